//! Fits of one candidate effect: the value of its parameter that maximises the likelihood of a measurement, with a 90 % interval.
//!
//! The network runs at several values under the same seeds, so that differences between values come from the effect alone. The
//! values first cover the whole range coarsely, then the neighbourhood of the best one. Finally they cover the plausible range
//! evenly, under more seeds, and the figures are smoothed over them.
//!
//! The interval is the profile-likelihood interval, widened by the scatter over seeds. Runs with the fitted effect are then fitted
//! in turn; if their errors are larger, the interval is widened to them ([`FitContext::calibrate`]).

use super::candidates::CandidateEffect;
use super::likelihood::{
    self, FigureDensity, RunMoments, ScaledFigures, SmoothDensity, interpolate,
};
use super::resimulate::{Resimulation, ResimulationError};
use numbers::normal::{FALL_90_NATS, Z_90};
use numbers::power::square;
use numbers::statistics::{quantile, standard_deviation};
use proto::rng::{Draws, Purpose, uniform};
use study::thresholds::{SEARCHED_NATS, SEED_RESAMPLES, TAIL_90};

/// Where seeds for fits begin: those for comparisons, from 0 on, are not among them.
const FIRST_SEED: u64 = 1 << 32;
/// Rounds in which values are added about the best one.
const ROUNDS: usize = 3;
/// Values over what is plausible.
const FINAL_TRIES: usize = 5;
/// Places that are looked at over what is plausible.
const PLACES: usize = 120;
/// Values nearer than this on the scale are one.
const SAME: f64 = 1e-6;

/// What candidates are fitted to: an experiment, and the figures of the measurement.
#[derive(Clone, Debug)]
pub(crate) struct FitContext<'a> {
    /// The experiment, which is simulated again for each value.
    pub resimulation: &'a Resimulation,
    /// The figures that were measured, on their scales.
    pub measured: ScaledFigures,
    /// Indices of the figures that are known in the measurement.
    pub usable: Vec<usize>,
    /// Packets made before do not count (s).
    pub from_s: f64,
    /// Seeds for the last round of a fit; half as many before.
    pub seeds: u64,
}

/// The runs at one value of the parameter.
#[derive(Clone, Debug)]
struct RunsAtValue {
    at: f64,
    runs: Vec<ScaledFigures>,
}

/// A candidate with the values of its parameter that were simulated so far.
#[derive(Clone, Debug)]
pub(crate) struct CandidateScan<'a> {
    candidate: &'a CandidateEffect,
    simulated: Vec<RunsAtValue>,
}

/// A fitted effect, and what it takes to see how far off fits are.
#[derive(Clone, Debug)]
pub(crate) struct CandidateFit {
    /// The effect with its fitted parameter.
    pub fitted: FittedEffect,
    /// Laws near the best value, and where that is; none of whole numbers.
    laws: Option<(SmoothDensity, [f64; 2])>,
}

/// A fitted effect: its parameter and the gain in log likelihood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedEffect {
    /// Estimate of its parameter.
    pub value: f64,
    /// 90 % profile-likelihood interval, widened for the choice of seeds and by a parametric bootstrap.
    pub interval: [f64; 2],
    /// Gain in log likelihood over the model without it (nats).
    pub gain: f64,
    /// Standard error of the gain over the choice of seeds (nats).
    pub standard_error: f64,
    /// Log density of the measurement (nats).
    pub log_density: f64,
}

