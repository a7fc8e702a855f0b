//! Cells as they are configured, the same from beginning to end.

use super::{
    BuildContext, Config, Configured, Context, Entry, MAX_SLOTS, PayloadCells, SchedulingFunction,
};
use crate::mac::{Cell, CellKind, CellOptions};
use crate::wire::Eui64;
use proto::config::{CheckedValue, Choice, Key, Kind, Problem, Section, join, variant};
use proto::ids::MoteId;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// `kind = "static"`.
pub const ENTRY: Entry =
    Entry { variant: variant::<Keys>("static"), payload_cells: PayloadCells::Either, build };

const MOTE: Kind = Kind::Integer { min: 0, max: u32::MAX as i64 };

/// Handle of the slotframe with the listed cells.
pub const HANDLE: u8 = 1;

/// A static schedule: the listed cells, as computed by another tool.
#[derive(Section)]
struct Keys {
    /// Length of the slotframe (slots).
    #[key(range = 1..=MAX_SLOTS)]
    slotframe_slots: u16,
    /// Length (slots) of an additional slotframe 0 with the minimal cell of RFC 8180, which takes precedence over listed cells.
    /// Absent: none.
    #[key(range = 1..=MAX_SLOTS)]
    minimal_cell_slots: Option<u16>,
    /// A cell. Each mote installs the cells in which it transmits or receives.
    cell: Vec<CellKeys>,
}

/// A cell.
#[derive(Section)]
struct CellKeys {
    /// Slot offset within the slotframe.
    #[key(range = 0..=u16::MAX)]
    slot: u16,
    /// Channel offset, less than the number of channels.
    #[key(range = 0..=u16::MAX, default = 0)]
    channel: u16,
    /// The mote that transmits, or "any": every mote except the receiver.
    #[key(kind = Kind::Either(&[MOTE, Kind::Choice(&[Choice { name: "any", doc: "Every mote." }])]))]
    from: EndKey,
    /// The mote that receives, or "all": every mote except the transmitter; the cell then carries broadcast frames and unicast
    /// frames to any mote.
    #[key(kind = Kind::Either(&[MOTE, Kind::Choice(&[Choice { name: "all", doc: "Every mote." }])]))]
    to: EndKey,
    /// Whether the cell is shared: several motes may transmit in it, and back off after failures. Absent: true with from = "any",
    /// otherwise false.
    shared: Option<bool>,
    /// Whether beacons are sent in it; requires to = "all".
    #[key(default = false)]
    advertising: bool,
}

enum EndKey {
    Mote(u32),
    Everyone,
}

impl Key for EndKey {
    const KIND: Kind = MOTE;

    fn from_value(value: &CheckedValue) -> Option<Self> {
        let mote = u32::from_value(value).map(Self::Mote);
        mote.or_else(|| value.is_str().then_some(Self::Everyone))
    }
}

impl EndKey {
    fn mote(&self) -> Option<u32> {
        match self {
            Self::Mote(mote) => Some(*mote),
            Self::Everyone => None,
        }
    }
}

/// A mote at one end of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct End {
    /// Number of the mote.
    pub mote: MoteId,
    /// Link-layer address of the mote.
    pub address: Eui64,
}

/// A cell as seen from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct StaticCell {
    /// Slot offset within the slotframe.
    pub slot: u16,
    /// Channel offset, before hopping.
    pub channel: u16,
    /// Who transmits; `None`: anyone.
    pub from: Option<End>,
    /// Who receives; `None`: everyone.
    pub to: Option<End>,
    /// Whether several motes may transmit in it: failures back off.
    pub shared: bool,
    /// Beacons are sent in it.
    pub advertising: bool,
}

impl StaticCell {
    /// What it is for a mote; `None`: it does not concern it.
    #[must_use]
    pub(crate) fn cell_for(&self, mote: MoteId) -> Option<Cell> {
        let is = |end: Option<End>| end.is_some_and(|end| end.mote == mote);
        let (sends, receives) = (is(self.from), is(self.to));
        let options = CellOptions {
            tx: sends || (self.from.is_none() && !receives),
            rx: receives || (self.to.is_none() && !sends),
            shared: self.shared,
        };
        // A cell that only receives has nobody to contend with, and hears only the one that transmits.
        let (options, other) = match (options.tx, options.rx) {
            (false, false) => return None,
            (false, true) => (CellOptions::RX, self.from),
            (true, _) => (options, self.to),
        };
        let kind = if self.advertising { CellKind::Advertising } else { CellKind::Normal };
        let neighbour = other.map(|end| end.address);
        Some(Cell::new(self.slot, self.channel, options, neighbour).of_kind(kind))
    }
}

/// The schedule of all motes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct StaticConfig {
    /// Length of the slotframe (slots).
    pub slotframe_slots: u16,
    /// Length of slotframe 0, if there is one with the minimal cell (slots).
    pub minimal_cell_slots: Option<u16>,
    /// The cells of all motes, as configured.
    pub cells: Vec<StaticCell>,
}

