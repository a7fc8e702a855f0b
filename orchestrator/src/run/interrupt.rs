//! Ctrl-C and SIGTERM: the step under way is finished, what was recorded is kept.

use drive::Interrupts;
use std::time::Duration;
use tokio::signal::unix::{Signal, SignalKind, signal};

/// How long the step under way may still take after someone said stop.
const PATIENCE: Duration = Duration::from_secs(5);

/// Listens for both signals.
pub(crate) struct Interrupt {
    interrupt: Option<Signal>,
    terminate: Option<Signal>,
    seen: Option<&'static str>,
}

impl Interrupt {
    pub(crate) fn listen() -> Self {
        Self {
            interrupt: signal(SignalKind::interrupt()).ok(),
            terminate: signal(SignalKind::terminate()).ok(),
            seen: None,
        }
    }

    /// Completes when a signal comes.
    pub(crate) async fn first(&mut self) -> &'static str {
        let name = next(&mut self.interrupt, &mut self.terminate).await;
        self.seen = Some(name);
        name
    }
}

impl Interrupts for Interrupt {
    fn seen(&self) -> Option<&'static str> {
        self.seen
    }

    /// A while after the signal, or with the second one.
    async fn lasting(&mut self) -> &'static str {
        if self.seen.is_none() {
            self.first().await;
        }
        let second = next(&mut self.interrupt, &mut self.terminate);
        let _ = tokio::time::timeout(PATIENCE, second).await;
        self.seen.unwrap_or("a signal")
    }
}

async fn next(interrupt: &mut Option<Signal>, terminate: &mut Option<Signal>) -> &'static str {
    tokio::select! {
        () = recv(interrupt) => "SIGINT",
        () = recv(terminate) => "SIGTERM",
    }
}

async fn recv(signal: &mut Option<Signal>) {
    match signal {
        Some(signal) => {
            signal.recv().await;
        }
        None => std::future::pending().await,
    }
}
