//! O-QPSK at 868 MHz: 100 kbit/s on one channel.

use super::{ChannelPlan, Entry, Modulation, Standard};
use crate::timing::Airtime;

/// `standard = "o-qpsk-868"`.
///
/// # Model
///
/// 400 kchip/s, 16 chips and 4 bits to a symbol of 40 µs (IEEE Std 802.15.4-2015, 12). The bit error rate is that of 2.4 GHz
/// (16 quasi-orthogonal sequences without phase) with the gain of a sequence of 16 chips instead of 32: 10 instead of 20.
pub const ENTRY: Entry = Entry {
    name: "o-qpsk-868",
    doc: "O-QPSK at 868 MHz, 100 kbit/s, channel 0 only (IEEE Std 802.15.4-2015, 12).",
    standard: Standard {
        channels: ChannelPlan { page: 2, first: 0, last: 0, first_hz: 868.3e6, spacing_hz: 2e6 },
        airtime: Airtime::of_bytes(80_000, 4, 6),
        hopping_sequence: &[0],
        bit_rate_bps: 100e3,
        noise_bandwidth_hz: 400e3,
        noise_figure_db: 6.0,
        modulation: Modulation::OQpsk { symbol_gain: 10.0 },
    },
};
