//! Sequence numbers of packets and frames: gaps, restarts.

use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeSet;

/// What the sequence numbers of one source in one run say; of frames, those that one receiver logged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct SequenceGaps {
    /// Number of the run.
    pub run: u32,
    /// Number of the node that created the packets, or sent the frames.
    pub source: u32,
    /// Number of the node that logged the frames; null for packets.
    pub receiver: Option<u32>,
    /// Packets that arrived, or frames that the receiver logged, duplicates not counted.
    pub arrived: usize,
    /// Packets that are missing between two that arrived, or frames that the receiver did not log.
    pub missing: usize,
    /// How often the numbers began anew; what was lost just before is not known.
    pub restarts: usize,
    /// Line of the first packet or frame after a gap; 0: there is none.
    pub first_line: usize,
}

/// A packet or frame with a sequence number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Numbered {
    /// When it was created, or logged (ns).
    pub created_ns: i64,
    /// Its sequence number.
    pub sequence: u32,
    /// Its row in the frame.
    pub row: usize,
    /// Line of the log.
    pub line: usize,
}

/// Numbers of packets have 16 bits, unless the mapping says otherwise.
pub(crate) const MODULUS_OF_PACKETS: u64 = 1 << 16;
/// A packet may come out of order by as many numbers.
pub(crate) const OUT_OF_ORDER: u32 = 32;
/// Numbers may pass at as many times the usual pace, beside [`OUT_OF_ORDER`] numbers at once.
const GREATEST_PACE: f64 = 4.0;

/// How the numbers of a source count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Counting {
    /// They begin anew after the number before this one.
    pub modulus: u64,
    /// The median time from one number to the next (ns); `None`: numbers may pass at any pace.
    pub period_ns: Option<f64>,
}

impl Counting {
    /// By how much the number increases from one to a later one, if it may be a count that went on.
    ///
    /// Numbers increase, or increase modulo `modulus` by less than half of that. They do not increase much faster than usual: if they
    /// seem to, the source restarted, or a number is damaged.
    pub(crate) fn step(&self, before: &Numbered, after: &Numbered) -> Option<u64> {
        let (from, to) = (u64::from(before.sequence), u64::from(after.sequence));
        let step = match to.checked_sub(from) {
            Some(step) => step,
            None if from < self.modulus => to + self.modulus - from,
            None => return None,
        };
        if to < from && self.modulus / 2 <= step {
            return None;
        }
        let elapsed_ns = after.created_ns.saturating_sub(before.created_ns) as f64;
        let is_usual = |period_ns: f64| {
            step as f64 <= f64::from(OUT_OF_ORDER) + GREATEST_PACE * elapsed_ns / period_ns
        };
        self.period_ns.is_none_or(is_usual).then_some(step)
    }
}

/// Packets that are missing between two that arrived.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Gap {
    before: Numbered,
    /// The packet after the gap.
    pub after: Numbered,
    /// By how much the number increases.
    step: u64,
    modulus: u64,
    /// Which of the numbers arrived late, as their distance from the number before the gap.
    late: BTreeSet<u64>,
}

impl Gap {
    /// How many packets are missing.
    pub(crate) fn n_missing(&self) -> usize {
        self.step as usize - 1 - self.late.len()
    }

    /// The missing packets. Their creation times are interpolated linearly; row and line are those of the packet after the gap.
    pub(crate) fn missing(&self) -> impl Iterator<Item = Numbered> {
        let is_missing = |distance: &u64| !self.late.contains(distance);
        (1..self.step).filter(is_missing).map(|distance| {
            let span_ns = i128::from(self.after.created_ns) - i128::from(self.before.created_ns);
            let later_ns = span_ns * i128::from(distance) / i128::from(self.step);
            let number = u64::from(self.before.sequence) + distance;
            let number = if self.is_wrapped() { number % self.modulus } else { number };
            Numbered {
                // Between two times, so it fits; the number likewise.
                created_ns: self.before.created_ns + later_ns as i64,
                sequence: number as u32,
                ..self.after
            }
        })
    }

    fn is_wrapped(&self) -> bool {
        self.after.sequence < self.before.sequence
    }

    /// Marks a packet that arrived after a later one; false: it is not missing in this gap.
    fn fill(&mut self, sequence: u32) -> bool {
        let is_ahead = self.is_wrapped() && sequence < self.before.sequence;
        let ahead = if is_ahead { self.modulus } else { 0 };
        let distance =
            (u64::from(sequence) + ahead).saturating_sub(u64::from(self.before.sequence));
        (1..self.step).contains(&distance) && self.late.insert(distance)
    }
}

/// What is missing in the numbers of one source.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Gaps {
    pub gaps: Vec<Gap>,
    /// How often the numbers began anew.
    pub restarts: usize,
}

impl Gaps {
    /// How many packets are missing.
    pub(crate) fn n_missing(&self) -> usize {
        self.gaps.iter().map(Gap::n_missing).sum()
    }
}

