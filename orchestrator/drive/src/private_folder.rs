//! Temporary folders that only this user may enter, for sockets and for files of a while.
//!
//! A folder is removed when its owner drops it. The owner holds a lock on a file in it, which the system releases if the program is
//! killed: the next program that makes such a folder then removes it.

use nix::fcntl::OFlag;
use std::fs::{DirBuilder, File, OpenOptions, Permissions};
use std::io::{Error, ErrorKind, Result};
use std::os::unix::fs::{
    DirBuilderExt as _, MetadataExt as _, OpenOptionsExt as _, PermissionsExt as _,
};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// How names of such folders begin.
const PREFIX: &str = "murmuration-";
/// The file that is locked.
const LOCK: &str = "lock";
/// The file before it is locked.
const UNLOCKED: &str = "lock.new";
/// The folder in it that is used.
const INSIDE: &str = "f";
/// Only this user may enter either.
const MODE: u32 = 0o700;

/// A temporary folder that only this user may enter.
#[derive(Debug)]
pub struct PrivateFolder {
    _folder: TempDir,
    inside: PathBuf,
    _lock: File,
}

impl PrivateFolder {
    /// A folder for sockets, whose path is short.
    ///
    /// # Errors
    ///
    /// There is no place for it.
    pub fn for_sockets() -> Result<Self> {
        /// A socket's path, with the names of both folders and of the socket, has fewer than 108 bytes.
        const LONGEST: usize = 70;
        let runtime = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
        let mut places: Vec<PathBuf> = runtime.into_iter().collect();
        places.extend([std::env::temp_dir(), PathBuf::from("/tmp")]);
        let mut last = Error::from(ErrorKind::NotFound);
        let is_usable =
            |place: &&PathBuf| place.is_absolute() && place.as_os_str().len() <= LONGEST;
        for place in places.iter().filter(is_usable) {
            match Self::in_place(place) {
                Ok(folder) => return Ok(folder),
                Err(error) => last = error,
            }
        }
        Err(last)
    }

    /// A folder for files.
    ///
    /// # Errors
    ///
    /// The system's folder for temporary files cannot be written.
    pub fn for_files() -> Result<Self> {
        Self::in_place(&std::env::temp_dir())
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.inside
    }

    fn in_place(place: &Path) -> Result<Self> {
        let mut builder = tempfile::Builder::new();
        builder.prefix(PREFIX).permissions(Permissions::from_mode(MODE));
        let folder = builder.tempdir_in(place)?;
        let unlocked = folder.path().join(UNLOCKED);
        let lock = File::create_new(&unlocked)?;
        lock.lock()?;
        // It has its name only once it is locked, so that nobody takes it for left behind.
        std::fs::rename(unlocked, folder.path().join(LOCK))?;
        let inside = folder.path().join(INSIDE);
        DirBuilder::new().mode(MODE).create(&inside)?;
        sweep(place, lock.metadata()?.uid());
        Ok(Self { _folder: folder, inside, _lock: lock })
    }
}

/// Removes the folders that killed programs of a user left in a place. One that cannot be removed stays.
fn sweep(place: &Path, user: u32) {
    let Ok(entries) = std::fs::read_dir(place) else { return };
    let ours = entries
        .flatten()
        .filter(|entry| entry.file_name().to_str().is_some_and(|name| name.starts_with(PREFIX)));
    for path in ours.map(|entry| entry.path()) {
        if let Some(_lock) = lock_of_left_behind(&path, user) {
            let _ = std::fs::remove_dir_all(&path);
        }
    }
}

/// The lock of a folder whose owner has ended. `None`: it is in use, or no such folder of the user.
fn lock_of_left_behind(folder: &Path, user: u32) -> Option<File> {
    let about = std::fs::symlink_metadata(folder).ok()?;
    if !about.is_dir() || about.uid() != user {
        return None;
    }
    let flags = OFlag::O_NOFOLLOW | OFlag::O_NONBLOCK;
    let mut options = OpenOptions::new();
    let lock = options.read(true).custom_flags(flags.bits()).open(folder.join(LOCK)).ok()?;
    let about = lock.metadata().ok()?;
    let is_left = about.is_file() && about.uid() == user && lock.try_lock().is_ok();
    is_left.then_some(lock)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_killed_program_left_is_removed_by_the_next_and_nothing_else() {
        let place = tempfile::tempdir().unwrap();
        let make = |name: &str| {
            let folder = place.path().join(name);
            std::fs::create_dir(&folder).unwrap();
            folder
        };
        let in_use = PrivateFolder::in_place(place.path()).unwrap();
        for folder in [in_use._folder.path(), in_use.path()] {
            assert_eq!(folder.metadata().unwrap().mode() & 0o777, MODE);
        }
        // As one is left by a program that was killed: the system has released its lock.
        let left = make("murmuration-left");
        std::fs::write(left.join(LOCK), "").unwrap();
        std::fs::write(left.join("socket"), "").unwrap();
        std::os::unix::fs::symlink(in_use.path(), left.join("link")).unwrap();
        let without_lock = make("murmuration-other");
        let of_others = make("other-left");
        std::fs::write(of_others.join(LOCK), "").unwrap();
        let elsewhere = make("elsewhere");
        std::fs::write(elsewhere.join(LOCK), "").unwrap();
        let link = place.path().join("murmuration-link");
        std::os::unix::fs::symlink(&elsewhere, &link).unwrap();
        let linked_lock = make("murmuration-linked");
        std::os::unix::fs::symlink(elsewhere.join(LOCK), linked_lock.join(LOCK)).unwrap();

        let next = PrivateFolder::in_place(place.path()).unwrap();
        assert!(!left.exists());
        for stays in [&*without_lock, &of_others, &elsewhere, &link, &linked_lock, in_use.path()] {
            assert!(stays.exists(), "{}", stays.display());
        }
        assert!(elsewhere.join(LOCK).exists() && in_use._folder.path().join(LOCK).exists());
        let path = next._folder.path().to_owned();
        drop(next);
        assert!(!path.exists());
    }
}
