//! DIOs and DISs: RFC 6550, § 8.2 and 8.3.

use super::link::Etx;
use super::neighbours::Neighbour;
use super::objective::INFINITE_RANK;
use super::{Event, Outgoing, Rpl, Solicitation, lollipop};
use crate::dice::Dice;
use crate::wire::Eui64;
use crate::wire::address::ALL_RPL_NODES;
use crate::wire::rpl::{DioRepr, DisRepr, RplMessage};
use proto::time::{SimDuration, SimTime};
use std::cmp::Ordering;
use std::net::Ipv6Addr;

/// A solicitation after leaving a DODAG waits between one and two of these, for those below to hear of it first.
const SOLICIT_DELAY: SimDuration = SimDuration::SECOND;

impl Rpl {
    /// A DIO of a neighbour.
    pub(super) fn handle_dio(&mut self, from: Eui64, dio: &DioRepr, now: SimTime, dice: &mut Dice) {
        if dio.instance != self.config.instance {
            return;
        }
        let says_the_same = self.note(from, dio, now);
        self.child_says(from, dio, now);
        if self.is_root {
            self.handle_dio_at_root(dio, now, dice);
            return;
        }
        if self.dodag.is_none() && dio.rank == INFINITE_RANK {
            return;
        }
        let before = self.place();
        self.select(now, dice);
        if self.config.no_trickle_suppression && self.parent().is_some() {
            // The peer joins the DODAG anew with every DIO it hears.
            self.trickle.start_at_min(now, dice);
        } else if self.place() == before {
            self.judge_consistency(from, dio, says_the_same, now, dice);
        }
    }

    /// Whether a DIO that moved nothing was consistent (RFC 6550, § 8.3).
    fn judge_consistency(
        &mut self,
        from: Eui64,
        dio: &DioRepr,
        says_the_same: bool,
        now: SimTime,
        dice: &mut Dice,
    ) {
        let Some(dodag) = &self.dodag else {
            self.poison_again(dio, now);
            return;
        };
        if dodag.id != dio.dodag_id {
            return;
        }
        let is_behind = lollipop::compare(dio.version, dodag.version) == Some(Ordering::Less);
        if dio.rank == INFINITE_RANK || is_behind {
            // Who has left, or has not heard of the new version, shall soon hear whom it can join.
            self.reset_trickle(now, dice);
        } else if dodag.dag_rank(dio.rank) < dodag.dag_rank(dodag.rank)
            && dio.version == dodag.version
            && (says_the_same || !self.parent_set(now).contains(&from))
        {
            self.trickle.handle_consistent();
        }
    }

    /// A root whose DODAG is known in a newer version has restarted: it goes on from there (RFC 6550, § 7.2).
    fn handle_dio_at_root(&mut self, dio: &DioRepr, now: SimTime, dice: &mut Dice) {
        let Some(dodag) = &mut self.dodag else { return };
        if dio.dodag_id != dodag.id {
            return;
        }
        let order = lollipop::compare(dio.version, dodag.version);
        if matches!(order, Some(Ordering::Greater) | None) {
            dodag.version = lollipop::next(dio.version);
            self.reset_trickle(now, dice);
        } else if dio.rank == INFINITE_RANK || order == Some(Ordering::Less) {
            self.reset_trickle(now, dice);
        }
    }

    /// Within the hold after leaving, a mote that still says it is further down than one had been: it may be below and has
    /// missed the news.
    fn poison_again(&mut self, dio: &DioRepr, now: SimTime) {
        let hold = self.config.repair_hold;
        let Some(past) = self.past.iter().find(|past| {
            past.dodag.id == dio.dodag_id
                && past.dodag.version == dio.version
                && !past.dodag.is_leaf
                && now < past.left.saturating_add(hold)
                && past.dodag.dag_rank(past.dodag.rank) < past.dodag.dag_rank(dio.rank)
        }) else {
            return;
        };
        let poison = past.dodag.dio(self.config.instance, INFINITE_RANK);
        let waits = self.outgoing.iter().any(|one| matches!(&one.message, RplMessage::Dio(_)));
        if !waits {
            self.multicast_dio(poison);
        }
    }

