//! Positions of moving nodes that are off by some metres.
//!
//! A position that is off by d changes the prediction by the gradient of the model times d, so that the variance of a reading is
//! σ² + s²·g² with the squared gradient g² over the positions that move. Rows with as many moving ends have a σ of their own, so
//! that fading which comes from motion is no position noise. The gain in likelihood over s = 0 is tested on rows left out, by blocks of time.
//!
//! Where several receivers log a frame of a moving sender, the same error moves all their predictions: residuals of receivers in opposite
//! directions have opposite signs. The covariance of such pairs must then be significant, too. Shadowing and a common gain make
//! residuals alike, never opposite.

use super::evidence::{Evidence, p_value_by_blocks};
use super::{Correction, Defect};
use crate::Estimate;
use crate::thresholds::{
    FEWEST_MOVING_READINGS, FEWEST_OPPOSITE_PAIRS, FEWEST_OTHER_RECEIVERS, OPPOSITE_COSINE,
};
use measure::links::LinkRow;
use numbers::normal::FALL_90_NATS;
use numbers::optimise::roots::bisection;
use numbers::power::square;
use std::collections::BTreeMap;

/// The name of this kind.
pub const NAME: &str = "position-noise";
/// Positions are moved by this (m) for the gradient.
const STEP_M: f64 = 0.25;
/// Standard deviations that are tried (m): from the first, each this many times the one before.
const SDS_M: (f64, f64, i32) = (0.05, 1.15, 45);

/// A reading with what its variance depends on.
#[derive(Clone, Copy, Debug)]
struct Reading {
    row: usize,
    block: u32,
    fold: usize,
    residual_db: f64,
    /// How many of its ends move.
    n_moving: usize,
    /// The squared gradient over the positions of ends that move (dB²/m²).
    gradient: f64,
}

/// The gradient of each row over the position of the sender and of the receiver (dB/m), where they move.
fn gradients(evidence: &Evidence<'_>) -> Option<Vec<[[f64; 2]; 2]>> {
    let (rows, moving) = (evidence.rows(), evidence.study.moving());
    let mut gradients = vec![[[0.0; 2]; 2]; rows.len()];
    for end in 0..2 {
        for axis in 0..2 {
            let displace = |row: &LinkRow| {
                let mut displaced = *row;
                let place = if end == 0 { &mut displaced.tx_m } else { &mut displaced.rx_m };
                place[axis] += STEP_M;
                displaced
            };
            let displaced = rows.iter().map(displace).enumerate().collect();
            let (_, levels) = evidence.predicted(displaced)?;
            for (row, (displaced, level)) in levels.iter().zip(&evidence.levels).enumerate() {
                if moving[row][end] {
                    let slope = (displaced.power_dbm - level.power_dbm) / STEP_M;
                    gradients[row][end][axis] = if slope.is_finite() { slope } else { 0.0 };
                }
            }
        }
    }
    Some(gradients)
}

/// Sum of the log densities of readings (nats), and the variance (dB²) of each class that is likeliest with so much position noise
/// (m): by fixed-point steps of the equation of the score.
fn fitted(readings: &[&Reading], sd_m: f64) -> [f64; 3] {
    let mut variances = [0.0; 3];
    for (class, variance) in variances.iter_mut().enumerate() {
        let of_class: Vec<&&Reading> =
            readings.iter().filter(|reading| reading.n_moving == class).collect();
        let n = of_class.len() as f64;
        *variance = of_class.iter().map(|reading| square(reading.residual_db)).sum::<f64>() / n;
        // Without position noise the likeliest variance is the mean square, and nothing is iterated.
        if of_class.is_empty() || sd_m == 0.0 {
            *variance = if of_class.is_empty() { 1.0 } else { variance.max(LEAST_VARIANCE) };
            continue;
        }
        for _ in 0..30 {
            let (mut weights, mut sum) = (0.0, 0.0);
            for reading in &of_class {
                let position = square(sd_m) * reading.gradient;
                let weight = 1.0 / square(*variance + position);
                weights += weight;
                sum += weight * (square(reading.residual_db) - position);
            }
            *variance = (sum / weights).max(LEAST_VARIANCE);
        }
    }
    variances
}

/// The noise has at least this variance (dB²).
const LEAST_VARIANCE: f64 = 0.04;

fn log_density(reading: &Reading, variances: &[f64; 3], sd_m: f64) -> f64 {
    let variance = variances[reading.n_moving] + square(sd_m) * reading.gradient;
    -0.5 * (libm::log(variance) + square(reading.residual_db) / variance)
}

/// Log likelihood of readings (nats) with so much position noise (m), all variances fitted.
fn log_likelihood(readings: &[&Reading], sd_m: f64) -> f64 {
    let variances = fitted(readings, sd_m);
    readings.iter().map(|reading| log_density(reading, &variances, sd_m)).sum()
}

