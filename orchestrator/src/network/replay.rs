//! What a configured network would have done, under a seed: in this process, without files.

use super::kpis::Figures;
use super::tracks::Tracks;
use crate::config::{Plan, SideConfig, Start};
use crate::measure::packets::Packet;
use bytes::Bytes;
use netsim::sim::Network;
use proto::config::{Node, Problem};
use proto::rng::{Draws, Purpose};
use proto::side::{NetInput, NetSimulator as _, RobotInput, RobotSimulator as _, Setup};
use proto::site::Site;
use proto::types::{Coupling, MoteCommand, MoteOrder, NS_PER_S, NetRecord};
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
        for (name, side) in [("netsim", &plan.netsim), ("robotsim", &plan.robotsim)] {
            if side.url.is_some() {
                return unfit(format!(
                    "{name}.url: a replay takes place in this program, and cannot ask a simulator elsewhere"
                ));
            }
        }
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
            Some(tracks) => {
                let unseen: Vec<String> =
                    tracks.unseen(n).iter().take(8).map(ToString::to_string).collect();
                if !unseen.is_empty() {
                    return unfit(format!(
                        "no place is known of agents {}: every agent of the experiment needs one",
                        unseen.join(", ")
                    ));
                }
            }
            None if plan.experiment.coupling != Coupling::Sequential => {
                return unfit(format!("{OWN_ROBOTS}; give measured places with --positions"));
            }
            None => {}
        }
        let ends = packets.iter().map(|packet| packet.received_s.unwrap_or(packet.time_s));
        let until_ns = (ends.fold(0.0, f64::max) * NS_PER_S as f64).ceil() as u64;
        let mut problems = Vec::new();
        let site = proto::config::parse(&plan.site_toml).unwrap_or_else(|_| Node::empty_table());
        let (site, _) = proto::site::read(&site, "site", &mut problems);
        let has_apps = network.get("app").and_then(toml::Value::as_array).is_some();
        let resent = if has_apps { Vec::new() } else { packets.to_vec() };
        Ok(Self { plan, site, tracks, resent, until_ns: until_ns.max(1) })
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
        let Plan { experiment, timeline, .. } = &self.plan;
        let mut robots = Swarm::default();
        // The robots are those of the experiment, whatever the network's chances.
        let setup = |toml: &str, side: &SideConfig, seed: u64| {
            let mut experiment = experiment.clone();
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
        };
        let side = &self.plan.robotsim;
        let begin = robots
            .configure(&setup(&side.toml, side, experiment.seed)?)
            .map_err(ReplayError::Refused)?;
        let mut radios = Network::default();
        let seed = Draws::new(experiment.seed, Purpose::Replay).words(number, 0, 0)[0] >> 1;
        let mut told = setup(&network.to_string(), &self.plan.netsim, seed)?;
        told.files.extend(trace.map(|trace| (LINKS.to_owned(), trace.clone())));
        let start = radios.configure(&told).map_err(ReplayError::Refused)?;
        let waits = match self.plan.start {
            Some(start) => start == Start::WhenFormed,
            None => true,
        } && start.formation.is_some();
        let mut started_ns = (!waits).then_some(0);
        let (mut states, mut payloads) = (begin.states, begin.payloads);
        let mut deliveries = None;
        let mut motes = start.motes;
        let mut packets = Vec::new();
        let mut resent = self.resent.iter().peekable();
        let (mut step, mut from_ns) = (0, 0);
        while from_ns < self.until_ns {
            step += 1;
            let until_ns = from_ns + experiment.step_ns;
            let mut moved = Vec::new();
            if let Some(tracks) = &self.tracks {
                tracks.place(until_ns as f64 / NS_PER_S as f64, &mut states);
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
            if started_ns.is_none() && reply.formation.is_some_and(|it| it.formed_ns.is_some()) {
                started_ns = Some(until_ns);
            }
            packets.extend(reply.packets.iter().flat_map(ended));
            (deliveries, motes) = (Some(reply.deliveries), reply.motes);
            from_ns = until_ns;
        }
        packets.sort_by(|a, b| a.time_s.total_cmp(&b.time_s).then(a.source.cmp(&b.source)));
        Ok(packets)
    }
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

/// Packets whose way has ended, those for everyone apart.
fn ended(packets: &proto::types::Packets) -> impl Iterator<Item = Packet> + '_ {
    let to_one = |&i: &usize| packets.destination[i] != u32::MAX;
    (0..packets.len()).filter(to_one).map(|i| {
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
