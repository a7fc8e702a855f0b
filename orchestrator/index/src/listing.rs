//! The folders and files below a folder that may be results.

use crate::unfinished;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Folders are looked into so many levels below the first one.
const MOST_DEPTH: usize = 4;
/// Results at most.
pub(crate) const MOST_RESULTS: usize = 10_000;
/// Entries of folders that are looked at, at most.
const MOST_ENTRIES: usize = 200_000;
/// A JSON file of more bytes is not looked into, whether it is an answer.
const MOST_ANSWER_BYTES: u64 = 16 << 20;

/// What a folder or a file may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A folder with a summary: of a run or of a sweep. Or one with other files of a run, whose summary is gone.
    Finished,
    /// A folder that a run or a sweep fills, or has left when it was killed.
    Unfinished,
    /// A JSON file.
    Answer,
}

/// Whether a file is still the one that was read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Stamp([Option<(SystemTime, u64)>; N_STAMPED]);

/// Files of a result that are looked at again and again.
const N_STAMPED: usize = 6;

impl Stamp {
    /// Of some files, which may be missing.
    pub(crate) fn of<'a>(files: impl IntoIterator<Item = &'a Path>) -> Self {
        let mut stamp = Self::default();
        for (own, file) in stamp.0.iter_mut().zip(files) {
            let metadata = fs::symlink_metadata(file).ok();
            *own = metadata.and_then(|file| Some((file.modified().ok()?, file.len())));
        }
        stamp
    }

    /// When the first file that is there was changed (Unix time, s).
    pub(crate) fn changed_unix_s(self) -> Option<f64> {
        let (changed, _) = self.0.into_iter().flatten().next()?;
        Some(changed.duration_since(SystemTime::UNIX_EPOCH).ok()?.as_secs_f64())
    }
}

/// What may be a result.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Found {
    /// Where it is.
    pub(crate) path: PathBuf,
    /// The same from the first folder on, with `/` between its parts.
    pub(crate) place: String,
    pub(crate) kind: Kind,
    pub(crate) stamp: Stamp,
}

/// What a folder holds.
#[derive(Debug, Default)]
pub(crate) struct Listing {
    /// By place.
    pub(crate) found: Vec<Found>,
    /// There is more than is listed.
    pub(crate) is_cut: bool,
    n_entries: usize,
}

impl Listing {
    /// Looks through a folder. Links are not followed, so nothing outside of it is found.
    pub(crate) fn of(folder: &Path) -> Self {
        let mut listing = Self::default();
        if is_file(&folder.join("summary.json")) || is_sweep(folder) || is_without_summary(folder) {
            let name = folder.file_name().map_or_else(|| ".".into(), |name| name.to_string_lossy());
            listing.folder(folder, &name, MOST_DEPTH);
        } else {
            listing.below(folder, "", 0);
        }
        listing.found.sort_by(|a, b| a.place.cmp(&b.place));
        listing
    }

