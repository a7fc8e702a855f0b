//! What a configured network would have done, under a seed: in this process, without files.

mod tracked;

use super::kpis::NetworkFigures;
use super::tracks::Tracks;
use bytes::Bytes;
use drive::coupling::Coupled;
use drive::peer::{Described, InProcess, NetworkSide, Peer, RobotSide, SideError, ready};
use drive::{
    ConfigureRequests, Driver, End, Failure, Interrupts, Observer, Schedule, Stopped, Taken,
    Wanted, configure,
};
use experiment::{Plan, Start};
use measure::packets::{MeasuredPacket, NOT_MEASURED};
use netsim::sim::Network as BuiltInNetwork;
use proto::bounds::{LATENCY_S, PACKET_TIME_S};
use proto::config::Problem;
use proto::exchange::{Configured, NetworkStep};
use proto::rng::{Draws, Purpose};
use proto::types::{
    AgentStates, Coupling, Experiment, MoteCommand, MoteOrder, NS_PER_S, NetRecord,
};
use rayon::prelude::*;
use robotsim::sim::Swarm;
use std::convert::Infallible;
use std::iter::Peekable;
use std::slice::Iter;
use study::StopFlag;
use tracked::Tracked;

/// Why an experiment cannot be simulated again.
#[derive(Debug, thiserror::Error)]
pub enum ResimulationError {
    /// It is no experiment of a network with packets, or has parts that cannot be simulated here.
    #[error("{0}")]
    Unfit(String),
    /// The network refuses its configuration.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
    Refused(Vec<Problem>),
    /// A signal, or the end of a time budget, stopped it.
    #[error("the simulations were stopped before their end")]
    Stopped,
}

/// An experiment that is simulated again, in this process and without files: who is where, who sends what, for how long.
#[derive(Clone, Debug)]
pub struct Resimulation {
    plan: Plan,
    /// Where robots were measured; `None`: they go as the experiment has them.
    tracks: Option<Tracks>,
    /// Packets that are sent again as they were measured; empty: motes send as their applications say.
    resent: Vec<MeasuredPacket>,
    until_ns: u64,
    /// Whether simulations are to stop.
    stop: StopFlag,
}

/// What it takes to simulate the experiment's own robots again.
const OWN_ROBOTS: &str = "re-simulating the robots requires experiment.coupling = \"sequential\" and a fixed control period";
/// The name under which measured links come to the network.
pub const LINKS: &str = "measured-links.k7";
/// The name under which measured places come to the robots as those where they begin.
const BEGIN: &str = "measured-begin.csv";

/// The payload of a packet whose length is not known (bytes).
const PAYLOAD_BYTES: u32 = 30;

/// Refuses a campaign that would be simulated without end.
fn is_short_enough(until_s: f64) -> Result<(), ResimulationError> {
    if until_s <= (PACKET_TIME_S.most + LATENCY_S.most) as f64 {
        return Ok(());
    }
    let most_s = PACKET_TIME_S.most;
    Err(ResimulationError::Unfit(format!(
        "the campaign lasts {until_s} s; at most {most_s} s (7 days) can be simulated again. Check that times count from the \
         start of the campaign, in s"
    )))
}

