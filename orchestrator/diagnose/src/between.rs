//! What changed between two campaigns of one site or one fleet: which change of the model of the first is needed to predict the second.
//!
//! The rows of both campaigns are one study. What the first campaign alone accepts is fitted to both; a change is a term that acts on the
//! rows of the second only, beside the same term on all rows. So the uncertainty of the first takes part in every test.
//!
//! | module | what |
//! |---|---|
//! | `campaigns` | from two files to an answer |
//! | `answer` | from what was found to an answer |
//! | `search`, `choice`, `rivals` | the search for changes, which explanation is chosen, and other explanations of them |
//! | `pairs` | what stayed the same |
//! | `recordings` | recordings as replicates of a condition |
//! | `certainty` | which changes are certain |
//! | `contrast` | tests of differences between the campaigns |
//! | [`error_change`] | whether the second campaign is predicted worse than the first |
//! | `welch` | the test of the means of two samples |
//! | `rule` | the verdict |
//! | [`words`] | the answer, as people read it |

mod answer;
mod campaigns;
mod certainty;
mod choice;
mod contrast;
pub mod error_change;
mod pairs;
mod recordings;
mod rivals;
mod rule;
mod search;
mod welch;
pub mod words;

pub use campaigns::{BetweenError, BetweenRequest, between};

use crate::defects::MeasurementDefect;
use crate::diagnosis::Parameter;
use crate::gate::Misfit;
use crate::json_number;
use error_change::ErrorChange;
use indexmap::IndexMap;
use measure::account::DataAccount;
use schemars::JsonSchema;
use serde::Serialize;
use study::open::Subject;
use study::thresholds::TAIL_90;

/// What the schema of this answer is called.
pub const SCHEMA: &str = "diagnose-between/1";

/// What changed between two campaigns, A and B.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Between {
    /// The format of this answer.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: &'static str,
    /// What the measurements are of: links or robots.
    pub kind: Subject,
    /// The verdict.
    pub verdict: BetweenVerdict,
    /// The verdict in a sentence.
    pub sentence: String,
    /// What changed from A to B, in the order in which it was found.
    pub changed: Vec<Change>,
    /// Changes that are not certain: each says why (`doubt`), or what it is indistinguishable from.
    pub possible: Vec<Change>,
    /// What the configured model lacks in both campaigns alike.
    pub common: Vec<Common>,
    /// What stayed the same, and within which margin.
    pub same: Vec<Same>,
    /// Effects that were tested as changes, everywhere and at each robot or node, and not found.
    pub not_found: Vec<String>,
    /// Of links: defects of the measurement in A and in B. They may look like changes, so that no verdict is certain with one.
    pub measurement_defects: SidesOf<Vec<MeasurementDefect>>,
    /// Constants by which B is off beyond A that no change explains, the surest first.
    pub unexplained: Vec<Misfit>,
    /// How well the model of A predicts both campaigns; absent where the data are too few for a test.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<ErrorChange>,
    /// The greatest constant difference between A and B that may be hidden in these data (90 % bound), in the unit of errors; null
    /// where the data are too few.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub could_hide: f64,
    /// Covariates of which A and B have hardly a value in common: an effect of them is indistinguishable from a change.
    pub confounded: Vec<Confounded>,
    /// Rows that the campaigns are compared on: those within the common range of each other covariate.
    pub shared: SidesOf<Shared>,
    /// How many recordings (values of `run`) each campaign has. A change is certain only if each has four.
    pub recordings: SidesOf<usize>,
    /// When both were measured, in hours since midnight (UTC); absent where the start of one is unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_of_day_h: Option<Spans>,
    /// Columns that only one of the files has. They are not used.
    pub left_out_columns: Vec<String>,
    /// What to check before the answer is trusted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub caution: Option<String>,
    /// What A shows over the time since its start. It is not carried over to B.
    pub of_time_in_a: Vec<String>,
    /// Why the data are too few to find anything, if they are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub too_little: Option<String>,
    /// Whether the search came to its end. If not, the answer may still change.
    pub complete: bool,
    /// Rows of both campaigns that were searched, where these are a subset of those used, spread evenly. Of robots a row is a window.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub searched: Option<usize>,
    /// The file of the first campaign, and how much of it was used.
    pub a: DataAccount,
    /// The file of the second campaign, and how much of it was used.
    pub b: DataAccount,
    /// Unit of errors in words: dB or m.
    #[serde(skip)]
    pub error_unit: &'static str,
}

/// What two campaigns say of a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BetweenVerdict {
    /// Something changed, and it is identified.
    Changed,
    /// Nothing changed that these data could show.
    NothingChanged,
    /// B is off, or predicted worse than A, and no change of the model explains it.
    SomethingChanged,
    /// B differs, and a change is indistinguishable from an effect that acts in both campaigns, or from a defect of the measurement.
    CannotTell,
    /// Nothing was found, and the data are too few to show that nothing changed.
    NothingFound,
}

