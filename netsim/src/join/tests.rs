use super::*;
use crate::dice::Dice;
use crate::lowpan::DropReason;
use crate::wire::Eui64;
use proptest::prelude::*;
use proto::ids::MoteId;
use proto::rng::Purpose;
use proto::time::{SimDuration, SimTime};
use proto::types::NS_PER_S;

fn mote(n: u32) -> Eui64 {
    Eui64::of_mote(MoteId(n))
}

fn dice(n: u32) -> Dice {
    Dice::new(1, Purpose::Join, MoteId(n))
}

fn root() -> std::net::Ipv6Addr {
    mote(0).global()
}

/// The requests of a pledge that nobody answers: when each was sent, and when it gave up.
fn unanswered(seed: u64, config: Config) -> (Vec<SimTime>, SimTime) {
    let mut dice = Dice::new(seed, Purpose::Join, MoteId(5));
    let mut pledge = Pledge::new(config, mote(5));
    pledge.start(mote(1), SimTime::START, &mut dice);
    let (mut sent, mut now) = (Vec::new(), SimTime::START);
    loop {
        if pledge.poll_transmit().is_some() {
            sent.push(now);
        }
        assert_eq!(pledge.poll_transmit(), None);
        if let Some(event) = pledge.poll_event() {
            assert_eq!(event, Event::Failed);
            return (sent, now);
        }
        now = pledge.poll_timeout().unwrap();
        pledge.handle_timeout(now - SimDuration::from_ns(1));
        assert_eq!(pledge.poll_timeout(), Some(now));
        pledge.handle_timeout(now);
    }
}

#[test]
fn j1_who_leaves_before_being_admitted_has_failed_and_afterwards_has_left() {
    let mut pledge = Pledge::new(Config::default(), mote(1));
    pledge.leave();
    assert_eq!(pledge.poll_event(), None);
    pledge.start(mote(0), SimTime::START, &mut dice(1));
    pledge.leave();
    assert_eq!(pledge.poll_event(), Some(Event::Failed));
    assert_eq!((pledge.poll_timeout(), pledge.poll_transmit()), (None, None));

    let mut pledge = Pledge::new(Config { secure: false, ..Config::default() }, mote(1));
    pledge.start(mote(0), SimTime::START, &mut dice(1));
    assert_eq!(pledge.poll_event(), Some(Event::Joined));
    assert!(pledge.is_joined());
    pledge.leave();
    assert_eq!(pledge.poll_event(), Some(Event::Left));
    assert!(!pledge.is_joined());
}

#[test]
fn without_admission_a_mote_has_joined_at_once_and_asks_nobody() {
    let mut pledge = Pledge::new(Config { secure: false, ..Config::default() }, mote(1));
    pledge.start(mote(0), SimTime::START, &mut dice(1));
    assert_eq!(pledge.poll_event(), Some(Event::Joined));
    assert_eq!((pledge.poll_transmit(), pledge.poll_timeout()), (None, None));
}

/// A pledge (5), its proxy (1) and the root, with messages that may be lost: the k-th way is open as `open` says.
fn exchange(open: &[bool]) -> (Pledge, Registrar, usize) {
    let config = Config::default();
    let mut ways = open.iter().copied().chain(std::iter::repeat(true));
    let mut dice = dice(5);
    let mut pledge = Pledge::new(config, mote(5));
    let mut proxy = Proxy::new(config, mote(1));
    let mut registrar = Registrar::new(config, mote(0), vec![]);
    let mut now = 7;
    let mut n_requests = 0;
    pledge.start(mote(1), SimTime::from_ns(now), &mut dice);
    while pledge.poll_event().is_none() {
        if let Some(request) = pledge.poll_transmit() {
            n_requests += 1;
            assert_eq!(request.destination, mote(1).link_local());
            if ways.next().unwrap() {
                let request = proxy
                    .handle_request(
                        request.source,
                        &request.message,
                        Some(root()),
                        SimTime::from_ns(now),
                    )
                    .unwrap();
                assert_eq!((request.source, request.destination), (mote(1).global(), root()));
                if ways.next().unwrap() {
                    let answer = registrar
                        .handle_request(request.source, &request.message, SimTime::from_ns(now))
                        .unwrap();
                    assert_eq!((answer.source, answer.destination), (root(), mote(1).global()));
                    if ways.next().unwrap() {
                        let answer = proxy.handle_response(&answer.message).unwrap();
                        assert_eq!(answer.source, mote(1).link_local());
                        assert_eq!(answer.destination, mote(5).link_local());
                        if ways.next().unwrap() {
                            pledge.handle_response(&answer.message);
                        }
                    }
                }
            }
            continue;
        }
        now = pledge.poll_timeout().unwrap().ns();
        pledge.handle_timeout(SimTime::from_ns(now));
    }
    (pledge, registrar, n_requests)
}

