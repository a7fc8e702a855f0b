//! Everyone within a radius.

use super::friis::within;
use super::{
    AssignedRssi, Entry, Family, NOT_REPLAYED, Prediction, Propagation, Reach, Reading, Reception,
};
use crate::link::Link;
use proto::config::{Range, Section, variant};

/// `propagation = "unit-disk"`.
pub const ENTRY: Entry = Entry {
    variant: variant::<Keys>("unit-disk"),
    family: Family::Connectivity,
    replay: NOT_REPLAYED,
    build: |table, context| {
        let keys = Keys::read(table);
        let rssi = AssignedRssi::new(context.radio, keys.reading.rssi_dbm);
        Some(Box::new(UnitDisk { radius_m: keys.radius_m, rssi }))
    },
};

/// Unit disk: every frame arrives within the radius, and none beyond.
#[derive(Section)]
struct Keys {
    /// The radius (m), itself included. BotNet uses 3 without and 10 with its network.
    #[key(range = Range::LENGTH)]
    radius_m: f64,
    #[key(flatten)]
    reading: Reading,
}

/// The unit disk of the literature, closed: reception is certain where d ≤ radius, impossible elsewhere.
///
/// # Validity
///
/// An abstraction. Distances below `min_distance_m` count as that: a smaller radius reaches nobody.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitDisk {
    /// The radius (m).
    pub radius_m: f64,
    /// RSSI that is assigned to received frames (dBm).
    pub rssi: AssignedRssi,
}

impl Propagation for UnitDisk {
    fn predict(&self, link: &Link<'_>) -> Prediction {
        let inside = link.distance_m <= self.radius_m;
        Prediction {
            rssi_dbm: self.rssi.dbm(link),
            reception: Reception::Stated(if inside { 1.0 } else { 0.0 }),
        }
    }

    fn reach(&self, _: f64, _: f64) -> Reach {
        within(self.radius_m)
    }

    fn is_isotropic(&self) -> bool {
        true
    }
}
