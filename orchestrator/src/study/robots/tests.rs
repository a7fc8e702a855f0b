//! Robots that are driven here, with noise, by equations written out here.

use super::*;
use crate::diagnose::answer::{Kind, answer};
use crate::diagnose::ladder::Search;
use crate::diagnose::scan;
use crate::measure::robots;
use crate::measure::table::Table;
use crate::study::COMMON;
use crate::study::folds::scramble;
use proto::rng::normal;

const STEP_S: f64 = 0.05;
const NOISE_M: f64 = 0.01;
const THRESHOLD_MPS: f64 = 0.3;

/// Two robots, far from each other, whose command of a velocity changes every 0.4 to 1.6 s. As columns of a table of robot
/// samples, and one more. `moved`: moves place and velocity by a step under a command, and says what that column holds.
fn driven(
    n_steps: usize,
    column: &str,
    moved: impl Fn(usize, [f64; 2], &mut [f64; 2], &mut [f64; 2]) -> f64,
) -> Table {
    let names = ["time_s", "agent", "x_m", "y_m", "cmd_vx_mps", "cmd_vy_mps", column];
    let mut columns = vec![Vec::new(); names.len()];
    let mut draws = 0u64;
    let mut draw = || {
        draws += 2;
        normal(scramble(draws), scramble(draws + 1))
    };
    for agent in 0..2 {
        let (mut at, mut velocity, mut command) =
            ([1e4 * f64::from(agent), 0.0], [0.0; 2], [0.0; 2]);
        let mut until = 0;
        for step in 0..n_steps {
            if step == until {
                command = [draw(), draw()];
                until = step + 8 + (scramble(step as u64) % 24) as usize;
            }
            let measured = at.map(|place| place + NOISE_M * draw());
            let value = moved(step, command, &mut at, &mut velocity);
            let row = [
                step as f64 * STEP_S,
                f64::from(agent),
                measured[0],
                measured[1],
                command[0],
                command[1],
                value,
            ];
            for (column, value) in columns.iter_mut().zip(row) {
                column.push(value);
            }
        }
    }
    Table::of_columns(names.map(str::to_owned).to_vec(), columns)
}

/// Robots whose motors follow with a lag. The column is of no meaning.
fn lagging(n_steps: usize, tau_s: f64) -> Table {
    driven(n_steps, "battery_v", |_, command, at, velocity| {
        // A thousand small steps of v̇ = (u − v) / τ.
        for _ in 0..1000 {
            for axis in 0..2 {
                velocity[axis] += STEP_S / 1000.0 * (command[axis] - velocity[axis]) / tau_s;
                at[axis] += STEP_S / 1000.0 * velocity[axis];
            }
        }
        12.0
    })
}

/// Robots that a tide carries to the east, always, now more and now less: by as much as the noise in some seconds.
fn carried(n_steps: usize) -> Table {
    driven(n_steps, "tide_m", |step, command, at, _| {
        let tide_m = 1.0 + (scramble((step / 100) as u64) % 4) as f64;
        for axis in 0..2 {
            at[axis] += STEP_S * command[axis];
        }
        at[0] += STEP_S * 0.002 * tide_m;
        tide_m
    })
}

fn study(table: &Table) -> RobotStudy {
    let node = proto::config::parse("kind = 'point-mass'").unwrap();
    let spec = &robotsim::dynamics::SPEC;
    let dynamics = proto::config::check(&node, "", spec, &mut Vec::new()).table;
    let robots = robots::read(table).unwrap();
    RobotStudy::new(robots, &dynamics, Given::default(), (&Choices::default(), table)).unwrap()
}

fn index(study: &RobotStudy, name: &str) -> usize {
    study.candidates().iter().position(|candidate| candidate.name == name).unwrap()
}

#[test]
fn a_lag_is_fitted_with_its_time_constant_and_the_noise_is_what_is_left() {
    let study = study(&lagging(1000, 0.2));
    let lag = index(&study, "actuator-lag");
    let all: Vec<u32> = (0..study.n_rows() as u32).collect();
    let fit = study.fit(&[lag], &all, Level::Time, None);
    let (estimates, warning) = study.estimates(&fit, lag);
    assert_eq!(warning, None);
    let Estimate { value, low, high, .. } = estimates[0].clone();
    // A 90 % interval is 1.67 standard errors to each side; four of them.
    assert!((value - 0.2).abs() < 4.0 / 1.67 * 0.5 * (high - low), "{estimates:?}");
    assert!(high - low < 0.02, "{estimates:?}");
    assert!((fit.sd_m() / NOISE_M - 1.0).abs() < 0.1, "{fit:?}");
    let rise = study.log_likelihood(&fit) - study.log_likelihood(study.configured());
    assert!(100.0 < rise, "{rise}");
    let table = study.effect_table(&fit, lag).unwrap();
    assert_eq!(table["kind"].as_str(), Some("actuator-lag"));
    assert_eq!(table["tau_s"].as_float(), Some(value));
}

