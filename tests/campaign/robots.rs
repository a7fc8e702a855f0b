//! Robot campaigns: commands, the strengths that make the sizes asked for, and the samples.

use super::draws::Draws;
use super::fleet::{Drive, Fleet, RobotHidden};
use super::geometry::Point;
use super::hidden::Size;
use super::link::settled_one;
use super::motion::{
    CAP_MPS, Command, Hill, Physics, Robot, SAMPLE_S, WHEELBASE_M, advance, rotated,
};
use super::world::rounded;
use super::{Campaign, Scores, Truth};
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;

/// Standard deviation of the measured heading (rad).
pub(crate) const HEADING_SD_RAD: f64 = 0.002;
/// Spacing of the heights in the configuration (m); the true hills are smooth.
const GRID_M: f64 = 2.0;
/// Samples in the window that a size and a score are about: one second.
pub(crate) const WINDOW: usize = 20;

impl Campaign {
    /// A robot campaign with this hidden in it, of at most `n_rows` rows: all robots at each of so many samples, 20 per second.
    #[must_use]
    pub fn robots(seed: u64, fleet: &Fleet, hidden: &[(RobotHidden, Size)], n_rows: usize) -> Self {
        let kinds: Vec<RobotHidden> = hidden.iter().map(|(kind, _)| *kind).collect();
        let plan = Plan::new(seed, fleet, &kinds, n_rows / fleet.n_robots);
        let strengths = plan.settled(hidden);
        let tracks = plan.driven(&plan.physics(&strengths));
        let truth = (0..hidden.len()).map(|k| plan.truth(&strengths, k)).collect();
        let measured = plan.measured(&tracks, plan.noise_m(&strengths));
        Self {
            csv: plan.csv(&tracks, &measured),
            config_toml: plan.config(),
            truth,
            oracle: plan.scores(&tracks, &measured, plan.noise_m(&strengths)),
            received: 1.0,
        }
    }
}

/// All of a campaign that does not depend on how strong an effect is.
pub(crate) struct Plan<'a> {
    seed: u64,
    fleet: &'a Fleet,
    kinds: Vec<RobotHidden>,
    pub(crate) n_samples: usize,
    orders: Vec<Vec<Order>>,
    hills: Vec<Hill>,
    /// What each robot carries (kg), per sample.
    pub(crate) payloads_kg: Vec<Vec<f64>>,
    /// Per effect, what of its shape is drawn.
    shapes: Vec<[f64; 3]>,
}

/// Where a robot is to go from some sample on, and how fast.
#[derive(Clone, Copy, Debug)]
struct Order {
    from: usize,
    target_m: Point,
    speed_mps: f64,
}

/// What robots did.
pub(crate) struct Tracks {
    /// Per sample and robot.
    pub(crate) robots: Vec<Vec<Robot>>,
    /// Per robot and sample.
    pub(crate) commands: Vec<Vec<Command>>,
}

/// What was measured of a robot at a sample: less the truth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Error {
    pub(crate) at_m: [f64; 2],
    pub(crate) heading_rad: f64,
}

impl<'a> Plan<'a> {
    pub(crate) fn new(
        seed: u64,
        fleet: &'a Fleet,
        kinds: &[RobotHidden],
        n_samples: usize,
    ) -> Self {
        let mut draws = Draws::new(seed, "hills");
        let hills = (0..3)
            .map(|_| Hill {
                centre_m: fleet
                    .extent_m
                    .map(|extent_m| rounded(draws.between(0.1, 0.9) * extent_m, 1)),
                height_m: rounded(draws.between(2.0, 5.0), 1),
                radius_m: rounded(draws.between(12.0, 25.0), 1),
            })
            .collect();
        let shapes = kinds
            .iter()
            .map(|kind| {
                let mut draws = Draws::new(seed, &format!("robot effect {kind:?}"));
                [(); 3].map(|()| draws.uniform())
            })
            .collect();
        let orders = (0..fleet.n_robots)
            .map(|robot| {
                orders(&mut Draws::new(seed, &format!("orders {robot}")), fleet, n_samples)
            })
            .collect();
        let payloads: Vec<Vec<f64>> = (0..fleet.n_robots)
            .map(|robot| payload_kg(&mut Draws::new(seed, &format!("payload {robot}")), n_samples))
            .collect();
        let payloads_kg = (0..n_samples)
            .map(|sample| payloads.iter().map(|payload| payload[sample]).collect())
            .collect();
        Self { seed, fleet, kinds: kinds.to_vec(), n_samples, orders, hills, payloads_kg, shapes }
    }

