//! Steering that is never quite straight.

use super::{Drive, Effect, Entry, Shape};
use proto::config::Section;
use proto::effect::{Body, Catalogued, Need};

/// `kind = "steering-bias"`.
pub(super) const ENTRY: Entry = Entry::of::<SteeringBias>();

/// A constant is added to the steering angle (car) or the yaw rate (unicycle).
///
/// # Mechanism
///
/// A linkage, a servo or a pair of wheels is not trimmed, so the robot turns when commanded to go straight.
///
/// # Equation
///
/// ```text
/// car: delta = delta_cmd + angle_rad; unicycle: omega = omega_cmd + rate_radps
/// ```
///
/// # Source
///
/// J. Borenstein and L. Feng, IEEE Trans. Robotics and Automation 12 (1996) 869 (unequal wheels).
///
/// # Validity
///
/// A unicycle turns even when commanded to stand still. No effect on bodies that are commanded by a velocity.
///
/// # Trace
///
/// Curvature where straight motion is commanded.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "steering-bias",
    needs = &[Need::TurningCommands],
    example = "rate_radps = 0.05\n",
    of_body = &[("angle_rad", Body::Car), ("rate_radps", Body::Unicycle)],
)]
struct SteeringBias {
    /// Bias of a car's steering angle (rad), to the left.
    #[key(range = -1.5..=1.5, default = 0.0)]
    #[fit(unit = "rad", starts = [0.0], step = 0.002, null = 0.0)]
    angle_rad: f64,
    /// Bias of a unicycle's yaw rate (rad/s), to the left.
    #[key(range = -100.0..=100.0, default = 0.0)]
    #[fit(unit = "rad/s", range = -20.0..=20.0, starts = [0.0], step = 0.005, null = 0.0)]
    rate_radps: f64,
}

impl Effect for SteeringBias {
    fn shape(&self, shape: Shape, [speed_mps, turn, rest]: Drive) -> Drive {
        match shape {
            Shape::Velocity => [speed_mps, turn, rest],
            Shape::Unicycle => [speed_mps, turn + self.rate_radps, rest],
            Shape::Car => [speed_mps, turn + self.angle_rad, rest],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;

    #[test]
    fn who_is_told_to_go_straight_goes_in_a_circle() {
        let text = "kind = 'unicycle'\n[[effect]]\nkind = 'steering-bias'\nrate_radps = 0.5";
        // Radius 4 m, angle 1 rad.
        let end = drive(text, [2.0, 0.0, 0.0], 2.0);
        assert_near(end.position_m, [4.0 * 1f64.sin(), 4.0 * (1.0 - 1f64.cos()), 0.0]);
        let text =
            "kind = 'car'\nwheelbase_m = 2.0\n[[effect]]\nkind = 'steering-bias'\nangle_rad = 0.3";
        let end = drive(text, [2.0, -0.3, 0.0], 2.0);
        assert_near(end.position_m, [4.0, 0.0, 0.0]);
    }
}
