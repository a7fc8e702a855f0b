//! What a configured network would have done, under a seed: in this process, without files.

use super::kpis::Figures;
use super::tracks::Tracks;
use bytes::Bytes;
use experiment::{Plan, SideConfig, Start};
use measure::packets::{OWN, Packet};
use netsim::sim::Network;
use proto::config::{Node, Problem};
use proto::rng::{Draws, Purpose};
use proto::side::{
    NetInput, NetOutput, NetSimulator as _, RobotInput, RobotSimulator as _, RobotStart, Setup,
};
use proto::site::Site;
use proto::types::{AgentStates, Coupling, MoteCommand, MoteOrder, NS_PER_S, NetRecord};
use rayon::prelude::*;
use robotsim::sim::Swarm;

/// Why an experiment cannot be replayed.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// It is no experiment of a network with packets, or has parts that cannot be replayed.
    #[error("{0}")]
    Unfit(String),
    /// The network refuses what it is told.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
    Refused(Vec<Problem>),
}

/// An experiment that is replayed: who is where, who sends what, for how long.
#[derive(Clone, Debug)]
pub struct Replay {
    plan: Plan,
    site: Site,
    /// Where robots were measured; `None`: they go as the experiment has them.
    tracks: Option<Tracks>,
    /// Packets that are sent again as they were measured; empty: motes send as their applications say.
    resent: Vec<Packet>,
    until_ns: u64,
}

/// What a replay of the experiment's own robots takes.
const OWN_ROBOTS: &str = "a replay has the coupling \"sequential\" and a fixed control period";
/// The name under which measured links come to the network.
pub const LINKS: &str = "measured-links.k7";
/// The name under which measured places come to the robots as those where they begin.
const BEGIN: &str = "measured-begin.csv";

/// The payload of a packet whose length is not known (bytes).
const PAYLOAD_BYTES: u32 = 30;

impl Replay {
    /// An experiment over measured packets, and over measured places where there are any. Motes send what the
    /// experiment's applications say; where it has none, the measured packets are sent again.
    ///
    /// # Errors
    ///
    /// See [`ReplayError::Unfit`].
    pub fn new(
        plan: Plan,
        tracks: Option<Tracks>,
        packets: &[Packet],
    ) -> Result<Self, ReplayError> {
        let unfit = |why: String| Err(ReplayError::Unfit(why));
        has_both_sides(&plan)?;
        let network = network_of(&plan);
        if network.get("mode").and_then(toml::Value::as_str) != Some("6tisch") {
            return unfit(
                "netsim.mode must be \"6tisch\": without protocols there are no packets from end to end"
                    .to_owned(),
            );
        }
        let n = plan.experiment.agent_count;
        let beyond = packets.iter().flat_map(|packet| [packet.source, packet.destination]);
        if let Some(mote) = beyond.max().filter(|&mote| n <= mote as usize) {
            return unfit(format!(
                "the packets name mote {mote}, the experiment has {n} agents: motes 0 to {}. Are motes numbered otherwise there?",
                n - 1
            ));
        }
        match &tracks {
            Some(tracks) => all_are_seen(tracks, n)?,
            None if plan.experiment.coupling != Coupling::Sequential => {
                return unfit(format!("{OWN_ROBOTS}; give measured places with --positions"));
            }
            None => {}
        }
        let ends = packets.iter().map(|packet| packet.received_s.unwrap_or(packet.time_s));
        let until_ns = (ends.fold(0.0, f64::max) * NS_PER_S as f64).ceil() as u64;
        let site = site_of(&plan);
        let has_apps = network.get("app").and_then(toml::Value::as_array).is_some();
        let resent = if has_apps { Vec::new() } else { packets.to_vec() };
        Ok(Self { plan, site, tracks, resent, until_ns: until_ns.max(1) })
    }

