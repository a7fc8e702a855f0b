//! Robots that spread as far as their links hold.

use super::{Controller, Demands, Entry, Goal, ParentLink, View, add, norm, scaled, sub};
use crate::context::Context;
use crate::dynamics::Command;
use proto::config::{Kind, Problem, Range, Section, variant};
use proto::ids::AgentId;

const POSITIVE: Kind = Kind::Number(Range::above(0.0, 1e4));

pub(super) const ENTRY: Entry = Entry {
    variant: variant::<Dispersion>("dispersion"),
    demands: Demands::NONE,
    goal: Goal::Disperse,
    build: |table, context, problems| {
        let this = Dispersion::read(table);
        this.check(context, problems);
        Some(Box::new(this))
    },
};

/// Dispersion: every robot moves away from the others, slower as the link to its routing parent weakens, and back if the link is
/// nearly lost.
///
/// Dispersion that keeps the network together.
///
/// # Model
///
/// With p the strength at which robot i has heard its preferred parent in routing, and c = (p − floor) / margin, kept within
/// −1 and 1,
///
/// ```text
/// u_i = v c e_away                     c ≥ 0,   e_away along Σ_j (x_i − x_j) / d_ij²
/// u_i = v |c| e_parent                 c < 0,   e_parent towards the parent
/// ```
///
/// Whoever has no parent but has joined is a root, and stays. Where the network has no routing, the strongest link stands for
/// that to the parent. Whoever has not joined, or has not heard its parent, has lost its link: it moves at full speed towards
/// the robot it hears best, or the origin if it hears nobody.
///
/// Since everybody keeps its link to its parent, the tree of routing holds; since routing chooses parents by their links, whom
/// a robot keeps near changes as it moves. The repulsion is that of potential fields for deployment (Howard, Matarić, Sukhatme,
/// "Mobile Sensor Network Deployment using Potential Fields", DARS 2002), without its friction; what is added is the link.
///
/// # Validity
///
/// A link is judged by the strength of one frame: where that varies from frame to frame robots tremble at the floor. Places
/// lie in one plane.
#[derive(Debug, Section)]
struct Dispersion {
    /// Maximum speed (m/s).
    #[key(kind = POSITIVE, default = 1.0)]
    speed_mps: f64,
    /// Received signal strength (dBm) below which a robot turns back.
    #[key(range = -300.0..=100.0, default = -85.0)]
    rssi_floor_dbm: f64,
    /// Margin above the floor (dB) from which a robot moves at full speed; below, it moves more slowly.
    #[key(kind = POSITIVE, default = 6.0)]
    rssi_margin_db: f64,
}

impl Dispersion {
    fn check(&self, context: &Context<'_>, problems: &mut Vec<Problem>) {
        super::check_speed("speed_mps", self.speed_mps, context, problems);
    }

    /// The velocity along a direction, or none if it has no length.
    fn along(&self, way: [f64; 3], share: f64) -> Command {
        let length = norm(way);
        let factor = if length == 0.0 { 0.0 } else { self.speed_mps * share / length };
        Command::Velocity(scaled(way, factor))
    }
}

impl Controller for Dispersion {
    fn wants_rssi(&self) -> bool {
        true
    }

    fn command(&self, view: &View<'_>, agent: AgentId) -> Command {
        let own_m = view.position_m(agent);
        match view.parent_link(agent) {
            ParentLink::Root => Command::Velocity([0.0; 3]),
            ParentLink::Heard { rssi_dbm, to } => {
                let above_db = rssi_dbm - self.rssi_floor_dbm;
                let share = (above_db / self.rssi_margin_db).clamp(-1.0, 1.0);
                if 0.0 <= share {
                    self.along(away_from_others(view, agent), share)
                } else {
                    self.along(sub(to.motion.position_m, own_m), -share)
                }
            }
            ParentLink::Lost(Some(to)) => self.along(sub(to.motion.position_m, own_m), 1.0),
            ParentLink::Lost(None) => self.along(scaled(own_m, -1.0), 1.0),
        }
    }
}

