//! In which slots each mote listens, cached as bits in one array, so that most motes of a slot need not be asked.

use crate::mac::blacklist::is_dedicated;
use crate::mac::{Cell, CellOptions, CellRef, Schedule, Tsch};
use physics::asn::Asn;
use proto::ids::MoteId;

/// By mote, the slots of its slotframe in which it listens. Computed from the motes' schedules when they change, and invalid
/// for a mote while it acts; not part of the saved state.
#[derive(Debug)]
pub(super) struct ListeningCache {
    /// By mote: the number of changes of its schedule at which its bits were computed, plus one; 0: never.
    holds_for: Vec<u64>,
    /// By mote: whether its bits are valid.
    is_known: Vec<bool>,
    /// By mote: slotframe handle and channel offset of its background cell, if it has one.
    background: Vec<Option<(u8, u16)>>,
    /// Length (slots) of the slotframes that are cached: that of the first mote noted; 0 before. Motes with another length are
    /// not cached.
    slots: u16,
    /// `words` entries per mote, in each 64 slots: a bit per slot for listening, and one for listening in the background cell.
    bits: Vec<[u64; 2]>,
    words: usize,
    /// `slots` entries per mote: the channel offset of the cell in which it listens there, or [`ASK`].
    channels: Vec<u8>,
    /// The absolute slot number asked for last, and its offset in the slotframe.
    latest: (Asn, usize),
    /// Links blacklist channels: the offset of a dedicated cell does not tell its channel.
    has_blacklists: bool,
}

/// What the cache says of a mote in a slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Known {
    /// Not cached: ask the mote.
    Unknown,
    /// It does not listen.
    Silent,
    /// It listens in its background cell.
    Background(CellRef),
    /// It listens in a cell of this channel offset: ask the mote which, if a frame comes on it.
    Listens(u16),
}

/// Longest slotframe that is cached (slots): ten kilobytes for each mote.
const LONGEST: u16 = 8192;
/// A channel offset that is not cached: ask the mote.
const ASK: u8 = u8::MAX;

impl ListeningCache {
    pub(super) fn new(n: usize, has_blacklists: bool) -> Self {
        Self {
            holds_for: vec![0; n],
            is_known: vec![false; n],
            background: vec![None; n],
            slots: 0,
            bits: Vec::new(),
            words: 0,
            channels: Vec::new(),
            latest: (Asn::FIRST, 0),
            has_blacklists,
        }
    }

    /// Makes the bits of a mote invalid, since it may change from now on.
    pub(super) fn forget(&mut self, mote: MoteId) {
        self.is_known[mote.index()] = false;
    }

    /// Computes the bits of a mote, which stays as it is until [`ListeningCache::forget`].
    pub(super) fn note(&mut self, mote: MoteId, mac: &Tsch, schedule: &Schedule) {
        let place = mote.index();
        self.is_known[place] = false;
        if !mac.follows_schedule() {
            return;
        }
        let holds_for = schedule.n_changes() + 1;
        if self.holds_for[place] == holds_for {
            self.is_known[place] = true;
            return;
        }
        let Some((slots, listens)) = schedule.listening_slots() else { return };
        if self.slots == 0 && slots <= LONGEST {
            self.slots = slots;
            self.words = listens.len();
            self.bits = vec![[0; 2]; self.words * self.is_known.len()];
            self.channels = vec![ASK; usize::from(slots) * self.is_known.len()];
        }
        if slots != self.slots {
            return;
        }
        let bits = &mut self.bits[place * self.words..][..self.words];
        for (bits, &listens) in bits.iter_mut().zip(listens) {
            *bits = [listens, 0];
        }
        let channels = &mut self.channels[place * usize::from(slots)..][..usize::from(slots)];
        for (slot, channel) in channels.iter_mut().enumerate() {
            if listens[slot / 64] & 1 << (slot % 64) != 0 {
                // All slotframes are as long as each other: a slot offset is an absolute slot.
                let at = schedule.listens(Asn(slot as u64));
                let at = at.filter(|at| !self.has_blacklists || !is_dedicated(&at.cell));
                *channel = at.and_then(|at| at.cell.channel.try_into().ok()).unwrap_or(ASK);
            }
        }
        self.background[place] = schedule.background().map(|(handle, channel, in_force)| {
            for (slot, in_force) in in_force.enumerate() {
                bits[slot / 64][1] |= u64::from(in_force) << (slot % 64);
            }
            (handle, channel)
        });
        self.holds_for[place] = holds_for;
        self.is_known[place] = true;
    }

