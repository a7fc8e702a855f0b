//! The figures of a swarm's task that are compared: those of a run's summary (docs/metrics.md), of places alone.

use crate::figure::{FigureSpec, figure};
use crate::tracks::Tracks;
use metrics::figures::FigureValue;
use metrics::places::measures_of;
use metrics::task::Goal;
use metrics::task_figures::task_figure;
use metrics::{Measures, Task};
use numbers::power::square;
use proto::types::{AgentStates, NS_PER_S};

/// The scale on which differences of a figure are reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TaskScale {
    /// As it is.
    Plain,
    /// A length or a speed above 0: logarithm.
    Ratio,
}

use TaskScale::{Plain, Ratio};

/// How many figures there are.
pub(super) const N: usize = 13;

/// All figures, in the order of their values.
pub const FIGURES: [FigureSpec<TaskScale>; N] = [
    of_task("mean_speed_mps", "m/s", Ratio),
    of_task("flock_speed_mps", "m/s", Ratio),
    of_task("speed_along_leader_mps", "m/s", Plain),
    of_task("leader_distance_m", "m", Ratio),
    of_task("polarisation", "", Plain),
    of_task("radial_speed_mps", "m/s", Plain),
    of_task("cohesion_m", "m", Ratio),
    of_task("min_distance_m", "m", Ratio),
    of_task("final_spread_m", "m", Ratio),
    of_task("line_rms_m", "m", Ratio),
    of_task("circle_rms_m", "m", Ratio),
    figure("centre_x_m", "m", Plain, "displacement of the centre of all robots, east"),
    figure("centre_y_m", "m", Plain, "displacement of the centre of all robots, north"),
];

/// A figure that the summary of a run has as well.
const fn of_task(
    name: &'static str,
    unit: &'static str,
    scale: TaskScale,
) -> FigureSpec<TaskScale> {
    figure(name, unit, scale, task_figure(name).doc)
}

/// Figures of one swarm.
#[derive(Clone, Debug, PartialEq)]
pub struct TaskFigures {
    /// Those of [`FIGURES`]; NaN where there is nothing to tell: no leader, no shape.
    pub values: [f64; N],
}

impl TaskFigures {
    /// On their scales: for differences.
    #[must_use]
    pub fn scaled(&self) -> [f64; N] {
        let mut scaled = self.values;
        for (value, figure) in scaled.iter_mut().zip(&FIGURES) {
            if figure.scale == TaskScale::Ratio {
                // A centimetre is as good as nothing.
                *value = libm::log(*value + 0.01);
            }
        }
        scaled
    }
}

/// Looks at a swarm at fixed times.
#[derive(Clone, Debug)]
pub(super) struct Sheet {
    task: Task,
    n_agents: usize,
    times_ns: Vec<u64>,
}

impl Sheet {
    /// Of `n_agents` robots of a task, from 0 to `until_s`, as often as places were measured or a step passes, whichever is
    /// rarer, yet not more often than needed.
    #[must_use]
    pub(super) fn new(
        task: Task,
        n_agents: usize,
        until_s: f64,
        spacing_s: f64,
        step_s: f64,
    ) -> Self {
        let every_s = spacing_s.max(step_s).max(until_s / MOST_LOOKS);
        let n = (until_s / every_s).floor().max(1.0);
        let times_ns =
            (0..=n as u64).map(|k| (until_s * (k as f64 / n) * NS_PER_S as f64) as u64).collect();
        Self { task, n_agents, times_ns }
    }

    /// Where everyone was at these times.
    fn places(&self, tracks: &Tracks) -> Vec<(u64, AgentStates)> {
        let mut states = AgentStates::at_origin(self.n_agents);
        // Not known: they follow from the places.
        for column in [&mut states.vx_mps, &mut states.vy_mps, &mut states.vz_mps] {
            column.clear();
        }
        let place = |&time_ns: &u64| {
            let mut states = states.clone();
            tracks.place(time_ns as f64 / NS_PER_S as f64, &mut states);
            (time_ns, states)
        };
        self.times_ns.iter().map(place).collect()
    }