    /// An experiment over what its robots did: they are where they were measured, from the beginning of the task on.
    ///
    /// # Errors
    ///
    /// See [`ReplayError::Unfit`].
    pub fn of_task(plan: Plan, tracks: Tracks) -> Result<Self, ReplayError> {
        has_both_sides(&plan)?;
        let n = plan.experiment.agent_count;
        all_are_seen(&tracks, n)?;
        if n < tracks.n_agents() {
            return Err(ReplayError::Unfit(format!(
                "the places name agent {}, the experiment has {n} agents: 0 to {}. Are agents numbered otherwise there?",
                tracks.n_agents() - 1,
                n - 1
            )));
        }
        if plan.experiment.coupling != Coupling::Sequential {
            return Err(ReplayError::Unfit(OWN_ROBOTS.to_owned()));
        }
        let site = site_of(&plan);
        let until_ns = ((tracks.until_s() * NS_PER_S as f64).round() as u64).max(1);
        Ok(Self { plan, site, tracks: Some(tracks), resent: Vec::new(), until_ns })
    }

    /// The same up to a time (s) at which packets may long have ceased: that none come any more is news, too.
    #[must_use]
    pub fn until(&self, until_s: f64) -> Self {
        let until_ns = (until_s * NS_PER_S as f64).round() as u64;
        Self { until_ns: self.until_ns.max(until_ns), ..self.clone() }
    }

    /// The same with robots elsewhere.
    #[must_use]
    pub fn over(&self, tracks: Tracks) -> Self {
        Self { tracks: Some(tracks), ..self.clone() }
    }

