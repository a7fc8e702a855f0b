//! The map of the site with the model's error in each place.

use super::{MeasuredPage, Picture, figures};
use crate::figures::{HALF, equal_scales, map_width};
use crate::svg::Chart;
use diagnose::rows::{LinkEnd, LinkRows, MeasuredRows, RobotRows};
use maud::Markup;
use numbers::format::{count_of, number};
use std::collections::BTreeMap;
use study::view::RowPredictions;

/// Classes of errors, from far too low to far too high.
const CLASSES: [&str; 5] = ["low2", "low1", "none", "high1", "high2"];
/// Places along the longer side of the map.
const SPOTS: f64 = 24.0;
/// Fewer rows of a link, or of a place, are not drawn.
const FEWEST: f64 = 8.0;
/// Links that are drawn.
const MOST_PAIRS: usize = 3000;
/// Tracks that are drawn, and places of each.
const MOST_TRACKS: usize = 40;
const MOST_PLACES: usize = 400;

/// The class of a mean error: within a third of the scale none, beyond the scale far.
fn class(mean: f64, scale: f64) -> usize {
    match mean / scale {
        share if share < -1.0 => 0,
        share if share < -1.0 / 3.0 => 1,
        share if share <= 1.0 / 3.0 => 2,
        share if share <= 1.0 => 3,
        _ => 4,
    }
}

/// Obstacles that the diagnosis located: screens as pairs of end points (m), discs as centre and radius (m).
type Found = (Vec<[[f64; 2]; 2]>, Vec<([f64; 2], f64)>);

fn found(contents: &MeasuredPage<'_>) -> Found {
    let mut found = Found::default();
    let Some(diagnosis) = contents.answer.diagnosis() else { return found };
    for settings in diagnosis.accepted().filter_map(|candidate| candidate.settings.as_ref()) {
        let number =
            |value: &toml::Value| value.as_float().or(value.as_integer().map(|value| value as f64));
        let point = |key: &str| {
            let list = settings.get(key)?.as_array()?;
            Some([number(list.first()?)?, number(list.get(1)?)?])
        };
        if let (Some(from), Some(to)) = (point("from_m"), point("to_m")) {
            found.0.push([from, to]);
        }
        let radius_m = settings.get("radius_m").and_then(number);
        if let (Some(centre_m), Some(radius_m)) = (point("centre_m"), radius_m) {
            found.1.push((centre_m, radius_m));
        }
    }
    found
}

fn span(points: impl Iterator<Item = [f64; 2]>) -> Option<[[f64; 2]; 2]> {
    points.filter(|point| point.iter().all(|c| c.is_finite())).fold(None, |span, [x, y]| match span
    {
        None => Some([[x, x], [y, y]]),
        Some([[x0, x1], [y0, y1]]) => Some([[x0.min(x), x1.max(x)], [y0.min(y), y1.max(y)]]),
    })
}

/// Errors where they were made.
pub(super) fn maps(contents: &MeasuredPage<'_>) -> Option<Markup> {
    let intro = if contents.is_link() {
        "Do colours lie together? Lines are links between motes that stand still, dots places of motes that move, coloured by the mean \
         of what was measured less what was predicted. Orange lines that cross in one place are something in the way there. All links \
         of one mote in one colour are that mote. Colours that change with length are a wrong exponent; a mixture without order is \
         shadowing, or noise."
    } else {
        "Do colours lie together? Lines are measured tracks; dots are places, coloured by how much farther robots got in a window that \
         began there than predicted. One colour in one place is the ground there, or a wind; one colour in one direction a wind or a \
         slope; one colour everywhere is slip or a wrong scale."
    };
    figures("On the map", intro, &maps_of_models(contents))
}

