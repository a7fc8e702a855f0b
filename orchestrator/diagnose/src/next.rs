//! The next measurement: where two models that the data cannot tell apart differ most. They are rivals, or one model at both ends
//! of the interval of a parameter. Where rivals differ nowhere in these data, it is under conditions that these data do not have.

use super::diagnosis::NextMeasurement;
use super::ladder::{Ladder, Search, dependence_of, without_term};
use super::score_test::{ScoreTest, ScoreTests};
use numbers::format::{count, number, trimmed, with_unit};
use numbers::power::{integer_power, square};
use numbers::quantity;
use numbers::statistics::{correlation, mean, mean_ignoring_nan};
use proto::effect::{CONSTANT, Need};
use statrs::distribution::{ContinuousCDF as _, Normal};
use study::links::rows::covariates;
use study::thresholds::{
    CONDITION_BINS, DETECTABLE_PROBABILITY, FEWEST_BIN_ROWS, GOING_TOGETHER, HARDLY_VARYING_SHARE,
    LEAST_NEXT_DIFFERENCE, MOST_NEXT_ROWS, UNCORRECTED_LEVEL, WIDE_INTERVAL,
};
use study::{COMMON, Candidate, Estimate, PredictionDifference, Study, TermId};

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
    /// What a row in that range tells of the difference, on average (1/unit²).
    pub information: f64,
}

/// Covariates that follow from a measurement, or that nobody can choose: a time since the campaign began, a level, a speed as it was
/// measured. Another covariate stands for each of them.
const NOT_CHOSEN: [&str; 5] =
    ["time_s", "rssi_dbm", "predicted_rssi_dbm", "measured_speed_mps", "log10_distance"];

/// The first parameter of a random offset of nodes.
const OF_NODES: &str = "tx_sd_db";

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
                // One node can be chosen, a range of numbers means nothing.
                || is_range && covariates::OF_NODES.contains(&name.as_str())
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
                    information: mean(part.iter().map(|&row| difference.information[row])),
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
            let Some(difference) = study.prediction_difference(&chosen, &other) else { continue };
            let [a, b] = [term, rival].map(|term| &candidates[term]);
            let aim = format!("to distinguish {} from {}", a.name, b.name);
            let design_effect = || design_effect(study, &other, term);
            let in_data = || {
                let names = [a, b].map(|it| it.name.as_str());
                // Offsets of nodes follow whatever is measured where their nodes are.
                let is_shown = ![a, b].into_iter().any(is_of_nodes);
                let found = || measurement(&difference, study.n_rows(), names, &aim, design_effect);
                is_shown.then(found).flatten()
            };
            all.extend(advice(&difference, [a, b], &aim, in_data));
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
            let Some(difference) = study.prediction_difference(&least, &most) else { continue };
            let design_effect = || {
                let others = without_term(&ladder.accepted, *term);
                design_effect(study, &search.full_fit(&others, COMMON, None), *term)
            };
            let names = [ends[0].as_str(), &ends[1]];
            all.extend(measurement(&difference, study.n_rows(), names, &aim, design_effect));
        }
    }
    all
}

/// Where two fits differ most; none where no condition stands out, or where it takes too many rows beside the `n_rows` at hand.
fn measurement(
    difference: &PredictionDifference,
    n_rows: usize,
    between: [&str; 2],
    aim: &str,
    design_effect: impl FnOnce() -> f64,
) -> Option<NextMeasurement> {
    let at = greatest_difference(difference).filter(|at| LEAST_NEXT_DIFFERENCE <= at.inside)?;
    let rows = rows_needed(at.inside, at.information, design_effect());
    if MOST_NEXT_ROWS * (n_rows as f64) < rows {
        return None;
    }
    let sentence = sentence(aim, &at, difference.unit, rows);
    Some(NextMeasurement {
        between: between.map(str::to_owned),
        covariate: at.covariate,
        from: at.from,
        to: at.to,
        difference: at.inside,
        elsewhere: at.outside,
        unit: difference.unit,
        rows: Some(rows as u64),
        sentence,
    })
}

/// How many rows show a difference with a probability of [`DETECTABLE_PROBABILITY`], by a one-sided test at [`UNCORRECTED_LEVEL`]: to two
/// digits, rounded up.
///
/// * `information`: of a row, the inverse of its variance.
/// * `design_effect`: how many rows tell what one independent row would.
fn rows_needed(difference: f64, information: f64, design_effect: f64) -> f64 {
    let quantile = |probability: f64| Normal::standard().inverse_cdf(probability);
    let errors = quantile(1.0 - UNCORRECTED_LEVEL) + quantile(DETECTABLE_PROBABILITY);
    let rows = design_effect * square(errors / difference) / information;
    if !rows.is_finite() {
        return f64::INFINITY;
    }
    let digit = libm::floor(libm::log10(rows)) as i32 - 1;
    let step = integer_power(10.0, digit.max(0));
    step * libm::ceil(rows / step)
}

