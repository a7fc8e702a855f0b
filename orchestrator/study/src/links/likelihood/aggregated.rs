//! How likely a row of several frames is: their number received and their mean reading, the level of the link integrated out.
//!
//! Frames of one link and channel share a level. With the level u ~ N(μ, τ²), k frames sent and r received, p(u) the probability
//! that a frame passes, and the mean reading m normal about u + n(u), n(u) being the mean noise of received frames, with a variance of v(u)/r:
//!
//! ```text
//! L(μ) = ∫ N(u; μ, τ²) · Binomial(r; k, p(u)) · N(m; u + n(u), v(u)/r) du
//! ```
//!
//! Its derivatives over μ follow from the posterior moments of u: (E u − μ)/τ² and 1/τ² − Var u/τ⁴.

use super::Instrument;
use super::PowerRange;
use super::RegisterResponse;
use super::RowLikelihood;
use super::RowPrediction;
use super::tables::{FrameMoments, FrameTable, SilentRowTable};
use crate::RowScore;
use crate::thresholds::{FRAME_CORRELATION, MEAN_READING_SD_DB, STRAY_FRAMES};
use measure::links::LinkRow;
use numbers::optimise::newton::Newton;

/// The logarithm of the square of [`MEAN_READING_SD_DB`].
const LN_LEAST_VARIANCE: f64 = -2.407_945_608_651_872;
const LN_TAU: f64 = 1.837_877_066_409_345_5;
/// Points of an integral. It reaches on both sides to where the integrand has fallen by so much (nats).
const POINTS: usize = 25;
const REACH_NATS: f64 = 14.0;
/// A part of an integrand less than this share of the greatest is taken not to change with the noise.
const LEAST_PART: f64 = 1e-4;
/// Integrands narrower than this (standard deviations of the noise, over which chances of reception change) are summed at few
/// points: those of Gauss and Hermite with their weights (Abramowitz and Stegun, table 25.10), for unit width.
const NARROW: f64 = 0.4;
/// … if the outermost of them lie so much lower than the top (nats), as they do on a normal density: 7.
const OUTERMOST_NATS: f64 = 5.0;
const HERMITE: [(f64, f64); 7] = [
    (-3.750_439_717_725_742_5, 1.557_516_854_473_175_2),
    (-2.366_759_410_734_541_5, 1.268_810_629_590_737_8),
    (-1.154_405_394_739_968_2, 1.171_940_823_270_109_2),
    (0.0, 1.145_887_211_259_886_1),
    (1.154_405_394_739_968_2, 1.171_940_823_270_109_2),
    (2.366_759_410_734_541_5, 1.268_810_629_590_737_8),
    (3.750_439_717_725_742_5, 1.557_516_854_473_175_2),
];
/// Frames of levels this many standard deviations below the likeliest must pass alike for an integral in closed form.
const ALIKE_SD: f64 = 7.0;
/// The likelihood of rows without a received frame is tabulated so many standard deviations of their level beyond the curve, at
/// about so many points.
const SILENT_SD: f64 = 5.0;
const SILENT_POINTS: usize = 300;
/// Steps to the top of an integrand.
const TOP_STEPS: usize = 16;
/// By how much the spread of frames is changed for a derivative.
const WIDER: f64 = 1.02;

/// Frames sent and received in a row, and their mean reading.
#[derive(Clone, Copy)]
struct RowCounts {
    /// Frames sent, as many as were worth as much if they were independent.
    sent: f64,
    /// Of these received.
    received: f64,
    reading_dbm: f64,
    readings: f64,
    ln_readings: f64,
    knows_losses: bool,
}

