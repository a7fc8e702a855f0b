//! The k nearest.

use super::{
    AssignedRssi, Entry, Family, NOT_REPLAYED, Prediction, Propagation, Reach, Reading, Reception,
};
use crate::link::{Link, Scene};
use crate::nearest::Nearest;
use proto::config::{Section, variant};

/// `propagation = "nearest-k"`.
pub const ENTRY: Entry = Entry {
    variant: variant::<Keys>("nearest-k"),
    family: Family::Connectivity,
    replay: NOT_REPLAYED,
    build: |table, context| {
        let keys = Keys::read(table);
        let rssi = AssignedRssi::new(context.radio, keys.reading.rssi_dbm);
        Some(Box::new(NearestK { k: keys.k, rssi }))
    },
};

/// Every robot receives from its k nearest robots only.
#[derive(Section)]
struct Keys {
    /// How many.
    #[key(range = 0..=1_000_000)]
    k: usize,
    #[key(flatten)]
    reading: Reading,
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
