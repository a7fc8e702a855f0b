//! The truth of a campaign, and the judgement of a diagnosis by it.

use super::reference::{DETECTABLE_NATS, TIED_NATS};
use super::said::{Claim, Said, Verdict};
use serde_json::Value;

/// What is hidden in a campaign.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Truth {
    /// What acts.
    pub causes: Vec<Cause>,
    /// Patterns of names that are consequences of what acts: neither right nor wrong.
    pub permitted: Vec<&'static str>,
    /// Information of the campaign about all causes together (nats).
    pub nats: f64,
    /// Whether the campaign is too small to exclude anything.
    pub is_tiny: bool,
}

/// Something that acts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cause {
    /// Patterns of its name, `*` for any text; empty: it is in no catalogue.
    pub names: Vec<&'static str>,
    /// Covariates in which it leaves structure.
    pub covariates: Vec<&'static str>,
    /// Nodes, robots or runs on which it acts; empty: all.
    pub members: Vec<u64>,
    /// Whether a claim without members is as good.
    pub is_optional: bool,
    /// Whether it takes frames away, and changes no reading.
    pub is_of_losses: bool,
    /// Whether it acts for a time or under a condition only.
    pub is_limited: bool,
    /// Parameters of the first name, with their values.
    pub sizes: Vec<(&'static str, f64)>,
    /// Names that the reference cannot distinguish from it in this campaign.
    pub ties: Vec<&'static str>,
    /// Information of the campaign about it beyond the other causes (nats).
    pub nats: f64,
    /// Part of that information that its parameters take up (nats).
    pub spent_nats: f64,
}

/// How a diagnosis did.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Outcome {
    /// All that the campaign shows is named with the right size, and what it cannot show is said to be uncertain.
    Right,
    /// A part is named, or with a wrong size or limit, and nothing false.
    Half,
    /// It does not say, and says so.
    CannotTell,
    /// It names the cause only as an alternative, a consequence of it, or something false with a warning.
    Hedged,
    /// It makes a false claim without a warning.
    FalselyCertain,
}

impl Outcome {
    /// All outcomes.
    pub const ALL: [Self; 5] =
        [Self::Right, Self::Half, Self::CannotTell, Self::Hedged, Self::FalselyCertain];

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Half => "half",
            Self::CannotTell => "cannot tell",
            Self::Hedged => "hedged",
            Self::FalselyCertain => "falsely certain",
        }
    }
}

/// A judgement with its reasons.
#[derive(Clone, Debug, PartialEq)]
pub struct Judged {
    /// How the diagnosis did.
    pub outcome: Outcome,
    /// Its false claims.
    pub wrong: Vec<String>,
    /// For each parameter of a right name: whether the 90 % interval covers the truth.
    pub covered: Vec<bool>,
}

/// How a claim agrees with the truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Agreement {
    False,
    /// False, with a warning; or permitted.
    Hedged,
    /// The cause is among the alternatives that it lists, or is a catalogue's and called structure.
    Alternative,
    /// The cause with a wrong size or limit, or without the ties that it has.
    Vague,
    Full,
}

impl Cause {
    pub(super) fn of(name: &'static str) -> Self {
        Self { names: vec![name], ..Self::default() }
    }

