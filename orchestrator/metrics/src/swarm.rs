//! What the swarm does, step by step: does it follow, does it hold together, does it collide? docs/metrics.md defines each.

use super::contacts::Contacts;
use super::period::{Period, distance_m};
use super::task::Task;
use crate::figures::{FigureValue, FiguresByName};
use crate::headline::is_thrashing;
use proto::types::seconds;

/// Measures of a swarm over time.
#[derive(Clone, Debug, Default)]
pub(super) struct SwarmMeasures {
    along_leader: Mean,
    /// Speed of the robots while their leader moves.
    led_speed: Mean,
    leader_distance: Mean,
    leader_connected: Mean,
    radial: Mean,
    polarisation: Mean,
    cohesion: Mean,
    fragments: Mean,
    final_fragments: Option<usize>,
    contacts: Contacts,
    n_collisions: u64,
    age: Mean,
    neighbour_error: Mean,
    /// What was sent in the period before: by whom, from where (m), and how many heard it.
    said: Vec<(u32, [f64; 3], u32)>,
}

/// A mean with weights.
#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    sum: f64,
    weight: f64,
}

impl Mean {
    fn add(&mut self, value: Option<f64>, weight: f64) {
        if let Some(value) = value {
            self.sum += value * weight;
            self.weight += weight;
        }
    }

    fn value(self) -> Option<f64> {
        (0.0 < self.weight).then(|| self.sum / self.weight)
    }
}

impl SwarmMeasures {
    /// Adds a step in which robots were free to move. Returns the speed of their mean velocity along the leader's direction (m/s),
    /// if there is a leader that moves.
    pub(super) fn add(&mut self, task: &Task, period: &Period<'_>) -> Option<f64> {
        let weight = (period.time_ns - period.from_ns) as f64;
        let states = period.states;
        let alive: Vec<usize> = states.alive.iter_ones().collect();
        self.age(period);
        self.neighbour_error(period);
        if alive.is_empty() {
            return None;
        }
        let n = alive.len() as f64;
        let velocities = velocities(period, &alive);
        let mean_of = |of: &dyn Fn(usize) -> [f64; 3]| -> [f64; 3] {
            let mut sum = [0.0; 3];
            for place in 0..alive.len() {
                sum = add(sum, of(place));
            }
            sum.map(|component| component / n)
        };
        let mean_velocity = mean_of(&|place| velocities[place]);
        let centre = mean_of(&|place| states.position_m(alive[place]));

        let leader = task.leader.filter(|&leader| states.alive.get(leader));
        let along_mps = along_leader_mps(task, &alive, &velocities);
        self.along_leader.add(along_mps, weight);
        let speeds_mps: f64 = velocities.iter().map(|&velocity| norm(velocity)).sum();
        self.led_speed.add(along_mps.map(|_| speeds_mps / n), weight);

        let (mut to_centre, mut radial, mut n_away) = (0.0, 0.0, 0.0);
        let (mut headings, mut n_moving) = ([0.0; 3], 0.0);
        for (place, &agent) in alive.iter().enumerate() {
            let away = sub(states.position_m(agent), centre);
            to_centre += norm(away);
            if let Some(outward) = unit(away) {
                radial += dot(sub(velocities[place], mean_velocity), outward);
                n_away += 1.0;
            }
            if let Some(heading) = unit(velocities[place]) {
                headings = add(headings, heading);
                n_moving += 1.0;
            }
        }
        self.cohesion.add(Some(to_centre / n), weight);
        self.radial.add((0.0 < n_away).then(|| radial / n_away), weight);
        self.polarisation.add((0.0 < n_moving).then(|| norm(headings) / n_moving), weight);

        if let Some(leader) = leader {
            let others = alive.iter().filter(|&&agent| agent != leader);
            let sum: f64 = others.map(|&agent| distance_m(states, agent, leader)).sum();
            self.leader_distance.add((1.0 < n).then(|| sum / (n - 1.0)), weight);
        }
        self.connectivity(period, &alive, leader, weight);
        self.n_collisions += self.contacts.add(task, states, &alive).len() as u64;
        along_mps
    }

