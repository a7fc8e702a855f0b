//! What is on the air, who listens, and what arrives where.

use crate::asn::Asn;
use crate::timing::{Airtime, RX_OFFSET_NS, RX_WAIT_NS, TX_OFFSET_NS};
use proto::ids::MoteId;
use serde::{Deserialize, Serialize};

/// Which slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Slot {
    /// Absolute number of the slot.
    pub asn: Asn,
    /// When it begins (ns).
    pub begins_ns: u64,
}

/// A frame on the air.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct OnAir {
    /// Number of the mote.
    pub sender: MoteId,
    /// IEEE 802.15.4 channel, 11 to 26.
    pub channel: u8,
    /// Deviation (ns) of the sender's clock from the true time: by so much the frame begins later than macTsTxOffset.
    pub starts_ns: i64,
    /// Length (bytes), header and check sequence of the MAC included.
    pub psdu_bytes: u16,
}

impl OnAir {
    /// When its first symbol is on the air (ns after the slot's true begin).
    #[must_use]
    pub fn begins_ns(&self) -> i64 {
        TX_OFFSET_NS + self.starts_ns
    }

    /// When its last symbol has been on the air (ns after the slot's true begin).
    #[must_use]
    pub fn ends_ns(&self, airtime: &Airtime) -> i64 {
        self.begins_ns() + airtime.of(self.psdu_bytes)
    }
}

/// A receiver that is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Listening {
    /// Number of the mote.
    pub receiver: MoteId,
    /// IEEE 802.15.4 channel, 11 to 26.
    pub channel: u8,
    /// From when (ns after the slot's true begin) it hears a frame that begins.
    pub opens_ns: i64,
    /// Until when, inclusively.
    pub closes_ns: i64,
}

impl Listening {
    /// A synchronised mote whose clock deviates by so much (ns): within macTsRxWait about its own macTsTxOffset.
    #[must_use]
    pub fn synchronised(receiver: MoteId, channel: u8, deviation_ns: i64) -> Self {
        let opens_ns = RX_OFFSET_NS + deviation_ns;
        Self { receiver, channel, opens_ns, closes_ns: opens_ns + RX_WAIT_NS }
    }

    /// A mote that scans: it hears whatever begins in the slot.
    #[must_use]
    pub fn scanning(receiver: MoteId, channel: u8) -> Self {
        Self { receiver, channel, opens_ns: i64::MIN, closes_ns: i64::MAX }
    }
}

/// An acknowledgment to be sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Acknowledgment {
    /// Of which frame: its place among the slot's transmissions.
    pub transmission: u32,
    /// Who sends it: who received the frame.
    pub receiver: MoteId,
    /// Length (bytes), header and check sequence of the MAC included.
    pub psdu_bytes: u16,
}

/// What became of a listener.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Reception {
    /// It noticed nothing.
    Idle,
    /// It locked on to a frame and lost it.
    Lost {
        /// Place of the frame among the transmissions.
        transmission: u32,
    },
    /// It received a frame.
    Received {
        /// Place of the frame among the transmissions.
        transmission: u32,
        /// What its register reads (dBm); not a number where nobody asks ([`Paths::is_certain`]).
        rssi_dbm: f64,
    },
}

/// A frame that is sent, as propagation sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sent {
    /// Number of the mote.
    pub sender: MoteId,
    /// IEEE 802.15.4 channel, 11 to 26.
    pub channel: u8,
    /// When it begins (ns).
    pub sent_ns: u64,
    /// When it ends (ns).
    pub end_ns: u64,
}

/// What of a frame arrives at a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// Power (dBm).
    pub rssi_dbm: f64,
    /// What the receiver's register reads (dBm).
    pub register_rssi_dbm: f64,
    /// By how much (dB) it would have to be stronger to be received as well as without the effects that demand this.
    pub shift_db: f64,
    /// Probability that it is received if nobody interferes: by the reception curve, or as a connectivity model states it.
    pub reception_probability: f64,
}

impl Arrival {
    /// Nothing: beyond the horizon.
    pub const NOTHING: Self = Self {
        rssi_dbm: f64::NEG_INFINITY,
        register_rssi_dbm: f64::NEG_INFINITY,
        shift_db: 0.0,
        reception_probability: 0.0,
    };

    /// Whether nothing arrives, and so nobody is disturbed either.
    #[inline]
    #[must_use]
    pub fn is_nothing(&self) -> bool {
        self.rssi_dbm == f64::NEG_INFINITY
    }
}

/// Which motes each sender's frames can reach, and at which power.
pub trait Paths {
    /// All motes, ascending, at which the sender's frames can arrive; `None`: they can arrive at any mote.
    fn neighbours(&mut self, sender: MoteId) -> Option<&[MoteId]>;

    /// Whether a frame that has the slot to itself is received by every radio that is on and listens, and nobody asks how
    /// strong it was: then levels need not be computed.
    fn is_certain(&self) -> bool {
        false
    }

    /// Whether a mote's radio is on. Asked where [`Paths::is_certain`].
    fn is_on(&self, _mote: MoteId) -> bool {
        true
    }

    /// Adds to `arrivals`, for each of `receivers`, what of a frame arrives there.
    fn arrivals(&mut self, sent: Sent, receivers: &[MoteId], arrivals: &mut Vec<Arrival>);
}
