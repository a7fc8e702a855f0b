//! Does a simulator keep the contract? Asked of a running one, by using it as the orchestrator would and as it would not.
//!
//! | module | content |
//! |---|---|
//! | here | the promises of both sides, and the answer |
//! | `probe` | what differs between robots and network |
//! | `predictions` | the promises of a robot simulator that predicts motion |
//! | `reseed` | the promises about snapshots and seeds |

mod predictions;
mod probe;
mod reseed;

use drive::peer::{Described, SideError, Standing, connect};
use experiment::Tls;
use probe::Probe;
use proto::config::Problem;
use proto::digest::{self, Digest};
use proto::exchange::ConfigureRequest;
use proto::types::{Coupling, Experiment};
use schemars::JsonSchema;
use serde::Serialize;
use std::fmt;
use std::future::Future;
use std::time::Duration;
use tonic::{Code, Status};

/// What is asked of whom.
#[derive(Clone, Debug)]
pub struct ConformanceOptions {
    /// Where it runs.
    pub url: String,
    /// Certificates for `https`.
    pub tls: Option<Tls>,
    /// Its configuration, as TOML text.
    pub config_toml: String,
    /// Number of agents.
    pub agents: u32,
}

/// Whether a promise was kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ContractVerdict {
    /// The simulator keeps it.
    Kept,
    /// The simulator breaks it: an experiment with this simulator will fail or cannot be trusted.
    Broken(String),
    /// The simulator accepts what it should refuse. The orchestrator never sends that, but a mistake of users would go unnoticed.
    Lax(String),
    /// The configuration does not show whether the simulator keeps it.
    Undecided(String),
    /// The promise is optional, and the simulator does not announce it.
    NotAnnounced,
}

/// A promise of the contract, as a sentence, and whether the simulator keeps it.
type Finding = (&'static str, ContractVerdict);

impl From<Result<(), String>> for ContractVerdict {
    fn from(result: Result<(), String>) -> Self {
        result.map_or_else(Self::Broken, |()| Self::Kept)
    }
}

/// All findings.
#[derive(Clone, Debug)]
pub struct Conformance {
    /// Who was asked.
    pub name: String,
    findings: Vec<Finding>,
}

impl Conformance {
    /// Whether every promise that experiments rely on was kept.
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.n_broken() == 0
    }

    fn n_broken(&self) -> usize {
        let verdicts = self.findings.iter().map(|(_, verdict)| verdict);
        verdicts.filter(|verdict| matches!(verdict, ContractVerdict::Broken(_))).count()
    }

    /// The answer for programs.
    #[must_use]
    pub fn answer(&self) -> ConformanceAnswer<'_> {
        ConformanceAnswer {
            schema: "conformance/1",
            name: &self.name,
            good: self.is_good(),
            findings: self.findings.iter().map(FindingAnswer::new).collect(),
        }
    }
}

/// The JSON of [`Conformance`].
#[derive(Debug, Serialize, JsonSchema)]
pub struct ConformanceAnswer<'a> {
    /// The format of this answer.
    #[schemars(extend("const" = "conformance/1"))]
    schema: &'static str,
    /// What the simulator calls itself.
    name: &'a str,
    /// Whether no promise is broken.
    good: bool,
    /// Each promise of the contract that was tested.
    findings: Vec<FindingAnswer<'a>>,
}

/// A promise of the contract, and whether the simulator keeps it.
#[derive(Debug, Serialize, JsonSchema)]
struct FindingAnswer<'a> {
    /// The promise.
    promise: &'static str,
    /// `kept`, `broken`, `lax` (accepted what should be refused), `undecided` (the configuration does not show it) or `not-announced` (an option that the simulator does not offer).
    verdict: &'static str,
    /// What happened instead; null where the promise is kept.
    reason: Option<&'a str>,
}

impl<'a> FindingAnswer<'a> {
    fn new((promise, verdict): &'a Finding) -> Self {
        let (verdict, reason) = match verdict {
            ContractVerdict::Kept => ("kept", None),
            ContractVerdict::Broken(reason) => ("broken", Some(reason.as_str())),
            ContractVerdict::Lax(reason) => ("lax", Some(reason.as_str())),
            ContractVerdict::Undecided(reason) => ("undecided", Some(reason.as_str())),
            ContractVerdict::NotAnnounced => ("not-announced", None),
        };
        Self { promise, verdict, reason }
    }
}

