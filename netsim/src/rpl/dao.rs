//! DAOs and their acknowledgments: RFC 6550, § 9.

use super::routes::{Change, Lifetime, Via};
use super::{Mode, Outgoing, Rpl, lollipop};
use crate::dice::Dice;
use crate::wire::Eui64;
use crate::wire::rpl::{DaoAckRepr, DaoRepr, RplMessage};
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::net::Ipv6Addr;

/// First status of a rejection (RFC 6550, § 6.5.1).
const REJECTED: u8 = 128;
/// A lifetime without end.
const INFINITE_LIFETIME: u8 = 0xff;

/// Advertisements under way.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Dao {
    /// Of the last DAO (DAOSequence).
    sequence: u8,
    /// Of the own address.
    path_sequence: u8,
    /// When to advertise next.
    at: Option<SimTime>,
    /// When it last did.
    last: Option<SimTime>,
    /// A change was not advertised, because nobody needed the way down.
    is_stale: bool,
    /// Until when somebody needs it.
    needed_until: SimTime,
    /// Then everything that is kept for those below, too (storing mode).
    in_full: bool,
    /// The parent that was left and still has routes (storing mode).
    left: Option<Eui64>,
    /// Not acknowledged yet.
    pending: Vec<Pending>,
    /// The way down was acknowledged as it is: it is only refreshed.
    is_known: bool,
    /// Routes down to this mote are known above: it was acknowledged that they are, or none was asked to acknowledge it.
    pub(super) is_advertised: bool,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Pending {
    dao: DaoRepr,
    destination: Ipv6Addr,
    next_hop: Eui64,
    n_retries: u8,
    deadline: SimTime,
}

impl Dao {
    pub(super) fn new() -> Self {
        let (sequence, path_sequence) = (lollipop::INITIAL, lollipop::INITIAL);
        Self {
            sequence,
            path_sequence,
            at: None,
            last: None,
            is_stale: false,
            needed_until: SimTime::START,
            in_full: false,
            left: None,
            pending: vec![],
            is_known: false,
            is_advertised: false,
        }
    }

    pub(super) fn stop(&mut self) {
        self.at = None;
        self.last = None;
        self.is_stale = false;
        self.needed_until = SimTime::START;
        self.left = None;
        self.pending.clear();
        self.is_known = false;
        self.is_advertised = false;
    }

    pub(super) fn poll_timeout(&self) -> Option<SimTime> {
        self.pending.iter().map(|one| one.deadline).chain(self.at).min()
    }
}

impl Rpl {
    /// The parent has changed: it and, in storing mode, the old one must hear of it (RFC 6550, § 9.8 and 9.2.2).
    pub(super) fn move_routes(
        &mut self,
        old: Option<Eui64>,
        new: Eui64,
        now: SimTime,
        dice: &mut Dice,
    ) {
        // Whoever is above now is not below any more.
        self.routes.remove_via(Via::Neighbour(new));
        self.lose_child(new);
        self.dao.pending.clear();
        if self.mode() == Some(Mode::Storing) && self.config.advertises {
            self.dao.left = old;
            self.dao.in_full = true;
        }
        self.schedule_dao(now, dice);
    }

    /// The parent asks for advertisements (RFC 6550, § 9.6).
    pub(super) fn follow_dtsn(&mut self, parent_dtsn: u8, now: SimTime, dice: &mut Dice) {
        let Some(dodag) = &mut self.dodag else { return };
        if !lollipop::is_newer(parent_dtsn, dodag.parent_dtsn) {
            return;
        }
        if dodag.mode() == Some(Mode::NonStoring) {
            dodag.dtsn = lollipop::next(dodag.dtsn);
            self.dtsn = dodag.dtsn;
            self.reset_trickle(now, dice);
        } else {
            self.dao.in_full = true;
        }
        self.schedule_dao(now, dice);
    }

