//! From positions and commands up to a moment, and the commands after it, to where the robot will be.

use super::density::Residual;
use super::foreign::{ForeignBase, Mover};
use super::ground;
use super::inertial::{self, VelocityVariance};
use super::neighbours::others;
use super::subset::Stretch;
use crate::thresholds::FEWEST_RUNS_ALIKE;
use measure::robots::{RobotSample, RobotSamples};
use numbers::power::square;
use proto::ids::AgentId;
use proto::site::Terrain;
use robotsim::dynamics::physics::{Order, Physics, Robot};
use robotsim::dynamics::surroundings::{Columns, Other, Surroundings};
use robotsim::dynamics::{Drive, wrapped};
use std::ops::Range;
use std::sync::Arc;

/// A row: from one sample of a track to a later one, as indices of samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MotionWindow {
    pub(super) track: u32,
    pub(super) start: u32,
    pub(super) end: u32,
}

/// How much a new measurement counts against what the model made of all earlier ones: 1 trusts it alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Gains {
    pub(super) position: f64,
    /// Of a heading, for the direction of motion.
    pub(super) heading: f64,
    /// Of a heading, for the headings that follow: the error of a sensor that drifts is in all of these, and in no motion.
    pub(super) sensor: f64,
}

impl Gains {
    /// Those of the measurement after step `index`: the first ones count in full, as a mean of all so far does.
    fn after(self, index: usize) -> Self {
        let of = |gain: f64| gain.max(1.0 / (index + 2) as f64);
        Self { position: of(self.position), heading: of(self.heading), sensor: of(self.sensor) }
    }
}

/// Measured tracks, ready to be predicted.
#[derive(Clone, Debug)]
pub(super) struct MeasuredTracks {
    pub(super) robots: RobotSamples,
    /// Time between samples (s): the median.
    pub(super) spacing_s: f64,
    /// Sorted by track and start.
    pub(super) windows: Vec<MotionWindow>,
    /// How many windows overlap at any time.
    pub(super) n_overlapping: f64,
    /// Parts of tracks that are predicted, each by itself: all of each track, or what a subset of the windows needs.
    pub(super) stretches: Vec<Stretch>,
    /// What each track was commanded, sorted by time.
    pub(super) orders: Vec<Vec<Order>>,
    /// The others of the same campaign at each sample; empty where they do not matter.
    others: Vec<Vec<Other>>,
    terrain: Terrain,
    /// Height (m) at which robots are measured that have landed; none where none has.
    pub(super) landed_m: Option<f64>,
    /// Directions (cosine, sine) along which the errors of windows are given; empty: along what is predicted.
    pub(super) frames: Vec<[f64; 2]>,
    /// Another simulator's predictions, where they are the base model.
    pub(super) foreign: Option<Arc<ForeignBase>>,
}

/// Where the model alone takes each robot in each stretch, sample by sample: for motion that is alike everywhere, whatever measurements
/// count. Empty where motion depends on the place.
pub(super) type ModelPaths = Vec<Vec<Robot>>;

/// Estimated state of a robot when a window begins.
#[derive(Clone, Copy, Debug, Default)]
struct StateEstimate {
    robot: Robot,
    /// Variance of the position, per variance of one measurement.
    variance: f64,
    /// Where the model alone would be, and by how much (rad) the estimate is turned against it.
    path_m: [f64; 3],
    turned_rad: f64,
    /// What the sensor of the heading is expected to show (rad).
    shown_rad: f64,
    /// What the model moved the estimate since the sample before.
    step_m: [f64; 3],
    /// What our own kinematics does, where another simulator's predictions are the base.
    reference: Drive,
    /// Of bodies that keep their velocity: what scatters in that, too.
    velocity: VelocityVariance,
}

/// What a robot is predicted to do in a window.
#[derive(Clone, Copy, Debug)]
struct PredictedMotion {
    /// From where the window begins to where it ends (m).
    way_m: [f64; 3],
    /// Heading that is measured at its end (rad).
    heading_rad: f64,
}

