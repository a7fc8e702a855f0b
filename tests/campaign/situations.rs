//! Situations in which a diagnosis may go wrong, in three sets of thirty, with the right answer to each.
//!
//! Set A is for development. Sets B and C are for a judgement that nobody has prepared for: do not read them, do not develop on
//! them, and do not diagnose them before that judgement. Each set has its own world, with another base model, another kind of
//! noise and other laws of motion.
//!
//! A situation draws all its numbers from the seed. Its truth, and what a campaign can show of it, are computed from the
//! causes and the design (`reference`), never from a diagnosis.

mod a;
mod b;
mod c;
mod files;
mod reference;
mod said;
pub mod table;
pub mod truth;

use super::unforeseen::first_seed;
use serde_json::{Value, json};
use truth::{Judged, Truth};

/// A campaign of a situation.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// The measurements: a file's text.
    pub csv: String,
    /// The model as configured.
    pub config_toml: String,
    /// What it lacks.
    pub truth: Truth,
}

/// A situation: its name, and its campaign of a seed.
type Situation = (&'static str, fn(u64) -> Case);

/// A set of situations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Set {
    /// For development.
    A,
    /// For the first judgement.
    B,
    /// For the second judgement.
    C,
}

impl Set {
    const fn situations(self) -> &'static [Situation] {
        match self {
            Self::A => &a::SITUATIONS,
            Self::B => &b::SITUATIONS,
            Self::C => &c::SITUATIONS,
        }
    }

    const fn name(self) -> &'static str {
        match self {
            Self::A => "A",
            Self::B => "B",
            Self::C => "C",
        }
    }

    /// Whether what becomes of single situations may be printed.
    #[must_use]
    pub fn is_open(self) -> bool {
        self == Self::A
    }
}

/// One campaign of the plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Draw {
    /// The set of its situation.
    pub set: Set,
    /// The place of its situation in the set.
    pub index: usize,
    /// Its seed.
    pub seed: u64,
}

impl Draw {
    /// The plan of a set, `n_seeds` campaigns of each situation. The seeds follow from a text.
    #[must_use]
    pub fn plan(set: Set, n_seeds: u64, seed_from: &str) -> Vec<Self> {
        let first = first_seed(seed_from);
        let of_seed =
            |seed| (0..set.situations().len()).map(move |index| Self { set, index, seed });
        (first..first + n_seeds).flat_map(of_seed).collect()
    }

    fn situation(&self) -> String {
        format!("{}{:02} {}", self.set.name(), self.index + 1, self.set.situations()[self.index].0)
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> String {
        format!("{} #{}", self.situation(), self.seed)
    }

    /// Its campaign.
    #[must_use]
    pub fn case(&self) -> Case {
        // Equal seeds of two sets or situations share no draws.
        let place = 64 * (self.set as u64) + self.index as u64;
        (self.set.situations()[self.index].1)(self.seed.wrapping_mul(192).wrapping_add(place))
    }

    /// The line that is kept of it. `written`: the JSON of the diagnosis.
    #[must_use]
    pub fn line(&self, case: &Case, written: &Value) -> Value {
        let Judged { outcome, wrong, covered } = case.truth.judged(written);
        let keys = ["effect", "only", "parameters", "indistinguishable_from", "warning"];
        let accepted: Vec<Value> = written["candidates"]
            .as_array()
            .into_iter()
            .flatten()
            .filter(|candidate| candidate["accepted"] == true)
            .map(|one| keys.iter().map(|key| ((*key).to_owned(), one[key].clone())).collect())
            .collect();
        json!({
            "cell": self.name(),
            "situation": self.situation(),
            "judgement": outcome.name(),
            "wrong": wrong,
            "covered": covered,
            "verdict": written["verdict"],
            "sentence": written["sentence"],
            "accepted": accepted,
            "unexplained": written["unexplained"],
            "truth": format!("{:?}", case.truth),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Every situation makes campaigns that follow from the seed alone, have the size that a diagnosis takes seconds for, and a
    /// configuration that says nothing of the noise.
    fn check(set: Set) {
        let plan = Draw::plan(set, 2, "some commit");
        assert_eq!(plan.len(), 60);
        assert_eq!(plan.iter().map(Draw::name).collect::<BTreeSet<_>>().len(), 60);
        for [one, next] in pairs(&plan) {
            let (case, other) = (one.case(), next.case());
            let name = one.name();
            assert_eq!(case, one.case(), "{name}");
            assert_ne!(case.csv, other.csv, "{name}");
            let n_rows = case.csv.lines().count() - 1;
            let is_robots = case.config_toml.contains("[robotsim.dynamics]");
            let most = if is_robots { 20_000 } else { 5_000 };
            assert!((40..=most).contains(&n_rows), "{name}: {n_rows} rows");
            let n_columns = case.csv.lines().next().unwrap().split(',').count();
            let is_whole = |line: &str| line.split(',').count() == n_columns;
            assert!(case.csv.lines().all(is_whole) && !case.csv.contains("NaN"), "{name}");
            toml::from_str::<toml::Table>(&case.config_toml).unwrap();
            assert!(!case.config_toml.contains("noise_sd"), "{name}");
            assert!(case.truth.nats.is_finite(), "{name}");
            let is_null = case.truth.causes.is_empty();
            assert_eq!(is_null, case.truth.nats == 0.0, "{name}: {:?}", case.truth);
        }
    }

    /// Both campaigns of each situation.
    fn pairs(plan: &[Draw]) -> Vec<[Draw; 2]> {
        (0..plan.len() / 2).map(|index| [plan[index], plan[index + plan.len() / 2]]).collect()
    }

    #[test]
    fn set_a_is_drawn_from_its_seeds() {
        check(Set::A);
    }

    #[test]
    fn set_b_is_drawn_from_its_seeds() {
        check(Set::B);
    }

    #[test]
    fn set_c_is_drawn_from_its_seeds() {
        check(Set::C);
    }
}
