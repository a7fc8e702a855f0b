//! Campaigns unlike those that the diagnosis was developed on, each with its honest answer, and the judgement of a diagnosis.
//!
//! The kinds are 13 rows of a table. A row may have several variants, which rotate with the seed. Null campaigns, in which no
//! effect of the catalogue is hidden, differ in the distribution and the autocorrelation of their noise.

mod air;
mod anchors;
pub mod answer;
mod bands;
mod constant_bias;
mod drift;
mod exponent;
mod intervals;
mod labels;
pub mod nulls;
mod readings;
mod robots;
mod shadowing;
pub mod table;
mod testbed;
mod truck;

use super::blind::{LINK_PAIRS, ROBOT_PAIRS};
use super::{Campaign, Fleet, Layout, Size};
use answer::{Answer, Judged, Judgement};
use nulls::Noise;
use serde_json::{Value, json};

/// A campaign of a kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// The measurements: a file's text.
    pub csv: String,
    /// The model as configured.
    pub config_toml: String,
    /// The honest answer.
    pub expected: Expected,
}

/// The honest answer to a campaign, and who gives it.
#[derive(Clone, Debug, PartialEq)]
pub enum Expected {
    /// `diagnose` gives this answer.
    Answer(Answer),
    /// `compare` reports this root mean square error (dB), and blames no covariate that a constant bias does not depend on.
    PlainError(f64),
    /// `diagnose` reports only parameters with valid intervals.
    Intervals,
}

impl Case {
    /// The command of the orchestrator whose JSON is judged.
    #[must_use]
    pub const fn command(&self) -> &'static str {
        match self.expected {
            Expected::Answer(_) | Expected::Intervals => "diagnose",
            Expected::PlainError(_) => "compare",
        }
    }

    /// Judges what that command wrote.
    #[must_use]
    pub fn judged(&self, written: &Value) -> Judged {
        match &self.expected {
            Expected::Answer(answer) => answer.judged(written),
            Expected::PlainError(rmse_db) => constant_bias::judged(*rmse_db, written),
            Expected::Intervals => intervals::judged(intervals::n_ends(&self.csv), written),
        }
    }
}

/// A kind of campaign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// A row of the table, from 1 to 13.
    Row(u8),
    /// Links with nothing hidden, and this noise.
    NullLinks(Noise),
    /// Robots with nothing hidden, and this noise.
    NullRobots(Noise),
}

/// Makes the campaign of a seed.
type Make = fn(u64) -> Case;

/// The rows: title and variants.
const ROWS: [(&str, &[(&str, Make)]); 13] = [
    (
        "one robot differs",
        &[("heading-bias of one", robots::one_veers), ("slip of one, late", robots::one_slips)],
    ),
    ("testbed: level and exponent", &[("fixed nodes", testbed::case)]),
    ("one moving node, a level", &[("anchors", anchors::case)]),
    ("common drift", &[("common drift", drift::common_case)]),
    (
        "what changes over links, places or for a time",
        &[
            ("drift of every link", drift::link_case),
            ("all nodes move under shadowing", |seed| {
                shadowing::case(seed, shadowing::Movers::All)
            }),
            ("truck", truck::case),
        ],
    ),
    (
        "only shadowing",
        &[
            ("fixed nodes", |seed| shadowing::case(seed, shadowing::Movers::Nobody)),
            ("fixed and moving nodes", |seed| shadowing::case(seed, shadowing::Movers::Some)),
        ],
    ),
    (
        "defects of the measurement",
        &[
            ("register-floor", readings::register_floor),
            ("stuck-node", readings::stuck_node),
            ("heading-convention", labels::heading_convention),
            ("clock-skew", labels::clock_skew),
            ("channel-shift", labels::channel_shift),
            ("position-noise", labels::position_noise),
            ("swapped-ends", labels::swapped_ends),
            ("duplicates", readings::duplicates),
            ("outliers", readings::outliers),
        ],
    ),
    ("two bands of interference", &[("two bands", bands::case)]),
    ("slower in turns", &[("unicycles", robots::slower_in_turns)]),
    ("unknown effect in x of robots", &[("drift over x", robots::unknown_in_x)]),
    ("exponent of another base", &[("log-distance", exponent::case)]),
    ("compare: a constant bias", &[("constant bias", constant_bias::case)]),
    (
        "parameters of any diagnosis",
        &[
            ("pair of effects", pair),
            ("one robot differs", |seed| only_intervals(1, seed)),
            ("pair of effects", pair),
            ("testbed", |seed| only_intervals(2, seed)),
            ("one moving node", |seed| only_intervals(3, seed)),
            ("pair of effects", pair),
            ("common drift", |seed| only_intervals(4, seed)),
            ("changes", |seed| only_intervals(5, seed)),
            ("pair of effects", pair),
            ("only shadowing", |seed| only_intervals(6, seed)),
            ("defects", |seed| only_intervals(7, seed)),
            ("pair of effects", pair),
            ("two bands", |seed| only_intervals(8, seed)),
            ("slower in turns", |seed| only_intervals(9, seed)),
            ("unknown in x", |seed| only_intervals(10, seed)),
            ("exponent", |seed| only_intervals(11, seed)),
        ],
    ),
];