fn maps_of_models(contents: &MeasuredPage<'_>) -> Vec<Picture> {
    let rows: Vec<[f64; 2]> = match &contents.rows.rows {
        MeasuredRows::Links(links) => links.ends.iter().flatten().map(|end| end.place_m).collect(),
        MeasuredRows::Robots(robots) => robots.tracks.iter().flatten().copied().collect(),
    };
    let site = contents.site;
    let walls = site.wall.iter().flat_map(|wall| [wall.from_m, wall.to_m]);
    let (pieces, _) = found(contents);
    let Some([x, y]) = span(rows.into_iter().chain(walls).chain(pieces.into_iter().flatten()))
    else {
        return Vec::new();
    };
    if x[0] == x[1] && y[0] == y[1] {
        return Vec::new();
    }
    let scale = scale(&contents.rows.before);
    contents
        .views()
        .into_iter()
        .map(|(class, label, view)| map(contents, class, label, view, scale, [x, y]))
        .collect()
}

/// The error at which the colour scale is extreme: the median noise of the model, in the unit of the errors.
fn scale(view: &RowPredictions) -> f64 {
    super::quantiles(view.sd.iter().copied(), &[0.5]).map_or(1.0, |median| median[0].max(1e-6))
}

/// Means of errors, by key: the place of each, and the mean.
struct Means<K>(BTreeMap<K, [f64; 4]>);

impl<K: Ord> Means<K> {
    fn add(&mut self, key: K, place: [f64; 2], error: f64) {
        let sum = self.0.entry(key).or_default();
        for (sum, part) in sum.iter_mut().zip([1.0, place[0], place[1], error]) {
            *sum += part;
        }
    }

    fn all(&self) -> impl Iterator<Item = (&K, [f64; 2], f64)> {
        let enough = self.0.iter().filter(|(_, sum)| FEWEST <= sum[0]);
        enough.map(|(key, [n, x, y, e])| (key, [x / n, y / n], e / n))
    }
}

fn map(
    contents: &MeasuredPage<'_>,
    class_name: &'static str,
    label: &str,
    view: &RowPredictions,
    scale: f64,
    [x, y]: [[f64; 2]; 2],
) -> Picture {
    let side_m = (x[1] - x[0]).max(y[1] - y[0]) / SPOTS;
    let width = map_width(x, y);
    let (x, y, height) = equal_scales(x, y, width);
    let mut chart = Chart::new(x, y, width, height).as_map();
    let site = contents.site;
    let walls: Vec<_> = site.wall.iter().map(|wall| [wall.from_m, wall.to_m]).collect();
    let discs: Vec<_> = site.obstacle.iter().map(|disc| (disc.centre_m, disc.radius_m)).collect();
    let errors = view.residuals();
    let square = |[x, y]: [f64; 2]| ((x / side_m).floor() as i64, (y / side_m).floor() as i64);
    let mut spots = Means(BTreeMap::new());
    let unit = contents.unit();
    let of_mean = |mean: f64| format!("mean error {} {unit}", number(mean));
    match &contents.rows.rows {
        MeasuredRows::Links(links) => {
            let pairs = pairs(links, &errors, &mut spots, &square);
            for (k, name) in CLASSES.iter().enumerate() {
                let lines = || pairs.iter().filter(|(_, mean)| class(*mean, scale) == k);
                chart.names(lines().map(|(_, mean)| of_mean(*mean)));
                chart.segments(&format!("pair {name}"), lines().map(|(ends, _)| *ends));
            }
        }
        MeasuredRows::Robots(robots) => tracks(&mut chart, robots, &errors, &mut spots, &square),
    }
    for (k, name) in CLASSES.iter().enumerate() {
        let dots = || spots.all().filter(|(.., mean)| class(*mean, scale) == k);
        chart.names(dots().map(|(.., mean)| of_mean(mean)));
        chart.dots(&format!("spot {name}"), dots().map(|(_, place, _)| place));
    }
    chart.site(&format!("plane-{class_name}"), &walls, &discs);
    let (pieces, round) = if class_name == "after" { found(contents) } else { Found::default() };
    chart.segments("found", pieces.iter().copied());
    for &(centre, radius_m) in &round {
        chart.circle("found", centre, radius_m);
    }
    if let MeasuredRows::Links(links) = &contents.rows.rows {
        let ends = links.ends.iter().flatten().zip(links.motes.iter().flatten());
        let still =
            ends.filter(|(end, _)| !end.is_moving && end.place_m.iter().all(|c| c.is_finite()));
        let mut motes: Vec<(u32, [f64; 2])> =
            still.map(|(end, mote)| (*mote, end.place_m)).collect();
        let order = |a: &[f64; 2], b: &[f64; 2]| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]));
        motes.sort_by(|a, b| a.0.cmp(&b.0).then(order(&a.1, &b.1)));
        motes.dedup();
        chart.names(motes.iter().map(|(mote, _)| format!("mote {mote}")));
        chart.dots("mote", motes.iter().map(|(_, place)| *place));
        chart.numbers(motes.iter().map(|(mote, place)| (*mote as usize, *place)));
    }
    let mut key: super::Key = CLASSES
        .into_iter()
        .zip(["much less", "less", "as", "more", "much more"])
        .map(|(name, words)| {
            let then = if words == "as" { "predicted" } else { "than predicted" };
            let class: &'static str = match name {
                "low2" => "pair low2",
                "low1" => "pair low1",
                "none" => "pair none",
                "high1" => "pair high1",
                _ => "pair high2",
            };
            (class, format!("{words} {then}"))
        })
        .collect();
    if contents.is_link() {
        key.push(("mote", "mote that stands still, with its number".to_owned()));
    }
    if !walls.is_empty() || !discs.is_empty() {
        key.push(("wall", "walls and obstacles of the configuration".to_owned()));
    }
    if !pieces.is_empty() || !round.is_empty() {
        key.push(("found", "found, and on no map".to_owned()));
    }
    let title = format!("Errors on the map, {label}");
    let n = errors.iter().filter(|error| error.is_finite()).count();
    let look = format!("Mean errors in each place, {label}, of {}.", count_of(n as u64, "row"));
    let means = format!(
        "Strong colours are beyond {} {unit}, the noise of the model as configured.",
        number(scale)
    );
    let svg = chart.finish(&format!("map-{class_name}"), &title, &look);
    Picture { title, look, means, key, svg, is_wide: HALF < width }
}

