//! `netsim.phy.standard`: the physical layer, and what follows from it where it is not configured.

use super::MODE_6TISCH;
use crate::catalogue::Catalogue;
use crate::mesh::config::STANDARD_SLOT_NS;
use crate::phy::model::Model;
use crate::phy::propagation::{self, Family};
use crate::phy::standard::{self, Entry};
use crate::phy::{interference, reception};
use proto::config::{Lists, Node, Problem, TableSpec, Value, check, join, parse};
use proto::types::seconds;

/// The physical layer of a checked table of `[netsim.phy]`.
pub(super) fn of(phy: &toml::Table) -> &'static Entry {
    standard::find(phy.get("standard").and_then(toml::Value::as_str))
}

/// Fills in what follows from the physical layer of a checked table of `[netsim.phy]` and is not written. Reports what does not go
/// with it.
pub(super) fn apply(
    phy: &mut toml::Table,
    written: Option<&Node>,
    path: &str,
    catalogue: &Catalogue,
    problems: &mut Vec<Problem>,
) {
    let entry = of(phy);
    let base = catalogue.propagation.selected(phy, &propagation::TAG);
    let family = base.map(|base| base.family);
    let tables = [
        ("reception", &reception::SPEC, entry.standard.reception_toml()),
        ("interference", &interference::SPEC, entry.standard.interference_toml()),
    ];
    let is_written = |key: &str| written.and_then(|phy| phy.get(key)).is_some();
    for (key, spec, text) in tables {
        let Some(text) = text else { continue };
        let own = filled_in(&text, spec, &catalogue.lists());
        if !is_written(key) {
            phy.insert(key.to_owned(), own.into());
            continue;
        }
        let decides = key != "reception" || family == Some(Family::Signal);
        let kind = phy.get(key).and_then(|table| table.get("kind"));
        let is_own = kind == own.get("kind");
        let is_measured = phy.get(key).and_then(|table| table.get("points")).is_some();
        if decides && kind.is_some() && !is_own && !is_measured {
            let message = format!(
                "does not apply with standard = {:?}, because it describes receivers of another physical layer",
                entry.name
            );
            let text = |value: Option<&toml::Value>| {
                value.map_or_else(String::new, toml::Value::to_string)
            };
            let path = join(path, &format!("{key}.kind"));
            let problem = Problem::new(path, message).value(text(kind));
            problems.push(problem.nearest(text(own.get("kind"))));
        }
    }
    if entry.name == standard::find(None).name {
        return;
    }
    if !is_written("carrier_hz") {
        phy.insert("carrier_hz".to_owned(), entry.standard.channels.middle_hz().into());
    }
    if family == Some(Family::Recording) {
        let message = "must be the physical layer of the recording, which is of 2.4 GHz";
        let first = standard::find(None).name;
        let path = join(path, "standard");
        let problem = Problem::new(path, message).value(format!("{:?}", entry.name));
        problems.push(problem.nearest(format!("{first:?}")));
    }
}

/// A table of this text with all its defaults.
fn filled_in(text: &str, spec: &TableSpec, lists: &Lists) -> toml::Table {
    let node = parse(text).expect("the physical layer states TOML");
    check(&node, "", spec, lists, &mut Vec::new()).table
}

/// Reports written channels that the physical layer does not have, even if others are no channels at all.
pub(super) fn check_channels(
    written: Option<&Node>,
    entry: &Entry,
    path: &str,
    problems: &mut Vec<Problem>,
) {
    let Some(Value::List(channels)) = written.map(|node| &node.value) else { return };
    let plan = entry.standard.channels;
    for (index, node) in channels.iter().enumerate() {
        let Value::Integer(channel) = node.value else { continue };
        let is_known = u8::try_from(channel).is_ok_and(|channel| plan.contains(channel));
        // What no physical layer has is reported already.
        if !is_known && (0..=128).contains(&channel) {
            let (first, last) = (plan.first, plan.last);
            let message = format!(
                "must be a channel of phy.standard = {:?}, a whole number from {first} to {last}",
                entry.name
            );
            let problem = Problem::new(join(path, &format!("hopping_sequence[{index}]")), message);
            let nearest = channel.clamp(i64::from(first), i64::from(last));
            problems.push(problem.value(channel).nearest(nearest));
        }
    }
}

/// Warns of effects that act on no channel of the hopping sequence.
pub(super) fn warn_of_bands(
    model: &Model,
    hopping_sequence: &[u8],
    path: &str,
    warnings: &mut Vec<String>,
) {
    for (index, effect) in model.effects.iter().enumerate() {
        let Some(band_hz) = effect.band_hz() else { continue };
        let mut channels =
            hopping_sequence.iter().map(|&channel| model.frequency_hz(Some(channel)));
        if channels.any(|frequency_hz| band_hz.contains(&frequency_hz)) {
            continue;
        }
        let why = if hopping_sequence.is_empty() {
            format!("frames have no channel; set {path}.hopping_sequence")
        } else {
            let [first, last] = [band_hz.start(), band_hz.end()].map(|hz| hz / 1e6);
            format!("no channel of the hopping sequence lies between {first} and {last} MHz")
        };
        warnings.push(format!(
            "{path}.phy.effect[{index}] ({}) has no influence: {why}",
            effect.name()
        ));
    }
}

/// A problem with a slot of a network that is too short for the longest frame and its acknowledgment.
pub(super) fn check_slot(entry: &Entry, slot_ns: u64, step_ns: u64, path: &str) -> Option<Problem> {
    let least_ns = entry.standard.airtime.least_slot_ns();
    if least_ns <= slot_ns {
        return None;
    }
    let message = format!(
        "must be at least {} s with mode = {MODE_6TISCH:?}, the duration of the longest frame and its acknowledgment",
        seconds(least_ns)
    );
    let mut problem = Problem::new(path, message).value(seconds(slot_ns));
    let nearest_ns = if least_ns <= STANDARD_SLOT_NS {
        Some(STANDARD_SLOT_NS)
    } else {
        shortest_slot_ns(least_ns, step_ns)
    };
    problem.nearest = nearest_ns.map(|ns| seconds(ns).to_string());
    Some(problem)
}

/// The shortest slot (ns) of at least `least_ns` that divides a control period, if there is one.
fn shortest_slot_ns(least_ns: u64, step_ns: u64) -> Option<u64> {
    let most = step_ns / least_ns;
    // A search that takes no time; so many slots to a period are beyond any schedule.
    (1..=most.min(1 << 20)).rev().find(|&n| step_ns.is_multiple_of(n)).map(|n| step_ns / n)
}
