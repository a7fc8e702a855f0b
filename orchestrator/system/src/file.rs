//! A file that is written.

use super::fault::{Course, Operation, at};
use super::whole;
use std::fs::{Metadata, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// A file that is written, as [`std::fs::File`].
#[derive(Debug)]
pub struct File {
    file: std::fs::File,
    path: PathBuf,
}

impl File {
    /// Makes a file, or empties the one that is there.
    ///
    /// # Errors
    ///
    /// As [`std::fs::File::create`].
    pub fn create(path: &Path) -> io::Result<Self> {
        Self::open(path, OpenOptions::new().write(true).create(true).truncate(true))
    }

    /// Makes a file where there is none.
    ///
    /// # Errors
    ///
    /// As [`std::fs::File::create_new`].
    pub fn create_new(path: &Path) -> io::Result<Self> {
        Self::open(path, OpenOptions::new().read(true).write(true).create_new(true))
    }

    /// Opens a file to read it and to add to it; makes it if there is none.
    ///
    /// # Errors
    ///
    /// As [`OpenOptions::open`].
    pub fn append(path: &Path) -> io::Result<Self> {
        Self::open(path, OpenOptions::new().read(true).append(true).create(true))
    }

    /// Opens a file that is there, to write over its content.
    ///
    /// # Errors
    ///
    /// As [`OpenOptions::open`].
    pub fn overwrite(path: &Path) -> io::Result<Self> {
        Self::open(path, OpenOptions::new().write(true))
    }

    pub(crate) fn open(path: &Path, options: &OpenOptions) -> io::Result<Self> {
        whole(Operation::Create, path)?;
        Ok(Self { file: options.open(path)?, path: path.to_owned() })
    }

    /// Brings content and metadata to the disk.
    ///
    /// # Errors
    ///
    /// As [`std::fs::File::sync_all`].
    pub fn sync_all(&self) -> io::Result<()> {
        whole(Operation::Sync, &self.path)?;
        self.file.sync_all()
    }

    /// Brings the content to the disk.
    ///
    /// # Errors
    ///
    /// As [`std::fs::File::sync_data`].
    pub fn sync_data(&self) -> io::Result<()> {
        whole(Operation::Sync, &self.path)?;
        self.file.sync_data()
    }

    /// Cuts the file off.
    ///
    /// # Errors
    ///
    /// As [`std::fs::File::set_len`].
    pub fn set_len(&self, n_bytes: u64) -> io::Result<()> {
        whole(Operation::SetLength, &self.path)?;
        self.file.set_len(n_bytes)
    }

    /// What the file system knows of the file.
    ///
    /// # Errors
    ///
    /// As [`std::fs::File::metadata`].
    pub fn metadata(&self) -> io::Result<Metadata> {
        self.file.metadata()
    }

    pub(crate) fn inner(&self) -> &std::fs::File {
        &self.file
    }
}

impl Write for File {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match at(Operation::Write, &self.path)? {
            Course::Whole => self.file.write(bytes),
            Course::Half(end) => {
                self.file.write_all(&bytes[..bytes.len() / 2])?;
                end.happen().map(|()| bytes.len())
            }
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Read for File {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.file.read(bytes)
    }
}

impl Seek for File {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}
