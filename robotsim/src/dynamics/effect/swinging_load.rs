//! A load on a cable.

use super::{Effect, Entry};
use proto::config::{Problem, Section};
use proto::effect::{Catalogued, FromModel, Need};

/// `kind = "swinging-load"`.
pub(super) const ENTRY: Entry = Entry::of::<SwingingLoad>();

/// A load that hangs below the robot on a cable, of which its commands know nothing.
///
/// # Mechanism
///
/// A slung load lags behind each acceleration, swings, and pulls the robot to and fro; its weight lacks in the thrust.
///
/// # Equation
///
/// ```text
/// horizontally  x'' = a + m G s / L,  s'' = -(1 + m) G s / L - a - damping_per_s s',  m = payload_kg / mass_kg, L = cable_m
/// vertically    z'' + g = (a_z + g) / (1 + m),  G = z'' + 9.80665 m/s²
/// ```
///
/// s is where the load is, seen from the robot.
///
/// # Source
///
/// The pendulum on a cart, for small angles: e.g. K. Sreenath, T. Lee and V. Kumar, Geometric control and differential flatness of a
/// quadrotor UAV with a cable-suspended load, CDC 2013, eq. 1 to 4, linearised.
///
/// # Validity
///
/// Angles up to about 0.4 rad, a cable without mass that stays tight, attached at the centre of gravity. The load hangs at rest at
/// first. A short cable is payload-mass.
///
/// # Trace
///
/// As payload-mass, and an oscillation after each acceleration with the period of the pendulum.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "swinging-load",
    needs = &[Need::ThrustCommands, Need::Mass],
    example = "payload_kg = 0.2\ncable_m = 0.8\nmass_kg = 1.5\n",
    from_model = &[("mass_kg", FromModel::Mass)],
    generalises = &["payload-mass"],
)]
struct SwingingLoad {
    /// Mass of the load (kg).
    #[key(range = 0.0..=1e6)]
    #[fit(unit = "kg", range = 0.0..=1e3, starts = [0.0], step = 0.002, null = 0.0)]
    payload_kg: f64,
    /// Length of the cable, from the robot's centre of gravity to that of the load (m).
    #[key(range = 0.05..=1e3)]
    #[fit(unit = "m", range = 0.05..=100.0, starts = [0.3, 1.0, 3.0], step = 0.01)]
    cable_m: f64,
    /// Rate at which the load loses its speed through the air (1/s).
    #[key(range = 0.0..=10.0, default = 0.1)]
    #[fit(unit = "1/s", starts = [0.1], step = 0.005)]
    damping_per_s: f64,
    /// Mass that the commands assume (kg). `diagnose` takes it from robotsim.dynamics.mass_kg.
    #[key(above = 0.0, most = 1e6)]
    mass_kg: f64,
}

/// What hangs below a robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pendulum {
    /// Its mass, as a share of the robot's.
    pub share: f64,
    /// Length of the cable (m).
    pub cable_m: f64,
    /// Rate at which it loses its speed (1/s).
    pub damping_per_s: f64,
}

impl Effect for SwingingLoad {
    fn load(&self) -> Option<Pendulum> {
        let &Self { payload_kg, cable_m, damping_per_s, mass_kg } = self;
        (0.0 < payload_kg).then(|| Pendulum { share: payload_kg / mass_kg, cable_m, damping_per_s })
    }

    fn thrust_gains(&self) -> [f64; 2] {
        [self.mass_kg / (self.mass_kg + self.payload_kg), 1.0]
    }

    fn force_varies(&self) -> bool {
        true
    }
}

/// Adds a problem where more than one load would hang below a robot.
pub(in crate::dynamics) fn check(
    effects: &[Box<dyn Effect>],
    path: &str,
    problems: &mut Vec<Problem>,
) {
    let loaded = effects.iter().enumerate().filter(|(_, effect)| effect.load().is_some());
    problems.extend(loaded.skip(1).map(|(index, _)| {
        Problem::new(
            format!("{path}[{index}]"),
            "must occur only once: one load hangs below a robot",
        )
    }));
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;
    use crate::dynamics::GRAVITY_MPS2;

    fn text(payload_kg: f64, cable_m: f64) -> String {
        format!(
            "kind = 'quadrotor'\nattitude_lag_s = 0.0\n[[effect]]\nkind = 'swinging-load'\npayload_kg = {payload_kg:?}\n\
             cable_m = {cable_m:?}\ndamping_per_s = 0.0\nmass_kg = 2.0"
        )
    }

    #[test]
    fn at_hover_it_is_its_weight() {
        let end = drive(&text(0.5, 1.0), [0.0; 3], 1.0);
        assert!((end.drive[2] + 0.2 * GRAVITY_MPS2).abs() < 1e-12, "{end:?}");
        assert_eq!([end.drive[0], end.drive[1]], [0.0; 2]);
    }

    #[test]
    fn robot_and_load_swing_against_each_other_as_the_equations_say() {
        // Asked for 1 m/s² to the east and to keep its height with the load: G = g, m = 0.25. With w² = (1 + m) g / L the load is at
        // s = −a (1 − cos w t) / w², so that the robot has v = a t − m g a / (L w²) (t − sin(w t) / w).
        let up = 0.25 * GRAVITY_MPS2;
        let t_s = 2.0;
        let end = drive(&text(0.5, 0.7), [1.0, 0.0, up], t_s);
        let w = (1.25 * GRAVITY_MPS2 / 0.7f64).sqrt();
        let offset_m = -(1.0 - (w * t_s).cos()) / (w * w);
        let speed_mps = t_s - 0.25 * GRAVITY_MPS2 / (0.7 * w * w) * (t_s - (w * t_s).sin() / w);
        // Steps of 10 ms, of second order: (w × 0.01)² / 24 of a period.
        assert!((end.load.offset_m[0] - offset_m).abs() < 1e-3, "{end:?} {offset_m}");
        assert!((end.drive[0] - speed_mps).abs() < 2e-3, "{end:?} {speed_mps}");
        assert!(end.drive[2].abs() < 1e-9, "{end:?}");
    }

    #[test]
    fn with_a_short_cable_it_is_a_payload() {
        let end = drive(&text(0.5, 0.05), [1.0, 0.0, 0.25 * GRAVITY_MPS2], 5.0);
        // All five seconds but for the swing about the cable's place.
        assert!((end.drive[0] / 5.0 - 0.8).abs() < 0.01, "{end:?}");
    }
}
