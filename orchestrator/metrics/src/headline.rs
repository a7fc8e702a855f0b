//! The figures that a run leads with: for each goal of robots the one that says how well they reach it, and those beside it
//! that show whether it can be trusted. docs/metrics.md has the floor and the ceiling of each.

use crate::task::{Goal, Task};
use numbers::format::{count, number, percent, with_unit};

/// What a run with some goals leads with. Figures are paths in `summary.json`.
#[derive(Debug)]
pub struct Headline {
    /// The goals whose runs lead with it.
    pub goals: &'static [Goal],
    /// The first figure; of several the first that a run has, since not every network has all.
    pub first: &'static [Shown],
    /// Figures beside it: the first one looks good in some runs that fail, and these tell which.
    pub beside: &'static [Shown],
    /// Which values of the first figure are good.
    pub better: Better,
    /// The figure that is its floor: what robots that do nothing reach. `None`: a single run does not show it.
    pub floor: Option<&'static str>,
}

/// A figure as people read it.
#[derive(Clone, Copy, Debug)]
pub struct Shown {
    /// Its path in `summary.json`.
    pub path: &'static str,
    /// What it is, in a few words that begin with a capital letter.
    pub words: &'static str,
    /// Its unit; `%` of a share from 0 to 1, `1` of another number without a unit, empty of a count.
    pub unit: &'static str,
}

/// Which values of a figure are good.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    /// Great ones.
    Greater,
    /// Small ones.
    Less,
}

use Better::{Greater, Less};

const fn shown(path: &'static str, words: &'static str, unit: &'static str) -> Shown {
    Shown { path, words, unit }
}

/// Robots thrash if their mean speed is more than so many times their speed along the leader's direction, and above the leader's:
/// more than half of their motion does not follow.
pub const THRASH_FACTOR: f64 = 2.0;

/// Whether robots thrash: they move faster than their leader, and much faster than they get on. Speeds in m/s: the mean speed of
/// the robots, that of their mean velocity along the leader's direction, and that of the leader.
#[must_use]
pub fn is_thrashing(robots_mps: f64, along_leader_mps: f64, leader_mps: f64) -> bool {
    THRASH_FACTOR * along_leader_mps < robots_mps && leader_mps < robots_mps
}

/// The path of whether they do.
pub const THRASHING_PATH: &str = "task.thrashing";

/// The path of the number of collisions.
pub const COLLISIONS_PATH: &str = "task.collisions";

const COLLISIONS: Shown = shown(COLLISIONS_PATH, "Collisions between robots", "");
const SPREAD: Shown = shown("task.final_spread_m", "Spread at the end", "m");

