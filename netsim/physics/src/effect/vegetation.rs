//! Trees and bushes.

use super::{Effect, Entry};
use crate::link::Link;
use crate::sight::Path;
use proto::config::Section;
use proto::effect::{Catalogued, Level, Need};

/// `kind = "vegetation"`.
pub const ENTRY: Entry = Entry::of::<Vegetation>();

/// Foliage of \[site\] attenuates in proportion to the path length within it.
///
/// # Mechanism
///
/// Leaves and branches scatter and absorb, more so the longer the path within them.
///
/// # Equation
///
/// ```text
/// RSSI' = RSSI + db_per_m * depth; without db_per_m Weissberger's -0.45 f^0.284 depth up to 14 m, -1.33 f^0.284
/// depth^0.588 beyond, f in GHz
/// ```
///
/// # Source
///
/// M. A. Weissberger, An initial critical summary of models for predicting the attenuation of radio waves by trees, ESD-TR-81-101
/// (1982); ITU-R P.833 (specific attenuation).
///
/// # Validity
///
/// Only the straight path counts. In deep woods waves propagate along the tree tops, so the loss per metre falls; Weissberger's
/// model includes this, a constant does not. Weissberger: 0.23 to 95 GHz, up to 400 m. Overlapping areas count twice.
///
/// # Trace
///
/// Links through foliage are weak, in proportion to the path length within it.
#[derive(Clone, Copy, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "vegetation",
    needs = &[Need::Positions, Need::Readings, Need::Foliage],
    example = "db_per_m = -0.4\n",
    level = Level::Place,
)]
pub struct Vegetation {
    /// Gain per metre within foliage (dB per m): negative. Absent: Weissberger's model for trees in leaf.
    #[key(range = -20.0..=0.0)]
    #[fit(
        unit = "dB/m",
        starts = [-0.4],
        step = 0.005,
        null = 0.0,
        plausible = -10.0..=0.0,
        source = "ITU-R P.833 and Weissberger 1982: -0.3 to -0.6 dB/m at 2.4 GHz",
    )]
    pub db_per_m: Option<f64>,
}

fn weissberger_db(depth_m: f64, frequency_hz: f64) -> f64 {
    let by_frequency = libm::pow(frequency_hz / 1e9, 0.284);
    if depth_m <= 14.0 {
        0.45 * by_frequency * depth_m
    } else {
        1.33 * by_frequency * libm::pow(depth_m, 0.588)
    }
}

impl Effect for Vegetation {
    fn contribution_db(&self, link: &Link<'_>) -> f64 {
        let Some(site) = link.scene.site else { return 0.0 };
        if site.foliage.is_empty() {
            return 0.0;
        }
        let path = Path::direct(link);
        let depth_m: f64 = site.foliage.iter().map(|foliage| path.length_within_m(foliage)).sum();
        match self.db_per_m {
            Some(db_per_m) => db_per_m * depth_m,
            None if depth_m == 0.0 => 0.0,
            None => -weissberger_db(depth_m, link.frequency_hz),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::testing::{along_x, made};
    use crate::link::Scene;
    use proto::site::{Foliage, Site};

    #[test]
    fn loss_grows_with_depth() {
        let piece = |from_m: f64, to_m: f64| Foliage {
            polygon_m: vec![[from_m, -5.0], [to_m, -5.0], [to_m, 5.0], [from_m, 5.0]],
            height_m: None,
        };
        let site = Site { foliage: vec![piece(2.0, 5.0), piece(8.0, 10.0)], ..Site::default() };
        let scene = Scene { site: Some(&site), ..Scene::default() };
        let linear = made("vegetation", "db_per_m = -0.5");
        for (distance_m, expected_db) in [(1.0, 0.0), (4.0, -1.0), (7.0, -1.5), (20.0, -2.5)] {
            let got = linear.contribution_db(&along_x(distance_m, 1.0, None, &scene));
            assert!((got - expected_db).abs() < 1e-12, "{distance_m}: {got}");
        }
        // 5 m of leaves at 2.44 GHz: 0.45 * 2.44^0.284 * 5 = 2.90 dB.
        let got = made("vegetation", "").contribution_db(&along_x(20.0, 1.0, None, &scene));
        assert!((got + 2.90).abs() < 0.005, "{got}");
    }

    #[test]
    fn weissbergers_branches_meet_at_14_m() {
        let below = weissberger_db(14.0, 2.44e9);
        let above = weissberger_db(14.0 + 1e-9, 2.44e9);
        assert!((below / above - 1.0).abs() < 0.005, "{below} {above}");
        // At 1 GHz 100 m take 1.33 * 100^0.588 = 19.9 dB.
        assert!((weissberger_db(100.0, 1e9) - 19.95).abs() < 0.05);
    }
}
