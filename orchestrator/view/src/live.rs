//! A run that lasts: what viewers are sent while it is made.
//!
//! The run hands its steps to a thread by a bounded queue and never waits for it. Frames are made at the pace at which people can see
//! them; a viewer that is slow skips frames, and a queue that is full skips steps. Neither skips events of robots and motes, which are
//! found by comparing states.

use crate::frame::FrameBuilder;
use crate::overview::{Additions, OverviewBuilder};
use crate::run::run_of;
use crate::series::Figures;
use crate::view;
use bytes::Bytes;
use metrics::Task;
use prost::Message as _;
use proto::exchange::Configured;
use proto::types::seconds;
use record::StepRecord;
use record::periods::Periods;
use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::watch;

/// The queue holds so many steps.
const MOST_WAITING: usize = 1024;
/// Time between frames with viewers, and without.
const FRAME_PERIOD: Duration = Duration::from_millis(33);
const UNWATCHED_PERIOD: Duration = Duration::from_millis(500);
/// Time between additions to the overview.
const ADDED_PERIOD: Duration = Duration::from_millis(100);
/// So many messages with additions are kept for slow viewers: an hour of them.
const MOST_ADDED: usize = 36_000;
/// Frames for looking back are kept up to so many bytes.
const MOST_KEPT_BYTES: usize = 64 << 20;
/// Over how much time the speed is taken.
const SPEED_PERIOD: Duration = Duration::from_secs(1);

/// A run that lasts, as its server sees it.
pub struct LiveRun {
    state: Mutex<State>,
    changed: watch::Sender<u64>,
    pace: Arc<Pace>,
}

/// What the thread makes.
struct State {
    run: view::Run,
    overview: OverviewBuilder,
    pending: Additions,
    /// Encoded additions to the overview, and how many were dropped before them.
    added: VecDeque<Bytes>,
    n_dropped: usize,
    latest: Option<Arc<KeptFrame>>,
    kept: VecDeque<Arc<KeptFrame>>,
    n_kept_bytes: usize,
    reached_ns: u64,
    speed: f64,
    n_viewers: usize,
    ended: bool,
}

/// A frame.
pub(crate) struct KeptFrame {
    pub(crate) frame: view::Frame,
    n_bytes: usize,
    /// When its step had been taken.
    taken: Instant,
}

/// Whether the run may go on.
pub struct Pace {
    state: Mutex<PaceState>,
}

struct PaceState {
    paused: bool,
    steps_left: u64,
    /// Simulated seconds per second, at most.
    most_speed: Option<f64>,
    /// Since when that holds, and the simulated time then (ns).
    since: Option<(Instant, u64)>,
}

impl Pace {
    /// A run that takes at most so many simulated seconds per second; `None`: as fast as it can.
    #[must_use]
    pub fn new(most_speed: Option<f64>) -> Self {
        let state = PaceState { paused: false, steps_left: 0, most_speed, since: None };
        Self { state: Mutex::new(state) }
    }

    /// Whether the run may take a step now, having reached `time_ns`.
    pub fn may_step(&self, time_ns: u64) -> bool {
        let mut state = self.lock();
        if state.paused {
            let may = 0 < state.steps_left;
            state.steps_left = state.steps_left.saturating_sub(1);
            return may;
        }
        let Some(most_speed) = state.most_speed else { return true };
        let (since, since_ns) = *state.since.get_or_insert_with(|| (Instant::now(), time_ns));
        seconds(time_ns - since_ns) <= since.elapsed().as_secs_f64() * most_speed
    }

    /// Whether the next step has to wait for a viewer.
    #[must_use]
    pub fn is_paused(&self) -> bool {
        let state = self.lock();
        state.paused && state.steps_left == 0
    }

    /// Does what a viewer asks.
    pub fn control(&self, kind: view::ControlKind) {
        let mut state = self.lock();
        match kind {
            view::ControlKind::Unspecified => return,
            view::ControlKind::Pause => (state.paused, state.steps_left) = (true, 0),
            view::ControlKind::Resume => (state.paused, state.steps_left) = (false, 0),
            view::ControlKind::Step => {
                state.paused = true;
                state.steps_left += 1;
            }
        }
        state.since = None;
    }

    fn lock(&self) -> MutexGuard<'_, PaceState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The run's end of a [`LiveRun`].
pub struct LiveFeed {
    steps: SyncSender<(StepRecord, Instant)>,
    pace: Arc<Pace>,
    /// The latest step shown: a run that goes on from a checkpoint takes some steps again.
    latest: u64,
}

impl LiveFeed {
    /// Whether the run may take a step now, having reached `time_ns`.
    #[must_use]
    pub fn may_step(&self, time_ns: u64) -> bool {
        self.pace.may_step(time_ns)
    }

