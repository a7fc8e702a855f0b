//! From a search for changes to an answer: which numbers in A, which in B, and what stayed the same.

use super::contrast::{Constants, Contrasts, Dependences, RUNS, Sides};
use super::error_change::{ErrorChange, error_change, with_changes};
use super::pairs::Pair;
use super::rule::{Evidence, verdict};
use super::search::{Found, FoundChange};
use super::{Between, Change, Changed, Common, SCHEMA, Same, SidesOf, Spans, certainty, words};
use crate::answer::parameter;
use crate::defects::MeasurementDefect;
use crate::diagnosis::Parameter;
use crate::ladder::{Search, without_term};
use crate::score_test::ScoreTest;
use indexmap::IndexMap;
use measure::account::DataAccount;
use statrs::distribution::{ContinuousCDF as _, StudentsT};
use study::open::Subject;
use study::thresholds::{DOUBTFUL_LEVEL, INTERVAL_PROBABILITY, UNCHANGED_SHARE};
use study::{COMMON, Estimate, Study, TermId};

/// Two campaigns, and what is known of them beside the pooled study.
#[derive(Clone, Copy, Debug)]
pub(super) struct Campaigns<'a> {
    /// Of links or of robots.
    pub subject: Subject,
    /// Unit of errors in words.
    pub error_unit: &'static str,
    /// How many rows were searched, if that is to be said.
    pub searched: Option<usize>,
    /// The files, and how much of them was used.
    pub accounts: [&'a DataAccount; 2],
    /// Why one of them is too small to find anything in.
    pub too_little: Option<&'a str>,
    /// When both were measured, in hours since midnight (UTC).
    pub time_of_day_h: Option<Spans>,
    /// Columns that only one of the files has.
    pub left_out_columns: &'a [String],
    /// Defects of the measurement in both files.
    pub defects: &'a SidesOf<Vec<MeasurementDefect>>,
    /// Whether the diagnosis of A came to its end.
    pub is_base_complete: bool,
}

