//! Channel labels that are shifted by some channels.
//!
//! Where the model depends on the channel, by interference or by the frequency, the likelihood with all labels shifted back is compared
//! with that of the labels as they stand: of all rows, of each run, and of each receiver.

use super::evidence::Evidence;
use super::{Correction, Defect};
use crate::Estimate;
use crate::thresholds::MOST_CHANNEL_SHIFT;
use measure::links::LinkRow;
use std::collections::BTreeSet;

/// The name of this kind.
pub const NAME: &str = "channel-shift";
/// Channels of IEEE 802.15.4 in the band of 2.4 GHz.
const CHANNELS: (i16, i16) = (11, 26);

/// The rows that are shifted together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    All,
    Run(u32),
    Receiver(u32),
}

impl Part {
    fn has(self, row: &LinkRow) -> bool {
        match self {
            Self::All => true,
            Self::Run(run) => row.run == run,
            Self::Receiver(node) => row.rx == node,
        }
    }
}

/// All parts of the rows.
fn parts(rows: &[LinkRow]) -> Vec<Part> {
    let runs: BTreeSet<u32> = rows.iter().map(|row| row.run).collect();
    let receivers: BTreeSet<u32> = rows.iter().map(|row| row.rx).collect();
    let runs = runs.iter().filter(|_| 1 < runs.len()).map(|&run| Part::Run(run));
    let all = [Part::All].into_iter().chain(runs);
    all.chain(receivers.into_iter().map(Part::Receiver)).collect()
}

/// A row whose label is too high by `shift`; `None`: there is no such channel.
fn shifted_back(row: &LinkRow, shift: i16) -> Option<LinkRow> {
    let Some(label) = row.channel else { return Some(*row) };
    let channel = i16::from(label) - shift;
    let is_channel = (CHANNELS.0..=CHANNELS.1).contains(&channel);
    is_channel.then_some(LinkRow { channel: u8::try_from(channel).ok(), ..*row })
}

/// Looks for channel labels that are shifted.
#[must_use]
pub fn test(evidence: &Evidence<'_>) -> Option<Defect> {
    let rows = evidence.rows();
    let parts = parts(rows);
    let shifts: Vec<i16> =
        (-MOST_CHANNEL_SHIFT..=MOST_CHANNEL_SHIFT).filter(|&shift| shift != 0).collect();
    let n_tests = (parts.len() * shifts.len()) as f64;
    let mut best: Option<(i16, Part, f64, f64, f64)> = None;
    for &shift in &shifts {
        // Where one row of a part has no such channel, its labels are not shifted so; the row stays as it is for the others.
        let back: Vec<Option<LinkRow>> = rows.iter().map(|row| shifted_back(row, shift)).collect();
        let changed: Vec<LinkRow> =
            back.iter().zip(rows).map(|(back, row)| back.unwrap_or(*row)).collect();
        let Some(other) = evidence.alternative(&changed, false) else { continue };
        for &part in &parts {
            let is_in = |row: usize| part.has(&rows[row]);
            let is_possible = (0..rows.len()).all(|row| !is_in(row) || back[row].is_some());
            let (gain, p_value) = evidence.gain(&other, &is_in);
            if is_possible && 0.0 < gain && best.is_none_or(|(.., most)| most < gain) {
                let share = evidence.share_removed(&other, &is_in);
                best = Some((shift, part, p_value, share, gain));
            }
        }
    }
    let (shift, part, p_value, share, _) = best?;
    let replaced: Vec<(u32, LinkRow)> = (0..rows.len())
        .filter(|&row| part.has(&rows[row]) && rows[row].channel.is_some())
        .filter_map(|row| Some((row as u32, shifted_back(&rows[row], shift)?)))
        .collect();
    let (first, _) = replaced.first()?;
    let value = f64::from(shift);
    let of = match part {
        Part::All => String::new(),
        Part::Run(run) => format!(" of run {run}"),
        Part::Receiver(node) => format!(" of receiver {node}"),
    };
    Some(Defect {
        name: NAME,
        // Bonferroni over parts and shifts.
        p_value: (n_tests * p_value).min(1.0),
        share,
        estimates: vec![Estimate::new("shift_channels", "", value, (value, value))],
        nodes: if let Part::Receiver(node) = part { vec![node] } else { Vec::new() },
        runs: if let Part::Run(run) = part { vec![run] } else { Vec::new() },
        n_rows: replaced.len(),
        first_line: rows[*first as usize].line,
        clause: format!(
            "channel labels{of} are {} by {}",
            if 0 < shift { "too high" } else { "too low" },
            shift.abs()
        ),
        correction: Correction { replaced, ..Correction::default() },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::links::likelihood::tests::row;

    #[test]
    fn labels_are_shifted_back_within_the_band() {
        let labelled = |channel| LinkRow { channel: Some(channel), ..row(1.0, 1.0, -70.0) };
        let back = |channel, shift| shifted_back(&labelled(channel), shift)?.channel;
        assert_eq!(back(12, 1), Some(11));
        assert_eq!(back(11, 1), None);
        assert_eq!(back(26, -1), None);
        assert_eq!(back(25, -1), Some(26));
    }

    #[test]
    fn runs_are_parts_where_there_are_several() {
        let of = |run: u32| LinkRow { run, ..row(1.0, 1.0, -70.0) };
        assert_eq!(parts(&[of(1), of(1)]), [Part::All, Part::Receiver(2)]);
        let both = [Part::All, Part::Run(1), Part::Run(2), Part::Receiver(2)];
        assert_eq!(parts(&[of(1), of(2)]), both);
    }
}