fn build(table: &toml::Table, context: &mut BuildContext<'_>) -> Option<Config> {
    let keys = Keys::read(table);
    let mut problems = Vec::new();
    let mut known = BTreeSet::new();
    for (index, cell) in keys.cell.iter().enumerate() {
        let at = join(context.path, &format!("cell[{index}]"));
        let mut must = |key: &str, message: String, value: String| {
            let problem = Problem::new(join(&at, key), message);
            problems.push(if value.is_empty() { problem } else { problem.value(value) });
        };
        let (from, to) = (cell.from.mote(), cell.to.mote());
        if keys.slotframe_slots <= cell.slot {
            let message = format!("must be less than slotframe_slots, {}", keys.slotframe_slots);
            must("slot", message, cell.slot.to_string());
        }
        if context.n_channels <= cell.channel {
            let message =
                format!("must be less than the number of channels, {}", context.n_channels);
            must("channel", message, cell.channel.to_string());
        }
        for (key, mote) in [("from", from), ("to", to)] {
            if let Some(mote) = mote.filter(|&mote| context.agent_count <= mote as usize) {
                let message =
                    format!("must be the number of a mote, 0 to {}", context.agent_count - 1);
                must(key, message, mote.to_string());
            }
        }
        if from.is_some() && from == to {
            must("to", "must differ from from".to_owned(), String::new());
        }
        if from.is_none() && cell.shared == Some(false) {
            must("shared", "must be true with from = \"any\"".to_owned(), "false".to_owned());
        }
        if to.is_some() && cell.advertising {
            let message = "must be false unless to = \"all\", because beacons are broadcast";
            must("advertising", message.to_owned(), "true".to_owned());
        }
        if !known.insert((cell.slot, cell.channel, from, to)) {
            must("", "must not be listed twice".to_owned(), String::new());
        }
    }
    if !problems.is_empty() {
        context.problems.extend(problems);
        return None;
    }
    let end = |key: &EndKey| {
        key.mote().map(|mote| End { mote: MoteId(mote), address: (context.address)(MoteId(mote)) })
    };
    let cells = keys.cell.iter().map(|cell| StaticCell {
        slot: cell.slot,
        channel: cell.channel,
        from: end(&cell.from),
        to: end(&cell.to),
        shared: cell.shared.unwrap_or(cell.from.mote().is_none()),
        advertising: cell.advertising,
    });
    let config = StaticConfig {
        slotframe_slots: keys.slotframe_slots,
        minimal_cell_slots: keys.minimal_cell_slots,
        cells: cells.collect(),
    };
    warn(&config, context);
    Some(Config::new(config))
}

/// Schedules with which a network cannot form.
fn warn(config: &StaticConfig, context: &mut BuildContext<'_>) {
    if config.minimal_cell_slots.is_some() {
        return;
    }
    let path = context.path;
    let has = |mote: MoteId, which: &dyn Fn(&Cell) -> bool| {
        config.cells.iter().filter_map(|cell| cell.cell_for(mote)).any(|cell| which(&cell))
    };
    let advertises =
        |mote: MoteId| has(mote, &|cell| cell.options.tx && cell.kind != CellKind::Normal);
    if context.roots.len() < context.agent_count
        && !context.roots.iter().any(|&root| advertises(root))
    {
        context.warnings.push(format!(
            "{path}: no root has a cell for beacons: no other mote will ever be synchronised"
        ));
    }
    let mute: Vec<String> = (0..context.agent_count as u32)
        .filter(|&mote| !has(MoteId(mote), &|cell| cell.options.tx))
        .map(|mote| mote.to_string())
        .collect();
    if let [first, ..] = &mute[..] {
        context.warnings.push(format!(
            "{path}: {} of {} motes have no cell to transmit in, mote {first} for one: they will never join",
            mute.len(),
            context.agent_count
        ));
    }
}

/// The part of a schedule that concerns one mote.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct StaticSchedule {
    slotframe_slots: u16,
    minimal_cell_slots: Option<u16>,
    cells: Vec<Cell>,
}

impl Configured for StaticConfig {
    type OfMote = StaticSchedule;

    fn create(&self, mote: MoteId) -> StaticSchedule {
        StaticSchedule::new(self, mote)
    }

    fn has_dedicated_cells(&self) -> bool {
        true
    }
}

impl StaticSchedule {
    /// The scheduling function of a mote.
    #[must_use]
    pub(crate) fn new(config: &StaticConfig, mote: MoteId) -> Self {
        Self {
            slotframe_slots: config.slotframe_slots,
            minimal_cell_slots: config.minimal_cell_slots,
            cells: config.cells.iter().filter_map(|cell| cell.cell_for(mote)).collect(),
        }
    }
}

impl SchedulingFunction for StaticSchedule {
    fn start(&mut self, cx: &mut Context<'_>) {
        cx.schedule.add_slotframe(HANDLE, self.slotframe_slots);
        cx.schedule.add_all(HANDLE, &self.cells).expect("slots were checked");
    }

    fn stop(&mut self) {}

    fn slotframe_slots(&self) -> u16 {
        self.slotframe_slots
    }

    fn minimal_cell(&self) -> Option<u16> {
        self.minimal_cell_slots
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Bench, built, read};
    use super::*;

