//! What crosses between the simulators, as valid values.

mod records;

pub use records::{
    Formation, FrameOutcome, Frames, HeardLinks, MoteStatistics, NetRecord, PacketKind,
    PacketPurpose, Packets, Schedule, Statistic, is_statistic_name,
};

use crate::config::Choice;
use bytes::Bytes;
use serde::{Deserialize, Serialize};

/// Nanoseconds in a second.
pub const NS_PER_S: u64 = 1_000_000_000;

/// Simulated time in seconds, for display and physics that take seconds. Exact below 104 days.
#[must_use]
pub fn seconds(time_ns: u64) -> f64 {
    time_ns as f64 / NS_PER_S as f64
}

/// One bit per entry, least significant bit of the first byte first. Spare bits are zero.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Bitmap {
    bytes: Vec<u8>,
    len: usize,
}

impl Bitmap {
    /// `len` bits, all equal to `value`.
    #[must_use]
    pub fn filled(len: usize, value: bool) -> Self {
        let mut bitmap = Self { bytes: vec![if value { 0xff } else { 0 }; len.div_ceil(8)], len };
        bitmap.clear_spare_bits();
        bitmap
    }

    /// Reads `len` bits from `bytes`; `None` if the length is wrong or a spare bit is set.
    #[must_use]
    pub fn from_bytes(bytes: &[u8], len: usize) -> Option<Self> {
        if bytes.len() != len.div_ceil(8) {
            return None;
        }
        let bitmap = Self { bytes: bytes.to_vec(), len };
        let mut cleared = bitmap.clone();
        cleared.clear_spare_bits();
        (cleared == bitmap).then_some(bitmap)
    }

    /// Sets bit `index`.
    pub fn set(&mut self, index: usize, value: bool) {
        assert!(index < self.len, "bit {index} of {}", self.len);
        let mask = 1 << (index % 8);
        if value {
            self.bytes[index / 8] |= mask;
        } else {
            self.bytes[index / 8] &= !mask;
        }
    }

    /// Bit `index`.
    #[must_use]
    pub fn get(&self, index: usize) -> bool {
        self.bytes[index / 8] >> (index % 8) & 1 == 1
    }

    /// Number of bits.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are no bits at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Number of bits that are set.
    #[must_use]
    pub fn count(&self) -> usize {
        self.bytes.iter().map(|byte| byte.count_ones() as usize).sum()
    }

    /// Indices of the bits that are set, ascending.
    pub fn iter_ones(&self) -> impl Iterator<Item = usize> + '_ {
        ones(&self.bytes)
    }

    /// The bits, packed.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes
    }

    fn clear_spare_bits(&mut self) {
        if !self.len.is_multiple_of(8)
            && let Some(last) = self.bytes.last_mut()
        {
            *last &= (1 << (self.len % 8)) - 1;
        }
    }
}

/// Indices of the bits set in `bytes`, ascending.
fn ones(bytes: &[u8]) -> impl Iterator<Item = usize> + '_ {
    bytes.iter().enumerate().flat_map(|(byte_idx, &byte)| {
        let mut rest = byte;
        std::iter::from_fn(move || {
            (rest != 0).then(|| {
                let bit = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                byte_idx * 8 + bit
            })
        })
    })
}

/// A named number per agent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Covariate {
    /// Name, with its unit as suffix.
    pub name: String,
    /// One value per agent.
    pub values: Vec<f64>,
}

/// Where the agents are. All columns have one entry per agent, or are empty where a column is optional.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AgentStates {
    /// Which agents exist.
    pub alive: Bitmap,
    /// Position, east (m).
    pub x_m: Vec<f64>,
    /// Position, north (m).
    pub y_m: Vec<f64>,
    /// Position, up (m).
    pub z_m: Vec<f64>,
    /// Velocity, east (m/s). Optional.
    pub vx_mps: Vec<f64>,
    /// Velocity, north (m/s). Optional.
    pub vy_mps: Vec<f64>,
    /// Velocity, up (m/s). Optional.
    pub vz_mps: Vec<f64>,
    /// Direction the body faces (rad). Optional.
    pub heading_rad: Vec<f64>,
    /// Further numbers per agent.
    pub covariates: Vec<Covariate>,
}

