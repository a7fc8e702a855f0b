//! Whether the links of a node agree.
//!
//! Where links differ at random, so do the means over the links of each node. Levels of nodes make these means differ more. So links are
//! exchanged at random, each with both of its directions, and the spread of the means of nodes is compared with that of the links as they
//! are. What both directions of a link share, and by how much they differ, are looked at apart: shadowing is the same in both.

use crate::links::LinkStudy;
use crate::links::fit::LinkFit;
use crate::thresholds::{FEWEST_COMPARED_LINKS, FEWEST_DIRECTION_ROWS, PERMUTATIONS};
use proto::rng::{Draws, Purpose};
use std::collections::BTreeMap;

/// The ends of a link, with a value that links may exchange.
type Value = ([u32; 2], f64);

/// A link: its ends, and the mean residual in both directions (dB): from the first to the second, and back.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Means {
    ends: [u32; 2],
    forward_db: Option<f64>,
    back_db: Option<f64>,
}

impl LinkStudy {
    /// Probability that links which differ at random agree as much where they share a node, in what a fit leaves of their readings. 1
    /// where there are too few links. None where there is one pair of nodes: its two directions differ by levels of nodes alone, and
    /// nothing can be exchanged.
    pub(in crate::links) fn p_value_of_nodes(&self, fit: &LinkFit) -> Option<f64> {
        let mut sums: BTreeMap<[u32; 2], [(f64, f64); 2]> = BTreeMap::new();
        for (row, residual_db) in self.residuals_db(fit) {
            let measured = &self.rows.links.rows[row];
            let ends = [measured.tx.min(measured.rx), measured.tx.max(measured.rx)];
            let sum = &mut sums.entry(ends).or_default()[usize::from(measured.rx < measured.tx)];
            *sum = (sum.0 + residual_db, sum.1 + 1.0);
        }
        let mean = |(sum, n): (f64, f64)| (FEWEST_DIRECTION_ROWS <= n).then_some(sum / n);
        let links = sums.into_iter().map(|(ends, [forward, back])| Means {
            ends,
            forward_db: mean(forward),
            back_db: mean(back),
        });
        let links: Vec<Means> = links.collect();
        let is_one_pair =
            links.len() == 1 && links[0].forward_db.is_some() && links[0].back_db.is_some();
        (!is_one_pair).then(|| p_value(&links))
    }
}

/// What two directions share, what they differ by, and what is known of one direction only: each a kind of value that links may
/// exchange.
fn p_value(links: &[Means]) -> f64 {
    let both =
        || links.iter().filter_map(|link| Some((link.ends, link.forward_db?, link.back_db?)));
    let shared = both().map(|(ends, forward, back)| (ends, 0.5 * (forward + back))).collect();
    let differing = both().map(|(ends, forward, back)| (ends, 0.5 * (forward - back))).collect();
    let single = links.iter().filter(|link| link.forward_db.is_some() != link.back_db.is_some());
    let single = single.filter_map(|link| Some((link.ends, link.forward_db.or(link.back_db)?)));
    let kinds: [(Vec<Value>, [f64; 2]); 3] =
        [(shared, [1.0, 1.0]), (differing, [1.0, -1.0]), (single.collect(), [1.0, 1.0])];
    let p_values: Vec<f64> = kinds
        .iter()
        .enumerate()
        .filter(|(_, (values, _))| FEWEST_COMPARED_LINKS <= values.len())
        .map(|(kind, (values, signs))| p_value_of(values, *signs, kind as u64))
        .collect();
    let n = p_values.len().max(1) as f64;
    p_values.into_iter().map(|p_value| n * p_value).fold(1.0, f64::min)
}

/// Probability of as great a spread of the means of nodes by chance. `signs`: with which a value counts at the first end and at the
/// second.
fn p_value_of(values: &[Value], signs: [f64; 2], kind: u64) -> f64 {
    let centre = if 0.0 < signs[1] {
        values.iter().map(|(_, value)| value).sum::<f64>() / values.len() as f64
    } else {
        0.0
    };
    let spread = |value_of: &dyn Fn(usize) -> f64| -> f64 {
        let mut nodes: BTreeMap<u32, (f64, f64)> = BTreeMap::new();
        for (index, (ends, _)) in values.iter().enumerate() {
            for (end, sign) in ends.iter().zip(signs) {
                let sum = nodes.entry(*end).or_default();
                *sum = (sum.0 + sign * (value_of(index) - centre), sum.1 + 1.0);
            }
        }
        nodes.values().map(|(sum, n)| sum * sum / n).sum()
    };
    let observed = spread(&|index| values[index].1);
    let draws = Draws::new(5, Purpose::Resample);
    let at_random = |number: u64| {
        let mut order: Vec<usize> = (0..values.len()).collect();
        let mut turned = vec![false; values.len()];
        for index in (1..values.len()).rev() {
            let [word, turn, ..] = draws.words(number, index as u64, kind);
            order.swap(index, (word % (index as u64 + 1)) as usize);
            turned[index] = turn & 1 == 1;
        }
        // A link that is turned about has its difference the other way.
        let sign = |index: usize| if signs[1] < 0.0 && turned[index] { -1.0 } else { 1.0 };
        spread(&|index| sign(index) * values[order[index]].1)
    };
    let as_great = (0..PERMUTATIONS).filter(|&number| observed <= at_random(number)).count();
    (1 + as_great) as f64 / (1 + PERMUTATIONS) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Links between 10 nodes: shadowing of 4 dB, noise of 0.2 dB, and levels of senders and receivers of this spread.
    fn links(offsets_db: f64, seed: u64) -> Vec<Means> {
        let draws = Draws::new(seed, Purpose::Resample);
        let pairs = (0..10u32).flat_map(|a| (a + 1..10).map(move |b| [a, b]));
        let level = |node: u32, end: u64| offsets_db * draws.normal(u64::from(node), 1, end);
        pairs
            .map(|[a, b]| {
                let key = u64::from(100 * a + b);
                let shadowing_db = 4.0 * draws.normal(key, 0, 0);
                let value = |from: u32, to: u32, back: u64| {
                    let noise_db = 0.2 * draws.normal(key, 2, back);
                    Some(shadowing_db + level(from, 0) + level(to, 1) + noise_db)
                };
                Means { ends: [a, b], forward_db: value(a, b, 0), back_db: value(b, a, 1) }
            })
            .collect()
    }

    #[test]
    fn links_that_differ_at_random_agree_no_more_than_by_chance() {
        let few = (0..100).filter(|&seed| p_value(&links(0.0, seed)) < 0.05).count();
        // 5 of 100 expected; more than 12 in one case of 500.
        assert!(few <= 12, "{few}");
    }

    #[test]
    fn levels_of_nodes_show_beside_shadowing() {
        let found = (0..20).filter(|&seed| p_value(&links(1.0, seed)) < 0.005).count();
        assert!(18 <= found, "{found}");
    }

    #[test]
    fn few_links_tell_nothing() {
        let few = links(5.0, 1);
        assert_eq!(p_value(&few[..FEWEST_COMPARED_LINKS - 1]), 1.0);
        assert!(p_value(&few) < 0.005);
    }
}
