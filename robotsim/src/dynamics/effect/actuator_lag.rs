//! Actuators that follow with a time constant.

use super::{Actuator, Effect, Entry, Part};
use proto::config::Section;
use proto::effect::{Catalogued, Fixed};

/// `kind = "actuator-lag"`.
pub(super) const ENTRY: Entry = Entry::of::<ActuatorLag>();

/// Actuators follow the command with a first-order lag.
///
/// # Mechanism
///
/// Motors, wheels and rotors have inertia: after a change of command the velocity approaches the new value exponentially.
///
/// # Equation
///
/// ```text
/// dv/dt = (u - v) / tau_s
/// ```
///
/// # Source
///
/// First-order lag: K. J. Astrom and R. M. Murray, Feedback Systems, Princeton 2008, § 5.3.
///
/// # Validity
///
/// One time constant at all speeds, for acceleration and braking. Solved exactly. Several on one actuator count as one with the sum
/// of their time constants.
///
/// # Trace
///
/// A decaying error after every change of command, in proportion to the change and not to the speed.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "actuator-lag",
    needs = &[],
    example = "tau_s = 0.3\n",
    variants = &[&[("on", Fixed::Text("speed"))], &[("on", Fixed::Text("turn"))]],
)]
struct ActuatorLag {
    /// Time constant (s).
    #[key(range = 0.0..=60.0)]
    #[fit(unit = "s", range = 0.0..=10.0, starts = [0.0, 0.05, 0.15, 0.5, 1.5], step = 0.005, null = 0.0)]
    tau_s: f64,
    #[key(flatten)]
    actuator: Actuator,
}

impl Effect for ActuatorLag {
    fn lag_s(&self, part: Part) -> f64 {
        if part == self.actuator.on { self.tau_s } else { 0.0 }
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
