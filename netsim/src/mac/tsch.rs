//! The MAC of one mote: scanning, beacons, synchronisation, which frame goes in which cell, acknowledgments and retries.

mod blacklisting;
mod burden;
mod channel;
mod listening;
mod timekeeping;
mod types;
mod waiting;

pub use channel::{channel_at, channel_of};
pub use types::{Config, Done, Due, FrameHandling, Listening, Outgoing, State, Transmission};

use super::backoff::Backoff;
use super::blacklist::Blacklists;
use super::clock::Clock;
use super::neighbours::Neighbours;
use super::queue::{Queue, Queued, may_use};
use super::ration::Ration;
use super::schedule::{CellKind, CellRef, Schedule};
use crate::dice::Dice;
use crate::wire::Eui64;
use physics::asn::Asn;
use proto::ids::MoteId;
use proto::rng::Purpose;
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};

/// Others count as senders of beacons for so many beacon periods after each that is heard: motes move, and leave.
const N_PERIODS: u64 = 16;

/// So many questions for the time make a beacon due.
const N_ASKED: u32 = 2;

/// The next slot follows a frame with the pending bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Extra {
    asn: Asn,
    channel: u8,
    /// To whom we send; `None`: we listen.
    sends_to: Option<Eui64>,
}

/// The MAC of one mote.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tsch {
    own: Eui64,
    mote: MoteId,
    is_root: bool,
    state: State,
    clock: Clock,
    /// How long it does without its time source; not less than is set.
    patience: SimDuration,
    /// Whether it has kept time since it was switched on.
    had_time: bool,
    /// A scanning mote that lost its time still knows which slot it is until then.
    knows_slot_until: SimTime,
    /// When the time source was heard for which the next keep-alive was drawn.
    drawn_for: Option<SimTime>,
    queue: Queue,
    in_flight: bool,
    backoff: Backoff,
    neighbours: Neighbours,
    /// Whether a new search for a network begins without them.
    forgets_neighbours: bool,
    /// The number of the next frame that is sent for the first time: its last eight bits are the sequence number.
    next_number: u32,
    /// Sequence number of the next beacon: macEbsn.
    beacon_sequence: u8,
    beacons: Beacons,
    extra: Option<Extra>,
    ration: Option<Ration>,
    blacklists: Blacklists,
    dice: Dice,
}

#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Beacons {
    enabled: bool,
    /// When the next one is due.
    next: SimTime,
    is_due: bool,
    /// Neighbours that asked for the time since the last one.
    n_asked: u32,
}

/// What the pending bit announced has precedence in a slot in which all contend, or listen for everyone.
fn follows_beside_everyone(config: &Config, schedule: &Schedule, asn: Asn) -> bool {
    config.bursts_beside_everyone && schedule.is_free(asn, true)
}

impl Tsch {
    /// The MAC of a mote that is switched off.
    #[must_use]
    pub fn new(config: &Config, own: Eui64, mote: MoteId, is_root: bool, seed: u64) -> Self {
        let mut dice = Dice::new(seed, Purpose::Mac, mote);
        let clock = if is_root {
            Clock::exact()
        } else {
            Clock::new(config.max_drift_ppm, config.crystal_hz, &mut dice)
        };
        Self {
            own,
            mote,
            is_root,
            state: State::Off,
            clock,
            patience: config.desynchronise,
            had_time: false,
            knows_slot_until: SimTime::START,
            drawn_for: None,
            queue: Queue::new(config.queue_capacity),
            in_flight: false,
            backoff: Backoff::new(config.min_exponent, config.max_exponent),
            neighbours: Neighbours::default(),
            forgets_neighbours: config.beacon_probability.is_none(),
            next_number: 0,
            beacon_sequence: 0,
            beacons: Beacons::default(),
            extra: None,
            ration: None,
            blacklists: Blacklists::default(),
            dice,
        }
    }

    /// Draws by another seed from here on.
    pub fn reseed(&mut self, seed: u64) {
        self.dice.reseed(seed);
    }

