//! Many links at once, both directions of each: by bounds where these decide, by the whole computation where not.
//!
//! In passes over at most 64 links, and without branches that a random outcome would mislead.

use super::air::{Air, Radios};
use super::filter::{Filter, Limits, Rule, STEPS_PER_DB, draw_of};
use crate::scatter::{LEVEL_WORD, draw_blocks};
use proto::rng::unordered_link;

/// Links that are judged at once.
pub const MOST: usize = 64;

/// Room for what is known of [`MOST`] links.
#[derive(Debug)]
pub struct Scratch {
    ids: [u32; MOST],
    pairs: [u64; MOST],
    words: [[u64; 4]; MOST],
    added: [f64; MOST],
    limits: [Limits; MOST],
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            ids: [0; MOST],
            pairs: [0; MOST],
            words: [[0; 4]; MOST],
            added: [0.0; MOST],
            limits: [[0; 2]; MOST],
        }
    }
}

/// Judges the links of a moment.
#[derive(Debug)]
pub struct Judge<'a> {
    air: &'a Air<'a>,
    bounds: Bounds<'a>,
    variation: Variation,
    /// The most that scatter adds, in steps of the curve.
    most_steps: f64,
    /// The most that it takes away, in steps, with its sign.
    least_steps: f64,
    /// Links nearer than this (square, m²) succeed in both directions.
    pub certain_below_m2: f64,
    /// Links this far (square, m²) and farther fail in both directions.
    pub impossible_from_m2: f64,
}

/// Whose bounds hold for a frame.
#[derive(Debug)]
enum Bounds<'a> {
    /// There are none.
    None,
    /// Those of the one channel, or of none.
    One(&'a Filter),
    /// Those of the frame's channel.
    ByChannel,
}

/// What makes levels vary.
#[derive(Clone, Copy, Debug)]
enum Variation {
    /// Nothing.
    None,
    /// A word of the pair's block, the same for both directions: steps of the curve to a unit of the word's draw.
    Shared(f64),
    /// A word for each direction.
    Directed(f64),
    /// Whatever [`Air::scatter_db`] says, in both directions alike.
    OtherShared,
    /// Whatever it says.
    OtherDirected,
}

impl<'a> Judge<'a> {
    /// A judge of these links.
    #[must_use]
    pub fn new(air: &'a Air<'a>) -> Self {
        let model = air.model;
        let steps = |span_db: f64| span_db * STEPS_PER_DB / (1u64 << 53) as f64;
        let variation = match (model.symmetric_scatters(), model.directed_scatters()) {
            ([], []) => Variation::None,
            ([only], []) if only.block_span_db().is_some() => {
                Variation::Shared(steps(only.block_span_db().unwrap_or_default()))
            }
            ([], [only]) if only.block_span_db().is_some() => {
                Variation::Directed(steps(only.block_span_db().unwrap_or_default()))
            }
            (_, []) => Variation::OtherShared,
            (_, _) => Variation::OtherDirected,
        };
        let mut judge = Self {
            air,
            bounds: Bounds::None,
            variation,
            // A little more, so that rounding cannot make it less.
            most_steps: model.max_scatter_db() * STEPS_PER_DB + 1.0,
            least_steps: -(model.max_scatter_loss_db() * STEPS_PER_DB + 1.0),
            certain_below_m2: 0.0,
            impossible_from_m2: f64::INFINITY,
        };
        let frames = &air.radios.frames;
        let first = frames.first().and_then(|frame| frame.channel);
        if frames.iter().all(|frame| frame.channel == first) {
            if let Some(filter) = air.filters.on(first) {
                judge.certain_below_m2 = filter.certain_below_m2;
                judge.impossible_from_m2 = filter.impossible_from_m2;
                judge.bounds = Bounds::One(filter);
                if matches!(filter.rule, Rule::Draw(_)) {
                    // The level decides nothing.
                    judge.variation = Variation::None;
                }
            }
            return judge;
        }
        let mut channels: Vec<Option<u8>> = frames.iter().map(|frame| frame.channel).collect();
        channels.sort_unstable();
        channels.dedup();
        let filters: Option<Vec<&Filter>> =
            channels.iter().map(|&channel| air.filters.on(channel)).collect();
        if let Some(filters) = filters {
            let limit = |of: fn(&Filter) -> f64, start: f64, pick: fn(f64, f64) -> f64| {
                filters.iter().map(|filter| of(filter)).fold(start, pick)
            };
            judge.certain_below_m2 = limit(|filter| filter.certain_below_m2, f64::MAX, f64::min);
            judge.impossible_from_m2 = limit(|filter| filter.impossible_from_m2, 0.0, f64::max);
            judge.bounds = Bounds::ByChannel;
        }
        judge
    }

