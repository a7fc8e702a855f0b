//! The search over a study that is made up: a straight-line model with unit noise, in which candidates are columns.

use super::*;
use crate::identifiability::detection::Detection;
use crate::identifiability::noise::Noise;
use proto::effect::Level;
use proto::rng::{Draws, Purpose};
use std::sync::Mutex;
use study::folds::Blocks;
use study::linear::{Column, Dependence, Direction, Group, Linearised, Partition};
use study::symbolic::FittedFormula;
use study::thresholds::{FAMILY_ERROR, TIED_ERRORS, TIED_NATS, UNCORRECTED_LEVEL, WORTH_NATS};
use study::{COMMON, Candidate, Estimate, NotLimited, PerTerm, Residuals, RowScore};

const ROWS: u64 = 3000;
/// Members whose rows take turns.
const MEMBERS: u32 = 10;

/// y = Σ βₖ xₖ + noise of variance 1.
struct Lines {
    candidates: PerTerm<Candidate>,
    columns: PerTerm<Vec<f64>>,
    y: Vec<f64>,
    /// A second channel, and the share of what is predicted of y that is predicted of it.
    positions: Option<(Vec<f64>, f64)>,
    blocks: Blocks,
}

#[derive(Clone)]
struct LineFit {
    terms: Vec<TermId>,
    slopes: Vec<f64>,
    log_likelihood: f64,
}

pub(crate) fn candidate(name: &str) -> Candidate {
    Candidate {
        name: name.to_owned(),
        about: None,
        is_spread: false,
        level: Level::Time,
        parameters: &[],
        n_parameters: 1,
        generalises: Vec::new(),
        linear_in: None,
        is_derived: false,
        untestable: None,
        only: None,
        another_of: None,
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
        let columns: PerTerm<Vec<f64>> = (0..names.len()).map(column).collect();
        let y = (0..n_rows as usize)
            .map(|row| {
                let values: Vec<f64> = columns.iter().map(|column| column[row]).collect();
                measured(&values) + draws.normal(row as u64, 1000, 0)
            })
            .collect();
        let keys: Vec<u64> = (0..n_rows).map(|row| row / 50).collect();
        let blocks = Blocks::of_keys("blocks", &keys);
        let candidates = names.iter().map(|name| candidate(name)).collect();
        Self { candidates, columns, y, positions: None, blocks }
    }

    /// The term of a name.
    fn term(&self, name: &str) -> TermId {
        self.candidates.find(|candidate| candidate.name == name).unwrap()
    }

    fn set_column(&mut self, name: &str, column: &[f64]) {
        let term = self.term(name);
        let columns = self.columns.ids().zip(self.columns.iter());
        let columns = columns.map(|(other, own)| if other == term { column } else { own });
        self.columns = columns.map(<[f64]>::to_vec).collect();
    }

    fn predicted(&self, fit: &LineFit, row: usize) -> f64 {
        let parts = fit.terms.iter().zip(&fit.slopes);
        parts.map(|(&term, slope)| slope * self.columns[term][row]).sum()
    }

    fn log_density(&self, fit: &LineFit, row: usize) -> f64 {
        log_density_of(self.y[row] - self.predicted(fit, row))
    }
}

fn log_density_of(left: f64) -> f64 {
    -0.5 * (left * left + libm::log(std::f64::consts::TAU))
}

impl Study for Lines {
    type Fit = LineFit;

