//! Structure of the residuals over a covariate, looked for when no candidate gains any more.

use super::acceptance::{is_worth, share_scale};
use super::ladder::{Ladder, Search, without_term};
use super::score_test::ScoreTests;
use numbers::power::square;
use numbers::statistics::nth_quantile;
use proto::rng::{Draws, Purpose};
use statrs::distribution::{ContinuousCDF, FisherSnedecor, Gamma};
use std::collections::{BTreeMap, BTreeSet};
use study::folds::Blocks;
use study::linear::{Dependence, Linearised};
use study::symbolic::FittedFormula;
use study::thresholds::{
    FAMILY_ERROR, FEWEST_STRUCTURE_BIN_ROWS, FINE_STRUCTURE_BINS, LEAST_ERROR_SHARE,
    RIVAL_STRUCTURE, SIGN_FLIPS, STRUCTURE_BINS, UNCORRECTED_LEVEL,
};
use study::{COMMON, Study};

/// A significant dependence of the residuals on a covariate.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ResidualStructure {
    /// Name of the covariate.
    pub covariate: String,
    /// The share of the residual variance that it explains, less what it would explain by chance.
    pub explained: f64,
    /// P-value by flipping the signs of whole blocks.
    pub p_value: f64,
    /// In which of the residuals it is, by number.
    pub residual: usize,
    /// Other covariates over which there is at least half as much structure: it may be theirs.
    pub others: Vec<String>,
    /// A short formula of the covariate, if there is one.
    pub formula: Option<FittedFormula>,
}

impl ResidualStructure {
    /// What knowing it would gain (nats per row), of normal residuals.
    pub(crate) fn nats(&self) -> f64 {
        nats(self.explained)
    }
}

/// What a share of the variance is worth (nats per row).
fn nats(explained: f64) -> f64 {
    -0.5 * libm::log(1.0 - explained)
}

/// What the selected model leaves unexplained.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Unexplained {
    /// Formulas of the accepted curves, by the names of the curves.
    pub formulas: BTreeMap<String, FittedFormula>,
    /// The strongest structure that nothing in the model explains.
    pub structure: Option<ResidualStructure>,
    /// Whether residuals were searched for structure.
    pub is_searched: bool,
}

/// Standardised residuals: mean 0 and variance 1 where the model is right.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StandardisedResiduals<'a> {
    /// A value per row; NaN where there is none.
    pub values: &'a [f64],
    /// Mean squared error of the model as configured over that of these residuals, at least 1: it scales shares of the one to shares
    /// of the other.
    pub configured: f64,
}

impl StandardisedResiduals<'_> {
    /// Whether structure that explains this share is worth telling: as for effects, by nats, or by the share of the error.
    fn are_worth(&self, explained: f64) -> bool {
        is_worth(nats(explained), LEAST_ERROR_SHARE * self.configured, || explained)
    }
}

/// What the ladder leaves unexplained: for each curve that was accepted its formula, and the strongest structure of the residuals over a
/// covariate.
#[must_use]
pub(crate) fn scan_residuals<S: Study>(
    study: &S,
    search: &Search<'_, S>,
    ladder: &Ladder,
) -> Unexplained {
    let mut formulas = BTreeMap::new();
    for &term in ladder.accepted.iter().filter(|_| !search.is_stopped()) {
        let candidate = &study.candidates()[term];
        if candidate.curve_over().is_none() {
            continue;
        }
        let fit = search.full_fit(&without_term(&ladder.accepted, term), COMMON, None);
        if let Some(formula) = study.formula_of_curve(term, &fit) {
            formulas.insert(candidate.name.clone(), formula);
        }
    }
    let levels = study.scanned_blocks();
    if !ladder.is_complete() || search.is_stopped() || levels.is_empty() {
        return Unexplained { formulas, structure: None, is_searched: false };
    }
    let fit = search.full_fit(&ladder.accepted, COMMON, None);
    let unexplained = study.scanned_residuals(&fit);
    let (first, last) = (&ladder.rungs[0], &ladder.rungs[ladder.rungs.len() - 1]);
    let mean_square = unexplained.mean_square.unwrap_or_else(|| last.scores.mean_square());
    let scale = share_scale(first.scores.mean_square(), mean_square);
    let residuals: Vec<StandardisedResiduals<'_>> = unexplained
        .components
        .iter()
        .map(|component| StandardisedResiduals {
            values: &component.standardised,
            configured: if component.is_of_error { scale } else { 1.0 },
        })
        .collect();
    let mut covariates = study.scanned_covariates();
    let mut structure = strongest(&covariates, &residuals, &levels);
    while let Some(found) = &structure
        && !stands_clustered(study, &covariates, found, residuals[found.residual].values)
    {
        let name = found.covariate.clone();
        covariates.retain(|(other, _)| *other != name);
        structure = strongest(&covariates, &residuals, &levels);
    }
    if let Some(structure) = &mut structure {
        structure.formula = study.formula_of_residuals(&structure.covariate, &fit);
    }
    Unexplained { formulas, structure, is_searched: true }
}

