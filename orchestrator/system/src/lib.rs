//! All changes that the orchestrator makes to files and folders, and its readings of the wall clock.
//!
//! The functions do what those of [`std::fs`] with the same names do. Each asks [`fault`] first, so that a test can let any of
//! them fail, or kill the process there; without a schedule of faults this costs one comparison. `tests/checks` finds sources that
//! bypass this crate.

mod draft;
pub mod fault;
mod file;

pub use draft::{Draft, DraftFolder};
pub use fault::point;
pub use file::File;

use fault::{Course, Operation, at};
use std::fs;
use std::io;
use std::path::Path;
use std::time::SystemTime;

/// Writes a file with this content.
///
/// # Errors
///
/// As [`std::fs::write`].
pub fn write(path: &Path, content: impl AsRef<[u8]>) -> io::Result<()> {
    use io::Write as _;
    File::create(path)?.write_all(content.as_ref())
}

/// Copies the content of a file.
///
/// # Errors
///
/// As [`std::fs::copy`].
pub fn copy(from: &Path, to: &Path) -> io::Result<u64> {
    whole(Operation::Create, to)?;
    fs::copy(from, to)
}

/// Renames a file or folder.
///
/// # Errors
///
/// As [`std::fs::rename`].
pub fn rename(from: &Path, to: &Path) -> io::Result<()> {
    whole(Operation::Rename, to)?;
    fs::rename(from, to)
}

/// Gives a file a second name.
///
/// # Errors
///
/// As [`std::fs::hard_link`].
pub fn hard_link(from: &Path, to: &Path) -> io::Result<()> {
    whole(Operation::Link, to)?;
    fs::hard_link(from, to)
}

/// Makes a folder.
///
/// # Errors
///
/// As [`std::fs::create_dir`].
pub fn create_dir(path: &Path) -> io::Result<()> {
    whole(Operation::MakeFolder, path)?;
    fs::create_dir(path)
}

/// Makes a folder, and those that it is in.
///
/// # Errors
///
/// As [`std::fs::create_dir_all`].
pub fn create_dir_all(path: &Path) -> io::Result<()> {
    if !path.is_dir() {
        whole(Operation::MakeFolder, path)?;
    }
    fs::create_dir_all(path)
}

/// Removes a file.
///
/// # Errors
///
/// As [`std::fs::remove_file`].
pub fn remove_file(path: &Path) -> io::Result<()> {
    whole(Operation::Remove, path)?;
    fs::remove_file(path)
}

/// Removes an empty folder.
///
/// # Errors
///
/// As [`std::fs::remove_dir`].
pub fn remove_dir(path: &Path) -> io::Result<()> {
    whole(Operation::Remove, path)?;
    fs::remove_dir(path)
}

/// Removes a folder with all that is in it.
///
/// # Errors
///
/// As [`std::fs::remove_dir_all`].
pub fn remove_dir_all(path: &Path) -> io::Result<()> {
    if fault::is_scheduled() {
        // In steps, so that the process can be killed between any two.
        let mut entries: Vec<_> = fs::read_dir(path)?.collect::<io::Result<_>>()?;
        entries.sort_by_key(fs::DirEntry::file_name);
        for entry in entries {
            if entry.file_type()?.is_dir() {
                remove_dir_all(&entry.path())?;
            } else {
                remove_file(&entry.path())?;
            }
        }
        return remove_dir(path);
    }
    fs::remove_dir_all(path)
}

/// Brings a file, or the names in a folder, to the disk.
///
/// # Errors
///
/// As [`std::fs::File::sync_all`].
pub fn sync(path: &Path) -> io::Result<()> {
    whole(Operation::Sync, path)?;
    fs::File::open(path)?.sync_all()
}

/// A file without a name, which is gone when it is closed.
///
/// # Errors
///
/// There is no room for it.
pub fn unnamed_file() -> io::Result<fs::File> {
    whole(Operation::Create, Path::new("unnamed"))?;
    tempfile::tempfile()
}

/// The time now.
#[must_use]
pub fn now() -> SystemTime {
    #[expect(
        clippy::disallowed_methods,
        reason = "when a program runs is no part of what it simulates"
    )]
    let now = SystemTime::now();
    fault::shifted(now)
}

/// Lets a scheduled fault happen at an operation that is done or not done.
fn whole(operation: Operation, path: &Path) -> io::Result<()> {
    match at(operation, path)? {
        Course::Whole => Ok(()),
        Course::Half(end) => end.happen(),
    }
}
