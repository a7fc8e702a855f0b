//! Power: how large an effect must be for a campaign to show it. Campaigns with the effect at several sizes are simulated at the
//! rows of a file, and each is judged by the rule by which `diagnose` accepts an effect.
//!
//! The effect is tested alone on the model as configured. Its gain on held-out data must be significant after the correction for
//! all candidates (the first step of Holm's rule), and large enough. Rivals that might be named in its place are not tested.

pub mod answer;

use crate::acceptance;
use crate::extend::{self, ExtendError};
use crate::gain::Scores;
use crate::ladder::Search;
use crate::progress::SearchProgress;
use crate::request::{Observer, Request, stop_flag};
use crate::simulate;
use answer::{Power, SCHEMA, Size};
use measure::config::Compared;
use measure::table::DataTable;
use physics::Model;
use proto::effect::{Fixed, FromModel, Parameter};
use proto::rng::{Draws, Purpose};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF as _, Normal};
use study::choices::Choices;
use study::open::{self, OpenError, Subject};
use study::thresholds::{FEWEST_BLOCKS, FIRST_CAMPAIGNS, MOST_FIRST_ESTIMATES, POWER, POWER_SIZES};
use study::{StopFlag, Study};

/// Which effect is to be found, and how often campaigns are simulated for it.
#[derive(Clone, Copy, Debug)]
pub struct Question<'a> {
    /// Name of the effect.
    pub effect: &'a str,
    /// Further keys of it, as TOML: `reference_c=18`.
    pub with: &'a [String],
    /// The key that is its size; by default the first that is fitted.
    pub vary: Option<&'a str>,
    /// Campaigns at each size.
    pub campaigns: u64,
    /// Seed of all draws.
    pub seed: u64,
}

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum PowerError {
    /// One of the files cannot be used, or the effect cannot be built.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// There is no such effect, or these data cannot show it at any size.
    #[error(transparent)]
    Effect(#[from] ExtendError),
    /// The data are too few.
    #[error(
        "these data cannot reveal {effect} at any size: they have {n_blocks} {unit}, and at least {least} are required"
    )]
    TooFew {
        /// What was asked for.
        effect: String,
        /// How many blocks there are.
        n_blocks: usize,
        /// What they are.
        unit: &'static str,
        /// How many are needed.
        least: usize,
    },
    /// There is no such key.
    #[error("--vary {key}: {effect} has no such key; choose from {known}")]
    Key {
        /// The key.
        key: String,
        /// The effect.
        effect: String,
        /// What there is.
        known: String,
    },
}

/// A number that is the size of an effect.
struct Knob {
    key: String,
    unit: &'static str,
    /// The value at which the effect does nothing.
    neutral: f64,
    /// One unit of size: added to `neutral`.
    unit_size: f64,
    /// Greatest size, in such units.
    greatest: f64,
}

/// The result of one simulated campaign that has the effect.
#[derive(Clone, Copy, Debug)]
struct CampaignResult {
    is_found: bool,
    /// Gain in standard errors, less what is needed for significance.
    margin: f64,
    rmse: [f64; 2],
}

