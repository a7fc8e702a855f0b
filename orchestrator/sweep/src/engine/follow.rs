//! Follows the tasks of a sweep: shows how far the trials are, submits lost shards again, and returns once all shards are finished.

use super::command::CommandError;
use super::progress::Progress;
use super::stop::StopSignal;
use super::submission::{Submission, job_words};
use super::{BUILT_IN, Engine, EngineError, EngineWork, FOLDER, Queue, Task, TaskState};
use crate::SweepError;
use proto::bounds::COMMAND_BYTES;
use record::bounded::read_text_file;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};
use terminal::ProgressDisplay;

/// How often the engine is asked about its tasks: at first, and at most after long. In between, a twentieth of the time since the
/// beginning, so that short sweeps end soon and long ones do not burden the controller.
const ASK_EVERY: (Duration, Duration) = (Duration::from_secs(2), Duration::from_secs(30));
/// How often journals are read: likewise, at a hundredth.
const READ_EVERY: (Duration, Duration) = (Duration::from_secs(1), Duration::from_secs(10));
/// An engine that does not answer for so long is given up; its jobs go on.
const SILENCE: Duration = Duration::from_secs(30 * 60);
/// A task that ended well may be known to have ended before its journal arrives through a file system on the network.
const LATE_JOURNAL: Duration = Duration::from_secs(60);
/// A task that the engine does not know is lost if it is unknown so many times in a row.
const UNKNOWN_LIMIT: u32 = 2;
/// Most shards that a message lists.
const MOST_LISTED: usize = 10;

struct Follower<'a> {
    work: &'a EngineWork<'a>,
    queue: &'a dyn Queue,
    stop: StopSignal,
    submission: Submission,
    progress: Progress,
    display: ProgressDisplay,
    /// How often each shard was submitted again.
    n_resubmitted: BTreeMap<u32, u32>,
    /// How often in a row the task of a shard was unknown.
    n_unknown: BTreeMap<u32, u32>,
    /// When the task of a shard was first seen to have ended well.
    ended: BTreeMap<u32, Instant>,
    /// What the tasks were doing when the engine was last asked.
    activity: String,
    /// Whether the engine has been asked about tasks before. What it says the first time is of an earlier call of this program.
    is_first: bool,
}

/// Follows the shards until all are finished. `before`: what an earlier call submitted.
///
/// # Errors
///
/// See [`EngineError`].
pub(super) fn follow(
    work: &EngineWork<'_>,
    queue: &dyn Queue,
    before: Option<Submission>,
) -> Result<(), SweepError> {
    let stop = StopSignal::listen()?;
    let submission = Submission::of(work, before.clone());
    if let Some(other) = before.filter(|before| *before != submission) {
        refuse_running(work, &other, &stop)?;
    }
    let progress = Progress::read(work.plan, work.dir, work.n_shards)?;
    let mut follower = Follower {
        work,
        queue,
        stop,
        submission,
        progress,
        display: ProgressDisplay::new(work.plan.n_trials() as u64),
        n_resubmitted: BTreeMap::new(),
        n_unknown: BTreeMap::new(),
        ended: BTreeMap::new(),
        activity: String::new(),
        is_first: true,
    };
    let result = follower.run();
    follower.display.finish();
    result
}

/// Refuses to submit beside jobs of other trials, or of another engine, that still run in this folder.
fn refuse_running(
    work: &EngineWork<'_>,
    other: &Submission,
    stop: &StopSignal,
) -> Result<(), SweepError> {
    let engine = BUILT_IN.into_iter().find(|engine| engine.name() == other.engine);
    let title = engine.map_or("another engine", Engine::title);
    let Some((engine, queue)) = engine.and_then(|engine| Some((engine, engine.queue()?))) else {
        terminal::warn(format!(
            "{title} {} submitted for this folder before, and cannot be looked up; make sure that none of its tasks runs",
            other.job_words("was", "were")
        ));
        return Ok(());
    };
    let wanted: Vec<(String, u32)> = other
        .jobs
        .iter()
        .flat_map(|job| job.shards.iter().map(|&shard| (job.id.clone(), shard)))
        .collect();
    if wanted.is_empty() {
        return Ok(());
    }
    let tasks = queue.tasks(&wanted, stop).map_err(|error| EngineError::Submit { title, error })?;
    let is_active = |task: &&Task| matches!(task.state, TaskState::Pending | TaskState::Running);
    let mut jobs: Vec<String> =
        tasks.iter().filter(is_active).map(|task| task.job.clone()).collect();
    jobs.sort();
    jobs.dedup();
    if jobs.is_empty() {
        return Ok(());
    }
    let (words, cancel) = (job_words(&jobs, "is", "are"), engine.cancel_command(&jobs));
    Err(EngineError::AnotherSweep { dir: work.dir.to_owned(), title, jobs: words, cancel }.into())
}

