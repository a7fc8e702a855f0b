//! Terms that may be added to a radio model, and their state in a fit.

pub(super) mod active;
pub mod basis;
pub(super) mod candidates;
mod limited_effects;

use crate::formula::{FormulaCandidate, set};
use crate::links::rows::Contribution;
use crate::{CURVE, FINE, LOSS_CURVE, knots};
use physics::effect::{Effect, Entry, build_one};
use proto::config::{Default, Registry};
use proto::effect::{CONSTANT, Parameter, Search, only};
use std::sync::Arc;

/// The kind of a term, with what is needed to build it.
#[derive(Clone, Debug)]
pub enum TermSpec {
    /// An effect of the catalogue.
    Effect(&'static Entry),
    /// An effect of the catalogue on some links only: its table `only`.
    Limited(&'static Entry, toml::Table),
    /// A smooth curve over a covariate.
    Curve(LinkCurve),
    /// A random level per node.
    NodeOffset(&'static Entry),
    /// A random level per link and place.
    Shadowing(&'static Entry),
    /// A random level per link, channel and fine place.
    Multipath(&'static Entry),
    /// A random level of all links that changes in time.
    Drift(&'static Entry),
    /// A random level per link that changes in time.
    LinkDrift(&'static Entry),
    /// A formula of the user's.
    Formula(&'static Entry, FormulaCandidate),
}

impl TermSpec {
    /// The entry of the catalogue.
    #[must_use]
    pub fn entry(&self) -> Option<&'static Entry> {
        match self {
            Self::Effect(entry)
            | Self::Limited(entry, _)
            | Self::NodeOffset(entry)
            | Self::Shadowing(entry)
            | Self::Multipath(entry)
            | Self::Drift(entry)
            | Self::LinkDrift(entry)
            | Self::Formula(entry, _) => Some(entry),
            Self::Curve(_) => None,
        }
    }

    /// Where a search for its parameters starts.
    #[must_use]
    pub fn search(&self) -> Search {
        self.entry().map_or(Search::Starts, |entry| entry.fit.search)
    }

    /// Whether it is a random level: of nodes, links or times.
    #[must_use]
    pub fn is_random(&self) -> bool {
        match self {
            Self::NodeOffset(_)
            | Self::Shadowing(_)
            | Self::Multipath(_)
            | Self::Drift(_)
            | Self::LinkDrift(_) => true,
            Self::Effect(_) | Self::Limited(..) | Self::Curve(_) | Self::Formula(..) => false,
        }
    }

    /// The parameters that a fit sets by their slopes. Random levels have none: their spread is found otherwise.
    #[must_use]
    pub fn parameters(&self) -> &[Parameter] {
        match self {
            Self::Effect(entry) | Self::Limited(entry, _) => entry.fit.parameters,
            Self::Formula(_, asked) => &asked.parameters,
            _ => &[],
        }
    }
}

/// A linear spline over a covariate: of the mean power (dB), or of the loss rate.
#[derive(Clone, Debug)]
pub struct LinkCurve {
    /// Name of the covariate that the curve is over.
    pub covariate: String,
    /// Its value in every row; NaN where it is unknown: there the curve adds nothing.
    pub values: Arc<[f64]>,
    /// The knots, ascending.
    pub knots: Vec<f64>,
    /// It says how many frames are lost, not how strong they are.
    pub is_loss: bool,
    /// The covariate follows from time and places.
    pub is_derived: bool,
    /// It has many knots.
    pub is_fine: bool,
}

/// A curve of losses starts here: at none it could not fall.
const SMALL_LOSS: f64 = 0.02;
/// No curve loses more.
const MOST_LOST: f64 = 0.95;

impl LinkCurve {
    /// The name of the candidate.
    #[must_use]
    pub fn name(&self) -> String {
        let kind = if self.is_loss { LOSS_CURVE } else { CURVE };
        let fine = if self.is_fine { FINE } else { "" };
        format!("{fine}{kind}{}", self.covariate)
    }

    /// Names of what it has in it: the curve with few knots, of losses those that are the same everywhere, and effects that are
    /// linear in its covariate.
    #[must_use]
    pub fn generalises(&self, effects: &Registry<Entry>) -> Vec<String> {
        let is_constant = self.covariate == CONSTANT;
        let is_mean = !self.is_loss && !is_constant;
        let is_linear =
            |entry: &&Entry| is_mean && entry.fit.linear_in == Some(self.covariate.as_str());
        let linear = effects.iter().filter(is_linear).map(|entry| entry.variant.name.to_owned());
        let coarse = self.is_fine.then(|| Self { is_fine: false, ..self.clone() }.name());
        let constant = (self.is_loss && !is_constant).then(|| format!("{LOSS_CURVE}{CONSTANT}"));
        coarse.into_iter().chain(constant).chain(linear).collect()
    }

    /// The shares of the knots in a row.
    #[must_use]
    pub fn shares(&self, row: usize) -> [(usize, f64); 2] {
        let x = self.values[row];
        if x.is_nan() { [(0, 0.0); 2] } else { knots::shares(&self.knots, x) }
    }

    /// Contribution to a row with these values at the knots.
    #[must_use]
    pub fn contribution(&self, values: &[f64], row: usize) -> Contribution {
        let value = self.shares(row).iter().map(|&(k, part)| part * values[k]).sum::<f64>();
        if self.is_loss {
            let ln_survival = libm::log(1.0 - value.clamp(0.0, MOST_LOST));
            Contribution { ln_survival, ..Contribution::default() }
        } else {
            Contribution::of_power(value)
        }
    }
}

/// A term in a fit, with the present values of its parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct TermState {
    /// Keys that are not fitted by slopes.
    pub table: toml::Table,
    /// Values of the parameters, or of a curve at its knots.
    pub values: Vec<f64>,
}

/// The keys of an effect with their defaults.
fn defaults(entry: &Entry) -> toml::Table {
    let mut table = toml::Table::new();
    for field in entry.variant.fields {
        let value = match field.default {
            Default::Bool(truth) => toml::Value::Boolean(truth),
            Default::Integer(number) => toml::Value::Integer(number),
            Default::Number(number) => toml::Value::Float(number),
            Default::Text(text) => toml::Value::String(text.to_owned()),
            Default::Required | Default::RequiredOrNone | Default::Absent | Default::Table => {
                continue;
            }
        };
        table.insert(field.key.to_owned(), value);
    }
    table
}

impl TermState {
    /// The states from which a search for this term starts.
    #[must_use]
    pub fn starts(spec: &TermSpec) -> Vec<Self> {
        match spec {
            TermSpec::Curve(curve) => {
                let start = if curve.is_loss { SMALL_LOSS } else { 0.0 };
                vec![Self { table: toml::Table::new(), values: vec![start; curve.knots.len()] }]
            }
            TermSpec::NodeOffset(entry)
            | TermSpec::Shadowing(entry)
            | TermSpec::Multipath(entry)
            | TermSpec::Drift(entry)
            | TermSpec::LinkDrift(entry) => {
                vec![Self { table: defaults(entry), values: Vec::new() }]
            }
            TermSpec::Formula(_, asked) => {
                vec![Self { table: asked.table.clone(), values: asked.starts() }]
            }
            TermSpec::Limited(entry, limits) => Self::starts(&TermSpec::Effect(entry))
                .into_iter()
                .map(|state| state.limited(limits.clone()))
                .collect(),
            TermSpec::Effect(entry) => {
                let mut tables = vec![defaults(entry)];
                if !entry.fit.variants.is_empty() {
                    tables = entry
                        .fit
                        .variants
                        .iter()
                        .map(|keys| {
                            let mut table = defaults(entry);
                            for (key, value) in *keys {
                                table.insert((*key).to_owned(), value.value());
                            }
                            table
                        })
                        .collect();
                }
                let mut values: Vec<Vec<f64>> = vec![Vec::new()];
                for parameter in entry.fit.parameters {
                    values = values
                        .into_iter()
                        .flat_map(|before| {
                            parameter
                                .starts
                                .iter()
                                .map(move |&start| before.iter().copied().chain([start]).collect())
                        })
                        .collect();
                }
                tables
                    .into_iter()
                    .flat_map(|table| {
                        values.iter().map(move |values| Self {
                            table: table.clone(),
                            values: values.clone(),
                        })
                    })
                    .collect()
            }
        }
    }

    /// The same, limited to some links: `limits` is the table `only` of the effect.
    #[must_use]
    pub fn limited(mut self, limits: toml::Table) -> Self {
        self.table.insert(only::KEY.to_owned(), limits.into());
        self
    }

    /// The effect with these values. `None`: the term is none of the catalogue, or its limits are wrong.
    #[must_use]
    pub fn build(&self, spec: &TermSpec) -> Option<Box<dyn Effect>> {
        match spec {
            TermSpec::Effect(entry) | TermSpec::Limited(entry, _) | TermSpec::Formula(entry, _) => {
                build_one(entry, &self.keys(spec), 0)
            }
            _ => None,
        }
    }

    /// Its keys with the fitted values.
    #[must_use]
    pub fn keys(&self, spec: &TermSpec) -> toml::Table {
        let mut table = self.table.clone();
        for (parameter, &value) in spec.parameters().iter().zip(&self.values) {
            set(&mut table, parameter.key, value);
        }
        table
    }
}
