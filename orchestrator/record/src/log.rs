//! `run.mcap`: the messages exchanged, as they were, with their descriptors.
//!
//! Nothing in the file depends on when, where or by which version it was written: times are simulated, and transport-dependent
//! fields are cleared before a message comes here.

use super::descriptors::descriptors_of;
use super::mcap_file::McapFile;
use super::{RecordError, StepRecord};
use bytes::Bytes;
use input::fingerprint::Fingerprint;
use prost::Message as _;
use proto::exchange::{Configured, NetworkStep, RobotsStep};
use proto_messages::v1;
use std::collections::BTreeMap;
use std::path::Path;

/// A stream of messages of one type within the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Topic {
    RobotConfigureRequest,
    RobotConfigureResponse,
    NetConfigureRequest,
    NetConfigureResponse,
    NetCommand,
    RobotStep,
    NetStep,
    Barrier,
}

impl Topic {
    /// All of them, in the order of their channels.
    pub(crate) const ALL: [Self; 8] = [
        Self::RobotConfigureRequest,
        Self::RobotConfigureResponse,
        Self::NetConfigureRequest,
        Self::NetConfigureResponse,
        Self::NetCommand,
        Self::RobotStep,
        Self::NetStep,
        Self::Barrier,
    ];

    /// Name of the topic, and of the message type without its package.
    pub(crate) fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::RobotConfigureRequest => {
                ("/robotsim/configure/request", "RobotSimServiceConfigureRequest")
            }
            Self::RobotConfigureResponse => {
                ("/robotsim/configure/response", "RobotSimServiceConfigureResponse")
            }
            Self::NetConfigureRequest => {
                ("/netsim/configure/request", "NetSimServiceConfigureRequest")
            }
            Self::NetConfigureResponse => {
                ("/netsim/configure/response", "NetSimServiceConfigureResponse")
            }
            Self::NetCommand => ("/netsim/command", "NetSimServiceCommandRequest"),
            Self::RobotStep => ("/robotsim/step", "RobotSimServiceStepResponse"),
            Self::NetStep => ("/netsim/step", "NetSimServiceStepResponse"),
            Self::Barrier => ("/barrier", "RobotSimServiceBarrierResponse"),
        }
    }

    /// The topic of that name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|topic| topic.names().0 == name)
    }
}

/// A message as it was recorded: its topic, as an index into [`Topic::ALL`], and its bytes.
pub(crate) type StoredMessage = (u8, Vec<u8>);

/// The bytes of the messages that say how both sides were configured.
pub(crate) fn configuration_messages(configured: &Configured) -> [(Topic, Vec<u8>); 4] {
    let Configured { robots_request, robots_start, network_request, network_start } = configured;
    let robots_request = v1::RobotSimServiceConfigureRequest::from(robots_request);
    let robots_start = v1::RobotSimServiceConfigureResponse::from(robots_start);
    let network_request = v1::NetSimServiceConfigureRequest::from(network_request);
    let network_start = v1::NetSimServiceConfigureResponse::from(network_start);
    [
        (Topic::RobotConfigureRequest, robots_request.encode_to_vec()),
        (Topic::RobotConfigureResponse, robots_start.encode_to_vec()),
        (Topic::NetConfigureRequest, network_request.encode_to_vec()),
        (Topic::NetConfigureResponse, network_start.encode_to_vec()),
    ]
}

/// The bytes of the messages of a step. `capture`: the radio's traffic as they hold it.
pub(crate) fn step_messages(record: &StepRecord, capture: Bytes) -> Vec<(Topic, Vec<u8>)> {
    let mut messages = Vec::with_capacity(4);
    if !record.commands.is_empty() {
        let commands = record.commands.iter().cloned().map(Into::into).collect();
        let request = v1::NetSimServiceCommandRequest { commands };
        messages.push((Topic::NetCommand, request.encode_to_vec()));
    }
    let robots = v1::RobotSimServiceStepResponse::from(RobotsStep::clone(&record.robots));
    messages.push((Topic::RobotStep, robots.encode_to_vec()));
    let network = NetworkStep { capture, ..NetworkStep::clone(&record.network) };
    let network = v1::NetSimServiceStepResponse::from(network);
    messages.push((Topic::NetStep, network.encode_to_vec()));
    let StepRecord { step, time_ns, digest, .. } = *record;
    let digest = digest.to_vec().into();
    let barrier = v1::RobotSimServiceBarrierResponse { step, time_ns, digest };
    messages.push((Topic::Barrier, barrier.encode_to_vec()));
    messages
}

/// The log being written.
pub(crate) struct MessageLog {
    file: McapFile,
    channels: BTreeMap<Topic, u16>,
    /// For checkpoints: the messages that the file may not hold yet, by step.
    latest: Option<Vec<(u64, Vec<StoredMessage>)>>,
}

impl MessageLog {
    /// Begins the log, with all schemas and channels and a few words about the run. If it `keeps_latest` messages, a checkpoint can
    /// be written at any time.
    pub(crate) fn create(
        path: &Path,
        about: BTreeMap<String, String>,
        keeps_latest: bool,
    ) -> Result<Self, RecordError> {
        let mut file = McapFile::create(path, about)?;
        let mut channels = BTreeMap::new();
        for topic in Topic::ALL {
            let (name, message) = topic.names();
            let message = format!("cosim.v1.{message}");
            let descriptors = descriptors_of(proto_messages::FILE_DESCRIPTOR_SET, &message);
            let schema = (&*message, "protobuf", &*descriptors);
            channels.insert(topic, file.add_channel(name, "protobuf", schema)?);
        }
        let latest = keeps_latest.then(Vec::new);
        Ok(Self { file, channels, latest })
    }

    /// Adds messages. `step` becomes their sequence number.
    pub(crate) fn write(
        &mut self,
        step: u64,
        time_ns: u64,
        messages: impl IntoIterator<Item = (Topic, Vec<u8>)>,
    ) -> Result<(), RecordError> {
        messages
            .into_iter()
            .try_for_each(|(topic, message)| self.add(topic, step, time_ns, message))
    }

    fn add(
        &mut self,
        topic: Topic,
        step: u64,
        time_ns: u64,
        message: Vec<u8>,
    ) -> Result<(), RecordError> {
        let n_bytes = self.latest.as_ref().map(|_| self.file.n_bytes());
        self.file.write(self.channels[&topic], step, time_ns, &message)?;
        if let Some(latest) = &mut self.latest {
            if n_bytes != Some(self.file.n_bytes()) {
                // A chunk was written, with all messages before this one. A step is stored as a whole, or not at all.
                latest.retain(|(number, _)| *number == step);
            }
            if latest.last().is_none_or(|(number, _)| *number != step) {
                latest.push((step, Vec::new()));
            }
            if let Some((_, messages)) = latest.last_mut() {
                messages.push((topic as u8, message));
            }
        }
        Ok(())
    }

    /// Makes sure that whole chunks are on the disk. Returns the messages that may not be among them, by step.
    pub(crate) fn sync(&mut self) -> Result<Vec<(u64, Vec<StoredMessage>)>, RecordError> {
        self.file.sync()?;
        Ok(self.latest.clone().unwrap_or_default())
    }

    /// Ends the log.
    pub(crate) fn finish(self) -> Result<Fingerprint, RecordError> {
        self.file.finish()
    }
}
