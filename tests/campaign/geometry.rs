//! Lines, discs and polygons in the plane.

/// A point in the plane (m).
pub(crate) type Point = [f64; 2];

/// Where along the way from `a` to `b` (0 to 1) it crosses the segment from `c` to `d`.
pub(crate) fn crossing(a: Point, b: Point, c: Point, d: Point) -> Option<f64> {
    let way = [b[0] - a[0], b[1] - a[1]];
    let edge = [d[0] - c[0], d[1] - c[1]];
    let across = way[0] * edge[1] - way[1] * edge[0];
    if across == 0.0 {
        return None;
    }
    let from = [c[0] - a[0], c[1] - a[1]];
    let along = (from[0] * edge[1] - from[1] * edge[0]) / across;
    let on_edge = (from[0] * way[1] - from[1] * way[0]) / across;
    ((0.0..=1.0).contains(&along) && (0.0..=1.0).contains(&on_edge)).then_some(along)
}

/// Distance of a point from the line through `a` and `b` (m), and where along the way from `a` to `b` its foot lies (0 to 1
/// between them).
pub(crate) fn foot(a: Point, b: Point, point: Point) -> (f64, f64) {
    let way = [b[0] - a[0], b[1] - a[1]];
    let from = [point[0] - a[0], point[1] - a[1]];
    let square = (way[0] * way[0] + way[1] * way[1]).max(1e-12);
    let along = (from[0] * way[0] + from[1] * way[1]) / square;
    ((from[0] * way[1] - from[1] * way[0]).abs() / square.sqrt(), along)
}

/// Whether the way from `a` to `b` touches a disc.
pub(crate) fn touches(a: Point, b: Point, centre: Point, radius_m: f64) -> bool {
    let (_, along) = foot(a, b, centre);
    let along = along.clamp(0.0, 1.0);
    let nearest = [a[0] + along * (b[0] - a[0]), a[1] + along * (b[1] - a[1])];
    distance(nearest, centre) <= radius_m
}

/// Distance between two points (m).
pub(crate) fn distance(a: Point, b: Point) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Whether a point is inside a polygon: the even-odd rule.
fn is_inside(point: Point, polygon: &[Point]) -> bool {
    let edges = polygon.iter().zip(polygon.iter().cycle().skip(1));
    edges
        .filter(|(a, b)| {
            (point[1] < a[1]) != (point[1] < b[1])
                && point[0] < a[0] + (point[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
        })
        .count()
        % 2
        == 1
}

/// How much of the way from `a` to `b` is inside a polygon, as a share.
pub(crate) fn share_inside(a: Point, b: Point, polygon: &[Point]) -> f64 {
    let edges = polygon.iter().zip(polygon.iter().cycle().skip(1));
    let mut places: Vec<f64> = edges.filter_map(|(c, d)| crossing(a, b, *c, *d)).collect();
    places.extend([0.0, 1.0]);
    places.sort_by(f64::total_cmp);
    places
        .windows(2)
        .filter(|pair| {
            let middle = (pair[0] + pair[1]) / 2.0;
            is_inside([a[0] + middle * (b[0] - a[0]), a[1] + middle * (b[1] - a[1])], polygon)
        })
        .map(|pair| pair[1] - pair[0])
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_crosses_what_it_crosses() {
        assert_eq!(crossing([0.0, 0.0], [4.0, 0.0], [1.0, -1.0], [1.0, 1.0]), Some(0.25));
        assert_eq!(crossing([0.0, 0.0], [4.0, 0.0], [1.0, 1.0], [1.0, 2.0]), None);
        assert_eq!(crossing([0.0, 0.0], [4.0, 0.0], [0.0, 1.0], [4.0, 1.0]), None);
        assert!(touches([0.0, 0.0], [4.0, 0.0], [2.0, 1.0], 1.0));
        assert!(!touches([0.0, 0.0], [4.0, 0.0], [6.0, 0.0], 1.0));
        assert_eq!(foot([0.0, 0.0], [4.0, 0.0], [1.0, 3.0]), (3.0, 0.25));
    }

    #[test]
    fn a_path_is_inside_a_polygon_as_far_as_it_is() {
        let square = [[1.0, -1.0], [3.0, -1.0], [3.0, 1.0], [1.0, 1.0]];
        assert_eq!(share_inside([0.0, 0.0], [4.0, 0.0], &square), 0.5);
        assert_eq!(share_inside([0.0, 0.0], [2.0, 0.0], &square), 0.5);
        assert_eq!(share_inside([1.5, 0.0], [2.5, 0.0], &square), 1.0);
        assert_eq!(share_inside([0.0, 2.0], [4.0, 2.0], &square), 0.0);
    }
}
