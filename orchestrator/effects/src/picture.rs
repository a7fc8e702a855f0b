//! What an effect looks like: one curve, over whatever it depends on most.

use super::DECIMALS;
use super::Listed;
use numbers::format::trimmed;
use numbers::statistics::range;
use physics::catalogue::Catalogue;
use physics::effect::{self, Effect};
use physics::link::{Covariates, End, Link, Scene, channel_hz};
use physics::reception::Curve as _;
use physics::reception::table::Table;
use physics::scatter::{Moment, PairBlock, Renewal};
use proto::ids::MoteId;
use proto::site::{Foliage, Site, Wall};
use report::svg::{Axis, Chart};
use schemars::JsonSchema;
use serde::Serialize;

/// One curve.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Picture {
    /// What is on the horizontal axis, with the unit.
    pub x: &'static str,
    /// What is on the vertical axis, with the unit.
    pub y: &'static str,
    /// The surroundings of the example.
    #[serde(rename = "where")]
    pub where_: &'static str,
    /// The curve.
    pub points: Vec<[f64; 2]>,
}

/// The style of a picture that is a file of its own.
const STYLE: &str = "text{font:13px sans-serif;fill:#333}path{fill:none;stroke:#999;stroke-width:1}\
                     .curve{stroke:#06c;stroke-width:2}";

/// How many points a curve has.
const N: usize = 240;

/// A number that an effect may depend on: its name, its range, and the link that has it.
struct CurveAxis {
    x: &'static str,
    where_: &'static str,
    range: [f64; 2],
    set: fn(&mut LinkState, f64),
}

/// What describes the link of an example.
struct LinkState {
    distance_m: f64,
    temperature_c: f64,
    hours: f64,
    heading_rad: f64,
    channel: u8,
    speed_mps: f64,
}

/// In the order of preference, where an effect depends on several as much.
const SWEEPS: [CurveAxis; 6] = [
    CurveAxis {
        x: "distance (m)",
        where_: "antennas 1.5 m high; a wall 2 m high and a robot at 10 m, trees from 20 to 30 m",
        range: [1.0, 60.0],
        set: |row, x| row.distance_m = x,
    },
    CurveAxis {
        x: "temperature (°C)",
        where_: "both ends as warm",
        range: [-10.0, 60.0],
        set: |row, x| row.temperature_c = x,
    },
    CurveAxis {
        x: "time (h)",
        where_: "from the start",
        range: [0.0, 10.0],
        set: |row, x| row.hours = x,
    },
    CurveAxis {
        x: "bearing of the receiver seen from the sender (rad)",
        where_: "the receiver's heading is not known",
        range: [-std::f64::consts::PI, std::f64::consts::PI],
        set: |row, x| row.heading_rad = -x,
    },
    CurveAxis {
        x: "channel",
        where_: "IEEE 802.15.4, 11 to 26",
        range: [11.0, 26.0],
        set: |row, x| row.channel = x.round() as u8,
    },
    CurveAxis {
        x: "relative speed (m/s)",
        where_: "frames of 4.3 ms",
        range: [0.0, 30.0],
        set: |row, x| row.speed_mps = x,
    },
];

