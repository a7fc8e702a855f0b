//! Walls that the map shows.

use super::{Effect, Entry};
use crate::link::Link;
use crate::sight::Path;
use proto::config::Section;
use proto::effect::{Catalogued, Level, Need};

/// `kind = "wall-attenuation"`.
pub const ENTRY: Entry = Entry::of::<WallAttenuation>();

/// Every \[\[site.wall\]\] in the direct path attenuates.
///
/// # Mechanism
///
/// Each wall reflects and absorbs part of the power that reaches it.
///
/// # Equation
///
/// ```text
/// RSSI' = RSSI - loss_db * (walls that the straight path cuts)
/// ```
///
/// # Source
///
/// A. J. Motley, J. M. P. Keenan, Personal communication radio coverage in buildings at 900 MHz and 1700 MHz, Electronics Letters
/// 24 (1988) 763; COST 231 final report, § 4.7.2 (multi-wall model).
///
/// # Validity
///
/// Only the direct path counts: no propagation around the wall or through doors. The angle of incidence has no influence. A path
/// above a wall of known height is unobstructed.
///
/// # Trace
///
/// Links that cross walls are weak, by a multiple of the same value.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "wall-attenuation",
    needs = &[Need::Positions, Need::Readings, Need::Walls],
    example = "loss_db = 6.0\n",
    level = Level::Place,
)]
pub struct WallAttenuation {
    /// Loss per wall (dB): 2 to 4 for plasterboard, 6 to 15 for brick and concrete.
    #[key(range = 0.0..=100.0)]
    #[fit(
        unit = "dB",
        range = 0.0..=40.0,
        starts = [3.0],
        step = 0.05,
        null = 0.0,
        plausible = 0.1..=60.0,
        source = "ITU-R P.2040: from thin plasterboard to reinforced concrete",
    )]
    pub loss_db: f64,
    /// Walls of this material only. Absent: all walls.
    pub material: Option<String>,
}

impl Effect for WallAttenuation {
    fn contribution_db(&self, link: &Link<'_>) -> f64 {
        let Some(site) = link.scene.site else { return 0.0 };
        let path = Path::direct(link);
        let n_cut = site
            .wall
            .iter()
            .filter(|wall| self.material.is_none() || wall.material == self.material)
            .filter(|wall| path.is_cut_by_wall(wall))
            .count();
        -self.loss_db * n_cut as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::testing::along_x;
    use crate::link::Scene;
    use proto::site::{Site, Wall};

    #[test]
    fn walls_add_up_by_material_and_low_ones_are_passed() {
        let wall = |x_m: f64, height_m, material: &str| Wall {
            from_m: [x_m, -1.0],
            to_m: [x_m, 1.0],
            height_m,
            material: Some(material.to_owned()),
        };
        let site = Site {
            wall: vec![
                wall(1.0, None, "brick"),
                wall(2.0, Some(2.0), "brick"),
                wall(3.0, Some(1.0), "brick"),
                wall(4.0, None, "glass"),
                wall(50.0, None, "brick"),
            ],
            ..Site::default()
        };
        let scene = Scene { site: Some(&site), ..Scene::default() };
        let link = along_x(10.0, 1.5, None, &scene);
        let attenuation_db = |material: Option<&str>| {
            WallAttenuation { loss_db: 5.0, material: material.map(str::to_owned) }
                .contribution_db(&link)
        };
        assert_eq!(attenuation_db(None), -15.0);
        assert_eq!(attenuation_db(Some("brick")), -10.0);
        assert_eq!(attenuation_db(Some("glass")), -5.0);
        assert_eq!(attenuation_db(Some("steel")), 0.0);
    }
}
