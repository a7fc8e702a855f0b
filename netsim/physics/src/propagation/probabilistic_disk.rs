//! 40 dB below free space.

use super::friis::{friis_dbm, friis_reach};
use super::{Entry, Family, NOT_REPLAYED, Prediction, Propagation, Radio, Reach, Reception};
use crate::link::Link;
use proto::config::Variant;

/// `propagation = "probabilistic-disk"`.
pub const ENTRY: Entry = Entry {
    variant: Variant {
        name: "probabilistic-disk",
        doc: "Friis - 40 dB: the pessimistic bound of the BotNet paper.",
        fields: &[],
    },
    family: Family::Signal,
    replay: NOT_REPLAYED,
    build: |_, context| Some(Box::new(ProbabilisticDisk { radio: context.radio })),
};

/// How far (dB) the model lies below free space: the span of `experimental-randomness`.
const BELOW_FRIIS_DB: f64 = 40.0;

/// The lower bound of the BotNet paper (Selden et al., arXiv 2108.13606).
///
/// # Model
///
/// ```text
/// P_rx = Friis − 40 dB
/// ```
///
/// With the default table and 0 dBm at 2.4 GHz half of the frames arrive over 4.76 m, none beyond 7.04 m.
///
/// # Validity
///
/// A bound, not a description of any place: the lower end of the levels seen by Municio et al. (2019).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbabilisticDisk {
    /// Settings of the radio: power, frequency, antenna gains.
    pub radio: Radio,
}

impl Propagation for ProbabilisticDisk {
    fn predict(&self, link: &Link<'_>) -> Prediction {
        let friis_dbm = friis_dbm(self.radio.total_dbm(), link.distance_m, link.frequency_hz);
        Prediction { rssi_dbm: friis_dbm - BELOW_FRIIS_DB, reception: Reception::ByCurve }
    }

    fn reach(&self, floor_dbm: f64, frequency_hz: f64) -> Reach {
        friis_reach(self.radio.total_dbm(), floor_dbm + BELOW_FRIIS_DB, frequency_hz)
    }

    fn is_isotropic(&self) -> bool {
        true
    }
}
