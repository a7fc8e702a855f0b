//! The network as a whole: what a step brings in, slots, and what it reports.

use super::calendar::Calendar;
use super::capture::Capture;
use super::frames::FrameLog;
use super::hush::ListeningCache;
use super::inbox::Inbox;
use super::oracle::{Waiting, Ways};
use super::scratch::Scratch;
use crate::app::packets::Packets;
use crate::app::{App, Events};
use crate::lowpan::DropReason;
use crate::mesh::config::Config;
use crate::mote::addresses::Addresses;
use crate::mote::settings::Settings;
use crate::mote::{Mote, World};
use crate::place::{self, Place};
use crate::sf::oracle::OracleConfig;
use physics::asn::Asn;
use physics::medium::jam::Jams;
use physics::medium::links::Links;
use physics::medium::slot::SlotMedium;
use proto::ids::MoteId;
use proto::side::{NetInput, NetOutput};
use proto::site::Site;
use proto::time::{SimDuration, SimTime};
use proto::types::{DeliveryColumn, Experiment, NetRecord};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The state of the network: all that changes with time, and that a snapshot saves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Positions of the motes.
    pub place: Place,
    /// The motes, by number.
    pub motes: Vec<Mote>,
    /// For each mote, the next slot in which it acts.
    pub calendar: Calendar,
    /// Packets from end to end.
    pub packets: Packets<DropReason>,
    /// Jamming of channels that is in force.
    pub jams: Jams,
    /// Frames heard, by receiver; empty if nobody wants to know.
    pub heard: Vec<Vec<HeardOf>>,
    /// What waits where, if one scheduler decides for all; otherwise nothing does.
    pub waiting: Waiting,
    /// Events that applications report.
    pub events: Events,
    /// Whether everybody takes part.
    pub formed: Formed,
    /// The first slot that has not been simulated.
    pub asn: Asn,
}

/// Whether everybody takes part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Formed {
    /// When everybody did for the first time.
    pub formed: Option<SimTime>,
}

/// Frames heard over a link.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeardOf {
    pub(super) sender: MoteId,
    pub(super) frames: u64,
    pub(super) sum_dbm: f64,
}

/// The 6TiSCH network.
#[derive(Debug)]
pub struct Mesh {
    pub(super) experiment: Experiment,
    /// Seed of the draws to come: that of the experiment, unless there is another one since.
    pub(super) seed: u64,
    pub(super) columns: Vec<DeliveryColumn>,
    pub(super) records: Vec<NetRecord>,
    pub(super) config: Config,
    pub(super) settings: Settings,
    pub(super) addresses: Addresses,
    pub(super) state: State,
    pub(super) links: Links,
    pub(super) medium: SlotMedium,
    pub(super) inbox: Inbox,
    pub(super) capture: Capture,
    pub(super) frames: FrameLog,
    pub(super) scratch: Scratch,
    /// By mote: when a timer wants to be looked at, as last rescheduled; 0: not known.
    pub(super) due: Vec<SimTime>,
    pub(super) listening_cache: ListeningCache,
    /// Somebody has become ready, or is no longer, since it was last looked whether all are.
    pub(super) readiness_changed: bool,
    /// Whether one scheduler decides for all: `sf.kind = "oracle"`. Its ways, as far as they are known.
    pub(super) has_oracle: bool,
    pub(super) ways: Ways,
}

impl Mesh {
    /// A network at time 0: roots run, all others look for it.
    #[must_use]
    pub fn new(
        experiment: Experiment,
        config: Config,
        settings: Settings,
        addresses: Addresses,
        site: Site,
        columns: Vec<DeliveryColumn>,
        records: Vec<NetRecord>,
    ) -> Self {
        let n = experiment.agent_count;
        let place = Place::new(n, &config.absent, site);
        let motes = (0..n as u32)
            .map(|mote| Mote::new(&settings, &addresses, MoteId(mote), n as u32, experiment.seed))
            .collect();
        let state = State {
            place,
            motes,
            calendar: Calendar::new(n),
            packets: Packets::default(),
            jams: Jams::default(),
            heard: if records.contains(&NetRecord::HeardLinks) {
                vec![Vec::new(); n]
            } else {
                Vec::new()
            },
            waiting: Waiting::new(n),
            events: Events::new(&settings.apps, experiment.seed),
            formed: Formed::default(),
            asn: Asn::FIRST,
        };
        let mut mesh =
            Self::with_state(experiment, config, settings, addresses, columns, records, state);
        for mote in 0..n as u32 {
            if mesh.state.place.is_alive(mote as usize) {
                mesh.switch_on(MoteId(mote), Asn::FIRST);
            }
        }
        if mesh.has_oracle {
            mesh.look_whether_formed(Asn::FIRST);
        }
        mesh
    }

