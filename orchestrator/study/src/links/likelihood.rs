//! How likely a row is under a model: the likelihood of the instrument, lost frames and rounding included.

use crate::RowScore;
use crate::thresholds::STRAY_FRAMES;
use density::FadingDensity;
use measure::links::{LinkRow, Losses, Readings};
use reception::{AveragedCurve, PowerMixture, SampledCurve};
use register::{PowerRange, width_db};

/// Prediction of a row by a model: received power, register and loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowPrediction {
    /// Mean power at the receiver (dBm).
    pub power_dbm: f64,
    /// Bias of the register at that power (dB).
    pub register_db: f64,
    /// The range of powers that gives the row's reading.
    pub range: PowerRange,
    /// By how much the reception curve is shifted (dB).
    pub shift_db: f64,
    /// Logarithm of the probability that nothing but weakness loses a frame.
    pub ln_survival: f64,
    /// Probability of reception, where the base model states it.
    pub stated: Option<f64>,
}

/// Response of a register: the reading (dBm) at a power (dBm).
pub type RegisterResponse<'a> = &'a dyn Fn(f64) -> f64;

/// Log likelihood of a row, and its derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RowLikelihood {
    /// Log likelihood (nats).
    pub log: f64,
    /// Its derivative over the mean level (1/dB).
    pub over_level: f64,
    /// Minus its second derivative over the mean level (1/dB²), never negative.
    pub weight: f64,
    /// Its derivative over the logarithm of the noise's standard deviation.
    pub over_ln_sd: f64,
    /// Its derivative over the logarithm of the standard deviation of rows of several frames about their mean level.
    pub over_ln_link_sd: f64,
}

/// How frames vary about the mean level, and which of them pass.
#[derive(Clone, Debug)]
pub struct Instrument {
    /// Standard deviation of the noise (dB).
    pub sd_db: f64,
    /// The spread of the power about its mean level.
    pub spread: PowerMixture,
    /// Probability of reception over received power.
    pub curve: SampledCurve,
    /// It averaged over the noise.
    pub averaged: AveragedCurve,
    /// What a row is: one frame, or several that are summed up.
    pub readings: Readings,
    /// Standard deviation (dB) of the level that such frames share; without meaning for single frames.
    pub link_sd_db: f64,
    /// Standard deviation of the share of frames received about the curve, chance apart, where readings are given.
    pub share_sd: f64,
    /// The same with frames that vary a little more, where derivatives are asked for.
    pub wider: Option<Box<Self>>,
    /// What frames do at every level, where rows sum them up and losses are known.
    pub tabulated: Option<tables::FrameTable>,
    /// Likelihood of rows without a received frame, for the usual numbers of frames sent.
    pub silent: Vec<tables::SilentRowTable>,
    /// How readings lie about their mean, and strengths before they are rounded.
    of_reading: FadingDensity,
    of_strength: FadingDensity,
    /// All deviations of strengths from their mean (dB) on a grid, with their weights: what a received row reads is averaged over these.
    deviations: Vec<(f64, f64)>,
    /// How much less likely a strength is at each of the places looked at than at the middle, where the middle is likeliest.
    falls: [f64; 4],
}

mod aggregated;
mod density;
pub mod reception;
mod reception_share;
pub mod register;
mod tables;

/// Between two points a step apart, each with its value and slope.
fn cubic(part: f64, step: f64, a: [f64; 2], b: [f64; 2]) -> f64 {
    let (rise, rest) = (b[0] - a[0], 1.0 - part);
    let bend = rest * (a[1] * step - rise) - part * (b[1] * step - rise);
    a[0] + part * rise + part * rest * bend
}

/// What varies beside everything that has a cause (standard deviations).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Noise {
    /// From frame to frame (dB).
    pub sd_db: f64,
    /// From row to row, where rows sum up several frames (dB).
    pub link_sd_db: f64,
    /// Of the share of frames received, from row to row, where readings are given.
    pub share_sd: f64,
}

/// Where strengths that are rounded to one reading are looked at (steps of the readings).
const OFFSETS: [f64; 4] = [-0.375, -0.125, 0.125, 0.375];