    /// The same with the experiment's own robots.
    ///
    /// # Errors
    ///
    /// They cannot be run here: see [`ReplayError::Unfit`].
    pub fn with_its_robots(&self) -> Result<Self, ReplayError> {
        if self.plan.experiment.coupling == Coupling::Sequential {
            Ok(Self { tracks: None, ..self.clone() })
        } else {
            Err(ReplayError::Unfit(OWN_ROBOTS.to_owned()))
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

    /// When it ends (ns).
    pub(super) fn until_ns(&self) -> u64 {
        self.until_ns
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
    ) -> Result<Vec<Vec<Packet>>, ReplayError> {
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
    ) -> Result<Vec<Figures>, ReplayError> {
        let numbers: Vec<u64> = seeds.collect();
        let of = |&number: &u64| Ok(Figures::of(&self.under(network, number, None)?, from_s));
        numbers.par_iter().map(of).collect()
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
    ) -> Result<Vec<Figures>, ReplayError> {
        let of = |(number, trace): &(u64, Bytes)| {
            Ok(Figures::of(&self.under(network, *number, Some(trace))?, from_s))
        };
        runs.par_iter().map(of).collect()
    }

    /// What becomes of the packets under seed `number`.
    fn under(
        &self,
        network: &toml::Table,
        number: u64,
        trace: Option<&Bytes>,
    ) -> Result<Vec<Packet>, ReplayError> {
        let mut packets = Vec::new();
        // The robots are those of the experiment, whatever the network's chances.
        let course = Course {
            network,
            number,
            trace,
            robots_seed: self.plan.experiment.seed,
            begin: None,
            counts_from_start: false,
        };
        self.drive(&course, &mut |step| packets.extend(step.reply.packets.iter().flat_map(ended)))?;
        packets.sort_by(|a, b| a.time_s.total_cmp(&b.time_s).then(a.source.cmp(&b.source)));
        Ok(packets)
    }

    /// What a side is told when a replay begins.
    fn setup(&self, toml: &str, side: &SideConfig, seed: u64) -> Result<Setup, ReplayError> {
        let mut experiment = self.plan.experiment.clone();
        experiment.seed = seed;
        let config = proto::config::parse(toml).map_err(ReplayError::Refused)?;
        Ok(Setup {
            experiment,
            site: self.site.clone(),
            config,
            path: String::new(),
            files: side.files.clone(),
            columns: Vec::new(),
            records: vec![NetRecord::Packets],
        })
    }

    /// The robots, where they begin.
    ///
    /// * `begin`: their places in place of the scenario's, as the file of a scenario `csv`.
    ///
    /// # Errors
    ///
    /// They refuse their section, or the places.
    pub(super) fn robots(
        &self,
        seed: u64,
        begin: Option<&Bytes>,
    ) -> Result<(Swarm, RobotStart), ReplayError> {
        let side = &self.plan.robotsim;
        let mut section: toml::Table = side.toml.parse().unwrap_or_default();
        if begin.is_some() {
            let mut scenario = toml::Table::new();
            scenario.insert("kind".to_owned(), "csv".into());
            scenario.insert("file".to_owned(), BEGIN.into());
            section.insert("scenario".to_owned(), scenario.into());
        }
        let mut told = self.setup(&section.to_string(), side, seed)?;
        told.files.extend(begin.map(|begin| (BEGIN.to_owned(), begin.clone())));
        let mut robots = Swarm::default();
        let start = robots.configure(&told).map_err(ReplayError::Refused)?;
        Ok((robots, start))
    }

    /// A seed for replay `number`: of the network, or of something else that has chances of its own.
    pub(super) fn seed(&self, number: u64, of: u64) -> u64 {
        Draws::new(self.plan.experiment.seed, Purpose::Replay).words(number, of, 0)[0] >> 1
    }

    /// Runs both sides in turn, and shows each step.
    pub(super) fn drive(
        &self,
        course: &Course<'_>,
        each: &mut dyn FnMut(&Stepped<'_>),
    ) -> Result<(), ReplayError> {
        let Plan { experiment, timeline, .. } = &self.plan;
        let (mut robots, begin) = self.robots(course.robots_seed, course.begin)?;
        let mut radios = Network::default();
        let seed = self.seed(course.number, 0);
        let mut told = self.setup(&course.network.to_string(), &self.plan.netsim, seed)?;
        told.files.extend(course.trace.map(|trace| (LINKS.to_owned(), trace.clone())));
        told.columns.clone_from(&begin.columns);
        let start = radios.configure(&told).map_err(ReplayError::Refused)?;
        let waits = match self.plan.start {
            Some(start) => start == Start::WhenFormed,
            None => true,
        } && start.formation.is_some();
        let mut started_ns = (!waits).then_some(0);
        let (mut states, mut payloads) = (begin.states, begin.payloads);
        let mut deliveries = None;
        let mut motes = start.motes;
        let mut resent = self.resent.iter().peekable();
        let (mut step, mut from_ns) = (0, 0);
        loop {
            let end_ns = match (course.counts_from_start, started_ns) {
                (false, _) => self.until_ns,
                (true, Some(started_ns)) => started_ns + self.until_ns,
                (true, None) => self.plan.formation_limit_ns,
            };
            if end_ns <= from_ns {
                return Ok(());
            }
            step += 1;
            let until_ns = from_ns + experiment.step_ns;
            let since_ns = if course.counts_from_start { started_ns } else { Some(0) };
            let mut moved = Vec::new();
            if let Some(tracks) = &self.tracks {
                let at_ns = since_ns.map_or(0, |since_ns| until_ns - since_ns);
                tracks.place(at_ns as f64 / NS_PER_S as f64, &mut states);
            } else {
                let reply = robots.step(&RobotInput {
                    step,
                    from_ns,
                    until_ns,
                    deliveries: deliveries.as_ref(),
                    motes: Some(&motes),
                    commands: &[],
                    hold: started_ns.is_none(),
                });
                (states, payloads, moved) = (reply.states, reply.payloads, reply.moved_obstacles);
            }
            let mut commands = match started_ns {
                Some(started_ns) => timeline.commands(started_ns, from_ns, until_ns),
                None => Vec::new(),
            };
            while let Some(packet) = resent.next_if(|packet| packet.time_s * 1e9 < until_ns as f64)
            {
                commands.push(again(packet));
            }
            let reply = radios.step(&NetInput {
                step,
                from_ns,
                until_ns,
                states: &states,
                payloads: &payloads,
                moved_obstacles: &moved,
                commands: &commands,
                stop_at_first_delivery: false,
                records: &[],
            });
            if let Some(since_ns) = since_ns {
                each(&Stepped { since_ns, until_ns, states: &states, reply: &reply });
            }
            if started_ns.is_none() && reply.formation.is_some_and(|it| it.formed_ns.is_some()) {
                started_ns = Some(until_ns);
            }
            (deliveries, motes) = (Some(reply.deliveries), reply.motes);
            from_ns = until_ns;
        }
    }
}

/// One replay.
#[derive(Clone, Copy, Debug)]
pub(super) struct Course<'a> {
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

/// A step of a replay.
#[derive(Debug)]
pub(super) struct Stepped<'a> {
    /// When time begins to count (ns).
    pub(super) since_ns: u64,
    /// When the step ends (ns).
    pub(super) until_ns: u64,
    /// Where agents are then.
    pub(super) states: &'a AgentStates,
    /// What the network did in it.
    pub(super) reply: &'a NetOutput,
}

/// Refuses simulators elsewhere.
fn has_both_sides(plan: &Plan) -> Result<(), ReplayError> {
    for (name, side) in [("netsim", &plan.netsim), ("robotsim", &plan.robotsim)] {
        if side.url.is_some() {
            return Err(ReplayError::Unfit(format!(
                "{name}.url: a replay takes place in this program, and cannot ask a simulator elsewhere"
            )));
        }
    }
    Ok(())
}

/// Refuses tracks that lack an agent.
fn all_are_seen(tracks: &Tracks, n_agents: usize) -> Result<(), ReplayError> {
    let unseen: Vec<String> = tracks.unseen(n_agents).iter().take(8).map(u32::to_string).collect();
    if unseen.is_empty() {
        return Ok(());
    }
    Err(ReplayError::Unfit(format!(
        "no place is known of agents {}: every agent of the experiment needs one",
        unseen.join(", ")
    )))
}

fn site_of(plan: &Plan) -> Site {
    let site = proto::config::parse(&plan.site_toml).unwrap_or_else(|_| Node::empty_table());
    proto::site::read(&site, "site", &mut Vec::new()).0
}

/// The network's section of an experiment, with all defaults.
fn network_of(plan: &Plan) -> toml::Table {
    let text = plan.netsim.effective_toml.as_ref().unwrap_or(&plan.netsim.toml);
    text.parse().unwrap_or_default()
}

/// The order to send a packet again.
fn again(packet: &Packet) -> MoteCommand {
    let bytes = packet.payload_bytes.unwrap_or(PAYLOAD_BYTES).min(1000) as usize;
    let order = MoteOrder::Send {
        mote: packet.source,
        destination: packet.destination,
        payload: vec![0; bytes].into(),
    };
    MoteCommand { source: "measured".to_owned(), order }
}

/// Packets whose way has ended, those for everyone apart, and those of the network itself.
fn ended(packets: &proto::types::Packets) -> impl Iterator<Item = Packet> + '_ {
    let is_own = |i: usize| packets.kinds[packets.kind[i] as usize].name == OWN;
    let is_meant = move |&i: &usize| packets.destination[i] != u32::MAX && !is_own(i);
    (0..packets.len()).filter(is_meant).map(|i| {
        let arrived = packets.outcome[i] == 0;
        let at_s = |ns: u64| ns as f64 * 1e-9;
        Packet {
            time_s: at_s(packets.created_ns[i]),
            source: packets.source[i],
            destination: packets.destination[i],
            received_s: arrived.then(|| at_s(packets.ended_ns[i])),
            hops: Some(packets.hops[i]).filter(|&hops| arrived && hops != 0),
            payload_bytes: Some(packets.payload_bytes[i]),
        }
    })
}
