//! Boids: robots that flock without a leader.

use super::{Controller, Demands, Entry, Goal, View, add, norm, scaled, sub};
use crate::dynamics::Command;
use proto::config::{Kind, Range, Section, variant};
use proto::ids::AgentId;

const WEIGHT: Kind = Kind::Number(Range::closed(0.0, 1e3));
const RADIUS: Kind = Kind::Number(Range::above(0.0, 1e6));

pub(super) const ENTRY: Entry = Entry {
    variant: variant::<Boids>("boids"),
    demands: Demands::NONE,
    goal: Goal::Align,
    build: |table, context, problems| {
        let this = Boids::read(table);
        super::check_speed("speed_mps", this.speed_mps, context, problems);
        Some(Box::new(this))
    },
};

/// Reynolds' boids: separation, alignment and cohesion.
///
/// Boids.
///
/// # Model
///
/// Reynolds, "Flocks, herds, and schools: a distributed behavioral model", SIGGRAPH 1987: three urges, in order of
/// precedence there, as weighted accelerations here. Over the robots j within `radius_m` that it knows of, N of them at
/// distances d_j, those within `separation_m` in the first sum:
///
/// ```text
///     a_i  =  w_s Σ (x_i − x_j) / d_j²  +  w_a (mean v_j − v_i)  +  w_c (mean x_j − x_i)
/// ```
///
/// at most the cap. The command is v_i + a_i Δt, brought to `speed_mps`: boids never stand. A robot at rest sets out in a
/// direction of its own, drawn once.
///
/// # Validity
///
/// In the plane. No obstacles, no field of view.
#[derive(Debug, Section)]
struct Boids {
    /// Speed of all robots (m/s).
    #[key(kind = RADIUS, default = 2.0)]
    speed_mps: f64,
    /// Interaction range: robots farther away are ignored (m).
    #[key(kind = RADIUS, default = 10.0)]
    radius_m: f64,
    /// Separation range: robots move away from others nearer than this (m).
    #[key(kind = RADIUS, default = 1.5)]
    separation_m: f64,
    /// Weight of separation (m²/s²).
    #[key(kind = WEIGHT, default = 2.0)]
    separation: f64,
    /// Weight of alignment (1/s).
    #[key(kind = WEIGHT, default = 1.0)]
    alignment: f64,
    /// Weight of cohesion (1/s²).
    #[key(kind = WEIGHT, default = 0.5)]
    cohesion: f64,
    /// Maximum acceleration (m/s²).
    #[key(kind = RADIUS, default = 10.0)]
    acceleration_cap_mps2: f64,
}

impl Controller for Boids {
    fn command(&self, view: &View<'_>, agent: AgentId) -> Command {
        let own_m = view.position_m(agent);
        let own_mps = view.velocity_mps(agent);
        let (mut away, mut velocities, mut places) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        let mut n = 0.0;
        view.knowledge.for_each_known_to(agent, |seen| {
            let from = sub(own_m, seen.motion.position_m);
            let distance_m = norm(from);
            if self.radius_m < distance_m {
                return;
            }
            n += 1.0;
            velocities = add(velocities, seen.motion.velocity_mps);
            places = sub(places, from);
            if 0.0 < distance_m && distance_m < self.separation_m {
                away = add(away, scaled(from, 1.0 / (distance_m * distance_m)));
            }
        });
        let mut acceleration = scaled(away, self.separation);
        if 0.0 < n {
            let align = sub(scaled(velocities, 1.0 / n), own_mps);
            acceleration = add(acceleration, scaled(align, self.alignment));
            acceleration = add(acceleration, scaled(places, self.cohesion / n));
        }
        let size = norm(acceleration);
        if self.acceleration_cap_mps2 < size {
            acceleration = scaled(acceleration, self.acceleration_cap_mps2 / size);
        }
        let start = if norm(own_mps) < 1e-9 {
            let angle = std::f64::consts::TAU * view.draws.uniform(u64::from(agent.0), 0, 0);
            [self.speed_mps * libm::cos(angle), self.speed_mps * libm::sin(angle), 0.0]
        } else {
            own_mps
        };
        let wanted = add(start, scaled(acceleration, view.dt_s));
        let speed_mps = norm(wanted);
        let wanted = if speed_mps < 1e-9 { start } else { wanted };
        Command::Velocity(scaled(wanted, self.speed_mps / norm(wanted)))
    }
}
