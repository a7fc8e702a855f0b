//! How predicted positions scatter, and headings beside them.

use super::headings::HeadingDensity;
use crate::thresholds::{BROAD_FACTOR, BROAD_SHARE};
use numbers::optimise::pattern_search::{PatternSearch, Polling};
use robotsim::dynamics::wrapped;
use std::f64::consts::TAU;
use std::sync::LazyLock;

/// A residual in the directions along and across the predicted motion, and upwards.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Residual {
    /// Measured less predicted (m): along, across, up.
    pub(super) parts_m: [f64; 3],
    /// Variance of the difference, per variance of one measured position.
    pub(super) spread: f64,
    /// Predicted way (m).
    pub(super) way_m: f64,
    /// Measured less predicted heading (rad); NaN where the body does not turn.
    pub(super) heading_rad: f64,
}

impl Residual {
    /// By how much it exceeds another of the same window: along, across, and up (m) or, where headings are measured, in heading (rad).
    pub(super) fn less(&self, other: &Self) -> [f64; 3] {
        let mut less = std::array::from_fn(|i| self.parts_m[i] - other.parts_m[i]);
        if !self.heading_rad.is_nan() {
            less[2] = wrapped(self.heading_rad - other.heading_rad);
        }
        less
    }
}

/// Scatter of residuals: a normal law and, for one window in a hundred, one that is ten times as broad, so that a single
/// window at the edge of a threshold does not decide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ResidualDensity {
    /// Standard deviation of one measured position, per component (m).
    pub(super) sd_m: f64,
    /// Standard deviation of the direction at the window's start (rad): scatter across the motion grows with the way.
    pub(super) sd_rad: f64,
    /// Components of positions that are measured: 2 or 3.
    pub(super) n_parts: usize,
    /// Scatter of headings, of bodies that turn: these have two components.
    pub(super) heading: Option<HeadingDensity>,
}

/// Logarithms of the share of the narrow law, of that of the broad one over that of the narrow one, and of how much broader it is.
static LOGS: LazyLock<[f64; 3]> = LazyLock::new(|| {
    [
        libm::log(1.0 - BROAD_SHARE),
        libm::log(BROAD_SHARE / (1.0 - BROAD_SHARE)),
        libm::log(BROAD_FACTOR),
    ]
});
/// By how much less a broad law of a component counts.
const BROAD_WEIGHT: f64 = 1.0 / (BROAD_FACTOR * BROAD_FACTOR);

/// The logarithm (nats) of a density that is mixed of a narrow and a broad one, over that of the narrow one, and how much a residual counts
/// in a least squares fit; `broader`: logarithm of the broad density over the narrow one.
pub(super) fn mixed(broader: f64) -> (f64, f64) {
    // The greater of both densities is factored out: far from the mean both underflow.
    if broader <= 0.0 {
        let ratio = libm::exp(broader);
        (libm::log1p(ratio), weight_of(1.0 / (1.0 + ratio)))
    } else {
        let ratio = libm::exp(-broader);
        (broader + libm::log1p(ratio), weight_of(ratio / (1.0 + ratio)))
    }
}

/// How much a residual counts in a least squares fit; `broader`: as for [`mixed`].
pub(super) fn mixed_weight(broader: f64) -> f64 {
    weight_of(1.0 / (1.0 + libm::exp(broader)))
}

/// The same; `share`: the probability that it is of the narrow law.
fn weight_of(share: f64) -> f64 {
    share + (1.0 - share) * BROAD_WEIGHT
}

/// Residuals as the scale of their scatter needs them, for one ratio of `sd_rad` to `sd_m`.
struct Scaled {
    n_parts: usize,
    /// Of each residual the sum of the squares of its components, each over its variance for an `sd_m` of 1.
    squares: Vec<f64>,
    /// Sum of the logarithms of these variances.
    logs: f64,
}

impl Scaled {
    fn new(residuals: &[Residual], n_parts: usize, ratio: f64) -> Self {
        let unit = ResidualDensity { sd_m: 1.0, sd_rad: ratio, n_parts, heading: None };
        let (mut squares, mut logs) = (Vec::with_capacity(residuals.len()), SumOfLogs::default());
        for residual in residuals {
            let (square, product) = unit.standardised(residual);
            squares.push(square);
            logs.add_log_of(product);
        }
        Self { n_parts, squares, logs: logs.total() }
    }

    /// How many components there are of all residuals.
    fn n(&self) -> f64 {
        (self.squares.len() * self.n_parts) as f64
    }

    /// The likeliest `sd_m`, by expectation and maximisation from this one.
    fn likeliest_sd_m(&self, mut sd_m: f64) -> f64 {
        for _ in 0..60 {
            let variance = sd_m * sd_m;
            let weighted = |square: &f64| {
                let square = square / variance;
                mixed_weight(broader(square, self.n_parts)) * square
            };
            let step = (self.squares.iter().map(weighted).sum::<f64>() / self.n()).sqrt();
            sd_m = (sd_m * step).max(1e-9);
            if (step - 1.0).abs() < 1e-9 {
                break;
            }
        }
        sd_m
    }

