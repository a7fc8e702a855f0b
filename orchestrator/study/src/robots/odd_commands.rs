//! What is odd about the commands of a file beside its motion: a thrust in another unit, an axis of the opposite sign.

use measure::robots::{CommandKind, RobotSample, RobotSamples};
use numbers::power::square;
use robotsim::dynamics::GRAVITY_MPS2;

use crate::thresholds::{OPPOSITE_CORRELATION, OPPOSITE_ERRORS, WEIGHTS_OF_THRUST};

/// Time over which accelerations are measured, to either side (s). Noise of 1 cm is then 0.4 m/s².
const HALF_S: f64 = 0.25;
/// Names of the axes along which robots are commanded, from the back to the front and from the right to the left.
const AXES: [&str; 2] = ["forwards", "to the left"];

/// Warnings of commands as they stand in a file: of thrust in N.
pub(crate) fn warnings(robots: &RobotSamples, mass_kg: Option<f64>) -> Vec<String> {
    let thrust = mass_kg.and_then(|mass_kg| odd_thrust(robots, mass_kg));
    let opposite = (0..2).filter(|&axis| is_opposite(robots, axis)).map(|axis| {
        format!(
            "robots are accelerated against what commands say {}. Check the sign of the columns that command this, \
             and of positions; a mapping turns one round with scale = -1",
            AXES[axis]
        )
    });
    thrust.into_iter().chain(opposite).collect()
}

/// Thrusts that are far from the weight of a robot: a fraction of the greatest, steps of a motor, or another mass.
fn odd_thrust(robots: &RobotSamples, mass_kg: f64) -> Option<String> {
    if robots.commands != CommandKind::Thrust {
        return None;
    }
    let size = |sample: &RobotSample| sample.command.iter().map(|part| square(*part)).sum::<f64>();
    let mut thrusts_n: Vec<f64> = robots.samples.iter().map(|it| size(it).sqrt()).collect();
    thrusts_n.retain(|thrust_n| 0.0 < *thrust_n);
    thrusts_n.sort_by(f64::total_cmp);
    let (median_n, weight_n) = (*thrusts_n.get(thrusts_n.len() / 2)?, mass_kg * GRAVITY_MPS2);
    let is_odd = !(1.0 / WEIGHTS_OF_THRUST..=WEIGHTS_OF_THRUST).contains(&(median_n / weight_n));
    is_odd.then(|| {
        format!(
            "cmd_thrust_n is {median_n:.3} N in the median, and robots of {mass_kg} kg weigh {weight_n:.3} N. Check that it is in N, and \
             robotsim.dynamics.mass_kg; a fraction of the greatest thrust, or steps of a motor, must be converted"
        )
    })
}

/// Whether robots are accelerated against their commands along an axis of theirs, beyond noise.
fn is_opposite(robots: &RobotSamples, axis: usize) -> bool {
    if !robots.commands.is_inertial() {
        return false;
    }
    let pairs: Vec<[f64; 2]> = robots
        .tracks
        .iter()
        .flat_map(|track| pairs(&robots.samples[track.clone()], axis))
        .collect();
    let [x, y] = [0, 1].map(|k| centred(pairs.iter().map(move |pair| pair[k]).collect()));
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let correlation = product(&x, &y) / (product(&x, &x) * product(&y, &y)).sqrt();
    let errors = correlation * ((pairs.len() as f64 - 2.0) / (1.0 - square(correlation))).sqrt();
    correlation < -OPPOSITE_CORRELATION && errors < -OPPOSITE_ERRORS
}

/// Less their mean.
fn centred(mut values: Vec<f64>) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter_mut().for_each(|value| *value -= mean);
    values
}

