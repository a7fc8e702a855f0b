//! What a page says in words and tables.

use super::{MeasuredAnswer, MeasuredPage};
use crate::layout::{self, listing, number_cell, with_unit};
use diagnose::diagnosis::{NearestEffect, Parameter, Rung, Structure};
use indexmap::IndexMap;
use maud::{Markup, html};
use measure::account::DataAccount;
use numbers::format::{capitalised, count, number, number_within, percent};
use numbers::quantity;
use proto::effect::CONSTANT;
use study::LOSS_CURVE;

pub(super) fn heading(contents: &MeasuredPage<'_>) -> Option<Markup> {
    let account = contents.answer.account();
    let what = if contents.is_link() { "link samples" } else { "robot samples" };
    Some(html! {
        header {
            h1 { (contents.title()) }
            p.lead {
                (count(account.rows as u64)) " rows of " (what) ", " (count(account.used as u64)) " used. Every score is held \
                out: the model is fitted to four fifths of the blocks of data and judged on the fifth, five times."
                @if let Some(by) = &account.predicted_by {
                    " The base model is the predictions of " (by) "; effects are added to first order."
                }
            }
        }
        p.verdict { (verdict(contents)) }
    })
}

/// What was found, and where to look.
fn verdict(contents: &MeasuredPage<'_>) -> Markup {
    if let Some(diagnosis) = contents.answer.diagnosis() {
        let ends = diagnosis.ladder.first().zip(diagnosis.ladder.last());
        let ends = ends.filter(|(first, last)| last.rmse < first.rmse);
        return html! {
            (capitalised(&diagnosis.sentence))
            @if let Some((first, last)) = ends {
                ". The error falls from " (number(first.rmse)) " to " (number(last.rmse)) " " (contents.unit())
                ": look first at “Error, effect by effect”."
            }
        };
    }
    let scores = contents.answer.comparison().map(|comparison| &comparison.scores);
    let score =
        |key: &str| scores.and_then(|scores| scores.get(key)).copied().filter(|it| it.is_finite());
    let keys = if contents.is_link() { ["rmse_db", "bias_db"] } else { ["rmse_m", "bias_m"] };
    let [rmse, bias] = keys.map(score);
    let unit = contents.unit();
    let (higher, lower) =
        if contents.is_link() { ("above", "below") } else { ("ahead of", "behind") };
    let side = |bias: f64| if bias < 0.0 { lower } else { higher };
    let places = contents.answer.comparison().map_or(&[][..], |comparison| &comparison.places);
    let known = places.iter().filter(|place| place.explained.is_finite() && place.p_value < LEVEL);
    let strongest = known.max_by(|a, b| a.explained.total_cmp(&b.explained));
    html! {
        @if let Some(rmse) = rmse { "The model errs by " (number(rmse)) " " (unit) " (root mean square). " }
        @if let Some(bias) = bias {
            "Measurements are " (number(bias.abs())) " " (unit) " " (side(bias)) " it on average. "
        }
        @if let Some(place) = strongest {
            "Look first at the error over " (quantity::words(&place.covariate)) ", which explains "
            (percent(place.explained)) " of its variance."
        } @else { "The error depends on no covariate significantly." }
    }
}

/// A covariate with a greater probability by chance is not named.
const LEVEL: f64 = 0.005;

pub(super) fn notices(contents: &MeasuredPage<'_>) -> Option<Markup> {
    notices_of(contents.answer.account())
}

/// What is to be known of the measurements before an answer about them is believed.
pub(crate) fn notices_of(account: &DataAccount) -> Option<Markup> {
    let rejected = account.rejected.iter().map(|rejected| {
        format!(
            "{} rows not used: {} (first on line {})",
            rejected.rows, rejected.reason, rejected.first_line
        )
    });
    layout::notices(&rejected.chain(account.warnings.iter().cloned()).collect::<Vec<_>>())
}

