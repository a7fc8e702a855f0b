//! Small commands that move nothing.

use super::{Drive, Effect, Entry, ON, Part, Shape, UNCHECKED, with_speed};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Fixed, Level, Need, Parameter, Search};
use serde::Deserialize;

/// `kind = "dead-band"`.
pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "dead-band",
        doc: "Commands below a threshold have no effect.",
        fields: &[
            Field {
                key: "threshold_mps",
                doc: "Commanded speed (m/s), or for the turn actuator yaw rate (rad/s) or steering (rad), below which the \
                      robot does not move.",
                kind: Kind::Number(Range::closed(0.0, 1e4)),
                default: Default::Required,
            },
            ON,
        ],
    },
    about: About {
        mechanism: "Static friction holds the drive until the command is large enough.",
        equation: "v = 0 where |u| < threshold_mps, else u",
        source: "Stiction in its simplest form: B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, A survey of models, analysis tools and compensation methods for the control of machines with friction, Automatica 30 (1994) 1083.",
        validity: "The threshold is the same at rest and in motion (no hysteresis), and above it the whole command acts.",
        trace: "An error only at low commanded speeds, as large as the command.",
        needs: &[Need::VelocityCommands],
        example: "threshold_mps = 0.05\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "threshold_mps",
            unit: "m/s",
            min: 0.0,
            max: 100.0,
            starts: &[0.03, 0.06, 0.12, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0],
            step: 0.02,
        }],
        variants: &[&[("on", Fixed::Text("speed"))], &[("on", Fixed::Text("turn"))]],
        level: Level::Time,
        generalises: &[],
        search: Search::Thresholds { only_below: true },
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table| Some(Box::new(typed::<DeadBand>(table))),
};

/// No motion below a commanded speed.
///
/// # Model
///
/// ```text
/// v = 0  where |u| < c,        else v = u
/// ```
///
/// Stiction in its simplest form: Armstrong-Hélouvry, Dupont and Canudas de Wit, "A survey of models, analysis tools and
/// compensation methods for the control of machines with friction", Automatica 30 (1994) 1083.
///
/// # Arguments
///
/// * `threshold_mps` c: the least command that moves the actuator (m/s; rad/s or rad on `turn`), not negative.
/// * `on`: which actuator: `speed`, or `turn` (yaw rate or steering).
///
/// # Validity
///
/// The threshold is the same from rest and in motion (no hysteresis), and above it all of the command acts: real friction also
/// takes away a part of what exceeds the threshold. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct DeadBand {
    threshold_mps: f64,
    on: Part,
}

impl Effect for DeadBand {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn shape(&self, shape: Shape, mut demand: Drive) -> Drive {
        let pass = |size: f64| if size < self.threshold_mps { 0.0 } else { size };
        match self.on {
            Part::Speed => with_speed(shape, demand, pass),
            Part::Turn => {
                if shape.is_turning() && demand[1].abs() < self.threshold_mps {
                    demand[1] = 0.0;
                }
                demand
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;

    #[test]
    fn a_command_below_the_threshold_moves_nothing_and_one_above_acts_in_full() {
        let text = "[[effect]]\nkind = 'dead-band'\nthreshold_mps = 0.5";
        assert_eq!(drive(text, [0.3, 0.3, 0.0], 2.0).position_m, [0.0; 3]);
        assert_near(drive(text, [0.3, 0.4, 0.0], 2.0).position_m, [0.6, 0.8, 0.0]);
    }

    #[test]
    fn small_steering_does_not_turn() {
        let text =
            "kind = 'unicycle'\n[[effect]]\nkind = 'dead-band'\nthreshold_mps = 0.2\non = 'turn'";
        assert_eq!(drive(text, [1.0, 0.1, 0.0], 2.0).heading_rad, 0.0);
        assert_near(drive(text, [0.1, 0.1, 0.0], 2.0).position_m, [0.2, 0.0, 0.0]);
    }
}