/// Finds the smallest size of an effect that a campaign like that of the request would show with a probability of [`POWER`]. The
/// choices hold for the file and for every campaign. Simulations that are stopped give the answer that they have until then, with
/// `complete` false.
///
/// # Errors
///
/// What is wrong with the files or the question.
pub fn power(
    request: &Request<'_>,
    question: &Question<'_>,
    observer: &dyn Observer,
) -> Result<Power, PowerError> {
    let subject = open::subject(request.table)?;
    let plan = PowerPlan::new(request, question, subject, stop_flag(observer))?;
    let knob = plan.knob()?;
    let mut asked = 0;
    let mut at = |size: f64, n: u64| -> Result<Vec<CampaignResult>, PowerError> {
        let first = asked;
        asked += n;
        observer.progress(SearchProgress::Campaigns {
            parameter: &knob.key,
            value: plan.value(&knob, size),
            campaigns: n,
        });
        (first..asked)
            .into_par_iter()
            .map(|k| plan.run_campaign(&knob, size, question.seed + k))
            .collect()
    };
    // A first estimate: the gain in standard errors grows in proportion to the size.
    let needed = Normal::standard().inverse_cdf(POWER);
    let mut size = knob.greatest.min(1.0);
    for _ in 0..MOST_FIRST_ESTIMATES {
        let outcomes = at(size, FIRST_CAMPAIGNS)?;
        if plan.stop.is_set() {
            break;
        }
        let margin = outcomes.iter().map(|o| o.margin).sum::<f64>() / outcomes.len() as f64;
        let excess = margin - needed;
        if excess.abs() < 0.7 || size == knob.greatest && excess < 0.0 {
            break;
        }
        let critical = plan.critical();
        let factor = ((critical + needed) / (critical + margin).max(0.5)).clamp(0.2, 3.0);
        size = (size * factor).min(knob.greatest);
    }
    let mut points: Vec<(f64, u64, Vec<CampaignResult>)> = Vec::new();
    for relative in POWER_SIZES {
        let size = (size * relative).min(knob.greatest);
        if !plan.stop.is_set() && points.iter().all(|(other, ..)| *other != size) {
            let outcomes = at(size, question.campaigns)?;
            if !plan.stop.is_set() {
                points.push((size, question.campaigns, outcomes));
            }
        }
    }
    // Detections may begin elsewhere, where it is not significance that decides but whether it is worth having.
    for _ in 0..4 {
        let share =
            |point: &(f64, u64, Vec<CampaignResult>)| n_found(&point.2) as f64 / point.1 as f64;
        let next = match (points.first(), points.last()) {
            (Some(first), _) if POWER <= share(first) => first.0 * 0.6,
            (_, Some(last)) if share(last) < POWER && last.0 < knob.greatest => {
                (last.0 * 1.5).min(knob.greatest)
            }
            _ => break,
        };
        if plan.stop.is_set() {
            break;
        }
        let outcomes = at(next, question.campaigns)?;
        if plan.stop.is_set() {
            break;
        }
        points.push((next, question.campaigns, outcomes));
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    Ok(plan.answer(&knob, &points))
}

fn n_found(outcomes: &[CampaignResult]) -> usize {
    outcomes.iter().filter(|outcome| outcome.is_found).count()
}

/// The size at which a normal law over the logarithm of sizes reaches [`POWER`]: the likeliest one. `None`: even the greatest
/// size is hardly ever found.
fn detectable_size(points: &[(f64, u64, Vec<CampaignResult>)]) -> Option<f64> {
    let law = Normal::standard();
    let mut best: Option<(f64, f64)> = None;
    let (low, high) = (points.first()?.0 * 0.5, points.last()?.0 * 1.25);
    for i in 0..=200 {
        let middle = libm::log(low) + f64::from(i) / 200.0 * libm::log(high / low);
        for width in [0.05, 0.08, 0.12, 0.18, 0.27, 0.4] {
            let log: f64 = points
                .iter()
                .map(|(size, n, outcomes)| {
                    let p = law.cdf((libm::log(*size) - middle) / width).clamp(1e-3, 1.0 - 1e-3);
                    let k = n_found(outcomes) as f64;
                    k * libm::log(p) + (*n as f64 - k) * libm::log(1.0 - p)
                })
                .sum();
            let size = libm::exp(middle + law.inverse_cdf(POWER) * width);
            if best.is_none_or(|(other, _)| other < log) {
                best = Some((log, size));
            }
        }
    }
    let (_, size) = best?;
    (size <= points.last()?.0 * 1.0001).then_some(size)
}

/// The checked question, with what all campaigns share.
struct PowerPlan<'a> {
    config: &'a Compared,
    table: &'a DataTable,
    choices: &'a Choices,
    question: &'a Question<'a>,
    subject: Subject,
    stop: StopFlag,
    /// `netsim.phy.effect`, `robotsim.dynamics.effect`.
    section: &'static str,
    /// Standard deviation of the noise that all campaigns have.
    noise: f64,
    n_candidates: usize,
    n_blocks: usize,
    parameters: &'static [Parameter],
    /// Keys that repeat a property of the configured model.
    starts: Vec<(String, toml::Value)>,
    /// Keys that are not varied.
    keys: Vec<(String, toml::Value)>,
}

