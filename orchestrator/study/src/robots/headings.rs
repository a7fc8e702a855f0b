//! How predicted headings scatter: the channel that bodies which turn are measured in beside their position.

use super::density::{Residual, mixed, mixed_weight};

use super::{RobotFit, RobotModel, RobotStudy};
use crate::folds::Blocks;
use crate::thresholds::{BROAD_FACTOR, BROAD_SHARE, CHANCE_SDS, FAMILY_ERROR, UNCORRECTED_LEVEL};
use numbers::power::square;
use robotsim::dynamics::wrapped;
use statrs::distribution::{ContinuousCDF as _, FisherSnedecor};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::ops::Range;

/// The greatest concentration: headings that agree to 1e-9 rad.
const MOST_CONCENTRATED: f64 = 1e18;
/// Headings are turned by this (rad) for the slope of errors over them.
const TURN_RAD: f64 = 1e-3;
/// A course is measured by a way of at least so many times the noise of positions.
const FAR_NOISES: f64 = 5.0;
/// Windows of a part of a track.
const PART_WINDOWS: usize = 8;

/// Scatter of the headings at the ends of windows: von Mises' law and, for one window in a hundred, one that is ten times as broad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HeadingDensity {
    /// Concentration of the law, which each fit estimates (1/rad²).
    concentration: f64,
    /// What a heading counts of an independent measurement, from 0 to 1.
    pub(super) weight: f64,
    /// Logarithm (nats) of the integral over all headings: of the narrow law and of the broad one.
    log_norms: [f64; 2],
}

impl HeadingDensity {
    /// Of headings that count so much, before a fit.
    pub(super) fn new(weight: f64) -> Self {
        Self { concentration: 0.0, weight, log_norms: [0.0; 2] }.concentrated(1e4)
    }

    /// The same with headings that count so much.
    pub(super) fn weighted(self, weight: f64) -> Self {
        Self { weight, ..self }
    }

    fn concentrated(self, concentration: f64) -> Self {
        let broad = concentration / square(BROAD_FACTOR);
        Self { concentration, log_norms: [concentration, broad].map(log_norm), ..self }
    }

    /// Logarithm of the density of the broad law over that of the narrow one, for an error whose cosine lies so far below 1.
    fn broader(&self, below: f64) -> f64 {
        let [narrow, broad] = self.log_norms;
        let pull = self.concentration * below;
        libm::log(BROAD_SHARE / (1.0 - BROAD_SHARE))
            + pull * (1.0 - 1.0 / square(BROAD_FACTOR))
            + narrow
            - broad
    }

    /// Log density (nats) of such an error.
    fn log_unweighted(&self, below: f64) -> f64 {
        let narrow = libm::log(1.0 - BROAD_SHARE) - self.concentration * below - self.log_norms[0];
        narrow + mixed(self.broader(below)).0
    }

    /// Log density (nats) of an error (rad), times what a heading counts; 0 where none is measured.
    pub(super) fn log(&self, error_rad: f64) -> f64 {
        if error_rad.is_nan() { 0.0 } else { self.weight * self.log_unweighted(below(error_rad)) }
    }

    /// What pulls the prediction towards a heading that is off by an error (rad), and its information (1/rad²); 0 where none is
    /// measured.
    pub(super) fn pull(&self, error_rad: f64) -> (f64, f64) {
        if error_rad.is_nan() {
            return (0.0, 0.0);
        }
        let counts = mixed_weight(self.broader(below(error_rad)));
        (libm::sin(error_rad), self.weight * counts * self.concentration)
    }

    /// The likeliest concentration, by expectation and maximisation from this one.
    pub(super) fn fitted(mut self, residuals: &[Residual]) -> Self {
        let errors = residuals.iter().map(|residual| residual.heading_rad);
        let below: Vec<f64> = errors.filter(|error| !error.is_nan()).map(below).collect();
        if below.is_empty() {
            return self;
        }
        for _ in 0..60 {
            let weighted = below.iter().map(|below| mixed_weight(self.broader(*below)) * below);
            let mean = weighted.sum::<f64>() / below.len() as f64;
            let before = self.concentration;
            self = self.concentrated(concentration(mean));
            if (self.concentration / before - 1.0).abs() < 1e-7 {
                break;
            }
        }
        self
    }
}

