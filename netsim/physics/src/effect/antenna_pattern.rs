//! Antennas that are not the same in all directions.

use super::{Effect, Entry};
use crate::link::{End, Link};
use proto::config::{Choice, Kind, Problem, Range, Section};
use proto::effect::{Catalogued, Fixed, Level, Need, Search};
use std::f64::consts::{FRAC_PI_2, PI};

const ANGLE: Range = Range::closed(-100.0, 100.0);
const COEFFICIENTS: Kind =
    Kind::List { of: &Kind::Number(Range::closed(-60.0, 60.0)), min: 1, max: 8 };

/// `kind = "antenna-pattern"`.
pub const ENTRY: Entry = Entry::new::<Keys>(check, |table, _| {
    let keys = Keys::read(table);
    let shape = match keys.shape {
        ShapeKey::Cardioid => Shape::Cardioid {
            half_db: 0.5 * keys.front_to_back_db?,
            boresight_rad: keys.boresight_rad,
        },
        ShapeKey::Dipole => Shape::Dipole,
        ShapeKey::Fourier => Shape::Fourier { cos: keys.cos, sin: keys.sin },
    };
    Some(Box::new(AntennaPattern { shape, headings_rad: keys.headings_rad }))
});

#[derive(Choice, Clone, Copy, PartialEq, Eq)]
enum ShapeKey {
    /// A cardioid over the bearing seen from the body: 0 dB towards boresight_rad, -front_to_back_db in the opposite direction.
    Cardioid,
    /// A vertical half-wave dipole over elevation: 0 dB horizontally, nulls up and down.
    Dipole,
    /// A Fourier series over the bearing.
    Fourier,
}

/// The antenna gain at each end depends on the direction of the other end.
///
/// # Mechanism
///
/// The body of a robot, its battery and its wheels are near the antenna, so its gain is lower towards some sides.
///
/// # Equation
///
/// ```text
/// RSSI' = RSSI + g(sender) + g(receiver); cardioid g = -front_to_back_db/2 (1 - cos(b - boresight_rad)), fourier g = sum_k
/// cos_k cos(k b) + sin_k sin(k b), b the bearing of the other end less the heading; dipole g = 20 log10 |cos(pi/2 cos
/// t)/sin t|, t the angle from upright
/// ```
///
/// # Source
///
/// C. A. Balanis, Antenna Theory, 4th ed., § 4.6 (half-wave dipole); cardioid: first harmonic of any pattern, in dB.
///
/// # Validity
///
/// The same pattern at every node. Ends without a known heading have no pattern. The Fourier series has no constant, which would be
/// aliased with system-gain. The dipole's nulls end at -40 dB.
///
/// # Trace
///
/// An error over the bearing seen from the body, the same at the sender and at the receiver.
#[derive(Catalogued, Section)]
#[effect(
    name = "antenna-pattern",
    makes = AntennaPattern,
    needs = &[Need::Positions, Need::Headings, Need::Readings],
    example = "front_to_back_db = 10.0\nboresight_rad = 0.0\n",
    variants = &[&[("shape", Fixed::Text("cardioid"))]],
    level = Level::Place,
    search = Search::Headings,
)]
struct Keys {
    /// The pattern.
    #[key(default = ShapeKey::Cardioid)]
    shape: ShapeKey,
    /// Cardioid: front-to-back ratio (dB).
    #[key(range = 0.0..=60.0)]
    #[fit(unit = "dB", range = 0.0..=40.0, starts = [4.0], step = 0.05, null = 0.0)]
    front_to_back_db: Option<f64>,
    /// Cardioid: direction of maximum gain, seen from the body (rad, to the left of the heading).
    #[key(range = ANGLE, default = 0.0)]
    #[fit(unit = "rad", range = -PI..=PI, starts = [-FRAC_PI_2, 0.0, FRAC_PI_2, PI], step = 0.02)]
    boresight_rad: f64,
    /// Fourier: coefficients (dB) of cos(b), cos(2b), …, with the bearing b.
    #[key(kind = COEFFICIENTS)]
    cos: Vec<f64>,
    /// Fourier: coefficients (dB) of sin(b), sin(2b), …, with the bearing b.
    #[key(kind = COEFFICIENTS)]
    sin: Vec<f64>,
    /// Headings (rad) by node number, for nodes that report none.
    #[key(range = ANGLE, length = 1..=1_000_000)]
    headings_rad: Vec<f64>,
}

