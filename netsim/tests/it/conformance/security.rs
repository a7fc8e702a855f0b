//! Secured networks: RFC 8180, § 4.6; RFC 9031, § 5.

use super::bench::{Bench, EAGER, FULL, LINE, OnAir, SLOT_NS, What, line, trace};
use netsim::wire::Eui64;
use netsim::wire::frame::{Content, FrameRepr};
use netsim::wire::security::FrameSecurity::{K1, K2, Unsecured};
use physics::asn::Asn;
use physics::timing::Airtime;
use proto::ids::MoteId;
use proto::time::SimDuration;

const SECURED: &str = "[security]\n";

/// CoAP between neighbours: the two ends of a join exchange on the link.
fn is_join(what: &What) -> bool {
    *what == What::Udp(5683)
}

#[test]
fn rfc8180_4_6_beacons_have_k1_and_what_admitted_motes_send_has_k2() {
    let mut bench = Bench::new(&line(3), &format!("{LINE}{EAGER}{SECURED}"));
    bench.form();
    bench.run(10_000);
    let joined_ns = |mote: u32| bench.mote(mote as usize).tally.first_joined.unwrap();
    let mut n = [0; 3];
    for frame in &bench.frames {
        let is_admitted = joined_ns(frame.source) < frame.asn * SimDuration::from_ns(SLOT_NS);
        let expected = match frame.what {
            What::Beacon { .. } => K1,
            _ if !is_admitted => Unsecured,
            _ if is_join(&frame.what) => continue,
            _ => K2,
        };
        assert_eq!(frame.security, expected, "{frame:?}");
        n[expected as usize] += 1;
        if let Some(ack) = frame.ack_security {
            assert_eq!(ack, frame.security, "{frame:?}");
        }
    }
    assert!(2 <= n[0] && 20 < n[1] && 20 < n[2], "{n:?}");
}

#[test]
fn rfc9031_5_join_messages_are_unsecured_between_pledge_and_proxy_and_secured_beyond() {
    let mut bench = Bench::new(&line(3), &format!("{LINE}{EAGER}{SECURED}"));
    bench.form();
    let exchange: Vec<&OnAir> = bench.frames.iter().filter(|frame| is_join(&frame.what)).collect();
    for (source, destination, security) in
        [(2, 1, Unsecured), (1, 0, K2), (0, 1, K2), (1, 2, Unsecured)]
    {
        let of_way = |frame: &&&OnAir| {
            frame.source == source
                && frame.destination == Some(destination)
                && bench.mote(1).tally.first_joined.unwrap()
                    < frame.asn * SimDuration::from_ns(SLOT_NS)
        };
        let securities: Vec<_> =
            exchange.iter().filter(of_way).map(|frame| frame.security).collect();
        assert!(!securities.is_empty(), "{source} to {destination}");
        assert!(securities.iter().all(|&found| found == security), "{source}: {securities:?}");
    }
}

#[test]
fn a_mote_takes_what_it_has_the_key_for_and_motes_with_keys_exempt_join_traffic() {
    let mut bench = Bench::new(&line(2), &format!("{FULL}{EAGER}{SECURED}"));
    bench.run_until(1, 20_000, |bench| bench.mote(1).mac.is_synced());
    let settings = bench.mesh.settings().clone();
    let frame = |security, destination: Option<u32>| FrameRepr {
        source: Eui64::of_mote(MoteId(9)),
        destination: destination.map(MoteId).map(Eui64::of_mote),
        sequence: 0,
        ack_request: destination.is_some(),
        pending: false,
        security,
        slots: None,
        blacklist: None,
        content: Content::KeepAlive,
    };
    let (root, pledge) = (bench.mote(0), bench.mote(1));
    assert!(root.joined && !pledge.joined);
    let beacon = root.beacon(&settings, Asn(7), [0, 0]);
    assert_eq!(beacon.security, K1);
    for mote in [root, pledge] {
        assert!(mote.takes(&settings, &beacon));
        let has_keys = mote.joined;
        for destination in [None, Some(0)] {
            assert_eq!(mote.takes(&settings, &frame(K2, destination)), has_keys);
        }
        assert!(mote.takes(&settings, &frame(Unsecured, Some(0))), "exempt");
        assert_eq!(mote.takes(&settings, &frame(Unsecured, None)), !has_keys);
    }
}

