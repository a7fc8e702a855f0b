//! The command line, under the name that users type.

use orchestrator::cli;
use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
