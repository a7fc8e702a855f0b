//! Two campaigns at one site, of which the second may differ in one thing: what `diagnose --between` is judged by.
//!
//! The equations are those of the sources named here and in `radio.rs`; nothing of the product is used. Half of the sites have
//! shadowing, a random field over the places of both ends that no model knows: nodes that move meet other values of it, and nothing has
//! changed. Half of the sites have noise with heavy tails.

use super::draws::Draws;
use super::geometry::{Point, crossing, distance};
use super::radio::friis_db;
use serde_json::Value;
use std::f64::consts::TAU;
use std::fmt::Write as _;

/// What differs between the campaigns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Between {
    /// Nothing: the nodes stand where they stood.
    FixedNodes,
    /// Nothing but the places of four nodes.
    MovedNodes,
    /// Nothing but four nodes, which left, and four others at other places.
    NewNodes,
    /// Every reading is 3 dB higher or lower.
    Gain,
    /// The path loss exponent rises or falls by 0.6.
    Exponent,
    /// One node sends and receives 5 dB more weakly.
    NodeGain,
    /// A wall that no model knows, which took 10 dB from each path through it, is gone.
    ObstacleGone,
}

impl Between {
    /// All kinds: those in which nothing changed first.
    pub const ALL: [Self; 7] = [
        Self::FixedNodes,
        Self::MovedNodes,
        Self::NewNodes,
        Self::Gain,
        Self::Exponent,
        Self::NodeGain,
        Self::ObstacleGone,
    ];

    /// Its name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::FixedNodes => "nothing: fixed nodes",
            Self::MovedNodes => "nothing: moved nodes",
            Self::NewNodes => "nothing: new nodes",
            Self::Gain => "gain of all, 3 dB",
            Self::Exponent => "path loss exponent, 0.6",
            Self::NodeGain => "gain of one node, 5 dB",
            Self::ObstacleGone => "obstacle gone, 10 dB",
        }
    }

    /// Whether nothing changed.
    #[must_use]
    pub const fn is_null(self) -> bool {
        matches!(self, Self::FixedNodes | Self::MovedNodes | Self::NewNodes)
    }
}

/// Two campaigns, and what is true of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Repeated {
    /// What differs.
    pub between: Between,
    /// The files of the first and the second campaign.
    pub csv: [String; 2],
    /// The model, which lacks the shadowing, the obstacle and what changed.
    pub config_toml: String,
    /// Of [`Between::NodeGain`]: the node.
    pub node: usize,
    /// What changed in dB, or in the exponent; 0 where nothing did.
    pub size: f64,
}

/// How an answer is judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// What changed is named, and nothing else; or nothing changed and no change is claimed.
    Right,
    /// A change is claimed without a cause where something changed.
    SomethingChanged,
    /// The answer names explanations and claims none, or finds nothing where something changed.
    Undecided,
    /// A change is claimed where nothing changed, without a cause.
    FalseAlarm,
    /// A cause is named that is none, or a change is denied.
    FalseCertain,
}

impl Verdict {
    /// Its name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::SomethingChanged => "something-changed",
            Self::Undecided => "undecided",
            Self::FalseAlarm => "false-alarm",
            Self::FalseCertain => "false-certain",
        }
    }
}

const N_NODES: usize = 11;
/// These move, or leave; or drive, at some sites.
const FROM_MOVED: usize = 7;
const N_FRAMES: usize = 180;
/// Recordings of a campaign, one after the other.
const N_RECORDINGS: usize = 4;
const EXTENT_M: [f64; 2] = [60.0, 40.0];
const DURATION_S: f64 = 1600.0;
const TX_POWER_DBM: f64 = -5.0;
/// Exponent of the log-distance model, with free space up to 1 m.
const EXPONENT: f64 = 2.4;

/// A random field over the places of both ends, alike in both directions: a sum of plane waves in the four coordinates (the spectral
/// method of M. Shinozuka and C.-M. Jan, J. Sound Vib. 25, 1972), with normal wave numbers, so that the correlation is a Gaussian.
struct Shadowing {
    waves: Vec<([f64; 4], f64)>,
    sd_db: f64,
}

