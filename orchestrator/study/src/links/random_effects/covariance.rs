//! How far levels of links reach: the length over which the covariance of residuals falls.
//!
//! Two rows of a link whose levels have the covariance sd² e^(-lag / length) have residuals whose product is that on the mean,
//! whatever the noise. The squares in which a fit takes levels for constant say less: how large they are best depends on how
//! densely links were measured, too.

use crate::thresholds::{
    CORRELATION_REACH, FEWEST_JACKKNIFE_GROUPS, FEWEST_LAG_PAIRS, JACKKNIFE_GROUPS, TAIL_90,
};
use numbers::optimise::pattern_search::PatternSearch;
use numbers::power::square;
use statrs::distribution::{ContinuousCDF as _, StudentsT};

/// A search ends this near (logarithm of the length) to an end of its range where it leads beyond.
const AT_END: f64 = 1e-6;

/// Lengths that are tried first, and how often the best is refined.
const LENGTHS: usize = 60;
const REFINED: usize = 30;

/// Products of residuals by lag, by part of the links.
#[derive(Clone, Debug)]
pub struct Products {
    edges: Vec<f64>,
    /// By group, by bin: number of pairs, sum of lags, sum of products.
    sums: Vec<Vec<[f64; 3]>>,
}

/// A fitted correlation length with its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorrelationLength {
    /// Where the covariance has fallen to 1/e.
    pub value: f64,
    /// Lower end of the 90 % interval.
    pub low: f64,
    /// Upper end of the 90 % interval.
    pub high: f64,
    /// Whether the length lies within the range in which lengths are sought, and at least one end of its interval does.
    pub is_determined: bool,
    /// Standard deviation of the levels (dB).
    pub sd_db: f64,
    /// Its relative standard error.
    pub sd_error: f64,
}

impl Products {
    /// Nothing yet. `edges`: ascending upper ends of the bins of lags.
    #[must_use]
    pub fn new(edges: Vec<f64>) -> Self {
        let sums = vec![vec![[0.0; 3]; edges.len()]; JACKKNIFE_GROUPS];
        Self { edges, sums }
    }

    /// Adds a pair of rows of a link. Lags beyond the last edge are left out.
    pub fn add(&mut self, link: usize, lag: f64, product: f64) {
        let bin = self.edges.partition_point(|&edge| edge < lag);
        if let Some(sum) = self.sums[link % JACKKNIFE_GROUPS].get_mut(bin) {
            *sum = [sum[0] + 1.0, sum[1] + lag, sum[2] + product];
        }
    }

    /// The length and its interval; none where the products tell none.
    #[must_use]
    pub fn length(&self) -> Option<CorrelationLength> {
        let bins = self.bins_without(None);
        let (shortest, longest) = range(&bins)?;
        let whole = fitted(&bins)?;
        let parts: Vec<[f64; 2]> = (0..JACKKNIFE_GROUPS)
            .filter(|&group| self.sums[group].iter().any(|sum| 0.0 < sum[0]))
            .filter_map(|group| fitted(&self.bins_without(Some(group))))
            .collect();
        let n = parts.len() as f64;
        if n < FEWEST_JACKKNIFE_GROUPS {
            return None;
        }
        let error = |k: usize| {
            let mean = parts.iter().map(|part| part[k]).sum::<f64>() / n;
            let squares: f64 = parts.iter().map(|part| square(part[k] - mean)).sum();
            ((n - 1.0) / n * squares).sqrt()
        };
        let quantile =
            StudentsT::new(0.0, 1.0, n - 1.0).map_or(1.7, |t| t.inverse_cdf(1.0 - TAIL_90));
        let half = quantile * error(0);
        let (low, high) = (whole[0] - half, whole[0] + half);
        Some(CorrelationLength {
            value: libm::exp(whole[0]),
            low: libm::exp(low.max(shortest)),
            high: libm::exp(high.min(longest)),
            is_determined: shortest + AT_END < whole[0]
                && whole[0] < longest - AT_END
                && (shortest <= low || high <= longest),
            sd_db: libm::exp(0.5 * whole[1]),
            sd_error: 0.5 * error(1),
        })
    }

    /// Mean lag, mean product and number of pairs by bin, without one group of rows (for the jackknife).
    fn bins_without(&self, group: Option<usize>) -> Vec<[f64; 3]> {
        let kept = || (0..JACKKNIFE_GROUPS).filter(|&other| Some(other) != group);
        (0..self.edges.len())
            .map(|bin| {
                let total = |k: usize| kept().map(|other| self.sums[other][bin][k]).sum::<f64>();
                [total(1) / total(0), total(2) / total(0), total(0)]
            })
            .filter(|bin| FEWEST_LAG_PAIRS <= bin[2])
            .collect()
    }
}

