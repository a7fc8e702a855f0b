//! The numbers of a figure as CSV (RFC 4180), a row for each point.

use crate::content::{Figure, Panel, Point, Scale, Series};

/// A point, and what it belongs to.
struct Row<'a> {
    place: usize,
    panel: &'a Panel,
    series: &'a Series,
    point: &'a Point,
}

/// A column, and what it has of a point.
type Column = (&'static str, fn(&Row<'_>) -> String);

/// Columns that every table has.
const ALWAYS: [Column; 6] = [
    ("panel", |row| row.place.to_string()),
    ("series", |row| row.series.name.clone()),
    ("x_label", |row| row.panel.x.label.clone()),
    ("x", |row| x_of(row.panel, row.point)),
    ("y_label", |row| row.panel.y.label.clone()),
    ("y", |row| number(row.point.y)),
];

/// Columns that a table has if a point has something in them.
const IF_ANY: [Column; 10] = [
    ("statistic", |row| row.point.statistic.unwrap_or_default().to_owned()),
    ("seed", |row| row.point.seed.map(|seed| seed.to_string()).unwrap_or_default()),
    ("low", |row| number(row.point.low)),
    ("high", |row| number(row.point.high)),
    ("interval", |row| row.point.interval.unwrap_or_default().to_owned()),
    ("n", |row| row.point.n.map(|n| n.to_string()).unwrap_or_default()),
    ("end_x", |row| number(row.point.end.map(|[x, _]| x))),
    ("end_y", |row| number(row.point.end.map(|[_, y]| y))),
    ("value", |row| number(row.point.value)),
    ("name", |row| row.point.name.clone()),
];

fn number(value: Option<f64>) -> String {
    value.map(|value| value.to_string()).unwrap_or_default()
}

fn x_of(panel: &Panel, point: &Point) -> String {
    match panel.x.scale {
        Scale::Category => {
            let place = libm::round(point.x).max(0.0) as usize;
            panel.x.categories.get(place).cloned().unwrap_or_default()
        }
        Scale::Linear | Scale::Log => point.x.to_string(),
    }
}

/// The table of a figure. Columns in which no point has anything are left out.
#[must_use]
pub fn csv(figure: &Figure) -> String {
    let rows: Vec<Row<'_>> = (1..)
        .zip(&figure.panels)
        .flat_map(|(place, panel)| panel.series.iter().map(move |series| (place, panel, series)))
        .flat_map(|(place, panel, series)| {
            series.points.iter().map(move |point| Row { place, panel, series, point })
        })
        .collect();
    let used = IF_ANY.iter().filter(|(_, field)| rows.iter().any(|row| !field(row).is_empty()));
    let columns: Vec<&Column> = ALWAYS.iter().chain(used).collect();
    let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
    let mut text = names.join(",") + "\n";
    for row in &rows {
        let fields: Vec<String> = columns.iter().map(|(_, field)| quoted(&field(row))).collect();
        text.push_str(&fields.join(","));
        text.push('\n');
    }
    text
}

/// A field, in quotation marks where it needs them.
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}
