//! The blacklists of one mote: of the links on which it sends, and of those on which it receives.

use super::{ChannelSet, Config, N_CHANNELS, Quality, is_dedicated, place_of, set_of};
use crate::mac::Cell;
use crate::mac::tsch::channel_at;
use crate::wire::Eui64;
use physics::asn::Asn;
use proto::rng::{Draws, Purpose};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The blacklists of one mote.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Blacklists {
    sends: BTreeMap<Eui64, Link>,
    receives: BTreeMap<Eui64, ChannelSet>,
}

/// A link on which the mote sends.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Link {
    quality: Quality,
    /// The blacklist in force.
    agreed: ChannelSet,
    /// The receiver is known to have it.
    is_confirmed: bool,
    /// The blacklist that frames carry, as the rule has it now.
    wanted: ChannelSet,
    /// Failures since the last acknowledgment.
    n_failures: u8,
}

impl Link {
    const NEW: Self = Self {
        quality: [100; N_CHANNELS],
        agreed: 0,
        is_confirmed: false,
        wanted: 0,
        n_failures: 0,
    };
}

/// Whether the link from one mote to another follows the plain hopping sequence in a slot. Both ends compute the same.
fn explores(config: &Config, from: Eui64, to: Eui64, asn: Asn) -> bool {
    let link = from.0 ^ to.0.rotate_left(32);
    Draws::new(0, Purpose::BlacklistExploration).uniform(link, asn.0, 0) < config.explore
}

/// The first of the channels to choose from that is not blacklisted, or the last.
fn channel_by(
    config: &Config,
    sequence: &[u8],
    asn: Asn,
    offset: u16,
    blacklist: ChannelSet,
) -> u8 {
    let n = u64::from(config.offsets).min(sequence.len() as u64);
    let mut channel = channel_at(sequence, asn, offset);
    for ahead in 1..n {
        if blacklist & set_of(channel) == 0 {
            break;
        }
        channel = channel_at(sequence, asn + ahead * u64::from(config.spacing), offset);
    }
    channel
}

impl Blacklists {
    /// The channel of a dedicated cell of mote `own` in a slot.
    #[must_use]
    pub fn channel(
        &self,
        config: &Config,
        sequence: &[u8],
        own: Eui64,
        cell: &Cell,
        asn: Asn,
    ) -> u8 {
        let plain = channel_at(sequence, asn, cell.channel);
        let Some(neighbour) = cell.neighbour.filter(|_| is_dedicated(cell)) else { return plain };
        let (blacklist, from, to) = if cell.options.tx {
            let link = self.sends.get(&neighbour);
            (link.map_or(0, |link| link.agreed), own, neighbour)
        } else {
            let received = self.receives.get(&neighbour);
            (received.copied().unwrap_or_default(), neighbour, own)
        };
        if blacklist & set_of(plain) == 0 || explores(config, from, to, asn) {
            return plain;
        }
        channel_by(config, sequence, asn, cell.channel, blacklist)
    }

    /// The blacklist that a frame carries in a dedicated cell that transmits, if it carries one.
    #[must_use]
    pub fn offer(&self, config: &Config, own: Eui64, to: Eui64, asn: Asn) -> Option<ChannelSet> {
        let link = self.sends.get(&to)?;
        let is_due =
            link.wanted != link.agreed || !link.is_confirmed || explores(config, own, to, asn);
        is_due.then_some(link.wanted)
    }

    /// What became of a frame that was sent in a dedicated cell. `carried`: the blacklist in it.
    pub fn learn(
        &mut self,
        config: &Config,
        to: Eui64,
        channel: u8,
        carried: Option<ChannelSet>,
        acknowledged: bool,
    ) {
        let link = self.sends.entry(to).or_insert(Link::NEW);
        let quality = &mut link.quality[place_of(channel)];
        *quality = config.rule.learn(*quality, acknowledged);
        if acknowledged {
            link.n_failures = 0;
            if let Some(blacklist) = carried {
                link.agreed = blacklist;
                link.is_confirmed = true;
            }
        } else {
            // Whether the receiver has taken it over is unknown.
            link.is_confirmed &= carried.is_none_or(|blacklist| blacklist == link.agreed);
            link.n_failures += 1;
            if config.max_failures < link.n_failures {
                link.n_failures = 0;
                link.agreed = 0;
                link.is_confirmed = false;
            }
        }
        link.wanted = config.rule.blacklist(&link.quality, config.channels, link.wanted);
    }

    /// A frame from a neighbour, for us alone, carried its blacklist.
    pub fn receive(&mut self, from: Eui64, blacklist: ChannelSet) {
        self.receives.insert(from, blacklist);
    }

    /// Forgets all links.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// The blacklist in force for frames to a neighbour.
    #[must_use]
    pub fn of_sender(&self, to: Eui64) -> ChannelSet {
        self.sends.get(&to).map_or(0, |link| link.agreed)
    }

    /// The estimated packet delivery ratio (hundredths) of a channel for frames to a neighbour, once one was sent.
    #[must_use]
    pub fn quality(&self, to: Eui64, channel: u8) -> Option<u8> {
        self.sends.get(&to).map(|link| link.quality[place_of(channel)])
    }

    /// The blacklist in force for frames from a neighbour.
    #[must_use]
    pub fn of_receiver(&self, from: Eui64) -> ChannelSet {
        self.receives.get(&from).copied().unwrap_or_default()
    }
}
