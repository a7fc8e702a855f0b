//! Ctrl-C, SIGTERM and SIGHUP while jobs are followed.

use super::EngineError;
use run::interrupt::on_signal;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

/// Whether someone said stop.
#[derive(Clone, Debug, Default)]
pub(crate) struct StopSignal {
    state: Arc<(Mutex<Option<&'static str>>, Condvar)>,
}

impl StopSignal {
    /// Listens from now on. A second signal ends the process.
    pub(super) fn listen() -> Result<Self, EngineError> {
        let stop = Self::default();
        let heard = stop.clone();
        on_signal(move |signal| heard.set(signal))?;
        Ok(stop)
    }

    fn set(&self, signal: &'static str) {
        let (state, changed) = &*self.state;
        *state.lock().unwrap_or_else(PoisonError::into_inner) = Some(signal);
        changed.notify_all();
    }

    /// The signal, if there was one.
    pub(super) fn signal(&self) -> Option<&'static str> {
        *self.state.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for so long, or until someone says stop.
    pub(super) fn wait(&self, longest: Duration) {
        let (state, changed) = &*self.state;
        let guard = state.lock().unwrap_or_else(PoisonError::into_inner);
        let _ = changed.wait_timeout_while(guard, longest, |signal| signal.is_none());
    }
}
