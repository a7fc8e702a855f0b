//! Keyed random draws: each is a pure function of the seed, what it is for, whose it is, when, and which of several.
//!
//! Nothing is drawn in sequence, so a draw never depends on which others were made before it, on the number of agents,
//! on the order of iteration or on threads. The generator is Philox4x64-10 (Salmon, Moraes, Dror, Shaw: "Parallel random
//! numbers: as easy as 1, 2, 3", SC'11): the counter holds the entity, the time, the index and the purpose, the key holds
//! the seed. One call gives four independent 64-bit words.

use serde::{Deserialize, Serialize};

/// What a draw is for. The one list: a purpose is never reused or renumbered, so old seeds keep their meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[repr(u64)]
pub enum Purpose {
    /// Whether a frame is received. Entity: unordered link; time: begin of the period. Words 0 and 1 serve the frames from
    /// the lower number and from the higher one, words 2 and 3 levels of `experimental-randomness` that are redrawn then.
    Reception = 1,
    /// The level of `experimental-randomness` where it outlives a period. Entity: unordered link.
    RandomnessLevel = 2,
    /// The value of `shadowing`. Entity: unordered link.
    Shadowing = 3,
    /// Initial positions of a scenario. Entity: agent.
    Scenario = 4,
    /// A controller's own draws. Entity: agent.
    Control = 5,
    /// Noise on a measured position. Entity: agent.
    Localization = 6,
    /// The choice of links that a record samples. Entity: ordered link.
    RecordSample = 7,
    /// Noise on the strength of one frame (`noise_sd_db`). Entity: ordered link.
    FrameNoise = 8,
    /// Back-off and jitter of the MAC, in sequence. Entity: mote.
    Mac = 9,
    /// Choices of a scheduling function, in sequence. Entity: mote.
    Scheduling = 10,
    /// Jitter of routing: Trickle, DIS, DAO; in sequence. Entity: mote.
    Routing = 11,
    /// Jitter of the join protocol, in sequence. Entity: mote.
    Join = 12,
    /// Times and sizes of an application's packets, in sequence. Entity: mote.
    Application = 13,
    /// Clock error. Entity: mote; time: how often it was synchronised.
    Clock = 14,
    /// The channel on which a mote scans. Entity: mote; time: number of the dwell.
    Scan = 15,
    /// Whether a frame is received in a slot. Entity: ordered link; time: ASN.
    SlotReception = 16,
    /// Whether an acknowledgment is received in a slot. Entity: ordered link; time: ASN.
    SlotAcknowledgment = 17,
    /// Compression tags and other identifiers that begin at random, in sequence. Entity: mote.
    Lowpan = 18,
    /// The error of a node's transmitter or receiver (`node-offset`). Entity: node.
    NodeOffset = 19,
    /// The value of `multipath`. Entity: unordered link; time: number of the place.
    Multipath = 20,
    /// The value of `fast-fading`. Entity: ordered link; time: begin of the frame.
    FastFading = 21,
    /// Gusts of wind. Entity: axis; time: number of the gust.
    Gust = 22,
    /// Which blocks of measurements a resample has. Entity: resample; time: number of the draw.
    Resample = 23,
    /// Samples of a sweep's ranges. Entity: range; time: sample.
    Sweep = 24,
    /// Whether an acknowledgment is lost for `ack-loss`. Entity: ordered link; time: ASN.
    AckLoss = 25,
    /// The further error of a clock's rate (`clock-drift`). Entity: mote.
    ClockDrift = 26,
    /// When a mote reboots (`node-reboots`). Entity: mote; time: which of its reboots.
    Reboot = 27,
    /// Seeds of the runs that resimulate a measurement. Entity: number of the seed.
    Resimulation = 28,
    /// The value of `drift`. Entity: 0.
    Drift = 29,
    /// The value of `link-drift`. Entity: unordered link.
    LinkDrift = 30,
    /// Which effect `demo` hides, and how large it is. Entity: 0 of the effect, else which of its numbers.
    Demo = 31,
    /// Times, destinations and timeouts of the traffic kinds that have a stream per application (`poisson`, `coap`, `download`).
    /// Entity: mote; time: number of the application, or `u64::MAX` for the mote's first CoAP message ID.
    Traffic = 50,
    /// Times and places of the events of `event`, the same for all motes. Entity: number of the application; index: the event.
    TrafficEvent = 51,
    /// Whether a link follows the plain hopping sequence. Entity: ordered link, by its addresses; time: ASN. Of seed 0, since both
    /// ends must know it.
    BlacklistExploration = 55,
    /// Whether a frame of the second medium is lost. Entity: ordered link; time: begin of the frame.
    SecondMediumLoss = 60,
    /// Back-off of the second medium. Entity: mote; time: which of its back-offs.
    SecondMediumBackoff = 61,
    /// When in a control period a robot hands its payload to the second medium. Entity: mote.
    SecondMediumPhase = 62,
}

/// The draws of one purpose under one seed.
#[derive(Clone, Copy, Debug)]
pub struct Draws {
    seed: u64,
    purpose: Purpose,
}

impl Draws {
    /// Draws for `purpose` under `seed`.
    #[inline]
    #[must_use]
    pub fn new(seed: u64, purpose: Purpose) -> Self {
        Self { seed, purpose }
    }

    /// Four independent words for (entity, time, k).
    #[inline]
    #[must_use]
    pub fn words(self, entity: u64, time: u64, k: u64) -> [u64; 4] {
        philox4x64([entity, time, k, self.purpose as u64], [self.seed, KEY_HIGH])
    }

