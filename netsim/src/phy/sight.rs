//! What stands between two antennas: walls, obstacles, other bodies.

use super::link::{End, Link, distance_squared_m2};
use proto::site::{Obstacle, Wall};

/// The straight path between two points (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    from_m: [f64; 3],
    to_m: [f64; 3],
}

impl Path {
    /// The direct path of a link.
    #[must_use]
    pub fn of(link: &Link<'_>) -> Self {
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
        let step = [self.to_m[0] - self.from_m[0], self.to_m[1] - self.from_m[1]];
        let from_centre =
            [self.from_m[0] - obstacle.centre_m[0], self.from_m[1] - obstacle.centre_m[1]];
        // |from_centre + t step|^2 <= radius^2
        let a = dot(step, step);
        let b = dot(from_centre, step);
        let c = dot(from_centre, from_centre) - obstacle.radius_m * obstacle.radius_m;
        if a == 0.0 {
            return c <= 0.0 && self.is_below(obstacle.height_m, 0.0, 1.0);
        }
        let discriminant = b * b - a * c;
        if discriminant < 0.0 {
            return false;
        }
        let root = discriminant.sqrt();
        let (low, high) = (((-b - root) / a).max(0.0), ((-b + root) / a).min(1.0));
        low <= high && self.is_below(obstacle.height_m, low, high)
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
        let z = |t: f64| self.from_m[2] + t * (self.to_m[2] - self.from_m[2]);
        height_m.is_none_or(|height_m| z(low).min(z(high)) <= height_m)
    }
}

/// Whether a body of another agent, a ball of this radius around its antenna, touches the direct path.
#[must_use]
pub fn is_blocked_by_body(link: &Link<'_>, body_radius_m: f64) -> bool {
    let path = Path::of(link);
    let touches = |agent: &End| {
        agent.id != link.sender.id
            && agent.id != link.receiver.id
            && path.distance_squared_m2(agent.position_m) <= body_radius_m * body_radius_m
    };
    let agents = link.scene.agents;
    match &link.scene.grid {
        None => agents.iter().any(touches),
        Some(grid) => {
            let (a, b) = (path.from_m, path.to_m);
            let low = [a[0].min(b[0]) - body_radius_m, a[1].min(b[1]) - body_radius_m];
            let high = [a[0].max(b[0]) + body_radius_m, a[1].max(b[1]) + body_radius_m];
            grid.in_box(low, high).any(|place| touches(&agents[place as usize]))
        }
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
    use crate::phy::link::Scene;
    use crate::phy::nearest::Grid;
    use proptest::prelude::*;

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

    proptest! {
        #[test]
        fn a_grid_finds_the_same_blockers(
            places in prop::collection::vec(prop::array::uniform3(-9.0..9.0f64), 2..60),
            body_radius_m in 0.05..1.0f64,
        ) {
            let agents: Vec<End> =
                (0..).zip(&places).map(|(id, &position_m)| End::at(id, position_m)).collect();
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
