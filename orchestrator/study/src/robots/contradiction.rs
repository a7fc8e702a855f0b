//! Whether measured motion contradicts an effect: an effect that bounds motion is wrong if robots pass that bound.

use super::terms::Term;
use super::{RobotFit, RobotStudy};
use crate::thresholds::{
    ACCELERATION_SHARE, BOUND_MARGIN, CONTRADICTED_LEVEL, FEWEST_SUMMED_BLOCKS, NOISE_SDS,
    PASSING_SHARE,
};
use crate::{Estimate, Study as _, TermId};
use numbers::power::square;
use proto::effect::Bounds;
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::collections::BTreeMap;

impl RobotStudy {
    /// Why the measured motion contradicts an effect of a fit; none: it does not.
    pub(super) fn contradicted(&self, fit: &RobotFit, term: TermId) -> Option<String> {
        let Term::Effect(effect) = &self.model.terms[term] else { return None };
        let bounds = effect.bounds?;
        // What bounds a turn shows in headings.
        if effect.is_on_turn()
            || self.candidates[term].only.as_ref().is_some_and(is_otherwise_limited)
        {
            return None;
        }
        let (estimates, _) = self.estimates(fit, term);
        let &Estimate { low, high, .. } = estimates.first()?;
        match bounds {
            Bounds::Acceleration => self.passes_acceleration(term, high),
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

    /// The windows in which an effect acts, if it is limited to robots or campaigns.
    fn rows_of(&self, term: TermId) -> impl Iterator<Item = usize> + '_ {
        let only = self.candidates[term].only.as_ref();
        let list = |key: &str| only.and_then(|only| only.get(key)).and_then(toml::Value::as_array);
        let (agents, runs) = (list("agents").cloned(), list("runs").cloned());
        let has = |list: &Option<Vec<toml::Value>>, id: u32| {
            list.as_ref().is_none_or(|list| list.contains(&toml::Value::from(i64::from(id))))
        };
        let tracks = &self.model.tracks;
        (0..tracks.windows.len()).filter(move |&row| {
            let start = tracks.start(&tracks.windows[row]);
            has(&agents, start.agent) && has(&runs, start.run)
        })
    }

    /// The share (%) of windows that pass a bound, if it is more than noise and stray windows explain.
    fn passing_share(&self, term: TermId, passes: impl Fn(usize) -> Option<bool>) -> Option<f64> {
        let values = self.rows_of(term).filter_map(|row| Some((row, f64::from(passes(row)?))));
        let share = self.mean_over_blocks(values)?;
        (PASSING_SHARE < share.least(CONTRADICTED_LEVEL)).then_some(100.0 * share.mean)
    }

    /// Whether robots that are asked for more than a greatest acceleration are accelerated by more, in the mean of the direction that is
    /// asked for: noise of positions, which no command knows of, has no part in that.
    fn passes_acceleration(&self, term: TermId, high_mps2: f64) -> Option<String> {
        // Of commands of velocity, robots follow any change as they can.
        if !self.robots().commands.is_inertial() {
            return None;
        }
        let along = |row: usize| {
            let [asked, measured] = self.accelerations_of(row)?;
            let asked_mps2 = norm(asked);
            let dot: f64 = asked.iter().zip(measured).map(|(a, b)| a * b).sum();
            (BOUND_MARGIN * high_mps2 < asked_mps2).then_some((row, dot / asked_mps2))
        };
        let mean = self.mean_over_blocks(self.rows_of(term).filter_map(along))?;
        let is_above = high_mps2 < mean.least(CONTRADICTED_LEVEL);
        (is_above && BOUND_MARGIN * high_mps2 < mean.mean).then(|| {
            format!(
                "robots that are asked for more are accelerated by {:.3} m/s², which is above {high_mps2:.3} m/s²",
                mean.mean
            )
        })
    }

    /// The acceleration (m/s²) that is asked for at the beginning of a window, and the measured one: both are means over the same time.
    fn accelerations_of(&self, row: usize) -> Option<[[f64; 3]; 2]> {
        let tracks = &self.model.tracks;
        let window = tracks.windows[row];
        let n = (window.end - window.start) as usize;
        let reach = ((ACCELERATION_SHARE * n as f64).round() as usize).max(2);
        let first = window.start as usize;
        let samples = self.robots().samples.get(first..=first + 2 * reach)?;
        if tracks.robots.tracks[window.track as usize].end <= first + 2 * reach {
            return None;
        }
        if (first..=first + 2 * reach).any(|sample| tracks.is_landed(sample)) {
            return None;
        }
        let half_s = 0.5 * (samples[2 * reach].time_s - samples[0].time_s);
        let [a, b, c] = [0, reach, 2 * reach].map(|k| samples[k].position_m);
        let measured = std::array::from_fn(|i| (a[i] - 2.0 * b[i] + c[i]) / square(half_s));
        // A second difference is a mean with weights that fall evenly on both sides.
        let mut asked = [0.0; 3];
        for (k, sample) in samples.iter().enumerate() {
            let weight = (reach - k.abs_diff(reach)) as f64 / square(reach as f64);
            for (sum, part) in asked.iter_mut().zip(sample.command) {
                *sum += weight * part;
            }
        }
        Some([asked, measured])
    }

    /// The mean of values of windows, with its standard error over blocks of time. None of too few blocks.
    fn mean_over_blocks(&self, values: impl Iterator<Item = (usize, f64)>) -> Option<BlockMean> {
        let mut sums: BTreeMap<u32, [f64; 2]> = BTreeMap::new();
        for (row, value) in values {
            let [sum, n] = sums.entry(self.in_time.dependent()[row]).or_default();
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
struct BlockMean {
    mean: f64,
    standard_error: f64,
    blocks: f64,
}

impl BlockMean {
    /// Its lower bound at a one-sided level.
    fn least(&self, level: f64) -> f64 {
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
