//! What a diagnosis of links or robots found: the answer that programs read as JSON, pages draw and people read as text.

use crate::defects::MeasurementDefect;
use crate::gate::Misfit;
use crate::identifiability::Identifiability;
use crate::json_number;
use indexmap::IndexMap;
use measure::account::DataAccount;
use proto::effect::CONSTANT;
use schemars::JsonSchema;
use serde::Serialize;
use std::fmt::Write as _;
use study::open::Subject;

/// What the schema of a diagnosis is called.
pub const SCHEMA: &str = "diagnose/2";
/// What it was called before ties stood in `missing`: its other keys are the same.
pub const SCHEMA_BEFORE: &str = "diagnose/1";

/// A diagnosis: which physical effects a model of links or robots lacks, by how well they predict data left out.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Diagnosis {
    /// The format of this answer.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: &'static str,
    /// What the measurements are of: links or robots.
    pub kind: Subject,
    /// The verdict.
    pub verdict: Verdict,
    /// The verdict in a sentence; in further ones what is possible beside it, and why that is not certain.
    pub sentence: String,
    /// Defects of the measurement as `measurement:` and their kind, then what is certainly missing, in the order in which it was
    /// found: the name of an effect, or `A or B` where these data cannot tell which of several it is.
    pub missing: Vec<String>,
    /// Of what is missing, the effects that these data cannot tell apart: the names of each set. Absent if there are none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub missing_one_of: Vec<Vec<String>>,
    /// Names of effects that may be missing and are not certain. Absent if there are none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub possible: Vec<String>,
    /// Why each effect of `possible` is not certain. Absent if there are none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub possible_because: Vec<String>,
    /// What the blocks are that are held out together, by which candidates are ordered and models compared: `blocks of time`, `places`.
    pub split: &'static str,
    /// Of links: defects of the measurement. All else is about the corrected measurements. Absent if there are none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub measurement_defects: Vec<MeasurementDefect>,
    /// What these data can tell, before any search. Absent where no level is predicted, or the search was stopped before.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub identifiability: Option<Identifiability>,
    /// Held-out scores of the model as configured, then with each effect or curve added, on the blocks of `split`.
    pub ladder: Vec<Rung>,
    /// Candidates tested, in the order of the catalogue.
    pub candidates: Vec<Tested>,
    /// The numbers of tied effects, each fitted in place of the accepted one. Absent if there are none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub rivals: Vec<Rival>,
    /// Structure that no effect of the catalogue explains.
    pub unexplained: Vec<Structure>,
    /// Whether the residuals were searched for structure: not of an incomplete search, nor of data in too few blocks.
    pub residuals_searched: bool,
    /// Constants by which the model is wrong with all that was accepted, the surest first.
    pub misfits: Vec<Misfit>,
    /// The greatest constant error that may be hidden in these data (90 % bound), in the unit of errors; null where that cannot be told.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub could_hide: f64,
    /// Where to measure next so that models can be distinguished that these data do not distinguish.
    pub next_measurement: Vec<NextMeasurement>,
    /// Whether the search came to its end. If not, a signal or a time budget ended it: the answer may still change, and what is in it
    /// depends on how fast the machine was.
    pub complete: bool,
    /// Why the data are too few to find anything, or to tell chance from what predicts rows left out better, if they are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub too_little: Option<String>,
    /// The round in which the search was interrupted, if it was; what was accepted before stands.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stopped_in_round: Option<usize>,
    /// Rows that were searched; of large files a subset of those used, spread evenly. Of robots a row is a window, and only a subset is counted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub searched: Option<usize>,
    /// The file of measurements, and how much of it was used.
    #[serde(flatten)]
    pub account: DataAccount,
    /// Unit of errors in words: dB, m, or pdr where only reception is predicted.
    #[serde(skip)]
    pub error_unit: &'static str,
}

/// The verdict of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Nothing that these data could show.
    NothingMissing,
    /// Effects of the catalogue, and nothing else.
    MissingEffects,
    /// Effects of the catalogue, of each of which these data tell only that it is one of several.
    MissingOneOf,
    /// There is structure that no effect of the catalogue explains.
    UnexplainedStructure,
    /// The model is wrong, and these data do not say why: readings are off by a constant, or there is structure that an effect of the
    /// catalogue may explain, though it is not certain.
    SomethingMissing,
    /// Nothing was found in data that are too few to tell that nothing is missing.
    NothingFound,
}

