//! From command to motion.
//!
//! A command is a velocity, or an acceleration. The body turns it into motion, by way of the effects of real robots (lag, slip, drift, …) that
//! `[[robotsim.dynamics.effect]]` lists. [`physics`] advances one robot under its commands, in runs and in fits alike;
//! [`fleet`] advances the swarm. A bare point mass has the commanded velocity at once, and its position follows exactly, since
//! that velocity holds over the whole control period: x += v Δt.

mod body;
pub(crate) mod contacts;
pub mod effect;
pub mod fleet;
mod forces;
mod inertial;
pub mod physics;
mod point_mass;
mod response;
mod rigid;
pub mod surroundings;

pub use body::{Drive, Part, Shape, wrapped};
pub use inertial::{GRAVITY_MPS2, thrust_direction};
pub use response::Response;

use crate::obstacles::Course;
use body::Body;
use effect::{Localization, Situation};
use physics::{Order, Physics, Robot};
use point_mass::Cap;
use proto::config::{Problem, Registry, Section, TableSpec, join};
use proto::ids::AgentId;
use proto::site::Site;
use proto::time::SimTime;
use proto::types::AgentStates;
use serde::{Deserialize, Serialize};
use surroundings::Surroundings;

/// Length of a vector.
pub(crate) fn norm(vector: [f64; 3]) -> f64 {
    libm::sqrt(vector.iter().map(|part| part * part).sum())
}

/// What a controller asks of a robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Move with this velocity (m/s).
    Velocity([f64; 3]),
    /// Accelerate like this (m/s²). Bodies that do not keep their velocity come to that velocity which they would have at the
    /// end of the period.
    Acceleration([f64; 3]),
    /// Be displaced by this (m), at once and without limit. No robot can: it is for workloads, not for physics.
    Jump([f64; 3]),
}

/// Description of `[robotsim.dynamics]`.
pub const SPEC: TableSpec = Keys::SPEC;

/// The dynamics of the robots: how they execute commands.
#[derive(Section)]
struct Keys {
    /// Maximum speed (m/s). Default: the BotNet paper's.
    #[key(above = 0.0, most = 1e4, default = 30.0)]
    #[expect(dead_code, reason = "bodies inherit it")]
    speed_cap_mps: f64,
    /// What the speed cap of a point mass limits.
    #[key(default = Cap::Norm)]
    #[expect(dead_code, reason = "bodies inherit it")]
    cap: Cap,
    /// Physical effects between command and motion; `murmuration effects` lists them.
    #[key(tables = effect::SPEC)]
    effect: Vec<toml::Table>,
    /// The body.
    #[key(tag, default = "point-mass")]
    kind: Option<Body>,
}

/// Accuracy of the robots' measured positions. The effect localization adds to it.
#[derive(Section)]
pub(crate) struct Measured {
    /// Standard deviation of the noise of measured positions, per component of the plane (m). Absent: 0 in a run; estimated when the
    /// model is compared with measurements.
    #[key(range = 0.0..=1e4)]
    pub(crate) sd_m: Option<f64>,
}

/// Whether a checked table is of a body whose contacts are its own.
pub(crate) fn is_rigid(table: &toml::Table) -> bool {
    matches!(Keys::read(table).kind, Some(Body::RigidBody(_)))
}

/// How robots of one kind move.
#[derive(Debug)]
pub struct Dynamics {
    physics: Physics,
    localization: Option<Localization>,
    /// Those that act on some robots or at some times only, with their places in the list of effects.
    limited: Vec<(usize, Localization)>,
}

/// What one robot carries from step to step where effects reach back in time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Memory {
    drive: Drive,
    /// How bodies that keep their velocity are accelerated (m/s²).
    push_mps2: [f64; 3],
    /// How the load below it hangs.
    load: forces::Hanging,
    /// How a rigid body spins (rad/s), counter-clockwise.
    spin_radps: f64,
    /// Commands that may still have to act, oldest first.
    orders: Vec<Order>,
    /// Where it was, oldest first, as long as positions are measured late.
    track: Vec<(f64, [f64; 3])>,
}

/// A step, and what is around the robots then.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    /// When it begins.
    pub from: SimTime,
    /// When it ends.
    pub until: SimTime,
    /// The place: its ground, walls and obstacles.
    pub site: &'a Site,
    /// How obstacles of the place move.
    pub courses: &'a [Course],
    /// Seed of gusts and of noise.
    pub seed: u64,
}