    /// Synchronisation of the mote.
    #[must_use]
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Whether it keeps time.
    #[must_use]
    pub fn is_synced(&self) -> bool {
        matches!(self.state, State::Synced { .. })
    }

    /// Whether it looks for a network.
    #[must_use]
    pub fn is_scanning(&self) -> bool {
        matches!(self.state, State::Scanning { .. })
    }

    /// Whose time it keeps; `None`: its own, or none.
    #[must_use]
    pub fn time_source(&self) -> Option<Eui64> {
        match self.state {
            State::Synced { source, .. } => source,
            State::Off | State::Scanning { .. } => None,
        }
    }

    /// Whom it has heard.
    #[must_use]
    pub fn neighbours(&self) -> &Neighbours {
        &self.neighbours
    }

    /// How far its clock is off.
    #[must_use]
    pub fn deviation_ns(&self, now: SimTime) -> i64 {
        self.clock.deviation_ns(now)
    }

    /// The root switches its radio on: it keeps its own time.
    pub fn start_root(&mut self, now: SimTime) {
        self.state = State::Synced { source: None, heard: now, keep_alive: SimTime::NEVER };
    }

    /// Looks for a network: after it was switched on, or lost synchronisation. The frames that waited are returned.
    pub fn scan(&mut self, config: &Config) -> Vec<Queued> {
        self.knows_slot_until = match self.state {
            State::Synced { heard, .. } if config.scans_hopping => {
                heard.saturating_add(config.knows_slot_for())
            }
            _ => SimTime::START,
        };
        let frames = self.reset();
        self.state = State::Scanning { heard: Vec::new(), decide: None };
        frames
    }

    /// Switches off. The frames that waited are returned.
    pub fn switch_off(&mut self) -> Vec<Queued> {
        let frames = self.reset();
        self.had_time = false;
        self.clock.forget();
        self.state = State::Off;
        frames
    }

    fn reset(&mut self) -> Vec<Queued> {
        self.backoff.clear();
        if self.forgets_neighbours {
            self.neighbours.forget();
        }
        self.beacons = Beacons::default();
        self.extra = None;
        self.blacklists.forget();
        self.queue.take_where(|_| true)
    }

    /// The sequence number of the next beacon: one more than that of the one before (IEEE Std 802.15.4-2015, 6.3.1:
    /// macEbsn).
    #[must_use]
    pub(crate) fn beacon_sequence(&self) -> u8 {
        self.beacon_sequence
    }

    /// Sends beacons from now on, or no longer.
    pub fn enable_beacons(&mut self, config: &Config, enabled: bool, now: SimTime) {
        if enabled && !self.beacons.enabled {
            let interval = self.beacon_interval(config, now);
            self.beacons.next = now + self.dice.duration(SimDuration::ZERO, interval);
        }
        self.beacons.enabled = enabled;
        self.beacons.is_due &= enabled;
    }

    /// A neighbour has asked for the time in a cell in which all contend. One beacon tells it to all that are about to ask, so that the
    /// second question since the last beacon makes the next one due: there is at most one for two questions.
    pub fn handle_keep_alive(&mut self, config: &Config, now: SimTime) {
        if !self.beacons.enabled || config.contends_as_peer || config.beacon_probability.is_some() {
            return;
        }
        self.beacons.n_asked += 1;
        if self.beacons.n_asked == N_ASKED {
            let interval = self.beacon_interval(config, now);
            self.beacons.is_due = true;
            self.beacons.next = now + self.dice.duration(interval * 3 / 4, interval * 5 / 4);
        }
    }

    /// The mean time between this mote's beacons: longer where many others have sent them lately, too. A neighbour that has
    /// joined only sends none yet.
    fn beacon_interval(&mut self, config: &Config, now: SimTime) -> SimDuration {
        let lately = now.saturating_sub(N_PERIODS * config.beacon_period);
        let n_senders = 1 + self.neighbours.n_with_beacons(Asn(lately / config.slot)) as u64;
        let crowd = config.beacon_spacing.saturating_mul(n_senders);
        config.beacon_period.max(crowd)
    }

