//! Frames that a second medium carried in a step, and who received them.

use bytes::Bytes;
use proto::ids::MoteId;
use proto::time::SimTime;

/// What a second medium carried in a step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Carried {
    /// Frames that ended, in any order.
    pub frames: Vec<CarriedFrame>,
}

/// A frame that ended in a step.
#[derive(Clone, Debug, PartialEq)]
pub struct CarriedFrame {
    /// Number of the robot that sent it.
    pub sender: MoteId,
    /// When it began.
    pub sent: SimTime,
    /// When its last bit arrived.
    pub end: SimTime,
    /// What it carried.
    pub payload: Bytes,
    /// Robots that received it, ascending, with the power (dBm).
    pub receivers: Vec<(u32, f32)>,
}

impl Carried {
    /// When the first reception is complete.
    #[must_use]
    pub fn first(&self) -> Option<SimTime> {
        let received = self.frames.iter().filter(|frame| !frame.receivers.is_empty());
        received.map(|frame| frame.end).min()
    }
}
