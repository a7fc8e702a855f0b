//! The figures of a task by name: what each means, when it is null, and which direction is better. docs/metrics.md defines them.

use crate::figures::Better;

/// A figure of `task` in `summary.json`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TaskFigure {
    /// Its name, which ends in its unit.
    pub name: &'static str,
    /// What it is, in a few words, without a capital letter.
    pub doc: &'static str,
    /// When it is null or absent: what follows "null if". Empty: never.
    pub null_if: &'static str,
    /// Which values are better.
    pub better: Better,
    /// Whether it is a truth value.
    pub is_flag: bool,
}

use Better::{Higher, Lower, Neither};

const fn figure(
    name: &'static str,
    better: Better,
    doc: &'static str,
    null_if: &'static str,
) -> TaskFigure {
    TaskFigure { name, doc, null_if, better, is_flag: false }
}

const NO_STEP: &str = "no step, as in a run that was stopped before the network formed";
const NO_LEADER: &str = "no leader";
const LEADER_STILL: &str = "no leader, or it stands still";
const NOBODY_SENDS: &str = "nobody sends";
const NOBODY: &str = "nobody alive";
const NOT_LINE: &str = "not line formation";
const NOT_CIRCLE: &str = "not circle formation, or the robots are in a line";
const NOT_COVERAGE: &str = "not coverage";
const NOT_EXPLORATION: &str = "not exploration";

/// All figures that this program computes. Simulators of others report further ones.
pub const TASK_FIGURES: &[TaskFigure] = &[
    figure("flock_speed_mps", Higher, "speed of the mean velocity: mean over time", NO_STEP),
    figure(
        "flock_speed_floor_mps",
        Neither,
        "flock speed if nobody follows the leader: the leader's speed over the number of robots",
        NO_LEADER,
    ),
    figure("leader_speed_mps", Neither, "speed of the leader", NO_LEADER),
    figure(
        "speed_along_leader_mps",
        Higher,
        "mean velocity along that of the leader: mean over time",
        LEADER_STILL,
    ),
    figure(
        "leader_speed_ratio",
        Higher,
        "speed along the leader's direction over the leader's speed",
        LEADER_STILL,
    ),
    figure(
        "leader_speed_floor_ratio",
        Neither,
        "leader_speed_ratio if nobody follows the leader: 1 over the number of robots",
        NO_LEADER,
    ),
    figure(
        "thrash_factor",
        Lower,
        "speed of a robot over that along the leader's direction, while the leader moves",
        "no leader, or nobody gets on along its direction",
    ),
    TaskFigure {
        is_flag: true,
        ..figure(
            "thrashing",
            Lower,
            "whether robots move much faster than they get on along the leader's direction",
            LEADER_STILL,
        )
    },
    figure("mean_speed_mps", Neither, "speed of a robot: mean over robots and time", NO_STEP),
    figure(
        "leader_distance_m",
        Lower,
        "distance from the leader: mean over robots and time",
        NO_LEADER,
    ),
    figure(
        "leader_connected_ratio",
        Higher,
        "share of the other robots that are in one group with the leader: mean over time",
        "no leader, or nobody sends",
    ),
    figure(
        "polarisation",
        Higher,
        "polarisation of the headings, 0 to 1: mean over time",
        "nobody moves",
    ),
    figure(
        "radial_speed_mps",
        Neither,
        "speed away from the centre: mean over robots and time",
        "fewer than two places",
    ),
    figure("cohesion_m", Lower, "distance from the centre: mean over robots and time", NOBODY),
    figure("final_spread_m", Lower, "root mean square distance from the centre at the end", NOBODY),
    figure(
        "fragments",
        Lower,
        "number of groups whose robots heard each other in a period: mean over time",
        NOBODY_SENDS,
    ),
    figure("final_fragments", Lower, "number of such groups in the last step", NOBODY_SENDS),
    figure(
        "collisions",
        Lower,
        "how often two robots came closer than their diameter",
        "the robot simulator has no robotsim.diameter_m",
    ),
    figure(
        "site_collisions",
        Lower,
        "how often a robot hit a wall or an obstacle",
        "[site] has no walls or obstacles, or the robot simulator has no robotsim.diameter_m",
    ),
    figure(
        "min_distance_m",
        Higher,
        "minimum distance between two robots at any time",
        "fewer than two robots",
    ),
    figure(
        "neighbour_error_m",
        Lower,
        "distance of a neighbour from where it was when it sent what a robot acts on: mean over receptions",
        "nobody heard anybody",
    ),
    figure(
        "line_residual_m2",
        Lower,
        "sum of the squared distances along y from the least-squares line at the end",
        "not line formation, or all x are equal",
    ),
    figure(
        "line_residual_log10",
        Lower,
        "decimal logarithm of line_residual_m2",
        "not line formation, or all x are equal",
    ),
    figure(
        "line_residual_across_m2",
        Lower,
        "sum of the squared distances perpendicular to the line at the end",
        NOT_LINE,
    ),
    figure(
        "line_residual_across_log10",
        Lower,
        "decimal logarithm of line_residual_across_m2",
        NOT_LINE,
    ),
    figure("line_rms_m", Lower, "root mean square distance from the line at the end", NOT_LINE),
    figure(
        "lines",
        Lower,
        "number of straight lines on which all robots are at the end, to 0.1 m",
        NOT_LINE,
    ),
    figure(
        "circle_rms_m",
        Lower,
        "root mean square distance from the circle at the end",
        NOT_CIRCLE,
    ),
    figure("circle_radius_m", Neither, "radius of that circle", NOT_CIRCLE),
    figure(
        "circle_gap_rad",
        Lower,
        "greatest angle between neighbours on that circle at the end",
        NOT_CIRCLE,
    ),
    figure(
        "initial_circle_rms_m",
        Neither,
        "root mean square distance from the circle at the start",
        NOT_CIRCLE,
    ),
    figure(
        "initial_line_rms_m",
        Neither,
        "root mean square distance from the line at the start",
        NOT_LINE,
    ),
    figure(
        "polarisation_floor",
        Neither,
        "mean polarisation of as many independent headings",
        "not boids, nor a flock without a leader",
    ),
    figure(
        "lattice_error_m",
        Lower,
        "error of the distance to the nearest neighbour at the end: root mean square",
        "not lattice flocking",
    ),
    figure(
        "coverage_rms_m",
        Lower,
        "root mean square distance of points of the area from the nearest robot at the end",
        NOT_COVERAGE,
    ),
    figure(
        "initial_coverage_rms_m",
        Neither,
        "root mean square distance of points of the area from the nearest robot at the start",
        NOT_COVERAGE,
    ),
    figure(
        "connected_spread_m",
        Higher,
        "spread of the largest group that is connected at the end",
        "not dispersion",
    ),
    figure(
        "initial_spread_m",
        Neither,
        "root mean square distance from the centroid at the start",
        "neither consensus nor dispersion",
    ),
    TaskFigure {
        is_flag: true,
        ..figure(
            "false_completion",
            Lower,
            "whether the robots took the task for done while they were more than 0.1 m off the shape",
            "not done, or not a formation",
        )
    },
    figure(
        "mapped_ratio",
        Higher,
        "share of the reachable cells that are on the base's map at the end",
        NOT_EXPLORATION,
    ),
    figure(
        "seen_ratio",
        Higher,
        "share of the reachable cells that any robot has seen",
        NOT_EXPLORATION,
    ),
    figure(
        "mapped_90_s",
        Lower,
        "time from the start of the robots until mapped_ratio reached 0.9",
        "it did not, or not exploration",
    ),
    figure(
        "map_delay_s",
        Lower,
        "time from a robot's first sight of a cell to its entry on the base's map: mean over cells",
        "nothing is mapped, or not exploration",
    ),
    figure(
        "map_age_s",
        Lower,
        "age of the base's latest message from a robot: mean over robots and time",
        NOT_EXPLORATION,
    ),
    figure("map_reports", Neither, "reports that robots sent to the base", NOT_EXPLORATION),
    figure("map_reports_repeated", Neither, "reports that were sent again", NOT_EXPLORATION),
    figure("waypoint_orders", Neither, "messages that the base sent to robots", NOT_EXPLORATION),
];