impl Shadowing {
    const N_WAVES: usize = 120;
    /// Length over which it changes (m): 1/e of the correlation at √2 times this.
    const LENGTH_M: f64 = 6.0;

    fn new(draws: &mut Draws, sd_db: f64) -> Self {
        let waves = (0..Self::N_WAVES)
            .map(|_| {
                let numbers = [0; 4].map(|_| draws.normal() / Self::LENGTH_M);
                (numbers, TAU * draws.uniform())
            })
            .collect();
        Self { waves, sd_db }
    }

    fn db(&self, a: Point, b: Point) -> f64 {
        let sum: f64 = self
            .waves
            .iter()
            .map(|([k0, k1, k2, k3], phase)| {
                let one = k0 * a[0] + k1 * a[1] + k2 * b[0] + k3 * b[1] + phase;
                let other = k0 * b[0] + k1 * b[1] + k2 * a[0] + k3 * a[1] + phase;
                one.cos() + other.cos()
            })
            .sum();
        // Each cosine has a variance of 1/2.
        self.sd_db * sum / (Self::N_WAVES as f64).sqrt()
    }
}

/// A site, which stays as it is.
struct Site {
    places_m: Vec<Point>,
    new_places_m: Vec<Point>,
    shadowing: Shadowing,
    wall_m: [Point; 2],
    noise_db: f64,
    is_heavy: bool,
    is_driving: bool,
}

impl Site {
    fn new(seed: u64) -> Self {
        let mut draws = Draws::new(seed, "repeated: site");
        let mut place = || [draws.between(0.0, EXTENT_M[0]), draws.between(0.0, EXTENT_M[1])];
        let mut places = || (0..N_NODES).map(|_| place()).collect::<Vec<Point>>();
        let (places_m, new_places_m) = (places(), places());
        let sd_db = if draws.chance(0.5) { draws.between(2.0, 4.0) } else { 0.0 };
        let x_m = draws.between(20.0, 40.0);
        Self {
            places_m,
            new_places_m,
            shadowing: Shadowing::new(&mut draws, sd_db),
            wall_m: [[x_m, 5.0], [x_m, 35.0]],
            noise_db: draws.between(1.0, 2.5),
            is_heavy: draws.chance(0.5),
            is_driving: draws.chance(0.5),
        }
    }

    /// Where a node is. `has_moved`: in the second campaign, where nodes stand elsewhere.
    fn place_m(&self, node: usize, time_s: f64, has_moved: bool) -> Point {
        if node < FROM_MOVED {
            return self.places_m[node];
        }
        let [x, y] = if has_moved { self.new_places_m[node] } else { self.places_m[node] };
        if !self.is_driving {
            return [x, y];
        }
        // A circle of 5 m, in five to eight minutes.
        let angle = time_s * TAU / (200.0 + 20.0 * node as f64);
        [x + 5.0 * angle.cos(), y + 5.0 * angle.sin()]
    }
}

impl Repeated {
    /// Of a seed.
    #[must_use]
    pub fn new(between: Between, seed: u64) -> Self {
        let site = Site::new(seed);
        let mut draws = Draws::new(seed, "repeated: change");
        let sign = if draws.chance(0.5) { 1.0 } else { -1.0 };
        let node = draws.below(N_NODES);
        let size = match between {
            Between::Gain => 3.0 * sign,
            Between::Exponent => 0.6 * sign,
            Between::NodeGain => -5.0,
            Between::ObstacleGone => 10.0,
            Between::FixedNodes | Between::MovedNodes | Between::NewNodes => 0.0,
        };
        let csv =
            [false, true].map(|is_second| campaign(&site, seed, between, (size, node), is_second));
        let config_toml = format!(
            "[netsim.phy]\npropagation = \"log-distance\"\nexponent = {EXPONENT:?}\ntx_power_dbm = {TX_POWER_DBM:?}\n"
        );
        Self { between, csv, config_toml, node, size }
    }

