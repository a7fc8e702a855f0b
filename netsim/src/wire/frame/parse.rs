//! From octets back to MAC frames.

use super::bytes::{
    ACK, ACK_REQUEST, BEACON, BROADCAST, CHANNEL_HOPPING, DATA, DESTINATION, ELEMENTS, EXTENDED,
    FCS_LEN, IETF, MLME, NETWORK_PAN, NO_SEQUENCE, PAN_COMPRESSION, PAYLOAD_TERMINATION, PENDING,
    SECURED, SHORT, SIXTOP, SLOTFRAME_AND_LINK, SOURCE, TERMINATION_1, TERMINATION_2,
    TIME_CORRECTION, TIMESLOT, TSCH_SYNCHRONIZATION, VENDOR, VENDOR_HEADER, VERSION, fcs,
};
use super::{AckRepr, BeaconRepr, BeaconSlotframe, Content, FrameRepr};
use crate::wire::datagram::Datagram;
use crate::wire::fragment::{FragmentHeader, LowpanRepr};
use crate::wire::security::{FrameSecurity, HEADER_LEN, Keys, MIC_LEN};
use crate::wire::sink::ByteReader;
use crate::wire::sixp::SixpRepr;
use crate::wire::slots::{OUI, SlotsRepr};
use crate::wire::{Eui64, Malformed};
use physics::asn::Asn;
use std::net::Ipv6Addr;
use std::sync::Arc;

/// A frame's header, its information elements and its payload, with a right FCS.
#[derive(Clone, Copy, Debug)]
pub struct Envelope<'a> {
    control: u16,
    /// Sequence number.
    pub sequence: u8,
    /// For whom; `None`: everyone.
    pub destination: Option<Eui64>,
    /// Who sent it; acknowledgments do not say.
    pub source: Option<Eui64>,
    /// Time correction (µs), if it has one.
    time_correction_us: Option<i16>,
    /// Channels that the link from its sender skips, if it says so; bit 0 is channel 11.
    pub blacklist: Option<u16>,
    /// First payload information element that is no vendor's: group and content.
    element: Option<(u16, &'a [u8])>,
    /// Content of the first vendor-specific one.
    vendor: Option<&'a [u8]>,
    /// MAC payload: in data frames 6LoWPAN's, whole datagrams or fragments ([`FragmentHeader::parse`]).
    pub payload: &'a [u8],
}

impl<'a> Envelope<'a> {
    /// Takes a PSDU apart.
    ///
    /// # Errors
    /// A wrong FCS; frames that are secured ([`unsecure`] comes first), of another version or network, or addressed in a way that
    /// [`FrameRepr::to_vec`] and [`AckRepr::to_vec`] do not use.
    pub fn parse(psdu: &'a [u8]) -> Result<Self, Malformed> {
        let end = psdu.len().saturating_sub(FCS_LEN);
        if psdu.len() < FCS_LEN || fcs(&psdu[..end]).to_le_bytes() != psdu[end..] {
            return Err(Malformed { what: "wrong frame check sequence", at: end });
        }
        let mut reader = ByteReader::new(&psdu[..end]);
        let Addressing { control, sequence, destination, source } = Addressing::parse(&mut reader)?;
        if control & SECURED != 0 {
            return Err(Malformed { what: "secured", at: 0 });
        }
        let (mut header, mut element, mut vendor) = (HeaderElements::default(), None, None);
        if control & ELEMENTS != 0 {
            header = parse_header_elements(&mut reader)?;
            if header.payload_follows {
                (element, vendor) = parse_payload_elements(&mut reader)?;
            }
        }
        let payload = reader.rest();
        Ok(Self {
            control,
            sequence,
            destination,
            source,
            time_correction_us: header.time_correction_us,
            blacklist: header.blacklist,
            element,
            vendor,
            payload,
        })
    }

    fn kind(&self) -> u16 {
        self.control & 7
    }
}

/// What a frame begins with.
struct Addressing {
    control: u16,
    sequence: u8,
    destination: Option<Eui64>,
    source: Option<Eui64>,
}

impl Addressing {
    fn parse(reader: &mut ByteReader<'_>) -> Result<Self, Malformed> {
        let control = reader.u16_le()?;
        if control >> VERSION & 3 != 2 || control & NO_SEQUENCE != 0 {
            return Err(Malformed { what: "not version 2, numbered", at: 0 });
        }
        let sequence = reader.u8()?;
        if reader.u16_le()? != NETWORK_PAN {
            return Err(Malformed { what: "of another network", at: 3 });
        }
        let destination = match (control >> DESTINATION & 3, control & PAN_COMPRESSION) {
            (EXTENDED, 0) => Some(Eui64(reader.u64_le()?)),
            (SHORT, PAN_COMPRESSION) if reader.u16_le()? == BROADCAST => None,
            _ => return Err(reader.malformed("addressed otherwise")),
        };
        let source = match control >> SOURCE & 3 {
            EXTENDED => Some(Eui64(reader.u64_le()?)),
            0 => None,
            _ => return Err(reader.malformed("a short source address")),
        };
        Ok(Self { control, sequence, destination, source })
    }
}

