use super::*;
use crate::wire::address::ALL_NODES;
use crate::wire::datagram::{SourceRoute, UdpRepr, Upper};
use line::{Line, datagram, down, mote};
use proptest::prelude::*;
use proto::ids::MoteId;
use proto::rng::Purpose;
use proto::time::{SimDuration, SimTime};
use proto::types::NS_PER_S;

mod line;

/// Room in frames for these tests: the 6TiSCH simulator's 90 bytes.
const ROOM: usize = 90;
const MODES: [Mode; 2] = [Mode::PerHopReassembly, Mode::FragmentForwarding];

fn lowpan(n: u32, config: Config) -> Lowpan {
    Lowpan::new(config, mote(n), n == 0, &mut Dice::new(3, Purpose::Lowpan, MoteId(n)))
}

/// The parts of a datagram of `payload` bytes from mote `from` to the root.
fn parts(from: u32, packet: u64, payload: usize) -> Vec<LowpanRepr> {
    let mut sender = lowpan(from, Config::default());
    sender.tag = packet as u16;
    sender
        .send(Arc::new(datagram(from, 0, packet, payload)), Some(mote(1)), ROOM)
        .unwrap()
        .collect()
}

fn fragment(received: &LowpanRepr) -> &Fragment {
    match received {
        LowpanRepr::Whole(_) => panic!("a part was expected"),
        LowpanRepr::First(part) | LowpanRepr::Next(part) => part,
    }
}

fn dropped(outcome: &LowpanAction) -> Option<DropReason> {
    match outcome {
        LowpanAction::Drop { reason, .. } => Some(*reason),
        _ => None,
    }
}

/// The simulator's numbers, with the short part in front and offsets of any size, are no fragments of RFC 4944: § 5.3 wants
/// offsets in units of 8 bytes, and sizes before compression. So the lengths are the vector's, the cuts the standard's.
#[test]
fn f1_datagrams_longer_than_a_frame_are_cut_at_multiples_of_8_bytes() {
    let mut sender = lowpan(5, Config::default());
    let hop = Some(mote(1));
    let headers = datagram(5, 0, 1, 0).compressed_len(mote(5), hop);
    let lengths = [45, 90, 91, 135, 180, 181, 270, 360].into_iter().chain((91..=811).step_by(90));
    for length in lengths {
        let payload = length - headers;
        let whole = Arc::new(datagram(5, 0, 1, payload));
        assert_eq!(whole.compressed_len(mote(5), hop), length);
        let sent: Vec<_> = sender.send(whole.clone(), hop, ROOM).unwrap().collect();
        if length <= 90 {
            assert_eq!(sent, [LowpanRepr::Whole(whole)]);
            continue;
        }
        let mut end = 0;
        for (i, frame) in sent.iter().enumerate() {
            let Fragment { size, offset, covers, .. } = *fragment(frame);
            assert_eq!(matches!(frame, LowpanRepr::First(_)), i == 0);
            assert_eq!(usize::from(size), 40 + 8 + payload);
            assert_eq!((offset, offset % 8), (end, 0));
            assert!(frame.buffer_len(mote(5), hop) <= ROOM);
            end += covers;
        }
        assert_eq!(usize::from(end), 48 + payload);
        // The first: 90 less its header of 4 and at most 23 of IPHC and UDP, for 48 of IPv6 and UDP: 104 of 111, so 56 of
        // payload. Others: 90 less 5, so 80; the last one 85.
        let rest = (payload - 56) - 5;
        assert_eq!(sent.len(), 1 + rest.div_ceil(80).max(1), "{length}");
    }
}

#[test]
fn f1_what_no_fragments_can_carry_is_refused() {
    let mut sender = lowpan(5, Config::default());
    let mut send = |payload, room| {
        let sent = sender.send(Arc::new(datagram(5, 0, 1, payload)), Some(mote(1)), room);
        sent.map(|parts| parts.len())
    };
    assert!(send(2047 - 48, ROOM).is_ok());
    assert_eq!(send(2048 - 48, ROOM), Err(DropReason::TooLarge));
    assert_eq!(send(200, 20), Err(DropReason::TooLarge));
}

