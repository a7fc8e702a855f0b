//! What may be missing: every effect of the catalogue, and a smooth curve over every covariate.

use super::{LinkCurve, TermSpec};
use crate::formula::{FORMULA, FormulaFitError, FormulaRequest, RowValues};
use crate::links::LinkStudy;
use crate::links::rows::ModelledLinks;
use crate::links::rows::{covariates, testable};
use crate::thresholds::{CURVE_KNOTS, FINE_CURVE_KNOTS, ROWS_PER_KNOT};
use crate::{Candidate, PerTerm, knots};
use physics::catalogue::Catalogue;
use physics::effect;
use proto::config::Registry;
use proto::effect::{CONSTANT, Level, Need, Role};
use std::sync::Arc;

/// Covariates that follow from time and places and may be a cause by themselves.
const DERIVED: [&str; 4] = [TIME, CHANNEL, "midpoint_x_m", "midpoint_y_m"];
/// Its curve has a knot at every channel. Where readings are given, nothing of the catalogue follows the channel, and losses have one, too.
const CHANNEL: &str = "frequency_mhz";
/// Beside what is given, losses have a curve only over this.
const TIME: &str = "time_s";
/// Why what does not touch reception cannot be tested where readings are given.
const READING_GIVEN: &str = "acts on RSSI readings only, which --given-rssi takes as given";

/// Every term that may be added.
pub(in crate::links) fn specs(
    rows: &ModelledLinks,
    effects: &Registry<effect::Entry>,
) -> PerTerm<TermSpec> {
    let effects = effects.iter().filter(|entry| entry.variant.name != FORMULA).map(|entry| {
        match entry.fit.role {
            Role::RandomPerNode => TermSpec::NodeOffset(entry),
            Role::RandomPerLink => TermSpec::Shadowing(entry),
            Role::RandomPerChannel => TermSpec::Multipath(entry),
            Role::RandomInTime => TermSpec::Drift(entry),
            Role::RandomPerLinkInTime => TermSpec::LinkDrift(entry),
            Role::Effect | Role::Noise => TermSpec::Effect(entry),
        }
    });
    let of_columns =
        rows.links.covariates.iter().cloned().map(|(name, values)| (name, values, false));
    let measured = &rows.links.rows;
    let places = [("tx", 0), ("tx", 1), ("rx", 0), ("rx", 1)].map(|(end, axis)| {
        let place_of =
            |row: &measure::links::LinkRow| if end == "tx" { row.tx_m } else { row.rx_m };
        let values: Vec<f64> = measured.iter().map(|row| place_of(row)[axis]).collect();
        (format!("{end}_{}_m", ["x", "y"][axis]), values, true)
    });
    let derived = covariates::by_name(rows)
        .into_iter()
        .filter(|(name, _)| DERIVED.contains(&name.as_str()))
        .map(|(name, values)| (name, values, true));
    let covariates: Vec<LinkCurve> = of_columns
        .chain(derived)
        .chain(places)
        .flat_map(|(name, values, is_derived)| {
            let is_fine = name == TIME && FINE_CURVE_KNOTS * ROWS_PER_KNOT <= rows.len();
            let values: Arc<[f64]> = Arc::from(values);
            [false, true]
                .into_iter()
                .filter(move |fine| is_fine || !fine)
                .filter_map(move |fine| curve(rows, &name, &values, is_derived, fine))
        })
        .collect();
    let of_losses = covariates
        .iter()
        .chain([&constant(rows)])
        .filter(|curve| {
            !curve.is_derived
                || curve.covariate == TIME && !curve.is_fine
                || curve.covariate == CHANNEL && rows.links.readings.is_given
        })
        .map(|curve| TermSpec::Curve(LinkCurve { is_loss: true, ..curve.clone() }))
        .filter(|_| rows.links.readings.has_losses())
        .collect::<Vec<_>>();
    let of_readings = covariates.iter().cloned().map(TermSpec::Curve);
    let of_readings = of_readings.filter(|_| !rows.links.readings.is_given);
    effects.chain(of_readings).chain(of_losses).collect()
}

impl LinkStudy {
    /// Adds a formula of the user's to what may be added to the model.
    ///
    /// # Errors
    ///
    /// The formula is wrong, or names what is neither a parameter nor known of these rows.
    pub fn add_formula(&mut self, wanted: &FormulaRequest) -> Result<(), FormulaFitError> {
        let Some(entry) = self.catalogue.effects.find(FORMULA) else { return Ok(()) };
        let columns = self.rows.links.covariates.iter().map(|(name, _)| name.as_str());
        // Of a column of both ends, its name without the end is their mean.
        let columns: Vec<&str> = columns
            .flat_map(|name| {
                let of_both = name.strip_prefix("tx_").or(name.strip_prefix("rx_"));
                [Some(name), of_both]
            })
            .flatten()
            .collect();
        let known = effect::formula::NAMES.map(|(name, _)| name);
        let value = |name: &str, row: usize| self.value_of(name, row);
        let values = RowValues { n_rows: self.rows.len(), of: &value };
        let asked = wanted.checked(
            &effect::SPEC,
            &self.catalogue.lists(),
            entry.check,
            &known,
            &columns,
            &values,
        )?;
        let spec = TermSpec::Formula(entry, asked);
        self.candidates.push(candidate(&spec, &self.rows, &self.catalogue));
        self.specs.push(spec);
        Ok(())
    }

