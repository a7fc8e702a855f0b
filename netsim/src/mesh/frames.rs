//! The frames of a step, for the record.

use super::scratch::Sending;
use crate::mac::kind::FrameKind;
use crate::mac::tsch::Outgoing;
use crate::wire::Eui64;
use proto::ids::MoteId;
use proto::time::SimTime;
use proto::types::{EVERYONE, FrameOutcome, Frames};

/// Frames since they were last taken, if they are wanted.
#[derive(Clone, Debug)]
pub(crate) struct FrameLog {
    frames: Option<Frames>,
}

impl FrameLog {
    /// Keeps frames, or not.
    #[must_use]
    pub(crate) fn new(wanted: bool) -> Self {
        Self { frames: wanted.then(empty) }
    }

    /// All that was sent in a slot, which began at `begins`, and what became of it. `mote_of`: the mote that has an address.
    pub(super) fn add(
        &mut self,
        begins: SimTime,
        sending: &[Sending],
        mote_of: impl Fn(Eui64) -> Option<MoteId>,
    ) {
        let Some(frames) = &mut self.frames else { return };
        let first = frames.len();
        for sent in sending {
            let frame = sent.frame();
            let (packet, attempt) = match &sent.transmission.outgoing {
                Outgoing::Beacon => (0, 1),
                Outgoing::Frame(queued) => (queued.packet, queued.n_attempts),
            };
            frames.sent_ns.push(begins.ns());
            frames.sender.push(sent.sender.0);
            frames
                .destination
                .push(frame.destination.and_then(&mote_of).map_or(EVERYONE, |mote| mote.0));
            frames.channel.push(sent.transmission.channel.into());
            let at = sent.transmission.at;
            frames.channel_offset.push(at.map_or(u32::MAX, |at| at.cell.channel.into()));
            frames.kind.push(FrameKind::of(&frame.content) as u32);
            frames.length_bytes.push(sent.psdu_bytes.into());
            frames.packet.push(packet);
            frames.attempt.push(attempt.into());
            frames.n_received.push(sent.n_received);
            frames.n_missed.push(sent.n_missed);
            frames.outcome.push(match (frame.destination, sent.answered_by) {
                (None, _) => FrameOutcome::Broadcast,
                (Some(_), None) => FrameOutcome::Lost,
                (Some(_), Some(_)) if sent.acknowledged => FrameOutcome::Acknowledged,
                (Some(_), Some(_)) => FrameOutcome::NotAcknowledged,
            });
        }
        debug_assert!(frames.sender[first..].is_sorted(), "motes are asked in their order");
    }

    /// All frames since this was last asked.
    pub(crate) fn take(&mut self) -> Option<Frames> {
        self.frames.as_mut().map(|frames| std::mem::replace(frames, empty()))
    }
}

fn empty() -> Frames {
    Frames {
        kinds: FrameKind::ALL.map(|kind| kind.name().to_owned()).to_vec(),
        ..Frames::default()
    }
}
