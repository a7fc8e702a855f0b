//! Where the error comes from: the answer, a table and a sentence.

use super::{ErrorSource, ErrorSplit, SplitPart};
use crate::error_split::{ErrorPart, NetworkErrorSplit, NetworkFigureSplit, PartOfFigure};
use crate::kpis::KPIS;
use numbers::format::{capitalised, number, percent};
use numbers::layout::TextTable;
use std::fmt::Write as _;
use study::thresholds::PACKETS_LEVEL;

/// In what order models take over what was measured.
const ORDER: &str = "robots are replaced first, then links; joint effects of robots and radio are attributed to the robots";

fn shown(value: f64, unit: &str) -> String {
    if unit.is_empty() && 0.0 <= value { percent(value) } else { number(value) }
}

/// The figure in which a part is furthest out.
fn furthest(share: &ErrorSource) -> Option<usize> {
    let known = share.parts.iter().enumerate().filter_map(|(k, part)| Some((k, (*part)?.z.abs())));
    known.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
}

fn sentence(split: &ErrorSplit) -> String {
    let found: Vec<String> = split
        .found()
        .iter()
        .map(|share| {
            let figure = furthest(share).map_or("", |k| KPIS[k].name);
            format!("{} (p = {:.3}, most of all in {figure})", share.name, share.p_value)
        })
        .collect();
    if found.is_empty() {
        "no part of the error (robot, radio or protocol) is significant".to_owned()
    } else {
        format!("the error comes from: {}", found.join(", "))
    }
}

/// What a comparison says of the parts of the error.
#[must_use]
pub(crate) fn answer(split: &ErrorSplit) -> NetworkErrorSplit {
    let figures = KPIS.iter().enumerate().map(|(k, kpi)| {
        let [whole, with_tracks, with_tracks_and_own_links, with_tracks_and_links] =
            split.means.map(|means| means[k]);
        let figure_part = |SplitPart { value, interval: [low, high], z }| PartOfFigure {
            value,
            low,
            high,
            z: Some(z),
        };
        NetworkFigureSplit {
            name: kpi.name,
            unit: kpi.unit,
            measured: split.measured.values[k],
            whole,
            with_tracks,
            with_tracks_and_own_links,
            with_tracks_and_links,
            parts: split
                .shares
                .iter()
                .map(|share| (share.name, share.parts[k].map(figure_part)))
                .collect(),
        }
    });
    let parts = split.shares.iter().map(|share| ErrorPart {
        part: share.name,
        p_value: share.p_value,
        is_distinguishable: share.p_value <= PACKETS_LEVEL,
        figure: furthest(share).map(|k| KPIS[k].name),
    });
    NetworkErrorSplit {
        order: ["robot", "radio", "protocol"],
        note: ORDER,
        seeds: split.seeds,
        parts: parts.collect(),
        figures: figures.collect(),
        sentence: sentence(split),
    }
}

/// As a person reads it.
#[must_use]
pub(crate) fn text(split: &ErrorSplit) -> String {
    let headings =
        ["figure (means)", "measured", "whole model", "with robots", "own links", "and links"];
    let mut table = TextTable::new(headings);
    for (k, kpi) in KPIS.iter().enumerate() {
        let [whole, tracked, own, linked] = split.means.map(|means| shown(means[k], kpi.unit));
        let measured = shown(split.measured.values[k], kpi.unit);
        table.row([kpi.name.to_owned(), measured, whole, tracked, own, linked]);
    }
    let mut text = table.text();
    let _ = writeln!(
        text,
        "with robots: at their measured positions; own links: also with replayed links as the model would have measured \
         them;\nand links: also with the measured links, replayed\n\n{:<10} {:>7}   most in",
        "part", "p"
    );
    for share in &split.shares {
        let most = furthest(share).and_then(|k| {
            let part = share.parts[k]?;
            let [low, high] = part.interval.map(number);
            let unit = KPIS[k].unit;
            Some(format!("{}: {} {unit} (90 %: {low} to {high})", KPIS[k].name, number(part.value)))
        });
        let _ = writeln!(
            text,
            "{:<10} {:>7.3}   {}",
            share.name,
            share.p_value,
            most.unwrap_or_default()
        );
    }
    let _ = write!(text, "{}\n\n{}", capitalised(ORDER), capitalised(&sentence(split)));
    text
}
