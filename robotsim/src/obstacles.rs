//! Obstacles of the place that move. Robots and radio see them where they are.

use crate::context::Context;
use crate::dynamics::contacts::Solid;
use crate::path;
use proto::config::{Problem, Range, Section};
use proto::site::Site;
use proto::types::MovedObstacle;

/// How an obstacle moves: a function of time alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Course {
    obstacle: usize,
    points_m: Vec<[f64; 2]>,
    speed_mps: f64,
    is_closed: bool,
}

/// The motion of a cylindrical obstacle of `[site]`.
#[derive(Clone, Debug, Section)]
pub(crate) struct Keys {
    /// Name of the obstacle in `[site]`.
    name: String,
    /// Waypoints (x, y in m), visited in order, from its position in `[site]`.
    #[key(range = Range::PLACE, length = 1..=10_000, required)]
    path_m: Vec<[f64; 2]>,
    /// Speed (m/s).
    #[key(range = 0.0..=1e3)]
    speed_mps: f64,
    /// Whether it returns from the last waypoint to its initial position and repeats; otherwise it stays at the last one.
    #[key(default = false)]
    closed: bool,
}

impl Course {
    /// Which obstacle of the site it is.
    #[must_use]
    pub(crate) fn obstacle(&self) -> usize {
        self.obstacle
    }

    /// How fast it goes (m/s).
    #[must_use]
    pub(crate) fn speed_mps(&self) -> f64 {
        self.speed_mps
    }

    /// Where its centre is (m).
    #[must_use]
    pub(crate) fn centre_m(&self, time_s: f64) -> [f64; 2] {
        path::point_at(&self.points_m, self.is_closed, self.speed_mps * time_s)
    }

    /// The obstacle as robots meet it, at the end of a part of a step.
    #[must_use]
    pub(crate) fn solid(&self, site: &Site, [from_s, until_s]: [f64; 2]) -> Solid {
        let (from_m, to_m) = (self.centre_m(from_s), self.centre_m(until_s));
        let velocity_mps = std::array::from_fn(|i| (to_m[i] - from_m[i]) / (until_s - from_s));
        Solid::obstacle(&site.obstacle[self.obstacle], to_m, velocity_mps)
    }
}

/// Of checked tables, the first of which stands at the path of the context with an index of 0.
pub(crate) fn build(
    keys: &[Keys],
    site: &Site,
    context: &Context<'_>,
    problems: &mut Vec<Problem>,
) -> Vec<Course> {
    let mut courses: Vec<Course> = Vec::new();
    for (index, keys) in keys.iter().enumerate() {
        let Keys { name, path_m, speed_mps, closed } = keys.clone();
        let name_path = || format!("{}[{index}].name", context.path);
        let is_it = |name_there: &Option<String>| name_there.as_deref() == Some(&*name);
        let Some(obstacle) = site.obstacle.iter().position(|there| is_it(&there.name)) else {
            let problem = Problem::new(name_path(), "must be the name of an obstacle of [site]");
            problems.push(problem.value(format!("{name:?}")));
            continue;
        };
        if courses.iter().any(|course| course.obstacle == obstacle) {
            let problem = Problem::new(
                name_path(),
                "must be unique, because an obstacle has only one motion",
            );
            problems.push(problem.value(format!("{name:?}")));
        }
        let begin_m = site.obstacle[obstacle].centre_m;
        let points_m = std::iter::once(begin_m).chain(path_m).collect();
        courses.push(Course { obstacle, points_m, speed_mps, is_closed: closed });
    }
    courses
}

/// Those that moved between two times, where they are then.
pub(crate) fn moved(
    courses: &[Course],
    site: &Site,
    [from_s, until_s]: [f64; 2],
) -> Vec<MovedObstacle> {
    let is_elsewhere = |course: &&Course| course.centre_m(from_s) != course.centre_m(until_s);
    let moved = |course: &Course| MovedObstacle {
        name: site.obstacle[course.obstacle].name.clone().unwrap_or_default(),
        centre_m: course.centre_m(until_s),
    };
    courses.iter().filter(is_elsewhere).map(moved).collect()
}
