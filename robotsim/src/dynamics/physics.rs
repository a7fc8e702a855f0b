//! One robot from one moment to another, under its commands: the one piece of code that runs use and fits use.

use super::body::{Body, Drive, Part};
use super::effect::{Effect, Situation};
use super::inertial::{Push, within};
use super::response::Response;
use super::rigid::RigidBody;
use super::surroundings::Surroundings;
use serde::{Deserialize, Serialize};

/// What a robot carries from one moment to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Robot {
    /// Where it is (m).
    pub position_m: [f64; 3],
    /// Direction its body faces (rad). Used by turning bodies.
    pub heading_rad: f64,
    /// What its actuators do.
    pub drive: Drive,
    /// How a body that keeps its velocity is accelerated (m/s²).
    pub push_mps2: [f64; 3],
}

/// A command and since when it is in force.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Order {
    /// Since when (s).
    pub from_s: f64,
    /// What is asked for.
    pub demand: Drive,
}

/// A body and effects, ready to be advanced.
#[derive(Debug)]
pub struct Physics {
    body: Body,
    effects: Vec<Box<dyn Effect>>,
    delay_s: [f64; 2],
    response: [Response; 2],
    course_rad: f64,
    sideways_s: f64,
    varies: bool,
    drifts: bool,
    steps: Steps,
}

/// Where motion has no closed form it is integrated in steps of at most so long. An arc with the mean speed and turn of the
/// step is of second order in it; a drift that depends on the place is of first, since half way is taken without the drift
/// itself.
#[derive(Clone, Copy, Debug)]
struct Steps {
    /// Where a body turns while its actuators follow (s).
    turning_s: f64,
    /// Where motion depends on the place or the time (s).
    local_s: f64,
}

const STEPS: Steps = Steps { turning_s: 0.025, local_s: 0.01 };

impl Physics {
    pub(super) fn new(body: Body, effects: Vec<Box<dyn Effect>>) -> Self {
        let parts = [Part::Speed, Part::Turn];
        let sum = |value: &dyn Fn(&dyn Effect) -> f64| {
            effects.iter().map(|effect| value(&**effect)).sum::<f64>()
        };
        let response = |part| Response {
            lag_s: sum(&|effect| effect.lag_s(part)),
            limit: effects
                .iter()
                .map(|effect| effect.limit_per_s(part))
                .fold(f64::INFINITY, f64::min),
        };
        Self {
            delay_s: parts.map(|part| sum(&|effect| effect.delay_s(part))),
            response: parts.map(response),
            course_rad: sum(&|effect| effect.course_rad()),
            sideways_s: sum(&|effect| effect.sideways_s()),
            varies: effects.iter().any(|effect| effect.varies_on_the_way()),
            drifts: !effects.is_empty(),
            steps: STEPS,
            body,
            effects,
        }
    }

    /// How the body is commanded.
    #[must_use]
    pub fn shape(&self) -> super::body::Shape {
        self.body.shape()
    }

    pub(super) fn body(&self) -> &Body {
        &self.body
    }

    /// The effects, in the order of the configuration.
    #[must_use]
    pub fn effects(&self) -> &[Box<dyn Effect>] {
        &self.effects
    }

    /// How long ago (s) commands may have been given that still matter for what is to come.
    #[must_use]
    pub fn delay_s(&self) -> f64 {
        self.delay_s[0].max(self.delay_s[1])
    }

    /// After how long (s) what actuators did before has no influence any more: the delay, and 5 time constants.
    #[must_use]
    pub fn memory_s(&self) -> f64 {
        self.delay_s() + 5.0 * self.response[0].lag_s.max(self.response[1].lag_s)
    }

    /// Whether effects make it differ from the bare body.
    #[must_use]
    pub fn is_bare(&self) -> bool {
        self.effects.is_empty()
    }

    /// Whether a robot moves alike wherever it begins, and turned where it begins turned: nothing but its commands counts.
    #[must_use]
    pub fn is_alike_everywhere(&self) -> bool {
        let drifts = || self.effects.iter().any(|effect| effect.drifts());
        !(self.varies || self.shape().is_turning() && drifts())
    }

    /// Whether bodies keep their velocity.
    #[must_use]
    pub fn is_inertial(&self) -> bool {
        self.body.inertial().is_some()
    }

