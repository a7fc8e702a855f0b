//! A sensor network over MSF for an hour, as the 6TiSCH simulator's default configuration has it.

use super::{
    COMPAT, Group, NS_PER_S, NetRecord, Standing, compat, digits, wants_whole_tables, without,
};
use physics::propagation::friis::friis_dbm;
use physics::reception::Curve as _;
use physics::reception::table::Table;
use proto::rng::{Draws, Purpose};
use rayon::prelude::*;
use std::fmt::Write as _;
use std::sync::OnceLock;
use tests::statistics::{Comparison, mean, median, quantile};

/// The simulator's settings that are not behaviour.
pub(super) const SETTINGS: &str = "[sf]\nkind = 'msf'\n\
     [mac]\nneighbours_to_wait = 1\nscan_dwell_s = 0.01\n\
     [rpl]\ndao_period_s = 60.0\ndao_ack = false\ndao_delay_s = 0.0\n\
     [swarm]\ntransport = 'none'\n\
     [[app]]\nkind = 'periodic'\nperiod_s = 60.0\njitter = 0.05\ndestination = 'root'\npayload_bytes = 90\n";

/// Everyone hears everyone.
const FULLY_MESHED: &str =
    "[phy]\npropagation = 'full'\nrssi_dbm = -10.0\ninterference = { kind = 'table' }\n";

/// Links from a file.
pub(super) const FROM_FILE: &str =
    "[phy]\npropagation = 'trace'\nfile = 'links.k7'\ninterference = { kind = 'table' }\n";

/// Side of the square (m).
const SIDE_M: f64 = 2000.0;
/// What a neighbour must hear at least,
const LEAST_PDR: f64 = 0.5;
/// and how many neighbours a mote must have, or all that there are.
const LEAST_NEIGHBOURS: usize = 3;

/// The simulator's random topology, as a K7 trace: mote 0 in a corner of the square, the others where they have enough
/// neighbours; per pair one level, uniform between Friis − 40 dB and Friis, and the reception that follows from it.
pub(super) fn random_links(n: usize, seed: u64) -> String {
    let draws = Draws::new(seed, Purpose::RecordSample);
    let curve = Table::dust();
    let mut places = vec![(0.0, 0.0)];
    let mut rows = String::new();
    let mut attempt = 0;
    while places.len() < n {
        attempt += 1;
        let uniform = |what: u64| draws.uniform(n as u64, attempt, what);
        let (x, y) = (SIDE_M * uniform(0), SIDE_M * uniform(1));
        let rssi_dbm: Vec<f64> = (2..)
            .zip(&places)
            .map(|(what, &(other_x, other_y))| {
                let distance_m = f64::hypot(x - other_x, y - other_y);
                friis_dbm(0.0, distance_m, 2.4e9) - 40.0 * uniform(what)
            })
            .collect();
        let pdr = |rssi_dbm: f64| curve.reception_probability(rssi_dbm);
        let n_neighbours = rssi_dbm.iter().filter(|&&rssi| LEAST_PDR <= pdr(rssi)).count();
        if n_neighbours < LEAST_NEIGHBOURS.min(places.len()) {
            continue;
        }
        let new = places.len();
        for (other, &rssi) in rssi_dbm.iter().enumerate() {
            for (from, to) in [(new, other), (other, new)] {
                writeln!(rows, "2018-01-11T00:00:00.0,{from},{to},,{rssi},{},100", pdr(rssi))
                    .unwrap();
            }
        }
        places.push((x, y));
    }
    let channels: Vec<String> = (11..27).map(|channel: u8| channel.to_string()).collect();
    format!(
        "{{\"start_date\": \"2018-01-11T00:00:00.0\", \"stop_date\": \"2018-01-11T23:00:00.0\", \"channels\": [{}], \
         \"node_count\": {n}}}\ndatetime,src,dst,channel,mean_rssi,pdr,tx_count\n{rows}",
        channels.join(", ")
    )
}

/// Of an hour.
#[derive(Clone, Copy, Debug)]
struct Kpis {
    delivered: f64,
    latency_mean_s: f64,
    latency_p99_s: f64,
    hops: f64,
    /// First admission of the last mote (s).
    joined_s: f64,
}

