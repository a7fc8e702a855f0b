//! Channel blacklisting: the two ends of a link agree which channels they skip, `[netsim.mac.blacklist]` of the configuration.
//!
//! One file per rule, one list, `BUILT_IN`. Without a rule nothing is learned, signalled or skipped.
//!
//! # Model
//!
//! The sender of a link keeps an estimate of the packet delivery ratio of each channel, from the acknowledgments of the frames
//! that it sends in dedicated cells. A rule turns the estimates into a blacklist. As long as the receiver is not known to have it,
//! frames carry it in a vendor-specific header information element. It is in force at the receiver once a frame with it is received,
//! and at the sender once that frame is acknowledged. In a dedicated cell of channel offset c both ends then use the first of the
//! `offsets` channel offsets c, c + `spacing`, c + 2 `spacing`, … whose channel is not blacklisted, and the last of them if all are.
//!
//! In a fraction `explore` of a link's cells, chosen by a hash of the absolute slot number and of both addresses, both ends follow
//! the plain hopping sequence, and the frame carries the blacklist. There the ends always meet, so that a disagreement ends:
//! no protocol can exclude one, since the receiver cannot know whether its acknowledgment arrived. After `max_failures` and one more
//! in a row the sender, too, follows the plain sequence until it has agreed anew with the receiver; it keeps its estimates.
//!
//! Beacons, broadcast frames, shared cells and cells after a pending bit are not affected.

pub mod first_best_arm;
mod links;
#[cfg(test)]
mod tests;

pub use links::Blacklists;

use crate::mac::{Cell, CellKind};
use proto::config::{
    Problem, Registered, Registry, Section, TableSpec, Tag, Variant, Variants, join,
};
use serde::{Deserialize, Serialize};

/// Number of channels of IEEE 802.15.4 at 2.4 GHz, 11 to 26.
pub(crate) const N_CHANNELS: usize = 16;
const FIRST_CHANNEL: u8 = 11;

/// A set of channels: bit 0 is channel 11.
pub(crate) type ChannelSet = u16;

/// Place of a channel among the 16 of the band.
#[must_use]
pub fn place_of(channel: u8) -> usize {
    usize::from(channel.saturating_sub(FIRST_CHANNEL)).min(N_CHANNELS - 1)
}

/// The set with one channel.
#[must_use]
pub(crate) fn set_of(channel: u8) -> ChannelSet {
    1 << place_of(channel)
}

/// Packet delivery ratio of each channel, in hundredths.
pub type Quality = [u8; N_CHANNELS];

/// Description of `[netsim.mac.blacklist]`.
pub const SPEC: TableSpec = TableSpec {
    doc: "Channel blacklisting: per link, channels on which frames are lost are skipped in dedicated cells.",
    fields: &[],
    tag: Some(&TAG),
};

/// The key that selects a rule.
pub(crate) const TAG: Tag = Tag {
    key: "kind",
    doc: "The rule by which a link blacklists channels.",
    default: Some(NONE.variant.name),
    variants: Variants::List(LIST),
};

/// A rule that can be configured.
#[derive(Debug)]
pub struct Entry {
    /// Its name and keys.
    pub variant: Variant,
    /// Makes it of its checked table; `None`: no blacklisting. The set: the channels of the hopping sequence. The path is that of
    /// the table.
    pub build: fn(&toml::Table, ChannelSet, &str, &mut Vec<Problem>) -> Option<Config>,
}

impl Registered for Entry {
    fn variant(&self) -> &Variant {
        &self.variant
    }
}

/// What descriptions call the list of rules.
pub(crate) const LIST: &str = "netsim.mac.blacklist";

/// The rules that are built in.
pub(crate) const BUILT_IN: &[Entry] = &[NONE, first_best_arm::ENTRY];

const NONE: Entry = Entry {
    variant: Variant {
        name: "none",
        doc: "No blacklisting: every cell follows the hopping sequence.",
        fields: &[],
    },
    build: |_, _, _, _| None,
};

/// The keys that every rule has.
#[derive(Section)]
struct Common {
    /// Number of channel offsets to choose from, the first being that of the cell. More avoid more channels, but may collide with cells
    /// of other links in the same slot. 3: as most links have in the schedule of MABO-TSCH's implementation.
    #[key(range = 2..=512, default = 3)]
    offsets: u16,
    /// Difference between one of these channel offsets and the next. 7: as in that schedule.
    #[key(range = 1..=511, default = 7)]
    spacing: u16,
    /// Fraction of cells in which the link follows the plain hopping sequence, so that a blacklisted channel that has become good is
    /// noticed. 0.05: the initial value of MABO-TSCH's implementation.
    #[key(range = 0.001..=1.0, default = 0.05)]
    explore: f64,
}

/// Channel blacklisting as configured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Config {
    /// The rule.
    pub rule: Rule,
    /// The channels of the hopping sequence.
    pub channels: ChannelSet,
    /// Number of channel offsets to choose from.
    pub offsets: u16,
    /// Difference between one of them and the next.
    pub spacing: u16,
    /// Fraction of cells that follow the plain hopping sequence.
    pub explore: f64,
    /// After more failures than this in a row the sender follows the plain hopping sequence until a blacklist is acknowledged.
    pub max_failures: u8,
}

