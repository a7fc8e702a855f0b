//! Slotframes and cells: IEEE Std 802.15.4-2015, 6.2.6 and 8.4.3.3.

mod listening;
mod silence;
#[cfg(test)]
mod tests;

use crate::wire::Eui64;
use listening::listening_slots;
use physics::asn::Asn;
use serde::{Deserialize, Serialize};
use silence::Silence;

/// What a cell may be used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CellOptions {
    /// The mote may transmit in it.
    pub tx: bool,
    /// The mote listens in it when it does not transmit.
    pub rx: bool,
    /// Others may transmit in it as well: failures back off.
    pub shared: bool,
}

impl CellOptions {
    /// Transmit, nobody else does.
    pub const TX: Self = Self { tx: true, rx: false, shared: false };
    /// A cell in which the mote only listens.
    pub const RX: Self = Self { tx: false, rx: true, shared: false };
    /// Transmit, as others may.
    pub const TX_SHARED: Self = Self { tx: true, rx: false, shared: true };
    /// Transmit as others may, and receive.
    pub const TX_RX_SHARED: Self = Self { tx: true, rx: true, shared: true };
}

/// Whether enhanced beacons are sent in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum CellKind {
    /// No beacons.
    Normal,
    /// Beacons, when there is nothing else to send.
    Advertising,
    /// Nothing but beacons.
    AdvertisingOnly,
}

/// A cell of a slotframe: a link in the standard's terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Cell {
    /// Slot offset within the slotframe.
    pub slot: u16,
    /// Channel offset: with the absolute slot number it selects the channel.
    pub channel: u16,
    /// What it may be used for.
    pub options: CellOptions,
    /// With whom; `None`: with anyone.
    pub neighbour: Option<Eui64>,
    /// Whether beacons are sent in it.
    pub kind: CellKind,
    /// Frames sent (halved together with `num_tx_ack` at 256: RFC 9033, § 5.3).
    pub num_tx: u16,
    /// Frames sent and acknowledged.
    pub num_tx_ack: u16,
    /// Frames received in the cell.
    pub num_rx: u16,
}

impl Cell {
    /// A cell that has not been used.
    #[must_use]
    pub fn new(slot: u16, channel: u16, options: CellOptions, neighbour: Option<Eui64>) -> Self {
        let kind = CellKind::Normal;
        Self { slot, channel, options, neighbour, kind, num_tx: 0, num_tx_ack: 0, num_rx: 0 }
    }

    /// The same cell, with beacons as `kind` says.
    #[must_use]
    pub fn of_kind(self, kind: CellKind) -> Self {
        Self { kind, ..self }
    }

    /// Counts a transmission. At 256 both counters are halved.
    pub(crate) fn count_tx(&mut self, acknowledged: bool) {
        self.num_tx += 1;
        self.num_tx_ack += u16::from(acknowledged);
        if self.num_tx == 256 {
            self.num_tx /= 2;
            self.num_tx_ack /= 2;
        }
    }

    /// Whether two cells are the same: slot, channel, options, neighbour, kind.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        (self.slot, self.channel, self.options, self.neighbour, self.kind)
            == (other.slot, other.channel, other.options, other.neighbour, other.kind)
    }
}

/// Which cell: handle of the slotframe, slot and channel offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CellRef {
    /// Handle of the slotframe.
    pub handle: u8,
    /// The cell as it is in that slotframe.
    pub cell: Cell,
}

/// A slotframe: cells that repeat.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Slotframe {
    /// Its handle: of two cells in one slot, that of the lower handle counts.
    pub handle: u8,
    slots: u16,
    cells: Vec<Cell>,
    /// Channel offset of the cell that receives in every slot without cells, if there is one.
    background: Option<u16>,
    /// Places in `cells` of those that transmit.
    tx: Vec<u16>,
    /// By slot: whether a cell receives in it.
    receives: Vec<bool>,
    /// In how many slots that is so.
    n_receives: u16,
    /// By slot: place in `cells` of the first one there, or NONE.
    first: Vec<u16>,
}

const NONE: u16 = u16::MAX;

impl Slotframe {
    fn new(handle: u8, slots: u16) -> Self {
        let mut frame = Self {
            handle,
            slots,
            cells: vec![],
            background: None,
            tx: vec![],
            receives: vec![],
            n_receives: 0,
            first: vec![],
        };
        frame.index();
        frame
    }

    /// Length of the slotframe (slots).
    #[must_use]
    pub fn slots(&self) -> u16 {
        self.slots
    }

    /// Its cells, by slot; within a slot in the order they were added. Without [`Slotframe::background`].
    #[must_use]
    pub fn cells(&self) -> &[Cell] {
        &self.cells
    }