impl Resimulation {
    /// An experiment over measured packets, and over measured places where there are any. Motes send what the
    /// experiment's applications say; where it has none, the measured packets are sent again.
    ///
    /// # Errors
    ///
    /// See [`ResimulationError::Unfit`].
    pub fn new(
        plan: Plan,
        tracks: Option<Tracks>,
        packets: &[MeasuredPacket],
    ) -> Result<Self, ResimulationError> {
        let unfit = |why: String| Err(ResimulationError::Unfit(why));
        has_both_sides(&plan)?;
        let network = network_of(&plan);
        if network.get("mode").and_then(toml::Value::as_str) != Some("6tisch") {
            return unfit(
                "netsim.mode must be \"6tisch\", because without protocols there are no end-to-end packets"
                    .to_owned(),
            );
        }
        let n = plan.experiment.agent_count;
        let beyond = packets.iter().flat_map(|packet| [packet.source, packet.destination]);
        if let Some(mote) = beyond.max().filter(|&mote| n <= mote as usize) {
            return unfit(format!(
                "the packets mention mote {mote}, but the experiment has {n} agents, motes 0 to {}; renumber the motes, or \
                 set experiment.agents",
                n - 1
            ));
        }
        match &tracks {
            Some(tracks) => all_are_seen(tracks, n)?,
            None if plan.experiment.coupling != Coupling::Sequential => {
                return unfit(format!("{OWN_ROBOTS}; or give measured positions with --positions"));
            }
            None => {}
        }
        let ends = packets.iter().map(|packet| packet.received_s.unwrap_or(packet.time_s));
        let until_s = ends.fold(0.0, f64::max);
        is_short_enough(until_s)?;
        let until_ns = (until_s * NS_PER_S as f64).ceil() as u64;
        let has_apps = network.get("app").and_then(toml::Value::as_array).is_some();
        let resent = if has_apps { Vec::new() } else { packets.to_vec() };
        let stop = StopFlag::default();
        Ok(Self { plan, tracks, resent, until_ns: until_ns.max(1), stop })
    }

    /// An experiment over what its robots did: they are where they were measured, from the beginning of the task on.
    ///
    /// # Errors
    ///
    /// See [`ResimulationError::Unfit`].
    pub fn of_task(plan: Plan, tracks: Tracks) -> Result<Self, ResimulationError> {
        has_both_sides(&plan)?;
        let n = plan.experiment.agent_count;
        all_are_seen(&tracks, n)?;
        if n < tracks.n_agents() {
            return Err(ResimulationError::Unfit(format!(
                "the positions mention agent {}, but the experiment has {n} agents, 0 to {}; renumber the agents, or set \
                 experiment.agents",
                tracks.n_agents() - 1,
                n - 1
            )));
        }
        if plan.experiment.coupling != Coupling::Sequential {
            return Err(ResimulationError::Unfit(OWN_ROBOTS.to_owned()));
        }
        is_short_enough(tracks.until_s())?;
        let until_ns = ((tracks.until_s() * NS_PER_S as f64).round() as u64).max(1);
        let stop = StopFlag::default();
        Ok(Self { plan, tracks: Some(tracks), resent: Vec::new(), until_ns, stop })
    }

    /// The same resimulation, which ends with [`ResimulationError::Stopped`] once the observer asks for it.
    pub(crate) fn stopped_by(&self, observer: &dyn diagnose::Observer) -> Self {
        let stop = observer.stop_flag().unwrap_or(&self.stop).clone();
        Self { stop, ..self.clone() }
    }

    /// The same resimulation, which lasts until `until_s` (s) at least, even if the measured packets end earlier.
    #[must_use]
    pub fn extended_to(&self, until_s: f64) -> Self {
        let until_ns = (until_s * NS_PER_S as f64).round() as u64;
        Self { until_ns: self.until_ns.max(until_ns), ..self.clone() }
    }

    /// The same resimulation with robots on other tracks.
    #[must_use]
    pub fn with_tracks(&self, tracks: Tracks) -> Self {
        Self { tracks: Some(tracks), ..self.clone() }
    }

    /// The same with the experiment's own robots.
    ///
    /// # Errors
    ///
    /// They cannot be run here: see [`ResimulationError::Unfit`].
    pub fn with_its_robots(&self) -> Result<Self, ResimulationError> {
        if self.plan.experiment.coupling == Coupling::Sequential {
            Ok(Self { tracks: None, ..self.clone() })
        } else {
            Err(ResimulationError::Unfit(OWN_ROBOTS.to_owned()))
        }
    }

    /// The network's section, with all defaults.
    #[must_use]
    pub fn network(&self) -> toml::Table {
        network_of(&self.plan)
    }

