//! Robots that are commanded an acceleration, or a thrust and an attitude: they keep their velocity, which has to be estimated.
//!
//! Positions alone are measured. From the residual r of each against what the model expects, position and velocity are corrected by
//! shares of it: x += α r, v += β r / h, h being the time since the sample before. That is the α-β filter, the steady state of Kalman's for
//! a body whose acceleration is known but for noise. β follows from α by P. R. Kalata, The tracking index: a generalized parameter
//! for α-β and α-β-γ target trackers, IEEE Trans. Aerospace and Electronic Systems 20 (1984) 174: β = 2 (2 − α) − 4 √(1 − α).
//! At first both are those of a straight line through all samples so far, against the model: E. Brookner, Tracking and Kalman
//! Filtering Made Easy, 1998, § 1.2.10.

use super::RobotStudyError;
use crate::thresholds::{TRACK_BEGIN_S, TRACK_BEGIN_SAMPLES, TRACK_BEGIN_WINDOWS};
use measure::robots::{CommandKind, RobotSample, RobotSamples};
use numbers::power::square;
use robotsim::dynamics::GRAVITY_MPS2;
use robotsim::dynamics::physics::Robot;
use std::ops::Range;

/// Makes accelerations (m/s²) of commands of thrust.
pub(super) fn in_accelerations(
    robots: &mut RobotSamples,
    dynamics: &toml::Table,
) -> Result<(), RobotStudyError> {
    if robots.commands != CommandKind::Thrust {
        return Ok(());
    }
    let mass_kg = dynamics.get("mass_kg").and_then(toml::Value::as_float);
    let mass_kg = mass_kg.ok_or(RobotStudyError::Mass)?;
    for sample in &mut robots.samples {
        sample.command = sample.command.map(|part_n| part_n / mass_kg);
        sample.command[2] -= GRAVITY_MPS2;
    }
    Ok(())
}

/// The first sample of a track at which a window may begin.
pub(super) fn first_start(robots: &RobotSamples, track: &Range<usize>, window_s: f64) -> usize {
    // Commands of velocity take effect at once: nothing has to be estimated first.
    if !robots.commands.is_inertial() {
        return 0;
    }
    let samples = &robots.samples[track.clone()];
    let from_s = samples[0].time_s + TRACK_BEGIN_WINDOWS * window_s;
    samples.partition_point(|sample| sample.time_s < from_s).max(TRACK_BEGIN_SAMPLES)
}

/// A robot where its track begins: with the velocity that its first samples say, were the first command in force in them.
pub(super) fn begin(robot: Robot, samples: &[RobotSample]) -> Robot {
    let first = &samples[0];
    let n = samples.partition_point(|sample| sample.time_s <= first.time_s + TRACK_BEGIN_S).max(2);
    let Some(last) = samples.get(n - 1) else { return robot };
    let span_s = last.time_s - first.time_s;
    let drive = std::array::from_fn(|i| {
        (last.position_m[i] - first.position_m[i]) / span_s - 0.5 * span_s * first.command[i]
    });
    Robot { drive, push_mps2: first.command, ..robot }
}

/// How an estimated velocity scatters, per variance of one measured position. 0: it does not.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct VelocityVariance {
    /// Covariance with the estimated position (1/s).
    covariance: f64,
    /// Variance (1/s²).
    variance: f64,
}

impl VelocityVariance {
    /// What it adds to the variance of a position that is predicted so far ahead (s).
    pub(super) fn spread(&self, ahead_s: f64) -> f64 {
        2.0 * ahead_s * self.covariance + square(ahead_s) * self.variance
    }
}

/// Shares α and β of a residual for the measurement after step `index`, of which the position's is `gain` in the long run.
fn shares(gain: f64, index: usize) -> [f64; 2] {
    // The sample number, the first being 0.
    let n = (index + 1) as f64;
    let line = (n + 1.0) * (n + 2.0);
    let beta = 2.0 * (2.0 - gain) - 4.0 * (1.0 - gain).max(0.0).sqrt();
    [gain.max(2.0 * (2.0 * n + 1.0) / line), beta.max(6.0 / line)]
}