/// Points and weights of Gauss and Legendre (Abramowitz and Stegun, table 25.4, n = 16), each for both signs.
const LEGENDRE: [(f64, f64); 8] = [
    (0.095_012_509_837_637_4, 0.189_450_610_455_068_5),
    (0.281_603_550_779_258_9, 0.182_603_415_044_923_6),
    (0.458_016_777_657_227_4, 0.169_156_519_395_002_5),
    (0.617_876_244_402_643_7, 0.149_595_988_816_576_7),
    (0.755_404_408_355_003, 0.124_628_971_255_533_9),
    (0.865_631_202_387_831_7, 0.095_158_511_682_492_8),
    (0.944_575_023_073_232_6, 0.062_253_523_938_647_9),
    (0.989_400_934_991_649_9, 0.027_152_459_411_754_1),
];
/// Strengths do not lie further from their mean than this, beyond the levels of their spread (standard deviations of the noise).
const REACH_SD: f64 = 8.0;
/// Beyond that they are so dense only at the near end of a range (standard deviations of the noise).
const THERE_SD: f64 = 2.0;

/// The weight of a reading of a received frame is at least this share of that without the condition that it was received, so that
/// Newton's method takes steps.
const LEAST_WEIGHT: f64 = 0.05;

/// Beyond this ratio (nats) of densities at two of these places next to the middle, products of ratios may overflow.
const MOST_TILT: f64 = 100.0;

/// The grid over which a reading is averaged: its step, and how far it reaches beyond the levels of the spread (standard deviations of
/// the noise).
const READING_STEP_SD: f64 = 1.0 / 3.0;
const READING_REACH_SD: f64 = 4.0;

impl Instrument {
    /// Of a curve of reception and what varies, nothing tabulated.
    #[must_use]
    pub fn new(
        curve: SampledCurve,
        spread: PowerMixture,
        noise: Noise,
        readings: Readings,
    ) -> Self {
        let Noise { sd_db, link_sd_db, share_sd } = noise;
        let averaged = curve.averaged(sd_db, &spread);
        let reading_variance = sd_db * sd_db + readings.quantum_db * readings.quantum_db / 12.0;
        let density =
            |variance: f64| FadingDensity::new(&spread, variance, sd_db, !readings.is_aggregated);
        let falls = OFFSETS.map(|offset| {
            let z = offset * readings.quantum_db / sd_db;
            libm::exp(-0.5 * z * z)
        });
        Self {
            falls,
            of_reading: density(reading_variance),
            of_strength: density(sd_db * sd_db),
            deviations: spread.grid(sd_db, READING_STEP_SD, READING_REACH_SD),
            sd_db,
            spread,
            curve,
            averaged,
            readings,
            link_sd_db,
            share_sd,
            wider: None,
            tabulated: None,
            silent: Vec::new(),
        }
    }

    /// Its noise.
    #[must_use]
    pub fn noise(&self) -> Noise {
        Noise { sd_db: self.sd_db, link_sd_db: self.link_sd_db, share_sd: self.share_sd }
    }

    /// With another noise, nothing tabulated.
    #[must_use]
    pub fn with_sd(&self, sd_db: f64) -> Self {
        let noise = Noise { sd_db, ..self.noise() };
        Self::new(self.curve.clone(), self.spread.clone(), noise, self.readings)
    }

    /// As [`FadingDensity::log_density_at`], of all strengths about `power_dbm` that are rounded to the same reading, each by the probability
    /// that such a frame passes.
    fn rounded(&self, power_dbm: f64, deviation_db: f64) -> RowLikelihood {
        // A single level leaves a normal density, of which all places follow from one exponential.
        if let [(level, _)] = self.spread.0[..] {
            let deviation_db = deviation_db - level;
            let variance = self.of_strength.variance();
            let tilt = -deviation_db * OFFSETS[2] * self.readings.quantum_db / variance;
            if tilt.abs() < MOST_TILT {
                return self.rounded_normal(power_dbm, deviation_db, tilt);
            }
        }
        self.mixture(OFFSETS.map(|offset| {
            let offset_db = offset * self.readings.quantum_db;
            let passes = self.curve.probability_at(power_dbm + offset_db);
            (deviation_db + offset_db, passes / OFFSETS.len() as f64)
        }))
    }

