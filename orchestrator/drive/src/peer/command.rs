//! A simulator that a command of the experiment file starts: it is started, waited for, watched and ended like the built-in ones.
//!
//! The command serves at the address in [`LISTEN`]. It is ready once it answers `Describe` there; it need not print anything.
//! Its process group gets SIGTERM when the run ends, and SIGKILL two seconds later. Should this process be killed, the kernel
//! kills the command (Linux, through [`become_command`]), and closes the standard input of all that it has started.

use super::process::{ChildProcess, Launch};
use super::service::Service;
use super::{Connected, SideError, open};
use experiment::SideCommand;
use nix::sys::signal::Signal;
use nix::unistd::{Pid, getppid};
use std::ffi::OsString;
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tokio::time::Instant;

/// The environment variable that says where a command is to listen: `unix:` and the path of a socket.
pub(super) const LISTEN: &str = "MURMURATION_LISTEN";
/// The environment variable whose presence says that standard input closes when the command is to end.
pub(super) const EXIT_WITH_STDIN: &str = "MURMURATION_EXIT_WITH_STDIN";
/// The subcommand of the orchestrator that calls [`become_command`].
pub(super) const BECOME: &str = "become";
/// How long a command may take until it serves: Python may import for seconds, and longer on a busy machine.
const START: Duration = Duration::from_secs(60);
/// How long to wait between two attempts to reach it.
const RETRY: Duration = Duration::from_millis(20);

/// Starts a command and waits until it serves. Returns where.
///
/// # Errors
///
/// The program does not exist, ends, is no simulator of this kind, or does not serve in time.
pub(super) async fn start<S: Service>(
    command: &SideCommand,
    launch: &Launch,
) -> Result<(String, ChildProcess, Connected<S>), SideError> {
    start_within::<S>(command, launch, START).await
}

async fn start_within<S: Service>(
    command: &SideCommand,
    launch: &Launch,
    limit: Duration,
) -> Result<(String, ChildProcess, Connected<S>), SideError> {
    let shown = command.shown();
    let failed = |reason: String| SideError::Start { side: S::SIDE, reason };
    let program = find(command).map_err(|reason| SideError::Command { side: S::SIDE, reason })?;
    let (socket, mut child) = ChildProcess::of_command(S::SIDE, command, &program, launch)?;
    let url = format!("unix:{}", socket.display());
    let deadline = Instant::now() + limit;
    loop {
        if let Some(how) = child.has_ended() {
            let said = child.said().await;
            return Err(failed(format!(
                "{shown} ended before it served at the address in {LISTEN}: {how}{said}"
            )));
        }
        let in_time = match socket.exists() {
            true => tokio::time::timeout_at(deadline, open::<S>(&url, None)).await,
            // Reaching it would fail at once.
            false => Ok(Err(SideError::Unreachable {
                side: S::SIDE,
                url: url.clone(),
                reason: String::new(),
            })),
        };
        match in_time {
            Ok(Ok(connected)) => return Ok((url, child, connected)),
            Ok(Err(SideError::Unreachable { .. })) if Instant::now() < deadline => {}
            Ok(Err(SideError::Unreachable { .. })) | Err(_) => {
                let said = child.said().await;
                return Err(failed(format!(
                    "{shown} does not serve at the address in {LISTEN} within {} s. If it takes longer to start, start it \
                     yourself and give its URL with --{}{said}",
                    limit.as_secs(),
                    S::SIDE
                )));
            }
            Ok(Err(error)) => return Err(error),
        }
        tokio::time::sleep(RETRY).await;
    }
}

