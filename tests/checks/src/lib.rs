//! Reads the sources and pages of the repository, for tests of rules that no compiler checks.
//!
//! The crate depends on nothing of the workspace, so that its tests run within seconds of a fresh clone.

mod product_code;

pub use product_code::product_code;
use std::path::{Path, PathBuf};

/// The folder of the repository.
///
/// # Panics
///
/// If this crate is no longer two folders below it.
#[must_use]
pub fn repository() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2);
    root.expect("tests/checks/ is in the repository").to_owned()
}

/// The Rust sources below a folder, sorted by path. Neither build output below an example nor code that
/// `proto/generate` has written is a source.
///
/// # Panics
///
/// If a folder cannot be read.
#[must_use]
pub fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder of the repository") {
            let path = entry.expect("an entry of a folder").path();
            if path.is_dir() {
                if !path.ends_with("target") && !path.ends_with("generated") {
                    folders.push(path);
                }
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}
