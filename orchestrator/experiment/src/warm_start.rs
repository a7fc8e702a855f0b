//! Starting from a formed network: `experiment.warm_start`.

use super::keys::ExperimentKeys;
use super::{SideConfig, Start};
use proto::config::{FilePath, Problem};
use std::path::{Path, PathBuf};

/// The file of a formed network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WarmStart {
    /// Where it is.
    pub path: PathBuf,
    /// Its SHA-256, if the experiment states it.
    pub sha256: Option<String>,
}

impl WarmStart {
    /// The file that `[experiment]` names, its path being relative to `base`, and every problem with that. The table `recorded` then
    /// holds its absolute path, which is the same wherever the table is recorded.
    pub(super) fn read(
        experiment: &ExperimentKeys,
        recorded: &mut toml::Table,
        base: &Path,
        netsim: &SideConfig,
        problems: &mut Vec<Problem>,
    ) -> Option<Self> {
        let sha256 = &experiment.warm_start_sha256;
        let Some(FilePath(written)) = &experiment.warm_start else {
            if sha256.is_some() {
                problems.push(Problem::new(
                    "experiment.warm_start_sha256",
                    "is the checksum of experiment.warm_start, which is not set",
                ));
            }
            return None;
        };
        if let Some(sha256) = sha256
            && !(sha256.len() == 64 && sha256.chars().all(|c| c.is_ascii_hexdigit()))
        {
            problems.push(
                Problem::new("experiment.warm_start_sha256", "must be 64 hexadecimal digits")
                    .value(format!("{sha256:?}")),
            );
        }
        if experiment.start == Some(Start::AtOnce) {
            problems.push(
                Problem::new(
                    "experiment.start",
                    "must be \"when-formed\" with experiment.warm_start, whose robots start when the network has formed",
                )
                .value("\"at-once\""),
            );
        }
        let network = netsim.effective_toml.as_ref().filter(|_| netsim.url.is_none());
        let network: Option<toml::Table> = network.and_then(|text| toml::from_str(text).ok());
        let mode = network.as_ref().and_then(|network| network.get("mode")?.as_str());
        if let Some(mode) = mode.filter(|mode| *mode != "6tisch") {
            problems.push(
                Problem::new(
                    "experiment.warm_start",
                    format!("requires a network that forms, which netsim.mode = {mode:?} does not"),
                )
                .value(format!("{written:?}")),
            );
        }
        let file = base.join(written);
        let path = std::path::absolute(&file).unwrap_or(file);
        recorded.insert("warm_start".to_owned(), path.display().to_string().into());
        Some(Self { path, sha256: sha256.as_ref().map(|sha256| sha256.to_ascii_lowercase()) })
    }
}
