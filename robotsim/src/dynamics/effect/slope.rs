//! Ground that leads downhill.

use super::{Effect, Entry, Situation, UNCHECKED};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Level, Need, Parameter};
use serde::Deserialize;

/// `kind = "slope"`.
pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "slope",
        doc: "A downhill drift in proportion to the slope of site.terrain.",
        fields: &[Field {
            key: "gain",
            doc: "Drift (m/s) on a slope of 1 m per metre.",
            kind: Kind::Number(Range::closed(-1e3, 1e3)),
            default: Default::Required,
        }],
    },
    about: About {
        mechanism: "On a slope, gravity pulls robots downhill, and their drives compensate only partly.",
        equation: "v = u - gain * grad h",
        source: "A linearised balance of weight and drive force; the general form of effects that depend on the position.",
        validity: "Small slopes, and a drift in proportion to the slope. Without terrain the ground is level.",
        trace: "A downhill error that depends only on the position.",
        needs: &[Need::Terrain, Need::VelocityCommands],
        example: "gain = 0.5\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "gain",
            unit: "m/s",
            min: -1e3,
            max: 1e3,
            starts: &[0.0],
            step: 0.02,
        }],
        variants: &[],
        level: Level::Place,
        generalises: &[],
        needs_one_frame: true,
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table| Some(Box::new(typed::<Slope>(table))),
};

/// A drift downhill.
///
/// # Model
///
/// ```text
/// v = u − g ∇h(x, y)
/// ```
///
/// A balance of weight and drive, linear in the slope: weight along the slope grows with ∇h for small slopes, and a drive that
/// controls its speed in proportion gives way in proportion. A simplification made here.
///
/// # Arguments
///
/// * `gain` g: drift per slope (m/s); a slope of 1 is 45°. Negative: uphill.
///
/// h is the height of `[site]`'s terrain (m).
///
/// # Validity
///
/// Small slopes, drives that give way in proportion. Standing robots drift as well, where brakes would hold them. Where no terrain is
/// known, the ground is level. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct Slope {
    gain: f64,
}

impl Effect for Slope {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn drift_mps(&self, at: &Situation<'_>) -> [f64; 3] {
        let [x_m, y_m, _] = at.position_m;
        let terrain = at.surroundings.terrain;
        let [east, north] = terrain.map_or([0.0; 2], |terrain| terrain.gradient([x_m, y_m]));
        [-self.gain * east, -self.gain * north, 0.0]
    }

    fn drifts(&self) -> bool {
        true
    }

    fn varies_on_the_way(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;
    use crate::dynamics::physics::Robot;
    use crate::dynamics::surroundings::Surroundings;
    use proto::site::{Hill, Terrain};

    #[test]
    fn a_robot_creeps_down_a_hollow_as_the_equation_says() {
        // Near the middle of a hollow of depth H: ẋ = −k (H / r²) x, x = x0 e^(−k H t / r²).
        let hollow = Hill { centre_m: [0.0; 2], height_m: -4.0, radius_m: 100.0 };
        let terrain = Terrain::Hills(vec![hollow]);
        let surroundings = Surroundings { terrain: Some(&terrain), ..Surroundings::default() };
        let physics = physics("[[effect]]\nkind = 'slope'\ngain = 500.0");
        let mut robot = Robot { position_m: [0.5, 0.0, 0.0], ..Robot::default() };
        physics.advance(&mut robot, &[], &mut 0, 0.0, 3.0, &surroundings);
        // Steps of 10 ms err by half of (k H / r² × 10 ms)² each; the shape of the hollow by (x / r)².
        let exact = 0.5 * (-500.0f64 * 4.0 / 1e4 * 3.0).exp();
        assert!((robot.position_m[0] - exact).abs() < 5e-4, "{robot:?} {exact}");
    }
}
