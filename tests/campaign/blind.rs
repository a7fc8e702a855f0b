//! A blind campaign: many campaigns with something hidden, a diagnosis of each that is told nothing, and the table of how it did.

use super::{Campaign, Drive, Fleet, Hidden, Layout, RobotHidden, Scores, Size, Truth};
use crate::statistics::{binomial_interval, median};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// One campaign of the plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// What is hidden.
    pub subject: Subject,
    /// Seed of the campaign.
    pub seed: u64,
    /// Links only: the layout is drawn from the seed, in place of the standard one.
    pub is_drawn: bool,
}

/// What is hidden in a cell.
#[derive(Clone, Debug, PartialEq)]
pub enum Subject {
    /// Links.
    Link(Vec<(Hidden, Size)>),
    /// Robots.
    Robots(Vec<(RobotHidden, Size)>),
}

/// Two effects at once.
pub(super) const LINK_PAIRS: [[Hidden; 2]; 8] = [
    [Hidden::TwoRayGround, Hidden::AntennaPattern],
    [Hidden::PathLossExponent, Hidden::Interference],
    [Hidden::WallAttenuation, Hidden::Temperature],
    [Hidden::NodeOffset, Hidden::NoiseFloor],
    [Hidden::HiddenScreen, Hidden::Multipath],
    [Hidden::Shadowing, Hidden::BatterySag],
    [Hidden::Vegetation, Hidden::SystemGain],
    [Hidden::BodyBlocking, Hidden::ReceiverNonlinearity],
];

/// Two effects at once, of robots.
pub(super) const ROBOT_PAIRS: [[RobotHidden; 2]; 3] = [
    [RobotHidden::Slip, RobotHidden::Wind],
    [RobotHidden::HeadingBias, RobotHidden::QuadraticDrag],
    [RobotHidden::Slope, RobotHidden::SpeedLimit],
];

impl Cell {
    /// The plan: every effect at three sizes, those of no catalogue, pairs at medium and clear size, all with `n_seeds` seeds, and 25
    /// times as many campaigns of links, and as many of robots as seeds, in which nothing is hidden. `is_drawn`: in layouts drawn from their seeds.
    #[must_use]
    pub fn plan(n_seeds: u64, is_drawn: bool) -> Vec<Self> {
        let mut subjects: Vec<Subject> = Vec::new();
        let links = [&Hidden::KNOWN[..], &Hidden::UNKNOWN].concat();
        let robots = [&RobotHidden::KNOWN[..], &RobotHidden::UNKNOWN].concat();
        for size in Size::ALL {
            subjects.extend(links.iter().map(|&kind| Subject::Link(vec![(kind, size)])));
            subjects.extend(robots.iter().map(|&kind| Subject::Robots(vec![(kind, size)])));
        }
        for size in [Size::Medium, Size::Clear] {
            let links = LINK_PAIRS.map(|pair| pair.map(|hidden| (hidden, size)).to_vec());
            subjects.extend(links.map(Subject::Link));
            let robots = ROBOT_PAIRS.map(|pair| pair.map(|hidden| (hidden, size)).to_vec());
            subjects.extend(robots.map(Subject::Robots));
        }
        let mut cells: Vec<Self> = Vec::new();
        // One seed of everything before the next of anything, so that a plan cut short is a smaller plan.
        for seed in 1..=n_seeds {
            let each =
                subjects.iter().map(|subject| Self { subject: subject.clone(), seed, is_drawn });
            cells.extend(each);
            let nulls = (25 * (seed - 1) + 1)..=25 * seed;
            cells.extend(nulls.map(|seed| Self {
                subject: Subject::Link(Vec::new()),
                seed,
                is_drawn,
            }));
            cells.push(Self { subject: Subject::Robots(Vec::new()), seed, is_drawn });
        }
        cells
    }