impl RowCounts {
    fn from_row(row: &LinkRow, instrument: &Instrument) -> Self {
        let knows_losses = instrument.readings.has_losses() && row.received.is_finite();
        let sent = if row.frames.is_finite() { row.frames.max(1.0) } else { 1.0 };
        let received = if row.received.is_finite() { row.received } else { sent };
        let share = effective_frames(sent) / sent;
        Self {
            sent: effective_frames(sent),
            received: received * share,
            reading_dbm: row.rssi_dbm,
            readings: received.max(1.0),
            ln_readings: libm::log(received.max(1.0)),
            knows_losses,
        }
    }
}

impl RowCounts {
    fn is_silent(&self) -> bool {
        self.knows_losses && self.received == 0.0
    }
}

/// Effective sample size of so many frames of one row, which are correlated.
fn effective_frames(frames: f64) -> f64 {
    frames / (1.0 + (frames - 1.0) * FRAME_CORRELATION)
}

/// A level that nothing but power makes.
const PLAIN: RowPrediction = RowPrediction {
    power_dbm: 0.0,
    register_db: 0.0,
    range: PowerRange::shifted(0.0),
    shift_db: 0.0,
    ln_survival: 0.0,
    stated: None,
};

/// What an integral over the level gives.
struct Integral {
    /// Its logarithm.
    log: f64,
    /// The posterior mean of the level (dBm).
    posterior_mean: f64,
    /// Its posterior variance (dB²).
    posterior_variance: f64,
    /// Its derivative over the logarithm of the noise's standard deviation.
    over_ln_sd: f64,
}

impl Instrument {
    /// Chance that a frame passes at a level, how much stronger those that pass are in the mean (dB), and their variance (dB²).
    fn frames(&self, level: &RowPrediction, u: f64) -> (f64, f64, f64) {
        let chance = self.averaged.reception_at(u - level.shift_db);
        let survival = if level.ln_survival == 0.0 { 1.0 } else { libm::exp(level.ln_survival) };
        match level.stated {
            Some(stated) => {
                let passes = (stated * survival).clamp(STRAY_FRAMES, 1.0 - STRAY_FRAMES);
                (passes, 0.0, self.sd_db * self.sd_db)
            }
            None if !self.readings.is_of_received() => (1.0, 0.0, self.sd_db * self.sd_db),
            None => {
                let z = chance.received_noise_db / self.sd_db;
                let share = (1.0 + chance.over_ln_sd / chance.passes - z * z).clamp(0.05, 2.0);
                (
                    survival * chance.passes,
                    chance.received_noise_db,
                    self.sd_db * self.sd_db * share,
                )
            }
        }
    }

    /// What frames do at every level, where losses are known.
    fn table(&self) -> FrameTable {
        let rows: Vec<[f64; 7]> = self
            .averaged
            .points()
            .map(|u| {
                let (passes, received_noise_db, variance) = self.frames(&PLAIN, u);
                let slope = self.averaged.reception_at(u).slope;
                let fails = 1.0 - passes;
                let variance = self.rounded_variance(variance);
                let (by_passes, by_fails) = (slope / passes, -slope / fails);
                [
                    libm::log(passes),
                    by_passes,
                    libm::log(fails),
                    by_fails,
                    received_noise_db,
                    variance,
                    libm::log(variance),
                ]
            })
            .collect();
        let top = rows[rows.len() - 1];
        let is_alike = |row: &[f64; 7]| {
            (row[0] - top[0]).abs() < 1e-9
                && (row[2] - top[2]).abs() < 1e-6
                && (row[5] / top[5] - 1.0).abs() < 1e-6
        };
        let n_below = rows.iter().rposition(|row| !is_alike(row)).map_or(0, |last| last + 1);
        let (from_dbm, step) = (self.averaged.from_dbm, self.averaged.step);
        FrameTable { from_dbm, step, rows, alike_from_dbm: from_dbm + n_below as f64 * step }
    }

