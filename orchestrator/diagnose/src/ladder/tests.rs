//! The search over a study that is made up: a straight-line model with unit noise, in which candidates are columns.

use super::*;
use proto::rng::{Draws, Purpose};
use study::folds::Blocks;
use study::symbolic::FittedFormula;
use study::{Estimate, Residuals};

const ROWS: u64 = 3000;

/// y = Σ βₖ xₖ + noise of variance 1.
struct Lines {
    candidates: Vec<Candidate>,
    columns: Vec<Vec<f64>>,
    y: Vec<f64>,
    blocks: Blocks,
}

#[derive(Clone)]
struct LineFit {
    terms: Vec<usize>,
    slopes: Vec<f64>,
    log_likelihood: f64,
}

fn candidate(name: &str) -> Candidate {
    Candidate {
        name: name.to_owned(),
        about: None,
        level: Level::Time,
        n_parameters: 1,
        generalises: Vec::new(),
        linear_in: None,
        is_derived: false,
        untestable: None,
        stands_in_for: None,
    }
}

impl Lines {
    /// Columns of noise, and what is measured of them.
    fn new(names: &[&str], seed: u64, measured: impl Fn(&[f64]) -> f64) -> Self {
        Self::of_rows(ROWS, names, seed, measured)
    }

    fn of_rows(n_rows: u64, names: &[&str], seed: u64, measured: impl Fn(&[f64]) -> f64) -> Self {
        let draws = Draws::new(seed, Purpose::Resample);
        let column = |k: usize| (0..n_rows).map(|row| draws.normal(row, k as u64, 0)).collect();
        let columns: Vec<Vec<f64>> = (0..names.len()).map(column).collect();
        let y = (0..n_rows as usize)
            .map(|row| {
                let values: Vec<f64> = columns.iter().map(|column| column[row]).collect();
                measured(&values) + draws.normal(row as u64, 1000, 0)
            })
            .collect();
        let keys: Vec<u64> = (0..n_rows).map(|row| row / 50).collect();
        let blocks = Blocks::of_keys("blocks", &keys);
        let candidates = names.iter().map(|name| candidate(name)).collect();
        Self { candidates, columns, y, blocks }
    }

    fn predicted(&self, fit: &LineFit, row: usize) -> f64 {
        let parts = fit.terms.iter().zip(&fit.slopes);
        parts.map(|(&term, slope)| slope * self.columns[term][row]).sum()
    }

    fn log_density(&self, fit: &LineFit, row: usize) -> f64 {
        let left = self.y[row] - self.predicted(fit, row);
        -0.5 * (left * left + libm::log(std::f64::consts::TAU))
    }
}

impl Study for Lines {
    type Fit = LineFit;

    fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    fn n_rows(&self) -> usize {
        self.y.len()
    }

    fn blocks(&self, _level: Level) -> &Blocks {
        &self.blocks
    }

    /// Coordinate descent to the least squares.
    fn fit(
        &self,
        terms: &[usize],
        train: &[u32],
        _level: Level,
        _start: Option<&LineFit>,
    ) -> LineFit {
        let slopes = vec![0.0; terms.len()];
        let mut fit = LineFit { terms: terms.to_vec(), slopes, log_likelihood: 0.0 };
        for _ in 0..20 {
            for (k, &term) in terms.iter().enumerate() {
                let (mut along, mut norm) = (0.0, 0.0);
                for &row in train {
                    let (row, x) = (row as usize, self.columns[term][row as usize]);
                    along += x * (self.y[row] - self.predicted(&fit, row));
                    norm += x * x;
                }
                fit.slopes[k] += along / norm;
            }
        }
        fit.log_likelihood = train.iter().map(|&row| self.log_density(&fit, row as usize)).sum();
        fit
    }

    fn scanned_covariates(&self) -> Vec<(String, Vec<f64>)> {
        Vec::new()
    }

    fn scanned_blocks(&self) -> Vec<&Blocks> {
        Vec::new()
    }

    fn scanned_residuals(&self, _fit: &LineFit) -> Residuals {
        Residuals { components: Vec::new(), mean_square: None }
    }

