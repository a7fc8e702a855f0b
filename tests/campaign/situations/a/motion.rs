//! The motion of set A: bodies in steps of 10 ms, robots that are sent from place to place, and quadrotors that hover.

use crate::campaign::draws::Draws;
use crate::campaign::situations::Case;
use crate::campaign::situations::files::{RobotRow, robots};
use crate::campaign::situations::reference::{Rival, truth};
use crate::campaign::situations::truth::Cause;
use crate::campaign::world::rounded;

pub(super) const STEP_S: f64 = 0.01;
/// Steps from row to row.
const PER_ROW: usize = 10;
/// Rows in a window of a second.
const WINDOW: usize = 10;
pub(super) const GRAVITY_MPS2: f64 = 9.806_65;

/// A body.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Body {
    pub(super) at_m: [f64; 3],
    pub(super) heading_rad: f64,
    /// Its velocity, of those that keep it; its speed first, of those with lag.
    pub(super) velocity_mps: [f64; 3],
}

/// Who moves, when, and by which command.
pub(super) struct Moment {
    pub(super) agent: usize,
    pub(super) time_s: f64,
    pub(super) command: [f64; 4],
}

/// What moves a body during a step. The causes and rivals that act are those with a bit in the mask.
type Law<'a> = dyn Fn(&mut Body, &Moment, u32) + 'a;

/// Bodies, by their commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    PointMass,
    Unicycle,
    Quadrotor,
}

/// Moves a point mass.
pub(super) fn glide(body: &mut Body, velocity_mps: [f64; 3]) {
    for (place, velocity) in body.at_m.iter_mut().zip(velocity_mps) {
        *place += velocity * STEP_S;
    }
}

/// Moves a unicycle: half of the turn, the way, the other half.
pub(super) fn drive(body: &mut Body, speed_mps: f64, yaw_rate_radps: f64) {
    body.heading_rad += 0.5 * yaw_rate_radps * STEP_S;
    body.at_m[0] += speed_mps * STEP_S * body.heading_rad.cos();
    body.at_m[1] += speed_mps * STEP_S * body.heading_rad.sin();
    body.heading_rad += 0.5 * yaw_rate_radps * STEP_S;
}

/// Moves a body that has an acceleration.
pub(super) fn accelerate(body: &mut Body, acceleration_mps2: [f64; 3]) {
    for (axis, acceleration) in acceleration_mps2.into_iter().enumerate() {
        let mean_mps = body.velocity_mps[axis] + 0.5 * STEP_S * acceleration;
        body.at_m[axis] += STEP_S * mean_mps;
        body.velocity_mps[axis] += STEP_S * acceleration;
    }
}

/// Acceleration by a thrust (per mass) and an attitude.
pub(super) fn thrust_mps2([thrust, roll, pitch, yaw]: [f64; 4]) -> [f64; 3] {
    let [(sr, cr), (sp, cp), (sy, cy)] = [roll, pitch, yaw].map(f64::sin_cos);
    [
        thrust * (cy * sp * cr + sy * sr),
        thrust * (sy * sp * cr - cy * sr),
        thrust * cp * cr - GRAVITY_MPS2,
    ]
}

/// A fleet, and how it is commanded and measured.
pub(super) struct Fleet {
    pub(super) draws: Draws,
    pub(super) kind: Kind,
    pub(super) n_robots: usize,
    pub(super) n_rows: usize,
    pub(super) side_m: f64,
    pub(super) speed_mps: f64,
    pub(super) noise_m: f64,
    pub(super) noise_rad: f64,
    /// Correlation of the noise from row to row.
    pub(super) memory: f64,
    pub(super) mass_kg: f64,
    /// Whether all drive to the east at one speed.
    pub(super) is_steady: bool,
    /// Height about which quadrotors are to fly.
    pub(super) hover_m: f64,
    /// Rows between which quadrotors stand on the ground.
    pub(super) landed: std::ops::Range<usize>,
}

