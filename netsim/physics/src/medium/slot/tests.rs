//! Tests of slots: conformance, single effects, and a plain reference.

mod plain;

use super::*;
use crate::asn::Asn;
use crate::interference::o_qpsk::OQpsk;
use crate::interference::table::ByTable;
use crate::reception::Curve;
use crate::reception::o_qpsk::OQpsk as NoiseCurve;
use crate::timing::{BYTE_NS, SYNCHRONISATION_NS, airtime_ns};
use proto::ids::MoteId;
use proto::rng::{Draws, ordered_link};
use proto::time::SimDuration;

/// Who hears whom how strongly, and with which probability; the first index is the sender.
pub(super) struct Matrix {
    arrivals: Vec<Vec<Arrival>>,
    /// Whether senders list whom they reach.
    lists: bool,
    neighbours: Vec<MoteId>,
}

impl Matrix {
    fn new(n_motes: usize) -> Self {
        let arrivals = vec![vec![Arrival::NOTHING; n_motes]; n_motes];
        Self { arrivals, lists: false, neighbours: Vec::new() }
    }

    /// Sets one direction: power, probability without interference.
    fn set(&mut self, sender: MoteId, receiver: MoteId, rssi_dbm: f64, probability: f64) {
        self.arrivals[sender.index()][receiver.index()] = Arrival {
            rssi_dbm,
            register_rssi_dbm: rssi_dbm,
            shift_db: 0.0,
            reception_probability: probability,
        };
    }

    fn get(&self, sender: MoteId, receiver: MoteId) -> Arrival {
        self.arrivals[sender.index()][receiver.index()]
    }
}

impl Paths for Matrix {
    fn neighbours(&mut self, sender: MoteId) -> Option<&[MoteId]> {
        let row = &self.arrivals[sender.index()];
        self.neighbours.clear();
        let reached = (0..).zip(row).filter(|(_, arrival)| !arrival.is_nothing());
        self.neighbours.extend(reached.map(|(mote, _)| MoteId(mote)));
        self.lists.then_some(&self.neighbours)
    }

    fn arrivals(&mut self, sent: Sent, receivers: &[MoteId], arrivals: &mut Vec<Arrival>) {
        arrivals.extend(receivers.iter().map(|&receiver| self.get(sent.sender, receiver)));
    }
}

const SEED: u64 = 11;
const CHANNEL: u8 = 17;

fn slot(asn: Asn) -> Slot {
    Slot { asn, begins_ns: (asn * SimDuration::from_ns(10_000_000)).ns() }
}

pub(super) fn o_qpsk() -> Box<dyn Rule> {
    Box::new(OQpsk::new(-105.0, 3.0))
}

pub(super) fn by_table() -> Box<dyn Rule> {
    Box::new(ByTable::new(-105.0))
}

fn medium() -> SlotMedium {
    SlotMedium::new(SEED, o_qpsk(), false)
}

fn frame(sender: MoteId, starts_us: i64, psdu_bytes: u16) -> OnAir {
    OnAir { sender, channel: CHANNEL, starts_ns: starts_us * 1000, psdu_bytes }
}

fn listens(receiver: MoteId) -> Listening {
    Listening::synchronised(receiver, CHANNEL, 0)
}

fn is_received(reception: Reception, of: u32) -> bool {
    matches!(reception, Reception::Received { transmission, .. } if transmission == of)
}

fn uniform(purpose: Purpose, sender: MoteId, receiver: MoteId, asn: Asn) -> f64 {
    Draws::new(SEED, purpose).uniform(ordered_link(sender.0, receiver.0), asn.0, 0)
}

/// What becomes of a slot.
fn resolved(air: &mut Matrix, on_air: &[OnAir], listening: &[Listening]) -> Vec<Reception> {
    medium().resolve(air, slot(Asn(0)), on_air, listening).to_vec()
}

/// How many of 1000 slots mote 2 receives the frame of mote 0, where mote 1 sends too.
fn n_received(rule: Box<dyn Rule>, air: &mut Matrix, on_air: &[OnAir]) -> usize {
    let mut medium = SlotMedium::new(SEED, rule, false);
    (0..1000)
        .filter(|&asn| {
            is_received(medium.resolve(air, slot(Asn(asn)), on_air, &[listens(MoteId(2))])[0], 0)
        })
        .count()
}