/// A link on the map with its mean error.
type Pair = ([[f64; 2]; 2], f64);

/// Links between motes that stand still; the errors of the others are added to the places of the ends that move.
fn pairs(
    links: &LinkRows,
    errors: &[f64],
    spots: &mut Means<(i64, i64)>,
    square: &dyn Fn([f64; 2]) -> (i64, i64),
) -> Vec<Pair> {
    let mut ends_of: BTreeMap<(u32, u32), [[f64; 2]; 2]> = BTreeMap::new();
    let mut means = Means(BTreeMap::new());
    for ((ends, motes), &error) in links.ends.iter().zip(&links.motes).zip(errors) {
        if !error.is_finite() || !ends.iter().flat_map(|end| end.place_m).all(f64::is_finite) {
            continue;
        }
        let [tx_m, rx_m] = ends.map(|end| end.place_m);
        if !ends.iter().any(|end| end.is_moving) {
            let key = (motes[0].min(motes[1]), motes[0].max(motes[1]));
            ends_of.entry(key).or_insert([tx_m, rx_m]);
            means.add(key, tx_m, error);
        }
        for LinkEnd { place_m, .. } in ends.iter().filter(|end| end.is_moving) {
            spots.add(square(*place_m), *place_m, error);
        }
    }
    let stride = means.0.len().div_ceil(MOST_PAIRS).max(1);
    means.all().step_by(stride).map(|(key, _, mean)| (ends_of[key], mean)).collect()
}

fn tracks(
    chart: &mut Chart,
    robots: &RobotRows,
    errors: &[f64],
    spots: &mut Means<(i64, i64)>,
    square: &dyn Fn([f64; 2]) -> (i64, i64),
) {
    let stride = robots.tracks.len().div_ceil(MOST_TRACKS).max(1);
    for track in robots.tracks.iter().step_by(stride) {
        let step = track.len().div_ceil(MOST_PLACES).max(1);
        chart.line("track", track.iter().step_by(step).map(|place| Some(*place)));
    }
    for ([begin, _], &error) in robots.ends.iter().zip(errors) {
        if error.is_finite() {
            spots.add(square(*begin), *begin, error);
        }
    }
}
