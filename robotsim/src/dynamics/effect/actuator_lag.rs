//! Actuators that follow with a time constant.

use super::{Effect, Entry, ON, Part, UNCHECKED};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Fixed, Level, Parameter};
use serde::Deserialize;

/// `kind = "actuator-lag"`.
pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "actuator-lag",
        doc: "Actuators follow the command with a first-order lag.",
        fields: &[
            Field {
                key: "tau_s",
                doc: "Time constant (s).",
                kind: Kind::Number(Range::closed(0.0, 60.0)),
                default: Default::Required,
            },
            ON,
        ],
    },
    about: About {
        mechanism: "Motors, wheels and rotors have inertia: after a change of command the velocity approaches the new \
                    value exponentially.",
        equation: "dv/dt = (u - v) / tau_s",
        source: "First-order lag: K. J. Astrom and R. M. Murray, Feedback Systems, Princeton 2008, § 5.3.",
        validity: "One time constant at all speeds, for acceleration and braking. Solved exactly. Several on one actuator \
                   count as one with the sum of their time constants.",
        trace: "A decaying error after every change of command, in proportion to the change and not to the speed.",
        needs: &[],
        example: "tau_s = 0.3\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "tau_s",
            unit: "s",
            min: 0.0,
            max: 10.0,
            starts: &[0.0, 0.05, 0.15, 0.5, 1.5],
            step: 0.005,
        }],
        variants: &[&[("on", Fixed::Text("speed"))], &[("on", Fixed::Text("turn"))]],
        level: Level::Time,
        generalises: &[],
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table| Some(Box::new(typed::<ActuatorLag>(table))),
};

/// Actuators that follow with a time constant.
///
/// # Model
///
/// ```text
/// dv/dt = (u − v)/τ
/// ```
///
/// First-order lag: Åström and Murray, Feedback Systems, Princeton 2008, § 5.3. u is what is asked of the actuator, v what it
/// does. Solved exactly within a step.
///
/// # Arguments
///
/// * `tau_s` τ: the time constant (s), not negative; 0: the actuator follows at once.
/// * `on`: which actuator: `speed`, or `turn` (yaw rate or steering).
///
/// # Validity
///
/// One time constant at all speeds, up and down alike: drives that saturate, or brake faster than they accelerate, are not
/// described. Bodies that keep their velocity add τ to the lag of their thrust. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct ActuatorLag {
    tau_s: f64,
    on: Part,
}

impl Effect for ActuatorLag {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn lag_s(&self, part: Part) -> f64 {
        if part == self.on { self.tau_s } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;

    #[test]
    fn a_step_of_the_command_is_answered_by_an_exponential() {
        // v = u (1 − e^(−t/τ)), x = u (t − τ (1 − e^(−t/τ))).
        let end = drive("[[effect]]\nkind = 'actuator-lag'\ntau_s = 0.5", [2.0, 0.0, 1.0], 1.5);
        let share = 1.0 - (-3.0f64).exp();
        assert_near(end.drive, [2.0 * share, 0.0, share]);
        let way = 1.5 - 0.5 * share;
        assert_near(end.position_m, [2.0 * way, 0.0, way]);
    }

    #[test]
    fn the_lag_of_steering_leaves_the_speed_alone() {
        let text = "kind = 'unicycle'\n[[effect]]\nkind = 'actuator-lag'\ntau_s = 0.5\non = 'turn'";
        let end = drive(text, [2.0, 1.0, 0.0], 1.5);
        assert_eq!(end.drive[0], 2.0);
        assert!((end.heading_rad - (1.5 - 0.5 * (1.0 - (-3.0f64).exp()))).abs() < 1e-12);
    }
}