    /// The physics with all effects at their strengths.
    fn physics(&self, strengths: &[f64]) -> Physics {
        let mut physics = Physics::ideal(self.fleet.drive);
        for ((kind, &strength), shape) in self.kinds.iter().zip(strengths).zip(&self.shapes) {
            let signed = if shape[1] < 0.5 { strength } else { -strength };
            match kind {
                RobotHidden::ActuatorLag => physics.lag_s = strength,
                RobotHidden::DeadTime => physics.delay_s = strength,
                RobotHidden::Slip => physics.slip = 1.0 - strength,
                RobotHidden::HeadingBias => physics.rotation_rad = signed,
                RobotHidden::DeadBand => physics.threshold_mps = strength,
                RobotHidden::SpeedLimit => physics.limit_mps = CAP_MPS - strength,
                RobotHidden::AccelerationLimit => physics.limit_mps2 = 1.0 / strength,
                RobotHidden::QuadraticDrag => physics.drag_per_m = strength,
                RobotHidden::SteeringBias => physics.trim = signed,
                RobotHidden::Wind => physics.wind_mps = rotated([strength, 0.0], TAU * shape[0]),
                RobotHidden::Slope => {
                    physics.slope_gain = strength;
                    physics.hills.clone_from(&self.hills);
                }
                RobotHidden::RoughGround => {
                    let (centre, radius_m) = self.rough(shape);
                    physics.rough = (centre, radius_m, 1.0 - strength);
                }
                RobotHidden::YawCoupling => physics.yaw_gain_s = strength,
                RobotHidden::Downwash => physics.downwash = (strength, range_m(shape)),
                RobotHidden::Localization => {}
                RobotHidden::Payload => physics.slip_per_kg = strength,
                RobotHidden::Tide => {
                    let period_s = self.n_samples as f64 * SAMPLE_S / 3.0;
                    physics.tide = (rotated([strength, 0.0], TAU * shape[0]), period_s);
                }
                RobotHidden::Stream => physics.stream_per_s = strength,
            }
        }
        physics
    }

    /// Centre (m) and radius (m) of the rough ground.
    fn rough(&self, shape: &[f64; 3]) -> (Point, f64) {
        let [width_m, depth_m] = self.fleet.extent_m;
        let centre = [
            rounded((0.3 + 0.4 * shape[0]) * width_m, 1),
            rounded((0.3 + 0.4 * shape[1]) * depth_m, 1),
        ];
        (centre, rounded(14.0 + 10.0 * shape[2], 1))
    }

    /// The whole campaign.
    fn driven(&self, physics: &Physics) -> Tracks {
        self.driven_by(|robots, commands, sample| {
            advance(physics, robots, commands, &self.payloads_kg[sample], sample);
        })
    }

    /// The whole campaign; `step` moves all robots from a sample to the next, given their commands up to it.
    pub(crate) fn driven_by(
        &self,
        mut step: impl FnMut(&mut [Robot], &[Vec<Command>], usize),
    ) -> Tracks {
        let n_robots = self.fleet.n_robots;
        let mut draws = Draws::new(self.seed, "starts");
        let mut now: Vec<Robot> = (0..n_robots)
            .map(|_| Robot {
                at_m: self.fleet.extent_m.map(|extent_m| draws.between(0.0, extent_m)),
                heading_rad: draws.between(-PI, PI),
                velocity_mps: [0.0; 2],
            })
            .collect();
        let mut robots = Vec::with_capacity(self.n_samples);
        let mut commands: Vec<Vec<Command>> = vec![Vec::new(); n_robots];
        for sample in 0..self.n_samples {
            for (robot, given) in commands.iter_mut().enumerate() {
                let orders = &self.orders[robot];
                let order = orders[orders.partition_point(|order| order.from <= sample) - 1];
                let last = given.last().copied();
                given.push(match last {
                    Some(last) if order.from != sample => last,
                    _ => self.command(&now[robot], order),
                });
            }
            robots.push(now.clone());
            step(&mut now, &commands, sample);
        }
        Tracks { robots, commands }
    }

