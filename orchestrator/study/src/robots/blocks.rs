//! Which windows are independent of which.

use super::motion::MeasuredTracks;
use crate::choices::{ChoiceError, SplitBy};
use crate::folds::{Blocks, Few};
use crate::thresholds::{
    LONGEST_BLOCK_WINDOWS, MEMORY_S, N_FOLDS, PLACES_ACROSS, SHORTEST_BLOCK_WINDOWS, WANTED_BLOCKS,
};
use measure::robots::RobotSample;
use std::collections::BTreeMap;

/// What blocks of time are called.
pub(super) const PARTS: &str = "parts of tracks";

impl MeasuredTracks {
    /// Blocks of windows that are left out together by choice.
    pub(super) fn split_blocks(
        &self,
        window_s: f64,
        split: SplitBy,
    ) -> Result<Blocks, ChoiceError> {
        let blocks_by = |unit, key: &dyn Fn(&RobotSample) -> u32| {
            let keys = self.windows.iter().map(|window| u64::from(key(self.start(window))));
            Blocks::of_keys(unit, &keys.collect::<Vec<_>>())
        };
        let refused = |reason: String, nearest| Err(ChoiceError::Split { split, reason, nearest });
        let blocks = match split {
            SplitBy::Time => self.blocks_in_time(window_s),
            SplitBy::Place => self.blocks_in_place(),
            SplitBy::Run => blocks_by("campaigns", &|sample| sample.run).showing(Few::Certain),
            SplitBy::Node => blocks_by("robots", &|sample| sample.agent),
            SplitBy::Pair => {
                return refused("robot samples have no pairs".to_owned(), SplitBy::Node);
            }
        };
        if blocks.n_blocks() < 2 {
            let reason = format!("all windows belong to one of the {}", blocks.unit);
            return refused(reason, SplitBy::Time);
        }
        Ok(blocks)
    }

    /// Blocks of time; whole runs where blocks of time are few and runs are enough. Runs are replicates, and parts of a run are not.
    pub(super) fn default_blocks(&self, window_s: f64) -> Blocks {
        let parts = self.blocks_in_time(window_s);
        let runs = self.windows.iter().map(|window| u64::from(self.start(window).run));
        let runs = Blocks::of_keys("runs", &runs.collect::<Vec<_>>()).showing(Few::Certain);
        if !parts.are_many() && runs.suffices() { runs } else { parts }
    }

    /// Blocks of time: parts of a robot's track.
    pub(super) fn blocks_in_time(&self, window_s: f64) -> Blocks {
        self.parts_of_tracks(window_s, 1.0)
    }

    /// Parts of tracks, so long that about [`WANTED_BLOCKS`] of them are this share of the time measured.
    pub(super) fn parts_of_tracks(&self, window_s: f64, share: f64) -> Blocks {
        let begins: Vec<f64> = self
            .robots
            .tracks
            .iter()
            .map(|track| self.robots.samples[track.start].time_s)
            .collect();
        let lengths = self
            .robots
            .tracks
            .iter()
            .zip(&begins)
            .map(|(track, begin)| self.robots.samples[track.end - 1].time_s - begin);
        let lengths: Vec<f64> = lengths.collect();
        let total_s: f64 = lengths.iter().sum();
        let block_s = (share * total_s / WANTED_BLOCKS)
            .clamp(SHORTEST_BLOCK_WINDOWS * window_s, LONGEST_BLOCK_WINDOWS * window_s);
        let key = |window: &super::motion::MotionWindow| {
            let track = window.track as usize;
            let sample = &self.robots.samples[window.start as usize];
            // Parts of equal length, so that none is a scrap.
            let n = (lengths[track] / block_s).round().max(1.0);
            let part = (sample.time_s - begins[track]) / lengths[track] * n;
            (track as u64) << 32 | part.min(n - 1.0) as u64
        };
        let keys: Vec<u64> = self.windows.iter().map(key).collect();
        let mut blocks = Blocks::of_keys(PARTS, &keys).showing(Few::Possible);
        blocks.gaps = self.gaps_in_time(&blocks, window_s);
        blocks
    }

    /// Windows that lie too near to those of a fold of blocks of time.
    pub(super) fn gaps_in_time(&self, blocks: &Blocks, window_s: f64) -> Vec<(u32, u8)> {
        self.gaps(blocks, window_s + MEMORY_S)
    }

    /// Blocks of place: the squares of a grid in which windows begin.
    pub(super) fn blocks_in_place(&self) -> Blocks {
        let places = || {
            self.windows.iter().map(|window| self.robots.samples[window.start as usize].position_m)
        };
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for place in places() {
            for axis in 0..2 {
                low[axis] = low[axis].min(place[axis]);
                high[axis] = high[axis].max(place[axis]);
            }
        }
        let side_m = (high[0] - low[0]).max(high[1] - low[1]).max(1e-3) / PLACES_ACROSS;
        let cell = |place: [f64; 3], axis: usize| ((place[axis] - low[axis]) / side_m) as u64;
        let keys: Vec<u64> = places().map(|place| cell(place, 0) << 32 | cell(place, 1)).collect();
        Blocks::of_keys("places", &keys)
    }

    /// Windows that lie so near to windows of a fold, on the same track, that training without the fold leaves them out.
    fn gaps(&self, blocks: &Blocks, gap_s: f64) -> Vec<(u32, u8)> {
        let mut by_track: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for (row, window) in self.windows.iter().enumerate() {
            by_track.entry(window.track).or_default().push(row as u32);
        }
        let start_s =
            |row: u32| self.robots.samples[self.windows[row as usize].start as usize].time_s;
        let mut gaps = Vec::new();
        for rows in by_track.values() {
            let mut first = 0;
            for &row in rows {
                while start_s(rows[first]) < start_s(row) - gap_s {
                    first += 1;
                }
                let mut near = [false; N_FOLDS];
                for &other in rows[first..]
                    .iter()
                    .take_while(|&&other| start_s(other) <= start_s(row) + gap_s)
                {
                    near[blocks.fold(other)] = true;
                }
                let own = blocks.fold(row);
                gaps.extend(
                    (0..N_FOLDS)
                        .filter(|&fold| near[fold] && fold != own)
                        .map(|fold| (row, fold as u8)),
                );
            }
        }
        gaps.sort_unstable();
        gaps
    }
}
