//! Predicted against measured, errors against covariates, reception, and whether the predicted uncertainty is right.

use super::{MeasuredPage, Picture, bin, drawn, edges, figures, half, quantiles, thinned};

use crate::figures::spread_in_words;
use crate::svg::Axis;
use diagnose::compare;
use diagnose::rows::MeasuredRows;
use maud::Markup;
use metrics::DistanceBin;
use numbers::format::{capitalised, count_of, number, percent};
use numbers::normal::Z_90;
use numbers::quantity;
use numbers::statistics::mean;
use std::collections::BTreeSet;
use study::view::RowPredictions;

/// Bins of a curve.
const BINS: usize = 12;
/// Covariates that are shown.
const MOST_COVARIATES: usize = 5;
/// Bars of a histogram.
const BARS: usize = 20;

/// A bin of a covariate: middle, mean error, half of its 90 % interval.
struct Point {
    x: f64,
    mean: f64,
    half: f64,
    /// Rows in the bin.
    n: f64,
}

/// Mean errors over the bins of a covariate, each bin drawn at the mean of its values.
fn curve(edges: &[f64], values: &[f64], errors: &[f64]) -> Vec<Point> {
    let mut sums = vec![[0.0; 4]; edges.len() - 1];
    for (&value, &error) in values.iter().zip(errors) {
        if value.is_finite() && error.is_finite() {
            let sum = &mut sums[bin(edges, value)];
            for (sum, part) in sum.iter_mut().zip([1.0, value, error, error * error]) {
                *sum += part;
            }
        }
    }
    sums.into_iter()
        .filter(|sum| 2.0 < sum[0])
        .map(|[n, x, e, e2]| {
            let mean = e / n;
            let variance = (e2 / n - mean * mean).max(0.0) * n / (n - 1.0);
            Point { x: x / n, mean, half: Z_90 * (variance / n).sqrt(), n }
        })
        .collect()
}

/// What a covariate explains of the errors: as the answer says where it does, as of the page's rows elsewhere.
fn share_of(contents: &MeasuredPage<'_>, name: &str, values: &[f64], errors: &[f64]) -> f64 {
    let places = contents.answer.comparison().map_or(&[][..], |comparison| &comparison.places);
    let stated = places.iter().find(|place| place.covariate == name).map(|place| place.explained);
    let share = stated.or_else(|| Some(compare::explained(values, errors)?.explained));
    share.filter(|share| share.is_finite()).unwrap_or(0.0)
}

/// Names of covariates that a verdict speaks of.
fn spoken_of(contents: &MeasuredPage<'_>) -> BTreeSet<String> {
    let unexplained = contents.answer.diagnosis().map_or(&[][..], |it| &it.unexplained);
    unexplained.iter().map(|structure| structure.covariate.clone()).collect()
}

/// A covariate: whether a verdict speaks of it, what it explains, its name and values.
type Ranked<'a> = (bool, f64, &'a (String, Vec<f64>));

/// The errors against what was predicted, and over the covariates that explain most of them.
pub(super) fn by_covariate(contents: &MeasuredPage<'_>) -> Option<Markup> {
    let intro = "A model that is right errs alike everywhere. A bend or a slope over something is physics that the model lacks, or \
                 something that goes along with it: look for the strongest, the others may be its shadows. Dots are rows; lines \
                 are means of rows with similar values, with 90 % intervals as if rows were independent.";
    let intro = format!("{intro}{}", drawn(contents.rows.before.predicted.len()));
    figures("Where the model errs", &intro, &over_covariates(contents))
}

