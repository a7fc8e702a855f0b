//! The choice of the preferred parent: RFC 6550, § 8.2.2; RFC 6552, § 4.2; RFC 6719, § 3.2.

use super::dodag::{Dodag, Past};
use super::neighbours::Neighbour;
use super::objective::{INFINITE_RANK, Objective};
use super::{Event, Rpl, lollipop};
use crate::dice::Dice;
use crate::wire::Eui64;
use proto::time::SimTime;
use std::cmp::{Ordering, Reverse};

/// What a neighbour offers as parent.
#[derive(Clone, Copy, Debug)]
struct Offer {
    address: Eui64,
    preference: u8,
    /// A newer version of the own DODAG.
    is_newer: bool,
    /// Rank through it.
    rank: u16,
    rssi_dbm: f64,
}

impl Offer {
    /// The better one is less: preference of the DODAG, version, rank; then the stronger signal (a peer takes the weaker
    /// one, its Q24), then the lower address.
    fn compare(&self, other: &Self) -> Ordering {
        let key = |offer: &Self| (Reverse((offer.preference, offer.is_newer)), offer.rank);
        key(self)
            .cmp(&key(other))
            .then(other.rssi_dbm.total_cmp(&self.rssi_dbm))
            .then(self.address.cmp(&other.address))
    }
}

impl Rpl {
    /// Looks at all neighbours anew: stays, changes parent, joins or leaves.
    pub(super) fn select(&mut self, now: SimTime, dice: &mut Dice) {
        if self.is_root || !self.is_running {
            return;
        }
        let forget = self.config.forget;
        self.past.retain(|past| now < past.left.saturating_add(forget));
        let parent = self.parent();
        let mut best: Option<Offer> = None;
        let mut current: Option<Offer> = None;
        for neighbour in self.neighbours.as_slice() {
            let Some(offer) = self.offer(neighbour, now) else { continue };
            if Some(offer.address) == parent {
                current = Some(offer);
            }
            if best.is_none_or(|best| offer.compare(&best).is_lt()) {
                best = Some(offer);
            }
        }
        self.note_outdone(best.as_ref(), current.as_ref(), now);
        match (best, current) {
            (None, _) if self.dodag.is_some() => self.detach(now, dice),
            (None, _) => {}
            (Some(best), Some(current)) if !self.switches(&best, &current, now) => {
                self.adopt(&current, now, dice);
            }
            (Some(best), _) => {
                self.outdone_since = None;
                self.adopt(&best, now, dice);
            }
        }
        self.schedule_probe(now, dice);
    }

    /// Remembers since when somebody has offered a rank that is better by a hop than the one through the parent.
    fn note_outdone(&mut self, best: Option<&Offer>, current: Option<&Offer>, now: SimTime) {
        let (Some(best), Some(current), false) = (best, current, self.config.stale_rank) else {
            self.outdone_since = None;
            return;
        };
        let hop = self.dodag.as_ref().map_or(1, |dodag| dodag.configuration.min_hop_rank_increase);
        let is_outdone = best.preference == current.preference
            && best.is_newer == current.is_newer
            && best.rank.saturating_add(hop.max(1)) <= current.rank;
        self.outdone_since = is_outdone.then(|| self.outdone_since.unwrap_or(now));
    }

    /// Whether the parent has been outdone for so long that no threshold protects it.
    pub(super) fn is_outdone(&self, now: SimTime) -> bool {
        let outdone = self.config.outdone;
        self.outdone_since.is_some_and(|since| since.saturating_add(outdone) <= now)
    }

    /// Hysteresis: a permitted parent is left for a DODAG of higher preference, a newer version, or a rank that is better
    /// by more than the threshold (RFC 8180, § 6.4; RFC 6719, § 3.2.2). Below the threshold it may be kept, and is for a
    /// while: a threshold of 640 would keep a way of three good hops where there is one of one.
    fn switches(&self, best: &Offer, current: &Offer, now: SimTime) -> bool {
        self.is_outdone(now)
            || best.preference > current.preference
            || (best.is_newer && !current.is_newer)
            || self.switch_threshold() < current.rank.saturating_sub(best.rank)
    }

    /// A parent is left for one that improves rank by more than this: where ranks come with beacons, in whole hops, by anything.
    fn switch_threshold(&self) -> u16 {
        if self.config.handover.is_some() { 0 } else { self.objective().switch_threshold() }
    }

