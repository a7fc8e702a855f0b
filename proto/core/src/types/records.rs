//! What a network keeps for the record of a run, as valid values. `netsim.proto` defines each of them.

use super::Bitmap;
use crate::config::Choice;
use serde::{Deserialize, Serialize};

/// Something that a network keeps only on request, numbered as in the contract.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum NetRecord {
    /// [`Packets`], in every step.
    Packets = 1,
    /// The radio's traffic as a capture file, in every step.
    Capture = 2,
    /// [`MoteStatistics`], in steps that ask for them.
    Statistics = 3,
    /// [`Schedule`], in steps that ask for it.
    Schedule = 4,
    /// [`HeardLinks`], in steps that ask for them.
    HeardLinks = 5,
    /// [`Frames`], in every step.
    Frames = 6,
}

impl NetRecord {
    /// Whether it is a state, sent in steps that ask for it, rather than events, sent in every step.
    #[must_use]
    pub fn is_state(self) -> bool {
        match self {
            Self::Packets | Self::Capture | Self::Frames => false,
            Self::Statistics | Self::Schedule | Self::HeardLinks => true,
        }
    }
}

/// What a packet is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum PacketPurpose {
    /// An application's.
    Application,
    /// The swarm's, to one neighbour.
    Swarm,
    /// Ordered from outside.
    Ordered,
    /// A request to be admitted, from the pledge to the registrar, or a response, on its way back.
    Join,
    /// A CoAP exchange: from the first transmission of the request, by its client, to the response.
    Exchange,
    /// A download of a large representation: from its begin to its last block.
    Download,
}

impl PacketPurpose {
    /// All kinds of packets.
    pub const ALL: [Self; 6] =
        [Self::Application, Self::Swarm, Self::Ordered, Self::Join, Self::Exchange, Self::Download];
    /// Those of a network without applications that use CoAP.
    pub const WITHOUT_COAP: [Self; 4] = [Self::Application, Self::Swarm, Self::Ordered, Self::Join];

    /// Its name in records.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Application => "app",
            Self::Swarm => "swarm",
            Self::Ordered => "ordered",
            Self::Join => "join",
            Self::Exchange => "exchange",
            Self::Download => "download",
        }
    }
}

/// A kind of packet.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PacketKind {
    /// Its name.
    pub name: String,
    /// End-to-end delivery is judged by packets of this kind.
    pub is_application: bool,
    /// Packets of this kind since the experiment began.
    pub created: u64,
}

/// Packets whose way ended during a step, in the order (`ended_ns`, `id`). Columns of equal length.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Packets {
    /// Number of the packet, unique within the experiment.
    pub id: Vec<u64>,
    /// Index into `kinds`.
    pub kind: Vec<u32>,
    /// The mote that created it.
    pub source: Vec<u32>,
    /// The mote it was for; [`EVERYONE`](super::EVERYONE): everyone in reach.
    pub destination: Vec<u32>,
    /// When it was created (ns).
    pub created_ns: Vec<u64>,
    /// When the last frame that it took had ended, or when it was dropped (ns).
    pub ended_ns: Vec<u64>,
    /// Hops it took until then.
    pub hops: Vec<u32>,
    /// Its payload (bytes), without any header.
    pub payload_bytes: Vec<u32>,
    /// 0: delivered. i, from 1: dropped for `reasons[i - 1]`.
    pub outcome: Vec<u32>,
    /// All kinds known, in the same order always; more may follow later.
    pub kinds: Vec<PacketKind>,
    /// Why packets are dropped, in the same order always; more may follow later.
    pub reasons: Vec<String>,
}

impl Packets {
    /// Number of packets that ended.
    #[must_use]
    pub fn len(&self) -> usize {
        self.id.len()
    }

