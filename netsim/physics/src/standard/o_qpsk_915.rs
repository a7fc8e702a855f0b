//! O-QPSK at 915 MHz: 250 kbit/s.

use super::{ChannelPlan, Entry, Modulation, Standard};
use crate::timing::Airtime;

/// `standard = "o-qpsk-915"`.
///
/// # Model
///
/// 1 Mchip/s, 16 chips and 4 bits to a symbol of 16 µs (IEEE Std 802.15.4-2015, 12). The bit error rate is that of 2.4 GHz (16
/// quasi-orthogonal sequences without phase) with the gain of a sequence of 16 chips instead of 32: 10 instead of 20.
pub const ENTRY: Entry = Entry {
    name: "o-qpsk-915",
    doc: "O-QPSK at 915 MHz, 250 kbit/s, channels 1 to 10 (IEEE Std 802.15.4-2015, 12).",
    standard: Standard {
        channels: ChannelPlan { page: 2, first: 1, last: 10, first_hz: 906e6, spacing_hz: 2e6 },
        airtime: Airtime::of_bytes(32_000, 4, 6),
        hopping_sequence: &[1, 6, 3, 8, 5, 10, 2, 7, 4, 9],
        bit_rate_bps: 250e3,
        noise_bandwidth_hz: 1e6,
        noise_figure_db: 6.0,
        modulation: Modulation::OQpsk { symbol_gain: 10.0 },
    },
};
