//! The compressed form: paging dispatch and 6LoWPAN routing headers (RFC 8138), IPHC and NHC (RFC 6282).

use super::upper::{ICMPV6, Tail};
use super::{Datagram, RpiRepr, SourceRoute, Upper};
use crate::wire::Eui64;
use crate::wire::address::{GLOBAL_PREFIX, LINK_LOCAL_PREFIX};
use crate::wire::sink::{Put, Sink, bytes_of, length_of, write};
use std::net::Ipv6Addr;

/// Dispatch of page 1 (RFC 8025, § 3), where routing headers are.
pub(super) const PAGE_1: u8 = 0xf1;
/// A routing header that must be understood, and one that may be skipped (RFC 8138, § 4).
pub(super) const CRITICAL: u8 = 0x80;
pub(super) const ELECTIVE: u8 = 0xa0;
/// Types of routing headers: 0 to 4 are source routes with addresses of 1, 2, 4, 8, 16 bytes (§ 5.1).
pub(super) const SRH_BYTES: [usize; 5] = [1, 2, 4, 8, 16];
/// RPL packet information (§ 6).
pub(super) const RPI: u8 = 5;
/// IP in IP (§ 7).
pub(super) const IP_IN_IP: u8 = 6;
/// Addresses that one source route header holds at most (§ 5.1: five bits, less one).
const SRH_MOST: usize = 32;

/// Flags of the RPL packet information (§ 6).
pub(super) const DOWN: u8 = 0x10;
pub(super) const RANK_ERROR: u8 = 0x08;
pub(super) const FORWARDING_ERROR: u8 = 0x04;
pub(super) const NO_INSTANCE: u8 = 0x02;
pub(super) const SHORT_RANK: u8 = 0x01;

/// IPHC (RFC 6282, § 3.1.1): dispatch 011; then its fields.
pub(super) const IPHC: u8 = 0x60;
/// Traffic class and flow label are left out, or the flow label only.
pub(super) const NO_CLASS: u8 = 0x18;
pub(super) const NO_LABEL: u8 = 0x10;
pub(super) const NEXT_HEADER: u8 = 0x04;
pub(super) const SOURCE_CONTEXT: u8 = 0x40;
pub(super) const MULTICAST: u8 = 0x08;
pub(super) const DESTINATION_CONTEXT: u8 = 0x04;
/// Hop limits that take two bits only, by their code.
pub(super) const HOP_LIMITS: [(u8, u8); 3] = [(1, 1), (64, 2), (255, 3)];

/// NHC of UDP with its checksum (§ 4.3.3); ports that take four bits, and those that take a byte.
pub(super) const NHC_UDP: u8 = 0xf0;
pub(super) const PORTS_4: u16 = 0xf0b0;
pub(super) const PORTS_8: u16 = 0xf000;

/// The link that a compressed datagram crosses: what may be left out because the frame says it.
#[derive(Clone, Copy)]
pub(crate) enum Hop {
    /// From one MAC address to another, or to everyone.
    Between(Eui64, Option<Eui64>),
    /// Whichever takes the most bytes.
    Worst,
}

impl Datagram {
    /// Length (bytes) before compression: what fragments call the datagram's size.
    #[must_use]
    pub(crate) fn uncompressed_len(&self) -> usize {
        let inner = if self.is_encapsulated() { 40 } else { 0 };
        let rpi = if self.rpi.is_some() { 8 } else { 0 };
        40 + rpi + self.route_len() + inner + self.upper.uncompressed_len()
    }

    /// Length (bytes) of the compressed form on the way from one MAC address to another, or to everyone.
    #[must_use]
    pub(crate) fn compressed_len(
        &self,
        hop_source: Eui64,
        hop_destination: Option<Eui64>,
    ) -> usize {
        self.headers_len(Hop::Between(hop_source, hop_destination)) + self.upper.tail_len()
    }

    /// Writes the compressed form to the beginning of `bytes`, which must have room for `Self::compressed_len`.
    pub fn emit(&self, hop_source: Eui64, hop_destination: Option<Eui64>, bytes: &mut [u8]) {
        write(&Compressed(self, Hop::Between(hop_source, hop_destination)), bytes);
    }

    /// The compressed form.
    #[must_use]
    pub fn to_vec(&self, hop_source: Eui64, hop_destination: Option<Eui64>) -> Vec<u8> {
        bytes_of(&Compressed(self, Hop::Between(hop_source, hop_destination)))
    }

    /// Whether the root carries somebody else's datagram down in one of its own.
    #[must_use]
    pub(crate) fn is_encapsulated(&self) -> bool {
        self.tunnel_hop_limit().is_some()
    }

