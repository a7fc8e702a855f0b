//! From what a search found of a network to an answer, and its words.

use super::{Found, Rung, Trial};
use crate::candidates::Candidate;
use crate::compared::{Asked, among_seeds, sentence as compared};
use crate::diagnosis::{
    NetworkCandidate, NetworkDiagnosis, NetworkRung, NextCampaign, SCHEMA, UnexplainedFigure,
};
use crate::kpis::KPIS;
use crate::spread::LEVEL;
use crate::tried::Fitted;
use diagnose::diagnosis::{Parameter, Verdict};
use indexmap::IndexMap;
use measure::account::Account;
use numbers::format::{capitalised, number};
use numbers::power::square;
use std::fmt::Write as _;

/// The number of an effect as fitted, by its key.
#[must_use]
pub fn parameters(candidate: &Candidate, fitted: &Fitted) -> IndexMap<&'static str, Parameter> {
    let [low, high] = fitted.interval;
    let unit = candidate.parameter.unit.to_owned();
    IndexMap::from([(candidate.parameter.key, Parameter { value: fitted.value, unit, low, high })])
}

/// A fitted number in words: `delay_s = 0.600 s (90 %: 0.580 to 0.620)`.
pub fn said(candidate: &Candidate, fitted: &Fitted) -> String {
    let [low, high] = fitted.interval.map(number);
    format!("{} (90 %: {low} to {high})", candidate.said(fitted.value))
}

fn candidate(trial: &Trial) -> NetworkCandidate {
    let fitted = trial.fitted.as_ref();
    NetworkCandidate {
        effect: trial.candidate.name,
        gain: trial.gain,
        standard_error: fitted.map(|fitted| fitted.standard_error),
        p_value: trial.p_value,
        accepted: trial.is_accepted,
        indistinguishable_from: trial.ties.clone(),
        p_value_with: trial.p_with,
        parameters: fitted
            .map_or_else(IndexMap::new, |fitted| parameters(&trial.candidate, fitted)),
        settings: fitted.map(|fitted| trial.candidate.settings(fitted.value)),
        untestable: trial.untestable.clone(),
    }
}

/// The answer of a search.
#[must_use]
pub fn answer(found: &Found, asked: Asked, account: &Account) -> NetworkDiagnosis {
    let (first, last) = found.ends();
    let (_, difference) = compared(&first.among);
    let missing: Vec<&str> =
        found.accepted.iter().map(|&k| found.trials[k].candidate.name).collect();
    let verdict = match (found.agrees(), missing.is_empty()) {
        (true, true) => Verdict::NothingMissing,
        (true, false) => Verdict::MissingEffects,
        (false, _) => Verdict::UnexplainedStructure,
    };
    let far = furthest(found);
    let sentence = match verdict {
        Verdict::NothingMissing => {
            format!("nothing is missing that these packets could show: {difference}")
        }
        Verdict::MissingEffects => {
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
        Verdict::UnexplainedStructure => {
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
    NetworkDiagnosis {
        schema: SCHEMA,
        kind: "network",
        among: among_seeds(&first.among, asked),
        verdict,
        sentence,
        missing,
        ladder: found.rungs.iter().map(rung).collect(),
        candidates: found.trials.iter().map(candidate).collect(),
        unexplained: unexplained(found, far),
        next_measurement: next(found),
        kpis_with: (!found.accepted.is_empty()).then(|| among_seeds(&last.among, asked).kpis),
        stopped_in_round: found.stopped,
        account: account.clone(),
    }
}

/// A diagnosis of a network as a person reads it on a terminal.
#[must_use]
pub fn text(found: &Found, diagnosis: &NetworkDiagnosis) -> String {
    let (_, difference) = compared(&found.ends().0.among);
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
    for next in &diagnosis.next_measurement {
        let _ = writeln!(text, "{}", capitalised(&next.sentence));
    }
    if !tried.is_empty() {
        text.push('\n');
    }
    text.push_str(&capitalised(&diagnosis.sentence));
    text
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
    let figures = &found.ends().1.among.placed.figures;
    let known = figures.iter().enumerate().filter_map(|(k, it)| Some((k, (*it)?.z.abs())));
    known.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
}

fn rung(rung: &Rung) -> NetworkRung {
    NetworkRung {
        model: rung.added.map_or_else(|| "as configured".to_owned(), |name| format!("+ {name}")),
        log_score: rung.log_density,
        p_value: rung.among.placed.p_value,
        rmse: (),
        crps: (),
        reception_log_loss: (),
    }
}

fn unexplained(found: &Found, far: Option<usize>) -> Vec<UnexplainedFigure> {
    let (_, last) = found.ends();
    let far = far.filter(|_| !found.agrees());
    far.into_iter()
        .map(|k| UnexplainedFigure {
            covariate: KPIS[k].name,
            explained: (),
            p_value: last.among.placed.figures[k].map(|standing| standing.p_value),
            formula: (),
            rmse_after: (),
        })
        .collect()
}

/// What would break ties.
fn next(found: &Found) -> Vec<NextCampaign> {
    found
        .rivals
        .iter()
        .map(|rivals| {
            let figure = KPIS[rivals.figure].name;
            // By then the log likelihood of one lies as far before that of the other as it takes, on average.
            let runs = (2.0 * super::TIE / square(rivals.apart)).ceil().max(1.0);
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
            NextCampaign {
                effects: rivals.names,
                figure,
                apart: rivals.apart,
                campaigns: runs,
                sentence,
            }
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
