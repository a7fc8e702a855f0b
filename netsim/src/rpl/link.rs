//! How many transmissions a frame takes to a neighbour: ETX.

use serde::{Deserialize, Serialize};

/// Transmissions over which the estimate forgets half of what it knew.
const WINDOW: u32 = 64;
/// Transmissions of one estimate of the 6TiSCH simulator.
const HUNDRED: u16 = 100;
/// Transmissions that make an estimate; fewer do not speak against an assumption. Half of those over which it forgets: of so
/// many a link that loses three of ten hardly ever loses two thirds.
const N_MEASURED: u16 = 32;
/// Counts are kept in parts of this, so that halving loses nothing that matters.
const SCALE: u32 = 256;

/// An estimate of ETX: transmissions by acknowledgments, both counted with a memory that fades.
///
/// Whenever the count of transmissions comes to 64, both counts are halved: the ratio stays, and the past weighs half from then
/// on. So the last 32 to 64 transmissions make most of the estimate, which needs no clock; a link that was never used has one
/// acknowledgment's worth of an assumed ETX, which a few frames outweigh, though only for the better among the first 32
/// transmissions: a first frame that is lost tells little of a link. Unlike an average of per-frame counts it knows
/// failures, too, whose number of transmissions never ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Etx {
    n_tx: u32,
    n_ack: u32,
    /// Transmissions since the last acknowledgment.
    n_failed: u16,
    /// Counted by hundreds: transmissions and acknowledgments of the hundred that is not full yet.
    hundred: (u16, u16),
    /// ETX × 128 that was assumed; 0: none was.
    assumed_x128: u16,
    /// Transmissions since then.
    n_counted: u16,
}

impl Etx {
    /// An assumption, of little weight: ETX × 128.
    #[must_use]
    pub fn assumed(etx_x128: u16) -> Self {
        let etx_x128 = etx_x128.max(128);
        Self {
            n_tx: u32::from(etx_x128) * SCALE / 128,
            n_ack: SCALE,
            assumed_x128: etx_x128,
            ..Self::counted(0, 0)
        }
    }

    /// Whether too little was sent over the link for the estimate to be good.
    #[must_use]
    pub(crate) fn is_vague(&self) -> bool {
        self.assumed_x128 != 0 && self.n_counted < N_MEASURED
    }

    /// Exactly `n_tx` transmissions, `n_ack` of them acknowledged.
    #[must_use]
    pub fn counted(n_tx: u16, n_ack: u16) -> Self {
        let (n_tx, n_ack) = (u32::from(n_tx) * SCALE, u32::from(n_ack) * SCALE);
        Self { n_tx, n_ack, n_failed: 0, hundred: (0, 0), assumed_x128: 0, n_counted: 0 }
    }

    /// A frame was sent `n_transmissions` times; the last one may have been acknowledged.
    pub fn count(&mut self, n_transmissions: u16, acknowledged: bool) {
        self.n_counted = self.n_counted.saturating_add(n_transmissions);
        self.n_tx = self.n_tx.saturating_add(u32::from(n_transmissions) * SCALE);
        if acknowledged {
            self.n_ack += SCALE;
            self.n_failed = 0;
        } else {
            self.n_failed = self.n_failed.saturating_add(n_transmissions);
        }
        while WINDOW * SCALE <= self.n_tx {
            self.n_tx /= 2;
            self.n_ack /= 2;
        }
    }

    /// Counts as the 6TiSCH simulator does: the estimate stays as it is until a hundred transmissions have been counted, and
    /// is then theirs. Ten without an acknowledgment among them make the link unusable at once.
    pub(crate) fn count_by_hundreds(&mut self, n_transmissions: u16, acknowledged: bool) {
        let (n_tx, n_ack) = &mut self.hundred;
        *n_tx = n_tx.saturating_add(n_transmissions);
        *n_ack += u16::from(acknowledged);
        self.n_failed = if *n_ack == 0 { *n_tx } else { 0 };
        if HUNDRED <= *n_tx {
            (self.n_tx, self.n_ack) = (u32::from(*n_tx) * SCALE, u32::from(*n_ack) * SCALE);
            self.hundred = (0, 0);
            self.assumed_x128 = 0;
        }
    }

    /// Transmissions since the last acknowledgment.
    #[must_use]
    pub fn n_failed(&self) -> u16 {
        self.n_failed
    }

