//! Robot samples compared with `[robotsim.dynamics]`.
//!
//! A row is a window of a track: from all positions and commands up to its start, and the commands within it, the model says
//! where the robot will be at its end. Velocity is not measured: what the actuators do at the start follows from earlier
//! commands. The position (and heading) at the start is estimated from all earlier ones, each new measurement correcting what
//! the model made of those before by a share that is fitted with the noise.

mod blocks;
mod command_thresholds;
mod contradiction;
mod curve;
mod density;
mod derivatives;
mod discs;
mod fit;
mod fit_state;
mod foreign;
mod formulas;
mod ground;
mod headings;
mod inertial;
mod limited_effects;
mod linear;
mod motion;
mod neighbours;
mod noise_free_motion;
mod objective;
pub(crate) mod odd_commands;
mod rivals;
mod screen;
mod search;
mod subset;
mod terms;
#[cfg(test)]
mod tests;
mod view;

use super::choices::{ChoiceError, Choices, ConditionRows};
use super::folds::Blocks;
use super::formula::set;
use super::{Candidate, Estimate, StopFlag};
use crate::thresholds::{ROBOTS_COLLINEAR, WINDOW_S};
use crate::{PerTerm, TermId};
use density::ResidualDensity;
use derivatives::Derivatives;
use foreign::ForeignBase;
pub use foreign::{TooDense, command_kind, prediction_windows};
use headings::HeadingDensity;
use measure::Rejected;
use measure::robots::RobotSamples;
use measure::table::DataTable;
use motion::{Gains, MeasuredTracks};
use nalgebra::DMatrix;
use numbers::normal::Z_90;
use numbers::power::square;
use objective::Number;
use proto::prediction::PredictedWindow;
use proto::site::Terrain;
use robotsim::catalogue::Catalogue;
use robotsim::dynamics::physics::Physics;
use robotsim::dynamics::{Dynamics, Shape};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use terms::{Starts, Term};

/// Robot samples compared with a configuration.
#[derive(Debug)]
pub struct RobotStudy {
    model: RobotModel,
    candidates: PerTerm<Candidate>,
    in_time: Blocks,
    in_place: Blocks,
    configured: RobotFit,
    /// Windows that are left out by choice.
    rejected: Vec<Rejected>,
    /// How many windows fits may see.
    n_fitted: usize,
    cache: Mutex<BTreeMap<Vec<TermId>, RobotFit>>,
}

/// The configured model and what may be added to it.
#[derive(Debug)]
struct RobotModel {
    tracks: MeasuredTracks,
    dynamics: toml::Table,
    /// What the dynamics and its terms are made of.
    catalogue: Catalogue,
    is_wheelbase_free: bool,
    /// Standard deviation of the noise of measured positions (m), where it is given.
    given_sd_m: Option<f64>,
    /// Numbers that every model has: shares by which measurements correct, a car's wheelbase where it is not given.
    base: Vec<Number>,
    terms: PerTerm<Term>,
    /// Whether fits are to stop.
    stop: StopFlag,
    /// Directions in which windows go by the configured model: cosine and sine.
    directions: Vec<[f64; 2]>,
    /// What the configured model moves robots from each sample to the next (m, east and north).
    steps_m: Vec<[f64; 2]>,
}

/// Settings that the configuration states, so that they are not fitted.
#[derive(Clone, Debug, Default)]
pub struct StatedSettings {
    /// It says a car's wheelbase; otherwise that is fitted with the noise.
    pub is_wheelbase_given: bool,
    /// Standard deviation of the noise of measured positions (m), where it says that.
    pub sd_m: Option<f64>,
    /// Heights of the ground, from `[site]`.
    pub terrain: Terrain,
    /// The effects that may be missing.
    pub catalogue: Catalogue,
    /// What another robot simulator predicts of [`prediction_windows`], where that is the base model.
    pub predicted: Option<Vec<PredictedWindow>>,
}

/// The body that executes such commands: a kind of `[robotsim.dynamics]`.
pub(crate) fn body_for(shape: Shape) -> &'static str {
    match shape {
        Shape::Velocity => "point-mass",
        Shape::Unicycle => "unicycle",
        Shape::Car => "car",
    }
}

