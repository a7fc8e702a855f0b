//! The place: walls, obstacles and ground. Both simulators read the same one, from the `[site]` section.

mod foliage;
mod terrain;

pub use foliage::Foliage;
pub use terrain::{Grid, HeightNet, Hill, Terrain};

use crate::config::{self, Node, Problem, Range, Section, TableSpec};
use crate::types::AgentStates;
use serde::{Deserialize, Serialize};

/// Description of `[site]`.
pub const SPEC: TableSpec = Site::SPEC;

/// The environment that robots and radio share.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Default, Section)]
pub struct Site {
    /// Straight, vertical, thin walls.
    #[serde(default)]
    pub wall: Vec<Wall>,
    /// Vertical cylindrical obstacles.
    #[serde(default)]
    pub obstacle: Vec<Obstacle>,
    /// Areas of trees and bushes, as polygons.
    #[serde(default)]
    pub foliage: Vec<Foliage>,
    /// The terrain: hills on a plane (`[[site.terrain]]`), or heights on a grid (`[site.terrain]`).
    #[key(absent)]
    #[serde(default)]
    pub terrain: Terrain,
}

/// A straight wall.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Section)]
pub struct Wall {
    /// One end (x, y in m).
    #[key(range = Range::PLACE)]
    pub from_m: [f64; 2],
    /// The other end (x, y in m).
    #[key(range = Range::PLACE)]
    pub to_m: [f64; 2],
    /// Height above ground (m). Absent: unlimited.
    #[key(range = Range::LENGTH)]
    pub height_m: Option<f64>,
    /// Material, for effects that act only on walls of one material.
    pub material: Option<String>,
}

/// A round obstacle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Section)]
pub struct Obstacle {
    /// Unique name, by which `[[robotsim.obstacle]]` refers to it.
    pub name: Option<String>,
    /// Its centre (x, y in m).
    #[key(range = Range::PLACE)]
    pub centre_m: [f64; 2],
    /// Its radius (m).
    #[key(range = Range::LENGTH)]
    pub radius_m: f64,
    /// Height above ground (m). Absent: unlimited.
    #[key(range = Range::LENGTH)]
    pub height_m: Option<f64>,
    /// Material. No built-in effect depends on the material of obstacles.
    pub material: Option<String>,
}

impl Site {
    /// The corners (least and greatest x, y in m) of the rectangle around all that stands in the place and around all agents.
    #[must_use]
    pub fn extent_m(&self, states: &AgentStates) -> [[f64; 2]; 2] {
        let walls = self.wall.iter().flat_map(|wall| [wall.from_m, wall.to_m]);
        let obstacles = self.obstacle.iter().map(|obstacle| obstacle.centre_m);
        let foliage = self.foliage.iter().flat_map(|foliage| foliage.polygon_m.iter().copied());
        let agents = states.x_m.iter().zip(&states.y_m).map(|(x, y)| [*x, *y]);
        let mut corners = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        for place in walls.chain(obstacles).chain(foliage).chain(agents) {
            for axis in 0..2 {
                corners[0][axis] = corners[0][axis].min(place[axis]);
                corners[1][axis] = corners[1][axis].max(place[axis]);
            }
        }
        corners
    }
}

/// Reads `[site]`, which stands at `path`. The site is returned with its effective table, even where there were problems.
pub fn read(node: &Node, path: &str, problems: &mut Vec<Problem>) -> (Site, toml::Table) {
    let before = problems.len();
    let table = config::check(node, path, &SPEC, &config::Lists::NONE, problems).table;
    if problems.len() != before {
        return (Site::default(), table);
    }
    let site = Site::read(&table);
    for (index, wall) in site.wall.iter().enumerate() {
        if wall.from_m == wall.to_m {
            problems.push(
                Problem::new(
                    format!("{}[{index}].to_m", config::join(path, "wall")),
                    "must differ from from_m: a wall has a length",
                )
                .value(format!("{:?}", wall.to_m)),
            );
        }
    }
    for (index, obstacle) in site.obstacle.iter().enumerate() {
        if let Some(name) = &obstacle.name
            && site.obstacle[..index].iter().any(|other| other.name.as_ref() == Some(name))
        {
            problems.push(
                Problem::new(
                    format!("{}[{index}].name", config::join(path, "obstacle")),
                    "must be unique",
                )
                .value(format!("{name:?}")),
            );
        }
    }
    for (index, foliage) in site.foliage.iter().enumerate() {
        foliage.check(&format!("{}[{index}]", config::join(path, "foliage")), problems);
    }
    site.terrain.check(&config::join(path, "terrain"), problems);
    (site, table)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_of_no_length_is_refused() {
        let node = config::parse("[[wall]]\nfrom_m = [1, 2]\nto_m = [1.0, 2.0]\n").unwrap();
        let mut problems = Vec::new();
        read(&node, "site", &mut problems);
        assert_eq!(
            problems[0].to_string(),
            "site.wall[0].to_m: must differ from from_m: a wall has a length, got [1.0, 2.0]"
        );
    }
}
