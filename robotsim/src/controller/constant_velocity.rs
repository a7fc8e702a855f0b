//! Robots that all move with one velocity, whatever they hear.

use super::{Controller, Demands, Entry, Goal, View};
use crate::context::field;
use crate::dynamics::Command;
use proto::config::{Default, Kind, Range, Variant, typed};
use serde::Deserialize;

pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "constant-velocity",
        doc: "All robots move with the same velocity.",
        fields: &[field(
            "velocity_mps",
            "The velocity (x, y in m/s).",
            Kind::List { of: &Kind::Number(Range::closed(-1e4, 1e4)), min: 2, max: 2 },
            Default::Required,
        )],
    },
    demands: Demands::NONE,
    goal: Goal::Other,
    build: |table, context, problems| {
        let this: ConstantVelocity = typed(table);
        let [vx, vy] = this.velocity_mps;
        super::check_speed("velocity_mps", libm::hypot(vx, vy), context, problems);
        Some(Box::new(this))
    },
};

#[derive(Debug, Deserialize)]
struct ConstantVelocity {
    velocity_mps: [f64; 2],
}

impl Controller for ConstantVelocity {
    fn command(&self, _view: &View<'_>, _agent: usize) -> Command {
        let [vx, vy] = self.velocity_mps;
        Command::Velocity([vx, vy, 0.0])
    }
}
