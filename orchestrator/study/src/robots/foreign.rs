//! Another robot simulator's predictions as the base model, in place of our own kinematics.
//!
//! The recording of each robot is cut into segments of [`FOREIGN_SEGMENT_S`]. For each, the other simulator is asked where the robot
//! gets to that starts in a measured state and executes the recorded commands, begun [`FOREIGN_LEAD_S`] earlier so that what its
//! actuators do has settled. What it predicts from one sample to the next is a step, seen from the body where robots turn. The
//! base model moves a robot by these steps from wherever it is believed to be. That is exact for a simulator whose robots move
//! alike everywhere. For one whose robots do not, such as on a slope, the place and heading that count are at most
//! [`FOREIGN_LEAD_S`] + [`FOREIGN_SEGMENT_S`] of its own prediction away from measured ones.
//!
//! An effect adds what our own kinematics with it differs from our own kinematics without it, step by step, both begun where
//! the robot is believed to be: the first order of the effect on top of any base model. With our own kinematics as the base
//! this is the model with the effect itself.

use super::motion::{MeasuredTracks, rotated};
use super::{RobotFit, RobotStudy};
use crate::thresholds::{FOREIGN_LEAD_S, FOREIGN_SEGMENT_S};
use measure::robots::{RobotSample, RobotSamples};
use numbers::power::square;
use proto::prediction::{
    MAX_STEPS, MotionCommandKind, PredictedWindow, PredictionStep, PredictionWindow,
};
use robotsim::dynamics::physics::{Physics, Robot};
use robotsim::dynamics::{Drive, Dynamics, Shape, wrapped};
use std::f64::consts::PI;
use std::ops::Range;
use std::sync::Arc;

/// A segment cannot be asked for.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "line {line}: {n} samples of one robot within {span_s} s; at most {MAX_STEPS} can be predicted by another robot \
     simulator at a time. Leave out rows so that fewer remain"
)]
pub struct TooDense {
    /// Line of the file on which they begin.
    pub line: usize,
    /// How many there are.
    pub n: usize,
    /// Within how long (s).
    pub span_s: f64,
}

/// A part of a track that is predicted together, as indices of samples.
#[derive(Clone, Debug)]
struct Segment {
    /// The sample at which the prediction begins.
    lead: usize,
    /// The samples whose steps, to the next sample each, are taken from it.
    samples: Range<usize>,
}

/// The segments of all tracks, in order.
fn segments(robots: &RobotSamples) -> Vec<Segment> {
    let mut segments = Vec::new();
    for track in &robots.tracks {
        let samples = &robots.samples;
        let mut first = track.start;
        // The last sample has no step.
        while first + 1 < track.end {
            let begin_s = samples[first].time_s;
            let inside = |k: &usize| samples[*k].time_s < begin_s + FOREIGN_SEGMENT_S;
            let end = (first + 1..track.end - 1).find(|k| !inside(k)).unwrap_or(track.end - 1);
            let lead = (track.start..first)
                .rev()
                .take_while(|&k| begin_s - FOREIGN_LEAD_S <= samples[k].time_s)
                .last()
                .unwrap_or(first);
            segments.push(Segment { lead, samples: first..end });
            first = end;
        }
    }
    segments
}

/// How robots were commanded, in the terms of the contract.
#[must_use]
pub fn command_kind(shape: Shape) -> MotionCommandKind {
    match shape {
        Shape::Velocity => MotionCommandKind::Velocity,
        Shape::Unicycle => MotionCommandKind::SpeedAndYawRate,
        Shape::Car => MotionCommandKind::SpeedAndSteering,
    }
}

