//! What each table is: the data dictionary in docs/outputs.md says the same.

use crate::table::{ColumnKind, ColumnShape, TableShape};

/// The shapes of all tables.
pub const TABLES: [&TableShape; 8] =
    [&STEPS, &LINKS, &TRANSMISSIONS, &PACKETS, &MOTES, &SCHEDULE, &NEIGHBOURS, &FRAMES];

const STEP: ColumnShape =
    never_null("step", ColumnKind::U64, "The step, from 1; 0 is the beginning of the run.");
const TIME: ColumnShape =
    never_null("time_ns", ColumnKind::U64, "Simulated time at the end of the step (ns).");
const NOT_KNOWN: &str = "the robot simulator does not report it";
const NO_SUCH_STATE: &str = "the network has no such state";
const NOT_RECEIVED: &str = "not received";

pub(super) const STEPS: TableShape = TableShape {
    file: "steps.parquet",
    row: "An agent at the end of a step, alive or not, and at the beginning (step 0).",
    columns: &[
        STEP,
        TIME,
        never_null("agent", ColumnKind::U32, "The agent, from 0."),
        never_null(
            "alive",
            ColumnKind::Bool,
            "The agent exists. If false, the other columns of the row have no meaning.",
        ),
        never_null("x_m", ColumnKind::F64, "Position, east (m)."),
        never_null("y_m", ColumnKind::F64, "Position, north (m)."),
        never_null("z_m", ColumnKind::F64, "Position, up (m)."),
        nullable("vx_mps", ColumnKind::F64, NOT_KNOWN, "Velocity over the step, east (m/s)."),
        nullable("vy_mps", ColumnKind::F64, NOT_KNOWN, "Velocity over the step, north (m/s)."),
        nullable("vz_mps", ColumnKind::F64, NOT_KNOWN, "Velocity over the step, up (m/s)."),
        nullable(
            "heading_rad",
            ColumnKind::F64,
            "bodies have no heading",
            "Heading of the body (rad, from +x towards +y).",
        ),
        never_null(
            "n_heard",
            ColumnKind::U32,
            "Number of other agents from which it received a frame in the step's period, each counted once.",
        ),
    ],
};

pub(super) const LINKS: TableShape = TableShape {
    file: "links.parquet",
    row: "A transmission and an alive agent that is a potential receiver; `output.links` selects which are kept.",
    columns: &[
        STEP,
        TIME,
        never_null("sender", ColumnKind::U32, "The agent that sent."),
        never_null("receiver", ColumnKind::U32, "The potential receiver."),
        never_null("sent_ns", ColumnKind::U64, "When the first bit was sent (ns)."),
        never_null(
            "distance_m",
            ColumnKind::F64,
            "Distance between both, at the positions that the network used during the period (m).",
        ),
        never_null("received", ColumnKind::Bool, "It was delivered."),
        nullable("received_ns", ColumnKind::U64, NOT_RECEIVED, "When it was delivered (ns)."),
        nullable(
            "rssi_dbm",
            ColumnKind::F32,
            "not received, or the network does not report it",
            "Received signal strength (dBm).",
        ),
        nullable("hops", ColumnKind::U32, NOT_RECEIVED, "Number of hops."),
    ],
};

pub(super) const TRANSMISSIONS: TableShape = TableShape {
    file: "transmissions.parquet",
    row: "A payload that a robot sent.",
    columns: &[
        never_null("step", ColumnKind::U64, "The step in whose period it was sent, from 1."),
        never_null("sender", ColumnKind::U32, "The agent that sent it."),
        never_null("sent_ns", ColumnKind::U64, "When its first bit was sent (ns)."),
        never_null("end_ns", ColumnKind::U64, "When its last bit had arrived (ns)."),
        never_null("payload_bytes", ColumnKind::U32, "Length of its payload (bytes)."),
        never_null("n_receivers", ColumnKind::U32, "Number of other agents that received it."),
        nullable(
            "destination",
            ColumnKind::U32,
            "it was a broadcast",
            "The destination. A unicast payload has a row only if it arrived.",
        ),
    ],
};

pub(super) const PACKETS: TableShape = TableShape {
    file: "packets.parquet",
    row: "A packet that was delivered to its destination, over any number of hops and frames, or dropped.",
    columns: &[
        never_null("step", ColumnKind::U64, "The step in which it ended, from 1."),
        never_null("packet", ColumnKind::U64, "Its number, unique within the run."),
        never_null("kind", ColumnKind::Text, "Kind of the packet, as named by the network."),
        never_null("source", ColumnKind::U32, "The mote that created it."),
        nullable("destination", ColumnKind::U32, "it was a broadcast", "The destination mote."),
        never_null("created_ns", ColumnKind::U64, "When it was created (ns)."),
        never_null(
            "ended_ns",
            ColumnKind::U64,
            "When the last frame that it took had ended, or when it was dropped (ns).",
        ),
        never_null("hops", ColumnKind::U32, "Number of hops until then."),
        never_null("payload_bytes", ColumnKind::U32, "Its payload (bytes), without any header."),
        never_null(
            "delivered",
            ColumnKind::Bool,
            "It was delivered. A broadcast counts as delivered when it was sent.",
        ),
        nullable(
            "drop_reason",
            ColumnKind::Text,
            "delivered",
            "Why it was dropped, as named by the network.",
        ),
    ],
};

