//! Situations of robots and flyers.

use super::motion::{By, Now, Robot, Test, WEIGHT_MPS2};
use crate::campaign::situations::Case;
use crate::campaign::situations::truth::Cause;
use crate::campaign::world::rounded;
use std::f64::consts::TAU;

fn permitting(case: Case, patterns: &[&'static str]) -> Case {
    Case { truth: case.truth.permitting(patterns), ..case }
}

/// Acceleration by thrust and attitude.
fn lift(command: [f64; 4], mass_kg: f64, gain: f64) -> [f64; 3] {
    let [thrust, roll, pitch, _] = command;
    let up = gain * thrust / mass_kg;
    [up * pitch.sin() * roll.cos(), -up * roll.sin(), up * pitch.cos() * roll.cos() - WEIGHT_MPS2]
}

pub(super) fn nothing_cars(seed: u64) -> Case {
    let law = |robot: &mut Robot, now: &Now<'_>| robot.steer(now.command[0], now.command[1]);
    Test::new(seed, By::Steering).campaign(Vec::new(), &[], &law)
}

pub(super) fn nothing_flyers(seed: u64) -> Case {
    let law = |robot: &mut Robot, now: &Now<'_>| robot.push(now.vector());
    Test::new(seed, By::Acceleration).campaign(Vec::new(), &[], &law)
}

/// Gross errors of the camera, now and then.
pub(super) fn nothing_jumps(seed: u64) -> Case {
    let mut test = Test::new(seed, By::Velocity);
    test.jumps = test.draws.between(0.005, 0.02);
    let law = |robot: &mut Robot, now: &Now<'_>| robot.go(now.vector());
    permitting(
        test.campaign(Vec::new(), &[], &law),
        &["measurement:*outlier*", "measurement:*jump*"],
    )
}

/// One of several runs is on another floor.
pub(super) fn other_floor(seed: u64) -> Case {
    let mut test = Test::new(seed, By::Velocity);
    test.n_runs = 3 + test.draws.below(3);
    test.n_rows /= test.n_runs;
    let run = test.draws.below(test.n_runs);
    let kept = rounded(test.draws.between(0.75, 0.92), 3);
    let law = |robot: &mut Robot, now: &Now<'_>| {
        let factor = if now.is(0) && now.run == run { kept } else { 1.0 };
        robot.go(now.vector().map(|v| factor * v));
    };
    let cause = Cause::of("slip").only(&[run + 1]).sized("scale", kept).seen_over(&["run"]);
    test.campaign(vec![cause], &[], &law)
}

/// The wheels are not trimmed, and slip.
pub(super) fn trim_and_slip(seed: u64) -> Case {
    let mut test = Test::new(seed, By::Steering);
    let kept = rounded(test.draws.between(0.8, 0.95), 3);
    let angle = rounded(test.draws.between(0.02, 0.08), 3);
    let angle = if test.draws.chance(0.5) { angle } else { -angle };
    let law = |robot: &mut Robot, now: &Now<'_>| {
        let speed = now.command[0] * if now.is(0) { kept } else { 1.0 };
        robot.steer(speed, now.command[1] + if now.is(1) { angle } else { 0.0 });
    };
    let causes = vec![
        Cause::of("slip").sized("scale", kept),
        Cause::of("steering-bias").sized("angle_rad", angle),
    ];
    test.campaign(causes, &[], &law)
}

/// Play in the steering: it follows the command only after a gap, in either direction.
pub(super) fn play(seed: u64) -> Case {
    let mut test = Test::new(seed, By::Steering);
    let gap = test.draws.between(0.05, 0.12);
    let law = |robot: &mut Robot, now: &Now<'_>| {
        let asked = now.command[1];
        robot.memory = robot.memory.clamp(asked - gap, asked + gap);
        robot.steer(now.command[0], if now.is(0) { robot.memory } else { asked });
    };
    let cause = Cause::unknown(&["commanded_turn", "*change*", "heading*", "time_s"]);
    let rough = ["dead-band (turn)", "actuator-lag (turn)", "dead-time (turn)", "slip (turn)"];
    permitting(test.campaign(vec![cause], &[], &law), &rough)
}

/// Positions arrive late.
pub(super) fn late(seed: u64) -> Case {
    let mut test = Test::new(seed, By::Velocity);
    test.late = 1 + test.draws.below(3);
    let cause =
        Cause::of("dead-time").or(&["measurement:*delay*", "measurement:*late*", "localization"]);
    let cause = cause.sized("delay_s", 0.2 * test.late as f64);
    let law = |robot: &mut Robot, now: &Now<'_>| robot.go(now.vector());
    test.campaign(vec![cause], &[], &law)
}

/// Wheels wear off: the speed falls with time.
pub(super) fn wear(seed: u64) -> Case {
    let mut test = Test::new(seed, By::Velocity);
    let fall = test.draws.between(0.15, 0.35);
    let duration_s = 0.2 * test.n_rows as f64;
    let law = |robot: &mut Robot, now: &Now<'_>| {
        let factor = if now.is(0) { 1.0 - fall * now.time_s / duration_s } else { 1.0 };
        robot.go(now.vector().map(|v| factor * v));
    };
    permitting(test.campaign(vec![Cause::unknown(&["time_s"])], &[], &law), &["slip"])
}

