//! Fits a radio model with further terms to rows: Newton's method on the likelihood of the instrument.

use crate::links::likelihood::reception::{PowerMixture, SampledCurve};
use crate::links::likelihood::{Instrument, Noise, RowLikelihood, RowPrediction};
use crate::links::random_effects::{NewtonStep, Random, RandomEffectSds, RowCells, Scales};
use crate::links::rows::{Contribution, ModelledLinks};
use crate::links::terms::active::{ActiveEffect, AlteredRegister, level};
use crate::links::terms::basis::Basis;
use crate::links::terms::{TermSpec, TermState};
use crate::{StopFlag, TermId};
use nalgebra::{DMatrix, DVector};
use numbers::power::square;
use physics::effect::Effect;
use proto::effect;
use std::sync::Arc;

mod linear;
mod noise_bound;
mod objective;
pub(super) mod run;
pub mod search;
mod starts;

/// A model of links fitted to measurements: terms with their states, noise and random levels.
#[derive(Clone, Debug)]
pub struct LinkFit {
    /// Terms, as indices of candidates.
    pub terms: Vec<TermId>,
    /// Their states, in the same order.
    pub states: Vec<TermState>,
    /// How frames vary about the mean level, and which pass.
    pub instrument: Instrument,
    /// Random levels of nodes, links and channels (dB).
    pub random: Random,
    /// Over what its random levels change.
    pub scales: Scales,
    /// The level at which it is judged.
    pub level: effect::Level,
    /// Log likelihood of the rows it was fitted to: random levels integrated out (Laplace).
    pub log_likelihood: f64,
    /// Information about the parameters of all terms in their order, then the logarithm of the noise.
    pub information: DMatrix<f64>,
    /// Effects of the terms.
    effects: Vec<Option<ActiveEffect>>,
}

/// A fit to be made: rows, terms, and what is held fixed.
pub struct FitProblem<'a> {
    /// The measurements and the configured model.
    pub rows: &'a ModelledLinks,
    /// The terms of the model, in the order of their parameters.
    pub specs: Vec<&'a TermSpec>,
    /// The groups of all rows for random levels.
    pub cells: &'a RowCells,
    /// Over what random levels change in them.
    pub scales: Scales,
    /// The level at which the fit will be judged.
    pub level: effect::Level,
    /// Indices of the rows to fit to.
    pub train: &'a [u32],
    /// Standard deviation of the noise (dB), where the configuration gives it; `None`: it is fitted.
    pub fixed_sd_db: Option<f64>,
    /// Which standard deviations of random levels the fit may change.
    pub free: FreeRandomEffects,
    /// The spreads of random levels stay as they are, and the noise with them.
    pub holds: bool,
    /// A parameter that stays where it is: its term, and its place there.
    pub held: Option<(usize, usize)>,
    /// Terms that are sums of columns, or are taken for such.
    pub bases: Vec<Option<Arc<Basis>>>,
    /// Whether the fit is to stop where it is.
    pub stop: &'a StopFlag,
}

/// The random effects whose standard deviations a fit estimates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FreeRandomEffects {
    /// Whether that of links is estimated.
    pub link: bool,
    /// Whether that of channels is estimated.
    pub channel: bool,
    /// Whether those of nodes, as senders and as receivers, are estimated.
    pub nodes: bool,
    /// Whether that of times is estimated.
    pub times: bool,
}

/// By how much a value at a knot is changed for a derivative.
const CURVE_STEP: f64 = 1e-3;

/// Limits on the iterations of a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IterationLimits {
    /// Most steps of Newton's method.
    pub most_steps: usize,
    /// Most rounds in which the spreads of random levels are found.
    pub rounds: usize,
}

/// The noise lies within these (dB); a configuration takes no more either.
pub(super) const NOISE_DB: (f64, f64) = (0.1, 30.0);
/// Where readings are given, the share received scatters within these about what is predicted, at first by so much.
const SHARE_SD: (f64, f64) = (1e-3, 1.0);
const ROUGH_SHARE_SD: f64 = 0.2;
/// What is gained in the last step (nats).
const CONVERGED_NATS: f64 = 1e-4;
/// Levels of the rows that are fitted, and what terms add to them.
#[derive(Clone)]
struct Levels {
    /// By term, by row.
    parts: Vec<Vec<Contribution>>,
    levels: Vec<RowPrediction>,
}

