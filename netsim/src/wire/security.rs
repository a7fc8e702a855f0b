//! Security of MAC frames: IEEE Std 802.15.4-2015, clause 9, with the keys of RFC 8180, § 4.6.
//!
//! | key | index | frames | level (9.4.1.1) |
//! |---|---|---|---|
//! | K1 | 1 | enhanced beacons | 1: MIC-32, not encrypted |
//! | K2 | 2 | all others, acknowledgments among them | 5: ENC-MIC-32 |
//!
//! The auxiliary security header (9.4) has two bytes: the security control field, and the index of the key (key identifier
//! mode 1). The frame counter is suppressed, because the nonce takes the absolute slot number in its place (9.3.2.2). The MIC
//! covers the whole frame. Header information elements stay legible; payload information elements and the payload are
//! encrypted (9.3.4).

use super::sink::{ByteReader, Put, Sink};
use super::{Eui64, Malformed};
use aes::Aes128;
use ccm::aead::array::ArraySize;
use ccm::consts::{U4, U13};
use ccm::{AeadInOut, Ccm, KeyInit, TagSize};
use physics::asn::Asn;
use serde::{Deserialize, Serialize};

/// Length of the message integrity code at levels 1 and 5 (bytes).
pub(crate) const MIC_LEN: usize = 4;
/// Length of the auxiliary security header (bytes).
pub(crate) const HEADER_LEN: usize = 2;
/// By how much a secured frame is longer than one that is not (bytes).
pub(crate) const OVERHEAD: usize = HEADER_LEN + MIC_LEN;

/// Security control field (9.4.1): key identifier mode 1, frame counter suppressed, ASN in the nonce.
const CONTROL: u8 = 1 << 3 | 1 << 5 | 1 << 6;
/// MIC-32 and ENC-MIC-32.
const AUTHENTICATED: u8 = 1;
const ENCRYPTED: u8 = 5;

/// How a frame is secured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum FrameSecurity {
    /// Not at all.
    #[default]
    Unsecured,
    /// Authenticated with K1.
    K1,
    /// Encrypted and authenticated with K2.
    K2,
}

impl FrameSecurity {
    /// Whether the frame has an auxiliary security header and a MIC.
    #[must_use]
    pub(crate) fn is_secured(self) -> bool {
        self != Self::Unsecured
    }

    /// Length of the message integrity code (bytes).
    #[must_use]
    pub(crate) fn mic_len(self) -> usize {
        if self.is_secured() { MIC_LEN } else { 0 }
    }

    /// By how much the frame is longer than one that is not secured (bytes).
    #[must_use]
    pub(crate) fn overhead(self) -> usize {
        if self.is_secured() { OVERHEAD } else { 0 }
    }

    /// The auxiliary security header that these two bytes are.
    pub(super) fn parse(reader: &mut ByteReader<'_>) -> Result<Self, Malformed> {
        let otherwise = reader.malformed("secured in another way than RFC 8180 has it");
        let (control, index) = (reader.u8()?, reader.u8()?);
        [Self::K1, Self::K2]
            .into_iter()
            .find(|security| security.header() == Some([control, index]))
            .ok_or(otherwise)
    }

    fn header(self) -> Option<[u8; HEADER_LEN]> {
        match self {
            Self::Unsecured => None,
            Self::K1 => Some([CONTROL | AUTHENTICATED, 1]),
            Self::K2 => Some([CONTROL | ENCRYPTED, 2]),
        }
    }
}

/// The auxiliary security header.
impl Put for FrameSecurity {
    fn put<S: Sink>(&self, sink: &mut S) {
        if let Some(header) = self.header() {
            sink.put(&header);
        }
    }
}

/// The link-layer keys of a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Keys {
    /// Authenticates enhanced beacons.
    pub k1: [u8; 16],
    /// Secures all other frames.
    pub k2: [u8; 16],
}

