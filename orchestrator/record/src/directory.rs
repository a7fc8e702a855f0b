//! Where a record grows and where it goes: `OUT/.<name>.partial-<pid>/` until it is whole, then `OUT/<name>/`, or
//! `OUT/<name>-2/` where it may not replace what stands there.

use super::bounded::read_file;
use super::lock::ResultLock;
use super::run_summary::RunSummary;
use super::{RecordError, Status, TABLES, checkpoint, ending, run_log};
use experiment::WITHOUT_EFFECT;
use nix::unistd::{AccessFlags, access, geteuid};
use proto::bounds::DESCRIPTION_BYTES;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::fmt;
use std::fs;
use std::io::{ErrorKind, Write as _};
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use system::File;

/// Which earlier results a new one replaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReplacePolicy {
    /// A complete result replaces one of the same effective configuration and seed. Nothing else is replaced.
    SameExperiment,
    /// A complete result replaces whatever result there is, an incomplete one only results that are incomplete.
    AnyExperiment,
    /// A result replaces whatever result there is: in a folder whose results are remade.
    Always,
}

/// The place of a result, locked until the result stands there or this is dropped.
#[derive(Debug)]
pub struct Reservation {
    out: PathBuf,
    name: String,
    lock: ResultLock,
    leftovers: Vec<PathBuf>,
    /// After the lock: fields are dropped in this order.
    _made: MadeFolder,
}

/// A folder that did not exist. Removed when dropped, if it is empty.
#[derive(Debug)]
struct MadeFolder(Option<PathBuf>);

impl Drop for MadeFolder {
    fn drop(&mut self) {
        if let Some(path) = &self.0 {
            // Fails if there is anything in it.
            let _ = system::remove_dir(path);
        }
    }
}

impl Reservation {
    /// Locks the place of the result `name` in the folder `out`, which is made if need be. Leaves nothing when dropped.
    ///
    /// # Errors
    ///
    /// A name that cannot be a directory's, a result directory that no run left, another run that writes the result, no
    /// permission, no space.
    pub fn new(out: &Path, name: &str) -> Result<Self, RecordError> {
        let valid = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
        if name.is_empty() || 100 < name.len() || name.starts_with('.') || !name.chars().all(valid)
        {
            return Err(RecordError::Name { name: name.to_owned() });
        }
        let made = MadeFolder((!out.exists()).then(|| out.to_owned()));
        let mut attempt = 0;
        let lock = loop {
            system::create_dir_all(out)
                .map_err(|source| RecordError::Create { path: out.to_owned(), source })?;
            match ResultLock::take(out, name) {
                Ok(lock) => break lock,
                // Another run that failed has just removed the empty folder.
                Err(RecordError::Create { source, .. })
                    if source.kind() == ErrorKind::NotFound && attempt < 10 =>
                {
                    attempt += 1;
                }
                Err(error) => return Err(error),
            }
        };
        put_back(out, name)?;
        let target = out.join(name);
        refuse_foreign(&target)?;
        refuse_immovable(out, &target)?;
        // Of a program that was killed once its result had its name.
        let _ = forget_progress(&target);
        let mut leftovers = hidden(out, &format!(".{name}.partial-"));
        leftovers.retain(|left| !remove_if_empty(left));
        Ok(Self { out: out.to_owned(), name: name.to_owned(), lock, leftovers, _made: made })
    }

    /// What runs of that name left that ended before their records were whole: nobody writes there any more.
    #[must_use]
    pub fn leftovers(&self) -> &[PathBuf] {
        &self.leftovers
    }

    /// The folder of results.
    #[must_use]
    pub fn out(&self) -> &Path {
        &self.out
    }
}

/// Entries of a folder whose names begin like this, sorted.
fn hidden(out: &Path, prefix: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(out).into_iter().flatten().flatten();
    let mut found: Vec<PathBuf> = entries
        .filter(|entry| entry.file_name().to_string_lossy().starts_with(prefix))
        .map(|entry| entry.path())
        .filter(|path| path.is_dir())
        .collect();
    found.sort();
    found
}

