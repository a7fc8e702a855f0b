//! Neighbours that route through this mote.
//!
//! A storing router learns of them from their DAOs, and so does a root. Others in a non-storing DODAG see DAOs pass as
//! datagrams only: whoever hands over a datagram that goes up is a child.

use super::objective::INFINITE_RANK;
use super::routes::Via;
use super::{Event, Rpl};
use crate::wire::Eui64;
use crate::wire::rpl::DioRepr;
use proto::time::{SimDuration, SimTime};

/// Children are looked through at most so often in a lifetime.
const LOOKS: u64 = 8;
/// A lifetime without end.
const INFINITE_LIFETIME: u8 = 0xff;

impl Rpl {
    /// A neighbour routes through this mote: it has sent a DAO, or a datagram that goes up.
    pub(super) fn refresh_child(&mut self, child: Eui64, now: SimTime) {
        let Some(dodag) = &self.dodag else { return };
        let c = &dodag.configuration;
        let length = match c.default_lifetime {
            INFINITE_LIFETIME => SimDuration::MAX,
            units => {
                SimDuration::from_s(u64::from(units.max(1)) * u64::from(c.lifetime_unit_s.max(1)))
            }
        };
        let expires = now.saturating_add(length);
        if self.children.insert(child, expires).is_none() {
            self.events.push_back(Event::ChildAdded(child));
        }
        self.children_check.get_or_insert(expires);
    }

    /// A neighbour does not route through this mote any more.
    pub(super) fn lose_child(&mut self, child: Eui64) {
        if self.children.remove(&child).is_some() {
            self.events.push_back(Event::ChildRemoved(child));
        }
    }

    /// A neighbour's DIO shows that it cannot be below: it has left, or is no further from the root than this mote. If it
    /// has left, what was reached through it is not.
    pub(super) fn child_says(&mut self, from: Eui64, dio: &DioRepr, now: SimTime) {
        let Some(dodag) = &self.dodag else { return };
        let has_left = dio.dodag_id != dodag.id || dio.rank == INFINITE_RANK;
        let is_below = dodag.dag_rank(dodag.rank) < dodag.dag_rank(dio.rank);
        if !self.children.contains_key(&from) || (is_below && !has_left) {
            return;
        }
        self.lose_child(from);
        if has_left {
            let gone = self.routes.remove_via(Via::Neighbour(from));
            self.withdraw(&gone, now);
        }
    }

    /// Forgets children of whom nothing came for the lifetime of a route.
    pub(super) fn expire_children(&mut self, now: SimTime) {
        if self.children_check.is_none_or(|check| now < check) {
            return;
        }
        let gone: Vec<Eui64> = (self.children.iter())
            .filter(|&(_, &expires)| expires <= now)
            .map(|(&child, _)| child)
            .collect();
        for child in gone {
            self.lose_child(child);
        }
        let lifetime = self.dodag.as_ref().map_or(SimDuration::ZERO, |dodag| {
            let c = &dodag.configuration;
            SimDuration::from_s(u64::from(c.default_lifetime) * u64::from(c.lifetime_unit_s))
        });
        let soonest = now.saturating_add(lifetime / LOOKS + SimDuration::from_ns(1));
        self.children_check = self.children.values().min().map(|&at| at.max(soonest));
    }
}
