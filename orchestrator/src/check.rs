//! What a file of measurements holds, and which effects it can show: nothing is fitted.

use measure::config::Compared;
use measure::links::Row;
use measure::table::Table;
use numbers::format::rounded;
use numbers::statistics::quantile_lower;
use proto::effect::Level;
use robotsim::dynamics::Shape;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;
use study::choices::Choices;
use study::links::LinkStudy;
use study::open::{self, Account, OpenError, Subject};
use study::robots::{RobotStudy, WINDOW_S};
use study::{Candidate, Study};

/// What was seen in a file.
#[derive(Clone, Debug)]
pub struct Checked {
    /// As JSON, `check-data/1`.
    pub json: Value,
    /// As a person reads it.
    pub text: String,
    /// Rows, what was rejected, warnings.
    pub account: Account,
}

/// Looks at a file of measurements. Without a configuration, free space and bodies that obey at once are taken.
///
/// # Errors
///
/// What is wrong with either file, in words for its author.
pub fn data(
    config: Option<Compared>,
    table: &Table,
    choices: &Choices,
) -> Result<Checked, OpenError> {
    let is_bare = config.is_none();
    let subject = open::subject(table)?;
    let config = match config {
        Some(config) => config,
        None => bare(subject, table)?,
    };
    let mut checked = match subject {
        Subject::Links => {
            let (study, account) = open::links(&config, table, choices)?;
            links(&study, account)
        }
        Subject::Robots => {
            let (study, account) = open::robots(&config, table, choices)?;
            robots(&study, account, choices.window_s.unwrap_or(WINDOW_S))
        }
    };
    if is_bare {
        checked.text.push_str(
            "(no configuration was given: what walls, foliage and terrain are needed for is not testable without one)\n",
        );
    }
    Ok(checked)
}

/// The least configuration that suits a file.
fn bare(subject: Subject, table: &Table) -> Result<Compared, OpenError> {
    let text = match subject {
        Subject::Links => "[netsim.phy]\npropagation = \"friis\"\n".to_owned(),
        Subject::Robots => {
            let kind = match measure::robots::has_shape(table) {
                Ok(Shape::Unicycle) => "unicycle",
                Ok(Shape::Car) => "car",
                _ => "point-mass",
            };
            format!("[robotsim.dynamics]\nkind = \"{kind}\"\n")
        }
    };
    Ok(Compared::of_text(Path::new("no configuration"), text, &[])?)
}

/// A fact: its name, what a person reads, and for programs key and value.
struct Fact(&'static str, String, &'static str, Value);

fn range(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    values.filter(|value| value.is_finite()).fold(None, |range, value| match range {
        None => Some([value, value]),
        Some([low, high]) => Some([low.min(value), high.max(value)]),
    })
}

/// Rounded as a person would.
fn short(value: f64) -> String {
    rounded(value, 4).to_string()
}

fn from_to(name: &'static str, key: &'static str, unit: &str, range: Option<[f64; 2]>) -> Fact {
    let (text, json) = match range {
        Some([low, high]) => {
            let space = if unit.is_empty() { "" } else { " " };
            (format!("{} to {}{space}{unit}", short(low), short(high)), json!([low, high]))
        }
        None => ("unknown".to_owned(), Value::Null),
    };
    Fact(name, text, key, json)
}

