//! From what a search found of a network to an answer, and its words.

use super::{EffectTest, SearchResult, SearchStep};
use crate::candidate_fits::FittedEffect;
use crate::candidates::CandidateEffect;
use crate::compare::{ComparisonOptions, among_seeds, sentence as comparison_sentence};
use crate::diagnosis::{
    NetworkCandidate, NetworkDiagnosis, NetworkRung, NextCampaign, SCHEMA, UnexplainedFigure,
};
use crate::kpis::KPIS;
use diagnose::diagnosis::{Parameter, Verdict};
use indexmap::IndexMap;
use measure::account::DataAccount;
use numbers::format::{capitalised, number};
use numbers::layout::TextTable;
use numbers::power::square;
use std::fmt::Write as _;
use study::thresholds::{CONSISTENCY_LEVEL, PACKETS_LEVEL, RIVAL_NATS};

/// The number of an effect as fitted, by its key.
#[must_use]
pub(crate) fn parameters(
    candidate: &CandidateEffect,
    fitted: &FittedEffect,
) -> IndexMap<&'static str, Parameter> {
    let [low, high] = fitted.interval;
    let unit = candidate.parameter.unit.to_owned();
    IndexMap::from([(candidate.parameter.key, Parameter { value: fitted.value, unit, low, high })])
}

/// A fitted number in words: `delay_s = 0.600 s (90 %: 0.580 to 0.620)`.
pub fn parameter_text(candidate: &CandidateEffect, fitted: &FittedEffect) -> String {
    let [low, high] = fitted.interval.map(number);
    format!("{} (90 %: {low} to {high})", candidate.setting_text(fitted.value))
}

fn candidate(test: &EffectTest) -> NetworkCandidate {
    let fitted = test.fitted.as_ref();
    NetworkCandidate {
        effect: test.candidate.name,
        gain: test.gain,
        standard_error: fitted.map(|fitted| fitted.standard_error),
        p_value: test.p_value,
        accepted: test.is_accepted,
        indistinguishable_from: test.ties.clone(),
        p_value_with: test.p_with,
        parameters: fitted.map_or_else(IndexMap::new, |fitted| parameters(&test.candidate, fitted)),
        settings: fitted.map(|fitted| test.candidate.settings(fitted.value)),
        untestable: test.untestable.clone(),
    }
}

/// The answer of a search.
#[must_use]
pub(crate) fn answer(
    found: &SearchResult,
    asked: ComparisonOptions,
    account: &DataAccount,
) -> NetworkDiagnosis {
    let (first, last) = found.first_and_last();
    let (_, difference) = comparison_sentence(&first.among);
    let missing: Vec<&str> =
        found.accepted.iter().map(|&k| found.tests[k].candidate.name).collect();
    let far = furthest(found);
    let (verdict, sentence) = match (found.agrees(), missing.is_empty()) {
        (true, true) => (
            Verdict::NothingMissing,
            format!("no missing effect is detectable in these packets: {difference}"),
        ),
        (true, false) => {
            let parts: Vec<String> =
                found.accepted.iter().map(|&k| effect_text(&found.tests[k])).collect();
            let sentence = format!(
                "missing: {}. The packets are inconsistent with the model as configured (p = {:.3}), and consistent with \
                 {} (p = {:.3})",
                parts.join(", then "),
                first.among.placed.p_value,
                if missing.len() == 1 { "it" } else { "them" },
                last.among.placed.p_value
            );
            (Verdict::MissingEffects, sentence)
        }
        (false, _) => {
            let also = if missing.is_empty() {
                String::new()
            } else {
                format!(", even with {}", missing.join(" and "))
            };
            let figure =
                far.map_or_else(String::new, |k| format!(", most of all in {}", KPIS[k].name));
            let sentence = format!(
                "the packets are inconsistent with the model{also} (p = {:.3}){figure}, and no known effect explains this",
                last.among.placed.p_value
            );
            (Verdict::UnexplainedStructure, sentence)
        }
    };
    let sentence = match found.stopped {
        None => sentence,
        Some(1) => "stopped in round 1, before any result".to_owned(),
        Some(round) => {
            format!("stopped in round {round}; partial result, which may still change: {sentence}")
        }
    };
    NetworkDiagnosis {
        schema: SCHEMA,
        kind: "network",
        among: among_seeds(&first.among, asked),
        verdict,
        sentence,
        missing,
        ladder: found.rungs.iter().map(rung).collect(),
        candidates: found.tests.iter().map(candidate).collect(),
        unexplained: unexplained(found, far),
        next_measurement: next(found),
        kpis_with: (!found.accepted.is_empty()).then(|| among_seeds(&last.among, asked).kpis),
        stopped_in_round: found.stopped,
        complete: found.stopped.is_none(),
        account: account.clone(),
    }
}

