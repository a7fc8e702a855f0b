//! Robots that form a circle.

use super::{Controller, Demands, Entry, Goal, View};
use crate::dynamics::Command;
use proto::config::{Section, variant};
use proto::ids::AgentId;

pub(super) const ENTRY: Entry = Entry {
    variant: variant::<CircleFormation>("circle-formation"),
    demands: Demands::NONE,
    goal: Goal::Circle,
    build: |table, _, _| Some(Box::new(CircleFormation::read(table))),
};

/// Circle formation: every robot moves to the circle that fits the robots it knows of.
///
/// Circle formation by least squares.
///
/// # Model
///
/// As line formation (Yun, Alptekin and Albayrak, "Line and circle formation of distributed physical mobile robots", J. Robotic
/// Systems 14(2), 1997): each robot fits the figure to its own place and those it knows of, and moves to the nearest point of
/// it. Without `radius_m` the circle is Kåsa's algebraic fit (IEEE Trans. Instrum. Meas. 25(1), 1976), which minimises
/// Σ (|x_j − c|² − r²)²; with it, the centre minimises Σ (|x_j − c| − r)², by the fixed point c = mean(x_j − r e_j), e_j the
/// direction from c to x_j, from the centroid.
/// `even` turns a robot by a quarter of the difference of the angles to its two neighbours on the circle.
///
/// # Validity
///
/// In the plane. Fewer than three in all, or all in a line, have no circle: then everyone stays, unless `radius_m` is
/// given. Robots do not avoid each other.
#[derive(Debug, Section)]
struct CircleFormation {
    /// Radius of the circle (m). Absent: the best fit.
    #[key(above = 0.0, most = 1e6)]
    radius_m: Option<f64>,
    /// Whether robots also spread along the circle, away from the nearer of their two neighbours on it.
    #[key(default = false)]
    even: bool,
    /// Maximum displacement per control step (m).
    #[key(above = 0.0, most = 1e6, default = 0.1)]
    step_cap_m: f64,
    /// A robot closer than this to its target position stays (m).
    #[key(range = 0.0..=1e6, default = 0.001)]
    threshold_m: f64,
}

/// Centre (m) and radius (m).
type Circle = ([f64; 2], f64);

impl CircleFormation {
    fn circle(&self, places: &[[f64; 2]]) -> Option<Circle> {
        match self.radius_m {
            None => kasa(places),
            Some(radius_m) if 1 < places.len() => Some((centre(places, radius_m), radius_m)),
            Some(_) => None,
        }
    }
}

/// The algebraic fit. `None`: the places lie in a line.
fn kasa(places: &[[f64; 2]]) -> Option<Circle> {
    let n = places.len() as f64;
    if places.len() < 3 {
        return None;
    }
    let mean = mean(places);
    let [mut xx, mut xy, mut yy, mut xz, mut yz] = [0.0; 5];
    for place in places {
        let (x, y) = (place[0] - mean[0], place[1] - mean[1]);
        let z = x * x + y * y;
        xx += x * x;
        xy += x * y;
        yy += y * y;
        xz += x * z;
        yz += y * z;
    }
    let determinant = xx * yy - xy * xy;
    if determinant <= 1e-9 * (xx + yy) * (xx + yy) {
        return None;
    }
    let a = 0.5 * (xz * yy - yz * xy) / determinant;
    let b = 0.5 * (yz * xx - xz * xy) / determinant;
    Some(([mean[0] + a, mean[1] + b], libm::sqrt(a * a + b * b + (xx + yy) / n)))
}

/// The centre of a circle of known radius.
fn centre(places: &[[f64; 2]], radius_m: f64) -> [f64; 2] {
    let mean = mean(places);
    let n = places.len() as f64;
    let mut centre = mean;
    for _ in 0..100 {
        let mut sum = [0.0; 2];
        for &place in places {
            let [x, y] = direction(centre, place);
            sum = [sum[0] + x, sum[1] + y];
        }
        centre = [mean[0] - radius_m * sum[0] / n, mean[1] - radius_m * sum[1] / n];
    }
    centre
}

fn mean(places: &[[f64; 2]]) -> [f64; 2] {
    let n = places.len() as f64;
    std::array::from_fn(|axis| places.iter().map(|place| place[axis]).sum::<f64>() / n)
}

/// East where there is none.
fn direction(from: [f64; 2], to: [f64; 2]) -> [f64; 2] {
    let (x, y) = (to[0] - from[0], to[1] - from[1]);
    let length = libm::hypot(x, y);
    if length < 1e-12 { [1.0, 0.0] } else { [x / length, y / length] }
}

impl Controller for CircleFormation {
    fn command(&self, view: &View<'_>, agent: AgentId) -> Command {
        let [x_m, y_m, _] = view.position_m(agent);
        let own_m = [x_m, y_m];
        let mut places = vec![own_m];
        view.knowledge.for_each_known_to(agent, |seen| {
            let [x_m, y_m, _] = seen.motion.position_m;
            places.push([x_m, y_m]);
        });
        let Some((centre, radius_m)) = self.circle(&places).filter(|_| 1 < places.len()) else {
            return Command::Velocity([0.0; 3]);
        };
        let [mut ex, mut ey] = direction(centre, own_m);
        if self.even {
            // Angles to the others, counter-clockwise and clockwise.
            let (mut ahead, mut behind) = (std::f64::consts::TAU, std::f64::consts::TAU);
            for place in &places[1..] {
                let [ox, oy] = direction(centre, *place);
                let angle = libm::atan2(ex * oy - ey * ox, ex * ox + ey * oy);
                let forwards = if angle < 0.0 { angle + std::f64::consts::TAU } else { angle };
                ahead = ahead.min(forwards);
                behind = behind.min(std::f64::consts::TAU - forwards);
            }
            let turn = 0.25 * (ahead - behind);
            let (sin, cos) = (libm::sin(turn), libm::cos(turn));
            (ex, ey) = (ex * cos - ey * sin, ex * sin + ey * cos);
        }
        let way = [centre[0] + radius_m * ex - own_m[0], centre[1] + radius_m * ey - own_m[1]];
        let length_m = libm::hypot(way[0], way[1]);
        if length_m <= self.threshold_m {
            return Command::Velocity([0.0; 3]);
        }
        let share = (self.step_cap_m / length_m).min(1.0) / view.dt_s;
        Command::Velocity([share * way[0], share * way[1], 0.0])
    }

    fn is_done(&self, view: &View<'_>, commands: &[Command]) -> bool {
        view.knowledge.is_any() && super::all_within(view, commands, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circle_is_found_from_points_on_it() {
        let on = |angle: f64| [3.0 + 2.0 * libm::cos(angle), -1.0 + 2.0 * libm::sin(angle)];
        let places = [0.1, 1.0, 2.5, 4.0].map(on);
        let (found, radius_m) = kasa(&places).unwrap();
        assert!((found[0] - 3.0).abs() < 1e-9 && (found[1] + 1.0).abs() < 1e-9);
        assert!((radius_m - 2.0).abs() < 1e-9);
        // All around, the fixed point is the centre as well.
        let found = centre(&[0.0, 1.5, 3.0, 4.5].map(on), 2.0);
        assert!((found[0] - 3.0).abs() < 1e-6 && (found[1] + 1.0).abs() < 1e-6, "{found:?}");
        assert_eq!(kasa(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]), None);
    }
}