    /// There is news to advertise: soon (DelayDAO: RFC 6550, § 9.5), and to be acknowledged.
    pub(super) fn schedule_dao(&mut self, now: SimTime, dice: &mut Dice) {
        self.dao.is_known = false;
        if !self.config.advertises || self.mode().is_none() {
            return;
        }
        self.dao.is_stale = !self.is_way_down_needed(now);
        if self.dao.is_stale {
            return;
        }
        let delay = self.config.dao_delay;
        let at = now.saturating_add(dice.duration(delay / 2, delay + delay / 2));
        let apart = self.config.dao_interval;
        let at = self.dao.last.map_or(at, |last| at.max(last + apart));
        self.dao.at = Some(self.dao.at.map_or(at, |soon| soon.min(at)));
    }

    /// A request to join has come this way: the answer needs a way back.
    pub(crate) fn handle_join_request(&mut self, now: SimTime, dice: &mut Dice) {
        if let Some(within) = self.config.dao_for_joins {
            self.dao.needed_until = now.saturating_add(within);
            if self.dao.is_stale {
                self.schedule_dao(now, dice);
            }
        }
    }

    /// Whether anybody needs the way down to this mote, if not everybody always does. The first advertisement is always needed: without it
    /// nobody is admitted through the mote.
    fn is_way_down_needed(&self, now: SimTime) -> bool {
        self.config.dao_for_joins.is_none()
            || self.dao.last.is_none()
            || now < self.dao.needed_until
    }

    /// Time has passed: repeats what was not acknowledged, and advertises when it is time to.
    pub(super) fn dao_timeout(&mut self, now: SimTime, dice: &mut Dice) {
        self.repeat_daos(now, dice);
        if self.dao.at.is_none_or(|at| now < at) {
            return;
        }
        self.dao.at = None;
        self.dao.is_stale = !self.is_way_down_needed(now);
        if self.dao.is_stale {
            return;
        }
        self.dao.last = Some(now);
        let Some(dodag) = &self.dodag else { return };
        let Some(parent) = dodag.parent else { return };
        let c = &dodag.configuration;
        let (lifetime, unit_s) = (c.default_lifetime.max(1), c.lifetime_unit_s);
        let period = match self.config.dao_period {
            SimDuration::ZERO if lifetime == INFINITE_LIFETIME => None,
            SimDuration::ZERO => {
                Some(SimDuration::from_ms(500) * (u64::from(lifetime) * u64::from(unit_s.max(1))))
            }
            period => Some(period),
        };
        // A fifth more or less, so that motes that start together do not stay so.
        self.dao.at = period.map(|period| {
            let fifth = period / 5;
            now.saturating_add(
                dice.duration(period - fifth, period + fifth + SimDuration::from_ns(1)),
            )
        });
        let before = self.dao.path_sequence;
        self.dao.path_sequence = lollipop::next(before);
        self.advertise(parent, lifetime, now);
        // The new way first, then the old one is taken back, under the old path sequence: routers on both keep the new.
        if let Some(left) = self.dao.left.take().filter(|&left| left != parent) {
            self.take_back(left, before, now);
        }
    }

    /// Takes back from a former parent whatever was advertised to it: No-Path (RFC 6550, § 9.2.2).
    fn take_back(&mut self, from: Eui64, path_sequence: u8, now: SimTime) {
        let own = self.address().map(|address| (address, path_sequence));
        let below = self.routes.iter().map(|(&target, entry)| (target, entry.path_sequence));
        let mut groups: BTreeMap<u8, Vec<Ipv6Addr>> = BTreeMap::new();
        for (target, path_sequence) in own.into_iter().chain(below) {
            groups.entry(path_sequence).or_default().push(target);
        }
        for (path_sequence, targets) in groups {
            self.send_dao(from, &targets, path_sequence, 0, false, now);
        }
    }

    /// Advertises the own address and, in storing mode where asked for, everything below. What was acknowledged and is only
    /// refreshed needs no acknowledgment: the next refresh comes before the route ends.
    fn advertise(&mut self, to: Eui64, lifetime: u8, now: SimTime) {
        let Some(address) = self.address() else { return };
        let path_sequence = self.dao.path_sequence;
        if self.mode() == Some(Mode::NonStoring) {
            // What is still under way says less than this.
            self.dao.pending.clear();
        }
        let mut groups = BTreeMap::from([((path_sequence, lifetime), vec![address])]);
        if std::mem::take(&mut self.dao.in_full) {
            let unit_s = self.dodag.as_ref().map_or(1, |dodag| dodag.configuration.lifetime_unit_s);
            for (&target, entry) in self.routes.iter() {
                let units = Lifetime::left_until(entry.expires, unit_s, now).units;
                groups.entry((entry.path_sequence, units)).or_default().push(target);
            }
        }
        let wants_ack = !self.dao.is_known;
        for ((path_sequence, lifetime), targets) in groups {
            self.send_dao(to, &targets, path_sequence, lifetime, wants_ack, now);
        }
    }