impl fmt::Display for Conformance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (promise, verdict) in &self.findings {
            match verdict {
                ContractVerdict::Kept => writeln!(f, "  kept    {promise}")?,
                ContractVerdict::Broken(reason) => writeln!(f, "  BROKEN  {promise}: {reason}")?,
                ContractVerdict::Lax(reason) => writeln!(f, "  lax     {promise}: {reason}")?,
                ContractVerdict::Undecided(reason) => writeln!(f, "  ?       {promise}: {reason}")?,
                ContractVerdict::NotAnnounced => writeln!(f, "  –       {promise}: not announced")?,
            }
        }
        let kept = self.findings.iter().filter(|(_, it)| *it == ContractVerdict::Kept).count();
        write!(f, "{}: {kept} checks passed, {} failed", self.name, self.n_broken())
    }
}

/// Asks the robot simulator at a URL.
///
/// # Errors
///
/// It cannot be reached, or is none.
pub async fn robots(options: &ConformanceOptions) -> Result<Conformance, SideError> {
    ask::<drive::peer::RobotSide>(options).await
}

/// Asks the network simulator at a URL.
///
/// # Errors
///
/// It cannot be reached, or is none.
pub async fn network(options: &ConformanceOptions) -> Result<Conformance, SideError> {
    ask::<drive::peer::NetworkSide>(options).await
}

const SESSION: &str = "a session gives the same replies as single calls";

/// How long any answer may take.
const DEADLINE: Duration = Duration::from_secs(10);
/// The period of the experiment (ns).
const STEP_NS: u64 = 100_000_000;
/// Steps that are compared.
const N_STEPS: u64 = 5;

async fn ask<S: Probe>(options: &ConformanceOptions) -> Result<Conformance, SideError> {
    let (client, described) = connect::<S>(&options.url, options.tls.as_ref()).await?;
    let session = Questions::<S> { client, n: options.agents, toml: &options.config_toml };
    let mut findings = Vec::new();
    let mut found = |promise, result: Result<(), String>| {
        let is_kept = result.is_ok();
        findings.push((promise, result.into()));
        is_kept
    };
    let version = described.contract_version;
    found(
        "Describe states a name and version 1 of the contract",
        if described.name.is_empty() || version != proto_messages::CONTRACT_VERSION {
            Err(format!("name {:?}, version {version}", described.name))
        } else {
            Ok(())
        },
    );
    let name = if described.name.is_empty() { S::SIDE.to_owned() } else { described.name.clone() };
    let configured = session.try_to_configure(1).await;
    if let Err(status) = &configured
        && status.code() == Code::InvalidArgument
    {
        let hint = match options.config_toml.trim() {
            "" => "give the simulator its section of an experiment file with --config FILE",
            _ => "mend the file of --config",
        };
        let problem = Problem::new(
            "",
            format!("the simulator refused its configuration; {hint}: {}", status.message()),
        );
        return Err(SideError::Unacceptable { side: S::SIDE, problems: vec![problem] });
    }
    if !found("Configure begins an experiment", configured.map(|_| ()).map_err(status_text)) {
        return Ok(Conformance { name, findings });
    }
    let first = session.run(1).await;
    let digests_good = first.as_ref().map(|_| ()).map_err(Clone::clone);
    if !found(
        "Step replies for the requested step and time, with complete and finite columns; Barrier has the digest",
        digests_good,
    ) {
        return Ok(Conformance { name, findings });
    }
    let first = first.unwrap_or_default();
    found("repeating the latest step gives the same reply", session.repeats(&first).await);
    found(
        "another step or an earlier time is refused with FAILED_PRECONDITION and changes nothing",
        session.order().await,
    );
    found("the same seed gives the same replies after Configure", session.same(1, &first).await);
    if described.session {
        found(SESSION, session.streams(&first).await);
    } else {
        findings.push((SESSION, ContractVerdict::NotAnnounced));
    }
    for (promise, request) in
        S::malformed(N_STEPS + 1, (N_STEPS + 1) * STEP_NS, options.agents as usize)
    {
        let verdict = match session.refuses(request).await {
            Ok(()) => ContractVerdict::Kept,
            Err(reason) => ContractVerdict::Lax(reason),
        };
        findings.push((promise, verdict));
    }
    findings.extend(S::predictions(&session, &described).await);
    findings.extend(reseed::judged(&session, &described).await);
    // Last: both begin other experiments.
    let whole = match described.full_digest {
        true => session.compares_everything(&described).await.into(),
        false => ContractVerdict::NotAnnounced,
    };
    let promise =
        "when asked for the full digest, Barrier has it, of all that was asked and replied";
    findings.push((promise, whole));
    if let Some(promise) = S::HOLD {
        let holds = match described.hold {
            true => S::holds(&session).await.into(),
            false => ContractVerdict::NotAnnounced,
        };
        findings.push((promise, holds));
    }
    Ok(Conformance { name, findings })
}

