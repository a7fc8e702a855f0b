//! What stands between two antennas: walls, obstacles, other bodies.

use super::link::{End, Link, Scene, distance_squared_m2};
use super::nearest::Grid;
use proto::site::{Foliage, Obstacle, Wall};

/// The straight path between two points (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    from_m: [f64; 3],
    to_m: [f64; 3],
}

impl Path {
    /// The direct path of a link.
    #[must_use]
    pub fn direct(link: &Link<'_>) -> Self {
        Self { from_m: link.sender.position_m, to_m: link.receiver.position_m }
    }

    /// Whether a wall cuts the path, its foot at z = 0, its top at its height. Touching is cutting.
    #[must_use]
    pub fn is_cut_by_wall(&self, wall: &Wall) -> bool {
        let step = [self.to_m[0] - self.from_m[0], self.to_m[1] - self.from_m[1]];
        let along = [wall.to_m[0] - wall.from_m[0], wall.to_m[1] - wall.from_m[1]];
        let to_wall = [wall.from_m[0] - self.from_m[0], wall.from_m[1] - self.from_m[1]];
        let determinant = cross(step, along);
        if determinant != 0.0 {
            let t = cross(to_wall, along) / determinant;
            let u = cross(to_wall, step) / determinant;
            let hit = (0.0..=1.0).contains(&t) && (0.0..=1.0).contains(&u);
            return hit && self.is_below(wall.height_m, t, t);
        }
        // Parallel, or straight up: cut only where the wall lies along the path.
        if cross(to_wall, along) != 0.0 {
            return false;
        }
        let length_squared = dot(step, step);
        if length_squared == 0.0 {
            let u = -dot(to_wall, along) / dot(along, along);
            return (0.0..=1.0).contains(&u) && self.is_below(wall.height_m, 0.0, 1.0);
        }
        let first = dot(to_wall, step) / length_squared;
        let second = first + dot(along, step) / length_squared;
        let (low, high) = (first.min(second).max(0.0), first.max(second).min(1.0));
        low <= high && self.is_below(wall.height_m, low, high)
    }

    /// Whether a round obstacle cuts the path. Touching is cutting.
    #[must_use]
    pub fn is_cut_by_obstacle(&self, obstacle: &Obstacle) -> bool {
        self.chord_of(obstacle)
            .is_some_and(|(low, high)| self.is_below(obstacle.height_m, low, high))
    }

    /// Between which fractions of its length the path runs through or above a round obstacle, if it does.
    fn chord_of(&self, obstacle: &Obstacle) -> Option<(f64, f64)> {
        let step = [self.to_m[0] - self.from_m[0], self.to_m[1] - self.from_m[1]];
        let from_centre =
            [self.from_m[0] - obstacle.centre_m[0], self.from_m[1] - obstacle.centre_m[1]];
        // |from_centre + t step|^2 <= radius^2
        let a = dot(step, step);
        let b = dot(from_centre, step);
        let c = dot(from_centre, from_centre) - obstacle.radius_m * obstacle.radius_m;
        if a == 0.0 {
            return (c <= 0.0).then_some((0.0, 1.0));
        }
        let discriminant = b * b - a * c;
        if discriminant < 0.0 {
            return None;
        }
        let root = discriminant.sqrt();
        let (low, high) = (((-b - root) / a).max(0.0), ((-b + root) / a).min(1.0));
        (low <= high).then_some((low, high))
    }

    /// Where the path, seen from above, crosses the edge on top of a wall: the fraction of its length, and how far (m) the
    /// edge stands above it there. None where it does not cross, or where the wall has no top.
    #[must_use]
    pub fn edge_of_wall(&self, wall: &Wall) -> Option<(f64, f64)> {
        let height_m = wall.height_m?;
        let step = [self.to_m[0] - self.from_m[0], self.to_m[1] - self.from_m[1]];
        let along = [wall.to_m[0] - wall.from_m[0], wall.to_m[1] - wall.from_m[1]];
        let to_wall = [wall.from_m[0] - self.from_m[0], wall.from_m[1] - self.from_m[1]];
        let determinant = cross(step, along);
        let t = cross(to_wall, along) / determinant;
        let u = cross(to_wall, step) / determinant;
        // Parallel: neither is a number within.
        let crosses = (0.0..=1.0).contains(&t) && (0.0..=1.0).contains(&u);
        crosses.then(|| (t, height_m - self.height_m(t)))
    }