impl FitContext<'_> {
    /// The figures of a network under the first `n` seeds for fits.
    fn runs(&self, network: &toml::Table, n: u64) -> Result<Vec<ScaledFigures>, ResimulationError> {
        let runs = self.resimulation.figures(network, FIRST_SEED..FIRST_SEED + n, self.from_s)?;
        Ok(likelihood::scaled(&runs))
    }

    /// A network as it is, for gains over it.
    ///
    /// # Errors
    ///
    /// The network refuses its section.
    pub(crate) fn base(
        &self,
        network: &toml::Table,
    ) -> Result<Vec<ScaledFigures>, ResimulationError> {
        self.runs(network, self.seeds)
    }

    /// The law of runs.
    #[must_use]
    pub(crate) fn law(&self, runs: &[ScaledFigures]) -> FigureDensity {
        FigureDensity::at_value(
            &RunMoments::from_runs(0.0, runs.iter(), &self.usable),
            &self.usable,
        )
    }

    /// A candidate on top of a network, at some places of its scale.
    ///
    /// # Errors
    ///
    /// The network refuses it.
    pub(crate) fn curve<'c>(
        &self,
        network: &toml::Table,
        candidate: &'c CandidateEffect,
        places: &[f64],
    ) -> Result<CandidateScan<'c>, ResimulationError> {
        let mut curve = CandidateScan { candidate, simulated: Vec::new() };
        self.add(network, &mut curve, places, self.seeds.div_ceil(2))?;
        Ok(curve)
    }

    /// Runs a network at further places, or under more seeds at the same ones.
    fn add(
        &self,
        network: &toml::Table,
        curve: &mut CandidateScan<'_>,
        places: &[f64],
        n: u64,
    ) -> Result<(), ResimulationError> {
        for &place in places {
            let value = curve.candidate.value(place);
            let at = curve.candidate.scaled(value);
            let place = curve.simulated.iter().position(|runs| (runs.at - at).abs() < SAME);
            if place.is_some_and(|place| n <= curve.simulated[place].runs.len() as u64) {
                continue;
            }
            let runs = self.runs(&curve.candidate.added(network, value), n)?;
            match place {
                Some(place) => curve.simulated[place].runs = runs,
                None => curve.simulated.push(RunsAtValue { at, runs }),
            }
            curve.simulated.sort_by(|a, b| a.at.total_cmp(&b.at));
        }
        Ok(())
    }

    /// The laws of a curve, at the simulated values and between.
    #[must_use]
    pub(crate) fn laws(&self, curve: &CandidateScan<'_>) -> Vec<(f64, FigureDensity)> {
        let moments = curve.moments(curve.simulated.iter(), None, &self.usable);
        let mut laws = Vec::new();
        for pair in moments.windows(2) {
            for at in curve.candidate.values_between(pair[0].at, pair[1].at) {
                laws.push((at, interpolate(&pair[0], &pair[1], at, &self.usable)));
            }
        }
        laws.extend(
            moments.last().map(|last| (last.at, FigureDensity::at_value(last, &self.usable))),
        );
        laws
    }

    /// The place at which the measurement is most probable, and its log density there.
    fn best(&self, laws: &[(f64, FigureDensity)]) -> (f64, f64) {
        best_of(laws, &self.measured)
    }

    /// Looks closely about the best value. `base`: runs without the effect.
    ///
    /// # Errors
    ///
    /// The network refuses it.
    pub(crate) fn fit(
        &self,
        network: &toml::Table,
        curve: &mut CandidateScan<'_>,
        base: &[ScaledFigures],
    ) -> Result<CandidateFit, ResimulationError> {
        for _ in 0..ROUNDS {
            let (best, _) = self.best(&self.laws(curve));
            let further = curve.about(best);
            self.add(network, curve, &further, self.seeds.div_ceil(2))?;
        }
        let mut window = self.plausible(curve);
        if curve.candidate.is_whole {
            let fitted = self.estimate_integer(network, curve, window, base)?;
            return Ok(CandidateFit { fitted, laws: None });
        }
        for widening in 0.. {
            let even = |k: usize| {
                window[0] + k as f64 / (FINAL_TRIES - 1) as f64 * (window[1] - window[0])
            };
            let places: Vec<f64> = (0..FINAL_TRIES).map(even).collect();
            self.add(network, curve, &places, self.seeds)?;
            let within = curve.within(window, self.seeds);
            let law = self.smooth(curve, &within, None);
            let profile = self.profile(law.as_ref(), window);
            let top = profile.iter().map(|it| it.1).fold(f64::NEG_INFINITY, f64::max);
            // What is plausible reaches beyond: look there too.
            let falls =
                |end: Option<&(f64, f64)>| end.is_some_and(|end| end.1 < top - 1.4 * FALL_90_NATS);
            let half = 0.5 * (window[1] - window[0]);
            let mut wider = window;
            if !falls(profile.first()) {
                wider[0] -= half;
            }
            if !falls(profile.last()) {
                wider[1] += half;
            }
            let wider = wider.map(|at| curve.candidate.scaled(curve.candidate.value(at)));
            if widening == 3 || wider.iter().zip(window).all(|(a, b)| (a - b).abs() < SAME) {
                let fitted = self.estimate_continuous(curve, &within, &profile, base);
                return Ok(CandidateFit { fitted, laws: law.map(|law| (law, window)) });
            }
            window = wider;
        }
        unreachable!("three widenings at most")
    }

    /// What is plausible, by straight lines between simulated values.
    fn plausible(&self, curve: &CandidateScan<'_>) -> [f64; 2] {
        let laws = self.laws(curve);
        let (best, top) = self.best(&laws);
        let is_in = |law: &FigureDensity| top - SEARCHED_NATS <= law.log_density(&self.measured);
        let value_of = |place: &(f64, FigureDensity)| place.0;
        let middle = laws.iter().position(|(at, _)| *at == best).unwrap_or_default();
        let low = laws[..=middle]
            .iter()
            .rev()
            .take_while(|(_, law)| is_in(law))
            .last()
            .map_or(best, value_of);
        let high =
            laws[middle..].iter().take_while(|(_, law)| is_in(law)).last().map_or(best, value_of);
        // Never so narrow that the figures hardly change.
        let least = 0.03;
        [low.min(best - least), high.max(best + least)]
            .map(|at| curve.candidate.scaled(curve.candidate.value(at)))
    }

    fn smooth(
        &self,
        curve: &CandidateScan<'_>,
        within: &[&RunsAtValue],
        picks: Option<&[f64]>,
    ) -> Option<SmoothDensity> {
        SmoothDensity::fit(
            &curve.moments(within.iter().copied(), picks, &self.usable),
            &self.usable,
        )
    }

    /// The log density of the measurement over what is plausible.
    fn profile(&self, law: Option<&SmoothDensity>, window: [f64; 2]) -> Vec<(f64, f64)> {
        let Some(law) = law else { return Vec::new() };
        (0..=PLACES)
            .map(|k| window[0] + k as f64 / PLACES as f64 * (window[1] - window[0]))
            .map(|at| (at, law.law(at).log_density(&self.measured)))
            .collect()
    }

    /// Estimates a continuous parameter: the maximum of the smoothed profile likelihood, with an interval that includes the scatter
    /// over the choice of seeds.
    fn estimate_continuous(
        &self,
        curve: &CandidateScan<'_>,
        within: &[&RunsAtValue],
        profile: &[(f64, f64)],
        base: &[ScaledFigures],
    ) -> FittedEffect {
        let top = |profile: &[(f64, f64)]| {
            let first = (f64::NAN, f64::NEG_INFINITY);
            profile.iter().fold(first, |best, it| if best.1 < it.1 { *it } else { best })
        };
        let (best, log_density) = top(profile);
        let in_interval = || profile.iter().filter(|it| log_density - FALL_90_NATS <= it.1);
        let ends = [in_interval().next(), in_interval().next_back()]
            .map(|end| end.map_or(best, |end| end.0));
        let window = [profile.first(), profile.last()].map(|end| end.map_or(best, |end| end.0));
        let mut resampled = Vec::new();
        for resample in 0..SEED_RESAMPLES {
            let picks = self.picks(resample);
            let law = self.smooth(curve, within, Some(&picks));
            let (at, log) = top(&self.profile(law.as_ref(), window));
            resampled.push((at, log - self.base_density(base, Some(&picks))));
        }
        let sd_of_place = sd(resampled.iter().map(|it| it.0));
        let widened = |end: f64| libm::sqrt(square(best - end) + square(Z_90 * sd_of_place));
        let value = |at: f64| curve.candidate.value(at);
        let mut interval = [value(best - widened(ends[0])), value(best + widened(ends[1]))];
        interval.sort_by(f64::total_cmp);
        FittedEffect {
            value: curve.candidate.rounded(value(best)),
            interval,
            gain: log_density - self.base_density(base, None),
            standard_error: sd(resampled.iter().map(|it| it.1)),
            log_density,
        }
    }

    /// Widens the interval of a fit by a parametric bootstrap. `runs` of the network with the fitted effect, under seeds that the fit
    /// has not seen, are fitted like the measurement. Their errors are distributed as the error of the estimate, whatever the
    /// figures' distributions are.
    pub(crate) fn calibrate(
        &self,
        candidate: &CandidateEffect,
        fit: &mut CandidateFit,
        runs: &[ScaledFigures],
    ) {
        let Some((smooth, [low, high])) = &fit.laws else { return };
        let room = 0.5 * (high - low);
        let [low, high] = [low - room, high + room];
        let laws: Vec<(f64, FigureDensity)> = (0..=PLACES)
            .map(|k| low + k as f64 / PLACES as f64 * (high - low))
            .map(|at| (at, smooth.law(at)))
            .collect();
        let made_with = candidate.scaled(fit.fitted.value);
        let mut errors: Vec<f64> = runs
            .iter()
            .map(|run| best_of(&laws, run).0 - made_with)
            .filter(|error| error.is_finite())
            .collect();
        if errors.is_empty() {
            return;
        }
        errors.sort_by(f64::total_cmp);
        let mut ends = [1.0 - TAIL_90, TAIL_90]
            .map(|share| candidate.value(made_with - quantile(&errors, share)));
        ends.sort_by(f64::total_cmp);
        let interval = &mut fit.fitted.interval;
        *interval = [interval[0].min(ends[0]), interval[1].max(ends[1])];
    }

    /// Estimates an integer parameter: the simulated value with the greatest likelihood, and the values within the interval's bound.
    fn estimate_integer(
        &self,
        network: &toml::Table,
        curve: &mut CandidateScan<'_>,
        window: [f64; 2],
        base: &[ScaledFigures],
    ) -> Result<FittedEffect, ResimulationError> {
        let places: Vec<f64> = curve.simulated.iter().map(|runs| runs.at).collect();
        let near = |at: &f64| (window[0] - SAME..=window[1] + SAME).contains(at);
        let places: Vec<f64> = places.into_iter().filter(near).collect();
        self.add(network, curve, &places, self.seeds)?;
        let within = curve.within(window, self.seeds);
        let logs = |picks: Option<&[f64]>| -> Vec<f64> {
            let moments = curve.moments(within.iter().copied(), picks, &self.usable);
            let log = |moments: &RunMoments| {
                FigureDensity::at_value(moments, &self.usable).log_density(&self.measured)
            };
            moments.iter().map(log).collect()
        };
        let here = logs(None);
        let best = (0..here.len()).fold(0, |best, k| if here[best] < here[k] { k } else { best });
        let resampled: Vec<(Vec<f64>, f64)> = (0..SEED_RESAMPLES)
            .map(|resample| {
                let picks = self.picks(resample);
                (logs(Some(&picks)), self.base_density(base, Some(&picks)))
            })
            .collect();
        let is_in = |k: &usize| {
            let doubt = sd(resampled.iter().map(|(logs, _)| logs[best] - logs[*k]));
            here[best] - FALL_90_NATS - Z_90 * doubt <= here[*k]
        };
        let inside: Vec<usize> = (0..here.len()).filter(is_in).collect();
        let value = |k: usize| curve.candidate.value(within[k].at);
        let mut interval =
            [inside.first(), inside.last()].map(|end| value(end.copied().unwrap_or(best)));
        interval.sort_by(f64::total_cmp);
        Ok(FittedEffect {
            value: value(best),
            interval,
            gain: here[best] - self.base_density(base, None),
            standard_error: sd(resampled.iter().map(|(logs, base)| logs[best] - base)),
            log_density: here[best],
        })
    }

    fn base_density(&self, base: &[ScaledFigures], picks: Option<&[f64]>) -> f64 {
        let runs = picked(base, picks);
        FigureDensity::at_value(
            &RunMoments::from_runs(0.0, runs.into_iter(), &self.usable),
            &self.usable,
        )
        .log_density(&self.measured)
    }

    /// Which seeds a resample has, as shares of all.
    fn picks(&self, resample: u64) -> Vec<f64> {
        let draws = Draws::new(1, Purpose::Resample);
        (0..self.seeds).map(|k| uniform(draws.words(resample, k, 0)[0])).collect()
    }
}