/// Whether structure over a covariate is beyond what links share that have a node in common, and those at one time. Its shape, the mean
/// residual in each bin, is one of as many contrasts as there are bins (H. Scheffé, A method for judging all contrasts in the
/// analysis of variance, Biometrika 40, 1953). Where nothing can be told, it stands.
fn stands_clustered<S: Study>(
    study: &S,
    covariates: &[(String, Vec<f64>)],
    found: &ResidualStructure,
    residual: &[f64],
) -> bool {
    let values = covariates.iter().find(|(name, _)| *name == found.covariate);
    let Some((_, values)) = values else { return true };
    let Some(bins) = binned(values, STRUCTURE_BINS) else { return true };
    let dependence = study.dependence();
    let Some(nodes) = &dependence.nodes else { return true };
    if is_of_few_nodes(values, nodes) {
        return false;
    }
    let known = |value: &f64| if value.is_finite() { [*value, 1.0] } else { [0.0; 2] };
    let part = |k: usize| residual.iter().map(|value| [known(value)[k], 0.0, 0.0]).collect();
    // All rows may be off alike.
    let estimated = vec![vec![[1.0, 0.0, 0.0]; residual.len()]];
    let rows = Linearised { slopes: part(0), weights: part(1), estimated, ..Linearised::default() };
    let mut sums = [[0.0; 2]; 256];
    for (bin, (slopes, weights)) in bins.iter().zip(rows.slopes.iter().zip(&rows.weights)) {
        let sum = &mut sums[usize::from(*bin)];
        *sum = [sum[0] + slopes[0], sum[1] + weights[0]];
    }
    let shape = |bin: &u8| {
        let [slope, weight] = sums[usize::from(*bin)];
        [if *bin == u8::MAX || weight <= 0.0 { 0.0 } else { slope / weight }, 0.0, 0.0]
    };
    let column = bins.iter().map(shape).collect();
    // What nodes differ by lasts: no block of time is long enough for it, and the nodes alone tell.
    let of_nodes =
        Dependence { times_s: vec![f64::NAN; dependence.times_s.len()], ..dependence.clone() };
    let told = [&dependence, &of_nodes].into_iter();
    let mut told = told.filter_map(|rest| ScoreTests::new(&rows, rest).test(&column, &[]));
    let Some(test) = told.next() else { return true };
    let t = test.amplitude / test.standard_error;
    let n = (STRUCTURE_BINS - 1) as f64;
    let p_value = FisherSnedecor::new(n, test.freedom).map_or(1.0, |law| law.sf(t * t / n));
    p_value < UNCORRECTED_LEVEL
}

/// Whether a covariate has one value for each sender, or each receiver, and these values are too few to tell it from what nodes differ by:
/// any shape in so many bins fits them. A node that moves counts once, however many squares it passes.
fn is_of_few_nodes(values: &[f64], nodes: &[[u32; 2]]) -> bool {
    (0..2).any(|end| {
        let mut of_node: BTreeMap<u32, f64> = BTreeMap::new();
        let is_of_node = values
            .iter()
            .zip(nodes)
            .filter(|(value, _)| value.is_finite())
            .all(|(value, ends)| of_node.entry(ends[end]).or_insert(*value) == value);
        let different: BTreeSet<u64> = of_node.values().map(|value| value.to_bits()).collect();
        is_of_node && different.len() < 2 * STRUCTURE_BINS
    })
}