    /// The first slot from `from_asn` on in which it may transmit.
    #[must_use]
    pub fn next_tx_asn(&self, config: &Config, schedule: &Schedule, from_asn: Asn) -> Option<Asn> {
        if !self.is_synced() {
            return None;
        }
        let by_chance = config.beacon_probability.is_some() && self.beacons.enabled;
        let beacon = self.beacons.is_due || (by_chance && self.queue.is_idle());
        if self.queue.is_empty() && !beacon && self.extra.is_none() {
            return None;
        }
        let mut first = Asn::NEVER;
        if let Some(Extra { asn, sends_to: Some(_), .. }) = self.extra
            && from_asn <= asn
        {
            first = asn;
        }
        for frame in schedule.slotframes() {
            let (slots, begin) = (u64::from(frame.slots()), u64::from(frame.slot_of(from_asn)));
            for cell in frame.tx_cells() {
                let slot = u64::from(cell.slot);
                let ahead = if begin <= slot { slot - begin } else { slot + slots - begin };
                let asn = from_asn + ahead;
                if first <= asn {
                    continue;
                }
                let of_beacon = beacon && cell.kind != CellKind::Normal;
                let usable = of_beacon
                    || self
                        .queue
                        .iter()
                        .any(|queued| may_use(queued, frame.handle, cell, schedule));
                if usable {
                    first = asn;
                }
            }
        }
        (first != Asn::NEVER).then_some(first)
    }

    /// What it sends in this slot. Cells of lower handles first (IEEE Std 802.15.4-2015, 6.2.6.4).
    pub fn poll_slot(
        &mut self,
        config: &Config,
        schedule: &Schedule,
        asn: Asn,
    ) -> Option<Transmission> {
        if !self.is_synced() {
            return None;
        }
        if self.is_silenced(asn * config.slot) {
            return None;
        }
        if let Some(Extra { asn: at, channel, sends_to }) = self.extra
            && at <= asn
        {
            // Who listens is asked later in the slot.
            if at < asn || sends_to.is_some() {
                self.extra = None;
            }
            if at == asn && sends_to.is_none() && follows_beside_everyone(config, schedule, asn) {
                return None;
            }
            if let (true, Some(neighbour)) = (at == asn, sends_to)
                && schedule.is_free(asn, config.bursts_beside_everyone)
            {
                let place =
                    self.queue.iter().position(|queued| queued.destination() == Some(neighbour))?;
                return Some(self.transmit(config, schedule, asn, place, None, channel));
            }
        }
        if self.queue.is_empty() && !self.beacons.is_due && config.beacon_probability.is_none() {
            return None;
        }
        for frame in schedule.slotframes() {
            for cell in frame.cells_at(asn).iter().filter(|cell| cell.options.tx) {
                let at = CellRef { handle: frame.handle, cell: *cell };
                let channel = self.channel_in(config, cell, asn);
                if cell.kind != CellKind::Normal && self.beacon_goes(config) {
                    self.beacons.is_due = false;
                    self.beacons.n_asked = 0;
                    let outgoing = Outgoing::Beacon;
                    return Some(Transmission { at: Some(at), channel, outgoing, pending: false });
                }
                let Some(place) = self.queue.first_for(frame.handle, cell, schedule) else {
                    continue;
                };
                let queued = self.queue.get(place);
                let is_free = config.contends_as_peer && queued.n_attempts == 0;
                if let (true, Some(to)) = (cell.options.shared && !is_free, queued.destination())
                    && !self.backoff.passes(to)
                {
                    continue;
                }
                return Some(self.transmit(config, schedule, asn, place, Some(at), channel));
            }
        }
        None
    }

    fn beacon_goes(&mut self, config: &Config) -> bool {
        match config.beacon_probability {
            None => self.beacons.is_due,
            Some(probability) => {
                self.beacons.enabled
                    && self.queue.is_idle()
                    && self.dice.uniform() < probability / (1.0 + self.neighbours.len() as f64)
            }
        }
    }

