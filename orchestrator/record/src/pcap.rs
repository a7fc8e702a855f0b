//! `radio.pcap`: what the network says was on the air, as it says it.

use super::RecordError;
use super::hashed_file::WholeFile;
use input::fingerprint::Fingerprint;
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read as _, Write as _};
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

    /// Adds what an earlier capture of the same run holds, after its header, which was written already.
    pub(crate) fn copy(
        &mut self,
        part: &CapturePart,
        header_bytes: usize,
    ) -> Result<(), RecordError> {
        let read = |source| RecordError::Read { path: part.path.clone(), source };
        let mut file = File::open(&part.path).map_err(read)?;
        std::io::copy(&mut (&mut file).take(header_bytes as u64), &mut std::io::sink())
            .map_err(read)?;
        let mut left = part.n_bytes.saturating_sub(header_bytes as u64);
        let mut block = vec![0; 1 << 16];
        while left != 0 {
            let n = block.len().min(usize::try_from(left).unwrap_or(usize::MAX));
            file.read_exact(&mut block[..n]).map_err(read)?;
            self.write(&block[..n])?;
            left -= n as u64;
        }
        Ok(())
    }

    /// Makes sure that all of it is on the disk. Returns its length so far (bytes).
    pub(crate) fn sync(&mut self) -> Result<u64, RecordError> {
        self.file.sync()
    }

    /// Ends the file. Returns how many frames it holds.
    pub(crate) fn finish(self) -> Result<(u64, Fingerprint), RecordError> {
        Ok((self.counter.frames(), self.file.finish()?))
    }
}

/// The beginning of the capture of an unfinished run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CapturePart {
    /// The file.
    pub(crate) path: PathBuf,
    /// How much of it (bytes), its header included.
    pub(crate) n_bytes: u64,
}

/// How much of a capture are whole frames up to `time_ns` (bytes). Times in captures are simulated, with nanoseconds.
pub(crate) fn length_until(path: &Path, time_ns: u64) -> std::io::Result<u64> {
    let mut file = BufReader::new(File::open(path)?);
    let mut header = [0; FILE_HEADER];
    let mut length = 0;
    let whole = |read: std::io::Result<()>| match read {
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        other => other.map(|()| true),
    };
    if !whole(file.read_exact(&mut header))? {
        return Ok(0);
    }
    length += FILE_HEADER as u64;
    loop {
        let mut record = [0; RECORD_HEADER];
        if !whole(file.read_exact(&mut record))? {
            return Ok(length);
        }
        let [s, ns, n_bytes, _] = [0, 4, 8, 12]
            .map(|at| u64::from(u32::from_le_bytes([0, 1, 2, 3].map(|i| record[at + i]))));
        let read = std::io::copy(&mut (&mut file).take(n_bytes), &mut std::io::sink())?;
        if read < n_bytes || time_ns < s * 1_000_000_000 + ns {
            return Ok(length);
        }
        length += RECORD_HEADER as u64 + n_bytes;
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