impl RobotModel {
    /// What a heading counts: the ratio of the variance that the sum of all slopes would have if windows were independent to that
    /// by tracks, or by blocks of time if that is smaller. At most 1. An error that lasts, such as the drift of a gyroscope, then counts
    /// once.
    pub(super) fn heading_weight(&self, fit: &RobotFit, rows: &[u32], blocks: &Blocks) -> f64 {
        let (Some(heading), Some(residuals)) = (fit.density.heading, self.residuals(fit, rows))
        else {
            return 1.0;
        };
        let slopes = residuals.iter().map(|residual| {
            let (sine, information) = heading.weighted(1.0).pull(residual.heading_rad);
            sine * information
        });
        let slopes: Vec<f64> = slopes.collect();
        let by = |cluster: &dyn Fn(usize) -> u32| {
            let mut sums: BTreeMap<u32, f64> = BTreeMap::new();
            for (slope, &row) in slopes.iter().zip(rows) {
                *sums.entry(cluster(row as usize)).or_default() += slope;
            }
            sums.values().copied().map(square).sum::<f64>()
        };
        let alone: f64 = slopes.iter().copied().map(square).sum();
        let together = by(&|row| self.tracks.windows[row].track).max(by(&|row| blocks.of_row[row]));
        if alone < together { alone / together } else { 1.0 }
    }
}

impl RobotModel {
    /// Turns the measured headings of each track by what their mean is off by chance. A model whose motion is right takes that mean for the
    /// course, and positions, which tell the course far better, would show a bias. Where the angle of a track, or what all have in common,
    /// exceeds [`CHANCE_SDS`] standard deviations, it is no chance: something turns robots, and nothing is done.
    pub(super) fn turn_headings(&mut self, fit: &RobotFit, rows: &[u32]) {
        let (Some(heading), Some(residuals)) = (fit.density.heading, self.residuals(fit, rows))
        else {
            return;
        };
        let measured = self.tracks.robots.samples.clone();
        self.turn(0..measured.len(), TURN_RAD);
        let turned = self.residuals(fit, rows);
        self.tracks.robots.samples = measured;
        let Some(turned) = turned else { return };
        let variance_m2 = square(fit.density.sd_m) * self.tracks.n_overlapping;
        // Of each track the sum of the squares of slopes over the angle (m²/rad²), and that of slopes times errors (m²/rad).
        let mut sums: BTreeMap<u32, [f64; 2]> = BTreeMap::new();
        for ((residual, turned), &row) in residuals.iter().zip(&turned).zip(rows) {
            let of = sums.entry(self.tracks.windows[row as usize].track).or_default();
            for (left_m, turned_m) in residual.parts_m.iter().zip(turned.parts_m) {
                let slope = (left_m - turned_m) / TURN_RAD;
                *of = [of[0] + square(slope), of[1] + slope * left_m];
            }
        }
        let angle = |(track, [information, pull]): (u32, [f64; 2])| {
            let range = self.tracks.robots.tracks[track as usize].clone();
            // The mean of all means up to a sample, which the filter follows, has twice the variance of the mean of all.
            let variance = 2.0 / (heading.concentration * range.len() as f64);
            let angle_rad = pull / (information + variance_m2 / variance);
            (range, angle_rad, angle_rad / variance.sqrt())
        };
        let angles: Vec<(Range<usize>, f64, f64)> = sums.into_iter().map(angle).collect();
        let is_chance = |sds: f64| sds.abs() < CHANCE_SDS;
        let common =
            angles.iter().map(|(_, _, sds)| sds).sum::<f64>() / (angles.len() as f64).sqrt();
        if is_chance(common) && angles.iter().all(|(_, _, sds)| is_chance(*sds)) {
            angles.into_iter().for_each(|(range, angle_rad, _)| self.turn(range, angle_rad));
        }
    }

    fn turn(&mut self, samples: Range<usize>, angle_rad: f64) {
        let samples = &mut self.tracks.robots.samples[samples];
        samples.iter_mut().for_each(|sample| sample.heading_rad += angle_rad);
    }
}

