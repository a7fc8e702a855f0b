//! Two nodes that hear each other: how much weaker one direction is than the other.

use crate::folds::Blocks;
use crate::links::LinkStudy;
use crate::links::fit::LinkFit;
use crate::thresholds::{FAMILY_ERROR, FEWEST_REPLICATES, TAIL_90};
use numbers::power::square;
use statrs::distribution::{ContinuousCDF as _, StudentsT};
use std::collections::BTreeMap;

/// The difference between both directions of the only pair of nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionsApart {
    /// Sender and receiver of the weaker direction.
    pub weaker: [u32; 2],
    /// How much weaker it is than the other (dB), with its 90 % interval.
    pub difference_db: f64,
    /// Lower end of the interval (dB).
    pub low_db: f64,
    /// Upper end of the interval (dB).
    pub high_db: f64,
}

impl LinkStudy {
    /// The difference between both directions that a fit leaves, where there are two nodes and the difference is significant: by its means in
    /// blocks of places or of time, whichever vary more.
    pub(in crate::links) fn two_directions(&self, fit: &LinkFit) -> Option<DirectionsApart> {
        let measured = &self.rows.links.rows;
        let first = measured.first()?;
        let (a, b) = (first.tx.min(first.rx), first.tx.max(first.rx));
        let is_pair = measured.iter().all(|row| (row.tx.min(row.rx), row.tx.max(row.rx)) == (a, b));
        if !is_pair || a == b {
            return None;
        }
        let errors_db = self.residuals(fit).deviation;
        let apart = |blocks: &Blocks| {
            let mut sums: BTreeMap<u32, [[f64; 2]; 2]> = BTreeMap::new();
            for ((row, error_db), block) in measured.iter().zip(&errors_db).zip(&blocks.of_row) {
                if error_db.is_finite() {
                    let sum = &mut sums.entry(*block).or_default()[usize::from(row.tx == a)];
                    *sum = [sum[0] + error_db, sum[1] + 1.0];
                }
            }
            let both = sums.into_values().filter(|ends| ends.iter().all(|end| 0.0 < end[1]));
            let apart: Vec<f64> =
                both.map(|[of_b, of_a]| of_a[0] / of_a[1] - of_b[0] / of_b[1]).collect();
            let n = apart.len() as f64;
            let mean = apart.iter().sum::<f64>() / n;
            let squares: f64 = apart.iter().map(|value| square(value - mean)).sum();
            let standard_error = (squares / (n * (n - 1.0))).sqrt();
            (FEWEST_REPLICATES <= apart.len()).then_some((mean, standard_error, n - 1.0))
        };
        let of_blocks = [&self.time, &self.place].map(apart);
        let widest = of_blocks.into_iter().flatten().max_by(|one, other| one.1.total_cmp(&other.1));
        let (mean_db, standard_error_db, freedom) = widest?;
        let law = StudentsT::new(0.0, 1.0, freedom).ok()?;
        if FAMILY_ERROR < 2.0 * law.sf(mean_db.abs() / standard_error_db) {
            return None;
        }
        let half_db = -law.inverse_cdf(TAIL_90) * standard_error_db;
        let difference_db = mean_db.abs();
        Some(DirectionsApart {
            weaker: if mean_db < 0.0 { [a, b] } else { [b, a] },
            difference_db,
            low_db: difference_db - half_db,
            high_db: difference_db + half_db,
        })
    }
}
