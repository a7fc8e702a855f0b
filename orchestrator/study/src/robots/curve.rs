//! Smooth curves over a covariate: what a robot's way is longer by, and where it drifts.

use super::density::Residual;
use super::motion::{Gains, MeasuredTracks};
use super::subset::kept_of;
use super::{RobotFit, RobotModel};
use crate::TermId;
use crate::knots;
use numbers::statistics::mean_ignoring_nan;
use std::ops::Range;

/// Hat functions over a covariate, each less its mean over all windows, and perhaps a constant.
#[derive(Clone, Debug)]
pub(super) struct RobotCurve {
    knots: Vec<f64>,
    means: Vec<f64>,
    /// The covariate at each sample; NaN where it is missing.
    samples: Vec<f64>,
    /// The same where each window begins.
    windows: Vec<f64>,
    /// There is a constant beside the functions.
    has_constant: bool,
}

/// Numbers of a function: one for the way, two for the drift.
const N_EACH: usize = 3;

impl RobotCurve {
    /// With so many knots over a covariate of each sample; of few values with fewer.
    pub(super) fn new(tracks: &MeasuredTracks, samples: Vec<f64>, n_knots: usize) -> Option<Self> {
        let windows: Vec<f64> = tracks.windows.iter().map(|w| samples[w.start as usize]).collect();
        let mut sorted: Vec<f64> = windows.iter().copied().filter(|v| v.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let knots = knots::at_quantiles(&sorted, n_knots);
        if knots.len() < 2 {
            return None;
        }
        let means = vec![0.0; knots.len() - 1];
        let mut curve = Self { knots, means, samples, windows, has_constant: false };
        curve.means = (0..curve.means.len())
            .map(|k| {
                let known = (0..curve.windows.len()).filter(|&w| curve.windows[w].is_finite());
                mean_ignoring_nan(known.map(|window| curve.function(k, window)))
            })
            .collect();
        Some(curve)
    }

    /// The same with a constant.
    pub(super) fn with_constant(&self) -> Self {
        Self { has_constant: true, ..self.clone() }
    }

    /// The same at the windows that are kept.
    pub(super) fn some(&self, kept: &[bool]) -> Self {
        Self { windows: kept_of(&self.windows, kept), ..self.clone() }
    }

    /// The covariate at the start of each window; NaN where it is missing.
    pub(super) fn values(&self) -> &[f64] {
        &self.windows
    }

    fn n_functions(&self) -> usize {
        self.means.len() + usize::from(self.has_constant)
    }

    /// How many numbers it has.
    pub(super) fn n_numbers(&self) -> usize {
        N_EACH * self.n_functions()
    }

    /// Value of a function at a window: of the hats of all knots but the first, and after them of the constant. Zero where the
    /// covariate is missing.
    fn function(&self, k: usize, window: usize) -> f64 {
        let value = self.windows[window];
        if !value.is_finite() {
            return 0.0;
        }
        // The function after those of the knots is the constant.
        let Some(mean) = self.means.get(k) else { return 1.0 };
        let of_knot =
            knots::shares(&self.knots, value).into_iter().filter(|(knot, _)| *knot == k + 1);
        let hat: f64 = of_knot.map(|(_, share)| share).sum();
        hat - mean
    }
}

/// A curve, and what it has done to where robots are believed to be.
pub(super) struct Acting<'a> {
    curve: &'a RobotCurve,
    /// Where its numbers are among all of a fit.
    pub(super) numbers: Range<usize>,
    /// By window and function: way (m, east and north) and time (s) that a unit of the function has acted on and measurements have
    /// not corrected yet.
    before: Vec<[f64; 3]>,
}

impl RobotModel {
    /// What the curves of a fit do where measurements count as much as it says.
    pub(super) fn actings(&self, fit: &RobotFit) -> Vec<Acting<'_>> {
        let gains = self.gains(fit);
        let acting = |&term: &TermId| {
            let curve = self.curve(term)?;
            let first = fit.first(self, term);
            Some(self.acting(curve, first..first + self.n_numbers(term), gains))
        };
        fit.terms.iter().filter_map(acting).collect()
    }

    fn acting<'a>(&self, curve: &'a RobotCurve, numbers: Range<usize>, gains: Gains) -> Acting<'a> {
        let n_knots = curve.knots.len();
        let mut before = Vec::with_capacity(self.tracks.windows.len() * curve.n_functions());
        // One sum for each knot's hat, and after them one for 1.
        let mut sums = vec![[0.0; 3]; n_knots + 1];
        self.tracks.believed(
            gains,
            &mut sums,
            |sample, sums| {
                let value = curve.samples[sample];
                if !value.is_finite() {
                    return;
                }
                let [east_m, north_m] = self.steps_m[sample];
                let step = [east_m, north_m, self.tracks.step_s(sample)];
                let shares = knots::shares(&curve.knots, value);
                for (knot, share) in shares.into_iter().chain([(n_knots, 1.0)]) {
                    for (sum, part) in sums[knot].iter_mut().zip(step) {
                        *sum += share * part;
                    }
                }
            },
            |sums| {
                for k in 0..curve.n_functions() {
                    before.push(match curve.means.get(k) {
                        Some(mean) => {
                            std::array::from_fn(|i| sums[k + 1][i] - mean * sums[n_knots][i])
                        }
                        None => sums[n_knots],
                    });
                }
            },
        );
        Acting { curve, numbers, before }
    }

    /// What one unit of a number of a curve, the `index`th of its own, adds to where a window ends (m), along and across: to its
    /// motion, and to where it begins.
    pub(super) fn curve_column(
        &self,
        acting: &Acting<'_>,
        index: usize,
        row: u32,
        residual: &Residual,
    ) -> [f64; 2] {
        let (k, row) = (index / N_EACH, row as usize);
        let value = acting.curve.function(k, row);
        let [east_m, north_m, time_s] = acting.before[row * acting.curve.n_functions() + k];
        let [cos, sin] = self.directions[row];
        // East and north, seen along and across.
        let seen = |east: f64, north: f64| [east * cos + north * sin, north * cos - east * sin];
        let acted_s = value * self.tracks.window_s(row) + time_s;
        match index % N_EACH {
            0 => {
                let [along_m, across_m] = seen(east_m, north_m);
                [value * residual.way_m + along_m, across_m]
            }
            1 => seen(acted_s, 0.0),
            _ => seen(0.0, acted_s),
        }
    }

    /// How long (s) what changes a robot's velocity has acted before each window without measurements having corrected what it did.
    pub(super) fn uncorrected_s(&self, gains: Gains) -> Vec<f64> {
        let mut times_s = Vec::with_capacity(self.tracks.windows.len());
        let add = |sample: usize, sums: &mut [[f64; 1]]| sums[0][0] += self.tracks.step_s(sample);
        self.tracks.believed(gains, &mut [[0.0]], add, |sums| times_s.push(sums[0][0]));
        times_s
    }
}
