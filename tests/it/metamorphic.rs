//! What must not change an answer: another origin of coordinates and times, mirrored and turned coordinates, other numbers of nodes,
//! another order of rows, a column that says nothing. A model with another transmit power misses another gain, and nothing else.

use diagnose::Request;
use diagnose::diagnosis::Diagnosis;
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use study::thresholds::FAMILY_ERROR;
use tests::answers::{diagnosed, measurements, model};
use tests::campaign::{Base, Campaign, Hidden, Layout, Size};

const ROWS: usize = 700;
/// Estimates are the same within this share of the number, or of 1.
const SAME: f64 = 1e-6;
/// None of these has a place or a direction among its numbers.
const HIDDEN: [&[Hidden]; 12] = [
    &[],
    &[Hidden::SystemGain],
    &[Hidden::PathLossExponent],
    &[Hidden::TwoRayGround],
    &[Hidden::NodeOffset],
    &[Hidden::Shadowing],
    &[Hidden::Multipath],
    &[Hidden::FastFading],
    &[Hidden::NoiseFloor],
    &[Hidden::Temperature],
    &[Hidden::Sinusoid],
    &[Hidden::SystemGain, Hidden::NodeOffset],
];

fn campaign(number: usize) -> Campaign {
    let layout =
        Layout { n_fixed: 7, n_moving: 2, base: Base::Friis, n_walls: 0, ..Layout::standard() };
    let hidden: Vec<(Hidden, Size)> =
        HIDDEN[number].iter().map(|&kind| (kind, Size::Clear)).collect();
    Campaign::link(number as u64, &layout, &hidden, ROWS)
}

