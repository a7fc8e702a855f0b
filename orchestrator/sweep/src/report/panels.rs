//! The picture of a figure: one panel for each combination of what is not along the axis, all with the same axes.

use super::factors::{Factor, Panel, View, describe};
use super::{MetricFigures, shown};
use crate::statistics::FEWEST;
use crate::sweep_summary::IntervalKind;
use maud::{Markup, html};
use numbers::statistics::range;
use report::layout;
use report::svg::{Axis, Chart};

/// Everything that panels of one picture share.
struct Shared<'a> {
    view: &'a View,
    factors: &'a [Factor],
    metric: &'a MetricFigures<'a>,
    x: Axis,
    y: Axis,
    /// Place of each setting along the axis.
    places: Vec<f64>,
    /// Medians are joined: places are few, and each panel has one setting at each.
    is_joined: bool,
    width: f64,
}

/// The picture of a figure, `None` where no trial has it.
pub(super) fn picture(
    view: &View,
    factors: &[Factor],
    metric: &MetricFigures<'_>,
    id: &str,
) -> Option<Markup> {
    let shared = Shared::new(view, factors, metric)?;
    let question = question(view, factors, metric);
    let explanation = metric.name.explanation.as_deref().map(with_stop);
    let words = html! {
        p { (how_to_read(metric)) }
        p.means {
            @if let Some(explanation) = explanation { (explanation) " " }
            "Column " code { (metric.figures.column.name) } " of " code { "trials.parquet" } "."
        }
    };
    let is_wide = 1 < view.panels.len();
    let columns = match view.n_columns {
        Some(n) => format!("panels of-{n}"),
        None if (2..=3).contains(&view.panels.len()) => format!("panels of-{}", view.panels.len()),
        None if is_wide => "panels".to_owned(),
        None => String::new(),
    };
    let panels = html! {
        div class=(columns) {
            @for (number, panel) in view.panels.iter().enumerate() {
                @let alternative = format!("{question} {}", panel.name);
                @let svg = shared.panel(panel).finish(&format!("{id}-{number}"), &question, alternative.trim());
                @if panel.name.is_empty() { (svg) } @else {
                    div.panel { p.panel-name { (panel.name) } (svg) }
                }
            }
        }
    };
    Some(layout::figure_of(id, &words, &shared.key(), &panels, is_wide))
}

/// What the marks are, and of how many trials.
fn how_to_read(metric: &MetricFigures<'_>) -> String {
    let [least, most] = n_trials(metric);
    let n = if least == most { format!("n = {most}") } else { format!("n = {least} to {most}") };
    if metric.figures.is_share() {
        return format!("Large dots: share of the trials of a setting ({n}).");
    }
    if most < 2 {
        return format!("Large dots: the trial of a setting ({n}); one trial has no interval.");
    }
    format!(
        "Small points: trials. Large dots: median of the trials of a setting ({n}). Bars: {}.",
        intervals(metric)
    )
}

/// Least and greatest number of trials of a setting that has any.
fn n_trials(metric: &MetricFigures<'_>) -> [usize; 2] {
    let n = || metric.figures.values.iter().map(Vec::len).filter(|n| 0 < *n);
    [n().min().unwrap_or(0), n().max().unwrap_or(0)]
}

/// What the bars are.
fn intervals(metric: &MetricFigures<'_>) -> String {
    let has = |kind: IntervalKind| {
        let intervals =
            metric.figures.spreads.iter().flatten().filter_map(|spread| spread.interval);
        intervals.into_iter().any(|interval| interval.kind == kind)
    };
    let bootstrap = "95 % interval of the median (percentile bootstrap)";
    match (has(IntervalKind::Bootstrap95), has(IntervalKind::Range)) {
        (true, false) => bootstrap.to_owned(),
        (true, true) => format!("{bootstrap}; of fewer than {FEWEST} trials their range"),
        (false, _) => "range of the trials, least to greatest".to_owned(),
    }
}

fn with_stop(sentence: &str) -> String {
    let sentence = sentence.trim_end();
    if sentence.ends_with('.') { sentence.to_owned() } else { format!("{sentence}.") }
}

/// What a figure is called in a sentence.
pub(super) fn figure_words(metric: &MetricFigures<'_>) -> String {
    if metric.figures.is_share() {
        return format!("the share of trials with “{}”", metric.name.words);
    }
    metric.name.words.clone()
}

/// The question that the picture answers.
pub(super) fn question(view: &View, factors: &[Factor], metric: &MetricFigures<'_>) -> String {
    let words = figure_words(metric);
    match view.x.map(|x| &factors[x]) {
        None => format!("How do the settings differ in {words}?"),
        Some(factor) if factor.key.is_none() => format!("How do the cases differ in {words}?"),
        Some(factor) => format!("How does the {} change {words}?", factor.name.words),
    }
}

const HEIGHT: f64 = 244.0;
/// How far medians, and trials, are drawn beside their setting (pixels).
const MEDIAN_SHIFT: f64 = 3.0;
const TRIAL_SHIFT: f64 = -4.5;

