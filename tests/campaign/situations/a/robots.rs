//! Situations of robots and flyers.

use super::motion::{Body, Fleet, Kind, Moment, STEP_S, accelerate, drive, glide, thrust_mps2};
use crate::campaign::draws::Draws;
use crate::campaign::situations::Case;
use crate::campaign::situations::truth::Cause;
use crate::campaign::world::rounded;
use std::f64::consts::TAU;

/// Whether the cause or rival with this bit acts.
const fn acts(mask: u32, bit: u32) -> bool {
    mask >> bit & 1 == 1
}

fn along(command: [f64; 4], factor: f64) -> [f64; 3] {
    [factor * command[0], factor * command[1], factor * command[2]]
}

fn no_error(_: f64) -> f64 {
    0.0
}

pub(super) fn nothing(seed: u64) -> Case {
    let law = |body: &mut Body, now: &Moment, _| drive(body, now.command[0], now.command[1]);
    Fleet::new(seed, Kind::Unicycle).campaign(Vec::new(), &[], &law, no_error)
}

pub(super) fn nothing_slow_errors(seed: u64) -> Case {
    let mut fleet = Fleet::new(seed, Kind::PointMass);
    fleet.memory = fleet.draws.between(0.6, 0.9);
    let law = |body: &mut Body, now: &Moment, _| glide(body, along(now.command, 1.0));
    fleet.campaign(Vec::new(), &[], &law, no_error)
}

/// The sensor of the heading drifts: a rate for all, of which the motion knows nothing.
pub(super) fn gyro(seed: u64) -> Case {
    let fleet = Fleet::new(seed, Kind::Unicycle);
    let duration_s = fleet.n_rows as f64 * 0.1;
    let mut draws = Draws::new(seed, "gyro");
    let rate = draws.between(0.15, 0.5) / duration_s * if draws.chance(0.5) { 1.0 } else { -1.0 };
    // Seen from the measured heading, the motion turns away from it.
    let law = |body: &mut Body, now: &Moment, mask: u32| {
        let off = if acts(mask, 0) { 0.0 } else { rate * now.time_s };
        body.heading_rad += off;
        drive(body, now.command[0], now.command[1]);
        body.heading_rad -= off;
    };
    let cause =
        Cause::of("measurement:*heading*").or(&["measurement:*gyro*"]).seen_over(&["time_s"]);
    let case = fleet.campaign(vec![cause], &[], &law, |time_s| rate * time_s);
    Case { truth: case.truth.permitting(&["heading-bias", "steering-bias"]), ..case }
}

pub(super) fn shear(seed: u64) -> Case {
    let mut fleet = Fleet::new(seed, Kind::PointMass);
    let side_m = fleet.side_m;
    let most_mps = fleet.draws.between(0.2, 0.6);
    let law = |body: &mut Body, now: &Moment, mask: u32| {
        let mut velocity = along(now.command, 1.0);
        if acts(mask, 0) {
            velocity[0] += most_mps * (2.0 * body.at_m[1] / side_m - 1.0);
        }
        glide(body, velocity);
    };
    let case = fleet.campaign(vec![Cause::unknown(&["y_m"])], &[], &law, no_error);
    Case { truth: case.truth.permitting(&["wind"]), ..case }
}

pub(super) fn lag_up_down(seed: u64) -> Case {
    let mut fleet = Fleet::new(seed, Kind::Unicycle);
    let [up_s, down_s] = [fleet.draws.between(0.5, 0.9), fleet.draws.between(0.1, 0.2)];
    let law = |body: &mut Body, now: &Moment, mask: u32| {
        let is_faster = body.velocity_mps[0] < now.command[0];
        let tau_s = if is_faster { up_s } else { down_s };
        if acts(mask, 0) {
            body.velocity_mps[0] += (now.command[0] - body.velocity_mps[0]) * STEP_S / tau_s;
            drive(body, body.velocity_mps[0], now.command[1]);
        } else {
            drive(body, now.command[0], now.command[1]);
        }
    };
    let cause = Cause::of("actuator-lag").seen_over(&[
        "commanded_speed_mps",
        "time_since_change_s",
        "*change*",
    ]);
    let case = fleet.campaign(vec![cause], &[], &law, no_error);
    Case { truth: case.truth.permitting(&["acceleration-limit", "dead-time", "slip"]), ..case }
}

pub(super) fn two_old(seed: u64) -> Case {
    let mut fleet = Fleet::new(seed, Kind::PointMass);
    fleet.n_robots = 6 + fleet.draws.below(2);
    fleet.n_rows = 1100;
    let old = fleet.draws.order(fleet.n_robots)[..2].to_vec();
    let limit_mps = rounded(fleet.speed_mps * fleet.draws.between(0.45, 0.7), 2);
    let law = |body: &mut Body, now: &Moment, mask: u32| {
        let speed = now.command[0].hypot(now.command[1]);
        let is_limited = acts(mask, 0) && old.contains(&now.agent) && limit_mps < speed;
        glide(body, along(now.command, if is_limited { limit_mps / speed } else { 1.0 }));
    };
    let cause = Cause::of("speed-limit").only(&old).sized("limit_mps", limit_mps);
    fleet.campaign(vec![cause.seen_over(&["agent"])], &[], &law, no_error)
}

