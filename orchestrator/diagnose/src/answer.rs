//! What a diagnosis found: for programs as JSON, for people as a table and a sentence.

use super::gain::{Gain, Scores};
use super::ladder::{Ladder, Search};
use super::next;
use super::scan::LeftOver;
use proto::effect::CONSTANT;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::sync::Arc;
use study::symbolic::Formula;
use study::{COMMON, Study};

/// Names of what a kind of measurements is scored by.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    /// `link` or `robot`.
    pub name: &'static str,
    /// Unit of errors.
    pub unit: &'static str,
}

/// A diagnosis.
#[derive(Clone, Debug)]
pub struct Answer {
    /// As in the specification of the file format `diagnose/1`.
    pub json: Value,
    /// As a person reads it.
    pub text: String,
}

/// JSON has no number for what is not one.
fn number(value: f64) -> Value {
    if value.is_finite() { json!(value) } else { Value::Null }
}

/// What a structure is: what follows which covariate, and those that it cannot be told from.
pub fn named_structure(entry: &Value) -> String {
    let covariate = entry["covariate"].as_str().unwrap_or_default();
    let others = entry["indistinguishable_from"].as_array().into_iter().flatten();
    let others: Vec<&str> = others.filter_map(Value::as_str).collect();
    let is_of_losses = entry["of"] == LOSSES;
    let mut named = match (is_of_losses, covariate) {
        (true, CONSTANT) => "a loss of frames that is the same everywhere".to_owned(),
        (true, _) => format!("a loss of frames that follows {covariate}"),
        (false, _) => format!("structure in {covariate}"),
    };
    if !others.is_empty() {
        let or = |other: &&str| match (covariate, *other) {
            (CONSTANT, other) => format!("or follows {other}"),
            (_, CONSTANT) if is_of_losses => "or is the same everywhere".to_owned(),
            (_, other) => format!("or {other}"),
        };
        let others: Vec<String> = others.iter().map(or).collect();
        let _ = write!(named, " ({}: these data do not tell)", others.join(", "));
    }
    named
}

/// A formula along a second direction.
fn also(formula: &Formula) -> Option<Value> {
    let (text, target) = formula.also.as_ref()?;
    Some(json!({ "formula": text, "target": target }))
}

/// The formulas of a structure, each with what it is added to.
pub fn formulas_of(entry: &Value) -> impl Iterator<Item = (&str, &str)> {
    let both = [entry, &entry["also"]].into_iter();
    both.filter_map(|part| Some((part["formula"].as_str()?, part["target"].as_str()?)))
}

/// Of a curve of losses.
pub const LOSSES: &str = "losses";
/// Of a curve of what is read.
const READINGS: &str = "readings";

fn rung(name: &str, scores: &Scores) -> Value {
    json!({
        "model": name,
        "log_score": number(scores.log_score),
        "rmse": number(scores.rmse),
        "crps": number(scores.crps),
        "reception_log_loss": number(scores.reception_log_loss),
    })
}

/// The study and the fit of some terms that numbers are taken from: all rows, where the search looked at some of them.
pub fn numbers<'a, S: Study>(
    search: &Search<'a, S>,
    study: &'a S,
    whole: Option<&'a S>,
    terms: &[usize],
) -> (&'a S, Arc<S::Fit>) {
    let found = search.full(terms, COMMON, None);
    let Some(whole) = whole else { return (study, found) };
    (whole, Arc::new(whole.fit(terms, &whole.fitted_rows(), COMMON, Some(&found))))
}

