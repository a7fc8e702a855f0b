//! Free space.

use super::{Entry, Family, NOT_REPLAYED, Prediction, Propagation, Radio, Reach, Reception};
use crate::link::{Link, SPEED_OF_LIGHT_MPS};
use proto::config::Variant;

/// `propagation = "friis"`.
pub const ENTRY: Entry = Entry {
    variant: Variant {
        name: "friis",
        doc: "Free-space propagation (Friis 1946): the optimistic bound of the BotNet paper.",
        fields: &[],
    },
    family: Family::Signal,
    replay: NOT_REPLAYED,
    build: |_, context| Some(Box::new(Friis { radio: context.radio })),
};

/// Received power (dBm) in free space.
///
/// # Model
///
/// Friis, "A note on a simple transmission formula", Proc. IRE 34 (1946) 254:
///
/// ```text
/// P_rx = P_tx + G_t + G_r + 20 log10(c / (4 π d f))
/// ```
///
/// # Arguments
///
/// * `total_dbm`: transmit power and both antenna gains (dBm).
/// * `distance_m`: between the antennas (m), greater than 0.
/// * `frequency_hz`: (Hz), greater than 0.
///
/// # Validity
///
/// The far field (beyond a wavelength, 12 cm), a clear path, no ground: real links are weaker.
///
/// # Examples
///
/// ```
/// use physics::propagation::friis::friis_dbm;
///
/// assert!((friis_dbm(0.0, 10.0, 2.4e9) - -60.052).abs() < 0.0005);
/// ```
#[must_use]
pub fn friis_dbm(total_dbm: f64, distance_m: f64, frequency_hz: f64) -> f64 {
    let ratio = SPEED_OF_LIGHT_MPS / (4.0 * std::f64::consts::PI * distance_m * frequency_hz);
    total_dbm + 20.0 * libm::log10(ratio)
}

/// Distance (m) at which free space leaves `power_dbm`.
#[must_use]
pub fn friis_range_m(total_dbm: f64, power_dbm: f64, frequency_hz: f64) -> f64 {
    let wavelength_m = SPEED_OF_LIGHT_MPS / frequency_hz;
    wavelength_m / (4.0 * std::f64::consts::PI) * libm::pow(10.0, (total_dbm - power_dbm) / 20.0)
}

/// As far as [`friis_range_m`], and a little farther, so that rounding cannot cut off a link.
pub(super) fn friis_reach(total_dbm: f64, floor_dbm: f64, frequency_hz: f64) -> Reach {
    within(friis_range_m(total_dbm, floor_dbm, frequency_hz))
}

/// Within a distance and a little more, unless that is beyond numbers.
pub(super) fn within(distance_m: f64) -> Reach {
    let distance_m = distance_m * (1.0 + 1e-9);
    if distance_m.is_finite() { Reach::Within(distance_m) } else { Reach::Unlimited }
}

/// Free space: [`friis_dbm`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friis {
    /// Settings of the radio: power, frequency, antenna gains.
    pub radio: Radio,
}

impl Propagation for Friis {
    fn predict(&self, link: &Link<'_>) -> Prediction {
        let rssi_dbm = friis_dbm(self.radio.total_dbm(), link.distance_m, link.frequency_hz);
        Prediction { rssi_dbm, reception: Reception::ByCurve }
    }

    fn reach(&self, floor_dbm: f64, frequency_hz: f64) -> Reach {
        friis_reach(self.radio.total_dbm(), floor_dbm, frequency_hz)
    }

    fn is_isotropic(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_6tisch_simulator_friis_at_2_4_ghz() {
        for (distance_m, expected_dbm) in [
            (0.01, -0.052),
            (1.0, -40.052),
            (2.0, -46.073),
            (5.0, -54.031),
            (7.0, -56.954),
            (10.0, -60.052),
            (20.0, -66.073),
            (50.0, -74.031),
            (100.0, -80.052),
            (500.0, -94.031),
            (700.0, -96.954),
        ] {
            let got = friis_dbm(0.0, distance_m, 2.4e9);
            // Half a unit of the vectors' last digit.
            assert!((got - expected_dbm).abs() < 0.000_501, "{distance_m} m: {got} dBm");
        }
    }

    #[test]
    fn channels_11_and_26_are_weaker_than_2_4_ghz() {
        // The catalogue's figures, two digits.
        assert!((friis_dbm(0.0, 10.0, 2.405e9) - -60.07).abs() < 0.005);
        assert!((friis_dbm(0.0, 10.0, 2.480e9) - -60.34).abs() < 0.005);
    }

    #[test]
    fn val_6tisch_simulator_ranges() {
        // Power (dBm), and the distance at which Friis, Friis - 20 dB and Friis - 40 dB leave it.
        for (power_dbm, upper_m, mean_m, lower_m) in [
            (-79.0, 88.593, 8.859, 0.886),
            (-93.6, 475.77, 47.577, 4.758),
            (-97.0, 703.72, 70.372, 7.037),
        ] {
            for (loss_db, expected_m) in [(0.0, upper_m), (20.0, mean_m), (40.0, lower_m)] {
                let got = friis_range_m(-loss_db, power_dbm, 2.4e9);
                // Three decimals are given, five digits for the largest.
                let tolerance = if 100.0 < expected_m { 0.0051 } else { 0.000_51 };
                assert!((got - expected_m).abs() < tolerance, "{power_dbm} dBm: {got} m");
            }
        }
    }
}