/// Design effect of a term beside a fit that does not have it.
fn design_effect<S: Study>(study: &S, fit: &S::Fit, term: TermId) -> f64 {
    let of_columns = || {
        let rows = study.linearised(fit)?;
        let dependence = dependence_of(study, term);
        let tests = ScoreTests::new(&rows, &dependence);
        let columns = study.columns(fit, term);
        let of_column = |column| tests.test(column, &[]).as_ref().map(ScoreTest::design_effect);
        columns.iter().filter_map(of_column).reduce(f64::max)
    };
    of_columns().unwrap_or_else(|| study.design_effect()).max(1.0)
}

/// Whether an effect is a random offset of nodes.
fn is_of_nodes(candidate: &Candidate) -> bool {
    candidate.parameters.iter().any(|parameter| parameter.key == OF_NODES)
}

/// The covariate that an effect declares to follow, or that a curve is over.
fn declared(candidate: &Candidate) -> Option<&str> {
    let needs = candidate.about.map_or(&[][..], |about| about.needs);
    let of_need = |need: &Need| match need {
        Need::Column(name) => Some(*name),
        Need::Time => Some("time_s"),
        Need::VelocityCommands => Some("commanded_speed_mps"),
        _ => None,
    };
    let of_effect = candidate.linear_in.or_else(|| needs.iter().find_map(of_need));
    candidate.curve_over().or(of_effect).filter(|name| *name != CONSTANT)
}

/// A covariate by name, or that of the sender or the receiver.
fn covariate<'a>(
    difference: &'a PredictionDifference,
    name: &str,
) -> Option<&'a (String, Vec<f64>)> {
    let is_it = |it: &&(String, Vec<f64>)| {
        ["", "tx_", "rx_"].iter().any(|end| it.0.strip_prefix(end) == Some(name))
    };
    difference.covariates.iter().find(is_it)
}

/// How to distinguish two rivals. Where their covariates go together, or nodes decide, it takes conditions that these data do not have: what
/// differs in the data, the rivals' parameters may follow. Otherwise it takes the condition `in_data`, or other values of a covariate.
fn advice(
    difference: &PredictionDifference,
    rivals: [&Candidate; 2],
    aim: &str,
    in_data: impl FnOnce() -> Option<NextMeasurement>,
) -> Option<NextMeasurement> {
    let of_new = |(name, how): (String, String)| {
        let between = rivals.map(|it| it.name.clone());
        let sentence = format!("{aim}, {how}");
        NextMeasurement::of_new_conditions(between, name, difference.unit, sentence)
    };
    let alike = swapped_nodes(rivals).or_else(|| separated(difference, rivals));
    alike.map(of_new).or_else(in_data).or_else(|| varied(difference, rivals).map(of_new))
}

/// Where one of two rivals is an offset of nodes, and the other is not limited to one.
fn swapped_nodes([a, b]: [&Candidate; 2]) -> Option<(String, String)> {
    let (nodes, other) = if is_of_nodes(a) { (a, b) } else { (b, a) };
    if !is_of_nodes(nodes) || is_of_nodes(other) || other.only.is_some() {
        return None;
    }
    let how = format!(
        "swap the nodes between their places: {} goes with the nodes, {} does not",
        nodes.name, other.name
    );
    Some(("transmitter".to_owned(), how))
}

/// Where the covariates of two rivals go together.
fn separated(
    difference: &PredictionDifference,
    [a, b]: [&Candidate; 2],
) -> Option<(String, String)> {
    let (of_a, of_b) = (covariate(difference, declared(a)?)?, covariate(difference, declared(b)?)?);
    let together = correlation_where_known(&of_a.1, &of_b.1)?;
    if of_a.0 == of_b.0 || together.abs() < GOING_TOGETHER {
        return None;
    }
    // Nobody can repeat a moment, but a temperature at another one.
    let (of_a, of_b) =
        if NOT_CHOSEN.contains(&of_a.0.as_str()) { (of_b, of_a) } else { (of_a, of_b) };
    let how = format!(
        "measure the same values of {} at other values of {}: in these data they go together (correlation {together:.2})",
        of_a.0, of_b.0
    );
    Some((of_a.0.clone(), how))
}