    /// Groups that heard each other, directly or by way of others, in the period.
    fn connectivity(
        &mut self,
        period: &Period<'_>,
        alive: &[usize],
        leader: Option<usize>,
        weight: f64,
    ) {
        let sent = &period.deliveries.transmissions;
        if sent.is_empty() {
            return;
        }
        let mut groups = Groups::new(period.states.len(), alive.len());
        'receivers: for &receiver in alive {
            for index in period.deliveries.heard_by(receiver) {
                let sender = sent.sender[index] as usize;
                if period.states.alive.get(sender) {
                    groups.join(receiver, sender);
                }
                if groups.n == 1 {
                    // Where everyone hears everyone, the first receiver stands for all.
                    break 'receivers;
                }
            }
        }
        self.fragments.add(Some(groups.n as f64), weight);
        self.final_fragments = Some(groups.n);
        let Some(leader) = leader.filter(|_| 1 < alive.len()) else { return };
        let home = groups.root_of(leader);
        let others = alive.iter().filter(|&&agent| agent != leader);
        let connected = others.filter(|&&agent| groups.root_of(agent) == home).count();
        self.leader_connected.add(Some(connected as f64 / (alive.len() - 1) as f64), weight);
    }

    /// How old what was heard is when the period ends, which is when robots act on it.
    fn age(&mut self, period: &Period<'_>) {
        let sent = &period.deliveries.transmissions;
        for (index, &sent_ns) in sent.sent_ns.iter().enumerate() {
            let age_s = seconds(period.time_ns.saturating_sub(sent_ns));
            self.age.add(Some(age_s), f64::from(period.counts.receivers[index]));
        }
    }

    /// How far neighbours are at the end of the step in which robots act on what they heard from where they said it.
    fn neighbour_error(&mut self, period: &Period<'_>) {
        for &(sender, said_m, n_heard) in &self.said {
            let sender = sender as usize;
            if period.states.alive.get(sender) {
                let way = sub(period.states.position_m(sender), said_m);
                self.neighbour_error.add(Some(norm(way)), f64::from(n_heard));
            }
        }
        let sent = &period.deliveries.transmissions;
        // Where the sender of a message to a single agent was when it sent it, some periods ago, is not known here.
        let for_all = (0..sent.len()).filter(|&index| sent.destination(index).is_none());
        self.said.clear();
        self.said.extend(for_all.map(|index| {
            let sender = sent.sender[index];
            let from_m = period.states_on_air.position_m(sender as usize);
            (sender, from_m, period.counts.receivers[index])
        }));
    }

    /// Time mean of the speed of the mean velocity along the leader's direction (m/s).
    pub(super) fn speed_along_leader_mps(&self) -> Option<f64> {
        self.along_leader.value()
    }

    /// Mean age of what was heard (s).
    pub(super) fn age_s(&self) -> Option<f64> {
        self.age.value()
    }

    /// The figures of the task, by name.
    pub(super) fn figures(&self, task: &Task) -> FiguresByName {
        let number = |value: Option<f64>| value.map(FigureValue::Number);
        let mut figures = FiguresByName::new();
        let mut add = |name: &str, value: Option<FigureValue>| {
            figures.insert(name.to_owned(), value);
        };
        if task.leader.is_some() {
            add("speed_along_leader_mps", number(self.speed_along_leader_mps()));
            add("leader_distance_m", number(self.leader_distance.value()));
            add("leader_connected_ratio", number(self.leader_connected.value()));
            let along_mps = self.speed_along_leader_mps();
            let robots_mps = self.led_speed.value();
            let leader_mps = task.leader_speed_mps.filter(|leader_mps| 0.0 < *leader_mps);
            let of_leader = along_mps.zip(leader_mps).map(|(along, leader)| along / leader);
            add("leader_speed_ratio", number(of_leader));
            let along_and_robots_mps = along_mps.zip(robots_mps);
            let on = along_and_robots_mps.filter(|(along, _)| 0.0 < *along);
            add("thrash_factor", number(on.map(|(along, robots)| robots / along)));
            let thrashing = along_and_robots_mps
                .zip(leader_mps)
                .map(|((along, robots), leader)| is_thrashing(robots, along, leader));
            add("thrashing", thrashing.map(FigureValue::Flag));
        }
        add("polarisation", number(self.polarisation.value()));
        add("radial_speed_mps", number(self.radial.value()));
        add("cohesion_m", number(self.cohesion.value()));
        add("fragments", number(self.fragments.value()));
        add("final_fragments", self.final_fragments.map(|n| FigureValue::Count(n as u64)));
        add("collisions", task.diameter_m.map(|_| FigureValue::Count(self.n_collisions)));
        add("min_distance_m", number(self.contacts.min_distance_m()));
        add("neighbour_error_m", number(self.neighbour_error.value()));
        figures
    }
}

