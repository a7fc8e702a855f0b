//! Which other effects explain most of what an effect moves.

use crate::score_test::Products;
use study::TermId;
use study::thresholds::{MOST_RIVALS_IN_A_SET, RIVAL_ADDS_SHARE};

/// The columns of an effect at one of its starts, by number.
pub(super) struct Group {
    pub(super) term: TermId,
    pub(super) columns: Vec<usize>,
}

/// The nearest rivals of an effect.
pub(super) struct RivalSet {
    /// Which effects, the one that explains most first.
    pub(super) terms: Vec<TermId>,
    /// The share R² that they explain together of what the effect moves beside all that was estimated.
    pub(super) explained: f64,
}

/// The set of rivals that is nearest to a column: the effect that explains most of it, and each further one that explains at least
/// [`RIVAL_ADDS_SHARE`] of what those before leave. `groups`: of the rivals.
pub(super) fn nearest(products: &Products, column: usize, groups: &[&Group]) -> RivalSet {
    let mut set = RivalSet { terms: Vec::new(), explained: 0.0 };
    let mut columns: Vec<usize> = Vec::new();
    while set.terms.len() < MOST_RIVALS_IN_A_SET {
        let others = groups.iter().filter(|group| !set.terms.contains(&group.term));
        let with =
            |group: &&Group| products.explained(column, &[&columns[..], &group.columns].concat());
        let all = others.map(|group| (with(group), *group));
        // Of equal ones the first.
        let best = all.reduce(|a, b| if a.0 < b.0 { b } else { a });
        let Some((explained, group)) = best else { break };
        let adds = (explained - set.explained) / (1.0 - set.explained);
        if !set.terms.is_empty() && (adds.is_nan() || adds < RIVAL_ADDS_SHARE) {
            break;
        }
        set.terms.push(group.term);
        set.explained = explained;
        columns.extend(&group.columns);
    }
    set
}
