//! Bounds on a link's fate from its distance alone.
//!
//! Where a model is isotropic, its mean power (or stated probability) falls with distance. Tabulated over the square of
//! the distance, in steps of 1/256 of its size, it bounds the true value from both sides without a root or a logarithm;
//! the reception curve, tabulated over power, bounds the probability. A draw outside these bounds is decided; the rare
//! one between them is decided by the full computation. So the outcome is the same.

use crate::link::{End, Scene};
use crate::model::Model;
use crate::propagation::{Reach, Reception};
use proto::ids::MoteId;

/// Filters of a model, for frames without and with a known channel.
#[derive(Clone, Debug, Default)]
pub struct Filters {
    /// Without a channel, then channels by number.
    by_channel: Vec<Option<Filter>>,
}

impl Filters {
    /// Filters for frames on these channels, and for frames without one.
    #[must_use]
    pub fn for_channels(model: &Model, channels: &[u8]) -> Self {
        let mut by_channel = vec![None; 257];
        by_channel[0] = Filter::for_channel(model, None);
        for &channel in channels {
            by_channel[place(Some(channel))] = Filter::for_channel(model, Some(channel));
        }
        Self { by_channel }
    }

    /// The filter for a channel, if there can be one.
    #[inline]
    #[must_use]
    pub fn on(&self, channel: Option<u8>) -> Option<&Filter> {
        self.by_channel.get(place(channel))?.as_ref()
    }
}

fn place(channel: Option<u8>) -> usize {
    channel.map_or(0, |channel| usize::from(channel) + 1)
}

/// Bounds on the fate of links over the square of their distance.
#[derive(Clone, Debug)]
pub struct Filter {
    first_key: u64,
    /// Links nearer than this (square, m²) succeed whatever is drawn.
    pub certain_below_m2: f64,
    /// Links this far (square, m²) and farther fail whatever is drawn.
    pub impossible_from_m2: f64,
    /// What decides the others.
    pub rule: Rule,
}

/// What decides a link that its distance leaves open.
#[derive(Clone, Debug)]
pub enum Rule {
    /// Nothing but the draw: limits on it by cell of distance.
    Draw(Vec<Limits>),
    /// The mean power and what scatter adds to it.
    Level {
        /// Least mean power by cell of distance, in steps of the curve.
        steps: Vec<f64>,
        /// Limits on the draw over the power.
        curve: CurveGrid,
    },
}

/// Limits on the draw of a link: below `[0]` it certainly succeeds, from `[1]` on it certainly fails. In units of 2⁻⁵³, as
/// draws have.
pub type Limits = [i64; 2];

/// A draw in units of 2⁻⁵³: what [`uniform`](proto::rng::uniform) makes a number in [0, 1) of.
#[inline]
#[must_use]
pub fn draw_of(word: u64) -> i64 {
    (word >> 11) as i64
}

/// 2⁵³.
const DRAWS: f64 = (1u64 << 53) as f64;

/// Limits where the probability lies from `low` to `high`.
fn limits(low: f64, high: f64) -> Limits {
    let low = (low - MARGIN).clamp(0.0, 1.0) * DRAWS;
    let high = (high + MARGIN).clamp(0.0, 1.0) * DRAWS;
    [low.floor() as i64, high.ceil() as i64]
}

/// Bits of the mantissa that a key keeps: cells are 1/256 of their size wide.
const MANTISSA_BITS: u32 = 8;
/// Rounding of powers (dB) and probabilities is far below this.
const MARGIN: f64 = 1e-9;
/// Where the power falls by more than this (dB) within a cell, bounds say too little.
const WIDEST_DB: f64 = 10.0;
/// More cells than this are not worth their memory: such a model is evaluated plainly.
const MOST_CELLS: u64 = 1 << 16;

#[inline]
fn key(distance_squared_m2: f64) -> u64 {
    distance_squared_m2.to_bits() >> (52 - MANTISSA_BITS)
}