#[test]
fn a_pledge_joins_through_a_proxy_that_remembers_nothing() {
    let (pledge, registrar, n_requests) = exchange(&[]);
    assert!(pledge.is_joined());
    assert_eq!(pledge.poll_timeout(), None);
    assert_eq!((registrar.n_admitted(), n_requests), (1, 1));
    assert_eq!(registrar.admitted(mote(5)), Some(SimTime::from_ns(7)));
}

#[test]
fn a_lost_answer_is_given_again_and_admission_counts_once() {
    let (pledge, registrar, n_requests) = exchange(&[true, true, true, false]);
    assert!(pledge.is_joined());
    assert_eq!((registrar.n_admitted(), n_requests), (1, 2));
    assert_eq!(registrar.admitted(mote(5)), Some(SimTime::from_ns(7)));
}

#[test]
fn a_root_answers_its_neighbours_on_the_link() {
    let config = Config::default();
    let mut pledge = Pledge::new(config, mote(1));
    let mut registrar = Registrar::new(config, mote(0), vec![]);
    pledge.start(mote(0), SimTime::START, &mut dice(1));
    let request = pledge.poll_transmit().unwrap();
    let answer =
        registrar.handle_request(request.source, &request.message, SimTime::START).unwrap();
    assert_eq!(answer.source, mote(0).link_local());
    assert_eq!(answer.destination, mote(1).link_local());
    pledge.handle_response(&answer.message);
    assert!(pledge.is_joined());
}

#[test]
fn only_the_response_to_the_open_request_admits() {
    let mut pledge = Pledge::new(Config::default(), mote(5));
    let response = |message_id, pledge, proxy_state| CojpRepr::Response {
        message_id,
        pledge,
        proxy_state,
        key_index: 1,
        keys: None,
        join_rate_bytes_s: None,
    };
    pledge.handle_response(&response(0, mote(5), None));
    assert!(!pledge.is_joined(), "nothing was asked");
    pledge.start(mote(1), SimTime::START, &mut dice(5));
    let request = pledge.poll_transmit().unwrap();
    let CojpRepr::Request { message_id, .. } = request.message else { panic!() };
    for wrong in [
        response(message_id.wrapping_add(1), mote(5), None),
        response(message_id, mote(6), None),
        response(message_id, mote(5), Some(mote(5))),
        request.message,
    ] {
        pledge.handle_response(&wrong);
        assert!(!pledge.is_joined(), "{wrong:?}");
    }
    pledge.handle_response(&response(message_id, mote(5), None));
    assert!(pledge.is_joined());
}

#[test]
fn repetitions_go_through_the_new_proxy() {
    let mut pledge = Pledge::new(Config::default(), mote(5));
    pledge.start(mote(1), SimTime::START, &mut dice(5));
    let first = pledge.poll_transmit().unwrap();
    pledge.handle_proxy(mote(2));
    pledge.handle_timeout(pledge.poll_timeout().unwrap());
    let second = pledge.poll_transmit().unwrap();
    assert_eq!(second, Outgoing { destination: mote(2).link_local(), ..first });
}

#[test]
fn who_is_denied_or_asks_for_another_network_hears_nothing() {
    let config = Config::default();
    let mut registrar = Registrar::new(config, mote(0), vec![mote(9), mote(5)]);
    let request = |pledge: Eui64, network_id| CojpRepr::Request {
        message_id: 1,
        pledge,
        proxy_state: None,
        network_id,
    };
    let mut ask = |pledge: Eui64, network_id| {
        registrar.handle_request(pledge.link_local(), &request(pledge, network_id), SimTime::START)
    };
    assert_eq!(ask(mote(5), config.network_id), Err(DropReason::JoinDenied));
    assert_eq!(ask(mote(6), config.network_id ^ 1), Err(DropReason::JoinDenied));
    assert!(ask(mote(6), config.network_id).is_ok());
    assert_eq!(registrar.n_admitted(), 1);
}

