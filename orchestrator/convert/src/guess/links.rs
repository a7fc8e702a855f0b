//! Logs of radio links.

use super::places::{self, Place, Side};
use super::profile::Profile;
use super::readings;
use super::times::{self, Rate, quoted};
use super::words::{self, RX, RX_DEVICE, TX, TX_DEVICE};
use super::write::model_of_links;
use super::{Asked, Draft, DraftInput, Log};
use crate::tables::TableKind;

/// What a table of links can be made of.
///
/// # Errors
///
/// What is lacking; empty if the logs have nothing of links.
pub(super) fn draft(logs: &[Log], asked: &mut Asked<'_>) -> Result<Draft, String> {
    if let Some(at) = logs.iter().position(|log| log.is_made_of("k7")) {
        return Ok(k7(at));
    }
    let best = |score: &dyn Fn(&Profile) -> i32| {
        let found = logs.iter().enumerate().filter_map(|(at, log)| {
            let column = log.best(score)?;
            Some((score(log.profile(column)), at, column))
        });
        found
            .max_by_key(|(score, at, _)| (*score, usize::MAX - at))
            .map(|(_, at, column)| (at, column))
    };
    let melted = logs.iter().enumerate().find_map(|(at, log)| {
        log.melted.as_ref()?;
        Some((at, log.sample.place(super::MELTED_VALUE)?))
    });
    let found =
        melted.or_else(|| best(&readings::score)).or_else(|| best(&readings::score_of_values));
    let Some((at, rssi)) = found else { return Err(lacking(logs)) };
    let log = &logs[at];
    let mut draft = Draft {
        table: TableKind::Links,
        inputs: vec![DraftInput::new(at)],
        top: Vec::new(),
        findings: Vec::new(),
        unknown: Vec::new(),
        model: String::new(),
    };
    let mut used = vec![rssi];

    // Who sent, who received.
    let fits_end = |profile: &Profile| !profile.has(words::COMMAND);
    let tx = log.best(|p| if fits_end(p) { words::end(p, TX, TX_DEVICE, RX) } else { 0 });
    let rx = log.best(|p| {
        let score = if fits_end(p) { words::end(p, RX, RX_DEVICE, TX) } else { 0 };
        if tx.is_some_and(|tx| log.profile(tx).name == p.name) { 0 } else { score }
    });
    let melted = log.sample.place(super::MELTED_NAME).filter(|_| log.melted.is_some());
    let (tx, rx) = ends(log, tx, rx, melted, asked);
    for (end, column, constant) in [("tx", tx, 1), ("rx", rx, 0)] {
        match column {
            Some(column) => {
                used.push(column);
                let profile = log.profile(column);
                let n = profile.n_distinct;
                let what = if n == 1 { "one node".to_owned() } else { format!("{n} nodes") };
                let reason = format!("{what}, such as {}", profile.example);
                draft.inputs[0].add(end, quoted(&profile.name), reason);
            }
            None => {
                let other = if end == "tx" { rx } else { tx };
                let number =
                    other.map_or(constant, |other| free_number(log.profile(other), constant));
                let who = if end == "tx" { "sender" } else { "receiver" };
                draft.inputs[0].add(
                    end,
                    number.to_string(),
                    format!("no column names the {who}: one, number {number}"),
                );
            }
        }
    }

    let is_free =
        |profile: &Profile| used.iter().all(|&column| log.profile(column).name != profile.name);
    match times::fill(log, &mut draft.inputs[0], "time_s", Rate::Any, asked, is_free) {
        Some(columns) => used.extend(columns),
        None => {
            draft.inputs[0].add("time_s", "0", "no column of times: all rows have one");
            draft
                .findings
                .push("there are no times, so effects over time cannot be tested".to_owned());
        }
    }

    let readings = readings::readings(log, rssi);
    draft.findings.extend(readings.findings);
    draft.inputs[0].add("rssi_dbm", readings.source, readings.reason);
    reception(log, &mut draft, &mut used, readings.n_missing);
    frame_columns(log, &mut draft, &mut used, tx, rx);
    let has_places = positions(logs, at, &mut draft, &mut used, [tx, rx], asked);
    if !has_places {
        label_of_files(log, &mut draft, &mut used, asked);
    }
    let has_places = draft.inputs.iter().any(|input| {
        ["tx_x_m", "rx_x_m", "x_m", "latitude_deg"].iter().any(|name| input.has(name))
    });
    let has_times =
        !draft.inputs[0].columns.iter().any(|(name, source, _)| name == "time_s" && source == "0");
    if !has_places && !has_times && log.names.len() == 1 {
        return Err("there is RSSI, but neither a time nor a position or distance: a model has nothing to predict it from".to_owned());
    }
    if !has_places {
        draft.unknown.push(
            "Positions: the log has none. Add tx_x_m, tx_y_m, rx_x_m, rx_y_m (m), or a second [[input]] with node, x_m, y_m; without \
             them only noise, offsets and changes over time can be tested."
                .to_owned(),
        );
    }
    covariates(log, &mut draft, &used);
    draft.model = model_of_links(log, &mut draft.findings);
    Ok(draft)
}

