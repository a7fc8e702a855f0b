//! Where a message's bytes go, and where they come from.
//!
//! A message says once, in [`Put::put`], which bytes it consists of. Whether they are counted, summed or written is up to
//! the [`Sink`]: lengths need no buffer and cannot differ from what is written.

use super::Malformed;
use std::net::Ipv6Addr;

/// Takes bytes in order.
pub(crate) trait Sink {
    /// The next bytes.
    fn put(&mut self, bytes: &[u8]);

    /// One byte.
    fn put_u8(&mut self, byte: u8) {
        self.put(&[byte]);
    }

    /// Two bytes in network order, as IETF's formats have it.
    fn put_u16(&mut self, word: u16) {
        self.put(&word.to_be_bytes());
    }

    /// Four bytes in network order.
    fn put_u32(&mut self, word: u32) {
        self.put(&word.to_be_bytes());
    }

    /// Two bytes, least significant first, as IEEE's formats have it.
    fn put_u16_le(&mut self, word: u16) {
        self.put(&word.to_le_bytes());
    }

    /// An IPv6 address.
    fn put_ip(&mut self, address: Ipv6Addr) {
        self.put(&address.octets());
    }

    /// A checksum in network order. It is computed only where its value matters.
    fn put_checksum(&mut self, checksum: impl FnOnce() -> u16) {
        self.put_u16(checksum());
    }
}

/// A message that says which bytes it consists of.
pub(crate) trait Put {
    /// Its bytes, in order.
    fn put<S: Sink>(&self, sink: &mut S);
}

/// Counts.
struct Length(usize);

impl Sink for Length {
    fn put(&mut self, bytes: &[u8]) {
        self.0 += bytes.len();
    }

    fn put_checksum(&mut self, _: impl FnOnce() -> u16) {
        self.0 += size_of::<u16>();
    }
}

/// Writes to the beginning of a buffer that is long enough.
struct Buffer<'a> {
    bytes: &'a mut [u8],
    at: usize,
}

impl Sink for Buffer<'_> {
    fn put(&mut self, bytes: &[u8]) {
        self.bytes[self.at..self.at + bytes.len()].copy_from_slice(bytes);
        self.at += bytes.len();
    }
}

/// Sums words as the Internet checksum does (RFC 1071).
#[derive(Default)]
struct Checksum {
    sum: u32,
    odd: bool,
}

impl Sink for Checksum {
    fn put(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            let word = if self.odd { u32::from(byte) } else { u32::from(byte) << 8 };
            self.sum = self.sum.wrapping_add(word);
            self.sum = (self.sum & 0xffff) + (self.sum >> 16);
            self.odd = !self.odd;
        }
    }
}

/// Passes on a range of what it gets.
pub(crate) struct Window<'a, S> {
    sink: &'a mut S,
    skip: usize,
    take: usize,
}

impl<'a, S: Sink> Window<'a, S> {
    /// Leaves out `skip` bytes, then passes on `take`.
    pub(crate) fn new(sink: &'a mut S, skip: usize, take: usize) -> Self {
        Self { sink, skip, take }
    }
}

impl<S: Sink> Sink for Window<'_, S> {
    fn put(&mut self, bytes: &[u8]) {
        let skipped = self.skip.min(bytes.len());
        self.skip -= skipped;
        let taken = self.take.min(bytes.len() - skipped);
        self.take -= taken;
        self.sink.put(&bytes[skipped..skipped + taken]);
    }
}

/// How many bytes a message has.
pub(crate) fn length_of(message: &impl Put) -> usize {
    let mut length = Length(0);
    message.put(&mut length);
    length.0
}

/// Writes a message to the beginning of a buffer; returns how many bytes that took. Panics if they do not fit.
pub(crate) fn write(message: &impl Put, bytes: &mut [u8]) -> usize {
    let mut buffer = Buffer { bytes, at: 0 };
    message.put(&mut buffer);
    buffer.at
}

/// A message's bytes.
pub(crate) fn bytes_of(message: &impl Put) -> Vec<u8> {
    let mut bytes = vec![0; length_of(message)];
    write(message, &mut bytes);
    bytes
}

/// Internet checksum over a message; where its own field lies, the message puts zeros.
pub(crate) fn checksum_of(message: &impl Put) -> u16 {
    let mut checksum = Checksum::default();
    message.put(&mut checksum);
    !(checksum.sum as u16)
}

/// Takes bytes from the front of a message that came in.
#[derive(Clone, Copy)]
pub(crate) struct ByteReader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> ByteReader<'a> {
    /// From the beginning of `bytes`.
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// What is wrong here.
    pub(crate) fn malformed(&self, what: &'static str) -> Malformed {
        Malformed { what, at: self.at }
    }

    /// Whether nothing is left.
    pub(crate) fn is_empty(&self) -> bool {
        self.bytes.len() == self.at
    }

    /// How many bytes are left.
    pub(crate) fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// The next byte, which stays.
    pub(crate) fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    /// The next `n` bytes.
    pub(crate) fn take(&mut self, n: usize) -> Result<&'a [u8], Malformed> {
        let end = self.at.checked_add(n).filter(|&end| end <= self.bytes.len());
        let bytes = &self.bytes[self.at..end.ok_or(self.malformed("it ends too early"))?];
        self.at += n;
        Ok(bytes)
    }

    /// All that is left.
    pub(crate) fn rest(&mut self) -> &'a [u8] {
        let bytes = &self.bytes[self.at..];
        self.at = self.bytes.len();
        bytes
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Malformed> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    /// One byte.
    pub(crate) fn u8(&mut self) -> Result<u8, Malformed> {
        Ok(u8::from_be_bytes(self.array()?))
    }

    /// Two bytes in network order.
    pub(crate) fn u16(&mut self) -> Result<u16, Malformed> {
        Ok(u16::from_be_bytes(self.array()?))
    }

    /// Two bytes, least significant first.
    pub(crate) fn u16_le(&mut self) -> Result<u16, Malformed> {
        Ok(u16::from_le_bytes(self.array()?))
    }

    /// Eight bytes in network order.
    pub(crate) fn u64(&mut self) -> Result<u64, Malformed> {
        Ok(u64::from_be_bytes(self.array()?))
    }

    /// Eight bytes, least significant first.
    pub(crate) fn u64_le(&mut self) -> Result<u64, Malformed> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    /// An IPv6 address.
    pub(crate) fn ip(&mut self) -> Result<Ipv6Addr, Malformed> {
        Ok(Ipv6Addr::from(self.array::<16>()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Bytes(&'static [u8]);

    impl Put for Bytes {
        fn put<S: Sink>(&self, sink: &mut S) {
            for byte in self.0 {
                sink.put_u8(*byte);
            }
        }
    }

    #[test]
    fn rfc1071_3_the_example_sums_to_ddf2() {
        let words = Bytes(&[0x00, 0x01, 0xf2, 0x03, 0xf4, 0xf5, 0xf6, 0xf7]);
        assert_eq!(checksum_of(&words), !0xddf2);
    }

    #[test]
    fn a_window_passes_on_its_range_only() {
        struct Slice;
        impl Put for Slice {
            fn put<S: Sink>(&self, sink: &mut S) {
                let mut window = Window::new(sink, 2, 4);
                for part in [&[0_u8][..], &[1, 2, 3], &[4], &[5, 6, 7]] {
                    window.put(part);
                }
            }
        }
        assert_eq!(bytes_of(&Slice), [2, 3, 4, 5]);
    }
}
