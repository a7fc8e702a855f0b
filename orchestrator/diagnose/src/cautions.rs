//! What to mind of an accepted effect or curve: that the log score alone shows it, and that it includes a constant by which all rows are
//! off. `temperature` may set the reference, and a curve its level, so that a constant error goes into them and `system-gain` is not named.

use crate::gate::decimals;
use crate::ladder::{Ladder, Search, without_term};
use crate::score_test::ScoreTests;
use numbers::format::{number, with_unit};
use numbers::normal::Z_90;
use numbers::quantity;
use numbers::statistics::mean_ignoring_nan;
use proto::effect::Level;
use study::linear::{Dependence, Direction, Linearised};
use study::thresholds::FAR_HALF_INTERVALS;
use study::{COMMON, Candidate, Study, TermId};

/// What to mind of an accepted effect or curve that the log score alone shows; `step`: its place among what was accepted. What lowers the log
/// loss of reception shows there.
pub(crate) fn only_in_log_score(
    candidate: &Candidate,
    ladder: &Ladder,
    step: usize,
) -> Option<String> {
    let scores = |rung: usize| Some(&ladder.rungs.get(rung)?.scores);
    let (before, after) = (scores(step)?, scores(step + 1)?);
    let losses_fall = after.reception_log_loss < before.reception_log_loss;
    let is_alone = before.log_score < after.log_score && before.rmse <= after.rmse && !losses_fall;
    let why = if candidate.is_spread || candidate.level == Level::Random {
        "it widens the spread"
    } else {
        "large errors count less in the log score"
    };
    is_alone.then(|| format!("the log score rises though the rmse does not fall: {why}"))
}

/// The constant that an accepted effect or curve includes, as a clause. None where it includes none, or where rows may be off in several
/// directions, as those of robots.
pub(crate) fn constant_within<S: Study>(
    search: &Search<'_, S>,
    ladder: &Ladder,
    term: TermId,
) -> Option<String> {
    let study = search.study();
    let candidate = &study.candidates()[term];
    let directions = study.directions();
    let [direction] = &directions[..] else { return None };
    if !has_free_offset(candidate) || search.is_stopped() {
        return None;
    }
    let others = without_term(&ladder.accepted, term);
    let rows = |terms: &[TermId]| study.linearised(&search.full_fit(terms, COMMON, None));
    let (with, without) = (rows(&ladder.accepted)?, rows(&others)?);
    let constant = included([&with, &without], &study.dependence(), direction)?;
    let covariates = study.scanned_covariates();
    let middle = candidate.linear_in.and_then(|over| {
        let (_, values) = covariates.iter().find(|(name, _)| name == over)?;
        let middle = number(mean_ignoring_nan(values.iter().copied()));
        let middle = with_unit(&middle, quantity::unit(over).unwrap_or_default());
        Some(format!("at the mean {} of {middle}", quantity::words(over)))
    });
    let middle = middle.unwrap_or_else(|| "as the mean over all rows".to_owned());
    Some(format!(
        "it includes a constant of {constant:+.*} {} {middle}",
        decimals(constant, 1.0),
        direction.unit
    ))
}

/// Whether a candidate can move all rows alike as well as it follows its covariate: a curve of readings, or an effect that is linear in a
/// covariate and has another parameter, the covariate's zero.
fn has_free_offset(candidate: &Candidate) -> bool {
    let is_curve = candidate.curve_over().is_some() && !candidate.is_of_losses();
    let has_zero = candidate.linear_in.is_some() && 1 < candidate.parameters.len();
    candidate.only.is_none() && (is_curve || has_zero)
}

