//! Velocity that changes only so fast.

use super::{Effect, Entry, Part, UNCHECKED};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Level, Parameter, Search};
use serde::Deserialize;

/// `kind = "acceleration-limit"`.
pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "acceleration-limit",
        doc: "The acceleration is limited.",
        fields: &[Field {
            key: "limit_mps2",
            doc: "Maximum acceleration (m/s²).",
            kind: Kind::Number(Range::above(0.0, 1e6)),
            default: Default::Required,
        }],
    },
    about: About {
        mechanism: "Torque, grip or firmware limit how fast a robot speeds up, brakes or changes direction.",
        equation: "|dv/dt| <= limit_mps2",
        source: "Definition.",
        validity: "The same in all directions, for acceleration and braking. Together with actuator-lag: dv/dt = (u - v) / \
                   tau_s, clipped at the limit. Solved exactly.",
        trace: "A ramp after large changes of command, and no error after small ones.",
        needs: &[],
        example: "limit_mps2 = 1.5\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "limit_mps2",
            unit: "m/s²",
            min: 0.01,
            max: 1e6,
            starts: &[0.1, 0.3, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 1e4, 1e6],
            step: 0.05,
        }],
        variants: &[],
        level: Level::Time,
        generalises: &[],
        search: Search::ThresholdsOfChanges,
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table| Some(Box::new(typed::<AccelerationLimit>(table))),
};

/// A bound on how fast the velocity changes.
///
/// # Model
///
/// ```text
/// |dv/dt| ≤ a        and with a lag τ:  dv/dt = (u − v)/τ, cut to the length a
/// ```
///
/// u is the velocity asked for, after delays and all effects on the command. Definition. Solved exactly within a step.
///
/// # Arguments
///
/// * `limit_mps2` a: greatest change of the velocity, or of the speed along the heading (m/s²), greater than 0.
///
/// # Validity
///
/// The same in all directions, speeding up and braking, whereas grip and torque differ between them. Turning rates are not limited.
/// Of several effects the least limit holds. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct AccelerationLimit {
    limit_mps2: f64,
}

impl Effect for AccelerationLimit {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn limit_per_s(&self, part: Part) -> f64 {
        match part {
            Part::Speed => self.limit_mps2,
            Part::Turn => f64::INFINITY,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;

    #[test]
    fn a_robot_speeds_up_evenly_and_then_goes_on() {
        // 5 m/s along (3, 4)/5 at 2 m/s²: 2.5 s and 6.25 m, then 0.5 s at 5 m/s.
        let text = "[[effect]]\nkind = 'acceleration-limit'\nlimit_mps2 = 2.0";
        assert_near(drive(text, [3.0, 4.0, 0.0], 1.0).position_m, [0.6, 0.8, 0.0]);
        assert_near(drive(text, [3.0, 4.0, 0.0], 3.0).position_m, [5.25, 7.0, 0.0]);
    }
}