impl AgentStates {
    /// `n` agents, all alive, at the origin and at rest, without headings.
    #[must_use]
    pub fn at_origin(n: usize) -> Self {
        let zeros = || vec![0.0; n];
        Self {
            alive: Bitmap::filled(n, true),
            x_m: zeros(),
            y_m: zeros(),
            z_m: zeros(),
            vx_mps: zeros(),
            vy_mps: zeros(),
            vz_mps: zeros(),
            heading_rad: Vec::new(),
            covariates: Vec::new(),
        }
    }

    /// Agents, all alive, at these places of the ground (m), at rest, without headings.
    #[must_use]
    pub fn at_rest(places_m: &[[f64; 2]]) -> Self {
        Self {
            x_m: places_m.iter().map(|place| place[0]).collect(),
            y_m: places_m.iter().map(|place| place[1]).collect(),
            ..Self::at_origin(places_m.len())
        }
    }

    /// Where the body of an agent faces (rad); of one without a heading, where it goes.
    #[must_use]
    pub fn facing_rad(&self, agent: usize) -> f64 {
        let of = |column: &[f64]| column.get(agent).copied();
        let [vx, vy] = [&self.vx_mps, &self.vy_mps].map(|v| of(v).unwrap_or_default());
        of(&self.heading_rad).unwrap_or_else(|| libm::atan2(vy, vx))
    }

    /// Capacity: alive or not.
    #[must_use]
    pub fn len(&self) -> usize {
        self.x_m.len()
    }

    /// Whether there is no agent at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.x_m.is_empty()
    }

    /// Position of an agent (m).
    #[must_use]
    pub fn position_m(&self, agent: usize) -> [f64; 3] {
        [self.x_m[agent], self.y_m[agent], self.z_m[agent]]
    }
}

/// Opaque byte strings, end to end.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Payloads {
    length_bytes: Vec<u32>,
    data: Bytes,
}

impl Payloads {
    /// `n` agents that say nothing.
    #[must_use]
    pub fn silence(n: usize) -> Self {
        Self { length_bytes: vec![0; n], data: Bytes::new() }
    }

    /// `None` unless `data` is as long as the sum of the lengths.
    #[must_use]
    pub fn new(length_bytes: Vec<u32>, data: Bytes) -> Option<Self> {
        let total: u64 = length_bytes.iter().map(|&length| u64::from(length)).sum();
        (total == data.len() as u64).then_some(Self { length_bytes, data })
    }

    /// Number of payloads.
    #[must_use]
    pub fn len(&self) -> usize {
        self.length_bytes.len()
    }

    /// Whether there is no payload, not even an empty one.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.length_bytes.is_empty()
    }

    /// Length of each (bytes).
    #[must_use]
    pub fn length_bytes(&self) -> &[u32] {
        &self.length_bytes
    }

    /// All of them, end to end.
    #[must_use]
    pub fn data(&self) -> &Bytes {
        &self.data
    }

    /// What is wrong if a payload is longer than a network can broadcast (bytes): the first such agent.
    ///
    /// # Errors
    ///
    /// In words, beginning with the field.
    pub fn check_lengths(&self, most: Option<u32>) -> Result<(), String> {
        let Some(most) = most else { return Ok(()) };
        match self.length_bytes.iter().position(|&length| most < length) {
            None => Ok(()),
            Some(agent) => Err(format!(
                "payloads: robot {agent} broadcasts {} bytes, and the network carries at most {most} bytes in a broadcast",
                self.length_bytes[agent]
            )),
        }
    }

    /// Each payload in turn.
    pub fn iter(&self) -> impl Iterator<Item = &[u8]> + '_ {
        let mut rest = &self.data[..];
        self.length_bytes.iter().map(move |&length| {
            let (payload, after) = rest.split_at(length as usize);
            rest = after;
            payload
        })
    }
}

/// What was on the air, each transmission once, in the order (`sent_ns`, `sender`). Columns of equal length.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Transmissions {
    /// The agent that sent it.
    pub sender: Vec<u32>,
    /// When its first bit was sent (ns).
    pub sent_ns: Vec<u64>,
    /// When its last bit had arrived (ns).
    pub end_ns: Vec<u64>,
    /// What was sent.
    pub payloads: Payloads,
    /// For whom: an agent, or [`EVERYONE`]. Empty: all of them for everyone.
    pub destination: Vec<u32>,
}

