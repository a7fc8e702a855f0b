//! A mote: its layers, and what passes between them.
//!
//! | module | what |
//! |---|---|
//! | [`settings`], [`compat`] | what all motes have in common |
//! | [`addresses`] | which mote has which address |
//! | `admission` | the way into the network |
//! | `announce` | what motes tell their neighbours of slots |
//! | [`down`] | from a datagram to frames in the queue |
//! | [`up`] | from a received frame to the layer it is for |
//! | [`pump`] | what the layers have to say to each other after something happened |
//! | [`tally`] | what is counted of a mote |
//! | `security` | which frames are secured, and which are taken |
//! | `reroute` | another way for datagrams whose way has failed |
//! | `traffic` | what passes between a mote and its applications |

pub mod addresses;
mod admission;
mod announce;
pub mod compat;
pub mod down;
pub mod pump;
mod reroute;
mod security;
pub mod settings;
pub mod tally;
mod traffic;
pub mod up;

use crate::app::packets::Packets;
use crate::app::{App, Host};
use crate::dice::Dice;
use crate::join::{Pledge, Proxy, Registrar};
use crate::lowpan::{DropReason, Lowpan};
use crate::mac::queue::{Queued, SWARM_HANDLE};
use crate::mac::{Cell, CellOptions, Schedule, Tsch};
use crate::mote::addresses::Addresses;
use crate::mote::settings::{Settings, Transport};
use crate::rpl::Rpl;
use crate::sf::{AnySf, minimal};
use crate::sixtop::Sixtop;
use crate::wire::Eui64;
use crate::wire::frame::{BeaconRepr, BeaconSlotframe, Content, FrameRepr};
use bytes::Bytes;
use down::Wanted;
use physics::asn::Asn;
use proto::ids::MoteId;
use proto::rng::{Draws, Purpose};
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use tally::Tally;

/// What a mote may see of the world when something happens to it.
#[derive(Debug)]
pub struct World<'a> {
    /// Settings of the network.
    pub settings: &'a Settings,
    /// Who has which address.
    pub addresses: &'a Addresses,
    /// Packets from end to end.
    pub packets: &'a mut Packets<DropReason>,
    /// Seed of the experiment.
    pub seed: u64,
    /// Absolute number of the current slot.
    pub asn: Asn,
    /// When it begins.
    pub now: SimTime,
    /// When the frame that is being handled had arrived in full; without one, when the slot begins.
    pub received: SimTime,
    /// The first slot in which a change of the schedule counts: the current one, or the next if its radio has acted.
    pub effective_asn: Asn,
    /// Set when a mote has become ready to send data, or is no longer.
    pub readiness_changed: &'a mut bool,
    /// Payloads of the swarm that frames for one mote alone brought in this slot.
    pub swarm: &'a mut Vec<Brought>,
}

/// A payload of the swarm that came in a frame for one mote alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Brought {
    /// Number of the mote that received it.
    pub receiver: MoteId,
    /// Number of the mote that sent it first.
    pub sender: MoteId,
    /// When its sender made it.
    pub sent: SimTime,
    /// Number of hops from sender to receiver.
    pub hops: u32,
    /// Strength of its last hop (dBm).
    pub rssi_dbm: f32,
    /// The payload as the robot gave it.
    pub payload: Bytes,
}

/// A mote: its layers, its applications, and what is counted of it. It is saved whole in a snapshot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mote {
    /// Number of the mote, which is that of its agent.
    pub id: MoteId,
    /// Its link-layer address, derived from its number.
    pub address: Eui64,
    /// Whether it is a root.
    pub is_root: bool,
    /// The MAC layer (TSCH): queue, clock and synchronisation.
    pub mac: Tsch,
    /// Slotframes and cells in which it sends and listens.
    pub schedule: Schedule,
    /// 6P transactions with neighbours (RFC 8480).
    pub sixtop: Sixtop,
    /// State of the scheduling function, which fills the schedule.
    pub sf: AnySf,
    /// Routing (RPL, RFC 6550): rank, parents and routes.
    pub rpl: Rpl,
    /// 6LoWPAN: fragments and their reassembly.
    pub lowpan: Lowpan,
    /// The way into the network, for a mote that is not in it yet.
    pub pledge: Pledge,
    /// The way into the network, for others.
    pub proxy: Proxy,
    /// Who decides on the way in, at a root.
    pub registrar: Option<Registrar>,
    /// Whether it has been admitted.
    pub joined: bool,
    /// Whether it has all it needs to send data: time, admission, a route, cells.
    pub ready: bool,
    /// Whether it sends beacons, so that others join through it.
    pub invites: bool,
    /// What it sends of its own accord.
    pub apps: Vec<App>,
    /// Counters of frames, packets and losses since the start.
    pub tally: Tally,
    /// Random draws of the mote, one stream for each layer.
    pub dice: MoteDice,
    /// A neighbour whose time it wants to keep.
    pub wants_sync: Option<Eui64>,
    /// Neighbours that the scheduling function has given up, of which routing has not heard yet.
    unusable: Vec<Eui64>,
    /// What the processor works on, and until when, in order of time.
    in_work: VecDeque<(SimTime, Wanted)>,
    /// When it reboots of itself, if ever.
    reboots: Option<SimTime>,
    /// How often that was drawn.
    n_reboots_drawn: u64,
    #[serde(skip)]
    cells_known: CellsKnown,
}

