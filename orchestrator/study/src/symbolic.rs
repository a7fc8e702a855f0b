//! Symbolic regression: the short formula of a covariate that predicts residuals best on rows left out.

use super::folds::Blocks;
use crate::thresholds::{FEWEST_FORMULA_ROWS, LONGER_FORMULA, MOST_WAVE_QUARTERS, PRODUCT_FORMULA};
use nalgebra::{DMatrix, DVector};
use numbers::power::{integer_power, square};
use numbers::statistics::mean_ignoring_nan;
use std::f64::consts::FRAC_PI_2;

/// A term whose mean square is less is nothing but rounding.
const NOTHING: f64 = 1e-12;
/// How often the step between two paces of a wave is halved, from a quarter of a cycle over the range on.
const HALVES: i32 = 5;

/// A short formula for the residuals of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedFormula {
    /// The expression, as `extend --formula` takes it.
    pub text: String,
    /// What it is added to: of links `mean` or `loss`, of robots a direction.
    pub target: &'static str,
    /// Of robots: the expression along the other direction of the same two, where there is something along both, and its target.
    pub also: Option<(String, &'static str)>,
    /// The rmse after all of it, of rows left out.
    pub rmse: f64,
}

impl FittedFormula {
    fn new(text: String, target: &'static str, rmse: f64) -> Self {
        Self { text, target, also: None, rmse }
    }
}

/// A function of a covariate, and of another.
type Function = Box<dyn Fn(f64, f64) -> f64>;

/// A formula in a covariate, or in two: its terms as text and as functions.
struct FormulaShape {
    terms: Vec<(String, Function)>,
    /// Of a wave: what the covariate is multiplied by.
    pace: Option<f64>,
}

impl FormulaShape {
    fn with_constant(terms: Vec<(String, Function)>) -> Self {
        let one: (String, Function) = ("1".to_owned(), Box::new(|_, _| 1.0));
        Self { terms: [one].into_iter().chain(terms).collect(), pace: None }
    }

    fn wave(name: &str, pace: f64) -> Self {
        let terms = vec![
            term(format!("sin({pace:.6e} * {name})"), move |x, _| libm::sin(pace * x)),
            term(format!("cos({pace:.6e} * {name})"), move |x, _| libm::cos(pace * x)),
        ];
        Self { pace: Some(pace), ..Self::with_constant(terms) }
    }
}

fn term(text: String, function: impl Fn(f64, f64) -> f64 + 'static) -> (String, Function) {
    (text, Box::new(function))
}

/// Shapes that a formula in one covariate may have, the simplest first. `quarter`: the pace of a quarter of a cycle over the
/// values known.
fn shapes(name: &str, known: &[f64], quarter: f64) -> Vec<FormulaShape> {
    let power = |power: i32| {
        let text = if power == 1 { name.to_owned() } else { format!("{name}^{power}") };
        term(text, move |x, _| integer_power(x, power))
    };
    let powers = |highest: i32| FormulaShape::with_constant((1..=highest).map(power).collect());
    let mut all: Vec<FormulaShape> = (1..=3).map(powers).collect();
    // A logarithm needs positive values.
    if known.first().is_some_and(|least| 0.0 < *least) {
        all.push(FormulaShape::with_constant(vec![term(format!("ln({name})"), |x, _| {
            libm::log(x)
        })]));
    }
    let quantile_at = |share: f64| known[((known.len() - 1) as f64 * share) as usize];
    for share in [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9] {
        let edge = quantile_at(share);
        let text = format!("step({name} - ({edge:.6}))");
        all.push(FormulaShape::with_constant(vec![term(text, move |x, _| {
            f64::from(u8::from(edge < x))
        })]));
    }
    all.extend((2..=MOST_WAVE_QUARTERS).map(|n| FormulaShape::wave(name, f64::from(n) * quarter)));
    all
}

/// Shapes in which what one covariate does depends on another.
fn products(name: &str, other: &str) -> Vec<FormulaShape> {
    let product = || term(format!("{name} * {other}"), |x, z| x * z);
    vec![
        FormulaShape::with_constant(vec![product()]),
        FormulaShape::with_constant(vec![term(name.to_owned(), |x, _| x), product()]),
    ]
}

/// The formula of deviations that are the same in every row.
#[must_use]
pub fn constant(deviations: &[f64], target: &'static str) -> Option<FittedFormula> {
    let level = mean_ignoring_nan(deviations.iter().copied());
    let rmse =
        mean_ignoring_nan(deviations.iter().map(|deviation| square(deviation - level))).sqrt();
    rmse.is_finite().then(|| FittedFormula::new(format!("{level:.6}"), target, rmse))
}

