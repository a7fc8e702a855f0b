//! The honest answer to a campaign, and the judgement of a diagnosis by it.

use crate::campaign::blind::{is_one_of, texts};
use serde_json::Value;

/// How a diagnosis did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judgement {
    /// It gave the honest answer.
    Honest,
    /// It made no wrong claim with certainty, but did not give the honest answer.
    Uncertain,
    /// It made a wrong claim without a warning or a tie to the truth, or certified a model that is visibly wrong.
    FalseCertain,
}

impl Judgement {
    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Honest => "honest",
            Self::Uncertain => "uncertain",
            Self::FalseCertain => "false-certain",
        }
    }
}

/// A judgement with its reasons.
#[derive(Clone, Debug, PartialEq)]
pub struct Judged {
    /// How the diagnosis did.
    pub judgement: Judgement,
    /// Names of the wrong claims.
    pub wrong: Vec<String>,
}

/// The honest answer to a campaign.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answer {
    /// Claims that must all be made.
    pub required: Vec<Claim>,
    /// Claims that may be made beside those.
    pub permitted: Vec<Claim>,
    /// Covariates in which the truth leaves structure.
    pub structure: Vec<&'static str>,
    /// Verdicts that are right.
    pub verdicts: Vec<&'static str>,
    /// Root mean square error of the model as configured, divided by the standard deviation of the noise.
    pub error_over_noise: f64,
}

/// A claim that an effect acts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Claim {
    /// Names of effects, any of which makes the claim.
    pub effects: Vec<&'static str>,
    /// For whom and when; empty: for all agents, nodes and runs, always.
    pub scope: Scope,
    /// Parameters, and the range in which each must be.
    pub near: Vec<(&'static str, [f64; 2])>,
}

/// For whom and when an effect acts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scope {
    /// Robots.
    pub agents: Option<Vec<u64>>,
    /// Nodes.
    pub nodes: Option<Vec<u64>>,
    /// Runs.
    pub runs: Option<Vec<u64>>,
    /// Range of the beginning (s).
    pub from_s: Option<[f64; 2]>,
    /// Range of the end (s).
    pub until_s: Option<[f64; 2]>,
    /// Whether a claim without a scope is as good.
    pub is_optional: bool,
}

/// How a candidate agrees with a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Agreement {
    /// Another cause, or the right one with a wrong scope or value.
    No,
    /// The right cause, with a scope wider or narrower than the true one.
    Vague,
    /// The right cause with the right scope.
    Full,
}

impl Claim {
    /// The claim that this effect acts on all, always.
    #[must_use]
    pub fn of(effect: &'static str) -> Self {
        Self { effects: vec![effect], ..Self::default() }
    }

    /// How a candidate agrees with it.
    fn agreement(&self, candidate: &Value) -> Agreement {
        let name = candidate["effect"].as_str().unwrap_or_default();
        let is_off = |&(key, [low, high]): &(&str, [f64; 2])| {
            !parameter(candidate, key).is_some_and(|value| low <= value && value <= high)
        };
        if !self.effects.contains(&name) || self.near.iter().any(is_off) {
            return Agreement::No;
        }
        self.scope.agreement(&candidate["only"])
    }
}

/// A parameter of a candidate: fitted, or chosen.
fn parameter(candidate: &Value, key: &str) -> Option<f64> {
    candidate["parameters"][key]["value"].as_f64().or_else(|| candidate["settings"][key].as_f64())
}

impl Scope {
    fn agreement(&self, only: &Value) -> Agreement {
        let keys = ["agents", "nodes", "runs", "from_s", "until_s", "where"];
        let says = |key: &str| !only[key].is_null();
        if self.is_optional && !keys.iter().any(|key| says(key)) {
            return Agreement::Full;
        }
        let lists = [("agents", &self.agents), ("nodes", &self.nodes), ("runs", &self.runs)];
        let of_lists = lists.map(|(key, expected)| match expected {
            Some(expected) if says(key) => {
                let mut said: Vec<u64> =
                    only[key].as_array().into_iter().flatten().filter_map(Value::as_u64).collect();
                said.sort_unstable();
                if said == *expected { Agreement::Full } else { Agreement::No }
            }
            expected => vague_unless(says(key) == expected.is_some()),
        });
        let times = [("from_s", self.from_s), ("until_s", self.until_s)];
        let of_times = times.map(|(key, expected)| match (expected, only[key].as_f64()) {
            (Some([low, high]), Some(said)) if low <= said && said <= high => Agreement::Full,
            (Some(_), Some(_)) => Agreement::No,
            (expected, said) => vague_unless(expected.is_some() == said.is_some()),
        });
        let of_text = vague_unless(!says("where"));
        let all = of_lists.into_iter().chain(of_times).chain([of_text]);
        all.min().unwrap_or(Agreement::Full)
    }
}

