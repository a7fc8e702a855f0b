//! Moves rigid bodies, whose contacts Rapier resolves.

use super::Fleet;
use crate::dynamics::rigid::{RigidBody, surface};
use crate::dynamics::surroundings::{Other, Surroundings, all_but};
use crate::dynamics::{Command, Memory, Motion, Step, norm, wrapped};
use crate::obstacles::Course;
use proto::site::Site;
use proto::types::{AgentStates, seconds};
use rapier2d_f64::prelude::{
    ColliderBuilder, ContactPair, PhysicsWorld, RigidBodyBuilder, RigidBodyHandle, Vector,
};

/// Longest part (s) of a step after which contacts are looked for.
const PART_S: f64 = 0.005;

/// What is solid, and the robots in it: made anew for each step, so that nothing but robots' states goes on.
struct World {
    physics: PhysicsWorld,
    /// By course, the obstacle that moves.
    moving: Vec<RigidBodyHandle>,
    /// Robots that are no rigid bodies.
    pushing: Vec<RigidBodyHandle>,
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
    fn position_at(&self, share: f64) -> Vector {
        let [x, y]: [f64; 2] = std::array::from_fn(|i| {
            let (begin_m, end_m) = (self.begin_m[i], self.end_m[i]);
            if share < 1.0 { begin_m + share * (end_m - begin_m) } else { end_m }
        });
        Vector::new(x, y)
    }
}

impl World {
    fn new(site: &Site, courses: &[Course], pushers: &[Pusher], from_s: f64) -> Self {
        let mut physics = PhysicsWorld { gravity: Vector::ZERO, ..PhysicsWorld::default() };
        let parameters = &mut physics.integration_parameters;
        parameters.normalized_max_linear_velocity = f64::MAX;
        // Contacts are where bodies are, not where they were when they were last looked at; parts are short enough.
        parameters.contact_recycling = false;
        parameters.max_ccd_substeps = 0;
        let point = |[x, y]: [f64; 2]| Vector::new(x, y);
        for wall in &site.wall {
            let shape = ColliderBuilder::segment(point(wall.from_m), point(wall.to_m));
            physics.insert(RigidBodyBuilder::fixed(), surface(shape));
        }
        let mut moving = vec![RigidBodyHandle::invalid(); courses.len()];
        for (number, obstacle) in site.obstacle.iter().enumerate() {
            let course = courses.iter().position(|course| course.obstacle() == number);
            let (body, centre_m) = match course {
                Some(course) => {
                    let at_m = courses[course].centre_m(from_s);
                    (RigidBodyBuilder::kinematic_position_based(), at_m)
                }
                None => (RigidBodyBuilder::fixed(), obstacle.centre_m),
            };
            let shape = surface(ColliderBuilder::ball(obstacle.radius_m));
            let body = body.translation(point(centre_m));
            let body = if course.is_some() { body.user_data(DRIVEN) } else { body };
            let (handle, _) = physics.insert(body, shape);
            if let Some(course) = course {
                moving[course] = handle;
            }
        }
        let pushing = pushers.iter().map(|pusher| {
            let body = RigidBodyBuilder::kinematic_position_based()
                .translation(pusher.position_at(0.0))
                .user_data(DRIVEN);
            physics.insert(body, surface(ColliderBuilder::ball(pusher.radius_m))).0
        });
        let pushing = pushing.collect();
        Self { physics, moving, pushing }
    }

    /// Says where everything that is driven is at the end of the next part: at this time, after this share of the step.
    fn drive(&mut self, courses: &[Course], pushers: &[Pusher], to_s: f64, share: f64) {
        let obstacles = courses.iter().zip(&self.moving).map(|(course, &handle)| {
            let [x, y] = course.centre_m(to_s);
            (handle, Vector::new(x, y))
        });
        let robots = pushers
            .iter()
            .zip(&self.pushing)
            .map(|(pusher, &handle)| (handle, pusher.position_at(share)));
        for (handle, at) in obstacles.chain(robots) {
            if let Some(body) = self.physics.bodies.get_mut(handle) {
                body.set_next_kinematic_translation(at);
            }
        }
    }

    /// Takes in the disc of this number.
    fn add(
        &mut self,
        disc: usize,
        body: &RigidBody,
        [x, y, _]: [f64; 3],
        spin_radps: f64,
    ) -> RigidBodyHandle {
        let robot = RigidBodyBuilder::dynamic()
            .user_data(disc as u128 + 1)
            .translation(Vector::new(x, y))
            .angvel(spin_radps)
            .can_sleep(false);
        self.physics.insert(robot, body.collider()).0
    }

