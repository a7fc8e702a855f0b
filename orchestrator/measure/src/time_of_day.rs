//! When rows were measured, where that is known: the time of day, in UTC.

use crate::table::DataTable;
use numbers::statistics::median_high;

/// Times from here on (s) are epoch times: March 1973. No campaign lasts that long.
pub const EPOCH_S: f64 = 1e8;
/// An optional column: the epoch time (s) from which `time_s` of a row counts.
pub const START: &str = "start_epoch_s";
/// The covariate that follows: hours from midnight (UTC), from 0 to 24.
pub const TIME_OF_DAY: &str = "time_of_day_h";
/// A day (s).
const DAY_S: f64 = 86_400.0;
/// An hour (s).
const HOUR_S: f64 = 3600.0;

/// The epoch time of each row (s), NaN where it is unknown: `start_epoch_s` and `time_s`, or `time_s` itself where that is an epoch
/// time. None where no start is known.
#[must_use]
pub fn epoch_s(table: &DataTable) -> Option<Vec<f64>> {
    let times_s = table.column("time_s")?;
    if let Some(starts_s) = table.column(START) {
        let sums: Vec<f64> =
            starts_s.iter().zip(times_s).map(|(start, time)| start + time).collect();
        return sums.iter().any(|time_s| EPOCH_S <= *time_s).then_some(sums);
    }
    let mut known: Vec<f64> = times_s.iter().copied().filter(|time_s| time_s.is_finite()).collect();
    known.sort_by(f64::total_cmp);
    (EPOCH_S <= median_high(&known)).then(|| times_s.to_vec())
}

/// Hours since midnight (UTC) at an epoch time (s).
#[must_use]
pub fn hours(epoch_s: f64) -> f64 {
    let in_day_s = epoch_s - DAY_S * libm::floor(epoch_s / DAY_S);
    in_day_s / HOUR_S
}

/// The time of day of each row (h), where it may be another cause than the time since the start: rows span more than a day, or start
/// at several times and go on for an hour or more after one. Of short campaigns it would only say which of them a row is of.
#[must_use]
pub fn covariate(table: &DataTable) -> Option<Vec<f64>> {
    let epoch_s = epoch_s(table)?;
    let known = || epoch_s.iter().copied().filter(|time_s| time_s.is_finite());
    let span_s = known().fold(f64::NEG_INFINITY, f64::max) - known().fold(f64::INFINITY, f64::min);
    let starts_s = table.column(START).unwrap_or_default();
    let lasts_s = table.column("time_s")?.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut known_starts = starts_s.iter().filter(|start_s| start_s.is_finite());
    let first = known_starts.next();
    let differs = first.is_some_and(|first| known_starts.any(|other| other != first));
    (DAY_S <= span_s || differs && HOUR_S <= lasts_s)
        .then(|| epoch_s.into_iter().map(hours).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(times_s: &[f64], starts_s: Option<&[f64]>) -> DataTable {
        let names = ["time_s", START].map(str::to_owned);
        let columns = [Some(times_s), starts_s].into_iter().flatten().map(<[f64]>::to_vec);
        let columns: Vec<Vec<f64>> = columns.collect();
        DataTable::of_columns(names[..columns.len()].to_vec(), columns)
    }

    /// 2026-01-01T00:00:00Z.
    const MIDNIGHT_S: f64 = 1_767_225_600.0;

    #[test]
    fn hours_count_from_midnight() {
        assert_eq!(hours(MIDNIGHT_S), 0.0);
        assert_eq!(hours(MIDNIGHT_S + 8.5 * 3600.0), 8.5);
        assert_eq!(hours(MIDNIGHT_S - 3600.0), 23.0);
    }

    #[test]
    fn a_start_is_known_from_its_column_or_from_epoch_times() {
        assert_eq!(epoch_s(&table(&[0.0, 60.0], None)), None);
        assert_eq!(epoch_s(&table(&[MIDNIGHT_S], None)), Some(vec![MIDNIGHT_S]));
        let both = table(&[0.0, 60.0], Some(&[MIDNIGHT_S; 2]));
        assert_eq!(epoch_s(&both), Some(vec![MIDNIGHT_S, MIDNIGHT_S + 60.0]));
        assert_eq!(epoch_s(&table(&[0.0], Some(&[f64::NAN]))), None);
    }

    #[test]
    fn within_a_day_of_one_start_the_time_of_day_is_no_covariate() {
        let of = |span_s: f64| covariate(&table(&[MIDNIGHT_S, MIDNIGHT_S + span_s], None));
        assert_eq!(of(86_399.0), None);
        assert_eq!(of(86_400.0), Some(vec![0.0, 0.0]));
        let of_two = |lasts_s: f64| {
            covariate(&table(&[0.0, lasts_s], Some(&[MIDNIGHT_S, MIDNIGHT_S + 7200.0])))
        };
        assert_eq!(of_two(3600.0), Some(vec![0.0, 3.0]));
        assert_eq!(of_two(3599.0), None);
    }
}
