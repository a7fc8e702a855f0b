//! Whether the error that `extend` promises is the error on measurements that it has not seen: a campaign is divided into two halves of
//! the same truth, the model is extended on one and compared with the other.

use super::blind::{Cell, Subject};
use super::{Campaign, Hidden, RobotHidden, Size};
use crate::statistics::{median, median_interval};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// What is new in the second half.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum New {
    /// The noise alone: rows of links take turns.
    Noise,
    /// Links between the same nodes, those whose numbers have an odd sum; or robots, every second one.
    Members,
}

/// A campaign of which one half is fresh.
#[derive(Clone, Debug, PartialEq)]
pub struct Promise {
    cell: Cell,
    new: New,
}

/// Effects with levels of their own for each node, link or moment. Such levels are no part of the extended configuration, so that its
/// error is another figure than that of a model which knows them.
const WITH_LEVELS: [Hidden; 4] =
    [Hidden::NodeOffset, Hidden::Shadowing, Hidden::Multipath, Hidden::FastFading];

impl Promise {
    /// Every effect of the catalogue without random levels, at medium size: of links with new noise and with new links, of robots with
    /// new robots.
    #[must_use]
    pub fn plan(n_seeds: u64) -> Vec<Self> {
        let mut subjects = Vec::new();
        for kind in Hidden::KNOWN.into_iter().filter(|kind| !WITH_LEVELS.contains(kind)) {
            let subject = Subject::Link(vec![(kind, Size::Medium)]);
            subjects.push((subject.clone(), New::Noise));
            subjects.push((subject, New::Members));
        }
        for kind in RobotHidden::KNOWN {
            subjects.push((Subject::Robots(vec![(kind, Size::Medium)]), New::Members));
        }
        let of_seed = |seed| {
            subjects.clone().into_iter().map(move |(subject, new)| Self {
                cell: Cell { subject, seed, is_drawn: false },
                new,
            })
        };
        (1..=n_seeds).flat_map(of_seed).collect()
    }

    /// What is measured together.
    fn kind(&self) -> &'static str {
        match (&self.cell.subject, self.new) {
            (Subject::Link(_), New::Noise) => "links, new noise",
            (Subject::Link(_), New::Members) => "links, new links",
            (Subject::Robots(_), _) => "robots, new robots",
        }
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> String {
        format!("{}: {}", self.kind(), self.cell.name())
    }

    /// Its campaign, of twice as many rows.
    #[must_use]
    pub fn campaign(&self, n_rows: usize) -> Campaign {
        self.cell.campaign(2 * n_rows)
    }

    /// The measurements that a model is extended on, and the fresh ones: two files' texts.
    ///
    /// # Panics
    ///
    /// If the campaign's file lacks a column that a campaign of its kind has.
    #[must_use]
    pub fn halves(&self, campaign: &Campaign) -> [String; 2] {
        let mut lines = campaign.csv.lines();
        let header = lines.next().expect("a campaign has a header");
        let place = |name: &str| {
            header.split(',').position(|column| column == name).expect("a campaign has its columns")
        };
        let columns: Vec<usize> = match (&self.cell.subject, self.new) {
            (_, New::Noise) => Vec::new(),
            (Subject::Link(_), New::Members) => vec![place("tx"), place("rx")],
            (Subject::Robots(_), New::Members) => vec![place("agent")],
        };
        let mut halves = [0, 1].map(|_| format!("{header}\n"));
        for (row, line) in lines.enumerate() {
            let fields: Vec<&str> = line.split(',').collect();
            let member = |&column: &usize| -> usize {
                fields[column].parse().expect("nodes and robots are whole numbers")
            };
            let sum = if columns.is_empty() { row } else { columns.iter().map(member).sum() };
            let _ = writeln!(halves[sum % 2], "{line}");
        }
        halves
    }

    /// The line that is kept.
    ///
    /// * `extension`: as `extend --json` wrote it; null where nothing was added.
    /// * `comparison`: as `compare --json` wrote it of the extended configuration and the fresh half.
    #[must_use]
    pub fn line(&self, extension: &Value, comparison: &Value) -> Value {
        let promised = extension["rmse"][1].as_f64();
        let scores = &comparison["scores"];
        let fresh = scores["rmse_db"].as_f64().or_else(|| scores["rmse_m"].as_f64());
        let ratio = promised.zip(fresh).map(|(promised, fresh)| fresh / promised);
        json!({
            "cell": self.name(),
            "group": self.kind(),
            "added": extension["added"],
            "promised": promised,
            "fresh": fresh,
            "ratio": ratio,
        })
    }
}

/// The table, as Markdown, from the lines kept.
#[must_use]
pub fn table(lines: &[Value]) -> String {
    let mut groups: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for line in lines {
        if let (Some(group), Some(ratio)) = (line["group"].as_str(), line["ratio"].as_f64()) {
            groups.entry(group).or_default().push(ratio);
        }
    }
    let mut text = String::from(
        "| fresh | campaigns | fresh error over promised: median | 90 % interval of the median |\n|---|---|---|---|\n",
    );
    for (group, ratios) in &groups {
        let [low, high] = median_interval(ratios, 0.9);
        let _ = writeln!(
            text,
            "| {group} | {} | {:.3} | {low:.3} to {high:.3} |",
            ratios.len(),
            median(ratios)
        );
    }
    let n_without = lines.iter().filter(|line| line["ratio"].is_null()).count();
    let _ =
        writeln!(text, "\nCampaigns in which nothing was added: {n_without} of {}.", lines.len());
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_share_no_row_and_new_members_are_in_one_of_them_only() {
        let plan = Promise::plan(1);
        for kind in ["links, new noise", "links, new links", "robots, new robots"] {
            let promise = plan.iter().find(|promise| promise.kind() == kind).unwrap();
            let campaign = promise.campaign(500);
            let halves = promise.halves(&campaign);
            let n_rows = |text: &str| text.lines().count() - 1;
            assert_eq!(n_rows(&halves[0]) + n_rows(&halves[1]), n_rows(&campaign.csv), "{kind}");
            let least = n_rows(&campaign.csv) / 3;
            assert!(halves.iter().all(|half| least < n_rows(half)), "{kind}");
            let first = |half: &str| -> Vec<String> {
                let members =
                    |line: &str| line.split(',').take(3).skip(1).collect::<Vec<_>>().join(" ");
                half.lines().skip(1).map(members).collect()
            };
            if kind == "links, new links" {
                let [one, other] = [first(&halves[0]), first(&halves[1])];
                assert!(one.iter().all(|pair| !other.contains(pair)));
            }
        }
    }

    #[test]
    fn the_table_has_the_median_of_each_kind() {
        let line = |ratio: Option<f64>| json!({"group": "links, new noise", "ratio": ratio});
        let lines = [0.9, 1.0, 1.3].map(|ratio| line(Some(ratio)));
        let text = table(&[&lines[..], &[line(None)]].concat());
        assert!(text.contains("| links, new noise | 3 | 1.000 | 0.900 to 1.300 |"), "{text}");
        assert!(text.contains("nothing was added: 1 of 4"), "{text}");
    }
}
