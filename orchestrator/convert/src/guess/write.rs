//! The mapping file and the first model, as text.

use super::times::quoted;
use super::{Draft, Guess, Guessed, Log, Question};
use crate::formats::BUILT_IN;
use crate::tables::{COLUMNS, TableKind};
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// What a line is marked by that a user must check.
pub const CHECK: &str = "CHECK";

/// A guess as text.
pub(super) fn guess(logs: &[Log], draft: Draft, questions: Vec<Question>) -> Guess {
    let mut findings: Vec<String> = draft.findings.clone();
    for log in logs {
        if let (1.., Some(first)) = (log.sample.broken.0, &log.sample.broken.1) {
            findings.push(format!(
                "{}: {} lines are unlike the others and are left out ({first})",
                log.files, log.sample.broken.0
            ));
        }
        if log.sample.is_cut {
            findings.push(format!(
                "{}: guessed from the first {} rows",
                log.files,
                log.sample.rows.len()
            ));
        }
    }
    let mut top: Vec<(String, String)> = draft.top.clone();
    let main = &logs[draft.inputs[0].log];
    // Of rows that share their times, equal ones may be of different frames.
    let has_own_times = main.profiles.iter().any(|profile| {
        let is_used = draft.inputs[0].columns.iter().any(|(name, source, _)| {
            ["time_s", "sequence"].contains(&&**name) && source.contains(&*quoted(&profile.name))
        });
        is_used && 10 * profile.n_distinct.min(4000) >= 9 * main.sample.rows.len().min(4000)
    });
    let (n_repeats, first) = if has_own_times { main.sample.repeats() } else { (0, None) };
    if let (1.., Some(first)) = (n_repeats, first) {
        findings.push(format!("rows that repeat an earlier row in every field: {n_repeats}, first in row {first}; left out"));
        top.push(("repeats".to_owned(), quoted("drop")));
    }
    for key in draft.inputs.iter().flat_map(|input| &input.top) {
        if !top.contains(key) {
            top.push(key.clone());
        }
    }
    let mapping = mapping(logs, &draft, &top, &findings, &questions);
    let columns = draft.inputs.iter().enumerate().flat_map(|(number, input)| {
        let of_format =
            BUILT_IN.iter().find(|format| format.variant.name == logs[input.log].form.format);
        let own =
            of_format.into_iter().flat_map(|format| format.columns).map(move |(column, field)| {
                Guessed {
                    column: (*column).to_owned(),
                    from: quoted(field),
                    reason: "as the format has it".to_owned(),
                    input: number,
                }
            });
        let stated =
            input.columns.iter().chain(&input.covariates).map(move |(column, from, reason)| {
                Guessed {
                    column: column.clone(),
                    from: from.clone(),
                    reason: reason.clone(),
                    input: number,
                }
            });
        own.filter(|column| !column.column.starts_with("hop")).chain(stated)
    });
    let columns: Vec<Guessed> = columns.collect();
    let used: BTreeSet<&str> = columns.iter().flat_map(|column| texts(&column.from)).collect();
    let unused = logs.iter().filter(|log| {
        log.form.format == "csv" || log.form.format == "json-lines" || log.form.format == "parquet"
    });
    let unused = unused
        .flat_map(|log| &log.sample.names)
        .filter(|name| !name.is_empty() && !name.starts_with("label") && !used.contains(&***name));
    let unused: Vec<String> = unused.cloned().collect();
    Guess { table: draft.table, columns, findings, questions, unused, mapping, model: draft.model }
}

/// The texts in quotation marks of a source.
fn texts(source: &str) -> impl Iterator<Item = &str> {
    source.split(['"', '\'']).skip(1).step_by(2)
}

fn mapping(
    logs: &[Log],
    draft: &Draft,
    top: &[(String, String)],
    findings: &[String],
    questions: &[Question],
) -> String {
    let mut text = format!(
        "# Which columns of the logs fill those of the table. Check the lines marked {CHECK}.\n"
    );
    for finding in findings {
        comment(&mut text, "Found: ", finding);
    }
    for question in questions {
        let choices: Vec<String> =
            question.choices.iter().map(|(word, what)| format!("{word} ({what})")).collect();
        let taken = &question.choices[question.answer].0;
        comment(
            &mut text,
            &format!("{CHECK}: "),
            &format!("{} {}. Taken: {taken}", question.text, choices.join("; ")),
        );
    }
    for unknown in &draft.unknown {
        comment(&mut text, &format!("{CHECK}: "), unknown);
    }
    let _ = writeln!(text, "table = \"{}\"", draft.table.name());
    for (key, value) in top {
        let _ = writeln!(text, "{key} = {value}");
    }
    for input in &draft.inputs {
        let log = &logs[input.log];
        let _ = writeln!(text, "\n[[input]]\nfiles = {}", quoted(&log.files));
        if log.form.format != "csv" && !input.keys.iter().any(|(key, _)| key == "format") {
            let _ = writeln!(text, "format = {}", quoted(log.form.format));
        }
        for (key, value) in &log.form.keys {
            let _ = writeln!(text, "{key} = {value}");
        }
        if let Some(columns) = &log.melted {
            let _ = writeln!(text, "melt = {}", toml::Value::from(columns.clone()));
        }
        for (key, value) in &input.keys {
            let _ = writeln!(text, "{key} = {value}");
        }
        section(&mut text, "columns", &input.columns);
        section(&mut text, "covariates", &input.covariates);
    }
    text
}

