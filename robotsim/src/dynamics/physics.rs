//! One robot from one moment to another, under its commands: the one piece of code that runs use and fits use.

use super::body::{Body, Drive, Part};
use super::effect::only::{Limits, Moment};
use super::effect::{Effect, Situation};
use super::forces::Hanging;
use super::inertial::{Push, within};
use super::norm;
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
    /// How a body that keeps its velocity is accelerated by its actuators (m/s²).
    pub push_mps2: [f64; 3],
    /// How its load hangs, where it has one on a cable.
    pub load: Hanging,
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
    /// All effects together.
    all: Acting,
    /// Some effects act on some robots or at some times only.
    is_limited: bool,
    /// They may begin or cease to act at any time.
    limits_vary: bool,
    steps: Steps,
}

/// What effects that act at a moment come to together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Acting {
    /// By place in the list of effects.
    bits: u64,
    delay_s: [f64; 2],
    response: [Response; 2],
    course_rad: f64,
    sideways_s: f64,
    slowdown_s: f64,
    /// Roll and pitch of the thrust beside the attitude.
    pub(super) tilt_rad: [f64; 2],
    varies: bool,
    /// The effect, by its place in the list, that alone makes motion vary on the way, where robots go nowhere but by themselves.
    alone: Option<usize>,
    /// The same of bodies that keep their velocity.
    pub(super) force_varies: bool,
}

/// So many effects, the first ones, may be limited to some robots or times.
pub(super) const MOST_LIMITED: usize = 64;

impl Acting {
    /// Those whose bits are set.
    fn new(effects: &[Box<dyn Effect>], bits: u64) -> Self {
        let parts = [Part::Speed, Part::Turn];
        let acting = || effects.iter().enumerate().filter(|(place, _)| has(bits, *place));
        let sum = |value: &dyn Fn(&dyn Effect) -> f64| {
            acting().map(|(_, effect)| value(&**effect)).sum::<f64>()
        };
        let response = |part| Response {
            lag_s: sum(&|effect| effect.lag_s(part)),
            limit: acting()
                .map(|(_, effect)| effect.limit_per_s(part))
                .fold(f64::INFINITY, f64::min),
        };
        let mut varying = acting().filter(|(_, effect)| effect.varies_on_the_way());
        let alone = varying.next().filter(|_| varying.next().is_none()).map(|(place, _)| place);
        let sideways_s = sum(&|effect| effect.sideways_s());
        let drifts = acting().any(|(_, effect)| effect.drifts());
        Self {
            bits,
            alone: alone.filter(|_| !drifts && sideways_s == 0.0),
            delay_s: parts.map(|part| sum(&|effect| effect.delay_s(part))),
            response: parts.map(response),
            course_rad: sum(&|effect| effect.course_rad()),
            sideways_s,
            slowdown_s: sum(&|effect| effect.slowdown_s()),
            tilt_rad: [0, 1].map(|axis| sum(&|effect| effect.tilt_rad()[axis])),
            varies: acting().any(|(_, effect)| effect.varies_on_the_way()),
            force_varies: acting().any(|(_, effect)| effect.force_varies()),
        }
    }

    /// Whether the effect at this place acts.
    #[inline]
    pub(super) fn has(&self, place: usize) -> bool {
        has(self.bits, place)
    }
}

/// Whether the effect at a place acts. Those beyond [`MOST_LIMITED`] always do.
#[inline]
fn has(bits: u64, place: usize) -> bool {
    MOST_LIMITED <= place || bits >> place & 1 == 1
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
    /// Where forces on a body that keeps its velocity depend on its motion (s).
    force_s: f64,
    /// Whether steps are short only near places where motion changes.
    are_adaptive: bool,
}

const STEPS: Steps = Steps { turning_s: 0.025, local_s: 0.01, force_s: 0.01, are_adaptive: false };
/// In fits, which compare motion with noisy positions. Steps are of second order: the period of a load that swings with 5 rad/s changes by
/// less than a thousandth.
const FIT_STEPS: Steps = Steps { force_s: 0.025, are_adaptive: true, ..STEPS };