/// Corrects what the model expects by a measurement, the second of two samples.
///
/// * `gain`: how much it counts, and its number after the first.
/// * `scatter`: variance of the position, per variance of one measured position, and that of the velocity.
pub(super) fn correct(
    robot: &mut Robot,
    pair: &[RobotSample],
    (gain, index): (f64, usize),
    (variance, velocity): (&mut f64, &mut VelocityVariance),
) {
    let h_s = pair[1].time_s - pair[0].time_s;
    let [alpha, beta] = shares(gain, index);
    for i in 0..3 {
        let residual_m = pair[1].position_m[i] - robot.position_m[i];
        robot.position_m[i] += alpha * residual_m;
        robot.drive[i] += beta / h_s * residual_m;
    }
    // Errors of the estimate: e = A F e + (α, β/h) n, F going on by h, A = [[1 − α, 0], [−β/h, 1]].
    let ahead = *variance + velocity.spread(h_s);
    let covariance = velocity.covariance + h_s * velocity.variance;
    let per_s = beta / h_s;
    *variance = square(1.0 - alpha) * ahead + square(alpha);
    velocity.covariance = (1.0 - alpha) * (covariance - per_s * ahead) + alpha * per_s;
    velocity.variance += square(per_s) * ahead - 2.0 * per_s * covariance + square(per_s);
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 0.1;

    fn sample(time_s: f64, x_m: f64) -> RobotSample {
        RobotSample {
            line: 0,
            run: 0,
            agent: 0,
            time_s,
            position_m: [x_m, 0.0, 0.0],
            heading_rad: f64::NAN,
            command: [0.0; 3],
        }
    }

    /// What an estimate is after these positions, the model saying that nothing pushes: position, velocity, and how they scatter.
    fn after(places_m: &[f64], gain: f64) -> (Robot, f64, VelocityVariance) {
        let first = sample(0.0, places_m[0]);
        let mut robot = Robot { position_m: first.position_m, ..Robot::default() };
        let (mut variance, mut velocity) = (1.0, VelocityVariance::default());
        for (index, pair) in places_m.windows(2).enumerate() {
            let [before, now] = [index, index + 1].map(|k| STEP_S * k as f64);
            robot.position_m[0] += STEP_S * robot.drive[0];
            let pair = [sample(before, pair[0]), sample(now, pair[1])];
            correct(&mut robot, &pair, (gain, index), (&mut variance, &mut velocity));
        }
        (robot, variance, velocity)
    }

    #[test]
    fn at_first_an_estimate_is_the_straight_line_through_all_samples() {
        let places_m = [0.0, 0.3, 0.1, 0.5, 0.9, 0.7];
        let (robot, variance, velocity) = after(&places_m, 1e-3);
        let n = places_m.len() as f64;
        let times = |k: usize| STEP_S * (k as f64 - 0.5 * (n - 1.0));
        let squares: f64 = (0..places_m.len()).map(|k| square(times(k))).sum();
        let slope: f64 =
            places_m.iter().enumerate().map(|(k, x)| times(k) * x).sum::<f64>() / squares;
        let mean = places_m.iter().sum::<f64>() / n;
        assert!((robot.drive[0] - slope).abs() < 1e-12, "{robot:?} {slope}");
        let end_m = mean + slope * times(places_m.len() - 1);
        assert!((robot.position_m[0] - end_m).abs() < 1e-12, "{robot:?} {end_m}");
        // And scatters as one does.
        let last_s = times(places_m.len() - 1);
        assert!((velocity.variance - 1.0 / squares).abs() < 1e-9, "{velocity:?}");
        assert!((velocity.covariance - last_s / squares).abs() < 1e-9, "{velocity:?}");
        assert!((variance - (1.0 / n + last_s * last_s / squares)).abs() < 1e-9, "{variance}");
    }

    #[test]
    fn in_the_long_run_shares_are_those_of_the_tracking_index() {
        // Kalata's relation as he writes it: Λ² = β² / (1 − α), with α of Λ; at Λ = 1 α = 0.75 and β = 0.5.
        let [alpha, beta] = shares(0.75, 1000);
        assert!((alpha - 0.75).abs() < 1e-12 && (beta - 0.5).abs() < 1e-12, "{alpha} {beta}");
        assert!((square(beta) / (1.0 - alpha) - 1.0).abs() < 1e-12);
        // Both sides of where the line gives way.
        let [early, _] = shares(0.1, 36);
        let [late, _] = shares(0.1, 37);
        assert!(0.1 < early && late == 0.1, "{early} {late}");
    }
}
