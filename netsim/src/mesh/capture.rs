//! The radio's traffic as records of a capture file.

use crate::wire::Eui64;
use crate::wire::frame::{AckRepr, FrameRepr};
use crate::wire::security::Keys;
use crate::wire::tap;
use bytes::Bytes;
use physics::asn::Asn;
use proto::time::SimTime;

/// Frames since they were last taken, if they are wanted.
#[derive(Clone, Debug, Default)]
pub struct Capture {
    wanted: bool,
    /// What frames are secured with, in a secured network: captures have the octets that are on the air.
    keys: Option<Keys>,
    /// Channel page of the physical layer.
    page: u8,
    records: Vec<u8>,
    /// What was sent in this slot, each record with its time.
    slot: Vec<(SimTime, Vec<u8>)>,
}

impl Capture {
    /// Captures, or not.
    #[must_use]
    pub fn new(wanted: bool, keys: Option<Keys>) -> Self {
        Self { wanted, keys, ..Self::default() }
    }

    /// The same for a physical layer of another channel page than 0.
    #[must_use]
    pub(crate) fn on_page(self, page: u8) -> Self {
        Self { page, ..self }
    }

    /// A frame was sent, whose first symbol was on the air at `begins` (true time).
    pub fn frame(&mut self, asn: Asn, begins: SimTime, channel: u8, frame: &FrameRepr) {
        if self.wanted {
            let psdu = match &self.keys {
                Some(keys) => frame.to_secured_vec(keys, asn),
                None => frame.to_vec(),
            };
            self.record(asn, begins, channel, &psdu);
        }
    }

    /// An acknowledgment was sent by `source`.
    pub fn ack(&mut self, asn: Asn, begins: SimTime, channel: u8, source: Eui64, ack: &AckRepr) {
        if self.wanted {
            let psdu = match &self.keys {
                Some(keys) => ack.to_secured_vec(keys, source, asn),
                None => ack.to_vec(),
            };
            self.record(asn, begins, channel, &psdu);
        }
    }

    fn record(&mut self, asn: Asn, begins: SimTime, channel: u8, psdu: &[u8]) {
        let channel = (channel.into(), self.page);
        self.slot.push((begins, tap::record(begins, channel, None, asn, psdu)));
    }

    /// Nothing more is sent in the slot: what was is put in the order in which it began.
    pub(crate) fn end_slot(&mut self) {
        self.slot.sort_by_key(|&(begins, _)| begins);
        self.records.extend(self.slot.drain(..).flat_map(|(_, record)| record));
    }

    /// All records since this was last asked.
    pub fn take(&mut self) -> Bytes {
        std::mem::take(&mut self.records).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::security::FrameSecurity;
    use proto::ids::MoteId;

    #[test]
    fn what_is_sent_in_a_slot_is_in_the_order_in_which_it_began() {
        let mut capture = Capture::new(true, None);
        for (destination, begins) in [(1, 77_376_000), (2, 74_272_000), (3, 75_232_000)] {
            let destination = Eui64(destination);
            let security = FrameSecurity::Unsecured;
            let ack = AckRepr { destination, sequence: 0, time_correction_us: 0, security };
            capture.ack(Asn(7), SimTime::from_ns(begins), 15, Eui64::of_mote(MoteId(0)), &ack);
        }
        assert_eq!(capture.take().len(), 0);
        capture.end_slot();
        let records = capture.take();
        let length = records.len() / 3;
        let times_ns: Vec<u32> = records
            .chunks(length)
            .map(|record| u32::from_le_bytes([record[4], record[5], record[6], record[7]]))
            .collect();
        assert_eq!(times_ns, [74_272_000, 75_232_000, 77_376_000]);
    }
}
