//! Robots that wander: the mobility model of networks that move.

use super::{Controller, Demands, Entry, Goal, View, scaled, sub};
use crate::dynamics::Command;
use proto::config::{Kind, Range, Section, variant};
use proto::ids::AgentId;
use proto::rng::{Draws, uniform};

const POSITIVE: Kind = Kind::Number(Range::above(0.0, 1e6));

pub(super) const ENTRY: Entry = Entry {
    variant: variant::<RandomWaypoint>("random-waypoint"),
    demands: Demands::NONE,
    goal: Goal::Carry,
    build: |table, context, problems| {
        let this = RandomWaypoint::read(table);
        super::check_speed("fastest_mps", this.fastest_mps, context, problems);
        if this.fastest_mps < this.slowest_mps {
            problems.push(
                context
                    .problem(
                        "fastest_mps",
                        format!("must be at least slowest_mps = {} m/s", this.slowest_mps),
                    )
                    .value(format!("{} m/s", this.fastest_mps))
                    .nearest(this.slowest_mps),
            );
        }
        Some(Box::new(this))
    },
};

/// Random waypoint: every robot drives straight to random places, one after another, each time at a random speed.
///
/// The random waypoint model.
///
/// # Model
///
/// Broch, Maltz, Johnson, Hu and Jetcheva, "A performance comparison of multi-hop wireless ad hoc network routing protocols",
/// MobiCom 1998, § 3.2. Places are uniform in the square, speeds uniform between the two, which must not begin at 0 (Yoon,
/// Liu and Noble, "Random waypoint considered harmful", INFOCOM 2003). The way of each robot is drawn once and for all: a
/// point goes along it, beginning in the first place, and the robot goes where the point will be. Until it has caught up
/// the robot moves as fast as its body allows.
///
/// # Validity
///
/// In the plane. As ever with this model, robots are denser in the middle than at the edge.
#[derive(Debug, Section)]
struct RandomWaypoint {
    /// Side of the square around the origin that contains the waypoints (m).
    #[key(kind = POSITIVE)]
    side_m: f64,
    /// Minimum speed (m/s); must be above 0, or the mean speed would decay to 0 over time.
    #[key(kind = POSITIVE, default = 0.5)]
    slowest_mps: f64,
    /// Maximum speed (m/s).
    #[key(kind = POSITIVE, default = 2.0)]
    fastest_mps: f64,
    /// Pause at each waypoint (s).
    #[key(range = 0.0..=1e6, default = 0.0)]
    pause_s: f64,
}

impl RandomWaypoint {
    /// Place `k` of an agent (m), and the speed from there to the next (m/s).
    fn leg(&self, draws: Draws, agent: AgentId, k: u64) -> ([f64; 3], f64) {
        let [a, b, c, _] = draws.words(u64::from(agent.0), k, 0);
        let [x_m, y_m] = [a, b].map(|word| self.side_m * (uniform(word) - 0.5));
        let speed_mps = self.slowest_mps + uniform(c) * (self.fastest_mps - self.slowest_mps);
        ([x_m, y_m, 0.0], speed_mps)
    }

    /// Where the point of an agent is at a time (m).
    fn position_at(&self, draws: Draws, agent: AgentId, time_s: f64) -> [f64; 3] {
        let mut left_s = time_s;
        let (mut from_m, mut speed_mps) = self.leg(draws, agent, 0);
        for k in 1.. {
            let (to_m, next_mps) = self.leg(draws, agent, k);
            let way = sub(to_m, from_m);
            let duration_s = super::norm(way) / speed_mps;
            if left_s < duration_s {
                return super::add(from_m, scaled(way, left_s / duration_s));
            }
            left_s -= duration_s;
            if left_s < self.pause_s {
                return to_m;
            }
            left_s -= self.pause_s;
            (from_m, speed_mps) = (to_m, next_mps);
        }
        from_m
    }
}

impl Controller for RandomWaypoint {
    fn scatter_mps(&self) -> Option<f64> {
        Some(self.fastest_mps)
    }

    fn command(&self, view: &View<'_>, agent: AgentId) -> Command {
        let own_m = view.position_m(agent);
        let mut goal_m = self.position_at(view.draws, agent, view.time_s + view.dt_s);
        goal_m[2] = own_m[2];
        Command::Velocity(scaled(sub(goal_m, own_m), 1.0 / view.dt_s))
    }
}
