//! How robots move: written from the catalogue's equations and not from the product.

use super::fleet::Drive;
use super::geometry::{Point, distance};

/// Time between samples (s).
pub(crate) const SAMPLE_S: f64 = 0.05;
/// Steps of the integration in it.
const N_STEPS: usize = 10;
/// Distance between the axles of a car (m).
pub(crate) const WHEELBASE_M: f64 = 0.33;
/// The cap of the model as configured (m/s).
pub(crate) const CAP_MPS: f64 = 30.0;

/// A hill: Gaussian, with this height and standard deviation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hill {
    pub(crate) centre_m: Point,
    pub(crate) height_m: f64,
    pub(crate) radius_m: f64,
}

impl Hill {
    /// What it adds to the height of the ground (m).
    pub(crate) fn height_at(&self, place: Point) -> f64 {
        let off = distance(place, self.centre_m) / self.radius_m;
        self.height_m * (-0.5 * off * off).exp()
    }
}

/// Everything that acts on robots. [`Physics::ideal`]: nothing but the command.
#[derive(Clone, Debug)]
pub(crate) struct Physics {
    pub(crate) drive: Drive,
    pub(crate) lag_s: f64,
    pub(crate) delay_s: f64,
    pub(crate) slip: f64,
    pub(crate) rotation_rad: f64,
    pub(crate) threshold_mps: f64,
    pub(crate) limit_mps: f64,
    pub(crate) limit_mps2: f64,
    pub(crate) drag_per_m: f64,
    /// Of the yaw rate (rad/s) or the steering angle (rad).
    pub(crate) trim: f64,
    pub(crate) wind_mps: [f64; 2],
    pub(crate) slope_gain: f64,
    pub(crate) hills: Vec<Hill>,
    /// Centre (m), radius (m), scale of the speed.
    pub(crate) rough: (Point, f64, f64),
    pub(crate) yaw_gain_s: f64,
    /// Gain (m/s) and range (m).
    pub(crate) downwash: (f64, f64),
    pub(crate) slip_per_kg: f64,
    /// Amplitude of a drift that swings (m/s), and its period (s).
    pub(crate) tide: ([f64; 2], f64),
    pub(crate) stream_per_s: f64,
    /// Of unicycles: the share of the speed that is lost per yaw rate (s).
    pub(crate) turn_loss_s: f64,
    /// A drift to the north that varies with x: amplitude (m/s), wavelength (m), phase (rad).
    pub(crate) swell: (f64, f64, f64),
}

impl Physics {
    /// The model as configured.
    pub(crate) const fn ideal(drive: Drive) -> Self {
        Self {
            drive,
            lag_s: 0.0,
            delay_s: 0.0,
            slip: 1.0,
            rotation_rad: 0.0,
            threshold_mps: 0.0,
            limit_mps: CAP_MPS,
            limit_mps2: f64::INFINITY,
            drag_per_m: 0.0,
            trim: 0.0,
            wind_mps: [0.0; 2],
            slope_gain: 0.0,
            hills: Vec::new(),
            rough: ([0.0; 2], 0.0, 1.0),
            yaw_gain_s: 0.0,
            downwash: (0.0, 1.0),
            slip_per_kg: 0.0,
            tide: ([0.0; 2], 1.0),
            stream_per_s: 0.0,
            turn_loss_s: 0.0,
            swell: (0.0, 1.0, 0.0),
        }
    }

    /// The speed (m/s) that a commanded speed leads to in the end.
    fn steady_mps(&self, commanded_mps: f64, payload_kg: f64) -> f64 {
        if commanded_mps < self.threshold_mps {
            return 0.0;
        }
        let slipping = self.slip * commanded_mps * (1.0 - self.slip_per_kg * payload_kg);
        // v + q v² = u.
        let q = self.drag_per_m;
        let dragged =
            if q == 0.0 { slipping } else { ((1.0 + 4.0 * q * slipping).sqrt() - 1.0) / (2.0 * q) };
        dragged.min(self.limit_mps)
    }

