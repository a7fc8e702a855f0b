//! The straight line nearest to some points of the plane.
//!
//! Two readings of "least squares": the sum of squared *vertical* distances to y = m x + c, which is what the line
//! formation of the BotNet paper prints, or of squared *orthogonal* distances, which does not depend on where east is.

use proto::config::Choice;

/// Which distances are to be small.
///
/// Vertical ones: ordinary least squares of y on x. Orthogonal ones: total least squares, Pearson 1901.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fit {
    /// Along y, as the BotNet paper prints.
    Vertical,
    /// Across the line.
    Orthogonal,
}

/// Second moments of some points about their centroid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moments {
    /// Centroid (m).
    pub centroid_m: [f64; 2],
    /// Sum of squared x deviations (m²).
    pub xx_m2: f64,
    /// Sum of products of deviations (m²).
    pub xy_m2: f64,
    /// Sum of squared y deviations (m²).
    pub yy_m2: f64,
}

impl Moments {
    /// The moments of weighted points, in two passes so that no digits cancel. `visit` calls its argument with x (m),
    /// y (m) and weight of each point, the same both times. `None` if there are no points.
    pub fn accumulate(mut visit: impl FnMut(&mut dyn FnMut(f64, f64, f64))) -> Option<Self> {
        let (mut weight, mut x, mut y) = (0.0, 0.0, 0.0);
        let (mut largest_x_m, mut largest_y_m) = (0.0f64, 0.0f64);
        visit(&mut |x_m, y_m, w| {
            weight += w;
            x += w * x_m;
            y += w * y_m;
            largest_x_m = largest_x_m.max(x_m.abs());
            largest_y_m = largest_y_m.max(y_m.abs());
        });
        if weight <= 0.0 {
            return None;
        }
        let centroid_m = [x / weight, y / weight];
        let (mut xx_m2, mut xy_m2, mut yy_m2) = (0.0, 0.0, 0.0);
        visit(&mut |x_m, y_m, w| {
            let (dx, dy) = (x_m - centroid_m[0], y_m - centroid_m[1]);
            xx_m2 += w * dx * dx;
            xy_m2 += w * dx * dy;
            yy_m2 += w * dy * dy;
        });
        // A spread no larger than the rounding of the centroid is none.
        let rounding_m2 = |largest_m: f64| {
            let rounding_m = 4.0 * f64::EPSILON * largest_m;
            weight * rounding_m * rounding_m
        };
        if xx_m2 <= rounding_m2(largest_x_m) {
            (xx_m2, xy_m2) = (0.0, 0.0);
        }
        if yy_m2 <= rounding_m2(largest_y_m) {
            (yy_m2, xy_m2) = (0.0, 0.0);
        }
        Some(Self { centroid_m, xx_m2, xy_m2, yy_m2 })
    }

    /// Direction (unit vector) of the line nearest to the points; it passes through their centroid. `None` if the points
    /// coincide, so that any line would do.
    ///
    /// # Model
    ///
    /// Vertical: slope m = S_xy / S_xx, as the direction (S_xx, S_xy), normalised. Orthogonal: the principal axis, at the
    /// angle ½ atan2(2 S_xy, S_xx − S_yy).
    ///
    /// # Validity
    ///
    /// Where all points stand one above the other (S_xx / S_yy below 1e-24, which is rounding) S_xy / S_xx has no value:
    /// every slope leaves vertical distances that the slope cannot reduce. Both rules then give the upright line, which is
    /// the limit of the orthogonal fit and the only one that all points lie on. The code published with the BotNet paper
    /// has no such rule.
    #[must_use]
    pub fn direction(&self, fit: Fit) -> Option<[f64; 2]> {
        let Self { xx_m2: xx, xy_m2: xy, yy_m2: yy, .. } = *self;
        if xx <= 0.0 && yy <= 0.0 {
            return None;
        }
        if xx <= 1e-24 * yy {
            return Some([0.0, 1.0]);
        }
        Some(match fit {
            Fit::Vertical => {
                let length = libm::hypot(xx, xy);
                [xx / length, xy / length]
            }
            Fit::Orthogonal => {
                let angle_rad = 0.5 * libm::atan2(2.0 * xy, xx - yy);
                [libm::cos(angle_rad), libm::sin(angle_rad)]
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn direction(points: &[[f64; 2]], fit: Fit) -> Option<[f64; 2]> {
        Moments::accumulate(|visit| points.iter().for_each(|p| visit(p[0], p[1], 1.0)))?
            .direction(fit)
    }

    #[test]
    fn the_vertical_rule_has_the_slope_of_ordinary_least_squares() {
        // By hand: S_xy / S_xx = 7.75 / 8.75. All numbers but the quotient are exact.
        let points = [[0.0, 1.0], [1.0, 3.0], [2.0, 2.0], [4.0, 5.0]];
        let [dx, dy] = direction(&points, Fit::Vertical).unwrap();
        assert!((dy / dx - 7.75 / 8.75).abs() < 1e-15, "{}", dy / dx);
    }

    #[test]
    fn points_above_each_other_have_an_upright_line_under_both_rules() {
        let points = [[0.1, 0.0], [0.1, 2.0], [0.1, -7.3]];
        assert_eq!(direction(&points, Fit::Vertical), Some([0.0, 1.0]));
        assert_eq!(direction(&points, Fit::Orthogonal), Some([0.0, 1.0]));
    }

    #[test]
    fn points_that_coincide_have_no_line() {
        assert_eq!(direction(&[[0.1, 0.3]; 3], Fit::Vertical), None);
        assert_eq!(direction(&[], Fit::Orthogonal), None);
    }

    proptest! {
        #[test]
        fn points_on_a_line_give_that_line_under_both_rules(
            angle_rad in -1.5f64..1.5, along_m in prop::collection::vec(-50f64..50.0, 2..20)
        ) {
            let spread = along_m.iter().fold(0.0f64, |max, a| max.max((a - along_m[0]).abs()));
            prop_assume!(0.1 < spread);
            let (sin, cos) = (libm::sin(angle_rad), libm::cos(angle_rad));
            let points: Vec<[f64; 2]> = along_m.iter().map(|a| [a * cos, a * sin]).collect();
            for fit in [Fit::Vertical, Fit::Orthogonal] {
                let [dx, dy] = direction(&points, fit).unwrap();
                // Rounding of points up to 50 m (1e-14 m) over a spread of at least 0.1 m, and over cos 1.5 = 0.07
                // for the vertical rule.
                prop_assert!((dx * sin - dy * cos).abs() < 1e-10, "{fit:?} {dx} {dy}");
            }
        }

        #[test]
        fn no_other_direction_has_smaller_orthogonal_distances(
            points in prop::collection::vec(prop::array::uniform2(-5f64..5.0), 2..9), other_rad in 0f64..3.2
        ) {
            let moments = Moments::accumulate(|visit| points.iter().for_each(|p| visit(p[0], p[1], 1.0))).unwrap();
            let cost = |d: [f64; 2]| {
                moments.xx_m2 * d[1] * d[1] - 2.0 * moments.xy_m2 * d[0] * d[1] + moments.yy_m2 * d[0] * d[0]
            };
            let best = moments.direction(Fit::Orthogonal).unwrap();
            // Costs are up to 9 * 50 m²: rounding is below 1e-11.
            prop_assert!(cost(best) <= cost([libm::cos(other_rad), libm::sin(other_rad)]) + 1e-11);
        }
    }
}
