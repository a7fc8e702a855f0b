//! Search for effects that a network model lacks. Each candidate is added and the network simulated; the effect that gives the
//! measured packets the greatest likelihood is accepted, until the measurement is consistent with the model.

mod words;

use super::candidate_fits::{CandidateFit, CandidateScan, FitContext, FittedEffect};
use super::candidates::{self, CandidateEffect};
use super::compare::{ComparisonOptions, SeedComparison, among};
use super::kpis::NetworkFigures;
use super::likelihood::{self, FigureDensity, ScaledFigures};
use super::request::simulating;
use super::resimulate::{Resimulation, ResimulationError};
use diagnose::Observer;
use diagnose::stepwise::{self, Round, Stepwise};
use measure::packets::MeasuredPacket;
use netsim::catalogue::Catalogue;
use study::StopFlag;
use study::thresholds::{
    CONSISTENCY_LEVEL, CONSISTENT_BEHIND_NATS, FEWEST_FIT_SEEDS, MOST_ADDED_EFFECTS, MOST_REFINED,
    PACKETS_LEVEL, REFINED_BEHIND, RIVAL_NATS, TIED_ERRORS,
};
pub use words::parameter_text;
pub(crate) use words::{answer, parameters, text};

/// The result of testing one candidate effect.
#[derive(Clone, Debug)]
pub(crate) struct EffectTest {
    /// The effect that was tested.
    pub candidate: CandidateEffect,
    /// Why it cannot be tested; `None`: it can.
    pub untestable: Option<String>,
    /// Gain in log likelihood over the model it was added to (nats); `None`: not tested.
    pub gain: Option<f64>,
    /// P-value of the gain: the share of runs of the model in which any candidate gains as much.
    pub p_value: Option<f64>,
    /// The fit, of candidates that were fitted closely.
    pub fitted: Option<FittedEffect>,
    /// P-value of the measurement among runs with the effect; `None`: it was not run often enough.
    pub p_with: Option<f64>,
    /// Other effects with nearly the same likelihood.
    pub ties: Vec<&'static str>,
    /// Whether the search accepted it as missing from the model.
    pub is_accepted: bool,
}

/// One model of the stepwise selection: as configured, or with effects.
#[derive(Clone, Debug)]
pub(crate) struct SearchStep {
    /// Name of the effect added last; `None`: the model as configured.
    pub added: Option<&'static str>,
    /// The measurement compared with runs of this model.
    pub among: SeedComparison,
    /// Log density of the measurement by them (nats).
    pub log_density: f64,
}

/// Two statistically indistinguishable effects, and the figure in which they differ most.
#[derive(Clone, Debug)]
pub(crate) struct TiedEffects {
    /// Names of the accepted effect and of its rival.
    pub names: [&'static str; 2],
    /// Index of the figure among the KPIs.
    pub figure: usize,
    /// Their difference in it, in standard deviations of a run.
    pub apart: f64,
}

/// The result of a search.
#[derive(Clone, Debug)]
pub(crate) struct SearchResult {
    /// Models, from as configured on: at least that one.
    pub rungs: Vec<SearchStep>,
    /// Candidates, in their order.
    pub tests: Vec<EffectTest>,
    /// What was added, as indices of candidates, in the order of adding.
    pub accepted: Vec<usize>,
    /// Effects that explain the packets as well as an accepted one.
    pub rivals: Vec<TiedEffects>,
    /// The round in which it was stopped.
    pub stopped: Option<usize>,
}

/// Effects that were asked for, fitted.
#[derive(Clone, Debug)]
pub(crate) struct RequestedEffects {
    /// Each with its number.
    pub fitted: Vec<(CandidateEffect, FittedEffect)>,
    /// The models without and with them.
    pub rungs: [SearchStep; 2],
}

impl SearchResult {
    /// The model as configured, and the last one.
    fn first_and_last(&self) -> (&SearchStep, &SearchStep) {
        (&self.rungs[0], &self.rungs[self.rungs.len() - 1])
    }

