//! What a run shows: measured step by step, so that no run is too long.

use super::arrangement::{Arrangement, connected_spread_m};
use super::counts::{add_known, by_second_medium, was_heard_by};
use super::distances::{DistanceBin, Distances};
use super::hearing::{Hearing, works};
use super::kpi::Kpis;
use super::period::{Period, distance_m};
use super::solids::Solids;
use super::swarm::SwarmMeasures;
use super::task::Task;
use super::trajectories::Trajectories;
use crate::figures::{FigureValue, FiguresByName};
use numbers::statistics::{quantile, ratio};
use proto::site::Site;
use proto::types::{AgentStates, Bitmap, TaskFigure, seconds};

/// Measures of a run.
#[derive(Clone, Debug, Default)]
pub struct Measures {
    /// What the robots were asked to do.
    pub task: Task,
    /// Walls and obstacles, where they stand at the beginning.
    pub site: Site,
    /// Time series, one entry per step.
    pub series: Vec<Sample>,
    /// Positions of agents over time, thinned out for pictures.
    pub trajectories: Trajectories,
    /// Number of steps that were added.
    pub n_steps: u64,
    /// Simulated time reached (ns).
    pub time_ns: u64,
    /// When the robots started (ns): before that they stood still, and nothing is measured but [`Self::kpis`].
    pub start_ns: u64,
    /// The network's own figures.
    pub kpis: Kpis,
    /// Who heard whom when.
    pub hearing: Hearing,
    /// The first step after which the robots regarded their task as done.
    pub completed_at_step: Option<u64>,
    /// What the robots say of how far their task is, after the latest step.
    pub task_figures: Vec<TaskFigure>,
    /// Number of payloads that agents sent.
    pub transmissions: u64,
    /// Bytes of payload sent.
    pub sent_bytes: u64,
    /// Transmissions for everyone in reach, times alive receivers other than the sender.
    pub attempts: u64,
    /// How many of them were delivered.
    pub deliveries: u64,
    /// Deliveries of unicast messages. The network reports these only if they arrive, so the number of attempts is unknown.
    pub unicast_deliveries: u64,
    /// Deliveries that a second medium carried, if the network states by which medium they came.
    pub second_medium_deliveries: Option<u64>,
    /// Fewer than all receivers were looked at for [`Measures::by_distance`].
    pub is_distance_sampled: bool,
    distances: Distances,
    delay_ns: u128,
    /// Sums over steps, weighted by their duration (m/s times ns).
    flock_speed_sum: f64,
    speed_sum: f64,
    /// Duration of all steps, and of all steps times alive agents (ns).
    duration_ns: u64,
    agent_duration_ns: u128,
    /// Alive agents over all steps; how many others they heard; how many of them heard nobody.
    n_alive: u64,
    neighbour_sum: u64,
    isolated: u64,
    /// The latter two by agent: steps in which it was alive, and in which it heard nobody.
    isolated_by_agent: Vec<[u64; 2]>,
    first_states: AgentStates,
    last_states: AgentStates,
    events: Vec<Event>,
    /// Motes that worked after the latest step, and motes that were ordered to fail since.
    working: Option<Bitmap>,
    killed: Vec<u32>,
    swarm: SwarmMeasures,
    solids: Option<Solids>,
}

/// More events than this cannot be distinguished in a picture.
const MOST_EVENTS: usize = 100;
/// The word for an order to fail.
pub const KILL: &str = "kill";

/// What happened to motes.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// When the step in which it happened began (s).
    pub time_s: f64,
    /// What happened, in one word.
    pub what: &'static str,
    /// The motes; empty where it concerns all.
    pub motes: Vec<u32>,
}

/// What is measured in every step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Time at the end of the step (s).
    pub time_s: f64,
    /// Magnitude of the mean velocity of alive agents (m/s).
    pub flock_speed_mps: f64,
    /// The part of that velocity along the leader's direction (m/s), if there is a leader that moves.
    pub along_leader_mps: Option<f64>,
    /// Neighbours heard per alive agent: 10 % quantile, median, 90 % quantile.
    pub neighbours: [f64; 3],
}

