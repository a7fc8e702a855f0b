//! Orchestra: cells that every mote computes from addresses.
//!
//! Duquennoy, Al Nahas, Landsiedel, Watteyne: "Orchestra: Robust Mesh Networks Through Autonomously Scheduled TSCH", SenSys 2015; the
//! rules, periods and hashes of Contiki-NG and TSCH-Sim.

mod config;
#[cfg(test)]
mod tests;

pub use config::{ENTRY, Hash, OrchestraConfig, Rule};

use super::{Configured, Context, SchedulingFunction, Traffic};
use crate::mac::{Cell, CellKind, CellOptions, Schedule};
use crate::wire::Eui64;
use proto::ids::MoteId;
use serde::{Deserialize, Serialize};

/// Added to the handle of [`Rule::SpecialForRoot`] for the slotframe in which a root listens: after all others.
pub(crate) const ROOT_LISTENS: u8 = 0x80;

/// Orchestra of one mote: every rule has a slotframe, whose handle is its place in the list.
///
/// | rule | transmits | receives | matches |
/// |---|---|---|---|
/// | eb-per-time-source | hash(self) | hash(time source) | beacons |
/// | unicast-non-storing | hash(X), as long as a frame for X waits | hash(self) | unicast frames |
/// | unicast-storing | hash(X), for parent and children X | hash(self) | unicast frames to parent and children |
/// | the same, sender-based | hash(self) | hash(X) | to children, and to a parent that knows us |
/// | link-based | hash(self, X) | hash(X, self) | to children, and to a parent that knows us |
/// | special-for-root | hash(self) | roots: every slot | unicast frames to roots |
/// | default-common | 0 | 0 | everything else |
///
/// All hashes are taken modulo the slotframe's length. A unicast frame is sent on the channel offset of its receiver, whoever's the
/// slot is.
///
/// # Peers
///
/// Contiki-NG fills the slotframe of unicast-non-storing with transmit cells, of which a frame may use one; here just that one
/// exists, while it is needed. Contiki-NG's receiver-based unicast-storing lets a frame for a neighbour that is neither parent nor child
/// wait for a cell that may not exist; here, as in TSCH-Sim, it goes to the next rule.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Orchestra {
    config: OrchestraConfig,
    is_root: bool,
    time_source: Option<Eui64>,
    parent: Option<Eui64>,
    is_known_to_parent: bool,
    /// Ascending.
    children: Vec<Eui64>,
    /// Neighbours that are roots, ascending.
    roots: Vec<Eui64>,
}

impl Configured for OrchestraConfig {
    type OfMote = Orchestra;

    fn create(&self, mote: MoteId) -> Orchestra {
        Orchestra::new(self, mote)
    }
}

impl Orchestra {
    /// The scheduling function of a mote.
    #[must_use]
    pub fn new(config: &OrchestraConfig, _mote: MoteId) -> Self {
        Self {
            config: config.clone(),
            is_root: false,
            time_source: None,
            parent: None,
            is_known_to_parent: false,
            children: Vec::new(),
            roots: Vec::new(),
        }
    }