    /// As [`Self::rounded`], of all strengths in a range that is `stretch` times as wide as the step of readings, about one
    /// `deviation_db` from the mean; each by the probability that such a frame passes, if `by_curve`, at `power_dbm` in the middle.
    fn bent(
        &self,
        power_dbm: f64,
        deviation_db: f64,
        stretch: f64,
        by_curve: bool,
    ) -> RowLikelihood {
        let quantum_db = width_db(self.readings.quantum_db);
        let half_db = 0.5 * stretch * quantum_db;
        let (from_db, to_db) = (deviation_db - half_db, deviation_db + half_db);
        // No further than there is anything; out there where it is most.
        let (reach_db, there_db) = (REACH_SD * self.sd_db, THERE_SD * self.sd_db);
        let (least_db, most_db) =
            (self.spread.least() - reach_db, self.spread.greatest() + reach_db);
        let low_db = from_db.max(least_db.min(to_db - there_db));
        let high_db = to_db.min(most_db.max(from_db + there_db));
        let (middle_db, half_db) = (0.5 * (low_db + high_db), 0.5 * (high_db - low_db));
        let points: [(f64, f64); 2 * LEGENDRE.len()] = std::array::from_fn(|i| {
            let (place, weight) = LEGENDRE[i / 2];
            (if i % 2 == 0 { place } else { -place }, weight)
        });
        self.mixture(points.map(|(place, weight)| {
            let at_db = middle_db + half_db * place;
            let passes = if by_curve {
                self.curve.probability_at(power_dbm + at_db - deviation_db)
            } else {
                1.0
            };
            (at_db, weight * passes * half_db / quantum_db)
        }))
    }

    /// As [`FadingDensity::log_density_at`], of a weighted mixture of several deviations.
    fn mixture<const N: usize>(&self, points: [(f64, f64); N]) -> RowLikelihood {
        let parts = points
            .map(|(deviation_db, weight)| (self.of_strength.log_density_at(deviation_db), weight));
        let greatest =
            parts.iter().fold(f64::NEG_INFINITY, |greatest, (part, _)| greatest.max(part.log));
        let (mut total, mut sum, mut squares) = (0.0, RowLikelihood::default(), 0.0);
        for (part, weight) in &parts {
            let share = weight * libm::exp(part.log - greatest);
            total += share;
            sum.over_level += share * part.over_level;
            squares += share * part.over_level * part.over_level;
            sum.weight += share * part.weight;
            sum.over_ln_sd += share * part.over_ln_sd;
        }
        let (over_level, weight) = (sum.over_level / total, sum.weight / total);
        let spread = squares / total - over_level * over_level;
        RowLikelihood {
            log: greatest + libm::log(total),
            over_level,
            // The log density of a mixture may be convex between its parts, where Newton's method needs a positive weight, too.
            weight: (weight - spread).max(0.1 * weight),
            over_ln_sd: sum.over_ln_sd / total,
            over_ln_link_sd: 0.0,
        }
    }

    /// As [`Self::rounded`] where nothing varies but by normal noise: densities at places a step apart are in a constant ratio to each
    /// other, e^`tilt` at the first of them above the middle, but for one that does not depend on the deviation.
    fn rounded_normal(&self, power_dbm: f64, deviation_db: f64, tilt: f64) -> RowLikelihood {
        let variance = self.of_strength.variance();
        let up = libm::exp(tilt);
        let ratios = [1.0 / (up * up * up), 1.0 / up, up, up * up * up];
        let (mut total, mut first, mut second) = (0.0, 0.0, 0.0);
        for ((offset, ratio), falls) in OFFSETS.iter().zip(ratios).zip(self.falls) {
            let offset_db = offset * self.readings.quantum_db;
            let share = ratio * falls * self.curve.probability_at(power_dbm + offset_db);
            let deviation_db = deviation_db + offset_db;
            total += share;
            first += share * deviation_db;
            second += share * deviation_db * deviation_db;
        }
        let (mean, square) = (first / total, second / total);
        RowLikelihood {
            log: self.of_strength.ln_peak() - 0.5 * deviation_db * deviation_db / variance
                + libm::log(total / OFFSETS.len() as f64),
            over_level: mean / variance,
            weight: (1.0 / variance - (square - mean * mean) / (variance * variance))
                .max(0.1 / variance),
            over_ln_sd: square / variance - 1.0,
            over_ln_link_sd: 0.0,
        }
    }