impl MeasuredTracks {
    /// Windows of `window_s`, four of which overlap where samples are close enough.
    pub(super) fn new(robots: RobotSamples, window_s: f64, terrain: Terrain) -> Self {
        let spacing_s = robots.spacing_s();
        let stride = ((0.25 * window_s / spacing_s).round() as usize).max(1);
        let tolerance_s = 0.51 * spacing_s;
        let mut windows = Vec::new();
        let mut stretches = Vec::new();
        let mut orders = Vec::new();
        for (number, track) in robots.tracks.iter().enumerate() {
            let first_window = windows.len();
            let samples = &robots.samples[track.clone()];
            let mut end = 0;
            let first = inertial::first_start(&robots, track, window_s);
            for start in (first..samples.len()).step_by(stride) {
                let until_s = samples[start].time_s + window_s;
                while end < samples.len() && samples[end].time_s < until_s - tolerance_s {
                    end += 1;
                }
                if end < samples.len() && samples[end].time_s <= until_s + tolerance_s {
                    windows.push(MotionWindow {
                        track: number as u32,
                        start: (track.start + start) as u32,
                        end: (track.start + end) as u32,
                    });
                }
            }
            let windows = first_window..windows.len();
            stretches.push(Stretch { track: number, samples: track.clone(), windows });
            // What was commanded at first is taken to have been in force before.
            let mut list = vec![Order { from_s: f64::NEG_INFINITY, demand: samples[0].command }];
            for sample in samples {
                if list.last().is_some_and(|last| last.demand != sample.command) {
                    list.push(Order { from_s: sample.time_s, demand: sample.command });
                }
            }
            orders.push(list);
        }
        let others = others(&robots);
        let n_overlapping = (window_s / (stride as f64 * spacing_s)).max(1.0);
        let frames = Vec::new();
        let foreign = None;
        let landed_m = ground::landed_m(&robots, &terrain);
        Self {
            robots,
            spacing_s,
            landed_m,
            windows,
            n_overlapping,
            stretches,
            orders,
            others,
            terrain,
            frames,
            foreign,
        }
    }

    /// Only some of the windows. All samples stay: what is known when a window begins follows from those before.
    pub(super) fn keep(&mut self, kept: &[bool]) {
        let mut first = 0;
        for Stretch { windows, .. } in &mut self.stretches {
            let n = kept[windows.clone()].iter().filter(|kept| **kept).count();
            *windows = first..first + n;
            first += n;
        }
        let mut at = kept.iter();
        self.windows.retain(|_| at.next().is_some_and(|kept| *kept));
    }

    /// The sample at which a window begins.
    pub(super) fn start(&self, window: &MotionWindow) -> &RobotSample {
        &self.robots.samples[window.start as usize]
    }

    /// The campaign of each window.
    pub(super) fn runs(&self) -> Vec<u32> {
        self.windows.iter().map(|window| self.start(window).run).collect()
    }

    /// The line of the file on which each window begins.
    pub(super) fn lines(&self) -> Vec<usize> {
        self.windows.iter().map(|window| self.start(window).line).collect()
    }

    /// Length of a window (s).
    pub(super) fn window_s(&self, window: usize) -> f64 {
        let MotionWindow { start, end, .. } = self.windows[window];
        self.robots.samples[end as usize].time_s - self.robots.samples[start as usize].time_s
    }

    /// Time from a sample to the next of its track (s).
    pub(super) fn step_s(&self, sample: usize) -> f64 {
        self.robots.samples[sample + 1].time_s - self.robots.samples[sample].time_s
    }

    /// Sums of what happens step by step to where robots are believed to be, of which every measurement corrects its share.
    ///
    /// * `sums`: room for them.
    /// * `add`: adds what happens from a sample to the next.
    /// * `tell`: receives the sums where each window begins.
    pub(super) fn believed<const N: usize>(
        &self,
        gains: Gains,
        sums: &mut [[f64; N]],
        add: impl Fn(usize, &mut [[f64; N]]),
        mut tell: impl FnMut(&[[f64; N]]),
    ) {
        for Stretch { samples, windows, .. } in &self.stretches {
            let mut windows = self.windows[windows.clone()].iter().peekable();
            sums.fill([0.0; N]);
            for (index, sample) in samples.clone().enumerate() {
                if windows.next_if(|window| window.start as usize == sample).is_some() {
                    tell(sums);
                }
                if windows.peek().is_none() {
                    break;
                }
                add(sample, sums);
                let correction = gains.after(index).position;
                for sum in sums.iter_mut().flatten() {
                    *sum *= 1.0 - correction;
                }
            }
        }
    }

    /// What the model moves a robot (m, east and north) from each sample to the next of its track.
    pub(super) fn steps_m(&self, physics: &Physics, gains: Gains) -> Vec<[f64; 2]> {
        let mut steps_m = vec![[0.0; 2]; self.robots.samples.len()];
        let paths = self.paths(physics);
        for (number, stretch) in self.stretches.iter().enumerate() {
            if stretch.windows.is_empty() {
                continue;
            }
            let estimates = self.state_estimates(stretch, physics, paths.get(number), gains);
            for (sample, after) in stretch.samples.clone().zip(&estimates[1..]) {
                steps_m[sample] = [after.step_m[0], after.step_m[1]];
            }
        }
        steps_m
    }

