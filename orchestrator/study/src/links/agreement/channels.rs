//! Whether the rows of a link and channel agree.
//!
//! Fading over several paths gives each channel of a link a level of its own. Where a link's level changes with places or in time, rows near
//! each other agree whatever their channels are. So channels are exchanged at random among the rows of each link.

use crate::links::LinkStudy;
use crate::links::fit::LinkFit;
use proto::rng::{Draws, Purpose};
use std::collections::BTreeMap;

/// Exchanges of channels.
const EXCHANGES: u64 = 999;

/// Rows of a link: their channels, and what is left of their readings less the mean over the link (dB).
#[derive(Clone, Debug, Default)]
struct Rows {
    channels: Vec<u8>,
    left_db: Vec<f64>,
}

impl LinkStudy {
    /// Probability that rows of a link whose channels say nothing agree as much where they have a channel in common, in what a fit leaves of
    /// their readings.
    pub(in crate::links) fn p_value_of_channels(&self, fit: &LinkFit) -> f64 {
        let mut links: BTreeMap<(u32, u32, u32), Rows> = BTreeMap::new();
        for (row, left_db) in self.left_db(fit) {
            let measured = &self.rows.links.rows[row];
            let Some(channel) = measured.channel else { continue };
            let ends = (measured.tx.min(measured.rx), measured.tx.max(measured.rx));
            let rows = links.entry((measured.run, ends.0, ends.1)).or_default();
            rows.channels.push(channel);
            rows.left_db.push(left_db);
        }
        for rows in links.values_mut() {
            let mean = rows.left_db.iter().sum::<f64>() / rows.left_db.len() as f64;
            rows.left_db.iter_mut().for_each(|left_db| *left_db -= mean);
        }
        p_value(&links.into_values().collect::<Vec<_>>())
    }
}

/// Probability of as great sums over the rows of a channel by chance.
fn p_value(links: &[Rows]) -> f64 {
    let agreement = |order: &dyn Fn(usize, usize) -> Vec<usize>| -> f64 {
        let mut squares = 0.0;
        for (link, rows) in links.iter().enumerate() {
            let mut sums = [(0.0, 0.0); 256];
            let order = order(link, rows.channels.len());
            for (channel, place) in rows.channels.iter().zip(order) {
                let sum = &mut sums[usize::from(*channel)];
                *sum = (sum.0 + rows.left_db[place], sum.1 + 1.0);
            }
            let of_channels = sums.iter().filter(|(_, n)| 1.0 < *n);
            squares += of_channels.map(|(sum, n)| sum * sum / n).sum::<f64>();
        }
        squares
    };
    let observed = agreement(&|_, n| (0..n).collect());
    let draws = Draws::new(6, Purpose::Resample);
    let at_random = |number: u64| {
        agreement(&|link, n| {
            let mut order: Vec<usize> = (0..n).collect();
            for index in (1..n).rev() {
                let [word, ..] = draws.words(number, index as u64, link as u64);
                order.swap(index, (word % (index as u64 + 1)) as usize);
            }
            order
        })
    };
    let as_great = (0..EXCHANGES).filter(|&number| observed <= at_random(number)).count();
    (1 + as_great) as f64 / (1 + EXCHANGES) as f64
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
                let channel = 11 + (row * 7 % 16) as u8;
                walk += walk_db * draws.normal(link, row, 2);
                rows.channels.push(channel);
                rows.left_db.push(
                    walk + fading_db * draws.normal(link, u64::from(channel), 0)
                        + 2.0 * draws.normal(link, row, 1),
                );
            }
            let mean = rows.left_db.iter().sum::<f64>() / 48.0;
            rows.left_db.iter_mut().for_each(|left_db| *left_db -= mean);
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
        let alone = Rows { channels: vec![11, 12, 13], left_db: vec![1.0, -2.0, 1.0] };
        assert_eq!(p_value(&[alone]), 1.0);
    }
}