impl RobotStudy {
    /// The configured model fitted to positions alone, if it cannot predict headings with the same numbers: positions are predicted worse
    /// beside headings than chance explains (one-sided [`UNCORRECTED_LEVEL`] over blocks of time). On the rows of the fit a shared number
    /// that is off by z standard errors lies z / 2 above chance, so that this is 3.3 standard errors. A car is measured at a point before or
    /// behind its rear axle, and turns by another wheelbase than it moves. Positions are what is predicted, and headings do not count then.
    pub(super) fn of_positions_alone(&self, rows: &[u32]) -> Option<RobotFit> {
        let joint = &self.configured;
        joint.density.heading?;
        let mut start = joint.clone();
        start.density.heading = None;
        let alone = self.model.fitted(&[], rows, &start);
        let logs = |fit: &RobotFit| -> Option<Vec<f64>> {
            let residuals = self.model.residuals(fit, rows)?;
            Some(residuals.iter().map(|it| fit.density.log_of_position(it)).collect())
        };
        let more =
            logs(&alone)?.into_iter().zip(logs(joint)?).zip(rows).map(|((a, b), &row)| {
                (self.model.tracks.windows[row as usize].start as usize, a - b)
            });
        let gain = self.mean_over_blocks(more)?;
        (0.0 < gain.least(UNCORRECTED_LEVEL)).then_some(alone)
    }

    /// Whether measured headings drift against the course that positions show: windows that follow each other, without overlap, differ from
    /// those of other parts of their track by more than among themselves (F test at [`FAMILY_ERROR`]). What a wind of the same direction
    /// everywhere turns is taken out first.
    pub(super) fn headings_drift(&self) -> bool {
        let tracks = &self.model.tracks;
        let samples = &tracks.robots.samples;
        let least_m = FAR_NOISES * self.configured.density.sd_m;
        // Of each window of a track: track and part, the course less the heading (rad), and what a wind turns.
        let mut rows: Vec<((u32, usize), [f64; 3])> = Vec::new();
        let (mut track, mut n, mut last_end) = (u32::MAX, 0, 0);
        for window in &tracks.windows {
            if window.track != track {
                (track, n, last_end) = (window.track, 0, 0);
            }
            let [from, to] = [window.start, window.end].map(|sample| samples[sample as usize]);
            let [dx, dy] = [0, 1].map(|axis| to.position_m[axis] - from.position_m[axis]);
            let way_m = libm::hypot(dx, dy);
            let turned_rad = wrapped(to.heading_rad - from.heading_rad);
            let middle_rad = from.heading_rad + 0.5 * turned_rad;
            let forward = libm::cos(libm::atan2(dy, dx) - middle_rad);
            if window.start < last_end || way_m < least_m || forward.is_nan() || forward < 0.5 {
                continue;
            }
            let off_rad = wrapped(libm::atan2(dy, dx) - middle_rad);
            let slow = (to.time_s - from.time_s) / way_m;
            let (sin, cos) = libm::sincos(middle_rad);
            rows.push(((track, n / PART_WINDOWS), [off_rad, slow * sin, slow * cos]));
            (n, last_end) = (n + 1, window.end);
        }
        let n_tracks = by_group(&mut rows, |(track, _)| u64::from(track));
        let beside_wind = |column: usize, rows: &mut [((u32, usize), [f64; 3])]| {
            let products = |k: usize| rows.iter().map(move |(_, it)| it[column] * it[k]);
            let sums: Vec<f64> = (0..3).map(|k| products(k).sum()).collect();
            for k in [0, 2].into_iter().filter(|&k| k == 0 || column < k) {
                let share = if 0.0 < sums[column] { sums[k] / sums[column] } else { 0.0 };
                rows.iter_mut().for_each(|(_, it)| it[k] -= share * it[column]);
            }
        };
        beside_wind(1, &mut rows);
        beside_wind(2, &mut rows);
        let all = rows.iter().map(|(_, it)| square(it[0])).sum::<f64>();
        let n_rows = rows.len();
        let parts = by_group(&mut rows, |(track, part)| (u64::from(track) << 32) + part as u64);
        let within = rows.iter().map(|(_, it)| square(it[0])).sum::<f64>();
        let between = all - within;
        let (Some(more), Some(left)) = (parts.checked_sub(n_tracks), n_rows.checked_sub(parts + 2))
        else {
            return false;
        };
        let [more, left] = [more as f64, left as f64];
        FisherSnedecor::new(more, left)
            .is_ok_and(|law| law.sf(between / more / (within / left)) < FAMILY_ERROR)
    }
}

/// Takes the mean of each group from its rows, and returns the number of groups.
fn by_group(rows: &mut [((u32, usize), [f64; 3])], group: impl Fn((u32, usize)) -> u64) -> usize {
    let mut sums: BTreeMap<u64, ([f64; 3], f64)> = BTreeMap::new();
    for (key, values) in rows.iter() {
        let (sum, n) = sums.entry(group(*key)).or_default();
        (0..3).for_each(|k| sum[k] += values[k]);
        *n += 1.0;
    }
    for (key, values) in rows.iter_mut() {
        let (sum, n) = &sums[&group(*key)];
        (0..3).for_each(|k| values[k] -= sum[k] / n);
    }
    sums.len()
}

