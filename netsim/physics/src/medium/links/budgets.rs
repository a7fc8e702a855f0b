//! Budgets of links that were computed lately, where a budget follows from distance and channel alone.

use crate::memo::place_of;
use crate::model::LinkBudget;

/// Budgets by distance and channel, each at a place that follows from both: one that is asked for anew takes the place of the
/// one before. An acknowledgment crosses the distance that its frame did, and on a grid distances are few.
#[derive(Debug, Default)]
pub(super) struct Budgets {
    /// Empty before the first.
    known: Vec<Known>,
}

#[derive(Clone, Copy, Debug)]
struct Known {
    /// Bits of the square of the distance (m²), and the channel, for which it was computed.
    of: (u64, u8),
    budget: LinkBudget,
}

/// Budgets kept: 56 KB, which a processor's nearer caches hold.
const MOST: usize = 1024;

impl Budgets {
    /// The budget over a distance (m²) on a channel: the one that is known, or what `compute` says.
    #[inline]
    pub(super) fn get(
        &mut self,
        distance_squared_m2: f64,
        channel: u8,
        compute: impl FnOnce() -> LinkBudget,
    ) -> LinkBudget {
        let of = (distance_squared_m2.to_bits(), channel);
        let place = place_of(of.0 ^ u64::from(channel), MOST);
        match self.known.get(place) {
            Some(known) if known.of == of => return known.budget,
            _ => {}
        }
        let known = Known { of, budget: compute() };
        if self.known.is_empty() {
            self.known.resize(MOST, known);
        }
        self.known[place] = known;
        known.budget
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_is_that_of_its_distance_and_channel_whatever_was_asked_before() {
        let budget = |distance: f64, channel: u8| LinkBudget {
            rssi_dbm: -distance,
            register_rssi_dbm: f64::from(channel),
            reception_probability: 1.0,
            shift_db: 0.0,
            is_stated: false,
        };
        let mut budgets = Budgets::default();
        let mut n_computed = 0;
        for round in 0..3 {
            for channel in 11..=26 {
                for distance in 0..200 {
                    let distance = f64::from(distance) * 1.7;
                    let found = budgets.get(distance, channel, || {
                        n_computed += 1;
                        budget(distance, channel)
                    });
                    assert_eq!(found, budget(distance, channel), "{round}");
                    let again = budgets.get(distance, channel, || unreachable!("it is known"));
                    assert_eq!(again, found);
                }
            }
        }
        assert!(3200 <= n_computed);
    }
}
