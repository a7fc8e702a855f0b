//! The motion of set C: commands that jump between levels, 20 rows a second, and errors of a double exponential distribution.

use crate::campaign::draws::Draws;
use crate::campaign::situations::Case;
use crate::campaign::situations::files::{RobotRow, robots};
use crate::campaign::situations::reference::{Rival, truth};
use crate::campaign::situations::truth::Cause;
use crate::campaign::world::rounded;
use std::f64::consts::PI;

/// A step, of which a row has ten.
pub(super) const H: f64 = 0.005;
const STEPS: usize = 10;
const ROW_S: f64 = 0.05;
/// Rows of a second.
const ROWS: usize = 20;
pub(super) const G: f64 = 9.806_65;
/// Steps that a mover remembers: half a second.
pub(super) const REMEMBERED: usize = 100;

/// What moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Body {
    /// By velocities in the plane.
    Puck,
    /// By speed and yaw rate.
    Rover,
    /// By accelerations.
    Jet,
    /// By thrust and attitude.
    Copter,
}

/// The state of a mover.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Mover {
    pub(super) p: [f64; 3],
    pub(super) heading: f64,
    pub(super) v: [f64; 3],
    /// The latest commands, step by step, the last first.
    pub(super) past: std::collections::VecDeque<[f64; 4]>,
}

impl Mover {
    pub(super) fn slide(&mut self, v: [f64; 3]) {
        self.p.iter_mut().zip(v).for_each(|(p, v)| *p += H * v);
    }

    /// Rolls ahead and aside while it turns.
    pub(super) fn roll(&mut self, ahead: f64, left: f64, turn: f64) {
        let (sin, cos) = (self.heading + 0.5 * H * turn).sin_cos();
        self.p[0] += H * (ahead * cos - left * sin);
        self.p[1] += H * (ahead * sin + left * cos);
        self.heading += H * turn;
    }

    pub(super) fn thrust(&mut self, a: [f64; 3]) {
        for (axis, a) in a.into_iter().enumerate() {
            self.p[axis] += H * (self.v[axis] + 0.5 * H * a);
            self.v[axis] += H * a;
        }
    }

    /// The command of some time ago; at first none.
    pub(super) fn command_before(&self, delay_s: f64) -> [f64; 4] {
        self.past.get((delay_s / H).round() as usize).copied().unwrap_or_default()
    }
}

/// One step of one mover.
pub(super) struct Step {
    pub(super) who: usize,
    pub(super) t: f64,
    pub(super) u: [f64; 4],
    /// Which causes and rivals act.
    pub(super) on: u32,
}

impl Step {
    pub(super) const fn on(&self, bit: u32) -> bool {
        self.on & (1 << bit) != 0
    }
}

/// A trial of movers.
pub(super) struct Trial {
    pub(super) draws: Draws,
    pub(super) body: Body,
    pub(super) n: usize,
    pub(super) n_rows: usize,
    pub(super) hall_m: f64,
    pub(super) fast: f64,
    pub(super) error_m: f64,
    pub(super) error_rad: f64,
    pub(super) mass_kg: f64,
    /// Of pucks: one direction and one speed for all, always.
    pub(super) one_way: Option<f64>,
}

impl Trial {
    pub(super) fn new(seed: u64, body: Body) -> Self {
        let mut draws = Draws::new(seed, "trial of set C");
        let n = if matches!(body, Body::Jet | Body::Copter) { 2 } else { 3 + draws.below(3) };
        Self {
            body,
            n,
            n_rows: (9000 + draws.below(4000)) / n,
            hall_m: draws.between(12.0, 30.0),
            fast: draws.between(1.0, 3.0),
            error_m: draws.between(0.002, 0.008),
            error_rad: draws.between(0.002, 0.006),
            mass_kg: rounded(draws.between(0.5, 3.0), 2),
            one_way: None,
            draws,
        }
    }

    /// Seconds of a run.
    pub(super) fn lasts_s(&self) -> f64 {
        ROW_S * self.n_rows as f64
    }

    /// The next level of a command, and for how many rows.
    fn level(&mut self, mover: &Mover) -> ([f64; 4], usize) {
        let rows = 10 + self.draws.below(50);
        let far = mover.p[0].hypot(mover.p[1]) / (0.5 * self.hall_m);
        let home = (-mover.p[1]).atan2(-mover.p[0]);
        let speed = self.fast * [0.15, 0.35, 0.6, 0.8, 1.0][self.draws.below(5)];
        match self.body {
            Body::Puck => {
                if let Some(way) = self.one_way {
                    return ([self.fast * way.cos(), self.fast * way.sin(), 0.0, 0.0], rows);
                }
                let free = self.draws.between(-PI, PI);
                let way = if 1.0 < far { home + 0.5 * self.draws.normal() } else { free };
                let speed = if self.draws.chance(0.1) { 0.0 } else { speed };
                ([speed * way.cos(), speed * way.sin(), 0.0, 0.0], rows)
            }
            Body::Rover => {
                let off = home - mover.heading;
                let turn = if 1.0 < far {
                    off.sin().atan2(off.cos()).clamp(-1.2, 1.2)
                } else {
                    [-1.0, -0.5, 0.0, 0.0, 0.5, 1.0][self.draws.below(6)]
                };
                ([speed, turn, 0.0, 0.0], rows.min(30))
            }
            Body::Jet | Body::Copter => {
                let wish = [0, 1, 2].map(|axis| {
                    let goal = if axis == 2 { 2.0 } else { 0.0 };
                    let pull = 0.5 * (goal - mover.p[axis]) - 0.9 * mover.v[axis];
                    (pull + 0.9 * self.draws.normal()).clamp(-2.5, 2.5)
                });
                if self.body == Body::Jet {
                    return ([wish[0], wish[1], wish[2], 0.0], 6);
                }
                let size = (wish[0].powi(2) + wish[1].powi(2) + (wish[2] + G).powi(2)).sqrt();
                let [pitch, roll] = [wish[0].atan2(wish[2] + G), (-wish[1] / size).asin()];
                ([self.mass_kg * size, roll, pitch, 0.0], 6)
            }
        }
    }

