//! Commands of a batch system, each with a bound on its time and its output.

use super::stop::StopSignal;
use proto::bounds::COMMAND_BYTES;
use std::io::Read;
use std::os::unix::process::CommandExt as _;
use std::process::{Command, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How long a command may take. Slurm's own give up within a minute or two where the controller does not answer.
const PATIENCE: Duration = Duration::from_secs(120);
/// How often a command that runs is looked at.
const GLANCE: Duration = Duration::from_millis(10);

/// Why a command of a batch system was of no use.
#[derive(Debug, thiserror::Error)]
pub enum CommandError {
    /// It is not installed.
    #[error(
        "{program} was not found on PATH; run this command where the commands of the batch system are installed, such as a login \
         node, or use --emit script"
    )]
    Missing {
        /// The program.
        program: String,
    },
    /// It could not be started, or its output could not be read.
    #[error("{program}: {source}")]
    System {
        /// The program.
        program: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// It ended with another status than 0.
    #[error("{program}: {said}")]
    Failed {
        /// The program.
        program: String,
        /// What it wrote to standard error, in one line.
        said: String,
    },
    /// It did not end in time.
    #[error("{program} did not end within {} s", PATIENCE.as_secs())]
    Late {
        /// The program.
        program: String,
    },
    /// Its output has another form than it should.
    #[error("{program} printed something unexpected: {text:?}")]
    Output {
        /// The program.
        program: String,
        /// What it printed.
        text: String,
    },
    /// Someone said stop while it ran.
    #[error("{program} was stopped")]
    Stopped {
        /// The program.
        program: String,
    },
}

/// The number of a job, in what a program printed when the job was submitted to it.
///
/// # Errors
///
/// [`CommandError::Output`] if it is no number.
pub(super) fn job_number(
    program: &str,
    printed: &str,
    number: &str,
) -> Result<String, CommandError> {
    let number = number.trim();
    if number.is_empty() || !number.bytes().all(|byte| byte.is_ascii_digit()) {
        return Err(CommandError::Output { program: program.to_owned(), text: printed.to_owned() });
    }
    Ok(number.to_owned())
}

/// Runs a command and returns what it prints. It hears no Ctrl-C, which is for this program alone. `stop`: it is killed once that
/// is set.
///
/// # Errors
///
/// See [`CommandError`].
pub(super) fn output(
    program: &str,
    arguments: &[&str],
    stop: Option<&StopSignal>,
) -> Result<String, CommandError> {
    let named = || program.to_owned();
    let system = |source| CommandError::System { program: named(), source };
    let mut child = Command::new(program)
        .args(arguments)
        // Messages and times in one form, whatever the user's language.
        .env("LC_ALL", "C")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .process_group(0)
        .spawn()
        .map_err(|source| match source.kind() {
            std::io::ErrorKind::NotFound => CommandError::Missing { program: named() },
            _ => system(source),
        })?;
    let (out, err) = (reader(child.stdout.take()), reader(child.stderr.take()));
    let begun = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().map_err(system)? {
            break status;
        }
        let is_stopped = stop.is_some_and(|stop| stop.signal().is_some());
        if is_stopped || PATIENCE < begun.elapsed() {
            let _ = child.kill();
            let _ = child.wait();
            return Err(if is_stopped {
                CommandError::Stopped { program: named() }
            } else {
                CommandError::Late { program: named() }
            });
        }
        std::thread::sleep(GLANCE);
    };
    let (out, err) = (text_of(out).map_err(system)?, text_of(err).map_err(system)?);
    if status.success() {
        return Ok(out);
    }
    let lines: Vec<&str> =
        err.lines().map(str::trim).filter(|line| !line.is_empty()).take(20).collect();
    let said = if lines.is_empty() { status.to_string() } else { lines.join("; ") };
    Err(CommandError::Failed { program: named(), said })
}

type Reader = JoinHandle<std::io::Result<Vec<u8>>>;

/// Reads in a thread, so that a command with much to say does not wait for it.
fn reader(source: Option<impl Read + Send + 'static>) -> Option<Reader> {
    source.map(|source| std::thread::spawn(move || COMMAND_BYTES.read(source)))
}

fn text_of(reader: Option<Reader>) -> std::io::Result<String> {
    let bytes = reader.map(JoinHandle::join).transpose();
    let bytes = bytes.map_err(|_| std::io::Error::other("a thread failed"))?;
    Ok(String::from_utf8_lossy(&bytes.transpose()?.unwrap_or_default()).into_owned())
}
