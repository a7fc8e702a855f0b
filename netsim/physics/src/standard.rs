//! Physical layers of IEEE 802.15.4: band, channels, bit rate, and what a receiver makes of noise.
//!
//! One file per physical layer, one list: `BUILT_IN`. `netsim.phy.standard` selects one. A physical layer decides
//!
//! * which channels there are, and their frequencies, for propagation and for captures;
//! * how long frames last, and so which slots are long enough;
//! * the defaults of the carrier, the hopping sequence, the reception curve and the interference rule.
//!
//! All have the offsets, guard times and turnaround times of the default timeslot template for 2.4 GHz (IEEE Std 802.15.4-2015,
//! 8.4.3.3.3). These are attributes of the MAC, which a network may set otherwise; firmware for slower radios often has longer ones.

pub mod o_qpsk_2450;
pub mod o_qpsk_868;
pub mod o_qpsk_915;
pub mod sun_fsk_863;
pub mod sun_fsk_902;

use crate::timing::Airtime;
use proto::config::Choice;
use serde::{Deserialize, Serialize};

/// The physical layers that are built in.
pub(crate) const BUILT_IN: &[Entry] = &[
    o_qpsk_2450::ENTRY,
    o_qpsk_868::ENTRY,
    o_qpsk_915::ENTRY,
    sun_fsk_863::ENTRY,
    sun_fsk_902::ENTRY,
];

/// The values of `netsim.phy.standard`.
pub const CHOICES: [Choice; BUILT_IN.len()] = {
    let mut choices = [Choice { name: "", doc: "" }; BUILT_IN.len()];
    let mut place = 0;
    while place < BUILT_IN.len() {
        choices[place] = Choice { name: BUILT_IN[place].name, doc: BUILT_IN[place].doc };
        place += 1;
    }
    choices
};

/// The physical layer of this name; the first one of the list for `None`.
#[must_use]
pub fn find(name: Option<&str>) -> &'static Entry {
    let named = BUILT_IN.iter().find(|entry| Some(entry.name) == name);
    named.unwrap_or(&BUILT_IN[0])
}

/// A physical layer that can be configured.
#[derive(Debug)]
pub struct Entry {
    /// Its name.
    pub name: &'static str,
    /// What it is, one sentence.
    pub doc: &'static str,
    /// Its properties.
    pub standard: Standard,
}

/// A physical layer.
#[derive(Clone, Copy, Debug)]
pub struct Standard {
    /// Channels and their frequencies.
    pub channels: ChannelPlan,
    /// How long frames last.
    pub airtime: Airtime,
    /// The hopping sequence if none is configured.
    pub hopping_sequence: &'static [u8],
    /// Bit rate (bit/s).
    pub bit_rate_bps: f64,
    /// Bandwidth in which the receiver collects noise (Hz).
    pub noise_bandwidth_hz: f64,
    /// Noise figure of the receiver (dB).
    pub noise_figure_db: f64,
    /// How bits are sent.
    pub modulation: Modulation,
}

/// How bits are sent, and so which of them noise changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Modulation {
    /// The measured table of 2.4 GHz motes and the bit error rate of their O-QPSK: what `reception` and `interference` are
    /// without a physical layer.
    Measured,
    /// O-QPSK with 16 quasi-orthogonal sequences of chips.
    OQpsk {
        /// Energy of a symbol over the noise density, per signal-to-noise ratio.
        symbol_gain: f64,
    },
    /// 2-FSK, detected without phase.
    Fsk,
}

/// Channels of a physical layer: their numbers and centre frequencies.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChannelPlan {
    /// Channel page, by which captures name the physical layer.
    pub page: u8,
    /// Lowest number of a channel.
    pub first: u8,
    /// Highest number of a channel.
    pub last: u8,
    /// Centre frequency of the lowest channel (Hz).
    pub first_hz: f64,
    /// Distance between neighbouring centres (Hz).
    pub spacing_hz: f64,
}

impl ChannelPlan {
    /// Centre frequency (Hz) of a channel.
    #[inline]
    #[must_use]
    pub fn centre_hz(&self, channel: u8) -> f64 {
        self.first_hz + self.spacing_hz * (f64::from(channel) - f64::from(self.first))
    }

    /// Centre of the band (Hz).
    #[must_use]
    pub fn middle_hz(&self) -> f64 {
        0.5 * (self.centre_hz(self.first) + self.centre_hz(self.last))
    }

    /// Whether there is such a channel.
    #[must_use]
    pub fn contains(&self, channel: u8) -> bool {
        (self.first..=self.last).contains(&channel)
    }
}