impl Measures {
    /// Begins with the states of step 0.
    pub fn new(task: Task, site: Site, states: &AgentStates, kpis: Kpis) -> Self {
        Self {
            trajectories: Trajectories::new(states, task.leader),
            solids: Solids::from_site(&site, &task),
            task,
            site,
            kpis,
            isolated_by_agent: vec![[0; 2]; states.len()],
            first_states: states.clone(),
            last_states: states.clone(),
            ..Self::default()
        }
    }

    /// Adds what happened in one control period. Periods are added in order.
    pub fn add(&mut self, period: &Period<'_>) {
        self.n_steps = period.step;
        self.time_ns = period.time_ns;
        self.kpis.add(period);
        self.hearing.add(period);
        self.note_failures(period);
        if let Some(solids) = &mut self.solids {
            solids.add(&self.task, period, |_, _| {});
        }
        if period.held {
            self.start_ns = period.time_ns;
            self.first_states.clone_from(period.states);
            return;
        }
        if period.task_complete && self.completed_at_step.is_none() {
            self.completed_at_step = Some(period.step);
        }
        self.trajectories.add(period.step, period.states);
        self.hearing.add_payloads(period);
        let along_leader_mps = self.swarm.add(&self.task, period);
        self.add_network(period);
        self.add_distances(period);
        let flock_speed_mps = self.add_speeds(period);
        let neighbours = self.add_neighbours(period);
        let time_s = seconds(period.time_ns);
        self.series.push(Sample { time_s, flock_speed_mps, along_leader_mps, neighbours });
        self.last_states.clone_from(period.states);
    }

    /// Notes that no step follows.
    pub fn end(&mut self) {
        self.trajectories.end(&self.last_states);
    }

    /// Time mean of the flock's speed (m/s): of the magnitude of the mean velocity of alive agents.
    #[must_use]
    pub fn flock_speed_mps(&self) -> Option<f64> {
        ratio(self.flock_speed_sum, self.duration_ns as f64)
    }

    /// Time from when the robots started until they first regarded their task as done (s).
    #[must_use]
    pub fn completed_after_s(&self) -> Option<f64> {
        // There is no sample of steps in which the robots stood still for the network.
        let n_held = self.n_steps - self.series.len() as u64;
        let place = usize::try_from(self.completed_at_step?.checked_sub(n_held + 1)?).ok()?;
        Some(self.series.get(place)?.time_s - seconds(self.start_ns))
    }

    /// Mean over alive agents and time of each one's own speed (m/s).
    #[must_use]
    pub fn mean_speed_mps(&self) -> Option<f64> {
        ratio(self.speed_sum, self.agent_duration_ns as f64)
    }

    /// Whether an agent moved. In a network of sensors nobody does.
    #[must_use]
    pub fn anybody_moved(&self) -> bool {
        self.speed_sum != 0.0
    }

    /// Whether the agents have a path worth showing: they moved, or reported positions. Sensors do neither.
    #[must_use]
    pub fn has_way(&self) -> bool {
        self.anybody_moved() || self.anybody_spoke() || !self.kpis.account.has_applications()
    }

    /// What happened to motes within the steps: orders that the network was given, and motes that failed of themselves.
    #[must_use]
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// Notes an order of the step that begins at `from_ns`, in one word, and the mote that it is for. Motes for which the same is
    /// ordered at once share an event.
    pub fn note_event(&mut self, from_ns: u64, what: &'static str, mote: Option<u32>) {
        if what == KILL {
            self.killed.extend(mote);
        }
        let time_s = seconds(from_ns);
        let is_full = MOST_EVENTS <= self.events.len();
        match self.events.last_mut() {
            Some(last) if last.what == what && last.time_s == time_s => last.motes.extend(mote),
            _ if is_full => {}
            _ => self.events.push(Event { time_s, what, motes: mote.into_iter().collect() }),
        }
    }

    /// Notes motes that failed though nobody ordered that: their batteries are empty.
    fn note_failures(&mut self, period: &Period<'_>) {
        let alive = &period.motes.alive;
        let killed = std::mem::take(&mut self.killed);
        if let Some(working) = self.working.take() {
            let failed =
                |&mote: &usize| !works(period.motes, mote) && !killed.contains(&(mote as u32));
            for mote in working.iter_ones().filter(failed) {
                self.note_event(period.from_ns, "fails", Some(mote as u32));
            }
        }
        self.working = Some(alive.clone());
    }