/// The windows that another robot simulator is to predict, for [`super::StatedSettings::predicted`].
///
/// # Errors
///
/// Samples lie so dense that a segment has more of them than a request may have.
pub fn prediction_windows(robots: &RobotSamples) -> Result<Vec<PredictionWindow>, TooDense> {
    let nanoseconds = |sample: &RobotSample| (sample.time_s.max(0.0) * 1e9).round() as u64;
    let window = |segment: Segment| {
        let first = &robots.samples[segment.lead];
        let samples = &robots.samples[segment.lead..=segment.samples.end];
        if MAX_STEPS < samples.len() - 1 {
            let span_s = samples[samples.len() - 1].time_s - first.time_s;
            return Err(TooDense { line: first.line, n: samples.len() - 1, span_s });
        }
        let step = |pair: &[RobotSample]| PredictionStep {
            duration_ns: nanoseconds(&pair[1]).saturating_sub(nanoseconds(&pair[0])).max(1),
            command: pair[0].command,
        };
        Ok(PredictionWindow {
            agent: first.agent,
            start_ns: nanoseconds(first),
            position_m: first.position_m,
            // A body that does not turn has no heading, and the contract needs a number.
            heading_rad: if first.heading_rad.is_nan() { 0.0 } else { first.heading_rad },
            velocity_mps: None,
            steps: samples.windows(2).map(step).collect(),
        })
    };
    segments(robots).into_iter().map(window).collect()
}

/// What the other simulator moves a robot from a sample to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct BaseStep {
    /// How far (m): ahead, to the left and up of where its body faces if it turns, else east, north and up.
    pub(super) moved_m: [f64; 3],
    /// How far it turns (rad).
    pub(super) turned_rad: f64,
}

/// Predicted steps of all tracks, and our own kinematics without any added effect.
#[derive(Debug)]
pub(super) struct ForeignBase {
    /// By sample; the last one of each track has none.
    steps: Vec<BaseStep>,
    reference: Physics,
}

impl ForeignBase {
    /// * `predicted`: of [`prediction_windows`], one for each, as long each.
    /// * `reference`: our own kinematics as configured.
    pub(super) fn new(
        robots: &RobotSamples,
        predicted: &[PredictedWindow],
        reference: Physics,
    ) -> Self {
        Self { steps: steps(robots, predicted), reference }
    }
}

pub(super) fn steps(robots: &RobotSamples, predicted: &[PredictedWindow]) -> Vec<BaseStep> {
    let mut steps = vec![BaseStep::default(); robots.samples.len()];
    for (Segment { lead, samples }, window) in segments(robots).into_iter().zip(predicted) {
        let begin = &robots.samples[lead];
        for sample in samples {
            let (from_m, from_rad) = match sample.checked_sub(lead + 1) {
                Some(before) => (window[before].position_m, window[before].heading_rad),
                None => (begin.position_m, begin.heading_rad),
            };
            let to = &window[sample - lead];
            let moved_m = std::array::from_fn(|i| to.position_m[i] - from_m[i]);
            steps[sample] = if robots.shape.is_turning() {
                let turned_rad = to.heading_rad - from_rad;
                // A heading that was wrapped in between did not turn all the way round.
                let turned_rad =
                    if PI < turned_rad.abs() { wrapped(turned_rad) } else { turned_rad };
                BaseStep { moved_m: rotated(moved_m, -from_rad), turned_rad }
            } else {
                BaseStep { moved_m, turned_rad: 0.0 }
            };
        }
    }
    steps
}

/// Wheelbase (m) of the kinematic bicycle whose heading changes are nearest to predicted ones, by least squares over θ̇ = v tan δ / L;
/// `None` where nobody is predicted to turn.
pub(super) fn wheelbase_m(robots: &RobotSamples, predicted: &[PredictedWindow]) -> Option<f64> {
    let (mut squares, mut product) = (0.0, 0.0);
    let samples = robots.samples.windows(2);
    for (pair, step) in samples.zip(steps(robots, predicted)) {
        if (pair[0].run, pair[0].agent) == (pair[1].run, pair[1].agent) {
            let [speed_mps, steer_rad, _] = pair[0].command;
            let arc = speed_mps * libm::tan(steer_rad) * (pair[1].time_s - pair[0].time_s);
            squares += arc * arc;
            product += arc * step.turned_rad;
        }
    }
    let wheelbase_m = squares / product;
    (0.01..=100.0).contains(&wheelbase_m).then_some(wheelbase_m)
}

impl MeasuredTracks {
    /// The same with another simulator's predictions as the base model, if there are any.
    #[must_use]
    pub(super) fn with_foreign(mut self, foreign: Option<Arc<ForeignBase>>) -> Self {
        self.foreign = foreign;
        self
    }
}