    /// Log likelihood of a sample: one frame, received or lost. `blup_db`: its random effects, which are added to the level.
    #[must_use]
    pub fn row_likelihood(
        &self,
        row: &LinkRow,
        level: &RowPrediction,
        blup_db: f64,
    ) -> RowLikelihood {
        if self.readings.is_given {
            return self.share_likelihood(row, level);
        }
        if self.readings.is_aggregated {
            return self.aggregated_likelihood(row, level, blup_db);
        }
        let is_received = row.received == 1.0;
        let PowerRange { offset_db, stretch } = level.range;
        let deviation = row.rssi_dbm - level.power_dbm - offset_db - blup_db;
        let mut slope = RowLikelihood::default();
        if is_received {
            let by_curve = self.readings.is_of_received() && level.stated.is_none();
            let power_dbm = row.rssi_dbm - offset_db - level.shift_db;
            let is_bent = stretch != 1.0;
            let is_cut =
                by_curve && !self.curve.is_level(power_dbm, 0.5 * self.readings.quantum_db);
            slope = match (is_bent, is_cut) {
                (true, _) => self.bent(power_dbm, deviation, stretch, by_curve),
                (false, true) => self.rounded(power_dbm, deviation),
                // Where the curve is level, all strengths that are rounded to one reading pass alike.
                (false, false) => self.of_reading.log_density_at(deviation),
            };
            let is_weighted = is_bent && by_curve || is_cut;
            if self.readings.losses == Losses::NotLogged && by_curve {
                if !is_weighted {
                    slope.log += self.curve.ln_at(power_dbm);
                }
                return self.given_reception(slope, level.power_dbm + blup_db - level.shift_db);
            }
            if is_weighted {
                slope.log += level.ln_survival;
                return slope;
            }
        }
        if !self.readings.has_losses() {
            return slope;
        }
        if let Some(stated) = level.stated {
            let passes =
                (stated * libm::exp(level.ln_survival)).clamp(STRAY_FRAMES, 1.0 - STRAY_FRAMES);
            slope.log += if is_received { libm::log(passes) } else { libm::log(1.0 - passes) };
        } else if is_received {
            let power_dbm = row.rssi_dbm - offset_db;
            slope.log += self.curve.ln_at(power_dbm - level.shift_db) + level.ln_survival;
        } else {
            let chance = self.averaged.reception_at(level.power_dbm + blup_db - level.shift_db);
            let survival =
                if level.ln_survival == 0.0 { 1.0 } else { libm::exp(level.ln_survival) };
            let lost = 1.0 - survival * chance.passes;
            let first = -survival * chance.slope / lost;
            slope.log = libm::log(lost);
            slope.over_level = first;
            slope.weight =
                (survival * chance.bend / lost + first * first).max(0.25 * first * first);
            slope.over_ln_sd = -survival * chance.over_ln_sd / lost;
        }
        slope
    }

    /// The log likelihood of a reading together with reception, under the condition that the frame was received: what else may lose
    /// frames counts in neither. `dbm`: where on the curve the mean level lies.
    fn given_reception(&self, joint: RowLikelihood, dbm: f64) -> RowLikelihood {
        let chance = self.averaged.reception_at(dbm);
        let first = chance.slope / chance.passes;
        RowLikelihood {
            log: joint.log - libm::log(chance.passes),
            over_level: joint.over_level - first,
            // Far below the curve all that is received is alike, and tells little of the level.
            weight: (joint.weight + chance.bend / chance.passes - first * first)
                .max(LEAST_WEIGHT * joint.weight),
            over_ln_sd: joint.over_ln_sd - chance.over_ln_sd / chance.passes,
            ..joint
        }
    }

