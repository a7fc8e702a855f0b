//! Where the work of runs is compiled.
//!
//! The crate that polls a future compiles it, with everything generic in it: the loop of steps, the client and the server of gRPC.
//! The crate of the commands is not optimised, so futures are polled here.

use proto_host::{ServeArgs, ServeError};
use std::pin::Pin;

/// A future whose code is compiled where it was made.
pub type Work<'a, T> = Pin<Box<dyn Future<Output = T> + 'a>>;

/// Does the work on a runtime of this thread, which it starts.
///
/// # Errors
///
/// The runtime cannot be started.
pub fn on_runtime<'a, T: 'a>(work: impl Future<Output = T> + 'a) -> std::io::Result<T> {
    let mut result = None;
    block_on(Box::pin(async { result = Some(work.await) }))?;
    Ok(result.expect("the work was done"))
}

fn block_on(work: Work<'_, ()>) -> std::io::Result<()> {
    tokio::runtime::Builder::new_current_thread().enable_all().build()?.block_on(work);
    Ok(())
}

/// Serves the built-in network simulator until a signal ends it.
///
/// # Errors
///
/// See [`ServeError`].
pub fn serve_network(args: &ServeArgs) -> Result<(), ServeError> {
    proto_host::serve_network(netsim::sim::Network::default(), args)
}

/// Serves the built-in robot simulator until a signal ends it.
///
/// # Errors
///
/// See [`ServeError`].
pub fn serve_robots(args: &ServeArgs) -> Result<(), ServeError> {
    proto_host::serve_robots(robotsim::sim::Swarm::default(), args)
}
