//! Rooms are explored: robots send maps to a base, which sends them where nobody has been.

use super::{Controller, Demands, Entry, Goal, View};
use crate::context::Context;
use crate::dynamics::Command;
use crate::exploration::grid::{Grid, MAX_CELLS};
use crate::exploration::{MIN_MESSAGE_BYTES, Settings};
use proto::config::{Kind, Problem, Range, Section, variant};
use proto::ids::AgentId;
use proto::time::SimDuration;
use proto::types::NS_PER_S;

const POSITIVE: Kind = Kind::Number(Range::above(0.0, 1e4));
const CORNER: Kind = Kind::List { of: &Kind::Number(Range::closed(-1e6, 1e6)), min: 2, max: 2 };

pub(super) const ENTRY: Entry = Entry {
    variant: variant::<Raw>("exploration"),
    demands: Demands { sends_messages: true, ..Demands::NONE },
    goal: Goal::Explore,
    build: |table, context, problems| {
        let raw = Raw::read(table);
        raw.settings(context, problems)
            .map(|settings| Box::new(Exploration { settings }) as Box<dyn Controller>)
    },
};

/// Frontier exploration: robots map their surroundings and report to a base, which sends each robot to a different frontier of its
/// map.
#[derive(Debug, Section)]
struct Raw {
    /// South-western corner of the area (x, y in m).
    #[key(kind = CORNER)]
    from_m: [f64; 2],
    /// North-eastern corner of the area (x, y in m).
    #[key(kind = CORNER)]
    to_m: [f64; 2],
    /// Side of a cell of the map (m).
    #[key(range = 0.01..=1e3, default = 0.5)]
    cell_m: f64,
    /// Sensing range (m), limited by walls and obstacles in the line of sight; at least 1.5 cells.
    #[key(kind = POSITIVE, default = 4.0)]
    range_m: f64,
    /// Speed of a robot (m/s).
    #[key(kind = POSITIVE, default = 0.5)]
    speed_mps: f64,
    /// The robot that is the base: it collects maps, sends waypoints, and stays where it is. Routes to it are shortest if it is a
    /// root of the network.
    #[key(default = 0)]
    base: AgentId,
    /// Minimum interval between reports of a robot, and between answers of the base to it (s).
    #[key(range = 1e-3..=1e4, default = 1.0)]
    report_s: f64,
    /// Retransmission timeout of unanswered messages (s); a robot without news also reports at this interval. At least report_s.
    #[key(range = 1e-3..=1e5, default = 10.0)]
    retry_s: f64,
    /// A robot that has waited this long for a message from the base (s) returns towards its initial position. Absent: it stays.
    #[key(range = 1e-3..=1e6)]
    return_after_s: Option<f64>,
    /// Maximum size of a message (bytes). Up to about 60 fit into one frame.
    #[key(range = MIN_MESSAGE_BYTES..=900, default = 60)]
    message_bytes: usize,
}

