//! CoAP exchanges and downloads between a root and motes, message by message.

use super::*;
use coap::{Coap, Servers, Settings};
use download::Download;
use exchange::Timers;
use proto::ids::MoteId;
use proto::time::{SimDuration, SimTime};
use proto::types::PacketPurpose;

/// Those of RFC 7252, § 4.8.
pub(super) const TIMERS: Timers =
    Timers { least: SimDuration::from_s(2), most: SimDuration::from_s(3), max_retransmit: 4 };

fn coap(servers: Servers) -> Spec {
    let settings = Settings {
        servers,
        period: SimDuration::from_s(10),
        is_poisson: false,
        response_bytes: 16,
        timers: TIMERS,
    };
    Spec { machine: Machine::Coap(Coap::new(settings)) }
}

fn download(size_bytes: u32, szx: u8) -> Spec {
    let settings = download::Settings { after: SimDuration::ZERO, size_bytes, szx, timers: TIMERS };
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
    now: SimTime,
    world: &mut World,
) -> Option<Packet> {
    match app.machine().handle_message(MoteId(from), 1, &message(packet), &mut world.at(now)) {
        Heard::NotMine => panic!("nobody takes {packet:?}"),
        Heard::Taken(answer) => answer,
    }
}

#[test]
fn rfc7252_5_2_1_the_response_is_in_the_acknowledgment_and_ends_the_exchange() {
    let spec = coap(Servers::InTurn);
    let (mut root, mut mote) = (app(&spec, 0, true, 3), app(&spec, 1, false, 3));
    let mut world = World::of(0);
    root.set_ready(true, &mut world.at(SimTime::START));
    mote.set_ready(true, &mut world.at(SimTime::START));
    assert_eq!(mote.poll_timeout(), None);
    let request =
        root.handle_timeout(&mut world.at(SimTime::START + SimDuration::from_s(10))).unwrap();
    assert_eq!(to(&request), 1);
    let get = message(&request);
    assert_eq!((get.kind, get.code), (Type::Confirmable, Code::GET));
    let response =
        give(&mut mote, 0, &request, SimTime::START + SimDuration::from_s(11), &mut world).unwrap();
    let content = message(&response);
    assert!(content.answers(get.message_id, get.token));
    assert_eq!((content.code, content.payload.len()), (Code::CONTENT, 16));
    assert_eq!(
        give(&mut root, 1, &response, SimTime::START + SimDuration::from_s(12), &mut world),
        None
    );
    let [ended] = &world.packets.take_ended()[..] else { panic!("one exchange") };
    assert_eq!((ended.ended - ended.packet.created, ended.lost), (SimDuration::from_s(2), None));
    // The same again belongs to nothing.
    let again = root.machine().handle_message(
        MoteId(1),
        1,
        &content,
        &mut world.at(SimTime::START + SimDuration::from_s(13)),
    );
    assert_eq!(again, Heard::NotMine);
    // Then the other one, and mote 1 again.
    let at = [20, 30].map(|at_s| {
        let request =
            root.handle_timeout(&mut world.at(SimTime::START + SimDuration::from_s(at_s))).unwrap();
        let mut asked = app(&spec, to(&request), false, 3);
        asked.set_ready(true, &mut world.at(SimTime::START));
        let response =
            give(&mut asked, 0, &request, SimTime::START + SimDuration::from_s(at_s), &mut world)
                .unwrap();
        give(
            &mut root,
            to(&request),
            &response,
            SimTime::START + SimDuration::from_s(at_s),
            &mut world,
        );
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
        root.set_ready(true, &mut world.at(SimTime::START));
        let begin = SimTime::START + SimDuration::from_s(10);
        let request = root.handle_timeout(&mut world.at(begin)).unwrap();
        let mut sent = Vec::new();
        let mut ended = Vec::new();
        while ended.is_empty() {
            let due = root.poll_timeout().unwrap();
            if let Some(packet) = root.handle_timeout(&mut world.at(due)) {
                assert_eq!(packet.payload(), request.payload());
                sent.push(due - begin);
            }
            ended = world.packets.take_ended();
        }
        let timeout = sent[0];
        assert!((SimDuration::from_s(2)..=SimDuration::from_s(3)).contains(&timeout));
        assert_eq!(sent, [1, 3, 7, 15].map(|n| n * timeout));
        assert_eq!(ended[0].lost, Some(DropReason::MaxRetries));
        assert_eq!(ended[0].ended - begin, 31 * timeout);
        // MAX_TRANSMIT_WAIT.
        assert!(ended[0].ended - begin <= TIMERS.max_transmit_wait());
        assert_eq!((root.counters().requests, root.counters().retransmissions), (1, 4));
        firsts.push(timeout);
    }
    assert_eq!(TIMERS.max_transmit_wait(), SimDuration::from_s(93));
    // Uniform from 2 s to 3 s: the mean of 49 has a standard error of 0.041 s.
    let mean_s = firsts.into_iter().sum::<SimDuration>().ns() as f64 / 49e9;
    assert!((mean_s - 2.5).abs() < 0.124, "{mean_s}");
}

#[test]
fn rfc7252_4_7_a_mote_has_one_open_exchange_and_message_ids_are_never_shared() {
    let spec = coap(Servers::InTurn);
    let clients = [0, 1].map(|number| {
        let mut client =
            App::new(&spec, &Host { app: number, n_apps: 2, ..host(0, true, 3) }).unwrap();
        let mut world = World::of(0);
        client.set_ready(true, &mut world.at(SimTime::START));
        let packets = run(&mut client, SimTime::START + SimDuration::from_s(45), &mut world);
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

/// A root and a mote whose every message takes `hop`. Messages for which `is_lost` holds do not arrive. Returns what was sent.
fn transfer(
    spec: &Spec,
    world: &mut World,
    hop: SimDuration,
    until: SimTime,
    mut is_lost: impl FnMut(&Packet) -> bool,
) -> (Vec<Packet>, [App; 2]) {
    let mut apps = [app(spec, 0, true, 2), app(spec, 1, false, 2)];
    for app in &mut apps {
        app.set_ready(true, &mut world.at(SimTime::START));
    }
    let mut flying: std::collections::VecDeque<(SimTime, usize, Packet)> = [].into();
    let mut sent = Vec::new();
    loop {
        let arrives = flying.front().map(|(at, ..)| *at);
        let due = apps.iter().filter_map(App::poll_timeout).min();
        let Some(now) = [arrives, due].into_iter().flatten().min() else { break };
        if until < now {
            break;
        }
        let mut send = |packet: Option<Packet>, from: usize| {
            let Some(packet) = packet else { return };
            sent.push(packet.clone());
            if !is_lost(&packet) {
                flying.push_back((now + hop, from, packet));
            }
        };
        for (from, app) in apps.iter_mut().enumerate() {
            send(app.handle_timeout(&mut world.at(now)), from);
        }
        if let Some((_, from, packet)) = flying.pop_front_if(|(at, ..)| *at <= now) {
            let other = 1 - from;
            let app = apps[other].machine();
            let heard =
                app.handle_message(MoteId(from as u32), 1, &message(&packet), &mut world.at(now));
            if let Heard::Taken(Some(answer)) = heard {
                sent.push(answer.clone());
                if !is_lost(&answer) {
                    flying.push_back((now + hop, other, answer));
                }
            }
        }
    }
    (sent, apps)
}

/// N = ⌈S/b⌉ exchanges that take two hops each; the mote requests the first block as soon as it is triggered.
#[test]
fn rfc7959_a_download_takes_as_many_round_trips_as_it_has_blocks() {
    let hop = NS_PER_S / 10;
    for (size_bytes, szx) in
        [(1, 0), (16, 0), (17, 0), (1000, 2), (1024, 2), (5000, 6), (100_000, 3)]
    {
        let mut world = World::of(0);
        let (sent, apps) = transfer(
            &download(size_bytes, szx),
            &mut world,
            SimDuration::from_ns(hop),
            SimTime::NEVER,
            |_| false,
        );
        let n_blocks = size_bytes.div_ceil(16 << szx);
        let [ended] = &world.packets.take_ended()[..] else { panic!("one download") };
        let took = ended.ended - ended.packet.created;
        assert_eq!(took, SimDuration::from_ns(2 * hop * u64::from(n_blocks)));
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
    let (sent, apps) =
        transfer(&download(2000, 2), &mut world, SimDuration::SECOND / 10, SimTime::NEVER, |_| {
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
    let (_, mut apps) =
        transfer(&download(2000, 2), &mut world, SimDuration::SECOND / 10, SimTime::NEVER, is_late);
    let [ended] = &world.packets.take_ended()[..] else { panic!("one download") };
    assert_eq!(ended.lost, Some(DropReason::MaxRetries));
    assert_eq!((apps[1].counters().blocks, apps[1].counters().block_retransmissions), (11, 4));
    assert_eq!(apps.each_mut().map(|app| app.poll_timeout()), [None, None]);
}

#[test]
fn a_trigger_that_nobody_answers_is_a_download_that_failed() {
    let mut world = World::of(0);
    let (sent, _) =
        transfer(&download(2000, 2), &mut world, SimDuration::SECOND / 10, SimTime::NEVER, |_| {
            true
        });
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
    let hop = SimDuration::SECOND / 20;
    // Longer than MAX_TRANSMIT_WAIT: no exchange waits for another.
    let period = SimDuration::from_s(100);
    let settings = Settings {
        servers: Servers::One(MoteId(1)),
        period,
        is_poisson: false,
        response_bytes: 16,
        timers: TIMERS,
    };
    let spec = Spec { machine: Machine::Coap(Coap::new(settings)) };
    let mut world = World::of(0);
    let draws = proto::rng::Draws::new(11, Purpose::Traffic);
    let mut n_messages = 0;
    let until = SimTime::START + u64::from(n) * period + period - SimDuration::from_ns(1);
    let (_, apps) = transfer(&spec, &mut world, hop, until, |_| {
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
        succeeded.map(|one| (one.ended - one.packet.created).ns() as f64 / 1e9).collect();
    let mean_s = round_trips_s.iter().sum::<f64>() / round_trips_s.len() as f64;
    let waits_s = |k: u32| 2.5 * (power(2.0, k) - 1.0);
    let expected_s =
        (0..5).map(|k| power(q, k) * (1.0 - q) * waits_s(k)).sum::<f64>() / (1.0 - fails);
    within(mean_s, expected_s + 2.0 * hop.ns() as f64 / 1e9, 11.0);
}

/// RFC 7252, 4.5 and 4.8.2: a message ID that comes again within EXCHANGE_LIFETIME, 247 s, is answered with the same octets, and
/// counted as a duplicate. After that it is another request.
#[test]
fn rfc7252_4_5_a_server_acts_upon_a_request_once() {
    assert_eq!(TIMERS.exchange_lifetime(), SimDuration::from_s(247));
    let spec = coap(Servers::InTurn);
    let mut world = World::of(1);
    let mut root = app(&spec, 0, true, 2);
    root.set_ready(true, &mut world.at(SimTime::START));
    let request =
        root.handle_timeout(&mut world.at(SimTime::START + SimDuration::from_s(10))).unwrap();
    let mut mote = app(&spec, 1, false, 2);
    mote.set_ready(true, &mut world.at(SimTime::START));
    let [first, again, later] = [10, 256, 257].map(|at_s| {
        let answer =
            give(&mut mote, 0, &request, SimTime::START + SimDuration::from_s(at_s), &mut world)
                .unwrap();
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
    let (sent, [_, mut mote]) =
        transfer(&spec, &mut world, SimDuration::SECOND / 10, SimTime::NEVER, |_| false);
    assert_eq!(world.packets.take_ended().len(), 1);
    assert_eq!(message(&sent[0]).code, Code::POST);
    let answer = give(&mut mote, 0, &sent[0], SimTime::START + SimDuration::from_s(5), &mut world);
    assert_eq!(message(&answer.unwrap()).code, Code::CHANGED);
    assert_eq!((mote.poll_timeout(), mote.counters().block_duplicates), (None, 1));
}

/// The root gives up the trigger: the download has failed, from the first transmission on. The trigger reaches the mote later.
#[test]
fn a_trigger_that_arrives_after_it_was_given_up_counts_no_second_download() {
    let spec = download(16, 0);
    let mut world = World::of(0);
    let (sent, [mut root, mut mote]) =
        transfer(&spec, &mut world, SimDuration::SECOND / 10, SimTime::NEVER, |_| true);
    let [ended] = &world.packets.take_ended()[..] else { panic!("one download") };
    let waited = ended.ended - ended.packet.created;
    assert!((SimDuration::from_s(62)..=SimDuration::from_s(93)).contains(&waited));

    let later = SimDuration::from_s(100);
    give(&mut mote, 0, &sent[0], SimTime::START + later, &mut world).unwrap();
    let get = mote.handle_timeout(&mut world.at(SimTime::START + later)).unwrap();
    let block = give(&mut root, 1, &get, SimTime::START + later, &mut world).unwrap();
    assert_eq!(give(&mut mote, 0, &block, SimTime::START + later, &mut world), None);
    assert_eq!((mote.poll_timeout(), world.packets.take_ended()), (None, vec![]));
    assert_eq!((world.packets.created(PacketPurpose::Download), world.packets.late()), (1, 1));
}

/// The mote has begun and nothing that it sends arrives: both ends give up, and it is one download that failed.
#[test]
fn a_download_that_both_ends_give_up_has_failed_once() {
    let mut world = World::of(0);
    let is_from_mote = |packet: &Packet| message(packet).code != Code::POST;
    let (_, apps) = transfer(
        &download(16, 0),
        &mut world,
        SimDuration::SECOND / 10,
        SimTime::NEVER,
        is_from_mote,
    );
    let [ended] = &world.packets.take_ended()[..] else { panic!("one download") };
    assert_eq!(
        (ended.packet.created, ended.lost),
        (SimTime::START + SimDuration::SECOND / 10, Some(DropReason::MaxRetries))
    );
    assert_eq!(apps[1].counters().block_retransmissions, 4);
}

/// A reboot of the root while the mote downloads, of the root while it triggers, and of the mote: none begins a second download.
#[test]
fn a_reboot_of_either_end_begins_no_second_download() {
    let reboot = |app: &mut App, now: SimTime, world: &mut World| {
        app.set_ready(false, &mut world.at(now));
        app.machine().reset(&mut world.at(now));
        app.set_ready(true, &mut world.at(now));
    };
    let spec = download(2000, 2);
    let hop = NS_PER_S / 10;
    // The second time the root has not heard of the mote yet.
    for (until, is_triggered_again) in [(NS_PER_S, false), (hop, true)] {
        let mut world = World::of(0);
        let (_, [mut root, mut mote]) =
            transfer(&spec, &mut world, SimDuration::from_ns(hop), SimTime::from_ns(until), |_| {
                false
            });
        reboot(&mut root, SimTime::from_ns(until), &mut world);
        let posts = run(&mut root, SimTime::START + SimDuration::from_s(1000), &mut world);
        assert_eq!(!posts.is_empty(), is_triggered_again);
        reboot(&mut mote, SimTime::START + SimDuration::from_s(1000), &mut world);
        for post in posts {
            let answer =
                give(&mut mote, 0, &post, SimTime::START + SimDuration::from_s(1000), &mut world)
                    .unwrap();
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
    for (spec, at_s) in [(coap(Servers::InTurn), 21), (download(2000, 2), 1)] {
        let mut world = World::of(0);
        let (_, apps) = transfer(
            &spec,
            &mut world,
            SimDuration::SECOND / 10,
            SimTime::START + SimDuration::from_s(at_s),
            |_| false,
        );
        let bytes = postcard::to_allocvec(&apps).unwrap();
        assert_eq!(postcard::from_bytes::<[App; 2]>(&bytes).unwrap(), apps);
        assert!(apps.iter().any(|app| app.poll_timeout().is_some()));
    }
}
