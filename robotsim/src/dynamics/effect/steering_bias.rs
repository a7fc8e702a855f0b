//! Steering that is never quite straight.

use super::{Drive, Effect, Entry, Shape, UNCHECKED};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Body, Fit, Level, Need, Parameter};
use serde::Deserialize;

/// `kind = "steering-bias"`.
pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "steering-bias",
        doc: "A constant is added to the steering angle (car) or the yaw rate (unicycle).",
        fields: &[
            Field {
                key: "angle_rad",
                doc: "Bias of a car's steering angle (rad), to the left.",
                kind: Kind::Number(Range::closed(-1.5, 1.5)),
                default: Default::Number(0.0),
            },
            Field {
                key: "rate_radps",
                doc: "Bias of a unicycle's yaw rate (rad/s), to the left.",
                kind: Kind::Number(Range::closed(-100.0, 100.0)),
                default: Default::Number(0.0),
            },
        ],
    },
    about: About {
        mechanism: "A linkage, a servo or a pair of wheels is not trimmed, so the robot turns when commanded to go straight.",
        equation: "car: delta = delta_cmd + angle_rad; unicycle: omega = omega_cmd + rate_radps",
        source: "J. Borenstein and L. Feng, IEEE Trans. Robotics and Automation 12 (1996) 869 (unequal wheels).",
        validity: "A unicycle turns even when commanded to stand still. No effect on bodies that are commanded by a velocity.",
        trace: "Curvature where straight motion is commanded.",
        needs: &[Need::TurningCommands],
        example: "rate_radps = 0.05\n",
    },
    fit: Fit {
        parameters: &[
            Parameter {
                key: "angle_rad",
                unit: "rad",
                min: -1.5,
                max: 1.5,
                starts: &[0.0],
                step: 0.002,
            },
            Parameter {
                key: "rate_radps",
                unit: "rad/s",
                min: -20.0,
                max: 20.0,
                starts: &[0.0],
                step: 0.005,
            },
        ],
        variants: &[],
        level: Level::Time,
        generalises: &[],
        of_body: &[("angle_rad", Body::Car), ("rate_radps", Body::Unicycle)],
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table| Some(Box::new(typed::<SteeringBias>(table))),
};

/// A trim of the steering or of the yaw rate.
///
/// # Model
///
/// ```text
/// car:      δ = δ_cmd + b
/// unicycle: ω = ω_cmd + c
/// ```
///
/// Wheels of unequal size make a robot turn that is commanded to go straight: Borenstein and Feng, IEEE Trans. Robotics and Automation 12
/// (1996) 869.
///
/// # Arguments
///
/// * `angle_rad` b: added to the steering angle of cars (rad), to the left.
/// * `rate_radps` c: added to the yaw rate of unicycles (rad/s), to the left.
///
/// # Validity
///
/// Constant: unequal wheels turn a robot in proportion to its speed, whereas here a unicycle that is commanded to stand still turns all
/// the same. Nothing for bodies that are commanded by a velocity. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct SteeringBias {
    angle_rad: f64,
    rate_radps: f64,
}

impl Effect for SteeringBias {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

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