/// The camera's scale is wrong: as slip, of more or less than one.
pub(super) fn camera_scale(seed: u64) -> Case {
    let mut test = Test::new(seed, By::Velocity);
    let size = test.draws.log_between(0.0005, 0.12);
    let scale = rounded(if test.draws.chance(0.5) { 1.0 + size } else { 1.0 - size }, 5);
    let law = |robot: &mut Robot, now: &Now<'_>| {
        robot.go(now.vector().map(|v| if now.is(0) { scale * v } else { v }));
    };
    let cause =
        Cause::of("slip").or(&["localization", "measurement:*scale*"]).sized("scale", scale);
    test.campaign(vec![cause], &[], &law)
}

/// Flyers that push each other away.
pub(super) fn crowd(seed: u64) -> Case {
    let mut test = Test::new(seed, By::Velocity);
    test.n_robots = 6;
    test.n_rows = 900;
    test.room_m = test.draws.between(5.0, 8.0);
    let [gain, range_m] = [test.draws.between(0.4, 1.0), test.draws.between(0.5, 1.2)];
    let law = |robot: &mut Robot, now: &Now<'_>| {
        let mut velocity = now.vector();
        if now.is(0) {
            for (_, place) in now.all.iter().enumerate().filter(|(other, _)| *other != now.robot) {
                let away = [robot.place[0] - place[0], robot.place[1] - place[1]];
                let far = away[0].hypot(away[1]).max(0.01);
                for axis in 0..2 {
                    velocity[axis] += gain * (-far / range_m).exp() * away[axis] / far;
                }
            }
        }
        robot.go(velocity);
    };
    let cause = Cause::of("downwash").sized("gain", gain).sized("range_m", range_m);
    test.campaign(vec![cause], &[], &law)
}

/// A current that turns with the tide.
pub(super) fn tide(seed: u64) -> Case {
    let mut test = Test::new(seed, By::Velocity);
    let strength = test.speed * test.draws.between(0.15, 0.35);
    let turns = test.draws.between(0.6, 2.0);
    let phase = test.draws.between(0.0, TAU);
    let duration_s = 0.2 * test.n_rows as f64;
    let law = |robot: &mut Robot, now: &Now<'_>| {
        let mut velocity = now.vector();
        if now.is(0) {
            let (sin, cos) = (TAU * turns * now.time_s / duration_s + phase).sin_cos();
            velocity[0] += strength * cos;
            velocity[1] += strength * sin;
        }
        robot.go(velocity);
    };
    permitting(test.campaign(vec![Cause::unknown(&["time_s"])], &[], &law), &["wind"])
}

/// A steady force on bodies that are commanded by accelerations.
pub(super) fn push(seed: u64) -> Case {
    let mut test = Test::new(seed, By::Acceleration);
    let force = test.draws.between(0.15, 0.6);
    let angle = test.draws.between(0.0, TAU);
    let law = |robot: &mut Robot, now: &Now<'_>| {
        let mut acceleration = now.vector();
        if now.is(0) {
            acceleration[0] += force * angle.cos();
            acceleration[1] += force * angle.sin();
        }
        robot.push(acceleration);
    };
    let cause = Cause::of("*wind*").or(&["*push*", "*force*", "*acceleration-bias*"]);
    test.campaign(vec![cause], &[], &law)
}

/// A load is dropped in flight.
pub(super) fn dropped_load(seed: u64) -> Case {
    let mut test = Test::new(seed, By::Thrust);
    let mass_kg = test.mass_kg;
    let gain = rounded(test.draws.between(0.88, 0.97), 3);
    let until_s = 0.2 * test.n_rows as f64 * test.draws.between(0.35, 0.65);
    let law = |robot: &mut Robot, now: &Now<'_>| {
        let is_loaded = now.time_s < until_s;
        let factor = |bit| if now.is(bit) && is_loaded { gain } else { 1.0 };
        robot.push(lift(now.command, mass_kg, factor(0) * factor(1)));
    };
    let cause = Cause::of("payload-mass").for_a_time().seen_over(&["time_s"]);
    let cause = cause.sized("payload_kg", mass_kg * (1.0 / gain - 1.0));
    test.campaign(vec![cause], &["thrust-scale"], &law)
}

/// Hovering so low that the ground carries a part.
pub(super) fn low_hover(seed: u64) -> Case {
    let mut test = Test::new(seed, By::Thrust);
    let mass_kg = test.mass_kg;
    test.height_m = test.draws.between(0.4, 0.6);
    let radius_m = rounded(test.draws.between(0.25, 0.4), 2);
    let law = |robot: &mut Robot, now: &Now<'_>| {
        let near = radius_m / (4.0 * robot.place[2].max(0.5 * radius_m));
        let gain = if now.is(0) { 1.0 / (1.0 - near * near) } else { 1.0 };
        robot.push(lift(now.command, mass_kg, gain));
    };
    let cause = Cause::of("ground-effect").sized("rotor_radius_m", radius_m).seen_over(&["z_m"]);
    test.campaign(vec![cause], &[], &law)
}
