//! One mote's MAC against a plain statement of its rules: which cell of a slot, which frame, retries, back-off, beacons. The
//! plain one is asked in every slot; the one under test only in those that it has announced.

use netsim::dice::Dice;
use netsim::mac::queue::{Priority, Queued, SWARM_HANDLE};
use netsim::mac::tsch::{Config, Done, Outgoing, Transmission};
use netsim::mac::{Cell, CellKind, CellOptions, CellRef, Schedule, Tsch};
use netsim::wire::Eui64;
use netsim::wire::frame::{Content, FrameRepr};
use netsim::wire::security::FrameSecurity;
use physics::asn::Asn;
use physics::timing::Airtime;
use proptest::prelude::*;
use proto::ids::MoteId;
use proto::rng::Purpose;
use proto::time::{SimDuration, SimTime};
use std::collections::BTreeMap;

const SLOT_NS: u64 = 10_000_000;
const N_SLOTS: u64 = 3000;
const BEACON_NS: u64 = 700_000_000;
const PRIORITIES: [Priority; 6] = [
    Priority::Time,
    Priority::Sixp,
    Priority::Join,
    Priority::ForwardedRequest,
    Priority::Routing,
    Priority::Data,
];

/// A frame that waits.
#[derive(Clone, Debug, PartialEq)]
struct Waiting {
    id: u64,
    to: Option<Eui64>,
    priority: Priority,
    slotframe: Option<u8>,
    latest_only: bool,
    attempts: u16,
    sequence: u8,
}

/// What goes out in a slot.
#[derive(Clone, Debug, PartialEq)]
struct Sent {
    /// Slotframe and cell; none after a pending bit.
    cell: Option<(u8, u16, u16)>,
    is_shared: bool,
    channel: u8,
    /// None: a beacon.
    frame: Option<Waiting>,
    pending: bool,
}

/// The rules.
struct Plain {
    capacity: Option<usize>,
    retries: Option<u16>,
    exponents: (u8, u8),
    pending_bit: bool,
    channels: Vec<u8>,
    frames: Vec<Waiting>,
    in_flight: usize,
    /// By neighbour: exponent, and shared cells to wait.
    waits: BTreeMap<Eui64, (u8, u64)>,
    /// When the next beacon falls due (ns), and whether one is.
    beacon: (u64, bool),
    /// Slot, channel and neighbour of the frame that was announced.
    announced: Option<(Asn, u8, Eui64)>,
    next_sequence: u8,
    /// By frame that has been sent: how many others were sent for the first time after it.
    n_newer: BTreeMap<u64, u64>,
    dice: Dice,
}

impl Plain {
    /// Frames stand by priority, those of the same one in the order of arrival. The swarm's payload replaces the one before.
    /// A full queue takes a frame only at the cost of a less important one: of the least important ones, the last. Returns
    /// those that were not kept.
    fn push(&mut self, frame: Waiting) -> Option<u64> {
        if frame.latest_only
            && let Some(old) = self.frames.iter_mut().find(|other| other.latest_only)
        {
            return Some(std::mem::replace(old, frame).id);
        }
        let mut dropped = None;
        if self.capacity.is_some_and(|capacity| capacity <= self.frames.len() + self.in_flight) {
            let least = self.frames.iter().map(|other| other.priority).max();
            let least = least.filter(|&least| frame.priority < least);
            let last = self.frames.iter().rposition(|other| Some(other.priority) == least);
            let Some(last) = last else { return Some(frame.id) };
            dropped = Some(self.frames.remove(last).id);
        }
        self.frames.push(frame);
        // Stable: equal ones stay in order.
        self.frames.sort_by_key(|other| other.priority);
        dropped
    }

