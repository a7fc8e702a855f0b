//! Slots in which no cell receives, found without looking at slotframes.

use super::Slotframe;
use physics::asn::Asn;
use serde::{Deserialize, Serialize};

/// Slots of all slotframes together, where these are as long as each other (RFC 9033, § 2).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Silence {
    /// Length of the slotframes; 0: they differ, nothing is known.
    slots: u16,
    /// By slot, a bit: some slotframe receives.
    receives: Vec<u64>,
}

impl Silence {
    /// Looks at slotframes anew.
    pub(super) fn index(&mut self, frames: &[Slotframe]) {
        self.receives.clear();
        self.slots = frames.first().map_or(0, |frame| frame.slots);
        if frames.iter().any(|frame| frame.slots != self.slots) {
            self.slots = 0;
            return;
        }
        self.receives.resize(usize::from(self.slots).div_ceil(64), 0);
        for frame in frames {
            let slots = (0..).zip(&frame.receives).filter(|(_, receives)| **receives);
            for (slot, _) in slots {
                let _: usize = slot;
                self.receives[slot / 64] |= 1 << (slot % 64);
            }
        }
    }

    /// Length and bits, if the slotframes are as long as each other.
    pub(super) fn listening_slots(&self) -> Option<(u16, &[u64])> {
        (self.slots != 0).then_some((self.slots, &self.receives))
    }

    /// Whether it is known that nothing receives in an absolute slot.
    #[inline]
    pub(super) fn covers(&self, asn: Asn) -> bool {
        if self.slots == 0 {
            return false;
        }
        let slot = (asn % u64::from(self.slots)) as usize;
        self.receives[slot / 64] & 1 << (slot % 64) == 0
    }
}