    /// How long it lasts (s).
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.until_ns as f64 / NS_PER_S as f64
    }

    /// Whether motes send what was measured, and not what applications say.
    #[must_use]
    pub fn resends(&self) -> bool {
        !self.resent.is_empty()
    }

    /// The experiment.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// What became of the packets under each of the seeds `first..first + n`, with `network` as the network's section.
    ///
    /// # Errors
    ///
    /// The network refuses that section.
    pub fn packets(
        &self,
        network: &toml::Table,
        seeds: std::ops::Range<u64>,
    ) -> Result<Vec<Vec<MeasuredPacket>>, ResimulationError> {
        let numbers: Vec<u64> = seeds.collect();
        numbers.par_iter().map(|&number| self.under(network, number, None)).collect()
    }

    /// The figures of what became of the packets made from `from_s` on, under each of the seeds.
    ///
    /// # Errors
    ///
    /// The network refuses that section.
    pub fn figures(
        &self,
        network: &toml::Table,
        seeds: std::ops::Range<u64>,
        from_s: f64,
    ) -> Result<Vec<NetworkFigures>, ResimulationError> {
        let numbers: Vec<u64> = seeds.collect();
        let figures_of = |&number: &u64| {
            Ok(NetworkFigures::from_packets(&self.under(network, number, None)?, from_s))
        };
        numbers.par_iter().map(figures_of).collect()
    }

    /// The same over traces of links, named [`LINKS`] in the network's section: a seed and a trace for each run.
    ///
    /// # Errors
    ///
    /// The network refuses that section.
    pub fn figures_over(
        &self,
        network: &toml::Table,
        runs: &[(u64, Bytes)],
        from_s: f64,
    ) -> Result<Vec<NetworkFigures>, ResimulationError> {
        let figures_of = |(number, trace): &(u64, Bytes)| {
            Ok(NetworkFigures::from_packets(&self.under(network, *number, Some(trace))?, from_s))
        };
        runs.par_iter().map(figures_of).collect()
    }

    /// What becomes of the packets under seed `number`.
    fn under(
        &self,
        network: &toml::Table,
        number: u64,
        trace: Option<&Bytes>,
    ) -> Result<Vec<MeasuredPacket>, ResimulationError> {
        let mut packets = Vec::new();
        // The robots are those of the experiment, whatever the network's chances.
        let course = ResimulationSettings {
            network,
            number,
            trace,
            robots_seed: self.plan.experiment.seed,
            begin: None,
            counts_from_start: false,
        };
        self.drive(&course, &mut |step| {
            packets.extend(step.reply.packets.iter().flat_map(ended_packets))
        })?;
        packets.sort_by(|a, b| a.time_s.total_cmp(&b.time_s).then(a.source.cmp(&b.source)));
        Ok(packets)
    }

    /// What both sides are asked.
    ///
    /// * `begin`: robots' places in place of the scenario's, as the file of a scenario `csv`.
    fn configure_requests(
        &self,
        course: &ResimulationSettings<'_>,
        robots: &Described,
        network: &Described,
    ) -> ConfigureRequests {
        let mut asked = ConfigureRequests::from_plan(&self.plan, robots, network, Wanted::Nothing);
        asked.robots.experiment.seed = course.robots_seed;
        if let Some(begin) = course.begin {
            let mut section: toml::Table = asked.robots.config_toml.parse().unwrap_or_default();
            let mut scenario = toml::Table::new();
            scenario.insert("kind".to_owned(), "csv".into());
            scenario.insert("file".to_owned(), BEGIN.into());
            section.insert("scenario".to_owned(), scenario.into());
            asked.robots.config_toml = section.to_string();
            asked.robots.files.insert(BEGIN.to_owned(), begin.clone());
        }
        asked.network.experiment.seed = self.seed(course.number, 0);
        asked.network.config_toml = course.network.to_string();
        asked.network.records = vec![NetRecord::Packets];
        if let Some(trace) = course.trace {
            asked.network.files.insert(LINKS.to_owned(), trace.clone());
        }
        asked
    }

    /// A seed for resimulation `number`: of the network, or of something else that has chances of its own.
    pub(super) fn seed(&self, number: u64, of: u64) -> u64 {
        Draws::new(self.plan.experiment.seed, Purpose::Resimulation).words(number, of, 0)[0] >> 1
    }

    /// Runs both sides, and shows each step: the built-in network with the experiment's robots, or with those measured.
    pub(super) fn drive(
        &self,
        course: &ResimulationSettings<'_>,
        each: &mut dyn FnMut(&ResimulatedStep<'_>),
    ) -> Result<(), ResimulationError> {
        match &self.tracks {
            None => self.drive_over(course, built_in_robots(), built_in_network(), each),
            Some(tracks) => {
                let robots = Tracked::new(tracks, course.counts_from_start);
                self.drive_over(course, robots, built_in_network(), each)
            }
        }
    }

    /// The same over any robots and any network.
    pub(super) fn drive_over<R: Peer<RobotSide>, N: Peer<NetworkSide>>(
        &self,
        course: &ResimulationSettings<'_>,
        robots: R,
        network: N,
        each: &mut dyn FnMut(&ResimulatedStep<'_>),
    ) -> Result<(), ResimulationError> {
        let asked = self.configure_requests(course, robots.described(), network.described());
        // Measured robots do not care who takes turns how.
        let experiment =
            Experiment { coupling: Coupling::Sequential, ..self.plan.experiment.clone() };
        let (mut coupled, configured) = couple(asked, experiment, robots, network)?;
        let (formation_limit_ns, end) = if course.counts_from_start {
            (self.plan.formation_limit_ns, End::AfterStart(self.until_ns))
        } else {
            (self.until_ns, End::At(self.until_ns))
        };
        let schedule = Schedule {
            plan: &self.plan,
            waits: waits(&self.plan, &configured),
            formation_limit_ns,
            end,
            stop_when_complete: false,
        };
        let mut spectator = Spectator {
            resent: self.resent.iter().peekable(),
            counts_from_start: course.counts_from_start,
            each,
        };
        finished(drive(schedule, &configured, &mut coupled, &mut spectator, &self.stop))
    }
}

/// What both sides exchange in the experiment itself: under its own seed, and with all that a run of it records. A run of the
/// processes exchanges the same, to the last bit.
///
/// * `begin`: is shown how both were configured.
/// * `each`: is shown each step.
///
/// # Errors
///
/// A side refuses its section, or the experiment names simulators elsewhere.
pub fn exchanged(
    plan: &Plan,
    begin: &mut dyn FnMut(&Configured),
    each: &mut dyn FnMut(&Taken),
) -> Result<(), ResimulationError> {
    has_both_sides(plan)?;
    let (robots, network) = (built_in_robots(), built_in_network());
    let described =
        (Peer::<RobotSide>::described(&robots), Peer::<NetworkSide>::described(&network));
    let asked = ConfigureRequests::from_plan(plan, described.0, described.1, Wanted::Record);
    let (mut coupled, configured) = couple(asked, plan.experiment.clone(), robots, network)?;
    begin(&configured);
    let schedule = Schedule::from_plan(plan, waits(plan, &configured));
    let never = StopFlag::default();
    finished(drive(schedule, &configured, &mut coupled, &mut Shown(each), &never))
}

/// Whether robots stand still until the network has formed.
fn waits(plan: &Plan, configured: &Configured) -> bool {
    plan.start != Some(Start::AtOnce) && configured.network_start.formation.is_some()
}

/// The simulator of robots that comes with this program.
pub(super) fn built_in_robots() -> InProcess<Swarm> {
    InProcess::robots(Swarm::default())
}

/// The simulator of networks that comes with this program.
fn built_in_network() -> InProcess<BuiltInNetwork> {
    InProcess::network(BuiltInNetwork::default())
}

/// Configures both sides and couples them.
fn couple<R: Peer<RobotSide>, N: Peer<NetworkSide>>(
    asked: ConfigureRequests,
    experiment: Experiment,
    mut robots: R,
    mut network: N,
) -> Result<(Coupled<R, N>, Configured), ResimulationError> {
    let configured = ready(configure(asked, &mut robots, &mut network))?;
    let (start, network_start) = (&configured.robots_start, &configured.network_start);
    Ok((Coupled::new(robots, network, experiment, start, network_start), configured))
}

/// Takes all steps.
fn drive<R: Peer<RobotSide>, N: Peer<NetworkSide>, O: Observer>(
    schedule: Schedule<'_>,
    configured: &Configured,
    coupled: &mut Coupled<R, N>,
    observer: &mut O,
    stop: &StopFlag,
) -> Result<Stopped, Failure<O::Error>> {
    let driver = Driver::new(schedule, &configured.network_start.records, coupled);
    ready(driver.drive(observer, &mut Flagged(stop), &mut ()))
}

/// Stops an experiment between two steps once a flag is set.
struct Flagged<'a>(&'a StopFlag);

