//! The place: walls, obstacles and ground. Both simulators read the same one, from the `[site]` section.

mod foliage;
mod terrain;

pub use foliage::Foliage;
pub use terrain::{Grid, HeightNet, Hill, Terrain};

use crate::config::{self, Default, Field, Kind, Node, Problem, Range, TableSpec};
use crate::types::AgentStates;
use serde::{Deserialize, Serialize};

const POINT: Kind = Kind::List { of: &Kind::Number(Range::PLACE), min: 2, max: 2 };

/// Description of `[site]`.
pub const SPEC: TableSpec = TableSpec {
    doc: "The environment that robots and radio share.",
    fields: &[
        Field {
            key: "wall",
            doc: "Straight, vertical, thin walls.",
            kind: Kind::Tables(&WALL),
            default: Default::Absent,
        },
        Field {
            key: "obstacle",
            doc: "Vertical cylindrical obstacles.",
            kind: Kind::Tables(&OBSTACLE),
            default: Default::Absent,
        },
        Field {
            key: "foliage",
            doc: "Areas of trees and bushes, as polygons.",
            kind: Kind::Tables(&foliage::SPEC),
            default: Default::Absent,
        },
        Field {
            key: "terrain",
            doc: "The terrain: hills on a plane (`[[site.terrain]]`), or heights on a grid (`[site.terrain]`).",
            kind: terrain::KIND,
            default: Default::Absent,
        },
    ],
    tag: None,
};

const WALL: TableSpec = TableSpec {
    doc: "A straight wall.",
    fields: &[
        Field {
            key: "from_m",
            doc: "One end (x, y in m).",
            kind: POINT,
            default: Default::Required,
        },
        Field {
            key: "to_m",
            doc: "The other end (x, y in m).",
            kind: POINT,
            default: Default::Required,
        },
        Field {
            key: "height_m",
            doc: "Height above ground (m). Absent: unlimited.",
            kind: Kind::Number(Range::LENGTH),
            default: Default::Absent,
        },
        Field {
            key: "material",
            doc: "Material, for effects that act only on walls of one material.",
            kind: Kind::Text,
            default: Default::Absent,
        },
    ],
    tag: None,
};

const OBSTACLE: TableSpec = TableSpec {
    doc: "A round obstacle.",
    fields: &[
        Field {
            key: "name",
            doc: "Unique name, by which `[[robotsim.obstacle]]` refers to it.",
            kind: Kind::Text,
            default: Default::Absent,
        },
        Field {
            key: "centre_m",
            doc: "Its centre (x, y in m).",
            kind: POINT,
            default: Default::Required,
        },
        Field {
            key: "radius_m",
            doc: "Its radius (m).",
            kind: Kind::Number(Range::LENGTH),
            default: Default::Required,
        },
        Field {
            key: "height_m",
            doc: "Height above ground (m). Absent: unlimited.",
            kind: Kind::Number(Range::LENGTH),
            default: Default::Absent,
        },
        Field {
            key: "material",
            doc: "Material. No built-in effect depends on the material of obstacles.",
            kind: Kind::Text,
            default: Default::Absent,
        },
    ],
    tag: None,
};

/// The place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, std::default::Default)]
pub struct Site {
    /// Walls.
    #[serde(default)]
    pub wall: Vec<Wall>,
    /// Obstacles.
    #[serde(default)]
    pub obstacle: Vec<Obstacle>,
    /// Trees and bushes.
    #[serde(default)]
    pub foliage: Vec<Foliage>,
    /// The ground.
    #[serde(default)]
    pub terrain: Terrain,
}

/// A straight, upright, thin wall.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wall {
    /// One end (m).
    pub from_m: [f64; 2],
    /// The other end (m).
    pub to_m: [f64; 2],
    /// Height above ground (m); none: unlimited.
    pub height_m: Option<f64>,
    /// What it is made of.
    pub material: Option<String>,
}

/// A round, upright obstacle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Obstacle {
    /// Its name.
    pub name: Option<String>,
    /// Its centre (m).
    pub centre_m: [f64; 2],
    /// Its radius (m).
    pub radius_m: f64,
    /// Height above ground (m); none: unlimited.
    pub height_m: Option<f64>,
    /// What it is made of.
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
    let mut written = table.clone();
    let terrain = written.remove("terrain").map(Terrain::of_checked).unwrap_or_default();
    let site: Site = written.try_into().expect("a checked table has the site's shape");
    let site = Site { terrain, ..site };
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
