//! The next measurement: where two models that the data cannot tell apart differ most. They are rivals, or one model at both ends
//! of the interval of a parameter.

use super::diagnosis::NextMeasurement;
use super::ladder::{Ladder, Search};
use numbers::format::trimmed;
use numbers::power::integer_power;
use numbers::quantity;
use study::thresholds::{CONDITION_BINS, FEWEST_BIN_ROWS, LEAST_NEXT_DIFFERENCE, WIDE_INTERVAL};
use study::{COMMON, Estimate, PredictionDifference, Study, TermId};

/// Decimals of a covariate in a sentence.
const DECIMALS: usize = 6;

/// Conditions under which models differ: a range of one covariate.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Condition {
    /// Name of the covariate by which rows are selected.
    pub covariate: String,
    /// Least value of the covariate, in its own unit.
    pub from: f64,
    /// Greatest value of the covariate, in its own unit.
    pub to: f64,
    /// Mean difference of the two predictions in that range (dB, m or a share of frames).
    pub inside: f64,
    /// Mean difference of all other rows.
    pub outside: f64,
}

/// Covariates that follow from a measurement, or that nobody can choose: a time since the campaign began, a level, a speed as it was
/// measured. Another covariate stands for each of them.
const NOT_CHOSEN: [&str; 5] =
    ["time_s", "rssi_dbm", "predicted_rssi_dbm", "measured_speed_mps", "log10_distance"];
/// Numbers of nodes: one of them can be chosen, a range of them means nothing.
const NUMBERS_OF_NODES: [&str; 2] = ["transmitter", "receiver"];

/// The tenth of the rows, by one covariate that a person can choose, in which two models differ most.
#[must_use]
pub(crate) fn greatest_difference(difference: &PredictionDifference) -> Option<Condition> {
    let total: f64 = difference.by_row.iter().sum();
    let n = difference.by_row.len();
    let mut best: Option<Condition> = None;
    for (name, values) in &difference.covariates {
        if NOT_CHOSEN.contains(&name.as_str()) {
            continue;
        }
        let mut order: Vec<usize> = (0..n).filter(|&row| values[row].is_finite()).collect();
        order.sort_by(|&a, &b| values[a].total_cmp(&values[b]).then(a.cmp(&b)));
        for part in tenths(&order, values) {
            let (Some(&first), Some(&last)) = (part.first(), part.last()) else { continue };
            let (from, to) = (values[first], values[last]);
            let sum: f64 = part.iter().map(|&row| difference.by_row[row]).sum();
            let is_range = from < to;
            if part.len() < FEWEST_BIN_ROWS
                || n <= part.len()
                || is_range && NUMBERS_OF_NODES.contains(&name.as_str())
            {
                continue;
            }
            let inside = sum / part.len() as f64;
            if best.as_ref().is_none_or(|best| best.inside < inside) {
                let (from, to) = if is_range { round_range(from, to) } else { (from, to) };
                best = Some(Condition {
                    covariate: name.clone(),
                    from,
                    to,
                    inside,
                    outside: (total - sum) / (n - part.len()) as f64,
                });
            }
        }
    }
    best
}

/// Rows in ascending order, in about as many parts as there are bins; rows with equal values are in one part.
fn tenths<'a>(mut order: &'a [usize], values: &[f64]) -> Vec<&'a [usize]> {
    let size = order.len().div_ceil(CONDITION_BINS).max(FEWEST_BIN_ROWS);
    let mut parts = Vec::new();
    while !order.is_empty() {
        let mut end = size.min(order.len());
        while end < order.len() && values[order[end]] == values[order[end - 1]] {
            end += 1;
        }
        let (part, rest) = order.split_at(end);
        parts.push(part);
        order = rest;
    }
    parts
}

/// A range with ends rounded outwards to 1, 2 or 5 times a power of ten: to about a tenth of its width.
fn round_range(from: f64, to: f64) -> (f64, f64) {
    let least = (to - from) / 10.0;
    let power = integer_power(10.0, libm::floor(libm::log10(least)) as i32);
    let step = [1.0, 2.0, 5.0].map(|times| times * power).into_iter().find(|step| least <= *step);
    let step = step.unwrap_or(10.0 * power);
    (step * libm::floor(from / step), step * libm::ceil(to / step))
}

/// For each tie, and each parameter that is known weakly, where the rivals differ most. `estimates`: by term.
pub(crate) fn measurements<S: Study>(
    study: &S,
    search: &Search<'_, S>,
    ladder: &Ladder,
    estimates: &[(TermId, Vec<Estimate>)],
) -> Vec<NextMeasurement> {
    let candidates = study.candidates();
    let chosen = search.full_fit(&ladder.accepted, COMMON, None);
    let mut all = Vec::new();
    for (place, &term) in ladder.accepted.iter().enumerate() {
        let Some(test) = ladder.test_of(term) else { continue };
        for &rival in test.ties.iter().filter(|tie| !ladder.accepted.contains(tie)) {
            let mut terms = ladder.accepted.clone();
            terms[place] = rival;
            let other = search.full_fit(&terms, COMMON, Some(&chosen));
            let (a, b) = (&candidates[term].name, &candidates[rival].name);
            let aim = format!("to distinguish {a} from {b}");
            all.extend(measurement(study, (&chosen, &other), [a, b], &aim));
        }
    }
    for (term, estimates) in estimates {
        let name = &candidates[*term].name;
        for Estimate { name: key, value, low, high, .. } in estimates {
            if high - low <= WIDE_INTERVAL * value.abs() || !(high - low).is_finite() {
                continue;
            }
            let held_at = |end: f64| study.with_parameter_held(&chosen, *term, key, end);
            let (Some(least), Some(most)) = (held_at(*low), held_at(*high)) else { continue };
            let ends = [low, high].map(|end| format!("{key} = {end:.4}"));
            let aim = format!("to narrow the interval of {key} of {name}, {low:.4} to {high:.4}");
            all.extend(measurement(study, (&least, &most), [&ends[0], &ends[1]], &aim));
        }
    }
    all
}