impl Interrupts for Flagged<'_> {
    fn seen(&self) -> Option<&'static str> {
        self.0.is_set().then_some("the stop flag")
    }

    fn lasting(&mut self) -> impl Future<Output = &'static str> {
        std::future::pending()
    }
}

/// A network that has not formed in time is one of the things that may happen.
fn finished(ended: Result<Stopped, Failure<Infallible>>) -> Result<(), ResimulationError> {
    match ended {
        Ok(Stopped::Interrupted(_)) => Err(ResimulationError::Stopped),
        Ok(Stopped::Complete) | Err(Failure::NotFormed(_)) => Ok(()),
        Err(Failure::Side(error)) => Err(error.into()),
        Err(Failure::Observer(never)) => match never {},
    }
}

impl From<SideError> for ResimulationError {
    fn from(error: SideError) -> Self {
        match error {
            SideError::Unacceptable { problems, .. } => Self::Refused(problems),
            SideError::Cannot { what, .. } => Self::Unfit(what),
            error => Self::Unfit(error.to_string()),
        }
    }
}

/// Sends measured packets again, and shows the steps that count.
struct Spectator<'a, 'e> {
    resent: Peekable<Iter<'a, MeasuredPacket>>,
    counts_from_start: bool,
    each: &'e mut dyn FnMut(&ResimulatedStep<'_>),
}

