//! The numbers of a fit: with intervals, and as a section of a configuration.

use crate::COMMON;
use crate::links::LinkStudy;
use crate::links::fit::LinkFit;
use crate::links::fit::run::FitOptions;
use crate::links::fit::search;
use crate::links::random_effects::Random;
use crate::links::random_effects::cells::{self, HALF_WAVE_M, Span};
use crate::links::random_effects::covariance::{CorrelationLength, Products};
use crate::links::random_effects::scales::CORRELATION_S;
use crate::links::rows::blocks;
use crate::links::terms::TermSpec;
use crate::thresholds::{
    CERTAIN_PASS, JACKKNIFE_GROUPS, LINKS_COLLINEAR, MOST_COMPARED_ROWS, MOST_PROFILED_ROWS,
    TAIL_90,
};
use crate::{Estimate, Study as _, TermId, caution, is_as_wide, joined};
use numbers::normal::{FALL_90_NATS, Z_90};
use numbers::optimise::roots::ParabolicRoot;
use numbers::power::square;
use proto::config::{Field, Kind};
use proto::effect::{Role, Search};
use statrs::distribution::{ChiSquared, ContinuousCDF as _};
use std::collections::BTreeMap;

impl LinkStudy {
    pub(in crate::links) fn estimates_of(
        &self,
        fit: &LinkFit,
        term: TermId,
    ) -> (Vec<Estimate>, Option<String>) {
        let (mut estimates, caution) = self.fitted_estimates(fit, term);
        let mut cautions: Vec<String> = caution.into_iter().collect();
        // Spreads and lengths are found by no slope, and so within no range.
        if let Some(entry) = self.specs[term].entry().filter(|entry| {
            matches!(
                entry.fit.role,
                Role::RandomPerNode
                    | Role::RandomPerLink
                    | Role::RandomPerChannel
                    | Role::RandomInTime
                    | Role::RandomPerLinkInTime
            )
        }) {
            for estimate in &mut estimates {
                let field = entry.variant.fields.iter().find(|field| field.key == estimate.name);
                if let Some(Field { kind: Kind::Number(range), .. }) = field {
                    cautions.extend(bounded(estimate, [range.min, range.max]));
                }
            }
        }
        (estimates, joined(cautions))
    }

