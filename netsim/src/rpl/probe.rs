//! Looking for a better parent: asking neighbours whose beacons show that they are nearer to the root, and sending frames over
//! links that are not known yet.
//!
//! DIOs of the Trickle timer are rare in a network that stands, and a link counts as a bad one until something was sent over
//! it. Without more, a mote would keep the parent through which it has joined. Contiki-NG probes likewise.

use super::Rpl;
use super::link::Etx;
use crate::dice::Dice;
use crate::wire::Eui64;
use crate::wire::rpl::{DisRepr, RplMessage};
use proto::time::SimTime;
use serde::{Deserialize, Serialize};

/// Who is asked next, and when.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Probes {
    /// When the next frame is due.
    pub(super) at: Option<SimTime>,
    /// A neighbour whose beacon gave it this DAGRank, of which its last DIO, if there was one, said nothing.
    beacon: Option<(Eui64, u16)>,
}

impl Rpl {
    /// A beacon of a neighbour, whose join metric is its DAGRank less one (RFC 8180, § 6.1).
    pub fn handle_beacon(
        &mut self,
        neighbour: Eui64,
        join_metric: u8,
        now: SimTime,
        dice: &mut Dice,
    ) {
        let dag_rank = u16::from(join_metric) + 1;
        // Of most beacons this is known before the neighbour is looked up.
        let is_better = self.probes.beacon.is_none_or(|(_, other)| dag_rank < other);
        if !is_better || !self.could_outdo(dag_rank) {
            return;
        }
        let Some(dodag) = &self.dodag else { return };
        let is_known = self.neighbours.get(neighbour).is_some_and(|one| {
            dodag.id == one.dio.dodag_id && dodag.dag_rank(one.dio.rank) <= dag_rank
        });
        if !is_known {
            self.probes.beacon = Some((neighbour, dag_rank));
            self.schedule_probe(now, dice);
        }
    }

    /// Whether a neighbour of this DAGRank, one good hop away, would give a rank better by a hop.
    fn could_outdo(&self, dag_rank: u16) -> bool {
        let Some(dodag) = self.dodag.as_ref().filter(|dodag| dodag.parent.is_some()) else {
            return false;
        };
        !self.config.stale_rank && dag_rank.saturating_add(1) < dodag.dag_rank(dodag.rank)
    }

    /// The neighbour whose link is hardly known and that would be the best parent if the link were good.
    fn candidate(&self) -> Option<Eui64> {
        let dodag = self.dodag.as_ref()?;
        let hop = dodag.configuration.min_hop_rank_increase.max(1);
        let objective = self.objective();
        (self.neighbours.as_slice().iter())
            .filter(|one| one.is_usable() && one.etx.is_vague())
            .filter(|one| Some(one.address) != dodag.parent)
            .filter(|one| one.dio.dodag_id == dodag.id && one.dio.version == dodag.version)
            .filter(|one| self.could_outdo(dodag.dag_rank(one.dio.rank)))
            .filter(|one| {
                let outdoes = |etx: &Etx| {
                    let via = objective.rank_via(one.dio.rank, etx, hop);
                    via.is_some_and(|via| via.saturating_add(hop) <= dodag.rank)
                };
                outdoes(&Etx::counted(1, 1)) && !outdoes(&one.etx)
            })
            .min_by_key(|one| (one.dio.rank, one.address))
            .map(|one| one.address)
    }

    /// Sets a time for the next frame if there is one to be sent.
    pub(super) fn schedule_probe(&mut self, now: SimTime, dice: &mut Dice) {
        if self.probes.beacon.is_some_and(|(_, dag_rank)| !self.could_outdo(dag_rank)) {
            self.probes.beacon = None;
        }
        if self.probes.beacon.is_none() && self.candidate().is_none() {
            self.probes.at = None;
        } else if self.probes.at.is_none() {
            let period = self.config.probe_period;
            let wait = dice.duration(period / 2, period + period / 2);
            self.probes.at = Some(now.saturating_add(wait));
        }
    }

    /// Asks a neighbour whose rank is not known for it, or sends a DIO, which needs no answer, to learn of a link.
    pub(super) fn probe(&mut self, now: SimTime, dice: &mut Dice) {
        self.probes.at = None;
        let asked = self.probes.beacon.take().map(|(neighbour, _)| neighbour);
        let is_leaf = self.dodag.as_ref().is_some_and(|dodag| dodag.is_leaf);
        let message = if asked.is_some() || is_leaf {
            Some(RplMessage::Dis(DisRepr {}))
        } else {
            self.current_dio().map(RplMessage::Dio)
        };
        if let Some((to, message)) = asked.or_else(|| self.candidate()).zip(message) {
            self.send_alone(to, message);
        }
        self.schedule_probe(now, dice);
    }
}
