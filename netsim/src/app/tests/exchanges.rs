//! CoAP exchanges and downloads between a root and motes, message by message.

use super::*;
use coap::{Coap, Servers, Settings};
use download::Download;
use exchange::Timers;
use proto::ids::MoteId;
use proto::types::PacketPurpose;

/// Those of RFC 7252, § 4.8.
pub(super) const TIMERS: Timers =
    Timers { least_ns: 2 * NS_PER_S, most_ns: 3 * NS_PER_S, max_retransmit: 4 };

fn coap(servers: Servers) -> Spec {
    let settings = Settings {
        servers,
        period_ns: 10 * NS_PER_S,
        is_poisson: false,
        response_bytes: 16,
        timers: TIMERS,
    };
    Spec { machine: Machine::Coap(Coap::new(settings)) }
}

fn download(size_bytes: u32, szx: u8) -> Spec {
    let settings = download::Settings { after_ns: 0, size_bytes, szx, timers: TIMERS };
    Spec { machine: Machine::Download(Download::new(settings, Some(vec![MoteId(1)]))) }
}

fn message(packet: &Packet) -> CoapRepr {
    CoapRepr::parse(&packet.payload()).unwrap()
}

fn to(packet: &Packet) -> u32 {
    match packet.destination {
        Destination::Mote(mote) => mote.0,
        Destination::Root => panic!("CoAP is for a mote"),
    }
}

/// Gives a packet of mote `from` to an application. Returns what it sends.
fn give(
    app: &mut App,
    from: u32,
    packet: &Packet,
    now_ns: u64,
    world: &mut World,
) -> Option<Packet> {
    match app.machine().handle_message(MoteId(from), 1, &message(packet), &mut world.at(now_ns)) {
        Heard::NotMine => panic!("nobody takes {packet:?}"),
        Heard::Taken(answer) => answer,
    }
}

#[test]
fn rfc7252_5_2_1_the_response_is_in_the_acknowledgment_and_ends_the_exchange() {
    let spec = coap(Servers::InTurn);
    let (mut root, mut mote) = (app(&spec, 0, true, 3), app(&spec, 1, false, 3));
    let mut world = World::of(0);
    root.set_ready(true, &mut world.at(0));
    mote.set_ready(true, &mut world.at(0));
    assert_eq!(mote.poll_timeout(), None);
    let request = root.handle_timeout(&mut world.at(10 * NS_PER_S)).unwrap();
    assert_eq!(to(&request), 1);
    let get = message(&request);
    assert_eq!((get.kind, get.code), (Type::Confirmable, Code::GET));
    let response = give(&mut mote, 0, &request, 11 * NS_PER_S, &mut world).unwrap();
    let content = message(&response);
    assert!(content.answers(get.message_id, get.token));
    assert_eq!((content.code, content.payload.len()), (Code::CONTENT, 16));
    assert_eq!(give(&mut root, 1, &response, 12 * NS_PER_S, &mut world), None);
    let [ended] = &world.packets.take_ended()[..] else { panic!("one exchange") };
    assert_eq!((ended.ended_ns - ended.packet.created_ns, ended.lost), (2 * NS_PER_S, None));
    // The same again belongs to nothing.
    let again = root.machine().handle_message(MoteId(1), 1, &content, &mut world.at(13 * NS_PER_S));
    assert_eq!(again, Heard::NotMine);
    // Then the other one, and mote 1 again.
    let at = [20, 30].map(|at_s| {
        let request = root.handle_timeout(&mut world.at(at_s * NS_PER_S)).unwrap();
        let mut asked = app(&spec, to(&request), false, 3);
        asked.set_ready(true, &mut world.at(0));
        let response = give(&mut asked, 0, &request, at_s * NS_PER_S, &mut world).unwrap();
        give(&mut root, to(&request), &response, at_s * NS_PER_S, &mut world);
        to(&request)
    });
    assert_eq!(at, [2, 1]);
    assert_eq!(root.counters(), Counters { requests: 3, ..Counters::default() });
}

