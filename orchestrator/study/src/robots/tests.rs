//! Robots that are driven here, with noise, by equations written out here.

mod driven;
mod foreign;
mod headings;
mod subset;

use super::*;
use crate::folds::scramble;
use crate::thresholds::MEMORY_S;
use crate::{Study as _, TermId};
use driven::{NOISE_M, STEP_S, driven};
use measure::robots;
use measure::table::DataTable;
use proto::effect::Level;

const THRESHOLD_MPS: f64 = 0.3;

/// Robots whose motors follow with a lag. The column is of no meaning.
fn lagging(n_steps: usize, tau_s: f64) -> DataTable {
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

fn study(table: &DataTable) -> RobotStudy {
    study_of("point-mass", table)
}

fn study_of(kind: &str, table: &DataTable) -> RobotStudy {
    let node = proto::config::parse(&format!("kind = '{kind}'")).unwrap();
    let spec = &robotsim::dynamics::SPEC;
    let dynamics =
        proto::config::check(&node, "", spec, &Catalogue::built_in().lists(), &mut Vec::new())
            .table;
    let robots = robots::read(table).unwrap();
    RobotStudy::new(robots, &dynamics, StatedSettings::default(), (&Choices::default(), table))
        .unwrap()
}

fn index(study: &RobotStudy, name: &str) -> TermId {
    study.candidates().find(|candidate| candidate.name == name).unwrap()
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

#[test]
fn a_fit_leaves_gains_at_which_a_wrong_model_trusts_each_measurement() {
    let study = study(&lagging(1000, 0.2));
    let lag = index(&study, "actuator-lag");
    let all: Vec<u32> = (0..study.n_rows() as u32).collect();
    let fit = study.fit(&[lag], &all, Level::Time, None);
    let mut trusting = RobotFit { derivatives: Arc::default(), ..fit };
    let gains = 0..study.model.n_gains();
    // Gains count by their logarithm.
    trusting.values[gains.clone()].fill(0.0);
    trusting.log_likelihood = study.model.point(&trusting, &all).unwrap().total;
    let found = study.model.with_gains_tried(trusting.clone(), &all);
    assert!(trusting.log_likelihood + 10.0 < found.log_likelihood, "{found:?}");
    assert!(found.values[gains].iter().all(|gain| *gain < -0.1), "{found:?}");
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
fn reluctant(n_steps: usize) -> DataTable {
    driven(n_steps, "battery_v", |_, command, at, _| {
        let is_moving = THRESHOLD_MPS < libm::hypot(command[0], command[1]);
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
    let dynamics =
        proto::config::check(&node, "", spec, &Catalogue::built_in().lists(), &mut Vec::new())
            .table;
    let table = lagging(100, 0.2);
    let robots = robots::read(&table).unwrap();
    let chosen = (&Choices::default(), &table);
    let error = RobotStudy::new(robots, &dynamics, StatedSettings::default(), chosen);
    let text = error.unwrap_err().to_string();
    assert!(text.contains("\"point-mass\"") && text.contains("\"car\""), "{text}");
}

/// Robots that are no faster than a limit.
fn limited(n_steps: usize, limit_mps: f64) -> DataTable {
    driven(n_steps, "battery_v", |_, command, at, _| {
        let speed_mps = libm::hypot(command[0], command[1]);
        let share = if limit_mps < speed_mps { limit_mps / speed_mps } else { 1.0 };
        for axis in 0..2 {
            at[axis] += STEP_S * share * command[axis];
        }
        12.0
    })
}

#[test]
fn robots_that_pass_a_limit_contradict_it() {
    let contradiction = |table: &DataTable, held_mps: Option<f64>| {
        let study = study(table);
        let limit = index(&study, "speed-limit");
        let all: Vec<u32> = (0..study.n_rows() as u32).collect();
        let mut fit = study.fit(&[limit], &all, Level::Time, None);
        if let Some(held_mps) = held_mps {
            fit = study.with_parameter_held(&fit, limit, "limit_mps", held_mps).unwrap();
        }
        study.contradiction(&fit, limit)
    };
    assert_eq!(contradiction(&limited(1000, THRESHOLD_MPS), None), None);
    let why = contradiction(&limited(1000, f64::INFINITY), Some(THRESHOLD_MPS)).unwrap();
    assert!(why.starts_with("robots are faster than"), "{why}");
}
