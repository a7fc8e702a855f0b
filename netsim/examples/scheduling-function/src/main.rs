//! The network simulator with one more scheduling function, as a program of its own.

use clap::Parser;
use netsim::catalogue::Catalogue;
use netsim::sim::Network;
use proto_host::{ServeArgs, serve_network};
use std::process::ExitCode;

/// Network simulator with the scheduling function "wandering-receiver"
#[derive(Parser)]
#[command(name = "my-netsim", version)]
struct Args {
    #[command(flatten)]
    serve: ServeArgs,
}

fn main() -> ExitCode {
    let mut catalogue = Catalogue::default();
    catalogue.scheduling_functions.add(&my_netsim::ENTRY);
    match serve_network(Network::with_catalogue(catalogue), &Args::parse().serve) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}