impl Fleet {
    pub(super) fn new(seed: u64, kind: Kind) -> Self {
        let mut draws = Draws::new(seed, "fleet of set A");
        let n_robots = 4 + draws.below(4);
        Self {
            kind,
            n_robots,
            n_rows: (4000 + draws.below(5000)) / n_robots,
            side_m: draws.between(15.0, 40.0),
            speed_mps: draws.between(1.0, 2.5),
            noise_m: rounded(draws.between(0.006, 0.02), 4),
            noise_rad: 0.004,
            memory: 0.0,
            mass_kg: rounded(draws.between(0.03, 1.2), 3),
            is_steady: false,
            hover_m: 1.2,
            landed: 0..0,
            draws,
        }
    }

    /// A command for the next seconds, towards a random place.
    fn command(&mut self, body: &Body, row: usize) -> ([f64; 4], usize) {
        let speed = self.speed_mps * self.draws.between(0.2, 1.0);
        let for_rows = 8 + self.draws.below(30);
        if self.is_steady {
            return ([self.speed_mps, 0.0, 0.0, 0.0], self.n_rows);
        }
        let goal = [0, 1].map(|_| self.draws.uniform() * self.side_m);
        let bearing = (goal[1] - body.at_m[1]).atan2(goal[0] - body.at_m[0]);
        match self.kind {
            Kind::PointMass => ([speed * bearing.cos(), speed * bearing.sin(), 0.0, 0.0], for_rows),
            Kind::Unicycle => {
                let off =
                    (bearing - body.heading_rad).sin().atan2((bearing - body.heading_rad).cos());
                let turn = (0.5 * off + 0.15 * self.draws.normal()).clamp(-0.8, 0.8);
                ([speed, turn, 0.0, 0.0], for_rows)
            }
            Kind::Quadrotor => {
                if self.landed.contains(&row) {
                    return ([0.0; 4], 1);
                }
                // A proportional and derivative law towards a place that moves, and what else a pilot does.
                let phase = row as f64 / 60.0;
                let height_m = self.hover_m + 0.4 * (0.9 * phase).sin();
                let goal = [(0.7 * phase).sin(), (0.45 * phase).cos(), height_m];
                let wish = |axis: usize| {
                    1.2 * (goal[axis] - body.at_m[axis]) - 1.6 * body.velocity_mps[axis]
                };
                let [pitch, roll] = [wish(0), -wish(1)].map(|tilt| {
                    (tilt / GRAVITY_MPS2 + 0.05 * self.draws.normal()).clamp(-0.35, 0.35)
                });
                let up = GRAVITY_MPS2 + wish(2).clamp(-4.0, 4.0) + 0.3 * self.draws.normal();
                ([up / (pitch.cos() * roll.cos()) * self.mass_kg, roll, pitch, 0.0], 2)
            }
        }
    }