    /// Notes what a neighbour says. Returns whether it says what it had said before.
    pub(super) fn note(&mut self, from: Eui64, dio: &DioRepr, now: SimTime) -> bool {
        let initial_etx_x128 = self.config.initial_etx_x128;
        if let Some(known) = self.neighbours.get_mut(from) {
            known.hear(None, now);
            known.forgive(initial_etx_x128, now);
            let same_dodag = known.dio.dodag_id == dio.dodag_id;
            let same = same_dodag
                && (known.dio.version, known.dio.rank, known.dio.preference)
                    == (dio.version, dio.rank, dio.preference);
            // Options may be left out: then what they said last still holds (RFC 6550, § 6.7.6).
            let configuration =
                dio.configuration.or(known.dio.configuration.filter(|_| same_dodag));
            let prefix = dio.prefix.or(known.dio.prefix.filter(|_| same_dodag));
            known.dio = DioRepr { configuration, prefix, ..dio.clone() };
            return same;
        }
        let new = Neighbour {
            address: from,
            dio: dio.clone(),
            etx: Etx::assumed(initial_etx_x128),
            rssi_dbm: None,
            latest_dbm: None,
            trend_db_per_s: 0.0,
            heard: now,
            unusable_until: None,
            n_unusable: 0,
        };
        let parent = self.parent();
        let (max, lifetime) = (self.config.max_neighbours, self.config.neighbour_lifetime);
        self.neighbours.add(new, max, parent, lifetime);
        false
    }

    /// DODAG, version, parent and rank: what a consistent DIO leaves alone.
    fn place(&self) -> Option<(Ipv6Addr, u8, Option<Eui64>, u16)> {
        self.dodag.as_ref().map(|dodag| (dodag.id, dodag.version, dodag.parent, dodag.rank))
    }

    /// A DIS of a neighbour (RFC 6550, § 8.3): to everyone, it is an inconsistency; to us alone, it is answered alone.
    pub(super) fn handle_dis(
        &mut self,
        source: Ipv6Addr,
        from: Eui64,
        multicast: bool,
        now: SimTime,
        dice: &mut Dice,
    ) {
        let Some(dodag) = &self.dodag else { return };
        if multicast {
            if !dodag.is_leaf {
                self.reset_trickle(now, dice);
            }
            return;
        }
        let dio = self.current_dio();
        self.outgoing.extend(dio.map(|dio| Outgoing {
            destination: source,
            next_hop: Some(from),
            message: RplMessage::Dio(dio),
        }));
    }

    /// The DIO of now. What it says counts as advertised.
    pub(super) fn current_dio(&mut self) -> Option<DioRepr> {
        let dodag = self.dodag.as_mut()?;
        let rank = if dodag.is_leaf { INFINITE_RANK } else { dodag.rank };
        dodag.advertised_rank = dodag.rank;
        dodag.lowest_rank = dodag.lowest_rank.min(rank);
        Some(dodag.dio(self.config.instance, rank))
    }

    /// Sends a message to one neighbour alone.
    pub(super) fn send_alone(&mut self, to: Eui64, message: RplMessage) {
        let destination = to.link_local();
        self.outgoing.push_back(Outgoing { destination, next_hop: Some(to), message });
    }

    /// Sends a DIO to all RPL nodes.
    pub(super) fn multicast_dio(&mut self, dio: DioRepr) {
        let message = RplMessage::Dio(dio);
        self.outgoing.push_back(Outgoing { destination: ALL_RPL_NODES, next_hop: None, message });
    }

    /// An inconsistency (RFC 6550, § 8.3).
    pub(super) fn reset_trickle(&mut self, now: SimTime, dice: &mut Dice) {
        if self.trickle.handle_inconsistent(now, dice) {
            self.events.push_back(Event::TrickleReset);
        }
    }

    /// The next solicitation comes soon.
    pub(super) fn solicit_soon(&mut self, now: SimTime, dice: &mut Dice) {
        if self.config.solicitation != Solicitation::Off {
            let delay = dice.duration(SOLICIT_DELAY, 2 * SOLICIT_DELAY);
            self.dis_at = Some(now.saturating_add(delay));
        }
    }

    /// Sends a DIS: the first one to the mote through which one has joined, if so configured, later ones to everyone.
    pub(super) fn solicit(&mut self, now: SimTime) {
        let first = !self.has_solicited && self.config.solicitation == Solicitation::Unicast;
        let next_hop = self.proxy.filter(|_| first);
        self.has_solicited = true;
        self.dis_at = Some(now.saturating_add(self.config.dis_period.max(SimDuration::from_ns(1))));
        self.outgoing.push_back(Outgoing {
            destination: next_hop.map_or(ALL_RPL_NODES, Eui64::link_local),
            next_hop,
            message: RplMessage::Dis(DisRepr {}),
        });
    }
}