    /// Log likelihood of a row at a level.
    fn log_likelihood_at(&self, counts: &RowCounts, level: &RowPrediction, u: f64) -> f64 {
        let frame = match &self.tabulated {
            Some(frames) if level.stated.is_none() => {
                let mut frame = frames.moments_at(u - level.shift_db);
                if level.ln_survival != 0.0 {
                    frame.ln_passes += level.ln_survival;
                    frame.ln_fails = libm::log(-libm::expm1(frame.ln_passes));
                }
                frame
            }
            _ => {
                let (passes, received_noise_db, variance) = self.frames(level, u);
                let variance = self.rounded_variance(variance);
                let (ln_passes, ln_fails) = (libm::log(passes), libm::log(1.0 - passes));
                FrameMoments {
                    ln_passes,
                    ln_fails,
                    received_noise_db,
                    variance,
                    ln_variance: libm::log(variance),
                }
            }
        };
        let mut log = 0.0;
        if counts.knows_losses {
            log += counts.received * frame.ln_passes
                + (counts.sent - counts.received) * frame.ln_fails;
        }
        if counts.reading_dbm.is_finite() {
            let variance = mean_variance(frame.variance, counts.readings);
            let ln_variance = (frame.ln_variance - counts.ln_readings).max(LN_LEAST_VARIANCE);
            let deviation =
                counts.reading_dbm - level.range.offset_db - u - frame.received_noise_db;
            log -= 0.5 * (deviation * deviation / variance + ln_variance + LN_TAU);
        }
        log
    }

    /// Variance of a reading (dB²), the frames' own given: they are rounded.
    fn rounded_variance(&self, variance: f64) -> f64 {
        variance + self.readings.quantum_db * self.readings.quantum_db / 12.0
    }

    /// The integral where frames of every level that is likely pass alike: that of a product of two normal densities.
    fn integral_of_reading(
        &self,
        counts: &RowCounts,
        level: &RowPrediction,
        mean: f64,
        variance: f64,
    ) -> Option<Integral> {
        let read = counts.reading_dbm - level.range.offset_db;
        let (noise_db, one, alike_from_dbm) = match &self.tabulated {
            _ if !self.readings.is_of_received() => {
                (0.0, self.rounded_variance(self.sd_db * self.sd_db), f64::NEG_INFINITY)
            }
            Some(frames) if level.stated.is_none() => {
                let FrameMoments { received_noise_db, variance, .. } =
                    frames.moments_at(read - level.shift_db);
                (received_noise_db, variance, frames.alike_from_dbm)
            }
            _ => return None,
        };
        let own = mean_variance(one, counts.readings);
        let both = variance + own;
        let posterior_variance = variance * own / both;
        let deviation = read - noise_db - mean;
        let posterior_mean = mean + variance * deviation / both;
        let lowest =
            (posterior_mean - ALIKE_SD * posterior_variance.sqrt()).min(read) - level.shift_db;
        if read.is_nan() || lowest < alike_from_dbm {
            return None;
        }
        let by_frames = self.log_likelihood_at(
            &RowCounts { reading_dbm: f64::NAN, ..*counts },
            level,
            posterior_mean,
        );
        let share = deviation * deviation / both;
        // Where the variance is at its floor, it does not change with the noise.
        let is_least = own <= MEAN_READING_SD_DB * MEAN_READING_SD_DB;
        let own_over_ln_sd =
            if is_least { 0.0 } else { 2.0 * self.sd_db * self.sd_db / counts.readings };
        Some(Integral {
            log: by_frames - 0.5 * (share + libm::log(both) + LN_TAU),
            posterior_mean,
            posterior_variance,
            over_ln_sd: 0.5 * own_over_ln_sd * (share - 1.0) / both,
        })
    }