    /// Channel offset on which it receives, from anyone, in every slot without cells. It stands for as many cells, takes no
    /// room, gives way to any cell that is added, and counts no frames.
    #[must_use]
    pub fn background(&self) -> Option<u16> {
        self.background
    }

    /// The cell that [`Slotframe::background`] stands for in a slot, if it is in force there.
    #[inline]
    #[must_use]
    pub fn background_at(&self, slot: u16) -> Option<Cell> {
        let channel = self.background?;
        let is_free = self.first[usize::from(slot)] == NONE;
        is_free.then(|| Cell::new(slot, channel, CellOptions::RX, None))
    }

    /// Cells that transmit, by slot.
    pub fn tx_cells(&self) -> impl Iterator<Item = &Cell> {
        self.tx.iter().map(|&place| &self.cells[usize::from(place)])
    }

    /// The cells in a slot. Without [`Slotframe::background`].
    #[must_use]
    pub(crate) fn at_slot(&self, slot: u16) -> &[Cell] {
        let first = self.first[usize::from(slot)];
        if first == NONE {
            return &[];
        }
        let first = usize::from(first);
        let n = self.cells[first..].iter().take_while(|cell| cell.slot == slot).count();
        &self.cells[first..first + n]
    }

    /// The cells in an absolute slot. Without [`Slotframe::background`].
    #[must_use]
    pub fn cells_at(&self, asn: Asn) -> &[Cell] {
        self.at_slot(self.slot_of(asn))
    }

    /// The slot offset of an absolute slot.
    #[must_use]
    pub(crate) fn slot_of(&self, asn: Asn) -> u16 {
        (asn % u64::from(self.slots)) as u16
    }

    /// The first absolute slot, not before `from_asn`, with this slot offset.
    #[must_use]
    pub fn next_asn(&self, slot: u16, from_asn: Asn) -> Asn {
        let length = u64::from(self.slots);
        from_asn + (u64::from(slot) + length - from_asn % length) % length
    }

    /// Slots without a cell, ascending. [`Slotframe::background`] leaves them free.
    pub fn free_slots(&self) -> impl Iterator<Item = u16> + '_ {
        (0..self.slots).filter(|&slot| self.first[usize::from(slot)] == NONE)
    }

    fn index(&mut self) {
        let n = usize::from(self.slots);
        self.tx.clear();
        self.receives.clear();
        self.receives.resize(n, false);
        self.first.clear();
        self.first.resize(n, NONE);
        for (place, cell) in (0..).zip(&self.cells) {
            let slot = usize::from(cell.slot);
            if cell.options.tx {
                self.tx.push(place);
            }
            self.receives[slot] |= cell.options.rx;
            if self.first[slot] == NONE {
                self.first[slot] = place;
            }
        }
        if self.background.is_some() {
            for (receives, &first) in self.receives.iter_mut().zip(&self.first) {
                *receives |= first == NONE;
            }
        }
        self.n_receives = self.receives.iter().map(|&receives| u16::from(receives)).sum();
    }

    /// Slots from `from` (included) to `until` (excluded) in which it receives.
    fn n_receiving(&self, from: Asn, until: Asn) -> u64 {
        let length = u64::from(self.slots);
        let whole = (until - from) / length;
        let rest = (from.0 + whole * length..until.0)
            .filter(|&asn| self.receives[usize::from(self.slot_of(Asn(asn)))])
            .count();
        whole * u64::from(self.n_receives) + rest as u64
    }

    fn insert(&mut self, cell: Cell) {
        let place = self.cells.partition_point(|other| other.slot <= cell.slot);
        self.cells.insert(place, cell);
        self.index();
    }
}

/// Why a cell cannot be added.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ScheduleError {
    /// There is no such slotframe.
    #[error("there is no slotframe {0}")]
    NoSlotframe(u8),
    /// The slot lies beyond the end of the slotframe.
    #[error("slot {slot} lies beyond a slotframe of {slots}")]
    BeyondEnd {
        /// The slot.
        slot: u16,
        /// Length of the slotframe.
        slots: u16,
    },
}

/// All slotframes of a mote, by handle.
///
/// It also counts the slots in which a radio listens: not by looking at every slot, but from the cells, whenever they
/// change or somebody asks.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Schedule {
    frames: Vec<Slotframe>,
    n_changes: u64,
    /// First slot that has not been counted.
    counted_asn: Asn,
    /// First slot in which a change made now takes effect.
    effective_asn: Asn,
    n_listening: u64,
    silence: Silence,
}

impl Schedule {
    /// A schedule without slotframes, in which the mote sleeps.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Changes made from now on take effect in slot `asn`.
    pub fn set_effective(&mut self, asn: Asn) {
        self.effective_asn = asn;
    }

