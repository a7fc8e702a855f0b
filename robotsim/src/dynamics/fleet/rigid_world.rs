//! Moves rigid bodies and resolves their contacts.

mod contacts;

use super::{Fleet, alive};
use crate::dynamics::rigid::RigidBody;
use crate::dynamics::surroundings::{Other, Surroundings, all_but};
use crate::dynamics::{Command, Memory, Motion, Step, norm, wrapped};
use crate::obstacles::Course;
use contacts::{Contacts, Partner, Round};
use proto::ids::AgentId;
use proto::site::Site;
use proto::types::AgentStates;

/// Longest part (s) of a step after which contacts are looked for.
const PART_S: f64 = 0.005;

/// Walls, obstacles and robots: made anew for each step, so that nothing but robots' states goes on.
struct World {
    contacts: Contacts,
    /// By course, the number of the obstacle that moves.
    moving: Vec<usize>,
    /// Numbers of the robots that are no rigid bodies.
    pushing: Vec<usize>,
    /// Number of the first rigid body; the others follow.
    first: usize,
}

/// A robot that pushes rigid bodies and is not pushed back: it goes straight, evenly, from one place to another in a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pusher {
    pub(super) begin_m: [f64; 3],
    pub(super) end_m: [f64; 3],
    pub(super) radius_m: f64,
}

impl Pusher {
    /// How far it goes in the plane (m).
    fn way_m(&self) -> f64 {
        libm::hypot(self.end_m[0] - self.begin_m[0], self.end_m[1] - self.begin_m[1])
    }

    /// Whether it is ever lower than its radius above this height (m).
    fn is_below(&self, height_m: f64) -> bool {
        self.begin_m[2].min(self.end_m[2]) < height_m + self.radius_m
    }

    /// Where it is after a share of the step.
    fn position_at(&self, share: f64) -> [f64; 2] {
        std::array::from_fn(|i| {
            let (begin_m, end_m) = (self.begin_m[i], self.end_m[i]);
            if share < 1.0 { begin_m + share * (end_m - begin_m) } else { end_m }
        })
    }
}

impl World {
    fn new(site: &Site, courses: &[Course], pushers: &[Pusher], from_s: f64) -> Self {
        let mut contacts = Contacts::new(&site.wall);
        let mut moving = vec![0; courses.len()];
        for (number, obstacle) in site.obstacle.iter().enumerate() {
            let course = courses.iter().position(|course| course.obstacle() == number);
            let centre_m = course.map_or(obstacle.centre_m, |it| courses[it].centre_m(from_s));
            let round = contacts.add(Round::immovable(centre_m, obstacle.radius_m));
            if let Some(course) = course {
                moving[course] = round;
            }
        }
        let pushing = pushers
            .iter()
            .map(|pusher| contacts.add(Round::immovable(pusher.position_at(0.0), pusher.radius_m)));
        let pushing = pushing.collect();
        let first = contacts.rounds.len();
        Self { contacts, moving, pushing, first }
    }

    /// Sets the velocity of everything that contacts do not move: at the end of the next part of `h_s`, at this time, after this share
    /// of the step, it is where its way says.
    fn drive(
        &mut self,
        (courses, pushers): (&[Course], &[Pusher]),
        to_s: f64,
        share: f64,
        h_s: f64,
    ) {
        let obstacles =
            courses.iter().zip(&self.moving).map(|(course, &round)| (round, course.centre_m(to_s)));
        let robots = pushers
            .iter()
            .zip(&self.pushing)
            .map(|(pusher, &round)| (round, pusher.position_at(share)));
        for (round, at_m) in obstacles.chain(robots) {
            let round = &mut self.contacts.rounds[round];
            round.velocity_mps = std::array::from_fn(|i| (at_m[i] - round.position_m[i]) / h_s);
        }
    }

    /// Takes in a rigid body.
    fn add(&mut self, body: &RigidBody, [x, y, _]: [f64; 3], spin_radps: f64) -> usize {
        self.contacts.add(Round {
            position_m: [x, y],
            velocity_mps: [0.0; 2],
            spin_radps,
            radius_m: 0.5 * body.body_diameter_m,
            inverse_mass: 1.0 / body.mass_kg,
            inverse_inertia: 1.0 / body.inertia(),
            friction: body.friction,
            restitution: body.restitution,
        })
    }