    fn transmit(
        &mut self,
        config: &Config,
        schedule: &Schedule,
        asn: Asn,
        place: usize,
        at: Option<CellRef>,
        channel: u8,
    ) -> Transmission {
        let mut frame = self.queue.take(place);
        if frame.n_attempts == 0 {
            frame.number = self.next_number;
            frame.frame.sequence = self.next_number as u8;
            self.next_number = self.next_number.wrapping_add(1);
        }
        frame.n_attempts += 1;
        self.in_flight = true;
        let pending = config.pending_bit
            && frame.destination().is_some_and(|to| self.queue.waits_for(to))
            && schedule.is_free(asn + 1, config.bursts_beside_everyone);
        frame.frame.pending = pending;
        self.offer_blacklist(config, asn, at.as_ref(), &mut frame);
        Transmission { at, channel, outgoing: Outgoing::Frame(frame), pending }
    }

    /// A frame was heard that is of no use, but for knowing that its sender is there.
    pub fn hear(&mut self, from: Eui64, sequence: Option<u8>, asn: Asn) {
        self.neighbours.hear(from, sequence, false, asn);
    }

    /// A frame was received. `sequence`: its number; beacons have none. `source_ns`: how far the sender's clock is off.
    #[inline]
    pub fn handle_frame(
        &mut self,
        config: &Config,
        from: Eui64,
        destination: Option<Eui64>,
        sequence: Option<u8>,
        asn: Asn,
        source_ns: i64,
    ) -> FrameHandling {
        let now = asn * config.slot;
        let for_us = destination == Some(self.own);
        let is_new = self.neighbours.hear(from, sequence, for_us, asn);
        let State::Synced { source, heard, .. } = &mut self.state else {
            return FrameHandling { acknowledge: false, deliver: false };
        };
        // A frame for another mote is discarded before it could correct the clock (IEEE Std 802.15.4-2015, 6.7.2).
        if *source == Some(from) && (for_us || destination.is_none()) {
            *heard = now;
            self.take_time(config, from, source_ns, now);
        }
        FrameHandling { acknowledge: for_us, deliver: destination.is_none() || (for_us && is_new) }
    }

    /// A received unicast frame for us had the pending bit: listens in the next slot.
    pub fn follow(&mut self, asn: Asn, channel: u8) {
        self.extra = Some(Extra { asn: asn + 1, channel, sends_to: None });
    }

    /// The slot, not before `from_asn`, in which it listens because of a pending bit.
    #[must_use]
    pub fn follows_at(&self, from_asn: Asn) -> Option<Asn> {
        let extra = self.extra.filter(|extra| extra.sends_to.is_none() && from_asn <= extra.asn);
        extra.map(|extra| extra.asn)
    }

    /// The slot in which it listened because of a pending bit is over.
    pub fn end_following(&mut self) {
        self.extra = self.extra.filter(|extra| extra.sends_to.is_some());
    }

    /// A beacon was heard while scanning. Returns whom to synchronise to, once enough neighbours have been heard.
    pub fn handle_beacon(
        &mut self,
        config: &Config,
        from: Eui64,
        join_metric: u8,
        now: SimTime,
    ) -> Option<Eui64> {
        let State::Scanning { heard, decide } = &mut self.state else { return None };
        match heard.iter_mut().find(|(other, _)| *other == from) {
            Some(entry) => entry.1 = join_metric,
            None => heard.push((from, join_metric)),
        }
        if decide.is_none() {
            let wait = if self.had_time { config.rejoin_wait } else { config.beacon_wait };
            *decide = Some(now + wait);
        }
        if usize::from(config.neighbours_to_wait) <= heard.len() { self.choose() } else { None }
    }

    /// The neighbour with the least join metric; of equal ones the one heard first.
    fn choose(&mut self) -> Option<Eui64> {
        let State::Scanning { heard, decide } = &mut self.state else { return None };
        *decide = None;
        let best = heard.iter().min_by_key(|(_, metric)| *metric).map(|(from, _)| *from);
        heard.clear();
        best
    }

