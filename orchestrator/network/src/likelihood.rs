//! How probable the figures of a measurement are under a model that can be run, but not written down: the synthetic likelihood
//! (S. N. Wood, Statistical inference for noisy nonlinear ecological dynamic systems, Nature 466, 2010).
//!
//! A model is run under many seeds. Mean, scatter and correlation of the figures, on the scales on which they are compared,
//! make a density. It is Student's, for figures of networks have long tails; correlations are shrunk towards none, the more
//! so the fewer runs there are (J. Schäfer, K. Strimmer, Stat. Appl. Genet. Mol. Biol. 4(1), 2005). A figure that all
//! runs have alike scatters at least as far as counting does.
//!
//! Between values of a parameter that were tried, mean and scatter are interpolated linearly ([`interpolate`]); near the best they are smoothed
//! ([`SmoothDensity`]), so that the chances of single values do not count for the parameter's.

use super::kpis::{KPIS, NetworkFigures};
use crate::kpis::Scale;
use nalgebra::{DMatrix, DVector};
use numbers::power::square;
use numbers::statistics;
use std::collections::BTreeMap;
use study::thresholds::{FIGURES_FREEDOM, LEAST_RATIO_SD, LEAST_SHRINKAGE};

/// How many figures there are.
pub(crate) const D: usize = KPIS.len();
/// The figures of a run on their scales; NaN where there is nothing to tell.
pub(crate) type ScaledFigures = [f64; D];
/// The log density of a run that is unlike every run of a model (nats).
const UNHEARD_OF: f64 = -1e4;
/// The figure of the number of packets.
const PACKETS: usize = D - 1;

/// The figures of runs.
#[must_use]
pub(crate) fn scaled(runs: &[NetworkFigures]) -> Vec<ScaledFigures> {
    runs.iter().map(NetworkFigures::scaled).collect()
}

/// Which of the figures are known, as bits.
fn pattern(run: &ScaledFigures, usable: &[usize]) -> u16 {
    usable.iter().filter(|&&k| run[k].is_finite()).fold(0, |bits, &k| bits | 1 << k)
}

/// Means, scatter and correlations of the figures over runs at one value of a parameter.
#[derive(Clone, Debug)]
pub(crate) struct RunMoments {
    /// The value, on the parameter's scale.
    pub at: f64,
    n: f64,
    mean: ScaledFigures,
    log_sd: ScaledFigures,
    /// Correlations.
    correlation: Vec<[f64; D]>,
    /// How often which figures are known.
    patterns: BTreeMap<u16, f64>,
}

impl RunMoments {
    /// Moments of runs. `at`: the value of the parameter; `usable`: indices of the figures that count.
    pub(crate) fn from_runs<'a>(
        at: f64,
        runs: impl Iterator<Item = &'a ScaledFigures> + Clone,
        usable: &[usize],
    ) -> Self {
        let n = runs.clone().count() as f64;
        let mut patterns = BTreeMap::new();
        for run in runs.clone() {
            *patterns.entry(pattern(run, usable)).or_insert(0.0) += 1.0;
        }
        let (mut mean, mut sd) = ([f64::NAN; D], [f64::NAN; D]);
        for &k in usable {
            let known = || runs.clone().map(|run| run[k]).filter(|value| value.is_finite());
            if known().count() < 3 {
                continue;
            }
            mean[k] = statistics::mean(known());
            sd[k] = statistics::standard_deviation(known());
        }
        for &k in usable {
            sd[k] = sd[k].max(least_sd(k, &mean));
        }
        let mut correlation = vec![[0.0; D]; D];
        let out = |run: &ScaledFigures, k: usize| {
            let out = (run[k] - mean[k]) / sd[k];
            if out.is_finite() { out } else { 0.0 }
        };
        for &i in usable {
            for &j in usable {
                let sum: f64 = runs.clone().map(|run| out(run, i) * out(run, j)).sum();
                correlation[i][j] = if i == j { 1.0 } else { sum / (n - 1.0).max(1.0) };
            }
        }
        Self { at, n, mean, log_sd: sd.map(libm::log), correlation, patterns }
    }
}