    /// The group of each disc, by the number of one of them: those that touch, directly or by way of others. None where one of them
    /// touches what is driven: an obstacle that moves, or a robot that is no rigid body.
    fn groups(&self, n_discs: usize) -> Vec<Option<usize>> {
        let mut group: Vec<usize> = (0..n_discs).collect();
        let root = |group: &[usize], mut disc: usize| {
            while group[disc] != disc {
                disc = group[disc];
            }
            disc
        };
        let mut driven = Vec::new();
        for pair in self.physics.contact_pairs().filter(|pair| pair.has_any_active_contact()) {
            let ends = [pair.collider1, pair.collider2].map(|collider| {
                let body = self.physics.colliders.get(collider).and_then(|it| it.parent());
                body.and_then(|body| self.physics.bodies.get(body)).map_or(0, |it| it.user_data)
            });
            match ends {
                [0, _] | [_, 0] => {}
                [DRIVEN, disc] | [disc, DRIVEN] => driven.push(disc as usize - 1),
                [one, other] => {
                    let [one, other] = [one, other].map(|disc| root(&group, disc as usize - 1));
                    group[one.max(other)] = one.min(other);
                }
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
        if !self.physics.contact_pairs().any(ContactPair::has_any_active_contact) {
            return;
        }
        // Of each group the energy, and what a share s of the changes adds to it: s · first + s² · second.
        let mut sums = vec![[0.0; 3]; discs.len()];
        let groups = self.groups(discs.len());
        for ((disc, &([x, y], spin)), group) in discs.iter().zip(before).zip(&groups) {
            let Some(group) = *group else { continue };
            let robot = &self.physics.bodies[disc.handle];
            let (mass_kg, inertia) = (disc.body.mass_kg, disc.body.inertia());
            let (velocity, turn) = (robot.linvel(), robot.angvel() - spin);
            let [dx, dy] = [velocity.x - x, velocity.y - y];
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
            let robot = &mut self.physics.bodies[disc.handle];
            let (velocity, turned) = (robot.linvel(), robot.angvel());
            let within = |before: f64, after: f64| before + share * (after - before);
            robot.set_linvel(Vector::new(within(x, velocity.x), within(y, velocity.y)), true);
            robot.set_angvel(within(spin, turned), true);
        }
    }
}

/// What the user data of a body in the world say: nothing of what stands, this of what is driven, and of a rigid body which of the
/// discs it is, from 1 on.
const DRIVEN: u128 = u128::MAX;
/// Rounding makes no more energy than this share.
const ROUNDING: f64 = 1e-12;

/// A robot in the world.
struct Disc<'a> {
    agent: usize,
    body: &'a RigidBody,
    handle: RigidBodyHandle,
    motion: Motion,
    begin_m: [f64; 3],
    others: Vec<Other>,
}

impl Fleet {
    /// [`Self::advance`] for rigid bodies, all others having gone: in parts, in each of which drive, effects and ground change
    /// velocities, and Rapier does what contacts do.
    pub(super) fn advance_rigid(
        &self,
        step: &Step<'_>,
        (base, others, pushers): (&Surroundings<'_>, &[(usize, Other)], &[Pusher]),
        commands: &[Command],
        states: &mut AgentStates,
        memory: &mut [Memory],
    ) {
        let (from_s, until_s) = (seconds(step.from_ns), seconds(step.until_ns));
        let dt_s = seconds(step.until_ns - step.from_ns);
        let rigid: Vec<usize> =
            states.alive.iter_ones().filter(|&agent| self.dynamics(agent).is_rigid()).collect();
        let heights_m = rigid.iter().map(|&agent| states.z_m[agent]);
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
            let around = Surroundings { agent: agent as u32, ..*base };
            let command = commands[agent];
            let motion = dynamics.take_up(command, from_s, dt_s, &around, states, memory);
            let most_mps = dt_s * body.force_cap_n / body.mass_kg;
            fastest_mps = fastest_mps.max(norm(memory[agent].drive) + most_mps);
            smallest_m = smallest_m.min(body.body_diameter_m);
            let begin_m = states.position_m(agent);
            discs.push(Disc {
                agent,
                body,
                handle: world.add(discs.len(), body, begin_m, memory[agent].spin_radps),
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
            world.drive(step.courses, &pushers, to_s, (part + 1) as f64 / n as f64);
            self.advance_part(&mut world, &discs, [time_s(part), to_s], base, states, memory);
        }
        for Disc { agent, begin_m, .. } in discs {
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
            let agent = disc.agent;
            let surroundings = Surroundings { agent: agent as u32, others: &disc.others, ..*base };
            let before_mps = memory[agent].drive;
            let dynamics = self.dynamics(agent);
            let way_m = dynamics.go(agent, disc.motion, span_s, &surroundings, states, memory);
            let after_mps = memory[agent].drive;
            let (left_mps, way_m) = disc.body.braked([before_mps, after_mps], way_m, h_s);
            memory[agent].drive = left_mps;
            let velocity_mps = [way_m[0] / h_s, way_m[1] / h_s];
            let spin_radps = disc.body.slowed(memory[agent].spin_radps, h_s);
            free.push((velocity_mps, spin_radps));
            let robot = &mut world.physics.bodies[disc.handle];
            robot.set_linvel(Vector::new(velocity_mps[0], velocity_mps[1]), true);
            robot.set_angvel(spin_radps, true);
        }
        world.physics.integration_parameters.dt = h_s;
        world.physics.step();
        world.keep_energy(discs, &free);
        for (disc, (free_mps, _)) in discs.iter().zip(free) {
            let agent = disc.agent;
            let robot = &world.physics.bodies[disc.handle];
            let (place, velocity, spin_radps) =
                (robot.translation(), robot.linvel(), robot.angvel());
            (states.x_m[agent], states.y_m[agent]) = (place.x, place.y);
            // What contacts changed, its drive did not.
            memory[agent].drive[0] += velocity.x - free_mps[0];
            memory[agent].drive[1] += velocity.y - free_mps[1];
            memory[agent].spin_radps = spin_radps;
            if let Some(heading_rad) = states.heading_rad.get_mut(agent) {
                *heading_rad = wrapped(*heading_rad + spin_radps * h_s);
            }
        }
    }
}

#[cfg(test)]
mod tests;