    fn fitted_estimates(&self, fit: &LinkFit, term: TermId) -> (Vec<Estimate>, Option<String>) {
        let specs = self.specs_of(&fit.terms);
        let Some(place) = fit.terms.iter().position(|&other| other == term) else {
            return (Vec::new(), None);
        };
        let cells = self.cells(fit.scales);
        let (_, determined) = fit.random.suggested(&cells);
        let sd = fit.random.sd;
        match specs[place] {
            TermSpec::Shadowing(_) => {
                // Levels of neighbouring places are not independent of each other.
                let n = determined[0].min(blocks::n_pairs(&self.rows) as f64);
                let level = spread("sd_db", sd.link_db, n);
                return with_length(level, "decorrelation_m", "m", self.decorrelation(fit));
            }
            TermSpec::Multipath(_) => {
                let (sd_db, coherence) = self.fading(fit);
                let level = spread("sd_db", sd_db, determined[1]);
                return with_length(level, "coherence_mhz", "MHz", coherence);
            }
            TermSpec::Drift(_) => {
                let level = spread("sd_db", sd.time_db, determined[4]);
                return with_length(level, CORRELATION_S, "s", self.drift(fit));
            }
            TermSpec::LinkDrift(_) => {
                let level = spread("sd_db", sd.channel_db, determined[1]);
                return with_length(level, CORRELATION_S, "s", self.link_drift(fit));
            }
            TermSpec::NodeOffset(_) => {
                let [senders, receivers] = self.n_ends;
                return of_nodes([
                    (spread("tx_sd_db", sd.tx_db, determined[2]), senders, "sender"),
                    (spread("rx_sd_db", sd.rx_db, determined[3]), receivers, "receiver"),
                ]);
            }
            TermSpec::Effect(_)
            | TermSpec::Limited(..)
            | TermSpec::Formula(..)
            | TermSpec::Curve(_) => {}
        }
        let before: usize = fit.states[..place].iter().map(|state| state.values.len()).sum();
        let parameters = specs[place].parameters();
        let inverse = fit.information.clone().try_inverse();
        let mut estimates: Vec<Estimate> = parameters
            .iter()
            .enumerate()
            .map(|(k, parameter)| {
                let value = fit.states[place].values[k];
                let error = inverse.as_ref().map_or(f64::INFINITY, |inverse| {
                    inverse[(before + k, before + k)].max(0.0).sqrt()
                });
                // A profile takes many fits.
                let is_quick = MOST_PROFILED_ROWS < self.rows.len() || self.is_stopped();
                let curved = is_quick && 0.0 < error && error.is_finite();
                let (low, high) = if curved {
                    let low = (value - Z_90 * error).max(parameter.min);
                    (low, (value + Z_90 * error).min(parameter.max))
                } else {
                    self.profile(fit, place, k, error)
                };
                Estimate::new(parameter.key, parameter.unit, value, (low, high))
            })
            .collect();
        if !self.is_stopped() {
            self.add_searched(fit, place, &mut estimates);
        }
        let mut cautions = Vec::new();
        for (parameter, estimate) in parameters.iter().zip(&mut estimates) {
            let range = [parameter.min, parameter.max];
            estimate.is_identifiable = !is_as_wide([estimate.low, estimate.high], range);
            cautions.extend(caution(parameter, estimate));
        }
        if let (true, Some(inverse)) = (cautions.is_empty(), inverse) {
            cautions.extend(self.confusable(fit, &specs, &inverse, place));
        }
        (estimates, joined(cautions))
    }

    /// Adds what a search found besides the parameters of a fit: places with their standard errors. Parameters that were found
    /// together with headings get larger standard errors, because the fit holds the headings fixed.
    fn add_searched(&self, fit: &LinkFit, place: usize, estimates: &mut Vec<Estimate>) {
        let specs = self.specs_of(&fit.terms);
        let state = &fit.states[place];
        let has_headings = state.table.contains_key("headings_rad");
        if !has_headings && specs[place].search() != Search::Places {
            return;
        }
        let all = self.fitted_rows();
        let likelihoods = self.row_likelihoods(fit, &all);
        if has_headings {
            let errors = search::headings::errors(&self.rows, &all, &likelihoods, state);
            for (estimate, error) in estimates.iter_mut().zip(errors.into_iter().flatten()) {
                estimate.low = estimate.low.min(estimate.value - Z_90 * error);
                estimate.high = estimate.high.max(estimate.value + Z_90 * error);
            }
            return;
        }
        for found in search::places::coordinates(&self.rows, &all, &likelihoods, state, TAIL_90) {
            match estimates.iter_mut().find(|estimate| estimate.name == found.name) {
                // The loss is known less well than the fit, which holds the place, says.
                Some(estimate) => {
                    estimate.low = estimate.low.min(found.low);
                    estimate.high = estimate.high.max(found.high);
                }
                None => {
                    let ends = (found.low, found.high);
                    estimates.push(Estimate::new(found.name, "m", found.value, ends));
                }
            }
        }
    }

    pub(in crate::links) fn settings_of(&self, fit: &LinkFit, term: TermId) -> Option<toml::Table> {
        let place = fit.terms.iter().position(|&other| other == term)?;
        let spec = &self.specs[term];
        let entry = spec.entry()?;
        let mut keys = toml::Table::new();
        keys.insert("kind".to_owned(), toml::Value::String(entry.variant.name.to_owned()));
        keys.extend(fit.states[place].keys(spec));
        if spec.is_random() {
            for spread in self.estimates_of(fit, term).0 {
                keys.insert(spread.name, toml::Value::Float(spread.value));
            }
        }
        Some(keys)
    }