/// Removes the folder of an unfinished run that was killed before anything was recorded. Its own lock tells that from one that
/// stands still, on another host.
fn remove_if_empty(left: &Path) -> bool {
    let Ok(folder) = fs::File::open(left) else { return false };
    holds_nothing(left) && folder.try_lock().is_ok() && system::remove_dir_all(left).is_ok()
}

/// Whether nothing was recorded in the folder of an unfinished run: its files are empty, but for the configuration and the log.
fn holds_nothing(dir: &Path) -> bool {
    let is_empty = |entry: std::io::Result<fs::DirEntry>| -> std::io::Result<bool> {
        let entry = entry?;
        let metadata = entry.metadata()?;
        let is_about = [CONFIG_FILE, run_log::FILE].iter().any(|name| entry.file_name() == *name);
        Ok(metadata.is_file() && (is_about || metadata.len() == 0))
    };
    fs::read_dir(dir).is_ok_and(|mut entries| entries.all(|entry| is_empty(entry).unwrap_or(false)))
}

/// Finishes the replacement of a result in which a program was killed: nothing of the earlier result is lost.
fn put_back(out: &Path, name: &str) -> Result<(), RecordError> {
    let target = out.join(name);
    for removed in hidden(out, &format!(".{name}.removed-")) {
        // That it cannot be removed is no reason not to run.
        let _ = system::remove_dir_all(&removed);
    }
    for aside in hidden(out, &format!(".{name}.replaced-")) {
        if target.exists() {
            empty_aside(&aside, &target)?;
        } else {
            rename(&aside, &target)?;
        }
    }
    Ok(())
}

/// The directory of one record, under its temporary name.
#[derive(Debug)]
pub(crate) struct Directory {
    partial: PathBuf,
    /// Open and locked.
    _folder: Option<fs::File>,
    reservation: Reservation,
    policy: ReplacePolicy,
}

/// Where a record has gone.
#[derive(Debug)]
pub(crate) struct Published {
    /// The directory.
    pub(crate) dir: PathBuf,
    /// The earlier result that kept the place, if one did.
    pub(crate) kept: Option<KeptResult>,
    /// What could not be done after the record had its name, a sentence each.
    pub(crate) warnings: Vec<String>,
}

/// An earlier result that a new one did not replace, and why not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeptResult {
    /// Its directory.
    pub dir: PathBuf,
    /// Why it was not replaced.
    pub reason: KeptReason,
}

/// Why an earlier result was not replaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeptReason {
    /// The new result is not complete.
    Incomplete,
    /// The earlier result has another seed.
    OtherSeed(u64),
    /// The earlier result has another effective configuration.
    OtherConfiguration,
}

impl fmt::Display for KeptReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Incomplete => f.write_str("this run is not complete"),
            Self::OtherSeed(seed) => write!(f, "it is the result of seed {seed}"),
            Self::OtherConfiguration => f.write_str("it is the result of another configuration"),
        }
    }
}

impl Directory {
    /// Makes the temporary directory.
    pub(crate) fn create(
        reservation: Reservation,
        policy: ReplacePolicy,
    ) -> Result<Self, RecordError> {
        let Reservation { out, name, .. } = &reservation;
        let pid = std::process::id();
        for attempt in 0u32.. {
            let suffix = if attempt == 0 { String::new() } else { format!("-{attempt}") };
            let partial = out.join(format!(".{name}.partial-{pid}{suffix}"));
            match system::create_dir(&partial) {
                Ok(()) => {
                    // What cannot be renamed at the end is not worth beginning.
                    let other = out.join(format!(".{name}.partial-{pid}-renamed{suffix}"));
                    let renamed = rename(&partial, &other).and_then(|()| rename(&other, &partial));
                    renamed.inspect_err(|_| drop(system::remove_dir(&partial)))?;
                    let folder = fs::File::open(&partial).ok();
                    let _folder = folder.filter(|folder| folder.try_lock().is_ok());
                    return Ok(Self { partial, _folder, reservation, policy });
                }
                Err(source) if source.kind() == ErrorKind::AlreadyExists && attempt < 1000 => {}
                Err(source) => return Err(RecordError::Create { path: partial, source }),
            }
        }
        unreachable!("the last attempt returns")
    }

    /// Where the record stands now.
    pub(crate) fn path(&self) -> &Path {
        &self.partial
    }

