//! Where agents went, thinned out so that any run fits into a picture.

use proto::types::AgentStates;

/// Paths of some agents at equally spaced steps.
#[derive(Clone, Debug, Default)]
pub struct Trajectories {
    /// The agents followed, ascending.
    pub agents: Vec<usize>,
    /// Position (m, east and north) of each agent followed, per step kept; `None` where it did not exist.
    pub points: Vec<Vec<Option<[f64; 2]>>>,
    /// A step is kept every so many.
    pub every_steps: u64,
    /// All agents' positions (m, east and north) at the beginning, and at the end; `None` for those that did not exist.
    pub ends: [Vec<Option<[f64; 2]>>; 2],
}

impl Trajectories {
    /// Begins with the states of step 0. The leader is among the agents followed.
    pub fn new(states: &AgentStates, leader: Option<usize>) -> Self {
        let n = states.len();
        let n_followed = n.min(MAX_AGENTS);
        let mut agents: Vec<usize> = (0..n_followed).map(|i| i * n / n_followed).collect();
        if let Some(leader) = leader.filter(|&leader| leader < n)
            && let Err(place) = agents.binary_search(&leader)
        {
            agents[place.min(n_followed - 1)] = leader;
        }
        let mut paths = Self {
            agents,
            points: Vec::new(),
            every_steps: 1,
            ends: [positions(states), positions(states)],
        };
        paths.keep(states);
        paths
    }

    /// Adds positions after a step; steps beyond the memory's size are thinned out.
    pub fn add(&mut self, step: u64, states: &AgentStates) {
        if !step.is_multiple_of(self.every_steps) {
            return;
        }
        if self.points.len() == MAX_POINTS {
            let mut index = 0;
            self.points.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.every_steps *= 2;
            if !step.is_multiple_of(self.every_steps) {
                return;
            }
        }
        self.keep(states);
    }

    /// Notes where everyone ended up.
    pub fn end(&mut self, states: &AgentStates) {
        self.ends[1] = positions(states);
    }

    fn keep(&mut self, states: &AgentStates) {
        self.points.push(self.agents.iter().map(|&agent| position(states, agent)).collect());
    }
}

fn positions(states: &AgentStates) -> Vec<Option<[f64; 2]>> {
    (0..states.len()).map(|agent| position(states, agent)).collect()
}

fn position(states: &AgentStates, agent: usize) -> Option<[f64; 2]> {
    states.alive.get(agent).then(|| [states.x_m[agent], states.y_m[agent]])
}

/// Most agents followed.
const MAX_AGENTS: usize = 120;
/// Most steps kept.
const MAX_POINTS: usize = 400;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_run_keeps_equally_spaced_steps_from_its_beginning() {
        let mut states = AgentStates::at_origin(1);
        let mut paths = Trajectories::new(&states, None);
        for step in 1..=5000 {
            states.x_m[0] = step as f64;
            paths.add(step, &states);
        }
        let spacing = paths.every_steps as f64;
        assert!((MAX_POINTS / 2..=MAX_POINTS).contains(&paths.points.len()));
        for (index, points) in paths.points.iter().enumerate() {
            assert_eq!(points[0], Some([index as f64 * spacing, 0.0]));
        }
    }

    #[test]
    fn the_leader_is_always_followed() {
        for leader in [0, 1, 777, 999] {
            let paths = Trajectories::new(&AgentStates::at_origin(1000), Some(leader));
            assert!(paths.agents.contains(&leader));
            assert!(paths.agents.is_sorted());
        }
    }
}
