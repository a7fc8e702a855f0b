//! Interference by the 6TiSCH simulator's table.

use super::{Entry, Noise, Rule, milliwatts};
use crate::reception::Curve;
use crate::reception::table::Table;
use proto::config::{Section, variant};

/// `kind = "table"`.
pub const ENTRY: Entry = Entry {
    variant: variant::<Keys>("table"),
    build: |table| Some(Box::new(ByTable::new(Keys::read(table).noise.noise_floor_dbm))),
};

/// As in the 6TiSCH simulator: the signal-to-interference-and-noise ratio is converted to the RSSI with the same ratio over noise
/// alone, which is looked up in the simulator's table. All frames arrive from 26 dB, and none below 7.25 dB.
#[derive(Section)]
struct Keys {
    #[key(flatten)]
    noise: Noise,
}

/// Interference by the 6TiSCH simulator's table.
///
/// # Model
///
/// In mW, with P the power that is received, noise N within it:
///
/// ```text
/// S = P − N,  I = Σ max(P_i − N, 0),  SINR = 10 log10(S / (I + N)) dB
/// equivalent RSSI = 10 log10(10^((SINR + N_dBm)/10) + 10^(N_dBm/10)) dBm
/// PDR_I = table(equivalent RSSI)
/// ```
///
/// Municio et al., "Simulating 6TiSCH networks" (2019). The simulator multiplies the PDR of the link by PDR_I, which itself
/// contains noise. Here the factor is PDR_I with interference over PDR_I without, so that noise counts once; over part of
/// a frame it is that to the power of the part.
///
/// # Validity
///
/// As that of the table, see [`Table`]: an average over receivers, much wider than the waterfall of a radio. A receiver
/// never turns to a stronger frame, as in the simulator. There frames do not differ in time by more than their order.
#[derive(Clone, Debug, PartialEq)]
pub struct ByTable {
    noise_dbm: f64,
    noise_mw: f64,
    table: Table,
}

/// What the simulator makes of a frame under interference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disturbed {
    /// Ratio of signal to interference and noise (dB).
    pub sinr_db: f64,
    /// RSSI (dBm) that has this ratio over noise alone.
    pub equivalent_rssi_dbm: f64,
    /// The table at that RSSI.
    pub pdr: f64,
}

impl ByTable {
    /// Interference over this noise (dBm).
    #[must_use]
    pub fn new(noise_floor_dbm: f64) -> Self {
        let noise_mw = milliwatts(noise_floor_dbm);
        Self { noise_dbm: noise_floor_dbm, noise_mw, table: Table::dust() }
    }

    /// A frame under interference (mW, as [`Rule::disturbance_mw`] adds up to). `None`: weaker than noise, never received.
    #[must_use]
    pub fn disturbed(&self, signal_dbm: f64, interference_mw: f64) -> Option<Disturbed> {
        let signal_mw = milliwatts(signal_dbm) - self.noise_mw;
        if signal_mw < 0.0 {
            return None;
        }
        let sinr_db = 10.0 * libm::log10(signal_mw / (interference_mw + self.noise_mw));
        let equivalent_mw = milliwatts(sinr_db + self.noise_dbm) + self.noise_mw;
        let equivalent_rssi_dbm = 10.0 * libm::log10(equivalent_mw);
        let pdr = self.table.reception_probability(equivalent_rssi_dbm);
        Some(Disturbed { sinr_db, equivalent_rssi_dbm, pdr })
    }
}

impl Rule for ByTable {
    fn disturbance_mw(&self, rssi_dbm: f64) -> f64 {
        (milliwatts(rssi_dbm) - self.noise_mw).max(0.0)
    }

    fn survival(
        &self,
        signal_dbm: f64,
        interference_mw: f64,
        stretch_ns: i64,
        frame_ns: i64,
    ) -> f64 {
        if interference_mw == 0.0 {
            return 1.0;
        }
        let pdr = |interference_mw: f64| {
            self.disturbed(signal_dbm, interference_mw).map_or(0.0, |disturbed| disturbed.pdr)
        };
        let (with, without) = (pdr(interference_mw), pdr(0.0));
        if with == 0.0 {
            return 0.0;
        }
        let factor = (with / without).min(1.0);
        if stretch_ns == frame_ns {
            factor
        } else {
            libm::pow(factor, stretch_ns as f64 / frame_ns as f64)
        }
    }

