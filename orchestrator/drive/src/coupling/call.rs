//! What the network is asked in a step.

use super::{Coupled, StepPlan};
use proto::digest::full::{NetworkGiven, RobotsReply};
use proto::exchange::RobotsStep;
use proto::side::NetInput;
use proto::types::{MoteCommand, Payloads};

/// What the network is given for a step, where it is not shared with anybody.
pub(super) struct NetworkCall<'a> {
    step: u64,
    from_ns: u64,
    on_air: &'a RobotsStep,
    /// In place of what robots say that stand still: a network that forms has nothing of theirs to carry.
    pub(super) silence: Option<Payloads>,
    pub(super) commands: Vec<MoteCommand>,
    plan: StepPlan,
    stop_at_first_delivery: bool,
}

impl<'a> NetworkCall<'a> {
    /// Takes the messages that wait.
    pub(super) fn new<R, N>(
        coupled: &mut Coupled<R, N>,
        on_air: &'a RobotsStep,
        mut plan: StepPlan,
        stop_at_first_delivery: bool,
    ) -> Self {
        // Sorted by source, as all orders.
        let mut commands = std::mem::take(&mut plan.commands);
        commands.append(&mut coupled.messages);
        commands.sort_by(|a, b| a.source.cmp(&b.source));
        Self {
            step: coupled.step + 1,
            from_ns: coupled.time_ns,
            on_air,
            silence: plan.hold.then(|| Payloads::silence(coupled.experiment.agent_count)),
            commands,
            plan,
            stop_at_first_delivery,
        }
    }

    /// What the network is given with it, beside the robots' reply of that digest.
    pub(super) fn given(&self, robots: &RobotsReply) -> NetworkGiven {
        NetworkGiven::of_reply(robots, &self.input(), self.silence.is_some())
    }

    pub(super) fn input(&self) -> NetInput<'_> {
        NetInput {
            step: self.step,
            from_ns: self.from_ns,
            until_ns: self.plan.until_ns,
            states: &self.on_air.states,
            payloads: self.silence.as_ref().unwrap_or(&self.on_air.payloads),
            moved_obstacles: &self.on_air.moved_obstacles,
            commands: &self.commands,
            stop_at_first_delivery: self.stop_at_first_delivery,
            records: &self.plan.records,
        }
    }
}