#[test]
fn c4_a_single_frame_whose_draw_is_not_below_the_probability_is_lost() {
    let mut air = Matrix::new(2);
    air.set(MoteId(0), MoteId(1), -90.0, 0.5);
    let mut medium = medium();
    let mut n_lost = 0;
    for asn in 0..1000 {
        let got = medium.resolve(
            &mut air,
            slot(Asn(asn)),
            &[frame(MoteId(0), 0, 127)],
            &[listens(MoteId(1))],
        )[0];
        let u = uniform(Purpose::SlotReception, MoteId(0), MoteId(1), Asn(asn));
        // The header is 5 of 133 bytes.
        let header = libm::pow(0.5, 5.0 / 133.0);
        let expected = if u < 0.5 {
            Reception::Received { transmission: 0, rssi_dbm: -90.0 }
        } else if u < header {
            Reception::Lost { transmission: 0 }
        } else {
            Reception::Idle
        };
        assert_eq!(got, expected, "{u}");
        n_lost += usize::from(got == Reception::Lost { transmission: 0 });
    }
    assert!(400 < n_lost, "most failures are of frames that a receiver has locked on to");
}

#[test]
fn c5_without_collision_the_stated_probability_decides_whatever_the_power() {
    for rssi_dbm in [-10.0, -90.0, -97.0, -1000.0] {
        let mut air = Matrix::new(2);
        air.set(MoteId(0), MoteId(1), rssi_dbm, 1.0);
        let mut medium = medium();
        for asn in 0..1000 {
            let got = medium.resolve(
                &mut air,
                slot(Asn(asn)),
                &[frame(MoteId(0), 0, 100)],
                &[listens(MoteId(1))],
            );
            assert_eq!(got, [Reception::Received { transmission: 0, rssi_dbm }]);
        }
    }
}

#[test]
fn c6_acknowledgments_arrive_with_the_probability_of_the_way_back() {
    for (probability, at_least, at_most) in [(0.0, 0, 0), (0.5, 430, 570), (1.0, 1000, 1000)] {
        let mut air = Matrix::new(2);
        air.set(MoteId(0), MoteId(1), -60.0, 1.0);
        air.set(MoteId(1), MoteId(0), -60.0, probability);
        let mut medium = medium();
        let acknowledgment =
            Acknowledgment { transmission: 0, receiver: MoteId(1), psdu_bytes: 27 };
        let mut n_arrived = 0;
        for asn in 0..1000 {
            let on_air = [frame(MoteId(0), 0, 60)];
            assert!(is_received(
                medium.resolve(&mut air, slot(Asn(asn)), &on_air, &[listens(MoteId(1))])[0],
                0
            ));
            let got = medium.acknowledge(&mut air, slot(Asn(asn)), &on_air, &[acknowledgment])[0];
            let u = uniform(Purpose::SlotAcknowledgment, MoteId(1), MoteId(0), Asn(asn));
            assert_eq!(is_received(got, 0), u < probability);
            n_arrived += usize::from(is_received(got, 0));
        }
        // 4.4 standard deviations of 1000 draws.
        assert!((at_least..=at_most).contains(&n_arrived), "{n_arrived}");
    }
}

#[test]
fn perfect_acknowledgments_always_arrive() {
    let mut air = Matrix::new(4);
    for (sender, receiver) in [(0, 1), (2, 3), (0, 3), (2, 1)] {
        air.set(MoteId(sender), MoteId(receiver), -60.0, 1.0);
    }
    let mut medium = SlotMedium::new(SEED, o_qpsk(), true);
    let acknowledgments = [
        Acknowledgment { transmission: 0, receiver: MoteId(1), psdu_bytes: 27 },
        Acknowledgment { transmission: 1, receiver: MoteId(3), psdu_bytes: 27 },
    ];
    let on_air = [frame(MoteId(0), 0, 60), frame(MoteId(2), 0, 60)];
    let got = medium.acknowledge(&mut air, slot(Asn(0)), &on_air, &acknowledgments);
    assert!(is_received(got[0], 0) && is_received(got[1], 1));
}

#[test]
fn who_transmits_does_not_hear() {
    let mut air = Matrix::new(3);
    for (sender, receiver) in [(0, 1), (1, 0), (0, 2), (1, 2)] {
        air.set(MoteId(sender), MoteId(receiver), -60.0, 1.0);
    }
    let listening = [listens(MoteId(0)), listens(MoteId(1))];
    let got = resolved(&mut air, &[frame(MoteId(0), 0, 20), frame(MoteId(1), 0, 20)], &listening);
    assert_eq!(got, [Reception::Idle, Reception::Idle]);
}