/// Where two fits differ most; none where no condition stands out.
fn measurement<S: Study>(
    study: &S,
    (one, other): (&S::Fit, &S::Fit),
    between: [&str; 2],
    aim: &str,
) -> Option<NextMeasurement> {
    let difference = study.prediction_difference(one, other)?;
    let at = greatest_difference(&difference).filter(|at| LEAST_NEXT_DIFFERENCE <= at.inside)?;
    let sentence = sentence(aim, &at, difference.unit);
    Some(NextMeasurement {
        between: between.map(str::to_owned),
        covariate: at.covariate,
        from: at.from,
        to: at.to,
        difference: at.inside,
        elsewhere: at.outside,
        unit: difference.unit,
        sentence,
    })
}

/// Where to measure, and what for, in words.
fn sentence(aim: &str, at: &Condition, unit: &str) -> String {
    let of_covariate = quantity::unit(&at.covariate);
    let of_covariate = of_covariate.map_or_else(String::new, |unit| format!(" {unit}"));
    let [from, to] = [at.from, at.to].map(|end| trimmed(end, DECIMALS));
    let range = if at.from < at.to { format!("from {from} to {to}") } else { from };
    format!(
        "{aim}, measure at {} {range}{of_covariate}: there the predictions differ by {:.2} {unit}, elsewhere by {:.2} {unit}",
        at.covariate, at.inside, at.outside
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tenth_with_the_greatest_difference_is_named() {
        let x: Vec<f64> = (0..1000).map(|row| f64::from(row * 7 % 1000)).collect();
        let by_row = x.iter().map(|x| if (300.0..400.0).contains(x) { 2.0 } else { 0.5 }).collect();
        let other = (0..1000).map(|row| f64::from(row % 13)).collect();
        let covariates = vec![("other".to_owned(), other), ("x".to_owned(), x)];
        let found =
            greatest_difference(&PredictionDifference { by_row, unit: "dB", covariates }).unwrap();
        assert_eq!((found.covariate.as_str(), found.from, found.to), ("x", 300.0, 400.0));
        assert_eq!((found.inside, found.outside), (2.0, 0.5));
    }

    fn found(name: &str, values: Vec<f64>) -> Option<Condition> {
        let by_row = values.iter().map(|value| if *value < 3.0 { 2.0 } else { 0.5 }).collect();
        let covariates = vec![(name.to_owned(), values)];
        greatest_difference(&PredictionDifference { by_row, unit: "dB", covariates })
    }

    #[test]
    fn nothing_is_asked_of_what_nobody_can_choose() {
        let values = || (0..1000).map(|row| f64::from(row % 10)).collect::<Vec<f64>>();
        for name in NOT_CHOSEN {
            assert_eq!(found(name, values()), None, "{name}");
        }
        assert!(found("humidity_pct", values()).is_some());
        assert!(found("time_since_change_s", values()).is_some());
        // Tenths of these are single nodes, of 100 nodes ranges.
        assert!(found("transmitter", values()).is_some());
        let many = (0..1000).map(|row| f64::from(row % 100)).collect();
        assert_eq!(found("transmitter", many), None);
    }

    #[test]
    fn a_range_is_round_and_has_a_unit() {
        let sentence = |name: &str, from: f64, to: f64| {
            let (from, to) = if from < to { round_range(from, to) } else { (from, to) };
            let at = Condition { covariate: name.to_owned(), from, to, inside: 2.0, outside: 0.5 };
            let sentence = sentence("to distinguish a from b", &at, "dB");
            sentence.split(": ").next().unwrap_or_default().to_owned()
        };
        let expected = "to distinguish a from b, measure at distance_m from 12 to 26 m";
        assert_eq!(sentence("distance_m", 12.345, 25.9), expected);
        let expected = "to distinguish a from b, measure at humidity_pct from 41.2 to 41.9 %";
        assert_eq!(sentence("humidity_pct", 41.23, 41.87), expected);
        let expected = "to distinguish a from b, measure at frequency_mhz 2405 MHz";
        assert_eq!(sentence("frequency_mhz", 2405.0, 2405.0), expected);
        let expected = "to distinguish a from b, measure at crowd from -20 to 60";
        assert_eq!(sentence("crowd", -17.0, 51.0), expected);
    }

    #[test]
    fn equal_values_are_in_one_part() {
        let values: Vec<f64> = (0..300).map(|row| f64::from(row / 100)).collect();
        let order: Vec<usize> = (0..300).collect();
        let lengths: Vec<usize> = tenths(&order, &values).iter().map(|part| part.len()).collect();
        assert_eq!(lengths, [100, 100, 100]);
        let distinct: Vec<f64> = (0..300).map(f64::from).collect();
        assert_eq!(tenths(&order, &distinct).len(), 10);
    }
}
