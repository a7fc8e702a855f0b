//! Where the nodes of a link campaign are, how they move, and which frames they send.

use super::draws::Draws;
use super::geometry::{Point, distance};
use super::hidden::Hidden;
use super::radio::friis_db;
use std::fmt::Write as _;

/// The model as configured, to which something is hidden.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Base {
    /// Free space.
    Friis,
    /// Free space up to 1 m, from there on this exponent.
    LogDistance(f64),
}

impl Base {
    /// Gain of a path (dB).
    pub(crate) fn gain_db(self, distance_m: f64, channel: u8) -> f64 {
        match self {
            Self::Friis => friis_db(distance_m, channel),
            Self::LogDistance(exponent) => {
                friis_db(distance_m.min(1.0), channel)
                    - 10.0 * exponent * distance_m.max(1.0).log10()
            }
        }
    }
}

/// What a link campaign is like.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Nodes that stay where they are. They report no heading.
    pub n_fixed: usize,
    /// Nodes that drive from waypoint to waypoint, facing where they go.
    pub n_moving: usize,
    /// Extent of the place, east and north (m).
    pub extent_m: [f64; 2],
    /// How long it lasts (s).
    pub duration_s: f64,
    /// Standard deviation of the noise of every frame (dB).
    pub noise_db: f64,
    /// The model as configured.
    pub base: Base,
    /// Mapped walls.
    pub n_walls: usize,
    /// Greatest speed (m/s).
    pub speed_mps: f64,
}

impl Layout {
    /// 12 fixed and 6 moving nodes, 60 × 40 m, two hours, 2 dB of noise, three walls, free space.
    #[must_use]
    pub const fn standard() -> Self {
        Self {
            n_fixed: 12,
            n_moving: 6,
            extent_m: [60.0, 40.0],
            duration_s: 7200.0,
            noise_db: 2.0,
            base: Base::Friis,
            n_walls: 3,
            speed_mps: 20.0,
        }
    }

    /// Another one, drawn from a seed.
    #[must_use]
    pub fn drawn(seed: u64) -> Self {
        let mut draws = Draws::new(seed, "layout");
        Self {
            n_fixed: 8 + draws.below(9),
            n_moving: 3 + draws.below(6),
            extent_m: [draws.between(40.0, 80.0).round(), draws.between(30.0, 60.0).round()],
            duration_s: draws.between(3600.0, 10_800.0).round(),
            noise_db: (draws.between(1.0, 3.0) * 10.0).round() / 10.0,
            base: if draws.chance(0.5) {
                Base::Friis
            } else {
                Base::LogDistance((draws.between(2.0, 3.2) * 10.0).round() / 10.0)
            },
            n_walls: draws.below(5),
            speed_mps: draws.between(10.0, 28.0).round(),
        }
    }
}

/// A frame and one who might receive it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub(crate) frame: usize,
    pub(crate) time_s: f64,
    pub(crate) tx: usize,
    pub(crate) rx: usize,
    pub(crate) channel: u8,
    pub(crate) tx_at: At,
    pub(crate) rx_at: At,
    pub(crate) temperature_c: f64,
    pub(crate) humidity_pct: f64,
    pub(crate) dust_ugm3: f64,
}

impl Row {
    /// Distance between the antennas (m).
    pub(crate) fn distance_m(&self) -> f64 {
        self.planar_m().hypot(self.tx_at.z_m - self.rx_at.z_m)
    }

    /// Distance between the antennas over ground (m).
    pub(crate) fn planar_m(&self) -> f64 {
        distance(self.tx_at.plane_m, self.rx_at.plane_m)
    }
}

/// Where a node is at a moment, all as written in the file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct At {
    pub(crate) plane_m: Point,
    pub(crate) z_m: f64,
    /// Direction it faces; unknown of those that never move.
    pub(crate) heading_rad: Option<f64>,
    pub(crate) speed_mps: f64,
}

/// A mapped wall.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wall {
    pub(crate) from_m: Point,
    pub(crate) to_m: Point,
}