/// The mean of what follows the tide is `wind` to begin with. What follows it explains the mean, too.
#[test]
fn what_no_effect_explains_is_one_thing_with_its_mean() {
    let study = study(&carried(6000));
    let search = Search::new(&study, &|_| {});
    let ladder = search.climb();
    let names = |terms: &[usize]| -> Vec<String> {
        terms.iter().map(|&term| study.candidates()[term].name.clone()).collect()
    };
    assert_eq!(names(&ladder.accepted), ["curve:tide_m"]);
    let wind = study.fit(&[index(&study, "wind")], &study.fitted_rows(), Level::Time, None);
    let found = search.full(&ladder.accepted, COMMON, None);
    let likelihoods = [study.configured(), &wind, &found].map(|fit| study.log_likelihood(fit));
    assert!(likelihoods[0] + 100.0 < likelihoods[1], "{likelihoods:?}");
    assert!(likelihoods[1] + 50.0 < likelihoods[2], "{likelihoods:?}");
    let kind = Kind { name: "robot", unit: "m" };
    let json =
        answer(&study, &search, &ladder, kind, &scan::left_over(&study, &search, &ladder), None)
            .json;
    let listed = json["candidates"].as_array().unwrap();
    let curves = listed.iter().filter(|entry| entry["effect"] == "curve:tide_m");
    assert_eq!(curves.map(|entry| &entry["accepted"]).collect::<Vec<_>>(), [true]);
    assert_eq!(json["missing"].as_array().map(Vec::len), Some(0));
}

#[test]
fn an_effect_that_does_nothing_gains_nothing() {
    // Ten kilometres from each other, nobody feels the other's wash.
    let study = study(&lagging(400, 0.2));
    let lag = index(&study, "actuator-lag");
    let wash = index(&study, "downwash");
    let all: Vec<u32> = (0..study.n_rows() as u32).collect();
    let parent = study.fit(&[lag], &all, Level::Time, None);
    let child = study.fit(&[lag, wash], &all, Level::Time, Some(&parent));
    let rise = study.log_likelihood(&child) - study.log_likelihood(&parent);
    assert!(rise.abs() < 1e-6, "{rise}");
}

/// Robots that do not move at slow commands.
fn reluctant(n_steps: usize) -> Table {
    driven(n_steps, "battery_v", |_, command, at, _| {
        let is_moving = THRESHOLD_MPS < command[0].hypot(command[1]);
        for axis in 0..2 {
            at[axis] += if is_moving { STEP_S * command[axis] } else { 0.0 };
        }
        12.0
    })
}

/// How much measurements count depends on how well the model moves: with another threshold it is another share, and with that
/// share again another threshold.
#[test]
fn a_threshold_and_what_goes_with_it_are_at_their_likeliest_together() {
    let study = study(&reluctant(4000));
    let band = index(&study, "dead-band");
    let all: Vec<u32> = (0..study.n_rows() as u32).collect();
    let fit = study.fit(&[band], &all, Level::Time, None);
    let again = study.model.fitted(&[band], &all, &fit);
    let rise = study.log_likelihood(&again) - study.log_likelihood(&fit);
    assert!(rise.abs() < 0.02, "{rise}");
    let (estimates, _) = study.estimates(&fit, band);
    let Estimate { low, high, .. } = estimates[0].clone();
    assert!((low..=high).contains(&THRESHOLD_MPS), "{estimates:?}");
}

#[test]
fn blocks_are_many_and_what_lies_near_a_fold_is_not_trained_on() {
    let study = study(&lagging(1000, 0.2));
    let blocks = study.blocks(Level::Time);
    assert!((40..=80).contains(&blocks.n_blocks()), "{}", blocks.n_blocks());
    let tracks = &study.model.tracks;
    let start_s =
        |row: u32| tracks.robots.samples[tracks.windows[row as usize].start as usize].time_s;
    for fold in 0..5 {
        let (train, test) = blocks.split(fold);
        assert!(!train.is_empty());
        for &row in &train {
            for &other in &test {
                let same =
                    tracks.windows[row as usize].track == tracks.windows[other as usize].track;
                let apart_s = (start_s(row) - start_s(other)).abs();
                assert!(!same || WINDOW_S + MEMORY_S < apart_s + 1e-9, "{row} {other}");
            }
        }
    }
}

#[test]
fn what_needs_turns_or_ground_is_said_to_be_not_testable() {
    let study = study(&lagging(400, 0.2));
    let why = |name: &str| study.candidates()[index(&study, name)].untestable.clone();
    assert_eq!(why("slip"), None);
    assert_eq!(why("slope").as_deref(), Some("needs terrain in [site]"));
    assert_eq!(
        why("steering-bias").as_deref(),
        Some("needs commands of speed and of yaw rate or steering")
    );
    assert!(why("localization").is_some());
}

#[test]
fn a_body_that_takes_other_commands_is_refused() {
    let node = proto::config::parse("kind = 'car'").unwrap();
    let spec = &robotsim::dynamics::SPEC;
    let dynamics = proto::config::check(&node, "", spec, &mut Vec::new()).table;
    let table = lagging(100, 0.2);
    let robots = robots::read(&table).unwrap();
    let chosen = (&Choices::default(), &table);
    let error = RobotStudy::new(robots, &dynamics, Given::default(), chosen);
    let text = error.unwrap_err().to_string();
    assert!(text.contains("\"point-mass\"") && text.contains("\"car\""), "{text}");
}
