//! Where things are: the site, the motes, and how far each has moved.

use physics::link::End;
use proto::ids::MoteId;
use proto::site::Site;
use proto::types::{AgentStates, Bitmap, MoteCommand, MoteOrder, MovedObstacle};
use serde::{Deserialize, Serialize};

/// Where things are now.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// The site, obstacles where they are now.
    pub site: Site,
    /// Motes that belong to the network.
    pub present: Bitmap,
    /// Motes that have not failed.
    pub working: Bitmap,
    /// The way each agent has travelled while it was alive (m).
    pub way_m: Vec<f64>,
    /// Where each was last seen alive (m).
    pub last_seen_m: Vec<Option<[f64; 3]>>,
}

impl Place {
    /// At time 0, with `absent` motes left out.
    #[must_use]
    pub fn new(agent_count: usize, absent: &[MoteId], site: Site) -> Self {
        let mut present = Bitmap::filled(agent_count, true);
        for &mote in absent {
            present.set(mote.index(), false);
        }
        Self {
            site,
            present,
            working: Bitmap::filled(agent_count, true),
            way_m: vec![0.0; agent_count],
            last_seen_m: vec![None; agent_count],
        }
    }

    /// Whether it is one of so many agents.
    #[must_use]
    pub fn is_of(&self, agent_count: usize) -> bool {
        [self.present.len(), self.working.len(), self.way_m.len(), self.last_seen_m.len()]
            == [agent_count; 4]
    }

    /// Whether a mote belongs to the network and has not failed.
    #[must_use]
    pub fn is_alive(&self, mote: usize) -> bool {
        self.present.get(mote) && self.working.get(mote)
    }

    /// By mote: whether it is present and works.
    #[must_use]
    pub fn alive(&self) -> Bitmap {
        let mut alive = self.working.clone();
        for mote in 0..alive.len() {
            alive.set(mote, self.is_alive(mote));
        }
        alive
    }

    /// Motes fail, work again, come in addition. Other orders are not its business.
    pub fn obey(&mut self, commands: &[MoteCommand]) {
        for command in commands {
            match command.order {
                MoteOrder::Kill(mote) => self.working.set(mote as usize, false),
                MoteOrder::Revive(mote) => self.working.set(mote as usize, true),
                MoteOrder::Add(mote) => self.present.set(mote as usize, true),
                MoteOrder::Jam { .. } | MoteOrder::Send { .. } => {}
            }
        }
    }

    /// Obstacles are elsewhere now.
    pub(crate) fn move_obstacles(&mut self, moved: &[MovedObstacle]) {
        for moved in moved {
            let named = |name: &Option<String>| name.as_ref() == Some(&moved.name);
            match self.site.obstacle.iter_mut().find(|obstacle| named(&obstacle.name)) {
                Some(obstacle) => obstacle.centre_m = moved.centre_m,
                None => {
                    tracing::warn!(name = moved.name, "an obstacle moved that is not in the site")
                }
            }
        }
    }

    /// Adds what every agent has moved since it was last seen alive to its way.
    pub fn travel(&mut self, states: &AgentStates) {
        for agent in states.alive.iter_ones() {
            let position_m = states.position_m(agent);
            if let Some(last_m) = self.last_seen_m[agent] {
                let step = End::new(MoteId(0), last_m)
                    .distance_squared_m2(&End::new(MoteId(0), position_m));
                self.way_m[agent] += step.sqrt();
            }
            self.last_seen_m[agent] = Some(position_m);
        }
    }
}

/// What is added to heights (m): that of the antennas, where all positions are planar.
#[must_use]
pub fn lift_m(antenna_height_m: f64, states: &AgentStates) -> f64 {
    let planar = states.alive.iter_ones().all(|agent| states.z_m[agent] == 0.0);
    if planar { antenna_height_m } else { 0.0 }
}

/// An agent as an end of links.
#[must_use]
pub fn end_of(states: &AgentStates, agent: u32, lift_m: f64) -> End {
    let place = agent as usize;
    let [x, y, z] = states.position_m(place);
    let velocity = |column: &[f64]| column.get(place).copied();
    End {
        id: MoteId(agent),
        position_m: [x, y, z + lift_m],
        heading_rad: states.heading_rad.get(place).copied(),
        velocity_mps: velocity(&states.vx_mps)
            .zip(velocity(&states.vy_mps))
            .zip(velocity(&states.vz_mps))
            .map(|((x, y), z)| [x, y, z]),
    }
}