    /// What a neighbour offers; `None` if it must not be the parent.
    fn offer(&self, neighbour: &Neighbour, now: SimTime) -> Option<Offer> {
        if !neighbour.is_usable() {
            return None;
        }
        let dio = &neighbour.dio;
        let configuration = dio.configuration.unwrap_or_else(|| self.config.configuration());
        let objective = self.objective_of(configuration.objective);
        let hop = configuration.min_hop_rank_increase;
        let rank = objective.rank_via(dio.rank, &neighbour.etx, hop)?;
        let is_fading = self.config.handover.is_some_and(|handover| neighbour.is_fading(&handover));
        // A hop farther, and behind whoever is as near with a signal that holds.
        let penalty = if is_fading { hop.saturating_add(1) } else { 0 };
        let rank = rank.saturating_add(penalty).min(INFINITE_RANK - 1);
        let is_newer = match &self.dodag {
            Some(dodag) if dodag.id == dio.dodag_id => {
                match lollipop::compare(dio.version, dodag.version) {
                    Some(Ordering::Equal) => self.permits(dodag, neighbour, rank).then_some(false),
                    Some(Ordering::Greater) => Some(true),
                    Some(Ordering::Less) | None => None,
                }?
            }
            _ => {
                let past = self.past.iter().find(|past| past.dodag.id == dio.dodag_id);
                if past.is_some_and(|past| !self.permits_again(past, neighbour, rank, now)) {
                    return None;
                }
                false
            }
        };
        Some(Offer {
            address: neighbour.address,
            preference: dio.preference,
            is_newer,
            rank,
            rssi_dbm: neighbour.rssi_dbm.unwrap_or(f64::NEG_INFINITY),
        })
    }

    /// Within a version: a parent is nearer to the root (RFC 6550, § 8.2.1), and rank stays within its bound (§ 8.2.2.4,
    /// rule 3). The present parent may have moved down: it is followed as far as that bound, or else left.
    fn permits(&self, dodag: &Dodag, neighbour: &Neighbour, rank: u16) -> bool {
        if dodag.rank_limit() < rank {
            return false;
        }
        if Some(neighbour.address) == dodag.parent {
            let hop = dodag.configuration.min_hop_rank_increase;
            return !self.config.stale_rank || neighbour.dio.rank.saturating_add(hop) <= dodag.rank;
        }
        dodag.dag_rank(neighbour.dio.rank) < dodag.dag_rank(dodag.rank)
    }

    /// A version that was left: its bound on rank still holds (RFC 6550, § 8.2.2.4, rule 4), and for a while no mote is
    /// joined that may have been below.
    fn permits_again(&self, past: &Past, neighbour: &Neighbour, rank: u16, now: SimTime) -> bool {
        match lollipop::compare(neighbour.dio.version, past.dodag.version) {
            Some(Ordering::Less) => false,
            Some(Ordering::Equal) => {
                let is_held = now < past.left.saturating_add(self.config.repair_hold);
                let is_above =
                    past.dodag.dag_rank(neighbour.dio.rank) < past.dodag.dag_rank(past.dodag.rank);
                rank <= past.dodag.rank_limit() && (is_above || !is_held)
            }
            Some(Ordering::Greater) | None => true,
        }
    }

    /// Takes an offer: another DODAG, a newer version, another parent, or the same one with what it says now.
    fn adopt(&mut self, offer: &Offer, now: SimTime, dice: &mut Dice) {
        let Some(dio) = self.neighbours.get(offer.address).map(|one| one.dio.clone()) else {
            return;
        };
        let old = self.parent();
        let moves = self.dodag.as_ref().is_none_or(|dodag| dodag.id != dio.dodag_id);
        if moves {
            self.remember(now);
            self.forget_below();
        }
        let before = self.dodag.take().filter(|_| !moves);
        let dtsn = before.as_ref().map_or(self.dtsn, |before| before.dtsn);
        let mut dodag = Dodag::of_dio(&dio, &self.config, dtsn);
        let is_new_version = before.as_ref().is_none_or(|before| before.version != dodag.version);
        let was_rank = before.as_ref().map_or(INFINITE_RANK, |before| before.rank);
        // Within a version the lowest rank counts even over a time outside (RFC 6550, § 8.2.2.4, rule 4).
        let same = |other: &&Dodag| other.id == dodag.id && other.version == dodag.version;
        let past = self.past.iter().map(|past| &past.dodag).find(same);
        if let Some(lowest) = before.as_ref().filter(same).or(past).map(|same| same.lowest_rank) {
            dodag.lowest_rank = lowest;
        }
        self.past.retain(|past| past.dodag.id != dodag.id);
        if let Some(before) = before {
            dodag.advertised_rank = before.advertised_rank;
            dodag.parent_dtsn = before.parent_dtsn;
        }
        dodag.parent = Some(offer.address);
        let is_new_parent = old != Some(offer.address) || moves;
        dodag.rank = if self.config.stale_rank && !is_new_parent && !self.etx_changed {
            was_rank
        } else {
            offer.rank
        };
        self.dtsn = dodag.dtsn;
        // Good news can wait unless it is large. Bad news cannot: in a circle it must come round fast, for rank to reach its
        // bound.
        let threshold = self.objective_of(dodag.configuration.objective).switch_threshold();
        let hop = dodag.configuration.min_hop_rank_increase.max(1);
        let jumps = dodag.advertised_rank.saturating_add(hop) <= dodag.rank
            || threshold < dodag.advertised_rank.saturating_sub(dodag.rank);
        let rank_changed = dodag.rank != was_rank;
        let is_leaf = dodag.is_leaf;
        if is_new_version || !self.trickle.is_running() {
            self.trickle = dodag.trickle();
        }
        let id = dodag.id;
        self.dodag = Some(dodag);
        if moves {
            self.dis_at = None;
            self.hold_until = None;
            self.events.push_back(Event::Joined { dodag: id });
        }
        if is_new_parent {
            self.events.push_back(Event::ParentChanged { old, new: Some(offer.address) });
            self.move_routes(old.filter(|_| !moves), offer.address, now, dice);
        } else {
            self.follow_dtsn(dio.dtsn, now, dice);
            if is_new_version {
                self.schedule_dao(now, dice);
            }
        }
        if let Some(dodag) = &mut self.dodag {
            dodag.parent_dtsn = dio.dtsn;
        }
        if rank_changed {
            self.events.push_back(Event::RankChanged);
        }
        if is_leaf {
            self.trickle.stop();
        } else if !self.trickle.is_running() {
            self.trickle.start_at_min(now, dice);
            self.events.push_back(Event::TrickleReset);
        } else if is_new_parent || jumps {
            self.reset_trickle(now, dice);
        }
    }