pub(super) fn tiles(contents: &MeasuredPage<'_>) -> Option<Markup> {
    let unit = contents.unit();
    let mut tiles: Vec<(String, Markup)> = Vec::new();
    let error = |value: f64| with_unit(&number(known(value)), unit);
    match contents.answer {
        MeasuredAnswer::Diagnosis(diagnosis) => {
            let ends = diagnosis.ladder.first().zip(diagnosis.ladder.last());
            if let Some((first, last)) = ends {
                tiles.push(("Error as configured (rmse)".into(), error(first.rmse)));
                if 1 < diagnosis.ladder.len() {
                    tiles.extend(gained(first, last, &error));
                }
            }
        }
        MeasuredAnswer::Comparison(comparison) => {
            let is_link = unit == "dB";
            for (name, key) in [
                ("Error (rmse)", if is_link { "rmse_db" } else { "rmse_m" }),
                ("Bias", if is_link { "bias_db" } else { "bias_m" }),
            ] {
                if let Some(&value) = comparison.scores.get(key).filter(|value| value.is_finite()) {
                    tiles.push((name.into(), error(value)));
                }
            }
        }
    }
    for (_, name, view) in contents.views() {
        let coverage = html! { (percent(view.coverage_90())) };
        tiles.push((format!("In the 90 % interval, {name}"), coverage));
    }
    Some(layout::tiles(tiles.iter().map(|(name, value)| (name.as_str(), value.clone()))))
}

/// What the model that was found is better by than the one as configured.
fn gained(first: &Rung, last: &Rung, error: &dyn Fn(f64) -> Markup) -> Vec<(String, Markup)> {
    let gained = known(last.log_score) - known(first.log_score);
    let mut tiles = vec![
        ("With what was found".into(), error(last.rmse)),
        (
            "Gained in log score".into(),
            html! {
                (number(gained)) " "
                small { (layout::nats()) " a row" }
                small.means { "a held-out row is " (number(gained.exp())) " times as likely" }
            },
        ),
    ];
    let losses = [first, last].map(|rung| rung.reception_log_loss);
    if losses.iter().all(|loss| loss.is_finite()) {
        let [before, after] = losses.map(number);
        let [was, is] = losses.map(|loss| number((-loss).exp()));
        let fall = html! {
            (before) " → " (after) " "
            small { "nats a frame" }
            small.means { "what happened had probability " (was) " → " (is) ", in geometric mean" }
        };
        tiles.push(("Log loss of reception, as configured → with what was found".into(), fall));
    }
    tiles
}

/// A number that is shown as unknown unless it is finite.
fn known(value: f64) -> f64 {
    if value.is_finite() { value } else { f64::NAN }
}

/// The numbers of what was accepted.
pub(super) fn parameters(contents: &MeasuredPage<'_>) -> Option<Markup> {
    let diagnosis = contents.answer.diagnosis()?;
    diagnosis.accepted().next()?;
    let has_warning = diagnosis.accepted().any(|candidate| candidate.warning.is_some());
    Some(html! {
        h2 { "Their parameters" }
        p {
            "As fitted to all rows, with 90 % intervals: a wide interval means that these data determine the parameter \
             poorly. "
            code { "murmuration extend" } " writes them into a configuration."
        }
        table {
            tr {
                th { "effect" }
                th { "parameter" }
                th.n { "value" }
                th.n { "90 % interval" }
                th { "unit" }
                @if has_warning { th { "warning" } }
            }
            @for candidate in diagnosis.accepted() {
                @let (name, warning) = (candidate.effect.as_str(), candidate.warning.as_deref().unwrap_or_default());
                @if candidate.parameters.is_empty() {
                    tr { td { (name) } td colspan="4" { (curve_in_words(name)) } @if has_warning { td { (warning) } } }
                }
                (parameter_rows(name, &candidate.parameters, has_warning.then_some(warning)))
                @for rival in diagnosis.rivals_of(&candidate.name()) {
                    @let name = format!("or {} in its place", rival.effect);
                    (parameter_rows(&name, &rival.parameters, has_warning.then_some("")))
                }
            }
        }
    })
}

