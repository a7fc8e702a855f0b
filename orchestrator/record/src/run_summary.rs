//! `summary.json`: what came of a run, in numbers, as it is written and read back.

use super::Status;
use super::bounded::read_file;
use experiment::Start;
use indexmap::IndexMap;
use input::result::{ResultError, ResultFolder};
use metrics::figures::{FigureValue, FiguresByName};
use metrics::headline::{Headline, Shown};
use metrics::kpi::kpi_summary::KpiSummary;
use proto::bounds::DESCRIPTION_BYTES;
use proto::types::Coupling;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// What came of a run, in numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RunSummary {
    /// The format of this file: `murmuration/summary/1`.
    pub schema: String,
    /// Name of the experiment.
    pub name: String,
    /// Seed of every random draw.
    pub seed: u64,
    /// Agents at most.
    pub agent_count: u32,
    /// The control period (ns).
    pub step_ns: u64,
    /// How the two simulators take turns.
    #[schemars(with = "String")]
    pub coupling: Coupling,
    /// Words shown with the results.
    pub labels: BTreeMap<String, String>,
    /// `truth baseline`, if the robots knew the true state of all others; null if they knew what they heard.
    pub baseline: Option<String>,
    /// Whether the run came to its end.
    pub status: Status,
    /// Why it did not; null if it did.
    pub reason: Option<String>,
    /// Steps recorded.
    pub steps: u64,
    /// When the robots start.
    pub start: Start,
    /// When the robots started (s); what they do is measured from then on.
    pub robots_started_s: Option<f64>,
    /// Simulated time that the steps reached (s).
    pub simulated_s: f64,
    /// Digest of the last step, hexadecimal: equal in equal runs; null without a step.
    pub final_digest: Option<String>,
    /// What the robots did; null if the run failed before it was configured.
    pub task: Option<TaskSummary>,
    /// What was sent between robots; null if the run failed before it was configured.
    pub network: Option<NetworkSummary>,
    /// The figures of a network with protocols; null if the network has no protocols, as with propagation only.
    pub kpis: Option<KpiSummary>,
    /// Orders from other programs that took effect; absent without any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orders_from_outside: Option<OrdersFromOutside>,
    /// How much each table, log or capture holds, by name of the file.
    pub files: IndexMap<String, FileCount>,
    /// What to check before the results are trusted, a sentence each.
    pub warnings: Vec<String>,
}

/// Orders that other programs gave through `Command`, as far as the simulators list them: with them, the same configuration and
/// seed need not give the same results.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct OrdersFromOutside {
    /// Orders to robots, by source.
    pub robots: BTreeMap<String, u64>,
    /// Orders to the network, by source.
    pub network: BTreeMap<String, u64>,
}

impl OrdersFromOutside {
    /// Whether there were none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.robots.is_empty() && self.network.is_empty()
    }
}

/// The orders in words: how many, and who gave them.
impl std::fmt::Display for OrdersFromOutside {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let sides = [("robots", &self.robots), ("the network", &self.network)];
        let sides = sides.into_iter().filter(|(_, by_source)| !by_source.is_empty());
        let words = sides.map(|(side, by_source)| {
            let n: u64 = by_source.values().sum();
            let sources: Vec<String> = by_source
                .iter()
                .map(|(source, n)| {
                    format!("{} {n}", if source.is_empty() { "unnamed" } else { source })
                })
                .collect();
            let orders = if n == 1 { "order" } else { "orders" };
            format!("{n} {orders} to {side} ({})", sources.join(", "))
        });
        formatter.write_str(&words.collect::<Vec<_>>().join(" and "))
    }
}

/// How much a file of a run holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FileCount {
    /// Rows of a table.
    Rows(u64),
    /// Messages of a log.
    Messages(u64),
    /// Frames of a capture.
    Frames(u64),
}

/// What the robots did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TaskSummary {
    /// The robots' controller; null where the robot simulator has no such key, or several kinds of robots have several.
    pub controller: Option<String>,
    /// Path in this file of the figure to look at first, which says how well the robots reached their goal, such as
    /// `task.leader_speed_ratio`; null in summaries of earlier versions.
    #[serde(default)]
    pub first_figure: Option<String>,
    /// Whether the robots regarded their task as done.
    #[schemars(extend("x-better" = "higher"))]
    pub complete: bool,
    /// First step at which the robots regarded their task as done; null if it was never done.
    #[schemars(extend("x-better" = "lower"))]
    pub completed_at_step: Option<u64>,
    /// Time from when the robots started until they first regarded their task as done (s); null if it was never done.
    #[schemars(extend("x-better" = "lower"))]
    pub completed_after_s: Option<f64>,
    /// Further figures by name: those of every swarm, those of the controller, and those that the robot simulator reports.
    #[serde(flatten)]
    pub figures: FiguresByName,
}

