//! Figures of an answer as JSON. To add one, write a function like those below and name it in the list of its schema.

use crate::content::{Axis, Figure, Mark, Panel, Point, SCHEMA, Series};
use crate::{FigureError, Kind, Request, Wanted, kind};
use metrics::distances::DistanceBin;
use numbers::format::{number, percent};
use numbers::quantity;
use numbers::statistics::range;
use serde_json::Value;
use std::path::Path;
use study::{CURVE, FINE, LOSS_CURVE};

type Draw = fn(&Value) -> Result<Figure, String>;

/// Of `diagnose`.
const DIAGNOSIS: &[Kind<Draw>] = &[
    Kind { name: "ladder", shows: "the error, effect by effect", file: "", draw: ladder },
    Kind {
        name: "gains",
        shows: "what each candidate gains, with 95 % intervals",
        file: "",
        draw: gains,
    },
];
/// Of `compare`.
const COMPARISON: &[Kind<Draw>] = &[Kind {
    name: "errors",
    shows: "the error over the covariates that explain most of it",
    file: "",
    draw: errors,
}];
/// Of `power`.
const POWER: &[Kind<Draw>] = &[Kind {
    name: "power",
    shows: "how often the effect is found, over its size",
    file: "",
    draw: power,
}];

/// A figure of an answer.
pub(crate) fn figure(
    path: &Path,
    answer: &Value,
    request: &Request,
) -> Result<Figure, FigureError> {
    let refused = |text: String| FigureError::Request(format!("{}: {text}", path.display()));
    if request.from_s.is_some() || request.until_s.is_some() {
        return Err(refused("is an answer; --from and --until are for runs".to_owned()));
    }
    let kinds = match answer["schema"].as_str().unwrap_or_default() {
        "diagnose/1" | "diagnose/2" => DIAGNOSIS,
        "compare/1" => COMPARISON,
        "power/1" => POWER,
        schema => {
            return Err(refused(format!(
                "has the schema {schema:?}; there are figures of answers of compare, diagnose and power (--json)"
            )));
        }
    };
    let wanted = Wanted {
        what: path.display().to_string(),
        has: &|_| true,
        can_draw: &|kind: &Kind<Draw>| (kind.draw)(answer).is_ok(),
    };
    let kind = kind(&wanted, kinds, request)?;
    (kind.draw)(answer).map_err(refused)
}

fn list<'a>(answer: &'a Value, key: &str) -> &'a [Value] {
    answer[key].as_array().map_or(&[], Vec::as_slice)
}

fn text<'a>(value: &'a Value, key: &str) -> &'a str {
    value[key].as_str().unwrap_or_default()
}

/// The unit of errors, from the names of scores.
fn error_axis(answer: &Value) -> &'static str {
    match text(answer, "kind") {
        "robot" => "r.m.s. error (m)",
        "link" => "r.m.s. error (dB)",
        _ => "r.m.s. error",
    }
}

fn ladder(answer: &Value) -> Result<Figure, String> {
    let rungs: Vec<(&str, f64)> = list(answer, "ladder")
        .iter()
        .filter_map(|rung| Some((text(rung, "model"), rung["rmse"].as_f64()?)))
        .collect();
    let (Some((_, first)), Some((_, last))) = (rungs.first(), rungs.last()) else {
        return Err("has no models with scores".to_owned());
    };
    let [_, high] = range(rungs.iter().map(|(_, rmse)| *rmse));
    let n = answer["used"].as_u64();
    let points = rungs
        .iter()
        .enumerate()
        .map(|(place, (_, rmse))| Point { n, ..Point::of(place as f64, *rmse) });
    let rows = n.map(|n| format!(", n = {} rows", numbers::format::count(n))).unwrap_or_default();
    let caption = format!(
        "Error on held-out data, effect by effect: from {} to {}{rows}. {}",
        number(*first),
        number(*last),
        text(answer, "sentence")
    );
    let panel = Panel {
        x: Axis::of_categories("", rungs.iter().map(|(model, _)| (*model).to_owned()).collect()),
        y: Axis::linear(error_axis(answer), [0.0, 1.05 * high]),
        is_map: false,
        series: vec![Series {
            name: String::new(),
            mark: Mark::Bar,
            group: Some(0),
            points: points.collect(),
        }],
        colour: None,
    };
    Ok(Figure::of_panel("Error, effect by effect", caption.trim(), panel))
}

