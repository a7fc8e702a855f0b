//! Batteries that run down.

use super::{Effect, Entry, UNCHECKED};
use crate::link::Link;
use proto::config::Section;
use proto::effect::{Catalogued, Need, Search};

/// `kind = "battery-sag"`.
pub const ENTRY: Entry = Entry::new::<BatterySag>(UNCHECKED, |table, _| {
    let mut effect = BatterySag::read(table);
    if let Some(nodes) = &mut effect.nodes {
        nodes.sort_unstable();
    }
    Some(Box::new(effect))
});

/// The transmit power of battery-powered nodes falls over time.
///
/// # Mechanism
///
/// The voltage of a battery falls as it discharges, and with it the power of an unregulated amplifier.
///
/// # Equation
///
/// ```text
/// RSSI' = RSSI + db_per_hour * t for frames of the named nodes, t in hours since time 0
/// ```
///
/// # Source
///
/// First-order model of the discharge. CC2420 data sheet, § 6: output power over supply voltage.
///
/// # Validity
///
/// Linear in time from time 0, and the same for all named nodes. Real batteries have a plateau followed by a steep fall.
///
/// # Trace
///
/// A drift over time of some transmitters, at all receivers.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "battery-sag",
    needs = &[Need::Time, Need::Readings],
    example = "db_per_hour = -0.5\nnodes = [0, 3]\n",
    linear_in = Some("time_s"),
    search = Search::Nodes,
)]
pub struct BatterySag {
    /// Change of the transmit power per hour (dB per hour): negative.
    #[key(range = -100.0..=0.0)]
    #[fit(
        unit = "dB/h",
        starts = [-0.5],
        step = 0.01,
        null = 0.0,
        plausible = -20.0..=0.0,
        source = "CC2650MODA data sheet, figure 5-11: power varies by a few dB over the whole range of the supply",
    )]
    pub db_per_hour: f64,
    /// Numbers of the battery-powered nodes. Absent: all.
    #[key(range = 0..=u32::MAX, length = 1..=1_000_000)]
    pub nodes: Option<Vec<u32>>,
}

impl Effect for BatterySag {
    fn contribution_db(&self, link: &Link<'_>) -> f64 {
        let sags =
            self.nodes.as_ref().is_none_or(|nodes| nodes.binary_search(&link.sender.id.0).is_ok());
        if sags { self.db_per_hour * (link.time_ns as f64 / 3.6e12) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::testing::along_x;
    use crate::link::{Link, Scene};

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