/// A rule: how estimates are updated, and which channels they blacklist.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Rule {
    /// All but the best channels are blacklisted.
    FirstBestArm(first_best_arm::FirstBestArm),
}

impl Rule {
    /// The estimate after a transmission.
    #[must_use]
    pub fn learn(&self, quality: u8, acknowledged: bool) -> u8 {
        match self {
            Self::FirstBestArm(rule) => rule.learn(quality, acknowledged),
        }
    }

    /// The blacklist among `channels`, where `current` is in force.
    #[must_use]
    pub fn blacklist(
        &self,
        quality: &Quality,
        channels: ChannelSet,
        current: ChannelSet,
    ) -> ChannelSet {
        match self {
            Self::FirstBestArm(rule) => rule.blacklist(quality, channels, current),
        }
    }
}

/// Whether a cell belongs to one sender and one receiver, both of whom know it.
#[inline]
#[must_use]
pub fn is_dedicated(cell: &Cell) -> bool {
    let options = cell.options;
    options.tx != options.rx
        && !options.shared
        && cell.neighbour.is_some()
        && cell.kind == CellKind::Normal
}

/// Makes the settings of the checked table. `sf`: the checked table of the scheduling function, at `sf_path`.
pub fn build(
    table: &toml::Table,
    path: &str,
    hopping_sequence: &[u8],
    (sf, sf_path): (&toml::Table, &str),
    known: &Registry<Entry>,
    problems: &mut Vec<Problem>,
) -> Option<Config> {
    let channels = hopping_sequence.iter().fold(0, |set, &channel| set | set_of(channel));
    let entry = known.selected(table, &TAG)?;
    let band = FIRST_CHANNEL..FIRST_CHANNEL + N_CHANNELS as u8;
    let beyond = hopping_sequence.iter().find(|&channel| !band.contains(channel));
    if let Some(beyond) = beyond.filter(|_| entry.variant.name != NONE.variant.name) {
        let message = format!(
            "requires phy.standard = \"o-qpsk-2450\", whose channels are 11 to 26, and netsim.hopping_sequence has \
             channel {beyond}"
        );
        let quoted = |name: &str| format!("{name:?}");
        let problem = Problem::new(join(path, TAG.key), message);
        problems.push(problem.value(quoted(entry.variant.name)).nearest(quoted(NONE.variant.name)));
        return None;
    }
    let config = (entry.build)(table, channels, path, problems)?;
    let n = hopping_sequence.len().max(1);
    if usize::from(config.spacing).is_multiple_of(n) && 1 < n {
        let message = format!(
            "must not be a multiple of the length of netsim.hopping_sequence, {n}, because all channel offsets then \
             have the same channel"
        );
        let problem = Problem::new(join(path, "spacing"), message).value(config.spacing);
        problems.push(problem.nearest(config.spacing - 1));
    }
    if sf.get("kind").and_then(toml::Value::as_str) == Some("static") {
        check_cells(sf, path, sf_path, problems);
    }
    Some(config)
}

/// What is wrong with a scheduling function without dedicated cells where `[netsim.mac.blacklist]`, at `path`, is set. `sf`: the
/// checked table of the scheduling function, at `sf_path`.
pub(crate) fn undedicated((sf, sf_path): (&toml::Table, &str), path: &str) -> Problem {
    let kind = sf.get("kind").and_then(toml::Value::as_str).unwrap_or_default();
    let message = format!(
        "has no dedicated cells that both ends of a link know, which {path} requires: set it to \"msf\", \"llsf\", \"emsf\" or \
         \"static\""
    );
    Problem::new(format!("{sf_path}.kind"), message).value(format!("{kind:?}")).nearest("\"msf\"")
}

/// The cells of a static schedule, as far as they must be the same at both ends.
#[derive(Section)]
struct StaticKeys {
    cell: Vec<StaticCell>,
}

#[derive(Section)]
struct StaticCell {
    from: toml::Value,
    to: toml::Value,
    shared: Option<bool>,
}

/// A receiver cannot tell the cell of a sender to it alone from one that the sender shares, or uses for everyone.
fn check_cells(sf: &toml::Table, path: &str, sf_path: &str, problems: &mut Vec<Problem>) {
    for (index, cell) in StaticKeys::read(sf).cell.iter().enumerate() {
        let at = format!("{sf_path}.cell[{index}]");
        let is_shared = cell.shared.unwrap_or(!cell.from.is_integer());
        let problem = match (cell.from.is_integer(), cell.to.is_integer()) {
            (true, true) if is_shared => Problem::new(
                format!("{at}.shared"),
                format!("must be false for a cell between two motes, because {path} is set"),
            ),
            (false, true) if !is_shared => Problem::new(
                format!("{at}.shared"),
                format!("must be true for a cell from \"any\" to one mote, because {path} is set"),
            ),
            (true, false) => Problem::new(
                format!("{at}.from"),
                format!("must be \"any\" for a cell to \"all\", because {path} is set"),
            )
            .nearest("\"any\""),
            _ => continue,
        };
        problems.push(problem);
    }
}
