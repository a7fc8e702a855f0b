//! From the compressed form back to the datagram.

use super::compressed::{
    CRITICAL, DESTINATION_CONTEXT, DOWN, ELECTIVE, FORWARDING_ERROR, HOP_LIMITS, IP_IN_IP, IPHC,
    MULTICAST, NEXT_HEADER, NHC_UDP, NO_CLASS, NO_INSTANCE, NO_LABEL, PAGE_1, PORTS_4, PORTS_8,
    RANK_ERROR, RPI, SHORT_RANK, SOURCE_CONTEXT, SRH_BYTES,
};
use super::upper::{ICMPV6, parse_rpl, parse_udp};
use super::{Datagram, RpiRepr, SourceRoute};
use crate::wire::address::{GLOBAL_PREFIX, LINK_LOCAL_PREFIX};
use crate::wire::sink::ByteReader;
use crate::wire::{Eui64, Malformed};
use std::net::Ipv6Addr;

impl Datagram {
    /// The datagram of which these bytes are the compressed form, on the way from one MAC address to another or to
    /// everyone. `root` is the receiver's DODAG's, which encapsulating headers do not name. Checksums are verified.
    ///
    /// # Errors
    /// Forms that [`Self::to_vec`] does not make, and wrong checksums.
    pub fn parse(
        bytes: &[u8],
        hop_source: Eui64,
        hop_destination: Option<Eui64>,
        root: Option<Ipv6Addr>,
    ) -> Result<Self, Malformed> {
        let mut reader = ByteReader::new(bytes);
        let routing = parse_routing_headers(&mut reader)?;
        let elided = match routing.tunnel_hop_limit {
            Some(_) => (None, None),
            None => (Some(hop_source), hop_destination),
        };
        let addresses = parse_iphc(&mut reader, elided)?;
        let (upper, checksum) = if addresses.is_udp {
            let ports = parse_ports(&mut reader)?;
            let checksum = reader.u16()?;
            (parse_udp(ports, &mut reader), checksum)
        } else {
            parse_rpl(&mut reader)?
        };
        let root = match routing.tunnel_hop_limit {
            Some(_) => root.ok_or(Malformed { what: "encapsulated by an unknown root", at: 0 }),
            None => Ok(addresses.source),
        };
        let route = match routing.route {
            Some(mut entries) => Some(SourceRoute {
                hops: resolve(root?, &mut entries)?,
                root: root?,
                tunnel_hop_limit: routing.tunnel_hop_limit,
            }),
            None if routing.tunnel_hop_limit.is_some() => {
                return Err(reader.malformed("encapsulated without a source route"));
            }
            None => None,
        };
        let datagram = Self {
            packet: 0,
            source: addresses.source,
            destination: addresses.destination,
            dscp: addresses.dscp,
            hop_limit: addresses.hop_limit,
            rpi: routing.rpi,
            route,
            upper,
        };
        if datagram.checksum() == checksum {
            Ok(datagram)
        } else {
            Err(reader.malformed("wrong checksum"))
        }
    }
}

/// Routing headers as they stand there.
struct Routing<'a> {
    /// Hops: type and addresses, not yet made whole.
    route: Option<Vec<(usize, ByteReader<'a>)>>,
    rpi: Option<RpiRepr>,
    tunnel_hop_limit: Option<u8>,
}

fn parse_routing_headers<'a>(reader: &mut ByteReader<'a>) -> Result<Routing<'a>, Malformed> {
    let mut routing = Routing { route: None, rpi: None, tunnel_hop_limit: None };
    if reader.peek() != Some(PAGE_1) {
        return Ok(routing);
    }
    reader.u8()?;
    while let Some(first) = reader.peek().filter(|first| first & 0xc0 == CRITICAL) {
        reader.u8()?;
        let kind = reader.u8()?;
        match (first & 0xe0, kind) {
            (CRITICAL, RPI) => routing.rpi = Some(parse_rpi(first, reader)?),
            (CRITICAL, 0..RPI) => {
                let kind = usize::from(kind);
                let n = usize::from(first & 0x1f) + 1;
                let addresses = ByteReader::new(reader.take(n * SRH_BYTES[kind])?);
                routing.route.get_or_insert_default().push((kind, addresses));
            }
            (ELECTIVE, IP_IN_IP) if first & 0x1f == 1 => {
                routing.tunnel_hop_limit = Some(reader.u8()?);
            }
            _ => return Err(reader.malformed("unknown routing header")),
        }
    }
    Ok(routing)
}

