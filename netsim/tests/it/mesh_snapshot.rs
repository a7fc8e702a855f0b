//! The full network saved at any slot and restored: it goes on as if it had never stopped. Steps of any length, seeds, and
//! what must not disturb what.

use crate::harness::STEP_NS;
use crate::model::scenario::{FUNCTIONS, RADIOS, Scenario, Spice};
use netsim::dice::Dice;
use netsim::mote::Mote;
use netsim::sim::Network;
use proto::ids::MoteId;
use proto::rng::Purpose;
use proto::side::{NetOutput, NetSimulator as _};

const SLOT_NS: u64 = 10_000_000;

/// Everything an output says.
fn assert_same(a: &NetOutput, b: &NetOutput, what: &str) {
    assert_eq!(a.time_ns, b.time_ns, "{what}");
    assert_eq!(a.deliveries, b.deliveries, "{what}");
    assert_eq!(a.motes, b.motes, "{what}");
    assert_eq!(a.formation, b.formation, "{what}");
    assert_eq!(a.packets, b.packets, "{what}");
    assert_eq!(a.capture, b.capture, "{what}");
    assert_eq!(a.statistics, b.statistics, "{what}");
    assert_eq!(a.schedule, b.schedule, "{what}");
    assert_eq!(a.heard_links, b.heard_links, "{what}");
}

/// Effects whose state must be saved as well: at some motes, for that the network forms all the same.
const BURDENS: &str = "[[mac.effect]]\nkind = \"processing-delay\"\ndelay_s = 0.2\nmotes = [1]\n\
    [[mac.effect]]\nkind = \"node-reboots\"\nmean_interval_s = 20\nmotes = [2]\n\
    [[mac.effect]]\nkind = \"duty-cycle-limit\"\nfraction = 0.02\nwindow_s = 2\nmotes = [1, 2]\n";

/// Every scheduling function over every radio.
fn scenarios(seconds: u64) -> impl Iterator<Item = Scenario> {
    FUNCTIONS.iter().enumerate().flat_map(move |(i, function)| {
        RADIOS.iter().enumerate().map(move |(k, radio)| {
            Scenario::draw(function, radio, Spice::ALL, 1000 + 10 * i as u64 + k as u64, seconds)
        })
    })
}

/// Every scheduling function in a secured network.
fn secured(seconds: u64) -> impl Iterator<Item = Scenario> {
    let of_functions = (2000..).zip(FUNCTIONS).map(move |(seed, function)| {
        Scenario::draw(function, RADIOS[0], Spice::NONE, seed, seconds)
    });
    // Secured frames have headers.
    let with_headers = of_functions.filter(|of| !of.config.contains("no_frame_overhead = true"));
    with_headers.map(|mut scenario| {
        scenario.config.push_str("[security]\n");
        scenario
    })
}

#[test]
fn restored_at_any_slot_and_continued_equals_never_having_stopped() {
    let mut n_midst = [0; 3];
    for mut scenario in scenarios(24).chain(secured(24)) {
        scenario.config.push_str(BURDENS);
        let mut dice = Dice::new(scenario.seed, Purpose::Scenario, MoteId(9));
        let mut network = scenario.network();
        let n_slots = scenario.end_ns / SLOT_NS;
        let mut saved_at: Vec<u64> = (0..4).map(|_| dice.below(n_slots)).collect();
        saved_at.sort_unstable();
        // A restored network runs beside the original until the next one is restored.
        let mut twin: Option<Network> = None;
        for slot in 0..n_slots {
            if saved_at.contains(&slot) {
                let saved = network.snapshot();
                if let Some(twin) = &twin {
                    assert!(twin.snapshot() == saved, "{slot}: {}", scenario.config);
                }
                let mut restored = Network::default();
                restored.restore(&saved).unwrap();
                assert!(restored.snapshot() == saved, "{slot}: {}", scenario.config);
                twin = Some(restored);
            }
            let (from_ns, until_ns) = (slot * SLOT_NS, (slot + 1) * SLOT_NS);
            let output = scenario.step_network(&mut network, from_ns, until_ns);
            let is_synced = output.motes.synced.as_ref().unwrap();
            let joined = output.motes.joined.as_ref().unwrap();
            if saved_at.contains(&slot) {
                n_midst[0] += usize::from(is_synced.count() != joined.count());
                n_midst[1] += usize::from(output.motes.queue_length.iter().any(|&n| n != 0));
                n_midst[2] += usize::from(output.formation.as_ref().unwrap().formed_ns.is_some());
            }
            if let Some(twin) = &mut twin {
                let again = scenario.step_network(twin, from_ns, until_ns);
                assert_same(&output, &again, &format!("slot {slot}\n{}", scenario.config));
            }
        }
        if let Some(twin) = twin {
            assert!(twin.snapshot() == network.snapshot(), "{}", scenario.config);
        }
    }
    // Amid joining, with frames waiting, and formed.
    assert!(n_midst.iter().all(|&n| 5 < n), "{n_midst:?}");
}

