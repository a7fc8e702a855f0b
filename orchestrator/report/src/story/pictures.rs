//! Pictures of the story, drawn from the residuals of each row.

use super::{Story, StoryRow};
use crate::figures::{HALF, equal_scales};
use crate::layout::{self, NATS};
use crate::measured::ladder::{Bar, bars};
use crate::svg::{Axis, Chart};
use maud::{Markup, html};
use numbers::format::number;
use numbers::normal::Z_90;
use numbers::statistics::range;
use std::collections::BTreeMap;

/// Bins of the covariate.
const BINS: usize = 10;
/// Candidates that are drawn.
const MOST_CANDIDATES: usize = 7;
/// Classes of mean errors, from far too low to far too high, and what the key calls them.
const CLASSES: [(&str, &str); 5] = [
    ("pair low2", "far less than predicted"),
    ("pair low1", "less"),
    ("pair none", "as predicted"),
    ("pair high1", "more"),
    ("pair high2", "far more"),
];

/// Rows between the same two places: the places (m), the number of readings, and the sum of their errors.
type Group = ([[f64; 2]; 2], f64, f64);

/// The class of links without a reading.
const SILENT: &str = "silent";
/// A mean error of fewer standard errors than this counts as none.
const CLEAR: f64 = 2.0;

/// The class of a mean error of so many rows, in standard deviations of the noise.
fn class(mean: f64, n: f64) -> usize {
    let mean = if mean.abs() * n.sqrt() < CLEAR { 0.0 } else { mean };
    [-1.0, -1.0 / 3.0, 1.0 / 3.0, 1.0].iter().filter(|&&edge| edge < mean).count()
}

/// Where the errors were made, and over what: pictures of the same height.
pub(super) fn errors(story: &Story<'_>) -> Markup {
    let (map, height) = map(story);
    html! {
        (map)
        @if let Some(picture) = over_symptom(story, height) { (picture) }
    }
}

/// The errors on the map, and the height of the picture.
fn map(story: &Story<'_>) -> (Markup, f64) {
    let walls: Vec<[[f64; 2]; 2]> =
        story.site.wall.iter().map(|wall| [wall.from_m, wall.to_m]).collect();
    let foliage: Vec<Vec<[f64; 2]>> =
        story.site.foliage.iter().map(|area| area.polygon_m.clone()).collect();
    let rows = story.rows.iter().flat_map(|row| row.ends);
    let places: Vec<[f64; 2]> = rows
        .chain(walls.iter().flatten().copied())
        .chain(foliage.iter().flatten().copied())
        .collect();
    let span = |axis: usize| range(places.iter().map(|place| place[axis]));
    let (x, y, height) = equal_scales(span(0), span(1), HALF);
    let mut chart = Chart::new(x, y, HALF, height).as_map();
    for area in &foliage {
        chart.line("foliage", area.iter().chain(area.first()).map(|&corner| Some(corner)));
    }
    // Rows between the same two places, in either direction.
    let mut groups: BTreeMap<[u64; 4], Group> = BTreeMap::new();
    for row in &story.rows {
        let mut ends = row.ends;
        ends.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        let [[x0, y0], [x1, y1]] = ends;
        let group = groups.entry([x0, y0, x1, y1].map(f64::to_bits)).or_insert((ends, 0.0, 0.0));
        if row.error.is_finite() {
            group.1 += 1.0;
            group.2 += row.error;
        }
    }
    let silent = groups.values().filter(|(_, n, _)| *n == 0.0);
    chart.segments(SILENT, silent.map(|(ends, ..)| *ends));
    let known: Vec<_> = groups.values().filter(|(_, n, _)| 0.0 < *n).collect();
    for (number, (name, _)) in CLASSES.iter().enumerate() {
        let of_class =
            || known.iter().filter(|(_, n, sum)| class(sum / n / story.noise, *n) == number);
        chart.names(of_class().map(|(_, n, sum)| {
            format!("mean {} {} (n = {n})", numbers::format::number(sum / n), story.unit)
        }));
        chart.segments(name, of_class().map(|(ends, ..)| *ends));
    }
    chart.site("story-plane", &walls, &[]);
    let mut motes: BTreeMap<u32, [f64; 2]> = BTreeMap::new();
    if story.unit == "dB" {
        for StoryRow { ends, numbers, .. } in &story.rows {
            motes.extend(numbers.iter().copied().zip(ends.iter().copied()));
        }
    }
    chart.names(motes.keys().map(u32::to_string));
    chart.dots("mote", motes.values().copied());
    chart.numbers(motes.iter().map(|(mote, place)| (*mote as usize, *place)));
    let mut key: Vec<(&str, &str)> = CLASSES.to_vec();
    if known.len() < groups.len() {
        key.push((SILENT, "no frame received"));
    }
    key.push(("wall", "wall"));
    if !foliage.is_empty() {
        key.push(("foliage", "foliage"));
    }
    if !motes.is_empty() {
        key.push(("mote", "mote"));
    }
    let words = if story.unit == "dB" {
        "Lines are links, coloured by the mean of measured less predicted signal strength. Only received frames count, so links at the \
         limit look stronger than they are."
    } else {
        "Lines are windows of measured tracks, coloured by how much farther the robot moved than predicted."
    };
    let svg = chart.finish("story-map", "Error on the map", words);
    (figure("Error on the map", words, &key, &svg), height)
}

