//! Sender and receiver that are exchanged in some rows.
//!
//! Where the model depends on the end, as by offsets of nodes, the likelihood with the ends exchanged is compared with that of the rows as they
//! stand: of each run, of each sender, of each receiver, and of the rows of a sender that contradict a frame. A frame has one sender; of
//! rows of the same moment and channel, one whose receiver is the sender of the others contradicts them.
//!
//! All rows together are compared only where most moments have several senders and one receiver: else offsets that are configured the
//! wrong way round look the same.

use super::evidence::Evidence;
use super::{Correction, Defect};
use crate::thresholds::{FEWEST_REVERSED_MOMENTS, FEWEST_SWAPPED_ROWS, MOST_REGULAR_MOMENTS};
use measure::links::LinkRow;
use std::collections::{BTreeMap, BTreeSet};

/// The name of this kind.
pub const NAME: &str = "swapped-ends";

/// The rows whose ends are exchanged together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    All,
    Run(u32),
    Sender(u32),
    Receiver(u32),
    /// Rows of a sender that contradict their frames: the log of one receiver.
    Contradicting(u32),
}

impl Part {
    fn has(self, row: &LinkRow, contradicts: bool) -> bool {
        match self {
            Self::All => true,
            Self::Run(run) => row.run == run,
            Self::Sender(node) => row.tx == node,
            Self::Receiver(node) => row.rx == node,
            Self::Contradicting(node) => row.tx == node && contradicts,
        }
    }

    fn words(self) -> String {
        match self {
            Self::All => "in all rows".to_owned(),
            Self::Run(run) => format!("in run {run}"),
            Self::Sender(node) => format!("in the rows of sender {node}"),
            Self::Receiver(node) => format!("in the rows of receiver {node}"),
            Self::Contradicting(node) => format!("in the log of receiver {node}"),
        }
    }
}

/// A row with its ends exchanged.
fn exchanged(row: &LinkRow) -> LinkRow {
    LinkRow {
        tx: row.rx,
        rx: row.tx,
        tx_m: row.rx_m,
        rx_m: row.tx_m,
        tx_heading_rad: row.rx_heading_rad,
        rx_heading_rad: row.tx_heading_rad,
        ..*row
    }
}

/// Rows of each moment and channel.
fn frames(rows: &[LinkRow]) -> Vec<Vec<usize>> {
    let mut frames: BTreeMap<(u32, u64, u8), Vec<usize>> = BTreeMap::new();
    for (index, row) in rows.iter().enumerate().filter(|(_, row)| row.time_s.is_finite()) {
        let key = (row.run, row.time_s.to_bits(), row.channel.unwrap_or(0));
        frames.entry(key).or_default().push(index);
    }
    frames.into_values().collect()
}

/// Whether each row contradicts its frame: two others at least have one sender, which is its receiver.
fn contradicting(rows: &[LinkRow], frames: &[Vec<usize>]) -> Vec<bool> {
    let mut contradicts = vec![false; rows.len()];
    for frame in frames {
        for &row in frame {
            let sender = rows[row].rx;
            let n_agree = frame.iter().filter(|&&other| rows[other].tx == sender).count();
            let n_own = frame.iter().filter(|&&other| rows[other].tx == rows[row].tx).count();
            contradicts[row] = 2 <= n_agree && n_own < n_agree;
        }
    }
    contradicts
}

/// Whether most moments have several senders and one receiver, rather than one sender and several receivers.
fn is_reversed(rows: &[LinkRow], frames: &[Vec<usize>]) -> bool {
    let (mut n_reversed, mut n_regular) = (0_usize, 0_usize);
    for frame in frames {
        let senders: BTreeSet<u32> = frame.iter().map(|&row| rows[row].tx).collect();
        let receivers: BTreeSet<u32> = frame.iter().map(|&row| rows[row].rx).collect();
        n_reversed += usize::from(receivers.len() == 1 && 2 < senders.len());
        n_regular += usize::from(senders.len() == 1 && 2 < receivers.len());
    }
    FEWEST_REVERSED_MOMENTS <= n_reversed
        && n_regular as f64 <= MOST_REGULAR_MOMENTS * n_reversed as f64
}

