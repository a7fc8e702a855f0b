use super::first_best_arm::FirstBestArm;
use super::*;
use crate::mac::CellOptions;
use crate::mac::tsch::channel_at;
use crate::wire::Eui64;
use physics::asn::Asn;
use proptest::prelude::*;
use proto::ids::MoteId;
use proto::rng::{Draws, Purpose};

/// IEEE Std 802.15.4-2015's for 16 channels.
const SEQUENCE: [u8; 16] = [16, 17, 23, 18, 26, 15, 25, 22, 19, 11, 12, 13, 24, 14, 20, 21];

fn config(arms: u8) -> Config {
    Config {
        rule: Rule::FirstBestArm(FirstBestArm { arms, weight: 20 }),
        channels: u16::MAX,
        offsets: 16,
        spacing: 5,
        explore: 0.05,
        max_failures: 15,
    }
}

/// A link from mote 1 to mote 2 with one dedicated cell.
struct Pair {
    config: Config,
    ends: [Blacklists; 2],
    cells: [Cell; 2],
}

/// What became of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fate {
    FrameLost,
    AckLost,
    Acknowledged,
}

impl Pair {
    fn new(config: Config) -> Self {
        let [sender, receiver] = [1, 2].map(MoteId).map(Eui64::of_mote);
        let cells = [
            Cell::new(7, 3, CellOptions::TX, Some(receiver)),
            Cell::new(7, 3, CellOptions::RX, Some(sender)),
        ];
        Self { config, ends: std::array::from_fn(|_| Blacklists::default()), cells }
    }

    fn addresses(&self) -> [Eui64; 2] {
        [1, 2].map(MoteId).map(Eui64::of_mote)
    }

    /// The channels on which the two ends are in a slot.
    fn channels(&self, asn: Asn) -> [u8; 2] {
        let addresses = self.addresses();
        std::array::from_fn(|end| {
            self.ends[end].channel(&self.config, &SEQUENCE, addresses[end], &self.cells[end], asn)
        })
    }

    /// Sends a frame, which the receiver hears only if it is on the same channel.
    fn send(&mut self, asn: Asn, fate: impl Fn(u8) -> Fate) -> Fate {
        let [from, to] = self.addresses();
        let [channel, listens] = self.channels(asn);
        let carried = self.ends[0].offer(&self.config, from, to, asn);
        let fate = if channel == listens { fate(channel) } else { Fate::FrameLost };
        if let (Fate::AckLost | Fate::Acknowledged, Some(blacklist)) = (fate, carried) {
            self.ends[1].receive(from, blacklist);
        }
        let acknowledged = fate == Fate::Acknowledged;
        self.ends[0].learn(&self.config, to, channel, carried, acknowledged);
        fate
    }

    fn agree(&self) -> bool {
        let [from, to] = self.addresses();
        self.ends[0].of_sender(to) == self.ends[1].of_receiver(from)
    }
}

fn fates() -> impl Strategy<Value = Vec<Fate>> {
    let fate = prop_oneof![
        3 => Just(Fate::FrameLost),
        2 => Just(Fate::AckLost),
        5 => Just(Fate::Acknowledged),
    ];
    proptest::collection::vec(fate, 1..600)
}

proptest! {
    /// After 16 failures in a row the sender is back on the plain sequence by itself.
    #[test]
    fn without_lost_acknowledgments_both_ends_are_always_on_the_same_channel(
        fates in fates(), first in 0_u64..1 << 40, slots in 1_u64..200, arms in 1_u8..16,
    ) {
        let mut pair = Pair::new(config(arms));
        let mut n_failures = 0;
        for (asn, fate) in (first..).step_by(slots as usize).zip(fates) {
            let fate = if fate == Fate::AckLost { Fate::Acknowledged } else { fate };
            let fate = if n_failures == 15 { Fate::Acknowledged } else { fate };
            let [sends, listens] = pair.channels(Asn(asn));
            prop_assert_eq!(sends, listens);
            prop_assert_eq!(pair.send(Asn(asn), |_| fate), fate);
            prop_assert!(pair.agree());
            n_failures = if fate == Fate::Acknowledged { 0 } else { n_failures + 1 };
        }
    }

    /// Whatever is lost: they agree after each acknowledgment of a frame with a blacklist, and meet where the link explores.
    #[test]
    fn ends_that_disagree_meet_in_cells_that_explore_and_agree_after_the_next_acknowledgment(
        fates in fates(), first in 0_u64..1 << 40, slots in 1_u64..200, arms in 1_u8..16,
    ) {
        let mut pair = Pair::new(config(arms));
        let [from, to] = pair.addresses();
        for (asn, fate) in (first..).step_by(slots as usize).zip(fates) {
            let plain = channel_at(&SEQUENCE, Asn(asn), 3);
            let draw = Draws::new(0, Purpose::BlacklistExploration);
            let explores = draw.uniform(from.0 ^ to.0.rotate_left(32), asn, 0) < 0.05;
            if explores {
                prop_assert_eq!(pair.channels(Asn(asn)), [plain; 2]);
            }
            let carries = pair.ends[0].offer(&pair.config, from, to, Asn(asn)).is_some();
            let fate = pair.send(Asn(asn), |_| fate);
            if fate == Fate::Acknowledged && carries {
                prop_assert!(pair.agree());
            }
            // A disagreement is known to the sender, whose frames say what it wants until one is acknowledged.
            if !pair.agree() {
                prop_assert!(pair.ends[0].offer(&pair.config, from, to, Asn(asn + 1)).is_some());
            }
        }
    }
}

