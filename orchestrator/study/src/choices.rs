//! What is chosen by hand: which rows are used, which of them are left out together, how far robots are predicted.

use measure::Rejected;
use measure::table::DataTable;
use proto::formula::{Formula, FormulaError};
use std::fmt;

/// Choices by hand. The default leaves all of them to the study.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choices {
    /// A condition over columns and derived covariates: rows on which it does not hold are not used.
    pub condition: Option<String>,
    /// What is left out together, at every level.
    pub split: Option<SplitBy>,
    /// Campaigns that models are fitted to; empty: all that are not scored.
    pub fit_runs: Vec<u32>,
    /// Campaigns that are predicted; empty: all that are not fitted to. Both empty: folds.
    pub score_runs: Vec<u32>,
    /// How far ahead robots are predicted (s).
    pub window_s: Option<f64>,
    /// The reading of a row of several frames is taken for the level at which they arrived: reception alone is predicted.
    pub given_rssi: bool,
    /// Of links without a lost frame: whether lost ones would have been logged. None: as the file says, or unknown.
    pub losses_logged: Option<bool>,
}

impl Choices {
    /// All rows, everything left to the study.
    pub const NONE: Self = Self {
        condition: None,
        split: None,
        fit_runs: Vec::new(),
        score_runs: Vec::new(),
        window_s: None,
        given_rssi: false,
        losses_logged: None,
    };
}

/// The rows that cross-validation leaves out together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SplitBy {
    /// Parts of the time that was measured.
    Time,
    /// Pairs of nodes, both directions together.
    Pair,
    /// Nodes, with every row that they take part in; of robots, whole robots.
    Node,
    /// Squares of the plane in which nodes or robots move.
    Place,
    /// Campaigns: equal numbers in the column run.
    Run,
}

impl SplitBy {
    /// As it is typed.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Pair => "pair",
            Self::Node => "node",
            Self::Place => "place",
            Self::Run => "run",
        }
    }
}

impl fmt::Display for SplitBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A choice that these data do not allow.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ChoiceError {
    /// The condition cannot be read.
    #[error("--where: {0}")]
    Condition(#[from] FormulaError),
    /// It holds nowhere.
    #[error("--where: no row satisfies {condition:?} ({rows} rows checked); relax the condition")]
    Nowhere {
        /// The condition.
        condition: String,
        /// How many rows there are.
        rows: usize,
    },
    /// Rows cannot be left out in this way.
    #[error("--split {split}: {reason}; use --split {nearest}")]
    Split {
        /// What was asked for.
        split: SplitBy,
        /// Why not.
        reason: String,
        /// What can be asked for.
        nearest: SplitBy,
    },
    /// There is no such campaign.
    #[error("{option}: the data have no run {run} (nearest valid: {nearest}); their runs are {}", listed(.known))]
    NoRun {
        /// The option.
        option: &'static str,
        /// What was asked for.
        run: u32,
        /// The nearest that there is.
        nearest: u32,
        /// All that there are.
        known: Vec<u32>,
    },
    /// A campaign is both.
    #[error(
        "run {run} is in both --fit-runs and --score-runs; remove it from one of them, because a fit must not see the runs \
         that it is scored on"
    )]
    Both {
        /// The campaign.
        run: u32,
    },
    /// Nothing is left for the other part.
    #[error("{option} lists every run of the data ({}), so that no run is left to be {rest}; leave out at least one", listed(.known))]
    NoneLeft {
        /// The option.
        option: &'static str,
        /// What the others would be.
        rest: &'static str,
        /// All that there are.
        known: Vec<u32>,
    },
    /// A window that does not fit.
    #[error("--window {window_s}: {reason} (nearest valid: {nearest_s})")]
    Window {
        /// What was asked for (s).
        window_s: f64,
        /// Why not.
        reason: String,
        /// What can be asked for (s).
        nearest_s: f64,
    },
    /// Links have no windows.
    #[error(
        "--window sets the prediction horizon for robots, and these data are link samples; leave it out"
    )]
    NoWindows,
    /// Robots have no readings.
    #[error(
        "--given-rssi predicts reception from RSSI readings, and these data are robot samples; leave it out"
    )]
    NoReadings,
    /// Lost frames were logged.
    #[error(
        "--losses not-logged: {rows} rows of these data report lost frames (the first on line {line}), so that losses were logged; leave \
         it out"
    )]
    LossesAreThere {
        /// How many rows report some.
        rows: usize,
        /// The line of the first.
        line: usize,
    },
    /// Robots send no frames.
    #[error("--losses is about frames, and these data are robot samples; leave it out")]
    NoFrames,
    /// Every row is one frame, and a lost one shows no reading.
    #[error(
        "--given-rssi predicts the reception rate of a row from its mean RSSI reading, and here each row is one frame; a \
         lost frame has no reading. Aggregate the rows, with the columns frames and pdr, or leave the option out"
    )]
    SingleFrames,
    /// Nothing is known of what was lost, or nothing was.
    #[error(
        "--given-rssi predicts the reception rate, and none of the {rows} rows with a reading reports a lost frame, so \
         there is nothing to fit; leave it out"
    )]
    NothingLost {
        /// How many rows have a reading.
        rows: usize,
    },
    /// What is predicted decided which rows are used.
    #[error(
        "--where: {columns} is the outcome that --given-rssi predicts, and selecting rows by the outcome biases the \
         result; filter on something measured before the frame was sent, or on rssi_dbm"
    )]
    ChosenByReception {
        /// The columns.
        columns: String,
    },
    /// The model says who receives, whatever the strength.
    #[error(
        "--given-rssi: netsim.phy.propagation fixes who receives, independently of the RSSI; choose a model in which \
         reception depends on the RSSI, such as \"friis\""
    )]
    Stated,
}