#[test]
fn what_is_beyond_the_horizon_neither_arrives_nor_disturbs() {
    let mut air = Matrix::new(3);
    air.set(MoteId(0), MoteId(2), -60.0, 1.0);
    let got = resolved(
        &mut air,
        &[frame(MoteId(0), 0, 100), frame(MoteId(1), 0, 100)],
        &[listens(MoteId(2)), listens(MoteId(1))],
    );
    assert!(is_received(got[0], 0));
    assert_eq!(got[1], Reception::Idle);
}

#[test]
fn other_channels_are_not_heard_and_do_not_disturb() {
    let mut air = Matrix::new(4);
    for sender in [0, 1] {
        for receiver in [2, 3] {
            air.set(MoteId(sender), MoteId(receiver), -60.0, 1.0);
        }
    }
    let other = OnAir { channel: CHANNEL + 1, ..frame(MoteId(1), 0, 100) };
    let listening = [listens(MoteId(2)), Listening::synchronised(MoteId(3), CHANNEL + 2, 0)];
    let got = resolved(&mut air, &[frame(MoteId(0), 0, 100), other], &listening);
    assert!(is_received(got[0], 0));
    assert_eq!(got[1], Reception::Idle);
}

#[test]
fn ieee_802_15_4_8_4_3_3_3_a_frame_beyond_the_guard_time_is_not_heard() {
    let mut air = Matrix::new(2);
    air.set(MoteId(0), MoteId(1), -60.0, 1.0);
    for (starts_us, deviation_us, hears) in [
        (0, 0, true),
        (1100, 0, true),
        (-1100, 0, true),
        (1101, 0, false),
        (-1101, 0, false),
        (600, -500, true),
        (600, -501, false),
        (5000, 5000, true),
    ] {
        let ear = Listening::synchronised(MoteId(1), CHANNEL, deviation_us * 1000);
        let got = resolved(&mut air, &[frame(MoteId(0), starts_us, 50)], &[ear])[0];
        assert_eq!(is_received(got, 0), hears, "{starts_us} {deviation_us}");
        let scans = [Listening::scanning(MoteId(1), CHANNEL)];
        let got = resolved(&mut air, &[frame(MoteId(0), starts_us, 50)], &scans)[0];
        assert!(is_received(got, 0), "who scans hears it");
    }
}

#[test]
fn a_frame_beyond_the_guard_time_still_disturbs() {
    let mut air = Matrix::new(3);
    air.set(MoteId(0), MoteId(2), -60.0, 1.0);
    air.set(MoteId(1), MoteId(2), -50.0, 1.0);
    let got = resolved(
        &mut air,
        &[frame(MoteId(0), 0, 100), frame(MoteId(1), 1200, 100)],
        &[listens(MoteId(2))],
    )[0];
    assert_eq!(got, Reception::Lost { transmission: 0 });
}

#[test]
fn equal_frames_collide() {
    let mut air = Matrix::new(3);
    air.set(MoteId(0), MoteId(2), -60.0, 1.0);
    air.set(MoteId(1), MoteId(2), -60.0, 1.0);
    for starts_us in [0, 40, 500] {
        let on_air = [frame(MoteId(0), 0, 127), frame(MoteId(1), starts_us, 127)];
        for rule in [o_qpsk(), by_table()] {
            let name = format!("{rule:?}");
            let n = n_received(rule, &mut air, &on_air);
            assert!(n == 0, "{name} {starts_us}: {n}");
        }
    }
}

#[test]
fn a_stronger_frame_captures_under_o_qpsk_and_needs_26_db_under_the_table() {
    let mut air = Matrix::new(3);
    air.set(MoteId(0), MoteId(2), -60.0, 1.0);
    let on_air = [frame(MoteId(0), 0, 127), frame(MoteId(1), 0, 127)];
    for (rssi_dbm, o_qpsk_at_least, table_range) in
        [(-64.5, 990, 0..=0), (-72.0, 1000, 580..=720), (-86.0, 1000, 1000..=1000)]
    {
        air.set(MoteId(1), MoteId(2), rssi_dbm, 1.0);
        let n = n_received(o_qpsk(), &mut air, &on_air);
        assert!(o_qpsk_at_least <= n, "{rssi_dbm} dBm: {n}");
        let n = n_received(by_table(), &mut air, &on_air);
        // 0.6494 of 1000 at 12 dB, within 4.5 standard deviations.
        assert!(table_range.contains(&n), "{rssi_dbm} dBm: {n}");
    }
}