fn links(study: &LinkStudy, account: Account) -> Checked {
    let rows = &study.rows.links.rows;
    let n_motes: BTreeSet<u32> = rows.iter().flat_map(|row| [row.tx, row.rx]).collect();
    let still = study.still_motes();
    let links: BTreeSet<(u32, u32)> = rows.iter().map(|row| (row.tx, row.rx)).collect();
    let pairs: BTreeSet<(u32, u32)> =
        rows.iter().map(|row| (row.tx.min(row.rx), row.tx.max(row.rx))).collect();
    let channels: BTreeSet<u8> = rows.iter().filter_map(|row| row.channel).collect();
    let runs: BTreeSet<u32> = rows.iter().map(|row| row.run).collect();
    let known = || rows.iter().filter(|row| row.received.is_finite());
    let sum = |value: fn(&Row) -> f64| known().map(value).sum::<f64>();
    let (frames, received) = (sum(|row| row.frames), sum(|row| row.received));
    let rounding =
        if study.rows.links.readings.quantum_db == 1.0 { "whole dB" } else { "not rounded" };
    let readings = range(rows.iter().map(|row| row.rssi_dbm));
    let n_readings = rows.iter().filter(|row| row.rssi_dbm.is_finite()).count();
    let mut rssi = from_to("RSSI", "rssi_dbm", "dBm", readings);
    let _ = write!(rssi.1, " in {n_readings} readings, {rounding}");
    let is_placed =
        |row: &Row| [row.tx_m, row.rx_m].iter().all(|m| m[..2].iter().all(|c| c.is_finite()));
    let distances = (0..rows.len())
        .filter(|&row| is_placed(&rows[row]))
        .map(|row| study.rows.link(row, |link| link.distance_m));
    let n = n_motes.len();
    let motes = if rows.iter().all(is_placed) {
        format!("{n}: {still} stand still, {} move", n - still.min(n))
    } else {
        format!("{n}; of some the place is unknown")
    };
    let mut facts = vec![
        from_to("time", "time_s", "s", range(rows.iter().map(|row| row.time_s))),
        Fact("campaigns", runs.len().to_string(), "runs", json!(runs.len())),
        Fact("motes", motes, "motes", json!({ "all": n_motes, "still": still })),
        Fact(
            "links",
            format!("{} directed, {} pairs", links.len(), pairs.len()),
            "links",
            json!({ "directed": links.len(), "pairs": pairs.len() }),
        ),
        Fact(
            "channels",
            match (channels.first(), channels.last()) {
                (Some(low), Some(high)) => format!("{}: {low} to {high}", channels.len()),
                _ => "unknown".to_owned(),
            },
            "channels",
            json!(channels),
        ),
        from_to("distance", "distance_m", "m", range(distances)),
        rssi,
        Fact(
            "delivery",
            if 0.0 < frames {
                format!("{:.1} % of {frames} frames", 100.0 * received / frames)
            } else {
                "unknown".to_owned()
            },
            "delivery",
            if 0.0 < frames { json!(received / frames) } else { Value::Null },
        ),
    ];
    facts.extend(covariates(&study.rows.links.covariates));
    let shape = if study.rows.links.readings.is_aggregated {
        ("link table", "sums of frames of a link", "aggregated-link")
    } else {
        ("link samples", "a row per frame and possible receiver", "link")
    };
    finished(shape, facts, study, account)
}

fn robots(study: &RobotStudy, account: Account, window_s: f64) -> Checked {
    let robots = study.robots();
    let samples = &robots.samples;
    let agents: BTreeSet<u32> = samples.iter().map(|sample| sample.agent).collect();
    let runs: BTreeSet<u32> = samples.iter().map(|sample| sample.run).collect();
    let command = match robots.shape {
        Shape::Velocity => "velocities",
        Shape::Unicycle => "speed and yaw rate",
        Shape::Car => "speed and steering",
    };
    let place = |axis: usize| range(samples.iter().map(|sample| sample.position_m[axis]));
    let spacing_s = robots.spacing_s();
    let speeds = robots.tracks.iter().flat_map(|track| {
        samples[track.clone()].windows(2).map(|pair| {
            let [a, b] = [pair[0].position_m, pair[1].position_m];
            (b[0] - a[0]).hypot(b[1] - a[1]).hypot(b[2] - a[2]) / (pair[1].time_s - pair[0].time_s)
        })
    });
    let mut speeds: Vec<f64> = speeds.filter(|speed| speed.is_finite()).collect();
    speeds.sort_by(f64::total_cmp);
    let most_speeds = [0.01, 0.99].map(|share| quantile_lower(&speeds, share));
    let most_speeds = (!speeds.is_empty()).then_some(most_speeds);
    let mut facts = vec![
        from_to("time", "time_s", "s", range(samples.iter().map(|sample| sample.time_s))),
        Fact("campaigns", runs.len().to_string(), "runs", json!(runs.len())),
        Fact("robots", agents.len().to_string(), "agents", json!(agents)),
        Fact("sampled", format!("every {} s", short(spacing_s)), "spacing_s", json!(spacing_s)),
        Fact("commands", command.to_owned(), "commands", json!(command)),
        from_to("x", "x_m", "m", place(0)),
        from_to("y", "y_m", "m", place(1)),
        from_to("speed", "speed_mps", "m/s", most_speeds),
        Fact(
            "windows",
            format!("{} of {window_s} s", study.n_rows()),
            "windows",
            json!(study.n_rows()),
        ),
    ];
    if let Some(speed) = facts.iter_mut().find(|fact| fact.0 == "speed") {
        speed.1.push_str(" (1 % to 99 %, as measured)");
    }
    if robots.is_spatial {
        facts.insert(7, from_to("z", "z_m", "m", place(2)));
    }
    facts.extend(covariates(&robots.covariates));
    finished(("robot samples", "a row per robot and instant", "robot"), facts, study, account)
}