fn over_covariates(contents: &MeasuredPage<'_>) -> Vec<Picture> {
    let residuals = contents.rows.before.residuals();
    let spoken_of = spoken_of(contents);
    let mut ranked: Vec<Ranked<'_>> = contents
        .rows
        .covariates
        .iter()
        .filter(|(name, _)| name != "log10_distance")
        .map(|entry| {
            (
                spoken_of.contains(&entry.0),
                share_of(contents, &entry.0, &entry.1, &residuals),
                entry,
            )
        })
        .filter(|(is_named, share, _)| *is_named || 0.005 < *share)
        .collect();
    ranked.sort_by(|a, b| b.0.cmp(&a.0).then(b.1.total_cmp(&a.1)));
    ranked.truncate(MOST_COVARIATES);
    let mut pictures = vec![if contents.is_link() { against(contents) } else { around(contents) }];
    pictures.extend(
        ranked
            .into_iter()
            .filter_map(|(_, share, (name, values))| over(contents, name, values, share)),
    );
    pictures
}

/// Errors over a covariate.
fn over(contents: &MeasuredPage<'_>, name: &str, values: &[f64], share: f64) -> Option<Picture> {
    let unit = contents.unit();
    let edges = edges(values, BINS)?;
    let before = contents.rows.before.residuals();
    let spread = quantiles(before.iter().copied(), &[0.02, 0.98])?;
    let top = spread[1].abs().max(spread[0].abs()).max(1e-6);
    let mut chart = half(
        Axis::new(&quantity::label(name), edges[0], edges[edges.len() - 1]),
        Axis::new(&format!("measured less predicted ({unit})"), -top, top),
    );
    chart.dots(
        "dot",
        thinned(values.len())
            .filter(|&row| before[row].abs() <= top && values[row].is_finite())
            .map(|row| [values[row], before[row]]),
    );
    chart.guides("zero", [[[edges[0], 0.0], [edges[edges.len() - 1], 0.0]]]);
    chart.note(drawn(values.len()).trim());
    let mut key = vec![("dot", "a row, as configured".to_owned())];
    let mut ends = Vec::new();
    for (class, label, view) in contents.views() {
        let points = curve(&edges, values, &view.residuals());
        let row = |p: &Point| ([p.x, p.mean, p.mean - p.half, p.mean + p.half], p.n);
        chart.means(class, &points.iter().map(row).collect::<Vec<_>>());
        key.push((class, format!("mean of a bin, {label}")));
        let greatest = points.iter().map(|p| p.mean.abs()).fold(0.0, f64::max);
        ends.push(format!("{} {unit} {label}", number(greatest)));
    }
    let title = format!("Error over {}", quantity::words(name));
    let n =
        before.iter().zip(values).filter(|(error, value)| (*error + *value).is_finite()).count();
    let rows = count_of(n as u64, "row");
    let look = format!("Greatest mean error of a bin: {}, of {rows}.", ends.join(", "));
    let means = format!("It explains {} of the error variance as configured.", percent(share));
    let svg = chart.finish(&format!("over-{}", name.replace(['^', ':', ' '], "-")), &title, &look);
    Some(Picture { title, look, means, key, svg, is_wide: false })
}

/// Predicted against measured readings.
fn against(contents: &MeasuredPage<'_>) -> Picture {
    let all = || {
        contents.views().into_iter().flat_map(|(_, _, view)| {
            view.predicted
                .iter()
                .zip(&view.measured)
                .filter(|(_, measured)| measured.is_finite())
                .flat_map(|(p, m)| [*p, *m])
                .collect::<Vec<f64>>()
        })
    };
    let ends = quantiles(all(), &[0.002, 0.998]).unwrap_or_else(|| vec![0.0, 1.0]);
    let (low, high) = (ends[0], ends[1].max(ends[0] + 1e-6));
    let mut chart = half(
        Axis::new("predicted RSSI (dBm)", low, high),
        Axis::new("measured RSSI (dBm)", low, high),
    );
    let inside = |value: f64| (low..=high).contains(&value);
    let mut key = Vec::new();
    for (class, label, view) in contents.views() {
        let mark = if class == "after" { "dot after" } else { "dot" };
        chart.dots(
            mark,
            thinned(view.predicted.len())
                .map(|row| [view.predicted[row], view.measured[row]])
                .filter(|point| point.iter().all(|&value| inside(value))),
        );
        key.push((mark, format!("a row, {label}")));
    }
    chart.guides("zero", [[[low, low], [high, high]]]);
    chart.note(drawn(contents.rows.before.predicted.len()).trim());
    let title = "Predicted against measured".to_owned();
    let look = format!(
        "Do the dots lie along the diagonal, and how far from it? {}",
        capitalised(&biases(contents))
    );
    let means = "A cloud beside the diagonal is a constant error, a tilted one a wrong dependence on strength, several clouds \
                 several kinds of links. Frames that were lost are not here, but count in every score."
        .to_owned();
    let svg = chart.finish("against", &title, &look);
    Picture { title, look, means, key, svg, is_wide: false }
}

