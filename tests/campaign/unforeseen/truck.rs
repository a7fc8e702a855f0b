//! A truck that obstructs some links for a quarter of an hour or more.

use super::air::{Air, layout, n_rows};
use super::answer::{Answer, Claim, Scope};
use super::{Case, Expected};
use crate::campaign::draws::Draws;
use crate::campaign::geometry::{Point, crossing};
use crate::campaign::world::{Layout, Row, World};

/// Tolerance of the named times (s).
const NEAR_S: f64 = 120.0;

/// A truck: a segment in the plane, and when it stands there.
struct Truck {
    side: [Point; 2],
    from_s: f64,
    until_s: f64,
    loss_db: f64,
}

impl Truck {
    /// Of forty random places, the one where the share of obstructed paths is nearest to a quarter.
    fn new(seed: u64, world: &World) -> Self {
        let mut draws = Draws::new(seed, "truck");
        let stands_s = 60.0 * draws.between(15.0, 25.0);
        let from_s = draws.between(0.1, 0.9) * (world.duration_s - stands_s);
        let loss_db = draws.between(8.0, 18.0);
        let length_m = draws.between(8.0, 16.0);
        let off = |side: &[Point; 2]| {
            let n = world.rows.iter().filter(|row| is_crossed(*side, row)).count();
            (n as f64 / world.rows.len() as f64 - 0.25).abs()
        };
        let places = (0..40).map(|_| {
            let centre = world.extent_m.map(|extent_m| draws.between(0.2, 0.8) * extent_m);
            let (sin, cos) = draws.between(0.0, std::f64::consts::PI).sin_cos();
            [-0.5, 0.5].map(|along| {
                [centre[0] + along * length_m * cos, centre[1] + along * length_m * sin]
            })
        });
        let side = places.min_by(|a, b| off(a).total_cmp(&off(b))).expect("forty places");
        Self { side, from_s, until_s: from_s + stands_s, loss_db }
    }

    /// Its contribution to a row (dB).
    fn added_db(&self, row: &Row) -> f64 {
        let stands = self.from_s <= row.time_s && row.time_s < self.until_s;
        if stands && is_crossed(self.side, row) { -self.loss_db } else { 0.0 }
    }
}

fn is_crossed([from, to]: [Point; 2], row: &Row) -> bool {
    crossing(row.tx_at.plane_m, row.rx_at.plane_m, from, to).is_some()
}

fn air(seed: u64) -> (Air, Truck) {
    let mut draws = Draws::new(seed, "site");
    let site = Layout {
        n_fixed: 9 + draws.below(5),
        n_moving: draws.below(4),
        duration_s: draws.between(3600.0, 6000.0).round(),
        ..layout(seed, draws.between(2.0, 6.0))
    };
    let mut air = Air::new(seed, &site, n_rows(seed, 4000, 5000));
    let truck = Truck::new(seed, &air.world);
    air.add(|_, row| truck.added_db(row));
    (air, truck)
}

/// Honest: an obstacle, with the times at which it came and went.
pub(super) fn case(seed: u64) -> Case {
    let (air, truck) = air(seed);
    let sent = air.send();
    let near = |moment_s: f64| Some([moment_s - NEAR_S, moment_s + NEAR_S]);
    let scope =
        Scope { from_s: near(truck.from_s), until_s: near(truck.until_s), ..Scope::default() };
    let obstacle = Claim { scope, ..Claim::of("hidden-obstacle") };
    let answer = Answer::of(vec![obstacle])
        .with_structure(&["time_s", "midpoint_x_m", "midpoint_y_m"])
        .with_error(air.error_over_noise(&sent));
    Case { csv: air.csv(&sent), config_toml: air.config(&sent), expected: Expected::Answer(answer) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_truck_attenuates_the_links_that_cross_it_while_it_stands() {
        for seed in 0..5 {
            let (air, truck) = air(seed);
            let stands_s = truck.until_s - truck.from_s;
            assert!((900.0..=1500.0).contains(&stands_s));
            assert!(0.0 < truck.from_s && truck.until_s < air.world.duration_s);
            let mut n_crossed = 0;
            for (index, row) in air.world.rows.iter().enumerate() {
                let added_db = air.level_db[index] - air.model_db[index];
                // The two sides of a line through the truck, by the sign of a determinant.
                let [a, b] = truck.side;
                let side = |p: Point| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
                let is_between = side(row.tx_at.plane_m) * side(row.rx_at.plane_m) < 0.0;
                let stands = (truck.from_s..truck.until_s).contains(&row.time_s);
                assert!(added_db.abs() < 1e-9 || (is_between && stands));
                assert!(added_db.abs() < 1e-9 || (added_db + truck.loss_db).abs() < 1e-9);
                n_crossed += usize::from(1.0 < added_db.abs());
            }
            // About a quarter of the paths, for about a quarter of the time.
            assert!(60 < n_crossed, "{n_crossed}");
        }
    }
}
