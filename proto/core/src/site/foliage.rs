//! Trees and bushes.

use crate::config::{Problem, Range, Section};
use serde::{Deserialize, Serialize};

/// An area with trees or bushes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Section)]
pub struct Foliage {
    /// Its corners (x, y in m), in order along the boundary.
    #[key(range = Range::PLACE, length = 3..=1000, required)]
    pub polygon_m: Vec<[f64; 2]>,
    /// Height above ground (m). Absent: unlimited.
    #[key(range = Range::LENGTH)]
    pub height_m: Option<f64>,
}

impl Foliage {
    /// Adds what is wrong with it, which stands at `path`.
    pub(super) fn check(&self, path: &str, problems: &mut Vec<Problem>) {
        if let Some((a, b)) = self.crossing() {
            problems.push(Problem::new(
                format!("{path}.polygon_m"),
                format!("must not cross itself: the sides from corners {a} and {b} do"),
            ));
        }
    }

    /// Two sides that touch each other though they are not neighbours, by their first corners, if there are any.
    fn crossing(&self) -> Option<(usize, usize)> {
        let corner = |i: usize| self.polygon_m[i % self.polygon_m.len()];
        let n = self.polygon_m.len();
        let turn = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        let within = |a: f64, b: f64, x: f64| a.min(b) <= x && x <= a.max(b);
        let touches = |i: usize, j: usize| {
            let (a, b, c, d) = (corner(i), corner(i + 1), corner(j), corner(j + 1));
            let [abc, abd] = [turn(a, b, c), turn(a, b, d)];
            let [cda, cdb] = [turn(c, d, a), turn(c, d, b)];
            let on = |turn: f64, a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
                turn == 0.0 && within(a[0], b[0], c[0]) && within(a[1], b[1], c[1])
            };
            (abc * abd < 0.0 && cda * cdb < 0.0)
                || on(abc, a, b, c)
                || on(abd, a, b, d)
                || on(cda, c, d, a)
                || on(cdb, c, d, b)
        };
        (0..n).find_map(|i| {
            // The last side is a neighbour of the first.
            let last = if i == 0 { n - 1 } else { n };
            (i + 2..last).find(|&j| touches(i, j)).map(|j| (i, j))
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::config;
    use crate::site::read;

    #[test]
    fn foliage_that_crosses_itself_is_refused() {
        let problems_of = |corners: &str| {
            let node = config::parse(&format!("[[foliage]]\npolygon_m = {corners}\n")).unwrap();
            let mut problems = Vec::new();
            read(&node, "site", &mut problems);
            problems.iter().map(ToString::to_string).collect::<String>()
        };
        assert_eq!(problems_of("[[0, 0], [4, 0], [4, 4], [0, 4]]"), "");
        assert_eq!(problems_of("[[0, 0], [4, 0], [2, 3]]"), "");
        assert_eq!(
            problems_of("[[0, 0], [4, 4], [4, 0], [0, 4]]"),
            "site.foliage[0].polygon_m: must not cross itself: the sides from corners 0 and 2 do"
        );
        assert!(problems_of("[[0, 0], [4, 0]]").contains("polygon_m"));
    }
}