/// The place at which a run is most probable, and its log density there.
fn best_of(laws: &[(f64, FigureDensity)], run: &ScaledFigures) -> (f64, f64) {
    laws.iter()
        .map(|(at, law)| (*at, law.log_density(run)))
        .fold((f64::NAN, f64::NEG_INFINITY), |best, it| if best.1 < it.1 { it } else { best })
}

/// All runs, or those that are picked.
fn picked<'r>(runs: &'r [ScaledFigures], picks: Option<&[f64]>) -> Vec<&'r ScaledFigures> {
    match picks {
        None => runs.iter().collect(),
        Some(picks) => {
            picks.iter().map(|share| &runs[(share * runs.len() as f64) as usize]).collect()
        }
    }
}

fn sd(values: impl Iterator<Item = f64> + Clone) -> f64 {
    standard_deviation(values.filter(|value| value.is_finite()))
}

impl CandidateScan<'_> {
    fn moments<'r>(
        &self,
        values: impl Iterator<Item = &'r RunsAtValue>,
        picks: Option<&[f64]>,
        usable: &[usize],
    ) -> Vec<RunMoments> {
        let moments_of = |it: &RunsAtValue| {
            RunMoments::from_runs(it.at, picked(&it.runs, picks).into_iter(), usable)
        };
        values.map(moments_of).collect()
    }

    /// Values tested within a window under as many seeds.
    fn within(&self, window: [f64; 2], seeds: u64) -> Vec<&RunsAtValue> {
        let is_in = |value: &&RunsAtValue| {
            let inside = (window[0] - SAME..=window[1] + SAME).contains(&value.at);
            inside && seeds <= value.runs.len() as u64
        };
        self.simulated.iter().filter(is_in).collect()
    }

    /// Where to try next: at the best place, and halfway to the simulated values on either side of it; further out where the best
    /// is at the end.
    fn about(&self, best: f64) -> Vec<f64> {
        let places: Vec<f64> = self.simulated.iter().map(|runs| runs.at).collect();
        let nearest = (0..places.len())
            .min_by(|&a, &b| (places[a] - best).abs().total_cmp(&(places[b] - best).abs()))
            .unwrap_or_default();
        let here = places[nearest];
        let before = nearest.checked_sub(1).map(|k| places[k]);
        let after = places.get(nearest + 1).copied();
        let (before, after) = match (before, after) {
            (Some(before), Some(after)) => (0.5 * (before + here), 0.5 * (here + after)),
            (None, Some(after)) => (2.0 * here - after, 0.5 * (here + after)),
            (Some(before), None) => (0.5 * (before + here), 2.0 * here - before),
            (None, None) => (here - 1.0, here + 1.0),
        };
        let mut next = vec![before, after];
        // Where it is not nearly simulated already.
        if 0.1 * (after - before) < (best - here).abs() {
            next.push(best);
        }
        next
    }
}