    /// Spread of multipath fading (dB) and, where nothing else makes a link's channels alike, its coherence (MHz).
    fn fading(&self, fit: &LinkFit) -> (f64, Option<CorrelationLength>) {
        let sd = fit.random.sd;
        if self.specs_of(&fit.terms).iter().any(|spec| matches!(spec, TermSpec::Shadowing(_))) {
            return (sd.channel_db, None);
        }
        let edges = (0..16).map(|apart| 5.0 * f64::from(apart) + 2.5).collect();
        let fit = &fit.without_links();
        let products = self.products(fit, edges, |one, other| {
            let channel = |row: usize| self.rows.links.rows[row].channel;
            let apart = channel(one)?.abs_diff(channel(other)?);
            (self.way_m(one, other) < HALF_WAVE_M).then_some(5.0 * f64::from(apart))
        });
        (libm::hypot(sd.channel_db, sd.link_db), products.length())
    }

    /// The length over which shadowing changes (m), where nodes move.
    fn decorrelation(&self, fit: &LinkFit) -> Option<CorrelationLength> {
        if self.lengths_m.len() < 2 {
            return None;
        }
        let edges =
            [0.125, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0, 48.0];
        let fit = &fit.without_links();
        self.products(fit, edges.to_vec(), |one, other| Some(self.way_m(one, other))).length()
    }

    /// The time over which levels of links change (s).
    fn link_drift(&self, fit: &LinkFit) -> Option<CorrelationLength> {
        let fit = &marginal(fit, |random| random.clone().without_channels());
        let measured = &self.rows.links.rows;
        let lag = |one: usize, other: usize| {
            (measured[one].run == measured[other].run)
                .then(|| (measured[one].time_s - measured[other].time_s).abs())
        };
        self.products(fit, self.lags_s(), lag).length()
    }

    /// The time over which the level of all links changes (s): from means of short spans of time.
    fn drift(&self, fit: &LinkFit) -> Option<CorrelationLength> {
        let cells = self.cells(fit.scales);
        let fit = &marginal(fit, |random| random.clone().without_times(&cells));
        let edges_s = self.lags_s();
        let span_s = *edges_s.first()?;
        let numbers = cells::spans(&self.rows, Some(span_s));
        let mut spans: BTreeMap<Span, (f64, f64)> = BTreeMap::new();
        for (row, residual_db) in self.residuals_db(fit) {
            let sum = spans.entry(numbers[row]).or_default();
            (sum.0, sum.1) = (sum.0 + residual_db, sum.1 + 1.0);
        }
        let means: Vec<(Span, f64)> =
            spans.into_iter().map(|(key, (sum, n))| (key, sum / n)).collect();
        let mut products = Products::new(edges_s);
        for (index, ((run, span), mean)) in means.iter().enumerate() {
            // Neighbours in time are left out together.
            let part = index * JACKKNIFE_GROUPS / means.len();
            let later = means[index + 1..].iter().filter(|((other, _), _)| other == run);
            for ((_, other), right) in later {
                products.add(part, (other - span) as f64 * span_s, mean * right);
            }
        }
        products.length()
    }

    /// Upper ends of bins of time between two rows (s): from a part of the shortest time over which drift is looked for.
    fn lags_s(&self) -> Vec<f64> {
        let (Some(shortest_s), Some(longest_s)) = (self.times_s.first(), self.times_s.last())
        else {
            // All rows have one time.
            return Vec::new();
        };
        let mut lags_s = vec![0.25 * shortest_s];
        while let Some(last_s) = lags_s.last().copied().filter(|last_s| *last_s < 3.0 * longest_s) {
            lags_s.push(last_s * std::f64::consts::SQRT_2);
        }
        lags_s
    }

