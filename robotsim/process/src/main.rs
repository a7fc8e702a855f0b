//! The robot simulator as a process of its own.

use clap::Parser;
use proto_host::{ServeArgs, serve_robots};
use std::io::Write as _;
use std::process::ExitCode;

/// Robot simulator of Murmuration: serves cosim.v1.RobotSimService
#[derive(Parser)]
#[command(name = "robotsim", version)]
struct Args {
    #[command(flatten)]
    serve: ServeArgs,
}

fn main() -> ExitCode {
    match serve_robots(robotsim::sim::Swarm::default(), &Args::parse().serve) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "error: {error}");
            ExitCode::from(2)
        }
    }
}
