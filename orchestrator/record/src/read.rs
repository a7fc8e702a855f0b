//! Opens `run.mcap` again.

use super::log::Topic;
use super::random_access::Messages;
use super::writer::LOG_FILE;
use input::checked::{Changed, CheckedFile};
use input::result::{ResultError, ResultFolder};
use mcap::io::MessageReader;
use mcap::sans_io::LinearReaderOptions;
use prost::Message;
use proto::bounds::RECORDING_BYTES;
use proto_messages::v1;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// A recorded run, read step by step: memory does not grow with its length.
pub struct RunReader {
    path: PathBuf,
    messages: Source,
    configured: Option<RecordedConfiguration>,
}

/// Where messages come from.
enum Source {
    File(Box<MessageReader<BufReader<CheckedFile>>>),
    Stored(std::vec::IntoIter<Found>),
    Span(Box<Messages>),
}

/// How both sides were configured, as it was recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedConfiguration {
    /// What the robot simulator was asked.
    pub robot_request: v1::RobotSimServiceConfigureRequest,
    /// What it replied.
    pub robot_response: v1::RobotSimServiceConfigureResponse,
    /// What the network simulator was asked.
    pub net_request: v1::NetSimServiceConfigureRequest,
    /// What it replied.
    pub net_response: v1::NetSimServiceConfigureResponse,
}

/// A step as it was recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedStep {
    /// Orders to the network that took effect in it, from the timeline of the experiment.
    pub commands: Vec<v1::MoteCommand>,
    /// The robots' reply.
    pub robots: v1::RobotSimServiceStepResponse,
    /// The network's reply.
    pub net: v1::NetSimServiceStepResponse,
    /// Step, time and digest that both agreed on.
    pub barrier: v1::RobotSimServiceBarrierResponse,
}

/// Why a recording cannot be read, or not further.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be opened. Likely `output.mcap = false`, or not the directory of a run.
    #[error("cannot open {}: {source}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// It is not what the run wrote, or that cannot be told.
    #[error(transparent)]
    Unbelieved {
        /// Why.
        source: Box<ResultError>,
    },
    /// The file is damaged or ends too early. What was read before is right.
    #[error("{} is damaged or truncated: {}", path.display(), mcap_in_words(source))]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What the reader says.
        source: Box<mcap::McapError>,
    },
    /// A message is not what its topic says.
    #[error("{}: a message on {topic} cannot be decoded: {source}", path.display())]
    Decode {
        /// The file.
        path: PathBuf,
        /// The topic.
        topic: &'static str,
        /// What the decoder says.
        source: prost::DecodeError,
    },
    /// A message holds a value that no run records.
    #[error("{}: {field}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The field, and what is wrong with it.
        field: String,
    },
    /// A message is missing, or on a topic that no run writes. Likely a file of another program.
    #[error("{}: expected a message on {expected}, got {got}", path.display())]
    Unexpected {
        /// The file.
        path: PathBuf,
        /// The topic expected.
        expected: &'static str,
        /// The topic found, or `the end`.
        got: String,
    },
}

impl ReadError {
    /// What the reader of MCAP says of a file.
    pub(crate) fn of_mcap(path: &Path, source: mcap::McapError) -> Self {
        let path = path.to_owned();
        match source {
            mcap::McapError::Io(source) if Changed::of(&source).is_some() => {
                Self::Unbelieved { source: Box::new(ResultError::of_reading(&path, source)) }
            }
            source => Self::Damaged { path, source: Box::new(source) },
        }
    }
}

/// What is wrong with a recording. The library's own words of an error of the system do not say which.
pub(crate) fn mcap_in_words(error: &mcap::McapError) -> String {
    match error {
        mcap::McapError::Io(source) => source.to_string(),
        error => error.to_string(),
    }
}

/// The recording of a result, and its path.
pub(crate) fn log_of(run: &ResultFolder) -> Result<(PathBuf, CheckedFile), ReadError> {
    let file = run.file(LOG_FILE).map_err(|error| match error {
        ResultError::Read { path, source } => ReadError::Open { path, source },
        error => ReadError::Unbelieved { source: Box::new(error) },
    })?;
    Ok((run.path().join(LOG_FILE), file))
}

/// A message: its topic, if runs write such, and its bytes.
pub(crate) type Found = (Option<Topic>, Vec<u8>);

impl RunReader {
    /// Opens a recording without checking it against `provenance.json`, given its directory: the recording of an unfinished run, or one
    /// that [`verify()`](super::verify()) checks. All other code opens a [`ResultFolder`](super::result::ResultFolder).
    ///
    /// # Errors
    ///
    /// No such file, or not the recording of a run.
    pub(crate) fn open(run: &Path) -> Result<Self, ReadError> {
        let path = run.join(LOG_FILE);
        let file = CheckedFile::unchecked(&path)
            .map_err(|source| ReadError::Open { path: path.clone(), source })?;
        Self::of_file(path, file)
    }

