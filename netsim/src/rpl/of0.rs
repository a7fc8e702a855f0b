//! Objective function zero: RFC 6552, § 4.1, with the step of rank of RFC 8180, § 5.1.1.

use super::link::Etx;

/// MAXIMUM_STEP_OF_RANK: RFC 6552, § 6.3.
const MAX_STEP: u32 = 9;

/// The step of rank: floor(3 × ETX) − 2, 1 to 9; `None` if the link is too bad to be used.
#[must_use]
pub(crate) fn step_of_rank(etx: &Etx, max_etx_x128: u16) -> Option<u32> {
    if etx.exceeds(max_etx_x128) {
        return None;
    }
    let step = etx.times(3).saturating_sub(2).max(1);
    (step <= MAX_STEP).then_some(step)
}

/// The rise of rank over a hop: (factor × step + stretch) × MinHopRankIncrease.
#[must_use]
pub(crate) fn rank_increase(
    step: u32,
    rank_factor: u8,
    stretch: u8,
    min_hop_rank_increase: u16,
) -> u32 {
    (u32::from(rank_factor) * step + u32::from(stretch)) * u32::from(min_hop_rank_increase)
}

#[cfg(test)]
mod tests {
    use super::super::objective::Objective;
    use super::*;

    #[test]
    fn r1_ranks_over_hops_of_100_transmissions_and_75_acknowledgments() {
        // The example of RFC 8180, § 5.1.2.
        let etx = Etx::counted(100, 75);
        let mut ranks = vec![256];
        for _ in 0..5 {
            let last = ranks[ranks.len() - 1];
            ranks.push(Objective::of0().rank_via(last, &etx, 256).unwrap());
        }
        assert_eq!(ranks, [256, 768, 1280, 1792, 2304, 2816]);
        let dag_ranks: Vec<u16> = ranks.iter().map(|rank| rank / 256).collect();
        assert_eq!(dag_ranks, [1, 3, 5, 7, 9, 11]);
    }

    #[test]
    fn r2_the_step_of_rank_by_etx() {
        for (from, to, step) in [
            (100, 133, 1),
            (134, 166, 2),
            (167, 199, 3),
            (200, 233, 4),
            (234, 266, 5),
            (267, 299, 6),
            (300, 300, 7),
        ] {
            for n_tx in from..=to {
                let etx = Etx::counted(n_tx, 100);
                assert_eq!(step_of_rank(&etx, 384), Some(step), "{n_tx}");
                assert_eq!(rank_increase(step, 1, 0, 256), 256 * step);
            }
        }
        for n_tx in 301..500 {
            assert_eq!(step_of_rank(&Etx::counted(n_tx, 100), 384), None, "{n_tx}");
        }
    }

    #[test]
    fn r7_one_failure_more_than_an_etx_of_three_ends_a_link() {
        assert_eq!(step_of_rank(&Etx::counted(99, 33), 384), Some(7));
        assert_eq!(step_of_rank(&Etx::counted(100, 33), 384), None);
    }

    #[test]
    fn rfc6552_6_3_a_step_beyond_nine_is_none() {
        assert_eq!(step_of_rank(&Etx::counted(11, 3), u16::MAX), Some(9));
        assert_eq!(step_of_rank(&Etx::counted(12, 3), u16::MAX), None);
    }

    #[test]
    fn rfc6552_4_1_factor_and_stretch() {
        assert_eq!(rank_increase(3, 2, 1, 256), 7 * 256);
        assert_eq!(Objective::of0().rank_via(65000, &Etx::counted(1, 1), 256), Some(65256));
        assert_eq!(Objective::of0().rank_via(65300, &Etx::counted(1, 1), 256), None);
    }
}