    /// What both ends of a link have moved between two rows (m).
    fn way_m(&self, one: usize, other: usize) -> f64 {
        let ends = |row: usize| {
            let (tx, rx) = self.rows.ends(row);
            if tx.id < rx.id { [tx, rx] } else { [rx, tx] }.map(|end| end.position_m)
        };
        let moved = |(a, b): ([f64; 3], [f64; 3])| {
            (0..3).map(|axis| square(a[axis] - b[axis])).sum::<f64>().sqrt()
        };
        ends(one).into_iter().zip(ends(other)).map(moved).sum()
    }

    /// Products of the residuals of two rows of a link by their lag; none: they are not compared.
    fn products(
        &self,
        fit: &LinkFit,
        edges: Vec<f64>,
        lag: impl Fn(usize, usize) -> Option<f64>,
    ) -> Products {
        let mut links: BTreeMap<(u32, u32), Vec<(usize, f64)>> = BTreeMap::new();
        for (row, residual_db) in self.residuals_db(fit) {
            let measured = &self.rows.links.rows[row];
            let key = (measured.tx.min(measured.rx), measured.tx.max(measured.rx));
            links.entry(key).or_default().push((row, residual_db));
        }
        let mut products = Products::new(edges);
        for (link, rows) in links.values().enumerate() {
            // The number of pairs grows with the square of the rows of a link.
            let each = rows.len().div_ceil(MOST_COMPARED_ROWS);
            let rows: Vec<&(usize, f64)> = rows.iter().step_by(each).collect();
            for (index, &&(one, earlier_db)) in rows.iter().enumerate() {
                for &&(other, later_db) in &rows[index + 1..] {
                    if let Some(lag) = lag(one, other) {
                        products.add(link, lag, earlier_db * later_db);
                    }
                }
            }
        }
        products
    }

    /// Residuals of readings under a fit, row by row (dB). Rows that might as well have been lost are left out: they are read only
    /// where their level is high.
    pub(in crate::links) fn residuals_db(
        &self,
        fit: &LinkFit,
    ) -> impl Iterator<Item = (usize, f64)> {
        let predictions = self.predictions(fit).into_iter().enumerate();
        predictions
            .filter(|(row, predicted)| {
                self.rows.is_received(*row) && CERTAIN_PASS < predicted.passes
            })
            .map(|(row, predicted)| (row, self.rows.links.rows[row].rssi_dbm - predicted.rssi_dbm))
    }

    /// Two parameters of which one hides the other.
    fn confusable(
        &self,
        fit: &LinkFit,
        specs: &[&TermSpec],
        inverse: &nalgebra::DMatrix<f64>,
        place: usize,
    ) -> Option<String> {
        let names: Vec<(usize, String)> = specs
            .iter()
            .enumerate()
            .flat_map(|(index, spec)| {
                let term = &self.candidates[fit.terms[index]].name;
                (0..fit.states[index].values.len()).map(move |k| {
                    let key = spec.parameters().get(k).map_or("a knot", |parameter| parameter.key);
                    (index, format!("{key} of {term}"))
                })
            })
            .collect();
        for i in 0..names.len() {
            for j in 0..i {
                if names[i].0 != place && names[j].0 != place {
                    continue;
                }
                let r = inverse[(i, j)] / (inverse[(i, i)] * inverse[(j, j)]).sqrt();
                if LINKS_COLLINEAR < r.abs() {
                    return Some(format!(
                        "{} and {} are nearly collinear on these data",
                        names[j].1, names[i].1
                    ));
                }
            }
        }
        None
    }
}

/// A fit in which some random levels are as if nothing was known of them.
fn marginal(fit: &LinkFit, random: impl Fn(&Random) -> Random) -> LinkFit {
    let mut marginal = fit.clone();
    marginal.random = random(&fit.random);
    marginal
}