/// A line at 0 over an axis.
fn zero(range: [f64; 2]) -> Series {
    let points = range.map(|x| Point::of(x, 0.0)).into();
    Series { name: String::new(), mark: Mark::Line, group: None, points }
}

/// What a candidate is called: a curve by its covariate, an effect by its name.
fn candidate_words(effect: &str) -> String {
    let (rest, fine) = match effect.strip_prefix(FINE) {
        Some(rest) => (rest, "fine "),
        None => (effect, ""),
    };
    let curves = [(LOSS_CURVE, "loss curve"), (CURVE, "curve")];
    let curve = curves.iter().find_map(|(prefix, words)| Some((rest.strip_prefix(prefix)?, words)));
    match curve {
        Some((covariate, words)) => format!("{fine}{words} over {}", quantity::words(covariate)),
        None => effect.to_owned(),
    }
}

/// Most candidates in a figure.
const MOST_CANDIDATES: usize = 10;
/// The 97.5 % quantile of the normal distribution.
const Z: f64 = 1.959_963_984_540_054;

fn gains(answer: &Value) -> Result<Figure, String> {
    let mut tested: Vec<(&str, f64, f64, bool)> = list(answer, "candidates")
        .iter()
        .filter_map(|tested| {
            let of = |key: &str| tested[key].as_f64();
            Some((
                text(tested, "effect"),
                of("gain")?,
                of("standard_error")?,
                tested["accepted"] == true,
            ))
        })
        .collect();
    let n_all = tested.len();
    // Of those that were not fitted, neither is known.
    tested.retain(|(_, _, error, _)| 0.0 < *error);
    if tested.is_empty() {
        return Err("has no candidate with a gain".to_owned());
    }
    tested.sort_by(|a, b| b.3.cmp(&a.3).then(b.1.total_cmp(&a.1)));
    let n_fitted = tested.len();
    tested.truncate(MOST_CANDIDATES);
    let series = [(true, "accepted"), (false, "not accepted")].map(|(is_accepted, name)| {
        let own = tested.iter().enumerate().filter(|(_, candidate)| candidate.3 == is_accepted);
        let points = own.map(|(place, (_, gain, error, _))| Point {
            low: Some(gain - Z * error),
            high: Some(gain + Z * error),
            interval: Some("normal 95 %"),
            ..Point::of(place as f64, *gain)
        });
        Series {
            name: name.to_owned(),
            mark: Mark::Interval,
            group: Some(usize::from(!is_accepted)),
            points: points.collect(),
        }
    });
    let own = series.into_iter().filter(|series| !series.points.is_empty());
    let series: Vec<Series> =
        [zero([-0.5, tested.len() as f64 - 0.5])].into_iter().chain(own).collect();
    let points = series.iter().flat_map(|series| &series.points);
    let [low, high] =
        range(points.flat_map(|point| [point.low, point.high]).flatten().chain([0.0]));
    let margin = 0.06 * (high - low);
    let caption = format!(
        "Gain of each candidate in held-out log score (nats per row), with 95 % intervals over blocks: {} of the \
         {n_fitted} that were fitted, of {n_all} candidates. {}",
        tested.len(),
        text(answer, "sentence")
    );
    let panel = Panel {
        x: Axis::of_categories(
            "",
            tested.iter().map(|(effect, ..)| candidate_words(effect)).collect(),
        ),
        y: Axis::linear("gain (nats per row)", [low - margin, high + margin]),
        is_map: false,
        series,
        colour: None,
    };
    let figure = Figure::of_panel("Gain of each candidate", caption.trim(), panel);
    Ok(Figure { note: "Dots: gain; bars: 95 % interval over blocks.".to_owned(), ..figure })
}

/// Most covariates, a panel each.
const MOST_COVARIATES: usize = 3;