    /// Moves all robots, and makes the campaign. `causes`: in the order of their bits; `rivals`: in the order of the bits after those.
    /// `heading_error`: what the measured heading has too much.
    pub(super) fn campaign(
        mut self,
        causes: Vec<Cause>,
        rivals: &[&'static str],
        law: &Law<'_>,
        heading_error: impl Fn(f64) -> f64,
    ) -> Case {
        let truth_mask = (1_u32 << causes.len()) - 1;
        let mut bodies: Vec<Body> = (0..self.n_robots)
            .map(|_| {
                let side_m = if self.kind == Kind::Quadrotor { 0.5 } else { self.side_m };
                let mut at_m = [0.0; 3];
                at_m[0] = self.draws.uniform() * side_m;
                at_m[1] = self.draws.uniform() * side_m;
                at_m[2] = if self.kind == Kind::Quadrotor { self.hover_m } else { 0.0 };
                Body { at_m, heading_rad: self.draws.between(-3.0, 3.0), ..Body::default() }
            })
            .collect();
        let mut plans = vec![([0.0; 4], 0); self.n_robots];
        let mut states = Vec::new();
        let mut commands = Vec::new();
        for row in 0..self.n_rows {
            for agent in 0..self.n_robots {
                if plans[agent].1 == 0 {
                    plans[agent] = self.command(&bodies[agent], row);
                }
                plans[agent].1 -= 1;
            }
            let now: Vec<[f64; 4]> = plans.iter().map(|(command, _)| *command).collect();
            states.push(bodies.clone());
            for (agent, body) in bodies.iter_mut().enumerate() {
                advance(law, body, agent, row, now[agent], truth_mask);
            }
            commands.push(now);
        }
        let ends = |mask: u32| -> Vec<f64> {
            let mut ends = Vec::new();
            for start in (0..self.n_rows - WINDOW).step_by(WINDOW) {
                for agent in 0..self.n_robots {
                    let mut body = states[start][agent].clone();
                    for (row, now) in commands.iter().enumerate().skip(start).take(WINDOW) {
                        advance(law, &mut body, agent, row, now[agent], mask);
                    }
                    ends.extend(body.at_m);
                }
            }
            ends
        };
        let less = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<f64>>();
        let whole = ends(truth_mask);
        let n_causes = causes.len();
        let signals = (0..n_causes).map(|bit| less(&whole, &ends(truth_mask & !(1 << bit))));
        let hidden: Vec<_> = causes.into_iter().zip(signals).collect();
        let rivals: Vec<Rival> = rivals
            .iter()
            .enumerate()
            .map(|(index, name)| {
                // In place of the first cause.
                let without = truth_mask & !1;
                let with = ends(without | (1 << (n_causes + index)));
                Rival::new(name, vec![less(&with, &ends(without))])
            })
            .collect();
        // Two positions have an error each; a velocity that is estimated from positions has more.
        let errors = if self.kind == Kind::Quadrotor { 4.0 } else { 2.0_f64.sqrt() };
        let truth = truth(hidden, &[], &rivals, errors * self.noise_m);
        Case { csv: self.csv(&states, &commands, heading_error), config_toml: self.config(), truth }
    }

    fn csv(
        &mut self,
        states: &[Vec<Body>],
        commands: &[Vec<[f64; 4]>],
        heading_error: impl Fn(f64) -> f64,
    ) -> String {
        let (columns, n_values): (&[&str], usize) = match self.kind {
            Kind::PointMass => (&["cmd_vx_mps", "cmd_vy_mps", "cmd_vz_mps"], 3),
            Kind::Unicycle => (&["cmd_speed_mps", "cmd_yaw_rate_radps"], 2),
            Kind::Quadrotor => {
                (&["cmd_thrust_n", "cmd_roll_rad", "cmd_pitch_rad", "cmd_yaw_rad"], 4)
            }
        };
        let mut errors = vec![[0.0; 3]; self.n_robots];
        let mut rows = Vec::new();
        for (row, (bodies, commands)) in states.iter().zip(commands).enumerate() {
            let time_s = row as f64 * PER_ROW as f64 * STEP_S;
            for (agent, body) in bodies.iter().enumerate() {
                let mut at_m = body.at_m;
                let n_axes = if self.kind == Kind::Quadrotor { 3 } else { 2 };
                for axis in 0..n_axes {
                    let fresh =
                        (1.0 - self.memory.powi(2)).sqrt() * self.noise_m * self.draws.normal();
                    errors[agent][axis] = self.memory * errors[agent][axis] + fresh;
                    at_m[axis] += errors[agent][axis];
                }
                let heading_rad = (self.kind == Kind::Unicycle).then(|| {
                    let measured = body.heading_rad
                        + heading_error(time_s)
                        + self.noise_rad * self.draws.normal();
                    measured.sin().atan2(measured.cos())
                });
                let values = commands[agent][..n_values].to_vec();
                rows.push(RobotRow { run: None, time_s, agent, at_m, heading_rad, values });
            }
        }
        robots(&rows, columns)
    }

    fn config(&self) -> String {
        let body = match self.kind {
            Kind::PointMass => "kind = \"point-mass\"".to_owned(),
            Kind::Unicycle => "kind = \"unicycle\"".to_owned(),
            Kind::Quadrotor => {
                format!("kind = \"quadrotor\"\nattitude_lag_s = 0.0\nmass_kg = {:?}", self.mass_kg)
            }
        };
        format!("[robotsim.dynamics]\n{body}\n")
    }
}

/// Moves a body from one row to the next.
fn advance(law: &Law<'_>, body: &mut Body, agent: usize, row: usize, command: [f64; 4], mask: u32) {
    for step in 0..PER_ROW {
        let time_s = (row * PER_ROW + step) as f64 * STEP_S;
        law(body, &Moment { agent, time_s, command }, mask);
    }
}