#[test]
fn a_proxy_outside_a_dodag_forwards_nothing() {
    let config = Config::default();
    let mut proxy = Proxy::new(config, mote(1));
    let request = CojpRepr::Request {
        message_id: 1,
        pledge: mote(5),
        proxy_state: None,
        network_id: config.network_id,
    };
    let link = mote(5).link_local();
    assert_eq!(
        proxy.handle_request(link, &request, None, SimTime::START),
        Err(DropReason::NoRoute)
    );
    let far = proxy.handle_request(mote(5).global(), &request, Some(root()), SimTime::START);
    assert_eq!(far, Err(DropReason::Malformed));
    proxy.set_join_rate(Some(0));
    let refused = proxy.handle_request(link, &request, Some(root()), SimTime::START);
    assert_eq!(refused, Err(DropReason::JoinRateExceeded));
}

#[test]
fn rfc9031_6_1_a_proxy_without_a_join_rate_forwards_one_request_in_three_seconds() {
    let config = Config::default();
    let mut proxy = Proxy::new(config, mote(1));
    let network_id = config.network_id;
    let forwarded: Vec<u64> = (0..100)
        .map(|n| n * NS_PER_S / 10)
        .filter(|&now| {
            let pledge = mote(5 + now as u32 % 7);
            let request =
                CojpRepr::Request { message_id: 1, pledge, proxy_state: None, network_id };
            proxy
                .handle_request(pledge.link_local(), &request, Some(root()), SimTime::from_ns(now))
                .is_ok()
        })
        .collect();
    assert_eq!(forwarded, [0, 3 * NS_PER_S, 6 * NS_PER_S, 9 * NS_PER_S]);
}

#[test]
fn rfc9031_7_2_a_join_rate_is_a_mean_over_ten_seconds() {
    let config = Config::default();
    let network_id = config.network_id;
    let request =
        CojpRepr::Request { message_id: 1, pledge: mote(5), proxy_state: None, network_id };
    for rate in [1, 20, 100] {
        let mut proxy = Proxy::new(config, mote(1));
        proxy.set_join_rate(Some(rate));
        let mut bytes = Vec::new();
        while let Ok(sent) =
            proxy.handle_request(mote(5).link_local(), &request, Some(root()), SimTime::START)
        {
            bytes.push(sent.message.buffer_len());
        }
        // At least one, or none would ever go through.
        let n = (10 * rate as usize / bytes[0]).max(1);
        assert_eq!(bytes.len(), n);
    }
}

#[test]
fn rfc9031_8_4_2_who_is_admitted_hears_the_join_rate() {
    for join_rate_bytes_s in [None, Some(40)] {
        let config = Config { join_rate_bytes_s, ..Config::default() };
        let mut pledge = Pledge::new(config, mote(5));
        pledge.start(mote(0), SimTime::START, &mut dice(5));
        let request = pledge.poll_transmit().unwrap();
        let mut registrar = Registrar::new(config, mote(0), vec![]);
        let answer =
            registrar.handle_request(request.source, &request.message, SimTime::START).unwrap();
        pledge.handle_response(&answer.message);
        assert!(pledge.is_joined());
        assert_eq!(pledge.join_rate_bytes_s(), join_rate_bytes_s);
    }
}

#[test]
fn rfc9031_6_1_proxied_requests_are_af43_responses_to_proxies_af42_and_the_rest_best_effort() {
    let config = Config::default();
    let mut pledge = Pledge::new(config, mote(5));
    pledge.start(mote(1), SimTime::START, &mut dice(5));
    let asked = pledge.poll_transmit().unwrap();
    let mut proxy = Proxy::new(config, mote(1));
    let passed =
        proxy.handle_request(asked.source, &asked.message, Some(root()), SimTime::START).unwrap();
    let mut registrar = Registrar::new(config, mote(0), vec![]);
    let answer = registrar.handle_request(passed.source, &passed.message, SimTime::START).unwrap();
    let handed = proxy.handle_response(&answer.message).unwrap();
    let on_link = registrar.handle_request(asked.source, &asked.message, SimTime::START).unwrap();
    let marks = [&asked, &passed, &answer, &handed, &on_link].map(|one| one.dscp);
    // AF43 is 100110, AF42 100100 (RFC 2597, § 6).
    assert_eq!(marks, [0, 0b10_0110, 0b10_0100, 0, 0]);
}