impl Verdict {
    /// The verdict on what is missing for certain, of which `one_of` are sets that these data do not tell apart; none: nothing is.
    pub(crate) fn of_missing(missing: &[String], one_of: &[Vec<String>]) -> Option<Self> {
        match missing.len() {
            0 => None,
            n if n == one_of.len() => Some(Self::MissingOneOf),
            _ => Some(Self::MissingEffects),
        }
    }
}

/// Held-out scores of a model.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Rung {
    /// `as configured`, or what this model has beyond the one before: `+ multipath`.
    pub model: String,
    /// Log predictive density (nats per row).
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub log_score: f64,
    /// Root mean squared error (dB, m or a share of frames).
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub rmse: f64,
    /// Of links: root mean square of readings less predicted mean levels (dB), of all received frames. `rmse` is about the mean reading
    /// of frames that are received, which the noise of the model shifts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rmse_received_db: Option<f64>,
    /// Of robots whose body turns: root mean squared error of the heading at the end of a window (rad). The log score
    /// includes it; `rmse` and `crps` are of positions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rmse_heading_rad: Option<f64>,
    /// Continuous ranked probability score (dB, m or a share of frames).
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub crps: f64,
    /// Log loss of reception (nats per frame); null where reception is unknown.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub reception_log_loss: f64,
}

/// A candidate, and the result of its test.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Tested {
    /// Its name: an effect of the catalogue, or a curve over a covariate (`curve:humidity_pct`).
    pub effect: String,
    /// Gain in held-out log score (nats per row): of an accepted one when it was added, of the others on top of all that was
    /// accepted.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub gain: f64,
    /// What the blocks are that were held out for this gain; `none` of defects of the measurement, which are tested on all rows.
    pub held_out: &'static str,
    /// Standard error of the gain, clustered over blocks (nats per row).
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub standard_error: f64,
    /// Probability of as great a gain by chance, before correction for the number of candidates.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub p_value: f64,
    /// Whether it was accepted.
    pub accepted: bool,
    /// Why it is not certain though it was accepted, if it is not: it is then possible, and not missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub doubt: Option<String>,
    /// Candidates that explain these data as well.
    pub indistinguishable_from: Vec<String>,
    /// To which rows it is limited, if it is: the keys of its table `only`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<serde_json::Map<String, serde_json::Value>>")]
    pub only: Option<toml::Table>,
    /// Of an effect that was not accepted: it moves rows by no more than this, in the unit of errors (root mean square over the rows; 90 %
    /// for all such effects together). Absent where the design does not tell it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub upper: Option<f64>,
    /// The size, likewise, that would have been found in 9 of 10 such campaigns.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub detectable: Option<f64>,
    /// Of levels of nodes, where there are only two: the difference between both directions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub directions: Option<Directions>,
    /// What to mind when its parameters are used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub warning: Option<String>,
    /// Its parameters as fitted to all rows, by key; empty unless it was accepted.
    pub parameters: IndexMap<String, Parameter>,
    /// Keys of its parameters of which these data say nothing; what `settings` has of them is no estimate.
    pub not_identifiable: Vec<String>,
    /// The keys of its section in a configuration; null of curves and of what was not accepted.
    #[schemars(with = "Option<serde_json::Map<String, serde_json::Value>>")]
    pub settings: Option<toml::Table>,
    /// Why these data cannot show it, if they cannot.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub untestable: Option<String>,
}

/// How much weaker one direction between two nodes is than the other. Whether the sender of the weaker direction or its receiver is the
/// cause cannot be told from two nodes.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Directions {
    /// The sender of the weaker direction.
    pub from: u32,
    /// Its receiver.
    pub to: u32,
    /// By how much it is weaker than the other (dB).
    pub weaker_by: Parameter,
}

/// An effect that explains these data as well as an accepted one, fitted in its place.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Rival {
    /// The accepted effect, with what limits it.
    pub in_place_of: String,
    /// The tied effect, with what limits it.
    pub effect: String,
    /// Its parameters as fitted to the rows that were searched, by key.
    pub parameters: IndexMap<String, Parameter>,
    /// Keys of its parameters of which these data say nothing.
    pub not_identifiable: Vec<String>,
}

/// A fitted parameter with its interval.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Parameter {
    /// The estimate, in `unit`.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub value: f64,
    /// Its unit; `1` or empty for a number without one.
    pub unit: String,
    /// Lower end of the 90 % interval.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub low: f64,
    /// Upper end of the 90 % interval.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub high: f64,
}

/// What a curve that stands for unexplained structure is added to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Affects {
    /// The share of frames that are lost.
    Losses,
    /// What is read: received signal strength, or positions.
    Readings,
}

