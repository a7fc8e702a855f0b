//! A side that runs as a child process of this one.

use super::SideError;
use super::command::{BECOME, EXIT_WITH_STDIN, LISTEN};
use crate::private_folder::PrivateFolder;
use experiment::SideCommand;
use nix::sys::signal::{Signal, killpg};
use nix::unistd::Pid;
use std::collections::VecDeque;
use std::fmt;
use std::fs::File;
use std::io::{BufRead as _, Read as _, Write as _};
use std::os::fd::OwnedFd;
use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::{ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::io::{AsyncBufReadExt as _, BufReader};
use tokio::process::{Child, ChildStdin, Command};

/// How long a child may take until it listens.
const START: Duration = Duration::from_secs(10);
/// How long a child may take to end by itself.
const STOP: Duration = Duration::from_secs(2);
/// How long the last lines of a child that has ended are waited for. Processes that it left behind may hold them open.
const LAST_LINES: Duration = Duration::from_millis(500);

/// How children are started.
#[derive(Clone, Debug)]
pub struct Launch {
    /// The executable, which takes the side's name as its subcommand, and `become`.
    pub executable: PathBuf,
    /// What is started instead of the simulator in the executable.
    pub command: Option<SideCommand>,
    /// Threads for physics and dynamics; `None`: one per core.
    pub threads: Option<u16>,
    /// Log filter.
    pub log: String,
    /// Log as JSON.
    pub log_json: bool,
    /// Children take orders from other programs that know the token made for them.
    pub accept_commands: bool,
    /// Who is given each line that the child writes to standard error, beside this program's standard error.
    pub lines: Option<LineSink>,
}

impl Launch {
    /// The simulator in this executable, on all cores, with warnings alone, without orders.
    #[must_use]
    pub fn new(executable: PathBuf) -> Self {
        Self {
            executable,
            command: None,
            threads: None,
            log: "warn".to_owned(),
            log_json: false,
            accept_commands: false,
            lines: None,
        }
    }
}

/// Where and how other programs may give orders to a child.
#[derive(Clone, PartialEq, Eq)]
pub struct Orders {
    /// Where it listens.
    pub url: String,
    /// The token that a call of `Command` carries.
    pub token: String,
}

/// Without the token.
impl fmt::Debug for Orders {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Orders").field("url", &self.url).finish_non_exhaustive()
    }
}

/// Takes the name of a side and a line that it wrote.
#[derive(Clone)]
pub struct LineSink(Arc<TakeLine>);

/// Called with a side and a line.
type TakeLine = dyn Fn(&str, &str) + Send + Sync;

impl LineSink {
    /// Calls this with each line.
    pub fn new(take: impl Fn(&str, &str) + Send + Sync + 'static) -> Self {
        Self(Arc::new(take))
    }
}

impl fmt::Debug for LineSink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("LineSink")
    }
}

/// A running child. Killed if dropped, with all its process group.
pub(super) struct ChildProcess {
    child: Child,
    /// Its process group, which a command may have filled; `None`: it starts no others.
    group: Option<Pid>,
    /// Closing it ends the child. Held here, since waiting for a [`Child`] closes what that holds.
    stdin: Option<ChildStdin>,
    orders: Option<Orders>,
    /// Where its socket is: nobody else may enter.
    _folder: PrivateFolder,
    /// Pass its lines on until it has ended.
    lines: Vec<JoinHandle<()>>,
    /// The last lines that a command wrote to standard error.
    tail: Tail,
}

impl ChildProcess {
    /// Starts a side and waits until it listens. Returns where.
    pub(super) async fn start(
        side: &'static str,
        launch: &Launch,
    ) -> Result<(String, Self), SideError> {
        let failed = |reason: String| SideError::Start { side, reason };
        let cannot = |error: std::io::Error| failed(format!("no folder for its socket: {error}"));
        let folder = PrivateFolder::for_sockets().map_err(cannot)?;
        let socket = folder.path().join(side);
        let mut command = Command::new(&launch.executable);
        command.arg(side).arg("--listen").arg(format!("unix:{}", socket.display()));
        command.args(["--exit-with-parent", "--log", &launch.log]);
        let token_file = folder.path().join("token");
        let token = if launch.accept_commands {
            command.arg("--require-token").arg(&token_file);
            Some(new_token(&token_file).map_err(cannot)?)
        } else {
            command.arg("--refuse-orders");
            None
        };
        if launch.log_json {
            command.arg("--log-json");
        }
        if let Some(threads) = launch.threads {
            command.args(["--threads", &threads.to_string()]);
        }
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(if launch.lines.is_some() { Stdio::piped() } else { Stdio::inherit() })
            // A group of its own: Ctrl-C on the terminal reaches the orchestrator alone, which then ends its children.
            .process_group(0)
            .kill_on_drop(true)
            .spawn()
            .map_err(|error| failed(format!("{}: {error}", launch.executable.display())))?;
        let stderr = launch.lines.clone().zip(child.stderr.take());
        let passing_on = stderr.and_then(|(sink, stderr)| {
            pass_on(side, stderr.into_owned_fd().ok()?, Some(sink), Tail::default()).ok()
        });
        let stdout =
            child.stdout.take().ok_or_else(|| failed("it has no standard output".to_owned()))?;
        let mut lines = BufReader::new(stdout).lines();
        let line = tokio::time::timeout(START, lines.next_line())
            .await
            .map_err(|_| {
                failed(format!("it did not start to listen within {} s", START.as_secs()))
            })?
            .map_err(|error| failed(error.to_string()))?;
        let stdin = child.stdin.take();
        let mut process = Self {
            child,
            group: None,
            stdin,
            orders: None,
            _folder: folder,
            lines: passing_on.into_iter().collect(),
            tail: Tail::default(),
        };
        let Some(line) = line else {
            let ended = failed("it ended before it listened".to_owned());
            return Err(process.explain(side, "starting", ended).await);
        };
        let url = line
            .rsplit_once(" listening on ")
            .map(|(_, url)| url.to_owned())
            .ok_or_else(|| failed(format!("it printed {line:?} instead of its address")))?;
        if let Some(token) = token {
            // Read before it listened.
            let _ = std::fs::remove_file(token_file);
            process.orders = Some(Orders { url: url.clone(), token });
        }
        Ok((url, process))
    }