/// The constant by which rows are off without a term and not with it, in the unit of errors. It is certain beyond [`FAR_HALF_INTERVALS`]
/// halves of its 90 % interval. Where a model has a constant already, none is left to include.
fn included(
    [with, without]: [&Linearised; 2],
    dependence: &Dependence,
    direction: &Direction,
) -> Option<f64> {
    let far = FAR_HALF_INTERVALS * Z_90;
    let test = ScoreTests::new(without, dependence).test_in_noise_of(&direction.column, with)?;
    let left = ScoreTests::new(with, dependence).test(&direction.column, &[]);
    let is_left = left.is_some_and(|left| far * left.standard_error < left.amplitude.abs());
    (far * test.standard_error < test.amplitude.abs() && !is_left).then_some(test.amplitude)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gain::Scores;
    use crate::ladder::LadderStep;
    use crate::ladder::tests::candidate;
    use proto::effect::Parameter;
    use proto::rng::{Draws, Purpose};

    /// Rows of two series, 5 s apart, with these errors and normal noise.
    fn off(by: impl Fn(usize) -> f64) -> (Linearised, Dependence) {
        let n = 2000;
        let draws = Draws::new(1, Purpose::Resample);
        let errors: Vec<[f64; 3]> =
            (0..n).map(|row| [by(row) + draws.normal(row as u64, 0, 0), 0.0, 0.0]).collect();
        let rows = Linearised {
            slopes: errors.clone(),
            weights: vec![[1.0, 0.0, 0.0]; n],
            estimated: Vec::new(),
            errors,
            directions: Vec::new(),
        };
        let dependence = Dependence {
            times_s: (0..n).map(|row| 5.0 * (row / 2) as f64).collect(),
            series: (0..n).map(|row| (row % 2) as u32).collect(),
            campaigns: vec![0; n],
            shortest_s: 10.0,
            nodes: None,
            replicates: None,
        };
        (rows, dependence)
    }

    fn constant_of(without: impl Fn(usize) -> f64, with: impl Fn(usize) -> f64) -> Option<f64> {
        let [(without, dependence), (with, _)] = [off(without), off(with)];
        let column = vec![[1.0, 0.0, 0.0]; without.errors.len()];
        let direction = Direction { name: "readings are off", unit: "dB", column };
        included([&with, &without], &dependence, &direction)
    }

    #[test]
    fn an_effect_that_raises_the_log_score_and_not_the_rmse_is_accepted_with_a_clause() {
        let scores = |log_score, rmse, reception_log_loss| Scores {
            log_score,
            rmse,
            reception_log_loss,
            rmse_received_db: None,
            rmse_heading_rad: None,
            crps: 1.0,
        };
        let of = |candidate: &Candidate, after: Scores| {
            let rungs = [scores(1.0, 2.0, 0.5), after];
            let rungs = rungs.map(|scores| LadderStep { terms: Vec::new(), scores });
            let ladder = Ladder {
                accepted: Vec::new(),
                rungs: rungs.into(),
                tests: Vec::new(),
                too_little: None,
                stopped: None,
            };
            only_in_log_score(candidate, &ladder, 0)
        };
        let mean = candidate("yaw-coupling");
        let spread = Candidate { is_spread: true, ..candidate("fast-fading") };
        let start = "the log score rises though the rmse does not fall: ";
        let expected = format!("{start}it widens the spread");
        assert_eq!(of(&spread, scores(1.5, 2.0, 0.5)), Some(expected));
        let expected = format!("{start}large errors count less in the log score");
        assert_eq!(of(&mean, scores(1.5, 2.25, f64::NAN)), Some(expected));
        for after in [scores(1.5, 1.75, 0.5), scores(1.5, 2.0, 0.25), scores(0.5, 2.0, 0.5)] {
            assert_eq!(of(&mean, after), None);
        }
    }

    #[test]
    fn a_constant_that_goes_with_an_effect_is_included_in_it() {
        let slope = |row: usize| libm::sin(row as f64 / 50.0);
        let constant = constant_of(|row| 2.0 + slope(row), |_| 0.0).unwrap();
        // The mean of 2,000 rows of variance 1, and of a sine of 6.4 periods.
        assert!((constant - 2.0).abs() < 0.1, "{constant}");
        assert_eq!(constant_of(slope, |_| 0.0), None);
        // The effect leaves it to the readings.
        assert_eq!(constant_of(|row| 2.0 + slope(row), |_| 2.0), None);
    }

    #[test]
    fn an_effect_of_one_number_has_no_offset_and_a_curve_has_one() {
        const ZERO: Parameter = Parameter {
            key: "reference_c",
            unit: "degC",
            min: -100.0,
            max: 100.0,
            starts: &[20.0],
            step: 0.5,
            null: None,
            plausible: None,
        };
        let linear = |parameters| Candidate {
            linear_in: Some("temperature_c"),
            parameters,
            ..candidate("temperature")
        };
        assert!(has_free_offset(&linear(&[ZERO, ZERO])));
        assert!(!has_free_offset(&linear(&[ZERO])));
        assert!(has_free_offset(&candidate("curve:dust")));
        assert!(!has_free_offset(&candidate("loss-curve:dust")));
        assert!(!has_free_offset(&candidate("shadowing")));
    }
}
