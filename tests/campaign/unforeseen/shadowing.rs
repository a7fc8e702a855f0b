//! Nothing but shadowing, spatially correlated where nodes move (Gudmundson 1991).

use super::air::{Air, layout, n_rows};
use super::answer::{Answer, Claim};
use super::{Case, Expected};
use crate::campaign::draws::Draws;
use crate::campaign::field::{Kernel, pair_field};
use crate::campaign::world::Layout;

/// Which nodes move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Movers {
    Nobody,
    Some,
    All,
}

/// Nodes that move are slow: between two frames of a link its ends move less than a decorrelation distance. Otherwise nothing tells
/// their shadowing from white noise.
fn place(seed: u64, movers: Movers) -> Layout {
    let mut draws = Draws::new(seed, "movers");
    let [n_fixed, n_moving] = match movers {
        Movers::Nobody => [9 + draws.below(6), 0],
        Movers::Some => [6 + draws.below(5), 3 + draws.below(3)],
        Movers::All => [0, 6 + draws.below(2)],
    };
    let layout = layout(seed, draws.between(0.3, 0.6));
    let duration_s = match movers {
        Movers::Nobody => layout.duration_s,
        Movers::Some | Movers::All => draws.between(600.0, 1200.0).round(),
    };
    Layout { n_fixed, n_moving, duration_s, ..layout }
}

/// Standard deviation (dB) and decorrelation distance (m).
fn shadowing(seed: u64) -> (f64, f64) {
    let mut draws = Draws::new(seed, "shadowing");
    (draws.between(2.5, 6.0), draws.between(6.0, 15.0))
}

fn air(seed: u64, movers: Movers) -> Air {
    let mut air = Air::new(seed, &place(seed, movers), n_rows(seed, 4000, 5000));
    let (sd_db, decorrelation_m) = shadowing(seed);
    let kernel = Kernel::Place { variance: sd_db * sd_db, decorrelation_m };
    let field = pair_field(&air.world, kernel, &mut Draws::new(seed, "field"));
    air.add(|index, _| field[index]);
    air
}

/// Honest: shadowing, and nothing beside it.
pub(super) fn case(seed: u64, movers: Movers) -> Case {
    let air = air(seed, movers);
    let sent = air.send();
    let answer = Answer::of(vec![Claim::of("shadowing")]).with_error(air.error_over_noise(&sent));
    Case { csv: air.csv(&sent), config_toml: air.config(&sent), expected: Expected::Answer(answer) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::unforeseen::testbed::link;
    use crate::statistics::mean;
    use std::collections::BTreeMap;

    #[test]
    fn fixed_links_have_one_value_each_and_moving_ones_vary() {
        let n_values = |movers: Movers| {
            let air = air(2, movers);
            let mut values: BTreeMap<(usize, usize), Vec<i64>> = BTreeMap::new();
            for (index, row) in air.world.rows.iter().enumerate() {
                let added_db = air.level_db[index] - air.model_db[index];
                values.entry(link(row)).or_default().push((added_db * 100.0).round() as i64);
            }
            let mut least = usize::MAX;
            let mut most = 0;
            for mut values in values.into_values() {
                // The diagonal is regularised by 10⁻⁹ dB²: the values of a still link differ by less than 0.01 dB.
                values.sort_unstable();
                let steps = values.windows(2).filter(|pair| 1 < pair[1] - pair[0]).count();
                least = least.min(steps);
                most = most.max(steps);
            }
            [least, most]
        };
        assert_eq!(n_values(Movers::Nobody), [0, 0]);
        let [least, most] = n_values(Movers::Some);
        assert!(least == 0 && 20 < most);
        assert!(20 < n_values(Movers::All)[0]);
    }

    #[test]
    fn successive_frames_of_a_moving_link_are_correlated() {
        for seed in 0..4 {
            let air = air(seed, Movers::All);
            let mut links: BTreeMap<(usize, usize), Vec<f64>> = BTreeMap::new();
            for (index, row) in air.world.rows.iter().enumerate() {
                links.entry(link(row)).or_default().push(air.level_db[index] - air.model_db[index]);
            }
            let products: Vec<f64> = links
                .values()
                .flat_map(|values| values.windows(2).map(|pair| pair[0] * pair[1]))
                .collect();
            let correlation = mean(&products) / shadowing(seed).0.powi(2);
            // Of nodes at up to 1 m/s, some 5 m in the time between two frames of a link.
            assert!((0.3..1.0).contains(&correlation), "{correlation}");
        }
    }

    #[test]
    fn shadowing_has_the_spread_drawn() {
        let ratios: Vec<f64> = (0..8)
            .map(|seed| {
                let air = air(seed, Movers::All);
                let squares: Vec<f64> = air
                    .level_db
                    .iter()
                    .zip(&air.model_db)
                    .map(|(truth, model)| (truth - model).powi(2))
                    .collect();
                mean(&squares) / shadowing(seed).0.powi(2)
            })
            .collect();
        // Each of at least 15 links of a campaign goes through tens of decorrelation distances: a variance of at least 150
        // independent values, of eight campaigns.
        assert!((mean(&ratios) - 1.0).abs() < 4.0 * (2.0_f64 / 1200.0).sqrt(), "{ratios:?}");
    }
}