/// Rows of the table of parameters. The effect and what to mind about it stand in the first row alone.
///
/// * `warning`: what to mind, where the table has a column for it.
fn parameter_rows(
    effect: &str,
    parameters: &IndexMap<String, Parameter>,
    warning: Option<&str>,
) -> Markup {
    let first = |k: usize, words| if k == 0 { words } else { "" };
    html! {
        @for (k, (key, parameter)) in parameters.iter().enumerate() {
            @let [value, low, high] = [parameter.value, parameter.low, parameter.high].map(known);
            @let [value, low, high] = [value, low, high].map(|it| number_within(it, (high - low) / 2.0));
            tr {
                td { (first(k, effect)) }
                td { (key) }
                (number_cell(value))
                (number_cell(format!("{low} to {high}")))
                td { (parameter.unit) }
                @if let Some(warning) = warning { td { (first(k, warning)) } }
            }
        }
    }
}

/// What a curve that was accepted is, in place of numbers.
fn curve_in_words(name: &str) -> &'static str {
    match name.strip_prefix(LOSS_CURVE) {
        Some(CONSTANT) => {
            "a share of the frames, the same in every row; its size is given below, under Unexplained structure"
        }
        Some(_) => {
            "a share of the frames, as a smooth curve; it is given below, under Unexplained structure"
        }
        None => "a smooth curve; see the plots below",
    }
}

pub(super) fn ties(contents: &MeasuredPage<'_>) -> Option<Markup> {
    let diagnosis = contents.answer.diagnosis()?;
    let candidates = diagnosis.candidates.iter().map(|candidate| {
        let others = candidate.indistinguishable_from.iter().map(String::as_str);
        (candidate.effect.as_str(), others.collect())
    });
    let next = diagnosis.next_measurement.iter().map(|next| next.sentence.as_str());
    ties_of(candidates, next)
}

/// Effects that these data do not distinguish, and what would.
///
/// * `candidates`: each with those that it cannot be distinguished from.
/// * `next`: what to measure, in words.
pub(crate) fn ties_of<'a>(
    candidates: impl Iterator<Item = (&'a str, Vec<&'a str>)>,
    next: impl Iterator<Item = &'a str>,
) -> Option<Markup> {
    let ties = candidates.filter(|(_, others)| !others.is_empty()).map(|(effect, others)| {
        format!("{effect} is indistinguishable from {} on these data", others.join(", "))
    });
    let lines: Vec<String> = ties.chain(next.map(str::to_owned)).collect();
    let list = html! {
        h2 { "Ties, and measurements that would break them" }
        ul { @for line in &lines { li { (capitalised(line)) } } }
    };
    (!lines.is_empty()).then_some(list)
}

/// Structure that no effect explains.
pub(super) fn unexplained(contents: &MeasuredPage<'_>) -> Option<Markup> {
    let diagnosis = contents.answer.diagnosis()?;
    let structure = &diagnosis.unexplained;
    Some(html! {
        h2 { "Unexplained structure" }
        @if !structure.is_empty() {
            ul {
                @for (k, entry) in structure.iter().enumerate() {
                    @let is_further = structure[..k].iter().any(|it| it.is_over_same(entry));
                    li { (unexplained_in_words(entry, is_further)) }
                }
            }
        } @else if diagnosis.residuals_searched {
            p { "No covariate explains a significant part of the residuals." }
        } @else {
            p { "The residuals were not searched for structure; the plots below show the error over each covariate." }
        }
    })
}

