//! Channels that a link skips.

use super::{Config, Tsch, channel_of};
use crate::mac::blacklist::{Blacklists, ChannelSet, is_dedicated};
use crate::mac::queue::Queued;
use crate::mac::schedule::{Cell, CellRef};
use crate::wire::Eui64;
use crate::wire::frame::MAX_PSDU;
use physics::asn::Asn;

impl Tsch {
    /// The channel on which the mote uses a cell in a slot.
    #[inline]
    pub(super) fn channel_in(&self, config: &Config, cell: &Cell, asn: Asn) -> u8 {
        match &config.blacklist {
            Some(blacklist) if is_dedicated(cell) => {
                let sequence = &config.hopping_sequence;
                self.blacklists.channel(blacklist, sequence, self.own, cell, asn)
            }
            _ => channel_of(config, asn, cell.channel),
        }
    }

    /// Puts a blacklist into a frame that is about to be sent, if one is due and the frame has room for it.
    pub(super) fn offer_blacklist(
        &self,
        config: &Config,
        asn: Asn,
        at: Option<&CellRef>,
        queued: &mut Queued,
    ) {
        let Some(blacklist) = &config.blacklist else { return };
        queued.frame.blacklist = at
            .filter(|at| is_dedicated(&at.cell))
            .and_then(|_| queued.destination())
            .and_then(|to| self.blacklists.offer(blacklist, self.own, to, asn));
        if queued.frame.blacklist.is_some() && MAX_PSDU < queued.frame.buffer_len() {
            queued.frame.blacklist = None;
        }
    }

    /// Learns from a unicast frame that was sent.
    pub(super) fn learn_channel(
        &mut self,
        config: &Config,
        at: Option<&CellRef>,
        channel: u8,
        queued: &Queued,
        acknowledged: bool,
    ) {
        if let (Some(blacklist), Some(at), Some(to)) = (&config.blacklist, at, queued.destination())
            && is_dedicated(&at.cell)
        {
            let carried = queued.frame.blacklist;
            self.blacklists.learn(blacklist, to, channel, carried, acknowledged);
        }
    }

    /// A frame from a neighbour, for us alone, carried its blacklist.
    pub(crate) fn receive_blacklist(&mut self, from: Eui64, blacklist: ChannelSet) {
        self.blacklists.receive(from, blacklist);
    }

    /// The blacklists of its links.
    #[must_use]
    pub fn blacklists(&self) -> &Blacklists {
        &self.blacklists
    }
}