    /// Whether a disc goes its own way: an obstacle that moves, or a robot that is no rigid body.
    fn is_driven(&self, round: usize) -> bool {
        self.moving.contains(&round) || self.pushing.contains(&round)
    }

    /// The group of each rigid body, by the number of one of them: those that touch, directly or by way of others. None where one of
    /// them touches what is driven.
    fn groups(&self, n_discs: usize) -> Vec<Option<usize>> {
        let mut group: Vec<usize> = (0..n_discs).collect();
        let root = |group: &[usize], mut disc: usize| {
            while group[disc] != disc {
                disc = group[disc];
            }
            disc
        };
        let mut driven = Vec::new();
        for (body, partner) in self.contacts.touching() {
            let Partner::Round(other) = partner else { continue };
            if self.first <= other {
                let [one, other] = [body, other].map(|disc| root(&group, disc - self.first));
                group[one.max(other)] = one.min(other);
            } else if self.is_driven(other) {
                driven.push(body - self.first);
            }
        }
        let mut is_driven = vec![false; n_discs];
        for disc in driven {
            is_driven[root(&group, disc)] = true;
        }
        let free_group = |disc| Some(root(&group, disc)).filter(|&group| !is_driven[group]);
        (0..n_discs).map(free_group).collect()
    }

    /// Lessens what discs exchanged where it has given a group more energy than it had with the velocities (m/s) and spins (rad/s)
    /// `before`: the share s of all its changes for which it has as much.
    fn keep_energy(&mut self, discs: &[Disc<'_>], before: &[([f64; 2], f64)]) {
        if self.contacts.touching().next().is_none() {
            return;
        }
        // Of each group the energy, and what a share s of the changes adds to it: s · first + s² · second.
        let mut sums = vec![[0.0; 3]; discs.len()];
        let groups = self.groups(discs.len());
        for ((disc, &([x, y], spin)), group) in discs.iter().zip(before).zip(&groups) {
            let Some(group) = *group else { continue };
            let robot = &self.contacts.rounds[disc.round];
            let (mass_kg, inertia) = (disc.body.mass_kg, disc.body.inertia());
            let turn = robot.spin_radps - spin;
            let [dx, dy] = [robot.velocity_mps[0] - x, robot.velocity_mps[1] - y];
            let [energy, first, second] = &mut sums[group];
            *energy += 0.5 * (mass_kg * (x * x + y * y) + inertia * spin * spin);
            *first += mass_kg * (x * dx + y * dy) + inertia * spin * turn;
            *second += 0.5 * (mass_kg * (dx * dx + dy * dy) + inertia * turn * turn);
        }
        for ((disc, &([x, y], spin)), group) in discs.iter().zip(before).zip(&groups) {
            let Some([energy, first, second]) = group.map(|group| sums[group]) else { continue };
            if first + second <= ROUNDING * energy {
                continue;
            }
            let share = (-first / second).clamp(0.0, 1.0);
            let robot = &mut self.contacts.rounds[disc.round];
            let within = |before: f64, after: f64| before + share * (after - before);
            let [after_x, after_y] = robot.velocity_mps;
            robot.velocity_mps = [within(x, after_x), within(y, after_y)];
            robot.spin_radps = within(spin, robot.spin_radps);
        }
    }
}

/// Rounding makes no more energy than this share.
const ROUNDING: f64 = 1e-12;

/// A robot in the world.
struct Disc<'a> {
    agent: AgentId,
    body: &'a RigidBody,
    round: usize,
    motion: Motion,
    begin_m: [f64; 3],
    others: Vec<Other>,
}

