//! Traffic at random times against closed forms.

use super::*;
use event::{Area, Event, Times};
use proto::time::{SimDuration, SimTime};

fn poisson(mean: SimDuration) -> Spec {
    Spec { machine: Machine::Poisson(poisson::Poisson::new(sender(Peer::Root), mean)) }
}

/// Times of the packets of one mote.
fn times(mote: u32, mean: SimDuration, until: SimTime) -> Vec<SimTime> {
    let mut world = World::of(mote);
    let mut app = app(&poisson(mean), mote, false, 1000);
    app.set_ready(true, &mut world.at(SimTime::START));
    run(&mut app, until, &mut world).iter().map(|packet| packet.created).collect()
}

/// Kolmogorov and Smirnov: the greatest distance between the empirical distribution of the intervals and 1 − e^(−t/m). With n of
/// them, a right generator exceeds 1.63/√n for one seed in a hundred (Massey 1951); the seed is fixed.
#[test]
fn intervals_of_a_poisson_process_are_exponential_and_independent() {
    let mean = SimDuration::from_s(2);
    let sent = times(1, mean, SimTime::START + SimDuration::from_s(20_000));
    let intervals: Vec<f64> =
        sent.windows(2).map(|pair| (pair[1] - pair[0]).ns() as f64 / mean.ns() as f64).collect();
    let n = intervals.len() as f64;
    let mut sorted = intervals.clone();
    sorted.sort_by(f64::total_cmp);
    let distance = (0..).zip(&sorted).fold(0.0_f64, |most, (i, t)| {
        let expected = 1.0 - libm::exp(-t);
        most.max((expected - f64::from(i) / n).abs()).max((expected - f64::from(i + 1) / n).abs())
    });
    assert!(distance < 1.63 / n.sqrt(), "{distance} of {n}");
    // Each interval beside the next: the correlation has a standard deviation of 1/√n.
    let lagged: f64 = intervals.windows(2).map(|pair| (pair[0] - 1.0) * (pair[1] - 1.0)).sum();
    assert!((lagged / n).abs() < 3.0 / n.sqrt(), "{lagged} of {n}");
}

/// The number of packets of a mote in t has mean and variance t/m. Of 400 motes with t/m = 50 the mean has a standard error of
/// √50/20 = 0.35, the variance one of 50 √(2/400) = 3.5 and a bit.
#[test]
fn the_number_of_packets_of_a_poisson_process_has_mean_and_variance_t_over_m() {
    let counts: Vec<f64> = (1..=400)
        .map(|mote| {
            times(mote, SimDuration::SECOND, SimTime::START + SimDuration::from_s(50)).len() as f64
        })
        .collect();
    let mean = counts.iter().sum::<f64>() / 400.0;
    let variance = counts.iter().map(|n| (n - mean) * (n - mean)).sum::<f64>() / 399.0;
    assert!((mean - 50.0).abs() < 1.06 && (variance - 50.0).abs() < 11.0, "{mean} {variance}");
}

#[test]
fn draws_depend_on_seed_mote_and_application_only() {
    let first = |seed, mote, number| {
        let host = Host { seed, app: number, n_apps: 3, ..host(mote, false, 1000) };
        let mut app = App::new(&poisson(SimDuration::SECOND), &host).unwrap();
        app.set_ready(true, &mut World::of(mote).at(SimTime::START));
        app.poll_timeout().unwrap()
    };
    assert_eq!(first(7, 1, 0), first(7, 1, 0));
    assert_ne!(first(7, 1, 0), first(8, 1, 0));
    assert_ne!(first(7, 1, 0), first(7, 2, 0));
    assert_ne!(first(7, 1, 0), first(7, 1, 1));
}

fn event(times: Times, area: Area, n_packets: u32, spacing: SimDuration) -> Spec {
    let event = Event::new(sender(Peer::Root), Some((times, area)), n_packets, spacing);
    Spec { machine: Machine::Event(event) }
}

#[test]
fn each_concerned_mote_sends_its_packets_at_each_event_with_their_spacing() {
    let spec = event(
        Times::Listed(vec![SimTime::from_ns(5_000_000_000), SimTime::from_ns(6_000_000_000)]),
        Area::default(),
        3,
        SimDuration::from_s(2),
    );
    let mut events = Events::new(std::slice::from_ref(&spec), 7);
    let mut world = World::of(1);
    let mut app = app(&spec, 1, false, 2);
    app.set_ready(true, &mut world.at(SimTime::START));
    let mut n_events = 0;
    while let Some(at) = events.next() {
        assert_eq!(events.take(at - SimDuration::from_ns(1), 7), None);
        let occurrence = events.take(at, 7).unwrap();
        assert_eq!(occurrence.concerned(&[None, Some([0.0; 3])]), [true, true]);
        app.machine().handle_event(occurrence.at);
        n_events += 1;
    }
    assert_eq!(n_events, 2);
    let packets = run(&mut app, SimTime::START + SimDuration::from_s(1000), &mut world);
    let at_s: Vec<u64> =
        packets.iter().map(|packet| packet.created / SimDuration::SECOND).collect();
    assert_eq!(at_s, [5, 6, 7, 8, 9, 10]);
    // What falls into a time in which the mote may not send does not exist.
    app.machine().handle_event(SimTime::START + SimDuration::from_s(1001));
    app.set_ready(false, &mut world.at(SimTime::START + SimDuration::from_s(1000)));
    assert_eq!(run(&mut app, SimTime::START + SimDuration::from_s(1004), &mut world), []);
    app.set_ready(true, &mut world.at(SimTime::START + SimDuration::from_s(1004)));
    assert_eq!(run(&mut app, SimTime::START + SimDuration::from_s(2000), &mut world).len(), 1);
}

/// Uniform places in a square of 10 m: a disc of radius r around a random place holds the centre with probability π r² / 100.
#[test]
fn random_places_are_uniform_in_the_rectangle_around_all_motes() {
    let area = Area { place_m: None, radius_m: Some(3.0) };
    let mut events =
        Events::new(&[event(Times::Poisson(SimDuration::SECOND), area, 1, SimDuration::ZERO)], 7);
    let places_m = [[0.0, 0.0, 1.0], [10.0, 10.0, 5.0], [5.0, 5.0, 9.0]].map(Some);
    let n = 20_000;
    let mut n_at_centre = 0;
    let mut last = SimTime::START;
    for _ in 0..n {
        let occurrence = events.take(SimTime::NEVER, 7).unwrap();
        last = occurrence.at;
        n_at_centre += u32::from(occurrence.concerned(&places_m)[2]);
    }
    let share = f64::from(n_at_centre) / f64::from(n);
    // Standard errors: 0.0032 of the share, √20,000 = 141 s of the time.
    assert!((share - std::f64::consts::PI * 0.09).abs() < 0.0096, "{share}");
    assert!((last.ns() as f64 / 1e9 - 20_000.0).abs() < 424.0, "{last:?}");
}

#[test]
fn events_are_the_same_for_a_seed_and_others_for_another() {
    let spec = [event(Times::Poisson(SimDuration::SECOND), Area::default(), 1, SimDuration::ZERO)];
    let first = |seed| Events::new(&spec, seed).next();
    assert_eq!(first(7), first(7));
    assert_ne!(first(7), first(8));
    let mut events = Events::new(&spec, 7);
    events.take(SimTime::NEVER, 7);
    let bytes = postcard::to_allocvec(&events).unwrap();
    assert_eq!(postcard::from_bytes::<Events>(&bytes).unwrap(), events);
}