    /// Directions (cosine, sine) in which the windows are predicted to go.
    pub(super) fn directions(&self, physics: &Physics, gains: Gains) -> Vec<[f64; 2]> {
        self.predictions(physics, &self.paths(physics), gains)
            .into_iter()
            .map(|(_, moved)| direction(moved.way_m))
            .collect()
    }

    /// Whether positions are counted from where each campaign began: a direction or a place of the plane is then another one
    /// in every campaign.
    pub(super) fn is_relative(&self) -> bool {
        let first = |track: &std::ops::Range<usize>| &self.robots.samples[track.start];
        let mut runs: Vec<u32> = self.robots.tracks.iter().map(|track| first(track).run).collect();
        runs.dedup();
        let [begin, rest @ ..] = &self.robots.tracks[..] else { return false };
        let place_m = first(begin).position_m;
        let is_same = |track: &std::ops::Range<usize>| {
            let other_m = first(track).position_m;
            (0..2).all(|axis| (other_m[axis] - place_m[axis]).abs() < SAME_M)
        };
        FEWEST_RUNS_ALIKE <= runs.len() && rest.iter().all(is_same)
    }

    /// Whether the height of the ground is known.
    pub(super) fn has_terrain(&self) -> bool {
        !self.terrain.is_level()
    }

    /// The ground.
    pub(super) fn terrain(&self) -> &Terrain {
        &self.terrain
    }

    /// Whether some robot has company.
    pub(super) fn has_others(&self) -> bool {
        self.others.iter().any(|others| !others.is_empty())
    }

    /// Simulates every track by the model alone. Empty if a robot's motion depends on where it begins.
    pub(super) fn paths(&self, physics: &Physics) -> ModelPaths {
        // Where motion depends on the place, a path from the start of the track cannot be moved to where a window
        // begins.
        if !physics.is_alike_everywhere() {
            return ModelPaths::new();
        }
        let path = |stretch: &Stretch| {
            if stretch.windows.is_empty() { Vec::new() } else { self.path(stretch, physics) }
        };
        self.stretches.iter().map(path).collect()
    }

    /// Predicts all windows, and says how far measurements lie from that. `paths`: those of this physics.
    pub(super) fn residuals(
        &self,
        physics: &Physics,
        paths: &ModelPaths,
        gains: Gains,
    ) -> Vec<Residual> {
        let predictions = self.predictions(physics, paths, gains);
        let both = self.windows.iter().zip(predictions).enumerate();
        let is_turning = physics.shape().is_turning();
        both.map(|(index, (window, (begin, moved)))| {
            let frame = self.frames.get(index).copied().unwrap_or_else(|| direction(moved.way_m));
            let mut residual = self.residual(window, &begin, moved.way_m, frame);
            if is_turning {
                let measured_rad = self.robots.samples[window.end as usize].heading_rad;
                residual.heading_rad = wrapped(measured_rad - moved.heading_rad);
            }
            residual
        })
        .collect()
    }

    /// From now on the errors of all windows are given along these directions. A term that moves a robot at rest by a hair would
    /// turn its error otherwise.
    pub(super) fn fix_frames(&mut self, frames: Vec<[f64; 2]>) {
        self.frames = frames;
    }

    /// Where each window is predicted to end (m).
    pub(super) fn ends_m(&self, physics: &Physics, gains: Gains) -> Vec<[f64; 3]> {
        let predictions = self.predictions(physics, &self.paths(physics), gains);
        let end = |(begin, moved): (StateEstimate, PredictedMotion)| {
            std::array::from_fn(|i| begin.robot.position_m[i] + moved.way_m[i])
        };
        predictions.into_iter().map(end).collect()
    }

    /// What is known when each window begins, and what the robot is predicted to move in it.
    fn predictions(
        &self,
        physics: &Physics,
        paths: &ModelPaths,
        gains: Gains,
    ) -> Vec<(StateEstimate, PredictedMotion)> {
        let mut predictions = Vec::with_capacity(self.windows.len());
        let is_alike = !paths.is_empty();
        for (number, stretch) in self.stretches.iter().enumerate() {
            let windows = &self.windows[stretch.windows.clone()];
            if windows.is_empty() {
                continue;
            }
            let estimates = self.state_estimates(stretch, physics, paths.get(number), gains);
            for window in windows {
                let [first, last] = [window.start, window.end]
                    .map(|sample| sample as usize - stretch.samples.start);
                let begin = estimates[first];
                let moved = if is_alike {
                    let end = &estimates[last];
                    let path_m = std::array::from_fn(|i| end.path_m[i] - begin.path_m[i]);
                    PredictedMotion {
                        way_m: rotated(path_m, begin.turned_rad),
                        heading_rad: begin.shown_rad + paths[number][last].heading_rad
                            - paths[number][first].heading_rad,
                    }
                } else {
                    self.simulate(physics, stretch.track, window, &begin)
                };
                predictions.push((begin, moved));
            }
        }
        predictions
    }

