//! Charge: what the radio takes in every slot.
//!
//! A mote only counts: so many slots of each kind, so many bytes. Charge, radio-on time and lifetime follow from the totals,
//! once, so that they are exact and cost nothing while slots run.
//!
//! Three models. [`Model::PerSlot`] is the 6TiSCH simulator's table, one charge per kind of slot whatever the frame's length.
//! [`Model::ByLength`] is a regression on the CC2650 (TSCH-Sim), where longer frames cost more. [`Model::ByTime`] is the
//! only one for other physical layers than 2.4 GHz. None knows what the processor and sensors take, nor what a sleeping mote leaks.

use crate::wire::security::OVERHEAD;
use physics::timing::Airtime;
use proto::time::SimDuration;
use proto::types::NS_PER_S;
use serde::{Deserialize, Serialize};

/// What a radio does in one slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SlotUse {
    /// Nothing: it is off.
    Sleep,
    /// It listens as long as a frame may begin, and none does.
    IdleListen,
    /// It listens for the whole slot: a mote that is not synchronised.
    Scan,
    /// It sends a frame to a neighbour and listens for the acknowledgment.
    TxUnicast {
        /// Length of the frame (PSDU, bytes).
        bytes: u16,
        /// Whether the acknowledgment came.
        acked: bool,
    },
    /// It sends a frame to everyone.
    TxBroadcast {
        /// Length of the frame (PSDU, bytes).
        bytes: u16,
    },
    /// It receives a frame and acknowledges it.
    RxUnicast {
        /// Length of the frame (PSDU, bytes).
        bytes: u16,
    },
    /// It receives a frame for everyone.
    RxBroadcast {
        /// Length of the frame (PSDU, bytes).
        bytes: u16,
    },
    /// It receives a frame for somebody else, or one that is destroyed: no acknowledgment is sent.
    Overhear {
        /// Length of the frame (PSDU, bytes).
        bytes: u16,
    },
}

/// How charge is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Model {
    /// One charge per kind of slot: the 6TiSCH simulator's table.
    #[default]
    PerSlot,
    /// By the length of frames: TSCH-Sim's regression on the CC2650.
    ByLength,
    /// By the time in which the radio sends and in which it listens, whatever the physical layer.
    ByTime {
        /// Current while it sends (mA).
        tx_ma: f64,
        /// Current while it listens (mA).
        rx_ma: f64,
        /// How long frames are on the air.
        airtime: Airtime,
    },
}

/// Charge of a slot with a frame: `per_byte_uc` · bytes + `base_uc`.
#[derive(Clone, Copy, Debug)]
struct Line {
    per_byte_uc: f64,
    base_uc: f64,
}

impl Line {
    const fn new(per_byte_uc: f64, base_uc: f64) -> Self {
        Self { per_byte_uc, base_uc }
    }

    const fn flat(base_uc: f64) -> Self {
        Self::new(0.0, base_uc)
    }

    fn charge_uc(self, frames: Frames) -> f64 {
        self.per_byte_uc * frames.bytes as f64 + self.base_uc * frames.n as f64
    }
}

/// What slots take (µC).
#[derive(Clone, Copy, Debug)]
struct Table {
    idle_listen_uc: f64,
    /// Per 10 ms.
    scan_uc: f64,
    tx_unicast: Line,
    tx_broadcast: Line,
    rx_unicast: Line,
    rx_broadcast: Line,
}

/// The slot for which scanning is stated.
const STATED_SLOT_NS: u64 = 10_000_000;

/// The 6TiSCH simulator's table. It charges a scanning slot as idle listening, though the radio is on throughout; here
/// scanning takes the current that idle listening takes, 6.4 µC in a guard time of 2.2 ms, for the whole slot.
const PER_SLOT: Table = Table {
    idle_listen_uc: 6.4,
    scan_uc: 6.4 * 10.0 / 2.2,
    tx_unicast: Line::flat(54.5),
    tx_broadcast: Line::flat(49.5),
    rx_unicast: Line::flat(32.6),
    rx_broadcast: Line::flat(22.6),
};

/// TSCH-Sim's regression on the CC2650.
const BY_LENGTH: Table = Table {
    idle_listen_uc: 21.816775,
    scan_uc: 70.0,
    tx_unicast: Line::new(0.345406, 36.546091),
    tx_broadcast: Line::new(0.399234, 13.671529),
    rx_unicast: Line::new(0.244439, 38.344072),
    rx_broadcast: Line::new(0.258910, 21.816775),
};

impl Model {
    /// Charge (µC) of one slot of `slot`. A frame that is not acknowledged costs what an acknowledged one does.
    #[must_use]
    pub fn charge_uc(self, slot: SlotUse, slot_length: SimDuration) -> f64 {
        let mut usage = Usage::default();
        usage.count(slot);
        usage.charge_uc(self, slot_length)
    }
}

/// Frames of one kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Frames {
    /// Number of frames.
    pub n: u64,
    /// Their lengths together (PSDU, bytes).
    pub bytes: u64,
}