/// Structure over a covariate that no effect of the catalogue explains.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Structure {
    /// The covariate: a column of the measurements, or a quantity computed from them.
    pub covariate: String,
    /// What depends on it; absent where a scan of the residuals found it rather than a fitted curve.
    #[serde(rename = "of", skip_serializing_if = "Option::is_none")]
    pub affects: Option<Affects>,
    /// The share of the squared error, or of the log loss of reception, that it explains.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub explained: f64,
    /// Probability of as much by chance.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub p_value: f64,
    /// A short formula for it, as `extend --formula` takes it; null if there is none.
    pub formula: Option<String>,
    /// What the formula is added to, as `extend --target` takes it.
    pub target: Option<String>,
    /// Of robots: a second formula, where there is structure along two directions.
    pub also: Option<AlsoAlong>,
    /// Held-out root mean squared error with it.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub rmse_after: Option<f64>,
    /// Other covariates that explain these data as well.
    pub indistinguishable_from: Vec<String>,
    /// The effect of the catalogue that explains most of the same, if one explains half of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nearest_effect: Option<NearestEffect>,
    /// Why its cause may follow another quantity: less is explained than is left.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub warning: Option<String>,
}

/// The effect of the catalogue that explains most of what structure over a covariate explains, or two that do so together.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct NearestEffect {
    /// Its name; `A with B` if only the two together may be the cause.
    pub effect: String,
    /// Its gain in held-out log score, as a share of that of the structure.
    pub share: f64,
    /// Whether it explains so much that it may be the cause.
    pub may_be_cause: bool,
    /// Why it (the first of two) was not accepted in place of the structure.
    pub why_not: String,
}

/// A formula along a second direction.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct AlsoAlong {
    /// The formula (m/s), as `extend --formula` takes it.
    pub formula: String,
    /// The direction, as `extend --target` takes it: `ahead`, `left`, `east`, `north` or `up`.
    pub target: String,
}

/// Where, or how, to measure so that two models can be distinguished.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct NextMeasurement {
    /// The two models: names of candidates, or two values of a parameter.
    pub between: [String; 2],
    /// The covariate by which rows are selected, or that is to vary otherwise.
    pub covariate: String,
    /// Least value of the covariate; this and the next three are null where conditions are needed that these data do not have.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub from: f64,
    /// Greatest value of the covariate.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub to: f64,
    /// Mean difference of the two predictions there.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub difference: f64,
    /// Mean difference of the two predictions elsewhere.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub elsewhere: f64,
    /// Unit of the differences.
    pub unit: &'static str,
    /// How many rows there distinguish the two with a power of 90 % (one-sided, 5 %), rounded up; absent where conditions are needed that
    /// these data do not have.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rows: Option<u64>,
    /// The same in words.
    pub sentence: String,
}

impl NextMeasurement {
    /// Advice to measure under conditions that these data do not have.
    pub(crate) fn of_new_conditions(
        between: [String; 2],
        covariate: String,
        unit: &'static str,
        sentence: String,
    ) -> Self {
        let [from, to, difference, elsewhere] = [f64::NAN; 4];
        Self { between, covariate, from, to, difference, elsewhere, unit, rows: None, sentence }
    }
}

impl Diagnosis {
    /// Candidates that were accepted, curves among them.
    pub fn accepted(&self) -> impl Iterator<Item = &Tested> {
        self.candidates.iter().filter(|candidate| candidate.accepted)
    }

    /// The rivals of an accepted effect, by its name with what limits it.
    pub fn rivals_of(&self, name: &str) -> impl Iterator<Item = &Rival> {
        self.rivals.iter().filter(move |rival| rival.in_place_of == name)
    }

    /// Effects that were not found and whose sizes are bounded, each with `upper` and `detectable`; the one that may be largest first. An
    /// effect that is named as one of several is not among them.
    #[must_use]
    pub fn not_found(&self) -> Vec<(&str, f64, f64)> {
        let is_named = |name: &String| self.missing_one_of.iter().flatten().any(|it| it == name);
        let others = self.candidates.iter().filter(|one| !is_named(&one.effect));
        let mut bounded: Vec<(&str, f64, f64)> = others
            .filter_map(|one| Some((one.effect.as_str(), one.upper?, one.detectable?)))
            .collect();
        bounded.sort_by(|a, b| b.1.total_cmp(&a.1));
        bounded
    }
}

impl Tested {
    /// Its name, with what limits it: `slip (only agents = [3])`.
    #[must_use]
    pub fn name(&self) -> String {
        let limited = self.only.as_ref().map(|only| study::limited_name(&self.effect, only));
        limited.unwrap_or_else(|| self.effect.clone())
    }
}