fn sds_m() -> Vec<f64> {
    let (first, factor, n) = SDS_M;
    (0..n).map(|k| first * libm::pow(factor, f64::from(k))).collect()
}

/// The likeliest position noise (m) and its log likelihood.
fn likeliest(readings: &[&Reading]) -> (f64, f64) {
    let trials = sds_m().into_iter().map(|sd_m| (sd_m, log_likelihood(readings, sd_m)));
    trials.fold(
        (0.0, log_likelihood(readings, 0.0)),
        |best, it| if best.1 < it.1 { it } else { best },
    )
}

/// The p-value of the gain on readings left out, fold by fold.
fn p_value(readings: &[Reading], n_folds: usize) -> f64 {
    let mut gains = Vec::with_capacity(readings.len());
    for fold in 0..n_folds {
        let (test, train): (Vec<&Reading>, Vec<&Reading>) =
            readings.iter().partition(|reading| reading.fold == fold);
        if train.is_empty() {
            return 1.0;
        }
        let (sd_m, _) = likeliest(&train);
        let (with, without) = (fitted(&train, sd_m), fitted(&train, 0.0));
        gains.extend(test.iter().map(|reading| {
            let gain = log_density(reading, &with, sd_m) - log_density(reading, &without, 0.0);
            (reading.block, gain)
        }));
    }
    p_value_by_blocks(gains)
}

/// The p-value of the covariance of receivers in opposite directions, and the number of pairs. A pair's residuals are taken from the
/// mean of the other rows of the frame, so that what all have in common makes products positive, and these are negative. Each product is
/// weighted by the covariance that position noise gives it, over both variances (dB²).
fn opposite(
    evidence: &Evidence<'_>,
    gradients: &[[[f64; 2]; 2]],
    variances: &BTreeMap<usize, f64>,
) -> (f64, usize) {
    let rows = evidence.rows();
    let mut frames: BTreeMap<(u32, u64, u32), Vec<usize>> = BTreeMap::new();
    for row in evidence.received() {
        // Only a sender that moves has an error of position that its receivers share.
        if gradients[row][0] != [0.0; 2] {
            let key = (rows[row].run, rows[row].time_s.to_bits(), rows[row].tx);
            frames.entry(key).or_default().push(row);
        }
    }
    let mut products = Vec::new();
    let mut n_pairs = 0;
    for frame in frames.values().filter(|frame| 2 + FEWEST_OTHER_RECEIVERS <= frame.len()) {
        let total: f64 = frame.iter().map(|&row| evidence.residual_db(row)).sum();
        for (index, &one) in frame.iter().enumerate() {
            for &other in &frame[index + 1..] {
                let [a, b] = [one, other].map(|row| gradients[row][0]);
                let dot = a[0] * b[0] + a[1] * b[1];
                let size = libm::hypot(a[0], a[1]) * libm::hypot(b[0], b[1]);
                // Only receivers on opposite sides get errors of opposite sign, which nothing else causes.
                if OPPOSITE_COSINE * size < dot {
                    continue;
                }
                let [first_db, second_db] = [one, other].map(|row| evidence.residual_db(row));
                let mean = (total - first_db - second_db) / (frame.len() - 2) as f64;
                n_pairs += 1;
                let block = evidence.blocks().dependent()[one];
                let weight = dot / (variances[&one] * variances[&other]);
                products.push((block, weight * (first_db - mean) * (second_db - mean)));
            }
        }
    }
    (p_value_by_blocks(products), n_pairs)
}

/// The 90 % interval of the position noise by its profile (m).
fn interval(readings: &[&Reading], sd_m: f64, top: f64) -> (f64, f64) {
    let is_likely = |sd_m: f64| top - log_likelihood(readings, sd_m) < FALL_90_NATS;
    let end = |outside_m: f64| bisection(sd_m, outside_m, 30, is_likely);
    (end(0.0), end(4.0 * sd_m))
}

/// What the variance of readings depends on, and how, if positions are noisy.
struct Noise {
    readings: Vec<Reading>,
    gradients: Vec<[[f64; 2]; 2]>,
    sd_m: f64,
    top: f64,
    variances: [f64; 3],
}

