//! Where the error comes from, as JSON, as a table and in a sentence.

use super::{Share, Split};
use crate::network::kpis::KPIS;
use numbers::format::{capitalised, number, percent};
use serde_json::{Value, json};
use std::fmt::Write as _;

/// In what order models take over what was measured.
const ORDER: &str = "robots are replaced first, then links: what robots and radio bring about together counts as the robots'";

fn shown(value: f64, unit: &str) -> String {
    if unit.is_empty() && 0.0 <= value { percent(value) } else { number(value) }
}

/// The figure in which a part is furthest out.
fn furthest(share: &Share) -> Option<usize> {
    let known = share.parts.iter().enumerate().filter_map(|(k, part)| Some((k, (*part)?.z.abs())));
    known.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
}

fn sentence(split: &Split) -> String {
    let found: Vec<String> = split
        .found()
        .iter()
        .map(|share| {
            let figure = furthest(share).map_or("", |k| KPIS[k].name);
            format!("{} (p = {:.3}, {figure} above all)", share.name, share.p_value)
        })
        .collect();
    if found.is_empty() {
        "no part of the error, robot, radio or protocol, is more than chance".to_owned()
    } else {
        format!("the error comes from: {}", found.join(", "))
    }
}

/// `error_split` of `compare/1`.
#[must_use]
pub fn json(split: &Split) -> Value {
    let figures: Vec<Value> = KPIS
        .iter()
        .enumerate()
        .map(|(k, kpi)| {
            let [whole, tracked, own, linked] = split.means.map(|means| means[k]);
            let mut parts = json!({});
            for share in &split.shares {
                parts[share.name] = share.parts[k].map_or(Value::Null, |part| {
                    let [low, high] = part.interval;
                    json!({ "value": part.value, "low": low, "high": high, "z": part.z })
                });
            }
            json!({
                "name": kpi.name,
                "unit": kpi.unit,
                "measured": split.measured.values[k],
                "whole": whole,
                "with_tracks": tracked,
                "with_tracks_and_own_links": own,
                "with_tracks_and_links": linked,
                "parts": parts,
            })
        })
        .collect();
    let parts: Vec<Value> = split
        .shares
        .iter()
        .map(|share| {
            json!({
                "part": share.name,
                "p_value": share.p_value,
                "is_distinguishable": share.p_value <= super::ACCEPT,
                "figure": furthest(share).map(|k| KPIS[k].name),
            })
        })
        .collect();
    json!({
        "order": ["robot", "radio", "protocol"],
        "note": ORDER,
        "seeds": split.seeds,
        "parts": parts,
        "figures": figures,
        "sentence": sentence(split),
    })
}

/// As a person reads it.
#[must_use]
pub fn text(split: &Split) -> String {
    let mut text = format!(
        "{:<18} {:>10} {:>12} {:>14} {:>12} {:>14}\n",
        "figure (means)", "measured", "whole model", "with robots", "own links", "and links"
    );
    for (k, kpi) in KPIS.iter().enumerate() {
        let [whole, tracked, own, linked] = split.means.map(|means| shown(means[k], kpi.unit));
        let measured = shown(split.measured.values[k], kpi.unit);
        let _ = writeln!(
            text,
            "{:<18} {measured:>10} {whole:>12} {tracked:>14} {own:>12} {linked:>14}",
            kpi.name
        );
    }
    let _ = writeln!(
        text,
        "with robots: where they were measured; own links: these, and links as the model would have measured them, replayed;\n\
         and links: those that were measured, replayed\n\n{:<10} {:>7}   most in",
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
