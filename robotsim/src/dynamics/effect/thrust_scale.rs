//! Rotors that give more or less thrust than is asked for.

use super::{Effect, Entry, Situation};
use proto::config::Section;
use proto::effect::{Catalogued, Need};

/// `kind = "thrust-scale"`.
pub(super) const ENTRY: Entry = Entry::of::<ThrustScale>();

/// The thrust is a constant fraction of the commanded thrust.
///
/// # Mechanism
///
/// The thrust curve of the rotors is miscalibrated, the battery is low, the air is thin, or the mass is not the assumed one.
///
/// # Equation
///
/// ```text
/// a' = scale (a + g e_z) - g e_z of a quadrotor, a' = scale a of other bodies
/// ```
///
/// # Source
///
/// Thrust k omega^2 with another k than assumed: R. Mahony, V. Kumar and P. Corke, Multirotor aerial vehicles, IEEE Robotics and
/// Automation Magazine 19 (2012) 20, eq. 5.
///
/// # Validity
///
/// One fraction at all thrusts. A mass that is not the assumed one has the same signature: see payload-mass.
///
/// # Trace
///
/// A vertical error at hover that grows with the square of time, and an error along each acceleration.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "thrust-scale",
    needs = &[Need::ThrustCommands],
    example = "scale = 0.95\n",
)]
struct ThrustScale {
    /// Ratio of executed to commanded thrust.
    #[key(range = 0.0..=10.0)]
    #[fit(
        unit = "1",
        range = 0.0..=5.0,
        starts = [1.0],
        step = 0.002,
        null = 1.0,
        plausible = 0.25..=4.0,
        source = "ISO 2533: air at 5000 m has 0.6 of its density; cells of 3 to 4.2 V halve the thrust",
    )]
    scale: f64,
}

impl Effect for ThrustScale {
    fn thrust_gain(&self, _at: &Situation<'_>) -> f64 {
        self.scale
    }

    fn thrust_gains(&self) -> [f64; 2] {
        [self.scale; 2]
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;
    use crate::dynamics::GRAVITY_MPS2;

    #[test]
    fn a_quadrotor_that_is_to_hover_falls_with_what_is_lacking() {
        let text = "kind = 'quadrotor'\n[[effect]]\nkind = 'thrust-scale'\nscale = 0.9";
        let end = drive(text, [0.0; 3], 2.0);
        let fall_mps2 = -0.1 * GRAVITY_MPS2;
        assert_near(end.position_m, [0.0, 0.0, 0.5 * fall_mps2 * 4.0]);
        assert_near(end.drive, [0.0, 0.0, fall_mps2 * 2.0]);
    }

    #[test]
    fn the_lag_of_the_thrust_is_scaled_as_well() {
        // From rest, asked for a: v = s a (t − τ (1 − e^(−t/τ))), and the same integrated.
        let text = "kind = 'quadrotor'\nattitude_lag_s = 0.2\n[[effect]]\nkind = 'thrust-scale'\nscale = 1.1";
        let end = drive(text, [2.0, 0.0, 0.0], 1.0);
        let gone = 1.0 - (-5.0f64).exp();
        assert!((end.drive[0] - 1.1 * 2.0 * (1.0 - 0.2 * gone)).abs() < 1e-12, "{end:?}");
        let way_m = 1.1 * 2.0 * (0.5 - 0.2 * (1.0 - 0.2 * gone));
        assert!((end.position_m[0] - way_m).abs() < 1e-12, "{end:?} {way_m}");
    }

    #[test]
    fn a_body_that_needs_no_thrust_to_stay_where_it_is_stays() {
        let text = "kind = 'double-integrator'\n[[effect]]\nkind = 'thrust-scale'\nscale = 0.5";
        assert_near(drive(text, [0.0; 3], 2.0).position_m, [0.0; 3]);
        assert_near(drive(text, [2.0, 0.0, -1.0], 2.0).position_m, [2.0, 0.0, -1.0]);
        // Nothing else is changed: point masses have no thrust.
        let text = "[[effect]]\nkind = 'thrust-scale'\nscale = 0.5";
        assert_near(drive(text, [2.0, 0.0, -1.0], 2.0).position_m, [4.0, 0.0, -2.0]);
    }
}