impl TaskSummary {
    /// A figure that is a number or a count, and known.
    #[must_use]
    pub fn number(&self, name: &str) -> Option<f64> {
        self.figures.get(name).copied().flatten()?.number()
    }

    /// Whether a figure is a truth value, and true.
    #[must_use]
    pub fn is_set(&self, name: &str) -> bool {
        self.figures.get(name).copied().flatten() == Some(FigureValue::Flag(true))
    }
}

/// What was sent between robots, and who heard it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NetworkSummary {
    /// Transmissions of robots' payloads.
    pub transmissions: u64,
    /// Bytes of payload in them.
    pub sent_bytes: u64,
    /// Each transmission for everyone in reach, counted once for every other alive agent.
    pub attempts: u64,
    /// Attempts that were delivered.
    pub deliveries: u64,
    /// The share of the attempts that was delivered; null if there was no attempt.
    #[schemars(extend("x-better" = "higher"))]
    pub delivery_ratio: Option<f64>,
    /// Deliveries of what was for one agent alone.
    pub unicast_deliveries: u64,
    /// Deliveries that a second medium carried; absent if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second_medium_deliveries: Option<u64>,
    /// Mean time from a transmission's first bit to its delivery (s); null if nothing was delivered.
    #[schemars(extend("x-better" = "lower"))]
    pub mean_delay_s: Option<f64>,
    /// Mean age of what was heard when robots act on it (s); null if nothing was delivered.
    #[schemars(extend("x-better" = "lower"))]
    pub mean_age_s: Option<f64>,
    /// How many others an alive agent heard in a period, mean over agents and steps; null if nobody sent.
    pub mean_neighbours_heard: Option<f64>,
    /// The share of alive agents and steps in which the agent heard nobody; null if nobody sent.
    #[schemars(extend("x-better" = "lower"))]
    pub isolated_ratio: Option<f64>,
    /// Whether `by_distance` was counted over some of the receivers, because there are too many pairs.
    pub by_distance_is_sampled: bool,
    /// Delivery over distance.
    pub by_distance: Vec<DeliveryByDistance>,
}

/// Delivery in a range of distances.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DeliveryByDistance {
    /// Least distance (m).
    pub from_m: f64,
    /// Greatest distance (m).
    pub to_m: f64,
    /// Attempts.
    pub attempts: u64,
    /// Attempts that were delivered.
    pub deliveries: u64,
    /// The share that was delivered; null without an attempt.
    pub ratio: Option<f64>,
    /// The 95 % interval of the share, taking attempts for independent (Wilson 1927).
    pub ratio_interval_95: [Option<f64>; 2],
}

/// Why the summary of a run cannot be read.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SummaryError {
    /// The file cannot be read.
    #[error("{0}")]
    Read(#[from] std::io::Error),
    /// The file is not the summary of a run.
    #[error("{0}")]
    Format(#[from] serde_json::Error),
}

impl RunSummary {
    /// The first figure of the run, its value, and the headline that it belongs to; none if the run has no value of it.
    #[must_use]
    pub fn first_figure(&self) -> Option<(&'static Headline, &'static Shown, f64)> {
        let path = self.task.as_ref()?.first_figure.as_ref()?;
        let (headline, first) = Headline::of_first(path)?;
        Some((headline, first, self.number(path)?))
    }

    /// A figure that is a number or a count, and known, by its path in the file, such as `network.delivery_ratio`: one of the
    /// task, or one that a run leads with.
    #[must_use]
    pub fn number(&self, path: &str) -> Option<f64> {
        if let Some(name) = path.strip_prefix("task.") {
            return self.task.as_ref()?.number(name);
        }
        match path {
            "network.delivery_ratio" => self.network.as_ref()?.delivery_ratio,
            "kpis.since_start.delivered_of_expected.ratio" => {
                Some(self.kpis.as_ref()?.since_start.delivered_of_expected.as_ref()?.ratio)
            }
            _ => None,
        }
    }

    /// Name of the file in the directory of a run.
    pub const FILE: &'static str = "summary.json";

    /// The summary of a result.
    ///
    /// # Errors
    ///
    /// It was changed, cannot be read, or is not that of a run.
    pub fn of(run: &ResultFolder) -> Result<Self, ResultError> {
        let text = run.bytes(&DESCRIPTION_BYTES, Self::FILE)?;
        serde_json::from_slice(&text).map_err(|error| ResultError::Format {
            path: run.path().join(Self::FILE),
            message: error.to_string(),
        })
    }

    /// Reads the summary in the directory of a run as it is found. All code outside of this crate opens a [`ResultFolder`].
    ///
    /// # Errors
    ///
    /// There is none, or it is not that of a run.
    pub(crate) fn read(dir: &Path) -> Result<Self, SummaryError> {
        Ok(serde_json::from_slice(&read_file(&DESCRIPTION_BYTES, &dir.join(Self::FILE))?)?)
    }
}