    /// Local repair (RFC 6550, § 8.2.2.5 and 8.2.2.6): nobody can be the parent. The motes below are notified, and others are asked.
    pub(super) fn detach(&mut self, now: SimTime, dice: &mut Dice) {
        let Some(dodag) = &self.dodag else { return };
        let (old, rank, id) = (dodag.parent, dodag.rank, dodag.id);
        let hop = dodag.configuration.min_hop_rank_increase.max(1);
        if !dodag.is_leaf {
            let poison = dodag.dio(self.config.instance, INFINITE_RANK);
            self.multicast_dio(poison);
        }
        // Whoever is no nearer to the root may be below: what it said is not believed until it says it again.
        for neighbour in self.neighbours.as_mut_slice() {
            if neighbour.dio.dodag_id == id && rank / hop <= neighbour.dio.rank / hop {
                neighbour.dio.rank = INFINITE_RANK;
            }
        }
        self.remember(now);
        self.forget_below();
        self.dodag = None;
        self.outdone_since = None;
        self.trickle.stop();
        self.hold_until = Some(now.saturating_add(self.config.repair_hold));
        self.events.push_back(Event::ParentChanged { old, new: None });
        self.events.push_back(Event::Detached);
        self.events.push_back(Event::LocalRepair);
        self.solicit_soon(now, dice);
    }

    /// Keeps the bounds of the DODAG that is being left.
    fn remember(&mut self, now: SimTime) {
        if let Some(dodag) = &self.dodag {
            self.past.retain(|past| past.dodag.id != dodag.id);
            self.past.push(Past { dodag: dodag.clone(), left: now });
        }
    }

    /// Forgets who is below and what was to be advertised.
    pub(super) fn forget_below(&mut self) {
        self.routes.clear();
        self.dao.stop();
        while let Some((child, _)) = self.children.pop_first() {
            self.events.push_back(Event::ChildRemoved(child));
        }
        self.children_check = None;
    }

    /// The objective function of the DODAG, or the own one outside.
    pub(super) fn objective(&self) -> Objective {
        let code = self.dodag.as_ref().map(|dodag| dodag.configuration.objective);
        code.map_or(self.config.objective, |code| self.objective_of(code))
    }

    /// The objective function of a code point: the own one with its settings, or another as its RFC recommends. Where it is
    /// not known, one is a leaf, and any will do (RFC 6550, § 8.5).
    fn objective_of(&self, code: u16) -> Objective {
        if code == self.config.objective.code() {
            return self.config.objective;
        }
        Objective::of_code(code).unwrap_or(self.config.objective)
    }

    /// Neighbours that could be parents now, the preferred one first, then by rank (RFC 6550, § 8.2.1): of lower rank than
    /// one's own, `parent_set_size` of them.
    ///
    /// A mote's rank must be at least the next whole hop after the highest rank that its parents advertise, and at least the
    /// highest rank through any of them less DAGMaxRankIncrease (RFC 6719, § 3.3, rules 2 and 3). Whoever would raise it
    /// above the rank through the preferred parent, which is rule 1, is no parent.
    #[must_use]
    pub(crate) fn parent_set(&self, now: SimTime) -> Vec<Eui64> {
        let Some(dodag) = &self.dodag else { return vec![] };
        let highest = match dodag.configuration.max_rank_increase {
            0 => INFINITE_RANK,
            increase => dodag.rank.saturating_add(increase),
        };
        let mut offers: Vec<Offer> = (self.neighbours.as_slice().iter())
            .filter(|one| one.dio.dodag_id == dodag.id && one.dio.version == dodag.version)
            .filter(|one| dodag.dag_rank(one.dio.rank) < dodag.dag_rank(dodag.rank))
            .filter_map(|one| self.offer(one, now))
            .filter(|offer| Some(offer.address) == dodag.parent || offer.rank <= highest)
            .collect();
        offers.sort_by(|a, b| {
            let is_other = |offer: &Offer| Some(offer.address) != dodag.parent;
            is_other(a).cmp(&is_other(b)).then(a.compare(b))
        });
        offers.truncate(self.config.parent_set_size.max(1).into());
        offers.into_iter().map(|offer| offer.address).collect()
    }
}