/// The file of a command's program: in a folder of PATH, or relative to the command's folder if a slash is in it.
fn find(command: &SideCommand) -> Result<PathBuf, String> {
    let SideCommand { words, folder } = command;
    if !folder.is_dir() {
        return Err(format!("cannot run in the folder {}, which does not exist", folder.display()));
    }
    let name = words.first().map_or("", String::as_str);
    if name.contains('/') {
        let path = folder.join(name);
        return match (path.is_file(), is_executable(&path)) {
            (true, true) => Ok(path),
            (true, false) => Err(format!(
                "the program {} is not executable; run: chmod +x {}",
                path.display(),
                path.display()
            )),
            (false, _) => Err(format!("the program {} does not exist", path.display())),
        };
    }
    on_path(name).ok_or_else(|| {
        let hint = match name {
            "python" if on_path("python3").is_some() => "; python3 is there",
            _ => "; install it, or give its path",
        };
        format!("the program {name:?} is in no folder of the environment variable PATH{hint}")
    })
}

fn on_path(name: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let mut found = std::env::split_paths(&path).map(|folder| folder.join(name));
    found.find(|path| path.is_file() && is_executable(path))
}

fn is_executable(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|metadata| metadata.permissions().mode() & 0o111 != 0)
}

/// Makes this process a command that the kernel kills once process `parent` has ended. Returns only if that fails.
#[must_use]
pub fn become_command(parent: u32, words: &[OsString]) -> std::io::Error {
    let Some((program, arguments)) = words.split_first() else {
        return std::io::Error::from(std::io::ErrorKind::InvalidInput);
    };
    // Stays in force when the program is replaced.
    #[cfg(target_os = "linux")]
    if let Err(error) = nix::sys::prctl::set_pdeathsig(Signal::SIGKILL) {
        return error.into();
    }
    // It may have ended before that.
    if getppid() != Pid::from_raw(parent.cast_signed()) {
        return std::io::Error::other("the parent process has ended");
    }
    std::process::Command::new(program).args(arguments).exec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::peer::RobotSide;
    use std::fs::Permissions;
    use tempfile::TempDir;

    /// A command of a shell, and an executable that becomes it.
    fn of_script(script: &str) -> (SideCommand, Launch, TempDir) {
        let folder = tempfile::tempdir().unwrap();
        let executable = folder.path().join("program");
        std::fs::write(&executable, "#!/bin/sh\nshift 3\nexec \"$@\"\n").unwrap();
        std::fs::set_permissions(&executable, Permissions::from_mode(0o755)).unwrap();
        let words = ["sh", "-c", script].map(str::to_owned).to_vec();
        let command = SideCommand { words, folder: folder.path().to_owned() };
        let launch = Launch::new(executable);
        (command, launch, folder)
    }

    async fn refused(script: &str, limit: Duration) -> String {
        let (command, launch, _folder) = of_script(script);
        match start_within::<RobotSide>(&command, &launch, limit).await {
            Ok(_) => panic!("it serves nothing"),
            Err(error) => error.to_string(),
        }
    }

    #[tokio::test]
    async fn a_command_that_never_serves_is_given_up_and_ended() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("pid");
        let script =
            format!("echo $$ > {}; echo 'still importing' >&2; exec sleep 1000", file.display());
        let said = refused(&script, Duration::from_secs(1)).await;
        assert!(
            said.contains("does not serve at the address in MURMURATION_LISTEN within 1 s"),
            "{said}"
        );
        assert!(said.contains("give its URL with --robotsim"), "{said}");
        assert!(said.ends_with("\n  still importing"), "{said}");
        let pid: i32 = std::fs::read_to_string(file).unwrap().trim().parse().unwrap();
        let begun = Instant::now();
        while std::path::Path::new(&format!("/proc/{pid}")).exists() {
            assert!(begun.elapsed() < Duration::from_secs(5), "it was not ended");
            tokio::time::sleep(RETRY).await;
        }
    }

    #[tokio::test]
    async fn what_a_command_said_is_bounded_and_complete_at_its_end() {
        let script =
            "i=0; while [ $i -lt 3000 ]; do echo line $i >&2; i=$((i+1)); done; kill -KILL $$";
        let said = refused(script, Duration::from_secs(20)).await;
        assert!(said.contains("killed by SIGKILL"), "{said}");
        assert!(said.ends_with("\n  line 2999") && !said.contains("line 1\n"), "{said}");
        assert!(said.len() < 14_000, "{}", said.len());
    }
}