/// Says what a search found. `whole`: all rows, where the search looked at some of them.
pub fn answer<S: Study>(
    study: &S,
    search: &Search<'_, S>,
    ladder: &Ladder,
    kind: Kind,
    left_over: &LeftOver,
    whole: Option<&S>,
) -> Answer {
    let candidates = study.candidates();
    let name = |term: usize| candidates[term].name.as_str();
    let effects: Vec<usize> = ladder
        .accepted
        .iter()
        .copied()
        .filter(|&term| candidates[term].curve_over().is_none())
        .collect();
    let over = |terms: &[usize]| -> Vec<&str> {
        terms.iter().filter_map(|&term| candidates[term].curve_over()).collect()
    };
    let mut structure: Vec<Value> = Vec::new();
    for &term in &ladder.accepted {
        let Some(covariate) = candidates[term].curve_over() else { continue };
        let Some(trial) = ladder.trials.iter().find(|trial| trial.term == term) else { continue };
        let step = ladder.accepted.iter().position(|&other| other == term).unwrap_or_default();
        let (before, after) = (&ladder.rungs[step].scores, &ladder.rungs[step + 1].scores);
        let is_of_losses = candidates[term].is_of_losses();
        // A curve over the same with other knots is not another cause.
        let mut others = over(&trial.ties);
        others.retain(|&other| other != covariate);
        let left = if is_of_losses {
            after.reception_log_loss / before.reception_log_loss
        } else {
            after.mean_square() / before.mean_square()
        };
        let formula: Option<&Formula> = left_over.formulas.get(name(term));
        structure.push(json!({
            "covariate": covariate,
            "of": if is_of_losses { LOSSES } else { READINGS },
            "explained": number((1.0 - left).max(0.0)),
            "p_value": number(trial.gain.p_value),
            "formula": formula.map(|formula| &formula.text),
            "target": formula.map(|formula| formula.target),
            "also": formula.and_then(also),
            "rmse_after": number(formula.map_or(after.rmse, |formula| formula.rmse)),
            "indistinguishable_from": others,
        }));
    }
    if let Some(left) = &left_over.structure {
        structure.push(json!({
            "covariate": left.covariate,
            "explained": number(left.explained),
            "p_value": number(left.p_value),
            "formula": left.formula.as_ref().map(|formula| &formula.text),
            "target": left.formula.as_ref().map(|formula| formula.target),
            "also": left.formula.as_ref().and_then(also),
            "rmse_after": left.formula.as_ref().map(|formula| number(formula.rmse)),
            "indistinguishable_from": [],
        }));
    }
    let verdict = if ladder.too_little.is_some() {
        "nothing-missing"
    } else if !structure.is_empty() {
        "unexplained-structure"
    } else if effects.is_empty() {
        "nothing-missing"
    } else {
        "missing-effects"
    };
    let (measured, full) = numbers(search, study, whole, &ladder.accepted);
    let mut text = String::new();
    let mut rungs = Vec::new();
    let has_losses = !ladder.rungs[0].scores.reception_log_loss.is_nan();
    let _ = writeln!(
        text,
        "{:<34} {:>12} {:>10} {:>10}{}",
        "model (held out)",
        "log score",
        format!("rmse {}", kind.unit),
        format!("crps {}", kind.unit),
        if has_losses { "  reception loss" } else { "" }
    );
    for (index, step) in ladder.rungs.iter().enumerate() {
        let label = match step.terms.last() {
            None => "as configured".to_owned(),
            Some(&term) => format!("+ {}", name(term)),
        };
        let scores = &step.scores;
        let loss = if has_losses {
            format!("  {:>14.4}", scores.reception_log_loss)
        } else {
            String::new()
        };
        let _ = writeln!(
            text,
            "{label:<34} {:>12.4} {:>10.4} {:>10.4}{loss}",
            scores.log_score, scores.rmse, scores.crps
        );
        debug_assert_eq!(index, step.terms.len());
        rungs.push(rung(&label, scores));
    }
    let mut listed = Vec::new();
    let mut known = Vec::new();
    let _ = writeln!(text);
    for (term, candidate) in candidates.iter().enumerate() {
        let trial = ladder.trials.iter().find(|trial| trial.term == term);
        let accepted = ladder.accepted.contains(&term);
        // Of a curve and the one that stands in for it, one is listed.
        let stands_in = |&other: &usize| candidates[other].stands_in_for == Some(term);
        if candidate.stands_in_for.is_some() && !accepted || ladder.accepted.iter().any(stands_in) {
            continue;
        }
        let gain = trial.map_or(Gain::NONE, |trial| trial.gain);
        let is_other = |&&tie: &&usize| {
            let [a, b] = [candidate, &candidates[tie]];
            a.curve_over().is_none() || a.curve_over() != b.curve_over()
        };
        let ties: Vec<&str> = trial.map_or_else(Vec::new, |trial| {
            trial.ties.iter().filter(is_other).map(|&tie| name(tie)).collect()
        });
        let mut parameters = serde_json::Map::new();
        let mut entry = json!({
            "effect": candidate.name,
            "gain": number(gain.gain),
            "standard_error": number(gain.standard_error),
            "p_value": number(gain.p_value),
            "accepted": accepted,
            "indistinguishable_from": ties,
        });
        if accepted {
            let (estimates, warning) = measured.estimates(&full, term);
            let mut shown = Vec::new();
            for estimate in &estimates {
                parameters.insert(
                    estimate.name.clone(),
                    json!({
                        "value": number(estimate.value),
                        "unit": estimate.unit,
                        "low": number(estimate.low),
                        "high": number(estimate.high),
                    }),
                );
                shown.push(format!(
                    "{} = {:.4} {} (90 %: {:.4} to {:.4})",
                    estimate.name, estimate.value, estimate.unit, estimate.low, estimate.high
                ));
            }
            let _ = writeln!(
                text,
                "{}: gains {:.4} +- {:.4} nats a row. {}",
                candidate.name,
                gain.gain,
                gain.standard_error,
                shown.join(", ")
            );
            if !ties.is_empty() {
                let _ =
                    writeln!(text, "  on these data it cannot be told from {}", ties.join(", "));
            }
            if let Some(warning) = warning {
                let _ = writeln!(text, "  warning: {warning}");
                entry["warning"] = json!(warning);
            }
            known.push((term, estimates));
        }
        entry["parameters"] = Value::Object(parameters);
        entry["settings"] = measured.settings(&full, term);
        if let Some(reason) = &candidate.untestable {
            entry["untestable"] = json!(reason);
        }
        listed.push(entry);
    }
    let untestable: Vec<String> = candidates
        .iter()
        .filter_map(|candidate| {
            candidate.untestable.as_ref().map(|why| format!("{} ({why})", candidate.name))
        })
        .collect();
    if !untestable.is_empty() {
        let _ = writeln!(text, "not testable on these data: {}", untestable.join("; "));
    }
    for entry in &structure {
        let share = if entry["of"] == LOSSES { "log loss of reception" } else { "squared error" };
        let formulas: Vec<String> = formulas_of(entry)
            .map(|(formula, target)| match target {
                "mean" => format!("{formula} dB"),
                "loss" => format!("{formula} of the frames"),
                direction => format!("{formula} m/s {direction}"),
            })
            .collect();
        let colon = if formulas.is_empty() { "" } else { ": " };
        let _ = writeln!(
            text,
            "left over: {} explains {:.1} % of the {share}{colon}{}",
            named_structure(entry),
            100.0 * entry["explained"].as_f64().unwrap_or_default(),
            formulas.join(", and ")
        );
    }
    let missing: Vec<&str> = effects.iter().map(|&term| name(term)).collect();
    let sentence = match (&ladder.too_little, verdict) {
        (Some(why), _) => why.clone(),
        (None, "nothing-missing") => "nothing is missing that these data could show".to_owned(),
        (None, "missing-effects") => format!("missing: {}", missing.join(", then ")),
        (None, _) => {
            let over: Vec<String> = structure.iter().map(named_structure).collect();
            let also = if missing.is_empty() {
                String::new()
            } else {
                format!("; besides, missing: {}", missing.join(", then "))
            };
            format!("there is {}, which no known effect explains{also}", over.join(", and "))
        }
    };
    let sentence = match ladder.stopped {
        None => sentence,
        Some(1) => "stopped before anything was found".to_owned(),
        Some(round) => format!("stopped in round {round}; until then: {sentence}"),
    };
    let next = next::measurements(study, search, ladder, &known);
    for sentence in next.iter().filter_map(|entry| entry["sentence"].as_str()) {
        let _ = writeln!(text, "{sentence}");
    }
    let _ = writeln!(text, "\n{sentence}");
    let mut json = json!({
        "schema": "diagnose/1",
        "kind": kind.name,
        "verdict": verdict,
        "sentence": sentence,
        "missing": missing,
        "ladder": rungs,
        "candidates": listed,
        "unexplained": structure,
        "next_measurement": next,
    });
    if let Some(why) = &ladder.too_little {
        json["too_little"] = json!(why);
    }
    if let Some(round) = ladder.stopped {
        json["stopped_in_round"] = json!(round);
    }
    Answer { json, text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_structure_is_named_by_what_it_is_of_and_what_it_follows() {
        let named = |of: &str, covariate: &str, others: &[&str]| {
            let entry =
                json!({ "of": of, "covariate": covariate, "indistinguishable_from": others });
            named_structure(&entry)
        };
        assert_eq!(named(READINGS, "dust", &[]), "structure in dust");
        assert_eq!(
            named(READINGS, "dust", &["time_s", "height"]),
            "structure in dust (or time_s, or height: these data do not tell)"
        );
        assert_eq!(named(LOSSES, "dust", &[]), "a loss of frames that follows dust");
        assert_eq!(
            named(LOSSES, CONSTANT, &["dust", "height"]),
            "a loss of frames that is the same everywhere (or follows dust, or follows height: these data do not tell)"
        );
        assert_eq!(
            named(LOSSES, "dust", &["height", CONSTANT]),
            "a loss of frames that follows dust (or height, or is the same everywhere: these data do not tell)"
        );
    }
}
