//! Commands that act later.

use super::{Effect, Entry, ON, Part, UNCHECKED};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Fixed, Level, Parameter};
use serde::Deserialize;

/// `kind = "dead-time"`.
pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "dead-time",
        doc: "Commands take effect after a delay.",
        fields: &[
            Field {
                key: "delay_s",
                doc: "Delay (s).",
                kind: Kind::Number(Range::closed(0.0, 60.0)),
                default: Default::Required,
            },
            ON,
        ],
    },
    about: About {
        mechanism: "Buses, radios, controllers and drives delay commands: after a change of command the robot continues as \
                    before for a while.",
        equation: "v(t) = u(t - delay_s)",
        source: "Definition (transport delay).",
        validity: "The delay is constant. Several on one actuator add up. A robot stands still before its first command.",
        trace: "A position error that builds up just after every change of command and then stays constant.",
        needs: &[],
        example: "delay_s = 0.2\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "delay_s",
            unit: "s",
            min: 0.0,
            max: 5.0,
            starts: &[0.0, 0.03, 0.1, 0.3, 1.0],
            step: 0.005,
        }],
        variants: &[&[("on", Fixed::Text("speed"))], &[("on", Fixed::Text("turn"))]],
        level: Level::Time,
        generalises: &[],
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table| Some(Box::new(typed::<DeadTime>(table))),
};

/// Commands that act later.
///
/// # Model
///
/// ```text
/// v(t) = u(t − d)
/// ```
///
/// Transport delay, by definition. Commands are kept until they have acted, so that d need not be a multiple of the control period.
///
/// # Arguments
///
/// * `delay_s` d: from when a command is given until it acts (s), not negative.
/// * `on`: which actuator: `speed`, or `turn` (yaw rate or steering).
///
/// # Validity
///
/// One delay at all times: buses and radios vary. Of several effects on one actuator the delays are added. Before its first command
/// a robot stands. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct DeadTime {
    delay_s: f64,
    on: Part,
}

impl Effect for DeadTime {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn delay_s(&self, part: Part) -> f64 {
        if part == self.on { self.delay_s } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;

    #[test]
    fn a_command_acts_that_much_later() {
        let end = drive("[[effect]]\nkind = 'dead-time'\ndelay_s = 0.4", [3.0, -1.0, 0.0], 1.0);
        assert_near(end.position_m, [1.8, -0.6, 0.0]);
    }

    #[test]
    fn late_steering_drives_straight_first() {
        let text = "kind = 'unicycle'\n[[effect]]\nkind = 'dead-time'\ndelay_s = 0.4\non = 'turn'";
        let end = drive(text, [2.0, 0.5, 0.0], 1.0);
        // 0.8 m straight, then 0.6 s on a circle of radius 4 m.
        let angle = 0.3f64;
        assert_near(end.position_m, [0.8 + 4.0 * angle.sin(), 4.0 * (1.0 - angle.cos()), 0.0]);
    }
}
