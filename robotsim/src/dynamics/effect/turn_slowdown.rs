//! Loss of speed in turns.

use super::{Effect, Entry};
use proto::config::Section;
use proto::effect::{Catalogued, Need};

/// `kind = "turn-slowdown"`.
pub(super) const ENTRY: Entry = Entry::of::<TurnSlowdown>();

/// The body is slower in turns, in proportion to the yaw rate.
///
/// # Mechanism
///
/// In a turn, wheels slip and scrub sideways, and motors must turn the robot as well as drive it. Both reduce the speed.
///
/// # Equation
///
/// ```text
/// v = u * max(0, 1 - gain * |omega|)
/// ```
///
/// # Source
///
/// A phenomenological law, of first order in the yaw rate. Slip of wheels and tracks in turns: A. Mandow et al., Experimental
/// kinematics for wheeled skid-steer mobile robots, IROS 2007.
///
/// # Validity
///
/// Moderate yaw rates, one ground. The yaw rate of a unicycle is not changed; a car turns on the same arc, more slowly. No effect
/// on bodies that are commanded by a velocity.
///
/// # Trace
///
/// An error against the motion, in turns only, to either side alike.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "turn-slowdown",
    needs = &[Need::TurningCommands],
    example = "gain = 0.1\n",
)]
struct TurnSlowdown {
    /// Fraction of the speed that is lost per unit of yaw rate (s/rad).
    #[key(range = 0.0..=10.0)]
    #[fit(unit = "s/rad", starts = [0.02], step = 0.002, null = 0.0)]
    gain: f64,
}

impl Effect for TurnSlowdown {
    fn slowdown_s(&self) -> f64 {
        self.gain
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;

    const UNICYCLE: &str = "kind = 'unicycle'\n[[effect]]\nkind = 'turn-slowdown'\ngain = 0.4";

    #[test]
    fn a_unicycle_turns_as_before_on_a_smaller_circle() {
        let t = 3.0f64;
        for (v, omega) in [(2.0f64, 0.5f64), (2.0, -0.5), (-1.0, 0.5)] {
            let end = drive(UNICYCLE, [v, omega, 0.0], t);
            let radius_m = v * (1.0 - 0.4 * omega.abs()) / omega;
            let turned = omega * t;
            let exact = [radius_m * turned.sin(), radius_m * (1.0 - turned.cos()), 0.0];
            assert_near(end.position_m, exact);
            assert!((end.heading_rad - turned).abs() < 1e-12, "{end:?}");
        }
        assert_eq!(drive(UNICYCLE, [2.0, 0.0, 0.0], 1.0).position_m, [2.0, 0.0, 0.0]);
    }

    #[test]
    fn no_turn_makes_it_go_backwards() {
        let end = drive(UNICYCLE, [2.0, 3.0, 0.0], 1.0);
        assert_near(end.position_m, [0.0; 3]);
        assert!((end.heading_rad - 3.0).abs() < 1e-12, "{end:?}");
    }

    #[test]
    fn a_car_keeps_its_arc_and_is_longer_on_it() {
        let text =
            "kind = 'car'\nwheelbase_m = 0.5\n[[effect]]\nkind = 'turn-slowdown'\ngain = 0.2";
        let (v, delta, t) = (1.0f64, 0.3f64, 2.0f64);
        let end = drive(text, [v, delta, 0.0], t);
        let per_m = delta.tan() / 0.5;
        let way_m = v * (1.0 - 0.2 * v * per_m) * t;
        let turned = way_m * per_m;
        assert_near(end.position_m, [turned.sin() / per_m, (1.0 - turned.cos()) / per_m, 0.0]);
        assert!((end.heading_rad - turned).abs() < 1e-12, "{end:?}");
    }
}
