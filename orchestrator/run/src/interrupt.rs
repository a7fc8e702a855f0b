//! Ctrl-C, SIGTERM and SIGHUP: the step under way is finished, what was recorded is kept.

use drive::Interrupts;
use proto_host::ignores_hangup;
use std::time::Duration;
use tokio::signal::unix::{Signal, SignalKind, signal};

/// How long the step under way may still take after someone said stop.
const PATIENCE: Duration = Duration::from_secs(5);

/// Listens for these signals; for SIGHUP unless the process was started to ignore it.
pub struct Interrupt {
    interrupt: Option<Signal>,
    terminate: Option<Signal>,
    hang_up: Option<Signal>,
    seen: Option<&'static str>,
}

impl Interrupt {
    /// Listens from now on. Within a runtime only.
    #[must_use]
    pub fn listen() -> Self {
        // With nohup a run outlives the session that started it.
        let hang_up = if ignores_hangup() { None } else { signal(SignalKind::hangup()).ok() };
        Self {
            interrupt: signal(SignalKind::interrupt()).ok(),
            terminate: signal(SignalKind::terminate()).ok(),
            hang_up,
            seen: None,
        }
    }

    /// Completes when a signal comes.
    pub async fn first(&mut self) -> &'static str {
        let name = self.next().await;
        self.seen = Some(name);
        name
    }

    async fn next(&mut self) -> &'static str {
        tokio::select! {
            () = recv(&mut self.interrupt) => "SIGINT",
            () = recv(&mut self.terminate) => "SIGTERM",
            () = recv(&mut self.hang_up) => "SIGHUP",
        }
    }
}

/// As a shell reports an end by Ctrl-C.
const INTERRUPTED: i32 = 130;

/// Calls `act` with the first signal, in a thread of its own. A second signal ends the process.
///
/// # Errors
///
/// The thread cannot be started.
pub fn on_signal(act: impl FnOnce(&'static str) + Send + 'static) -> std::io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    // Signals are heard from here on, not only once the thread runs.
    let mut interrupt = {
        let _guard = runtime.enter();
        Interrupt::listen()
    };
    let listen = move || {
        runtime.block_on(async {
            act(interrupt.first().await);
            interrupt.first().await;
        });
        std::process::exit(INTERRUPTED);
    };
    std::thread::Builder::new().name("signals".to_owned()).spawn(listen).map(|_| ())
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
        let _ = tokio::time::timeout(PATIENCE, self.next()).await;
        self.seen.unwrap_or("a signal")
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
