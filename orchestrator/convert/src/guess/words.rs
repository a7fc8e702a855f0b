//! Words in the names of columns and files, by what they mean.

use super::profile::Profile;

/// Words for the sender of a frame.
pub(super) const TX: &[&str] = &[
    "tx",
    "sender",
    "send",
    "src",
    "source",
    "transmitter",
    "from",
    "transmit",
    "transmitting",
    "absender",
    "emisor",
    "emetteur",
    "émetteur",
];
/// Words for what usually sends.
pub(super) const TX_DEVICE: &[&str] = &[
    "device",
    "dev",
    "devaddr",
    "deveui",
    "tag",
    "beacon",
    "node",
    "mote",
    "mac",
    "addr",
    "address",
    "ap",
    "bssid",
    "ssid",
    "advertiser",
    "peripheral",
    "uuid",
];
/// Words for the receiver of a frame.
pub(super) const RX: &[&str] = &[
    "rx",
    "receiver",
    "recv",
    "dst",
    "dest",
    "destination",
    "to",
    "receive",
    "receiving",
    "empfänger",
    "empfaenger",
    "receptor",
    "recepteur",
    "récepteur",
];
/// Words for what usually receives.
pub(super) const RX_DEVICE: &[&str] = &[
    "gateway",
    "gateways",
    "gtw",
    "gw",
    "anchor",
    "scanner",
    "listener",
    "hotspot",
    "hotspots",
    "anchors",
    "receivers",
    "stations",
    "sink",
    "root",
    "central",
    "station",
    "reader",
];
/// Words for a robot.
pub(super) const ROBOT: &[&str] = &[
    "agent",
    "robot",
    "vehicle",
    "drone",
    "uav",
    "car",
    "quadrotor",
    "quad",
    "turtlebot",
    "rover",
    "cf",
    "crazyflie",
    "boat",
];
/// Words for what was commanded.
pub(super) const COMMAND: &[&str] = &[
    "cmd",
    "command",
    "commanded",
    "commands",
    "ref",
    "reference",
    "setpoint",
    "sp",
    "desired",
    "des",
    "target",
    "ctrltarget",
    "goal",
    "control",
    "ctrl",
    "input",
    "action",
];
/// Words for times.
pub(super) const TIME: &[&str] = &[
    "time",
    "timestamp",
    "ts",
    "datetime",
    "date",
    "t",
    "epoch",
    "stamp",
    "when",
    "zeit",
    "uhrzeit",
    "datum",
    "tick",
    "sec",
    "secs",
    "seconds",
    "fecha",
    "hora",
    "heure",
    "reported",
];
/// Words for what no node is called by.
const NO_LABEL: &[&str] = &[
    "x",
    "y",
    "z",
    "lat",
    "latitude",
    "lon",
    "lng",
    "long",
    "longitude",
    "power",
    "rssi",
    "rss",
    "snr",
    "lqi",
    "pos",
    "position",
    "count",
    "time",
    "timestamp",
    "frequency",
    "freq",
    "channel",
    "seq",
    "payload",
    "size",
    "height",
    "alt",
    "altitude",
    "heading",
    "yaw",
    "distance",
    "dist",
    "range",
    "temperature",
    "humidity",
    "battery",
    "voltage",
    "port",
    "len",
    "length",
    "speed",
    "velocity",
    "pdr",
    "gain",
    "delay",
];

/// Covariates that are recognised, and words in the names of the log's columns.
pub(super) const COVARIATES: [(&str, &[&str]); 6] = [
    ("temperature_c", &["temperature", "temp"]),
    ("humidity_percent", &["humidity", "rh"]),
    ("battery_v", &["battery", "vbat", "voltage"]),
    ("pressure_hpa", &["pressure", "baro"]),
    ("wind_mps", &["wind"]),
    ("rain_mmph", &["rain"]),
];
/// Words of columns that have no reading of one node.
pub(super) const NO_LEVEL: &[&str] =
    &["snr", "noise", "lqi", "tx", "lat", "lon", "latitude", "longitude", "temp", "temperature"];

