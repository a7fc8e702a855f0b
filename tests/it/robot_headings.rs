//! Headings of robots that turn, predicted beside their positions.

use diagnose::Request;
use diagnose::compare::{self, comparison::Comparison};
use measure::config::Compared;
use measure::table::DataTable;
use proto::rng::{Draws, Purpose};
use std::fmt::Write as _;
use tests::answers;

/// Noise of headings and positions.
const NOISE: f64 = 0.01;

/// A robot that turns by nine tenths of what is commanded: 1 m/s, and 0.6 rad/s to one side and the other for some two seconds each.
fn turning() -> DataTable {
    let draws = Draws::new(8, Purpose::Resample);
    let mut csv = "time_s,agent,x_m,y_m,heading_rad,cmd_speed_mps,cmd_yaw_rate_radps\n".to_owned();
    let (mut x_m, mut y_m, mut heading_rad) = (0.0_f64, 0.0_f64, 0.0_f64);
    for step in 0..4000_u64 {
        let sign = if step / 20 % 2 == 0 { 1.0 } else { -1.0 };
        let noise = |axis| NOISE * draws.normal(0, step, axis);
        writeln!(
            csv,
            "{:.1},0,{:.5},{:.5},{:.5},1,{}",
            step as f64 * 0.1,
            x_m + noise(0),
            y_m + noise(1),
            heading_rad + noise(2),
            0.6 * sign
        )
        .unwrap();
        for _ in 0..100 {
            heading_rad += 0.001 * 0.9 * 0.6 * sign;
            x_m += 0.001 * heading_rad.cos();
            y_m += 0.001 * heading_rad.sin();
        }
    }
    answers::measurements(&csv)
}

fn config(effects: &str) -> Compared {
    answers::model(&format!("[robotsim.dynamics]\nkind = \"unicycle\"\n{effects}"))
}

fn compared(effects: &str) -> Comparison {
    answers::compared(&Request::new(&config(effects), &turning()))
}

#[test]
fn headings_are_as_wrong_as_the_turns_and_with_what_is_missing_as_wrong_as_their_noise() {
    let plain = compared("");
    let rmse_rad = plain.scores["rmse_heading_rad"];
    // A second of 0.6 rad/s is off by 0.06 rad where the sign stays, which is so in half of the windows, and by less in others.
    assert!((0.035..0.1).contains(&rmse_rad), "{rmse_rad}");
    let [low, high] = plain.intervals["rmse_heading_rad"];
    assert!(low < rmse_rad && rmse_rad < high, "{low} {rmse_rad} {high}");
    let turn = plain.places.iter().find(|place| place.covariate == "commanded_turn").unwrap();
    let explained = turn.heading.unwrap().explained;
    // The covariate is the size of the turn, and headings err to both sides.
    assert!((0.0..0.3).contains(&explained), "{explained}");
    assert!(compare::words::text(&plain).contains("rmse_heading_rad"));

    let right =
        compared("[[robotsim.dynamics.effect]]\nkind = \"slip\"\nscale = 0.9\non = \"turn\"\n");
    let rmse_rad = right.scores["rmse_heading_rad"];
    // Noise of the end, and of the estimate of the begin, which is no greater.
    assert!((0.95 * NOISE..1.45 * NOISE).contains(&rmse_rad), "{rmse_rad}");
}

#[test]
fn the_heading_falls_where_the_missing_turn_is_found() {
    let found = answers::diagnosed(&Request::new(&config(""), &turning()));
    assert_eq!(found.missing, ["slip (turn)"]);
    let [before, after] = [0, 1].map(|rung| found.ladder[rung].rmse_heading_rad.unwrap());
    assert!(2.0 * after < before && after < 1.45 * NOISE, "{before} {after}");
}

#[test]
fn bodies_that_do_not_turn_have_no_error_of_headings() {
    let mut csv = "time_s,agent,x_m,y_m,heading_rad,cmd_vx_mps,cmd_vy_mps\n".to_owned();
    for step in 0..400 {
        let time_s = 0.1 * f64::from(step);
        writeln!(csv, "{time_s:.1},0,{:.4},0,0.1,{},0", time_s.sin(), time_s.cos()).unwrap();
    }
    let model = answers::model("[robotsim.dynamics]\nkind = \"point-mass\"\n");
    let found = answers::compared(&Request::new(&model, &answers::measurements(&csv)));
    assert!(!found.scores.contains_key("rmse_heading_rad"), "{found:?}");
    assert!(found.places.iter().all(|place| place.heading.is_none()));
}