/// Whether the scheduling function has cells enough, with the number of changes of the schedule and the parent for which it
/// said so. It would say the same again, so it is no part of the state: all are equal.
#[derive(Clone, Copy, Debug, Default)]
struct CellsKnown(Option<((u64, Option<Eui64>), bool)>);

impl PartialEq for CellsKnown {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// Random draws of a mote, one stream for each layer, so that draws of one do not move those of another.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MoteDice {
    /// Draws of the scheduling function.
    pub scheduling: Dice,
    /// Draws of routing.
    pub routing: Dice,
    /// Draws of the join protocol.
    pub join: Dice,
    /// Draws of applications.
    pub application: Dice,
    /// Draws of the 6LoWPAN layer.
    pub lowpan: Dice,
}

impl MoteDice {
    fn new(seed: u64, mote: MoteId) -> Self {
        let dice_for = |purpose| Dice::new(seed, purpose, mote);
        Self {
            scheduling: dice_for(Purpose::Scheduling),
            routing: dice_for(Purpose::Routing),
            join: dice_for(Purpose::Join),
            application: dice_for(Purpose::Application),
            lowpan: dice_for(Purpose::Lowpan),
        }
    }

    fn reseed(&mut self, seed: u64) {
        let Self { scheduling, routing, join, application, lowpan } = self;
        for dice in [scheduling, routing, join, application, lowpan] {
            dice.reseed(seed);
        }
    }
}

impl Mote {
    /// A mote that is switched off.
    #[must_use]
    pub fn new(
        settings: &Settings,
        addresses: &Addresses,
        mote: MoteId,
        n_motes: u32,
        seed: u64,
    ) -> Self {
        let address = addresses.eui64(mote);
        let is_root = settings.roots.contains(&mote);
        let host = |app: u32| Host {
            mote,
            is_root,
            first_root: settings.roots.first().copied().unwrap_or_default(),
            n_motes,
            slot: settings.mac.slot,
            app,
            n_apps: settings.apps.len() as u32,
            seed,
        };
        let apps = (0..).zip(&settings.apps);
        let apps = apps.filter_map(|(app, spec)| App::new(spec, &host(app))).collect();
        let mut dice = MoteDice::new(seed, mote);
        Self {
            id: mote,
            address,
            is_root,
            mac: Tsch::new(&settings.mac, address, mote, is_root, seed)
                .burdened(settings.burden(mote), seed),
            schedule: Schedule::new(),
            sixtop: Sixtop::new(settings.sixtop),
            sf: settings.sf.create(mote),
            rpl: Rpl::new(settings.rpl_of(mote), address, is_root),
            lowpan: Lowpan::new(settings.lowpan, address, is_root, &mut dice.lowpan),
            pledge: Pledge::new(settings.join, address),
            proxy: Proxy::new(settings.join, address),
            registrar: is_root.then(|| Registrar::new(settings.join, address, Vec::new())),
            joined: false,
            ready: false,
            invites: false,
            apps,
            tally: Tally::default(),
            dice,
            wants_sync: None,
            unusable: Vec::new(),
            in_work: VecDeque::new(),
            reboots: None,
            n_reboots_drawn: 0,
            cells_known: CellsKnown::default(),
        }
    }

    /// Draws by another seed from here on. What was drawn before, such as the rate of its clock, stays.
    pub fn reseed(&mut self, seed: u64) {
        self.dice.reseed(seed);
        self.mac.reseed(seed);
        self.apps.iter_mut().for_each(|app| app.machine().reseed(seed));
    }

