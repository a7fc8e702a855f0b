//! Curves of one run as a figure of a panel, or of several runs over each other with a panel for each quantity.

use super::RunFolder;
use crate::content::{Axis, DrawnRun, Figure, Mark, Panel, Point, SCHEMA, Scale, Series};
use numbers::format::capitalised;
use numbers::statistics::range;

/// From this ratio of the greatest to the least value on, an axis that may be logarithmic is.
const LOG_RATIO: f64 = 20.0;

/// What a kind of figure shows of one run.
pub(crate) struct Curves {
    /// What the figure is called.
    pub what: &'static str,
    /// What it shows, in a sentence that holds for every run.
    pub explains: String,
    /// The numbers of this run, in words without a stop at the end.
    pub numbers: String,
    /// What the marks are, where they need words.
    pub note: &'static str,
    /// The label of the horizontal axis.
    pub x_label: String,
    /// The horizontal axis reaches at least over these; none: from the least to the greatest value, by their logarithms where they
    /// span much.
    pub x: Option<[f64; 2]>,
    /// The label of the vertical axis, where all curves are in one panel.
    pub y_label: &'static str,
    /// Vertical values are shares, and reach up to this one; else they begin at 0.
    pub share_up_to: Option<f64>,
    /// The curves.
    pub curves: Vec<Curve>,
}

/// One quantity.
pub(crate) struct Curve {
    /// What the legend calls it beside others of the same run.
    pub name: String,
    /// The label of the vertical axis of a panel of its own.
    pub y_label: String,
    /// How it is drawn.
    pub mark: Mark,
    /// Its points.
    pub points: Vec<Point>,
}

/// The figure of one run.
pub(super) fn of_one(run: &RunFolder<'_>, curves: &Curves) -> Figure {
    let caption = format!("{} {}.", curves.explains, capitalised(&curves.numbers));
    let title = format!("{}: {}", run.name(), curves.what);
    let note = curves.note.to_owned();
    let series = (0..).zip(&curves.curves).map(|(group, curve)| Series {
        name: curve.name.clone(),
        mark: curve.mark,
        group: Some(group),
        points: curve.points.clone(),
    });
    let panel = panel(&[curves], curves.y_label, series.collect());
    Figure { note, ..Figure::of_panel(title, caption, panel) }
}

/// The figure of several runs: their curves over each other, a panel for each quantity.
pub(super) fn of_several(runs: &[DrawnRun], of_each: &[Curves]) -> Figure {
    let first = &of_each[0];
    let mut quantities: Vec<(&str, &str)> = Vec::new();
    for curve in of_each.iter().flat_map(|curves| &curves.curves) {
        if !quantities.iter().any(|(name, _)| *name == curve.name) {
            quantities.push((&curve.name, &curve.y_label));
        }
    }
    let all: Vec<&Curves> = of_each.iter().collect();
    let panels = quantities.iter().map(|(quantity, y_label)| {
        let series = runs.iter().zip(of_each).enumerate().flat_map(|(group, (run, curves))| {
            let own = curves.curves.iter().filter(|curve| curve.name == *quantity);
            own.map(move |curve| Series {
                name: run.name.clone(),
                mark: curve.mark,
                group: Some(group),
                points: curve.points.clone(),
            })
        });
        panel(&all, y_label, series.collect())
    });
    let panels = panels.collect();
    let numbers: Vec<String> = runs
        .iter()
        .zip(of_each)
        .map(|(run, curves)| {
            let folder = run.name.split_once(": ").map_or(run.name.as_str(), |(folder, _)| folder);
            format!("{folder}: {}", curves.numbers)
        })
        .collect();
    Figure {
        schema: SCHEMA,
        title: format!("{} runs: {}", runs.len(), first.what),
        caption: format!("{} {}.", first.explains, numbers.join("; ")),
        note: first.note.to_owned(),
        runs: runs.to_vec(),
        panels,
    }
}

fn panel(all: &[&Curves], y_label: &str, series: Vec<Series>) -> Panel {
    let first = all[0];
    let points = || series.iter().flat_map(|series| &series.points);
    let x = match first.x {
        Some(_) => {
            let ends = all.iter().filter_map(|curves| curves.x).flatten();
            Axis::linear(&first.x_label, range(ends))
        }
        None => by_ratio(&first.x_label, points().map(|point| point.x)),
    };
    let y = match first.share_up_to {
        Some(most) => Axis::linear(y_label, [0.0, most]).of_shares(),
        None => {
            let values = points().flat_map(|point| [point.y, point.high]).flatten();
            let [_, high] = range(values.chain([0.0]));
            Axis::linear(y_label, [0.0, 1.05 * high])
        }
    };
    Panel { x, y, is_map: false, series, colour: None }
}

/// An axis from the least value that is not 0 to the greatest, by their logarithms where they span much.
fn by_ratio(label: &str, values: impl Iterator<Item = f64> + Clone) -> Axis {
    let [low, high] = range(values.clone().filter(|value| 0.0 < *value));
    if 0.0 < low && LOG_RATIO * low < high {
        return Axis { scale: Scale::Log, ..Axis::linear(label, [low, high]) };
    }
    Axis::linear(label, range(values.chain([0.0])))
}