/// Where the covariate of one of two rivals hardly varies.
fn varied(difference: &PredictionDifference, [a, b]: [&Candidate; 2]) -> Option<(String, String)> {
    let hardly = |candidate: &Candidate| {
        let name = declared(candidate).filter(|name| !NOT_CHOSEN.contains(name))?;
        let (name, middle) = match covariate(difference, name) {
            // Of a constant there is no covariate.
            None => (name, String::new()),
            Some((name, values)) => {
                let middle = mean_ignoring_nan(values.iter().copied());
                let variance = mean_ignoring_nan(values.iter().map(|it| square(it - middle)));
                let most = HARDLY_VARYING_SHARE * middle.abs();
                let unit = quantity::unit(name).unwrap_or_default();
                let about = format!(" (about {})", with_unit(&number(middle), unit));
                (variance.sqrt() <= most).then_some((name.as_str(), about))?
            }
        };
        let how =
            format!("measure at other values of {name}: in these data it hardly varies{middle}");
        Some((name.to_owned(), how))
    };
    [a, b].into_iter().find_map(hardly)
}

/// Correlation of two covariates over the rows in which both are known; `None` if one of them is constant.
fn correlation_where_known(a: &[f64], b: &[f64]) -> Option<f64> {
    let both = a.iter().zip(b).filter(|(a, b)| a.is_finite() && b.is_finite());
    let (a, b): (Vec<f64>, Vec<f64>) = both.unzip();
    correlation(&a, &b)
}

