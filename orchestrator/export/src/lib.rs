//! A run in the formats of other programs: CSV tables, or a bag of ROS 2.
//!
//! | module | content |
//! |---|---|
//! | `tables` | CSV tables |
//! | `rosbag` | a bag of ROS 2; `cdr` is the encoding of its messages |

mod cdr;
mod rosbag;
mod tables;

use record::read::ReadError;
use record::result::{ResultError, ResultFolder};
use std::path::{Path, PathBuf};
use system::DraftFolder;

/// A format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum ExportFormat {
    /// Every Parquet table as CSV
    Csv,
    /// Odometry and transforms of all robots as a bag of ROS 2 (MCAP)
    Rosbag2,
}

impl ExportFormat {
    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Rosbag2 => "rosbag2",
        }
    }
}

/// A file that was written, and how many rows or messages it holds.
#[derive(Debug)]
pub struct Exported {
    /// The file.
    pub path: PathBuf,
    /// Rows or messages.
    pub n_entries: u64,
}

/// Why a run cannot be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] ReadError),
    /// A table is not what the run wrote, or cannot be read.
    #[error(transparent)]
    Table(#[from] ResultError),
    /// There is nothing of this kind in the folder.
    #[error("{} holds no tables: give the folder of a recorded run", path.display())]
    NoTables {
        /// The folder.
        path: PathBuf,
    },
    /// Something stands where the export is to go.
    #[error("{} exists: give another --out, or remove it", path.display())]
    Exists {
        /// What is there.
        path: PathBuf,
    },
    /// A file cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}

impl ExportError {
    /// A failure to write `path`.
    fn write(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        |source| Self::Write { path, source }
    }
}

/// Writes a run to the folder `output`, which must not exist. It has its name only once everything in it is whole.
///
/// # Errors
///
/// The run cannot be read, or the folder not written. Nothing is left behind then.
pub fn export(
    run: &ResultFolder,
    format: ExportFormat,
    output: &Path,
) -> Result<Vec<Exported>, ExportError> {
    if output.exists() {
        return Err(ExportError::Exists { path: output.to_owned() });
    }
    let folder = DraftFolder::beside(output).map_err(ExportError::write(output))?;
    let name = output.file_name().map(|name| name.to_string_lossy().into_owned());
    let written = match format {
        ExportFormat::Csv => tables::export(run, folder.path())?,
        ExportFormat::Rosbag2 => rosbag::export(run, folder.path(), &name.unwrap_or_default())?,
    };
    folder.place(output).map_err(ExportError::write(output))?;
    let moved = written.into_iter().map(|Exported { path, n_entries }| Exported {
        path: output.join(path.file_name().unwrap_or_default()),
        n_entries,
    });
    Ok(moved.collect())
}
