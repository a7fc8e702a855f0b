//! Robots that stay where they are.

use super::{Controller, Demands, Entry, Goal, View};
use crate::dynamics::Command;
use proto::config::Variant;
use proto::ids::AgentId;

pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "hold",
        doc: "Every robot stays where it is, unless commanded otherwise.",
        fields: &[],
    },
    demands: Demands::NONE,
    goal: Goal::Carry,
    build: |_, _, _| Some(Box::new(Hold)),
};

#[derive(Debug)]
struct Hold;

impl Controller for Hold {
    fn command(&self, _view: &View<'_>, _agent: AgentId) -> Command {
        Command::Velocity([0.0; 3])
    }

    fn moves(&self) -> bool {
        false
    }
}