/// The least scatter of a figure: that of counting losses, for shares.
fn least_sd(k: usize, mean: &ScaledFigures) -> f64 {
    match KPIS[k].scale {
        Scale::Ratio => LEAST_RATIO_SD,
        Scale::Share => {
            let packets = if mean[PACKETS].is_finite() { libm::exp(mean[PACKETS]) } else { 1.0 };
            let lost = packets * libm::exp(-mean[k].max(-30.0));
            // The mote that fares worst has a part of the packets: one of its own is many of all.
            let one = if KPIS[k].name == "delivery" { 0.5 } else { 1.0 };
            one / libm::sqrt(1.0 + lost)
        }
    }
}

/// Joint probability density of the figures of a run: the synthetic likelihood.
#[derive(Clone, Debug)]
pub(crate) struct FigureDensity {
    usable: Vec<usize>,
    mean: ScaledFigures,
    sd: ScaledFigures,
    correlation: Vec<[f64; D]>,
    patterns: BTreeMap<u16, f64>,
    /// Chance of figures that no run had.
    unseen: f64,
    /// Of all usable figures; `None`: they are not all known of the runs.
    whole: Option<CholeskyFactor>,
}

impl FigureDensity {
    fn new(
        usable: &[usize],
        mean: ScaledFigures,
        log_sd: ScaledFigures,
        correlation: Vec<[f64; D]>,
        n: f64,
    ) -> Self {
        let mut law = Self {
            usable: usable.to_vec(),
            mean,
            sd: log_sd.map(libm::exp),
            correlation: shrink_correlations(correlation, usable, n),
            patterns: BTreeMap::new(),
            unseen: 0.5 / (n + 1.0),
            whole: None,
        };
        law.whole = law.lower(usable);
        law
    }

    /// The density of runs at the value at which the moments were taken.
    #[must_use]
    pub(crate) fn at_value(moments: &RunMoments, usable: &[usize]) -> Self {
        interpolate(moments, moments, moments.at, usable)
    }

    fn lower(&self, figures: &[usize]) -> Option<CholeskyFactor> {
        CholeskyFactor::factorise(figures, |i, j| self.correlation[i][j])
    }

    /// Log density of figures (nats).
    #[must_use]
    pub(crate) fn log_density(&self, run: &ScaledFigures) -> f64 {
        let seen = pattern(run, &self.usable);
        let chance = self.patterns.get(&seen).copied().unwrap_or(0.0).max(self.unseen);
        let known: Vec<usize> =
            self.usable.iter().copied().filter(|k| seen >> k & 1 == 1).collect();
        if known.iter().any(|&k| !self.mean[k].is_finite()) {
            return UNHEARD_OF;
        }
        let own;
        let lower = match &self.whole {
            Some(whole) if known.len() == self.usable.len() => whole,
            _ => match self.lower(&known) {
                Some(lower) => {
                    own = lower;
                    &own
                }
                None => return UNHEARD_OF,
            },
        };
        let out: Vec<f64> = known.iter().map(|&k| (run[k] - self.mean[k]) / self.sd[k]).collect();
        let d = known.len() as f64;
        // Scaled so that the law has this scatter.
        let squares = lower.squares(&out) * FIGURES_FREEDOM / (FIGURES_FREEDOM - 2.0);
        let log_scale = known.iter().map(|&k| libm::log(self.sd[k])).sum::<f64>()
            + lower.log_root
            + 0.5 * d * libm::log((FIGURES_FREEDOM - 2.0) / FIGURES_FREEDOM);
        libm::log(chance) + libm::lgamma(0.5 * (FIGURES_FREEDOM + d))
            - libm::lgamma(0.5 * FIGURES_FREEDOM)
            - 0.5 * d * libm::log(FIGURES_FREEDOM * std::f64::consts::PI)
            - log_scale
            - 0.5 * (FIGURES_FREEDOM + d) * libm::log1p(squares / FIGURES_FREEDOM)
    }

    /// Differences of the means of two densities, by figure, in standard deviations.
    #[must_use]
    pub(crate) fn standardised_differences(&self, other: &Self) -> Vec<(usize, f64)> {
        let distance_in = |k: usize| {
            let sd = libm::sqrt(0.5 * (square(self.sd[k]) + square(other.sd[k])));
            (k, (self.mean[k] - other.mean[k]) / sd)
        };
        self.usable.iter().map(|&k| distance_in(k)).filter(|(_, z)| z.is_finite()).collect()
    }
}

