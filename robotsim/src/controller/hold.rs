//! Robots that stay where they are.

use super::{Controller, Registration, View};
use crate::dynamics::Command;

pub(super) const REGISTRATION: Registration = Registration {
    name: "hold",
    doc: "Everyone stays where it is, unless ordered otherwise.",
    fields: &[],
    build: |_, _, _| Some(Box::new(Hold)),
};

#[derive(Debug)]
struct Hold;

impl Controller for Hold {
    fn command(&self, _view: &View<'_>, _agent: usize) -> Command {
        Command::Velocity([0.0; 3])
    }
}
