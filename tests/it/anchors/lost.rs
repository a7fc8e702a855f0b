//! What fifty motes lose over random links, and by what: while the network forms, and after that.

use super::standing::{FROM_FILE, SETTINGS, random_links};
use super::{COMPAT, NS_PER_S, NetRecord, Standing, compat, wants_whole_tables};
use rayon::prelude::*;
use std::collections::BTreeMap;

const N_MOTES: usize = 50;

fn n_runs() -> u64 {
    if wants_whole_tables() { 32 } else { 16 }
}

/// Transmissions of a frame: one, and five more.
const N_ATTEMPTS: i32 = 6;
/// A frame that is dropped was first sent at most so many steps before (s).
const N_STEPS_BACK: usize = 8;

/// Counts of one phase, by what is counted.
type Counts = BTreeMap<String, f64>;

/// How likely a frame from one mote to the other is received, of a trace as [`random_links`] writes it.
fn receptions(trace: &str) -> Vec<Vec<f64>> {
    let mut receptions = vec![vec![0.0; N_MOTES]; N_MOTES];
    for row in trace.lines().skip(2) {
        let cells: Vec<&str> = row.split(',').collect();
        let mote = |cell: usize| cells[cell].parse::<usize>().expect("a mote");
        receptions[mote(1)][mote(2)] = cells[5].parse().expect("a reception");
    }
    receptions
}

/// The way from a mote along parents, itself first, to the root.
fn way(parents: &[u32], mote: usize) -> Vec<usize> {
    let mut way = vec![mote];
    while let Some(&parent) = parents.get(way[way.len() - 1]) {
        if parent as usize >= N_MOTES || N_MOTES < way.len() {
            break;
        }
        way.push(parent as usize);
    }
    way
}

/// In which words a link's reception is told.
fn class(reception: f64) -> &'static str {
    match reception {
        low if low < 0.5 => "max_retries, link below 50 %",
        middle if middle < 0.8 => "max_retries, link of 50 to 80 %",
        _ => "max_retries, link above 80 %",
    }
}

/// An hour of one network: until all motes were admitted at once, and after that.
fn hour(seed: u64) -> [Counts; 2] {
    let trace = random_links(N_MOTES, seed);
    let receptions = receptions(&trace);
    let config = format!("{FROM_FILE}{SETTINGS}{}", compat(&COMPAT));
    let (places, files) = (vec![(0.0, 0.0); N_MOTES], [("links.k7", trace)]);
    let mut network =
        Standing::start(&places, &config, seed, NS_PER_S, &[NetRecord::Packets], &files);
    let mut phases = [Counts::new(), Counts::new()];
    let (mut parents, mut has_formed) = (Vec::<Vec<u32>>::new(), false);
    let (mut created, mut dropped) = (vec![0.0; N_MOTES], vec![0.0; N_MOTES]);
    for _ in 0..3600 {
        let output = network.step(&[NetRecord::Statistics]);
        let statistics = output.statistics.expect("asked for");
        let column = |name: &str| Standing::column(&statistics, name).values.clone();
        let joined = output.motes.joined.as_ref().expect("motes join");
        has_formed |= (0..N_MOTES).all(|mote| joined.get(mote));
        let counts = &mut phases[usize::from(has_formed)];
        let mut count = |what: &str, n: f64| *counts.entry(what.to_owned()).or_default() += n;
        parents.push(output.motes.parent.clone());
        let now = &parents[parents.len() - 1];
        let (created_now, dropped_now) = (column("packets_created"), column("drops_max_retries"));
        for mote in 0..N_MOTES {
            let n_new = created_now[mote] - created[mote];
            let arrives: f64 = way(now, mote)
                .windows(2)
                .map(|hop| 1.0 - (1.0 - receptions[hop[0]][hop[1]]).powi(N_ATTEMPTS))
                .product();
            count("created", n_new);
            count("max_retries, expected by chance", n_new * (1.0 - arrives));
        }
        let packets = output.packets.expect("asked for");
        for packet in 0..packets.len() {
            let is_application = packets.kinds[packets.kind[packet] as usize].is_application;
            let Some(reason) = packets.drop_reason(packet).filter(|_| is_application) else {
                continue;
            };
            count(reason, 1.0);
            if reason != "max_retries" {
                continue;
            }
            // The first on the way that has dropped a frame in this step, and its parent when that was sent first.
            let way = way(now, packets.source[packet] as usize);
            let dropper = way.into_iter().find(|&mote| dropped[mote] < dropped_now[mote]);
            let before = &parents[parents.len().saturating_sub(1 + N_STEPS_BACK)];
            let link = dropper
                .filter(|&mote| before[mote] == now[mote])
                .and_then(|mote| receptions[mote].get(now[mote] as usize));
            count(link.map_or("max_retries, another parent", |&link| class(link)), 1.0);
        }
        (created, dropped) = (created_now, dropped_now);
    }
    phases
}

#[test]
fn once_all_have_joined_what_is_lost_over_random_links_is_lost_by_chance() {
    let hours: Vec<[Counts; 2]> = (0..n_runs()).into_par_iter().map(hour).collect();
    let mut phases = [Counts::new(), Counts::new()];
    for hour in &hours {
        for (sum, counts) in phases.iter_mut().zip(hour) {
            for (what, n) in counts {
                *sum.entry(what.clone()).or_default() += n;
            }
        }
    }
    let figure = |phase: usize, what: &str| phases[phase].get(what).copied().unwrap_or(0.0);
    println!("| what | until all have joined | after that |\n|---|---|---|");
    let names: std::collections::BTreeSet<&String> =
        phases.iter().flat_map(BTreeMap::keys).collect();
    for what in names {
        println!("| {what} | {:.0} | {:.0} |", figure(0, what), figure(1, what));
    }
    let [found, expected] =
        ["max_retries", "max_retries, expected by chance"].map(|what| figure(1, what));
    assert!(10.0 < expected, "{expected}: too few to tell anything");
    // Losses by chance are of a Poisson distribution: beyond three standard deviations for one choice of seeds in 370.
    assert!((found - expected).abs() < 3.0 * expected.sqrt(), "{found}, expected {expected}");
}