/// The residuals that a formula is to describe.
#[derive(Clone, Copy, Debug)]
pub struct UnexplainedResiduals<'a> {
    /// Measured less predicted, row by row; NaN where unknown.
    pub values: &'a [f64],
    /// What a formula is multiplied by: its name, and its values row by row.
    pub factor: Option<(&'static str, &'a [f64])>,
    /// What a formula is added to.
    pub target: &'static str,
}

/// The short formula of a covariate that predicts deviations best on rows left out. What the covariate does may depend on one of the
/// `others`.
#[must_use]
pub fn of_covariate(
    covariate: (&str, &[f64]),
    others: &[&(String, Vec<f64>)],
    deviations: UnexplainedResiduals<'_>,
    blocks: &Blocks,
) -> Option<FittedFormula> {
    let (name, values) = covariate;
    let rows: Vec<usize> = (0..values.len())
        .filter(|&row| values[row].is_finite() && deviations.values[row].is_finite())
        .collect();
    let mut known: Vec<f64> = rows.iter().map(|&row| values[row]).collect();
    known.sort_by(f64::total_cmp);
    if known.len() < FEWEST_FORMULA_ROWS {
        return None;
    }
    let data = Data { values, others: values, deviations, rows: &rows };
    let mut best: Option<(f64, String)> = None;
    let mut pace = None;
    let quarter = FRAC_PI_2 / (known[known.len() - 1] - known[0]);
    for shape in shapes(name, &known, quarter) {
        if data.improve(&mut best, &shape, LONGER_FORMULA, blocks) {
            pace = shape.pace;
        }
    }
    // The squared error has many minima over the pace of a wave, so the grid above finds the cycle and halvings refine
    // it.
    if let Some(mut pace) = pace {
        for half in 1..=HALVES {
            let step = quarter * integer_power(0.5, half);
            for other in [pace - step, pace + step] {
                if data.improve(&mut best, &FormulaShape::wave(name, other), 1.0, blocks) {
                    pace = other;
                }
            }
        }
    }
    let is_known = |other: &[f64]| rows.iter().all(|&row| other[row].is_finite());
    for (other, others) in others.iter().filter(|(other, of)| other != name && is_known(of)) {
        for shape in products(name, other) {
            Data { others, ..data }.improve(&mut best, &shape, PRODUCT_FORMULA, blocks);
        }
    }
    let (rmse, text) = best?;
    let text = match deviations.factor {
        Some((factor, _)) => format!("{factor} * ({text})"),
        None => text,
    };
    Some(FittedFormula::new(text, deviations.target, rmse))
}

/// What a formula is fitted to.
#[derive(Clone, Copy)]
struct Data<'a> {
    values: &'a [f64],
    others: &'a [f64],
    deviations: UnexplainedResiduals<'a>,
    rows: &'a [usize],
}

