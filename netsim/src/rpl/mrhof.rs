//! Minimum rank with hysteresis, over ETX: RFC 6719, § 3.

use super::link::Etx;

/// Rank through a neighbour. The metric is ETX, which is carried in the rank itself (§ 3.5): the cost of the path is the
/// neighbour's rank and the link's ETX × 128, and rank rises by at least MinHopRankIncrease (§ 3.3). `None` beyond
/// MAX_LINK_METRIC or MAX_PATH_COST (§ 3.2.2).
#[must_use]
pub(crate) fn rank_via(
    rank: u16,
    etx: &Etx,
    max_link_metric: u16,
    max_path_cost: u16,
    min_hop_rank_increase: u16,
) -> Option<u32> {
    if etx.exceeds(max_link_metric) {
        return None;
    }
    let cost = u32::from(rank) + u32::from(etx.x128());
    (cost <= u32::from(max_path_cost))
        .then(|| cost.max(u32::from(rank) + u32::from(min_hop_rank_increase)))
}

#[cfg(test)]
mod tests {
    use super::super::objective::Objective;
    use super::*;

    #[test]
    fn rfc6719_3_3_rank_is_the_path_cost_but_rises_by_a_hop_at_least() {
        let mrhof = Objective::mrhof();
        assert_eq!(mrhof.rank_via(256, &Etx::counted(1, 1), 256), Some(512));
        assert_eq!(mrhof.rank_via(256, &Etx::counted(3, 1), 256), Some(640));
    }

    #[test]
    fn rfc6719_3_2_2_links_and_paths_have_bounds() {
        let mrhof = Objective::mrhof();
        assert_eq!(mrhof.rank_via(256, &Etx::counted(4, 1), 256), Some(768));
        assert_eq!(mrhof.rank_via(256, &Etx::counted(401, 100), 256), None);
        assert_eq!(mrhof.rank_via(32768 - 128, &Etx::counted(1, 1), 64), Some(32768));
        assert_eq!(mrhof.rank_via(32768 - 127, &Etx::counted(1, 1), 64), None);
    }
}