    /// The residual of a window whose motion is predicted.
    fn residual(
        &self,
        window: &MotionWindow,
        begin: &StateEstimate,
        moved_m: [f64; 3],
        [cos, sin]: [f64; 2],
    ) -> Residual {
        let end = &self.robots.samples[window.end as usize];
        let (measured_m, window_s) = (end.position_m, end.time_s - self.start(window).time_s);
        let error_m: [f64; 3] =
            std::array::from_fn(|i| measured_m[i] - (begin.robot.position_m[i] + moved_m[i]));
        let way_m = libm::hypot(moved_m[0], moved_m[1]);
        Residual {
            parts_m: [
                error_m[0] * cos + error_m[1] * sin,
                error_m[1] * cos - error_m[0] * sin,
                error_m[2],
            ],
            spread: 1.0 + begin.variance + begin.velocity.spread(window_s),
            way_m,
            heading_rad: f64::NAN,
        }
    }

    /// A robot where these samples begin, doing what is commanded there.
    pub(super) fn begin(&self, samples: &Range<usize>, physics: &Physics) -> Robot {
        let first = &self.robots.samples[samples.start];
        let heading_rad = if first.heading_rad.is_nan() { 0.0 } else { first.heading_rad };
        let robot = Robot { position_m: first.position_m, heading_rad, ..Robot::default() };
        if physics.is_inertial() {
            return inertial::begin(robot, &self.robots.samples[samples.clone()]);
        }
        let around = self.surroundings(samples.start);
        let drive = physics.target_at(first.command, &robot, first.time_s, &around);
        Robot { drive, ..robot }
    }

    /// Estimated state of a robot at each sample of a stretch; `path`: where the model alone takes it, where motion is alike everywhere.
    fn state_estimates(
        &self,
        stretch: &Stretch,
        physics: &Physics,
        path: Option<&Vec<Robot>>,
        gains: Gains,
    ) -> Vec<StateEstimate> {
        match path {
            Some(path) => self.follow(stretch, path, physics.shape().is_turning(), gains),
            None => self.correct(stretch, physics, gains),
        }
    }

    /// Goes along a stretch by the model alone.
    fn path(&self, Stretch { track, samples, .. }: &Stretch, physics: &Physics) -> Vec<Robot> {
        let mut robot = self.begin(samples, physics);
        let mut path = Vec::with_capacity(samples.len());
        path.push(robot);
        let mut mover = Mover::new(self, physics, *track, samples);
        for sample in samples.start..samples.end - 1 {
            mover.advance(&mut robot, sample);
            path.push(robot);
        }
        path
    }

    /// Lets estimates follow the path of the model alone: for motion that is alike everywhere, so that what the model does
    /// from an estimate is what it does by itself, moved and turned.
    fn follow(
        &self,
        stretch: &Stretch,
        path: &[Robot],
        is_turning: bool,
        gains: Gains,
    ) -> Vec<StateEstimate> {
        let samples = &self.robots.samples[stretch.samples.clone()];
        let robot = path[0];
        let mut estimates = Vec::with_capacity(samples.len());
        let mut at = StateEstimate {
            robot,
            variance: 1.0,
            path_m: robot.position_m,
            shown_rad: robot.heading_rad,
            ..StateEstimate::default()
        };
        estimates.push(at);
        for (index, (pair, robot)) in samples.windows(2).zip(&path[1..]).enumerate() {
            let step_m: [f64; 3] = std::array::from_fn(|i| robot.position_m[i] - at.path_m[i]);
            let step_m = rotated(step_m, at.turned_rad);
            let gains = gains.after(index);
            let measured_m = pair[1].position_m;
            at.robot.position_m = std::array::from_fn(|i| {
                let expected = at.robot.position_m[i] + step_m[i];
                expected + gains.position * (measured_m[i] - expected)
            });
            if is_turning {
                let expected = robot.heading_rad + at.turned_rad;
                at.turned_rad += gains.heading * wrapped(pair[1].heading_rad - expected);
                at.shown_rad += robot.heading_rad - path[index].heading_rad;
                at.shown_rad += gains.sensor * wrapped(pair[1].heading_rad - at.shown_rad);
            }
            at.variance = square(1.0 - gains.position) * at.variance + square(gains.position);
            at.path_m = robot.position_m;
            at.step_m = step_m;
            estimates.push(at);
        }
        estimates
    }

