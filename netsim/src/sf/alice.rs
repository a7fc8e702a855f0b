//! ALICE: a cell for each direction of each link, elsewhere in every slotframe.
//!
//! Kim, Kim, Kim: "ALICE: Autonomous Link-based Cell Scheduling for TSCH", IPSN 2019. What the paper leaves open is as in the
//! authors' code for Contiki and Contiki-NG.

use super::orchestra::{Hash, Orchestra, OrchestraConfig, Rule};
use super::{
    BuildContext, Config, Configured, Context, Entry, MAX_SLOTS, PayloadCells, SchedulingFunction,
    Traffic,
};
use crate::mac::{Cell, CellOptions};
use crate::wire::Eui64;
use physics::asn::Asn;
use proto::config::{Choice, Problem, Section, variant};
use proto::ids::MoteId;
use proto::time::SimTime;
use serde::{Deserialize, Serialize};

/// `kind = "alice"`.
pub const ENTRY: Entry =
    Entry { variant: variant::<AliceConfig>("alice"), payload_cells: PayloadCells::Shared, build };

/// Handle of the slotframe with the cells of links: after those for beacons (0) and for everything else (1), which take
/// precedence where cells coincide.
pub(crate) const UNICAST_HANDLE: u8 = 2;

/// Channel offset of the common cell, and of links where all have the same: the handles of their slotframes.
const COMMON_CHANNEL: u16 = 1;

/// Channel offsets of the cells of links.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum UnicastChannels {
    /// Computed like the slot, from 1 to the number of channels minus 1.
    PerLink,
    /// 2 for all cells.
    One,
}

/// ALICE: every mote computes a cell for each direction of each link to its parent and children, at another place in every
/// slotframe, without negotiation (Kim et al., IPSN 2019). Requires the storing mode of RPL.
///
/// Keys of `[netsim.sf]`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Section)]
pub(crate) struct AliceConfig {
    /// Length of the slotframe for beacons (slots). 397: the authors' code.
    #[key(range = 1..=MAX_SLOTS, default = 397)]
    pub eb_slots: u16,
    /// Length of the slotframe for broadcast frames and frames without a cell of their own (slots). 31: the authors' code.
    #[key(range = 1..=MAX_SLOTS, default = 31)]
    pub common_slots: u16,
    /// Length of the slotframe with the cells of links (slots). 23: the authors' code.
    #[key(range = 1..=MAX_SLOTS, default = 23)]
    pub unicast_slots: u16,
    /// Channel offsets of the cells of links.
    #[key(default = UnicastChannels::PerLink)]
    pub unicast_channels: UnicastChannels,
    /// Whether a waiting frame is dropped when its receiver stops being a parent or child; otherwise it moves to the common cell.
    #[key(default = true)]
    pub early_packet_drop: bool,
    /// The part of an address from which cells are computed.
    #[key(default = Hash::LastOctet)]
    pub hash: Hash,
}

impl AliceConfig {
    /// Absolute slotframe number (ASFN) of the slotframe of links: whole slotframes since slot 0, in the 16 bits that the
    /// authors' code keeps.
    #[must_use]
    pub(crate) fn asfn(&self, asn: Asn) -> u16 {
        (asn / u64::from(self.unicast_slots)) as u16
    }

    /// The number that is hashed for the link from one mote to another in a slotframe: α · ID(from) + ID(to) + ASFN, where α
    /// is the number of different IDs.
    fn link(&self, from: Eui64, to: Eui64, asfn: u16) -> u32 {
        let (alpha, id): (u32, fn(Eui64) -> u32) = match self.hash {
            Hash::LastOctet => (1 << 8, |address| u32::from(address.0 as u8)),
            Hash::LastTwoOctets => (1 << 16, |address| u32::from(address.0 as u16)),
        };
        // All of 16 bits in both IDs leaves no room for the slotframe's number: it begins anew, as the authors' 32 bits do.
        (alpha * id(from) + id(to)).wrapping_add(u32::from(asfn))
    }

