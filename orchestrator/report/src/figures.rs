//! The pictures of a report. Each says in one sentence what it shows.

mod connectivity;
pub(crate) mod network;
mod plan;

use super::layout;
use super::svg::{Axis, Chart};
use maud::{Markup, html};
use metrics::measures::Event;
use metrics::{DistanceBin, Measures, Sample, Task, Trajectories};
use numbers::format::{count, count_of, number, percent, shortest};
use numbers::statistics::{quantile, range};
use proto::types::seconds;
use record::FinishedRun;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// A picture with its words.
#[derive(Clone, Debug)]
pub(crate) struct Figure {
    /// Its heading.
    pub(crate) title: &'static str,
    /// What it shows, one sentence, with the numbers that matter.
    pub(crate) sentence: String,
    /// What its marks mean: class of the mark, words.
    pub(crate) key: Vec<(&'static str, Cow<'static, str>)>,
    /// The picture, and what the reader may choose to see besides.
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
            figures.push(speed(measures, n_agents));
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
        for figure in figures.iter_mut().filter(|figure| OVER_TIME.contains(&figure.title)) {
            figure.key.push(("moment", "what happened to motes".into()));
        }
    }
    figures
}

fn trajectories(measures: &Measures) -> Figure {
    let Trajectories { agents, points, ends, .. } = &measures.trajectories;
    let leader = measures.task.leader;
    let [starts, stops] = ends;
    let everything = || points.iter().flatten().chain(starts).chain(stops).copied().flatten();
    let span = |axis: usize| range(everything().map(|point| point[axis]));
    let width = map_width(span(0), span(1));
    let (x, y, height) = equal_scales(span(0), span(1), width);
    let n = starts.len();
    let mut chart = Chart::new(x, y, width, height).as_map();
    if points.len() < measures.series.len() {
        let [kept, all] = [points.len(), measures.series.len()].map(|n| count(n as u64));
        chart.note(format!("Places of {kept} of {all} steps, spread evenly, and those at the end"));
    }
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
        chart.item(format!("agent {agent}"));
        chart.line("path", points.iter().map(|step| step[place]).chain([stops[agent]]));
    }
    chart.item("");
    let named = (0..).zip(starts).filter_map(|(agent, start)| start.map(|_: [f64; 2]| agent));
    chart.names(named.map(|agent: usize| format!("agent {agent}")));
    chart.dots("start", starts.iter().copied().flatten());
    let others = || stops.iter().enumerate().filter(move |&(agent, _)| !is_leader(agent));
    let mut key = vec![("start", "start".into()), ("path", "path".into())];
    key.extend(dots_by_group(&mut chart, &measures.task, ["agent", "end"], others()));
    if let Some((place, &agent)) = agents.iter().enumerate().find(|&(_, &agent)| is_leader(agent)) {
        chart.item(format!("agent {agent}"));
        chart.line("path-leader", points.iter().map(|step| step[place]).chain([stops[agent]]));
        if let Some(start) = starts[agent] {
            chart.ring("start-leader", start, 5.0);
        }
        if let Some(stop) = stops[agent] {
            chart.words("end-leader", "leader, end");
            chart.names([format!("agent {agent}")]);
            chart.dots("end-leader", [stop]);
            chart.label("leader", stop, &format!("leader {agent}"));
        }
    }
    chart.numbers(others().filter_map(|(agent, stop)| Some((agent, (*stop)?))));

    let spread = measures
        .at_end()
        .spread_m()
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
    if leader.is_some() {
        key.push(("path-leader", "leader".into()));
    }
    if !walls.is_empty() || !discs.is_empty() {
        key.push(("wall", "walls and obstacles".into()));
    }
    let svg = chart.finish("trajectories", "Trajectories", &sentence);
    Figure { title: "Trajectories", sentence, key, svg, is_wide: HALF < width }
}

/// The width of a map: that of the page only if what there is to show is much longer from west to east than from south to north.
pub(super) fn map_width([x0, x1]: [f64; 2], [y0, y1]: [f64; 2]) -> f64 {
    if LEAST_WIDE * (y1 - y0) < x1 - x0 { WIDE } else { HALF }
}