    /// Parent and children.
    fn relatives(&self) -> impl Iterator<Item = Eui64> + '_ {
        self.parent.iter().chain(&self.children).copied()
    }

    /// Relatives that certainly listen where we would transmit to them.
    fn mutual_relatives(&self) -> impl Iterator<Item = Eui64> + '_ {
        self.parent.iter().filter(|_| self.is_known_to_parent).chain(&self.children).copied()
    }

    fn is_relative(&self, neighbour: Eui64) -> bool {
        self.relatives().any(|relative| relative == neighbour)
    }

    fn is_mutual_relative(&self, neighbour: Eui64) -> bool {
        self.mutual_relatives().any(|relative| relative == neighbour)
    }

    /// Whether frames to a neighbour go by [`Rule::SpecialForRoot`], wherever in the list it stands.
    fn is_by_root_rule(&self, neighbour: Eui64) -> bool {
        !self.is_root
            && self.roots.binary_search(&neighbour).is_ok()
            && self.config.handle_of(Rule::SpecialForRoot).is_some()
    }

    fn matches(&self, rule: Rule, traffic: Traffic) -> bool {
        match (rule, traffic) {
            (Rule::DefaultCommon, _) | (Rule::EbPerTimeSource, Traffic::Beacon) => true,
            (Rule::SpecialForRoot, Traffic::Unicast(to)) => self.is_by_root_rule(to),
            (_, Traffic::Unicast(to)) if self.is_by_root_rule(to) => false,
            (Rule::UnicastNonStoring, Traffic::Unicast(_)) => true,
            (Rule::UnicastStoring, Traffic::Unicast(to)) if !self.config.sender_based => {
                self.is_relative(to)
            }
            (Rule::UnicastStoring | Rule::LinkBased, Traffic::Unicast(to)) => {
                self.is_mutual_relative(to)
            }
            _ => false,
        }
    }

    /// The cells of a rule, but for those of [`Rule::UnicastNonStoring`] that come and go with waiting frames.
    fn cells(&self, rule: Rule, own: Eui64) -> Vec<Cell> {
        let config = &self.config;
        let to = |slot: u16, neighbour: Eui64, options: CellOptions| {
            Cell::new(slot, config.channel(neighbour), options, Some(neighbour))
        };
        let receive = |slot: u16| Cell::new(slot, config.channel(own), CellOptions::RX, None);
        match rule {
            Rule::EbPerTimeSource => self.beacon_cells(own),
            Rule::UnicastNonStoring => vec![receive(config.unicast_slot(own))],
            Rule::UnicastStoring if config.sender_based => {
                let options = CellOptions { shared: !config.is_collision_free, ..CellOptions::TX };
                let slot = config.unicast_slot(own);
                let sent = self.mutual_relatives().map(|relative| to(slot, relative, options));
                let received =
                    self.relatives().map(|relative| receive(config.unicast_slot(relative)));
                sent.chain(received).collect()
            }
            Rule::UnicastStoring => {
                let sent = self.relatives().map(|relative| {
                    to(config.unicast_slot(relative), relative, CellOptions::TX_SHARED)
                });
                std::iter::once(receive(config.unicast_slot(own))).chain(sent).collect()
            }
            Rule::LinkBased => {
                let sent = self.mutual_relatives().map(|relative| {
                    to(config.link_slot(own, relative), relative, CellOptions::TX_SHARED)
                });
                let received =
                    self.relatives().map(|relative| receive(config.link_slot(relative, own)));
                sent.chain(received).collect()
            }
            Rule::SpecialForRoot if self.is_root => Vec::new(),
            Rule::SpecialForRoot => {
                let slot = config.root_slot(own);
                self.roots.iter().map(|&root| to(slot, root, CellOptions::TX_SHARED)).collect()
            }
            Rule::DefaultCommon => {
                let advertises = config.handle_of(Rule::EbPerTimeSource).is_none();
                let kind = if advertises { CellKind::Advertising } else { CellKind::Normal };
                let cell = Cell::new(0, config.common_channel, CellOptions::TX_RX_SHARED, None);
                vec![cell.of_kind(kind)]
            }
        }
    }

    /// Own beacons and those of the time source; one cell, if both have the same slot.
    fn beacon_cells(&self, own: Eui64) -> Vec<Cell> {
        let config = &self.config;
        let cell = |slot, options| {
            Cell::new(slot, config.eb_channel, options, None).of_kind(CellKind::AdvertisingOnly)
        };
        let own_slot = config.eb_slot(own);
        match self.time_source.map(|source| config.eb_slot(source)) {
            Some(slot) if slot == own_slot => {
                vec![cell(own_slot, CellOptions { rx: true, ..CellOptions::TX })]
            }
            Some(slot) => vec![cell(own_slot, CellOptions::TX), cell(slot, CellOptions::RX)],
            None => vec![cell(own_slot, CellOptions::TX)],
        }
    }

    /// Makes the cells of some rules what they should be. Cells that stay keep their counters.
    fn refresh(&self, cx: &mut Context<'_>, which: &[Rule]) {
        for &rule in which {
            if let Some(handle) = self.config.handle_of(rule) {
                replace(cx.schedule, handle, &self.cells(rule, cx.own));
            }
        }
    }

    fn slots(&self, rule: Rule) -> u16 {
        match rule {
            Rule::EbPerTimeSource => self.config.eb_slots,
            Rule::UnicastNonStoring | Rule::UnicastStoring | Rule::LinkBased => {
                self.config.unicast_slots
            }
            Rule::SpecialForRoot => self.config.root_slots,
            Rule::DefaultCommon => self.config.common_slots,
        }
    }
}

/// Rules whose cells depend on parent and children.
const OF_RELATIVES: &[Rule] = &[Rule::UnicastStoring, Rule::LinkBased];

