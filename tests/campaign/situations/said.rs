//! What a diagnosis claims: the only place that knows the form of its JSON.

use crate::campaign::blind::texts;
use serde_json::Value;

/// What a diagnosis claims.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Said {
    pub(super) verdict: Verdict,
    pub(super) claims: Vec<Claim>,
}

/// Its verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// Nothing is missing.
    Nothing,
    /// The data are too few to say, or the search did not end.
    CannotTell,
    /// The model is wrong, and the cause is unknown.
    Something,
    /// The causes are those named.
    Named,
}

/// One cause that it names.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Claim {
    /// The effect, the defect of the measurement, or the covariate of a structure.
    pub(super) name: String,
    /// Whether it is structure over a covariate, which no effect explains.
    pub(super) is_structure: bool,
    /// What the data cannot distinguish from it.
    pub(super) ties: Vec<String>,
    /// Whether it comes with a warning.
    pub(super) is_warned: bool,
    /// The keys to which it is limited, and its nodes, robots or runs.
    pub(super) limited_by: Vec<String>,
    pub(super) members: Vec<u64>,
    /// Its parameters: key, estimate and interval.
    pub(super) parameters: Vec<(String, [f64; 3])>,
}

impl Said {
    /// Reads the JSON of `diagnose`.
    pub(super) fn read(diagnosis: &Value) -> Self {
        let list = |key: &str| diagnosis[key].as_array().into_iter().flatten();
        let accepted = list("candidates")
            .filter(|candidate| candidate["accepted"] == true && candidate["doubt"].is_null());
        let mut claims: Vec<Claim> = accepted.map(Claim::read).collect();
        for structure in list("unexplained").map(Claim::read) {
            if !claims.iter().any(|claim| claim.is_structure && claim.name == structure.name) {
                claims.push(structure);
            }
        }
        let verdict = match diagnosis["verdict"].as_str() {
            _ if diagnosis["complete"] == false => Verdict::CannotTell,
            Some("nothing-missing") => Verdict::Nothing,
            Some("something-missing") => Verdict::Something,
            Some("missing-effects" | "missing-one-of" | "unexplained-structure") => Verdict::Named,
            _ => Verdict::CannotTell,
        };
        Self { verdict, claims }
    }
}

impl Claim {
    fn read(one: &Value) -> Self {
        let text = |key: &str| one[key].as_str().unwrap_or_default().to_owned();
        let effect = text("effect");
        let curve = effect.strip_prefix("curve:").or_else(|| effect.strip_prefix("fine-curve:"));
        let (name, is_structure) = match (one["covariate"].as_str(), curve) {
            (Some(covariate), _) | (None, Some(covariate)) => (covariate.to_owned(), true),
            (None, None) => (effect.clone(), false),
        };
        let only = one["only"].as_object();
        let limited_by = only
            .into_iter()
            .flatten()
            .filter(|(_, value)| !value.is_null())
            .map(|(k, _)| k.clone());
        let members = ["nodes", "agents", "runs"].iter().flat_map(|key| {
            one["only"][key].as_array().into_iter().flatten().filter_map(Value::as_u64)
        });
        let parameters = one["parameters"].as_object().into_iter().flatten();
        let nearest = &one["nearest_effect"];
        let cause = nearest["effect"].as_str().filter(|_| nearest["may_be_cause"] == true);
        let ties = texts(&one["indistinguishable_from"]).into_iter().chain(cause);
        Self {
            ties: ties.map(str::to_owned).collect(),
            is_warned: one["warning"].is_string(),
            limited_by: limited_by.collect(),
            members: members.collect(),
            parameters: parameters
                .filter_map(|(key, parameter)| {
                    let ends = ["value", "low", "high"].map(|end| parameter[end].as_f64());
                    let [Some(value), Some(low), Some(high)] = ends else { return None };
                    Some((key.clone(), [value, low, high]))
                })
                .collect(),
            name,
            is_structure,
        }
    }
}
