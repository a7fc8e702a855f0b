//! Neighbours that were heard to take part in the instance.

use super::link::Etx;
use super::objective::INFINITE_RANK;
use crate::wire::Eui64;
use crate::wire::rpl::DioRepr;
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};

/// A neighbour: what its last DIO said, and what the link to it is like.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Neighbour {
    /// Link-layer address of the neighbour.
    pub address: Eui64,
    /// The DIO that it sent last.
    pub dio: DioRepr,
    /// Transmissions it takes to reach it.
    pub etx: Etx,
    /// Mean strength of received frames (dBm), if the radio reports it.
    pub rssi_dbm: Option<f64>,
    /// Strength of its latest beacon (dBm), and when that came, where parents are chosen by beacons.
    pub latest_dbm: Option<(f64, SimTime)>,
    /// How that changes (dB/s).
    pub trend_db_per_s: f64,
    /// When anything was last heard of it.
    pub heard: SimTime,
    /// It is not used before then, and then only after it was heard anew.
    pub unusable_until: Option<SimTime>,
    /// How often in a row it became unusable.
    pub n_unusable: u8,
}

/// Weight of a new strength in the mean.
const RSSI_WEIGHT: f64 = 0.125;
/// An unusable neighbour's hold is doubled at most so often.
const MAX_HOLD_DOUBLINGS: u8 = 4;

impl Neighbour {
    /// Heard at strength `rssi_dbm`.
    pub(super) fn hear(&mut self, rssi_dbm: Option<f64>, now: SimTime) {
        self.heard = now;
        if let Some(rssi_dbm) = rssi_dbm {
            let mean = self.rssi_dbm.unwrap_or(rssi_dbm);
            self.rssi_dbm = Some(mean + RSSI_WEIGHT * (rssi_dbm - mean));
        }
    }

    /// Not to be used for `hold`, doubled each further time.
    pub(super) fn mark_unusable(&mut self, hold: SimDuration, now: SimTime) {
        let factor = 1 << self.n_unusable.min(MAX_HOLD_DOUBLINGS);
        self.n_unusable = self.n_unusable.saturating_add(1);
        self.unusable_until = Some(now.saturating_add(hold.saturating_mul(factor)));
    }

    /// Gives an unusable neighbour another chance when its time is over: the link is assumed to be as on first sight.
    /// Returns whether it does.
    pub(super) fn forgive(&mut self, initial_etx_x128: u16, now: SimTime) -> bool {
        let forgives = self.unusable_until.is_some_and(|until| until <= now);
        if forgives {
            self.unusable_until = None;
            self.etx = Etx::assumed(initial_etx_x128);
        }
        forgives
    }

    /// Whether it may be used at all: heard with a finite rank, over a link that works.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        self.unusable_until.is_none() && self.dio.rank != INFINITE_RANK
    }
}

/// All neighbours, by address.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Neighbours {
    /// Address of each, ascending, in a column of its own: a search reads nothing else.
    addresses: Vec<Eui64>,
    list: Vec<Neighbour>,
    /// No neighbour's lifetime ends before.
    check: Option<SimTime>,
}

impl Neighbours {
    pub(super) fn as_slice(&self) -> &[Neighbour] {
        &self.list
    }

    pub(super) fn as_mut_slice(&mut self) -> &mut [Neighbour] {
        &mut self.list
    }

    pub(super) fn get(&self, address: Eui64) -> Option<&Neighbour> {
        let place = self.addresses.binary_search(&address).ok()?;
        Some(&self.list[place])
    }

    pub(super) fn get_mut(&mut self, address: Eui64) -> Option<&mut Neighbour> {
        let place = self.addresses.binary_search(&address).ok()?;
        Some(&mut self.list[place])
    }

    /// Adds one that is not there yet. Of more than `max`, the one of highest rank gives way, the unusable ones first and
    /// never `parent`; that may be the new one.
    pub(super) fn add(
        &mut self,
        new: Neighbour,
        max: u16,
        parent: Option<Eui64>,
        lifetime: SimDuration,
    ) {
        if self.check.is_none() {
            self.check = Some(new.heard.saturating_add(lifetime));
        }
        let place = self.addresses.partition_point(|other| *other < new.address);
        self.addresses.insert(place, new.address);
        self.list.insert(place, new);
        if usize::from(max.max(1)) < self.list.len() {
            let worst = self
                .list
                .iter()
                .enumerate()
                .filter(|(_, neighbour)| Some(neighbour.address) != parent)
                .max_by_key(|(_, neighbour)| {
                    (!neighbour.is_usable(), neighbour.dio.rank, neighbour.address)
                })
                .map(|(place, _)| place);
            if let Some(worst) = worst {
                self.addresses.remove(worst);
                self.list.remove(worst);
            }
        }
    }

    pub(super) fn clear(&mut self) {
        self.addresses.clear();
        self.list.clear();
        self.check = None;
    }

    /// When to look for lifetimes that have ended.
    pub(super) fn poll_timeout(&self) -> Option<SimTime> {
        self.check
    }

    /// Forgets those of whom nothing was heard for `lifetime`. Returns whether there were any.
    pub(super) fn expire(&mut self, lifetime: SimDuration, now: SimTime) -> bool {
        if self.check.is_none_or(|check| now < check) {
            return false;
        }
        let n = self.list.len();
        self.list.retain(|one| now < one.heard.saturating_add(lifetime));
        self.addresses.clear();
        self.addresses.extend(self.list.iter().map(|one| one.address));
        // A quarter of a lifetime between looks: a neighbour is forgotten after 1 to 1.25 lifetimes.
        let oldest = self.list.iter().map(|one| one.heard).min();
        self.check = oldest.map(|heard| {
            heard
                .saturating_add(lifetime)
                .max(now.saturating_add(lifetime / 4 + SimDuration::from_ns(1)))
        });
        self.list.len() < n
    }
}
