//! A hill.

use super::super::POINT;
use crate::config::{Default, Field, Kind, Range, TableSpec};
use serde::{Deserialize, Serialize};

/// Description of `[[site.terrain]]`.
pub(super) const SPEC: TableSpec = TableSpec {
    doc: "A hill, or a hollow if the height is negative: height_m × e^(−d² / (2 radius_m²)) at distance d. Several hills \
          add up.",
    fields: &[
        Field {
            key: "centre_m",
            doc: "Position of the top (x, y in m).",
            kind: POINT,
            default: Default::Required,
        },
        Field {
            key: "height_m",
            doc: "Its height (m).",
            kind: Kind::Number(Range::closed(-1e4, 1e4)),
            default: Default::Required,
        },
        Field {
            key: "radius_m",
            doc: "Distance from the top at which it is steepest (m).",
            kind: Kind::Number(Range::LENGTH),
            default: Default::Required,
        },
    ],
    tag: None,
};

/// A hill or a hollow of Gaussian shape.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hill {
    /// Its top (m).
    pub centre_m: [f64; 2],
    /// Its height (m).
    pub height_m: f64,
    /// How far from its top it is steepest (m).
    pub radius_m: f64,
}

impl Hill {
    /// How steeply the ground rises towards the east and the north (m per m) because of it.
    #[must_use]
    pub fn gradient(&self, at_m: [f64; 2]) -> [f64; 2] {
        let square_m2 = self.radius_m * self.radius_m;
        let away_m = [at_m[0] - self.centre_m[0], at_m[1] - self.centre_m[1]];
        let distance_m2 = away_m[0] * away_m[0] + away_m[1] * away_m[1];
        let height_m = self.height_m * libm::exp(-0.5 * distance_m2 / square_m2);
        away_m.map(|part| -height_m * part / square_m2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hill_is_steepest_at_its_radius_and_falls_away_from_its_top() {
        let hill = Hill { centre_m: [1.0, 2.0], height_m: 3.0, radius_m: 5.0 };
        assert_eq!(hill.gradient([1.0, 2.0]), [0.0, 0.0]);
        // −h / r e^(−1/2) at one radius.
        let steepest = -3.0 / 5.0 * (-0.5f64).exp();
        let [east, north] = hill.gradient([6.0, 2.0]);
        assert!((east - steepest).abs() < 1e-15 && north == 0.0, "{east} {north}");
        for away_m in [2.0, 4.0, 6.0, 9.0] {
            assert!(steepest <= hill.gradient([1.0, 2.0 + away_m])[1]);
        }
    }
}
