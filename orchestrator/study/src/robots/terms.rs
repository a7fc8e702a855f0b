//! What may be missing from a model of robots: effects of the catalogue, and curves over covariates.

use super::RobotStudy;
use super::curve::RobotCurve;
use super::motion::MeasuredTracks;
use crate::formula::{FORMULA, FormulaFitError, FormulaRequest, RowValues, set};
use crate::thresholds::{CURVE_KNOTS, FINE_CURVE_KNOTS, ROWS_PER_KNOT};
use crate::{CURVE, Candidate, FINE, PerTerm};
use measure::robots::RobotSample;
use proto::config::{Node, Value, check};
use proto::effect::{Body, Bounds, FromModel, Level, Need, Parameter, Role, Search, only};
use robotsim::catalogue::Catalogue;
use robotsim::dynamics::effect::{self, Entry};
use robotsim::dynamics::{Part, Shape};

/// A term that a fit may contain.
#[derive(Clone, Debug)]
pub(super) enum Term {
    /// An effect of the catalogue.
    Effect(EffectTerm),
    /// More noise of measured positions than the configuration says.
    Noise(toml::Table),
    /// A smooth curve over a covariate: what the window's motion is longer by, and where it drifts.
    Curve(RobotCurve),
}

/// An effect, and the numbers of it that are fitted.
#[derive(Clone, Debug)]
pub(super) struct EffectTerm {
    /// Its checked table, to be filled in.
    table: toml::Table,
    /// What is filled in.
    pub(super) parameters: Vec<Parameter>,
    /// Where searches start.
    pub(super) starts: Starts,
    /// What those starts are.
    search: Search,
    /// What the first parameter says of motion.
    pub(super) bounds: Option<Bounds>,
}

/// Where searches for an effect start.
#[derive(Clone, Debug)]
pub(super) enum Starts {
    /// At each of these.
    At(Vec<Vec<f64>>),
    /// At those of these discs of the plane (centre, radius, what speed is scaled by in it) that explain most of what is left.
    Discs(Vec<Vec<f64>>),
}

impl EffectTerm {
    /// Of an effect that does something to commands below a threshold and nothing else to any: which part of commands that is. What
    /// it does changes with the threshold only where that passes a command.
    pub(super) fn threshold_on(&self) -> Option<Part> {
        let part = if self.is_on_turn() { Part::Turn } else { Part::Speed };
        (self.search == Search::Thresholds { only_below: true }).then_some(part)
    }

    /// Whether it begins at a time that is fitted.
    pub(super) fn has_beginning(&self) -> bool {
        self.search == Search::Times
    }

    /// Whether it acts on the turn actuator.
    pub(super) fn is_on_turn(&self) -> bool {
        self.table.get("on").and_then(toml::Value::as_str) == Some("turn")
    }

    /// The same, limited to some robots or times: `limits` is the table `only` of the effect.
    #[must_use]
    pub(super) fn limited(mut self, limits: toml::Table) -> Self {
        self.table.insert(only::KEY.to_owned(), limits.into());
        self
    }

    /// The effect's table with these numbers.
    pub(super) fn table(&self, values: &[f64]) -> toml::Table {
        let mut table = self.table.clone();
        for (parameter, &value) in self.parameters.iter().zip(values) {
            set(&mut table, parameter.key, value);
        }
        table
    }
}

