//! The full network, held against measurements of BotNet's network and of the 6TiSCH simulator it was made from.
//!
//! A comparison is of one figure of our runs with the same figure of a few runs of the peer. Many comparisons are made, so
//! each is at a level of 5 % divided by their number: programs that simulate the same fail a test of this module for one
//! choice of seeds in twenty at most. The seeds are fixed.

mod forming;
mod heard;
mod lost;
mod standing;

use netsim::sim::Network;
use proto::config::parse;
use proto::side::{NetInput, NetOutput, NetSimulator as _, Setup};
use proto::site::Site;
use proto::types::{
    AgentStates, Coupling, Experiment, MoteStatistics, NS_PER_S, NetRecord, Payloads, Statistic,
};
use std::fmt;
use tests::statistics::{Comparison, Resampled};

/// Length of a slot (ns).
const SLOT_NS: u64 = 10_000_000;

/// Keys of `[netsim.compat]`.
const COMPAT: [&str; 6] = [
    "shared_slot_0",
    "eb_rule",
    "no_frame_overhead",
    "no_trickle_suppression",
    "perfect_acks",
    "stale_rank",
];

/// `[compat]` with these keys switched on, and the others off.
fn compat(on: &[&str]) -> String {
    let lines: String =
        COMPAT.iter().map(|key| format!("{key} = {}\n", on.contains(key))).collect();
    format!("[compat]\n{lines}")
}

/// All keys but one.
fn without(key: &str) -> Vec<&'static str> {
    COMPAT.into_iter().filter(|other| *other != key).collect()
}

/// Whether rows of which nothing is asserted are simulated, too: `WHOLE_TABLES=1` prints the tables of docs/validation.md.
fn wants_whole_tables() -> bool {
    std::env::var_os("WHOLE_TABLES").is_some()
}

/// A network whose motes stand still, without a swarm.
struct Standing {
    network: Network,
    states: AgentStates,
    payloads: Payloads,
    step: u64,
    step_ns: u64,
}

impl Standing {
    /// `places`: x and y (m), mote 0 first. `config`: the text of `[netsim]` but for its mode. `step_ns`: how far one step
    /// goes. `records`: what every step tells. `files`: those that the configuration names, and their text.
    fn start(
        places: &[(f64, f64)],
        config: &str,
        seed: u64,
        step_ns: u64,
        records: &[NetRecord],
        files: &[(&str, String)],
    ) -> Self {
        let agent_count = places.len();
        // The peers limit no join traffic, so a limit that hardly ever holds stands for none.
        let join = "join = { rate_bytes_s = 127, burst_bytes = 508 }";
        let text = format!("mode = \"6tisch\"\n{join}\n{config}");
        let file = |(name, text): &(&str, String)| ((*name).to_owned(), text.clone().into());
        let setup = Setup {
            experiment: Experiment { seed, agent_count, step_ns, coupling: Coupling::Sequential },
            site: Site::default(),
            config: parse(&text).expect("TOML"),
            path: "netsim".to_owned(),
            files: files.iter().map(file).collect(),
            columns: Vec::new(),
            records: records.to_vec(),
        };
        let mut network = Network::default();
        network.configure(&setup).unwrap_or_else(|problems| panic!("{problems:?}"));
        let mut states = AgentStates::at_origin(agent_count);
        for (place, &(x_m, y_m)) in places.iter().enumerate() {
            (states.x_m[place], states.y_m[place]) = (x_m, y_m);
        }
        let payloads = Payloads::silence(agent_count);
        Self { network, states, payloads, step: 0, step_ns }
    }

    /// A step, after which `records` are told besides.
    fn step(&mut self, records: &[NetRecord]) -> NetOutput {
        self.step += 1;
        self.network.step(&NetInput {
            step: self.step,
            from_ns: (self.step - 1) * self.step_ns,
            until_ns: self.step * self.step_ns,
            states: &self.states,
            payloads: &self.payloads,
            moved_obstacles: &[],
            commands: &[],
            stop_at_first_delivery: false,
            records,
        })
    }

    /// A column of the statistics.
    fn column<'a>(statistics: &'a MoteStatistics, name: &str) -> &'a Statistic {
        let column = statistics.columns.iter().find(|column| column.name == name);
        column.unwrap_or_else(|| panic!("a column {name}"))
    }

    /// When (ns) each mote first did something, as a column of the statistics tells; `None`: it has not.
    fn first(statistics: &MoteStatistics, name: &str) -> Vec<Option<u64>> {
        let column = Self::column(statistics, name);
        let known = column.known.as_ref().expect("the moment may not have come yet");
        let values = column.values.iter().enumerate();
        values.map(|(mote, &ns)| known.get(mote).then_some(ns as u64)).collect()
    }
}

/// Digits behind the point with which a figure is printed.
fn digits(value: f64) -> usize {
    if value < 20.0 { 2 } else { 0 }
}

/// Comparisons of one test.
#[derive(Default)]
struct Group {
    rows: Vec<Row>,
}

struct Row {
    what: String,
    measured: f64,
    n_runs: usize,
    compared: Comparison,
    resampled: Resampled,
}

impl Group {
    /// Compares `figure` of `values`, one per run of ours, with what was `measured` of `n_runs`, as `compare` does.
    fn add(
        &mut self,
        what: &str,
        values: &[f64],
        n_runs: usize,
        figure: fn(&[f64]) -> f64,
        measured: f64,
        compare: impl Fn(&[f64]) -> Comparison,
    ) {
        let resampled = Resampled::bootstrap(values, n_runs, figure);
        let what = what.to_owned();
        self.rows.push(Row { what, measured, n_runs, compared: compare(values), resampled });
    }

    /// Of each comparison: 5 % for all of them together.
    fn level(&self) -> f64 {
        0.05 / self.rows.len() as f64
    }

    /// No comparison is so improbable that one of as many would be for one choice of seeds in twenty.
    fn assert_agreement(&self) {
        let level = self.level();
        for row in &self.rows {
            assert!(level <= row.compared.probability, "{}\n{self}", row.what);
        }
    }
}

impl fmt::Display for Group {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "| what | ours | peer's | its runs | 95 % of the difference | p | found in 80 % |"
        )?;
        writeln!(f, "|---|---|---|---|---|---|---|")?;
        let factor = |of: Option<f64>| of.map_or("–".to_owned(), |of| format!("× {of:.2}"));
        for Row { what, measured, n_runs, compared, resampled } in &self.rows {
            let [less, more] = resampled.detectable(self.level()).map(factor);
            let Comparison { own, interval: [low, high], probability } = compared;
            let digits = digits(*measured);
            writeln!(
                f,
                "| {what} | {own:.digits$} | {measured:.digits$} | {n_runs} | {low:.digits$} to {high:.digits$} | \
                 {probability:.3} | {less}, {more} |"
            )?;
        }
        Ok(())
    }
}