    /// The integral over the level, `variance` being its prior variance.
    fn integral(
        &self,
        counts: &RowCounts,
        level: &RowPrediction,
        mean: f64,
        variance: f64,
    ) -> Integral {
        if let Some(integral) = self.integral_of_reading(counts, level, mean, variance) {
            return integral;
        }
        let exponent_at = |u: f64| {
            self.log_likelihood_at(counts, level, u) - 0.5 * (u - mean) * (u - mean) / variance
        };
        let mut top = mean;
        let mut start = |level: f64| {
            if exponent_at(top) < exponent_at(level) {
                top = level;
            }
        };
        if counts.reading_dbm.is_finite() {
            let read = counts.reading_dbm - level.range.offset_db;
            let (_, noise_db, own) = self.frames(level, read);
            let own = mean_variance(self.rounded_variance(own), counts.readings);
            start((variance * (read - noise_db) + own * mean) / (variance + own));
        }
        // Without a reading the integrand may peak far below its prior mean, where frames are lost.
        if !counts.reading_dbm.is_finite() {
            for k in [-3.0, -2.0, -1.0, 1.0] {
                start(mean + k * variance.sqrt());
            }
        }
        let search = Newton {
            difference: 0.05,
            max_iterations: TOP_STEPS,
            max_step: (2.0, 1.0),
            tolerance: 0.05,
        };
        let (top, width) = search.maximise(exponent_at, top, 1.0 / variance);
        // Beside a reading nothing but a normal density is left of the integrand; without one a wall of losses on one side leaves a
        // long slope on the other.
        if counts.reading_dbm.is_finite() && width < NARROW * self.sd_db {
            let few = HERMITE.map(|(z, weight)| (z * width, weight * width));
            let logs = few.map(|(away, _)| exponent_at(top + away));
            let is_normal = |log: &f64| *log < logs[3] - OUTERMOST_NATS;
            if [&logs[0], &logs[6]].into_iter().all(is_normal) {
                return self.sum_over(counts, level, (mean, variance), top, &few, &logs);
            }
        }
        let points = Self::trapezia(&exponent_at, top, width, variance);
        let logs = points.map(|(away, _)| exponent_at(top + away));
        self.sum_over(counts, level, (mean, variance), top, &points, &logs)
    }

    /// Points about the top of an integrand at equal steps, to where it has fallen low, each with its weight.
    fn trapezia(
        at: &dyn Fn(f64) -> f64,
        top: f64,
        width: f64,
        variance: f64,
    ) -> [(f64, f64); POINTS] {
        let peak = at(top);
        let reach = |sign: f64| {
            let mut reach = 2.0 * width;
            while reach < 20.0 * variance.sqrt() && peak - REACH_NATS < at(top + sign * reach) {
                reach *= 1.5;
            }
            sign * reach
        };
        let (low, high) = (reach(-1.0), reach(1.0));
        let step = (high - low) / (POINTS - 1) as f64;
        std::array::from_fn(|k| (low + k as f64 * step, step))
    }

    /// The integral by points about the top of its integrand, each with its weight, and the logarithms of the integrand there.
    fn sum_over<const N: usize>(
        &self,
        counts: &RowCounts,
        level: &RowPrediction,
        (mean, variance): (f64, f64),
        top: f64,
        points: &[(f64, f64); N],
        logs: &[f64; N],
    ) -> Integral {
        let best = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (mut total, mut first, mut second) = (0.0, 0.0, 0.0);
        for (&(away, weight), log) in points.iter().zip(logs) {
            let part = weight * libm::exp(log - best);
            total += part;
            first += part * away;
            second += part * away * away;
        }
        let (shift, square) = (first / total, second / total);
        let log = best + libm::log(total) - 0.5 * (libm::log(variance) + LN_TAU);
        let posterior_variance = (square - shift * shift).max(1e-12);
        // The same integral with frames that vary a little more, as a ratio.
        let over_ln_sd = self.wider.as_ref().map_or(0.0, |wider| {
            let mut sum = 0.0;
            for (&(away, weight), log) in points.iter().zip(logs) {
                let part = libm::exp(log - best);
                if LEAST_PART < part {
                    let u = top + away;
                    let prior = -0.5 * (u - mean) * (u - mean) / variance;
                    let ratio = wider.log_likelihood_at(counts, level, u) + prior - log;
                    sum += weight * part * libm::exp(ratio);
                } else {
                    sum += weight * part;
                }
            }
            libm::log(sum / total) / libm::log(WIDER)
        });
        Integral { log, posterior_mean: top + shift, posterior_variance, over_ln_sd }
    }