fn k7(at: usize) -> Draft {
    let mut input = DraftInput::new(at);
    input.keys.push(("format".to_owned(), quoted("k7")));
    Draft {
        table: TableKind::Links,
        inputs: vec![input],
        top: Vec::new(),
        findings: vec![
            "check, compare and diagnose read this K7 trace as it is; the table is for other programs".to_owned(),
        ],
        unknown: vec!["Positions: a K7 trace has none. Add a second [[input]] with node, x_m, y_m.".to_owned()],
        model: super::write::plain_model_of_links(),
    }
}

/// What a table of links lacks.
fn lacking(logs: &[Log]) -> String {
    let has_ratio =
        logs.iter().flat_map(|log| &log.profiles).any(|profile| profile.has(&["pdr", "prr"]));
    if has_ratio {
        "links need RSSI readings (dBm): a delivery ratio alone is not enough".to_owned()
    } else {
        "links need a column of RSSI (dBm, about -120 to -20), a sender and a receiver".to_owned()
    }
}

/// Sender and receiver, of several candidates as the answer says.
fn ends(
    log: &Log,
    tx: Option<usize>,
    rx: Option<usize>,
    melted: Option<usize>,
    asked: &mut Asked<'_>,
) -> (Option<usize>, Option<usize>) {
    if let Some(column) = melted {
        let text =
            "Each of the columns of readings is of another node. Did these nodes send or receive?"
                .to_owned();
        let choices = [
            ("sent", "they are senders, such as beacons or access points"),
            ("received", "they are receivers"),
        ];
        let is_receiver = rx.is_none() && tx.is_some();
        let word = asked.ask("columns-of-readings", text, &choices, usize::from(is_receiver));
        return if word == "sent" { (Some(column), rx.or(tx)) } else { (tx.or(rx), Some(column)) };
    }
    if tx.is_some() || rx.is_some() {
        return (tx, rx);
    }
    // Two columns of few whole numbers or names, of which nothing says which is which.
    let is_label = |profile: &&Profile| {
        profile.is_label() && 1 < profile.n_distinct && words::end(profile, &[], &[], &[]) == 0
    };
    let is_possible = |profile: &&Profile| {
        is_label(profile)
            && (profile.n_numbers == 0 || profile.range[2] < 1e6)
            && profile.has(&["id", "column", "name", "peer", "neighbor", "neighbour"])
    };
    let labels: Vec<usize> = log
        .profiles
        .iter()
        .enumerate()
        .filter(|(_, profile)| is_possible(profile))
        .map(|(at, _)| at)
        .collect();
    match labels[..] {
        [one] => {
            let text = format!("Is {} the sender or the receiver?", log.profile(one).name);
            let choices = [
                ("sender", "the node that sent the frame"),
                ("receiver", "the node that measured the RSSI"),
            ];
            let word = asked.ask("node", text, &choices, 0);
            if word == "sender" { (Some(one), None) } else { (None, Some(one)) }
        }
        [a, b, ..] => {
            let text = format!(
                "Which of {} and {} is the sender?",
                log.profile(a).name,
                log.profile(b).name
            );
            let choices = [("first", &*log.profile(a).name), ("second", &*log.profile(b).name)];
            let word = asked.ask("sender", text, &choices, 0);
            if word == "first" { (Some(a), Some(b)) } else { (Some(b), Some(a)) }
        }
        [] => (None, None),
    }
}