impl Fleet {
    /// [`Self::advance`] for rigid bodies, all others having gone: in parts, in each of which drive, effects and ground change
    /// velocities, and then contacts do.
    pub(super) fn advance_rigid(
        &self,
        step: &Step<'_>,
        (base, others, pushers): (&Surroundings<'_>, &[(AgentId, Other)], &[Pusher]),
        commands: &[Command],
        states: &mut AgentStates,
        memory: &mut [Memory],
    ) {
        let (from_s, until_s) = (step.from.seconds(), step.until.seconds());
        let dt_s = (step.until - step.from).seconds();
        let rigid: Vec<AgentId> =
            alive(states).filter(|&agent| self.dynamics(agent).is_rigid()).collect();
        let heights_m = rigid.iter().map(|agent| states.z_m[agent.index()]);
        let highest_m = heights_m.fold(f64::NEG_INFINITY, f64::max);
        let pushers: Vec<Pusher> =
            pushers.iter().copied().filter(|pusher| pusher.is_below(highest_m)).collect();
        let mut world = World::new(step.site, step.courses, &pushers, from_s);
        let mut fastest_mps = step.courses.iter().map(Course::speed_mps).fold(0.0, f64::max);
        let mut smallest_m = f64::INFINITY;
        for pusher in &pushers {
            fastest_mps = fastest_mps.max(pusher.way_m() / dt_s);
            smallest_m = smallest_m.min(2.0 * pusher.radius_m);
        }
        let mut discs = Vec::new();
        for agent in rigid {
            let dynamics = self.dynamics(agent);
            let Some(body) = dynamics.physics.rigid() else { continue };
            let around = Surroundings { agent, ..*base };
            let command = commands[agent.index()];
            let motion = dynamics.take_up(command, from_s, dt_s, &around, states, memory);
            let most_mps = dt_s * body.force_cap_n / body.mass_kg;
            let before = &memory[agent.index()];
            fastest_mps = fastest_mps.max(norm(before.drive) + most_mps);
            smallest_m = smallest_m.min(body.body_diameter_m);
            let begin_m = states.position_m(agent.index());
            discs.push(Disc {
                agent,
                body,
                round: world.add(body, begin_m, before.spin_radps),
                motion,
                begin_m,
                others: all_but(others, agent),
            });
        }
        let n = (dt_s / PART_S).max(dt_s * fastest_mps.min(1e4) / (0.25 * smallest_m));
        let n = libm::ceil(n).max(1.0) as usize;
        for part in 0..n {
            let time_s = |part: usize| from_s + dt_s * (part as f64 / n as f64);
            let to_s = if part + 1 == n { until_s } else { time_s(part + 1) };
            let span_s = [time_s(part), to_s];
            let share = (part + 1) as f64 / n as f64;
            world.drive((step.courses, pushers.as_slice()), to_s, share, span_s[1] - span_s[0]);
            self.advance_part(&mut world, &discs, span_s, base, states, memory);
        }
        for Disc { agent, begin_m, .. } in discs {
            let agent = agent.index();
            let end_m = states.position_m(agent);
            [states.vx_mps[agent], states.vy_mps[agent], states.vz_mps[agent]] =
                std::array::from_fn(|i| (end_m[i] - begin_m[i]) / dt_s);
        }
    }

    fn advance_part(
        &self,
        world: &mut World,
        discs: &[Disc<'_>],
        span_s: [f64; 2],
        base: &Surroundings<'_>,
        states: &mut AgentStates,
        memory: &mut [Memory],
    ) {
        let h_s = span_s[1] - span_s[0];
        let mut free = Vec::with_capacity(discs.len());
        for disc in discs {
            let (agent, place) = (disc.agent, disc.agent.index());
            let surroundings = Surroundings { agent, others: &disc.others, ..*base };
            let before_mps = memory[place].drive;
            let dynamics = self.dynamics(agent);
            let way_m = dynamics.go(agent, disc.motion, span_s, &surroundings, states, memory);
            let after_mps = memory[place].drive;
            let (left_mps, way_m) = disc.body.braked([before_mps, after_mps], way_m, h_s);
            memory[place].drive = left_mps;
            let velocity_mps = [way_m[0] / h_s, way_m[1] / h_s];
            let spin_radps = disc.body.slowed(memory[place].spin_radps, h_s);
            free.push((velocity_mps, spin_radps));
            let robot = &mut world.contacts.rounds[disc.round];
            (robot.velocity_mps, robot.spin_radps) = (velocity_mps, spin_radps);
        }
        world.contacts.step(h_s);
        world.keep_energy(discs, &free);
        for (disc, (free_mps, _)) in discs.iter().zip(free) {
            let agent = disc.agent.index();
            let robot = &world.contacts.rounds[disc.round];
            [states.x_m[agent], states.y_m[agent]] = robot.position_m;
            // What contacts changed, its drive did not.
            memory[agent].drive[0] += robot.velocity_mps[0] - free_mps[0];
            memory[agent].drive[1] += robot.velocity_mps[1] - free_mps[1];
            memory[agent].spin_radps = robot.spin_radps;
            if let Some(heading_rad) = states.heading_rad.get_mut(agent) {
                *heading_rad = wrapped(*heading_rad + robot.spin_radps * h_s);
            }
        }
    }
}

#[cfg(test)]
mod tests;
