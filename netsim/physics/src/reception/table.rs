//! The measured RSSI → PDR table.

use super::{Curve, Entry};
use proto::config::{Problem, Section, variant};

/// `kind = "table"`.
pub const ENTRY: Entry = Entry { variant: variant::<Keys>("table"), build };

/// A table of reception probability over RSSI, with linear interpolation.
#[derive(Section)]
struct Keys {
    /// Points \[RSSI in dBm, probability\], with ascending RSSI and non-decreasing probability; 0 below the first point, constant beyond
    /// the last. Absent: the table of the 6TiSCH simulator, -97 dBm: 0 to -79 dBm: 1, measured on SmartMesh IP (Dust) motes, both end
    /// points synthetic.
    #[key(length = 2..=10_000, range = -1000.0..=1000.0)]
    points: Option<Vec<[f64; 2]>>,
}

/// RSSI (dBm) and probability of reception of IEEE 802.15.4 frames, in steps of 1 dB from −97 to −79 dBm.
///
/// Measured on SmartMesh IP (Dust) motes and used by the 6TiSCH simulator (Municio et al. 2019, "Simulating 6TiSCH
/// networks"); the two end points are synthetic.
pub const DUST: [(f64, f64); 19] = [
    (-97.0, 0.0000),
    (-96.0, 0.1494),
    (-95.0, 0.2340),
    (-94.0, 0.4071),
    (-93.0, 0.6359),
    (-92.0, 0.6866),
    (-91.0, 0.7476),
    (-90.0, 0.8603),
    (-89.0, 0.8702),
    (-88.0, 0.9324),
    (-87.0, 0.9427),
    (-86.0, 0.9562),
    (-85.0, 0.9611),
    (-84.0, 0.9739),
    (-83.0, 0.9745),
    (-82.0, 0.9844),
    (-81.0, 0.9854),
    (-80.0, 0.9903),
    (-79.0, 1.0000),
];

/// A table of reception probability over RSSI.
///
/// # Model
///
/// Linear between neighbouring points; 0 below the first point, the last point's probability from there on.
///
/// # Validity
///
/// Averages over the receivers and the interference of one campaign. A single radio's own waterfall is steeper (about
/// 1 dB wide where this one is 18 dB wide), and lies elsewhere.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    points: Vec<(f64, f64)>,
}

impl Table {
    /// The table of the 6TiSCH simulator.
    #[must_use]
    pub fn dust() -> Self {
        Self { points: DUST.to_vec() }
    }
}

impl Curve for Table {
    fn reception_probability(&self, rssi_dbm: f64) -> f64 {
        let (last_dbm, last) = self.points[self.points.len() - 1];
        if last_dbm <= rssi_dbm {
            return last;
        }
        let above = self.points.partition_point(|&(rssi, _)| rssi <= rssi_dbm);
        if above == 0 {
            return 0.0;
        }
        let (x0, p0) = self.points[above - 1];
        match self.points.get(above) {
            Some(&(x1, p1)) => p0 + (p1 - p0) * ((rssi_dbm - x0) / (x1 - x0)),
            None => p0,
        }
    }

    fn floor_dbm(&self) -> f64 {
        self.points[0].0
    }

    fn ceiling_dbm(&self) -> f64 {
        self.points[self.points.len() - 1].0
    }
}

fn build(table: &toml::Table, path: &str, problems: &mut Vec<Problem>) -> Option<Box<dyn Curve>> {
    let Some(points) = Keys::read(table).points else { return Some(Box::new(Table::dust())) };
    let points: Vec<(f64, f64)> = points.into_iter().map(|[rssi, pdr]| (rssi, pdr)).collect();
    let before = problems.len();
    for (index, &(_, probability)) in points.iter().enumerate() {
        if !(0.0..=1.0).contains(&probability) {
            problems.push(
                Problem::new(
                    format!("{path}.points[{index}]"),
                    "must have a probability from 0 to 1",
                )
                .value(probability)
                .nearest(probability.clamp(0.0, 1.0)),
            );
        }
    }
    for (index, pair) in points.windows(2).enumerate() {
        let key = format!("{path}.points[{}]", index + 1);
        if pair[1].0 <= pair[0].0 {
            let message = format!("must have a greater RSSI than the point before, {}", pair[0].0);
            problems.push(Problem::new(&key, message).value(pair[1].0));
        }
        if pair[1].1 < pair[0].1 {
            let message = format!(
                "must have a probability of at least that of the point before, {}",
                pair[0].1
            );
            problems.push(Problem::new(key, message).value(pair[1].1).nearest(pair[0].1));
        }
    }
    (problems.len() == before).then(|| Box::new(Table::from(points)) as Box<dyn Curve>)
}

impl From<Vec<(f64, f64)>> for Table {
    fn from(points: Vec<(f64, f64)>) -> Self {
        assert!(2 <= points.len(), "a table has points");
        Self { points }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_6tisch_simulator_table_points_and_between() {
        let table = Table::dust();
        for (rssi_dbm, expected) in [
            (-1000.0, 0.0),
            (-97.5, 0.0),
            (-97.0, 0.0),
            (-96.5, 0.0747),
            (-96.0, 0.1494),
            (-94.5, 0.32055),
            (-93.6, 0.49862),
            (-93.5, 0.5215),
            (-92.25, 0.673925),
            (-90.0, 0.8603),
            (-89.5, 0.86525),
            (-85.5, 0.95865),
            (-80.5, 0.98785),
            (-79.5, 0.99515),
            (-79.0, 1.0),
            (-10.0, 1.0),
        ] {
            let got = table.reception_probability(rssi_dbm);
            // The vectors are exact in decimal: only rounding differs.
            assert!((got - expected).abs() < 1e-12, "{rssi_dbm} dBm: {got}, expected {expected}");
        }
    }
}