    /// Goes along a stretch by the model, corrected by every measurement.
    fn correct(
        &self,
        Stretch { track, samples: range, .. }: &Stretch,
        physics: &Physics,
        gains: Gains,
    ) -> Vec<StateEstimate> {
        let samples = &self.robots.samples[range.clone()];
        let mut robot = self.begin(range, physics);
        let mut variance = 1.0;
        let mut shown_rad = robot.heading_rad;
        let mut velocity = VelocityVariance::default();
        let mut estimates = Vec::with_capacity(samples.len());
        let mut mover = Mover::new(self, physics, *track, range);
        let reference = mover.reference_drive();
        let first =
            StateEstimate { robot, variance, shown_rad, reference, ..StateEstimate::default() };
        estimates.push(first);
        for (index, pair) in samples.windows(2).enumerate() {
            let Robot { position_m: from_m, heading_rad: from_rad, .. } = robot;
            mover.advance(&mut robot, range.start + index);
            let step_m = std::array::from_fn(|i| robot.position_m[i] - from_m[i]);
            if physics.is_inertial() {
                let scatter = (&mut variance, &mut velocity);
                inertial::correct(&mut robot, pair, (gains.position, index), scatter);
                estimates.push(StateEstimate {
                    robot,
                    variance,
                    step_m,
                    velocity,
                    ..StateEstimate::default()
                });
                continue;
            }
            let gains = gains.after(index);
            for i in 0..3 {
                robot.position_m[i] +=
                    gains.position * (pair[1].position_m[i] - robot.position_m[i]);
            }
            if physics.shape().is_turning() {
                let measured_rad = pair[1].heading_rad;
                shown_rad += robot.heading_rad - from_rad;
                shown_rad += gains.sensor * wrapped(measured_rad - shown_rad);
                robot.heading_rad += gains.heading * wrapped(measured_rad - robot.heading_rad);
            }
            variance = square(1.0 - gains.position) * variance + square(gains.position);
            let reference = mover.reference_drive();
            estimates.push(StateEstimate {
                robot,
                variance,
                shown_rad,
                step_m,
                reference,
                ..StateEstimate::default()
            });
        }
        estimates
    }

    /// What a robot moves in a window.
    fn simulate(
        &self,
        physics: &Physics,
        track: usize,
        window: &MotionWindow,
        begin: &StateEstimate,
    ) -> PredictedMotion {
        let mut robot = begin.robot;
        let from_m = robot.position_m;
        let (first, end) = (window.start as usize, window.end as usize);
        let mut mover = Mover::from(self, physics, (track, first), begin.reference);
        for sample in first..end {
            mover.advance(&mut robot, sample);
        }
        PredictedMotion {
            way_m: std::array::from_fn(|i| robot.position_m[i] - from_m[i]),
            heading_rad: begin.shown_rad + robot.heading_rad - begin.robot.heading_rad,
        }
    }

    pub(super) fn surroundings(&self, sample: usize) -> Surroundings<'_> {
        Surroundings {
            agent: AgentId(self.robots.samples[sample].agent),
            run: Some(self.robots.samples[sample].run),
            terrain: Some(&self.terrain),
            others: self.others.get(sample).map_or(&[], |others| others),
            others_at_s: self.robots.samples[sample].time_s,
            columns: Columns { all: &self.robots.covariates, row: sample },
            draws: None,
        }
    }
}

/// Measured positions do not agree so closely (m), unless they are counted from there.
const SAME_M: f64 = 1e-6;

/// Cosine and sine of the direction of a motion; east where there is none.
fn direction(moved_m: [f64; 3]) -> [f64; 2] {
    let way_m = libm::hypot(moved_m[0], moved_m[1]);
    if way_m < 1e-9 { [1.0, 0.0] } else { [moved_m[0] / way_m, moved_m[1] / way_m] }
}

/// A vector turned counter-clockwise by an angle.
pub(super) fn rotated([x, y, z]: [f64; 3], angle_rad: f64) -> [f64; 3] {
    if angle_rad == 0.0 {
        return [x, y, z];
    }
    let (sin, cos) = libm::sincos(angle_rad);
    [x * cos - y * sin, x * sin + y * cos, z]
}
