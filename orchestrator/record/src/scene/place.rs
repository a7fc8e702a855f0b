//! What stands still in a scene: walls, obstacles, foliage and ground.

use super::{WORLD, foxglove, timestamp};
use proto::site::{Site, Terrain};

/// What has no height stands as high as this (m).
const UNLIMITED_M: f64 = 3.0;
/// Thickness of a drawn wall (m).
const WALL_M: f64 = 0.1;
/// Squares of the ground along each side.
const SQUARES: usize = 48;
/// How far the ground reaches beyond what stands on it (m).
const MARGIN_M: f64 = 5.0;

const WALL: [f64; 4] = [0.45, 0.45, 0.45, 1.0];
const OBSTACLE: [f64; 4] = [0.8, 0.47, 0.65, 0.9];
const FOLIAGE: [f64; 4] = [0.0, 0.62, 0.45, 0.9];
const GROUND: [f64; 4] = [0.75, 0.72, 0.66, 1.0];

pub(super) fn colour([r, g, b, a]: [f64; 4]) -> foxglove::Color {
    foxglove::Color { r, g, b, a }
}

pub(super) fn point([x, y, z]: [f64; 3]) -> foxglove::Point3 {
    foxglove::Point3 { x, y, z }
}

/// A place, turned about the vertical.
pub(super) fn pose([x, y, z]: [f64; 3], heading_rad: f64) -> foxglove::Pose {
    let (sin, cos) = libm::sincos(0.5 * heading_rad);
    foxglove::Pose {
        position: Some(foxglove::Vector3 { x, y, z }),
        orientation: Some(foxglove::Quaternion { x: 0.0, y: 0.0, z: sin, w: cos }),
    }
}

/// An entity that holds nothing yet.
pub(super) fn entity(id: &str, time_ns: u64) -> foxglove::SceneEntity {
    foxglove::SceneEntity {
        timestamp: Some(timestamp(time_ns)),
        frame_id: WORLD.to_owned(),
        id: id.to_owned(),
        ..foxglove::SceneEntity::default()
    }
}

/// All that stands still.
pub(super) fn entities(site: &Site, extent_m: [[f64; 2]; 2]) -> Vec<foxglove::SceneEntity> {
    let mut entities = vec![walls(site), obstacles(site, 0)];
    if !site.foliage.is_empty() {
        entities.push(foliage(site));
    }
    if !site.terrain.is_level() {
        entities.push(ground(&site.terrain, extent_m));
    }
    entities
}

fn walls(site: &Site) -> foxglove::SceneEntity {
    let cubes = site.wall.iter().map(|wall| {
        let [dx, dy] = [0, 1].map(|axis| wall.to_m[axis] - wall.from_m[axis]);
        let height_m = wall.height_m.unwrap_or(UNLIMITED_M);
        let [x, y] = [0, 1].map(|axis| 0.5 * (wall.to_m[axis] + wall.from_m[axis]));
        foxglove::CubePrimitive {
            pose: Some(pose([x, y, 0.5 * height_m], libm::atan2(dy, dx))),
            size: Some(foxglove::Vector3 { x: libm::hypot(dx, dy), y: WALL_M, z: height_m }),
            color: Some(colour(WALL)),
        }
    });
    foxglove::SceneEntity { cubes: cubes.collect(), ..entity("walls", 0) }
}

/// The round obstacles, where they are.
pub(super) fn obstacles(site: &Site, time_ns: u64) -> foxglove::SceneEntity {
    let cylinders = site.obstacle.iter().map(|obstacle| {
        let height_m = obstacle.height_m.unwrap_or(UNLIMITED_M);
        let [x, y] = obstacle.centre_m;
        let across_m = 2.0 * obstacle.radius_m;
        foxglove::CylinderPrimitive {
            pose: Some(pose([x, y, 0.5 * height_m], 0.0)),
            size: Some(foxglove::Vector3 { x: across_m, y: across_m, z: height_m }),
            bottom_scale: 1.0,
            top_scale: 1.0,
            color: Some(colour(OBSTACLE)),
        }
    });
    foxglove::SceneEntity { cylinders: cylinders.collect(), ..entity("obstacles", time_ns) }
}

/// The outline of each area, on the ground and at its height.
fn foliage(site: &Site) -> foxglove::SceneEntity {
    let outlines = site.foliage.iter().flat_map(|foliage| {
        [0.0, foliage.height_m.unwrap_or(UNLIMITED_M)].map(|z_m| foxglove::LinePrimitive {
            r#type: foxglove::line_primitive::Type::LineLoop.into(),
            pose: Some(pose([0.0; 3], 0.0)),
            thickness: 2.0,
            scale_invariant: true,
            points: foliage.polygon_m.iter().map(|&[x, y]| point([x, y, z_m])).collect(),
            color: Some(colour(FOLIAGE)),
            colors: Vec::new(),
            indices: Vec::new(),
        })
    });
    foxglove::SceneEntity { lines: outlines.collect(), ..entity("foliage", 0) }
}

/// The ground as a net of triangles. Only differences of height are known: the lowest corner of the net has height 0.
fn ground(terrain: &Terrain, [least_m, most_m]: [[f64; 2]; 2]) -> foxglove::SceneEntity {
    let net = terrain.net([least_m.map(|m| m - MARGIN_M), most_m.map(|m| m + MARGIN_M)], SQUARES);
    let n = SQUARES + 1;
    let points = (0..n * n).map(|k| {
        let (row, column) = (k / n, k % n);
        point([net.x_m(column), net.y_m(row), net.height_m[k]])
    });
    let squares = (0..SQUARES * SQUARES).map(|k| (k / SQUARES * n + k % SQUARES) as u32);
    let n = n as u32;
    let indices = squares.flat_map(|at| [at, at + 1, at + n, at + 1, at + n + 1, at + n]);
    let triangles = foxglove::TriangleListPrimitive {
        pose: Some(pose([0.0; 3], 0.0)),
        points: points.collect(),
        color: Some(colour(GROUND)),
        colors: Vec::new(),
        indices: indices.collect(),
    };
    foxglove::SceneEntity { triangles: vec![triangles], ..entity("ground", 0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_lies_between_its_ends_and_as_high_as_it_is() {
        let site: Site =
            toml::from_str("[[wall]]\nfrom_m = [1.0, 2.0]\nto_m = [1.0, 6.0]\nheight_m = 2.0\n")
                .unwrap();
        let cube = &walls(&site).cubes[0];
        let at = cube.pose.unwrap();
        assert_eq!(at.position.unwrap(), foxglove::Vector3 { x: 1.0, y: 4.0, z: 1.0 });
        let size = cube.size.unwrap();
        assert_eq!((size.x, size.z), (4.0, 2.0));
        // A quarter turn.
        let turn = at.orientation.unwrap();
        assert!((turn.z - turn.w).abs() < 1e-12 && (turn.z * turn.z * 2.0 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_ground_rises_as_its_gradient_says() {
        let site: Site = toml::from_str(
            "[terrain]\nHills = [{ centre_m = [0.0, 0.0], height_m = 4.0, radius_m = 10.0 }]\n",
        )
        .unwrap();
        let entity = ground(&site.terrain, [[-20.0, -20.0], [20.0, 20.0]]);
        let heights: Vec<f64> = entity.triangles[0].points.iter().map(|point| point.z).collect();
        let highest_m = heights.iter().copied().fold(0.0, f64::max);
        assert!((highest_m - 4.0).abs() < 0.1, "{highest_m}");
        assert_eq!(entity.triangles[0].indices.len(), 6 * SQUARES * SQUARES);
    }
}
