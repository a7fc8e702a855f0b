//! Which column has the RSSI, and what is wrong with its values: missing signs, sentinels, missing readings.

use super::Log;
use super::profile::Profile;
use super::times::quoted;
use std::fmt::Write as _;

/// A column of RSSI.
pub(super) struct Readings {
    /// The source, as TOML.
    pub source: String,
    pub reason: String,
    /// What was found among the values.
    pub findings: Vec<String>,
    /// Rows without a reading, of the sample.
    pub n_missing: usize,
}

/// Words of the name of a reading that is not of one node among several.
pub(super) const PLAIN: [&str; 7] = ["rssi", "rss", "signal", "strength", "dbm", "level", "power"];

/// Words for the strength of a signal.
const STRENGTH: &[&str] = &[
    "signal",
    "strength",
    "dbm",
    "level",
    "signalstärke",
    "signalstaerke",
    "signalpegel",
    "empfangspegel",
    "empfangsstärke",
    "feldstärke",
    "pegel",
    "señal",
    "intensidad",
    "niveau",
];

/// Whether a column is named as one of RSSI, and has no readings.
pub(super) fn is_empty(profile: &Profile) -> bool {
    profile.n_numbers == 0
        && (profile.has(&["rssi", "rsrp", "rss", "rssdbm"]) || profile.has(STRENGTH))
}

/// Readings in dBm are usually within these.
const PLAUSIBLE_DBM: std::ops::RangeInclusive<f64> = -135.0..=-8.0;

/// How well a column holds RSSI: 0 for not at all.
pub(super) fn score(profile: &Profile) -> i32 {
    if !profile.is_numeric()
        || profile.has(&["snr", "noise", "lqi", "sd", "std", "var", "count", "quality"])
    {
        return 0;
    }
    let median = profile.range[1];
    let is_plausible = PLAUSIBLE_DBM.contains(&median);
    let is_unsigned = (8.0..=135.0).contains(&median) && 0.0 <= profile.range[0];
    let of_sender =
        profile.has(&["tx", "transmit", "transmitted", "send"]) && !profile.has(&["rx", "rssi"]);
    if of_sender || profile.is_constant() && profile.n > 5 && !profile.has(&["rssi"]) {
        return 0;
    }
    let named = if profile.has(&["rssi", "rsrp"]) {
        10
    } else if profile.has(&["rss", "rssdbm"]) {
        9
    } else if profile.has(&["rx", "received", "receive"])
        && profile.has(&["power", "level", "signal", "pwr"])
    {
        8
    } else if profile.has(STRENGTH) {
        6
    } else {
        0
    };
    match (named, is_plausible, is_unsigned) {
        (0, _, _) => 0,
        (named, true, _) => named + 2,
        (10, false, true) => 5,
        _ => 0,
    }
}

/// How well a column without a telling name holds RSSI, by its values alone.
pub(super) fn score_of_values(profile: &Profile) -> i32 {
    let [least, median, greatest] = profile.range;
    let is_level = PLAUSIBLE_DBM.contains(&median) && greatest < 0.0 && -140.0 <= least;
    i32::from(profile.is_numeric() && is_level && 3 < profile.n_distinct && median < -30.0)
}

/// `1 row`, `2 rows`, …
pub(super) fn rows(n: usize) -> String {
    if n == 1 { "1 row".to_owned() } else { format!("{n} rows") }
}

