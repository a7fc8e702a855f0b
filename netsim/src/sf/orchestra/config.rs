//! Orchestra's keys and the arithmetic of its cells.

use crate::sf::{BuildContext, Config, Entry, MAX_SLOTS, PayloadCells};
use crate::wire::Eui64;
use proto::config::{Choice, Problem, Section, join, variant};
use proto::ids::MoteId;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// `kind = "orchestra"`.
pub const ENTRY: Entry =
    Entry { variant: variant::<Keys>("orchestra"), payload_cells: PayloadCells::Shared, build };

/// A slotframe and what is sent in it.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rule {
    /// Every mote sends beacons in its own slot and listens in that of its time source.
    EbPerTimeSource,
    /// Every mote listens in its own slot, in which its neighbours transmit to it (receiver-based).
    UnicastNonStoring,
    /// Receiver-based or sender-based cells between parents and children only; requires the storing mode of RPL.
    UnicastStoring,
    /// A slot for each direction of each link between parents and children.
    LinkBased,
    /// Roots listen in every otherwise empty slot; every mote has a slot to transmit to them.
    SpecialForRoot,
    /// One shared cell of all motes, for all other frames.
    DefaultCommon,
}

/// The part of an address from which cells are computed.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Hash {
    /// The last octet (Contiki-NG, and the authors of ALICE): motes i and i + 256 share all their cells.
    LastOctet,
    /// The last two octets: distinguishes 65,536 motes.
    LastTwoOctets,
}

/// Orchestra as all motes have it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct OrchestraConfig {
    /// What there are slotframes for. The place of a rule is the handle of its slotframe.
    pub rules: Vec<Rule>,
    /// Slotframe of [`Rule::EbPerTimeSource`] (slots).
    pub eb_slots: u16,
    /// Slotframe of [`Rule::DefaultCommon`] (slots).
    pub common_slots: u16,
    /// Slotframe length of the unicast rules (slots).
    pub unicast_slots: u16,
    /// How many of them have cells.
    pub unicast_active_slots: u16,
    /// Slotframe of [`Rule::SpecialForRoot`] (slots).
    pub root_slots: u16,
    /// Channel offset of beacons.
    pub eb_channel: u16,
    /// Channel offset of the common cell.
    pub common_channel: u16,
    /// Minimum channel offset of unicast frames.
    pub unicast_channel_min: u16,
    /// Greatest channel offset of unicast frames.
    pub unicast_channel_max: u16,
    /// [`Rule::UnicastStoring`]: in the slot of the sender.
    pub sender_based: bool,
    /// No two motes have the same unicast slot: sender-based cells need not be shared.
    pub is_collision_free: bool,
    /// What an address contributes.
    pub hash: Hash,
}

impl OrchestraConfig {
    fn hash(&self, address: Eui64) -> u32 {
        match self.hash {
            Hash::LastOctet => u32::from(address.0 as u8),
            Hash::LastTwoOctets => u32::from(address.0 as u16),
        }
    }

    /// The slot in which a mote sends its beacons.
    #[must_use]
    pub(crate) fn eb_slot(&self, of: Eui64) -> u16 {
        (self.hash(of) % u32::from(self.eb_slots)) as u16
    }

    /// The slot of a mote in the unicast slotframe.
    #[must_use]
    pub(crate) fn unicast_slot(&self, of: Eui64) -> u16 {
        (self.hash(of) % u32::from(self.unicast_active_slots)) as u16
    }

    /// The slot of the link from one mote to another. 264 is no multiple of the slotframe's usual length, nor one more than one:
    /// the two directions differ.
    #[must_use]
    pub(crate) fn link_slot(&self, from: Eui64, to: Eui64) -> u16 {
        let hash = self.hash(from) + 264 * self.hash(to);
        (hash % u32::from(self.unicast_active_slots)) as u16
    }

    /// The slot in which a mote transmits to roots.
    #[must_use]
    pub(crate) fn root_slot(&self, of: Eui64) -> u16 {
        (self.hash(of) % u32::from(self.root_slots)) as u16
    }

    /// The channel offset on which a mote receives unicast frames, whoever's the slot is.
    #[must_use]
    pub fn channel(&self, receiver: Eui64) -> u16 {
        let n = u32::from(self.unicast_channel_max - self.unicast_channel_min) + 1;
        self.unicast_channel_min + (self.hash(receiver) % n) as u16
    }

    /// Warns of motes that have all their cells in common.
    pub(in crate::sf) fn warn_of_equal_motes(&self, context: &mut BuildContext<'_>) {
        let mut hashes = BTreeSet::new();
        let addresses = MoteId::first(context.agent_count).map(context.address);
        let n_same = addresses.filter(|&address| !hashes.insert(self.hash(address))).count();
        if n_same != 0 {
            let key = join(context.path, "hash");
            context.warnings.push(format!(
                "{key}: {n_same} of {} motes have all their cells in common with another one{}",
                context.agent_count,
                if self.hash == Hash::LastOctet {
                    "; \"last-two-octets\" tells them apart"
                } else {
                    ""
                }
            ));
        }
    }

