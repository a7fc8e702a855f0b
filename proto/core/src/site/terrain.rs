//! The height of the ground.

mod grid;
mod hill;

pub use grid::Grid;
pub use hill::Hill;

use crate::config::{Kind, Problem};
use serde::{Deserialize, Serialize};

/// What `site.terrain` may be.
pub(super) const KIND: Kind = Kind::Either(&[Kind::Tables(&hill::SPEC), Kind::Table(&grid::SPEC)]);

/// The ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Terrain {
    /// Hills on a plane.
    Hills(Vec<Hill>),
    /// Heights that were measured.
    Grid(Grid),
}

impl Default for Terrain {
    /// A plane.
    fn default() -> Self {
        Self::Hills(Vec::new())
    }
}

impl Terrain {
    /// Of `site.terrain` as it is written, which was checked.
    pub(super) fn of_checked(written: toml::Value) -> Self {
        let shape = "a checked value has the terrain's shape";
        if written.is_array() {
            Self::Hills(written.try_into().expect(shape))
        } else {
            Self::Grid(written.try_into().expect(shape))
        }
    }

    /// How steeply the ground rises towards the east and the north (m per m) at a place.
    #[must_use]
    pub fn gradient(&self, at_m: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Hills(hills) => hills.iter().fold([0.0; 2], |[east, north], hill| {
                let rise = hill.gradient(at_m);
                [east + rise[0], north + rise[1]]
            }),
            Self::Grid(grid) => grid.gradient(at_m),
        }
    }

    /// Whether nothing is known of the ground: it is taken to be level.
    #[must_use]
    pub fn is_level(&self) -> bool {
        matches!(self, Self::Hills(hills) if hills.is_empty())
    }

    /// Adds what is wrong with it, which stands at `path`.
    pub(super) fn check(&self, path: &str, problems: &mut Vec<Problem>) {
        match self {
            Self::Hills(_) => {}
            Self::Grid(grid) => grid.check(path, problems),
        }
    }
}
