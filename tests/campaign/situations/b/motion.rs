//! The motion of set B: joysticks whose commands never rest, at 5 rows a second, and positions on a grid of millimetres.

use crate::campaign::draws::Draws;
use crate::campaign::situations::Case;
use crate::campaign::situations::files::{RobotRow, robots};
use crate::campaign::situations::reference::{Rival, truth};
use crate::campaign::situations::truth::Cause;
use crate::campaign::world::rounded;
use std::f64::consts::TAU;

pub(super) const TICK_S: f64 = 0.02;
const TICKS: usize = 10;
const ROW_S: f64 = 0.2;
/// Rows in a second.
const SECOND: usize = 5;
pub(super) const WEIGHT_MPS2: f64 = 9.806_65;
const WHEELBASE_M: f64 = 0.33;

/// What is commanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum By {
    /// Velocity.
    Velocity,
    /// Speed and steering of a car.
    Steering,
    /// Acceleration.
    Acceleration,
    /// Thrust and attitude.
    Thrust,
}

/// What a robot is and remembers.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Robot {
    pub(super) place: [f64; 3],
    pub(super) heading: f64,
    pub(super) velocity: [f64; 3],
    /// Whatever else a law remembers.
    pub(super) memory: f64,
}

/// When a law acts on whom.
pub(super) struct Now<'a> {
    pub(super) robot: usize,
    pub(super) run: usize,
    pub(super) time_s: f64,
    pub(super) command: [f64; 4],
    /// Places of all robots at the last row.
    pub(super) all: &'a [[f64; 3]],
    /// Bits of the causes, then of the rivals, that act.
    pub(super) acting: u32,
}

impl Now<'_> {
    pub(super) const fn is(&self, bit: u32) -> bool {
        self.acting >> bit & 1 == 1
    }

    /// The planar command as a velocity, or an acceleration.
    pub(super) const fn vector(&self) -> [f64; 3] {
        [self.command[0], self.command[1], self.command[2]]
    }
}

impl Robot {
    pub(super) fn go(&mut self, velocity: [f64; 3]) {
        self.place.iter_mut().zip(velocity).for_each(|(place, speed)| *place += TICK_S * speed);
    }

    /// Drives a car along an arc.
    pub(super) fn steer(&mut self, speed: f64, angle: f64) {
        let turn = TICK_S * speed * angle.tan() / WHEELBASE_M;
        let along = self.heading + 0.5 * turn;
        self.place[0] += TICK_S * speed * along.cos();
        self.place[1] += TICK_S * speed * along.sin();
        self.heading += turn;
    }

    pub(super) fn push(&mut self, acceleration: [f64; 3]) {
        for (axis, more) in acceleration.into_iter().enumerate() {
            self.place[axis] += TICK_S * (self.velocity[axis] + 0.5 * TICK_S * more);
            self.velocity[axis] += TICK_S * more;
        }
    }
}

/// A test drive.
pub(super) struct Test {
    pub(super) draws: Draws,
    pub(super) by: By,
    pub(super) n_robots: usize,
    pub(super) n_runs: usize,
    /// Rows of a run.
    pub(super) n_rows: usize,
    pub(super) room_m: f64,
    pub(super) speed: f64,
    pub(super) height_m: f64,
    pub(super) mass_kg: f64,
    pub(super) error_m: f64,
    /// Rows by which places are measured late, and share of gross errors.
    pub(super) late: usize,
    pub(super) jumps: f64,
}

impl Test {
    pub(super) fn new(seed: u64, by: By) -> Self {
        let mut draws = Draws::new(seed, "test of set B");
        let is_flying = matches!(by, By::Acceleration | By::Thrust);
        let n_robots = if is_flying { 1 + draws.below(3) } else { 3 + draws.below(4) };
        Self {
            by,
            n_robots,
            n_runs: 1,
            n_rows: (3500 + draws.below(2500)) / n_robots,
            room_m: draws.between(8.0, 24.0),
            speed: draws.between(0.6, 1.8),
            height_m: draws.between(1.0, 1.8),
            mass_kg: rounded(draws.between(0.25, 2.5), 2),
            error_m: draws.between(0.004, 0.015),
            late: 0,
            jumps: 0.0,
            draws,
        }
    }

