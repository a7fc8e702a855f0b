//! Pairs of robots that come closer than their diameter. docs/metrics.md defines `collisions`.

use super::period::distance_m;
use super::task::Task;
use proto::types::AgentStates;
use std::collections::BTreeSet;

/// The pairs that are in contact, step by step.
#[derive(Clone, Debug, Default)]
pub struct Contacts {
    pairs: BTreeSet<(u32, u32)>,
    min_distance_m: Option<f64>,
}

impl Contacts {
    /// Adds a step in which robots were free to move. Returns the pairs that collided in it, each with the smaller number first:
    /// those that are closer than a robot's diameter, and were not at the end of the step before. There are none where the
    /// diameter is not known.
    ///
    /// * `alive`: the robots that exist, ascending.
    pub fn add(&mut self, task: &Task, states: &AgentStates, alive: &[usize]) -> Vec<(u32, u32)> {
        let mut by_x = alive.to_vec();
        by_x.sort_by(|&a, &b| states.x_m[a].total_cmp(&states.x_m[b]).then(a.cmp(&b)));
        let mut least_m = self.min_distance_m.unwrap_or(f64::INFINITY);
        let mut pairs = BTreeSet::new();
        for (place, &a) in by_x.iter().enumerate() {
            let range_m = least_m.max(task.diameter_m.unwrap_or(0.0));
            for &b in &by_x[place + 1..] {
                if range_m < states.x_m[b] - states.x_m[a] {
                    break;
                }
                let distance_m = distance_m(states, a, b);
                least_m = least_m.min(distance_m);
                if task.diameter_m.is_some_and(|diameter_m| distance_m < diameter_m) {
                    pairs.insert((a.min(b) as u32, a.max(b) as u32));
                }
            }
        }
        let new = pairs.difference(&self.pairs).copied().collect();
        self.pairs = pairs;
        self.min_distance_m = least_m.is_finite().then_some(least_m);
        new
    }

    /// The least distance of any pair so far (m).
    pub(super) fn min_distance_m(&self) -> Option<f64> {
        self.min_distance_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_collides_when_it_comes_close_and_not_while_it_stays() {
        let task = Task { diameter_m: Some(0.5), ..Task::default() };
        let mut contacts = Contacts::default();
        let mut add = |places: &[[f64; 2]]| {
            let states = AgentStates::at_rest(places);
            let alive: Vec<usize> = (0..places.len()).collect();
            contacts.add(&task, &states, &alive)
        };
        assert!(add(&[[1.0, 0.0], [0.0, 0.0], [3.0, 0.0]]).is_empty());
        assert_eq!(add(&[[0.4, 0.0], [0.0, 0.0], [-0.1, 0.3]]), [(0, 1), (1, 2)]);
        assert_eq!(add(&[[0.4, 0.0], [0.0, 0.0], [0.3, 0.3]]), [(0, 2)]);
        assert!(add(&[[2.0, 0.0], [0.0, 0.0], [0.0, 0.3]]).is_empty());
        assert_eq!(add(&[[0.4, 0.0], [0.0, 0.0], [9.0, 0.0]]), [(0, 1)]);
        assert!((contacts.min_distance_m().unwrap() - 0.3).abs() < 1e-12);
    }
}
