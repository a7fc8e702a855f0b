//! When things happen within a slot: the default timeslot template of IEEE Std 802.15.4-2015, 8.4.3.3.3, for 2.4 GHz, and how long
//! frames of other physical layers last.

use serde::{Deserialize, Serialize};

/// From the begin of the slot to the begin of a frame (ns): macTsTxOffset.
pub const TX_OFFSET_NS: i64 = 2_120_000;
/// From the begin of the slot until the receiver listens (ns): macTsRxOffset.
pub const RX_OFFSET_NS: i64 = 1_020_000;
/// How long it waits for the begin of a frame (ns): macTsRxWait. Half of it is the guard time.
pub const RX_WAIT_NS: i64 = 2_200_000;
/// From the end of a frame until its sender listens for the acknowledgment (ns): macTsRxAckDelay.
pub const RX_ACK_DELAY_NS: i64 = 800_000;
/// From the end of a frame to the begin of its acknowledgment (ns): macTsTxAckDelay.
pub const TX_ACK_DELAY_NS: i64 = 1_000_000;
/// How long the sender waits for the begin of the acknowledgment (ns): macTsAckWait.
pub const ACK_WAIT_NS: i64 = 400_000;
/// Longest frame (ns): macTsMaxTx, 127 bytes and 6 of the physical layer.
pub const MAX_TX_NS: i64 = 4_256_000;
/// Longest acknowledgment (ns): macTsMaxAck.
pub const MAX_ACK_NS: i64 = 2_400_000;

/// Bytes of the longest frame, header and check sequence of the MAC included (11.3: aMaxPhyPacketSize).
pub const MAX_PSDU_BYTES: usize = 127;

/// A byte lasts so long (ns): 250 kb/s.
pub const BYTE_NS: i64 = 32_000;
/// Bytes of the physical layer before a frame: preamble (4), start of frame (1), length (1).
pub const PHY_HEADER_BYTES: i64 = 6;
/// The synchronisation header (ns): preamble and start of frame.
pub const SYNCHRONISATION_NS: i64 = 5 * BYTE_NS;

/// How long a frame of 2.4 GHz of so many bytes, header and check sequence of the MAC included, is on the air (ns).
#[inline]
#[must_use]
pub fn airtime_ns(psdu_bytes: u16) -> i64 {
    Airtime::O_QPSK_2450.of(psdu_bytes)
}

/// How long frames of a physical layer are on the air.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Airtime {
    /// A byte lasts so long (ns).
    pub byte_ns: i64,
    /// The physical layer before a frame (ns): preamble, start of frame, header.
    pub header_ns: i64,
    /// The part of it by which a receiver notices the frame (ns): preamble and start of frame.
    pub synchronisation_ns: i64,
}

/// Bytes of the longest acknowledgment (PSDU): macTsMaxAck at 2.4 GHz.
const MAX_ACK_BYTES: u16 = 69;

impl Airtime {
    /// 2.4 GHz O-QPSK.
    pub const O_QPSK_2450: Self = Self {
        byte_ns: BYTE_NS,
        header_ns: PHY_HEADER_BYTES * BYTE_NS,
        synchronisation_ns: SYNCHRONISATION_NS,
    };

    /// A physical layer with so many bytes before each frame, the first of them for synchronisation.
    #[must_use]
    pub const fn of_bytes(byte_ns: i64, synchronisation_bytes: i64, header_bytes: i64) -> Self {
        Self {
            byte_ns,
            header_ns: header_bytes * byte_ns,
            synchronisation_ns: synchronisation_bytes * byte_ns,
        }
    }

    /// How long a frame of so many bytes, header and check sequence of the MAC included, is on the air (ns).
    #[inline]
    #[must_use]
    pub const fn of(&self, psdu_bytes: u16) -> i64 {
        self.header_ns + psdu_bytes as i64 * self.byte_ns
    }

    /// From the begin of a slot to the end of the longest acknowledgment of the longest frame (ns).
    #[must_use]
    pub const fn least_slot_ns(&self) -> u64 {
        let longest_ns = self.of(MAX_PSDU_BYTES as u16);
        (TX_OFFSET_NS + longest_ns + TX_ACK_DELAY_NS + self.of(MAX_ACK_BYTES)) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_frame_takes_the_longest_time_for_a_transmission() {
        assert_eq!(airtime_ns(127), MAX_TX_NS);
    }

    #[test]
    fn frames_begin_in_the_middle_of_the_wait_and_acknowledgments_too() {
        assert_eq!(RX_OFFSET_NS + RX_WAIT_NS / 2, TX_OFFSET_NS);
        assert_eq!(RX_ACK_DELAY_NS + ACK_WAIT_NS / 2, TX_ACK_DELAY_NS);
    }

    #[test]
    fn the_longest_frame_and_its_acknowledgment_take_9_776_ms_of_10() {
        let last_ns = TX_OFFSET_NS + MAX_TX_NS + TX_ACK_DELAY_NS + MAX_ACK_NS;
        assert_eq!(last_ns, 9_776_000);
        assert_eq!(Airtime::O_QPSK_2450.least_slot_ns(), 9_776_000);
    }
}
