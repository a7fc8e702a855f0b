//! A formed network in a file of its own: what a run was until its network had formed, and both sides' states there.
//!
//! The file begins with a magic number and the SHA-256 of what follows: the version of the program as a postcard text, then a
//! postcard record with the states and with the messages of every step, as `run.mcap` would hold them. A run that starts from
//! the file records those steps as its own first ones, so that its results have the same shape as those of any other run.

use super::bounded::read_file;
use super::log::{StoredMessage, Topic, configuration_messages, step_messages};
use super::read::{ReadError, RunReader};
use super::{StepRecord, values};
use bytes::Bytes;
use proto::bounds::FORMED_BYTES;
use proto::digest;
use proto::exchange::Configured;
use serde::{Deserialize, Serialize};
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// A network that has formed, and everything that a run needs to start from it.
#[derive(Clone, Debug)]
pub struct FormedNetwork {
    /// The version of the program that wrote it.
    pub version: String,
    /// Name and version of the robot simulator.
    pub robots: SimulatorVersion,
    /// Name and version of the network simulator.
    pub network: SimulatorVersion,
    /// How both sides were configured.
    pub configured: Configured,
    /// Every step until the network had formed, from step 1 on.
    pub steps: Vec<StepRecord>,
    /// The robots' state after the last of these steps.
    pub robots_state: Bytes,
    /// The network's state after the last of these steps.
    pub network_state: Bytes,
}

/// Who took a snapshot: it can be restored by the same simulator of the same version alone.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SimulatorVersion {
    /// Its name, as it describes itself.
    pub name: String,
    /// Its version, as it describes itself.
    pub version: String,
}

/// Why a file is no formed network that this program can use.
#[derive(Debug, thiserror::Error)]
pub enum FormedError {
    /// The file cannot be read.
    #[error("cannot be read: {source}")]
    Read {
        /// What the system says.
        source: std::io::Error,
    },
    /// The file is something else.
    #[error(
        "is not a formed network; write one with {} run --save-formed",
        experiment::program_name()
    )]
    Foreign,
    /// Another version wrote it: snapshots hold for one version.
    #[error("was written by version {version} of the program; this is version {}. Form the network again with --save-formed",
        env!("CARGO_PKG_VERSION"))]
    Version {
        /// The version that wrote it.
        version: String,
    },
    /// The file was cut off or changed.
    #[error("is damaged: {reason}; form the network again with --save-formed")]
    Damaged {
        /// What is wrong with it.
        reason: String,
    },
}

/// What the file holds after its version.
#[derive(Serialize, Deserialize)]
struct Stored {
    robots: SimulatorVersion,
    network: SimulatorVersion,
    robots_state: Bytes,
    network_state: Bytes,
    /// How both sides were configured, then the steps.
    messages: Vec<StoredMessage>,
}

/// What every such file begins with; the last byte is the format.
const MAGIC: [u8; 8] = *b"murmfrm\x01";

impl FormedNetwork {
    /// Length of what comes before the checksummed content.
    pub const HEADER_BYTES: usize = MAGIC.len() + 32;

    /// Writes the file at `path` as a whole: whoever reads it finds the one that was there before, or this one. Returns its
    /// SHA-256.
    ///
    /// # Errors
    ///
    /// No permission, no space.
    pub fn write(&self, path: &Path) -> std::io::Result<String> {
        let content = self.to_bytes();
        let mut draft = system::Draft::beside(path)?;
        draft.write_all(&content)?;
        draft.replace(path)?;
        Ok(digest::hex(&digest::of_bytes(&content)))
    }

    /// The content of the file.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let stored = Stored {
            robots: self.robots.clone(),
            network: self.network.clone(),
            robots_state: self.robots_state.clone(),
            network_state: self.network_state.clone(),
            messages: self.messages(),
        };
        Self::sealed(&postcard::to_stdvec(&(&self.version, stored)).expect("plain data in memory"))
    }

    /// A file with this content: magic number and checksum before it.
    #[must_use]
    pub fn sealed(content: &[u8]) -> Vec<u8> {
        [&MAGIC[..], &digest::of_bytes(content), content].concat()
    }

    /// Reads a file. Returns its SHA-256 as well, in hexadecimal.
    ///
    /// # Errors
    ///
    /// See [`FormedError`].
    pub fn read(path: &Path) -> Result<(Self, String), FormedError> {
        let content =
            read_file(&FORMED_BYTES, path).map_err(|source| FormedError::Read { source })?;
        let formed = Self::of_bytes(path, &content)?;
        Ok((formed, digest::hex(&digest::of_bytes(&content))))
    }

    /// Reads the content of a file. `path` is for messages.
    ///
    /// # Errors
    ///
    /// See [`FormedError`].
    pub fn of_bytes(path: &Path, content: &[u8]) -> Result<Self, FormedError> {
        let damaged = |reason: String| FormedError::Damaged { reason };
        let rest = content.strip_prefix(&MAGIC).ok_or(FormedError::Foreign)?;
        let rest = match rest.split_at_checked(32) {
            Some((checksum, rest)) if checksum == digest::of_bytes(rest) => rest,
            _ => return Err(damaged("its checksum is wrong".to_owned())),
        };
        let wrong = |error: postcard::Error| damaged(error.to_string());
        let (version, rest): (String, _) = postcard::take_from_bytes(rest).map_err(wrong)?;
        if version != env!("CARGO_PKG_VERSION") {
            return Err(FormedError::Version { version });
        }
        let (stored, rest): (Stored, _) = postcard::take_from_bytes(rest).map_err(wrong)?;
        if !rest.is_empty() {
            return Err(damaged(format!("{} bytes too many", rest.len())));
        }
        let Stored { robots, network, robots_state, network_state, messages } = stored;
        let (configured, steps) = exchanged(path.to_owned(), messages).map_err(damaged)?;
        Ok(Self { version, robots, network, configured, steps, robots_state, network_state })
    }

    fn messages(&self) -> Vec<StoredMessage> {
        let steps = self.steps.iter();
        let steps = steps.flat_map(|step| step_messages(step, step.network.capture.clone()));
        let messages = configuration_messages(&self.configured).into_iter().chain(steps);
        messages.map(|(topic, bytes)| (topic as u8, bytes)).collect()
    }
}

/// The configuration and the steps of stored messages.
fn exchanged(
    path: PathBuf,
    messages: Vec<StoredMessage>,
) -> Result<(Configured, Vec<StepRecord>), String> {
    let text = |error: ReadError| error.to_string();
    let mut named = Vec::with_capacity(messages.len());
    for (topic, data) in messages {
        let known = Topic::ALL.get(usize::from(topic));
        named.push((*known.ok_or_else(|| format!("topic {topic} is unknown"))?, data));
    }
    let mut reader = RunReader::stored(path, named).map_err(text)?;
    let Some(recorded) = reader.configured().cloned() else {
        return Err("it does not say how both sides were configured".to_owned());
    };
    let n_agents = recorded.robot_request.agent_count as usize;
    let configured = values::configured(recorded).map_err(|invalid| invalid.to_string())?;
    let mut steps: Vec<StepRecord> = Vec::new();
    while let Some(step) = reader.next_step().map_err(text)? {
        let step = values::step(step, n_agents).map_err(|invalid| invalid.to_string())?;
        let expected = steps.len() as u64 + 1;
        if step.step != expected {
            return Err(format!("step {} stands where step {expected} belongs", step.step));
        }
        steps.push(step);
    }
    Ok((configured, steps))
}