    fn slot(&mut self, schedule: &Schedule, asn: Asn) -> Option<Sent> {
        let now_ns = asn * SimDuration::from_ns(SLOT_NS);
        if !self.beacon.1 && self.beacon.0 <= now_ns.ns() {
            let (low_ns, high_ns) = (BEACON_NS * 3 / 4, BEACON_NS * 5 / 4);
            self.beacon = (
                (now_ns
                    + self
                        .dice
                        .duration(SimDuration::from_ns(low_ns), SimDuration::from_ns(high_ns)))
                .ns(),
                true,
            );
        }
        let cells: Vec<CellRef> = schedule.cells_at(asn).collect();
        if let Some((at, channel, to)) = self.announced.take()
            && at == asn
            && cells.is_empty()
        {
            let place = self.frames.iter().position(|frame| frame.to == Some(to))?;
            return Some(self.send(schedule, asn, place, None, channel));
        }
        for at in cells.iter().filter(|at| at.cell.options.tx) {
            let channel =
                self.channels[(asn.0 as usize + at.cell.channel as usize) % self.channels.len()];
            if self.beacon.1 && at.cell.kind != CellKind::Normal {
                self.beacon.1 = false;
                let (cell, is_shared) = (Some(name(at)), at.cell.options.shared);
                return Some(Sent { cell, is_shared, channel, frame: None, pending: false });
            }
            let Some(place) = self.frames.iter().position(|frame| goes(frame, at, schedule)) else {
                continue;
            };
            if let (true, Some(to)) = (at.cell.options.shared, self.frames[place].to)
                && let Some((_, cells)) = self.waits.get_mut(&to)
                && *cells != 0
            {
                *cells -= 1;
                continue;
            }
            return Some(self.send(schedule, asn, place, Some(at), channel));
        }
        None
    }

    fn send(
        &mut self,
        schedule: &Schedule,
        asn: Asn,
        place: usize,
        at: Option<&CellRef>,
        channel: u8,
    ) -> Sent {
        let mut frame = self.frames.remove(place);
        if frame.attempts == 0 {
            frame.sequence = self.next_sequence;
            self.next_sequence = self.next_sequence.wrapping_add(1);
            for other in self.frames.iter().filter(|other| other.attempts != 0) {
                *self.n_newer.entry(other.id).or_insert(0) += 1;
            }
        }
        frame.attempts += 1;
        self.in_flight = 1;
        let follows = frame.to.is_some() && self.frames.iter().any(|other| other.to == frame.to);
        let pending = self.pending_bit && follows && schedule.cells_at(asn + 1).count() == 0;
        let is_shared = at.is_some_and(|at| at.cell.options.shared);
        Sent { cell: at.map(name), is_shared, channel, frame: Some(frame), pending }
    }

    /// Frames that are not sent again: their number would be taken for that of another.
    fn outrun(&mut self) -> Vec<u64> {
        let is_outrun = |id: &u64| self.n_newer.get(id).is_some_and(|&newer| 128 <= newer);
        self.frames.extract_if(.., |frame| is_outrun(&frame.id)).map(|frame| frame.id).collect()
    }

    /// What becomes of what was sent. `Some`: a frame that is done with, and whether it was acknowledged.
    fn done(&mut self, sent: Sent, acknowledged: bool, asn: Asn) -> Option<(u64, bool)> {
        let frame = sent.frame?;
        self.in_flight = 0;
        let Some(to) = frame.to else { return Some((frame.id, false)) };
        if acknowledged {
            if sent.is_shared || self.frames.iter().all(|other| other.to != Some(to)) {
                self.waits.remove(&to);
            }
            if sent.pending {
                self.announced = Some((Asn((asn + 1).0), sent.channel, to));
            }
            return Some((frame.id, true));
        }
        if sent.is_shared {
            let (least, most) = self.exponents;
            let exponent = self.waits.get(&to).map_or(least, |(before, _)| most.min(before + 1));
            let cells = self.dice.below(1 << exponent);
            self.waits.insert(to, (exponent, cells));
        }
        if self.retries.is_some_and(|retries| retries < frame.attempts) {
            return Some((frame.id, false));
        }
        // In front of its kind.
        self.frames.insert(0, frame);
        self.frames.sort_by_key(|other| other.priority);
        None
    }
}

fn name(at: &CellRef) -> (u8, u16, u16) {
    (at.handle, at.cell.slot, at.cell.channel)
}