/// A change of the model from A to B.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Change {
    /// The effect of the catalogue that acts otherwise in B.
    pub effect: String,
    /// To which robots or nodes the change is limited, if it is: the keys of its table `only`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<serde_json::Map<String, serde_json::Value>>")]
    pub only: Option<toml::Table>,
    /// Its parameters in both campaigns, by key.
    pub parameters: IndexMap<String, Changed>,
    /// Gain in held-out log score from the change (nats per row of both campaigns).
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub gain: f64,
    /// Standard error of the gain, clustered over blocks (nats per row).
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub standard_error: f64,
    /// Probability of as great a difference by chance, times the number of tests.
    pub p_value: f64,
    /// Changes, and effects in both campaigns, that explain these data as well.
    pub indistinguishable_from: Vec<String>,
    /// Explanations that were fitted in its place and predict held-out rows significantly worse.
    pub ruled_out: Vec<String>,
    /// Why it is not certain; absent where it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub doubt: Option<String>,
    /// What to mind when its parameters are used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub warning: Option<String>,
    /// The keys of its section in a configuration of B; null where it is absent from B.
    #[schemars(with = "Option<serde_json::Map<String, serde_json::Value>>")]
    pub settings: Option<toml::Table>,
}

/// A parameter in both campaigns.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Changed {
    /// Its unit; empty for a number without.
    pub unit: String,
    /// In A; null where the model of A lacks the effect.
    pub a: Option<Parameter>,
    /// In B.
    pub b: Parameter,
    /// B less A, with its 90 % interval; null where the model of A lacks the effect.
    pub difference: Option<Parameter>,
}

/// An effect that the configured model lacks in both campaigns.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Common {
    /// Its name: an effect of the catalogue, or a curve over a covariate.
    pub effect: String,
    /// To which robots or nodes it is limited, if it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<serde_json::Map<String, serde_json::Value>>")]
    pub only: Option<toml::Table>,
    /// Its parameters as fitted to both campaigns, by key.
    pub parameters: IndexMap<String, Parameter>,
    /// Whether A alone shows it; otherwise both campaigns together do.
    pub found_in_a: bool,
}

/// Something that stayed the same.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Same {
    /// What: `readings`, or an effect and its parameter: `path-loss-exponent: exponent`.
    pub what: String,
    /// B less A, with its 90 % interval.
    pub difference: Parameter,
    /// The greatest difference, to either side, that the interval has in it.
    #[serde(serialize_with = "json_number::serialize")]
    #[schemars(with = "Option<f64>")]
    pub within: f64,
}

/// The same of both campaigns.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct SidesOf<T> {
    /// Of A.
    pub a: T,
    /// Of B.
    pub b: T,
}

/// Rows of a campaign that were measured under conditions which the other has, too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Shared {
    /// How many.
    pub rows: usize,
    /// Of how many.
    pub of: usize,
}

/// A covariate of which the campaigns have hardly a value in common.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Confounded {
    /// Its name.
    pub covariate: String,
    /// Its values.
    pub spans: Spans,
}

/// Where most values of a covariate lie in both campaigns: from the 5 % to the 95 % quantile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Spans {
    /// In A.
    pub a: [f64; 2],
    /// In B.
    pub b: [f64; 2],
}

impl Spans {
    /// Of the values in both campaigns; none where either has none.
    #[must_use]
    pub fn of(a: &[f64], b: &[f64]) -> Option<Self> {
        Self::within(a, b, TAIL_90)
    }

    /// From one quantile to the other, each with this share of the values beyond.
    #[must_use]
    pub(crate) fn within(a: &[f64], b: &[f64], tail: f64) -> Option<Self> {
        let span = |values: &[f64]| {
            let mut known: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
            known.sort_by(f64::total_cmp);
            let at = |share: f64| known[(share * (known.len() - 1) as f64).round() as usize];
            (!known.is_empty()).then(|| [at(tail), at(1.0 - tail)])
        };
        Some(Self { a: span(a)?, b: span(b)? })
    }

    /// Whether they have no value in common.
    #[must_use]
    pub fn are_apart(&self) -> bool {
        self.a[1] < self.b[0] || self.b[1] < self.a[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_are_apart_where_most_values_are() {
        let of = |first: f64| {
            let values =
                |first: f64| -> Vec<f64> { (0..101).map(|k| first + f64::from(k)).collect() };
            Spans::of(&values(0.0), &values(first)).unwrap()
        };
        assert_eq!(of(200.0), Spans { a: [5.0, 95.0], b: [205.0, 295.0] });
        assert!(of(91.0).are_apart() && of(-91.0).are_apart());
        assert!(!of(90.0).are_apart() && !of(-90.0).are_apart());
        assert_eq!(Spans::of(&[f64::NAN], &[1.0]), None);
    }
}