/// Refuses windows that are shorter than the time between samples, or longer than every track.
fn check_window(robots: &RobotSamples, window_s: f64) -> Result<(), ChoiceError> {
    let spacing_s = robots.spacing_s();
    let length_s = |track: &std::ops::Range<usize>| {
        robots.samples[track.end - 1].time_s - robots.samples[track.start].time_s
    };
    let longest_s = robots.tracks.iter().map(length_s).fold(0.0, f64::max);
    let refused = |reason: String, nearest_s: f64| {
        let nearest_s = (nearest_s * 1e6).round() * 1e-6;
        Err(ChoiceError::Window { window_s, reason, nearest_s })
    };
    if !(0.5 * spacing_s..).contains(&window_s) {
        return refused(
            format!("shorter than the sampling interval of {spacing_s:.6} s"),
            spacing_s,
        );
    }
    if longest_s + 0.5 * spacing_s < window_s {
        return refused(format!("longer than the longest track of {longest_s:.6} s"), longest_s);
    }
    Ok(())
}

/// A model fitted to some windows.
#[derive(Clone, Debug)]
pub struct RobotFit {
    terms: Vec<TermId>,
    values: Vec<f64>,
    density: ResidualDensity,
    log_likelihood: f64,
    /// Derivatives of all residuals at these numbers, once somebody asked for them.
    derivatives: Arc<OnceLock<Option<Derivatives>>>,
}

/// The model does not suit the file.
#[derive(Debug, thiserror::Error)]
pub enum RobotStudyError {
    /// The configured body takes other commands than the file has.
    #[error(
        "robotsim.dynamics.kind = {kind:?}: does not match the commands of the file; set it to {needed}"
    )]
    Body {
        /// What the file needs, in quotes.
        needed: String,
        /// What the configuration has.
        kind: String,
    },
    /// Commands of thrust need a mass.
    #[error(
        "robotsim.dynamics.mass_kg is required with commands of thrust (cmd_thrust_n): set it to the mass of a robot in kg"
    )]
    Mass,
    /// What was chosen by hand cannot be.
    #[error(transparent)]
    Choice(#[from] ChoiceError),
    /// No two samples are a window apart.
    #[error(
        "no two samples of a robot are {window_s} s apart, so no window of this length can be scored; choose another \
         length with --window"
    )]
    NoWindow {
        /// Length of a window (s).
        window_s: f64,
    },
    /// The dynamics cannot be built.
    #[error("robotsim.dynamics cannot be built")]
    Dynamics,
}

impl RobotFit {
    /// The numbers of a term.
    fn numbers(&self, model: &RobotModel, term: TermId) -> &[f64] {
        if !self.terms.contains(&term) {
            return &[];
        }
        let first = self.first(model, term);
        &self.values[first..first + model.n_numbers(term)]
    }

    /// Where the numbers of a term, which the fit has, begin among all.
    fn first(&self, model: &RobotModel, term: TermId) -> usize {
        let before = self.terms.iter().take_while(|&&other| other != term);
        model.base.len() + before.map(|&other| model.n_numbers(other)).sum::<usize>()
    }

    /// Standard deviation of one measured position, per component (m).
    #[must_use]
    pub fn sd_m(&self) -> f64 {
        self.density.sd_m
    }
}

impl RobotModel {
    fn n_numbers(&self, term: TermId) -> usize {
        match &self.terms[term] {
            Term::Effect(effect) => effect.parameters.len(),
            Term::Noise(_) => 0,
            Term::Curve(curve) => curve.n_numbers(),
        }
    }

    /// Whether a fit estimates the noise of measured positions.
    fn is_noise_free(&self, terms: &[TermId]) -> bool {
        self.given_sd_m.is_none()
            || terms.iter().any(|&term| matches!(self.terms[term], Term::Noise(_)))
    }

