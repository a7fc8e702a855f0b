//! Electronics that grow warm.

use super::{Effect, Entry};
use crate::link::{Link, Side};
use proto::config::Section;
use proto::effect::{Catalogued, Need};

/// `kind = "temperature"`.
pub const ENTRY: Entry = Entry::of::<Temperature>();

/// Transmit power and sensitivity depend on the temperature of the electronics.
///
/// # Mechanism
///
/// As the electronics warm up, the transmitter's power falls and the receiver's noise rises, so a sunny afternoon weakens every
/// outdoor link.
///
/// # Equation
///
/// ```text
/// RSSI' = RSSI + db_per_c * (T - reference_c), T the mean of temperature_c at both ends
/// ```
///
/// # Source
///
/// K. Bannister, G. Giorgetti, S. K. S. Gupta, Wireless sensor networking for hot applications, HotEmNets 2008 (8 dB from 25 to 65
/// degrees C, CC2420); C. A. Boano et al., The impact of temperature on outdoor industrial sensornet applications, IEEE Trans.
/// Industrial Informatics 6 (2010) 451.
///
/// # Validity
///
/// Linear and the same for every node; temperatures are clipped to -60 to 125 degrees C. Without a known temperature nothing is
/// added.
///
/// # Trace
///
/// Linear in temperature, and therefore a slow daily cycle on all links alike.
#[derive(Clone, Copy, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "temperature",
    needs = &[Need::Column("temperature_c"), Need::Readings],
    example = "db_per_c = -0.15\n",
    linear_in = Some("temperature_c"),
)]
pub struct Temperature {
    /// Change of the received power if both ends warm up by one degree (dB per degree C). Measured: -0.1 to -0.2.
    #[key(range = -5.0..=5.0)]
    #[fit(
        unit = "dB/degC",
        starts = [-0.1],
        step = 0.005,
        null = 0.0,
        plausible = -1.5..=0.5,
        source = "Bannister et al. 2008 and Boano et al. 2010: -0.1 to -0.2 dB per degree C",
    )]
    pub db_per_c: f64,
    /// Reference temperature (degrees C) at which nothing is added. It is aliased with system-gain: its fit absorbs any missing
    /// constant.
    #[key(range = -60.0..=125.0, default = 20.0)]
    #[fit(unit = "degC", starts = [20.0], step = 0.5)]
    pub reference_c: f64,
}

/// Temperatures (°C) that electronics survive.
const COLDEST_C: f64 = -60.0;
const WARMEST_C: f64 = 125.0;

impl Effect for Temperature {
    fn contribution_db(&self, link: &Link<'_>) -> f64 {
        let celsius_of = |side: Side| link.covariate("temperature_c", side);
        let temperature_c = match (celsius_of(Side::Sender), celsius_of(Side::Receiver)) {
            (Some(sender_c), Some(receiver_c)) => 0.5 * (sender_c + receiver_c),
            (Some(one_c), None) | (None, Some(one_c)) => one_c,
            (None, None) => return 0.0,
        };
        if !temperature_c.is_finite() {
            return 0.0;
        }
        self.db_per_c * (temperature_c.clamp(COLDEST_C, WARMEST_C) - self.reference_c)
    }

    fn max_gain_db(&self) -> f64 {
        let shift_db = |temperature_c: f64| self.db_per_c * (temperature_c - self.reference_c);
        shift_db(COLDEST_C).max(shift_db(WARMEST_C))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::testing::along_x;
    use crate::link::{Covariates, Scene};

    #[test]
    fn bannister_2008_has_8_db_from_25_to_65_degrees() {
        let effect = Temperature { db_per_c: -0.2, reference_c: 25.0 };
        let contribution_with = |row: &[(&str, f64)]| {
            let row: Vec<_> = row.iter().map(|&(name, value)| (name.to_owned(), value)).collect();
            let scene = Scene { covariates: Covariates::Row(&row), ..Scene::default() };
            effect.contribution_db(&along_x(10.0, 1.0, None, &scene))
        };
        assert_eq!(contribution_with(&[("temperature_c", 65.0)]), -8.0);
        assert_eq!(
            contribution_with(&[("tx_temperature_c", 65.0), ("rx_temperature_c", 25.0)]),
            -4.0
        );
        assert_eq!(contribution_with(&[("rx_temperature_c", 65.0)]), -8.0);
        assert_eq!(contribution_with(&[("humidity_pct", 65.0)]), 0.0);
        assert_eq!(contribution_with(&[("temperature_c", f64::NAN)]), 0.0);
        assert!(contribution_with(&[("temperature_c", -1000.0)]) <= effect.max_gain_db());
    }
}
