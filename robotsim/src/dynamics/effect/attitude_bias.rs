//! Thrust that points beside where it is asked to.

use super::{Effect, Entry};
use proto::config::Section;
use proto::effect::{Catalogued, Need};

/// `kind = "attitude-bias"`.
pub(super) const ENTRY: Entry = Entry::of::<AttitudeBias>();

/// The thrust is tilted against the commanded attitude.
///
/// # Mechanism
///
/// The attitude estimate or the mounting of the autopilot is off by a constant angle, or the centre of gravity is off the middle. The
/// robot is tilted where it believes to be level.
///
/// # Equation
///
/// ```text
/// a' = R_z(yaw) R_y(pitch_rad) R_x(roll_rad) R_z(-yaw) (a + g e_z) - g e_z of a quadrotor, without g of other bodies
/// ```
///
/// # Source
///
/// Definition; axes as in B. Siciliano et al., Robotics: Modelling, Planning and Control, § 2.4.2.
///
/// # Validity
///
/// Small angles. It turns with the robot as far as headings, or the yaw of the commands, are known; a robot that never turns is pushed
/// in one direction: see push.
///
/// # Trace
///
/// A horizontal error that grows with the square of time, in a direction that turns with the robot.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "attitude-bias",
    needs = &[Need::ThrustCommands],
    example = "roll_rad = 0.03\npitch_rad = -0.02\n",
)]
struct AttitudeBias {
    /// Roll beside the commanded one (rad). Positive: the right side is lower.
    #[key(range = -1.5..=1.5)]
    #[fit(
        unit = "rad",
        starts = [0.0],
        step = 0.0005,
        plausible = -0.35..=0.35,
        source = "20 degrees: beyond what autopilots accept before they arm",
    )]
    roll_rad: f64,
    /// Pitch beside the commanded one (rad). Positive: the nose is lower.
    #[key(range = -1.5..=1.5)]
    #[fit(
        unit = "rad",
        starts = [0.0],
        step = 0.0005,
        plausible = -0.35..=0.35,
        source = "20 degrees: beyond what autopilots accept before they arm",
    )]
    pitch_rad: f64,
}

impl Effect for AttitudeBias {
    fn tilt_rad(&self) -> [f64; 2] {
        [self.roll_rad, self.pitch_rad]
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;
    use crate::dynamics::GRAVITY_MPS2;
    use crate::dynamics::physics::{Order, Robot};
    use crate::dynamics::surroundings::Surroundings;

    #[test]
    fn what_believes_to_be_level_slides_where_it_is_lowered() {
        let text = "kind = 'quadrotor'\n[[effect]]\nkind = 'attitude-bias'\nroll_rad = 0.1\npitch_rad = 0.0";
        // Right side down, facing east: to the south, and down by what the thrust lacks upwards.
        let (sin, cos) = 0.1f64.sin_cos();
        let down_mps2 = GRAVITY_MPS2 * (cos - 1.0);
        let end = drive(text, [0.0; 3], 2.0);
        assert_near(end.drive, [0.0, -2.0 * GRAVITY_MPS2 * sin, 2.0 * down_mps2]);
        // Facing north: to the east.
        let physics = physics(text);
        let mut robot = Robot { heading_rad: std::f64::consts::FRAC_PI_2, ..Robot::default() };
        let orders = [Order { from_s: 0.0, demand: [0.0; 3] }];
        physics.advance(&mut robot, &orders, &mut 0, 0.0, 2.0, &Surroundings::default());
        assert_near(robot.drive, [2.0 * GRAVITY_MPS2 * sin, 0.0, 2.0 * down_mps2]);
    }

    #[test]
    fn a_body_without_weight_is_turned_only_where_it_is_asked_to_accelerate() {
        let text = "kind = 'double-integrator'\n[[effect]]\nkind = 'attitude-bias'\nroll_rad = 0.0\npitch_rad = 0.1";
        assert_near(drive(text, [0.0; 3], 2.0).drive, [0.0; 3]);
        let end = drive(text, [0.0, 0.0, 1.0], 2.0);
        assert_near(end.drive, [2.0 * 0.1f64.sin(), 0.0, 2.0 * 0.1f64.cos()]);
    }
}
