//! Random numbers for protocol machines, where a sequence is natural: back-off, jitter, the choice of cells.

use proto::ids::MoteId;
use proto::rng::{Draws, Purpose, uniform};
use proto::time::SimDuration;
use serde::{Deserialize, Serialize};

/// The draws of one mote for one purpose, in sequence. Its k-th number depends on the seed, the purpose, the mote and k
/// only: neither on other motes nor on the draws of other layers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Dice {
    seed: u64,
    purpose: Purpose,
    mote: MoteId,
    n_drawn: u64,
}

impl Dice {
    /// Draws of `mote` for `purpose`.
    #[must_use]
    pub fn new(seed: u64, purpose: Purpose, mote: MoteId) -> Self {
        Self { seed, purpose, mote, n_drawn: 0 }
    }

    /// From the next number on, the numbers that another seed has at the same places of the stream.
    pub fn reseed(&mut self, seed: u64) {
        self.seed = seed;
    }

    /// The next 64 random bits of the stream.
    pub fn word(&mut self) -> u64 {
        let k = self.n_drawn;
        self.n_drawn += 1;
        Draws::new(self.seed, self.purpose).words(u64::from(self.mote.0), 0, k)[0]
    }

    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        uniform(self.word())
    }

    /// Uniform in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// A whole number from 0 to n − 1; n at least 1.
    pub fn below(&mut self, n: u64) -> u64 {
        ((u128::from(self.word()) * u128::from(n)) >> 64) as u64
    }

    /// Uniform duration in [low, high).
    pub fn duration(&mut self, low: SimDuration, high: SimDuration) -> SimDuration {
        low + SimDuration::from_ns(self.below((high - low).ns().max(1)))
    }

    /// Puts a slice into random order (Fisher and Yates).
    pub(crate) fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            items.swap(i, self.below(i as u64 + 1) as usize);
        }
    }
}
