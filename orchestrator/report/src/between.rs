//! The page of `diagnose --between A B`: what changed between two campaigns, the errors with and without it, and what was ruled out.

use super::layout::{self, listing, number_cell, with_unit};
use super::measured::ladder::{Bar, bars};
use super::measured::{Picture, STYLE, figures};
use diagnose::between::words::{limits, time_of_day};
use diagnose::between::{Between, Change, Changed, Spans};
use diagnose::diagnosis::Parameter;
use maud::{Markup, html};
use measure::account::DataAccount;
use numbers::format::{capitalised, count, number, number_within};

/// What goes into the page.
struct BetweenPage<'a> {
    config: &'a str,
    command: &'a str,
    answer: &'a Between,
}

/// A section of the page, or none where the answer has nothing to show in it.
type Section = fn(&BetweenPage<'_>) -> Option<Markup>;

/// The page from top to bottom.
const SECTIONS: &[Section] = &[
    heading,
    notices,
    tiles,
    changed,
    possible,
    errors,
    ruled_out,
    common,
    unexplained,
    conditions,
    again,
];

/// The page: one HTML file that needs no other.
///
/// * `config`: name of the configuration.
/// * `command`: the command that makes this page again.
#[must_use]
pub fn page(config: &str, command: &str, answer: &Between) -> String {
    let contents = BetweenPage { config, command, answer };
    let sections = SECTIONS.iter().filter_map(|section| section(&contents));
    layout::page(&contents.title(), STYLE, &html! { @for section in sections { (section) } })
}

impl BetweenPage<'_> {
    fn title(&self) -> String {
        let Between { a, b, .. } = self.answer;
        format!("What changed: {} to {} ({})", a.data.file, b.data.file, self.config)
    }
}

fn heading(contents: &BetweenPage<'_>) -> Option<Markup> {
    let Between { a, b, sentence, .. } = contents.answer;
    let rows = |account: &DataAccount| count(account.used as u64);
    Some(html! {
        header {
            h1 { (contents.title()) }
            p.lead {
                "A is " code { (a.data.file) } " (" (rows(a)) " rows used), B is " code { (b.data.file) } " (" (rows(b))
                " rows used). The model is fitted to A; a change is needed to predict B."
            }
        }
        p.verdict { (capitalised(sentence)) }
    })
}

fn notices(contents: &BetweenPage<'_>) -> Option<Markup> {
    let Between { a, b, measurement_defects: defects, too_little, caution, complete, .. } =
        contents.answer;
    let mut notices: Vec<String> = Vec::new();
    if !complete {
        notices.push("The search was stopped before its end; the answer may still change".into());
    }
    notices.extend(too_little.iter().chain(caution).map(|why| capitalised(why)));
    for (name, account, defects) in [("A", a, &defects.a), ("B", b, &defects.b)] {
        notices.extend(account.rejected.iter().map(|rejected| {
            format!(
                "{name}: {} rows not used: {} (first on line {})",
                rejected.rows, rejected.reason, rejected.first_line
            )
        }));
        let defects = defects.iter().map(|defect| defect.text());
        let warnings = account.warnings.iter().cloned();
        notices.extend(warnings.chain(defects).map(|warning| format!("{name}: {warning}")));
    }
    layout::notices(&notices)
}

fn tiles(contents: &BetweenPage<'_>) -> Option<Markup> {
    let Between { error, error_unit, could_hide, .. } = contents.answer;
    let with_unit = |value: f64| with_unit(&number(value), error_unit);
    let mut tiles: Vec<(&str, Markup)> = Vec::new();
    if let Some(error) = error {
        tiles.push(("Error of A (rmse, held out)", with_unit(error.rmse_a)));
        tiles.push(("Error of B by the model of A", with_unit(error.rmse_b)));
        if let Some(rmse) = error.rmse_b_with_changes {
            tiles.push(("Error of B with the changes (held out)", with_unit(rmse)));
        }
    }
    if could_hide.is_finite() {
        tiles.push(("A constant difference that could hide (90 %)", with_unit(*could_hide)));
    }
    (!tiles.is_empty()).then(|| layout::tiles(tiles))
}

fn changed(contents: &BetweenPage<'_>) -> Option<Markup> {
    let changes = &contents.answer.changed;
    (!changes.is_empty()).then(|| {
        html! {
            h2 { "What changed" }
            p {
                "Parameters as fitted to each campaign, and their differences with 90 % intervals. A dash means that the model of A \
                 lacks the effect."
            }
            (changes_table(changes))
            (notes_on(changes))
        }
    })
}

fn possible(contents: &BetweenPage<'_>) -> Option<Markup> {
    let changes = &contents.answer.possible;
    (!changes.is_empty()).then(|| {
        html! {
            h2 { "What may have changed" }
            p {
                "None of these changes is certain: something else explains B as well, or the recordings do not show it beyond doubt."
            }
            (changes_table(changes))
            (notes_on(changes))
        }
    })
}