/// What is commanded and what is measured (m/s²) along an axis of a robot, at moments so far apart that they share no sample but one.
fn pairs(track: &[RobotSample], axis: usize) -> Vec<[f64; 2]> {
    let mut found = Vec::new();
    let after = |from: usize| {
        let until_s = track[from].time_s + HALF_S;
        let index = from + track[from..].partition_point(|sample| sample.time_s < until_s);
        (index < track.len()).then_some(index)
    };
    let mut first = 0;
    while let Some((middle, last)) = after(first).and_then(|middle| Some((middle, after(middle)?)))
    {
        let heading_rad = track[middle].heading_rad;
        let heading_rad = if heading_rad.is_nan() { 0.0 } else { heading_rad };
        let (sin, cos) = (libm::sin(heading_rad), libm::cos(heading_rad));
        let direction = [[cos, sin], [-sin, cos]][axis];
        let along = |vector: &[f64; 3]| direction[0] * vector[0] + direction[1] * vector[1];
        let place = |index: usize| (track[index].time_s, along(&track[index].position_m));
        let ([t0, t1, t2], [x0, x1, x2]) = {
            let [(t0, x0), (t1, x1), (t2, x2)] = [first, middle, last].map(place);
            ([t0, t1, t2], [x0, x1, x2])
        };
        let measured = 2.0 * ((x2 - x1) / (t2 - t1) - (x1 - x0) / (t1 - t0)) / (t2 - t0);
        let commands = track[first..last].iter().map(|sample| along(&sample.command));
        found.push([commands.sum::<f64>() / (last - first) as f64, measured]);
        first = middle;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::rng::{Draws, Purpose};

    /// A flight of half a minute in which parts of the commanded acceleration are followed, with noise of 2 mm.
    fn flight(parts: [f64; 2]) -> RobotSamples {
        let step_s = 0.05;
        let (mut at_m, mut mps) = ([0.0; 2], [0.0; 2]);
        let mut sample = |k: u32| {
            let noise = |axis: u64| {
                0.002 * Draws::new(1, Purpose::FrameNoise).normal(axis, u64::from(k), 0)
            };
            let time_s = step_s * f64::from(k);
            let command = [libm::sin(1.3 * time_s), libm::cos(1.7 * time_s), 0.0];
            let position_m = [at_m[0] + noise(0), at_m[1] + noise(1), 1.0];
            for axis in 0..2 {
                at_m[axis] += step_s * mps[axis];
                mps[axis] += step_s * parts[axis] * command[axis];
            }
            RobotSample {
                line: 1,
                run: 0,
                agent: 0,
                time_s,
                position_m,
                heading_rad: f64::NAN,
                command,
            }
        };
        let samples: Vec<RobotSample> = (0..600).map(&mut sample).collect();
        RobotSamples {
            samples,
            tracks: std::iter::once(0..600).collect(),
            covariates: Vec::new(),
            commands: CommandKind::Acceleration,
            shape: robotsim::dynamics::Shape::Velocity,
            is_spatial: true,
            rejected: Vec::new(),
            warnings: Vec::new(),
            n_rows: 600,
        }
    }

    #[test]
    fn a_thrust_in_another_unit_is_said_and_one_that_bears_the_weight_is_not() {
        let of = |scale: f64| {
            let mut robots = flight([1.0, 1.0]);
            robots.commands = CommandKind::Thrust;
            for sample in &mut robots.samples {
                let thrust_n = |part_mps2: f64| scale * 0.032 * part_mps2;
                let [forwards, left, _] = sample.command;
                sample.command = [forwards, left, GRAVITY_MPS2].map(thrust_n);
            }
            warnings(&robots, Some(0.032))
        };
        assert_eq!(of(1.0), [""; 0]);
        for wrong in [41_000.0, 0.1] {
            assert!(of(wrong)[0].contains("steps of a motor"), "{wrong}");
        }
    }

    #[test]
    fn an_axis_that_is_turned_round_is_said() {
        assert_eq!(warnings(&flight([1.0, 1.0]), None), [""; 0]);
        let said = warnings(&flight([-1.0, 1.0]), None);
        assert!(said.len() == 1 && said[0].contains("forwards"), "{said:?}");
        let said = warnings(&flight([1.0, -1.0]), None);
        assert!(said.len() == 1 && said[0].contains("to the left"), "{said:?}");
        // Where noise is all that moves nothing is said.
        assert_eq!(warnings(&flight([0.0, 0.0]), None), [""; 0]);
    }
}