/// A file as columns by name.
struct Columns {
    names: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Columns {
    fn read(csv: &str) -> Self {
        let split = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<String>>();
        let mut lines = csv.lines().map(split);
        Self { names: lines.next().unwrap_or_default(), rows: lines.collect() }
    }

    fn change(&mut self, name: &str, change: impl Fn(f64) -> f64) {
        let Some(at) = self.names.iter().position(|other| other == name) else { return };
        for row in &mut self.rows {
            if let Ok(value) = row[at].parse::<f64>() {
                row[at] = change(value).to_string();
            }
        }
    }

    fn change_both(&mut self, names: [&str; 2], change: impl Fn(f64) -> f64) {
        names.into_iter().for_each(|name| self.change(name, &change));
    }

    fn exchange(&mut self, a: &str, b: &str) {
        let at = |name: &str| self.names.iter().position(|other| other == name).unwrap();
        let (a, b) = (at(a), at(b));
        self.rows.iter_mut().for_each(|row| row.swap(a, b));
    }

    fn csv(&self) -> String {
        let lines = [&self.names].into_iter().chain(&self.rows).map(|row| row.join(","));
        lines.map(|line| line + "\n").collect()
    }
}

/// An angle from -π to π.
fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

type Transformation = (&'static str, fn(&mut Columns));

const TRANSFORMATIONS: [Transformation; 7] = [
    ("coordinates moved", |columns| {
        columns.change_both(["tx_x_m", "rx_x_m"], |m| m + 1234.5);
        columns.change_both(["tx_y_m", "rx_y_m"], |m| m - 777.25);
    }),
    ("coordinates mirrored", |columns| {
        columns.change_both(["tx_x_m", "rx_x_m"], |m| -m);
        columns.change_both(["tx_heading_rad", "rx_heading_rad"], |rad| wrapped(PI - rad));
    }),
    ("coordinates turned by a quarter", |columns| {
        for [x, y] in [["tx_x_m", "tx_y_m"], ["rx_x_m", "rx_y_m"]] {
            columns.exchange(x, y);
            columns.change(x, |m| -m);
        }
        columns.change_both(["tx_heading_rad", "rx_heading_rad"], |rad| wrapped(rad + FRAC_PI_2));
    }),
    ("times from elsewhere", |columns| columns.change("time_s", |s| s + 50_000.125)),
    ("nodes renumbered", |columns| {
        columns.change_both(["tx", "rx"], |node| 20.0 + (node * 7.0).rem_euclid(23.0));
    }),
    ("rows shuffled", |columns| {
        // Strides that share no factor with the number of rows come past each once.
        let n = columns.rows.len();
        let stride = (n / 3..n).find(|stride| (2..=*stride).all(|k| n % k != 0 || stride % k != 0));
        let stride = stride.unwrap();
        columns.rows = (0..n).map(|k| columns.rows[k * stride % n].clone()).collect();
    }),
    ("a constant column", |columns| {
        columns.names.push("mast".to_owned());
        columns.rows.iter_mut().for_each(|row| row.push("7".to_owned()));
    }),
];

fn found(csv: &str, config: &str) -> Diagnosis {
    let (model, table) = (model(config), measurements(csv));
    diagnosed(&Request::new(&model, &table))
}

/// The numbers of what was accepted.
fn estimates(diagnosis: &Diagnosis) -> BTreeMap<String, f64> {
    let accepted = diagnosis.candidates.iter().filter(|candidate| candidate.accepted);
    let numbers = accepted.flat_map(|candidate| {
        let one = |(key, parameter): (&String, &diagnose::diagnosis::Parameter)| {
            (format!("{} {key}", candidate.effect), parameter.value)
        };
        candidate.parameters.iter().map(one).collect::<Vec<_>>()
    });
    numbers.collect()
}

/// Whether the decision on an effect that one of two answers alone names was a close one.
fn is_close(effect: &str, answers: [&Diagnosis; 2]) -> bool {
    answers.into_iter().any(|answer| {
        let n = answer.candidates.iter().filter(|other| other.untestable.is_none()).count() as f64;
        let of_effect = answer.candidates.iter().filter(|other| other.effect == effect);
        of_effect
            .map(|one| n * one.p_value)
            .any(|p_value| (0.5 * FAMILY_ERROR..2.0 * FAMILY_ERROR).contains(&p_value))
    })
}

fn accepted(answer: &Diagnosis) -> Vec<&str> {
    let accepted = answer.candidates.iter().filter(|candidate| candidate.accepted);
    accepted.map(|candidate| candidate.effect.as_str()).collect()
}

/// How two answers differ, if they do.
fn difference(one: &Diagnosis, other: &Diagnosis) -> Option<String> {
    let names = [one, other].map(accepted);
    if names[0] != names[1] {
        let only = |a: usize, b: usize| {
            names[a].iter().filter(|name| !names[b].contains(name)).copied().collect::<Vec<_>>()
        };
        let differing = [only(0, 1), only(1, 0)].concat();
        let are_close = differing.iter().all(|effect| is_close(effect, [one, other]));
        return (!are_close).then(|| format!("{:?}, then {:?}", names[0], names[1]));
    }
    let [before, after] = [one, other].map(estimates);
    before.iter().find_map(|(key, value)| {
        let now = after.get(key).copied().unwrap_or(f64::NAN);
        // Not a number is no agreement.
        let is_same = (now - value).abs() <= SAME * value.abs().max(1.0);
        (!is_same).then(|| format!("{key}: {value}, then {now}"))
    })
}

/// The failures of a campaign under all exact transformations at once; where there are any, of each by itself.
fn exact_failures(number: usize) -> Vec<String> {
    let campaign = campaign(number);
    let base = found(&campaign.csv, &campaign.config_toml);
    let differs = |transformations: &[Transformation]| {
        let mut columns = Columns::read(&campaign.csv);
        transformations.iter().for_each(|(_, change)| change(&mut columns));
        difference(&base, &found(&columns.csv(), &campaign.config_toml))
    };
    let Some(together) = differs(&TRANSFORMATIONS) else { return Vec::new() };
    let alone = TRANSFORMATIONS.iter().filter_map(|transformation| {
        Some(format!("{}: {}", transformation.0, differs(&[*transformation])?))
    });
    let all = [format!("all together: {together}")].into_iter().chain(alone);
    all.map(|text| format!("{:?}: {text}", HIDDEN[number])).collect()
}

#[test]
fn transformations_that_change_nothing_change_no_answer() {
    let failures: Vec<String> = (0..HIDDEN.len()).flat_map(exact_failures).collect();
    assert!(failures.is_empty(), "{failures:#?}");
}

/// By how much the transmit power of a configuration is changed, either way (dB).
const GAIN_DB: f64 = 30.0;
/// What else is estimated is the same within this share of its interval: the search takes another way.
const SAME_OF_INTERVAL: f64 = 0.25;

/// The configuration with another transmit power.
fn with_power(config: &str, by_db: f64) -> String {
    let line = |line: &str| match line.strip_prefix("tx_power_dbm = ") {
        Some(power) => format!("tx_power_dbm = {}\n", power.parse::<f64>().unwrap() + by_db),
        None => format!("{line}\n"),
    };
    config.lines().map(line).collect()
}

/// A parameter of an accepted effect: its estimate, and the ends of its interval.
fn parameter(answer: &Diagnosis, effect: &str, key: &str) -> Option<[f64; 3]> {
    let found = answer.candidates.iter().find(|one| one.accepted && one.effect == effect)?;
    found.parameters.get(key).map(|it| [it.value, it.low, it.high])
}

/// How the answers to a campaign by models with too weak and too strong a transmitter differ beyond the gain, and how the gains are not
/// what they should be.
fn gain_failures(number: usize) -> Vec<String> {
    const GAIN: [&str; 2] = ["system-gain", "gain_db"];
    let campaign = campaign(number);
    let [weak, strong] = [-GAIN_DB, GAIN_DB]
        .map(|by_db| found(&campaign.csv, &with_power(&campaign.config_toml, by_db)));
    let mut failures = Vec::new();
    let names = [&weak, &strong].map(accepted);
    let either = names.iter().flatten().copied();
    let differing: Vec<&str> =
        either.filter(|name| names.iter().any(|names| !names.contains(name))).collect();
    if !differing.iter().all(|effect| is_close(effect, [&weak, &strong])) {
        failures.push(format!("{:?}, then {:?}", names[0], names[1]));
    }
    match [&weak, &strong].map(|answer| parameter(answer, GAIN[0], GAIN[1])) {
        [Some([of_weak, low, high]), Some([of_strong, ..])] => {
            let is_same = (of_weak - of_strong - 2.0 * GAIN_DB).abs() <= high - low;
            if !is_same {
                failures.push(format!("a gain of {of_weak} dB, then of {of_strong} dB"));
            }
        }
        gains => failures.push(format!("gains {gains:?}")),
    }
    for one in weak.candidates.iter().filter(|one| one.accepted && one.effect != GAIN[0]) {
        for (key, it) in &one.parameters {
            let now = parameter(&strong, &one.effect, key).map(|[value, ..]| value);
            let most = SAME_OF_INTERVAL * (it.high - it.low);
            if now.is_some_and(|now| most < (now - it.value).abs()) {
                failures.push(format!("{} {key}: {}, then {now:?}", one.effect, it.value));
            }
        }
    }
    failures.into_iter().map(|text| format!("{:?}: {text}", HIDDEN[number])).collect()
}

#[test]
fn another_transmit_power_changes_the_gain_and_nothing_else() {
    // The others have a constant of their own, which takes up that of all readings.
    let has_no_constant = |number: &usize| {
        ![Hidden::Temperature, Hidden::Sinusoid].iter().any(|kind| HIDDEN[*number].contains(kind))
    };
    // Every other one: each takes two diagnoses, and differs from its neighbour in what is hidden alone.
    let numbers = (0..HIDDEN.len()).filter(has_no_constant).step_by(2);
    let failures: Vec<String> = numbers.flat_map(gain_failures).collect();
    assert!(failures.is_empty(), "{failures:#?}");
}