/// Logarithms of the shortest and the longest length that bins (lag, mean product, weight) can tell.
fn range(bins: &[[f64; 3]]) -> Option<(f64, f64)> {
    let last = bins.last()?[0];
    let first = bins.iter().map(|bin| bin[0]).find(|&lag| 0.0 < lag)?;
    (3 <= bins.len() && first < last)
        .then(|| (libm::log(first / CORRELATION_REACH), libm::log(last * CORRELATION_REACH)))
}

/// Logarithms of length and variance of the covariance that lies nearest to the bins (lag, mean product, weight).
fn fitted(bins: &[[f64; 3]]) -> Option<[f64; 2]> {
    let (low, high) = range(bins)?;
    // The variance follows from the length; what is left says how good both are.
    let fit_at = |ln_length: f64| {
        let length = libm::exp(ln_length);
        let (mut cross, mut squares) = (0.0, 0.0);
        for [lag, product, weight] in bins {
            let shape = libm::exp(-lag / length);
            cross += weight * shape * product;
            squares += weight * shape * shape;
        }
        let variance = (cross / squares).max(0.0);
        let gain = if 0.0 < cross { cross * cross / squares } else { 0.0 };
        (gain, variance)
    };
    let step = (high - low) / (LENGTHS - 1) as f64;
    let mut best = low;
    for k in 1..LENGTHS {
        let trial = low + k as f64 * step;
        if fit_at(best).0 < fit_at(trial).0 {
            best = trial;
        }
    }
    let search = PatternSearch {
        step: 0.7 * step,
        max_iterations: REFINED,
        contract: |step| 0.7 * step,
        contracts_always: true,
        ..PatternSearch::default()
    };
    let poll = |&ln_length: &f64, step: f64| {
        [ln_length - step, ln_length + step].map(|ln_length| ln_length.clamp(low, high))
    };
    let best = search.maximise(best, poll, |&ln_length| fit_at(ln_length).0).point;
    let (gain, variance) = fit_at(best);
    (0.0 < gain).then(|| [best, libm::log(variance)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::rng::{Draws, Purpose};

    /// Levels along a way that forget themselves over `length`, measured every metre with noise, on many links.
    fn products(length: f64, seed: u64) -> Products {
        let edges = vec![1.5, 2.5, 4.5, 8.5, 16.5, 32.5];
        let mut products = Products::new(edges);
        let draws = Draws::new(seed, Purpose::Resample);
        for link in 0..80u64 {
            let keeps = libm::exp(-1.0 / length);
            let mut level = draws.normal(link, 0, 0);
            let mut read = Vec::new();
            for step in 0..60u64 {
                level = keeps * level + (1.0 - keeps * keeps).sqrt() * draws.normal(link, step, 1);
                read.push(level + 1.5 * draws.normal(link, step, 2));
            }
            for (i, one) in read.iter().enumerate() {
                for (j, other) in read.iter().enumerate().skip(i + 1) {
                    products.add(link as usize, (j - i) as f64, one * other);
                }
            }
        }
        products
    }

    #[test]
    fn the_interval_covers_the_length_as_often_as_it_says() {
        for truth in [3.0, 8.0] {
            let covers = (0..100)
                .filter(|&seed| {
                    let found = products(truth, seed).length().unwrap();
                    found.low <= truth && truth <= found.high
                })
                .count();
            // 90 of 100 expected; outside of 82 to 97 in one case of 200.
            assert!((82..=97).contains(&covers), "{truth}: {covers}");
        }
    }

    #[test]
    fn a_covariance_that_does_not_fall_has_no_length_that_can_be_told() {
        let mut products = Products::new(vec![1.0, 2.0, 3.0, 4.0]);
        for link in 0..100 {
            for lag in 1..=4 {
                products.add(link, f64::from(lag), 1.0 + 0.01 * (link % 7) as f64);
            }
        }
        let found = products.length().unwrap();
        assert!(!found.is_determined, "{found:?}");
        // The longest length that is sought is four times the longest lag.
        assert!((found.value - 16.0).abs() < 1e-9, "{found:?}");
        assert!(found.low <= found.value && found.value <= found.high, "{found:?}");
        assert!(super::tests::products(3.0, 1).length().unwrap().is_determined);
    }

    #[test]
    fn noise_alone_has_no_length() {
        let mut products = Products::new(vec![1.0, 2.0, 3.0, 4.0]);
        for link in 0..100 {
            for lag in 1..=4 {
                products.add(link, f64::from(lag), -0.1);
            }
        }
        assert_eq!(products.length(), None);
    }
}
