//! What arrives where, between motes that stand still for a control period at a time.
//!
//! The physics is that of the physics of this crate, asked link by link as frames are sent: base model, effects, scatter, curve. The
//! power of a link is `Model::evaluate_at` of it, whatever has been asked before. Kept from one frame to the next is only
//! what spares work: who is within reach of a sender ([`Links::neighbours`](Paths::neighbours), found on its first frame),
//! scatter that lasts (shadowing, frozen levels), while neither end moves, and without scatter the latest budgets of models
//! for which distance and channel decide. A result never depends on it, so it is not
//! part of a snapshot.
//!
//! # Horizon
//!
//! A frame whose power, shifts of the curve taken off, is less than the horizon neither arrives nor disturbs: by default
//! the power below which the reception curve is 0. Where a connectivity model states the probability, 0 means the same:
//! nothing arrives, and nobody is disturbed.
//!
//! # Draws
//!
//! Scatter is keyed as in propagation-only runs, but that levels which change with every frame are keyed by the frame's
//! begin and not by the period: here a mote sends more than one frame to a period.

mod budgets;
mod rows;

#[cfg(test)]
mod tests;

use super::jam::Jams;
use super::slot::{Arrival, Paths, Sent};
use crate::link::{Covariates, End, Scene};
use crate::model::Model;
use crate::nearest::{Grid, Nearest};
use crate::propagation::Reach;
use crate::scatter::{Moment, PairBlock, Renewal, Scatter, Seeds};
use budgets::Budgets;
use proto::ids::MoteId;
use proto::site::Site;
use proto::types::Covariate;
use rows::SenderRows;
use std::sync::Arc;

/// What arrives where.
#[derive(Debug)]
pub struct Links {
    model: Arc<Model>,
    seeds: Seeds,
    reach: Reach,
    floor_dbm: f64,
    /// Scatter that lasts while nobody moves, and scatter that does not.
    lasting: Vec<Scatter>,
    passing: Vec<Scatter>,
    place: Place,
    rows: SenderRows,
    /// `None`: more than distance and channel decides.
    budgets: Option<Budgets>,
    nearest: Option<Nearest>,
    grid: Option<Grid>,
    is_prepared: bool,
    /// Frames arrive wherever they meet nothing else, and nobody asks how strong.
    is_certain: bool,
}

/// Who is where, in which surroundings.
#[derive(Debug, Default)]
struct Place {
    period_ns: u64,
    /// Radios that are on, by number.
    ends: Vec<End>,
    way_m: Vec<f64>,
    /// Place in `ends` by mote.
    place_of: Vec<u32>,
    site: Site,
    covariates: Vec<Covariate>,
    jams: Jams,
}

const NOWHERE: u32 = u32::MAX;

impl Place {
    #[inline]
    fn index_of(&self, mote: MoteId) -> Option<usize> {
        let place = *self.place_of.get(mote.index())?;
        (place != NOWHERE).then_some(place as usize)
    }
}

impl Links {
    /// Draws of periods and frames come from another seed from here on.
    pub fn reseed(&mut self, seed: u64) {
        self.seeds.passing = seed;
    }

    /// Links of nobody yet.
    ///
    /// * `channels`: those in use, 11 to 26.
    /// * `horizon_dbm`: frames that arrive with less do not disturb; `None`: those too weak to be received do not.
    #[must_use]
    pub fn new(
        model: Arc<Model>,
        seeds: impl Into<Seeds>,
        channels: &[u8],
        horizon_dbm: Option<f64>,
    ) -> Self {
        let floor_dbm = model.floor_dbm();
        let floor_dbm = horizon_dbm.map_or(floor_dbm, |dbm| dbm.min(floor_dbm));
        let farthest = |channel: u8| model.reach_of(floor_dbm, Some(channel));
        let reach = channels.iter().map(|&channel| farthest(channel)).reduce(|a, b| match (a, b) {
            (Reach::Within(a), Reach::Within(b)) => Reach::Within(a.max(b)),
            (Reach::Within(_), other) | (other, _) => other,
        });
        let (lasting, passing) = model.unlimited_scatters().iter().partition(|scatter| {
            matches!(scatter.renewal, Renewal::Frozen | Renewal::Coherence { .. })
        });
        let is_plain = model.is_isotropic() && model.scatters().is_empty();
        Self {
            budgets: is_plain.then(Budgets::default),
            reach: reach.unwrap_or_else(|| model.reach_of(floor_dbm, None)),
            model,
            seeds: seeds.into(),
            floor_dbm,
            lasting,
            passing,
            place: Place::default(),
            rows: SenderRows::default(),
            nearest: None,
            grid: None,
            is_prepared: false,
            is_certain: false,
        }
    }

