//! What a datagram carries, as bytes: UDP (RFC 768) and RPL in ICMPv6 (RFC 4443, § 2.1), with true checksums.

use super::{Datagram, UdpRepr, Upper};
use crate::wire::Malformed;
use crate::wire::rpl::RplMessage;
use crate::wire::sink::{ByteReader, Put, Sink, checksum_of, length_of};
use bytes::Bytes;

/// Next-header values.
pub(super) const UDP: u8 = 17;
pub(super) const ICMPV6: u8 = 58;
/// Type of an ICMPv6 message: RPL control.
const RPL: u8 = 155;

impl Upper {
    /// Length (bytes) before compression, its header included.
    #[must_use]
    pub(crate) fn uncompressed_len(&self) -> usize {
        match self {
            Self::Udp(udp) => 8 + udp.payload.len(),
            Self::Rpl(message) => 4 + length_of(message),
        }
    }

    /// Length (bytes) of what compression leaves alone: UDP's payload; all of an ICMPv6 message.
    pub(crate) fn tail_len(&self) -> usize {
        match self {
            Self::Udp(udp) => udp.payload.len(),
            Self::Rpl(_) => self.uncompressed_len(),
        }
    }
}

/// What compression leaves alone.
pub(crate) struct Tail<'a>(pub(crate) &'a Datagram);

impl Put for Tail<'_> {
    fn put<S: Sink>(&self, sink: &mut S) {
        match &self.0.upper {
            Upper::Udp(udp) => sink.put(&udp.payload),
            Upper::Rpl(message) => put_rpl(message, || self.0.checksum(), sink),
        }
    }
}

fn put_rpl<S: Sink>(message: &RplMessage, checksum: impl FnOnce() -> u16, sink: &mut S) {
    sink.put(&[RPL, message.code()]);
    sink.put_checksum(checksum);
    message.put(sink);
}

/// What checksums are computed over: pseudo-header (RFC 8200, § 8.1), then header and payload.
struct Summed<'a>(&'a Datagram);

impl Put for Summed<'_> {
    fn put<S: Sink>(&self, sink: &mut S) {
        let Datagram { source, destination, upper, .. } = self.0;
        sink.put_ip(*source);
        sink.put_ip(*destination);
        let length = upper.uncompressed_len();
        sink.put_u32(length as u32);
        match upper {
            Upper::Udp(udp) => {
                sink.put_u32(u32::from(UDP));
                sink.put_u16(udp.source_port);
                sink.put_u16(udp.destination_port);
                sink.put_u16(length as u16);
                sink.put_u16(0);
                sink.put(&udp.payload);
            }
            Upper::Rpl(message) => {
                sink.put_u32(u32::from(ICMPV6));
                put_rpl(message, || 0, sink);
            }
        }
    }
}

impl Datagram {
    /// Checksum of what it carries.
    pub(super) fn checksum(&self) -> u16 {
        match (checksum_of(&Summed(self)), &self.upper) {
            (0, Upper::Udp(_)) => 0xffff,
            (checksum, _) => checksum,
        }
    }
}

/// An ICMPv6 message with its checksum.
pub(super) fn parse_rpl(reader: &mut ByteReader<'_>) -> Result<(Upper, u16), Malformed> {
    let otherwise = reader.malformed("ICMPv6 but not RPL");
    let (kind, code, checksum) = (reader.u8()?, reader.u8()?, reader.u16()?);
    if kind != RPL {
        return Err(otherwise);
    }
    Ok((Upper::Rpl(RplMessage::parse(code, reader.rest())?), checksum))
}

/// A UDP datagram whose ports are known.
pub(super) fn parse_udp(ports: (u16, u16), reader: &mut ByteReader<'_>) -> Upper {
    let payload = Bytes::copy_from_slice(reader.rest());
    Upper::Udp(UdpRepr { source_port: ports.0, destination_port: ports.1, payload })
}