    /// Writes a whole file into it.
    pub(crate) fn write(&self, name: &str, content: &[u8]) -> Result<(), RecordError> {
        let path = self.partial.join(name);
        let mut file = File::create(&path)
            .map_err(|source| RecordError::Create { path: path.clone(), source })?;
        file.write_all(content).map_err(|source| RecordError::Write { path, source })
    }

    /// Brings the record to the disk and gives it its name: that of the experiment, or the first of `<name>-2`, `<name>-3`, …
    /// that is free or holds what the record may replace.
    pub(crate) fn publish(self, summary: &RunSummary) -> Result<Published, RecordError> {
        let Self { partial, reservation, policy, _folder } = self;
        let Reservation { out, name, lock, .. } = &reservation;
        sync_tree(&partial)?;
        let target = out.join(name);
        if !lock.is_held() {
            return Err(RecordError::LockLost { target, partial });
        }
        let config = read_file(&DESCRIPTION_BYTES, &partial.join(CONFIG_FILE)).ok();
        let mut kept = None;
        for n in 1u32.. {
            let dir = if n == 1 { target.clone() } else { out.join(format!("{name}-{n}")) };
            if 1 < n {
                put_back(out, &format!("{name}-{n}"))?;
            }
            let earlier = EarlierResult::read(&dir);
            let keeps = match (&earlier, n) {
                (Some(earlier), _) => earlier.keeps(policy, summary, config.as_deref()),
                (None, 1) => {
                    refuse_foreign(&dir)?;
                    None
                }
                // What is not a result is not ours. A folder of this name that appears meanwhile keeps it.
                (None, _) => match system::create_dir(&dir) {
                    Ok(()) => None,
                    Err(source) if source.kind() == ErrorKind::AlreadyExists => continue,
                    Err(source) => return Err(RecordError::Create { path: dir, source }),
                },
            };
            if let Some(reason) = keeps {
                kept.get_or_insert(KeptResult { dir, reason });
                continue;
            }
            let mut warnings = Vec::new();
            system::point("before the rename");
            if earlier.is_some() {
                warnings.extend(replace(&partial, &dir)?.err());
            } else {
                rename(&partial, &dir)?;
            }
            system::point("after the rename");
            warnings.extend(sync_dir(out).err());
            // Last: whatever fails before, the run can go on from its checkpoint.
            warnings.extend(forget_progress(&dir).err());
            let warnings = warnings.iter().map(|error| format!("{error}; the result is whole"));
            return Ok(Published { dir: dir.clone(), kept, warnings: warnings.collect() });
        }
        unreachable!("some number is free")
    }
}

/// A result that stands where another one is to go.
struct EarlierResult {
    summary: Option<RunSummary>,
    config: Option<Vec<u8>>,
}

impl EarlierResult {
    fn read(dir: &Path) -> Option<Self> {
        is_record(dir).then(|| Self {
            summary: RunSummary::read(dir).ok(),
            config: read_file(&DESCRIPTION_BYTES, &dir.join(CONFIG_FILE)).ok(),
        })
    }

    /// Why it keeps its place from a new result; `None`: it is replaced.
    fn keeps(
        &self,
        policy: ReplacePolicy,
        new: &RunSummary,
        config: Option<&[u8]>,
    ) -> Option<KeptReason> {
        let is_new_complete = new.status == Status::Complete;
        // One that cannot be read may be complete.
        let is_complete = self.summary.as_ref().is_none_or(|s| s.status == Status::Complete);
        match policy {
            ReplacePolicy::Always => return None,
            ReplacePolicy::AnyExperiment if is_new_complete || !is_complete => return None,
            ReplacePolicy::AnyExperiment => return Some(KeptReason::Incomplete),
            ReplacePolicy::SameExperiment => {}
        }
        match &self.summary {
            _ if !is_new_complete => Some(KeptReason::Incomplete),
            Some(summary) if summary.seed != new.seed => Some(KeptReason::OtherSeed(summary.seed)),
            _ if is_same_configuration(self.config.as_deref(), config) => None,
            _ => Some(KeptReason::OtherConfiguration),
        }
    }
}

