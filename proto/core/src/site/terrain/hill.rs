//! A hill.

use crate::config::{Range, Section};
use serde::{Deserialize, Serialize};

/// A hill, or a hollow if the height is negative: height_m × e^(−d² / (2 radius_m²)) at distance d. Several hills add up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Section)]
pub struct Hill {
    /// Position of the top (x, y in m).
    #[key(range = Range::PLACE)]
    pub centre_m: [f64; 2],
    /// Its height (m).
    #[key(range = -1e4..=1e4)]
    pub height_m: f64,
    /// Distance from the top at which it is steepest (m).
    #[key(range = Range::LENGTH)]
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
