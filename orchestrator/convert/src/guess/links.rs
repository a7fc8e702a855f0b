//! Logs of radio links.

mod placing;

use super::places;
use super::profile::Profile;
use super::readings;
use super::times::{self, Rate, quoted};
use super::words::{self, RX, RX_DEVICE, TX, TX_DEVICE};
use super::write::model_of_links;
use super::{Asked, Draft, DraftInput, Log};
use crate::tables::TableKind;
pub(super) use placing::geographic;
use placing::{label_of_files, positions};
use std::collections::{BTreeMap, BTreeSet};

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
            // Of several files, the one that says who sent and who received, and where.
            let has_ends = log
                .profiles
                .iter()
                .any(|p| words::end(p, TX, TX_DEVICE, RX) + words::end(p, RX, RX_DEVICE, TX) > 0);
            let has_places = places::find(log, |p| {
                p.has(TX) || p.has(RX) || p.has(RX_DEVICE) || p.has(TX_DEVICE)
            });
            let bonus = 3 * i32::from(has_ends) + 2 * i32::from(has_places.is_some());
            Some((score(log.profile(column)) + bonus, at, column))
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
    let (mut tx, mut rx) = ends(log, tx, rx, melted, asked);
    // Nobody hears its own frames: such columns name something else, as kinds of radios.
    if let Some((a, b)) = tx.zip(rx) {
        let is_own = |&row: &usize| log.sample.field(row, a) == log.sample.field(row, b);
        let n_own = (0..log.sample.rows.len()).filter(is_own).count();
        if 5 * n_own > log.sample.rows.len() {
            draft.findings.push(format!(
                "{} and {} are equal in {n_own} rows, so they do not name sender and receiver",
                log.profile(a).name,
                log.profile(b).name
            ));
            (tx, rx) = (None, None);
        }
    }
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
    let has_places = positions(logs, at, &mut draft, &mut used, [tx, rx], rssi, asked);
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
    // Where all are received, lost frames may be without a row.
    let has_losses = |column: &usize| log.profile(*column).range[0] < log.profile(*column).range[2];
    if let Some(received) = received.filter(has_losses) {
        used.push(received);
        input.add("received", quoted(&log.profile(received).name), "1 or 0");
        draft.top.push(("losses".to_owned(), quoted("logged")));
    } else if let Some(lost) = lost.filter(has_losses) {
        used.push(lost);
        let name = quoted(&log.profile(lost).name);
        input.add("received", format!("{{ column = {name}, scale = -1, offset = 1 }}"), "1 − lost");
        draft.top.push(("losses".to_owned(), quoted("logged")));
    } else {
        // A column that is 1 throughout the rows looked at may be 0 further on.
        match received.filter(|column| log.profile(*column).range[0] == 1.0) {
            Some(column) => {
                used.push(column);
                input.add(
                    "received",
                    quoted(&log.profile(column).name),
                    "1 in every row looked at",
                );
            }
            None => input.add(
                "received",
                "1",
                "no column says so: every row is a frame that was received",
            ),
        }
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
    let mut last: BTreeMap<(usize, &str, &str), f64> = BTreeMap::new();
    let (mut n_steps, mut n_small) = (0_usize, 0_usize);
    for (row, &number) in numbers.iter().enumerate() {
        let key = (log.sample.files[row], label(row, tx), label(row, rx));
        if let Some(before) = last.insert(key, number) {
            let step = number - before;
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
        let mut receivers: BTreeMap<(&str, u64), BTreeSet<&str>> = BTreeMap::new();
        for (row, number) in numbers.iter().enumerate() {
            let key = (label(row, tx), number.to_bits());
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

/// What was measured beside, by names that say what it is.
pub(super) fn covariates(log: &Log, draft: &mut Draft, used: &[usize]) {
    for (name, words) in words::COVARIATES {
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