    /// Is switched on: a root begins its network, any other mote looks for one.
    pub fn switch_on(&mut self, world: &mut World<'_>) {
        self.tally.switch_on(world.asn);
        self.boot(world);
    }

    /// Is switched on in a network that needs no forming.
    pub(crate) fn switch_on_ready(&mut self, world: &mut World<'_>) {
        self.tally.switch_on(world.asn);
        self.mac.start_root(world.now);
        (self.joined, self.ready) = (true, true);
        *world.readiness_changed = true;
        let at = Some(world.now);
        let Tally { first_synced, first_joined, first_ready, .. } = &mut self.tally;
        for first in [first_synced, first_joined, first_ready] {
            *first = first.or(at);
        }
        self.set_apps_ready(world, true);
    }

    /// Begins with nothing.
    fn boot(&mut self, world: &mut World<'_>) {
        self.draw_reboot(world);
        if self.is_root {
            self.mac.start_root(world.now);
            self.begin_synced(world, None);
        } else {
            self.mac.scan(&world.settings.mac);
            self.tally.start_scanning(world.asn);
        }
        self.pump(world);
    }

    /// Is switched off, or fails: whatever it holds is lost.
    pub fn switch_off(&mut self, world: &mut World<'_>) {
        let frames = self.mac.switch_off();
        self.leave(world, frames, DropReason::Killed);
        self.reboots = None;
        self.tally.switch_off(world.asn);
    }

    /// Reboots: whatever it holds is lost, and it begins anew.
    fn reboot(&mut self, world: &mut World<'_>) {
        let frames = self.mac.switch_off();
        self.leave(world, frames, DropReason::Killed);
        self.tally.stop_scanning(world.asn);
        self.boot(world);
    }

    /// When it will reboot of itself: after a time that is exponentially distributed.
    fn draw_reboot(&mut self, world: &World<'_>) {
        let rate_per_s = world.settings.burden(self.id).reboots_per_s;
        if rate_per_s == 0.0 {
            return;
        }
        let draws = Draws::new(world.seed, Purpose::Reboot);
        let draw = draws.uniform(u64::from(self.id.0), self.n_reboots_drawn, 0);
        self.n_reboots_drawn += 1;
        // 1 - u lies in (0, 1]: the logarithm is finite.
        let wait_s = -libm::log(1.0 - draw) / rate_per_s;
        self.reboots =
            Some(world.now + world.settings.mac.slot + SimDuration::from_ns((wait_s * 1e9) as u64));
    }

    /// Takes over the time of a neighbour whose clock is off by `source_ns`.
    pub fn synchronise(&mut self, world: &mut World<'_>, source: Eui64, source_ns: i64) {
        self.tally.stop_scanning(world.effective_asn);
        self.mac.synchronise(&world.settings.mac, source, source_ns, world.now);
        self.begin_synced(world, Some(source));
        self.pump(world);
    }

    /// Synchronised: cells, then admission.
    fn begin_synced(&mut self, world: &mut World<'_>, source: Option<Eui64>) {
        let first = &mut self.tally.first_synced;
        *first = first.or(Some(world.now));
        self.schedule.set_effective(world.effective_asn);
        if let Some(slots) = self.sf.minimal_cell() {
            minimal::install(&mut self.schedule, slots);
        }
        if let Transport::BroadcastSlotframe { slots, channel } = world.settings.transport {
            let own =
                Cell::new((self.id.0 % u32::from(slots)) as u16, channel, CellOptions::TX, None);
            self.schedule.add_slotframe(SWARM_HANDLE, slots);
            self.schedule.set_background(SWARM_HANDLE, Some(channel)).expect("it was just added");
            self.schedule.add(SWARM_HANDLE, own).expect("its slot lies within");
        }
        self.with_sf(world, |sf, cx| sf.start(cx));
        self.with_sf(world, |sf, cx| sf.handle_time_source(cx, source));
        match source {
            Some(proxy) if self.pledge.is_joined() => {
                self.rpl.set_proxy(Some(proxy));
                self.admit(world);
            }
            Some(proxy) => {
                self.rpl.set_proxy(Some(proxy));
                self.pledge.start(proxy, world.now, &mut self.dice.join);
            }
            None => self.admit(world),
        }
    }

