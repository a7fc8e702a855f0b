//! A run that was recorded: frames of any span, and an overview that is read in the background.

use crate::frame::FrameBuilder;
use crate::overview::OverviewBuilder;
use crate::place::add_effects;
use crate::run::run_of;
use crate::view;
use bytes::Bytes;
use metrics::period::Period;
use prost::Message as _;
use proto::exchange::Configured;
use proto::types::{Coupling, MovedObstacle};
use record::periods::Periods;
use record::random_access::Recording;
use record::read::ReadError;
use record::result::{ResultError, ResultFolder};
use record::run_summary::RunSummary;
use record::{LOG_FILE, StepRecord};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A reply holds at most so many frames.
pub const MOST_FRAMES: usize = 2000;
/// A reply ends with the frame with which it has so many bytes.
const MOST_BYTES: usize = 64 << 20;
/// If more steps lie between two frames, only the last of them is read.
const MOST_BETWEEN: u64 = 50;
/// How often the overview is made anew while the recording is read.
const REFRESH: Duration = Duration::from_millis(500);

/// A recorded run.
pub struct RecordedRun {
    folder: ResultFolder,
    recording: Recording,
    run: view::Run,
    scan: Mutex<Scan>,
}

/// What is known of the whole recording.
#[derive(Default)]
struct Scan {
    /// The overview, encoded.
    overview: Bytes,
    /// Of each obstacle that has moved: the ends of the steps in which it did (ns), ascending, and where it was then (m).
    moved: BTreeMap<String, Vec<(u64, [f64; 2])>>,
    /// Why it could not be read to its end.
    failure: Option<String>,
}

impl RecordedRun {
    /// Opens the recording of a run.
    ///
    /// # Errors
    ///
    /// No such file, not a complete recording, or one that was changed.
    pub fn open(folder: &ResultFolder) -> Result<Self, ReadError> {
        let recording = Recording::of(folder)?;
        let name = folder.path().file_name().map(|name| name.to_string_lossy().into_owned());
        let configured = run_of(&name.unwrap_or_default(), recording.configured());
        let run = view::Run {
            // A run that started from a formed network was configured with the seed with which that had formed.
            seed: seed_of(folder)?.unwrap_or(configured.seed),
            end_ns: recording.end_ns(),
            step_count: recording.n_steps(),
            ..configured
        };
        Ok(Self { folder: folder.clone(), recording, run, scan: Mutex::default() })
    }

    /// Draws the places of effects that were estimated from measurements, each as a table of the configuration.
    pub fn add_estimates(&mut self, effects: &[toml::Table]) {
        let place = self.run.place.get_or_insert_default();
        add_effects(place, effects, view::ObstacleKind::Estimated);
    }

    /// With the name of the experiment in place of that of its folder.
    #[must_use]
    pub fn named(mut self, name: &str) -> Self {
        name.clone_into(&mut self.run.name);
        self
    }

    /// What it is.
    #[must_use]
    pub fn run(&self) -> &view::Run {
        &self.run
    }

    /// How both sides were configured.
    #[must_use]
    pub fn configured(&self) -> &Configured {
        self.recording.configured()
    }

    fn coupling(&self) -> Coupling {
        self.configured().robots_request.experiment.coupling
    }

    /// Reads the whole recording in a thread, for its overview. If that fails, the page is told when it asks, and `tell` at once.
    pub fn read_in_background(self: &Arc<Self>, tell: impl FnOnce(&str) + Send + 'static) {
        let run = Arc::clone(self);
        // Without the thread there is no overview: the page says how far it reaches.
        let _ = std::thread::Builder::new().name("overview".to_owned()).spawn(move || {
            if let Err(error) = run.read_overview() {
                let failure = error.to_string();
                tell(&failure);
                run.scan.lock().unwrap_or_else(PoisonError::into_inner).failure = Some(failure);
            }
        });
    }

    /// The overview as far as the recording was read, encoded.
    ///
    /// # Errors
    ///
    /// The recording is damaged.
    pub fn overview(&self) -> Result<Bytes, String> {
        let scan = self.scan.lock().unwrap_or_else(PoisonError::into_inner);
        match &scan.failure {
            Some(failure) => Err(failure.clone()),
            None => Ok(scan.overview.clone()),
        }
    }