    /// Whether the measurement could be a run of the last model.
    #[must_use]
    pub(crate) fn agrees(&self) -> bool {
        self.rungs.last().is_some_and(|rung| CONSISTENCY_LEVEL < rung.among.placed.p_value)
    }
}

/// A candidate by its number, what was tried of it, and its laws there.
type ScannedCandidate<'a> = (usize, CandidateScan<'a>, Vec<(f64, FigureDensity)>);

/// What a round adds, and the model with it.
type AcceptedEffect = ((usize, CandidateFit), SearchStep);

/// The decision on a gain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum GainVerdict {
    /// Not significant.
    Nothing,
    /// Unusual runs of the network itself gain as much by chance. But if the measurement is inconsistent with the network, the
    /// effect counts, provided that the measurement is consistent with a network that has it.
    IfItMends,
    /// Significant.
    More,
}

impl GainVerdict {
    /// Judges a gain (nats). `chance`: p-value of the gain; `p_value`: of the comparison with the network without the effect.
    fn judge(gain: f64, chance: f64, p_value: f64) -> Self {
        if chance <= PACKETS_LEVEL {
            Self::More
        } else if p_value <= PACKETS_LEVEL && RIVAL_NATS <= gain {
            Self::IfItMends
        } else {
            Self::Nothing
        }
    }
}

/// A candidate by its number that was looked at closely.
type FittedCandidate = (usize, CandidateFit, GainVerdict);

/// What is selected: a network with effects, and what came of the candidates.
#[derive(Clone)]
pub(crate) struct Selection {
    network: toml::Table,
    effects: Vec<(usize, CandidateFit)>,
    found: SearchResult,
}

impl Stepwise for &NetworkSearch<'_> {
    type Selection = Selection;
    type Error = ResimulationError;

    fn may_go_on(&self, selection: &Selection, _rounds: usize) -> bool {
        !selection.found.agrees() && selection.effects.len() < MOST_ADDED_EFFECTS
    }

    fn round(
        &mut self,
        selection: &mut Selection,
        _round: usize,
    ) -> Result<Round, ResimulationError> {
        let Selection { network, effects, found } = selection;
        match self.extended(network, effects, found) {
            Ok(true) => Ok(Round::Changed),
            Ok(false) => Ok(Round::Finished),
            Err(ResimulationError::Stopped) => Ok(Round::Stopped),
            Err(error) => Err(error),
        }
    }
}

/// The search for missing effects over one set of measured packets.
pub(crate) struct NetworkSearch<'a> {
    resimulation: &'a Resimulation,
    measured: &'a [MeasuredPacket],
    asked: ComparisonOptions,
    candidates: &'a [CandidateEffect],
    ground: FitContext<'a>,
    observer: &'a dyn Observer,
}