    /// A joystick: waves, and a pull to the middle of the room.
    fn joystick(&self, waves: &[[f64; 3]; 4], robot: &Robot, time_s: f64) -> [f64; 4] {
        let wave = |index: usize| {
            let [rate, phase, size] = waves[index];
            size * ((TAU * rate * time_s + phase).sin() + 0.6 * (TAU * 2.7 * rate * time_s).cos())
        };
        let out = [0, 1].map(|axis| (robot.place[axis] - 0.5 * self.room_m) / (0.5 * self.room_m));
        match self.by {
            By::Velocity => [
                self.speed * (wave(0) - 0.7 * out[0].powi(3)),
                self.speed * (wave(1) - 0.7 * out[1].powi(3)),
                0.0,
                0.0,
            ],
            By::Steering => {
                let home = (-out[1]).atan2(-out[0]) - robot.heading;
                let pull = home.sin().atan2(home.cos()) * out[0].hypot(out[1]).min(1.5);
                let speed = self.speed * (0.55 + 0.25 * wave(0));
                [speed.max(0.1), (0.12 * pull + 0.15 * wave(1)).clamp(-0.4, 0.4), 0.0, 0.0]
            }
            By::Acceleration | By::Thrust => {
                let goal = [
                    0.5 * self.room_m + 1.5 * wave(0),
                    0.5 * self.room_m + 1.5 * wave(1),
                    self.height_m * (1.0 + 0.35 * (TAU * waves[2][0] * time_s).sin()),
                ];
                let wish = [0, 1, 2].map(|axis| {
                    let pull = 0.9 * (goal[axis] - robot.place[axis]) - 1.3 * robot.velocity[axis];
                    (pull + 0.4 * wave((axis + 1) % 4)).clamp(-2.5, 2.5)
                });
                if self.by == By::Acceleration {
                    return [wish[0], wish[1], wish[2], 0.0];
                }
                // The attitude that points the thrust along the wish: no yaw.
                let up = WEIGHT_MPS2 + wish[2];
                let pitch = wish[0].atan2(up);
                let roll = (-wish[1]).atan2(up.hypot(wish[0]));
                let thrust = up.hypot(wish[0]).hypot(wish[1]);
                [self.mass_kg * thrust, roll, pitch, 0.0]
            }
        }
    }