    fn read_overview(&self) -> Result<(), ReadError> {
        let mut overview = OverviewBuilder::new(self.configured());
        let states = self.configured().robots_start.states.clone();
        let mut periods = Periods::new(self.coupling(), states);
        let mut steps = self.recording.steps(0, u64::MAX)?;
        let mut refreshed = Instant::now();
        while let Some(record) = steps.next_step()? {
            periods.next(&record, |period| overview.add(&record, period));
            if !record.robots.moved_obstacles.is_empty() {
                let mut scan = self.scan.lock().unwrap_or_else(PoisonError::into_inner);
                for MovedObstacle { name, centre_m } in &record.robots.moved_obstacles {
                    let moves = scan.moved.entry(name.clone()).or_default();
                    moves.push((record.time_ns, *centre_m));
                }
            }
            if REFRESH < refreshed.elapsed() {
                self.publish(&overview.overview(false));
                refreshed = Instant::now();
            }
        }
        // What no step needed. The page asks no more once the overview is complete.
        self.folder.check(LOG_FILE).map_err(unbelieved)?;
        self.publish(&overview.overview(true));
        Ok(())
    }

    fn publish(&self, overview: &view::Overview) {
        let encoded = Bytes::from(overview.encode_to_vec());
        self.scan.lock().unwrap_or_else(PoisonError::into_inner).overview = encoded;
    }

    /// The frame at `from_ns` (the last one not after it), and at most `most` frames after it until `until_ns`, evenly spaced in steps.
    ///
    /// # Errors
    ///
    /// The recording is damaged.
    pub fn frames(
        &self,
        from_ns: u64,
        until_ns: u64,
        most: usize,
    ) -> Result<Vec<view::Frame>, ReadError> {
        let most = most.min(MOST_FRAMES) as u64;
        let mut reader = FrameReader::at(self, from_ns)?;
        let mut frames = vec![reader.frame.clone()];
        let until_ns = until_ns.min(self.run.end_ns);
        if most == 0 || until_ns <= from_ns {
            return Ok(frames);
        }
        let span = u128::from(until_ns - from_ns) * u128::from(self.run.step_count);
        let n_steps = (span / u128::from(self.run.end_ns.max(1))) as u64;
        let stride = n_steps.div_ceil(most).max(1);
        let mut n_bytes = frames[0].encoded_len();
        if stride <= MOST_BETWEEN {
            let mut steps = self.recording.steps(reader.periods.time_ns(), until_ns)?;
            while let Some(record) = steps.next_step()? {
                let is_wanted = record.step.is_multiple_of(stride) || until_ns <= record.time_ns;
                if let Some(frame) = reader.add(&record, is_wanted, |_| {}) {
                    n_bytes += frame.encoded_len();
                    frames.push(frame);
                    if MOST_BYTES < n_bytes {
                        break;
                    }
                }
            }
        } else {
            for number in 1..=most {
                let part = u128::from(until_ns - from_ns) * u128::from(number) / u128::from(most);
                let frame = FrameReader::at(self, from_ns + part as u64)?.frame;
                n_bytes += frame.encoded_len();
                if frames.last().is_some_and(|last| last.step < frame.step) {
                    frames.push(frame);
                }
                if MOST_BYTES < n_bytes {
                    break;
                }
            }
        }
        Ok(frames)
    }

    /// Obstacles that move until `until_ns`, each with the end of the step in which it does (ns), in the order of time. Reads the
    /// recording from its beginning, unless no obstacle has a name, by which it could be moved.
    ///
    /// # Errors
    ///
    /// The recording is damaged.
    pub fn moved_obstacles(&self, until_ns: u64) -> Result<Vec<(u64, MovedObstacle)>, ReadError> {
        let obstacles = self.run.place.iter().flat_map(|place| &place.obstacles);
        if obstacles.clone().all(|obstacle| obstacle.name.is_empty()) {
            return Ok(Vec::new());
        }
        let mut moved = Vec::new();
        let mut steps = self.recording.steps(0, until_ns)?;
        while let Some(StepRecord { time_ns, robots, .. }) = steps.next_step()? {
            let obstacles = robots.moved_obstacles.iter().cloned();
            moved.extend(obstacles.map(|obstacle| (time_ns, obstacle)));
        }
        Ok(moved)
    }

