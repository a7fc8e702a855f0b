//! Whether the rows of a link agree on a channel, or at a time.
//!
//! Fading over several paths gives each channel of a link a level of its own. Where a link's level changes with places or in time, rows near
//! each other agree whatever their channels are. So rows of each link are exchanged at random, and their sums by channel compared.
//! A link that drifts agrees at a time, whatever the channel is: there, rows of each link and channel are exchanged.

use crate::links::LinkStudy;
use crate::links::fit::LinkFit;
use crate::thresholds::{CHANNEL_SPANS, PERMUTATIONS};
use proto::rng::{Draws, Purpose};
use std::collections::BTreeMap;

/// Rows of a link. Rows of one set are exchangeable under the null hypothesis; rows of one group have a common level otherwise. Each row has
/// its residual less the mean over its set (dB).
#[derive(Clone, Debug, Default)]
struct Rows {
    sets: Vec<u32>,
    groups: Vec<u32>,
    residual_db: Vec<f64>,
}

impl Rows {
    fn push(&mut self, set: u32, group: u32, residual_db: f64) {
        self.sets.push(set);
        self.groups.push(group);
        self.residual_db.push(residual_db);
    }

    /// Takes the mean of each set away.
    fn centre(&mut self) {
        let mut sums: BTreeMap<u32, (f64, f64)> = BTreeMap::new();
        for (set, residual_db) in self.sets.iter().zip(&self.residual_db) {
            let sum = sums.entry(*set).or_default();
            *sum = (sum.0 + residual_db, sum.1 + 1.0);
        }
        for (set, residual_db) in self.sets.iter().zip(&mut self.residual_db) {
            let (sum, n) = sums[set];
            *residual_db -= sum / n;
        }
    }
}

impl LinkStudy {
    /// Probability that rows of a link whose channels say nothing agree as much where they have a channel in common, in what a fit leaves of
    /// their readings.
    pub(in crate::links) fn p_value_of_channels(&self, fit: &LinkFit) -> f64 {
        self.p_value_of_rows(fit, |row| Some((0, u32::from(self.rows.links.rows[row].channel?))))
    }

    /// Probability that rows of a link and channel whose times say nothing agree as much where they are of one time, in what a fit leaves
    /// of their readings.
    pub(in crate::links) fn p_value_of_times(&self, fit: &LinkFit) -> f64 {
        let measured = &self.rows.links.rows;
        let times_s = || measured.iter().map(|row| row.time_s);
        let first_s = times_s().fold(f64::INFINITY, f64::min);
        let length_s = times_s().fold(f64::NEG_INFINITY, f64::max) - first_s;
        self.p_value_of_rows(fit, |row| {
            let span = (CHANNEL_SPANS * (measured[row].time_s - first_s) / length_s) as u32;
            Some((u32::from(measured[row].channel.unwrap_or(0)), span))
        })
    }

    /// `of_row`: the set and the group of a row among those of its link; none: it is left out.
    fn p_value_of_rows(&self, fit: &LinkFit, of_row: impl Fn(usize) -> Option<(u32, u32)>) -> f64 {
        let mut links: BTreeMap<[u32; 3], Rows> = BTreeMap::new();
        for (row, residual_db) in self.residuals_db(fit) {
            let measured = &self.rows.links.rows[row];
            let Some((set, group)) = of_row(row) else { continue };
            let link = [measured.run, measured.tx.min(measured.rx), measured.tx.max(measured.rx)];
            links.entry(link).or_default().push(set, group, residual_db);
        }
        links.values_mut().for_each(Rows::centre);
        p_value(&links.into_values().collect::<Vec<_>>())
    }
}