    fn formula_of_curve(&self, _term: usize, _fit_without: &LineFit) -> Option<FittedFormula> {
        None
    }

    fn formula_of_residuals(&self, _covariate: &str, _fit: &LineFit) -> Option<FittedFormula> {
        None
    }

    fn log_likelihood(&self, fit: &LineFit) -> f64 {
        fit.log_likelihood
    }

    fn scores(&self, fit: &LineFit, test: &[u32]) -> Vec<RowScore> {
        let score = |&row: &u32| {
            let left = self.y[row as usize] - self.predicted(fit, row as usize);
            RowScore {
                log: self.log_density(fit, row as usize),
                squared_error: left * left,
                plain_squared_error: f64::NAN,
                crps: left.abs(),
                reception_log_loss: f64::NAN,
            }
        };
        test.iter().map(score).collect()
    }

    fn estimates(&self, _fit: &LineFit, _term: usize) -> (Vec<Estimate>, Option<String>) {
        (Vec::new(), None)
    }

    fn settings(&self, _fit: &LineFit, _term: usize) -> Option<toml::Table> {
        None
    }
}

fn accepted(study: &Lines) -> Vec<String> {
    let ladder = Search::new(study, &|_| {}).stepwise_selection();
    ladder.accepted.iter().map(|&term| study.candidates[term].name.clone()).collect()
}

#[test]
fn the_terms_that_act_are_accepted_the_stronger_one_first_and_no_other() {
    let names = ["a", "b", "c", "d", "e"];
    let study = Lines::new(&names, 3, |x| 0.3 * x[1] + 0.8 * x[3]);
    assert_eq!(accepted(&study), ["d", "b"]);
}

/// With five candidates and 0.5 % for all of them, one of 20 searches accepts anything in 10 % of the cases.
#[test]
fn where_nothing_acts_nothing_is_accepted() {
    for seed in 0..20 {
        let study = Lines::new(&["a", "b", "c", "d", "e"], seed, |_| 0.0);
        assert_eq!(accepted(&study), Vec::<String>::new(), "seed {seed}");
    }
}

#[test]
fn a_term_that_is_significant_and_not_worth_having_is_refused() {
    // 0.5 · 0.07² = 0.0025 nats a row and 0.5 % of the error: 29 nats in all, but a quarter and a half of what is worth having.
    let study = Lines::of_rows(4 * ROWS, &["a", "b"], 3, |x| 0.07 * x[0]);
    let search = Search::new(&study, &|_| {});
    let gain = search.gain(&[0], &[], Level::Time);
    assert!(gain.p_value < acceptance::FAMILY_ERROR && gain.gain < WORTH_NATS, "{gain:?}");
    assert_eq!(search.stepwise_selection().accepted, Vec::<usize>::new());
}

#[test]
fn two_columns_that_are_one_are_tied() {
    let mut study = Lines::new(&["a", "b", "c"], 3, |x| 0.5 * x[0]);
    study.columns[2] = study.columns[0].iter().map(|x| 2.0 * x).collect();
    let ladder = Search::new(&study, &|_| {}).stepwise_selection();
    assert_eq!(ladder.accepted.len(), 1);
    let test = ladder.tests.iter().find(|test| test.term == ladder.accepted[0]).unwrap();
    assert_eq!(test.ties, [2 - ladder.accepted[0]]);
}

#[test]
fn a_search_reports_rounds_what_it_tried_and_what_it_accepted() {
    let study = Lines::new(&["a", "b"], 3, |x| 0.8 * x[1]);
    let log = Mutex::new(Vec::new());
    let report = |progress: SearchProgress<'_>| log.lock().unwrap().push(format!("{progress:?}"));
    Search::new(&study, &report).stepwise_selection();
    let log = log.into_inner().unwrap();
    let count = |part: &str| log.iter().filter(|line| line.starts_with(part)).count();
    assert_eq!((count("Round"), count("Tried"), count("Accepted"), count("Ties")), (2, 4, 1, 1));
    assert!(log.iter().any(|line| line.contains("name: \"b\"")), "{log:?}");
}
