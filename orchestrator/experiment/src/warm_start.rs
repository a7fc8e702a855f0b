//! Starting from a formed network: `experiment.warm_start`.

use super::SideConfig;
use proto::config::Problem;
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
    /// The file that a table `[experiment]` names, its path being relative to `base`, and every problem with that. The table then
    /// holds its absolute path, which is the same wherever the table is recorded.
    pub(super) fn read(
        experiment: &mut toml::Table,
        base: &Path,
        netsim: &SideConfig,
        problems: &mut Vec<Problem>,
    ) -> Option<Self> {
        let text = |key: &str| experiment.get(key).and_then(toml::Value::as_str).map(str::to_owned);
        let (written, sha256) = (text("warm_start"), text("warm_start_sha256"));
        let Some(written) = written else {
            if sha256.is_some() {
                problems.push(Problem::new(
                    "experiment.warm_start_sha256",
                    "is the checksum of experiment.warm_start, which is not set",
                ));
            }
            return None;
        };
        if let Some(sha256) = &sha256
            && !(sha256.len() == 64 && sha256.chars().all(|c| c.is_ascii_hexdigit()))
        {
            problems.push(
                Problem::new("experiment.warm_start_sha256", "must be 64 hexadecimal digits")
                    .value(format!("{sha256:?}")),
            );
        }
        if text("start").as_deref() == Some("at-once") {
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
        let file = base.join(&written);
        let path = std::path::absolute(&file).unwrap_or(file);
        experiment.insert("warm_start".to_owned(), path.display().to_string().into());
        Some(Self { path, sha256: sha256.map(|sha256| sha256.to_ascii_lowercase()) })
    }
}