    /// The same, for a caller that never reads how strong the frames were which it receives.
    #[must_use]
    pub fn without_levels(mut self) -> Self {
        self.is_certain = self.model.is_certain() && self.reach == Reach::Unlimited;
        self
    }

    /// Where the radios that are on stand in the control period that begins at `period_ns`.
    ///
    /// * `ends`: by ascending number.
    /// * `way_m`: the way each of them has travelled so far (m).
    ///
    /// # Panics
    ///
    /// If there are not as many ways as ends.
    pub fn set_positions(&mut self, period_ns: u64, ends: &[End], way_m: &[f64]) {
        assert_eq!(ends.len(), way_m.len(), "every radio has a way");
        debug_assert!(ends.is_sorted_by_key(|end| end.id), "by number");
        self.place.period_ns = period_ns;
        if self.place.ends == ends && self.place.way_m == way_m {
            return;
        }
        self.rows.note_moves((&self.place.ends, &self.place.way_m), (ends, way_m));
        for end in &self.place.ends {
            self.place.place_of[end.id.index()] = NOWHERE;
        }
        let n_motes = ends.last().map_or(0, |end| end.id.index() + 1);
        if self.place.place_of.len() < n_motes {
            self.place.place_of.resize(n_motes, NOWHERE);
        }
        for (place, end) in (0..).zip(ends) {
            self.place.place_of[end.id.index()] = place;
        }
        self.place.ends.clear();
        self.place.ends.extend_from_slice(ends);
        self.place.way_m.clear();
        self.place.way_m.extend_from_slice(way_m);
        self.is_prepared = false;
    }

    /// The control period that begins at `period_ns` is under way: nobody has moved since.
    pub fn set_period(&mut self, period_ns: u64) {
        self.place.period_ns = period_ns;
    }

    /// Walls and obstacles, where they are now.
    pub fn set_site(&mut self, site: &Site) {
        if self.place.site != *site {
            self.place.site.clone_from(site);
            self.is_prepared = false;
        }
    }

    /// Numbers beside the geometry.
    pub fn set_covariates(&mut self, covariates: &[Covariate]) {
        self.place.covariates.clear();
        self.place.covariates.extend_from_slice(covariates);
    }

    /// Where noise keeps everything from being received.
    pub fn set_jams(&mut self, jams: &Jams) {
        self.place.jams.clone_from(jams);
    }

    /// What of a frame arrives at one receiver.
    #[must_use]
    pub fn arrival(&mut self, sent: Sent, receiver: MoteId) -> Arrival {
        let mut arrival = Arrival::NOTHING;
        self.each_arrival(sent, &[receiver], |found| arrival = found);
        arrival
    }

    fn each_arrival(&mut self, sent: Sent, receivers: &[MoteId], mut found: impl FnMut(Arrival)) {
        let Some(from) = self.place.index_of(sent.sender) else {
            receivers.iter().for_each(|_| found(Arrival::NOTHING));
            return;
        };
        let Self { place, rows, budgets, .. } = self;
        let mut scene = Scene {
            site: Some(&place.site),
            agents: &place.ends,
            nearest: self.nearest.take(),
            grid: self.grid.take(),
            covariates: Covariates::Agents(&place.covariates),
            run: None,
        };
        if !self.is_prepared {
            self.model.prepare(&mut scene);
            self.is_prepared = true;
        }
        if !self.lasting.is_empty() {
            rows.refresh(&place.ends, from, self.reach, true);
        }
        let on_air = OnAir {
            model: &self.model,
            seeds: self.seeds,
            place,
            scene: &scene,
            lasting: &self.lasting,
            passing: &self.passing,
            floor_dbm: self.floor_dbm,
            within_m2: match self.reach {
                Reach::Within(reach_m) => reach_m * reach_m,
                Reach::Unlimited | Reach::Listed => f64::INFINITY,
            },
            from,
            sent,
        };
        for &receiver in receivers {
            found(on_air.arrival_at(receiver, rows, budgets.as_mut()));
        }
        Scene { nearest: self.nearest, grid: self.grid, .. } = scene;
    }
}

impl Paths for Links {
    fn neighbours(&mut self, sender: MoteId) -> Option<&[MoteId]> {
        let Some(from) = self.place.index_of(sender) else { return Some(&[]) };
        self.rows.refresh(&self.place.ends, from, self.reach, !self.lasting.is_empty());
        self.rows.neighbours(sender)
    }