    /// Admitted to the network: looks for routes.
    pub(super) fn admit(&mut self, world: &mut World<'_>) {
        self.joined = true;
        let first = &mut self.tally.first_joined;
        *first = first.or(Some(world.now));
        self.rpl.start(world.now, &mut self.dice.routing);
    }

    /// No longer synchronised: forgets all that the network was. `frames` had waited to be sent.
    fn leave(&mut self, world: &mut World<'_>, frames: Vec<Queued>, reason: DropReason) {
        for frame in frames {
            self.lose_frame(world, &frame, reason);
        }
        for (packet, reason) in self.lowpan.clear(reason) {
            self.lose(world, packet, reason);
        }
        for (_, wanted) in std::mem::take(&mut self.in_work) {
            self.lose(world, wanted.packet, reason);
        }
        self.schedule.set_effective(world.effective_asn);
        let handles: Vec<u8> =
            self.schedule.slotframes().iter().map(|frame| frame.handle).collect();
        for handle in handles {
            self.schedule.remove_slotframe(handle);
        }
        self.sixtop.reset();
        self.sf.stop();
        self.rpl.stop();
        let keeps = world.settings.mobility.keep_admission && reason == DropReason::Desynchronised;
        if !(keeps && self.pledge.is_joined()) {
            self.pledge.leave();
        }
        while self.pledge.poll_event().is_some() {}
        self.joined = false;
        self.invites = false;
        *world.readiness_changed |= std::mem::take(&mut self.ready);
        self.wants_sync = None;
        self.unusable.clear();
        self.set_apps_ready(world, false);
        if reason == DropReason::Killed {
            self.reset_apps(world);
        }
    }

    /// The beacon it sends in a slot (RFC 8180, § 4.5). `ids`: of the template that times slots, and of the sequence of
    /// channels.
    #[must_use]
    pub fn beacon(
        &self,
        settings: &Settings,
        asn: Asn,
        [timeslot_id, hopping_sequence_id]: [u8; 2],
    ) -> FrameRepr {
        let slotframes = self.sf.minimal_cell().map(|slots| BeaconSlotframe {
            handle: 0,
            slots,
            // TX, RX, shared, timekeeping.
            links: vec![(0, 0, 0b1111)],
        });
        let join_metric =
            if self.is_root { 0 } else { self.rpl.dag_rank().saturating_sub(1).min(255) as u8 };
        FrameRepr {
            source: self.address,
            destination: None,
            sequence: self.mac.beacon_sequence(),
            ack_request: false,
            pending: false,
            security: self.beacon_security(settings),
            slots: None,
            blacklist: None,
            content: Content::Beacon(BeaconRepr {
                asn,
                join_metric,
                timeslot_id,
                hopping_sequence_id,
                slotframes: slotframes.into_iter().collect(),
            }),
        }
    }

    /// Whether it is switched on.
    #[must_use]
    pub fn is_on(&self) -> bool {
        self.tally.on_since_asn.is_some()
    }

    /// What it still needs to take part; `None`: nothing.
    #[must_use]
    pub fn lacks(&self) -> Option<Lack> {
        if self.mac.is_scanning() {
            let had_time = self.tally.n_desynchronised != 0;
            Some(if had_time { Lack::Time } else { Lack::Beacon })
        } else if !self.joined {
            Some(Lack::Admission)
        } else if !self.is_root && self.rpl.parent().is_none() {
            Some(Lack::Parent)
        } else if !self.ready {
            Some(Lack::Cells)
        } else {
            None
        }
    }
}

/// What a mote needs next to take part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Lack {
    /// It hears no beacon, or not enough of them.
    Beacon,
    /// It was synchronised, has lost that, and looks for a beacon again.
    Time,
    /// It has not been admitted.
    Admission,
    /// It has no parent in routing.
    Parent,
    /// It has no cells to its parent.
    Cells,
}

impl Lack {
    /// All of them, as they come one after the other.
    pub const ALL: [Self; 5] =
        [Self::Beacon, Self::Time, Self::Admission, Self::Parent, Self::Cells];

    /// What the mote lacks, as the end of a sentence that begins with the mote.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Beacon => "hears no enhanced beacon to follow",
            Self::Time => "has lost synchronisation and looks for a beacon again",
            Self::Admission => "waits to be admitted by the join registrar",
            Self::Parent => "has no preferred parent in routing",
            Self::Cells => "has no cells to its parent",
        }
    }
}
