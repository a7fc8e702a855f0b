//! Runs to which something happens, and what became of each.
//!
//! A run is drawn from a seed and its number: an experiment, which sides run elsewhere, what happens, to whom and when. It must end
//! with the recording of a run to which nothing happened, resumed where it was killed, or with an error that says what failed; in
//! time, and never with a recording that differs.

pub(crate) mod proxy;

use crate::recording::read_recording;
use crate::{Server, executable, hearing_hang_ups, repository};
use anyhow::{Context as _, bail};
use proto::rng::{philox4x64, uniform};
use proxy::{Disturbance, Proxy};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// The experiments: a name, the file in configs/, and what is put over it.
const EXPERIMENTS: [(&str, &str, &[&str]); 4] = [
    ("propagation", "flocking", &["experiment.duration_s=60"]),
    ("packet control", "packet-control", &["experiment.duration_s=5"]),
    (
        "sensors, 6TiSCH",
        "sensors-msf",
        &[
            "experiment.control_period={ rate_hz = 1.0 }",
            "experiment.duration_s=300",
            "output.pcap=true",
        ],
    ),
    ("swarm, 6TiSCH", "flocking-msf", &["experiment.duration_s=2", "output.pcap=true"]),
];

/// Longest time that a run to which something happens may take: a side that hangs is given up within seconds, and restarts are few.
const LIMIT: Duration = Duration::from_secs(120);

/// What happens to a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Event {
    /// SIGKILL to a side.
    KillSide,
    /// SIGSTOP to a side, for good.
    StopSide,
    /// SIGSTOP to a side, and SIGCONT half a second later.
    PauseSide,
    /// SIGKILL to the orchestrator; the run is resumed.
    KillOrchestrator,
    /// SIGKILL to the orchestrator and both sides; the run is resumed.
    KillAll,
    /// SIGTERM to the orchestrator.
    Terminate,
    /// SIGHUP to the orchestrator.
    HangUp,
    /// The connection to a side elsewhere is cut.
    Cut,
    /// The connection to a side elsewhere is held up for half a second.
    Delay,
    /// Bytes from a side elsewhere come twice.
    Duplicate,
    /// A bit from a side elsewhere is flipped.
    Corrupt,
    /// Writing fails from some size of a file on, as on a full disk.
    FullDisk,
}

impl Event {
    /// All of them.
    const ALL: [Self; 12] = [
        Self::KillSide,
        Self::StopSide,
        Self::PauseSide,
        Self::KillOrchestrator,
        Self::KillAll,
        Self::Terminate,
        Self::HangUp,
        Self::Cut,
        Self::Delay,
        Self::Duplicate,
        Self::Corrupt,
        Self::FullDisk,
    ];

    /// It happens on a connection.
    fn disturbance(self) -> Option<Disturbance> {
        match self {
            Self::Cut => Some(Disturbance::Cut),
            Self::Delay => Some(Disturbance::Delay),
            Self::Duplicate => Some(Disturbance::Duplicate),
            Self::Corrupt => Some(Disturbance::Corrupt),
            _ => None,
        }
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = serde_json::to_value(self).map_err(|_| fmt::Error)?;
        f.write_str(name.as_str().unwrap_or_default())
    }
}

/// What became of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fate {
    /// The recording of a run to which nothing happened.
    SameBytes,
    /// The same after it was resumed.
    Resumed,
    /// An error that says what failed.
    TypedError,
    /// A signal interrupted it, and its recording up to then is kept.
    Interrupted,
    /// It did not end in time. A defect.
    Hangs,
    /// It is complete, and its recording differs. The worst defect.
    SilentlyWrong,
    /// It failed without saying what, or left what cannot be used. A defect.
    Unclear,
}

impl Fate {
    /// Whether it may not be.
    #[must_use]
    pub fn is_defect(self) -> bool {
        matches!(self, Self::Hangs | Self::SilentlyWrong | Self::Unclear)
    }
}

/// A run, as it is drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// Its number.
    pub number: u64,
    /// The experiment, an index.
    experiment: usize,
    /// What happens.
    pub event: Event,
    /// The side that it happens to.
    side: String,
    /// Each side runs elsewhere: robots, network.
    elsewhere: [bool; 2],
    /// When, as a share of the time, or of the bytes, that an undisturbed run takes.
    share: f64,
    /// Checkpoints are stored every so many seconds; 0: none.
    checkpoint_every_s: f64,
}

