//! Routing: RPL, RFC 6550, of one mote, as a pure machine.
//!
//! | module | what |
//! |---|---|
//! | [`config`] | what can be set |
//! | [`trickle`] | when to advertise: RFC 6206 |
//! | [`lollipop`] | sequence counters: RFC 6550, § 7.2 |
//! | [`link`] | ETX |
//! | [`objective`], [`of0`], [`mrhof`] | how rank follows from links: RFC 6552, 6719, 8180 |
//! | [`neighbours`] | who was heard |
//! | `probe` | looking for a better parent |
//! | `handover` | parents by beacons, for motes that move |
//! | `select` | the choice of the parent, local repair |
//! | `dio`, `dao` | control messages in and out |
//! | `children` | who routes through this mote |
//! | [`routes`], [`data`] | the way of datagrams, and loops |
//!
//! A mote belongs to one DODAG at a time; every root has its own.

mod children;
pub mod config;
mod dao;
pub mod data;
mod dio;
mod dodag;
mod handover;
pub mod link;
pub mod lollipop;
pub mod mrhof;
pub mod neighbours;
pub mod objective;
pub mod of0;
mod probe;
pub mod routes;
mod select;
#[cfg(test)]
mod tests;
pub mod trickle;

use crate::dice::Dice;
use crate::timer::earliest;
use crate::wire::Eui64;
use crate::wire::rpl::RplMessage;
use dao::Dao;
use dodag::{Dodag, Past};
use neighbours::Neighbours;
use probe::Probes;
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, VecDeque};
use std::net::Ipv6Addr;
use trickle::Trickle;

pub use config::{Config, Handover, Mode, Solicitation};
pub use data::{DropReason, ForwardingDecision, Route};
pub use neighbours::Neighbour;
pub use objective::{INFINITE_RANK, Objective};
pub use routes::Routes;

/// A message to send.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Outgoing {
    /// To whom: all RPL nodes, a neighbour's link-local address, or a global one.
    pub destination: Ipv6Addr,
    /// Through whom; `None`: everyone for multicast, otherwise as [`Rpl::route`] says.
    pub next_hop: Option<Eui64>,
    /// The RPL message to send.
    pub message: RplMessage,
}

/// What has happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Event {
    /// Another preferred parent, or none.
    ParentChanged {
        /// The one until now.
        old: Option<Eui64>,
        /// The one from now on.
        new: Option<Eui64>,
    },
    /// Belongs to this DODAG from now on.
    Joined {
        /// The root's address.
        dodag: Ipv6Addr,
    },
    /// Belongs to no DODAG any more.
    Detached,
    /// The own rank is another one.
    RankChanged,
    /// A neighbour routes through this mote.
    ChildAdded(Eui64),
    /// It does so no longer.
    ChildRemoved(Eui64),
    /// The DODAG was left because nobody could be the parent.
    LocalRepair,
    /// DIOs come in short intervals again.
    TrickleReset,
}

/// RPL of one mote.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rpl {
    config: Config,
    own: Eui64,
    is_root: bool,
    is_running: bool,
    /// Through whom this mote joined the network.
    proxy: Option<Eui64>,
    neighbours: Neighbours,
    dodag: Option<Dodag>,
    /// DODAGs that were left, not yet forgotten.
    past: Vec<Past>,
    /// Own DTSN and, as root, version to begin with: kept over stops.
    dtsn: u8,
    version: u8,
    trickle: Trickle,
    routes: Routes,
    dao: Dao,
    /// Neighbours that route through this mote, and until when that is believed.
    children: BTreeMap<Eui64, SimTime>,
    children_check: Option<SimTime>,
    dis_at: Option<SimTime>,
    has_solicited: bool,
    hold_until: Option<SimTime>,
    /// Since when a neighbour has offered a rank better by a hop than the parent does.
    outdone_since: Option<SimTime>,
    probes: Probes,
    global_repair: Option<SimTime>,
    /// A link is why parents are being looked at.
    etx_changed: bool,
    outgoing: VecDeque<Outgoing>,
    events: VecDeque<Event>,
}

