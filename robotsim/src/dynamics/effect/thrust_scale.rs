//! Rotors that give more or less thrust than is asked for.

use super::{Effect, Entry, Situation, UNCHECKED};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Level, Need, Parameter};
use serde::Deserialize;

/// `kind = "thrust-scale"`.
pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "thrust-scale",
        doc: "The thrust is a constant fraction of the commanded thrust.",
        fields: &[Field {
            key: "scale",
            doc: "Ratio of executed to commanded thrust.",
            kind: Kind::Number(Range::closed(0.0, 10.0)),
            default: Default::Required,
        }],
    },
    about: About {
        mechanism: "The thrust curve of the rotors is miscalibrated, the battery is low, the air is thin, or the mass is not the assumed one.",
        equation: "a' = scale (a + g e_z) - g e_z of a quadrotor, a' = scale a of other bodies",
        source: "Thrust k omega^2 with another k than assumed: R. Mahony, V. Kumar and P. Corke, Multirotor aerial vehicles, IEEE Robotics and Automation Magazine 19 (2012) 20, eq. 5.",
        validity: "One fraction at all thrusts. A mass that is not the assumed one has the same signature: see payload-mass.",
        trace: "A vertical error at hover that grows with the square of time, and an error along each acceleration.",
        needs: &[Need::ThrustCommands],
        example: "scale = 0.95\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "scale",
            unit: "1",
            min: 0.0,
            max: 5.0,
            starts: &[1.0],
            step: 0.002,
        }],
        variants: &[],
        level: Level::Time,
        generalises: &[],
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table| Some(Box::new(typed::<ThrustScale>(table))),
};

/// Rotors whose thrust is a constant share of what is asked for.
///
/// # Model
///
/// ```text
/// a' = s (a + g e_z) − g e_z
/// ```
///
/// a + g e_z is the thrust by mass. A rotor gives the thrust k ω²; with another k than the controller assumes the thrust is off by a
/// factor: Mahony, Kumar and Corke, "Multirotor aerial vehicles", IEEE Robotics and Automation Magazine 19 (2012) 20, eq. 5. Of bodies
/// that need no thrust to stay at their height, a' = s a.
///
/// # Arguments
///
/// * `scale` s: the thrust per thrust that is asked for (1), not negative.
///
/// # Validity
///
/// One share at all thrusts and voltages. It acts on bodies that are asked for an acceleration and on no others; a controller of
/// velocities makes up for part of it. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct ThrustScale {
    scale: f64,
}

impl Effect for ThrustScale {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

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