    /// A network in a state that another one of the same configuration reached.
    #[must_use]
    pub fn with_state(
        experiment: Experiment,
        mut config: Config,
        settings: Settings,
        addresses: Addresses,
        columns: Vec<DeliveryColumn>,
        records: Vec<NetRecord>,
        state: State,
    ) -> Self {
        let rule = config.interference.take().expect("an interference rule is configured");
        let medium = SlotMedium::new(experiment.seed, rule.rule, settings.compat.perfect_acks)
            .with_airtime(settings.mac.airtime);
        let n = experiment.agent_count;
        let mut links = Links::new(
            Arc::clone(&config.model),
            experiment.seed,
            &config.hopping_sequence,
            rule.horizon_dbm,
        );
        if !records.contains(&NetRecord::HeardLinks) && !columns.contains(&DeliveryColumn::RssiDbm)
        {
            links = links.without_levels();
        }
        let keys = settings.join.security.map(|security| security.keys);
        let page = config.model.channels.page;
        let capture = Capture::new(records.contains(&NetRecord::Capture), keys).on_page(page);
        let frames = FrameLog::new(records.contains(&NetRecord::Frames));
        let has_blacklists = settings.mac.blacklist.is_some();
        let has_oracle = settings.sf.as_kind::<OracleConfig>().is_some();
        Self {
            seed: experiment.seed,
            experiment,
            columns,
            records,
            config,
            settings,
            addresses,
            state,
            links,
            medium,
            inbox: Inbox::default(),
            capture,
            frames,
            scratch: Scratch::new(n),
            due: vec![SimTime::START; n],
            listening_cache: ListeningCache::new(n, has_blacklists),
            readiness_changed: true,
            has_oracle,
            ways: Ways::default(),
        }
    }

    /// Draws by another seed from here on. Lasting scatter keeps the experiment's.
    pub fn reseed(&mut self, seed: u64) {
        self.seed = seed;
        self.medium.reseed(seed);
        self.links.reseed(seed);
        self.state.motes.iter_mut().for_each(|mote| mote.reseed(seed));
    }

    /// What changes as time goes on.
    #[must_use]
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Settings of the protocols.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Which mote has which address.
    #[must_use]
    pub fn addresses(&self) -> &Addresses {
        &self.addresses
    }

    /// Runs to `input.until_ns`, or to the end of the first slot in which somebody heard a payload.
    pub fn step(&mut self, input: &NetInput<'_>) -> NetOutput {
        let slot = self.config.slot;
        let until = SimTime::from_ns(input.until_ns);
        let from_asn = Asn::first_from(SimTime::from_ns(input.from_ns), slot);
        let until_asn = Asn::first_from(until, slot);
        self.state.place.travel(input.states);
        self.state.place.move_obstacles(input.moved_obstacles);
        self.obey(input.commands, from_asn);
        self.follow_bodies(input.states, from_asn);
        self.place_radios(input);

        let step = SimDuration::from_ns(self.experiment.step_ns);
        let mut time = until;
        let mut asn = from_asn;
        while asn < until_asn {
            let period = SimTime::START + asn * slot / step * step;
            // Steps may be shorter than a control period: batteries are looked at when one begins, whatever the steps.
            if asn == Asn::first_from(period, slot) {
                self.fail_empty_motes(asn);
            }
            self.hand_over_payloads(input, asn);
            let period_end = period + step;
            // Steps may be shorter than a control period, or longer: what is redrawn with each must not depend on it.
            self.links.set_period(period.ns());
            self.ways.forget();
            let end_asn = Asn::first_from(period_end, slot).min(until_asn).max(asn + 1);
            if let Some(stopped_asn) = self.run(end_asn, input.stop_at_first_delivery) {
                time = until.min((stopped_asn + 1) * slot);
                break;
            }
            asn = end_asn;
        }
        self.state.asn = Asn::first_from(time, slot);
        self.report(input, time)
    }

