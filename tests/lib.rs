//! Harness of the end-to-end tests: the real executables, run in folders of their own.

use anyhow::{Context as _, bail};
use std::collections::BTreeSet;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

pub mod alarms;
pub mod answers;
pub mod campaign;
pub mod documented;
pub mod fake;
pub mod fault_campaign;
pub mod fault_simulation;
pub mod forming;
pub mod fuzz;
pub mod in_process;
pub mod recording;
pub mod reporting;
pub mod same_results;
pub mod statistics;

/// The folder of the repository.
#[must_use]
pub fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ is in the repository").to_owned()
}

/// An executable of the workspace, built with the tests.
///
/// # Panics
///
/// If it was not built: `cargo test --workspace` builds it.
#[must_use]
pub fn executable(name: &str) -> PathBuf {
    let test = std::env::current_exe().expect("a test has an executable");
    // Tests are in target/PROFILE/deps, other programs in target/PROFILE.
    let mut paths = test.ancestors().skip(1).take(2).map(|folder| folder.join(name));
    let found = paths.find(|path| path.exists());
    assert!(found.is_some(), "{name} is missing: build it with cargo test --workspace");
    found.unwrap_or_default()
}

/// An executable of the workspace that takes a hang-up as a program of a terminal does, even where this process ignores it, as
/// under `nohup`: what is ignored is inherited.
///
/// # Panics
///
/// As [`executable`].
#[must_use]
pub fn hearing_hang_ups(name: &str) -> Command {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    if ignored & 1 == 0 {
        return Command::new(executable(name));
    }
    let mut command = Command::new("env");
    command.arg("--default-signal=HUP").arg(executable(name));
    command
}

/// A folder for one test, removed at its end.
///
/// # Panics
///
/// If there is no room for it.
#[must_use]
pub fn folder() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

/// Runs the orchestrator to its end.
///
/// # Panics
///
/// If it cannot be started.
#[must_use]
pub fn orchestrator(args: &[&str], folder: &Path) -> Output {
    std::fs::create_dir_all(folder).expect("a folder");
    Command::new(executable("murmuration"))
        .args(args)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .expect("the orchestrator starts")
}

/// Starts a program in a folder, without input, and keeps what it prints.
///
/// # Panics
///
/// If it cannot be started.
#[must_use]
pub fn spawn(command: &mut Command, folder: &Path) -> Child {
    command
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts")
}

/// How long a test waits before it fails because of a hang. It says nothing about speed: on a machine that is busy with other work,
/// anything may take many seconds.
pub const DEADLINE: Duration = Duration::from_secs(120);

/// Waits until a condition holds. `failure` says what is wrong if it never does.
///
/// # Panics
///
/// If it does not hold within [`DEADLINE`].
pub fn wait_until(failure: &str, mut holds: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < DEADLINE, "{failure}");
        std::thread::park_timeout(Duration::from_millis(5));
    }
}

/// Waits until runs in folders below `out` have recorded further steps.
///
/// # Panics
///
/// If they do not within [`DEADLINE`].
pub fn wait_until_recording(out: &Path) {
    let mut sizes = BTreeSet::new();
    wait_until("nothing is recorded", || {
        let runs = std::fs::read_dir(out).into_iter().flatten().flatten();
        let recordings = runs.filter_map(|run| run.path().join("run.mcap").metadata().ok());
        let bytes: u64 = recordings.map(|recording| recording.len()).sum();
        sizes.insert(bytes);
        // Steps are written in chunks: the first change may be a file with a header, or a chunk of earlier steps.
        3 < sizes.len()
    });
}

/// Waits for the end of a program; returns its status and what it printed.
///
/// # Panics
///
/// If it does not end within [`DEADLINE`]. It is killed then.
#[must_use]
pub fn end_of(child: Child) -> Output {
    let id = child.id();
    let (sender, receiver) = std::sync::mpsc::channel();
    std::thread::spawn(move || sender.send(child.wait_with_output()));
    let Ok(output) = receiver.recv_timeout(DEADLINE) else {
        signal("-KILL", id);
        panic!("the program did not end within {DEADLINE:?}");
    };
    output.expect("its output can be read")
}

/// Sends a signal, such as `-INT`, to a process.
///
/// # Panics
///
/// If there is no such process.
pub fn signal(signal: &str, process: u32) {
    let sent = Command::new("kill").args([signal, &process.to_string()]).status();
    assert!(sent.is_ok_and(|status| status.success()), "kill {signal} {process}");
}

/// Runs an experiment that must succeed; returns the folder of its results.
///
/// # Panics
///
/// If it fails, with what it said.
#[must_use]
pub fn run(config: &Path, out: &Path, args: &[&str]) -> PathBuf {
    let config = config.to_str().expect("paths of tests are UTF-8");
    let out_text = out.to_str().expect("paths of tests are UTF-8");
    let output = orchestrator(&[&["run", config, "--out", out_text], args].concat(), out);
    assert!(output.status.success(), "{}", said(&output));
    let stdout = String::from_utf8_lossy(&output.stdout);
    let dir = stdout
        .lines()
        .find_map(|line| line.strip_prefix("results in "))
        .expect("it says where the results are");
    PathBuf::from(dir)
}

/// A page without its scripts: packed data are text by chance.
#[must_use]
pub fn without_scripts(page: &str) -> String {
    page.split("<script").map(|part| part.rsplit("</script>").next().unwrap_or_default()).collect()
}

/// What a program said, both ways.
#[must_use]
pub fn said(output: &Output) -> String {
    format!(
        "{}\n{}{}",
        output.status,
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    )
}

/// A simulator running as a separate process. Killed when dropped.
pub struct Server {
    child: Child,
    /// Where it listens.
    pub url: String,
}

impl Server {
    /// Starts `netsim` or `robotsim` and waits until it listens.
    ///
    /// # Errors
    ///
    /// It does not start.
    pub fn start(name: &str, args: &[&str]) -> anyhow::Result<Self> {
        let mut child = Command::new(executable(name))
            .args(args)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("starting {name}"))?;
        let mut line = String::new();
        let stdout = child.stdout.take().context("its output")?;
        BufReader::new(stdout).read_line(&mut line)?;
        let Some((_, url)) = line.trim().rsplit_once(" listening on ") else {
            let _ = child.kill();
            bail!("{name} said {line:?}, {}", child.wait()?);
        };
        Ok(Self { url: url.to_owned(), child })
    }

    /// Number of the process.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.id()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