    /// The command that leads a robot to where it is ordered.
    fn command(&self, robot: &Robot, order: Order) -> Command {
        let way = [0, 1].map(|axis| order.target_m[axis] - robot.at_m[axis]);
        let bearing = way[1].atan2(way[0]);
        if self.fleet.drive == Drive::Velocity {
            return rotated([order.speed_mps, 0.0], bearing).map(|part| rounded(part, 3));
        }
        let off = (bearing - robot.heading_rad + PI).rem_euclid(TAU) - PI;
        let yaw_radps = (off / 2.0).clamp(-1.2, 1.2);
        let turn = if self.fleet.drive == Drive::Unicycle {
            yaw_radps
        } else {
            (WHEELBASE_M * yaw_radps / order.speed_mps.max(0.3)).atan().clamp(-0.4, 0.4)
        };
        [rounded(order.speed_mps, 3), rounded(turn, 4)]
    }

    /// The strengths at which the effects have their sizes.
    fn settled(&self, hidden: &[(RobotHidden, Size)]) -> Vec<f64> {
        let mut strengths = vec![1e-4; hidden.len()];
        // As with links: each changes the other's size a little.
        for _ in 0..hidden.len() {
            for (k, (_, size)) in hidden.iter().enumerate() {
                let steps: Vec<f64> = match self.kinds[k] {
                    RobotHidden::SpeedLimit => (0..30).map(f64::from).collect(),
                    RobotHidden::RoughGround => (0..20).map(|n| f64::from(n) * 0.05).collect(),
                    _ => (0..40).map(|n| 1e-6 * 1.8_f64.powi(n)).collect(),
                };
                let mut at = strengths.clone();
                let mut size_of = |strength: f64| {
                    at[k] = strength;
                    self.size(&at, k)
                };
                strengths[k] = settled_one(&steps, size.of_noise(), &mut size_of);
            }
        }
        strengths
    }

    /// The size of an effect: how far (rms) robots are after a second from where they would be without it from the same state,
    /// divided by the noise of a difference of two measured positions, two standard deviations of an axis.
    fn size(&self, strengths: &[f64], of: usize) -> f64 {
        if self.kinds[of] == RobotHidden::Localization {
            return strengths[of];
        }
        let mut others = strengths.to_vec();
        others[of] = 0.0;
        let without = self.physics(&others);
        let tracks = self.driven(&self.physics(strengths));
        let [mut squares, mut n] = [0.0; 2];
        for start in (0..self.n_samples.saturating_sub(WINDOW)).step_by(WINDOW) {
            let mut robots = tracks.robots[start].clone();
            for sample in start..start + WINDOW {
                let payload_kg = &self.payloads_kg[sample];
                advance(&without, &mut robots, &tracks.commands, payload_kg, sample);
            }
            for (one, other) in robots.iter().zip(&tracks.robots[start + WINDOW]) {
                squares += super::geometry::distance(one.at_m, other.at_m).powi(2);
                n += 1.0;
            }
        }
        (squares / n).sqrt() / (2.0 * self.fleet.noise_m)
    }

    /// Standard deviation of the measured positions (m).
    fn noise_m(&self, strengths: &[f64]) -> f64 {
        let more = self.kinds.iter().position(|&kind| kind == RobotHidden::Localization);
        self.fleet.noise_m * more.map_or(1.0, |k| 1.0_f64.hypot(strengths[k]))
    }

    pub(crate) fn measured(&self, tracks: &Tracks, noise_m: f64) -> Vec<Vec<Error>> {
        let mut draws = Draws::new(self.seed, "localization");
        let mut one = |_: &Robot| Error {
            at_m: [noise_m * draws.normal(), noise_m * draws.normal()],
            heading_rad: HEADING_SD_RAD * draws.normal(),
        };
        tracks.robots.iter().map(|robots| robots.iter().map(&mut one).collect()).collect()
    }

