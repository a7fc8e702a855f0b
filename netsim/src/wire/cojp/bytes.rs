//! Octets of CoJP messages: CoAP (RFC 7252, § 3) with a CBOR object as payload (RFC 9031, § 8.4), or with its ciphertext.

use super::CojpRepr;
use crate::wire::oscore::partial_iv;
use crate::wire::security::Keys;
use crate::wire::sink::{ByteReader, Put, Sink, bytes_of, length_of, write};
use crate::wire::{Eui64, Malformed};

/// Version 1, non-confirmable (a stateless proxy cannot repeat), a token of 8 bytes; and without a token.
const HEADER: u8 = 0x58;
const WITHOUT_TOKEN: u8 = 0x50;
/// 0.02.
pub(super) const POST: u8 = 0x02;
/// 2.04.
pub(super) const CHANGED: u8 = 0x44;
/// The group bit of an EUI-64, set in the tokens of a proxy.
const PROXY: u64 = 1 << 56;
/// Uri-Host (3) "6tisch.arpa": RFC 9031, § 8.1.1.
const HOST: &[u8] = b"\x3b6tisch.arpa";
/// Uri-Path (11) "j", after that.
const PATH: &[u8] = b"\x81j";
/// OSCORE (9) after Uri-Host, the length apart; and alone and empty (RFC 8613, § 6.1).
const OSCORE: u8 = 0x60;
const OSCORE_ALONE: u8 = 0x90;
/// Flags of its value: an ID context and a key identifier follow.
const ID_CONTEXT_AND_KEY: u8 = 0x18;
/// Proxy-Scheme (39) "coap", after Uri-Path and after OSCORE, which a proxy takes off (RFC 7252, § 5.7.2).
const TO_PROXY: &[u8] = b"\xd4\x0fcoap";
const PROTECTED_TO_PROXY: &[u8] = b"\xd4\x11coap";
pub(super) const PAYLOAD: u8 = 0xff;
/// A map of one entry: network identifier (5), two bytes.
const NETWORK_IDENTIFIER: &[u8] = &[0xa1, 0x05, 0x42];
/// Maps of one entry, and of two.
const ONE: u8 = 0xa1;
const TWO: u8 = 0xa2;
/// Link-layer key set (2): an array of two, index and key; of six, index, usage and key twice.
const KEY_SET: u8 = 0x02;
const OF_ONE: u8 = 0x82;
const OF_TWO: u8 = 0x86;
/// Index and usage of each of two keys (§ 8.4.3): 6TiSCH-K1-MIC32, 6TiSCH-K2-ENC-MIC32.
const K1: &[u8] = &[1, 6];
const K2: &[u8] = &[2, 12];
/// Join rate (7), a number.
const JOIN_RATE: u8 = 0x07;
/// Numbers that take one byte of their own, two, or four.
const NUMBER: u8 = 0x18;
const NUMBER_2: u8 = 0x19;
const NUMBER_4: u8 = 0x1a;
/// A byte string of sixteen.
const KEY: u8 = 0x50;

impl CojpRepr {
    /// Length (bytes) as UDP payload.
    #[must_use]
    pub fn buffer_len(&self) -> usize {
        length_of(self)
    }

    /// Writes it to the beginning of `bytes`, which must have room for [`Self::buffer_len`].
    pub fn emit(&self, bytes: &mut [u8]) {
        write(self, bytes);
    }

    /// Its bytes.
    #[must_use]
    pub fn to_vec(&self) -> Vec<u8> {
        bytes_of(self)
    }

    /// The message that these bytes are.
    ///
    /// # Errors
    /// Anything but the two messages of § 8.1, protected or not.
    pub fn parse(bytes: &[u8]) -> Result<Self, Malformed> {
        let mut reader = ByteReader::new(bytes);
        let header = reader.u8()?;
        if header != HEADER && header != WITHOUT_TOKEN {
            return Err(Malformed { what: "not a non-confirmable message of CoJP", at: 0 });
        }
        let code = reader.u8()?;
        let message_id = reader.u16()?;
        let token = if header == HEADER { Some(reader.u64()?) } else { None };
        let proxy_state =
            token.filter(|token| token & PROXY != 0).map(|token| Eui64(token & !PROXY));
        if code == POST {
            expect(&mut reader, HOST, "other options than a join request's")?;
        } else if code != CHANGED {
            return Err(Malformed { what: "neither POST nor 2.04", at: 1 });
        }
        let is_plain = reader.peek().is_some_and(|byte| byte == PATH[0] || byte == PAYLOAD);
        if is_plain {
            let pledge = Eui64(token.ok_or(reader.malformed("no token"))? & !PROXY);
            return Self::parse_plain(code, message_id, pledge, proxy_state, &mut reader);
        }
        if proxy_state.is_none() && token.is_some() {
            return Err(reader.malformed("the token of a protected message is not a proxy's"));
        }
        if code == CHANGED {
            expect(&mut reader, &[OSCORE_ALONE, PAYLOAD], "no OSCORE option")?;
            let ciphertext = reader.rest().to_vec();
            return Ok(Self::ProtectedResponse { message_id, proxy_state, ciphertext });
        }
        let (pledge, sequence) = parse_oscore(&mut reader)?;
        if proxy_state.is_none() {
            expect(&mut reader, PROTECTED_TO_PROXY, "not to a proxy")?;
        }
        expect(&mut reader, &[PAYLOAD], "no payload")?;
        let ciphertext = reader.rest().to_vec();
        Ok(Self::ProtectedRequest { message_id, pledge, sequence, proxy_state, ciphertext })
    }