    /// What became of a transmission. `source_ns`: how far the clock of whoever acknowledged is off.
    pub fn handle_done(
        &mut self,
        config: &Config,
        transmission: Transmission,
        acknowledged: bool,
        source_ns: i64,
        asn: Asn,
    ) -> Done {
        let Transmission { at, channel, outgoing, pending } = transmission;
        let frame = match outgoing {
            Outgoing::Beacon => {
                self.beacon_sequence = self.beacon_sequence.wrapping_add(1);
                return Done::Broadcast(None);
            }
            Outgoing::Frame(frame) => frame,
        };
        self.in_flight = false;
        let Some(destination) = frame.destination() else { return Done::Broadcast(Some(frame)) };
        self.learn_channel(config, at.as_ref(), channel, &frame, acknowledged);
        let is_shared = at.is_some_and(|at| at.cell.options.shared);
        if acknowledged {
            if is_shared || !self.queue.waits_for(destination) {
                self.backoff.succeed(destination);
            }
            if let State::Synced { source: Some(source), heard, .. } = &mut self.state
                && *source == destination
            {
                let now = asn * config.slot;
                *heard = now;
                self.take_time(config, destination, source_ns, now);
            }
            if pending {
                self.extra = Some(Extra { asn: asn + 1, channel, sends_to: Some(destination) });
            }
            return Done::Acknowledged(frame);
        }
        if is_shared {
            if config.contends_as_peer && frame.n_attempts == 1 {
                self.backoff.succeed(destination);
            }
            self.backoff.fail(destination, &mut self.dice);
        }
        if config.max_retries.is_some_and(|most| most < frame.n_attempts) {
            return Done::GivenUp(frame);
        }
        let dscp = frame.frame.content.dscp();
        self.queue.put_back(frame);
        Done::Retry { destination, dscp }
    }

    /// When [`Tsch::handle_timeout`] wants to be called.
    #[must_use]
    pub fn poll_timeout(&self, config: &Config) -> Option<SimTime> {
        match &self.state {
            State::Off => None,
            State::Scanning { decide, .. } => *decide,
            State::Synced { source, heard, keep_alive } => {
                let beacon = if self.beacons.enabled
                    && !self.beacons.is_due
                    && config.beacon_probability.is_none()
                {
                    self.beacons.next
                } else {
                    SimTime::NEVER
                };
                let time = match source {
                    _ if self.is_root || config.keep_alive.is_zero() => SimTime::NEVER,
                    Some(_) | None => (*keep_alive).min(*heard + self.patience),
                };
                let first = beacon.min(time);
                (first != SimTime::NEVER).then_some(first)
            }
        }
    }

    /// Time has come to `now`.
    pub fn handle_timeout(&mut self, config: &Config, now: SimTime) -> Option<Due> {
        if self.beacons.enabled
            && !self.beacons.is_due
            && config.beacon_probability.is_none()
            && self.beacons.next <= now
        {
            let interval = self.beacon_interval(config, now);
            self.beacons.is_due = true;
            self.beacons.next = now + self.dice.duration(interval * 3 / 4, interval * 5 / 4);
        }
        match &mut self.state {
            State::Scanning { decide: Some(decide), .. } if *decide <= now => {
                self.choose().map(Due::Synchronise)
            }
            State::Synced { source, heard, keep_alive }
                if !self.is_root && !config.keep_alive.is_zero() =>
            {
                let (source, heard) = (*source, *heard);
                if heard + self.patience <= now {
                    return Some(self.miss_source(config, heard, now));
                }
                if now < *keep_alive {
                    return None;
                }
                self.ask_for_time(config, source?, heard, now)
            }
            State::Off | State::Scanning { .. } | State::Synced { .. } => None,
        }
    }

    /// Whether the root keeps this mote's time.
    #[must_use]
    pub fn is_root(&self) -> bool {
        self.is_root
    }
}
