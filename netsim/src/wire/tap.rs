//! Captures that Wireshark opens: classic pcap with link type 283, IEEE 802.15.4 TAP
//! (<https://github.com/jkcko/ieee802.15.4-tap>). All fields least significant byte first.

use physics::asn::Asn;
use proto::time::{SimDuration, SimTime};

/// LINKTYPE_IEEE802_15_4_TAP.
const LINK_TYPE: u32 = 283;
/// Says that timestamps are seconds and nanoseconds.
const NANOSECOND_MAGIC: u32 = 0xa1b2_3c4d;
/// No packet is longer: 127 bytes of PSDU and the fields before it.
const SNAPSHOT_LEN: u32 = 256;

/// Types of fields.
const FCS_TYPE: u16 = 0;
const RSS: u16 = 1;
const CHANNEL: u16 = 3;
const START_OF_FRAME: u16 = 5;
const ASN: u16 = 7;
/// FCS of 16 bits.
const FCS_16: u8 = 1;

/// What a capture begins with.
#[must_use]
pub fn file_header() -> [u8; 24] {
    let mut header = [0; 24];
    header[..4].copy_from_slice(&NANOSECOND_MAGIC.to_le_bytes());
    header[4..6].copy_from_slice(&2_u16.to_le_bytes());
    header[6..8].copy_from_slice(&4_u16.to_le_bytes());
    header[16..20].copy_from_slice(&SNAPSHOT_LEN.to_le_bytes());
    header[20..].copy_from_slice(&LINK_TYPE.to_le_bytes());
    header
}

/// One frame of a capture: the PSDU with its FCS, when its first symbol was on the air (ns of simulated time), on which
/// channel of which channel page (IEEE Std 802.15.4-2015, 10.1.2) and in which slot; and how strongly it was received, if it was a receiver that captured it.
#[must_use]
pub fn record(
    time: SimTime,
    (channel, page): (u16, u8),
    rssi_dbm: Option<f32>,
    asn: Asn,
    psdu: &[u8],
) -> Vec<u8> {
    let mut fields = Vec::with_capacity(64);
    put_field(&mut fields, FCS_TYPE, &[FCS_16]);
    if let Some(rssi_dbm) = rssi_dbm {
        put_field(&mut fields, RSS, &rssi_dbm.to_le_bytes());
    }
    let [low, high] = channel.to_le_bytes();
    put_field(&mut fields, CHANNEL, &[low, high, page]);
    put_field(&mut fields, START_OF_FRAME, &time.ns().to_le_bytes());
    put_field(&mut fields, ASN, &asn.0.to_le_bytes());

    let fields_len = 4 + fields.len();
    let length = (fields_len + psdu.len()) as u32;
    let mut record = Vec::with_capacity(16 + length as usize);
    record.extend_from_slice(&((time / SimDuration::SECOND) as u32).to_le_bytes());
    record.extend_from_slice(&((time % SimDuration::SECOND).ns() as u32).to_le_bytes());
    record.extend_from_slice(&length.to_le_bytes());
    record.extend_from_slice(&length.to_le_bytes());
    record.extend_from_slice(&[0, 0]);
    record.extend_from_slice(&(fields_len as u16).to_le_bytes());
    record.extend_from_slice(&fields);
    record.extend_from_slice(psdu);
    record
}

/// Type, length, value, zeros up to a multiple of four bytes.
fn put_field(fields: &mut Vec<u8>, kind: u16, value: &[u8]) {
    fields.extend_from_slice(&kind.to_le_bytes());
    fields.extend_from_slice(&(value.len() as u16).to_le_bytes());
    fields.extend_from_slice(value);
    fields.resize(fields.len().next_multiple_of(4), 0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_as_long_as_it_says_and_ends_with_the_frame() {
        let psdu = [1, 2, 3];
        let record = record(SimTime::from_ns(3_000_000_007), (26, 0), Some(-90.0), Asn(300), &psdu);
        assert_eq!(record[..8], [3, 0, 0, 0, 7, 0, 0, 0]);
        assert_eq!(record[8..12], ((record.len() - 16) as u32).to_le_bytes());
        assert_eq!(record[8..12], record[12..16]);
        let fields = usize::from(u16::from_le_bytes([record[18], record[19]]));
        assert_eq!(record[16 + fields..], psdu);
        // FCS type, RSS (−90 = 0xc2b40000), channel 26 on page 0, start of frame, ASN.
        let rss = [1, 0, 4, 0, 0, 0, 0xb4, 0xc2];
        assert_eq!(record[20..28], [0, 0, 1, 0, 1, 0, 0, 0]);
        assert_eq!(record[28..36], rss);
        assert_eq!(record[36..44], [3, 0, 3, 0, 26, 0, 0, 0]);
        assert_eq!(record[44..48], [5, 0, 8, 0]);
        assert_eq!(record[56..68], [7, 0, 8, 0, 44, 1, 0, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn frames_that_nobody_received_have_no_strength() {
        let with = record(SimTime::START, (11, 0), Some(-50.0), Asn(0), &[]).len();
        assert_eq!(record(SimTime::START, (11, 0), None, Asn(0), &[]).len(), with - 8);
    }
}
