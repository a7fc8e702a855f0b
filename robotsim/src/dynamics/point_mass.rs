//! A point that has the commanded velocity at once, up to a limit.

use proto::config::{Choice, Section};

/// A velocity-commanded point mass.
///
/// # Model
///
/// ẋ = u, where u is the commanded velocity reduced to the cap: the robot of the BotNet paper, "capable of high
/// velocities" (30 m/s). The paper limits the speed; its code limits each component (up to 42.4 m/s along a diagonal).
///
/// # Validity
///
/// No inertia, drag or slip. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Section)]
pub(super) struct PointMass {
    /// The cap (m/s).
    #[key(inherited)]
    pub(super) speed_cap_mps: f64,
    /// What it limits.
    #[key(inherited)]
    cap: Cap,
}

/// What a speed cap limits.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cap {
    /// The speed, keeping the direction.
    Norm,
    /// Each velocity component separately, as BotNet's code does: the speed may reach 1.41 times the cap.
    Axis,
}

impl PointMass {
    /// The velocity (m/s) that follows from a commanded one.
    pub(super) fn velocity_mps(&self, commanded_mps: [f64; 3]) -> [f64; 3] {
        let cap = self.speed_cap_mps;
        match self.cap {
            Cap::Axis => commanded_mps.map(|component| component.clamp(-cap, cap)),
            Cap::Norm => {
                // Scaled by the largest component, so that squares cannot overflow.
                let largest = commanded_mps.iter().fold(0.0f64, |max, c| max.max(c.abs()));
                let unit = commanded_mps.map(|component| component / largest);
                let norm = libm::sqrt(unit[0] * unit[0] + unit[1] * unit[1] + unit[2] * unit[2]);
                if largest * norm <= cap || largest == 0.0 {
                    commanded_mps
                } else {
                    unit.map(|component| component / norm * cap)
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn capped(cap: Cap, velocity: [f64; 3]) -> [f64; 3] {
        PointMass { speed_cap_mps: 30.0, cap }.velocity_mps(velocity)
    }

    #[test]
    fn an_axis_cap_limits_each_component() {
        assert_eq!(capped(Cap::Axis, [31.0, 0.0, 0.0]), [30.0, 0.0, 0.0]);
        assert_eq!(capped(Cap::Axis, [31.0, -31.0, 2.0]), [30.0, -30.0, 2.0]);
    }

    #[test]
    fn a_norm_cap_keeps_the_direction() {
        assert_eq!(capped(Cap::Norm, [0.0; 3]), [0.0; 3]);
        assert_eq!(capped(Cap::Norm, [18.0, 24.0, 0.0]), [18.0, 24.0, 0.0]);
        let [x, y, z] = capped(Cap::Norm, [36.0, 48.0, 0.0]);
        assert!((x - 18.0).abs() < 1e-13 && (y - 24.0).abs() < 1e-13 && z == 0.0, "{x} {y} {z}");
    }

    proptest! {
        #[test]
        fn no_command_exceeds_the_cap(velocity in prop::array::uniform3(-1e300f64..1e300)) {
            let [x, y, z] = capped(Cap::Norm, velocity);
            // One part in 1e15 for rounding.
            prop_assert!(x * x + y * y + z * z <= 900.0 * (1.0 + 1e-15));
        }
    }
}