    /// Whether an agent's payload was sent.
    #[must_use]
    pub fn anybody_spoke(&self) -> bool {
        self.transmissions != 0
    }

    /// Where the robots were when they started.
    #[must_use]
    pub fn at_start(&self) -> Arrangement<'_> {
        Arrangement(&self.first_states)
    }

    /// Where they are at the end.
    #[must_use]
    pub fn at_end(&self) -> Arrangement<'_> {
        Arrangement(&self.last_states)
    }

    /// The spread of the largest group of robots that heard each other in the last period of [`Self::hearing`], m: 0 if nobody
    /// heard anybody, since each is a group of its own.
    #[must_use]
    pub fn connected_spread_m(&self) -> Option<f64> {
        let periods = self.hearing.periods();
        let nobody = Some(0.0).filter(|_| 0 < self.n_alive_at_end());
        periods.last().map_or(nobody, connected_spread_m)
    }

    /// Time mean of the speed of the mean velocity along the leader's direction (m/s).
    #[must_use]
    pub fn speed_along_leader_mps(&self) -> Option<f64> {
        self.swarm.speed_along_leader_mps()
    }

    /// Mean age (s) of what was heard when robots act on it.
    #[must_use]
    pub fn mean_age_s(&self) -> Option<f64> {
        self.swarm.age_s()
    }

    /// What the swarm did, by name of the figure.
    #[must_use]
    pub fn swarm_figures(&self) -> FiguresByName {
        let mut figures = self.swarm.figures(&self.task);
        if let Some(solids) = &self.solids {
            let n_met = FigureValue::Count(solids.n_met());
            figures.insert("site_collisions".to_owned(), Some(n_met));
        }
        figures
    }

    /// How often robots went into or through walls and obstacles, since nothing holds them up.
    #[must_use]
    pub fn n_passed_walls(&self) -> u64 {
        self.solids.as_ref().map_or(0, Solids::n_passed)
    }

    /// Agents alive at the end.
    #[must_use]
    pub fn n_alive_at_end(&self) -> usize {
        self.last_states.alive.count()
    }

    /// Mean over alive agents and steps of how many others each heard; `None`: nobody said anything.
    #[must_use]
    pub fn mean_neighbours(&self) -> Option<f64> {
        self.of_those_alive(self.neighbour_sum)
    }

    /// Share of alive agents and steps in which the agent heard nobody; `None`: nobody said anything.
    #[must_use]
    pub fn isolated_ratio(&self) -> Option<f64> {
        self.of_those_alive(self.isolated)
    }

    /// Agents that heard nobody in some steps: the agent, and in which share of the steps in which it was alive. Most first.
    #[must_use]
    pub fn isolated_agents(&self) -> Vec<(usize, f64)> {
        let share = |&[alive, isolated]: &[u64; 2]| ratio(isolated as f64, alive as f64);
        let by_agent = self.isolated_by_agent.iter().enumerate();
        let mut agents: Vec<(usize, f64)> = by_agent
            .filter_map(|(agent, counts)| Some((agent, share(counts)?)))
            .filter(|&(_, share)| 0.0 < share)
            .collect();
        agents.sort_by(|a, b| b.1.total_cmp(&a.1));
        agents
    }

    fn of_those_alive(&self, sum: u64) -> Option<f64> {
        ratio(sum as f64, self.n_alive as f64).filter(|_| self.anybody_spoke())
    }

    /// Share of [`Measures::attempts`] that were delivered.
    #[must_use]
    pub fn delivery_ratio(&self) -> Option<f64> {
        ratio(self.deliveries as f64, self.attempts as f64)
    }

    /// Mean time from the first bit sent to the delivery (s).
    #[must_use]
    pub fn mean_delay_s(&self) -> Option<f64> {
        ratio(self.delay_ns as f64 / 1e9, (self.deliveries + self.unicast_deliveries) as f64)
    }

    /// Delivery against distance, in at most 30 bins of equal width.
    #[must_use]
    pub fn by_distance(&self) -> Vec<DistanceBin> {
        self.distances.table(30)
    }

    fn add_network(&mut self, period: &Period<'_>) {
        let sent = &period.deliveries.transmissions;
        let alive = &period.states_on_air.alive;
        let n_alive = alive.count() as u64;
        self.transmissions += sent.len() as u64;
        self.sent_bytes += sent.payloads.data().len() as u64;
        add_known(&mut self.second_medium_deliveries, by_second_medium(period.deliveries));
        for (index, &sender) in sent.sender.iter().enumerate() {
            let n_received = u64::from(period.counts.receivers[index]);
            if sent.destination(index).is_some() {
                self.unicast_deliveries += n_received;
            } else {
                self.attempts += n_alive - u64::from(alive.get(sender as usize));
                self.deliveries += n_received;
            }
            if period.deliveries.received_ns.is_empty() {
                self.delay_ns +=
                    u128::from(n_received) * u128::from(sent.end_ns[index] - sent.sent_ns[index]);
            }
        }
        if period.deliveries.received_ns.is_empty() {
            return;
        }
        let mut delivery = 0;
        for receiver in 0..period.states.len() {
            for index in period.deliveries.heard_by(receiver) {
                if sent.sender[index] as usize != receiver {
                    let received_ns = period.deliveries.received_ns[delivery];
                    self.delay_ns += u128::from(received_ns.saturating_sub(sent.sent_ns[index]));
                }
                delivery += 1;
            }
        }
    }

    /// Counts attempts by distance. Where there are very many, over some receivers only: spread evenly over the agents,
    /// and others in each step.
    fn add_distances(&mut self, period: &Period<'_>) {
        let sent = &period.deliveries.transmissions;
        if sent.is_empty() {
            return;
        }
        let alive: Vec<usize> = period.states_on_air.alive.iter_ones().collect();
        let n_looked_at = alive.len().min((MAX_PAIRS / sent.len()).max(1));
        self.is_distance_sampled |= n_looked_at < alive.len();
        for i in 0..n_looked_at {
            let place = i * alive.len() / n_looked_at + (period.step % alive.len() as u64) as usize;
            let receiver = alive[place % alive.len()];
            for (index, &sender) in sent.sender.iter().enumerate() {
                if sender as usize != receiver && sent.destination(index).is_none() {
                    let distance_m = distance_m(period.states_on_air, sender as usize, receiver);
                    self.distances
                        .add(distance_m, was_heard_by(period.deliveries, receiver, index));
                }
            }
        }
    }

    /// Adds everyone's speed, as long as the step lasted. Returns the flock's (m/s).
    fn add_speeds(&mut self, period: &Period<'_>) -> f64 {
        let (states, before) = (period.states, period.states_before);
        let duration_ns = period.time_ns - period.from_ns;
        let duration_s = seconds(duration_ns);
        let known = [&states.vx_mps, &states.vy_mps, &states.vz_mps];
        let reached = [&states.x_m, &states.y_m, &states.z_m];
        let left = [&before.x_m, &before.y_m, &before.z_m];
        let mut sum = [0.0; 3];
        let mut speeds_mps = 0.0;
        for agent in states.alive.iter_ones() {
            let mut square = 0.0;
            for axis in 0..3 {
                let velocity = known[axis].get(agent).copied().unwrap_or_else(|| {
                    // Not reported. An agent that has just come to life has not moved.
                    if before.alive.get(agent) && 0.0 < duration_s {
                        (reached[axis][agent] - left[axis][agent]) / duration_s
                    } else {
                        0.0
                    }
                });
                sum[axis] += velocity;
                square += velocity * velocity;
            }
            speeds_mps += libm::sqrt(square);
        }
        let n = states.alive.count();
        let norm = libm::sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]);
        let flock_speed_mps = ratio(norm, n as f64).unwrap_or(0.0);
        self.duration_ns += duration_ns;
        self.agent_duration_ns += u128::from(duration_ns) * n as u128;
        self.flock_speed_sum += flock_speed_mps * duration_ns as f64;
        self.speed_sum += speeds_mps * duration_ns as f64;
        flock_speed_mps
    }

    /// Adds how many neighbours everyone heard. Returns the quantiles, 0 where nobody is alive.
    fn add_neighbours(&mut self, period: &Period<'_>) -> [f64; 3] {
        for agent in period.states.alive.iter_ones() {
            let [alive, isolated] = &mut self.isolated_by_agent[agent];
            *alive += 1;
            *isolated += u64::from(period.counts.neighbours[agent] == 0);
        }
        let mut heard: Vec<u32> =
            period.states.alive.iter_ones().map(|agent| period.counts.neighbours[agent]).collect();
        heard.sort_unstable();
        self.n_alive += heard.len() as u64;
        self.neighbour_sum += heard.iter().map(|&n| u64::from(n)).sum::<u64>();
        self.isolated += heard.iter().filter(|&&n| n == 0).count() as u64;
        if heard.is_empty() {
            return [0.0; 3];
        }
        [0.1, 0.5, 0.9].map(|share| quantile(&heard, share))
    }
}