    /// Length (bytes) of the compressed headers.
    pub(crate) fn headers_len(&self, hop: Hop) -> usize {
        length_of(&Headers(self, hop))
    }

    /// Hop limit of the outer header of an encapsulated datagram.
    fn tunnel_hop_limit(&self) -> Option<u8> {
        self.source_route()?.tunnel_hop_limit
    }

    fn source_route(&self) -> Option<&SourceRoute> {
        self.route.as_ref().filter(|route| !route.hops.is_empty())
    }

    /// Length of the routing header of RFC 6554, § 3: all hops but the next one, which is the destination of the IPv6
    /// header, without the prefix that all share with it.
    fn route_len(&self) -> usize {
        let Some([first, others @ ..]) = self.source_route().map(|route| route.hops.as_slice())
        else {
            return 0;
        };
        if others.is_empty() {
            return 0;
        }
        let bytes = others.iter().map(|hop| differing(*first, *hop)).max().unwrap_or(0).max(1);
        8 + (others.len() * bytes).next_multiple_of(8)
    }
}

/// A whole datagram.
pub(crate) struct Compressed<'a>(pub(crate) &'a Datagram, pub(crate) Hop);

impl Put for Compressed<'_> {
    fn put<S: Sink>(&self, sink: &mut S) {
        Headers(self.0, self.1).put(sink);
        Tail(self.0).put(sink);
    }
}

/// Its headers, compressed.
pub(crate) struct Headers<'a>(pub(crate) &'a Datagram, pub(crate) Hop);

impl Put for Headers<'_> {
    fn put<S: Sink>(&self, sink: &mut S) {
        let Self(datagram, hop) = *self;
        let route = datagram.source_route();
        if datagram.rpi.is_some() || route.is_some() {
            sink.put_u8(PAGE_1);
        }
        if let Some(route) = route {
            put_route(route, sink);
        }
        if let Some(rpi) = datagram.rpi {
            put_rpi(rpi, hop, sink);
        }
        if let Some(hop_limit) = datagram.tunnel_hop_limit() {
            // The encapsulator is the root, and thereby left out (RFC 8138, § 7).
            sink.put(&[ELECTIVE | 1, IP_IN_IP, hop_limit]);
        }
        put_iphc(datagram, hop, sink);
        if let Upper::Udp(udp) = &datagram.upper {
            put_ports(udp.source_port, udp.destination_port, sink);
            sink.put_checksum(|| datagram.checksum());
        }
    }
}

/// How many bytes at the end of an address differ from another.
fn differing(reference: Ipv6Addr, address: Ipv6Addr) -> usize {
    let differ = reference.to_bits() ^ address.to_bits();
    16 - differ.leading_zeros() as usize / 8
}

/// The type of source route header for one address after another.
fn srh_type(reference: Ipv6Addr, address: Ipv6Addr) -> usize {
    let bytes = differing(reference, address);
    SRH_BYTES.iter().position(|&room| bytes <= room).unwrap_or(SRH_BYTES.len() - 1)
}

/// Each address relative to the one before it, the first to the root (RFC 8138, § 5.4). Neighbours of equal type share
/// a header.
fn put_route<S: Sink>(route: &SourceRoute, sink: &mut S) {
    let mut reference = route.root;
    let mut hops = route.hops.as_slice();
    while let Some(&first) = hops.first() {
        let kind = srh_type(reference, first);
        let mut before = reference;
        let alike =
            |hop: &&Ipv6Addr| srh_type(std::mem::replace(&mut before, **hop), **hop) == kind;
        let n = hops.iter().take(SRH_MOST).take_while(alike).count();
        sink.put(&[CRITICAL | (n - 1) as u8, kind as u8]);
        for hop in &hops[..n] {
            sink.put(&hop.octets()[16 - SRH_BYTES[kind]..]);
        }
        reference = hops[n - 1];
        hops = &hops[n..];
    }
}

fn put_rpi<S: Sink>(rpi: RpiRepr, hop: Hop, sink: &mut S) {
    let short = rpi.sender_rank.trailing_zeros() >= 8 && matches!(hop, Hop::Between(..));
    let flag = |set: bool, flag: u8| if set { flag } else { 0 };
    let flags = flag(rpi.down, DOWN)
        | flag(rpi.rank_error, RANK_ERROR)
        | flag(rpi.forwarding_error, FORWARDING_ERROR)
        | flag(rpi.instance == 0, NO_INSTANCE)
        | flag(short, SHORT_RANK);
    sink.put(&[CRITICAL | flags, RPI]);
    if rpi.instance != 0 {
        sink.put_u8(rpi.instance);
    }
    let rank = rpi.sender_rank.to_be_bytes();
    sink.put(if short { &rank[..1] } else { &rank });
}

