//! Routes down: at the root of a non-storing DODAG who is whose parent, in a storing one the next hop to everyone below.

use super::lollipop;
use crate::wire::Eui64;
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::net::Ipv6Addr;

/// Lifetimes are rounded up to whole multiples of this, so that many routes expire at one look.
const GRAIN: SimDuration = SimDuration::from_ns(10_000_000_000);
/// Longest source route (hops): the hop limit of a datagram.
const MAX_HOPS: usize = 255;
/// Lifetime that never ends (RFC 6550, § 6.7.8).
const INFINITE_LIFETIME: u8 = 0xff;

/// Where a target is reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Via {
    /// Non-storing: below this parent.
    Parent(Ipv6Addr),
    /// Storing: through this neighbour.
    Neighbour(Eui64),
}

/// What is known of a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Entry {
    /// Where it is reached.
    pub via: Via,
    /// Path sequence of the advertisement: larger is newer (RFC 6550, § 6.7.8).
    pub path_sequence: u8,
    /// When it ends.
    pub expires: SimTime,
}

/// What an advertisement changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// A new target, or one that has moved, or a newer word of the same.
    Updated,
    /// The same word again.
    Repeated,
    /// An older word: nothing was changed.
    Stale,
    /// The target is gone.
    Removed,
    /// There is no room.
    Full,
}

/// Routes down, by target.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Routes {
    entries: BTreeMap<Ipv6Addr, Entry>,
    /// No route ends before.
    check: Option<SimTime>,
}

impl Routes {
    /// What is known of a target.
    #[must_use]
    pub fn get(&self, target: Ipv6Addr) -> Option<&Entry> {
        self.entries.get(&target)
    }

    /// All of them, by target.
    pub fn iter(&self) -> impl Iterator<Item = (&Ipv6Addr, &Entry)> {
        self.entries.iter()
    }

    /// Number of routes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Takes an advertisement (RFC 6550, § 9.2.1 and 9.3). A lifetime of 0 is a No-Path: it ends the route through `via`
    /// only. Of the same path sequence but by another way: the target, or a router above it, has moved.
    pub fn update(
        &mut self,
        target: Ipv6Addr,
        via: Via,
        path_sequence: u8,
        lifetime: Lifetime,
        max_routes: u32,
        now: SimTime,
    ) -> Change {
        let known = self.entries.get(&target).copied();
        if let Some(known) = known
            && lollipop::compare(path_sequence, known.path_sequence) == Some(Ordering::Less)
        {
            return Change::Stale;
        }
        if lifetime.units == 0 {
            if known.is_none_or(|known| known.via != via) {
                return Change::Stale;
            }
            self.entries.remove(&target);
            return Change::Removed;
        }
        if known.is_none() && max_routes != 0 && max_routes as usize <= self.entries.len() {
            return Change::Full;
        }
        let expires = lifetime.end(now);
        self.entries.insert(target, Entry { via, path_sequence, expires });
        self.check = Some(self.check.map_or(expires, |check| check.min(expires)));
        match known {
            Some(known) if known.via == via && known.path_sequence == path_sequence => {
                Change::Repeated
            }
            _ => Change::Updated,
        }
    }

    /// Removes the route to a target, and returns it.
    pub fn remove(&mut self, target: Ipv6Addr) -> Option<Entry> {
        self.entries.remove(&target)
    }

    /// Forgets what is reached through `via`; returns the targets with their path sequences.
    pub(crate) fn remove_via(&mut self, via: Via) -> Vec<(Ipv6Addr, u8)> {
        let gone: Vec<_> = (self.entries.iter())
            .filter(|(_, entry)| entry.via == via)
            .map(|(&target, entry)| (target, entry.path_sequence))
            .collect();
        for (target, _) in &gone {
            self.entries.remove(target);
        }
        gone
    }

    /// Removes all routes.
    pub fn clear(&mut self) {
        self.entries.clear();
        self.check = None;
    }

    /// When to look for routes that have ended.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<SimTime> {
        self.check
    }

    /// Ends routes whose time is over; returns them.
    pub(crate) fn expire(&mut self, now: SimTime) -> Vec<(Ipv6Addr, u8)> {
        if self.check.is_none_or(|check| now < check) {
            return vec![];
        }
        let mut gone = vec![];
        let mut next = SimTime::NEVER;
        self.entries.retain(|&target, entry| {
            let lives = now < entry.expires;
            if lives {
                next = next.min(entry.expires);
            } else {
                gone.push((target, entry.path_sequence));
            }
            lives
        });
        self.check = (!self.entries.is_empty()).then_some(next);
        gone
    }

    /// The hops from `root` to a target, the target last; `None` if a parent is unknown on the way or the way leads in a
    /// circle (RFC 6550, § 9.7).
    #[must_use]
    pub(crate) fn source_route(&self, root: Ipv6Addr, target: Ipv6Addr) -> Option<Vec<Ipv6Addr>> {
        let longest = MAX_HOPS.min(self.entries.len());
        let mut hops = vec![];
        let mut hop = target;
        while hop != root {
            if hops.len() == longest {
                return None;
            }
            hops.push(hop);
            match self.entries.get(&hop)?.via {
                Via::Parent(parent) => hop = parent,
                Via::Neighbour(_) => return None,
            }
        }
        hops.reverse();
        Some(hops)
    }
}

/// A lifetime as it is advertised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lifetime {
    /// Units; 0: none, 255: without end.
    pub units: u8,
    /// The unit (s).
    pub unit_s: u16,
}

impl Lifetime {
    fn end(self, now: SimTime) -> SimTime {
        if self.units == INFINITE_LIFETIME {
            return SimTime::NEVER;
        }
        let length = SimDuration::from_s(u64::from(self.units) * u64::from(self.unit_s));
        let grains = now.saturating_add(length).saturating_since(SimTime::START).div_ceil(GRAIN);
        SimTime::START.saturating_add(GRAIN.saturating_mul(grains))
    }

