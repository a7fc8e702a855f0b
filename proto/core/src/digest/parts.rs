//! The parts of the full digest: one for each kind of message that crosses between the sides. `cosim/v1/common.proto` defines
//! their byte strings.

use super::{Digest, update};
use crate::types::{
    AgentCommand, AgentMessage, AgentOrder, AgentStates, Bitmap, Covariate, Deliveries, Formation,
    Frames, Heard, HeardLinks, MoteCommand, MoteOrder, MoteStates, MoteStatistics, MovedObstacle,
    NetRecord, PacketKind, Packets, Payloads, Schedule, Statistic, TaskFigure,
};
use sha2::{Digest as _, Sha256};

/// What a part counts as that is absent or empty.
pub(super) const ABSENT: Digest = [0; 32];

/// Fields, one after the other, as the byte string that is hashed.
#[derive(Default)]
pub(super) struct Fields(Sha256);

impl Fields {
    pub(super) fn end(self) -> Digest {
        self.0.finalize().into()
    }

    pub(super) fn u8(&mut self, value: u8) -> &mut Self {
        self.0.update([value]);
        self
    }

    pub(super) fn flag(&mut self, value: bool) -> &mut Self {
        self.u8(value.into())
    }

    pub(super) fn u32(&mut self, value: u32) -> &mut Self {
        self.0.update(value.to_le_bytes());
        self
    }

    pub(super) fn u64(&mut self, value: u64) -> &mut Self {
        self.0.update(value.to_le_bytes());
        self
    }

    fn f64(&mut self, value: f64) -> &mut Self {
        self.0.update(value.to_le_bytes());
        self
    }

    pub(super) fn length(&mut self, n: usize) -> &mut Self {
        self.u64(n as u64)
    }

    pub(super) fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.length(bytes.len());
        self.0.update(bytes);
        self
    }

    pub(super) fn text(&mut self, text: &str) -> &mut Self {
        self.bytes(text.as_bytes())
    }

    pub(super) fn parts(&mut self, digests: &[Digest]) -> &mut Self {
        self.0.update(digests.as_flattened());
        self
    }

    fn bitmap(&mut self, bitmap: Option<&Bitmap>) -> &mut Self {
        self.bytes(bitmap.map_or(&[], Bitmap::as_bytes))
    }

    fn f64s(&mut self, column: &[f64]) -> &mut Self {
        self.length(column.len());
        update(&mut self.0, column, f64::to_le_bytes);
        self
    }

    fn f32s(&mut self, column: &[f32]) -> &mut Self {
        self.length(column.len());
        update(&mut self.0, column, f32::to_le_bytes);
        self
    }

    pub(super) fn u32s(&mut self, column: &[u32]) -> &mut Self {
        self.length(column.len());
        update(&mut self.0, column, u32::to_le_bytes);
        self
    }

    fn u64s(&mut self, column: &[u64]) -> &mut Self {
        self.length(column.len());
        update(&mut self.0, column, u64::to_le_bytes);
        self
    }

    fn payload_column(&mut self, payloads: &Payloads) -> &mut Self {
        self.u32s(payloads.length_bytes()).bytes(payloads.data())
    }

    pub(super) fn records(&mut self, records: &[NetRecord]) -> &mut Self {
        self.length(records.len());
        for record in records {
            self.u32(*record as u32);
        }
        self
    }
}

/// A list, of which an empty one counts as absent.
fn list<T>(entries: &[T], mut write: impl FnMut(&mut Fields, &T)) -> Digest {
    if entries.is_empty() {
        return ABSENT;
    }
    let mut fields = Fields::default();
    fields.length(entries.len());
    entries.iter().for_each(|entry| write(&mut fields, entry));
    fields.end()
}

/// The part of something that may be absent.
pub(super) fn optional<T>(value: Option<&T>, part: impl FnOnce(&T) -> Digest) -> Digest {
    value.map_or(ABSENT, part)
}

pub(super) fn states(states: &AgentStates) -> Digest {
    let AgentStates { alive, x_m, y_m, z_m, vx_mps, vy_mps, vz_mps, heading_rad, covariates } =
        states;
    let mut fields = Fields::default();
    fields.bitmap(Some(alive));
    for column in [x_m, y_m, z_m, vx_mps, vy_mps, vz_mps, heading_rad] {
        fields.f64s(column);
    }
    fields.length(covariates.len());
    for Covariate { name, values } in covariates {
        fields.text(name).f64s(values);
    }
    fields.end()
}

pub(super) fn payloads(payloads: &Payloads) -> Digest {
    let mut fields = Fields::default();
    fields.payload_column(payloads);
    fields.end()
}

pub(super) fn moved_obstacles(moved: &[MovedObstacle]) -> Digest {
    list(moved, |fields, MovedObstacle { name, centre_m }| {
        fields.text(name).f64(centre_m[0]).f64(centre_m[1]);
    })
}

pub(super) fn agent_commands(commands: &[AgentCommand]) -> Digest {
    list(commands, |fields, AgentCommand { agent, source, order }| {
        fields.u32(*agent).text(source);
        let (number, vector) = match order {
            AgentOrder::Velocity(vector) => (3, Some(vector)),
            AgentOrder::Waypoint(vector) => (4, Some(vector)),
            AgentOrder::Release => (5, None),
        };
        fields.u8(number);
        for &value in vector.into_iter().flatten() {
            fields.f64(value);
        }
    })
}

