//! The motion of robots by the model alone, without measurement noise.

use super::RobotStudy;
use super::motion::MeasuredTracks;
use proto::rng::Draws;
use robotsim::dynamics::effect::Localization;
use robotsim::dynamics::physics::{Physics, Robot};
use robotsim::dynamics::surroundings::Surroundings;

/// Positions and headings at every sample, without measurement noise.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseFreeMotion {
    /// Where each would have been measured (m): delay and scale of its localization count, noise does not.
    pub places_m: Vec<[f64; 3]>,
    /// Direction of its body (rad).
    pub headings_rad: Vec<f64>,
    /// Noise of positions by an effect of the configuration, beside what it says otherwise (m).
    pub more_sd_m: f64,
}

impl RobotStudy {
    /// Drives all robots from where their tracks begin by the model as configured and the commands of the file.
    ///
    /// * `draws`: for gusts.
    #[must_use]
    pub fn driven(&self, draws: Draws) -> NoiseFreeMotion {
        let samples = &self.robots().samples;
        let mut motion = NoiseFreeMotion {
            places_m: samples.iter().map(|sample| sample.position_m).collect(),
            headings_rad: samples.iter().map(|sample| sample.heading_rad).collect(),
            more_sd_m: 0.0,
        };
        let Some(physics) = self.model.physics_of_runs(&self.configured) else { return motion };
        let localization = physics.effects().iter().find_map(|effect| effect.localization());
        let Localization { sd_m, delay_s, scale } =
            localization.unwrap_or(Localization { sd_m: 0.0, delay_s: 0.0, scale: 1.0 });
        motion.more_sd_m = sd_m;
        let tracks = &self.model.tracks;
        for (number, track) in self.robots().tracks.iter().enumerate() {
            let robots = tracks.driven(number, &physics, draws);
            // Where it was a while ago, between two samples on the straight line.
            let place_at = |time_s: f64| {
                let after = samples[track.clone()].partition_point(|s| s.time_s < time_s);
                let Some(before) = after.checked_sub(1) else { return robots[0].position_m };
                let after = after.min(robots.len() - 1);
                let [a, b] = [before, after].map(|k| samples[track.start + k].time_s);
                let part = if a < b { (time_s - a) / (b - a) } else { 0.0 };
                let [from, to] = [before, after].map(|k| robots[k].position_m);
                std::array::from_fn(|axis| from[axis] + part * (to[axis] - from[axis]))
            };
            for (k, robot) in robots.iter().enumerate() {
                let sample = track.start + k;
                let place_m: [f64; 3] = place_at(samples[sample].time_s - delay_s);
                motion.places_m[sample] = place_m.map(|coordinate| scale * coordinate);
                motion.headings_rad[sample] = robot.heading_rad;
            }
        }
        motion
    }
}

impl MeasuredTracks {
    /// A robot at each sample of a track by the model alone, from where the track begins.
    fn driven(&self, track: usize, physics: &Physics, draws: Draws) -> Vec<Robot> {
        let range = self.robots.tracks[track].clone();
        let mut robot = self.begin(&range, physics);
        let (mut next, mut driven) = (0, vec![robot]);
        for index in range.start..range.end - 1 {
            let [a, b] = [index, index + 1].map(|index| self.robots.samples[index].time_s);
            let surroundings = Surroundings { draws: Some(draws), ..self.surroundings(index) };
            physics.advance(&mut robot, &self.orders[track], &mut next, a, b, &surroundings);
            self.carry(&mut robot, index);
            driven.push(robot);
        }
        driven
    }
}