#[test]
fn f2_a_datagram_that_loses_any_of_three_fragments_does_not_arrive() {
    for mode in MODES {
        for lost in 0..3 {
            let mut line = Line::new(3, Config { mode, ..Config::default() });
            line.send(2, datagram(2, 0, 1, 200));
            let mut sent = 0;
            line.run(20, |from, _| {
                sent += usize::from(from == 2);
                from == 2 && sent == lost + 1
            });
            assert_eq!((sent, line.motes[1].n_received), (3, 2), "{mode:?} {lost}");
            assert_eq!(line.delivered(), [], "{mode:?} {lost}");
            line.expire();
            assert!(!line.lost().is_empty(), "{mode:?} {lost}: nobody says so");
        }
    }
}

#[test]
fn f3_over_three_hops_two_fragments_take_6_slotframes_put_together_and_4_forwarded() {
    for (mode, slotframes) in MODES.into_iter().zip([6, 4]) {
        let mut line = Line::new(4, Config { mode, ..Config::default() });
        line.send(3, datagram(3, 0, 1, 120));
        assert_eq!(line.motes[3].queue.len(), 2);
        line.run(slotframes - 1, |_, _| false);
        assert_eq!(line.delivered(), []);
        line.run(1, |_, _| false);
        assert_eq!(line.delivered(), [(0, 1)]);
    }
}

#[test]
fn f4_of_ten_datagrams_as_many_are_under_way_as_there_is_room_for() {
    for limit in 1..=9 {
        for mode in MODES {
            let config =
                Config { mode, reassembly_buffers: limit, vrb_entries: limit, ..Config::default() };
            let (mut relay, mut root) = (lowpan(1, config), lowpan(0, config));
            let mut refused = Vec::new();
            for from in 11..21 {
                let first = &parts(from, u64::from(from), 200)[0];
                let mut outcome = relay.handle(mote(from), first, SimTime::START);
                if let LowpanAction::Route(datagram) = outcome {
                    outcome =
                        relay.forward(mote(from), first, datagram.into(), mote(0), SimTime::START);
                }
                refused.extend(dropped(&outcome));
                assert_eq!(root.handle(mote(from), first, SimTime::START), LowpanAction::Wait);
            }
            let (n, why) = match mode {
                Mode::PerHopReassembly => (relay.n_buffers(), DropReason::ReassemblyBufferFull),
                Mode::FragmentForwarding => (relay.n_vrb_entries(), DropReason::VrbTableFull),
            };
            assert_eq!(n, usize::from(limit));
            assert_eq!(refused, vec![why; 10 - usize::from(limit)]);
            assert_eq!(root.n_buffers(), 10);
        }
    }
}

#[test]
fn f5_after_60_s_a_datagram_is_given_up_by_the_clock_and_by_the_next_fragment() {
    let minute = 60 * NS_PER_S;
    for mode in MODES {
        let config = Config { mode, ..Config::default() };
        let begin = |relay: &mut Lowpan| {
            let all = parts(5, 1, 200);
            if let LowpanAction::Route(datagram) =
                relay.handle(mote(5), &all[0], SimTime::from_ns(7))
            {
                relay.forward(mote(5), &all[0], datagram.into(), mote(0), SimTime::from_ns(7));
            }
            assert_eq!(relay.poll_timeout(), Some(SimTime::from_ns(7 + minute)));
            assert_eq!(relay.n_buffers() + relay.n_vrb_entries(), 1);
            all
        };
        let expected = vec![(1, DropReason::ReassemblyTimeout)];

        let mut relay = lowpan(1, config);
        begin(&mut relay);
        assert_eq!(relay.handle_timeout(SimTime::from_ns(6 + minute)), []);
        assert_eq!(relay.handle_timeout(SimTime::from_ns(7 + minute)), expected);
        assert_eq!(relay.poll_timeout(), None);
        assert_eq!(relay.n_buffers() + relay.n_vrb_entries(), 0);

        let mut relay = lowpan(1, config);
        let all = begin(&mut relay);
        let outcome = relay.handle(mote(5), &all[1], SimTime::from_ns(7 + minute));
        match mode {
            Mode::PerHopReassembly => assert_eq!(outcome, LowpanAction::Wait),
            Mode::FragmentForwarding => assert_eq!(dropped(&outcome), Some(DropReason::NoVrbEntry)),
        }
        assert!(relay.poll_timeout().unwrap() <= SimTime::from_ns(7 + minute));
        assert_eq!(relay.handle_timeout(SimTime::from_ns(7 + minute)), expected);
    }
}

