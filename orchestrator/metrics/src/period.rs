//! A step as the tables and measures see it.

use super::counts::Counts;
use proto::types::{
    AgentStates, Deliveries, Formation, Frames, HeardLinks, MoteStates, MoteStatistics,
    MovedObstacle, Packets, Schedule,
};

/// A step and the period that it covers.
#[derive(Clone, Copy, Debug)]
pub struct Period<'a> {
    /// The step, from 1.
    pub step: u64,
    /// When the period began (ns).
    pub from_ns: u64,
    /// When it ended (ns).
    pub time_ns: u64,
    /// Where the agents ended up.
    pub states: &'a AgentStates,
    /// Where they ended up in the step before.
    pub states_before: &'a AgentStates,
    /// Where the network took them to be during the period.
    pub states_on_air: &'a AgentStates,
    /// Obstacles that moved, where they ended up.
    pub moved_obstacles: &'a [MovedObstacle],
    /// Payloads that were delivered in the period.
    pub deliveries: &'a Deliveries,
    /// How many heard and were heard.
    pub counts: &'a Counts,
    /// The motes at the end.
    pub motes: &'a MoteStates,
    /// The robots regard their task as done.
    pub task_complete: bool,
    /// The robots were ordered to stand still: the experiment itself has not begun.
    pub held: bool,
    /// Whether the network has formed; `None`: it has nothing to form.
    pub formation: Option<&'a Formation>,
    /// Packets whose way ended, if they are kept.
    pub packets: Option<&'a Packets>,
    /// The motes' statistics, if they were asked for.
    pub statistics: Option<&'a MoteStatistics>,
    /// The motes' schedules, if they were asked for.
    pub schedule: Option<&'a Schedule>,
    /// Who has heard whom, if it was asked for.
    pub heard_links: Option<&'a HeardLinks>,
    /// Frames that were sent, if they are kept.
    pub frames: Option<&'a Frames>,
}

impl<'a> Period<'a> {
    /// A step of which only the agents' positions, and what they received meanwhile, are known.
    pub fn of_places(
        step: u64,
        [(from_ns, before), (time_ns, states)]: [(u64, &'a AgentStates); 2],
        (deliveries, counts): (&'a Deliveries, &'a Counts),
        motes: &'a MoteStates,
    ) -> Self {
        Self {
            step,
            from_ns,
            time_ns,
            states,
            states_before: before,
            states_on_air: before,
            moved_obstacles: &[],
            deliveries,
            counts,
            motes,
            task_complete: false,
            held: false,
            formation: None,
            packets: None,
            statistics: None,
            schedule: None,
            heard_links: None,
            frames: None,
        }
    }
}

/// Distance between two agents (m).
pub fn distance_m(states: &AgentStates, a: usize, b: usize) -> f64 {
    let [ax, ay, az] = states.position_m(a);
    let [bx, by, bz] = states.position_m(b);
    let (dx, dy, dz) = (ax - bx, ay - by, az - bz);
    libm::sqrt(dx * dx + dy * dy + dz * dz)
}