/// A run and what became of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// The run.
    pub trial: Trial,
    /// What became of it.
    pub fate: Fate,
    /// What it said last.
    pub said: String,
    /// How long it took (s), resuming included.
    pub wall_s: f64,
}

impl Trial {
    /// The run of that number.
    #[must_use]
    pub fn draw(seed: u64, number: u64) -> Self {
        let [a, b, c, d] = philox4x64([number, 0, 0, 0], [seed, 0]);
        let [e, f, ..] = philox4x64([number, 1, 0, 0], [seed, 0]);
        let event = Event::ALL[(number % Event::ALL.len() as u64) as usize];
        let side = if a.is_multiple_of(2) { "robotsim" } else { "netsim" };
        let mut elsewhere = [b & 1 != 0, b & 2 != 0];
        if event.disturbance().is_some() {
            elsewhere[usize::from(side == "netsim")] = true;
        }
        Self {
            number,
            experiment: (c % EXPERIMENTS.len() as u64) as usize,
            event,
            side: side.to_owned(),
            elsewhere,
            share: uniform(d),
            checkpoint_every_s: [0.0, 0.05, 0.2][(e % 3) as usize]
                * if f % 8 == 0 { 0.1 } else { 1.0 },
        }
    }
}

/// An undisturbed run of an experiment.
pub struct Reference {
    recording: BTreeMap<String, Vec<u8>>,
    wall: Duration,
    /// Bytes that each side sends: robots, network.
    n_bytes: [u64; 2],
}

/// Undisturbed runs of all experiments, in `folder`.
///
/// # Errors
///
/// One fails.
pub fn references(folder: &Path) -> anyhow::Result<Vec<Reference>> {
    (0..EXPERIMENTS.len()).map(|experiment| reference(experiment, folder)).collect()
}

fn reference(experiment: usize, folder: &Path) -> anyhow::Result<Reference> {
    let folder = folder.join(format!("reference-{experiment}"));
    std::fs::create_dir_all(&folder)?;
    let begun = Instant::now();
    let output = arguments(experiment, 0.0, &folder).output()?;
    let wall = begun.elapsed();
    if !output.status.success() {
        bail!("{}: {}", EXPERIMENTS[experiment].0, said(&output));
    }
    let recording = read_recording(&result_of(experiment, &folder));
    // Once more over proxies, which count.
    let counted = folder.join("counted");
    std::fs::create_dir_all(&counted)?;
    let servers = [Server::start("robotsim", &[])?, Server::start("netsim", &[])?];
    let proxies = [Proxy::start(&servers[0].url, None)?, Proxy::start(&servers[1].url, None)?];
    let mut command = arguments(experiment, 0.0, &counted);
    command.args(["--robotsim", &proxies[0].url, "--netsim", &proxies[1].url]);
    let output = command.output()?;
    if !output.status.success() {
        bail!("{} over proxies: {}", EXPERIMENTS[experiment].0, said(&output));
    }
    if read_recording(&result_of(experiment, &counted)) != recording {
        bail!("{}: the recording depends on where the sides run", EXPERIMENTS[experiment].0);
    }
    Ok(Reference { recording, wall, n_bytes: proxies.map(|proxy| proxy.n_bytes()) })
}

