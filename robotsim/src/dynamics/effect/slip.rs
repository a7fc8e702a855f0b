//! Wheels that slip, or are not as large as assumed.

use super::{Actuator, Drive, Effect, Entry, Part, Shape};
use proto::config::Section;
use proto::effect::{Catalogued, Fixed, Need};

/// `kind = "slip"`.
pub(super) const ENTRY: Entry = Entry::of::<Slip>();

/// The robot executes a constant fraction of its commands.
///
/// # Mechanism
///
/// Wheels slip, their radius differs from the assumed one, or a drive is miscalibrated. Positions with a wrong scale have the same
/// signature.
///
/// # Equation
///
/// ```text
/// v = scale * u
/// ```
///
/// # Source
///
/// J. Borenstein and L. Feng, Measurement and correction of systematic odometry errors in mobile robots, IEEE Trans. Robotics and
/// Automation 12 (1996) 869.
///
/// # Validity
///
/// One fraction at all speeds and on all grounds.
///
/// # Trace
///
/// An error along the motion, in proportion to the speed (on turns: to the turn).
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "slip",
    needs = &[Need::VelocityCommands],
    example = "scale = 0.95\n",
    variants = &[&[("on", Fixed::Text("speed"))], &[("on", Fixed::Text("turn"))]],
)]
struct Slip {
    /// Ratio of executed to commanded velocity; with on = "turn", of the yaw rate or steering angle.
    #[key(range = 0.0..=10.0)]
    #[fit(
        unit = "1",
        range = 0.0..=5.0,
        starts = [1.0],
        step = 0.005,
        null = 1.0,
        plausible = 0.0..=2.0,
        source = "Wong, Theory of Ground Vehicles: a slip of 0 to 1 of the commanded speed",
    )]
    scale: f64,
    #[key(flatten)]
    actuator: Actuator,
}

impl Effect for Slip {
    fn shape(&self, shape: Shape, mut demand: Drive) -> Drive {
        match (self.actuator.on, shape.is_turning()) {
            (Part::Speed, false) => demand.map(|part| part * self.scale),
            (Part::Speed, true) => {
                demand[0] *= self.scale;
                demand
            }
            (Part::Turn, false) => demand,
            (Part::Turn, true) => {
                demand[1] *= self.scale;
                demand
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;

    #[test]
    fn a_robot_goes_that_share_of_the_way() {
        let end = drive("[[effect]]\nkind = 'slip'\nscale = 0.9", [3.0, -1.0, 0.5], 2.0);
        assert_near(end.position_m, [5.4, -1.8, 0.9]);
    }

    #[test]
    fn a_car_that_steers_less_drives_a_wider_circle() {
        let text =
            "kind = 'car'\nwheelbase_m = 0.5\n[[effect]]\nkind = 'slip'\nscale = 0.8\non = 'turn'";
        let end = drive(text, [2.0, 0.4, 0.0], 1.0);
        assert!((end.heading_rad - 2.0 * 0.32f64.tan() / 0.5).abs() < 1e-12, "{end:?}");
    }
}