/// Mean and rmse of the errors of each model, in words.
fn biases(contents: &MeasuredPage<'_>) -> String {
    let unit = contents.unit();
    let parts: Vec<String> = contents
        .views()
        .into_iter()
        .map(|(_, label, view)| {
            let known: Vec<f64> = view.residuals().into_iter().filter(|r| r.is_finite()).collect();
            let bias = mean(known.iter().copied());
            let rmse = mean(known.iter().map(|r| r * r)).sqrt();
            let of = |value: f64| format!("{} {unit}", number(value));
            let spread = spread_in_words(known.iter().copied(), &of, "row");
            format!(
                "{label} their mean is {} off and they scatter by {}{spread}",
                of(bias),
                of(rmse)
            )
        })
        .collect();
    format!("{}.", parts.join("; "))
}

/// Errors of predicted places, along and across the motion.
fn around(contents: &MeasuredPage<'_>) -> Picture {
    let standardised = |view: &RowPredictions| -> Vec<[f64; 2]> {
        view.residuals()
            .into_iter()
            .zip(&view.across)
            .map(|(along, [across, _])| [along, *across])
            .collect()
    };
    let greatest = quantiles(
        standardised(&contents.rows.before).into_iter().flatten().map(f64::abs),
        &[0.985],
    );
    let top = greatest.map_or(1.0, |list| list[0].max(1e-9));
    let mut chart = half(
        Axis::new("measured less predicted, along the motion (m)", -top, top),
        Axis::new("across the motion, to the left (m)", -top, top),
    );
    let mut key = Vec::new();
    for (class, label, view) in contents.views() {
        let mark = if class == "after" { "dot after" } else { "dot" };
        let errors = standardised(view);
        chart.dots(
            mark,
            thinned(errors.len())
                .map(|row| errors[row])
                .filter(|point| point.iter().all(|part| part.abs() <= top)),
        );
        key.push((mark, format!("a window, {label}")));
    }
    chart.note(drawn(contents.rows.before.predicted.len()).trim());
    chart.guides("zero", [[[-top, 0.0], [top, 0.0]], [[0.0, -top], [0.0, top]]]);
    let title = "Predicted against measured".to_owned();
    let look =
        format!("Is the cloud round, and about the middle? Along the motion: {}", biases(contents));
    let means = "A cloud to the left is a robot that gets less far than the model says, one above or below is one that drifts \
                 sideways; a long cloud errs the more the faster the robot is, or the more it turns."
        .to_owned();
    let svg = chart.finish("against", &title, &look);
    Picture { title, look, means, key, svg, is_wide: false }
}

/// Whether predicted distributions are right.
pub(super) fn of_distributions(contents: &MeasuredPage<'_>) -> Option<Markup> {
    let mut intro =
        "A model predicts a distribution, not a number: how strong, how likely to be received, how far off.".to_owned();
    if contents.knows_losses() {
        intro += " In pictures of reception, the line should run through the dots. Dots below it on the right, where signals are \
                  strong, are frames lost by something else than weakness (interference, motion). Dots beside the slope: the \
                  receiver needs more, or less, than the model says. Intervals are of 95 % (Wilson), as if frames were \
                  independent.";
    }
    figures("Does it know what it does not know?", &intro, &distributions(contents))
}

