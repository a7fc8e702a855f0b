//! How datagrams are cut, and the octets of the parts: RFC 4944, § 5.3.

use super::{Fragment, LowpanRepr};
use crate::wire::datagram::{Compressed, Datagram, Headers, Hop, Tail};
use crate::wire::sink::{ByteReader, Put, Sink, Window, bytes_of, length_of, write};
use crate::wire::{Eui64, Malformed};
use std::net::Ipv6Addr;
use std::sync::Arc;

/// Dispatches, above the 11 bits of the datagram's size.
const FIRST: u16 = 0b11000 << 11;
const NEXT: u16 = 0b11100 << 11;
/// Length of the header of a first fragment, and of any other.
const FIRST_LEN: usize = 4;
const NEXT_LEN: usize = 5;
/// The greatest size of a datagram.
const MOST: usize = 0x7ff;

impl Datagram {
    /// Cuts a datagram so that every fragment fits `room` bytes of a frame. Offsets are multiples of 8 (§ 5.3); all
    /// headers are in the first fragment (RFC 6282, § 2). There, room is left for the least compression on any later
    /// hop, so that a mote may forward it as it is (RFC 8930, § 6). `None`: it is too large, or its headers are.
    #[must_use]
    pub fn fragment(self: &Arc<Self>, tag: u16, room: usize) -> Option<Vec<Fragment>> {
        let size = self.uncompressed_len();
        let headers = size - self.upper.tail_len();
        let first = FIRST_LEN + self.headers_len(Hop::Worst);
        if size > MOST || room < first || room < NEXT_LEN + 8 {
            return None;
        }
        let mut fragments = Vec::new();
        let (mut offset, mut most) = (0, headers + room - first);
        while offset < size {
            let covers = if size - offset <= most { size - offset } else { most / 8 * 8 };
            if offset == 0 && covers < headers {
                return None;
            }
            fragments.push(Fragment {
                size: size as u16,
                tag,
                offset: offset as u16,
                covers: covers as u16,
                datagram: self.clone(),
            });
            offset += covers;
            most = room - NEXT_LEN;
        }
        Some(fragments)
    }
}

impl LowpanRepr {
    /// The datagram, of which this may be a part only.
    #[must_use]
    pub fn datagram(&self) -> &Arc<Datagram> {
        match self {
            Self::Whole(datagram) => datagram,
            Self::First(fragment) | Self::Next(fragment) => &fragment.datagram,
        }
    }

    /// Length (bytes) on the way from one MAC address to another, or to everyone.
    #[must_use]
    pub fn buffer_len(&self, hop_source: Eui64, hop_destination: Option<Eui64>) -> usize {
        length_of(&Payload(self, Hop::Between(hop_source, hop_destination)))
    }

    /// Writes it to the beginning of `bytes`, which must have room for [`Self::buffer_len`].
    pub fn emit(&self, hop_source: Eui64, hop_destination: Option<Eui64>, bytes: &mut [u8]) {
        write(&Payload(self, Hop::Between(hop_source, hop_destination)), bytes);
    }

    /// Its bytes.
    #[must_use]
    pub fn to_vec(&self, hop_source: Eui64, hop_destination: Option<Eui64>) -> Vec<u8> {
        bytes_of(&Payload(self, Hop::Between(hop_source, hop_destination)))
    }
}

/// The payload of a frame on a hop.
pub(crate) struct Payload<'a>(pub(crate) &'a LowpanRepr, pub(crate) Hop);

impl Put for Payload<'_> {
    fn put<S: Sink>(&self, sink: &mut S) {
        let Self(payload, hop) = *self;
        match payload {
            LowpanRepr::Whole(datagram) => Compressed(datagram, hop).put(sink),
            LowpanRepr::First(fragment) => {
                sink.put_u16(FIRST | fragment.size & MOST as u16);
                sink.put_u16(fragment.tag);
                Headers(&fragment.datagram, hop).put(sink);
                fragment.put_tail(sink);
            }
            LowpanRepr::Next(fragment) => {
                sink.put_u16(NEXT | fragment.size & MOST as u16);
                sink.put_u16(fragment.tag);
                sink.put_u8((fragment.offset / 8) as u8);
                fragment.put_tail(sink);
            }
        }
    }
}

impl Fragment {
    /// What compression leaves alone, within the part's range. Where that begins in the datagram follows from the size
    /// as first cut: the headers of a forwarded datagram may have shrunk since (RFC 8138, § 5.5).
    fn put_tail<S: Sink>(&self, sink: &mut S) {
        let tail = self.datagram.upper.tail_len();
        let headers = usize::from(self.size).saturating_sub(tail);
        let start = usize::from(self.offset);
        let end = start + usize::from(self.covers);
        let skip = start.saturating_sub(headers);
        let take = end.saturating_sub(headers.max(start));
        Tail(&self.datagram).put(&mut Window::new(sink, skip, take));
    }
}

/// The header of a fragment that came in as bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FragmentHeader {
    /// Size (bytes) of the datagram before compression.
    pub size: u16,
    /// Tag, unique per sender.
    pub tag: u16,
    /// Where the part begins in the uncompressed datagram (bytes). 0: in front, with the compressed headers.
    pub offset: u16,
}

impl FragmentHeader {
    /// The header and what follows it; `None` if it is no fragment.
    ///
    /// # Errors
    /// A header that is cut off.
    pub fn parse(payload: &[u8]) -> Result<Option<(Self, &[u8])>, Malformed> {
        let mut reader = ByteReader::new(payload);
        let is_first = match reader.peek().map(|first| u16::from(first & 0xf8) << 8) {
            Some(FIRST) => true,
            Some(NEXT) => false,
            _ => return Ok(None),
        };
        let size = reader.u16()? & MOST as u16;
        let tag = reader.u16()?;
        let offset = if is_first { 0 } else { u16::from(reader.u8()?) * 8 };
        Ok(Some((Self { size, tag, offset }, reader.rest())))
    }
}

/// Puts a datagram together from the payloads of the frames that its parts came in, in any order. See
/// [`Datagram::parse`] for the rest.
///
/// # Errors
/// Parts that are not of one datagram, or not all of them.
pub fn reassemble(
    payloads: &[&[u8]],
    hop_source: Eui64,
    hop_destination: Option<Eui64>,
    root: Option<Ipv6Addr>,
) -> Result<Datagram, Malformed> {
    let mut parts = Vec::with_capacity(payloads.len());
    for payload in payloads {
        let part = FragmentHeader::parse(payload)?;
        parts.push(part.ok_or(Malformed { what: "not a fragment", at: 0 })?);
    }
    parts.sort_by_key(|(header, _)| header.offset);
    let mut bytes = Vec::new();
    for (header, content) in &parts {
        let FragmentHeader { size, tag, .. } = parts[0].0;
        if (header.size, header.tag) != (size, tag) {
            return Err(Malformed { what: "parts of two datagrams", at: bytes.len() });
        }
        bytes.extend_from_slice(content);
    }
    let datagram = Datagram::parse(&bytes, hop_source, hop_destination, root)?;
    let size = usize::from(parts[0].0.size);
    let headers = size.saturating_sub(datagram.upper.tail_len());
    let compressed = datagram.headers_len(Hop::Between(hop_source, hop_destination));
    let mut end = 0;
    for (i, (header, content)) in parts.iter().enumerate() {
        if usize::from(header.offset) != end {
            return Err(Malformed { what: "parts are missing", at: end });
        }
        end += if i == 0 { headers + content.len() - compressed } else { content.len() };
    }
    if end == size { Ok(datagram) } else { Err(Malformed { what: "parts are missing", at: end }) }
}
