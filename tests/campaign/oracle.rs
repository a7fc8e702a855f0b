//! How well the true model predicts a link campaign.
//!
//! Of a random effect the true model knows the variances, not the values: these it learns from the rows of other times, 40
//! blocks of time dealt to five folds.

use super::Scores;
use super::draws::Draws;
use super::effect::{Change, Curve, Random};
use super::link::{Air, Law, bisected, loss};
use super::posterior::{Evidence, foretold};
use super::radio;
use std::f64::consts::TAU;

/// The scores of the model that has these changes.
pub(crate) fn scores(
    air: &Air,
    changes: &[&Change],
    tx_power_dbm: f64,
    readings: &[Option<f64>],
) -> Scores {
    let (world, law) = (&air.world, Law::combine(changes));
    let random: Vec<Random> = changes.iter().filter_map(|change| change.random).collect();
    let fading = fading_levels(&random);
    let known: Vec<f64> =
        (0..world.rows.len()).map(|row| tx_power_dbm + air.known_level(changes, row)).collect();
    let parts = parts(air, &random, law, changes, &known, readings);
    let mut sums = [0.0; 4];
    let mut n_received = 0;
    for (row, reading) in readings.iter().enumerate() {
        let (mean_db, variance) = parts[row];
        let sd_db = (air.noise_sd_db.powi(2) + variance).sqrt();
        let foretold = Foretold::integrate(
            known[row] + mean_db,
            sd_db,
            &fading,
            law,
            1.0 - loss(changes, row),
        );
        match reading {
            Some(reading) => {
                n_received += 1;
                sums[0] += foretold.probability(*reading).ln();
                sums[1] += (reading - foretold.mean_dbm()).powi(2);
                sums[2] += foretold.crps(*reading);
                sums[3] -= foretold.received.ln();
            }
            None => {
                sums[0] += (1.0 - foretold.received).max(1e-12).ln();
                sums[3] -= (1.0 - foretold.received).max(1e-12).ln();
            }
        }
    }
    let n_rows = readings.len() as f64;
    Scores {
        log_score: sums[0] / n_rows,
        rmse: (sums[1] / f64::from(n_received)).sqrt(),
        crps: sums[2] / f64::from(n_received),
        reception_log_loss: Some(sums[3] / n_rows),
    }
}

/// What is foretold of the random part of each row: its mean (dB) and variance (dB²).
fn parts(
    air: &Air,
    random: &[Random],
    law: Law,
    changes: &[&Change],
    known_dbm: &[f64],
    readings: &[Option<f64>],
) -> Vec<(f64, f64)> {
    if random.iter().all(|part| matches!(part, Random::Fading(_))) {
        return vec![(0.0, 0.0); known_dbm.len()];
    }
    let world = &air.world;
    // Fading stands beside noise in what a row tells; its scatter is taken as Gaussian here.
    let fading = fading_levels(random);
    let faded_db = crate::statistics::mean(&fading);
    let fading_variance =
        fading.iter().map(|level| (level - faded_db).powi(2)).sum::<f64>() / fading.len() as f64;
    let variance = air.noise_sd_db.powi(2) + fading_variance + 1.0 / 12.0;
    let reception = Reception::new(law.curve, variance.sqrt());
    let block_s = world.duration_s / 40.0;
    let folds: Vec<usize> = {
        let mut draws = Draws::new(1, "folds");
        let order = draws.order(40);
        let block = |time_s: f64| ((time_s / block_s) as usize).min(39);
        world.rows.iter().map(|row| order[block(row.time_s)] % 5).collect()
    };
    foretold(world, random, &folds, |row, part_db| match readings[row] {
        // The reception of what was read does not depend on the part.
        Some(reading) => Evidence {
            at_db: law.register.power(reading) - faded_db - known_dbm[row],
            weight: 1.0 / variance,
        },
        None => {
            let passes = 1.0 - loss(changes, row);
            let lost = |off_db: f64| {
                let mean_dbm = known_dbm[row] + part_db + faded_db + off_db;
                (1.0 - passes * reception.probability(mean_dbm)).max(1e-9).ln()
            };
            let [below, here, above] = [-0.5, 0.0, 0.5].map(lost);
            let weight = (4.0 * (2.0 * here - below - above)).max(1e-6);
            Evidence { at_db: part_db + (above - below) / weight, weight }
        }
    })
}

/// Levels (dB) of equal probability that stand for the fading: the power of a Rician channel has the law of the squared
/// length of a plane Gaussian vector off the origin, which is drawn by a fixed grid of its two coordinates.
fn fading_levels(random: &[Random]) -> Vec<f64> {
    let k_factor_db = random
        .iter()
        .find_map(|part| if let Random::Fading(k_db) = part { Some(*k_db) } else { None });
    let Some(k_factor_db) = k_factor_db else { return vec![0.0] };
    const N: usize = 24;
    let normals: Vec<f64> = (0..N).map(|k| normal_quantile((k as f64 + 0.5) / N as f64)).collect();
    let mut levels: Vec<f64> = normals
        .iter()
        .flat_map(|&x| normals.iter().map(move |&y| radio::rician_db(k_factor_db, [x, y])))
        .collect();
    levels.sort_by(f64::total_cmp);
    // As many as make steps that vanish behind the noise.
    levels.chunks(12).map(|chunk| chunk.iter().sum::<f64>() / chunk.len() as f64).collect()
}

