//! Where the error of a task comes from: the answer, a table and a sentence.

use super::comparison::{
    HeardFile, PlacesOff, SCHEMA, TaskComparison, TaskErrorSplit, TaskFigureSplit, TaskVerdict,
};
use super::figures::FIGURES;
use super::{RunPlacement, TaskPart, TaskRuns, TaskSplit};
use crate::compare::ComparisonOptions;
use crate::error_split::{ErrorPart, PartOfFigure};
use crate::spread::kpi;
use indexmap::IndexMap;
use measure::account::DataAccount;
use numbers::format::{capitalised, number};
use numbers::layout::TextTable;
use std::fmt::Write as _;
use study::thresholds::CONSISTENCY_LEVEL;

/// What goes with neither.
const NEITHER: &str = "the model's network delivers other messages along the measured tracks than along the simulated \
                       ones; this difference is attributed to neither";

/// The names of the parts.
const PARTS: [&str; 3] = ["network", "robot", "neither"];

/// `polarisation is 0.31, where the model has 0.85 to 0.92`.
fn figure_text(k: usize, value: f64, runs: &TaskRuns) -> String {
    let [low, high] = runs.middle(k).map(number);
    let unit = FIGURES[k].unit;
    let space = if unit.is_empty() { "" } else { " " };
    let has = if low == high { low } else { format!("{low} to {high}") };
    format!("{} is {}{space}{unit}, not {has}", FIGURES[k].name, number(value))
}

/// A comparison in words: its p-value, and the figure that deviates most.
fn placement_text(placing: RunPlacement, value: &dyn Fn(usize) -> f64, runs: &TaskRuns) -> String {
    let most = placing
        .furthest
        .map_or_else(String::new, |k| format!(": {}", figure_text(k, value(k), runs)));
    format!("p = {:.3}{most}", placing.p_value)
}

/// The verdict, and the result in a sentence.
fn sentence(split: &TaskSplit) -> (TaskVerdict, String) {
    let network = placement_text(split.network, &|k| split.heard.mean(k), &split.own);
    let robot = placement_text(split.robot, &|k| split.measured.values[k], &split.heard);
    let differs = "the robots' behaviour is inconsistent with the model";
    match (split.network.is_found(), split.robot.is_found()) {
        (true, false) => (
            TaskVerdict::Network,
            format!(
                "the network causes the error: with the measured receptions, the model's robots deviate from their motion \
                 with its own network along the same tracks ({network}), and then match the measured robots ({robot})"
            ),
        ),
        (false, true) => (
            TaskVerdict::Robot,
            format!(
                "the robots cause the error: even with the measured receptions, the model's robots deviate from the \
                 measured ones ({robot}), and the network has no significant part ({network})"
            ),
        ),
        (true, true) => (
            TaskVerdict::Both,
            format!(
                "network and robots both cause the error: the measured receptions differ from those of the model's network \
                 along the same tracks ({network}), and with them the model's robots deviate from the measured ones \
                 ({robot})"
            ),
        ),
        (false, false) if split.model.p_value <= CONSISTENCY_LEVEL => (
            TaskVerdict::Open,
            format!(
                "{differs} (p = {:.3}), but neither the part of the network ({network}) nor that of the robots ({robot}) \
                 is significant by itself",
                split.model.p_value
            ),
        ),
        (false, false) => (
            TaskVerdict::Agrees,
            format!(
                "the robots' behaviour is consistent with the model (p = {:.3}), so there is no error to attribute",
                split.model.p_value
            ),
        ),
    }
}

/// The answer of a split.
#[must_use]
pub(super) fn answer(
    split: &TaskSplit,
    asked: ComparisonOptions,
    account: &DataAccount,
    heard: HeardFile,
) -> TaskComparison {
    let (verdict, sentence) = sentence(split);
    let (mut kpis, mut figures) = (Vec::new(), Vec::new());
    let (mut scores, mut intervals) = (IndexMap::new(), IndexMap::new());
    for (k, figure) in FIGURES.iter().enumerate() {
        let measured = split.measured.values[k];
        if measured.is_nan() {
            continue;
        }
        let [low, high] = split.whole.middle(k);
        let standing = split.standings[k];
        let seeds = split.whole.figures.iter().map(|run| run.values[k]).collect();
        let mean = split.whole.mean(k);
        if (measured - mean).is_finite() {
            scores.insert(figure.name.to_owned(), measured - mean);
            intervals.insert(figure.name.to_owned(), [measured - high, measured - low]);
        }
        kpis.push(kpi(figure, measured, mean, [low, high], seeds, standing));
        let part =
            |TaskPart { value, interval: [low, high] }| PartOfFigure { value, low, high, z: None };
        figures.push(TaskFigureSplit {
            name: figure.name,
            unit: figure.unit,
            measured,
            whole: mean,
            own_network_along_tracks: split.own.mean(k),
            with_what_was_heard: split.heard.mean(k),
            parts: PARTS.into_iter().zip(split.parts(k).map(|it| it.map(part))).collect(),
        });
    }
    let error_part = |part: &'static str, placing: RunPlacement| ErrorPart {
        part,
        p_value: placing.p_value,
        is_distinguishable: placing.is_found(),
        figure: placing.furthest.map(|k| FIGURES[k].name),
    };
    TaskComparison {
        schema: SCHEMA,
        kind: "task",
        unit: "seed",
        seeds: asked.seeds,
        from_s: asked.from_s,
        scores,
        intervals,
        kpis,
        places: [],
        p_value: split.model.p_value,
        verdict,
        sentence: sentence.clone(),
        error_split: TaskErrorSplit {
            order: ["network", "robot"],
            note: NEITHER,
            sentence,
            parts: [error_part("network", split.network), error_part("robot", split.robot)],
            figures,
            places_off_m: PlacesOff {
                whole: split.whole.off_m,
                own_network_along_tracks: split.own.off_m,
                with_what_was_heard: split.heard.off_m,
            },
        },
        account: account.clone(),
        heard,
    }
}

/// As a person reads it.
#[must_use]
pub(super) fn text(split: &TaskSplit) -> String {
    let mut table = TextTable::new([
        "figure (means)",
        "measured",
        "whole model",
        "own network",
        "as heard",
        "network",
        "robot",
        "neither",
    ]);
    for (k, figure) in FIGURES.iter().enumerate() {
        let measured = split.measured.values[k];
        if measured.is_nan() {
            continue;
        }
        let [whole, own, heard] =
            [&split.whole, &split.own, &split.heard].map(|runs| number(runs.mean(k)));
        let parts =
            split.parts(k).map(|part| part.map_or("–".to_owned(), |part| number(part.value)));
        let first = [figure.name.to_owned(), number(measured), whole, own, heard];
        table.row(first.into_iter().chain(parts));
    }
    let [whole, own, heard] =
        [&split.whole, &split.own, &split.heard].map(|runs| number(runs.off_m));
    table.row(["position error (m)".to_owned(), String::new(), whole, own, heard]);
    let mut text = table.text();
    let _ = write!(
        text,
        "own network: robots receive what the model's network delivers along the measured tracks; as heard: the measured \
         receptions\n{}\n\n{}",
        capitalised(NEITHER),
        capitalised(&sentence(split).1)
    );
    text
}
