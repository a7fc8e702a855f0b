//! Ctrl-C and SIGTERM while measurements are searched: fits under way are finished, and partial results are printed.

use super::{Failure, on_runtime};
use crate::console::warn;
use crate::run::interrupt::Interrupt;
use std::sync::atomic::{AtomicBool, Ordering};

static STOP: AtomicBool = AtomicBool::new(false);
/// As a shell reports an end by Ctrl-C.
const INTERRUPTED: i32 = 130;

/// Listens from now on. It becomes true with the first signal; a second one ends the process.
pub(super) fn listen() -> Result<&'static AtomicBool, Failure> {
    let work = || {
        let ended = on_runtime(async {
            let mut interrupt = Interrupt::listen();
            let name = interrupt.first().await;
            STOP.store(true, Ordering::Relaxed);
            warn(format!("{name}: finishing the current fits; press Ctrl-C again to abort"));
            interrupt.first().await;
        });
        if ended.is_ok() {
            std::process::exit(INTERRUPTED);
        }
    };
    std::thread::Builder::new().name("signals".to_owned()).spawn(work).map_err(Failure::work)?;
    Ok(&STOP)
}

/// Fails if a search was interrupted in the round `stopped`: its partial results were printed and written.
pub(super) fn require_complete(stopped: Option<usize>) -> Result<(), Failure> {
    stopped.map_or(Ok(()), |round| {
        Err(Failure::work(format!(
            "interrupted in round {round}: the search did not finish, and any results printed above are partial"
        )))
    })
}