/// What a robot does during a step.
#[derive(Clone, Copy, Debug)]
enum Motion {
    /// Its body follows its orders, of which this is the last.
    Body(Drive),
    /// It is displaced by this (m).
    Jump([f64; 3]),
    /// It has this velocity (m/s).
    Velocity([f64; 3]),
}

impl Dynamics {
    /// From a checked table that stands at `path`. `known`: what effects there are.
    pub fn build(
        table: &toml::Table,
        path: &str,
        known: &Registry<effect::Entry>,
        problems: &mut Vec<Problem>,
    ) -> Option<Self> {
        let keys = Keys::read(table);
        let body = keys.kind?;
        let effects = effect::build(&keys.effect, &join(path, "effect"), known, problems);
        let (mut localization, mut lags, mut limited) = (None, [false; 2], Vec::new());
        for (index, effect) in effects.iter().enumerate() {
            let place = format!("{}[{index}]", join(path, "effect"));
            if let Some(limits) = effect.limits() {
                let name = limits.unknown_to(body.shape(), body.inertial().is_some());
                problems.extend(name.map(|name| {
                    let message = format!(
                        "must not use {name}, which this kind of body does not have; use the names of the effect formula"
                    );
                    Problem::new(format!("{place}.only.where"), message)
                }));
                if physics::MOST_LIMITED <= index {
                    let message = format!(
                        "must be absent from all effects but the first {}",
                        physics::MOST_LIMITED
                    );
                    problems.push(Problem::new(format!("{place}.only"), message));
                }
                // Several may be limited to different robots or times.
                limited.extend(effect.localization().map(|given| (index, given)));
                continue;
            }
            if let Some(given) = effect.localization()
                && localization.replace(given).is_some()
            {
                problems.push(Problem::new(
                    &*place,
                    "must occur only once: positions are measured once",
                ));
            }
            for (part, lagging) in [Part::Speed, Part::Turn].into_iter().zip(&mut lags) {
                if 0.0 < effect.lag_s(part) && std::mem::replace(lagging, true) {
                    problems.push(Problem::new(
                        &*place,
                        "must occur only once per actuator; change the time constant of the first one",
                    ));
                }
            }
        }
        effect::check_loads(&effects, &join(path, "effect"), problems);
        Some(Self { physics: Physics::new(body, effects), localization, limited })
    }

    /// How the position of a robot is measured, if anything is wrong with it. Of effects that act on some robots or at some times
    /// only, the last one that acts decides.
    fn localization_at(
        &self,
        agent: AgentId,
        time_s: f64,
        states: &AgentStates,
    ) -> Option<Localization> {
        let surroundings = Surroundings { agent, ..Surroundings::default() };
        let agent = agent.index();
        let at = Situation {
            time_s,
            position_m: states.position_m(agent),
            velocity_mps: [states.vx_mps[agent], states.vy_mps[agent], states.vz_mps[agent]],
            heading_rad: states.heading_rad.get(agent).copied().unwrap_or(0.0),
            surroundings: &surroundings,
        };
        let last = self.limited.iter().rev().find(|(place, _)| self.physics.acts(*place, &at));
        last.map(|&(_, localization)| localization).or(self.localization)
    }

    /// Whether positions may be measured wrongly.
    fn has_localization(&self) -> bool {
        self.localization.is_some() || !self.limited.is_empty()
    }

    /// Adds noise (standard deviation in m) to how positions are measured.
    #[must_use]
    pub(crate) fn with_noise(mut self, sd_m: f64) -> Self {
        if 0.0 < sd_m {
            self.localization.get_or_insert(Localization::PERFECT);
            let limited = self.limited.iter_mut().map(|(_, localization)| localization);
            for localization in limited.chain(&mut self.localization) {
                localization.sd_m = libm::hypot(localization.sd_m, sd_m);
            }
        }
        self
    }

    /// Whether it faces somewhere by itself.
    pub(crate) fn has_heading(&self) -> bool {
        self.physics.shape().is_turning() || self.is_rigid()
    }

    /// Whether its contacts are those of a rigid body.
    pub(crate) fn is_rigid(&self) -> bool {
        self.physics.rigid().is_some()
    }

    /// The body and its effects, for fits.
    #[must_use]
    pub fn into_physics(self) -> Physics {
        self.physics
    }