/// Every kind of traffic with a state of its own.
const TRAFFIC: &str = "[[app]]\nkind = \"poisson\"\nmean_interval_s = 3\n\
    [[app]]\nkind = \"event\"\nmean_interval_s = 4\nradius_m = 20\nn_packets = 3\nspacing_s = 0.3\n\
    [[app]]\nkind = \"coap\"\nperiod_s = 1\ninterval = \"exponential\"\nservers = \"random\"\n\
    [[app]]\nkind = \"download\"\nsize_bytes = 500\nblock_bytes = 32\n";

#[test]
fn traffic_saved_in_its_midst_goes_on_and_does_not_depend_on_the_length_of_steps() {
    let mut n_created = [0; 6];
    let open = (300..)
        .zip(FUNCTIONS.iter().take(4))
        .map(|(seed, function)| Scenario::draw(function, RADIOS[0], Spice::ALL, seed, 30));
    for mut scenario in open.chain(secured(30).take(2)) {
        scenario.config.push_str(TRAFFIC);
        let mut network = scenario.network();
        let mut parts = scenario.network();
        for period in 0..scenario.end_ns / STEP_NS {
            let (from_ns, until_ns) = (period * STEP_NS, (period + 1) * STEP_NS);
            let output = scenario.step_network(&mut network, from_ns, until_ns);
            let mut restored = Network::default();
            restored.restore(&parts.snapshot()).unwrap();
            parts = restored;
            let middle_ns = from_ns + 3 * SLOT_NS;
            scenario.step_network(&mut parts, from_ns, middle_ns);
            let again = scenario.step_network(&mut parts, middle_ns, until_ns);
            assert_eq!(output.statistics, again.statistics, "{period}\n{}", scenario.config);
            let kinds = output.packets.unwrap().kinds;
            assert_eq!(kinds, again.packets.unwrap().kinds, "{period}\n{}", scenario.config);
            if until_ns == scenario.end_ns {
                n_created.iter_mut().zip(kinds).for_each(|(n, kind)| *n += kind.created);
            }
        }
        // Jams that are over are forgotten at the beginning of a step.
        for network in [&mut network, &mut parts] {
            scenario.step_network(network, scenario.end_ns, scenario.end_ns + STEP_NS);
        }
        assert!(network.snapshot() == parts.snapshot(), "{}", scenario.config);
    }
    // Packets of applications, exchanges, downloads.
    assert!([n_created[0], n_created[4], n_created[5]].iter().all(|&n| 2 < n), "{n_created:?}");
}