/// Probability of as great sums over the rows of groups by chance.
fn p_value(links: &[Rows]) -> f64 {
    // Places of the rows of each set of a link: among these, rows are exchanged.
    let sets: Vec<Vec<Vec<usize>>> = links
        .iter()
        .map(|rows| {
            let mut sets: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
            for (place, set) in rows.sets.iter().enumerate() {
                sets.entry(*set).or_default().push(place);
            }
            sets.into_values().collect()
        })
        .collect();
    let agreement = |order: &dyn Fn(usize) -> Vec<usize>| -> f64 {
        let mut squares = 0.0;
        for (link, rows) in links.iter().enumerate() {
            let mut sums: BTreeMap<u32, (f64, f64)> = BTreeMap::new();
            for (group, place) in rows.groups.iter().zip(order(link)) {
                let sum = sums.entry(*group).or_default();
                *sum = (sum.0 + rows.residual_db[place], sum.1 + 1.0);
            }
            let of_groups = sums.values().filter(|(_, n)| 1.0 < *n);
            squares += of_groups.map(|(sum, n)| sum * sum / n).sum::<f64>();
        }
        squares
    };
    let observed = agreement(&|link| (0..links[link].groups.len()).collect());
    let draws = Draws::new(6, Purpose::Resample);
    let at_random = |number: u64| {
        agreement(&|link| {
            let mut order: Vec<usize> = (0..links[link].groups.len()).collect();
            for places in &sets[link] {
                for index in (1..places.len()).rev() {
                    let [word, ..] = draws.words(number, places[index] as u64, link as u64);
                    let other = places[(word % (index as u64 + 1)) as usize];
                    order.swap(places[index], other);
                }
            }
            order
        })
    };
    // Rounding must not make what no exchange changes look rare.
    let least = observed * (1.0 - 1e-9);
    let as_great = (0..PERMUTATIONS).filter(|&number| least <= at_random(number)).count();
    (1 + as_great) as f64 / (1 + PERMUTATIONS) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Links with three rows on each of 16 channels, in order: levels of channels of this spread (dB), or one that wanders from row to row,
    /// and noise of 2 dB.
    fn links(fading_db: f64, walk_db: f64, seed: u64) -> Vec<Rows> {
        let draws = Draws::new(seed, Purpose::Resample);
        let link = |link: u64| {
            let mut rows = Rows::default();
            let mut walk = 0.0;
            for row in 0..48u64 {
                let channel = 11 + (row * 7 % 16) as u32;
                walk += walk_db * draws.normal(link, row, 2);
                let fading_db = fading_db * draws.normal(link, u64::from(channel), 0);
                rows.push(0, channel, walk + fading_db + 2.0 * draws.normal(link, row, 1));
            }
            rows.centre();
            rows
        };
        (0..30).map(link).collect()
    }

    #[test]
    fn channels_agree_where_each_has_a_level_and_not_where_the_link_wanders() {
        assert!((0..10).all(|seed| p_value(&links(1.5, 0.0, seed)) < 0.005));
        let few = (0..40).filter(|&seed| p_value(&links(0.0, 0.0, seed)) < 0.05).count();
        // 2 of 40 expected; more than 7 in one case of 300.
        assert!(few <= 7, "{few}");
        let wandering = (0..10).filter(|&seed| p_value(&links(0.0, 1.0, seed)) < 0.005).count();
        assert_eq!(wandering, 0);
    }

    #[test]
    fn rows_of_one_frame_each_tell_nothing() {
        let alone =
            Rows { sets: vec![0; 3], groups: vec![11, 12, 13], residual_db: vec![1.0, -2.0, 1.0] };
        assert_eq!(p_value(&[alone]), 1.0);
    }

    #[test]
    fn links_agree_at_a_time_where_they_wander_and_not_where_only_channels_differ() {
        // The same rows, of six spans of time, exchanged within their channels.
        let in_time = |links: Vec<Rows>| -> Vec<Rows> {
            let turned = |rows: Rows| {
                let spans = (0..48).map(|row| row / 8).collect();
                let mut rows =
                    Rows { sets: rows.groups, groups: spans, residual_db: rows.residual_db };
                rows.centre();
                rows
            };
            links.into_iter().map(turned).collect()
        };
        assert!((0..10).all(|seed| p_value(&in_time(links(0.0, 1.0, seed))) < 0.005));
        let few = (0..40).filter(|&seed| p_value(&in_time(links(3.0, 0.0, seed))) < 0.05).count();
        assert!(few <= 7, "{few}");
    }
}
