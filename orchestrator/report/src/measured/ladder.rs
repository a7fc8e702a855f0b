//! The ladder of held-out error, and what each candidate gains.

use super::{MeasuredPage, Picture, figures};
use crate::svg::data::{ChartData, Kind};
use crate::svg::{Axis, Px};
use diagnose::diagnosis::{Diagnosis, Rung, Tested};
use maud::{Markup, html};
use numbers::format::number;
use numbers::normal::Z_90;
use numbers::quantity;

/// Width of a picture, of its labels, of the numbers at its right end.
const WIDTH: f64 = 540.0;
const LABELS: f64 = 190.0;
const NUMBERS: f64 = 88.0;
/// Height of a row.
const ROW: f64 = 30.0;
/// Candidates that are shown.
const MOST_CANDIDATES: usize = 12;

/// A row of bars.
pub(crate) struct Bar {
    pub(crate) label: String,
    pub(crate) value: f64,
    /// Half of an interval about it.
    pub(crate) half: f64,
    /// Class of the bar, beside `bar`.
    pub(crate) class: &'static str,
    /// What stands at its right end.
    pub(crate) text: String,
}

/// A picture of bars, one below the other, with its data.
///
/// * `id`: the identifier that its name and text begin with.
/// * `of`, `label`: what each bar is of, and what bars measure, with the unit.
pub(crate) fn bars(
    id: &str,
    title: &str,
    [of, label]: [&str; 2],
    alternative: &str,
    rows: &[Bar],
) -> Markup {
    let low = rows.iter().map(|row| row.value - row.half).fold(0.0, f64::min);
    let high = rows.iter().map(|row| row.value + row.half).fold(1e-9, f64::max);
    let plane = WIDTH - LABELS - NUMBERS;
    let x = |value: f64| LABELS + (value - low) / (high - low) * plane;
    let height = ROW * rows.len() as f64 + 8.0;
    let bar = |k: usize, row: &Bar| {
        let (top, middle) = (ROW * k as f64 + 8.0, ROW * k as f64 + 4.0 + ROW / 2.0);
        let (from, to) = (x(0.0).min(x(row.value)), x(0.0).max(x(row.value)));
        let text_y = Px(middle + 4.0);
        html! {
            text.row x=(Px(LABELS - 10.0)) y=(text_y) text-anchor="end" { (row.label) }
            path class={ "bar " (row.class) }
                d=(format_args!("M{from:.1},{top:.1}H{to:.1}v{:.1}H{from:.1}Z", ROW - 8.0)) {}
            @if 0.0 < row.half {
                @let (a, b) = (x(row.value - row.half), x(row.value + row.half));
                path.axis d=(format_args!("M{a:.1},{middle:.1}H{b:.1}")) {}
            }
            text.value x=(Px(WIDTH - 4.0)) y=(text_y) text-anchor="end" { (row.text) }
        }
    };
    let zero = x(0.0);
    let names: Vec<String> = rows.iter().map(|row| row.label.clone()).collect();
    let n = rows.len() as f64;
    let categories = Axis::new(of, 0.0, n).named(&names);
    let values = Axis::new(label, low, high);
    let mut data = ChartData::default();
    data.is_transposed = true;
    // For figures without a key.
    data.words =
        ["bar", "bar after", "bar none"].map(|class| (class.to_owned(), "value".to_owned())).into();
    let has_intervals = rows.iter().any(|row| 0.0 < row.half);
    for (k, row) in rows.iter().enumerate() {
        let class = format!("bar {}", row.class);
        let place = k as f64;
        if has_intervals {
            let ends = [row.value - row.half, row.value + row.half];
            data.add(class.trim_end(), Kind::Intervals, [[place, row.value, ends[0], ends[1]]]);
        } else {
            data.add(class.trim_end(), Kind::Dots, [[place, row.value]]);
        }
    }
    // A category lies in the middle of its row.
    let first = 4.0 + ROW / 2.0;
    let plane = [x(low), first, x(high), first + ROW * n];
    html! {
        svg viewBox={ "0 0 " (WIDTH) " " (height) } role="img"
            aria-labelledby={ (id) "-title " (id) "-text" }
        {
            title id={ (id) "-title" } { (title) }
            desc id={ (id) "-text" } { (alternative) }
            g.marks { @for (k, row) in rows.iter().enumerate() { (bar(k, row)) } }
            path.axis d=(format_args!("M{zero:.1},4V{:.1}", height - 2.0)) {}
        }
        (data.markup(plane, &categories, &values))
    }
}

/// The ladder in pictures.
pub(super) fn section(contents: &MeasuredPage<'_>) -> Option<Markup> {
    let pictures = pictures(contents.answer.diagnosis()?, contents.unit());
    let intro = "Effects are added one at a time, each time the one that makes the model predict best what it has not seen, until \
                 none does beyond chance. Each bar is a model with one effect more, fitted anew with all before it; all scores are \
                 of data that were left out. What no effect takes away is noise, or physics that is not in the catalogue.";
    figures("Which effects are missing", intro, &pictures)
}