    /// As [`Path::edge_of_wall`], for the top of a round obstacle, in the middle of the chord.
    #[must_use]
    pub fn edge_of_obstacle(&self, obstacle: &Obstacle) -> Option<(f64, f64)> {
        let height_m = obstacle.height_m?;
        let (low, high) = self.chord_of(obstacle)?;
        let t = 0.5 * (low + high);
        Some((t, height_m - self.height_m(t)))
    }

    /// How much of the path (m) lies within foliage.
    #[must_use]
    pub fn length_within_m(&self, foliage: &Foliage) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|axis| self.to_m[axis] - self.from_m[axis]);
        let length_m = distance_squared_m2([x, y, z]).sqrt();
        // The part of the path that is not above the foliage's top.
        let (mut low, mut high) = (0.0, 1.0);
        if let Some(height_m) = foliage.height_m {
            let t = (height_m - self.from_m[2]) / z;
            match (self.from_m[2] <= height_m, self.to_m[2] <= height_m) {
                (true, true) => {}
                (false, false) => return 0.0,
                (true, false) => high = t,
                (false, true) => low = t,
            }
        }
        // The line through the path enters and leaves a polygon in turns, and crosses edges one way and the other in turns.
        let step = [x, y];
        let side =
            |point: [f64; 2]| cross(step, [point[0] - self.from_m[0], point[1] - self.from_m[1]]);
        let polygon = &foliage.polygon_m;
        let Some(&last) = polygon.last() else { return 0.0 };
        if step == [0.0, 0.0] {
            let within = is_within([self.from_m[0], self.from_m[1]], polygon);
            return if within { (high - low) * length_m } else { 0.0 };
        }
        let (mut before, mut before_side) = (last, side(last));
        let mut within = 0.0;
        for &corner in polygon {
            let corner_side = side(corner);
            if (0.0 < before_side) != (0.0 < corner_side) {
                let share = before_side / (before_side - corner_side);
                let at = [0, 1].map(|axis| before[axis] + share * (corner[axis] - before[axis]));
                let to = [at[0] - self.from_m[0], at[1] - self.from_m[1]];
                let t = (dot(to, step) / dot(step, step)).clamp(low, high);
                within += if 0.0 < corner_side { t } else { -t };
            }
            (before, before_side) = (corner, corner_side);
        }
        within.abs() * length_m
    }

    /// Square of the distance of a point to the path (m²).
    #[must_use]
    pub fn distance_squared_m2(&self, point_m: [f64; 3]) -> f64 {
        let minus = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let step = minus(self.to_m, self.from_m);
        let to_point = minus(point_m, self.from_m);
        let length_squared = distance_squared_m2(step);
        let t = if length_squared == 0.0 {
            0.0
        } else {
            let along = to_point[0] * step[0] + to_point[1] * step[1] + to_point[2] * step[2];
            (along / length_squared).clamp(0.0, 1.0)
        };
        distance_squared_m2(minus(to_point, step.map(|x| x * t)))
    }

    /// Whether the path between two fractions of its length comes down to a height.
    fn is_below(&self, height_m: Option<f64>, low: f64, high: f64) -> bool {
        height_m.is_none_or(|height_m| self.height_m(low).min(self.height_m(high)) <= height_m)
    }

    /// Its height (m) at a fraction of its length.
    fn height_m(&self, t: f64) -> f64 {
        self.from_m[2] + t * (self.to_m[2] - self.from_m[2])
    }
}

/// Whether a point lies within a polygon: a ray to the right crosses its edges an odd number of times.
fn is_within(point: [f64; 2], polygon: &[[f64; 2]]) -> bool {
    let mut within = false;
    let mut before = polygon[polygon.len() - 1];
    for &corner in polygon {
        if (point[1] < before[1]) != (point[1] < corner[1]) {
            let share = (point[1] - before[1]) / (corner[1] - before[1]);
            within ^= point[0] < before[0] + share * (corner[0] - before[0]);
        }
        before = corner;
    }
    within
}