/// Parameters, noise and random effects of a search, with what follows from them.
#[derive(Clone)]
struct Point {
    states: Vec<TermState>,
    effects: Vec<Option<ActiveEffect>>,
    levels: Levels,
    instrument: Instrument,
    random: Random,
    likelihoods: Vec<RowLikelihood>,
    log: f64,
}

impl<'a> FitProblem<'a> {
    fn effects(&self, states: &[TermState]) -> Vec<Option<ActiveEffect>> {
        self.specs
            .iter()
            .zip(states)
            .map(|(spec, state)| {
                state.build(spec).map(|effect| ActiveEffect::new(effect, self.rows))
            })
            .collect()
    }

    /// Contribution of the term at a place to each row of the training set.
    fn contribution(
        &self,
        place: usize,
        state: &TermState,
        effect: Option<&dyn Effect>,
    ) -> Vec<Contribution> {
        if let Some(basis) = &self.bases[place] {
            let power_db = |row: u32| basis.contribution(&state.values, row as usize);
            let added = |&row: &u32| Contribution::of_power(power_db(row));
            return self.train.iter().map(added).collect();
        }
        match (self.specs[place], effect) {
            (TermSpec::Curve(curve), _) => self
                .train
                .iter()
                .map(|&row| curve.contribution(&state.values, row as usize))
                .collect(),
            (_, Some(effect)) => {
                self.train.iter().map(|&row| self.rows.contribution(effect, row as usize)).collect()
            }
            (_, None) => Vec::new(),
        }
    }

    fn levels(&self, parts: Vec<Vec<Contribution>>, effects: &[Option<ActiveEffect>]) -> Levels {
        let mut added = vec![Contribution::default(); self.train.len()];
        for part in &parts {
            for (sum, term) in added.iter_mut().zip(part) {
                *sum += *term;
            }
        }
        let otherwise = AlteredRegister::from_effects(effects, self.rows);
        let levels = self
            .train
            .iter()
            .zip(added)
            .map(|(&row, added)| level(self.rows, row as usize, added, &otherwise))
            .collect();
        Levels { parts, levels }
    }

    /// The instrument with this noise: with the curve and the spread of the terms that have one.
    fn instrument(&self, effects: &[Option<ActiveEffect>], noise: Noise) -> Instrument {
        let curve = effects.iter().rev().flatten().find_map(|active| active.effect.curve());
        let curve =
            SampledCurve::tabulate(curve.unwrap_or_else(|| self.rows.model.reception_curve()));
        let mut spread = self.rows.base_spread();
        for scatter in effects.iter().flatten().filter_map(|active| active.effect.scatter()) {
            spread = spread.and(&PowerMixture::of_law(&scatter.law));
        }
        let instrument = Instrument::new(curve, spread, noise, self.rows.links.readings);
        if instrument.readings.is_aggregated && !instrument.readings.is_given {
            instrument.with_tables(self.rows.silent_frames())
        } else {
            instrument
        }
    }

    fn row_likelihoods(
        &self,
        instrument: &Instrument,
        levels: &Levels,
        random: &Random,
    ) -> Vec<RowLikelihood> {
        let any = random.sd != RandomEffectSds::default();
        self.train
            .iter()
            .zip(&levels.levels)
            .map(|(&row, level)| {
                let blup_db = if any { random.level_db(self.cells, row as usize) } else { 0.0 };
                instrument.row_likelihood(&self.rows.links.rows[row as usize], level, blup_db)
            })
            .collect()
    }

    fn point_at(&self, states: Vec<TermState>, noise: Noise, random: Random) -> Point {
        let effects = self.effects(&states);
        let parts = (0..self.specs.len())
            .map(|place| {
                self.contribution(
                    place,
                    &states[place],
                    effects[place].as_ref().map(ActiveEffect::get),
                )
            })
            .collect();
        let levels = self.levels(parts, &effects);
        let noise = self.bounded(noise, &levels.levels);
        let instrument = self.instrument(&effects, noise);
        let likelihoods = self.row_likelihoods(&instrument, &levels, &random);
        let log = likelihoods.iter().map(|row| row.log).sum::<f64>() + random.penalty(self.cells);
        Point { states, effects, levels, instrument, random, likelihoods, log }
    }

