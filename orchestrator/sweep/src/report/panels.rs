//! The picture of a figure: one panel for each combination of what is not along the axis, all with the same axes.

use super::factors::{Factor, Panel, View, describe};
use super::{MetricFigures, shown};
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
    /// Distance of a trial from its median, in units of the axis.
    step: f64,
    /// Medians are joined: places are few, and each panel has one setting at each.
    is_joined: bool,
    width: f64,
}

/// The picture of a figure, `None` where no trial has it or all trials have the same.
pub(super) fn picture(
    view: &View,
    factors: &[Factor],
    metric: &MetricFigures<'_>,
    id: &str,
) -> Option<Markup> {
    if metric.constant().is_some() {
        return None;
    }
    let shared = Shared::new(view, factors, metric)?;
    let question = question(view, factors, metric);
    let explanation = metric.name.explanation.as_deref().map(with_stop);
    let words = html! {
        p.means {
            @if let Some(explanation) = explanation { (explanation) " " }
            "Column " code { (metric.figures.column.name) } "."
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
    Some(layout::figure_of(id, &question, &words, &panels, is_wide))
}

fn with_stop(sentence: &str) -> String {
    let sentence = sentence.trim_end();
    if sentence.ends_with('.') { sentence.to_owned() } else { format!("{sentence}.") }
}

/// The question that the picture answers.
fn question(view: &View, factors: &[Factor], metric: &MetricFigures<'_>) -> String {
    let words = if metric.figures.is_share() {
        format!("the share of trials with “{}”", metric.name.words)
    } else {
        metric.name.words.clone()
    };
    match view.x.map(|x| &factors[x]) {
        None => format!("How do the settings differ in {words}?"),
        Some(factor) if factor.key.is_none() => format!("How do the cases differ in {words}?"),
        Some(factor) => format!("How does the {} change {words}?", factor.name.words),
    }
}

const HEIGHT: f64 = 244.0;

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
            Some(factor) => {
                match factor.numbers.as_ref().filter(|numbers| is_even(factor, numbers)) {
                    Some(numbers) => (numbers.clone(), None),
                    // Names, or numbers too far apart for one scale.
                    None => (
                        factor.level_of.iter().map(|&level| level as f64).collect(),
                        Some(factor.levels.clone()),
                    ),
                }
            }
        };
        let label =
            factor.map_or_else(|| "setting (number)".to_owned(), |factor| factor.name.label());
        let [left, right] = range(places.iter().copied());
        // A list of values has its ticks where the values are.
        let is_list = factor.is_some_and(|factor| !factor.is_range);
        let marked = |axis: Axis| if is_list { axis.ticks_at(&places) } else { axis };
        let (x, room, share) = match &names {
            Some(names) => {
                let n = names.len() as f64;
                (Axis::new(&label, -0.5, n - 0.5).named(names), n, 0.25 / n)
            }
            None => {
                let margin = 0.06 * (right - left);
                (marked(Axis::new(&label, left - margin, right + margin)), right - left, 0.012)
            }
        };
        let step = share.min(0.012) * room.max(f64::MIN_POSITIVE);
        let width = match (view.panels.len(), view.n_columns) {
            (1, _) => 540.0,
            (_, Some(1 | 2)) | (2, None) => 520.0,
            (3, None) | (_, Some(3)) => 345.0,
            _ => 260.0,
        };
        let is_joined = factor.is_some_and(|factor| !factor.is_range && factor.numbers.is_some());
        let y = y_axis(metric, [low, high]);
        Some(Self { view, factors, metric, x, y, places, step, is_joined, width })
    }

    /// Place and middle of the settings of a panel that have the figure, along the axis.
    fn medians(&self, panel: &Panel) -> Vec<[f64; 2]> {
        let known = panel.settings.iter().filter_map(|&setting| {
            Some([self.places[setting] + 0.5 * self.step, self.metric.middle(setting)?])
        });
        let mut medians: Vec<[f64; 2]> = known.collect();
        medians.sort_by(|a, b| a[0].total_cmp(&b[0]));
        medians
    }

    fn panel(&self, panel: &Panel) -> Chart {
        let figures = self.metric.figures;
        let mut chart = Chart::new(self.x.clone(), self.y.clone(), self.width, HEIGHT);
        let line = |medians: Vec<[f64; 2]>| medians.into_iter().map(Some);
        if self.is_joined {
            // The other panels, as a background to compare with.
            for other in self.view.panels.iter().filter(|other| other.settings != panel.settings) {
                chart.line("ghost", line(self.medians(other)));
            }
            chart.line("line", line(self.medians(panel)));
        }
        for &setting in &panel.settings {
            let place = self.places[setting];
            // A share has no points: all would lie at 0 or 1.
            if !figures.is_share() {
                let values = &figures.values[setting];
                chart.dots("trial", values.iter().map(|&value| [place - 0.8 * self.step, value]));
            }
            let Some(spread) = &figures.spreads[setting] else { continue };
            let Some(middle) = self.metric.middle(setting) else { continue };
            let title = format!("{}: {}", describe(self.factors, setting), shown(figures, setting));
            let interval = spread.median_interval_95.filter(|_| !figures.is_share());
            let interval = interval.unwrap_or([middle, middle]);
            chart.interval(place + 0.5 * self.step, middle, interval, &title);
        }
        chart
    }
}

/// Whether numbers can have places on one scale.
fn is_even(factor: &Factor, numbers: &[f64]) -> bool {
    let [low, high] = range(numbers.iter().copied());
    factor.is_range || low <= 0.0 || high <= 20.0 * low
}

/// The axis of a figure whose values have these ends.
fn y_axis(metric: &MetricFigures<'_>, [low, high]: [f64; 2]) -> Axis {
    let label = metric.label();
    if metric.figures.is_share() {
        return Axis::new(&label, 0.0, 1.05).percent();
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