/// RFC 7252, 4.2 and 4.8: after t, 3t, 7t and 15t come the same octets again, and after 31t the client gives up; 2 s ≤ t ≤ 3 s.
#[test]
fn rfc7252_4_2_timeouts_double_and_after_four_retransmissions_the_client_gives_up() {
    let mut firsts = Vec::new();
    for mote in 1..50 {
        let mut root = app(&coap(Servers::One(MoteId(mote))), 0, true, 50);
        let mut world = World::of(0);
        root.machine().reseed(u64::from(mote));
        root.set_ready(true, &mut world.at(0));
        let begin_ns = 10 * NS_PER_S;
        let request = root.handle_timeout(&mut world.at(begin_ns)).unwrap();
        let mut sent_ns = Vec::new();
        let mut ended = Vec::new();
        while ended.is_empty() {
            let due_ns = root.poll_timeout().unwrap();
            if let Some(packet) = root.handle_timeout(&mut world.at(due_ns)) {
                assert_eq!(packet.payload(), request.payload());
                sent_ns.push(due_ns - begin_ns);
            }
            ended = world.packets.take_ended();
        }
        let timeout_ns = sent_ns[0];
        assert!((2 * NS_PER_S..=3 * NS_PER_S).contains(&timeout_ns));
        assert_eq!(sent_ns, [1, 3, 7, 15].map(|n| n * timeout_ns));
        assert_eq!(ended[0].lost, Some(DropReason::MaxRetries));
        assert_eq!(ended[0].ended_ns - begin_ns, 31 * timeout_ns);
        // MAX_TRANSMIT_WAIT.
        assert!(ended[0].ended_ns - begin_ns <= TIMERS.max_transmit_wait_ns());
        assert_eq!((root.counters().requests, root.counters().retransmissions), (1, 4));
        firsts.push(timeout_ns);
    }
    assert_eq!(TIMERS.max_transmit_wait_ns(), 93 * NS_PER_S);
    // Uniform from 2 s to 3 s: the mean of 49 has a standard error of 0.041 s.
    let mean_s = firsts.iter().sum::<u64>() as f64 / 49e9;
    assert!((mean_s - 2.5).abs() < 0.124, "{mean_s}");
}

#[test]
fn rfc7252_4_7_a_mote_has_one_open_exchange_and_message_ids_are_never_shared() {
    let spec = coap(Servers::InTurn);
    let clients = [0, 1].map(|number| {
        let mut client =
            App::new(&spec, &Host { app: number, n_apps: 2, ..host(0, true, 3) }).unwrap();
        let mut world = World::of(0);
        client.set_ready(true, &mut world.at(0));
        let packets = run(&mut client, 45 * NS_PER_S, &mut world);
        let mut seen: Vec<(u32, u16, Vec<u8>)> = packets
            .iter()
            .map(|packet| (to(packet), message(packet)))
            .map(|(to, message)| (to, message.message_id, message.token.bytes().to_vec()))
            .collect();
        seen.dedup();
        seen.sort_unstable();
        seen.dedup();
        // At 10 s and 20 s; then both wait for answers.
        assert_eq!(seen.len(), 2);
        seen
    });
    let mut ids: Vec<u16> = clients.iter().flatten().map(|(_, id, _)| *id).collect();
    let mut tokens: Vec<&[u8]> = clients.iter().flatten().map(|(.., token)| &token[..]).collect();
    ids.sort_unstable();
    ids.dedup();
    tokens.sort_unstable();
    tokens.dedup();
    assert_eq!((ids.len(), tokens.len()), (4, 4));
}

/// A root and a mote whose every message takes `hop_ns`. Messages for which `is_lost` holds do not arrive. Returns what was sent.
fn transfer(
    spec: &Spec,
    world: &mut World,
    hop_ns: u64,
    until_ns: u64,
    mut is_lost: impl FnMut(&Packet) -> bool,
) -> (Vec<Packet>, [App; 2]) {
    let mut apps = [app(spec, 0, true, 2), app(spec, 1, false, 2)];
    for app in &mut apps {
        app.set_ready(true, &mut world.at(0));
    }
    let mut flying: std::collections::VecDeque<(u64, usize, Packet)> = [].into();
    let mut sent = Vec::new();
    loop {
        let arrives_ns = flying.front().map(|(at_ns, ..)| *at_ns);
        let due_ns = apps.iter().filter_map(App::poll_timeout).min();
        let Some(now_ns) = [arrives_ns, due_ns].into_iter().flatten().min() else { break };
        if until_ns < now_ns {
            break;
        }
        let mut send = |packet: Option<Packet>, from: usize| {
            let Some(packet) = packet else { return };
            sent.push(packet.clone());
            if !is_lost(&packet) {
                flying.push_back((now_ns + hop_ns, from, packet));
            }
        };
        for (from, app) in apps.iter_mut().enumerate() {
            send(app.handle_timeout(&mut world.at(now_ns)), from);
        }
        if let Some((_, from, packet)) = flying.pop_front_if(|(at_ns, ..)| *at_ns <= now_ns) {
            let other = 1 - from;
            let app = apps[other].machine();
            let heard = app.handle_message(
                MoteId(from as u32),
                1,
                &message(&packet),
                &mut world.at(now_ns),
            );
            if let Heard::Taken(Some(answer)) = heard {
                sent.push(answer.clone());
                if !is_lost(&answer) {
                    flying.push_back((now_ns + hop_ns, other, answer));
                }
            }
        }
    }
    (sent, apps)
}

