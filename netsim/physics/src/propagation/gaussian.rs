//! The Gaussian well.

use super::friis::within;
use super::{
    AssignedRssi, Entry, Family, NOT_REPLAYED, Prediction, Propagation, Reach, Reading, Reception,
};
use crate::link::Link;
use proto::config::{Range, Section, variant};

/// `propagation = "gaussian"`.
pub const ENTRY: Entry = Entry {
    variant: variant::<Keys>("gaussian"),
    family: Family::Connectivity,
    replay: NOT_REPLAYED,
    build: |table, context| {
        let keys = Keys::read(table);
        let rssi = AssignedRssi::new(context.radio, keys.reading.rssi_dbm);
        Some(Box::new(Gaussian { sigma_m: keys.sigma_m, rssi }))
    },
};

/// A frame arrives with probability exp(-d^2 / (2 sigma^2)).
#[derive(Section)]
struct Keys {
    /// Width sigma (m): half of the frames arrive over 1.18 sigma.
    #[key(range = Range::LENGTH)]
    sigma_m: f64,
    #[key(flatten)]
    reading: Reading,
}

/// From this many widths on nothing arrives; the well has left 1.5 · 10⁻⁸ there.
const CUT_SIGMAS: f64 = 6.0;

/// The Gaussian well of the swarm literature.
///
/// # Model
///
/// ```text
/// PDR = exp(−d² / (2 σ²))  d ≤ 6 σ,  0 beyond
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// Width σ (m).
    pub sigma_m: f64,
    /// RSSI that is assigned to received frames (dBm).
    pub rssi: AssignedRssi,
}

impl Propagation for Gaussian {
    fn predict(&self, link: &Link<'_>) -> Prediction {
        let widths = link.distance_m / self.sigma_m;
        let pdr = if widths <= CUT_SIGMAS { libm::exp(-0.5 * widths * widths) } else { 0.0 };
        Prediction { rssi_dbm: self.rssi.dbm(link), reception: Reception::Stated(pdr) }
    }

    fn reach(&self, _: f64, _: f64) -> Reach {
        within(CUT_SIGMAS * self.sigma_m)
    }

    fn is_isotropic(&self) -> bool {
        true
    }
}