impl Physics {
    pub(super) fn new(body: Body, effects: Vec<Box<dyn Effect>>) -> Self {
        let limits = || effects.iter().filter_map(|effect| effect.limits());
        Self {
            all: Acting::new(&effects, u64::MAX),
            is_limited: limits().next().is_some(),
            limits_vary: limits().any(Limits::vary_on_the_way),
            steps: STEPS,
            body,
            effects,
        }
    }

    /// The same with longer steps, for fits to measured motion.
    #[must_use]
    pub fn in_fits(self) -> Self {
        Self { steps: FIT_STEPS, ..self }
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
        self.all.delay_s[0].max(self.all.delay_s[1])
    }

    /// After how long (s) what actuators did before has no influence any more: the delay, and 5 time constants.
    #[must_use]
    pub fn memory_s(&self) -> f64 {
        let [speed, turn] = self.all.response;
        self.delay_s() + 5.0 * speed.lag_s.max(turn.lag_s)
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
        let is_turned = self.shape().is_turning() && drifts();
        // How fast a body goes that keeps its velocity, its commands do not say.
        !(self.all.varies || self.limits_vary || is_turned || self.is_inertial())
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
    pub(super) fn follow(
        &self,
        velocity_mps: [f64; 3],
        robot: &Robot,
        [from_s, dt_s]: [f64; 2],
        surroundings: &Surroundings<'_>,
    ) -> Drive {
        match self.body.inertial() {
            Some(body) => {
                let target_mps = self.target_at(velocity_mps, robot, from_s, surroundings);
                body.towards(target_mps, robot.drive, dt_s)
            }
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
            let limited;
            let mut acting = &self.all;
            if self.is_limited {
                let later = orders.partition_point(|order| order.from_s <= at_s);
                let command = later.checked_sub(1).map_or([0.0; 3], |last| orders[last].demand);
                limited = self.acting(robot, command, at_s, surroundings);
                acting = &limited;
                let next_order_s = orders.get(later).map_or(f64::INFINITY, |order| order.from_s);
                end_s = end_s.min(next_order_s).min(self.next_change_s(at_s));
            }
            for (part, &delay_s) in acting.delay_s.iter().enumerate() {
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
            self.hold(robot, acting, demand, at_s, end_s - at_s, surroundings);
            at_s = end_s;
        }
    }

    /// The effects that act on a robot at a moment, of which this is the last command.
    fn acting(
        &self,
        robot: &Robot,
        command: Drive,
        time_s: f64,
        surroundings: &Surroundings<'_>,
    ) -> Acting {
        let velocity_mps = if self.shape().is_turning() {
            let (sin, cos) = libm::sincos(robot.heading_rad);
            [robot.drive[0] * cos, robot.drive[0] * sin, 0.0]
        } else {
            robot.drive
        };
        let at = Situation {
            time_s,
            position_m: robot.position_m,
            velocity_mps,
            heading_rad: robot.heading_rad,
            surroundings,
        };
        let command = (!self.is_inertial()).then_some(command);
        let moment = Moment { at, shape: self.shape(), command };
        let mut bits = u64::MAX;
        for (place, effect) in self.effects.iter().enumerate().take(MOST_LIMITED) {
            if effect.limits().is_some_and(|limits| !limits.allow(&moment)) {
                bits &= !(1 << place);
            }
        }
        Acting::new(&self.effects, bits)
    }

    /// Up to when (s) the effects that act at `time_s` are taken to act.
    fn next_change_s(&self, time_s: f64) -> f64 {
        let limits = self.effects.iter().filter_map(|effect| effect.limits());
        let change_s =
            limits.map(|limits| limits.next_change_s(time_s)).fold(f64::INFINITY, f64::min);
        if self.limits_vary { change_s.min(time_s + self.steps.local_s) } else { change_s }
    }

    /// What the actuators of a robot come to where a command at `time_s` asks for `demand` for long.
    #[must_use]
    pub fn target_at(
        &self,
        demand: Drive,
        robot: &Robot,
        time_s: f64,
        surroundings: &Surroundings<'_>,
    ) -> Drive {
        if self.is_limited {
            self.target(&self.acting(robot, demand, time_s, surroundings), demand)
        } else {
            self.target(&self.all, demand)
        }
    }

    /// How fast (m/s) a body may be that is asked for this velocity (m/s), whichever effects act.
    pub(super) fn most_mps(&self, velocity_mps: [f64; 3]) -> f64 {
        if !self.is_limited {
            return norm(self.target(&self.all, velocity_mps));
        }
        let capped = self.body.cap(velocity_mps);
        let own_mps = norm(capped);
        if own_mps == 0.0 {
            return 0.0;
        }
        let shaped = self.effects.iter().map(|effect| effect.shape(self.shape(), capped));
        own_mps * shaped.map(|shaped| (norm(shaped) / own_mps).max(1.0)).product::<f64>()
    }

    /// Whether the effect at this place of the list acts on a robot that has this velocity (m/s).
    pub(super) fn acts(&self, place: usize, at: &Situation<'_>) -> bool {
        let moment = Moment { at: *at, shape: self.shape(), command: None };
        self.effects[place].limits().is_none_or(|limits| limits.allow(&moment))
    }

    fn target(&self, acting: &Acting, demand: Drive) -> Drive {
        let shape = self.shape();
        let mut demand = self.body.cap(demand);
        for (place, effect) in self.effects.iter().enumerate() {
            if acting.has(place) {
                demand = effect.shape(shape, demand);
            }
        }
        demand
    }

    /// Advances a robot by `dt_s` under one demand.
    fn hold(
        &self,
        robot: &mut Robot,
        acting: &Acting,
        demand: Drive,
        from_s: f64,
        dt_s: f64,
        surroundings: &Surroundings<'_>,
    ) {
        if self.is_inertial() {
            return self.push(robot, acting, demand, from_s, dt_s, surroundings);
        }
        let target = self.target(acting, demand);
        let turning = self.shape().is_turning();
        let varies = acting.varies
            && !(self.steps.are_adaptive && self.is_uniform(robot, acting, target, dt_s));
        let longest_s = match (varies, turning) {
            (true, _) => self.steps.local_s,
            (false, true) => self.steps.turning_s,
            (false, false) => f64::INFINITY,
        };
        let is_steady = robot.drive == target || acting.response == [Response::INSTANT; 2];
        let n = if is_steady && !varies { 1 } else { (dt_s / longest_s).ceil().max(1.0) as usize };
        let h_s = dt_s / n as f64;
        for step in 0..n {
            let mean = self.respond(acting, &mut robot.drive, target, h_s);
            let time_s = from_s + (step as f64 + 0.5) * h_s;
            if turning {
                self.turn(robot, acting, mean, time_s, h_s, surroundings);
            } else {
                self.shift(robot, acting, mean, time_s, h_s, surroundings);
            }
        }
    }

    /// Whether what acts is the same wherever a robot may come within `dt_s`, with actuators that go from what they do to a target.
    fn is_uniform(&self, robot: &Robot, acting: &Acting, target: Drive, dt_s: f64) -> bool {
        let speed_mps =
            |drive: Drive| if self.shape().is_turning() { drive[0].abs() } else { norm(drive) };
        let reach_m = speed_mps(robot.drive).max(speed_mps(target)) * dt_s;
        acting.alone.is_some_and(|place| self.effects[place].is_uniform(robot.position_m, reach_m))
    }

    /// Advances a robot that keeps its velocity by `dt_s`, asked for an acceleration (m/s²).
    fn push(
        &self,
        robot: &mut Robot,
        acting: &Acting,
        asked_mps2: [f64; 3],
        from_s: f64,
        dt_s: f64,
        surroundings: &Surroundings<'_>,
    ) {
        let body = self.body.inertial().expect("it keeps its velocity");
        let Response { lag_s, limit } = acting.response[0];
        let asked_mps2 = body.limited(within(asked_mps2, limit));
        let lag_s = lag_s + body.lag_s();
        let longest_s = if acting.force_varies { self.steps.force_s } else { f64::INFINITY };
        let n = (dt_s / longest_s).ceil().max(1.0) as usize;
        let h_s = dt_s / n as f64;
        for step in 0..n {
            let mut push = Push { velocity_mps: robot.drive, acceleration_mps2: robot.push_mps2 };
            let mut mean_mps = push.advance(asked_mps2, lag_s, h_s);
            let time_s = from_s + (step as f64 + 0.5) * h_s;
            let free = (&mut push, &mut mean_mps);
            self.act(robot, acting, free, [time_s, h_s], surroundings);
            self.shift(robot, acting, mean_mps, time_s, h_s, surroundings);
            robot.drive = push.velocity_mps;
            robot.push_mps2 = push.acceleration_mps2;
        }
    }

    /// Lets the actuators follow for `h_s` and returns their mean over that time.
    fn respond(&self, acting: &Acting, drive: &mut Drive, target: Drive, h_s: f64) -> Drive {
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
            follow(0..1, acting.response[0]);
            follow(1..2, acting.response[1]);
        } else {
            follow(0..3, acting.response[0]);
        }
        mean
    }

    /// Moves a point mass for `h_s` with a mean velocity (m/s) of its own.
    fn shift(
        &self,
        robot: &mut Robot,
        acting: &Acting,
        velocity_mps: [f64; 3],
        time_s: f64,
        h_s: f64,
        surroundings: &Surroundings<'_>,
    ) {
        let over_ground = self.over_ground(robot, acting, velocity_mps, time_s, h_s, surroundings);
        for (position, velocity) in robot.position_m.iter_mut().zip(over_ground) {
            *position += velocity * h_s;
        }
    }

    /// Moves a turning body for `h_s` along the arc of a mean speed and turn.
    fn turn(
        &self,
        robot: &mut Robot,
        acting: &Acting,
        [speed_mps, turn, _]: Drive,
        time_s: f64,
        h_s: f64,
        surroundings: &Surroundings<'_>,
    ) {
        let mut speed_mps = speed_mps;
        let mut yaw_rate_radps = self.body.yaw_rate_radps(speed_mps, turn);
        if acting.slowdown_s != 0.0 {
            speed_mps *= (1.0 - acting.slowdown_s * yaw_rate_radps.abs()).max(0.0);
            yaw_rate_radps = self.body.yaw_rate_radps(speed_mps, turn);
        }
        let half_rad = 0.5 * yaw_rate_radps * h_s;
        // The chord of an arc is shorter than the arc.
        let chord = if half_rad.abs() < 1e-4 {
            1.0 - half_rad * half_rad / 6.0
        } else {
            libm::sin(half_rad) / half_rad
        };
        let (sin, cos) = libm::sincos(robot.heading_rad + half_rad + acting.course_rad);
        let along_mps = speed_mps * chord;
        let sideways_mps = acting.sideways_s * yaw_rate_radps * along_mps;
        let velocity_mps =
            [along_mps * cos - sideways_mps * sin, along_mps * sin + sideways_mps * cos, 0.0];
        self.shift(robot, acting, velocity_mps, time_s, h_s, surroundings);
        robot.heading_rad += 2.0 * half_rad;
    }

    /// The velocity (m/s) over ground where the robot's own is `velocity_mps`: with the ground's and the air's part, both
    /// taken half way.
    fn over_ground(
        &self,
        robot: &Robot,
        acting: &Acting,
        velocity_mps: [f64; 3],
        time_s: f64,
        h_s: f64,
        surroundings: &Surroundings<'_>,
    ) -> [f64; 3] {
        if self.effects.is_empty() {
            return velocity_mps;
        }
        let ahead = |share: f64| -> [f64; 3] {
            std::array::from_fn(|i| robot.position_m[i] + velocity_mps[i] * h_s * share)
        };
        let effects = || {
            let all = self.effects.iter().enumerate();
            all.filter(|(place, _)| acting.has(*place)).map(|(_, effect)| effect)
        };
        let scale: f64 =
            effects().map(|effect| effect.ground_scale(robot.position_m, ahead(1.0))).product();
        let mut over_ground = velocity_mps.map(|velocity| velocity * scale);
        let situation = Situation {
            time_s,
            position_m: ahead(0.5 * scale),
            velocity_mps,
            heading_rad: robot.heading_rad,
            surroundings,
        };
        // Bodies that keep their velocity are pushed instead.
        for effect in effects().filter(|_| !self.is_inertial()) {
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
