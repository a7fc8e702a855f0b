//! The end of a run's page: what the experiment was, how to do it again, and tables for those who need the numbers.

use super::layout::{listing, number_cell};
use maud::{Markup, html};
use numbers::format::{count, percent, shortest};
use record::{FinishedRun, TRUTH_BASELINE};

pub(super) fn facts(contents: &FinishedRun<'_>) -> Option<Markup> {
    let FinishedRun { header, summary, .. } = contents;
    let mut facts: Vec<(&str, String)> = vec![
        ("name", header.name.clone()),
        ("seed", header.seed.to_string()),
        ("agents", header.agent_count.to_string()),
        ("control period", format!("{} s", shortest(header.step_ns as f64 / 1e9))),
        ("coupling", header.coupling.name().to_owned()),
    ];
    facts.extend(header.labels.iter().map(|(label, value)| {
        if label == "knowledge" && value == "truth" {
            (label.as_str(), format!("{value}: {TRUTH_BASELINE}"))
        } else {
            (label.as_str(), value.clone())
        }
    }));
    if let Some(digest) = &summary.final_digest {
        facts.push(("digest of the last step", digest.clone()));
    }
    Some(html! {
        h2 { "Experiment" }
        table.facts {
            @for (name, value) in facts { tr { th scope="row" { (name) } td { (value) } } }
        }
    })
}

pub(super) fn again(contents: &FinishedRun<'_>) -> Option<Markup> {
    Some(html! {
        h2 { "To do it again" }
        p {
            "Beside this page, " code { "config.toml" } " holds the whole configuration, the seed included. The same configuration \
             and seed give the same messages, tables and summary, byte for byte. In this directory:"
        }
        (listing("murmuration run config.toml --out again\nmurmuration verify ."))
        details {
            summary { "The configuration" }
            (listing(contents.header.config_toml.trim_end()))
        }
    })
}

/// Delivery against distance as a table: the picture for those who need the numbers.
pub(super) fn delivery_in_numbers(contents: &FinishedRun<'_>) -> Option<Markup> {
    let bins = contents.measures?.by_distance();
    if bins.is_empty() {
        return None;
    }
    let headings = ["from (m)", "to (m)", "attempts", "deliveries", "share", "95 % interval"];
    Some(html! {
        details {
            summary { "Delivery against distance in numbers" }
            table {
                tr { @for heading in headings { th.n { (heading) } } }
                @for bin in &bins {
                    @let [low, high] = bin.interval();
                    tr {
                        (number_cell(shortest(bin.from_m)))
                        (number_cell(shortest(bin.to_m)))
                        (number_cell(count(bin.attempts)))
                        (number_cell(count(bin.deliveries)))
                        (number_cell(percent(bin.ratio())))
                        (number_cell(format!("{} to {}", percent(low), percent(high))))
                    }
                }
            }
        }
    })
}

pub(super) fn provenance(contents: &FinishedRun<'_>) -> Option<Markup> {
    let provenance = contents.provenance;
    provenance.as_object().filter(|provenance| !provenance.is_empty())?;
    Some(html! {
        details {
            summary { "When, where and how it was run" }
            (listing(&format!("{provenance:#}")))
        }
    })
}
