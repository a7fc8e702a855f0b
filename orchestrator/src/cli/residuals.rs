//! `--residuals`: the residual of each measured row as CSV, for other programs and for the page that shows a run.

use super::ReadArgs;
use diagnose::compare::explained;
use diagnose::rows::{MeasuredRows, PredictedRows};
use indexmap::IndexMap;
use measure::table::DataTable;
use numbers::statistics::quantile_nearest;
use std::path::Path;
use view::view;

/// A page is given at most so many rows of a file, spread evenly.
const MOST_ROWS: usize = 20_000;

/// Columns that say which link or window a row is, and where.
const LINK_KEYS: [&str; 6] = ["tx", "rx", "tx_x_m", "tx_y_m", "rx_x_m", "rx_y_m"];
const ROBOT_KEYS: [&str; 6] = ["agent", "agent", "start_x_m", "start_y_m", "end_x_m", "end_y_m"];
/// Columns of values, before the unit that ends their names.
const MEASURED: &str = "measured";
const PREDICTED: &str = "predicted";
const NOISE: &str = "sd";
const RESIDUAL: &str = "residual";
const WITH_EFFECTS: &str = "residual_with_effects";

/// The residuals of each row, as a table with names in its first line.
pub(super) fn csv(found: &PredictedRows) -> Result<Vec<u8>, csv::Error> {
    let (unit, level_unit, names, keys): (_, _, _, Vec<[f64; 6]>) = match &found.rows {
        MeasuredRows::Links(links) => {
            let rows = links.ends.iter().zip(&links.motes);
            let keys = rows.map(|(ends, motes)| {
                let [tx, rx] = ends.map(|end| end.place_m);
                [f64::from(motes[0]), f64::from(motes[1]), tx[0], tx[1], rx[0], rx[1]]
            });
            ("db", "dbm", LINK_KEYS, keys.collect())
        }
        MeasuredRows::Robots(robots) => {
            let rows = robots.ends.iter().zip(&robots.agents);
            let keys = rows.map(|([start, end], &agent)| {
                let agent = f64::from(agent);
                [agent, agent, start[0], start[1], end[0], end[1]]
            });
            ("m", "m", ROBOT_KEYS, keys.collect())
        }
    };
    let PredictedRows { before, after, covariates, .. } = found;
    let named = |name: &str, unit: &str| format!("{name}_{unit}");
    // Of equal names the first alone.
    let mut columns: IndexMap<String, Vec<f64>> = IndexMap::new();
    for (place, name) in names.into_iter().enumerate() {
        columns
            .entry(name.to_owned())
            .or_insert_with(|| keys.iter().map(|key| key[place]).collect());
    }
    columns.insert(named(MEASURED, level_unit), before.measured.clone());
    columns.insert(named(PREDICTED, level_unit), before.predicted.clone());
    columns.insert(named(NOISE, unit), before.sd.clone());
    columns.insert(named(RESIDUAL, unit), before.residuals());
    if let Some(after) = after {
        columns.insert(named(WITH_EFFECTS, unit), after.residuals());
    }
    for (name, values) in covariates {
        columns.entry(name.clone()).or_insert_with(|| values.clone());
    }
    let mut table = csv::Writer::from_writer(Vec::new());
    table.write_record(columns.keys())?;
    for row in 0..before.measured.len() {
        let fields = columns.values().map(|values| match values[row] {
            value if value.is_finite() => value.to_string(),
            _ => String::new(),
        });
        table.write_record(fields)?;
    }
    table.into_inner().map_err(|error| error.into_error().into())
}

/// The rows of such a file, for a page. `n_rows`: how many the answer was found from; `has_effects`: whether it has accepted any.
pub(super) fn read(
    path: &Path,
    n_rows: Option<usize>,
    has_effects: bool,
    reading: ReadArgs,
) -> Result<view::MeasuredRows, String> {
    const GIVE: &str =
        "give the file that compare or diagnose wrote with --residuals beside this answer";
    let table =
        DataTable::read(path, reading.reading()).map_err(|error| format!("{error}; {GIVE}"))?;
    if let Some(n_rows) = n_rows.filter(|n_rows| *n_rows != table.n_rows()) {
        return Err(format!(
            "{}: has {} rows, but the answer was found from {n_rows}; {GIVE}",
            path.display(),
            table.n_rows()
        ));
    }
    let kinds = [("db", "dbm", LINK_KEYS), ("m", "m", ROBOT_KEYS)];
    let is_kind = |unit: &str| table.column(&format!("{RESIDUAL}_{unit}")).is_some();
    let kind = kinds.into_iter().find(|(unit, ..)| is_kind(unit));
    let Some((unit, level_unit, keys)) = kind else {
        return Err(format!(
            "{}: has no column {RESIDUAL}_db or {RESIDUAL}_m; {GIVE}",
            path.display()
        ));
    };
    if table.column(&format!("{WITH_EFFECTS}_{unit}")).is_some() != has_effects {
        return Err(format!("{}: is of another answer; {GIVE}", path.display()));
    }
    let column = |name: &str| {
        table.column(name).ok_or_else(|| format!("{}: has no column {name}", path.display()))
    };
    let of_links: Vec<&[f64]> = keys.into_iter().map(column).collect::<Result<_, _>>()?;
    let [noise, residual, after] =
        [NOISE, RESIDUAL, WITH_EFFECTS].map(|name| format!("{name}_{unit}"));
    let levels = [MEASURED, PREDICTED].map(|name| format!("{name}_{level_unit}"));
    let (residuals, noises) = (column(&residual)?, column(&noise)?);

    let n_rows = table.n_rows();
    let stride = n_rows.div_ceil(MOST_ROWS).max(1);
    let floats = |values: &[f64]| values.iter().step_by(stride).map(|it| *it as f32).collect();
    let numbers = |values: &[f64]| values.iter().step_by(stride).map(|it| *it as u32).collect();
    let of_table = |name: &String| {
        let name = name.as_str();
        let is_value = [&noise, &residual, &after].into_iter().chain(&levels).any(|it| it == name);
        !is_value && !keys.contains(&name)
    };
    let covariates = table.names().iter().filter(|name| of_table(name)).map(|name| {
        let values = table.column(name).unwrap_or_default();
        view::Covariate {
            name: name.clone(),
            value: floats(values),
            explained: explained(values, residuals).map_or(f64::NAN, |it| it.explained),
        }
    });
    let mut known: Vec<f64> = noises.iter().copied().filter(|sd| sd.is_finite()).collect();
    known.sort_by(f64::total_cmp);
    if known.is_empty() {
        return Err(format!("{}: holds no row with a value in {noise}", path.display()));
    }
    Ok(view::MeasuredRows {
        from: numbers(of_links[0]),
        to: numbers(of_links[1]),
        from_x_m: floats(of_links[2]),
        from_y_m: floats(of_links[3]),
        to_x_m: floats(of_links[4]),
        to_y_m: floats(of_links[5]),
        residual: floats(residuals),
        residual_with_effects: table.column(&after).map(floats).unwrap_or_default(),
        noise: quantile_nearest(&known, 0.5) as f32,
        covariates: covariates.collect(),
        row_count: n_rows as u64,
    })
}
