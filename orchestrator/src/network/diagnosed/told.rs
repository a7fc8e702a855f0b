//! What a search found of a network: for programs as JSON, for people as a table and a sentence.

use super::{Found, Trial};
use crate::network::candidates::Candidate;
use crate::network::compared::{Asked, body, sentence as compared};
use crate::network::kpis::KPIS;
use crate::network::spread::LEVEL;
use crate::network::tried::Fitted;
use diagnose::answer::Answer;
use numbers::format::{capitalised, number};
use serde_json::{Value, json};
use std::fmt::Write as _;

/// A fitted number as JSON: `{"delay_s": {"value": …, "unit": …, "low": …, "high": …}}`.
#[must_use]
pub fn parameters(candidate: &Candidate, fitted: &Fitted) -> Value {
    let parameter = candidate.parameter;
    json!({ parameter.key: {
        "value": fitted.value,
        "unit": parameter.unit,
        "low": fitted.interval[0],
        "high": fitted.interval[1],
    } })
}

/// A fitted number in words: `delay_s = 0.600 s (90 %: 0.580 to 0.620)`.
pub(crate) fn said(candidate: &Candidate, fitted: &Fitted) -> String {
    let [low, high] = fitted.interval.map(number);
    format!("{} (90 %: {low} to {high})", candidate.said(fitted.value))
}

fn entry(trial: &Trial) -> Value {
    let candidate = &trial.candidate;
    let mut entry = json!({
        "effect": candidate.name,
        "gain": trial.gain,
        "standard_error": trial.fitted.map(|fitted| fitted.standard_error),
        "p_value": trial.p_value,
        "accepted": trial.is_accepted,
        "indistinguishable_from": trial.ties,
        "p_value_with": trial.p_with,
        "parameters": {},
        "settings": Value::Null,
    });
    if let Some(fitted) = &trial.fitted {
        entry["parameters"] = parameters(candidate, fitted);
        entry["settings"] = json!(candidate.settings(fitted.value));
    }
    if let Some(why) = &trial.untestable {
        entry["untestable"] = json!(why);
    }
    entry
}

/// Says what a search found.
#[must_use]
pub fn told(found: &Found, asked: Asked) -> Answer {
    let (Some(first), Some(last)) = (found.rungs.first(), found.rungs.last()) else {
        return Answer { json: Value::Null, text: String::new() };
    };
    let (_, difference) = compared(&first.among);
    let missing: Vec<&str> =
        found.accepted.iter().map(|&k| found.trials[k].candidate.name).collect();
    let verdict = match (found.agrees(), missing.is_empty()) {
        (true, true) => "nothing-missing",
        (true, false) => "missing-effects",
        (false, _) => "unexplained-structure",
    };
    let far = furthest(found);
    let sentence = match verdict {
        "nothing-missing" => {
            format!("nothing is missing that these packets could show: {difference}")
        }
        "missing-effects" => {
            let parts: Vec<String> =
                found.accepted.iter().map(|&k| part(&found.trials[k])).collect();
            format!(
                "missing: {}. These packets are no run of the model as configured (p = {:.3}), and could be one with {} (p = {:.3})",
                parts.join(", then "),
                first.among.placed.p_value,
                if missing.len() == 1 { "it" } else { "them" },
                last.among.placed.p_value
            )
        }
        _ => {
            let also = if missing.is_empty() {
                String::new()
            } else {
                format!(", even with {}", missing.join(" and "))
            };
            let figure = far.map_or_else(String::new, |k| format!(", {} above all", KPIS[k].name));
            format!(
                "these packets are no run of the model{also} (p = {:.3}){figure}, and no effect that is known mends that",
                last.among.placed.p_value
            )
        }
    };
    let sentence = match found.stopped {
        None => sentence,
        Some(1) => "stopped before anything was found".to_owned(),
        Some(round) => format!("stopped in round {round}; until then: {sentence}"),
    };
    let mut json = body(&first.among, asked);
    json["schema"] = json!("diagnose/1");
    json["verdict"] = json!(verdict);
    json["sentence"] = json!(sentence);
    json["missing"] = json!(missing);
    json["ladder"] = rungs(found);
    json["candidates"] = found.trials.iter().map(entry).collect();
    json["unexplained"] = unexplained(found, far);
    let next = next(found);
    json["next_measurement"] = json!(next);
    if found.accepted.is_empty() {
        json["kpis_with"] = Value::Null;
    } else {
        json["kpis_with"] = body(&last.among, asked)["kpis"].take();
    }
    if let Some(round) = found.stopped {
        json["stopped_in_round"] = json!(round);
    }
    let mut text = format!("{}\n\n", capitalised(&difference));
    let tried: Vec<&Trial> = found.trials.iter().filter(|trial| trial.gain.is_some()).collect();
    if !tried.is_empty() {
        table(&mut text, &tried);
    }
    for trial in &found.trials {
        if let Some(why) = &trial.untestable {
            let _ = writeln!(text, "{} cannot be tried: {why}", trial.candidate.name);
        }
    }
    for sentence in next.iter().filter_map(|entry| entry["sentence"].as_str()) {
        let _ = writeln!(text, "{}", capitalised(sentence));
    }
    if !tried.is_empty() {
        text.push('\n');
    }
    text.push_str(&capitalised(&sentence));
    Answer { json, text }
}

