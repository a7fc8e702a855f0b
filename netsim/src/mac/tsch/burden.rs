//! What effects lay on the MAC of a mote.

use super::Tsch;
use crate::mac::effect::Burden;
use crate::mac::ration::Ration;
use proto::rng::{Draws, Purpose};
use proto::time::{SimDuration, SimTime};

impl Tsch {
    /// The same MAC under a burden.
    #[must_use]
    pub(crate) fn burdened(mut self, burden: &Burden, seed: u64) -> Self {
        if burden.max_drift_ppm != 0.0 {
            let entity = u64::from(self.mote.0);
            let draw = Draws::new(seed, Purpose::ClockDrift).uniform(entity, 0, 0);
            self.clock = self.clock.faster((2.0 * draw - 1.0) * burden.max_drift_ppm);
        }
        if let Some(frames) = burden.queue_frames {
            self.queue = self.queue.at_most(frames);
        }
        self.ration = burden.duty.map(Ration::new);
        self
    }

    /// A frame was on the air for so long.
    #[inline]
    pub(crate) fn spend_airtime(&mut self, airtime: SimDuration, now: SimTime) {
        if let Some(ration) = &mut self.ration {
            ration.spend(airtime, now);
        }
    }

    /// Whether its airtime is used up.
    #[inline]
    pub(super) fn is_silenced(&self, now: SimTime) -> bool {
        self.ration.is_some_and(|ration| !ration.allows(now))
    }
}
