//! Measured links compared with a radio model.
//!
//! | module | what |
//! |---|---|
//! | [`rows`] | the measurements as the physics sees them: covariates, blocks that are left out together, what the data suffice for |
//! | [`likelihood`] | how likely a row is: readings, lost frames, rounding, reception, registers |
//! | [`terms`] | what may be added to the model: candidates, effects at certain values, effects limited to some rows |
//! | [`random_effects`] | levels of nodes, links, channels and times: over what they change, how far they reach, whether they agree |
//! | [`fit`] | Newton's method on all of it; from where it starts, and the search for places, headings and times that no map shows |
//! | [`predict`] | what a fit says: predictions, residuals, estimates with intervals, corrected measurements |

pub mod fit;
pub mod likelihood;
pub mod predict;
pub mod random_effects;
pub mod rows;
pub mod terms;

use super::choices::{ChoiceError, Choices};
use super::defects::evidence::Evidence;
use super::defects::node_place::{self, NodeLevel};
use super::defects::{outliers, position_noise};
use super::folds::Blocks;
use super::limits::NotLimited;
use super::linear::{Column, Dependence, Direction, Linearised, Partition, Signature};
use super::symbolic::FittedFormula;
use super::{
    Candidate, Estimate, PerTerm, PredictionDifference, Residuals, RowScore, StopFlag, Study,
    TermId,
};
use crate::thresholds::{
    DECORRELATION_M, DEFAULT_DECORRELATION_M, FEWEST_REPLICATES, MOST_SEARCHED_ROWS,
    NODE_PLACE_SHARE, SELECTED_SHARE, UNCORRECTED_LEVEL,
};
use fit::LinkFit;
use likelihood::Instrument;
use likelihood::reception::SampledCurve;
use measure::links::Losses;
use physics::catalogue::Catalogue;
use predict::RandomEffect;
use predict::directions::DirectionsApart;
use proto::effect::{Level, Search};
use random_effects::cells::{FINEST_M, drift_times_s};
use random_effects::{RandomEffectSds, RowCells, Scales};
use rows::blocks::{self, Grouped};
use rows::passes::Passes;
use rows::{ModelledLinks, covariates};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use terms::basis::Bases;
use terms::{TermSpec, candidates};

/// Measured links compared with a radio model.
#[derive(Debug)]
pub struct LinkStudy {
    /// The measurements and the model.
    pub rows: ModelledLinks,
    candidates: PerTerm<Candidate>,
    specs: PerTerm<TermSpec>,
    time: Blocks,
    place: Blocks,
    /// Links and channels, where nothing was measured twice.
    once: Option<Blocks>,
    /// Why places are held out by default, if they are.
    fallback: Option<String>,
    /// The lengths over which levels of links may change (m).
    lengths_m: Vec<f64>,
    /// The times over which levels may drift (s).
    times_s: Vec<f64>,
    /// Cells by what they change over.
    cells: Mutex<Vec<(Scales, Arc<RowCells>)>>,
    fixed_sd_db: Option<f64>,
    configured: RandomEffectSds,
    /// The effects that may be missing.
    catalogue: Catalogue,
    bases: Bases,
    /// What was chosen by hand.
    choices: Choices,
    /// How many rows fits may see.
    n_fitted: usize,
    /// How many rows there are for each that differs from all others, where no time tells whether these are of one frame.
    repeats: f64,
    /// How many nodes send, and how many receive.
    n_ends: [usize; 2],
    /// Where pairs and places are few: passes of a node that turns on the spot, if there are enough to show the pattern of its antenna.
    passes: Option<Passes>,
    /// Whether fits are to stop.
    stop: StopFlag,
    /// Nobody said whether lost frames were logged.
    are_losses_unknown: bool,
}