/// Gives a slotframe these cells and no others, touching nothing that is right already.
fn replace(schedule: &mut Schedule, handle: u8, wanted: &[Cell]) {
    let is_in = |cells: &[Cell], cell: &Cell| cells.iter().any(|other| other.is_same(cell));
    let cells = schedule.slotframe(handle).map_or(&[][..], |frame| frame.cells());
    let missing: Vec<Cell> = wanted.iter().filter(|cell| !is_in(cells, cell)).copied().collect();
    if cells.iter().any(|cell| !is_in(wanted, cell)) {
        schedule.remove_where(handle, |cell| !is_in(wanted, cell));
    }
    for cell in missing {
        schedule.add(handle, cell).expect("slots are hashes modulo the slotframe's length");
    }
}

/// Adds an address to an ascending list, or takes it out. Returns whether that changed anything.
fn set_member(list: &mut Vec<Eui64>, address: Eui64, is_member: bool) -> bool {
    match (list.binary_search(&address), is_member) {
        (Err(place), true) => list.insert(place, address),
        (Ok(place), false) => drop(list.remove(place)),
        _ => return false,
    }
    true
}

impl SchedulingFunction for Orchestra {
    fn start(&mut self, cx: &mut Context<'_>) {
        self.is_root = cx.is_root;
        self.parent = cx.parent;
        for (handle, &rule) in (0..).zip(&self.config.rules) {
            cx.schedule.add_slotframe(handle, self.slots(rule));
            replace(cx.schedule, handle, &self.cells(rule, cx.own));
            if rule == Rule::SpecialForRoot && self.is_root {
                let channel = self.config.channel(cx.own);
                let listens = Cell::new(0, channel, CellOptions::RX, None);
                cx.schedule.add_slotframe(ROOT_LISTENS | handle, 1);
                replace(cx.schedule, ROOT_LISTENS | handle, &[listens]);
            }
        }
    }

    fn stop(&mut self) {
        self.time_source = None;
        self.parent = None;
        self.is_known_to_parent = false;
        self.children.clear();
        self.roots.clear();
    }

    /// That of the common cell, in which broadcast frames are sent.
    fn slotframe_slots(&self) -> u16 {
        self.config.common_slots
    }

    fn minimal_cell(&self) -> Option<u16> {
        None
    }

    fn handle_time_source(&mut self, cx: &mut Context<'_>, source: Option<Eui64>) {
        if self.time_source != source {
            self.time_source = source;
            self.refresh(cx, &[Rule::EbPerTimeSource]);
        }
    }

    fn heeds_beacons(&self) -> bool {
        true
    }

    fn handle_beacon(&mut self, cx: &mut Context<'_>, from: Eui64, join_metric: u8) {
        if set_member(&mut self.roots, from, join_metric == 0) {
            self.refresh(cx, &[Rule::SpecialForRoot]);
        }
    }

    /// The parent becomes the time source. Without one, whom the mote followed so far remains it.
    fn handle_parent(&mut self, cx: &mut Context<'_>, _old: Option<Eui64>) {
        if self.parent == cx.parent {
            return;
        }
        self.parent = cx.parent;
        self.is_known_to_parent = false;
        self.refresh(cx, OF_RELATIVES);
        if cx.parent.is_some() {
            self.handle_time_source(cx, cx.parent);
        }
    }

    fn handle_known_to_parent(&mut self, cx: &mut Context<'_>) {
        self.is_known_to_parent = true;
        self.refresh(cx, OF_RELATIVES);
    }

    fn handle_child(&mut self, cx: &mut Context<'_>, child: Eui64, is_child: bool) {
        if set_member(&mut self.children, child, is_child) {
            self.refresh(cx, OF_RELATIVES);
        }
    }

    /// Transmit cells of [`Rule::UnicastNonStoring`].
    fn handle_queue(&mut self, cx: &mut Context<'_>, neighbour: Eui64, waits: bool) {
        let Some(handle) = self.config.handle_of(Rule::UnicastNonStoring) else { return };
        if !waits {
            let frame = cx.schedule.slotframe(handle);
            if frame
                .is_some_and(|frame| frame.tx_cells().any(|cell| cell.neighbour == Some(neighbour)))
            {
                cx.schedule.remove_where(handle, |cell| cell.neighbour == Some(neighbour));
            }
        } else if self.slotframe_of(Traffic::Unicast(neighbour)) == Some(handle) {
            let slot = self.config.unicast_slot(neighbour);
            let channel = self.config.channel(neighbour);
            let cell = Cell::new(slot, channel, CellOptions::TX_SHARED, Some(neighbour));
            cx.schedule.add(handle, cell).expect("a hash modulo the slotframe's length");
        }
    }

    fn slotframe_of(&self, traffic: Traffic) -> Option<u8> {
        let place = self.config.rules.iter().position(|&rule| self.matches(rule, traffic));
        place.map(|place| place as u8)
    }
}