    /// Starts a command, whose program is the file `program`. Returns the path of the socket at which it is to listen.
    pub(super) fn of_command(
        side: &'static str,
        command: &SideCommand,
        program: &Path,
        launch: &Launch,
    ) -> Result<(PathBuf, Self), SideError> {
        let failed = |reason: String| SideError::Start { side, reason };
        let folder = PrivateFolder::for_sockets()
            .map_err(|error| failed(format!("no folder for its socket: {error}")))?;
        let socket = folder.path().join(side);
        let mut child = Command::new(&launch.executable)
            .args([BECOME, &std::process::id().to_string(), "--"])
            .arg(program)
            .args(command.words.iter().skip(1))
            .current_dir(&command.folder)
            .env(LISTEN, format!("unix:{}", socket.display()))
            .env(EXIT_WITH_STDIN, "1")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .process_group(0)
            .kill_on_drop(true)
            .spawn()
            .map_err(|error| failed(format!("{}: {error}", launch.executable.display())))?;
        let group = child.id().map(|id| Pid::from_raw(id.cast_signed()));
        let tail = Tail::default();
        let stderr = child.stderr.take().and_then(|stderr| stderr.into_owned_fd().ok());
        let stdout = child.stdout.take().and_then(|stdout| stdout.into_owned_fd().ok());
        let lines = [(stderr, tail.clone()), (stdout, Tail::default())]
            .into_iter()
            .filter_map(|(from, tail)| pass_on(side, from?, launch.lines.clone(), tail).ok())
            .collect();
        let stdin = child.stdin.take();
        let process = Self { child, group, stdin, orders: None, _folder: folder, lines, tail };
        Ok((socket, process))
    }

    /// How it has ended, if it has.
    pub(super) fn has_ended(&mut self) -> Option<String> {
        let status = self.child.try_wait().ok()??;
        Some(how(status))
    }

    /// The last lines that a command wrote to standard error, to be put after a message. Complete if it has ended.
    pub(super) async fn said(&mut self) -> String {
        if self.child.id().is_none() {
            self.read_to_end().await;
        }
        self.tail.shown()
    }

    pub(super) fn orders(&self) -> Option<&Orders> {
        self.orders.as_ref()
    }

    pub(super) fn id(&self) -> Option<u32> {
        self.child.id()
    }

    /// If the process has ended, that explains whatever error was seen.
    pub(super) async fn explain(
        &mut self,
        side: &'static str,
        doing: &str,
        error: SideError,
    ) -> SideError {
        // The connection breaks a moment before the process can be reaped.
        match tokio::time::timeout(Duration::from_millis(500), self.child.wait()).await {
            Ok(Ok(status)) => {
                let (how, said) = (how(status), self.said().await);
                SideError::Exited { side, doing: doing.to_owned(), how, said }
            }
            _ => error,
        }
    }

    /// Asks it to end by closing its standard input, and a command by SIGTERM, too; kills it if it does not.
    pub(super) async fn stop(mut self) {
        drop(self.stdin.take());
        self.signal_group(Signal::SIGTERM);
        if tokio::time::timeout(STOP, self.child.wait()).await.is_err()
            && let Err(error) = self.child.kill().await
        {
            tracing::warn!(%error, "cannot kill a child process");
            return;
        }
        self.read_to_end().await;
    }

