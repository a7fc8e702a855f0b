//! Traffic between motes, which turns round at the root or at a common ancestor: RFC 6550, § 11.2.

use super::bench::{Bench, EAGER, Ended, LINE, SLOT_NS, line};
use proto::time::{SimDuration, SimTime};

const APP: &str = "[[app]]\nkind = \"periodic\"\nperiod_s = 30.0\npayload_bytes = 20\n\
                   destination = \"peers\"\n";
const FUNCTIONS: [&str; 8] =
    ["minimal", "msf", "llsf", "emsf", "orchestra", "alice", "rrsf", "sotdma"];
const MODES: [&str; 2] = ["non-storing", "storing"];

/// Slots in a time (s).
const fn slots(duration_s: u64) -> u64 {
    duration_s * 1_000_000_000 / SLOT_NS
}

/// Twelve motes: the root between two arms, the longer of which has a branch. Traffic turns round at the root and below it.
fn tree() -> Vec<(f64, f64)> {
    let trunk = (0..6).map(|mote| (10.0 * f64::from(mote), 0.0));
    let branch = (0..3).map(|mote| (20.0, 14.0 + 10.0 * f64::from(mote)));
    let other_arm = (1..4).map(|mote| (-10.0 * f64::from(mote), 0.0));
    trunk.chain(branch).chain(other_arm).collect()
}

/// So many retries that no frame is lost to others in a shared cell: what is lost then was lost by routing.
const PATIENT: &str = "max_retries = 15\n";

/// Under every scheduling function and mode all packets arrive that motes at `places` send each other, a minute after the
/// network has formed.
fn all_arrive(places: &[(f64, f64)]) {
    for function in FUNCTIONS {
        // ALICE has cells of parents and children, who know of each other in storing mode only.
        let modes = if function == "alice" { &MODES[1..] } else { &MODES };
        for mode in modes {
            for seed in [1, 2] {
                let what = format!("{function}, {mode}, seed {seed}");
                let config = format!(
                    "{LINE}{EAGER}{PATIENT}[sf]\nkind = \"{function}\"\n[rpl]\nmode = \"{mode}\"\n{APP}"
                );
                let mut bench = Bench::seeded(places, &config, seed);
                bench.form();
                // Cells follow the traffic.
                bench.run(slots(60));
                let settled_ns = bench.asn * SimDuration::from_ns(SLOT_NS);
                bench.run(slots(1800));
                let of_then: Vec<&Ended> = bench
                    .ended
                    .iter()
                    .filter(|ended| settled_ns < SimTime::from_ns(ended.created_ns))
                    .collect();
                assert!(600 < of_then.len(), "{what}: {}", of_then.len());
                let lost: Vec<_> = of_then.iter().filter(|ended| ended.lost.is_some()).collect();
                assert!(lost.is_empty(), "{what}: {} of {}: {lost:#?}", lost.len(), of_then.len());
            }
        }
    }
}

#[test]
fn rfc6550_11_2_on_a_perfect_line_motes_reach_each_other_under_every_function_and_mode() {
    all_arrive(&line(12));
}

#[test]
fn rfc6550_11_2_on_a_tree_whose_traffic_turns_round_above_the_ends_motes_reach_each_other() {
    all_arrive(&tree());
}