    /// Fits from given states.
    #[must_use]
    pub fn fit(
        &self,
        terms: &[TermId],
        states: Vec<TermState>,
        noise: Option<Noise>,
        random: Random,
        steps: IterationLimits,
    ) -> LinkFit {
        let is_random = random.sd != RandomEffectSds::default() && !self.holds;
        let mut noise = noise.unwrap_or_else(|| self.rough_noise(&states));
        noise.sd_db = self.fixed_sd_db.unwrap_or(noise.sd_db);
        let start = self.point_at(states, noise, random);
        let (mut point, mut lm_step) = self.maximum(start, steps.most_steps);
        if is_random {
            let mut before = point.log - lm_step.half_log_determinant;
            for _ in 0..steps.rounds {
                let (sd, _) = point.random.suggested(self.cells);
                let noise = self.suggested_noise(&point);
                let old = point.random.sd;
                point.random.sd = RandomEffectSds {
                    link_db: if self.free.link { sd.link_db } else { old.link_db },
                    channel_db: if self.free.channel { sd.channel_db } else { old.channel_db },
                    tx_db: if self.free.nodes { sd.tx_db } else { old.tx_db },
                    rx_db: if self.free.nodes { sd.rx_db } else { old.rx_db },
                    time_db: if self.free.times { sd.time_db } else { old.time_db },
                };
                let random = point.random.clone();
                (point, lm_step) = self.maximum(self.point_at(point.states, noise, random), 6);
                let now = point.log - lm_step.half_log_determinant;
                if (now - before).abs() < 0.02 || self.stop.is_set() {
                    break;
                }
                before = now;
            }
        }
        LinkFit {
            terms: terms.to_vec(),
            scales: self.scales,
            level: self.level,
            log_likelihood: point.log - lm_step.half_log_determinant,
            information: lm_step.information,
            states: point.states,
            instrument: point.instrument,
            random: point.random,
            effects: point.effects,
        }
    }

    /// The noise that the rows suggest, levels of cells counted as what they are worth.
    fn suggested_noise(&self, point: &Point) -> Noise {
        let Noise { sd_db, link_sd_db, share_sd } = point.instrument.noise();
        let n_received =
            self.train.iter().filter(|&&row| self.rows.is_received(row as usize)).count() as f64;
        let n_effects = point.random.n_determined(self.cells);
        let moved = |sd_db: f64, slope: f64, information: f64| {
            let step = (slope + n_effects) / information.max(1.0);
            (sd_db * libm::exp(step.clamp(-0.5, 0.5))).clamp(NOISE_DB.0, NOISE_DB.1)
        };
        let over_ln_sd: f64 = point.likelihoods.iter().map(|row| row.over_ln_sd).sum();
        let information = 2.0 * (n_received - 0.5 * n_effects);
        if !self.rows.links.readings.is_aggregated {
            let is_fixed = self.fixed_sd_db.is_some();
            let moved = moved(sd_db, over_ln_sd, information);
            return Noise { sd_db: if is_fixed { sd_db } else { moved }, link_sd_db, share_sd };
        }
        // Levels of cells take from what rows vary; how frames vary about them is another matter.
        let over_link: f64 = point.likelihoods.iter().map(|row| row.over_ln_link_sd).sum();
        let squares: f64 = point.likelihoods.iter().map(|row| square(row.over_ln_sd)).sum();
        let step = (over_ln_sd / squares.max(1e-9)).clamp(-0.5, 0.5);
        let frames = (sd_db * libm::exp(step)).clamp(NOISE_DB.0, NOISE_DB.1);
        Noise {
            sd_db: if self.fixed_sd_db.is_some() { sd_db } else { frames },
            link_sd_db: moved(link_sd_db, over_link, information),
            share_sd,
        }
    }