impl Frames {
    fn count(&mut self, bytes: u16) {
        self.n += 1;
        self.bytes += u64::from(bytes);
    }

    fn since(self, earlier: Self) -> Self {
        Self { n: self.n - earlier.n, bytes: self.bytes - earlier.bytes }
    }

    fn and(self, other: Self) -> Self {
        Self { n: self.n + other.n, bytes: self.bytes + other.bytes }
    }
}

/// What the radio of a mote has done, in slots. Kinds whose slots nobody walks through (idle listening, sleep) may be set
/// from the schedule instead of counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Usage {
    /// Slots in which the radio was off.
    pub sleep: u64,
    /// Slots in which nothing came.
    pub idle_listen: u64,
    /// Slots in which the radio was on throughout, to find a network.
    pub scan: u64,
    /// Frames sent to a neighbour and acknowledged.
    pub tx_acked: Frames,
    /// Frames sent to a neighbour and not acknowledged.
    pub tx_not_acked: Frames,
    /// Frames sent to everyone.
    pub tx_broadcast: Frames,
    /// Frames received and acknowledged.
    pub rx_unicast: Frames,
    /// Frames for everyone received.
    pub rx_broadcast: Frames,
    /// Frames received that were for somebody else, or destroyed.
    pub overheard: Frames,
    /// Secured acknowledgments sent.
    pub secured_acks_sent: u64,
    /// Secured acknowledgments received.
    pub secured_acks_received: u64,
}

/// Times of the default timeslot that decide how long a radio is on: IEEE Std 802.15.4-2015, 8.4.3.3 (macTsRxWait,
/// macTsRxAckDelay, macTsTxAckDelay, macTsAckWait).
pub mod on_time {
    /// A listener waits so long for a frame to begin (ns).
    pub const RX_WAIT_NS: u64 = 2_200_000;
    /// From the end of a frame until its sender listens for the acknowledgment (ns).
    pub const RX_ACK_DELAY_NS: u64 = 800_000;
    /// From the end of a frame until its receiver sends the acknowledgment (ns).
    pub const TX_ACK_DELAY_NS: u64 = 1_000_000;
    /// A sender waits so long for an acknowledgment to begin (ns).
    pub const ACK_WAIT_NS: u64 = 400_000;
}

impl Usage {
    /// Counts one slot by how the radio was used in it.
    pub fn count(&mut self, slot: SlotUse) {
        match slot {
            SlotUse::Sleep => self.sleep += 1,
            SlotUse::IdleListen => self.idle_listen += 1,
            SlotUse::Scan => self.scan += 1,
            SlotUse::TxUnicast { bytes, acked: true } => self.tx_acked.count(bytes),
            SlotUse::TxUnicast { bytes, acked: false } => self.tx_not_acked.count(bytes),
            SlotUse::TxBroadcast { bytes } => self.tx_broadcast.count(bytes),
            SlotUse::RxUnicast { bytes } => self.rx_unicast.count(bytes),
            SlotUse::RxBroadcast { bytes } => self.rx_broadcast.count(bytes),
            SlotUse::Overhear { bytes } => self.overheard.count(bytes),
        }
    }

