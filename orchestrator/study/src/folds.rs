//! Blocks of rows that depend on each other, dealt to folds that are left out in turn.

use crate::thresholds::{FEWEST_BLOCKS, FEWEST_REPLICATES, N_FOLDS};
use std::collections::BTreeSet;

/// What blocks show that are fewer than [`FEWEST_BLOCKS`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Few {
    /// Nothing: they share nodes, or nobody knows how they depend on each other.
    #[default]
    Nothing,
    /// What may be missing: they follow each other in one recording.
    Possible,
    /// What is missing: they are replicates, such as flights and places, which are independent.
    Certain,
}

/// Rows in blocks, blocks in folds.
#[derive(Clone, Debug, PartialEq)]
pub struct Blocks {
    /// What a block is: `blocks of time`, `pairs of nodes`, …
    pub unit: &'static str,
    /// The block of each row.
    pub of_row: Vec<u32>,
    /// The fold of each block.
    pub fold_of_block: Vec<u8>,
    /// Which rows depend on each other, where that is more than a block: by number, for each row.
    pub clusters: Option<Vec<u32>>,
    /// Rows that a fold's training leaves out beside its own: they lie too near. None for most kinds of blocks. As
    /// (row, fold), sorted.
    pub gaps: Vec<(u32, u8)>,
    /// Which rows are scored, by a fit to all others: one split by hand, and no folds.
    pub scored: Option<Vec<bool>>,
    /// What they show where they are few.
    pub few: Few,
}

impl Blocks {
    /// Blocks of rows with equal keys, dealt to folds in the order in which the keys are sorted, but mixed: so that
    /// neighbours fall into different folds and folds get alike sizes.
    #[must_use]
    pub fn of_keys(unit: &'static str, keys: &[u64]) -> Self {
        let mut sorted: Vec<u64> = keys.to_vec();
        sorted.sort_unstable();
        sorted.dedup();
        let index = |key: &u64| sorted.binary_search(key).unwrap_or_default() as u32;
        let of_row: Vec<u32> = keys.iter().map(index).collect();
        let mut n_rows = vec![0usize; sorted.len()];
        for &block in &of_row {
            n_rows[block as usize] += 1;
        }
        // Largest first into the fold that has least: the order among equals is scrambled by a fixed hash.
        let mut order: Vec<usize> = (0..sorted.len()).collect();
        order.sort_by_key(|&block| (std::cmp::Reverse(n_rows[block]), scramble(block as u64)));
        let mut filled = [0usize; N_FOLDS];
        let mut fold_of_block = vec![0u8; sorted.len()];
        for block in order {
            let fold = (0..N_FOLDS).min_by_key(|&fold| filled[fold]).unwrap_or_default();
            filled[fold] += n_rows[block];
            fold_of_block[block] = fold as u8;
        }
        Self {
            unit,
            of_row,
            fold_of_block,
            clusters: None,
            gaps: Vec::new(),
            scored: None,
            few: Few::Nothing,
        }
    }

    /// The same, but blocks that follow each other are never left out together: of every five each is in another fold, and the first of
    /// five is not in that of the last before.
    #[must_use]
    pub fn in_turn(mut self) -> Self {
        let mut last = None;
        for (group, folds) in self.fold_of_block.chunks_mut(N_FOLDS).enumerate() {
            let mut order: Vec<u8> = (0..N_FOLDS as u8).collect();
            order.sort_by_key(|&fold| scramble((group * N_FOLDS) as u64 + u64::from(fold)));
            if order.first() == last.as_ref() {
                order.swap(0, 1);
            }
            folds.copy_from_slice(&order[..folds.len()]);
            last = folds.last().copied();
        }
        self
    }

    /// Number of blocks.
    #[must_use]
    pub fn n_blocks(&self) -> usize {
        self.fold_of_block.len()
    }

    /// Which rows depend on each other: by number, for each row.
    #[must_use]
    pub fn dependent(&self) -> &[u32] {
        self.clusters.as_deref().unwrap_or(&self.of_row)
    }

    /// Number of blocks that rows are scored in.
    #[must_use]
    pub fn n_scored(&self) -> usize {
        self.distinct(&self.of_row)
    }

    fn distinct(&self, numbers: &[u32]) -> usize {
        let Some(scored) = &self.scored else {
            return numbers.iter().max().map_or(0, |&last| last as usize + 1);
        };
        let of_scored = numbers.iter().zip(scored).filter(|(_, scored)| **scored);
        of_scored.map(|(number, _)| number).collect::<BTreeSet<_>>().len()
    }

    /// The same, which show this where they are few.
    #[must_use]
    pub fn showing(self, few: Few) -> Self {
        Self { few, ..self }
    }

    /// Number of blocks that are scored and do not depend on each other.
    fn n_independent(&self) -> usize {
        self.n_scored().min(self.distinct(self.dependent()))
    }

    /// How many blocks tell something.
    #[must_use]
    pub fn fewest(&self) -> usize {
        if self.few == Few::Nothing { FEWEST_BLOCKS } else { FEWEST_REPLICATES }
    }

