//! What a page says in words and tables.

use super::{Contents, MeasuredAnswer};
use crate::text::escape;
use diagnose::compare::comparison::Comparison;
use diagnose::diagnosis::{Diagnosis, Rung};
use measure::account::Account;
use numbers::format::{capitalised, count, number, number_within, percent};
use proto::effect::CONSTANT;
use std::fmt::Write as _;
use study::LOSS_CURVE;
use study::open::Subject;

pub(super) fn heading(page: &mut String, contents: &Contents<'_>, title: &str) {
    let account = contents.answer.account();
    let what = if contents.is_link() { "link samples" } else { "robot samples" };
    let _ = write!(
        page,
        "<header>\n<h1>{title}</h1>\n<p class=\"lead\">{} rows of {what}, {} used. Every score is held out: the model is fitted to four fifths of the blocks of data and judged on the fifth, five times.</p>\n</header>\n",
        count(account.rows as u64),
        count(account.used as u64)
    );
    if let Some(diagnosis) = contents.answer.diagnosis() {
        let sentence = escape(&capitalised(&diagnosis.sentence));
        let _ = writeln!(page, "<p class=\"verdict\">{sentence}</p>");
    }
}

pub(crate) fn notices(page: &mut String, account: &Account) {
    let mut notices: Vec<String> = account
        .rejected
        .iter()
        .map(|rejected| {
            format!(
                "{} rows not used: {} (first on line {})",
                rejected.rows, rejected.reason, rejected.first_line
            )
        })
        .collect();
    notices.extend(account.warnings.iter().cloned());
    if notices.is_empty() {
        return;
    }
    page.push_str("<section class=\"notice\" aria-label=\"Warnings\"><ul>\n");
    for notice in notices {
        let _ = writeln!(page, "<li>{}</li>", escape(&notice));
    }
    page.push_str("</ul></section>\n");
}

pub(super) fn tiles(page: &mut String, contents: &Contents<'_>) {
    let unit = contents.unit();
    let mut tiles: Vec<(String, String)> = Vec::new();
    let error = |value: f64| format!("{} <small>{unit}</small>", number(known(value)));
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
        tiles.push((format!("In the 90 % interval, {name}"), percent(view.coverage_90())));
    }
    page.push_str("<dl class=\"tiles\">\n");
    for (name, value) in tiles {
        let _ =
            writeln!(page, "<div class=\"tile\"><dt>{}</dt><dd>{value}</dd></div>", escape(&name));
    }
    page.push_str("</dl>\n");
}

/// What the model that was found is better by than the one as configured.
fn gained(first: &Rung, last: &Rung, error: &dyn Fn(f64) -> String) -> Vec<(String, String)> {
    let gained = known(last.log_score) - known(first.log_score);
    let mut tiles = vec![
        ("With what was found".into(), error(last.rmse)),
        ("Gained".into(), format!("{} <small>nats a row</small>", number(gained))),
    ];
    let losses = [first, last].map(|rung| rung.reception_log_loss);
    if losses.iter().all(|loss| loss.is_finite()) {
        let [before, after] = losses.map(number);
        let fall = format!("{before} → {after} <small>nats a frame</small>");
        tiles.push(("Log loss of reception, as configured → with what was found".into(), fall));
    }
    tiles
}

/// A number that is shown as unknown unless it is finite.
fn known(value: f64) -> f64 {
    if value.is_finite() { value } else { f64::NAN }
}

/// The numbers of what was accepted.
pub(super) fn parameters(page: &mut String, diagnosis: &Diagnosis) {
    if diagnosis.accepted().next().is_none() {
        return;
    }
    page.push_str(
        "<h2>Their parameters</h2>\n<p>As fitted to all rows, with 90 % intervals: where an interval is wide, these data say little. <code>orchestrator extend</code> writes them into a configuration.</p>\n<table>\n<tr><th>effect</th><th>parameter</th><th class=\"n\">value</th><th class=\"n\">90 % interval</th><th>unit</th><th>mind</th></tr>\n",
    );
    for candidate in diagnosis.accepted() {
        let mut name = candidate.effect.as_str();
        let mut warning = candidate.warning.as_deref().unwrap_or_default();
        if candidate.parameters.is_empty() {
            let _ = writeln!(
                page,
                "<tr><td>{}</td><td colspan=\"4\">{}</td><td>{}</td></tr>",
                escape(name),
                curve_in_words(name),
                escape(warning)
            );
        }
        for (key, parameter) in &candidate.parameters {
            let [value, low, high] = [parameter.value, parameter.low, parameter.high].map(known);
            let half = (high - low) / 2.0;
            let _ = writeln!(
                page,
                "<tr><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{} to {}</td><td>{}</td><td>{}</td></tr>",
                escape(name),
                escape(key),
                number_within(value, half),
                number_within(low, half),
                number_within(high, half),
                escape(&parameter.unit),
                escape(warning)
            );
            (name, warning) = ("", "");
        }
    }
    page.push_str("</table>\n");
}

