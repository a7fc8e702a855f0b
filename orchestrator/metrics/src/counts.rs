//! How many heard, and were heard, in a period.

use proto::types::{Deliveries, Heard, Medium};

/// How many deliveries a second medium carried; `None`: the network has none.
#[must_use]
pub fn by_second_medium(deliveries: &Deliveries) -> Option<u64> {
    let media = &deliveries.medium;
    let n = media.iter().filter(|&&medium| medium == Medium::Second).count() as u64;
    (!media.is_empty()).then_some(n)
}

/// Adds a count to a sum, as far as it is known.
pub fn add_known(sum: &mut Option<u64>, count: Option<u64>) {
    if let Some(count) = count {
        *sum = Some(sum.unwrap_or(0) + count);
    }
}

/// Counts over the deliveries of a period. An agent's own transmissions do not count as heard by itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Per agent: how many others it heard at least once.
    pub neighbours: Vec<u32>,
    /// Per transmission: how many others heard it.
    pub receivers: Vec<u32>,
    /// All deliveries: the sum of `receivers`.
    pub n_deliveries: u64,
}

impl Counts {
    /// Counts for `n_agents` agents.
    pub fn from_deliveries(deliveries: &Deliveries, n_agents: usize) -> Self {
        let senders = &deliveries.transmissions.sender;
        let mut neighbours = vec![0; n_agents];
        let mut receivers = vec![0; senders.len()];
        if has_repeats(senders, n_agents) {
            // Someone spoke twice: a neighbour counts once.
            let mut last_heard_by = vec![usize::MAX; n_agents];
            for (receiver, count) in neighbours.iter_mut().enumerate() {
                for index in deliveries.heard_by(receiver) {
                    let sender = senders[index] as usize;
                    if sender == receiver {
                        continue;
                    }
                    receivers[index] += 1;
                    if last_heard_by[sender] != receiver {
                        last_heard_by[sender] = receiver;
                        *count += 1;
                    }
                }
            }
        } else {
            match &deliveries.heard {
                Heard::Lists { indices, .. } => {
                    for &index in indices {
                        receivers[index as usize] += 1;
                    }
                    for (receiver, count) in neighbours.iter_mut().enumerate() {
                        *count = deliveries.heard_by(receiver).count() as u32;
                    }
                }
                Heard::Rows { bytes, row_bytes } => {
                    count_rows(bytes, *row_bytes, &mut neighbours, &mut receivers);
                }
            }
            for (index, &sender) in senders.iter().enumerate() {
                if was_heard_by(deliveries, sender as usize, index) {
                    neighbours[sender as usize] -= 1;
                    receivers[index] -= 1;
                }
            }
        }
        let n_deliveries = receivers.iter().map(|&count| u64::from(count)).sum();
        Self { neighbours, receivers, n_deliveries }
    }
}

/// Whether `receiver` heard the transmission with that index.
pub fn was_heard_by(deliveries: &Deliveries, receiver: usize, index: usize) -> bool {
    match &deliveries.heard {
        Heard::Lists { ends, indices } => {
            let Some(&end) = ends.get(receiver) else { return false };
            let start = receiver.checked_sub(1).map_or(0, |before| ends[before] as usize);
            indices[start..end as usize].binary_search(&(index as u32)).is_ok()
        }
        Heard::Rows { bytes, row_bytes } => {
            bytes[receiver * row_bytes + index / 8] >> (index % 8) & 1 == 1
        }
    }
}

fn has_repeats(senders: &[u32], n_agents: usize) -> bool {
    let mut seen = vec![false; n_agents];
    senders.iter().any(|&sender| std::mem::replace(&mut seen[sender as usize], true))
}

