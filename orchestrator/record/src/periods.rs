//! Steps as they were recorded, turned into the periods that measures, tables and pictures take.

use super::StepRecord;
use metrics::counts::Counts;
use metrics::period::Period;
use proto::exchange::RobotsStep;
use proto::types::{AgentStates, Coupling, MoteStates};
use std::sync::Arc;

/// Where a run stands: what the next period starts from.
#[derive(Clone, Debug)]
pub struct Periods {
    coupling: Coupling,
    /// The robots' latest reply; before the first step, where they begin.
    moved: Arc<RobotsStep>,
    time_ns: u64,
}

impl Periods {
    /// Begins with the states of step 0.
    #[must_use]
    pub fn new(coupling: Coupling, states: AgentStates) -> Self {
        Self::after(coupling, Arc::new(RobotsStep { states, ..RobotsStep::default() }), 0)
    }

    /// Begins after a step, of which the robots' reply and its end (ns) are known.
    #[must_use]
    pub fn after(coupling: Coupling, moved: Arc<RobotsStep>, time_ns: u64) -> Self {
        Self { coupling, moved, time_ns }
    }

    /// The end of the latest step (ns).
    #[must_use]
    pub fn time_ns(&self) -> u64 {
        self.time_ns
    }

    /// Gives the period of the next step to `take`.
    pub fn next<R>(&mut self, record: &StepRecord, take: impl FnOnce(&Period<'_>) -> R) -> R {
        let StepRecord { step, time_ns, robots, network, .. } = record;
        let n_agents = robots.states.len();
        let counts = Counts::from_deliveries(&network.deliveries, n_agents);
        let all_working;
        let motes = match &network.motes {
            Some(motes) => motes,
            None => {
                all_working = MoteStates::all_working(n_agents);
                &all_working
            }
        };
        let taken = take(&Period {
            step: *step,
            from_ns: self.time_ns,
            time_ns: *time_ns,
            states: &robots.states,
            states_before: &self.moved.states,
            states_on_air: match self.coupling {
                Coupling::Sequential => &robots.states,
                Coupling::Parallel | Coupling::Event => &self.moved.states,
            },
            moved_obstacles: &robots.moved_obstacles,
            deliveries: &network.deliveries,
            counts: &counts,
            motes,
            task_complete: robots.task_complete,
            held: robots.held,
            formation: network.formation.as_ref(),
            packets: network.packets.as_ref(),
            statistics: network.statistics.as_ref(),
            schedule: network.schedule.as_ref(),
            heard_links: network.heard_links.as_ref(),
            frames: network.frames.as_ref(),
        });
        self.moved = Arc::clone(robots);
        self.time_ns = *time_ns;
        taken
    }
}
