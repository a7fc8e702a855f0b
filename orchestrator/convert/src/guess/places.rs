//! Positions: which columns have them, in which unit, whose they are.

use super::profile::Profile;
use super::times::quoted;
use super::words::shares_group;
use super::{Asked, DraftInput, Log};
use crate::units::Unit;
use std::collections::BTreeMap;

/// Whose a position is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Tx,
    Rx,
}

/// The columns of a position: x, y and z, or latitude, longitude and height.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Place {
    pub x: Option<usize>,
    pub y: Option<usize>,
    pub z: Option<usize>,
    pub is_geographic: bool,
}

impl Place {
    pub(super) fn columns(&self) -> impl Iterator<Item = usize> {
        [self.x, self.y, self.z].into_iter().flatten()
    }
}

const LAT: &[&str] = &["lat", "latitude"];
const LON: &[&str] = &["lon", "lng", "long", "longitude"];
const HEIGHT: &[&str] = &["z", "height", "alt", "altitude"];
/// Words of what has three components and is no position.
pub(super) const NO_PLACE: &[&str] = &[
    "velocity",
    "vel",
    "v",
    "twist",
    "linear",
    "angular",
    "acc",
    "accel",
    "acceleration",
    "orientation",
    "quaternion",
    "quat",
    "q",
    "gyro",
    "mag",
    "imu",
    "covariance",
    "error",
    "err",
    "rate",
    "std",
    "payload",
    "force",
    "torque",
    "cov",
    "dop",
    "accuracy",
];

/// The position among columns that `fits` lets through.
pub(super) fn find(log: &Log, fits: impl Fn(&Profile) -> bool) -> Option<Place> {
    let score = |profile: &Profile, words: &[&str], bonus: &[&str]| {
        let is_number =
            profile.is_numeric() && !profile.has(NO_PLACE) && profile.has(words) && fits(profile);
        if is_number {
            2 + i32::from(profile.has(bonus)) - profile.words.len() as i32 / 4
        } else {
            0
        }
    };
    let best =
        |words: &[&str]| log.best(|profile| score(profile, words, &["position", "pos", "pose"]));
    let (lat, lon) = (best(LAT), best(LON));
    if let (Some(lat), Some(lon)) = (lat, lon) {
        return Some(Place { x: Some(lat), y: Some(lon), z: None, is_geographic: true });
    }
    let (x, y) = (best(&["x"]), best(&["y"]));
    x.zip(y)?;
    Some(Place { x, y, z: best(HEIGHT), is_geographic: false })
}

/// Whether a column is of one end of a link, by its name or by its group.
///
/// * `label`: the column that names the nodes of this end.
pub(super) fn is_of(
    log: &Log,
    profile: &Profile,
    words: &[&str],
    digit: &str,
    label: Option<usize>,
) -> bool {
    profile.has(words)
        || profile.words.last().is_some_and(|last| last == digit)
        || label.is_some_and(|label| shares_group(&profile.name, &log.profile(label).name))
}

/// The unit of positions without one in their names.
///
/// * `known`: the other end's position in metres, by node, and this end's labels: nodes that stand still show the unit.
pub(super) fn unit(
    log: &Log,
    place: &Place,
    asked: &mut Asked<'_>,
    id: &'static str,
) -> (&'static str, Option<String>) {
    let columns: Vec<&Profile> = place.columns().map(|column| log.profile(column)).collect();
    if let Some(unit) = columns.iter().find_map(|profile| named(profile)) {
        return (unit.name, Some(format!("the name says {}", unit.name)));
    }
    let span = columns.iter().take(2).map(|p| p.range[2] - p.range[0]).fold(0.0, f64::max);
    let is_whole = columns.iter().all(|profile| profile.is_whole);
    if !is_whole || span < 300.0 {
        return ("m", None);
    }
    let text = format!(
        "In which unit are {}, which span {span}?",
        columns.iter().map(|profile| &*profile.name).collect::<Vec<_>>().join(", ")
    );
    let choices = [("m", "metres"), ("cm", "centimetres"), ("mm", "millimetres")];
    let likely = if span < 5000.0 { 1 } else { 2 };
    let word = asked.ask(id, text, &choices, likely);
    (Unit::named(&word).map_or("m", |unit| unit.name), None)
}