impl Data<'_> {
    /// Takes a shape in place of the best so far if the rmse of rows left out falls to less than `share` of that. Whether it did.
    fn improve(
        &self,
        best: &mut Option<(f64, String)>,
        shape: &FormulaShape,
        share: f64,
        blocks: &Blocks,
    ) -> bool {
        let Some(rmse) = self.held_out(shape, blocks) else { return false };
        if best.as_ref().is_some_and(|(least, _)| share * least <= rmse) {
            return false;
        }
        let Some(factors) = self.fitted(shape, self.rows.iter().copied()) else { return false };
        let parts = shape.terms.iter().zip(factors.iter());
        let text: Vec<String> = parts
            .map(|((term, _), factor)| match term.as_str() {
                "1" => format!("{factor:.6}"),
                term => format!("({factor:.6e}) * {term}"),
            })
            .collect();
        *best = Some((rmse, text.join(" + ")));
        true
    }

    /// The rmse of rows left out; none where the shape cannot be fitted.
    fn held_out(&self, shape: &FormulaShape, blocks: &Blocks) -> Option<f64> {
        let (mut squares, mut n_scored) = (0.0, 0usize);
        for fold in 0..blocks.n_folds() {
            let is_test = |row: usize| blocks.fold(row as u32) == fold;
            let train = self.rows.iter().copied().filter(|&row| !is_test(row));
            let factors = self.fitted(shape, train)?;
            for &row in self.rows.iter().filter(|&&row| is_test(row)) {
                let parts = shape.terms.iter().zip(factors.iter());
                let (x, z) = (self.values[row], self.others[row]);
                let value: f64 = parts.map(|((_, term), factor)| factor * term(x, z)).sum();
                let value = value * self.factor(row);
                squares += square(self.deviations.values[row] - value);
                n_scored += 1;
            }
        }
        let rmse = (squares / n_scored as f64).sqrt();
        rmse.is_finite().then_some(rmse)
    }

    /// What a formula is multiplied by in a row.
    fn factor(&self, row: usize) -> f64 {
        self.deviations.factor.map_or(1.0, |(_, factors)| factors[row])
    }

    /// Factors of the terms by least squares.
    fn fitted(
        &self,
        shape: &FormulaShape,
        rows: impl Iterator<Item = usize>,
    ) -> Option<DVector<f64>> {
        let n = shape.terms.len();
        let mut matrix = DMatrix::zeros(n, n);
        let mut vector = DVector::zeros(n);
        for row in rows {
            let (x, z) = (self.values[row], self.others[row]);
            let by = self.factor(row);
            let at: Vec<f64> = shape.terms.iter().map(|(_, term)| by * term(x, z)).collect();
            for i in 0..n {
                vector[i] += at[i] * self.deviations.values[row];
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
    use proto::rng::{Draws, Purpose};

    const N: u64 = 3000;

    fn noise() -> Vec<f64> {
        let draws = Draws::new(9, Purpose::Resample);
        (0..N).map(|row| draws.normal(row, 0, 0)).collect()
    }

    fn found(
        x: &[f64],
        others: &[&(String, Vec<f64>)],
        values: &[f64],
        factor: Option<(&'static str, &[f64])>,
    ) -> FittedFormula {
        let keys: Vec<u64> = (0..N).map(|row| row / 50).collect();
        let deviations = UnexplainedResiduals { values, factor, target: "mean" };
        of_covariate(("x", x), others, deviations, &Blocks::of_keys("blocks", &keys)).unwrap()
    }

    #[test]
    fn a_parabola_a_product_and_a_share_are_found() {
        let x: Vec<f64> = (0..N).map(|row| (row * 7919 % N) as f64 / N as f64).collect();
        let z: Vec<f64> = (0..N).map(|row| (row * 104_729 % N) as f64).collect();
        let simulated = |value: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
            noise()
                .iter()
                .zip(x.iter().zip(&z))
                .map(|(noise, (x, z))| noise + value(*x, *z))
                .collect()
        };
        let others = ("other".to_owned(), z.clone());
        let bent = found(&x, &[], &simulated(&|x, _| 4.0 * (x - 0.5) * (x - 0.5)), None);
        let turned = found(&x, &[&others], &simulated(&|x, z| x * (z / N as f64 - 0.5)), None);
        let share = found(&x, &[], &simulated(&|x, z| 1e-3 * z * x), Some(("other", &z)));
        for (formula, part) in [(bent, "x^2"), (turned, "x * other"), (share, "other * (")] {
            assert!(formula.text.contains(part), "{formula:?}");
            // The noise has an rmse of 1 +- 0.013.
            assert!((formula.rmse - 1.0).abs() < 0.06, "{formula:?}");
        }
    }

    #[test]
    fn the_pace_of_a_wave_is_found_between_quarters_of_a_cycle() {
        // 16.7 rad over all rows: 10.6 quarters of a cycle.
        let x: Vec<f64> = (0..N).map(|row| row as f64 / 180.0).collect();
        let y: Vec<f64> =
            noise().iter().zip(&x).map(|(z, x)| z + 4.0 * libm::sin(x + 0.3)).collect();
        let formula = found(&x, &[], &y, None);
        let after = formula.text.split("sin(").nth(1).unwrap();
        let pace: f64 = after.split(" *").next().unwrap().parse().unwrap();
        // A pace that is off by as much moves the wave by a hundredth of a cycle at the ends.
        assert!((pace - 1.0).abs() < 0.005, "{formula:?}");
        assert!((formula.rmse - 1.0).abs() < 0.06, "{formula:?}");
    }

    #[test]
    fn a_wave_that_vanishes_where_it_was_measured_is_no_formula() {
        let x: Vec<f64> = (0..N).map(|row| (row % 16) as f64).collect();
        let y: Vec<f64> = noise().iter().zip(&x).map(|(z, x)| z + (x % 2.0)).collect();
        let text = found(&x, &[], &y, None).text;
        assert!(!text.contains("e8") && !text.contains("e9") && !text.contains("e1"), "{text}");
    }
}
