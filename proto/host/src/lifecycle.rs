//! What both sides' lifecycles share: counting steps and time, and running a simulator where it cannot do harm.

use crate::orders::OrdersFromOutside;
use crate::{MAX_MESSAGE_BYTES, snapshot};
use bytes::Bytes;
use prost::Message;
use proto::config::Problem;
use proto::digest::{self, Digest};
use proto::side::{MAX_AGENTS, NotASnapshot};
use proto::types::{AgentStates, Experiment};
use proto_messages::convert::InvalidField;
use proto_messages::v1;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError};
use tonic::Status;
use tonic_types::{ErrorDetails, StatusExt as _};

/// Where an experiment stands.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Ledger {
    pub(super) experiment: Experiment,
    pub(super) step: u64,
    pub(super) time_ns: u64,
    /// The `until_ns` of the latest step: a repetition must ask the same.
    asked_ns: u64,
    /// What else the latest step was given, part by part.
    asked: Vec<Digest>,
    digest: Digest,
    /// Digest of how the experiment began; `None`: nobody asked for full digests.
    pub(super) start: Option<Digest>,
    /// Robots' latest states: those that the network uses next where it runs a step behind.
    pub(super) states: AgentStates,
}

/// Whether a step is new.
pub(super) enum Admission {
    New,
    Repeated,
}

impl Ledger {
    pub(super) fn new(experiment: Experiment, states: AgentStates, start: Option<Digest>) -> Self {
        let digest = start.unwrap_or_else(|| digest::of_step(0, 0, &states, None));
        let asked = Vec::new();
        Self { experiment, step: 0, time_ns: 0, asked_ns: 0, asked, digest, start, states }
    }

    pub(super) fn agent_count(&self) -> usize {
        self.experiment.agent_count
    }

    /// Checks the number and time of a step, and the digest that everyone agreed on after the one before.
    pub(super) fn admit(
        &self,
        step: u64,
        until_ns: u64,
        confirmed: &[u8],
    ) -> Result<Admission, Status> {
        if step == self.step && step != 0 {
            if until_ns != self.asked_ns {
                return Err(Status::failed_precondition(format!(
                    "until_ns: step {step} ended at {} ns, but its repetition requests {until_ns} ns",
                    self.asked_ns
                )));
            }
            return Ok(Admission::Repeated);
        }
        if step != self.step + 1 {
            return Err(Status::failed_precondition(format!(
                "step: the next step is {}, got {step}",
                self.step + 1
            )));
        }
        if until_ns <= self.time_ns {
            return Err(Status::failed_precondition(format!(
                "until_ns: must be later than {} ns, where step {} ended, got {until_ns} ns",
                self.time_ns, self.step
            )));
        }
        let longest_ns = self.experiment.step_ns.saturating_mul(MAX_PERIODS);
        if longest_ns < until_ns - self.time_ns {
            return Err(Status::invalid_argument(format!(
                "until_ns: must be at most {MAX_PERIODS} periods, {longest_ns} ns, after {} ns, got {until_ns} ns",
                self.time_ns
            )));
        }
        if !confirmed.is_empty() && confirmed != self.digest {
            return Err(Status::failed_precondition(format!(
                "confirmed_digest: the digest of step {} is {} here, got {}",
                self.step,
                digest::hex(&self.digest),
                digest::hex(confirmed)
            )));
        }
        Ok(Admission::New)
    }

    /// Checks that the latest step, asked for again, is given what it was given: parts and their names.
    pub(super) fn repeat(&self, asked: &[Digest], names: &[&str]) -> Result<(), Status> {
        let mut parts = self.asked.iter().zip(asked).zip(names);
        match parts.find(|((before, now), _)| before != now) {
            None => Ok(()),
            Some((_, name)) => Err(Status::failed_precondition(format!(
                "{name}: step {} was taken with other content than its repetition has",
                self.step
            ))),
        }
    }

