//! Batteries that run down.

use super::{Effect, Entry, UNCHECKED};
use crate::phy::link::Link;
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Level, Need, Parameter, Search};
use serde::Deserialize;

/// `kind = "battery-sag"`.
pub const ENTRY: Entry = Entry {
    variant: Variant {
        name: "battery-sag",
        doc: "The transmit power of battery-powered nodes falls over time.",
        fields: &[
            Field {
                key: "db_per_hour",
                doc: "Change of the transmit power per hour (dB per hour): negative.",
                kind: Kind::Number(Range::closed(-100.0, 0.0)),
                default: Default::Required,
            },
            Field {
                key: "nodes",
                doc: "Numbers of the battery-powered nodes. Absent: all.",
                kind: Kind::List {
                    of: &Kind::Integer { min: 0, max: u32::MAX as i64 },
                    min: 1,
                    max: 1_000_000,
                },
                default: Default::Absent,
            },
        ],
    },
    about: About {
        mechanism: "The voltage of a battery falls as it discharges, and with it the power of an unregulated amplifier.",
        equation: "RSSI' = RSSI + db_per_hour * t for frames of the named nodes, t in hours since time 0",
        source: "First-order model of the discharge. CC2420 data sheet, § 6: output power over supply voltage.",
        validity: "Linear in time from time 0, and the same for all named nodes. Real batteries have a plateau followed by \
                   a steep fall.",
        trace: "A drift over time of some transmitters, at all receivers.",
        needs: &[Need::Time, Need::Readings],
        example: "db_per_hour = -0.5\nnodes = [0, 3]\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "db_per_hour",
            unit: "dB/h",
            min: -100.0,
            max: 0.0,
            starts: &[-0.5],
            step: 0.01,
        }],
        variants: &[],
        level: Level::Time,
        generalises: &[],
        linear_in: Some("time_s"),
        search: Search::Nodes,
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table, _| {
        let keys: Keys = typed(table);
        let nodes = keys.nodes.map(|mut nodes| {
            nodes.sort_unstable();
            nodes
        });
        Some(Box::new(BatterySag { db_per_hour: keys.db_per_hour, nodes }))
    },
};

#[derive(Deserialize)]
struct Keys {
    db_per_hour: f64,
    nodes: Option<Vec<u32>>,
}

/// A transmit power that falls.
///
/// # Model
///
/// RSSI′ = RSSI + a t for the frames of some transmitters, t the hours since time 0.
///
/// # Validity
///
/// Linear, as any discharge is over a short time. A search over measurements finds the nodes itself.
#[derive(Clone, Debug, PartialEq)]
pub struct BatterySag {
    /// What an hour adds (dB).
    pub db_per_hour: f64,
    /// Whose power falls, ascending; none: everyone's.
    pub nodes: Option<Vec<u32>>,
}

impl Effect for BatterySag {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn contribution_db(&self, link: &Link<'_>) -> f64 {
        let sags =
            self.nodes.as_ref().is_none_or(|nodes| nodes.binary_search(&link.sender.id).is_ok());
        if sags { self.db_per_hour * (link.time_ns as f64 / 3.6e12) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phy::effect::testing::along_x;
    use crate::phy::link::{Link, Scene};

    #[test]
    fn half_a_decibel_an_hour_is_one_after_two_and_only_for_those_that_send() {
        let scene = Scene::default();
        let link = Link { time_ns: 7_200_000_000_000, ..along_x(10.0, 1.0, None, &scene) };
        let contribution_db = |nodes: Option<Vec<u32>>| {
            BatterySag { db_per_hour: -0.5, nodes }.contribution_db(&link)
        };
        // The link is from node 0 to node 1.
        assert_eq!(contribution_db(None), -1.0);
        assert_eq!(contribution_db(Some(vec![0, 7])), -1.0);
        assert_eq!(contribution_db(Some(vec![1])), 0.0);
    }
}
