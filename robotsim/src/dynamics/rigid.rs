//! Rigid bodies: discs with mass, friction and spin, whose contacts Rapier resolves.

use super::fleet::{Fleet, near};
use super::inertial::{GRAVITY_MPS2, Inertial, within};
use super::surroundings::{Other, Surroundings};
use super::{Command, Memory, Motion, Step, norm};
use crate::config::field;
use crate::obstacles::Course;
use proto::config::{Default as Absent, Field, Kind, Range};
use proto::site::Site;
use proto::types::{AgentStates, seconds};
use rapier2d_f64::prelude::{
    CoefficientCombineRule, ColliderBuilder, ContactPair, PhysicsWorld, RigidBodyBuilder,
    RigidBodyHandle, Vector,
};
use serde::Deserialize;

/// A rigid disc on the ground.
///
/// # Model
///
/// A disc of mass m, radius r and moment of inertia m r²/2 that keeps its velocity and its spin. Its drive pushes it, in any
/// direction, with at most `force_cap_n`; where a controller commands a velocity u the force is m (u − v) / Δt, as far as that
/// allows. The ground brakes it with Coulomb's friction, which at rest holds it against a smaller force; the spin is
/// braked as that of a disc that presses evenly, whether it slides or not:
///
/// ```text
/// |dv/dt| = μ_g g,    |dω/dt| = 4 μ_g g / (3 r)
/// ```
///
/// Contacts with other discs, walls and obstacles are Rapier's (<https://rapier.rs>, `enhanced-determinism`): Newton's law with
/// restitution e along the normal, Coulomb's friction μ along the surface, which spins the disc; of two that touch the lower e
/// and the lower μ count, walls and obstacles having neither of their own. To them robots that are no rigid bodies are round
/// bodies that push and are not pushed back, and have neither e nor μ either: off one that moves with u a disc that meets it
/// head-on with v parts with u + e (u − v).
///
/// # Validity
///
/// On a plane: z stays, and heights do not count, but that robots which are no rigid bodies pass over all of them where they are
/// higher than their own radius above the highest. Within a step these go straight, evenly. Rapier lets bodies that are pressed together overlap a little, and gets hold
/// of them up to one part's way before they touch. A pair keeps its energy as the restitution says; in a room some meetings give
/// back less, so that elastic discs slow down in time. Where several meet at once, a restitution for each pair can give them more than
/// they had: what they exchange is then lessened until they have as much. Friction acts on the impulse of meeting, not on that of parting. How sliding lessens what the ground takes from the spin, and the
/// reverse, is left out (Farkas et al., Phys. Rev. Lett. 90, 248302, 2003). Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(super) struct RigidBody {
    pub(super) speed_cap_mps: f64,
    mass_kg: f64,
    body_diameter_m: f64,
    force_cap_n: f64,
    friction: f64,
    restitution: f64,
    ground_friction: f64,
}

pub(super) const FIELDS: &[Field] = &[
    field("mass_kg", "Mass (kg).", Kind::Number(Range::above(0.0, 1e6)), Absent::Number(1.0)),
    field(
        "body_diameter_m",
        "Diameter of the body in contacts (m). `robotsim.diameter_m` sets what counts as a collision.",
        Kind::Number(Range::closed(1e-3, 1e3)),
        Absent::Number(0.3),
    ),
    field(
        "force_cap_n",
        "Maximum drive force (N). 0: no drive; the body is only pushed.",
        Kind::Number(Range::closed(0.0, 1e9)),
        Absent::Number(10.0),
    ),
    field(
        "friction",
        "Coefficient of friction in contacts with robots, walls and obstacles.",
        Kind::Number(Range::closed(0.0, 10.0)),
        Absent::Number(0.3),
    ),
    field(
        "restitution",
        "Coefficient of restitution: speed after a contact per speed before it.",
        Kind::Number(Range::closed(0.0, 1.0)),
        Absent::Number(0.0),
    ),
    field(
        "ground_friction",
        "Coefficient of sliding friction with the ground. 0: it glides, or rolls on wheels.",
        Kind::Number(Range::closed(0.0, 10.0)),
        Absent::Number(0.0),
    ),
];

/// Longest part (s) of a step after which contacts are looked for.
const PART_S: f64 = 0.005;

impl Inertial for RigidBody {
    fn towards(&self, velocity_mps: [f64; 3], own_mps: [f64; 3], dt_s: f64) -> [f64; 3] {
        // What the ground takes has to be given, too.
        let ground_mps = within(velocity_mps, self.ground_mps2() * dt_s);
        let [x, y, _]: [f64; 3] =
            std::array::from_fn(|i| (velocity_mps[i] - own_mps[i] + ground_mps[i]) / dt_s);
        [x, y, 0.0]
    }

