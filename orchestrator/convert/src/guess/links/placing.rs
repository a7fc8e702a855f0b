//! Where the nodes of a log of links stand.

use super::super::places::{self, Place, Side};
use super::super::profile::Profile;
use super::super::times::{self, Rate, quoted};
use super::super::words::{RX, RX_DEVICE, TX, TX_DEVICE};
use super::super::{Asked, Draft, DraftInput, Log};
use std::collections::BTreeSet;

/// Fills positions, and returns whether there are any.
pub(super) fn positions(
    logs: &[Log],
    at: usize,
    draft: &mut Draft,
    used: &mut Vec<usize>,
    labels: [Option<usize>; 2],
    rssi: usize,
    asked: &mut Asked<'_>,
) -> bool {
    let log = &logs[at];
    let is_tx = |p: &Profile| places::is_of(log, p, TX, "1", labels[0]);
    let is_rx = |p: &Profile| places::is_of(log, p, RX, "2", labels[1]) || p.has(RX_DEVICE);
    let tx = places::find(log, |p| is_tx(p) && !is_rx(p));
    let rx = places::find(log, |p| is_rx(p) && !is_tx(p));
    let plain = places::find(log, |p| !is_tx(p) && !is_rx(p));
    let mut found = false;
    if let (Some(tx), Some(rx)) = (&tx, &rx)
        && !tx.is_geographic
        && !rx.is_geographic
    {
        both_ends(log, draft, [tx, rx], labels, asked);
        used.extend(tx.columns().chain(rx.columns()));
        found = true;
    } else {
        for (place, side) in [(&tx, Side::Tx), (&rx, Side::Rx)] {
            if let Some(place) = place {
                one_end(log, at, draft, place, side, labels, asked);
                used.extend(place.columns());
                found = true;
            }
        }
        if let Some(place) = plain.filter(|_| tx.is_none() || rx.is_none()) {
            let side = match (&tx, &rx) {
                (Some(_), None) => Side::Rx,
                (None, Some(_)) => Side::Tx,
                _ => whose(log, &place, labels, asked),
            };
            one_end(log, at, draft, &place, side, labels, asked);
            used.extend(place.columns());
            found = true;
        }
    }
    if !found {
        found = distance(log, draft, used, rssi, asked);
    }
    // Other files may have the places of nodes.
    for (other, log) in logs.iter().enumerate().filter(|(other, _)| *other != at) {
        let names: BTreeSet<&str> = labels
            .iter()
            .flatten()
            .flat_map(|&label| {
                (0..logs[at].sample.rows.len()).map(move |row| logs[at].sample.field(row, label))
            })
            .collect();
        if of_nodes(log, other, &names, draft, asked) {
            found = true;
        } else {
            draft
                .findings
                .push(format!("{} is not used: it has no places of these nodes", log.files));
        }
    }
    found
}

/// Positions of both ends in the rows themselves.
fn both_ends(
    log: &Log,
    draft: &mut Draft,
    places: [&Place; 2],
    labels: [Option<usize>; 2],
    asked: &mut Asked<'_>,
) {
    let stated =
        places.map(|place| place.columns().find_map(|column| places::named(log.profile(column))));
    let mut units = ["m", "m"];
    let mut reasons = ["metres".to_owned(), "metres".to_owned()];
    for end in 0..2 {
        let Some(unit) = stated[end] else { continue };
        units[end] = unit.name;
        reasons[end] = format!("the name says {}", unit.name);
    }
    let both = labels[0].zip(labels[1]);
    for end in 0..2 {
        if stated[end].is_some() {
            continue;
        }
        // Nodes that both send and receive show the unit of the other end.
        let other = 1 - end;
        let shown = both.and_then(|(tx, rx)| {
            let label = [tx, rx];
            let known = places::nodes(log, label[other], places[other], units[other]);
            places::scale(&known, &places::nodes(log, label[end], places[end], "m"))
        });
        match shown {
            Some(1.0) if stated[other].is_some() => {
                reasons[end] =
                    "metres: the same nodes stand at the same places at the other end".to_owned();
            }
            Some(factor) if stated[other].is_some() => {
                units[end] = if factor == 0.01 { "cm" } else { "mm" };
                reasons[end] =
                    format!("{} by the places of the same nodes at the other end", units[end]);
            }
            _ => {
                let (unit, reason) = places::unit(log, places[end], asked, "unit-of-positions");
                units[end] = unit;
                reasons[end] =
                    reason.unwrap_or_else(|| format!("{unit}, as no name says otherwise"));
            }
        }
    }
    let mut order = [0, 1];
    if let Some((tx, rx)) = both
        && let Some((n_swapped, n_told, first)) = places::swapped(log, [tx, rx], places, units)
    {
        if 2 * n_swapped > n_told {
            order = [1, 0];
            draft.findings.push("positions of sender and receiver are the other way round than their names: swapped".to_owned());
        } else {
            draft.findings.push(format!(
                "{n_swapped} of {n_told} rows have the ends swapped: each node stands where the other one does (the first is row {first})"
            ));
        }
    }
    for (end, prefix) in ["tx_", "rx_"].into_iter().enumerate() {
        let own = order[end];
        places::add(log, &mut draft.inputs[0], places[own], prefix, units[own], &reasons[own]);
        if let Some(label) = labels[own] {
            for column in places[own].columns() {
                let name = &log.profile(column).name;
                if let Some((n, first, factor)) = places::mixed_units(log, label, column) {
                    draft.findings.push(format!(
                        "{name} mixes units: {n} rows are {factor} times the usual place of their node (the first is row {first})"
                    ));
                }
            }
        }
    }
}

