//! Measured links compared with a radio model.
//!
//! | module | what |
//! |---|---|
//! | [`rows`] | the measurements as the physics sees them |
//! | [`likelihood`] | how likely a row is: readings, lost frames, rounding |
//! | [`reception`] | the probability that a frame passes, noise averaged out |
//! | [`terms`] | what may be added to the model |
//! | [`fit`] | Newton's method on all of it |
//! | `candidates` | what may be missing |
//! | `active` | effects at certain values |
//! | `agreement` | whether links change together in time |
//! | [`basis`] | terms that are sums of columns |
//! | [`cells`] | random levels of nodes, links and channels |
//! | `scales` | over what random levels change |
//! | `starts` | from where a fit starts, and which start is best |
//! | [`search`] | places, nodes and times that an effect needs and that no map shows |
//! | `group` | blocks that are left out together, cells that share a level |
//! | `estimates` | numbers with intervals |
//! | [`predict`] | what a fit predicts, and the residuals |
//! | `correction` | predictions of changed rows, and studies of corrected measurements |
//! | [`covariance`] | how far levels of links reach |
//! | [`covariates`] | what an error may depend on, given or derived |
//! | `view` | predictions row by row, for pictures |
//! | [`testable`] | what the data lack for an effect to be tested |

mod active;
mod agreement;
pub mod basis;
mod candidates;
pub mod cells;
mod correction;
pub mod covariance;
pub mod covariates;
mod estimates;
pub mod fit;
mod group;
pub mod likelihood;
mod limited_effects;
mod linear;
mod noise_bound;
pub mod predict;
pub mod reception;
pub mod register;
pub mod rows;
mod scales;
pub mod search;
mod starts;
pub mod terms;
pub mod testable;
mod view;

use super::choices::{ChoiceError, Choices};
use super::folds::Blocks;
use super::limits::NotLimited;
use super::linear::{Column, Dependence, Direction, Linearised, Partition};
use super::symbolic::FittedFormula;
use super::{Candidate, Estimate, PredictionDifference, Residuals, RowScore, StopFlag, Study};
use crate::thresholds::{DECORRELATION_M, DEFAULT_DECORRELATION_M, MOST_SEARCHED_ROWS};
use crate::{PerTerm, TermId};
use basis::{Bases, Basis};
use cells::{Random, RandomEffectSds, RowCells, Scales};
use fit::{FitProblem, FreeRandomEffects, IterationLimits, LinkFit};
use likelihood::Instrument;
use physics::catalogue::Catalogue;
use physics::scatter::Law;
use predict::RandomEffect;
use proto::effect::Level;
use reception::PowerMixture;
use rows::ModelledLinks;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use terms::{TermSpec, TermState};

/// The side of the squares whose rows share a level, in such lengths. Two places share a square of side s with a chance that falls
/// as 1 - way / s, whose integral is s / 2; that of e^(-way / length) is the length.
const SIDE: f64 = 2.0;
/// That of levels which fading leaves to links (m): squares of half a wave.
const FINEST_M: f64 = group::HALF_WAVE_M / SIDE;
/// The key of the time over which a level drifts.
const CORRELATION_S: &str = "correlation_s";

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
    /// How many nodes send, and how many receive.
    n_ends: [usize; 2],
    /// Whether fits are to stop.
    stop: StopFlag,
}