    fn is_certain(&self) -> bool {
        self.is_certain && self.place.jams.is_empty()
    }

    #[inline]
    fn is_on(&self, mote: MoteId) -> bool {
        self.place.index_of(mote).is_some()
    }

    fn arrivals(&mut self, sent: Sent, receivers: &[MoteId], arrivals: &mut Vec<Arrival>) {
        self.each_arrival(sent, receivers, |arrival| arrivals.push(arrival));
    }
}

/// A frame on the air and all that decides what of it arrives.
struct OnAir<'a> {
    model: &'a Model,
    seeds: Seeds,
    place: &'a Place,
    scene: &'a Scene<'a>,
    lasting: &'a [Scatter],
    passing: &'a [Scatter],
    floor_dbm: f64,
    within_m2: f64,
    /// The sender's place among the ends.
    from: usize,
    sent: Sent,
}

impl OnAir<'_> {
    #[inline]
    fn arrival_at(
        &self,
        receiver: MoteId,
        rows: &mut SenderRows,
        budgets: Option<&mut Budgets>,
    ) -> Arrival {
        let Self { model, place, sent, from, .. } = *self;
        let Some(to) = place.index_of(receiver).filter(|&to| to != from) else {
            return Arrival::NOTHING;
        };
        let (sender, receiver) = (&place.ends[from], &place.ends[to]);
        let distance_squared_m2 = sender.distance_squared_m2(receiver);
        if self.within_m2 < distance_squared_m2 {
            return Arrival::NOTHING;
        }
        let Sent { channel, sent_ns, end_ns, .. } = sent;
        if !place.jams.is_empty()
            && place.jams.silence(receiver.position_m, channel, sent_ns, end_ns)
        {
            return Arrival::NOTHING;
        }
        let mut scatter_db = 0.0;
        if !self.lasting.is_empty() {
            scatter_db += rows.lasting_db(sender.id, receiver.id, || self.lasting_db(to));
        }
        for scatter in self.passing {
            scatter_db += self.passing_db(scatter, to);
        }
        let compute = || {
            let link = model.link(self.scene, *sender, *receiver, Some(channel), sent_ns);
            if model.has_limited_scatter() {
                let limited = model.limited_scatters(&link);
                let limited_db: f64 = limited.map(|scatter| self.passing_db(scatter, to)).sum();
                return model.evaluate_at(&link, scatter_db + limited_db);
            }
            model.evaluate_at(&link, scatter_db)
        };
        let budget = match budgets {
            Some(budgets) => budgets.get(distance_squared_m2, channel, compute),
            None => compute(),
        };
        let arrives = if budget.is_stated {
            0.0 < budget.reception_probability
        } else {
            self.floor_dbm <= budget.rssi_dbm - budget.shift_db
        };
        if !arrives {
            return Arrival::NOTHING;
        }
        Arrival {
            rssi_dbm: budget.rssi_dbm,
            register_rssi_dbm: budget.register_rssi_dbm,
            shift_db: budget.shift_db,
            reception_probability: budget.reception_probability,
        }
    }

    fn moment(&self, to: usize) -> Moment {
        let way_m = &self.place.way_m;
        Moment {
            period_ns: self.place.period_ns,
            sent_ns: self.sent.sent_ns,
            way_m: way_m[self.from] + way_m[to],
            channel: Some(self.sent.channel),
        }
    }

    /// Sum of the scatter (dB) that lasts while nobody moves.
    fn lasting_db(&self, to: usize) -> f64 {
        let (sender, receiver) = (self.place.ends[self.from].id, self.place.ends[to].id);
        let mut block = PairBlock::new(self.seeds, sender, receiver, self.place.period_ns);
        let at = self.moment(to);
        let value_db = |scatter: &Scatter| scatter.value_db(&mut block, sender, receiver, at);
        self.lasting.iter().map(value_db).sum()
    }

    /// Scatter (dB) of this period or frame.
    fn passing_db(&self, scatter: &Scatter, to: usize) -> f64 {
        let (sender, receiver) = (self.place.ends[self.from].id, self.place.ends[to].id);
        let time_ns = match scatter.renewal {
            Renewal::Frame => self.sent.sent_ns,
            Renewal::Period
            | Renewal::Frozen
            | Renewal::Coherence { .. }
            | Renewal::Place { .. }
            | Renewal::Time { .. } => self.place.period_ns,
        };
        let mut block = PairBlock::new(self.seeds, sender, receiver, time_ns);
        scatter.value_db(&mut block, sender, receiver, self.moment(to))
    }
}
