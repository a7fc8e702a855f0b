//! One node that moves among anchors for a few minutes. The blocks of time are few, and the level is far off.

use super::air::{Air, layout};
use super::answer::{Answer, Claim};
use super::{Case, Expected};
use crate::campaign::draws::Draws;
use crate::campaign::field::{Kernel, pair_field};
use crate::campaign::world::{Base, Layout, World, rounded};

/// The constant that the model lacks (dB).
fn bias_db(seed: u64) -> f64 {
    let mut draws = Draws::new(seed, "bias");
    let size_db = draws.between(17.0, 50.0);
    if draws.chance(0.7) { -size_db } else { size_db }
}

fn place(seed: u64) -> Layout {
    let mut draws = Draws::new(seed, "anchors");
    Layout {
        n_fixed: 5 + draws.below(8),
        n_moving: 1,
        extent_m: [rounded(draws.between(14.0, 40.0), 0), rounded(draws.between(12.0, 25.0), 0)],
        duration_s: draws.between(300.0, 900.0).round(),
        base: Base::Friis,
        n_walls: 0,
        ..layout(seed, draws.between(0.5, 1.0))
    }
}

fn air(seed: u64) -> Air {
    let place = place(seed);
    let mut draws = Draws::new(seed, "moving node");
    // Half of the campaigns have the moving node as their only sender, the others as their only receiver.
    let is_sender = draws.chance(0.5);
    let n_rows = 1000 + draws.below(2001);
    let mobile = place.n_fixed;
    // Of the rows of all nodes, one in so many is of the moving node.
    let mut world = World::new(seed, &place, &[], (mobile + 1) * n_rows);
    world.rows.retain(|row| if is_sender { row.tx == mobile } else { row.rx == mobile });
    let kernel = Kernel::Place {
        variance: draws.between(1.0, 3.0).powi(2),
        decorrelation_m: draws.between(1.0, 3.0),
    };
    let shadowing_db = pair_field(&world, kernel, &mut draws);
    let offsets_db: Vec<f64> = (0..world.n_nodes).map(|_| 1.5 * draws.normal()).collect();
    let mut air = Air::of(seed, &place, world);
    let bias_db = bias_db(seed);
    air.add(|index, row| bias_db + shadowing_db[index] + offsets_db[row.tx.min(row.rx)]);
    air
}

/// Honest: the level, judged on blocks of time or, where these are too few, on places. Random effects may be named beside it.
pub(super) fn case(seed: u64) -> Case {
    let air = air(seed);
    let sent = air.send();
    let answer = Answer::of(vec![Claim::of("system-gain")])
        .permitting(&["shadowing", "node-offset", "multipath", "link-drift"])
        .with_structure(&["transmitter", "receiver"])
        .with_error(air.error_over_noise(&sent));
    Case { csv: air.csv(&sent), config_toml: air.config(&sent), expected: Expected::Answer(answer) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::{deviation, mean};
    use std::collections::BTreeSet;

    #[test]
    fn one_node_moves_and_the_level_is_off() {
        let mut n_senders = BTreeSet::new();
        for seed in 0..8 {
            let air = air(seed);
            let rows = &air.world.rows;
            let errors: Vec<f64> = air
                .level_db
                .iter()
                .zip(&air.model_db)
                .map(|(truth, model)| truth - model)
                .collect();
            let bias_db = bias_db(seed);
            assert!((17.0..=50.0).contains(&bias_db.abs()));
            // Anchors differ by 1.5 dB, of which there are at least five; shadowing is up to 3 dB.
            assert!((mean(&errors) - bias_db).abs() < 4.0, "{} {bias_db}", mean(&errors));
            assert!((1.0..5.5).contains(&deviation(&errors)), "{}", deviation(&errors));
            let mobile = air.world.n_fixed;
            assert!(rows.iter().all(|row| row.tx == mobile || row.rx == mobile));
            assert!((900..=3300).contains(&rows.len()), "{}", rows.len());
            assert!(rows.iter().all(|row| row.time_s <= 900.0));
            n_senders.insert(rows.iter().map(|row| row.tx).collect::<BTreeSet<_>>().len().min(2));
        }
        assert_eq!(n_senders.len(), 2, "sender or receiver");
    }

    #[test]
    fn anchors_find_room_in_the_smallest_place() {
        // Twelve in 14 m by 12 m; a search for places 4 m apart did not end.
        assert!(!case(534_128_452_000_002).csv.is_empty());
    }
}