impl<'a> Shared<'a> {
    fn new(view: &'a View, factors: &'a [Factor], metric: &'a MetricFigures<'a>) -> Option<Self> {
        let figures = metric.figures;
        let [low, high] = range(figures.values.iter().flatten().copied());
        if high < low {
            return None;
        }
        let factor = view.x.map(|x| &factors[x]);
        let n_settings = figures.values.len();
        let (places, names): (Vec<f64>, Option<Vec<String>>) = match factor {
            None if factors.is_empty() => (vec![0.0; n_settings], Some(vec![describe(factors, 0)])),
            None => ((0..n_settings).map(|setting| setting as f64).collect(), None),
            Some(factor) => match &factor.numbers {
                Some(numbers) => (numbers.clone(), None),
                None => (
                    factor.level_of.iter().map(|&level| level as f64).collect(),
                    Some(factor.levels.clone()),
                ),
            },
        };
        let label =
            factor.map_or_else(|| "setting (number)".to_owned(), |factor| factor.name.label());
        let [left, right] = range(places.iter().copied());
        // A list of values has its ticks where the values are.
        let is_list = factor.is_some_and(|factor| !factor.is_range);
        let marked = |axis: Axis| if is_list { axis.ticks_at(&places) } else { axis };
        let x = match &names {
            Some(names) => Axis::new(&label, -0.5, names.len() as f64 - 0.5).named(names),
            None if factor.is_some_and(|factor| factor.is_log) => {
                let margin = libm::pow(right / left, 0.06);
                marked(Axis::new(&label, left / margin, right * margin).log())
            }
            None => {
                let margin = 0.06 * (right - left);
                marked(Axis::new(&label, left - margin, right + margin))
            }
        };
        // Settings have whole numbers.
        let x = if factor.is_none() { x.integer_ticks() } else { x };
        let width = match (view.panels.len(), view.n_columns) {
            (1, _) => 540.0,
            (_, Some(1 | 2)) | (2, None) => 520.0,
            (3, None) | (_, Some(3)) => 345.0,
            _ => 260.0,
        };
        let is_joined = factor.is_some_and(|factor| !factor.is_range && factor.numbers.is_some());
        let y = y_axis(metric, [low, high]);
        Some(Self { view, factors, metric, x, y, places, is_joined, width })
    }

    /// Place and middle of the settings of a panel that have the figure, along the axis.
    fn medians(&self, panel: &Panel) -> Vec<[f64; 2]> {
        let known = panel
            .settings
            .iter()
            .filter_map(|&setting| Some([self.places[setting], self.metric.middle(setting)?]));
        let mut medians: Vec<[f64; 2]> = known.collect();
        medians.sort_by(|a, b| a[0].total_cmp(&b[0]));
        medians
    }

    /// What the marks mean.
    fn key(&self) -> Markup {
        let metric = self.metric;
        let is_share = metric.figures.is_share();
        let median = if is_share { "share of trials" } else { "median and interval" };
        html! {
            @if !is_share { (layout::key_entry("trial", None, "trial")) }
            (layout::key_entry("interval", None, median))
            @if self.is_joined {
                (layout::key_entry("line", None, "line through medians"))
                @if 1 < self.view.panels.len() { (layout::key_entry("ghost", None, "medians of the other panels")) }
            }
        }
    }

    fn panel(&self, panel: &Panel) -> Chart {
        let figures = self.metric.figures;
        let mut chart = Chart::new(self.x.clone(), self.y.clone(), self.width, HEIGHT);
        let line = |medians: Vec<[f64; 2]>| medians.into_iter().map(Some);
        chart.shift(MEDIAN_SHIFT);
        if self.is_joined {
            // The other panels, as a background to compare with.
            for other in self.view.panels.iter().filter(|other| other.settings != panel.settings) {
                chart.item(&other.name);
                chart.line("ghost", line(self.medians(other)));
            }
            chart.item("");
            let medians = self.medians(panel);
            chart.guide_line("line", line(medians));
        }
        for &setting in &panel.settings {
            let place = self.places[setting];
            // A share has no points: all would lie at 0 or 1.
            if !figures.is_share() {
                let values = &figures.values[setting];
                chart.shift(TRIAL_SHIFT);
                chart.names(figures.seeds[setting].iter().map(|seed| format!("seed {seed}")));
                chart.dots("trial", values.iter().map(|&value| [place, value]));
            }
            let Some(spread) = &figures.spreads[setting] else { continue };
            let Some(middle) = self.metric.middle(setting) else { continue };
            let title =
                format!("{}: {}", describe(self.factors, setting), shown(self.metric, setting));
            let interval = spread.interval.filter(|_| !figures.is_share());
            let ends = interval.map_or([middle, middle], |interval| [interval.low, interval.high]);
            chart.shift(MEDIAN_SHIFT);
            chart.interval(place, middle, ends, &title);
        }
        chart
    }
}

/// The axis of a figure whose values have these ends.
fn y_axis(metric: &MetricFigures<'_>, [low, high]: [f64; 2]) -> Axis {
    let label = metric.label();
    if metric.figures.is_share() {
        return Axis::new(&label, 0.0, 1.05).percent();
    }
    if high - low <= 1e-9 * low.abs().max(high.abs()) {
        // All values are the same: an axis from 0 on shows how great they are.
        let [low, high] = [low.min(0.0), high.max(0.0)];
        let margin = 0.05 * (high - low);
        let top = if low == high { 1.0 } else { high + margin * f64::from(u8::from(0.0 < high)) };
        let axis = Axis::new(&label, low - margin * f64::from(u8::from(low < 0.0)), top);
        return if metric.is_ratio() { axis.percent() } else { axis };
    }
    let low = if 0.0 <= low && low < 0.6 * high { 0.0 } else { low };
    let margin = 0.05 * (high - low);
    let floor = if low == 0.0 { 0.0 } else { low - margin };
    let axis = Axis::new(&label, floor, high + margin);
    if metric.is_ratio() {
        axis.percent()
    } else if metric.is_count() {
        axis.integer_ticks()
    } else {
        axis
    }
}