/// Σ_j (x_i − x_j) / d_ij² over those a robot knows of.
fn away_from_others(view: &View<'_>, agent: AgentId) -> [f64; 3] {
    let own_m = view.position_m(agent);
    let mut away = [0.0; 3];
    view.knowledge.for_each_known_to(agent, |seen| {
        let apart = sub(own_m, seen.motion.position_m);
        let distance_m = norm(apart);
        if distance_m != 0.0 {
            away = add(away, scaled(apart, 1.0 / (distance_m * distance_m)));
        }
    });
    away
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::controller::Links;
    use crate::knowledge::Knowledge;
    use crate::payload;
    use proto::rng::{Draws, Purpose};
    use proto::types::{AgentStates, Bitmap, Deliveries, Heard, MoteStates, Transmissions};

    /// The velocity of robot 0, at x = 10, which hears robots 1 at x = 0 and 2 at x = 12 so strongly.
    fn velocity(rssi_dbm: [f32; 2], motes: Option<&MoteStates>) -> [f64; 3] {
        let mut states = AgentStates::at_origin(3);
        states.x_m = vec![10.0, 0.0, 12.0];
        let deliveries = Deliveries {
            transmissions: Transmissions {
                sender: vec![1, 2],
                sent_ns: vec![0, 1],
                end_ns: vec![1, 2],
                payloads: {
                    let all = payload::encode(&states);
                    let kept: Vec<u8> = all.iter().skip(1).flatten().copied().collect();
                    proto::types::Payloads::new(vec![48; 2], kept.into()).unwrap()
                },
                ..Transmissions::default()
            },
            heard: Heard::Lists { ends: vec![2, 2, 2], indices: vec![0, 1] },
            rssi_dbm: rssi_dbm.to_vec(),
            ..Deliveries::default()
        };
        let knowledge = Knowledge::heard(Some(&deliveries), 3);
        let view = View {
            step: 1,
            time_s: 0.0,
            dt_s: 0.1,
            states: &states,
            knowledge: &knowledge,
            links: Links::new(motes),
            exploration: None,
            draws: Draws::new(1, Purpose::Control),
        };
        let this = Dispersion { speed_mps: 2.0, rssi_floor_dbm: -80.0, rssi_margin_db: 10.0 };
        assert!(this.wants_rssi());
        match this.command(&view, AgentId(0)) {
            Command::Velocity(velocity_mps) => velocity_mps,
            command => panic!("{command:?}"),
        }
    }

    fn motes(parent: u32, joined: bool) -> MoteStates {
        let mut all = Bitmap::filled(3, false);
        all.set(0, joined);
        MoteStates {
            alive: Bitmap::filled(3, true),
            joined: Some(all),
            parent: vec![parent; 3],
            ..MoteStates::default()
        }
    }

    #[test]
    fn a_robot_moves_away_as_fast_as_its_link_to_its_parent_is_good() {
        // Away from 2, which is nearer.
        for (rssi_dbm, expected) in [(-60.0, -2.0), (-75.0, -1.0), (-80.0, 0.0)] {
            assert_eq!(velocity([rssi_dbm, -90.0], Some(&motes(1, true))), [expected, 0.0, 0.0]);
        }
    }

    #[test]
    fn a_robot_turns_back_to_a_parent_that_it_hardly_hears() {
        assert_eq!(velocity([-85.0, -50.0], Some(&motes(1, true))), [-1.0, 0.0, 0.0]);
        assert_eq!(velocity([-50.0, -85.0], Some(&motes(2, true))), [1.0, 0.0, 0.0]);
    }

    #[test]
    fn who_has_not_joined_or_not_heard_its_parent_goes_to_whom_it_hears_best() {
        assert_eq!(velocity([-70.0, -60.0], Some(&motes(1, false))), [2.0, 0.0, 0.0]);
        assert_eq!(velocity([-60.0, -70.0], Some(&motes(0, true))), [-2.0, 0.0, 0.0]);
    }

    #[test]
    fn a_root_stays() {
        assert_eq!(velocity([-60.0, -60.0], Some(&motes(u32::MAX, true))), [0.0; 3]);
    }

    #[test]
    fn without_routing_the_best_link_counts() {
        assert_eq!(velocity([-75.0, -78.0], None), [-1.0, 0.0, 0.0]);
    }
}
