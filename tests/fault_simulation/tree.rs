//! Folders, as they are compared.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Copies a folder and all that is in it.
pub(super) fn copy_tree(from: &Path, to: &Path) -> io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let to = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copy_tree(&entry.path(), &to)?;
        } else {
            fs::copy(entry.path(), to)?;
        }
    }
    Ok(())
}

/// Everything below a folder, each with its path in it; `None`: a folder.
fn walk(folder: &Path, under: &str, found: &mut Vec<(String, Option<PathBuf>)>) -> io::Result<()> {
    let mut entries: Vec<_> = fs::read_dir(folder)?.collect::<io::Result<_>>()?;
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        let name = format!("{under}{}", entry.file_name().to_string_lossy());
        if entry.file_type()?.is_dir() {
            found.push((name.clone(), None));
            walk(&entry.path(), &format!("{name}/"), found)?;
        } else {
            found.push((name, Some(entry.path())));
        }
    }
    Ok(())
}

/// The files below a folder.
pub(super) fn read_tree(folder: &Path) -> io::Result<BTreeMap<String, Vec<u8>>> {
    let mut found = Vec::new();
    walk(folder, "", &mut found)?;
    let files = found.into_iter().filter_map(|(name, path)| Some((name, path?)));
    files.map(|(name, path)| Ok((name, fs::read(path)?))).collect()
}

/// The names of all files and folders below a folder.
pub(super) fn names(folder: &Path) -> io::Result<Vec<String>> {
    let mut found = Vec::new();
    walk(folder, "", &mut found)?;
    Ok(found.into_iter().map(|(name, _)| name).collect())
}

/// Folders of unfinished runs, the one that goes furthest last: one with a checkpoint after one without, then by name.
pub(super) fn unfinished(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder.join("runs")).into_iter().flatten().flatten();
    let is_partial = |path: &PathBuf| path.display().to_string().contains(".partial-");
    let mut found: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(is_partial).collect();
    found.sort_by_key(|path| (path.join("checkpoint").exists(), path.clone()));
    found
}
