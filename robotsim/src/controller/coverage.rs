//! Robots that spread over an area.

use super::{Controller, Demands, Entry, Goal, View};
use crate::dynamics::Command;
use proto::config::{Kind, Range, Section, variant};
use proto::ids::AgentId;

const ANY: Kind = Kind::Number(Range::closed(-1e6, 1e6));

pub(super) const ENTRY: Entry = Entry {
    variant: variant::<Coverage>("coverage"),
    demands: Demands::NONE,
    goal: Goal::Cover,
    build: |table, context, problems| {
        let this = Coverage::read(table);
        if this.to_m[0] <= this.from_m[0] || this.to_m[1] <= this.from_m[1] {
            let [x, y] = this.from_m;
            problems.push(
                context
                    .problem("to_m", format!("must lie north-east of from_m = [{x}, {y}]"))
                    .value(format!("[{}, {}]", this.to_m[0], this.to_m[1])),
            );
        }
        Some(Box::new(this))
    },
};

/// Coverage by Lloyd's algorithm: every robot moves to the centroid of its Voronoi cell.
///
/// Coverage of a rectangle.
///
/// # Model
///
/// Cortés, Martínez, Karatas and Bullo, "Coverage control for mobile sensing networks", IEEE Trans. Robot. Autom. 20(2), 2004,
/// eq. 6: u_i = k (C_i − x_i), C_i the centroid of the points of the area that are nearer to robot i than to any robot it
/// knows of, all points counting alike. With everyone known this descends the mean squared distance of the area's points
/// to the nearest robot; k Δt = 1 is Lloyd's iteration.
///
/// # Validity
///
/// The plane only. A robot that knows of nobody stays: else all would meet in the middle before they have heard each other.
/// Of robots in one place all think the part theirs. From outside a robot enters at the nearest point first.
#[derive(Debug, Section)]
struct Coverage {
    /// South-western corner of the area (x, y in m).
    #[key(kind = Kind::List { of: &ANY, min: 2, max: 2 })]
    from_m: [f64; 2],
    /// North-eastern corner (x, y in m).
    #[key(kind = Kind::List { of: &ANY, min: 2, max: 2 })]
    to_m: [f64; 2],
    /// Gain towards the centroid (1/s); robots do not overshoot it.
    #[key(above = 0.0, most = 1e3, default = 1.0)]
    gain_per_s: f64,
    /// The task is complete when no robot would move farther than this in a control period (m).
    #[key(above = 0.0, most = 1e3, default = 1e-3)]
    threshold_m: f64,
}

impl Controller for Coverage {
    fn command(&self, view: &View<'_>, agent: AgentId) -> Command {
        let [x_m, y_m, _] = view.position_m(agent);
        let own_m = [x_m, y_m];
        let ([x0, y0], [x1, y1]) = (self.from_m, self.to_m);
        let mut cell = vec![[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
        let mut is_alone = true;
        view.knowledge.for_each_known_to(agent, |seen| {
            let [x_m, y_m, _] = seen.motion.position_m;
            nearer(&mut cell, own_m, [x_m, y_m]);
            is_alone = false;
        });
        if is_alone {
            return Command::Velocity([0.0; 3]);
        }
        let goal_m =
            centroid(&cell).unwrap_or_else(|| [own_m[0].clamp(x0, x1), own_m[1].clamp(y0, y1)]);
        let gain = self.gain_per_s.min(1.0 / view.dt_s);
        Command::Velocity([gain * (goal_m[0] - own_m[0]), gain * (goal_m[1] - own_m[1]), 0.0])
    }

    fn is_done(&self, view: &View<'_>, commands: &[Command]) -> bool {
        view.knowledge.is_any() && super::all_within(view, commands, self.threshold_m)
    }
}

/// Leaves of a convex polygon what is nearer to `own_m` than to `other_m` (Sutherland and Hodgman 1974).
fn nearer(cell: &mut Vec<[f64; 2]>, own_m: [f64; 2], other_m: [f64; 2]) {
    let [nx, ny] = [other_m[0] - own_m[0], other_m[1] - own_m[1]];
    let middle = [0.5 * (own_m[0] + other_m[0]), 0.5 * (own_m[1] + other_m[1])];
    // Positive on the other's side.
    let side = |p: [f64; 2]| (p[0] - middle[0]) * nx + (p[1] - middle[1]) * ny;
    if nx == 0.0 && ny == 0.0 || cell.iter().all(|&corner| side(corner) <= 0.0) {
        return;
    }
    let mut kept = Vec::with_capacity(cell.len() + 1);
    for (place, &from) in cell.iter().enumerate() {
        let to = cell[(place + 1) % cell.len()];
        let (a, b) = (side(from), side(to));
        if a <= 0.0 {
            kept.push(from);
        }
        if (a < 0.0 && 0.0 < b) || (b < 0.0 && 0.0 < a) {
            let share = a / (a - b);
            kept.push([from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])]);
        }
    }
    *cell = kept;
}

/// Centroid of a polygon; `None` of one without area.
fn centroid(cell: &[[f64; 2]]) -> Option<[f64; 2]> {
    let origin = *cell.first()?;
    let (mut area, mut x, mut y) = (0.0, 0.0, 0.0);
    for (place, a) in cell.iter().enumerate() {
        let b = cell[(place + 1) % cell.len()];
        let [ax, ay, bx, by] =
            [a[0] - origin[0], a[1] - origin[1], b[0] - origin[0], b[1] - origin[1]];
        let cross = ax * by - bx * ay;
        area += cross;
        x += cross * (ax + bx);
        y += cross * (ay + by);
    }
    (1e-12 < area).then(|| [origin[0] + x / (3.0 * area), origin[1] + y / (3.0 * area)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_is_what_is_nearest() {
        let mut cell = vec![[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
        assert_eq!(centroid(&cell), Some([2.0, 2.0]));
        // A robot at (1, 1) against one at (3, 3): a triangle, whose centroid is the mean of its corners.
        nearer(&mut cell, [1.0, 1.0], [3.0, 3.0]);
        let [x, y] = centroid(&cell).unwrap();
        assert!((x - 4.0 / 3.0).abs() < 1e-12 && (y - 4.0 / 3.0).abs() < 1e-12);
        // And one at (1, 3): the lower half of it remains.
        nearer(&mut cell, [1.0, 1.0], [1.0, 3.0]);
        assert!(cell.iter().all(|corner| corner[1] <= 2.0));
        // In one place both think it theirs; from far outside nothing is nearest.
        let before = cell.clone();
        nearer(&mut cell, [1.0, 1.0], [1.0, 1.0]);
        assert_eq!(cell, before);
        nearer(&mut cell, [100.0, 100.0], [1.0, 1.0]);
        assert_eq!(centroid(&cell), None);
    }
}
