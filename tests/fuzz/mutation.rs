//! Mutations of inputs: bits, bytes, lengths, texts and pieces, drawn from a seed alone.

/// Draws for one input.
pub struct Mutator {
    state: u64,
}

/// Numbers that stand at the ends of what types and ranges hold, little endian.
const LENGTHS: [u64; 10] =
    [0, 1, 0x7f, 0x80, 0xffff, 0x7fff_ffff, 0xffff_ffff, 1 << 40, i64::MAX as u64, u64::MAX];

/// Texts that are numbers, signs or words to one reader or another.
const TEXTS: [&str; 24] = [
    "0",
    "-1",
    "-5",
    "1e6",
    "1e160",
    "1e308",
    "-1e308",
    "1e400",
    "nan",
    "inf",
    "\"",
    "'",
    ",",
    "\n",
    "[",
    "]",
    "{",
    "}",
    "=",
    ".",
    "a.",
    "\u{0}",
    "1700000000",
    "18446744073709551616",
];

impl Mutator {
    /// The draws of an input's number under a seed.
    #[must_use]
    pub fn new(seed: u64, number: u64) -> Self {
        let mut mutator = Self { state: seed };
        mutator.state = mutator.next() ^ number;
        mutator
    }

    /// SplitMix64 (Steele, Lea and Flood, OOPSLA 2014).
    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.state ^ (self.state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A whole number below `n`, which is not 0.
    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    /// One of the inputs of a corpus, with one to eight mutations.
    ///
    /// # Panics
    ///
    /// If the corpus is empty.
    #[must_use]
    pub fn mutated(&mut self, corpus: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = corpus[self.below(corpus.len())].clone();
        for _ in 0..=self.below(8) {
            self.mutate(&mut bytes, corpus);
        }
        bytes
    }

    fn mutate(&mut self, bytes: &mut Vec<u8>, corpus: &[Vec<u8>]) {
        if bytes.is_empty() {
            bytes.push(self.below(256) as u8);
            return;
        }
        let at = self.below(bytes.len());
        match self.below(9) {
            0 => bytes[at] ^= 1 << self.below(8),
            1 => bytes[at] = self.below(256) as u8,
            2 => {
                let number = LENGTHS[self.below(LENGTHS.len())].to_le_bytes();
                let length = [1, 2, 4, 8][self.below(4)].min(bytes.len() - at);
                bytes[at..at + length].copy_from_slice(&number[..length]);
            }
            3 => bytes.truncate(at),
            4 => {
                let end = (at + 1 + self.below(64)).min(bytes.len());
                bytes.drain(at..end);
            }
            5 => {
                let end = (at + 1 + self.below(64)).min(bytes.len());
                let piece = bytes[at..end].to_vec();
                let times = [1, 1, 2, 1000][self.below(4)];
                bytes.splice(at..at, piece.repeat(times));
            }
            6 => {
                let text = TEXTS[self.below(TEXTS.len())];
                bytes.splice(at..at, text.bytes());
            }
            7 => {
                // A field of a text is replaced.
                let is_end = |byte: &u8| b",\n= []".contains(byte);
                let from = bytes[..at].iter().rposition(is_end).map_or(0, |end| end + 1);
                let to = bytes[at..].iter().position(is_end).map_or(bytes.len(), |end| at + end);
                let text = TEXTS[self.below(TEXTS.len())];
                bytes.splice(from..to.max(from), text.bytes());
            }
            _ => {
                let other = &corpus[self.below(corpus.len())];
                if !other.is_empty() {
                    let from = self.below(other.len());
                    let to = (from + 1 + self.below(256)).min(other.len());
                    bytes.splice(at..at, other[from..to].iter().copied());
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mutations_follow_from_the_seed_alone() {
        let corpus = [b"a,b\n1,2\n".to_vec(), Vec::new()];
        let run = |seed: u64| -> Vec<Vec<u8>> {
            (0..200).map(|number| Mutator::new(seed, number).mutated(&corpus)).collect()
        };
        assert_eq!(run(3), run(3));
        assert_ne!(run(3), run(4));
    }
}