/// One simulator under question.
struct Questions<'a, S: Probe> {
    client: S::Client,
    n: u32,
    toml: &'a str,
}

impl<S: Probe> Questions<'_, S> {
    async fn configure(&self, seed: u64) -> Result<S::ConfigureResponse, String> {
        self.try_to_configure(seed).await.map_err(status_text)
    }

    async fn try_to_configure(&self, seed: u64) -> Result<S::ConfigureResponse, Status> {
        let request = S::configure_request(seed, self.n, STEP_NS, self.toml);
        within(S::configure(self.client.clone(), request)).await
    }

    /// Takes a step, and checks the reply by itself.
    async fn step(&self, step: u64) -> Result<S::StepResponse, String> {
        let (until_ns, n) = (step * STEP_NS, self.n as usize);
        let request = S::step_request(step, until_ns, n);
        let reply = within(S::step(self.client.clone(), request)).await.map_err(status_text)?;
        S::check(&reply, step, until_ns, n)?;
        Ok(reply)
    }

    /// Takes some steps, checking each. Returns the replies.
    async fn run(&self, first: u64) -> Result<Vec<Vec<u8>>, String> {
        let mut replies = Vec::new();
        let mut exchange = S::Exchange::default();
        for step in first..first + N_STEPS {
            let reply = self.step(step).await?;
            let digest =
                S::expected_digest(&reply, step, step * STEP_NS, self.n as usize, &mut exchange)?;
            let standing = self.barrier(step).await?;
            if (standing.step, standing.time_ns) != (step, step * STEP_NS) {
                return Err(format!(
                    "after step {step} Barrier reports step {}, {} ns",
                    standing.step, standing.time_ns
                ));
            }
            has_digest(&standing, step, &digest)?;
            replies.push(S::bytes(reply));
        }
        Ok(replies)
    }

    async fn barrier(&self, step: u64) -> Result<Standing, String> {
        within(S::barrier(self.client.clone(), step, step * STEP_NS)).await.map_err(status_text)
    }

    /// Takes some steps of an experiment that asks for the full digest, and for all that the simulator can reply.
    async fn compares_everything(&self, described: &Described) -> Result<(), String> {
        let n = self.n as usize;
        let coupling = Coupling::Sequential;
        let request = ConfigureRequest {
            experiment: Experiment { seed: 1, agent_count: n, step_ns: STEP_NS, coupling },
            site_toml: String::new(),
            config_toml: self.toml.to_owned(),
            files: std::collections::BTreeMap::new(),
            columns: described.columns.clone(),
            records: described.records.clone(),
            full_digest: true,
        };
        let configured = S::configure(self.client.clone(), S::configuration(&request));
        let configured = within(configured).await.map_err(status_text)?;
        let start = S::start(configured, n).map_err(|invalid| invalid.to_string())?;
        let kept = S::kept(&start);
        let start = S::start_digest(&request, &start);
        for step in 1..=N_STEPS {
            let (request, given) = S::given(step, step * STEP_NS, n, &kept);
            let reply = within(S::step(self.client.clone(), request)).await.map_err(status_text)?;
            let (reply, _) = S::reply(reply, n).map_err(|invalid| invalid.to_string())?;
            let expected = S::full_digest(&start, &given, &reply);
            let standing = self.barrier(step).await?;
            has_digest(&standing, step, &expected)?;
        }
        Ok(())
    }

    async fn repeats(&self, replies: &[Vec<u8>]) -> Result<(), String> {
        let request = S::step_request(N_STEPS, N_STEPS * STEP_NS, self.n as usize);
        let reply = within(S::step(self.client.clone(), request)).await.map_err(status_text)?;
        if replies.last() == Some(&S::bytes(reply)) {
            Ok(())
        } else {
            Err("the second reply differs".to_owned())
        }
    }

    async fn order(&self) -> Result<(), String> {
        let before = self.barrier(N_STEPS).await?;
        let wrong = [
            (N_STEPS - 1, (N_STEPS - 1) * STEP_NS, "an older step"),
            (N_STEPS + 2, (N_STEPS + 2) * STEP_NS, "a step that skips one"),
            (N_STEPS + 1, N_STEPS * STEP_NS, "a step that does not advance time"),
        ];
        for (step, until_ns, what) in wrong {
            let request = S::step_request(step, until_ns, self.n as usize);
            match within(S::step(self.client.clone(), request)).await {
                Err(status) if status.code() == Code::FailedPrecondition => {}
                Err(status) => return Err(format!("{what} is refused with {:?}", status.code())),
                Ok(_) => return Err(format!("{what} is accepted")),
            }
        }
        if self.barrier(N_STEPS).await? == before {
            Ok(())
        } else {
            Err("the refused request changed its step or time".to_owned())
        }
    }

    async fn same(&self, seed: u64, replies: &[Vec<u8>]) -> Result<(), String> {
        self.configure(seed).await?;
        let again = self.run(1).await?;
        match replies.iter().zip(&again).position(|(a, b)| a != b) {
            None => Ok(()),
            Some(index) => Err(format!("the reply to step {} differs", index + 1)),
        }
    }

    async fn streams(&self, replies: &[Vec<u8>]) -> Result<(), String> {
        self.configure(1).await?;
        let calls = (1..=N_STEPS)
            .map(|step| S::session_step(S::step_request(step, step * STEP_NS, self.n as usize)))
            .collect();
        let streamed = within(S::stream(self.client.clone(), calls)).await.map_err(status_text)?;
        let streamed: Vec<Vec<u8>> =
            streamed.into_iter().filter_map(S::step_of).map(S::bytes).collect();
        if streamed == replies { Ok(()) } else { Err("the replies differ".to_owned()) }
    }

    /// A malformed request: must be refused with `INVALID_ARGUMENT` and change nothing.
    async fn refuses(&self, request: S::StepRequest) -> Result<(), String> {
        match within(S::step(self.client.clone(), request)).await {
            Err(status) if status.code() == Code::InvalidArgument => {}
            Err(status) => {
                return Err(format!("refused with {:?} instead of InvalidArgument", status.code()));
            }
            Ok(_) => {
                // So that the next question finds it where it was.
                self.configure(1).await?;
                self.run(1).await?;
                return Err("accepted".to_owned());
            }
        }
        let standing = self.barrier(N_STEPS).await?;
        if standing.step == N_STEPS {
            Ok(())
        } else {
            Err("the refused request changed its step or time".to_owned())
        }
    }
}

async fn within<T>(call: impl Future<Output = Result<T, Status>>) -> Result<T, Status> {
    tokio::time::timeout(DEADLINE, call).await.unwrap_or_else(|_| {
        Err(Status::deadline_exceeded(format!("no reply within {} s", DEADLINE.as_secs())))
    })
}

fn has_digest(standing: &Standing, step: u64, expected: &Digest) -> Result<(), String> {
    if standing.digest[..] == expected[..] {
        return Ok(());
    }
    Err(format!(
        "the digest of step {step} is {}, expected {}",
        digest::hex(&standing.digest),
        digest::hex(expected)
    ))
}

fn status_text(status: Status) -> String {
    format!("{:?}: {}", status.code(), status.message())
}