    fn curve(&self, term: TermId) -> Option<&curve::RobotCurve> {
        match &self.terms[term] {
            Term::Curve(curve) => Some(curve),
            Term::Effect(_) | Term::Noise(_) => None,
        }
    }

    /// Where a search for one more term starts.
    fn starts(&self, term: TermId, parent: &RobotFit, train: &[u32]) -> Vec<Vec<f64>> {
        match &self.terms[term] {
            Term::Effect(effect) => match &effect.starts {
                Starts::At(starts) => starts.clone(),
                Starts::Discs(discs) => self.likely_discs(parent, discs, train),
            },
            Term::Noise(_) => vec![Vec::new()],
            Term::Curve(curve) => vec![vec![0.0; curve.n_numbers()]],
        }
    }

    fn numbers_of(&self, terms: &[TermId]) -> Vec<Number> {
        let mut numbers = self.base.clone();
        for &term in terms {
            match &self.terms[term] {
                Term::Effect(effect) => numbers.extend(effect.parameters.iter().map(|parameter| {
                    Number { min: parameter.min, max: parameter.max, step: parameter.step }
                })),
                Term::Noise(_) => {}
                Term::Curve(curve) => {
                    let number = Number { min: -1e3, max: 1e3, step: 0.1 };
                    numbers.extend(std::iter::repeat_n(number, curve.n_numbers()));
                }
            }
        }
        numbers
    }

    /// Whether errors of the measured heading scatter predictions across the motion.
    fn has_direction(&self) -> bool {
        self.tracks.robots.shape.is_turning()
    }

    /// How many numbers, the first ones, say how much measurements count.
    fn n_gains(&self) -> usize {
        if self.has_direction() { 3 } else { 1 }
    }

    /// What a fit says of the robot, in steps that suffice for fits, and of how much measurements count.
    fn physics(&self, fit: &RobotFit) -> Option<(Physics, Gains)> {
        Some((self.physics_of_runs(fit)?.in_fits(), self.gains(fit)))
    }

    /// What a fit says of the robot, as runs simulate it.
    fn physics_of_runs(&self, fit: &RobotFit) -> Option<Physics> {
        let mut table = self.dynamics.clone();
        if self.is_wheelbase_free {
            set(&mut table, "wheelbase_m", fit.values[self.base.len() - 1]);
        }
        let effects = table.entry("effect").or_insert_with(|| toml::Value::Array(Vec::new()));
        for &term in &fit.terms {
            if let (Term::Effect(effect), Some(list)) = (&self.terms[term], effects.as_array_mut())
            {
                list.push(effect.table(fit.numbers(self, term)).into());
            }
        }
        Some(Dynamics::build(&table, "", &self.catalogue.effects, &mut Vec::new())?.into_physics())
    }

    /// How much measurements count under a fit.
    fn gains(&self, fit: &RobotFit) -> Gains {
        let position = libm::exp(fit.values[0]);
        let [heading, sensor] = if self.has_direction() {
            [1, 2].map(|index| libm::exp(fit.values[index]))
        } else {
            [1.0; 2]
        };
        Gains { position, heading, sensor }
    }
}

