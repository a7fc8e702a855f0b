//! A side that runs as a child process of this one.

use super::SideError;
use std::fs::Permissions;
use std::io::Write as _;
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::{ExitStatus, Stdio};
use std::time::Duration;
use tempfile::TempDir;
use tokio::io::{AsyncBufReadExt as _, BufReader};
use tokio::process::{Child, ChildStdin, Command};

/// How long a child may take until it listens.
const START: Duration = Duration::from_secs(10);
/// How long a child may take to end by itself.
const STOP: Duration = Duration::from_secs(2);

/// How children are started.
#[derive(Clone, Debug)]
pub struct Launch {
    /// The executable, which takes the side's name as its subcommand.
    pub executable: PathBuf,
    /// Threads for physics and dynamics; `None`: one per core.
    pub threads: Option<u16>,
    /// Log filter.
    pub log: String,
    /// Log as JSON.
    pub log_json: bool,
    /// Children take orders from other programs that know the token made for them.
    pub accept_commands: bool,
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
impl std::fmt::Debug for Orders {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Orders").field("url", &self.url).finish_non_exhaustive()
    }
}

/// A running child. Killed if dropped.
pub(super) struct ChildProcess {
    child: Child,
    /// Closing it ends the child. Held here, since waiting for a [`Child`] closes what that holds.
    stdin: Option<ChildStdin>,
    orders: Option<Orders>,
    /// Where its socket is: nobody else may enter.
    _folder: TempDir,
}

impl ChildProcess {
    /// Starts a side and waits until it listens. Returns where.
    pub(super) async fn start(
        side: &'static str,
        launch: &Launch,
    ) -> Result<(String, Self), SideError> {
        let failed = |reason: String| SideError::Start { side, reason };
        let cannot = |error: std::io::Error| failed(format!("no folder for its socket: {error}"));
        let folder = private_folder().map_err(cannot)?;
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
            // A group of its own: Ctrl-C on the terminal reaches the orchestrator alone, which then ends its children.
            .process_group(0)
            .kill_on_drop(true)
            .spawn()
            .map_err(|error| failed(format!("{}: {error}", launch.executable.display())))?;
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
        let mut process = Self { child, stdin, orders: None, _folder: folder };
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
            Ok(Ok(status)) => SideError::Exited { side, doing: doing.to_owned(), how: how(status) },
            _ => error,
        }
    }

    /// Asks it to end by closing its standard input; kills it if it does not.
    pub(super) async fn stop(mut self) {
        drop(self.stdin.take());
        if tokio::time::timeout(STOP, self.child.wait()).await.is_err()
            && let Err(error) = self.child.kill().await
        {
            tracing::warn!(%error, "cannot kill a child process");
        }
    }
}

/// A folder that only this user may enter, for a socket. Removed when dropped.
fn private_folder() -> std::io::Result<TempDir> {
    /// A socket's path, with the name of the folder and of the socket, has fewer than 108 bytes.
    const LONGEST: usize = 70;
    let runtime = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    let mut places: Vec<PathBuf> = runtime.into_iter().collect();
    places.extend([std::env::temp_dir(), PathBuf::from("/tmp")]);
    let mut last = std::io::Error::from(std::io::ErrorKind::NotFound);
    let is_usable = |place: &&PathBuf| place.is_absolute() && place.as_os_str().len() <= LONGEST;
    for place in places.iter().filter(is_usable) {
        let mut builder = tempfile::Builder::new();
        builder.prefix("murmuration-").permissions(Permissions::from_mode(0o700));
        match builder.tempdir_in(place) {
            Ok(folder) => return Ok(folder),
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// A token that nobody can guess, in a file that only this user may read.
fn new_token(path: &Path) -> std::io::Result<String> {
    use std::io::Read as _;
    use std::os::unix::fs::OpenOptionsExt as _;
    let mut random = [0; 16];
    std::fs::File::open("/dev/urandom")?.read_exact(&mut random)?;
    let token = proto::digest::hex(&random);
    let mut options = std::fs::OpenOptions::new();
    let mut file = options.write(true).create_new(true).mode(0o600).open(path)?;
    writeln!(file, "{token}")?;
    Ok(token)
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

    #[tokio::test]
    async fn a_child_that_lives_is_not_ended_by_asking_whether_it_does() {
        let folder = tempfile::tempdir().unwrap();
        let executable = folder.path().join("side");
        // Lives as long as its standard input is open, as a simulator does.
        let script = "#!/bin/sh\necho side listening on http://127.0.0.1:1\nexec cat >/dev/null\n";
        std::fs::write(&executable, script).unwrap();
        std::fs::set_permissions(&executable, std::fs::Permissions::from_mode(0o755)).unwrap();
        let launch = Launch {
            executable,
            threads: None,
            log: "warn".to_owned(),
            log_json: false,
            accept_commands: false,
        };
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
