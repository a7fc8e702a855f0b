//! Robots that come late and robots that are lost.

use crate::context::Context;
use proto::config::{Problem, Section};
use proto::ids::AgentId;
use proto::time::SimDuration;
use proto::types::{AgentStates, Bitmap, NS_PER_S};

/// Some robots that are not there for a time.
#[derive(Clone, Debug, PartialEq)]
pub struct Absence {
    robots: Vec<AgentId>,
    /// Since the robots started.
    from: SimDuration,
    until: SimDuration,
}

/// Robots that are absent for a time. They do not move, send, receive or collide, and metrics exclude them.
#[derive(Debug, Section)]
pub(crate) struct Keys {
    /// Indices of the robots, from 0.
    #[key(range = 0..=u32::MAX - 1, length = 1.., required)]
    robots: Vec<u32>,
    /// Start of the absence (s after the robots start, as duration_s). 0: from the beginning, network formation included.
    #[key(range = 0.0..=1e9, default = 0.0)]
    from_s: f64,
    /// End of the absence (s after the robots start). They return to their last position, or to that of the scenario. Absent:
    /// never.
    #[key(above = 0.0, most = 1e9)]
    until_s: Option<f64>,
}

/// Of checked tables: the first stands at the path of the context with an index of 0.
pub(crate) fn build(
    keys: &[Keys],
    context: &Context<'_>,
    problems: &mut Vec<Problem>,
) -> Vec<Absence> {
    let mut absences = Vec::new();
    for (index, Keys { robots, from_s, until_s }) in keys.iter().enumerate() {
        let (from_s, until_s) = (*from_s, *until_s);
        let key_path = |key: &str| format!("{}[{index}].{key}", context.path);
        for robot in robots {
            if context.n_agents <= *robot as usize {
                let n = context.n_agents;
                let problem = Problem::new(
                    key_path("robots"),
                    format!("must be less than the number of robots, {n}"),
                );
                problems.push(problem.value(robot.to_string()));
            }
        }
        if let Some(until_s) = until_s.filter(|until_s| *until_s <= from_s) {
            let problem =
                Problem::new(key_path("until_s"), format!("must be later than from_s, {from_s:?}"));
            problems.push(problem.value(format!("{until_s:?}")));
        }
        let duration =
            |time_s: f64| SimDuration::from_ns(libm::round(time_s * NS_PER_S as f64) as u64);
        absences.push(Absence {
            robots: robots.iter().copied().map(AgentId).collect(),
            from: duration(from_s),
            until: until_s.map_or(SimDuration::MAX, duration),
        });
    }
    absences
}

/// Marks who is there at a time since the robots started; the others are at rest. Returns those who have just gone.
pub(crate) fn mark(
    absences: &[Absence],
    time: SimDuration,
    states: &mut AgentStates,
) -> Vec<AgentId> {
    if absences.is_empty() {
        return Vec::new();
    }
    let before = std::mem::replace(&mut states.alive, Bitmap::filled(states.x_m.len(), true));
    for absence in absences {
        if (absence.from..absence.until).contains(&time) {
            for &robot in &absence.robots {
                states.alive.set(robot.index(), false);
            }
        }
    }
    let gone: Vec<usize> = before.iter_ones().filter(|&robot| !states.alive.get(robot)).collect();
    for &robot in &gone {
        [states.vx_mps[robot], states.vy_mps[robot], states.vz_mps[robot]] = [0.0; 3];
    }
    gone.into_iter().map(AgentId::from_index).collect()
}