fn changes_table(changes: &[Change]) -> Markup {
    // The effect and where it acts stand in the first row alone.
    let first = |k: usize, words: &str| if k == 0 { words.to_owned() } else { String::new() };
    html! {
        table {
            tr {
                th { "effect" }
                th { "where" }
                th { "parameter" }
                th.n { "in A" }
                th.n { "in B" }
                th.n { "90 % interval in B" }
                th.n { "B less A" }
                th.n { "90 % interval" }
                th { "unit" }
            }
            @for change in changes {
                @let place = change.only.as_ref().map_or_else(|| "everywhere".to_owned(), limits);
                @if change.parameters.is_empty() {
                    tr { td { (change.effect) } td colspan="8" { (place) } }
                }
                @for (k, (key, Changed { unit, a, b, difference })) in change.parameters.iter().enumerate() {
                    tr {
                        td { (first(k, &change.effect)) }
                        td { (first(k, &place)) }
                        td { (key) }
                        (number_cell(value(a.as_ref())))
                        (number_cell(value(Some(b))))
                        (number_cell(interval(Some(b))))
                        (number_cell(value(difference.as_ref())))
                        (number_cell(interval(difference.as_ref())))
                        td { @if unit != "1" { (unit) } }
                    }
                }
            }
        }
    }
}

/// A value, to the digits that its interval determines; a dash where there is none.
fn value(parameter: Option<&Parameter>) -> String {
    parameter.map_or_else(dash, |it| number_within(it.value, (it.high - it.low) / 2.0))
}

fn interval(parameter: Option<&Parameter>) -> String {
    parameter.map_or_else(dash, |it| {
        let [low, high] = [it.low, it.high].map(|end| number_within(end, (it.high - it.low) / 2.0));
        format!("{low} to {high}")
    })
}

fn dash() -> String {
    "–".to_owned()
}

/// How sure each change is, and what else explains the data.
fn notes_on(changes: &[Change]) -> Markup {
    html! {
           ul {
               @for change in changes {
                   li {
                       (change.effect) ": held-out gain " (number(change.gain)) " ± " (number(change.standard_error))
    " " (layout::nats()) " a row, p = " (format_args!("{:.1e}", change.p_value)) "."
                       @if !change.indistinguishable_from.is_empty() {
                           " Indistinguishable on these data from " (change.indistinguishable_from.join(", or ")) "."
                       }
                       @if let Some(why) = &change.doubt { " Not certain, because " (why) "." }
                       @if let Some(warning) = &change.warning { " " (capitalised(warning)) "." }
                   }
               }
           }
       }
}

/// A probability; one that is too small to be written is not 0.
fn p_in_words(p_value: f64) -> String {
    if p_value < LEAST_P {
        format!("p < {LEAST_P:.0e}")
    } else {
        format!("p = {}", number(p_value))
    }
}

/// Smaller probabilities are not told apart.
const LEAST_P: f64 = 1e-6;

/// The errors without and with the changes.
fn errors(contents: &BetweenPage<'_>) -> Option<Markup> {
    let Between { error, error_unit: unit, .. } = contents.answer;
    let error = error.as_ref()?;
    let mut rows =
        vec![("A, held out", error.rmse_a, ""), ("B, by the model of A", error.rmse_b, "")];
    if let Some(rmse) = error.rmse_b_with_changes {
        rows.push(("B, with the changes", rmse, "after"));
    }
    let rows: Vec<Bar> = rows
        .into_iter()
        .map(|(label, value, class)| Bar {
            label: label.to_owned(),
            value,
            half: 0.0,
            class,
            text: format!("{} {unit}", number(value)),
        })
        .collect();
    let title = "Root mean squared error";
    let look = format!(
        "Does the model of A predict B as well as A? Chance alone gives as great a change of the error with {}{}.",
        p_in_words(error.p_value),
        error.p_value_new_places.map_or_else(String::new, |p_value| {
            format!(
                "; where A is predicted at held-out places, as B has new ones, with {}",
                p_in_words(p_value)
            )
        })
    );
    let means = "Rows of A are predicted by fits to other blocks of A, rows of B by a fit to all of A. With the changes, rows of B \
                 are held out."
        .to_owned();
    let svg = bars(
        "between-rmse",
        title,
        ["campaign", &format!("root mean squared error ({unit})")],
        &look,
        &rows,
    );
    let picture =
        Picture { title: title.to_owned(), look, means, key: Vec::new(), svg, is_wide: false };
    figures("Errors before and after", "", &[picture])
}

