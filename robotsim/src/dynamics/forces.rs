//! What acts on a body that keeps its velocity beside what its actuators give by themselves: changed thrust, forces, a load.

use super::effect::{Effect, Pendulum, Situation};
use super::inertial::{GRAVITY_MPS2, Push};
use super::norm;
use super::physics::{Acting, Physics, Robot};
use super::surroundings::Surroundings;
use serde::{Deserialize, Serialize};

/// How the load below a robot hangs, seen from the robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Hanging {
    /// Where (m, east and north).
    pub offset_m: [f64; 2],
    /// How that changes (m/s).
    pub rate_mps: [f64; 2],
}

impl Physics {
    /// Changes what a body does in a step by effects.
    ///
    /// Thrust is a + lift: a' = M (a + lift) − lift, M being held over the step. Forces are those half way through the step, with the
    /// velocity that they themselves bring about until then: of second order. Gravity and springs do not make energy: the load is
    /// moved by half a step, pushed, and moved by the other half.
    ///
    /// * `free`: what its actuators would make of it until the end of the step, and its mean velocity (m/s).
    /// * `[time_s, h_s]`: the middle of the step, and its length.
    pub(super) fn act(
        &self,
        robot: &mut Robot,
        acting: &Acting,
        (push, mean_mps): (&mut Push, &mut [f64; 3]),
        [time_s, h_s]: [f64; 2],
        surroundings: &Surroundings<'_>,
    ) {
        if self.effects().is_empty() {
            return;
        }
        let own_mps = robot.drive;
        let situation = |mean_mps: [f64; 3]| Situation {
            time_s,
            position_m: std::array::from_fn(|i| robot.position_m[i] + 0.5 * h_s * mean_mps[i]),
            velocity_mps: mean_mps,
            heading_rad: robot.heading_rad,
            surroundings,
        };
        let load = self.acting_on(acting).find_map(Effect::load);
        let at = situation(*mean_mps);
        let gain: f64 = self.acting_on(acting).map(|effect| effect.thrust_gain(&at)).product();
        if gain != 1.0 || acting.tilt_rad != [0.0; 2] || load.is_some() {
            let lift_mps2 = self.lift_mps2();
            let lifts = load.map_or(1.0, |load| 1.0 / (1.0 + load.share));
            let thrust = |free_mps: [f64; 3], lifted_mps: f64| -> [f64; 3] {
                let thrust_mps = std::array::from_fn(|i| {
                    gain * (free_mps[i] - own_mps[i] + if i == 2 { lifted_mps } else { 0.0 })
                });
                let [east, north, up] = tilted(thrust_mps, acting.tilt_rad, robot.heading_rad);
                let gained_mps = [east, north, lifts * up - lifted_mps];
                std::array::from_fn(|i| own_mps[i] + gained_mps[i])
            };
            *mean_mps = thrust(*mean_mps, 0.5 * h_s * lift_mps2);
            push.velocity_mps = thrust(push.velocity_mps, h_s * lift_mps2);
        }
        let force_mps2 = |at: &Situation<'_>| {
            self.acting_on(acting).fold([0.0; 3], |sum: [f64; 3], effect| {
                let force_mps2 = effect.force_mps2(at);
                std::array::from_fn(|i| sum[i] + force_mps2[i])
            })
        };
        let ahead = |force_mps2: [f64; 3]| -> [f64; 3] {
            std::array::from_fn(|i| mean_mps[i] + 0.5 * h_s * force_mps2[i])
        };
        let mut total_mps2 = force_mps2(&situation(*mean_mps));
        if acting.force_varies && total_mps2 != [0.0; 3] {
            total_mps2 = force_mps2(&situation(ahead(total_mps2)));
        }
        if let Some(load) = load {
            let gained_mps: [f64; 3] =
                std::array::from_fn(|i| push.velocity_mps[i] - own_mps[i] + h_s * total_mps2[i]);
            let pull_mps2 = robot.load.swing(load, gained_mps.map(|part| part / h_s), h_s);
            total_mps2 =
                [total_mps2[0] + pull_mps2[0], total_mps2[1] + pull_mps2[1], total_mps2[2]];
        }
        for (axis, part_mps2) in total_mps2.into_iter().enumerate() {
            push.velocity_mps[axis] += h_s * part_mps2;
            mean_mps[axis] += 0.5 * h_s * part_mps2;
        }
    }

    /// The effects that act.
    fn acting_on<'a>(&'a self, acting: &'a Acting) -> impl Iterator<Item = &'a dyn Effect> + Clone {
        let all = self.effects().iter().enumerate().filter(|(place, _)| acting.has(*place));
        all.map(|(_, effect)| &**effect)
    }

    /// The acceleration (m/s²) that the thrust must give the body so that it stays at its height.
    fn lift_mps2(&self) -> f64 {
        self.body().inertial().map_or(0.0, |body| body.lift_mps2())
    }

    /// How fast (m/s²) a body that keeps its velocity may be accelerated that is asked for this, whichever effects act.
    pub(super) fn most_mps2(&self, asked_mps2: [f64; 3]) -> f64 {
        let gains = self.effects().iter().map(|effect| effect.thrust_gains());
        let [least, most] =
            gains.fold([1.0; 2], |[a, b], [least, most]| [a * least.min(1.0), b * most.max(1.0)]);
        let forces_mps2: f64 = self.effects().iter().map(|effect| effect.most_force_mps2()).sum();
        let lacking = (most - 1.0).max(1.0 - least);
        most * norm(asked_mps2) + lacking * self.lift_mps2() + forces_mps2
    }
}

impl Hanging {
    /// Lets the load swing for `h_s` below a robot that all else accelerates (m/s²). Returns how it pulls the robot meanwhile (m/s²).
    fn swing(&mut self, load: Pendulum, robot_mps2: [f64; 3], h_s: f64) -> [f64; 2] {
        let Pendulum { share, cable_m, damping_per_s } = load;
        // A cable does not push.
        let stiffness_per_s2 = (robot_mps2[2] + GRAVITY_MPS2).max(0.0) / cable_m;
        std::array::from_fn(|i| {
            let half_m = self.offset_m[i] + 0.5 * h_s * self.rate_mps[i];
            let pulled_mps2 = -(1.0 + share) * stiffness_per_s2 * half_m - robot_mps2[i];
            self.rate_mps[i] = (self.rate_mps[i] + h_s * pulled_mps2) / (1.0 + h_s * damping_per_s);
            self.offset_m[i] = half_m + 0.5 * h_s * self.rate_mps[i];
            share * stiffness_per_s2 * half_m
        })
    }
}

/// A vector tilted by roll and pitch (rad) of a body that faces somewhere.
fn tilted(vector: [f64; 3], [roll_rad, pitch_rad]: [f64; 2], heading_rad: f64) -> [f64; 3] {
    if roll_rad == 0.0 && pitch_rad == 0.0 {
        return vector;
    }
    let [(sin, cos), (sin_roll, cos_roll), (sin_pitch, cos_pitch)] =
        [heading_rad, roll_rad, pitch_rad].map(libm::sincos);
    let [east, north, up] = vector;
    let (ahead, left) = (cos * east + sin * north, cos * north - sin * east);
    let (left, up) = (cos_roll * left - sin_roll * up, sin_roll * left + cos_roll * up);
    let (ahead, up) = (cos_pitch * ahead + sin_pitch * up, cos_pitch * up - sin_pitch * ahead);
    [cos * ahead - sin * left, sin * ahead + cos * left, up]
}
