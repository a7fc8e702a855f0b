//! Octets of MAC frames: IEEE Std 802.15.4-2015, clause 7, frame version 2, least significant byte first throughout.

use super::{AckRepr, BeaconRepr, Content, FrameRepr};
use crate::wire::Eui64;
use crate::wire::datagram::Hop;
use crate::wire::fragment::Payload;
use crate::wire::security::{FrameSecurity, Keys};
use crate::wire::sink::{Put, Sink, length_of, write};
use crate::wire::slots::OUI;
use physics::asn::Asn;

pub use physics::timing::MAX_PSDU_BYTES as MAX_PSDU;
/// Identifier of the one network there is.
pub const NETWORK_PAN: u16 = 0xabcd;
/// Length of the frame check sequence (bytes).
pub(super) const FCS_LEN: usize = 2;
/// The broadcast address, short.
pub(super) const BROADCAST: u16 = 0xffff;

/// Frame control (7.2.1).
pub(super) const BEACON: u16 = 0;
pub(super) const DATA: u16 = 1;
pub(super) const ACK: u16 = 2;
pub(super) const SECURED: u16 = 1 << 3;
pub(super) const PENDING: u16 = 1 << 4;
pub(super) const ACK_REQUEST: u16 = 1 << 5;
pub(super) const PAN_COMPRESSION: u16 = 1 << 6;
pub(super) const NO_SEQUENCE: u16 = 1 << 8;
pub(super) const ELEMENTS: u16 = 1 << 9;
pub(super) const DESTINATION: u16 = 10;
pub(super) const VERSION: u16 = 12;
pub(super) const SOURCE: u16 = 14;
/// Addressing modes.
pub(super) const SHORT: u16 = 2;
pub(super) const EXTENDED: u16 = 3;

/// Header information elements (7.4.2): vendor-specific, here the blacklist of a link; time correction; end of the header elements,
/// before payload elements (1) or before the payload (2).
pub(super) const VENDOR_HEADER: u16 = 0;
pub(super) const TIME_CORRECTION: u16 = 0x1e;
pub(super) const TERMINATION_1: u16 = 0x7e;
pub(super) const TERMINATION_2: u16 = 0x7f;
/// Payload information elements (7.4.3), by group.
pub(super) const MLME: u16 = 1;
pub(super) const VENDOR: u16 = 2;
pub(super) const IETF: u16 = 5;
pub(super) const PAYLOAD_TERMINATION: u16 = 0xf;
/// Nested in the MLME's (7.4.4): short ones, and one long one.
pub(super) const TSCH_SYNCHRONIZATION: u16 = 0x1a;
pub(super) const SLOTFRAME_AND_LINK: u16 = 0x1b;
pub(super) const TIMESLOT: u16 = 0x1c;
pub(super) const CHANNEL_HOPPING: u16 = 0x9;
/// 6P in the IETF's (RFC 8480, § 6.1: SUBIEID_6TOP).
pub(super) const SIXTOP: u8 = 0xc9;

/// Bytes left for a 6LoWPAN payload in a data frame to one mote, or to everyone.
#[must_use]
pub fn payload_room(destination: Option<Eui64>, security: FrameSecurity) -> usize {
    let addresses = if destination.is_some() { 8 } else { 2 } + 8;
    MAX_PSDU - FCS_LEN - (2 + 1 + 2 + addresses) - security.overhead()
}

impl FrameRepr {
    /// Length (bytes) of the PSDU, MIC and FCS included.
    #[must_use]
    pub fn buffer_len(&self) -> usize {
        length_of(self) + self.security.mic_len() + FCS_LEN
    }

    /// Writes the PSDU to the beginning of `bytes`, which must have room for [`Self::buffer_len`]. Without keys, the content
    /// of a secured frame is legible and its MIC is zero.
    pub fn emit(&self, bytes: &mut [u8]) {
        let end = write_with_mic(self, self.security, bytes);
        put_fcs(bytes, end);
    }

    /// The PSDU as [`Self::emit`] writes it.
    #[must_use]
    pub fn to_vec(&self) -> Vec<u8> {
        let mut bytes = vec![0; self.buffer_len()];
        self.emit(&mut bytes);
        bytes
    }