impl Structure {
    /// Whether it is one of losses rather than of readings.
    #[must_use]
    pub fn is_of_losses(&self) -> bool {
        self.affects == Some(Affects::Losses)
    }

    /// Whether another one is over the same covariate, of losses or of readings as this one.
    #[must_use]
    pub fn is_over_same(&self, other: &Self) -> bool {
        (&self.covariate, self.is_of_losses()) == (&other.covariate, other.is_of_losses())
    }

    /// Its formulas, each with what it is added to.
    pub fn formulas(&self) -> impl Iterator<Item = (&str, &str)> {
        let first = self.formula.as_deref().zip(self.target.as_deref());
        let second = self.also.as_ref().map(|also| (&*also.formula, &*also.target));
        first.into_iter().chain(second)
    }

    /// The share that it explains, 0 where that is unknown.
    #[must_use]
    pub fn share(&self) -> f64 {
        if self.explained.is_finite() { self.explained } else { 0.0 }
    }

    /// Whether its cause is unknown and depends on this covariate: no effect of the catalogue may be the cause, and there is no warning.
    #[must_use]
    pub fn is_certain(&self) -> bool {
        self.possible_cause().is_none() && self.warning.is_none()
    }

    /// The effect of the catalogue that may be its cause.
    #[must_use]
    pub fn possible_cause(&self) -> Option<&NearestEffect> {
        self.nearest_effect.as_ref().filter(|nearest| nearest.may_be_cause)
    }

    /// What follows which covariate, and the covariates that explain it as well, in words.
    #[must_use]
    pub fn named(&self) -> String {
        let covariate = self.covariate.as_str();
        let is_of_losses = self.is_of_losses();
        let mut named = match (is_of_losses, covariate) {
            (true, CONSTANT) => "a constant loss rate".to_owned(),
            (true, _) => format!("a loss rate that depends on {covariate}"),
            (false, _) => format!("structure over {covariate}"),
        };
        if !self.indistinguishable_from.is_empty() {
            let or = |other: &String| match (covariate, other.as_str()) {
                (CONSTANT, other) => format!("or depends on {other}"),
                (_, CONSTANT) if is_of_losses => "or is constant".to_owned(),
                (_, other) => format!("or {other}"),
            };
            let others: Vec<String> = self.indistinguishable_from.iter().map(or).collect();
            let _ = write!(named, " ({}: indistinguishable on these data)", others.join(", "));
        }
        named
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_verdict_says_whether_any_cause_is_told_from_its_rivals() {
        let of = |missing: &[&str], one_of: &[&[&str]]| {
            let texts =
                |names: &[&str]| -> Vec<String> { names.iter().map(|&it| it.to_owned()).collect() };
            let one_of: Vec<Vec<String>> = one_of.iter().map(|names| texts(names)).collect();
            Verdict::of_missing(&texts(missing), &one_of)
        };
        let tied: &[&[&str]] = &[&["slip", "wind"]];
        assert_eq!(of(&[], &[]), None);
        assert_eq!(of(&["slip or wind"], tied), Some(Verdict::MissingOneOf));
        assert_eq!(of(&["dead-time", "slip or wind"], tied), Some(Verdict::MissingEffects));
        assert_eq!(of(&["slip"], &[]), Some(Verdict::MissingEffects));
    }

    #[test]
    fn a_structure_is_named_by_what_it_is_of_and_what_it_follows() {
        let named = |affects: Affects, covariate: &str, others: &[&str]| {
            let structure = Structure {
                covariate: covariate.to_owned(),
                affects: Some(affects),
                explained: 0.1,
                p_value: 0.0,
                formula: None,
                target: None,
                also: None,
                rmse_after: None,
                indistinguishable_from: others.iter().map(|&other| other.to_owned()).collect(),
                nearest_effect: None,
                warning: None,
            };
            structure.named()
        };
        assert_eq!(named(Affects::Readings, "dust", &[]), "structure over dust");
        assert_eq!(
            named(Affects::Readings, "dust", &["time_s", "height"]),
            "structure over dust (or time_s, or height: indistinguishable on these data)"
        );
        assert_eq!(named(Affects::Losses, "dust", &[]), "a loss rate that depends on dust");
        assert_eq!(
            named(Affects::Losses, CONSTANT, &["dust", "height"]),
            "a constant loss rate (or depends on dust, or depends on height: indistinguishable on these data)"
        );
        assert_eq!(
            named(Affects::Losses, "dust", &["height", CONSTANT]),
            "a loss rate that depends on dust (or height, or is constant: indistinguishable on these data)"
        );
    }
}