#[test]
fn f5_a_datagram_that_has_passed_whole_is_not_lost_when_its_way_is_forgotten() {
    let mut relay = lowpan(1, Config::default());
    for (i, received) in parts(5, 1, 200).iter().enumerate() {
        match relay.handle(mote(5), received, SimTime::START) {
            LowpanAction::Route(datagram) if i == 0 => {
                relay.forward(mote(5), received, datagram.into(), mote(0), SimTime::START);
            }
            LowpanAction::Forward { next_hop, .. } => assert_eq!(next_hop, mote(0)),
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(relay.n_vrb_entries(), 1);
    assert_eq!(relay.handle_timeout(SimTime::START + SimDuration::from_s(60)), []);
    assert_eq!(relay.n_vrb_entries(), 0);
}

#[test]
fn f6_tags_differ_from_hop_to_hop_and_grow_by_one_per_datagram() {
    let mut sender = lowpan(5, Config::default());
    let mut relay = lowpan(1, Config::default());
    // The least favourable beginning: both count alike. And both pass the end of the count.
    sender.tag = 65_533;
    relay.tag = 65_533;
    let mut tags = Vec::new();
    for packet in 0..5 {
        let whole = Arc::new(datagram(5, 0, packet, 200));
        for received in sender.send(whole, Some(mote(1)), ROOM).unwrap() {
            let outcome = match relay.handle(mote(5), &received, SimTime::START) {
                LowpanAction::Route(datagram) => {
                    relay.forward(mote(5), &received, datagram.into(), mote(0), SimTime::START)
                }
                outcome => outcome,
            };
            let LowpanAction::Forward { part: sent, .. } = outcome else { panic!("{outcome:?}") };
            tags.push((fragment(&received).tag, fragment(&sent).tag));
        }
    }
    tags.dedup();
    assert_eq!(tags, [(65_533, 65_534), (65_534, 65_535), (65_535, 0), (0, 1), (1, 2)]);
}

/// What a relay forwards, by offset, of a datagram in parts of which some come.
fn passed(config: Config, all: &[LowpanRepr], come: &[usize]) -> (Vec<u16>, Lowpan) {
    let mut relay = lowpan(1, config);
    let mut offsets = Vec::new();
    for &i in come {
        let outcome = match relay.handle(mote(5), &all[i], SimTime::START) {
            LowpanAction::Route(datagram) => {
                relay.forward(mote(5), &all[i], datagram.into(), mote(0), SimTime::START)
            }
            outcome => outcome,
        };
        if let LowpanAction::Forward { part: sent, .. } = outcome {
            offsets.push(fragment(&sent).offset);
        }
    }
    (offsets, relay)
}

#[test]
fn f7_ways_are_forgotten_as_the_policies_say() {
    let all = parts(5, 1, 300);
    assert_eq!(all.len(), 4);
    let offsets: Vec<u16> = all.iter().map(|received| fragment(received).offset).collect();
    let none = Config::default();
    let missing = Config { discard_after_missing: true, ..none };
    let last = Config { discard_after_last: true, ..none };
    let both = Config { discard_after_last: true, ..missing };

    for (config, n_entries) in [(none, 1), (missing, 1), (last, 0), (both, 0)] {
        let (sent, relay) = passed(config, &all, &[0, 1, 2, 3]);
        assert_eq!((sent, relay.n_vrb_entries()), (offsets.clone(), n_entries));
    }
    for (config, n_sent, n_entries) in [(none, 3, 1), (missing, 1, 0), (last, 3, 0), (both, 1, 0)] {
        let (sent, relay) = passed(config, &all, &[0, 2, 3]);
        assert_eq!((sent.len(), relay.n_vrb_entries()), (n_sent, n_entries), "{config:?}");
    }
    let mut relay = passed(missing, &all, &[0]).1;
    let outcome = relay.handle(mote(5), &all[2], SimTime::START);
    assert_eq!(dropped(&outcome), Some(DropReason::MissingFragment));
}

#[test]
fn f8_a_fragmented_datagram_with_a_source_route_reaches_its_end_and_nobody_else() {
    for mode in MODES {
        for payload in [40, 180] {
            let mut line = Line::new(3, Config { mode, ..Config::default() });
            line.send(0, down(2, 1, payload));
            line.run(20, |_, _| false);
            assert_eq!(line.delivered(), [(2, 1)], "{mode:?} {payload}");
            assert_eq!(line.lost(), []);
        }
    }
}

#[test]
fn what_arrives_is_what_was_sent_with_the_headers_of_the_last_hop() {
    for mode in MODES {
        let mut line = Line::new(5, Config { mode, ..Config::default() });
        let sent = datagram(4, 0, 1, 500);
        line.send(4, sent.clone());
        line.run(100, |_, _| false);
        let received = &line.motes[0].delivered;
        assert_eq!(received.len(), 1);
        assert_eq!(**received.first().unwrap(), Datagram { hop_limit: 61, ..sent });
    }
}

#[test]
fn parts_for_a_group_are_put_together_and_never_forwarded() {
    for mode in MODES {
        let mut receiver = lowpan(1, Config { mode, ..Config::default() });
        let group = Arc::new(Datagram { destination: ALL_NODES, ..datagram(5, 0, 1, 200) });
        let sent: Vec<_> =
            lowpan(5, Config::default()).send(group.clone(), None, ROOM).unwrap().collect();
        let (last, others) = sent.split_last().unwrap();
        for received in others {
            assert_eq!(receiver.handle(mote(5), received, SimTime::START), LowpanAction::Wait);
        }
        assert_eq!(receiver.handle(mote(5), last, SimTime::START), LowpanAction::Deliver(group));
    }
}

#[test]
fn rfc8930_6_parts_whose_first_has_not_come_are_dropped() {
    let all = parts(5, 1, 300);
    let (sent, relay) = passed(Config::default(), &all, &[1, 2, 3]);
    assert_eq!((sent, relay.n_vrb_entries()), (vec![], 0));
}

#[test]
fn rfc8930_6_a_first_part_that_comes_twice_is_forwarded_once() {
    let all = parts(5, 1, 300);
    let (sent, mut relay) = passed(Config::default(), &all, &[0, 0]);
    assert_eq!(sent, [0]);
    assert_eq!(
        dropped(&relay.handle(mote(5), &all[0], SimTime::START)),
        Some(DropReason::Duplicate)
    );
}

#[test]
fn rfc4944_5_3_datagrams_of_two_neighbours_with_one_tag_are_kept_apart() {
    let mut root = lowpan(0, Config::default());
    let (a, b) = (parts(5, 9, 200), parts(6, 9, 200));
    let outcomes: Vec<_> = (0..3)
        .flat_map(|i| [(5, &a[i]), (6, &b[i])])
        .map(|(from, received)| root.handle(mote(from), received, SimTime::START))
        .collect();
    assert_eq!(
        outcomes[..4],
        [LowpanAction::Wait, LowpanAction::Wait, LowpanAction::Wait, LowpanAction::Wait]
    );
    for (outcome, from) in outcomes[4..].iter().zip([5, 6]) {
        let LowpanAction::Deliver(datagram) = outcome else { panic!("{outcome:?}") };
        assert_eq!(datagram.source, mote(from).global());
    }
}

#[test]
fn rfc4944_5_3_a_part_that_overlaps_another_begins_the_datagram_anew() {
    let mut root = lowpan(0, Config::default());
    let all = parts(5, 1, 300);
    root.handle(mote(5), &all[0], SimTime::START);
    root.handle(mote(5), &all[1], SimTime::START);
    assert_eq!(
        dropped(&root.handle(mote(5), &all[1], SimTime::START)),
        Some(DropReason::Duplicate)
    );
    let LowpanRepr::Next(mut overlapping) = all[1].clone() else { panic!() };
    overlapping.covers -= 8;
    assert_eq!(
        root.handle(mote(5), &LowpanRepr::Next(overlapping), SimTime::START),
        LowpanAction::Wait
    );
    assert_eq!(root.poll_timeout(), Some(SimTime::START));
    assert_eq!(root.handle_timeout(SimTime::START), [(1, DropReason::FragmentOverlap)]);
    // The rest does not complete what was given up.
    assert_eq!(root.handle(mote(5), &all[2], SimTime::START), LowpanAction::Wait);
    assert_eq!(root.handle(mote(5), &all[3], SimTime::START), LowpanAction::Wait);
}

#[test]
fn a_neighbour_that_begins_anew_with_an_old_tag_is_not_mixed_up_with_before() {
    let all = parts(5, 1, 300);
    let mut again = parts(5, 2, 400);
    for received in &mut again {
        let (LowpanRepr::First(part) | LowpanRepr::Next(part)) = received else { panic!() };
        part.tag = 1;
    }
    let (_, mut relay) = passed(Config::default(), &all, &[0]);
    assert_eq!(
        dropped(&relay.handle(mote(5), &again[1], SimTime::START)),
        Some(DropReason::NoVrbEntry)
    );
    assert!(matches!(relay.handle(mote(5), &again[0], SimTime::START), LowpanAction::Route(_)));
    assert_eq!(relay.handle_timeout(SimTime::START), [(1, DropReason::FragmentOverlap)]);
}

#[test]
fn what_cannot_be_a_part_is_dropped() {
    let all = parts(5, 1, 300);
    let good = fragment(&all[1]);
    let mut root = lowpan(0, Config::default());
    for bad in [
        Fragment { covers: 0, ..good.clone() },
        Fragment { offset: good.offset + 4, ..good.clone() },
        Fragment { covers: good.covers - 4, ..good.clone() },
        Fragment { offset: 8 * (good.size / 8), covers: 80, ..good.clone() },
        Fragment { offset: 0, ..good.clone() },
        Fragment { size: 2048, ..good.clone() },
        Fragment { offset: 65_528, covers: 65_528, ..good.clone() },
    ] {
        let outcome = root.handle(mote(5), &LowpanRepr::Next(bad.clone()), SimTime::START);
        assert_eq!(dropped(&outcome), Some(DropReason::Malformed), "{bad:?}");
    }
    assert_eq!(root.n_buffers(), 0);
}

#[test]
fn rfc4944_5_3_a_mote_that_leaves_the_network_forgets_all_parts() {
    let mut relay = passed(Config::default(), &parts(5, 1, 300), &[0, 1]).1;
    // One for the relay itself, under another tag.
    let own = Arc::new(datagram(6, 1, 2, 200));
    let sent: Vec<_> =
        lowpan(6, Config::default()).send(own, Some(mote(1)), ROOM).unwrap().collect();
    assert_eq!(relay.handle(mote(6), &sent[0], SimTime::START), LowpanAction::Wait);
    let mut lost = relay.clear(DropReason::Desynchronised);
    lost.sort_unstable();
    assert_eq!(lost, [(1, DropReason::Desynchronised), (2, DropReason::Desynchronised)]);
    assert_eq!((relay.n_buffers(), relay.n_vrb_entries(), relay.poll_timeout()), (0, 0, None));
}

proptest! {
    #[test]
    fn parts_in_any_order_and_any_number_make_the_datagram_once_all_are_there(
        payload in 150usize..1900,
        order in prop::collection::vec(any::<prop::sample::Index>(), 0..120),
    ) {
        let all = parts(5, 1, payload);
        let mut receiver = lowpan(1, Config { mode: Mode::PerHopReassembly, ..Config::default() });
        let mut there = vec![false; all.len()];
        for index in order {
            let i = index.index(all.len());
            let outcome = receiver.handle(mote(5), &all[i], SimTime::START);
            if there[i] {
                prop_assert_eq!(dropped(&outcome), Some(DropReason::Duplicate));
                continue;
            }
            there[i] = true;
            if there.iter().all(|&is_there| is_there) {
                let LowpanAction::Deliver(datagram) = outcome else { panic!("{outcome:?}") };
                prop_assert_eq!(&*datagram, &line::datagram(5, 0, 1, payload));
                prop_assert_eq!(receiver.n_buffers(), 0);
                there.fill(false);
            } else {
                prop_assert_eq!(outcome, LowpanAction::Wait);
            }
        }
        prop_assert_eq!(receiver.n_buffers(), usize::from(there.contains(&true)));
    }

    #[test]
    fn every_datagram_is_delivered_or_somebody_says_why_not(
        forwards in any::<bool>(),
        buffers in 1u16..4,
        payloads in prop::collection::vec((1u32..5, 0usize..600), 1..12),
        losses in prop::collection::vec(0u8..10, 400),
        missing in any::<bool>(),
        last in any::<bool>(),
    ) {
        let config = Config {
            mode: MODES[usize::from(forwards)],
            reassembly_buffers: buffers,
            vrb_entries: buffers,
            discard_after_missing: missing,
            discard_after_last: last,
            ..Config::default()
        };
        let mut line = Line::new(5, config);
        for (packet, &(end, payload)) in (1..).zip(&payloads) {
            if packet % 3 == 0 {
                line.send(0, down(end, packet, payload));
            } else {
                line.send(end, datagram(end, 0, packet, payload));
            }
        }
        let mut losses = losses.into_iter();
        let mut lost_on_air = Vec::new();
        line.run(400, |_, sent| {
            let is_lost = losses.next() == Some(0);
            if is_lost {
                lost_on_air.push(sent.datagram().packet);
            }
            is_lost
        });
        line.expire();
        let delivered: Vec<u64> = line.delivered().iter().map(|&(_, packet)| packet).collect();
        let lost: Vec<u64> = line.lost().iter().map(|&(packet, _)| packet).collect();
        for packet in 1..=payloads.len() as u64 {
            let times = delivered.iter().filter(|&&one| one == packet).count();
            let is_lost = lost.contains(&packet) || lost_on_air.contains(&packet);
            prop_assert_eq!(times, usize::from(!is_lost), "packet {}", packet);
        }
        for mote in &line.motes {
            prop_assert_eq!(mote.lowpan.n_buffers() + mote.lowpan.n_vrb_entries(), 0);
            prop_assert_eq!(mote.lowpan.poll_timeout(), None);
        }
    }

    #[test]
    fn a_copy_from_bytes_goes_on_the_same(n in 0usize..4, forwards in any::<bool>()) {
        let all = parts(5, 1, 300);
        let config = Config { mode: MODES[usize::from(forwards)], ..Config::default() };
        let come: Vec<usize> = (0..n).collect();
        let (_, mut relay) = passed(config, &all, &come);
        let bytes = postcard::to_allocvec(&relay).unwrap();
        let mut copy: Lowpan = postcard::from_bytes(&bytes).unwrap();
        prop_assert_eq!(&copy, &relay);
        for received in &all[n..] {
            let outcome = relay.handle(mote(5), received, SimTime::from_ns(1));
            prop_assert_eq!(copy.handle(mote(5), received, SimTime::from_ns(1)), outcome);
        }
        prop_assert_eq!(copy, relay);
    }
}