impl Filter {
    fn for_channel(model: &Model, channel: Option<u8>) -> Option<Self> {
        let Reach::Within(reach_m) = model.reach(channel) else { return None };
        if !model.is_isotropic() {
            return None;
        }
        let first_key = key(model.min_distance_m * model.min_distance_m);
        let last_key = key(reach_m * reach_m);
        if MOST_CELLS < last_key - first_key || !(reach_m * reach_m).is_finite() {
            return None;
        }
        let scene = Scene::default();
        let mut by_curve = false;
        let value_at = |key: u64| {
            let distance_m = near_edge_m2(key).sqrt();
            let [sender, receiver] = [0.0, distance_m].map(|x| End::new(MoteId(0), [x, 0.0, 0.0]));
            let link = model.link(&scene, sender, receiver, channel, 0);
            let budget = model.evaluate(&link);
            match model.propagation.predict(&link).reception {
                Reception::ByCurve => {
                    by_curve = true;
                    budget.rssi_dbm
                }
                Reception::Stated(_) => budget.reception_probability,
            }
        };
        // Mean power (dBm), or stated probability, at the near edge of each cell and at the far edge of the last; then
        // twice nothing at all, for what lies beyond.
        let edges: Vec<f64> = (first_key..=last_key + 1)
            .map(value_at)
            .chain([f64::NEG_INFINITY, f64::NEG_INFINITY])
            .collect();
        let widest = widest(&edges);
        if by_curve && WIDEST_DB < widest {
            return None;
        }
        let curve = by_curve.then(|| CurveGrid::new(model, widest));
        let (gain_db, loss_db) = (model.max_scatter_db(), model.max_scatter_loss_db());
        let is_certain = |low: f64| match &curve {
            None => 1.0 <= low,
            Some(curve) => curve.certain_dbm <= low - loss_db - MARGIN,
        };
        let is_impossible = |high: f64| match &curve {
            None => high <= 0.0,
            Some(curve) => high + gain_db + MARGIN < curve.floor_dbm,
        };
        let n_cells = edges.len() - 1;
        let n_certain = (0..n_cells).take_while(|&cell| is_certain(edges[cell + 1])).count();
        let n_impossible =
            (0..n_cells).rev().take_while(|&cell| is_impossible(edges[cell])).count();
        let certain_below_m2 =
            if n_certain == 0 { 0.0 } else { near_edge_m2(first_key + n_certain as u64) };
        let n_possible = n_cells - n_impossible;
        let impossible_from_m2 =
            if n_possible == 0 { 0.0 } else { near_edge_m2(first_key + n_possible as u64) };
        let has_scatter = !model.scatters().is_empty();
        let rule = match curve {
            Some(curve) if has_scatter => {
                let steps = edges[1..].iter().map(|&low_dbm| curve.steps(low_dbm)).collect();
                Rule::Level { steps, curve }
            }
            _ => Rule::Draw(
                edges
                    .windows(2)
                    .map(|pair| match &curve {
                        None => limits(pair[1], pair[0]),
                        Some(curve) => curve.limits_between(pair[1], pair[0]),
                    })
                    .collect(),
            ),
        };
        Some(Self { first_key, certain_below_m2, impossible_from_m2, rule })
    }

    /// Limits on the draw of a link from the square of its distance (m²) and the steps of the curve that scatter adds.
    #[inline]
    #[must_use]
    pub fn limits(&self, distance_squared_m2: f64, added_steps: f64) -> Limits {
        let cell = self.cell(distance_squared_m2);
        match &self.rule {
            Rule::Draw(by_cell) => by_cell[cell.min(by_cell.len() - 1)],
            Rule::Level { steps, curve } => {
                curve.limits(steps[cell.min(steps.len() - 1)] + added_steps)
            }
        }
    }

    /// The cell of a link with this square of its distance (m²).
    #[inline(always)]
    #[must_use]
    pub fn cell(&self, distance_squared_m2: f64) -> usize {
        key(distance_squared_m2).saturating_sub(self.first_key) as usize
    }
}