impl<'a> NetworkSearch<'a> {
    /// Of measured packets, under an experiment. The observer sees the progress, and may stop the search.
    #[must_use]
    pub(crate) fn new(
        resimulation: &'a Resimulation,
        (measured, asked): (&'a [MeasuredPacket], ComparisonOptions),
        candidates: &'a [CandidateEffect],
        observer: &'a dyn Observer,
    ) -> Self {
        let figures = NetworkFigures::from_packets(measured, asked.from_s).scaled();
        let ground = FitContext {
            resimulation,
            measured: figures,
            usable: (0..figures.len()).filter(|&k| figures[k].is_finite()).collect(),
            from_s: asked.from_s,
            seeds: (asked.seeds / 4).max(FEWEST_FIT_SEEDS),
        };
        Self { resimulation, measured, asked, candidates, ground, observer }
    }

    fn is_stopped(&self) -> bool {
        self.observer.stop_flag().is_some_and(StopFlag::is_set)
    }

    /// Compares a model with the measurement, under the seeds of comparisons.
    fn rung(
        &self,
        network: &toml::Table,
        added: Option<&'static str>,
    ) -> Result<SearchStep, ResimulationError> {
        let among = among(self.resimulation, network, self.measured, self.asked)?;
        let law = self.ground.law(&likelihood::scaled(&among.seeds));
        let log_density = law.log_density(&self.ground.measured);
        Ok(SearchStep { added, among, log_density })
    }

    /// The network with effects.
    fn network(&self, effects: &[(usize, CandidateFit)]) -> toml::Table {
        let add = |network: toml::Table, (k, fit): &(usize, CandidateFit)| {
            self.candidates[*k].added(&network, fit.fitted.value)
        };
        effects.iter().fold(self.resimulation.network(), add)
    }

    /// Adds what is missing, one effect after the other.
    ///
    /// # Errors
    ///
    /// The network refuses its configuration.
    pub(crate) fn stepwise_selection(&self) -> Result<SearchResult, ResimulationError> {
        let network = self.resimulation.network();
        let first = self.rung(&network, None)?;
        let test = |candidate: &CandidateEffect| EffectTest {
            candidate: candidate.clone(),
            untestable: None,
            gain: None,
            p_value: None,
            fitted: None,
            p_with: None,
            ties: Vec::new(),
            is_accepted: false,
        };
        let found = SearchResult {
            rungs: vec![first],
            tests: self.candidates.iter().map(test).collect(),
            accepted: Vec::new(),
            rivals: Vec::new(),
            stopped: None,
        };
        let mut selection = Selection { network, effects: Vec::new(), found };
        let mut rounds = self;
        let ended = stepwise::select(&mut rounds, &mut selection)?;
        Ok(SearchResult { stopped: ended.stopped_in(), ..selection.found })
    }

    /// Adds one more effect to a network, if any is missing.
    fn extended(
        &self,
        network: &mut toml::Table,
        effects: &mut Vec<(usize, CandidateFit)>,
        found: &mut SearchResult,
    ) -> Result<bool, ResimulationError> {
        let round = effects.len() + 1;
        let Some((fit, rung)) = self.round(network, round, found)? else { return Ok(false) };
        let chosen = fit.0;
        effects.push(fit);
        found.tests[chosen].is_accepted = true;
        found.accepted.push(chosen);
        let rung = if effects.len() == 1 {
            rung
        } else {
            self.refit(effects)?;
            let rung = self.rung(&self.network(effects), rung.added)?;
            self.calibrate(effects, &rung);
            for (k, fit) in &*effects {
                found.tests[*k].fitted = Some(fit.fitted);
            }
            rung
        };
        *network = self.network(effects);
        found.rungs.push(rung);
        Ok(true)
    }

    /// Tries every candidate that is not yet there on top of a network: the one to add, if any, and the model with it.
    fn round(
        &self,
        network: &toml::Table,
        round: usize,
        found: &mut SearchResult,
    ) -> Result<Option<AcceptedEffect>, ResimulationError> {
        let base = self.ground.base(network)?;
        let base_law = self.ground.law(&base);
        let mut curves: Vec<ScannedCandidate<'a>> = Vec::new();
        for (k, candidate) in self.candidates.iter().enumerate() {
            if self.is_stopped() {
                return Err(ResimulationError::Stopped);
            }
            if found.accepted.contains(&k) {
                continue;
            }
            let (number, of, name) = (k + 1, self.candidates.len(), candidate.name);
            let what = format!("round {round}, candidate {number} of {of}: {name}");
            simulating(self.observer, &what);
            match self.ground.curve(network, candidate, &candidate.first_tries()) {
                Ok(curve) => {
                    let laws = self.ground.laws(&curve);
                    curves.push((k, curve, laws));
                }
                Err(ResimulationError::Stopped) => return Err(ResimulationError::Stopped),
                Err(error) => found.tests[k].untestable = Some(error.to_string()),
            }
        }
        let gains = |run: &ScaledFigures| -> Vec<f64> {
            let without = base_law.log_density(run);
            let gain_of = |(_, _, laws): &ScannedCandidate<'_>| {
                let logs = laws.iter().map(|(_, law)| law.log_density(run));
                logs.fold(f64::NEG_INFINITY, f64::max) - without
            };
            curves.iter().map(gain_of).collect()
        };
        let here = gains(&self.ground.measured);
        // What chance gains: the greatest gain of any candidate, of runs of the network as it is that no fit has seen.
        let Some(last) = found.rungs.last() else { return Ok(None) };
        let by_chance: Vec<f64> = likelihood::scaled(&last.among.seeds)
            .iter()
            .map(|run| gains(run).into_iter().fold(f64::NEG_INFINITY, f64::max))
            .collect();
        let chance = |gain: f64| {
            let as_great = by_chance.iter().filter(|&&other| gain <= other).count() as f64;
            (1.0 + as_great) / (1.0 + by_chance.len() as f64)
        };
        for ((k, ..), gain) in curves.iter().zip(&here) {
            let test = &mut found.tests[*k];
            (test.gain, test.p_value) = (Some(*gain), Some(chance(*gain)));
            (test.fitted, test.p_with) = (None, None);
        }
        let p_value = last.among.placed.p_value;
        let worth: Vec<GainVerdict> =
            here.iter().map(|&gain| GainVerdict::judge(gain, chance(gain), p_value)).collect();
        let mut order: Vec<usize> =
            (0..curves.len()).filter(|&place| worth[place] != GainVerdict::Nothing).collect();
        order.sort_by(|&a, &b| here[b].total_cmp(&here[a]));
        let Some(&best) = order.first() else { return Ok(None) };
        let behind = REFINED_BEHIND.0.max(REFINED_BEHIND.1 * here[best]);
        order.retain(|&place| here[best] - behind <= here[place]);
        order.truncate(MOST_REFINED);
        let mut close: Vec<FittedCandidate> = Vec::new();
        for place in order {
            if self.is_stopped() {
                return Err(ResimulationError::Stopped);
            }
            let (k, curve, _) = &mut curves[place];
            let what = format!("round {round}, refining: {}", self.candidates[*k].name);
            simulating(self.observer, &what);
            let fit = self.ground.fit(network, curve, &base)?;
            found.tests[*k].fitted = Some(fit.fitted);
            found.tests[*k].gain = Some(fit.fitted.gain);
            close.push((*k, fit, worth[place]));
        }
        close.sort_by(|a, b| b.1.fitted.gain.total_cmp(&a.1.fitted.gain));
        self.choose(network, close, found)
    }