/// An accepted effect, with its number and its ties.
fn part(trial: &Trial) -> String {
    let number = trial.fitted.as_ref().map(|fitted| said(&trial.candidate, fitted));
    let ties = if trial.ties.is_empty() {
        String::new()
    } else {
        format!(", or {}: these packets do not tell", trial.ties.join(" or "))
    };
    format!("{}, {}{ties}", trial.candidate.name, number.unwrap_or_default())
}

/// The figure in which the measurement is furthest from the last model.
fn furthest(found: &Found) -> Option<usize> {
    let figures = &found.rungs.last()?.among.placed.figures;
    let known = figures.iter().enumerate().filter_map(|(k, it)| Some((k, (*it)?.z.abs())));
    known.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
}

fn rungs(found: &Found) -> Value {
    let of = |rung: &super::Rung| {
        json!({
            "model": rung.added.map_or_else(|| "as configured".to_owned(), |name| format!("+ {name}")),
            "log_score": rung.log_density,
            "p_value": rung.among.placed.p_value,
            "rmse": Value::Null,
            "crps": Value::Null,
            "reception_log_loss": Value::Null,
        })
    };
    found.rungs.iter().map(of).collect()
}

fn unexplained(found: &Found, far: Option<usize>) -> Value {
    if found.agrees() {
        return json!([]);
    }
    let p_value = |k: usize| {
        let last = found.rungs.last();
        last.and_then(|rung| rung.among.placed.figures[k]).map(|standing| standing.p_value)
    };
    far.map_or_else(
        || json!([]),
        |k| {
            json!([{
                "covariate": KPIS[k].name,
                "explained": Value::Null,
                "p_value": p_value(k),
                "formula": Value::Null,
                "rmse_after": Value::Null,
            }])
        },
    )
}

/// What would break ties.
fn next(found: &Found) -> Vec<Value> {
    found
        .rivals
        .iter()
        .map(|rivals| {
            let figure = KPIS[rivals.figure].name;
            // By then the log likelihood of one lies as far before that of the other as it takes, on average.
            let runs = (2.0 * super::TIE / rivals.apart.powi(2)).ceil().max(1.0);
            let [one, other] = rivals.names;
            let apart = number(rivals.apart.abs());
            let sentence = if runs <= 100.0 {
                format!(
                    "{one} and {other} differ most in {figure}, by {apart} of the scatter of a run: about {} more such campaigns would tell \
                     them apart",
                    number(runs)
                )
            } else {
                format!(
                    "{one} and {other} differ most in {figure}, and hardly: by {apart} of the scatter of a run. Another campaign, with \
                     more traffic or more hops, is needed to tell them apart"
                )
            };
            json!({
                "effects": rivals.names,
                "figure": figure,
                "apart": rivals.apart,
                "campaigns": runs,
                "sentence": sentence,
            })
        })
        .collect()
}

fn table(text: &mut String, tried: &[&Trial]) {
    let _ = writeln!(
        text,
        "{:<18} {:>12} {:>8} {:>10}   number",
        "effect", "gain (nats)", "p", "p with it"
    );
    let mut tried = tried.to_vec();
    tried.sort_by(|a, b| b.gain.unwrap_or_default().total_cmp(&a.gain.unwrap_or_default()));
    for trial in tried {
        let p = |p: Option<f64>| p.map_or("–".to_owned(), |p| format!("{p:.3}"));
        let fitted =
            trial.fitted.as_ref().map_or_else(String::new, |fitted| said(&trial.candidate, fitted));
        let row = format!(
            "{:<18} {:>12} {:>8} {:>10}   {fitted}",
            trial.candidate.name,
            number(trial.gain.unwrap_or(f64::NAN)),
            p(trial.p_value),
            p(trial.p_with)
        );
        let _ = writeln!(text, "{}", row.trim_end());
    }
    let _ = writeln!(
        text,
        "gain: how much more probable the packets are with it; p: chance of as great a gain without any of them, accepted up to {}, or\n\
         beyond it where the packets are no run of the model at that level and could be one with it;\n\
         p with it: could they be one more run then, above {LEVEL} they could",
        super::ACCEPT
    );
}