impl Observer for Spectator<'_, '_> {
    type Error = Infallible;

    fn orders(&mut self, until_ns: u64) -> Vec<MoteCommand> {
        let is_now = |packet: &&MeasuredPacket| packet.time_s * 1e9 < until_ns as f64;
        std::iter::from_fn(|| self.resent.next_if(is_now)).map(resend_order).collect()
    }

    fn step(&mut self, Taken { outcome, start_ns, .. }: Taken) -> Result<(), Infallible> {
        if let Some(since_ns) = if self.counts_from_start { start_ns } else { Some(0) } {
            (self.each)(&ResimulatedStep {
                since_ns,
                until_ns: outcome.time_ns,
                states: &outcome.robots.states,
                reply: &outcome.network,
            });
        }
        Ok(())
    }
}

/// Shows every step whole.
struct Shown<'e>(&'e mut dyn FnMut(&Taken));

impl Observer for Shown<'_> {
    type Error = Infallible;

    fn step(&mut self, taken: Taken) -> Result<(), Infallible> {
        (self.0)(&taken);
        Ok(())
    }
}

/// Settings of one resimulation: network, seeds and initial positions.
#[derive(Clone, Copy, Debug)]
pub(super) struct ResimulationSettings<'a> {
    /// The network's section.
    pub(super) network: &'a toml::Table,
    /// Number of its seed.
    pub(super) number: u64,
    /// Links in place of its radio, named [`LINKS`].
    pub(super) trace: Option<&'a Bytes>,
    /// Seed of the robots.
    pub(super) robots_seed: u64,
    /// Where robots begin, if not as the scenario has it.
    pub(super) begin: Option<&'a Bytes>,
    /// Time counts from when the robots start, not from when the network is switched on; only then steps are shown.
    pub(super) counts_from_start: bool,
}

