//! `radio.pcap`: what the network says was on the air, as it says it.

use super::RecordError;
use super::hashed_file::{Fingerprint, WholeFile};
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The capture.
pub(crate) const FILE: &str = "radio.pcap";

/// The capture being written.
pub(crate) struct Capture {
    path: PathBuf,
    file: WholeFile,
    counter: Counter,
}

impl Capture {
    /// Begins the file.
    pub(crate) fn create(dir: &Path) -> Result<Self, RecordError> {
        let path = dir.join(FILE);
        Ok(Self { file: WholeFile::create(path.clone())?, path, counter: Counter::default() })
    }

    /// Adds the header, or what a step brought.
    pub(crate) fn write(&mut self, bytes: &[u8]) -> Result<(), RecordError> {
        self.counter.read(bytes);
        self.file
            .write_all(bytes)
            .map_err(|source| RecordError::Write { path: self.path.clone(), source })
    }

    /// Ends the file. Returns how many frames it holds.
    pub(crate) fn finish(self) -> Result<(u64, Fingerprint), RecordError> {
        Ok((self.counter.frames(), self.file.finish()?))
    }
}

/// Counts the records of a classic pcap file, however it is cut into pieces.
#[derive(Clone, Debug, Default)]
pub(crate) struct Counter {
    /// What of a header has come so far.
    header: Vec<u8>,
    is_in_file: bool,
    is_big_endian: bool,
    /// Bytes of the record that are still to come.
    left: u64,
    n: u64,
}

impl Counter {
    /// Reads on.
    pub(crate) fn read(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            if self.left != 0 {
                let n = bytes.len().min(usize::try_from(self.left).unwrap_or(usize::MAX));
                bytes = &bytes[n..];
                self.left -= n as u64;
                continue;
            }
            let wanted = if self.is_in_file { RECORD_HEADER } else { FILE_HEADER };
            let n = bytes.len().min(wanted - self.header.len());
            self.header.extend_from_slice(&bytes[..n]);
            bytes = &bytes[n..];
            if self.header.len() < wanted {
                return;
            }
            if self.is_in_file {
                // The third of four numbers: bytes captured.
                let number = [8, 9, 10, 11].map(|i| self.header[i]);
                self.left = u64::from(if self.is_big_endian {
                    u32::from_be_bytes(number)
                } else {
                    u32::from_le_bytes(number)
                });
                self.n += 1;
            } else {
                self.is_big_endian = self.header[0] == 0xa1;
                self.is_in_file = true;
            }
            self.header.clear();
        }
    }

    /// Records whose header was read.
    pub(crate) fn frames(&self) -> u64 {
        self.n
    }

    /// Whether the bytes ended where a record does.
    pub(crate) fn is_whole(&self) -> bool {
        self.is_in_file && self.left == 0 && self.header.is_empty()
    }
}

/// Length of the header of a file, and of a record (draft-ietf-opsawg-pcap, sections 4 and 5).
const FILE_HEADER: usize = 24;
const RECORD_HEADER: usize = 16;

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// The header of a file with nanoseconds, LINKTYPE_IEEE802_15_4_TAP, and a record of so many bytes.
    pub(crate) fn header() -> Vec<u8> {
        let mut bytes = 0xa1b2_3c4du32.to_le_bytes().to_vec();
        bytes.extend([2, 0, 4, 0]);
        for number in [0, 0, 65_535, 283u32] {
            bytes.extend(number.to_le_bytes());
        }
        bytes
    }

    pub(crate) fn record(length: u32) -> Vec<u8> {
        let mut bytes: Vec<u8> =
            [1, 2, length, length].into_iter().flat_map(u32::to_le_bytes).collect();
        bytes.resize(16 + length as usize, 0xa1);
        bytes
    }

    #[test]
    fn frames_are_counted_however_the_file_is_cut() {
        let file = [header(), record(40), record(0), record(133)].concat();
        for piece in [1, 7, 16, 24, 1000] {
            let mut counter = Counter::default();
            file.chunks(piece).for_each(|bytes| counter.read(bytes));
            assert_eq!((counter.frames(), counter.is_whole()), (3, true), "{piece}");
        }
        let mut counter = Counter::default();
        counter.read(&file[..file.len() - 1]);
        assert!(!counter.is_whole());
    }
}
