//! Who is known not to listen: a few bits of each mote in one place, so that those who sleep need not be looked at.

use crate::mac::{Schedule, Tsch};

/// By mote, the slots of its slotframes in which it listens. Derived from motes whenever they are rescheduled, and
/// forgotten while they act; no part of the state.
#[derive(Debug)]
pub(super) struct Hush {
    /// By mote: number of changes of its schedule for which its bits hold, plus one; 0: nothing is known.
    holds_for: Vec<u64>,
    /// By mote: whether its bits may be used.
    is_known: Vec<bool>,
    /// Length of all motes' slotframes (slots); those with another are not known. 0: that of the first mote noted.
    slots: u16,
    /// `words` for each mote: a bit for each slot in which it listens.
    bits: Vec<u64>,
    words: usize,
    /// The slot asked for last, and its place in the slotframe.
    latest: (u64, usize),
}

/// Longer slotframes are not kept (slots): a kilobyte for each mote.
const LONGEST: u16 = 8192;

impl Hush {
    pub(super) fn new(n: usize) -> Self {
        Self {
            holds_for: vec![0; n],
            is_known: vec![false; n],
            slots: 0,
            bits: Vec::new(),
            words: 0,
            latest: (0, 0),
        }
    }

    /// The mote may change from now on.
    pub(super) fn forget(&mut self, mote: u32) {
        self.is_known[mote as usize] = false;
    }

    /// The mote stays as it is until something happens to it.
    pub(super) fn note(&mut self, mote: u32, mac: &Tsch, schedule: &Schedule) {
        let place = mote as usize;
        self.is_known[place] = false;
        if !mac.follows_schedule() {
            return;
        }
        let holds_for = schedule.n_changes() + 1;
        if self.holds_for[place] == holds_for {
            self.is_known[place] = true;
            return;
        }
        let Some((slots, bits)) = schedule.listening_slots() else { return };
        if self.slots == 0 && slots <= LONGEST {
            self.slots = slots;
            self.words = bits.len();
            self.bits = vec![0; self.words * self.is_known.len()];
        }
        if slots == self.slots {
            self.bits[place * self.words..][..self.words].copy_from_slice(bits);
            self.holds_for[place] = holds_for;
            self.is_known[place] = true;
        }
    }

    /// Whether it is known that the mote does not listen in a slot.
    #[inline]
    pub(super) fn covers(&mut self, mote: u32, asn: u64) -> bool {
        let place = mote as usize;
        if !self.is_known[place] {
            return false;
        }
        if self.latest.0 != asn {
            self.latest = (asn, (asn % u64::from(self.slots)) as usize);
        }
        let slot = self.latest.1;
        self.bits[place * self.words + slot / 64] & 1 << (slot % 64) == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mac::tsch::Config;
    use crate::mac::{Cell, CellOptions};
    use crate::wire::Eui64;

    fn config() -> Config {
        Config {
            slot_ns: 10_000_000,
            hopping_sequence: vec![11, 12, 13],
            queue_capacity: None,
            max_retries: None,
            min_exponent: 1,
            max_exponent: 7,
            beacon_period_ns: 1,
            beacon_spacing_ns: 1,
            beacon_probability: None,
            beacon_wait_ns: 1,
            neighbours_to_wait: 1,
            scan_dwell_slots: 1,
            keep_alive_ns: 0,
            desynchronise_ns: 1,
            max_drift_ppm: 0.0,
            crystal_hz: 32_768,
            pending_bit: false,
            contends_as_peer: false,
        }
    }

    #[test]
    fn who_is_covered_does_not_listen_and_of_those_noted_everyone_who_does_not_is_covered() {
        let config = config();
        let mut hush = Hush::new(5);
        let mut motes: Vec<(Tsch, Schedule)> = (0..5)
            .map(|mote| {
                let mac = Tsch::new(&config, Eui64::of_mote(mote), mote, true, 1);
                (mac, Schedule::new())
            })
            .collect();
        for (mac, _) in &mut motes[..4] {
            mac.start_root(0);
        }
        motes[4].0.scan();
        for (mote, (mac, schedule)) in (0..).zip(&mut motes) {
            // Mote 3's slotframes are longer than those of the others.
            let slots = if mote == 3 { 131 } else { 101 };
            for handle in 0..3 {
                schedule.add_slotframe(handle, slots);
                let slot = (mote as u16 * 37 + u16::from(handle) * 50) % slots;
                schedule.add(handle, Cell::new(slot, 0, CellOptions::RX, None)).unwrap();
            }
            hush.note(mote, mac, schedule);
        }
        motes[1].1.remove_where(2, |_| true);
        hush.note(1, &motes[1].0, &motes[1].1);
        hush.forget(2);
        for asn in 0..1000 {
            for (mote, (mac, schedule)) in (0..).zip(&motes) {
                let listens = mac.listening(&config, schedule, 1, asn).is_some();
                let is_noted = mote < 2;
                assert_eq!(hush.covers(mote, asn), is_noted && !listens, "{mote} in {asn}");
            }
        }
    }
}
