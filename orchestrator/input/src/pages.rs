//! The headers of a column's pages, read ahead: the library decompresses a page as soon as it has read its header.
//!
//! A header is a struct `PageHeader` of the Parquet format in Thrift's compact protocol.

use parquet::file::metadata::ColumnChunkMetaData;
use std::io::{BufRead, Error, ErrorKind, Read, Result, Seek, SeekFrom};

/// What a byte of the description at the end of a file takes in memory, at most.
const DESCRIPTION: u64 = 32;

/// The memory of the description of the columns, which stands at the end of a file of `length` bytes.
///
/// # Errors
///
/// The end cannot be read, or is not that of a Parquet file.
pub fn memory_of_description<R: Read + Seek>(content: &mut R, length: u64) -> Result<u64> {
    // Four bytes with the length of the description, and a magic number of four.
    let Some(at) = length.checked_sub(8) else { return Ok(0) };
    content.seek(SeekFrom::Start(at))?;
    let (mut stated, mut magic) = ([0; 4], [0; 4]);
    content.read_exact(&mut stated)?;
    content.read_exact(&mut magic)?;
    let described = u64::from(u32::from_le_bytes(stated));
    // Without this check a file that was cut would seem to need gigabytes of memory.
    if ![*b"PAR1", *b"PARE"].contains(&magic) || at < described {
        return Err(Error::new(
            ErrorKind::InvalidData,
            "does not end as a Parquet file does: it is damaged or was cut",
        ));
    }
    Ok(DESCRIPTION * described)
}

/// Refuses a column that does not lie in a file of `length` bytes.
///
/// # Errors
///
/// The column, in words.
pub fn check_place(column: &ColumnChunkMetaData, length: u64) -> std::result::Result<(), String> {
    let start = column.dictionary_page_offset().unwrap_or(column.data_page_offset());
    let place = [start, column.data_page_offset(), column.compressed_size()].map(u64::try_from);
    match place {
        [Ok(start), Ok(_), Ok(size)] if start.saturating_add(size) <= length => Ok(()),
        _ => {
            let message = format!("the column {} lies outside the file", column.column_path());
            Err(format!("{message}: it is damaged"))
        }
    }
}

/// What is needed to read a column (bytes).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PagesMemory {
    /// The largest page, as it is stored and decompressed.
    pub page: u64,
    /// The dictionary.
    pub dictionary: u64,
}

impl PagesMemory {
    /// What both take together (bytes).
    #[must_use]
    pub fn total(self) -> u64 {
        self.page.saturating_add(self.dictionary)
    }
}

/// What a value of a dictionary takes beside its bytes: the library has a reference to each (bytes).
const DICTIONARY_VALUE: u64 = 32;
/// Encodings of text in which a few bytes stand for many: DELTA_LENGTH_BYTE_ARRAY and DELTA_BYTE_ARRAY.
const DELTA_TEXT: [i64; 2] = [6, 7];

/// Reads the headers of all pages within the next `length` bytes. `is_text`: values are bytes.
///
/// # Errors
///
/// They cannot be read, or the column is damaged or encoded so that its memory is not known.
pub fn memory_of<R: BufRead + Seek>(
    content: &mut R,
    length: u64,
    is_text: bool,
) -> Result<PagesMemory> {
    let mut needed = PagesMemory::default();
    let end = content.stream_position()?.saturating_add(length);
    while content.stream_position()? < end {
        let header = PageHeader::read(content)?;
        let stored =
            i64::try_from(header.stored).map_err(|_| damaged("a page ends before it begins"))?;
        if is_text && DELTA_TEXT.contains(&header.encoding) {
            return Err(damaged("its text is encoded by differences, which is not read"));
        }
        if header.is_dictionary {
            if header.unpacked < header.n_values {
                return Err(damaged("a dictionary has more values than bytes: it is damaged"));
            }
            let values = header.n_values.saturating_mul(DICTIONARY_VALUE);
            needed.dictionary += header.unpacked.saturating_add(values);
        }
        needed.page = needed.page.max(header.stored.saturating_add(header.unpacked));
        content.seek_relative(stored)?;
    }
    Ok(needed)
}

/// The part of a header that says what the page takes.
#[derive(Default)]
struct PageHeader {
    unpacked: u64,
    stored: u64,
    n_values: u64,
    encoding: i64,
    is_dictionary: bool,
}

impl PageHeader {
    fn read(content: &mut impl Read) -> Result<Self> {
        let mut header = Self::default();
        read_struct(content, &[], &mut |path, value| {
            let size = u64::try_from(value).map_err(|_| damaged("a page has a size below 0"));
            match *path {
                // Fields of PageHeader, and of its data_page_header (5), dictionary_page_header (7) and data_page_header_v2 (8).
                [2] => header.unpacked = size?,
                [3] => header.stored = size?,
                [kind @ (5 | 7 | 8), 1] => {
                    header.n_values = size?;
                    header.is_dictionary |= kind == 7;
                }
                [5, 2] | [8, 4] => header.encoding = value,
                _ => {}
            }
            Ok(())
        })?;
        Ok(header)
    }
}