#[test]
fn a_message_travels_as_udp_payload_and_comes_back() {
    let mut pledge = Pledge::new(Config::default(), mote(5));
    pledge.start(mote(1), SimTime::START, &mut dice(5));
    let request = pledge.poll_transmit().unwrap();
    let Upper::Udp(udp) = request.upper() else { panic!() };
    assert_eq!((udp.source_port, udp.destination_port), (5683, 5683));
    assert_eq!(CojpRepr::parse(&udp.payload), Ok(request.message));
}

proptest! {
    #[test]
    fn j2_timeouts_are_t0_times_1_2_4_8_16_and_t0_is_from_10_to_15_s(seed in any::<u64>()) {
        let (sent, failed) = unanswered(seed, Config::default());
        let t0 = sent[1] - SimTime::START;
        prop_assert!((SimDuration::from_s(10)..SimDuration::from_s(15)).contains(&t0));
        let expected = [0, 1, 3, 7, 15].map(|n| SimTime::START + n * t0);
        prop_assert_eq!(sent, expected);
        prop_assert_eq!(failed, SimTime::START + 31 * t0);
    }

    #[test]
    fn a_pledge_joins_iff_one_of_five_attempts_gets_through(
        lost_at in prop::collection::vec(0usize..4, 0..8),
    ) {
        // Attempt k is lost on its (lost_at[k] + 1)-th way.
        let open: Vec<bool> =
            lost_at.iter().flat_map(|&n| std::iter::repeat_n(true, n).chain([false])).collect();
        let (pledge, _, n_requests) = exchange(&open);
        prop_assert_eq!(pledge.is_joined(), lost_at.len() < 5);
        prop_assert_eq!(n_requests, (lost_at.len() + 1).min(5));
    }

    #[test]
    fn a_proxy_keeps_to_the_join_rate(
        rate in 1u32..10_000,
        burst in 60u32..2000,
        pauses_ms in prop::collection::vec(0u64..3000, 1..200),
    ) {
        let config = Config { join_burst_bytes: Some(burst), ..Config::default() };
        let mut proxy = Proxy::new(config, mote(1));
        proxy.set_join_rate(Some(rate));
        let network_id = config.network_id;
        let request =
            CojpRepr::Request { message_id: 1, pledge: mote(5), proxy_state: None, network_id };
        let (mut now, mut bytes) = (0, 0);
        for pause_ms in pauses_ms {
            now += pause_ms * 1_000_000;
            let link = mote(5).link_local();
            match proxy.handle_request(link, &request, Some(root()), SimTime::from_ns(now)) {
                Ok(sent) => {
                    bytes += sent.message.buffer_len() as u64;
                }
                Err(reason) => {
                    prop_assert_eq!(reason, DropReason::JoinRateExceeded);
                }
            }
            let allowed = u64::from(burst) + u64::from(rate) * now / NS_PER_S + 1;
            prop_assert!(bytes <= allowed, "{bytes} of {allowed}");
        }
        // After a pause in which the bucket fills, one goes through.
        let later = now + 2 * NS_PER_S * u64::from(burst) / u64::from(rate) + NS_PER_S;
        let link = mote(5).link_local();
        prop_assert!(proxy.handle_request(link, &request, Some(root()), SimTime::from_ns(later)).is_ok());
    }

    #[test]
    fn a_copy_from_bytes_asks_the_same(n in 0usize..5) {
        let mut pledge = Pledge::new(Config::default(), mote(5));
        pledge.start(mote(1), SimTime::START, &mut dice(5));
        for _ in 0..n {
            pledge.handle_timeout(pledge.poll_timeout().unwrap());
        }
        let bytes = postcard::to_allocvec(&pledge).unwrap();
        let copy: Pledge = postcard::from_bytes(&bytes).unwrap();
        prop_assert_eq!(&copy, &pledge);
    }
}