    /// What a name of a formula is in a row.
    fn value_of(&self, name: &str, row: usize) -> Option<f64> {
        if let Some((_, read)) = effect::formula::NAMES.iter().find(|(known, _)| *known == name) {
            return self.rows.link(row, read);
        }
        let column = |name: &str| {
            let mut covariates = self.rows.links.covariates.iter();
            covariates.find(|(column, _)| column == name).map(|(_, values)| values[row])
        };
        let ends = ["tx_", "rx_"].map(|end| column(&format!("{end}{name}")));
        column(name).or_else(|| match ends {
            [Some(sender), Some(receiver)] => Some(0.5 * (sender + receiver)),
            [sender, receiver] => sender.or(receiver),
        })
    }
}

/// How a term stands among the others.
pub(in crate::links) fn candidate(
    spec: &TermSpec,
    rows: &ModelledLinks,
    catalogue: &Catalogue,
) -> Candidate {
    match spec {
        TermSpec::Curve(curve) => Candidate {
            name: curve.name(),
            about: None,
            is_spread: false,
            level: level_of(rows, curve),
            parameters: &[],
            n_parameters: curve.knots.len(),
            generalises: curve.generalises(&catalogue.effects),
            linear_in: None,
            is_derived: curve.is_derived,
            untestable: None,
            only: None,
            another_of: None,
            stands_in_for: None,
        },
        _ => {
            let entry = spec.entry().expect("everything but a curve is in the catalogue");
            let lacking: Vec<String> = entry
                .about
                .needs
                .iter()
                .filter(|need| !testable::has(rows, **need))
                .map(|need: &Need| need.describe())
                .collect();
            Candidate {
                name: entry.variant.name.to_owned(),
                about: Some(&entry.about),
                is_spread: entry.fit.is_spread,
                level: entry.fit.level,
                parameters: entry.fit.parameters,
                n_parameters: match spec {
                    TermSpec::Formula(_, asked) => asked.parameters.len(),
                    _ => entry.fit.parameters.len(),
                },
                generalises: entry.fit.generalises.iter().map(|name| (*name).to_owned()).collect(),
                linear_in: entry.fit.linear_in,
                is_derived: false,
                untestable: if rows.links.readings.is_given && !decides_reception(spec) {
                    Some(READING_GIVEN.to_owned())
                } else {
                    (!lacking.is_empty()).then(|| format!("needs {}", lacking.join(", ")))
                },
                only: None,
                another_of: None,
                stands_in_for: None,
            }
        }
    }
}

/// Whether a term says which frames pass at a level.
fn decides_reception(spec: &TermSpec) -> bool {
    match spec {
        TermSpec::Formula(_, asked) => ["loss", "noise"]
            .map(Some)
            .contains(&asked.table.get("target").and_then(toml::Value::as_str)),
        _ => spec.entry().is_none_or(|entry| entry.about.needs.contains(&Need::Losses)),
    }
}

/// At which level a curve is judged: what follows from places, on places left out.
fn level_of(rows: &ModelledLinks, curve: &LinkCurve) -> Level {
    if curve.is_derived && ![TIME, CHANNEL].contains(&curve.covariate.as_str()) {
        return Level::Place;
    }
    testable::level_of(rows, &curve.values)
}

/// The same in every row: of losses, those that are alike everywhere, which every other curve of losses has in it.
fn constant(rows: &ModelledLinks) -> LinkCurve {
    LinkCurve {
        covariate: CONSTANT.to_owned(),
        values: Arc::from(vec![0.0; rows.len()]),
        knots: vec![0.0],
        is_loss: false,
        is_derived: false,
        is_fine: false,
    }
}

/// A curve over a covariate with knots at its quantiles, many of a fine one; none where too few values are known or differ.
fn curve(
    rows: &ModelledLinks,
    covariate: &str,
    values: &Arc<[f64]>,
    is_derived: bool,
    is_fine: bool,
) -> Option<LinkCurve> {
    let mut known: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    known.sort_by(f64::total_cmp);
    if known.len() < rows.len() / 2 || known.is_empty() {
        return None;
    }
    // Each channel has a knot of its own: between two channels there is nothing to interpolate.
    let knots = if covariate == CHANNEL {
        known.dedup();
        known
    } else {
        knots::at_quantiles(&known, if is_fine { FINE_CURVE_KNOTS } else { CURVE_KNOTS })
    };
    (2 <= knots.len()).then(|| LinkCurve {
        covariate: covariate.to_owned(),
        values: values.clone(),
        knots,
        is_loss: false,
        is_derived,
        is_fine,
    })
}