/// All of a campaign but the radio.
#[derive(Clone, Debug)]
pub(crate) struct World {
    pub(crate) n_fixed: usize,
    pub(crate) n_nodes: usize,
    pub(crate) extent_m: [f64; 2],
    pub(crate) duration_s: f64,
    pub(crate) base: Base,
    pub(crate) walls: Vec<Wall>,
    pub(crate) foliage: Vec<Vec<Point>>,
    pub(crate) rows: Vec<Row>,
    /// Per frame, where all nodes are.
    pub(crate) frames: Vec<Vec<At>>,
}

impl World {
    /// Of a layout, with what these effects need, in as many whole frames as make up at most `n_rows`.
    pub(crate) fn new(seed: u64, layout: &Layout, hidden: &[Hidden], n_rows: usize) -> Self {
        let n_nodes = layout.n_fixed + layout.n_moving;
        let n_frames = n_rows / (n_nodes - 1);
        let mut draws = Draws::new(seed, "places");
        let fixed = fixed_places(&mut draws, layout);
        let mut draws = Draws::new(seed, "heights");
        let heights: Vec<f64> = (0..n_nodes)
            .map(|node| {
                let highest = if node < layout.n_fixed { 3.0 } else { 1.5 };
                rounded(draws.between(0.4, highest), 2)
            })
            .collect();
        let mut times = Draws::new(seed, "times");
        let moments: Vec<f64> = (0..n_frames)
            .map(|k| {
                let slot_s = layout.duration_s / n_frames as f64;
                rounded((k as f64 + times.uniform()) * slot_s, 2)
            })
            .collect();
        let paths: Vec<Path> = (0..layout.n_moving)
            .map(|k| Path::new(&mut Draws::new(seed, &format!("path {k}")), layout))
            .collect();
        let frames: Vec<Vec<At>> = moments
            .iter()
            .map(|&time_s| {
                let still = fixed.iter().map(|&plane_m| At {
                    plane_m,
                    z_m: 0.0,
                    heading_rad: None,
                    speed_mps: 0.0,
                });
                let mut all: Vec<At> =
                    still.chain(paths.iter().map(|path| path.place_at(time_s))).collect();
                for (at, &height_m) in all.iter_mut().zip(&heights) {
                    at.z_m = height_m;
                }
                all
            })
            .collect();
        let weather = Weather::new(&mut Draws::new(seed, "weather"), layout.duration_s);
        let mut senders = Draws::new(seed, "senders");
        let mut turns = Vec::new();
        let mut rows = Vec::with_capacity(n_frames * (n_nodes - 1));
        for (frame, &time_s) in moments.iter().enumerate() {
            if turns.is_empty() {
                turns = senders.order(n_nodes);
            }
            let tx = turns.pop().expect("just filled");
            let channel = 11 + senders.below(16) as u8;
            let [temperature_c, humidity_pct, dust_ugm3] = weather.values_at(time_s);
            let all = &frames[frame];
            rows.extend((0..n_nodes).filter(|&rx| rx != tx).map(|rx| Row {
                frame,
                time_s,
                tx,
                rx,
                channel,
                tx_at: all[tx],
                rx_at: all[rx],
                temperature_c,
                humidity_pct,
                dust_ugm3,
            }));
        }
        let mut draws = Draws::new(seed, "walls");
        let n_walls = if hidden.contains(&Hidden::Diffraction) {
            1
        } else if hidden.contains(&Hidden::WallAttenuation) {
            layout.n_walls.max(3)
        } else {
            layout.n_walls
        };
        let walls = (0..n_walls).map(|_| wall(&mut draws, layout, n_walls == 1)).collect();
        let foliage = if hidden.contains(&Hidden::Vegetation) {
            let mut draws = Draws::new(seed, "foliage");
            (0..2).map(|_| grove(&mut draws, layout)).collect()
        } else {
            Vec::new()
        };
        Self {
            n_fixed: layout.n_fixed,
            n_nodes,
            extent_m: layout.extent_m,
            duration_s: layout.duration_s,
            base: layout.base,
            walls,
            foliage,
            rows,
            frames,
        }
    }