    /// A first guess of the noise: the spread of what was received about the mean level.
    fn rough_noise(&self, states: &[TermState]) -> Noise {
        let effects = self.effects(states);
        let parts = (0..self.specs.len())
            .map(|place| {
                self.contribution(
                    place,
                    &states[place],
                    effects[place].as_ref().map(ActiveEffect::get),
                )
            })
            .collect();
        let levels = self.levels(parts, &effects);
        let (mut sum, mut n) = (0.0, 0.0);
        for (&row, level) in self.train.iter().zip(&levels.levels) {
            let rssi = self.rows.links.rows[row as usize].rssi_dbm;
            if rssi.is_finite() {
                let deviation = rssi - level.power_dbm - level.range.offset_db;
                sum += deviation * deviation;
                n += 1.0;
            }
        }
        // Without a reading nothing says how large the noise is.
        let sd_db = if n < 1.0 { 3.0 } else { f64::sqrt(sum / n).clamp(0.3, 20.0) };
        let is_aggregated = self.rows.links.readings.is_aggregated;
        Noise {
            sd_db: if is_aggregated { 2.0 } else { sd_db },
            link_sd_db: sd_db,
            share_sd: ROUGH_SHARE_SD,
        }
    }

    fn n_parameters(&self, point: &Point) -> usize {
        point.states.iter().map(|state| state.values.len()).sum()
    }

    /// The point after a step, parameters within their ranges.
    fn after_step(&self, point: &Point, step: &NewtonStep) -> Point {
        let mut states = point.states.clone();
        let mut index = 0;
        for (spec, state) in self.specs.iter().zip(&mut states) {
            for (k, value) in state.values.iter_mut().enumerate() {
                let change = step.parameters[index];
                *value = match spec.parameters().get(k) {
                    Some(parameter) => (*value + change).clamp(parameter.min, parameter.max),
                    None => *value + change,
                };
                index += 1;
            }
        }
        let mut noise = point.instrument.noise();
        if index < step.parameters.len() {
            let factor = libm::exp(step.parameters[index].clamp(-0.7, 0.7));
            if self.rows.links.readings.is_given {
                noise.share_sd = (noise.share_sd * factor).clamp(SHARE_SD.0, SHARE_SD.1);
            } else {
                noise.sd_db = (noise.sd_db * factor).clamp(NOISE_DB.0, NOISE_DB.1);
            }
        }
        if index + 1 < step.parameters.len() {
            let change = step.parameters[index + 1].clamp(-0.7, 0.7);
            noise.link_sd_db = (noise.link_sd_db * libm::exp(change)).clamp(NOISE_DB.0, NOISE_DB.1);
        }
        let random = point.random.moved(&step.random);
        self.point_at(states, noise, random)
    }