    pub(crate) fn csv(&self, tracks: &Tracks, measured: &[Vec<Error>]) -> String {
        let columns = match self.fleet.drive {
            Drive::Velocity => "cmd_vx_mps,cmd_vy_mps",
            Drive::Unicycle => "heading_rad,cmd_speed_mps,cmd_yaw_rate_radps",
            Drive::Car => "heading_rad,cmd_speed_mps,cmd_steer_rad",
        };
        let mut text = format!("time_s,agent,x_m,y_m,z_m,{columns},payload_kg\n");
        for (sample, robots) in tracks.robots.iter().enumerate() {
            for (agent, robot) in robots.iter().enumerate() {
                let error = measured[sample][agent];
                let [x, y] = [0, 1].map(|axis| rounded(robot.at_m[axis] + error.at_m[axis], 4));
                let _ = write!(text, "{},{agent},{x},{y},0,", rounded(sample as f64 * SAMPLE_S, 2));
                if self.fleet.drive != Drive::Velocity {
                    let heading_rad = robot.heading_rad + error.heading_rad;
                    let turned = (heading_rad + PI).rem_euclid(TAU) - PI;
                    let _ = write!(text, "{},", rounded(turned, 5));
                }
                let [one, other] = tracks.commands[agent][sample];
                let _ = writeln!(text, "{one},{other},{}", self.payloads_kg[sample][agent]);
            }
        }
        text
    }

    pub(crate) fn config(&self) -> String {
        let kind = match self.fleet.drive {
            Drive::Velocity => "kind = \"point-mass\"".to_owned(),
            Drive::Unicycle => "kind = \"unicycle\"".to_owned(),
            Drive::Car => format!("kind = \"car\"\nwheelbase_m = {WHEELBASE_M:?}"),
        };
        let mut text = format!("[robotsim.dynamics]\n{kind}\nspeed_cap_mps = {CAP_MPS:?}\n");
        if self.kinds.contains(&RobotHidden::Localization) {
            let _ = write!(text, "\n[robotsim.localization]\nsd_m = {:?}\n", self.fleet.noise_m);
        }
        if self.kinds.contains(&RobotHidden::Slope) {
            // Robots may leave the place a little.
            let margin_m = 30.0;
            let n = self.fleet.extent_m.map(|extent| ((extent + 2.0 * margin_m) / GRID_M) as usize);
            let height_m = |row: usize, column: usize| {
                let place = [column, row].map(|k| k as f64 * GRID_M - margin_m);
                rounded(self.hills.iter().map(|hill| hill.height_at(place)).sum(), 4)
            };
            let rows: Vec<Vec<f64>> = (0..=n[1])
                .map(|row| (0..=n[0]).map(|column| height_m(row, column)).collect())
                .collect();
            let _ = write!(
                text,
                "\n[site.terrain]\norigin_m = [-{margin_m:?}, -{margin_m:?}]\nspacing_m = {GRID_M:?}\n\
                 height_m = {rows:?}\n"
            );
        }
        text
    }

    /// How well the true model predicts positions after a second: from the positions of the last second, all carried to the
    /// window's start by the true motion.
    fn scores(&self, tracks: &Tracks, measured: &[Vec<Error>], noise_m: f64) -> Scores {
        let [mut log, mut squares, mut crps, mut n] = [0.0; 4];
        let past = WINDOW as f64;
        for start in (WINDOW - 1..self.n_samples - WINDOW).step_by(WINDOW) {
            for agent in 0..self.fleet.n_robots {
                let way = [0, 1].map(|axis| {
                    tracks.robots[start + WINDOW][agent].at_m[axis]
                        - tracks.robots[start][agent].at_m[axis]
                });
                let mean = |of: &dyn Fn(Error) -> f64| {
                    measured[start + 1 - WINDOW..=start]
                        .iter()
                        .map(|row| of(row[agent]))
                        .sum::<f64>()
                        / past
                };
                let has_heading = self.fleet.drive != Drive::Velocity;
                let turn = if has_heading { mean(&|error| error.heading_rad) } else { 0.0 };
                let turned = rotated(way, turn);
                let across = way[0].hypot(way[1]) * HEADING_SD_RAD;
                let heading_square = if has_heading { across * across / past / 2.0 } else { 0.0 };
                let sd_m = (noise_m.powi(2) * (1.0 + 1.0 / past) + heading_square).sqrt();
                n += 1.0;
                for axis in 0..2 {
                    let end = measured[start + WINDOW][agent].at_m[axis];
                    let error = mean(&|error| error.at_m[axis]) + turned[axis] - way[axis] - end;
                    squares += error * error;
                    log -= 0.5 * (error / sd_m).powi(2) + (sd_m * TAU.sqrt()).ln();
                    crps += gaussian_crps(error / sd_m) * sd_m / 2.0;
                }
            }
        }
        Scores {
            log_score: log / n,
            rmse: (squares / n).sqrt(),
            crps: crps / n,
            reception_log_loss: None,
        }
    }

