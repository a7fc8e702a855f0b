use super::*;
use proto::ids::MoteId;
use proto::time::{SimDuration, SimTime};

const TIMING: Timing = Timing {
    slot: SimDuration::from_ns(20_000),
    difs: SimDuration::from_ns(50_000),
    preamble: SimDuration::from_ns(192_000),
    bit_ns: 1000.0,
    overhead_bytes: 64,
    window: 16,
};

/// Everyone among `n` stations hears everyone else.
fn all(n: u32) -> impl FnMut(MoteId) -> HeardBy {
    move |sender: MoteId| {
        let sensed: Vec<u32> = (0..n).filter(|&id| id != sender.0).collect();
        HeardBy { received: sensed.iter().map(|&id| (id, -50.0)).collect(), sensed }
    }
}

fn payload() -> Bytes {
    Bytes::from_static(&[7; 36])
}

/// 192 µs and 100 bytes at 1 Mbit/s.
const AIRTIME_NS: u64 = 992_000;

fn run(dcf: &mut Dcf, arrivals: &[(u64, u32)], n: u32, until: SimTime, seed: u64) -> Carried {
    let mut carried = Carried::default();
    let arrivals =
        arrivals.iter().map(|&(at_ns, id)| (SimTime::from_ns(at_ns), id, payload())).collect();
    dcf.run(arrivals, until, seed, &mut all(n), &mut carried);
    carried
}

#[test]
fn a_frame_that_finds_the_medium_idle_is_sent_at_once_and_received_by_all() {
    let mut dcf = Dcf::new(TIMING, 4);
    let carried = run(&mut dcf, &[(100_000, 2)], 4, SimTime::from_ns(10_000_000), 1);
    let [frame] = &carried.frames[..] else { panic!("{carried:?}") };
    assert_eq!((frame.sent.ns(), frame.end.ns()), (100_000, 100_000 + AIRTIME_NS));
    assert_eq!(frame.receivers, [(0, -50.0), (1, -50.0), (3, -50.0)]);
}

#[test]
fn frames_that_begin_at_the_same_instant_are_lost_and_hidden_ones_too() {
    let mut dcf = Dcf::new(TIMING, 3);
    let carried = run(&mut dcf, &[(100_000, 0), (100_000, 1)], 3, SimTime::from_ns(10_000_000), 1);
    assert!(carried.frames.iter().all(|frame| frame.receivers.is_empty()));
    // 0 and 2 hear 1 alone, and do not sense each other.
    let mut line = |sender: MoteId| {
        let sensed = if sender == MoteId(1) { vec![0, 2] } else { vec![1] };
        HeardBy { received: sensed.iter().map(|&id| (id, 0.0)).collect(), sensed }
    };
    let mut carried = Carried::default();
    let arrivals = [(100_000, 0), (500_000, 2)]
        .map(|(at_ns, id)| (SimTime::from_ns(at_ns), id, payload()))
        .to_vec();
    Dcf::new(TIMING, 3).run(arrivals, SimTime::from_ns(10_000_000), 1, &mut line, &mut carried);
    assert_eq!(carried.frames[1].sent, SimTime::from_ns(500_000), "nothing is sensed");
    assert!(carried.frames.iter().all(|frame| frame.receivers.is_empty()));
}

/// While a frame is on the air n stations receive something to send. Each draws a back-off and sends once, so that a frame is
/// received exactly if no other station drew the same one: probability (1 − 1/W)^(n − 1).
#[test]
fn val_one_round_of_contention_has_the_closed_form_of_distinct_draws() {
    for (n, window) in [(2u32, 16u32), (6, 16), (11, 16), (6, 32)] {
        let timing = Timing { window, ..TIMING };
        let n_rounds = 20_000;
        let mut n_received = 0.0;
        for seed in 0..n_rounds {
            let mut dcf = Dcf::new(timing, n as usize + 1);
            let mut arrivals = vec![(0, n)];
            arrivals.extend((0..n).map(|id| (500_000, id)));
            arrivals[0].0 = 60_000;
            let carried = run(&mut dcf, &arrivals, n + 1, SimTime::from_ns(100_000_000), seed);
            assert_eq!(carried.frames.len(), n as usize + 1);
            let received = carried.frames[1..].iter().filter(|frame| !frame.receivers.is_empty());
            n_received += received.count() as f64;
        }
        let share = n_received / (n_rounds as f64 * f64::from(n));
        let expected = libm::pow(1.0 - 1.0 / f64::from(window), f64::from(n - 1));
        // Frames of a round depend on each other: at most n times the variance of independent ones. 4.5 standard deviations, which a
        // correct program exceeds for one seed in 150,000; seeds are fixed.
        let sd = (expected * (1.0 - expected) / n_rounds as f64).sqrt();
        assert!((share - expected).abs() < 4.5 * sd, "{n} of {window}: {share} {expected}");
    }
}