    /// Its name without the seed.
    #[must_use]
    pub fn group(&self) -> String {
        let (of, names) = match &self.subject {
            Subject::Link(hidden) => (
                if self.is_drawn { "drawn link" } else { "link" },
                hidden.iter().map(|(k, s)| link_name(*k, *s)).collect(),
            ),
            Subject::Robots(hidden) => (
                "robot",
                hidden
                    .iter()
                    .map(|(kind, size)| format!("{} {}", size.name(), kind.effect()))
                    .collect::<Vec<_>>(),
            ),
        };
        let what = if names.is_empty() { "nothing".to_owned() } else { names.join(" + ") };
        format!("{of}: {what}")
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> String {
        format!("{} #{}", self.group(), self.seed)
    }

    /// The campaign, of at most this many rows; of robots, four times as many, since 20 rows make one second of one.
    #[must_use]
    pub fn campaign(&self, n_rows: usize) -> Campaign {
        match &self.subject {
            Subject::Link(hidden) => {
                let layout =
                    if self.is_drawn { Layout::drawn(self.seed) } else { Layout::standard() };
                Campaign::link(self.seed, &layout, hidden, n_rows)
            }
            Subject::Robots(hidden) => {
                let fleet = hidden
                    .first()
                    .map_or(const { Fleet::standard(Drive::Velocity) }, |(kind, _)| {
                        Fleet::showing(*kind)
                    });
                Campaign::robots(self.seed, &fleet, hidden, 4 * n_rows)
            }
        }
    }

    /// What came of a diagnosis of it: the line that is kept. `diagnosis`: as `diagnose --json` wrote it.
    #[must_use]
    pub fn judged(&self, campaign: &Campaign, diagnosis: &Value) -> Value {
        // Of several that the data cannot tell apart, the first is the one that counts.
        let first_of = |named: &'_ str| named.split(" or ").next().unwrap_or_default().to_owned();
        let missing: Vec<String> = texts(&diagnosis["missing"]).into_iter().map(first_of).collect();
        let missing: Vec<&str> = missing.iter().map(String::as_str).collect();
        let unexplained: Vec<&str> = diagnosis["unexplained"]
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(|one| one["covariate"].as_str())
            .collect();
        let is_known = |truth: &&Truth| truth.covariates.is_empty();
        let known: Vec<&Truth> = campaign.truth.iter().filter(is_known).collect();
        let first = missing.first().copied();
        let named = unexplained.first().copied();
        let right_first = match &campaign.truth[..] {
            [] => diagnosis["verdict"] == "nothing-missing",
            [truth] if !truth.covariates.is_empty() => {
                diagnosis["verdict"] == "unexplained-structure"
                    && named.is_some_and(|named| is_one_of(named, truth.covariates))
            }
            truths => truths.iter().any(|truth| first == Some(truth.effect)),
        };
        let found = known.iter().filter(|truth| missing.contains(&truth.effect)).count();
        let false_alarms: Vec<&str> = missing
            .iter()
            .copied()
            .filter(|name| known.iter().all(|truth| truth.effect != *name))
            .collect();
        let intervals: Vec<Value> = known
            .iter()
            .filter(|truth| missing.contains(&truth.effect))
            .flat_map(|truth| intervals(truth, diagnosis))
            .collect();
        json!({
            "cell": self.name(),
            "group": self.group(),
            "sizes": campaign.truth.iter().map(|truth| truth.size).collect::<Vec<_>>(),
            "verdict": diagnosis["verdict"],
            "missing": missing,
            "unexplained": unexplained,
            "right_first": right_first,
            "tied": campaign.truth.iter().all(|truth| is_tied(truth, diagnosis)),
            "all_found": found == known.len() && (!known.is_empty() || right_first),
            "false_alarms": false_alarms,
            "rank": known.first().and_then(|truth| rank(truth, diagnosis)),
            "over_oracle": over_oracle(&campaign.oracle, diagnosis),
            "intervals": intervals,
        })
    }
}

fn link_name(kind: Hidden, size: Size) -> String {
    let place = match kind {
        Hidden::HiddenScreen => " (screen)",
        Hidden::HiddenDisc => " (disc)",
        _ => "",
    };
    format!("{} {}{place}", size.name(), kind.effect())
}

pub(super) fn texts(list: &Value) -> Vec<&str> {
    list.as_array().into_iter().flatten().filter_map(Value::as_str).collect()
}

/// Whether an effect is named, or cannot be told from one that is.
fn is_tied(truth: &Truth, diagnosis: &Value) -> bool {
    if !truth.covariates.is_empty() {
        let mut structure = diagnosis["unexplained"].as_array().into_iter().flatten();
        return structure.any(|one| {
            let named = one["covariate"].as_str();
            let others = texts(&one["indistinguishable_from"]);
            named.into_iter().chain(others).any(|named| is_one_of(named, truth.covariates))
        });
    }
    let accepted = diagnosis["candidates"].as_array().into_iter().flatten();
    accepted.filter(|candidate| candidate["accepted"] == true).any(|candidate| {
        candidate["effect"] == truth.effect
            || texts(&candidate["indistinguishable_from"]).contains(&truth.effect)
    })
}

/// Whether a covariate, perhaps with its curve's prefix or without its unit, is one of those.
pub(super) fn is_one_of(named: &str, covariates: &[&str]) -> bool {
    let named = named.strip_prefix("curve:").unwrap_or(named);
    covariates.iter().any(|covariate| {
        covariate.strip_prefix(named).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
    })
}

/// Which of the candidates the right one is, by gain.
fn rank(truth: &Truth, diagnosis: &Value) -> Option<usize> {
    let candidates = diagnosis["candidates"].as_array()?;
    let gain = |candidate: &Value| candidate["gain"].as_f64();
    let own = candidates.iter().find(|candidate| candidate["effect"] == truth.effect)?;
    let own = gain(own)?;
    Some(1 + candidates.iter().filter(|candidate| Some(own) < gain(candidate)).count())
}

/// By which factor the last model's held-out errors exceed the true model's.
fn over_oracle(oracle: &Scores, diagnosis: &Value) -> Value {
    let last = diagnosis["ladder"].as_array().and_then(|ladder| ladder.last());
    let ratio = |name: &str, truth: f64| Some(last?[name].as_f64()? / truth);
    json!({
        "rmse": ratio("rmse", oracle.rmse),
        "crps": ratio("crps", oracle.crps),
        "reception_log_loss":
            oracle.reception_log_loss.and_then(|truth| ratio("reception_log_loss", truth)),
        "log_score": last.and_then(|last| Some(oracle.log_score - last["log_score"].as_f64()?)),
    })
}

/// For each parameter of an effect that the diagnosis gives an interval: whether the truth is in it.
fn intervals(truth: &Truth, diagnosis: &Value) -> Vec<Value> {
    let candidates = diagnosis["candidates"].as_array();
    let own =
        candidates.and_then(|all| all.iter().find(|candidate| candidate["effect"] == truth.effect));
    let Some(own) = own else { return Vec::new() };
    let found = |name: &str| own["parameters"][name]["value"].as_f64();
    truth
        .named_as(&found)
        .into_iter()
        .filter_map(|(name, value)| {
            let found = &own["parameters"][name];
            let [low, high] = [found["low"].as_f64()?, found["high"].as_f64()?];
            Some(json!({
                "parameter": format!("{} {name}", truth.effect),
                "truth": value,
                "value": found["value"],
                "low": low,
                "high": high,
                "covers": low <= value && value <= high,
            }))
        })
        .collect()
}

/// The tables, as Markdown, from the lines kept; sorted by group.
#[must_use]
pub fn tables(lines: &[Value]) -> String {
    let mut groups: BTreeMap<&str, Vec<&Value>> = BTreeMap::new();
    let has_failed = |line: &&Value| line["error"].is_string();
    for line in lines.iter().filter(|line| !has_failed(line)) {
        groups.entry(line["group"].as_str().unwrap_or("?")).or_default().push(line);
    }
    let mut text = String::from(
        "| hidden | campaigns | right cause first | all found | named as well | rank | rmse over oracle's | \
         reception log loss over oracle's | intervals that cover |\n|---|---|---|---|---|---|---|---|---|\n",
    );
    for (group, lines) in &groups {
        let share = |key: &str| {
            let n_of = lines.iter().filter(|line| line[key] == true).count();
            percent(n_of, lines.len())
        };
        let ratio = |key: &str| {
            let values: Vec<f64> =
                lines.iter().filter_map(|line| line["over_oracle"][key].as_f64()).collect();
            if values.is_empty() {
                "–".to_owned()
            } else {
                format!("{:+.1} %", 100.0 * (median(&values) - 1.0))
            }
        };
        let ranks: Vec<f64> = lines.iter().filter_map(|line| line["rank"].as_f64()).collect();
        let rank =
            if ranks.is_empty() { "–".to_owned() } else { format!("{:.0}", median(&ranks)) };
        let _ = writeln!(
            text,
            "| {group} | {} | {} | {} | {} | {rank} | {} | {} | {} |",
            lines.len(),
            share("right_first"),
            share("all_found"),
            others(lines),
            ratio("rmse"),
            ratio("reception_log_loss"),
            covered(lines.iter().copied()),
        );
    }
    summaries(&mut text, &groups);
    let failed = lines.iter().filter(has_failed).count();
    let _ = writeln!(text, "\nAll 90 % intervals: {}.", covered(lines.iter()));
    let _ = writeln!(text, "Campaigns that no diagnosis came of: {failed} of {}.", lines.len());
    text
}

/// Groups of a kind together: one effect of the catalogue, two, one of no catalogue, none; by size.
fn summaries(text: &mut String, groups: &BTreeMap<&str, Vec<&Value>>) {
    let mut kinds: BTreeMap<String, Vec<&Value>> = BTreeMap::new();
    for (group, lines) in groups {
        let (of, hidden) = group.split_once(": ").unwrap_or(("?", group));
        let size = hidden.split(' ').next().unwrap_or_default();
        let kind = match hidden {
            "nothing" => format!("{of}: nothing"),
            _ if hidden.contains("unknown-") => format!("{of}: one of no catalogue, {size}"),
            _ if hidden.contains(" + ") => format!("{of}: two, {size}"),
            _ => format!("{of}: one, {size}"),
        };
        kinds.entry(kind).or_default().extend(lines.iter().copied());
    }
    text.push_str(
        "\n| hidden | campaigns | right cause first | all found | right or tied with it | named as well | intervals that \
         cover |\n|---|---|---|---|---|---|---|\n",
    );
    for (kind, lines) in &kinds {
        let share = |wanted: &dyn Fn(&Value) -> bool| {
            percent(lines.iter().filter(|line| wanted(line)).count(), lines.len())
        };
        let _ = writeln!(
            text,
            "| {kind} | {} | {} | {} | {} | {} | {} |",
            lines.len(),
            share(&|line| line["right_first"] == true),
            share(&|line| line["all_found"] == true),
            share(&|line| line["right_first"] == true || line["tied"] == true),
            others(lines),
            covered(lines.iter().copied()),
        );
    }
}

/// A share with its exact 95 % interval.
pub(super) fn percent(n_of: usize, n: usize) -> String {
    let [low, high] = binomial_interval(n_of, n, 0.05);
    let share = n_of as f64 / n as f64;
    format!("{:.0} % ({:.0} to {:.0})", 100.0 * share, 100.0 * low, 100.0 * high)
}

/// How many intervals cover the truth.
fn covered<'a>(lines: impl Iterator<Item = &'a Value>) -> String {
    let all: Vec<bool> = lines
        .flat_map(|line| line["intervals"].as_array().into_iter().flatten())
        .map(|interval| interval["covers"] == true)
        .collect();
    if all.is_empty() {
        return "–".to_owned();
    }
    let n_of = all.iter().filter(|covers| **covers).count();
    format!("{n_of} of {}, {}", all.len(), percent(n_of, all.len()))
}