impl Raw {
    fn settings(&self, context: &Context<'_>, problems: &mut Vec<Problem>) -> Option<Settings> {
        let before = problems.len();
        super::check_speed("speed_mps", self.speed_mps, context, problems);
        if self.to_m.iter().zip(self.from_m).any(|(to_m, from_m)| *to_m <= from_m) {
            let message = format!(
                "must lie north-east of from_m = {:?}, as a corner of an area",
                self.from_m
            );
            problems.push(context.problem("to_m", message).value(format!("{:?}", self.to_m)));
        }
        if self.range_m < 1.5 * self.cell_m {
            let message = format!("must be at least 1.5 cells of cell_m = {:?}", self.cell_m);
            let nearest = format!("{:?}", 1.5 * self.cell_m);
            problems.push(
                context
                    .problem("range_m", message)
                    .value(format!("{:?}", self.range_m))
                    .nearest(nearest),
            );
        }
        if self.retry_s < self.report_s {
            let message = format!("must be at least report_s = {:?}", self.report_s);
            let nearest = format!("{:?}", self.report_s);
            problems.push(
                context
                    .problem("retry_s", message)
                    .value(format!("{:?}", self.retry_s))
                    .nearest(nearest),
            );
        }
        let last = context.n_agents.saturating_sub(1);
        if last == 0 {
            let message =
                "requires experiment.agents of at least 2: a base and robots that explore";
            problems.push(context.problem("base", message));
        } else if last < self.base.index() {
            let message = format!("must be the number of a robot, 0 to {last}");
            problems.push(context.problem("base", message).value(self.base).nearest(last));
        }
        if problems.len() != before {
            return None;
        }
        let Some(grid) = Grid::new(self.from_m, self.to_m, self.cell_m) else {
            let [width_m, height_m] = [0, 1].map(|axis| self.to_m[axis] - self.from_m[axis]);
            // So large that whole cells to either side are among those that fit.
            let nearest_m = libm::ceil(100.0 * libm::sqrt(width_m * height_m / 65_000.0)) / 100.0;
            let message =
                format!("must be larger: it divides this area into more than {MAX_CELLS} cells");
            problems.push(
                context
                    .problem("cell_m", message)
                    .value(format!("{:?}", self.cell_m))
                    .nearest(format!("{nearest_m:?}")),
            );
            return None;
        };
        let duration =
            |seconds: f64| SimDuration::from_ns(libm::round(seconds * NS_PER_S as f64) as u64);
        Some(Settings {
            grid,
            base: self.base,
            range_m: self.range_m,
            speed_mps: self.speed_mps,
            report_every: duration(self.report_s),
            retry_after: duration(self.retry_s),
            return_after: self.return_after_s.map(duration),
            message_bytes: self.message_bytes,
        })
    }
}

/// Frontier-based exploration by a central planner.
///
/// # Model
///
/// The area is a grid of square cells, of which each is free or occupied ([`Grid::solid`]). A robot that comes into a cell knows
/// those that it sees from there: within its range, no occupied cell between ([`Grid::sees`]). What is new to it, it sends to the
/// base, in parts that each fit a message and are repeated until the base says that they have come.
///
/// The base puts all parts on one map. A frontier is a free cell beside an unknown one (Yamauchi, "A frontier-based approach for
/// autonomous exploration", CIRA 1997). Of all robots without a goal and all frontiers that nobody else will see from its goal
/// the pair with the shortest way comes first, then the next (Burgard, Moors, Stachniss and Schneider, "Coordinated Multi-Robot
/// Exploration", IEEE Trans. Robot. 21(3), 2005, whose utility is here that a cell is expected to be seen or not). Ways are the
/// shortest over free cells (Dijkstra 1959), with steps across corners where both cells beside are free; the robot is told
/// where they turn.
///
/// # Validity
///
/// Maps are without error: a robot knows what it sees, though with noise of measured positions it is mistaken about where it is
/// itself. Robots do not avoid each other. Obstacles that move are on no map.
#[derive(Debug)]
struct Exploration {
    settings: Settings,
}

impl Controller for Exploration {
    fn command(&self, view: &View<'_>, agent: AgentId) -> Command {
        let aim_m = view.exploration.and_then(|exploration| exploration.aim_m(agent));
        let Some([x_m, y_m]) = aim_m.filter(|_| agent != self.settings.base) else {
            return Command::Velocity([0.0; 3]);
        };
        let [at_x_m, at_y_m, _] = view.position_m(agent);
        let (dx_m, dy_m) = (x_m - at_x_m, y_m - at_y_m);
        let off_m = libm::hypot(dx_m, dy_m);
        let speed_mps = self.settings.speed_mps.min(off_m / view.dt_s);
        let factor = if off_m == 0.0 { 0.0 } else { speed_mps / off_m };
        Command::Velocity([factor * dx_m, factor * dy_m, 0.0])
    }

    fn is_done(&self, view: &View<'_>, _commands: &[Command]) -> bool {
        view.exploration.is_some_and(crate::exploration::State::is_done)
    }

    fn exploration(&self) -> Option<&Settings> {
        Some(&self.settings)
    }
}