    fn candidates(&self) -> &PerTerm<Candidate> {
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
        terms: &[TermId],
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

    fn formula_of_curve(&self, _term: TermId, _fit_without: &LineFit) -> Option<FittedFormula> {
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
                heading_squared_error_rad2: f64::NAN,
                log_of_position: self.positions.as_ref().map_or(f64::NAN, |(positions, share)| {
                    log_density_of(
                        positions[row as usize] - share * self.predicted(fit, row as usize),
                    )
                }),
                crps: left.abs(),
                reception_log_loss: f64::NAN,
            }
        };
        test.iter().map(score).collect()
    }

    fn linearised(&self, fit: &LineFit) -> Option<Linearised> {
        let one = |value: f64| [value, 0.0, 0.0];
        let left = |row: usize| self.y[row] - self.predicted(fit, row);
        let column = |&term: &TermId| self.columns[term].iter().map(|x| one(*x)).collect();
        Some(Linearised {
            slopes: (0..self.y.len()).map(|row| one(left(row))).collect(),
            weights: vec![one(1.0); self.y.len()],
            estimated: fit.terms.iter().map(column).collect(),
            errors: (0..self.y.len()).map(|row| [left(row), f64::NAN, f64::NAN]).collect(),
            directions: Vec::new(),
        })
    }

    fn columns(&self, _fit: &LineFit, term: TermId) -> Vec<Column> {
        vec![self.columns[term].iter().map(|x| [*x, 0.0, 0.0]).collect()]
    }

    fn columns_of_curve(&self, _fit: &LineFit, _term: TermId) -> Vec<Column> {
        Vec::new()
    }

    fn directions(&self) -> Vec<Direction> {
        let column = vec![[1.0, 0.0, 0.0]; self.y.len()];
        vec![Direction { name: "lines are off", unit: "m", column }]
    }

    /// Ten members take turns.
    fn partitions(&self) -> Vec<Partition> {
        let rows = |id: u32| (id..self.y.len() as u32).step_by(MEMBERS as usize).collect();
        let groups = (0..MEMBERS).map(|id| Group { id, rows: rows(id) }).collect();
        vec![Partition { of: "member", key: Some("agents"), groups }]
    }

    fn dependence(&self) -> Dependence {
        let rows = 0..self.y.len() as u32;
        Dependence {
            times_s: rows.clone().map(|row| f64::from(row / MEMBERS)).collect(),
            series: rows.clone().map(|row| row % MEMBERS).collect(),
            campaigns: rows.map(|_| 0).collect(),
            shortest_s: 3.0,
            nodes: None,
            replicates: None,
        }
    }

    fn add_limited(&mut self, term: TermId, only: &toml::Table) -> Result<TermId, NotLimited> {
        let members: Option<Vec<i64>> = only.get("agents").and_then(|agents| {
            Some(agents.as_array()?.iter().filter_map(toml::Value::as_integer).collect())
        });
        let moment_s = |key: &str| only.get(key).and_then(toml::Value::as_float);
        let is_in = |row: usize| {
            let time_s = (row / MEMBERS as usize) as f64;
            let member = (row % MEMBERS as usize) as i64;
            members.as_ref().is_none_or(|members| members.contains(&member))
                && moment_s("from_s").is_none_or(|from_s| from_s <= time_s)
                && moment_s("until_s").is_none_or(|until_s| time_s < until_s)
        };
        let column = self.columns[term].iter().enumerate();
        let column = column.map(|(row, x)| if is_in(row) { *x } else { 0.0 }).collect();
        let unlimited = self.candidates[term].clone();
        let name = format!("{} (only {only:?})", unlimited.name);
        self.candidates.push(Candidate { name, only: Some(only.clone()), ..unlimited });
        Ok(self.columns.push(column))
    }

    fn estimates(&self, _fit: &LineFit, _term: TermId) -> (Vec<Estimate>, Option<String>) {
        (Vec::new(), None)
    }

    fn settings(&self, _fit: &LineFit, _term: TermId) -> Option<toml::Table> {
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

#[test]
fn a_term_is_accepted_from_the_amplitude_on_that_is_said_to_be_found_and_hardly_at_half_of_it() {
    let names = ["a", "b", "c", "d", "e"];
    let study = Lines::new(&names, 100, |_| 0.0);
    let search = Search::new(&study, &|_| {});
    let fit = search.full_fit(&[], COMMON, None);
    let noise = Noise { rows: study.linearised(&fit).unwrap(), rms: 1.0 };
    let term = study.term("a");
    let column = &study.columns(&fit, term)[0];
    let amplitudes = Detection::new(&search, &noise).amplitudes(term, column).unwrap();
    let found = amplitudes.found.unwrap();
    let n_found = |amplitude: f64| {
        let is_found = |&seed: &u64| {
            accepted(&Lines::new(&names, seed, |x| amplitude * x[0])).iter().any(|name| name == "a")
        };
        (0..40).filter(is_found).count()
    };
    // Of 40 campaigns 36 are expected, with a standard deviation of 2.
    assert!(31 <= n_found(found), "{} at {found}", n_found(found));
    assert!(n_found(0.5 * found) <= 12, "{} at half of {found}", n_found(0.5 * found));
}

/// A term that one channel shows, beside another channel that shows a share of it and of which another share is predicted.
fn beside_positions(shown: f64, predicted: f64) -> (Lines, TermId) {
    let mut study = Lines::new(&["a", "b"], 3, |x| 0.8 * x[0]);
    let term = study.term("a");
    let draws = Draws::new(4, Purpose::Resample);
    let position = |(row, x): (usize, &f64)| 0.8 * shown * x + draws.normal(row as u64, 0, 0);
    let positions = study.columns[term].iter().enumerate().map(position).collect();
    study.positions = Some((positions, predicted));
    (study, term)
}

#[test]
fn a_term_that_only_headings_show_is_known_and_one_that_positions_contradict_is_refused() {
    let judged = |shown, predicted| {
        let (study, term) = beside_positions(shown, predicted);
        let search = Search::new(&study, &|_| {});
        (search.channel_without(term, &[]), search.contradiction(term, &[]).is_some())
    };
    assert_eq!(judged(1.0, 1.0), (None, false));
    assert_eq!(judged(0.0, 1e-3), (Some(Channel::Positions), false));
    assert_eq!(judged(0.0, 1.0), (Some(Channel::Positions), true));
    let alone = Lines::new(&["a", "b"], 3, |x| 0.8 * x[0]);
    let search = Search::new(&alone, &|_| {});
    assert_eq!(search.channel_without(alone.term("a"), &[]), None);
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
    let gain = search.gain(&[study.term("a")], &[], Level::Time);
    assert!(gain.p_value < FAMILY_ERROR && gain.gain < WORTH_NATS, "{gain:?}");
    assert_eq!(search.stepwise_selection().accepted, Vec::<TermId>::new());
}

#[test]
fn two_columns_that_are_one_are_tied() {
    let mut study = Lines::new(&["a", "b", "c"], 3, |x| 0.5 * x[0]);
    let [a, c] = ["a", "c"].map(|name| study.term(name));
    let twice: Vec<f64> = study.columns[a].iter().map(|x| 2.0 * x).collect();
    study.set_column("c", &twice);
    let ladder = Search::new(&study, &|_| {}).stepwise_selection();
    assert_eq!(ladder.accepted.len(), 1);
    let test = ladder.test_of(ladder.accepted[0]).unwrap();
    assert_eq!(test.ties, [if test.term == a { c } else { a }]);
}

#[test]
fn what_gains_as_much_is_tied_even_where_chance_cannot_be_excluded_for_it_alone() {
    let (mut n_alike, mut n_less) = (0, 0);
    for seed in 0..100 {
        let mut study = Lines::of_rows(1500, &["a", "b", "c"], seed, |x| 0.2 * x[0]);
        let [a, b, c] = ["a", "b", "c"].map(|name| study.term(name));
        for scatter in [0.3, 1.0] {
            let mixed = study.columns[a].iter().zip(&study.columns[b]);
            let mixed: Vec<f64> = mixed.map(|(a, b)| a + scatter * b).collect();
            study.set_column("c", &mixed);
            let ladder = Search::new(&study, &|_| {}).stepwise_selection();
            let Some(test) = ladder.test_of(a) else { continue };
            let search = Search::new(&study, &|_| {});
            let other = search.gain(&[c], &[], Level::Time);
            if ladder.accepted != [a] || other.p_value < FAMILY_ERROR {
                continue;
            }
            let over = search.gain(&[a], &[c], Level::Time);
            let is_near = other.p_value < UNCORRECTED_LEVEL
                && (over.gain <= TIED_ERRORS * over.standard_error || over.total() <= TIED_NATS);
            let is_tied = test.ties.contains(&c);
            assert!(is_near || !is_tied, "seed {seed}, scatter {scatter}");
            n_alike += u32::from(is_tied);
            n_less += u32::from(!is_near);
        }
    }
    assert!(0 < n_alike && 0 < n_less, "{n_alike} {n_less}");
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

fn selected(study: &mut Lines) -> Vec<(String, Option<toml::Table>)> {
    let (ladder, _) = select(study, None, &|_| {});
    let candidate = |&term: &TermId| &study.candidates[term];
    let only =
        |c: &Candidate| (c.name.split(' ').next().unwrap_or_default().to_owned(), c.only.clone());
    ladder.accepted.iter().map(candidate).map(only).collect()
}

/// Lines of which y is measured with its row.
fn of_row(seed: u64, measured: impl Fn(usize, &[f64]) -> f64) -> Lines {
    let mut study = Lines::new(&["a", "b"], seed, |_| 0.0);
    let described = |own: &Candidate| Candidate { about: Some(&ABOUT), ..own.clone() };
    study.candidates = study.candidates.iter().map(described).collect();
    for row in 0..study.y.len() {
        let values: Vec<f64> = study.columns.iter().map(|column| column[row]).collect();
        study.y[row] += measured(row, &values);
    }
    study
}

const ABOUT: proto::effect::About = proto::effect::About {
    mechanism: "",
    equation: "",
    source: "",
    validity: "",
    trace: "",
    needs: &[],
    example: "",
};

fn members(id: i64) -> toml::Table {
    format!("agents = [{id}]").parse().unwrap()
}

#[test]
fn what_gains_by_no_more_than_rows_in_a_row_share_is_withheld_and_said() {
    // What acts is another in each of 24 spans of time; blocks that are left out are a sixteenth as long.
    let mut n_withheld = 0;
    for seed in 0..20 {
        let draws = Draws::new(seed, Purpose::Resample);
        let strength = |row: usize| 0.3 + 0.9 * draws.normal((row / 800) as u64, 2000, 0);
        let mut study = Lines::of_rows(24 * 800, &["a", "b"], seed, |_| 0.0);
        let column = &study.columns[study.term("a")];
        for (row, (y, x)) in study.y.iter_mut().zip(column).enumerate() {
            *y += strength(row) * x;
        }
        let ladder = Search::new(&study, &|_| {}).stepwise_selection();
        let withheld: Vec<TermId> = ladder.withheld().collect();
        assert!(withheld.iter().all(|term| !ladder.accepted.contains(term)), "seed {seed}");
        n_withheld += withheld.len();
    }
    assert!(0 < n_withheld);
}

#[test]
fn what_acts_on_one_of_ten_is_named_with_it() {
    let mut study = of_row(3, |row, x| if row % 10 == 4 { 0.8 * x[1] } else { 0.0 });
    assert_eq!(selected(&mut study), [("b".to_owned(), Some(members(4)))]);
    // What acts on all alike is not limited, and what acts on each otherwise names none.
    let mut study = of_row(3, |_, x| 0.5 * x[1]);
    assert_eq!(selected(&mut study), [("b".to_owned(), None)]);
    let mut study =
        of_row(3, |row, x| [0.9, 0.1, 0.6, 0.3, 1.1, 0.0, 0.7, 0.2, 0.5, 0.8][row % 10] * x[1]);
    assert_eq!(selected(&mut study), [("b".to_owned(), None)]);
}

#[test]
fn what_acts_on_one_from_a_moment_on_is_named_with_it() {
    let mut study =
        of_row(5, |row, x| if row % 10 == 4 && 1500 <= row { -0.9 * x[0] } else { 0.0 });
    let found = selected(&mut study);
    let [(name, Some(only))] = &found[..] else { panic!("{found:?}") };
    assert_eq!((name.as_str(), &only["agents"]), ("a", &members(4)["agents"]));
    let from_s = only["from_s"].as_float().unwrap();
    assert!((140.0..160.0).contains(&from_s), "{from_s}");
    assert!(!only.contains_key("until_s"));
    let mut study = of_row(6, |row, x| if row < 900 { 0.5 * x[0] } else { 0.0 });
    let found = selected(&mut study);
    let [(name, Some(only))] = &found[..] else { panic!("{found:?}") };
    let until_s = only["until_s"].as_float().unwrap();
    assert!(name == "a" && (85.0..95.0).contains(&until_s) && only.len() == 1, "{only}");
}

#[test]
fn where_nothing_acts_nothing_is_limited() {
    for seed in 0..20 {
        assert_eq!(selected(&mut of_row(seed, |_, _| 0.0)), [], "{seed}");
    }
}

/// A curve, one effect that is nearly the same, and one of its own.
fn beside_a_curve(likeness: f64) -> Lines {
    let mut lines = Lines::new(&["curve:dust", "effect", "other"], 9, |x| 0.5 * x[0] + 0.5 * x[2]);
    let [curve, effect] = ["curve:dust", "effect"].map(|name| lines.term(name));
    let pairs = lines.columns[curve].iter().zip(&lines.columns[effect]);
    let like = pairs.map(|(a, b)| likeness * a + (1.0 - likeness * likeness).sqrt() * b);
    let like: Vec<f64> = like.collect();
    lines.set_column("effect", &like);
    lines
}

#[test]
fn the_effect_that_explains_most_of_a_curve_is_nearest_to_it() {
    let report = |_: SearchProgress<'_>| {};
    let nearest = |likeness: f64| {
        let lines = beside_a_curve(likeness);
        let search = Search::new(&lines, &report);
        let [curve, effect, other] = ["curve:dust", "effect", "other"].map(|name| lines.term(name));
        let found = search.nearest_effect(curve, &[other]);
        assert!(found.as_ref().is_none_or(|found| found.term == effect), "{found:?}");
        found
    };
    // It explains the square of its correlation with the curve.
    let most = nearest(0.95).expect("nine tenths");
    assert!((most.share - 0.9).abs() < 0.06 && most.may_be_cause(), "{most:?}");
    let half = nearest(0.8).expect("six tenths");
    assert!((half.share - 0.64).abs() < 0.08 && !half.may_be_cause(), "{half:?}");
    assert_eq!(nearest(0.3), None);
}

#[test]
fn two_effects_may_together_be_the_cause_of_a_curve() {
    let report = |_: SearchProgress<'_>| {};
    let nearest = |of_second: f64| {
        let sum =
            |first: f64, second: f64| (1.0 - of_second).sqrt() * first + of_second.sqrt() * second;
        let names = ["curve:dust", "first", "second", "other"];
        let mut lines = Lines::new(&names, 9, |x| 0.5 * sum(x[1], x[2]));
        let [curve, first, second, _] = names.map(|name| lines.term(name));
        let pairs = lines.columns[first].iter().zip(&lines.columns[second]);
        let dust: Vec<f64> = pairs.map(|(&first, &second)| sum(first, second)).collect();
        lines.set_column("curve:dust", &dust);
        let found =
            Search::new(&lines, &report).nearest_effect(curve, &[]).expect("more than half");
        (found.term == first, found.beside == Some(second), found.may_be_cause())
    };
    assert_eq!(nearest(0.4), (true, true, true));
    assert_eq!(nearest(0.05), (true, false, true), "one is enough");
}

#[test]
fn what_is_part_of_a_curve_does_not_survive_beside_it() {
    let report = |_: SearchProgress<'_>| {};
    let survive = |likeness: f64| {
        let lines = beside_a_curve(likeness);
        let search = Search::new(&lines, &report);
        let [effect, other] = ["effect", "other"].map(|name| lines.term(name));
        let ladder = Ladder {
            accepted: vec![effect, other],
            rungs: Vec::new(),
            tests: Vec::new(),
            too_little: None,
            stopped: None,
        };
        [effect, other].map(|term| search.survives_beside_curves(term, &ladder, &["dust"]))
    };
    assert_eq!(survive(0.95), [false, true]);
}