    /// Advances after a step that was admitted: what it was given, and its digest.
    pub(super) fn advance(
        &mut self,
        step: u64,
        asked_ns: u64,
        asked: &[Digest],
        time_ns: u64,
        digest: Digest,
    ) -> Bytes {
        self.step = step;
        self.asked_ns = asked_ns;
        self.asked.clear();
        self.asked.extend_from_slice(asked);
        self.time_ns = time_ns;
        self.digest = digest;
        self.digest()
    }

    pub(super) fn digest(&self) -> Bytes {
        Bytes::copy_from_slice(&self.digest)
    }

    /// Checks that a barrier asks about the latest step.
    pub(super) fn barrier(&self, step: u64) -> Result<(), Status> {
        if step == self.step {
            Ok(())
        } else {
            Err(Status::failed_precondition(format!(
                "step: the latest step is {}, got {step}",
                self.step
            )))
        }
    }
}

/// Checks what a simulator could not be configured for at all.
pub(super) fn admissible(agent_count: u32, step_ns: u64) -> Result<(), Status> {
    if agent_count == 0 {
        return Err(Status::invalid_argument("agent_count: must be at least 1, got 0"));
    }
    if MAX_AGENTS < agent_count {
        return Err(Status::resource_exhausted(format!(
            "agent_count: must be at most {MAX_AGENTS}, got {agent_count}"
        )));
    }
    if step_ns == 0 {
        return Err(Status::invalid_argument("step_ns: must be at least 1, got 0"));
    }
    Ok(())
}

/// Path and content of files in the order in which they were sent, in which a digest covers them.
pub(super) fn sent(files: &[v1::File]) -> Vec<(&str, &[u8])> {
    files.iter().map(|file| (file.path.as_str(), &file.content[..])).collect()
}

/// The limits that both services state.
pub(super) fn limits() -> v1::Limits {
    v1::Limits { max_message_bytes: MAX_MESSAGE_BYTES as u64, max_agents: MAX_AGENTS }
}

/// The status of a call whose message breaks the contract.
pub(super) fn malformed(invalid: InvalidField) -> Status {
    Status::invalid_argument(invalid.to_string())
}

/// The problems of a configuration as one status: all of them, or the first ones and how many more there are. A status travels
/// in HTTP/2 headers, which clients accept up to 16 KiB in all: the details encoded by 4/3, the text by up to 3.
pub(super) fn refusal(problems: Vec<Problem>) -> Status {
    const DETAILS_BYTES: usize = 7_000;
    const TEXT_BYTES: usize = 1_200;
    let more = |n: usize| format!("and {n} more problem{}", if n == 1 { "" } else { "s" });
    let mut details = ErrorDetails::new();
    let mut n_bytes = 0;
    for (index, problem) in problems.iter().enumerate() {
        let description = Problem { path: String::new(), ..problem.clone() }.to_string();
        n_bytes += problem.path.len() + description.len() + 16;
        if index != 0 && DETAILS_BYTES < n_bytes {
            details.add_bad_request_violation("", more(problems.len() - index));
            break;
        }
        details.add_bad_request_violation(
            shortened(&problem.path, DETAILS_BYTES / 4),
            shortened(&description, DETAILS_BYTES / 2),
        );
    }
    let mut text = String::new();
    for (index, problem) in problems.iter().enumerate() {
        let next = problem.to_string();
        if index != 0 {
            text.push('\n');
        }
        if index != 0 && TEXT_BYTES < text.len() + next.len() {
            text.push_str(&more(problems.len() - index));
            break;
        }
        text.push_str(&shortened(&next, TEXT_BYTES));
    }
    Status::with_error_details(tonic::Code::InvalidArgument, text, details)
}

/// The beginning of a text that is longer than `n_bytes`.
fn shortened(text: &str, n_bytes: usize) -> String {
    if text.len() <= n_bytes {
        return text.to_owned();
    }
    let end = (0..=n_bytes).rev().find(|&end| text.is_char_boundary(end)).unwrap_or(0);
    format!("{} …", &text[..end])
}

/// What a service keeps of a configured experiment besides its simulator.
pub(super) trait Active: Serialize + DeserializeOwned + Send + 'static {
    fn ledger(&self) -> &Ledger;
}

