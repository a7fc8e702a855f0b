//! The robots that take part in a step, and which of them reach each other.

use crate::place::{self, Place};
use bytes::Bytes;
use physics::link::{End, Link, Scene};
use physics::nearest::Grid;
use physics::sight::{Path, is_blocked_by_body, off_heading_rad, prepare_bodies};
use proto::time::SimDuration;
use proto::types::{AgentStates, Payloads};

/// The robots of a step.
#[derive(Debug)]
pub struct Around<'a> {
    /// Those that are present and work, ascending by number.
    pub agents: Vec<End>,
    /// Length of a control period.
    pub step: SimDuration,
    /// Seed of the draws to come.
    pub seed: u64,
    place: &'a Place,
    /// By number, the place in `agents`; `u32::MAX` for those that do not take part.
    places: Vec<u32>,
    begins: Vec<usize>,
    payloads: &'a Payloads,
}

impl<'a> Around<'a> {
    /// The robots at the beginning of a step, and what each says.
    pub(super) fn new(
        place: &'a Place,
        states: &AgentStates,
        lift_m: f64,
        payloads: &'a Payloads,
        step: SimDuration,
        seed: u64,
    ) -> Self {
        let n = payloads.len();
        let mut places = vec![u32::MAX; n];
        let mut agents = Vec::with_capacity(n);
        for id in states.alive.iter_ones().filter(|&id| place.is_alive(id)) {
            places[id] = agents.len() as u32;
            agents.push(place::end_of(states, id as u32, lift_m));
        }
        let begins = payloads
            .length_bytes()
            .iter()
            .scan(0, |end, &length| Some(std::mem::replace(end, *end + length as usize)))
            .collect();
        Self { agents, step, seed, place, places, begins, payloads }
    }

    /// Capacity of the experiment.
    #[must_use]
    pub fn agent_count(&self) -> usize {
        self.places.len()
    }

    /// Whether a robot is present and works.
    #[must_use]
    pub fn is_on(&self, id: u32) -> bool {
        self.places[id as usize] != u32::MAX
    }

    /// What a robot says, if it is on and says something.
    #[must_use]
    pub fn payload(&self, id: u32) -> Option<Bytes> {
        let length = self.payloads.length_bytes()[id as usize] as usize;
        let begin = self.begins[id as usize];
        (self.is_on(id) && length != 0).then(|| self.payloads.data().slice(begin..begin + length))
    }

    /// The robots sorted by place, for searches of about this radius.
    #[must_use]
    pub fn grid(&self, radius_m: f64) -> Grid {
        let mut grid = Grid::default();
        let points = self.agents.iter().map(|end| [end.position_m[0], end.position_m[1]]);
        grid.build(radius_m, points);
        grid
    }

    /// The surroundings of all links. `bodies`: other robots may stand in the way.
    #[must_use]
    pub fn scene(&self, bodies: bool) -> Scene<'_> {
        let mut scene =
            Scene { site: Some(&self.place.site), agents: &self.agents, ..Scene::default() };
        if bodies {
            prepare_bodies(&mut scene);
        }
        scene
    }

    /// The robot of this number, if it is on.
    #[must_use]
    pub fn end(&self, id: u32) -> Option<End> {
        self.agents.get(self.places[id as usize] as usize).copied()
    }
}

/// How far frames reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// Greatest distance (m), itself included.
    pub range_m: f64,
    /// Angle off the sender's heading (rad) at which it radiates half as much as straight ahead; `None`: alike in all directions.
    pub half_angle_rad: Option<f64>,
    /// Whether walls and obstacles block.
    pub walls_block: bool,
    /// Radius of robots' bodies (m), if they block.
    pub body_radius_m: Option<f64>,
    /// Received power at the greatest distance, straight ahead (dBm).
    pub edge_dbm: f64,
}

/// Received power is stated for no shorter distance (m): at contact it would be infinite.
const CLOSEST_M: f64 = 0.01;

