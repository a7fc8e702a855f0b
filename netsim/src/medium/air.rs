//! The radios and frames of a moment, and the judgement of one link.

use super::filter::{Fate, Filters};
use crate::phy::link::{End, Scene};
use crate::phy::model::{LinkBudget, Model};
use crate::phy::scatter::{Moment, PairBlock};

/// A frame on the air.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    /// When it begins (ns).
    pub sent_ns: u64,
    /// On which channel, if that is known.
    pub channel: Option<u8>,
}

/// The radios that are on: first those that send, in the order of their frames, then the others. A radio's place in this
/// order is what everything here counts by, so that frame f is sent by radio f.
#[derive(Clone, Debug, Default)]
pub struct Radios {
    /// Where they are, and who.
    pub ends: Vec<End>,
    /// The way each has travelled so far (m).
    pub way_m: Vec<f64>,
    /// The frames of the first of them.
    pub frames: Vec<Frame>,
}

/// All that decides who hears what at a moment.
#[derive(Clone, Copy, Debug)]
pub struct Air<'a> {
    /// The radio physics.
    pub model: &'a Model,
    /// Its shortcuts.
    pub filters: &'a Filters,
    /// Seed of the experiment.
    pub seed: u64,
    /// Begin of the control period (ns).
    pub period_ns: u64,
    /// Radios and frames.
    pub radios: &'a Radios,
    /// What stands around; its agents are the radios' ends.
    pub scene: &'a Scene<'a>,
}

/// What a pair of radios shares: random words, and the scatter that is the same in both directions.
#[derive(Clone, Copy, Debug)]
pub struct PairState {
    block: PairBlock,
    symmetric_db: Option<f64>,
}

impl Air<'_> {
    /// How many frames there are.
    #[must_use]
    pub fn n_frames(&self) -> usize {
        self.radios.frames.len()
    }

    /// What a pair shares, nothing of it computed yet.
    #[inline]
    #[must_use]
    pub fn pair(&self, a: usize, b: usize) -> PairState {
        let ends = &self.radios.ends;
        let block = PairBlock::new(self.seed, ends[a].id, ends[b].id, self.period_ns);
        PairState { block, symmetric_db: None }
    }

    /// Whether a radio hears a frame: a keyed draw against the model's probability.
    #[inline]
    #[must_use]
    pub fn hears(&self, receiver: usize, frame: usize, pair: &mut PairState) -> bool {
        let ends = &self.radios.ends;
        let distance_squared_m2 = ends[frame].distance_squared_m2(&ends[receiver]);
        self.hears_over(receiver, frame, distance_squared_m2, pair)
    }

    /// As [`Air::hears`], where the square of the distance (m²) is known.
    #[inline]
    #[must_use]
    pub fn hears_over(
        &self,
        receiver: usize,
        frame: usize,
        distance_squared_m2: f64,
        pair: &mut PairState,
    ) -> bool {
        let Some(filter) = self.filters.on(self.radios.frames[frame].channel) else {
            return self.hears_plainly(receiver, frame, pair);
        };
        let mut fate = filter.fate(distance_squared_m2);
        if let Fate::MeanWithin(low, high) = fate {
            fate = filter.fate_at(low, high, self.scatter_db(receiver, frame, pair));
        }
        match fate {
            Fate::Never => false,
            Fate::Always => true,
            Fate::Within(low, high) => {
                let draw = self.draw(receiver, frame, pair);
                draw < low || draw < high && self.hears_plainly(receiver, frame, pair)
            }
            Fate::MeanWithin(..) => self.hears_plainly(receiver, frame, pair),
        }
    }

    /// As [`Air::hears`], without any shortcut: what the others must agree with.
    #[must_use]
    pub fn hears_plainly(&self, receiver: usize, frame: usize, pair: &mut PairState) -> bool {
        let probability = self.budget(receiver, frame, pair).reception_probability;
        // Draws lie in [0, 1): 0 never succeeds, 1 always does, and neither needs one.
        0.0 < probability && (1.0 <= probability || self.draw(receiver, frame, pair) < probability)
    }

    /// What the physics makes of a frame at a radio.
    #[must_use]
    pub fn budget(&self, receiver: usize, frame: usize, pair: &mut PairState) -> LinkBudget {
        let Radios { ends, frames, .. } = self.radios;
        let Frame { sent_ns, channel } = frames[frame];
        let link = self.model.link(self.scene, ends[frame], ends[receiver], channel, sent_ns);
        let scatter_db = self.scatter_db(receiver, frame, pair);
        self.model.evaluate_at(&link, scatter_db)
    }

    #[inline]
    fn draw(&self, receiver: usize, frame: usize, pair: &mut PairState) -> f64 {
        let ends = &self.radios.ends;
        pair.block.reception(ends[frame].id, ends[receiver].id)
    }

    /// Sum of all scatter (dB): first what both directions share, then what belongs to this one.
    #[inline]
    fn scatter_db(&self, receiver: usize, frame: usize, pair: &mut PairState) -> f64 {
        let scatters = self.model.scatters();
        if scatters.is_empty() {
            return 0.0;
        }
        let Radios { ends, way_m, frames } = self.radios;
        let (sender_id, receiver_id) = (ends[frame].id, ends[receiver].id);
        let at = Moment {
            period_ns: self.period_ns,
            sent_ns: frames[frame].sent_ns,
            way_m: way_m[frame] + way_m[receiver],
        };
        let mut sum = |symmetric: bool| {
            let mut sum_db = 0.0;
            for scatter in scatters.iter().filter(|scatter| scatter.is_symmetric() == symmetric) {
                sum_db += scatter.value_db(&mut pair.block, sender_id, receiver_id, at);
            }
            sum_db
        };
        let shared_db = match pair.symmetric_db {
            Some(shared_db) => shared_db,
            None => sum(true),
        };
        let own_db = sum(false);
        pair.symmetric_db = Some(shared_db);
        shared_db + own_db
    }
}