/// The variant of a row that a seed selects.
fn variant(row: u8, seed: u64) -> &'static (&'static str, Make) {
    let (_, variants) = ROWS[usize::from(row) - 1];
    &variants[(seed % variants.len() as u64) as usize]
}

/// A campaign with two effects of the catalogue, of links or of robots. Only the intervals are judged.
fn pair(seed: u64) -> Case {
    let n_pairs = (LINK_PAIRS.len() + ROBOT_PAIRS.len()) as u64;
    // Neighbouring seeds of this variant select different pairs.
    let turn = (seed / 3 % n_pairs) as usize;
    let size = [Size::Medium, Size::Clear][(seed / 48 % 2) as usize];
    let campaign = match LINK_PAIRS.get(turn) {
        Some(&both) => {
            let hidden = both.map(|hidden| (hidden, size));
            Campaign::link(seed, &Layout::drawn(seed), &hidden, 4000)
        }
        None => {
            let both = ROBOT_PAIRS[turn - LINK_PAIRS.len()];
            let fleet = Fleet::showing(both[0]);
            Campaign::robots(seed, &fleet, &both.map(|hidden| (hidden, size)), 10_000)
        }
    };
    let Campaign { csv, config_toml, .. } = campaign;
    Case { csv, config_toml, expected: Expected::Intervals }
}

/// A campaign of another row. Only the intervals are judged.
fn only_intervals(row: u8, seed: u64) -> Case {
    // One seed in 16 selects this variant: count those.
    let (_, make) = variant(row, seed / 16);
    Case { expected: Expected::Intervals, ..make(seed) }
}

/// One campaign of the plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Question {
    /// Its kind.
    pub kind: Kind,
    /// Its seed.
    pub seed: u64,
}

impl Question {
    /// The plan of all rows, `n_seeds` campaigns a row. The seeds follow from a text.
    #[must_use]
    pub fn plan(n_seeds: u64, seed_from: &str) -> Vec<Self> {
        let kinds: Vec<Kind> = (1..=13).map(Kind::Row).collect();
        plan_of(&kinds, n_seeds, seed_from)
    }

    /// The plan of all null campaigns, `n_seeds` of each kind. The seeds follow from a text.
    #[must_use]
    pub fn nulls(n_seeds: u64, seed_from: &str) -> Vec<Self> {
        let links = Noise::LINKS.map(Kind::NullLinks);
        let robots = Noise::ROBOTS.map(Kind::NullRobots);
        plan_of(&[&links[..], &robots].concat(), n_seeds, seed_from)
    }

    /// Its row in the table.
    #[must_use]
    pub fn row(&self) -> String {
        match self.kind {
            Kind::Row(row) => format!("{row:02} {}", ROWS[usize::from(row) - 1].0),
            Kind::NullLinks(noise) => format!("null links: {}", noise.name()),
            Kind::NullRobots(noise) => format!("null robots: {}", noise.name()),
        }
    }

    /// Its variant of that row.
    #[must_use]
    pub fn variant(&self) -> &'static str {
        match self.kind {
            Kind::Row(row) => variant(row, self.seed).0,
            Kind::NullLinks(_) | Kind::NullRobots(_) => "",
        }
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> String {
        match self.variant() {
            "" => format!("{} #{}", self.row(), self.seed),
            variant => format!("{} ({variant}) #{}", self.row(), self.seed),
        }
    }

    /// Its campaign.
    #[must_use]
    pub fn case(&self) -> Case {
        match self.kind {
            Kind::Row(row) => (variant(row, self.seed).1)(self.seed),
            Kind::NullLinks(noise) => nulls::links(self.seed, noise),
            Kind::NullRobots(noise) => nulls::of_robots(self.seed, noise),
        }
    }

