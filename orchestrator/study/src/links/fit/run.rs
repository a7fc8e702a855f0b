//! One fit: from the terms and their starts to convergence.

use super::{FitProblem, FreeRandomEffects, IterationLimits, LinkFit};
use crate::links::LinkStudy;
use crate::links::random_effects::{Random, RandomEffectSds};
use crate::links::terms::basis::Basis;
use crate::links::terms::{TermSpec, TermState};
use crate::{Study as _, TermId};
use proto::effect::Level;
use std::sync::Arc;

/// From where a fit starts, and how far it goes.
#[derive(Clone, Copy)]
pub(in crate::links) struct FitOptions<'a> {
    /// At which level it will be judged.
    pub(in crate::links) level: Level,
    /// A fit of fewer or other terms.
    pub(in crate::links) parent: Option<&'a LinkFit>,
    /// A trial: the parent's terms are taken for straight lines, and spreads of random levels stay as they are.
    pub(in crate::links) is_trial: bool,
    /// A parameter that stays where it is: its term, and its place there.
    pub(in crate::links) held: Option<(usize, usize)>,
    /// Most steps.
    pub(in crate::links) most_steps: usize,
}

impl<'a> FitOptions<'a> {
    /// A trial on top of a parent, if there is one.
    pub(in crate::links) fn quick(level: Level, parent: Option<&'a LinkFit>) -> Self {
        Self { level, parent, is_trial: true, held: None, most_steps: TRIAL_STEPS }
    }

    /// A fit to convergence.
    pub(in crate::links) fn to_convergence(level: Level, parent: Option<&'a LinkFit>) -> Self {
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

impl LinkStudy {
    /// Fits terms to rows, each from where a fit with it ended or else from the best of its starts.
    pub(in crate::links) fn fitted(
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

    /// A quick fit of the last of `terms` on top of its parent.
    pub(in crate::links) fn screened(
        &self,
        terms: &[TermId],
        level: Level,
        parent: &LinkFit,
    ) -> Option<LinkFit> {
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

    pub(in crate::links) fn run(
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
