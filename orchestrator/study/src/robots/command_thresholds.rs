//! Numbers that count only where they pass a command or a time: thresholds, limits of change, beginnings.

use super::fit_state::FitState;
use super::motion::MeasuredTracks;
use super::terms::Term;
use super::{RobotFit, RobotModel};
use crate::TermId;
use measure::robots::RobotSample;
use numbers::normal::FALL_90_NATS;
use numbers::power::square;
use robotsim::dynamics::Part;

/// How often the share of commands beyond a threshold is halved, from a 24th on: a limit that only the fastest commands meet is
/// worth finding.
const TAIL_HALVES: usize = 4;

/// At so many times of the measurements something may begin, where a search for it starts.
const N_TIMES: usize = 16;

/// A threshold is looked for in steps of this part of all commands, a quarter of what its starts are apart …
const COARSE: usize = 96;
/// … so many to each side, and then in steps that are so many times smaller.
const PARTS: usize = 8;
/// Most commands that an interval has on each side of the threshold.
const MOST_PASSED: usize = 500;

impl MeasuredTracks {
    /// Sizes of a part of all commands, sorted.
    fn sizes(&self, part: Part) -> Vec<f64> {
        let turning = self.robots.shape.is_turning();
        let size = |command: [f64; 3]| match (part, turning) {
            (Part::Turn, _) => command[1].abs(),
            (Part::Speed, true) => command[0].abs(),
            (Part::Speed, false) => command.iter().map(|part| part * part).sum::<f64>().sqrt(),
        };
        let mut sizes: Vec<f64> =
            self.robots.samples.iter().map(|sample| size(sample.command)).collect();
        sizes.sort_by(f64::total_cmp);
        sizes
    }

    /// Values between which commanded sizes lie: half way from each to the next larger one, about two dozen; closer where few
    /// commands are smaller, or larger; and beyond all.
    pub(super) fn thresholds(&self, part: Part) -> Vec<f64> {
        let mut sizes = self.sizes(part);
        // By quantiles of what was commanded, however often.
        let steps = 24;
        let last = sizes.len() - 1;
        let halves = (1..=TAIL_HALVES).map(|k| last / (steps << k));
        let mut places: Vec<usize> = (0..=steps).map(|k| k * last / steps).collect();
        places.extend(halves.flat_map(|few| [few, last - few]));
        places.sort_unstable();
        let mut picked: Vec<f64> = places.into_iter().map(|place| sizes[place]).collect();
        sizes.dedup();
        let [smallest, largest] = [sizes[0], sizes[sizes.len() - 1]];
        if sizes.len() <= steps {
            picked = sizes;
        }
        picked.dedup();
        let middles = picked.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
        let mut values: Vec<f64> =
            [smallest].into_iter().chain(middles).chain([largest]).map(|v| v.max(0.01)).collect();
        values.dedup();
        values
    }

    /// Times (s) that part the samples into equal parts.
    pub(super) fn times_s(&self) -> Vec<f64> {
        let mut all: Vec<f64> = self.robots.samples.iter().map(|sample| sample.time_s).collect();
        all.sort_by(f64::total_cmp);
        let mut times: Vec<f64> =
            (1..=N_TIMES).map(|k| all[k * (all.len() - 1) / (N_TIMES + 1)]).collect();
        times.dedup();
        times
    }

    /// Accelerations (m/s²) with which the greatest change of a commanded speed would take from a hundred times the time between
    /// samples to next to nothing.
    pub(super) fn accelerations(&self) -> Vec<f64> {
        let n_parts = if self.robots.shape.is_turning() { 1 } else { 3 };
        let change = |pair: &[RobotSample]| -> f64 {
            let parts = 0..n_parts;
            parts.map(|k| square(pair[1].command[k] - pair[0].command[k])).sum::<f64>().sqrt()
        };
        let tracks = self.robots.tracks.iter();
        let changes = tracks.flat_map(|track| self.robots.samples[track.clone()].windows(2));
        let greatest_mps = changes.map(change).fold(0.0, f64::max);
        let spacing_s = self.robots.spacing_s();
        let (least, most) = ((greatest_mps / (100.0 * spacing_s)).clamp(0.01, 1e3), 1e6);
        (0..14).map(|k| least * libm::pow(most / least, f64::from(k) / 13.0)).collect()
    }
}