    /// Waits for the last lines of a child that has ended. Those whom it has left behind are killed: they would hold them open.
    async fn read_to_end(&mut self) {
        self.signal_group(Signal::SIGKILL);
        self.group = None;
        let begun = Instant::now();
        let lasts = |lines: &[JoinHandle<()>]| lines.iter().any(|thread| !thread.is_finished());
        while lasts(&self.lines) && begun.elapsed() < LAST_LINES {
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
        self.lines.clear();
    }

    /// Sends a signal to all processes of a command that lives, or has just ended: the number of its group is not given to
    /// another so soon.
    fn signal_group(&self, signal: Signal) {
        if let Some(group) = self.group {
            let _ = killpg(group, signal);
        }
    }
}

impl Drop for ChildProcess {
    fn drop(&mut self) {
        self.signal_group(Signal::SIGKILL);
    }
}

/// A token that nobody can guess, in a file that only this user may read.
fn new_token(path: &Path) -> std::io::Result<String> {
    use std::os::unix::fs::OpenOptionsExt as _;
    let mut random = [0; 16];
    File::open("/dev/urandom")?.read_exact(&mut random)?;
    let token = proto::digest::hex(&random);
    let mut options = std::fs::OpenOptions::new();
    let mut file = options.write(true).create_new(true).mode(0o600).open(path)?;
    writeln!(file, "{token}")?;
    Ok(token)
}

/// A line is passed on in pieces of at most so many bytes.
const MOST_LINE_BYTES: u64 = 1 << 16;

/// The last lines of a command are kept up to so many bytes.
const MOST_TAIL_BYTES: usize = 8000;

/// The last lines that a process wrote.
#[derive(Clone, Default)]
struct Tail(Arc<Mutex<VecDeque<String>>>);

impl Tail {
    fn add(&self, line: &str) {
        let mut lines = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        lines.push_back(line.to_owned());
        let mut n_bytes: usize = lines.iter().map(String::len).sum();
        while MOST_TAIL_BYTES < n_bytes && 1 < lines.len() {
            n_bytes -= lines.pop_front().map_or(0, |line| line.len());
        }
    }

    /// To be put after a message; empty if there are none.
    fn shown(&self) -> String {
        let lines = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let texts: Vec<String> = lines
            .iter()
            .map(|line| line.chars().take(MOST_TAIL_BYTES).collect::<String>())
            .map(|line| format!("\n  {line}"))
            .collect();
        if texts.is_empty() {
            String::new()
        } else {
            format!("\nits last lines on standard error:{}", texts.concat())
        }
    }
}

/// Passes on what a child writes: to this program's standard error, and line by line to `sink` and `tail`.
fn pass_on(
    side: &'static str,
    from: OwnedFd,
    sink: Option<LineSink>,
    tail: Tail,
) -> std::io::Result<JoinHandle<()>> {
    let mut from = std::io::BufReader::new(File::from(from));
    let work = move || {
        let mut line = Vec::new();
        loop {
            line.clear();
            let mut reader = from.by_ref().take(MOST_LINE_BYTES);
            if matches!(reader.read_until(b'\n', &mut line), Ok(0) | Err(_)) {
                return;
            }
            // That nobody reads it is no reason to stop.
            let _ = std::io::stderr().write_all(&line);
            let text = String::from_utf8_lossy(&line);
            let text = text.trim_end();
            tail.add(text);
            if let Some(sink) = &sink {
                (sink.0)(side, text);
            }
        }
    };
    std::thread::Builder::new().name(format!("{side}: lines")).spawn(work)
}

fn how(status: ExitStatus) -> String {
    match (status.code(), status.signal()) {
        (Some(code), _) => format!("exit status {code}"),
        (None, Some(signal)) => match nix::sys::signal::Signal::try_from(signal) {
            Ok(name) => format!("killed by {name}"),
            Err(_) => format!("killed by signal {signal}"),
        },
        (None, None) => "no status".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt as _;

    #[tokio::test]
    async fn a_child_that_lives_is_not_ended_by_asking_whether_it_does() {
        let folder = tempfile::tempdir().unwrap();
        let executable = folder.path().join("side");
        // Lives as long as its standard input is open, as a simulator does.
        let script = "#!/bin/sh\necho side listening on http://127.0.0.1:1\nexec cat >/dev/null\n";
        std::fs::write(&executable, script).unwrap();
        std::fs::set_permissions(&executable, std::fs::Permissions::from_mode(0o755)).unwrap();
        let launch = Launch::new(executable);
        let (url, mut child) = ChildProcess::start("netsim", &launch).await.unwrap();
        assert_eq!(url, "http://127.0.0.1:1");
        let said = SideError::Cannot { side: "netsim", what: "its own words".to_owned() };
        for _ in 0..2 {
            let said = SideError::Cannot { side: "netsim", what: "its own words".to_owned() };
            let explained = child.explain("netsim", "step 1", said).await;
            assert_eq!(explained.to_string(), "netsim: its own words");
        }
        child.child.start_kill().unwrap();
        let explained = child.explain("netsim", "step 1", said).await;
        assert_eq!(
            explained.to_string(),
            "netsim: the process ended during step 1: killed by SIGKILL"
        );
    }
}