impl Rpl {
    /// At rest.
    #[must_use]
    pub fn new(config: Config, own: Eui64, is_root: bool) -> Self {
        Self {
            config,
            own,
            is_root,
            is_running: false,
            proxy: None,
            neighbours: Neighbours::default(),
            dodag: None,
            past: vec![],
            dtsn: lollipop::INITIAL,
            version: lollipop::INITIAL,
            trickle: Trickle::new(SimDuration::from_ns(1), 0, 0),
            routes: Routes::default(),
            dao: Dao::new(),
            children: BTreeMap::new(),
            children_check: None,
            dis_at: None,
            has_solicited: false,
            hold_until: None,
            outdone_since: None,
            probes: Probes::default(),
            global_repair: None,
            etx_changed: false,
            outgoing: VecDeque::new(),
            events: VecDeque::new(),
        }
    }

    /// Through whom the mote has joined the network: the first solicitation goes there.
    pub(crate) fn set_proxy(&mut self, proxy: Option<Eui64>) {
        self.proxy = proxy;
    }

    /// Begins: a root its DODAG, others to look for one.
    pub fn start(&mut self, now: SimTime, dice: &mut Dice) {
        if self.is_running {
            return;
        }
        self.is_running = true;
        if self.is_root {
            let dodag = Dodag::of_root(&self.config, self.own, self.version, self.dtsn);
            self.trickle = dodag.trickle();
            self.trickle.start_at_min(now, dice);
            self.events.push_back(Event::Joined { dodag: dodag.id });
            self.dodag = Some(dodag);
            self.schedule_global_repair(now);
        } else if self.config.solicitation != Solicitation::Off {
            self.solicit(now);
        }
    }

    /// Ends, and forgets neighbours, DODAG and routes. Sequence numbers go on where they were.
    pub fn stop(&mut self) {
        if !self.is_running {
            return;
        }
        self.is_running = false;
        if let Some(dodag) = self.dodag.take() {
            if self.config.root_keeps_version {
                // A root that returns has no routes: a new version brings them.
                self.version = lollipop::next(dodag.version);
            } else if self.is_root {
                (self.version, self.dtsn) = (lollipop::INITIAL, lollipop::INITIAL);
            }
            if dodag.parent.is_some() {
                self.events.push_back(Event::ParentChanged { old: dodag.parent, new: None });
            }
            self.events.push_back(Event::Detached);
        }
        self.forget_below();
        self.neighbours.clear();
        self.past.clear();
        self.trickle.stop();
        self.dis_at = None;
        self.has_solicited = false;
        self.hold_until = None;
        self.outdone_since = None;
        self.probes = Probes::default();
        self.global_repair = None;
        self.outgoing.clear();
    }

    /// A control message for this mote has come from neighbour `from`; `source` is its IPv6 source.
    pub(crate) fn handle_message(
        &mut self,
        from: Eui64,
        source: Ipv6Addr,
        multicast: bool,
        message: &RplMessage,
        now: SimTime,
        dice: &mut Dice,
    ) {
        if !self.is_running {
            return;
        }
        match message {
            RplMessage::Dis(_) => self.handle_dis(source, from, multicast, now, dice),
            RplMessage::Dio(dio) => self.handle_dio(from, dio, now, dice),
            RplMessage::Dao(dao) => self.handle_dao(from, source, dao, now),
            RplMessage::DaoAck(ack) => self.handle_dao_ack(from, *ack, now, dice),
        }
    }

