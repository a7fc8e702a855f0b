//! The command line.

use orchestrator::cli;
use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