fn arguments(experiment: usize, checkpoint_every_s: f64, folder: &Path) -> Command {
    let (_, config, sets) = EXPERIMENTS[experiment];
    let mut command = hearing_hang_ups("murmuration");
    command.arg("run").arg(repository().join(format!("configs/{config}.toml")));
    for set in sets {
        command.args(["--set", set]);
    }
    command.args(["--set", &format!("experiment.checkpoint_every_s={checkpoint_every_s}")]);
    // A side that is gone for good is not waited for long.
    command.args(["--set", "experiment.reconnect_limit_s=3", "--out", "runs"]);
    command.current_dir(folder).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn result_of(experiment: usize, folder: &Path) -> PathBuf {
    folder.join("runs").join(EXPERIMENTS[experiment].1)
}

fn said(output: &Output) -> String {
    let text = [&output.stdout[..], &output.stderr[..]].concat();
    String::from_utf8_lossy(&text).trim().to_owned()
}

/// Carries out a run in a folder of its own.
///
/// # Errors
///
/// It cannot be started.
pub fn carry_out(trial: &Trial, references: &[Reference]) -> anyhow::Result<Outcome> {
    let folder = tempfile::tempdir()?;
    let begun = Instant::now();
    let (fate, said) = attempt(trial, &references[trial.experiment], folder.path())?;
    let wall_s = begun.elapsed().as_secs_f64();
    let said = said.chars().rev().take(400).collect::<Vec<_>>().into_iter().rev().collect();
    Ok(Outcome { trial: trial.clone(), fate, said, wall_s })
}

fn attempt(trial: &Trial, reference: &Reference, folder: &Path) -> anyhow::Result<(Fate, String)> {
    let mut command = match trial.event {
        Event::FullDisk => limited(trial, reference, folder),
        _ => arguments(trial.experiment, trial.checkpoint_every_s, folder),
    };
    let mut servers = Vec::new();
    let mut proxies = Vec::new();
    for (i, name) in ["robotsim", "netsim"].into_iter().enumerate() {
        if !trial.elsewhere[i] {
            continue;
        }
        let server = Server::start(name, &[])?;
        let mut url = server.url.clone();
        if trial.side == name && trial.event.disturbance().is_some() {
            let at = (trial.share * reference.n_bytes[i] as f64) as u64;
            let proxy = Proxy::start(&url, trial.event.disturbance().map(|kind| (kind, at)))?;
            url.clone_from(&proxy.url);
            proxies.push(proxy);
        }
        command.args([&format!("--{name}"), &url]);
        servers.push((name, server));
    }
    let run = command.spawn().context("starting the orchestrator")?;
    std::thread::sleep(reference.wall.mul_f64(trial.share));
    let orchestrator = run.id();
    let victims = || -> Vec<u32> {
        let at =
            servers.iter().filter(|(name, _)| *name == trial.side).map(|(_, server)| server.id());
        let own = children(orchestrator).into_iter().filter(|(_, name)| *name == trial.side);
        at.chain(own.map(|(id, _)| id)).collect()
    };
    match trial.event {
        Event::KillSide => victims().into_iter().for_each(|id| signal("-KILL", id)),
        Event::StopSide => victims().into_iter().for_each(|id| signal("-STOP", id)),
        Event::PauseSide => {
            let victims = victims();
            victims.iter().for_each(|&id| signal("-STOP", id));
            std::thread::sleep(Duration::from_millis(500));
            victims.iter().for_each(|&id| signal("-CONT", id));
        }
        Event::KillOrchestrator => signal("-KILL", orchestrator),
        Event::KillAll => {
            signal("-KILL", orchestrator);
            children(orchestrator).into_iter().for_each(|(id, _)| signal("-KILL", id));
            servers.iter().for_each(|(_, server)| signal("-KILL", server.id()));
        }
        Event::Terminate => signal("-TERM", orchestrator),
        Event::HangUp => signal("-HUP", orchestrator),
        Event::Cut | Event::Delay | Event::Duplicate | Event::Corrupt | Event::FullDisk => {}
    }
    let Some(output) = ended(run, LIMIT)? else { return Ok((Fate::Hangs, String::new())) };
    let is_killed = matches!(trial.event, Event::KillOrchestrator | Event::KillAll);
    if is_killed && !output.status.success() {
        return resumed(trial, reference, folder);
    }
    Ok(judge(trial, reference, folder, &output, Fate::SameBytes))
}

/// A run whose files may not grow beyond some size.
fn limited(trial: &Trial, reference: &Reference, folder: &Path) -> Command {
    let sizes = reference.recording.values().map(Vec::len);
    let largest = sizes.max().unwrap_or(0) as f64;
    // In blocks of 512 bytes. Writing beyond is an error, since the signal that would come with it is ignored.
    let n_blocks = (largest * trial.share / 512.0) as u64 + 1;
    let inner = arguments(trial.experiment, trial.checkpoint_every_s, folder);
    let mut command = Command::new("sh");
    command.arg("-c").arg(format!("trap '' XFSZ; ulimit -f {n_blocks}; exec \"$0\" \"$@\""));
    command.arg(inner.get_program()).args(inner.get_args());
    command.current_dir(folder).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Goes on with a run that was killed, or begins it anew where it left no checkpoint.
fn resumed(trial: &Trial, reference: &Reference, folder: &Path) -> anyhow::Result<(Fate, String)> {
    // Children that end with their parent are given the time.
    std::thread::sleep(Duration::from_millis(100));
    let left = std::fs::read_dir(folder.join("runs")).ok().and_then(|entries| {
        let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
        paths.into_iter().find(|path| path.join("checkpoint").exists())
    });
    let mut command = match &left {
        Some(left) => {
            let mut command = Command::new(executable("murmuration"));
            command.arg("run").arg("--resume").arg(left).current_dir(folder);
            command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
            command
        }
        None => arguments(trial.experiment, trial.checkpoint_every_s, folder),
    };
    let mut servers = Vec::new();
    for (i, name) in ["robotsim", "netsim"].into_iter().enumerate() {
        if trial.elsewhere[i] {
            let server = Server::start(name, &[])?;
            command.args([&format!("--{name}"), &server.url]);
            servers.push(server);
        }
    }
    let run = command.spawn().context("resuming")?;
    let Some(output) = ended(run, LIMIT)? else { return Ok((Fate::Hangs, "resuming".to_owned())) };
    if !output.status.success() {
        return Ok((Fate::Unclear, said(&output)));
    }
    Ok(judge(trial, reference, folder, &output, Fate::Resumed))
}

/// What became of a run that has ended; `complete` if it is complete and right.
fn judge(
    trial: &Trial,
    reference: &Reference,
    folder: &Path,
    output: &Output,
    complete: Fate,
) -> (Fate, String) {
    let said = said(output);
    let dir = result_of(trial.experiment, folder);
    let status = std::fs::read(dir.join("summary.json"))
        .ok()
        .and_then(|text| serde_json::from_slice::<serde_json::Value>(&text).ok())
        .and_then(|summary| Some(summary["status"].as_str()?.to_owned()));
    let is_asked = matches!(trial.event, Event::Terminate | Event::HangUp);
    let fate = match (output.status.code(), status.as_deref()) {
        (Some(0), Some("complete")) => {
            if read_recording(&dir) == reference.recording {
                complete
            } else {
                Fate::SilentlyWrong
            }
        }
        (Some(0), _) | (_, Some("complete")) => Fate::Unclear,
        (Some(1), Some("interrupted")) if is_asked => Fate::Interrupted,
        (Some(1), None) if is_asked && said.contains("stopped by SIG") => Fate::Interrupted,
        // Before it could listen for signals, and before it began anything.
        (None, None) if is_asked && !folder.join("runs").exists() => Fate::Interrupted,
        (Some(1 | 2), _) if names_the_cause(&said) => Fate::TypedError,
        _ => Fate::Unclear,
    };
    (fate, said)
}

/// An error that names the side or the file.
fn names_the_cause(said: &str) -> bool {
    !said.contains("panicked")
        && ["robotsim: ", "netsim: ", "cannot write", "cannot create", "cannot rename"]
            .iter()
            .any(|name| said.contains(name))
}

/// Waits for a process, at most so long; kills it after that.
pub(crate) fn ended(mut run: Child, limit: Duration) -> anyhow::Result<Option<Output>> {
    // What it says is little: it fits into the pipes.
    let begun = Instant::now();
    while run.try_wait()?.is_none() {
        if limit < begun.elapsed() {
            run.kill()?;
            run.wait()?;
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(Some(run.wait_with_output()?))
}

/// Processes that `parent` has started, with the subcommand of each.
#[must_use]
pub fn children(parent: u32) -> Vec<(u32, String)> {
    let listed =
        Command::new("ps").args(["-o", "pid=,args=", "--ppid", &parent.to_string()]).output();
    let text = listed.map(|output| String::from_utf8_lossy(&output.stdout).into_owned());
    let text = text.unwrap_or_default();
    let child = |line: &str| -> Option<(u32, String)> {
        let mut words = line.split_whitespace();
        Some((words.next()?.parse().ok()?, words.nth(1)?.to_owned()))
    };
    text.lines().filter_map(child).collect()
}

fn signal(signal: &str, id: u32) {
    // A process that has ended is past it.
    let _ = Command::new("kill").args([signal, &id.to_string()]).stderr(Stdio::null()).status();
}