    /// As [`Draws::words`] for each of many entities: a third of the time each, for the processor works at several at once.
    ///
    /// # Panics
    ///
    /// If there are fewer places for words than entities.
    pub fn words_of(self, entities: &[u64], time: u64, k: u64, words: &mut [[u64; 4]]) {
        let words = &mut words[..entities.len()];
        for (words, &entity) in words.iter_mut().zip(entities) {
            *words = philox4x64([entity, time, k, self.purpose as u64], [self.seed, KEY_HIGH]);
        }
    }

    /// A uniform number in [0, 1) for (entity, time, k).
    #[inline]
    #[must_use]
    pub fn uniform(self, entity: u64, time: u64, k: u64) -> f64 {
        uniform(self.words(entity, time, k)[0])
    }

    /// A standard normal number for (entity, time, k).
    #[inline]
    #[must_use]
    pub fn normal(self, entity: u64, time: u64, k: u64) -> f64 {
        let [a, b, ..] = self.words(entity, time, k);
        normal(a, b)
    }
}

/// The entity of an ordered link. Independent of the number of agents.
#[inline]
#[must_use]
pub fn ordered_link(sender: u32, receiver: u32) -> u64 {
    u64::from(sender) << 32 | u64::from(receiver)
}

/// The entity of an unordered link: the same from both ends. Independent of the number of agents.
#[inline]
#[must_use]
pub fn unordered_link(a: u32, b: u32) -> u64 {
    ordered_link(a.min(b), a.max(b))
}

/// A uniform number in [0, 1) with 53 random bits, from the upper bits of a word.
#[inline]
#[must_use]
pub fn uniform(word: u64) -> f64 {
    (word >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// A standard normal number from two words (Box and Muller 1958).
#[inline]
#[must_use]
pub fn normal(a: u64, b: u64) -> f64 {
    // 1 - u lies in (0, 1]: the logarithm is finite.
    let radius = libm::sqrt(-2.0 * libm::log(1.0 - uniform(a)));
    radius * libm::cos(std::f64::consts::TAU * uniform(b))
}

/// Second word of every key: the fractional part of pi, so that seed 0 is not the all-zero key.
const KEY_HIGH: u64 = 0x243f_6a88_85a3_08d3;

/// Philox4x64 with ten rounds. Always inlined: in a loop the processor then works at several blocks at a time, which makes
/// one of them half as long.
#[inline(always)]
#[must_use]
pub fn philox4x64(counter: [u64; 4], key: [u64; 2]) -> [u64; 4] {
    let [mut c0, mut c1, mut c2, mut c3] = counter;
    let [mut k0, mut k1] = key;
    for _ in 0..10 {
        let p0 = u128::from(c0) * 0xd2e7_470e_e14c_6c93;
        let p1 = u128::from(c2) * 0xca5a_8263_9512_1157;
        (c0, c1, c2, c3) =
            ((p1 >> 64) as u64 ^ c1 ^ k0, p1 as u64, (p0 >> 64) as u64 ^ c3 ^ k1, p0 as u64);
        k0 = k0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        k1 = k1.wrapping_add(0xbb67_ae85_84ca_a73b);
    }
    [c0, c1, c2, c3]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_random123_known_answers_philox4x64_10() {
        // kat_vectors of the Random123 distribution.
        assert_eq!(
            philox4x64([0; 4], [0; 2]),
            [0x16554d9eca36314c, 0xdb20fe9d672d0fdc, 0xd7e772cee186176b, 0x7e68b68aec7ba23b]
        );
        assert_eq!(
            philox4x64([u64::MAX; 4], [u64::MAX; 2]),
            [0x87b092c3013fe90b, 0x438c3c67be8d0224, 0x9cc7d7c69cd777b6, 0xa09caebf594f0ba0]
        );
        assert_eq!(
            philox4x64(
                [0x243f6a8885a308d3, 0x13198a2e03707344, 0xa4093822299f31d0, 0x082efa98ec4e6c89],
                [0x452821e638d01377, 0xbe5466cf34e90c6c]
            ),
            [0xa528f45403e61d95, 0x38c72dbd566e9788, 0xa5a1610e72fd18b5, 0x57bd43b5e52b7fe6]
        );
    }

    #[test]
    fn many_at_once_are_those_one_by_one() {
        let draws = Draws::new(3, Purpose::Reception);
        let entities: Vec<u64> = (0..67).map(|i| unordered_link(i, 2 * i + 1)).collect();
        let mut words = [[0; 4]; 70];
        draws.words_of(&entities, 9, 2, &mut words);
        for (&entity, &words) in entities.iter().zip(&words) {
            assert_eq!(words, draws.words(entity, 9, 2));
        }
        assert_eq!(words[67..], [[0; 4]; 3]);
    }

    #[test]
    fn normals_have_zero_mean_and_unit_variance() {
        // n = 40,000: the mean's standard error is 0.005, the variance's 0.0071; both bounds are 4.5 of them,
        // which a correct generator exceeds for one seed in 150,000. The seed is fixed.
        let draws = Draws::new(7, Purpose::Shadowing);
        let values: Vec<f64> = (0..40_000).map(|entity| draws.normal(entity, 0, 0)).collect();
        let mean = values.iter().sum::<f64>() / 4e4;
        let variance =
            values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / 4e4;
        assert!(mean.abs() < 0.0225, "{mean}");
        assert!((variance - 1.0).abs() < 0.032, "{variance}");
    }

    #[test]
    fn a_link_has_the_same_entity_from_both_ends_only_if_unordered() {
        assert_eq!(unordered_link(3, 9), unordered_link(9, 3));
        assert_ne!(ordered_link(3, 9), ordered_link(9, 3));
    }
}