#[test]
fn within_the_header_a_stronger_frame_takes_over_and_after_it_only_destroys() {
    let mut air = Matrix::new(3);
    air.set(MoteId(0), MoteId(2), -80.0, 1.0);
    air.set(MoteId(1), MoteId(2), -60.0, 1.0);
    let mut outcome = |rule: Box<dyn Rule>, starts_us: i64| {
        let on_air = [frame(MoteId(0), 0, 127), frame(MoteId(1), starts_us, 127)];
        SlotMedium::new(SEED, rule, false).resolve(
            &mut air,
            slot(Asn(0)),
            &on_air,
            &[listens(MoteId(2))],
        )[0]
    };
    assert_eq!(SYNCHRONISATION_NS, 160_000);
    assert!(is_received(outcome(o_qpsk(), 100), 1));
    assert!(is_received(outcome(o_qpsk(), 159), 1));
    assert_eq!(outcome(o_qpsk(), 160), Reception::Lost { transmission: 0 });
    assert_eq!(outcome(by_table(), 100), Reception::Lost { transmission: 0 }, "no capture");
}

#[test]
fn q5_the_frame_that_is_not_locked_on_to_is_the_one_that_interferes() {
    // The later frame is listed first, as where the simulator replaces its lock and takes the wrong one for interference.
    let mut air = Matrix::new(3);
    air.set(MoteId(0), MoteId(2), -60.0, 1.0);
    air.set(MoteId(1), MoteId(2), -90.0, 1.0);
    let on_air = [frame(MoteId(1), 10, 127), frame(MoteId(0), 0, 127)];
    for rule in [o_qpsk(), by_table()] {
        let mut medium = SlotMedium::new(SEED, rule, false);
        let got = medium.resolve(&mut air, slot(Asn(0)), &on_air, &[listens(MoteId(2))])[0];
        assert!(is_received(got, 1), "30 dB above the other: {got:?}");
    }
}

#[test]
fn frames_that_overlap_in_part_disturb_in_part() {
    // 2.4 dB above the other: some bits are wrong.
    let rule = OQpsk::new(-105.0, 3.0);
    let mut air = Matrix::new(3);
    air.set(MoteId(0), MoteId(2), -60.0, 1.0);
    air.set(MoteId(1), MoteId(2), -62.4, 1.0);
    let whole_ns = airtime_ns(127);
    let mut before = 1001;
    for overlap_bytes in [0, 1, 10, 30, 60, 100] {
        // The second frame begins beyond the guard time, towards the end of the first.
        let begins_ns = whole_ns - overlap_bytes * BYTE_NS;
        let on_air =
            [frame(MoteId(0), 0, 127), OnAir { starts_ns: begins_ns, ..frame(MoteId(1), 0, 127) }];
        let n = n_received(o_qpsk(), &mut air, &on_air);
        let expected =
            rule.survival(-60.0, rule.disturbance_mw(-62.4), overlap_bytes * BYTE_NS, whole_ns);
        // 4.5 standard deviations of 1000 draws.
        let tolerance = 4.5 * (1000.0 * expected * (1.0 - expected)).sqrt() + 1e-6;
        assert!((n as f64 - 1000.0 * expected).abs() <= tolerance, "{overlap_bytes}: {n}");
        assert!(n < before || overlap_bytes == 1);
        before = n;
    }
}

#[test]
fn under_noise_and_interference_the_o_qpsk_curve_counts_noise_once() {
    // A weak frame, a disturbance as weak: reception is the curve over the sum of both, weighted.
    let rule = OQpsk::new(-105.0, 3.0);
    let (signal_dbm, other_dbm) = (-101.0, -105.0);
    let curve = NoiseCurve::new(-105.0, 133);
    let mut air = Matrix::new(3);
    air.set(MoteId(0), MoteId(2), signal_dbm, curve.reception_probability(signal_dbm));
    air.set(MoteId(1), MoteId(2), other_dbm, curve.reception_probability(other_dbm));
    let together_mw = libm::pow(10.0, -10.5) + rule.disturbance_mw(other_dbm);
    let expected =
        NoiseCurve::new(10.0 * libm::log10(together_mw), 133).reception_probability(signal_dbm);
    assert!((0.1..0.9).contains(&expected), "{expected}");
    let n = n_received(o_qpsk(), &mut air, &[frame(MoteId(0), 0, 127), frame(MoteId(1), 0, 127)]);
    // 4.5 standard deviations of 1000 draws.
    let tolerance = 4.5 * (1000.0 * expected * (1.0 - expected)).sqrt();
    assert!((n as f64 - 1000.0 * expected).abs() < tolerance, "{n}, expected {expected}");
}

