//! Robots that follow a leader, held together and apart by a potential.

use super::{Controller, Demands, Entry, Goal, View};
use crate::dynamics::Command;
use crate::knowledge::Seen;
use proto::config::{Choice, Kind, Range, Section, variant};
use proto::ids::AgentId;

const RADIUS: Kind = Kind::Number(Range::closed(1e-3, 1e6));
const SPEED: Kind = Kind::Number(Range::closed(-1e4, 1e4));
const POINT: Kind = Kind::List { of: &Kind::Number(Range::closed(-1e6, 1e6)), min: 2, max: 2 };

pub(super) const ENTRY: Entry = Entry {
    variant: variant::<Flocking>("flocking"),
    demands: Demands::NONE,
    goal: Goal::FollowLeader,
    build: |table, context, problems| {
        let default = context.n_agents as f64 / 10.0;
        table.entry("leader_weight").or_insert(default.max(1.0).into());
        table.entry("leader_velocity_mps").or_insert(vec![7.0, 0.0].into());
        let this = Flocking::read(table);
        if context.n_agents <= this.leader.index() {
            let last = context.n_agents - 1;
            problems.push(
                context
                    .problem("leader", format!("must be one of the agents, 0 to {last}"))
                    .value(this.leader)
                    .nearest(last),
            );
        }
        let [vx, vy] = this.leader_velocity_mps;
        super::check_speed("leader_velocity_mps", libm::hypot(vx, vy), context, problems);
        if this.leader_weight_on == WeightOn::Velocity && !this.velocity_term {
            problems.push(
                context
                    .problem("leader_weight_on", "requires velocity_term = true")
                    .value("\"velocity\"")
                    .nearest("\"gradient\""),
            );
        }
        Some(Box::new(this))
    },
};

/// Flocking: one robot leads with a constant velocity, and the others follow by the gradient of a potential.
///
/// Follow-the-leader flocking.
///
/// # Model
///
/// BotNet paper (Selden et al., arXiv 2108.13606), § Flocking. The leader has u = v*. A follower i, over those j it
/// knows of at distance d:
///
/// ```text
///                                 K_conn            K_col
///     u_i  =  −  Σ  2 w_j (x_i − x_j) ( ────── e^{d²/r_f²} − ────── e^{−d²/r_c²} )
///                j                 r_f²              r_c²
/// ```
///
/// with r_f the flock radius, r_c the collision radius, K_conn = r_f, K_col = r_c² + r_f (values as printed, without
/// units). That is the gradient of the printed potential; its inner sum is a misprint. w_j is `leader_weight` for the
/// leader, else 1. `law = "botnet"` has d in place of d² in both exponents (but not in the gradient's factors), as the
/// published code has; it then is the gradient of nothing. `law = "zavlanos"` is the potential that the paper begins with,
/// after Zavlanos, Jadbabaie and Pappas, "Flocking while preserving network connectivity", CDC 2007, without its gains:
///
/// ```text
///     V = 1/d² + 1/(r_f² − d²)          u_i = − Σ 2 w_j (x_i − x_j) ( 1/(r_f² − d²)² − 1/d⁴ )
/// ```
///
/// in which `collision_radius_m` has no part. A pair farther apart than r_f is past the singularity: the pull that should
/// have kept it together falls with distance. `velocity_term` adds −Σ (v_i − v_j) of the paper's first
/// equation, in which the published code takes v* for v_i.
///
/// `leaderless` makes all of them followers. With `input = "acceleration"` a follower is asked to accelerate like that: a body that does not keep its velocity comes to v_i + u_i Δt, v_i being its
/// velocity over the step before: a double integrator, by the semi-implicit Euler method.
///
/// # Validity
///
/// A follower that knows of nobody stops, or with `input = "acceleration"` goes straight on. The exponent is limited to 200: further out the speed cap decides anyway.
#[derive(Debug, Section)]
struct Flocking {
    /// The potential.
    #[key(default = Law::Paper)]
    law: Law,
    /// r_flock: maximum desired distance between robots (m).
    #[key(kind = RADIUS)]
    flock_radius_m: f64,
    /// r_collision (m). Default: the BotNet paper's.
    #[key(kind = RADIUS, default = 0.8)]
    collision_radius_m: f64,
    /// The agent that leads.
    #[key(default = 0)]
    leader: AgentId,
    /// No robot leads; all follow the law. leader_velocity_mps and leader_weight are unused.
    #[key(default = false)]
    leaderless: bool,
    /// Quantity that the control law commands.
    #[key(default = Input::Velocity)]
    input: Input,
    /// The leader's velocity (x, y in m/s). Default: \[7, 0\], the BotNet paper's experiments.
    #[key(kind = Kind::List { of: &SPEED, min: 2, max: 2 }, absent)]
    leader_velocity_mps: [f64; 2],
    /// Waypoints (x, y in m) of the leader, at the speed of leader_velocity_mps. Absent: it moves straight on.
    #[key(kind = Kind::List { of: &POINT, min: 2, max: 10_000 })]
    leader_path_m: Option<Vec<[f64; 2]>>,
    /// Whether the leader returns from the last waypoint to the first, in a loop.
    #[key(default = false)]
    leader_path_closed: bool,
    /// Weight of the leader among the neighbours of a follower. Default: a tenth of the number of agents, at least 1.
    #[key(above = 0.0, most = 1e6, absent)]
    leader_weight: f64,
    /// Which term of the leader is weighted.
    #[key(default = WeightOn::Gradient)]
    leader_weight_on: WeightOn,
    /// Whether followers also align velocities, by the first sum of the BotNet paper's general law.
    #[key(default = false)]
    velocity_term: bool,
}