    /// Transmissions by acknowledgments.
    fn ratio(&self) -> (u64, u64) {
        let counted = (u64::from(self.n_tx), u64::from(self.n_ack));
        let assumed = (u64::from(self.assumed_x128), 128);
        if self.is_vague() && assumed.0 * counted.1 < counted.0 * assumed.1 {
            assumed
        } else {
            counted
        }
    }

    /// floor(n × ETX), exactly; the largest number if nothing was ever acknowledged.
    #[must_use]
    pub fn times(&self, n: u32) -> u32 {
        let (n_tx, n_ack) = self.ratio();
        (n_tx * u64::from(n))
            .checked_div(n_ack)
            .map_or(u32::MAX, |product| u32::try_from(product).unwrap_or(u32::MAX))
    }

    /// Whether ETX × 128 exceeds a bound (exactly, without rounding).
    #[must_use]
    pub fn exceeds(&self, bound_x128: u16) -> bool {
        let (n_tx, n_ack) = self.ratio();
        u64::from(bound_x128) * n_ack < n_tx * 128
    }

    /// ETX × 128 as RFC 6719, § 3.1, and RFC 6551, § 4.3.2, write it, rounded to the nearest.
    #[must_use]
    pub(crate) fn x128(&self) -> u16 {
        u16::try_from((self.times(256).saturating_add(1)) / 2).unwrap_or(u16::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dice::Dice;
    use proto::ids::MoteId;
    use proto::rng::Purpose;

    #[test]
    fn an_assumption_gives_way_to_a_few_frames() {
        let mut etx = Etx::assumed(384);
        assert_eq!(etx.x128(), 384);
        etx.count(1, true);
        assert_eq!(etx.x128(), 256);
        for _ in 0..9 {
            etx.count(1, true);
        }
        assert!(etx.x128() < 152);
    }

    #[test]
    fn halving_keeps_the_ratio() {
        let mut etx = Etx::counted(63, 21);
        let before = etx.x128();
        etx.count(3, true);
        assert!(etx.x128().abs_diff(before) <= 1);
        assert!(etx.n_tx < WINDOW * SCALE);
    }

    #[test]
    fn the_estimate_follows_a_link_and_its_change() {
        let mut dice = Dice::new(5, Purpose::Routing, MoteId(0));
        let mut etx = Etx::assumed(384);
        for (pdr, truth) in [(1.0, 1.0), (0.5, 2.0), (0.8, 1.25)] {
            for _ in 0..300 {
                let mut n = 1;
                while pdr <= dice.uniform() {
                    n += 1;
                }
                etx.count(n, true);
            }
            // At least 64 transmissions: the ratio's standard deviation is at most 0.18 (PDR 0.5); three of them.
            let estimate = f64::from(etx.x128()) / 128.0;
            assert!((estimate - truth).abs() < 0.54, "{estimate} {truth}");
        }
    }

    #[test]
    fn a_first_frame_that_is_lost_does_not_end_a_link_that_was_assumed_to_be_usable() {
        let mut etx = Etx::assumed(384);
        for n_sent in 1..32 {
            etx.count(1, n_sent % 5 == 0);
            assert!(!etx.exceeds(384), "{n_sent}");
        }
        etx.count(1, false);
        assert!(etx.exceeds(384));
        // Good news counts at once, and what follows it.
        let mut etx = Etx::assumed(384);
        etx.count(1, true);
        etx.count(1, false);
        assert_eq!(etx.x128(), 5 * 64);
    }

    #[test]
    fn failures_worsen_the_estimate_and_an_acknowledgment_ends_their_row() {
        let mut etx = Etx::counted(1, 1);
        etx.count(5, false);
        etx.count(5, false);
        assert_eq!(etx.n_failed(), 10);
        assert_eq!(etx.x128(), 11 * 128);
        etx.count(2, true);
        assert_eq!(etx.n_failed(), 0);
    }

    #[test]
    fn q23_a_hundred_failures_are_no_accident_of_arithmetic() {
        let mut etx = Etx::assumed(384);
        for _ in 0..10_000 {
            etx.count(u16::MAX, false);
        }
        assert!(etx.exceeds(u16::MAX - 1));
        assert_eq!(etx.n_failed(), u16::MAX);
        assert_eq!(Etx::counted(100, 0).times(3), u32::MAX);
    }
}
