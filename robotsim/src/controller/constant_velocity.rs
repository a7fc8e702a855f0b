//! Robots that all move with one velocity, whatever they hear.

use super::{Controller, Demands, Entry, Goal, View};
use crate::dynamics::Command;
use proto::config::{Section, variant};
use proto::ids::AgentId;

pub(super) const ENTRY: Entry = Entry {
    variant: variant::<ConstantVelocity>("constant-velocity"),
    demands: Demands::NONE,
    goal: Goal::Carry,
    build: |table, context, problems| {
        let this = ConstantVelocity::read(table);
        let [vx, vy] = this.velocity_mps;
        super::check_speed("velocity_mps", libm::hypot(vx, vy), context, problems);
        Some(Box::new(this))
    },
};

/// All robots move with the same velocity.
#[derive(Debug, Section)]
struct ConstantVelocity {
    /// The velocity (x, y in m/s).
    #[key(range = -1e4..=1e4)]
    velocity_mps: [f64; 2],
}

impl Controller for ConstantVelocity {
    fn command(&self, _view: &View<'_>, _agent: AgentId) -> Command {
        let [vx, vy] = self.velocity_mps;
        Command::Velocity([vx, vy, 0.0])
    }
}
