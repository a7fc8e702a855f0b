//! CoJP messages under OSCORE (RFC 8613): the code, Uri-Path and the CBOR object are encrypted (§ 4.1, Figure 5).

use super::CojpRepr;
use super::bytes::{CHANGED, PAYLOAD, POST};
use crate::wire::Eui64;
use crate::wire::oscore::Context;
use crate::wire::sink::{ByteReader, Put, Sink, bytes_of};

/// Uri-Path (11) "j" as the first option.
const PATH: &[u8] = b"\xb1j";

/// What OSCORE encrypts of a message (§ 5.3).
struct Plaintext<'a>(&'a CojpRepr);

impl Put for Plaintext<'_> {
    fn put<S: Sink>(&self, sink: &mut S) {
        if matches!(self.0, CojpRepr::Request { .. }) {
            sink.put_u8(POST);
            sink.put(PATH);
        } else {
            sink.put_u8(CHANGED);
        }
        sink.put_u8(PAYLOAD);
        self.0.put_object(sink);
    }
}

impl CojpRepr {
    /// A request or a response as OSCORE protects it. `sequence`: the sender sequence number of the request. A message that
    /// is protected already stays as it is.
    #[must_use]
    pub(crate) fn protect(self, context: &Context, sequence: u32) -> Self {
        match self {
            Self::Request { message_id, pledge, proxy_state, .. } => {
                let mut ciphertext = bytes_of(&Plaintext(&self));
                context.protect_request(sequence, &mut ciphertext);
                Self::ProtectedRequest { message_id, pledge, sequence, proxy_state, ciphertext }
            }
            Self::Response { message_id, proxy_state, .. } => {
                let mut ciphertext = bytes_of(&Plaintext(&self));
                context.protect_response(sequence, &mut ciphertext);
                Self::ProtectedResponse { message_id, proxy_state, ciphertext }
            }
            Self::ProtectedRequest { .. } | Self::ProtectedResponse { .. } => self,
        }
    }

    /// The request that a protected one carries; `None`: it is not authentic, or no request.
    #[must_use]
    pub(crate) fn unprotect_request(&self, context: &Context) -> Option<Self> {
        let Self::ProtectedRequest { message_id, pledge, sequence, proxy_state, ciphertext } = self
        else {
            return None;
        };
        let text = context.unprotect_request(*sequence, ciphertext)?;
        parse(&text, &[&[POST], PATH].concat(), *message_id, *pledge, *proxy_state)
    }

    /// The response that a protected one carries, to a request of `pledge` with one of these sequence numbers; `None`: it
    /// is not authentic, or no response.
    #[must_use]
    pub(crate) fn unprotect_response(
        &self,
        context: &Context,
        mut sequences: impl Iterator<Item = u32>,
        pledge: Eui64,
    ) -> Option<Self> {
        let Self::ProtectedResponse { message_id, proxy_state, ciphertext } = self else {
            return None;
        };
        let text =
            sequences.find_map(|sequence| context.unprotect_response(sequence, ciphertext))?;
        parse(&text, &[CHANGED], *message_id, pledge, *proxy_state)
    }
}

/// The message of which this is the plaintext, which begins as it must.
fn parse(
    text: &[u8],
    begin: &[u8],
    message_id: u16,
    pledge: Eui64,
    proxy_state: Option<Eui64>,
) -> Option<CojpRepr> {
    let object = text.strip_prefix(begin)?.strip_prefix(&[PAYLOAD])?;
    let mut reader = ByteReader::new(object);
    let message =
        CojpRepr::parse_object(begin[0], message_id, pledge, proxy_state, &mut reader).ok()?;
    reader.is_empty().then_some(message)
}