impl LinkStudy {
    /// Holds the rows against their model, with every radio effect of the catalogue and a curve over every covariate as
    /// candidates.
    ///
    /// # Errors
    ///
    /// Rows cannot be left out as chosen.
    pub fn new(
        rows: ModelledLinks,
        fixed_sd_db: Option<f64>,
        choices: &Choices,
        catalogue: &Catalogue,
    ) -> Result<Self, ChoiceError> {
        let specs = candidates::specs(&rows, &catalogue.effects);
        let Grouped { time, place, once, fallback } = blocks::grouped(&rows, choices)?;
        let moving = rows.still().values().any(|still| !still);
        let lengths: &[f64] = if moving { &DECORRELATION_M } else { &[DEFAULT_DECORRELATION_M] };
        let finest = [FINEST_M];
        let times_s = drift_times_s(&rows);
        let lengths = lengths.iter().chain(finest.iter().filter(|_| moving));
        let configured = RandomEffectSds::configured(&rows);
        let passes = (!place.are_many())
            .then(|| Passes::of(&rows))
            .filter(|passes| FEWEST_REPLICATES <= passes.rows.len());
        let candidates = specs.iter().map(|spec| {
            let candidate = candidates::candidate(spec, &rows, catalogue);
            // What one pair shows as it turns is judged over time.
            let is_of_pass = passes.is_some() && spec.search() == Search::Headings;
            Candidate { level: if is_of_pass { Level::Time } else { candidate.level }, ..candidate }
        });
        let candidates = candidates.collect();
        Ok(Self {
            passes,
            n_fitted: time.fitted().len(),
            n_ends: blocks::n_ends(&rows),
            repeats: blocks::repeats(&rows),
            choices: choices.clone(),
            rows,
            candidates,
            specs,
            time,
            place,
            once,
            fallback,
            lengths_m: lengths.copied().collect(),
            times_s,
            cells: Mutex::default(),
            fixed_sd_db,
            configured,
            catalogue: catalogue.clone(),
            bases: Bases::default(),
            stop: StopFlag::default(),
            are_losses_unknown: false,
        })
    }

    /// The same study, where nobody may have said whether lost frames were logged.
    #[must_use]
    pub(crate) fn with_losses_unknown(self, are_losses_unknown: bool) -> Self {
        Self { are_losses_unknown, ..self }
    }

    /// The same measurements as if received frames alone had been logged, where nobody said whether lost frames were and it matters: more than one reading in a hundred is of a level at which more than one frame in a hundred is lost. That is asked
    /// of the readings, not of the model, which may be far off.
    #[must_use]
    pub fn as_received(&self) -> Option<Self> {
        if !self.are_losses_unknown {
            return None;
        }
        let curve = SampledCurve::tabulate(self.rows.model.reception_curve());
        let readings = self.rows.links.rows.iter().map(|row| row.rssi_dbm);
        let readings: Vec<f64> = readings.filter(|dbm| dbm.is_finite()).collect();
        let weak = readings.iter().filter(|&&dbm| curve.own_at(dbm) < 1.0 - SELECTED_SHARE);
        if (weak.count() as f64) < SELECTED_SHARE * readings.len() as f64 {
            return None;
        }
        let mut rows = self.rows.clone();
        rows.links.readings.losses = Losses::NotLogged;
        let study = Self::new(rows, self.fixed_sd_db, &self.choices, &self.catalogue).ok()?;
        Some(study.with_stop_flag(&self.stop))
    }

    /// The same study, whose fits end early once `stop` is set.
    #[must_use]
    pub fn with_stop_flag(self, stop: &StopFlag) -> Self {
        Self { stop: stop.clone(), ..self }
    }

    /// A study of about as many rows as a search needs, spread evenly; none where there are hardly more. Nothing that is worth
    /// having in so many rows escapes; the numbers are then fitted to all.
    #[must_use]
    pub fn thinned(&self) -> Option<Self> {
        let is_aggregated = self.rows.links.readings.is_aggregated;
        let most = if is_aggregated { MOST_SEARCHED_ROWS / 3 } else { MOST_SEARCHED_ROWS };
        // A study that is hardly smaller saves no time.
        if self.rows.len() < most + most / 4 {
            return None;
        }
        let rows = self.rows.some(&blocks::spread_evenly(&self.rows, most));
        let thin = Self::new(rows, self.fixed_sd_db, &self.choices, &self.catalogue).ok()?;
        let names = |study: &Self| -> Vec<String> {
            study.candidates.iter().map(|candidate| candidate.name.clone()).collect()
        };
        // Terms are numbers of candidates: of other candidates, the selection would mean other terms.
        (names(&thin) == names(self))
            .then(|| thin.with_stop_flag(&self.stop).with_losses_unknown(self.are_losses_unknown))
    }

