//! Two files of measurements as one table: those of the second are campaigns of their own.

use crate::memory::Memory;
use crate::table::DataTable;
use crate::time_of_day::{EPOCH_S, START};
use std::collections::BTreeSet;

/// The column that numbers campaigns.
const RUN: &str = "run";
/// The column of times.
const TIME: &str = "time_s";

/// Two tables as one.
#[derive(Clone, Debug)]
pub struct Pooled {
    /// The rows of the first table, then those of the second, with the columns that both have, and `run`.
    pub table: DataTable,
    /// Numbers of the campaigns of the second table; those of the first keep theirs.
    pub second_runs: Vec<u32>,
    /// Columns that only one of the two has. They are not used.
    pub left_out: Vec<String>,
}

/// Pools two tables of the same kind. Campaigns of the second are numbered from beyond those of the first. Times of a table that
/// are epoch times count from its first row, so that a gap between the two takes no part in anything. Where both state from when their
/// times count, so does the pooled table (`start_epoch_s`), and rows have a time of day.
///
/// # Errors
///
/// The two have no column in common, or numbers of campaigns that cannot be continued, or they need more memory than the budget of
/// the first.
pub fn pool(first: &DataTable, second: &DataTable) -> Result<Pooled, String> {
    let offset = 1.0 + last_run(first)?;
    if f64::from(u32::MAX) < offset + last_run(second)? {
        return Err(format!(
            "{}: run must be at most {}, so that the campaigns of both files can be numbered",
            second.path.display(),
            f64::from(u32::MAX) - offset
        ));
    }
    let names: Vec<String> = first
        .names()
        .iter()
        .filter(|name| *name != RUN && second.column(name).is_some())
        .cloned()
        .collect();
    if names.is_empty() {
        return Err("the two files have no column in common".to_owned());
    }
    let both = [first, second];
    let left_out = both
        .iter()
        .zip([second, first])
        .flat_map(|(table, other)| {
            let is_start_known = starts_s(table).is_some() && starts_s(other).is_some();
            table.names().iter().filter(move |name| {
                *name != RUN && other.column(name).is_none() && !(is_start_known && *name == START)
            })
        })
        .cloned()
        .collect();
    let runs_of = |table: &DataTable, offset: f64| -> Vec<f64> {
        let runs = table.column(RUN).map_or_else(|| vec![0.0; table.n_rows()], <[f64]>::to_vec);
        runs.into_iter().map(|run| offset + if run.is_nan() { 0.0 } else { run }).collect()
    };
    let runs = [runs_of(first, 0.0), runs_of(second, offset)];
    let numbers: BTreeSet<u32> = runs[1].iter().map(|run| *run as u32).collect();
    let mut columns: Vec<Vec<f64>> = names
        .iter()
        .map(|name| {
            let of = |table: &DataTable| {
                let column = table.column(name).unwrap_or_default();
                let start_s = if name == TIME { epoch_start_s(column) } else { 0.0 };
                column.iter().map(|value| value - start_s).collect::<Vec<f64>>()
            };
            [of(first), of(second)].concat()
        })
        .collect();
    columns.push(runs.concat());
    let mut all = names.clone();
    all.push(RUN.to_owned());
    if !names.iter().any(|name| name == START)
        && let (Some(first), Some(second)) = (starts_s(first), starts_s(second))
    {
        columns.push([first, second].concat());
        all.push(START.to_owned());
    }
    let mut table = DataTable::of_columns(all, columns);
    let place = |column: usize, table: &DataTable| {
        names.iter().position(|name| *name == table.names()[column])
    };
    for (before, source) in [(0, first), (first.n_rows(), second)] {
        for (row, column, text) in source.strange() {
            if let Some(column) = place(column, source) {
                table.add_strange(before + row, column, text);
            }
        }
    }
    table.path = second.path.clone();
    let mut memory = Memory::new(first.budget());
    memory.take(table.n_bytes(), format_args!("{} rows of both files together", table.n_rows()))?;
    table.memory = memory;
    Ok(Pooled { table, second_runs: numbers.into_iter().collect(), left_out })
}

/// The greatest number of a campaign; 0 where campaigns have none.
fn last_run(table: &DataTable) -> Result<f64, String> {
    let known = table.column(RUN).unwrap_or_default().iter().filter(|run| !run.is_nan());
    let mut last: f64 = 0.0;
    for &run in known {
        if run < 0.0 || run.fract() != 0.0 || f64::from(u32::MAX) < run {
            return Err(format!(
                "{}: run is {run}; campaigns are numbered by whole numbers from 0 to {}",
                table.path.display(),
                u32::MAX
            ));
        }
        last = last.max(run);
    }
    Ok(last)
}

/// The first of epoch times (s); 0 where times count from the start of a campaign.
fn epoch_start_s(times_s: &[f64]) -> f64 {
    let first_s = times_s.iter().copied().fold(f64::INFINITY, f64::min);
    if first_s.is_finite() && EPOCH_S <= first_s { first_s } else { 0.0 }
}