/// The part of the mean velocity of those alive along the direction of their leader (m/s). `velocities`: as [`velocities`]
/// gives them. `None`: they have no leader, or it stands still; one on a path is gone if it is not alive.
#[must_use]
pub fn along_leader_mps(task: &Task, alive: &[usize], velocities: &[[f64; 3]]) -> Option<f64> {
    let leader_mps = match task.leader_velocity_mps {
        Some([vx, vy]) => [vx, vy, 0.0],
        // On a path its direction changes.
        None => velocities[alive.binary_search(&task.leader?).ok()?],
    };
    let direction = unit(leader_mps)?;
    let sum = velocities.iter().fold([0.0; 3], |sum, &velocity| add(sum, velocity));
    Some(dot(sum.map(|component| component / alive.len() as f64), direction))
}

/// Velocities of those alive (m/s): as reported, or differences of positions over the step.
#[must_use]
pub fn velocities(period: &Period<'_>, alive: &[usize]) -> Vec<[f64; 3]> {
    let (states, before) = (period.states, period.states_before);
    let duration_s = seconds(period.time_ns - period.from_ns);
    let known = [&states.vx_mps, &states.vy_mps, &states.vz_mps];
    alive
        .iter()
        .map(|&agent| {
            std::array::from_fn(|axis| {
                known[axis].get(agent).copied().unwrap_or_else(|| {
                    if before.alive.get(agent) && 0.0 < duration_s {
                        let (to, from) = (states.position_m(agent), before.position_m(agent));
                        (to[axis] - from[axis]) / duration_s
                    } else {
                        0.0
                    }
                })
            })
        })
        .collect()
}

/// Groups of agents.
pub(super) struct Groups {
    parent: Vec<usize>,
    n: usize,
}

impl Groups {
    /// Everyone a group, `n_alive` of them counted.
    pub(super) fn new(n_agents: usize, n_alive: usize) -> Self {
        Self { parent: (0..n_agents).collect(), n: n_alive }
    }

    pub(super) fn root_of(&mut self, mut agent: usize) -> usize {
        while self.parent[agent] != agent {
            self.parent[agent] = self.parent[self.parent[agent]];
            agent = self.parent[agent];
        }
        agent
    }

    pub(super) fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root_of(a), self.root_of(b));
        if a != b {
            self.parent[a.max(b)] = a.min(b);
            self.n -= 1;
        }
    }
}

fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] + b[axis])
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn norm(a: [f64; 3]) -> f64 {
    libm::sqrt(dot(a, a))
}

