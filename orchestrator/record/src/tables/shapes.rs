//! What each table is: the data dictionary in docs/outputs.md says the same.

use crate::table::{ColumnKind, ColumnShape, TableShape};

/// The shapes of all tables.
pub const TABLES: [&TableShape; 8] =
    [&STEPS, &LINKS, &TRANSMISSIONS, &PACKETS, &MOTES, &SCHEDULE, &NEIGHBOURS, &FRAMES];

const STEP: ColumnShape = ColumnShape {
    name: "step",
    kind: ColumnKind::U64,
    null_when: "",
    doc: "The step, from 1; 0 is the beginning of the run.",
};
const TIME: ColumnShape = ColumnShape {
    name: "time_ns",
    kind: ColumnKind::U64,
    null_when: "",
    doc: "Simulated time at the end of the step (ns).",
};
const NOT_KNOWN: &str = "the robot simulator does not report it";
const NO_SUCH_STATE: &str = "the network has no such state";
const NOT_RECEIVED: &str = "not received";
const NO_PACKETS: &str = "the network has reported no packets";
const NONE_DELIVERED: &str = "none was delivered";

/// Tables: a comment says what a row is, and what a column means. In brackets: columns that several tables begin with.
macro_rules! tables {
    ($(
        $(#[doc = $row:literal])+
        $table:ident = $file:literal: [$($first:ident),*] {
            $($(#[doc = $doc:literal])+ $name:ident: $kind:ident $(, null if $null_when:expr)?;)+
        }
    )+) => {$(
        pub(super) const $table: TableShape = TableShape {
            file: $file,
            row: concat!($($row),+).trim_ascii_start(),
            columns: &[
                $($first,)*
                $(ColumnShape {
                    name: stringify!($name),
                    kind: ColumnKind::$kind,
                    null_when: [$($null_when,)? ""][0],
                    doc: concat!($($doc),+).trim_ascii_start(),
                },)+
            ],
        };
    )+};
}

tables! {
    /// An agent at the end of a step, alive or not, and at the beginning (step 0).
    STEPS = "steps.parquet": [STEP, TIME] {
        /// The agent, from 0.
        agent: U32;
        /// The agent exists. If false, the other columns of the row have no meaning.
        alive: Bool;
        /// Position, east (m).
        x_m: F64;
        /// Position, north (m).
        y_m: F64;
        /// Position, up (m).
        z_m: F64;
        /// Velocity over the step, east (m/s).
        vx_mps: F64, null if NOT_KNOWN;
        /// Velocity over the step, north (m/s).
        vy_mps: F64, null if NOT_KNOWN;
        /// Velocity over the step, up (m/s).
        vz_mps: F64, null if NOT_KNOWN;
        /// Heading of the body (rad, from +x towards +y).
        heading_rad: F64, null if "bodies have no heading";
        /// Number of other agents from which it received a frame in the step's period, each counted once.
        n_heard: U32;
    }

    /// A transmission and an alive agent that is a potential receiver; `output.links` selects which are kept.
    LINKS = "links.parquet": [STEP, TIME] {
        /// The agent that sent.
        sender: U32;
        /// The potential receiver.
        receiver: U32;
        /// When the first bit was sent (ns).
        sent_ns: U64;
        /// Distance between both, at the positions that the network used during the period (m).
        distance_m: F64;
        /// It was delivered.
        received: Bool;
        /// When it was delivered (ns).
        received_ns: U64, null if NOT_RECEIVED;
        /// Received signal strength (dBm).
        rssi_dbm: F32, null if "not received, or the network does not report it";
        /// Number of hops.
        hops: U32, null if NOT_RECEIVED;
    }

    /// A payload that a robot sent.
    TRANSMISSIONS = "transmissions.parquet": [] {
        /// The step in whose period it was sent, from 1.
        step: U64;
        /// The agent that sent it.
        sender: U32;
        /// When its first bit was sent (ns).
        sent_ns: U64;
        /// When its last bit had arrived (ns).
        end_ns: U64;
        /// Length of its payload (bytes).
        payload_bytes: U32;
        /// Number of other agents that received it.
        n_receivers: U32;
        /// The destination. A unicast payload has a row only if it arrived.
        destination: U32, null if "it was a broadcast";
    }

    /// A packet that was delivered to its destination, over any number of hops and frames, or dropped.
    PACKETS = "packets.parquet": [] {
        /// The step in which it ended, from 1.
        step: U64;
        /// Its number, unique within the run.
        packet: U64;
        /// Kind of the packet, as named by the network.
        kind: Text;
        /// The mote that created it.
        source: U32;
        /// The destination mote.
        destination: U32, null if "it was a broadcast";
        /// When it was created (ns).
        created_ns: U64;
        /// When the last frame that it took had ended, or when it was dropped (ns).
        ended_ns: U64;
        /// Number of hops until then.
        hops: U32;
        /// Its payload (bytes), without any header.
        payload_bytes: U32;
        /// It was delivered. A broadcast counts as delivered when it was sent.
        delivered: Bool;
        /// Why it was dropped, as named by the network.
        drop_reason: Text, null if "delivered";
    }

    /// A mote at the end of a step, and at the beginning (step 0). Mote i is the radio of agent i. Further columns of type f64
    /// follow, one for each statistic that the network keeps.
    MOTES = "motes.parquet": [STEP, TIME] {
        /// The mote, from 0.
        mote: U32;
        /// Its radio works.
        alive: Bool;
        /// Synchronised to the network.
        synced: Bool, null if NO_SUCH_STATE;
        /// Joined the network.
        joined: Bool, null if NO_SUCH_STATE;
        /// Routing rank (RFC 6550).
        rank: U32, null if NO_SUCH_STATE;
        /// Preferred parent, a mote.
        parent: U32, null if "the mote has none, or the network has no such state";
        /// Packets waiting.
        queue_length: U32, null if NO_SUCH_STATE;
        /// Number of the mote's application packets to one destination that were delivered until then.
        delivered: U64, null if NO_PACKETS;
        /// Number of the same packets that were dropped.
        dropped: U64, null if NO_PACKETS;
        /// Latency from creation to delivery, mean over delivered packets (s).
        mean_latency_s: F64, null if NONE_DELIVERED;
        /// Latency, median (s).
        median_latency_s: F64, null if NONE_DELIVERED;
        /// Latency, 95 % quantile (s).
        p95_latency_s: F64, null if NONE_DELIVERED;
        /// Latency, 99 % quantile (s).
        p99_latency_s: F64, null if NONE_DELIVERED;
        /// Latency, maximum (s).
        max_latency_s: F64, null if NONE_DELIVERED;
        /// Number of hops of delivered packets, mean.
        mean_hops: F64, null if NONE_DELIVERED;
    }

    /// A cell of a mote's schedule, at the end of the first step after formation and of the last step.
    SCHEDULE = "schedule.parquet": [STEP, TIME] {
        /// The mote, from 0.
        mote: U32;
        /// Handle of the slotframe.
        slotframe: U32;
        /// Length of that slotframe (slots).
        slotframe_slots: U32;
        /// Slot offset.
        slot: U32;
        /// Channel offset.
        channel_offset: U32;
        /// The mote may transmit in it.
        transmits: Bool;
        /// The mote listens in it.
        receives: Bool;
        /// Other motes may transmit in it as well (shared cell).
        is_shared: Bool;
        /// Frames in it are used for time synchronisation.
        keeps_time: Bool;
        /// It takes precedence over cells of other slotframes.
        has_priority: Bool;
        /// The mote at the other end.
        neighbour: U32, null if "any";
    }

    /// A mote that has received frames from another one until the end of a step: the first step after formation, and the last.
    NEIGHBOURS = "neighbours.parquet": [STEP, TIME] {
        /// The mote that received.
        receiver: U32;
        /// The mote that sent.
        sender: U32;
        /// Frames received.
        frames: U64;
        /// Their mean received signal strength (dBm).
        rssi_dbm: F32, null if "the network does not report it";
    }

    /// A frame on the air, acknowledgments apart, in the order of time and sender.
    FRAMES = "frames.parquet": [] {
        /// The step in which it was sent, from 1.
        step: U64;
        /// Beginning of the slot in which it was sent (ns).
        sent_ns: U64;
        /// The mote that sent it.
        sender: U32;
        /// The mote it was for.
        destination: U32, null if "it was a broadcast";
        /// IEEE 802.15.4 channel; 11 to 26 at 2.4 GHz.
        channel: U32;
        /// Channel offset of the cell.
        channel_offset: U32, null if "sent in no cell";
        /// Kind of the frame, as named by the network.
        kind: Text;
        /// Length of the frame (PSDU, bytes).
        length_bytes: U32;
        /// The packet that it carries or is a part of, as in `packets.parquet`.
        packet: U64, null if "it carries none that is counted";
        /// How often this frame was sent, this time included.
        attempt: U32;
        /// Number of motes that received it.
        n_received: U32;
        /// Number of motes in reach that listened on its channel and did not receive it.
        n_missed: U32;
        /// `acknowledged`; `not-acknowledged`: its destination received it, and the acknowledgment was lost; `lost`; or
        /// `broadcast`.
        outcome: Text;
    }
}
