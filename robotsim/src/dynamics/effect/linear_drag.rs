//! Resistance in proportion to the speed.

use super::{Effect, Entry, Situation};
use proto::config::Section;
use proto::effect::{Catalogued, Need};

/// `kind = "linear-drag"`.
pub(super) const ENTRY: Entry = Entry::of::<LinearDrag>();

/// Drag in proportion to the speed of a body that keeps its velocity.
///
/// # Mechanism
///
/// Rotors that move sideways through the air are pushed back: blades that advance and retreat drag differently.
///
/// # Equation
///
/// ```text
/// a' = a - rate_per_s v
/// ```
///
/// # Source
///
/// M. Faessler, A. Franchi and D. Scaramuzza, Differential flatness of quadrotor dynamics subject to rotor drag, IEEE Robotics and
/// Automation Letters 3 (2018) 620, eq. 2, with the same coefficient along all axes.
///
/// # Validity
///
/// Still air: see wind for air that moves. Well below the speed of the blades.
///
/// # Trace
///
/// An error against the motion, in proportion to the speed, that grows with the square of time.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "linear-drag",
    needs = &[Need::ThrustCommands],
    example = "rate_per_s = 0.4\n",
)]
struct LinearDrag {
    /// Deceleration per speed (1/s).
    #[key(range = 0.0..=50.0)]
    #[fit(
        unit = "1/s",
        starts = [0.1],
        step = 0.002,
        null = 0.0,
        plausible = 0.01..=10.0,
        source = "Faessler, Franchi and Scaramuzza 2018: 0.4 to 0.5 of a quadrotor",
    )]
    rate_per_s: f64,
}

impl Effect for LinearDrag {
    fn force_mps2(&self, at: &Situation<'_>) -> [f64; 3] {
        at.velocity_mps.map(|part_mps| -self.rate_per_s * part_mps)
    }

    fn force_varies(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;

    #[test]
    fn a_body_that_is_pushed_comes_to_the_speed_at_which_drag_bears_it() {
        // v = a (1 − e^(−k t)) / k, and the same integrated.
        let text = "kind = 'double-integrator'\n[[effect]]\nkind = 'linear-drag'\nrate_per_s = 0.8";
        let end = drive(text, [2.0, 0.0, 0.0], 2.0);
        let gone = 1.0 - (-1.6f64).exp();
        // Steps of 10 ms, of second order: (0.8 × 0.01)² / 6 a step.
        assert!((end.drive[0] - 2.5 * gone).abs() < 1e-4, "{end:?}");
        assert!((end.position_m[0] - 2.5 * (2.0 - gone / 0.8)).abs() < 1e-4, "{end:?}");
    }
}