/// A simulator as a service.
pub struct Host<S, A> {
    pub(super) shared: Shared<S, A>,
    /// Of the simulator, which may be busy when it is asked to describe itself.
    pub(super) config_schema_json: Arc<str>,
    pub(super) orders: Arc<OrdersFromOutside>,
}

impl<S, A> Clone for Host<S, A> {
    fn clone(&self) -> Self {
        Self {
            shared: self.shared.clone(),
            config_schema_json: Arc::clone(&self.config_schema_json),
            orders: Arc::clone(&self.orders),
        }
    }
}

impl<S, A> Host<S, A> {
    /// A service around a simulator that is not configured yet, which takes orders from anyone.
    pub(super) fn around(simulator: S, config_schema_json: &str) -> Self {
        let inner = Arc::new(Mutex::new(Lifecycle { simulator, active: None }));
        let shared = Shared { inner };
        Self { shared, config_schema_json: config_schema_json.into(), orders: Arc::default() }
    }

    /// The same service, which takes orders from those alone.
    #[must_use]
    pub fn with_orders(self, orders: OrdersFromOutside) -> Self {
        Self { orders: Arc::new(orders), ..self }
    }
}

/// A simulator, and its experiment once it is configured.
pub(super) struct Lifecycle<S, A> {
    pub(super) simulator: S,
    pub(super) active: Option<A>,
}

/// A whole experiment as a snapshot stores it. `active` and `simulator` are those of [`Lifecycle`].
#[derive(Serialize, Deserialize)]
struct Frozen<A> {
    active: A,
    simulator: Vec<u8>,
}

impl<S, A: Active> Lifecycle<S, A> {
    pub(super) fn active(&mut self) -> Result<&mut A, Status> {
        self.active.as_mut().ok_or_else(not_configured)
    }

    /// The state of the experiment, for a snapshot. `version` names the simulator and its version; `simulator` is its state.
    pub(super) fn frozen(
        &self,
        version: String,
        simulator: impl FnOnce(&S) -> Vec<u8>,
    ) -> Result<Bytes, Status> {
        let active = self.active.as_ref().ok_or_else(not_configured)?;
        let simulator = simulator(&self.simulator);
        postcard::to_stdvec(&Frozen { active, simulator })
            .map(|state| Bytes::from(snapshot::seal(&version, &state)))
            .map_err(|error| Status::internal(format!("cannot serialise the state: {error}")))
    }

    /// Restores what [`Self::frozen`] returned for the same `version`: `restore` does so for the simulator.
    /// Returns where the experiment stands.
    pub(super) fn restored(
        &mut self,
        state: &[u8],
        version: &str,
        seed: Option<u64>,
        restore: impl FnOnce(&mut S, &[u8]) -> Result<(), NotASnapshot>,
        reseed: impl FnOnce(&mut S, u64),
    ) -> Result<&Ledger, Status> {
        let refuse = |error: NotASnapshot| Status::invalid_argument(error.to_string());
        let state = snapshot::open(version, state).map_err(refuse)?;
        let frozen: Frozen<A> =
            postcard::from_bytes(state).map_err(|error| refuse(NotASnapshot(error.to_string())))?;
        restore(&mut self.simulator, &frozen.simulator).map_err(refuse)?;
        if let Some(seed) = seed {
            reseed(&mut self.simulator, seed);
        }
        Ok(self.active.insert(frozen.active).ledger())
    }

    /// Whether a call takes so little time that it need not leave the network thread.
    fn is_quick(&self) -> bool {
        self.active.as_ref().is_none_or(|active| active.ledger().agent_count() <= QUICK_AGENTS)
    }
}

/// Serialises a message of the contract as its protobuf bytes.
pub(super) mod encoded {
    use super::{Deserialize as _, Deserializer, Message, Serialize as _, Serializer};
    use serde::de::Error as _;

    pub(crate) fn serialize<S: Serializer>(
        message: &impl Message,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        message.encode_to_vec().serialize(serializer)
    }

