//! Drift to the side in turns.

use super::{Effect, Entry};
use proto::config::Section;
use proto::effect::{Catalogued, Need};

/// `kind = "yaw-coupling"`.
pub(super) const ENTRY: Entry = Entry::of::<YawCoupling>();

/// The body moves sideways in turns.
///
/// # Mechanism
///
/// In a turn, friction with the ground must provide the centripetal force. If it is too small, the body slides outwards, more so at
/// higher speed and yaw rate.
///
/// # Equation
///
/// ```text
/// v = u + gain * (omega x u)
/// ```
///
/// # Source
///
/// The steady state of dv/dt = (u - v) / tau + c (omega x v) for a small tau: gain = c tau. Sideslip: R. Rajamani, Vehicle Dynamics
/// and Control, § 2.3.
///
/// # Validity
///
/// Steady turns below the limit of grip. No effect on bodies that are commanded by a velocity.
///
/// # Trace
///
/// An error across the motion, in turns only.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "yaw-coupling",
    needs = &[Need::TurningCommands],
    example = "gain = 0.1\n",
)]
struct YawCoupling {
    /// Sideways velocity per product of speed and yaw rate (s), positive towards the inside of the turn, negative outwards.
    #[key(range = -10.0..=10.0)]
    #[fit(unit = "s", starts = [0.0], step = 0.005, null = 0.0)]
    gain: f64,
}

impl Effect for YawCoupling {
    fn sideways_s(&self) -> f64 {
        self.gain
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;

    #[test]
    fn the_circle_is_shifted_by_the_slide() {
        // v along the tangent and g ω v to the inner side: the sum is turned by atan(g ω) and longer by its secant.
        let text = "kind = 'unicycle'\n[[effect]]\nkind = 'yaw-coupling'\ngain = -0.4";
        let (v, omega, t) = (2.0f64, 0.5f64, 3.0f64);
        let end = drive(text, [v, omega, 0.0], t);
        let (along, side) = (v, -0.4 * omega * v);
        let (s, c) = ((omega * t).sin() / omega, (1.0 - (omega * t).cos()) / omega);
        assert_near(end.position_m, [along * s - side * c, along * c + side * s, 0.0]);
        assert_eq!(drive(text, [2.0, 0.0, 0.0], 1.0).position_m, [2.0, 0.0, 0.0]);
    }
}
