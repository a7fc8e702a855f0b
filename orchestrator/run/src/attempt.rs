//! A run under way: begun, or gone on from a checkpoint. A run that loses a side goes on as a new attempt.

use super::interrupt::Interrupt;
use super::start::{
    Processes, SideIdentity, StartOptions, Started, connect, header, identity, orders, ready_with,
    side,
};
use super::warm_start::{FormedFiles, FormedSaver};
use super::{RunError, record_of};
use bytes::Bytes;
use drive::coupling::{Coupled, Position};
use drive::peer::{NetworkSide, Orders, Peer as _, Remote, RobotSide, SideError};
use drive::{ConfigureRequests, Observer, Past, Taken, Wanted};
use experiment::{Overrides, Plan, Start};
use proto::exchange::Configured;
use proto::types::NetRecord;
use record::checkpoint::Checkpoint;
use record::leftover::{Leftover, LeftoverError};
use record::run_log::{self, RunLog};
use record::{RecordError, Recorder, ReplacePolicy, Reservation, RunHeader, States, StepRecord};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use view::live::LiveFeed;

/// Both sides and the record, ready for the next step.
pub(super) struct Attempt {
    pub(super) coupled: Processes,
    pub(super) recording: Recording,
    pub(super) waits: bool,
    pub(super) records: Vec<NetRecord>,
    pub(super) past: Past,
    pub(super) robots: SideIdentity,
    pub(super) network: SideIdentity,
    /// What should be checked before the results are trusted.
    pub(super) warnings: Vec<String>,
    /// Where and how other programs may give orders, by side.
    pub(super) orders: Vec<(&'static str, Orders)>,
}

/// Where a run's results go, and what it has come from.
pub(super) struct Origin {
    /// Folder of results.
    pub(super) out: PathBuf,
    /// Which earlier results the result replaces.
    pub(super) replace: ReplacePolicy,
    /// Folders of attempts that failed: removed when the run is recorded.
    pub(super) left: Vec<PathBuf>,
    /// The steps after which it went on from a checkpoint.
    pub(super) resumed: Vec<u64>,
}

impl Origin {
    /// A run that begins.
    pub(super) fn new(out: PathBuf, replace: ReplacePolicy) -> Self {
        Self { out, replace, left: Vec::new(), resumed: Vec::new() }
    }
}

/// Where a run is recorded.
pub(super) struct Begun {
    pub(super) reservation: Reservation,
    pub(super) replace: ReplacePolicy,
    pub(super) log: RunLog,
    /// The folder of the attempt before, whose log goes on.
    pub(super) before: Option<PathBuf>,
}

impl Begun {
    /// Begins the record.
    fn recorder(self, header: RunHeader) -> Result<Recorder, RecordError> {
        let recorder = Recorder::create_in(self.reservation, self.replace, header)?;
        if let Some(before) = &self.before {
            run_log::carry_over(before, &recorder.path())?;
        }
        self.log.open(&recorder.path())?;
        Ok(recorder)
    }
}

impl Attempt {
    /// Records from the first step on. If that fails both sides are stopped.
    pub(super) async fn begin(
        plan: &Plan,
        begun: Begun,
        started: Started,
    ) -> Result<Self, RunError> {
        let Started {
            mut coupled,
            exchange,
            header,
            waits,
            records,
            formed_steps,
            past,
            robots,
            network,
            warnings,
            orders,
        } = started;
        let urls = urls(&robots, &network);
        let is_warm = !formed_steps.is_empty();
        let recording = begun.recorder(header).and_then(|mut recorder| {
            recorder.configured(exchange)?;
            let mut recording = Recording::new(recorder, plan, urls);
            for step in formed_steps {
                recording.record(step)?;
            }
            Ok(recording)
        });
        match recording {
            Ok(mut recording) => {
                if is_warm && let Err(error) = recording.store(&mut coupled).await {
                    coupled.stop().await;
                    return Err(error);
                }
                Ok(Self {
                    coupled,
                    recording,
                    waits,
                    records,
                    past,
                    robots,
                    network,
                    warnings,
                    orders,
                })
            }
            Err(error) => {
                coupled.stop().await;
                Err(RunError::Record { error, before_start: true })
            }
        }
    }