    const START: &str = "kind = \"static\"\nslotframe_slots = 10\n";

    fn cells(text: &str, mote: MoteId) -> Vec<Cell> {
        let config = built(&format!("{START}minimal_cell_slots = 5\n{text}"), 4);
        let bench = Bench::start(&config, mote);
        bench.schedule.slotframe(HANDLE).unwrap().cells().to_vec()
    }

    fn mote(n: u32) -> Option<Eui64> {
        Some(Eui64::of_mote(MoteId(n)))
    }

    #[test]
    fn a_cell_between_two_motes_concerns_no_other() {
        let text = "[[cell]]\nslot = 3\nchannel = 2\nfrom = 1\nto = 2";
        let is = |mote: MoteId, options, neighbour| {
            let [cell] = cells(text, mote)[..] else { panic!("one cell") };
            assert!(cell.is_same(&Cell::new(3, 2, options, neighbour)));
        };
        is(MoteId(1), CellOptions::TX, mote(2));
        is(MoteId(2), CellOptions::RX, mote(1));
        assert!(cells(text, MoteId(0)).is_empty());
    }

    #[test]
    fn a_cell_to_all_is_heard_by_all_others_and_may_carry_beacons() {
        let text = "[[cell]]\nslot = 9\nfrom = 0\nto = \"all\"\nadvertising = true";
        let is = |mote: MoteId, options, neighbour| {
            let [cell] = cells(text, mote)[..] else { panic!("one cell") };
            let wanted = Cell::new(9, 0, options, neighbour).of_kind(CellKind::Advertising);
            assert!(cell.is_same(&wanted));
        };
        is(MoteId(0), CellOptions::TX, None);
        is(MoteId(1), CellOptions::RX, mote(0));
        is(MoteId(3), CellOptions::RX, mote(0));
    }

    #[test]
    fn a_cell_from_any_is_shared() {
        let options = |text: &str, mote: MoteId| cells(text, mote)[0].options;
        let text = "[[cell]]\nslot = 0\nfrom = \"any\"\nto = \"all\"";
        assert_eq!(options(text, MoteId(2)), CellOptions::TX_RX_SHARED);
        let text = "[[cell]]\nslot = 0\nfrom = \"any\"\nto = 2";
        assert_eq!(options(text, MoteId(2)), CellOptions::RX);
        assert_eq!(options(text, MoteId(1)), CellOptions::TX_SHARED);
        assert_eq!(cells(text, MoteId(1))[0].neighbour, mote(2));
        let text = "[[cell]]\nslot = 0\nfrom = 1\nto = 2\nshared = true";
        assert_eq!(options(text, MoteId(1)), CellOptions::TX_SHARED);
    }

    #[test]
    fn its_minimal_cell_lies_in_a_slotframe_of_its_own_length() {
        let config = built(&format!("{START}minimal_cell_slots = 5"), 4);
        let bench = Bench::start(&config, MoteId(1));
        assert_eq!(bench.schedule.slotframe(0).unwrap().slots(), 5);
        assert_eq!(bench.schedule.slotframe(HANDLE).unwrap().slots(), 10);
        assert_eq!(config.slotframe_slots(), 10);
    }

    #[test]
    fn all_that_is_wrong_is_said_at_once() {
        let text = format!(
            "{START}[[cell]]\nslot = 10\nchannel = 16\nfrom = 4\nto = 5\n\
             [[cell]]\nslot = 1\nfrom = 1\nto = 1\nadvertising = true\n\
             [[cell]]\nslot = 2\nfrom = \"any\"\nto = \"all\"\nshared = false\n\
             [[cell]]\nslot = 2\nfrom = \"any\"\nto = \"all\"\n"
        );
        let (config, problems, _) = read(&text, 4);
        assert!(config.is_none());
        assert_eq!(
            problems,
            [
                "netsim.sf.cell[0].slot: must be less than slotframe_slots, 10, got 10",
                "netsim.sf.cell[0].channel: must be less than the number of channels, 16, got 16",
                "netsim.sf.cell[0].from: must be the number of a mote, 0 to 3, got 4",
                "netsim.sf.cell[0].to: must be the number of a mote, 0 to 3, got 5",
                "netsim.sf.cell[1].to: must differ from from",
                "netsim.sf.cell[1].advertising: must be false unless to = \"all\", because beacons are broadcast, got true",
                "netsim.sf.cell[2].shared: must be true with from = \"any\", got false",
                "netsim.sf.cell[3]: must not be listed twice",
            ]
        );
        let (_, problems, _) =
            read(&format!("{START}[[cell]]\nslot = 1\nfrom = \"all\"\nto = 1"), 4);
        assert_eq!(problems.len(), 1, "{problems:?}");
    }

    #[test]
    fn a_schedule_with_which_nobody_joins_is_warned_of() {
        let text = format!("{START}[[cell]]\nslot = 1\nfrom = 1\nto = \"all\"");
        assert_eq!(
            read(&text, 4).2,
            [
                "netsim.sf: no root has a cell for beacons: no other mote will ever be synchronised",
                "netsim.sf: 3 of 4 motes have no cell to transmit in, mote 0 for one: they will never join",
            ]
        );
    }
}