/// What stayed the same, and what was tested and not found.
fn ruled_out(contents: &BetweenPage<'_>) -> Option<Markup> {
    let Between { same, not_found, changed, possible, could_hide, error_unit, .. } =
        contents.answer;
    let worse: Vec<String> = changed
        .iter()
        .chain(possible)
        .filter(|change| !change.ruled_out.is_empty())
        .map(|change| format!("In place of {}: {}", change.effect, change.ruled_out.join(", ")))
        .collect();
    if same.is_empty() && not_found.is_empty() && worse.is_empty() {
        return None;
    }
    Some(html! {
        h2 { "What was ruled out" }
        @if !worse.is_empty() {
            p { "These explanations were fitted and predict held-out rows significantly worse." }
            ul { @for line in &worse { li { (line) } } }
        }
        @if !same.is_empty() {
            p { "These are the same in both campaigns within the margin." }
            table {
                tr { th { "what" } th.n { "margin" } th.n { "B less A, 90 % interval" } th { "unit" } }
                @for same in same {
                    @let half = (same.difference.high - same.difference.low) / 2.0;
                    tr {
                        td { (same.what) }
                        (number_cell(number_within(same.within, half)))
                        (number_cell(interval(Some(&same.difference))))
                        td { (same.difference.unit) }
                    }
                }
            }
        }
        @if !not_found.is_empty() {
            p {
                "Tested as changes, everywhere and at each node or robot, and not significant: " (not_found.join(", ")) "."
                @if could_hide.is_finite() {
                    " A constant difference of up to " (number(*could_hide)) " " (error_unit) " may still hide in these data."
                }
            }
        }
    })
}

/// What the configured model lacks in both campaigns.
fn common(contents: &BetweenPage<'_>) -> Option<Markup> {
    let common = &contents.answer.common;
    (!common.is_empty()).then(|| {
        html! {
            h2 { "What the model lacks in both campaigns" }
            table {
                tr {
                    th { "effect" }
                    th { "where" }
                    th { "parameters (90 % interval)" }
                    th { "shown by" }
                }
                @for common in common {
                    @let parameters: Vec<String> = common
                        .parameters
                        .iter()
                        .map(|(key, it)| {
                            format!("{key} = {} {} ({})", value(Some(it)), it.unit, interval(Some(it)))
                        })
                        .collect();
                    tr {
                        td { (common.effect) }
                        td { (common.only.as_ref().map_or_else(|| "everywhere".to_owned(), limits)) }
                        td { (parameters.join(", ")) }
                        td { @if common.found_in_a { "A alone" } @else { "both together" } }
                    }
                }
            }
        }
    })
}

fn unexplained(contents: &BetweenPage<'_>) -> Option<Markup> {
    let misfits = &contents.answer.unexplained;
    (!misfits.is_empty()).then(|| {
        html! {
            h2 { "Unexplained differences" }
            ul {
                @for misfit in misfits {
                    li {
                        "Beyond A, " (misfit.sentence()) " (standard error " (number(misfit.standard_error)) ", p = "
                        (format_args!("{:.1e}", misfit.p_value)) ")."
                    }
                }
            }
        }
    })
}

/// Under which conditions the campaigns were measured, where they differ.
fn conditions(contents: &BetweenPage<'_>) -> Option<Markup> {
    let Between { confounded, time_of_day_h, left_out_columns, of_time_in_a, .. } = contents.answer;
    let mut lines: Vec<String> = Vec::new();
    if let Some(spans) = time_of_day_h {
        let apart = if spans.are_apart() {
            ": an effect of the time of day is indistinguishable from a change"
        } else {
            ""
        };
        lines.push(format!("{}{apart}", time_of_day(spans)));
    }
    for it in confounded {
        let Spans { a: [a_low, a_high], b: [b_low, b_high] } = it.spans;
        let [a_low, a_high, b_low, b_high] = [a_low, a_high, b_low, b_high].map(number);
        lines.push(format!(
            "{} was {a_low} to {a_high} in A and {b_low} to {b_high} in B: its effects are indistinguishable from a change",
            it.covariate
        ));
    }
    lines.extend(of_time_in_a.iter().map(|effect| {
        format!("A varies with the time since its start ({effect}), which is not carried over to B")
    }));
    if !left_out_columns.is_empty() {
        let columns = left_out_columns.join(", ");
        lines.push(format!("Not used, because only one of the files has them: {columns}"));
    }
    (!lines.is_empty()).then(|| {
        html! {
            h2 { "Conditions" }
            ul { @for line in &lines { li { (line) "." } } }
        }
    })
}

fn again(contents: &BetweenPage<'_>) -> Option<Markup> {
    let Between { a, b, .. } = contents.answer;
    Some(html! {
        h2 { "To do it again" }
        (listing(contents.command))
        p.soft {
            "SHA-256 of the data: A " code { (a.data.sha256) } ", B " code { (b.data.sha256) }
        }
    })
}

#[cfg(test)]
mod tests;
