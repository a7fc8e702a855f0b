//! Octets of CoJP messages: CoAP (RFC 7252, § 3) with a CBOR object as payload (RFC 9031, § 8.4).

use super::CojpRepr;
use crate::wire::sink::{ByteReader, Put, Sink, bytes_of, length_of, write};
use crate::wire::{Eui64, Malformed};

/// Version 1, non-confirmable (a stateless proxy cannot repeat), a token of 8 bytes.
const HEADER: u8 = 0x58;
/// 0.02.
const POST: u8 = 0x02;
/// 2.04.
const CHANGED: u8 = 0x44;
/// The group bit of an EUI-64, set in the tokens of a proxy.
const PROXY: u64 = 1 << 56;
/// Uri-Host (3) "6tisch.arpa", Uri-Path (11) "j": RFC 9031, § 8.1.1.
const OPTIONS: &[u8] = b"\x3b6tisch.arpa\x81j";
/// Proxy-Scheme (39) "coap", which a proxy takes off (RFC 7252, § 5.7.2).
const TO_PROXY: &[u8] = b"\xd4\x0fcoap";
const PAYLOAD: u8 = 0xff;
/// A map of one entry: network identifier (5), two bytes.
const NETWORK_IDENTIFIER: &[u8] = &[0xa1, 0x05, 0x42];
/// Maps of one entry, and of two.
const ONE: u8 = 0xa1;
const TWO: u8 = 0xa2;
/// Link-layer key set (2), an array of two, the first of them a number.
const KEY_SET: &[u8] = &[0x02, 0x82];
/// Join rate (7), a number.
const JOIN_RATE: u8 = 0x07;
/// Numbers that take one byte of their own, two, or four.
const NUMBER: u8 = 0x18;
const NUMBER_2: u8 = 0x19;
const NUMBER_4: u8 = 0x1a;
/// Sixteen bytes. They are zeros: frames are not secured.
const KEY: [u8; 17] = [0x50, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];

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
    /// Anything but the two messages of § 8.1.
    pub fn parse(bytes: &[u8]) -> Result<Self, Malformed> {
        let mut reader = ByteReader::new(bytes);
        if reader.u8()? != HEADER {
            return Err(Malformed { what: "not a non-confirmable message of CoJP", at: 0 });
        }
        let code = reader.u8()?;
        let message_id = reader.u16()?;
        let token = reader.u64()?;
        let pledge = Eui64(token & !PROXY);
        let proxy_state = (token & PROXY != 0).then_some(pledge);
        let message = match code {
            POST => {
                expect(&mut reader, OPTIONS, "other options than a join request's")?;
                if proxy_state.is_none() {
                    expect(&mut reader, TO_PROXY, "not to a proxy")?;
                }
                expect(&mut reader, &[PAYLOAD], "no payload")?;
                expect(&mut reader, NETWORK_IDENTIFIER, "no network identifier")?;
                let network_id = reader.u16()?;
                Self::Request { message_id, pledge, proxy_state, network_id }
            }
            CHANGED => {
                expect(&mut reader, &[PAYLOAD], "no payload")?;
                let entries = reader.u8()?;
                expect(&mut reader, KEY_SET, "no key set")?;
                let small = reader.u8()?;
                let key_index = match small {
                    0..NUMBER => small,
                    NUMBER => reader.u8()?,
                    _ => return Err(reader.malformed("not the index of a key")),
                };
                expect(&mut reader, &KEY[..1], "not a key of 16 bytes")?;
                reader.take(16)?;
                let join_rate_bytes_s = match entries {
                    ONE => None,
                    TWO => {
                        expect(&mut reader, &[JOIN_RATE], "no join rate")?;
                        Some(parse_number(&mut reader)?)
                    }
                    _ => return Err(reader.malformed("neither one parameter nor two")),
                };
                Self::Response { message_id, pledge, proxy_state, key_index, join_rate_bytes_s }
            }
            _ => return Err(Malformed { what: "neither POST nor 2.04", at: 1 }),
        };
        if reader.is_empty() { Ok(message) } else { Err(reader.malformed("more than the message")) }
    }
}

impl Put for CojpRepr {
    fn put<S: Sink>(&self, sink: &mut S) {
        let (code, message_id, pledge, proxy_state) = match *self {
            Self::Request { message_id, pledge, proxy_state, .. } => {
                (POST, message_id, pledge, proxy_state)
            }
            Self::Response { message_id, pledge, proxy_state, .. } => {
                (CHANGED, message_id, pledge, proxy_state)
            }
        };
        sink.put(&[HEADER, code]);
        sink.put_u16(message_id);
        let token = proxy_state.map_or(pledge.0 & !PROXY, |state| state.0 | PROXY);
        sink.put(&token.to_be_bytes());
        match *self {
            Self::Request { network_id, .. } => {
                sink.put(OPTIONS);
                if proxy_state.is_none() {
                    sink.put(TO_PROXY);
                }
                sink.put_u8(PAYLOAD);
                sink.put(NETWORK_IDENTIFIER);
                sink.put_u16(network_id);
            }
            Self::Response { key_index, join_rate_bytes_s, .. } => {
                sink.put(&[PAYLOAD, if join_rate_bytes_s.is_some() { TWO } else { ONE }]);
                sink.put(KEY_SET);
                if key_index >= NUMBER {
                    sink.put_u8(NUMBER);
                }
                sink.put_u8(key_index);
                sink.put(&KEY);
                if let Some(rate) = join_rate_bytes_s {
                    sink.put_u8(JOIN_RATE);
                    put_number(rate, sink);
                }
            }
        }
    }
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