/// What a curve that was accepted is, in place of numbers.
fn curve_in_words(name: &str) -> &'static str {
    match name.strip_prefix(LOSS_CURVE) {
        Some(CONSTANT) => {
            "a share of the frames, the same in every row: how large is said below, where What is left is"
        }
        Some(_) => "a share of the frames, as a smooth curve: said below, where What is left is",
        None => "a smooth curve, see the pictures below",
    }
}

/// Effects that these data do not distinguish, and what would.
///
/// * `candidates`: each with those that it cannot be distinguished from.
/// * `next`: what to measure, in words.
pub(crate) fn ties<'a>(
    page: &mut String,
    candidates: impl Iterator<Item = (&'a str, Vec<&'a str>)>,
    next: impl Iterator<Item = &'a str>,
) {
    let ties = candidates.filter(|(_, others)| !others.is_empty()).map(|(effect, others)| {
        format!("{effect} cannot be told from {} on these data", others.join(", "))
    });
    let lines: Vec<String> = ties.chain(next.map(str::to_owned)).collect();
    if lines.is_empty() {
        return;
    }
    page.push_str("<h2>Ties, and what would break them</h2>\n<ul>\n");
    for line in lines {
        let _ = writeln!(page, "<li>{}</li>", escape(&capitalised(&line)));
    }
    page.push_str("</ul>\n");
}

/// Structure that no effect explains.
pub(super) fn left_over(page: &mut String, diagnosis: &Diagnosis) {
    let structure = &diagnosis.unexplained;
    page.push_str("<h2>What is left</h2>\n");
    let is_searched = diagnosis.kind == Subject::Links && diagnosis.too_little.is_none();
    if structure.is_empty() && !is_searched {
        page.push_str("<p>It was not searched for structure: the pictures below show the error over each covariate.</p>\n");
        return;
    }
    if structure.is_empty() {
        page.push_str(
            "<p>Nothing that is left depends on any covariate beyond what chance does.</p>\n",
        );
        return;
    }
    page.push_str("<ul>\n");
    for entry in structure {
        let is_of_losses = entry.is_of_losses();
        let what = if is_of_losses { "the share of frames lost" } else { "it" };
        let formulas: Vec<String> = entry
            .formulas()
            .map(|(formula, target)| {
                let formula = escape(formula);
                format!(
                    "<code>{formula}</code> describes {what}, and can be added with <code>extend --formula '{formula}' --target \
                     {target}</code>"
                )
            })
            .collect();
        let colon = if formulas.is_empty() { "" } else { ": " };
        let formula = format!("{colon}{}", formulas.join("; and along the other direction "));
        let share = percent(entry.share());
        let error = if is_of_losses { "the log loss of reception" } else { "what was left" };
        let _ = writeln!(
            page,
            "<li>There is {}, which no known effect explains: {share} of {error}{formula}.</li>",
            escape(&entry.named())
        );
    }
    page.push_str("</ul>\n");
}

/// What the data lack.
pub(super) fn untestable(page: &mut String, diagnosis: &Diagnosis) {
    let lacking: Vec<(&str, &str)> = diagnosis
        .candidates
        .iter()
        .filter_map(|candidate| Some((&*candidate.effect, candidate.untestable.as_deref()?)))
        .collect();
    if lacking.is_empty() {
        return;
    }
    page.push_str("<h2>Not testable on these data</h2>\n<table>\n");
    for (effect, why) in lacking {
        let _ = writeln!(
            page,
            "<tr><th scope=\"row\">{}</th><td>{}</td></tr>",
            escape(effect),
            escape(why)
        );
    }
    page.push_str("</table>\n");
}

/// Scores of a comparison.
pub(super) fn scores(page: &mut String, comparison: &Comparison) {
    page.push_str(
        "<h2>Scores</h2>\n<table>\n<tr><th>score (held out)</th><th class=\"n\">value</th><th class=\"n\">90 % interval</th></tr>\n",
    );
    for ((name, value), ends) in comparison.scores.iter().zip(comparison.intervals.values()) {
        let [low, high] = ends.map(|end| number(known(end)));
        let _ = writeln!(
            page,
            "<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{low} to {high}</td></tr>",
            escape(name),
            number(known(*value))
        );
    }
    page.push_str("</table>\n");
}

pub(super) fn again(page: &mut String, contents: &Contents<'_>) {
    let _ = write!(
        page,
        "<h2>To do it again</h2>\n<pre>{}</pre>\n<p class=\"soft\">SHA-256 of the data: <code>{}</code></p>\n",
        escape(&contents.command),
        escape(&contents.answer.account().data.sha256)
    );
}
