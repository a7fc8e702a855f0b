//! The ground carries a flyer that has landed: with its thrust off it neither falls nor slides.

use super::motion::MeasuredTracks;
use measure::robots::{CommandKind, RobotSample, RobotSamples};
use numbers::statistics::median_high;
use proto::site::Terrain;
use robotsim::dynamics::GRAVITY_MPS2;
use robotsim::dynamics::physics::Robot;

/// Thrust below this share of the weight lifts nothing: rotors are off, or idle.
const OFF_SHARE: f64 = 0.5;
/// A flyer has landed that does not fall in this time (s) with its thrust off …
const RESTS_S: f64 = 0.2;
/// … by so much (m). In free fall it would fall by 0.2 m.
const RESTS_M: f64 = 0.02;
/// Fewest samples of landed flyers.
const FEWEST_LANDED: usize = 5;

/// The median height (m) at which landed flyers are measured; none where none has landed, or the ground is not level.
pub(super) fn landed_m(robots: &RobotSamples, terrain: &Terrain) -> Option<f64> {
    if robots.commands != CommandKind::Thrust || !terrain.is_level() {
        return None;
    }
    let mut heights_m = Vec::new();
    for track in &robots.tracks {
        let samples = &robots.samples[track.clone()];
        for (first, sample) in samples.iter().enumerate() {
            let rests = |other: &&RobotSample| {
                is_off(other) && (other.position_m[2] - sample.position_m[2]).abs() < RESTS_M
            };
            let last = samples[first..].iter().take_while(rests).last();
            if last.is_some_and(|last| RESTS_S <= last.time_s - sample.time_s) {
                heights_m.push(sample.position_m[2]);
            }
        }
    }
    heights_m.sort_by(f64::total_cmp);
    (FEWEST_LANDED <= heights_m.len()).then(|| median_high(&heights_m))
}

/// Whether thrust is off. Commands are accelerations.
fn is_off(sample: &RobotSample) -> bool {
    sample.command[2] + GRAVITY_MPS2 < OFF_SHARE * GRAVITY_MPS2
}

impl MeasuredTracks {
    /// Whether a robot is measured where landed ones are, with its thrust off.
    pub(super) fn is_landed(&self, sample: usize) -> bool {
        let at = &self.robots.samples[sample];
        self.landed_m.is_some_and(|landed_m| {
            let above_m = at.position_m[2] - landed_m;
            is_off(at) && above_m < RESTS_M
        })
    }

    /// Turns a robot that is free to turn to where it faces in the next sample, and puts it on the ground that has sunk to it under the
    /// command of a sample, where it comes to rest.
    pub(super) fn carry(&self, robot: &mut Robot, sample: usize) {
        let next_rad =
            self.robots.samples.get(sample + 1).map_or(f64::NAN, |next| next.heading_rad);
        if self.robots.commands.is_inertial() && !next_rad.is_nan() {
            robot.heading_rad = next_rad;
        }
        let Some(ground_m) = self.landed_m else { return };
        let is_lifted = 0.0 <= self.robots.samples[sample].command[2];
        if is_lifted || ground_m < robot.position_m[2] {
            return;
        }
        robot.position_m[2] = ground_m;
        robot.drive = [0.0; 3];
        robot.push_mps2 = [0.0; 3];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A flyer of 1 kg in steps of 0.1 s at these heights, with thrust as a share of the weight.
    fn flown(heights_m: &[f64], share: f64) -> RobotSamples {
        let sample = |(index, &height_m): (usize, &f64)| RobotSample {
            line: index,
            run: 0,
            agent: 0,
            time_s: 0.1 * index as f64,
            position_m: [1.0, 0.0, height_m],
            heading_rad: f64::NAN,
            command: [0.0, 0.0, (share - 1.0) * GRAVITY_MPS2],
        };
        RobotSamples {
            samples: heights_m.iter().enumerate().map(sample).collect(),
            tracks: std::iter::once(0..heights_m.len()).collect(),
            covariates: Vec::new(),
            commands: CommandKind::Thrust,
            shape: robotsim::dynamics::Shape::Velocity,
            is_spatial: true,
            rejected: Vec::new(),
            warnings: Vec::new(),
            n_rows: heights_m.len(),
        }
    }

    #[test]
    fn a_flyer_that_rests_with_its_thrust_off_is_carried_and_one_that_falls_is_not() {
        let level = Terrain::default();
        assert_eq!(landed_m(&flown(&[0.03; 20], 0.0), &level), Some(0.03));
        assert_eq!(landed_m(&flown(&[0.03; 20], 1.0), &level), None);
        let falls: Vec<f64> = (0..20).map(|k| 20.0 - 0.05 * f64::from(k * k)).collect();
        assert_eq!(landed_m(&flown(&falls, 0.0), &level), None);

        let tracks = MeasuredTracks::new(flown(&[0.03; 20], 0.0), 1.0, level);
        let mut robot =
            Robot { position_m: [1.0, 0.0, -0.02], drive: [0.5, 0.0, -1.0], ..Robot::default() };
        tracks.carry(&mut robot, 3);
        assert_eq!((robot.position_m, robot.drive), ([1.0, 0.0, 0.03], [0.0; 3]));
        assert!(tracks.is_landed(3));
    }
}