/// The strongest structure, if there is any, in these residuals over `covariates`. Rows of one block of `levels` may depend on
/// each other.
#[must_use]
pub(crate) fn strongest(
    covariates: &[(String, Vec<f64>)],
    residuals: &[StandardisedResiduals<'_>],
    levels: &[&Blocks],
) -> Option<ResidualStructure> {
    let in_bins = |n_bins| strongest_in(covariates, residuals, levels, n_bins);
    in_bins(STRUCTURE_BINS).or_else(|| in_bins(FINE_STRUCTURE_BINS))
}

/// The same in so many bins of each covariate.
fn strongest_in(
    covariates: &[(String, Vec<f64>)],
    residuals: &[StandardisedResiduals<'_>],
    levels: &[&Blocks],
    n_bins: usize,
) -> Option<ResidualStructure> {
    let tests = (2 * covariates.len() * residuals.len()).max(1) as f64;
    let mut all: Vec<ResidualStructure> = Vec::new();
    for (name, values) in covariates {
        let Some(bins) = binned(values, n_bins) else { continue };
        for (number, residual) in residuals.iter().enumerate() {
            let Some((explained, p_value)) = test_structure(&bins, residual.values, levels, n_bins)
            else {
                continue;
            };
            let found = p_value < FAMILY_ERROR / tests && residual.are_worth(explained);
            if found {
                all.push(ResidualStructure {
                    covariate: name.clone(),
                    explained,
                    p_value,
                    residual: number,
                    others: Vec::new(),
                    formula: None,
                });
            }
        }
    }
    // The first of equal ones.
    let best = all.iter().rev().max_by(|a, b| a.explained.total_cmp(&b.explained))?.clone();
    let is_other = |one: &&ResidualStructure| {
        one.covariate != best.covariate && RIVAL_STRUCTURE * best.explained <= one.explained
    };
    let mut others: Vec<String> =
        all.iter().filter(is_other).map(|one| one.covariate.clone()).collect();
    others.dedup();
    Some(ResidualStructure { others, ..best })
}

/// The bin of each row; `u8::MAX` where the covariate is unknown.
fn binned(values: &[f64], n_bins: usize) -> Option<Vec<u8>> {
    let mut known: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    known.sort_by(f64::total_cmp);
    if known.len() < FEWEST_STRUCTURE_BIN_ROWS * n_bins {
        return None;
    }
    let mut edges: Vec<f64> = (1..n_bins).map(|k| nth_quantile(&known, k, n_bins)).collect();
    edges.dedup();
    let bin = |value: &f64| {
        if value.is_finite() { edges.partition_point(|edge| edge <= value) as u8 } else { u8::MAX }
    };
    Some(values.iter().map(bin).collect())
}

/// The share of a residual's sum of squares between bins, less its expectation under the null hypothesis, and its p-value. The null
/// distribution is a gamma law fitted to a wild cluster bootstrap (Cameron, Gelbach and Miller 2008): random sign flips of whole
/// blocks.
fn test_structure(
    bins: &[u8],
    residual: &[f64],
    levels: &[&Blocks],
    n_bins: usize,
) -> Option<(f64, f64)> {
    let rows: Vec<usize> =
        (0..bins.len()).filter(|&row| bins[row] != u8::MAX && residual[row].is_finite()).collect();
    if rows.len() < FEWEST_STRUCTURE_BIN_ROWS * n_bins {
        return None;
    }
    let mut counts = [0.0f64; 256];
    for &row in &rows {
        counts[usize::from(bins[row])] += 1.0;
    }
    let n_rows = rows.len() as f64;
    // About the mean: what is the same everywhere is no structure over anything.
    let between = |sums: &[f64]| -> f64 {
        let within = sums.iter().zip(&counts).filter(|(_, n)| 0.0 < **n);
        let total: f64 = sums.iter().sum();
        within.map(|(sum, n)| sum * sum / n).sum::<f64>() - total * total / n_rows
    };
    let mean = rows.iter().map(|&row| residual[row]).sum::<f64>() / n_rows;
    let squares: f64 = rows.iter().map(|&row| square(residual[row] - mean)).sum();
    let mut sums = [0.0; 256];
    for &row in &rows {
        sums[usize::from(bins[row])] += residual[row];
    }
    let observed = between(&sums);
    let mut p_value: f64 = 0.0;
    let mut expected: f64 = 0.0;
    let draws = Draws::new(2, Purpose::Resample);
    for blocks in levels {
        // Sums by block and bin: a flip then costs no pass over the rows.
        let n_bins = n_bins + 1;
        let mut parts = vec![0.0; blocks.n_blocks() * n_bins];
        for &row in &rows {
            let block = blocks.of_row[row] as usize;
            parts[block * n_bins + usize::from(bins[row])] += residual[row];
        }
        let (mut first, mut second) = (0.0, 0.0);
        for flip in 0..SIGN_FLIPS {
            let mut sums = [0.0; 256];
            for (block, part) in parts.chunks(n_bins).enumerate() {
                let [word, ..] = draws.words(flip, block as u64, 0);
                let sign = if word & 1 == 0 { 1.0 } else { -1.0 };
                for (sum, part) in sums.iter_mut().zip(part) {
                    *sum += sign * part;
                }
            }
            let chance = between(&sums);
            first += chance;
            second += chance * chance;
        }
        let n = SIGN_FLIPS as f64;
        let mean = first / n;
        let variance = (second / n - mean * mean).max(1e-12);
        let law = Gamma::new(mean * mean / variance, mean / variance).ok()?;
        p_value = p_value.max(law.sf(observed));
        expected = expected.max(mean);
    }
    Some((((observed - expected) / squares).max(0.0), p_value))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(n: u64) -> Vec<f64> {
        let draws = Draws::new(9, Purpose::Resample);
        (0..n).map(|row| draws.normal(row, 0, 0)).collect()
    }

    fn blocks(n: u64) -> Blocks {
        let keys: Vec<u64> = (0..n).map(|row| row / 50).collect();
        Blocks::of_keys("blocks", &keys)
    }

    #[test]
    fn nothing_is_found_in_noise_and_a_parabola_where_there_is_one() {
        let n = 3000;
        let x: Vec<f64> = (0..n).map(|row| (row * 7919 % n) as f64 / n as f64).collect();
        let other: Vec<f64> = (0..n).map(|row| (row * 104_729 % n) as f64).collect();
        let covariates = [("x".to_owned(), x.clone()), ("other".to_owned(), other)];
        let blocks = blocks(n);
        let plain = noise(n);
        let residuals = |values, configured| StandardisedResiduals { values, configured };
        assert_eq!(strongest(&covariates, &[residuals(&plain, 1.0)], &[&blocks]), None);
        let bent: Vec<f64> = plain
            .iter()
            .zip(&x)
            .map(|(z, x)| z + 4.0 * (x - 0.5) * (x - 0.5) - 1.0 / 3.0)
            .collect();
        let found = strongest(&covariates, &[residuals(&bent, 1.0)], &[&blocks]).unwrap();
        assert_eq!(found.covariate, "x");
        // What all rows are off alike is structure over neither.
        let off: Vec<f64> = plain.iter().map(|z| z + 0.3).collect();
        assert_eq!(strongest(&covariates, &[residuals(&off, 1.0)], &[&blocks]), None);
    }

    #[test]
    fn what_is_given_for_each_of_a_few_nodes_is_not_told_from_their_differences() {
        let nodes = |n: u32| -> Vec<[u32; 2]> { (0..200).map(|row| [row % n, row % 7]).collect() };
        let of_sender = |nodes: &[[u32; 2]]| -> Vec<f64> {
            nodes.iter().map(|ends| f64::from(ends[0])).collect()
        };
        let (few, many) = (nodes(19), nodes(20));
        assert!(is_of_few_nodes(&of_sender(&few), &few));
        assert!(!is_of_few_nodes(&of_sender(&many), &many));
        let varying: Vec<f64> = (0..200).map(f64::from).collect();
        assert!(!is_of_few_nodes(&varying, &few));
    }

    #[test]
    fn what_comes_and_goes_is_found_where_few_bins_show_nothing() {
        let n = 3000;
        let x: Vec<f64> = (0..n).map(|row| (row * 7919 % n) as f64 / n as f64).collect();
        let pulse = |x: &f64| if (10.0 * x).fract() < 0.5 { 0.3 } else { -0.3 };
        let values: Vec<f64> = noise(n).iter().zip(&x).map(|(z, x)| z + pulse(x)).collect();
        let residuals = [StandardisedResiduals { values: &values, configured: 1.0 }];
        let (covariates, blocks) = ([("x".to_owned(), x)], blocks(n));
        assert_eq!(strongest_in(&covariates, &residuals, &[&blocks], STRUCTURE_BINS), None);
        let found = strongest(&covariates, &residuals, &[&blocks]).unwrap();
        assert!((0.05..0.1).contains(&found.explained), "{found:?}");
    }
}