    /// Derivatives of the levels over the parameters, row by row; then information and gradient of everything that is not
    /// a mean: shifts, losses, curves, noise.
    fn derivatives(&self, point: &Point) -> (Vec<f64>, DMatrix<f64>, DVector<f64>) {
        let readings = self.rows.links.readings;
        let fits_noise = point.random.sd == RandomEffectSds::default()
            && (self.fixed_sd_db.is_none() || readings.is_aggregated);
        let n_terms = self.n_parameters(point);
        let fits_rows = fits_noise && readings.is_aggregated && !readings.is_given;
        let p = n_terms + usize::from(fits_noise) + usize::from(fits_rows);
        let n = self.train.len();
        let mut jacobian = vec![0.0; n * p];
        let mut scores: Vec<(usize, Vec<f64>)> = Vec::new();
        let mut index = 0;
        for (place, (spec, state)) in self.specs.iter().zip(&point.states).enumerate() {
            if let TermSpec::Curve(curve) = spec
                && !curve.is_loss
            {
                for (i, &row) in self.train.iter().enumerate() {
                    for (k, part) in curve.shares(row as usize) {
                        jacobian[i * p + index + k] += part;
                    }
                }
                index += curve.knots.len();
                continue;
            }
            if let Some(basis) = &self.bases[place] {
                for k in 0..state.values.len() {
                    if self.held == Some((place, k)) {
                        index += 1;
                        continue;
                    }
                    let column = basis.column(k);
                    for (i, &row) in self.train.iter().enumerate() {
                        jacobian[i * p + index] = column[row as usize];
                    }
                    index += 1;
                }
                continue;
            }
            for k in 0..state.values.len() {
                if self.held == Some((place, k)) {
                    index += 1;
                    continue;
                }
                let mut displaced = state.clone();
                let mut step = CURVE_STEP;
                if let Some(parameter) = spec.parameters().get(k) {
                    step = 1e-3 * parameter.step;
                    // At the upper bound the difference is taken downwards: values beyond it are not valid.
                    if parameter.max < state.values[k] + step {
                        step = -step;
                    }
                }
                displaced.values[k] += step;
                let effect =
                    displaced.build(spec).map(|effect| ActiveEffect::new(effect, self.rows));
                if effect.is_none() && !matches!(spec, TermSpec::Curve(_)) {
                    index += 1;
                    continue;
                }
                let part =
                    self.contribution(place, &displaced, effect.as_ref().map(ActiveEffect::get));
                // What moves means only enters by the weights of rows; everything else by the outer product of its
                // scores.
                let is_mean = effect.as_ref().is_some_and(ActiveEffect::is_plain)
                    && part
                        .iter()
                        .zip(&point.levels.parts[place])
                        .all(|(a, b)| a.shift_db == b.shift_db && a.ln_survival == b.ln_survival);
                if is_mean {
                    for (i, (a, b)) in part.iter().zip(&point.levels.parts[place]).enumerate() {
                        jacobian[i * p + index] = (a.power_db - b.power_db) / step;
                    }
                } else {
                    let mut effects = point.effects.clone();
                    let has_curve = effect.as_ref().is_some_and(ActiveEffect::is_instrument);
                    effects[place] = effect;
                    let mut parts = point.levels.parts.clone();
                    parts[place] = part;
                    let levels = self.levels(parts, &effects);
                    let likelihoods = if has_curve {
                        let instrument = self.instrument(&effects, point.instrument.noise());
                        self.row_likelihoods(&instrument, &levels, &point.random)
                    } else {
                        self.row_likelihoods(&point.instrument, &levels, &point.random)
                    };
                    let score = likelihoods
                        .iter()
                        .zip(&point.likelihoods)
                        .map(|(a, b)| (a.log - b.log) / step)
                        .collect();
                    scores.push((index, score));
                }
                index += 1;
            }
        }
        if fits_noise {
            let is_free = f64::from(u8::from(self.fixed_sd_db.is_none() || readings.is_given));
            let of_noise = point.likelihoods.iter().map(|slope| is_free * slope.over_ln_sd);
            scores.push((n_terms, of_noise.collect()));
        }
        if fits_rows {
            let of_rows = point.likelihoods.iter().map(|row| row.over_ln_link_sd);
            scores.push((n_terms + 1, of_rows.collect()));
        }
        // Information by the outer product of scores where a parameter is no mean.
        let mut extra = DMatrix::zeros(p, p);
        let mut gradient = DVector::zeros(p);
        for (a, (j, first)) in scores.iter().enumerate() {
            gradient[*j] += first.iter().sum::<f64>();
            for (k, second) in &scores[..=a] {
                let sum: f64 = first.iter().zip(second).map(|(x, y)| x * y).sum();
                extra[(*j, *k)] += sum;
                if j != k {
                    extra[(*k, *j)] += sum;
                }
            }
            for i in 0..n {
                let slope = point.likelihoods[i].over_level * first[i];
                for k in 0..n_terms {
                    let entry = jacobian[i * p + k];
                    if entry != 0.0 {
                        extra[(*j, k)] += entry * slope;
                        extra[(k, *j)] += entry * slope;
                    }
                }
            }
        }
        (jacobian, extra, gradient)
    }
}

impl LinkFit {
    /// The fit as it predicts links of which nothing is known.
    pub(super) fn without_links(&self) -> Self {
        Self { random: self.random.without_links(), ..self.clone() }
    }

    /// Effects with which registers read otherwise.
    pub(super) fn otherwise(&self, rows: &ModelledLinks) -> AlteredRegister<'_> {
        AlteredRegister::from_effects(&self.effects, rows)
    }

    /// What the fitted model says about any row, random levels apart.
    pub(super) fn level(
        &self,
        (rows, specs): (&ModelledLinks, &[&TermSpec]),
        row: usize,
        otherwise: &AlteredRegister<'_>,
    ) -> RowPrediction {
        let mut added = Contribution::default();
        for ((spec, state), effect) in specs.iter().zip(&self.states).zip(&self.effects) {
            match (spec, effect) {
                (TermSpec::Curve(curve), _) => added += curve.contribution(&state.values, row),
                (_, Some(effect)) => added += rows.contribution(effect.get(), row),
                (_, None) => {}
            }
        }
        level(rows, row, added, otherwise)
    }
}