fn listed(runs: &[u32]) -> String {
    runs.iter().map(u32::to_string).collect::<Vec<_>>().join(", ")
}

/// The columns and covariates of a study's rows, over which a condition is evaluated.
pub struct ConditionRows<'a> {
    /// The table of measurements that the choices are of.
    pub table: &'a DataTable,
    /// The line of each row in it.
    pub lines: Vec<usize>,
    /// The campaign of each row.
    pub runs: Vec<u32>,
    /// What follows from columns: a value per row.
    pub derived: Vec<(String, Vec<f64>)>,
    /// What a row is, in words: ` when a window begins`, or nothing.
    pub when: &'static str,
}

/// The rows that a study uses, and the reasons why others are rejected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RowSelection {
    /// Whether each row is used.
    pub rows: Vec<bool>,
    /// The others, by reason.
    pub rejected: Vec<Rejected>,
    /// Columns and covariates that the condition asks for.
    pub asked: Vec<String>,
}

impl Choices {
    /// Both lists of campaigns, each completed by the other.
    ///
    /// # Errors
    ///
    /// A campaign is not there, or is in both.
    pub fn resolved(&self, runs: &[u32]) -> Result<Self, ChoiceError> {
        let mut known = runs.to_vec();
        known.sort_unstable();
        known.dedup();
        for (option, list) in [("--fit-runs", &self.fit_runs), ("--score-runs", &self.score_runs)] {
            if let Some(&run) = list.iter().find(|run| !known.contains(run)) {
                let nearest = known.iter().copied().min_by_key(|known| known.abs_diff(run));
                let nearest = nearest.unwrap_or_default();
                return Err(ChoiceError::NoRun { option, run, nearest, known });
            }
        }
        if let Some(&run) = self.fit_runs.iter().find(|run| self.score_runs.contains(run)) {
            return Err(ChoiceError::Both { run });
        }
        let others = |list: &[u32]| -> Vec<u32> {
            known.iter().copied().filter(|run| !list.contains(run)).collect()
        };
        let mut all = self.clone();
        match (self.fit_runs.is_empty(), self.score_runs.is_empty()) {
            (true, true) | (false, false) => return Ok(all),
            (false, true) => all.score_runs = others(&self.fit_runs),
            (true, false) => all.fit_runs = others(&self.score_runs),
        }
        if all.score_runs.is_empty() {
            return Err(ChoiceError::NoneLeft { option: "--fit-runs", rest: "scored", known });
        }
        if all.fit_runs.is_empty() {
            let option = "--score-runs";
            return Err(ChoiceError::NoneLeft { option, rest: "fitted to", known });
        }
        Ok(all)
    }

    /// Which rows are used: those on which the condition holds, of campaigns that are fitted to or scored.
    ///
    /// # Errors
    ///
    /// The condition cannot be read, or holds nowhere.
    pub fn select_rows(&self, seen: &ConditionRows<'_>) -> Result<RowSelection, ChoiceError> {
        let n = seen.lines.len();
        let mut kept =
            RowSelection { rows: vec![true; n], rejected: Vec::new(), asked: Vec::new() };
        if let Some(condition) = &self.condition {
            let (truths, asked) = truths(condition, seen)?;
            kept.asked = asked;
            let when = seen.when;
            kept.leave_out(seen, format!("--where {condition:?} is not satisfied{when}"), |row| {
                truths[row] == 0.0
            });
            kept.leave_out(
                seen,
                format!("--where {condition:?} uses a value that is missing{when}"),
                |row| truths[row].is_nan(),
            );
            if !kept.rows.contains(&true) {
                return Err(ChoiceError::Nowhere { condition: condition.clone(), rows: n });
            }
        }
        if !self.score_runs.is_empty() {
            kept.leave_out(
                seen,
                "its run is in neither --fit-runs nor --score-runs".to_owned(),
                |row| {
                    let run = &seen.runs[row];
                    !self.fit_runs.contains(run) && !self.score_runs.contains(run)
                },
            );
        }
        Ok(kept)
    }

    /// Which rows are scored, by a fit to all others, of rows of these campaigns; none where rows are left out in turn.
    #[must_use]
    pub fn scored_rows(&self, runs: &[u32]) -> Option<Vec<bool>> {
        let of_runs = || runs.iter().map(|run| self.score_runs.contains(run)).collect();
        (!self.score_runs.is_empty()).then(of_runs)
    }
}

