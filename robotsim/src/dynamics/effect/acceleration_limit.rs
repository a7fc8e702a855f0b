//! Velocity that changes only so fast.

use super::{Effect, Entry, Part};
use proto::config::Section;
use proto::effect::{Bounds, Catalogued, Search};

/// `kind = "acceleration-limit"`.
pub(super) const ENTRY: Entry = Entry::of::<AccelerationLimit>();

/// The acceleration is limited.
///
/// # Mechanism
///
/// Torque, grip or firmware limit how fast a robot speeds up, brakes or changes direction.
///
/// # Equation
///
/// ```text
/// |dv/dt| <= limit_mps2
/// ```
///
/// # Source
///
/// Definition.
///
/// # Validity
///
/// The same in all directions, for acceleration and braking. Together with actuator-lag: dv/dt = (u - v) / tau_s, clipped at the
/// limit. Solved exactly.
///
/// # Trace
///
/// A ramp after large changes of command, and no error after small ones.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "acceleration-limit",
    needs = &[],
    example = "limit_mps2 = 1.5\n",
    search = Search::ThresholdsOfChanges,
    bounds = Some(Bounds::Acceleration),
)]
struct AccelerationLimit {
    /// Maximum acceleration (m/s²).
    #[key(above = 0.0, most = 1e6)]
    #[fit(unit = "m/s²", range = 0.01..=1e6, starts = [0.1, 0.3, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 1e4, 1e6], step = 0.05)]
    limit_mps2: f64,
}

impl Effect for AccelerationLimit {
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