    /// Log likelihood of a row of several frames. `blup_db`: random effects, which are added to the level.
    pub(super) fn aggregated_likelihood(
        &self,
        row: &LinkRow,
        level: &RowPrediction,
        blup_db: f64,
    ) -> RowLikelihood {
        let counts = RowCounts::from_row(row, self);
        let mean = level.power_dbm + blup_db;
        let is_plain = level.stated.is_none() && level.ln_survival == 0.0;
        // Silent rows of one number of frames differ by their mean level alone: a table replaces their integrals.
        if is_plain && counts.is_silent() {
            let known = self.silent.iter().find(|silent| silent.sent == counts.sent);
            if let Some(slope) =
                known.and_then(|silent| silent.likelihood_at(mean - level.shift_db))
            {
                return slope;
            }
        }
        self.integrated(&counts, level, mean)
    }

    /// Log likelihood of a row, by an integral over the level.
    fn integrated(&self, counts: &RowCounts, level: &RowPrediction, mean: f64) -> RowLikelihood {
        let variance = self.link_sd_db * self.link_sd_db;
        let Integral { log, posterior_mean, posterior_variance, over_ln_sd } =
            self.integral(counts, level, mean, variance);
        let away = posterior_mean - mean;
        RowLikelihood {
            log: log + ln_constant(counts, level),
            over_level: away / variance,
            weight: ((1.0 - posterior_variance / variance) / variance).max(0.0),
            over_ln_sd,
            over_ln_link_sd: (away * away + posterior_variance) / variance - 1.0,
        }
    }

    /// Tabulates what many rows need: the probabilities of frames at every level; the same with slightly larger noise, for
    /// derivatives; and the likelihood of rows without a received frame, for these numbers of frames sent.
    #[must_use]
    pub fn with_tables(self, silent_frames: &[f64]) -> Self {
        let tabulated = |one: Self| Self {
            tabulated: one.readings.is_of_received().then(|| one.table()),
            ..one
        };
        let wider = tabulated(self.with_sd(WIDER * self.sd_db));
        let mut with = Self { wider: Some(Box::new(wider)), ..tabulated(self) };
        if with.readings.has_losses() {
            with.silent = silent_frames.iter().map(|&frames| with.silent(frames)).collect();
        }
        with
    }

    /// What rows of so many frames, none of them received, say at every mean level.
    fn silent(&self, frames: f64) -> SilentRowTable {
        let sent = effective_frames(frames);
        let counts = RowCounts {
            sent,
            received: 0.0,
            reading_dbm: f64::NAN,
            readings: 1.0,
            ln_readings: 0.0,
            knows_losses: true,
        };
        let below = SILENT_SD * self.link_sd_db;
        let from_dbm = self.averaged.from_dbm - below;
        let width = self.averaged.width_db() + below + below;
        let step = (width / SILENT_POINTS as f64).max(0.1 * self.link_sd_db);
        let rows = (0..=(width / step) as usize)
            .map(|i| self.integrated(&counts, &PLAIN, from_dbm + i as f64 * step))
            .collect();
        SilentRowTable { sent, from_dbm, step, rows }
    }