    /// Runs, measures and asks the reference.
    pub(super) fn run(
        mut self,
        causes: Vec<Cause>,
        rivals: &[&'static str],
        law: &dyn Fn(&mut Mover, &Step),
    ) -> Case {
        let n_causes = causes.len() as u32;
        let truly = (1 << n_causes) - 1;
        let mut movers: Vec<Mover> = (0..self.n)
            .map(|_| Mover {
                p: [
                    0.2 * self.hall_m * self.draws.normal(),
                    0.2 * self.hall_m * self.draws.normal(),
                    if matches!(self.body, Body::Jet | Body::Copter) { 2.0 } else { 0.0 },
                ],
                heading: self.draws.between(-PI, PI),
                ..Mover::default()
            })
            .collect();
        let mut levels = vec![([0.0; 4], 0); self.n];
        let mut film: Vec<Vec<(Mover, [f64; 4])>> = Vec::new();
        for row in 0..self.n_rows {
            for (level, mover) in levels.iter_mut().zip(&movers) {
                if level.1 == 0 {
                    let (command, rows) = self.level(mover);
                    *level = (command.map(|value| rounded(value, 5)), rows);
                }
                level.1 -= 1;
            }
            film.push(movers.iter().cloned().zip(levels.iter().map(|level| level.0)).collect());
            for (who, mover) in movers.iter_mut().enumerate() {
                through_row(law, mover, who, row, levels[who].0, truly);
            }
        }
        let after_a_second = |on: u32| -> Vec<f64> {
            let mut ends = Vec::new();
            for start in (0..self.n_rows - ROWS).step_by(ROWS) {
                for who in 0..self.n {
                    let mut mover = film[start][who].0.clone();
                    for (row, frame) in film.iter().enumerate().skip(start).take(ROWS) {
                        through_row(law, &mut mover, who, row, frame[who].1, on);
                    }
                    ends.extend(mover.p);
                }
            }
            ends
        };
        let true_ends = after_a_second(truly);
        let minus = |ends: Vec<f64>| -> Vec<f64> {
            true_ends.iter().zip(ends).map(|(truth, other)| truth - other).collect()
        };
        let hidden = causes
            .into_iter()
            .zip(0..)
            .map(|(cause, bit)| (cause, minus(after_a_second(truly & !(1 << bit)))))
            .collect();
        // In place of the first cause.
        let without = truly & !1;
        let rivals: Vec<Rival> = rivals
            .iter()
            .zip(n_causes..)
            .map(|(name, bit)| {
                let [with, none] = [without | 1 << bit, without].map(after_a_second);
                Rival::new(name, vec![with.iter().zip(&none).map(|(a, b)| a - b).collect()])
            })
            .collect();
        let has_velocity = matches!(self.body, Body::Jet | Body::Copter);
        let errors = if has_velocity { 5.0 } else { 1.42 };
        let truth = truth(hidden, &[], &rivals, errors * self.error_m);
        let (columns, kind): (&[&str], String) = match self.body {
            Body::Puck => (&["cmd_vx_mps", "cmd_vy_mps"], "\"point-mass\"".to_owned()),
            Body::Rover => (&["cmd_speed_mps", "cmd_yaw_rate_radps"], "\"unicycle\"".to_owned()),
            Body::Jet => {
                (&["cmd_ax_mps2", "cmd_ay_mps2", "cmd_az_mps2"], "\"double-integrator\"".to_owned())
            }
            Body::Copter => (
                &["cmd_thrust_n", "cmd_roll_rad", "cmd_pitch_rad", "cmd_yaw_rad"],
                format!("\"quadrotor\"\nattitude_lag_s = 0.0\nmass_kg = {:?}", self.mass_kg),
            ),
        };
        let mut double_exponential = |sd: f64| {
            let share = self.draws.between(-1.0, 1.0);
            -share.signum() * sd / 2.0_f64.sqrt() * (1.0 - share.abs()).max(1e-9).ln()
        };
        let mut rows = Vec::new();
        for (row, frame) in film.iter().enumerate() {
            for (agent, (mover, command)) in frame.iter().enumerate() {
                let mut at_m = mover.p;
                for place in at_m.iter_mut().take(if has_velocity { 3 } else { 2 }) {
                    *place += double_exponential(self.error_m);
                }
                let heading = mover.heading + double_exponential(self.error_rad);
                rows.push(RobotRow {
                    run: None,
                    time_s: row as f64 * ROW_S,
                    agent,
                    at_m,
                    heading_rad: (self.body == Body::Rover)
                        .then(|| heading.sin().atan2(heading.cos())),
                    values: command[..columns.len()].to_vec(),
                });
            }
        }
        Case {
            csv: robots(&rows, columns),
            config_toml: format!("[robotsim.dynamics]\nkind = {kind}\n"),
            truth,
        }
    }
}

fn through_row(
    law: &dyn Fn(&mut Mover, &Step),
    mover: &mut Mover,
    who: usize,
    row: usize,
    u: [f64; 4],
    on: u32,
) {
    for step in 0..STEPS {
        mover.past.push_front(u);
        mover.past.truncate(REMEMBERED);
        law(mover, &Step { who, t: (row * STEPS + step) as f64 * H, u, on });
    }
}