    /// Whether there are enough blocks to tell anything.
    #[must_use]
    pub fn suffices(&self) -> bool {
        self.fewest() <= self.n_independent()
    }

    /// Whether there are so many blocks that it does not matter what they are.
    #[must_use]
    pub fn are_many(&self) -> bool {
        FEWEST_BLOCKS <= self.n_independent()
    }

    /// Whether what they show may be certain.
    #[must_use]
    pub fn may_be_certain(&self) -> bool {
        self.are_many() || (self.few == Few::Certain && self.suffices())
    }

    /// The replicate of each row, where a few replicates take the place of many blocks.
    #[must_use]
    pub fn replicates(&self) -> Option<&[u32]> {
        (!self.are_many() && self.may_be_certain()).then(|| self.dependent())
    }

    /// How many folds are left out in turn.
    #[must_use]
    pub fn n_folds(&self) -> usize {
        if self.scored.is_some() { 1 } else { N_FOLDS }
    }

    /// Rows that a fit may see: all, but those that are only scored.
    #[must_use]
    pub fn fitted(&self) -> Vec<u32> {
        let is_only_scored =
            |row: &u32| self.scored.as_ref().is_some_and(|scored| scored[*row as usize]);
        (0..self.of_row.len() as u32).filter(|row| !is_only_scored(row)).collect()
    }

    /// The fold of a row: of one split by hand, 0 where it is scored and 1 where it is not.
    #[must_use]
    pub fn fold(&self, row: u32) -> usize {
        if let Some(scored) = &self.scored {
            return usize::from(!scored[row as usize]);
        }
        usize::from(self.fold_of_block[self.of_row[row as usize] as usize])
    }

    /// Rows to fit and rows to score where `fold` is left out.
    #[must_use]
    pub fn split(&self, fold: usize) -> (Vec<u32>, Vec<u32>) {
        let mut train = Vec::new();
        let mut test = Vec::new();
        for row in 0..self.of_row.len() as u32 {
            if self.fold(row) == fold {
                test.push(row);
            } else if self.scored.is_some() || self.gaps.binary_search(&(row, fold as u8)).is_err()
            {
                train.push(row);
            }
        }
        (train, test)
    }
}

/// A fixed permutation of numbers, so that what is dealt has nothing to do with the order in the file (SplitMix64's mix).
#[must_use]
pub fn scramble(number: u64) -> u64 {
    let mut z = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_is_left_out_once_and_blocks_stay_whole() {
        let keys: Vec<u64> = (0..1000).map(|row| row / 7).collect();
        let blocks = Blocks::of_keys("blocks", &keys);
        assert_eq!(blocks.n_blocks(), 143);
        let mut out = vec![0; keys.len()];
        for fold in 0..N_FOLDS {
            let (train, test) = blocks.split(fold);
            assert_eq!(train.len() + test.len(), keys.len());
            assert!((180..=220).contains(&test.len()), "{}", test.len());
            for row in test {
                out[row as usize] += 1;
                let first = row - row % 7;
                assert_eq!(blocks.fold(first), fold, "a block is torn");
            }
        }
        assert!(out.iter().all(|&times| times == 1));
    }

    #[test]
    fn blocks_that_follow_each_other_are_not_left_out_together() {
        let keys: Vec<u64> = (0..600).map(|row| row / 10).collect();
        let folds = Blocks::of_keys("blocks", &keys).in_turn().fold_of_block;
        assert!(folds.windows(2).all(|pair| pair[0] != pair[1]), "{folds:?}");
        for fold in 0..N_FOLDS as u8 {
            assert_eq!(folds.iter().filter(|&&other| other == fold).count(), 12);
        }
    }

    #[test]
    fn a_few_replicates_may_be_certain_and_a_few_parts_of_one_recording_may_not() {
        let of = |n: u64, few| {
            let keys: Vec<u64> = (0..10 * n).map(|row| row / 10).collect();
            let blocks = Blocks::of_keys("blocks", &keys).showing(few);
            (blocks.suffices(), blocks.may_be_certain(), blocks.replicates().is_some())
        };
        assert_eq!(of(4, Few::Certain), (true, true, true));
        assert_eq!(of(3, Few::Certain), (false, false, false));
        assert_eq!(of(19, Few::Possible), (true, false, false));
        assert_eq!(of(19, Few::Nothing), (false, false, false));
        for few in [Few::Nothing, Few::Possible, Few::Certain] {
            assert_eq!(of(20, few), (true, true, false));
        }
    }

    #[test]
    fn of_one_split_by_hand_what_is_scored_is_not_fitted_to() {
        let keys: Vec<u64> = (0..100).map(|row| row / 2).collect();
        let mut blocks = Blocks::of_keys("blocks", &keys);
        assert!(blocks.suffices());
        blocks.scored = Some((0..100).map(|row| row < 30).collect());
        let (train, test) = blocks.split(0);
        assert_eq!((train.clone(), test), ((30..100).collect(), (0..30).collect()));
        assert_eq!(blocks.fitted(), train);
        assert_eq!((blocks.n_folds(), blocks.n_scored()), (1, 15));
        assert!(!blocks.suffices(), "only what is scored counts");
    }
}
