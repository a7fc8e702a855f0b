//! Waves that bend over edges.

use super::{Effect, Entry};
use crate::link::Link;
use crate::sight::Path;
use proto::config::Section;
use proto::effect::{Catalogued, Level, Need};

/// `kind = "diffraction"`.
pub const ENTRY: Entry = Entry::of::<Diffraction>();

/// Waves diffract over walls and obstacles with a height, as over knife edges.
///
/// # Mechanism
///
/// Waves diffract over the top of a wall, with more loss the deeper the receiver is in the shadow. A path that narrowly clears the
/// edge loses power, too.
///
/// # Equation
///
/// ```text
/// RSSI' = RSSI - scale * J(v), J(v) = 6.9 + 20 log10(sqrt((v - 0.1)^2 + 1) + v - 0.1) for v > -0.78, else 0; v = h
/// sqrt(2/lambda (1/d1 + 1/d2)), h the height of the edge above the straight path
/// ```
///
/// # Source
///
/// ITU-R P.526-15, § 4.1, equations 26 and 31 (single knife edge).
///
/// # Validity
///
/// Only the worst edge of a path counts, and only paths over it, not around or through it. Rounded tops and several edges lose
/// more. Walls without a height belong to wall-attenuation.
///
/// # Trace
///
/// Links behind mapped edges are weak, with a gradual transition, less so on tall masts.
#[derive(Clone, Copy, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "diffraction",
    needs = &[Need::Positions, Need::Heights, Need::Readings, Need::Edges],
    level = Level::Place,
)]
pub struct Diffraction {
    /// Loss relative to the theory; 1: a knife edge.
    #[key(range = 0.0..=10.0, default = 1.0)]
    #[fit(unit = "", range = 0.0..=3.0, starts = [1.0], step = 0.01, null = 0.0)]
    pub scale: f64,
}

/// Loss (dB) over a knife edge with the parameter ν.
#[must_use]
pub fn knife_edge_db(v: f64) -> f64 {
    if v <= -0.78 {
        return 0.0;
    }
    let x = v - 0.1;
    (6.9 + 20.0 * libm::log10((x * x + 1.0).sqrt() + x)).max(0.0)
}

impl Effect for Diffraction {
    fn contribution_db(&self, link: &Link<'_>) -> f64 {
        let Some(site) = link.scene.site else { return 0.0 };
        let path = Path::direct(link);
        let wavelength_m = link.wavelength_m();
        let walls = site.wall.iter().filter_map(|wall| path.edge_of_wall(wall));
        let obstacles = site.obstacle.iter().filter_map(|obstacle| path.edge_of_obstacle(obstacle));
        let worst = walls.chain(obstacles).map(|(t, above_m)| {
            let first_m = (t * link.distance_m).max(wavelength_m);
            let second_m = ((1.0 - t) * link.distance_m).max(wavelength_m);
            above_m * (2.0 / wavelength_m * (1.0 / first_m + 1.0 / second_m)).sqrt()
        });
        let worst = worst.fold(f64::NEG_INFINITY, f64::max);
        // Not -0, where there is no edge.
        0.0 - self.scale * knife_edge_db(worst)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::testing::along_x;
    use crate::link::Scene;
    use proto::site::{Site, Wall};

    #[test]
    fn the_approximation_is_that_of_fresnels_integrals() {
        // C(v) and S(v) of Abramowitz and Stegun, table 7.7; loss -20 log10(sqrt((1-C-S)^2 + (C-S)^2)/2), P.526 eq. 30.
        for (v, c, s) in [
            (-0.5f64, -0.492_344_2f64, -0.064_732_4f64),
            (0.0, 0.0, 0.0),
            (0.5, 0.492_344_2, 0.064_732_4),
            (1.0, 0.779_893_4, 0.438_259_1),
            (2.0, 0.488_253_4, 0.343_415_7),
        ] {
            let field = ((1.0 - c - s).powi(2) + (c - s).powi(2)).sqrt() / 2.0;
            let expected = -20.0 * field.log10();
            // P.526 does not say how near the approximation is; it is within 0.3 dB here.
            let got = knife_edge_db(v);
            assert!((got - expected).abs() < 0.3, "{v}: {got}, {expected}");
        }
        assert_eq!(knife_edge_db(-0.79), 0.0);
        assert!(knife_edge_db(-0.78 + 1e-9) < 0.05);
    }

    #[test]
    fn a_wall_half_way_loses_by_its_height_over_the_path() {
        let wall =
            |height_m| Wall { from_m: [10.0, -5.0], to_m: [10.0, 5.0], height_m, material: None };
        let loss_db = |walls: Vec<Wall>, scale: f64| {
            let site = Site { wall: walls, ..Site::default() };
            let scene = Scene { site: Some(&site), ..Scene::default() };
            Diffraction { scale }.contribution_db(&along_x(20.0, 1.0, None, &scene))
        };
        // λ = 0.1228658 m, d1 = d2 = 10 m: ν = h √(2/0.1228658 · 0.2) = 1.804324 h.
        assert!((loss_db(vec![wall(Some(2.0))], 1.0) + knife_edge_db(1.804_324)).abs() < 1e-4);
        assert!((loss_db(vec![wall(Some(1.0))], 2.0) + 2.0 * knife_edge_db(0.0)).abs() < 1e-12);
        // The worst one counts; what has no top has no edge.
        assert_eq!(
            loss_db(vec![wall(Some(2.0)), wall(Some(1.0)), wall(None)], 1.0),
            loss_db(vec![wall(Some(2.0))], 1.0)
        );
        assert_eq!(loss_db(vec![wall(None)], 1.0), 0.0);
        assert_eq!(loss_db(vec![], 1.0), 0.0);
    }
}