    /// A frame to a neighbour was sent `n_transmissions` times; the last one was acknowledged or not.
    pub(crate) fn handle_link(
        &mut self,
        neighbour: Eui64,
        n_transmissions: u16,
        acknowledged: bool,
        now: SimTime,
        dice: &mut Dice,
    ) {
        let (max_failures, hold) = (self.config.max_failures, self.config.unusable_hold);
        let objective = self.objective();
        let Some(known) = self.neighbours.get_mut(neighbour) else { return };
        let before = objective.rank_via(known.dio.rank, &known.etx, 1);
        if self.config.stale_rank {
            known.etx.count_by_hundreds(n_transmissions, acknowledged);
        } else {
            known.etx.count(n_transmissions, acknowledged);
        }
        if acknowledged {
            known.heard = now;
            known.n_unusable = 0;
        }
        let fails = max_failures <= known.etx.n_failed() || !objective.accepts(&known.etx);
        if fails && known.unusable_until.is_none() {
            known.mark_unusable(hold, now);
        }
        if fails || before != objective.rank_via(known.dio.rank, &known.etx, 1) {
            self.etx_changed = self.parent() == Some(neighbour);
            self.select(now, dice);
            self.etx_changed = false;
        }
    }

    /// A neighbour cannot be used: the scheduling function has given up on it, or it has rejected this mote.
    pub(crate) fn handle_unusable(&mut self, neighbour: Eui64, now: SimTime, dice: &mut Dice) {
        let hold = self.config.unusable_hold;
        let Some(known) = self.neighbours.get_mut(neighbour) else { return };
        known.mark_unusable(hold, now);
        self.select(now, dice);
    }

    /// A neighbour is in quarantine: the scheduling function has nothing to do with it until then (RFC 9033, § 12), so that
    /// it is no parent before.
    pub(crate) fn handle_quarantine(
        &mut self,
        neighbour: Eui64,
        until: SimTime,
        now: SimTime,
        dice: &mut Dice,
    ) {
        let Some(known) = self.neighbours.get_mut(neighbour) else { return };
        known.unusable_until = known.unusable_until.max(Some(until));
        self.select(now, dice);
    }

    /// A frame of a neighbour was heard at strength `rssi_dbm`: it is still there.
    pub fn handle_rssi(&mut self, neighbour: Eui64, rssi_dbm: f64, now: SimTime) {
        if let Some(known) = self.neighbours.get_mut(neighbour) {
            known.hear(Some(rssi_dbm), now);
        }
    }

    /// As root: a new version of the DODAG, so that everyone finds its place anew (RFC 6550, § 3.2.2).
    pub(crate) fn global_repair(&mut self, now: SimTime, dice: &mut Dice) {
        let Some(dodag) = self.dodag.as_mut().filter(|_| self.is_root) else { return };
        dodag.version = lollipop::next(dodag.version);
        self.reset_trickle(now, dice);
        self.schedule_global_repair(now);
    }

    fn schedule_global_repair(&mut self, now: SimTime) {
        let period = self.config.global_repair_period;
        self.global_repair = (!period.is_zero()).then(|| now.saturating_add(period));
    }

    /// The next message to send.
    pub(crate) fn poll_transmit(&mut self) -> Option<Outgoing> {
        self.outgoing.pop_front()
    }

    /// Whether there are events or messages that the layers above have not taken yet.
    #[must_use]
    pub(crate) fn has_news(&self) -> bool {
        !self.events.is_empty() || !self.outgoing.is_empty()
    }

    /// The next event for the layers above, removed from the queue; `None`: there is none.
    pub(crate) fn poll_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// When to call [`Rpl::handle_timeout`].
    #[must_use]
    pub fn poll_timeout(&self) -> Option<SimTime> {
        if !self.is_running {
            return None;
        }
        earliest([
            self.trickle.poll_timeout(),
            self.dis_at,
            self.hold_until,
            self.global_repair,
            self.dao.poll_timeout(),
            self.routes.poll_timeout(),
            self.children_check,
            self.neighbours.poll_timeout(),
            self.outdone_since.map(|since| since.saturating_add(self.config.outdone)),
            self.probes.at,
        ])
    }