#[test]
fn a_secured_frame_is_dropped_by_a_mote_without_keys() {
    // The root is heard and hears nothing: mote 1 is never admitted.
    let cells = "[sf]\nkind = \"static\"\nslotframe_slots = 10\nminimal_cell_slots = 10\n\
        [[sf.cell]]\nslot = 3\nfrom = 1\nto = 0\n[rpl]\ndio_interval_min = 10\n";
    let config = format!("{EAGER}{cells}{SECURED}");
    let mut bench = Bench::over_trace(2, trace(2, &[(0, 0, 1, 1.0)]), &config);
    bench.run_until(1, 200_000, |bench| bench.mote(1).mac.is_synced());
    let (synced_asn, dropped) = (bench.asn, bench.mote(1).tally.n_insecure);
    bench.run(10_000);
    assert!(bench.mote(1).mac.is_synced() && !bench.mote(1).joined);
    let said = bench.sent(0, |what| matches!(what, What::Rpl(_)));
    let n = said.iter().filter(|frame| synced_asn <= frame.asn).count() as u64;
    assert!(2 <= n, "{n}");
    assert_eq!(bench.mote(1).tally.n_insecure - dropped, n);
    assert!(bench.mote(1).rpl.parent().is_none() && bench.mote(0).tally.n_insecure == 0);
}

/// Fragments on the air when mote 1 sends a payload to the root, and the lengths of all frames of it.
fn frames_of(payload_bytes: usize, config: &str) -> Vec<(bool, usize)> {
    let mut bench = Bench::new(&line(2), &format!("{FULL}{EAGER}{config}"));
    bench.form();
    bench.frames.clear();
    bench.send(1, 0, payload_bytes);
    bench.run(3_000);
    let is_data = |what: &What| matches!(what, What::Fragment(_) | What::Udp(61_616 | 61_617));
    let mut frames = bench.sent(1, is_data);
    frames.dedup_by_key(|frame| frame.sequence);
    frames.iter().map(|frame| (matches!(frame.what, What::Fragment(_)), frame.psdu_bytes)).collect()
}

#[test]
fn six_bytes_less_fit_a_frame() {
    let least = frames_of(1, "");
    let [(false, headers)] = least[..] else { panic!("{least:?}") };
    let most = 127 + 1 - headers;
    assert_eq!(frames_of(most, ""), [(false, 127)]);
    assert_eq!(frames_of(most - 6, SECURED), [(false, 127)]);
    let parts = frames_of(most - 5, SECURED);
    assert_eq!(parts.len(), 2, "{parts:?}");
    assert!(parts.iter().all(|&(is_part, bytes)| is_part && bytes <= 127), "{parts:?}");
}

#[test]
fn secured_acknowledgments_keep_the_radio_on_for_six_bytes_more() {
    let radio_on_ns = |bench: &Bench| {
        let mut usage = bench.mote(1).tally.usage;
        let with = usage.radio_on(SimDuration::from_ns(SLOT_NS), 19, &Airtime::O_QPSK_2450);
        let acks = usage.secured_acks_sent + usage.secured_acks_received;
        (usage.secured_acks_sent, usage.secured_acks_received) = (0, 0);
        (acks, with - usage.radio_on(SimDuration::from_ns(SLOT_NS), 19, &Airtime::O_QPSK_2450))
    };
    let mut bench = Bench::new(&line(2), &format!("{FULL}{EAGER}{SECURED}"));
    bench.form();
    bench.run(20_000);
    let (acks, longer_ns) = radio_on_ns(&bench);
    let unsecured = bench.frames.iter().filter(|frame| frame.ack_security == Some(Unsecured));
    let of_frames = bench.frames.iter().filter(|frame| frame.answered).count();
    assert_eq!(acks as usize, of_frames - unsecured.count(), "all were heard");
    assert!(3 < acks, "{acks}");
    assert_eq!(longer_ns, SimDuration::from_ns(acks * 6 * 32_000));
    let mut bench = Bench::new(&line(2), &format!("{FULL}{EAGER}"));
    bench.form();
    assert_eq!(radio_on_ns(&bench), (0, SimDuration::ZERO));
}

#[test]
fn without_admission_motes_have_both_keys_beforehand() {
    let config = format!("{FULL}{EAGER}[join]\nsecure = false\n{SECURED}");
    let mut bench = Bench::new(&line(2), &config);
    bench.form();
    assert!(bench.frames.iter().all(|frame| frame.security != Unsecured));
    assert!(bench.ended_joins.is_empty());
}
