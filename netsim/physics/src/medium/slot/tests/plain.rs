//! Slots against a plain reference: every listener by itself, every frame against every other, bit by bit.

use super::*;
use crate::asn::Asn;
use proptest::prelude::*;
use proto::ids::MoteId;

/// A whole slot to be resolved.
#[derive(Clone, Debug)]
struct Case {
    on_air: Vec<OnAir>,
    listening: Vec<Listening>,
    /// By sender and receiver; `None`: nothing arrives.
    links: Vec<Vec<Option<(f64, f64)>>>,
    asn: Asn,
    by_table: bool,
    lists: bool,
}

const N_MOTES: usize = 40;
const BIT: i64 = 4_000;

fn case() -> impl Strategy<Value = Case> {
    let link = prop_oneof![
        1 => Just(None),
        3 => (-104i32..-50, prop_oneof![Just(1.0), Just(0.0), 0.0..1.0f64])
            .prop_map(|(dbm, probability)| Some((f64::from(dbm), probability))),
    ];
    let links = prop::collection::vec(prop::collection::vec(link, N_MOTES), N_MOTES);
    // Begins and lengths in whole bits, so that the reference may step by them; close together, so that frames meet.
    let begins = prop_oneof![Just(0), 0i64..50, -280i64..280].prop_map(|bits| bits * BIT);
    let frame = (0..N_MOTES as u32, 11u8..13, begins, 0u16..128);
    let deviation = prop_oneof![Just(0), -300i64..300].prop_map(|bits| bits * BIT);
    let ear = (0..N_MOTES as u32, 11u8..14, deviation, prop::bool::weighted(0.1));
    let frames = prop::collection::vec(frame, 0..12);
    let ears = prop::collection::vec(ear, 0..2 * N_MOTES);
    (frames, ears, links, 0u64..1 << 40, any::<bool>(), any::<bool>()).prop_map(
        |(frames, ears, links, asn, by_table, lists)| {
            let mut on_air: Vec<OnAir> = Vec::new();
            for (sender, channel, starts_ns, psdu_bytes) in frames {
                if on_air.iter().all(|other| other.sender != MoteId(sender)) {
                    on_air.push(OnAir { sender: MoteId(sender), channel, starts_ns, psdu_bytes });
                }
            }
            let mut listening: Vec<Listening> = Vec::new();
            for (receiver, channel, deviation_ns, scans) in ears {
                if listening.iter().all(|other| other.receiver != MoteId(receiver)) {
                    listening.push(if scans {
                        Listening::scanning(MoteId(receiver), channel)
                    } else {
                        Listening::synchronised(MoteId(receiver), channel, deviation_ns)
                    });
                }
            }
            Case { on_air, listening, links, asn: Asn(asn), by_table, lists }
        },
    )
}

impl Case {
    fn air(&self) -> Matrix {
        let mut air = Matrix::new(N_MOTES);
        air.lists = self.lists;
        for (sender, row) in (0..).zip(&self.links) {
            for (receiver, link) in (0..).zip(row) {
                if let &Some((dbm, probability)) = link {
                    air.set(MoteId(sender), MoteId(receiver), dbm, probability);
                }
            }
        }
        air
    }

    fn rule(&self) -> Box<dyn Rule> {
        if self.by_table { by_table() } else { o_qpsk() }
    }

    fn slot(&self) -> Slot {
        Slot { asn: self.asn, begins_ns: 0 }
    }

    fn resolve(&self) -> Vec<Reception> {
        let mut medium = SlotMedium::new(SEED, self.rule(), false);
        let mut air = self.air();
        medium.resolve(&mut air, self.slot(), &self.on_air, &self.listening).to_vec()
    }

    fn span(frame: &OnAir) -> (i64, i64) {
        let begins_ns = 2_120_000 + frame.starts_ns;
        (begins_ns, begins_ns + 32_000 * (6 + i64::from(frame.psdu_bytes)))
    }

