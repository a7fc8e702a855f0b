//! Resistance that grows with the square of the speed.

use super::{Drive, Effect, Entry, Shape, Situation, with_speed};
use crate::dynamics::norm;
use proto::config::Section;
use proto::effect::Catalogued;

/// `kind = "quadratic-drag"`.
pub(super) const ENTRY: Entry = Entry::of::<QuadraticDrag>();

/// Drag in proportion to the square of the speed.
///
/// # Mechanism
///
/// Air drag grows with the square of the speed, so the steady speed falls short of the commanded speed, more so at high speed.
///
/// # Equation
///
/// ```text
/// v + q v^2 = u, of bodies that keep their velocity a' = a - q |v| v
/// ```
///
/// # Source
///
/// Lord Rayleigh's drag equation; e.g. L. D. Landau and E. M. Lifshitz, Fluid Mechanics, § 45. The steady state of a drive with
/// proportional speed control.
///
/// # Validity
///
/// Still air. With commands of velocity the steady state only: actuator-lag models the transient, and linear drag is aliased with
/// slip.
///
/// # Trace
///
/// An error along the motion, in proportion to the square of the speed.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(name = "quadratic-drag", example = "coefficient_per_m = 0.02\n")]
struct QuadraticDrag {
    /// q (1/m).
    #[key(range = 0.0..=1e3)]
    #[fit(unit = "1/m", range = 0.0..=100.0, starts = [0.0, 0.003, 0.03, 0.3], step = 0.001, null = 0.0)]
    coefficient_per_m: f64,
}

impl Effect for QuadraticDrag {
    fn shape(&self, shape: Shape, demand: Drive) -> Drive {
        // The positive root, in the form that is exact for small q, too.
        with_speed(shape, demand, |speed_mps| {
            2.0 * speed_mps / (1.0 + libm::sqrt(1.0 + 4.0 * self.coefficient_per_m * speed_mps))
        })
    }

    fn force_mps2(&self, at: &Situation<'_>) -> [f64; 3] {
        let speed_mps = norm(at.velocity_mps);
        at.velocity_mps.map(|part_mps| -self.coefficient_per_m * speed_mps * part_mps)
    }

    fn force_varies(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;

    #[test]
    fn speed_and_drag_together_are_the_command() {
        let text = "[[effect]]\nkind = 'quadratic-drag'\ncoefficient_per_m = 0.1";
        // 10 + 0.1 × 10² = 20.
        assert_near(drive(text, [12.0, 0.0, -16.0], 1.0).position_m, [6.0, 0.0, -8.0]);
    }

    #[test]
    fn a_body_that_falls_comes_to_the_speed_at_which_drag_bears_it() {
        // v̇ = a − q v²: v = √(a/q) tanh(√(a q) t), x = ln cosh(√(a q) t) / q.
        let text = "kind = 'double-integrator'\nspeed_cap_mps = 100.0\n[[effect]]\nkind = 'quadratic-drag'\ncoefficient_per_m = 0.2";
        let end = drive(text, [5.0, 0.0, 0.0], 2.0);
        let (fast_mps, way_m) = (5.0 * 2f64.tanh(), 2f64.cosh().ln() / 0.2);
        // Steps of 10 ms, of second order: the rate is up to 2 q v = 2, (2 × 0.01)² a second.
        assert!((end.drive[0] - fast_mps).abs() < 4e-4, "{end:?} {fast_mps}");
        assert!((end.position_m[0] - way_m).abs() < 4e-4, "{end:?} {way_m}");
    }
}
