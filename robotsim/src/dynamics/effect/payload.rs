//! A load that the controller knows nothing of.

use super::{Effect, Entry, Situation};
use proto::config::Section;
use proto::effect::{Catalogued, FromModel, Need};

/// `kind = "payload-mass"`.
pub(super) const ENTRY: Entry = Entry {
    check: |table, path, problems| {
        let number = |key: &str| table.get(key).and_then(toml::Value::as_float).unwrap_or(0.0);
        let (payload_kg, mass_kg) = (number("payload_kg"), number("mass_kg"));
        if payload_kg <= -mass_kg {
            problems.push(proto::config::Problem::new(
                proto::config::join(path, "payload_kg"),
                format!("must be greater than {}, so that the robot weighs something", -mass_kg),
            ));
        }
    },
    ..Entry::of::<Payload>()
};

/// The robot carries a load that its commands do not take into account.
///
/// # Mechanism
///
/// A camera, a package or another battery makes the robot heavier than its controller assumes, so that the same thrust accelerates
/// it less.
///
/// # Equation
///
/// ```text
/// a' = mass_kg / (mass_kg + payload_kg) (a + g e_z) - g e_z of a quadrotor, without g of other bodies
/// ```
///
/// # Source
///
/// Newton's second law.
///
/// # Validity
///
/// A point mass at the centre of gravity: no change of attitude dynamics, no swing. The same signature as thrust-scale with mass_kg
/// / (mass_kg + payload_kg).
///
/// # Trace
///
/// As thrust-scale: a vertical error at hover, and an error along each acceleration.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "payload-mass",
    needs = &[Need::ThrustCommands, Need::Mass],
    example = "payload_kg = 0.2\nmass_kg = 1.5\n",
    from_model = &[("mass_kg", FromModel::Mass)],
)]
struct Payload {
    /// Mass in addition to the assumed one (kg). Negative: the robot is lighter than assumed; its total mass must be positive.
    #[key(range = -1e6..=1e6)]
    #[fit(unit = "kg", range = 0.0..=1e3, starts = [0.0], step = 0.002, null = 0.0)]
    payload_kg: f64,
    /// Mass that the commands assume (kg). `diagnose` takes it from robotsim.dynamics.mass_kg.
    #[key(above = 0.0, most = 1e6)]
    mass_kg: f64,
}

impl Payload {
    fn gain(&self) -> f64 {
        self.mass_kg / (self.mass_kg + self.payload_kg)
    }
}

impl Effect for Payload {
    fn thrust_gain(&self, _at: &Situation<'_>) -> f64 {
        self.gain()
    }

    fn thrust_gains(&self) -> [f64; 2] {
        [self.gain(); 2]
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;
    use crate::catalogue::Catalogue;
    use crate::dynamics::{Dynamics, GRAVITY_MPS2};

    #[test]
    fn a_quarter_of_the_mass_more_takes_a_fifth_of_the_thrust() {
        let text = "kind = 'quadrotor'\n[[effect]]\nkind = 'payload-mass'\npayload_kg = 0.5\nmass_kg = 2.0";
        let end = drive(text, [0.0; 3], 1.0);
        assert_near(end.drive, [0.0, 0.0, -0.2 * GRAVITY_MPS2]);
    }

    #[test]
    fn a_robot_must_weigh_something() {
        let problems = |payload_kg: f64| {
            let text = format!(
                "kind = 'quadrotor'\n[[effect]]\nkind = 'payload-mass'\npayload_kg = {payload_kg:?}\nmass_kg = 2.0"
            );
            let node = proto::config::parse(&text).unwrap();
            let catalogue = Catalogue::built_in();
            let mut problems = Vec::new();
            let spec = &crate::dynamics::SPEC;
            let table =
                proto::config::check(&node, "", spec, &catalogue.lists(), &mut problems).table;
            Dynamics::build(&table, "", &catalogue.effects, &mut problems);
            problems.iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        assert!(problems(-1.9).is_empty());
        let refused = problems(-2.0).join("\n");
        assert!(refused.contains("payload_kg") && refused.contains("greater than -2"), "{refused}");
    }
}
