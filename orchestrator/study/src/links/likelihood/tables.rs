//! What many rows of several frames ask for, tabulated over the level.

use super::RowLikelihood;
use super::cubic;

/// Log likelihood of rows in which no frame was received over the mean power, tabulated at equal steps.
#[derive(Clone, Debug)]
pub struct SilentRowTable {
    pub(super) sent: f64,
    pub(super) from_dbm: f64,
    pub(super) step: f64,
    pub(super) rows: Vec<RowLikelihood>,
}

impl SilentRowTable {
    /// Interpolated at a mean power (dBm); `None` above the table.
    pub(super) fn likelihood_at(&self, dbm: f64) -> Option<RowLikelihood> {
        let place = ((dbm - self.from_dbm) / self.step).max(0.0);
        let index = place as usize;
        let (a, b) = (self.rows.get(index)?, self.rows.get(index + 1)?);
        let part = place - index as f64;
        let linear = |a: f64, b: f64| a + part * (b - a);
        Some(RowLikelihood {
            log: cubic(part, self.step, [a.log, a.over_level], [b.log, b.over_level]),
            over_level: cubic(
                part,
                self.step,
                [a.over_level, -a.weight],
                [b.over_level, -b.weight],
            ),
            weight: linear(a.weight, b.weight),
            over_ln_sd: linear(a.over_ln_sd, b.over_ln_sd),
            over_ln_link_sd: linear(a.over_ln_link_sd, b.over_ln_link_sd),
        })
    }
}

/// Reception of frames by their level, tabulated at equal steps: the log probabilities of reception and of loss, each with its
/// slope; the mean excess of received frames over their level (dB); and the variance of their readings (dB²) with its logarithm.
#[derive(Clone, Debug)]
pub struct FrameTable {
    pub(super) from_dbm: f64,
    pub(super) step: f64,
    pub(super) rows: Vec<[f64; 7]>,
    /// From here on frames pass alike.
    pub(super) alike_from_dbm: f64,
}

impl FrameTable {
    /// Interpolated at a mean power (dBm): cubic where slopes are known, else linear.
    pub(super) fn moments_at(&self, dbm: f64) -> FrameMoments {
        let last = self.rows.len() - 1;
        let place = ((dbm - self.from_dbm) / self.step).clamp(0.0, last as f64);
        let index = (place as usize).min(last - 1);
        let part = place - index as f64;
        let (a, b) = (&self.rows[index], &self.rows[index + 1]);
        let cubic = |k: usize| cubic(part, self.step, [a[k], a[k + 1]], [b[k], b[k + 1]]);
        let linear = |k: usize| a[k] + part * (b[k] - a[k]);
        FrameMoments {
            ln_passes: cubic(0),
            ln_fails: cubic(2),
            received_noise_db: linear(4),
            variance: linear(5),
            ln_variance: linear(6),
        }
    }
}

/// Probabilities and moments of a frame at one mean power.
pub(super) struct FrameMoments {
    pub(super) ln_passes: f64,
    pub(super) ln_fails: f64,
    pub(super) received_noise_db: f64,
    pub(super) variance: f64,
    pub(super) ln_variance: f64,
}
