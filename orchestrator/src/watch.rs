//! `run --watch`: the swarm and its key figures in a terminal, while a run lasts.

mod picture;

use nix::sys::signal::{Signal, raise};
use ratatui::crossterm::event::{self, Event, KeyCode, KeyModifiers};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;
use view::live::LiveRun;
use view::view::ControlKind;

/// Time between two pictures.
const PICTURE_PERIOD: Duration = Duration::from_millis(100);
/// So many events are listed.
const N_EVENTS: usize = 12;

/// A terminal that shows a run, until this is dropped.
pub struct Watch {
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Watch {
    /// Takes the terminal over.
    ///
    /// # Errors
    ///
    /// Standard output is no terminal, or it cannot be drawn on.
    pub fn begin(run: Arc<LiveRun>) -> std::io::Result<Self> {
        let mut terminal = ratatui::try_init()?;
        let is_over = Arc::new(AtomicBool::new(false));
        run.add_viewer();
        let over = Arc::clone(&is_over);
        let thread = std::thread::Builder::new().name("watch".to_owned()).spawn(move || {
            while !over.load(Ordering::Relaxed) {
                let look = run.look(N_EVENTS);
                let drawn = terminal.draw(|frame| picture::draw(frame, &look));
                if drawn.is_err() || !goes_on(&run, look.status.paused) {
                    break;
                }
            }
            ratatui::restore();
        })?;
        Ok(Self { is_over, thread: Some(thread) })
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // The terminal is given back before anything else is written on it.
            let _ = thread.join();
        }
    }
}

/// Waits for the next picture, and does what keys ask for. Returns whether to go on drawing.
fn goes_on(run: &LiveRun, is_paused: bool) -> bool {
    if !event::poll(PICTURE_PERIOD).unwrap_or(false) {
        return true;
    }
    let Ok(Event::Key(key)) = event::read() else { return true };
    match key.code {
        // A terminal that is drawn on does not make a signal of it.
        KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => {
            ratatui::restore();
            let _ = raise(Signal::SIGINT);
            false
        }
        KeyCode::Char('q') => {
            // Nobody could resume a run that stays paused without a view.
            run.pace().control(ControlKind::Resume);
            false
        }
        KeyCode::Char(' ') => {
            let kind = if is_paused { ControlKind::Resume } else { ControlKind::Pause };
            run.pace().control(kind);
            true
        }
        KeyCode::Right => {
            run.pace().control(ControlKind::Step);
            true
        }
        _ => true,
    }
}
