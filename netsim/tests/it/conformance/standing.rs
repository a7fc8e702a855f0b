//! Networks that stand still, over links that lose nothing.

use super::bench::Bench;
use netsim::mac::tsch::State;
use proto::types::MoteOrder;

/// Motes on a grid, 10 m apart, mote 0 in a corner.
fn grid(columns: usize, rows: usize) -> Vec<(f64, f64)> {
    let place = |mote: usize| (10.0 * (mote % columns) as f64, 10.0 * (mote / columns) as f64);
    (0..columns * rows).map(place).collect()
}

/// All hear their eight neighbours, and report once a minute.
fn orchestra(max_drift_ppm: u32, more: &str) -> String {
    format!(
        "[phy]\npropagation = \"unit-disk\"\nradius_m = 15.0\n[sf]\nkind = \"orchestra\"\n\
         [mac]\nmax_drift_ppm = {max_drift_ppm}\n{more}[[app]]\nkind = \"periodic\"\n\
         period_s = 60.0\npayload_bytes = 40\n"
    )
}

/// Forms a network and runs it for an hour: how often synchronisation was lost, and what did not arrive.
fn an_hour(places: &[(f64, f64)], config: &str, seed: u64) -> (u64, Vec<String>) {
    let mut bench = Bench::seeded(places, config, seed);
    bench.form();
    let n_lost = |bench: &Bench| -> u64 {
        (0..places.len()).map(|mote| bench.mote(mote).tally.n_desynchronised).sum()
    };
    let before = n_lost(&bench);
    bench.ended.clear();
    for _ in 0..360 {
        bench.run(1000);
        bench.frames.clear();
        bench.capture.clear();
    }
    let synced = |mote: usize| matches!(bench.mote(mote).mac.state(), State::Synced { .. });
    assert!((0..places.len()).all(synced), "seed {seed}");
    assert!(40 * places.len() < bench.ended.len(), "{}", bench.ended.len());
    let lost = bench.ended.iter().filter_map(|ended| ended.lost.clone()).collect();
    (n_lost(&bench) - before, lost)
}

#[test]
fn orchestra_keeps_everybody_synchronised_over_links_that_lose_nothing() {
    for max_drift_ppm in [30, 5] {
        for (places, seeds) in [(grid(10, 5), 1..=5), (grid(10, 10), 1..=3)] {
            for seed in seeds {
                let (n_lost, lost) = an_hour(&places, &orchestra(max_drift_ppm, ""), seed);
                assert_eq!(n_lost, 0, "{max_drift_ppm} ppm, seed {seed}");
                // Frames in shared cells meet others: one packet in 200 at most is lost to that, or to the queue behind it.
                let crowd = ["max_retries", "txqueue_full"];
                assert!(lost.iter().all(|reason| crowd.contains(&reason.as_str())), "{lost:?}");
                assert!(lost.len() < places.len() * 60 / 200, "{max_drift_ppm} ppm, seed {seed}");
            }
        }
    }
}

#[test]
fn a_root_that_was_off_for_two_minutes_has_its_motes_back_within_five() {
    for function in ["minimal", "msf", "rrsf", "orchestra"] {
        for seed in 1..=3 {
            let config = orchestra(30, "").replace("\"orchestra\"", &format!("\"{function}\""));
            let places = grid(5, 4);
            let mut bench = Bench::seeded(&places, &config, seed);
            bench.form();
            bench.run(60_000);
            bench.order(MoteOrder::Kill(0));
            bench.run(12_000);
            bench.order(MoteOrder::Revive(0));
            // Part of the DODAG that the root has begun anew, which has a new version, and known to it.
            let are_back = |bench: &Bench| {
                let version = bench.mote(0).rpl.version();
                let is_back = |mote: usize| {
                    bench.mote(mote).ready && bench.mote(mote).rpl.version() == version
                };
                (0..20).all(is_back) && bench.mote(0).rpl.routes().len() == 19
            };
            bench.run_until(100, 30_000, are_back);
            let n_lost: u64 = (0..20).map(|mote| bench.mote(mote).tally.n_desynchronised).sum();
            assert_eq!(n_lost, 0, "{function}, seed {seed}");
        }
    }
}