/// Counts the bits of every row and of every column of a bitmap.
///
/// Columns are counted 64 at a time in binary counters that lie across words: plane `p` of a word holds bit `p` of its
/// 64 counts, and adding a row is adding one bit to each, the carry running up the planes. On average two planes are
/// touched per row, so a bitmap of 2500 by 2500 takes well under a millisecond.
fn count_rows(bytes: &[u8], row_bytes: usize, per_row: &mut [u32], per_column: &mut [u32]) {
    let n_words = row_bytes.div_ceil(8);
    let n_planes = (usize::BITS - per_row.len().leading_zeros()) as usize;
    let mut planes = vec![0u64; n_words * n_planes];
    for (row, count) in bytes.chunks_exact(row_bytes).zip(per_row) {
        let counters = planes.chunks_exact_mut(n_planes);
        for (part, counter) in row.chunks(8).zip(counters) {
            let mut word = [0; 8];
            word[..part.len()].copy_from_slice(part);
            let mut carry = u64::from_le_bytes(word);
            *count += carry.count_ones();
            for plane in counter {
                if carry == 0 {
                    break;
                }
                (*plane, carry) = (*plane ^ carry, *plane & carry);
            }
        }
    }
    for (index, count) in per_column.iter_mut().enumerate() {
        let counter = &planes[index / 64 * n_planes..][..n_planes];
        for (weight, plane) in counter.iter().enumerate() {
            *count |= ((plane >> (index % 64) & 1) as u32) << weight;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::types::{Bitmap, Transmissions};

    /// Deliveries in both forms, by a rule.
    fn both(senders: &[u32], n: usize, rule: impl Fn(usize, usize) -> bool) -> [Deliveries; 2] {
        let (mut ends, mut indices, mut bytes) = (vec![], vec![], vec![]);
        for receiver in 0..n {
            let mut row = Bitmap::filled(senders.len(), false);
            for index in 0..senders.len() {
                if rule(receiver, index) {
                    row.set(index, true);
                    indices.push(index as u32);
                }
            }
            ends.push(indices.len() as u32);
            bytes.extend_from_slice(row.as_bytes());
        }
        let row_bytes = senders.len().div_ceil(8);
        let transmissions = Transmissions { sender: senders.to_vec(), ..Transmissions::default() };
        [Heard::Lists { ends, indices }, Heard::Rows { bytes: bytes.into(), row_bytes }].map(
            |heard| Deliveries {
                transmissions: transmissions.clone(),
                heard,
                ..Default::default()
            },
        )
    }

    #[test]
    fn counts_agree_with_counting_one_by_one_in_both_forms() {
        // 150 agents: more than two words and eight planes of the counters are in use.
        let n = 150;
        let senders: Vec<u32> = (0..n as u32).rev().collect();
        let rule = |receiver: usize, index: usize| (receiver * 31 + index * 17) % 7 < 3;
        for deliveries in both(&senders, n, rule) {
            let counts = Counts::from_deliveries(&deliveries, n);
            for agent in 0..n {
                let expected =
                    (0..n).filter(|&i| rule(agent, i) && senders[i] as usize != agent).count();
                assert_eq!(counts.neighbours[agent] as usize, expected);
            }
            for (index, &sender) in senders.iter().enumerate() {
                let expected = (0..n).filter(|&r| rule(r, index) && sender as usize != r).count();
                assert_eq!(counts.receivers[index] as usize, expected);
            }
            assert!((0..n).all(|r| (0..n).all(|i| was_heard_by(&deliveries, r, i) == rule(r, i))));
        }
    }

    #[test]
    fn a_neighbour_that_speaks_twice_is_one_neighbour() {
        for deliveries in both(&[1, 2, 1], 3, |_, _| true) {
            let counts = Counts::from_deliveries(&deliveries, 3);
            assert_eq!(counts.neighbours, [2, 1, 1]);
            assert_eq!(counts.receivers, [2, 2, 2]);
            assert_eq!(counts.n_deliveries, 6);
        }
    }

    #[test]
    fn nothing_sent_is_nothing_heard() {
        let counts = Counts::from_deliveries(&Deliveries::default(), 3);
        assert_eq!(counts, Counts { neighbours: vec![0; 3], receivers: vec![], n_deliveries: 0 });
    }
}
