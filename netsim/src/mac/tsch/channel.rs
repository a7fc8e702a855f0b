//! Which channel a slot is on.

use super::Config;
use physics::asn::Asn;
use proto::ids::MoteId;
use proto::rng::{Draws, Purpose};

/// The channel offset on which beacons are expected: of the minimal cell (RFC 8180, § 4.1), and Orchestra's by default.
pub(super) const BEACON_CHANNEL_OFFSET: u16 = 0;

/// The channel of a cell in a slot: IEEE Std 802.15.4-2015, 6.2.6.3.
#[inline]
#[must_use]
pub fn channel_of(config: &Config, asn: Asn, channel_offset: u16) -> u8 {
    channel_at(&config.hopping_sequence, asn, channel_offset)
}

/// The same, of a hopping sequence.
#[inline]
#[must_use]
pub fn channel_at(sequence: &[u8], asn: Asn, channel_offset: u16) -> u8 {
    sequence[((asn + u64::from(channel_offset)) % sequence.len() as u64) as usize]
}

/// The channel on which a scanning mote listens: another one at random after each dwell.
#[must_use]
pub(super) fn scan_channel(config: &Config, seed: u64, mote: MoteId, asn: Asn) -> u8 {
    let dwell = asn / u64::from(config.scan_dwell_slots);
    let word = Draws::new(seed, Purpose::Scan).words(u64::from(mote.0), dwell, 0)[0];
    let sequence = &config.hopping_sequence;
    sequence[((u128::from(word) * sequence.len() as u128) >> 64) as usize]
}