    /// Which of those that were looked at closely is added: the most probable one that mends what is wrong, else the most
    /// probable one.
    fn choose(
        &self,
        network: &toml::Table,
        close: Vec<FittedCandidate>,
        found: &mut SearchResult,
    ) -> Result<Option<AcceptedEffect>, ResimulationError> {
        let Some(best) = close.first().map(|(_, fit, _)| fit.fitted.gain) else { return Ok(None) };
        let mut rungs: Vec<(usize, CandidateFit, SearchStep)> = Vec::new();
        let mends = |rung: &SearchStep| CONSISTENCY_LEVEL < rung.among.placed.p_value;
        for (k, mut fit, worth) in close {
            if fit.fitted.gain < best - CONSISTENT_BEHIND_NATS {
                continue;
            }
            let candidate = &self.candidates[k];
            let rung =
                self.rung(&candidate.added(network, fit.fitted.value), Some(candidate.name))?;
            let runs = likelihood::scaled(&rung.among.seeds);
            self.ground.calibrate(candidate, &mut fit, &runs);
            found.tests[k].fitted = Some(fit.fitted);
            found.tests[k].p_with = Some(rung.among.placed.p_value);
            if worth == GainVerdict::More || mends(&rung) {
                rungs.push((k, fit, rung));
            }
        }
        if rungs.is_empty() {
            return Ok(None);
        }
        let is_as_good = |one: &(usize, CandidateFit, SearchStep),
                          other: &(usize, CandidateFit, SearchStep)| {
            let (a, b) = (one.1.fitted, other.1.fitted);
            let doubt = libm::hypot(a.standard_error, b.standard_error);
            a.gain - b.gain < RIVAL_NATS.max(TIED_ERRORS * doubt)
                && mends(&one.2) == mends(&other.2)
        };
        let mut place = rungs.iter().position(|(_, _, rung)| mends(rung)).unwrap_or(0);
        // Interference of the whole band would be seen in links; of two that packets do not tell apart it is the other one.
        if self.candidates[rungs[place].0].layer == "phy" {
            let rival = |other: &(usize, CandidateFit, SearchStep)| {
                self.candidates[other.0].layer == "mac" && is_as_good(&rungs[place], other)
            };
            place = rungs.iter().position(rival).unwrap_or(place);
        }
        let chosen = rungs.remove(place);
        for it in &rungs {
            let (k, _, its) = it;
            if is_as_good(&chosen, it) {
                let names = [self.candidates[chosen.0].name, self.candidates[*k].name];
                found.tests[chosen.0].ties.push(names[1]);
                found.tests[*k].ties.push(names[0]);
                let law =
                    |rung: &SearchStep| self.ground.law(&likelihood::scaled(&rung.among.seeds));
                let apart = law(&chosen.2).standardised_differences(&law(its));
                let furthest = apart.into_iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
                if let Some((figure, apart)) = furthest {
                    found.rivals.push(TiedEffects { names, figure, apart });
                }
            }
        }
        Ok(Some(((chosen.0, chosen.1), chosen.2)))
    }