    /// Sends targets of one path sequence and lifetime, as many to a message as fit. `wants_ack`: they are to be acknowledged
    /// if acknowledgments are used.
    fn send_dao(
        &mut self,
        to: Eui64,
        targets: &[Ipv6Addr],
        path_sequence: u8,
        path_lifetime: u8,
        wants_ack: bool,
        now: SimTime,
    ) {
        let Some(dodag) = &self.dodag else { return };
        let (destination, parent) = match dodag.mode() {
            Some(Mode::NonStoring) => (dodag.id, dodag.prefix.map(|prefix| to.under(prefix))),
            Some(Mode::Storing) => (to.link_local(), None),
            None => return,
        };
        for targets in targets.chunks(usize::from(self.config.max_dao_targets.max(1))) {
            self.dao.sequence = lollipop::next(self.dao.sequence);
            let dao = DaoRepr {
                instance: self.config.instance,
                ack_request: self.config.dao_ack && wants_ack,
                sequence: self.dao.sequence,
                targets: targets.to_vec(),
                path_sequence,
                path_lifetime,
                parent,
            };
            self.dao.is_advertised |= !dao.ack_request && path_lifetime != 0;
            if dao.ack_request {
                self.dao.pending.push(Pending {
                    dao: dao.clone(),
                    destination,
                    next_hop: to,
                    n_retries: 0,
                    deadline: now
                        .saturating_add(self.config.dao_ack_wait.max(SimDuration::from_ns(1))),
                });
            }
            let message = RplMessage::Dao(dao);
            self.outgoing.push_back(Outgoing { destination, next_hop: Some(to), message });
        }
    }

    /// Sends again what was not acknowledged in time; after the last time, begins anew later.
    fn repeat_daos(&mut self, now: SimTime, dice: &mut Dice) {
        let (wait, max) =
            (self.config.dao_ack_wait.max(SimDuration::from_ns(1)), self.config.dao_max_retries);
        let mut given_up = false;
        let outgoing = &mut self.outgoing;
        self.dao.pending.retain_mut(|one| {
            if now < one.deadline {
                return true;
            }
            if one.n_retries == max {
                given_up = true;
                return false;
            }
            one.n_retries += 1;
            let wait = wait.saturating_mul(1 << one.n_retries.min(16));
            one.deadline = now.saturating_add(wait);
            outgoing.push_back(Outgoing {
                destination: one.destination,
                next_hop: Some(one.next_hop),
                message: RplMessage::Dao(one.dao.clone()),
            });
            true
        });
        if given_up {
            (self.dao.in_full, self.dao.is_known) = (true, false);
            let pause = wait.saturating_mul(1 << max.min(16));
            let at = now + dice.duration(pause / 2, pause.saturating_add(SimDuration::from_ns(1)));
            self.dao.at = Some(self.dao.at.map_or(at, |soon| soon.min(at)));
        }
    }

    /// A DAO for this mote: as root of a non-storing DODAG from anywhere, as storing router from a child.
    pub(super) fn handle_dao(
        &mut self,
        from: Eui64,
        source: Ipv6Addr,
        dao: &DaoRepr,
        now: SimTime,
    ) {
        let Some(dodag) = &self.dodag else { return };
        let is_leaf = dodag.is_leaf;
        // From above a DAO can only come by a loop.
        if dao.instance != self.config.instance || dodag.parent == Some(from) {
            return;
        }
        let status = match dodag.mode() {
            Some(Mode::NonStoring) if self.is_root => self.take_transit(from, dao, now),
            Some(Mode::Storing) if !is_leaf => self.take_targets(from, dao, now),
            _ => return,
        };
        if dao.ack_request {
            let next_hop = (self.mode() == Some(Mode::Storing)).then_some(from);
            let ack = DaoAckRepr { instance: dao.instance, sequence: dao.sequence, status };
            let message = RplMessage::DaoAck(ack);
            self.outgoing.push_back(Outgoing { destination: source, next_hop, message });
        }
    }