/// Whether a frame may go in a cell.
fn goes(frame: &Waiting, at: &CellRef, schedule: &Schedule) -> bool {
    let cell = &at.cell;
    let its_slotframe = match frame.slotframe {
        Some(slotframe) => slotframe == at.handle,
        None => at.handle != SWARM_HANDLE,
    };
    let has_own = |to: Eui64| {
        schedule.cells().any(|other| other.cell.options.tx && other.cell.neighbour == Some(to))
    };
    let its_neighbour = match (cell.neighbour, frame.to) {
        (Some(neighbour), to) => to == Some(neighbour),
        (None, None) => true,
        (None, Some(to)) => frame.slotframe.is_some() || !has_own(to),
    };
    cell.options.tx && cell.kind != CellKind::AdvertisingOnly && its_slotframe && its_neighbour
}

fn config(dice: &mut Dice) -> Config {
    let mut pick = |choices: &[u16]| choices[dice.below(choices.len() as u64) as usize];
    Config {
        blacklist: None,
        slot: SimDuration::from_ns(SLOT_NS),
        hopping_sequence: (11..=26).take(usize::from(pick(&[1, 4, 16]))).collect(),
        airtime: Airtime::O_QPSK_2450,
        queue_capacity: Some(pick(&[0, 2, 5, 10])).filter(|&frames| frames != 0),
        max_retries: Some(pick(&[0, 1, 3, 99])).filter(|&retries| retries != 99),
        min_exponent: pick(&[0, 1, 2]) as u8,
        max_exponent: pick(&[3, 7]) as u8,
        beacon_period: SimDuration::from_ns(BEACON_NS),
        beacon_spacing: SimDuration::ZERO,
        beacon_probability: None,
        beacon_wait: SimDuration::ZERO,
        rejoin_wait: SimDuration::ZERO,
        neighbours_to_wait: 1,
        scan_dwell_slots: 100,
        keep_alive: SimDuration::ZERO,
        desynchronise: SimDuration::from_ns(u64::MAX),
        max_keep_alive: None,
        max_free_run: SimDuration::ZERO,
        max_drift_ppm: 0.0,
        crystal_hz: 32_768,
        pending_bit: pick(&[0, 1]) == 1,
        bursts_beside_everyone: false,
        scans_hopping: false,
        contends_as_peer: false,
    }
}

fn random_cell(dice: &mut Dice, slots: u16) -> Cell {
    use CellOptions as Options;
    let options = [Options::TX, Options::TX_SHARED, Options::TX_RX_SHARED, Options::RX];
    let kinds =
        [CellKind::Normal, CellKind::Normal, CellKind::Advertising, CellKind::AdvertisingOnly];
    let mut below = |n: u64| dice.below(n) as usize;
    let (slot, channel) = (below(slots.into()) as u16, below(4) as u16);
    let (option, kind, neighbour) = (options[below(4)], kinds[below(4)], below(6) as u32);
    let neighbour = (neighbour < 3).then(|| Eui64::of_mote(MoteId(neighbour)));
    Cell::new(slot, channel, option, neighbour).of_kind(kind)
}

fn of_queue(queued: &Queued) -> Waiting {
    Waiting {
        id: queued.packet,
        to: queued.destination(),
        priority: queued.priority,
        slotframe: queued.slotframe,
        latest_only: queued.is_latest_only,
        attempts: queued.n_attempts,
        sequence: queued.frame.sequence,
    }
}

fn of_transmission(transmission: &Transmission) -> Sent {
    Sent {
        cell: transmission.at.as_ref().map(name),
        is_shared: transmission.at.is_some_and(|at| at.cell.options.shared),
        channel: transmission.channel,
        frame: match &transmission.outgoing {
            Outgoing::Beacon => None,
            Outgoing::Frame(queued) => Some(of_queue(queued)),
        },
        pending: transmission.pending,
    }
}

/// Both machines, and what happens to them.
struct Pair {
    config: Config,
    dice: Dice,
    schedule: Schedule,
    handles: Vec<(u8, u16)>,
    mac: Tsch,
    plain: Plain,
    n_pushed: u64,
    n_outrun: usize,
}