/// All that may be missing.
pub(super) fn all(
    tracks: &MeasuredTracks,
    dynamics: &toml::Table,
    is_noise_given: bool,
    catalogue: &Catalogue,
) -> (PerTerm<Candidate>, PerTerm<Term>) {
    let mut candidates = PerTerm::default();
    let mut terms = PerTerm::default();
    let shape = tracks.robots.shape;
    for entry in catalogue.effects.iter().filter(|entry| entry.variant.name != FORMULA) {
        let variants: &[&[_]] =
            if entry.fit.variants.is_empty() { &[&[]] } else { entry.fit.variants };
        for variant in variants {
            let keys: Vec<(&str, toml::Value)> =
                variant.iter().map(|(key, fixed)| (*key, fixed.value())).collect();
            let on = keys.iter().find(|(key, _)| *key == "on").and_then(|(_, v)| v.as_str());
            if on == Some("turn") && !shape.is_turning() {
                continue;
            }
            let name = match on {
                Some("turn") => format!("{} (turn)", entry.variant.name),
                _ => entry.variant.name.to_owned(),
            };
            let mut parameters: Vec<Parameter> = entry
                .fit
                .parameters
                .iter()
                .copied()
                .filter(|parameter| {
                    let of_body = entry.fit.of_body.iter().find(|(key, _)| *key == parameter.key);
                    of_body.is_none_or(|(_, body)| match body {
                        Body::Car => shape == Shape::Car,
                        Body::Unicycle => shape == Shape::Unicycle,
                        Body::Inertial => tracks.robots.commands.is_inertial(),
                    })
                })
                .collect();
            let times_s = (entry.fit.search == Search::Times).then(|| tracks.times_s());
            if let (Some(times_s), Some(time)) = (&times_s, parameters.last_mut()) {
                // What begins before all measurements is another effect.
                (time.min, time.max) = (times_s[0], times_s[times_s.len() - 1]);
            }
            let starts = starts(entry, on, (&parameters, times_s.as_deref()), tracks);
            candidates.push(Candidate {
                name,
                about: Some(&entry.about),
                is_spread: entry.fit.is_spread,
                level: entry.fit.level,
                parameters: entry.fit.parameters,
                n_parameters: parameters.len(),
                generalises: entry.fit.generalises.iter().map(|s| (*s).to_owned()).collect(),
                linear_in: entry.fit.linear_in,
                is_derived: false,
                untestable: untestable(entry, on, tracks, dynamics, is_noise_given),
                only: None,
                another_of: None,
                stands_in_for: None,
            });
            let keys = [&keys[..], &of_model(entry, dynamics)].concat();
            let table = template(entry, &keys, &parameters, catalogue);
            if entry.fit.role == Role::Noise {
                terms.push(Term::Noise(table));
                continue;
            }
            let search = entry.fit.search;
            let bounds = entry.fit.bounds;
            terms.push(Term::Effect(EffectTerm { table, parameters, starts, search, bounds }));
        }
    }
    if tracks.robots.commands.is_inertial() {
        // A curve drifts, and the velocity of these bodies, which is estimated, takes a drift up.
        return (candidates, terms);
    }
    let own = tracks.own_covariates();
    let is_known = |(name, _): &&(String, Vec<f64>)| name == "time_s" || !tracks.is_relative();
    for (name, values) in tracks.robots.covariates.iter().chain(own.iter().filter(is_known)) {
        let fine = name == "time_s" && FINE_CURVE_KNOTS * ROWS_PER_KNOT <= tracks.windows.len();
        let kinds =
            [("", CURVE_KNOTS), (FINE, FINE_CURVE_KNOTS)].into_iter().take(1 + usize::from(fine));
        for (prefix, n_knots) in kinds {
            let Some(curve) = RobotCurve::new(tracks, values.clone(), n_knots) else { continue };
            let coarse = format!("{CURVE}{name}");
            let mut stands_in_for = None;
            for curve in [curve.clone(), curve.with_constant()] {
                let term = candidates.push(Candidate {
                    name: format!("{prefix}{coarse}"),
                    about: None,
                    is_spread: false,
                    level: Level::Time,
                    parameters: &[],
                    n_parameters: curve.n_numbers(),
                    generalises: if prefix.is_empty() { Vec::new() } else { vec![coarse.clone()] },
                    linear_in: None,
                    is_derived: false,
                    untestable: None,
                    only: None,
                    another_of: None,
                    stands_in_for,
                });
                terms.push(Term::Curve(curve));
                stands_in_for = Some(term);
            }
        }
    }
    (candidates, terms)
}

impl RobotStudy {
    /// Adds a formula of the user's to what may be added to the model.
    ///
    /// # Errors
    ///
    /// The formula is wrong, or names what is neither a parameter nor known of these samples.
    pub fn add_formula(&mut self, wanted: &FormulaRequest) -> Result<(), FormulaFitError> {
        let catalogue = &self.model.catalogue;
        let Some(entry) = catalogue.effects.find(FORMULA) else { return Ok(()) };
        let covariates = &self.model.tracks.robots.covariates;
        let columns: Vec<&str> = covariates.iter().map(|(name, _)| name.as_str()).collect();
        let known = effect::NAMES.map(|(name, _)| name);
        let value = |name: &str, row: usize| self.value_of(name, row);
        let n_rows = self.model.tracks.robots.samples.len();
        let asked = wanted.checked(
            &effect::SPEC,
            &catalogue.lists(),
            entry.check,
            &known,
            &columns,
            &RowValues { n_rows, of: &value },
        )?;
        self.candidates.push(Candidate {
            name: FORMULA.to_owned(),
            about: Some(&entry.about),
            is_spread: entry.fit.is_spread,
            level: entry.fit.level,
            parameters: entry.fit.parameters,
            n_parameters: asked.parameters.len(),
            generalises: Vec::new(),
            linear_in: None,
            is_derived: false,
            untestable: None,
            only: None,
            another_of: None,
            stands_in_for: None,
        });
        self.model.terms.push(Term::Effect(EffectTerm {
            starts: Starts::At(vec![asked.starts()]),
            table: asked.table,
            parameters: asked.parameters,
            search: entry.fit.search,
            bounds: None,
        }));
        Ok(())
    }
}