/// Where to measure, and what for, in words.
fn sentence(aim: &str, at: &Condition, unit: &str, rows: f64) -> String {
    let of_covariate = quantity::unit(&at.covariate);
    let of_covariate = of_covariate.map_or_else(String::new, |unit| format!(" {unit}"));
    let [from, to] = [at.from, at.to].map(|end| trimmed(end, DECIMALS));
    let range = if at.from < at.to { format!("from {from} to {to}") } else { from };
    format!(
        "{aim}, measure at {} {range}{of_covariate}: there the predictions differ by {:.2} {unit}, elsewhere by {:.2} {unit}; {} rows there \
         distinguish them with a power of {:.0} %",
        at.covariate,
        at.inside,
        at.outside,
        count(rows as u64),
        100.0 * DETECTABLE_PROBABILITY
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ladder::tests::candidate;
    use proto::effect::Parameter;

    /// A difference of rows that are read with a standard deviation of 2 dB.
    fn of_rows(by_row: Vec<f64>, covariates: Vec<(String, Vec<f64>)>) -> PredictionDifference {
        let information = vec![0.25; by_row.len()];
        PredictionDifference { by_row, unit: "dB", information, covariates }
    }

    #[test]
    fn the_tenth_with_the_greatest_difference_is_named() {
        let x: Vec<f64> = (0..1000).map(|row| f64::from(row * 7 % 1000)).collect();
        let by_row = x.iter().map(|x| if (300.0..400.0).contains(x) { 2.0 } else { 0.5 }).collect();
        let other = (0..1000).map(|row| f64::from(row % 13)).collect();
        let covariates = vec![("other".to_owned(), other), ("x".to_owned(), x)];
        let found = greatest_difference(&of_rows(by_row, covariates)).unwrap();
        assert_eq!((found.covariate.as_str(), found.from, found.to), ("x", 300.0, 400.0));
        assert_eq!((found.inside, found.outside), (2.0, 0.5));
    }

    fn found(name: &str, values: Vec<f64>) -> Option<Condition> {
        let by_row = values.iter().map(|value| if *value < 3.0 { 2.0 } else { 0.5 }).collect();
        let covariates = vec![(name.to_owned(), values)];
        greatest_difference(&of_rows(by_row, covariates))
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
            let at = Condition {
                covariate: name.to_owned(),
                from,
                to,
                inside: 2.0,
                outside: 0.5,
                information: 0.25,
            };
            let sentence = sentence("to distinguish a from b", &at, "dB", 35.0);
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

    #[test]
    fn rows_needed_have_a_power_of_90_percent_and_are_rounded_up() {
        // (1.6449 + 1.2816)^2 = 8.5638.
        assert_eq!(rows_needed(1.0, 0.25, 1.0), 35.0);
        assert_eq!(rows_needed(1.0, 0.25, 2.0), 69.0);
        assert_eq!(rows_needed(0.1, 0.25, 1.0), 3500.0);
        // Four of five frames are received, and ten points of a hundred make the difference.
        assert_eq!(rows_needed(10.0, 1.0 / 1600.0, 1.0), 140.0);
        assert_eq!(rows_needed(100.0, 1.0, 1.0), 1.0);
        assert_eq!(rows_needed(1.0, 0.0, 1.0), f64::INFINITY);
    }

    #[test]
    fn nothing_is_recommended_that_takes_ten_times_the_rows_at_hand() {
        let x: Vec<f64> = (0..1000).map(|row| f64::from(row % 10)).collect();
        let found_with = |apart: f64, design_effect: f64| {
            let by_row = x.iter().map(|&x| if x < 1.0 { apart } else { 0.0 }).collect();
            let difference = of_rows(by_row, vec![("humidity_pct".to_owned(), x.clone())]);
            measurement(&difference, 1000, ["a", "b"], "to distinguish a from b", || design_effect)
        };
        let found = found_with(0.1, 1.0).unwrap();
        assert_eq!((found.rows, found.from), (Some(3500), 0.0));
        assert!(
            found.sentence.ends_with("; 3,500 rows there distinguish them with a power of 90 %")
        );
        assert_eq!(found_with(0.1, 3.0), None);
        assert_eq!(found_with(0.05, 1.0), None);
    }

    fn following(name: &str, linear_in: Option<&'static str>) -> Candidate {
        Candidate { linear_in, ..candidate(name) }
    }

    /// A covariate: its name, and its value by row.
    type Given = (&'static str, fn(f64) -> f64);

    /// How to distinguish an effect that follows a temperature from one that follows another covariate.
    fn how(covariates: &[Given], other: &Candidate) -> Option<String> {
        let of = |value: fn(f64) -> f64| (0..100).map(|row| value(f64::from(row))).collect();
        let covariates =
            covariates.iter().map(|(name, value)| ((*name).to_owned(), of(*value))).collect();
        let temperature = following("temperature", Some("temperature_c"));
        let difference = of_rows(vec![0.0; 100], covariates);
        let advice = advice(&difference, [&temperature, other], "to distinguish them", || None)?;
        assert!(advice.rows.is_none() && advice.from.is_nan());
        Some(advice.sentence)
    }

    #[test]
    fn covariates_that_go_together_are_to_be_parted_and_others_are_not() {
        let sag = following("battery-sag", Some("time_s"));
        let together = how(&[("temperature_c", |x| 40.0 - 0.2 * x), ("time_s", |x| x)], &sag);
        let expected = "to distinguish them, measure the same values of temperature_c at other values of time_s: in these data they go \
                        together (correlation -1.00)";
        assert_eq!(together.as_deref(), Some(expected));
        let apart = how(&[("temperature_c", |x| x % 10.0), ("time_s", |x| x)], &sag);
        assert_eq!(apart, None);
        let of_sender = how(&[("tx_temperature_c", |x| x), ("time_s", |x| x)], &sag);
        assert!(of_sender.unwrap().contains("values of tx_temperature_c at"));
    }

    #[test]
    fn a_condition_in_the_data_comes_before_other_values_and_after_covariates_that_go_together() {
        let rising = |n: u32| (0..n).map(f64::from).collect::<Vec<f64>>();
        let covariates = |of_time: Vec<f64>| {
            vec![("temperature_c".to_owned(), rising(100)), ("time_s".to_owned(), of_time)]
        };
        let rivals = [("temperature", "temperature_c"), ("battery-sag", "time_s")];
        let [a, b] = rivals.map(|(name, over)| following(name, Some(over)));
        let in_data = || {
            let between = ["a".to_owned(), "b".to_owned()];
            Some(NextMeasurement::of_new_conditions(between, "x".to_owned(), "dB", String::new()))
        };
        let named = |of_time: Vec<f64>| {
            let difference = of_rows(vec![0.0; 100], covariates(of_time));
            advice(&difference, [&a, &b], "to distinguish them", in_data).unwrap().covariate
        };
        assert_eq!(named(rising(100)), "temperature_c");
        assert_eq!(named(rising(10).repeat(10)), "x");
    }

    #[test]
    fn what_hardly_varies_is_to_be_varied_and_time_is_not() {
        let gain = following("system-gain", Some(CONSTANT));
        let level = how(&[("temperature_c", |x| 20.0 + x % 2.0)], &gain);
        let expected = "to distinguish them, measure at other values of temperature_c: in these data it hardly varies (about 20.5 °C)";
        assert_eq!(level.as_deref(), Some(expected));
        assert!(how(&[], &gain).unwrap().ends_with("in these data it hardly varies"));
        assert_eq!(how(&[("temperature_c", |x| x)], &gain), None);
    }

    #[test]
    fn nodes_are_to_be_swapped_where_one_rival_is_an_offset_of_theirs() {
        const SPREAD: Parameter = Parameter {
            key: OF_NODES,
            unit: "dB",
            min: 0.0,
            max: 20.0,
            starts: &[1.5],
            step: 0.05,
            null: None,
            plausible: None,
        };
        let offset = Candidate { parameters: &[SPREAD], ..candidate("node-offset") };
        let expected = "to distinguish them, swap the nodes between their places: node-offset goes with the nodes, temperature does not";
        assert_eq!(how(&[("temperature_c", |x| x)], &offset).as_deref(), Some(expected));
    }
}
