//! The answer of a demo: what was hidden, what the diagnosis named, and what that does to the swarm.

use super::answers::DiagnosisAnswer;
use super::hidden::HiddenEffect;
use schemars::JsonSchema;
use serde::Serialize;

/// What the schema of this answer is called.
pub(super) const SCHEMA: &str = "demo/1";

/// What a demo found.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct DemoAnswer {
    /// The format of this answer.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: &'static str,
    /// The seed.
    pub seed: u64,
    /// Name of the hidden effect; null if none was hidden.
    pub hidden: Option<String>,
    /// The keys of its section of a configuration; null if none was hidden.
    #[schemars(with = "Option<serde_json::Map<String, serde_json::Value>>")]
    pub settings: Option<toml::Table>,
    /// How the verdict compares with what was hidden.
    pub outcome: Outcome,
    /// The verdict of the diagnosis.
    pub sentence: String,
    /// Names of the effects that were accepted.
    pub accepted: Vec<String>,
    /// Names of the effects that these data do not distinguish from an accepted one.
    pub indistinguishable: Vec<String>,
    /// Root mean squared error of the model (dB or m).
    pub error: Option<f64>,
    /// The same of the extended model; null if there is none.
    pub error_extended: Option<f64>,
    /// Numbers of the hidden effect that were estimated.
    pub estimates: Vec<Estimate>,
    /// The runs of the swarm.
    pub swarms: Vec<SwarmResult>,
    /// The folder of all files.
    pub folder: String,
    /// The page that tells it.
    pub page: String,
}

/// A number of the hidden effect, and its estimate.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Estimate {
    /// The key, with the place in a list.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// The hidden value.
    pub hidden: f64,
    /// The estimate.
    pub value: f64,
    /// Lower end of its 90 % interval.
    pub low: f64,
    /// Upper end of its 90 % interval.
    pub high: f64,
}

/// The swarm under one model.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SwarmResult {
    /// The configuration: `model`, `better` or `truth`.
    pub model: &'static str,
    /// Speed of the swarm's mean velocity along the leader's direction, mean over time (m/s).
    pub speed_along_leader_mps: f64,
    /// Magnitude of that mean velocity, mean over time (m/s): the BotNet paper's flock speed, which oscillation increases.
    pub flock_speed_mps: f64,
    /// Speed of the leader (m/s).
    pub leader_speed_mps: f64,
    /// Both speeds if no robot follows (m/s).
    pub flock_speed_floor_mps: f64,
    /// The share of frames that were delivered.
    pub delivery_ratio: f64,
}

/// How the verdict of the diagnosis compares with what was hidden.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The hidden effect was named, and nothing else.
    Named,
    /// The hidden effect was named as one of several that these data do not distinguish.
    OneOfSeveral,
    /// No effect was hidden, and none was named.
    NothingHidden,
    /// The diagnosis states that something is missing, and names no effect.
    Unnamed,
    /// An effect was hidden, and the diagnosis found nothing missing.
    Missed,
    /// The hidden effect was named, and another one that was not hidden.
    AmongOthers,
    /// Effects were named, and the hidden one is not among them.
    Wrong,
}

/// Verdicts by which nothing is missing.
const NOTHING: [&str; 2] = ["nothing-missing", "nothing-found"];

impl Outcome {
    /// Of a diagnosis.
    pub(super) fn of(diagnosis: &DiagnosisAnswer, hidden: Option<&HiddenEffect>) -> Self {
        let named: Vec<_> = diagnosis.accepted().collect();
        let finds_nothing = NOTHING.contains(&diagnosis.verdict.as_str());
        let Some(hidden) = hidden else {
            return match (named.is_empty(), finds_nothing) {
                (true, true) => Self::NothingHidden,
                _ => Self::Wrong,
            };
        };
        let is_hidden = |name: &String| *name == hidden.kind;
        match named.as_slice() {
            [] if finds_nothing => Self::Missed,
            [] => Self::Unnamed,
            [one] if is_hidden(&one.effect) && one.indistinguishable_from.is_empty() => Self::Named,
            [one] if is_hidden(&one.effect) || one.indistinguishable_from.iter().any(is_hidden) => {
                Self::OneOfSeveral
            }
            several if several.iter().any(|one| is_hidden(&one.effect)) => Self::AmongOthers,
            _ => Self::Wrong,
        }
    }

