//! Bounds on what is read. A file that exceeds one is refused with the bound, the value and the limit, before it takes memory or
//! time without end.
//!
//! Each bound stands here once. docs/outputs.md lists them for users.

use std::io::{Error, ErrorKind, Read};

/// Most of something that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bound {
    /// What is bounded, with its unit: `length of a line (bytes)`.
    pub what: &'static str,
    /// The greatest value that is read.
    pub most: u64,
}

/// Size of an experiment file.
pub const CONFIGURATION_BYTES: Bound =
    Bound { what: "size of a configuration (bytes)", most: 64 << 20 };
/// Entries of all lists and tables of a configuration together.
pub const CONFIGURATION_VALUES: Bound =
    Bound { what: "number of values in a configuration", most: 2_000_000 };
/// Keys of one table of a configuration.
pub const TABLE_KEYS: Bound = Bound { what: "number of keys in one table", most: 2000 };
/// How deeply tables and lists of a configuration lie within each other.
pub const NESTING: Bound = Bound { what: "depth of tables and lists", most: 64 };
/// Problems of a configuration that are listed. The others are counted.
pub const LISTED_PROBLEMS: Bound = Bound { what: "number of problems listed", most: 100 };
/// Size of a file that a configuration names, as it is stored.
pub const NAMED_FILE_BYTES: Bound =
    Bound { what: "size of a file that a configuration names (bytes)", most: 512 << 20 };
/// Size of a K7 trace, decompressed.
pub const K7_BYTES: Bound =
    Bound { what: "decompressed size of a K7 trace (bytes)", most: 512 << 20 };
/// Size of a table of measurements, decompressed.
pub const TABLE_BYTES: Bound =
    Bound { what: "decompressed size of a table (bytes)", most: 8 << 30 };
/// Length of a line of a table, line breaks within quotation marks included.
pub const LINE_BYTES: Bound = Bound { what: "length of a line (bytes)", most: 1 << 20 };
/// Columns of a table.
pub const COLUMNS: Bound = Bound { what: "number of columns", most: 2000 };
/// Rows of a table.
pub const ROWS: Bound = Bound { what: "number of rows", most: 100_000_000 };
/// Rows times columns of a table.
pub const CELLS: Bound = Bound { what: "number of rows times columns", most: 500_000_000 };
/// One message or chunk of `run.mcap`, decompressed.
pub const RECORDING_BYTES: Bound =
    Bound { what: "size of a record of run.mcap (bytes)", most: 512 << 20 };
/// Size of a file that describes a result: `summary.json`, `provenance.json`, `config.toml`, `sweep.toml`.
pub const DESCRIPTION_BYTES: Bound =
    Bound { what: "size of a file that describes a result (bytes)", most: 256 << 20 };
/// Size of the state of an interrupted run.
pub const CHECKPOINT_BYTES: Bound = Bound { what: "size of a checkpoint (bytes)", most: 8 << 30 };
/// Size of a formed network that a run starts from.
pub const FORMED_BYTES: Bound = Bound { what: "size of a formed network (bytes)", most: 2 << 30 };
/// Size of the journal of a sweep.
pub const JOURNAL_BYTES: Bound =
    Bound { what: "size of the journal of a sweep (bytes)", most: 8 << 30 };
/// What a command of a batch system prints, or the log of one of its tasks.
pub const COMMAND_BYTES: Bound =
    Bound { what: "output of a command of a batch system (bytes)", most: 256 << 20 };
/// Size of a file that says who writes a result.
pub const LOCK_BYTES: Bound = Bound { what: "size of a lock (bytes)", most: 64 << 10 };
/// Size of a file of certificates, or of a key.
pub const CERTIFICATE_BYTES: Bound =
    Bound { what: "size of a certificate or key (bytes)", most: 16 << 20 };
/// Time of a packet since the network was switched on: what is simulated again.
pub const PACKET_TIME_S: Bound = Bound { what: "time of a packet (s)", most: 604_800 };
/// Time that a packet takes from its source to its destination.
pub const LATENCY_S: Bound = Bound { what: "latency of a packet (s)", most: 3600 };

/// All of them.
pub const ALL: [Bound; 22] = [
    CONFIGURATION_BYTES,
    CONFIGURATION_VALUES,
    TABLE_KEYS,
    NESTING,
    LISTED_PROBLEMS,
    NAMED_FILE_BYTES,
    K7_BYTES,
    TABLE_BYTES,
    LINE_BYTES,
    COLUMNS,
    ROWS,
    CELLS,
    RECORDING_BYTES,
    DESCRIPTION_BYTES,
    CHECKPOINT_BYTES,
    FORMED_BYTES,
    JOURNAL_BYTES,
    COMMAND_BYTES,
    LOCK_BYTES,
    CERTIFICATE_BYTES,
    PACKET_TIME_S,
    LATENCY_S,
];

impl Bound {
    /// Checks a value.
    ///
    /// # Errors
    ///
    /// It is greater than the limit: the bound, the value and the limit in words.
    pub fn check(&self, value: u64) -> Result<(), String> {
        if value <= self.most { Ok(()) } else { Err(self.refusal(&value.to_string())) }
    }

    /// What is said where a value is greater than the limit.
    #[must_use]
    pub fn refusal(&self, value: &str) -> String {
        format!("the {} is {value}; at most {} is read", self.what, self.most)
    }

    /// Reads all of a source.
    ///
    /// # Errors
    ///
    /// It has more bytes than the limit ([`ErrorKind::FileTooLarge`]), or cannot be read.
    pub fn read(&self, source: impl Read) -> Result<Vec<u8>, Error> {
        let mut content = Vec::new();
        source.take(self.most.saturating_add(1)).read_to_end(&mut content)?;
        if content.len() as u64 <= self.most {
            Ok(content)
        } else {
            let refusal = self.refusal(&format!("more than {}", self.most));
            Err(Error::new(ErrorKind::FileTooLarge, refusal))
        }
    }

    /// Reads all of a source as text.
    ///
    /// # Errors
    ///
    /// See [`Self::read`]; and it is not UTF-8 ([`ErrorKind::InvalidData`]).
    pub fn read_text(&self, source: impl Read) -> Result<String, Error> {
        let not_text = |error| Error::new(ErrorKind::InvalidData, error);
        String::from_utf8(self.read(source)?).map_err(not_text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOUR: Bound = Bound { what: "length (bytes)", most: 4 };

    #[test]
    fn a_value_beyond_the_bound_is_refused_with_bound_value_and_limit() {
        assert_eq!(FOUR.check(4), Ok(()));
        assert_eq!(FOUR.check(5).unwrap_err(), "the length (bytes) is 5; at most 4 is read");
    }

    #[test]
    fn a_source_is_read_up_to_the_bound() {
        assert_eq!(FOUR.read(&b"abcd"[..]).unwrap(), b"abcd");
        let error = FOUR.read(std::io::repeat(0)).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::FileTooLarge);
        assert!(error.to_string().contains("is more than 4; at most 4"), "{error}");
        assert_eq!(FOUR.read_text(&b"\xff"[..]).unwrap_err().kind(), ErrorKind::InvalidData);
    }
}