/// The destination of what is for everyone in reach.
pub const EVERYONE: u32 = u32::MAX;

impl Transmissions {
    /// The agent that a transmission is for; `None`: everyone in reach.
    #[must_use]
    pub fn destination(&self, index: usize) -> Option<u32> {
        self.destination.get(index).copied().filter(|&agent| agent != EVERYONE)
    }

    /// Number of transmissions.
    #[must_use]
    pub fn len(&self) -> usize {
        self.sender.len()
    }

    /// Whether nothing was sent.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.sender.is_empty()
    }
}

/// Who heard which transmission.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Heard {
    /// Receiver `r` heard the transmissions `indices[ends[r - 1]..ends[r]]`, ascending.
    Lists {
        /// Where each receiver's list ends. One entry per agent, or none if nothing was transmitted.
        ends: Vec<u32>,
        /// Indices into the transmissions.
        indices: Vec<u32>,
    },
    /// One row of `ceil(transmissions / 8)` bytes per receiver.
    Rows {
        /// The rows, receiver 0 first.
        bytes: Bytes,
        /// Bytes in a row, at least 1.
        row_bytes: usize,
    },
}

impl Default for Heard {
    fn default() -> Self {
        Self::Lists { ends: Vec::new(), indices: Vec::new() }
    }
}

/// What carried a delivery, numbered as in the contract.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Medium {
    /// The radio mesh.
    Radio = 1,
    /// Nothing: the ideal baseline.
    Truth = 2,
    /// A broadcast medium beside the radio mesh.
    Second = 3,
}

/// A column of [`Deliveries`] that is filled in only on request, numbered as in the contract.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum DeliveryColumn {
    /// [`Deliveries::received_ns`].
    ReceivedNs = 1,
    /// [`Deliveries::rssi_dbm`].
    RssiDbm = 2,
    /// [`Deliveries::hops`].
    Hops = 3,
    /// [`Deliveries::medium`].
    Medium = 4,
}

/// What was delivered during a period. Optional columns have one entry per delivery, in the order (receiver, index).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Deliveries {
    /// What was on the air.
    pub transmissions: Transmissions,
    /// Who heard it.
    pub heard: Heard,
    /// When each delivery was complete (ns). Empty: at the transmission's end.
    pub received_ns: Vec<u64>,
    /// Received signal strength of each (dBm). Optional.
    pub rssi_dbm: Vec<f32>,
    /// Hops each took. Empty: 1.
    pub hops: Vec<u32>,
    /// What carried each. Empty: radio.
    pub medium: Vec<Medium>,
}

impl Deliveries {
    /// Indices of the transmissions that `receiver` heard, ascending.
    pub fn heard_by(&self, receiver: usize) -> impl Iterator<Item = usize> + '_ {
        let (list, row): (&[u32], &[u8]) = match &self.heard {
            Heard::Lists { ends, indices } => {
                let end = ends.get(receiver).map_or(0, |&end| end as usize);
                let start = if receiver == 0 {
                    0
                } else {
                    ends.get(receiver - 1).map_or(0, |&start| start as usize)
                };
                (&indices[start..end], &[])
            }
            Heard::Rows { bytes, row_bytes } => {
                (&[], &bytes[receiver * row_bytes..(receiver + 1) * row_bytes])
            }
        };
        list.iter().map(|&index| index as usize).chain(ones(row))
    }

    /// Number of deliveries.
    #[must_use]
    pub fn n_deliveries(&self) -> usize {
        match &self.heard {
            Heard::Lists { indices, .. } => indices.len(),
            Heard::Rows { bytes, .. } => bytes.iter().map(|byte| byte.count_ones() as usize).sum(),
        }
    }
}

