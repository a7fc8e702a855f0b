//! O-QPSK at 2.4 GHz: 250 kbit/s.

use super::{ChannelPlan, Entry, Modulation, Standard};
use crate::timing::Airtime;

/// The hopping sequence of 6TiSCH networks for 16 channels, as the 6TiSCH simulator has it (IEEE Std 802.15.4-2015 default).
pub const HOPPING_SEQUENCE: [u8; 16] =
    [16, 17, 23, 18, 26, 15, 25, 22, 19, 11, 12, 13, 24, 14, 20, 21];

/// `standard = "o-qpsk-2450"`.
pub const ENTRY: Entry = Entry {
    name: "o-qpsk-2450",
    doc: "O-QPSK at 2.4 GHz, 250 kbit/s, channels 11 to 26 (IEEE Std 802.15.4-2015, 12).",
    standard: Standard {
        channels: CHANNELS,
        airtime: Airtime::O_QPSK_2450,
        hopping_sequence: &HOPPING_SEQUENCE,
        bit_rate_bps: 250e3,
        noise_bandwidth_hz: 2e6,
        noise_figure_db: 6.0,
        modulation: Modulation::Measured,
    },
};

/// Channels 11 to 26 of channel page 0: 2405 + 5 (k − 11) MHz (IEEE Std 802.15.4-2015, 10.1.2.2).
pub const CHANNELS: ChannelPlan =
    ChannelPlan { page: 0, first: 11, last: 26, first_hz: 2405e6, spacing_hz: 5e6 };
