//! `ending.json` in the folder of a run that is not finished: how the run ended, once it has taken its last step.
//!
//! With it, making the result can be repeated from the recording. Like the checkpoint it is removed when the result has its name.

use super::bounded::read_file;
use super::directory::Directory;
use super::{Ending, RecordError, pretty};
use proto::bounds::DESCRIPTION_BYTES;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::path::Path;

/// The file.
pub(crate) const FILE: &str = "ending.json";

/// Its content.
#[derive(Serialize, Deserialize)]
struct Stored<'a> {
    ending: Cow<'a, Ending>,
    /// The last step.
    steps: u64,
}

impl Ending {
    /// Stores it in the folder of a run that ended after step `steps`.
    pub(crate) fn store(&self, directory: &Directory, steps: u64) -> Result<(), RecordError> {
        let stored = Stored { ending: Cow::Borrowed(self), steps };
        directory.write(FILE, pretty(&stored).as_bytes())
    }

    /// How the run in the folder `dir` ended after step `steps`; `None`: it was killed before, or took further steps.
    #[must_use]
    pub fn stored(dir: &Path, steps: u64) -> Option<Self> {
        let content = read_file(&DESCRIPTION_BYTES, &dir.join(FILE)).ok()?;
        let stored: Stored<'_> = serde_json::from_slice(&content).ok()?;
        (stored.steps == steps).then(|| stored.ending.into_owned())
    }
}