    /// Velocity that the place and the time add (m/s).
    fn drift_mps(&self, at: Point, time_s: f64) -> [f64; 2] {
        let swing = (std::f64::consts::TAU * time_s / self.tide.1).sin();
        let (amplitude_mps, wavelength_m, phase) = self.swell;
        let swell_mps =
            amplitude_mps * (std::f64::consts::TAU * at[0] / wavelength_m + phase).sin();
        let mut drift = [
            self.wind_mps[0] + swing * self.tide.0[0] + self.stream_per_s * at[1],
            self.wind_mps[1] + swing * self.tide.0[1] + swell_mps,
        ];
        for hill in &self.hills {
            let square = hill.radius_m.powi(2);
            let height_m = hill.height_at(at);
            for axis in 0..2 {
                // -k ∇h.
                drift[axis] +=
                    self.slope_gain * height_m * (at[axis] - hill.centre_m[axis]) / square;
            }
        }
        drift
    }
}

/// A robot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Robot {
    pub(crate) at_m: Point,
    pub(crate) heading_rad: f64,
    /// Driven velocity (m/s): in the plane, or along the heading with 0.
    pub(crate) velocity_mps: [f64; 2],
}

/// What a robot is told: a velocity (m/s), or speed (m/s) and yaw rate (rad/s) or steering angle (rad).
pub(crate) type Command = [f64; 2];

/// Moves all robots from one sample to the next. `commands`: per robot those of all samples up to this one; `payload_kg`: of
/// each now.
pub(crate) fn advance(
    physics: &Physics,
    robots: &mut [Robot],
    commands: &[Vec<Command>],
    payload_kg: &[f64],
    sample: usize,
) {
    let step_s = SAMPLE_S / N_STEPS as f64;
    for step in 0..N_STEPS {
        let since_s = step as f64 * step_s;
        let time_s = sample as f64 * SAMPLE_S + since_s;
        let places: Vec<Point> = robots.iter().map(|robot| robot.at_m).collect();
        for (index, robot) in robots.iter_mut().enumerate() {
            let command = delayed(&commands[index], sample, since_s - physics.delay_s, step_s);
            let mut pushed = push(physics, index, &places);
            let (driven, yaw_radps) = drive(physics, robot, command, payload_kg[index], step_s);
            let middle = [0, 1].map(|axis| robot.at_m[axis] + driven[axis] * step_s / 2.0);
            let drift = physics.drift_mps(middle, time_s + step_s / 2.0);
            let (centre, radius_m, rough) = physics.rough;
            let scale = if distance(middle, centre) < radius_m { rough } else { 1.0 };
            // ω × v.
            pushed[0] -= physics.yaw_gain_s * yaw_radps * driven[1];
            pushed[1] += physics.yaw_gain_s * yaw_radps * driven[0];
            for axis in 0..2 {
                robot.at_m[axis] += (scale * driven[axis] + drift[axis] + pushed[axis]) * step_s;
            }
            robot.heading_rad += yaw_radps * step_s;
        }
    }
}

/// The command in force, on average over a step that begins this long after a sample.
fn delayed(commands: &[Command], sample: usize, since_s: f64, step_s: f64) -> Command {
    let begin = sample as f64 + since_s / SAMPLE_S;
    let end = begin + step_s / SAMPLE_S;
    let command_at = |place: f64| commands[(place.max(0.0) as usize).min(commands.len() - 1)];
    // The tolerance keeps rounding from ending a step in the next sample.
    let change = (end - 1e-9).floor();
    if change <= begin {
        return command_at(begin + 1e-9);
    }
    let late = (end - change) / (end - begin);
    let (before, after) = (command_at(begin), command_at(change));
    [0, 1].map(|k| before[k] + late * (after[k] - before[k]))
}