fn distributions(contents: &MeasuredPage<'_>) -> Vec<Picture> {
    let mut pictures = vec![pit(contents)];
    match &contents.rows.rows {
        MeasuredRows::Links(links) => {
            if contents.knows_losses() {
                for (class, label, view) in contents.views() {
                    pictures.extend(reception(class, label, view, &links.frames));
                }
            }
        }
        MeasuredRows::Robots(robots) => pictures.extend(horizons(&robots.horizons)),
    }
    pictures
}

/// Error against horizon.
fn horizons(points: &[(f64, f64, Option<f64>)]) -> Option<Picture> {
    let last = points.last()?;
    let greatest = points.iter().map(|(_, before, after)| before.max(after.unwrap_or(0.0)));
    let top = 1.08 * greatest.fold(1e-9, f64::max);
    let mut chart = half(
        Axis::new("horizon (s)", 0.0, last.0 * 1.03),
        Axis::new("error of the predicted position (rmse, m)", 0.0, top),
    );
    let mut key = vec![("before", "as configured".to_owned())];
    let before = points.iter().map(|(at, before, _)| [*at, *before]);
    chart.line("before", before.clone().map(Some));
    chart.knots("before point", before);
    if points.iter().all(|(.., after)| after.is_some()) {
        let after = points.iter().filter_map(|(at, _, after)| Some([*at, (*after)?]));
        chart.line("after", after.clone().map(Some));
        chart.knots("after point", after);
        key.push(("after", "with what was found".to_owned()));
    }
    let title = "Error against horizon".to_owned();
    let numbers: Vec<String> = points
        .iter()
        .map(|(at, before, after)| {
            let after = after.map(|after| format!(", {} m with what was found", number(after)));
            format!("at {at} s {} m{}", number(*before), after.unwrap_or_default())
        })
        .collect();
    let look = format!(
        "How fast does the error grow with how far ahead is predicted? {}.",
        capitalised(&numbers.join("; "))
    );
    let means = "Where the line begins is the noise of measured positions; what grows from there on is what the model does not \
                 know of the motion. These are fitted to all rows."
        .to_owned();
    let svg = chart.finish("horizons", &title, &look);
    Some(Picture { title, look, means, key, svg, is_wide: false })
}

/// Below which part of the predicted distribution measurements lie: flat where the predicted uncertainty is right.
fn pit(contents: &MeasuredPage<'_>) -> Picture {
    let quantum = match &contents.rows.rows {
        MeasuredRows::Links(links) => links.quantum_db,
        MeasuredRows::Robots(_) => 0.0,
    };
    let below = |z: f64| 0.5 * libm::erfc(-z / std::f64::consts::SQRT_2);
    let mut histograms: Vec<(&'static str, &'static str, Vec<f64>)> = Vec::new();
    for (class, label, view) in contents.views() {
        // A rounded reading stands for all that is rounded to it (Czado, Gneiting and Held 2009).
        let mut bars = [0.0; BARS];
        let mut n = 0.0;
        for ((predicted, measured), sd) in view.predicted.iter().zip(&view.measured).zip(&view.sd) {
            let residual = measured - predicted;
            if !residual.is_finite() {
                continue;
            }
            n += 1.0;
            let own = (sd * sd - quantum * quantum / 12.0).max(1e-12).sqrt();
            let (low, high) =
                (below((residual - 0.5 * quantum) / own), below((residual + 0.5 * quantum) / own));
            if high - low < 1e-9 {
                bars[((low * BARS as f64) as usize).min(BARS - 1)] += 1.0;
                continue;
            }
            for (k, bar) in bars.iter_mut().enumerate() {
                let (from, to) = (k as f64 / BARS as f64, (k + 1) as f64 / BARS as f64);
                *bar += (to.min(high) - from.max(low)).max(0.0) / (high - low);
            }
        }
        histograms.push((class, label, bars.iter().map(|bar| bar / n * BARS as f64).collect()));
    }
    let top = histograms.iter().flat_map(|(.., bars)| bars).copied().fold(1.6, f64::max);
    let mut chart = half(
        Axis::new("quantile of the predicted distribution (%)", 0.0, 1.0).percent(),
        Axis::new("rows, relative to an even spread (ratio)", 0.0, 1.05 * top.min(6.0)),
    );
    let mut key = Vec::new();
    for (class, label, bars) in &histograms {
        let box_class = if *class == "after" { "box after" } else { "box" };
        chart.rectangles(
            box_class,
            bars.iter().enumerate().map(|(k, bar)| {
                let edge_at = |k: usize| k as f64 / BARS as f64;
                [[edge_at(k), 0.0], [edge_at(k + 1), bar.min(1.05 * top.min(6.0))]]
            }),
        );
        key.push((box_class, (*label).to_owned()));
    }
    chart.level(1.0, "even");
    let known = contents.rows.before.residuals();
    let n_rows = known.iter().filter(|residual| residual.is_finite()).count();
    let coverage: Vec<String> = contents
        .views()
        .iter()
        .map(|(_, label, view)| format!("{} {label}", percent(view.coverage_90())))
        .collect();
    let title = "Probability integral transform".to_owned();
    let look = format!(
        "Are the bars level? 90 % of measurements should lie inside the predicted 90 % interval; of {} it is {}.",
        count_of(n_rows as u64, "row"),
        coverage.join(", ")
    );
    let means = "A hump in the middle: the model claims to know less than it does. A bowl: it claims to know more, or errs in \
                 some places. A slope: it is biased."
        .to_owned();
    let svg = chart.finish("pit", &title, &look);
    Picture { title, look, means, key, svg, is_wide: false }
}

