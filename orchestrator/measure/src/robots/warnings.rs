//! What is odd about tracks of robots beside their units, and what it does to an answer.

use super::{RobotSample, RobotSamples};
use crate::warnings::{GREATEST_MPS, LEAST_JUMP_M, first_few, way_m};
use std::collections::{BTreeMap, BTreeSet};

/// All that is odd about tracks of robots beside their units.
pub(super) fn track_warnings(robots: &RobotSamples) -> Vec<String> {
    let mut warnings = Vec::new();
    let mut agents: BTreeMap<u32, f64> = BTreeMap::new();
    let mut jumps: Vec<&RobotSample> = Vec::new();
    for track in &robots.tracks {
        let samples = &robots.samples[track.clone()];
        let way = agents.entry(samples[0].agent).or_default();
        for pair in samples.windows(2) {
            let step = way_m(pair[0].position_m, pair[1].position_m);
            *way += step;
            if LEAST_JUMP_M < step && GREATEST_MPS * (pair[1].time_s - pair[0].time_s) < step {
                jumps.push(&pair[1]);
            }
        }
    }
    let still: BTreeSet<u32> =
        agents.iter().filter(|(_, way)| **way == 0.0).map(|(agent, _)| *agent).collect();
    if !still.is_empty() && still.len() < agents.len() {
        warnings.push(format!(
            "robots {} never move. Check that their positions were measured; otherwise they count as robots that ignore \
             their commands",
            first_few(&still)
        ));
    }
    if let (Some(first), Some(last)) =
        (agents.keys().next().copied(), agents.keys().next_back().copied())
        && (last - first) as usize <= 2 * agents.len()
    {
        let missing: BTreeSet<u32> =
            (first..=last).filter(|agent| !agents.contains_key(agent)).collect();
        if !missing.is_empty() {
            warnings.push(format!(
                "robots {} never appear, although robots are numbered {first} to {last}; check whether their rows were lost",
                first_few(&missing)
            ));
        }
    }
    if let Some(first) = jumps.iter().min_by_key(|sample| sample.line) {
        warnings.push(format!(
            "positions jump faster than {GREATEST_MPS} m/s in {} places, one of them on line {}. Check whether robots were \
             moved by hand, robot numbers were swapped, or the unit is not m. Windows across a jump count as outliers",
            jumps.len(),
            first.line
        ));
    }
    warnings
}
