//! Sequence numbers of packets: duplicates, gaps, restarts.

use schemars::JsonSchema;
use serde::Serialize;

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
/// A number that is this little below the one before is out of order; one further below has begun anew.
const OUT_OF_ORDER: u32 = 32;

/// Counts gaps in the sequence numbers of one source.
///
/// * `packets`: without duplicates, in any order.
pub(crate) fn gaps(run: u32, source: u32, packets: &mut [Numbered]) -> SequenceGaps {
    packets.sort_by_key(|packet| (packet.created_ns, packet.sequence));
    let mut gaps = SequenceGaps {
        run,
        source,
        arrived: packets.len(),
        missing: 0,
        restarts: 0,
        first_line: 0,
    };
    let Some(mut last) = packets.first().map(|packet| packet.sequence) else { return gaps };
    for packet in &packets[1..] {
        let step = if last < MODULUS && packet.sequence < last {
            packet.sequence + MODULUS - last
        } else {
            packet.sequence.saturating_sub(last)
        };
        let is_wrapped = packet.sequence < last && (1..MODULUS / 2).contains(&step);
        if last <= packet.sequence || is_wrapped {
            let missing = step.saturating_sub(1) as usize;
            gaps.missing += missing;
            if 0 < missing && gaps.first_line == 0 {
                gaps.first_line = packet.line;
            }
            last = packet.sequence;
        } else if last - packet.sequence <= OUT_OF_ORDER && OUT_OF_ORDER < last {
            // It was counted as missing when a later one came before it.
            gaps.missing = gaps.missing.saturating_sub(1);
        } else {
            gaps.restarts += 1;
            last = packet.sequence;
        }
    }
    gaps
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counted(numbers: &[u32]) -> (usize, usize, usize) {
        let mut packets: Vec<Numbered> = (1..)
            .zip(numbers)
            .map(|(line, &sequence)| Numbered { created_ns: line as i64, sequence, line })
            .collect();
        let gaps = gaps(1, 2, &mut packets);
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
}
