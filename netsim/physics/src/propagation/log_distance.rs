//! Path loss with an exponent.

use super::friis::{friis_dbm, within};
use super::{
    Entry, Family, NOT_REPLAYED, PathLoss, Prediction, Propagation, Radio, Reach, Reception,
};
use crate::link::Link;
use proto::config::{Section, variant};

/// `propagation = "log-distance"`.
pub const ENTRY: Entry = Entry {
    variant: variant::<LogDistance>("log-distance"),
    family: Family::Signal,
    replay: NOT_REPLAYED,
    build: |table, context| {
        Some(Box::new(LogDistance { radio: context.radio, ..LogDistance::read(table) }))
    },
};

/// Log-distance path loss: free space up to a reference distance, and another exponent beyond.
///
/// Log-distance path loss (Rappaport, *Wireless Communications*, 2nd ed., § 4.9.1).
///
/// # Model
///
/// ```text
/// P_rx = Friis(d)                        d ≤ d0
/// P_rx = Friis(d0) − 10 n log10(d / d0)  d > d0
/// ```
///
/// # Validity
///
/// A mean over places: add `shadowing` for what varies between them.
#[derive(Clone, Copy, Debug, PartialEq, Section)]
pub struct LogDistance {
    /// Path loss exponent n: 2 is free space, 3 to 4 indoors with obstacles.
    #[key(range = 1.0..=8.0)]
    pub exponent: f64,
    /// Reference distance, up to which free space applies (m).
    #[key(above = 0.0, most = 1e4, default = 1.0)]
    pub reference_distance_m: f64,
    /// Settings of the radio: power, frequency, antenna gains.
    #[key(skip)]
    pub radio: Radio,
}

impl Propagation for LogDistance {
    fn predict(&self, link: &Link<'_>) -> Prediction {
        let d0 = self.reference_distance_m;
        let near_m = link.distance_m.min(d0);
        let mut rssi_dbm = friis_dbm(self.radio.total_dbm(), near_m, link.frequency_hz);
        if d0 < link.distance_m {
            rssi_dbm -= 10.0 * self.exponent * libm::log10(link.distance_m / d0);
        }
        Prediction { rssi_dbm, reception: Reception::ByCurve }
    }

    fn reach(&self, floor_dbm: f64, frequency_hz: f64) -> Reach {
        let d0 = self.reference_distance_m;
        let at_reference = friis_dbm(self.radio.total_dbm(), d0, frequency_hz);
        let left_db = at_reference - floor_dbm;
        // Below the floor at the reference distance already: it lies within.
        within(d0 * libm::pow(10.0, left_db.max(0.0) / (10.0 * self.exponent)))
    }

    fn is_isotropic(&self) -> bool {
        true
    }

    fn path_loss(&self) -> Option<PathLoss> {
        let Self { exponent, reference_distance_m, .. } = *self;
        Some(PathLoss { exponent, reference_distance_m })
    }
}
