//! What a file of measurements holds, in words: the text of the terminal.

use super::data_check::{CovariateFacts, DataCheck, Facts, LinkFacts, RobotFacts, RowKind};
use diagnose::identifiability;
use indexmap::IndexMap;
use numbers::format::{rounded, wrapped};
use numbers::layout::WIDTH;
use std::fmt::Write as _;

/// What was found as a person reads it on a terminal.
#[must_use]
pub fn text(check: &DataCheck) -> String {
    let mut text = match check.kind {
        RowKind::Link => "link samples: one row per frame and potential receiver\n",
        RowKind::AggregatedLink => "link table: one row per link, aggregated over frames\n",
        RowKind::Robot => "robot samples: one row per robot and time\n",
    }
    .to_owned();
    let facts = match &check.facts {
        Facts::Links(facts) => links(facts),
        Facts::Robots(facts) => robots(facts),
    };
    for (label, words) in facts {
        fact(&mut text, label, &words);
    }
    fact(&mut text, "held out in", &check.blocks.join("; "));
    let testable =
        if check.testable.is_empty() { "none".to_owned() } else { check.testable.join(", ") };
    let _ = writeln!(text, "testable effects: {testable}");
    for lacking in &check.not_testable {
        let begin = format!("not testable: {:<24} ", lacking.effect);
        let indent = " ".repeat(begin.chars().count());
        let because = wrapped(&lacking.because, &indent, WIDTH);
        let _ = writeln!(text, "{begin}{}", because.trim_start());
    }
    if let Some(defects) = &check.measurement_defects {
        if defects.is_empty() {
            text.push_str("defects of the measurement: none significant\n");
        }
        for defect in defects {
            let _ = writeln!(text, "defect {}", defect.text());
        }
    }
    if let Some(table) = &check.identifiability {
        text.push_str(&identifiability::text(table));
    }
    if check.is_without_configuration {
        text.push_str(
            "(no configuration given: effects that need walls, foliage or terrain are not testable without one)\n",
        );
    }
    text
}

/// Adds a fact. Words that do not fit stand below its own.
pub(super) fn fact(text: &mut String, label: &str, words: &str) {
    let words = wrapped(words, &" ".repeat(15), WIDTH);
    let _ = writeln!(text, "  {label:<12} {}", words.trim_start());
}

/// A fact: its name, and what it is.
type Fact = (&'static str, String);

fn links(facts: &LinkFacts) -> Vec<Fact> {
    let LinkFacts { motes, links, channels, .. } = facts;
    let (n, still) = (motes.all.len(), motes.still);
    let mut list = vec![
        ("time", from_to("s", facts.time_s)),
        ("campaigns", facts.runs.to_string()),
        (
            "motes",
            if facts.is_placed {
                format!("{n}: {still} stationary, {} mobile", n - still.min(n))
            } else {
                format!("{n}; some positions are unknown")
            },
        ),
        ("links", format!("{} directed, {} pairs", links.directed, links.pairs)),
        (
            "channels",
            match (channels.first(), channels.last()) {
                (Some(low), Some(high)) => format!("{}: {low} to {high}", channels.len()),
                _ => "unknown".to_owned(),
            },
        ),
        ("distance", from_to("m", facts.distance_m)),
        (
            "RSSI",
            format!(
                "{} in {} readings, {}",
                from_to("dBm", facts.rssi_dbm),
                facts.n_readings,
                if facts.is_rounded { "whole dB" } else { "not rounded" }
            ),
        ),
        (
            "delivery",
            facts.delivery.map_or_else(
                || "unknown".to_owned(),
                |share| format!("{:.1} % of {} frames", 100.0 * share, facts.n_frames),
            ),
        ),
    ];
    list.extend(covariates(facts.covariates.as_ref()));
    list
}

fn robots(facts: &RobotFacts) -> Vec<Fact> {
    let mut list = vec![
        ("time", from_to("s", facts.time_s)),
        ("campaigns", facts.runs.to_string()),
        ("robots", facts.agents.len().to_string()),
        ("sampled", format!("every {} s", short(facts.spacing_s))),
        ("commands", facts.commands.to_owned()),
        ("x", from_to("m", facts.x_m)),
        ("y", from_to("m", facts.y_m)),
    ];
    list.extend(facts.z_m.map(|z_m| ("z", from_to("m", z_m))));
    list.push(("speed", format!("{} (1 % to 99 %, as measured)", from_to("m/s", facts.speed_mps))));
    list.push(("windows", format!("{} of {} s", facts.windows, facts.window_s)));
    list.extend(covariates(facts.covariates.as_ref()));
    list
}

fn covariates(covariates: Option<&IndexMap<String, CovariateFacts>>) -> Option<Fact> {
    let words = covariates?.iter().map(|(name, CovariateFacts { range: [low, high], missing })| {
        let missing = match missing {
            0 => String::new(),
            missing => format!(" (missing in {missing} rows)"),
        };
        format!("{name} {} to {}{missing}", short(*low), short(*high))
    });
    Some(("covariates", words.collect::<Vec<_>>().join(", ")))
}

fn from_to(unit: &str, range: Option<[f64; 2]>) -> String {
    range.map_or_else(
        || "unknown".to_owned(),
        |[low, high]| format!("{} to {} {unit}", short(low), short(high)),
    )
}

/// A number rounded to four digits.
fn short(value: f64) -> String {
    rounded(value, 4).to_string()
}