fn parse_rpi(first: u8, reader: &mut ByteReader<'_>) -> Result<RpiRepr, Malformed> {
    let instance = if first & NO_INSTANCE != 0 { 0 } else { reader.u8()? };
    let sender_rank =
        if first & SHORT_RANK != 0 { u16::from(reader.u8()?) << 8 } else { reader.u16()? };
    Ok(RpiRepr {
        down: first & DOWN != 0,
        rank_error: first & RANK_ERROR != 0,
        forwarding_error: first & FORWARDING_ERROR != 0,
        instance,
        sender_rank,
    })
}

/// Makes every hop's address whole.
fn resolve(
    root: Ipv6Addr,
    headers: &mut [(usize, ByteReader<'_>)],
) -> Result<Vec<Ipv6Addr>, Malformed> {
    let mut hops = Vec::new();
    let mut octets = root.octets();
    for (kind, addresses) in headers {
        while !addresses.is_empty() {
            let bytes = SRH_BYTES[*kind];
            octets[16 - bytes..].copy_from_slice(addresses.take(bytes)?);
            hops.push(Ipv6Addr::from(octets));
        }
    }
    Ok(hops)
}

struct Addresses {
    is_udp: bool,
    dscp: u8,
    hop_limit: u8,
    source: Ipv6Addr,
    destination: Ipv6Addr,
}

fn parse_iphc(
    reader: &mut ByteReader<'_>,
    (hop_source, hop_destination): (Option<Eui64>, Option<Eui64>),
) -> Result<Addresses, Malformed> {
    let first = reader.u8()?;
    let second = reader.u8()?;
    if first & 0xe0 != IPHC || second & 0x80 != 0 {
        return Err(reader.malformed("not IPHC with context 0"));
    }
    let dscp = match first & NO_CLASS {
        NO_CLASS => 0,
        NO_LABEL => reader.u8()?,
        _ => return Err(reader.malformed("with a flow label")),
    };
    if 63 < dscp {
        return Err(reader.malformed("with congestion notification"));
    }
    let is_udp = first & NEXT_HEADER != 0;
    if !is_udp && reader.u8()? != ICMPV6 {
        return Err(reader.malformed("unknown next header"));
    }
    let hop_limit = match HOP_LIMITS.iter().find(|(_, code)| *code == first & 3) {
        Some(&(limit, _)) => limit,
        None => reader.u8()?,
    };
    let source = match (second & SOURCE_CONTEXT != 0, second >> 4 & 3) {
        (true, 0) => Ipv6Addr::UNSPECIFIED,
        (context, mode) => parse_unicast(reader, context, mode, hop_source)?,
    };
    let context = second & DESTINATION_CONTEXT != 0;
    let destination = match (second & MULTICAST != 0, context) {
        (true, true) => return Err(reader.malformed("multicast by context")),
        (true, false) => parse_multicast(reader, second & 3)?,
        (false, context) => parse_unicast(reader, context, second & 3, hop_destination)?,
    };
    Ok(Addresses { is_udp, dscp, hop_limit, source, destination })
}

fn parse_unicast(
    reader: &mut ByteReader<'_>,
    context: bool,
    mode: u8,
    hop: Option<Eui64>,
) -> Result<Ipv6Addr, Malformed> {
    let prefix = if context { GLOBAL_PREFIX } else { LINK_LOCAL_PREFIX };
    let interface = match mode {
        0 if context => return Err(reader.malformed("reserved mode of address")),
        0 => return reader.ip(),
        1 => reader.u64()?,
        2 => 0x00ff_fe00_0000 | u64::from(reader.u16()?),
        _ => hop.ok_or(reader.malformed("an address told from nothing"))?.interface_id(),
    };
    Ok(Ipv6Addr::from_bits(u128::from(prefix) << 64 | u128::from(interface)))
}

fn parse_multicast(reader: &mut ByteReader<'_>, mode: u8) -> Result<Ipv6Addr, Malformed> {
    let mut octets = [0; 16];
    octets[0] = 0xff;
    let inline = match mode {
        0 => return reader.ip(),
        1 => 5,
        2 => 3,
        _ => 1,
    };
    octets[1] = if mode == 3 { 2 } else { reader.u8()? };
    octets[16 - inline..].copy_from_slice(reader.take(inline)?);
    Ok(Ipv6Addr::from(octets))
}

fn parse_ports(reader: &mut ByteReader<'_>) -> Result<(u16, u16), Malformed> {
    let otherwise = reader.malformed("not UDP with a checksum");
    match reader.u8()?.checked_sub(NHC_UDP) {
        Some(0) => Ok((reader.u16()?, reader.u16()?)),
        Some(1) => Ok((reader.u16()?, PORTS_8 | u16::from(reader.u8()?))),
        Some(2) => Ok((PORTS_8 | u16::from(reader.u8()?), reader.u16()?)),
        Some(3) => {
            let both = u16::from(reader.u8()?);
            Ok((PORTS_4 | both >> 4, PORTS_4 | both & 0xf))
        }
        _ => Err(otherwise),
    }
}
