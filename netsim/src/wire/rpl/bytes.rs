//! Octets of RPL control messages: RFC 6550, § 6.2 to 6.7.

use super::{DaoAckRepr, DaoRepr, DioRepr, DisRepr, DodagConfiguration, RplMessage};
use crate::wire::Malformed;
use crate::wire::sink::{ByteReader, Put, Sink, bytes_of, length_of, write};
use std::net::Ipv6Addr;

/// Codes of ICMPv6 messages of type 155 (§ 6).
const DIS: u8 = 0;
const DIO: u8 = 1;
const DAO: u8 = 2;
const DAO_ACK: u8 = 3;

/// Types of options (§ 20.4).
const PAD1: u8 = 0;
const CONFIGURATION: u8 = 4;
const TARGET: u8 = 5;
const TRANSIT: u8 = 6;
const PREFIX: u8 = 8;

/// Flags of the DODAG configuration (§ 6.7.6): 'T', whose motes compress as RFC 8138 says (RFC 9035, § 3), and the RPL
/// option's type, 0x23 (RFC 9008, § 4.1.3).
const COMPRESSED: u8 = 0x20;
const OPTION_TYPE_0X23: u8 = 0x10;
/// The 'K' flag of a DAO (§ 6.4.1).
const ACK_REQUEST: u8 = 0x80;
/// The 'D' flag of a DAO: a DODAG identifier follows. It does not here: instances are global.
const DODAG_ID: u8 = 0x40;
/// Path control (§ 6.7.8, § 9.9): there is one parent, which has the one bit that a Path Control Size of 0 leaves, the most
/// preferred.
const PATH_CONTROL: u8 = 0x80;
/// The 'A' flag of a prefix (§ 6.7.10): addresses may be formed under it.
const AUTONOMOUS: u8 = 0x40;

impl RplMessage {
    /// Its code as an ICMPv6 message (§ 6).
    #[must_use]
    pub fn code(&self) -> u8 {
        match self {
            Self::Dis(_) => DIS,
            Self::Dio(_) => DIO,
            Self::Dao(_) => DAO,
            Self::DaoAck(_) => DAO_ACK,
        }
    }

    /// Length (bytes) of base and options, without the 4 bytes of the ICMPv6 header.
    #[must_use]
    pub fn buffer_len(&self) -> usize {
        length_of(self)
    }

    /// Writes base and options to the beginning of `bytes`, which must have room for [`Self::buffer_len`].
    pub fn emit(&self, bytes: &mut [u8]) {
        write(self, bytes);
    }

    /// Base and options.
    #[must_use]
    pub fn to_vec(&self) -> Vec<u8> {
        bytes_of(self)
    }

    /// The message of this code. Unknown options are skipped (§ 6.7.1).
    ///
    /// # Errors
    /// Unknown codes; messages and options that end too early.
    pub fn parse(code: u8, bytes: &[u8]) -> Result<Self, Malformed> {
        let mut reader = ByteReader::new(bytes);
        match code {
            DIS => {
                reader.take(2)?;
                Ok(Self::Dis(DisRepr {}))
            }
            DIO => parse_dio(&mut reader).map(Self::Dio),
            DAO => parse_dao(&mut reader).map(Self::Dao),
            DAO_ACK => {
                let (instance, _, sequence, status) =
                    (reader.u8()?, reader.u8()?, reader.u8()?, reader.u8()?);
                Ok(Self::DaoAck(DaoAckRepr { instance, sequence, status }))
            }
            _ => Err(reader.malformed("unknown RPL message")),
        }
    }
}

impl Put for RplMessage {
    fn put<S: Sink>(&self, sink: &mut S) {
        match self {
            Self::Dis(DisRepr {}) => sink.put(&[0, 0]),
            Self::Dio(dio) => put_dio(dio, sink),
            Self::Dao(dao) => put_dao(dao, sink),
            Self::DaoAck(ack) => sink.put(&[ack.instance, 0, ack.sequence, ack.status]),
        }
    }
}

fn put_dio<S: Sink>(dio: &DioRepr, sink: &mut S) {
    sink.put(&[dio.instance, dio.version]);
    sink.put_u16(dio.rank);
    let flags = u8::from(dio.grounded) << 7 | (dio.mode & 7) << 3 | dio.preference & 7;
    sink.put(&[flags, dio.dtsn, 0, 0]);
    sink.put_ip(dio.dodag_id);
    if let Some(configuration) = dio.configuration {
        sink.put(&[CONFIGURATION, 14, COMPRESSED | OPTION_TYPE_0X23]);
        sink.put_u8(configuration.dio_interval_doublings);
        sink.put_u8(configuration.dio_interval_min);
        sink.put_u8(configuration.dio_redundancy);
        sink.put_u16(configuration.max_rank_increase);
        sink.put_u16(configuration.min_hop_rank_increase);
        sink.put_u16(configuration.objective);
        sink.put(&[0, configuration.default_lifetime]);
        sink.put_u16(configuration.lifetime_unit_s);
    }
    if let Some(prefix) = dio.prefix {
        sink.put(&[PREFIX, 30, 64, AUTONOMOUS]);
        sink.put_u32(u32::MAX);
        sink.put_u32(u32::MAX);
        sink.put_u32(0);
        sink.put_ip(Ipv6Addr::from_bits(u128::from(prefix) << 64));
    }
}

