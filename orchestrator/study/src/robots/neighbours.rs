//! Other robots near each sample.

use measure::robots::RobotSamples;
use robotsim::dynamics::surroundings::Other;
use std::collections::BTreeMap;

/// For each sample the other robots of its campaign at that time, where they were measured within one spacing, with the
/// velocities of their last step. Other robots' measured positions are a covariate: they are known within the window, too.
pub(super) fn others(robots: &RobotSamples) -> Vec<Vec<Other>> {
    let mut by_run: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (number, track) in robots.tracks.iter().enumerate() {
        by_run.entry(robots.samples[track.start].run).or_default().push(number);
    }
    // Nobody has company: an empty list says so for all samples.
    if by_run.values().all(|tracks| tracks.len() < 2) {
        return Vec::new();
    }
    let within_s = 1.01 * robots.spacing_s();
    let mut others = vec![Vec::new(); robots.samples.len()];
    for tracks in by_run.values() {
        for &own in tracks {
            for &other in tracks.iter().filter(|&&other| other != own) {
                let samples = &robots.samples[robots.tracks[other].clone()];
                let mut near = 0;
                for index in robots.tracks[own].clone() {
                    let time_s = robots.samples[index].time_s;
                    while near + 1 < samples.len() && samples[near + 1].time_s <= time_s {
                        near += 1;
                    }
                    // A robot that was not measured near this time may have been anywhere.
                    if within_s < (samples[near].time_s - time_s).abs() {
                        continue;
                    }
                    let velocity_mps = match samples.get(near + 1) {
                        Some(after) => std::array::from_fn(|i| {
                            (after.position_m[i] - samples[near].position_m[i])
                                / (after.time_s - samples[near].time_s)
                        }),
                        // The last sample of a track has no step that says how fast the robot is.
                        None => [0.0; 3],
                    };
                    let ahead_s = time_s - samples[near].time_s;
                    others[index].push(Other {
                        position_m: std::array::from_fn(|i| {
                            samples[near].position_m[i] + velocity_mps[i] * ahead_s
                        }),
                        velocity_mps,
                    });
                }
            }
        }
    }
    others
}