    /// Goes on from the latest checkpoint in `dir`, the folder of an attempt that failed: records its steps up to there again, and
    /// puts both sides back. Where a side keeps no snapshots, the run begins anew and is compared with what was recorded.
    pub(super) async fn go_on(
        plan: &Plan,
        options: &StartOptions,
        origin: &Origin,
        dir: &Path,
        interrupt: &mut Interrupt,
    ) -> Result<Self, RunError> {
        let unusable = |error: LeftoverError| RunError::Leftover { error };
        let mut leftover = Leftover::open(dir).map_err(unusable)?;
        let exchange = leftover.configured().map_err(unusable)?;
        let checkpoint = leftover.checkpoint().cloned();
        let reservation = reserve(&origin.out, &plan.name).await?;
        let begun = Begun {
            reservation,
            replace: origin.replace,
            log: options.run_log.clone(),
            before: Some(dir.to_owned()),
        };
        let (robots, network) = tokio::select! {
            biased;
            connected = connect_patiently(plan, options) => connected?,
            signal = interrupt.first() => return Err(RunError::Interrupted { signal }),
        };
        match checkpoint {
            Some(Checkpoint {
                robots: Some(ours), network: Some(theirs), step, time_ns, ..
            }) => {
                let states = [ours, theirs];
                let end = CheckpointEnd { step, time_ns, states };
                restored(plan, begun, leftover, exchange, end, (robots, network)).await
            }
            _ => {
                let asked = ConfigureRequests {
                    robots: exchange.robots_request,
                    network: exchange.network_request,
                };
                // The plan has its checksum: the file is the one that the run started from.
                let formed = FormedFiles::default().open(&mut plan.clone())?;
                let wanted = Wanted::Record;
                let formed = formed.as_deref();
                let started =
                    ready_with(plan, robots, network, wanted, Some(asked), formed).await?;
                let mut attempt = Self::begin(plan, begun, started).await?;
                for _ in 0..attempt.recording.step {
                    leftover.next_step();
                }
                attempt.recording.expected = Some(leftover);
                Ok(attempt)
            }
        }
    }
}

/// Reserves the place of the results. A process that was just killed may hold it for a moment.
async fn reserve(out: &Path, name: &str) -> Result<Reservation, RunError> {
    let begun = Instant::now();
    loop {
        match Reservation::new(out, name) {
            Err(RecordError::Locked { .. }) if begun.elapsed() < HELD_BY_KILLED => {
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
            reservation => {
                return reservation.map_err(|error| RunError::Record { error, before_start: true });
            }
        }
    }
}

/// How long a process that was killed may take to be gone.
const HELD_BY_KILLED: Duration = Duration::from_secs(3);

/// The step that a checkpoint is of, and both sides' states after it.
struct CheckpointEnd {
    step: u64,
    time_ns: u64,
    states: [Bytes; 2],
}

/// Records the steps up to a checkpoint again and puts both sides back there. If that fails both sides are stopped.
async fn restored(
    plan: &Plan,
    begun: Begun,
    mut leftover: Leftover,
    exchange: Configured,
    end: CheckpointEnd,
    (mut robots, mut network): (Remote<RobotSide>, Remote<NetworkSide>),
) -> Result<Attempt, RunError> {
    let (ours, theirs) = (identity(&robots), identity(&network));
    let urls = urls(&ours, &theirs);
    let restore = async {
        let forms = exchange.network_start.formation.is_some();
        let start =
            drive::starts(plan, robots.described(), network.described(), forms).map_err(side)?;
        let waits = start == Start::WhenFormed;
        let again = |error: RecordError| RunError::Record { error, before_start: true };
        let mut recorder = begun.recorder(header(plan, &exchange, start)).map_err(again)?;
        let (past, last) = record_again(&mut recorder, &mut leftover, &exchange, &end, waits)
            .await
            .map_err(again)?;
        let Some(last) = last.filter(|last| last.step == end.step) else {
            return Err(RunError::Leftover { error: leftover.ends_before(end.step) });
        };
        let at = (last.step, last.time_ns);
        let [state, network_state] = end.states.clone();
        let Configured { robots_request, robots_start, network_request, network_start } = &exchange;
        robots
            .restore(state.clone(), None, robots_request, robots_start, at)
            .await
            .map_err(side)?;
        network
            .restore(network_state.clone(), None, network_request, network_start, at)
            .await
            .map_err(side)?;
        let states =
            States { robots: Some(state), network: Some(network_state), urls: urls.clone() };
        recorder.checkpoint(states).map_err(again)?;
        Ok((recorder, past, last, waits))
    };
    match restore.await {
        Ok((recorder, past, last, waits)) => {
            let orders = orders(&robots, &network);
            let Configured { robots_start, network_start, .. } = exchange;
            let StepRecord { step, time_ns, robots: moved, network: carried, .. } = last;
            let position = Position { step, time_ns, robots: moved, network: carried };
            let coupled = Coupled::new(
                robots,
                network,
                plan.experiment.clone(),
                &robots_start,
                &network_start,
            )
            .after(&position);
            let mut recording = Recording::new(recorder, plan, urls);
            recording.latest = Some(step);
            Ok(Attempt {
                coupled,
                recording,
                waits,
                records: network_start.records,
                past,
                robots: ours,
                network: theirs,
                // They were given before the first step.
                warnings: Vec::new(),
                orders,
            })
        }
        Err(error) => {
            tokio::join!(robots.stop(), network.stop());
            Err(error)
        }
    }
}

/// Records what an earlier attempt has recorded, up to a checkpoint. Returns what a driver that goes on has to know, and the last
/// step.
async fn record_again(
    recorder: &mut Recorder,
    leftover: &mut Leftover,
    exchange: &Configured,
    end: &CheckpointEnd,
    waits: bool,
) -> Result<(Past, Option<StepRecord>), RecordError> {
    recorder.configured(exchange.clone())?;
    if let Some(part) = leftover.capture(end.time_ns)? {
        recorder.capture(part)?;
    }
    let mut past = PastSteps::new(exchange, waits);
    let mut last: Option<StepRecord> = None;
    while last.as_ref().is_none_or(|last| last.step < end.step) {
        let Some(step) = leftover.next_step() else { break };
        past.add(&step);
        last = Some(step.clone());
        recorder.step(step)?;
        // This may take minutes: the connections to both sides must stay alive.
        tokio::task::yield_now().await;
    }
    Ok((past.past, last))
}

/// Works out from recorded steps what the driver knew after them.
struct PastSteps {
    past: Past,
    time_ns: u64,
    had_formed: bool,
}

impl PastSteps {
    fn new(exchange: &Configured, waits: bool) -> Self {
        let formation = exchange.network_start.formation.as_ref();
        let had_formed = formation.is_some_and(|formation| formation.formed_ns.is_some());
        let started = (!waits).then_some((0, 0));
        Self { past: Past { started, has_just_formed: false }, time_ns: 0, had_formed }
    }

    fn add(&mut self, step: &StepRecord) {
        if self.past.started.is_none() && !step.robots.held {
            self.past.started = Some((self.time_ns, step.step - 1));
        }
        let formation = step.network.formation.as_ref();
        let has_formed = formation.is_some_and(|formation| formation.formed_ns.is_some());
        self.past.has_just_formed = has_formed && !self.had_formed;
        self.had_formed = has_formed;
        self.time_ns = step.time_ns;
    }
}

/// Connects to both sides; one that runs elsewhere is waited for as long as the plan says.
async fn connect_patiently(
    plan: &Plan,
    options: &StartOptions,
) -> Result<(Remote<RobotSide>, Remote<NetworkSide>), RunError> {
    let begun = Instant::now();
    let limit = Duration::from_secs_f64(plan.reconnect_limit_s);
    loop {
        match connect(plan, options).await {
            Err(RunError::Side { error, .. }) if is_absent(&error) && begun.elapsed() < limit => {
                tokio::time::sleep(RETRY).await;
            }
            other => return other,
        }
    }
}

/// How long to wait between two attempts to reach a side.
const RETRY: Duration = Duration::from_millis(500);

/// A side may come back.
fn is_absent(error: &SideError) -> bool {
    match error {
        SideError::Unreachable { .. } => true,
        SideError::Both(robots, network) => is_absent(robots) || is_absent(network),
        _ => false,
    }
}

/// A side died or cannot be reached: nothing is wrong with the experiment.
pub(super) fn is_lost(error: &SideError) -> bool {
    match error {
        SideError::Exited { .. } | SideError::Lost { .. } | SideError::Hangs { .. } => true,
        SideError::Both(robots, network) => is_lost(robots) && is_lost(network),
        _ => false,
    }
}

fn urls(robots: &SideIdentity, network: &SideIdentity) -> [Option<String>; 2] {
    [robots, network].map(|side| (!side.is_child).then(|| side.url.clone()))
}

/// The plan of a run that was killed, from its folder: files that it names are those that were recorded.
pub(super) fn plan_of(
    dir: &Path,
    leftover: &mut Leftover,
    overrides: &Overrides,
) -> Result<(Plan, Configured), RunError> {
    let exchange = leftover.configured().map_err(|error| RunError::Leftover { error })?;
    let plan = recorded_plan(&dir.join("config.toml"), &exchange, overrides)?;
    Ok((plan, exchange))
}

/// The plan of a recorded run: files that it names are those that were recorded.
pub(super) fn recorded_plan(
    config: &Path,
    exchange: &Configured,
    overrides: &Overrides,
) -> Result<Plan, RunError> {
    let mut overrides = overrides.clone();
    for (section, request) in
        [("robotsim", &exchange.robots_request), ("netsim", &exchange.network_request)]
    {
        for (name, content) in &request.files {
            overrides.files.insert((section.to_owned(), name.clone()), content.clone());
        }
    }
    Ok(experiment::load(config, &overrides)?)
}

/// Records the steps that it is given, and stores checkpoints.
pub(super) struct Recording {
    pub(super) recorder: Recorder,
    /// The steps of an earlier attempt, which this one must repeat.
    expected: Option<Leftover>,
    every: Option<Duration>,
    stored: Instant,
    urls: [Option<String>; 2],
    /// The step of the latest checkpoint.
    pub(super) latest: Option<u64>,
    step: u64,
    /// Where it is shown while it lasts.
    pub(super) live: Option<LiveFeed>,
    /// Saves the network once it has formed.
    pub(super) saver: Option<FormedSaver>,
}

impl Recording {
    fn new(recorder: Recorder, plan: &Plan, urls: [Option<String>; 2]) -> Self {
        let is_kept = plan.output.mcap && 0.0 < plan.checkpoint_every_s;
        Self {
            recorder,
            expected: None,
            every: is_kept.then(|| Duration::from_secs_f64(plan.checkpoint_every_s)),
            stored: Instant::now(),
            urls,
            latest: None,
            step: 0,
            live: None,
            saver: None,
        }
    }

    /// Stores a checkpoint before the first step of its own, if it stores any: the states of a run that starts from a formed
    /// network draw from its own seed, so the run can go on without the file.
    async fn store(&mut self, coupled: &mut Processes) -> Result<(), RunError> {
        if self.every.is_none() {
            return Ok(());
        }
        let [robots, network] = coupled.snapshots().await.map_err(side)?;
        self.checkpoint(robots, network)
            .map_err(|error| RunError::Record { error, before_start: true })
    }

    /// Records a step.
    fn record(&mut self, record: StepRecord) -> Result<(), RecordError> {
        self.step = record.step;
        match self.expected.as_mut().map(Leftover::next_step) {
            Some(Some(expected)) if expected.digest != record.digest => {
                return Err(RecordError::NotRepeated { step: record.step });
            }
            Some(None) => self.expected = None,
            _ => {}
        }
        if let Some(live) = &mut self.live {
            live.step(&record);
        }
        if let Some(saver) = &mut self.saver {
            saver.step(&record);
        }
        self.recorder.step(record)
    }
}

impl Observer for Recording {
    type Error = RecordError;

    fn step(&mut self, taken: Taken) -> Result<(), RecordError> {
        self.record(record_of(taken))
    }

    fn wants_formed(&mut self) -> bool {
        self.saver.as_ref().is_some_and(|saver| !saver.is_saved())
    }

    fn formed(&mut self, robots: Option<Bytes>, network: Option<Bytes>) -> Result<(), RecordError> {
        match (&mut self.saver, robots, network) {
            (Some(saver), Some(robots), Some(network)) => saver.save(robots, network),
            _ => Ok(()),
        }
    }

    fn may_go_on(&mut self, time_ns: u64) -> bool {
        self.live.as_ref().is_none_or(|live| live.may_step(time_ns))
    }

    fn wants_checkpoint(&mut self) -> bool {
        self.every.is_some_and(|every| every <= self.stored.elapsed())
    }

    fn checkpoint(
        &mut self,
        robots: Option<Bytes>,
        network: Option<Bytes>,
    ) -> Result<(), RecordError> {
        self.stored = Instant::now();
        self.latest = Some(self.step);
        self.recorder.checkpoint(States { robots, network, urls: self.urls.clone() })
    }
}
