//! Whether measured motion contradicts an effect: an effect that bounds motion is wrong if robots pass that bound, an error of the
//! course that noise of headings explains is none, and neither is a thrust that differs by no more than gravity does.

use super::inertial::{self, GRAVITY_RANGE_MPS2};
use super::terms::Term;
use super::{RobotFit, RobotStudy};
use crate::thresholds::{
    BOUND_MARGIN, CONTRADICTED_LEVEL, FAR_HALF_INTERVALS, FEWEST_SUMMED_BLOCKS, PASSING_SHARE,
    SHORTEST_BLOCK_WINDOWS,
};
use crate::{Estimate, Study as _, TermId};
use measure::robots::RobotSample;
use numbers::normal::Z_90;
use numbers::power::square;
use numbers::statistics::{mean, median_high};
use proto::effect::Bounds;
use robotsim::dynamics::effect::{self, Situation};
use robotsim::dynamics::{GRAVITY_MPS2, Part};
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::collections::BTreeMap;

/// Accelerations are measured over so long that noise changes them by at most this share of a bound (one standard deviation).
const NOISE_OF_BOUND: f64 = 0.25;
/// The standard deviation of noise over that by differences of neighbouring positions: noise with a correlation of 0.9 between
/// neighbours differs by a quarter of what it scatters by.
const CORRELATED_NOISE: f64 = 4.0;
/// The median absolute value of a standard normal number.
const MEDIAN_ABSOLUTE: f64 = 0.674_489_750_196_081_7;
/// Standard deviations by which noise of positions may pass a bound.
const NOISE_SDS: f64 = 3.0;

impl RobotStudy {
    /// Why the measured motion contradicts an effect of a fit; none: it does not.
    pub(super) fn contradicted(&self, fit: &RobotFit, term: TermId) -> Option<String> {
        let Term::Effect(effect) = &self.model.terms[term] else { return None };
        if let Some(why) = self.is_gravity(fit, term) {
            return Some(why);
        }
        let bounds = effect.bounds?;
        if bounds == Bounds::Course {
            return self.chance_of_course(fit, term);
        }
        // What bounds a turn shows in headings.
        if effect.is_on_turn()
            || self.candidates[term].only.as_ref().is_some_and(is_otherwise_limited)
        {
            return None;
        }
        let (estimates, _) = self.estimates(fit, term);
        let &Estimate { low, high, .. } = estimates.first()?;
        match bounds {
            Bounds::Acceleration => {
                // Over so long that noise of positions, differentiated twice, is small beside the bound.
                let sd_m = 6.0_f64.sqrt() * self.position_sd_m(fit);
                let over_s = (sd_m / (NOISE_OF_BOUND * high)).sqrt();
                let passes = |first: usize| {
                    let [acceleration_mps2, half_s] = self.acceleration_from(first, over_s)?;
                    let noise_mps2 = NOISE_SDS * sd_m / square(half_s);
                    Some((first, high * BOUND_MARGIN + noise_mps2 < acceleration_mps2))
                };
                let share = self.share_of(self.samples_of(term).filter_map(passes))?;
                Some(format!(
                    "robots are accelerated by more than {high:.3} m/s² at {share:.0} % of the moments"
                ))
            }
            Bounds::Course => None,
            Bounds::Speed => {
                let passes = |row: usize| {
                    let [moved_m, _, window_s] = self.motion_of(row);
                    Some(high * BOUND_MARGIN * window_s + self.noise_m(fit) < moved_m)
                };
                let share = self.passing_share(term, passes)?;
                Some(format!("robots are faster than {high:.3} m/s in {share:.0} % of windows"))
            }
            Bounds::Standstill => {
                let passes = |row: usize| {
                    let [moved_m, fastest_mps, window_s] = self.motion_of(row);
                    let is_below = 0.0 < fastest_mps && fastest_mps < low;
                    let half_m = 0.5 * fastest_mps * window_s;
                    is_below.then_some(half_m + self.noise_m(fit) < moved_m)
                };
                let share = self.passing_share(term, passes)?;
                Some(format!(
                    "robots move in {share:.0} % of windows in which less than {low:.3} m/s is commanded"
                ))
            }
        }
    }

