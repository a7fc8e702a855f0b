//! When and where a mote listens.

use super::channel::{BEACON_CHANNEL_OFFSET, scan_channel};
use super::{Config, Listening, State, Tsch, channel_of, follows_beside_everyone};
use crate::mac::schedule::Schedule;
use physics::asn::Asn;

impl Tsch {
    /// Whether it listens where its schedule says so, and nowhere else.
    #[must_use]
    pub(crate) fn follows_schedule(&self) -> bool {
        self.is_synced() && self.extra.is_none()
    }

    /// How it listens in this slot, if it does and does not transmit.
    #[inline]
    #[must_use]
    pub fn listening(
        &self,
        config: &Config,
        schedule: &Schedule,
        seed: u64,
        asn: Asn,
    ) -> Option<Listening> {
        match &self.state {
            State::Off => None,
            State::Scanning { .. } => {
                let channel = self.scans_on(config, seed, asn);
                Some(Listening { scans: true, ..Listening::synchronised(None, channel) })
            }
            State::Synced { .. } => {
                let at = schedule.listens(asn);
                let follows =
                    self.extra.filter(|extra| extra.asn == asn && extra.sends_to.is_none());
                match (at, follows) {
                    (Some(_), Some(extra)) if follows_beside_everyone(config, schedule, asn) => {
                        Some(Listening {
                            is_scheduled: true,
                            ..Listening::synchronised(None, extra.channel)
                        })
                    }
                    (Some(at), _) => {
                        let channel = self.channel_in(config, &at.cell, asn);
                        Some(Listening::synchronised(Some(at), channel))
                    }
                    (None, follows) => {
                        follows.map(|extra| Listening::synchronised(None, extra.channel))
                    }
                }
            }
        }
    }

    /// The channel on which it listens in a slot while it looks for a network.
    #[must_use]
    pub fn scans_on(&self, config: &Config, seed: u64, asn: Asn) -> u8 {
        if asn * config.slot < self.knows_slot_until {
            channel_of(config, asn, BEACON_CHANNEL_OFFSET)
        } else {
            scan_channel(config, seed, self.mote, asn)
        }
    }
}