    /// Opens the recording of a result.
    ///
    /// # Errors
    ///
    /// No such file, not the recording of a run, or one that was changed. What is read later is checked then.
    pub fn of(run: &ResultFolder) -> Result<Self, ReadError> {
        let (path, file) = log_of(run)?;
        Self::of_file(path, file)
    }

    /// Opens a recording and reads how both sides were configured.
    pub(crate) fn of_file(path: PathBuf, file: CheckedFile) -> Result<Self, ReadError> {
        let options = LinearReaderOptions::default()
            .with_prevalidate_chunk_crcs(true)
            .with_validate_data_section_crc(true)
            .with_validate_summary_section_crc(true)
            .with_check_finishes_after_end_magic(true)
            .with_record_length_limit(RECORDING_BYTES.most as usize);
        let messages = MessageReader::new_with_options(BufReader::new(file), options);
        Self { path, messages: Source::File(Box::new(messages)), configured: None }.begun()
    }

    /// Reads messages that a checkpoint has stored beside the file at `path`: from the beginning of the run, or from the beginning
    /// of a step.
    pub(crate) fn stored(
        path: PathBuf,
        messages: Vec<(Topic, Vec<u8>)>,
    ) -> Result<Self, ReadError> {
        let begins =
            messages.first().is_some_and(|(topic, _)| *topic == Topic::RobotConfigureRequest);
        let messages: Vec<Found> =
            messages.into_iter().map(|(topic, data)| (Some(topic), data)).collect();
        let reader =
            Self { path, messages: Source::Stored(messages.into_iter()), configured: None };
        if begins { reader.begun() } else { Ok(reader) }
    }

    /// Reads the steps of a span.
    pub(crate) fn of_span(path: PathBuf, messages: Messages) -> Self {
        Self { path, messages: Source::Span(Box::new(messages)), configured: None }
    }

    /// Reads how both sides were configured, which every recording begins with.
    fn begun(self) -> Result<Self, ReadError> {
        let mut reader = self;
        if let Some(robot_request) = reader.next_or_end(Topic::RobotConfigureRequest)? {
            reader.configured = Some(RecordedConfiguration {
                robot_request,
                robot_response: reader.next(Topic::RobotConfigureResponse)?,
                net_request: reader.next(Topic::NetConfigureRequest)?,
                net_response: reader.next(Topic::NetConfigureResponse)?,
            });
        }
        Ok(reader)
    }

    /// How both sides were configured; `None` of a run that ended before that.
    #[must_use]
    pub fn configured(&self) -> Option<&RecordedConfiguration> {
        self.configured.as_ref()
    }

    /// The next step; `None` after the last.
    ///
    /// # Errors
    ///
    /// The file is damaged or cut off here.
    pub fn next_step(&mut self) -> Result<Option<RecordedStep>, ReadError> {
        let Some((topic, data)) = self.next_message()? else { return Ok(None) };
        let (commands, robots) = if topic == Some(Topic::NetCommand) {
            let request: v1::NetSimServiceCommandRequest = self.decode(Topic::NetCommand, &data)?;
            (request.commands, self.next(Topic::RobotStep)?)
        } else if topic == Some(Topic::RobotStep) {
            (Vec::new(), self.decode(Topic::RobotStep, &data)?)
        } else {
            let got = topic.map_or("another topic", |topic| topic.names().0);
            return Err(self.unexpected(Topic::RobotStep, got));
        };
        let net = self.next(Topic::NetStep)?;
        let barrier = self.next(Topic::Barrier)?;
        Ok(Some(RecordedStep { commands, robots, net, barrier }))
    }

    fn next<M: Message + Default>(&mut self, topic: Topic) -> Result<M, ReadError> {
        self.next_or_end(topic)?.ok_or_else(|| self.unexpected(topic, "the end"))
    }

    fn next_or_end<M: Message + Default>(&mut self, topic: Topic) -> Result<Option<M>, ReadError> {
        match self.next_message()? {
            None => Ok(None),
            Some((Some(found), data)) if found == topic => self.decode(topic, &data).map(Some),
            Some((found, _)) => {
                let got = found.map_or("another topic", |found| found.names().0);
                Err(self.unexpected(topic, got))
            }
        }
    }

    /// The next message.
    fn next_message(&mut self) -> Result<Option<Found>, ReadError> {
        let next = match &mut self.messages {
            Source::Stored(messages) => return Ok(messages.next()),
            Source::Span(messages) => messages.next(),
            Source::File(messages) => messages.next().map(|message| {
                message.map(|message| (Topic::named(&message.channel.topic), message.data.to_vec()))
            }),
        };
        next.transpose().map_err(|source| ReadError::of_mcap(&self.path, source))
    }

    fn decode<M: Message + Default>(&self, topic: Topic, data: &[u8]) -> Result<M, ReadError> {
        M::decode(data).map_err(|source| ReadError::Decode {
            path: self.path.clone(),
            topic: topic.names().0,
            source,
        })
    }

    fn unexpected(&self, expected: Topic, got: &str) -> ReadError {
        ReadError::Unexpected {
            path: self.path.clone(),
            expected: expected.names().0,
            got: got.to_owned(),
        }
    }
}
