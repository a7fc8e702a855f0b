//! Motion at an angle to what is commanded.

use super::{Drive, Effect, Entry, Shape};
use proto::config::Section;
use proto::effect::{Bounds, Catalogued};

/// `kind = "heading-bias"`.
pub(super) const ENTRY: Entry = Entry::of::<HeadingBias>();

/// The direction of motion has a constant bias from the command, or from the heading.
///
/// # Mechanism
///
/// A compass is biased or was mounted at an angle, so the robot moves in another direction than commanded. A rotated coordinate
/// frame of the positions has the same signature.
///
/// # Equation
///
/// ```text
/// v = R(angle_rad) u; a turning body: course = heading + angle_rad
/// ```
///
/// # Source
///
/// J. Borenstein and L. Feng, IEEE Trans. Robotics and Automation 12 (1996) 869; definition.
///
/// # Validity
///
/// One angle at all places and headings, in the plane.
///
/// # Trace
///
/// An error across the motion, in proportion to the speed.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "heading-bias",
    needs = &[],
    example = "angle_rad = 0.05\n",
    bounds = Some(Bounds::Course),
)]
struct HeadingBias {
    /// Angle of the bias, to the left (rad).
    #[key(range = -3.2..=3.2)]
    #[fit(unit = "rad", starts = [0.0, 1.0, -1.0, 2.5, -2.5], step = 0.005, null = 0.0)]
    angle_rad: f64,
}

impl Effect for HeadingBias {
    fn shape(&self, shape: Shape, demand: Drive) -> Drive {
        if shape.is_turning() {
            return demand;
        }
        let (sin, cos) = libm::sincos(self.angle_rad);
        let [x, y, z] = demand;
        [x * cos - y * sin, x * sin + y * cos, z]
    }

    fn course_rad(&self) -> f64 {
        self.angle_rad
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;

    #[test]
    fn a_quarter_turn_makes_east_north() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let text = format!("[[effect]]\nkind = 'heading-bias'\nangle_rad = {quarter}");
        assert_near(drive(&text, [3.0, 0.0, 1.0], 2.0).position_m, [0.0, 6.0, 2.0]);
        let end = drive(&format!("kind = 'unicycle'\n{text}"), [3.0, 0.0, 0.0], 2.0);
        assert_near(end.position_m, [0.0, 6.0, 0.0]);
        assert_eq!(end.heading_rad, 0.0, "the body faces east still");
    }
}