fn pictures(diagnosis: &Diagnosis, unit: &str) -> Vec<Picture> {
    let rungs = &diagnosis.ladder;
    let losses = |rung: &Rung| rung.reception_log_loss;
    let mut pictures: Vec<Picture> = Vec::new();
    let means = "Root mean square of what was measured less what was predicted.";
    pictures.extend(fall(rungs, "rmse", |rung| rung.rmse, ["Error", means], unit));
    let words = [
        "Log loss of reception",
        "How surprised the model is by frames that were received or lost.",
    ];
    pictures.extend(fall(rungs, "reception_log_loss", losses, words, "nats a frame"));
    pictures.extend(gained(rungs));
    pictures.extend(candidates(diagnosis));
    pictures
}

/// How an error falls from rung to rung; `key`: its name in the answer; `title`, `means`: what it is.
fn fall(
    rungs: &[Rung],
    key: &str,
    error: fn(&Rung) -> f64,
    [title, means]: [&str; 2],
    unit: &str,
) -> Option<Picture> {
    let values: Vec<f64> = rungs.iter().map(error).collect();
    if values.is_empty() || values.iter().any(|value| !value.is_finite()) {
        return None;
    }
    let rows: Vec<Bar> = rungs
        .iter()
        .zip(&values)
        .enumerate()
        .map(|(k, (rung, &value))| Bar {
            label: rung.model.clone(),
            value,
            half: 0.0,
            class: if k == 0 { "" } else { "after" },
            text: format!("{} {}", number(value), unit.split(' ').next().unwrap_or_default()),
        })
        .collect();
    let words = title.to_lowercase();
    let title = format!("{title}, effect by effect");
    let (first, last) = (values[0], values[values.len() - 1]);
    let look = if values.len() == 1 {
        format!(
            "There is one rung: nothing that was tried predicts data left out better than the model as configured, {} {unit}.",
            number(first)
        )
    } else {
        format!(
            "How much shorter does each effect make the bar? From {} to {} {unit}.",
            number(first),
            number(last)
        )
    };
    let means = means.to_owned();
    let label = quantity::with_unit(&words, Some(unit));
    let svg = bars(&format!("ladder-{key}"), &title, ["model", &label], &look, &rows);
    Some(Picture { title, look, means, key: Vec::new(), svg, is_wide: false })
}

/// How the log score rises from rung to rung.
fn gained(rungs: &[Rung]) -> Option<Picture> {
    let scores: Vec<f64> = rungs.iter().map(|rung| rung.log_score).collect();
    if scores.len() < 2 || scores.iter().any(|score| !score.is_finite()) {
        return None;
    }
    let rows: Vec<Bar> = rungs
        .iter()
        .zip(&scores)
        .skip(1)
        .map(|(rung, score)| Bar {
            label: rung.model.clone(),
            value: score - scores[0],
            half: 0.0,
            class: "after",
            text: format!("{} nats", number(score - scores[0])),
        })
        .collect();
    let title = "Log score gained, effect by effect".to_owned();
    let gain = scores[scores.len() - 1] - scores[0];
    let look = format!(
        "How much likelier do data that were left out become? By a factor of {} a row in the end.",
        number(gain.exp())
    );
    let means = "The log score counts readings and losses alike, and punishes a model that is surer than it should be. It is what \
                 decides."
        .to_owned();
    let svg = bars(
        "ladder-log-score",
        &title,
        ["model", "log score gained (nats per row)"],
        &look,
        &rows,
    );
    Some(Picture { title, look, means, key: Vec::new(), svg, is_wide: false })
}

/// What candidates gain.
fn candidates(diagnosis: &Diagnosis) -> Option<Picture> {
    let mut gains: Vec<&Tested> = diagnosis
        .candidates
        .iter()
        .filter(|candidate| candidate.gain.is_finite())
        .filter(|candidate| candidate.gain != 0.0 || candidate.accepted)
        .collect();
    gains.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    gains.truncate(MOST_CANDIDATES);
    if gains.is_empty() {
        return None;
    }
    let rows: Vec<Bar> = gains
        .iter()
        .map(|candidate| Bar {
            label: candidate.effect.clone(),
            value: candidate.gain,
            half: Z_90 * Some(candidate.standard_error).filter(|it| it.is_finite()).unwrap_or(0.0),
            class: if candidate.accepted { "after" } else { "none" },
            text: number(candidate.gain),
        })
        .collect();
    let title = "What each candidate gains".to_owned();
    let look = "Which bars are clear of zero? Nats a row gained on data left out; lines are 90 % intervals.".to_owned();
    let means = "Accepted is what gains beyond chance with all candidates counted, and is worth having. An accepted effect stands \
                 with what it gained when it was added; the others with what they would still gain on top of all that was \
                 accepted. Each gain is on the blocks that its covariate demands, which may be others than those of the steps above."
        .to_owned();
    let key = vec![("bar after", "accepted".to_owned()), ("bar none", "not accepted".to_owned())];
    let svg = bars("candidates", &title, ["effect", "held-out gain (nats per row)"], &look, &rows);
    Some(Picture { title, look, means, key, svg, is_wide: false })
}
