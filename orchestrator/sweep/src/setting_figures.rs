//! One figure of all trials, setting by setting.

use super::plan::SweepPlan;
use super::sweep_summary::MetricSpread;
use super::table::TableColumn;
use record::ColumnKind;

/// A figure, by setting.
pub(super) struct SettingFigures<'a> {
    /// Its column.
    pub(super) column: &'a TableColumn,
    /// The values of each setting.
    pub(super) values: Vec<Vec<f64>>,
    /// What they tell.
    pub(super) spreads: Vec<Option<MetricSpread>>,
}

impl<'a> SettingFigures<'a> {
    /// Of trials whose network has formed.
    pub(super) fn from_trials(
        plan: &SweepPlan,
        column: &'a TableColumn,
        has_formed: &[bool],
    ) -> Self {
        let n_seeds = plan.seeds.len();
        let values: Vec<Vec<f64>> = column
            .numbers()
            .chunks(n_seeds)
            .zip(has_formed.chunks(n_seeds))
            .map(|(numbers, has_formed)| {
                let formed = numbers.iter().zip(has_formed).filter(|(_, formed)| **formed);
                formed.filter_map(|(number, _)| *number).collect()
            })
            .collect();
        let spreads = values.iter().map(|values| MetricSpread::from_values(values)).collect();
        Self { column, values, spreads }
    }

    /// A share of trials rather than a size.
    pub(super) fn is_share(&self) -> bool {
        self.column.kind == ColumnKind::Bool
    }
}