#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
enum Law {
    /// As the BotNet paper prints it: exponents in d².
    Paper,
    /// As BotNet's code has it: exponents in d.
    Botnet,
    /// The original, 1/d² + 1/(r_flock² − d²), which is singular at r_flock.
    Zavlanos,
}

#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
enum Input {
    /// The velocity, as in the BotNet paper.
    Velocity,
    /// The acceleration of followers: double integrators, as in the original.
    Acceleration,
}

#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
enum WeightOn {
    /// The gradient of its potential.
    Gradient,
    /// The velocity difference; requires velocity_term = true.
    Velocity,
}

impl Flocking {
    /// What the separation from another robot at `distance_m` is multiplied by (1/s): positive pulls together.
    fn pull(&self, distance_m: f64) -> f64 {
        let (r_flock, r_collision) = (self.flock_radius_m, self.collision_radius_m);
        let (flock_2, collision_2) = (r_flock * r_flock, r_collision * r_collision);
        let power = match self.law {
            Law::Botnet => distance_m,
            Law::Paper => distance_m * distance_m,
            Law::Zavlanos => {
                // Infinite at its two singularities; the speed cap decides there.
                let square = distance_m * distance_m;
                let left = flock_2 - square;
                let [near, far] = [square * square, left * left].map(|d| d.max(1e-12));
                return 2.0 / far - 2.0 / near;
            }
        };
        let connect = r_flock / flock_2 * libm::exp((power / flock_2).min(200.0));
        let collide = (collision_2 + r_flock) / collision_2 * libm::exp(-power / collision_2);
        2.0 * (connect - collide)
    }

    /// The leader's velocity (m/s) where it has a path: to where it should be at the end of the period.
    fn leading(&self, view: &View<'_>) -> Option<[f64; 3]> {
        let points = self.leader_path_m.as_ref()?;
        let [vx, vy] = self.leader_velocity_mps;
        let length_m = libm::hypot(vx, vy) * (view.time_s + view.dt_s);
        let [x_m, y_m] = crate::path::point_at(points, self.leader_path_closed, length_m);
        let own_m = view.position_m(self.leader);
        Some([(x_m - own_m[0]) / view.dt_s, (y_m - own_m[1]) / view.dt_s, 0.0])
    }

    /// A follower's velocity (m/s) on account of one other robot.
    fn term(&self, own_m: [f64; 3], own_mps: [f64; 3], seen: &Seen) -> [f64; 3] {
        let weight = |on| {
            let is_leader = seen.agent == self.leader && !self.leaderless;
            let weighted = is_leader && self.leader_weight_on == on;
            if weighted { self.leader_weight } else { 1.0 }
        };
        let away: [f64; 3] = std::array::from_fn(|i| own_m[i] - seen.motion.position_m[i]);
        let distance_m = libm::sqrt(away[0] * away[0] + away[1] * away[1] + away[2] * away[2]);
        let pull = weight(WeightOn::Gradient) * self.pull(distance_m);
        let align = if self.velocity_term { weight(WeightOn::Velocity) } else { 0.0 };
        std::array::from_fn(|i| {
            -pull * away[i] - align * (own_mps[i] - seen.motion.velocity_mps[i])
        })
    }
}

