//! What a run comes to, without leaving anything on disk.

use super::writer::{Event, RunWriter, Step};
use super::{
    Configured, Ending, OutputConfig, RecordError, Recorder, RunHeader, StepRecord, summary,
};
use experiment::output::Links;
use serde_json::Value;
use std::path::Path;

/// What the steps of a run are given to.
pub trait Steps {
    /// Takes a step.
    ///
    /// # Errors
    ///
    /// What went wrong with this or anything taken before.
    fn step(&mut self, record: StepRecord<'_>) -> Result<(), RecordError>;
}

impl Steps for Recorder {
    fn step(&mut self, record: StepRecord<'_>) -> Result<(), RecordError> {
        Self::step(self, record)
    }
}

/// Measures a run as [`Recorder`] does, and writes nothing.
pub struct Measurer {
    header: RunHeader,
    writer: RunWriter,
}

impl Measurer {
    /// Begins with both sides configured.
    ///
    /// # Errors
    ///
    /// A malformed reply.
    pub fn new(mut header: RunHeader, configured: Configured) -> Result<Self, RecordError> {
        header.output = NOTHING;
        let mut writer = RunWriter::create(Path::new(""), &header)?;
        writer.handle(Event::Configured(Box::new(configured)))?;
        Ok(Self { header, writer })
    }

    /// The summary.
    ///
    /// # Errors
    ///
    /// None that a record without files has.
    pub fn finish(self, ending: &Ending) -> Result<Value, RecordError> {
        Ok(summary::of_run(&self.header, ending, &self.writer.finish()?))
    }
}

impl Steps for Measurer {
    fn step(&mut self, record: StepRecord<'_>) -> Result<(), RecordError> {
        let StepRecord { step, time_ns, robots, net, commands, digest } = record;
        let (robots, net, commands) = (robots.clone(), net.clone(), commands.to_vec());
        let step = Step { step, time_ns, robots, net, commands, digest };
        self.writer.handle(Event::Steps(vec![step]))
    }
}

/// No file at all.
const NOTHING: OutputConfig = OutputConfig {
    mcap: false,
    steps: false,
    transmissions: false,
    packets: false,
    motes: false,
    motes_every_ns: None,
    schedule: false,
    neighbours: false,
    pcap: false,
    links: Links::None,
    every_steps: 1,
    report: false,
};
