//! The network simulator as a process of its own.

use clap::Parser;
use proto_host::{ServeArgs, serve_network};
use std::io::Write as _;
use std::process::ExitCode;

/// Network simulator of Murmuration: serves cosim.v1.NetSimService
#[derive(Parser)]
#[command(name = "netsim", version)]
struct Args {
    #[command(flatten)]
    serve: ServeArgs,
}

fn main() -> ExitCode {
    match serve_network(netsim::sim::Network::default(), &Args::parse().serve) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "error: {error}");
            ExitCode::from(2)
        }
    }
}