    /// What was done after `earlier` was read off the same counters.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            sleep: self.sleep - earlier.sleep,
            idle_listen: self.idle_listen - earlier.idle_listen,
            scan: self.scan - earlier.scan,
            tx_acked: self.tx_acked.since(earlier.tx_acked),
            tx_not_acked: self.tx_not_acked.since(earlier.tx_not_acked),
            tx_broadcast: self.tx_broadcast.since(earlier.tx_broadcast),
            rx_unicast: self.rx_unicast.since(earlier.rx_unicast),
            rx_broadcast: self.rx_broadcast.since(earlier.rx_broadcast),
            overheard: self.overheard.since(earlier.overheard),
            secured_acks_sent: self.secured_acks_sent - earlier.secured_acks_sent,
            secured_acks_received: self.secured_acks_received - earlier.secured_acks_received,
        }
    }

    /// Slots of all kinds together.
    #[must_use]
    pub fn slots(&self) -> u64 {
        self.sleep + self.idle_listen + self.scan + self.sent().n + self.received().n
    }

    /// Slots in which the radio was on, in part or throughout.
    #[must_use]
    pub(crate) fn active_slots(&self) -> u64 {
        self.slots() - self.sleep
    }

    /// Frames sent, of all kinds together.
    #[must_use]
    pub fn sent(&self) -> Frames {
        self.tx_acked.and(self.tx_not_acked).and(self.tx_broadcast)
    }

    /// All frames received, whosever they were.
    #[must_use]
    pub fn received(&self) -> Frames {
        self.rx_unicast.and(self.rx_broadcast).and(self.overheard)
    }

    /// Bytes by which secured acknowledgments were longer than others: sent, and received.
    fn ack_security_bytes(&self) -> [u64; 2] {
        [self.secured_acks_sent, self.secured_acks_received].map(|acks| acks * OVERHEAD as u64)
    }

    /// Charge (µC) in slots of `slot`, which matters to scanning only. Sleep takes none. A slot with a frame includes its
    /// acknowledgment; by length, the bytes by which a secured one is longer are charged as those of frames.
    #[must_use]
    pub fn charge_uc(&self, model: Model, slot: SimDuration) -> f64 {
        let table = match model {
            Model::PerSlot => &PER_SLOT,
            Model::ByLength => &BY_LENGTH,
            Model::ByTime { tx_ma, rx_ma, airtime } => {
                let sending = self.sending(ACK_BYTES, &airtime);
                let listening = self.radio_on(slot, ACK_BYTES, &airtime) - sending;
                return 1e-6 * (tx_ma * sending.ns() as f64 + rx_ma * listening.ns() as f64);
            }
        };
        let [acks_sent, acks_received] = self.ack_security_bytes();
        let scan_uc = table.scan_uc * (slot.ns() as f64 / STATED_SLOT_NS as f64);
        table.idle_listen_uc * self.idle_listen as f64
            + scan_uc * self.scan as f64
            + table.tx_unicast.charge_uc(self.tx_acked.and(self.tx_not_acked))
            + table.tx_broadcast.charge_uc(self.tx_broadcast)
            + table.rx_unicast.charge_uc(self.rx_unicast)
            + table.rx_broadcast.charge_uc(self.rx_broadcast.and(self.overheard))
            + table.tx_unicast.per_byte_uc * acks_sent as f64
            + table.rx_unicast.per_byte_uc * acks_received as f64
    }

    /// How long the radio sent: frames, and acknowledgments of `ack_bytes` (PSDU, security apart).
    #[must_use]
    pub fn sending(&self, ack_bytes: u16, airtime: &Airtime) -> SimDuration {
        let [ack_security_bytes, _] = self.ack_security_bytes();
        let acks_ns = self.rx_unicast.n * airtime.of(ack_bytes).unsigned_abs()
            + ack_security_bytes * airtime.byte_ns.unsigned_abs();
        on_air(self.sent(), airtime) + SimDuration::from_ns(acks_ns)
    }

    /// How long the radio was on, in slots of `slot` with acknowledgments of `ack_bytes` (PSDU, security apart) and
    /// frames of a physical layer; see [`on_time`]. A frame begins in the middle of the guard time: clocks deviate to either side.
    #[must_use]
    pub fn radio_on(&self, slot: SimDuration, ack_bytes: u16, airtime: &Airtime) -> SimDuration {
        use on_time::*;
        let ack_ns = airtime.of(ack_bytes).unsigned_abs();
        let received = self.received();
        let beside_ns = self.idle_listen * RX_WAIT_NS
            + self.tx_acked.n * (TX_ACK_DELAY_NS - RX_ACK_DELAY_NS + ack_ns)
            + self.tx_not_acked.n * ACK_WAIT_NS
            + received.n * (RX_WAIT_NS / 2)
            + self.rx_unicast.n * ack_ns
            + self.ack_security_bytes().iter().sum::<u64>() * airtime.byte_ns.unsigned_abs();
        slot * self.scan
            + on_air(self.sent(), airtime)
            + on_air(received, airtime)
            + SimDuration::from_ns(beside_ns)
    }
}

/// How long frames of a physical layer are on the air.
fn on_air(frames: Frames, airtime: &Airtime) -> SimDuration {
    SimDuration::from_ns(
        airtime.header_ns.unsigned_abs() * frames.n + airtime.byte_ns.unsigned_abs() * frames.bytes,
    )
}

/// Length of an enhanced acknowledgment that is not secured (PSDU, bytes): 64-bit destination and a time correction.
pub const ACK_BYTES: u16 = 19;

/// Share of `elapsed` in which the radio was on, 0 to 1. `None` if no time has passed.
#[must_use]
pub fn duty_cycle(radio_on: SimDuration, elapsed: SimDuration) -> Option<f64> {
    (!elapsed.is_zero()).then(|| radio_on.ns() as f64 / elapsed.ns() as f64)
}

/// Mean current (µA): charge (µC) by the time in which it was taken. Both must cover the same span: use
/// [`Usage::since`] for one that does not begin with the run. `None` if no time has passed.
#[must_use]
pub fn mean_current_ua(charge_uc: f64, elapsed: SimDuration) -> Option<f64> {
    (!elapsed.is_zero()).then(|| charge_uc / (elapsed.ns() as f64 / NS_PER_S as f64))
}

/// A pair of AA cells (mAh), as the 6TiSCH simulator has it.
pub(crate) const BATTERY_AA_MAH: f64 = 2821.5;

/// A milliampere-hour (µC).
pub const UC_PER_MAH: f64 = 3.6e6;

/// How long a battery of `battery_mah` lasts (years of 365 days) at the mean current of a span. `None` if no charge was
/// taken or no time has passed.
#[must_use]
pub fn lifetime_years(battery_mah: f64, charge_uc: f64, elapsed: SimDuration) -> Option<f64> {
    let current_ua = mean_current_ua(charge_uc, elapsed)?;
    (0.0 < current_ua).then(|| battery_mah * 1000.0 / current_ua / (24.0 * 365.0))
}

#[cfg(test)]
mod tests;