/// Reception over the mean power of a row, its noise averaged over.
struct Reception {
    table: Vec<f64>,
}

impl Reception {
    const FROM_DBM: f64 = -200.0;
    const STEP_DB: f64 = 0.1;

    fn new(curve: Curve, sd_db: f64) -> Self {
        let nodes: Vec<f64> =
            (0..200).map(|k| normal_quantile((f64::from(k) + 0.5) / 200.0)).collect();
        let mean_probability = |mean_dbm: f64| {
            let sum: f64 = nodes.iter().map(|z| curve.probability(mean_dbm + sd_db * z)).sum();
            sum / nodes.len() as f64
        };
        let table = (0..3000)
            .map(|k| mean_probability(Self::FROM_DBM + Self::STEP_DB * f64::from(k)))
            .collect();
        Self { table }
    }

    fn probability(&self, mean_dbm: f64) -> f64 {
        let place = (mean_dbm - Self::FROM_DBM) / Self::STEP_DB;
        let place = place.clamp(0.0, self.table.len() as f64 - 1.001);
        let below = place as usize;
        let share = place - below as f64;
        self.table[below] * (1.0 - share) + self.table[below + 1] * share
    }
}

/// What is foretold of a row.
struct Foretold {
    /// The lowest reading (dBm).
    from_dbm: f64,
    /// Probability of each reading from there on, of a frame that is received.
    cells: Vec<f64>,
    /// Probability of reception.
    received: f64,
}

impl Foretold {
    fn integrate(mean_dbm: f64, sd_db: f64, fading: &[f64], law: Law, passes: f64) -> Self {
        let lowest = fading.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = fading.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        // Below -120 dBm nothing is received.
        let from_dbm = law.register.reading((mean_dbm + lowest - 7.0 * sd_db).max(-120.0)).round();
        let to_dbm = law.register.reading(mean_dbm + highest + 7.0 * sd_db).round();
        let n_cells = (to_dbm - from_dbm).max(0.0) as usize + 1;
        let density = |power_dbm: f64| {
            let one = |level: &f64| {
                let z = (power_dbm - mean_dbm - level) / sd_db;
                if 8.0 < z.abs() { 0.0 } else { (-0.5 * z * z).exp() }
            };
            fading.iter().map(one).sum::<f64>() / (fading.len() as f64 * sd_db * TAU.sqrt())
        };
        let cells: Vec<f64> = (0..n_cells)
            .map(|k| {
                let reading = from_dbm + k as f64;
                let [low, high] = [-0.5, 0.5].map(|half| law.register.power(reading + half));
                // Gauss and Legendre with three points, over pieces of at most half a decibel.
                let n_pieces = ((high - low) / 0.5).ceil();
                let half = (high - low) / n_pieces / 2.0;
                let pieces = (0..n_pieces as usize).map(|piece| {
                    let middle = low + (2.0 * piece as f64 + 1.0) * half;
                    let weighted = |off: f64, weight: f64| {
                        let power_dbm = middle + off * half;
                        weight * density(power_dbm) * law.curve.probability(power_dbm)
                    };
                    let off = 0.6_f64.sqrt();
                    half * (weighted(-off, 5.0) + weighted(0.0, 8.0) + weighted(off, 5.0)) / 9.0
                });
                passes * pieces.sum::<f64>()
            })
            .collect();
        let received = cells.iter().sum::<f64>().clamp(1e-12, 1.0 - 1e-12);
        Self { from_dbm, cells, received }
    }

    /// Probability that a frame is received and this is read.
    fn probability(&self, reading_dbm: f64) -> f64 {
        let place = reading_dbm - self.from_dbm;
        let inside = 0.0 <= place && place < self.cells.len() as f64;
        (if inside { self.cells[place as usize] } else { 0.0 }).max(1e-12)
    }

    /// What a received frame reads in the mean.
    fn mean_dbm(&self) -> f64 {
        let each = self.cells.iter().enumerate();
        let sum: f64 = each.map(|(k, cell)| cell * (self.from_dbm + k as f64)).sum();
        sum / self.received
    }

    /// Continuous ranked probability score (dB) of what a received frame reads: Gneiting and Raftery 2007, eq. 20.
    fn crps(&self, reading_dbm: f64) -> f64 {
        let mut below = 0.0;
        let outside = (self.from_dbm - reading_dbm).max(0.0)
            + (reading_dbm - self.from_dbm - self.cells.len() as f64 + 1.0).max(0.0);
        let each = self.cells.iter().enumerate().map(|(k, cell)| {
            below += cell / self.received;
            let is_below = f64::from(u8::from(reading_dbm <= self.from_dbm + k as f64));
            (below - is_below).powi(2)
        });
        each.sum::<f64>() + outside
    }
}

/// Quantile of the standard normal distribution, by bisection.
fn normal_quantile(share: f64) -> f64 {
    bisected(-8.0, 8.0, 60, |z| normal_distribution(z) < share)
}

/// Standard normal distribution function, by Simpson's rule.
pub(crate) fn normal_distribution(z: f64) -> f64 {
    let n = 200;
    let step = z / f64::from(n);
    let density = |x: f64| (-0.5 * x * x).exp() / TAU.sqrt();
    let inner: f64 =
        (1..n).map(|k| (if k % 2 == 0 { 2.0 } else { 4.0 }) * density(f64::from(k) * step)).sum();
    0.5 + step / 3.0 * (density(0.0) + inner + density(z))
}
