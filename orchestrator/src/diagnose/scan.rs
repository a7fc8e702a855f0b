//! What is left over when no effect gains any more: structure over a covariate, and a short formula for it.

use super::gain::mean;
use super::ladder::{LEAST_SHARE, WORTH_NATS, WORTH_SHARE};
use crate::study::folds::Blocks;
use nalgebra::{DMatrix, DVector};
use proto::rng::{Draws, Purpose};
use statrs::distribution::{ContinuousCDF, Gamma};

/// All covariates together may be called structure wrongly with this probability.
const FAMILY_ERROR: f64 = 0.005;
/// Bins of a covariate …
const BINS: usize = 10;
/// … and, where nothing is found so, of one that comes and goes.
const FINE_BINS: usize = 30;
/// Flips of the signs of whole blocks.
const FLIPS: u64 = 200;

/// A longer formula must bring the rmse to less than this share of what a shorter one leaves …
const LONGER: f64 = 0.998;
/// … and one of two covariates, of which many are tried, to less than this.
const TWOFOLD: f64 = 0.99;
/// A term whose mean square is less is nothing but rounding.
const NOTHING: f64 = 1e-12;
/// Most cycles of a formula over the range of a covariate, in quarters.
const MOST_QUARTERS: u32 = 48;

/// Structure over a covariate.
#[derive(Clone, Debug, PartialEq)]
pub struct Structure {
    /// The covariate.
    pub covariate: String,
    /// The share of what is left that it explains, what chance explains taken off.
    pub explained: f64,
    /// Probability of as much by chance.
    pub p_value: f64,
    /// A short formula of the covariate (dB), if one explains readings, and the rmse of readings after it (dB).
    pub formula: Option<(String, f64)>,
}

/// Residuals that have a mean of 0 and a variance of 1 each where the model is right.
#[derive(Clone, Copy, Debug)]
pub struct Residuals<'a> {
    /// Row by row.
    pub values: &'a [f64],
    /// How many times greater the mean square error of the model as configured is than what is left: shares of the one are so
    /// many times smaller than shares of the other. At least 1.
    pub configured: f64,
}

impl Residuals<'_> {
    /// Whether structure that explains this share is worth telling: as for effects, by nats, or by the share of the error.
    fn are_worth(&self, explained: f64) -> bool {
        let nats = -0.5 * (1.0 - explained).ln();
        WORTH_NATS <= nats || WORTH_SHARE.max(LEAST_SHARE * self.configured) <= explained
    }
}