    /// The body, if its contacts are those of a rigid one.
    pub(super) fn rigid(&self) -> Option<&RigidBody> {
        match &self.body {
            Body::RigidBody(body) => Some(body),
            _ => None,
        }
    }

    /// What to ask of a robot so that it moves with this velocity (m/s), as well as it can within `dt_s`.
    pub(super) fn follow(&self, velocity_mps: [f64; 3], robot: &Robot, dt_s: f64) -> Drive {
        match self.body.inertial() {
            Some(body) => body.towards(self.target(velocity_mps), robot.drive, dt_s),
            None => self.body.follow(velocity_mps, robot.heading_rad, dt_s),
        }
    }

    /// Advances a robot from `from_s` to `until_s` under orders, sorted by time. Before the first of them nothing was asked
    /// for. `next` is a place to begin to search in the orders, and is left where the next call may begin.
    pub fn advance(
        &self,
        robot: &mut Robot,
        orders: &[Order],
        next: &mut usize,
        from_s: f64,
        until_s: f64,
        surroundings: &Surroundings<'_>,
    ) {
        let mut at_s = from_s;
        // Orders are looked for from a little before: the longest delay ago.
        let longest_s = self.delay_s();
        while *next < orders.len() && orders[*next].from_s + longest_s <= from_s {
            *next += 1;
        }
        while 0 < *next && from_s < orders[*next - 1].from_s + longest_s {
            *next -= 1;
        }
        while at_s < until_s {
            let mut end_s = until_s;
            let mut demand = [0.0; 3];
            for (part, &delay_s) in self.delay_s.iter().enumerate() {
                // The first order that does not act on this part yet.
                let mut later = *next;
                while later < orders.len() && orders[later].from_s + delay_s <= at_s {
                    later += 1;
                }
                if let Some(order) = orders.get(later) {
                    end_s = end_s.min(order.from_s + delay_s);
                }
                if 0 < later {
                    let order = &orders[later - 1];
                    if self.shape().is_turning() {
                        demand[part] = order.demand[part];
                    } else if part == 0 {
                        demand = order.demand;
                    }
                }
            }
            self.hold(robot, demand, at_s, end_s - at_s, surroundings);
            at_s = end_s;
        }
    }

    /// What the actuators come to where a command asks for `demand` for long.
    #[must_use]
    pub fn target(&self, demand: Drive) -> Drive {
        let shape = self.shape();
        self.effects
            .iter()
            .fold(self.body.cap(demand), |demand, effect| effect.shape(shape, demand))
    }

    /// Advances a robot by `dt_s` under one demand.
    fn hold(
        &self,
        robot: &mut Robot,
        demand: Drive,
        from_s: f64,
        dt_s: f64,
        surroundings: &Surroundings<'_>,
    ) {
        if self.is_inertial() {
            return self.push(robot, demand, from_s, dt_s, surroundings);
        }
        let target = self.target(demand);
        let turning = self.shape().is_turning();
        let longest_s = match (self.varies, turning) {
            (true, _) => self.steps.local_s,
            (false, true) => self.steps.turning_s,
            (false, false) => f64::INFINITY,
        };
        let is_steady = robot.drive == target || self.response == [Response::INSTANT; 2];
        let n =
            if is_steady && !self.varies { 1 } else { (dt_s / longest_s).ceil().max(1.0) as usize };
        let h_s = dt_s / n as f64;
        for step in 0..n {
            let mean = self.respond(&mut robot.drive, target, h_s);
            let time_s = from_s + (step as f64 + 0.5) * h_s;
            if turning {
                self.turn(robot, mean, time_s, h_s, surroundings);
            } else {
                self.shift(robot, mean, time_s, h_s, surroundings);
            }
        }
    }

    /// Advances a robot that keeps its velocity by `dt_s`, asked for an acceleration (m/s²).
    fn push(
        &self,
        robot: &mut Robot,
        asked_mps2: [f64; 3],
        from_s: f64,
        dt_s: f64,
        surroundings: &Surroundings<'_>,
    ) {
        let body = self.body.inertial().expect("it keeps its velocity");
        let Response { lag_s, limit } = self.response[0];
        let asked_mps2 = body.limited(within(asked_mps2, limit));
        let lag_s = lag_s + body.lag_s();
        let longest_s = if self.varies { self.steps.local_s } else { f64::INFINITY };
        let n = (dt_s / longest_s).ceil().max(1.0) as usize;
        let h_s = dt_s / n as f64;
        for step in 0..n {
            let mut push = Push { velocity_mps: robot.drive, acceleration_mps2: robot.push_mps2 };
            let mean_mps = push.advance(asked_mps2, lag_s, h_s);
            let time_s = from_s + (step as f64 + 0.5) * h_s;
            self.shift(robot, mean_mps, time_s, h_s, surroundings);
            robot.drive = push.velocity_mps;
            robot.push_mps2 = push.acceleration_mps2;
        }
    }

