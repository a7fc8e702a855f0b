//! The numbers of a fit: with intervals, and as a section of a configuration.

use super::cells::Deviations;
use super::fit::LinkFit;
use super::terms::Spec;
use super::{From, LinkStudy, group, search};
use crate::diagnose::ladder::COMMON;
use crate::study::{Estimate, Study as _};

/// Standard errors to either side of a 90 % interval.
const NINETY: f64 = 1.645;
/// Estimates that are correlated beyond this cannot be told apart.
const CONFUSABLE: f64 = 0.97;

impl LinkStudy {
    pub(super) fn estimates_of(
        &self,
        fit: &LinkFit,
        term: usize,
    ) -> (Vec<Estimate>, Option<String>) {
        let specs = self.specs_of(&fit.terms);
        let Some(place) = fit.terms.iter().position(|&other| other == term) else {
            return (Vec::new(), None);
        };
        let cells = self.cells(fit.decorrelation_m);
        let (_, determined) = fit.random.suggested(cells);
        let sd = fit.random.sd;
        let spread = |name: &str, value: f64, n: f64| {
            let relative = 1.0 / (2.0 * n.max(0.5)).sqrt();
            Estimate::new(
                name,
                "dB",
                value,
                (value * (-NINETY * relative).exp(), value * (NINETY * relative).exp()),
            )
        };
        match specs[place] {
            Spec::Shadowing(_) => {
                // Levels of neighbouring places are not independent of each other.
                let n = determined[0].min(group::n_pairs(&self.rows) as f64);
                let mut all = vec![spread("sd_db", sd.link_db, n)];
                if 1 < self.cells.len() {
                    let length = fit.decorrelation_m;
                    all.push(Estimate::new(
                        "decorrelation_m",
                        "m",
                        length,
                        (length / 2.0, length * 2.0),
                    ));
                }
                return (all, None);
            }
            Spec::Multipath(_) => {
                let (sd_db, coherence_mhz) = Self::fading(&specs, sd);
                let mut all = vec![spread("sd_db", sd_db, determined[1])];
                if let Some(value) = coherence_mhz {
                    all.push(Estimate::new(
                        "coherence_mhz",
                        "MHz",
                        value,
                        (value / 2.0, value * 2.0),
                    ));
                }
                return (all, None);
            }
            Spec::NodeOffset(_) => {
                let all = vec![
                    spread("tx_sd_db", sd.tx_db, determined[2]),
                    spread("rx_sd_db", sd.rx_db, determined[3]),
                ];
                return (all, None);
            }
            Spec::Effect(_) | Spec::Curve { .. } => {}
        }
        let before: usize = fit.states[..place].iter().map(|state| state.values.len()).sum();
        let parameters = specs[place].parameters();
        let inverse = fit.information.clone().try_inverse();
        let mut warning = None;
        let mut estimates: Vec<Estimate> = parameters
            .iter()
            .enumerate()
            .map(|(k, parameter)| {
                let value = fit.states[place].values[k];
                let error = inverse.as_ref().map_or(f64::INFINITY, |inverse| {
                    inverse[(before + k, before + k)].max(0.0).sqrt()
                });
                let curved = 0.0 < error && error.is_finite() && MOST_PROFILED < self.rows.len();
                let (low, high) = if curved {
                    let low = (value - NINETY * error).max(parameter.min);
                    (low, (value + NINETY * error).min(parameter.max))
                } else {
                    self.profile(fit, place, k, error)
                };
                if parameter.max - parameter.min <= high - low {
                    warning = Some(format!("{} is not determined by these data", parameter.key));
                }
                Estimate::new(parameter.key, parameter.unit, value, (low, high))
            })
            .collect();
        self.add_searched(fit, place, &mut estimates);
        if let Some(inverse) = inverse {
            warning = warning.or_else(|| self.confusable(fit, &specs, &inverse, place));
        }
        (estimates, warning)
    }

    /// What a search found beside the numbers of a fit: places, with how well they are known; and numbers that were found
    /// together with headings are known less well than the fit, which holds the headings, says.
    fn add_searched(&self, fit: &LinkFit, place: usize, estimates: &mut Vec<Estimate>) {
        let specs = self.specs_of(&fit.terms);
        let state = &fit.states[place];
        let has_headings = state.table.contains_key("headings_rad");
        let name = specs[place].entry().map_or("", |entry| entry.variant.name);
        if !has_headings && name != "hidden-obstacle" {
            return;
        }
        let all = self.fitted_rows();
        let left = self.slopes_left(fit, &all);
        if has_headings {
            let errors = search::headings::errors(&self.rows, &all, &left, state);
            for (estimate, error) in estimates.iter_mut().zip(errors.into_iter().flatten()) {
                estimate.low = estimate.low.min(estimate.value - NINETY * error);
                estimate.high = estimate.high.max(estimate.value + NINETY * error);
            }
            return;
        }
        let places = search::places::coordinates(&self.rows, &all, &left, state, FALL_NATS);
        estimates.extend(
            places
                .into_iter()
                .map(|at| Estimate::new(at.name, "m", at.value_m, (at.low_m, at.high_m))),
        );
    }

