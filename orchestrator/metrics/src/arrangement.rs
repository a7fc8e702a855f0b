//! Where robots are at one moment: how near to a line, a circle or a lattice, how wide, and how well they cover an area.

use super::hearing::HeardPeriod;
use super::lines;
use super::swarm::Groups;
use numbers::statistics::ratio;
use proto::types::AgentStates;
use std::collections::BTreeMap;

/// The robots that are alive at one moment, and where they are.
#[derive(Clone, Copy, Debug)]
pub struct Arrangement<'a>(pub(super) &'a AgentStates);

/// The circle that fits robots best, and how well it does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedCircle {
    /// Its radius (m).
    pub radius_m: f64,
    /// Root mean square distance of the robots from it (m).
    pub rms_m: f64,
    /// Greatest angle between two robots that are neighbours on it (rad): 2π/n if they stand evenly, almost 2π if all stand on
    /// one side.
    pub gap_rad: f64,
}

/// Points along each side of an area at which its coverage is measured.
const POINTS: usize = 100;

impl Arrangement<'_> {
    /// Root mean square distance of alive agents from their centroid (m).
    #[must_use]
    pub fn spread_m(&self) -> Option<f64> {
        let states = self.0;
        let alive: Vec<usize> = states.alive.iter_ones().collect();
        let n = alive.len() as f64;
        let mut sum = 0.0;
        for column in [&states.x_m, &states.y_m, &states.z_m] {
            let centre = ratio(alive.iter().map(|&agent| column[agent]).sum(), n)?;
            sum += alive
                .iter()
                .map(|&agent| (column[agent] - centre) * (column[agent] - centre))
                .sum::<f64>();
        }
        ratio(sum, n).map(libm::sqrt)
    }

    /// Sum of the squared vertical distances (m²) of alive agents from the line y = a + b x that makes it
    /// least. `None` where their x do not differ.
    #[must_use]
    pub fn line_residual_m2(&self) -> Option<f64> {
        let states = self.0;
        let alive: Vec<usize> = states.alive.iter_ones().collect();
        let n = alive.len() as f64;
        let x0 = ratio(alive.iter().map(|&agent| states.x_m[agent]).sum(), n)?;
        let y0 = ratio(alive.iter().map(|&agent| states.y_m[agent]).sum(), n)?;
        let (mut xx, mut xy) = (0.0, 0.0);
        for &agent in &alive {
            let (x, y) = (states.x_m[agent] - x0, states.y_m[agent] - y0);
            xx += x * x;
            xy += x * y;
        }
        if xx <= 0.0 {
            return None;
        }
        let slope = xy / xx;
        let square = |&agent: &usize| {
            let residual = states.y_m[agent] - y0 - slope * (states.x_m[agent] - x0);
            residual * residual
        };
        Some(alive.iter().map(square).sum())
    }

    /// How many straight lines it takes so that every alive agent is within this distance (m) of one.
    #[must_use]
    pub fn n_lines(&self, within_m: f64) -> usize {
        lines::n_lines(self.0, within_m)
    }

    /// Sum of the squared distances (m²) of alive agents across the line that makes it least, in the plane: n times the lesser
    /// eigenvalue of the covariance of their places (Pearson 1901).
    #[must_use]
    pub fn across_line_m2(&self) -> Option<f64> {
        let states = self.0;
        let alive: Vec<usize> = states.alive.iter_ones().collect();
        let n = alive.len() as f64;
        if alive.is_empty() {
            return None;
        }
        let mean = |column: &[f64]| alive.iter().map(|&agent| column[agent]).sum::<f64>() / n;
        let (x0, y0) = (mean(&states.x_m), mean(&states.y_m));
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for &agent in &alive {
            let (x, y) = (states.x_m[agent] - x0, states.y_m[agent] - y0);
            xx += x * x;
            xy += x * y;
            yy += y * y;
        }
        // With the greater eigenvalue the lesser follows from the determinant, without cancellation.
        let greater = 0.5 * (xx + yy) + libm::hypot(0.5 * (xx - yy), xy);
        let lesser = if 0.0 < greater { (xx * yy - xy * xy) / greater } else { 0.0 };
        Some(lesser.max(0.0))
    }

    /// Root mean square distance (m) of alive agents from that line.
    #[must_use]
    pub fn line_rms_m(&self) -> Option<f64> {
        let n = self.0.alive.count() as f64;
        self.across_line_m2().map(|across_m2| libm::sqrt(across_m2 / n))
    }

    /// The circle that fits alive agents best (algebraic fit, Kåsa 1976), in the plane. `None`: no circle fits, since they stand in
    /// a line or there are too few.
    #[must_use]
    pub fn circle(&self) -> Option<FittedCircle> {
        let places = self.places_m();
        let n = places.len() as f64;
        if places.len() < 3 {
            return None;
        }
        let mean: [f64; 2] =
            std::array::from_fn(|axis| places.iter().map(|place| place[axis]).sum::<f64>() / n);
        let (mut xx, mut xy, mut yy, mut xz, mut yz, mut zz) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for place in &places {
            let (x, y) = (place[0] - mean[0], place[1] - mean[1]);
            let z = x * x + y * y;
            xx += x * x;
            xy += x * y;
            yy += y * y;
            xz += x * z;
            yz += y * z;
            zz += z;
        }
        let determinant = xx * yy - xy * xy;
        if determinant <= 1e-12 * (xx + yy) * (xx + yy) {
            return None;
        }
        let a = 0.5 * (xz * yy - yz * xy) / determinant;
        let b = 0.5 * (yz * xx - xz * xy) / determinant;
        let radius_m = libm::sqrt(a * a + b * b + zz / n);
        let away = |place: &[f64; 2]| [place[0] - mean[0] - a, place[1] - mean[1] - b];
        let squares = places.iter().map(|place| {
            let [x, y] = away(place);
            let off = libm::hypot(x, y) - radius_m;
            off * off
        });
        let rms_m = libm::sqrt(squares.sum::<f64>() / n);
        let mut angles: Vec<f64> = places
            .iter()
            .map(|place| {
                let [x, y] = away(place);
                libm::atan2(y, x)
            })
            .collect();
        angles.sort_by(f64::total_cmp);
        let round = angles.first().map(|first| first + std::f64::consts::TAU);
        let next = angles.iter().copied().skip(1).chain(round);
        let gap_rad = angles.iter().zip(next).map(|(from, to)| to - from).fold(0.0, f64::max);
        Some(FittedCircle { radius_m, rms_m, gap_rad })
    }

    /// Root mean square distance (m) of the points of a rectangle from the nearest robot that is alive, in the plane: the cost that
    /// coverage control minimises (Cortés et al. 2004). Measured at the centres of 100 × 100 equal parts. `area_m`: its
    /// south-western and north-eastern corner. `None`: nobody is alive.
    #[must_use]
    pub fn coverage_rms_m(&self, area_m: [[f64; 2]; 2]) -> Option<f64> {
        let places = self.places_m();
        if places.is_empty() {
            return None;
        }
        let [from, to] = area_m;
        let at = |axis: usize, part: usize| {
            from[axis] + (to[axis] - from[axis]) * (part as f64 + 0.5) / POINTS as f64
        };
        let mut sum = 0.0;
        for point in 0..POINTS * POINTS {
            let [x, y] = [at(0, point / POINTS), at(1, point % POINTS)];
            let squares = places
                .iter()
                .map(|place| (place[0] - x) * (place[0] - x) + (place[1] - y) * (place[1] - y));
            sum += squares.fold(f64::INFINITY, f64::min);
        }
        Some(libm::sqrt(sum / (POINTS * POINTS) as f64))
    }

    /// Root mean square (m), over robots that are alive, of the difference between the distance to the nearest other one and
    /// `spacing_m`, in the plane. `None`: fewer than two.
    #[must_use]
    pub fn lattice_error_m(&self, spacing_m: f64) -> Option<f64> {
        let mut places = self.places_m();
        if places.len() < 2 {
            return None;
        }
        places.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        let mut sum = 0.0;
        for (number, from) in places.iter().enumerate() {
            let mut nearest_m = f64::INFINITY;
            let mut is_near = |to: &[f64; 2]| {
                let apart = [to[0] - from[0], to[1] - from[1]];
                let is_near = apart[0].abs() < nearest_m;
                nearest_m = nearest_m.min(libm::hypot(apart[0], apart[1]));
                is_near
            };
            // In order of x: those behind one that is too far along x are as far.
            let _ = places[..number].iter().rev().all(&mut is_near);
            let _ = places[number + 1..].iter().all(&mut is_near);
            let off = nearest_m - spacing_m;
            sum += off * off;
        }
        Some(libm::sqrt(sum / places.len() as f64))
    }

    /// Places of robots that are alive (m, east and north).
    fn places_m(&self) -> Vec<[f64; 2]> {
        let states = self.0;
        states.alive.iter_ones().map(|agent| [states.x_m[agent], states.y_m[agent]]).collect()
    }
}