/// Shrinkage estimate of correlations from `n` runs.
fn shrink_correlations(mut correlation: Vec<[f64; D]>, usable: &[usize], n: f64) -> Vec<[f64; D]> {
    let pairs =
        || usable.iter().flat_map(|&i| usable.iter().map(move |&j| (i, j))).filter(|(i, j)| i != j);
    let squares: f64 = pairs().map(|(i, j)| square(correlation[i][j])).sum();
    let doubts: f64 = pairs()
        .map(|(i, j)| square((1.0 - square(correlation[i][j])).max(0.0)) / (n - 1.0).max(1.0))
        .sum();
    let part = if 0.0 < squares { (doubts / squares).clamp(LEAST_SHRINKAGE, 1.0) } else { 1.0 };
    for (i, j) in pairs().collect::<Vec<_>>() {
        correlation[i][j] *= 1.0 - part;
    }
    correlation
}

/// A figure of which less than this share is left when those before it are known follows from them.
const LEAST_LEFT: f64 = 1e-9;

/// The factor L of a matrix L L' of correlations.
#[derive(Clone, Debug)]
struct CholeskyFactor {
    factor: DMatrix<f64>,
    /// Logarithm of its determinant.
    log_root: f64,
}

impl CholeskyFactor {
    fn factorise(figures: &[usize], entry: impl Fn(usize, usize) -> f64) -> Option<Self> {
        let n = figures.len();
        let matrix = DMatrix::from_fn(n, n, |i, j| entry(figures[i], figures[j]));
        let factor = matrix.cholesky()?.unpack();
        let left: Vec<f64> = factor.diagonal().iter().map(|root| root * root).collect();
        let log_root = 0.5 * left.iter().map(|&left| libm::log(left)).sum::<f64>();
        left.iter().all(|&left| LEAST_LEFT < left).then_some(Self { factor, log_root })
    }

    /// x' (L L')^-1 x.
    fn squares(&self, x: &[f64]) -> f64 {
        let solved = self.factor.solve_lower_triangular(&DVector::from_row_slice(x));
        // The diagonal was looked at: nothing of it is 0.
        solved.map_or(f64::INFINITY, |solved| solved.norm_squared())
    }
}

/// The density at a value between two simulated ones, by linear interpolation of the moments.
#[must_use]
pub(crate) fn interpolate(
    from: &RunMoments,
    to: &RunMoments,
    at: f64,
    usable: &[usize],
) -> FigureDensity {
    let share =
        if from.at < to.at { ((at - from.at) / (to.at - from.at)).clamp(0.0, 1.0) } else { 0.0 };
    let mix = |a: f64, b: f64| {
        if share == 0.0 {
            a
        } else if share == 1.0 {
            b
        } else {
            a + share * (b - a)
        }
    };
    let each = |a: &ScaledFigures, b: &ScaledFigures| -> ScaledFigures {
        std::array::from_fn(|k| mix(a[k], b[k]))
    };
    let correlation =
        from.correlation.iter().zip(&to.correlation).map(|(a, b)| each(a, b)).collect();
    let n = mix(from.n, to.n);
    let mut law = FigureDensity::new(
        usable,
        each(&from.mean, &to.mean),
        each(&from.log_sd, &to.log_sd),
        correlation,
        n,
    );
    for (moments, weight) in [(from, 1.0 - share), (to, share)] {
        for (&pattern, &count) in &moments.patterns {
            *law.patterns.entry(pattern).or_insert(0.0) +=
                weight * (count + 0.5) / (moments.n + 1.0);
        }
    }
    law
}

/// The laws near the best value: the mean of each figure as a parabola over the parameter's scale, the logarithm of its
/// scatter as a straight line, and correlations that are the same throughout.
#[derive(Clone, Debug)]
pub(crate) struct SmoothDensity {
    middle: f64,
    half: f64,
    mean: Vec<[f64; 3]>,
    log_sd: Vec<[f64; 3]>,
    correlation: Vec<[f64; D]>,
    patterns: BTreeMap<u16, f64>,
    n: f64,
    usable: Vec<usize>,
}