    /// Sum of the log densities (nats) of all residuals.
    fn total(&self, sd_m: f64) -> f64 {
        let variance = sd_m * sd_m;
        let (mut logs, mut sum) = (SumOfLogs::default(), 0.0);
        for square in &self.squares {
            let square = square / variance;
            let broader = broader(square, self.n_parts);
            // The greater of both densities is factored out.
            logs.add_log_of(1.0 + libm::exp(-broader.abs()));
            sum += broader.max(0.0) - 0.5 * square;
        }
        let n_residuals = self.squares.len() as f64;
        sum + logs.total() + n_residuals * LOGS[0]
            - 0.5 * (self.logs + self.n() * libm::log(TAU * variance))
    }
}

/// A sum of logarithms, taken of products as long as these are in the range of numbers.
struct SumOfLogs {
    sum: f64,
    product: f64,
}

impl Default for SumOfLogs {
    fn default() -> Self {
        Self { sum: 0.0, product: 1.0 }
    }
}

impl SumOfLogs {
    fn add_log_of(&mut self, value: f64) {
        let product = self.product * value;
        if (1e-200..1e200).contains(&product) {
            self.product = product;
        } else {
            self.sum += libm::log(self.product) + libm::log(value);
            self.product = 1.0;
        }
    }

    fn total(self) -> f64 {
        self.sum + libm::log(self.product)
    }
}

/// The logarithm of the broad density over the narrow one where the squares of standardised components add up to this.
fn broader(square: f64, n_parts: usize) -> f64 {
    LOGS[1] - n_parts as f64 * LOGS[2] + 0.5 * (1.0 - BROAD_WEIGHT) * square
}

impl ResidualDensity {
    /// Variances (m²) of the components of a residual.
    fn variances_m2(&self, residual: &Residual) -> [f64; 3] {
        let own = self.sd_m * self.sd_m * residual.spread;
        let turned = self.sd_rad * residual.way_m;
        [own, own + turned * turned, own]
    }

    /// Standard deviations (m) of the components of a residual.
    pub(super) fn sd_m(&self, residual: &Residual) -> [f64; 3] {
        self.variances_m2(residual).map(f64::sqrt)
    }

    /// Sum of the squares of the standardised components of a residual, and the product of their variances (m² each).
    fn standardised(&self, residual: &Residual) -> (f64, f64) {
        let variances = self.variances_m2(residual);
        let parts = residual.parts_m.iter().zip(variances).take(self.n_parts);
        parts.fold((0.0, 1.0), |(square, product), (part, variance)| {
            (square + part * part / variance, product * variance)
        })
    }

    /// Log density (nats) of the position, and of the heading as far as that counts.
    pub(super) fn log(&self, residual: &Residual) -> f64 {
        let position = self.log_of_position(residual);
        self.heading.map_or(position, |heading| position + heading.log(residual.heading_rad))
    }

    /// How many components are predicted: those of the position, and the heading after two of these.
    pub(super) fn n_components(&self) -> usize {
        if self.heading.is_some() { 3 } else { self.n_parts }
    }

    /// What pulls the prediction of each component (m; of the heading the sine), and its information (1/m², 1/rad²): their product is the
    /// slope of the log density.
    pub(super) fn pulls(&self, residual: &Residual) -> ([f64; 3], [f64; 3]) {
        let weight = self.weight(residual);
        let mut parts = residual.parts_m;
        let mut scales = self.variances_m2(residual).map(|variance| weight / variance);
        if let Some(heading) = self.heading {
            (parts[2], scales[2]) = heading.pull(residual.heading_rad);
        }
        (parts, scales)
    }

    /// How much the position counts in a least squares fit.
    pub(super) fn weight(&self, residual: &Residual) -> f64 {
        mixed_weight(broader(self.standardised(residual).0, self.n_parts))
    }

    /// Log density (nats) of the position.
    pub(super) fn log_of_position(&self, residual: &Residual) -> f64 {
        let (square, product) = self.standardised(residual);
        let norm = 0.5 * (libm::log(product) + self.n_parts as f64 * libm::log(TAU));
        LOGS[0] - 0.5 * square + mixed(broader(square, self.n_parts)).0 - norm
    }

    /// Sum of log densities (nats).
    pub(super) fn total(&self, residuals: &[Residual]) -> f64 {
        residuals.iter().map(|residual| self.log(residual)).sum()
    }

    /// The likeliest density, searched from this one. The ratio of its two scatters is searched only where asked; positions
    /// scatter as they do where not `is_noise_free`.
    pub(super) fn fitted(
        self,
        residuals: &[Residual],
        is_noise_free: bool,
        searches_ratio: bool,
    ) -> Self {
        let heading = self.heading.map(|heading| heading.fitted(residuals));
        let positions = Self { heading: None, ..self };
        Self { heading, ..positions.fitted_to_positions(residuals, is_noise_free, searches_ratio) }
    }

