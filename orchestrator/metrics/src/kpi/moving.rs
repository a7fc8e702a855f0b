//! What happened while robots were free to move.

use super::packets::PacketAccount;
use crate::period::Period;
use proto::types::{Bitmap, EVERYONE, Packets, seconds};

/// Packets, and who was on and joined, while robots were free to move.
#[derive(Clone, Debug, Default)]
pub(super) struct Moving {
    /// The account of packets that ended then.
    pub(super) account: PacketAccount,
    /// Robots had to wait before they were free to move.
    pub(super) has_waited: bool,
    /// When they were free first (ns).
    started_ns: Option<u64>,
    /// Application packets to one destination that were created since then, by source: delivered, and ended in any way.
    ended: Vec<[u64; 2]>,
    /// Payload of application packets to one destination that were delivered then (bytes).
    delivered_bytes: u64,
    /// For so long robots were free (ns).
    for_ns: u64,
    on: TimeOn,
    /// Share of motes that were joined, summed over nanoseconds, and those nanoseconds.
    joined: (f64, f64),
}

impl Moving {
    /// Adds a period, in order.
    pub(super) fn add(&mut self, period: &Period<'_>) {
        self.has_waited |= period.held;
        if period.held {
            return;
        }
        let started_ns = *self.started_ns.get_or_insert(period.from_ns);
        self.on.add(period);
        self.for_ns += period.time_ns - period.from_ns;
        if let Some(packets) = period.packets {
            self.account.add(packets);
            self.count(packets, started_ns, period.motes.alive.len());
        }
        if let Some(joined) = &period.motes.joined {
            let weight = (period.time_ns - period.from_ns) as f64;
            let n_alive = period.motes.alive.count();
            if 0 < n_alive {
                let n = period.motes.alive.iter_ones().filter(|&mote| joined.get(mote)).count();
                self.joined.0 += weight * n as f64 / n_alive as f64;
                self.joined.1 += weight;
            }
        }
    }

    fn count(&mut self, packets: &Packets, started_ns: u64, n_motes: usize) {
        self.ended.resize(n_motes, [0; 2]);
        for place in 0..packets.len() {
            let kind = &packets.kinds[packets.kind[place] as usize];
            if !kind.is_application || packets.destination[place] == EVERYONE {
                continue;
            }
            if packets.drop_reason(place).is_none() {
                self.delivered_bytes += u64::from(packets.payload_bytes[place]);
            }
            if started_ns <= packets.created_ns[place]
                && let Some([delivered, ended]) = self.ended.get_mut(packets.source[place] as usize)
            {
                *delivered += u64::from(packets.drop_reason(place).is_none());
                *ended += 1;
            }
        }
    }

    /// Application packets of a mote that were created then: delivered, and ended in any way.
    pub(super) fn ended(&self, mote: usize) -> [u64; 2] {
        self.ended.get(mote).copied().unwrap_or_default()
    }

    /// Payload of application packets that were delivered, per second (bytes/s).
    pub(super) fn throughput_bytes_s(&self) -> Option<f64> {
        (self.for_ns != 0).then(|| self.delivered_bytes as f64 / seconds(self.for_ns))
    }

    /// How long a mote was on (s).
    pub(super) fn on_s(&self, mote: usize) -> f64 {
        seconds(self.on.of(mote))
    }

    /// Time mean of the share of living motes that were joined.
    pub(super) fn joined_ratio(&self) -> Option<f64> {
        let (joined, weight) = self.joined;
        (0.0 < weight).then(|| joined / weight)
    }
}

/// How long each mote was on: periods at whose ends it was alive. Costs nothing while nobody is switched on or off.
#[derive(Clone, Debug, Default)]
struct TimeOn {
    alive: Bitmap,
    /// For so long just these were alive, which is not in the sums yet (ns).
    for_ns: u64,
    sums_ns: Vec<u64>,
}

impl TimeOn {
    fn add(&mut self, period: &Period<'_>) {
        let alive = &period.motes.alive;
        if *alive != self.alive {
            self.sums_ns.resize(alive.len(), 0);
            for mote in self.alive.iter_ones() {
                self.sums_ns[mote] += self.for_ns;
            }
            self.alive.clone_from(alive);
            self.for_ns = 0;
        }
        self.for_ns += period.time_ns - period.from_ns;
    }

    fn of(&self, mote: usize) -> u64 {
        let is_alive = mote < self.alive.len() && self.alive.get(mote);
        self.sums_ns.get(mote).copied().unwrap_or_default() + if is_alive { self.for_ns } else { 0 }
    }
}