/// The driven velocity on average over a step (m/s), and the yaw rate (rad/s); changes the robot's velocity.
fn drive(
    physics: &Physics,
    robot: &mut Robot,
    command: Command,
    payload_kg: f64,
    step_s: f64,
) -> ([f64; 2], f64) {
    let steady = match physics.drive {
        Drive::Velocity => {
            let asked_mps = command[0].hypot(command[1]);
            let scale = physics.steady_mps(asked_mps, payload_kg) / asked_mps.max(1e-9);
            rotated(command, physics.rotation_rad).map(|component| scale * component)
        }
        Drive::Unicycle => {
            let kept = (1.0 - physics.turn_loss_s * (command[1] + physics.trim).abs()).max(0.0);
            [kept * physics.steady_mps(command[0], payload_kg), 0.0]
        }
        Drive::Car => [physics.steady_mps(command[0], payload_kg), 0.0],
    };
    let before = robot.velocity_mps;
    let off = [0, 1].map(|k| steady[k] - before[k]);
    // v̇ = (u - v) / τ: how much of the way is made at the step's end, and on average over it.
    let (at_end, on_average) = if physics.lag_s == 0.0 {
        (1.0, 1.0)
    } else {
        let steps = step_s / physics.lag_s;
        (1.0 - (-steps).exp(), 1.0 - (1.0 - (-steps).exp()) / steps)
    };
    let asked = at_end * off[0].hypot(off[1]);
    let greatest = physics.limit_mps2 * step_s;
    let (at_end, on_average) = if asked <= greatest {
        (at_end, on_average)
    } else {
        (at_end * greatest / asked, 0.5 * at_end * greatest / asked)
    };
    robot.velocity_mps = [0, 1].map(|k| before[k] + at_end * off[k]);
    let mean = [0, 1].map(|k| before[k] + on_average * off[k]);
    let yaw_radps = match physics.drive {
        Drive::Velocity => return (mean, 0.0),
        Drive::Unicycle => command[1] + physics.trim,
        Drive::Car => mean[0] * (command[1] + physics.trim).tan() / WHEELBASE_M,
    };
    let middle_rad = robot.heading_rad + yaw_radps * step_s / 2.0 + physics.rotation_rad;
    (rotated(mean, middle_rad), yaw_radps)
}

/// What the others do to a robot (m/s): away from each, e-folding over the range.
fn push(physics: &Physics, index: usize, places: &[Point]) -> [f64; 2] {
    let (gain_mps, range_m) = physics.downwash;
    let mut sum = [0.0; 2];
    for (other, &place) in places.iter().enumerate().filter(|_| gain_mps != 0.0) {
        if other != index {
            let apart_m = distance(places[index], place).max(0.01);
            let size = gain_mps * (-apart_m / range_m).exp() / apart_m;
            sum = [0, 1].map(|axis| sum[axis] + size * (places[index][axis] - place[axis]));
        }
    }
    sum
}