impl<'a> PowerPlan<'a> {
    fn new(
        request: &'a Request<'a>,
        question: &'a Question<'a>,
        subject: Subject,
        stop: StopFlag,
    ) -> Result<Self, PowerError> {
        let Request { config, table, ref choices, .. } = *request;
        let kind = question.effect.trim_end_matches(" (turn)");
        let ((n_candidates, n_blocks), starts) = match subject {
            Subject::Links => {
                let (study, _) = open::links(config, table, choices)?;
                let entry = config.catalogues.radio.effects.find(kind);
                let from_model = entry.map_or(&[][..], |entry| entry.fit.from_model);
                let starts = configured_keys(from_model, &study.rows.model);
                (candidates_and_blocks(&study, question.effect)?, starts)
            }
            Subject::Robots => {
                let (study, _) = open::robots(config, table, choices)?;
                let entry = config.catalogues.robots.effects.find(kind);
                let starts = entry.map(|entry| study.configured_keys(entry)).unwrap_or_default();
                (candidates_and_blocks(&study, question.effect)?, starts)
            }
        };
        let (parameters, variants, section) = match subject {
            Subject::Links => config
                .catalogues
                .radio
                .effects
                .find(kind)
                .map(|entry| (entry.fit.parameters, entry.fit.variants, "netsim.phy.effect")),
            Subject::Robots => config.catalogues.robots.effects.find(kind).map(|entry| {
                (entry.fit.parameters, entry.fit.variants, "robotsim.dynamics.effect")
            }),
        }
        .unwrap_or((&[], &[], ""));
        let is_turn = question.effect != kind;
        let variant = variants
            .iter()
            .find(|keys| {
                let turns = keys.iter().any(|(key, on)| *key == "on" && is_text(on, "turn"));
                turns == is_turn
            })
            .copied()
            .unwrap_or_default();
        let mut keys: Vec<(String, toml::Value)> =
            vec![("kind".to_owned(), toml::Value::String(kind.to_owned()))];
        keys.extend(variant.iter().map(|(key, value)| ((*key).to_owned(), value.value())));
        keys.extend(
            parameters.iter().map(|parameter| {
                (parameter.key.to_owned(), toml::Value::Float(parameter.starts[0]))
            }),
        );
        for (key, value) in starts.iter().cloned() {
            match keys.iter_mut().find(|(other, _)| *other == key) {
                Some((_, other)) => *other = value,
                None => keys.push((key, value)),
            }
        }
        // Noise as in the file, or as configured: the same in every campaign.
        let noise = simulate::noise(config, table, choices)?;
        let mut plan = Self {
            config,
            table,
            choices,
            question,
            subject,
            stop,
            section,
            noise,
            n_candidates,
            n_blocks,
            parameters,
            starts,
            keys,
        };
        plan.take_given()?;
        Ok(plan)
    }

    /// Keys from the command line go before what a fit would start from.
    fn take_given(&mut self) -> Result<(), PowerError> {
        let text: String = self.question.with.iter().map(|key| format!("{key}\n")).collect();
        let table: toml::Table = toml::from_str(&text).map_err(|error| OpenError::Useless {
            file: "--with".to_owned(),
            reason: format!("must be KEY=VALUE with a TOML value: {}", error.message()),
        })?;
        for (key, value) in table {
            match self.keys.iter_mut().find(|(other, _)| *other == key) {
                Some((_, other)) => *other = value,
                None => self.keys.push((key, value)),
            }
        }
        Ok(())
    }

    /// The configuration with the effect in it.
    fn with_effect(&self, key: &str, value: f64) -> Result<Compared, PowerError> {
        let mut text = format!("{}\n[[{}]]\n", self.config.text.trim_end(), self.section);
        let mut table = toml::Table::new();
        table.extend(self.keys.iter().cloned());
        table.insert(key.to_owned(), toml::Value::Float(value));
        // Entries of lists, `name[i]`, stand under the list's name.
        let lists: Vec<String> = table.keys().filter(|key| key.contains('[')).cloned().collect();
        for entry in lists {
            let value = table.remove(&entry);
            let name = entry.split('[').next().unwrap_or_default().to_owned();
            let list = table.entry(name).or_insert_with(|| toml::Value::Array(Vec::new()));
            if let (Some(list), Some(value)) = (list.as_array_mut(), value) {
                list.push(value);
            }
        }
        text.push_str(&table.to_string());
        Ok(self.config.with_text(text).map_err(OpenError::from)?)
    }