/// `is_further`: an entry before is over the same.
fn unexplained_in_words(entry: &Structure, is_further: bool) -> Markup {
    let [what, error] = if entry.is_of_losses() {
        ["the share of frames lost", "the log loss of reception"]
    } else {
        ["it", "the residual error"]
    };
    let unknown =
        if entry.possible_cause().is_none() { ", which no known effect explains" } else { "" };
    html! {
        "There is " @if is_further { "further " } (entry.named()) (unknown) ": " (percent(entry.share())) " of " (error)
        @for (k, (formula, target)) in entry.formulas().enumerate() {
            @if k == 0 { ": " } @else { "; and along the other direction " }
            code { (formula) } " describes " (what) ", and can be added with "
            code { "extend --formula '" (formula) "' --target " (target) }
        }
        "."
        @if let Some(nearest) = &entry.nearest_effect { p.soft { (nearest_in_words(nearest)) } }
        @if let Some(warning) = &entry.warning { p.soft { "Warning: " (warning) "." } }
    }
}

/// The effect of the catalogue that comes nearest to a structure: what it reaches, and why it was not accepted.
fn nearest_in_words(nearest: &NearestEffect) -> String {
    let NearestEffect { effect, share, may_be_cause, why_not } = nearest;
    let share = percent(*share);
    let is_cause = if *may_be_cause { ", and may be its cause" } else { "" };
    format!(
        "The nearest known effect is {effect}, which reaches {share} of its gain{is_cause}. Not accepted: {why_not}."
    )
}

/// Effects that were not found: how large each may be, and from which size on it would have been found.
pub(super) fn not_found(contents: &MeasuredPage<'_>) -> Option<Markup> {
    let diagnosis = contents.answer.diagnosis()?;
    let (bounded, unit) = (diagnosis.not_found(), diagnosis.error_unit);
    let table = html! {
        h2 { "What was not found" }
        p {
            "Each effect may still move predictions by “at most” this (90 %, for all these effects together). From the second size on, \
             9 of 10 such campaigns would have shown it. Sizes are root mean squares over the rows."
        }
        table {
            tr {
                th { "effect" }
                th.n { "at most (" (unit) ")" }
                th.n { "would be found from (" (unit) ")" }
            }
            @for (effect, upper, detectable) in &bounded {
                tr {
                    td { (effect) }
                    (number_cell(number(known(*upper))))
                    (number_cell(number(known(*detectable))))
                }
            }
        }
    };
    (!bounded.is_empty()).then_some(table)
}

/// What the data lack.
pub(super) fn untestable(contents: &MeasuredPage<'_>) -> Option<Markup> {
    let candidates = contents.answer.diagnosis()?.candidates.iter();
    let lacking: Vec<(&str, &str)> = candidates
        .filter_map(|candidate| Some((&*candidate.effect, candidate.untestable.as_deref()?)))
        .collect();
    let table = html! {
        h2 { "Not testable on these data" }
        table {
            @for (effect, why) in &lacking { tr { th scope="row" { (effect) } td { (why) } } }
        }
    };
    (!lacking.is_empty()).then_some(table)
}

/// Scores of a comparison.
pub(super) fn scores(contents: &MeasuredPage<'_>) -> Option<Markup> {
    let MeasuredAnswer::Comparison(comparison) = contents.answer else { return None };
    Some(html! {
        h2 { "Scores" }
        table {
            tr { th { "score (held out)" } th.n { "value" } th.n { "90 % interval" } }
            @for ((name, value), ends) in comparison.scores.iter().zip(comparison.intervals.values()) {
                @let [low, high] = ends.map(|end| number(known(end)));
                tr {
                    td { (name) }
                    (number_cell(number(known(*value))))
                    (number_cell(format!("{low} to {high}")))
                }
            }
        }
    })
}

pub(super) fn again(contents: &MeasuredPage<'_>) -> Option<Markup> {
    Some(html! {
        h2 { "To do it again" }
        (listing(&contents.command))
        p.soft { "SHA-256 of the data: " code { (contents.answer.account().data.sha256) } }
    })
}