impl Pair {
    fn new(seed: u64) -> Self {
        let mut dice = Dice::new(seed, Purpose::Scenario, MoteId(0));
        let config = config(&mut dice);
        let mut schedule = Schedule::new();
        let mut handles = Vec::new();
        for handle in [0, 1, SWARM_HANDLE] {
            let slots = 1 + dice.below(12) as u16;
            if handle == 0 || dice.below(3) != 0 {
                schedule.add_slotframe(handle, slots);
                handles.push((handle, slots));
                for _ in 0..1 + dice.below(4) {
                    schedule.add(handle, random_cell(&mut dice, slots)).expect("within");
                }
            }
        }
        let own = Eui64::of_mote(MoteId(9));
        let mut mac = Tsch::new(&config, own, MoteId(9), true, seed);
        let mut plain = Plain {
            capacity: config.queue_capacity.map(usize::from),
            retries: config.max_retries,
            exponents: (config.min_exponent, config.max_exponent),
            pending_bit: config.pending_bit,
            channels: config.hopping_sequence.clone(),
            frames: Vec::new(),
            in_flight: 0,
            waits: BTreeMap::new(),
            beacon: (u64::MAX, false),
            announced: None,
            next_sequence: 0,
            n_newer: BTreeMap::new(),
            dice: Dice::new(seed, Purpose::Mac, MoteId(9)),
        };
        mac.start_root(SimTime::START);
        mac.enable_beacons(&config, true, SimTime::START);
        plain.beacon =
            (plain.dice.duration(SimDuration::ZERO, SimDuration::from_ns(BEACON_NS)).ns(), false);
        Self { config, dice, schedule, handles, mac, plain, n_pushed: 0, n_outrun: 0 }
    }

    /// A frame for both; whom they do not keep is the same.
    fn push(&mut self) {
        self.n_pushed += 1;
        let to = self.dice.below(5) as u32;
        let latest_only = self.dice.below(8) == 0;
        let to = (to < 4 && !latest_only).then(|| Eui64::of_mote(MoteId(to)));
        let slotframes = [None, None, Some(0), Some(1), Some(SWARM_HANDLE)];
        let frame = Waiting {
            id: self.n_pushed,
            to,
            priority: if latest_only {
                Priority::Routing
            } else {
                PRIORITIES[self.dice.below(6) as usize]
            },
            slotframe: slotframes[self.dice.below(5) as usize],
            latest_only,
            attempts: 0,
            sequence: 0,
        };
        let queued = Queued {
            frame: FrameRepr {
                source: Eui64::of_mote(MoteId(9)),
                destination: to,
                sequence: 0,
                ack_request: to.is_some(),
                pending: false,
                security: FrameSecurity::Unsecured,
                slots: None,
                blacklist: None,
                content: Content::KeepAlive,
            },
            priority: frame.priority,
            slotframe: frame.slotframe,
            is_latest_only: latest_only,
            packet: frame.id,
            psdu_bytes: 30,
            n_attempts: 0,
            number: 0,
            has_arrived: false,
        };
        let dropped = match self.mac.enqueue(queued) {
            Ok(displaced) => displaced.map(|frame| frame.packet),
            Err(refused) => Some(refused.packet),
        };
        assert_eq!(dropped, self.plain.push(frame));
    }

    /// What happens between slots.
    fn disturb(&mut self, asn: Asn) {
        let now_ns = asn * SimDuration::from_ns(SLOT_NS);
        if self.dice.below(2) == 0 {
            self.push();
        }
        let (handle, slots) = self.handles[self.dice.below(self.handles.len() as u64) as usize];
        match self.dice.below(1200) {
            0..12 => {
                let cell = random_cell(&mut self.dice, slots);
                self.schedule.add(handle, cell).expect("within");
            }
            12..24 => {
                let slot = self.dice.below(slots.into()) as u16;
                self.schedule.remove_where(handle, |cell| cell.slot == slot);
            }
            24..27 => {
                let to = Some(Eui64::of_mote(MoteId(self.dice.below(4) as u32)));
                let taken = self.mac.take_where(|queued| queued.destination() == to);
                let ours: Vec<u64> = taken.iter().map(|queued| queued.packet).collect();
                let of_it = |frame: &&Waiting| frame.to == to;
                let theirs = self.plain.frames.iter().filter(of_it).map(|frame| frame.id);
                assert_eq!(ours, theirs.collect::<Vec<_>>());
                self.plain.frames.retain(|frame| frame.to != to);
            }
            // It fails, and works again: what waited is lost, the sequence number goes on.
            27 => {
                let lost = self.mac.switch_off();
                assert_eq!(lost.len(), self.plain.frames.len());
                self.mac.start_root(now_ns);
                self.mac.enable_beacons(&self.config, true, now_ns);
                self.plain.frames.clear();
                self.plain.waits.clear();
                self.plain.announced = None;
                self.plain.beacon = (
                    (now_ns
                        + self
                            .plain
                            .dice
                            .duration(SimDuration::ZERO, SimDuration::from_ns(BEACON_NS)))
                    .ns(),
                    false,
                );
            }
            _ => {}
        }
    }