/// Which end a position without a telling name is of.
fn whose(log: &Log, place: &Place, labels: [Option<usize>; 2], asked: &mut Asked<'_>) -> Side {
    let names: Vec<&str> = place.columns().map(|column| &*log.profile(column).name).collect();
    let is_one =
        |label: Option<usize>| label.is_none_or(|label| log.profile(label).n_distinct == 1);
    let is_fixed_sender = labels[0].is_some_and(|label| {
        log.profile(label).has(&["ap", "bssid", "ssid", "beacon", "anchor", "mac"])
            || log.melted.is_some()
    });
    let likely =
        usize::from(is_fixed_sender && !log.profile(labels[0].unwrap_or(0)).has(&["device"]));
    let text = format!("Is {} the place of the sender or of the receiver?", names.join(", "));
    let choices =
        [("sender", "the node that sent"), ("receiver", "the node that measured the RSSI")];
    if is_one(labels[0]) && is_one(labels[1]) {
        // One moves, one stands: by reciprocity of the path either will do.
        return Side::Tx;
    }
    let word = asked.ask("place-of", text, &choices, likely);
    if word == "sender" { Side::Tx } else { Side::Rx }
}

/// Positions of one end. Geographic ones are an input of their own, joined by node and time.
fn one_end(
    log: &Log,
    at: usize,
    draft: &mut Draft,
    place: &Place,
    side: Side,
    labels: [Option<usize>; 2],
    asked: &mut Asked<'_>,
) {
    let (end, prefix) = if side == Side::Tx { (0, "tx_") } else { (1, "rx_") };
    let who = if side == Side::Tx { "sender" } else { "receiver" };
    if place.is_geographic {
        let mut input = DraftInput::new(at);
        let main = &draft.inputs[0];
        let own = |name: &str| {
            main.columns
                .iter()
                .find(|(known, _, _)| known == name)
                .map(|(_, source, _)| source.clone())
        };
        if let Some(time) = own("time_s").filter(|source| source != "0") {
            input.add("time_s", time, "as above");
            input.keys.push(("join".to_owned(), quoted("nearest")));
        }
        if let Some(node) = own(if end == 0 { "tx" } else { "rx" }) {
            input.add("node", node, format!("the {who}"));
        }
        let columns: Vec<usize> = place.columns().collect();
        for (name, column) in ["latitude_deg", "longitude_deg"].into_iter().zip(columns) {
            let profile = log.profile(column);
            let source = geographic(profile);
            input.add(name, source, format!("the {who}'s place, degrees"));
        }
        draft.inputs.push(input);
    } else {
        let (unit, reason) = places::unit(log, place, asked, "unit-of-positions");
        let reason = reason.unwrap_or_else(|| format!("the {who}'s place, {unit}"));
        places::add(log, &mut draft.inputs[0], place, prefix, unit, &reason);
    }
    if labels[1 - end].is_none() {
        let other = if end == 0 { "rx" } else { "tx" };
        if !place.is_geographic && !draft.inputs[0].has(&format!("{other}_x_m")) {
            draft.unknown.push(format!(
                "{other}_x_m, {other}_y_m: where the {} stands. Add them to the columns, as numbers (m).",
                if end == 0 { "receiver" } else { "sender" }
            ));
        }
    }
}

/// Degrees, also where they are multiplied by ten million as receivers of satellites write them.
pub(in super::super) fn geographic(profile: &Profile) -> String {
    let greatest = profile.range[0].abs().max(profile.range[2].abs());
    if 180.0 < greatest && greatest <= 1.8e9 {
        format!("{{ column = {}, scale = 1e-7 }}", quoted(&profile.name))
    } else {
        quoted(&profile.name)
    }
}