    fn parse_plain(
        code: u8,
        message_id: u16,
        pledge: Eui64,
        proxy_state: Option<Eui64>,
        reader: &mut ByteReader<'_>,
    ) -> Result<Self, Malformed> {
        if code == POST {
            expect(reader, PATH, "other options than a join request's")?;
            if proxy_state.is_none() {
                expect(reader, TO_PROXY, "not to a proxy")?;
            }
        }
        expect(reader, &[PAYLOAD], "no payload")?;
        let message = Self::parse_object(code, message_id, pledge, proxy_state, reader)?;
        if reader.is_empty() { Ok(message) } else { Err(reader.malformed("more than the message")) }
    }

    /// The CBOR object of a request or a response.
    pub(super) fn parse_object(
        code: u8,
        message_id: u16,
        pledge: Eui64,
        proxy_state: Option<Eui64>,
        reader: &mut ByteReader<'_>,
    ) -> Result<Self, Malformed> {
        if code == POST {
            expect(reader, NETWORK_IDENTIFIER, "no network identifier")?;
            let network_id = reader.u16()?;
            return Ok(Self::Request { message_id, pledge, proxy_state, network_id });
        }
        let entries = reader.u8()?;
        expect(reader, &[KEY_SET], "no key set")?;
        let (key_index, keys) = match reader.u8()? {
            OF_ONE => {
                let key_index = match reader.u8()? {
                    small @ 0..NUMBER => small,
                    NUMBER => reader.u8()?,
                    _ => return Err(reader.malformed("not the index of a key")),
                };
                parse_key(reader)?;
                (key_index, None)
            }
            OF_TWO => {
                expect(reader, K1, "not key K1")?;
                let k1 = parse_key(reader)?;
                expect(reader, K2, "not key K2")?;
                (K1[0], Some(Keys { k1, k2: parse_key(reader)? }))
            }
            _ => return Err(reader.malformed("neither one key nor two")),
        };
        let join_rate_bytes_s = match entries {
            ONE => None,
            TWO => {
                expect(reader, &[JOIN_RATE], "no join rate")?;
                Some(parse_number(reader)?)
            }
            _ => return Err(reader.malformed("neither one parameter nor two")),
        };
        Ok(Self::Response { message_id, pledge, proxy_state, key_index, keys, join_rate_bytes_s })
    }

    /// The CBOR object of a request or a response; of a protected message nothing.
    pub(super) fn put_object<S: Sink>(&self, sink: &mut S) {
        match self {
            Self::Request { network_id, .. } => {
                sink.put(NETWORK_IDENTIFIER);
                sink.put_u16(*network_id);
            }
            Self::Response { key_index, keys, join_rate_bytes_s, .. } => {
                sink.put(&[if join_rate_bytes_s.is_some() { TWO } else { ONE }, KEY_SET]);
                if let Some(Keys { k1, k2 }) = keys {
                    sink.put_u8(OF_TWO);
                    for (usage, key) in [(K1, k1), (K2, k2)] {
                        sink.put(usage);
                        sink.put_u8(KEY);
                        sink.put(key);
                    }
                } else {
                    sink.put_u8(OF_ONE);
                    if *key_index >= NUMBER {
                        sink.put_u8(NUMBER);
                    }
                    sink.put(&[*key_index, KEY]);
                    sink.put(&[0; 16]);
                }
                if let Some(rate) = join_rate_bytes_s {
                    sink.put_u8(JOIN_RATE);
                    put_number(*rate, sink);
                }
            }
            Self::ProtectedRequest { .. } | Self::ProtectedResponse { .. } => {}
        }
    }
}