    /// What the mean reading of a row should be (dBm), its standard deviation (dB), the share of frames that should be received
    /// and the standard deviation of that. `extra`: further variance of the level (dB²); `read`: what the register reads, where it
    /// does more than shift.
    #[must_use]
    pub fn row_of(
        &self,
        row: &LinkRow,
        level: &RowPrediction,
        (blup_db, extra): (f64, f64),
        read: Option<RegisterResponse<'_>>,
    ) -> [f64; 4] {
        let counts = RowCounts::from_row(row, self);
        let mean = level.power_dbm + blup_db;
        let sd = (self.link_sd_db * self.link_sd_db + extra).sqrt();
        let mut sums = [0.0; 6];
        for k in 0..POINTS {
            let z = 8.0 * k as f64 / (POINTS - 1) as f64 - 4.0;
            let u = mean + z * sd;
            let (passes, noise_db, variance) = self.frames(level, u);
            let weight = libm::exp(-0.5 * z * z);
            // Rows without a single frame received show no reading.
            let shows =
                weight * (1.0 - libm::exp(counts.sent * libm::log((1.0 - passes).max(1e-300))));
            let readings = (counts.sent * passes).max(1.0);
            let reading = read.map_or(u + level.register_db + noise_db, |read| read(u + noise_db));
            sums[0] += weight;
            sums[1] += weight * passes;
            sums[2] += weight * (passes * passes + passes * (1.0 - passes) / counts.sent);
            sums[3] += shows;
            sums[4] += shows * reading;
            sums[5] += shows
                * (reading * reading + mean_variance(self.rounded_variance(variance), readings));
        }
        let (share, reading) = (sums[1] / sums[0], sums[4] / sums[3]);
        let sd_of = |square: f64, mean: f64| (square - mean * mean).max(1e-9).sqrt();
        [reading, sd_of(sums[5] / sums[3], reading), share, sd_of(sums[2] / sums[0], share)]
    }

    /// Scores the prediction of a row of several frames.
    #[must_use]
    pub fn score_row(
        &self,
        row: &LinkRow,
        level: &RowPrediction,
        (blup_db, extra): (f64, f64),
        read: Option<RegisterResponse<'_>>,
    ) -> RowScore {
        let counts = RowCounts::from_row(row, self);
        let variance = self.link_sd_db * self.link_sd_db + extra;
        let Integral { log, .. } =
            self.integral(&counts, level, level.power_dbm + blup_db, variance);
        let [reading, sd, share, _] = self.row_of(row, level, (blup_db, extra), read);
        let mut score = RowScore {
            log: log + ln_constant(&counts, level),
            squared_error: f64::NAN,
            plain_squared_error: f64::NAN,
            heading_squared_error_rad2: f64::NAN,
            log_of_position: f64::NAN,
            crps: f64::NAN,
            reception_log_loss: f64::NAN,
        };
        if row.rssi_dbm.is_finite() {
            let deviation = row.rssi_dbm - reading;
            score.squared_error = deviation * deviation;
            score.crps = super::normal_crps(deviation, sd);
        }
        if counts.knows_losses {
            let share = share.clamp(1e-9, 1.0 - 1e-9);
            let measured = counts.received / counts.sent;
            score.reception_log_loss =
                -measured * libm::log(share) - (1.0 - measured) * libm::log(1.0 - share);
        }
        score
    }
}

/// Variance of the mean of readings, the variance of one given (dB²).
fn mean_variance(variance: f64, readings: f64) -> f64 {
    (variance / readings).max(MEAN_READING_SD_DB * MEAN_READING_SD_DB)
}

/// The part of a row's log likelihood that does not depend on the mean power: the binomial coefficient, and the Jacobian of the
/// register's response.
fn ln_constant(counts: &RowCounts, level: &RowPrediction) -> f64 {
    let ln_stretch =
        if counts.reading_dbm.is_finite() { libm::log(level.range.stretch) } else { 0.0 };
    ways(counts) + ln_stretch
}

/// Logarithm of the number of ways in which so many of the frames are received.
fn ways(counts: &RowCounts) -> f64 {
    if !counts.knows_losses {
        return 0.0;
    }
    let factorial = |n: f64| libm::lgamma(n + 1.0);
    factorial(counts.sent) - factorial(counts.received) - factorial(counts.sent - counts.received)
}

#[cfg(test)]
mod tests;
