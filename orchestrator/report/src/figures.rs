//! The pictures of a report. Each says in one sentence what it shows.

pub(crate) mod network;

use super::layout;
use super::svg::{Axis, Chart};
use maud::{Markup, html};
use metrics::{DistanceBin, Measures, Sample, Trajectories};
use numbers::format::{count, number, percent, shortest};
use proto::types::seconds;
use record::FinishedRun;

/// A picture with its words.
#[derive(Clone, Debug)]
pub(crate) struct Figure {
    /// Its heading.
    pub(crate) title: &'static str,
    /// What it shows, one sentence, with the numbers that matter.
    pub(crate) sentence: String,
    /// What its marks mean: class of the mark, words.
    pub(crate) key: Vec<(&'static str, &'static str)>,
    /// The picture.
    pub(crate) svg: Markup,
    /// It takes the whole width.
    pub(crate) is_wide: bool,
}

/// The pictures of a run.
pub(super) fn section(contents: &FinishedRun<'_>) -> Option<Markup> {
    let figures = run_figures(contents.measures?, contents.header.agent_count);
    Some(html! { div.figures { @for figure in &figures { (figure.markup()) } } })
}

impl Figure {
    fn markup(&self) -> Markup {
        let words = html! { p { (self.sentence) } };
        let key =
            html! { @for (mark, words) in &self.key { (layout::key_entry(mark, None, words)) } };
        layout::figure(self.title, &words, &key, &self.svg, self.is_wide)
    }
}

/// All pictures for which there is something to show.
fn run_figures(measures: &Measures, n_agents: u32) -> Vec<Figure> {
    let mut figures = Vec::new();
    if measures.has_way() {
        figures.push(trajectories(measures));
    }
    if !measures.series.is_empty() {
        if measures.anybody_moved() {
            figures.push(flock_speed(measures, n_agents));
        }
        if measures.anybody_spoke() {
            figures.push(neighbours(measures, n_agents));
        }
    }
    let by_distance = measures.by_distance();
    if !by_distance.is_empty() {
        figures.push(delivery(measures, &by_distance));
    }
    figures.extend(network::network_figures(measures));
    if !measures.events().is_empty() {
        let over_time = ["Flock speed", "Neighbours heard", "Packets delivered over time"];
        for figure in figures.iter_mut().filter(|figure| over_time.contains(&figure.title)) {
            figure.key.push(("moment", "orders to the network"));
        }
    }
    figures
}

fn trajectories(measures: &Measures) -> Figure {
    let Trajectories { agents, points, ends, .. } = &measures.trajectories;
    let leader = measures.task.leader;
    let [starts, stops] = ends;
    let everything = || points.iter().flatten().chain(starts).chain(stops).copied().flatten();
    let span = |axis: usize| {
        everything().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], point| {
            [low.min(point[axis]), high.max(point[axis])]
        })
    };
    let (x, y, height) = equal_scales(span(0), span(1));
    let n = starts.len();
    let mut chart = Chart::new(x, y, WIDE, height);
    if MANY < n {
        // Many agents need finer marks.
        chart = chart.with_class("many");
    }

    let walls: Vec<_> = measures.site.wall.iter().map(|wall| [wall.from_m, wall.to_m]).collect();
    let discs: Vec<_> =
        measures.site.obstacle.iter().map(|disc| (disc.centre_m, disc.radius_m)).collect();
    chart.site("plane", &walls, &discs);

    let is_leader = |agent: usize| leader == Some(agent);
    for (place, &agent) in agents.iter().enumerate().filter(|&(_, &agent)| !is_leader(agent)) {
        let _ = agent;
        chart.line("path", points.iter().map(|step| step[place]).chain([stops[agent]]));
    }
    chart.dots("start", starts.iter().copied().flatten());
    let others = stops.iter().enumerate().filter(|&(agent, _)| !is_leader(agent));
    chart.dots("end", others.filter_map(|(_, stop)| *stop));
    if let Some((place, &agent)) = agents.iter().enumerate().find(|&(_, &agent)| is_leader(agent)) {
        chart.line("path-leader", points.iter().map(|step| step[place]).chain([stops[agent]]));
        if let Some(start) = starts[agent] {
            chart.ring("start-leader", start, 5.0);
        }
        if let Some(stop) = stops[agent] {
            chart.dots("end-leader", [stop]);
            chart.label("leader", stop, "leader");
        }
    }

    let spread = measures
        .final_spread_m()
        .map(|spread| {
            format!("; at the end they are {} m (r.m.s.) from their centroid", number(spread))
        })
        .unwrap_or_default();
    let followed = if agents.len() < n {
        format!(" Paths of {} agents, spread evenly over all, are drawn.", agents.len())
    } else {
        String::new()
    };
    let sentence = format!(
        "Where the {} went, seen from above{spread}.{followed}",
        if n == 1 { "agent".to_owned() } else { format!("{} agents", count(n as u64)) }
    );
    let mut key = vec![("start", "start"), ("end", "end"), ("path", "path")];
    if leader.is_some() {
        key.push(("path-leader", "leader"));
    }
    if !walls.is_empty() || !discs.is_empty() {
        key.push(("wall", "walls and obstacles"));
    }
    let svg = chart.finish("trajectories", "Trajectories", &sentence);
    Figure { title: "Trajectories", sentence, key, svg, is_wide: true }
}