pub(super) const MOTES: TableShape = TableShape {
    file: "motes.parquet",
    row: "A mote at the end of a step, and at the beginning (step 0). Mote i is the radio of agent i. Further columns of \
          type f64 follow, one for each statistic that the network keeps.",
    columns: &[
        STEP,
        TIME,
        never_null("mote", ColumnKind::U32, "The mote, from 0."),
        never_null("alive", ColumnKind::Bool, "Its radio works."),
        nullable("synced", ColumnKind::Bool, NO_SUCH_STATE, "Synchronised to the network."),
        nullable("joined", ColumnKind::Bool, NO_SUCH_STATE, "Joined the network."),
        nullable("rank", ColumnKind::U32, NO_SUCH_STATE, "Routing rank (RFC 6550)."),
        nullable(
            "parent",
            ColumnKind::U32,
            "the mote has none, or the network has no such state",
            "Preferred parent, a mote.",
        ),
        nullable("queue_length", ColumnKind::U32, NO_SUCH_STATE, "Packets waiting."),
        nullable(
            "delivered",
            ColumnKind::U64,
            NO_PACKETS,
            "Number of the mote's application packets to one destination that were delivered until then.",
        ),
        nullable(
            "dropped",
            ColumnKind::U64,
            NO_PACKETS,
            "Number of the same packets that were dropped.",
        ),
        latency(
            "mean_latency_s",
            "Latency from creation to delivery, mean over delivered packets (s).",
        ),
        latency("median_latency_s", "Latency, median (s)."),
        latency("p95_latency_s", "Latency, 95 % quantile (s)."),
        latency("p99_latency_s", "Latency, 99 % quantile (s)."),
        latency("max_latency_s", "Latency, maximum (s)."),
        latency("mean_hops", "Number of hops of delivered packets, mean."),
    ],
};

const NO_PACKETS: &str = "the network has reported no packets";

const fn latency(name: &'static str, doc: &'static str) -> ColumnShape {
    nullable(name, ColumnKind::F64, "none was delivered", doc)
}

const OF_MOTE: &str = "The mote, from 0.";

pub(super) const SCHEDULE: TableShape = TableShape {
    file: "schedule.parquet",
    row: "A cell of a mote's schedule, at the end of the first step after formation and of the last step.",
    columns: &[
        STEP,
        TIME,
        never_null("mote", ColumnKind::U32, OF_MOTE),
        never_null("slotframe", ColumnKind::U32, "Handle of the slotframe."),
        never_null("slotframe_slots", ColumnKind::U32, "Length of that slotframe (slots)."),
        never_null("slot", ColumnKind::U32, "Slot offset."),
        never_null("channel_offset", ColumnKind::U32, "Channel offset."),
        never_null("transmits", ColumnKind::Bool, "The mote may transmit in it."),
        never_null("receives", ColumnKind::Bool, "The mote listens in it."),
        never_null(
            "is_shared",
            ColumnKind::Bool,
            "Other motes may transmit in it as well (shared cell).",
        ),
        never_null(
            "keeps_time",
            ColumnKind::Bool,
            "Frames in it are used for time synchronisation.",
        ),
        never_null(
            "has_priority",
            ColumnKind::Bool,
            "It takes precedence over cells of other slotframes.",
        ),
        nullable("neighbour", ColumnKind::U32, "any", "The mote at the other end."),
    ],
};

pub(super) const NEIGHBOURS: TableShape = TableShape {
    file: "neighbours.parquet",
    row: "A mote that has received frames from another one until the end of a step: the first step after formation, and \
          the last.",
    columns: &[
        STEP,
        TIME,
        never_null("receiver", ColumnKind::U32, "The mote that received."),
        never_null("sender", ColumnKind::U32, "The mote that sent."),
        never_null("frames", ColumnKind::U64, "Frames received."),
        nullable(
            "rssi_dbm",
            ColumnKind::F32,
            "the network does not report it",
            "Their mean received signal strength (dBm).",
        ),
    ],
};

pub(super) const FRAMES: TableShape = TableShape {
    file: "frames.parquet",
    row: "A frame on the air, acknowledgments apart, in the order of time and sender.",
    columns: &[
        never_null("step", ColumnKind::U64, "The step in which it was sent, from 1."),
        never_null("sent_ns", ColumnKind::U64, "Beginning of the slot in which it was sent (ns)."),
        never_null("sender", ColumnKind::U32, "The mote that sent it."),
        nullable("destination", ColumnKind::U32, "it was a broadcast", "The mote it was for."),
        never_null("channel", ColumnKind::U32, "IEEE 802.15.4 channel; 11 to 26 at 2.4 GHz."),
        nullable(
            "channel_offset",
            ColumnKind::U32,
            "sent in no cell",
            "Channel offset of the cell.",
        ),
        never_null("kind", ColumnKind::Text, "Kind of the frame, as named by the network."),
        never_null("length_bytes", ColumnKind::U32, "Length of the frame (PSDU, bytes)."),
        nullable(
            "packet",
            ColumnKind::U64,
            "it carries none that is counted",
            "The packet that it carries or is a part of, as in `packets.parquet`.",
        ),
        never_null(
            "attempt",
            ColumnKind::U32,
            "How often this frame was sent, this time included.",
        ),
        never_null("n_received", ColumnKind::U32, "Number of motes that received it."),
        never_null(
            "n_missed",
            ColumnKind::U32,
            "Number of motes in reach that listened on its channel and did not receive it.",
        ),
        never_null(
            "outcome",
            ColumnKind::Text,
            "`acknowledged`; `not-acknowledged`: its destination received it, and the acknowledgment was lost; `lost`; or \
             `broadcast`.",
        ),
    ],
};

const fn never_null(name: &'static str, kind: ColumnKind, doc: &'static str) -> ColumnShape {
    ColumnShape { name, kind, null_when: "", doc }
}

const fn nullable(
    name: &'static str,
    kind: ColumnKind,
    null_when: &'static str,
    doc: &'static str,
) -> ColumnShape {
    ColumnShape { name, kind, null_when, doc }
}