/// The mean error over the covariate that explains most of it, by the model and by the extended one.
fn over_symptom(story: &Story<'_>, height: f64) -> Option<Markup> {
    let symptom = story.symptom.as_ref()?;
    let mut order: Vec<usize> = (0..symptom.values.len().min(story.rows.len()))
        .filter(|&row| symptom.values[row].is_finite() && story.rows[row].error.is_finite())
        .collect();
    order.sort_by(|&a, &b| symptom.values[a].total_cmp(&symptom.values[b]));
    if order.len() < 2 * BINS {
        return None;
    }
    let mean = |rows: &[usize], value: &dyn Fn(usize) -> f64| {
        rows.iter().map(|&row| value(row)).sum::<f64>() / rows.len() as f64
    };
    let bins: Vec<&[usize]> = order.chunks(order.len().div_ceil(BINS)).collect();
    let half = |rows: &[usize]| Z_90 * story.noise / (rows.len() as f64).sqrt();
    let halves: Vec<f64> = bins.iter().map(|rows| half(rows)).collect();
    let line = |error: &dyn Fn(usize) -> f64| -> Vec<[f64; 2]> {
        bins.iter()
            .map(|rows| [mean(rows, &|row| symptom.values[row]), mean(rows, error)])
            .collect()
    };
    let before = line(&|row| story.rows[row].error);
    let has_after = story.rows.iter().any(|row| row.error_with_effects.is_some());
    let after = line(&|row| story.rows[row].error_with_effects.unwrap_or(f64::NAN));
    let top = before.iter().map(|[_, y]| y.abs()).fold(story.noise, f64::max) * 1.1;
    let (first, last) = (before.first()?[0], before.last()?[0]);
    let mut chart = Chart::new(
        Axis::new(&symptom.name, first, last),
        Axis::new(&format!("measured less predicted ({})", story.unit), -top, top),
        HALF,
        height,
    );
    chart.guides("zero", [[[first, 0.0], [last, 0.0]]]);
    let means = |points: &[[f64; 2]]| -> Vec<([f64; 4], f64)> {
        let rows = points.iter().zip(&halves).zip(&bins);
        let known = rows.filter(|((point, _), _)| point[1].is_finite());
        known.map(|((&[x, y], half), bin)| ([x, y, y - half, y + half], bin.len() as f64)).collect()
    };
    chart.means("before", &means(&before));
    chart.knots("point before", before.iter().copied());
    let mut key = vec![("before", "model as configured")];
    if has_after {
        chart.means("after", &means(&after));
        chart.knots("point after", after.into_iter().filter(|point| point[1].is_finite()));
        key.push(("after", "extended model"));
    }
    let title = format!("Mean error over {}", symptom.name);
    let words = "A right model has a mean error of zero everywhere, up to noise (bars: 90 %) and to the loss of weak frames.";
    Some(figure(&title, words, &key, &chart.finish("story-symptom", &title, words)))
}

/// The error with each effect that was accepted.
pub(super) fn ladder(story: &Story<'_>) -> Markup {
    let mut rows: Vec<Bar> = story
        .ladder
        .iter()
        .enumerate()
        .map(|(rung, (model, error))| Bar {
            label: model.clone(),
            value: *error,
            half: 0.0,
            class: if rung == 0 { "" } else { "after" },
            text: story.error(*error),
        })
        .collect();
    rows.push(Bar {
        label: "the true model".to_owned(),
        value: story.noise,
        half: 0.0,
        class: "none",
        text: story.error(story.noise),
    });
    let words = "Root mean squared error on held-out rows. The error of the true model is noise.";
    let label = format!("root mean squared error ({})", story.unit);
    figure(
        "Error, effect by effect",
        words,
        &[],
        &bars("story-ladder", "Error", ["model", &label], words, &rows),
    )
}

/// What the best candidates gain.
pub(super) fn candidates(story: &Story<'_>) -> Option<Markup> {
    let rows: Vec<Bar> = story
        .candidates
        .iter()
        .filter(|candidate| candidate.gain != 0.0)
        .take(MOST_CANDIDATES)
        .map(|candidate| Bar {
            label: candidate.effect.clone(),
            value: candidate.gain,
            half: candidate.half,
            class: if candidate.accepted { "after" } else { "none" },
            text: number(candidate.gain),
        })
        .collect();
    let words = format!(
        "Gain in held-out log score (nats per row) with its 90 % interval. Accepted effects: the gain when they were added. Others: \
         the gain on top of these. {NATS}"
    );
    let key = [("bar after", "accepted"), ("bar none", "not accepted")];
    let svg = bars(
        "story-candidates",
        "Gain of candidates",
        ["effect", "held-out gain (nats per row)"],
        &words,
        &rows,
    );
    (!rows.is_empty()).then(|| figure("Gain of candidates", &words, &key, &svg))
}

fn figure(title: &str, words: &str, key: &[(&str, &str)], svg: &Markup) -> Markup {
    let words = html! { p { (words) } };
    let key = html! { @for (mark, words) in key { (layout::key_entry(mark, None, words)) } };
    layout::figure(title, &words, &key, svg, false)
}