    /// What the effect does at a value, in a measure of its own that is 0 where it does nothing.
    fn measure(&self, key: &str, value: f64) -> Result<f64, PowerError> {
        let with = self.with_effect(key, value)?;
        Ok(match self.subject {
            Subject::Links => {
                let (plain, _) = open::links(self.config, self.table, &Choices::NONE)?;
                let (study, _) = open::links(&with, self.table, &Choices::NONE)?;
                let budget = |rows: &study::links::rows::ModelledLinks, row: usize| {
                    rows.link(row, |link| rows.model.evaluate(link))
                };
                let sum: f64 = (0..study.rows.len().min(plain.rows.len()))
                    .map(|row| {
                        let (a, b) = (budget(&plain.rows, row), budget(&study.rows, row));
                        (a.register_rssi_dbm - b.register_rssi_dbm).abs()
                            + 10.0 * (a.reception_probability - b.reception_probability).abs()
                    })
                    .sum();
                let scatter = |rows: &study::links::rows::ModelledLinks| {
                    rows.model.scatters().iter().map(|s| s.max_loss_db()).sum::<f64>()
                };
                sum / study.rows.len() as f64 + scatter(&study.rows) - scatter(&plain.rows)
            }
            Subject::Robots => {
                let draws = Draws::new(1, Purpose::Gust);
                let plain = open::robots(self.config, self.table, &Choices::NONE)?.0.driven(draws);
                let driven = open::robots(&with, self.table, &Choices::NONE)?.0.driven(draws);
                let way: f64 = plain
                    .places_m
                    .iter()
                    .zip(&driven.places_m)
                    .map(|(a, b)| libm::hypot(a[0] - b[0], a[1] - b[1]))
                    .sum();
                way / plain.places_m.len() as f64 + driven.more_sd_m
            }
        })
    }

    /// The key that is the size, where it does nothing, and how it is counted.
    fn knob(&self) -> Result<Knob, PowerError> {
        let parameter = match self.question.vary {
            None => self.parameters.first(),
            Some(key) => self.parameters.iter().find(|parameter| parameter.key == key),
        };
        let Some(parameter) = parameter else {
            let known: Vec<&str> = self.parameters.iter().map(|parameter| parameter.key).collect();
            return Err(PowerError::Key {
                key: self.question.vary.unwrap_or_default().to_owned(),
                effect: self.question.effect.to_owned(),
                known: known.join(", "),
            });
        };
        let (min, max) = (parameter.min, parameter.max);
        let mut neutral = (f64::INFINITY, min);
        let start = self.start(parameter);
        for value in [0.0, 1.0, 2.0, start, min, max] {
            if (min..=max).contains(&value)
                && let Ok(measure) = self.measure(parameter.key, value)
                && measure < neutral.0 - 1e-12
            {
                neutral = (measure, value);
            }
        }
        if neutral.0 == f64::INFINITY {
            // The reason why it cannot be built.
            self.measure(parameter.key, min)?;
        }
        let neutral = neutral.1;
        let unit_size = if (start - neutral).abs() < 1e-12 {
            let step = 10.0 * parameter.step;
            if neutral + step <= max { step } else { -step }
        } else {
            start - neutral
        };
        let greatest = (if 0.0 < unit_size { max - neutral } else { min - neutral }) / unit_size;
        let (key, unit) = (parameter.key.to_owned(), parameter.unit);
        Ok(Knob { key, unit, neutral, unit_size, greatest })
    }

    /// Where a fit of a parameter starts: where the configured model has it, if it does.
    fn start(&self, parameter: &Parameter) -> f64 {
        let start = self.starts.iter().find(|(key, _)| *key == parameter.key);
        start.and_then(|(_, value)| value.as_float()).unwrap_or(parameter.starts[0])
    }

    fn value(&self, knob: &Knob, size: f64) -> f64 {
        knob.neutral + size * knob.unit_size
    }

    /// Standard errors that a gain must exceed.
    fn critical(&self) -> f64 {
        acceptance::critical_t(self.n_candidates, self.n_blocks)
    }