/// A vector turned counter-clockwise.
pub(crate) fn rotated(vector: [f64; 2], angle_rad: f64) -> [f64; 2] {
    let (sin, cos) = angle_rad.sin_cos();
    [cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1]]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where one robot from the origin is after a second of a command.
    fn after_a_second(physics: &Physics, command: Command) -> Robot {
        let mut robots = [Robot { at_m: [0.0; 2], heading_rad: 0.0, velocity_mps: [0.0; 2] }];
        let commands = [vec![command; 20]];
        for sample in 0..20 {
            advance(physics, &mut robots, &commands, &[0.0], sample);
        }
        robots[0]
    }

    fn near(value: f64, expected: f64, tolerance: f64) {
        assert!((value - expected).abs() <= tolerance, "{value}, not {expected}");
    }

    #[test]
    fn closed_forms_of_motion_hold() {
        let ideal = Physics::ideal(Drive::Velocity);
        near(after_a_second(&ideal, [3.0, 4.0]).at_m[1], 4.0, 1e-9);
        // u (t - τ (1 - e^(-t/τ))).
        let lag = Physics { lag_s: 0.2, ..ideal.clone() };
        let expected = 10.0 * (1.0 - 0.2 * (1.0 - (-5.0_f64).exp()));
        near(after_a_second(&lag, [10.0, 0.0]).at_m[0], expected, 1e-9);
        // a t²/2.
        let slow = Physics { limit_mps2: 2.0, ..ideal.clone() };
        near(after_a_second(&slow, [10.0, 0.0]).at_m[0], 1.0, 1e-9);
        let drag = Physics { drag_per_m: 0.1, ..ideal.clone() };
        let speed = after_a_second(&drag, [10.0, 0.0]).at_m[0];
        near(speed + 0.1 * speed * speed, 10.0, 1e-9);
        let still = Physics { threshold_mps: 1.0, ..ideal.clone() };
        near(after_a_second(&still, [0.9, 0.0]).at_m[0], 0.0, 1e-12);
        let biased = Physics { rotation_rad: 0.1, ..ideal.clone() };
        near(after_a_second(&biased, [10.0, 0.0]).at_m[1], 10.0 * 0.1_f64.sin(), 1e-9);
        // d x / d t = c y with y = 4 t.
        let stream = Physics { stream_per_s: 0.1, ..ideal };
        near(after_a_second(&stream, [0.0, 4.0]).at_m[0], 0.2, 1e-9);
        // d y / d t = a sin(2π x / w) with x = 4 t: half a wave of 8 m, of which the mean is 2/π.
        let swell = Physics { swell: (0.1, 8.0, 0.0), ..Physics::ideal(Drive::Velocity) };
        near(after_a_second(&swell, [4.0, 0.0]).at_m[1], 0.2 / std::f64::consts::PI, 1e-5);
    }

    #[test]
    fn a_command_waits_for_its_dead_time() {
        let physics = Physics { delay_s: 0.1234, ..Physics::ideal(Drive::Velocity) };
        let mut robots = [Robot { at_m: [0.0; 2], heading_rad: 0.0, velocity_mps: [0.0; 2] }];
        let commands = [[vec![[0.0, 0.0]; 10], vec![[10.0, 0.0]; 10]].concat()];
        for sample in 0..20 {
            advance(&physics, &mut robots, &commands, &[0.0], sample);
        }
        near(robots[0].at_m[0], 10.0 * (0.5 - 0.1234), 1e-9);
    }

    #[test]
    fn cars_and_unicycles_drive_in_circles() {
        let unicycle = Physics { trim: 0.1, ..Physics::ideal(Drive::Unicycle) };
        let robot = after_a_second(&unicycle, [2.0, 0.9]);
        // Radius 2 m, an angle of 1 rad; the midpoint rule errs by (ω h)²/24.
        near(robot.heading_rad, 1.0, 1e-9);
        near(robot.at_m[0], 2.0 * 1.0_f64.sin(), 1e-5);
        near(robot.at_m[1], 2.0 * (1.0 - 1.0_f64.cos()), 1e-5);
        let slower = Physics { turn_loss_s: 0.25, ..Physics::ideal(Drive::Unicycle) };
        let robot = after_a_second(&slower, [2.0, -1.0]);
        // 1.5 m/s at 1 rad/s to the right: a circle of 1.5 m.
        near(robot.at_m[0], 1.5 * 1.0_f64.sin(), 1e-5);
        near(robot.at_m[1], -1.5 * (1.0 - 1.0_f64.cos()), 1e-5);
        let car = after_a_second(&Physics::ideal(Drive::Car), [2.0, 0.1]);
        near(car.heading_rad, 2.0 * 0.1_f64.tan() / WHEELBASE_M, 1e-9);
    }

    #[test]
    fn robots_repel_each_other_alike() {
        let physics = Physics { downwash: (0.5, 2.0), ..Physics::ideal(Drive::Velocity) };
        let robot_at = |x| Robot { at_m: [x, 0.0], heading_rad: 0.0, velocity_mps: [0.0; 2] };
        let mut robots = [robot_at(0.0), robot_at(2.0)];
        let commands = [vec![[0.0; 2]], vec![[0.0; 2]]];
        advance(&physics, &mut robots, &commands, &[0.0; 2], 0);
        // A sample at 0.5 e^-1 m/s; a little less as they part.
        near(robots[1].at_m[0] - 2.0, 0.5 * (-1.0_f64).exp() * SAMPLE_S, 1e-4);
        near(robots[0].at_m[0] + robots[1].at_m[0], 2.0, 1e-12);
    }

    #[test]
    fn hills_push_downhill() {
        let hill = Hill { centre_m: [0.0; 2], height_m: 3.0, radius_m: 5.0 };
        let physics =
            Physics { slope_gain: 2.0, hills: vec![hill], ..Physics::ideal(Drive::Velocity) };
        let height = |x: f64| hill.height_at([x, 0.0]);
        near(height(5.0), 3.0 * (-0.5_f64).exp(), 1e-12);
        let gradient = (height(4.0 + 1e-5) - height(4.0 - 1e-5)) / 2e-5;
        near(physics.drift_mps([4.0, 0.0], 0.0)[0], -2.0 * gradient, 1e-8);
    }
}