#[test]
fn a_step_of_many_slots_equals_as_many_of_one() {
    for scenario in scenarios(20) {
        let mut whole = scenario.network();
        let mut parts = scenario.network();
        let mut dice = Dice::new(scenario.seed, Purpose::Scenario, MoteId(8));
        for period in 0..scenario.end_ns / STEP_NS {
            let (from_ns, until_ns) = (period * STEP_NS, (period + 1) * STEP_NS);
            let expected = scenario.step_network(&mut whole, from_ns, until_ns);
            let mut time_ns = from_ns;
            let mut got = None;
            let mut n_ended = 0;
            let mut capture = Vec::new();
            let mut n_heard = 0;
            while time_ns < until_ns {
                let next_ns = until_ns.min(time_ns + (1 + dice.below(4)) * SLOT_NS);
                let output = scenario.step_network(&mut parts, time_ns, next_ns);
                n_ended += output.packets.as_ref().unwrap().len();
                n_heard += output.deliveries.n_deliveries();
                capture.extend_from_slice(&output.capture);
                got = Some(output);
                time_ns = next_ns;
            }
            let got = got.unwrap();
            let what = format!("period {period}\n{}", scenario.config);
            assert_eq!(expected.capture[..], capture, "{what}");
            assert_eq!(expected.motes, got.motes, "{what}");
            assert_eq!(expected.formation, got.formation, "{what}");
            assert_eq!(expected.statistics, got.statistics, "{what}");
            assert_eq!(expected.schedule, got.schedule, "{what}");
            assert_eq!(expected.heard_links, got.heard_links, "{what}");
            assert_eq!(expected.packets.unwrap().len(), n_ended, "{what}");
            assert_eq!(expected.deliveries.n_deliveries(), n_heard, "{what}");
        }
        // Jams that are over are forgotten at the beginning of a step.
        for network in [&mut whole, &mut parts] {
            scenario.step_network(network, scenario.end_ns, scenario.end_ns + STEP_NS);
        }
        assert!(whole.snapshot() == parts.snapshot(), "{}", scenario.config);
    }
}

#[test]
fn the_same_seed_gives_the_same_run_and_another_one_another() {
    for scenario in scenarios(6) {
        let run = |scenario: &Scenario| {
            let mut network = scenario.network();
            for period in 0..scenario.end_ns / STEP_NS {
                scenario.step_network(&mut network, period * STEP_NS, (period + 1) * STEP_NS);
            }
            network.snapshot()
        };
        let first = run(&scenario);
        assert!(first == run(&scenario), "{}", scenario.config);
        let mut other = scenario.clone();
        other.seed += 1;
        assert!(first != run(&other), "{}", scenario.config);
    }
}

/// The motes as they are at the end, each control period one step. Without applications, which know how many motes there
/// are.
fn motes_at_the_end(scenario: &Scenario) -> Vec<Mote> {
    let mut mesh = scenario.mesh();
    for period in 0..scenario.end_ns / STEP_NS {
        let (from_ns, until_ns) = (period * STEP_NS, (period + 1) * STEP_NS);
        scenario.step(from_ns, until_ns, |input| mesh.step(input));
    }
    let mut motes = mesh.state().motes.clone();
    motes.iter_mut().for_each(|mote| mote.apps.clear());
    motes
}

#[test]
fn a_mote_out_of_everyones_reach_changes_nothing_for_the_others() {
    let mut n_compared = 0;
    for function in [FUNCTIONS[0], FUNCTIONS[1], FUNCTIONS[3], FUNCTIONS[4]] {
        for radio in &RADIOS[1..] {
            for seed in 0..4 {
                let scenario = Scenario::draw(function, radio, Spice::ALL, seed, 15);
                // Where the number of motes is part of what is configured, all are concerned.
                let config = &scenario.config;
                if config.contains("\"peers\"") || config.contains("broadcast-slotframe") {
                    continue;
                }
                if config.contains("destination = \"all\"") {
                    continue;
                }
                let alone = motes_at_the_end(&scenario);
                let mut with_hermit = motes_at_the_end(&scenario.with_hermit());
                with_hermit.pop();
                assert!(alone == with_hermit, "{config}");
                n_compared += 1;
            }
        }
    }
    assert!(15 < n_compared, "{n_compared}");
}

#[test]
fn an_effect_without_strength_changes_nothing() {
    for function in FUNCTIONS {
        for (radio, seed) in RADIOS.iter().zip(50..) {
            let scenario = Scenario::draw(function, radio, Spice::NONE, seed, 12);
            let alone = motes_at_the_end(&scenario);
            for effect in [
                "kind = \"shadowing\"\nsd_db = 0.0",
                "kind = \"system-gain\"\ngain_db = 0.0\n[[phy.effect]]\nkind = \"multipath\"\nsd_db = 0.0",
            ] {
                assert!(
                    motes_at_the_end(&scenario.with_effect(effect)) == alone,
                    "{}",
                    scenario.config
                );
            }
        }
    }
}
