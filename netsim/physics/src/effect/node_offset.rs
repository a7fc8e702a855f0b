//! No two nodes are alike.

use super::{Effect, Entry};
use crate::link::Link;
use crate::scatter::{Law, Renewal, Scatter};
use proto::config::{Kind, Problem, Range, Section};
use proto::effect::{Catalogued, Level, Need, Role};
use proto::rng::Purpose;

const VALUES: Kind =
    Kind::List { of: &Kind::Number(Range::closed(-60.0, 60.0)), min: 1, max: 1_000_000 };

/// `kind = "node-offset"`.
pub const ENTRY: Entry = Entry::new::<NodeOffset>(
    |table, path, problems| {
        let keys = NodeOffset::read(table);
        for (end, sd_db) in [("tx", keys.tx_sd_db), ("rx", keys.rx_sd_db)] {
            if table.contains_key(&format!("{end}_db")) && 0.0 < sd_db {
                let message = format!("must be absent if {end}_db lists the values");
                problems.push(Problem::new(format!("{path}.{end}_sd_db"), message));
            }
        }
    },
    |table, ordinal| Some(Box::new(NodeOffset { ordinal, ..NodeOffset::read(table) })),
);

/// Per-node offsets of transmit power and receiver gain.
///
/// # Mechanism
///
/// Amplifiers, matching and antennas vary between units, so two nodes at the same place differ by a few decibels in both
/// directions. Transmission and reception use different components, so both offsets are independent.
///
/// # Equation
///
/// ```text
/// RSSI' = RSSI + a_tx + b_rx, a ~ N(0, tx_sd_db^2) and b ~ N(0, rx_sd_db^2) per node
/// ```
///
/// # Source
///
/// M. Zuniga, B. Krishnamachari, An analysis of unreliability and asymmetry in low-power wireless links, ACM Trans. Sensor Networks
/// 3 (2007) 7 (hardware variance); Chen and Terzis, EWSN 2010.
///
/// # Validity
///
/// Constant in time and the same in all directions. Clipped at 5 sd. The mean over all nodes is aliased with system-gain.
///
/// # Trace
///
/// All links of a node are biased alike, separately for sent and received frames, so links are asymmetric.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "node-offset",
    needs = &[Need::Readings],
    example = "tx_sd_db = 1.5\nrx_sd_db = 1.0\n",
    level = Level::Random,
    generalises = &["antenna-pattern", "battery-sag"],
    role = Role::RandomPerNode,
)]
pub struct NodeOffset {
    /// Standard deviation between transmitters (dB).
    #[key(range = 0.0..=20.0, default = 0.0)]
    #[fit(unit = "dB", starts = [1.5], step = 0.05)]
    pub tx_sd_db: f64,
    /// Standard deviation between receivers (dB).
    #[key(range = 0.0..=20.0, default = 0.0)]
    #[fit(unit = "dB", starts = [1.5], step = 0.05)]
    pub rx_sd_db: f64,
    /// Offset of each transmitter (dB), by node number, instead of values drawn with tx_sd_db. Nodes beyond the list have no
    /// offset.
    #[key(kind = VALUES)]
    pub tx_db: Vec<f64>,
    /// As tx_db, for receivers.
    #[key(kind = VALUES)]
    pub rx_db: Vec<f64>,
    /// Tells several such effects apart.
    #[key(skip)]
    pub ordinal: u32,
}

fn offset_db(values_db: &[f64], node: u32) -> f64 {
    values_db.get(node as usize).copied().unwrap_or(0.0)
}

fn most(values_db: &[f64]) -> f64 {
    values_db.iter().copied().fold(0.0, f64::max)
}

impl Effect for NodeOffset {
    fn contribution_db(&self, link: &Link<'_>) -> f64 {
        offset_db(&self.tx_db, link.sender.id.0) + offset_db(&self.rx_db, link.receiver.id.0)
    }

    fn max_gain_db(&self) -> f64 {
        most(&self.tx_db) + most(&self.rx_db)
    }

    fn scatter(&self) -> Option<Scatter> {
        (self.tx_sd_db != 0.0 || self.rx_sd_db != 0.0).then_some(Scatter {
            law: Law::Nodes { tx_sd_db: self.tx_sd_db, rx_sd_db: self.rx_sd_db },
            renewal: Renewal::Frozen,
            purpose: Purpose::NodeOffset,
            ordinal: self.ordinal,
            directed: true,
        })
    }

    fn is_isotropic(&self) -> bool {
        self.tx_db.is_empty() && self.rx_db.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use crate::effect::testing::{along_x, made, problems};
    use crate::link::Scene;
    use crate::scatter::{Moment, PairBlock};
    use proto::ids::MoteId;

    #[test]
    fn stated_values_are_those_of_sender_and_receiver() {
        let scene = Scene::default();
        let effect = made("node-offset", "tx_db = [1.5, 40.0]\nrx_db = [50.0, -4.0]");
        // The link is from node 0 to node 1.
        assert_eq!(effect.contribution_db(&along_x(5.0, 1.0, None, &scene)), -2.5);
        assert_eq!(made("node-offset", "tx_db = [1.5]").max_gain_db(), 1.5);
        let both = problems("node-offset", "tx_db = [1.5]\ntx_sd_db = 1.0");
        assert!(both.contains("tx_sd_db: must be absent"), "{both}");
    }

    #[test]
    fn drawn_values_belong_to_nodes_and_have_their_variances() {
        let scatter = made("node-offset", "tx_sd_db = 3.0\nrx_sd_db = 4.0").scatter().unwrap();
        let at = Moment { period_ns: 0, sent_ns: 0, way_m: 0.0, channel: None };
        let value = |a, b| scatter.value_db(&mut PairBlock::new(7, a, b, 0), a, b, at);
        // What nodes share cancels: a rectangle of links sums to nothing.
        let rectangle =
            value(MoteId(0), MoteId(1)) - value(MoteId(0), MoteId(2)) - value(MoteId(3), MoteId(1))
                + value(MoteId(3), MoteId(2));
        assert!(
            rectangle.abs() < 1e-12 && value(MoteId(0), MoteId(1)) != value(MoteId(1), MoteId(0))
        );
        // 20,000 disjoint links: the variance, 25, has a standard error of 0.25. Beyond 4.5 of them: one seed in 150,000.
        let n = 20_000;
        let squares: f64 = (0..n).map(|i| value(MoteId(2 * i), MoteId(2 * i + 1)).powi(2)).sum();
        assert!((squares / f64::from(n) - 25.0).abs() < 1.13, "{}", squares / f64::from(n));
    }
}