/// N = ⌈S/b⌉ exchanges that take two hops each; the mote requests the first block as soon as it is triggered.
#[test]
fn rfc7959_a_download_takes_as_many_round_trips_as_it_has_blocks() {
    let hop_ns = NS_PER_S / 10;
    for (size_bytes, szx) in
        [(1, 0), (16, 0), (17, 0), (1000, 2), (1024, 2), (5000, 6), (100_000, 3)]
    {
        let mut world = World::of(0);
        let (sent, apps) =
            transfer(&download(size_bytes, szx), &mut world, hop_ns, u64::MAX, |_| false);
        let n_blocks = size_bytes.div_ceil(16 << szx);
        let [ended] = &world.packets.take_ended()[..] else { panic!("one download") };
        let took_ns = ended.ended_ns - ended.packet.created_ns;
        assert_eq!(took_ns, 2 * hop_ns * u64::from(n_blocks));
        assert_eq!((ended.lost, ended.packet.bytes), (None, size_bytes));
        // Two messages of the trigger.
        assert_eq!(sent.len() as u32, 2 + 2 * n_blocks);
        let counters = apps[1].counters();
        assert_eq!((counters.blocks, counters.block_retransmissions), (n_blocks.into(), 0));
        let payload: usize = sent.iter().map(|packet| message(packet).payload.len()).sum();
        assert_eq!(payload as u32, size_bytes);
        let last = message(sent.last().unwrap());
        assert_eq!(last.block2, Some(Block { number: n_blocks - 1, more: false, szx }));
    }
}

#[test]
fn lost_blocks_are_requested_again_and_the_download_completes() {
    let mut world = World::of(0);
    let mut n = 0;
    let (sent, apps) = transfer(&download(2000, 2), &mut world, NS_PER_S / 10, u64::MAX, |_| {
        n += 1;
        n % 5 == 4
    });
    let [ended] = &world.packets.take_ended()[..] else { panic!("one download") };
    assert_eq!(ended.lost, None);
    let counters = apps[1].counters();
    assert_eq!(counters.blocks, 32);
    // Each loss of a request or a response costs one more request.
    let n_requests = sent.iter().filter(|packet| message(packet).code == Code::GET).count() as u64;
    assert_eq!(n_requests, counters.blocks + counters.block_retransmissions);
    assert!(10 < counters.block_retransmissions);
}

#[test]
fn a_download_whose_way_is_cut_fails_and_the_root_goes_on() {
    let mut world = World::of(0);
    let is_late = |packet: &Packet| {
        let message = message(packet);
        message.path.as_deref() == Some("f0")
            && message.block2.is_some_and(|block| 10 <= block.number)
    };
    let (_, mut apps) = transfer(&download(2000, 2), &mut world, NS_PER_S / 10, u64::MAX, is_late);
    let [ended] = &world.packets.take_ended()[..] else { panic!("one download") };
    assert_eq!(ended.lost, Some(DropReason::MaxRetries));
    assert_eq!((apps[1].counters().blocks, apps[1].counters().block_retransmissions), (11, 4));
    assert_eq!(apps.each_mut().map(|app| app.poll_timeout()), [None, None]);
}

#[test]
fn a_trigger_that_nobody_answers_is_a_download_that_failed() {
    let mut world = World::of(0);
    let (sent, _) = transfer(&download(2000, 2), &mut world, NS_PER_S / 10, u64::MAX, |_| true);
    assert_eq!(sent.len(), 5);
    let [ended] = &world.packets.take_ended()[..] else { panic!("one download") };
    assert_eq!(ended.lost, Some(DropReason::MaxRetries));
}