/// How well a column names the nodes at one end of a link: 0 for not at all.
pub(super) fn end(profile: &Profile, strong: &[&str], weak: &[&str], other: &[&str]) -> i32 {
    if !profile.is_label() || profile.has(NO_LABEL) || profile.has(other) {
        return 0;
    }
    let is_named = profile.has(&["id", "name", "mac", "addr", "address", "eui"]);
    let score = if profile.has(strong) {
        8
    } else if profile.has(weak) {
        4
    } else {
        return 0;
    };
    score + i32::from(is_named) + i32::from(1 < profile.n_distinct)
}

/// Whether a label of several words is of the end of a link that another column names: `hotspots.lat` and `hotspots.id`.
pub(super) fn shares_group(a: &str, b: &str) -> bool {
    let group = |name: &str| name.rsplit_once(['.', '/']).map(|(group, _)| group.to_lowercase());
    group(a).is_some_and(|own| group(b) == Some(own))
}

/// A pattern for names of files, in which `{label:one|two}` stands for the texts by which they differ.
pub(super) fn pattern(names: &[String]) -> String {
    let parts: Vec<Vec<&str>> = names.iter().map(|name| name.split('/').collect()).collect();
    let n_parts = parts[0].len();
    if parts.iter().any(|own| own.len() != n_parts) {
        return names[0].clone();
    }
    let mut n_labels = 0;
    let of_part = |at: usize| {
        let own: Vec<&str> = parts.iter().map(|parts| parts[at]).collect();
        if own.iter().all(|part| *part == own[0]) {
            return own[0].to_owned();
        }
        n_labels += 1;
        let label = if n_labels == 1 { "label".to_owned() } else { format!("label_{n_labels}") };
        let (prefix, suffix) = common(&own);
        let middle = |part: &&str| part[prefix.len()..part.len() - suffix.len()].to_owned();
        let mut texts: Vec<String> = own.iter().map(middle).collect();
        texts.dedup();
        format!("{prefix}{{{label}:{}}}{suffix}", texts.join("|"))
    };
    let parts: Vec<String> = (0..n_parts).map(of_part).collect();
    parts.join("/")
}

/// Patterns that stand for some of the names of columns and for no others: one if they begin alike, or the names themselves.
pub(super) fn patterns(names: &[String], all: &[String]) -> Vec<String> {
    let own: Vec<&str> = names.iter().map(String::as_str).collect();
    let (prefix, _) = common(&own);
    let n_alike = all.iter().filter(|name| name.starts_with(prefix)).count();
    if 2 <= prefix.len() && n_alike == names.len() {
        vec![format!("{prefix}*")]
    } else {
        names.to_vec()
    }
}

/// What texts begin and end with; numbers are not divided.
pub(super) fn common<'a>(texts: &[&'a str]) -> (&'a str, &'a str) {
    let first = texts[0];
    let is_shared = |length: usize| {
        first.is_char_boundary(length)
            && texts.iter().all(|text| text.starts_with(&first[..length]))
    };
    let mut start = (0..=first.len()).rev().find(|&length| is_shared(length)).unwrap_or(0);
    let digit = |c: Option<char>| c.is_some_and(|c| c.is_ascii_digit());
    while 0 < start && digit(first[..start].chars().next_back()) {
        start -= 1;
    }
    let is_shared = |at: usize| {
        first.is_char_boundary(at)
            && texts
                .iter()
                .all(|text| start + first.len() - at <= text.len() && text.ends_with(&first[at..]))
    };
    let mut end = (start..=first.len()).find(|&at| is_shared(at)).unwrap_or(first.len());
    while end < first.len() && digit(first[end..].chars().next()) {
        end += 1;
    }
    (&first[..start], &first[end..])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_keeps_numbers_whole() {
        let pattern = |names: &[&str]| {
            pattern(&names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>())
        };
        assert_eq!(pattern(&["rssi_10m.csv", "rssi_12m.csv"]), "rssi_{label:10|12}m.csv");
        assert_eq!(pattern(&["a/1D1.txt", "a/1D2.txt", "a/3D1.txt"]), "a/{label:1D1|1D2|3D1}.txt");
        assert_eq!(pattern(&["run1/x.csv", "run2/x.csv"]), "run{label:1|2}/x.csv");
        assert_eq!(pattern(&["log5.csv", "log15.csv"]), "log{label:5|15}.csv");
    }

    #[test]
    fn columns_of_one_object_belong_together() {
        assert!(shares_group("hotspots.lat", "hotspots.name") && !shares_group("lat", "name"));
        assert!(!shares_group("a.lat", "b.name"));
    }
}