    /// Why an effect on a body that bears its weight is none: all that it does is to accelerate it vertically, by no more than gravity
    /// differs by.
    fn is_gravity(&self, fit: &RobotFit, term: TermId) -> Option<String> {
        let tracks = &self.model.tracks;
        if !inertial::is_borne(&tracks.robots, &self.model.dynamics) {
            return None;
        }
        let table = self.effect_table(fit, term)?;
        let entry = self.model.catalogue.effects.selected(&table, &effect::TAG)?;
        let effect = effect::build_one(entry, &table)?;
        let is_otherwise = 0.0 < effect.delay_s(Part::Speed)
            || 0.0 < effect.lag_s(Part::Speed)
            || effect.limit_per_s(Part::Speed).is_finite()
            || effect.tilt_rad() != [0.0; 2];
        if is_otherwise {
            return None;
        }
        // A load that swings pulls sideways by less than it weighs.
        let borne = effect.load().map_or(1.0, |load| 1.0 / (1.0 + load.share));
        let (mut up_mps2, mut aside_mps2) = (0.0_f64, 0.0_f64);
        let steps = tracks.robots.tracks.iter().flat_map(|track| track.start..track.end - 1);
        for index in steps {
            let [now, next] = [index, index + 1].map(|index| tracks.robots.samples[index]);
            let over_s = next.time_s - now.time_s;
            let surroundings = tracks.surroundings(index);
            let at = Situation {
                time_s: now.time_s,
                position_m: now.position_m,
                velocity_mps: difference(next.position_m, now.position_m).map(|part| part / over_s),
                heading_rad: if now.heading_rad.is_nan() { 0.0 } else { now.heading_rad },
                surroundings: &surroundings,
            };
            let gain = borne * effect.thrust_gain(&at);
            let force_mps2 = effect.force_mps2(&at);
            let [east, north, up]: [f64; 3] = std::array::from_fn(|i| {
                let lift_mps2 = if i == 2 { GRAVITY_MPS2 } else { 0.0 };
                (gain - 1.0) * (now.command[i] + lift_mps2) + force_mps2[i]
            });
            up_mps2 = up_mps2.max(up.abs());
            aside_mps2 = aside_mps2.max(libm::hypot(east, north));
        }
        (aside_mps2 <= up_mps2 && 0.0 < up_mps2 && up_mps2 <= GRAVITY_RANGE_MPS2).then(|| {
            format!(
                "it accelerates robots vertically by {up_mps2:.4} m/s² at most, and gravity differs by up to \
                 {GRAVITY_RANGE_MPS2} m/s² from place to place"
            )
        })
    }

    /// Why a constant error of the course is none: the mean of as many measured headings is off by as much by chance. Motion tells the
    /// course far better than headings do, so that the interval of the fit is that of this mean.
    fn chance_of_course(&self, fit: &RobotFit, term: TermId) -> Option<String> {
        if !self.robots().shape.is_turning() {
            return None;
        }
        let (estimates, _) = self.estimates(fit, term);
        let Estimate { value, low, high, .. } = estimates.first()?;
        let rows: Vec<u32> = self.rows_of(term).map(|row| row as u32).collect();
        let residuals = self.model.residuals(fit, &rows)?;
        let known = residuals.iter().map(|it| square(it.heading_rad)).filter(|it| it.is_finite());
        let n = self.samples_of(term).count() as f64;
        // The mean of all means up to a sample has twice the variance of the mean of all.
        let mean_sd_rad = (2.0 * mean(known) / n).sqrt();
        let half_rad = libm::hypot(0.5 * (high - low), Z_90 * mean_sd_rad);
        (value.abs() < FAR_HALF_INTERVALS * half_rad).then(|| {
            format!(
                "its angle of {value:.4} rad is no more than the mean of {n:.0} noisy headings is off by chance"
            )
        })
    }

    /// By how much (m) noise of both positions may change a measured way.
    fn noise_m(&self, fit: &RobotFit) -> f64 {
        NOISE_SDS * std::f64::consts::SQRT_2 * fit.sd_m()
    }

    /// The way between the ends of a window (m), the greatest speed commanded in it (m/s), and its length (s).
    fn motion_of(&self, row: usize) -> [f64; 3] {
        let tracks = &self.model.tracks;
        let window = tracks.windows[row];
        let samples = &self.robots().samples[window.start as usize..=window.end as usize];
        let [from_m, to_m] = [0, samples.len() - 1].map(|k| samples[k].position_m);
        let is_turning = self.robots().shape.is_turning();
        let speed = |command: [f64; 3]| if is_turning { command[0].abs() } else { norm(command) };
        let before = samples.len() - 1;
        let speeds = samples[..before].iter().map(|sample| speed(sample.command));
        [norm(difference(to_m, from_m)), speeds.fold(0.0, f64::max), tracks.window_s(row)]
    }

    /// Whether an effect, if it is limited to robots or campaigns, acts on a sample.
    fn acts_on(&self, term: TermId, sample: usize) -> bool {
        let only = self.candidates[term].only.as_ref();
        let sample = &self.robots().samples[sample];
        let has = |key: &str, id: u32| {
            let list = only.and_then(|only| only.get(key)).and_then(toml::Value::as_array);
            list.is_none_or(|list| list.contains(&toml::Value::from(i64::from(id))))
        };
        has("agents", sample.agent) && has("runs", sample.run)
    }

