//! Small commands that move nothing.

use super::{Actuator, Drive, Effect, Entry, Part, Shape, with_speed};
use proto::config::Section;
use proto::effect::{Bounds, Catalogued, Fixed, Need, Search};

/// `kind = "dead-band"`.
pub(super) const ENTRY: Entry = Entry::of::<DeadBand>();

/// Commands below a threshold have no effect.
///
/// # Mechanism
///
/// Static friction holds the drive until the command is large enough.
///
/// # Equation
///
/// ```text
/// v = 0 where |u| < threshold_mps, else u
/// ```
///
/// # Source
///
/// Stiction in its simplest form: B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, A survey of models, analysis tools and
/// compensation methods for the control of machines with friction, Automatica 30 (1994) 1083.
///
/// # Validity
///
/// The threshold is the same at rest and in motion (no hysteresis), and above it the whole command acts.
///
/// # Trace
///
/// An error only at low commanded speeds, as large as the command.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "dead-band",
    needs = &[Need::VelocityCommands],
    example = "threshold_mps = 0.05\n",
    variants = &[&[("on", Fixed::Text("speed"))], &[("on", Fixed::Text("turn"))]],
    search = Search::Thresholds { only_below: true },
    bounds = Some(Bounds::Standstill),
)]
struct DeadBand {
    /// Commanded speed (m/s), or for the turn actuator yaw rate (rad/s) or steering (rad), below which the robot does not move.
    #[key(range = 0.0..=1e4)]
    #[fit(unit = "m/s", range = 0.0..=100.0, starts = [0.03, 0.06, 0.12, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0], step = 0.02)]
    threshold_mps: f64,
    #[key(flatten)]
    actuator: Actuator,
}

impl Effect for DeadBand {
    fn shape(&self, shape: Shape, mut demand: Drive) -> Drive {
        let pass = |size: f64| if size < self.threshold_mps { 0.0 } else { size };
        match self.actuator.on {
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
