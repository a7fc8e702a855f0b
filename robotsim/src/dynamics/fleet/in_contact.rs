//! Moves robots whose contacts are resolved, and puts those apart that begin in each other.

use super::Fleet;
use crate::dynamics::contacts::{Contacts, Disc, solids};
use crate::dynamics::surroundings::{Other, Surroundings, all_but};
use crate::dynamics::{Command, Memory, Motion, Step, norm};
use crate::obstacles::Course;
use proto::ids::AgentId;
use proto::site::Site;
use proto::types::AgentStates;

impl Fleet {
    /// [`Self::advance`] in parts so short that robots cannot pass through each other, with contacts resolved after each.
    pub(super) fn advance_in_contact(
        &self,
        contacts: &Contacts,
        step: &Step<'_>,
        (base, others): (&Surroundings<'_>, &[(AgentId, Other)]),
        commands: &[Command],
        states: &mut AgentStates,
        memory: &mut [Memory],
    ) {
        let (from_s, until_s) = (step.from.seconds(), step.until.seconds());
        let dt_s = (step.until - step.from).seconds();
        let mut solids = solids(step.site);
        let mut fastest_mps = step.courses.iter().map(Course::speed_mps).fold(0.0, f64::max);
        let mut robots = Vec::new();
        let bodies: Vec<AgentId> = self.alive_bodies(states).collect();
        for agent in bodies {
            let command = commands[agent.index()];
            let own_mps = memory.get(agent.index()).map_or([0.0; 3], |memory| memory.drive);
            let asked_mps = match command {
                Command::Acceleration(asked_mps2) => {
                    dt_s * self.dynamics(agent).physics.most_mps2(asked_mps2)
                }
                Command::Jump(_) => 0.0,
                Command::Velocity(velocity_mps) => {
                    self.dynamics(agent).physics.most_mps(velocity_mps)
                }
            };
            fastest_mps = fastest_mps.max(norm(own_mps) + asked_mps);
            let dynamics = self.dynamics(agent);
            let surroundings = Surroundings { agent, ..*base };
            let motion = dynamics.take_up(command, from_s, dt_s, &surroundings, states, memory);
            let begin_m = states.position_m(agent.index());
            robots.push((agent, motion, begin_m, all_but(others, agent)));
        }
        let n = contacts.n_parts(dt_s, fastest_mps);
        let mut discs: Vec<Disc> = Vec::with_capacity(robots.len());
        for part in 0..n {
            let time_s = |part: usize| from_s + dt_s * (part as f64 / n as f64);
            let to_s = if part + 1 == n { until_s } else { time_s(part + 1) };
            for course in step.courses {
                solids[step.site.wall.len() + course.obstacle()] =
                    course.solid(step.site, [time_s(part), to_s]);
            }
            discs.clear();
            for &(agent, motion, _, ref near) in &robots {
                let surroundings = Surroundings { agent, others: near, ..*base };
                let motion = match motion {
                    Motion::Jump(way_m) => Motion::Jump(way_m.map(|part_m| part_m / n as f64)),
                    motion => motion,
                };
                let from_m = states.position_m(agent.index());
                let span_s = [time_s(part), to_s];
                let dynamics = self.dynamics(agent);
                let way_m = dynamics.go(agent, motion, span_s, &surroundings, states, memory);
                let is_inertial = dynamics.physics.is_inertial();
                let disc = Disc {
                    position_m: from_m,
                    velocity_mps: is_inertial.then(|| memory[agent.index()].drive),
                    driven_mps: way_m.map(|part_m| part_m / (to_s - time_s(part))),
                };
                discs.push(contacts.walk(&solids, disc, way_m));
            }
            contacts.separate(&solids, &mut discs);
            for ((agent, ..), disc) in robots.iter().zip(&discs) {
                let agent = agent.index();
                let [x_m, y_m, z_m] = disc.position_m;
                (states.x_m[agent], states.y_m[agent], states.z_m[agent]) = (x_m, y_m, z_m);
                if let Some(velocity_mps) = disc.velocity_mps {
                    memory[agent].drive = velocity_mps;
                }
            }
        }
        for (agent, _, begin_m, _) in robots {
            let agent = agent.index();
            let end_m = states.position_m(agent);
            [states.vx_mps[agent], states.vy_mps[agent], states.vz_mps[agent]] =
                std::array::from_fn(|i| (end_m[i] - begin_m[i]) / dt_s);
        }
    }

    /// Takes a robot that begins within a wall, an obstacle or another robot out of there, where contacts are resolved.
    pub fn make_room(&self, site: &Site, states: &mut AgentStates) {
        let Some(contacts) = self.room() else { return };
        let solids = solids(site);
        let alive = states.alive.clone();
        let disc = |agent| Disc {
            position_m: states.position_m(agent),
            velocity_mps: None,
            driven_mps: [0.0; 3],
        };
        let mut discs: Vec<Disc> =
            alive.iter_ones().map(|agent| contacts.walk(&solids, disc(agent), [0.0; 3])).collect();
        contacts.separate(&solids, &mut discs);
        for (agent, disc) in alive.iter_ones().zip(discs) {
            let [x_m, y_m, z_m] = disc.position_m;
            (states.x_m[agent], states.y_m[agent], states.z_m[agent]) = (x_m, y_m, z_m);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalogue::Catalogue;
    use crate::dynamics::Dynamics;
    use crate::dynamics::contacts::unit;
    use proptest::prelude::*;
    use proto::site::Wall;
    use proto::time::SimTime;

    const STEP_NS: u64 = 100_000_000;

    /// Double integrators of 0.3 m in a place, left to themselves for some steps. Positions (m) and velocities (m/s).
    fn drift(
        start: &[([f64; 3], [f64; 3])],
        restitution: f64,
        site: &Site,
        n_steps: u64,
    ) -> Vec<([f64; 3], [f64; 3])> {
        let body = "kind = 'double-integrator'\nspeed_cap_mps = 30.0\ncap = 'norm'\nacceleration_cap_mps2 = 10.0";
        let contacts = Contacts { radius_m: 0.15, restitution };
        let dynamics = Dynamics::build(
            &body.parse().unwrap(),
            "",
            &Catalogue::built_in().effects,
            &mut Vec::new(),
        )
        .unwrap();
        let dynamics = Fleet::new([(start.len(), dynamics)], Some(contacts), 0.3);
        let mut states = AgentStates::at_origin(start.len());
        let mut memory = dynamics.memory(start.len());
        for (agent, &(at_m, velocity_mps)) in start.iter().enumerate() {
            [states.x_m[agent], states.y_m[agent], states.z_m[agent]] = at_m;
            memory[agent].drive = velocity_mps;
        }
        let free = vec![Command::Acceleration([0.0; 3]); start.len()];
        for step in 0..n_steps {
            let [from, until] = [step, step + 1].map(|n| SimTime::from_ns(n * STEP_NS));
            let step = Step { from, until, site, courses: &[], seed: 1 };
            dynamics.advance(&step, &free, &mut states, &mut memory);
        }
        let end = |agent: usize| (states.position_m(agent), memory[agent].drive);
        (0..start.len()).map(end).collect()
    }

    fn momentum(robots: &[([f64; 3], [f64; 3])]) -> [f64; 3] {
        std::array::from_fn(|axis| robots.iter().map(|(_, velocity)| velocity[axis]).sum())
    }

    fn energy(robots: &[([f64; 3], [f64; 3])]) -> f64 {
        robots.iter().flat_map(|(_, velocity)| velocity).map(|part| 0.5 * part * part).sum()
    }

    /// Two robots that meet off-centre after 1 m.
    const MEETING: [([f64; 3], [f64; 3]); 2] =
        [([0.0; 3], [3.0, 0.0, 0.0]), ([2.3, -0.1, 0.0], [-1.0, 0.5, 0.0])];

    #[test]
    fn two_robots_keep_their_momentum_and_lose_what_the_restitution_says() {
        for restitution in [0.0, 0.5, 1.0] {
            let end = drift(&MEETING, restitution, &Site::default(), 20);
            assert!(end[0].1 != MEETING[0].1, "they met");
            for (after, before) in momentum(&end).into_iter().zip(momentum(&MEETING)) {
                // A few roundings of numbers below 4.
                assert!((after - before).abs() < 1e-14, "{after} {before}");
            }
            // Lost is (1 − e²) of the energy along the normal, which is what the velocities changed along.
            let change: [f64; 3] = std::array::from_fn(|i| end[0].1[i] - MEETING[0].1[i]);
            let normal = unit(change).unwrap();
            let closing: f64 =
                (0..3).map(|i| (MEETING[1].1[i] - MEETING[0].1[i]) * normal[i]).sum();
            let lost = (1.0 - restitution * restitution) * closing * closing / 4.0;
            assert!((energy(&MEETING) - energy(&end) - lost).abs() < 1e-13, "e = {restitution}");
        }
    }

    #[test]
    fn head_on_equal_robots_exchange_their_velocities_or_go_on_as_one() {
        let start = [([0.0; 3], [3.0, 0.0, 0.0]), ([2.0, 0.0, 0.0], [-1.0, 0.0, 0.0])];
        let [a, b] = drift(&start, 1.0, &Site::default(), 20)[..] else { unreachable!() };
        assert!((a.1[0] + 1.0).abs() < 1e-14 && (b.1[0] - 3.0).abs() < 1e-14, "{a:?} {b:?}");
        // They touch after (2 − 0.3)/4 s, at 1.275 m; found at most a quarter of a diameter late.
        let [x_a, x_b] = [1.275 - (2.0 - 0.425), 1.575 + 3.0 * (2.0 - 0.425)];
        assert!((a.0[0] - x_a).abs() < 0.075 && (b.0[0] - x_b).abs() < 0.075, "{a:?} {b:?}");
        let [a, b] = drift(&start, 0.0, &Site::default(), 20)[..] else { unreachable!() };
        assert!((a.1[0] - 1.0).abs() < 1e-14 && (b.1[0] - 1.0).abs() < 1e-14, "{a:?} {b:?}");
        assert!((b.0[0] - a.0[0] - 0.3).abs() < 1e-8, "{a:?} {b:?}");
    }

    #[test]
    fn a_ball_in_a_room_keeps_its_energy_only_if_nothing_is_lost_at_the_walls() {
        let site = room(2.0);
        let start = [([0.3, -0.2, 0.0], [7.0, 4.0, 0.0])];
        let after = drift(&start, 1.0, &site, 100);
        assert!((energy(&after) - energy(&start)).abs() < 1e-12, "{after:?}");
        // With e, a wall takes the part towards it to e of what it was.
        let wall = Wall { to_m: [2.0, 9.0], ..site.wall[0].clone() };
        let site = Site { wall: vec![wall], ..Site::default() };
        let after = drift(&[([1.0, 0.0, 0.0], [2.0, 1.0, 0.0])], 0.25, &site, 10);
        // The normal is rounded in numbers of the size of the place, over the radius.
        let [vx, vy, _] = after[0].1;
        assert!((vx + 0.5).abs() < 1e-13 && (vy - 1.0).abs() < 1e-13, "{after:?}");
    }

    /// Walls around the origin.
    fn room(half_m: f64) -> Site {
        let corners = [[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];
        let corners = corners.map(|corner| corner.map(|part: f64| half_m * part));
        let wall = |ends: &[[f64; 2]]| Wall {
            from_m: ends[0],
            to_m: ends[1],
            height_m: None,
            material: None,
        };
        Site { wall: corners.windows(2).map(wall).collect(), ..Site::default() }
    }

    #[test]
    fn a_robot_passes_over_what_is_lower_than_it_flies() {
        let mut site = room(2.0);
        for wall in &mut site.wall {
            wall.height_m = Some(3.0);
        }
        for (height_m, x_m) in [(3.0, 5.0), (2.9, 1.85)] {
            let end = drift(&[([0.0, 0.0, height_m], [5.0, 0.0, 0.0])], 0.0, &site, 10);
            assert!((end[0].0[0] - x_m).abs() < 1e-8, "{end:?}");
        }
    }

    proptest! {
        #[test]
        fn nobody_leaves_a_room_and_no_energy_comes_from_nowhere(
            robots in prop::collection::vec(
                (prop::array::uniform2(-1.8f64..1.8), prop::array::uniform2(-20.0f64..20.0)), 1..12),
            restitution in 0.0f64..=1.0,
        ) {
            let start: Vec<_> = robots
                .iter()
                .map(|([x, y], [vx, vy])| ([*x, *y, 0.0], [*vx, *vy, 0.0]))
                .collect();
            let end = drift(&start, restitution, &room(2.0), 20);
            prop_assert!(energy(&end) <= energy(&start) * (1.0 + 1e-12));
            for (at_m, _) in end {
                prop_assert!(at_m[0].abs() < 2.0 && at_m[1].abs() < 2.0, "{:?}", at_m);
            }
        }

        #[test]
        fn robots_in_the_open_keep_their_momentum(
            robots in prop::collection::vec(
                (prop::array::uniform3(-0.6f64..0.6), prop::array::uniform3(-5.0f64..5.0)), 2..10),
            restitution in 0.0f64..=1.0,
        ) {
            let end = drift(&robots, restitution, &Site::default(), 5);
            for (after, before) in momentum(&end).into_iter().zip(momentum(&robots)) {
                // Some hundred roundings of numbers below 50.
                prop_assert!((after - before).abs() < 1e-11, "{} {}", after, before);
            }
        }
    }
}