    /// Whether nothing that was named is false, and what was hidden is named.
    pub(super) fn is_right(self) -> bool {
        matches!(self, Self::Named | Self::OneOfSeveral | Self::NothingHidden)
    }
}

impl DemoAnswer {
    /// How the verdict compares with what was hidden, in words.
    #[must_use]
    pub fn outcome_sentence(&self) -> String {
        let hidden = self.hidden.as_deref().unwrap_or("none");
        let tied = self.indistinguishable.join(", ");
        match self.outcome {
            Outcome::Named => {
                format!("Right: the hidden effect was {hidden}, and the diagnosis named it.")
            }
            Outcome::OneOfSeveral => format!(
                "Right, but not unique: the hidden effect was {hidden}. The diagnosis named {}, and lists as indistinguishable on \
                 these data: {tied}.",
                self.accepted.join(", ")
            ),
            Outcome::NothingHidden => {
                "Right: no effect was hidden, and the diagnosis named none.".to_owned()
            }
            Outcome::Unnamed => format!(
                "Undecided: the hidden effect was {hidden}. The diagnosis states that something is missing, and names no effect."
            ),
            Outcome::Missed => {
                format!(
                    "Missed: the hidden effect was {hidden}. The diagnosis found nothing missing."
                )
            }
            Outcome::AmongOthers => format!(
                "Partly wrong: the hidden effect was {hidden}. The diagnosis named it, and another effect that was not hidden."
            ),
            Outcome::Wrong if self.hidden.is_none() => {
                "Wrong: no effect was hidden, and the diagnosis reports that something is missing."
                    .to_owned()
            }
            Outcome::Wrong => {
                format!("Wrong: the hidden effect was {hidden}. The diagnosis named another one.")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hidden::{draw, names};
    use serde_json::json;

    fn diagnosis(verdict: &str, accepted: &[(&str, &[&str])]) -> DiagnosisAnswer {
        let candidates: Vec<_> = accepted
            .iter()
            .map(|(effect, others)| {
                json!({
                    "effect": effect, "gain": 0.1, "standard_error": 0.01, "accepted": true,
                    "indistinguishable_from": others, "parameters": {}, "settings": null
                })
            })
            .collect();
        let answer = json!({
            "verdict": verdict, "sentence": "", "ladder": [], "candidates": candidates
        });
        serde_json::from_value(answer).unwrap()
    }

    #[test]
    fn a_verdict_is_right_only_if_it_names_what_was_hidden_and_nothing_else() {
        let names = names();
        let [name, other] = [&names[0], &names[1]].map(String::as_str);
        let hidden = draw(1, Some(name)).unwrap();
        let outcome = |verdict: &str, accepted: &[(&str, &[&str])], is_hidden: bool| {
            Outcome::of(&diagnosis(verdict, accepted), hidden.as_ref().filter(|_| is_hidden))
        };
        let found = "missing-effects";
        assert_eq!(outcome(found, &[(name, &[])], true), Outcome::Named);
        assert_eq!(outcome(found, &[(name, &[other])], true), Outcome::OneOfSeveral);
        assert_eq!(outcome(found, &[(other, &[name])], true), Outcome::OneOfSeveral);
        assert_eq!(outcome(found, &[(other, &[])], true), Outcome::Wrong);
        assert_eq!(outcome(found, &[(other, &[]), (name, &[])], true), Outcome::AmongOthers);
        assert_eq!(outcome("nothing-missing", &[], true), Outcome::Missed);
        assert_eq!(outcome("something-missing", &[], true), Outcome::Unnamed);
        assert_eq!(outcome("nothing-missing", &[], false), Outcome::NothingHidden);
        assert_eq!(outcome("something-missing", &[], false), Outcome::Wrong);
        assert_eq!(outcome(found, &[(name, &[])], false), Outcome::Wrong);
    }
}