    /// All frames, one of every `stride` steps, each given to `take` until that returns false. The overview follows.
    ///
    /// # Errors
    ///
    /// The recording is damaged.
    pub(crate) fn all_frames(
        &self,
        stride: u64,
        mut take: impl FnMut(&view::Frame) -> bool,
    ) -> Result<view::Overview, ReadError> {
        let mut overview = OverviewBuilder::new(self.configured());
        let mut reader = FrameReader::at(self, 0)?;
        if !take(&reader.frame) {
            return Ok(overview.overview(false));
        }
        let mut steps = self.recording.steps(0, u64::MAX)?;
        while let Some(record) = steps.next_step()? {
            let is_wanted =
                record.step.is_multiple_of(stride) || record.step == self.run.step_count;
            let frame = reader.add(&record, is_wanted, |period| overview.add(&record, period));
            if frame.is_some_and(|frame| !take(&frame)) {
                return Ok(overview.overview(false));
            }
        }
        Ok(overview.overview(true))
    }

    /// Where obstacles are that have moved until then (m), as far as the recording was read.
    fn moved_until(&self, time_ns: u64) -> BTreeMap<String, [f64; 2]> {
        let scan = self.scan.lock().unwrap_or_else(PoisonError::into_inner);
        let last = |(name, moves): (&String, &Vec<(u64, [f64; 2])>)| {
            let n_before = moves.partition_point(|(moved_ns, _)| *moved_ns <= time_ns);
            Some((name.clone(), moves[n_before.checked_sub(1)?].1))
        };
        scan.moved.iter().filter_map(last).collect()
    }
}

fn unbelieved(error: ResultError) -> ReadError {
    ReadError::Unbelieved { source: Box::new(error) }
}

/// The seed of a run in its summary; none where it has none yet, as while it is written.
fn seed_of(folder: &ResultFolder) -> Result<Option<u64>, ReadError> {
    if !folder.has(RunSummary::FILE) {
        return Ok(None);
    }
    RunSummary::of(folder).map(|summary| Some(summary.seed)).map_err(unbelieved)
}

/// Makes frames of steps that follow each other.
struct FrameReader {
    periods: Periods,
    builder: FrameBuilder,
    frame: view::Frame,
}

impl FrameReader {
    /// Begins with the last frame that is not after `time_ns`.
    fn at(run: &RecordedRun, time_ns: u64) -> Result<Self, ReadError> {
        let coupling = run.coupling();
        let start = &run.configured().robots_start.states;
        // Steps may be longer than the nominal period, so the span in which one must end is widened until one is found.
        let mut before_ns = run.run.step_ns.saturating_mul(3);
        loop {
            let after_ns = time_ns.saturating_sub(before_ns);
            let mut steps = run.recording.steps(after_ns, time_ns)?;
            let mut last: [Option<StepRecord>; 2] = [None, None];
            while let Some(record) = steps.next_step()? {
                last = [last[1].take(), Some(record)];
            }
            match last {
                [before, Some(record)] if before.is_some() || record.step == 1 => {
                    let mut periods = before.map_or_else(
                        || Periods::new(coupling, start.clone()),
                        |before| Periods::after(coupling, before.robots, before.time_ns),
                    );
                    let moved = run.moved_until(record.time_ns);
                    let mut builder =
                        FrameBuilder::after(coupling, periods.time_ns()).with_moved(moved);
                    let frame = periods.next(&record, |period| {
                        builder.add(period);
                        builder.take(&record)
                    });
                    return Ok(Self { periods, builder, frame });
                }
                [_, None] if after_ns == 0 => {
                    return Ok(Self {
                        periods: Periods::new(coupling, start.clone()),
                        builder: FrameBuilder::new(coupling),
                        frame: view::Frame {
                            motes: run.configured().network_start.motes.clone().map(Into::into),
                            formation: run
                                .configured()
                                .network_start
                                .formation
                                .clone()
                                .map(Into::into),
                            ..FrameBuilder::start(start)
                        },
                    });
                }
                _ => before_ns = before_ns.saturating_mul(4),
            }
        }
    }

    /// Adds a step, whose period `look` is given, too. Returns its frame, if it is wanted.
    fn add(
        &mut self,
        record: &StepRecord,
        is_wanted: bool,
        look: impl FnOnce(&Period<'_>),
    ) -> Option<view::Frame> {
        let Self { periods, builder, .. } = self;
        periods.next(record, |period| {
            look(period);
            builder.add(period);
            is_wanted.then(|| builder.take(record))
        })
    }
}