/// Delivery per transmission over `n` cells, with `jammed` channels that lose everything and others that lose nothing, from cell
/// `from` on.
fn delivery(config: Config, jammed: ChannelSet, n: u64, from: u64) -> f64 {
    let mut pair = Pair::new(config);
    let mut n_delivered = 0;
    for cell in 0..n {
        let fate = pair.send(Asn(7 + 101 * cell), |channel| {
            if jammed & set_of(channel) == 0 { Fate::Acknowledged } else { Fate::FrameLost }
        });
        n_delivered += u64::from(from <= cell && fate == Fate::Acknowledged);
    }
    n_delivered as f64 / (n - from) as f64
}

#[test]
fn with_a_fraction_of_channels_jammed_delivery_rises_to_one_but_for_exploration() {
    let (n, explore) = (40_000, 0.05);
    // Half of the channels with six arms, and three quarters with four.
    for (p, jammed, arms) in [(0.5, 0x00ff, 6), (0.75, 0x0fff, 4)] {
        let off = delivery(Config { explore: 1.0, ..config(arms) }, jammed, n, 0);
        assert!((off - (1.0 - p)).abs() < 1e-9, "{off}");
        // Of the cells that explore a fraction p is lost; all others are on clean channels.
        let on = delivery(Config { explore, ..config(arms) }, jammed, n, 5000);
        let expected = 1.0 - explore * p;
        // Three standard errors of the number of exploring cells.
        let tolerance = 3.0 * (explore * p * (1.0 - explore * p) / (n - 5000) as f64).sqrt();
        assert!((on - expected).abs() < tolerance, "{on} instead of {expected}");
    }
}

#[test]
fn a_channel_that_has_become_clean_is_used_again() {
    let mut pair = Pair::new(config(6));
    let lossy = |channel: u8| if channel < 19 { Fate::FrameLost } else { Fate::Acknowledged };
    let clean = |channel: u8| if channel < 19 { Fate::Acknowledged } else { Fate::FrameLost };
    for cell in 0..300 {
        pair.send(Asn(101 * cell), lossy);
    }
    let [_, to] = pair.addresses();
    assert_eq!(pair.ends[0].of_sender(to) & 0x00ff, 0x00ff);
    for cell in 300..3000 {
        pair.send(Asn(101 * cell), clean);
    }
    let used = !pair.ends[0].of_sender(to);
    assert_eq!((used & 0x00ff).count_ones(), 6, "{used:#018b}");
}

#[test]
fn the_best_channels_are_used_and_of_equal_ones_those_in_use() {
    let rule = FirstBestArm { arms: 2, weight: 20 };
    let mut quality = [100; N_CHANNELS];
    // Nothing was lost yet.
    assert_eq!(rule.blacklist(&quality, u16::MAX, 0), 0);
    quality[5] = 80;
    assert_eq!(rule.blacklist(&quality, u16::MAX, 0), !0b11);
    // Channels 20 and 21 are in use.
    let current = !(0b11 << 9);
    assert_eq!(rule.blacklist(&quality, u16::MAX, current), current);
    quality[9] = 99;
    assert_eq!(rule.blacklist(&quality, u16::MAX, current), !(1 << 10 | 1));
    // Only channels of the hopping sequence.
    assert_eq!(rule.blacklist(&quality, 0b1110_0000, 0), 0b0010_0000);
    // Integers, as in the authors' implementation: 80 after a failure, then 84.
    assert_eq!(
        [(100, false), (80, true), (96, true), (0, false)].map(|(q, a)| rule.learn(q, a)),
        [80, 84, 96, 0]
    );
}

#[test]
fn shared_beacon_and_nobodys_cells_are_not_dedicated() {
    let other = Some(Eui64::of_mote(MoteId(1)));
    let is = |options, neighbour| is_dedicated(&Cell::new(1, 0, options, neighbour));
    assert!(is(CellOptions::TX, other) && is(CellOptions::RX, other));
    assert!(!is(CellOptions::TX_SHARED, other) && !is(CellOptions::TX_RX_SHARED, None));
    assert!(!is(CellOptions::TX, None) && !is(CellOptions::RX, None));
    let beacons = Cell::new(1, 0, CellOptions::TX, other).of_kind(CellKind::Advertising);
    assert!(!is_dedicated(&beacons));
}