impl Noise {
    /// `None`: no node moves, too few rows have an end that moves, or there is no position noise at all.
    fn fitted(evidence: &Evidence<'_>) -> Option<Self> {
        let is_still = evidence.modelled().still().values().all(|&still| still);
        if !evidence.has_single_frames() || is_still {
            return None;
        }
        let gradients = gradients(evidence)?;
        let moving = evidence.study.moving();
        let blocks = evidence.blocks();
        let reading = |row: usize| Reading {
            row,
            block: blocks.dependent()[row],
            fold: blocks.fold(row as u32),
            residual_db: evidence.residual_db(row),
            n_moving: moving[row].iter().filter(|&&moves| moves).count(),
            gradient: gradients[row].as_flattened().iter().map(|slope| square(*slope)).sum(),
        };
        let readings: Vec<Reading> = evidence.received().map(reading).collect();
        if readings.iter().filter(|reading| 0 < reading.n_moving).count() < FEWEST_MOVING_READINGS {
            return None;
        }
        let all: Vec<&Reading> = readings.iter().collect();
        let (sd_m, top) = likeliest(&all);
        let variances = fitted(&all, sd_m);
        (0.0 < sd_m).then_some(Self { readings, gradients, sd_m, top, variances })
    }

    /// The variance of a reading by its position (dB²).
    fn by_position(&self, reading: &Reading) -> f64 {
        square(self.sd_m) * reading.gradient
    }
}

/// By how many times the standard deviation of each row's reading exceeds that of the noise alone, if positions are as noisy as is
/// likeliest: 1 where they are not.
#[must_use]
pub fn widening(evidence: &Evidence<'_>) -> Vec<f64> {
    let mut factors = vec![1.0; evidence.rows().len()];
    if let Some(noise) = Noise::fitted(evidence) {
        for reading in &noise.readings {
            let alone = noise.variances[reading.n_moving];
            factors[reading.row] = (1.0 + noise.by_position(reading) / alone).sqrt();
        }
    }
    factors
}

/// Looks for noise of positions.
#[must_use]
pub fn test(evidence: &Evidence<'_>) -> Option<Defect> {
    let noise = Noise::fitted(evidence)?;
    let Noise { readings, gradients, sd_m, top, variances } = &noise;
    let sd_m = *sd_m;
    let of_row = |it: &Reading| (it.row, variances[it.n_moving] + noise.by_position(it));
    let of_row: BTreeMap<usize, f64> = readings.iter().map(of_row).collect();
    let (by_pairs, n_pairs) = opposite(evidence, gradients, &of_row);
    // Few receivers hear a frame in opposite directions: then the test of variances decides alone.
    let by_pairs = if FEWEST_OPPOSITE_PAIRS <= n_pairs { by_pairs } else { 0.0 };
    let by_variance = p_value(readings, evidence.blocks().n_folds());
    tracing::debug!(sd_m, by_variance, by_pairs, n_pairs, "position noise");
    let share =
        readings.iter().map(|it| noise.by_position(it)).sum::<f64>() / evidence.squared_error();
    // Rows whose position tells less than their reading.
    let is_worse = |it: &&Reading| variances[it.n_moving] < noise.by_position(it);
    let left_out: Vec<u32> = readings.iter().filter(is_worse).map(|it| it.row as u32).collect();
    let concerned = || readings.iter().filter(|reading| 0 < reading.n_moving);
    let all: Vec<&Reading> = readings.iter().collect();
    let (low, high) = interval(&all, sd_m, *top);
    Some(Defect {
        name: NAME,
        p_value: by_variance.max(by_pairs),
        share,
        estimates: vec![Estimate::new("sd_m", "m", sd_m, (low, high))],
        nodes: Vec::new(),
        runs: Vec::new(),
        n_rows: concerned().count(),
        first_line: concerned().map(|it| evidence.rows()[it.row].line).min()?,
        clause: format!("positions of moving nodes are off by {sd_m:.2} m (standard deviation)"),
        correction: Correction {
            refusal: Some("the true positions are unknown"),
            ..Correction::leaving_out(left_out)
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::rng::{Draws, Purpose};

    /// Readings with 1 dB of noise, gradients up to 2 dB/m and positions off by `sd_m`.
    fn readings(sd_m: f64) -> Vec<Reading> {
        let draws = Draws::new(5, Purpose::FrameNoise);
        (0..2000)
            .map(|k| {
                let slope = 0.02 * (k % 100) as f64;
                let [noise, off_m] = [0, 1].map(|of| draws.normal(k, 0, of));
                Reading {
                    row: k as usize,
                    block: (k / 40) as u32,
                    fold: (k / 40 % 5) as usize,
                    residual_db: noise + slope * sd_m * off_m,
                    n_moving: 1,
                    gradient: square(slope),
                }
            })
            .collect()
    }

    #[test]
    fn position_noise_is_found_with_its_size() {
        let readings = readings(1.0);
        let all: Vec<&Reading> = readings.iter().collect();
        assert!(p_value(&readings, 5) < 1e-6);
        let (sd_m, top) = likeliest(&all);
        let (low, high) = interval(&all, sd_m, top);
        assert!(low < 1.0 && 1.0 < high && high - low < 0.3, "{low} {sd_m} {high}");
    }

    #[test]
    fn without_it_nothing_is_gained() {
        assert!(0.05 < p_value(&readings(0.0), 5));
    }
}
