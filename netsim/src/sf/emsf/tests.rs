//! How many cells it wants, and what it asks for.

use super::*;
use crate::sf::msf::tests::harness::Network;
use crate::sf::msf::tests::{negotiated, requests};
use crate::sf::testing::{built, read};

#[test]
fn quantiles_of_the_poisson_distribution_are_those_of_its_tables() {
    // P(X <= n) for mean 1: 0.3679, 0.7358, 0.9197, 0.9810, 0.9963.
    assert_eq!(poisson_quantile(1.0, 0.5, 99), 1);
    assert_eq!(poisson_quantile(1.0, 0.9, 99), 2);
    assert_eq!(poisson_quantile(1.0, 0.95, 99), 3);
    assert_eq!(poisson_quantile(1.0, 0.99, 99), 4);
    // Mean 10: P(X <= 14) = 0.9165, P(X <= 13) = 0.8645.
    assert_eq!(poisson_quantile(10.0, 0.9, 99), 14);
    assert_eq!(poisson_quantile(0.0, 0.9999, 99), 0);
    assert_eq!(poisson_quantile(0.1, 0.9, 99), 0);
    assert_eq!(poisson_quantile(1000.0, 0.9, 99), 99, "no more than slots");
}

#[test]
fn the_rate_is_frames_per_slotframe_and_all_missing_cells_are_asked_for_at_once() {
    let config = MsfConfig::default();
    let judge = |used, own, least| Forecast { quantile: 0.9 }.judge(&config, used, own, least);
    // A cell that was always used: one frame a slotframe, for which two cells suffice in 92 of 100.
    assert_eq!(judge(100, 1, 1), (1, 0));
    // Two that were: two frames, four cells (0.947).
    assert_eq!(judge(100, 2, 1), (2, 0));
    // Three, a third of them used: one frame, for which two suffice. That may be chance; a fifth is too little.
    assert_eq!(judge(33, 3, 1), (0, 0));
    assert_eq!(judge(20, 3, 1), (0, 1));
    assert_eq!(judge(0, 3, 1), (0, 2), "one to transmit in stays");
    assert_eq!(judge(0, 3, 0), (0, 3));
    // Without a negotiated cell the autonomous one serves half a frame a slotframe.
    assert_eq!(judge(50, 0, 0), (0, 0));
    assert_eq!(judge(100, 0, 0), (2, 0));
}

#[test]
fn the_upper_limit_of_use_is_no_key_of_it_and_the_others_have_their_ranges() {
    let (_, problems, _) = read("kind = \"emsf\"\nlim_numcellsused_high = 5", 5);
    assert_eq!(problems.len(), 1, "{problems:?}");
    assert!(problems[0].contains("does not apply with kind = \"emsf\""), "{problems:?}");
    let (_, problems, _) = read("kind = \"emsf\"\nmax_num_cells = 20", 5);
    assert_eq!(
        problems,
        [
            "netsim.sf.lim_numcellsused_low: must be at most max_num_cells, 20, got 25 (nearest valid: 20)"
        ]
    );
    let (_, problems, _) = read("kind = \"emsf\"\nquantile = 0.3", 5);
    assert_eq!(
        problems,
        ["netsim.sf.quantile: must be from 0.5 to 0.9999, got 0.3 (nearest valid: 0.5)"]
    );
    let config = built("kind = \"emsf\"\nmax_num_cells = 30\nquantile = 0.75", 5);
    let config = config.as_kind::<EmsfConfig>().unwrap();
    assert_eq!((config.msf.max_num_cells, config.quantile), (30, 0.75));
    assert_eq!(config.msf.slotframe_slots, 101);
    assert_eq!(FIELDS.len(), MsfConfig::SPEC.fields.len());
    assert!(FIELDS.iter().all(|field| field.key != LIMIT.0));
    assert_eq!(MsfConfig::SPEC.fields[LIMIT.1].key, LIMIT.0);
}

fn network(n_per_slotframe: u32, seed: u64) -> Network<Forecast> {
    let mut network =
        Network::with_policy(2, MsfConfig::default(), seed, Forecast { quantile: 0.9 });
    network.set_parent(1, Some(0));
    network.run_until(|network| network.is_ready(1));
    for _ in 0..300 {
        (0..n_per_slotframe).for_each(|_| network.send_data(1, 0));
        network.run(101);
    }
    network
}

#[test]
fn three_frames_a_slotframe_get_cells_on_which_both_ends_agree_and_that_go_several_at_once() {
    let mut network = network(3, 1);
    // P(X <= 5) = 0.916 for mean 3. More where the frames that waited were sent.
    let (tx, rx) = negotiated(&network, 1, 0);
    assert!((5..=9).contains(&tx) && rx == 0, "{tx} {rx}");
    network.run_until(|network| network.is_quiet());
    network.assert_agreement();
    // With the traffic gone all but one go, several at a time.
    let before = requests(&network, 1, "DELETE");
    network.run(300 * 101);
    assert_eq!(negotiated(&network, 1, 0), (1, 0));
    assert!(requests(&network, 1, "DELETE") - before < usize::from(tx - 1));
    network.assert_agreement();
}

#[test]
fn the_same_seed_gives_the_same_schedules() {
    let schedules = |seed: u64| {
        let network = network(2, seed);
        network.motes.iter().map(|mote| mote.schedule.clone()).collect::<Vec<_>>()
    };
    assert!(schedules(1) == schedules(1));
    assert!(schedules(1) != schedules(2));
}
