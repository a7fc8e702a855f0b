//! Traffic between motes, which turns round at the root or at a common ancestor: RFC 6550, § 11.2.

use super::bench::{Bench, EAGER, Ended, LINE, SLOT_NS, line};

const APP: &str = "[[app]]\nkind = \"periodic\"\nperiod_s = 30.0\npayload_bytes = 20\n\
                   destination = \"peers\"\n";
const FUNCTIONS: [&str; 4] = ["minimal", "msf", "orchestra", "rrsf"];
const MODES: [&str; 2] = ["non-storing", "storing"];

/// Slots in a time (s).
const fn slots(duration_s: u64) -> u64 {
    duration_s * 1_000_000_000 / SLOT_NS
}

#[test]
fn rfc6550_11_2_on_a_perfect_line_motes_reach_each_other_under_every_function_and_mode() {
    for function in FUNCTIONS {
        for mode in MODES {
            for seed in [1, 2] {
                let what = format!("{function}, {mode}, seed {seed}");
                let config = format!(
                    "{LINE}{EAGER}[sf]\nkind = \"{function}\"\n[rpl]\nmode = \"{mode}\"\n{APP}"
                );
                let mut bench = Bench::seeded(&line(12), &config, seed);
                bench.form();
                // Cells follow the traffic.
                bench.run(slots(60));
                let settled_ns = bench.asn * SLOT_NS;
                bench.run(slots(1800));
                let of_then: Vec<&Ended> =
                    bench.ended.iter().filter(|ended| settled_ns < ended.created_ns).collect();
                assert!(600 < of_then.len(), "{what}: {}", of_then.len());
                let lost: Vec<_> = of_then.iter().filter(|ended| ended.lost.is_some()).collect();
                assert!(lost.is_empty(), "{what}: {} of {}: {lost:#?}", lost.len(), of_then.len());
            }
        }
    }
}