    /// Whether none ended.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.id.is_empty()
    }

    /// Adds packets that ended later.
    pub fn append(&mut self, later: &Self) {
        self.id.extend(&later.id);
        self.kind.extend(&later.kind);
        self.source.extend(&later.source);
        self.destination.extend(&later.destination);
        self.created_ns.extend(&later.created_ns);
        self.ended_ns.extend(&later.ended_ns);
        self.hops.extend(&later.hops);
        self.payload_bytes.extend(&later.payload_bytes);
        self.outcome.extend(&later.outcome);
        self.kinds.clone_from(&later.kinds);
        self.reasons.clone_from(&later.reasons);
    }

    /// The packets that are to be kept, each asked by its index, in order.
    #[must_use]
    pub fn filtered(&self, mut keep: impl FnMut(usize) -> bool) -> Self {
        let indices: Vec<usize> = (0..self.len()).filter(|&index| keep(index)).collect();
        Self {
            id: chosen(&self.id, &indices),
            kind: chosen(&self.kind, &indices),
            source: chosen(&self.source, &indices),
            destination: chosen(&self.destination, &indices),
            created_ns: chosen(&self.created_ns, &indices),
            ended_ns: chosen(&self.ended_ns, &indices),
            hops: chosen(&self.hops, &indices),
            payload_bytes: chosen(&self.payload_bytes, &indices),
            outcome: chosen(&self.outcome, &indices),
            kinds: self.kinds.clone(),
            reasons: self.reasons.clone(),
        }
    }

    /// Why the packet was dropped; `None` if it was delivered.
    #[must_use]
    pub fn drop_reason(&self, packet: usize) -> Option<&str> {
        let reason = (self.outcome[packet] as usize).checked_sub(1)?;
        Some(&self.reasons[reason])
    }
}

fn chosen<T: Copy>(column: &[T], indices: &[usize]) -> Vec<T> {
    indices.iter().map(|&index| column[index]).collect()
}

/// A number per mote, counted since the experiment began.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Statistic {
    /// Its name: see [`is_statistic_name`].
    pub name: String,
    /// Unit, for people.
    pub unit: String,
    /// One value per mote.
    pub values: Vec<f64>,
    /// Whose value is known; `None`: everyone's.
    pub known: Option<Bitmap>,
}

impl Statistic {
    /// The value of a mote, if it is known.
    #[must_use]
    pub fn get(&self, mote: usize) -> Option<f64> {
        let is_known = self.known.as_ref().is_none_or(|known| known.get(mote));
        self.values.get(mote).copied().filter(|_| is_known)
    }
}

/// Whether a statistic may be called that: lower-case letters, digits and underscores, a letter first.
#[must_use]
pub fn is_statistic_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.len() <= 64
        && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
}

/// Numbers per mote. Names are unique, and the same in the same order in every step.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MoteStatistics {
    /// The columns.
    pub columns: Vec<Statistic>,
}

impl MoteStatistics {
    /// The column of that name.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<&Statistic> {
        self.columns.iter().find(|column| column.name == name)
    }
}

/// Every cell of every mote's schedule, in the order (mote, slotframe, slot, channel offset). Columns of equal length.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Schedule {
    /// The mote.
    pub mote: Vec<u32>,
    /// Handle of the slotframe.
    pub slotframe: Vec<u32>,
    /// Length of that slotframe (slots).
    pub slotframe_slots: Vec<u32>,
    /// Slot offset, less than the length.
    pub slot: Vec<u32>,
    /// Channel offset.
    pub channel_offset: Vec<u32>,
    /// Link options: 1 transmit, 2 receive, 4 shared, 8 timekeeping, 16 priority (IEEE Std 802.15.4-2015, 8.4.2.2.2).
    pub options: Vec<u32>,
    /// The mote at the other end; `u32::MAX`: any.
    pub neighbour: Vec<u32>,
}

impl Schedule {
    /// Number of cells.
    #[must_use]
    pub fn len(&self) -> usize {
        self.mote.len()
    }

    /// Whether nobody has a cell.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.mote.is_empty()
    }
}

/// Who has heard frames of whom, in the order (receiver, sender). Columns of equal length.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HeardLinks {
    /// The mote that heard.
    pub receiver: Vec<u32>,
    /// The mote that it heard.
    pub sender: Vec<u32>,
    /// Frames received, at least 1.
    pub frames: Vec<u64>,
    /// Their mean strength (dBm). Optional.
    pub rssi_dbm: Vec<f32>,
}