impl SmoothDensity {
    /// Fits smooth moments to those at simulated values; `None`: fewer than three values.
    #[must_use]
    pub(crate) fn fit(simulated: &[RunMoments], usable: &[usize]) -> Option<Self> {
        let (first, last) = (simulated.first()?.at, simulated.last()?.at);
        if simulated.len() < 3 {
            return None;
        }
        let (middle, half) = (0.5 * (first + last), 0.5 * (last - first));
        let places: Vec<f64> =
            simulated.iter().map(|moments| (moments.at - middle) / half).collect();
        let fitted = |of: &dyn Fn(&RunMoments) -> f64, degree: usize| {
            polynomial(&places, &simulated.iter().map(of).collect::<Vec<f64>>(), degree)
        };
        let parts = simulated.len() as f64;
        let mut correlation = vec![[0.0; D]; D];
        for (i, row) in correlation.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                *entry =
                    simulated.iter().map(|moments| moments.correlation[i][j]).sum::<f64>() / parts;
            }
        }
        let mut patterns = BTreeMap::new();
        for moments in simulated {
            for (&pattern, &count) in &moments.patterns {
                *patterns.entry(pattern).or_insert(0.0) +=
                    (count + 0.5) / (moments.n + 1.0) / parts;
            }
        }
        Some(Self {
            middle,
            half,
            mean: (0..D).map(|k| fitted(&|moments| moments.mean[k], 2)).collect(),
            log_sd: (0..D).map(|k| fitted(&|moments| moments.log_sd[k], 1)).collect(),
            correlation,
            patterns,
            // The same seeds everywhere: they count once.
            n: simulated.iter().map(|moments| moments.n).sum::<f64>() / parts,
            usable: usable.to_vec(),
        })
    }

    /// The law at a place of the scale.
    #[must_use]
    pub(crate) fn law(&self, at: f64) -> FigureDensity {
        let u = (at - self.middle) / self.half;
        let value = |c: &[f64; 3]| c[0] + u * (c[1] + u * c[2]);
        let mut law = FigureDensity::new(
            &self.usable,
            std::array::from_fn(|k| value(&self.mean[k])),
            std::array::from_fn(|k| value(&self.log_sd[k])),
            self.correlation.clone(),
            self.n,
        );
        law.patterns.clone_from(&self.patterns);
        law
    }
}

