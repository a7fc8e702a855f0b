//! Frames that wait at a mote.

use super::Tsch;
use crate::mac::queue::{N_NEWER_MOST, Queue, Queued};

impl Tsch {
    /// The queue of frames that wait for a cell.
    #[must_use]
    pub fn queue(&self) -> &Queue {
        &self.queue
    }

    /// Packets that wait or are in flight.
    #[must_use]
    pub fn queue_len(&self) -> usize {
        self.queue.len() + usize::from(self.in_flight)
    }

    /// A frame is to be sent.
    ///
    /// # Errors
    ///
    /// The queue is full: the frame comes back. Otherwise a frame that had to make room, if one had.
    #[expect(clippy::result_large_err, reason = "the refused frame returns to whoever had it")]
    pub fn enqueue(&mut self, frame: Queued) -> Result<Option<Queued>, Queued> {
        self.queue.push(frame, usize::from(self.in_flight))
    }

    /// Asks again which slotframe each frame that waits shall use. The swarm's payloads stay where they are.
    pub(crate) fn place_anew(&mut self, slotframe_of: impl Fn(&Queued) -> Option<u8>) {
        self.queue.place_anew(slotframe_of);
    }

    /// Takes frames that wait out of the queue.
    pub fn take_where(&mut self, which: impl FnMut(&Queued) -> bool) -> Vec<Queued> {
        self.queue.take_where(which)
    }

    /// Takes frames out of the queue that have been sent and must not be sent again: so many newer ones have gone out that
    /// whoever has received them would take these, by their eight bits, for newer ones still.
    pub fn take_outrun(&mut self) -> Vec<Queued> {
        let newest = self.next_number.wrapping_sub(1);
        self.queue.take_where(|frame| {
            frame.n_attempts != 0 && N_NEWER_MOST < newest.wrapping_sub(frame.number)
        })
    }
}
