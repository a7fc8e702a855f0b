//! Electronics that grow warm.

use super::{Effect, Entry, UNCHECKED};
use crate::phy::link::{Link, Side};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Level, Need, Parameter};
use serde::Deserialize;

/// `kind = "temperature"`.
pub const ENTRY: Entry = Entry {
    variant: Variant {
        name: "temperature",
        doc: "Transmit power and sensitivity depend on the temperature of the electronics.",
        fields: &[
            Field {
                key: "db_per_c",
                doc: "Change of the received power if both ends warm up by one degree (dB per degree C). Measured: -0.1 to \
                      -0.2.",
                kind: Kind::Number(Range::closed(-5.0, 5.0)),
                default: Default::Required,
            },
            Field {
                key: "reference_c",
                doc: "Reference temperature (degrees C) at which nothing is added. It is aliased with system-gain: its fit \
                      absorbs any missing constant.",
                kind: Kind::Number(Range::closed(-60.0, 125.0)),
                default: Default::Number(20.0),
            },
        ],
    },
    about: About {
        mechanism: "As the electronics warm up, the transmitter's power falls and the receiver's noise rises, so a sunny \
                    afternoon weakens every outdoor link.",
        equation: "RSSI' = RSSI + db_per_c * (T - reference_c), T the mean of temperature_c at both ends",
        source: "K. Bannister, G. Giorgetti, S. K. S. Gupta, Wireless sensor networking for hot applications, HotEmNets 2008 (8 dB \
                 from 25 to 65 degrees C, CC2420); C. A. Boano et al., The impact of temperature on outdoor industrial \
                 sensornet applications, IEEE Trans. Industrial Informatics 6 (2010) 451.",
        validity: "Linear and the same for every node; temperatures are clipped to -60 to 125 degrees C. Without a known \
                   temperature nothing is added.",
        trace: "Linear in temperature, and therefore a slow daily cycle on all links alike.",
        needs: &[Need::Column("temperature_c"), Need::Readings],
        example: "db_per_c = -0.15\n",
    },
    fit: Fit {
        parameters: &[
            Parameter {
                key: "db_per_c",
                unit: "dB/degC",
                min: -5.0,
                max: 5.0,
                starts: &[-0.1],
                step: 0.005,
            },
            Parameter {
                key: "reference_c",
                unit: "degC",
                min: -60.0,
                max: 125.0,
                starts: &[20.0],
                step: 0.5,
            },
        ],
        variants: &[],
        level: Level::Time,
        generalises: &[],
        linear_in: Some("temperature_c"),
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table, _| {
        let effect: Temperature = typed(table);
        Some(Box::new(effect))
    },
};

/// Temperature of the electronics.
///
/// # Model
///
/// ```text
/// RSSI' = RSSI + a (T − T0),   T = (T_tx + T_rx)/2
/// ```
///
/// Linear, as measured by Bannister et al. (HotEmNets 2008) and Boano et al. (2010). T is the covariate `temperature_c`: of
/// the agents at both ends in a run, of the row (or its columns `tx_temperature_c`, `rx_temperature_c`) in measurements.
///
/// # Validity
///
/// −60 to 125 °C, the range of the parts; temperatures beyond count as these. Where only one end's temperature is known, it
/// serves for both; where none is, nothing is added.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub struct Temperature {
    /// What a degree adds (dB per °C).
    pub db_per_c: f64,
    /// Where nothing is added (°C).
    pub reference_c: f64,
}

/// Temperatures (°C) that electronics survive.
const COLDEST_C: f64 = -60.0;
const WARMEST_C: f64 = 125.0;

impl Effect for Temperature {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

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
    use crate::phy::effect::testing::along_x;
    use crate::phy::link::{Covariates, Scene};

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
