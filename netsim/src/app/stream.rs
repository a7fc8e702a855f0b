//! Random draws of one application of one mote.

use proto::ids::MoteId;
use proto::rng::{Draws, Purpose, uniform};
use proto::time::SimDuration;
use serde::{Deserialize, Serialize};

/// Draws of one application of one mote, in sequence. The k-th number depends on the seed, the mote, the application and k only.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stream {
    seed: u64,
    mote: MoteId,
    app: u32,
    n_drawn: u64,
}

impl Stream {
    /// Draws of application `app` of mote `mote`.
    #[must_use]
    pub fn new(seed: u64, mote: MoteId, app: u32) -> Self {
        Self { seed, mote, app, n_drawn: 0 }
    }

    /// From the next number on, the numbers that another seed has at the same places of the stream.
    pub fn reseed(&mut self, seed: u64) {
        self.seed = seed;
    }

    fn word(&mut self) -> u64 {
        let k = self.n_drawn;
        self.n_drawn += 1;
        let draws = Draws::new(self.seed, Purpose::Traffic);
        draws.words(u64::from(self.mote.0), u64::from(self.app), k)[0]
    }

    /// A whole number from 0 to n − 1; n at least 1.
    pub fn below(&mut self, n: u64) -> u64 {
        ((u128::from(self.word()) * u128::from(n)) >> 64) as u64
    }

    /// Uniform duration from `low` to `high`, both included.
    pub fn duration(&mut self, low: SimDuration, high: SimDuration) -> SimDuration {
        low + SimDuration::from_ns(self.below(high.saturating_sub(low).ns() + 1))
    }

    /// Exponential duration with this mean: −m ln(1 − u).
    pub fn exponential(&mut self, mean: SimDuration) -> SimDuration {
        exponential(uniform(self.word()), mean)
    }
}

/// Exponential duration with this mean from u, uniform in [0, 1): −m ln(1 − u). Since u has 53 bits, it is less than 37 means.
#[must_use]
pub fn exponential(u: f64, mean: SimDuration) -> SimDuration {
    // 1 - u lies in (0, 1]: the logarithm is finite.
    SimDuration::from_ns((-libm::log(1.0 - u) * mean.ns() as f64) as u64)
}
