//! The place as it is drawn.

use crate::view;
use proto::site::Site;
use proto::types::AgentStates;

/// Parts of the ground along each side.
const SQUARES: usize = 48;
/// How far the ground reaches beyond what stands on it (m).
const MARGIN_M: f64 = 5.0;

/// What stands in a site.
pub(crate) fn place(site: &Site, states: &AgentStates) -> view::Place {
    let walls = site.wall.iter().map(|wall| view::Wall {
        from_x_m: wall.from_m[0] as f32,
        from_y_m: wall.from_m[1] as f32,
        to_x_m: wall.to_m[0] as f32,
        to_y_m: wall.to_m[1] as f32,
    });
    let obstacles = site.obstacle.iter().map(|obstacle| view::Obstacle {
        name: obstacle.name.clone().unwrap_or_default(),
        x_m: obstacle.centre_m[0] as f32,
        y_m: obstacle.centre_m[1] as f32,
        radius_m: obstacle.radius_m as f32,
        kind: view::ObstacleKind::Unspecified.into(),
    });
    let foliage = site.foliage.iter().map(|foliage| view::Polygon {
        x_m: foliage.polygon_m.iter().map(|corner| corner[0] as f32).collect(),
        y_m: foliage.polygon_m.iter().map(|corner| corner[1] as f32).collect(),
    });
    view::Place {
        walls: walls.collect(),
        obstacles: obstacles.collect(),
        foliage: foliage.collect(),
        ground: ground(site, states),
    }
}

fn ground(site: &Site, states: &AgentStates) -> Option<view::Ground> {
    if site.terrain.is_level() {
        return None;
    }
    let [least_m, most_m] = site.extent_m(states);
    let corners_m = [least_m.map(|m| m - MARGIN_M), most_m.map(|m| m + MARGIN_M)];
    let net = site.terrain.net(corners_m, SQUARES);
    Some(view::Ground {
        x_m: net.from_m[0] as f32,
        y_m: net.from_m[1] as f32,
        dx_m: net.step_m[0] as f32,
        dy_m: net.step_m[1] as f32,
        columns: net.columns as u32,
        height_m: net.height_m.iter().map(|height_m| *height_m as f32).collect(),
    })
}