/// Looks for rows whose ends are exchanged.
#[must_use]
pub fn test(evidence: &Evidence<'_>) -> Option<Defect> {
    let rows = evidence.rows();
    let changed: Vec<LinkRow> = rows.iter().map(exchanged).collect();
    let other = evidence.alternative(&changed, false)?;
    let frames = frames(rows);
    let contradicts = contradicting(rows, &frames);
    let runs: BTreeSet<u32> = rows.iter().map(|row| row.run).collect();
    let nodes: BTreeSet<u32> = rows.iter().flat_map(|row| [row.tx, row.rx]).collect();
    let runs = runs.iter().filter(|_| 1 < runs.len()).map(|&run| Part::Run(run));
    let of_node =
        |&node: &u32| [Part::Sender(node), Part::Receiver(node), Part::Contradicting(node)];
    let all = is_reversed(rows, &frames).then_some(Part::All);
    let parts: Vec<Part> =
        all.into_iter().chain(runs).chain(nodes.iter().flat_map(of_node)).collect();
    let mut best: Option<(Part, f64, f64)> = None;
    for &part in &parts {
        let is_in = |row: usize| part.has(&rows[row], contradicts[row]);
        if (0..rows.len()).filter(|&row| is_in(row)).count() < FEWEST_SWAPPED_ROWS {
            continue;
        }
        let (gain, p_value) = evidence.gain(&other, &is_in);
        if 0.0 < gain && best.is_none_or(|(.., most)| most < gain) {
            best = Some((part, p_value, gain));
        }
    }
    let (part, p_value, _) = best?;
    let is_in = |row: usize| part.has(&rows[row], contradicts[row]);
    let replaced: Vec<(u32, LinkRow)> =
        (0..rows.len()).filter(|&row| is_in(row)).map(|row| (row as u32, changed[row])).collect();
    let (first, _) = replaced.first()?;
    Some(Defect {
        name: NAME,
        p_value: (parts.len() as f64 * p_value).min(1.0),
        share: evidence.share_removed(&other, &is_in),
        estimates: Vec::new(),
        nodes: match part {
            Part::Sender(node) | Part::Receiver(node) | Part::Contradicting(node) => vec![node],
            Part::All | Part::Run(_) => Vec::new(),
        },
        runs: if let Part::Run(run) = part { vec![run] } else { Vec::new() },
        n_rows: replaced.len(),
        first_line: rows[*first as usize].line,
        clause: format!("sender and receiver are exchanged {}", part.words()),
        correction: Correction { replaced, ..Correction::default() },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::links::likelihood::tests::row;

    fn at(time_s: f64, tx: u32, rx: u32) -> LinkRow {
        LinkRow { time_s, tx, rx, channel: Some(20), ..row(1.0, 1.0, -70.0) }
    }

    #[test]
    fn a_row_contradicts_the_frame_that_its_receiver_sent() {
        // Node 1 sends; the log of node 4 has the ends exchanged.
        let rows = [at(1.0, 1, 2), at(1.0, 1, 3), at(1.0, 4, 1), at(2.0, 4, 1)];
        assert_eq!(contradicting(&rows, &frames(&rows)), [false, false, true, false]);
        // One other row does not suffice.
        let rows = [at(1.0, 1, 2), at(1.0, 4, 1)];
        assert_eq!(contradicting(&rows, &frames(&rows)), [false, false]);
    }

    #[test]
    fn a_log_is_reversed_where_several_send_and_one_receives() {
        let frame = |time_s: f64| [at(time_s, 2, 1), at(time_s, 3, 1), at(time_s, 4, 1)];
        let rows: Vec<LinkRow> = (0..10).flat_map(|k| frame(f64::from(k))).collect();
        assert!(is_reversed(&rows, &frames(&rows)));
        assert!(!is_reversed(&rows[3..], &frames(&rows[3..])));
        let back: Vec<LinkRow> = rows.iter().map(exchanged).collect();
        assert!(!is_reversed(&back, &frames(&back)));
    }
}
