//! What was run, and tables of all figures and of what varies.

use super::factors::describe;
use super::{MetricFigures, SweepPage, folded, shown_value};
use maud::{Markup, html};
use numbers::format::{count, count_of, percent, shortest};
use numbers::statistics::range;
use report::layout::number_cell;

/// What was run, and whether all trials ended.
pub(super) fn heading(contents: &SweepPage<'_>) -> Option<Markup> {
    let SweepPage { plan, summary, .. } = contents;
    let total = plan.n_trials();
    let of_settings = |n: fn(&crate::sweep_summary::SettingSummary) -> usize| {
        summary.settings.iter().map(n).sum::<usize>()
    };
    let failed = of_settings(|setting| setting.failed);
    let unformed = of_settings(|setting| setting.not_formed);
    let lost = [(failed, "failed"), (unformed, "had a network that did not form")];
    let lost: Vec<String> = lost
        .iter()
        .filter(|(n, _)| 0 < *n)
        .map(|(n, what)| format!("{} {what}", count(*n as u64)))
        .collect();
    Some(html! {
        header {
            h1 { (plan.name) }
            p.lead {
                (count_of(plan.settings.len() as u64, "setting")) ", each with "
                @if plan.seeds.len() == 1 { "one seed." } @else {
                    "the same " (count(plan.seeds.len() as u64)) " seeds: " (count(total as u64)) " trials."
                }
                @if lost.is_empty() {
                    @if total == 1 { " The trial finished." } @else { " All trials finished." }
                }
            }
            @if !lost.is_empty() {
                p.verdict.alert {
                    strong { "Of " (count_of(total as u64, "trial")) ", " (lost.join(" and ")) ". Their figures are left out." }
                }
            }
        }
    })
}

/// The figures in the order of importance: as the sweep asks for them; else those first that differ most between settings, in
/// comparison with seeds.
pub(super) fn by_importance<'a>(contents: &'a SweepPage<'_>) -> Vec<&'a MetricFigures<'a>> {
    let mut metrics: Vec<&MetricFigures<'_>> = contents.metrics.iter().collect();
    if contents.plan.sweep.metrics.is_none() {
        // Figures that runs lead with, then in whole per cent: of equals the first.
        let share = |metric: &&MetricFigures<'_>| metric.between_settings.unwrap_or(0.0);
        let rounded = |metric: &&MetricFigures<'_>| libm::round(100.0 * share(metric)) as i64;
        let leading = contents.plan.leading_figures();
        let leads =
            |metric: &&MetricFigures<'_>| leading.contains(&metric.figures.column.name.as_str());
        metrics.sort_by_key(|metric| {
            std::cmp::Reverse((metric.differs_between_settings(), leads(metric), rounded(metric)))
        });
    }
    metrics
}

/// The figures at a glance: their least and greatest medians, and what they depend on.
pub(super) fn at_a_glance(contents: &SweepPage<'_>) -> Option<Markup> {
    let SweepPage { plan, metrics, factors, .. } = contents;
    let shown: Vec<&MetricFigures<'_>> =
        metrics.iter().filter(|metric| metric.constant().is_none()).collect();
    if shown.is_empty() || plan.settings.len() < 2 {
        return None;
    }
    let (first, more) = shown.split_at(shown.len().min(MOST_ROWS));
    let section = html! {
        (glance_table(contents, first))
        @if !more.is_empty() {
            details {
                summary { (count_of(more.len() as u64, "further figure")) }
                (glance_table(contents, more))
            }
        }
        p.soft {
            "Least and greatest are medians over the seeds."
            @if 1 < factors.len() {
                " In parentheses: the share of the variance between settings that this factor explains by itself."
            }
            @if 1 < plan.seeds.len() {
                " Due to settings: the share of the variance of all trials that seeds do not explain."
            }
        }
    };
    Some(folded("All figures at a glance", &section))
}

/// More rows than this have to be asked for.
const MOST_ROWS: usize = 8;

fn glance_table(contents: &SweepPage<'_>, shown: &[&MetricFigures<'_>]) -> Markup {
    let SweepPage { plan, factors, .. } = contents;
    let has_strongest = 1 < factors.len();
    let has_seeds = 1 < plan.seeds.len();
    let share = |share: f64| percent(libm::round(100.0 * share) / 100.0);
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th { "figure" }
                        th.n { "least" }
                        th { "at" }
                        th.n { "greatest" }
                        th { "at" }
                        @if has_strongest { th { "depends most on" } }
                        @if has_seeds { th.n { "due to settings" } }
                    }
                }
                tbody {
                    @for metric in shown {
                        tr {
                            td { a href={ "#" (metric.id) "-0" } { (metric.label()) } }
                            @for end in metric.ends() {
                                @match end {
                                    Some((setting, value)) => {
                                        (number_cell(shown_value(metric, value)))
                                        td { (describe(factors, setting)) }
                                    }
                                    None => { td {} td {} }
                                }
                            }
                            @if has_strongest {
                                td {
                                    @if let Some((factor, explained)) = metric.strongest(factors) {
                                        (factor.name.words) " (" (share(explained)) ")"
                                    } @else { "–" }
                                }
                            }
                            @if has_seeds {
                                (number_cell(metric.between_settings.map_or_else(|| "–".to_owned(), share)))
                            }
                        }
                    }
                }
            }
        }
    }
}

/// What varies: names, values and keys.
pub(super) fn what_varies(contents: &SweepPage<'_>) -> Option<Markup> {
    let SweepPage { plan, factors, .. } = contents;
    if factors.is_empty() {
        return None;
    }
    let values = |factor: &super::factors::Factor| match &factor.numbers {
        Some(numbers) if factor.is_range => {
            let [low, high] = range(numbers.iter().copied());
            format!("{} samples, {} to {}", plan.sweep.samples, shortest(low), shortest(high))
        }
        _ => factor.levels.join(", "),
    };
    let section = html! {
        div.scroll {
            table {
                thead { tr { th { "name" } th { "values" } th { "meaning" } th { "key" } } }
                tbody {
                    @for factor in factors {
                        tr {
                            td { (factor.name.label()) }
                            td { (values(factor)) }
                            td {
                                @if factor.key.is_none() {
                                    "Values of several keys that change together."
                                } @else { (factor.name.explanation.as_deref().unwrap_or("–")) }
                            }
                            td { code { (factor.key.as_deref().unwrap_or("sweep.case")) } }
                        }
                    }
                }
            }
        }
    };
    Some(folded("What varies", &section))
}
