//! Sequence numbers of packets: duplicates, gaps, restarts.

use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeSet;

/// What the sequence numbers of one source in one run say.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct SequenceGaps {
    /// Number of the run.
    pub run: u32,
    /// Number of the node that created the packets.
    pub source: u32,
    /// Packets that arrived, duplicates not counted.
    pub arrived: usize,
    /// Packets that are missing between two that arrived.
    pub missing: usize,
    /// How often the numbers began anew; what was lost just before is not known.
    pub restarts: usize,
    /// Line of the first packet after a gap; 0: there is none.
    pub first_line: usize,
}

/// A packet with a sequence number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Numbered {
    /// When it was created (ns).
    pub created_ns: i64,
    /// Its sequence number.
    pub sequence: u32,
    /// Line of the log.
    pub line: usize,
}

/// Sequence numbers of 16 bits begin anew after the greatest.
const MODULUS: u32 = 1 << 16;
/// A packet may come out of order by as many numbers.
const OUT_OF_ORDER: u32 = 32;

/// Packets that are missing between two that arrived.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Gap {
    before: Numbered,
    after: Numbered,
    /// By how much the number increases.
    step: u32,
    /// Which of the numbers arrived late, as their distance from the number before the gap.
    late: BTreeSet<u32>,
}

impl Gap {
    /// How many packets are missing.
    pub(crate) fn n_missing(&self) -> usize {
        self.step as usize - 1 - self.late.len()
    }

    /// The missing packets. Their creation times are interpolated linearly; their line is that of the packet after the gap.
    pub(crate) fn missing(&self) -> impl Iterator<Item = Numbered> {
        let is_missing = |distance: &u32| !self.late.contains(distance);
        (1..self.step).filter(is_missing).map(|distance| {
            let span_ns = i128::from(self.after.created_ns) - i128::from(self.before.created_ns);
            let later_ns = span_ns * i128::from(distance) / i128::from(self.step);
            let number = self.before.sequence + distance;
            let is_wrapped = self.after.sequence < self.before.sequence;
            Numbered {
                // Between two times, so it fits.
                created_ns: self.before.created_ns + later_ns as i64,
                sequence: if is_wrapped { number % MODULUS } else { number },
                line: self.after.line,
            }
        })
    }

    /// Marks a packet that arrived after a later one; false: it is not missing in this gap.
    fn fill(&mut self, sequence: u32) -> bool {
        let is_wrapped = self.after.sequence < self.before.sequence;
        let ahead = if is_wrapped && sequence < self.before.sequence { MODULUS } else { 0 };
        let distance = (sequence + ahead).saturating_sub(self.before.sequence);
        (1..self.step).contains(&distance) && self.late.insert(distance)
    }
}

/// Finds gaps in the sequence numbers of one source.
///
/// A gap lies between two packets whose numbers increase, or increase modulo 2¹⁶ by less than half of that. A smaller number is a
/// late packet if it is missing in a gap within the 32 numbers before; otherwise the numbers began anew, which is no gap.
///
/// * `packets`: without duplicates, in any order.
pub(crate) fn gaps(run: u32, source: u32, packets: &mut [Numbered]) -> (SequenceGaps, Vec<Gap>) {
    packets.sort_by_key(|packet| (packet.created_ns, packet.sequence));
    let mut gaps: Vec<Gap> = Vec::new();
    let mut restarts = 0;
    // Where the gaps begin that lie after the latest restart.
    let mut continued = 0;
    let mut last = packets.first().copied();
    for packet in packets.iter().skip(1) {
        let Some(before) = last else { break };
        let is_lower = packet.sequence < before.sequence;
        let step = if is_lower && before.sequence < MODULUS {
            packet.sequence + MODULUS - before.sequence
        } else {
            packet.sequence.saturating_sub(before.sequence)
        };
        if !is_lower || (1..MODULUS / 2).contains(&step) {
            if 1 < step {
                gaps.push(Gap { before, after: *packet, step, late: BTreeSet::new() });
            }
            last = Some(*packet);
            continue;
        }
        let is_near = before.sequence - packet.sequence <= OUT_OF_ORDER;
        let is_late = is_near
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
    let counts = SequenceGaps {
        run,
        source,
        arrived: packets.len(),
        missing: gaps.iter().map(Gap::n_missing).sum(),
        restarts,
        first_line: gaps.first().map_or(0, |gap| gap.after.line),
    };
    (counts, gaps)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(numbers: &[u32]) -> (SequenceGaps, Vec<Gap>) {
        let mut packets: Vec<Numbered> = (1..)
            .zip(numbers)
            .map(|(line, &sequence)| Numbered { created_ns: 60 * line as i64, sequence, line })
            .collect();
        gaps(1, 2, &mut packets)
    }

    fn counted(numbers: &[u32]) -> (usize, usize, usize) {
        let (gaps, _) = found(numbers);
        (gaps.missing, gaps.restarts, gaps.first_line)
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
            let (_, gaps) = found(numbers);
            let missing = gaps.iter().flat_map(Gap::missing);
            missing.map(|one| (one.sequence, one.created_ns, one.line)).collect()
        };
        assert_eq!(numbers(&[4, 7, 8]), [(5, 80, 2), (6, 100, 2)]);
        assert_eq!(numbers(&[65534, 1]), [(65535, 80, 2), (0, 100, 2)]);
        // Nothing is missing where numbers begin anew, nor what came late.
        assert_eq!(numbers(&[500, 501, 3, 5]), [(4, 210, 4)]);
        assert_eq!(numbers(&[98, 99, 102, 100]), [(101, 160, 3)]);
    }
}
