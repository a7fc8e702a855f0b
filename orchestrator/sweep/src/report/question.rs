//! The question of a sweep, which its first figure asks, with its picture and a sentence that answers it; then the further ones.

use super::factors::describe;
use super::first_screen::by_importance;
use super::{MetricFigures, SweepPage, folded, panels, shown, shown_value};
use maud::{Markup, html};
use metrics::figures::Better;
use numbers::format::{capitalised, count_of};
use record::metric::{self, Robots};

/// The question that is asked first.
pub(super) fn first(contents: &SweepPage<'_>) -> Option<Markup> {
    let Some(metric) = by_importance(contents).into_iter().next() else {
        return Some(html! { p.verdict { "No figure differs between the trials." } });
    };
    Some(html! {
        h2.question { (question(contents, metric)) }
        p.verdict { (answer(contents, metric)) }
        div.figures.asked { @for picture in pictures(contents, metric) { (picture) } }
    })
}

/// The further questions, each to be opened.
pub(super) fn others(contents: &SweepPage<'_>) -> Option<Markup> {
    let metrics = by_importance(contents);
    let others = metrics.get(1..).filter(|others| !others.is_empty())?;
    let each = html! {
        @for metric in others {
            details.section {
                summary { h2 { (question(contents, metric)) } }
                p { (answer(contents, metric)) }
                @if metric.constant().is_none() {
                    div.figures.asked { @for picture in pictures(contents, metric) { (picture) } }
                }
            }
        }
    };
    if others.len() <= MOST_LISTED {
        return Some(each);
    }
    Some(folded(&count_of(others.len() as u64, "further question"), &each))
}

/// More further questions than this fold below their number.
const MOST_LISTED: usize = 6;

fn question(contents: &SweepPage<'_>, metric: &MetricFigures<'_>) -> String {
    let views = &contents.views;
    let what = match views.as_slice() {
        [view] => return panels::question(view, &contents.factors, metric),
        _ => contents.factors.iter().filter(|factor| factor.is_range),
    };
    let names: Vec<&str> = what.map(|factor| factor.name.words.as_str()).collect();
    let (last, rest) = names.split_last().unwrap_or((&"", &[]));
    format!(
        "How do the {} and the {last} change {}?",
        rest.join(", the "),
        panels::figure_words(metric)
    )
}

fn pictures(contents: &SweepPage<'_>, metric: &MetricFigures<'_>) -> Vec<Markup> {
    let views = contents.views.iter().enumerate();
    let picture = |(place, view)| {
        panels::picture(view, &contents.factors, metric, &format!("{}-{place}", metric.id))
    };
    views.filter_map(picture).collect()
}

/// What the trials say, and no more: the best and the worst setting, or the highest and the lowest where neither is better, each
/// with its interval, and whether these overlap.
pub(super) fn answer(contents: &SweepPage<'_>, metric: &MetricFigures<'_>) -> String {
    let name = capitalised(&panels::figure_words(metric));
    let of = |setting: usize| shown(metric, setting);
    let n: usize = metric.figures.values.iter().map(Vec::len).sum();
    if n == 0 {
        return format!("No trial has a value of {}.", panels::figure_words(metric));
    }
    if let Some(value) = metric.constant() {
        let trials = if n == 1 {
            "the only trial".to_owned()
        } else {
            format!("all {}", count_of(n as u64, "trial"))
        };
        return format!("{name} is {} in {trials}.", shown_value(metric, value));
    }
    let [Some((lowest, low)), Some((highest, high))] = metric.ends() else { return String::new() };
    let n_known =
        (0..metric.figures.values.len()).filter(|&it| metric.middle(it).is_some()).count();
    if n_known == 1 {
        return format!("{name} is {}.", of(highest));
    }
    if low >= high {
        let settings = if n_known == 2 {
            "both settings".to_owned()
        } else {
            format!("all {n_known} settings")
        };
        return format!("{name} has the same median in {settings}: {}.", of(highest));
    }
    let (words, [first, second]) = match better(metric) {
        Better::Higher => (["best", "worst"], [highest, lowest]),
        Better::Lower => (["best", "worst"], [lowest, highest]),
        Better::Neither => (["highest", "lowest"], [highest, lowest]),
    };
    let at = |setting: usize| {
        let words = describe(&contents.factors, setting).replace(": ", " ");
        format!("with {words}, {}", of(setting))
    };
    let [first_at, second_at] = [at(first), at(second)];
    let answer = format!("{name} is {} {first_at}, and {} {second_at}.", words[0], words[1]);
    let answer = format!("{answer} {}", certainty(metric, [first, second]));
    // A number and its unit stay on one line.
    answer.trim_end().replace(" %", "\u{a0}%")
}

/// Which values are better.
fn better(metric: &MetricFigures<'_>) -> Better {
    let name = &metric.figures.column.name;
    metric::find(name, Robots::Foreign).map_or(Better::Neither, |found| found.better)
}

/// Whether the intervals of two settings overlap.
fn certainty(metric: &MetricFigures<'_>, settings: [usize; 2]) -> String {
    if metric.figures.is_share() {
        return String::new();
    }
    let intervals =
        settings.map(|setting| metric.figures.spreads[setting].and_then(|spread| spread.interval));
    match intervals {
        [Some(a), Some(b)] if a.overlaps(b) => "The two intervals overlap.".to_owned(),
        [Some(_), Some(_)] => "The two intervals do not overlap.".to_owned(),
        _ => "One trial has no interval, so the difference may be due to the seed.".to_owned(),
    }
}