/// Energy of a symbol over the noise density, per signal-to-noise ratio, of 2.4 GHz O-QPSK (IEEE Std 802.15.4-2006, E.4.1.8).
const GAIN_2450: f64 = 20.0;
/// Thermal noise at 290 K in 1 Hz (dBm).
const THERMAL_DBM: f64 = -173.975;

impl Standard {
    /// Noise power in the receiver's channel (dBm): thermal noise in its bandwidth, and its noise figure; to 0.1 dB.
    #[must_use]
    pub fn noise_floor_dbm(&self) -> f64 {
        let noise_dbm =
            THERMAL_DBM + 10.0 * libm::log10(self.noise_bandwidth_hz) + self.noise_figure_db;
        libm::round(10.0 * noise_dbm) / 10.0
    }

    /// The tables `[netsim.phy.reception]` and `[netsim.phy.interference]` where they are not configured. `None`: their own
    /// defaults hold.
    #[must_use]
    pub fn reception_toml(&self) -> Option<String> {
        let noise_dbm = self.noise_floor_dbm();
        match self.modulation {
            Modulation::Measured => None,
            Modulation::OQpsk { symbol_gain } => {
                // Half the gain is twice the noise.
                let lost_db = 10.0 * libm::log10(GAIN_2450 / symbol_gain);
                let noise_dbm = libm::round(10.0 * (noise_dbm + lost_db)) / 10.0;
                Some(format!("kind = \"o-qpsk\"\nnoise_floor_dbm = {noise_dbm:?}\n"))
            }
            Modulation::Fsk => Some(format!(
                "kind = \"fsk\"\nnoise_floor_dbm = {noise_dbm:?}\nbandwidth_hz = {:?}\nbit_rate_bps = {:?}\n",
                self.noise_bandwidth_hz, self.bit_rate_bps,
            )),
        }
    }

    /// As [`Standard::reception_toml`], for interference.
    #[must_use]
    pub fn interference_toml(&self) -> Option<String> {
        let reception = self.reception_toml()?;
        Some(match self.modulation {
            Modulation::OQpsk { .. } => {
                format!("{reception}bit_rate_bps = {:?}\n", self.bit_rate_bps)
            }
            Modulation::Measured | Modulation::Fsk => reception,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_channel_of_a_hopping_sequence_exists_and_a_bit_lasts_as_its_rate_says() {
        for Entry { name, standard, .. } in BUILT_IN {
            let plan = standard.channels;
            assert!(standard.hopping_sequence.iter().all(|&channel| plan.contains(channel)));
            let byte_ns = 8e9 / standard.bit_rate_bps;
            assert_eq!(standard.airtime.byte_ns as f64, byte_ns, "{name}");
        }
    }

    #[test]
    fn val_centre_frequencies_of_the_standard() {
        // IEEE Std 802.15.4-2015, 10.1.2: first and last channel of each band (MHz).
        let expected = [
            (o_qpsk_2450::ENTRY, 2405.0, 2480.0),
            (o_qpsk_868::ENTRY, 868.3, 868.3),
            (o_qpsk_915::ENTRY, 906.0, 924.0),
            (sun_fsk_863::ENTRY, 863.125, 869.725),
            (sun_fsk_902::ENTRY, 902.2, 927.8),
        ];
        for (entry, first_mhz, last_mhz) in expected {
            let plan = entry.standard.channels;
            assert!((plan.centre_hz(plan.first) - first_mhz * 1e6).abs() < 1.0);
            assert!((plan.centre_hz(plan.last) - last_mhz * 1e6).abs() < 1.0);
        }
    }

    #[test]
    fn the_least_slot_holds_the_longest_frame_and_acknowledgment() {
        let least_us = |entry: Entry| entry.standard.airtime.least_slot_ns() / 1000;
        assert_eq!(least_us(o_qpsk_2450::ENTRY), 9_776);
        assert_eq!(least_us(sun_fsk_863::ENTRY), 2_120 + (8 + 127) * 160 + 1_000 + (8 + 69) * 160);
        assert_eq!(least_us(o_qpsk_868::ENTRY), 2_120 + (6 + 127) * 80 + 1_000 + (6 + 69) * 80);
    }

    #[test]
    fn noise_is_that_of_290_k_in_the_bandwidth_and_the_noise_figure() {
        // −173.975 + 50 + 7.
        assert_eq!(sun_fsk_863::ENTRY.standard.noise_floor_dbm(), -117.0);
    }
}
