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
use nalgebra::{Matrix3, Vector3};
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

/// By how much gravity differs from standard gravity on the ground at most (m/s²), at the equator and at the poles: H. Moritz, Geodetic
/// Reference System 1980, Journal of Geodesy 74 (2000) 128, with 0.0007 for heights and rock.
pub(super) const GRAVITY_RANGE_MPS2: f64 = 0.027;
/// Least time (s) over which it is looked for: noise of 1 cm is then far below the range.
const LEAST_S: f64 = 20.0;

/// Whether robots bear their weight by their thrust.
pub(super) fn is_borne(robots: &RobotSamples, dynamics: &toml::Table) -> bool {
    let kind = dynamics.get("kind").and_then(toml::Value::as_str);
    robots.commands.is_inertial() && kind == Some("quadrotor")
}

/// Makes commands of bodies that bear their weight those under the gravity of the place, which nobody says. It shows in how a robot departs from
/// the height that it would have as commanded, with the square of time. More than gravity may differ by is the doing of something else, and
/// left as it is.
pub(super) fn under_local_gravity(robots: &mut RobotSamples, dynamics: &toml::Table) {
    if !is_borne(robots, dynamics) {
        return;
    }
    let lag_s = dynamics.get("attitude_lag_s").and_then(toml::Value::as_float).unwrap_or(0.0);
    let (mut sum, mut weights) = (0.0, 0.0);
    for track in &robots.tracks {
        if let Some((excess_mps2, span_s)) = vertical_excess(&robots.samples[track.clone()], lag_s)
        {
            sum += square(span_s) * excess_mps2;
            weights += square(span_s);
        }
    }
    let excess_mps2 = sum / weights;
    // Not a number without a track that is long enough.
    if excess_mps2.abs() <= GRAVITY_RANGE_MPS2 {
        for sample in &mut robots.samples {
            sample.command[2] += excess_mps2;
        }
    }
}

/// By how much more (m/s²) than is commanded a robot is accelerated upwards over its track, and how long that is (s): by least squares
/// over its heights, from an unknown height and speed, the command being followed with a lag.
fn vertical_excess(samples: &[RobotSample], lag_s: f64) -> Option<(f64, f64)> {
    let [first, last] = [samples.first()?, samples.last()?];
    let span_s = last.time_s - first.time_s;
    if span_s < LEAST_S {
        return None;
    }
    let (mut height_m, mut up_mps, mut up_mps2) = (0.0, 0.0, first.command[2]);
    let (mut matrix, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (index, sample) in samples.iter().enumerate() {
        let part = (sample.time_s - first.time_s) / span_s;
        let powers = Vector3::new(1.0, part, 0.5 * square(part));
        matrix += powers * powers.transpose();
        right += powers * (sample.position_m[2] - height_m);
        let Some(next) = samples.get(index + 1) else { break };
        let h_s = next.time_s - sample.time_s;
        let missing_mps2 = up_mps2 - sample.command[2];
        let gone = if lag_s == 0.0 { 1.0 } else { -libm::expm1(-h_s / lag_s) };
        let late_mps = missing_mps2 * lag_s;
        height_m +=
            h_s * (up_mps + 0.5 * h_s * sample.command[2]) + late_mps * (h_s - lag_s * gone);
        up_mps += h_s * sample.command[2] + late_mps * gone;
        up_mps2 = sample.command[2] + missing_mps2 * (1.0 - gone);
    }
    let [_, _, curved] = (matrix.try_inverse()? * right).into();
    Some((curved / square(span_s), span_s))
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
    fn gravity_of_the_place_is_taken_from_flight_as_far_as_it_may_differ() {
        let of = |gravity_mps2: f64| {
            // To and fro with 1 m/s², as commanded under standard gravity, for two minutes.
            let (mut z_m, mut up_mps) = (10.0, 0.0);
            let samples = (0..1200).map(|k| {
                let command = [0.0, 0.0, if k % 40 < 20 { 1.0 } else { -1.0 }];
                let now = RobotSample {
                    position_m: [0.0, 0.0, z_m],
                    command,
                    ..sample(STEP_S * f64::from(k), 0.0)
                };
                let up_mps2 = command[2] + GRAVITY_MPS2 - gravity_mps2;
                z_m += STEP_S * (up_mps + 0.5 * STEP_S * up_mps2);
                up_mps += STEP_S * up_mps2;
                now
            });
            let samples: Vec<RobotSample> = samples.collect();
            let n = samples.len();
            let mut robots = RobotSamples {
                samples,
                tracks: std::iter::once(0..n).collect(),
                covariates: Vec::new(),
                commands: CommandKind::Acceleration,
                shape: robotsim::dynamics::Shape::Velocity,
                is_spatial: true,
                rejected: Vec::new(),
                warnings: Vec::new(),
                n_rows: n,
            };
            let dynamics = "kind = 'quadrotor'\nattitude_lag_s = 0.0".parse().unwrap();
            under_local_gravity(&mut robots, &dynamics);
            robots.samples[0].command[2] - 1.0
        };
        for gravity_mps2 in [9.81, 9.79, 9.83] {
            let excess_mps2 = GRAVITY_MPS2 - gravity_mps2;
            // Rounding of heights up to 100 m, over 120 s.
            assert!(
                (of(gravity_mps2) - excess_mps2).abs() < 1e-10,
                "{gravity_mps2}: {}",
                of(gravity_mps2)
            );
        }
        assert_eq!(of(9.7), 0.0);
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
