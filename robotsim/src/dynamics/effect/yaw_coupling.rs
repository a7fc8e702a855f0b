//! Drift to the side in turns.

use super::{Effect, Entry, UNCHECKED};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Level, Need, Parameter};
use serde::Deserialize;

/// `kind = "yaw-coupling"`.
pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "yaw-coupling",
        doc: "The body moves sideways in turns.",
        fields: &[Field {
            key: "gain",
            doc: "Sideways velocity per product of speed and yaw rate (s), positive towards the inside of the turn, negative \
                  outwards.",
            kind: Kind::Number(Range::closed(-10.0, 10.0)),
            default: Default::Required,
        }],
    },
    about: About {
        mechanism: "In a turn, friction with the ground must provide the centripetal force. If it is too small, the body \
                    slides outwards, more so at higher speed and yaw rate.",
        equation: "v = u + gain * (omega x u)",
        source: "The steady state of dv/dt = (u - v) / tau + c (omega x v) for a small tau: gain = c tau. Sideslip: R. Rajamani, Vehicle Dynamics and Control, § 2.3.",
        validity: "Steady turns below the limit of grip. No effect on bodies that are commanded by a velocity.",
        trace: "An error across the motion, in turns only.",
        needs: &[Need::TurningCommands],
        example: "gain = 0.1\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "gain",
            unit: "s",
            min: -10.0,
            max: 10.0,
            starts: &[0.0],
            step: 0.005,
        }],
        variants: &[],
        level: Level::Time,
        generalises: &[],
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table| Some(Box::new(typed::<YawCoupling>(table))),
};

/// A body that slides outwards in turns.
///
/// # Model
///
/// ```text
/// v = u + g (ω × u)
/// ```
///
/// The steady state of dv/dt = (u − v)/τ + c (ω × v) for a small τ, g = c τ. Sideslip of vehicles: Rajamani, Vehicle Dynamics and
/// Control, § 2.3. u is the velocity along the course, ω the yaw rate.
///
/// # Arguments
///
/// * `gain` g: sideways velocity per yaw rate and speed (s); positive: to the inside of the turn.
///
/// # Validity
///
/// Steady turns below the limit of grip: how sideslip builds up is not described. Of several effects the gains are added. Nothing
/// for bodies that are commanded by a velocity. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct YawCoupling {
    gain: f64,
}

impl Effect for YawCoupling {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

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