    /// Shows a step. Never waits: if the viewers' side is far behind, the step is skipped.
    pub fn step(&mut self, record: &StepRecord) {
        if record.step <= self.latest {
            return;
        }
        self.latest = record.step;
        // Full, or nobody is there any more: neither concerns the run.
        let _ = self.steps.try_send((record.clone(), Instant::now()));
    }
}

impl LiveRun {
    /// Begins with both sides configured. The run feeds it until the feed is dropped.
    ///
    /// # Errors
    ///
    /// The system has no thread for it.
    pub fn begin(
        name: &str,
        configured: &Configured,
        pace: Arc<Pace>,
        controllable: bool,
    ) -> std::io::Result<(Arc<Self>, LiveFeed)> {
        let run = view::Run { live: true, controllable, ..run_of(name, configured) };
        let state = State {
            run,
            overview: OverviewBuilder::new(configured),
            pending: Additions::default(),
            added: VecDeque::new(),
            n_dropped: 0,
            latest: None,
            kept: VecDeque::new(),
            n_kept_bytes: 0,
            reached_ns: 0,
            speed: 0.0,
            n_viewers: 0,
            ended: false,
        };
        let live = Arc::new(Self {
            state: Mutex::new(state),
            changed: watch::Sender::new(0),
            pace: Arc::clone(&pace),
        });
        let (steps, inbox) = sync_channel(MOST_WAITING);
        let maker = Maker::new(Arc::clone(&live), configured);
        std::thread::Builder::new()
            .name("live view".to_owned())
            .spawn(move || maker.serve(&inbox))?;
        Ok((live, LiveFeed { steps, pace, latest: 0 }))
    }

    /// What it is.
    pub(crate) fn run(&self) -> view::Run {
        self.lock().run.clone()
    }

    /// Whether the run has ended.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.lock().ended
    }

    /// The overview so far.
    pub(crate) fn overview(&self) -> view::Overview {
        self.lock().overview.overview(false)
    }

    /// What is allowed to viewers.
    #[must_use]
    pub fn pace(&self) -> &Pace {
        &self.pace
    }

    /// The frame at `from_ns`, and at most `most` frames after it until `until_ns`, of those that are kept.
    pub(crate) fn frames(&self, from_ns: u64, until_ns: u64, most: usize) -> Vec<view::Frame> {
        let state = self.lock();
        let first = state.kept.partition_point(|kept| kept.frame.time_ns <= from_ns);
        let end = state.kept.partition_point(|kept| kept.frame.time_ns <= until_ns);
        let begin = first.saturating_sub(1);
        let stride = end.saturating_sub(first).div_ceil(most.max(1)).max(1);
        let wanted = (begin..end).filter(|index| (index - begin).is_multiple_of(stride));
        wanted.map(|index| state.kept[index].frame.clone()).collect()
    }

