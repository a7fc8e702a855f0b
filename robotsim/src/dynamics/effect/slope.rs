//! Ground that leads downhill.

use super::{Effect, Entry, Situation};
use proto::config::Section;
use proto::effect::{Catalogued, Level, Need};

/// `kind = "slope"`.
pub(super) const ENTRY: Entry = Entry::of::<Slope>();

/// A downhill drift in proportion to the slope of site.terrain.
///
/// # Mechanism
///
/// On a slope, gravity pulls robots downhill, and their drives compensate only partly.
///
/// # Equation
///
/// ```text
/// v = u - gain * grad h, of bodies that keep their velocity a' = a - gain * grad h
/// ```
///
/// # Source
///
/// A linearised balance of weight and drive force; the general form of effects that depend on the position.
///
/// # Validity
///
/// Small slopes, and a drift in proportion to the slope. Without terrain the ground is level.
///
/// # Trace
///
/// A downhill error that depends only on the position.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "slope",
    needs = &[Need::Terrain, Need::VelocityCommands],
    example = "gain = 0.5\n",
    level = Level::Place,
    needs_one_frame = true,
)]
struct Slope {
    /// Drift (m/s), or acceleration (m/s²) of bodies that keep their velocity, on a slope of 1 m per metre.
    #[key(range = -1e3..=1e3)]
    #[fit(unit = "m/s", starts = [0.0], step = 0.02, null = 0.0)]
    gain: f64,
}

impl Effect for Slope {
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