    /// A slot: the MAC under test is woken only if it has asked for it.
    fn slot(&mut self, asn: Asn) -> bool {
        let now_ns = asn * SimDuration::from_ns(SLOT_NS);
        if self.mac.poll_timeout(&self.config).is_some_and(|due_ns| due_ns <= now_ns) {
            assert_eq!(self.mac.handle_timeout(&self.config, now_ns), None);
        }
        let expected = self.plain.slot(&self.schedule, asn);
        let is_awake = self.mac.next_tx_asn(&self.config, &self.schedule, asn) == Some(asn);
        let transmission =
            if is_awake { self.mac.poll_slot(&self.config, &self.schedule, asn) } else { None };
        assert_eq!(transmission.as_ref().map(of_transmission), expected, "slot {asn}");
        let (Some(transmission), Some(sent)) = (transmission, expected) else { return false };
        if self.dice.below(10) == 0 {
            // While one is in flight.
            self.push();
        }
        let is_unicast = sent.frame.as_ref().is_some_and(|frame| frame.to.is_some());
        let acknowledged = is_unicast && self.dice.below(5) < 3;
        let done = self.mac.handle_done(&self.config, transmission, acknowledged, 0, asn);
        let ours = match &done {
            Done::Broadcast(frame) => frame.as_ref().map(|frame| (frame.packet, false)),
            Done::Acknowledged(frame) => Some((frame.packet, true)),
            Done::GivenUp(frame) => Some((frame.packet, false)),
            Done::Retry { .. } => None,
        };
        assert_eq!(ours, self.plain.done(sent, acknowledged, asn), "slot {asn}");
        let outrun: Vec<u64> = self.mac.take_outrun().iter().map(|frame| frame.packet).collect();
        assert_eq!(outrun, self.plain.outrun(), "slot {asn}");
        self.n_outrun += outrun.len();
        let waiting: Vec<Waiting> = self.mac.queue().iter().map(of_queue).collect();
        assert_eq!(waiting, self.plain.frames, "slot {asn}");
        true
    }
}

proptest! {
    #![proptest_config(super::config(64))]
    #[test]
    fn cells_frames_retries_and_back_off_follow_the_rules_slot_by_slot(seed in any::<u64>()) {
        let mut pair = Pair::new(seed);
        for asn in 0..N_SLOTS {
            pair.disturb(Asn(asn));
            pair.slot(Asn(asn));
        }
    }
}

#[test]
fn the_random_schedules_lead_to_every_kind_of_transmission() {
    let (mut n_sent, mut n_pending, mut n_shared, mut n_beacons) = (0, 0, 0, 0);
    let mut n_outrun = 0;
    for seed in 0..40 {
        let mut pair = Pair::new(seed);
        for asn in 0..N_SLOTS {
            pair.disturb(Asn(asn));
            let before = pair.plain.announced.is_some();
            let beacon_was_due = pair.plain.beacon.1;
            let sent = pair.slot(Asn(asn));
            n_sent += u32::from(sent);
            n_pending += u32::from(sent && before);
            n_beacons += u32::from(beacon_was_due && !pair.plain.beacon.1);
            n_shared += u32::from(pair.plain.waits.values().any(|(_, cells)| *cells != 0));
        }
        n_outrun += pair.n_outrun;
    }
    assert!(5 < n_outrun, "{n_outrun}");
    let counts = [n_sent, n_pending, n_shared, n_beacons];
    assert!(counts.iter().all(|&n| 300 < n), "{counts:?}");
}
