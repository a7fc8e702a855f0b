//! Robots that keep in touch while they do something else: an option of every controller.

use super::{Controller, ExplorationSettings, ParentLink, View, add, scaled, sub};
use crate::dynamics::{Command, norm};
use proto::config::Section;
use proto::ids::AgentId;

/// A controller whose robots keep the link to their parent.
///
/// # Model
///
/// With p the strength at which a robot has heard its preferred parent, c = (p − floor) / margin within −1 and 1, and e the direction
/// away from the parent, the part of the velocity v along e, where it leads away, is multiplied by c:
///
/// ```text
/// v' = v − (1 − c) max(v · e, 0) e
/// ```
///
/// Motion across and towards the parent is free. A robot that has not joined, or has not heard its parent, moves as fast as it would
/// have, but towards the robot that it hears best; where it hears nobody, as its controller wants. A root is free.
/// Accelerations are changed so that the velocity at the end of the period obeys the same rule.
///
/// After "Active Connectivity Fundamentals for TSCH Networks of Mobile Robots" (arXiv 2201.08202), in which robots regulate their
/// speed by their connectivity.
///
/// # Validity
///
/// Strengths are those of the payloads that robots hear from each other: without payloads, or with `knowledge = "truth"`, it has no
/// influence. In the plane or in space alike.
#[derive(Debug)]
pub(crate) struct ActiveConnectivity {
    inner: Box<dyn Controller>,
    keys: Keys,
}

/// Active connectivity: a robot moves away from its routing parent more slowly as the link weakens, and back when it is nearly
/// lost.
#[derive(Debug, Section)]
pub(crate) struct Keys {
    /// Received signal strength (dBm) of the parent below which a robot turns back.
    #[key(range = -300.0..=100.0, default = -85.0)]
    rssi_floor_dbm: f64,
    /// Margin (dB): if the parent's signal exceeds the floor by at least this, the controller moves the robot freely.
    #[key(above = 0.0, most = 1e4, default = 6.0)]
    rssi_margin_db: f64,
}

impl ActiveConnectivity {
    /// A controller as its checked table says: with active connectivity around it, if there is any.
    pub(crate) fn around(inner: Box<dyn Controller>, table: &toml::Table) -> Box<dyn Controller> {
        match super::Keys::read(table).active_connectivity {
            Some(keys) => Box::new(Self { inner, keys }),
            None => inner,
        }
    }

    /// A velocity as the link allows it.
    fn allowed(&self, view: &View<'_>, agent: AgentId, velocity_mps: [f64; 3]) -> [f64; 3] {
        let own_m = view.position_m(agent);
        match view.parent_link(agent) {
            ParentLink::Root | ParentLink::Lost(None) => velocity_mps,
            ParentLink::Heard { rssi_dbm, to } => {
                let away = sub(own_m, to.motion.position_m);
                let distance_m = norm(away);
                if distance_m == 0.0 {
                    return velocity_mps;
                }
                let unit = scaled(away, 1.0 / distance_m);
                let away_mps: f64 = velocity_mps.iter().zip(unit).map(|(v, e)| v * e).sum();
                let above_db = rssi_dbm - self.keys.rssi_floor_dbm;
                let share = (above_db / self.keys.rssi_margin_db).clamp(-1.0, 1.0);
                add(velocity_mps, scaled(unit, (share - 1.0) * away_mps.max(0.0)))
            }
            ParentLink::Lost(Some(to)) => {
                let way = sub(to.motion.position_m, own_m);
                let length_m = norm(way);
                if length_m == 0.0 {
                    return velocity_mps;
                }
                scaled(way, norm(velocity_mps) / length_m)
            }
        }
    }
}

impl Controller for ActiveConnectivity {
    fn command(&self, view: &View<'_>, agent: AgentId) -> Command {
        match self.inner.command(view, agent) {
            Command::Velocity(velocity_mps) => {
                Command::Velocity(self.allowed(view, agent, velocity_mps))
            }
            Command::Acceleration(acceleration_mps2) => {
                let now_mps = view.velocity_mps(agent);
                let end_mps = add(now_mps, scaled(acceleration_mps2, view.dt_s));
                let allowed_mps = self.allowed(view, agent, end_mps);
                Command::Acceleration(scaled(sub(allowed_mps, now_mps), 1.0 / view.dt_s))
            }
            // Refused where the configuration is read.
            jump @ Command::Jump(_) => jump,
        }
    }

    fn wants_rssi(&self) -> bool {
        true
    }

