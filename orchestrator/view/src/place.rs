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
        ..view::Wall::default()
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

/// Adds what effects have in certain places: between two ends, or around a centre.
pub(crate) fn add_effects<'a>(
    place: &mut view::Place,
    effects: impl IntoIterator<Item = &'a toml::Table>,
    kind: view::ObstacleKind,
) {
    for effect in effects {
        let name = effect.get("kind").and_then(toml::Value::as_str).unwrap_or_default();
        let point = |key: &str| -> Option<[f32; 2]> {
            let number = |value: &toml::Value| {
                value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
            };
            let [x, y] = effect.get(key)?.as_array()?.as_slice() else { return None };
            Some([number(x)? as f32, number(y)? as f32])
        };
        let radius_m = effect.get("radius_m").and_then(toml::Value::as_float);
        if let (Some([x_m, y_m]), Some(radius_m)) = (point("centre_m"), radius_m) {
            let (name, radius_m) = (name.to_owned(), radius_m as f32);
            place.obstacles.push(view::Obstacle { name, x_m, y_m, radius_m, kind: kind.into() });
        }
        if let (Some(from), Some(to)) = (point("from_m"), point("to_m")) {
            place.walls.push(view::Wall {
                from_x_m: from[0],
                from_y_m: from[1],
                to_x_m: to[0],
                to_y_m: to[1],
                kind: kind.into(),
                name: name.to_owned(),
            });
        }
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
