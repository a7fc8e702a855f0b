//! A way through given points.

/// The point (m) at `length_m` along the straight lines from point to point; at the end of an open way its last point. A
/// closed way goes on from the last point to the first. Of at least two points.
pub(crate) fn point_at(points: &[[f64; 2]], is_closed: bool, length_m: f64) -> [f64; 2] {
    let n_lines = if is_closed { points.len() } else { points.len() - 1 };
    let line = |index: usize| (points[index], points[(index + 1) % points.len()]);
    let length_of = |index: usize| {
        let (from, to) = line(index);
        libm::hypot(to[0] - from[0], to[1] - from[1])
    };
    let whole_m: f64 = (0..n_lines).map(length_of).sum();
    let mut left_m = if is_closed && 0.0 < whole_m {
        length_m - whole_m * libm::floor(length_m / whole_m)
    } else {
        length_m
    };
    for index in 0..n_lines {
        let (length_m, (from, to)) = (length_of(index), line(index));
        if left_m < length_m {
            let share = left_m / length_m;
            return [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])];
        }
        left_m -= length_m;
    }
    line(n_lines - 1).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_is_gone_at_its_length_and_a_closed_one_again() {
        let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        assert_eq!(point_at(&square, false, 3.0), [2.0, 1.0]);
        assert_eq!(point_at(&square, false, 99.0), [0.0, 2.0]);
        assert_eq!(point_at(&square, true, 7.0), [0.0, 1.0]);
        assert_eq!(point_at(&square, true, 8.0 + 1.0), [1.0, 0.0]);
    }
}
