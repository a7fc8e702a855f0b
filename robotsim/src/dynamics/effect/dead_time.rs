//! Commands that act later.

use super::{Actuator, Effect, Entry, Part};
use proto::config::Section;
use proto::effect::{Catalogued, Fixed};

/// `kind = "dead-time"`.
pub(super) const ENTRY: Entry = Entry::of::<DeadTime>();

/// Commands take effect after a delay.
///
/// # Mechanism
///
/// Buses, radios, controllers and drives delay commands: after a change of command the robot continues as before for a while.
///
/// # Equation
///
/// ```text
/// v(t) = u(t - delay_s)
/// ```
///
/// # Source
///
/// Definition (transport delay).
///
/// # Validity
///
/// The delay is constant. Several on one actuator add up. A robot stands still before its first command.
///
/// # Trace
///
/// A position error that builds up just after every change of command and then stays constant.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "dead-time",
    needs = &[],
    example = "delay_s = 0.2\n",
    variants = &[&[("on", Fixed::Text("speed"))], &[("on", Fixed::Text("turn"))]],
)]
struct DeadTime {
    /// Delay (s).
    #[key(range = 0.0..=60.0)]
    #[fit(unit = "s", range = 0.0..=5.0, starts = [0.0, 0.03, 0.1, 0.3, 1.0], step = 0.005, null = 0.0)]
    delay_s: f64,
    #[key(flatten)]
    actuator: Actuator,
}

impl Effect for DeadTime {
    fn delay_s(&self, part: Part) -> f64 {
        if part == self.actuator.on { self.delay_s } else { 0.0 }
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