fn damaged(message: &str) -> Error {
    Error::new(ErrorKind::InvalidData, message)
}

/// How deeply structs lie within each other.
const NESTING: usize = 8;

/// Takes the numbers of a field and of those that it lies in, the outermost first, and its integer.
type Visit<'a> = dyn FnMut(&[i64], i64) -> Result<()> + 'a;

/// Reads a struct within the fields of `path`.
fn read_struct(content: &mut impl Read, path: &[i64], visit: &mut Visit<'_>) -> Result<()> {
    if NESTING < path.len() {
        return Err(damaged("a header of a page is nested too deeply: it is damaged"));
    }
    let mut path = [path, &[0]].concat();
    let at = path.len() - 1;
    loop {
        let byte = read_byte(content)?;
        let (step, kind) = (byte >> 4, byte & 15);
        if kind == 0 {
            return Ok(());
        }
        path[at] = if step == 0 { zigzag(content)? } else { path[at].saturating_add(step.into()) };
        match kind {
            // Truth values, which have no bytes of their own.
            1 | 2 => {}
            4..=6 => visit(&path, zigzag(content)?)?,
            kind => read_value(content, kind, &path, visit)?,
        }
    }
}

/// Reads a value that is no integer of a struct.
fn read_value(
    content: &mut impl Read,
    kind: u8,
    path: &[i64],
    visit: &mut Visit<'_>,
) -> Result<()> {
    match kind {
        1..=3 => read_byte(content).map(drop),
        4..=6 => varint(content).map(drop),
        7 => pass_over(content, 8),
        8 => {
            let length = varint(content)?;
            pass_over(content, length)
        }
        9 | 10 => {
            let byte = read_byte(content)?;
            let n = if byte >> 4 == 15 { varint(content)? } else { u64::from(byte >> 4) };
            let path = [path, &[0]].concat();
            (0..n).try_for_each(|_| read_value(content, byte & 15, &path, visit))
        }
        12 => read_struct(content, path, visit),
        _ => Err(damaged("a header of a page has a field of no known kind: it is damaged")),
    }
}

fn pass_over(content: &mut impl Read, length: u64) -> Result<()> {
    let passed = std::io::copy(&mut content.take(length), &mut std::io::sink())?;
    if passed == length { Ok(()) } else { Err(ErrorKind::UnexpectedEof.into()) }
}

fn read_byte(content: &mut impl Read) -> Result<u8> {
    let mut byte = [0];
    content.read_exact(&mut byte)?;
    Ok(byte[0])
}

fn varint(content: &mut impl Read) -> Result<u64> {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let byte = read_byte(content)?;
        value |= u64::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return Ok(value);
        }
    }
    Err(damaged("a number in a header of a page does not end: it is damaged"))
}

/// A signed integer, in which the sign is the last bit.
fn zigzag(content: &mut impl Read) -> Result<i64> {
    let value = varint(content)?;
    Ok((value >> 1) as i64 ^ -((value & 1) as i64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    /// Of a dictionary page with 3 values, 400 bytes decompressed, 2 stored; of a data page with 600 and 1.
    const PAGES: [&[u8]; 4] = [
        &[0x15, 4, 0x15, 0xa0, 6, 0x15, 4, 0x4c, 0x15, 6, 0x15, 0, 0, 0],
        b"ab",
        &[0x15, 0, 0x15, 0xb0, 9, 0x15, 2, 0x2c, 0x15, 6, 0x15, 16, 0x15, 6, 0x15, 6, 0, 0],
        b"c",
    ];

    #[test]
    fn a_file_that_was_cut_is_damaged_and_not_large() {
        let whole = [&[0; 8][..], &4_u32.to_le_bytes(), b"PAR1"].concat();
        let needed =
            |content: &[u8]| memory_of_description(&mut Cursor::new(content), content.len() as u64);
        assert_eq!(needed(&whole).unwrap(), 4 * DESCRIPTION);
        let cut = [&[0xff; 8][..], &whole[..8]].concat();
        assert!(needed(&cut).unwrap_err().to_string().contains("damaged or was cut"));
        let long = [&[0; 8][..], &9_u32.to_le_bytes(), b"PAR1"].concat();
        assert!(needed(&long).is_err(), "the description is longer than the file");
    }

    #[test]
    fn the_memory_of_pages_is_known_from_their_headers() {
        let content = PAGES.concat();
        let length = content.len() as u64;
        let needed = memory_of(&mut Cursor::new(content), length, true).unwrap();
        assert_eq!(needed, PagesMemory { page: 601, dictionary: 400 + 3 * 32 });
    }

    #[test]
    fn a_dictionary_of_more_values_than_bytes_is_refused() {
        let mut content = PAGES.concat();
        // One byte, of three values.
        (content[3], content[4]) = (0x82, 0);
        let length = content.len() as u64;
        let error = memory_of(&mut Cursor::new(content), length, true);
        assert!(error.is_err());
    }
}