/// Frames that were on the air during a step, in the order (`sent_ns`, `sender`). Columns of equal length.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Frames {
    /// Beginning of the slot in which it was sent (ns).
    pub sent_ns: Vec<u64>,
    /// The mote that sent it.
    pub sender: Vec<u32>,
    /// The mote it was for; [`EVERYONE`](super::EVERYONE): everyone in reach.
    pub destination: Vec<u32>,
    /// IEEE 802.15.4 channel.
    pub channel: Vec<u32>,
    /// Channel offset of the cell; `u32::MAX`: in no cell.
    pub channel_offset: Vec<u32>,
    /// Index into `kinds`.
    pub kind: Vec<u32>,
    /// Length (PSDU, bytes).
    pub length_bytes: Vec<u32>,
    /// Number of the packet that it carries, or a part of; 0: none that is counted.
    pub packet: Vec<u64>,
    /// How often it has been sent, this time included.
    pub attempt: Vec<u32>,
    /// How many motes received it.
    pub n_received: Vec<u32>,
    /// How many listened on its channel in reach and did not receive it.
    pub n_missed: Vec<u32>,
    /// What became of it at its destination.
    pub outcome: Vec<FrameOutcome>,
    /// Kinds of frames, in the same order always; more may follow later.
    pub kinds: Vec<String>,
}

impl Frames {
    /// Number of frames.
    #[must_use]
    pub fn len(&self) -> usize {
        self.sent_ns.len()
    }

    /// Whether nobody sent.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.sent_ns.is_empty()
    }

    /// Adds frames that were sent later.
    pub fn append(&mut self, later: &Self) {
        self.sent_ns.extend(&later.sent_ns);
        self.sender.extend(&later.sender);
        self.destination.extend(&later.destination);
        self.channel.extend(&later.channel);
        self.channel_offset.extend(&later.channel_offset);
        self.kind.extend(&later.kind);
        self.length_bytes.extend(&later.length_bytes);
        self.packet.extend(&later.packet);
        self.attempt.extend(&later.attempt);
        self.n_received.extend(&later.n_received);
        self.n_missed.extend(&later.n_missed);
        self.outcome.extend(&later.outcome);
        self.kinds.clone_from(&later.kinds);
    }
}

/// What became of a frame at the mote it was for, numbered as in the contract.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FrameOutcome {
    /// It was for everyone in reach.
    Broadcast = 0,
    /// It was not received.
    Lost = 1,
    /// It was received, and the acknowledgment was lost.
    NotAcknowledged = 2,
    /// It was received and acknowledged.
    Acknowledged = 3,
}

/// Whether every mote that is to take part in the network does.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Formation {
    /// When all did for the first time (ns); `None`: not yet.
    pub formed_ns: Option<u64>,
    /// Motes that do not, ascending. Empty once all did.
    pub missing: Vec<u32>,
    /// What each of them lacks: index into `reasons`.
    pub reason: Vec<u32>,
    /// Words for it.
    pub reasons: Vec<String>,
}

impl Formation {
    /// Who does not take part, by what is lacking, in the order of `reasons`; reasons that nobody has are left out.
    pub fn by_reason(&self) -> impl Iterator<Item = (&str, Vec<u32>)> {
        (0u32..).zip(&self.reasons).filter_map(|(index, words)| {
            let of_it = |&(_, &reason): &(&u32, &u32)| reason == index;
            let motes: Vec<u32> = self
                .missing
                .iter()
                .zip(&self.reason)
                .filter(of_it)
                .map(|(&mote, _)| mote)
                .collect();
            (!motes.is_empty()).then_some((words.as_str(), motes))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_statistic_that_is_not_known_has_no_value() {
        let mut known = Bitmap::filled(3, true);
        known.set(1, false);
        let values = vec![1.0, 0.0, 3.0];
        let column = Statistic { values, known: Some(known), ..Statistic::default() };
        assert_eq!([0, 1, 2, 3].map(|mote| column.get(mote)), [Some(1.0), None, Some(3.0), None]);
    }

    #[test]
    fn names_of_statistics_can_be_columns_of_a_table() {
        let names = ["charge_uc", "tx2", "", "2tx", "Charge", "a b", "_x"];
        assert_eq!(names.map(is_statistic_name), [true, true, false, false, false, false, false]);
    }

    #[test]
    fn those_who_are_missing_are_told_by_what_they_lack() {
        let formation = Formation {
            formed_ns: None,
            missing: vec![2, 3, 7],
            reason: vec![2, 0, 2],
            reasons: ["deaf", "shy", "late"].map(str::to_owned).to_vec(),
        };
        let told: Vec<_> = formation.by_reason().collect();
        assert_eq!(told, [("deaf", vec![3]), ("late", vec![2, 7])]);
    }
}
