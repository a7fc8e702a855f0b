//! Clutter: power falls faster, or slower, over distance than in free space.

use super::{Effect, Entry};
use crate::link::Link;
use crate::propagation::FREE_SPACE_EXPONENT;
use proto::config::Section;
use proto::effect::{Catalogued, FromModel, Level, Need};

/// `kind = "path-loss-exponent"`.
pub const ENTRY: Entry = Entry::of::<PathLossExponent>();

/// The path-loss exponent differs from that of the base model, for example from 2, that of free space.
///
/// # Mechanism
///
/// Among furniture, plants and people, power falls faster over distance than in free space; along a corridor, which guides the
/// wave, more slowly.
///
/// # Equation
///
/// ```text
/// RSSI' = RSSI - 10 (exponent - base_exponent) log10(d / reference_distance_m) for d > reference_distance_m
/// ```
///
/// # Source
///
/// T. S. Rappaport, Wireless Communications, 2nd ed., § 4.9.1 (log-distance path loss).
///
/// # Validity
///
/// An average over many links of one environment, on a base model whose exponent is base_exponent. On log-distance it only changes
/// that model's own exponent.
///
/// # Trace
///
/// A slope over the logarithm of distance.
#[derive(Clone, Copy, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "path-loss-exponent",
    needs = &[Need::Positions, Need::Readings],
    example = "exponent = 3.0\n",
    level = Level::Place,
    from_model = &[("exponent", FromModel::PathLossExponent), ("base_exponent", FromModel::PathLossExponent), ("reference_distance_m", FromModel::ReferenceDistance)],
)]
pub struct PathLossExponent {
    /// Path loss exponent of the site, that of the base model included: 1.6 to 1.8 along corridors, 2.7 to 3.5 in cities, 4 to 6 in
    /// obstructed buildings (Rappaport, table 4.2).
    #[key(range = 1.0..=8.0)]
    #[fit(
        unit = "",
        starts = [2.0],
        step = 0.01,
        plausible = 1.2..=7.0,
        source = "Rappaport, table 4.2: 1.6 to 6",
    )]
    pub exponent: f64,
    /// Exponent that the base model has already: 2 in free space, or the exponent of log-distance. The effect adds the difference.
    /// diagnose and extend take it from the configuration.
    #[key(range = 0.0..=8.0, default = FREE_SPACE_EXPONENT)]
    pub base_exponent: f64,
    /// Reference distance (m), up to which nothing is added.
    #[key(above = 0.0, most = 1e5, default = 1.0)]
    pub reference_distance_m: f64,
}

impl Effect for PathLossExponent {
    fn contribution_db(&self, link: &Link<'_>) -> f64 {
        if link.distance_m <= self.reference_distance_m {
            return 0.0;
        }
        -10.0 * self.added_exponent() * libm::log10(link.distance_m / self.reference_distance_m)
    }

    fn max_gain_db(&self) -> f64 {
        // Below that of the base model it gains without end as distance grows.
        if self.added_exponent() < 0.0 { f64::INFINITY } else { 0.0 }
    }

    fn is_isotropic(&self) -> bool {
        0.0 <= self.added_exponent()
    }

    fn added_exponent(&self) -> f64 {
        self.exponent - self.base_exponent
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::testing::along_x;
    use crate::link::Scene;

    fn effect(exponent: f64, base_exponent: f64) -> PathLossExponent {
        PathLossExponent { exponent, base_exponent, reference_distance_m: 1.0 }
    }

    #[test]
    fn an_exponent_of_4_loses_another_20_db_to_a_decade() {
        let scene = Scene::default();
        let effect = effect(4.0, 2.0);
        for (distance_m, expected_db) in [(0.5, 0.0), (1.0, 0.0), (10.0, -20.0), (100.0, -40.0)] {
            let got = effect.contribution_db(&along_x(distance_m, 1.0, None, &scene));
            assert!((got - expected_db).abs() < 1e-9, "{distance_m} m: {got}");
        }
    }

    #[test]
    fn the_difference_from_the_base_model_is_added() {
        let scene = Scene::default();
        for (exponent, expected_db) in [(2.2, 8.0), (3.0, 0.0), (3.5, -5.0)] {
            let effect = effect(exponent, 3.0);
            let got = effect.contribution_db(&along_x(10.0, 1.0, None, &scene));
            assert!((got - expected_db).abs() < 1e-9, "{exponent}: {got}");
            assert_eq!(effect.is_isotropic(), 3.0 <= exponent);
            assert_eq!(effect.max_gain_db(), if exponent < 3.0 { f64::INFINITY } else { 0.0 });
        }
    }
}