/// The epoch time (s) from which the times of each row count, once epoch times count from the first; none where it is unknown.
fn starts_s(table: &DataTable) -> Option<Vec<f64>> {
    if let Some(starts_s) = table.column(START) {
        return Some(starts_s.to_vec());
    }
    let start_s = epoch_start_s(table.column(TIME)?);
    (EPOCH_S <= start_s).then(|| vec![start_s; table.n_rows()])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(names: &[&str], columns: &[&[f64]]) -> DataTable {
        let names = names.iter().map(|name| (*name).to_owned()).collect();
        DataTable::of_columns(names, columns.iter().map(|column| column.to_vec()).collect())
    }

    #[test]
    fn campaigns_of_the_second_are_numbered_beyond_those_of_the_first() {
        let first = table(&["time_s", "run", "a"], &[&[0.0, 1.0], &[2.0, 5.0], &[7.0, 8.0]]);
        let second = table(&["time_s", "a"], &[&[0.0, 3.0], &[9.0, f64::NAN]]);
        let Pooled { table: pooled, second_runs, left_out } = pool(&first, &second).unwrap();
        assert_eq!(second_runs, [6]);
        assert!(left_out.is_empty());
        assert_eq!(pooled.column("run"), Some(&[2.0, 5.0, 6.0, 6.0][..]));
        assert_eq!(pooled.column("a").unwrap()[..3], [7.0, 8.0, 9.0]);
        assert!(pooled.column("a").unwrap()[3].is_nan());
        let Pooled { second_runs, .. } = pool(&second, &first).unwrap();
        assert_eq!(second_runs, [3, 6]);
    }

    #[test]
    fn columns_of_one_file_alone_are_left_out_and_named() {
        let first = table(&["time_s", "wind_mps"], &[&[0.0], &[1.0]]);
        let second = table(&["time_s", "battery_v"], &[&[0.0], &[3.0]]);
        let pooled = pool(&first, &second).unwrap();
        assert_eq!(pooled.left_out, ["wind_mps", "battery_v"]);
        assert_eq!(pooled.table.names(), ["time_s", "run"]);
        let nothing = pool(&table(&["a"], &[&[0.0]]), &table(&["b"], &[&[0.0]]));
        assert_eq!(nothing.unwrap_err(), "the two files have no column in common");
    }

    #[test]
    fn epoch_times_count_from_the_first_row_of_each_file_and_others_stay() {
        let epoch = table(&["time_s"], &[&[1.7e9 + 5.0, 1.7e9]]);
        let plain = table(&["time_s"], &[&[100.0, 200.0]]);
        let pooled = pool(&epoch, &plain).unwrap().table;
        assert_eq!(pooled.column("time_s"), Some(&[5.0, 0.0, 100.0, 200.0][..]));
        assert_eq!(pooled.column(START), None);
    }

    #[test]
    fn a_start_that_both_state_in_any_way_is_kept() {
        let epoch = table(&["time_s"], &[&[1.7e9 + 5.0, 1.7e9]]);
        let column = table(&["time_s", START], &[&[0.0, 5.0], &[1.8e9; 2]]);
        let starts = |first, second| {
            let Pooled { table, left_out, .. } = pool(first, second).unwrap();
            (table.column(START).map(<[f64]>::to_vec), left_out)
        };
        assert_eq!(starts(&epoch, &epoch).0, Some(vec![1.7e9; 4]));
        assert_eq!(starts(&column, &column).0, Some(vec![1.8e9; 4]));
        assert_eq!(starts(&epoch, &column).0, Some(vec![1.7e9, 1.7e9, 1.8e9, 1.8e9]));
        let plain = table(&["time_s"], &[&[100.0]]);
        assert_eq!(starts(&plain, &column), (None, vec![START.to_owned()]));
    }

    #[test]
    fn a_field_that_is_no_number_keeps_its_place() {
        let mut second = table(&["b", "time_s"], &[&[1.0], &[f64::NAN]]);
        second.add_strange(0, 1, "soon");
        second.add_strange(0, 0, "left out");
        let pooled = pool(&table(&["time_s"], &[&[0.0, 1.0]]), &second).unwrap().table;
        assert_eq!(pooled.strange().collect::<Vec<_>>(), [(2, 0, "soon")]);
    }

    #[test]
    fn numbers_of_campaigns_that_are_none_are_refused() {
        let good = table(&["run"], &[&[0.0]]);
        for wrong in [-1.0, 0.5, 5e9] {
            let bad = table(&["run", "time_s"], &[&[wrong], &[0.0]]);
            assert!(pool(&good, &bad).unwrap_err().contains("whole numbers from 0 to 4294967295"));
        }
        let last = table(&["run", "time_s"], &[&[4294967295.0], &[0.0]]);
        let first = table(&["run", "time_s"], &[&[0.0], &[0.0]]);
        assert!(pool(&first, &last).unwrap_err().contains("at most 4294967294"));
    }
}