/// The frame that a secured PSDU carries, without auxiliary security header and MIC: what [`Envelope::parse`] takes apart.
/// Frames that are not secured stay as they are. `answered`: who was asked for an acknowledgment, which does not name its
/// sender.
///
/// # Errors
/// A wrong FCS or MIC; another security than RFC 8180's.
pub fn unsecure(
    psdu: &[u8],
    keys: &Keys,
    asn: Asn,
    answered: Option<Eui64>,
) -> Result<(Vec<u8>, FrameSecurity), Malformed> {
    let end = psdu.len().saturating_sub(FCS_LEN);
    if psdu.len() < FCS_LEN || fcs(&psdu[..end]).to_le_bytes() != psdu[end..] {
        return Err(Malformed { what: "wrong frame check sequence", at: end });
    }
    let mut reader = ByteReader::new(&psdu[..end]);
    let Addressing { control, source, .. } = Addressing::parse(&mut reader)?;
    if control & SECURED == 0 {
        return Ok((psdu.to_vec(), FrameSecurity::Unsecured));
    }
    let nameless = Malformed { what: "no source address", at: 0 };
    let source = source.or(answered).ok_or(nameless)?;
    let header_at = end - reader.remaining();
    let security = FrameSecurity::parse(&mut reader)?;
    let Some(len) = reader.remaining().checked_sub(MIC_LEN) else {
        return Err(reader.malformed("it ends too early"));
    };
    let before_mic = reader.take(len)?;
    let mut reader = ByteReader::new(before_mic);
    if control & ELEMENTS != 0 {
        parse_header_elements(&mut reader)?;
    }
    let header_len = end - MIC_LEN - reader.remaining();
    let mut frame = psdu[..end].to_vec();
    let legible = keys.unsecure(&mut frame, header_len, security, source, asn)?;
    let mut plain = (control & !SECURED).to_le_bytes().to_vec();
    plain.extend_from_slice(&legible[2..header_at]);
    plain.extend_from_slice(&legible[header_at + HEADER_LEN..]);
    let fcs = fcs(&plain).to_le_bytes();
    plain.extend_from_slice(&fcs);
    Ok((plain, security))
}

/// What the header information elements say.
#[derive(Clone, Copy, Debug, Default)]
struct HeaderElements {
    time_correction_us: Option<i16>,
    blacklist: Option<u16>,
    /// Whether payload information elements follow.
    payload_follows: bool,
}

fn parse_header_elements(reader: &mut ByteReader<'_>) -> Result<HeaderElements, Malformed> {
    let mut found = HeaderElements::default();
    while !reader.is_empty() {
        let descriptor = reader.u16_le()?;
        if descriptor >> 15 != 0 {
            return Err(reader.malformed("a payload element before the headers' end"));
        }
        let mut content = ByteReader::new(reader.take(usize::from(descriptor & 0x7f))?);
        match descriptor >> 7 & 0xff {
            TERMINATION_1 => return Ok(HeaderElements { payload_follows: true, ..found }),
            TERMINATION_2 => return Ok(found),
            TIME_CORRECTION => {
                found.time_correction_us = Some((content.u16_le()? << 4).cast_signed() >> 4);
            }
            VENDOR_HEADER if content.take(3)? == &OUI.to_le_bytes()[..3] => {
                found.blacklist = Some(content.u16_le()?);
            }
            _ => {}
        }
    }
    Ok(found)
}

/// The first payload information element that is no vendor's, and the first one that is.
type PayloadElements<'a> = (Option<(u16, &'a [u8])>, Option<&'a [u8]>);

fn parse_payload_elements<'a>(
    reader: &mut ByteReader<'a>,
) -> Result<PayloadElements<'a>, Malformed> {
    let (mut first, mut vendor) = (None, None);
    while !reader.is_empty() {
        let descriptor = reader.u16_le()?;
        let content = reader.take(usize::from(descriptor & 0x7ff))?;
        let group = descriptor >> 11 & 0xf;
        if group == PAYLOAD_TERMINATION {
            break;
        }
        if group == VENDOR {
            vendor = vendor.or(Some(content));
        } else {
            first = first.or(Some((group, content)));
        }
    }
    Ok((first, vendor))
}