/// The figure of this name, known when the program is compiled.
///
/// # Panics
///
/// There is none of this name.
#[must_use]
pub const fn task_figure(name: &str) -> TaskFigure {
    let mut place = 0;
    while place < TASK_FIGURES.len() {
        if is_same(TASK_FIGURES[place].name.as_bytes(), name.as_bytes()) {
            return TASK_FIGURES[place];
        }
        place += 1;
    }
    panic!("no figure of a task has this name")
}

/// Whether two texts are equal; the operator is not available when the program is compiled.
const fn is_same(a: &[u8], b: &[u8]) -> bool {
    if a.len() != b.len() {
        return false;
    }
    let mut place = 0;
    while place < a.len() {
        if a[place] != b[place] {
            return false;
        }
        place += 1;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of the page for each: `| `name`[, `name`] | unit | … |`.
    #[test]
    fn the_page_of_metrics_defines_every_figure() {
        let page = include_str!("../../../docs/metrics.md");
        let defined: Vec<&str> = page
            .lines()
            .filter(|line| line.starts_with("| `"))
            .filter_map(|line| line.split('|').nth(1))
            .collect();
        for TaskFigure { name, .. } in TASK_FIGURES.iter().copied() {
            let is_elsewhere = name == "leader_speed_mps";
            let quoted = format!("`{name}`");
            assert!(is_elsewhere || defined.iter().any(|names| names.contains(&quoted)), "{name}");
        }
    }

    #[test]
    fn each_name_is_of_one_figure() {
        let names: std::collections::BTreeSet<&str> =
            TASK_FIGURES.iter().map(|figure| figure.name).collect();
        assert_eq!(names.len(), TASK_FIGURES.len());
        assert_eq!(task_figure("lines").name, "lines");
    }
}