/// A standard deviation (dB) with its interval: `n` levels of its law are known.
fn spread(name: &str, value: f64, n: f64) -> Estimate {
    let n = n.max(0.5);
    let ends = match ChiSquared::new(n) {
        Ok(law) => [1.0 - TAIL_90, TAIL_90].map(|part| value * (n / law.inverse_cdf(part)).sqrt()),
        Err(_) => [0.0, f64::INFINITY],
    };
    Estimate::new(name, "dB", value, (ends[0], ends[1]))
}

/// Keeps an estimate within what a configuration takes. Cautions if it is not below the bound, or if its interval is as wide as the
/// range: then it is not identifiable.
fn bounded(estimate: &mut Estimate, [least, most]: [f64; 2]) -> Option<String> {
    let mut caution = None;
    if estimate.is_identifiable && is_as_wide([estimate.low, estimate.high], [least, most]) {
        estimate.is_identifiable = false;
        caution = Some(format!("{} is not identifiable from these data", estimate.name));
    }
    if estimate.value < most {
        return caution;
    }
    if estimate.is_identifiable {
        caution = Some(format!("{} is at the bound of its range, {most}", estimate.name));
    }
    estimate.value = most;
    estimate.low = estimate.low.min(most);
    caution
}

/// The spreads of levels of nodes, each with the number of its nodes and what these do. A single node has a level, but no spread: 0
/// stands in its place.
fn of_nodes(spreads: [(Estimate, usize, &str); 2]) -> (Vec<Estimate>, Option<String>) {
    let mut cautions = Vec::new();
    let checked = |(estimate, n, what): (Estimate, usize, &str)| {
        if 1 < n {
            return estimate;
        }
        let name = &estimate.name;
        cautions.push(format!("{name} is not identifiable: the data have a single {what}"));
        Estimate::new(name, &estimate.unit, 0.0, (0.0, 0.0)).not_identifiable()
    };
    let all = spreads.map(checked).into();
    (all, joined(cautions))
}

/// The spread of levels with the length over which they change, if the data tell one, and a warning if they hardly do.
fn with_length(
    mut level: Estimate,
    name: &str,
    unit: &str,
    length: Option<CorrelationLength>,
) -> (Vec<Estimate>, Option<String>) {
    let Some(length) = length else { return (vec![level], None) };
    widen(&mut level, &length);
    let found = Estimate::new(name, unit, length.value, (length.low, length.high));
    if length.is_determined {
        return (vec![level, found], None);
    }
    let warning = format!("{name} is not identifiable from these data");
    (vec![level, found.not_identifiable()], Some(warning))
}

/// Widens the interval of the spread of levels to what the covariance of residuals says of it: a fit takes levels for constant
/// within a place, and those of channels for independent.
fn widen(spread: &mut Estimate, length: &CorrelationLength) {
    let sd_at = |sds: f64| length.sd_db * libm::exp(sds * length.sd_error);
    spread.low = spread.low.min(sd_at(-Z_90));
    spread.high = spread.high.max(sd_at(Z_90));
}

/// Steps in which an end is found.
const END_STEPS: usize = 6;

impl LinkStudy {
    /// A fit with a parameter at another value, all others fitted again.
    pub(in crate::links) fn held_at(
        &self,
        fit: &LinkFit,
        term: TermId,
        key: &str,
        value: f64,
    ) -> Option<LinkFit> {
        let place = fit.terms.iter().position(|&other| other == term)?;
        let parameters = self.specs[term].parameters();
        let k = parameters.iter().position(|parameter| parameter.key == key)?;
        let mut states = fit.states.clone();
        states[place].values[k] = value;
        let from = FitOptions { held: Some((place, k)), ..FitOptions::quick(COMMON, Some(fit)) };
        Some(self.run(&fit.terms, states, &self.fitted_rows(), from))
    }

