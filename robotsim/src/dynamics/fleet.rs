//! All robots of a swarm, whatever their kinds, moved together.

mod in_contact;
mod rigid_world;

use super::contacts::Contacts;
use super::effect::Localization;
use super::rigid::RigidBody;
use super::surroundings::{Other, Surroundings, all_but};
use super::{Command, Dynamics, Memory, Motion, Step};
use proto::ids::AgentId;
use proto::rng::{Draws, Purpose};
use proto::types::AgentStates;
use rigid_world::Pusher;

/// The robots of a swarm: kind after kind, each with a number of robots.
#[derive(Debug)]
pub struct Fleet {
    /// For each kind, the number of its last robot plus 1, and how it moves.
    kinds: Vec<(usize, Dynamics)>,
    /// Of robots that are not rigid bodies.
    pub(super) contacts: Option<Contacts>,
    /// Diameter (m) of those.
    diameter_m: f64,
}

impl Fleet {
    /// Robots of these numbers and kinds, numbered kind after kind. Contacts are resolved where there are rules for them; rigid
    /// bodies have their own, for which other robots are of this diameter (m).
    #[must_use]
    pub(crate) fn new(
        kinds: impl IntoIterator<Item = (usize, Dynamics)>,
        contacts: Option<Contacts>,
        diameter_m: f64,
    ) -> Self {
        let mut end = 0;
        let numbered = kinds.into_iter().map(|(count, dynamics)| {
            end += count;
            (end, dynamics)
        });
        Self { kinds: numbered.collect(), contacts, diameter_m }
    }

    /// How a robot moves.
    pub(super) fn dynamics(&self, agent: AgentId) -> &Dynamics {
        let kind = self.kinds.partition_point(|(end, _)| *end <= agent.index());
        &self.kinds[kind].1
    }

