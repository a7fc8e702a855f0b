//! Where a record grows and where it goes: `OUT/.<name>.partial-<pid>/` until it is whole, then `OUT/<name>/`.

use super::RecordError;
use serde::Deserialize;
use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The directory of one record, under its temporary name.
#[derive(Debug)]
pub(crate) struct Directory {
    partial: PathBuf,
    target: PathBuf,
}

impl Directory {
    /// Makes the temporary directory, having made sure that the result may go where it is to go.
    pub(crate) fn create(out: &Path, name: &str) -> Result<Self, RecordError> {
        let valid = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
        if name.is_empty() || 100 < name.len() || name.starts_with('.') || !name.chars().all(valid)
        {
            return Err(RecordError::Name { name: name.to_owned() });
        }
        fs::create_dir_all(out)
            .map_err(|source| RecordError::Create { path: out.to_owned(), source })?;
        let target = out.join(name);
        refuse_foreign(&target)?;
        let pid = std::process::id();
        for attempt in 0u32.. {
            let suffix = if attempt == 0 { String::new() } else { format!("-{attempt}") };
            let partial = out.join(format!(".{name}.partial-{pid}{suffix}"));
            match fs::create_dir(&partial) {
                Ok(()) => return Ok(Self { partial, target }),
                Err(source)
                    if source.kind() == std::io::ErrorKind::AlreadyExists && attempt < 1000 => {}
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

    /// Gives the record its name. An earlier result of that name is put aside first and removed afterwards.
    pub(crate) fn publish(self) -> Result<PathBuf, RecordError> {
        let Self { partial, target } = self;
        refuse_foreign(&target)?;
        let rename = |from: &Path, to: &Path| {
            fs::rename(from, to).map_err(|source| RecordError::Rename {
                from: from.to_owned(),
                to: to.to_owned(),
                source,
            })
        };
        if !target.exists() {
            rename(&partial, &target)?;
            return Ok(target);
        }
        let aside = partial.with_extension(format!("replaced-{}", std::process::id()));
        rename(&target, &aside)?;
        if let Err(error) = rename(&partial, &target) {
            // Back to where it was: the earlier result must not be lost as well.
            rename(&aside, &target)?;
            return Err(error);
        }
        fs::remove_dir_all(&aside).map_err(|source| RecordError::Write { path: aside, source })?;
        Ok(target)
    }
}

/// Whether `dir` holds what a run left.
pub(crate) fn is_record(dir: &Path) -> bool {
    fs::read(dir.join("summary.json"))
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

fn refuse_foreign(target: &Path) -> Result<(), RecordError> {
    let exists = fs::symlink_metadata(target).is_ok();
    let is_empty = || {
        target.is_dir() && fs::read_dir(target).is_ok_and(|mut entries| entries.next().is_none())
    };
    if exists && !is_empty() && !is_record(target) {
        return Err(RecordError::Foreign { path: target.to_owned() });
    }
    Ok(())
}