/// A number that no node of a column has.
fn free_number(profile: &Profile, preferred: i64) -> i64 {
    let is_taken = profile.n_numbers == profile.n
        && (profile.range[0]..=profile.range[2]).contains(&(preferred as f64));
    if is_taken { profile.range[2] as i64 + 1 } else { preferred }
}

/// Whether frames were received, and how many were sent.
fn reception(log: &Log, draft: &mut Draft, used: &mut Vec<usize>, n_missing: usize) {
    let input = &mut draft.inputs[0];
    let is_truth = |profile: &Profile| {
        profile.is_numeric()
            && profile.is_whole
            && 0.0 <= profile.range[0]
            && profile.range[2] <= 1.0
    };
    let lost =
        log.best(|p| i32::from(is_truth(p) && p.has(&["lost", "loss", "dropped", "missed"])));
    let received = log.best(|p| {
        i32::from(
            is_truth(p)
                && p.has(&["received", "success", "acked", "ack", "delivered", "ok", "crc"]),
        )
    });
    let ratio = log.best(|p| {
        let is_share = p.is_numeric() && 0.0 <= p.range[0] && p.range[2] <= 100.0;
        i32::from(
            is_share
                && (p.has(&["pdr", "prr"])
                    || p.has(&["delivery", "reception"]) && p.has(&["ratio", "rate"])),
        )
    });
    let count = log.best(|p| {
        let is_count = p.is_numeric() && p.is_whole && 1.0 <= p.range[0];
        let is_sent = p.has(&["tx", "sent", "frames", "packets", "transmitted"])
            && p.has(&["count", "n", "num", "frames", "packets", "sent"]);
        i32::from(is_count && is_sent)
    });
    if let Some(ratio) = ratio {
        let profile = log.profile(ratio);
        used.push(ratio);
        let is_percent = 1.0 < profile.range[2] && profile.unit.is_none();
        let source = if is_percent {
            format!("{{ column = {}, unit = \"percent\" }}", quoted(&profile.name))
        } else {
            quoted(&profile.name)
        };
        input.add(
            "pdr",
            source,
            format!("shares from {} to {}", profile.range[0], profile.range[2]),
        );
        if let Some(count) = count {
            used.push(count);
            input.add("frames", quoted(&log.profile(count).name), "frames that were sent");
        } else {
            let scale = if is_percent { 100.0 } else { 1.0 };
            let frames = frames_of(&log.sample.numbers(ratio), scale);
            let reason = frames.map_or_else(
                || "unknown: 100 frames for each row".to_owned(),
                |n| format!("all shares are multiples of 1/{n}"),
            );
            if frames.is_none() {
                draft
                    .unknown
                    .push("frames: of how many frames each share is. 100 was taken.".to_owned());
            }
            input.add("frames", frames.unwrap_or(100).to_string(), reason);
        }
        return;
    }
    if let Some(received) = received {
        used.push(received);
        input.add("received", quoted(&log.profile(received).name), "1 or 0");
        draft.top.push(("losses".to_owned(), quoted("logged")));
    } else if let Some(lost) = lost {
        used.push(lost);
        let name = quoted(&log.profile(lost).name);
        input.add("received", format!("{{ column = {name}, scale = -1, offset = 1 }}"), "1 − lost");
        draft.top.push(("losses".to_owned(), quoted("logged")));
    } else {
        input.add("received", "1", "no column says so: every row is a frame that was received");
        let missing = if 0 < n_missing { " Rows without a reading are left out." } else { "" };
        draft.unknown.push(format!(
            "losses: whether frames that were lost would have a row. Write losses = \"not-logged\" at the top if only received frames were \
             logged, or losses = \"logged\" if all were.{missing}"
        ));
    }
}