    fn is_done(&self, view: &View<'_>, commands: &[Command]) -> bool {
        self.inner.is_done(view, commands)
    }

    fn exploration(&self) -> Option<&ExplorationSettings> {
        self.inner.exploration()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::controller::Links;
    use crate::knowledge::Knowledge;
    use crate::payload;
    use proto::rng::{Draws, Purpose};
    use proto::types::{
        AgentStates, Bitmap, Deliveries, Heard, MoteStates, Payloads, Transmissions,
    };

    #[derive(Debug)]
    struct Wants(Command);

    impl Controller for Wants {
        fn command(&self, _view: &View<'_>, _agent: AgentId) -> Command {
            self.0
        }
    }

    /// The command of robot 0 at x = 10, whose own controller gives `wanted`. It hears robot 1 at x = 0 and robot 2 at x = 12 with
    /// these signal strengths.
    fn told(wanted: Command, rssi_dbm: [f32; 2], parent: u32, joined: bool) -> Command {
        let mut states = AgentStates::at_origin(3);
        states.x_m = vec![10.0, 0.0, 12.0];
        states.vx_mps[0] = 1.0;
        let kept: Vec<u8> = payload::encode(&states).iter().skip(1).flatten().copied().collect();
        let deliveries = Deliveries {
            transmissions: Transmissions {
                sender: vec![1, 2],
                sent_ns: vec![0, 1],
                end_ns: vec![1, 2],
                payloads: Payloads::new(vec![48; 2], kept.into()).unwrap(),
                ..Transmissions::default()
            },
            heard: Heard::Lists { ends: vec![2, 2, 2], indices: vec![0, 1] },
            rssi_dbm: rssi_dbm.to_vec(),
            ..Deliveries::default()
        };
        let mut all = Bitmap::filled(3, false);
        all.set(0, joined);
        let motes = MoteStates {
            alive: Bitmap::filled(3, true),
            joined: Some(all),
            parent: vec![parent; 3],
            ..MoteStates::default()
        };
        let knowledge = Knowledge::heard(Some(&deliveries), 3);
        let view = View {
            step: 1,
            time_s: 0.0,
            dt_s: 0.5,
            states: &states,
            knowledge: &knowledge,
            links: Links::new(Some(&motes)),
            exploration: None,
            draws: Draws::new(1, Purpose::Control),
        };
        let keys = Keys { rssi_floor_dbm: -80.0, rssi_margin_db: 10.0 };
        let this = ActiveConnectivity { inner: Box::new(Wants(wanted)), keys };
        assert!(this.wants_rssi());
        this.command(&view, AgentId(0))
    }

    fn velocity(wanted: [f64; 3], rssi_dbm: f32) -> [f64; 3] {
        match told(Command::Velocity(wanted), [rssi_dbm, -50.0], 1, true) {
            Command::Velocity(velocity_mps) => velocity_mps,
            command => panic!("{command:?}"),
        }
    }

    #[test]
    fn the_part_that_leads_away_from_the_parent_fades_with_the_link_and_turns_back() {
        for (rssi_dbm, share) in
            [(-60.0, 1.0), (-70.0, 1.0), (-75.0, 0.5), (-80.0, 0.0), (-85.0, -0.5), (-99.0, -1.0)]
        {
            assert_eq!(velocity([2.0, 3.0, 0.0], rssi_dbm), [2.0 * share, 3.0, 0.0]);
        }
        // Towards the parent it is free.
        assert_eq!(velocity([-2.0, 3.0, 0.0], -99.0), [-2.0, 3.0, 0.0]);
    }

    #[test]
    fn an_acceleration_leads_to_the_velocity_that_is_allowed() {
        // 1 m/s and 2 m/s² for half a second: 2 m/s, of which half remains.
        let wanted = Command::Acceleration([2.0, 0.0, 0.0]);
        let told = told(wanted, [-75.0, -50.0], 1, true);
        assert_eq!(told, Command::Acceleration([0.0, 0.0, 0.0]));
    }

    #[test]
    fn who_is_out_of_the_network_goes_to_whom_it_hears_best_and_a_root_is_free() {
        let wanted = Command::Velocity([0.0, 3.0, 0.0]);
        let to_best = Command::Velocity([3.0, 0.0, 0.0]);
        assert_eq!(told(wanted, [-90.0, -50.0], 1, false), to_best);
        assert_eq!(told(wanted, [-90.0, -50.0], u32::MAX, true), wanted);
    }
}
