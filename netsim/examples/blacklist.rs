//! What channel blacklisting gains beside WiFi networks: `cargo run --release -p netsim --example blacklist -- [SEEDS]`.
//!
//! Runs the network of configs/blacklist.toml without blacklisting and with several numbers of channels that stay; then the same
//! with more noise, and acknowledgments that are never lost. Prints Markdown tables: the share of transmissions in dedicated cells
//! that arrive, retransmissions per packet, and how much better both are than with the same seed without blacklisting. The values are
//! means over the seeds with 95 % confidence intervals. All transmissions count, from the first on: links learn meanwhile.

#![expect(clippy::disallowed_methods, reason = "a program reads its arguments")]

use netsim::sim::Network;
use proto::config::parse;
use proto::side::{NetInput, NetSimulator as _, Setup};
use proto::site::Site;
use proto::types::{
    AgentStates, Coupling, EVERYONE, Experiment, FrameOutcome, Frames, NS_PER_S, NetRecord,
    Payloads,
};
use std::collections::BTreeMap;
use std::io::{self, Write};

const CONFIG: &str = include_str!("../../configs/blacklist.toml");
const N_MOTES: usize = 14;
const SECONDS: u64 = 3600;
/// Quantiles of Student's t at 97.5 %, by degrees of freedom from 1.
const T: [f64; 19] = [
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160,
    2.145, 2.131, 2.120, 2.110, 2.101, 2.093,
];

/// Acknowledgments are never lost, as in the simulator of MABO-TSCH's authors, and there is noise on the whole band besides: a channel
/// between the WiFi networks delivers 0.77 of the frames, another 0.25.
const NOISY: &str = "[[phy.effect]]\nkind = \"interference\"\ncentre_mhz = 2440.0\nwidth_mhz = 80.0\nduty = 0.23\n\
    [compat]\nperfect_acks = true\n";
const NOISY_WIFI: &str = "duty = 0.675";

/// `[netsim]` of the configuration, its keys at top level, with another line of `[netsim.mac]`.
fn config(blacklist: &str, is_noisy: bool) -> String {
    let from = CONFIG.find("[netsim]").expect("a table");
    let until = CONFIG.find("[output]").expect("a table");
    let mut text = String::new();
    for line in CONFIG[from..until].lines().skip(1) {
        let line = match line {
            line if line.starts_with("blacklist = ") => blacklist,
            line if is_noisy && line.starts_with("duty = ") => NOISY_WIFI,
            line => line,
        };
        text.push_str(&line.replace("[netsim.", "["));
        text.push('\n');
    }
    if is_noisy {
        text.push_str(NOISY);
    }
    text
}

/// Transmissions to the root in dedicated cells, from the first on.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    n_sent: u64,
    n_arrived: u64,
    /// First transmissions of packets.
    n_first: u64,
}

impl Count {
    fn add(&mut self, frames: &Frames) {
        for frame in 0..frames.len() {
            // Slot 0 is everybody's.
            let slot = frames.sent_ns[frame] / 10_000_000 % 101;
            let is_dedicated = slot != 0 && frames.destination[frame] != EVERYONE;
            if is_dedicated {
                self.n_sent += 1;
                self.n_arrived += u64::from(frames.outcome[frame] != FrameOutcome::Lost);
                self.n_first += u64::from(frames.attempt[frame] == 1);
            }
        }
    }

    fn delivery(&self) -> f64 {
        self.n_arrived as f64 / self.n_sent as f64
    }

    fn retransmissions(&self) -> f64 {
        (self.n_sent - self.n_first) as f64 / self.n_first as f64
    }
}

fn run(config: &str, seed: u64) -> Count {
    let mut network = Network::default();
    let experiment = Experiment {
        seed,
        agent_count: N_MOTES,
        step_ns: NS_PER_S,
        coupling: Coupling::Sequential,
    };
    let setup = Setup {
        experiment,
        site: Site::default(),
        config: parse(config).expect("TOML"),
        path: "netsim".to_owned(),
        files: BTreeMap::new(),
        columns: Vec::new(),
        records: vec![NetRecord::Frames],
    };
    network.configure(&setup).unwrap_or_else(|problems| panic!("{problems:?}"));
    let states = AgentStates::at_origin(N_MOTES);
    let payloads = Payloads::silence(N_MOTES);
    let mut count = Count::default();
    for second in 0..SECONDS {
        let output = network.step(&NetInput {
            step: second + 1,
            from_ns: second * NS_PER_S,
            until_ns: (second + 1) * NS_PER_S,
            states: &states,
            payloads: &payloads,
            moved_obstacles: &[],
            commands: &[],
            stop_at_first_delivery: false,
            records: &[],
        });
        if let Some(frames) = &output.frames {
            count.add(frames);
        }
    }
    count
}

/// Mean and half the 95 % confidence interval.
fn interval(values: &[f64], digits: usize) -> String {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let half = T[values.len() - 2] * (variance / n).sqrt();
    format!("{mean:.digits$} ± {half:.digits$}")
}

fn main() -> io::Result<()> {
    let n_seeds: u64 = std::env::args().nth(1).map_or(Ok(10), |text| text.parse()).unwrap_or(0);
    if !(2..=20).contains(&n_seeds) {
        writeln!(io::stderr(), "error: the number of seeds must be 2 to 20")?;
        std::process::exit(2);
    }
    for (title, is_noisy) in
        [("configs/blacklist.toml", false), ("with noise and without lost acknowledgments", true)]
    {
        writeln!(io::stdout(), "{title}\n\n{}", table(n_seeds, is_noisy))?;
    }
    Ok(())
}

fn table(n_seeds: u64, is_noisy: bool) -> String {
    let of = |blacklist: &str| -> Vec<Count> {
        let config = config(blacklist, is_noisy);
        (1..=n_seeds).map(|seed| run(&config, seed)).collect()
    };
    let percent = |counts: &[Count]| {
        let shares: Vec<f64> = counts.iter().map(|count| 100.0 * count.delivery()).collect();
        interval(&shares, 2)
    };
    let again = |counts: &[Count]| {
        let means: Vec<f64> = counts.iter().map(Count::retransmissions).collect();
        interval(&means, 3)
    };
    let plain = of("");
    let mut text = "| channels that stay | arrive (%) | gain | retransmissions | fewer by the factor |\n|---|---|---|---|---|\n"
        .to_owned();
    text.push_str(&format!("| all | {} | 1 | {} | 1 |\n", percent(&plain), again(&plain)));
    for arms in [4, 6, 8] {
        let counts = of(&format!(
            "blacklist = {{ kind = \"mabo-first-best-arm\", arms = {arms}, offsets = 15, spacing = 1 }}"
        ));
        let ratios = |of: fn(&Count) -> f64| -> Vec<f64> {
            counts.iter().zip(&plain).map(|(with, without)| of(with) / of(without)).collect()
        };
        let gain = interval(&ratios(Count::delivery), 2);
        let fewer: Vec<f64> =
            ratios(Count::retransmissions).iter().map(|ratio| ratio.recip()).collect();
        text.push_str(&format!(
            "| {arms} | {} | {gain} | {} | {} |\n",
            percent(&counts),
            again(&counts),
            interval(&fewer, 2)
        ));
    }
    text
}