impl Controller for Flocking {
    fn command(&self, view: &View<'_>, agent: AgentId) -> Command {
        let [vx, vy] = self.leader_velocity_mps;
        let leading = [vx, vy, 0.0];
        if agent == self.leader && !self.leaderless {
            return Command::Velocity(self.leading(view).unwrap_or(leading));
        }
        let own_m = view.position_m(agent);
        let own_mps = match self.law {
            Law::Botnet => leading,
            Law::Paper | Law::Zavlanos => view.velocity_mps(agent),
        };
        let mut velocity = [0.0; 3];
        view.knowledge.for_each_known_to(agent, |seen| {
            let term = self.term(own_m, own_mps, seen);
            for (sum, component) in velocity.iter_mut().zip(term) {
                *sum += component;
            }
        });
        match self.input {
            Input::Velocity => Command::Velocity(velocity),
            Input::Acceleration => Command::Acceleration(velocity),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::payload::Motion;
    use proto::time::SimTime;

    fn flocking(law: Law, flock_radius_m: f64) -> Flocking {
        Flocking {
            law,
            flock_radius_m,
            collision_radius_m: 0.8,
            leader: AgentId(0),
            leaderless: false,
            input: Input::Velocity,
            leader_velocity_mps: [7.0, 0.0],
            leader_weight: 1.0,
            leader_weight_on: WeightOn::Gradient,
            velocity_term: false,
            leader_path_m: None,
            leader_path_closed: false,
        }
    }

    /// A leader (agent 0) at the origin.
    fn leader(velocity_mps: [f64; 3]) -> Seen {
        let motion = Motion { position_m: [0.0; 3], velocity_mps };
        Seen { agent: AgentId(0), sent: SimTime::START, motion, rssi_dbm: None }
    }

    #[test]
    fn a_follower_two_metres_behind_is_pulled_by_the_printed_law_and_pushed_by_the_code() {
        // r_flock 10 m, 10 agents. Tolerances: half a unit of the last digit of the hand-calculated values.
        for (law, speed_mps, tolerance) in
            [(Law::Paper, 0.28795, 5e-6), (Law::Botnet, -2.5137, 5e-5)]
        {
            let [vx, vy, vz] =
                flocking(law, 10.0).term([-2.0, 0.0, 0.0], [0.0; 3], &leader([0.0; 3]));
            assert!((vx - speed_mps).abs() < tolerance, "{law:?}: {vx}");
            assert_eq!((vy, vz), (0.0, 0.0));
        }
    }

    #[test]
    fn two_robots_rest_where_the_gradient_vanishes() {
        for (law, rest_m) in
            [(Law::Paper, [1.537, 1.803, 2.429]), (Law::Botnet, [2.362, 3.252, 5.899])]
        {
            for (radius_m, rest_m) in [5.0, 10.0, 80.0].into_iter().zip(rest_m) {
                let flocking = flocking(law, radius_m);
                let (mut near, mut far) = (0.1, 20.0);
                while 1e-9 < far - near {
                    let middle = 0.5 * (near + far);
                    *(if flocking.pull(middle) < 0.0 { &mut near } else { &mut far }) = middle;
                }
                // Half a unit of the last digit given.
                assert!((near - rest_m).abs() < 5e-4, "{law:?} at {radius_m} m: {near}");
            }
        }
    }

    #[test]
    fn the_original_potential_pulls_without_bound_at_the_radius_and_less_and_less_beyond() {
        let pull = |distance_m| flocking(Law::Zavlanos, 10.0).pull(distance_m);
        // d⁴ = (r² − d²)² at r/√2; there push and pull are equal.
        assert!(pull(10.0 / 2f64.sqrt()).abs() < 1e-12);
        assert!(pull(1.0) < -1.9 && 1e3 < pull(9.999));
        assert!(0.0 < pull(30.0) && pull(30.0) < 0.001 * pull(10.1));
        // Against the difference quotient of the printed potential: V' = pull times distance.
        let potential = |d: f64| 1.0 / (d * d) + 1.0 / (100.0 - d * d);
        let slope = (potential(8.0 + 1e-5) - potential(8.0 - 1e-5)) / 2e-5;
        assert!((pull(8.0) * 8.0 - slope).abs() < 1e-8 * slope.abs().max(1.0));
    }

    #[test]
    fn the_weight_acts_on_the_term_it_is_said_to_act_on() {
        let plain = flocking(Law::Paper, 10.0);
        let weighted = Flocking { leader_weight: 5.0, ..flocking(Law::Paper, 10.0) };
        let moving = leader([3.0, 0.0, 0.0]);
        let [one, ..] = plain.term([-2.0, 0.0, 0.0], [1.0, 0.0, 0.0], &moving);
        let [five, ..] = weighted.term([-2.0, 0.0, 0.0], [1.0, 0.0, 0.0], &moving);
        assert_eq!(five, 5.0 * one);
        let aligned =
            Flocking { velocity_term: true, leader_weight_on: WeightOn::Velocity, ..weighted };
        let [vx, ..] = aligned.term([-2.0, 0.0, 0.0], [1.0, 0.0, 0.0], &moving);
        assert_eq!(vx, one + 5.0 * 2.0);
    }

    #[test]
    fn however_far_the_others_are_the_command_is_a_number() {
        for law in [Law::Paper, Law::Botnet] {
            let [vx, ..] = flocking(law, 1e-3).term([-1e7, 0.0, 0.0], [0.0; 3], &leader([0.0; 3]));
            assert!(vx.is_finite() && 0.0 < vx, "{law:?}: {vx}");
        }
    }
}
