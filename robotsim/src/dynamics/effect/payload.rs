//! A load that the controller knows nothing of.

use super::{Effect, Entry, Situation};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, FromModel, Level, Need, Parameter};
use serde::Deserialize;

/// `kind = "payload-mass"`.
pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "payload-mass",
        doc: "The robot carries a load that its commands do not take into account.",
        fields: &[
            Field {
                key: "payload_kg",
                doc: "Mass in addition to the assumed one (kg). Negative: the robot is lighter than assumed; its total mass \
                      must be positive.",
                kind: Kind::Number(Range::closed(-1e6, 1e6)),
                default: Default::Required,
            },
            Field {
                key: "mass_kg",
                doc: "Mass that the commands assume (kg). `diagnose` takes it from robotsim.dynamics.mass_kg.",
                kind: Kind::Number(Range::above(0.0, 1e6)),
                default: Default::Required,
            },
        ],
    },
    about: About {
        mechanism: "A camera, a package or another battery makes the robot heavier than its controller assumes, so that the same thrust accelerates it less.",
        equation: "a' = mass_kg / (mass_kg + payload_kg) (a + g e_z) - g e_z of a quadrotor, without g of other bodies",
        source: "Newton's second law.",
        validity: "A point mass at the centre of gravity: no change of attitude dynamics, no swing. The same signature as thrust-scale with mass_kg / (mass_kg + payload_kg).",
        trace: "As thrust-scale: a vertical error at hover, and an error along each acceleration.",
        needs: &[Need::ThrustCommands, Need::Mass],
        example: "payload_kg = 0.2\nmass_kg = 1.5\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "payload_kg",
            unit: "kg",
            min: 0.0,
            max: 1e3,
            starts: &[0.0],
            step: 0.002,
        }],
        variants: &[],
        level: Level::Time,
        generalises: &[],
        from_model: &[("mass_kg", FromModel::Mass)],
        ..Fit::PLAIN
    },
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
    build: |table| Some(Box::new(typed::<Payload>(table))),
};

/// A mass that commands do not take into account.
///
/// # Model
///
/// ```text
/// a' = m / (m + p) (a + g e_z) − g e_z
/// ```
///
/// The thrust m (a + g e_z) accelerates the mass m + p: Newton's second law. Of bodies that need no thrust to stay at their height,
/// a' = m / (m + p) a.
///
/// # Arguments
///
/// * `payload_kg` p: mass beside the assumed one (kg), greater than −m.
/// * `mass_kg` m: the assumed mass (kg), greater than 0.
///
/// # Validity
///
/// At the centre of gravity and stiffly fixed: the attitude follows as before. It acts on bodies that are asked for an acceleration and
/// on no others. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct Payload {
    payload_kg: f64,
    mass_kg: f64,
}

impl Payload {
    fn gain(&self) -> f64 {
        self.mass_kg / (self.mass_kg + self.payload_kg)
    }
}

impl Effect for Payload {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

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
