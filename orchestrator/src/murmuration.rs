//! The command line, under the name that users type. `main.rs` is the same under the name of the crate.

use orchestrator::cli;
use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