    /// The figures of a swarm that went so.
    #[must_use]
    pub(super) fn figures(&self, tracks: &Tracks) -> TaskFigures {
        let places = self.places(tracks);
        let nothing = TaskFigures { values: [f64::NAN; N] };
        let (Some(measures), Some((_, begin)), Some((_, end))) =
            (measures_of(self.task.clone(), &places), places.first(), places.last())
        else {
            return nothing;
        };
        let swarm = measures.swarm_figures();
        let centre = |states: &AgentStates| -> [f64; 2] {
            [&states.x_m, &states.y_m]
                .map(|column| column.iter().sum::<f64>() / column.len() as f64)
        };
        let (from_m, to_m) = (centre(begin), centre(end));
        let figure_value = |name: &str| {
            let value = match name {
                "mean_speed_mps" => measures.mean_speed_mps(),
                "flock_speed_mps" => measures.flock_speed_mps(),
                "final_spread_m" => measures.at_end().spread_m(),
                "line_rms_m" => self.line_rms_m(&measures),
                "circle_rms_m" => {
                    let circle = measures.at_end().circle();
                    circle.filter(|_| self.task.goal == Goal::Circle).map(|circle| circle.rms_m)
                }
                "centre_x_m" => Some(to_m[0] - from_m[0]),
                "centre_y_m" => Some(to_m[1] - from_m[1]),
                _ => swarm.get(name).copied().flatten().and_then(FigureValue::number),
            };
            value.unwrap_or(f64::NAN)
        };
        TaskFigures { values: FIGURES.map(|figure| figure_value(figure.name)) }
    }

    fn line_rms_m(&self, measures: &Measures) -> Option<f64> {
        let across_m2 =
            measures.at_end().across_line_m2().filter(|_| self.task.goal == Goal::Line)?;
        Some(libm::sqrt(across_m2 / self.n_agents as f64))
    }

    /// Root mean square distance (m) between two swarms over robots and time.
    #[must_use]
    pub(super) fn apart_m(&self, one: &Tracks, other: &Tracks) -> f64 {
        let (mut squares, mut n) = (0.0, 0.0);
        for ((_, a), (_, b)) in self.places(one).iter().zip(self.places(other)) {
            for agent in 0..self.n_agents {
                let (a, b) = (a.position_m(agent), b.position_m(agent));
                squares += (0..3).map(|axis| square(a[axis] - b[axis])).sum::<f64>();
                n += 1.0;
            }
        }
        libm::sqrt(squares / n)
    }
}

/// Most times at which a swarm is looked at, about.
const MOST_LOOKS: f64 = 400.0;

#[cfg(test)]
mod tests {
    use super::*;
    use measure::table::DataTable;
    use std::fmt::Write as _;
    use std::path::Path;

    #[test]
    fn figures_are_those_of_where_robots_were() {
        // Two that go east at 2 m/s, 6 m apart, one 3 m behind the centre of both.
        let mut text = "time_s,agent,x_m,y_m\n".to_owned();
        for k in 0..=20 {
            let x_m = 2.0 * 0.5 * f64::from(k);
            for (agent, x_m, y_m) in [(0, x_m, 3.0), (1, x_m, -3.0), (2, x_m - 3.0, 0.0)] {
                writeln!(text, "{},{agent},{x_m},{y_m}", 0.5 * f64::from(k)).unwrap();
            }
        }
        let tracks =
            Tracks::from_table(&DataTable::of_csv(Path::new("p.csv"), text.as_bytes()).unwrap())
                .unwrap();
        let task = Task {
            leader: Some(0),
            leader_velocity_mps: Some([0.0, 1.0]),
            goal: Goal::Line,
            ..Task::default()
        };
        let sheet = Sheet::new(task, 3, tracks.until_s(), tracks.spacing_s(), 0.1);
        let figures = sheet.figures(&tracks);
        let value_of = |name: &str| {
            figures.values[FIGURES.iter().position(|figure| figure.name == name).unwrap()]
        };
        let near = |name: &str, value: f64| {
            assert!((value_of(name) - value).abs() < 1e-9, "{name}: {}", value_of(name))
        };
        near("mean_speed_mps", 2.0);
        near("flock_speed_mps", 2.0);
        near("speed_along_leader_mps", 0.0);
        near("leader_distance_m", 0.5 * (6.0 + 18.0_f64.sqrt()));
        near("polarisation", 1.0);
        near("radial_speed_mps", 0.0);
        near("min_distance_m", 18.0_f64.sqrt());
        near("centre_x_m", 20.0);
        near("centre_y_m", 0.0);
        // Across the line through them, which runs north: 1 m, 1 m and 2 m from their centre.
        near("line_rms_m", 2.0_f64.sqrt());
        assert!(value_of("circle_rms_m").is_nan());
        let moved = tracks.measured_of(&tracks, &|_, _, axis| [3.0, 4.0, 0.0][axis as usize]);
        assert!((sheet.apart_m(&tracks, &moved) - 5.0).abs() < 1e-9);
    }
}
