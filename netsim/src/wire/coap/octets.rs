//! Octets of CoAP messages: RFC 7252, § 3 and 3.1 (options), 3.2 (numbers).

use super::{Block, CoapRepr, Code, Token, Type};
use crate::wire::Malformed;
use crate::wire::sink::{ByteReader, Put, Sink, bytes_of, length_of};
use bytes::Bytes;

/// The first byte: version 1, the type, and the length of the token.
const VERSION: u8 = 0xc0;
const VERSION_1: u8 = 0x40;
const CONFIRMABLE: u8 = 0x00;
const ACKNOWLEDGMENT: u8 = 0x20;
const TYPE: u8 = 0x30;
const TOKEN_LENGTH: u8 = 0x0f;
const PAYLOAD: u8 = 0xff;
/// Numbers of options.
const URI_PATH: u16 = 11;
const BLOCK2: u16 = 23;
const SIZE2: u16 = 28;
/// A delta or a length from here on takes a byte of its own; from 269 on it would take two, which no message here needs.
const ONE_MORE: u16 = 13;

/// Whether a datagram to port 5683 is a message of an application: version 1, but not non-confirmable as those of the join protocol.
#[must_use]
pub fn is_application(payload: &[u8]) -> bool {
    payload.first().is_some_and(|first| {
        first & VERSION == VERSION_1 && matches!(first & TYPE, CONFIRMABLE | ACKNOWLEDGMENT)
    })
}

impl CoapRepr {
    /// Length (bytes) as UDP payload.
    #[must_use]
    pub fn buffer_len(&self) -> usize {
        length_of(self)
    }

    /// Its bytes.
    #[must_use]
    pub fn to_vec(&self) -> Vec<u8> {
        bytes_of(self)
    }

    /// The message that these bytes are.
    ///
    /// # Errors
    /// Anything but what [`CoapRepr`] can say, in the shortest form.
    pub fn parse(bytes: &[u8]) -> Result<Self, Malformed> {
        if !is_application(bytes) {
            return Err(Malformed { what: "neither confirmable nor an acknowledgment", at: 0 });
        }
        let mut reader = ByteReader::new(bytes);
        let first = reader.u8()?;
        let kind = match first & TYPE {
            CONFIRMABLE => Type::Confirmable,
            _ => Type::Acknowledgment,
        };
        let code = Code(reader.u8()?);
        let message_id = reader.u16()?;
        let otherwise = reader.malformed("a token of more than 8 bytes");
        let token = reader.take(usize::from(first & TOKEN_LENGTH))?;
        let token = Token::new(token).ok_or(otherwise)?;
        let mut message = Self {
            kind,
            code,
            message_id,
            token,
            path: None,
            block2: None,
            size2: None,
            payload: Bytes::new(),
        };
        let mut number = 0;
        while !reader.is_empty() {
            let first = reader.u8()?;
            if first == PAYLOAD {
                if reader.is_empty() {
                    return Err(reader.malformed("a payload marker without a payload"));
                }
                message.payload = Bytes::copy_from_slice(reader.rest());
                break;
            }
            let delta = extended(u16::from(first >> 4), &mut reader)?;
            let length = extended(u16::from(first & 0x0f), &mut reader)?;
            if delta == 0 {
                return Err(reader.malformed("an option that repeats"));
            }
            number += delta;
            let otherwise = reader.malformed("an option that is none of these, or malformed");
            let value = reader.take(usize::from(length))?;
            match number {
                URI_PATH => {
                    let path = std::str::from_utf8(value).map_err(|_| otherwise)?;
                    message.path = Some(path.to_owned());
                }
                BLOCK2 => {
                    let word = parse_number(value, 3).ok_or(otherwise)?;
                    let szx = (word & 7) as u8;
                    if szx == 7 {
                        return Err(otherwise);
                    }
                    message.block2 = Some(Block { number: word >> 4, more: word & 8 != 0, szx });
                }
                SIZE2 => message.size2 = Some(parse_number(value, 4).ok_or(otherwise)?),
                _ => return Err(otherwise),
            }
        }
        Ok(message)
    }
}

impl Put for CoapRepr {
    fn put<S: Sink>(&self, sink: &mut S) {
        let kind = match self.kind {
            Type::Confirmable => CONFIRMABLE,
            Type::Acknowledgment => ACKNOWLEDGMENT,
        };
        let token = self.token.bytes();
        sink.put(&[VERSION_1 | kind | token.len() as u8, self.code.0]);
        sink.put_u16(self.message_id);
        sink.put(token);
        let mut before = 0;
        let mut put_option = |number: u16, value: &[u8]| {
            put_header(number - before, value.len() as u16, sink);
            sink.put(value);
            before = number;
        };
        if let Some(path) = &self.path {
            put_option(URI_PATH, path.as_bytes());
        }
        if let Some(Block { number, more, szx }) = self.block2 {
            let word = number << 4 | u32::from(more) << 3 | u32::from(szx);
            put_option(BLOCK2, number_text(&word.to_be_bytes()));
        }
        if let Some(size) = self.size2 {
            put_option(SIZE2, number_text(&size.to_be_bytes()));
        }
        if !self.payload.is_empty() {
            sink.put_u8(PAYLOAD);
            sink.put(&self.payload);
        }
    }
}

/// Delta and length of an option, both less than 269.
fn put_header<S: Sink>(delta: u16, length: u16, sink: &mut S) {
    let nibble = |number: u16| number.min(ONE_MORE) as u8;
    sink.put_u8(nibble(delta) << 4 | nibble(length));
    for number in [delta, length] {
        if let Some(more) = number.checked_sub(ONE_MORE) {
            sink.put_u8(more as u8);
        }
    }
}

/// A delta or a length of which the four bits are known.
fn extended(nibble: u16, reader: &mut ByteReader<'_>) -> Result<u16, Malformed> {
    match nibble {
        0..ONE_MORE => Ok(nibble),
        ONE_MORE => Ok(u16::from(reader.u8()?) + ONE_MORE),
        _ => Err(reader.malformed("a delta or a length of 269 or more")),
    }
}

/// A number in as few bytes as it takes; 0 takes none.
fn number_text(bytes: &[u8; 4]) -> &[u8] {
    let n_zeros = bytes.iter().take_while(|&&byte| byte == 0).count();
    &bytes[n_zeros..]
}

fn parse_number(value: &[u8], most_bytes: usize) -> Option<u32> {
    let is_shortest = value.len() <= most_bytes && value.first() != Some(&0);
    is_shortest.then(|| value.iter().fold(0, |number, &byte| number << 8 | u32::from(byte)))
}
