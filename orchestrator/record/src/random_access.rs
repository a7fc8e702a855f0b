//! Reads the steps of any span of a recording, without reading what is before it.

use super::read::{Found, ReadError, RunReader, log_of};
use super::{StepRecord, log::Topic, values};
use input::checked::CheckedFile;
use input::result::ResultFolder;
use mcap::sans_io::indexed_reader::{IndexedReadEvent, IndexedReader, IndexedReaderOptions};
use mcap::sans_io::summary_reader::{SummaryReadEvent, SummaryReader, SummaryReaderOptions};
use proto::bounds::RECORDING_BYTES;
use proto::exchange::Configured;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::PathBuf;

/// A complete recording, with the index that its file ends with.
pub struct Recording {
    path: PathBuf,
    file: CheckedFile,
    summary: mcap::Summary,
    configured: Configured,
    end_ns: u64,
    n_steps: u64,
}

impl Recording {
    /// Reads the index of a recording, and how both sides were configured.
    ///
    /// # Errors
    ///
    /// Not the recording of a run, one that was changed, or one that ends before its index, as that of a run that was killed.
    pub fn of(run: &ResultFolder) -> Result<Self, ReadError> {
        let (path, file) = log_of(run)?;
        let configured = RunReader::of_file(path.clone(), file.clone())?.configured().cloned();
        let configured = configured.ok_or_else(|| ReadError::Unexpected {
            path: path.clone(),
            expected: Topic::RobotConfigureRequest.names().0,
            got: "the end".to_owned(),
        })?;
        let configured = values::configured(configured).map_err(|invalid| ReadError::Invalid {
            path: path.clone(),
            field: invalid.to_string(),
        })?;
        let damaged = |source| ReadError::of_mcap(&path, source);
        let summary = summary(file.clone()).map_err(damaged)?;
        let stats =
            summary.stats.as_ref().ok_or_else(|| damaged(mcap::McapError::UnexpectedEof))?;
        let barrier = Topic::Barrier.names().0;
        let barriers = summary.channels.values().find(|channel| channel.topic == barrier);
        let n_steps = barriers
            .and_then(|channel| stats.channel_message_counts.get(&channel.id))
            .copied()
            .unwrap_or_default();
        let end_ns = stats.message_end_time;
        Ok(Self { path, file, summary, configured, end_ns, n_steps })
    }

    /// How both sides were configured.
    #[must_use]
    pub fn configured(&self) -> &Configured {
        &self.configured
    }

    /// The end of the last step (ns).
    #[must_use]
    pub fn end_ns(&self) -> u64 {
        self.end_ns
    }

    /// The number of steps.
    #[must_use]
    pub fn n_steps(&self) -> u64 {
        self.n_steps
    }

    /// The steps that end after `after_ns` and not after `until_ns`, in order.
    ///
    /// # Errors
    ///
    /// Its index is damaged.
    pub fn steps(&self, after_ns: u64, until_ns: u64) -> Result<Steps, ReadError> {
        let file = self.file.clone();
        let options = IndexedReaderOptions::new()
            .starting_after(after_ns)
            .ending_at(until_ns)
            .with_record_length_limit(RECORDING_BYTES.most as usize);
        let reader = IndexedReader::new_with_options(&self.summary, options)
            .map_err(|source| ReadError::of_mcap(&self.path, source))?;
        let topics = self.summary.channels.iter();
        let topics = topics.map(|(id, channel)| (*id, Topic::named(&channel.topic)));
        let messages = Messages { file, reader, topics: topics.collect(), chunk: Vec::new() };
        let reader = RunReader::of_span(self.path.clone(), messages);
        let n_agents = self.configured.robots_request.experiment.agent_count;
        Ok(Steps { path: self.path.clone(), reader, n_agents })
    }
}

/// Steps of a span. See [`Recording::steps`].
pub struct Steps {
    path: PathBuf,
    reader: RunReader,
    n_agents: usize,
}

impl Steps {
    /// The next step; `None` after the last.
    ///
    /// # Errors
    ///
    /// The file is damaged here.
    pub fn next_step(&mut self) -> Result<Option<StepRecord>, ReadError> {
        let Some(step) = self.reader.next_step()? else { return Ok(None) };
        let step = values::step(step, self.n_agents).map_err(|invalid| ReadError::Invalid {
            path: self.path.clone(),
            field: invalid.to_string(),
        })?;
        Ok(Some(step))
    }
}

/// Messages of a span, in the order of time.
pub(crate) struct Messages {
    file: CheckedFile,
    reader: IndexedReader,
    topics: Vec<(u16, Option<Topic>)>,
    chunk: Vec<u8>,
}

impl Messages {
    /// The next one: its topic, if runs write such, and its bytes.
    pub(crate) fn next(&mut self) -> Option<mcap::McapResult<Found>> {
        loop {
            let (offset, length) = match self.reader.next_event()? {
                Err(error) => return Some(Err(error)),
                Ok(IndexedReadEvent::Message { header, data }) => {
                    let topic = self.topics.iter().find(|(id, _)| *id == header.channel_id);
                    return Some(Ok((topic.and_then(|(_, topic)| *topic), data.to_vec())));
                }
                Ok(IndexedReadEvent::ReadChunkRequest { offset, length }) => (offset, length),
            };
            self.chunk.resize(length, 0);
            let read = self
                .file
                .seek(SeekFrom::Start(offset))
                .and_then(|_| self.file.read_exact(&mut self.chunk))
                .map_err(mcap::McapError::from)
                .and_then(|()| self.reader.insert_chunk_record_data(offset, &self.chunk));
            if let Err(error) = read {
                return Some(Err(error));
            }
        }
    }
}

/// The index at the end of a file.
fn summary(mut file: CheckedFile) -> Result<mcap::Summary, mcap::McapError> {
    let options =
        SummaryReaderOptions::default().with_record_length_limit(RECORDING_BYTES.most as usize);
    let mut reader = SummaryReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event? {
            SummaryReadEvent::ReadRequest(n_bytes) => {
                let read = file.read(reader.insert(n_bytes))?;
                reader.notify_read(read);
            }
            SummaryReadEvent::SeekRequest(to) => {
                let position = file.seek(to)?;
                reader.notify_seeked(position);
            }
        }
    }
    reader.finish().ok_or(mcap::McapError::UnexpectedEof)
}