/// The answer of a search.
pub(super) fn answer<S: Study>(
    study: &S,
    found: &Found<S::Fit>,
    pairs: &[Pair],
    sides: &Sides,
    search: &Search<'_, S>,
    campaigns: Campaigns<'_>,
) -> Between {
    let is_stopped = || search.is_stopped();
    let constants = if is_stopped() {
        Constants::default()
    } else {
        constants(study, search, found, sides).unwrap_or_default()
    };
    let mut error =
        if is_stopped() { None } else { error_change(study, search, &found.base, sides) };
    if let Some(error) = error.as_mut().filter(|_| !found.changes.is_empty()) {
        with_changes(error, search, &found.terms, &sides.is_b);
    }
    let fit = search.full_fit(&found.terms, COMMON, None);
    let estimates = |term: TermId| study.estimates(&fit, term);
    let is_something = !constants.misfits.is_empty();
    let of_change = |change: &FoundChange| {
        let settings = study.settings(&fit, change.in_b);
        let wide = |term: TermId| {
            let (known, warning) = estimates(term);
            let wide = |it: &Estimate| widened(it, change.widening);
            (known.iter().map(wide).collect::<Vec<Estimate>>(), warning)
        };
        let (in_a, _) = change.in_a.map(wide).unwrap_or_default();
        let (in_b, warning) = wide(change.in_b);
        let doubt = if is_stopped() || !change.ties.is_empty() {
            None
        } else {
            let known = (change, &in_a[..], &in_b[..]);
            let too_little = campaigns.too_little.map(str::to_owned);
            certainty::doubt(study, search, found, known, (sides, is_something)).or(too_little)
        };
        let ties = change.ties.iter().map(|tie| {
            let of_tie = tie.term.filter(|_| !is_stopped());
            let size = of_tie.map(|term| tied_size(study, search, found, (change, term)));
            tie.name.clone() + &size.unwrap_or_default()
        });
        let change = Change {
            indistinguishable_from: ties.collect(),
            ..self::change(study, change, settings, [&in_a, &in_b], (doubt, warning))
        };
        (change.doubt.is_some() || !change.indistinguishable_from.is_empty(), change)
    };
    let (possible, changed): (Vec<_>, Vec<_>) =
        found.changes.iter().map(of_change).partition(|(is_open, _)| *is_open);
    let [possible, changed] =
        [possible, changed].map(|list| list.into_iter().map(|(_, it)| it).collect::<Vec<Change>>());
    let common = found.common.iter().map(|&(term, found_in_a)| {
        let candidate = &study.candidates()[term];
        let known = estimates(term).0;
        let known = known.iter().filter(|estimate| estimate.is_identifiable);
        Common {
            effect: candidate.effect().to_owned(),
            only: candidate.only.clone().map(without_runs).filter(|only| !only.is_empty()),
            parameters: known.map(parameter).collect(),
            found_in_a,
        }
    });
    let common = common.collect();
    let bound = |(_, _, test): &(&str, &str, ScoreTest)| {
        test.upper_bound(0.5 * (1.0 - INTERVAL_PROBABILITY))
    };
    let could_hide = constants.everywhere.iter().map(bound).fold(f64::NAN, f64::max);
    // What has a difference that is no chance is not the same.
    let includes_none = |same: &Same| same.difference.low <= 0.0 && 0.0 <= same.difference.high;
    let mut same: Vec<Same> =
        constants.everywhere.iter().map(same_constant).filter(includes_none).collect();
    for pair in pairs.iter().filter(|_| !is_stopped()) {
        same.extend(same_parameters(study, search, pair));
    }
    let is_complete = found.is_complete && campaigns.is_base_complete && !is_stopped();
    let evidence = Evidence {
        changes: changed.len(),
        possible: possible.len(),
        defects: campaigns.defects.a.len() + campaigns.defects.b.len(),
        unexplained: constants.misfits.len(),
        error_p_value: error.as_ref().map(ErrorChange::certain_p_value),
        doubtful_p_value: error.as_ref().map(ErrorChange::doubtful_p_value),
        is_sharp: could_hide < constants.sd,
        suffices: campaigns.too_little.is_none(),
        is_complete,
    };
    let [a, b] = campaigns.accounts.map(DataAccount::clone);
    let [n_a, n_b] = sides.recordings.counts();
    let is_change = |term: &&TermId| found.changes.iter().any(|change| change.effect == **term);
    let not_found = found.tested.iter().filter(|term| !is_change(term));
    let names = not_found.map(|&term| study.candidates()[term].name.clone());
    // What a change is tied with was found as much as the change.
    let not_found = names.filter(|name| !is_tied(found, name)).collect();
    let mut between = Between {
        schema: SCHEMA,
        kind: campaigns.subject,
        verdict: verdict(&evidence),
        sentence: String::new(),
        changed,
        possible,
        common,
        same,
        not_found,
        measurement_defects: campaigns.defects.clone(),
        unexplained: constants.misfits,
        error,
        could_hide,
        confounded: sides.apart.clone(),
        shared: sides.shared(),
        recordings: SidesOf { a: n_a, b: n_b },
        caution: None,
        time_of_day_h: campaigns.time_of_day_h,
        left_out_columns: campaigns.left_out_columns.to_vec(),
        of_time_in_a: found.of_time_in_a.clone(),
        too_little: campaigns.too_little.map(str::to_owned),
        complete: is_complete,
        searched: campaigns.searched,
        a,
        b,
        error_unit: campaigns.error_unit,
    };
    between.caution = regression_to_the_mean(&between, sides.recordings.are_enough());
    between.sentence = words::sentence(&between);
    between
}

/// The numbers of what is tied with a change, fitted in its place.
fn tied_size<S: Study>(
    study: &S,
    search: &Search<'_, S>,
    found: &Found<S::Fit>,
    (change, term): (&FoundChange, TermId),
) -> String {
    let mut terms = without_term(&found.terms, change.in_b);
    terms.push(term);
    let start = search.full_fit(&found.terms, COMMON, None);
    let fit = search.full_fit(&terms, COMMON, Some(&start));
    let (estimates, _) = study.estimates(&fit, term);
    let known = estimates.iter().filter(|estimate| estimate.is_identifiable);
    let sizes: Vec<String> = known
        .map(|estimate| {
            let (key, it) = parameter(&widened(estimate, change.widening));
            words::interval(&key, &it)
        })
        .collect();
    if sizes.is_empty() { String::new() } else { format!(": {}", sizes.join(", ")) }
}