/// Commands of different sizes, sorted, and a threshold between two of them.
struct Between {
    sizes: Vec<f64>,
    /// The threshold is greater than so many of them.
    above: usize,
}

impl Between {
    /// The threshold above so many commands: half way to the next.
    fn threshold_above(&self, above: usize) -> f64 {
        match (above.checked_sub(1).map(|last| self.sizes[last]), self.sizes.get(above)) {
            (Some(below), Some(next)) => 0.5 * (below + next),
            (None, Some(next)) => 0.5 * next,
            (Some(below), None) => below * 1.01,
            (None, None) => 0.0,
        }
    }
}

impl RobotModel {
    /// The part of commands on which a term has a threshold.
    pub(super) fn threshold_on(&self, term: TermId) -> Option<Part> {
        match &self.terms[term] {
            Term::Effect(effect) => effect.threshold_on(),
            Term::Noise(_) | Term::Curve(_) => None,
        }
    }

    /// Where the threshold of a term, if it has one, is among the commands.
    fn between(&self, fit: &RobotFit, term: TermId) -> Option<Between> {
        let mut sizes = self.tracks.sizes(self.threshold_on(term)?);
        sizes.dedup();
        let threshold = fit.numbers(self, term)[0];
        let above = sizes.partition_point(|size| *size < threshold);
        Some(Between { sizes, above })
    }

    /// A fit with another threshold of a term, and its likelihood.
    fn with_threshold(
        &self,
        fit: &RobotFit,
        term: TermId,
        threshold: f64,
        train: &[u32],
    ) -> Option<(RobotFit, FitState)> {
        let mut fit = RobotFit { derivatives: std::sync::Arc::default(), ..fit.clone() };
        let first = fit.first(self, term);
        fit.values[first] = threshold;
        let point = self.point(&fit, train)?;
        Some((fit, point))
    }

    /// A fit whose thresholds are the likeliest nearby: a likelihood that changes in jumps has no slope that leads there.
    pub(super) fn refine_thresholds(&self, mut fit: RobotFit, train: &[u32]) -> RobotFit {
        for term in fit.terms.clone() {
            let Some(mut between) = self.between(&fit, term) else { continue };
            let mut stride = (between.sizes.len() / COARSE).max(1);
            loop {
                let first = between.above.saturating_sub(PARTS * stride);
                let last = (between.above + PARTS * stride).min(between.sizes.len());
                for above in (first..=last).step_by(stride) {
                    let threshold = between.threshold_above(above);
                    let trial = self.with_threshold(&fit, term, threshold, train);
                    if let Some((trial, at)) = trial
                        && fit.log_likelihood < at.total
                    {
                        fit = self.fit_at(trial, at);
                        between.above = above;
                    }
                }
                if stride == 1 || self.stop.is_set() {
                    break;
                }
                stride = (stride / PARTS).max(1);
            }
        }
        fit
    }

    /// The 90 % interval of the threshold of a term, from one command to another, by the likelihood.
    pub(super) fn threshold_interval(
        &self,
        fit: &RobotFit,
        term: TermId,
        train: &[u32],
    ) -> Option<(f64, f64)> {
        let between = self.between(fit, term)?;
        let least = fit.log_likelihood - self.tracks.n_overlapping * FALL_90_NATS;
        let is_likely = |above: usize| {
            self.with_threshold(fit, term, between.threshold_above(above), train)
                .is_some_and(|(_, at)| least < at.total)
        };
        let (mut low, mut high) = (between.above, between.above);
        while 0 < low && between.above - low < MOST_PASSED && is_likely(low - 1) {
            low -= 1;
        }
        while high < between.sizes.len()
            && high - between.above < MOST_PASSED
            && is_likely(high + 1)
        {
            high += 1;
        }
        let below = low.checked_sub(1).map_or(0.0, |last| between.sizes[last]);
        let above = between.sizes.get(high).copied();
        Some((below, above.unwrap_or_else(|| between.threshold_above(high))))
    }
}