impl Reach {
    /// The power (dBm) that a receiver gets, if the frame reaches it.
    ///
    /// # Model
    ///
    /// Power falls with the square of the distance, and off the axis of a generalised Lambertian emitter as cos^m φ with
    /// m = −ln 2 / ln cos Φ, where Φ is the half-power angle (Kahn and Barry, "Wireless infrared communications", Proc. IEEE
    /// 85(2), 1997). A frame is received if its power is at least that at `range_m` straight ahead. So the reach at an angle φ is
    /// range · cos^(m/2) φ, and 0 from 90° on.
    #[must_use]
    pub fn power_dbm(&self, scene: &Scene<'_>, sender: End, receiver: End) -> Option<f64> {
        let distance_m = sender.distance_squared_m2(&receiver).sqrt();
        if self.range_m < distance_m {
            return None;
        }
        let link = Link {
            sender,
            receiver,
            distance_m,
            channel: None,
            frequency_hz: 0.0,
            time_ns: 0,
            scene,
        };
        let gain = self.half_angle_rad.map_or(1.0, |half_rad| lambertian_gain(&link, half_rad));
        let ratio = self.range_m / distance_m.max(CLOSEST_M.min(self.range_m));
        let margin = ratio * ratio * gain;
        if margin < 1.0 || self.is_blocked(&link) {
            return None;
        }
        Some(self.edge_dbm + 10.0 * libm::log10(margin))
    }

    fn is_blocked(&self, link: &Link<'_>) -> bool {
        let path = Path::direct(link);
        let by_site = self.walls_block
            && link.scene.site.is_some_and(|site| {
                site.wall.iter().any(|wall| path.is_cut_by_wall(wall))
                    || site.obstacle.iter().any(|obstacle| path.is_cut_by_obstacle(obstacle))
            });
        by_site || self.body_radius_m.is_some_and(|radius_m| is_blocked_by_body(link, radius_m))
    }

    /// Robots that a frame of `sender` reaches, by number, ascending, with the received power (dBm).
    pub fn receivers(
        &self,
        around: &Around<'_>,
        (scene, grid): (&Scene<'_>, &Grid),
        sender: End,
    ) -> Vec<(u32, f64)> {
        let [x, y, _] = sender.position_m;
        let mut receivers: Vec<(u32, f64)> = grid
            .around([x, y], self.range_m)
            .map(|place| around.agents[place as usize])
            .filter(|receiver| receiver.id != sender.id)
            .filter_map(|receiver| Some((receiver.id.0, self.power_dbm(scene, sender, receiver)?)))
            .collect();
        receivers.sort_unstable_by_key(|&(id, _)| id);
        receivers
    }
}

/// cos^m φ; 1 where the sender's heading is not known.
fn lambertian_gain(link: &Link<'_>, half_rad: f64) -> f64 {
    let Some(off_rad) = off_heading_rad(link) else { return 1.0 };
    let cosine = libm::cos(off_rad);
    if cosine <= 0.0 {
        return 0.0;
    }
    let order = -std::f64::consts::LN_2 / libm::log(libm::cos(half_rad));
    libm::pow(cosine, order)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::ids::MoteId;

    const REACH: Reach = Reach {
        range_m: 4.0,
        half_angle_rad: Some(0.5),
        walls_block: true,
        body_radius_m: None,
        edge_dbm: -40.0,
    };

    fn power_dbm(angle_rad: f64, distance_m: f64) -> Option<f64> {
        let sender = End { heading_rad: Some(1.0), ..End::new(MoteId(0), [0.0; 3]) };
        let (x, y) = (libm::cos(1.0 + angle_rad), libm::sin(1.0 + angle_rad));
        let receiver = End::new(MoteId(1), [distance_m * x, distance_m * y, 0.0]);
        REACH.power_dbm(&Scene::default(), sender, receiver)
    }

    #[test]
    fn power_falls_by_6_db_when_the_distance_doubles_and_by_3_db_at_the_half_power_angle() {
        // Rounding of the direction is below 1e-12.
        assert!((power_dbm(0.0, 2.0).unwrap() - (-40.0 + 20.0 * 2f64.log10())).abs() < 1e-9);
        assert!((power_dbm(0.5, 2.0).unwrap() - (-40.0 + 10.0 * 2f64.log10())).abs() < 1e-9);
    }

    #[test]
    fn the_reach_at_the_half_power_angle_is_the_range_over_the_square_root_of_2() {
        let edge_m = 4.0 / 2f64.sqrt();
        for angle_rad in [0.5, -0.5] {
            assert!(power_dbm(angle_rad, edge_m - 1e-9).is_some());
            assert!(power_dbm(angle_rad, edge_m + 1e-9).is_none());
        }
        assert!(power_dbm(0.0, 4.0 - 1e-9).is_some());
        assert!(power_dbm(0.0, 4.0 + 1e-9).is_none());
        assert_eq!(power_dbm(1.6, 0.1), None, "behind the emitter");
    }
}