/// Least squares of a polynomial of degree 1 or 2; NaN where a value is not known.
fn polynomial(places: &[f64], values: &[f64], degree: usize) -> [f64; 3] {
    let m = degree + 1;
    // Normal equations, by elimination: places lie in -1 to 1, so that they are well conditioned.
    let mut rows = [[0.0; 4]; 3];
    for (&u, &y) in places.iter().zip(values) {
        let powers = [1.0, u, u * u];
        for i in 0..m {
            for j in 0..m {
                rows[i][j] += powers[i] * powers[j];
            }
            rows[i][3] += powers[i] * y;
        }
    }
    for i in 0..m {
        for below in i + 1..m {
            let pivot = rows[i];
            let factor = rows[below][i] / pivot[i];
            for (entry, above) in rows[below].iter_mut().zip(pivot) {
                *entry -= factor * above;
            }
        }
    }
    let mut solved = [0.0; 3];
    for i in (0..m).rev() {
        let sum: f64 = (i + 1..m).map(|j| rows[i][j] * solved[j]).sum();
        solved[i] = (rows[i][3] - sum) / rows[i][i];
    }
    solved
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::rng::{Draws, Purpose};

    const USABLE: [usize; 4] = [2, 3, 4, 10];

    /// Runs about a mean that moves with a parameter, two of the figures going together.
    fn runs(shift: f64, first: u64, n: u64) -> Vec<ScaledFigures> {
        let draws = Draws::new(3, Purpose::Resample);
        let run_of = |number: u64| {
            let mut run = [f64::NAN; D];
            for (place, &k) in USABLE.iter().enumerate() {
                run[k] = 0.3 * draws.normal(number, place as u64, 0);
            }
            run[3] += run[2] + shift;
            run[2] += shift;
            run
        };
        (first..first + n).map(run_of).collect()
    }

    fn moments(at: f64, n: u64) -> RunMoments {
        RunMoments::from_runs(at, runs(at, 0, n).iter(), &USABLE)
    }

    #[test]
    fn the_density_of_many_runs_is_students_about_their_mean() {
        let law = FigureDensity::at_value(&moments(0.0, 4000), &USABLE);
        // Student's density with 8 degrees of freedom in 4 dimensions, scaled to the scatter that was put in: at its middle, and
        // one standard deviation of figure 10 beside it. Determinant of the scatter: 0.3^8. From 4,000 runs: to 0.1.
        let log_density = |squares: f64| {
            libm::lgamma(6.0)
                - libm::lgamma(4.0)
                - 2.0 * libm::log(6.0 * std::f64::consts::PI)
                - 4.0 * libm::log(0.3)
                - 6.0 * libm::log1p(squares / 6.0)
        };
        let mut run = [f64::NAN; D];
        USABLE.iter().for_each(|&k| run[k] = 0.0);
        assert!(
            (law.log_density(&run) - log_density(0.0)).abs() < 0.1,
            "{}",
            law.log_density(&run)
        );
        run[10] = 0.3;
        assert!(
            (law.log_density(&run) - log_density(1.0)).abs() < 0.1,
            "{}",
            law.log_density(&run)
        );
    }

    #[test]
    fn the_parameter_under_which_a_run_was_made_is_the_most_probable_one_on_average() {
        let tried: Vec<RunMoments> = (0..5).map(|k| moments(0.25 * f64::from(k), 100)).collect();
        let smooth = SmoothDensity::fit(&tried, &USABLE).unwrap();
        let best = |run: &ScaledFigures| {
            let place = |k: u32| f64::from(k) / 100.0;
            let log = |k: &u32| smooth.law(place(*k)).log_density(run);
            place((0..=100).max_by(|a, b| log(a).total_cmp(&log(b))).unwrap())
        };
        let found: Vec<f64> = runs(0.5, 1000, 60).iter().map(best).collect();
        let mean = found.iter().sum::<f64>() / 60.0;
        // One run estimates it to 0.3, limited to the range that was tried: the mean of 60 has a standard error of 0.04.
        assert!((mean - 0.5).abs() < 0.12, "{mean}");
        // Between two tried values the density is the same without smoothing.
        let run = runs(0.5, 1000, 1)[0];
        let straight = interpolate(&tried[1], &tried[3], 0.5, &USABLE).log_density(&run);
        assert!((straight - smooth.law(0.5).log_density(&run)).abs() < 0.2, "{straight}");
    }

    #[test]
    fn figures_that_are_not_known_are_told_by_how_often_that_happens() {
        let mut some = runs(0.0, 0, 100);
        some.iter_mut().take(30).for_each(|run| run[3] = f64::NAN);
        let law =
            FigureDensity::at_value(&RunMoments::from_runs(0.0, some.iter(), &USABLE), &USABLE);
        let mut run = [f64::NAN; D];
        USABLE.iter().for_each(|&k| run[k] = 0.0);
        let known = law.log_density(&run);
        run[3] = f64::NAN;
        let unknown = law.log_density(&run);
        assert!(known.is_finite() && unknown.is_finite());
        // Where none of the runs has the figure, nobody can tell of it.
        some.iter_mut().for_each(|run| run[3] = f64::NAN);
        let law =
            FigureDensity::at_value(&RunMoments::from_runs(0.0, some.iter(), &USABLE), &USABLE);
        run[3] = 0.0;
        assert_eq!(law.log_density(&run), UNHEARD_OF);
    }

    #[test]
    fn a_polynomial_goes_through_what_is_one() {
        let places = [-1.0, -0.4, 0.1, 0.6, 1.0];
        let values = places.map(|u| 2.0 - 3.0 * u + 0.5 * u * u);
        let found = polynomial(&places, &values, 2);
        for (found, true_value) in found.iter().zip([2.0, -3.0, 0.5]) {
            assert!((found - true_value).abs() < 1e-12, "{found}");
        }
    }
}
