//! Object security of join messages: OSCORE (RFC 8613) with AES-CCM-16-64-128 and HKDF SHA-256, as RFC 9031, § 7.3, sets
//! it up: the pledge's identifier is empty, the registrar's is "JRC", the ID context is the pledge's address.

use super::Eui64;
use super::security::{seal, unseal};
use aes::cipher::{BlockCipherEncrypt, KeyInit};
use ccm::consts::U8;
use hkdf::Hkdf;
use sha2::Sha256;

/// Length of the authentication tag (bytes).
pub(crate) const TAG_LEN: usize = 8;
/// Number of AES-CCM-16-64-128 (RFC 9053, § 4.2).
const ALGORITHM: u8 = 10;
/// Identifier of the registrar.
const REGISTRAR: &[u8] = b"JRC";

/// A security context (§ 3): the keys of both ways, and what nonces are made of.
#[derive(Debug)]
pub struct Context {
    sender_id: Vec<u8>,
    recipient_id: Vec<u8>,
    sender_key: [u8; 16],
    recipient_key: [u8; 16],
    common_iv: [u8; 13],
}

impl Context {
    /// Derives a context (§ 3.2.1). Identifiers have 7 bytes at most (§ 3.3), the ID context 23.
    #[must_use]
    pub fn derive(
        secret: &[u8],
        salt: &[u8],
        id_context: Option<&[u8]>,
        sender_id: &[u8],
        recipient_id: &[u8],
    ) -> Self {
        let hkdf = Hkdf::<Sha256>::new(Some(salt), secret);
        let (mut sender_key, mut recipient_key, mut common_iv) = ([0; 16], [0; 16], [0; 13]);
        for (id, kind, output) in [
            (sender_id, "Key", &mut sender_key[..]),
            (recipient_id, "Key", &mut recipient_key[..]),
            (&[], "IV", &mut common_iv[..]),
        ] {
            let mut info = vec![0x85];
            put_octets(&mut info, id);
            match id_context {
                Some(id_context) => put_octets(&mut info, id_context),
                None => info.push(0xf6),
            }
            info.extend_from_slice(&[ALGORITHM, 0x60 | kind.len() as u8]);
            info.extend_from_slice(kind.as_bytes());
            info.push(output.len() as u8);
            hkdf.expand(&info, output).expect("one block of SHA-256 holds either");
        }
        let (sender_id, recipient_id) = (sender_id.to_vec(), recipient_id.to_vec());
        Self { sender_id, recipient_id, sender_key, recipient_key, common_iv }
    }

    /// The context of a pledge, towards the registrar. `join_key`: see [`pre_shared_key`].
    #[must_use]
    pub(crate) fn of_pledge(join_key: &[u8; 16], pledge: Eui64) -> Self {
        let secret = pre_shared_key(join_key, pledge);
        Self::derive(&secret, &[], Some(&pledge.octets()), &[], REGISTRAR)
    }

    /// The registrar's context, towards a pledge.
    #[must_use]
    pub(crate) fn of_registrar(join_key: &[u8; 16], pledge: Eui64) -> Self {
        let secret = pre_shared_key(join_key, pledge);
        Self::derive(&secret, &[], Some(&pledge.octets()), REGISTRAR, &[])
    }

    /// Encrypts a request of ours; its tag is appended. `sequence`: the sender sequence number, sent as Partial IV.
    pub(crate) fn protect_request(&self, sequence: u32, message: &mut Vec<u8>) {
        self.protect(&self.sender_id, sequence, message);
    }

    /// Decrypts a request to us; `None`: it is not authentic.
    #[must_use]
    pub(crate) fn unprotect_request(&self, sequence: u32, message: &[u8]) -> Option<Vec<u8>> {
        self.unprotect(&self.recipient_id, sequence, message)
    }

    /// Encrypts the response to the request that had this sequence number; its nonce is the request's (§ 5.2).
    pub(crate) fn protect_response(&self, sequence: u32, message: &mut Vec<u8>) {
        self.protect(&self.recipient_id, sequence, message);
    }

    /// Decrypts the response to the request of ours that had this sequence number; `None`: it is not authentic.
    #[must_use]
    pub(crate) fn unprotect_response(&self, sequence: u32, message: &[u8]) -> Option<Vec<u8>> {
        self.unprotect(&self.sender_id, sequence, message)
    }

    fn protect(&self, requester: &[u8], sequence: u32, message: &mut Vec<u8>) {
        let (nonce, aad) = (self.nonce(requester, sequence), additional_data(requester, sequence));
        let tag = seal::<U8>(&self.sender_key, &nonce, &aad, message);
        message.extend_from_slice(&tag);
    }

    fn unprotect(&self, requester: &[u8], sequence: u32, message: &[u8]) -> Option<Vec<u8>> {
        let (text, tag) = message.split_at(message.len().checked_sub(TAG_LEN)?);
        let (nonce, aad) = (self.nonce(requester, sequence), additional_data(requester, sequence));
        let mut text = text.to_vec();
        unseal::<U8>(&self.recipient_key, &nonce, &aad, &mut text, tag)?;
        Some(text)
    }

    /// § 5.2: size and value of the identifier, the Partial IV, over the common IV.
    fn nonce(&self, requester: &[u8], sequence: u32) -> [u8; 13] {
        let mut nonce = [0; 13];
        nonce[0] = requester.len() as u8;
        nonce[8 - requester.len()..8].copy_from_slice(requester);
        nonce[9..].copy_from_slice(&sequence.to_be_bytes());
        nonce.iter_mut().zip(self.common_iv).for_each(|(byte, common)| *byte ^= common);
        nonce
    }
}

/// A sender sequence number in as few bytes as it takes, one at least (§ 6.1): the Partial IV.
#[must_use]
pub(crate) fn partial_iv(sequence: u32) -> Vec<u8> {
    let bytes = sequence.to_be_bytes();
    bytes[(sequence.leading_zeros() as usize / 8).min(3)..].to_vec()
}

/// The key that a pledge shares with the registrar. RFC 9031, § 3, wants another one for each pledge and leaves open how it
/// is provisioned; here it is the pledge's address, encrypted with a key of the network's owner.
#[must_use]
pub(crate) fn pre_shared_key(join_key: &[u8; 16], pledge: Eui64) -> [u8; 16] {
    let mut block = [0; 16];
    block[..8].copy_from_slice(&pledge.octets());
    aes::Aes128::new(join_key.into()).encrypt_block((&mut block).into());
    block
}

/// § 5.4: the Enc_structure over version 1, the algorithm, and whose request it is.
fn additional_data(requester: &[u8], sequence: u32) -> Vec<u8> {
    let mut external = vec![0x85, 1, 0x81, ALGORITHM];
    put_octets(&mut external, requester);
    put_octets(&mut external, &partial_iv(sequence));
    put_octets(&mut external, &[]);
    let mut data = b"\x83\x68Encrypt0\x40".to_vec();
    put_octets(&mut data, &external);
    data
}

/// A CBOR byte string of at most 23 bytes.
fn put_octets(to: &mut Vec<u8>, octets: &[u8]) {
    debug_assert!(octets.len() < 24);
    to.push(0x40 | octets.len() as u8);
    to.extend_from_slice(octets);
}

#[cfg(test)]
mod tests;