/// The state of each mote. Optional columns are empty where the network has no such state.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MoteStates {
    /// Whose radio works.
    pub alive: Bitmap,
    /// Synchronised to the network. Optional.
    pub synced: Option<Bitmap>,
    /// Joined. Optional.
    pub joined: Option<Bitmap>,
    /// Routing rank. Optional.
    pub rank: Vec<u32>,
    /// Preferred parent, `u32::MAX` for none. Optional.
    pub parent: Vec<u32>,
    /// Packets waiting. Optional.
    pub queue_length: Vec<u32>,
}

impl MoteStates {
    /// `n` motes whose radios work and of which no more is known: those of a network that reports no motes.
    #[must_use]
    pub fn all_working(n: usize) -> Self {
        Self { alive: Bitmap::filled(n, true), ..Self::default() }
    }
}

/// An order to an agent.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum AgentOrder {
    /// Hold this velocity (m/s).
    Velocity([f64; 3]),
    /// Go to this point (m) and stay.
    Waypoint([f64; 3]),
    /// Return to its own controller.
    Release,
}

/// An order to one agent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AgentCommand {
    /// The agent.
    pub agent: u32,
    /// Who commands it.
    pub source: String,
    /// What it is to do.
    pub order: AgentOrder,
}

/// A scheduled event of a mote or of the air.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum MoteOrder {
    /// The radio of a mote fails.
    Kill(u32),
    /// The radio of a mote works again.
    Revive(u32),
    /// A mote joins.
    Add(u32),
    /// Noise on a channel.
    Jam {
        /// IEEE 802.15.4 channel, 11 to 26.
        channel: u32,
        /// From when (ns).
        from_ns: u64,
        /// Until when (ns).
        until_ns: u64,
        /// Centre of the disc (m).
        centre_m: [f64; 2],
        /// Its radius (m); 0: everywhere.
        radius_m: f64,
    },
    /// One packet more.
    Send {
        /// Who sends it.
        mote: u32,
        /// To whom; [`EVERYONE`]: everyone in reach.
        destination: u32,
        /// What.
        payload: Bytes,
    },
}

impl MoteOrder {
    /// Which announced kind of order this is.
    #[must_use]
    pub fn kind(&self) -> MoteCommandKind {
        match self {
            Self::Kill(_) => MoteCommandKind::Kill,
            Self::Revive(_) => MoteCommandKind::Revive,
            Self::Add(_) => MoteCommandKind::Add,
            Self::Jam { .. } => MoteCommandKind::Jam,
            Self::Send { .. } => MoteCommandKind::Send,
        }
    }
}

/// A kind of [`MoteOrder`]: a network announces the kinds that it obeys.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MoteCommandKind {
    /// [`MoteOrder::Kill`].
    Kill,
    /// [`MoteOrder::Revive`].
    Revive,
    /// [`MoteOrder::Add`].
    Add,
    /// [`MoteOrder::Jam`].
    Jam,
    /// [`MoteOrder::Send`].
    Send,
}

/// A fault or some traffic.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MoteCommand {
    /// Who orders it.
    pub source: String,
    /// What happens.
    pub order: MoteOrder,
}

/// A message from one agent to another, over however many hops.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AgentMessage {
    /// Who sends it.
    pub sender: u32,
    /// For whom; not the sender.
    pub destination: u32,
    /// What; not empty.
    pub payload: Bytes,
}

/// A number that the robots have for how far their task is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TaskFigure {
    /// Its name: see [`is_statistic_name`].
    pub name: String,
    /// Its value.
    pub value: f64,
}

/// An obstacle of the site that has moved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MovedObstacle {
    /// Its name, as in the site.
    pub name: String,
    /// Its centre (m).
    pub centre_m: [f64; 2],
}

/// How the two simulators take turns, numbered as in the contract.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Coupling {
    /// Robots first, then the network over their new positions.
    Sequential = 1,
    /// Both at once, each on what the other reached before.
    Parallel = 2,
    /// The network first, to its first delivery; the robots follow.
    Event = 3,
}

/// What both simulators receive when an experiment begins.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Experiment {
    /// Seed of every draw.
    pub seed: u64,
    /// Capacity, at least 1.
    pub agent_count: usize,
    /// Nominal control period (ns), at least 1.
    pub step_ns: u64,
    /// Who takes turns how.
    pub coupling: Coupling,
}

#[cfg(test)]
mod tests;
