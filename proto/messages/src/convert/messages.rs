//! From values to messages. A value is valid, so this cannot fail.

use super::numbers;
use crate::v1;
use bytes::Bytes;
use proto::types::{
    AgentCommand, AgentOrder, AgentStates, Bitmap, Deliveries, Heard, MoteCommand, MoteOrder,
    MoteStates, MovedObstacle, Payloads,
};

impl From<AgentStates> for v1::AgentStates {
    fn from(states: AgentStates) -> Self {
        Self {
            alive: Bytes::copy_from_slice(states.alive.as_bytes()),
            x_m: states.x_m,
            y_m: states.y_m,
            z_m: states.z_m,
            vx_mps: states.vx_mps,
            vy_mps: states.vy_mps,
            vz_mps: states.vz_mps,
            heading_rad: states.heading_rad,
            covariates: states
                .covariates
                .into_iter()
                .map(|covariate| v1::Covariate { name: covariate.name, values: covariate.values })
                .collect(),
        }
    }
}

impl From<Payloads> for v1::Payloads {
    fn from(payloads: Payloads) -> Self {
        Self { length_bytes: payloads.length_bytes().to_vec(), data: payloads.data().clone() }
    }
}

impl From<Deliveries> for v1::Deliveries {
    fn from(deliveries: Deliveries) -> Self {
        let sent = deliveries.transmissions;
        let (heard_end, heard, heard_bitmap) = match deliveries.heard {
            Heard::Lists { ends, indices } => (ends, indices, Bytes::new()),
            Heard::Rows { bytes, .. } => (Vec::new(), Vec::new(), bytes),
        };
        Self {
            transmissions: Some(v1::Transmissions {
                sender: sent.sender,
                sent_ns: sent.sent_ns,
                end_ns: sent.end_ns,
                payloads: Some(sent.payloads.into()),
                destination: sent.destination,
            }),
            heard_end,
            heard,
            heard_bitmap,
            received_ns: deliveries.received_ns,
            rssi_dbm: deliveries.rssi_dbm,
            hops: deliveries.hops,
            medium: numbers(&deliveries.medium),
        }
    }
}

impl From<MoteStates> for v1::MoteStates {
    fn from(motes: MoteStates) -> Self {
        let bytes = |bitmap: &Bitmap| Bytes::copy_from_slice(bitmap.as_bytes());
        Self {
            alive: bytes(&motes.alive),
            synced: motes.synced.as_ref().map(bytes).unwrap_or_default(),
            joined: motes.joined.as_ref().map(bytes).unwrap_or_default(),
            rank: motes.rank,
            parent: motes.parent,
            queue_length: motes.queue_length,
        }
    }
}

impl From<AgentCommand> for v1::AgentCommand {
    fn from(command: AgentCommand) -> Self {
        use v1::agent_command::{Order, Release, Velocity, Waypoint};
        let order = match command.order {
            AgentOrder::Velocity([vx_mps, vy_mps, vz_mps]) => {
                Order::Velocity(Velocity { vx_mps, vy_mps, vz_mps })
            }
            AgentOrder::Waypoint([x_m, y_m, z_m]) => Order::Waypoint(Waypoint { x_m, y_m, z_m }),
            AgentOrder::Release => Order::Release(Release {}),
        };
        Self { agent: command.agent, source: command.source, order: Some(order) }
    }
}

impl From<MoteCommand> for v1::MoteCommand {
    fn from(command: MoteCommand) -> Self {
        use v1::mote_command::{Add, Jam, Kill, Order, Revive, Send};
        let order = match command.order {
            MoteOrder::Kill(mote) => Order::Kill(Kill { mote }),
            MoteOrder::Revive(mote) => Order::Revive(Revive { mote }),
            MoteOrder::Add(mote) => Order::Add(Add { mote }),
            MoteOrder::Jam { channel, from_ns, until_ns, centre_m: [x_m, y_m], radius_m } => {
                Order::Jam(Jam { channel, from_ns, until_ns, x_m, y_m, radius_m })
            }
            MoteOrder::Send { mote, destination, payload } => {
                Order::Send(Send { mote, destination, payload })
            }
        };
        Self { source: command.source, order: Some(order) }
    }
}

impl From<MovedObstacle> for v1::MovedObstacle {
    fn from(moved: MovedObstacle) -> Self {
        let [x_m, y_m] = moved.centre_m;
        Self { name: moved.name, x_m, y_m }
    }
}