/// Probability that a frame of two saturated stations collides, from the Markov chain of their back-offs: when the lower one ends,
/// its station sends and draws anew, and the other one keeps the difference; equal ones collide and both draw anew.
fn saturated_pair(window: usize) -> f64 {
    // State: how much longer the other station waits than the one that just sent would without its draw.
    let draw = 1.0 / window as f64;
    let mut of_both = 1.0;
    let mut left = vec![0.0; window];
    let mut collisions = 0.0;
    let mut frames = 0.0;
    for round in 0..20_000 {
        let mut next_left = vec![0.0; window];
        let mut next_both = 0.0;
        let (mut round_collisions, mut round_frames) = (0.0, 0.0);
        let mut meet = |a: usize, b: usize, probability: f64| match a.abs_diff(b) {
            0 => {
                next_both += probability;
                round_collisions += 2.0 * probability;
                round_frames += 2.0 * probability;
            }
            difference => {
                next_left[difference] += probability;
                round_frames += probability;
            }
        };
        for a in 0..window {
            for (b, &probability) in left.iter().enumerate() {
                meet(a, b, of_both * draw * draw);
                if b != 0 {
                    meet(a, b, probability * draw);
                }
            }
        }
        (of_both, left) = (next_both, next_left);
        if 10_000 <= round {
            collisions += round_collisions;
            frames += round_frames;
        }
    }
    collisions / frames
}

#[test]
fn val_two_saturated_stations_collide_as_the_markov_chain_says() {
    let mut dcf = Dcf::new(TIMING, 2);
    let mut frames = Vec::new();
    // A new payload waits whenever a frame has ended.
    for k in 0..90_000u64 {
        let at = k * 500_000;
        let carried = run(&mut dcf, &[(at, 0), (at, 1)], 2, SimTime::from_ns(at + 500_000), 3);
        frames.extend(carried.frames);
    }
    let lost = frames.iter().filter(|frame| frame.receivers.is_empty()).count() as f64;
    let share = lost / frames.len() as f64;
    let expected = saturated_pair(16);
    // Collisions come in pairs of frames: n / 2 trials. 4.5 standard deviations; the seed is fixed.
    let sd = (2.0 * expected * (1.0 - expected) / frames.len() as f64).sqrt();
    assert!(40_000 < frames.len(), "saturated: {}", frames.len());
    assert!((share - expected).abs() < 4.5 * sd, "{share} {expected}");
    // The formula of Bianchi (IEEE JSAC 18(3), 2000) for a constant window: τ = 2 / (W + 1), rounding apart.
    assert!((expected - 2.0 / 17.0).abs() < 1e-9, "{expected}");
}

#[test]
fn stopping_and_restoring_changes_nothing() {
    let arrivals: Vec<(u64, u32)> = (0..80).map(|k| (k * 700_000, (k % 5) as u32)).collect();
    let whole = run(&mut Dcf::new(TIMING, 5), &arrivals, 5, SimTime::from_ns(60_000_000), 9);
    let mut parts = Carried::default();
    let mut dcf = Dcf::new(TIMING, 5);
    for k in 0..6000 {
        let (from, until) = (k * 10_000, (k + 1) * 10_000);
        let now: Vec<(u64, u32)> =
            arrivals.iter().copied().filter(|(at, _)| (from..until).contains(at)).collect();
        let mut restored = Dcf::new(TIMING, 5);
        assert!(restored.resume(&dcf.state()));
        dcf = restored;
        parts.frames.extend(run(&mut dcf, &now, 5, SimTime::from_ns(until), 9).frames);
    }
    assert!(20 < whole.frames.len());
    assert_eq!(parts, whole);
    assert!(!Dcf::new(TIMING, 4).resume(&dcf.state()));
}