/// Axes of the same scale around what there is to show, and the height of their chart.
pub(super) fn equal_scales([x0, x1]: [f64; 2], [y0, y1]: [f64; 2]) -> (Axis, Axis, f64) {
    let (x0, x1, y0, y1) = if x0 <= x1 { (x0, x1, y0, y1) } else { (0.0, 0.0, 0.0, 0.0) };
    let plane = Chart::plane_width(WIDE);
    let margin = 0.04 * (x1 - x0).max(y1 - y0).max(0.5);
    let (width, height) = (x1 - x0 + 2.0 * margin, y1 - y0 + 2.0 * margin);
    let plane_height = (plane * height / width).clamp(190.0, 470.0);
    let metres = (width / plane).max(height / plane_height);
    let around = |low: f64, high: f64, pixels: f64| {
        let (middle, half) = ((low + high) / 2.0, metres * pixels / 2.0);
        [middle - half, middle + half]
    };
    let ([x0, x1], [y0, y1]) = (around(x0, x1, plane), around(y0, y1, plane_height));
    let (x, y) = (Axis::new("east (m)", x0, x1), Axis::new("north (m)", y0, y1));
    (x, y, Chart::with_plane_height(plane_height))
}

/// From when the robots started to the end.
fn time_axis(measures: &Measures) -> Axis {
    let start_s = seconds(measures.start_ns);
    let end_s = measures.series.last().map_or(start_s, |sample| sample.time_s);
    Axis::new("simulated time (s)", start_s, end_s)
}

fn flock_speed(measures: &Measures, n_agents: u32) -> Figure {
    let means = thinned(&measures.series, |sample| sample.flock_speed_mps);
    let mean_mps = measures.flock_speed_mps().unwrap_or(0.0);
    let leader_mps = measures.task.leader_speed_mps;
    let floor_mps = leader_mps.map(|speed| speed / f64::from(n_agents));
    let greatest = means.iter().map(|bucket| bucket.max).fold(0.0, f64::max);
    let top = greatest.max(leader_mps.unwrap_or(0.0)).max(1e-3) * 1.08;
    let x = time_axis(measures);
    let mut chart = Chart::new(x, Axis::new("flock speed (m/s)", 0.0, top), HALF, HALF_HEIGHT);
    if let Some(leader_mps) = leader_mps {
        chart.level(leader_mps, "leader");
    }
    if let Some(floor_mps) = floor_mps.filter(|_| 1 < n_agents) {
        chart.level(floor_mps, "leader alone");
    }
    let mut key = vec![("line", "magnitude of the mean velocity of all agents")];
    if means.len() < measures.series.len() {
        let band: Vec<_> = means.iter().map(|bucket| (bucket.x, bucket.min, bucket.max)).collect();
        chart.band("band", &band);
        key.push(("band", "least to greatest in the steps drawn as one point"));
    }
    chart.line("line", means.iter().map(|bucket| Some([bucket.x, bucket.mean])));
    let of_leader = match (leader_mps, floor_mps) {
        (Some(leader), Some(floor)) => format!(
            "; its leader moves at {} m/s, and if nobody followed it would be {} m/s",
            shortest(leader),
            number(floor)
        ),
        _ => String::new(),
    };
    let sentence = format!(
        "How fast the flock moves as a whole: {} m/s on average{of_leader}.",
        number(mean_mps)
    );
    chart.moments(measures.events());
    let svg = chart.finish("flock-speed", "Flock speed over time", &sentence);
    Figure { title: "Flock speed", sentence, key, svg, is_wide: false }
}

