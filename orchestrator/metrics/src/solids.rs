//! How often robots meet walls and obstacles of the place. docs/metrics.md defines it.

use super::period::Period;
use super::task::{Passage, Task};
use proto::site::Site;
use proto::types::MovedObstacle;

/// Walls and obstacles, and how often robots have met them.
#[derive(Clone, Debug)]
pub struct Solids {
    /// Walls, and obstacles without a name, which cannot move.
    standing: Tree,
    /// Obstacles with a name, where they are at the end of the latest step.
    named: Vec<(String, Solid)>,
    robot_radius_m: f64,
    n_met: u64,
    n_passed: u64,
}

/// Everything within `radius_m` of an upright, straight wall, or of a point, up to a height.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Solid {
    /// Its middle line at the beginning of a step, and at the end.
    line_m: [[[f64; 2]; 2]; 2],
    radius_m: f64,
    height_m: f64,
}

impl Solids {
    /// Of a place. `None` where nothing is solid, or where it is not known how large robots are.
    #[must_use]
    pub fn from_site(site: &Site, task: &Task) -> Option<Self> {
        let robot_radius_m = 0.5 * task.diameter_m?;
        let wall = site.wall.iter().map(|wall| Solid {
            line_m: [[wall.from_m, wall.to_m]; 2],
            radius_m: 0.0,
            height_m: wall.height_m.unwrap_or(f64::INFINITY),
        });
        let mut standing: Vec<Solid> = wall.collect();
        let mut named = Vec::new();
        for obstacle in &site.obstacle {
            let solid = Solid {
                line_m: [[obstacle.centre_m; 2]; 2],
                radius_m: obstacle.radius_m,
                height_m: obstacle.height_m.unwrap_or(f64::INFINITY),
            };
            match &obstacle.name {
                Some(name) => named.push((name.clone(), solid)),
                None => standing.push(solid),
            }
        }
        let is_empty = standing.is_empty() && named.is_empty();
        let standing = Tree::build(standing, robot_radius_m);
        (!is_empty).then_some(Self { standing, named, robot_radius_m, n_met: 0, n_passed: 0 })
    }

    /// Adds a step. Of one in which robots stand still, only where obstacles go counts.
    ///
    /// * `met`: called with each robot that has met walls or obstacles in the step, and how many.
    pub fn add(&mut self, task: &Task, period: &Period<'_>, mut met: impl FnMut(usize, u64)) {
        self.take_up(period.moved_obstacles);
        if period.held {
            return;
        }
        let named = self.named.iter().map(|(_, solid)| *solid).collect();
        let named = Tree::build(named, self.robot_radius_m);
        let (states, before) = (period.states, period.states_before);
        for agent in states.alive.iter_ones() {
            let end_m = states.position_m(agent);
            let begin_m = before.alive.get(agent).then(|| before.position_m(agent));
            let passage = task.passage(agent);
            let way = Way { begin_m, end_m, is_straight: passage == Passage::Through };
            let n = self.standing.n_met(way, self.robot_radius_m)
                + named.n_met(way, self.robot_radius_m);
            self.n_met += n;
            if 0 < n {
                met(agent, n);
            }
            if passage == Passage::Through {
                self.n_passed += n;
            }
        }
    }

    /// How often a robot has met a wall or an obstacle.
    pub(super) fn n_met(&self) -> u64 {
        self.n_met
    }

    /// How often one did that walls and obstacles do not hold up.
    pub(super) fn n_passed(&self) -> u64 {
        self.n_passed
    }

    /// Where obstacles are at the end of a step; those that are not listed have not moved.
    fn take_up(&mut self, moved: &[MovedObstacle]) {
        for (name, solid) in &mut self.named {
            let [_, before_m] = solid.line_m;
            let moved = moved.iter().find(|moved| moved.name == *name);
            let after_m = moved.map_or(before_m, |moved| [moved.centre_m; 2]);
            solid.line_m = [before_m, after_m];
        }
    }
}

/// A robot in a step.
#[derive(Clone, Copy, Debug)]
struct Way {
    /// Where it was; `None`: it was not there.
    begin_m: Option<[f64; 3]>,
    end_m: [f64; 3],
    /// It has gone straight from there to here. Else nothing is known of where it was between.
    is_straight: bool,
}

impl Way {
    /// Whether it meets a solid that it was not in before.
    fn meets(&self, solid: &Solid, robot_radius_m: f64) -> bool {
        let reach_m = (robot_radius_m + solid.radius_m - TOUCH_M).max(0.0);
        let [line_before_m, line_m] = solid.line_m;
        let is_in = |[x, y, z]: [f64; 3], line_m: [[f64; 2]; 2]| {
            z < solid.height_m && point_distance_m([x, y], line_m) <= reach_m
        };
        let is_in_now = is_in(self.end_m, line_m);
        let Some(begin_m) = self.begin_m else { return is_in_now };
        if is_in(begin_m, line_before_m) {
            return false;
        }
        if is_in_now || !self.is_straight {
            return is_in_now;
        }
        let Some([from, until]) = below(begin_m[2], self.end_m[2], solid.height_m) else {
            return false;
        };
        // As seen from the solid.
        let begin: [f64; 2] =
            std::array::from_fn(|i| begin_m[i] + line_m[0][i] - line_before_m[0][i]);
        let end = [self.end_m[0], self.end_m[1]];
        let point_at = |share: f64| -> [f64; 2] {
            std::array::from_fn(|i| begin[i] + share * (end[i] - begin[i]))
        };
        // What rests by something solid does not meet it anew.
        begin != end && segment_distance_m([point_at(from), point_at(until)], line_m) <= reach_m
    }
}

