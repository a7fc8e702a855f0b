//! Everyone hears everyone.

use super::{
    AssignedRssi, Entry, Family, NOT_REPLAYED, Prediction, Propagation, Reach, Reading, Reception,
};
use crate::link::Link;
use proto::config::{Section, variant};

/// `propagation = "full"`.
pub const ENTRY: Entry = Entry {
    variant: variant::<Keys>("full"),
    family: Family::Connectivity,
    replay: NOT_REPLAYED,
    build: |table, context| {
        let keys = Keys::read(table);
        Some(Box::new(Full { rssi: AssignedRssi::new(context.radio, keys.reading.rssi_dbm) }))
    },
};

/// Full connectivity: every frame arrives.
#[derive(Section)]
struct Keys {
    #[key(flatten)]
    reading: Reading,
}

/// Every frame arrives, over any distance: the ideal radio.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Full {
    /// RSSI that is assigned to received frames (dBm).
    pub rssi: AssignedRssi,
}

impl Propagation for Full {
    fn predict(&self, link: &Link<'_>) -> Prediction {
        Prediction { rssi_dbm: self.rssi.dbm(link), reception: Reception::Stated(1.0) }
    }

    fn reach(&self, _: f64, _: f64) -> Reach {
        Reach::Unlimited
    }

    fn is_isotropic(&self) -> bool {
        true
    }

    fn is_certain(&self) -> bool {
        true
    }
}