/// What was named though it was not there, the most frequent first.
fn others(lines: &[&Value]) -> String {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for line in lines {
        for name in texts(&line["false_alarms"]) {
            *counts.entry(name).or_default() += 1;
        }
        if line["right_first"] != true {
            for name in texts(&line["unexplained"]) {
                *counts.entry(name).or_default() += 1;
            }
        }
    }
    let mut counts: Vec<(&str, usize)> = counts.into_iter().collect();
    counts.sort_by_key(|&(name, n)| (std::cmp::Reverse(n), name));
    let named: Vec<String> =
        counts.iter().take(4).map(|(name, n)| format!("{name} ({n})")).collect();
    if named.is_empty() { "–".to_owned() } else { named.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(hidden: Hidden) -> Cell {
        Cell { subject: Subject::Link(vec![(hidden, Size::Clear)]), seed: 3, is_drawn: false }
    }

    #[test]
    fn a_diagnosis_is_judged_by_the_truth() {
        let wall = cell(Hidden::WallAttenuation);
        let campaign = wall.campaign(1000);
        let truth = campaign.truth[0].parameters[0].1;
        let diagnosis = json!({
            "verdict": "missing-effects",
            "missing": ["wall-attenuation", "shadowing"],
            "ladder": [{"rmse": 9.0}, {"rmse": 1.1 * campaign.oracle.rmse, "log_score": -2.0}],
            "candidates": [
                {"effect": "shadowing", "gain": 0.3},
                {"effect": "wall-attenuation", "gain": 0.2,
                 "parameters": {"loss_db": {"value": truth, "low": truth - 0.1, "high": truth + 0.1}}},
            ],
        });
        let line = wall.judged(&campaign, &diagnosis);
        assert_eq!(line["cell"], "link: clear wall-attenuation #3");
        assert_eq!([&line["right_first"], &line["all_found"]], [true, true]);
        assert_eq!(line["false_alarms"], json!(["shadowing"]));
        assert_eq!(line["rank"], 2);
        assert_eq!(line["intervals"][0]["covers"], true);
        assert!((line["over_oracle"]["rmse"].as_f64().unwrap() - 1.1).abs() < 1e-12);
        let text = tables(&[line]);
        let row = "| link: clear wall-attenuation | 1 | 100 % (2 to 100) | 100 % (2 to 100) | shadowing (1) | 2 | +10.0 % | – | \
                   1 of 1, 100 % (2 to 100) |";
        assert!(text.contains(row), "{text}");
    }

    #[test]
    fn the_unknown_is_right_where_its_covariate_is_named() {
        let dust = cell(Hidden::Dust);
        let campaign = dust.campaign(1000);
        let named = |covariate: &str, verdict: &str| {
            let diagnosis = json!({"verdict": verdict, "missing": [],
                "unexplained": [{"covariate": covariate}]});
            dust.judged(&campaign, &diagnosis)["right_first"] == true
        };
        assert!(named("dust_ugm3", "unexplained-structure"));
        assert!(named("curve:dust_ugm3", "unexplained-structure"));
        assert!(named("dust", "unexplained-structure"));
        assert!(!named("du", "unexplained-structure"));
        assert!(!named("time_s", "unexplained-structure"));
        assert!(!named("dust_ugm3", "missing-effects"));
    }

    #[test]
    fn where_nothing_is_hidden_nothing_is_right() {
        let nothing = Cell { subject: Subject::Robots(Vec::new()), seed: 1, is_drawn: false };
        let campaign = nothing.campaign(100);
        let right = |verdict: &str| {
            nothing.judged(&campaign, &json!({"verdict": verdict}))["right_first"] == true
        };
        assert!(right("nothing-missing") && !right("missing-effects"));
    }

    #[test]
    fn the_plan_has_a_thousand_nulls_for_forty_seeds() {
        let plan = Cell::plan(40, false);
        let n_nulls = plan.iter().filter(|cell| cell.subject == Subject::Link(Vec::new())).count();
        assert_eq!(n_nulls, 1000);
        let drawn = Cell { is_drawn: true, ..cell(Hidden::Dust) };
        assert_eq!(drawn.name(), "drawn link: clear unknown-dust #3");
        let is_other = drawn.campaign(500).csv != cell(Hidden::Dust).campaign(500).csv;
        assert!(is_other, "the layout was not drawn");
        let mut names: Vec<String> = plan.iter().map(Cell::name).collect();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), plan.len());
        // (21 + 7 link and 15 + 3 robot effects) × 3 sizes, 11 pairs × 2.
        assert_eq!(plan.len(), 40 * (46 * 3 + 22 + 25 + 1));
    }
}
