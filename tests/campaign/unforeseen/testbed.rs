//! A testbed of fixed nodes, for which the model is optimistic: the level is lower, the path loss exponent larger, and links are
//! shadowed.

use super::air::{Air, layout, n_rows};
use super::answer::{Answer, Claim};
use super::{Case, Expected};
use crate::campaign::draws::Draws;
use crate::campaign::world::{Base, Layout, Row};
use crate::statistics::median;
use std::collections::BTreeMap;

/// Random effects of a testbed.
const RANDOM: [&str; 2] = ["shadowing", "node-offset"];

/// What the model lacks.
struct Bench {
    /// Mean error of the model (dB).
    level_db: f64,
    exponent: f64,
    shadowing_db: f64,
    offsets_db: f64,
}

impl Bench {
    fn new(draws: &mut Draws) -> Self {
        Self {
            level_db: -draws.between(10.0, 20.0),
            exponent: draws.between(2.8, 3.8),
            shadowing_db: draws.between(4.0, 8.0),
            offsets_db: draws.between(1.0, 3.0),
        }
    }
}

/// 8 to 12 fixed nodes: about 45 pairs.
fn place(seed: u64) -> Layout {
    let n_fixed = 8 + Draws::new(seed, "nodes").below(5);
    Layout { n_fixed, n_moving: 0, base: Base::Friis, n_walls: 0, ..layout(seed, 1.0) }
}

fn air(seed: u64) -> Air {
    let mut air = Air::new(seed, &place(seed), n_rows(seed, 3000, 5000));
    let mut draws = Draws::new(seed, "testbed");
    let bench = Bench::new(&mut draws);
    let distances: Vec<f64> = air.world.rows.iter().map(Row::distance_m).collect();
    let middle_m = median(&distances);
    air.add(|_, row| {
        bench.level_db - 10.0 * (bench.exponent - 2.0) * (row.distance_m() / middle_m).log10()
    });
    let n_nodes = air.world.n_nodes;
    let links = links(&mut draws, n_nodes);
    air.add(|_, row| bench.shadowing_db * links[&link(row)]);
    let offsets: Vec<[f64; 2]> = (0..n_nodes).map(|_| [draws.normal(), draws.normal()]).collect();
    air.add(|_, row| bench.offsets_db * (offsets[row.tx][0] + offsets[row.rx][1]));
    air
}

/// The unordered pair of a row: the lower node number first.
pub(super) fn link(row: &Row) -> (usize, usize) {
    (row.tx.min(row.rx), row.tx.max(row.rx))
}

/// A standard normal draw per pair of nodes.
pub(super) fn links(draws: &mut Draws, n_nodes: usize) -> BTreeMap<(usize, usize), f64> {
    let pairs = (0..n_nodes).flat_map(|low| (low + 1..n_nodes).map(move |high| (low, high)));
    pairs.map(|pair| (pair, draws.normal())).collect()
}

/// Honest: the level or the exponent. Random effects may be named beside them, not instead.
pub(super) fn case(seed: u64) -> Case {
    let air = air(seed);
    let sent = air.send();
    let level = Claim { effects: vec!["system-gain", "path-loss-exponent"], ..Claim::default() };
    // Structure over the distance is true where the exponent is not named.
    let verdicts = vec!["missing-effects", "unexplained-structure"];
    let answer = Answer { verdicts, ..Answer::of(vec![level]) }
        .permitting(&["system-gain", "path-loss-exponent"])
        .permitting(&RANDOM)
        .with_structure(&["distance_m", "log10_distance", "transmitter", "receiver"])
        .with_error(air.error_over_noise(&sent));
    Case { csv: air.csv(&sent), config_toml: air.config(&sent), expected: Expected::Answer(answer) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::{deviation, mean};

    #[test]
    fn the_model_is_optimistic_by_the_level_drawn() {
        for seed in 0..5 {
            let air = air(seed);
            let bench = Bench::new(&mut Draws::new(seed, "testbed"));
            let errors: Vec<f64> = air
                .level_db
                .iter()
                .zip(&air.model_db)
                .map(|(truth, model)| truth - model)
                .collect();
            // Some 45 links at up to 8 dB, 8 nodes at up to 3 dB in two directions, and the mean distance against the median:
            // a standard error of at most 2.5 dB.
            assert!((mean(&errors) - bench.level_db).abs() < 10.0, "{}", mean(&errors));
            let sent = air.send();
            assert!(3.0 < air.error_over_noise(&sent), "{}", air.error_over_noise(&sent));
            assert!((28..=66).contains(&links(&mut Draws::new(1, "l"), air.world.n_nodes).len()));
            assert!(!air.config(&sent).contains("wall"));
        }
    }

    #[test]
    fn shadowing_is_one_draw_per_link_and_direction_does_not_matter() {
        let values: Vec<f64> = links(&mut Draws::new(2, "links"), 100).into_values().collect();
        assert_eq!(values.len(), 4950);
        assert!(mean(&values).abs() < 0.06 && (deviation(&values) - 1.0).abs() < 0.04);
        let air = air(1);
        let mut seen = BTreeMap::new();
        for (row, level_db) in air.world.rows.iter().zip(&air.level_db) {
            // A link has one level per direction and channel.
            let key = (row.tx, row.rx, row.channel);
            let before = *seen.entry(key).or_insert(*level_db);
            assert!((before - level_db).abs() < 1e-9);
        }
    }
}
