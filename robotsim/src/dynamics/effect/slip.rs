//! Wheels that slip, or are not as large as assumed.

use super::{Drive, Effect, Entry, ON, Part, Shape, UNCHECKED};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Fixed, Level, Need, Parameter};
use serde::Deserialize;

/// `kind = "slip"`.
pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "slip",
        doc: "The robot executes a constant fraction of its commands.",
        fields: &[
            Field {
                key: "scale",
                doc: "Ratio of executed to commanded velocity; with on = \"turn\", of the yaw rate or steering angle.",
                kind: Kind::Number(Range::closed(0.0, 10.0)),
                default: Default::Required,
            },
            ON,
        ],
    },
    about: About {
        mechanism: "Wheels slip, their radius differs from the assumed one, or a drive is miscalibrated. Positions with a \
                    wrong scale have the same signature.",
        equation: "v = scale * u",
        source: "J. Borenstein and L. Feng, Measurement and correction of systematic odometry errors in mobile robots, IEEE Trans. Robotics and Automation 12 (1996) 869.",
        validity: "One fraction at all speeds and on all grounds.",
        trace: "An error along the motion, in proportion to the speed (on turns: to the turn).",
        needs: &[Need::VelocityCommands],
        example: "scale = 0.95\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "scale",
            unit: "1",
            min: 0.0,
            max: 5.0,
            starts: &[1.0],
            step: 0.005,
        }],
        variants: &[&[("on", Fixed::Text("speed"))], &[("on", Fixed::Text("turn"))]],
        level: Level::Time,
        generalises: &[],
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table| Some(Box::new(typed::<Slip>(table))),
};

/// A drive that does a constant share of what is asked.
///
/// # Model
///
/// ```text
/// v = s u
/// ```
///
/// A wheel whose radius is not the assumed one: Borenstein and Feng, "Measurement and correction of systematic odometry errors in
/// mobile robots", IEEE Trans. Robotics and Automation 12 (1996) 869.
///
/// # Arguments
///
/// * `scale` s: what is done per what is asked (1), not negative.
/// * `on`: which actuator: `speed`, or `turn` (yaw rate or steering).
///
/// # Validity
///
/// One share at all speeds and on all grounds: tyres slip more the more force they carry. On `turn` it does nothing to bodies that
/// are commanded by a velocity. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct Slip {
    scale: f64,
    on: Part,
}

impl Effect for Slip {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn shape(&self, shape: Shape, mut demand: Drive) -> Drive {
        match (self.on, shape.is_turning()) {
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
