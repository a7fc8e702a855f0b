//! Robots that form a straight line, wherever it may lie.

use super::{Controller, Demands, Entry, Goal, View};
use crate::dynamics::Command;
use crate::line_fit::{Fit, Moments};
use proto::config::{Choice, Section, variant};
use proto::ids::AgentId;

pub(super) const ENTRY: Entry = Entry {
    variant: variant::<LineFormation>("line-formation"),
    demands: Demands::NONE,
    goal: Goal::Line,
    build: |table, context, problems| {
        let this = LineFormation::read(table);
        if this.step_cap_m <= this.threshold_m {
            problems.push(
                context
                    .problem(
                        "threshold_m",
                        format!("must be less than step_cap_m = {}", this.step_cap_m),
                    )
                    .value(this.threshold_m),
            );
        }
        Some(Box::new(this))
    },
};

/// Line formation: every robot moves to the straight line that fits the robots it knows of.
///
/// Line formation by local least squares.
///
/// # Model
///
/// Each robot fits a line to its own position and those it knows of ([`Fit`]), and moves towards the orthogonal
/// projection of its own position on it, at most `step_cap_m` a step, unless it is within `threshold_m` of it: BotNet
/// paper, § Formation Control, after Yun, Alptekin and Albayrak (1997). The task is done when all stay. In the BotNet
/// paper's count of rounds that last one is included; the first step of a run, before anything was heard, is not. The published code counts a robot's own position twice, because there a robot is its own
/// neighbour; the lines of two robots then differ even where both know everything, which leaves a residual of the order
/// of the threshold.
///
/// # Validity
///
/// A robot that knows of nobody, or only of robots at its own place, has no line and stays. Robots do not avoid each
/// other. "Done" is what the robots believe; they may have formed several lines.
#[derive(Debug, Section)]
struct LineFormation {
    /// Weight of a robot's own position in the fit.
    #[key(default = Law::Paper)]
    law: Law,
    /// Which distances to the line the fit minimises.
    #[key(default = Fit::Vertical)]
    fit: Fit,
    /// Maximum displacement per control step (m). Default: BotNet's.
    #[key(above = 0.0, most = 1e6, default = 0.1)]
    step_cap_m: f64,
    /// A robot closer to its line than this stays (m); the task is complete when all stay. Default: BotNet's.
    #[key(range = 0.0..=1e6, default = 0.001)]
    threshold_m: f64,
}

#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
enum Law {
    /// Counted once, as in the BotNet paper.
    Paper,
    /// Counted twice, as in BotNet's code.
    Botnet,
}

impl LineFormation {
    /// Where the robot would have to be (m), relative to where it is.
    fn offset_m(&self, view: &View<'_>, agent: AgentId) -> [f64; 2] {
        let [own_x_m, own_y_m, _] = view.position_m(agent);
        let own_weight = match self.law {
            Law::Botnet => 2.0,
            Law::Paper => 1.0,
        };
        // Relative to the robot, so that no digits are lost far from the origin.
        let moments = Moments::accumulate(|visit| {
            visit(0.0, 0.0, own_weight);
            view.knowledge.for_each_known_to(agent, |seen| {
                let [x, y, _] = seen.motion.position_m;
                visit(x - own_x_m, y - own_y_m, 1.0);
            });
        });
        let Some((moments, [dx, dy])) =
            moments.and_then(|moments| Some((moments, moments.direction(self.fit)?)))
        else {
            return [0.0; 2];
        };
        // From the robot to its projection: the part of the way to the centroid that is across the line.
        let [cx, cy] = moments.centroid_m;
        let across = cy * dx - cx * dy;
        [-across * dy, across * dx]
    }
}

impl Controller for LineFormation {
    fn command(&self, view: &View<'_>, agent: AgentId) -> Command {
        let [x, y] = self.offset_m(view, agent);
        let distance_m = libm::hypot(x, y);
        if distance_m <= self.threshold_m {
            return Command::Velocity([0.0; 3]);
        }
        let scale = if distance_m <= self.step_cap_m { 1.0 } else { self.step_cap_m / distance_m };
        Command::Velocity([x * scale / view.dt_s, y * scale / view.dt_s, 0.0])
    }

    /// Nobody wants to move, and somebody could have been known: before the first frames of the network arrive nobody
    /// moves either.
    fn is_done(&self, view: &View<'_>, commands: &[Command]) -> bool {
        let can_tell = view.knowledge.is_any() || view.states.len() == 1;
        can_tell && commands.iter().all(|command| *command == Command::Velocity([0.0; 3]))
    }
}