    /// Runs to slot `end_asn`, which is not simulated. Returns the slot in which somebody heard a payload, where the run
    /// shall stop there.
    fn run(&mut self, end_asn: Asn, stop_at_first_delivery: bool) -> Option<Asn> {
        while let Some(asn) = self.next_asn().filter(|&asn| asn < end_asn) {
            self.occur(asn);
            if self.has_oracle {
                self.oracle_slot(asn);
            } else {
                self.slot(asn);
            }
            if stop_at_first_delivery && self.inbox.is_heard() {
                return Some(asn);
            }
        }
        None
    }

    /// The next slot in which something happens: a mote acts, or an event occurs.
    fn next_asn(&mut self) -> Option<Asn> {
        let acts_asn = self.state.calendar.next_asn();
        let Some(event) = self.state.events.next() else { return acts_asn };
        let event_asn = Asn::first_from(event, self.config.slot);
        Some(acts_asn.map_or(event_asn, |acts_asn| acts_asn.min(event_asn)))
    }

    /// Events that have occurred by slot `asn` reach the motes that they concern, where these are now.
    fn occur(&mut self, asn: Asn) {
        let now = asn * self.config.slot;
        while let Some(event) = self.state.events.take(now, self.seed) {
            let concerned = event.concerned(&self.state.place.last_seen_m);
            for mote in (0..).zip(concerned).filter(|&(_, is)| is).map(|(mote, _)| mote) {
                let node = &mut self.state.motes[mote as usize];
                let reports = node.apps.iter_mut().find(|app| app.number == event.app);
                if let Some(app) = reports.filter(|_| node.tally.on_since_asn.is_some()) {
                    app.machine().handle_event(event.at);
                    self.reschedule(MoteId(mote), asn);
                }
            }
        }
    }

    /// Radios stand where the agents are, for the whole step.
    fn place_radios(&mut self, input: &NetInput<'_>) {
        let lift_m = place::lift_m(self.config.antenna_height_m, input.states);
        let place = &self.state.place;
        let (mut ends, mut way_m) = (Vec::new(), Vec::new());
        for agent in 0..self.experiment.agent_count {
            if input.states.alive.get(agent) && place.is_alive(agent) {
                ends.push(place::end_of(input.states, agent as u32, lift_m));
                way_m.push(place.way_m[agent]);
            }
        }
        self.links.set_site(&place.site);
        self.links.set_covariates(&input.states.covariates);
        self.links.set_jams(&self.state.jams);
        self.links.set_positions(input.from_ns, &ends, &way_m);
    }

    /// A mote, and the world as it sees it in a slot.
    pub(super) fn mote_and_world(&mut self, mote: MoteId, asn: Asn) -> (&mut Mote, World<'_>) {
        let world = World {
            settings: &self.settings,
            addresses: &self.addresses,
            packets: &mut self.state.packets,
            seed: self.seed,
            asn,
            effective_asn: asn,
            now: asn * self.config.slot,
            received: asn * self.config.slot,
            readiness_changed: &mut self.readiness_changed,
            swarm: &mut self.scratch.swarm,
        };
        (&mut self.state.motes[mote.index()], world)
    }

    /// Enters the next slot in which a mote acts, `from_asn` or later.
    pub(super) fn reschedule(&mut self, mote: MoteId, from_asn: Asn) {
        let slot = self.config.slot;
        let node = &self.state.motes[mote.index()];
        if self.has_oracle {
            let timeout = node.apps.iter().filter_map(App::poll_timeout).min();
            let timer_asn = timeout.map(|due| Asn::first_from(due, slot).max(from_asn));
            let next = if self.state.waiting.is_at(mote) { Some(from_asn) } else { timer_asn };
            return self.state.calendar.set(mote, next);
        }
        let timeout = node.poll_timeout(&self.settings.mac);
        self.due[mote.index()] = timeout.unwrap_or(SimTime::NEVER);
        let timer_asn = timeout.map(|due| Asn::first_from(due, slot).max(from_asn));
        self.listening_cache.note(mote, &node.mac, &node.schedule);
        let tx_asn = node.mac.next_tx_asn(&self.settings.mac, &node.schedule, from_asn);
        let next = [timer_asn, tx_asn, node.mac.follows_at(from_asn)].into_iter().flatten().min();
        self.state.calendar.set(mote, next);
    }
}
