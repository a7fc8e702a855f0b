//! A log-distance base whose path loss exponent is not the site's.

use super::air::{Air, layout, n_rows};
use super::answer::{Answer, Claim};
use super::{Case, Expected};
use crate::campaign::draws::Draws;
use crate::campaign::world::{Base, Layout, rounded};

/// Tolerance of the named exponent.
const NEAR: f64 = 0.15;

/// The configured exponent and the site's.
fn exponents(seed: u64) -> [f64; 2] {
    let mut draws = Draws::new(seed, "exponents");
    [rounded(draws.between(2.9, 3.1), 1), draws.between(2.0, 2.6)]
}

fn air(seed: u64) -> Air {
    let [configured, site] = exponents(seed);
    let drawn = layout(seed, 15.0);
    let n_fixed = drawn.n_fixed.max(10);
    let layout = Layout { base: Base::LogDistance(configured), n_fixed, ..drawn };
    let mut air = Air::new(seed, &layout, n_rows(seed, 3000, 5000));
    air.add(|_, row| {
        Base::LogDistance(site).gain_db(row.distance_m(), row.channel)
            - Base::LogDistance(configured).gain_db(row.distance_m(), row.channel)
    });
    air
}

/// Honest: the path loss exponent, with the site's value.
pub(super) fn case(seed: u64) -> Case {
    let air = air(seed);
    let sent = air.send();
    let [_, site] = exponents(seed);
    let claim = Claim {
        near: vec![("exponent", [site - NEAR, site + NEAR])],
        ..Claim::of("path-loss-exponent")
    };
    let answer = Answer::of(vec![claim])
        .with_structure(&["distance_m", "log10_distance", "predicted_rssi_dbm"])
        .with_error(air.error_over_noise(&sent));
    Case { csv: air.csv(&sent), config_toml: air.config(&sent), expected: Expected::Answer(answer) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_level_falls_with_the_exponent_of_the_site() {
        for seed in 0..4 {
            let air = air(seed);
            let [configured, site] = exponents(seed);
            for (index, row) in air.world.rows.iter().enumerate() {
                let decades = row.distance_m().max(1.0).log10();
                let off_db = air.level_db[index] - air.model_db[index];
                assert!((off_db - 10.0 * (configured - site) * decades).abs() < 1e-9);
            }
            let config = air.config(&air.send());
            assert!(config.contains(&format!("exponent = {configured:?}")), "{config}");
        }
    }
}
