//! CoAP messages of applications: RFC 7252, § 3, with block-wise transfer (RFC 7959, § 2.2).
//!
//! Confirmable requests, and acknowledgments with piggybacked responses. The messages of the join protocol, which are
//! non-confirmable, are [`super::cojp`]; both go to port 5683, where [`is_application`] tells them apart.

mod octets;

pub use octets::is_application;

/// Type of a message (RFC 7252, § 4.2 and 4.3): those that applications use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Type {
    /// CON: it wants an acknowledgment.
    Confirmable,
    /// ACK.
    Acknowledgment,
}

/// Method or response code (RFC 7252, § 12.1): class in the upper three bits, detail in the lower five.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Code(pub u8);

impl Code {
    /// 0.01 GET.
    pub const GET: Self = Self(0x01);
    /// 0.02 POST.
    pub const POST: Self = Self(0x02);
    /// 2.04 Changed.
    pub(crate) const CHANGED: Self = Self(0x44);
    /// 2.05 Content.
    pub const CONTENT: Self = Self(0x45);
}

/// A token: 0 to 8 bytes (RFC 7252, § 3).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Token {
    n_bytes: u8,
    /// Zeros behind the last byte.
    bytes: [u8; 8],
}

impl Token {
    /// The token with these bytes; `None`: they are more than 8.
    #[must_use]
    pub fn new(bytes: &[u8]) -> Option<Self> {
        let mut token = Self { n_bytes: bytes.len() as u8, bytes: [0; 8] };
        token.bytes.get_mut(..bytes.len())?.copy_from_slice(bytes);
        Some(token)
    }

    /// Its bytes.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes[..usize::from(self.n_bytes)]
    }
}

impl From<u32> for Token {
    /// Four bytes, the most significant first.
    fn from(number: u32) -> Self {
        let mut token = Self { n_bytes: 4, bytes: [0; 8] };
        token.bytes[..4].copy_from_slice(&number.to_be_bytes());
        token
    }
}

/// A block of a block-wise transfer (RFC 7959, § 2.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// NUM: which, from 0; less than 2^20.
    pub number: u32,
    /// M: whether more follow.
    pub more: bool,
    /// SZX: its size is 2^(szx + 4) bytes; 0 to 6.
    pub szx: u8,
}

impl Block {
    /// Size of a block (bytes); the last one may be shorter.
    #[must_use]
    pub fn size_bytes(self) -> u32 {
        16 << self.szx
    }
}

/// A CoAP message, the payload of a UDP datagram.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CoapRepr {
    /// CON or ACK.
    pub kind: Type,
    /// Method, or response code.
    pub code: Code,
    /// Message ID, by which an acknowledgment belongs to its message.
    pub message_id: u16,
    /// Token, by which a response belongs to its request.
    pub token: Token,
    /// Uri-Path (11), in requests: a path of one segment, at most 255 bytes of UTF-8.
    pub path: Option<String>,
    /// Block2 (23): a block of the response.
    pub block2: Option<Block>,
    /// Size2 (28): size of the whole representation (bytes; RFC 7959, § 4).
    pub size2: Option<u32>,
    /// Payload.
    pub payload: bytes::Bytes,
}

impl CoapRepr {
    /// A confirmable request without message ID and token.
    #[must_use]
    pub fn request(code: Code, path: &str) -> Self {
        Self {
            kind: Type::Confirmable,
            code,
            message_id: 0,
            token: Token::default(),
            path: Some(path.to_owned()),
            block2: None,
            size2: None,
            payload: bytes::Bytes::new(),
        }
    }

    /// The acknowledgment of this request, with a response of that code.
    #[must_use]
    pub fn response(&self, code: Code) -> Self {
        Self {
            kind: Type::Acknowledgment,
            code,
            message_id: self.message_id,
            token: self.token,
            path: None,
            block2: None,
            size2: None,
            payload: bytes::Bytes::new(),
        }
    }

    /// Whether it is the piggybacked response to the request with this message ID and token.
    #[must_use]
    pub fn answers(&self, message_id: u16, token: Token) -> bool {
        self.kind == Type::Acknowledgment && self.message_id == message_id && self.token == token
    }
}

#[cfg(test)]
mod tests;