    /// Why blocks of places are held out in place of the default blocks, if they are.
    #[must_use]
    pub fn fallback(&self) -> Option<&str> {
        self.fallback.as_deref()
    }

    /// What each term is made of.
    #[must_use]
    pub fn specs(&self) -> &PerTerm<TermSpec> {
        &self.specs
    }

    /// How many motes stand still throughout.
    #[must_use]
    pub fn still_motes(&self) -> usize {
        self.rows.still().values().filter(|still| **still).count()
    }

    /// What an error may depend on: a value per row.
    #[must_use]
    pub fn covariates(&self) -> Vec<(String, Vec<f64>)> {
        covariates::by_name(&self.rows)
    }

    fn specs_of(&self, terms: &[TermId]) -> Vec<&TermSpec> {
        terms.iter().map(|&term| &self.specs[term]).collect()
    }
}

impl Study for LinkStudy {
    type Fit = LinkFit;

    fn candidates(&self) -> &PerTerm<Candidate> {
        &self.candidates
    }

    fn n_rows(&self) -> usize {
        self.rows.len()
    }

    fn is_stopped(&self) -> bool {
        self.stop.is_set()
    }

    fn design_effect(&self) -> f64 {
        self.repeats
    }

    fn blocks(&self, level: Level) -> &Blocks {
        match level {
            Level::Place => &self.place,
            Level::Random => self.once.as_ref().unwrap_or(&self.time),
            Level::Time | Level::Run => &self.time,
        }
    }

    fn nodes_with_levels(&self, term: TermId) -> Option<Vec<[u32; 2]>> {
        let nodes = || self.rows.links.rows.iter().map(|row| [row.tx, row.rx]).collect();
        matches!(self.specs[term], TermSpec::NodeOffset(_)).then(nodes)
    }

    fn resurveyed(&self, fit: &LinkFit, level: NodeLevel) -> Option<(String, Self)> {
        let evidence = Evidence::new(self, fit)?;
        let place = node_place::likeliest(&evidence, NODE_PLACE_SHARE, level)
            .filter(|it| it.p_value < UNCORRECTED_LEVEL)?;
        let study = self.corrected(&place.correction).ok()??;
        Some((place.clause, study))
    }

    fn is_shape_of_noise(&self, with: &LinkFit, without: &LinkFit) -> bool {
        let evidence = [with, without].map(|fit| Evidence::new(self, fit));
        matches!(&evidence, [Some(with), Some(without)] if outliers::is_shape_of_noise(with, without))
    }

    fn position_noise_m(&self, fit: &LinkFit, covariate: &str) -> Option<f64> {
        if !covariates::OF_PLACES.contains(&covariate) {
            return None;
        }
        let found = position_noise::test(&Evidence::new(self, fit)?)?;
        let sd_m = found.estimates.first()?.value;
        (found.p_value < UNCORRECTED_LEVEL).then_some(sd_m)
    }

    fn judging_level(&self, level: Level) -> Level {
        if level == Level::Random && self.once.is_none() { Level::Time } else { level }
    }

    fn fit(
        &self,
        terms: &[TermId],
        train: &[u32],
        level: Level,
        start: Option<&LinkFit>,
    ) -> LinkFit {
        self.fitted(terms, train, level, start)
    }

    fn screen(&self, terms: &[TermId], level: Level, parent: &LinkFit) -> Option<LinkFit> {
        self.screened(terms, level, parent)
    }

    fn prediction_difference(
        &self,
        one: &LinkFit,
        other: &LinkFit,
    ) -> Option<PredictionDifference> {
        Some(self.difference_by_row(one, other))
    }

    fn scanned_covariates(&self) -> Vec<(String, Vec<f64>)> {
        let mut covariates = self.covariates();
        covariates.retain(|(name, _)| !covariates::OF_NODES.contains(&name.as_str()));
        covariates
    }

    fn scanned_blocks(&self) -> Vec<&Blocks> {
        let levels = [&self.time, &self.place];
        if levels.iter().all(|blocks| blocks.are_many()) { levels.to_vec() } else { Vec::new() }
    }