fn put_dao<S: Sink>(dao: &DaoRepr, sink: &mut S) {
    let flags = if dao.ack_request { ACK_REQUEST } else { 0 };
    sink.put(&[dao.instance, flags, 0, dao.sequence]);
    for &target in &dao.targets {
        sink.put(&[TARGET, 18, 0, 128]);
        sink.put_ip(target);
    }
    let length = if dao.parent.is_some() { 20 } else { 4 };
    sink.put(&[TRANSIT, length, 0, PATH_CONTROL, dao.path_sequence, dao.path_lifetime]);
    if let Some(parent) = dao.parent {
        sink.put_ip(parent);
    }
}

/// The next option: its type and what is in it.
fn option<'a>(reader: &mut ByteReader<'a>) -> Result<(u8, ByteReader<'a>), Malformed> {
    let kind = reader.u8()?;
    if kind == PAD1 {
        return Ok((PAD1, ByteReader::new(&[])));
    }
    let length = reader.u8()?;
    Ok((kind, ByteReader::new(reader.take(usize::from(length))?)))
}

fn parse_dio(reader: &mut ByteReader<'_>) -> Result<DioRepr, Malformed> {
    let (instance, version, rank) = (reader.u8()?, reader.u8()?, reader.u16()?);
    let (flags, dtsn) = (reader.u8()?, reader.u8()?);
    reader.take(2)?;
    let dodag_id = reader.ip()?;
    let (mut configuration, mut prefix) = (None, None);
    while !reader.is_empty() {
        let (kind, mut content) = option(reader)?;
        match kind {
            CONFIGURATION => configuration = Some(parse_configuration(&mut content)?),
            PREFIX => {
                if content.u8()? != 64 {
                    return Err(reader.malformed("a prefix of other than 64 bits"));
                }
                content.take(13)?;
                prefix = Some(content.u64()?);
            }
            _ => {}
        }
    }
    Ok(DioRepr {
        instance,
        version,
        rank,
        grounded: flags & 0x80 != 0,
        mode: flags >> 3 & 7,
        preference: flags & 7,
        dtsn,
        dodag_id,
        configuration,
        prefix,
    })
}

fn parse_configuration(content: &mut ByteReader<'_>) -> Result<DodagConfiguration, Malformed> {
    content.take(1)?;
    let (dio_interval_doublings, dio_interval_min) = (content.u8()?, content.u8()?);
    let dio_redundancy = content.u8()?;
    let (max_rank_increase, min_hop_rank_increase) = (content.u16()?, content.u16()?);
    let objective = content.u16()?;
    content.take(1)?;
    Ok(DodagConfiguration {
        dio_interval_doublings,
        dio_interval_min,
        dio_redundancy,
        max_rank_increase,
        min_hop_rank_increase,
        objective,
        default_lifetime: content.u8()?,
        lifetime_unit_s: content.u16()?,
    })
}

fn parse_dao(reader: &mut ByteReader<'_>) -> Result<DaoRepr, Malformed> {
    let (instance, flags) = (reader.u8()?, reader.u8()?);
    reader.take(1)?;
    let sequence = reader.u8()?;
    if flags & DODAG_ID != 0 {
        reader.take(16)?;
    }
    let mut targets = Vec::new();
    let mut transit = None;
    while !reader.is_empty() {
        let (kind, mut content) = option(reader)?;
        match kind {
            TARGET => {
                content.take(1)?;
                if content.u8()? != 128 {
                    return Err(reader.malformed("a target that is not one address"));
                }
                targets.push(content.ip()?);
            }
            TRANSIT => {
                content.take(2)?;
                let (path_sequence, path_lifetime) = (content.u8()?, content.u8()?);
                let parent = if content.is_empty() { None } else { Some(content.ip()?) };
                transit = Some((path_sequence, path_lifetime, parent));
            }
            _ => {}
        }
    }
    let (path_sequence, path_lifetime, parent) =
        transit.ok_or(reader.malformed("no transit information"))?;
    let ack_request = flags & ACK_REQUEST != 0;
    Ok(DaoRepr { instance, ack_request, sequence, targets, path_sequence, path_lifetime, parent })
}