impl RowSelection {
    /// Leaves rows out that are still in.
    fn leave_out(
        &mut self,
        seen: &ConditionRows<'_>,
        reason: String,
        is_out: impl Fn(usize) -> bool,
    ) {
        let mut first_line = usize::MAX;
        let mut n = 0;
        for row in 0..self.rows.len() {
            if self.rows[row] && is_out(row) {
                self.rows[row] = false;
                n += 1;
                first_line = first_line.min(seen.lines[row]);
            }
        }
        if 0 < n {
            self.rejected.push(Rejected { reason, rows: n, first_line });
        }
    }
}

/// The value of a condition on each row, and what it asks for.
fn truths(
    condition: &str,
    seen: &ConditionRows<'_>,
) -> Result<(Vec<f64>, Vec<String>), ChoiceError> {
    let columns = seen.table.names().iter().map(String::as_str);
    let derived = seen.derived.iter().map(|(name, _)| name.as_str());
    let mut known: Vec<&str> = columns.chain(derived).collect();
    known.sort_unstable();
    known.dedup();
    let formula = Formula::condition(condition, &known)?;
    let first = seen.table.line(0);
    let of_name = |name: &String| -> Vec<f64> {
        match seen.table.column(name) {
            Some(column) => seen.lines.iter().map(|line| column[line - first]).collect(),
            None => seen
                .derived
                .iter()
                .find(|(other, _)| other == name)
                .map_or_else(Vec::new, |(_, values)| values.clone()),
        }
    };
    let columns: Vec<Vec<f64>> = formula.names().iter().map(of_name).collect();
    let mut values = vec![0.0; columns.len()];
    let of_row = |row| {
        for (value, column) in values.iter_mut().zip(&columns) {
            *value = column[row];
        }
        formula.evaluate(&values)
    };
    Ok(((0..seen.lines.len()).map(of_row).collect(), formula.names().to_vec()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(table: &DataTable) -> ConditionRows<'_> {
        ConditionRows {
            table,
            lines: vec![2, 3, 4, 5],
            runs: vec![1, 1, 2, 3],
            derived: vec![("distance_m".to_owned(), vec![1.0, 2.0, 3.0, f64::NAN])],
            when: "",
        }
    }

    fn table() -> DataTable {
        let columns = vec![vec![0.9, 0.2, f64::NAN, 0.8], vec![1.0, 2.0, 3.0, 4.0]];
        DataTable::of_columns(vec!["pdr".to_owned(), "tx".to_owned()], columns)
    }

    #[test]
    fn a_condition_keeps_rows_by_columns_and_by_what_follows_from_them() {
        let table = table();
        let selected_by = |condition: &str| {
            let choices = Choices { condition: Some(condition.to_owned()), ..Choices::default() };
            choices.select_rows(&seen(&table))
        };
        let kept = selected_by("pdr > 0.5").unwrap();
        assert_eq!(kept.rows, [true, false, false, true]);
        let rows: Vec<(usize, usize)> =
            kept.rejected.iter().map(|rejected| (rejected.rows, rejected.first_line)).collect();
        assert_eq!(rows, [(1, 3), (1, 4)]);
        assert!(kept.rejected[1].reason.contains("missing"), "{:?}", kept.rejected);
        assert_eq!(
            selected_by("distance_m < 2.5 or tx == 4").unwrap().rows,
            [true, true, false, true]
        );
        let error = selected_by("distanc_m < 2").unwrap_err().to_string();
        assert!(error.contains("did you mean distance_m?") && error.contains("\n    ^"), "{error}");
        let error = selected_by("pdr > 2").unwrap_err().to_string();
        assert!(error.contains("no row satisfies"), "{error}");
    }

    #[test]
    fn campaigns_that_are_not_named_are_the_others() {
        let selected_runs = |fit: &[u32], score: &[u32]| {
            let choices = Choices {
                fit_runs: fit.to_vec(),
                score_runs: score.to_vec(),
                ..Choices::default()
            };
            choices.resolved(&[1, 1, 2, 3])
        };
        assert_eq!(selected_runs(&[1], &[]).unwrap().score_runs, [2, 3]);
        assert_eq!(selected_runs(&[], &[3]).unwrap().fit_runs, [1, 2]);
        let both = selected_runs(&[1], &[3]).unwrap();
        let table = table();
        assert_eq!(both.select_rows(&seen(&table)).unwrap().rows, [true, true, false, true]);
        assert_eq!(selected_runs(&[1], &[1]).unwrap_err(), ChoiceError::Both { run: 1 });
        let error = selected_runs(&[1], &[9]).unwrap_err().to_string();
        assert!(error.contains("no run 9 (nearest valid: 3); their runs are 1, 2, 3"), "{error}");
        let error = selected_runs(&[1, 2, 3], &[]).unwrap_err().to_string();
        assert!(error.contains("no run is left to be scored"), "{error}");
    }
}
