//! A study of some of the windows of robots: whole blocks of time, spread evenly over all tracks.
//!
//! Samples, candidates and what these start from stay those of all windows, so that a fit to the subset is one of the same model. Only the
//! stretches of tracks that the windows need are predicted.

use super::blocks::PARTS;
use super::motion::{MeasuredTracks, MotionWindow};
use super::terms::Term;
use super::{RobotModel, RobotStudy};
use crate::folds::{Blocks, scramble};
use crate::thresholds::{MOST_SEARCHED_STEPS, MOST_SEARCHED_WINDOWS, SUBSET_LEAD_WINDOWS};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Mutex;

/// A part of a track that is predicted by itself: from its first sample on, as a track from where it begins.
#[derive(Clone, Debug)]
pub(super) struct Stretch {
    /// The track.
    pub(super) track: usize,
    /// Its samples.
    pub(super) samples: Range<usize>,
    /// Its windows.
    pub(super) windows: Range<usize>,
}

impl RobotStudy {
    /// A study of about as many windows as a search needs: whole blocks of time, spread evenly over all tracks. None where there are hardly
    /// more. The numbers are then fitted to all.
    #[must_use]
    pub fn thinned(&self) -> Option<Self> {
        self.thinned_to(self.model.tracks.most_searched())
    }

    /// The same of about so many windows.
    #[must_use]
    pub fn thinned_to(&self, most: usize) -> Option<Self> {
        let tracks = &self.model.tracks;
        let n = tracks.windows.len();
        // A study that is hardly smaller saves no time.
        if n < most + most / 4 {
            return None;
        }
        let share = most as f64 / n as f64;
        let blocks = tracks.parts_of_tracks(tracks.window_s(0), share);
        let is_kept = spread_evenly(&blocks, share);
        let kept: Vec<bool> = blocks.of_row.iter().map(|block| is_kept[*block as usize]).collect();
        let in_time = if self.in_time.unit == PARTS { &blocks } else { &self.in_time };
        let scored = self.in_time.scored.clone();
        Some(self.some(&kept, &Blocks { scored, ..in_time.clone() }))
    }

    /// The study of the windows that are kept; `in_time`: the blocks of time of all windows that are left out together.
    fn some(&self, kept: &[bool], in_time: &Blocks) -> Self {
        let model = &self.model;
        let terms = model.terms.iter().map(|term| match term {
            Term::Curve(curve) => Term::Curve(curve.some(kept)),
            other => other.clone(),
        });
        let tracks = model.tracks.some(kept);
        let has_gaps = !in_time.gaps.is_empty();
        let mut in_time = in_time.some(kept);
        if has_gaps {
            in_time.gaps = tracks.gaps_in_time(&in_time, tracks.window_s(0));
        }
        let n_fitted = in_time.fitted().len();
        Self {
            candidates: self.candidates.clone(),
            in_place: self.in_place.some(kept),
            in_time,
            // Its derivatives are those at all windows.
            configured: model.with_terms(&[], &self.configured),
            rejected: self.rejected.clone(),
            n_fitted,
            cache: Mutex::default(),
            model: RobotModel {
                tracks,
                dynamics: model.dynamics.clone(),
                catalogue: model.catalogue.clone(),
                is_wheelbase_free: model.is_wheelbase_free,
                given_sd_m: model.given_sd_m,
                base: model.base.clone(),
                terms: terms.collect(),
                stop: model.stop.clone(),
                directions: kept_of(&model.directions, kept),
                steps_m: model.steps_m.clone(),
            },
        }
    }
}

impl MeasuredTracks {
    /// How many windows a search looks at most: fewer where each is simulated by itself.
    fn most_searched(&self) -> usize {
        if !self.robots.commands.is_inertial() {
            return MOST_SEARCHED_WINDOWS;
        }
        let steps = |window: &MotionWindow| (window.end - window.start) as usize;
        let n_steps: usize = self.windows.iter().map(steps).sum();
        let mean = n_steps as f64 / self.windows.len() as f64;
        ((MOST_SEARCHED_STEPS / mean) as usize).min(MOST_SEARCHED_WINDOWS)
    }

    /// Some of the windows, and the stretches of tracks that they need.
    fn some(&self, kept: &[bool]) -> Self {
        let windows = kept_of(&self.windows, kept);
        let lead_s = SUBSET_LEAD_WINDOWS * self.window_s(0);
        let samples = &self.robots.samples;
        let mut stretches: Vec<Stretch> = Vec::new();
        for (index, window) in windows.iter().enumerate() {
            let track = window.track as usize;
            let range = &self.robots.tracks[track];
            let from_s = samples[window.start as usize].time_s - lead_s;
            let first = range.start
                + samples[range.clone()].partition_point(|sample| sample.time_s < from_s);
            let end = window.end as usize + 1;
            match stretches.last_mut() {
                Some(last) if last.track == track && first <= last.samples.end => {
                    last.samples.end = last.samples.end.max(end);
                    last.windows.end = index + 1;
                }
                _ => stretches.push(Stretch {
                    track,
                    samples: first..end,
                    windows: index..index + 1,
                }),
            }
        }
        let mut some = self.clone();
        (some.windows, some.stretches) = (windows, stretches);
        some.frames = kept_of(&self.frames, kept);
        some
    }
}

impl Blocks {
    /// Of the rows that are kept. Blocks without any are none, and the others are dealt to folds anew; gaps are none.
    fn some(&self, kept: &[bool]) -> Self {
        let keys: Vec<u64> = kept_of(&self.of_row, kept).into_iter().map(u64::from).collect();
        let blocks = Self::of_keys(self.unit, &keys).showing(self.few);
        let clusters = self.clusters.as_ref().map(|clusters| renumbered(&kept_of(clusters, kept)));
        let scored = self.scored.as_ref().map(|scored| kept_of(scored, kept));
        Self { clusters, scored, ..blocks }
    }
}

/// Which of the blocks are kept: about this share, one of each group of neighbours.
fn spread_evenly(blocks: &Blocks, share: f64) -> Vec<bool> {
    let n = blocks.n_blocks();
    let n_kept = ((share * n as f64).round() as usize).clamp(1, n);
    let mut kept = vec![false; n];
    for group in 0..n_kept {
        let [first, end] = [group, group + 1].map(|group| group * n / n_kept);
        kept[first + (scramble(group as u64) % (end - first) as u64) as usize] = true;
    }
    kept
}

/// Numbers from 0 on, in the order of the numbers given.
fn renumbered(numbers: &[u32]) -> Vec<u32> {
    let mut new: BTreeMap<u32, u32> = numbers.iter().map(|&number| (number, 0)).collect();
    new.values_mut().zip(0..).for_each(|(new, index)| *new = index);
    numbers.iter().map(|number| new[number]).collect()
}

/// The values of the rows that are kept.
pub(super) fn kept_of<T: Clone>(values: &[T], kept: &[bool]) -> Vec<T> {
    values.iter().zip(kept).filter(|(_, kept)| **kept).map(|(value, _)| value.clone()).collect()
}
