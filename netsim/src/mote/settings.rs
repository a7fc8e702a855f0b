//! Settings of the network, the same for all motes.

use crate::app;
use crate::energy;
use crate::join;
use crate::lowpan;
use crate::mac::effect::{Burden, NO_BURDEN};
use crate::mac::tsch;
use crate::mote::compat::Compat;
use crate::rpl;
use crate::sf;
use crate::sixtop;
use crate::wire::Eui64;
use crate::wire::datagram::{Datagram, Upper};
use crate::wire::fragment::LowpanRepr;
use crate::wire::frame::{Content, FrameRepr, MAX_PSDU, payload_room};
use crate::wire::security::FrameSecurity;
use proto::ids::MoteId;

/// What motes that move do beyond the standards.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mobility {
    /// Motes through which nobody routes or joins, ascending.
    pub leaves: Vec<MoteId>,
    /// Time is taken from beacons of all neighbours that are nearer to the root.
    pub time_from_beacons: bool,
    /// Datagrams go another way where one fails.
    pub reroute: bool,
    /// Frames for one neighbour follow each other where everyone only listens.
    pub bursts: bool,
    /// Who has lost synchronisation scans where beacons are expected.
    pub scan_hopping: bool,
    /// Admission outlives synchronisation.
    pub keep_admission: bool,
}

/// Settings of the network, the same for all motes, as checked from the configuration.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Motes that are roots, ascending.
    pub roots: Vec<MoteId>,
    /// Settings of the MAC layer (TSCH).
    pub mac: tsch::Config,
    /// What effects lay on each mote; empty without effects.
    pub burdens: Vec<Burden>,
    /// The scheduling function and its settings.
    pub sf: sf::Config,
    /// Settings of 6P (RFC 8480): timeouts and retries.
    pub sixtop: sixtop::Config,
    /// Settings of routing (RPL).
    pub rpl: rpl::Config,
    /// Settings of 6LoWPAN fragmentation.
    pub lowpan: lowpan::Config,
    /// Settings of the join protocol, by which motes are admitted.
    pub join: join::Config,
    /// Applications, each with the motes that run it.
    pub apps: Vec<app::Spec>,
    /// How the swarm's payloads travel.
    pub transport: Transport,
    /// What motes that move do beyond the standards.
    pub mobility: Mobility,
    /// How charge is computed from uses of the radio.
    pub energy: energy::Model,
    /// Charge of a new battery (mAh).
    pub battery_mah: f64,
    /// Whether a mote other than a root fails once its battery is empty.
    pub battery_deaths: bool,
    /// What is done as the peers do it.
    pub compat: Compat,
}

/// How the swarm's payloads travel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// They do not.
    None,
    /// Broadcast in the cell that the scheduling function gives each mote for itself.
    OwnCell,
    /// Broadcast in the cells that all share.
    SharedCell,
    /// To each neighbour by itself, acknowledged.
    UnicastNeighbours,
    /// Broadcast in a slotframe of its own, in which each mote has a slot and listens in all others.
    BroadcastSlotframe {
        /// Length of the slotframe.
        slots: u16,
        /// Channel offset of its cells.
        channel: u16,
    },
}

/// Bytes that a frame of the 6TiSCH simulator holds, which has no headers.
pub(super) const PEER_FRAME_BYTES: usize = 90;
/// Least length of a frame (bytes): that of an empty one.
const LEAST_PSDU: usize = 23;

impl Settings {
    /// Whether applications exchange CoAP messages.
    #[must_use]
    pub(crate) fn uses_coap(&self) -> bool {
        self.apps.iter().any(app::Spec::is_coap)
    }

    /// What effects lay on a mote.
    #[inline]
    #[must_use]
    pub fn burden(&self, mote: MoteId) -> &Burden {
        self.burdens.get(mote.index()).unwrap_or(&NO_BURDEN)
    }

    /// Settings of routing of a mote.
    #[must_use]
    pub(crate) fn rpl_of(&self, mote: MoteId) -> rpl::Config {
        let is_leaf = self.mobility.leaves.binary_search(&mote).is_ok();
        rpl::Config { is_leaf, ..self.rpl.clone() }
    }

    /// Length (bytes) of a frame on the air.
    #[must_use]
    pub fn psdu_bytes(&self, frame: &FrameRepr) -> u16 {
        if !self.compat.no_frame_overhead {
            return frame.buffer_len() as u16;
        }
        let bytes = match &frame.content {
            Content::Lowpan(LowpanRepr::Whole(datagram)) => match &datagram.upper {
                Upper::Udp(udp) => udp.payload.len(),
                Upper::Rpl(message) => message.buffer_len(),
            },
            Content::Lowpan(LowpanRepr::First(part) | LowpanRepr::Next(part)) => {
                usize::from(part.covers)
            }
            Content::Beacon(_) | Content::KeepAlive | Content::Sixp(_) => 0,
        };
        bytes.clamp(LEAST_PSDU, MAX_PSDU) as u16
    }

    /// Whether frames are secured.
    #[inline]
    #[must_use]
    pub(crate) fn is_secured(&self) -> bool {
        self.join.security.is_some()
    }

    /// Room (bytes) for a datagram, or a part of it, in a frame.
    #[must_use]
    pub fn room(
        &self,
        datagram: &Datagram,
        next_hop: Option<Eui64>,
        security: FrameSecurity,
    ) -> usize {
        let is_short = match &datagram.upper {
            Upper::Udp(udp) => udp.payload.len() <= PEER_FRAME_BYTES,
            Upper::Rpl(_) => true,
        };
        if self.compat.no_frame_overhead && is_short {
            usize::MAX
        } else {
            payload_room(next_hop, security)
        }
    }

    /// Whether the network carries no payloads of the swarm.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        matches!(self.transport, Transport::None)
    }

    /// Slots of a control period that is one slotframe.
    #[must_use]
    pub fn slotframe_slots(&self) -> u16 {
        match self.transport {
            Transport::BroadcastSlotframe { slots, .. } => slots,
            Transport::None
            | Transport::OwnCell
            | Transport::SharedCell
            | Transport::UnicastNeighbours => self.sf.slotframe_slots(),
        }
    }
}