fn covariates(columns: &[(String, Vec<f64>)]) -> Option<Fact> {
    let mut text = Vec::new();
    let mut json = serde_json::Map::new();
    for (name, values) in columns {
        let [low, high] = range(values.iter().copied())?;
        let n_missing = values.iter().filter(|value| !value.is_finite()).count();
        let missing =
            if n_missing == 0 { String::new() } else { format!(" (missing in {n_missing} rows)") };
        text.push(format!("{name} {} to {}{missing}", short(low), short(high)));
        json.insert(name.clone(), json!({ "range": [low, high], "missing": n_missing }));
    }
    (!text.is_empty())
        .then(|| Fact("covariates", text.join(", "), "covariates", Value::Object(json)))
}

fn finished<S: Study>(
    (kind, meaning, name): (&str, &str, &str),
    facts: Vec<Fact>,
    study: &S,
    account: Account,
) -> Checked {
    let mut json = json!({ "schema": "check-data/1", "kind": name });
    let mut text = format!("{kind}: {meaning}\n");
    for Fact(label, words, key, value) in facts {
        let _ = writeln!(text, "  {label:<12} {words}");
        json[key] = value;
    }
    let blocks: Vec<String> = [Level::Time, Level::Place]
        .map(|level| study.blocks(level))
        .iter()
        .map(|blocks| format!("{} {}", blocks.n_scored(), blocks.unit))
        .collect();
    let _ = writeln!(text, "  {:<12} {}", "left out in", blocks.join("; "));
    json["blocks"] = json!(blocks);
    let effects: Vec<&Candidate> =
        study.candidates().iter().filter(|c| c.curve_over().is_none()).collect();
    let why = |candidate: &Candidate| match &candidate.untestable {
        Some(why) => Some(why.clone()),
        None => {
            let blocks = study.blocks(candidate.level);
            (!blocks.suffices()).then(|| {
                let few = study::folds::FEWEST_BLOCKS;
                format!("has {} {}, needs at least {few}", blocks.n_scored(), blocks.unit)
            })
        }
    };
    let testable: Vec<&str> =
        effects.iter().filter(|c| why(c).is_none()).map(|c| c.name.as_str()).collect();
    let _ = writeln!(
        text,
        "effects that these data can show: {}",
        if testable.is_empty() { "none".to_owned() } else { testable.join(", ") }
    );
    let mut lacking = Vec::new();
    for candidate in &effects {
        if let Some(why) = why(candidate) {
            let _ = writeln!(text, "not testable: {:<24} {why}", candidate.name);
            lacking.push(json!({ "effect": candidate.name, "because": why }));
        }
    }
    json["testable"] = json!(testable);
    json["not_testable"] = json!(lacking);
    Checked { json, text, account }
}