    /// Slot and channel offset of the cell in which `from` transmits to `to` in the slotframe with this absolute number.
    #[must_use]
    pub(crate) fn cell(&self, from: Eui64, to: Eui64, asfn: u16, n_channels: u16) -> (u16, u16) {
        let hash = mix(self.link(from, to, asfn));
        let slot = (hash % u32::from(self.unicast_slots)) as u16;
        let channel = match self.unicast_channels {
            UnicastChannels::One => u16::from(UNICAST_HANDLE),
            // Offset 0 is that of beacons. With a single channel all offsets are the same.
            UnicastChannels::PerLink => 1 + (hash % u32::from(n_channels.max(2) - 1)) as u16,
        };
        (slot, channel)
    }

    /// Orchestra's rules for everything but links: beacons by time source, and a common cell.
    fn others(&self) -> OrchestraConfig {
        OrchestraConfig {
            rules: vec![Rule::EbPerTimeSource, Rule::DefaultCommon],
            eb_slots: self.eb_slots,
            common_slots: self.common_slots,
            unicast_slots: 1,
            unicast_active_slots: 1,
            root_slots: 1,
            eb_channel: 0,
            common_channel: COMMON_CHANNEL,
            unicast_channel_min: 0,
            unicast_channel_max: 0,
            sender_based: false,
            is_collision_free: false,
            hash: self.hash,
        }
    }
}

/// The hash of the authors' code: shifts and additions of 32 bits, which they attribute to Thomas Wang.
fn mix(value: u32) -> u32 {
    ((value.wrapping_add(value >> 16) ^ (value >> 9)) ^ (value << 3)) ^ (value >> 5)
}

fn build(table: &toml::Table, context: &mut BuildContext<'_>) -> Option<Config> {
    if !context.stores_routes {
        let message = "requires rpl.mode = \"storing\", in which parents know their children";
        let path = proto::config::join(context.path, "kind");
        context.problems.push(Problem::new(path, message).value("\"alice\""));
        return None;
    }
    let config = AliceConfig::read(table);
    config.others().warn_of_equal_motes(context);
    Some(Config::new(config))
}

/// ALICE of one mote: three slotframes, of which the lower handle takes precedence where cells coincide.
///
/// | handle | transmits | receives | carries |
/// |---|---|---|---|
/// | 0 | hash(self) | hash(time source) | beacons |
/// | 1 | 0 | 0 | broadcast frames; unicast frames to others than parent and children |
/// | 2 | cell(self, X, ASFN) | cell(X, self, ASFN) | unicast frames to parent and children X |
///
/// The cells of slotframe 2 follow from both addresses, in this order, and from the absolute slotframe number: two links that
/// collide in one slotframe do not in the next. Cells of links are shared: other links may have the same.
///
/// # Rules
///
/// 1. When slotframe 2 begins anew, and when parent or children change, all its cells are computed again.
/// 2. A frame is matched with a cell when the cell comes, not when the frame is queued: it goes in whatever cell its receiver
///    then has.
/// 3. A frame for the parent uses slotframe 2 once the parent has acknowledged this mote's DAO, since only then it listens.
/// 4. A frame that waits for a mote that is no longer parent or child is dropped: no cell leads there.
///
/// # Differences
///
/// The authors' code reschedules after the last cell of a slotframe, this one when the next slotframe begins. The
/// cells of a slotframe are the same.
/// With `[netsim.mobility] reroute`, frames for a former parent go to the new one before rule 4 applies.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Alice {
    config: AliceConfig,
    /// Slotframes 0 and 1.
    others: Orchestra,
    parent: Option<Eui64>,
    is_known_to_parent: bool,
    /// Ascending.
    children: Vec<Eui64>,
    /// When the next slotframe of links begins.
    next: Option<SimTime>,
}

impl Configured for AliceConfig {
    type OfMote = Alice;

    fn create(&self, mote: MoteId) -> Alice {
        Alice::new(self, mote)
    }
}