    fn limited(&self, [x, y, _]: [f64; 3]) -> [f64; 3] {
        within([x, y, 0.0], self.force_cap_n / self.mass_kg)
    }
}

impl RigidBody {
    pub(super) fn diameter_m(&self) -> f64 {
        self.body_diameter_m
    }

    /// What the ground takes (m/s²).
    fn ground_mps2(&self) -> f64 {
        self.ground_friction * GRAVITY_MPS2
    }

    /// Velocity (m/s) and way (m) after `h_s`, where without the ground it would have come from one velocity to the other on
    /// that way. Exact where nothing drives it.
    fn braked(
        &self,
        [before_mps, after_mps]: [[f64; 3]; 2],
        way_m: [f64; 3],
        h_s: f64,
    ) -> ([f64; 3], [f64; 3]) {
        let taken_mps = self.ground_mps2() * h_s;
        if taken_mps == 0.0 {
            return (after_mps, way_m);
        }
        let speed_mps = norm(after_mps);
        if speed_mps <= taken_mps {
            let begin_mps = norm(before_mps);
            let until_s = h_s.min(begin_mps / self.ground_mps2());
            return ([0.0; 3], before_mps.map(|part_mps| 0.5 * part_mps * until_s));
        }
        let left_mps = after_mps.map(|part_mps| part_mps * (1.0 - taken_mps / speed_mps));
        let shorter = |i: usize| way_m[i] - 0.5 * (after_mps[i] - left_mps[i]) * h_s;
        (left_mps, std::array::from_fn(shorter))
    }

    /// The spin (rad/s) that the ground leaves after `h_s`.
    fn slowed(&self, spin_radps: f64, h_s: f64) -> f64 {
        let taken_radps = 4.0 * self.ground_mps2() * h_s / (1.5 * self.body_diameter_m);
        let left_radps = (spin_radps.abs() - taken_radps).max(0.0);
        if spin_radps < 0.0 { -left_radps } else { left_radps }
    }

    /// Moment of inertia (kg m²).
    fn inertia(&self) -> f64 {
        0.125 * self.mass_kg * self.body_diameter_m * self.body_diameter_m
    }

    fn collider(&self) -> ColliderBuilder {
        surface(ColliderBuilder::ball(0.5 * self.body_diameter_m))
            .mass(self.mass_kg)
            .friction(self.friction)
            .restitution(self.restitution)
    }
}

/// Of two surfaces that touch the lower coefficients count.
fn surface(collider: ColliderBuilder) -> ColliderBuilder {
    collider
        .friction_combine_rule(CoefficientCombineRule::Min)
        .restitution_combine_rule(CoefficientCombineRule::Min)
        .friction(f64::MAX)
        .restitution(1.0)
}

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
    fn at(&self, share: f64) -> Vector {
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
                .translation(pusher.at(0.0))
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
        let robots =
            pushers.iter().zip(&self.pushing).map(|(pusher, &handle)| (handle, pusher.at(share)));
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
        let of = |disc| Some(root(&group, disc)).filter(|&group| !is_driven[group]);
        (0..n_discs).map(of).collect()
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
            states.alive.iter_ones().filter(|&agent| self.of(agent).is_rigid()).collect();
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
            let dynamics = self.of(agent);
            let Some(body) = dynamics.physics.rigid() else { continue };
            let motion = dynamics.take_up(agent, commands[agent], from_s, dt_s, states, memory);
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
                others: near(others, agent),
            });
        }
        let n = (dt_s / PART_S).max(dt_s * fastest_mps.min(1e4) / (0.25 * smallest_m));
        let n = libm::ceil(n).max(1.0) as usize;
        for part in 0..n {
            let at = |part: usize| from_s + dt_s * (part as f64 / n as f64);
            let to_s = if part + 1 == n { until_s } else { at(part + 1) };
            world.drive(step.courses, &pushers, to_s, (part + 1) as f64 / n as f64);
            self.advance_part(&mut world, &discs, [at(part), to_s], base, states, memory);
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
            let surroundings = Surroundings { others: &disc.others, ..*base };
            let before_mps = memory[agent].drive;
            let dynamics = self.of(agent);
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
                *heading_rad = super::wrapped(*heading_rad + spin_radps * h_s);
            }
        }
    }
}

#[cfg(test)]
mod tests;