/// A diagnosis of a network as a person reads it on a terminal.
#[must_use]
pub(crate) fn text(found: &SearchResult, diagnosis: &NetworkDiagnosis) -> String {
    let (_, difference) = comparison_sentence(&found.first_and_last().0.among);
    let mut text = format!("{}\n\n", capitalised(&difference));
    let tried: Vec<&EffectTest> = found.tests.iter().filter(|test| test.gain.is_some()).collect();
    if !tried.is_empty() {
        table(&mut text, &tried);
    }
    for test in &found.tests {
        if let Some(why) = &test.untestable {
            let _ = writeln!(text, "{} is not testable: {why}", test.candidate.name);
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
fn effect_text(test: &EffectTest) -> String {
    let number = test.fitted.as_ref().map(|fitted| parameter_text(&test.candidate, fitted));
    let ties = if test.ties.is_empty() {
        String::new()
    } else {
        format!(", or {}: indistinguishable on these packets", test.ties.join(" or "))
    };
    format!("{}, {}{ties}", test.candidate.name, number.unwrap_or_default())
}

/// The figure in which the measurement is furthest from the last model.
fn furthest(found: &SearchResult) -> Option<usize> {
    let figures = &found.first_and_last().1.among.placed.figures;
    let known = figures.iter().enumerate().filter_map(|(k, it)| Some((k, (*it)?.z.abs())));
    known.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
}

fn rung(rung: &SearchStep) -> NetworkRung {
    NetworkRung {
        model: rung.added.map_or_else(|| "as configured".to_owned(), |name| format!("+ {name}")),
        log_score: rung.log_density,
        p_value: rung.among.placed.p_value,
        rmse: (),
        crps: (),
        reception_log_loss: (),
    }
}

fn unexplained(found: &SearchResult, far: Option<usize>) -> Vec<UnexplainedFigure> {
    let (_, last) = found.first_and_last();
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
fn next(found: &SearchResult) -> Vec<NextCampaign> {
    found
        .rivals
        .iter()
        .map(|rivals| {
            let figure = KPIS[rivals.figure].name;
            // By then the log likelihood of one lies as far before that of the other as it takes, on average.
            let runs = (2.0 * RIVAL_NATS / square(rivals.apart)).ceil().max(1.0);
            let [one, other] = rivals.names;
            let apart = number(rivals.apart.abs());
            let sentence = if runs <= 100.0 {
                format!(
                    "{one} and {other} differ most in {figure}, by {apart} standard deviations of a run: about {} more \
                     such campaigns would distinguish them",
                    number(runs)
                )
            } else {
                format!(
                    "{one} and {other} differ most in {figure}, but only by {apart} standard deviations of a run; a \
                     campaign with more traffic or more hops is needed to distinguish them"
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

fn table(text: &mut String, tried: &[&EffectTest]) {
    let headings = ["effect", "gain (nats)", "p", "p with it", "parameter"];
    let mut table = TextTable::new(headings).text_in(4);
    let mut tried = tried.to_vec();
    tried.sort_by(|a, b| b.gain.unwrap_or_default().total_cmp(&a.gain.unwrap_or_default()));
    for test in tried {
        let p = |p: Option<f64>| p.map_or("–".to_owned(), |p| format!("{p:.3}"));
        let fitted = test
            .fitted
            .as_ref()
            .map_or_else(String::new, |fitted| parameter_text(&test.candidate, fitted));
        table.row([
            test.candidate.name.to_owned(),
            number(test.gain.unwrap_or(f64::NAN)),
            p(test.p_value),
            p(test.p_with),
            fitted,
        ]);
    }
    text.push_str(&table.text());
    let _ = writeln!(
        text,
        "gain: log-likelihood gain with the effect; p: probability of such a gain if no effect is missing, accepted up to \
         {}, or\nbeyond it if the packets are inconsistent with the model at that level and consistent with the effect \
         added;\np with it: p-value of the packets with the effect added, consistent above {CONSISTENCY_LEVEL}",
        PACKETS_LEVEL
    );
}