    /// At the root, non-storing: whose parent is who (RFC 6550, § 9.7).
    fn take_transit(&mut self, from: Eui64, dao: &DaoRepr, now: SimTime) -> u8 {
        let Some(parent) = dao.parent else { return REJECTED };
        let lifetime = self.lifetime(dao.path_lifetime);
        let own = self.address();
        let mut status = 0;
        for &target in dao.targets.iter().filter(|&&target| Some(target) != own) {
            let change = self.routes.update(
                target,
                Via::Parent(parent),
                dao.path_sequence,
                lifetime,
                self.config.max_routes,
                now,
            );
            if change == Change::Full {
                status = REJECTED;
            }
            let child = Eui64::of_ip(target);
            if change != Change::Stale && child != from && Some(parent) != own {
                self.lose_child(child);
            }
        }
        if dao.targets.contains(&from.under(self.config.prefix)) && Some(parent) == own {
            self.refresh_child(from, now);
        }
        status
    }

    /// Storing: targets below a child; what is new goes on to the parent (RFC 6550, § 9.8).
    fn take_targets(&mut self, from: Eui64, dao: &DaoRepr, now: SimTime) -> u8 {
        let lifetime = self.lifetime(dao.path_lifetime);
        let own = self.address();
        let mut status = 0;
        let mut news = vec![];
        for &target in dao.targets.iter().filter(|&&target| Some(target) != own) {
            let change = self.routes.update(
                target,
                Via::Neighbour(from),
                dao.path_sequence,
                lifetime,
                self.config.max_routes,
                now,
            );
            match change {
                Change::Updated | Change::Removed => news.push(target),
                Change::Full => status = REJECTED,
                Change::Repeated | Change::Stale => {}
            }
        }
        if dao.path_lifetime != 0 {
            self.refresh_child(from, now);
        } else if dao.targets.iter().any(|&target| Eui64::of_ip(target) == from) {
            self.lose_child(from);
        }
        if let Some(parent) = self.parent().filter(|_| !news.is_empty()) {
            let (path_sequence, lifetime) = (dao.path_sequence, dao.path_lifetime);
            self.send_dao(parent, &news, path_sequence, lifetime, lifetime != 0, now);
        }
        status
    }

    /// An acknowledgment. A rejection sends a storing mote to another parent (RFC 6550, § 9.3).
    pub(super) fn handle_dao_ack(
        &mut self,
        from: Eui64,
        ack: DaoAckRepr,
        now: SimTime,
        dice: &mut Dice,
    ) {
        let is_ours = |one: &Pending| one.dao.sequence == ack.sequence;
        if ack.instance != self.config.instance || !self.dao.pending.iter().any(is_ours) {
            return;
        }
        self.dao.pending.retain(|one| !is_ours(one));
        self.dao.is_advertised |= ack.status < REJECTED;
        self.dao.is_known = ack.status < REJECTED && self.dao.pending.is_empty();
        if ack.status >= REJECTED
            && self.mode() == Some(Mode::Storing)
            && self.parent() == Some(from)
        {
            self.handle_unusable(from, now, dice);
        }
    }

    /// Takes routes back that have ended or lead nowhere (storing mode), from all above.
    pub(super) fn withdraw(&mut self, gone: &[(Ipv6Addr, u8)], now: SimTime) {
        let Some(parent) = self.parent() else { return };
        if self.mode() == Some(Mode::Storing) {
            for &(target, path_sequence) in gone {
                self.send_dao(parent, &[target], path_sequence, 0, false, now);
            }
        }
    }

    fn lifetime(&self, units: u8) -> Lifetime {
        let unit_s = self.dodag.as_ref().map_or(0, |dodag| dodag.configuration.lifetime_unit_s);
        Lifetime { units, unit_s }
    }
}