    /// Radio `p` against at most [`MOST`] others, of which those have the squared distances `d2_m2` (m²): bits of those
    /// whose frame it hears, and of those that hear its frame.
    #[must_use]
    pub fn both(
        &self,
        p: usize,
        others: &[u32],
        d2_m2: &[f64],
        scratch: &mut Scratch,
    ) -> (u64, u64) {
        let n = others.len().min(d2_m2.len()).min(MOST);
        let (others, d2_m2) = (&others[..n], &d2_m2[..n]);
        let (sending, listening) = self.on_air(p, others);
        if matches!(self.bounds, Bounds::None) {
            return self.plainly(p, others, (sending, listening));
        }
        let Scratch { ids, pairs, words, added, limits } = scratch;
        let (ids, words, added) = (&mut ids[..n], &mut words[..n], &mut added[..n]);
        let limits = &mut limits[..n];
        let id = &self.air.radios.id;
        for ((other_id, pair), &q) in ids.iter_mut().zip(&mut *pairs).zip(others) {
            *other_id = id[q as usize];
            *pair = unordered_link(id[p], *other_id);
        }
        draw_blocks(self.air.seeds, &pairs[..n], self.air.period_ns, words);

        let is_directed =
            matches!(self.variation, Variation::Directed(_) | Variation::OtherDirected);
        let mut open = u64::MAX;
        if self.is_costly() {
            // What fails even with the most that scatter may add needs no scatter, nor what succeeds with the least.
            let mut decided_at = |added_steps: f64| {
                added.fill(added_steps);
                self.limit(p, others, d2_m2, true, added, limits);
                let to_p = decide(limits, words, |k| usize::from(id[p] < ids[k]));
                let to_others = decide(limits, words, |k| usize::from(ids[k] < id[p]));
                (to_p, to_others)
            };
            let ((to_p, _), (to_others, _)) = decided_at(self.least_steps);
            let succeed = (to_p | !sending) & (to_others | !listening);
            let ((_, to_p), (_, to_others)) = decided_at(self.most_steps);
            let fail = !(to_p & sending | to_others & listening);
            open = !(succeed | fail);
            for k in ones(succeed & !fail & up_to(n)) {
                added[k] = self.least_steps;
            }
        }
        self.add(p, others, words, true, open, added);
        self.limit(p, others, d2_m2, true, added, limits);
        let to_p = decide(limits, words, |k| usize::from(id[p] < ids[k]));
        if is_directed && listening != 0 {
            self.add(p, others, words, false, open, added);
        }
        if (is_directed || matches!(self.bounds, Bounds::ByChannel)) && listening != 0 {
            self.limit(p, others, d2_m2, false, added, limits);
        }
        let to_others = decide(limits, words, |k| usize::from(ids[k] < id[p]));

        let (mut hears, mut is_heard) = (to_p.0 & sending, to_others.0 & listening);
        for k in ones(to_p.1 & !to_p.0 & sending) {
            let q = others[k] as usize;
            hears |= u64::from(self.air.hears(p, q, &mut self.air.drawn_pair(p, q, words[k]))) << k;
        }
        for k in ones(to_others.1 & !to_others.0 & listening) {
            let q = others[k] as usize;
            is_heard |=
                u64::from(self.air.hears(q, p, &mut self.air.drawn_pair(p, q, words[k]))) << k;
        }
        (hears, is_heard)
    }

    /// Bits of the others that send a frame; of all others, if `p` sends one.
    fn on_air(&self, p: usize, others: &[u32]) -> (u64, u64) {
        let all = up_to(others.len());
        let n_frames = self.air.n_frames();
        if n_frames == self.air.radios.ends.len() {
            return (all, all);
        }
        let mut sending = 0;
        for (k, &q) in others.iter().enumerate() {
            sending |= u64::from((q as usize) < n_frames) << k;
        }
        (sending, if p < n_frames { all } else { 0 })
    }

    fn plainly(&self, p: usize, others: &[u32], (sending, listening): (u64, u64)) -> (u64, u64) {
        let (mut hears, mut is_heard) = (0, 0);
        for k in ones(sending | listening) {
            let q = others[k] as usize;
            let mut pair = self.air.pair(p, q);
            if sending >> k & 1 == 1 && self.air.hears(p, q, &mut pair) {
                hears |= 1 << k;
            }
            if listening >> k & 1 == 1 && self.air.hears(q, p, &mut pair) {
                is_heard |= 1 << k;
            }
        }
        (hears, is_heard)
    }