    fn fitted_to_positions(
        self,
        residuals: &[Residual],
        is_noise_free: bool,
        searches_ratio: bool,
    ) -> Self {
        if residuals.is_empty() {
            return self;
        }
        // The density with a ratio, and the residuals as that sees them.
        let with = |density: Self, ratio: f64| {
            let scaled = Scaled::new(residuals, self.n_parts, ratio);
            let sd_m =
                if is_noise_free { scaled.likeliest_sd_m(density.sd_m) } else { density.sd_m };
            let total = if searches_ratio { scaled.total(sd_m) } else { f64::NAN };
            (Self { sd_m, sd_rad: ratio * sd_m, ..density }, total)
        };
        let (start, total) = with(self, self.sd_rad / self.sd_m);
        if !searches_ratio {
            return start;
        }
        // Over the logarithm of the ratio, whose likelihood has one peak: a step is a factor.
        let search = PatternSearch {
            step: 1.5,
            min_step: 1.002,
            polling: Polling::Opportunistic,
            contract: f64::sqrt,
            ..PatternSearch::default()
        };
        let poll = |&(density, _, ratio): &(Self, f64, f64), factor: f64| {
            let trial = move |ratio: f64| {
                let (density, total) = with(density, ratio.clamp(1e-4, 1e3));
                (density, total, ratio)
            };
            [ratio * factor, ratio / factor].into_iter().map(trial)
        };
        // A factor cannot leave a ratio of 0.
        let ratio = (start.sd_rad / start.sd_m).max(1e-3);
        search.maximise((start, total, ratio), poll, |&(_, total, _)| total).point.0
    }

    /// Continuous ranked probability score (m), the mean over components: that of the normal law.
    pub(super) fn crps_m(&self, residual: &Residual) -> f64 {
        let sd_m = self.sd_m(residual);
        let parts = residual.parts_m.iter().zip(sd_m).take(self.n_parts);
        let sum: f64 = parts
            .map(|(part, sd)| {
                let z = part / sd;
                let density = libm::exp(-0.5 * z * z) / TAU.sqrt();
                let below = libm::erf(z / std::f64::consts::SQRT_2);
                sd * (z * below + 2.0 * density - 1.0 / std::f64::consts::PI.sqrt())
            })
            .sum();
        sum / self.n_parts as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::rng::normal;

    fn normals(n: u64, sd_m: f64, sd_rad: f64) -> Vec<Residual> {
        let draw = |k: u64| {
            let word = |j| crate::folds::scramble(2 * k + j);
            normal(word(0), word(1))
        };
        (0..n)
            .map(|row| {
                let way_m = 0.5 * (row % 7) as f64;
                let across = draw(3 * row) * sd_rad * way_m;
                Residual {
                    parts_m: [draw(3 * row + 1) * sd_m, draw(3 * row + 2) * sd_m + across, 0.0],
                    spread: 1.0,
                    way_m,
                    heading_rad: f64::NAN,
                }
            })
            .collect()
    }

    #[test]
    fn the_scatter_that_was_put_in_is_found() {
        let mut residuals = normals(20_000, 0.02, 0.01);
        // And one window in two hundred is far off.
        for residual in residuals.iter_mut().step_by(200) {
            residual.parts_m[0] += 0.3;
        }
        let start = ResidualDensity { sd_m: 1.0, sd_rad: 1.0, n_parts: 2, heading: None };
        let found = start.fitted(&residuals, true, true);
        // Standard errors about 0.7 % and 2 %; the far ones add a little.
        assert!((found.sd_m / 0.02 - 1.0).abs() < 0.03, "{found:?}");
        assert!((found.sd_rad / 0.01 - 1.0).abs() < 0.1, "{found:?}");
    }

    #[test]
    fn densities_sum_to_one() {
        let density = ResidualDensity { sd_m: 0.02, sd_rad: 0.03, n_parts: 2, heading: None };
        let h = 0.004;
        let mut sum = 0.0;
        for i in -400..400 {
            for j in -400..400 {
                let parts_m = [f64::from(i) * h, f64::from(j) * h, 0.0];
                let residual = Residual { parts_m, spread: 1.5, way_m: 2.0, ..Residual::default() };
                sum += libm::exp(density.log(&residual)) * h * h;
            }
        }
        assert!((sum - 1.0).abs() < 1e-3, "{sum}");
    }

    #[test]
    fn the_crps_of_a_normal_law_is_that_of_the_literature() {
        // Gneiting and Raftery 2007, at z = 0: sd (2 φ(0) − 1/√π) = 0.233695 sd.
        let density = ResidualDensity { sd_m: 2.0, sd_rad: 0.0, n_parts: 2, heading: None };
        let residual = Residual { parts_m: [0.0; 3], spread: 1.0, ..Residual::default() };
        assert!((density.crps_m(&residual) - 2.0 * 0.233_695).abs() < 1e-6);
    }
}
