//! Parents by beacons: for motes that move, of which DIOs tell too late.
//!
//! A beacon says how far its sender is from the root, in whole hops, and its strength how near it is. Where every mote sends one every
//! second or two, all that a mote needs to change its parent before the link breaks is in the air already. The trend of strength
//! triggers the change as in mRPL and MobiRPL; ranks are those of RFC 8180, § 6.1.

use super::neighbours::Neighbour;
use super::objective::INFINITE_RANK;
use super::{Handover, Rpl};
use crate::dice::Dice;
use crate::wire::Eui64;
use proto::time::SimTime;

/// What a beacon says whose sender has no way to the root.
const NO_WAY: u8 = u8::MAX;

impl Rpl {
    /// Whether a neighbour with this join metric is nearer to the root than this mote.
    #[must_use]
    pub(crate) fn is_nearer(&self, join_metric: u8) -> bool {
        !self.is_root && join_metric != NO_WAY && u16::from(join_metric) + 1 < self.dag_rank()
    }

    /// A beacon counts as a DIO, if so configured. Returns whether it does.
    pub(crate) fn handle_rank(
        &mut self,
        from: Eui64,
        join_metric: u8,
        rssi_dbm: f64,
        now: SimTime,
        dice: &mut Dice,
    ) -> bool {
        let Some(handover) = self.config.handover else { return false };
        if !self.is_running || self.is_root {
            return true;
        }
        // A beacon does not say of which DODAG it is: of the own one, or of the one that was left last.
        let of = self.dodag.as_ref().or_else(|| self.past.last().map(|past| &past.dodag));
        let Some(dodag) = of else { return true };
        let (id, version) = (dodag.id, dodag.version);
        let hop = dodag.configuration.min_hop_rank_increase.max(1);
        let rank = match join_metric {
            NO_WAY => INFINITE_RANK,
            metric => (u16::from(metric) + 1).saturating_mul(hop),
        };
        let initial_etx_x128 = self.config.initial_etx_x128;
        let mut before = None;
        let mut was_weak = false;
        match self.neighbours.get_mut(from) {
            Some(known) if known.dio.dodag_id != id => return true,
            // Most say the same again.
            Some(known) if (known.dio.rank, known.dio.version) == (rank, version) => {
                before = Some((rank, known.is_usable()));
                was_weak = known.is_fading(&handover);
                known.hear(None, now);
                known.forgive(initial_etx_x128, now);
            }
            known => {
                let mut dio = dodag.dio(self.config.instance, rank);
                dio.dtsn = 0;
                if let Some(known) = known {
                    before = Some((known.dio.rank, known.is_usable()));
                    was_weak = known.is_fading(&handover);
                    dio.dtsn = known.dio.dtsn;
                }
                self.note(from, &dio, now);
            }
        }
        let Some(known) = self.neighbours.get_mut(from) else { return true };
        known.follow(rssi_dbm, now);
        let is_weak = known.is_fading(&handover);
        let after = (known.dio.rank, known.is_usable());
        if before != Some(after) || was_weak != is_weak || self.parent().is_none() {
            self.select(now, dice);
        }
        true
    }
}

impl Neighbour {
    /// Follows the trend of its strength.
    fn follow(&mut self, rssi_dbm: f64, now: SimTime) {
        if let Some((last_dbm, last)) = self.latest_dbm
            && last < now
        {
            let since_s = (now - last).ns() as f64 * 1e-9;
            let slope = (rssi_dbm - last_dbm) / since_s;
            // After a long silence the latest difference is all that is known.
            let weight = (since_s / TREND_S).min(1.0);
            self.trend_db_per_s += weight * (slope - self.trend_db_per_s);
        }
        self.latest_dbm = Some((rssi_dbm, now));
        self.rssi_dbm = Some(rssi_dbm);
    }

    /// Whether it will be received too weakly soon.
    pub(super) fn is_fading(&self, handover: &Handover) -> bool {
        let (Some(least_mdbm), Some((latest_dbm, _))) = (handover.least_mdbm, self.latest_dbm)
        else {
            return false;
        };
        let ahead_s = handover.ahead.ns() as f64 * 1e-9;
        let soon_dbm = latest_dbm + self.trend_db_per_s.min(0.0) * ahead_s;
        soon_dbm * 1e3 < f64::from(least_mdbm)
    }
}

/// Over how long the trend of strength is averaged (s).
const TREND_S: f64 = 4.0;
