//! Terms that may be added to a radio model, and their state in a fit.

use netsim::phy::effect::{Effect, Entry};
use proto::config::Default;
use proto::effect::Parameter;

/// What a term is made of.
#[derive(Clone, Debug)]
pub enum Spec {
    /// An effect of the catalogue.
    Effect(&'static Entry),
    /// A smooth curve over a covariate, in its column, linear between knots.
    Curve {
        /// The column among the covariates of the rows.
        column: usize,
        /// The knots, ascending.
        knots: Vec<f64>,
    },
    /// A random level per node.
    NodeOffset(&'static Entry),
    /// A random level per link and place.
    Shadowing(&'static Entry),
    /// A random level per link, channel and fine place.
    Multipath(&'static Entry),
}

impl Spec {
    /// The entry of the catalogue.
    #[must_use]
    pub fn entry(&self) -> Option<&'static Entry> {
        match self {
            Self::Effect(entry)
            | Self::NodeOffset(entry)
            | Self::Shadowing(entry)
            | Self::Multipath(entry) => Some(entry),
            Self::Curve { .. } => None,
        }
    }

    /// The parameters that a fit sets by their slopes. Random levels have none: their spread is found otherwise.
    #[must_use]
    pub fn parameters(&self) -> &'static [Parameter] {
        match self {
            Self::Effect(entry) => entry.fit.parameters,
            _ => &[],
        }
    }
}

/// A term in a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
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
            Default::Required | Default::Absent | Default::Table => continue,
        };
        table.insert(field.key.to_owned(), value);
    }
    table
}

impl State {
    /// The states from which a search for this term starts.
    #[must_use]
    pub fn starts(spec: &Spec) -> Vec<Self> {
        match spec {
            Spec::Curve { knots, .. } => {
                vec![Self { table: toml::Table::new(), values: vec![0.0; knots.len()] }]
            }
            Spec::NodeOffset(entry) | Spec::Shadowing(entry) | Spec::Multipath(entry) => {
                vec![Self { table: defaults(entry), values: Vec::new() }]
            }
            Spec::Effect(entry) => {
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

    /// The effect with these values.
    #[must_use]
    pub fn build(&self, spec: &Spec) -> Option<Box<dyn Effect>> {
        match spec {
            Spec::Effect(entry) => (entry.build)(&self.keys(spec), 0),
            _ => None,
        }
    }

    /// Its keys with the fitted values.
    #[must_use]
    pub fn keys(&self, spec: &Spec) -> toml::Table {
        let mut table = self.table.clone();
        for (parameter, &value) in spec.parameters().iter().zip(&self.values) {
            table.insert(parameter.key.to_owned(), toml::Value::Float(value));
        }
        table
    }
}

/// The share of each knot in a curve at `x`: two neighbours, linear between them. Beyond the ends the curve stays level.
#[must_use]
pub fn hat(knots: &[f64], x: f64) -> [(usize, f64); 2] {
    let last = knots.len() - 1;
    if x <= knots[0] {
        return [(0, 1.0), (0, 0.0)];
    }
    if knots[last] <= x {
        return [(last, 1.0), (last, 0.0)];
    }
    let above = knots.partition_point(|&knot| knot <= x);
    let part = (x - knots[above - 1]) / (knots[above] - knots[above - 1]);
    [(above - 1, 1.0 - part), (above, part)]
}