/// How a random contribution varies from frame to frame.
pub(super) fn spread_of(law: &Law) -> PowerMixture {
    PowerMixture(law.levels())
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
        let group::Grouped { time, place, once, fallback } = group::grouped(&rows, choices)?;
        let moving = rows.still().values().any(|still| !still);
        let lengths: &[f64] = if moving { &DECORRELATION_M } else { &[DEFAULT_DECORRELATION_M] };
        let finest = [FINEST_M];
        let times_s = group::drift_times_s(&rows);
        let lengths = lengths.iter().chain(finest.iter().filter(|_| moving));
        let configured = RandomEffectSds::configured(&rows);
        let candidates =
            specs.iter().map(|spec| candidates::candidate(spec, &rows, catalogue)).collect();
        Ok(Self {
            n_fitted: time.fitted().len(),
            n_ends: group::n_ends(&rows),
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
        })
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
        let rows = self.rows.some(&group::spread_evenly(&self.rows, most));
        let thin = Self::new(rows, self.fixed_sd_db, &self.choices, &self.catalogue).ok()?;
        let names = |study: &Self| -> Vec<String> {
            study.candidates.iter().map(|candidate| candidate.name.clone()).collect()
        };
        // Terms are numbers of candidates: of other candidates, the selection would mean other terms.
        (names(&thin) == names(self)).then(|| thin.with_stop_flag(&self.stop))
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

    /// Random levels of a model with these terms, where a search for them starts.
    fn deviations(
        &self,
        specs: &[&TermSpec],
        level: Level,
    ) -> (RandomEffectSds, FreeRandomEffects) {
        let has = |wanted: fn(&TermSpec) -> bool| specs.iter().any(|spec| wanted(spec));
        let carried = level == Level::Place;
        let nodes = has(|spec| matches!(spec, TermSpec::NodeOffset(_))) || carried;
        let channel = has(|spec| matches!(spec, TermSpec::Multipath(_)));
        // Channels that are near each other fade alike: what a link's channels share belongs to them.
        let link = has(|spec| matches!(spec, TermSpec::Shadowing(_))) || carried || channel;
        let channel = channel || has(|spec| matches!(spec, TermSpec::LinkDrift(_)));
        let times = has(|spec| matches!(spec, TermSpec::Drift(_)));
        let start_sd = |configured: f64, wanted: bool, start: f64| {
            if 0.0 < configured {
                configured
            } else if wanted {
                start
            } else {
                0.0
            }
        };
        // A given reading already holds the random effects of its link.
        if self.rows.links.readings.is_given {
            return (RandomEffectSds::default(), FreeRandomEffects::default());
        }
        let known = self.configured;
        // A single sender or receiver has a level, which is that of all links, and no spread.
        let sd = RandomEffectSds {
            link_db: start_sd(known.link_db, link, 2.0),
            channel_db: start_sd(known.channel_db, channel, 2.0),
            tx_db: start_sd(known.tx_db, nodes && 1 < self.n_ends[0], 1.0),
            rx_db: start_sd(known.rx_db, nodes && 1 < self.n_ends[1], 1.0),
            time_db: start_sd(known.time_db, times, 1.0),
        };
        let free = FreeRandomEffects {
            link: known.link_db == 0.0 && link,
            channel: known.channel_db == 0.0 && channel,
            nodes: known.tx_db == 0.0 && known.rx_db == 0.0 && nodes,
            times: known.time_db == 0.0 && times,
        };
        (sd, free)
    }

    fn run(
        &self,
        terms: &[TermId],
        states: Vec<TermState>,
        train: &[u32],
        from: FitOptions<'_>,
    ) -> LinkFit {
        let FitOptions { level, parent, is_trial, held, most_steps } = from;
        let specs = self.specs_of(terms);
        let (mut sd, free) = self.deviations(&specs, level);
        let scales = self.scales(&specs, &states, level);
        let cells = self.cells(scales);
        let mut random = Random::new(sd, &cells);
        if let Some(parent) = parent
            && parent.random.fits(&cells)
        {
            // Levels that the parent has start where it ended: low ones a little higher, so that they can rise again.
            let warm = |parent: f64, cold: f64, is_free: bool| {
                if cold == 0.0 || parent == 0.0 {
                    cold
                } else if is_free && !is_trial {
                    parent.max(LEAST_START_DB)
                } else {
                    parent
                }
            };
            let known = parent.random.sd;
            sd = RandomEffectSds {
                link_db: warm(known.link_db, sd.link_db, free.link),
                channel_db: warm(known.channel_db, sd.channel_db, free.channel),
                tx_db: warm(known.tx_db, sd.tx_db, free.nodes),
                rx_db: warm(known.rx_db, sd.rx_db, free.nodes),
                time_db: warm(known.time_db, sd.time_db, free.times),
            };
            random = parent.random.with_sds(sd, &cells);
        }
        let exact: Vec<Option<Arc<Basis>>> = terms
            .iter()
            .zip(&specs)
            .zip(&states)
            .map(|((&term, spec), state)| {
                self.bases.exact(&self.rows, term, spec, state, !self.is_searched(term))
            })
            .collect();
        // What is no sum of columns is taken for one at first, but where a trial looks for the place of what is new or held.
        let line = |place: usize| {
            let term = terms[place];
            let is_new = parent.is_none_or(|parent| !parent.terms.contains(&term));
            let is_held = held.is_some_and(|(other, _)| other == place);
            if is_trial && (is_new || is_held) {
                return None;
            }
            self.bases.tangent(&self.rows, term, specs[place], &states[place])
        };
        let bases: Vec<Option<Arc<Basis>>> = exact
            .iter()
            .enumerate()
            .map(|(place, exact)| exact.clone().or_else(|| line(place)))
            .collect();
        let is_exact = bases.iter().map(Option::is_some).eq(exact.iter().map(Option::is_some));
        let mut problem = FitProblem {
            rows: &self.rows,
            specs: specs.clone(),
            cells: &cells,
            scales,
            level,
            train,
            fixed_sd_db: self.fixed_sd_db,
            free,
            holds: is_trial,
            held,
            bases,
            stop: &self.stop,
        };
        let noise = parent.map(|parent| parent.instrument.noise());
        // Who starts with the same terms has its spreads already.
        let is_same = parent.is_some_and(|parent| parent.terms == terms);
        let rounds = if is_same { WARM_ROUNDS } else { MOST_ROUNDS };
        let steps = IterationLimits { most_steps, rounds };
        let fit = problem.fit(terms, states, noise, random, steps);
        if is_trial || is_exact {
            return fit;
        }
        problem.bases = exact;
        let steps = IterationLimits { most_steps, rounds: 1 };
        problem.fit(terms, fit.states, Some(fit.instrument.noise()), fit.random, steps)
    }
}

