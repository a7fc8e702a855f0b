//! SUN FSK from 863 to 870 MHz, operating mode 1: 50 kbit/s.

use super::{ChannelPlan, Entry, Modulation, Standard};
use crate::timing::Airtime;

/// `standard = "sun-fsk-863"`.
///
/// # Model
///
/// Operating mode 1 of the SUN FSK PHY (IEEE Std 802.15.4-2015, 20): 2-FSK of 50 kbit/s with modulation index 1, 34 channels of
/// 200 kHz. A frame begins with 4 bytes of preamble, the fewest that the standard allows, 2 of start of frame and 2 of PHY header.
/// Without forward error correction and data whitening. The receiver's bandwidth is 2 (deviation + bit rate / 2) = 100 kHz.
///
/// # Validity
///
/// The standard allows 2047 bytes to a frame; 6TiSCH frames stay within 127 here, with the check sequence of 2 bytes that the
/// PHY header can select. Firmware often sends longer preambles, up to 8 bytes.
pub const ENTRY: Entry = Entry {
    name: "sun-fsk-863",
    doc: "SUN FSK from 863 to 870 MHz, 2-FSK at 50 kbit/s, channels 0 to 33 (IEEE Std 802.15.4-2015, 20, operating \
          mode 1).",
    standard: Standard {
        channels: ChannelPlan {
            page: 9,
            first: 0,
            last: 33,
            first_hz: 863.125e6,
            spacing_hz: 200e3,
        },
        airtime: Airtime::of_bytes(160_000, 6, 8),
        hopping_sequence: &[0, 11, 22, 4, 15, 26, 8, 19, 30, 2, 13, 24, 6, 17, 28, 10],
        bit_rate_bps: 50e3,
        noise_bandwidth_hz: 100e3,
        noise_figure_db: 7.0,
        modulation: Modulation::Fsk,
    },
};
