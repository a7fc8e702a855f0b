//! Frames of a span of a recording, in the order of time, however long it is.

use ::view::recorded::{MOST_FRAMES, RecordedRun};
use ::view::view;
use record::read::ReadError;
use std::collections::VecDeque;

/// Reads the frames of a span part by part.
pub struct FrameSpan<'a> {
    run: &'a RecordedRun,
    /// Frames that were read and not yet given.
    ready: VecDeque<view::Frame>,
    /// Time and step of the last frame that was read.
    last: Option<(u64, u64)>,
    /// No frame ends between the last one and here (ns).
    reached_ns: u64,
    until_ns: u64,
    /// How much is read together (ns).
    part_ns: u64,
    /// Most frames of a part.
    most: usize,
}

impl<'a> FrameSpan<'a> {
    /// From the last frame that is not after `from_ns`, until `until_ns`, in about [`MOST_FRAMES`] frames.
    #[must_use]
    pub fn overview(run: &'a RecordedRun, from_ns: u64, until_ns: u64) -> Self {
        let length_ns = until_ns.min(run.run().end_ns).saturating_sub(from_ns);
        Self::new(run, from_ns, until_ns, length_ns.max(1), MOST_FRAMES - 1)
    }

    /// From the last frame that is not after `from_ns`, until `until_ns`: every step, or where more than
    /// four steps take `spacing_ns`, about four frames in that time.
    #[must_use]
    pub fn every(run: &'a RecordedRun, from_ns: u64, until_ns: u64, spacing_ns: u64) -> Self {
        let part_ns = spacing_ns.max(1).saturating_mul(MOST_FRAMES as u64 / 4);
        Self::new(run, from_ns, until_ns, part_ns, MOST_FRAMES)
    }

    fn new(run: &'a RecordedRun, from_ns: u64, until_ns: u64, part_ns: u64, most: usize) -> Self {
        let until_ns = until_ns.min(run.run().end_ns);
        let ready = VecDeque::new();
        Self { run, ready, last: None, reached_ns: from_ns, until_ns, part_ns, most }
    }

    /// The next frame; `None` after the last.
    ///
    /// # Errors
    ///
    /// The recording is damaged.
    pub fn next_frame(&mut self) -> Result<Option<view::Frame>, ReadError> {
        self.read()?;
        Ok(self.ready.pop_front())
    }

    /// The next frame, if it is not after `time_ns`.
    ///
    /// # Errors
    ///
    /// The recording is damaged.
    pub fn next_until(&mut self, time_ns: u64) -> Result<Option<view::Frame>, ReadError> {
        self.read()?;
        let is_due = self.ready.front().is_some_and(|frame| frame.time_ns <= time_ns);
        Ok(if is_due { self.ready.pop_front() } else { None })
    }

    /// Reads until a frame is ready, or the span ends.
    fn read(&mut self) -> Result<(), ReadError> {
        while self.ready.is_empty() && (self.last.is_none() || self.reached_ns < self.until_ns) {
            let from_ns = self.last.map_or(self.reached_ns, |(time_ns, _)| time_ns);
            let part_end_ns = self.reached_ns.saturating_add(self.part_ns).min(self.until_ns);
            // As dense as in a whole part.
            let length_ns = u128::from(part_end_ns - from_ns);
            let most = (self.most as u128 * length_ns).div_ceil(u128::from(self.part_ns));
            let frames = self.run.frames(from_ns, part_end_ns, self.most.min(most as usize))?;
            let last_step = self.last.map(|(_, step)| step);
            self.ready = frames
                .into_iter()
                .filter(|frame| last_step.is_none_or(|last_step| last_step < frame.step))
                .collect();
            match self.ready.back() {
                // A reply may end early, when it has many bytes.
                Some(frame) => {
                    self.last = Some((frame.time_ns, frame.step));
                    self.reached_ns = frame.time_ns;
                }
                None => self.reached_ns = part_end_ns,
            }
        }
        Ok(())
    }
}