impl RobotStudy {
    /// Holds robot samples against a checked `[robotsim.dynamics]`.
    ///
    /// * `stated`: what the configuration says beside the dynamics.
    /// * `choices`, `table`: what is chosen by hand, and the file that the samples come from.
    ///
    /// # Errors
    ///
    /// The configured body takes other commands, no window fits into the samples, or a choice cannot be.
    pub fn new(
        robots: RobotSamples,
        dynamics: &toml::Table,
        stated: StatedSettings,
        (choices, table): (&Choices, &DataTable),
    ) -> Result<Self, RobotStudyError> {
        let StatedSettings { is_wheelbase_given, sd_m: given_sd_m, terrain, catalogue, predicted } =
            stated;
        let kind = dynamics.get("kind").and_then(toml::Value::as_str).unwrap_or_default();
        let bodies = robots.commands.bodies();
        if !bodies.contains(&kind) {
            let needed = bodies.iter().map(|body| format!("{body:?}")).collect::<Vec<_>>();
            let needed = needed.join(" or ");
            return Err(RobotStudyError::Body { needed, kind: kind.to_owned() });
        }
        let mut robots = robots;
        inertial::in_accelerations(&mut robots, dynamics)?;
        inertial::under_local_gravity(&mut robots, dynamics);
        let shape = robots.shape;
        let n_parts = if robots.is_spatial { 3 } else { 2 };
        let window_s = choices.window_s.unwrap_or(WINDOW_S);
        if choices.window_s.is_some() {
            check_window(&robots, window_s)?;
        }
        let mut dynamics = dynamics.clone();
        let is_foreign = predicted.is_some();
        let mut base = None;
        if let Some(predicted) = predicted {
            if shape == Shape::Car && !is_wheelbase_given {
                let wheelbase_m = foreign::wheelbase_m(&robots, &predicted);
                wheelbase_m.into_iter().for_each(|it| set(&mut dynamics, "wheelbase_m", it));
            }
            let reference = Dynamics::build(&dynamics, "", &catalogue.effects, &mut Vec::new());
            let reference = reference.ok_or(RobotStudyError::Dynamics)?.into_physics();
            base = Some(Arc::new(ForeignBase::new(&robots, &predicted, reference)));
        }
        let mut tracks = MeasuredTracks::new(robots, window_s, terrain).with_foreign(base);
        if tracks.windows.is_empty() {
            return Err(RobotStudyError::NoWindow { window_s });
        }
        let choices = choices.resolved(&tracks.runs())?;
        let seen = ConditionRows {
            table,
            lines: tracks.lines(),
            runs: tracks.runs(),
            derived: if choices.condition.is_some() { tracks.covariates() } else { Vec::new() },
            when: " when a window begins",
        };
        let kept = choices.select_rows(&seen)?;
        tracks.keep(&kept.rows);
        // Another simulator's predictions do not depend on the wheelbase of our own kinematics.
        let is_wheelbase_free = shape == Shape::Car && !is_wheelbase_given && !is_foreign;
        let gain = Number { min: -6.0, max: 0.0, step: 0.5 };
        let mut base = vec![gain];
        let mut values = vec![-1.0];
        if shape.is_turning() {
            base.extend([gain; 2]);
            values.extend([-1.0; 2]);
        }
        if is_wheelbase_free {
            base.push(Number { min: 0.01, max: 50.0, step: 0.01 });
            values
                .push(dynamics.get("wheelbase_m").and_then(toml::Value::as_float).unwrap_or(0.33));
        }
        let (candidates, terms) = terms::all(&tracks, &dynamics, given_sd_m.is_some(), &catalogue);
        let (in_time, in_place) = match choices.split {
            Some(split) => {
                let blocks = tracks.split_blocks(window_s, split)?;
                (blocks.clone(), blocks)
            }
            None => (tracks.default_blocks(window_s), tracks.blocks_in_place()),
        };
        let scored = choices.scored_rows(&tracks.runs());
        let [in_time, in_place] =
            [in_time, in_place].map(|blocks| Blocks { scored: scored.clone(), ..blocks });
        let mut model = RobotModel {
            tracks,
            dynamics,
            catalogue,
            is_wheelbase_free,
            given_sd_m,
            base,
            terms,
            stop: StopFlag::default(),
            directions: Vec::new(),
            steps_m: Vec::new(),
        };
        let start = RobotFit {
            terms: Vec::new(),
            values,
            density: ResidualDensity {
                sd_m: given_sd_m.unwrap_or(0.1),
                sd_rad: if shape.is_turning() { 0.01 } else { 0.0 },
                n_parts,
                heading: shape.is_turning().then(|| HeadingDensity::new(1.0)),
            },
            log_likelihood: f64::NEG_INFINITY,
            derivatives: Arc::default(),
        };
        let (physics, gains) = model.physics(&start).ok_or(RobotStudyError::Dynamics)?;
        model.directions = model.tracks.directions(&physics, gains);
        model.tracks.fix_frames(model.directions.clone());
        model.steps_m = model.tracks.steps_m(&physics, gains);
        let all = in_time.fitted();
        let mut configured = model.fitted(&[], &all, &start);
        if shape.is_turning() {
            model.turn_headings(&configured, &all);
            configured = model.fitted(&[], &all, &configured);
            let weight = model.heading_weight(&configured, &all, &in_time);
            let heading = configured.density.heading.map(|heading| heading.weighted(weight));
            configured.density.heading = heading;
            configured = model.fitted(&[], &all, &configured);
        }
        let mut study = Self {
            model,
            candidates,
            in_time,
            in_place,
            configured,
            rejected: kept.rejected,
            n_fitted: all.len(),
            cache: Mutex::default(),
        };
        if let Some(alone) = study.of_positions_alone(&all) {
            study.configured = alone;
        }
        Ok(study)
    }