    fn capture_db(&self) -> f64 {
        f64::INFINITY
    }

    fn hides_preambles(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Signal (dBm), interferers (dBm), then SINR (dB), equivalent RSSI (dBm) and PDR.
    type Row = (f64, &'static [f64], f64, f64, f64);

    const ROWS: &[Row] = &[
        (-60.0, &[-60.0], -0.0001, -101.9898, 0.0),
        (-60.0, &[-65.0], 4.9999, -98.8068, 0.0),
        (-60.0, &[-67.0], 6.9999, -97.2100, 0.0),
        (-60.0, &[-68.0], 7.9999, -96.3612, 0.0954),
        (-60.0, &[-69.0], 8.9999, -95.4852, 0.1930),
        (-60.0, &[-70.0], 9.9999, -94.5862, 0.3056),
        (-60.0, &[-71.0], 10.9999, -93.6682, 0.4830),
        (-60.0, &[-72.0], 11.9999, -92.7344, 0.6494),
        (-60.0, &[-75.0], 14.9999, -89.8649, 0.8616),
        (-60.0, &[-80.0], 19.9999, -84.9569, 0.9617),
        (-60.0, &[-85.0], 24.9999, -79.9864, 0.9904),
        (-60.0, &[-86.0], 25.9999, -78.9892, 1.0),
        (-60.0, &[-70.0, -70.0], 6.9902, -97.2180, 0.0),
        (-60.0, &[-72.0, -72.0, -72.0], 7.2301, -97.0172, 0.0),
        (-80.0, &[-90.0], 9.9862, -94.5986, 0.3035),
        (-79.0, &[-97.0], 17.9891, -86.9425, 0.9435),
        (-95.0, &[], 9.5424, -95.0, 0.2340),
        (-90.0, &[-110.0], 14.8604, -90.0, 0.8603),
        (-104.0, &[], -5.8683, -104.0, 0.0),
        (-10.0, &[-1000.0], 95.0, -10.0, 1.0),
    ];

    fn sum_mw(rule: &ByTable, interferers_dbm: &[f64]) -> f64 {
        interferers_dbm.iter().map(|&dbm| rule.disturbance_mw(dbm)).sum()
    }

    #[test]
    fn sinr_rows_of_the_simulator() {
        let rule = ByTable::new(-105.0);
        for &(signal_dbm, interferers_dbm, sinr_db, rssi_dbm, pdr) in ROWS {
            let got = rule.disturbed(signal_dbm, sum_mw(&rule, interferers_dbm)).unwrap();
            // Four digits are given.
            let close = |got: f64, expected: f64| (got - expected).abs() < 0.5001e-4;
            assert!(close(got.sinr_db, sinr_db), "{signal_dbm} {interferers_dbm:?}: {got:?}");
            assert!(close(got.equivalent_rssi_dbm, rssi_dbm), "{signal_dbm}: {got:?}");
            assert!(close(got.pdr, pdr), "{signal_dbm} {interferers_dbm:?}: {got:?}");
        }
        assert_eq!(rule.disturbed(-106.0, 0.0), None, "never received");
    }

    #[test]
    fn sinr_needs_7_25_db_for_any_and_25_99_db_for_all() {
        let rule = ByTable::new(-105.0);
        let survival = |sinr_db: f64| rule.survival(-40.0, milliwatts(-40.0 - sinr_db), 1, 1);
        assert_eq!(survival(7.24), 0.0);
        assert!(0.0 < survival(7.26));
        assert!(survival(25.98) < 1.0);
        assert_eq!(survival(26.0), 1.0);
    }

    #[test]
    fn sinr_noise_counts_once() {
        // The link's own PDR is the table at its RSSI; times the factor, that is the simulator's PDR under interference.
        let rule = ByTable::new(-105.0);
        for &(signal_dbm, interferers_dbm, ..) in ROWS {
            let interference_mw = sum_mw(&rule, interferers_dbm);
            let link = rule.table.reception_probability(signal_dbm);
            let got = link * rule.survival(signal_dbm, interference_mw, 1, 1);
            let expected = rule.disturbed(signal_dbm, interference_mw).unwrap().pdr;
            assert!((got - expected).abs() < 1e-12, "{signal_dbm} {interferers_dbm:?}");
        }
    }
}