/// A map of so many times its height is as wide as the page.
const LEAST_WIDE: f64 = 1.7;

/// Axes of the same scale around what there is to show, and the height of their chart.
pub(super) fn equal_scales(
    [x0, x1]: [f64; 2],
    [y0, y1]: [f64; 2],
    width: f64,
) -> (Axis, Axis, f64) {
    let (x0, x1, y0, y1) = if x0 <= x1 { (x0, x1, y0, y1) } else { (0.0, 0.0, 0.0, 0.0) };
    let plane = Chart::plane_width(width);
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

/// Dots for agents, in colours by group, and what they mean.
///
/// * `whose`, `what`: what a number is of, and what a dot is, where there is but one group.
pub(super) fn dots_by_group<'a>(
    chart: &mut Chart,
    task: &Task,
    [whose, what]: [&'static str; 2],
    places: impl Iterator<Item = (usize, &'a Option<[f64; 2]>)>,
) -> Vec<(&'static str, Cow<'static, str>)> {
    let mut by_group: BTreeMap<usize, Vec<(String, [f64; 2])>> = BTreeMap::new();
    for (agent, place) in places {
        let named = place.map(|place| (format!("{whose} {agent}"), place));
        by_group.entry(task.group(agent)).or_default().extend(named);
    }
    let mut key = Vec::new();
    for (group, places) in by_group {
        let class = GROUP_ENDS[group % GROUP_ENDS.len()];
        let (names, places): (Vec<String>, Vec<[f64; 2]>) = places.into_iter().unzip();
        chart.names(names);
        chart.dots(class, places);
        let words = match task.groups.len() {
            0 | 1 => what.into(),
            _ => format!("{what}, group {group}").into(),
        };
        key.push((class, words));
    }
    key
}

/// Classes of the dots of each group.
const GROUP_ENDS: [&str; 7] = [
    "end",
    "end series-2",
    "end series-3",
    "end series-4",
    "end series-5",
    "end series-6",
    "end series-7",
];

/// Time as pictures show it: from when the robots started, if they had to wait, else from the beginning. What was before is a
/// span of its own at the left.
pub(super) struct TaskTime {
    /// When the robots started (s).
    start_s: f64,
    /// The begin of the axis.
    min: f64,
    /// Its end (s).
    max: f64,
    /// The span before the start has the scale of the rest.
    is_to_scale: bool,
}

impl TaskTime {
    /// Of a run. `shows_before`: there is something to see before the robots started.
    pub(super) fn new(measures: &Measures, shows_before: bool) -> Self {
        let start_s = seconds(measures.start_ns);
        let max =
            measures.series.last().map_or(seconds(measures.time_ns), |last| last.time_s) - start_s;
        let is_to_scale = shows_before || max <= 0.0;
        let before = if is_to_scale { start_s } else { start_s.min(SPAN * max) };
        Self { start_s, min: -before, max, is_to_scale }
    }

    pub(super) fn axis(&self) -> Axis {
        let label = if self.start_s == 0.0 {
            "simulated time (s)"
        } else {
            "time since the robots started (s)"
        };
        Axis::new(label, self.min, self.max)
    }

    /// The place on the axis of a simulated time (s).
    pub(super) fn at(&self, time_s: f64) -> f64 {
        time_s - self.start_s
    }

    /// Draws the time before the start, and what happened to motes; returns the key to the former.
    pub(super) fn mark(
        &self,
        chart: &mut Chart,
        events: &[Event],
    ) -> Option<(&'static str, Cow<'static, str>)> {
        let words: Vec<(f64, String)> =
            events.iter().map(|event| (self.at(event.time_s), words_of(event))).collect();
        let shown = words.iter().filter(|&&(at, _)| self.is_to_scale || 0.0 <= at);
        let moments: Vec<(f64, &str)> = shown.map(|(at, words)| (*at, words.as_str())).collect();
        if 0.0 < self.start_s {
            let time = format!("{} s", number(self.start_s));
            chart.span([self.min, 0.0], &format!("robots wait, {time}"));
            chart.moments(&moments);
            let scale = if self.is_to_scale { "" } else { ", not to scale" };
            return Some(("span", format!("robots wait for the network: {time}{scale}").into()));
        }
        chart.moments(&moments);
        None
    }
}

/// What happened, and to which motes.
pub(super) fn words_of(event: &Event) -> String {
    let motes: Vec<String> = event.motes.iter().take(MAX_MOTES).map(u32::to_string).collect();
    let more = if MAX_MOTES < event.motes.len() { ", …" } else { "" };
    format!("{} {}{more}", event.what, motes.join(", ")).trim_end().to_owned()
}

/// Most agents named that heard nobody.
const MAX_ISOLATED: usize = 6;
/// Share of the task's time that the span before it takes on an axis where it has no scale.
const SPAN: f64 = 0.08;
/// Most motes named beside a moment.
const MAX_MOTES: usize = 3;

/// How fast the swarm moves: along the direction of its leader, if it has one, else the magnitude of its mean velocity.
fn speed(measures: &Measures, n_agents: u32) -> Figure {
    let along_mps = measures.speed_along_leader_mps();
    let is_led = along_mps.is_some();
    let flock = thinned(&measures.series, |sample| sample.flock_speed_mps);
    let along = thinned(&measures.series, |sample| sample.along_leader_mps.unwrap_or(0.0));
    let means = if is_led { &along } else { &flock };
    let leader_mps = measures.task.leader_speed_mps;
    let floor_mps = leader_mps.map(|speed| speed / f64::from(n_agents));
    let greatest = means.iter().chain(&flock).map(|bucket| bucket.max).fold(0.0, f64::max);
    let least = means.iter().map(|bucket| bucket.min).fold(0.0, f64::min);
    let top = greatest.max(leader_mps.unwrap_or(0.0)).max(1e-3) * 1.08;
    let time = TaskTime::new(measures, false);
    let x = time.axis();
    let (title, axis) = if is_led {
        (ALONG_LEADER, "speed along the leader's direction (m/s)")
    } else {
        (FLOCK_SPEED, "flock speed (m/s)")
    };
    let mut chart = Chart::new(x, Axis::new(axis, least * 1.08, top), HALF, HALF_HEIGHT);
    if let Some(leader_mps) = leader_mps {
        chart.level(leader_mps, "leader");
    }
    if let Some(floor_mps) = floor_mps.filter(|_| 1 < n_agents) {
        chart.level(floor_mps, "leader alone");
    }
    let magnitude = "magnitude of the mean velocity of all agents";
    let mut key = Vec::new();
    if is_led {
        key.push(("line", "mean velocity of all agents along the leader's direction".into()));
        key.push(("thin", format!("flock speed (BotNet): {magnitude}").into()));
        chart.line("thin", flock.iter().map(|bucket| Some([time.at(bucket.x), bucket.mean])));
    } else {
        key.push(("line", magnitude.into()));
    }
    if means.len() < measures.series.len() {
        let band: Vec<_> =
            means.iter().map(|bucket| (time.at(bucket.x), bucket.min, bucket.max)).collect();
        chart.band("band", &band);
        key.push(("band", "least to greatest in the steps drawn as one point".into()));
        chart.note(thinning(measures));
    }
    chart.line("line", means.iter().map(|bucket| Some([time.at(bucket.x), bucket.mean])));
    let of_leader = match (leader_mps, floor_mps) {
        (Some(leader), Some(floor)) => format!(
            "; its leader moves at {} m/s, and if nobody followed it would be {} m/s",
            shortest(leader),
            number(floor)
        ),
        _ => String::new(),
    };
    let flock_mps = measures.flock_speed_mps().unwrap_or(0.0);
    let spread = spread_in_words(
        measures.series.iter().map(|sample| match sample.along_leader_mps.filter(|_| is_led) {
            Some(along_mps) => along_mps,
            None => sample.flock_speed_mps,
        }),
        &|mps| format!("{} m/s", number(mps)),
        "step",
    );
    let sentence = match along_mps {
        Some(along_mps) => format!(
            "How fast the flock moves along its leader's direction: {} m/s on average{spread}{of_leader}.",
            number(along_mps)
        ),
        None => format!(
            "How fast the flock moves as a whole: {} m/s on average{spread}{of_leader}.",
            number(flock_mps)
        ),
    };
    key.extend(time.mark(&mut chart, measures.events()));
    let svg = chart.finish("flock-speed", &format!("{title} over time"), &sentence);
    Figure { title, sentence, key, svg, is_wide: false }
}

fn neighbours(measures: &Measures, n_agents: u32) -> Figure {
    let quantile = |index: usize| thinned(&measures.series, move |sample| sample.neighbours[index]);
    let (low, median, high) = (quantile(0), quantile(1), quantile(2));
    let greatest = high.iter().map(|bucket| bucket.mean).fold(0.0, f64::max);
    let others = f64::from(n_agents.saturating_sub(1));
    let shows_all = others <= 1.5 * greatest;
    let top = (if shows_all { others.max(greatest) } else { greatest }).max(1.0) * 1.12;
    let time = TaskTime::new(measures, false);
    let x = time.axis();
    let mut chart = Chart::new(
        x,
        Axis::new("neighbours heard (count)", 0.0, top).integer_ticks(),
        HALF,
        HALF_HEIGHT,
    );
    if shows_all {
        chart.level(others, "all others");
    }
    if median.len() < measures.series.len() {
        chart.note(thinning(measures));
    }
    let band: Vec<_> = low.iter().zip(&high).map(|(l, h)| (time.at(l.x), l.mean, h.mean)).collect();
    chart.band("band", &band);
    chart.line("line", median.iter().map(|bucket| Some([time.at(bucket.x), bucket.mean])));
    let mean = measures.mean_neighbours().unwrap_or(0.0);
    let isolated = match measures.isolated_ratio() {
        Some(ratio) if 0.0 < ratio => {
            let agents = measures.isolated_agents();
            let named = |&(agent, share): &(usize, f64)| format!("{agent} ({})", percent(share));
            let most: Vec<String> = agents.iter().take(MAX_ISOLATED).map(named).collect();
            let more = match agents.len().saturating_sub(MAX_ISOLATED) {
                0 => String::new(),
                n => format!(" and {}", count_of(n as u64, "other")),
            };
            format!(
                "; in {} of agents and periods nobody was heard, by agent, in the share of its periods: {}{more}",
                percent(ratio),
                most.join(", ")
            )
        }
        _ => String::new(),
    };
    let medians = measures.series.iter().map(|sample| sample.neighbours[1]);
    let spread = spread_in_words(medians, &number, "period");
    let sentence = format!(
        "How many others an agent hears in a period: {} of {} on average{isolated}. Of the median agent over time: {}.",
        number(mean),
        count(u64::from(n_agents.saturating_sub(1))),
        spread.trim_start_matches(", ")
    );
    let mut key =
        vec![("line", "median over agents".into()), ("band", "10 % to 90 % of agents".into())];
    key.extend(time.mark(&mut chart, measures.events()));
    let svg = chart.finish("neighbours", "Neighbours heard over time", &sentence);
    Figure { title: "Neighbours heard", sentence, key, svg, is_wide: false }
}

fn delivery(measures: &Measures, bins: &[DistanceBin]) -> Figure {
    let end_m = bins.last().map_or(1.0, |bin| bin.to_m);
    let x = Axis::new("distance between sender and receiver (m)", 0.0, end_m);
    let y = Axis::new("share delivered (%)", 0.0, 1.03).percent();
    let mut chart = Chart::new(x, y, HALF, HALF_HEIGHT);
    let middle = |bin: &DistanceBin| (bin.from_m + bin.to_m) / 2.0;
    // A gap where nobody was at that distance.
    for neighbours in bins.windows(2).filter(|pair| (pair[1].from_m - pair[0].to_m).abs() < 1e-6) {
        chart.guide_line("thin", neighbours.iter().map(|bin| Some([middle(bin), bin.ratio()])));
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
        "share delivered, with the 95 % interval (Wilson) for independent attempts".into(),
    )];
    let svg = chart.finish("delivery", "Delivery against distance", &sentence);
    Figure { title: "Delivery against distance", sentence, key, svg, is_wide: false }
}

/// Median, the middle nine tenths and number of values: `, median 6.60 m/s, 90 % of 250 steps from 6.10 m/s to 6.90 m/s`.
/// Empty without values.
pub(crate) fn spread_in_words(
    values: impl Iterator<Item = f64>,
    shown: &dyn Fn(f64) -> String,
    thing: &str,
) -> String {
    let mut ascending: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    if ascending.is_empty() {
        return String::new();
    }
    ascending.sort_by(f64::total_cmp);
    let [low, median, high] = [0.05, 0.5, 0.95].map(|share| shown(quantile(&ascending, share)));
    let n = count_of(ascending.len() as u64, thing);
    format!(", median {median}, 90 % of {n} from {low} to {high}")
}

/// What a point of a series over time stands for, where it is not one step.
fn thinning(measures: &Measures) -> String {
    let n = measures.series.len();
    format!("Each point is the mean of {} consecutive steps", n.div_ceil(MAX_POINTS).max(1))
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

/// Pictures whose axis is time.
const OVER_TIME: [&str; 4] =
    [ALONG_LEADER, FLOCK_SPEED, "Neighbours heard", "Packets delivered over time"];
/// Headings of the picture of the swarm's speed, with a leader and without.
const ALONG_LEADER: &str = "Speed along the leader's direction";
const FLOCK_SPEED: &str = "Flock speed";
/// Most points of a line.
const MAX_POINTS: usize = 500;
/// More agents than this are drawn with finer marks.
const MANY: usize = 60;
/// Width of a picture across the page, in pixels.
pub(super) const WIDE: f64 = 1110.0;
/// Width of a picture across half of it.
pub(super) const HALF: f64 = 540.0;
/// Height of such a picture.
pub(super) const HALF_HEIGHT: f64 = 312.0;

#[cfg(test)]
mod tests {
    use super::*;
    use metrics::Kpis;
    use proto::site::Site;
    use proto::types::AgentStates;

    #[test]
    fn time_axes_start_with_the_task_and_formation_is_a_span_of_its_own() {
        let states = AgentStates::at_origin(1);
        let mut measures =
            Measures::new(Task::default(), Site::default(), &states, Kpis::default());
        let sample = Sample {
            time_s: 450.0,
            flock_speed_mps: 1.0,
            along_leader_mps: None,
            neighbours: [0.0; 3],
        };
        measures.series = vec![Sample { time_s: 401.0, ..sample }, sample];
        measures.start_ns = 400_000_000_000;
        let time = TaskTime::new(&measures, false);
        assert_eq!((time.at(400.0), time.axis().min, time.axis().max), (0.0, -4.0, 50.0));
        let mut chart = Chart::new(time.axis(), Axis::new("", 0.0, 1.0), HALF, HALF_HEIGHT);
        let event = |time_s, motes| Event { time_s, what: "kill", motes };
        let (mark, words) =
            time.mark(&mut chart, &[event(300.0, vec![1]), event(410.0, vec![7, 8])]).unwrap();
        assert_eq!((mark, &*words), ("span", "robots wait for the network: 400 s, not to scale"));
        let picture = chart.finish("", "", "").into_string();
        assert!(picture.contains("robots wait, 400 s") && picture.contains("kill 7, 8"));
        assert!(!picture.contains("kill 1<"), "what was before has no place on the axis");
        // Where something is to be seen before, the span has the scale of the rest.
        assert_eq!(TaskTime::new(&measures, true).axis().min, -400.0);
        measures.start_ns = 0;
        assert_eq!(TaskTime::new(&measures, true).axis().min, 0.0);
    }
}