    /// The same study, whose fits end early once `stop` is set.
    #[must_use]
    pub fn with_stop_flag(mut self, stop: &StopFlag) -> Self {
        self.model.stop = stop.clone();
        self
    }

    /// Windows that are left out by choice, by reason.
    #[must_use]
    pub fn rejected(&self) -> &[Rejected] {
        &self.rejected
    }

    /// The samples.
    #[must_use]
    pub fn robots(&self) -> &RobotSamples {
        &self.model.tracks.robots
    }

    /// The model as configured, with its noise estimated from all rows.
    #[must_use]
    pub fn configured(&self) -> &RobotFit {
        &self.configured
    }

    fn cached_fit(&self, terms: &[TermId]) -> Option<RobotFit> {
        self.cache.lock().unwrap_or_else(PoisonError::into_inner).get(terms).cloned()
    }

    /// Names the other term with which the first number of a term is nearly collinear.
    fn confounded(
        &self,
        fit: &RobotFit,
        term: TermId,
        covariance: Option<&DMatrix<f64>>,
    ) -> Option<String> {
        let covariance = covariance?;
        let first = fit.first(&self.model, term);
        for &other in fit.terms.iter().filter(|&&other| other != term) {
            let begin = fit.first(&self.model, other);
            for index in begin..begin + self.model.n_numbers(other) {
                let correlation = covariance[(first, index)]
                    / (covariance[(first, first)] * covariance[(index, index)]).sqrt();
                if ROBOTS_COLLINEAR < correlation.abs() {
                    return Some(format!(
                        "is nearly collinear with {}: the correlation of their estimates is {correlation:.2}",
                        self.candidates[other].name
                    ));
                }
            }
        }
        None
    }

    /// The `[[robotsim.dynamics.effect]]` that a term of a fit is; none where it is a curve.
    #[must_use]
    pub fn effect_table(&self, fit: &RobotFit, term: TermId) -> Option<toml::Table> {
        if !fit.terms.contains(&term) {
            return None;
        }
        match &self.model.terms[term] {
            Term::Effect(effect) => Some(effect.table(fit.numbers(&self.model, term))),
            Term::Noise(table) => {
                // What there is beside the noise that the configuration says.
                let given_m = self.model.given_sd_m.unwrap_or(0.0);
                let more_m = (square(fit.density.sd_m) - given_m * given_m).max(0.0).sqrt();
                let mut table = table.clone();
                set(&mut table, "sd_m", more_m);
                Some(table)
            }
            Term::Curve(_) => None,
        }
    }

    /// The noise of measured positions, with an interval: by the number of independent residuals.
    fn noise(&self, fit: &RobotFit) -> Estimate {
        let value = fit.density.sd_m;
        // Each window has as many residuals as positions have components.
        let n_windows = self.n_fitted as f64 / self.model.tracks.n_overlapping;
        let n = (n_windows * fit.density.n_parts as f64).max(1.0);
        let half = Z_90 * value / (2.0 * n).sqrt();
        Estimate::new("sd_m", "m", value, (value - half, value + half))
    }

    /// A car's wheelbase (m), where it is fitted.
    #[must_use]
    pub fn wheelbase_m(&self, fit: &RobotFit) -> Option<f64> {
        self.model.is_wheelbase_free.then(|| fit.values[self.model.base.len() - 1])
    }
}