    /// The PSDU as it is sent in a slot, encrypted and authenticated as its security has it.
    #[must_use]
    pub(crate) fn to_secured_vec(&self, keys: &Keys, asn: Asn) -> Vec<u8> {
        let mut bytes = vec![0; self.buffer_len()];
        let end = write_with_mic(self, self.security, &mut bytes);
        let header_len = length_of(&Header(self));
        keys.secure(&mut bytes[..end], header_len, self.security, self.source, asn);
        put_fcs(&mut bytes, end);
        bytes
    }

    fn has_payload_elements(&self) -> bool {
        self.slots.is_some() || matches!(self.content, Content::Beacon(_) | Content::Sixp(_))
    }
}

impl AckRepr {
    /// Length (bytes) of the PSDU, MIC and FCS included.
    #[must_use]
    pub fn buffer_len(&self) -> usize {
        length_of(self) + self.security.mic_len() + FCS_LEN
    }

    /// Writes the PSDU to the beginning of `bytes`, which must have room for [`Self::buffer_len`]. Without keys, the MIC of
    /// a secured acknowledgment is zero.
    pub fn emit(&self, bytes: &mut [u8]) {
        let end = write_with_mic(self, self.security, bytes);
        put_fcs(bytes, end);
    }

    /// The PSDU as [`Self::emit`] writes it.
    #[must_use]
    pub fn to_vec(&self) -> Vec<u8> {
        let mut bytes = vec![0; self.buffer_len()];
        self.emit(&mut bytes);
        bytes
    }

    /// The PSDU as `source` sends it in a slot, authenticated as its security has it: there is nothing to encrypt.
    #[must_use]
    pub fn to_secured_vec(&self, keys: &Keys, source: Eui64, asn: Asn) -> Vec<u8> {
        let mut bytes = vec![0; self.buffer_len()];
        let end = write_with_mic(self, self.security, &mut bytes);
        keys.secure(&mut bytes[..end], length_of(self), self.security, source, asn);
        put_fcs(&mut bytes, end);
        bytes
    }
}

/// Writes a frame and leaves room for its MIC; returns how many bytes both take.
fn write_with_mic(message: &impl Put, security: FrameSecurity, bytes: &mut [u8]) -> usize {
    let mic_at = write(message, bytes);
    let end = mic_at + security.mic_len();
    bytes[mic_at..end].fill(0);
    end
}

fn put_fcs(bytes: &mut [u8], end: usize) {
    let fcs = fcs(&bytes[..end]);
    bytes[end..end + FCS_LEN].copy_from_slice(&fcs.to_le_bytes());
}

/// Frame check sequence (7.2.10): the ITU-T's CRC of 16 bits, x¹⁶ + x¹² + x⁵ + 1, bits in the order they are sent in.
#[must_use]
pub fn fcs(bytes: &[u8]) -> u16 {
    let mut crc = 0_u16;
    for byte in bytes {
        crc ^= u16::from(*byte);
        for _ in 0..8 {
            crc = crc >> 1 ^ if crc & 1 != 0 { 0x8408 } else { 0 };
        }
    }
    crc
}

/// Everything but MIC and FCS.
impl Put for FrameRepr {
    fn put<S: Sink>(&self, sink: &mut S) {
        Header(self).put(sink);
        Body(self).put(sink);
    }
}

/// The MAC header, which is never encrypted: to the end of the header information elements.
struct Header<'a>(&'a FrameRepr);

impl Put for Header<'_> {
    fn put<S: Sink>(&self, sink: &mut S) {
        let frame = self.0;
        let kind = if matches!(frame.content, Content::Beacon(_)) { BEACON } else { DATA };
        let has_payload_elements = frame.has_payload_elements();
        let has_elements = has_payload_elements || frame.blacklist.is_some();
        let flag = |set: bool, flag: u16| if set { flag } else { 0 };
        // Table 7-2: the destination's PAN identifier is there, the source's is not.
        let addressing = match frame.destination {
            Some(_) => EXTENDED << DESTINATION,
            None => SHORT << DESTINATION | PAN_COMPRESSION,
        };
        sink.put_u16_le(
            kind | flag(frame.security.is_secured(), SECURED)
                | flag(frame.pending, PENDING)
                | flag(frame.ack_request, ACK_REQUEST)
                | flag(has_elements, ELEMENTS)
                | addressing
                | 2 << VERSION
                | EXTENDED << SOURCE,
        );
        sink.put_u8(frame.sequence);
        sink.put_u16_le(NETWORK_PAN);
        match frame.destination {
            Some(destination) => put_address(destination, sink),
            None => sink.put_u16_le(BROADCAST),
        }
        put_address(frame.source, sink);
        frame.security.put(sink);
        if let Some(blacklist) = frame.blacklist {
            put_header_element(VENDOR_HEADER, 5, sink);
            sink.put(&OUI.to_le_bytes()[..3]);
            sink.put_u16_le(blacklist);
        }
        if has_payload_elements {
            put_header_element(TERMINATION_1, 0, sink);
        } else if has_elements && matches!(frame.content, Content::Lowpan(_)) {
            put_header_element(TERMINATION_2, 0, sink);
        }
    }
}