/// The strongest structure, if there is any, in these residuals over `covariates`. Rows of one block of `levels` may depend on
/// each other.
#[must_use]
pub fn strongest(
    covariates: &[(String, Vec<f64>)],
    residuals: &[Residuals<'_>],
    levels: &[&Blocks],
) -> Option<Structure> {
    let in_bins = |n_bins| strongest_in(covariates, residuals, levels, n_bins);
    in_bins(BINS).or_else(|| in_bins(FINE_BINS))
}

/// The same in so many bins of each covariate.
fn strongest_in(
    covariates: &[(String, Vec<f64>)],
    residuals: &[Residuals<'_>],
    levels: &[&Blocks],
    n_bins: usize,
) -> Option<Structure> {
    let tests = (2 * covariates.len() * residuals.len()).max(1) as f64;
    let mut best: Option<Structure> = None;
    for (name, values) in covariates {
        let Some(bins) = binned(values, n_bins) else { continue };
        for residual in residuals {
            let Some((explained, p_value)) = weighed(&bins, residual.values, levels, n_bins) else {
                continue;
            };
            let found = p_value < FAMILY_ERROR / tests
                && residual.are_worth(explained)
                && best.as_ref().is_none_or(|best| best.explained < explained);
            if found {
                best =
                    Some(Structure { covariate: name.clone(), explained, p_value, formula: None });
            }
        }
    }
    best
}

/// The bin of each row; `u8::MAX` where the covariate is unknown.
fn binned(values: &[f64], n_bins: usize) -> Option<Vec<u8>> {
    let mut known: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    known.sort_by(f64::total_cmp);
    if known.len() < 20 * n_bins {
        return None;
    }
    let mut edges: Vec<f64> = (1..n_bins).map(|k| known[k * (known.len() - 1) / n_bins]).collect();
    edges.dedup();
    let bin = |value: &f64| {
        if value.is_finite() { edges.partition_point(|edge| edge <= value) as u8 } else { u8::MAX }
    };
    Some(values.iter().map(bin).collect())
}

/// The share of a residual's squares between bins, chance taken off, and its probability by chance: signs of whole blocks
/// flipped at random (the wild cluster bootstrap of Cameron, Gelbach and Miller 2008), a gamma law fitted to what comes.
fn weighed(bins: &[u8], residual: &[f64], levels: &[&Blocks], n_bins: usize) -> Option<(f64, f64)> {
    let rows: Vec<usize> =
        (0..bins.len()).filter(|&row| bins[row] != u8::MAX && residual[row].is_finite()).collect();
    if rows.len() < 20 * n_bins {
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
    let squares: f64 = rows.iter().map(|&row| (residual[row] - mean).powi(2)).sum();
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
        for flip in 0..FLIPS {
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
        let n = FLIPS as f64;
        let mean = first / n;
        let variance = (second / n - mean * mean).max(1e-12);
        let law = Gamma::new(mean * mean / variance, mean / variance).ok()?;
        p_value = p_value.max(law.sf(observed));
        expected = expected.max(mean);
    }
    Some((((observed - expected) / squares).max(0.0), p_value))
}

/// A function of a covariate, and of another.
type Function = Box<dyn Fn(f64, f64) -> f64>;

/// A formula in a covariate, or in two: its terms as text and as functions.
struct Shape {
    terms: Vec<(String, Function)>,
}

impl Shape {
    fn of(terms: Vec<(String, Function)>) -> Self {
        let one: (String, Function) = ("1".to_owned(), Box::new(|_, _| 1.0));
        Self { terms: [one].into_iter().chain(terms).collect() }
    }
}

fn term(text: String, function: impl Fn(f64, f64) -> f64 + 'static) -> (String, Function) {
    (text, Box::new(function))
}

/// Shapes that a formula in one covariate may have, the simplest first.
fn shapes(name: &str, known: &[f64]) -> Vec<Shape> {
    let power = |power: i32| {
        let text = if power == 1 { name.to_owned() } else { format!("{name}^{power}") };
        term(text, move |x, _| x.powi(power))
    };
    let powers = |highest: i32| Shape::of((1..=highest).map(power).collect());
    let mut all: Vec<Shape> = (1..=3).map(powers).collect();
    if known.first().is_some_and(|least| 0.0 < *least) {
        all.push(Shape::of(vec![term(format!("ln({name})"), |x, _| x.ln())]));
    }
    let at = |share: f64| known[((known.len() - 1) as f64 * share) as usize];
    for share in [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9] {
        let edge = at(share);
        let text = format!("step({name} - ({edge:.6}))");
        all.push(Shape::of(vec![term(text, move |x, _| f64::from(u8::from(edge < x)))]));
    }
    let span = at(1.0) - at(0.0);
    for quarter in 2..=MOST_QUARTERS {
        let pace = std::f64::consts::TAU * f64::from(quarter) / 4.0 / span;
        all.push(Shape::of(vec![
            term(format!("sin({pace:.6e} * {name})"), move |x, _| (pace * x).sin()),
            term(format!("cos({pace:.6e} * {name})"), move |x, _| (pace * x).cos()),
        ]));
    }
    all
}

/// Shapes in which what one covariate does depends on another.
fn products(name: &str, other: &str) -> Vec<Shape> {
    let product = || term(format!("{name} * {other}"), |x, z| x * z);
    vec![Shape::of(vec![product()]), Shape::of(vec![term(name.to_owned(), |x, _| x), product()])]
}

/// The formula of deviations that are the same in every row, and the rmse after it.
#[must_use]
pub fn constant(deviations: &[f64]) -> Option<(String, f64)> {
    let level = mean(deviations.iter().copied());
    let rmse = mean(deviations.iter().map(|deviation| (deviation - level).powi(2))).sqrt();
    rmse.is_finite().then(|| (format!("{level:.6}"), rmse))
}

/// The short formula of a covariate that predicts deviations best on rows left out, and the rmse after it. What the covariate does may
/// depend on one of the `others`.
#[must_use]
pub fn formula(
    covariate: (&str, &[f64]),
    others: &[&(String, Vec<f64>)],
    deviation_db: &[f64],
    blocks: &Blocks,
) -> Option<(String, f64)> {
    let (name, values) = covariate;
    let rows: Vec<usize> = (0..values.len())
        .filter(|&row| values[row].is_finite() && deviation_db[row].is_finite())
        .collect();
    let mut known: Vec<f64> = rows.iter().map(|&row| values[row]).collect();
    known.sort_by(f64::total_cmp);
    if known.len() < 20 * BINS {
        return None;
    }
    let data = Data { values, others: values, deviation_db, rows: &rows };
    let mut best: Option<(f64, String)> = None;
    for shape in shapes(name, &known) {
        data.improve(&mut best, &shape, LONGER, blocks);
    }
    let is_known = |other: &[f64]| rows.iter().all(|&row| other[row].is_finite());
    for (other, others) in others.iter().filter(|(other, of)| other != name && is_known(of)) {
        for shape in products(name, other) {
            Data { others, ..data }.improve(&mut best, &shape, TWOFOLD, blocks);
        }
    }
    best.map(|(rmse, text)| (text, rmse))
}

/// What a formula is fitted to.
#[derive(Clone, Copy)]
struct Data<'a> {
    values: &'a [f64],
    others: &'a [f64],
    deviation_db: &'a [f64],
    rows: &'a [usize],
}

impl Data<'_> {
    /// Takes a shape in place of the best so far if the rmse of rows left out falls to less than `share` of that.
    fn improve(
        &self,
        best: &mut Option<(f64, String)>,
        shape: &Shape,
        share: f64,
        blocks: &Blocks,
    ) {
        let Some(rmse) = self.held_out(shape, blocks) else { return };
        if best.as_ref().is_some_and(|(least, _)| share * least <= rmse) {
            return;
        }
        let Some(factors) = self.fitted(shape, self.rows.iter().copied()) else { return };
        let parts = shape.terms.iter().zip(factors.iter());
        let text: Vec<String> = parts
            .map(|((term, _), factor)| match term.as_str() {
                "1" => format!("{factor:.6}"),
                term => format!("({factor:.6e}) * {term}"),
            })
            .collect();
        *best = Some((rmse, text.join(" + ")));
    }

    /// The rmse of rows left out; none where the shape cannot be fitted.
    fn held_out(&self, shape: &Shape, blocks: &Blocks) -> Option<f64> {
        let (mut squares, mut n_scored) = (0.0, 0usize);
        for fold in 0..blocks.n_folds() {
            let is_test = |row: usize| blocks.fold(row as u32) == fold;
            let train = self.rows.iter().copied().filter(|&row| !is_test(row));
            let factors = self.fitted(shape, train)?;
            for &row in self.rows.iter().filter(|&&row| is_test(row)) {
                let parts = shape.terms.iter().zip(factors.iter());
                let (x, z) = (self.values[row], self.others[row]);
                let value: f64 = parts.map(|((_, term), factor)| factor * term(x, z)).sum();
                squares += (self.deviation_db[row] - value).powi(2);
                n_scored += 1;
            }
        }
        let rmse = (squares / n_scored as f64).sqrt();
        rmse.is_finite().then_some(rmse)
    }

    /// Factors of the terms by least squares.
    fn fitted(&self, shape: &Shape, rows: impl Iterator<Item = usize>) -> Option<DVector<f64>> {
        let n = shape.terms.len();
        let mut matrix = DMatrix::zeros(n, n);
        let mut vector = DVector::zeros(n);
        for row in rows {
            let (x, z) = (self.values[row], self.others[row]);
            let at: Vec<f64> = shape.terms.iter().map(|(_, term)| term(x, z)).collect();
            for i in 0..n {
                vector[i] += at[i] * self.deviation_db[row];
                for j in 0..n {
                    matrix[(i, j)] += at[i] * at[j];
                }
            }
        }
        // A wave may vanish wherever the covariate was measured: at channels, say.
        let vanishes = (0..n).any(|i| matrix[(i, i)] < NOTHING * matrix[(0, 0)]);
        if vanishes {
            return None;
        }
        matrix.cholesky().map(|factor| factor.solve(&vector))
    }
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
        let residuals = |values, configured| Residuals { values, configured };
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
        let (text, rmse) = formula(("x", &x), &[], &bent, &blocks).unwrap();
        assert!(text.contains("x^2"), "{text}");
        // The noise has an rmse of 1 +- 0.013.
        assert!((rmse - 1.0).abs() < 0.06, "{rmse}");
        let [_, (other, z)] = covariates;
        let turned: Vec<f64> =
            (0..bent.len()).map(|row| plain[row] + x[row] * (z[row] / n as f64 - 0.5)).collect();
        let (text, rmse) = formula(("x", &x), &[&(other, z)], &turned, &blocks).unwrap();
        assert!(text.contains("x * other"), "{text}");
        assert!((rmse - 1.0).abs() < 0.06, "{rmse}");
    }

    #[test]
    fn what_comes_and_goes_is_found_where_few_bins_show_nothing() {
        let n = 3000;
        let x: Vec<f64> = (0..n).map(|row| (row * 7919 % n) as f64 / n as f64).collect();
        let pulse = |x: &f64| if (10.0 * x).fract() < 0.5 { 0.3 } else { -0.3 };
        let values: Vec<f64> = noise(n).iter().zip(&x).map(|(z, x)| z + pulse(x)).collect();
        let residuals = [Residuals { values: &values, configured: 1.0 }];
        let (covariates, blocks) = ([("x".to_owned(), x)], blocks(n));
        assert_eq!(strongest_in(&covariates, &residuals, &[&blocks], BINS), None);
        let found = strongest(&covariates, &residuals, &[&blocks]).unwrap();
        assert!((0.05..0.1).contains(&found.explained), "{found:?}");
    }

    #[test]
    fn a_wave_that_vanishes_where_it_was_measured_is_no_formula() {
        let n = 3000;
        let x: Vec<f64> = (0..n).map(|row| (row % 16) as f64).collect();
        let y: Vec<f64> = noise(n).iter().zip(&x).map(|(z, x)| z + (x % 2.0)).collect();
        let (text, _) = formula(("x", &x), &[], &y, &blocks(n)).unwrap();
        assert!(!text.contains("e8") && !text.contains("e9") && !text.contains("e1"), "{text}");
    }
}
