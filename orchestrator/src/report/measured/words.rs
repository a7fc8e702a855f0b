//! What a page says in words and tables.

use super::Contents;
use crate::report::text::escape;
use diagnose::answer::{LOSSES, formulas_of, named_structure};
use numbers::format::{capitalised, count, number, number_within, percent};
use proto::effect::CONSTANT;
use serde_json::Value;
use std::fmt::Write as _;
use study::LOSS_CURVE;

fn list(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}

pub(super) fn heading(page: &mut String, contents: &Contents<'_>, title: &str) {
    let json = contents.json;
    let rows = |key: &str| count(json[key].as_u64().unwrap_or(0));
    let what = if contents.is_link() { "link samples" } else { "robot samples" };
    let _ = write!(
        page,
        "<header>\n<h1>{title}</h1>\n<p class=\"lead\">{} rows of {what}, {} used. Every score is held out: the model is fitted to four fifths of the blocks of data and judged on the fifth, five times.</p>\n</header>\n",
        rows("rows"),
        rows("used")
    );
    if let Some(sentence) = json["sentence"].as_str() {
        let _ = writeln!(page, "<p class=\"verdict\">{}</p>", escape(&capitalised(sentence)));
    }
}

pub(crate) fn notices(page: &mut String, json: &Value) {
    let mut notices: Vec<String> = list(&json["rejected"])
        .map(|rejected| {
            format!(
                "{} rows not used: {} (first on line {})",
                rejected["rows"],
                text(&rejected["reason"]),
                rejected["first_line"]
            )
        })
        .collect();
    notices.extend(list(&json["warnings"]).map(|warning| text(warning).to_owned()));
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
    let (json, unit) = (contents.json, contents.unit());
    let mut tiles: Vec<(String, String)> = Vec::new();
    let ladder: Vec<&Value> = list(&json["ladder"]).collect();
    let error = |value: f64| format!("{} <small>{unit}</small>", number(value));
    if let (Some(first), Some(last)) = (ladder.first(), ladder.last()) {
        let of = |rung: &Value, key: &str| rung[key].as_f64().unwrap_or(f64::NAN);
        tiles.push(("Error as configured (rmse)".into(), error(of(first, "rmse"))));
        if 1 < ladder.len() {
            tiles.push(("With what was found".into(), error(of(last, "rmse"))));
            let gained = of(last, "log_score") - of(first, "log_score");
            tiles.push(("Gained".into(), format!("{} <small>nats a row</small>", number(gained))));
            let losses = [first, last].map(|rung| of(rung, "reception_log_loss"));
            if losses.iter().all(|loss| loss.is_finite()) {
                let [before, after] = losses.map(number);
                let fall = format!("{before} → {after} <small>nats a frame</small>");
                tiles.push((
                    "Log loss of reception, as configured → with what was found".into(),
                    fall,
                ));
            }
        }
    } else {
        let key = if unit == "dB" { "rmse_db" } else { "rmse_m" };
        let bias = if unit == "dB" { "bias_db" } else { "bias_m" };
        for (name, key) in [("Error (rmse)", key), ("Bias", bias)] {
            if let Some(value) = json["scores"][key].as_f64() {
                tiles.push((name.into(), error(value)));
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

/// The numbers of what was accepted.
pub(super) fn parameters(page: &mut String, json: &Value) {
    let accepted: Vec<&Value> =
        list(&json["candidates"]).filter(|entry| entry["accepted"] == true).collect();
    if accepted.is_empty() {
        return;
    }
    page.push_str(
        "<h2>Their parameters</h2>\n<p>As fitted to all rows, with 90 % intervals: where an interval is wide, these data say little. <code>orchestrator extend</code> writes them into a configuration.</p>\n<table>\n<tr><th>effect</th><th>parameter</th><th class=\"n\">value</th><th class=\"n\">90 % interval</th><th>unit</th><th>mind</th></tr>\n",
    );
    for entry in accepted {
        let mut name = text(&entry["effect"]);
        let mut warning = text(&entry["warning"]);
        let parameters: Vec<(&String, &Value)> =
            entry["parameters"].as_object().into_iter().flatten().collect();
        if parameters.is_empty() {
            let _ = writeln!(
                page,
                "<tr><td>{}</td><td colspan=\"4\">{}</td><td>{}</td></tr>",
                escape(name),
                curve_in_words(name),
                escape(warning)
            );
        }
        for (key, parameter) in parameters {
            let of = |key: &str| parameter[key].as_f64().unwrap_or(f64::NAN);
            let half = (of("high") - of("low")) / 2.0;
            let value = |key: &str| number_within(of(key), half);
            let _ = writeln!(
                page,
                "<tr><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{} to {}</td><td>{}</td><td>{}</td></tr>",
                escape(name),
                escape(key),
                value("value"),
                value("low"),
                value("high"),
                escape(text(&parameter["unit"])),
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

/// What cannot be told apart, and what would tell.
pub(crate) fn ties(page: &mut String, json: &Value) {
    let ties: Vec<String> = list(&json["candidates"])
        .filter(|entry| list(&entry["indistinguishable_from"]).next().is_some())
        .map(|entry| {
            let others: Vec<&str> = list(&entry["indistinguishable_from"]).map(text).collect();
            format!(
                "{} cannot be told from {} on these data",
                text(&entry["effect"]),
                others.join(", ")
            )
        })
        .collect();
    let next: Vec<String> = list(&json["next_measurement"]).map(said).collect();
    if ties.is_empty() && next.is_empty() {
        return;
    }
    page.push_str("<h2>Ties, and what would break them</h2>\n<ul>\n");
    for line in ties.iter().chain(&next) {
        let _ = writeln!(page, "<li>{}</li>", escape(&capitalised(line)));
    }
    page.push_str("</ul>\n");
}

/// An entry in words: its own sentence, or all it holds.
fn said(entry: &Value) -> String {
    for key in ["sentence", "text", "what"] {
        if let Some(sentence) = entry[key].as_str() {
            return sentence.to_owned();
        }
    }
    match entry {
        Value::String(sentence) => sentence.clone(),
        Value::Object(fields) => {
            let fields: Vec<String> = fields
                .iter()
                .filter(|(_, value)| !value.is_null())
                .map(|(key, value)| match value {
                    Value::String(value) => format!("{key}: {value}"),
                    value => format!("{key}: {value}"),
                })
                .collect();
            fields.join("; ")
        }
        other => other.to_string(),
    }
}

/// Structure that no effect explains.
pub(super) fn left_over(page: &mut String, json: &Value) {
    let structure: Vec<&Value> = list(&json["unexplained"]).collect();
    page.push_str("<h2>What is left</h2>\n");
    if structure.is_empty() && (json["kind"] != "link" || json["too_little"].is_string()) {
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
        let is_of_losses = entry["of"] == LOSSES;
        let what = if is_of_losses { "the share of frames lost" } else { "it" };
        let formulas: Vec<String> = formulas_of(entry)
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
        let share = percent(entry["explained"].as_f64().unwrap_or(0.0));
        let error = if is_of_losses { "the log loss of reception" } else { "what was left" };
        let _ = writeln!(
            page,
            "<li>There is {}, which no known effect explains: {share} of {error}{formula}.</li>",
            escape(&named_structure(entry))
        );
    }
    page.push_str("</ul>\n");
}

/// What the data lack.
pub(super) fn untestable(page: &mut String, json: &Value) {
    let lacking: Vec<&Value> =
        list(&json["candidates"]).filter(|entry| entry["untestable"].is_string()).collect();
    if lacking.is_empty() {
        return;
    }
    page.push_str("<h2>Not testable on these data</h2>\n<table>\n");
    for entry in lacking {
        let _ = writeln!(
            page,
            "<tr><th scope=\"row\">{}</th><td>{}</td></tr>",
            escape(text(&entry["effect"])),
            escape(text(&entry["untestable"]))
        );
    }
    page.push_str("</table>\n");
}

/// Scores of a comparison.
pub(super) fn scores(page: &mut String, json: &Value) {
    page.push_str(
        "<h2>Scores</h2>\n<table>\n<tr><th>score (held out)</th><th class=\"n\">value</th><th class=\"n\">90 % interval</th></tr>\n",
    );
    for (name, value) in json["scores"].as_object().into_iter().flatten() {
        let interval: Vec<String> = list(&json["intervals"][name])
            .map(|end| number(end.as_f64().unwrap_or(f64::NAN)))
            .collect();
        let _ = writeln!(
            page,
            "<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>",
            escape(name),
            number(value.as_f64().unwrap_or(f64::NAN)),
            interval.join(" to ")
        );
    }
    page.push_str("</table>\n");
}

pub(super) fn again(page: &mut String, contents: &Contents<'_>) {
    let json = contents.json;
    let _ = write!(
        page,
        "<h2>To do it again</h2>\n<pre>{}</pre>\n<p class=\"soft\">SHA-256 of the data: <code>{}</code></p>\n",
        escape(&contents.command),
        escape(text(&json["data"]["sha256"]))
    );
}