    /// Drives, measures, and makes the campaign.
    pub(super) fn campaign(
        mut self,
        causes: Vec<Cause>,
        rivals: &[&'static str],
        law: &dyn Fn(&mut Robot, &Now<'_>),
    ) -> Case {
        let all_causes = (1_u32 << causes.len()) - 1;
        let n_causes = causes.len();
        let mut rows = Vec::new();
        let mut ends: Vec<Vec<f64>> = vec![Vec::new(); 1 + n_causes + rivals.len()];
        for run in 0..self.n_runs {
            let waves: Vec<[[f64; 3]; 4]> = (0..self.n_robots)
                .map(|_| {
                    [0, 1, 2, 3].map(|_| {
                        let draws = &mut self.draws;
                        [
                            draws.between(0.05, 0.25),
                            draws.between(0.0, TAU),
                            draws.between(0.4, 0.8),
                        ]
                    })
                })
                .collect();
            let mut crew: Vec<Robot> = (0..self.n_robots)
                .map(|_| Robot {
                    place: [
                        self.room_m * self.draws.between(0.25, 0.75),
                        self.room_m * self.draws.between(0.25, 0.75),
                        if matches!(self.by, By::Velocity | By::Steering) {
                            0.0
                        } else {
                            self.height_m
                        },
                    ],
                    heading: self.draws.between(-3.0, 3.0),
                    ..Robot::default()
                })
                .collect();
            let mut history = Vec::new();
            for row in 0..self.n_rows {
                let time_s = row as f64 * ROW_S;
                let commands: Vec<[f64; 4]> = (0..self.n_robots)
                    .map(|one| {
                        self.joystick(&waves[one], &crew[one], time_s).map(|c| rounded(c, 4))
                    })
                    .collect();
                history.push((crew.clone(), commands));
                let (crew_now, commands) = &history[row];
                let all: Vec<[f64; 3]> = crew_now.iter().map(|robot| robot.place).collect();
                for (one, robot) in crew.iter_mut().enumerate() {
                    let command = commands[one];
                    ticks(
                        law,
                        robot,
                        &Now { robot: one, run, time_s, command, all: &all, acting: all_causes },
                    );
                }
            }
            for start in (0..self.n_rows - SECOND).step_by(SECOND) {
                for one in 0..self.n_robots {
                    for (which, ends) in ends.iter_mut().enumerate() {
                        let acting = match which {
                            0 => all_causes,
                            which if which <= n_causes => all_causes & !(1 << (which - 1)),
                            // A rival acts in place of the first cause.
                            which => (all_causes & !1) | 1 << (which - 1),
                        };
                        let mut robot = history[start].0[one].clone();
                        for (row, (crew, commands)) in
                            history.iter().enumerate().skip(start).take(SECOND)
                        {
                            let all: Vec<[f64; 3]> = crew.iter().map(|robot| robot.place).collect();
                            let time_s = row as f64 * ROW_S;
                            let command = commands[one];
                            ticks(
                                law,
                                &mut robot,
                                &Now { robot: one, run, time_s, command, all: &all, acting },
                            );
                        }
                        if which == 0 && 0 < self.late {
                            // What is measured is the motion of some rows before.
                            let seen =
                                |row: usize| history[row.saturating_sub(self.late)].0[one].place;
                            let [from, to] = [seen(start), seen(start + SECOND)];
                            let here = history[start].0[one].place;
                            robot.place = [0, 1, 2].map(|axis| here[axis] + to[axis] - from[axis]);
                        }
                        ends.extend(robot.place);
                    }
                }
            }
            rows.extend(self.measured(run, &history));
        }
        let change = |from: usize, to: usize| -> Vec<f64> {
            ends[to].iter().zip(&ends[from]).map(|(to, from)| to - from).collect()
        };
        let hidden =
            causes.into_iter().enumerate().map(|(index, cause)| (cause, change(index + 1, 0)));
        let rivals: Vec<Rival> = rivals
            .iter()
            .enumerate()
            .map(|(index, name)| Rival::new(name, vec![change(1, 1 + n_causes + index)]))
            .collect();
        let error = self.error_m
            * if self.by == By::Velocity || self.by == By::Steering { 1.42 } else { 4.0 };
        let truth = truth(hidden.collect(), &[], &rivals, error);
        let columns: &[&str] = match self.by {
            By::Velocity => &["cmd_vx_mps", "cmd_vy_mps", "cmd_vz_mps"],
            By::Steering => &["cmd_speed_mps", "cmd_steer_rad"],
            By::Acceleration => &["cmd_ax_mps2", "cmd_ay_mps2", "cmd_az_mps2"],
            By::Thrust => &["cmd_thrust_n", "cmd_roll_rad", "cmd_pitch_rad", "cmd_yaw_rad"],
        };
        for row in &mut rows {
            row.values.truncate(columns.len());
        }
        let body = match self.by {
            By::Velocity => "kind = \"point-mass\"".to_owned(),
            By::Steering => format!("kind = \"car\"\nwheelbase_m = {WHEELBASE_M:?}"),
            By::Acceleration => "kind = \"double-integrator\"".to_owned(),
            By::Thrust => {
                format!("kind = \"quadrotor\"\nattitude_lag_s = 0.0\nmass_kg = {:?}", self.mass_kg)
            }
        };
        Case {
            csv: robots(&rows, columns),
            config_toml: format!("[robotsim.dynamics]\n{body}\n"),
            truth,
        }
    }

    /// The rows of a run.
    fn measured(&mut self, run: usize, history: &[(Vec<Robot>, Vec<[f64; 4]>)]) -> Vec<RobotRow> {
        let n_axes = if matches!(self.by, By::Velocity | By::Steering) { 2 } else { 3 };
        let mut rows = Vec::new();
        for (row, (_, commands)) in history.iter().enumerate() {
            let (seen, _) = &history[row.saturating_sub(self.late)];
            for (agent, robot) in seen.iter().enumerate() {
                let mut at_m = robot.place;
                for place in at_m.iter_mut().take(n_axes) {
                    // Of two uniform numbers.
                    let error = self.draws.between(-1.0, 1.0) + self.draws.between(-1.0, 1.0);
                    *place = rounded(*place + self.error_m * 1.5_f64.sqrt() * error, 3);
                }
                if self.draws.chance(self.jumps) {
                    at_m[0] += self.draws.between(-3.0, 3.0);
                    at_m[1] += self.draws.between(-3.0, 3.0);
                }
                let heading = robot.heading + 0.003 * self.draws.normal();
                rows.push(RobotRow {
                    run: (1 < self.n_runs).then_some(run + 1),
                    time_s: row as f64 * ROW_S,
                    agent,
                    at_m,
                    heading_rad: (self.by == By::Steering)
                        .then(|| heading.sin().atan2(heading.cos())),
                    values: commands[agent].to_vec(),
                });
            }
        }
        rows
    }
}

fn ticks(law: &dyn Fn(&mut Robot, &Now<'_>), robot: &mut Robot, now: &Now<'_>) {
    for tick in 0..TICKS {
        law(robot, &Now { time_s: now.time_s + tick as f64 * TICK_S, ..*now });
    }
}