/// Root mean square distance (m) from their centroid of the robots of the largest group whose members hear each other, directly
/// or by way of others. Robots outside of it count as 0, so that robots that left the network do not add to it. `None`: no
/// robot has a place. Of equal groups the one with the lowest number.
pub(super) fn connected_spread_m(heard: &HeardPeriod) -> Option<f64> {
    let present: Vec<usize> =
        (0..heard.places.len()).filter(|&agent| heard.places[agent].is_some()).collect();
    let mut groups = Groups::new(heard.places.len(), present.len());
    heard.pairs.keys().for_each(|&(a, b)| groups.join(a as usize, b as usize));
    let mut members: BTreeMap<usize, Vec<[f64; 2]>> = BTreeMap::new();
    for &agent in &present {
        members.entry(groups.root_of(agent)).or_default().extend(heard.places[agent]);
    }
    // The last of equals is the one with the lowest number.
    let largest = members.into_values().rev().max_by_key(Vec::len)?;
    let mean =
        |axis: usize| largest.iter().map(|place| place[axis]).sum::<f64>() / largest.len() as f64;
    let [x, y] = [mean(0), mean(1)];
    let square =
        |place: &[f64; 2]| (place[0] - x) * (place[0] - x) + (place[1] - y) * (place[1] - y);
    Some(libm::sqrt(largest.iter().map(square).sum::<f64>() / present.len() as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places<'a>(states: &'a AgentStates) -> Arrangement<'a> {
        Arrangement(states)
    }

    fn near(value: Option<f64>, expected: f64) {
        let value = value.unwrap();
        assert!((value - expected).abs() < 1e-3 * expected.max(1e-3), "{value} is not {expected}");
    }

    #[test]
    fn an_area_is_covered_as_its_parts_are_near_to_a_robot() {
        // In the middle of a square of side a: √(a²/6). In a corner: √(2 a²/3).
        let area_m = [[0.0, 0.0], [6.0, 6.0]];
        near(places(&AgentStates::at_rest(&[[3.0, 3.0]])).coverage_rms_m(area_m), 6f64.sqrt());
        near(places(&AgentStates::at_rest(&[[0.0, 0.0]])).coverage_rms_m(area_m), 24f64.sqrt());
        // Two robots in the middles of the halves of a square, each 3 m by 6 m: √((9 + 36)/12).
        let halves = AgentStates::at_rest(&[[1.5, 3.0], [4.5, 3.0]]);
        near(places(&halves).coverage_rms_m(area_m), 3.75f64.sqrt());
        assert_eq!(places(&AgentStates::at_rest(&[])).coverage_rms_m(area_m), None);
    }

    #[test]
    fn a_lattice_is_as_good_as_the_nearest_neighbours_are_far() {
        let row = AgentStates::at_rest(&[[0.0, 0.0], [7.0, 0.0], [14.0, 0.0]]);
        assert_eq!(places(&row).lattice_error_m(7.0), Some(0.0));
        // All in one place: each is off by the whole distance.
        assert_eq!(places(&AgentStates::at_origin(3)).lattice_error_m(7.0), Some(7.0));
        assert_eq!(places(&AgentStates::at_origin(1)).lattice_error_m(7.0), None);
    }

    #[test]
    fn robots_that_left_the_network_add_nothing_to_its_spread() {
        let heard = |pairs: &[(u32, u32)]| HeardPeriod {
            from_ns: 0,
            until_ns: 1,
            pairs: pairs.iter().map(|&pair| (pair, true)).collect(),
            places: vec![Some([-3.0, 0.0]), Some([3.0, 0.0]), Some([900.0, 0.0]), None],
        };
        // Two of three hear each other: √((9 + 9)/3).
        near(connected_spread_m(&heard(&[(0, 1)])), 6f64.sqrt());
        assert_eq!(connected_spread_m(&heard(&[])), Some(0.0));
        let all = connected_spread_m(&heard(&[(0, 1), (1, 2)])).unwrap();
        assert!(400.0 < all, "{all}");
    }

    #[test]
    fn a_line_and_a_circle_are_told_from_what_is_near_them() {
        // On y = 2 x exactly, then one metre off it across: of a line through three points of four.
        let on_line = AgentStates::at_rest(&[[0.0, 0.0], [1.0, 2.0], [2.0, 4.0]]);
        assert!(places(&on_line).across_line_m2().unwrap() < 1e-12);
        assert_eq!(places(&on_line).circle(), None);
        // A rectangle 4 by 2: across its long axis each corner is 1 m away.
        let corners = AgentStates::at_rest(&[[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]]);
        assert!((places(&corners).across_line_m2().unwrap() - 4.0).abs() < 1e-12);
        let circle = places(&corners).circle().unwrap();
        assert!(circle.rms_m < 1e-12 && (circle.radius_m - 5f64.sqrt()).abs() < 1e-12);
        // Along a side of 4 m, seen from a distance of 1 m.
        assert!((circle.gap_rad - 2.0 * libm::atan(2.0)).abs() < 1e-12);
        // Two on a circle of 1.1 m, two on one of 0.9 m, crosswise: 0.1 m off to first order.
        let crossed = AgentStates::at_rest(&[[1.1, 0.0], [-1.1, 0.0], [0.0, 0.9], [0.0, -0.9]]);
        let off_m = places(&crossed).circle().unwrap().rms_m;
        assert!((off_m - 0.1).abs() < 0.001, "{off_m}");
        // On a quarter of a circle they are near to it, and three quarters of it are empty.
        let arc = [0.0, 0.25, 0.75, 1.0].map(|share: f64| {
            let angle = share * std::f64::consts::FRAC_PI_2;
            [libm::cos(angle), libm::sin(angle)]
        });
        let arc = places(&AgentStates::at_rest(&arc)).circle().unwrap();
        assert!(arc.rms_m < 1e-12 && (arc.gap_rad - 1.5 * std::f64::consts::PI).abs() < 1e-9);
    }

    #[test]
    fn a_square_has_the_spread_of_its_half_diagonal_and_the_residual_of_its_rows() {
        let square = AgentStates::at_rest(&[[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [2.0, 2.0]]);
        // Exact but for the rounding of a square root.
        assert!((places(&square).spread_m().unwrap() - 2f64.sqrt()).abs() < 1e-12);
        assert!((places(&square).line_residual_m2().unwrap() - 4.0).abs() < 1e-12);
        let column = AgentStates::at_rest(&[[1.0, 0.0], [1.0, 2.0]]);
        assert_eq!(places(&column).line_residual_m2(), None);
    }
}
