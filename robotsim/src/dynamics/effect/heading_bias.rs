//! Motion at an angle to what is commanded.

use super::{Drive, Effect, Entry, Shape, UNCHECKED};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Level, Parameter};
use serde::Deserialize;

/// `kind = "heading-bias"`.
pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "heading-bias",
        doc: "The direction of motion has a constant bias from the command, or from the heading.",
        fields: &[Field {
            key: "angle_rad",
            doc: "Angle of the bias, to the left (rad).",
            kind: Kind::Number(Range::closed(-3.2, 3.2)),
            default: Default::Required,
        }],
    },
    about: About {
        mechanism: "A compass is biased or was mounted at an angle, so the robot moves in another direction than \
                    commanded. A rotated coordinate frame of the positions has the same signature.",
        equation: "v = R(angle_rad) u; a turning body: course = heading + angle_rad",
        source: "J. Borenstein and L. Feng, IEEE Trans. Robotics and Automation 12 (1996) 869; definition.",
        validity: "One angle at all places and headings, in the plane.",
        trace: "An error across the motion, in proportion to the speed.",
        needs: &[],
        example: "angle_rad = 0.05\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "angle_rad",
            unit: "rad",
            min: -3.2,
            max: 3.2,
            starts: &[0.0, 1.0, -1.0, 2.5, -2.5],
            step: 0.005,
        }],
        variants: &[],
        level: Level::Time,
        generalises: &[],
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table| Some(Box::new(typed::<HeadingBias>(table))),
};

/// A direction that is not the one asked for.
///
/// # Model
///
/// ```text
/// bodies commanded by a velocity:  v = R(α) u              R(α): rotation about the vertical
/// turning bodies:                  course = heading + α
/// ```
///
/// A rotation, by definition; a compass or an odometer whose heading is off: Borenstein and Feng, IEEE Trans. Robotics and
/// Automation 12 (1996) 869.
///
/// # Arguments
///
/// * `angle_rad` α: by how much (rad), from +x towards +y.
///
/// # Validity
///
/// One angle at all places and headings, in the plane: the deviation of a compass near iron depends on both. Of several effects the
/// angles are added. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct HeadingBias {
    angle_rad: f64,
}

impl Effect for HeadingBias {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

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
