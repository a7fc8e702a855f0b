//! The radio's traffic as records of a capture file.

use crate::wire::frame::{AckRepr, FrameRepr};
use crate::wire::tap;
use bytes::Bytes;

/// From the beginning of a slot until a frame begins (ns): macTsTxOffset, IEEE Std 802.15.4-2015, 8.4.3.3.1.
const TX_OFFSET_NS: u64 = 2_120_000;
/// From the end of a frame until its acknowledgment begins (ns): macTsTxAckDelay.
const TX_ACK_DELAY_NS: u64 = 1_000_000;
/// A byte on the air (ns), and bytes before the PSDU.
const BYTE_NS: u64 = 32_000;
const PHY_HEADER_BYTES: u64 = 6;

/// Frames since they were last taken, if they are wanted.
#[derive(Clone, Debug, Default)]
pub struct Capture {
    wanted: bool,
    records: Vec<u8>,
    /// Acknowledgments of this slot, each with its time (ns).
    acks: Vec<(u64, Vec<u8>)>,
}

impl Capture {
    /// Captures, or not.
    #[must_use]
    pub fn new(wanted: bool) -> Self {
        Self { wanted, ..Self::default() }
    }

    /// A frame was sent.
    pub fn frame(&mut self, asn: u64, slot_ns: u64, channel: u8, frame: &FrameRepr) {
        if self.wanted {
            let at_ns = asn * slot_ns + TX_OFFSET_NS;
            let bytes = frame.to_vec();
            self.records.extend(tap::record(at_ns, channel.into(), None, asn, &bytes));
        }
    }

    /// The acknowledgment of a frame of `frame_bytes` was sent.
    pub fn ack(&mut self, asn: u64, slot_ns: u64, channel: u8, frame_bytes: u16, ack: &AckRepr) {
        if self.wanted {
            let air_ns = (PHY_HEADER_BYTES + u64::from(frame_bytes)) * BYTE_NS;
            let at_ns = asn * slot_ns + TX_OFFSET_NS + air_ns + TX_ACK_DELAY_NS;
            let record = tap::record(at_ns, channel.into(), None, asn, &ack.to_vec());
            self.acks.push((at_ns, record));
        }
    }

    /// Nothing more is sent in the slot: acknowledgments, which begin when the frames before them end, are put in order.
    pub fn end_slot(&mut self) {
        self.acks.sort_by_key(|&(at_ns, _)| at_ns);
        self.records.extend(self.acks.drain(..).flat_map(|(_, record)| record));
    }

    /// All records since this was last asked.
    pub fn take(&mut self) -> Bytes {
        std::mem::take(&mut self.records).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::Eui64;

    #[test]
    fn acknowledgments_of_a_slot_are_in_the_order_in_which_their_frames_ended() {
        let mut capture = Capture::new(true);
        for (destination, frame_bytes) in [(1, 127), (2, 30), (3, 60)] {
            let ack =
                AckRepr { destination: Eui64(destination), sequence: 0, time_correction_us: 0 };
            capture.ack(7, 10_000_000, 15, frame_bytes, &ack);
        }
        assert_eq!(capture.take().len(), 0);
        capture.end_slot();
        let records = capture.take();
        let length = records.len() / 3;
        let times_ns: Vec<u32> = records
            .chunks(length)
            .map(|record| u32::from_le_bytes([record[4], record[5], record[6], record[7]]))
            .collect();
        // 70 ms, 2.12 ms, 6 bytes and the frame at 32 µs a byte, 1 ms.
        assert_eq!(times_ns, [74_272_000, 75_232_000, 77_376_000]);
    }
}