/// The angle in the plane (rad, from −π to π) between the sender's heading, or its direction of motion if no heading is known,
/// and the direction of the receiver. `None`: neither is known, or the receiver is straight above or below.
#[must_use]
pub fn off_heading_rad(link: &Link<'_>) -> Option<f64> {
    let motion = link
        .sender
        .velocity_mps
        .filter(|velocity| velocity[0] != 0.0 || velocity[1] != 0.0)
        .map(|velocity| libm::atan2(velocity[1], velocity[0]));
    let heading_rad = link.sender.heading_rad.or(motion)?;
    let [x, y] = [0, 1].map(|axis| link.receiver.position_m[axis] - link.sender.position_m[axis]);
    if x == 0.0 && y == 0.0 {
        return None;
    }
    Some(libm::remainder(libm::atan2(y, x) - heading_rad, std::f64::consts::TAU))
}

/// Whether a body of another agent, a ball of this radius around its antenna, touches the direct path.
#[must_use]
pub fn is_blocked_by_body(link: &Link<'_>, body_radius_m: f64) -> bool {
    bodies_on_path(link, body_radius_m).next().is_some()
}

/// The other agents whose bodies, balls of this radius around their antennas, touch the direct path.
pub fn bodies_on_path<'a>(
    link: &Link<'a>,
    body_radius_m: f64,
) -> impl Iterator<Item = &'a End> + use<'a> {
    let path = Path::direct(link);
    agents_near(link, body_radius_m).filter(move |agent| {
        path.distance_squared_m2(agent.position_m) <= body_radius_m * body_radius_m
    })
}

/// Bodies that reach into the first Fresnel zone of a link, seen from above: upright, of this radius, between the ends.
pub fn bodies_in_first_zone<'a>(
    link: &Link<'a>,
    body_radius_m: f64,
) -> impl Iterator<Item = &'a End> + use<'a> {
    let wavelength_m = link.wavelength_m();
    let (from, to) = (link.sender.position_m, link.receiver.position_m);
    let way = [to[0] - from[0], to[1] - from[1]];
    let length_squared = way[0] * way[0] + way[1] * way[1];
    let length_m = length_squared.sqrt();
    let widest_m = 0.5 * (wavelength_m * length_m).sqrt();
    agents_near(link, body_radius_m + widest_m).filter(move |agent| {
        let point = [agent.position_m[0] - from[0], agent.position_m[1] - from[1]];
        let along = (point[0] * way[0] + point[1] * way[1]) / length_squared;
        let off = [point[0] - along * way[0], point[1] - along * way[1]];
        let zone_m = (wavelength_m * length_m * along * (1.0 - along)).max(0.0).sqrt();
        let reach_m = body_radius_m + zone_m;
        (0.0..=1.0).contains(&along) && off[0] * off[0] + off[1] * off[1] <= reach_m * reach_m
    })
}

/// Agents other than the ends that may lie within a distance of the straight path in the plane, and some that do not.
fn agents_near<'a>(link: &Link<'a>, reach_m: f64) -> impl Iterator<Item = &'a End> + use<'a> {
    let (sender, receiver) = (link.sender.id, link.receiver.id);
    let is_other = move |agent: &&End| agent.id != sender && agent.id != receiver;
    let agents = link.scene.agents;
    let grid = link.scene.grid.as_ref();
    let all = if grid.is_none() { agents } else { &[] };
    let (a, b) = (link.sender.position_m, link.receiver.position_m);
    let low = [a[0].min(b[0]) - reach_m, a[1].min(b[1]) - reach_m];
    let high = [a[0].max(b[0]) + reach_m, a[1].max(b[1]) + reach_m];
    let near = grid.map(|grid| grid.in_box(low, high).map(|place| &agents[place as usize]));
    all.iter().chain(near.into_iter().flatten()).filter(is_other)
}