impl FrameRepr {
    /// The frame that these bytes are, FCS included. `root` is that of the receiver's DODAG ([`Datagram::parse`]).
    ///
    /// # Errors
    /// As [`Envelope::parse`]; content that is malformed; fragments, of which one alone is no datagram
    /// ([`crate::wire::fragment::reassemble`]).
    pub fn parse(psdu: &[u8], root: Option<Ipv6Addr>) -> Result<Self, Malformed> {
        let envelope = Envelope::parse(psdu)?;
        let Envelope { control, sequence, destination, payload, .. } = envelope;
        let nameless = Malformed { what: "no source address", at: 0 };
        let source = envelope.source.ok_or(nameless)?;
        let content = match (envelope.kind(), envelope.element) {
            (BEACON, Some((MLME, elements))) => Content::Beacon(parse_beacon(elements)?),
            (DATA, Some((IETF, [SIXTOP, message @ ..]))) => {
                Content::Sixp(SixpRepr::parse(message)?)
            }
            (DATA, None) if payload.is_empty() => Content::KeepAlive,
            (DATA, None) if FragmentHeader::parse(payload)?.is_some() => {
                return Err(Malformed { what: "a fragment alone is no datagram", at: 0 });
            }
            (DATA, None) => {
                let datagram = Datagram::parse(payload, source, destination, root)?;
                Content::Lowpan(LowpanRepr::Whole(Arc::new(datagram)))
            }
            _ => return Err(Malformed { what: "neither beacon nor data of a known kind", at: 0 }),
        };
        let slots = envelope.vendor.map(SlotsRepr::parse).transpose()?.flatten().map(Box::new);
        let ack_request = control & ACK_REQUEST != 0;
        let pending = control & PENDING != 0;
        let security = FrameSecurity::Unsecured;
        let blacklist = envelope.blacklist;
        Ok(Self {
            source,
            destination,
            sequence,
            ack_request,
            pending,
            security,
            slots,
            blacklist,
            content,
        })
    }
}

impl AckRepr {
    /// The acknowledgment that these bytes are, FCS included.
    ///
    /// # Errors
    /// As [`Envelope::parse`]; other frames.
    pub fn parse(psdu: &[u8]) -> Result<Self, Malformed> {
        let envelope = Envelope::parse(psdu)?;
        let otherwise = Malformed { what: "not an enhanced acknowledgment", at: 0 };
        match (envelope.kind(), envelope.destination, envelope.time_correction_us) {
            (ACK, Some(destination), Some(time_correction_us)) => {
                let (sequence, security) = (envelope.sequence, FrameSecurity::Unsecured);
                Ok(Self { destination, sequence, time_correction_us, security })
            }
            _ => Err(otherwise),
        }
    }
}

fn parse_beacon(elements: &[u8]) -> Result<BeaconRepr, Malformed> {
    let mut reader = ByteReader::new(elements);
    let (mut synchronization, mut slotframes) = (None, Vec::new());
    let (mut timeslot_id, mut hopping_sequence_id) = (0, 0);
    while !reader.is_empty() {
        let descriptor = reader.u16_le()?;
        if descriptor >> 15 != 0 {
            let mut content = ByteReader::new(reader.take(usize::from(descriptor & 0x7ff))?);
            if descriptor >> 11 & 0xf == CHANNEL_HOPPING {
                hopping_sequence_id = content.u8()?;
            }
            continue;
        }
        let mut content = ByteReader::new(reader.take(usize::from(descriptor & 0xff))?);
        match descriptor >> 8 & 0x7f {
            TSCH_SYNCHRONIZATION => {
                let mut asn = [0; 8];
                asn[..5].copy_from_slice(content.take(5)?);
                synchronization = Some((u64::from_le_bytes(asn), content.u8()?));
            }
            TIMESLOT => timeslot_id = content.u8()?,
            SLOTFRAME_AND_LINK => {
                for _ in 0..content.u8()? {
                    slotframes.push(parse_slotframe(&mut content)?);
                }
            }
            _ => {}
        }
    }
    let (asn, join_metric) = synchronization.ok_or(reader.malformed("no TSCH synchronization"))?;
    Ok(BeaconRepr { asn: Asn(asn), join_metric, timeslot_id, hopping_sequence_id, slotframes })
}

fn parse_slotframe(reader: &mut ByteReader<'_>) -> Result<BeaconSlotframe, Malformed> {
    let (handle, slots, n_links) = (reader.u8()?, reader.u16_le()?, reader.u8()?);
    let mut links = Vec::with_capacity(usize::from(n_links));
    for _ in 0..n_links {
        links.push((reader.u16_le()?, reader.u16_le()?, reader.u8()?));
    }
    Ok(BeaconSlotframe { handle, slots, links })
}
