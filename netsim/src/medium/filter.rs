//! Bounds on a link's fate from its distance alone.
//!
//! Where a model is isotropic, its mean power (or stated probability) falls with distance. Tabulated over the square of
//! the distance, in steps of 1/256 of its size, it bounds the true value from both sides without a root or a logarithm;
//! the reception curve, tabulated over power, bounds the probability. A draw outside these bounds is decided; the rare
//! one between them is decided by the full computation. So the outcome is the same.

use crate::phy::link::{End, Scene};
use crate::phy::model::Model;
use crate::phy::propagation::{Reach, Reception};

/// Filters of a model, for frames without and with a known channel.
#[derive(Clone, Debug, Default)]
pub struct Filters {
    /// Without a channel, then channels 11 to 26.
    by_channel: Vec<Option<Filter>>,
}

impl Filters {
    /// Filters for frames on these channels, and for frames without one.
    #[must_use]
    pub fn of(model: &Model, channels: &[u8]) -> Self {
        let mut by_channel = vec![None; 17];
        by_channel[0] = Filter::of(model, None);
        for &channel in channels {
            by_channel[place(Some(channel))] = Filter::of(model, Some(channel));
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
    channel.map_or(0, |channel| usize::from(channel) - 10)
}

/// Bounds on the fate of links over the square of their distance.
#[derive(Clone, Debug)]
pub struct Filter {
    first_key: u64,
    /// Mean power (dBm), or stated probability, at the near edge of each cell and at the far edge of the last; then twice
    /// nothing at all, for what lies beyond.
    edges: Vec<f64>,
    curve: Option<CurveGrid>,
    /// The most that scatter adds or takes (dB).
    max_scatter_db: f64,
}

/// Bits of the mantissa that a key keeps: cells are 1/256 of their size wide.
const MANTISSA_BITS: u32 = 8;
/// Rounding of powers (dB) and probabilities is far below this.
const MARGIN: f64 = 1e-9;
/// More cells than this are not worth their memory: such a model is evaluated plainly.
const MOST_CELLS: u64 = 1 << 16;

#[inline]
fn key(distance_squared_m2: f64) -> u64 {
    distance_squared_m2.to_bits() >> (52 - MANTISSA_BITS)
}

impl Filter {
    fn of(model: &Model, channel: Option<u8>) -> Option<Self> {
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
            let distance_m = f64::from_bits(key << (52 - MANTISSA_BITS)).sqrt();
            let [sender, receiver] = [0.0, distance_m].map(|x| End::at(0, [x, 0.0, 0.0]));
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
        let edges = (first_key..=last_key + 1)
            .map(value_at)
            .chain([f64::NEG_INFINITY, f64::NEG_INFINITY])
            .collect();
        Some(Self {
            first_key,
            edges,
            curve: by_curve.then(|| CurveGrid::of(model)),
            max_scatter_db: model.max_scatter_db(),
        })
    }

    /// Bounds, low and high, on the mean power (dBm) or stated probability of a link, from the square of its distance (m²).
    #[inline]
    #[must_use]
    pub fn bounds(&self, distance_squared_m2: f64) -> (f64, f64) {
        let cell = key(distance_squared_m2).saturating_sub(self.first_key) as usize;
        let cell = cell.min(self.edges.len() - 2);
        (self.edges[cell + 1], self.edges[cell])
    }

    /// Whether a link with this upper bound fails whatever is drawn.
    #[inline]
    #[must_use]
    pub fn is_impossible(&self, high: f64) -> bool {
        match &self.curve {
            None => high <= 0.0,
            Some(curve) => high + self.max_scatter_db + MARGIN < curve.floor_dbm,
        }
    }

    /// Whether a link with this lower bound succeeds whatever is drawn.
    #[inline]
    #[must_use]
    pub fn is_certain(&self, low: f64) -> bool {
        match &self.curve {
            None => 1.0 <= low,
            Some(curve) => curve.certain_dbm <= low - self.max_scatter_db - MARGIN,
        }
    }

    /// Bounds on the probability where the mean lies between `low` and `high` and scatter adds `scatter_db`.
    #[inline]
    #[must_use]
    pub fn probability(&self, (low, high): (f64, f64), scatter_db: f64) -> (f64, f64) {
        let (low, high) = match &self.curve {
            None => (low, high),
            Some(curve) => (
                curve.at_most(low + scatter_db - MARGIN),
                curve.at_least(high + scatter_db + MARGIN),
            ),
        };
        (low - MARGIN, high + MARGIN)
    }
}

/// The reception curve at every 1/32 dB.
#[derive(Clone, Debug)]
struct CurveGrid {
    floor_dbm: f64,
    /// From here on reception is certain; infinite if it never is.
    certain_dbm: f64,
    /// First 0, for powers below the floor; then the curve from the floor on.
    values: Vec<f64>,
    /// Index of the last value but one.
    last_step: f64,
}

const STEPS_PER_DB: f64 = 32.0;

impl CurveGrid {
    fn of(model: &Model) -> Self {
        let curve = &model.curve;
        let (floor_dbm, ceiling_dbm) = (curve.floor_dbm(), curve.ceiling_dbm());
        let n = ((ceiling_dbm - floor_dbm) * STEPS_PER_DB).ceil() as usize + 2;
        let on_grid = |i: usize| floor_dbm + i as f64 / STEPS_PER_DB;
        let values: Vec<f64> = std::iter::once(0.0)
            .chain((0..n).map(|i| curve.reception_probability(on_grid(i))))
            .collect();
        let last_step = (values.len() - 2) as f64;
        let certain = 1.0 <= curve.reception_probability(ceiling_dbm);
        let certain_dbm = if certain { ceiling_dbm } else { f64::INFINITY };
        Self { floor_dbm, certain_dbm, values, last_step }
    }

    /// No more than the probability at a power.
    #[inline]
    fn at_most(&self, rssi_dbm: f64) -> f64 {
        self.values[self.step(rssi_dbm)]
    }

    /// No less than the probability at a power.
    #[inline]
    fn at_least(&self, rssi_dbm: f64) -> f64 {
        let step = self.step(rssi_dbm);
        self.values[step + usize::from(step != 0)]
    }

    /// 0 below the floor, 1 in the first step of the grid, and so on. Bounded as a number, not as an index: that makes no
    /// branch, which random powers would mislead. The cast takes what is negative for 0.
    #[inline]
    fn step(&self, rssi_dbm: f64) -> usize {
        let step = (rssi_dbm - self.floor_dbm) * STEPS_PER_DB + 1.0;
        step.min(self.last_step) as u32 as usize
    }
}
