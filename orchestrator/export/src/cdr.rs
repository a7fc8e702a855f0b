//! Messages in CDR, the encoding of DDS and ROS 2 (OMG DDS-XTypes 1.3, § 7.4.1, plain CDR version 1, little-endian): every number
//! stands at a multiple of its size, counted from the end of the four bytes of the encapsulation.

/// A message being written.
pub(super) struct Cdr {
    bytes: Vec<u8>,
}

/// Length of the encapsulation (bytes).
const HEADER: usize = 4;

impl Cdr {
    /// Begins a message.
    pub(super) fn new() -> Self {
        Self { bytes: vec![0, 1, 0, 0] }
    }

    /// The message.
    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    fn align(&mut self, size: usize) {
        let length = self.bytes.len() - HEADER;
        self.bytes.resize(HEADER + length.next_multiple_of(size), 0);
    }

    /// Adds an unsigned number of 32 bits, which a length is, too.
    pub(super) fn u32(&mut self, value: u32) -> &mut Self {
        self.align(4);
        self.bytes.extend_from_slice(&value.to_le_bytes());
        self
    }

    /// Adds numbers of double precision.
    pub(super) fn f64s(&mut self, values: &[f64]) -> &mut Self {
        for value in values {
            self.align(8);
            self.bytes.extend_from_slice(&value.to_le_bytes());
        }
        self
    }

    /// Adds a text: its length with the zero that ends it, then both.
    pub(super) fn text(&mut self, text: &str) -> &mut Self {
        self.u32(text.len() as u32 + 1);
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.push(0);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stand_at_multiples_of_their_size() {
        let mut message = Cdr::new();
        message.text("ab").u32(7).f64s(&[1.0]);
        let mut expected = vec![0, 1, 0, 0, 3, 0, 0, 0, b'a', b'b', 0, 0, 7, 0, 0, 0];
        // The number begins 12 bytes after the encapsulation: 4 of padding follow.
        expected.extend([0; 4]);
        expected.extend(1f64.to_le_bytes());
        assert_eq!(message.bytes(), expected);
    }
}