    /// Those that are there and are not rigid bodies.
    pub(super) fn alive_bodies<'a>(
        &'a self,
        states: &'a AgentStates,
    ) -> impl Iterator<Item = AgentId> + 'a {
        alive(states).filter(|&agent| !self.dynamics(agent).is_rigid())
    }

    fn any(&self, mut has: impl FnMut(&Dynamics) -> bool) -> bool {
        self.kinds.iter().any(|(_, dynamics)| has(dynamics))
    }

    /// The rules by which robots that begin in each other or in something solid are put apart.
    pub(super) fn room(&self) -> Option<Contacts> {
        if !self.any(Dynamics::is_rigid) {
            return self.contacts;
        }
        let diameters = self.kinds.iter().map(|(_, dynamics)| {
            dynamics.physics.rigid().map_or(self.diameter_m, RigidBody::diameter_m)
        });
        Some(Contacts::inelastic(diameters.fold(0.0, f64::max)))
    }

    /// What robots at rest carry. Nothing, where nothing reaches back in time.
    #[must_use]
    pub fn memory(&self, n_agents: usize) -> Vec<Memory> {
        let is_needed = self.any(|dynamics| {
            let physics = &dynamics.physics;
            !physics.is_bare() || physics.is_inertial() || dynamics.has_localization()
        });
        if is_needed { vec![Memory::default(); n_agents] } else { Vec::new() }
    }

    /// Whether robots keep the heights at which they begin if they are commanded in the plane: nothing lifts or lowers them.
    #[must_use]
    pub fn keeps_heights(&self) -> bool {
        !self.any(|dynamics| !dynamics.physics.is_bare() || dynamics.physics.is_inertial())
    }

    /// Gives robots a heading where a body needs one: east, where the scenario says nothing.
    pub fn complete(&self, states: &mut AgentStates) {
        let is_needed = self.any(|dynamics| dynamics.has_heading());
        if is_needed && states.heading_rad.is_empty() {
            states.heading_rad = vec![0.0; states.len()];
        }
    }

    /// Moves every agent that is alive. Velocities become those the robots had on the mean.
    ///
    /// Bodies that do not turn have a direction only where the scenario or another kind of robot brings one: they face where
    /// they move, and at rest where they last moved. `memory` is that of [`Fleet::memory`].
    ///
    /// # Panics
    ///
    /// If a position ceases to be finite: that is a bug in a controller or effect.
    pub fn advance(
        &self,
        step: &Step<'_>,
        commands: &[Command],
        states: &mut AgentStates,
        memory: &mut [Memory],
    ) {
        let (from_s, until_s) = (step.from.seconds(), step.until.seconds());
        let dt_s = (step.until - step.from).seconds();
        let draws = Some(Draws::new(step.seed, Purpose::Gust));
        let terrain = Some(&step.site.terrain);
        let base = Surroundings {
            terrain,
            draws,
            others_at_s: from_s,
            others: &[],
            ..Surroundings::default()
        };
        let alive = states.alive.clone();
        let others = self.others(states);
        let any_rigid = self.any(Dynamics::is_rigid);
        let mut pushers = Vec::new();
        if any_rigid {
            pushers.extend(
                self.alive_bodies(states).map(|agent| (agent, states.position_m(agent.index()))),
            );
        }
        if let Some(contacts) = &self.contacts {
            self.advance_in_contact(contacts, step, (&base, &others), commands, states, memory);
        } else {
            let bodies: Vec<AgentId> = self.alive_bodies(states).collect();
            for agent in bodies {
                let dynamics = self.dynamics(agent);
                let near = all_but(&others, agent);
                let surroundings = Surroundings { agent, others: &near, ..base };
                let command = commands[agent.index()];
                let motion = dynamics.take_up(command, from_s, dt_s, &surroundings, states, memory);
                let (velocity, displacement) = match motion {
                    Motion::Velocity(velocity) => (velocity, velocity.map(|part| part * dt_s)),
                    Motion::Body(_) | Motion::Jump(_) => {
                        let span_s = [from_s, until_s];
                        let way_m =
                            dynamics.go(agent, motion, span_s, &surroundings, states, memory);
                        (way_m.map(|part| part / dt_s), way_m)
                    }
                };
                let agent = agent.index();
                states.x_m[agent] += displacement[0];
                states.y_m[agent] += displacement[1];
                states.z_m[agent] += displacement[2];
                [states.vx_mps[agent], states.vy_mps[agent], states.vz_mps[agent]] = velocity;
            }
        }
        if any_rigid {
            let pushers = pushers.into_iter().map(|(agent, begin_m)| Pusher {
                begin_m,
                end_m: states.position_m(agent.index()),
                radius_m: 0.5 * self.diameter_m,
            });
            let pushers: Vec<Pusher> = pushers.collect();
            self.advance_rigid(step, (&base, &others, &pushers), commands, states, memory);
        }
        for agent in alive.iter_ones() {
            assert!(
                states.position_m(agent).iter().all(|coordinate| coordinate.is_finite()),
                "the state of agent {agent} is no longer finite after the command {:?}",
                commands[agent]
            );
            let [vx, vy] = [states.vx_mps[agent], states.vy_mps[agent]];
            if !self.dynamics(AgentId::from_index(agent)).has_heading()
                && !states.heading_rad.is_empty()
                && (vx != 0.0 || vy != 0.0)
            {
                states.heading_rad[agent] = libm::atan2(vy, vx);
            }
        }
    }

    /// Robots that are ordered to stand still: earlier commands have no effect any more.
    pub fn stand_still(&self, memory: &mut [Memory]) {
        for memory in memory {
            memory.drive = [0.0; 3];
            memory.push_mps2 = [0.0; 3];
            memory.load = Default::default();
            memory.spin_radps = 0.0;
            memory.orders.clear();
        }
    }

    /// What the robots believe of where they are: their states, with positions as they were measured. `None`: as they are.
    pub fn measured(
        &self,
        step: &Step<'_>,
        states: &AgentStates,
        memory: &mut [Memory],
    ) -> Option<AgentStates> {
        if !self.any(Dynamics::has_localization) {
            return None;
        }
        let now_s = step.until.seconds();
        let draws = Draws::new(step.seed, Purpose::Localization);
        let mut measured = states.clone();
        for (agent, memory) in AgentId::first(memory.len()).zip(memory) {
            let dynamics = self.dynamics(agent);
            if dynamics.has_localization() {
                memory.track.push((now_s, states.position_m(agent.index())));
            }
            let Some(Localization { sd_m, delay_s, scale }) =
                dynamics.localization_at(agent, now_s, states)
            else {
                // What is measured late later on is measured late from here on.
                memory.track.drain(..memory.track.len().saturating_sub(1));
                continue;
            };
            let position_m = memory.position_m(now_s - delay_s);
            let noise_m: [f64; 3] = std::array::from_fn(|axis| {
                let axis_sd_m = if axis < 2 { sd_m } else { 0.0 };
                axis_sd_m * draws.normal(u64::from(agent.0), step.until.ns(), axis as u64)
            });
            let columns = [&mut measured.x_m, &mut measured.y_m, &mut measured.z_m];
            for (axis, column) in columns.into_iter().enumerate() {
                column[agent.index()] = scale * position_m[axis] + noise_m[axis];
            }
        }
        Some(measured)
    }

    /// All agents that are alive, if effects depend on them.
    pub(super) fn others(&self, states: &AgentStates) -> Vec<(AgentId, Other)> {
        let heeds = |dynamics: &Dynamics| {
            dynamics.physics.effects().iter().any(|effect| effect.heeds_others())
        };
        if !self.any(heeds) {
            return Vec::new();
        }
        let other = |agent: AgentId| {
            let place = agent.index();
            let velocity_mps = [states.vx_mps[place], states.vy_mps[place], states.vz_mps[place]];
            Other { position_m: states.position_m(place), velocity_mps }
        };
        alive(states).map(|agent| (agent, other(agent))).collect()
    }
}

/// The agents that are there.
fn alive(states: &AgentStates) -> impl Iterator<Item = AgentId> + '_ {
    states.alive.iter_ones().map(AgentId::from_index)
}