    fn scanned_residuals(&self, fit: &LinkFit) -> Residuals {
        self.standardised(fit)
    }

    fn formula_of_curve(&self, term: TermId, fit_without: &LinkFit) -> Option<FittedFormula> {
        self.curve_as_formula(term, fit_without)
    }

    fn formula_of_residuals(&self, covariate: &str, fit: &LinkFit) -> Option<FittedFormula> {
        self.residuals_as_formula(covariate, fit)
    }

    fn with_parameter_held(
        &self,
        fit: &LinkFit,
        term: TermId,
        key: &str,
        value: f64,
    ) -> Option<LinkFit> {
        self.held_at(fit, term, key, value)
    }

    fn linearised(&self, fit: &LinkFit) -> Option<Linearised> {
        self.linearised_at(fit)
    }

    fn columns(&self, _fit: &LinkFit, term: TermId) -> Vec<Column> {
        self.signatures_of(term).into_iter().map(|signature| signature.column).collect()
    }

    fn signatures(&self, _fit: &LinkFit, term: TermId) -> Vec<Signature> {
        self.signatures_of(term)
    }

    fn is_searched_for(&self, term: TermId) -> bool {
        self.specs[term].search() != Search::Starts
    }

    fn columns_of_curve(&self, _fit: &LinkFit, term: TermId) -> Vec<Column> {
        self.curve_columns_of(term)
    }

    fn directions(&self) -> Vec<Direction> {
        self.directions_of()
    }

    fn partitions(&self) -> Vec<Partition> {
        self.partitions_of()
    }

    fn dependence(&self) -> Dependence {
        self.dependence_of()
    }

    fn add_limited(&mut self, term: TermId, limits: &toml::Table) -> Result<TermId, NotLimited> {
        self.limit(term, limits)
    }

    fn span_of_search(&self, fit: &LinkFit, term: TermId) -> Option<(toml::Table, f64)> {
        self.window_of(fit, term)
    }

    fn add_another(&mut self, term: TermId) -> Option<TermId> {
        self.another(term)
    }

    fn passes(&self, term: TermId) -> Option<&Passes> {
        let is_of_pass = self.candidates[term].level == Level::Time
            && self.specs[term].search() == Search::Headings;
        self.passes.as_ref().filter(|_| is_of_pass)
    }

    fn directions_apart(&self, fit: &LinkFit, term: TermId) -> Option<DirectionsApart> {
        matches!(self.specs[term], TermSpec::NodeOffset(_)).then(|| self.two_directions(fit))?
    }

    fn is_drift(&self, term: TermId) -> bool {
        matches!(self.specs[term], TermSpec::Drift(_))
    }

    fn agreement(&self, fit: &LinkFit, term: TermId) -> Option<f64> {
        match self.specs[term] {
            TermSpec::Drift(_) => Some(self.p_value_of_agreement(fit)),
            TermSpec::NodeOffset(_) => self.p_value_of_nodes(&fit.without_links()),
            TermSpec::Multipath(_) => Some(self.p_value_of_channels(fit)),
            TermSpec::LinkDrift(_) => Some(self.p_value_of_times(fit)),
            _ => None,
        }
    }

    fn log_likelihood(&self, fit: &LinkFit) -> f64 {
        fit.log_likelihood
    }

    fn scores(&self, fit: &LinkFit, test: &[u32]) -> Vec<RowScore> {
        let specs = self.specs_of(&fit.terms);
        let cells = self.cells(fit.scales);
        let otherwise = fit.otherwise(&self.rows);
        let mut tables: BTreeMap<i64, Instrument> = BTreeMap::new();
        test.iter()
            .map(|&row| {
                let row = row as usize;
                let level = fit.level((&self.rows, &specs), row, &otherwise);
                let above = RandomEffect::for_row(fit, &cells, row);
                self.score(fit, row, (&level, &otherwise), above, &mut tables)
            })
            .collect()
    }

    fn estimates(&self, fit: &LinkFit, term: TermId) -> (Vec<Estimate>, Option<String>) {
        self.estimates_of(fit, term)
    }

    fn settings(&self, fit: &LinkFit, term: TermId) -> Option<toml::Table> {
        self.settings_of(fit, term)
    }
}
