//! The numbers of a figure as CSV (RFC 4180), a row for each point.

use crate::content::{Figure, Scale};

const COLUMNS: [&str; 14] = [
    "panel", "series", "x_label", "x", "y_label", "y", "low", "high", "interval", "n", "end_x",
    "end_y", "value", "name",
];

/// The table of a figure.
#[must_use]
pub fn csv(figure: &Figure) -> String {
    let mut text = COLUMNS.join(",") + "\n";
    let number = |value: Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
    for (place, panel) in (1..).zip(&figure.panels) {
        for series in &panel.series {
            for point in &series.points {
                let x = match panel.x.scale {
                    Scale::Category => panel
                        .x
                        .categories
                        .get(libm::round(point.x).max(0.0) as usize)
                        .cloned()
                        .unwrap_or_default(),
                    Scale::Linear | Scale::Log => point.x.to_string(),
                };
                let fields: [String; 14] = [
                    u32::to_string(&place),
                    series.name.clone(),
                    panel.x.label.clone(),
                    x,
                    panel.y.label.clone(),
                    number(point.y),
                    number(point.low),
                    number(point.high),
                    point.interval.unwrap_or_default().to_owned(),
                    point.n.map(|n| n.to_string()).unwrap_or_default(),
                    number(point.end.map(|[x, _]| x)),
                    number(point.end.map(|[_, y]| y)),
                    number(point.value),
                    point.name.clone(),
                ];
                let quoted: Vec<String> = fields.iter().map(|field| quoted(field)).collect();
                text.push_str(&quoted.join(","));
                text.push('\n');
            }
        }
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