impl Put for CojpRepr {
    fn put<S: Sink>(&self, sink: &mut S) {
        let (code, message_id, pledge, proxy_state) = match *self {
            Self::Request { message_id, pledge, proxy_state, .. } => {
                (POST, message_id, Some(pledge), proxy_state)
            }
            Self::Response { message_id, pledge, proxy_state, .. } => {
                (CHANGED, message_id, Some(pledge), proxy_state)
            }
            Self::ProtectedRequest { message_id, proxy_state, .. } => {
                (POST, message_id, None, proxy_state)
            }
            Self::ProtectedResponse { message_id, proxy_state, .. } => {
                (CHANGED, message_id, None, proxy_state)
            }
        };
        let token = match proxy_state {
            Some(state) => Some(state.0 | PROXY),
            None => pledge.map(|pledge| pledge.0 & !PROXY),
        };
        sink.put(&[if token.is_some() { HEADER } else { WITHOUT_TOKEN }, code]);
        sink.put_u16(message_id);
        if let Some(token) = token {
            sink.put(&token.to_be_bytes());
        }
        if code == POST {
            sink.put(HOST);
        }
        match self {
            Self::Request { .. } => {
                sink.put(PATH);
                if proxy_state.is_none() {
                    sink.put(TO_PROXY);
                }
            }
            Self::Response { .. } => {}
            Self::ProtectedRequest { pledge, sequence, .. } => {
                put_oscore(*pledge, *sequence, sink);
                if proxy_state.is_none() {
                    sink.put(PROTECTED_TO_PROXY);
                }
            }
            Self::ProtectedResponse { .. } => sink.put_u8(OSCORE_ALONE),
        }
        sink.put_u8(PAYLOAD);
        match self {
            Self::Request { .. } | Self::Response { .. } => self.put_object(sink),
            Self::ProtectedRequest { ciphertext, .. }
            | Self::ProtectedResponse { ciphertext, .. } => sink.put(ciphertext),
        }
    }
}

/// The OSCORE option of a request (RFC 8613, § 6.1): Partial IV, ID context, and a key identifier that is empty.
fn put_oscore<S: Sink>(pledge: Eui64, sequence: u32, sink: &mut S) {
    let partial_iv = partial_iv(sequence);
    match 10 + partial_iv.len() as u8 {
        length @ 0..13 => sink.put_u8(OSCORE | length),
        length => sink.put(&[OSCORE | 13, length - 13]),
    }
    sink.put_u8(ID_CONTEXT_AND_KEY | partial_iv.len() as u8);
    sink.put(&partial_iv);
    sink.put_u8(8);
    sink.put(&pledge.octets());
}

/// Who asks, with which sender sequence number.
fn parse_oscore(reader: &mut ByteReader<'_>) -> Result<(Eui64, u32), Malformed> {
    let otherwise = reader.malformed("not the OSCORE option of a join request");
    let option = reader.u8()?;
    let length = match option & 0xf {
        13 => 13 + reader.u8()?,
        length => length,
    };
    let n = length.checked_sub(10).filter(|n| option & 0xf0 == OSCORE && (1..=4).contains(n));
    let n = n.ok_or(otherwise)?;
    expect(reader, &[ID_CONTEXT_AND_KEY | n], "other flags than a join request's")?;
    let written = reader.take(usize::from(n))?;
    let sequence = written.iter().fold(0, |value, &byte| value << 8 | u32::from(byte));
    if partial_iv(sequence) != written {
        return Err(reader.malformed("a Partial IV with leading zeros"));
    }
    expect(reader, &[8], "not an ID context of 8 bytes")?;
    Ok((Eui64(reader.u64()?), sequence))
}

fn parse_key(reader: &mut ByteReader<'_>) -> Result<[u8; 16], Malformed> {
    expect(reader, &[KEY], "not a key of 16 bytes")?;
    let mut key = [0; 16];
    key.copy_from_slice(reader.take(16)?);
    Ok(key)
}

/// A number in as few bytes as it takes (RFC 8949, § 4.2.1).
fn put_number<S: Sink>(number: u32, sink: &mut S) {
    match (u8::try_from(number), u16::try_from(number)) {
        (Ok(small @ 0..NUMBER), _) => sink.put_u8(small),
        (Ok(byte), _) => sink.put(&[NUMBER, byte]),
        (Err(_), Ok(two)) => {
            sink.put_u8(NUMBER_2);
            sink.put_u16(two);
        }
        (Err(_), Err(_)) => {
            sink.put_u8(NUMBER_4);
            sink.put(&number.to_be_bytes());
        }
    }
}

fn parse_number(reader: &mut ByteReader<'_>) -> Result<u32, Malformed> {
    Ok(match reader.u8()? {
        small @ 0..NUMBER => small.into(),
        NUMBER => reader.u8()?.into(),
        NUMBER_2 => reader.u16()?.into(),
        NUMBER_4 => u32::from(reader.u16()?) << 16 | u32::from(reader.u16()?),
        _ => return Err(reader.malformed("not a number")),
    })
}

fn expect(reader: &mut ByteReader<'_>, bytes: &[u8], what: &'static str) -> Result<(), Malformed> {
    let otherwise = reader.malformed(what);
    if reader.take(bytes.len())? == bytes { Ok(()) } else { Err(otherwise) }
}
