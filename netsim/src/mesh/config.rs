//! What a network is made of: a configuration that was read.

use crate::mote::addresses::Addresses;
use crate::mote::settings::Settings;
use crate::second;
use physics::interference::Interference;
use physics::model::Model;
use physics::standard::o_qpsk_2450::HOPPING_SEQUENCE;
use proto::ids::MoteId;
use proto::time::SimDuration;
use std::sync::Arc;

/// A valid configuration.
#[derive(Debug)]
pub struct Config {
    /// Length of a slot.
    pub slot: SimDuration,
    /// Slots to a control period.
    pub n_slots: u64,
    /// Channels by absolute slot number; none: frames have no channel.
    pub hopping_sequence: Vec<u8>,
    /// Motes that are left out.
    pub absent: Vec<MoteId>,
    /// Height of antennas above planar positions (m).
    pub antenna_height_m: f64,
    /// The radio model, shared with the network that uses it.
    pub model: Arc<Model>,
    /// What frames that are on the air together do to each other.
    pub interference: Option<Interference>,
    /// The protocols, if there are any.
    pub network: Option<Box<(Settings, Addresses)>>,
    /// The broadcast medium beside the main network, if there is one.
    pub second: Option<second::Config>,
}

/// Length of a slot by the standard's template.
pub(crate) const STANDARD_SLOT: SimDuration = SimDuration::from_ms(10);

impl Config {
    /// What beacons say of the template that times slots and of the sequence of channels: 0, the standard's; 1, another one,
    /// on which all motes have agreed beforehand.
    #[must_use]
    pub(crate) fn announced_ids(&self) -> [u8; 2] {
        [self.slot != STANDARD_SLOT, self.hopping_sequence != HOPPING_SEQUENCE].map(u8::from)
    }
}