    /// A viewer that follows the run from now on.
    pub(crate) fn viewer(self: &Arc<Self>) -> Viewer {
        let mut state = self.lock();
        state.n_viewers += 1;
        state.publish_added();
        let first = state.overview.overview(false);
        let n_added = state.n_dropped + state.added.len();
        drop(state);
        Viewer {
            live: Arc::clone(self),
            changed: self.changed.subscribe(),
            first: Some(first),
            n_added,
            step: None,
            ended: false,
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Someone who follows a run.
pub(crate) struct Viewer {
    live: Arc<LiveRun>,
    changed: watch::Receiver<u64>,
    first: Option<view::Overview>,
    n_added: usize,
    step: Option<u64>,
    ended: bool,
}

impl Viewer {
    /// The next message, with its length before it, as soon as there is something to say; `None` after the run's end.
    pub(crate) async fn next(&mut self) -> Option<Bytes> {
        if self.ended {
            return None;
        }
        if self.first.is_none() {
            // Even if nothing happens, a message now and then shows that the run is paused, and finds viewers that are gone.
            let _ = tokio::time::timeout(Duration::from_secs(1), self.changed.changed()).await;
        }
        self.changed.borrow_and_update();
        let (added, latest, mut status) = {
            let state = self.live.lock();
            // A viewer that is further behind than additions are kept has to begin again.
            let from = self.n_added.checked_sub(state.n_dropped)?;
            let added: Vec<Bytes> = state.added.iter().skip(from).cloned().collect();
            self.n_added = state.n_dropped + state.added.len();
            let latest = state.latest.clone();
            (added, latest, state.status(&self.live.pace))
        };
        self.ended = status.ended;
        let latest = latest.filter(|latest| self.step.is_none_or(|step| step < latest.frame.step));
        match &latest {
            Some(latest) => self.step = Some(latest.frame.step),
            // Nothing is newer than what the viewer has.
            None => status.lag_s = 0.0,
        }
        let first = self.first.take();
        let message = view::Live {
            frame: latest.map(|latest| latest.frame.clone()),
            added: first,
            status: Some(status),
        };
        let mut bytes = message.encode_to_vec();
        for added in added {
            // A message that is there twice is merged: its repeated fields are appended.
            prost::encoding::bytes::encode(ADDED_FIELD, &added, &mut bytes);
        }
        let mut framed = Vec::with_capacity(bytes.len() + 10);
        prost::encoding::encode_varint(bytes.len() as u64, &mut framed);
        framed.extend_from_slice(&bytes);
        Some(framed.into())
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        self.live.lock().n_viewers -= 1;
    }
}

/// Number of the field `Live.added`.
const ADDED_FIELD: u32 = 2;

/// The thread: makes frames of steps.
struct Maker {
    live: Arc<LiveRun>,
    task: Task,
    periods: Periods,
    builder: FrameBuilder,
    /// The latest step, if no frame was made of it, and when it had been taken.
    unshown: Option<(StepRecord, Instant)>,
    last_frame: Instant,
    last_added: Instant,
    speed_since: (Instant, u64),
}

impl Maker {
    fn new(live: Arc<LiveRun>, configured: &Configured) -> Self {
        let coupling = configured.robots_request.experiment.coupling;
        let states = configured.robots_start.states.clone();
        let now = Instant::now();
        Self {
            live,
            task: Task::from_config(&configured.robots_start.effective_toml),
            periods: Periods::new(coupling, states),
            builder: FrameBuilder::new(coupling),
            unshown: None,
            last_frame: now - UNWATCHED_PERIOD,
            last_added: now,
            speed_since: (now, 0),
        }
    }

    fn serve(mut self, inbox: &Receiver<(StepRecord, Instant)>) {
        loop {
            match inbox.recv_timeout(ADDED_PERIOD) {
                Ok((record, taken)) => self.step(record, taken),
                Err(RecvTimeoutError::Timeout) => {
                    // The run waits: what it came to is shown.
                    self.show_latest();
                    self.publish_added();
                }
                Err(RecvTimeoutError::Disconnected) => break,
            }
        }
        self.show_latest();
        self.publish_added();
        self.live.lock().ended = true;
        self.live.changed.send_modify(|number| *number += 1);
    }

    fn step(&mut self, record: StepRecord, taken: Instant) {
        let Self { live, task, periods, builder, last_frame, .. } = self;
        let is_due = periods.next(&record, |period| {
            builder.add(period);
            let figures = Figures::of(task, &record, period);
            let mut state = live.lock();
            state.overview.add_with(&record, period, &figures);
            state.pending.add(&figures);
            state.reached_ns = period.time_ns;
            let due = if state.n_viewers == 0 { UNWATCHED_PERIOD } else { FRAME_PERIOD };
            due <= last_frame.elapsed()
        });
        self.unshown = Some((record, taken));
        if is_due {
            self.show_latest();
        }
        if ADDED_PERIOD <= self.last_added.elapsed() {
            self.publish_added();
        }
    }

    /// Makes a frame of the latest step, if there is none yet.
    fn show_latest(&mut self) {
        let Some((record, taken)) = self.unshown.take() else { return };
        self.last_frame = Instant::now();
        let frame = self.builder.take(&record);
        self.live.lock().keep(frame, taken);
        self.live.changed.send_modify(|number| *number += 1);
    }

    fn publish_added(&mut self) {
        let mut state = self.live.lock();
        let (since, since_ns) = self.speed_since;
        if SPEED_PERIOD <= since.elapsed() {
            let simulated_s = seconds(state.reached_ns.saturating_sub(since_ns));
            state.speed = simulated_s / since.elapsed().as_secs_f64();
            self.speed_since = (Instant::now(), state.reached_ns);
        }
        self.last_added = Instant::now();
        let has_more = state.publish_added();
        drop(state);
        if has_more {
            self.live.changed.send_modify(|number| *number += 1);
        }
    }
}

impl State {
    fn status(&self, pace: &Pace) -> view::LiveStatus {
        let latest = self.latest.as_ref();
        view::LiveStatus {
            reached_ns: self.reached_ns,
            lag_s: latest.map_or(0.0, |latest| latest.taken.elapsed().as_secs_f64()),
            speed: self.speed,
            paused: pace.is_paused(),
            ended: self.ended,
        }
    }

    /// Makes a message of what was added to the overview. Returns whether there was anything.
    fn publish_added(&mut self) -> bool {
        let Some(added) = self.pending.take(&self.overview) else { return false };
        if self.n_viewers == 0 {
            // Whoever comes is first sent all so far.
            self.n_dropped += self.added.len() + 1;
            self.added.clear();
            return true;
        }
        self.added.push_back(added.encode_to_vec().into());
        if MOST_ADDED < self.added.len() {
            self.added.pop_front();
            self.n_dropped += 1;
        }
        true
    }

    fn keep(&mut self, frame: view::Frame, taken: Instant) {
        let n_bytes = frame.encoded_len();
        let kept = Arc::new(KeptFrame { frame, n_bytes, taken });
        self.latest = Some(Arc::clone(&kept));
        self.kept.push_back(kept);
        self.n_kept_bytes += n_bytes;
        while MOST_KEPT_BYTES < self.n_kept_bytes {
            let Some(oldest) = self.kept.pop_front() else { break };
            self.n_kept_bytes -= oldest.n_bytes;
        }
    }
}