/// Whether a change that was found is indistinguishable from one of this effect.
fn is_tied<F>(found: &Found<F>, name: &str) -> bool {
    let mut ties = found.changes.iter().flat_map(|change| &change.ties);
    ties.any(|tie| tie.name.strip_prefix(name).is_some_and(|rest| rest.starts_with(' ')))
}

/// Constants by which B is off beyond A, with all that was found.
fn constants<S: Study>(
    study: &S,
    search: &Search<'_, S>,
    found: &Found<S::Fit>,
    sides: &Sides,
) -> Option<Constants> {
    let rows = sides.linearised(study, &search.full_fit(&found.terms, COMMON, None))?;
    let dependences = Dependences::of(study, sides);
    let contrasts = Contrasts::new(study, &rows, &dependences, sides);
    Some(contrasts.constants(&study.directions()))
}

fn without_runs(mut only: toml::Table) -> toml::Table {
    only.remove(RUNS);
    only
}

/// A change as the answer has it. `in_a`, `in_b`: its estimates in both campaigns, with intervals that are wide enough.
fn change<S: Study>(
    study: &S,
    change: &FoundChange,
    settings: Option<toml::Table>,
    [in_a, in_b]: [&[Estimate]; 2],
    (doubt, warning): (Option<String>, Option<String>),
) -> Change {
    let candidate = &study.candidates()[change.in_b];
    let mut parameters = IndexMap::new();
    for estimate in in_b.iter().filter(|estimate| estimate.is_identifiable) {
        let (key, b) = parameter(estimate);
        let of_a = in_a.iter().find(|other| other.name == key && other.is_identifiable);
        let a = of_a.map(|estimate| parameter(estimate).1);
        let difference = a.as_ref().map(|a| difference(a, &b));
        parameters.insert(key, Changed { unit: b.unit.clone(), a, b, difference });
    }
    let settings = settings.map(|mut settings| {
        let only = settings.remove(proto::effect::only::KEY);
        let only = only.and_then(|only| only.as_table().cloned()).map(without_runs);
        if let Some(only) = only.filter(|only| !only.is_empty()) {
            settings.insert(proto::effect::only::KEY.to_owned(), only.into());
        }
        settings
    });
    Change {
        effect: candidate.effect().to_owned(),
        only: candidate.only.clone().map(without_runs).filter(|only| !only.is_empty()),
        parameters,
        gain: change.gain.gain,
        standard_error: change.gain.standard_error,
        p_value: change.p_value.min(1.0),
        indistinguishable_from: Vec::new(),
        ruled_out: change.ruled_out.clone(),
        doubt,
        warning,
        settings,
    }
}

/// An estimate with an interval that is so many times wider.
fn widened(estimate: &Estimate, times: f64) -> Estimate {
    let Estimate { value, low, high, .. } = *estimate;
    Estimate {
        low: value - times * (value - low),
        high: value + times * (high - value),
        ..estimate.clone()
    }
}

/// The difference of two estimates with its interval, from the intervals of both (G. Y. Zou and A. Donner, Construction of confidence
/// limits about effect measures: a general approach, Stat. Med. 27, 2008).
fn difference(a: &Parameter, b: &Parameter) -> Parameter {
    let value = b.value - a.value;
    Parameter {
        value,
        unit: b.unit.clone(),
        low: value - libm::hypot(b.value - b.low, a.high - a.value),
        high: value + libm::hypot(b.high - b.value, a.value - a.low),
    }
}

/// The same of two estimates.
pub(super) fn difference_of(a: &Estimate, b: &Estimate) -> Estimate {
    let Parameter { value, unit, low, high } = difference(&parameter(a).1, &parameter(b).1);
    Estimate::new(&b.name, &unit, value, (low, high))
}

