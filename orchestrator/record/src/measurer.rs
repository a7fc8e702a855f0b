//! What a run comes to, without leaving anything on disk.

use super::run_summary::RunSummary;
use super::writer::{Event, RunWriter};
use super::{Ending, OutputConfig, RecordError, RunHeader, StepRecord, summary};
use experiment::output::Links;
use proto::exchange::Configured;
use std::path::Path;

/// Measures a run as [`Recorder`](super::Recorder) does, and writes nothing.
pub struct Measurer {
    header: RunHeader,
    writer: RunWriter,
}

impl Measurer {
    /// Begins with both sides configured.
    ///
    /// # Errors
    ///
    /// None that a record without files has.
    pub fn new(mut header: RunHeader, configured: Configured) -> Result<Self, RecordError> {
        header.output = NOTHING;
        let mut writer = RunWriter::create(Path::new(""), &header)?;
        writer.handle(Event::Configured(Box::new(configured)))?;
        Ok(Self { header, writer })
    }

    /// Takes a step.
    ///
    /// # Errors
    ///
    /// What went wrong with this or anything taken before.
    pub fn step(&mut self, record: StepRecord) -> Result<(), RecordError> {
        self.writer.handle(Event::Steps(vec![record]))
    }

    /// The summary.
    ///
    /// # Errors
    ///
    /// None that a record without files has.
    pub fn finish(self, ending: &Ending) -> Result<RunSummary, RecordError> {
        Ok(summary::of_run(&self.header, ending, &self.writer.finish()?))
    }
}

/// No file at all.
const NOTHING: OutputConfig = OutputConfig {
    mcap: false,
    scene: false,
    scene_every_s: None,
    steps: false,
    transmissions: false,
    packets: false,
    motes: false,
    motes_every_s: None,
    schedule: false,
    neighbours: false,
    frames: false,
    pcap: false,
    links: Links::None,
    every_steps: 1,
    report: false,
};