fn check(table: &toml::Table, path: &str, problems: &mut Vec<Problem>) {
    let shape = Keys::read(table).shape;
    let has = |key: &str| table.contains_key(key);
    if shape == ShapeKey::Cardioid && !has("front_to_back_db") {
        let message = "is missing: a cardioid requires it";
        problems.push(Problem::new(format!("{path}.front_to_back_db"), message));
    }
    if shape == ShapeKey::Fourier && !has("cos") && !has("sin") {
        problems.push(Problem::new(
            path,
            "must have cos or sin, the coefficients of the Fourier series",
        ));
    }
    for (key, of, name) in [
        ("front_to_back_db", ShapeKey::Cardioid, "cardioid"),
        ("cos", ShapeKey::Fourier, "fourier"),
        ("sin", ShapeKey::Fourier, "fourier"),
    ] {
        if has(key) && shape != of {
            let message = format!("must be absent: it applies only with shape = {name:?}");
            problems.push(Problem::new(format!("{path}.{key}"), message));
        }
    }
}

/// How gain depends on direction.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// One maximum and one minimum.
    Cardioid {
        /// Half of the difference between front and back (dB).
        half_db: f64,
        /// Direction of the maximum, seen from the body (rad).
        boresight_rad: f64,
    },
    /// An upright half-wave dipole.
    Dipole,
    /// Coefficients (dB) of the bearing, twice the bearing, ….
    Fourier {
        /// Of cosines.
        cos: Vec<f64>,
        /// Of sines.
        sin: Vec<f64>,
    },
}

/// A pattern, the same at every node.
///
/// # Model
///
/// ```text
/// RSSI' = RSSI + g_tx + g_rx
/// cardioid   g = −A/2 (1 − cos(b − b0))
/// fourier    g = Σ_k a_k cos(k b) + c_k sin(k b)
/// dipole     g = 20 log10 |cos(π/2 cos ϑ) / sin ϑ|
/// ```
///
/// b is the bearing of the other end in the plane less the own heading, ϑ the angle between the path and the upright. The
/// dipole is that of Balanis, "Antenna Theory", § 4.6, less its greatest gain (2.15 dBi), which belongs to the gains of
/// `[netsim.phy]`.
///
/// # Validity
///
/// At an end whose heading is not known a pattern over the bearing adds nothing, nor straight up and down. Horizontal
/// patterns do not depend on elevation.
#[derive(Clone, Debug, PartialEq)]
pub struct AntennaPattern {
    /// The pattern.
    pub shape: Shape,
    /// Headings of nodes that report none (rad).
    pub headings_rad: Vec<f64>,
}

/// The dipole's nulls (dB): bodies and cables fill them.
const NULL_DB: f64 = -40.0;

impl AntennaPattern {
    /// Gain (dB) at one end towards the other.
    fn gain_db(&self, here: &End, there: &End) -> f64 {
        let step = [0, 1, 2].map(|axis| there.position_m[axis] - here.position_m[axis]);
        let [x, y, z] = step;
        let flat_squared = x * x + y * y;
        if self.shape == Shape::Dipole {
            return dipole_db(z, flat_squared);
        }
        let heading_rad =
            here.heading_rad.or_else(|| self.headings_rad.get(here.id.index()).copied());
        let Some(heading_rad) = heading_rad.filter(|_| flat_squared != 0.0) else { return 0.0 };
        let bearing_rad = libm::atan2(y, x) - heading_rad;
        match &self.shape {
            Shape::Cardioid { half_db, boresight_rad } => {
                -half_db * (1.0 - libm::cos(bearing_rad - boresight_rad))
            }
            Shape::Fourier { cos, sin } => {
                let mut gain_db = 0.0;
                for k in 0..cos.len().max(sin.len()) {
                    let (sine, cosine) = libm::sincos((k + 1) as f64 * bearing_rad);
                    gain_db += cos.get(k).map_or(0.0, |a| a * cosine);
                    gain_db += sin.get(k).map_or(0.0, |b| b * sine);
                }
                gain_db
            }
            Shape::Dipole => 0.0,
        }
    }
}