    /// The greatest speed that the limit allows (m/s).
    #[must_use]
    pub fn speed_cap_mps(&self) -> f64 {
        self.physics.body().speed_cap_mps()
    }

    /// What a command that is given at `from_s` for `dt_s` makes a robot do.
    fn take_up(
        &self,
        command: Command,
        from_s: f64,
        dt_s: f64,
        surroundings: &Surroundings<'_>,
        states: &AgentStates,
        memory: &mut [Memory],
    ) -> Motion {
        let agent = surroundings.agent.index();
        let inertial = self.physics.is_inertial();
        let is_plain = self.physics.is_bare() && !self.physics.shape().is_turning() && !inertial;
        let command = match command {
            Command::Acceleration(acceleration_mps2) if !inertial => {
                let own_mps = [states.vx_mps[agent], states.vy_mps[agent], states.vz_mps[agent]];
                Command::Velocity(std::array::from_fn(|i| own_mps[i] + acceleration_mps2[i] * dt_s))
            }
            command => command,
        };
        let demand = match command {
            Command::Jump(displacement) => return Motion::Jump(displacement),
            Command::Velocity(velocity) if is_plain => {
                return Motion::Velocity(self.physics.body().cap(velocity));
            }
            Command::Velocity(velocity) => {
                let heading_rad = states.heading_rad.get(agent).copied().unwrap_or(0.0);
                let drive = memory.get(agent).map_or([0.0; 3], |memory| memory.drive);
                let position_m = states.position_m(agent);
                let robot = Robot { position_m, heading_rad, drive, ..Robot::default() };
                self.physics.follow(velocity, &robot, [from_s, dt_s], surroundings)
            }
            Command::Acceleration(asked) => asked,
        };
        if let Some(memory) = memory.get_mut(agent) {
            memory.order(from_s, demand, self.physics.delay_s());
        }
        Motion::Body(demand)
    }

    /// Moves a robot on and returns by how much (m) it would go.
    fn go(
        &self,
        agent: AgentId,
        motion: Motion,
        [from_s, until_s]: [f64; 2],
        surroundings: &Surroundings<'_>,
        states: &mut AgentStates,
        memory: &mut [Memory],
    ) -> [f64; 3] {
        let dt_s = until_s - from_s;
        let demand = match motion {
            Motion::Jump(displacement) => return displacement,
            Motion::Velocity(velocity) => return velocity.map(|component| component * dt_s),
            Motion::Body(demand) => demand,
        };
        let agent = agent.index();
        let mut bare = Memory::default();
        let memory = memory.get_mut(agent).unwrap_or(&mut bare);
        if memory.orders.is_empty() {
            memory.orders.push(Order { from_s, demand });
        }
        let before_m = states.position_m(agent);
        let mut robot = Robot {
            position_m: before_m,
            heading_rad: states.heading_rad.get(agent).copied().unwrap_or(0.0),
            drive: memory.drive,
            push_mps2: memory.push_mps2,
            load: memory.load,
        };
        let orders = &memory.orders;
        self.physics.advance(&mut robot, orders, &mut 0, from_s, until_s, surroundings);
        memory.drive = robot.drive;
        memory.push_mps2 = robot.push_mps2;
        memory.load = robot.load;
        if self.physics.shape().is_turning() {
            states.heading_rad[agent] = wrapped(robot.heading_rad);
        }
        std::array::from_fn(|i| robot.position_m[i] - before_m[i])
    }
}

impl Memory {
    /// Adds a command, and forgets those that the next one has replaced everywhere.
    fn order(&mut self, from_s: f64, demand: Drive, delay_s: f64) {
        self.orders.push(Order { from_s, demand });
        let old = self.orders.iter().skip(1).take_while(|next| next.from_s + delay_s <= from_s);
        let n = old.count();
        self.orders.drain(..n);
    }

    /// Where it was at a time: between two known places on the straight line, before the first one there. Forgets what is
    /// older.
    fn position_m(&mut self, at_s: f64) -> [f64; 3] {
        let n = self.track.iter().skip(1).take_while(|(time_s, _)| *time_s <= at_s).count();
        self.track.drain(..n);
        let (from_s, from_m) = self.track[0];
        match self.track.get(1) {
            Some(&(to_s, to_m)) if from_s < at_s => {
                let share = (at_s - from_s) / (to_s - from_s);
                std::array::from_fn(|i| from_m[i] + share * (to_m[i] - from_m[i]))
            }
            _ => from_m,
        }
    }
}