    /// What was hidden, in the terms of the catalogue.
    fn truth(&self, strengths: &[f64], of: usize) -> Truth {
        let (kind, strength, shape) = (self.kinds[of], strengths[of], &self.shapes[of]);
        let signed = if shape[1] < 0.5 { strength } else { -strength };
        let parameters = match kind {
            RobotHidden::ActuatorLag => vec![("tau_s", strength)],
            RobotHidden::DeadTime => vec![("delay_s", strength)],
            RobotHidden::Slip => vec![("scale", 1.0 - strength)],
            RobotHidden::HeadingBias => vec![("angle_rad", signed)],
            RobotHidden::DeadBand => vec![("threshold_mps", strength)],
            RobotHidden::SpeedLimit => vec![("limit_mps", CAP_MPS - strength)],
            RobotHidden::AccelerationLimit => vec![("limit_mps2", 1.0 / strength)],
            RobotHidden::QuadraticDrag => vec![("coefficient_per_m", strength)],
            RobotHidden::SteeringBias if self.fleet.drive == Drive::Car => {
                vec![("angle_rad", signed)]
            }
            RobotHidden::SteeringBias => vec![("rate_radps", signed)],
            RobotHidden::Wind => {
                let [x, y] = rotated([strength, 0.0], TAU * shape[0]);
                vec![("velocity_mps[0]", x), ("velocity_mps[1]", y)]
            }
            RobotHidden::Slope | RobotHidden::YawCoupling => vec![("gain", strength)],
            RobotHidden::RoughGround => {
                let ([x, y], radius_m) = self.rough(shape);
                let scale = 1.0 - strength;
                let centre = [("centre_m[0]", x), ("centre_m[1]", y)];
                centre.into_iter().chain([("radius_m", radius_m), ("scale", scale)]).collect()
            }
            RobotHidden::Downwash => vec![("gain", strength), ("range_m", range_m(shape))],
            RobotHidden::Localization => vec![("sd_m", self.noise_m(strengths))],
            RobotHidden::Payload | RobotHidden::Tide | RobotHidden::Stream => {
                vec![("coefficient", strength)]
            }
        };
        Truth {
            effect: kind.effect(),
            covariates: kind.covariates(),
            parameters,
            choices: Vec::new(),
            size: self.size(strengths, of),
        }
    }
}

/// Range of the downwash (m).
fn range_m(shape: &[f64; 3]) -> f64 {
    rounded(3.0 + 5.0 * shape[0], 1)
}

/// Orders every 0.4 to 3 s: a fifth of them slow or to stand still.
fn orders(draws: &mut Draws, fleet: &Fleet, n_samples: usize) -> Vec<Order> {
    let fastest_mps = fleet.fastest_mps;
    let mut orders = Vec::new();
    let mut from = 0;
    while from < n_samples {
        let speed_mps = if draws.chance(0.05) {
            0.0
        } else if draws.chance(0.2) {
            draws.between(0.0, 0.1 * fastest_mps)
        } else {
            draws.between(0.1, 1.0) * fastest_mps
        };
        let target_m = fleet.extent_m.map(|extent_m| draws.between(0.0, extent_m));
        orders.push(Order { from, target_m, speed_mps });
        from += 8 + draws.below(53);
    }
    orders
}

/// What a robot carries (kg), per sample: it is loaded anew every 20 to 40 s.
fn payload_kg(draws: &mut Draws, n_samples: usize) -> Vec<f64> {
    let mut loads_kg = Vec::with_capacity(n_samples);
    while loads_kg.len() < n_samples {
        let load_kg = rounded(draws.between(0.0, 5.0), 1);
        let until = loads_kg.len() + (draws.between(20.0, 40.0) / SAMPLE_S) as usize;
        loads_kg.resize(until.min(n_samples), load_kg);
    }
    loads_kg
}

/// Continuous ranked probability score of a standard normal prediction: Gneiting and Raftery 2007, eq. 21.
fn gaussian_crps(z: f64) -> f64 {
    let density = (-0.5 * z * z).exp() / TAU.sqrt();
    let distribution = super::oracle::normal_distribution(z);
    z * (2.0 * distribution - 1.0) + 2.0 * density - 1.0 / PI.sqrt()
}