    /// Does what is due by `now`: messages, and neighbours and routes that have expired.
    pub fn handle_timeout(&mut self, now: SimTime, dice: &mut Dice) {
        if !self.is_running {
            return;
        }
        let is_due = |at: Option<SimTime>| at.is_some_and(|at| at <= now);
        while is_due(self.trickle.poll_timeout()) {
            if self.trickle.handle_timeout(now, dice)
                && let Some(dio) = self.current_dio()
            {
                self.multicast_dio(dio);
            }
        }
        if is_due(self.dis_at) {
            self.solicit(now);
        }
        if is_due(self.global_repair) {
            self.global_repair(now, dice);
        }
        let gone = self.routes.expire(now);
        self.withdraw(&gone, now);
        self.expire_children(now);
        let lifetime = self.config.neighbour_lifetime;
        let held = is_due(self.hold_until);
        if held {
            self.hold_until = None;
        }
        let is_outdone = self.is_outdone(now);
        if self.neighbours.expire(lifetime, now) || held || is_outdone {
            self.select(now, dice);
        }
        if is_due(self.probes.at) {
            self.probe(now, dice);
        }
        self.dao_timeout(now, dice);
    }

    /// Own rank; infinite outside a DODAG.
    #[must_use]
    pub fn rank(&self) -> u16 {
        self.dodag.as_ref().map_or(INFINITE_RANK, |dodag| dodag.rank)
    }

    /// Own rank in whole hops (RFC 6550, § 3.5.1).
    #[must_use]
    pub(crate) fn dag_rank(&self) -> u16 {
        self.dodag.as_ref().map_or(INFINITE_RANK, |dodag| dodag.dag_rank(dodag.rank))
    }

    /// Whether datagrams find their way down to this mote, as far as it knows: a root, a mote whose advertisement was
    /// acknowledged or needs none, or one that advertises nothing.
    #[must_use]
    pub(crate) fn is_reachable(&self) -> bool {
        self.is_root || !self.config.advertises || self.dao.is_advertised
    }

    /// Whether nobody routes through this mote (RFC 6550, § 8.5).
    #[must_use]
    pub(crate) fn is_leaf(&self) -> bool {
        self.config.is_leaf
    }

    /// The preferred parent; `None`: the mote is a root, or has none.
    #[must_use]
    pub fn parent(&self) -> Option<Eui64> {
        self.dodag.as_ref().and_then(|dodag| dodag.parent)
    }

    /// The DODAG: its root's address.
    #[must_use]
    pub fn dodag_id(&self) -> Option<Ipv6Addr> {
        self.dodag.as_ref().map(|dodag| dodag.id)
    }

    /// Version of the DODAG that the mote is part of; `None`: of none.
    #[must_use]
    pub fn version(&self) -> Option<u8> {
        self.dodag.as_ref().map(|dodag| dodag.version)
    }

    /// The DODAG's /64 prefix.
    #[must_use]
    pub fn prefix(&self) -> Option<u64> {
        self.dodag.as_ref().and_then(|dodag| dodag.prefix)
    }

    /// The mote's own global address, once it knows the prefix.
    #[must_use]
    pub fn address(&self) -> Option<Ipv6Addr> {
        self.prefix().map(|prefix| self.own.under(prefix))
    }

    /// Who keeps routes down in this DODAG.
    #[must_use]
    pub fn mode(&self) -> Option<Mode> {
        self.dodag.as_ref().and_then(Dodag::mode)
    }

    /// Whether the mote belongs to a DODAG.
    #[must_use]
    pub fn is_in_dodag(&self) -> bool {
        self.dodag.is_some()
    }

    /// Neighbours that were heard, by address.
    #[must_use]
    pub fn neighbours(&self) -> &[Neighbour] {
        self.neighbours.as_slice()
    }

    /// Neighbours that route through this mote, by address.
    pub fn children(&self) -> impl Iterator<Item = Eui64> + '_ {
        self.children.keys().copied()
    }

    /// Routes down the DODAG, to the motes below this one.
    #[must_use]
    pub fn routes(&self) -> &Routes {
        &self.routes
    }
}