impl RobotStudy {
    /// Keys of an effect that repeat a property of the configured robot, with their values.
    #[must_use]
    pub fn configured_keys(&self, entry: &Entry) -> Vec<(String, toml::Value)> {
        let keys = of_model(entry, &self.model.dynamics).into_iter();
        keys.map(|(key, value)| (key.to_owned(), value)).collect()
    }

    /// What a name of a formula is in a sample, velocities taken as commanded.
    fn value_of(&self, name: &str, row: usize) -> Option<f64> {
        let robots = &self.model.tracks.robots;
        let sample = &robots.samples[row];
        let [first, second, third] = sample.command;
        let velocity_mps = if robots.shape.is_turning() {
            let heading_rad = sample.heading_rad;
            [first * libm::cos(heading_rad), first * libm::sin(heading_rad), 0.0]
        } else {
            [first, second, third]
        };
        match name {
            "time_s" => Some(sample.time_s),
            "x_m" => Some(sample.position_m[0]),
            "y_m" => Some(sample.position_m[1]),
            "z_m" => Some(sample.position_m[2]),
            "vx_mps" => Some(velocity_mps[0]),
            "vy_mps" => Some(velocity_mps[1]),
            "vz_mps" => Some(velocity_mps[2]),
            "speed_mps" => Some(velocity_mps.iter().map(|part| part * part).sum::<f64>().sqrt()),
            "heading_rad" => Some(sample.heading_rad),
            _ => {
                let column = robots.covariates.iter().find(|(column, _)| column == name);
                column.map(|(_, values)| values[row])
            }
        }
    }
}

/// Why an effect cannot be tested on these data.
fn untestable(
    entry: &Entry,
    on: Option<&str>,
    tracks: &MeasuredTracks,
    dynamics: &toml::Table,
    is_noise_given: bool,
) -> Option<String> {
    if entry.fit.role == Role::Noise && !is_noise_given {
        return Some(
            "is part of every model: without robotsim.localization.sd_m its noise is estimated, its scale is aliased with \
             slip, and its delay with dead-time"
                .to_owned(),
        );
    }
    let configured = dynamics.get("effect").and_then(toml::Value::as_array);
    let is_there = configured.into_iter().flatten().any(|table| {
        let text = |key: &str| table.get(key).and_then(toml::Value::as_str);
        // Elsewhere, or at other times, one that is limited may still be missing.
        let is_limited = table.get(only::KEY).is_some();
        !is_limited
            && text("kind") == Some(entry.variant.name)
            && (on.is_none() || text("on") == on)
    });
    if is_there {
        return Some("is already in the model".to_owned());
    }
    if entry.fit.needs_one_frame && tracks.is_relative() {
        return Some(
            "requires positions in a common frame: here every campaign starts at exactly the same position, so positions \
             and directions are relative to the start of each campaign"
                .to_owned(),
        );
    }
    let shape = tracks.robots.shape;
    entry
        .about
        .needs
        .iter()
        .find(|need| match need {
            Need::TurningCommands => !shape.is_turning(),
            Need::Steering => shape != Shape::Car,
            Need::Terrain => !tracks.has_terrain(),
            Need::OtherAgents => !tracks.has_others(),
            Need::VelocityCommands => tracks.robots.commands.is_inertial(),
            Need::ThrustCommands => !tracks.robots.commands.is_inertial(),
            Need::Mass => mass_kg(dynamics).is_none(),
            Need::Column(name) => !tracks.robots.covariates.iter().any(|(known, _)| known == name),
            _ => false,
        })
        .map(|need| format!("needs {}", need.describe()))
}

/// The mass of a robot (kg), where the model says it.
fn mass_kg(dynamics: &toml::Table) -> Option<f64> {
    dynamics.get("mass_kg").and_then(toml::Value::as_float)
}