    /// Lets the actuators follow for `h_s` and returns their mean over that time.
    fn respond(&self, drive: &mut Drive, target: Drive, h_s: f64) -> Drive {
        let mut mean = target;
        let mut follow = |parts: std::ops::Range<usize>, response: Response| {
            let missing: Drive = std::array::from_fn(|index| target[index] - drive[index]);
            let norm = libm::sqrt(missing[parts.clone()].iter().map(|part| part * part).sum());
            if response == Response::INSTANT || norm == 0.0 {
                drive[parts.clone()].copy_from_slice(&target[parts]);
                return;
            }
            let (left, integral) = response.remaining(norm, h_s);
            for index in parts {
                let direction = missing[index] / norm;
                mean[index] = target[index] - direction * integral / h_s;
                drive[index] = target[index] - direction * left;
            }
        };
        if self.shape().is_turning() {
            follow(0..1, self.response[0]);
            follow(1..2, self.response[1]);
        } else {
            follow(0..3, self.response[0]);
        }
        mean
    }

    /// Moves a point mass for `h_s` with a mean velocity (m/s) of its own.
    fn shift(
        &self,
        robot: &mut Robot,
        velocity_mps: [f64; 3],
        time_s: f64,
        h_s: f64,
        surroundings: &Surroundings<'_>,
    ) {
        let over_ground = self.over_ground(robot, velocity_mps, time_s, h_s, surroundings);
        for (position, velocity) in robot.position_m.iter_mut().zip(over_ground) {
            *position += velocity * h_s;
        }
    }

    /// Moves a turning body for `h_s` along the arc of a mean speed and turn.
    fn turn(
        &self,
        robot: &mut Robot,
        [speed_mps, turn, _]: Drive,
        time_s: f64,
        h_s: f64,
        surroundings: &Surroundings<'_>,
    ) {
        let yaw_rate_radps = self.body.yaw_rate_radps(speed_mps, turn);
        let half_rad = 0.5 * yaw_rate_radps * h_s;
        // The chord of an arc is shorter than the arc.
        let chord = if half_rad.abs() < 1e-4 {
            1.0 - half_rad * half_rad / 6.0
        } else {
            libm::sin(half_rad) / half_rad
        };
        let (sin, cos) = libm::sincos(robot.heading_rad + half_rad + self.course_rad);
        let along_mps = speed_mps * chord;
        let sideways_mps = self.sideways_s * yaw_rate_radps * along_mps;
        let velocity_mps =
            [along_mps * cos - sideways_mps * sin, along_mps * sin + sideways_mps * cos, 0.0];
        self.shift(robot, velocity_mps, time_s, h_s, surroundings);
        robot.heading_rad += 2.0 * half_rad;
    }

    /// The velocity (m/s) over ground where the robot's own is `velocity_mps`: with the ground's and the air's part, both
    /// taken half way.
    fn over_ground(
        &self,
        robot: &Robot,
        velocity_mps: [f64; 3],
        time_s: f64,
        h_s: f64,
        surroundings: &Surroundings<'_>,
    ) -> [f64; 3] {
        if !self.drifts {
            return velocity_mps;
        }
        let ahead = |share: f64| -> [f64; 3] {
            std::array::from_fn(|i| robot.position_m[i] + velocity_mps[i] * h_s * share)
        };
        let scale: f64 = self
            .effects
            .iter()
            .map(|effect| effect.ground_scale(robot.position_m, ahead(1.0)))
            .product();
        let mut over_ground = velocity_mps.map(|velocity| velocity * scale);
        let situation = Situation {
            time_s,
            position_m: ahead(0.5 * scale),
            velocity_mps,
            heading_rad: robot.heading_rad,
            surroundings,
        };
        for effect in &self.effects {
            let drift_mps = effect.drift_mps(&situation);
            for (velocity, drift) in over_ground.iter_mut().zip(drift_mps) {
                *velocity += drift;
            }
        }
        over_ground
    }
}

#[cfg(test)]
mod tests;