/// A constant that is the same in both campaigns.
fn same_constant((name, unit, test): &(&'static str, &'static str, ScoreTest)) -> Same {
    let quantile = StudentsT::new(0.0, 1.0, test.freedom)
        .map_or(f64::INFINITY, |law| law.inverse_cdf(0.5 + 0.5 * INTERVAL_PROBABILITY));
    let half = quantile * test.standard_error;
    let difference = Parameter {
        value: test.amplitude,
        unit: (*unit).to_owned(),
        low: test.amplitude - half,
        high: test.amplitude + half,
    };
    same(name.replace("are off ", "").replace(" are off", ""), difference)
}

fn same(what: String, difference: Parameter) -> Same {
    let within = difference.low.abs().max(difference.high.abs());
    Same { what, difference, within }
}

/// The parameters of an effect that both campaigns have, where they were fitted to each.
fn same_parameters<S: Study>(study: &S, search: &Search<'_, S>, pair: &Pair) -> Vec<Same> {
    let parent = search.full_fit(&pair.parent, COMMON, None);
    let fit = search.full_fit(&pair.terms, COMMON, Some(&parent));
    let [in_a, in_b] = [pair.in_a, pair.in_b].map(|term| study.estimates(&fit, term).0);
    let both = in_b.iter().filter_map(|b| {
        let a = in_a.iter().find(|a| a.name == b.name)?;
        (a.is_identifiable && b.is_identifiable).then_some((a, b))
    });
    let name = &study.candidates()[pair.of].name;
    let of_pair = |(a, b): (&Estimate, &Estimate)| {
        let [(key, a), (_, b)] =
            [a, b].map(|estimate| parameter(&widened(estimate, pair.widening)));
        let same = same(format!("{name}: {key}"), difference(&a, &b));
        (same.within <= UNCHANGED_SHARE * a.value.abs().max(b.value.abs())).then_some(same)
    };
    both.filter_map(of_pair).collect()
}

/// The warning that a campaign which was picked for its error is followed by one with another, whatever changed (F. Galton, Regression
/// towards mediocrity in hereditary stature, J. Anthropol. Inst. 15, 1886). None where errors are alike, or where there are recordings
/// enough to tell how much they differ by themselves.
fn regression_to_the_mean(between: &Between, are_enough: bool) -> Option<String> {
    let error = between.error.as_ref().filter(|_| !are_enough)?;
    let (name, other) = if error.rmse_a < error.rmse_b { ("B", "A") } else { ("A", "B") };
    (error.doubtful_p_value() < DOUBTFUL_LEVEL).then(|| {
        format!(
            "if {name} was chosen because its error is large, {other} has a smaller one by chance alone (regression to the mean): \
             choose recordings before you know their errors"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(value: f64, low: f64, high: f64) -> Parameter {
        Parameter { value, unit: "dB".to_owned(), low, high }
    }

    #[test]
    fn the_interval_of_a_difference_follows_from_those_of_both() {
        let found = difference(&estimate(-5.0, -8.0, -4.0), &estimate(-11.0, -14.0, -8.0));
        assert_eq!(found.value, -6.0);
        // Half widths 3 and 1 below, 3 and 3 above.
        assert!((found.low - (-6.0 - 10.0_f64.sqrt())).abs() < 1e-12, "{found:?}");
        assert!((found.high - (-6.0 + 18.0_f64.sqrt())).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn an_interval_is_widened_about_its_value() {
        let wide = widened(&Estimate::new("a", "dB", 2.0, (1.0, 4.0)), 2.0);
        assert_eq!((wide.value, wide.low, wide.high), (2.0, 0.0, 6.0));
    }

    #[test]
    fn the_margin_is_the_farther_end() {
        assert_eq!(same("a".to_owned(), estimate(0.1, -0.4, 0.6)).within, 0.6);
        assert_eq!(same("a".to_owned(), estimate(-0.3, -0.7, 0.1)).within, 0.7);
    }
}