/// Keys of an effect that repeat a property of the configured robot. An effect is not tested where it needs one that is not known.
fn of_model(entry: &Entry, dynamics: &toml::Table) -> Vec<(&'static str, toml::Value)> {
    let value = |property: FromModel| match property {
        FromModel::Mass => mass_kg(dynamics),
        FromModel::PathLossExponent | FromModel::ReferenceDistance => None,
    };
    let keys = entry.fit.from_model.iter();
    keys.map(|&(key, property)| (key, value(property).unwrap_or(1.0).into())).collect()
}

/// The effect's table with all defaults, and the numbers to be filled in at some allowed value.
fn template(
    entry: &Entry,
    keys: &[(&str, toml::Value)],
    parameters: &[Parameter],
    catalogue: &Catalogue,
) -> toml::Table {
    let mut table = toml::Table::new();
    table.insert("kind".to_owned(), entry.variant.name.into());
    for parameter in parameters {
        set(&mut table, parameter.key, parameter.starts[0].max(parameter.min));
    }
    for (key, value) in keys {
        match value {
            toml::Value::Float(number) => set(&mut table, key, *number),
            other => {
                table.insert((*key).to_owned(), other.clone());
            }
        }
    }
    let node = Node { value: Value::from(&toml::Value::Table(table)), span: None };
    check(&node, "", &effect::SPEC, &catalogue.lists(), &mut Vec::new()).table
}

/// Where a search for an effect starts: the catalogue's values, or for thresholds those that these data can tell apart. `times_s`: of the
/// last parameter, if it is a time.
fn starts(
    entry: &Entry,
    on: Option<&str>,
    (parameters, times_s): (&[Parameter], Option<&[f64]>),
    tracks: &MeasuredTracks,
) -> Starts {
    let part = if on == Some("turn") { Part::Turn } else { Part::Speed };
    match entry.fit.search {
        Search::Thresholds { .. } => {
            return Starts::At(
                tracks.thresholds(part).into_iter().map(|value| vec![value]).collect(),
            );
        }
        Search::ThresholdsOfChanges if tracks.robots.commands.is_inertial() => {
            // The change that is commanded is the command itself.
            return Starts::At(
                tracks.thresholds(Part::Speed).into_iter().map(|value| vec![value]).collect(),
            );
        }
        Search::ThresholdsOfChanges => {
            return Starts::At(
                tracks.accelerations().into_iter().map(|value| vec![value]).collect(),
            );
        }
        Search::Discs => return Starts::Discs(tracks.discs()),
        Search::Starts | Search::Headings | Search::Places | Search::Nodes | Search::Times => {}
    }
    let last = parameters.len().saturating_sub(1);
    let mut products: Vec<Vec<f64>> = vec![Vec::new()];
    for (index, parameter) in parameters.iter().enumerate() {
        let values = times_s.filter(|_| index == last).unwrap_or(parameter.starts);
        products = products
            .iter()
            .flat_map(|begin| {
                values
                    .iter()
                    .map(move |&start| begin.iter().copied().chain([start]).collect::<Vec<f64>>())
            })
            .collect();
    }
    Starts::At(products)
}

impl MeasuredTracks {
    /// Covariates that every file has: time, and place.
    fn own_covariates(&self) -> [(String, Vec<f64>); 3] {
        let of =
            |value: &dyn Fn(&RobotSample) -> f64| self.robots.samples.iter().map(value).collect();
        [
            ("time_s".to_owned(), of(&|sample| sample.time_s)),
            ("x_m".to_owned(), of(&|sample| sample.position_m[0])),
            ("y_m".to_owned(), of(&|sample| sample.position_m[1])),
        ]
    }

    /// Discs of the plane in which ground may be rough: a grid of centres, several sizes.
    fn discs(&self) -> Vec<Vec<f64>> {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for sample in &self.robots.samples {
            for axis in 0..2 {
                low[axis] = low[axis].min(sample.position_m[axis]);
                high[axis] = high[axis].max(sample.position_m[axis]);
            }
        }
        let size = (high[0] - low[0]).max(high[1] - low[1]).max(0.1);
        let n = 15;
        let mut discs = Vec::new();
        for i in 0..n {
            for j in 0..n {
                for part in [0.04, 0.07, 0.11, 0.16, 0.23, 0.33] {
                    let centre = |axis: usize, k: i32| {
                        low[axis] + (f64::from(k) + 0.5) / f64::from(n) * (high[axis] - low[axis])
                    };
                    discs.push(vec![centre(0, i), centre(1, j), part * size, 1.0]);
                }
            }
        }
        discs
    }
}