    pub(super) fn settings_of(&self, fit: &LinkFit, term: usize) -> serde_json::Value {
        let Some(place) = fit.terms.iter().position(|&other| other == term) else {
            return serde_json::Value::Null;
        };
        let spec = &self.specs[term];
        let Some(entry) = spec.entry() else { return serde_json::Value::Null };
        let mut keys = toml::Table::new();
        keys.insert("kind".to_owned(), toml::Value::String(entry.variant.name.to_owned()));
        keys.extend(fit.states[place].keys(spec));
        let sd = fit.random.sd;
        let spreads: Vec<(&str, f64)> = match spec {
            Spec::Shadowing(_) => vec![("sd_db", sd.link_db)],
            Spec::Multipath(_) => {
                let (sd_db, coherence_mhz) = Self::fading(&self.specs_of(&fit.terms), sd);
                let coherence_mhz = coherence_mhz.map(|value| ("coherence_mhz", value));
                [("sd_db", sd_db)].into_iter().chain(coherence_mhz).collect()
            }
            Spec::NodeOffset(_) => vec![("tx_sd_db", sd.tx_db), ("rx_sd_db", sd.rx_db)],
            Spec::Effect(_) | Spec::Curve { .. } => Vec::new(),
        };
        for (key, value) in spreads {
            keys.insert(key.to_owned(), toml::Value::Float(value));
        }
        serde_json::to_value(keys).unwrap_or_default()
    }

    /// Spread of multipath fading (dB) and, where nothing else makes a link's channels alike, its coherence (MHz).
    fn fading(specs: &[&Spec], sd: Deviations) -> (f64, Option<f64>) {
        if specs.iter().any(|spec| matches!(spec, Spec::Shadowing(_))) {
            return (sd.channel_db, None);
        }
        let sd_db = sd.channel_db.hypot(sd.link_db);
        let shared = (sd.link_db / sd_db) * (sd.link_db / sd_db);
        (sd_db, Some(coherence_mhz(shared)))
    }

    /// Two parameters of which one hides the other.
    fn confusable(
        &self,
        fit: &LinkFit,
        specs: &[&Spec],
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
                if CONFUSABLE < r.abs() {
                    return Some(format!(
                        "{} and {} can hardly be told apart on these data",
                        names[j].1, names[i].1
                    ));
                }
            }
        }
        None
    }
}

/// The coherence (MHz) with which the sixteen channels have this mean correlation with each other.
fn coherence_mhz(mean_correlation: f64) -> f64 {
    let mean = |coherence_mhz: f64| {
        let pairs = (1..16)
            .map(|apart| f64::from(16 - apart) * (-5.0 * f64::from(apart) / coherence_mhz).exp());
        pairs.sum::<f64>() / 120.0
    };
    let (mut low, mut high) = (0.1f64, 1e3f64);
    for _ in 0..40 {
        let middle = (low * high).sqrt();
        if mean(middle) < mean_correlation {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Half of the squared standard errors of a 90 % interval: by so much the log likelihood falls at its ends (nats).
const FALL_NATS: f64 = 0.5 * NINETY * NINETY;
/// With more rows the likelihood is a parabola, and its curvature says as much as a profile.
const MOST_PROFILED: usize = 50_000;
/// Steps in which an end is found.
const END_STEPS: usize = 6;

impl LinkStudy {
    /// The 90 % interval of a parameter by its profile: how far it can be moved, all others fitted again, until the
    /// likelihood has fallen as far as chance lets it.
    pub(super) fn profile(&self, fit: &LinkFit, place: usize, k: usize, error: f64) -> (f64, f64) {
        let specs = self.specs_of(&fit.terms);
        let parameter = &specs[place].parameters()[k];
        let best = fit.states[place].values[k];
        let all = self.fitted_rows();
        let from = |held| From { held, ..From::trial(COMMON, Some(fit)) };
        let fall = |value: f64, top: f64| {
            let mut states = fit.states.clone();
            states[place].values[k] = value;
            let there = self.run(&fit.terms, states, &all, from(Some((place, k))));
            (top - there.log_likelihood).max(0.0)
        };
        let top = self.run(&fit.terms, fit.states.clone(), &all, from(Some((place, k))));
        let top = top.log_likelihood.max(fit.log_likelihood);
        let end = |sign: f64| {
            let bound = if sign < 0.0 { parameter.min } else { parameter.max };
            let reach = (bound - best).abs();
            // The root of the fall is nearly a straight line: regula falsi, between what is too near and what too far.
            let (mut near, mut far) = (0.0, f64::INFINITY);
            let first =
                if error.is_finite() && 0.0 < error { NINETY * error } else { parameter.step };
            let mut step = first.min(reach);
            for _ in 0..END_STEPS {
                let now = fall(best + sign * step, top);
                if now < FALL_NATS {
                    near = step;
                    if reach <= step {
                        break;
                    }
                } else {
                    far = step;
                }
                let ratio = (FALL_NATS / now.max(1e-9)).sqrt().clamp(0.25, 4.0);
                let next = (step * ratio).min(reach);
                step = if far.is_finite() && (next <= near || far <= next) {
                    0.5 * (near + far)
                } else {
                    next
                };
                if (ratio - 1.0).abs() < 0.02 {
                    break;
                }
            }
            best + sign * step
        };
        (end(-1.0), end(1.0))
    }
}