impl RobotStudy {
    /// How far (m, root mean square over windows) a fit moves the ends of windows against the base model, and how far from those
    /// they are by other predictions alone, such as of the same simulator with the effects of the fit in its configuration.
    ///
    /// * `predicted`: of [`prediction_windows`], one for each, as long each.
    ///
    /// Returns `None` if the dynamics cannot be built.
    #[must_use]
    pub fn applied(&self, fit: &RobotFit, predicted: &[PredictedWindow]) -> Option<[f64; 2]> {
        let model = &self.model;
        let (physics, gains) = model.physics(fit)?;
        let plain = || {
            let effects = &model.catalogue.effects;
            Some(Dynamics::build(&model.dynamics, "", effects, &mut Vec::new())?.into_physics())
        };
        let tracks = |base| {
            let window_s = model.tracks.window_s(0);
            MeasuredTracks::new(self.robots().clone(), window_s, model.tracks.terrain().clone())
                .with_foreign(base)
        };
        let before = tracks(model.tracks.foreign.clone());
        let base = ForeignBase::new(self.robots(), predicted, plain()?);
        let after = tracks(Some(Arc::new(base)));
        let plain = plain()?;
        let fitted = before.ends_m(&physics, gains);
        let distance_m = |others: Vec<[f64; 3]>| {
            let squares = fitted.iter().zip(&others);
            let squares = squares.map(|(a, b)| (0..3).map(|i| square(a[i] - b[i])).sum::<f64>());
            (squares.sum::<f64>() / fitted.len().max(1) as f64).sqrt()
        };
        Some([before.ends_m(&plain, gains), after.ends_m(&plain, gains)].map(distance_m))
    }
}

/// Takes a robot along its track, sample by sample: by a model alone, or by what such a model changes in another simulator's
/// predictions.
pub(super) struct Mover<'a> {
    tracks: &'a MeasuredTracks,
    physics: &'a Physics,
    track: usize,
    next: usize,
    /// Our own kinematics without added effects, begun like the robot, and where it is in the orders.
    reference: Option<(&'a ForeignBase, Drive, usize)>,
}

impl<'a> Mover<'a> {
    /// From where these samples of a track begin.
    pub(super) fn new(
        tracks: &'a MeasuredTracks,
        physics: &'a Physics,
        track: usize,
        samples: &Range<usize>,
    ) -> Self {
        let drive = |base: &ForeignBase| tracks.begin(samples, &base.reference).drive;
        let drive = tracks.foreign.as_deref().map(drive).unwrap_or_default();
        Self::from(tracks, physics, (track, samples.start), drive)
    }

    /// From a sample of a track with `drive`, what our own kinematics does there.
    pub(super) fn from(
        tracks: &'a MeasuredTracks,
        physics: &'a Physics,
        (track, first): (usize, usize),
        drive: Drive,
    ) -> Self {
        let time_s = tracks.robots.samples[first].time_s;
        let next = tracks.orders[track].partition_point(|order| order.from_s <= time_s);
        let reference = tracks.foreign.as_deref().map(|base| (base, drive, next));
        Self { tracks, physics, track, next, reference }
    }

    /// What our own kinematics does now, where another simulator's predictions are the base.
    pub(super) fn reference_drive(&self) -> Drive {
        self.reference.map(|(_, drive, _)| drive).unwrap_or_default()
    }

    /// Moves a robot from a sample of the track to the next.
    pub(super) fn advance(&mut self, robot: &mut Robot, sample: usize) {
        let Self { tracks, physics, track, .. } = *self;
        let around = tracks.surroundings(sample);
        let [from_s, until_s] = [sample, sample + 1].map(|k| tracks.robots.samples[k].time_s);
        let orders = &tracks.orders[track][..];
        let from = *robot;
        physics.advance(robot, orders, &mut self.next, from_s, until_s, &around);
        tracks.carry(robot, sample);
        let Some((base, drive, next)) = &mut self.reference else { return };
        let mut plain = Robot { drive: *drive, ..from };
        base.reference.advance(&mut plain, orders, next, from_s, until_s, &around);
        *drive = plain.drive;
        let step = &base.steps[sample];
        let moved_m = if physics.shape().is_turning() {
            rotated(step.moved_m, from.heading_rad)
        } else {
            step.moved_m
        };
        robot.position_m = std::array::from_fn(|i| {
            from.position_m[i] + moved_m[i] + (robot.position_m[i] - plain.position_m[i])
        });
        robot.heading_rad =
            from.heading_rad + step.turned_rad + (robot.heading_rad - plain.heading_rad);
    }
}