/// A request and a response are lost with probability p each, independently. Then an attempt fails with q = 1 − (1 − p)², and an
/// exchange of up to five attempts (RFC 7252, 4.2) with q⁵. It takes (1 − q⁵)/(1 − q) transmissions in the mean. Of the requests
/// that arrive, a fraction 1 − p, all but the first are duplicates; some request arrives with probability 1 − p⁵. The k-th
/// retransmission, k = 0 … 4, follows after (2^k − 1) t with t = 2.5 s in the mean.
#[test]
fn rfc7252_4_2_losses_retransmissions_duplicates_and_round_trips_are_those_of_independent_trials() {
    let (p, n) = (0.3_f64, 4000_u32);
    let hop_ns = NS_PER_S / 20;
    // Longer than MAX_TRANSMIT_WAIT: no exchange waits for another.
    let period_ns = 100 * NS_PER_S;
    let settings = Settings {
        servers: Servers::One(MoteId(1)),
        period_ns,
        is_poisson: false,
        response_bytes: 16,
        timers: TIMERS,
    };
    let spec = Spec { machine: Machine::Coap(Coap::new(settings)) };
    let mut world = World::of(0);
    let draws = proto::rng::Draws::new(11, Purpose::Traffic);
    let mut n_messages = 0;
    let until_ns = u64::from(n) * period_ns + period_ns - 1;
    let (_, apps) = transfer(&spec, &mut world, hop_ns, until_ns, |_| {
        n_messages += 1;
        proto::rng::uniform(draws.words(0, 0, n_messages)[0]) < p
    });
    let ended = world.packets.take_ended();
    assert_eq!(ended.len() as u32, n);
    let n = f64::from(n);
    let q = 1.0 - (1.0 - p) * (1.0 - p);
    let power = |x: f64, n: u32| (0..n).fold(1.0, |product, _| product * x);
    let fails = power(q, 5);
    let failed = ended.iter().filter(|one| one.lost.is_some()).count() as f64;
    // Four standard errors of each mean, those of counts from their variances.
    let within = |measured: f64, expected: f64, deviation: f64| {
        let error = 4.0 * deviation / n.sqrt();
        assert!((measured - expected).abs() < error, "{measured} {expected} ± {error}");
    };
    within(failed / n, fails, (fails * (1.0 - fails)).sqrt());
    let transmissions = (1.0 - fails) / (1.0 - q);
    // At most 4, 4 and 15 · 3 s: half of each range bounds the deviation.
    let counters = apps.each_ref().map(App::counters);
    within(counters[0].retransmissions as f64 / n, transmissions - 1.0, 2.0);
    let duplicates = transmissions * (1.0 - p) - (1.0 - power(p, 5));
    within(counters[1].duplicates as f64 / n, duplicates, 2.0);
    let succeeded = ended.iter().filter(|one| one.lost.is_none());
    let round_trips_s: Vec<f64> =
        succeeded.map(|one| (one.ended_ns - one.packet.created_ns) as f64 / 1e9).collect();
    let mean_s = round_trips_s.iter().sum::<f64>() / round_trips_s.len() as f64;
    let waits_s = |k: u32| 2.5 * (power(2.0, k) - 1.0);
    let expected_s =
        (0..5).map(|k| power(q, k) * (1.0 - q) * waits_s(k)).sum::<f64>() / (1.0 - fails);
    within(mean_s, expected_s + 2.0 * hop_ns as f64 / 1e9, 11.0);
}

/// RFC 7252, 4.5 and 4.8.2: a message ID that comes again within EXCHANGE_LIFETIME, 247 s, is answered with the same octets, and
/// counted as a duplicate. After that it is another request.
#[test]
fn rfc7252_4_5_a_server_acts_upon_a_request_once() {
    assert_eq!(TIMERS.exchange_lifetime_ns(), 247 * NS_PER_S);
    let spec = coap(Servers::InTurn);
    let mut world = World::of(1);
    let mut root = app(&spec, 0, true, 2);
    root.set_ready(true, &mut world.at(0));
    let request = root.handle_timeout(&mut world.at(10 * NS_PER_S)).unwrap();
    let mut mote = app(&spec, 1, false, 2);
    mote.set_ready(true, &mut world.at(0));
    let [first, again, later] = [10, 256, 257].map(|at_s| {
        let answer = give(&mut mote, 0, &request, at_s * NS_PER_S, &mut world).unwrap();
        (answer.payload(), mote.counters().duplicates)
    });
    assert_eq!((first.1, again.1, later.1), (0, 1, 1));
    assert_eq!((&first.0, &first.0), (&again.0, &later.0));
}

/// A trigger is not idempotent: its duplicate does not begin a second download.
#[test]
fn a_duplicate_of_a_trigger_begins_no_second_download() {
    let spec = download(16, 0);
    let mut world = World::of(1);
    let (sent, [_, mut mote]) = transfer(&spec, &mut world, NS_PER_S / 10, u64::MAX, |_| false);
    assert_eq!(world.packets.take_ended().len(), 1);
    assert_eq!(message(&sent[0]).code, Code::POST);
    let answer = give(&mut mote, 0, &sent[0], 5 * NS_PER_S, &mut world);
    assert_eq!(message(&answer.unwrap()).code, Code::CHANGED);
    assert_eq!((mote.poll_timeout(), mote.counters().block_duplicates), (None, 1));
}