/// Square of the distance (m²) at the near edge of a cell.
fn near_edge_m2(key: u64) -> f64 {
    f64::from_bits(key << (52 - MANTISSA_BITS))
}

/// The widest cell: how far neighbouring values lie apart at most.
fn widest(edges: &[f64]) -> f64 {
    edges
        .windows(2)
        .map(|pair| pair[0] - pair[1])
        .filter(|width| width.is_finite())
        .fold(0.0, f64::max)
}

/// The reception curve in steps of 1/64 dB, as limits on the draw for links whose mean power is known to within a cell.
#[derive(Clone, Debug)]
pub struct CurveGrid {
    floor_dbm: f64,
    /// From here on reception is certain; infinite if it never is.
    certain_dbm: f64,
    /// Steps that a cell of distance may span, and one.
    n_spanned: usize,
    /// The curve from the floor on.
    values: Vec<f64>,
    /// By step: 0 for what certainly lies below the floor.
    limits: Vec<Limits>,
}

/// Steps of the curve to a decibel.
pub const STEPS_PER_DB: f64 = 64.0;

impl CurveGrid {
    fn new(model: &Model, widest_db: f64) -> Self {
        let curve = model.reception_curve();
        let (floor_dbm, ceiling_dbm) = (curve.floor_dbm(), curve.ceiling_dbm());
        let n = ((ceiling_dbm - floor_dbm) * STEPS_PER_DB).ceil() as usize + 2;
        let values: Vec<f64> = (0..n)
            .map(|i| curve.reception_probability(floor_dbm + i as f64 / STEPS_PER_DB))
            .collect();
        let certain = 1.0 <= curve.reception_probability(ceiling_dbm);
        let certain_dbm = if certain { ceiling_dbm } else { f64::INFINITY };
        let n_spanned = ((widest_db + 2.0 * MARGIN) * STEPS_PER_DB).ceil() as usize + 1;
        let mut grid = Self { floor_dbm, certain_dbm, n_spanned, values, limits: Vec::new() };
        grid.limits = std::iter::once([0, 0])
            .chain((0..n + n_spanned).map(|i| {
                let low = if i < n_spanned { 0.0 } else { grid.value(i - n_spanned) };
                limits(low, grid.value(i))
            }))
            .collect();
        grid
    }

    fn value(&self, i: usize) -> f64 {
        self.values[i.min(self.values.len() - 1)]
    }

    /// A power (dBm) in steps, 1 standing for what may reach the floor within a cell.
    fn steps(&self, low_dbm: f64) -> f64 {
        (low_dbm - MARGIN - self.floor_dbm) * STEPS_PER_DB + 1.0 + self.n_spanned as f64
    }

    /// Limits on the draw for a power of so many steps. Bounded as a number, not as an index: that makes no branch, which
    /// random powers would mislead.
    #[inline(always)]
    #[must_use]
    pub fn limits(&self, steps: f64) -> Limits {
        let last = self.limits.len() - 1;
        // The first bound makes the cast exact; the second one never acts, but lets the compiler know the range.
        let step = (steps.max(0.0).min(last as f64) as i32 as usize).min(last);
        self.limits[step]
    }

    /// Limits on the draw for a power from `low_dbm` to `high_dbm`, no matter how far these lie apart.
    fn limits_between(&self, low_dbm: f64, high_dbm: f64) -> Limits {
        let step = |dbm: f64| (dbm - self.floor_dbm) * STEPS_PER_DB;
        let (low, high) = (step(low_dbm - MARGIN), step(high_dbm + MARGIN));
        // The casts take what is negative for 0.
        let at_least = if low < 0.0 { 0.0 } else { self.value(low as usize) };
        let at_most = if high < 0.0 { 0.0 } else { self.value(high as usize + 1) };
        limits(at_least, at_most)
    }
}