    /// What is left of a route, in whole units, at least one.
    #[must_use]
    pub(crate) fn left_until(expires: SimTime, unit_s: u16, now: SimTime) -> Self {
        if expires == SimTime::NEVER {
            return Self { units: INFINITE_LIFETIME, unit_s };
        }
        let unit = SimDuration::from_s(unit_s.max(1).into());
        let units = (expires.saturating_since(now) / unit).clamp(1, 254);
        Self { units: units as u8, unit_s }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::ids::MoteId;

    const MINUTE: Lifetime = Lifetime { units: 1, unit_s: 60 };
    const UNIT: SimDuration = SimDuration::from_ns(60_000_000_000);

    fn mote(n: u16) -> Ipv6Addr {
        Eui64::of_mote(MoteId(n.into())).global()
    }

    fn tree(links: &[(u16, u16)]) -> Routes {
        let mut routes = Routes::default();
        for &(child, parent) in links {
            routes.update(mote(child), Via::Parent(mote(parent)), 240, MINUTE, 0, SimTime::START);
        }
        routes
    }

    fn hops(routes: &Routes, target: u16) -> Option<Vec<Ipv6Addr>> {
        routes.source_route(mote(0), mote(target))
    }

    #[test]
    fn r9_source_routes_of_chain_branch_gap_and_loop() {
        let chain = tree(&[(1, 0), (2, 1), (3, 2)]);
        assert_eq!(hops(&chain, 3), Some(vec![mote(1), mote(2), mote(3)]));
        assert_eq!(hops(&chain, 1), Some(vec![mote(1)]));
        let branch = tree(&[(1, 0), (2, 1), (3, 1), (4, 0)]);
        assert_eq!(hops(&branch, 3), Some(vec![mote(1), mote(3)]));
        assert_eq!(hops(&branch, 4), Some(vec![mote(4)]));
        let gap = tree(&[(1, 0), (3, 2)]);
        assert_eq!(hops(&gap, 3), None);
        assert_eq!(hops(&gap, 7), None);
        let circle = tree(&[(1, 2), (2, 3), (3, 1), (4, 0)]);
        assert_eq!(hops(&circle, 1), None);
        assert_eq!(hops(&tree(&[(1, 1)]), 1), None);
    }

    #[test]
    fn q20_routes_end_with_their_lifetime() {
        let mut routes = tree(&[(1, 0)]);
        assert_eq!(routes.poll_timeout(), Some(SimTime::START + UNIT));
        assert!(routes.expire(SimTime::START + UNIT - SimDuration::from_ns(1)).is_empty());
        routes.update(mote(1), Via::Parent(mote(0)), 241, MINUTE, 0, SimTime::START + UNIT / 2);
        assert!(routes.expire(SimTime::START + UNIT).is_empty());
        assert_eq!(routes.poll_timeout(), Some(SimTime::START + 3 * UNIT / 2));
        assert_eq!(routes.expire(SimTime::START + 3 * UNIT / 2), [(mote(1), 241)]);
        assert_eq!(routes.poll_timeout(), None);
    }

    #[test]
    fn rfc6550_9_2_1_an_older_path_sequence_changes_nothing() {
        let mut routes = tree(&[(2, 1)]);
        let via = Via::Parent(mote(3));
        assert_eq!(routes.update(mote(2), via, 239, MINUTE, 0, SimTime::from_ns(1)), Change::Stale);
        assert_eq!(routes.get(mote(2)).unwrap().via, Via::Parent(mote(1)));
        assert_eq!(
            routes.update(mote(2), via, 241, MINUTE, 0, SimTime::from_ns(1)),
            Change::Updated
        );
        assert_eq!(routes.get(mote(2)).unwrap().via, via);
        assert_eq!(
            routes.update(mote(2), via, 241, MINUTE, 0, SimTime::from_ns(1)),
            Change::Repeated
        );
    }

    #[test]
    fn rfc6550_9_2_2_a_no_path_ends_the_route_through_its_sender_only() {
        let (a, b) =
            (Via::Neighbour(Eui64::of_mote(MoteId(5))), Via::Neighbour(Eui64::of_mote(MoteId(6))));
        let none = Lifetime { units: 0, unit_s: 60 };
        let mut routes = Routes::default();
        routes.update(mote(2), a, 240, MINUTE, 0, SimTime::START);
        routes.update(mote(2), b, 241, MINUTE, 0, SimTime::START);
        assert_eq!(routes.update(mote(2), a, 241, none, 0, SimTime::START), Change::Stale);
        assert_eq!(routes.update(mote(2), b, 241, none, 0, SimTime::START), Change::Removed);
        assert!(routes.is_empty());
    }

    #[test]
    fn a_full_table_takes_news_of_known_targets_only() {
        let via = Via::Neighbour(Eui64::of_mote(MoteId(5)));
        let mut routes = Routes::default();
        assert_eq!(routes.update(mote(1), via, 240, MINUTE, 1, SimTime::START), Change::Updated);
        assert_eq!(routes.update(mote(2), via, 240, MINUTE, 1, SimTime::START), Change::Full);
        assert_eq!(routes.update(mote(1), via, 241, MINUTE, 1, SimTime::START), Change::Updated);
    }

    #[test]
    fn rfc6550_6_7_8_lifetime_255_has_no_end() {
        let mut routes = Routes::default();
        let forever = Lifetime { units: 255, unit_s: 1 };
        routes.update(mote(1), Via::Parent(mote(0)), 240, forever, 0, SimTime::START);
        assert!(routes.expire(SimTime::from_ns(u64::MAX - 1)).is_empty());
    }
}