    /// What one listener receives.
    fn plain(&self, air: &Matrix, rule: &dyn Rule, ear: &Listening) -> Reception {
        if self.on_air.iter().any(|frame| frame.sender == ear.receiver) {
            return Reception::Idle;
        }
        let mut arriving: Vec<(i64, u32, u32)> = Vec::new();
        for (number, frame) in (0..).zip(&self.on_air) {
            let nothing = air.get(frame.sender, ear.receiver).is_nothing();
            if frame.channel == ear.channel && !nothing {
                arriving.push((Self::span(frame).0, frame.sender.0, number));
            }
        }
        arriving.sort_unstable();
        let arrival = |number: u32| air.get(self.on_air[number as usize].sender, ear.receiver);
        // The probability that a frame is received as far as `n_bits`, noise apart: bit by bit.
        let survival = |number: u32, n_bits: i64| {
            let (begins_ns, ends_ns) = Self::span(&self.on_air[number as usize]);
            let mut survival = 1.0;
            for bit in 0..n_bits {
                let now_ns = begins_ns + bit * BIT;
                let interference_mw: f64 = arriving
                    .iter()
                    .filter(|other| other.2 != number)
                    .filter(|other| {
                        let (from_ns, until_ns) = Self::span(&self.on_air[other.2 as usize]);
                        from_ns <= now_ns && now_ns < until_ns
                    })
                    .map(|other| rule.disturbance_mw(arrival(other.2).rssi_dbm))
                    .sum();
                let signal_dbm = arrival(number).rssi_dbm;
                survival *= rule.survival(signal_dbm, interference_mw, BIT, ends_ns - begins_ns);
            }
            survival
        };
        let succeeds = |number: u32, probability: f64| {
            let sender = self.on_air[number as usize].sender;
            uniform(Purpose::SlotReception, sender, ear.receiver, self.asn) < probability
        };
        let mut locked: Option<(i64, u32)> = None;
        for &(begins_ns, _, number) in &arriving {
            if begins_ns < ear.opens_ns || ear.closes_ns < begins_ns {
                continue;
            }
            if let Some((since_ns, before)) = locked {
                let is_stronger =
                    arrival(before).rssi_dbm + rule.capture_db() <= arrival(number).rssi_dbm;
                if since_ns + 160_000 <= begins_ns || !is_stronger {
                    continue;
                }
            }
            let (_, ends_ns) = Self::span(&self.on_air[number as usize]);
            let share = 160_000.0 / (ends_ns - begins_ns) as f64;
            let mut probability = libm::pow(arrival(number).reception_probability, share);
            // With one frame alone there is nothing to hide it.
            if rule.hides_preambles() && 1 < arriving.len() {
                probability *= survival(number, 40);
            }
            if succeeds(number, probability) {
                locked = Some((begins_ns, number));
            }
        }
        let Some((begins_ns, number)) = locked else { return Reception::Idle };
        let n_bits = (Self::span(&self.on_air[number as usize]).1 - begins_ns) / BIT;
        let probability = arrival(number).reception_probability * survival(number, n_bits);
        if succeeds(number, probability) {
            let rssi_dbm = arrival(number).rssi_dbm;
            Reception::Received { transmission: number, rssi_dbm }
        } else {
            Reception::Lost { transmission: number }
        }
    }
}

/// The same reception, of a frame by another place.
fn renumbered(reception: Reception, place: impl Fn(u32) -> u32) -> Reception {
    match reception {
        Reception::Idle => Reception::Idle,
        Reception::Lost { transmission } => Reception::Lost { transmission: place(transmission) },
        Reception::Received { transmission, rssi_dbm } => {
            Reception::Received { transmission: place(transmission), rssi_dbm }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    /// A draw would have to fall within the rounding of a probability, 1e-12, for the two to differ.
    #[test]
    fn a_slot_is_what_the_plain_reference_makes_of_it(case in case()) {
        let got = case.resolve();
        let (air, rule) = (case.air(), case.rule());
        for (ear, got) in case.listening.iter().zip(got) {
            prop_assert_eq!(got, case.plain(&air, &*rule, ear));
        }
    }

    #[test]
    fn order_and_lists_of_neighbours_do_not_matter(case in case()) {
        let plain = case.resolve();
        let mut other = case.clone();
        other.lists = !case.lists;
        prop_assert_eq!(&plain, &other.resolve());
        other.listening.reverse();
        let mut back = other.resolve();
        back.reverse();
        prop_assert_eq!(&plain, &back);
        let mut other = case.clone();
        other.on_air.reverse();
        let last = case.on_air.len() as u32;
        let back: Vec<Reception> = other
            .resolve()
            .into_iter()
            .map(|reception| renumbered(reception, |place| last - 1 - place))
            .collect();
        prop_assert_eq!(plain, back);
    }

    #[test]
    fn room_left_by_earlier_slots_does_not_matter(cases in prop::collection::vec(case(), 2..4)) {
        let mut medium = SlotMedium::new(SEED, o_qpsk(), false);
        for case in cases {
            let case = Case { by_table: false, ..case };
            let mut air = case.air();
            let got = medium.resolve(&mut air, case.slot(), &case.on_air, &case.listening).to_vec();
            prop_assert_eq!(got, case.resolve());
        }
    }
}
