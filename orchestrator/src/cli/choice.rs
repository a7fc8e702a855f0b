//! Options that choose rows, partitions and prediction horizons.

use clap::{Args, ValueEnum};
use study::choices::{Choices, SplitBy};

/// The value of `--split`.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum SplitArg {
    /// Blocks of time
    Time,
    /// Pairs of nodes, both directions together
    Pair,
    /// Nodes, with all rows of their links; for robots, whole robots
    Node,
    /// Squares of the plane
    Place,
    /// Runs: rows with the same number in the column run
    Run,
}

impl From<SplitArg> for SplitBy {
    fn from(split: SplitArg) -> Self {
        match split {
            SplitArg::Time => Self::Time,
            SplitArg::Pair => Self::Pair,
            SplitArg::Node => Self::Node,
            SplitArg::Place => Self::Place,
            SplitArg::Run => Self::Run,
        }
    }
}

/// The value of `--losses`.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum LossesArg {
    /// Frames that were lost would be in the file
    Logged,
    /// Received frames alone were logged
    NotLogged,
}

/// Which rows are used, which are left out together, how far robots are predicted.
#[derive(Args, Clone)]
pub(super) struct ChoiceArgs {
    /// Use only rows that satisfy a condition on columns and derived covariates, as in 'channel == 26 and distance_m < 30'.
    /// For robots, the condition applies to the first row of each window
    #[arg(long = "where", value_name = "CONDITION")]
    condition: Option<String>,
    /// Unit of cross-validation: what each fold holds out together [default: the unit that suits each effect]
    #[arg(long, value_name = "UNIT")]
    split: Option<SplitArg>,
    /// Fit to these runs only (numbers of the column run, as in 1,2), and score those of --score-runs, or all others
    #[arg(long, value_name = "RUNS", value_delimiter = ',')]
    fit_runs: Vec<u32>,
    /// Score these runs only, with a fit to those of --fit-runs, or to all others
    #[arg(long, value_name = "RUNS", value_delimiter = ',')]
    score_runs: Vec<u32>,
    /// Prediction horizon for robots (s) [default: 1]
    #[arg(long, value_name = "S")]
    window: Option<f64>,
    /// Links in whose file no frame is lost: whether lost frames were logged [default: the column losses_logged; without it
    /// unknown, so that only that is certain which holds either way]
    #[arg(long, value_name = "WHICH")]
    losses: Option<LossesArg>,
}

impl ChoiceArgs {
    pub(super) fn choices(&self) -> Choices {
        Choices {
            condition: self.condition.clone(),
            split: self.split.map(SplitBy::from),
            fit_runs: self.fit_runs.clone(),
            score_runs: self.score_runs.clone(),
            window_s: self.window,
            given_rssi: false,
            losses_logged: self.losses.map(|losses| matches!(losses, LossesArg::Logged)),
        }
    }

    /// As they would be typed.
    pub(super) fn words(&self) -> String {
        let runs = |option: &str, runs: &[u32]| {
            let list: Vec<String> = runs.iter().map(u32::to_string).collect();
            if runs.is_empty() { String::new() } else { format!(" --{option} {}", list.join(",")) }
        };
        [
            self.condition.as_ref().map_or_else(String::new, |text| format!(" --where '{text}'")),
            self.split
                .map_or_else(String::new, |split| format!(" --split {}", SplitBy::from(split))),
            runs("fit-runs", &self.fit_runs),
            runs("score-runs", &self.score_runs),
            self.window.map_or_else(String::new, |window_s| format!(" --window {window_s}")),
            self.losses.map_or_else(String::new, |losses| {
                let is_logged = matches!(losses, LossesArg::Logged);
                format!(" --losses {}", if is_logged { "logged" } else { "not-logged" })
            }),
        ]
        .concat()
    }
}