    pub(crate) fn deserialize<'a, M: Message + Default, D: Deserializer<'a>>(
        deserializer: D,
    ) -> Result<M, D::Error> {
        M::decode(&Vec::deserialize(deserializer)?[..]).map_err(D::Error::custom)
    }
}

/// A simulator that several calls share, one at a time.
pub(super) struct Shared<S, A> {
    inner: Arc<Mutex<Lifecycle<S, A>>>,
}

impl<S, A> Clone for Shared<S, A> {
    fn clone(&self) -> Self {
        Self { inner: Arc::clone(&self.inner) }
    }
}

impl<S: Send + 'static, A: Active> Shared<S, A> {
    /// Runs `call` on the simulator: here if that is quick, else on a thread for blocking work. The lock is held for the
    /// call alone, never across an await. A panic ends the experiment, not the process.
    pub(super) async fn call<R: Send + 'static>(
        &self,
        call: impl FnOnce(&mut Lifecycle<S, A>) -> Result<R, Status> + Send + 'static,
    ) -> Result<R, Status> {
        // A lock that is taken belongs to a call on a blocking thread: wait there, not here.
        if self.inner.try_lock().is_ok_and(|lifecycle| lifecycle.is_quick()) {
            guarded(&self.inner, call)
        } else {
            self.call_blocking(call).await
        }
    }

    /// As [`Self::call`], never on this thread, so that other calls are answered meanwhile.
    pub(super) async fn call_blocking<R: Send + 'static>(
        &self,
        call: impl FnOnce(&mut Lifecycle<S, A>) -> Result<R, Status> + Send + 'static,
    ) -> Result<R, Status> {
        let inner = Arc::clone(&self.inner);
        tokio::task::spawn_blocking(move || guarded(&inner, call))
            .await
            .map_err(|error| Status::internal(format!("the call did not finish: {error}")))?
    }
}

fn guarded<S, A: Active, R>(
    inner: &Mutex<Lifecycle<S, A>>,
    call: impl FnOnce(&mut Lifecycle<S, A>) -> Result<R, Status>,
) -> Result<R, Status> {
    // A panic never leaves the lock: catch_unwind is inside.
    let mut lifecycle = inner.lock().unwrap_or_else(PoisonError::into_inner);
    match catch_unwind(AssertUnwindSafe(|| call(&mut lifecycle))) {
        Ok(result) => result,
        Err(panic) => {
            lifecycle.active = None;
            let text = panic
                .downcast_ref::<String>()
                .map(String::as_str)
                .or_else(|| panic.downcast_ref::<&str>().copied())
                .unwrap_or("no message");
            Err(Status::internal(format!("the simulator failed with an internal error: {text}")))
        }
    }
}

/// Agents up to which a step runs on the network thread: a step of so few takes less than handing it over.
pub(super) const QUICK_AGENTS: usize = 256;

/// The status of a call that came before `Configure`.
pub(super) fn not_configured() -> Status {
    Status::failed_precondition("not configured: call Configure first")
}

/// Runs what needs the processor beside a step: on another thread where that pays.
pub(super) fn beside<A: Send, B: Send>(
    n_agents: usize,
    step: impl FnOnce() -> A + Send,
    other: impl FnOnce() -> B + Send,
) -> (A, B) {
    if n_agents <= QUICK_AGENTS { (step(), other()) } else { rayon::join(step, other) }
}

/// Nominal periods that one step may span.
const MAX_PERIODS: u64 = 1000;

/// Orders that may wait for the next step.
const MAX_PENDING: usize = 100_000;

/// Adds orders to those that wait, all or none.
pub(super) fn queue<T>(pending: &mut Vec<T>, commands: Vec<T>) -> Result<(), Status> {
    if MAX_PENDING < pending.len() + commands.len() {
        return Err(Status::resource_exhausted(format!(
            "commands: at most {MAX_PENDING} may be pending for the next step; {} are pending and {} were added",
            pending.len(),
            commands.len()
        )));
    }
    pending.extend(commands);
    Ok(())
}