fn hour(n: usize, random: bool, config: &str, seed: u64) -> Kpis {
    let phy = if random { FROM_FILE } else { FULLY_MESHED };
    let files = if random { vec![("links.k7", random_links(n, seed))] } else { Vec::new() };
    let config = format!("{phy}{config}");
    let (places, records) = (vec![(0.0, 0.0); n], [NetRecord::Packets]);
    let mut network = Standing::start(&places, &config, seed, 60 * NS_PER_S, &records, &files);
    let (mut sent, mut delivered) = (0, 0);
    let (mut latency_s, mut hops) = (Vec::new(), 0.0);
    let mut joined_s = 0.0;
    for minute in 0..60 {
        let records: &[NetRecord] = if minute == 59 { &[NetRecord::Statistics] } else { &[] };
        let output = network.step(records);
        let packets = output.packets.expect("asked for");
        sent =
            packets.kinds.iter().filter(|kind| kind.is_application).map(|kind| kind.created).sum();
        for packet in 0..packets.len() {
            if packets.kinds[packets.kind[packet] as usize].is_application
                && packets.drop_reason(packet).is_none()
            {
                delivered += 1;
                latency_s.push(
                    (packets.ended_ns[packet] - packets.created_ns[packet]) as f64
                        / NS_PER_S as f64,
                );
                hops += f64::from(packets.hops[packet]);
            }
        }
        if let Some(statistics) = output.statistics {
            let joined = Standing::first(&statistics, "first_joined_ns");
            let joined: Vec<u64> =
                joined.into_iter().map(|at| at.unwrap_or(3600 * NS_PER_S)).collect();
            joined_s = *joined.iter().max().unwrap() as f64 / NS_PER_S as f64;
        }
    }
    let n_delivered = f64::from(delivered);
    Kpis {
        delivered: n_delivered / sent as f64,
        latency_mean_s: latency_s.iter().sum::<f64>() / n_delivered,
        latency_p99_s: quantile(&latency_s, 0.99),
        hops: hops / n_delivered,
        joined_s,
    }
}