    /// Probability that a frame at this level is received.
    #[must_use]
    pub fn reception(&self, level: &RowPrediction, blup_db: f64) -> f64 {
        let survival = libm::exp(level.ln_survival);
        let passes = match level.stated {
            Some(stated) => stated.clamp(STRAY_FRAMES, 1.0 - STRAY_FRAMES),
            None => self.averaged.reception_at(level.power_dbm + blup_db - level.shift_db).passes,
        };
        survival * passes
    }

    /// What a received row should read (dBm), and the standard deviation of that (dB). `read`: what its register reads, where it
    /// does more than shift.
    #[must_use]
    pub fn reading(
        &self,
        level: &RowPrediction,
        blup_db: f64,
        read: Option<RegisterResponse<'_>>,
    ) -> (f64, f64) {
        let mean = level.power_dbm + level.register_db + blup_db;
        let by_curve = level.stated.is_none() && self.readings.is_of_received();
        if !by_curve && read.is_none() {
            let shift: f64 = self.spread.0.iter().map(|(level, p)| level * p).sum();
            return (mean + shift, (self.of_reading.variance() + self.spread.variance()).sqrt());
        }
        // Frames that pass are stronger than those sent: moments over what passes.
        let power = level.power_dbm + blup_db;
        let (mut total, mut first, mut second) = (0.0, 0.0, 0.0);
        for &(deviation, weight) in &self.deviations {
            let passes = if by_curve {
                self.curve.probability_at(power + deviation - level.shift_db)
            } else {
                1.0
            };
            let away = read.map_or(deviation, |read| read(power + deviation) - mean);
            let part = weight * passes;
            total += part;
            first += part * away;
            second += part * away * away;
        }
        let (shift, square) = (first / total, second / total);
        let variance = (square - shift * shift).max(0.0)
            + self.readings.quantum_db * self.readings.quantum_db / 12.0;
        (mean + shift, variance.sqrt())
    }
}

impl Instrument {
    /// Scores the prediction of a sample.
    #[must_use]
    pub fn score(
        &self,
        row: &LinkRow,
        level: &RowPrediction,
        blup_db: f64,
        read: Option<RegisterResponse<'_>>,
    ) -> RowScore {
        let mut score = RowScore {
            log: self.row_likelihood(row, level, blup_db).log,
            squared_error: f64::NAN,
            plain_squared_error: f64::NAN,
            heading_squared_error_rad2: f64::NAN,
            log_of_position: f64::NAN,
            crps: f64::NAN,
            reception_log_loss: f64::NAN,
        };
        if row.rssi_dbm.is_finite() {
            let (mean, sd) = self.reading(level, blup_db, read);
            let deviation = row.rssi_dbm - mean;
            score.squared_error = deviation * deviation;
            score.crps = normal_crps(deviation, sd);
        }
        if self.readings.has_losses() && row.received.is_finite() {
            let passes = self.reception(level, blup_db).clamp(1e-9, 1.0 - 1e-9);
            score.reception_log_loss =
                if row.received == 1.0 { -libm::log(passes) } else { -libm::log(1.0 - passes) };
        }
        score
    }
}

/// Continuous ranked probability score of a normal prediction (Gneiting and Raftery 2007, § 4.2).
#[must_use]
pub fn normal_crps(deviation: f64, sd: f64) -> f64 {
    let z = deviation / sd;
    let density = libm::exp(-0.5 * z * z) / std::f64::consts::TAU.sqrt();
    let below = 0.5 * libm::erfc(-z / std::f64::consts::SQRT_2);
    sd * (z * (2.0 * below - 1.0) + 2.0 * density - 1.0 / std::f64::consts::PI.sqrt())
}

#[cfg(test)]
pub(crate) mod tests;