fn put_iphc<S: Sink>(datagram: &Datagram, hop: Hop, sink: &mut S) {
    // Inside a tunnel, what may be left out is what the tunnel's header says: nothing that helps.
    let (hop_source, hop_destination) = match hop {
        Hop::Between(source, destination) if !datagram.is_encapsulated() => {
            (Some(source), destination)
        }
        Hop::Between(..) | Hop::Worst => (None, None),
    };
    let is_udp = matches!(datagram.upper, Upper::Udp(_));
    let hop_limit = HOP_LIMITS
        .iter()
        .find(|(limit, _)| *limit == datagram.hop_limit && matches!(hop, Hop::Between(..)))
        .map(|&(_, code)| code);
    let class = if datagram.dscp == 0 { NO_CLASS } else { NO_LABEL };
    sink.put_u8(IPHC | class | if is_udp { NEXT_HEADER } else { 0 } | hop_limit.unwrap_or(0));

    let source = datagram.source.octets();
    let destination = datagram.destination.octets();
    let (source_flags, source_inline) = if datagram.source.is_unspecified() {
        (SOURCE_CONTEXT, 0)
    } else {
        let (context, mode, inline) = unicast(datagram.source, hop_source);
        (if context { SOURCE_CONTEXT } else { 0 } | mode << 4, inline)
    };
    if datagram.destination.is_multicast() {
        let (mode, inline) = multicast(&destination);
        sink.put_u8(source_flags | MULTICAST | mode);
        put_between(is_udp, hop_limit, datagram, sink);
        sink.put(&source[16 - source_inline..]);
        if inline < 16 && inline > 1 {
            sink.put_u8(destination[1]);
            sink.put(&destination[17 - inline..]);
        } else {
            sink.put(&destination[16 - inline..]);
        }
    } else {
        let (context, mode, inline) = unicast(datagram.destination, hop_destination);
        sink.put_u8(source_flags | if context { DESTINATION_CONTEXT } else { 0 } | mode);
        put_between(is_udp, hop_limit, datagram, sink);
        sink.put(&source[16 - source_inline..]);
        sink.put(&destination[16 - inline..]);
    }
}

/// What stands between IPHC's flags and the addresses.
fn put_between<S: Sink>(is_udp: bool, hop_limit: Option<u8>, datagram: &Datagram, sink: &mut S) {
    if datagram.dscp != 0 {
        // Explicit congestion notification, which comes first, is not used.
        sink.put_u8(datagram.dscp);
    }
    if !is_udp {
        sink.put_u8(ICMPV6);
    }
    if hop_limit.is_none() {
        sink.put_u8(datagram.hop_limit);
    }
}

/// How a unicast address is compressed (RFC 6282, § 3.1.1): whether by context, mode, bytes in line.
fn unicast(address: Ipv6Addr, hop: Option<Eui64>) -> (bool, u8, usize) {
    let bits = address.to_bits();
    let (prefix, interface) = ((bits >> 64) as u64, bits as u64);
    let context = match prefix {
        GLOBAL_PREFIX => true,
        LINK_LOCAL_PREFIX => false,
        _ => return (false, 0, 16),
    };
    if hop.is_some_and(|hop| hop.interface_id() == interface) {
        (context, 3, 0)
    } else if interface >> 16 == 0x0000_00ff_fe00 {
        (context, 2, 2)
    } else {
        (context, 1, 8)
    }
}

/// How a multicast address is compressed: mode, bytes in line.
fn multicast(address: &[u8; 16]) -> (u8, usize) {
    let zeros_up_to = |end: usize| address[2..end].iter().all(|&byte| byte == 0);
    if address[1] == 2 && zeros_up_to(15) {
        (3, 1)
    } else if zeros_up_to(13) {
        (2, 4)
    } else if zeros_up_to(11) {
        (1, 6)
    } else {
        (0, 16)
    }
}

fn put_ports<S: Sink>(source: u16, destination: u16, sink: &mut S) {
    if source & 0xfff0 == PORTS_4 && destination & 0xfff0 == PORTS_4 {
        sink.put(&[NHC_UDP | 3, (source as u8) << 4 | destination as u8 & 0xf]);
    } else if destination & 0xff00 == PORTS_8 {
        sink.put_u8(NHC_UDP | 1);
        sink.put_u16(source);
        sink.put_u8(destination as u8);
    } else if source & 0xff00 == PORTS_8 {
        sink.put(&[NHC_UDP | 2, source as u8]);
        sink.put_u16(destination);
    } else {
        sink.put_u8(NHC_UDP);
        sink.put_u16(source);
        sink.put_u16(destination);
    }
}