/// Figures of an hour: name, how to read it, half a unit of the last digit that the simulator's is stated with.
type Figure = (&'static str, fn(&Kpis) -> f64);

const FIGURES: [Figure; 5] = [
    ("lost (‰)", |kpis| 1000.0 * (1.0 - kpis.delivered)),
    ("latency, mean (s)", |kpis| kpis.latency_mean_s),
    ("latency, 99 % (s)", |kpis| kpis.latency_p99_s),
    ("hops", |kpis| kpis.hops),
    ("last mote joined (s)", |kpis| kpis.joined_s),
];

/// Of the simulator: motes; random links; how many runs; the mean over them of each figure, with half a unit of its last
/// digit. The last mote's joining is not known of 5 motes.
type Measured = (usize, bool, usize, &'static [(f64, f64)]);

#[rustfmt::skip]
const MEASURED: [Measured; 5] = [
    (5, false, 3, &[(0.0, 0.5), (0.63, 0.005), (1.7, 0.05), (1.18, 0.005)]),
    (10, false, 8, &[(0.2, 0.05), (0.61, 0.005), (1.6, 0.05), (1.15, 0.005), (268.0, 0.5)]),
    (50, false, 8, &[(1.1, 0.05), (1.05, 0.005), (3.0, 0.05), (1.82, 0.005), (756.0, 0.5)]),
    (10, true, 8, &[(3.0, 0.5), (1.34, 0.005), (4.8, 0.05), (1.55, 0.005), (315.0, 0.5)]),
    (50, true, 8, &[(3.1, 0.05), (2.03, 0.005), (7.1, 0.05), (2.27, 0.005), (1216.0, 0.5)]),
];

/// Runs of ours: 64 for the tables. The simulator's figures are of 8 runs, and scatter more than those of 32: more of ours make the
/// comparison hardly more exact (by 5 %).
fn n_seeds() -> u64 {
    if wants_whole_tables() { 64 } else { N_PAIRS }
}

/// The first `n_seeds` seeds.
fn hours(n: usize, random: bool, on: &[&str], n_seeds: u64) -> Vec<Kpis> {
    let config = format!("{SETTINGS}{}", compat(on));
    (0..n_seeds).into_par_iter().map(|seed| hour(n, random, &config, seed)).collect()
}

/// Fifty motes with all of the simulator's behaviour: both tests need them.
fn fifty(random: bool) -> &'static [Kpis] {
    static RUNS: [OnceLock<Vec<Kpis>>; 2] = [OnceLock::new(), OnceLock::new()];
    RUNS[usize::from(random)].get_or_init(|| hours(50, random, &COMPAT, n_seeds()))
}

#[test]
fn with_the_simulators_behaviour_a_standing_network_has_the_simulators_figures() {
    let mut group = Group::default();
    for (n, random, n_runs, measured) in MEASURED {
        let kpis =
            if n == 50 { fifty(random).to_vec() } else { hours(n, random, &COMPAT, n_seeds()) };
        let links = if random { "random" } else { "full" };
        for (&(name, read), &(value, rounding)) in FIGURES.iter().zip(measured) {
            let values: Vec<f64> = kpis.iter().map(read).collect();
            let what = format!("{n} motes, {links}: {name}");
            group.add(&what, &values, n_runs, mean, value, |values| {
                Comparison::of_means(values, value, rounding, n_runs)
            });
        }
    }
    println!("{group}");
    group.assert_agreement();
}

/// Runs of ours with and without a part of the simulator's behaviour, the same seeds.
const N_PAIRS: u64 = 32;

/// Of 32 pairs, chance puts so many or more on the side expected once in 950 times.
const LEAST_PAIRS: usize = 25;

/// What a part of the behaviour certainly moves when it is left out: random links or full ones, key, figure, and whether it
/// rises then.
const MOVED: [(bool, &str, &str, bool); 4] = [
    (false, "no_frame_overhead", "latency, mean (s)", true),
    (true, "no_frame_overhead", "latency, mean (s)", true),
    (true, "stale_rank", "hops", true),
    (false, "eb_rule", "last mote joined (s)", false),
];

#[test]
fn headers_cost_time_and_live_ranks_cost_hops() {
    let names: Vec<&str> = FIGURES.iter().map(|&(name, _)| name).collect();
    let mut table = format!(
        "| links | without | {} | lost, worst run (‰) |\n|---|---|---|---|---|---|---|---|\n",
        names.join(" | ")
    );
    let mut n_moved = 0;
    for random in [false, true] {
        let links = if random { "random" } else { "full" };
        let hours = |on: &[&str]| hours(50, random, on, N_PAIRS);
        let with = &fifty(random)[..N_PAIRS as usize];
        let mut cases = vec![("–", with.to_vec())];
        let is_asserted = |key: &str| MOVED.iter().any(|moved| (moved.0, moved.1) == (random, key));
        for key in COMPAT {
            if wants_whole_tables() || is_asserted(key) {
                cases.push((key, hours(&without(key))));
            }
        }
        if wants_whole_tables() {
            cases.push(("any", hours(&[])));
        }
        for (key, kpis) in &cases {
            write!(table, "| {links} | {key} ").unwrap();
            for (name, read) in FIGURES {
                let [values, before] =
                    [&kpis[..], with].map(|kpis| kpis.iter().map(read).collect::<Vec<_>>());
                let pairs = before.iter().zip(&values);
                let n_more = pairs.filter(|(before, value)| before < value).count();
                let (middle, digits) = (median(&values), digits(median(&values)));
                write!(table, "| {middle:.digits$} ({n_more}) ").unwrap();
                let is_expected = |moved: &&(bool, &str, &str, bool)| {
                    (moved.0, moved.1, moved.2) == (random, *key, name)
                };
                if let Some(&(.., rises)) = MOVED.iter().find(is_expected) {
                    let n_expected = if rises { n_more } else { N_PAIRS as usize - n_more };
                    assert!(LEAST_PAIRS <= n_expected, "{key}: {name} in {n_expected}");
                    n_moved += 1;
                }
            }
            let most = kpis.iter().map(FIGURES[0].1).reduce(f64::max).unwrap();
            writeln!(table, "| {most:.0} |").unwrap();
        }
    }
    println!("{table}");
    assert_eq!(n_moved, MOVED.len(), "{table}");
}