    /// The file's text; `readings`: per row what was read (dBm), if the frame was received.
    pub(crate) fn csv(&self, readings: &[Option<f64>]) -> String {
        let mut text = String::from(
            "time_s,tx,rx,channel,tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,rssi_dbm,received,\
             tx_heading_rad,rx_heading_rad,tx_speed_mps,rx_speed_mps,temperature_c,humidity_pct,\
             dust_ugm3\n",
        );
        for (row, reading) in self.rows.iter().zip(readings) {
            let [[tx_x, tx_y], [rx_x, rx_y]] = [row.tx_at.plane_m, row.rx_at.plane_m];
            let optional = |value: Option<f64>| value.map_or(String::new(), |v| v.to_string());
            writeln!(
                text,
                "{},{},{},{},{tx_x},{tx_y},{},{rx_x},{rx_y},{},{},{},{},{},{},{},{},{},{}",
                row.time_s,
                row.tx,
                row.rx,
                row.channel,
                row.tx_at.z_m,
                row.rx_at.z_m,
                optional(*reading),
                u8::from(reading.is_some()),
                optional(row.tx_at.heading_rad),
                optional(row.rx_at.heading_rad),
                row.tx_at.speed_mps,
                row.rx_at.speed_mps,
                row.temperature_c,
                row.humidity_pct,
                row.dust_ugm3,
            )
            .expect("writing to a string");
        }
        text
    }

    /// The configuration without what is hidden. `wall_height_m`: of the walls, where they have a top.
    pub(crate) fn config(&self, tx_power_dbm: f64, wall_height_m: Option<f64>) -> String {
        let mut text = String::from("[netsim.phy]\n");
        match self.base {
            Base::Friis => text.push_str("propagation = \"friis\"\n"),
            Base::LogDistance(exponent) => {
                let _ = writeln!(text, "propagation = \"log-distance\"\nexponent = {exponent:?}");
            }
        }
        let _ = writeln!(text, "tx_power_dbm = {tx_power_dbm:?}");
        for wall in &self.walls {
            let _ = writeln!(
                text,
                "\n[[site.wall]]\nfrom_m = {:?}\nto_m = {:?}",
                wall.from_m, wall.to_m
            );
            if let Some(height_m) = wall_height_m {
                let _ = writeln!(text, "height_m = {height_m:?}");
            }
        }
        for polygon in &self.foliage {
            let _ = writeln!(text, "\n[[site.foliage]]\npolygon_m = {polygon:?}");
        }
        text
    }
}

/// A value with this many decimals.
pub(crate) fn rounded(value: f64, decimals: i32) -> f64 {
    let scale = 10_f64.powi(decimals);
    (value * scale).round() / scale
}

fn anywhere(draws: &mut Draws, layout: &Layout, margin_m: f64) -> Point {
    layout.extent_m.map(|extent_m| rounded(draws.between(margin_m, extent_m - margin_m), 2))
}

/// Places at least 4 m apart; where there is no room for so many, a little less.
fn fixed_places(draws: &mut Draws, layout: &Layout) -> Vec<Point> {
    let mut places: Vec<Point> = Vec::new();
    let (mut apart_m, mut n_refused) = (4.0, 0);
    while places.len() < layout.n_fixed {
        let place = anywhere(draws, layout, 0.5);
        if places.iter().all(|&other| apart_m <= distance(place, other)) {
            places.push(place);
            continue;
        }
        n_refused += 1;
        if n_refused == 1000 {
            (apart_m, n_refused) = (0.9 * apart_m, 0);
        }
    }
    places
}

/// A wall inside the place. A single one is long and near the middle.
fn wall(draws: &mut Draws, layout: &Layout, is_alone: bool) -> Wall {
    let margin = if is_alone { 0.4 } else { 0.15 };
    let centre = layout.extent_m.map(|extent_m| draws.between(margin, 1.0 - margin) * extent_m);
    let half_m = if is_alone { draws.between(14.0, 20.0) } else { draws.between(5.0, 12.0) };
    let (sin, cos) = draws.between(0.0, std::f64::consts::PI).sin_cos();
    let end = |sign: f64| {
        [rounded(centre[0] + sign * half_m * cos, 2), rounded(centre[1] + sign * half_m * sin, 2)]
    };
    Wall { from_m: end(-1.0), to_m: end(1.0) }
}