fn errors(answer: &Value) -> Result<Figure, String> {
    let unit = if text(answer, "kind") == "robot" { "m" } else { "dB" };
    let mut panels = Vec::new();
    let mut words = Vec::new();
    for place in list(answer, "where") {
        let bins: Vec<Point> = list(place, "bins")
            .iter()
            .filter_map(|bin| {
                let middle = (bin["from"].as_f64()? + bin["to"].as_f64()?) / 2.0;
                let (n, bias) = (bin["n"].as_u64()?, bin["bias"].as_f64()?);
                let mean_square = bin["rmse"].as_f64()? * bin["rmse"].as_f64()?;
                let variance = (mean_square - bias * bias).max(0.0);
                let half = Z * libm::sqrt(variance / n.saturating_sub(1) as f64);
                let ends = (1 < n).then_some([bias - half, bias + half]);
                Some(Point {
                    low: ends.map(|ends| ends[0]),
                    high: ends.map(|ends| ends[1]),
                    interval: ends.map(|_| "normal 95 %"),
                    n: Some(n),
                    ..Point::of(middle, bias)
                })
            })
            .collect();
        if bins.len() < 2 || panels.len() == MOST_COVARIATES {
            continue;
        }
        let name = text(place, "covariate");
        let x = range(bins.iter().map(|point| point.x));
        let x_margin = 0.04 * (x[1] - x[0]);
        let x = [x[0] - x_margin, x[1] + x_margin];
        let values = bins.iter().flat_map(|point| [point.y, point.low, point.high]).flatten();
        let [low, high] = range(values.chain([0.0]));
        let margin = 0.08 * (high - low);
        if let Some(explained) = place["explained"].as_f64() {
            words.push(format!("{} explains {}", quantity::words(name), percent(explained)));
        }
        panels.push(Panel {
            x: Axis::linear(quantity::label(name), x),
            y: Axis::linear(
                format!("measured less predicted ({unit})"),
                [low - margin, high + margin],
            ),
            is_map: false,
            series: vec![
                zero(x),
                Series { name: String::new(), mark: Mark::Interval, group: Some(0), points: bins },
            ],
            colour: None,
        });
    }
    if panels.is_empty() {
        return Err("has no covariate with bins".to_owned());
    }
    let caption = format!(
        "Mean error in bins of a covariate with about as many rows each, with 95 % intervals that take rows for independent \
         (normal). Of the variance of the error, {}.",
        words.join(", ")
    );
    Ok(Figure {
        schema: SCHEMA,
        title: "Error over covariates".to_owned(),
        caption,
        note: "Dots: mean error; bars: 95 % interval of the mean.".to_owned(),
        runs: Vec::new(),
        panels,
    })
}

fn power(answer: &Value) -> Result<Figure, String> {
    let points: Vec<Point> = list(answer, "tried")
        .iter()
        .filter_map(|size| {
            let share = DistanceBin {
                attempts: size["campaigns"].as_u64().filter(|n| 0 < *n)?,
                deliveries: size["found"].as_u64()?,
                ..DistanceBin::default()
            };
            let [low, high] = share.interval();
            Some(Point {
                low: Some(low),
                high: Some(high),
                interval: Some("Wilson 95 %"),
                n: Some(share.attempts),
                ..Point::of(size["value"].as_f64()?, share.ratio())
            })
        })
        .collect();
    if points.is_empty() {
        return Err("has no size with campaigns".to_owned());
    }
    let [low, high] = range(points.iter().map(|point| point.x));
    let wanted = answer["power"].as_f64().unwrap_or(0.8);
    let level = [low, high].map(|x| Point::of(x, wanted));
    let parameter = text(answer, "parameter");
    let line =
        |name: &str, mark, group, points| Series { name: name.to_owned(), mark, group, points };
    let panel = Panel {
        x: Axis::linear(
            format!("{} {}", text(answer, "effect"), quantity::label(parameter)),
            [low, high],
        ),
        y: Axis::linear("campaigns in which it is found", [0.0, 1.05]).of_shares(),
        is_map: false,
        series: vec![
            line("wanted", Mark::Line, None, level.into()),
            line("", Mark::Interval, Some(0), points),
        ],
        colour: None,
    };
    Ok(Figure::of_panel("Power", text(answer, "sentence"), panel))
}
