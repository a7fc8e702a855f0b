//! Headings beside positions, of unicycles that are driven here.

use super::{index, study, study_of};
use crate::Study as _;
use crate::folds::scramble;
use crate::robots::RobotStudy;
use measure::table::DataTable;
use proto::effect::Level;
use proto::rng::normal;
use std::f64::consts::{PI, TAU};

const STEP_S: f64 = 0.1;
const NOISE_M: f64 = 0.02;
const NOISE_RAD: f64 = 0.004;

/// How the sensors of the heading are wrong.
#[derive(Clone, Copy, Default)]
struct SensorErrors {
    /// Drift (rad/s).
    drift_radps: f64,
    /// Standard deviation of a random walk (rad, in one second).
    walk_rad: f64,
}

/// Four unicycles that turn by a share of what is commanded.
fn unicycles(turn_scale: f64, errors: SensorErrors) -> DataTable {
    driven("cmd_yaw_rate_radps", turn_scale, |_, turn_radps| turn_radps, 0.0, errors)
}

/// Four cars that are measured so far (m) before their rear axle.
fn cars(lever_m: f64) -> DataTable {
    let steer_rad = |speed_mps: f64, turn_radps: f64| libm::atan(0.5 * turn_radps / speed_mps);
    driven("cmd_steer_rad", 1.0, steer_rad, lever_m, SensorErrors::default())
}

/// Four robots on wheels.
///
/// * `turn_command`: the column of the command of turns, which follows from speed (m/s) and yaw rate (rad/s) by `command`.
/// * `lever_m`: how far before the axle positions are measured.
fn driven(
    turn_command: &str,
    turn_scale: f64,
    command: impl Fn(f64, f64) -> f64,
    lever_m: f64,
    errors: SensorErrors,
) -> DataTable {
    let names = ["time_s", "agent", "x_m", "y_m", "heading_rad", "cmd_speed_mps", turn_command];
    let mut columns = vec![Vec::new(); names.len()];
    let mut draws = 0u64;
    let mut draw = || {
        draws += 2;
        normal(scramble(draws), scramble(draws + 1))
    };
    for agent in 0..4 {
        let (mut at_m, mut heading_rad) = ([100.0 * f64::from(agent), 0.0], 0.0);
        let (mut speed_mps, mut turn_radps) = (0.0, 0.0);
        let mut walked_rad = 0.0;
        for step in 0..1000_u32 {
            let time_s = STEP_S * f64::from(step);
            if step % 15 == 0 {
                (speed_mps, turn_radps) = (1.0 + 0.2 * draw(), 0.4 * draw());
            }
            walked_rad += errors.walk_rad * STEP_S.sqrt() * draw();
            let error_rad = walked_rad + errors.drift_radps * time_s + NOISE_RAD * draw();
            let measured_rad = heading_rad + error_rad;
            let row = [
                time_s,
                f64::from(agent),
                at_m[0] + lever_m * libm::cos(heading_rad) + NOISE_M * draw(),
                at_m[1] + lever_m * libm::sin(heading_rad) + NOISE_M * draw(),
                (measured_rad + PI).rem_euclid(TAU) - PI,
                speed_mps,
                command(speed_mps, turn_radps),
            ];
            columns.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
            let turned_rad = turn_scale * turn_radps * STEP_S;
            let middle_rad = heading_rad + 0.5 * turned_rad;
            at_m[0] += speed_mps * STEP_S * libm::cos(middle_rad);
            at_m[1] += speed_mps * STEP_S * libm::sin(middle_rad);
            heading_rad += turned_rad;
        }
    }
    DataTable::of_columns(names.map(str::to_owned).to_vec(), columns)
}

fn weight(study: &RobotStudy) -> f64 {
    study.configured().density.heading.unwrap().weight
}

#[test]
fn a_sensor_that_drifts_counts_for_little_and_its_drift_is_no_thousand_errors() {
    assert!(0.5 < weight(&study_of("unicycle", &unicycles(1.0, SensorErrors::default()))));
    let errors = SensorErrors { drift_radps: 0.01, ..SensorErrors::default() };
    let drifting = weight(&study_of("unicycle", &unicycles(1.0, errors)));
    assert!(drifting < 0.02, "{drifting}");
}

#[test]
fn a_sensor_that_walks_has_a_gain_of_its_own_and_does_not_turn_the_motion() {
    let errors = SensorErrors { walk_rad: 0.02, ..SensorErrors::default() };
    let study = study_of("unicycle", &unicycles(1.0, errors));
    let gains = study.model.gains(study.configured());
    assert!(gains.heading < 0.1 && 0.3 < gains.sensor, "{gains:?}");
}

#[test]
fn a_turn_is_told_by_headings_more_exactly_than_by_positions() {
    let study = study_of("unicycle", &unicycles(0.97, SensorErrors::default()));
    let slip = index(&study, "slip (turn)");
    let all: Vec<u32> = (0..study.n_rows() as u32).collect();
    let fit = study.fit(&[slip], &all, Level::Time, None);
    let (estimates, _) = study.estimates(&fit, slip);
    let half = 0.5 * (estimates[0].high - estimates[0].low);
    assert!((estimates[0].value - 0.97).abs() < 3.0 * half && half < 0.002, "{estimates:?}");
    assert_eq!(fit.density.heading.unwrap().weight, weight(&study));
}

#[test]
fn headings_that_drift_against_the_course_are_told_from_motion_that_turns_less() {
    let drift = |turn_scale, errors| {
        crate::Study::do_headings_drift(&study_of("unicycle", &unicycles(turn_scale, errors)))
    };
    assert!(!drift(1.0, SensorErrors::default()) && !drift(0.95, SensorErrors::default()));
    assert!(drift(1.0, SensorErrors { drift_radps: 0.002, ..SensorErrors::default() }));
    assert!(drift(1.0, SensorErrors { walk_rad: 0.01, ..SensorErrors::default() }));
}

#[test]
fn headings_of_cars_that_are_measured_before_their_axle_do_not_count() {
    let heading = |lever_m| study_of("car", &cars(lever_m)).configured().density.heading;
    assert!(heading(0.0).is_some());
    assert!(heading(0.3).is_none());
}

#[test]
fn bodies_that_do_not_turn_have_no_headings() {
    let study = study(&super::lagging(400, 0.2));
    assert!(study.configured().density.heading.is_none());
}
