//! What robots and base say to each other: reports with parts of a map upward, orders downward.
//!
//! | octets | report | order |
//! |---|---|---|
//! | 0 | `M` | `W` |
//! | 1 to 2 | number of the part, 0 for none | all parts up to this number have come |
//! | 3 to 4 | number of the last order taken | of the 16 parts after it: which have come, the first in the lowest bit |
//! | 5 to 6 | the cell in which the robot stands | number of the order |
//! | then | runs of cells seen, three octets each: the first cell, then how many, and 128 more if they are occupied | the cells where the way begins and turns, two octets each, the goal last |
//!
//! Numbers are little-endian. No message is as long as what robots broadcast of their motion, 48 octets.

use bytes::{BufMut as _, Bytes, BytesMut};
use serde::{Deserialize, Serialize};

/// Cells of one kind, one after the other by number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Run {
    /// Number of the first cell.
    pub first: u16,
    /// Number of cells: 1 to [`MAX_RUN`].
    pub n: u8,
    /// Whether the cells are occupied; else they are free.
    pub is_occupied: bool,
}

/// Most cells in a run: seven bits hold the number.
pub const MAX_RUN: u8 = 127;

impl Run {
    /// Numbers of its cells, ascending.
    pub fn cells(self) -> impl Iterator<Item = u16> {
        (0..u16::from(self.n)).map(move |place| self.first.saturating_add(place))
    }
}

/// What a robot reports to the base: a part of its map, and where it stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// Number of the part of the map, from 1; 0: none.
    pub part: u16,
    /// Number of the last order that the robot has taken.
    pub order: u16,
    /// Number of the cell in which the robot stands.
    pub cell: u16,
    /// Cells that it has seen, free or occupied.
    pub runs: Vec<Run>,
}

/// What the base sends to a robot: an order to go somewhere, and which parts of its map have arrived.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Order {
    /// All parts up to this number have come.
    pub received: u16,
    /// Of the 16 parts after it: which have come.
    pub later: u16,
    /// Number of the order.
    pub number: u16,
    /// Where the way begins and turns, the goal last. Empty: stay.
    pub corners: Vec<u16>,
}

/// Octets of a report without runs, and of an order without a way.
pub const HEADER_BYTES: usize = 7;

/// Octets of a run.
pub const RUN_BYTES: usize = 3;

/// Octets of a corner.
pub const CORNER_BYTES: usize = 2;

const REPORT: u8 = b'M';
const ORDER: u8 = b'W';

impl Report {
    /// The message as octets, as the table above lays them out.
    #[must_use]
    pub fn encode(&self) -> Bytes {
        let mut bytes = BytesMut::with_capacity(HEADER_BYTES + RUN_BYTES * self.runs.len());
        bytes.put_u8(REPORT);
        for number in [self.part, self.order, self.cell] {
            bytes.put_u16_le(number);
        }
        for run in &self.runs {
            bytes.put_u16_le(run.first);
            bytes.put_u8(run.n | if run.is_occupied { 0x80 } else { 0 });
        }
        bytes.freeze()
    }

    /// From octets; `None`: they are no report.
    #[must_use]
    pub fn decode(bytes: &[u8]) -> Option<Self> {
        let (&[tag, a, b, c, d, e, f], rest) = bytes.split_first_chunk::<HEADER_BYTES>()?;
        let (runs, []) = rest.as_chunks::<RUN_BYTES>() else { return None };
        let run = |&[low, high, n]: &[u8; RUN_BYTES]| Run {
            first: u16::from_le_bytes([low, high]),
            n: n & MAX_RUN,
            is_occupied: n & 0x80 != 0,
        };
        (tag == REPORT).then(|| Self {
            part: u16::from_le_bytes([a, b]),
            order: u16::from_le_bytes([c, d]),
            cell: u16::from_le_bytes([e, f]),
            runs: runs.iter().map(run).collect(),
        })
    }
}

impl Order {
    /// The message as octets, as the table above lays them out.
    #[must_use]
    pub fn encode(&self) -> Bytes {
        let mut bytes = BytesMut::with_capacity(HEADER_BYTES + CORNER_BYTES * self.corners.len());
        bytes.put_u8(ORDER);
        for number in [self.received, self.later, self.number] {
            bytes.put_u16_le(number);
        }
        for &corner in &self.corners {
            bytes.put_u16_le(corner);
        }
        bytes.freeze()
    }

    /// From octets; `None`: they are no order.
    #[must_use]
    pub fn decode(bytes: &[u8]) -> Option<Self> {
        let (&[tag, a, b, c, d, e, f], rest) = bytes.split_first_chunk::<HEADER_BYTES>()?;
        let (corners, []) = rest.as_chunks::<CORNER_BYTES>() else { return None };
        (tag == ORDER).then(|| Self {
            received: u16::from_le_bytes([a, b]),
            later: u16::from_le_bytes([c, d]),
            number: u16::from_le_bytes([e, f]),
            corners: corners.iter().map(|&corner| u16::from_le_bytes(corner)).collect(),
        })
    }
}

/// Whether octets are one of these messages.
#[must_use]
pub fn is_message(bytes: &[u8]) -> bool {
    Report::decode(bytes).is_some() || Order::decode(bytes).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_written_is_read(
            numbers: [u16; 3],
            runs in proptest::collection::vec((any::<u16>(), 1..=MAX_RUN, any::<bool>()), 0..40),
            corners in proptest::collection::vec(any::<u16>(), 0..40),
        ) {
            let [a, b, c] = numbers;
            let run = |(first, n, is_occupied)| Run { first, n, is_occupied };
            let runs = runs.into_iter().map(run).collect();
            let report = Report { part: a, order: b, cell: c, runs };
            prop_assert_eq!(Report::decode(&report.encode()), Some(report.clone()));
            prop_assert_eq!(Order::decode(&report.encode()), None);
            let order = Order { received: a, later: b, number: c, corners };
            prop_assert_eq!(Order::decode(&order.encode()), Some(order.clone()));
            prop_assert_eq!(Report::decode(&order.encode()), None);
            prop_assert!(report.encode().len() != crate::payload::LENGTH_BYTES);
            prop_assert!(order.encode().len() != crate::payload::LENGTH_BYTES);
        }
    }

    #[test]
    fn a_report_has_the_octets_that_its_description_says() {
        let run = Run { first: 0x0102, n: 3, is_occupied: true };
        let report = Report { part: 1, order: 0x0203, cell: 7, runs: vec![run] };
        assert_eq!(report.encode()[..], [b'M', 1, 0, 3, 2, 7, 0, 2, 1, 0x83]);
        let order = Order { received: 1, later: 5, number: 2, corners: vec![0x0102] };
        assert_eq!(order.encode()[..], [b'W', 1, 0, 5, 0, 2, 0, 2, 1]);
        assert!(!is_message(&[b'M', 1, 0, 3, 2, 7, 0, 2]) && !is_message(b"W"));
    }
}
