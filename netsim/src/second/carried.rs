//! Frames that a second medium carried in a step, and who received them.

use bytes::Bytes;
use proto::ids::MoteId;

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
    /// When it began (ns).
    pub sent_ns: u64,
    /// When its last bit arrived (ns).
    pub end_ns: u64,
    /// What it carried.
    pub payload: Bytes,
    /// Robots that received it, ascending, with the power (dBm).
    pub receivers: Vec<(u32, f32)>,
}

impl Carried {
    /// When the first reception is complete (ns).
    #[must_use]
    pub fn first_ns(&self) -> Option<u64> {
        let received = self.frames.iter().filter(|frame| !frame.receivers.is_empty());
        received.map(|frame| frame.end_ns).min()
    }
}