/// The least number of frames of which all shares are multiples.
fn frames_of(shares: &[f64], scale: f64) -> Option<u32> {
    let known: Vec<f64> = shares
        .iter()
        .copied()
        .filter(|share| share.is_finite())
        .map(|share| share / scale)
        .collect();
    let fits = |n: &u32| {
        known.iter().all(|share| {
            let product = share * f64::from(*n);
            (product - product.round()).abs() < 2e-3
        })
    };
    (2..=1000).find(fits).filter(|_| 10 <= known.len())
}

/// Channel, sequence number and headings.
fn frame_columns(
    log: &Log,
    draft: &mut Draft,
    used: &mut Vec<usize>,
    tx: Option<usize>,
    rx: Option<usize>,
) {
    let channel = log.best(|p| {
        let is_ieee = p.is_numeric() && p.is_whole && 11.0 <= p.range[0] && p.range[2] <= 26.0;
        i32::from(is_ieee && p.has(&["channel", "ch", "chan"]))
    });
    if let Some(channel) = channel {
        used.push(channel);
        draft.inputs[0].add(
            "channel",
            quoted(&log.profile(channel).name),
            "IEEE 802.15.4, 11 to 26",
        );
    }
    let sequence = log.best(|p| {
        let is_count = p.is_numeric() && p.is_whole && 0.0 <= p.range[0] && 3 < p.n_distinct;
        i32::from(is_count && p.has(&["seq", "sequence", "seqno", "counter", "fcnt", "fcntup"]))
    });
    let has_losses = draft.top.iter().any(|(key, _)| key == "losses") || draft.inputs[0].has("pdr");
    if let Some(sequence) = sequence {
        used.push(sequence);
        match counts(log, sequence, tx, rx) {
            Ok(()) if !has_losses => {
                draft.inputs[0].add(
                    "sequence",
                    quoted(&log.profile(sequence).name),
                    "counts the frames of each sender: lost frames are added",
                );
                draft.unknown.retain(|text| !text.starts_with("losses"));
            }
            Ok(()) => {}
            Err(why) => {
                draft.findings.push(format!(
                    "{} is not used to find lost frames: {why}",
                    log.profile(sequence).name
                ));
            }
        }
    }
}

/// Whether numbers count the frames of each sender, as a receiver gets them.
fn counts(log: &Log, column: usize, tx: Option<usize>, rx: Option<usize>) -> Result<(), String> {
    let numbers = log.sample.numbers(column);
    let known: Vec<f64> = numbers.iter().copied().filter(|number| number.is_finite()).collect();
    let by_one = known.windows(2).filter(|pair| pair[1] - pair[0] == 1.0).count();
    let n_senders = tx.map_or(1, |tx| log.profile(tx).n_distinct);
    let n_receivers = rx.map_or(1, |rx| log.profile(rx).n_distinct);
    if 1 < n_senders && 20 * by_one >= 19 * known.len().saturating_sub(1) {
        return Err("it numbers the rows of all senders".to_owned());
    }
    let label = |row: usize, end: Option<usize>| end.map_or("", |end| log.sample.field(row, end));
    let mut last: std::collections::BTreeMap<(usize, &str, &str), f64> = Default::default();
    let (mut n_steps, mut n_small) = (0_usize, 0_usize);
    for row in 0..numbers.len() {
        let key = (log.sample.files[row], label(row, tx), label(row, rx));
        if let Some(before) = last.insert(key, numbers[row]) {
            let step = numbers[row] - before;
            n_steps += 1;
            n_small += usize::from((1.0..=16.0).contains(&step));
        }
    }
    if n_steps < 10 || 2 * n_small < n_steps {
        return Err(
            "it does not count up by small steps from frame to frame of a sender".to_owned()
        );
    }
    if 1 < n_receivers && 1 < n_senders {
        // Frames for one receiver each would be taken for lost by all others.
        let mut receivers: std::collections::BTreeMap<
            (&str, u64),
            std::collections::BTreeSet<&str>,
        > = Default::default();
        for row in 0..numbers.len() {
            let key = (label(row, tx), numbers[row].to_bits());
            receivers.entry(key).or_default().insert(label(row, rx));
        }
        let shared = receivers.values().filter(|set| 1 < set.len()).count();
        if 10 * shared < receivers.len() {
            return Err(
                "no two receivers logged the same frame, so each frame may be for one of them"
                    .to_owned(),
            );
        }
    }
    Ok(())
}