/// Payload information elements and payload.
struct Body<'a>(&'a FrameRepr);

impl Put for Body<'_> {
    fn put<S: Sink>(&self, sink: &mut S) {
        let frame = self.0;
        match &frame.content {
            Content::KeepAlive | Content::Lowpan(_) => {}
            Content::Beacon(beacon) => {
                put_payload_element(MLME, length_of(beacon), sink);
                beacon.put(sink);
            }
            Content::Sixp(message) => {
                put_payload_element(IETF, 1 + length_of(message), sink);
                sink.put_u8(SIXTOP);
                message.put(sink);
            }
        }
        if let Some(slots) = &frame.slots {
            put_payload_element(VENDOR, length_of(&**slots), sink);
            slots.put(sink);
        }
        if let Content::Lowpan(payload) = &frame.content {
            if frame.has_payload_elements() {
                put_payload_element(PAYLOAD_TERMINATION, 0, sink);
            }
            Payload(payload, Hop::Between(frame.source, frame.destination)).put(sink);
        }
    }
}

/// Everything but MIC and FCS.
impl Put for AckRepr {
    fn put<S: Sink>(&self, sink: &mut S) {
        let secured = if self.security.is_secured() { SECURED } else { 0 };
        sink.put_u16_le(ACK | secured | ELEMENTS | EXTENDED << DESTINATION | 2 << VERSION);
        sink.put_u8(self.sequence);
        sink.put_u16_le(NETWORK_PAN);
        put_address(self.destination, sink);
        self.security.put(sink);
        // 7.4.2.7: twelve bits, two's complement; bit 15, not set, would refuse the frame.
        put_header_element(TIME_CORRECTION, 2, sink);
        sink.put_u16_le(self.time_correction_us.clamp(-2048, 2047) as u16 & 0xfff);
    }
}

/// The elements nested in the MLME's (RFC 8180, appendix A.1, gives the same in the same order).
impl Put for BeaconRepr {
    fn put<S: Sink>(&self, sink: &mut S) {
        put_nested_short(TSCH_SYNCHRONIZATION, 6, sink);
        sink.put(&self.asn.0.to_le_bytes()[..5]);
        sink.put_u8(self.join_metric);
        put_nested_short(TIMESLOT, 1, sink);
        sink.put_u8(self.timeslot_id);
        let links: usize = self.slotframes.iter().map(|frame| 4 + 5 * frame.links.len()).sum();
        put_nested_short(SLOTFRAME_AND_LINK, 1 + links, sink);
        sink.put_u8(self.slotframes.len() as u8);
        for frame in &self.slotframes {
            sink.put_u8(frame.handle);
            sink.put_u16_le(frame.slots);
            sink.put_u8(frame.links.len() as u8);
            for &(slot, channel, options) in &frame.links {
                sink.put_u16_le(slot);
                sink.put_u16_le(channel);
                sink.put_u8(options);
            }
        }
        sink.put_u16_le(1 << 15 | CHANNEL_HOPPING << 11 | 1);
        sink.put_u8(self.hopping_sequence_id);
    }
}

fn put_address<S: Sink>(address: Eui64, sink: &mut S) {
    sink.put(&address.0.to_le_bytes());
}

/// Descriptor of a header information element (7.4.2.1).
fn put_header_element<S: Sink>(id: u16, length: u16, sink: &mut S) {
    sink.put_u16_le(id << 7 | length);
}

/// Descriptor of a payload information element (7.4.3.1).
fn put_payload_element<S: Sink>(group: u16, length: usize, sink: &mut S) {
    sink.put_u16_le(1 << 15 | group << 11 | length as u16 & 0x7ff);
}

/// Descriptor of a short nested information element (7.4.4.1).
fn put_nested_short<S: Sink>(id: u16, length: usize, sink: &mut S) {
    sink.put_u16_le(id << 8 | length as u16 & 0xff);
}