/// Foliage: an irregular hexagon.
fn grove(draws: &mut Draws, layout: &Layout) -> Vec<Point> {
    let centre = anywhere(draws, layout, 8.0);
    (0..6)
        .map(|k| {
            let radius_m = draws.between(4.0, 8.0);
            let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 6.0).sin_cos();
            [rounded(centre[0] + radius_m * cos, 2), rounded(centre[1] + radius_m * sin, 2)]
        })
        .collect()
}

/// The way of a moving node.
pub(crate) struct Path {
    legs: Vec<Leg>,
}

/// A straight piece of it, or a halt.
struct Leg {
    until_s: f64,
    from: Point,
    to: Point,
    lasts_s: f64,
    heading_rad: f64,
}

impl Path {
    /// From waypoint to waypoint at speeds from 1 m/s to the layout's greatest, with a halt of 2 to 20 s at every tenth.
    pub(crate) fn new(draws: &mut Draws, layout: &Layout) -> Self {
        let mut at = anywhere(draws, layout, 0.5);
        let (mut now_s, mut heading_rad) = (0.0, 0.0);
        let mut legs = Vec::new();
        while now_s <= layout.duration_s {
            let to = anywhere(draws, layout, 0.5);
            let speed_mps = draws.between(1.0, layout.speed_mps);
            let halt_s = if draws.chance(0.1) { draws.between(2.0, 20.0) } else { 0.0 };
            let lasts_s = distance(at, to).max(0.1) / speed_mps;
            heading_rad = if distance(at, to) == 0.0 {
                heading_rad
            } else {
                (to[1] - at[1]).atan2(to[0] - at[0])
            };
            now_s += lasts_s;
            legs.push(Leg { until_s: now_s, from: at, to, lasts_s, heading_rad });
            now_s += halt_s;
            legs.push(Leg { until_s: now_s, from: to, to, lasts_s: halt_s, heading_rad });
            at = to;
        }
        Self { legs }
    }

    /// Where the node is at a moment; its height is left at 0.
    pub(crate) fn place_at(&self, time_s: f64) -> At {
        let index = self.legs.partition_point(|leg| leg.until_s < time_s);
        let leg = &self.legs[index];
        let left = if leg.lasts_s == 0.0 { 0.0 } else { (leg.until_s - time_s) / leg.lasts_s };
        let place = |axis: usize| rounded(leg.to[axis] + left * (leg.from[axis] - leg.to[axis]), 3);
        let speed_mps =
            if leg.lasts_s == 0.0 { 0.0 } else { distance(leg.from, leg.to) / leg.lasts_s };
        At {
            plane_m: [place(0), place(1)],
            z_m: 0.0,
            heading_rad: Some(rounded(leg.heading_rad, 4)),
            speed_mps: rounded(speed_mps, 3),
        }
    }
}

/// Temperature, humidity and dust, the same everywhere: smooth in time.
struct Weather {
    duration_s: f64,
    warming_c: f64,
    /// Per quantity three waves: amplitude, period (s), phase.
    waves: [[[f64; 3]; 3]; 3],
}

impl Weather {
    fn new(draws: &mut Draws, duration_s: f64) -> Self {
        let warming_c = draws.between(4.0, 8.0);
        let scales = [3.0, 9.0, 15.0];
        let waves = scales.map(|scale| {
            [0.11, 0.27, 0.61].map(|share: f64| {
                [
                    scale * draws.between(0.6, 1.0),
                    duration_s * share * draws.between(0.8, 1.25),
                    draws.between(0.0, std::f64::consts::TAU),
                ]
            })
        });
        Self { duration_s, warming_c, waves }
    }

    /// Temperature (°C, 25 in the middle), relative humidity (%) and dust (µg/m³).
    fn values_at(&self, time_s: f64) -> [f64; 3] {
        let [temperature, humidity, dust] = self.waves.map(|waves| {
            waves
                .iter()
                .map(|[amplitude, period_s, phase]| {
                    amplitude * (std::f64::consts::TAU * time_s / period_s + phase).sin()
                })
                .sum::<f64>()
        });
        [
            rounded(25.0 + self.warming_c * (time_s / self.duration_s - 0.5) + temperature, 2),
            rounded((60.0 + humidity).clamp(5.0, 99.0), 1),
            rounded((60.0 + dust).max(0.0), 1),
        ]
    }
}