/// Reads what the values of a column say.
pub(super) fn readings(log: &Log, column: usize) -> Readings {
    let profile = log.profile(column);
    let name = quoted(&profile.name);
    let values = log.sample.numbers(column);
    let known: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    let n_missing = values.len() - known.len();
    let mut findings = Vec::new();
    if 0 < n_missing {
        findings.push(format!(
            "{} has no reading in {n_missing} of {} rows",
            profile.name,
            values.len()
        ));
    }
    let is_unsigned = 0.0 < profile.range[1] && known.iter().all(|level| 0.0 <= *level);
    if is_unsigned {
        let source = format!("{{ column = {name}, unit = \"-dBm\" }}");
        let reason =
            format!("positive numbers ({} to {}): −dBm", profile.range[0], profile.range[2]);
        return Readings { source, reason, findings, n_missing };
    }
    // What is usual: readings but the extreme hundredths.
    let mut levels: Vec<f64> =
        known.iter().copied().filter(|level| PLAUSIBLE_DBM.contains(level)).collect();
    levels.sort_by(f64::total_cmp);
    let at = |share: f64| levels[((levels.len() - 1) as f64 * share) as usize];
    let (low, high) = (at(0.01), at(0.99));
    let positive: Vec<f64> = known.iter().copied().filter(|level| 0.0 < *level).collect();
    let mut different = positive.clone();
    different.sort_by(f64::total_cmp);
    different.dedup();
    let is_usual = |level: f64| (low - 10.0..=high + 10.0).contains(&-level);
    let unsigned: Vec<f64> = positive.iter().copied().filter(|level| is_usual(*level)).collect();
    // One value again and again stands for something else.
    let is_sign_missing = !unsigned.is_empty() && (1 < different.len() || unsigned.len() < 5);
    let mut sentinels: Vec<f64> =
        different.iter().copied().filter(|level| !is_sign_missing || !is_usual(*level)).collect();
    sentinels.extend([0.0].into_iter().filter(|zero| known.contains(zero)));
    const LOW: [f64; 7] = [-128.0, -127.0, -150.0, -200.0, -255.0, -256.0, -999.0];
    sentinels.extend(LOW.into_iter().filter(|level| known.contains(level) && *level < low - 15.0));
    let mut keys = String::new();
    if is_sign_missing {
        let first = values.iter().position(|value| unsigned.contains(value)).unwrap_or(0) + 1;
        findings.push(format!(
            "{} lacks its minus sign in {}, first in row {first} ({}); taken as negative",
            profile.name,
            rows(unsigned.len()),
            log.sample.field(first - 1, column)
        ));
        keys.push_str(", sign = \"negative\"");
    }
    if !sentinels.is_empty() {
        let n = known.iter().filter(|value| sentinels.contains(value)).count();
        let shown: Vec<String> = sentinels.iter().take(5).map(f64::to_string).collect();
        findings.push(format!(
            "{} is {} in {}, which stands for no reading; taken as missing",
            profile.name,
            shown.join(" or "),
            rows(n)
        ));
        let is_sentinel = |level: &&f64| {
            let level = if is_sign_missing { -level.abs() } else { **level };
            !sentinels
                .iter()
                .any(|sentinel| *sentinel == level || is_sign_missing && -sentinel.abs() == level)
        };
        let kept: Vec<f64> = known.iter().filter(is_sentinel).copied().collect();
        let least = kept.iter().copied().filter(|level| *level < 0.0).fold(f64::INFINITY, f64::min);
        let greatest =
            kept.iter().copied().filter(|level| *level < 0.0).fold(f64::NEG_INFINITY, f64::max);
        // The rest of the log may have others: what lies within ten decibels of those seen.
        let bound = |level: f64, sign: f64| {
            let near = level + sign * 10.0;
            let hits = |s: &f64| (level.min(near)..=level.max(near)).contains(s);
            if sentinels.iter().any(hits) || 0.0 <= near { level } else { near }
        };
        let _ = write!(
            keys,
            ", within = [{}, {}]",
            bound(least, -1.0).floor(),
            bound(greatest, 1.0).ceil()
        );
    }
    let source = if keys.is_empty() { name } else { format!("{{ column = {name}{keys} }}") };
    let reason = format!("most readings from {low} to {high} dBm");
    Readings { source, reason, findings, n_missing }
}

/// Whether a column has the readings of one node: levels, and at most one other value that stands for none.
pub(super) fn is_of_one_node(profile: &Profile, values: &[f64]) -> bool {
    if !profile.is_numeric() || profile.has(super::words::NO_LEVEL) {
        return false;
    }
    let is_level = |value: &&f64| (-125.0..=-15.0).contains(*value);
    let known: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    let levels: Vec<f64> = known.iter().filter(is_level).copied().collect();
    let others: Vec<f64> = known.iter().filter(|value| !is_level(value)).copied().collect();
    let has_one_other = others.iter().all(|other| *other == others[0]);
    let is_named = profile.has(&["rssi", "rss", "signal", "ap", "wap", "beacon"]);
    3 <= levels.len()
        && has_one_other
        && (is_named
            || 2 * levels.len() > known.len()
                && levels.iter().sum::<f64>() / (levels.len() as f64) < -30.0
            || !others.is_empty() && profile.is_whole)
}