/// A distance in place of positions.
fn distance(
    log: &Log,
    draft: &mut Draft,
    used: &mut Vec<usize>,
    rssi: usize,
    asked: &mut Asked<'_>,
) -> bool {
    let column = log.best(|p| {
        if !p.is_numeric()
            || p.range[0] < 0.0
            || p.has(&["estimated", "measured", "error", "err", "bias"])
        {
            return 0;
        }
        let is_true = p.has(&["true", "real", "actual", "gt", "truth"]);
        if p.has(&["distance", "dist", "distancia", "entfernung"]) {
            2 + i32::from(is_true)
        } else {
            2 * i32::from(is_true && p.has(&["range", "rng"]))
        }
    });
    let Some(column) = column else { return false };
    let profile = log.profile(column);
    used.push(column);
    let unit = match places::named(profile) {
        Some(unit) => unit.name,
        None => {
            let readings: Vec<f64> =
                log.sample.numbers(rssi).iter().map(|level| -level.abs()).collect();
            let likely = places::unit_by_readings(&log.sample.numbers(column), &readings);
            if likely == "m" {
                "m"
            } else {
                let text = format!(
                    "In which unit is {} ({} to {})? In metres the readings would be stronger than in free space.",
                    profile.name, profile.range[0], profile.range[2]
                );
                let choices = [("m", "metres"), ("cm", "centimetres"), ("mm", "millimetres")];
                let at = choices.iter().position(|(unit, _)| *unit == likely).unwrap_or(0);
                let word = asked.ask("unit-of-distance", text, &choices, at);
                choices.iter().find(|(unit, _)| *unit == word).map_or("m", |(unit, _)| unit)
            }
        }
    };
    let reason = format!("a distance in {unit}: the receiver is put at x = 0");
    draft.inputs[0].add("tx_x_m", places::source(profile, unit), reason);
    for (name, number) in [("tx_y_m", "0"), ("rx_x_m", "0"), ("rx_y_m", "0")] {
        draft.inputs[0].add(name, number, "");
    }
    true
}

/// A further file with the places of nodes, whether they stand or move.
///
/// * `names`: of the nodes of the links, if the log names them.
fn of_nodes(
    log: &Log,
    at: usize,
    names: &BTreeSet<&str>,
    draft: &mut Draft,
    asked: &mut Asked<'_>,
) -> bool {
    let Some(place) = places::find(log, |_| true) else { return false };
    let is_place = |p: &Profile| place.columns().any(|column| log.profile(column).name == p.name);
    let node = log.best(|p| {
        let is_name = !is_place(p)
            && !p.has(&["time", "timestamp"])
            && (p.n_numbers < p.n || p.is_whole && 0.0 <= p.range[0]);
        let is_node = p.has(TX_DEVICE)
            || p.has(RX_DEVICE)
            || p.has(TX)
            || p.has(RX)
            || p.has(&["id", "name"]);
        if is_name && is_node { 2 + i32::from(p.has(&["node", "mote", "id", "name"])) } else { 0 }
    });
    let mut input = DraftInput::new(at);
    let taken = |p: &Profile| !is_place(p);
    let columns = times::fill(log, &mut input, "time_s", Rate::Any, asked, taken);
    match node {
        Some(node) => {
            let is_known = |row: usize| names.contains(log.sample.field(row, node));
            if !names.is_empty() && !(0..log.sample.rows.len()).any(is_known) {
                return false;
            }
            input.add("node", quoted(&log.profile(node).name), "whose place it is");
        }
        None if columns.is_some() => {
            let text = format!("Whose places does {} have?", log.files);
            let word = asked.ask(
                "places-of",
                text,
                &[("sender", "the sender's"), ("receiver", "the receiver's")],
                0,
            );
            let end = if word == "sender" { "tx" } else { "rx" };
            let main = &draft.inputs[0].columns;
            let source = main
                .iter()
                .find(|(name, _, _)| name == end)
                .map_or("1".to_owned(), |(_, source, _)| source.clone());
            input.add("node", source, format!("the {word}"));
        }
        None => return false,
    }
    if columns.is_some() {
        input.keys.push(("join".to_owned(), quoted("interpolated")));
        input.keys.push(("within_s".to_owned(), "60".to_owned()));
    }
    if place.is_geographic {
        for (name, column) in ["latitude_deg", "longitude_deg"].into_iter().zip(place.columns()) {
            input.add(name, geographic(log.profile(column)), "degrees");
        }
    } else {
        let (unit, reason) = places::unit(log, &place, asked, "unit-of-places");
        places::add(log, &mut input, &place, "", unit, &reason.unwrap_or_else(|| unit.to_owned()));
    }
    draft.inputs.push(input);
    true
}

/// Asks what the text in the names of files means.
pub(super) fn label_of_files(
    log: &Log,
    draft: &mut Draft,
    used: &mut Vec<usize>,
    asked: &mut Asked<'_>,
) {
    let Some(label) = log.sample.place("label").filter(|_| 1 < log.names.len()) else { return };
    let profile = log.profile(label);
    used.push(label);
    let is_number = profile.n_numbers == profile.n;
    let text = format!(
        "The names of the files differ by {} (in {}). What is it?",
        profile.example, log.files
    );
    let choices = [
        ("distance-m", "the distance in metres"),
        ("distance-cm", "the distance in centimetres"),
        ("name", "the name of a campaign"),
    ];
    let beside = log.files.split('}').nth(1).unwrap_or_default().to_lowercase();
    let likely = match () {
        () if !is_number => 2,
        () if beside.starts_with("cm") => 1,
        () => 0,
    };
    let word = asked.ask("label-of-files", text, &choices, likely);
    if word == "name" || !is_number {
        return;
    }
    let unit = if word == "distance-cm" { "cm" } else { "m" };
    draft.inputs[0].add(
        "tx_x_m",
        places::source(profile, unit),
        "the distance in the name of the file",
    );
    for name in ["tx_y_m", "rx_x_m", "rx_y_m"] {
        draft.inputs[0].add(name, "0", "");
    }
}