impl Alice {
    /// The scheduling function of a mote.
    #[must_use]
    pub(crate) fn new(config: &AliceConfig, mote: MoteId) -> Self {
        Self {
            config: config.clone(),
            others: Orchestra::new(&config.others(), mote),
            parent: None,
            is_known_to_parent: false,
            children: Vec::new(),
            next: None,
        }
    }

    fn is_child(&self, neighbour: Eui64) -> bool {
        self.children.binary_search(&neighbour).is_ok()
    }

    /// Rule 1: the cells of the slotframe of links that contains the current slot.
    fn install(&mut self, cx: &mut Context<'_>) {
        let Self { config, parent, children, .. } = &*self;
        let asfn = config.asfn(cx.asn);
        let cell = |from, to, options, neighbour| {
            let (slot, channel) = config.cell(from, to, asfn, cx.n_channels);
            Cell::new(slot, channel, options, neighbour)
        };
        let own = cx.own;
        let cells: Vec<Cell> = parent
            .iter()
            .chain(children)
            .flat_map(|&relative| {
                [
                    cell(own, relative, CellOptions::TX_SHARED, Some(relative)),
                    cell(relative, own, CellOptions::RX, None),
                ]
            })
            .collect();
        cx.schedule.remove_where(UNICAST_HANDLE, |_| true);
        cx.schedule.add_all(UNICAST_HANDLE, &cells).expect("slots are hashes modulo the length");
        let length = u64::from(config.unicast_slots);
        self.next = Some(SimTime::START + (cx.asn / length + 1) * length * cx.slot);
    }
}

impl SchedulingFunction for Alice {
    fn start(&mut self, cx: &mut Context<'_>) {
        self.others.start(cx);
        self.parent = cx.parent;
        cx.schedule.add_slotframe(UNICAST_HANDLE, self.config.unicast_slots);
        self.install(cx);
    }

    fn stop(&mut self) {
        *self = Self::new(&self.config, MoteId(0));
    }

    /// That of the common cell, in which broadcast frames are sent.
    fn slotframe_slots(&self) -> u16 {
        self.config.common_slots
    }

    fn minimal_cell(&self) -> Option<u16> {
        None
    }

    fn handle_time_source(&mut self, cx: &mut Context<'_>, source: Option<Eui64>) {
        self.others.handle_time_source(cx, source);
    }

    fn handle_parent(&mut self, cx: &mut Context<'_>, old: Option<Eui64>) {
        self.others.handle_parent(cx, old);
        if self.parent != cx.parent {
            self.parent = cx.parent;
            self.is_known_to_parent = false;
            self.install(cx);
        }
    }

    fn handle_known_to_parent(&mut self, _cx: &mut Context<'_>) {
        self.is_known_to_parent = true;
    }

    fn handle_child(&mut self, cx: &mut Context<'_>, child: Eui64, is_child: bool) {
        match (self.children.binary_search(&child), is_child) {
            (Err(place), true) => self.children.insert(place, child),
            (Ok(place), false) => drop(self.children.remove(place)),
            _ => return,
        }
        self.install(cx);
    }

    fn poll_timeout(&self) -> Option<SimTime> {
        self.next
    }

    fn handle_timeout(&mut self, cx: &mut Context<'_>) {
        self.install(cx);
    }

    fn slotframe_of(&self, traffic: Traffic) -> Option<u8> {
        match traffic {
            Traffic::Unicast(to)
                if self.is_child(to) || self.is_known_to_parent && self.parent == Some(to) =>
            {
                Some(UNICAST_HANDLE)
            }
            _ => self.others.slotframe_of(traffic),
        }
    }

    fn abandons(&self, slotframe: u8, neighbour: Eui64) -> bool {
        self.config.early_packet_drop
            && slotframe == UNICAST_HANDLE
            && self.parent != Some(neighbour)
            && !self.is_child(neighbour)
    }
}

#[cfg(test)]
mod tests;
