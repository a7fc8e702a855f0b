//! What can go wrong with a side. Every message names the side and the fact.

use proto::config::Problem;
use std::path::PathBuf;
use std::time::Duration;
use tonic::{Code, Status};

/// A failure of one side. All of them end the experiment.
#[derive(Debug, thiserror::Error)]
pub enum SideError {
    /// Both sides failed.
    #[error("{0}\n{1}")]
    Both(Box<Self>, Box<Self>),
    /// Its process could not be started.
    #[error("{side}: cannot start: {reason}")]
    Start {
        /// Which side.
        side: &'static str,
        /// Why.
        reason: String,
    },
    /// The command that is to start it cannot be run.
    #[error("{side}.command: {reason}")]
    Command {
        /// Which side.
        side: &'static str,
        /// Why not.
        reason: String,
    },
    /// Nothing listens there, or not for us.
    #[error("{side}: cannot reach {url}: {reason}")]
    Unreachable {
        /// Which side.
        side: &'static str,
        /// Where.
        url: String,
        /// What the system says.
        reason: String,
    },
    /// Something else listens there.
    #[error("{side}: the server at {url} is not a {side}: {found}")]
    NotASimulator {
        /// Which side.
        side: &'static str,
        /// Where.
        url: String,
        /// What is there.
        found: String,
    },
    /// A certificate or key of ours cannot be used.
    #[error("certificate {}: {reason}", path.display())]
    Certificate {
        /// The file.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// It lacks something that the experiment needs.
    #[error("{side}: {what}")]
    Cannot {
        /// Which side.
        side: &'static str,
        /// What it cannot do.
        what: String,
    },
    /// Its process ended.
    #[error("{side}: the process ended during {doing}: {how}{said}")]
    Exited {
        /// Which side.
        side: &'static str,
        /// What it was asked to do.
        doing: String,
        /// Exit status or signal.
        how: String,
        /// The last lines that it wrote, on lines of their own; empty unless a command had started it.
        said: String,
    },
    /// The connection broke.
    #[error("{side}: the connection to {url} was lost during {doing}: {reason}")]
    Lost {
        /// Which side.
        side: &'static str,
        /// Where.
        url: String,
        /// What it was asked to do.
        doing: String,
        /// What the system says.
        reason: String,
    },
    /// It gives no sign of life.
    #[error("{side}: does not respond: no reply to {doing} and no sign of life for {:.1} s", waited.as_secs_f64())]
    Hangs {
        /// Which side.
        side: &'static str,
        /// What it was asked to do.
        doing: String,
        /// For how long.
        waited: Duration,
    },
    /// It lives but does not answer.
    #[error(
        "{side}: no reply to {doing} within {:.0} s, although it is alive; experiment.step_deadline_s sets the limit",
        waited.as_secs_f64()
    )]
    TooSlow {
        /// Which side.
        side: &'static str,
        /// What it was asked to do.
        doing: String,
        /// For how long.
        waited: Duration,
    },
    /// It refuses its configuration for what is in it.
    #[error("{side}: refuses its configuration: {}", problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
    Unacceptable {
        /// Which side.
        side: &'static str,
        /// Everything that is wrong with it. Paths begin with `site`, or below the side's own section.
        problems: Vec<Problem>,
    },
    /// It refused a request, or failed in it.
    #[error("{side}: {} {doing}: {}{}", refused_or_failed(status), status.message().trim_end(), unusual_code(status))]
    Refused {
        /// Which side.
        side: &'static str,
        /// What it was asked to do.
        doing: String,
        /// What it said.
        status: Box<Status>,
    },
    /// It stands at another step than we brought it to.
    #[error(
        "{side}: refused {doing}: {}; it was restarted, or another program has configured it in the meantime",
        status.message()
    )]
    Taken {
        /// Which side.
        side: &'static str,
        /// What it was asked to do.
        doing: String,
        /// What it said.
        status: Box<Status>,
    },
    /// Its answer makes no sense.
    #[error("{side}: malformed reply to {doing}: {reason}")]
    Garbage {
        /// Which side.
        side: &'static str,
        /// What it was asked to do.
        doing: String,
        /// What is wrong with the answer.
        reason: String,
    },
    /// It answered for another step.
    #[error("{side}: replied for step {got} instead of step {expected}")]
    WrongStep {
        /// Which side.
        side: &'static str,
        /// The step asked for.
        expected: u64,
        /// The step answered.
        got: u64,
    },
    /// It stands at another time.
    #[error("{side}: its time is {got} ns after step {step}, which ends at {expected} ns")]
    WrongTime {
        /// Which side.
        side: &'static str,
        /// The step.
        step: u64,
        /// Where it should stand (ns).
        expected: u64,
        /// Where it stands (ns).
        got: u64,
    },
    /// It holds other state than was exchanged.
    #[error(
        "{side}: its digest of step {step} is {got}, but the exchanged data have {expected}; what it sent or received was \
         changed on its way, or is not what it holds"
    )]
    WrongDigest {
        /// Which side.
        side: &'static str,
        /// The step.
        step: u64,
        /// Digest of what was exchanged.
        expected: String,
        /// Its digest.
        got: String,
    },
}

/// A fault of its own is no refusal.
fn refused_or_failed(status: &Status) -> &'static str {
    if status.code() == Code::Internal { "failed in" } else { "refused" }
}

/// The status code, unless "failed" or "refused" says the same.
fn unusual_code(status: &Status) -> String {
    match status.code() {
        Code::Internal | Code::InvalidArgument => String::new(),
        code => format!(" ({code:?})"),
    }
}
