//! The radios and frames of a moment, and the judgement of one link.

use super::filter::Filters;
use crate::link::{End, Scene, distance_squared_m2};
use crate::model::{LinkBudget, Model};
use crate::scatter::{Moment, PairBlock, Seeds};
use proto::ids::MoteId;

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
    /// Numbers of the motes, as in `ends`.
    pub id: Vec<u32>,
    /// Positions by axis (m), as in `ends`.
    pub position_m: [Vec<f64>; 3],
}

impl Radios {
    /// Adds a radio that has travelled `way_m`.
    pub fn push(&mut self, end: End, way_m: f64) {
        self.ends.push(end);
        self.way_m.push(way_m);
        self.id.push(end.id.0);
        for (column, coordinate) in self.position_m.iter_mut().zip(end.position_m) {
            column.push(coordinate);
        }
    }

    /// Square of the distance between two radios (m²).
    #[inline]
    #[must_use]
    pub fn distance_squared_m2(&self, a: usize, b: usize) -> f64 {
        let [x, y, z] = &self.position_m;
        distance_squared_m2([x[a] - x[b], y[a] - y[b], z[a] - z[b]])
    }
}

/// All that decides who hears what at a moment.
#[derive(Clone, Copy, Debug)]
pub struct Air<'a> {
    /// The radio model that predicts power and reception.
    pub model: &'a Model,
    /// Filters of the model, which decide many links without computing their power.
    pub filters: &'a Filters,
    /// Seeds of the experiment.
    pub seeds: Seeds,
    /// Begin of the control period (ns).
    pub period_ns: u64,
    /// The motes' radios, and the frames on the air.
    pub radios: &'a Radios,
    /// What stands around; its agents are the radios' ends.
    pub scene: &'a Scene<'a>,
}

/// What a pair of radios shares: random words, and the scatter that is the same in both directions.
#[derive(Clone, Copy, Debug, Default)]
pub struct PairState {
    block: PairBlock,
    shared_db: Option<f64>,
}

impl PairState {
    /// Uniform in [0, 1): a frame is received if this is less than its probability.
    #[inline]
    pub fn draw(&mut self, sender_id: u32, receiver_id: u32) -> f64 {
        self.block.reception(MoteId(sender_id), MoteId(receiver_id))
    }
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
        let id = &self.radios.id;
        let block = PairBlock::new(self.seeds, MoteId(id[a]), MoteId(id[b]), self.period_ns);
        PairState { block, shared_db: None }
    }

    /// As [`Air::pair`], where its words have been drawn already.
    #[inline]
    #[must_use]
    pub fn drawn_pair(&self, a: usize, b: usize, words: [u64; 4]) -> PairState {
        let id = &self.radios.id;
        let block =
            PairBlock::drawn(self.seeds, MoteId(id[a]), MoteId(id[b]), self.period_ns, words);
        PairState { block, shared_db: None }
    }

    /// Whether a radio hears a frame: a keyed draw against the model's probability.
    #[must_use]
    pub fn hears(&self, receiver: usize, frame: usize, pair: &mut PairState) -> bool {
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

    /// The scatter (dB) of a frame that acts on some links only.
    fn limited_db(&self, receiver: usize, frame: usize, pair: &mut PairState) -> f64 {
        let Radios { ends, frames, id, .. } = self.radios;
        let Frame { sent_ns, channel } = frames[frame];
        let link = self.model.link(self.scene, ends[frame], ends[receiver], channel, sent_ns);
        let at = self.moment(receiver, frame, frames[frame]);
        let block = &mut pair.block;
        let scatters = self.model.limited_scatters(&link);
        scatters
            .map(|scatter| scatter.value_db(block, MoteId(id[frame]), MoteId(id[receiver]), at))
            .sum()
    }

    /// The scatter (dB) that both directions share.
    #[inline]
    #[must_use]
    pub fn shared_db(&self, a: usize, b: usize, pair: &mut PairState) -> f64 {
        if let Some(shared_db) = pair.shared_db {
            return shared_db;
        }
        // A shared value depends on no frame.
        let at = self.moment(a, b, Frame { sent_ns: self.period_ns, channel: None });
        let (a, b) = (self.radios.id[a], self.radios.id[b]);
        let mut shared_db = 0.0;
        for scatter in self.model.symmetric_scatters() {
            shared_db += scatter.value_db(&mut pair.block, MoteId(a), MoteId(b), at);
        }
        pair.shared_db = Some(shared_db);
        shared_db
    }

    #[inline]
    fn draw(&self, receiver: usize, frame: usize, pair: &mut PairState) -> f64 {
        pair.draw(self.radios.id[frame], self.radios.id[receiver])
    }

    /// Sum of all scatter (dB) of a frame: what both directions share, and what belongs to this one.
    #[inline]
    #[must_use]
    pub fn scatter_db(&self, receiver: usize, frame: usize, pair: &mut PairState) -> f64 {
        let mut shared_db = self.shared_db(receiver, frame, pair);
        if self.model.has_limited_scatter() {
            shared_db += self.limited_db(receiver, frame, pair);
        }
        let directed = self.model.directed_scatters();
        if directed.is_empty() {
            return shared_db;
        }
        let at = self.moment(receiver, frame, self.radios.frames[frame]);
        let (sender, receiver) = (self.radios.id[frame], self.radios.id[receiver]);
        let mut own_db = 0.0;
        for scatter in directed {
            own_db += scatter.value_db(&mut pair.block, MoteId(sender), MoteId(receiver), at);
        }
        shared_db + own_db
    }

    #[inline]
    fn moment(&self, a: usize, b: usize, Frame { sent_ns, channel }: Frame) -> Moment {
        let way_m = &self.radios.way_m;
        Moment { period_ns: self.period_ns, sent_ns, way_m: way_m[a] + way_m[b], channel }
    }
}