    /// Whether what scatter adds takes long to compute, and the same bounds hold in both directions.
    fn is_costly(&self) -> bool {
        matches!(self.variation, Variation::OtherShared | Variation::OtherDirected)
            && matches!(self.bounds, Bounds::One(_))
    }

    /// Steps that scatter adds to the frames from the others (`to_p`), or to the frame to them, where `open` says that
    /// this matters; elsewhere `added` stays.
    #[inline]
    fn add(
        &self,
        p: usize,
        others: &[u32],
        words: &[[u64; 4]],
        to_p: bool,
        open: u64,
        added: &mut [f64],
    ) {
        let Radios { id, frames, .. } = self.air.radios;
        match self.variation {
            Variation::None => {}
            Variation::Shared(per_unit) => {
                for (added, words) in added.iter_mut().zip(words) {
                    *added = level(words[LEVEL_WORD], per_unit);
                }
            }
            Variation::Directed(per_unit) => {
                for ((added, words), &q) in added.iter_mut().zip(words).zip(others) {
                    let from_higher = (id[p] < id[q as usize]) == to_p;
                    *added = level(words[LEVEL_WORD + usize::from(from_higher)], per_unit);
                }
            }
            Variation::OtherShared | Variation::OtherDirected => {
                for k in ones(open & up_to(others.len())) {
                    let (added, words, q) = (&mut added[k], words[k], others[k] as usize);
                    let (receiver, frame) = if to_p { (p, q) } else { (q, p) };
                    let mut pair = self.air.drawn_pair(p, q, words);
                    let scatter_db = if matches!(self.variation, Variation::OtherShared) {
                        self.air.shared_db(p, q, &mut pair)
                    } else if frame < frames.len() {
                        self.air.scatter_db(receiver, frame, &mut pair)
                    } else {
                        0.0
                    };
                    *added = scatter_db * STEPS_PER_DB;
                }
            }
        }
    }

    /// Limits on the draws of the frames from the others (`to_p`), or of the frame to them.
    #[inline]
    fn limit(
        &self,
        p: usize,
        others: &[u32],
        d2_m2: &[f64],
        to_p: bool,
        added: &[f64],
        limits: &mut [Limits],
    ) {
        let links = limits.iter_mut().zip(d2_m2).zip(added);
        match self.bounds {
            Bounds::None => {}
            Bounds::One(filter) => match &filter.rule {
                Rule::Draw(by_cell) => {
                    for ((limits, &d2_m2), _) in links {
                        *limits = by_cell[filter.cell(d2_m2).min(by_cell.len() - 1)];
                    }
                }
                Rule::Level { steps, curve } => {
                    for ((limits, &d2_m2), &added) in links {
                        let step = steps[filter.cell(d2_m2).min(steps.len() - 1)];
                        *limits = curve.limits(step + added);
                    }
                }
            },
            Bounds::ByChannel => {
                let frames = &self.air.radios.frames;
                for (((limits, &d2_m2), &added), &q) in links.zip(others) {
                    let frame = frames.get(if to_p { q as usize } else { p });
                    let filter = frame.and_then(|frame| self.air.filters.on(frame.channel));
                    *limits = filter.map_or([0, 0], |filter| filter.limits(d2_m2, added));
                }
            }
        }
    }
}

/// Steps that a uniform contribution adds whose level is that of a word.
#[inline(always)]
fn level(word: u64, per_unit: f64) -> f64 {
    const MIDDLE: f64 = (1u64 << 52) as f64;
    (draw_of(word) as f64 - MIDDLE) * per_unit
}

/// Bits of the links that certainly succeed, and of those that may. `which`: the word that decides a link.
#[inline(always)]
fn decide(limits: &[Limits], words: &[[u64; 4]], which: impl Fn(usize) -> usize) -> (u64, u64) {
    let (mut sure, mut possible) = (0, 0);
    for (k, (&[low, high], words)) in limits.iter().zip(words).enumerate().rev() {
        let draw = draw_of(words[which(k)]);
        sure = sure << 1 | u64::from(draw < low);
        possible = possible << 1 | u64::from(draw < high);
    }
    (sure, possible)
}

/// The lowest `n` bits, at most all 64.
#[inline]
#[must_use]
pub fn up_to(n: usize) -> u64 {
    if n < 64 { (1 << n) - 1 } else { u64::MAX }
}

/// Indices of the bits that are set.
#[inline]
pub fn ones(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        (bits != 0).then(|| {
            let bit = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            bit
        })
    })
}
