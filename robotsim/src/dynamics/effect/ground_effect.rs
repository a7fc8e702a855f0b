//! Rotors that give more thrust close above the ground.

use super::{Effect, Entry, Situation};
use proto::config::{Range, Section};
use proto::effect::{Catalogued, Need};

/// Height (rotor radii) below which the gain is constant.
const LEAST_RADII: f64 = 0.5;

/// `kind = "ground-effect"`.
pub(super) const ENTRY: Entry = Entry::of::<GroundEffect>();

/// Rotors give more thrust close above the ground.
///
/// # Mechanism
///
/// The ground slows the air that a rotor throws down, so that the same power gives more thrust close above it.
///
/// # Equation
///
/// ```text
/// a' = gain (a + g e_z) - g e_z, gain = 1 / (1 - (rotor_radius_m / (4 (z - ground_m)))^2)
/// ```
///
/// # Source
///
/// I. C. Cheeseman and W. E. Bennett, The effect of the ground on a helicopter rotor in forward flight, ARC R&M 3021, 1955.
///
/// # Validity
///
/// Hover and slow flight over level ground. Below half a rotor radius the gain is constant, 4/3. One rotor; several close to each
/// other gain more.
///
/// # Trace
///
/// An upward error close above the ground, and none two rotor diameters above it.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "ground-effect",
    needs = &[Need::ThrustCommands],
    example = "rotor_radius_m = 0.2\n",
)]
struct GroundEffect {
    /// Radius of the rotor (m); for several rotors, of one rotor with the same effect.
    #[key(range = 0.0..=100.0)]
    #[fit(
        unit = "m",
        range = 0.0..=10.0,
        starts = [0.05, 0.2, 0.8],
        step = 0.005,
        null = 0.0,
        plausible = 0.01..=2.0,
        source = "propellers of 2 cm to 4 m",
    )]
    rotor_radius_m: f64,
    /// Height of the ground minus the height of the rotor above the measured position (m).
    #[key(range = Range::PLACE, default = 0.0)]
    ground_m: f64,
}

impl Effect for GroundEffect {
    fn thrust_gain(&self, at: &Situation<'_>) -> f64 {
        if self.rotor_radius_m == 0.0 {
            return 1.0;
        }
        let above_m = at.position_m[2] - self.ground_m;
        let radii = (above_m / self.rotor_radius_m).max(LEAST_RADII);
        1.0 / (1.0 - 1.0 / (16.0 * radii * radii))
    }

    fn thrust_gains(&self) -> [f64; 2] {
        [1.0, 1.0 / (1.0 - 1.0 / (16.0 * LEAST_RADII * LEAST_RADII))]
    }

    fn varies_on_the_way(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;
    use super::*;
    use crate::dynamics::GRAVITY_MPS2;
    use crate::dynamics::physics::{Order, Robot};
    use crate::dynamics::surroundings::Surroundings;

    fn gain(z_m: f64, ground_m: f64) -> f64 {
        let at = Situation {
            time_s: 0.0,
            position_m: [0.0, 0.0, z_m],
            velocity_mps: [0.0; 3],
            heading_rad: 0.0,
            surroundings: &Surroundings::default(),
        };
        GroundEffect { rotor_radius_m: 0.4, ground_m }.thrust_gain(&at)
    }

    #[test]
    fn the_gain_is_that_of_the_literature() {
        // One radius above the ground 16/15, two 64/63; and below half a radius 4/3.
        assert!((gain(0.4, 0.0) - 16.0 / 15.0).abs() < 1e-15);
        assert!((gain(0.8, 0.0) - 64.0 / 63.0).abs() < 1e-15);
        for z_m in [0.2, 0.1, 0.0, -1.0] {
            assert!((gain(z_m, 0.0) - 4.0 / 3.0).abs() < 1e-15, "{z_m}");
        }
        assert!((gain(0.2001, 0.0) - 4.0 / 3.0) < 0.0);
        assert!((gain(5.4, 5.0) - 16.0 / 15.0).abs() < 1e-12);
    }

    #[test]
    fn a_quadrotor_that_is_to_hover_low_rises_as_the_equation_says() {
        let physics =
            physics("kind = 'quadrotor'\n[[effect]]\nkind = 'ground-effect'\nrotor_radius_m = 0.3");
        let mut robot = Robot { position_m: [0.0, 0.0, 0.3], ..Robot::default() };
        let orders = [Order { from_s: 0.0, demand: [0.0; 3] }];
        physics.advance(&mut robot, &orders, &mut 0, 0.0, 0.5, &Surroundings::default());
        // z̈ = g ((1 − (R/4z)²)⁻¹ − 1), in steps of 1 µs.
        let (mut z_m, mut v_mps, h_s) = (0.3_f64, 0.0, 1e-6);
        for _ in 0..500_000 {
            let x = 0.3 / (4.0 * z_m);
            v_mps += h_s * GRAVITY_MPS2 * (1.0 / (1.0 - x * x) - 1.0);
            z_m += h_s * v_mps;
        }
        // Steps of 10 ms with the force half way: of second order.
        assert!((robot.position_m[2] - z_m).abs() < 2e-5, "{robot:?} {z_m}");
    }
}