/// Gain (dB) of an upright half-wave dipole over that to the sides, towards a point so far up and (squared) aside.
fn dipole_db(up: f64, aside_squared: f64) -> f64 {
    let squared = up * up + aside_squared;
    if aside_squared == 0.0 {
        return if squared == 0.0 { 0.0 } else { NULL_DB };
    }
    let cosine = up / squared.sqrt();
    let sine = (aside_squared / squared).sqrt();
    (20.0 * libm::log10(libm::cos(FRAC_PI_2 * cosine) / sine)).max(NULL_DB)
}

impl Effect for AntennaPattern {
    fn contribution_db(&self, link: &Link<'_>) -> f64 {
        self.gain_db(&link.sender, &link.receiver) + self.gain_db(&link.receiver, &link.sender)
    }

    fn max_gain_db(&self) -> f64 {
        match &self.shape {
            Shape::Cardioid { .. } | Shape::Dipole => 0.0,
            Shape::Fourier { cos, sin } => {
                2.0 * cos.iter().chain(sin).map(|coefficient| coefficient.abs()).sum::<f64>()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::testing::{along_x, made, problems};
    use crate::link::Scene;

    /// What an effect adds to a link along x whose ends face in these directions.
    fn facing(keys: &str, sender_rad: Option<f64>, receiver_rad: Option<f64>) -> f64 {
        let scene = Scene::default();
        let mut link = along_x(10.0, 1.0, None, &scene);
        link.sender.heading_rad = sender_rad;
        link.receiver.heading_rad = receiver_rad;
        made("antenna-pattern", keys).contribution_db(&link)
    }

    fn close(got: f64, expected: f64) {
        assert!((got - expected).abs() < 1e-9, "{got}, expected {expected}");
    }

    #[test]
    fn a_cardioid_loses_all_behind_and_half_to_the_sides_at_each_end() {
        let keys = "front_to_back_db = 12";
        // The receiver sees the sender at bearing pi.
        close(facing(keys, Some(0.0), Some(PI)), 0.0);
        close(facing(keys, Some(PI), None), -12.0);
        close(facing(keys, Some(FRAC_PI_2), Some(0.0)), -18.0);
        close(facing(keys, None, None), 0.0);
        // Facing left by a quarter, with the boresight a quarter to the right: it looks ahead again.
        close(
            facing(
                "front_to_back_db = 12\nboresight_rad = -1.5707963267948966",
                Some(FRAC_PI_2),
                None,
            ),
            0.0,
        );
        close(
            facing("front_to_back_db = 12\nheadings_rad = [3.141592653589793]", None, None),
            -12.0,
        );
    }

    #[test]
    fn a_fourier_series_can_say_what_a_cardioid_says_but_its_constant() {
        for heading_rad in [-2.0, 0.3, 1.0, 3.0] {
            let series = facing("shape = \"fourier\"\ncos = [6.0]", Some(heading_rad), None);
            close(series - 6.0, facing("front_to_back_db = 12", Some(heading_rad), None));
            let second = facing(
                "shape = \"fourier\"\ncos = [0.0, 2.0]\nsin = [0.0, 1.0]",
                Some(heading_rad),
                None,
            );
            // The bearing ahead of the x axis is the heading with the other sign.
            close(second, 2.0 * (2.0 * heading_rad).cos() - (2.0 * heading_rad).sin());
        }
    }

    #[test]
    fn a_half_wave_dipole_has_a_beam_of_78_degrees() {
        // Balanis: half of the power at 39 degrees above the horizon.
        let up = (39.0f64).to_radians().tan();
        assert!((dipole_db(up, 1.0) + 3.01).abs() < 0.05, "{}", dipole_db(up, 1.0));
        assert_eq!(dipole_db(0.0, 4.0), 0.0);
        assert_eq!(dipole_db(3.0, 0.0), NULL_DB);
        close(facing("shape = \"dipole\"", None, None), 0.0);
    }

    #[test]
    fn keys_belong_to_their_shapes() {
        for (keys, expected) in [
            ("", "front_to_back_db: is missing"),
            ("shape = \"fourier\"", "must have cos or sin"),
            ("shape = \"dipole\"\nfront_to_back_db = 3", "applies only with shape = \"cardioid\""),
            ("front_to_back_db = 3\nsin = [1.0]", "applies only with shape = \"fourier\""),
        ] {
            let found = problems("antenna-pattern", keys);
            assert!(found.contains(expected), "{keys}: {found}");
        }
    }
}
