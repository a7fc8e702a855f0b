//! Motion to predict: windows of recorded commands and the states in which they start, and where a robot simulator says that
//! they end.

use crate::config::Node;
use crate::site::Site;

/// Most steps of all windows of one request together. A reply to so many takes less than a megabyte, which every gRPC library
/// accepts by default.
pub const MAX_STEPS: usize = 20_000;

/// Most time (ns) of all windows of one request together: 100 000 s, so that a request takes seconds even where motion is
/// integrated in steps of 10 ms.
pub const MAX_TOTAL_NS: u64 = 100_000_000_000_000;

/// How recorded robots were commanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionCommandKind {
    /// Velocity east, north and up (m/s).
    Velocity,
    /// Speed along the heading (m/s), yaw rate counter-clockwise (rad/s), zero.
    SpeedAndYawRate,
    /// Speed along the heading (m/s), steering angle to the left (rad), zero.
    SpeedAndSteering,
}

impl MotionCommandKind {
    /// Whether robots have a heading along which they drive.
    #[must_use]
    pub fn is_turning(self) -> bool {
        self != Self::Velocity
    }
}

/// A command of a window, and how long it holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PredictionStep {
    /// How long it holds (ns), at least 1.
    pub duration_ns: u64,
    /// The command, as its [`MotionCommandKind`] says. Finite.
    pub command: [f64; 3],
}

/// A robot that starts in a known state and executes known commands.
#[derive(Clone, Debug, PartialEq)]
pub struct PredictionWindow {
    /// Number of the robot.
    pub agent: u32,
    /// Time of the experiment at which the window starts (ns).
    pub start_ns: u64,
    /// Position at the start (m).
    pub position_m: [f64; 3],
    /// Heading at the start (rad); 0 where it was not measured.
    pub heading_rad: f64,
    /// Velocity at the start (m/s), if it was measured. If not, the robot has executed the first command for long.
    pub velocity_mps: Option<[f64; 3]>,
    /// At least one.
    pub steps: Vec<PredictionStep>,
}

/// Windows to predict under a configuration.
#[derive(Clone, Debug)]
pub struct PredictionRequest {
    /// The place.
    pub site: Site,
    /// The simulator's own section, its keys at top level, as written.
    pub config: Node,
    /// What the commands of all windows are.
    pub command_kind: MotionCommandKind,
    /// Each is predicted by itself.
    pub windows: Vec<PredictionWindow>,
}

/// Where a robot is at the end of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PredictedState {
    /// Position (m).
    pub position_m: [f64; 3],
    /// Heading (rad), perhaps beyond a full turn; 0 for robots without one.
    pub heading_rad: f64,
}

/// States at the end of each step of a window.
pub type PredictedWindow = Vec<PredictedState>;

/// Windows with at most [`MAX_STEPS`] steps and [`MAX_TOTAL_NS`] each group, in order. A window that is larger is a group of its
/// own.
pub fn groups(windows: &[PredictionWindow]) -> Vec<&[PredictionWindow]> {
    let mut groups = Vec::new();
    let (mut first, mut n_steps, mut total_ns) = (0, 0, 0);
    for (index, window) in windows.iter().enumerate() {
        n_steps += window.steps.len();
        total_ns += window.duration_ns();
        if first < index && (MAX_STEPS < n_steps || MAX_TOTAL_NS < total_ns) {
            groups.push(&windows[first..index]);
            (first, n_steps, total_ns) = (index, window.steps.len(), window.duration_ns());
        }
    }
    groups.extend((first < windows.len()).then(|| &windows[first..]));
    groups
}

impl PredictionWindow {
    /// How long its commands hold together (ns).
    #[must_use]
    pub fn duration_ns(&self) -> u64 {
        self.steps.iter().map(|step| step.duration_ns).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_hold_as_much_as_a_request_may_and_keep_the_order() {
        let window = |agent, n: usize, duration_ns| PredictionWindow {
            agent,
            start_ns: 0,
            position_m: [0.0; 3],
            heading_rad: 0.0,
            velocity_mps: None,
            steps: vec![PredictionStep { duration_ns, command: [0.0; 3] }; n],
        };
        let agents = |windows: &[PredictionWindow]| -> Vec<Vec<u32>> {
            let agents = |group: &&[PredictionWindow]| group.iter().map(|it| it.agent).collect();
            groups(windows).iter().map(agents).collect()
        };
        let third = MAX_STEPS / 3;
        let windows =
            [window(1, third, 1), window(2, third, 1), window(3, MAX_STEPS - 2 * third, 1)];
        assert_eq!(agents(&windows), [vec![1, 2, 3]]);
        let windows = [window(1, third, 1), window(2, MAX_STEPS, 1), window(3, third, 1)];
        assert_eq!(agents(&windows), [vec![1], vec![2], vec![3]]);
        let windows = [window(1, 1, MAX_TOTAL_NS), window(2, 1, 1), window(3, 1, 1)];
        assert_eq!(agents(&windows), [vec![1], vec![2, 3]]);
        assert_eq!(agents(&[]), Vec::<Vec<u32>>::new());
    }
}