/// From which to which share of a way from one height to another it is below a third one.
fn below(begin_m: f64, end_m: f64, height_m: f64) -> Option<[f64; 2]> {
    let crossing = || (height_m - begin_m) / (end_m - begin_m);
    match (begin_m < height_m, end_m < height_m) {
        (true, true) => Some([0.0, 1.0]),
        (true, false) => Some([0.0, crossing()]),
        (false, true) => Some([crossing(), 1.0]),
        (false, false) => None,
    }
}

/// Distance (m) of a point from a straight line between two.
fn point_distance_m(point: [f64; 2], [from, to]: [[f64; 2]; 2]) -> f64 {
    let [along, off]: [[f64; 2]; 2] =
        [to, point].map(|end| std::array::from_fn(|i| end[i] - from[i]));
    let length_2 = along[0] * along[0] + along[1] * along[1];
    let way = along[0] * off[0] + along[1] * off[1];
    let share = if 0.0 < length_2 { (way / length_2).clamp(0.0, 1.0) } else { 0.0 };
    libm::hypot(off[0] - share * along[0], off[1] - share * along[1])
}

/// Distance (m) between two straight lines, each between two points: 0 where they cross.
fn segment_distance_m(one: [[f64; 2]; 2], other: [[f64; 2]; 2]) -> f64 {
    let side = |[a, b]: [[f64; 2]; 2], c: [f64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let parts = |line, [a, b]: [[f64; 2]; 2]| side(line, a) * side(line, b) < 0.0;
    if parts(one, other) && parts(other, one) {
        return 0.0;
    }
    let ends = one.iter().map(|&end| point_distance_m(end, other));
    let others = other.iter().map(|&end| point_distance_m(end, one));
    ends.chain(others).fold(f64::INFINITY, f64::min)
}

/// Solids in boxes within boxes, so that a robot is compared only with those near it.
#[derive(Clone, Debug)]
struct Tree {
    solids: Vec<Solid>,
    /// A box, then what is in it, box after box.
    boxes: Vec<TreeNode>,
}

/// A box that holds what robots of the tree's size touch when they are in it.
#[derive(Clone, Copy, Debug)]
struct TreeNode {
    from_m: [f64; 2],
    to_m: [f64; 2],
    /// The box that follows where nothing in this one matters.
    next: usize,
    /// What is in it, where that is one solid.
    solid: Option<usize>,
}

impl Tree {
    fn build(solids: Vec<Solid>, robot_radius_m: f64) -> Self {
        let mut order: Vec<usize> = (0..solids.len()).collect();
        let mut tree = Self { solids, boxes: Vec::new() };
        if !order.is_empty() {
            tree.fill(&mut order, robot_radius_m);
        }
        tree
    }

    /// Adds a box with these solids, and what is in it.
    fn fill(&mut self, order: &mut [usize], robot_radius_m: f64) {
        let place = self.boxes.len();
        let (mut from_m, mut to_m) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for &number in &*order {
            let [least_m, most_m] = self.solids[number].extent_m(robot_radius_m);
            from_m = std::array::from_fn(|i| from_m[i].min(least_m[i]));
            to_m = std::array::from_fn(|i| to_m[i].max(most_m[i]));
        }
        let solid = if let [only] = *order { Some(only) } else { None };
        self.boxes.push(TreeNode { from_m, to_m, next: 0, solid });
        if solid.is_none() {
            let axis = usize::from(to_m[0] - from_m[0] < to_m[1] - from_m[1]);
            let middle = |number: usize| {
                let [_, [from_m, to_m]] = self.solids[number].line_m;
                from_m[axis] + to_m[axis]
            };
            order.sort_by(|&a, &b| middle(a).total_cmp(&middle(b)).then(a.cmp(&b)));
            let (low, high) = order.split_at_mut(order.len() / 2);
            self.fill(low, robot_radius_m);
            self.fill(high, robot_radius_m);
        }
        self.boxes[place].next = self.boxes.len();
    }

    /// How many of the solids a robot meets.
    fn n_met(&self, way: Way, robot_radius_m: f64) -> u64 {
        let begin_m = way.begin_m.unwrap_or(way.end_m);
        let is_near = |it: &TreeNode| {
            (0..2).all(|i| {
                it.from_m[i] <= begin_m[i].max(way.end_m[i])
                    && begin_m[i].min(way.end_m[i]) <= it.to_m[i]
            })
        };
        let (mut n, mut place) = (0, 0);
        while let Some(it) = self.boxes.get(place) {
            if !is_near(it) {
                place = it.next;
                continue;
            }
            n += u64::from(
                it.solid.is_some_and(|number| way.meets(&self.solids[number], robot_radius_m)),
            );
            place += 1;
        }
        n
    }
}

impl Solid {
    /// Between which corners robots are that touch it in a step.
    fn extent_m(&self, robot_radius_m: f64) -> [[f64; 2]; 2] {
        let reach_m = self.radius_m + robot_radius_m;
        let extreme_m = |i: usize, least: fn(f64, f64) -> f64, none_m: f64| {
            self.line_m.iter().flatten().map(|end_m| end_m[i]).fold(none_m, least)
        };
        [
            std::array::from_fn(|i| extreme_m(i, f64::min, f64::INFINITY) - reach_m),
            std::array::from_fn(|i| extreme_m(i, f64::max, f64::NEG_INFINITY) + reach_m),
        ]
    }
}

/// Robots in what is solid by less than this (m) touch it, and do not meet it: rounding.
const TOUCH_M: f64 = 1e-9;

#[cfg(test)]
mod tests;