/// Whether two configurations give the same results.
fn is_same_configuration(one: Option<&[u8]>, other: Option<&[u8]>) -> bool {
    let with_effect = |text: Option<&[u8]>| {
        let mut config: toml::Table = str::from_utf8(text?).ok()?.parse().ok()?;
        if let Some(section) = config.get_mut("experiment").and_then(toml::Value::as_table_mut) {
            WITHOUT_EFFECT.iter().for_each(|key| drop(section.remove(*key)));
        }
        Some(config)
    };
    match (with_effect(one), with_effect(other)) {
        (Some(one), Some(other)) => one == other,
        _ => one == other,
    }
}

/// Puts a record in the place of an earlier one. Files in the earlier one that no run wrote move into the new one: that this fails
/// is the inner error, and the next run with this name does it.
fn replace(partial: &Path, target: &Path) -> Result<Result<(), RecordError>, RecordError> {
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    let aside = target.with_file_name(format!(".{name}.replaced-{}", std::process::id()));
    rename(target, &aside)?;
    system::point("between two renames");
    if let Err(error) = rename(partial, target) {
        // Back to where it was: the earlier result must not be lost as well.
        rename(&aside, target)?;
        return Err(error);
    }
    Ok(empty_aside(&aside, target))
}

/// Removes an earlier result whose place `target` has taken, but for files that no run wrote.
fn empty_aside(aside: &Path, target: &Path) -> Result<(), RecordError> {
    keep_foreign(aside, target)?;
    // Under a name that says so: half removed, it would no longer tell which of its files a run wrote.
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    let path = target.with_file_name(format!(".{name}.removed-{}", std::process::id()));
    rename(aside, &path)?;
    system::remove_dir_all(&path).map_err(|source| RecordError::Remove { path, source })
}

/// Removes what only an unfinished run needs from a result, which a program that was killed may have left there.
///
/// # Errors
///
/// A file cannot be removed.
pub fn forget_progress(dir: &Path) -> Result<(), RecordError> {
    for file in PROGRESS {
        let path = dir.join(file);
        match system::remove_file(&path) {
            Err(source) if source.kind() != ErrorKind::NotFound => {
                return Err(RecordError::Remove { path, source });
            }
            _ => {}
        }
    }
    Ok(())
}

/// Files that only an unfinished run needs.
const PROGRESS: [&str; 3] = [checkpoint::FILE, checkpoint::UNFINISHED, ending::FILE];

/// Moves everything in `from` that no run wrote into `to`. What has a name there already gets another one.
fn keep_foreign(from: &Path, to: &Path) -> Result<(), RecordError> {
    let ours = files_of_run(from);
    let read = |source| RecordError::Write { path: from.to_owned(), source };
    for entry in fs::read_dir(from).map_err(read)? {
        let entry = entry.map_err(read)?;
        let name = entry.file_name();
        if name.to_str().is_some_and(|name| ours.contains(name)) {
            continue;
        }
        let mut to = to.join(&name);
        let mut n = 2;
        while fs::symlink_metadata(&to).is_ok() {
            to.set_file_name(format!("{}-{n}", name.to_string_lossy()));
            n += 1;
        }
        rename(&entry.path(), &to)?;
    }
    sync_dir(to)
}

/// The names of files in a result that runs write.
fn files_of_run(dir: &Path) -> BTreeSet<String> {
    #[derive(Deserialize)]
    struct Provenance {
        files: serde_json::Map<String, serde_json::Value>,
    }
    let always = [CONFIG_FILE, "provenance.json", "report.html", RunSummary::FILE, "run.log"];
    let mut names: BTreeSet<String> = always.map(str::to_owned).into();
    names.extend(PROGRESS.map(str::to_owned));
    names.extend(TABLES.iter().map(|table| table.file.to_owned()));
    let provenance = read_file(&DESCRIPTION_BYTES, &dir.join("provenance.json")).ok();
    let provenance: Option<Provenance> =
        provenance.and_then(|content| serde_json::from_slice(&content).ok());
    names.extend(provenance.into_iter().flat_map(|provenance| provenance.files).map(|(n, _)| n));
    names
}

fn rename(from: &Path, to: &Path) -> Result<(), RecordError> {
    system::rename(from, to).map_err(|source| RecordError::Rename {
        from: from.to_owned(),
        to: to.to_owned(),
        source,
    })
}

