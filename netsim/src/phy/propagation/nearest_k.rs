//! The k nearest.

use super::{
    AssignedRssi, Entry, Family, NOT_REPLAYED, Prediction, Propagation, RSSI_FIELD, Reach,
    Reception,
};
use crate::phy::link::{Link, Scene};
use crate::phy::nearest::Nearest;
use proto::config::{Default, Field, Kind, Variant, typed};
use serde::Deserialize;

/// `propagation = "nearest-k"`.
pub const ENTRY: Entry = Entry {
    variant: Variant {
        name: "nearest-k",
        doc: "Every robot receives from its k nearest robots only.",
        fields: &[
            Field {
                key: "k",
                doc: "How many.",
                kind: Kind::Integer { min: 0, max: 1_000_000 },
                default: Default::Required,
            },
            RSSI_FIELD,
        ],
    },
    family: Family::Connectivity,
    replay: NOT_REPLAYED,
    build: |table, context| {
        let keys: Keys = typed(table);
        let rssi = AssignedRssi::new(context.radio, keys.rssi_dbm);
        Some(Box::new(NearestK { k: keys.k, rssi }))
    },
};

#[derive(Deserialize)]
struct Keys {
    k: usize,
    rssi_dbm: Option<f64>,
}

/// The topological neighbourhood of the swarm literature: the receiver hears the k radios nearest to it, whether they
/// have something to say or not. Of two equally far ones the lower number is nearer. Not symmetric.
///
/// # Validity
///
/// An abstraction: no radio counts its neighbours. Needs to know where all radios are; where it does not (a row of
/// measurements), it says that nothing arrives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestK {
    /// Number of nearest neighbours that receive each frame.
    pub k: usize,
    /// RSSI that is assigned to received frames (dBm).
    pub rssi: AssignedRssi,
}

impl Propagation for NearestK {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn predict(&self, link: &Link<'_>) -> Prediction {
        let nearest = link.scene.nearest.as_ref();
        let among = nearest.and_then(|nearest| nearest.is_among(&link.receiver, &link.sender));
        Prediction {
            rssi_dbm: self.rssi.dbm(link),
            reception: Reception::Stated(if among == Some(true) { 1.0 } else { 0.0 }),
        }
    }

    fn reach(&self, _: f64, _: f64) -> Reach {
        Reach::Listed
    }

    fn prepare(&self, scene: &mut Scene<'_>) {
        scene.nearest = Some(Nearest::find(scene.agents, self.k));
    }
}