/// Finds gaps in the sequence numbers of one source.
///
/// A gap lies between two packets between which the count goes on. A smaller number is a late packet if it is missing in a gap within
/// the 32 numbers before; otherwise the numbers began anew, which is no gap.
///
/// * `packets`: without duplicates, in order of time.
pub(crate) fn gaps(packets: &[Numbered], counting: Counting) -> Gaps {
    let mut gaps: Vec<Gap> = Vec::new();
    let mut restarts = 0;
    // Where the gaps begin that lie after the latest restart.
    let mut continued = 0;
    let mut last = packets.first().copied();
    for packet in packets.iter().skip(1) {
        let Some(before) = last else { break };
        if let Some(step) = counting.step(&before, packet) {
            if 1 < step {
                let late = BTreeSet::new();
                gaps.push(Gap { before, after: *packet, step, modulus: counting.modulus, late });
            }
            last = Some(*packet);
            continue;
        }
        let back = before.sequence.checked_sub(packet.sequence);
        let is_late = back.is_some_and(|back| back <= OUT_OF_ORDER)
            && gaps[continued..]
                .iter_mut()
                .rev()
                .take(OUT_OF_ORDER as usize)
                .any(|gap| gap.fill(packet.sequence));
        if !is_late {
            restarts += 1;
            continued = gaps.len();
            last = Some(*packet);
        }
    }
    Gaps { gaps, restarts }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OF_PACKETS: Counting = Counting { modulus: MODULUS_OF_PACKETS, period_ns: None };

    fn found(numbers: &[u32], counting: Counting) -> Gaps {
        let at = |(line, &sequence): (usize, &u32)| Numbered {
            created_ns: 60 * line as i64,
            sequence,
            row: line - 1,
            line,
        };
        gaps(&(1..).zip(numbers).map(at).collect::<Vec<_>>(), counting)
    }

    fn counted(numbers: &[u32]) -> (usize, usize, usize) {
        let found = found(numbers, OF_PACKETS);
        let first_line = found.gaps.first().map_or(0, |gap| gap.after.line);
        (found.n_missing(), found.restarts, first_line)
    }

    #[test]
    fn gaps_are_counted_over_wraps_and_restarts() {
        assert_eq!(counted(&[]), (0, 0, 0));
        assert_eq!(counted(&[4, 5, 6]), (0, 0, 0));
        assert_eq!(counted(&[4, 7, 8, 10]), (3, 0, 2));
        assert_eq!(counted(&[65534, 1, 2]), (2, 0, 2));
        assert_eq!(counted(&[500, 501, 3, 5]), (1, 1, 4));
        // 100 was late, and is not missing.
        assert_eq!(counted(&[98, 99, 101, 100, 102]), (0, 0, 3));
    }

    #[test]
    fn a_number_that_has_arrived_or_lies_before_the_latest_numbers_has_begun_anew() {
        assert_eq!(counted(&[98, 99, 100, 101, 99, 101]), (1, 1, 6));
        // 60 is missing, but 140 numbers back it is none that came late.
        assert_eq!(counted(&[59, 61, 200, 60]), (139, 1, 2));
        // What was missing before a restart cannot come late after it.
        assert_eq!(counted(&[100, 102, 104, 102, 101]), (2, 2, 2));
    }

    #[test]
    fn missing_packets_were_created_evenly_between_those_around_them() {
        let numbers = |numbers: &[u32]| -> Vec<(u32, i64, usize)> {
            let found = found(numbers, OF_PACKETS);
            let missing = found.gaps.iter().flat_map(Gap::missing);
            missing.map(|one| (one.sequence, one.created_ns, one.line)).collect()
        };
        assert_eq!(numbers(&[4, 7, 8]), [(5, 80, 2), (6, 100, 2)]);
        assert_eq!(numbers(&[65534, 1]), [(65535, 80, 2), (0, 100, 2)]);
        // Nothing is missing where numbers begin anew, nor what came late.
        assert_eq!(numbers(&[500, 501, 3, 5]), [(4, 210, 4)]);
        assert_eq!(numbers(&[98, 99, 102, 100]), [(101, 160, 3)]);
    }

    #[test]
    fn numbers_do_not_pass_much_faster_than_usual() {
        // One number in the time between two packets.
        let paced = |modulus| Counting { modulus, period_ns: Some(60.0) };
        let counted = |numbers: &[u32], counting| {
            let found = found(numbers, counting);
            (found.n_missing(), found.restarts)
        };
        assert_eq!(counted(&[253, 255, 1, 2], paced(256)), (2, 0));
        assert_eq!(counted(&[200, 201, 5, 6], paced(256)), (0, 1));
        assert_eq!(counted(&[200, 201, 5, 6], Counting { period_ns: None, ..paced(256) }), (59, 0));
        // A damaged number is two restarts, and what is lost around it is not known.
        assert_eq!(counted(&[7, 8, 40_000, 10, 12], paced(1 << 16)), (1, 2));
        assert_eq!(counted(&[u32::MAX - 1, 1], paced(1 << 32)), (2, 0));
    }
}