    /// How often it has changed: whoever remembers something derived from it compares this.
    #[must_use]
    pub(crate) fn n_changes(&self) -> u64 {
        self.n_changes
    }

    /// Slotframes, lowest handle first.
    #[must_use]
    pub fn slotframes(&self) -> &[Slotframe] {
        &self.frames
    }

    /// The slotframe with this handle; `None`: there is none.
    #[must_use]
    pub fn slotframe(&self, handle: u8) -> Option<&Slotframe> {
        self.frames.iter().find(|frame| frame.handle == handle)
    }

    /// All cells with the handle of their slotframe, lowest handle first. Without [`Slotframe::background`].
    pub fn cells(&self) -> impl Iterator<Item = CellRef> + '_ {
        self.frames.iter().flat_map(|frame| {
            frame.cells.iter().map(|&cell| CellRef { handle: frame.handle, cell })
        })
    }

    /// Whether there is no cell in an absolute slot. `beside_everyone`: nor none but those in which all contend, and a slotframe's
    /// background.
    #[must_use]
    pub fn is_free(&self, asn: Asn, beside_everyone: bool) -> bool {
        if beside_everyone {
            self.frames
                .iter()
                .all(|frame| frame.cells_at(asn).iter().all(|cell| cell.options.shared))
        } else {
            self.cells_at(asn).next().is_none()
        }
    }

    /// Cells in an absolute slot, lowest handle first.
    pub fn cells_at(&self, asn: Asn) -> impl Iterator<Item = CellRef> + '_ {
        self.frames.iter().flat_map(move |frame| {
            let cells =
                frame.cells_at(asn).iter().copied().chain(frame.background_at(frame.slot_of(asn)));
            cells.map(|cell| CellRef { handle: frame.handle, cell })
        })
    }

    /// The cell in which a radio listens in an absolute slot, unless it transmits: the first one of the lowest handle.
    #[inline]
    #[must_use]
    pub fn listens(&self, asn: Asn) -> Option<CellRef> {
        if self.silence.covers(asn) {
            return None;
        }
        self.frames.iter().find_map(|frame| {
            let slot = frame.slot_of(asn);
            if !frame.receives[usize::from(slot)] {
                return None;
            }
            let first = frame.first[usize::from(slot)];
            if first == NONE {
                let cell = frame.background_at(slot)?;
                return Some(CellRef { handle: frame.handle, cell });
            }
            let cell = frame.cells[usize::from(first)..].iter().find(|cell| cell.options.rx)?;
            Some(CellRef { handle: frame.handle, cell: *cell })
        })
    }

    /// Length of all slotframes, where it is the same, and by slot a bit: a cell receives there.
    #[must_use]
    pub(crate) fn listening_slots(&self) -> Option<(u16, &[u64])> {
        self.silence.listening_slots()
    }

    /// Handle, channel offset of the background and, by slot, whether it is in force, where there is one slotframe alone and
    /// it has a background.
    #[must_use]
    pub fn background(&self) -> Option<(u8, u16, impl Iterator<Item = bool> + '_)> {
        let [frame] = &self.frames[..] else { return None };
        let in_force = frame.first.iter().map(|&first| first == NONE);
        Some((frame.handle, frame.background?, in_force))
    }

    /// Adds a slotframe, or empties the one with this handle and gives it this length.
    pub fn add_slotframe(&mut self, handle: u8, slots: u16) {
        assert!(slots != 0, "a slotframe has at least one slot");
        self.change();
        self.frames.retain(|frame| frame.handle != handle);
        let place = self.frames.partition_point(|frame| frame.handle < handle);
        self.frames.insert(place, Slotframe::new(handle, slots));
        self.silence.index(&self.frames);
    }

    /// Removes a slotframe and its cells, if there is one.
    pub(crate) fn remove_slotframe(&mut self, handle: u8) {
        self.change();
        self.frames.retain(|frame| frame.handle != handle);
        self.silence.index(&self.frames);
    }

    /// Changes the length of a slotframe. Cells beyond its new end are removed.
    ///
    /// # Errors
    ///
    /// There is no such slotframe.
    pub fn resize(&mut self, handle: u8, slots: u16) -> Result<(), ScheduleError> {
        self.change();
        let frame = self.frame_mut(handle)?;
        frame.slots = slots;
        frame.cells.retain(|cell| cell.slot < slots);
        frame.index();
        self.silence.index(&self.frames);
        Ok(())
    }

    /// Lets a slotframe receive on a channel offset, from anyone, in every slot without cells; `None`: no longer.
    ///
    /// # Errors
    ///
    /// There is no such slotframe.
    pub(crate) fn set_background(
        &mut self,
        handle: u8,
        channel: Option<u16>,
    ) -> Result<(), ScheduleError> {
        self.change();
        let frame = self.frame_mut(handle)?;
        frame.background = channel;
        frame.index();
        self.silence.index(&self.frames);
        Ok(())
    }

    /// Adds a cell. One that is the same already stays as it is.
    ///
    /// # Errors
    ///
    /// There is no such slotframe, or its end comes before the slot.
    pub fn add(&mut self, handle: u8, cell: Cell) -> Result<(), ScheduleError> {
        self.change();
        let frame = self.frame_mut(handle)?;
        if frame.slots <= cell.slot {
            return Err(ScheduleError::BeyondEnd { slot: cell.slot, slots: frame.slots });
        }
        if !frame.at_slot(cell.slot).iter().any(|other| other.is_same(&cell)) {
            frame.insert(cell);
            self.silence.index(&self.frames);
        }
        Ok(())
    }

    /// Adds many cells at once.
    ///
    /// # Errors
    ///
    /// As [`Schedule::add`]; then none is added.
    pub fn add_all(&mut self, handle: u8, cells: &[Cell]) -> Result<(), ScheduleError> {
        self.change();
        let frame = self.frame_mut(handle)?;
        let slots = frame.slots;
        if let Some(cell) = cells.iter().find(|cell| slots <= cell.slot) {
            return Err(ScheduleError::BeyondEnd { slot: cell.slot, slots });
        }
        for cell in cells {
            if !frame.cells.iter().any(|other| other.slot == cell.slot && other.is_same(cell)) {
                frame.cells.push(*cell);
            }
        }
        frame.cells.sort_by_key(|cell| cell.slot);
        frame.index();
        self.silence.index(&self.frames);
        Ok(())
    }

    /// Removes cells of a slotframe; returns how many.
    pub fn remove_where(&mut self, handle: u8, mut which: impl FnMut(&Cell) -> bool) -> usize {
        self.change();
        let Ok(frame) = self.frame_mut(handle) else { return 0 };
        let before = frame.cells.len();
        frame.cells.retain(|cell| !which(cell));
        let removed = before - frame.cells.len();
        if removed != 0 {
            frame.index();
            self.silence.index(&self.frames);
        }
        removed
    }

    /// Whether frames to `neighbour` have a cell of their own.
    #[must_use]
    pub fn has_dedicated_tx(&self, neighbour: Eui64) -> bool {
        self.frames.iter().any(|frame| {
            frame.tx_cells().any(|cell| cell.neighbour == Some(neighbour) && !cell.options.shared)
        })
    }

    /// Whether frames to `neighbour` have a cell that is meant for it, shared or not.
    #[must_use]
    pub fn has_tx_to(&self, neighbour: Eui64) -> bool {
        self.frames
            .iter()
            .any(|frame| frame.tx_cells().any(|cell| cell.neighbour == Some(neighbour)))
    }

    /// Counts a transmission in a cell.
    pub(crate) fn count_tx(&mut self, at: &CellRef, acknowledged: bool) {
        self.used(at, |cell| cell.count_tx(acknowledged));
    }

    /// Counts a reception in a cell.
    pub fn count_rx(&mut self, at: &CellRef) {
        self.used(at, |cell| cell.num_rx = cell.num_rx.saturating_add(1));
    }

    /// Slots before `until_asn`, since this schedule began, in which some cell receives.
    pub fn n_listening(&self, until_asn: Asn) -> u64 {
        let since = self.counted_asn.min(until_asn);
        self.n_listening + listening_slots(&self.frames, since, until_asn)
    }

    fn used(&mut self, at: &CellRef, count: impl FnOnce(&mut Cell)) {
        let Ok(frame) = self.frame_mut(at.handle) else { return };
        let first = frame.first.get(usize::from(at.cell.slot)).copied().unwrap_or(NONE);
        if first == NONE {
            return;
        }
        let mut cells = frame.cells[usize::from(first)..]
            .iter_mut()
            .take_while(|cell| cell.slot == at.cell.slot);
        if let Some(cell) = cells.find(|cell| cell.is_same(&at.cell)) {
            count(cell);
        }
    }

    fn frame_mut(&mut self, handle: u8) -> Result<&mut Slotframe, ScheduleError> {
        self.frames
            .iter_mut()
            .find(|frame| frame.handle == handle)
            .ok_or(ScheduleError::NoSlotframe(handle))
    }

    fn change(&mut self) {
        self.count_until(self.effective_asn);
        self.n_changes += 1;
    }

    fn count_until(&mut self, until_asn: Asn) {
        if self.counted_asn < until_asn {
            self.n_listening += listening_slots(&self.frames, self.counted_asn, until_asn);
            self.counted_asn = until_asn;
        }
    }
}