    /// What the cache says of a mote in an absolute slot.
    #[inline]
    pub(super) fn known(&mut self, mote: MoteId, asn: Asn) -> Known {
        let place = mote.index();
        if !self.is_known[place] {
            return Known::Unknown;
        }
        if self.latest.0 != asn {
            self.latest = (asn, (asn % u64::from(self.slots)) as usize);
        }
        let slot = self.latest.1;
        let [listens, by_background] = self.bits[place * self.words + slot / 64];
        if listens & 1 << (slot % 64) == 0 {
            return Known::Silent;
        }
        match self.background[place] {
            Some((handle, channel)) if by_background & 1 << (slot % 64) != 0 => {
                let cell = Cell::new(slot as u16, channel, CellOptions::RX, None);
                Known::Background(CellRef { handle, cell })
            }
            _ => match self.channels[place * usize::from(self.slots) + slot] {
                ASK => Known::Unknown,
                channel => Known::Listens(channel.into()),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mac::tsch::{Config, Listening, channel_of};
    use crate::wire::Eui64;
    use physics::timing::Airtime;
    use proto::time::{SimDuration, SimTime};

    fn config() -> Config {
        Config {
            slot: SimDuration::from_ns(10_000_000),
            hopping_sequence: vec![11, 12, 13],
            airtime: Airtime::O_QPSK_2450,
            blacklist: None,
            queue_capacity: None,
            max_retries: None,
            min_exponent: 1,
            max_exponent: 7,
            beacon_period: SimDuration::from_ns(1),
            beacon_spacing: SimDuration::from_ns(1),
            beacon_probability: None,
            beacon_wait: SimDuration::from_ns(1),
            rejoin_wait: SimDuration::ZERO,
            neighbours_to_wait: 1,
            scan_dwell_slots: 1,
            keep_alive: SimDuration::ZERO,
            desynchronise: SimDuration::from_ns(1),
            max_keep_alive: None,
            max_free_run: SimDuration::ZERO,
            max_drift_ppm: 0.0,
            crystal_hz: 32_768,
            pending_bit: false,
            bursts_beside_everyone: false,
            scans_hopping: false,
            contends_as_peer: false,
        }
    }

    #[test]
    fn what_is_known_is_true_and_of_those_noted_it_is_known_who_is_silent_or_in_the_background() {
        let config = config();
        let mut cache = ListeningCache::new(5, false);
        let mut motes: Vec<(Tsch, Schedule)> = (0..5)
            .map(|mote| {
                let mac = Tsch::new(&config, Eui64::of_mote(MoteId(mote)), MoteId(mote), true, 1);
                (mac, Schedule::new())
            })
            .collect();
        for (mac, _) in &mut motes[..4] {
            mac.start_root(SimTime::START);
        }
        motes[4].0.scan(&config);
        for (mote, (mac, schedule)) in (0..).zip(&mut motes) {
            // Mote 3's slotframes are longer than those of the others.
            let slots = if mote == 3 { 131 } else { 101 };
            for handle in 0..3 {
                schedule.add_slotframe(handle, slots);
                let slot = (mote as u16 * 37 + u16::from(handle) * 50) % slots;
                schedule.add(handle, Cell::new(slot, 0, CellOptions::RX, None)).unwrap();
            }
            cache.note(MoteId(mote), mac, schedule);
        }
        motes[1].1.remove_where(2, |_| true);
        cache.note(MoteId(1), &motes[1].0, &motes[1].1);
        // Mote 0 has a background that gives way to a cell in one slot.
        let schedule = &mut motes[0].1;
        schedule.remove_slotframe(1);
        schedule.remove_slotframe(2);
        schedule.set_background(0, Some(3)).unwrap();
        schedule.add(0, Cell::new(70, 0, CellOptions::TX, None)).unwrap();
        cache.note(MoteId(0), &motes[0].0, &motes[0].1);
        cache.forget(MoteId(2));
        let (mut n_background, mut n_listening) = (0, 0);
        for asn in 0..1010 {
            for (mote, (mac, schedule)) in (0..).zip(&motes) {
                let listening = mac.listening(&config, schedule, 1, Asn(asn));
                let known = match cache.known(MoteId(mote), Asn(asn)) {
                    Known::Unknown => {
                        assert!(2 <= mote || listening.is_some(), "{mote} in {asn}");
                        continue;
                    }
                    Known::Listens(offset) => {
                        n_listening += 1;
                        let channel = listening.map(|listening| listening.channel);
                        assert_eq!(channel, Some(channel_of(&config, Asn(asn), offset)));
                        continue;
                    }
                    Known::Silent => None,
                    Known::Background(at) => {
                        n_background += 1;
                        Some(Listening::synchronised(Some(at), channel_of(&config, Asn(asn), 3)))
                    }
                };
                assert!(mote < 2, "{mote} in {asn}");
                assert_eq!(known, listening, "{mote} in {asn}");
            }
        }
        // All slots but that of its cell that receives and of the one that sends.
        assert_eq!(n_background, 10 * (101 - 2));
        // The cell of mote 0 that receives, and two of mote 1, one of whose slotframes is empty.
        assert_eq!(n_listening, 10 * (1 + 2));
    }
}
