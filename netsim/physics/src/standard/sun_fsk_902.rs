//! SUN FSK from 902 to 928 MHz, operating mode 1: 50 kbit/s.

use super::{ChannelPlan, Entry, Modulation, Standard};
use crate::timing::Airtime;

/// `standard = "sun-fsk-902"`.
///
/// # Model
///
/// Operating mode 1 of the SUN FSK PHY (IEEE Std 802.15.4-2015, 20): 2-FSK of 50 kbit/s with modulation index 1, 129 channels of
/// 200 kHz. A frame begins with 4 bytes of preamble, the fewest that the standard allows, 2 of start of frame and 2 of PHY header.
/// Without forward error correction and data whitening. The receiver's bandwidth is 2 (deviation + bit rate / 2) = 100 kHz.
///
/// # Validity
///
/// The standard allows 2047 bytes to a frame; 6TiSCH frames stay within 127 here, with the check sequence of 2 bytes that the
/// PHY header can select. Firmware often sends longer preambles, up to 8 bytes.
pub const ENTRY: Entry = Entry {
    name: "sun-fsk-902",
    doc: "SUN FSK from 902 to 928 MHz, 2-FSK at 50 kbit/s, channels 0 to 128 (IEEE Std 802.15.4-2015, 20, operating \
          mode 1).",
    standard: Standard {
        channels: ChannelPlan {
            page: 9,
            first: 0,
            last: 128,
            first_hz: 902.2e6,
            spacing_hz: 200e3,
        },
        airtime: Airtime::of_bytes(160_000, 6, 8),
        hopping_sequence: &[0, 43, 86, 17, 60, 103, 34, 77, 120, 9, 52, 95, 26, 69, 112, 128],
        bit_rate_bps: 50e3,
        noise_bandwidth_hz: 100e3,
        noise_figure_db: 7.0,
        modulation: Modulation::Fsk,
    },
};