/// Motes 0 and 2 send to 1 and 3, which acknowledge; all hear each other as `cross_dbm` says.
fn two_pairs(cross_dbm: f64) -> Matrix {
    let mut air = Matrix::new(4);
    for sender in 0..4 {
        for receiver in 0..4 {
            let own = sender / 2 == receiver / 2;
            if sender != receiver {
                air.set(MoteId(sender), MoteId(receiver), if own { -60.0 } else { cross_dbm }, 1.0);
            }
        }
    }
    air
}

/// How many of 1000 slots each frame is acknowledged.
fn n_acknowledged(air: &mut Matrix, on_air: &[OnAir; 2]) -> [usize; 2] {
    let acknowledgments = [(0, 1), (1, 3)].map(|(transmission, receiver)| Acknowledgment {
        transmission,
        receiver: MoteId(receiver),
        psdu_bytes: 27,
    });
    let mut medium = medium();
    let mut n = [0; 2];
    for asn in 0..1000 {
        let got = medium.acknowledge(air, slot(Asn(asn)), on_air, &acknowledgments);
        for (k, n) in n.iter_mut().enumerate() {
            *n += usize::from(is_received(got[k], k as u32));
        }
    }
    n
}

/// Of 264 bits at equal power hardly any come through whole.
const HARDLY_ANY: usize = 130;

#[test]
fn of_acknowledgments_as_strong_as_what_they_meet_one_in_twelve_arrives() {
    let rule = OQpsk::new(-105.0, 3.0);
    let whole_ns = airtime_ns(27);
    let expected = rule.survival(-60.0, rule.disturbance_mw(-60.0), whole_ns, whole_ns);
    let [first, _] =
        n_acknowledged(&mut two_pairs(-60.0), &[frame(MoteId(0), 0, 60), frame(MoteId(2), 0, 60)]);
    // Within 4.5 standard deviations of 1000 draws.
    let tolerance = 4.5 * (1000.0 * expected * (1.0 - expected)).sqrt();
    assert!((first as f64 - 1000.0 * expected).abs() < tolerance, "{first}, {expected}");
}

#[test]
fn acknowledgments_of_frames_of_equal_length_collide_where_they_are_equally_strong() {
    let on_air = [frame(MoteId(0), 0, 60), frame(MoteId(2), 0, 60)];
    let n = n_acknowledged(&mut two_pairs(-60.0), &on_air);
    assert!(n.iter().all(|&n| n < HARDLY_ANY), "{n:?}");
    assert_eq!(n_acknowledged(&mut two_pairs(-80.0), &on_air), [1000, 1000]);
}

#[test]
fn acknowledgments_meet_longer_frames_that_are_still_on_the_air_but_not_those_after_them() {
    // 70 bytes differ by 2.2 ms; an acknowledgment begins after 1 ms and takes 1.06 ms.
    let on_air = [frame(MoteId(0), 0, 10), frame(MoteId(2), 0, 80)];
    let mut air = two_pairs(-60.0);
    let [short, long] = n_acknowledged(&mut air, &on_air);
    assert!(short < HARDLY_ANY && long == 1000, "{short} {long}");
    air.set(MoteId(2), MoteId(0), -80.0, 1.0);
    assert_eq!(n_acknowledged(&mut air, &on_air), [1000, 1000]);
}

#[test]
fn an_acknowledgment_that_another_takes_for_its_own_is_no_acknowledgment() {
    // The other's acknowledgment is much the stronger at sender 0, which receives it instead of its own.
    let mut air = two_pairs(-60.0);
    air.set(MoteId(3), MoteId(0), -40.0, 1.0);
    let on_air = [frame(MoteId(0), 0, 60), frame(MoteId(2), 0, 60)];
    assert_eq!(n_acknowledged(&mut air, &on_air)[0], 0);
}

#[test]
fn two_who_acknowledge_one_frame_speak_to_one_ear() {
    let mut air = two_pairs(-60.0);
    air.set(MoteId(1), MoteId(0), -50.0, 1.0);
    let acknowledgments = [3, 1].map(|receiver| Acknowledgment {
        transmission: 0,
        receiver: MoteId(receiver),
        psdu_bytes: 27,
    });
    let mut medium = medium();
    let got =
        medium.acknowledge(&mut air, slot(Asn(0)), &[frame(MoteId(0), 0, 60)], &acknowledgments);
    assert_eq!(got[0], Reception::Lost { transmission: 0 });
    assert!(is_received(got[1], 1), "10 dB stronger");
}
