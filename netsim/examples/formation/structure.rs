//! What a formed network looks like.

use proto::types::HeardLinks;

/// Of its links and its routing tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Structure {
    /// Neighbours that a mote has heard until then, mean.
    pub(crate) mean_degree: f64,
    /// Hops from a mote to the root, mean over all but the root.
    pub(crate) mean_depth: f64,
    /// Of all pairs of other motes, the share whose way along the tree leads through a mote: the greatest of a mote other
    /// than the root.
    pub(crate) greatest_betweenness: f64,
}

impl Structure {
    /// `parent[mote]`: its preferred parent, `u32::MAX` if it has none.
    pub(crate) fn from_parents(parent: &[u32], links: &HeardLinks) -> Self {
        let n = parent.len();
        let up = |mote: usize| parent.get(parent[mote] as usize).map(|_| parent[mote] as usize);
        let mut depth_sum = 0;
        // Motes of the subtree below a mote, itself included.
        let mut subtree = vec![1usize; n];
        for mote in 0..n {
            let mut at = mote;
            // A loop, if there should be one, ends after n hops.
            for _ in 0..n {
                let Some(next) = up(at) else { break };
                depth_sum += 1;
                subtree[next] += 1;
                at = next;
            }
        }
        let others = (n - 1) as f64;
        let pairs = |k: f64| k * (k - 1.0) / 2.0;
        let mut greatest_betweenness: f64 = 0.0;
        for mote in (0..n).filter(|&mote| up(mote).is_some()) {
            // Without it the tree falls apart into its children's subtrees and the rest: pairs within one part do not
            // need it.
            let within: f64 = (0..n)
                .filter(|&child| up(child) == Some(mote))
                .map(|child| pairs(subtree[child] as f64))
                .sum();
            let rest = pairs((n - subtree[mote]) as f64);
            let all = pairs(others);
            if 0.0 < all {
                greatest_betweenness = greatest_betweenness.max((all - within - rest) / all);
            }
        }
        Self {
            mean_degree: links.receiver.len() as f64 / n as f64,
            mean_depth: f64::from(depth_sum) / others.max(1.0),
            greatest_betweenness,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_with_a_branch() {
        // 0 ← 1 ← 2, 1 ← 3, 0 ← 4.
        let links = HeardLinks {
            receiver: vec![1, 2, 3, 4, 0],
            sender: vec![0, 1, 1, 0, 1],
            ..HeardLinks::default()
        };
        let structure = Structure::from_parents(&[u32::MAX, 0, 1, 1, 0], &links);
        // Of the six pairs of 0, 2, 3 and 4 all but (0, 4) need mote 1.
        let greatest_betweenness = 5.0 / 6.0;
        assert_eq!(
            structure,
            Structure { mean_degree: 1.0, mean_depth: 1.5, greatest_betweenness }
        );
    }
}
