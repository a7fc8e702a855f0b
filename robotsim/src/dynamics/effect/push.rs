//! A force that is always there.

use super::{Effect, Entry, Situation};
use crate::dynamics::norm;
use proto::config::Section;
use proto::effect::{Catalogued, Fixed, Need};

/// `kind = "push"`.
pub(super) const ENTRY: Entry = Entry::of::<Push>();

/// A constant force on a body that keeps its velocity.
///
/// # Mechanism
///
/// A fan, a steady wind on a robot that hardly moves, or a tether pushes the robot, whatever it is commanded.
///
/// # Equation
///
/// ```text
/// a' = a + acceleration_mps2
/// ```
///
/// # Source
///
/// Newton's second law.
///
/// # Validity
///
/// The same force everywhere and at all speeds; where it depends on the speed, see wind. Its
/// horizontal part is aliased with attitude-bias of a robot that never turns. The vertical part is configured and not fitted: at hover
/// it is aliased with thrust-scale.
///
/// # Trace
///
/// An error in one direction that grows with the square of time, the same for all commands.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "push",
    needs = &[Need::ThrustCommands],
    example = "acceleration_mps2 = [0.5, -0.2, 0.0]\n",
    variants = &[&[("acceleration_mps2[2]", Fixed::Number(0.0))]],
    needs_one_frame = true,
)]
struct Push {
    /// Force by mass (east, north, up in m/s²).
    #[key(range = -1e3..=1e3)]
    #[fit(
        key = "acceleration_mps2[0]",
        unit = "m/s²",
        range = -100.0..=100.0,
        starts = [0.0],
        step = 0.005,
        plausible = -30.0..=30.0,
        source = "drag of a quadrotor in a storm: 0.5 1/s times 60 m/s",
    )]
    #[fit(
        key = "acceleration_mps2[1]",
        unit = "m/s²",
        range = -100.0..=100.0,
        starts = [0.0],
        step = 0.005,
        plausible = -30.0..=30.0,
        source = "drag of a quadrotor in a storm: 0.5 1/s times 60 m/s",
    )]
    acceleration_mps2: [f64; 3],
}

impl Effect for Push {
    fn force_mps2(&self, _at: &Situation<'_>) -> [f64; 3] {
        self.acceleration_mps2
    }

    fn most_force_mps2(&self) -> f64 {
        norm(self.acceleration_mps2)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;

    #[test]
    fn what_hovers_is_accelerated_whatever_its_mass_and_thrust() {
        for body in ["double-integrator", "quadrotor"] {
            let text = format!(
                "kind = '{body}'\n[[effect]]\nkind = 'push'\nacceleration_mps2 = [0.4, -0.2, 0.1]"
            );
            let end = drive(&text, [0.0; 3], 3.0);
            assert_near(end.drive, [1.2, -0.6, 0.3]);
            assert_near(end.position_m, [1.8, -0.9, 0.45]);
        }
    }

    #[test]
    fn what_is_carried_by_its_wheels_is_not_pushed_away() {
        let text = "[[effect]]\nkind = 'push'\nacceleration_mps2 = [0.4, -0.2, 0.0]";
        assert_near(drive(text, [1.0, 0.0, 0.0], 3.0).position_m, [3.0, 0.0, 0.0]);
    }
}