    /// Fits each of several effects anew with the others in place.
    fn refit(&self, effects: &mut [(usize, CandidateFit)]) -> Result<(), ResimulationError> {
        // The last one was fitted with the others as they are.
        for place in (0..effects.len()).rev().skip(1).chain([effects.len() - 1]) {
            let (k, fitted) = (effects[place].0, effects[place].1.fitted);
            let others: Vec<(usize, CandidateFit)> = (0..effects.len())
                .filter(|&other| other != place)
                .map(|other| effects[other].clone())
                .collect();
            let candidate = &self.candidates[k];
            let what = format!("refitting with the added effects: {}", candidate.name);
            simulating(self.observer, &what);
            let network = self.network(&others);
            let base = self.ground.base(&network)?;
            let here = candidate.scaled(fitted.value);
            let places = [-0.7, 0.0, 0.7].map(|step| here + step);
            let mut curve = self.ground.curve(&network, candidate, &places)?;
            effects[place].1 = self.ground.fit(&network, &mut curve, &base)?;
        }
        Ok(())
    }

    /// Widens intervals to what fits to runs of the whole model are off by.
    fn calibrate(&self, effects: &mut [(usize, CandidateFit)], rung: &SearchStep) {
        let runs = likelihood::scaled(&rung.among.seeds);
        for (k, fit) in effects {
            self.ground.calibrate(&self.candidates[*k], fit, &runs);
        }
    }

    /// Fits named effects, whatever they gain: each on top of those before, then all of them together. And the models without
    /// and with them.
    ///
    /// # Errors
    ///
    /// The network refuses one of them.
    pub(crate) fn fit(&self, names: &[usize]) -> Result<RequestedEffects, ResimulationError> {
        let mut effects: Vec<(usize, CandidateFit)> = Vec::new();
        for &k in names {
            let candidate = &self.candidates[k];
            simulating(self.observer, &format!("fitting {}", candidate.name));
            let network = self.network(&effects);
            let base = self.ground.base(&network)?;
            let mut curve = self.ground.curve(&network, candidate, &candidate.first_tries())?;
            effects.push((k, self.ground.fit(&network, &mut curve, &base)?));
        }
        if 1 < effects.len() {
            self.refit(&mut effects)?;
        }
        let last = effects.last().map(|(k, _)| self.candidates[*k].name);
        let before = self.rung(&self.resimulation.network(), None)?;
        let after = self.rung(&self.network(&effects), last)?;
        self.calibrate(&mut effects, &after);
        let fitted =
            effects.into_iter().map(|(k, fit)| (self.candidates[k].clone(), fit.fitted)).collect();
        Ok(RequestedEffects { fitted, rungs: [before, after] })
    }
}

/// All effects that are tried.
#[must_use]
pub(crate) fn catalogue() -> Vec<CandidateEffect> {
    candidates::all(Catalogue::built_in())
}