impl Follower<'_> {
    fn run(&mut self) -> Result<(), SweepError> {
        let n_before = self.progress.n_done();
        let begun = Instant::now();
        let (mut answered, mut asked) = (begun, None::<Instant>);
        let mut is_silent = false;
        loop {
            self.progress.update()?;
            let done = self.progress.n_done();
            self.display.shards(done, self.n(), done - n_before, &self.activity);
            if self.progress.to_run().is_empty() {
                return Ok(());
            }
            if let Some(signal) = self.stop.signal() {
                return Err(self.interrupted(signal).into());
            }
            let ask_every = (begun.elapsed() / 20).clamp(ASK_EVERY.0, ASK_EVERY.1);
            if asked.is_none_or(|asked| ask_every <= asked.elapsed()) {
                match self.ask()? {
                    Ok(()) => {
                        answered = Instant::now();
                        is_silent = false;
                        self.is_first = false;
                    }
                    Err(CommandError::Stopped { .. }) => continue,
                    Err(error @ CommandError::Missing { .. }) => {
                        return Err(EngineError::Submit { title: self.title(), error }.into());
                    }
                    // Nothing runs yet that could go on without an answer.
                    Err(error) if self.submission.jobs.is_empty() => {
                        return Err(EngineError::Submit { title: self.title(), error }.into());
                    }
                    Err(error) if SILENCE <= answered.elapsed() => {
                        let minutes = answered.elapsed().as_secs() / 60;
                        let title = self.title();
                        return Err(EngineError::Silent { title, minutes, error }.into());
                    }
                    Err(error) => {
                        if !is_silent {
                            let title = self.title();
                            self.warn(&format!("{title} does not answer, trying again: {error}"));
                        }
                        is_silent = true;
                    }
                }
                asked = Some(Instant::now());
            }
            self.stop.wait((begun.elapsed() / 100).clamp(READ_EVERY.0, READ_EVERY.1));
        }
    }

    fn n(&self) -> u64 {
        self.work.plan.n_trials() as u64
    }

    fn title(&self) -> &'static str {
        self.work.engine().title()
    }

    fn warn(&self, text: &str) {
        self.display.aside(|| terminal::warn(text));
    }

    fn interrupted(&self, signal: &'static str) -> EngineError {
        let jobs = self.active_jobs();
        EngineError::Interrupted {
            signal,
            done: self.progress.n_done(),
            n: self.n(),
            title: self.title(),
            cancel: self.work.engine().cancel_command(&jobs),
            jobs: job_words(&jobs, "is", "are"),
        }
    }

    /// The latest jobs of shards that are not finished.
    fn active_jobs(&self) -> Vec<String> {
        let of_shards: Vec<&str> = self
            .progress
            .to_run()
            .into_iter()
            .filter_map(|shard| self.submission.job_of(shard))
            .collect();
        self.submission.ids().into_iter().filter(|id| of_shards.contains(&id.as_str())).collect()
    }

    /// Asks the engine what the tasks are doing, and submits shards that have none. The inner error: the engine does not answer.
    fn ask(&mut self) -> Result<Result<(), CommandError>, SweepError> {
        let wanted: Vec<(String, u32)> = self
            .progress
            .to_run()
            .into_iter()
            .filter_map(|shard| Some((self.submission.job_of(shard)?.to_owned(), shard)))
            .collect();
        let tasks = if wanted.is_empty() {
            Vec::new()
        } else {
            match self.queue.tasks(&wanted, &self.stop) {
                Ok(tasks) => tasks,
                Err(error) => return Ok(Err(error)),
            }
        };
        // What a task wrote before it ended.
        self.progress.update()?;
        let mut states: BTreeMap<u32, &Task> = BTreeMap::new();
        for task in &tasks {
            if self.submission.job_of(task.shard) == Some(&task.job) {
                states.insert(task.shard, task);
            }
        }
        self.activity = activity(states.values().copied());
        let (mut to_submit, mut lost, mut cancelled) = (Vec::new(), BTreeMap::new(), Vec::new());
        for shard in self.progress.to_run() {
            if self.submission.job_of(shard).is_none() {
                to_submit.push(shard);
                continue;
            }
            if let Some(task) = states.get(&shard) {
                self.n_unknown.remove(&shard);
                match task.state {
                    TaskState::Pending | TaskState::Running => continue,
                    TaskState::Cancelled if !self.is_first => {
                        cancelled.push(shard);
                        continue;
                    }
                    TaskState::Ended { .. } if !self.is_first => self.progress.settle(shard),
                    _ => {}
                }
                let since = *self.ended.entry(shard).or_insert_with(Instant::now);
                let is_success = task.state == TaskState::Ended { is_success: true };
                let is_late = is_success && since.elapsed() < LATE_JOURNAL && !self.is_first;
                if !self.progress.is_done(shard) && !is_late {
                    lost.insert(shard, task.words.clone());
                }
                continue;
            }
            let n_unknown = self.n_unknown.entry(shard).or_default();
            *n_unknown += 1;
            if UNKNOWN_LIMIT <= *n_unknown {
                lost.insert(shard, format!("{} no longer knows its task", self.title()));
            }
        }
        if !cancelled.is_empty() {
            return Err(EngineError::Cancelled {
                title: self.title(),
                shards: self.shard_words(&cancelled),
                done: self.progress.n_done(),
                n: self.n(),
            }
            .into());
        }
        self.check_losses(&lost)?;
        to_submit.extend(lost.keys());
        to_submit.sort_unstable();
        if to_submit.is_empty() { Ok(Ok(())) } else { self.submit(&to_submit, &lost) }
    }

    /// Fails if a shard was lost once more than it may be submitted again.
    fn check_losses(&self, lost: &BTreeMap<u32, String>) -> Result<(), EngineError> {
        let most = self.work.engine().max_resubmissions(self.work.plan);
        for (&shard, reason) in lost {
            let n_resubmitted = self.n_resubmitted.get(&shard).copied().unwrap_or(0);
            if self.is_first || n_resubmitted < most {
                continue;
            }
            return Err(EngineError::Lost {
                title: self.title(),
                shard: format!("{shard}/{}", self.work.n_shards),
                n_lost: n_resubmitted + 1,
                reason: reason.clone(),
                done: self.progress.n_done(),
                n: self.n(),
                log: self.log_words(shard),
            });
        }
        Ok(())
    }

    /// Where the log of the latest task of a shard is, and its last line.
    fn log_words(&self, shard: u32) -> String {
        let Some(job) = self.submission.job_of(shard) else { return String::new() };
        let name = format!("{}-{job}-{shard}.log", self.work.engine().name());
        let path = self.work.dir.join(FOLDER).join(name);
        let Ok(text) = read_text_file(&COMMAND_BYTES, &path) else { return String::new() };
        let last = text.lines().map(str::trim).rfind(|line| !line.is_empty());
        let last = last.unwrap_or("it is empty");
        format!("\nits log is {} and ends: {last}", path.display())
    }

    /// Submits shards. `lost`: why, for those that had a task.
    fn submit(
        &mut self,
        shards: &[u32],
        lost: &BTreeMap<u32, String>,
    ) -> Result<Result<(), CommandError>, SweepError> {
        let job = match self.work.submit(shards)? {
            Ok(job) => job,
            Err(error) => return Ok(Err(error)),
        };
        self.submission.add(job.clone(), shards);
        self.submission.write(&self.work.folder())?;
        let title = self.title();
        let most = self.work.engine().max_resubmissions(self.work.plan);
        for (shard, reason) in lost {
            self.ended.remove(shard);
            self.n_unknown.remove(shard);
            let shard_of = format!("{shard}/{}", self.work.n_shards);
            if self.is_first {
                self.warn(&format!(
                    "the earlier task of shard {shard_of} has ended: {reason}; submitted again as {title} job {job}"
                ));
                continue;
            }
            let n = self.n_resubmitted.entry(*shard).or_default();
            *n += 1;
            let n = *n;
            self.warn(&format!(
                "shard {shard_of} was lost: {reason}; submitted again as {title} job {job}, {n} of at most {most} times"
            ));
        }
        let n_new = shards.len() - lost.len();
        if n_new != 0 {
            let shards = numbers::format::count_of(u64::from(self.work.n_shards), "shard");
            let text = format!("{title} job {job}: {n_new} of {shards} submitted");
            self.display.aside(|| terminal::note(&text));
        }
        Ok(Ok(()))
    }

    fn shard_words(&self, shards: &[u32]) -> String {
        let of = self.work.n_shards;
        let mut words: Vec<String> =
            shards.iter().take(MOST_LISTED).map(|shard| format!("{shard}/{of}")).collect();
        if MOST_LISTED < shards.len() {
            words.push(format!("and {} more", shards.len() - MOST_LISTED));
        }
        let noun = if shards.len() == 1 { "shard" } else { "shards" };
        format!("{noun} {}", words.join(", "))
    }
}

/// How many tasks run and how many wait, and why.
fn activity<'a>(tasks: impl Iterator<Item = &'a Task>) -> String {
    let (mut n_running, mut waiting) = (0u64, BTreeMap::new());
    for task in tasks {
        match task.state {
            TaskState::Running => n_running += 1,
            TaskState::Pending => *waiting.entry(task.words.clone()).or_insert(0u64) += 1,
            TaskState::Ended { .. } | TaskState::Cancelled | TaskState::Lost => {}
        }
    }
    let waiting = waiting.into_iter().map(|(words, n)| format!("{n} {words}"));
    std::iter::once(format!("{n_running} tasks run")).chain(waiting).collect::<Vec<_>>().join(", ")
}