/// Fills positions, and returns whether there are any.
fn positions(
    logs: &[Log],
    at: usize,
    draft: &mut Draft,
    used: &mut Vec<usize>,
    labels: [Option<usize>; 2],
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
        found = distance(log, draft, used);
    }
    // Other files may have the places of nodes.
    for (other, log) in logs.iter().enumerate().filter(|(other, _)| *other != at) {
        found |= of_nodes(log, other, draft, asked);
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
pub(super) fn geographic(profile: &Profile) -> String {
    let greatest = profile.range[0].abs().max(profile.range[2].abs());
    if 180.0 < greatest && greatest <= 1.8e9 {
        format!("{{ column = {}, scale = 1e-7 }}", quoted(&profile.name))
    } else {
        quoted(&profile.name)
    }
}

/// A distance in place of positions.
fn distance(log: &Log, draft: &mut Draft, used: &mut Vec<usize>) -> bool {
    let column = log.best(|p| {
        let is_distance = p.is_numeric()
            && 0.0 <= p.range[0]
            && p.has(&["distance", "dist", "distancia", "entfernung"]);
        i32::from(is_distance)
    });
    let Some(column) = column else { return false };
    let profile = log.profile(column);
    used.push(column);
    let unit = places::named(profile).map_or("m", |unit| unit.name);
    let reason = format!("a distance in {unit}: the receiver is put at x = 0");
    draft.inputs[0].add("tx_x_m", places::source(profile, unit), reason);
    for (name, number) in [("tx_y_m", "0"), ("rx_x_m", "0"), ("rx_y_m", "0")] {
        draft.inputs[0].add(name, number, "");
    }
    true
}

/// A further file with the places of nodes, whether they stand or move.
fn of_nodes(log: &Log, at: usize, draft: &mut Draft, asked: &mut Asked<'_>) -> bool {
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
        Some(node) => input.add("node", quoted(&log.profile(node).name), "whose place it is"),
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
fn label_of_files(log: &Log, draft: &mut Draft, used: &mut Vec<usize>, asked: &mut Asked<'_>) {
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
    let beside = log.files.split("{label}").nth(1).unwrap_or_default().to_lowercase();
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

/// What was measured beside, by names that say what it is.
pub(super) fn covariates(log: &Log, draft: &mut Draft, used: &[usize]) {
    const KNOWN: [(&str, &[&str]); 6] = [
        ("temperature_c", &["temperature", "temp"]),
        ("humidity_percent", &["humidity", "rh"]),
        ("battery_v", &["battery", "vbat", "voltage"]),
        ("pressure_hpa", &["pressure", "baro"]),
        ("wind_mps", &["wind"]),
        ("rain_mmph", &["rain"]),
    ];
    for (name, words) in KNOWN {
        let column = log.best(|p| {
            let is_free = used.iter().all(|&column| log.profile(column).name != p.name);
            i32::from(is_free && p.is_numeric() && !p.is_constant() && p.has(words))
        });
        if let Some(column) = column {
            let name_of = quoted(&log.profile(column).name);
            draft.inputs[0].covariates.push((
                name.to_owned(),
                name_of,
                "measured beside".to_owned(),
            ));
        }
    }
}