/// All of them: each goal has one.
pub const HEADLINES: &[Headline] = &[
    Headline {
        goals: &[Goal::FollowLeader],
        first: &[shown(
            "task.leader_speed_ratio",
            "Share of the leader's speed, along its direction",
            "%",
        )],
        beside: &[
            shown("task.speed_along_leader_mps", "Speed along the leader's direction", "m/s"),
            shown("task.leader_distance_m", "Distance to the leader", "m"),
            COLLISIONS,
        ],
        better: Greater,
        floor: Some("task.leader_speed_floor_ratio"),
    },
    Headline {
        goals: &[Goal::Align],
        first: &[shown("task.polarisation", "Polarisation", "1")],
        beside: &[shown("task.cohesion_m", "Distance to the swarm's centre", "m"), COLLISIONS],
        better: Greater,
        floor: Some("task.polarisation_floor"),
    },
    Headline {
        goals: &[Goal::Lattice],
        first: &[shown("task.lattice_error_m", "Error of the lattice's distances", "m")],
        beside: &[SPREAD, COLLISIONS],
        better: Less,
        floor: None,
    },
    Headline {
        goals: &[Goal::Line],
        first: &[shown("task.line_rms_m", "Distance from the line (r.m.s.)", "m")],
        beside: &[shown("task.lines", "Lines", ""), SPREAD, COLLISIONS],
        better: Less,
        floor: Some("task.initial_line_rms_m"),
    },
    Headline {
        goals: &[Goal::Circle],
        first: &[shown("task.circle_rms_m", "Distance from the circle (r.m.s.)", "m")],
        beside: &[
            shown("task.circle_gap_rad", "Widest gap on the circle", "rad"),
            shown("task.circle_radius_m", "Radius of the circle", "m"),
            COLLISIONS,
        ],
        better: Less,
        floor: Some("task.initial_circle_rms_m"),
    },
    Headline {
        goals: &[Goal::Meet],
        first: &[SPREAD],
        beside: &[shown("task.initial_spread_m", "Spread at the start", "m")],
        better: Less,
        floor: Some("task.initial_spread_m"),
    },
    Headline {
        goals: &[Goal::Cover],
        first: &[shown(
            "task.coverage_rms_m",
            "Distance of the area to the nearest robot (r.m.s.)",
            "m",
        )],
        beside: &[shown("task.initial_coverage_rms_m", "The same at the start", "m"), COLLISIONS],
        better: Less,
        floor: Some("task.initial_coverage_rms_m"),
    },
    Headline {
        goals: &[Goal::Disperse],
        first: &[shown(
            "task.connected_spread_m",
            "Spread of the largest connected group at the end",
            "m",
        )],
        beside: &[SPREAD, COLLISIONS],
        better: Greater,
        floor: Some("task.initial_spread_m"),
    },
    Headline {
        goals: &[Goal::Explore],
        first: &[shown("task.mapped_ratio", "Mapped share of the reachable area", "%")],
        beside: &[
            shown("task.seen_ratio", "Share seen by any robot", "%"),
            shown("task.mapped_90_s", "Time to map 90 %", "s"),
            COLLISIONS,
        ],
        better: Greater,
        floor: None,
    },
    Headline {
        goals: &[Goal::Carry, Goal::Other],
        first: &[
            shown(
                "kpis.since_start.delivered_of_expected.ratio",
                "Delivered of expected packets since the start",
                "%",
            ),
            shown("network.delivery_ratio", "Delivery ratio", "%"),
        ],
        beside: &[],
        better: Greater,
        floor: None,
    },
];

impl Shown {
    /// A value with its unit.
    #[must_use]
    pub fn text(&self, value: f64) -> String {
        match self.unit {
            "%" => percent(value),
            "" => count(value as u64),
            unit => with_unit(&number(value), unit),
        }
    }

    /// Whether it has no unit: it is compared with its floor by differences, not by shares of it.
    #[must_use]
    pub fn is_pure(&self) -> bool {
        ["%", "1"].contains(&self.unit)
    }

    /// Its name among the figures of `task`; `None`: it is one of the network.
    #[must_use]
    pub fn of_task(&self) -> Option<&'static str> {
        self.path.strip_prefix("task.")
    }
}

impl Headline {
    /// That of a goal; of one without an entry none.
    #[must_use]
    pub fn of_goal(goal: Goal) -> Option<&'static Self> {
        HEADLINES.iter().find(|headline| headline.goals.contains(&goal))
    }

    /// That with this first figure.
    #[must_use]
    pub fn of_first(path: &str) -> Option<(&'static Self, &'static Shown)> {
        HEADLINES.iter().find_map(|headline| {
            Some((headline, headline.first.iter().find(|shown| shown.path == path)?))
        })
    }

    /// The first figure of a run: the first that has a value there, else the last, which every run has a place for.
    pub fn first_of(&self, value: impl Fn(&str) -> Option<f64>) -> Option<&'static Shown> {
        let has_value = |shown: &&Shown| value(shown.path).is_some();
        self.first.iter().find(has_value).or(self.first.last())
    }

    /// Whether robots that reach the goal do not collide.
    #[must_use]
    pub fn counts_collisions(&self) -> bool {
        self.beside.iter().any(|shown| shown.path == COLLISIONS_PATH)
    }

    /// First figure and those beside it.
    pub fn shown(&self) -> impl Iterator<Item = &'static Shown> {
        self.first.iter().chain(self.beside)
    }
}

impl Task {
    /// What the robots are to come to, as their figures measure it: robots that follow somebody are measured by their leader,
    /// also those of a swarm with several controllers; without a leader a flock is measured by how well it aligns.
    #[must_use]
    pub fn measured_goal(&self) -> Goal {
        match self.goal {
            _ if self.leader.is_some() => Goal::FollowLeader,
            Goal::FollowLeader => Goal::Align,
            goal => goal,
        }
    }

    /// What its runs lead with.
    #[must_use]
    pub fn headline(&self) -> Option<&'static Headline> {
        Headline::of_goal(self.measured_goal())
    }
}