    fn run_campaign(
        &self,
        knob: &Knob,
        size: f64,
        seed: u64,
    ) -> Result<CampaignResult, PowerError> {
        if self.stop.is_set() {
            return Ok(CampaignResult { is_found: false, margin: f64::NAN, rmse: [f64::NAN; 2] });
        }
        let truth = self.with_effect(&knob.key, self.value(knob, size))?;
        let made = simulate::simulate(&truth, self.table, seed, Some(self.noise))?.to_table();
        let (effect, choices) = (self.question.effect, self.choices);
        match self.subject {
            Subject::Links => {
                let (study, _) = open::links(self.config, &made, choices)?;
                self.test_effect(&study.with_stop_flag(&self.stop), effect)
            }
            Subject::Robots => {
                let (study, _) = open::robots(self.config, &made, choices)?;
                self.test_effect(&study.with_stop_flag(&self.stop), effect)
            }
        }
    }

    /// Whether an effect is accepted on a campaign.
    fn test_effect<S: Study>(&self, study: &S, effect: &str) -> Result<CampaignResult, PowerError> {
        let term = extend::candidate(study, effect)?;
        let level = study.candidates()[term].level;
        let search = Search::new(study, &|_| {});
        let gain = search.gain(&[term], &[], level);
        let [before, after] =
            [&[][..], &[term]].map(|terms| Scores::mean(&search.held_out_scores(terms, level)));
        let floor = acceptance::least_share(&before, &before);
        let share_removed = |_| after.share_removed(&before);
        let verdict = acceptance::judge(&[gain], self.n_candidates, floor, share_removed)[0];
        let t = if 0.0 < gain.standard_error { gain.gain / gain.standard_error } else { 0.0 };
        Ok(CampaignResult {
            is_found: verdict.is_acceptable(),
            margin: t - self.critical(),
            rmse: [before.rmse, after.rmse],
        })
    }

    fn answer(&self, knob: &Knob, points: &[(f64, u64, Vec<CampaignResult>)]) -> Power {
        let tried = points.iter().map(|(size, n, outcomes)| {
            let mean = |k: usize| outcomes.iter().map(|o| o.rmse[k]).sum::<f64>() / *n as f64;
            Size {
                value: self.value(knob, *size),
                found: n_found(outcomes),
                campaigns: *n,
                rmse: [mean(0), mean(1)],
            }
        });
        let mut power = Power {
            schema: SCHEMA,
            effect: self.question.effect.to_owned(),
            parameter: knob.key.clone(),
            unit: knob.unit,
            neutral: knob.neutral,
            power: POWER,
            value: detectable_size(points).map(|size| self.value(knob, size)),
            sentence: String::new(),
            noise: self.noise,
            candidates: self.n_candidates,
            tried: tried.collect(),
            complete: !self.stop.is_set(),
            method: "simulation",
            error_unit: if self.subject == Subject::Links { "dB" } else { "m" },
        };
        power.sentence = answer::sentence(&power);
        power
    }
}

/// Keys of an effect that repeat a property of the configured radio.
fn configured_keys(from_model: &[(&str, FromModel)], model: &Model) -> Vec<(String, toml::Value)> {
    let value = |&(key, property): &(&str, FromModel)| {
        Some((key.to_owned(), toml::Value::Float(model.property(property)?)))
    };
    from_model.iter().filter_map(value).collect()
}

fn is_text(fixed: &Fixed, wanted: &str) -> bool {
    fixed.value().as_str() == Some(wanted)
}

/// Number of candidates that p-values are corrected for, and number of blocks at the level of an effect.
fn candidates_and_blocks<S: Study>(study: &S, effect: &str) -> Result<(usize, usize), PowerError> {
    let term = extend::candidate(study, effect)?;
    let candidates = study.candidates();
    let blocks = study.blocks(candidates[term].level);
    if !blocks.are_many() {
        return Err(PowerError::TooFew {
            effect: effect.to_owned(),
            n_blocks: blocks.n_blocks(),
            unit: blocks.unit,
            least: FEWEST_BLOCKS,
        });
    }
    let n = candidates.iter().filter(|candidate| candidate.is_tried()).count();
    Ok((n, blocks.n_blocks()))
}
