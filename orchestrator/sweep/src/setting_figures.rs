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
    /// The seed of each of these values.
    pub(super) seeds: Vec<Vec<u64>>,
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
        let (seeds, values): (Vec<Vec<u64>>, Vec<Vec<f64>>) = column
            .numbers()
            .chunks(n_seeds)
            .zip(has_formed.chunks(n_seeds))
            .map(|(numbers, has_formed)| {
                let formed = plan.seeds.iter().zip(numbers).zip(has_formed);
                let formed = formed.filter(|(_, formed)| **formed);
                formed.filter_map(|((seed, number), _)| Some((*seed, (*number)?))).unzip()
            })
            .unzip();
        let spreads = values.iter().map(|values| MetricSpread::from_values(values)).collect();
        Self { column, values, seeds, spreads }
    }

    /// A share of trials rather than a size.
    pub(super) fn is_share(&self) -> bool {
        self.column.kind == ColumnKind::Bool
    }
}