pub(super) fn mote_commands(commands: &[MoteCommand]) -> Digest {
    list(commands, |fields, MoteCommand { source, order }| {
        fields.text(source);
        match order {
            MoteOrder::Kill(mote) => fields.u8(2).u32(*mote),
            MoteOrder::Revive(mote) => fields.u8(3).u32(*mote),
            MoteOrder::Add(mote) => fields.u8(4).u32(*mote),
            MoteOrder::Jam { channel, from_ns, until_ns, centre_m, radius_m } => {
                fields.u8(5).u32(*channel).u64(*from_ns).u64(*until_ns);
                fields.f64(centre_m[0]).f64(centre_m[1]).f64(*radius_m)
            }
            MoteOrder::Send { mote, destination, payload } => {
                fields.u8(6).u32(*mote).u32(*destination).bytes(payload)
            }
        };
    })
}

pub(super) fn messages(messages: &[AgentMessage]) -> Digest {
    list(messages, |fields, AgentMessage { sender, destination, payload }| {
        fields.u32(*sender).u32(*destination).bytes(payload);
    })
}

pub(super) fn figures(figures: &[TaskFigure]) -> Digest {
    list(figures, |fields, TaskFigure { name, value }| {
        fields.text(name).f64(*value);
    })
}

/// Transmissions, who heard them, and what is known of each reception.
pub(super) fn deliveries(deliveries: Option<&Deliveries>) -> [Digest; 3] {
    let Some(deliveries) = deliveries.filter(|deliveries| !deliveries.transmissions.is_empty())
    else {
        return [ABSENT; 3];
    };
    let Deliveries { transmissions, heard, received_ns, rssi_dbm, hops, medium } = deliveries;
    let mut sent = Fields::default();
    sent.u32s(&transmissions.sender).u64s(&transmissions.sent_ns).u64s(&transmissions.end_ns);
    sent.payload_column(&transmissions.payloads).u32s(&transmissions.destination);
    let mut receptions = Fields::default();
    match heard {
        Heard::Lists { ends, indices } => receptions.u32s(ends).u32s(indices).bytes(&[]),
        Heard::Rows { bytes, .. } => receptions.u32s(&[]).u32s(&[]).bytes(bytes),
    };
    let mut links = Fields::default();
    links.u64s(received_ns).f32s(rssi_dbm).u32s(hops).length(medium.len());
    update(&mut links.0, medium, |medium| (medium as u32).to_le_bytes());
    [sent.end(), receptions.end(), links.end()]
}

pub(super) fn motes(motes: &MoteStates) -> Digest {
    let MoteStates { alive, synced, joined, rank, parent, queue_length } = motes;
    let mut fields = Fields::default();
    fields.bitmap(Some(alive)).bitmap(synced.as_ref()).bitmap(joined.as_ref());
    fields.u32s(rank).u32s(parent).u32s(queue_length);
    fields.end()
}

pub(super) fn formation(formation: &Formation) -> Digest {
    let Formation { formed_ns, missing, reason, reasons } = formation;
    let mut fields = Fields::default();
    fields.flag(formed_ns.is_some()).u64(formed_ns.unwrap_or(0)).u32s(missing).u32s(reason);
    fields.length(reasons.len());
    reasons.iter().for_each(|reason| {
        fields.text(reason);
    });
    fields.end()
}

pub(super) fn packets(packets: &Packets) -> Digest {
    let Packets {
        id,
        kind,
        source,
        destination,
        created_ns,
        ended_ns,
        hops,
        payload_bytes,
        outcome,
        kinds,
        reasons,
    } = packets;
    let mut fields = Fields::default();
    fields.u64s(id).u32s(kind).u32s(source).u32s(destination).u64s(created_ns).u64s(ended_ns);
    fields.u32s(hops).u32s(payload_bytes).u32s(outcome).length(kinds.len());
    for PacketKind { name, is_application, created } in kinds {
        fields.text(name).flag(*is_application).u64(*created);
    }
    fields.length(reasons.len());
    reasons.iter().for_each(|reason| {
        fields.text(reason);
    });
    fields.end()
}

pub(super) fn statistics(statistics: &MoteStatistics) -> Digest {
    let mut fields = Fields::default();
    fields.length(statistics.columns.len());
    for Statistic { name, unit, values, known } in &statistics.columns {
        fields.text(name).text(unit).f64s(values).bitmap(known.as_ref());
    }
    fields.end()
}

pub(super) fn schedule(schedule: &Schedule) -> Digest {
    let Schedule { mote, slotframe, slotframe_slots, slot, channel_offset, options, neighbour } =
        schedule;
    let mut fields = Fields::default();
    for column in [mote, slotframe, slotframe_slots, slot, channel_offset, options, neighbour] {
        fields.u32s(column);
    }
    fields.end()
}

pub(super) fn heard_links(links: &HeardLinks) -> Digest {
    let HeardLinks { receiver, sender, frames, rssi_dbm } = links;
    let mut fields = Fields::default();
    fields.u32s(receiver).u32s(sender).u64s(frames).f32s(rssi_dbm);
    fields.end()
}

pub(super) fn frames(frames: &Frames) -> Digest {
    let mut fields = Fields::default();
    fields.u64s(&frames.sent_ns);
    for column in [
        &frames.sender,
        &frames.destination,
        &frames.channel,
        &frames.channel_offset,
        &frames.kind,
        &frames.length_bytes,
    ] {
        fields.u32s(column);
    }
    fields.u64s(&frames.packet);
    let outcome: Vec<u32> = frames.outcome.iter().map(|outcome| *outcome as u32).collect();
    for column in [&frames.attempt, &frames.n_received, &frames.n_missed, &outcome] {
        fields.u32s(column);
    }
    fields.length(frames.kinds.len());
    for kind in &frames.kinds {
        fields.text(kind);
    }
    fields.end()
}

pub(super) fn capture(bytes: &[u8]) -> Digest {
    if bytes.is_empty() { ABSENT } else { Sha256::digest(bytes).into() }
}
