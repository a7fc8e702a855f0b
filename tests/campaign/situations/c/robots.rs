//! Situations of robots and flyers.

use super::motion::{Body, G, H, Mover, Step, Trial};
use crate::campaign::situations::Case;
use crate::campaign::situations::truth::Cause;
use crate::campaign::world::rounded;
use std::f64::consts::{FRAC_PI_2, PI};

fn with_consequences(case: Case, patterns: &[&'static str]) -> Case {
    Case { truth: case.truth.permitting(patterns), ..case }
}

const fn planar(u: [f64; 4]) -> [f64; 3] {
    [u[0], u[1], 0.0]
}

fn turned([x, y, z]: [f64; 3], angle: f64) -> [f64; 3] {
    let (sin, cos) = angle.sin_cos();
    [x * cos - y * sin, x * sin + y * cos, z]
}

/// Acceleration of a copter that faces east: a pitch too much, a factor of the thrust.
fn lifted(u: [f64; 4], mass_kg: f64, factor: f64, pitch_off: f64) -> [f64; 3] {
    let [(sin_roll, cos_roll), (sin_pitch, cos_pitch)] =
        [u[1].sin_cos(), (u[2] + pitch_off).sin_cos()];
    let lift = factor * u[0] / mass_kg;
    [lift * sin_pitch * cos_roll, -lift * sin_roll, lift * cos_pitch * cos_roll - G]
}

/// Exact, with a poor compass.
pub(super) fn nothing(seed: u64) -> Case {
    let mut trial = Trial::new(seed, Body::Rover);
    trial.error_rad = trial.draws.between(0.01, 0.03);
    trial.run(Vec::new(), &[], &|mover, step| mover.roll(step.u[0], 0.0, step.u[1]))
}

pub(super) fn bias_and_delay(seed: u64) -> Case {
    let mut trial = Trial::new(seed, Body::Puck);
    let angle = rounded(trial.draws.between(0.06, 0.25), 3);
    let angle = if trial.draws.chance(0.5) { angle } else { -angle };
    let delay_s = rounded(trial.draws.between(0.08, 0.3), 2);
    let law = |mover: &mut Mover, step: &Step| {
        let u = if step.on(1) { mover.command_before(delay_s) } else { step.u };
        mover.slide(turned(planar(u), if step.on(0) { angle } else { 0.0 }));
    };
    let causes = vec![
        Cause::of("heading-bias").sized("angle_rad", angle),
        Cause::of("dead-time").sized("delay_s", delay_s),
    ];
    trial.run(causes, &[], &law)
}

/// Rovers that slide outwards and lose speed in turns.
pub(super) fn slide_and_scrub(seed: u64) -> Case {
    let mut trial = Trial::new(seed, Body::Rover);
    let [aside_s, scrub] = [-trial.draws.between(0.05, 0.15), trial.draws.between(0.08, 0.25)];
    let law = |mover: &mut Mover, step: &Step| {
        let [u, turn, ..] = step.u;
        let ahead = if step.on(1) { u * (1.0 - scrub * turn.abs()).max(0.0) } else { u };
        // Across the command, or across the speed that is left: a difference of second order.
        let aside = if step.on(0) { aside_s * turn * ahead } else { 0.0 };
        mover.roll(ahead, aside, turn);
    };
    let causes = vec![
        Cause::of("yaw-coupling").sized("gain", aside_s),
        Cause::of("turn-slowdown").sized("gain", scrub),
    ];
    trial.run(causes, &[], &law)
}

/// A belt across the hall carries along what stands on it.
pub(super) fn belt(seed: u64) -> Case {
    let mut trial = Trial::new(seed, Body::Puck);
    let from_m = trial.hall_m * trial.draws.between(-0.25, 0.05);
    let wide_m = trial.hall_m * trial.draws.between(0.12, 0.25);
    let belt_mps = trial.fast * trial.draws.between(0.15, 0.4);
    let law = |mover: &mut Mover, step: &Step| {
        let mut v = planar(step.u);
        if step.on(0) && (from_m..from_m + wide_m).contains(&mover.p[0]) {
            v[1] += belt_mps;
        }
        mover.slide(v);
    };
    let case = trial.run(vec![Cause::unknown(&["x_m"])], &[], &law);
    with_consequences(case, &["wind"])
}

/// Firmware that knows speeds in coarse steps only.
pub(super) fn coarse_speed(seed: u64) -> Case {
    let mut trial = Trial::new(seed, Body::Rover);
    let step_mps = trial.fast * trial.draws.between(0.22, 0.3);
    let law = |mover: &mut Mover, step: &Step| {
        let u = step.u[0];
        let speed = if step.on(0) { (u / step_mps).floor() * step_mps } else { u };
        mover.roll(speed, 0.0, step.u[1]);
    };
    let case =
        trial.run(vec![Cause::unknown(&["commanded_speed_mps", "measured_speed_mps"])], &[], &law);
    with_consequences(case, &["slip", "dead-band"])
}

pub(super) fn stiction_and_slip(seed: u64) -> Case {
    let mut trial = Trial::new(seed, Body::Puck);
    let threshold_mps = rounded(trial.fast * trial.draws.between(0.2, 0.32), 3);
    let kept = rounded(trial.draws.between(0.85, 0.96), 3);
    let law = |mover: &mut Mover, step: &Step| {
        let kept = if step.on(1) { kept } else { 1.0 };
        let v = planar(step.u).map(|v| kept * v);
        // The band is of what is commanded.
        let is_held = step.on(0) && step.u[0].hypot(step.u[1]) < threshold_mps;
        mover.slide(if is_held { [0.0; 3] } else { v });
    };
    let causes = vec![Cause::of("dead-band"), Cause::of("slip").sized("scale", kept)];
    trial.run(causes, &[], &law)
}

/// The axes of one robot's frame are exchanged: it moves at a right angle.
pub(super) fn right_angle(seed: u64) -> Case {
    let mut trial = Trial::new(seed, Body::Puck);
    trial.n = 4 + trial.draws.below(2);
    trial.n_rows = 2400;
    let who = trial.draws.below(trial.n);
    let angle = if trial.draws.chance(0.5) { FRAC_PI_2 } else { -FRAC_PI_2 };
    let law = |mover: &mut Mover, step: &Step| {
        let is_turned = step.on(0) && step.who == who;
        mover.slide(turned(planar(step.u), if is_turned { angle } else { 0.0 }));
    };
    let cause = Cause::of("heading-bias").only(&[who]).sized("angle_rad", angle);
    trial.run(vec![cause.seen_over(&["agent"])], &[], &law)
}

/// All go one way at one speed: a wind across it and a turned compass are the same.
pub(super) fn one_way(seed: u64) -> Case {
    let mut trial = Trial::new(seed, Body::Puck);
    let way = trial.draws.between(-PI, PI);
    trial.one_way = Some(way);
    let angle = trial.draws.between(0.04, 0.12) * if trial.draws.chance(0.5) { 1.0 } else { -1.0 };
    let is_wind = trial.draws.chance(0.5);
    let law = |mover: &mut Mover, step: &Step| {
        let mut v = planar(step.u);
        for bit in [0, 1] {
            if step.on(bit) {
                // The same velocity by either.
                v = if (bit == 0) == is_wind {
                    let off = turned(planar(step.u), angle);
                    [v[0] + off[0] - step.u[0], v[1] + off[1] - step.u[1], v[2]]
                } else {
                    turned(v, angle)
                };
            }
        }
        mover.slide(v);
    };
    let [cause, rival] = if is_wind { ["wind", "heading-bias"] } else { ["heading-bias", "wind"] };
    trial.run(vec![Cause::of(cause)], &[rival], &law)
}

/// Weak drives: changes of the velocity take time in proportion.
pub(super) fn weak_drives(seed: u64) -> Case {
    let mut trial = Trial::new(seed, Body::Puck);
    let limit_mps2 = rounded(trial.fast * trial.draws.between(0.8, 2.0), 2);
    let law = |mover: &mut Mover, step: &Step| {
        let asked = planar(step.u);
        let [dx, dy] = [0, 1].map(|axis| asked[axis] - mover.v[axis]);
        let share =
            if step.on(0) { (limit_mps2 * H / dx.hypot(dy).max(1e-12)).min(1.0) } else { 1.0 };
        mover.v = [mover.v[0] + share * dx, mover.v[1] + share * dy, 0.0];
        mover.slide(mover.v);
    };
    let cause = Cause::of("acceleration-limit").sized("limit_mps2", limit_mps2);
    trial.run(vec![cause.seen_over(&["*change*"])], &[], &law)
}

pub(super) fn nothing_copters(seed: u64) -> Case {
    let trial = Trial::new(seed, Body::Copter);
    let mass_kg = trial.mass_kg;
    trial.run(Vec::new(), &[], &|mover, step| mover.thrust(lifted(step.u, mass_kg, 1.0, 0.0)))
}

/// Copters that burn fuel: ever lighter than their controller believes.
pub(super) fn fuel(seed: u64) -> Case {
    let mut trial = Trial::new(seed, Body::Copter);
    let mass_kg = trial.mass_kg;
    let lighter = trial.draws.between(0.06, 0.15);
    let lasts_s = trial.lasts_s();
    let law = |mover: &mut Mover, step: &Step| {
        let factor = if step.on(0) { 1.0 / (1.0 - lighter * step.t / lasts_s) } else { 1.0 };
        mover.thrust(lifted(step.u, mass_kg, factor, 0.0));
    };
    let case = trial.run(vec![Cause::unknown(&["time_s"])], &[], &law);
    with_consequences(case, &["thrust-scale", "payload-mass"])
}

/// Drag in proportion to the speed on what is commanded by accelerations.
pub(super) fn drag(seed: u64) -> Case {
    let mut trial = Trial::new(seed, Body::Jet);
    let per_s = trial.draws.between(0.15, 0.5);
    let law = |mover: &mut Mover, step: &Step| {
        let k = if step.on(0) { per_s } else { 0.0 };
        let v = mover.v;
        mover.thrust([0, 1, 2].map(|axis| step.u[axis] - k * v[axis]));
    };
    let cause = Cause::of("*drag*").seen_over(&["*speed*", "*direction*"]);
    trial.run(vec![cause], &[], &law)
}

/// An attitude sensor that is mounted askew. All face east, so that it is a push as well.
pub(super) fn askew(seed: u64) -> Case {
    let mut trial = Trial::new(seed, Body::Copter);
    let mass_kg = trial.mass_kg;
    let off = trial.draws.between(0.015, 0.06) * if trial.draws.chance(0.5) { 1.0 } else { -1.0 };
    let law = |mover: &mut Mover, step: &Step| {
        mover.thrust(lifted(step.u, mass_kg, 1.0, if step.on(0) { off } else { 0.0 }));
    };
    let cause = Cause::of("*attitude*").or(&["*tilt*", "*wind*", "*push*", "*force*"]);
    trial.run(vec![cause], &[], &law)
}
