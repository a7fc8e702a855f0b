//! Back-off in shared cells: TSCH CSMA-CA, IEEE Std 802.15.4-2015, 6.2.5.3.

use crate::dice::Dice;
use crate::wire::Eui64;
use serde::{Deserialize, Serialize};

/// Back-off of a mote: an exponent and a number of cells to wait for each neighbour it has failed to reach.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Backoff {
    min_exponent: u8,
    max_exponent: u8,
    /// Ascending by neighbour; those not listed are not backed off.
    of: Vec<(Eui64, Wait)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Wait {
    exponent: u8,
    cells: u64,
}

impl Backoff {
    /// Exponents from `min_exponent` (macMinBe) to `max_exponent` (macMaxBe).
    #[must_use]
    pub(crate) fn new(min_exponent: u8, max_exponent: u8) -> Self {
        Self { min_exponent, max_exponent, of: Vec::new() }
    }

    /// A shared cell comes up in which a frame for `neighbour` might be sent: whether it may. If not, one cell less is
    /// left to wait.
    pub(crate) fn passes(&mut self, neighbour: Eui64) -> bool {
        match self.find(neighbour) {
            Ok(place) if self.of[place].1.cells != 0 => {
                self.of[place].1.cells -= 1;
                false
            }
            _ => true,
        }
    }

    /// A frame was not acknowledged in a shared cell: waits for 0 to 2^BE − 1 shared cells, BE rising from its least
    /// value by one with every further failure.
    pub(crate) fn fail(&mut self, neighbour: Eui64, dice: &mut Dice) {
        let exponent = match self.find(neighbour) {
            Ok(place) => (self.of[place].1.exponent + 1).min(self.max_exponent),
            Err(_) => self.min_exponent,
        };
        let wait = Wait { exponent, cells: dice.below(1 << exponent) };
        match self.find(neighbour) {
            Ok(place) => self.of[place].1 = wait,
            Err(place) => self.of.insert(place, (neighbour, wait)),
        }
    }

    /// A frame was acknowledged in a shared cell, or the last one for this neighbour was acknowledged in another: no
    /// back-off any more.
    pub(crate) fn succeed(&mut self, neighbour: Eui64) {
        if let Ok(place) = self.find(neighbour) {
            self.of.remove(place);
        }
    }

    /// No back-off for anybody.
    pub(crate) fn clear(&mut self) {
        self.of.clear();
    }

    fn find(&self, neighbour: Eui64) -> Result<usize, usize> {
        self.of.binary_search_by_key(&neighbour, |entry| entry.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::ids::MoteId;
    use proto::rng::Purpose;

    #[test]
    fn t6_windows_double_from_1_to_127_cells() {
        let neighbour = Eui64::of_mote(MoteId(1));
        let mut longest = [0; 9];
        for seed in 0..2000 {
            let mut dice = Dice::new(seed, Purpose::Mac, MoteId(0));
            let mut backoff = Backoff::new(1, 7);
            for longest in &mut longest {
                backoff.fail(neighbour, &mut dice);
                let mut waited = 0;
                while !backoff.passes(neighbour) {
                    waited += 1;
                }
                *longest = waited.max(*longest);
            }
        }
        // 2000 draws: the greatest of a window of 128 is missed by 1 seed in 6 million.
        assert_eq!(longest, [1, 3, 7, 15, 31, 63, 127, 127, 127]);
    }

    #[test]
    fn success_ends_it_and_neighbours_do_not_share_it() {
        let [a, b] = [1, 2].map(MoteId).map(Eui64::of_mote);
        let mut dice = Dice::new(1, Purpose::Mac, MoteId(0));
        let mut backoff = Backoff::new(3, 5);
        backoff.fail(a, &mut dice);
        backoff.fail(a, &mut dice);
        let exponent = |of| backoff.find(of).ok().map(|place| backoff.of[place].1.exponent);
        assert_eq!((exponent(a), exponent(b)), (Some(4), None));
        assert!(backoff.passes(b));
        backoff.succeed(a);
        assert!(backoff.passes(a));
    }
}
