//! A robot that is slower than assumed.

use super::{Drive, Effect, Entry, Shape, UNCHECKED, with_speed};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Level, Need, Parameter, Search};
use serde::Deserialize;

/// `kind = "speed-limit"`.
pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "speed-limit",
        doc: "The speed is limited below the model's speed cap.",
        fields: &[Field {
            key: "limit_mps",
            doc: "Maximum speed (m/s).",
            kind: Kind::Number(Range::above(0.0, 1e4)),
            default: Default::Required,
        }],
    },
    about: About {
        mechanism: "A drive saturates, or firmware limits it, below the speed that the model assumes.",
        equation: "|v| <= limit_mps, direction kept",
        source: "Definition.",
        validity: "One limit in all directions.",
        trace: "An error only at commanded speeds above the limit, against the motion, growing with the speed.",
        needs: &[Need::VelocityCommands],
        example: "limit_mps = 1.2\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "limit_mps",
            unit: "m/s",
            min: 0.01,
            max: 1e4,
            starts: &[0.1, 0.2, 0.4, 0.8, 1.5, 3.0, 5.0, 8.0, 12.0, 16.0, 20.0, 24.0, 28.0],
            step: 0.05,
        }],
        variants: &[],
        level: Level::Time,
        generalises: &[],
        search: Search::Thresholds { only_below: false },
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table| Some(Box::new(typed::<SpeedLimit>(table))),
};

/// A bound on the speed.
///
/// # Model
///
/// ```text
/// v = u min(1, c/|u|)
/// ```
///
/// Saturation, by definition. Turning bodies: their speed along the heading.
///
/// # Arguments
///
/// * `limit_mps` c: greatest speed (m/s), greater than 0.
///
/// # Validity
///
/// One limit in all directions and on any slope; the direction is kept, where drives that saturate one by one change it. Not
/// validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct SpeedLimit {
    limit_mps: f64,
}

impl Effect for SpeedLimit {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn shape(&self, shape: Shape, demand: Drive) -> Drive {
        with_speed(shape, demand, |speed_mps| speed_mps.min(self.limit_mps))
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;

    #[test]
    fn no_robot_is_faster_and_directions_are_kept() {
        let text = "[[effect]]\nkind = 'speed-limit'\nlimit_mps = 5.0";
        assert_near(drive(text, [6.0, -8.0, 0.0], 2.0).position_m, [6.0, -8.0, 0.0]);
        assert_near(drive(text, [3.0, 0.0, 0.0], 2.0).position_m, [6.0, 0.0, 0.0]);
        let end = drive(&format!("kind = 'unicycle'\n{text}"), [-7.0, 0.0, 0.0], 2.0);
        assert_near(end.position_m, [-10.0, 0.0, 0.0]);
    }
}