impl Keys {
    fn of(&self, security: FrameSecurity) -> Option<&[u8; 16]> {
        match security {
            FrameSecurity::Unsecured => None,
            FrameSecurity::K1 => Some(&self.k1),
            FrameSecurity::K2 => Some(&self.k2),
        }
    }

    /// Encrypts a frame as its security has it, and writes its MIC. `frame`: without FCS, with room for the MIC at its end;
    /// its first `open_len` bytes are the MAC header. `source`: whose address the nonce takes.
    pub(super) fn secure(
        &self,
        frame: &mut [u8],
        open_len: usize,
        security: FrameSecurity,
        source: Eui64,
        asn: Asn,
    ) {
        let Some(key) = self.of(security) else { return };
        let open_len = security.open_len(frame.len(), open_len);
        let (open, rest) = frame.split_at_mut(open_len);
        let (private, mic) = rest.split_at_mut(rest.len() - MIC_LEN);
        mic.copy_from_slice(&seal::<U4>(key, &nonce(source, asn), open, private));
    }

    /// Reverses [`Self::secure`]: decrypts what is encrypted, and removes the MIC.
    ///
    /// # Errors
    /// Another MIC: another key, nonce or content.
    pub(super) fn unsecure<'a>(
        &self,
        frame: &'a mut [u8],
        open_len: usize,
        security: FrameSecurity,
        source: Eui64,
        asn: Asn,
    ) -> Result<&'a [u8], Malformed> {
        let Some(key) = self.of(security) else { return Ok(frame) };
        let end = frame.len().saturating_sub(MIC_LEN);
        if end < open_len {
            return Err(Malformed { what: "it ends too early", at: end });
        }
        let open_len = security.open_len(frame.len(), open_len);
        let (open, rest) = frame.split_at_mut(open_len);
        let (private, mic) = rest.split_at_mut(end - open_len);
        let wrong = Malformed { what: "wrong message integrity code", at: end };
        unseal::<U4>(key, &nonce(source, asn), open, private, mic).ok_or(wrong)?;
        Ok(&frame[..end])
    }
}

impl FrameSecurity {
    /// Length of what is authenticated and not encrypted, in a frame of `len` bytes with its MIC.
    fn open_len(self, len: usize, header_len: usize) -> usize {
        if self == Self::K1 { len - MIC_LEN } else { header_len }
    }
}

/// CCM* nonce in TSCH mode (9.3.2.2): the extended address of the sender, and the absolute slot number, most significant
/// byte first.
#[must_use]
pub fn nonce(source: Eui64, asn: Asn) -> [u8; 13] {
    let mut nonce = [0; 13];
    nonce[..8].copy_from_slice(&source.octets());
    nonce[8..].copy_from_slice(&asn.0.to_be_bytes()[3..]);
    nonce
}

/// AES-128 in CCM* (annex B.4; CCM where there is a MIC): encrypts `private` in place and returns the MIC over `open` and it.
pub(super) fn seal<M: ArraySize + TagSize>(
    key: &[u8; 16],
    nonce: &[u8; 13],
    open: &[u8],
    private: &mut [u8],
) -> ccm::Tag<M> {
    Ccm::<Aes128, M, U13>::new(key.into())
        .encrypt_inout_detached(nonce.into(), open, private.into())
        .expect("a message is shorter than 2^16 bytes")
}

/// Reverses [`seal`]; `None`: `mic` is another one.
pub(super) fn unseal<M: ArraySize + TagSize>(
    key: &[u8; 16],
    nonce: &[u8; 13],
    open: &[u8],
    private: &mut [u8],
    mic: &[u8],
) -> Option<()> {
    let mic = mic.try_into().ok()?;
    let ccm = Ccm::<Aes128, M, U13>::new(key.into());
    ccm.decrypt_inout_detached(nonce.into(), open, private.into(), mic).ok()
}

#[cfg(test)]
mod tests;