impl Picture {
    /// The picture of an effect with the keys of its example.
    pub(super) fn from_effect(listed: &Listed) -> Option<Self> {
        if listed.of != "radio" {
            return None;
        }
        let checked = checked(&listed.keys())?;
        let effect = effect::build(&checked, &Catalogue::built_in().effects).pop()?;
        let swept = |value: fn(&dyn Effect, &Link<'_>) -> f64, y: &'static str| {
            SWEEPS
                .iter()
                .map(|sweep| (sweep, swept(&*effect, sweep, value)))
                .fold(None, |best: Option<(&CurveAxis, Vec<[f64; 2]>)>, (sweep, points)| match best
                {
                    Some((_, ref before)) if spread(&points) <= spread(before) * 1.01 => best,
                    _ => Some((sweep, points)),
                })
                .filter(|(_, points)| 0.0 < spread(points))
                .map(|(sweep, points)| Self { x: sweep.x, y, where_: sweep.where_, points })
        };
        swept(|effect, link| effect.contribution_db(link), "added to the received power (dB)")
            .or_else(|| swept(|effect, link| effect.loss(link), "probability of loss"))
            .or_else(|| drawn(&*effect))
            .or_else(|| reception(&*effect))
            .or_else(|| reading(&*effect))
            .or_else(|| {
                let sweep = &SWEEPS[0];
                let points =
                    self::swept(&*effect, sweep, |effect, link| effect.contribution_db(link));
                let y = "added to the received power (dB)";
                Some(Self { x: sweep.x, y, where_: "everywhere alike", points })
            })
    }

    /// Title and surroundings.
    pub(super) fn caption(&self) -> String {
        let [low, high] = limits(&self.points);
        let (first, last) = (self.points[0][0], self.points[self.points.len() - 1][0]);
        format!(
            "Picture: {}, {} to {}, over {} from {} to {} ({})",
            self.y,
            trimmed(low, DECIMALS),
            trimmed(high, DECIMALS),
            self.x,
            trimmed(first, DECIMALS),
            trimmed(last, DECIMALS),
            self.where_
        )
    }

    /// The curve as a line of blocks.
    pub(super) fn sparkline(&self, width: usize) -> String {
        const BLOCKS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
        let [low, high] = limits(&self.points);
        (0..width)
            .map(|i| {
                let [_, y] =
                    self.points[i * (self.points.len() - 1) / width.max(2).saturating_sub(1)];
                let share = if low < high { (y - low) / (high - low) } else { 0.5 };
                BLOCKS[((share * 8.0) as usize).min(7)]
            })
            .collect()
    }

    /// The curve as a picture of its own.
    #[must_use]
    pub fn svg(&self, title: &str) -> String {
        let [low, high] = limits(&self.points);
        let margin = 0.05 * (high - low).max(0.1);
        let (first, last) = (self.points[0][0], self.points[self.points.len() - 1][0]);
        let mut chart = Chart::new(
            Axis::new(self.x, first, last),
            Axis::new(self.y, low - margin, high + margin),
            640.0,
            320.0,
        );
        chart.line("curve", self.points.iter().map(|&point| Some(point)));
        chart.finish_file("effect", title, &self.caption(), STYLE)
    }
}

fn limits(points: &[[f64; 2]]) -> [f64; 2] {
    range(points.iter().map(|point| point[1]))
}

fn spread(points: &[[f64; 2]]) -> f64 {
    let [low, high] = limits(points);
    high - low
}

/// The table of an effect with these keys, checked.
fn checked(keys: &str) -> Option<Vec<toml::Table>> {
    let node = proto::config::parse(keys).ok()?;
    let mut problems = Vec::new();
    let catalogue = Catalogue::built_in();
    let (spec, lists) = (&effect::SPEC, catalogue.lists());
    let table = proto::config::check(&node, "effect[0]", spec, &lists, &mut problems).table;
    let tables = vec![table];
    effect::check(&tables, "effect", &catalogue.effects, &mut problems);
    problems.is_empty().then_some(tables)
}

/// The place of the examples.
fn site() -> Site {
    let wall =
        Wall { from_m: [10.0, -2.0], to_m: [10.0, 2.0], height_m: Some(2.0), material: None };
    let polygon_m = vec![[20.0, -5.0], [30.0, -5.0], [30.0, 5.0], [20.0, 5.0]];
    let foliage = Foliage { polygon_m, height_m: None };
    Site { wall: vec![wall], foliage: vec![foliage], ..Site::default() }
}

/// A value over a sweep.
fn swept(
    effect: &dyn Effect,
    sweep: &CurveAxis,
    value: fn(&dyn Effect, &Link<'_>) -> f64,
) -> Vec<[f64; 2]> {
    let site = site();
    let [low, high] = sweep.range;
    (0..N)
        .map(|i| {
            let x = low + (high - low) * i as f64 / (N - 1) as f64;
            let mut row = LinkState {
                distance_m: 8.0,
                temperature_c: 20.0,
                hours: 0.0,
                heading_rad: 0.0,
                channel: 18,
                speed_mps: 0.0,
            };
            (sweep.set)(&mut row, x);
            let columns = [
                ("temperature_c".to_owned(), row.temperature_c),
                ("relative_speed_mps".to_owned(), row.speed_mps),
            ];
            let mut sender = End::new(MoteId(0), [0.0, 0.0, 1.5]);
            sender.heading_rad = Some(row.heading_rad);
            let receiver = End::new(MoteId(1), [row.distance_m, 0.0, 1.5]);
            let agents = [sender, receiver, End::new(MoteId(2), [10.0, 0.0, 1.5])];
            let scene = Scene {
                site: Some(&site),
                agents: &agents,
                covariates: Covariates::Row(&columns),
                ..Scene::default()
            };
            let link = Link {
                sender,
                receiver,
                distance_m: row.distance_m,
                channel: Some(row.channel),
                frequency_hz: channel_hz(row.channel),
                time_ns: (row.hours * 3.6e12) as u64,
                scene: &scene,
            };
            [x, value(effect, &link)]
        })
        .collect()
}

/// Values that are drawn: over the way for what changes with it, over links or frames otherwise.
fn drawn(effect: &dyn Effect) -> Option<Picture> {
    let scatter = effect.scatter()?;
    let value = |i: usize, way_m: f64, channel: Option<u8>, other: u32| {
        let sent_ns = 1_000_000 * i as u64;
        // Three hours in all.
        let period_ns = match scatter.renewal {
            Renewal::Time { .. } => i as u64 * (10_800_000_000_000 / N as u64),
            _ => 0,
        };
        let at = Moment { period_ns, sent_ns, way_m, channel };
        scatter.value_db(
            &mut PairBlock::new(1, MoteId(0), MoteId(other), 0),
            MoteId(0),
            MoteId(other),
            at,
        )
    };
    let (x, where_): (_, &'static str) = match scatter.renewal {
        Renewal::Coherence { .. } => ("way of both ends (m)", "one link, one draw of many"),
        Renewal::Place { .. } => ("channel", "one link, one draw of many"),
        Renewal::Frame => ("frame", "one link, one draw of many"),
        Renewal::Time { .. } => ("time (s)", "one link, one draw of many"),
        Renewal::Frozen | Renewal::Period => ("node", "one draw of many"),
    };
    let points = (0..N)
        .map(|i| match scatter.renewal {
            Renewal::Coherence { .. } => {
                let way_m = 60.0 * i as f64 / N as f64;
                [way_m, value(0, way_m, None, 1)]
            }
            Renewal::Place { .. } => {
                let channel = 11 + (16 * i / N) as u8;
                [f64::from(channel), value(0, 0.0, Some(channel), 1)]
            }
            Renewal::Frame => [i as f64, value(i, 0.0, None, 1)],
            Renewal::Time { .. } => [10_800.0 * i as f64 / N as f64, value(i, 0.0, None, 1)],
            Renewal::Frozen | Renewal::Period => {
                let node = (40 * i / N) as u32 + 1;
                [f64::from(node), value(0, 0.0, None, node)]
            }
        })
        .collect();
    Some(Picture { x, y: "added to the received power (dB)", where_, points })
}

const POWERS_DBM: [f64; 2] = [-100.0, -20.0];

fn power_dbm(i: usize, [low, high]: [f64; 2]) -> f64 {
    low + (high - low) * i as f64 / (N - 1) as f64
}

fn plain<T>(use_link: impl FnOnce(&Link<'_>) -> T) -> T {
    let scene = Scene::default();
    use_link(&Link {
        sender: End::new(MoteId(0), [0.0, 0.0, 1.5]),
        receiver: End::new(MoteId(1), [8.0, 0.0, 1.5]),
        distance_m: 8.0,
        channel: Some(18),
        frequency_hz: channel_hz(18),
        time_ns: 0,
        scene: &scene,
    })
}

/// Reception over power, where the effect changes that.
fn reception(effect: &dyn Effect) -> Option<Picture> {
    let shift_db = plain(|link| effect.curve_shift_db(link));
    if effect.curve().is_none() && shift_db == 0.0 {
        return None;
    }
    let table = Table::dust();
    let points = (0..N)
        .map(|i| {
            let rssi_dbm = power_dbm(i, [-100.0, -75.0]);
            let at_dbm = rssi_dbm - shift_db;
            let probability = match effect.curve() {
                Some(curve) => curve.reception_probability(at_dbm),
                None => table.reception_probability(at_dbm),
            };
            [rssi_dbm, probability]
        })
        .collect();
    let (x, y) = ("received power (dBm)", "probability of reception");
    Some(Picture { x, y, where_: "all links alike", points })
}

/// What the register reads over power, where the effect changes that.
fn reading(effect: &dyn Effect) -> Option<Picture> {
    let points: Vec<[f64; 2]> = (0..N)
        .map(|i| {
            let rssi_dbm = power_dbm(i, POWERS_DBM);
            [rssi_dbm, plain(|link| effect.register_dbm(link, rssi_dbm))]
        })
        .collect();
    if points.iter().all(|[x, y]| x == y) {
        return None;
    }
    let (x, y) = ("received power (dBm)", "reading of the register (dBm)");
    Some(Picture { x, y, where_: "all links alike", points })
}