    /// The 90 % interval of a parameter by its profile: how far it can be moved, all others fitted again, until the
    /// likelihood has fallen as far as chance lets it.
    pub(in crate::links) fn profile(
        &self,
        fit: &LinkFit,
        place: usize,
        k: usize,
        error: f64,
    ) -> (f64, f64) {
        let specs = self.specs_of(&fit.terms);
        let parameter = &specs[place].parameters()[k];
        let best = fit.states[place].values[k];
        let all = self.fitted_rows();
        let from = |held| FitOptions { held, ..FitOptions::quick(COMMON, Some(fit)) };
        let fall = |value: f64, top: f64| {
            let mut states = fit.states.clone();
            states[place].values[k] = value;
            let profiled = self.run(&fit.terms, states, &all, from(Some((place, k))));
            (top - profiled.log_likelihood).max(0.0)
        };
        let top = self.run(&fit.terms, fit.states.clone(), &all, from(Some((place, k))));
        let top = top.log_likelihood.max(fit.log_likelihood);
        let end = |sign: f64| {
            let bound = if sign < 0.0 { parameter.min } else { parameter.max };
            let reach = (bound - best).abs();
            let first =
                if error.is_finite() && 0.0 < error { Z_90 * error } else { parameter.step };
            let search =
                ParabolicRoot { max_iterations: END_STEPS, max_ratio: 4.0, tolerance: 0.02 };
            let fall_at = |step: f64| fall(best + sign * step, top);
            best + sign * search.find(fall_at, FALL_90_NATS, first, reach)
        };
        (end(-1.0), end(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_single_node_has_no_spread() {
        let spreads = |senders, receivers| {
            of_nodes([
                (spread("tx_sd_db", 2.0, 1.0), senders, "sender"),
                (spread("rx_sd_db", 3.0, 8.0), receivers, "receiver"),
            ])
        };
        let (all, warning) = spreads(1, 9);
        assert!(!all[0].is_identifiable && all[1].is_identifiable);
        assert_eq!((all[0].value, all[1].value), (0.0, 3.0));
        let expected = "tx_sd_db is not identifiable: the data have a single sender";
        assert_eq!(warning.as_deref(), Some(expected));
        let (all, warning) = spreads(2, 2);
        assert!(all.iter().all(|estimate| estimate.is_identifiable));
        assert_eq!(warning, None);
    }

    #[test]
    fn a_spread_beyond_its_range_is_cut_and_cautioned_against() {
        let range = [0.0, 20.0];
        let mut estimate = spread("sd_db", 19.9, 30.0);
        assert_eq!(bounded(&mut estimate, range), None);
        assert_eq!(estimate.value, 19.9);
        let mut estimate = spread("sd_db", 30.0, 30.0);
        let caution = bounded(&mut estimate, range);
        assert_eq!(caution.as_deref(), Some("sd_db is at the bound of its range, 20"));
        assert_eq!(estimate.value, 20.0);
        assert!(estimate.low <= 20.0 && 20.0 <= estimate.high);
    }

    #[test]
    fn a_spread_whose_interval_is_wider_than_its_range_is_not_identifiable() {
        // Of two nodes: one degree of freedom.
        let mut estimate = spread("tx_sd_db", 1.7, 1.0);
        let caution = bounded(&mut estimate, [0.0, 20.0]);
        assert_eq!(caution.as_deref(), Some("tx_sd_db is not identifiable from these data"));
        assert!(!estimate.is_identifiable && estimate.value == 1.7);
    }

    #[test]
    fn a_length_that_the_data_do_not_tell_is_not_identifiable() {
        let length = |is_determined| CorrelationLength {
            value: 300.0,
            low: 0.1,
            high: 300.0,
            is_determined,
            sd_db: 2.0,
            sd_error: 0.1,
        };
        let of = |is_determined| {
            let level = spread("sd_db", 2.0, 30.0);
            with_length(level, "decorrelation_m", "m", Some(length(is_determined)))
        };
        let (estimates, warning) = of(false);
        assert!(!estimates[1].is_identifiable);
        assert!(warning.is_some_and(|text| text.starts_with("decorrelation_m is not")));
        let (estimates, warning) = of(true);
        assert!(estimates[1].is_identifiable && warning.is_none());
    }
}
