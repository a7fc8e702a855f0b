//! How long a network takes to form under BotNet's scheduling function, with BotNet's behaviour switched on.

use super::{COMPAT, Group, NS_PER_S, NetRecord, SLOT_NS, Standing, compat};
use rayon::prelude::*;
use std::fmt::Write as _;
use tests::statistics::{Comparison, Measured, deviation, mean, median};

/// BotNet's settings that are not behaviour.
const SETTINGS: &str = "[phy]\npropagation = 'full'\nrssi_dbm = -10.0\ninterference = { kind = 'table' }\n\
     [sf]\nkind = 'rrsf'\n\
     [mac]\nbeacon_wait_s = 0.1\nneighbours_to_wait = 2\nscan_dwell_s = 0.01\n\
     [rpl]\ndao_period_s = 60.0\ndao_ack = false\ndao_delay_s = 0.0\n\
     [swarm]\ntransport = 'none'\n";

/// Slotframes that BotNet's runs were given.
const MOST_SLOTFRAMES: u64 = 20_000;

/// Slotframes of N slots until every mote has joined and its own slot has come; those given, if that is too few.
fn slotframes(n: usize, config: &str, seed: u64) -> f64 {
    let places: Vec<(f64, f64)> = (0..n).map(|mote| (0.0, 2.0 * mote as f64)).collect();
    let slots = n as u64;
    let step_ns = 10 * NS_PER_S;
    let mut network = Standing::start(&places, config, seed, step_ns, &[], &[]);
    for _ in 0..MOST_SLOTFRAMES * slots * SLOT_NS / step_ns {
        let statistics = network.step(&[NetRecord::Statistics]).statistics.expect("asked for");
        let ready = Standing::first(&statistics, "first_ready_ns");
        let Some(ready) = ready.into_iter().collect::<Option<Vec<u64>>>() else { continue };
        let own_slots = (0..slots).zip(&ready).map(|(mote, ready_ns)| {
            let asn = ready_ns / SLOT_NS + 1;
            asn + (mote + slots - asn % slots) % slots
        });
        return own_slots.max().expect("motes") as f64 / n as f64;
    }
    MOST_SLOTFRAMES as f64
}

fn all(n: usize, n_seeds: u64, config: &str) -> Vec<f64> {
    (0..n_seeds).into_par_iter().map(|seed| slotframes(n, config, seed)).collect()
}

/// Of BotNet: motes; median, mean, standard deviation, least and greatest (slotframes); of how many runs.
const MEASURED: [(usize, f64, f64, f64, [f64; 2], usize); 4] = [
    (5, 141.0, 138.0, 52.0, [43.0, 223.0], 16),
    (10, 196.0, 225.0, 119.0, [84.0, 573.0], 16),
    (25, 419.0, 440.0, 154.0, [262.0, 924.0], 16),
    (50, 2480.0, 2365.0, 498.0, [1686.0, 2996.0], 11),
];

/// Runs of ours: a greater network takes longer to simulate and scatters less.
const fn n_seeds(n: usize) -> u64 {
    if n < 50 { 256 } else { 64 }
}

#[test]
fn with_botnets_behaviour_a_network_forms_in_botnets_time() {
    let config = format!("{SETTINGS}{}", compat(&COMPAT));
    let mut group = Group::default();
    let mut table = String::from(
        "| N | ours: median, mean ± sd, range | BotNet's |\n\
         |---|---|---|\n",
    );
    for (n, of_median, of_mean, of_deviation, [least, greatest], n_runs) in MEASURED {
        let times = all(n, n_seeds(n), &config);
        let range = [f64::min, f64::max].map(|of| times.iter().copied().reduce(of).unwrap());
        writeln!(
            table,
            "| {n} | {:.0}, {:.0} ± {:.0}, {:.0}–{:.0} | {of_median}, {of_mean} ± {of_deviation}, {least}–{greatest} |",
            median(&times),
            mean(&times),
            deviation(&times),
            range[0],
            range[1],
        )
        .unwrap();
        let measured = Measured { value: of_median, rounding: 0.5, share: 0.5, n_runs };
        group.add(&format!("{n} motes: median"), &times, n_runs, median, of_median, |values| {
            Comparison::of(values, measured)
        });
        group.add(&format!("{n} motes: mean"), &times, n_runs, mean, of_mean, |values| {
            Comparison::of_means(values, of_mean, 0.5, n_runs)
        });
    }
    println!("{table}\n{group}");
    group.assert_agreement();
}