/// A step of a resimulation.
#[derive(Debug)]
pub(super) struct ResimulatedStep<'a> {
    /// When time begins to count (ns).
    pub(super) since_ns: u64,
    /// When the step ends (ns).
    pub(super) until_ns: u64,
    /// Where agents are then.
    pub(super) states: &'a AgentStates,
    /// What the network did in it.
    pub(super) reply: &'a NetworkStep,
}

/// Refuses simulators elsewhere.
fn has_both_sides(plan: &Plan) -> Result<(), ResimulationError> {
    if plan.warm_start.is_some() {
        return Err(ResimulationError::Unfit(
            "experiment.warm_start: must be absent, because a measurement is re-simulated from where its network was switched on"
                .to_owned(),
        ));
    }
    for (name, side) in [("netsim", &plan.netsim), ("robotsim", &plan.robotsim)] {
        if side.is_foreign() {
            let key = if side.url.is_some() { "url" } else { "command" };
            return Err(ResimulationError::Unfit(format!(
                "{name}.{key}: must be absent, because measured packets are re-simulated in this program and not by another \
                 simulator"
            )));
        }
    }
    Ok(())
}

/// Refuses tracks that lack an agent.
fn all_are_seen(tracks: &Tracks, n_agents: usize) -> Result<(), ResimulationError> {
    let unseen: Vec<String> = tracks.unseen(n_agents).iter().take(8).map(u32::to_string).collect();
    if unseen.is_empty() {
        return Ok(());
    }
    Err(ResimulationError::Unfit(format!(
        "no position is known for agents {}; every agent of the experiment needs one",
        unseen.join(", ")
    )))
}

/// The network's section of an experiment, with all defaults.
fn network_of(plan: &Plan) -> toml::Table {
    plan.netsim.effective_toml.as_ref().unwrap_or(&plan.netsim.toml).parse().unwrap_or_default()
}

/// The order that makes a mote send a measured packet again.
fn resend_order(packet: &MeasuredPacket) -> MoteCommand {
    let bytes = packet.payload_bytes.unwrap_or(PAYLOAD_BYTES).min(1000) as usize;
    let order = MoteOrder::Send {
        mote: packet.source,
        destination: packet.destination,
        payload: vec![0; bytes].into(),
    };
    MoteCommand { source: "measured".to_owned(), order }
}

/// Unicast packets that were delivered or dropped, without kinds that nobody measured.
fn ended_packets(packets: &proto::types::Packets) -> impl Iterator<Item = MeasuredPacket> + '_ {
    let kind = |i: usize| packets.kinds[packets.kind[i] as usize].name.as_str();
    let is_unicast = |&i: &usize| packets.destination[i] != u32::MAX;
    let is_measured = move |i: &usize| !NOT_MEASURED.contains(&kind(*i));
    (0..packets.len()).filter(is_unicast).filter(is_measured).map(|i| {
        let arrived = packets.outcome[i] == 0;
        let at_s = |ns: u64| ns as f64 * 1e-9;
        MeasuredPacket {
            line: 0,
            time_s: at_s(packets.created_ns[i]),
            source: packets.source[i],
            destination: packets.destination[i],
            received_s: arrived.then(|| at_s(packets.ended_ns[i])),
            hops: Some(packets.hops[i]).filter(|&hops| arrived && hops != 0),
            payload_bytes: Some(packets.payload_bytes[i]),
        }
    })
}
