//! Predictions of another simulator as the base model: here of this program's own, under configurations of its own.

use super::{NOISE_M, index, lagging, study};
use crate::Study as _;
use crate::choices::Choices;
use crate::robots::{RobotStudy, StatedSettings, command_kind, foreign, prediction_windows};
use measure::robots::{self, RobotSamples};
use measure::table::DataTable;
use numbers::power::square;
use proto::effect::Level;
use proto::prediction::{PredictedWindow, PredictionRequest};
use proto::side::RobotSimulator as _;
use proto::site::Site;
use robotsim::catalogue::Catalogue;
use robotsim::sim::Swarm;

/// What the built-in simulator predicts under `[robotsim]`.
fn predicted(robots: &RobotSamples, config: &str) -> Vec<PredictedWindow> {
    let request = PredictionRequest {
        site: Site::default(),
        config: proto::config::parse(config).unwrap(),
        command_kind: command_kind(robots.shape),
        windows: prediction_windows(robots).unwrap(),
    };
    Swarm::default().predict(&request).unwrap()
}

/// A study of a bare body under those predictions.
fn foreign_study(table: &DataTable, kind: &str, config: &str) -> RobotStudy {
    let node = proto::config::parse(&format!("kind = '{kind}'")).unwrap();
    let spec = &robotsim::dynamics::SPEC;
    let lists = Catalogue::built_in().lists();
    let dynamics = proto::config::check(&node, "", spec, &lists, &mut Vec::new()).table;
    let robots = robots::read(table).unwrap();
    let predicted = Some(predicted(&robots, config));
    let stated = StatedSettings { predicted, ..StatedSettings::default() };
    RobotStudy::new(robots, &dynamics, stated, (&Choices::default(), table)).unwrap()
}

const POINTS: &str = "dynamics.kind = 'point-mass'";
const LAG: &str =
    "dynamics = { kind = 'point-mass', effect = [{ kind = 'actuator-lag', tau_s = 0.2 }] }";

#[test]
fn predictions_of_our_own_kinematics_give_the_study_of_our_own_kinematics() {
    let table = lagging(1000, 0.2);
    let (own, foreign) = (study(&table), foreign_study(&table, "point-mass", POINTS));
    let [one, other] = [&own, &foreign].map(|it| it.log_likelihood(it.configured()));
    // Sums of a thousand steps instead of one path: rounding, times what a likelihood of 2000 windows makes of it.
    assert!((one - other).abs() < 1e-6, "{one} {other}");
    let lag = index(&own, "actuator-lag");
    let all: Vec<u32> = (0..own.n_rows() as u32).collect();
    let [one, other] = [&own, &foreign].map(|it| {
        let fit = it.fit(&[lag], &all, Level::Time, None);
        it.estimates(&fit, lag).0[0].value
    });
    assert!((one - other).abs() < 1e-6, "{one} {other}");
}

#[test]
fn what_the_other_simulator_does_by_itself_is_not_missing() {
    let table = lagging(1000, 0.2);
    let study = foreign_study(&table, "point-mass", LAG);
    let sd_m = study.configured().sd_m();
    assert!((sd_m / NOISE_M - 1.0).abs() < 0.1, "{sd_m}");
    let all: Vec<u32> = (0..study.n_rows() as u32).collect();
    let lag = index(&study, "actuator-lag");
    let fit = study.fit(&[lag], &all, Level::Time, None);
    let rise = study.log_likelihood(&fit) - study.log_likelihood(study.configured());
    // Windows overlap four times, so that twice the rise over four is a χ² of one number: above 10 once in 600 times.
    assert!(rise < 20.0, "{rise}");
}

#[test]
fn a_simulator_that_executes_a_fit_is_told_from_one_that_does_not() {
    let table = lagging(1000, 0.2);
    let study = foreign_study(&table, "point-mass", POINTS);
    let all: Vec<u32> = (0..study.n_rows() as u32).collect();
    let fit = study.fit(&[index(&study, "actuator-lag")], &all, Level::Time, None);
    let applied = |config| study.applied(&fit, &predicted(study.robots(), config)).unwrap();
    let [fitted_m, missing_m] = applied(LAG);
    // 0.2 s behind velocities of 1 m/s that change about once a second.
    assert!(0.02 < fitted_m && fitted_m < 0.3, "{fitted_m}");
    // The fitted time constant is not quite 0.2 s.
    assert!(missing_m < 0.05 * fitted_m, "{missing_m} of {fitted_m}");
    let [fitted_m, missing_m] = applied(POINTS);
    assert!((missing_m / fitted_m - 1.0).abs() < 1e-6, "{missing_m} of {fitted_m}");
}

/// Two cars on circles and straights, measured without noise, by the equations of the kinematic bicycle in small steps.
fn cars(wheelbase_m: f64) -> DataTable {
    let names = ["time_s", "agent", "x_m", "y_m", "heading_rad", "cmd_speed_mps", "cmd_steer_rad"];
    let mut columns = vec![Vec::new(); names.len()];
    for agent in 0..2 {
        let (mut at, mut heading_rad) = ([0.0, 50.0 * f64::from(agent)], 0.1);
        for step in 0..400 {
            let steer_rad = 0.3 * libm::sin(f64::from(step / 20));
            let row = [
                0.05 * f64::from(step),
                f64::from(agent),
                at[0],
                at[1],
                heading_rad,
                2.0,
                steer_rad,
            ];
            columns.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
            for _ in 0..1000 {
                let way_m = 2.0 * 0.05 / 1000.0;
                at[0] += way_m * libm::cos(heading_rad);
                at[1] += way_m * libm::sin(heading_rad);
                heading_rad += way_m * libm::tan(steer_rad) / wheelbase_m;
            }
        }
    }
    DataTable::of_columns(names.map(str::to_owned).into(), columns)
}

#[test]
fn the_wheelbase_behind_effects_on_cars_is_that_of_the_other_simulator() {
    let table = cars(0.5);
    let robots = robots::read(&table).unwrap();
    let predicted = predicted(&robots, "dynamics = { kind = 'car', wheelbase_m = 0.5 }");
    let found_m = foreign::wheelbase_m(&robots, &predicted).unwrap();
    // Durations are whole nanoseconds.
    assert!((found_m - 0.5).abs() < 1e-6, "{found_m}");
    let study = foreign_study(&table, "car", "dynamics = { kind = 'car', wheelbase_m = 0.5 }");
    // Euler steps of 50 µs on arcs of 2 m/s are off by micrometres.
    assert!(study.configured().sd_m() < 1e-4, "{}", study.configured().sd_m());
    assert_eq!(study.wheelbase_m(study.configured()), None);
}

/// Headings are measured with errors, and the base model follows the estimate, not the measurement at which a prediction began.
#[test]
fn steps_are_seen_from_the_body() {
    let table = cars(0.5);
    let robots = robots::read(&table).unwrap();
    let mut turned = robots.clone();
    for sample in &mut turned.samples {
        sample.heading_rad += 0.25;
    }
    let config = "dynamics = { kind = 'car', wheelbase_m = 0.5 }";
    let [straight, turned] =
        [&robots, &turned].map(|it| foreign::steps(it, &predicted(it, config)));
    for (a, b) in straight.iter().zip(&turned) {
        let apart_m = (0..3).map(|i| square(a.moved_m[i] - b.moved_m[i])).sum::<f64>().sqrt();
        assert!(apart_m < 1e-12 && (a.turned_rad - b.turned_rad).abs() < 1e-12, "{a:?} {b:?}");
    }
}