/// All drive to the east at one speed: slip, wind and drag are one.
pub(super) fn no_excitation(seed: u64) -> Case {
    let mut fleet = Fleet::new(seed, Kind::PointMass);
    fleet.is_steady = true;
    let kept = rounded(fleet.draws.between(0.85, 0.95), 3);
    let speed = fleet.speed_mps;
    // v + q v² = u at the same speed.
    let drag = (1.0 - kept) / (kept * kept * speed);
    let which = fleet.draws.below(3);
    let law = |body: &mut Body, now: &Moment, mask: u32| {
        let mut velocity = along(now.command, 1.0);
        for bit in 0..3 {
            if acts(mask, bit) {
                match (which + bit as usize) % 3 {
                    0 => velocity = velocity.map(|v| kept * v),
                    1 => velocity[0] -= (1.0 - kept) * speed,
                    _ => {
                        let slower =
                            ((1.0 + 4.0 * drag * velocity[0].abs()).sqrt() - 1.0) / (2.0 * drag);
                        velocity[0] = slower.copysign(velocity[0]);
                    }
                }
            }
        }
        glide(body, velocity);
    };
    let names = ["slip", "wind", "quadratic-drag"];
    let at = |turn: usize| names[(which + turn) % 3];
    let mut cause = Cause::of(at(0));
    cause.ties.push("speed-limit");
    fleet.campaign(vec![cause], &[at(1), at(2)], &law, no_error)
}

pub(super) fn mud(seed: u64) -> Case {
    let mut fleet = Fleet::new(seed, Kind::PointMass);
    let side_m = fleet.side_m;
    let centre = [0, 1].map(|_| rounded(side_m * fleet.draws.between(0.35, 0.65), 1));
    let radius_m = rounded(side_m * fleet.draws.between(0.15, 0.25), 1);
    let scale = rounded(fleet.draws.between(0.5, 0.75), 2);
    let until_s = 0.1 * fleet.n_rows as f64 * fleet.draws.between(0.4, 0.6);
    let law = |body: &mut Body, now: &Moment, mask: u32| {
        let away = (body.at_m[0] - centre[0]).hypot(body.at_m[1] - centre[1]);
        let is_in = acts(mask, 0) && away < radius_m && now.time_s < until_s;
        glide(body, along(now.command, if is_in { scale } else { 1.0 }));
    };
    let cause = Cause::of("rough-ground").sized("scale", scale).sized("radius_m", radius_m);
    let cause = cause.seen_over(&["x_m", "y_m", "time_s"]).for_a_time();
    fleet.campaign(vec![cause], &[], &law, no_error)
}

pub(super) fn slip_and_wind(seed: u64) -> Case {
    let mut fleet = Fleet::new(seed, Kind::PointMass);
    let kept = rounded(1.0 - fleet.draws.log_between(0.0005, 0.2), 4);
    let angle = fleet.draws.between(0.0, TAU);
    let wind = fleet.draws.between(0.1, 0.5);
    let law = |body: &mut Body, now: &Moment, mask: u32| {
        let mut velocity = along(now.command, if acts(mask, 0) { kept } else { 1.0 });
        if acts(mask, 1) {
            velocity[0] += wind * angle.cos();
            velocity[1] += wind * angle.sin();
        }
        glide(body, velocity);
    };
    let causes = vec![Cause::of("slip").sized("scale", kept), Cause::of("wind")];
    fleet.campaign(causes, &[], &law, no_error)
}

/// A quadrotor's law with a gain of its thrust.
fn fly(body: &mut Body, now: &Moment, mass_kg: f64, gain: f64) {
    let [thrust_n, roll, pitch, yaw] = now.command;
    let mut acceleration = thrust_mps2([gain * thrust_n / mass_kg, roll, pitch, yaw]);
    // The ground carries what does not fly.
    if body.at_m[2] <= 0.0 {
        body.at_m[2] = 0.0;
        body.velocity_mps[2] = body.velocity_mps[2].max(0.0);
        if acceleration[2] <= 0.0 {
            body.velocity_mps = [0.0; 3];
            acceleration = [0.0; 3];
        }
    }
    accelerate(body, acceleration);
}

/// Flights in which all land, stand for a while and go on.
pub(super) fn landing(seed: u64) -> Case {
    let mut fleet = Fleet::new(seed, Kind::Quadrotor);
    fleet.n_robots = 2;
    fleet.n_rows = 2500;
    let from = 900 + fleet.draws.below(400);
    fleet.landed = from..from + 200 + fleet.draws.below(300);
    let mass_kg = fleet.mass_kg;
    let law = move |body: &mut Body, now: &Moment, _: u32| fly(body, now, mass_kg, 1.0);
    fleet.campaign(Vec::new(), &[], &law, no_error)
}

/// A load, or weaker rotors: one and the same to thrust.
pub(super) fn load_or_thrust(seed: u64) -> Case {
    let mut fleet = Fleet::new(seed, Kind::Quadrotor);
    fleet.n_robots = 2;
    fleet.n_rows = 2000;
    // The pilot's law has no integral part: all sink by a metre at most, and none to the ground.
    fleet.hover_m = 3.0;
    let mass_kg = fleet.mass_kg;
    let gain = rounded(fleet.draws.between(0.88, 0.97), 3);
    let is_load = fleet.draws.chance(0.5);
    let law = move |body: &mut Body, now: &Moment, mask: u32| {
        let factor = |bit| if acts(mask, bit) { gain } else { 1.0 };
        fly(body, now, mass_kg, factor(0) * factor(1));
    };
    let load = Cause::of("payload-mass").sized("payload_kg", mass_kg * (1.0 / gain - 1.0));
    let thrust = Cause::of("thrust-scale").sized("scale", gain);
    let (cause, rival) = if is_load { (load, "thrust-scale") } else { (thrust, "payload-mass") };
    fleet.campaign(vec![cause], &[rival], &law, no_error)
}