/// From where a fit starts, and how far it goes.
#[derive(Clone, Copy)]
struct FitOptions<'a> {
    /// At which level it will be judged.
    level: Level,
    /// A fit of fewer or other terms.
    parent: Option<&'a LinkFit>,
    /// A trial: the parent's terms are taken for straight lines, and spreads of random levels stay as they are.
    is_trial: bool,
    /// A parameter that stays where it is: its term, and its place there.
    held: Option<(usize, usize)>,
    /// Most steps.
    most_steps: usize,
}

impl<'a> FitOptions<'a> {
    /// A trial on top of a parent, if there is one.
    fn quick(level: Level, parent: Option<&'a LinkFit>) -> Self {
        Self { level, parent, is_trial: true, held: None, most_steps: TRIAL_STEPS }
    }

    /// A fit to convergence.
    fn to_convergence(level: Level, parent: Option<&'a LinkFit>) -> Self {
        Self { level, parent, is_trial: false, held: None, most_steps: MOST_STEPS }
    }
}

/// Random levels start at least this wide (dB).
const LEAST_START_DB: f64 = 0.3;
/// Steps of a fit, and of a trial that only finds the best start.
const MOST_STEPS: usize = 40;
const TRIAL_STEPS: usize = 5;
/// Rounds in which the spreads of random levels are found, and found again with a few rows less.
const MOST_ROUNDS: usize = 25;
const WARM_ROUNDS: usize = 2;

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

    fn blocks(&self, level: Level) -> &Blocks {
        match level {
            Level::Place => &self.place,
            Level::Random => self.once.as_ref().unwrap_or(&self.time),
            Level::Time | Level::Run => &self.time,
        }
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
        if self.stop.is_set() {
            // No answer rests on a fit after the request to stop: any fit will do.
            let empty = || self.run(&[], Vec::new(), train, FitOptions::quick(level, None));
            return start.cloned().unwrap_or_else(empty);
        }
        let known = |term: TermId| {
            let fit = start?;
            let index = fit.terms.iter().position(|&other| other == term)?;
            // What was searched with all rows is searched again without those left out, and at another level, where links have
            // levels of their own or none.
            let is_part = train.len() < self.n_fitted;
            let again = self.is_searched(term) && (is_part || fit.level != level);
            (!again).then(|| fit.states[index].clone())
        };
        // One term at a time may be new: the others start where they were.
        let mut starts: Vec<Vec<TermState>> = vec![Vec::new()];
        for &term in terms {
            let options = match known(term) {
                Some(state) => vec![state],
                None => self.starts_of(term, terms, train, level, start),
            };
            starts = starts
                .into_iter()
                .flat_map(|before| {
                    options
                        .iter()
                        .map(move |state| before.iter().cloned().chain([state.clone()]).collect())
                })
                .collect();
        }
        let asks_for_scales = terms.iter().any(|&term| self.asks_for_scale(term));
        let best = if starts.len() == 1 {
            starts.swap_remove(0)
        } else {
            // A trial holds the spreads, on which the likelihood of a scale depends.
            let from = if asks_for_scales {
                FitOptions::to_convergence(level, start)
            } else {
                FitOptions::quick(level, start)
            };
            self.best_of(terms, starts, train, from).map(|fit| fit.states).unwrap_or_default()
        };
        self.run(terms, best, train, FitOptions::to_convergence(level, start))
    }

    fn screen(&self, terms: &[TermId], level: Level, parent: &LinkFit) -> Option<LinkFit> {
        let (&term, _) = terms.split_last()?;
        // A trial holds the spreads of random effects, so it cannot show what another one is worth.
        if self.stop.is_set() || self.specs[term].is_random() {
            return None;
        }
        let all = self.fitted_rows();
        let starts = self
            .starts_of(term, terms, &all, level, Some(parent))
            .into_iter()
            .map(|state| parent.states.iter().cloned().chain([state]).collect())
            .collect();
        self.best_of(terms, starts, &all, FitOptions::quick(level, Some(parent)))
    }

    fn prediction_difference(
        &self,
        one: &LinkFit,
        other: &LinkFit,
    ) -> Option<PredictionDifference> {
        Some(self.difference_by_row(one, other))
    }

    fn scanned_covariates(&self) -> Vec<(String, Vec<f64>)> {
        self.covariates()
    }

    fn scanned_blocks(&self) -> Vec<&Blocks> {
        let levels = [&self.time, &self.place];
        if levels.iter().all(|blocks| blocks.suffices()) { levels.to_vec() } else { Vec::new() }
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
        self.columns_of(term)
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

    fn agreement(&self, fit: &LinkFit, term: TermId) -> Option<f64> {
        match self.specs[term] {
            TermSpec::Drift(_) => Some(self.p_value_of_agreement(fit)),
            TermSpec::NodeOffset(_) => Some(self.p_value_of_nodes(&fit.without_links())),
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