/// The unit of distances without one: the largest in which no reading is far above that of free space at 2.44 GHz and 10 dBm.
pub(super) fn unit_by_readings(distances: &[f64], readings_dbm: &[f64]) -> &'static str {
    let strongest = |unit: &&str| {
        let factor = Unit::named(unit).map_or(1.0, |unit| unit.factor("x_m"));
        let mut above: Vec<f64> = distances
            .iter()
            .zip(readings_dbm)
            .filter(|(distance, _)| 0.0 < **distance)
            .map(|(distance, reading)| {
                // Friis: 20 lg(4 π d / λ), with λ = c / f.
                let loss_db = 40.2 + 20.0 * libm::log10(distance * factor);
                reading - (10.0 - loss_db)
            })
            .filter(|above_db| above_db.is_finite())
            .collect();
        above.sort_by(f64::total_cmp);
        above.get(above.len() * 9 / 10).is_none_or(|above_db| *above_db <= 0.0)
    };
    ["m", "cm", "mm"].iter().find(|unit| strongest(unit)).copied().unwrap_or("m")
}

/// The unit of length that the name of a column has.
pub(super) fn named(profile: &Profile) -> Option<&'static Unit> {
    let is_length = |unit: &&Unit| unit.fits("x_m");
    profile.unit.filter(is_length).or_else(|| {
        let last =
            profile.words.iter().rev().find_map(|word| Unit::named(word).filter(is_length))?;
        // A bare m may be anything.
        (last.name != "m").then_some(last)
    })
}

/// The source of a coordinate, as TOML.
pub(super) fn source(profile: &Profile, unit: &str) -> String {
    let stated = Unit::of_column(&profile.name)
        .filter(|unit| unit.fits("x_m"))
        .map_or("m", |unit| unit.name);
    if stated == unit {
        quoted(&profile.name)
    } else {
        format!("{{ column = {}, unit = \"{unit}\" }}", quoted(&profile.name))
    }
}

/// Adds the coordinates of a position with a prefix (`tx_`).
pub(super) fn add(
    log: &Log,
    input: &mut DraftInput,
    place: &Place,
    prefix: &str,
    unit: &str,
    reason: &str,
) {
    for (axis, column) in [("x_m", place.x), ("y_m", place.y), ("z_m", place.z)] {
        if let Some(column) = column {
            input.add(&format!("{prefix}{axis}"), source(log.profile(column), unit), reason);
        }
    }
}

/// Where each node stands, by its label: the median of each coordinate (m), and how far its positions scatter (m).
pub(super) type Nodes = BTreeMap<String, ([f64; 2], f64)>;

/// The places of nodes at one end.
pub(super) fn nodes(log: &Log, label: usize, place: &Place, unit: &str) -> Nodes {
    let factor = Unit::named(unit).map_or(1.0, |unit| unit.factor("x_m"));
    let mut all: BTreeMap<String, [Vec<f64>; 2]> = BTreeMap::new();
    let (Some(x), Some(y)) = (place.x, place.y) else { return Nodes::new() };
    let (xs, ys) = (log.sample.numbers(x), log.sample.numbers(y));
    for row in 0..log.sample.rows.len() {
        if xs[row].is_finite() && ys[row].is_finite() {
            let own = all.entry(log.sample.field(row, label).to_owned()).or_default();
            own[0].push(xs[row] * factor);
            own[1].push(ys[row] * factor);
        }
    }
    let median = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        let quantile = |share: f64| values[((values.len() - 1) as f64 * share) as usize];
        (quantile(0.5), quantile(0.9) - quantile(0.1))
    };
    all.into_iter()
        .map(|(name, [mut x, mut y])| {
            let ((x, x_spread), (y, y_spread)) = (median(&mut x), median(&mut y));
            (name, ([x, y], x_spread.max(y_spread)))
        })
        .collect()
}

