//! Everyone hears everyone.

use super::{AssignedRssi, Entry, Prediction, Propagation, RSSI_FIELD, Reach, Reception};
use crate::phy::link::Link;
use proto::config::Variant;

/// `propagation = "full"`.
pub const ENTRY: Entry = Entry {
    variant: Variant { name: "full", doc: "Every frame arrives.", fields: &[RSSI_FIELD] },
    build: |table, context| {
        let constant = table.get(RSSI_FIELD.key).and_then(toml::Value::as_float);
        Some(Box::new(Full { rssi: AssignedRssi::new(context.radio, constant) }))
    },
};

/// Every frame arrives, over any distance: the ideal radio.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Full {
    /// What frames read.
    pub rssi: AssignedRssi,
}

impl Propagation for Full {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

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
