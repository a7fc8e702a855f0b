//! A datagram whose parts have not all come: RFC 4944, § 5.3.

use crate::wire::datagram::Datagram;
use crate::wire::fragment::Fragment;
use proto::time::SimTime;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Parts begin at multiples of 8 bytes, and a datagram has 2047 bytes at most.
const UNIT_BYTES: u16 = 8;
/// 256 bits, one for each 8 bytes of the largest datagram.
type Units = [u64; 4];

/// A datagram that is put together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Buffer {
    /// Identity of the datagram, for records.
    pub(super) packet: u64,
    /// Until when it may wait.
    pub(super) until: SimTime,
    size: u16,
    covered: u16,
    /// Units that are there.
    present: Units,
    /// Units with which a part begins.
    begins: Units,
    /// The datagram as the first part showed it: its headers are those of the last hop.
    datagram: Option<Arc<Datagram>>,
}

/// What a part did to a buffer.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Added {
    /// Others are missing.
    Incomplete,
    /// It was the last one that was missing.
    Complete(Arc<Datagram>),
    /// The same part was there.
    Same,
    /// It overlaps another part without being the same, or is of a datagram of another size.
    Conflict,
}

/// Whether a part can be a part at all.
pub(super) fn is_valid(part: &Fragment) -> bool {
    let Some(end) = part.offset.checked_add(part.covers) else { return false };
    part.covers != 0
        && part.offset.is_multiple_of(UNIT_BYTES)
        && (end == part.size || end < part.size && part.covers.is_multiple_of(UNIT_BYTES))
        && usize::from(part.size) < UNIT_BYTES as usize * 256
}

impl Buffer {
    /// For the datagram of which `part` is one. Nothing is in it.
    pub(super) fn new(part: &Fragment, until: SimTime) -> Self {
        Self {
            packet: part.datagram.packet,
            until,
            size: part.size,
            covered: 0,
            present: [0; 4],
            begins: [0; 4],
            datagram: None,
        }
    }

    /// Adds a valid part.
    pub(super) fn add(&mut self, part: &Fragment) -> Added {
        if part.size != self.size {
            return Added::Conflict;
        }
        let first = part.offset / UNIT_BYTES;
        let units = first..(part.offset + part.covers).div_ceil(UNIT_BYTES);
        let next = units.end;
        if units.clone().any(|unit| has(&self.present, unit)) {
            let is_same = units.clone().all(|unit| has(&self.present, unit))
                && units.clone().all(|unit| has(&self.begins, unit) == (unit == first))
                && (has(&self.begins, next) || !has(&self.present, next));
            return if is_same { Added::Same } else { Added::Conflict };
        }
        for unit in units {
            set(&mut self.present, unit);
        }
        set(&mut self.begins, first);
        self.covered += part.covers;
        if part.offset == 0 {
            self.datagram = Some(part.datagram.clone());
        }
        match &self.datagram {
            Some(datagram) if self.covered == self.size => Added::Complete(datagram.clone()),
            _ => Added::Incomplete,
        }
    }
}

fn has(units: &Units, unit: u16) -> bool {
    units.get(usize::from(unit / 64)).is_some_and(|word| word >> (unit % 64) & 1 != 0)
}

fn set(units: &mut Units, unit: u16) {
    units[usize::from(unit / 64)] |= 1 << (unit % 64);
}