/// The root gives up the trigger: the download has failed, from the first transmission on. The trigger reaches the mote later.
#[test]
fn a_trigger_that_arrives_after_it_was_given_up_counts_no_second_download() {
    let spec = download(16, 0);
    let mut world = World::of(0);
    let (sent, [mut root, mut mote]) =
        transfer(&spec, &mut world, NS_PER_S / 10, u64::MAX, |_| true);
    let [ended] = &world.packets.take_ended()[..] else { panic!("one download") };
    let waited_ns = ended.ended_ns - ended.packet.created_ns;
    assert!((62 * NS_PER_S..=93 * NS_PER_S).contains(&waited_ns));

    let later_ns = 100 * NS_PER_S;
    give(&mut mote, 0, &sent[0], later_ns, &mut world).unwrap();
    let get = mote.handle_timeout(&mut world.at(later_ns)).unwrap();
    let block = give(&mut root, 1, &get, later_ns, &mut world).unwrap();
    assert_eq!(give(&mut mote, 0, &block, later_ns, &mut world), None);
    assert_eq!((mote.poll_timeout(), world.packets.take_ended()), (None, vec![]));
    assert_eq!((world.packets.created(PacketPurpose::Download), world.packets.late()), (1, 1));
}

/// The mote has begun and nothing that it sends arrives: both ends give up, and it is one download that failed.
#[test]
fn a_download_that_both_ends_give_up_has_failed_once() {
    let mut world = World::of(0);
    let is_from_mote = |packet: &Packet| message(packet).code != Code::POST;
    let (_, apps) = transfer(&download(16, 0), &mut world, NS_PER_S / 10, u64::MAX, is_from_mote);
    let [ended] = &world.packets.take_ended()[..] else { panic!("one download") };
    assert_eq!(
        (ended.packet.created_ns, ended.lost),
        (NS_PER_S / 10, Some(DropReason::MaxRetries))
    );
    assert_eq!(apps[1].counters().block_retransmissions, 4);
}

/// A reboot of the root while the mote downloads, of the root while it triggers, and of the mote: none begins a second download.
#[test]
fn a_reboot_of_either_end_begins_no_second_download() {
    let reboot = |app: &mut App, now_ns: u64, world: &mut World| {
        app.set_ready(false, &mut world.at(now_ns));
        app.machine().reset(&mut world.at(now_ns));
        app.set_ready(true, &mut world.at(now_ns));
    };
    let spec = download(2000, 2);
    let hop_ns = NS_PER_S / 10;
    // The second time the root has not heard of the mote yet.
    for (until_ns, is_triggered_again) in [(NS_PER_S, false), (hop_ns, true)] {
        let mut world = World::of(0);
        let (_, [mut root, mut mote]) = transfer(&spec, &mut world, hop_ns, until_ns, |_| false);
        reboot(&mut root, until_ns, &mut world);
        let posts = run(&mut root, 1000 * NS_PER_S, &mut world);
        assert_eq!(!posts.is_empty(), is_triggered_again);
        reboot(&mut mote, 1000 * NS_PER_S, &mut world);
        for post in posts {
            let answer = give(&mut mote, 0, &post, 1000 * NS_PER_S, &mut world).unwrap();
            assert_eq!(message(&answer).code, Code::CHANGED);
        }
        assert_eq!(mote.poll_timeout(), None);
        let [ended] = &world.packets.take_ended()[..] else { panic!("one download") };
        assert_eq!(ended.lost, Some(DropReason::Killed));
        assert_eq!(world.packets.created(PacketPurpose::Download), 1);
    }
}

#[test]
fn exchanges_saved_in_their_midst_go_on() {
    for (spec, at_ns) in [(coap(Servers::InTurn), 21 * NS_PER_S), (download(2000, 2), NS_PER_S)] {
        let mut world = World::of(0);
        let (_, apps) = transfer(&spec, &mut world, NS_PER_S / 10, at_ns, |_| false);
        let bytes = postcard::to_allocvec(&apps).unwrap();
        assert_eq!(postcard::from_bytes::<[App; 2]>(&bytes).unwrap(), apps);
        assert!(apps.iter().any(|app| app.poll_timeout().is_some()));
    }
}