    /// The handle of a rule's slotframe, if the rule is in force.
    #[must_use]
    pub(crate) fn handle_of(&self, rule: Rule) -> Option<u8> {
        self.rules.iter().position(|&other| other == rule).map(|place| place as u8)
    }
}

/// Orchestra: every mote computes its cells from its own address and those of its neighbours, without negotiation (Duquennoy et
/// al., SenSys 2015, as in Contiki-NG).
#[derive(Section)]
struct Keys {
    /// Rules, each with its own slotframe. The first rule that matches a frame selects its slotframe; if cells coincide, that of
    /// the earlier rule takes precedence. Absent: eb-per-time-source, unicast-non-storing, default-common.
    #[key(length = 1..=6)]
    rules: Option<Vec<Rule>>,
    /// Slotframe length of eb-per-time-source (slots). 397: Contiki-NG.
    #[key(range = 1..=MAX_SLOTS, default = 397)]
    eb_slots: u16,
    /// Slotframe length of default-common (slots). 31: Contiki-NG.
    #[key(range = 1..=MAX_SLOTS, default = 31)]
    common_slots: u16,
    /// Slotframe length of the unicast rules (slots). 17: Contiki-NG.
    #[key(range = 1..=MAX_SLOTS, default = 17)]
    unicast_slots: u16,
    /// Number of slots at the beginning of the unicast slotframe that have cells. Absent: all.
    #[key(range = 1..=MAX_SLOTS)]
    unicast_active_slots: Option<u16>,
    /// Slotframe length of special-for-root (slots). 7: Contiki-NG.
    #[key(range = 1..=MAX_SLOTS, default = 7)]
    root_slots: u16,
    /// Channel offset of eb-per-time-source. 0: Contiki-NG before 4.9, then 1.
    #[key(range = 0..=255, default = 0)]
    eb_channel: u16,
    /// Channel offset of default-common. 1: Contiki-NG before 4.9, then 0.
    #[key(range = 0..=255, default = 1)]
    common_channel: u16,
    /// Minimum channel offset of unicast frames. 2: Contiki-NG.
    #[key(range = 0..=255, default = 2)]
    unicast_channel_min: u16,
    /// Maximum channel offset of unicast frames; offsets count modulo the number of channels. 255: Contiki-NG.
    #[key(range = 0..=255, default = 255)]
    unicast_channel_max: u16,
    /// With unicast-storing: use the slot of the sender instead of that of the receiver.
    #[key(default = false)]
    sender_based: bool,
    /// The part of an address from which cells are computed.
    #[key(default = Hash::LastOctet)]
    hash: Hash,
}

fn build(table: &toml::Table, context: &mut BuildContext<'_>) -> Option<Config> {
    let keys = Keys::read(table);
    let before = context.problems.len();
    let rules = keys.rules.unwrap_or_else(|| {
        vec![Rule::EbPerTimeSource, Rule::UnicastNonStoring, Rule::DefaultCommon]
    });
    for (place, rule) in rules.iter().enumerate() {
        if rules[..place].contains(rule) {
            let key = join(context.path, &format!("rules[{place}]"));
            context.problems.push(Problem::new(key, "must not be listed twice"));
        }
    }
    if rules.last() != Some(&Rule::DefaultCommon) {
        let message =
            "must end with \"default-common\", which matches all frames that no other rule matches";
        context.problems.push(Problem::new(join(context.path, "rules"), message));
    }
    let unicast_active_slots = keys.unicast_active_slots.unwrap_or(keys.unicast_slots);
    if keys.unicast_slots < unicast_active_slots {
        let key = join(context.path, "unicast_active_slots");
        let message = format!("must be at most unicast_slots, {}", keys.unicast_slots);
        let problem = Problem::new(key, message).value(unicast_active_slots);
        context.problems.push(problem.nearest(keys.unicast_slots));
    }
    if keys.unicast_channel_max < keys.unicast_channel_min {
        let key = join(context.path, "unicast_channel_max");
        let least = keys.unicast_channel_min;
        let message = format!("must be at least unicast_channel_min, {least}");
        let problem = Problem::new(key, message).value(keys.unicast_channel_max);
        context.problems.push(problem.nearest(least));
    }
    if context.problems.len() != before {
        return None;
    }
    if keys.sender_based && !rules.contains(&Rule::UnicastStoring) {
        let key = join(context.path, "sender_based");
        context.warnings.push(format!("{key} has no influence without the rule unicast-storing"));
    }
    let mut config = OrchestraConfig {
        rules,
        eb_slots: keys.eb_slots,
        common_slots: keys.common_slots,
        unicast_slots: keys.unicast_slots,
        unicast_active_slots,
        root_slots: keys.root_slots,
        eb_channel: keys.eb_channel,
        common_channel: keys.common_channel,
        unicast_channel_min: keys.unicast_channel_min,
        unicast_channel_max: keys.unicast_channel_max,
        sender_based: keys.sender_based,
        is_collision_free: false,
        hash: keys.hash,
    };
    let mut addresses = MoteId::first(context.agent_count).map(context.address);
    let mut taken = BTreeSet::new();
    config.is_collision_free = context.agent_count <= usize::from(unicast_active_slots)
        && addresses.all(|address| taken.insert(config.unicast_slot(address)));
    config.warn_of_equal_motes(context);
    Some(Config::new(config))
}