    /// The line that is kept of it. `written`: the JSON of the command.
    #[must_use]
    pub fn line(&self, case: &Case, written: &Value) -> Value {
        let Judged { judgement, wrong } = case.judged(written);
        let candidates = written["candidates"].as_array().into_iter().flatten();
        let accepted: Vec<Value> = candidates
            .filter(|candidate| candidate["accepted"] == true)
            .map(|candidate| {
                let keys = ["effect", "only", "parameters", "indistinguishable_from", "warning"];
                keys.iter().map(|key| ((*key).to_owned(), candidate[key].clone())).collect()
            })
            .collect();
        let expected = match &case.expected {
            Expected::Answer(answer) => format!("{answer:?}"),
            other => format!("{other:?}"),
        };
        json!({
            "cell": self.name(),
            "row": self.row(),
            "variant": self.variant(),
            "judgement": judgement.name(),
            "wrong": wrong,
            "verdict": written["verdict"],
            "split": written["split"],
            "accepted": accepted,
            "unexplained": written["unexplained"],
            "expected": expected,
        })
    }
}

impl Question {
    /// The line that is kept of a null campaign of which only score tests were made: what they found is false.
    #[must_use]
    pub fn line_of_scores(&self, found: Vec<String>) -> Value {
        let judgement = if found.is_empty() { Judgement::Honest } else { Judgement::FalseCertain };
        json!({
            "cell": self.name(),
            "row": self.row(),
            "variant": self.variant(),
            "judgement": judgement.name(),
            "wrong": found,
        })
    }
}

/// Campaigns of these kinds, one of each before the next of any.
fn plan_of(kinds: &[Kind], n_seeds: u64, seed_from: &str) -> Vec<Question> {
    let first = first_seed(seed_from);
    (first..first + n_seeds)
        .flat_map(|seed| kinds.iter().map(move |&kind| Question { kind, seed }))
        .collect()
}

/// The first of a million seeds that follow from a text, by its FNV-1a hash.
pub(super) fn first_seed(text: &str) -> u64 {
    let hash = text.trim().bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    (hash >> 34) * 1_000_000
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn the_plan_has_thirty_campaigns_a_row_and_rotates_the_variants() {
        let plan = Question::plan(30, "some commit");
        assert_eq!(plan.len(), 390);
        let names: BTreeSet<String> = plan.iter().map(Question::name).collect();
        assert_eq!(names.len(), 390);
        let of_row = |row: u8| plan.iter().filter(move |one| one.kind == Kind::Row(row));
        let variants = |row| of_row(row).map(Question::variant).collect::<BTreeSet<_>>().len();
        assert_eq!([1, 5, 6, 7].map(variants), [2, 3, 2, 9]);
        assert_ne!(plan[0].seed, Question::plan(30, "another commit")[0].seed);
        assert_eq!(plan, Question::plan(30, "some commit\n"));
        assert_eq!(Question::nulls(2, "some commit").len(), 2 * 18);
    }

    #[test]
    fn every_variant_makes_campaigns_that_differ_from_seed_to_seed() {
        for row in 1..=13_u8 {
            let (_, variants) = ROWS[usize::from(row) - 1];
            for (name, make) in variants {
                let [one, other] = [48, 49].map(make);
                assert_ne!(one.csv, other.csv, "{row}: {name}");
                let n_rows = one.csv.lines().count() - 1;
                assert!((900..=12_000).contains(&n_rows), "{row}: {name}: {n_rows}");
                let config: toml::Table = toml::from_str(&one.config_toml).unwrap();
                let power_dbm =
                    config.get("netsim").and_then(|n| n["phy"]["tx_power_dbm"].as_float());
                assert!(
                    power_dbm.is_none_or(|dbm| (-89.0..59.0).contains(&dbm)),
                    "{row}: {name}: {power_dbm:?}"
                );
                // The noise is for the diagnosis to find.
                assert!(!one.config_toml.contains("sd_"), "{row}: {name}");
            }
        }
    }

    #[test]
    fn all_pairs_of_effects_rotate() {
        let pairs: Vec<u64> = (0..160)
            .filter(|seed| variant(13, *seed).0 == "pair of effects")
            .map(|seed| seed / 3 % 11)
            .collect();
        assert_eq!(pairs.iter().collect::<BTreeSet<_>>().len(), 11, "{pairs:?}");
    }

    #[test]
    fn a_line_has_the_judgement_and_what_was_accepted() {
        let question = Question { kind: Kind::Row(4), seed: 3 };
        let case = question.case();
        let written = json!({"verdict": "missing-effects", "candidates": [
            {"effect": "drift", "accepted": true}, {"effect": "temperature", "accepted": false}]});
        let line = question.line(&case, &written);
        assert_eq!(line["judgement"], "honest");
        assert_eq!(line["accepted"][0]["effect"], "drift");
        assert_eq!(line["accepted"].as_array().unwrap().len(), 1);
        assert_eq!(line["row"], "04 common drift");
        let bias = Question { kind: Kind::Row(12), seed: 3 };
        assert_eq!(bias.case().command(), "compare");
    }
}