fn section(text: &mut String, name: &str, columns: &[(String, String, String)]) {
    if columns.is_empty() {
        return;
    }
    let mut sorted: Vec<&(String, String, String)> = columns.iter().collect();
    sorted.sort_by_key(|(column, _, _)| COLUMNS.iter().position(|known| known.name == column));
    let _ = writeln!(text, "\n[input.{name}]");
    for (column, source, reason) in sorted {
        let line = format!("{column} = {source}");
        if reason.is_empty() {
            let _ = writeln!(text, "{line}");
        } else {
            let _ = writeln!(text, "{line}  # {reason}");
        }
    }
}

/// Lines of a comment, at most 100 characters long.
fn comment(text: &mut String, begin: &str, words: &str) {
    let mut line = format!("# {begin}");
    for word in words.split_whitespace() {
        if 100 < line.len() + word.len() {
            let _ = writeln!(text, "{}", line.trim_end());
            line = "#   ".to_owned();
        }
        line.push_str(word);
        line.push(' ');
    }
    let _ = writeln!(text, "{}", line.trim_end());
}

/// A model of links: the loss grows with the logarithm of the distance.
pub(super) fn model_of_links(log: &Log, findings: &mut Vec<String>) -> String {
    let power = log.best(|p| {
        let is_power =
            p.is_numeric() && p.is_constant() && -40.0 <= p.range[1] && p.range[1] <= 36.0;
        let is_named = p.has(&["power", "txpower", "pwr"]) && !p.has(&["rx", "received"]);
        i32::from(is_power && is_named)
            + i32::from(is_power && is_named && p.has(&["tx", "transmit"]))
    });
    let frequency = log.best(|p| {
        let [least, _, greatest] = p.range;
        let is_hz = 1e8 <= least && greatest <= 1e10;
        let is_mhz = 100.0 <= least && greatest <= 10_000.0;
        i32::from(p.is_numeric() && (is_hz || is_mhz) && p.has(&["frequency", "freq"]))
    });
    let mut text = String::from(
        "# A first model of these links: free space, in which the loss grows with the distance. What it lacks is what diagnose finds.\n",
    );
    if power.is_none() {
        let _ = writeln!(
            text,
            "# {CHECK}: tx_power_dbm, the transmit power (dBm). The log does not state it; a wrong one is a constant error."
        );
    }
    text.push_str("[netsim.phy]\npropagation = \"log-distance\"\nexponent = 2.0\n");
    let dbm = power.map_or(0.0, |column| log.profile(column).range[1]);
    let _ = writeln!(text, "tx_power_dbm = {dbm:?}");
    if let Some(column) = power {
        findings
            .push(format!("tx_power_dbm of the model is {dbm}, from {}", log.profile(column).name));
    }
    if let Some(column) = frequency {
        let [least, _, greatest] = log.profile(column).range;
        let middle = (least + greatest) / 2.0;
        let hz = if middle < 1e6 { middle * 1e6 } else { middle };
        let _ = writeln!(text, "carrier_hz = {hz:?}");
    } else {
        let _ = writeln!(
            text,
            "# carrier_hz = 2.44e9    # {CHECK}: 868e6 and 915e6 are usual for LoRa, 2.44e9 for BLE, WiFi and 802.15.4."
        );
    }
    text
}

/// The same where the log states nothing.
pub(super) fn plain_model_of_links() -> String {
    format!(
        "# A first model of these links: free space. What it lacks is what diagnose finds.\n\
         # {CHECK}: tx_power_dbm, the transmit power (dBm).\n\
         [netsim.phy]\npropagation = \"log-distance\"\nexponent = 2.0\ntx_power_dbm = 0.0\n"
    )
}

/// A model of robots: they do what they are commanded.
pub(super) fn model_of_robots(kind: &str) -> String {
    let body = match kind {
        "car" => format!(
            "kind = \"car\"\nwheelbase_m = 0.33  # {CHECK}: the distance between the axles (m)\n"
        ),
        "unicycle" => "kind = \"unicycle\"\n".to_owned(),
        "acceleration" => "kind = \"double-integrator\"\n".to_owned(),
        "thrust" => format!("kind = \"quadrotor\"\nmass_kg = 1.0  # {CHECK}: the mass (kg)\n"),
        _ => "kind = \"point-mass\"\n".to_owned(),
    };
    format!(
        "# A first model of these robots: they do what they are commanded. What it lacks is what diagnose finds.\n[robotsim.dynamics]\n{body}"
    )
}

/// A model of a network whose motes send the measured packets.
pub(super) fn model_of_packets(log: &Log) -> String {
    let n = super::packets::nodes(log).max(2);
    format!(
        "# A first model of this network: motes on a grid that send the measured packets at their measured times.\n\
         # {CHECK}: agents, the positions of the motes ([robotsim.scenario], or compare --positions), and the network's own settings.\n\
         [experiment]\nname = \"imported\"\nseed = 1\nduration_s = 3600.0\nagents = {n}\nstart = \"at-once\"\n\
         control_period = {{ rate_hz = 1.0 }}\n\n\
         [robotsim.scenario]\nkind = \"grid\"\nspacing_m = 10.0\n\n[robotsim.controller]\nkind = \"hold\"\n\n\
         [netsim]\nmode = \"6tisch\"\n\n[netsim.phy]\npropagation = \"log-distance\"\nexponent = 3.0\n\n\
         [netsim.sf]\nkind = \"msf\"\n\n[netsim.swarm]\ntransport = \"none\"\n"
    )
}

/// The command that a table of this kind goes into next.
#[must_use]
pub fn next_command(table: TableKind, model: &str, data: &str) -> String {
    match table {
        TableKind::Links | TableKind::Robots => format!("diagnose {model} --data {data}"),
        TableKind::Packets => format!("compare {model} --data {data} --from 600"),
    }
}