    fn below(&mut self, folder: &Path, place: &str, depth: usize) {
        let mut entries = Vec::new();
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            self.n_entries += 1;
            if MOST_ENTRIES < self.n_entries {
                self.is_cut = true;
                break;
            }
            if let (Ok(kind), Ok(name)) = (entry.file_type(), entry.file_name().into_string()) {
                entries.push((name, kind));
            }
        }
        // What is cut off does not depend on the order of the file system.
        entries.sort_by(|a, b| a.0.cmp(&b.0));
        for (name, kind) in entries {
            let path = folder.join(&name);
            let place = if place.is_empty() { name.clone() } else { format!("{place}/{name}") };
            if kind.is_dir() {
                if unfinished::name_of_partial(&name).is_some() {
                    self.add(path, place, Kind::Unfinished);
                } else if !name.starts_with('.') {
                    self.folder(&path, &place, depth + 1);
                }
            } else if kind.is_file() && name.ends_with(".json") && !name.starts_with('.') {
                let length = fs::symlink_metadata(&path).map_or(u64::MAX, |file| file.len());
                if length <= MOST_ANSWER_BYTES {
                    self.add(path, place, Kind::Answer);
                }
            }
        }
    }

    fn folder(&mut self, path: &Path, place: &str, depth: usize) {
        if is_file(&path.join("summary.json")) || is_without_summary(path) {
            self.add(path.to_owned(), place.to_owned(), Kind::Finished);
        } else if is_sweep(path) {
            self.add(path.to_owned(), place.to_owned(), Kind::Unfinished);
        } else if depth < MOST_DEPTH {
            return self.below(path, place, depth);
        }
        // The runs that a sweep keeps.
        let runs = path.join("runs");
        if is_sweep(path) && fs::symlink_metadata(&runs).is_ok_and(|runs| runs.is_dir()) {
            self.below(&runs, &format!("{place}/runs"), MOST_DEPTH - 1);
        }
    }

    fn add(&mut self, path: PathBuf, place: String, kind: Kind) {
        if self.found.len() == MOST_RESULTS {
            self.is_cut = true;
            return;
        }
        let stamped: &[&str] = match kind {
            Kind::Finished => &FINISHED_FILES,
            Kind::Unfinished => &["run.log", "trials.jsonl", "run.mcap"],
            Kind::Answer => &[""],
        };
        let files: Vec<PathBuf> = stamped
            .iter()
            .map(|name| if name.is_empty() { path.clone() } else { path.join(name) })
            .collect();
        let stamp = Stamp::of(files.iter().map(PathBuf::as_path));
        self.found.push(Found { path, place, kind, stamp });
    }
}

/// Whether a file stands there itself, and no link to one.
pub(crate) fn is_file(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok_and(|metadata| metadata.is_file())
}

/// The files of a finished result that are watched: what the table and the pages show is in them.
const FINISHED_FILES: [&str; N_STAMPED] =
    ["summary.json", "provenance.json", "steps.parquet", "report.html", "run.mcap", "trials.jsonl"];

/// Whether a folder has the configuration and other files of a run, but no summary.
fn is_without_summary(folder: &Path) -> bool {
    let has = |name: &&str| is_file(&folder.join(name));
    has(&"config.toml")
        && !is_sweep(folder)
        && ["run.log", "steps.parquet", "run.mcap"].iter().any(has)
}

fn is_sweep(folder: &Path) -> bool {
    ["sweep.toml", "trials.jsonl"].iter().any(|name| is_file(&folder.join(name)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_may_be_a_result_is_found_up_to_a_depth_and_no_link_is_followed() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("runs");
        for folder in ["a", ".a.partial-7", ".hidden/b", "1/2/3/c", "1/2/3/4/d", "lost", "s/runs/t"]
        {
            fs::create_dir_all(out.join(folder)).unwrap();
        }
        for file in ["a", ".hidden/b", "1/2/3/c", "1/2/3/4/d", "s/runs/t"] {
            fs::write(out.join(file).join("summary.json"), "{}").unwrap();
        }
        fs::write(out.join("a/other.json"), "{}").unwrap();
        fs::write(out.join("lost/config.toml"), "").unwrap();
        fs::write(out.join("lost/run.log"), "").unwrap();
        fs::write(out.join("s/sweep.toml"), "").unwrap();
        fs::write(out.join("answer.json"), "{}").unwrap();
        fs::create_dir(root.path().join("outside")).unwrap();
        fs::write(root.path().join("outside/summary.json"), "{}").unwrap();
        std::os::unix::fs::symlink(root.path().join("outside"), out.join("link")).unwrap();
        let found = Listing::of(&out).found;
        let found: Vec<(&str, Kind)> =
            found.iter().map(|found| (&*found.place, found.kind)).collect();
        let expected = [
            (".a.partial-7", Kind::Unfinished),
            ("1/2/3/c", Kind::Finished),
            ("a", Kind::Finished),
            ("answer.json", Kind::Answer),
            ("lost", Kind::Finished),
            ("s", Kind::Unfinished),
            ("s/runs/t", Kind::Finished),
        ];
        assert_eq!(found, expected);
        // A result alone.
        let alone = Listing::of(&out.join("a")).found;
        assert_eq!((alone.len(), &*alone[0].place), (1, "a"));
    }
}