const SECURED: Config = Config {
    secure: true,
    network_id: crate::wire::frame::NETWORK_PAN,
    timeout_min: SimDuration::from_ns(10_000_000_000),
    timeout_max: SimDuration::from_ns(15_000_000_000),
    max_retransmit: 4,
    join_rate_bytes_s: None,
    join_burst_bytes: None,
    security: Some(Security { keys: Keys { k1: [1; 16], k2: [2; 16] }, join_key: [3; 16] }),
};

#[test]
fn in_a_secured_network_only_pledge_and_registrar_read_what_they_say() {
    let mut pledge = Pledge::new(SECURED, mote(5));
    let mut proxy = Proxy::new(SECURED, mote(1));
    let mut registrar = Registrar::new(SECURED, mote(0), vec![]);
    pledge.start(mote(1), SimTime::START, &mut dice(5));
    let first = pledge.poll_transmit().unwrap();
    assert!(matches!(first.message, CojpRepr::ProtectedRequest { sequence: 0, .. }));
    // The first request is lost; a repetition has another number.
    pledge.handle_timeout(pledge.poll_timeout().unwrap());
    let second = pledge.poll_transmit().unwrap();
    let CojpRepr::ProtectedRequest { sequence: 1, pledge: named, .. } = second.message else {
        panic!("{second:?}")
    };
    assert_eq!(named, mote(5));
    let passed = proxy
        .handle_request(
            second.source,
            &second.message,
            Some(root()),
            SimTime::from_ns(4_000_000_000),
        )
        .unwrap();
    let answer = registrar.handle_request(passed.source, &passed.message, SimTime::START).unwrap();
    assert!(matches!(answer.message, CojpRepr::ProtectedResponse { .. }));
    // Said again, it is a replay.
    let again = registrar.handle_request(passed.source, &passed.message, SimTime::START);
    assert_eq!(again.unwrap_err(), DropReason::Duplicate);
    let answer = proxy.handle_response(&answer.message).unwrap();
    assert_eq!(answer.destination, mote(5).link_local());
    let mut changed = answer.message.clone();
    let CojpRepr::ProtectedResponse { ciphertext, .. } = &mut changed else { panic!() };
    ciphertext[0] ^= 1;
    pledge.handle_response(&changed);
    assert!(!pledge.is_joined());
    pledge.handle_response(&answer.message);
    assert!(pledge.is_joined());
    // A late answer to the first request changes nothing.
    assert!(registrar.handle_request(first.source, &first.message, SimTime::START).is_ok());
}

#[test]
fn in_a_secured_network_what_is_not_protected_admits_nobody() {
    let mut registrar = Registrar::new(SECURED, mote(0), vec![]);
    let mut open = Pledge::new(Config::default(), mote(5));
    open.start(mote(0), SimTime::START, &mut dice(5));
    let request = open.poll_transmit().unwrap();
    let refused = registrar.handle_request(request.source, &request.message, SimTime::START);
    assert_eq!(refused.unwrap_err(), DropReason::JoinDenied);
    // Nor does the key of somebody else.
    let other = Security { join_key: [4; 16], ..SECURED.security.unwrap() };
    let mut stranger = Pledge::new(Config { security: Some(other), ..SECURED }, mote(5));
    stranger.start(mote(0), SimTime::START, &mut dice(5));
    let request = stranger.poll_transmit().unwrap();
    let refused = registrar.handle_request(request.source, &request.message, SimTime::START);
    assert_eq!(refused.unwrap_err(), DropReason::JoinDenied);
    assert_eq!(registrar.n_admitted(), 0);

    let mut pledge = Pledge::new(SECURED, mote(5));
    pledge.start(mote(0), SimTime::START, &mut dice(5));
    let CojpRepr::ProtectedRequest { message_id, .. } = pledge.poll_transmit().unwrap().message
    else {
        panic!()
    };
    let (proxy_state, keys) = (None, Some(SECURED.security.unwrap().keys));
    pledge.handle_response(&CojpRepr::Response {
        message_id,
        pledge: mote(5),
        proxy_state,
        key_index: 1,
        keys,
        join_rate_bytes_s: None,
    });
    assert!(!pledge.is_joined());
}
