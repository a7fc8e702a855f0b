//! What a file holds, by its first lines: TOML or a table.

use std::fs::File;
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::Path;

/// What a file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// TOML: a configuration or a mapping.
    Toml,
    /// A table: CSV, a compressed file or Parquet.
    Table,
}

/// Endings of the names of tables.
const TABLE_ENDINGS: [&str; 4] = [".csv", ".csv.gz", ".tsv", ".parquet"];
/// First bytes of gzipped files, and of Parquet.
const MAGIC: [&[u8]; 2] = [b"\x1f\x8b", b"PAR1"];
/// Letters that separate the fields of a table.
const DELIMITERS: [char; 4] = [',', ';', '\t', '|'];
/// Bytes of a file that are looked at.
const HEAD_BYTES: u64 = 64 << 10;

impl FileKind {
    /// What the file at a path holds. `None`: neither, or it cannot be read.
    #[must_use]
    pub fn of_file(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_string_lossy().to_lowercase();
        let head = BufReader::new(File::open(path).ok()?.take(HEAD_BYTES));
        let lines = head.split(b'\n').map_while(Result::ok);
        Self::of_lines(&name, lines)
    }

    /// What a file of this name in small letters holds.
    fn of_lines(name: &str, lines: impl Iterator<Item = Vec<u8>>) -> Option<Self> {
        let by_name = TABLE_ENDINGS.iter().any(|ending| name.ends_with(ending));
        let by_name = by_name.then_some(Self::Table);
        for line in lines {
            if MAGIC.iter().any(|magic| line.starts_with(magic)) {
                return Some(Self::Table);
            }
            let line = String::from_utf8_lossy(&line);
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            return match () {
                () if is_toml(line) => Some(Self::Toml),
                () if is_header(line) => Some(Self::Table),
                () => by_name,
            };
        }
        by_name
    }
}

/// Whether TOML may begin with a line: with a table, or a key and a value.
fn is_toml(line: &str) -> bool {
    let is_of_key = |letter: char| letter.is_alphanumeric() || "_-.\"' ".contains(letter);
    let key = line.split_once('=').map(|(key, _)| key);
    line.starts_with('[') || key.is_some_and(|key| !key.is_empty() && key.chars().all(is_of_key))
}

/// Whether a line separates several fields.
fn is_header(line: &str) -> bool {
    DELIMITERS.iter().any(|&delimiter| 1 < line.split(delimiter).count())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kind(name: &str, content: &[u8]) -> Option<FileKind> {
        FileKind::of_lines(name, content.split(|&byte| byte == b'\n').map(<[u8]>::to_vec))
    }

    #[test]
    fn a_table_is_told_by_its_header_its_first_bytes_or_its_name() {
        for header in ["a,b\n1,2\n", "a;b\n1;2\n", "a\tb c\n", "Zeit;Wert", "# note\n\n1,2"] {
            assert_eq!(kind("log.txt", header.as_bytes()), Some(FileKind::Table), "{header}");
        }
        assert_eq!(kind("log.txt", b"\x1f\x8b\x08"), Some(FileKind::Table));
        assert_eq!(kind("log.txt", b"PAR1\xff"), Some(FileKind::Table));
        assert_eq!(kind("log.csv", b"a\n1\n"), Some(FileKind::Table));
        assert_eq!(kind("log.csv", b""), Some(FileKind::Table));
        assert_eq!(kind("log.txt", b"some prose"), None);
    }

    #[test]
    fn toml_is_toml_whatever_its_name_and_broken_toml_is_no_table() {
        for config in
            ["[netsim.phy]\nexponent = 2.6\n", "# x, y\n\nagents = [1, 2\n", "a.\"b c\" = 1"]
        {
            assert_eq!(kind("model.csv", config.as_bytes()), Some(FileKind::Toml), "{config}");
        }
        assert_eq!(kind("model.toml", b"# nothing, yet\n"), None);
        assert_eq!(kind("model.toml", b"agents\n"), None);
    }
}