/// How far the cosine of an error (rad) lies below 1.
fn below(error_rad: f64) -> f64 {
    2.0 * square(libm::sin(0.5 * error_rad))
}

/// The concentration (1/rad²) of headings whose cosines lie so far below 1 in the mean (A. Banerjee, I. S. Dhillon, J. Ghosh and S. Sra,
/// Clustering on the unit hypersphere using von Mises-Fisher distributions, J. Mach. Learn. Res. 6, 2005).
fn concentration(mean_below: f64) -> f64 {
    let length = (1.0 - mean_below).max(0.0);
    let free = mean_below * (1.0 + length);
    (length * (2.0 - length * length) / free).min(MOST_CONCENTRATED)
}

/// Logarithm of the integral of exp(κ (cos θ − 1)) over a turn.
fn log_norm(concentration: f64) -> f64 {
    const SERIES_FROM: f64 = 50.0;
    const N_POINTS: u32 = 64;
    if SERIES_FROM < concentration {
        // I₀ for large arguments: M. Abramowitz and I. A. Stegun, Handbook of Mathematical Functions, 1964, 9.7.1.
        let x = 1.0 / (8.0 * concentration);
        let series = 1.0 + x * (1.0 + x * (4.5 + x * 37.5));
        return libm::log(series) + 0.5 * libm::log(TAU / concentration);
    }
    // The trapezoidal rule is exact to rounding for so smooth a function of a turn.
    let step = TAU / f64::from(N_POINTS);
    let value = |k: u32| libm::exp(-concentration * below(step * f64::from(k)));
    libm::log(step * (0..N_POINTS).map(value).sum::<f64>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::rng::normal;

    #[test]
    fn densities_of_a_turn_sum_to_one() {
        for concentration in [0.0, 0.3, 20.0, 49.9, 50.1, 4000.0] {
            let density = HeadingDensity::new(1.0).concentrated(concentration);
            let n = 100_000;
            let step = TAU / f64::from(n);
            let sum: f64 = (0..n).map(|k| libm::exp(density.log(step * f64::from(k)))).sum();
            assert!((step * sum - 1.0).abs() < 1e-6, "{concentration}: {}", step * sum);
        }
    }

    #[test]
    fn the_scatter_that_was_put_in_is_found_and_missing_headings_drop_out() {
        let draw = |k: u64| {
            let word = |j| crate::folds::scramble(2 * k + j);
            normal(word(0), word(1))
        };
        let of = |heading_rad| Residual { heading_rad, ..Residual::default() };
        let mut residuals: Vec<Residual> = (0..20_000).map(|k| of(0.02 * draw(k))).collect();
        // One in two hundred points elsewhere, and one in ten is not measured.
        residuals.iter_mut().step_by(200).for_each(|residual| residual.heading_rad += 0.15);
        residuals.iter_mut().step_by(10).for_each(|residual| {
            residual.heading_rad =
                if residual.heading_rad < 0.1 { f64::NAN } else { residual.heading_rad };
        });
        let found = HeadingDensity::new(1.0).fitted(&residuals);
        let sd_rad = found.concentration.sqrt().recip();
        assert!((sd_rad / 0.02 - 1.0).abs() < 0.03, "{sd_rad}");
        assert_eq!((found.log(f64::NAN), found.pull(f64::NAN)), (0.0, (0.0, 0.0)));
        let half = found.weighted(0.5);
        assert!((2.0 * half.log(0.03) - found.log(0.03)).abs() < 1e-12);
        assert!(found.log(0.01) < 0.01 + found.log(TAU - 0.01));
    }

    #[test]
    fn a_pull_is_the_slope_of_the_log_density() {
        let density = HeadingDensity::new(0.3).concentrated(400.0);
        for error_rad in [-0.4, -0.05, 0.02, 0.1, 0.3] {
            let h = 1e-6;
            let slope = (density.log(error_rad - h) - density.log(error_rad + h)) / (2.0 * h);
            let (sine, information) = density.pull(error_rad);
            assert!((sine * information - slope).abs() < 1e-5 * slope.abs(), "{error_rad}");
        }
    }
}