/// By what the positions of `other` must be multiplied to be those of the same nodes in `known`, if they are a power of ten apart.
pub(super) fn scale(known: &Nodes, other: &Nodes) -> Option<f64> {
    let mut ratios: Vec<f64> = known
        .iter()
        .filter_map(|(name, (place, _))| Some((place, &other.get(name)?.0)))
        .flat_map(|(a, b)| [a[0] / b[0], a[1] / b[1]])
        .filter(|ratio| ratio.is_finite() && 0.0 < *ratio)
        .collect();
    ratios.sort_by(f64::total_cmp);
    let median = *ratios.get(ratios.len() / 2)?;
    let is_near = |ratio: &&f64| (**ratio / median - 1.0).abs() < 0.02;
    let is_shared = 3 * ratios.len() <= 4 * ratios.iter().filter(is_near).count();
    let power = [1.0, 0.01, 0.001, 100.0, 1000.0]
        .into_iter()
        .find(|power| (median / power - 1.0).abs() < 0.05);
    power.filter(|_| is_shared && 3 <= ratios.len())
}

/// Rows in which the two ends stand where the other one's node stands; how many rows tell, and the first of the rows (from 1).
pub(super) fn swapped(
    log: &Log,
    labels: [usize; 2],
    places: [&Place; 2],
    units: [&str; 2],
) -> Option<(usize, usize, usize)> {
    let factor = |unit: &str| Unit::named(unit).map_or(1.0, |unit| unit.factor("x_m"));
    let columns = |place: &Place, unit: &str| {
        let (x, y) = place.x.zip(place.y)?;
        let scaled = |column| {
            log.sample.numbers(column).into_iter().map(|v| v * factor(unit)).collect::<Vec<f64>>()
        };
        Some([scaled(x), scaled(y)])
    };
    let [tx, rx] = [columns(places[0], units[0])?, columns(places[1], units[1])?];
    // Where each node stands, over both ends: what most rows say.
    let mut all: BTreeMap<&str, [Vec<f64>; 2]> = BTreeMap::new();
    for row in 0..log.sample.rows.len() {
        for (label, values) in [(labels[0], &tx), (labels[1], &rx)] {
            if values[0][row].is_finite() && values[1][row].is_finite() {
                let own = all.entry(log.sample.field(row, label)).or_default();
                own[0].push(values[0][row]);
                own[1].push(values[1][row]);
            }
        }
    }
    let median = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let stands: BTreeMap<&str, [f64; 2]> = all
        .into_iter()
        .map(|(name, [mut x, mut y])| (name, [median(&mut x), median(&mut y)]))
        .collect();
    let is_at = |values: &[Vec<f64>; 2], row: usize, label: usize| {
        let place = stands.get(log.sample.field(row, label))?;
        Some(libm::hypot(values[0][row] - place[0], values[1][row] - place[1]) < 0.5)
    };
    let (mut n_told, mut n_swapped, mut first) = (0, 0, 0);
    for row in 0..log.sample.rows.len() {
        let (Some(right_tx), Some(right_rx)) =
            (is_at(&tx, row, labels[0]), is_at(&rx, row, labels[1]))
        else {
            continue;
        };
        let (Some(other_tx), Some(other_rx)) =
            (is_at(&tx, row, labels[1]), is_at(&rx, row, labels[0]))
        else {
            continue;
        };
        n_told += usize::from(right_tx && right_rx || other_tx && other_rx);
        if other_tx && other_rx && !right_tx && !right_rx {
            n_swapped += 1;
            if first == 0 {
                first = row + 1;
            }
        }
    }
    (0 < n_swapped).then_some((n_swapped, n_told, first))
}

/// Coordinates of a node that stands still, some of which are 100 or 1000 times the others: rows, the first of them (from 1), the factor.
pub(super) fn mixed_units(log: &Log, label: usize, column: usize) -> Option<(usize, usize, f64)> {
    let values = log.sample.numbers(column);
    let mut by_node: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for (row, &value) in values.iter().enumerate().filter(|(_, value)| value.is_finite()) {
        by_node.entry(log.sample.field(row, label)).or_default().push(value);
    }
    let stands: BTreeMap<&str, f64> = by_node
        .into_iter()
        .map(|(name, mut values)| {
            values.sort_by(f64::total_cmp);
            (name, values[values.len() / 2])
        })
        .collect();
    [100.0, 1000.0, 0.01, 0.001].into_iter().find_map(|factor| {
        let is_off = |row: &usize| {
            let Some(&usual) = stands.get(log.sample.field(*row, label)) else { return false };
            usual != 0.0 && (values[*row] / (usual * factor) - 1.0).abs() < 0.02
        };
        let mut rows = (0..values.len()).filter(is_off);
        let first = rows.next()?;
        Some((1 + rows.count(), first + 1, factor))
    })
}