/// The direction; `None` of what is as good as nothing.
fn unit(a: [f64; 3]) -> Option<[f64; 3]> {
    let length = norm(a);
    (1e-9 < length).then(|| a.map(|component| component / length))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counts::Counts;
    use proto::types::{AgentStates, Deliveries, Heard, MoteStates, Payloads, Transmissions};

    /// A step of one second in which everyone sends at its begin, and `hears` says who hears.
    fn after(
        task: &Task,
        swarm: &mut SwarmMeasures,
        states: &AgentStates,
        hears: impl Fn(usize, usize) -> bool,
    ) {
        let n = states.len();
        let mut ends = Vec::new();
        let mut indices = Vec::new();
        for receiver in 0..n {
            indices.extend(
                (0..n as u32).filter(|&s| s as usize != receiver && hears(receiver, s as usize)),
            );
            ends.push(indices.len() as u32);
        }
        let deliveries = Deliveries {
            transmissions: Transmissions {
                sender: (0..n as u32).collect(),
                sent_ns: vec![250_000_000; n],
                end_ns: vec![260_000_000; n],
                payloads: Payloads::new(vec![1; n], vec![0; n].into()).unwrap(),
                ..Transmissions::default()
            },
            heard: Heard::Lists { ends, indices },
            ..Deliveries::default()
        };
        let counts = Counts::from_deliveries(&deliveries, n);
        let motes = MoteStates::default();
        let places = [(0, states), (1_000_000_000, states)];
        swarm.add(task, &Period::of_places(1, places, (&deliveries, &counts), &motes));
    }

    fn leader() -> Task {
        Task {
            leader: Some(0),
            leader_velocity_mps: Some([0.0, 2.0]),
            diameter_m: Some(0.5),
            ..Task::default()
        }
    }

    fn number(swarm: &SwarmMeasures, name: &str) -> f64 {
        swarm.figures(&leader())[name].unwrap().number().unwrap()
    }

    #[test]
    fn following_is_measured_along_the_leaders_way() {
        // The leader goes north at 2 m/s; one follower south at 1, one east at 3, one stands.
        let mut states = AgentStates::at_rest(&[[0.0, 0.0], [3.0, 4.0], [0.0, 2.0], [6.0, 0.0]]);
        states.vy_mps = vec![2.0, -1.0, 0.0, 0.0];
        states.vx_mps = vec![0.0, 0.0, 3.0, 0.0];
        let mut swarm = SwarmMeasures::default();
        after(&leader(), &mut swarm, &states, |_, _| true);
        assert!((number(&swarm, "speed_along_leader_mps") - 0.25).abs() < 1e-12);
        assert!((number(&swarm, "leader_distance_m") - (5.0 + 2.0 + 6.0) / 3.0).abs() < 1e-12);
        // Headings north, south and east of the three that move.
        assert!((number(&swarm, "polarisation") - 1.0 / 3.0).abs() < 1e-12);
        assert!((swarm.age_s().unwrap() - 0.75).abs() < 1e-12);
    }

    #[test]
    fn what_spreads_has_a_positive_radial_speed_however_it_travels() {
        let mut states = AgentStates::at_rest(&[[-1.0, 0.0], [1.0, 0.0]]);
        states.vx_mps = vec![10.0 - 3.0, 10.0 + 3.0];
        let mut swarm = SwarmMeasures::default();
        after(&leader(), &mut swarm, &states, |_, _| true);
        assert!((number(&swarm, "radial_speed_mps") - 3.0).abs() < 1e-12);
        assert!((number(&swarm, "cohesion_m") - 1.0).abs() < 1e-12);
    }

    #[test]
    fn fragments_are_groups_that_hear_each_other_even_by_way_of_others() {
        let states =
            AgentStates::at_rest(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [50.0, 0.0], [51.0, 0.0]]);
        let mut swarm = SwarmMeasures::default();
        // 1 hears 0, 2 hears 1: one way suffices. 3 and 4 hear each other.
        let heard = [(1, 0), (2, 1), (3, 4), (4, 3)];
        after(&leader(), &mut swarm, &states, |r, s| heard.contains(&(r, s)));
        assert!((number(&swarm, "fragments") - 2.0).abs() < 1e-12);
        assert!((number(&swarm, "leader_connected_ratio") - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_collision_is_counted_once_until_they_have_parted() {
        let mut swarm = SwarmMeasures::default();
        for distance_m in [1.0, 0.4, 0.3, 0.7, 0.2] {
            let states = AgentStates::at_rest(&[[0.0, 0.0], [9.0, 0.0], [0.0, distance_m]]);
            after(&leader(), &mut swarm, &states, |_, _| false);
        }
        assert!((number(&swarm, "collisions") - 2.0).abs() < 1e-12);
        assert!((number(&swarm, "min_distance_m") - 0.2).abs() < 1e-12);
    }

    #[test]
    fn neighbours_are_off_by_what_they_have_moved_since_they_spoke() {
        let mut swarm = SwarmMeasures::default();
        // 1 moves by 3 m, then by 4 m across; two hear it, one hears 2, which stays.
        let heard = [(0, 1), (2, 1), (0, 2)];
        for place in [[1.0, 0.0], [4.0, 0.0], [4.0, 4.0]] {
            let states = AgentStates::at_rest(&[[0.0, 0.0], place, [9.0, 9.0]]);
            after(&leader(), &mut swarm, &states, |r, s| heard.contains(&(r, s)));
        }
        let expected = (2.0 * 3.0 + 2.0 * 4.0) / 6.0;
        assert!((number(&swarm, "neighbour_error_m") - expected).abs() < 1e-12);
    }
}