    /// The samples on which an effect acts.
    fn samples_of(&self, term: TermId) -> impl Iterator<Item = usize> + '_ {
        (0..self.robots().samples.len()).filter(move |&sample| self.acts_on(term, sample))
    }

    /// The windows in which an effect acts.
    fn rows_of(&self, term: TermId) -> impl Iterator<Item = usize> + '_ {
        let windows = &self.model.tracks.windows;
        (0..windows.len()).filter(move |&row| self.acts_on(term, windows[row].start as usize))
    }

    /// The share (%) of windows that pass a bound, if it is more than noise and stray windows explain.
    fn passing_share(&self, term: TermId, passes: impl Fn(usize) -> Option<bool>) -> Option<f64> {
        let start = |row: usize| self.model.tracks.windows[row].start as usize;
        self.share_of(self.rows_of(term).filter_map(|row| Some((start(row), passes(row)?))))
    }

    /// The share (%) of moments, each by its sample, at which a bound is passed, if it is more than noise and stray windows explain.
    fn share_of(&self, moments: impl Iterator<Item = (usize, bool)>) -> Option<f64> {
        let share = self.mean_over_blocks(moments.map(|(at, passes)| (at, f64::from(passes))))?;
        (PASSING_SHARE < share.least(CONTRADICTED_LEVEL)).then_some(100.0 * share.mean)
    }

    /// The measured acceleration (m/s²) from a sample on, a mean over a time (s) on either side of a moment, and that time.
    fn acceleration_from(&self, first: usize, over_s: f64) -> Option<[f64; 2]> {
        let tracks = &self.model.tracks;
        let track = tracks.robots.tracks.iter().find(|track| track.contains(&first))?;
        let reach = ((over_s / tracks.spacing_s).ceil() as usize).max(1);
        let last = first + 2 * reach;
        if track.end <= last || (first..=last).any(|sample| tracks.is_landed(sample)) {
            return None;
        }
        let [a, b, c] = [first, first + reach, last].map(|k| &self.robots().samples[k]);
        let half_s = 0.5 * (c.time_s - a.time_s);
        let bend_m =
            std::array::from_fn(|i| a.position_m[i] - 2.0 * b.position_m[i] + c.position_m[i]);
        Some([norm(bend_m) / square(half_s), half_s])
    }

    /// Standard deviation (m) of the noise of one measured position: that of a fit, or less if neighbouring positions scatter less about
    /// a parabola. What the model misses does not count as noise then.
    fn position_sd_m(&self, fit: &RobotFit) -> f64 {
        let robots = self.robots();
        let third = |samples: &[RobotSample]| -> [f64; 3] {
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| samples[k].position_m);
            std::array::from_fn(|i| (d[i] - 3.0 * c[i] + 3.0 * b[i] - a[i]).abs())
        };
        let tracks = robots.tracks.iter();
        let mut differences_m: Vec<f64> = tracks
            .flat_map(|track| robots.samples[track.clone()].windows(4).flat_map(third))
            .filter(|difference_m| 0.0 < *difference_m)
            .collect();
        if differences_m.is_empty() {
            return fit.sd_m();
        }
        differences_m.sort_by(f64::total_cmp);
        // The variance of a third difference is 1 + 9 + 9 + 1 times that of a position.
        let white_m = median_high(&differences_m) / MEDIAN_ABSOLUTE / 20.0_f64.sqrt();
        fit.sd_m().min(CORRELATED_NOISE * white_m)
    }

    /// The mean of values, each with its sample, and its standard error over blocks of time of each track. None of too few blocks.
    pub(super) fn mean_over_blocks(
        &self,
        values: impl Iterator<Item = (usize, f64)>,
    ) -> Option<BlockMean> {
        let tracks = &self.model.tracks;
        let block_s = SHORTEST_BLOCK_WINDOWS * tracks.window_s(0);
        let mut sums: BTreeMap<(u32, u32, u64), [f64; 2]> = BTreeMap::new();
        for (sample, value) in values {
            let RobotSample { run, agent, time_s, .. } = self.robots().samples[sample];
            let [sum, n] = sums.entry((run, agent, (time_s / block_s) as u64)).or_default();
            *sum += value;
            *n += 1.0;
        }
        let blocks = sums.len() as f64;
        let [sum, n] = sums.values().fold([0.0; 2], |[s, n], block| [s + block[0], n + block[1]]);
        let mean = sum / n;
        let squares: f64 = sums.values().map(|[sum, n]| square(sum - n * mean)).sum();
        let standard_error = (blocks / (blocks - 1.0) * squares).sqrt() / n;
        let is_enough = FEWEST_SUMMED_BLOCKS <= sums.len();
        is_enough.then_some(BlockMean { mean, standard_error, blocks })
    }
}

/// A mean over blocks.
pub(super) struct BlockMean {
    mean: f64,
    standard_error: f64,
    blocks: f64,
}

impl BlockMean {
    /// Its lower bound at a one-sided level.
    pub(super) fn least(&self, level: f64) -> f64 {
        let quantile = StudentsT::new(0.0, 1.0, self.blocks - 1.0)
            .map_or(f64::INFINITY, |law| law.inverse_cdf(1.0 - level));
        self.mean - quantile * self.standard_error
    }
}

/// Whether the limits of an effect are others than robots and campaigns.
fn is_otherwise_limited(only: &toml::Table) -> bool {
    only.keys().any(|key| key != "agents" && key != "runs")
}

fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

fn norm(vector: [f64; 3]) -> f64 {
    vector.iter().map(|part| part * part).sum::<f64>().sqrt()
}
