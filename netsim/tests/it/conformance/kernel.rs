//! K4 to K8 and A1 to A3: time, seeds, refusals, addresses.

use super::bench::{Bench, EAGER, FULL, LINE, SLOT_NS, line, set_up};
use crate::harness::text;
use netsim::catalogue::Catalogue;
use physics::asn::Asn;

#[test]
fn k4_a_step_ends_at_the_slot_it_was_told() {
    let mut bench = Bench::new(&line(3), &format!("{FULL}{EAGER}"));
    for asn in [1, 7, 100, 101, 12_345] {
        assert_eq!(bench.run_to(Asn(asn)).time_ns, asn * SLOT_NS);
        assert_eq!(bench.mesh.state().asn, Asn(asn));
        assert!(bench.frames.iter().all(|frame| frame.asn < Asn(asn)));
    }
}

#[test]
fn k5_slotframes_one_by_one_or_all_at_once_end_in_the_same_slot_and_state() {
    for slots in [100, 101] {
        let sf = format!("[sf]\nkind = \"minimal\"\nslotframe_slots = {slots}\n");
        let config = format!("{FULL}{EAGER}{sf}");
        for n_slotframes in [100, 200, 1000] {
            let mut whole = Bench::new(&line(2), &config);
            whole.run(n_slotframes * slots);
            let mut in_parts = Bench::new(&line(2), &config);
            for _ in 0..n_slotframes {
                in_parts.run(slots);
            }
            assert_eq!(in_parts.asn, Asn(n_slotframes * slots));
            assert_eq!(whole.mesh.state(), in_parts.mesh.state());
            assert_eq!(whole.capture, in_parts.capture);
        }
    }
}

#[test]
fn k7_the_same_seed_gives_the_same_bytes_and_another_seed_others() {
    let config = format!(
        "[phy]\npropagation = \"experimental-randomness\"\nredraw = \"frame\"\n{EAGER}[sf]\nkind = \"msf\"\n"
    );
    let run = |seed: u64| {
        let mut bench = Bench::seeded(&line(4), &config, seed);
        bench.run(40_000);
        (bench.capture, postcard_of(&bench.mesh))
    };
    let first = [1, 10, 100].map(run);
    assert!(first.iter().all(|(capture, _)| 10_000 < capture.len()));
    for (seed, first) in [1, 10, 100].into_iter().zip(&first) {
        assert_eq!(&run(seed), first, "{seed}");
    }
    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
        assert_ne!(first[a].0, first[b].0);
        assert_ne!(first[a].1, first[b].1);
    }
}

/// The state as words: every field of every layer.
fn postcard_of(mesh: &netsim::mesh::network::Mesh) -> String {
    format!("{:?}", mesh.state())
}

/// The problems of a configuration for three motes.
fn refused(config: &str) -> String {
    match netsim::config::read(&set_up(3, config, 1), Catalogue::built_in()) {
        Ok(_) => panic!("accepted: {config}"),
        Err(problems) => text(&problems),
    }
}

#[test]
fn k8_keys_that_are_missing_or_unknown_and_values_of_a_wrong_type_are_refused_by_name() {
    assert!(netsim::config::read(&set_up(3, FULL, 1), Catalogue::built_in()).is_ok());
    let missing = refused("[sf]\nkind = \"static\"\n");
    assert!(missing.contains("netsim.sf.slotframe_slots"), "{missing}");
    let unknown = refused("[mac]\nebb_period_s = 1\n");
    assert!(unknown.contains("netsim.mac.ebb_period_s"), "{unknown}");
    let wrong = refused("[mac]\nqueue_frames = \"dummy\"\n");
    assert!(wrong.contains("netsim.mac.queue_frames"), "{wrong}");
}

#[test]
fn a1_the_root_has_the_addresses_of_mote_0() {
    let mut bench = Bench::new(&line(2), FULL);
    bench.run(1);
    let root = bench.mote(0);
    assert_eq!(root.address.to_string(), "02-00-00-00-00-01-00-00");
    assert_eq!(root.address.link_local().to_string(), "fe80::1:0");
    assert_eq!(root.rpl.address().unwrap().to_string(), "fd00::1:0");
}

#[test]
fn a2_a_mote_has_a_global_address_while_it_is_in_a_dodag() {
    let mut bench = Bench::new(&line(2), &format!("{LINE}{EAGER}"));
    bench.run(1);
    assert_eq!(bench.mote(1).address.to_string(), "02-00-00-00-00-00-00-01");
    assert_eq!(bench.mote(1).address.link_local().to_string(), "fe80::1");
    assert_eq!(bench.mote(1).rpl.address(), None);
    bench.form();
    assert_eq!(bench.mote(1).rpl.address().unwrap().to_string(), "fd00::1");
    bench.states.x_m[1] = 1000.0;
    bench.run_until(101, 10_000, |bench| bench.mote(1).mac.is_scanning());
    assert_eq!(bench.mote(1).rpl.address(), None);
}

#[test]
fn a3_an_address_that_is_given_is_used_as_it_is() {
    let config = format!("eui64 = [\"01-23-45-67-89-ab-cd-ef\"]\n{FULL}");
    let bench = Bench::new(&line(2), &config);
    assert_eq!(bench.mote(0).address.octets(), [0x01, 0x23, 0x45, 0x67, 0x89, 0xab, 0xcd, 0xef]);
    assert_eq!(bench.mote(1).address.to_string(), "02-00-00-00-00-00-00-01");
}

#[test]
fn a4_an_address_given_twice_is_refused() {
    let listed = |last: u8| {
        format!("eui64 = [\"02-00-00-00-00-00-00-10\", \"02-00-00-00-00-00-00-{last:02x}\"]\n")
    };
    // Mote 2 would be ..-02 by default.
    assert!(refused(&listed(2)).contains("must not have the same address"));
    assert!(netsim::config::read(&set_up(3, &listed(0x20), 1), Catalogue::built_in()).is_ok());
}