    /// A cause of no catalogue, seen as structure over any of these covariates.
    pub(super) fn unknown(covariates: &[&'static str]) -> Self {
        Self { covariates: covariates.to_vec(), ..Self::default() }
    }

    pub(super) fn or(mut self, names: &[&'static str]) -> Self {
        self.names.extend(names);
        self
    }

    pub(super) fn seen_over(mut self, covariates: &[&'static str]) -> Self {
        self.covariates.extend(covariates);
        self
    }

    pub(super) fn sized(mut self, key: &'static str, value: f64) -> Self {
        self.sizes.push((key, value));
        self
    }

    /// Limits it to nodes, robots or runs.
    pub(super) fn only(mut self, members: &[usize]) -> Self {
        self.members = members.iter().map(|&member| member as u64).collect();
        self.members.sort_unstable();
        self
    }

    /// Limits it to nodes, robots or runs that need not be named.
    pub(super) fn mostly(self, members: &[usize]) -> Self {
        Self { is_optional: true, ..self.only(members) }
    }

    pub(super) const fn for_a_time(mut self) -> Self {
        self.is_limited = true;
        self
    }

    /// States how many values the cause draws: each takes up the information that one parameter takes.
    pub(super) fn drawing(mut self, n_values: usize) -> Self {
        self.spent_nats = n_values as f64;
        self
    }

    fn is_named(&self, name: &str) -> bool {
        self.names.iter().any(|pattern| matches(pattern, name))
    }

    /// How a claim agrees with this cause. `members`: those of all claims of its name.
    fn agreement(&self, claim: &Claim, members: &[u64]) -> Agreement {
        let is_over = |name: &str| {
            let name = name.rsplit_once("curve:").map_or(name, |(_, covariate)| covariate);
            self.covariates.iter().any(|one| matches(one, name))
        };
        let says_ties = self.ties.is_empty()
            || self.ties.iter().any(|tie| claim.ties.iter().any(|said| matches(tie, said)));
        if claim.is_structure {
            return if is_over(&claim.name) {
                match (self.names.is_empty(), says_ties) {
                    (true, true) => Agreement::Full,
                    (true, false) => Agreement::Vague,
                    (false, _) => Agreement::Alternative,
                }
            } else if claim.ties.iter().any(|tie| is_over(tie) || self.is_named(tie)) {
                Agreement::Alternative
            } else {
                Agreement::False
            };
        }
        if !self.is_named(&claim.name) {
            let is_this =
                |tie: &String| self.is_named(tie) || (self.names.is_empty() && is_over(tie));
            let is_listed = claim.ties.iter().any(is_this);
            let is_tied = is_listed && self.ties.iter().any(|tie| matches(tie, &claim.name));
            return match (is_tied, is_listed) {
                (true, _) => Agreement::Full,
                (_, true) => Agreement::Alternative,
                _ => Agreement::False,
            };
        }
        let is_of_measurement = claim.name.starts_with("measurement:");
        let elsewhere = members.iter().any(|member| !self.members.contains(member));
        if !self.members.is_empty() && elsewhere && !is_of_measurement {
            return Agreement::False;
        }
        let is_list = |key: &String| ["nodes", "agents", "runs"].contains(&key.as_str());
        let has_limit = claim.limited_by.iter().any(|key| !is_list(key));
        let has_members = members == self.members || (self.is_optional && members.is_empty());
        let is_vague = !is_of_measurement && (!has_members || has_limit != self.is_limited);
        if is_vague || !says_ties || self.is_size_wrong(claim) {
            Agreement::Vague
        } else {
            Agreement::Full
        }
    }

    /// The intervals of the claim's parameters, with the truth.
    fn intervals<'a>(&'a self, claim: &'a Claim) -> impl Iterator<Item = ([f64; 3], f64)> + 'a {
        let is_first = self.names.first().is_some_and(|pattern| matches(pattern, &claim.name));
        self.sizes.iter().filter(move |_| is_first).filter_map(|&(key, truth)| {
            let (_, interval) = claim.parameters.iter().find(|(said, _)| said == key)?;
            Some((*interval, truth))
        })
    }

    /// Whether a size is further off than its interval, of twice the width, and than a tenth.
    fn is_size_wrong(&self, claim: &Claim) -> bool {
        self.intervals(claim).any(|([value, low, high], truth)| {
            let is_within =
                value - 2.0 * (value - low) <= truth && truth <= value + 2.0 * (high - value);
            !is_within && 0.1 * truth.abs() < (value - truth).abs()
        })
    }
}

/// Whether a name fits a pattern.
fn matches(pattern: &str, name: &str) -> bool {
    let mut parts = pattern.split('*');
    let Some(mut left) = name.strip_prefix(parts.next().unwrap_or_default()) else { return false };
    for part in parts {
        let Some(at) = left.find(part) else { return false };
        left = &left[at + part.len()..];
    }
    left.is_empty() || pattern.ends_with('*')
}

impl Truth {
    /// Permits names as consequences.
    pub(super) fn permitting(mut self, patterns: &[&'static str]) -> Self {
        self.permitted.extend(patterns);
        self
    }

    /// Judges the JSON of `diagnose`.
    #[must_use]
    pub fn judged(&self, diagnosis: &Value) -> Judged {
        let said = Said::read(diagnosis);
        let members_of = |name: &str| {
            let named = said.claims.iter().filter(|claim| claim.name == name);
            let mut members: Vec<u64> = named.flat_map(|claim| claim.members.clone()).collect();
            members.sort_unstable();
            members.dedup();
            members
        };
        let agreement = |cause: &Cause, claim: &Claim| {
            let agreement = cause.agreement(claim, &members_of(&claim.name));
            // A name of a cause that these data cannot show is no success.
            if cause.nats < TIED_NATS { agreement.min(Agreement::Vague) } else { agreement }
        };
        let is_permitted =
            |claim: &Claim| self.permitted.iter().any(|one| matches(one, &claim.name));
        let are_permitted = said.claims.iter().all(is_permitted);
        let best = |claim: &Claim| {
            let of_causes = self.causes.iter().map(|cause| agreement(cause, claim)).max();
            let hedged = if is_permitted(claim) || claim.is_warned {
                Agreement::Hedged
            } else {
                Agreement::False
            };
            of_causes.map_or(hedged, |best| best.max(hedged))
        };
        let mut wrong: Vec<String> = said
            .claims
            .iter()
            .filter(|claim| best(claim) == Agreement::False)
            .map(|claim| claim.name.clone())
            .collect();
        let is_shown = DETECTABLE_NATS <= self.nats;
        match said.verdict {
            Verdict::Nothing if is_shown => wrong.push("nothing-missing".to_owned()),
            Verdict::Something if self.nats < TIED_NATS => {
                wrong.push("something-missing".to_owned());
            }
            _ => (),
        }
        let shown: Vec<&Cause> =
            self.causes.iter().filter(|cause| DETECTABLE_NATS <= cause.nats).collect();
        let found = |cause: &&Cause| {
            said.claims
                .iter()
                .map(|claim| agreement(cause, claim))
                .max()
                .unwrap_or(Agreement::False)
        };
        let reached: Vec<Agreement> = shown.iter().map(found).collect();
        let any = |least| said.claims.iter().map(best).any(|agreement| least <= agreement);
        let outcome = if !wrong.is_empty() {
            Outcome::FalselyCertain
        } else if shown.is_empty() {
            // Nothing, or too little to be seen; or causes that can be shown together only.
            match said.verdict {
                Verdict::Nothing if self.nats < TIED_NATS => Outcome::Right,
                Verdict::Named if self.nats < TIED_NATS && are_permitted => Outcome::Right,
                Verdict::CannotTell if TIED_NATS <= self.nats || self.is_tiny => Outcome::Right,
                Verdict::Named if any(Agreement::Full) => Outcome::Right,
                Verdict::Named if any(Agreement::Vague) => Outcome::Half,
                Verdict::Named => Outcome::Hedged,
                _ => Outcome::CannotTell,
            }
        } else if reached.iter().all(|agreement| *agreement == Agreement::Full) {
            Outcome::Right
        } else if any(Agreement::Vague) {
            Outcome::Half
        } else if said.claims.is_empty() {
            Outcome::CannotTell
        } else {
            Outcome::Hedged
        };
        let covered = said.claims.iter().flat_map(|claim| {
            self.causes.iter().filter(|cause| cause.is_named(&claim.name)).flat_map(|cause| {
                cause.intervals(claim).map(|([_, low, high], truth)| low <= truth && truth <= high)
            })
        });
        Judged { outcome, wrong, covered: covered.collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn accepted(effect: &str) -> Value {
        json!({"effect": effect, "accepted": true, "parameters": {}, "indistinguishable_from": []})
    }

    fn with(mut candidate: Value, key: &str, value: Value) -> Value {
        candidate[key] = value;
        candidate
    }

    fn named(candidates: &[Value]) -> Value {
        json!({"verdict": "missing-effects", "candidates": candidates, "complete": true})
    }

    fn of(causes: Vec<Cause>) -> Truth {
        let causes: Vec<Cause> =
            causes.into_iter().map(|cause| Cause { nats: 100.0, ..cause }).collect();
        let nats = 100.0 * causes.len() as f64;
        Truth { causes, nats, ..Truth::default() }
    }

    fn outcome(truth: &Truth, diagnosis: &Value) -> Outcome {
        truth.judged(diagnosis).outcome
    }

    #[test]
    fn a_null_is_right_only_if_nothing_is_missing() {
        let truth = of(Vec::new());
        let verdict = |verdict: &str| json!({"verdict": verdict, "complete": true});
        assert_eq!(outcome(&truth, &verdict("nothing-missing")), Outcome::Right);
        assert_eq!(outcome(&truth, &verdict("nothing-found")), Outcome::CannotTell);
        assert_eq!(outcome(&truth, &verdict("something-missing")), Outcome::FalselyCertain);
        assert_eq!(outcome(&truth, &named(&[accepted("drift")])), Outcome::FalselyCertain);
        let warned = with(accepted("drift"), "warning", json!("few blocks"));
        assert_eq!(outcome(&truth, &named(&[warned])), Outcome::Hedged);
        let structure = json!({"verdict": "unexplained-structure", "complete": true,
            "unexplained": [{"covariate": "time_s"}]});
        assert_eq!(truth.judged(&structure).wrong, ["time_s"]);
    }

    #[test]
    fn a_cause_is_right_with_its_size_half_without_and_false_is_what_denies_it() {
        let truth = of(vec![Cause::of("temperature").sized("db_per_c", -0.3)]);
        let sized = |value: f64, half: f64| {
            let interval = json!({"value": value, "low": value - half, "high": value + half});
            named(&[with(accepted("temperature"), "parameters", json!({"db_per_c": interval}))])
        };
        assert_eq!(outcome(&truth, &sized(-0.32, 0.01)), Outcome::Right);
        assert_eq!(truth.judged(&sized(-0.32, 0.01)).covered, [false]);
        assert_eq!(outcome(&truth, &sized(-0.5, 0.11)), Outcome::Right);
        assert_eq!(outcome(&truth, &sized(-0.5, 0.05)), Outcome::Half);
        let nothing = json!({"verdict": "nothing-missing", "complete": true});
        assert_eq!(truth.judged(&nothing).wrong, ["nothing-missing"]);
        let cut = json!({"verdict": "nothing-missing", "complete": false});
        assert_eq!(outcome(&truth, &cut), Outcome::CannotTell);
        let both = named(&[accepted("temperature"), accepted("shadowing")]);
        assert_eq!(outcome(&truth, &both), Outcome::FalselyCertain);
    }

    #[test]
    fn one_of_two_causes_is_half() {
        let truth = of(vec![Cause::of("slip"), Cause::of("wind")]);
        assert_eq!(outcome(&truth, &named(&[accepted("slip")])), Outcome::Half);
        assert_eq!(outcome(&truth, &named(&[accepted("slip"), accepted("wind")])), Outcome::Right);
    }

    #[test]
    fn a_tie_must_be_said() {
        let tied = Cause { ties: vec!["thrust-scale"], ..Cause::of("payload-mass") };
        let truth = of(vec![tied]);
        let saying = |name: &str, other: &str| {
            named(&[with(accepted(name), "indistinguishable_from", json!([other]))])
        };
        assert_eq!(outcome(&truth, &saying("payload-mass", "thrust-scale")), Outcome::Right);
        assert_eq!(outcome(&truth, &saying("thrust-scale", "payload-mass")), Outcome::Right);
        assert_eq!(outcome(&truth, &named(&[accepted("payload-mass")])), Outcome::Half);
        assert_eq!(outcome(&truth, &named(&[accepted("thrust-scale")])), Outcome::FalselyCertain);
        // Where the data can distinguish them, the wrong one with the right one as its alternative is no success.
        let truth = of(vec![Cause::of("payload-mass")]);
        assert_eq!(outcome(&truth, &saying("thrust-scale", "payload-mass")), Outcome::Hedged);
    }

    #[test]
    fn members_may_be_claimed_one_by_one() {
        let truth = of(vec![Cause::of("speed-limit").only(&[4, 1])]);
        let only = |agents: Value| with(accepted("speed-limit"), "only", json!({"agents": agents}));
        assert_eq!(outcome(&truth, &named(&[only(json!([1, 4]))])), Outcome::Right);
        assert_eq!(outcome(&truth, &named(&[only(json!([1])), only(json!([4]))])), Outcome::Right);
        assert_eq!(outcome(&truth, &named(&[only(json!([1]))])), Outcome::Half);
        assert_eq!(outcome(&truth, &named(&[only(json!([2]))])), Outcome::FalselyCertain);
        assert_eq!(outcome(&truth, &named(&[accepted("speed-limit")])), Outcome::Half);
    }

    #[test]
    fn structure_is_right_of_what_is_in_no_catalogue_and_hedged_of_what_is() {
        let structure = |covariate: &str| {
            json!({"verdict": "unexplained-structure", "complete": true,
                "unexplained": [{"covariate": covariate, "indistinguishable_from": []}]})
        };
        let unknown = of(vec![Cause::unknown(&["y_m", "*midpoint*"])]);
        assert_eq!(outcome(&unknown, &structure("y_m")), Outcome::Right);
        assert_eq!(outcome(&unknown, &structure("midpoint_x_m")), Outcome::Right);
        assert_eq!(outcome(&unknown, &structure("x_m")), Outcome::FalselyCertain);
        let drift = of(vec![Cause::of("drift").seen_over(&["time_s"])]);
        assert_eq!(outcome(&drift, &structure("time_s")), Outcome::Hedged);
        let permitting = unknown.permitting(&["wind"]);
        assert_eq!(outcome(&permitting, &named(&[accepted("wind")])), Outcome::Hedged);
    }

    #[test]
    fn what_is_too_small_to_be_seen_need_not_be_named() {
        let small = Cause { nats: 8.0, ..Cause::of("drift") };
        let truth = Truth { causes: vec![small], nats: 8.0, ..Truth::default() };
        let verdict = |verdict: &str| json!({"verdict": verdict, "complete": true});
        assert_eq!(outcome(&truth, &verdict("nothing-found")), Outcome::Right);
        assert_eq!(outcome(&truth, &verdict("nothing-missing")), Outcome::CannotTell);
        assert_eq!(outcome(&truth, &named(&[accepted("drift")])), Outcome::Right);
    }
}