/// Most pairs whose distance is looked at in a step.
const MAX_PAIRS: usize = 100_000;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counts::Counts;
    use proto::types::{Deliveries, EVERYONE, Heard, MoteStates, Payloads, Transmissions};

    #[test]
    fn what_is_for_one_agent_is_no_attempt_to_reach_the_others() {
        // Of four agents the first broadcasts, and two hear it; the second sends to the last alone.
        let states = AgentStates::at_origin(4);
        let deliveries = Deliveries {
            transmissions: Transmissions {
                sender: vec![0, 1],
                sent_ns: vec![0, 10],
                end_ns: vec![4, 30],
                payloads: Payloads::new(vec![1; 2], vec![0; 2].into()).unwrap(),
                destination: vec![EVERYONE, 3],
            },
            heard: Heard::Lists { ends: vec![0, 1, 2, 3], indices: vec![0, 0, 1] },
            ..Deliveries::default()
        };
        let counts = Counts::from_deliveries(&deliveries, 4);
        let motes = MoteStates::default();
        let places = [(0, &states), (1_000_000_000, &states)];
        let mut measures =
            Measures::new(Task::default(), Site::default(), &states, Kpis::default());
        measures.add(&Period::of_places(1, places, (&deliveries, &counts), &motes));
        assert_eq!([measures.transmissions, measures.attempts, measures.deliveries], [2, 3, 2]);
        assert_eq!(measures.unicast_deliveries, 1);
        assert_eq!(measures.by_distance().iter().map(|bin| bin.attempts).sum::<u64>(), 3);
        // The delays are 4, 4 and 20 ns.
        assert!((measures.mean_delay_s().unwrap() - 28e-9 / 3.0).abs() < 1e-15);
    }

    #[test]
    fn events_name_the_mote_and_who_heard_nobody_is_known() {
        let states = AgentStates::at_origin(3);
        // Agent 1 hears agent 0 in the first of two steps; the others hear nobody.
        let deliveries = |indices: Vec<u32>| Deliveries {
            transmissions: Transmissions {
                sender: vec![0],
                sent_ns: vec![0],
                end_ns: vec![4],
                payloads: Payloads::new(vec![1], vec![0].into()).unwrap(),
                destination: vec![EVERYONE],
            },
            heard: Heard::Lists {
                ends: vec![0, indices.len() as u32, indices.len() as u32],
                indices,
            },
            ..Deliveries::default()
        };
        let motes = |dead: &[usize]| {
            let mut alive = Bitmap::filled(3, true);
            dead.iter().for_each(|&mote| alive.set(mote, false));
            MoteStates { alive, ..MoteStates::default() }
        };
        let mut measures =
            Measures::new(Task::default(), Site::default(), &states, Kpis::default());
        let second = 1_000_000_000;
        for (step, heard, dead) in [(1, vec![0], vec![]), (2, vec![], vec![1, 2])] {
            let deliveries = deliveries(heard);
            let counts = Counts::from_deliveries(&deliveries, 3);
            let places = [((step - 1) * second, &states), (step * second, &states)];
            if step == 2 {
                measures.note_event(second, KILL, Some(2));
            }
            measures.add(&Period::of_places(step, places, (&deliveries, &counts), &motes(&dead)));
        }
        let event = |what, mote| Event { time_s: 1.0, what, motes: vec![mote] };
        assert_eq!(measures.events(), [event(KILL, 2), event("fails", 1)]);
        assert_eq!(measures.isolated_agents(), [(0, 1.0), (2, 1.0), (1, 0.5)]);
    }
}