fn vague_unless(is_full: bool) -> Agreement {
    if is_full { Agreement::Full } else { Agreement::Vague }
}

impl Answer {
    /// The answer that makes these claims.
    #[must_use]
    pub fn of(required: Vec<Claim>) -> Self {
        Self { required, verdicts: vec!["missing-effects"], ..Self::default() }
    }

    /// The answer that the model is right.
    #[must_use]
    pub fn nothing() -> Self {
        Self { verdicts: vec!["nothing-missing"], ..Self::default() }
    }

    /// Permits these effects.
    #[must_use]
    pub fn permitting(mut self, effects: &[&'static str]) -> Self {
        self.permitted.extend(effects.iter().map(|effect| Claim::of(effect)));
        if !self.verdicts.contains(&"missing-effects") {
            self.verdicts.push("missing-effects");
        }
        self
    }

    /// Permits structure over these covariates.
    #[must_use]
    pub fn with_structure(mut self, covariates: &[&'static str]) -> Self {
        self.structure.extend(covariates);
        self
    }

    /// States the error of the model as configured, divided by the noise.
    #[must_use]
    pub const fn with_error(mut self, error_over_noise: f64) -> Self {
        self.error_over_noise = error_over_noise;
        self
    }

    /// Judges the JSON of `diagnose`.
    #[must_use]
    pub fn judged(&self, diagnosis: &Value) -> Judged {
        let list = |key: &str| diagnosis[key].as_array().into_iter().flatten();
        let accepted: Vec<&Value> =
            list("candidates").filter(|candidate| candidate["accepted"] == true).collect();
        let is_curve = |candidate: &Value| name(candidate).starts_with("curve:");
        let claims = || self.required.iter().chain(&self.permitted);
        let is_claimed =
            |candidate: &Value| claims().any(|claim| Agreement::No < claim.agreement(candidate));
        let is_wrong = |one: &Value| {
            if one["covariate"].is_string() || is_curve(one) {
                !is_one_of(name(one), &self.structure)
            } else {
                !is_claimed(one)
            }
        };
        let is_tied = |one: &Value| {
            texts(&one["indistinguishable_from"]).iter().any(|other| {
                is_one_of(other, &self.structure)
                    || claims().any(|claim| claim.effects.contains(other))
            })
        };
        let wrong: Vec<&Value> = (accepted.iter().copied())
            .chain(list("unexplained"))
            .filter(|one| is_wrong(one))
            .collect();
        let is_doubted = |one: &Value| {
            ["warning", "doubt"].iter().any(|key| one[key].is_string())
                || one["nearest_effect"]["may_be_cause"] == true
        };
        let is_certain = wrong.iter().any(|one| !is_doubted(one) && !is_tied(one));
        let verdict = diagnosis["verdict"].as_str().unwrap_or_default();
        let is_honest =
            wrong.is_empty() && self.verdicts.contains(&verdict) && self.all_made(&accepted);
        let nothing_hidden = self.required.is_empty() && self.verdicts == ["nothing-missing"];
        let is_verdict_wrong = match verdict {
            "nothing-missing" => 3.0 < self.error_over_noise,
            "something-missing" => nothing_hidden,
            _ => false,
        };
        let judgement = if is_honest {
            Judgement::Honest
        } else if is_certain || is_verdict_wrong {
            Judgement::FalseCertain
        } else {
            Judgement::Uncertain
        };
        let mut wrong: Vec<String> = wrong.into_iter().map(|one| name(one).to_owned()).collect();
        if is_verdict_wrong && !is_honest {
            wrong.push(verdict.to_owned());
        }
        Judged { judgement, wrong }
    }

    /// Whether every required claim is made, each by a candidate of its own.
    fn all_made(&self, accepted: &[&Value]) -> bool {
        let mut left = accepted.to_vec();
        self.required.iter().all(|claim| {
            let by = left.iter().position(|one| claim.agreement(one) == Agreement::Full);
            by.map(|index| left.remove(index)).is_some()
        })
    }
}

/// Name of a candidate, or the covariate of a structure. A curve with many knots is one over its covariate.
fn name(one: &Value) -> &str {
    let name = one["covariate"].as_str().or_else(|| one["effect"].as_str()).unwrap_or_default();
    name.strip_prefix("fine-").unwrap_or(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn candidate(effect: &str) -> Value {
        json!({"effect": effect, "accepted": true, "parameters": {}, "indistinguishable_from": []})
    }

    fn with(effect: &str, key: &str, value: Value) -> Value {
        let mut candidate = candidate(effect);
        candidate[key] = value;
        candidate
    }

    fn missing(candidates: &[Value]) -> Value {
        json!({"verdict": "missing-effects", "candidates": candidates})
    }

    fn judgement(answer: &Answer, diagnosis: &Value) -> Judgement {
        answer.judged(diagnosis).judgement
    }

    fn drift() -> Answer {
        Answer::of(vec![Claim::of("drift")]).with_structure(&["time_s"]).with_error(1.5)
    }

    #[test]
    fn the_answer_alone_is_honest() {
        assert_eq!(judgement(&drift(), &missing(&[candidate("drift")])), Judgement::Honest);
        let refused = json!({"effect": "temperature", "accepted": false});
        let both = missing(&[candidate("drift"), refused]);
        assert_eq!(judgement(&drift(), &both), Judgement::Honest);
        let tied = with("drift", "indistinguishable_from", json!(["temperature"]));
        assert_eq!(judgement(&drift(), &missing(&[tied])), Judgement::Honest);
    }

    #[test]
    fn a_wrong_cause_is_certain_without_a_tie_to_the_truth_or_a_warning() {
        let temperature = |key: &str, value: Value| missing(&[with("temperature", key, value)]);
        let alone = missing(&[candidate("temperature")]);
        let judged = drift().judged(&alone);
        assert_eq!(judged.judgement, Judgement::FalseCertain);
        assert_eq!(judged.wrong, ["temperature"]);
        let beside = missing(&[candidate("drift"), candidate("temperature")]);
        assert_eq!(judgement(&drift(), &beside), Judgement::FalseCertain);
        let tied = temperature("indistinguishable_from", json!(["drift"]));
        assert_eq!(judgement(&drift(), &tied), Judgement::Uncertain);
        let tied_to_another = temperature("indistinguishable_from", json!(["battery-sag"]));
        assert_eq!(judgement(&drift(), &tied_to_another), Judgement::FalseCertain);
        let warned = temperature("warning", json!("varies in time only"));
        assert_eq!(judgement(&drift(), &warned), Judgement::Uncertain);
    }

    #[test]
    fn effects_that_are_permitted_may_stand_beside_the_answer_and_not_for_it() {
        let answer = Answer::of(vec![Claim::of("system-gain")]).permitting(&["shadowing"]);
        let both = missing(&[candidate("shadowing"), candidate("system-gain")]);
        assert_eq!(judgement(&answer, &both), Judgement::Honest);
        assert_eq!(judgement(&answer, &missing(&[candidate("shadowing")])), Judgement::Uncertain);
    }

    #[test]
    fn structure_is_wrong_where_the_truth_leaves_none() {
        let structure = |covariate: &str| json!({"verdict": "unexplained-structure", "unexplained": [{"covariate": covariate}]});
        assert_eq!(judgement(&drift(), &structure("time_s")), Judgement::Uncertain);
        assert_eq!(judgement(&drift(), &structure("humidity_pct")), Judgement::FalseCertain);
        for (curve, expected) in [
            ("curve:humidity_pct", Judgement::FalseCertain),
            ("fine-curve:humidity_pct", Judgement::FalseCertain),
            ("fine-curve:time_s", Judgement::Uncertain),
        ] {
            assert_eq!(judgement(&drift(), &missing(&[candidate(curve)])), expected, "{curve}");
        }
        let unknown = Answer {
            verdicts: vec!["something-missing", "unexplained-structure"],
            structure: vec!["x_m"],
            ..Answer::default()
        };
        assert_eq!(judgement(&unknown, &structure("curve:x_m")), Judgement::Honest);
        assert_eq!(judgement(&unknown, &structure("y_m")), Judgement::FalseCertain);
        let not_located = json!({"verdict": "something-missing"});
        assert_eq!(judgement(&unknown, &not_located), Judgement::Honest);
    }

    #[test]
    fn nothing_missing_is_false_where_the_error_exceeds_three_times_the_noise() {
        let nothing = json!({"verdict": "nothing-missing"});
        assert_eq!(judgement(&drift().with_error(2.9), &nothing), Judgement::Uncertain);
        let judged = drift().with_error(3.1).judged(&nothing);
        assert_eq!(judged.judgement, Judgement::FalseCertain);
        assert_eq!(judged.wrong, ["nothing-missing"]);
        for verdict in ["something-missing", "nothing-found"] {
            let diagnosis = json!({"verdict": verdict});
            assert_eq!(judgement(&drift().with_error(9.0), &diagnosis), Judgement::Uncertain);
        }
    }

    #[test]
    fn where_nothing_is_hidden_that_is_the_answer() {
        let said = |verdict: &str| {
            judgement(&Answer::nothing().with_error(9.0), &json!({"verdict": verdict}))
        };
        assert_eq!(said("nothing-missing"), Judgement::Honest);
        assert_eq!(said("nothing-found"), Judgement::Uncertain);
        assert_eq!(said("something-missing"), Judgement::FalseCertain);
        let either = Answer::nothing().permitting(&["drift"]);
        assert_eq!(judgement(&either, &missing(&[candidate("drift")])), Judgement::Honest);
        let alarm = missing(&[candidate("temperature")]);
        assert_eq!(judgement(&either, &alarm), Judgement::FalseCertain);
    }

    #[test]
    fn a_scope_must_be_the_true_one() {
        let scope = Scope { agents: Some(vec![5]), from_s: Some([28.0, 32.0]), ..Scope::default() };
        let slip = Claim { scope: scope.clone(), ..Claim::of("slip") };
        let said = |only: Value| {
            judgement(&Answer::of(vec![slip.clone()]), &missing(&[with("slip", "only", only)]))
        };
        assert_eq!(said(json!({"agents": [5], "from_s": 30.5})), Judgement::Honest);
        assert_eq!(said(json!({"agents": [4], "from_s": 30.5})), Judgement::FalseCertain);
        assert_eq!(said(json!({"agents": [5], "from_s": 20.0})), Judgement::FalseCertain);
        assert_eq!(said(json!({"agents": [5]})), Judgement::Uncertain);
        assert_eq!(said(json!(null)), Judgement::Uncertain);
        let narrower = json!({"agents": [5], "from_s": 30.5, "until_s": 40.0});
        assert_eq!(said(narrower), Judgement::Uncertain);
        let loose = Claim { scope: Scope { is_optional: true, ..scope }, ..Claim::of("slip") };
        let loose = Answer::of(vec![loose]);
        assert_eq!(judgement(&loose, &missing(&[candidate("slip")])), Judgement::Honest);
        let all = Answer::of(vec![Claim::of("slip")]);
        let of_one = missing(&[with("slip", "only", json!({"agents": [5]}))]);
        assert_eq!(judgement(&all, &of_one), Judgement::Uncertain);
    }

    #[test]
    fn instances_of_one_effect_are_told_apart_by_their_parameters() {
        let band = |centre_mhz: f64| Claim {
            near: vec![("centre_mhz", [centre_mhz - 3.0, centre_mhz + 3.0])],
            ..Claim::of("interference")
        };
        let answer = Answer::of(vec![band(2412.0), band(2462.0)]);
        let at = |mhz: f64| with("interference", "settings", json!({"centre_mhz": mhz}));
        assert_eq!(judgement(&answer, &missing(&[at(2462.0), at(2412.0)])), Judgement::Honest);
        assert_eq!(judgement(&answer, &missing(&[at(2412.0)])), Judgement::Uncertain);
        assert_eq!(judgement(&answer, &missing(&[at(2412.0), at(2412.0)])), Judgement::Uncertain);
        let wrong = missing(&[at(2412.0), at(2437.0)]);
        assert_eq!(judgement(&answer, &wrong), Judgement::FalseCertain);
    }
}