    /// Judges the JSON of `diagnose --between`.
    #[must_use]
    pub fn judged(&self, answer: &Value) -> Verdict {
        let verdict = answer["verdict"].as_str().unwrap_or_default();
        let changes = answer["changed"].as_array();
        let named: Vec<(&str, Option<&Value>)> = changes
            .into_iter()
            .flatten()
            .map(|change| (change["effect"].as_str().unwrap_or_default(), change.get("only")))
            .collect();
        let at_node = serde_json::json!({"nodes": [self.node]});
        let is_right = match self.between {
            Between::Gain => named == [("system-gain", None)],
            Between::Exponent => named == [("path-loss-exponent", None)],
            Between::NodeGain => named == [("system-gain", Some(&at_node))],
            _ => false,
        };
        match (verdict, self.between.is_null()) {
            ("changed", _) => {
                if is_right {
                    Verdict::Right
                } else {
                    Verdict::FalseCertain
                }
            }
            ("nothing-changed" | "nothing-found", true) => Verdict::Right,
            ("nothing-changed", false) => Verdict::FalseCertain,
            ("something-changed", true) => Verdict::FalseAlarm,
            // The catalogue has no effect that says which wall is gone.
            ("something-changed", false) if self.between == Between::ObstacleGone => Verdict::Right,
            ("something-changed", false) => Verdict::SomethingChanged,
            _ => Verdict::Undecided,
        }
    }
}

