//! The surveyed place of a node that stands still is wrong.
//!
//! Rows of a link, towards a square of the plane where its other end moves, have one mean residual: a cell. Senders and receivers have
//! levels of their own, so that a weak antenna is no wrong place, and cells have a variance of their own, so that shadowing is none. Both
//! come from the cells of all other nodes. First, the cells of a node must vary more than those, by Fisher's F. Then places are tried on a
//! grid about the surveyed one, and the best is refined. The statistic is the ratio of the likelihoods of the node's cells by
//! Student's t, which exceeds 1/p with a probability of at most p where the surveyed place is right. At the new place, the cells of
//! the node may vary no more than those of others do.

mod cells;
mod search;

use super::evidence::Evidence;
use super::{Correction, Defect};
use crate::Estimate;
use crate::thresholds::{MOST_WRONG_POSITIONS, NODE_MISPLACED_LEVEL};
use cells::{Cell, Levels};
use measure::links::LinkRow;
use search::Found;
use statrs::distribution::{ContinuousCDF as _, FisherSnedecor};
use std::collections::BTreeSet;

/// The name of this kind.
pub const NAME: &str = "wrong-position";

/// The upper tail of Fisher's F of a mean square of `freedom` over one of `others` degrees of freedom.
fn upper_tail(ratio: f64, freedom: f64, others: f64) -> f64 {
    FisherSnedecor::new(freedom, others).map_or(1.0, |law| law.sf(ratio))
}

/// A row with the antenna of a node elsewhere in the plane (m).
fn moved(row: &LinkRow, node: u32, place_m: [f64; 2]) -> LinkRow {
    let mut moved = *row;
    if row.tx == node {
        moved.tx_m[..2].copy_from_slice(&place_m);
    }
    if row.rx == node {
        moved.rx_m[..2].copy_from_slice(&place_m);
    }
    moved
}

/// A node that is found at another place, with the p-value of that.
struct Misplaced {
    node: u32,
    found: Found,
    p_value: f64,
}

/// The node for which another place is most likely, beside those that were found before, whose cells are left out.
fn most_likely(
    evidence: &Evidence<'_>,
    cells: &[Cell],
    nodes: &[u32],
    known: &[u32],
) -> Option<Misplaced> {
    let is_known = |cell: &Cell| known.contains(&cell.tx) || known.contains(&cell.rx);
    let cells: Vec<&Cell> = cells.iter().filter(|cell| !is_known(cell)).collect();
    let n_nodes = nodes.len() as f64;
    let one = |&node: &u32| {
        let (own, others): (Vec<&Cell>, Vec<&Cell>) =
            cells.iter().copied().partition(|cell| cell.has(node));
        let levels = Levels::new(&others)?;
        let node_cells = levels.of_node(node, &own)?;
        let by_variance =
            n_nodes * upper_tail(node_cells.mean_square(), node_cells.freedom(), levels.freedom);
        if NODE_MISPLACED_LEVEL < by_variance {
            return None;
        }
        let found = search::best_place(evidence, node, &node_cells, levels.freedom)?;
        let left = found.square / (node_cells.freedom() - 2.0);
        let is_as_others =
            NODE_MISPLACED_LEVEL < upper_tail(left, node_cells.freedom() - 2.0, levels.freedom);
        let by_ratio = n_nodes * found.n_places as f64 * libm::exp(-found.gain_nats);
        tracing::debug!(node, by_variance, by_ratio, is_as_others, place = ?found.place_m, "place");
        is_as_others.then(|| Misplaced { node, found, p_value: by_variance.max(by_ratio).min(1.0) })
    };
    let nodes = nodes.iter().filter(|node| !known.contains(node));
    nodes.filter_map(one).max_by(|a, b| a.found.gain_nats.total_cmp(&b.found.gain_nats))
}

/// Looks for nodes whose surveyed places are wrong.
#[must_use]
pub fn test(evidence: &Evidence<'_>) -> Option<Defect> {
    let cells = cells::cells(evidence)?;
    let still = evidence.modelled().still();
    let is_still = |node: &u32| still.get(node).copied().unwrap_or(false);
    let nodes: BTreeSet<u32> = cells.iter().flat_map(|cell| [cell.tx, cell.rx]).collect();
    let nodes: Vec<u32> = nodes.into_iter().filter(is_still).collect();
    let mut misplaced: Vec<Misplaced> = Vec::new();
    while misplaced.len() < MOST_WRONG_POSITIONS {
        let known: Vec<u32> = misplaced.iter().map(|one| one.node).collect();
        let Some(next) = most_likely(evidence, &cells, &nodes, &known) else { break };
        if !misplaced.is_empty() && NODE_MISPLACED_LEVEL < next.p_value {
            break;
        }
        misplaced.push(next);
    }
    defect(evidence, &misplaced)
}

fn defect(evidence: &Evidence<'_>, misplaced: &[Misplaced]) -> Option<Defect> {
    let first = misplaced.first()?;
    let rows = evidence.rows();
    let at_places = |row: &LinkRow| {
        misplaced.iter().fold(*row, |row, one| moved(&row, one.node, one.found.place_m))
    };
    let changed: Vec<LinkRow> = rows.iter().map(at_places).collect();
    let other = evidence.alternative(&changed, true)?;
    let mut nodes: Vec<u32> = misplaced.iter().map(|one| one.node).collect();
    nodes.sort_unstable();
    let is_in = |row: usize| nodes.contains(&rows[row].tx) || nodes.contains(&rows[row].rx);
    let concerned = || (0..rows.len()).filter(|&row| is_in(row));
    let replaced: Vec<(u32, LinkRow)> = concerned().map(|row| (row as u32, changed[row])).collect();
    let clauses: Vec<String> = misplaced
        .iter()
        .map(|one| {
            let Found { place_m: [x_m, y_m], shift_m, .. } = one.found;
            let node = one.node;
            format!("node {node} is {shift_m:.1} m from its surveyed place, at x {x_m:.1} and y {y_m:.1} m")
        })
        .collect();
    let estimate = |name: &str, value: f64, half: f64| {
        Estimate::new(name, "m", value, (value - half, value + half))
    };
    let Found { place_m, half_m, shift_m, .. } = first.found;
    let estimates = vec![
        estimate("x_m", place_m[0], half_m[0]),
        estimate("y_m", place_m[1], half_m[1]),
        estimate("shift_m", shift_m, half_m[0].max(half_m[1])),
    ];
    Some(Defect {
        name: NAME,
        p_value: first.p_value,
        share: evidence.share_removed(&other, &|_| true),
        estimates: if nodes.len() == 1 { estimates } else { Vec::new() },
        runs: Vec::new(),
        n_rows: replaced.len(),
        first_line: concerned().map(|row| rows[row].line).min()?,
        clause: clauses.join("; "),
        nodes,
        correction: Correction { replaced, ..Correction::default() },
    })
}