/// Reception over the level, predicted and measured.
fn reception(
    class: &'static str,
    label: &str,
    view: &RowPredictions,
    frames: &[[f64; 2]],
) -> Option<Picture> {
    let known: Vec<f64> = view
        .level
        .iter()
        .zip(frames)
        .map(|(level, [_, got])| if got.is_finite() { *level } else { f64::NAN })
        .collect();
    let edges = edges(&known, BINS)?;
    let mut sums = vec![[0.0; 4]; edges.len() - 1];
    for ((&level, &passes), [sent, got]) in known.iter().zip(&view.passes).zip(frames) {
        if level.is_finite() {
            let sum = &mut sums[bin(&edges, level)];
            for (sum, part) in sum.iter_mut().zip([*sent, sent * level, *got, sent * passes]) {
                *sum += part;
            }
        }
    }
    let mut chart = half(
        Axis::new("predicted received signal strength (dBm)", edges[0], edges[edges.len() - 1]),
        Axis::new("share received (%)", 0.0, 1.03).percent(),
    );
    let (mut worst, mut line) = (0.0f64, Vec::new());
    let n_frames: f64 = sums.iter().map(|[n, ..]| n).sum();
    for [n, level, got, passes] in sums.into_iter().filter(|sum| 0.0 < sum[0]) {
        let (x, share, predicted) = (level / n, got / n, passes / n);
        worst = worst.max((share - predicted).abs());
        let [low, high] =
            (DistanceBin { from_m: 0.0, to_m: 0.0, attempts: n as u64, deliveries: got as u64 })
                .interval();
        chart.interval(
            x,
            share,
            [low, high],
            &format!("{} of {} received, {} predicted", percent(share), n, percent(predicted)),
        );
        line.push(Some([x, predicted]));
    }
    chart.line(class, line);
    let title = format!("Reception, {label}");
    let look = format!(
        "Where the line misses most, predicted and measured differ by {} percentage points.",
        number(100.0 * worst)
    );
    let means = format!(
        "Shares of frames received, {label}: {} in bins of about as many rows.",
        count_of(n_frames as u64, "frame")
    );
    let key = vec![(class, "predicted".to_owned()), ("interval", "measured".to_owned())];
    let svg = chart.finish(&format!("reception-{class}"), &title, &look);
    Some(Picture { title, look, means, key, svg, is_wide: false })
}