/// Brings a directory and all files in it to the disk.
fn sync_tree(dir: &Path) -> Result<(), RecordError> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| RecordError::Write { path, source }
    };
    for entry in fs::read_dir(dir).map_err(failed(dir))? {
        let path = entry.map_err(failed(dir))?.path();
        if path.is_dir() {
            sync_tree(&path)?;
        } else {
            system::sync(&path).map_err(failed(&path))?;
        }
    }
    sync_dir(dir)
}

/// Brings the names in a directory to the disk, where the file system can.
fn sync_dir(dir: &Path) -> Result<(), RecordError> {
    match system::sync(dir) {
        Err(error) if !matches!(error.kind(), ErrorKind::InvalidInput | ErrorKind::Unsupported) => {
            Err(RecordError::Write { path: dir.to_owned(), source: error })
        }
        _ => Ok(()),
    }
}

/// Whether `dir` holds what a run left.
pub(crate) fn is_record(dir: &Path) -> bool {
    read_file(&DESCRIPTION_BYTES, &dir.join(RunSummary::FILE))
        .ok()
        .and_then(|text| serde_json::from_slice::<Tagged>(&text).ok())
        .is_some_and(|tagged| tagged.schema.starts_with(SCHEMA_PREFIX))
}

/// What says of which format a `summary.json` is.
#[derive(Debug, Deserialize)]
pub struct Tagged {
    /// The format.
    pub schema: String,
}

/// What the `schema` of every `summary.json` begins with.
pub const SCHEMA_PREFIX: &str = "murmuration/summary/";
/// The effective configuration.
const CONFIG_FILE: &str = "config.toml";

fn refuse_foreign(target: &Path) -> Result<(), RecordError> {
    let found = fs::symlink_metadata(target);
    if found.as_ref().is_ok_and(std::fs::Metadata::is_symlink) {
        return Err(RecordError::Link { path: target.to_owned() });
    }
    let exists = found.is_ok();
    let is_empty = || {
        target.is_dir() && fs::read_dir(target).is_ok_and(|mut entries| entries.next().is_none())
    };
    if exists && !is_empty() && !is_record(target) {
        return Err(RecordError::Foreign { path: target.to_owned() });
    }
    Ok(())
}

/// Refuses an earlier result that this user could not move away for a new one.
fn refuse_immovable(out: &Path, target: &Path) -> Result<(), RecordError> {
    let (Ok(folder), Ok(found)) = (fs::metadata(out), fs::metadata(target)) else { return Ok(()) };
    let reason = if folder.dev() != found.dev() {
        "it is on another file system than the folder that it is in"
    } else if access(target, AccessFlags::W_OK | AccessFlags::X_OK).is_err() {
        "you may not write it"
    } else if is_held(&folder, &found, geteuid().as_raw()) {
        "it is somebody else's, in a folder in which only owners may rename (sticky bit)"
    } else {
        return Ok(());
    };
    Err(RecordError::Immovable { path: target.to_owned(), reason })
}

/// Whether the sticky bit of a folder keeps a user from renaming what is in it.
fn is_held(folder: &fs::Metadata, found: &fs::Metadata, user: u32) -> bool {
    folder.mode() & 0o1000 != 0 && ![0, folder.uid(), found.uid()].contains(&user)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_could_not_be_moved_away_at_the_end_is_refused() {
        // Another file system, on any Linux.
        let refused = refuse_immovable(Path::new("/"), Path::new("/proc")).unwrap_err();
        assert!(refused.to_string().contains("another file system"), "{refused}");
        assert!(refuse_immovable(Path::new("/"), Path::new("/no such result")).is_ok());
        let out = tempfile::tempdir().unwrap();
        let of = |path: &Path| fs::metadata(path).unwrap();
        let sticky = of(&std::env::temp_dir());
        assert_ne!(sticky.mode() & 0o1000, 0, "the folder of temporary files is everybody's");
        let found = of(out.path());
        assert!(!is_held(&sticky, &found, found.uid()) && !is_held(&sticky, &found, 0));
        assert!(is_held(&sticky, &found, found.uid().max(sticky.uid()) + 1));
        assert!(!is_held(&found, &found, found.uid() + 1));
    }
}