/// The file of a campaign. `size` and `node`: what changed, and where.
fn campaign(
    site: &Site,
    seed: u64,
    between: Between,
    (size, node): (f64, usize),
    is_second: bool,
) -> String {
    let mut draws =
        Draws::new(seed, if is_second { "repeated: second" } else { "repeated: first" });
    let has_moved = is_second && matches!(between, Between::MovedNodes | Between::NewNodes);
    let number = |node: usize| {
        let is_new = is_second && between == Between::NewNodes && FROM_MOVED <= node;
        if is_new { node + N_NODES } else { node }
    };
    let mut csv =
        "time_s,tx,rx,channel,tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,rssi_dbm,received,run\n"
            .to_owned();
    for frame in 0..N_FRAMES {
        let time_s = (frame as f64 + draws.uniform()) * DURATION_S / N_FRAMES as f64;
        let tx = frame % N_NODES;
        let channel = 11 + draws.below(16) as u8;
        for rx in (0..N_NODES).filter(|&rx| rx != tx) {
            let [a, b] = [tx, rx].map(|node| site.place_m(node, time_s, has_moved));
            let distance_m = distance(a, b).max(1.0);
            let exponent = match between {
                Between::Exponent if is_second => EXPONENT + size,
                _ => EXPONENT,
            };
            let mut dbm =
                TX_POWER_DBM + friis_db(1.0, channel) - 10.0 * exponent * distance_m.log10();
            dbm += site.shadowing.db(a, b);
            dbm += match between {
                Between::Gain if is_second => size,
                Between::NodeGain if is_second && (tx == node || rx == node) => size,
                Between::ObstacleGone
                    if !is_second && crossing(a, b, site.wall_m[0], site.wall_m[1]).is_some() =>
                {
                    -size
                }
                _ => 0.0,
            };
            let normal = draws.normal();
            // Student's t of five degrees of freedom, of unit variance.
            let scale = if site.is_heavy {
                let squares: f64 = (0..5).map(|_| draws.normal().powi(2)).sum();
                (3.0 / squares).sqrt()
            } else {
                1.0
            };
            dbm += site.noise_db * normal * scale;
            let [x0, y0] = a;
            let [x1, y1] = b;
            let _ = writeln!(
                csv,
                "{time_s:.2},{},{},{channel},{x0:.3},{y0:.3},1,{x1:.3},{y1:.3},1,{dbm:.0},1,{}",
                number(tx),
                number(rx),
                frame * N_RECORDINGS / N_FRAMES
            );
        }
    }
    csv
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::{deviation, mean};
    use serde_json::json;
    use std::collections::BTreeSet;

    /// Sender, receiver and reading of each row.
    fn rows(csv: &str) -> Vec<(usize, usize, f64)> {
        let lines = csv.lines().skip(1).map(|line| line.split(',').collect::<Vec<_>>());
        lines
            .map(|f| (f[1].parse().unwrap(), f[2].parse().unwrap(), f[10].parse().unwrap()))
            .collect()
    }

    fn level(csv: &str, is_of: impl Fn(usize, usize) -> bool) -> f64 {
        let rows = rows(csv);
        let of = rows.iter().filter(|(tx, rx, _)| is_of(*tx, *rx)).map(|(.., dbm)| *dbm);
        mean(&of.collect::<Vec<f64>>())
    }

    #[test]
    fn only_what_should_change_changes() {
        let all = |_, _| true;
        for seed in 0..4 {
            let of = |between| Repeated::new(between, seed);
            let shift = |it: &Repeated, is_of: &dyn Fn(usize, usize) -> bool| {
                level(&it.csv[1], is_of) - level(&it.csv[0], is_of)
            };
            // 1800 readings of each with a noise of at most 2.5 dB: four standard errors of a difference are 0.34 dB; channels add 0.1 dB.
            assert!(shift(&of(Between::FixedNodes), &all).abs() < 0.45);
            let gain = of(Between::Gain);
            assert!((shift(&gain, &all) - gain.size).abs() < 0.45 && gain.size.abs() == 3.0);
            let one = of(Between::NodeGain);
            let is_of = |tx, rx| tx == one.node || rx == one.node;
            assert!((shift(&one, &is_of) + 5.0).abs() < 1.1);
            assert!(shift(&one, &|tx, rx| !is_of(tx, rx)).abs() < 0.5);
            assert!(0.3 < shift(&of(Between::ObstacleGone), &all));
            let nodes = |csv: &str| rows(csv).iter().map(|row| row.0).collect::<BTreeSet<_>>();
            let new = of(Between::NewNodes);
            assert_eq!(nodes(&new.csv[0]), (0..N_NODES).collect());
            assert_eq!(nodes(&new.csv[1]), (0..FROM_MOVED).chain(18..22).collect());
            assert_eq!(of(Between::MovedNodes).csv[0], new.csv[0]);
        }
    }

    #[test]
    fn shadowing_has_its_deviation_and_is_the_same_both_ways() {
        let mut draws = Draws::new(5, "test");
        let field = Shadowing::new(&mut draws, 3.0);
        // Places are drawn over a kilometre, so that values hardly depend on each other: of 4000 the deviation has a standard error of
        // about 1 %, and the sum of 120 waves varies by a few per cent.
        let mut place = || [draws.between(0.0, 1e3), draws.between(0.0, 1e3)];
        let values: Vec<f64> = (0..4000).map(|_| field.db(place(), place())).collect();
        assert!((deviation(&values) / 3.0 - 1.0).abs() < 0.1, "{}", deviation(&values));
        let (a, b) = (place(), place());
        assert!((field.db(a, b) - field.db(b, a)).abs() < 1e-9);
    }

    #[test]
    fn answers_are_judged_by_what_is_true() {
        let of = |between, answer: Value| Repeated::new(between, 1).judged(&answer);
        let gain =
            |verdict: &str| json!({"verdict": verdict, "changed": [{"effect": "system-gain"}]});
        assert_eq!(of(Between::Gain, gain("changed")), Verdict::Right);
        assert_eq!(of(Between::Exponent, gain("changed")), Verdict::FalseCertain);
        assert_eq!(of(Between::NodeGain, gain("changed")), Verdict::FalseCertain);
        assert_eq!(of(Between::MovedNodes, gain("changed")), Verdict::FalseCertain);
        assert_eq!(of(Between::Gain, gain("cannot-tell")), Verdict::Undecided);
        let node = Repeated::new(Between::NodeGain, 1);
        let at_node = json!({"verdict": "changed", "changed": [{"effect": "system-gain", "only": {"nodes": [node.node]}}]});
        assert_eq!(node.judged(&at_node), Verdict::Right);
        let bare = |verdict: &str| json!({"verdict": verdict, "changed": []});
        assert_eq!(of(Between::NewNodes, bare("something-changed")), Verdict::FalseAlarm);
        assert_eq!(of(Between::NewNodes, bare("nothing-found")), Verdict::Right);
        assert_eq!(of(Between::ObstacleGone, bare("something-changed")), Verdict::Right);
        assert_eq!(of(Between::Exponent, bare("something-changed")), Verdict::SomethingChanged);
        assert_eq!(of(Between::Exponent, bare("nothing-changed")), Verdict::FalseCertain);
        assert_eq!(of(Between::Exponent, bare("nothing-found")), Verdict::Undecided);
    }
}