fn neighbours(measures: &Measures, n_agents: u32) -> Figure {
    let quantile = |index: usize| thinned(&measures.series, move |sample| sample.neighbours[index]);
    let (low, median, high) = (quantile(0), quantile(1), quantile(2));
    let greatest = high.iter().map(|bucket| bucket.mean).fold(0.0, f64::max);
    let others = f64::from(n_agents.saturating_sub(1));
    let shows_all = others <= 1.5 * greatest;
    let top = (if shows_all { others.max(greatest) } else { greatest }).max(1.0) * 1.12;
    let x = time_axis(measures);
    let mut chart =
        Chart::new(x, Axis::new("neighbours heard", 0.0, top).integer_ticks(), HALF, HALF_HEIGHT);
    if shows_all {
        chart.level(others, "all others");
    }
    let band: Vec<_> = low.iter().zip(&high).map(|(l, h)| (l.x, l.mean, h.mean)).collect();
    chart.band("band", &band);
    chart.line("line", median.iter().map(|bucket| Some([bucket.x, bucket.mean])));
    let mean = measures.mean_neighbours().unwrap_or(0.0);
    let isolated = match measures.isolated_ratio() {
        Some(ratio) if 0.0 < ratio => {
            format!("; in {} of agents and periods nobody was heard", percent(ratio))
        }
        _ => String::new(),
    };
    let sentence = format!(
        "How many others an agent hears in a period: {} of {} on average{isolated}.",
        number(mean),
        count(u64::from(n_agents.saturating_sub(1)))
    );
    let key = vec![("line", "median over agents"), ("band", "10 % to 90 % of agents")];
    chart.moments(measures.events());
    let svg = chart.finish("neighbours", "Neighbours heard over time", &sentence);
    Figure { title: "Neighbours heard", sentence, key, svg, is_wide: false }
}

fn delivery(measures: &Measures, bins: &[DistanceBin]) -> Figure {
    let end_m = bins.last().map_or(1.0, |bin| bin.to_m);
    let x = Axis::new("distance between sender and receiver (m)", 0.0, end_m);
    let y = Axis::new("delivered", 0.0, 1.03).percent();
    let mut chart = Chart::new(x, y, WIDE, 290.0);
    let middle = |bin: &DistanceBin| (bin.from_m + bin.to_m) / 2.0;
    // A gap where nobody was at that distance.
    for neighbours in bins.windows(2).filter(|pair| (pair[1].from_m - pair[0].to_m).abs() < 1e-6) {
        chart.line("thin", neighbours.iter().map(|bin| Some([middle(bin), bin.ratio()])));
    }
    for bin in bins {
        let [low, high] = bin.interval();
        let title = format!(
            "{} to {} m: {} of {} delivered, {} ({} to {})",
            shortest(bin.from_m),
            shortest(bin.to_m),
            count(bin.deliveries),
            count(bin.attempts),
            percent(bin.ratio()),
            percent(low),
            percent(high)
        );
        chart.interval(middle(bin), bin.ratio(), [low, high], &title);
    }
    let sampled = if measures.is_distance_sampled {
        " Counted over a sample of the receivers, spread evenly and others in each step."
    } else {
        ""
    };
    let sentence = format!(
        "Which share of transmissions reaches an agent at a distance: of {} attempts over all distances {} were delivered.{sampled}",
        count(measures.attempts),
        percent(measures.delivery_ratio().unwrap_or(0.0))
    );
    let key = vec![(
        "interval",
        "share delivered, with the 95 % interval (Wilson) for independent attempts",
    )];
    let svg = chart.finish("delivery", "Delivery against distance", &sentence);
    Figure { title: "Delivery against distance", sentence, key, svg, is_wide: true }
}

/// Consecutive steps drawn as one point.
struct Bucket {
    x: f64,
    min: f64,
    mean: f64,
    max: f64,
}

/// A series with at most [`MAX_POINTS`] points, each the mean of as many steps.
fn thinned(series: &[Sample], value: impl Fn(&Sample) -> f64) -> Vec<Bucket> {
    series
        .chunks(series.len().div_ceil(MAX_POINTS).max(1))
        .map(|samples| {
            let n = samples.len() as f64;
            let values = || samples.iter().map(&value);
            Bucket {
                x: samples.iter().map(|sample| sample.time_s).sum::<f64>() / n,
                min: values().fold(f64::INFINITY, f64::min),
                mean: values().sum::<f64>() / n,
                max: values().fold(f64::NEG_INFINITY, f64::max),
            }
        })
        .collect()
}

/// Most points of a line.
const MAX_POINTS: usize = 500;
/// More agents than this are drawn with finer marks.
const MANY: usize = 60;
/// Width of a picture across the page, in pixels.
pub(super) const WIDE: f64 = 1110.0;
/// Width of a picture across half of it.
pub(super) const HALF: f64 = 540.0;
/// Height of such a picture.
pub(super) const HALF_HEIGHT: f64 = 300.0;
