//! From command to motion.
//!
//! A command is a velocity. The body turns it into the velocity it really has; the position follows exactly, since that
//! velocity holds over the whole control period: x += v Δt. Effects of real robots (lag, slip, drift, ...) belong between
//! the command and the body, in the order in which `[[robotsim.dynamics.effect]]` lists them; there are none yet.

mod point_mass;

use crate::config::field;
use point_mass::PointMass;
use proto::config::{Choice, Default, Kind, Range, TableSpec, Tag, Variant};
use proto::types::AgentStates;

/// What a controller asks of a robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Move with this velocity (m/s).
    Velocity([f64; 3]),
    /// Be displaced by this (m), at once and without limit. No robot can: it is for workloads, not for physics.
    Jump([f64; 3]),
}

/// Description of `[robotsim.dynamics]`.
pub(crate) const SPEC: TableSpec = TableSpec {
    doc: "How the robots move.",
    fields: &[
        field(
            "speed_cap_mps",
            "Greatest speed (m/s). Default: the BotNet paper's.",
            Kind::Number(Range::above(0.0, 1e4)),
            Default::Number(30.0),
        ),
        field(
            "cap",
            "What the cap limits.",
            Kind::Choice(&[
                Choice { name: "norm", doc: "The speed; the direction is kept." },
                Choice {
                    name: "axis",
                    doc: "Each component by itself, as BotNet's code does: up to 1.41 times the speed.",
                },
            ]),
            Default::Text("norm"),
        ),
    ],
    tag: Some(&Tag {
        key: "kind",
        doc: "The body.",
        default: Some("point-mass"),
        variants: || {
            vec![Variant {
                name: "point-mass",
                doc: "Has the commanded velocity at once.",
                fields: &[],
            }]
        },
    }),
};

/// How the robots move.
#[derive(Clone, Debug)]
pub struct Dynamics {
    body: PointMass,
}

impl Dynamics {
    /// From a checked table.
    pub(crate) fn build(table: &toml::Table) -> Option<Self> {
        Some(Self { body: table.clone().try_into().ok()? })
    }

    /// The greatest speed that the limit allows (m/s).
    #[must_use]
    pub fn speed_cap_mps(&self) -> f64 {
        self.body.speed_cap_mps
    }

    /// Moves every agent that is alive over `dt_s` (s, positive). Velocities become those the robots had.
    ///
    /// Bodies have a direction only where the scenario gave them one: they face where they move, and at rest where they
    /// last moved.
    ///
    /// # Panics
    ///
    /// If a position ceases to be finite: that is a bug in a controller or effect.
    pub fn advance(&self, dt_s: f64, commands: &[Command], states: &mut AgentStates) {
        for agent in states.alive.clone().iter_ones() {
            let (velocity, displacement) = match commands[agent] {
                Command::Velocity(velocity) => {
                    let velocity = self.body.velocity_mps(velocity);
                    (velocity, velocity.map(|component| component * dt_s))
                }
                Command::Jump(displacement) => {
                    (displacement.map(|component| component / dt_s), displacement)
                }
            };
            states.x_m[agent] += displacement[0];
            states.y_m[agent] += displacement[1];
            states.z_m[agent] += displacement[2];
            [states.vx_mps[agent], states.vy_mps[agent], states.vz_mps[agent]] = velocity;
            assert!(
                states.position_m(agent).iter().all(|coordinate| coordinate.is_finite()),
                "agent {agent} left the space of numbers: command {:?}",
                commands[agent]
            );
            if !states.heading_rad.is_empty() && (velocity[0] != 0.0 || velocity[1] != 0.0) {
                states.heading_rad[agent] = libm::atan2(velocity[1], velocity[0]);
            }
        }
    }
}
