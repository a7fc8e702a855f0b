//! Files and folders that are made under another name first, and get their own once they are whole.
//!
//! A draft stands beside its place, as `.NAME.draft-PID`, and is locked as long as the process lives. The next draft of the same
//! name removes those that are not locked: of processes that were killed.

use super::{File, create_dir, hard_link, remove_dir_all, remove_file, rename};
use std::fs::{self, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

/// A file that is being made. Removed when dropped.
#[derive(Debug)]
pub struct Draft {
    file: File,
    path: PathBuf,
    is_placed: bool,
}

impl Draft {
    /// Begins a file that is to be `place`. Anybody may read it, as far as the user's umask allows.
    ///
    /// # Errors
    ///
    /// The folder cannot be written.
    pub fn beside(place: &Path) -> io::Result<Self> {
        let name = place.file_name().unwrap_or_default().to_string_lossy();
        let make = |path: &Path| {
            File::open(path, OpenOptions::new().read(true).write(true).create_new(true))
        };
        let (file, path) = begin(folder_of(place), &name, make, File::inner)?;
        Ok(Self { file, path, is_placed: false })
    }

    /// Where it stands now.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Gives it its name. What stands there is replaced.
    ///
    /// # Errors
    ///
    /// As [`std::fs::rename`].
    pub fn replace(mut self, place: &Path) -> io::Result<()> {
        self.file.sync_all()?;
        rename(&self.path, place)?;
        self.is_placed = true;
        Ok(())
    }

    /// Gives it its name, unless something stands there.
    ///
    /// # Errors
    ///
    /// [`ErrorKind::AlreadyExists`]; as [`std::fs::rename`].
    pub fn place(self, place: &Path) -> io::Result<()> {
        self.file.sync_all()?;
        match hard_link(&self.path, place) {
            // A file system without links. Nothing stands there, as far as can be seen.
            Err(error) if error.kind() != ErrorKind::AlreadyExists => {
                if place.try_exists()? {
                    return Err(ErrorKind::AlreadyExists.into());
                }
                self.replace(place)
            }
            // Dropped, it loses its other name.
            linked => linked,
        }
    }
}

impl Write for Draft {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        if !self.is_placed {
            let _ = remove_file(&self.path);
        }
    }
}

/// A folder that is being made. Removed when dropped.
#[derive(Debug)]
pub struct DraftFolder {
    /// Locked.
    _folder: fs::File,
    path: PathBuf,
    is_placed: bool,
}

impl DraftFolder {
    /// Begins a folder that is to be `place`.
    ///
    /// # Errors
    ///
    /// The folder that it stands in cannot be written.
    pub fn beside(place: &Path) -> io::Result<Self> {
        let name = place.file_name().unwrap_or_default().to_string_lossy();
        Self::begin(folder_of(place), &name, create_dir)
    }

    fn begin(
        folder: &Path,
        name: &str,
        make: impl Fn(&Path) -> io::Result<()>,
    ) -> io::Result<Self> {
        let open = |path: &Path| {
            make(path)?;
            fs::File::open(path)
        };
        let (opened, path) = begin(folder, name, open, |folder| folder)?;
        Ok(Self { _folder: opened, path, is_placed: false })
    }

    /// Where it stands now.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Gives it its name.
    ///
    /// # Errors
    ///
    /// As [`std::fs::rename`].
    pub fn place(mut self, place: &Path) -> io::Result<()> {
        rename(&self.path, place)?;
        self.is_placed = true;
        Ok(())
    }
}

impl Drop for DraftFolder {
    fn drop(&mut self) {
        if !self.is_placed {
            let _ = remove_dir_all(&self.path);
        }
    }
}

/// Makes a draft under a name that is free and locks it. Removes drafts of the same name whose process was killed.
fn begin<T>(
    folder: &Path,
    name: &str,
    make: impl Fn(&Path) -> io::Result<T>,
    file_of: impl Fn(&T) -> &fs::File,
) -> io::Result<(T, PathBuf)> {
    let prefix = format!(".{name}.draft-");
    remove_abandoned(folder, &prefix);
    let process = std::process::id();
    for attempt in 0u32.. {
        let suffix = if attempt == 0 { String::new() } else { format!("-{attempt}") };
        let path = folder.join(format!("{prefix}{process}{suffix}"));
        match make(&path) {
            Ok(made) => {
                // On a file system without locks it is used without one.
                let is_taken =
                    matches!(file_of(&made).try_lock(), Err(fs::TryLockError::WouldBlock));
                if !is_taken && stands_at(file_of(&made), &path) {
                    return Ok((made, path));
                }
                // Another process takes it for abandoned, and removes it.
            }
            Err(error) if error.kind() == ErrorKind::AlreadyExists && attempt < 1000 => {}
            Err(error) => return Err(error),
        }
    }
    unreachable!("the last attempt returns")
}

/// Whether an open file or folder still stands at `path`.
fn stands_at(file: &fs::File, path: &Path) -> bool {
    let number = |metadata: io::Result<fs::Metadata>| metadata.ok().map(|m| (m.dev(), m.ino()));
    number(file.metadata()).is_some_and(|it| number(fs::metadata(path)) == Some(it))
}

/// Removes drafts whose process does not live. That one cannot be removed is no reason to do without a new one.
fn remove_abandoned(folder: &Path, prefix: &str) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if !entry.file_name().to_string_lossy().starts_with(prefix) {
            continue;
        }
        let path = entry.path();
        // Open until it is removed, so that nobody else removes it at the same time.
        let Ok(file) = fs::File::open(&path) else { continue };
        if file.try_lock().is_ok() && stands_at(&file, &path) {
            let _ = if path.is_dir() { remove_dir_all(&path) } else { remove_file(&path) };
        }
    }
}

fn folder_of(place: &Path) -> &Path {
    place.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_draft_gets_its_name_or_is_gone() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("a.csv");
        let mut draft = Draft::beside(&place).unwrap();
        draft.write_all(b"1").unwrap();
        draft.place(&place).unwrap();
        let mut draft = Draft::beside(&place).unwrap();
        draft.write_all(b"2").unwrap();
        assert_eq!(draft.place(&place).unwrap_err().kind(), ErrorKind::AlreadyExists);
        assert_eq!(fs::read(&place).unwrap(), b"1");
        let mut draft = Draft::beside(&place).unwrap();
        draft.write_all(b"2").unwrap();
        draft.replace(&place).unwrap();
        assert_eq!(fs::read(&place).unwrap(), b"2");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_draft_removes_those_of_processes_that_were_killed() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("bag");
        let left = folder.path().join(".bag.draft-1");
        fs::create_dir(&left).unwrap();
        fs::write(left.join("bag_0.mcap"), "half").unwrap();
        let first = DraftFolder::beside(&place).unwrap();
        assert!(!left.exists());
        let second = DraftFolder::beside(&place).unwrap();
        assert!(first.path().exists() && first.path() != second.path());
        second.place(&place).unwrap();
        drop(first);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