/// Sorts the agents by place, where there are so many that this helps to find bodies.
pub fn prepare_bodies(scene: &mut Scene<'_>) {
    if scene.grid.is_none() && 16 < scene.agents.len() {
        let mut grid = Grid::default();
        grid.build_for(scene.agents, 4);
        scene.grid = Some(grid);
    }
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::Scene;
    use crate::nearest::Grid;
    use proptest::prelude::*;
    use proto::ids::MoteId;

    fn path(from_m: [f64; 3], to_m: [f64; 3]) -> Path {
        Path { from_m, to_m }
    }

    fn wall(from_m: [f64; 2], to_m: [f64; 2], height_m: Option<f64>) -> Wall {
        Wall { from_m, to_m, height_m, material: None }
    }

    #[test]
    fn a_wall_cuts_what_crosses_or_touches_it() {
        let wall = wall([5.0, -1.0], [5.0, 1.0], None);
        assert!(path([0.0, 0.0, 0.0], [10.0, 0.0, 0.0]).is_cut_by_wall(&wall));
        assert!(path([0.0, 1.0, 0.0], [10.0, 1.0, 0.0]).is_cut_by_wall(&wall), "its end");
        assert!(path([0.0, 0.0, 0.0], [5.0, 0.0, 0.0]).is_cut_by_wall(&wall), "the path's end");
        assert!(!path([0.0, 1.5, 0.0], [10.0, 1.5, 0.0]).is_cut_by_wall(&wall));
        assert!(!path([0.0, 0.0, 0.0], [4.9, 0.0, 0.0]).is_cut_by_wall(&wall));
        assert!(path([5.0, 3.0, 0.0], [5.0, 0.5, 0.0]).is_cut_by_wall(&wall), "along it");
        assert!(!path([5.0, 3.0, 0.0], [5.0, 1.5, 0.0]).is_cut_by_wall(&wall));
        assert!(path([5.0, 0.0, 0.0], [5.0, 0.0, 9.0]).is_cut_by_wall(&wall), "straight up");
    }

    #[test]
    fn a_path_passes_above_a_low_wall() {
        let wall = wall([5.0, -1.0], [5.0, 1.0], Some(2.0));
        assert!(path([0.0, 0.0, 1.0], [10.0, 0.0, 3.0]).is_cut_by_wall(&wall), "2 m at the wall");
        assert!(!path([0.0, 0.0, 1.1], [10.0, 0.0, 3.0]).is_cut_by_wall(&wall));
    }

    #[test]
    fn an_obstacle_cuts_what_comes_within_its_radius_and_below_its_top() {
        let mut obstacle = Obstacle {
            name: None,
            centre_m: [5.0, 0.0],
            radius_m: 1.0,
            height_m: None,
            material: None,
        };
        assert!(path([0.0, 0.0, 0.0], [10.0, 0.0, 0.0]).is_cut_by_obstacle(&obstacle));
        assert!(path([0.0, 1.0, 0.0], [10.0, 1.0, 0.0]).is_cut_by_obstacle(&obstacle), "tangent");
        assert!(!path([0.0, 1.01, 0.0], [10.0, 1.01, 0.0]).is_cut_by_obstacle(&obstacle));
        assert!(!path([0.0, 0.0, 0.0], [3.9, 0.0, 0.0]).is_cut_by_obstacle(&obstacle));
        assert!(path([5.0, 0.5, 0.0], [5.0, 0.5, 0.0]).is_cut_by_obstacle(&obstacle), "inside");
        // Over the chord from x = 4 to 6 the path rises from 0.4 to 0.6 m.
        obstacle.height_m = Some(0.45);
        assert!(path([0.0, 0.0, 0.0], [10.0, 0.0, 1.0]).is_cut_by_obstacle(&obstacle));
        obstacle.height_m = Some(0.35);
        assert!(!path([0.0, 0.0, 0.0], [10.0, 0.0, 1.0]).is_cut_by_obstacle(&obstacle));
    }

    #[test]
    fn foliage_is_as_deep_as_the_path_within_it() {
        let mut foliage = Foliage {
            // A U about the x axis: two trunks of 2 m, from x = 2 to 4 and from x = 6 to 8.
            polygon_m: vec![
                [2.0, -1.0],
                [2.0, 5.0],
                [8.0, 5.0],
                [8.0, -1.0],
                [6.0, -1.0],
                [6.0, 3.0],
                [4.0, 3.0],
                [4.0, -1.0],
            ],
            height_m: None,
        };
        for turned in [false, true] {
            if turned {
                foliage.polygon_m.reverse();
            }
            for (from_m, to_m, expected_m) in [
                ([0.0, 0.0, 1.0], [10.0, 0.0, 1.0], 4.0),
                ([3.0, 0.0, 1.0], [7.0, 0.0, 1.0], 2.0),
                ([5.0, 0.0, 1.0], [5.0, 0.0, 9.0], 0.0),
                ([7.0, 0.0, 1.0], [7.0, 0.0, 9.0], 8.0),
                ([0.0, 4.0, 1.0], [10.0, 4.0, 1.0], 6.0),
                ([0.0, 6.0, 1.0], [10.0, 6.0, 1.0], 0.0),
                ([3.0, 1.0, 1.0], [3.0, 4.0, 1.0], 3.0),
                ([0.0, 5.0, 0.0], [5.0, 0.0, 0.0], 2.0 * std::f64::consts::SQRT_2),
            ] {
                let got = path(from_m, to_m).length_within_m(&foliage);
                let back = path(to_m, from_m).length_within_m(&foliage);
                assert!((got - expected_m).abs() < 1e-12, "{from_m:?} {to_m:?}: {got}");
                assert!((back - expected_m).abs() < 1e-12, "{to_m:?} {from_m:?}: {back}");
            }
        }
        // The path rises as it goes: up to 3 m it has gone from x = 2 to 3 within the first trunk, 1 m and 1 m up.
        foliage.height_m = Some(3.0);
        let rising = path([0.0, 0.0, 0.0], [10.0, 0.0, 10.0]);
        assert!((rising.length_within_m(&foliage) - std::f64::consts::SQRT_2).abs() < 1e-12);
        assert_eq!(path([0.0, 0.0, 4.0], [10.0, 0.0, 4.0]).length_within_m(&foliage), 0.0);
    }

    #[test]
    fn edges_stand_above_or_below_the_path() {
        let path = path([0.0, 0.0, 1.0], [10.0, 0.0, 3.0]);
        let low = wall([5.0, -1.0], [5.0, 1.0], Some(2.5));
        assert_eq!(path.edge_of_wall(&low), Some((0.5, 0.5)));
        assert_eq!(path.edge_of_wall(&wall([5.0, -1.0], [5.0, 1.0], None)), None);
        assert_eq!(path.edge_of_wall(&wall([5.0, 1.0], [5.0, 2.0], Some(9.0))), None);
        assert_eq!(path.edge_of_wall(&wall([0.0, 0.0], [9.0, 0.0], Some(9.0))), None, "along it");
        let round = Obstacle {
            name: None,
            centre_m: [5.0, 0.0],
            radius_m: 2.0,
            height_m: Some(1.0),
            material: None,
        };
        assert_eq!(path.edge_of_obstacle(&round), Some((0.5, -1.0)));
    }

    proptest! {
        #[test]
        fn a_grid_finds_the_same_blockers(
            places in prop::collection::vec(prop::array::uniform3(-9.0..9.0f64), 2..60),
            body_radius_m in 0.05..1.0f64,
        ) {
            let agents: Vec<End> =
                (0..).zip(&places).map(|(id, &position_m)| End::new(MoteId(id), position_m)).collect();
            let mut grid = Grid::default();
            grid.build_for(&agents, 4);
            let without = Scene { agents: &agents, ..Scene::default() };
            let with = Scene { agents: &agents, grid: Some(grid), ..Scene::default() };
            let link = |scene| Link {
                sender: agents[0],
                receiver: agents[1],
                distance_m: 1.0,
                channel: None,
                frequency_hz: 2.44e9,
                time_ns: 0,
                scene,
            };
            prop_assert_eq!(
                is_blocked_by_body(&link(&without), body_radius_m),
                is_blocked_by_body(&link(&with), body_radius_m)
            );
        }
    }

    #[test]
    fn the_distance_to_a_path_is_to_its_nearest_point() {
        let path = path([0.0, 0.0, 0.0], [10.0, 0.0, 0.0]);
        assert_eq!(path.distance_squared_m2([5.0, 3.0, 4.0]), 25.0);
        assert_eq!(path.distance_squared_m2([-3.0, 4.0, 0.0]), 25.0);
    }
}
