//! The page of a sweep: a picture for each figure, which answers how the figure depends on what varies. Each trial is a point
//! beside the median and its interval.

mod factors;
mod first_screen;
pub(crate) mod names;
mod panels;

use super::plan::SweepPlan;
use super::setting_figures::SettingFigures;
use super::statistics::FEWEST;
use super::sweep_summary::{MetricSpread, SweepSummary};
use factors::{Factor, View, describe, views};
use maud::{Markup, html};
use names::{Catalogue, Name};
use numbers::format::{count, count_of, number, percent};
use numbers::quantity;
use numbers::statistics::{mean, range};
use record::ColumnKind;
use report::layout::{self, listing, number_cell};

/// What goes into the page.
struct SweepPage<'a> {
    plan: &'a SweepPlan,
    summary: &'a SweepSummary,
    factors: Vec<Factor>,
    views: Vec<View>,
    metrics: Vec<MetricFigures<'a>>,
}

/// A figure, and what the page says of it.
struct MetricFigures<'a> {
    figures: &'a SettingFigures<'a>,
    name: Name,
    /// What identifies its pictures on the page, but for the number of the view.
    id: String,
    /// The share of the variance of all trials that seeds do not explain, 0 to 1; `None` with one seed.
    between_settings: Option<f64>,
}

/// A section of the page, or none where there is nothing to show in it.
type Section = fn(&SweepPage<'_>) -> Option<Markup>;

/// The page from top to bottom.
const SECTIONS: &[Section] = &[
    heading,
    first_screen::verdict,
    notices,
    first_screen::at_a_glance,
    pictures,
    first_screen::what_varies,
    in_numbers,
    again,
];

/// The page.
pub(super) fn page(
    plan: &SweepPlan,
    figures: &[SettingFigures<'_>],
    summary: &SweepSummary,
) -> String {
    let catalogue = Catalogue::of_program();
    let factors = factors::factors(plan, &catalogue);
    let views = views(&factors, plan.settings.len());
    let metrics = figures.iter().enumerate().map(|(place, figures)| MetricFigures {
        figures,
        name: Name::of_figure(&figures.column.name),
        id: format!("figure-{place}"),
        between_settings: between_settings(&figures.values),
    });
    let metrics = metrics.collect();
    let contents = SweepPage { plan, summary, factors, views, metrics };
    let sections = SECTIONS.iter().filter_map(|section| section(&contents));
    layout::page(&plan.name, "", &html! { @for section in sections { (section) } })
}

/// The share of the variance of all trials that seeds do not explain, 0 to 1 (ε², Kelley 1935): 0 on average of a figure on which
/// settings have no influence. `None`: no setting has two trials, or all trials are alike.
fn between_settings(values: &[Vec<f64>]) -> Option<f64> {
    let all = || values.iter().flatten().copied();
    let n = all().count();
    let n_settings = values.iter().filter(|values| !values.is_empty()).count();
    let squares = |values: &mut dyn Iterator<Item = f64>, middle: f64| {
        values.map(|value| (value - middle) * (value - middle)).sum::<f64>()
    };
    let total = squares(&mut all(), mean(all()));
    if n <= n_settings || total <= 0.0 {
        return None;
    }
    let within = values.iter().filter(|values| !values.is_empty());
    let within =
        within.map(|v| squares(&mut v.iter().copied(), mean(v.iter().copied()))).sum::<f64>();
    let per_degree = [within / (n - n_settings) as f64, total / (n - 1) as f64];
    Some((1.0 - per_degree[0] / per_degree[1]).clamp(0.0, 1.0))
}

/// With a smaller share of its variance between settings, a figure is not among those to look at first.
const LEAST_BETWEEN: f64 = 0.1;

impl MetricFigures<'_> {
    /// Words and unit, as an axis shows them.
    fn label(&self) -> String {
        if self.figures.is_share() {
            return quantity::with_unit(&self.name.words, Some("share of trials"));
        }
        if self.is_count() {
            return quantity::with_unit(&self.name.words, Some("count"));
        }
        self.name.label()
    }

    fn is_ratio(&self) -> bool {
        self.name.is_share
    }

    fn is_count(&self) -> bool {
        self.figures.column.kind == ColumnKind::U64 && self.name.unit.is_none()
    }

    /// The median of a setting, or its share of trials.
    fn middle(&self, setting: usize) -> Option<f64> {
        let spread = self.figures.spreads[setting].as_ref()?;
        Some(if self.figures.is_share() { spread.mean } else { spread.median })
    }

    /// The value that all trials have, but for what rounding does.
    fn constant(&self) -> Option<f64> {
        let [low, high] = range(self.figures.values.iter().flatten().copied());
        (low <= high && high - low <= 1e-9 * low.abs().max(high.abs())).then_some(low)
    }

    /// The settings with the least and the greatest median.
    fn ends(&self) -> [Option<(usize, f64)>; 2] {
        let known = || {
            (0..self.figures.values.len())
                .filter_map(|setting| Some((setting, self.middle(setting)?)))
        };
        [
            known().min_by(|a, b| a.1.total_cmp(&b.1)),
            known().rev().max_by(|a, b| a.1.total_cmp(&b.1)),
        ]
    }

    /// The factor that explains most of the variance between settings, and its share.
    fn strongest<'f>(&self, factors: &'f [Factor]) -> Option<(&'f Factor, f64)> {
        let values: Vec<Option<f64>> =
            (0..self.figures.values.len()).map(|setting| self.middle(setting)).collect();
        let shares = factors.iter().filter_map(|factor| Some((factor, factor.explains(&values)?)));
        shares.max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Whether settings differ by more than seeds let expect.
    fn differs_between_settings(&self) -> bool {
        self.constant().is_none()
            && 1 < self.figures.values.len()
            && self.between_settings.is_none_or(|share| LEAST_BETWEEN < share)
    }
}

fn heading(contents: &SweepPage<'_>) -> Option<Markup> {
    let plan = contents.plan;
    Some(html! {
        header {
            h1 { (plan.name) }
            p.lead {
                (count_of(plan.settings.len() as u64, "setting")) ", each with "
                @if plan.seeds.len() == 1 { "one seed." } @else {
                    "the same " (count(plan.seeds.len() as u64)) " seeds: " (count(plan.n_trials() as u64)) " trials."
                }
            }
        }
    })
}

fn notices(contents: &SweepPage<'_>) -> Option<Markup> {
    layout::notices(&contents.summary.warnings)
}

fn pictures(contents: &SweepPage<'_>) -> Option<Markup> {
    let SweepPage { factors, views, metrics, .. } = contents;
    let pairs = metrics.iter().flat_map(|metric| {
        views.iter().enumerate().map(move |(place, view)| (metric, place, view))
    });
    let pictures: Vec<Markup> = pairs
        .filter_map(|(metric, place, view)| {
            panels::picture(view, factors, metric, &format!("{}-{place}", metric.id))
        })
        .collect();
    let constant: Vec<String> = metrics
        .iter()
        .filter_map(|metric| {
            Some(format!("{} {}", metric.label(), shown_value(metric, metric.constant()?)))
        })
        .collect();
    let has_panels = views.iter().any(|view| 1 < view.panels.len());
    let has_ranges = factors.iter().any(|factor| factor.is_range);
    Some(html! {
        h2 { "Pictures" }
        @if !pictures.is_empty() {
            p {
                strong { "How to read the pictures. " }
                "Each picture answers one question. Small points are trials; the large dot beside them is the median of a setting, and \
                 its bar is the 95 % confidence interval (percentile bootstrap, of " (FEWEST) " trials or more)."
                @if has_panels { " Panels of a picture share their axes." }
                @if has_panels && !has_ranges { " Pale lines repeat the other panels for comparison." }
            }
            div.figures { @for picture in &pictures { (picture) } }
        }
        @if !constant.is_empty() {
            p { "The same in all trials, hence without a picture: " (constant.join("; ")) "." }
        }
    })
}

fn in_numbers(contents: &SweepPage<'_>) -> Option<Markup> {
    let metrics = contents.metrics.iter().filter(|metric| metric.constant().is_none());
    let tables: Vec<Markup> = metrics.map(|metric| table(contents, metric)).collect();
    let section = html! {
        h2 { "In numbers" }
        @for table in &tables { (table) }
    };
    (!tables.is_empty()).then_some(section)
}

fn again(contents: &SweepPage<'_>) -> Option<Markup> {
    Some(html! {
        h2 { "To do it again" }
        p {
            "Beside this page, " code { "sweep.toml" } " holds the whole file, and " code { "trials.parquet" } " a row for each \
             trial. The same file gives the same table, byte for byte."
        }
        (listing("murmuration sweep sweep.toml --out again"))
        details {
            summary { "The file" }
            (listing(contents.plan.written.trim_end()))
        }
    })
}

/// A value of a figure as people read it.
fn shown_value(metric: &MetricFigures<'_>, value: f64) -> String {
    if metric.figures.is_share() || metric.is_ratio() { percent(value) } else { number(value) }
}

/// Median and interval, or share, of a setting in words.
fn shown(figures: &SettingFigures<'_>, number_of_setting: usize) -> String {
    let Some(spread) = &figures.spreads[number_of_setting] else { return "nothing".to_owned() };
    let n = figures.values[number_of_setting].len();
    if figures.is_share() {
        return format!("{} of {n} trials", percent(spread.mean));
    }
    let interval = spread
        .median_interval_95
        .map(|[low, high]| format!(" ({} to {})", number(low), number(high)))
        .unwrap_or_default();
    format!("{}{interval}, {n} trials", number(spread.median))
}

fn table(contents: &SweepPage<'_>, metric: &MetricFigures<'_>) -> Markup {
    let SweepPage { plan, factors, .. } = contents;
    let figures = metric.figures;
    let headings: &[&str] = if figures.is_share() {
        &["share"]
    } else {
        &["median", "95 % interval", "middle half", "all", "mean ± sd"]
    };
    html! {
        details {
            summary { (metric.label()) }
            div.scroll { table {
                tr {
                    th.n { "setting" }
                    th {}
                    th.n { "trials" }
                    @for heading in headings { th.n { (heading) } }
                }
                @for (setting, spread) in (0..plan.settings.len()).zip(&figures.spreads) {
                    tr {
                        (number_cell(setting))
                        td { (describe(factors, setting)) }
                        (number_cell(figures.values[setting].len()))
                        @if let Some(spread) = spread {
                            @for cell in cells(spread, figures.is_share()) { (number_cell(cell)) }
                        }
                    }
                }
            } }
        }
    }
}

/// The cells of a setting, under the headings of the table.
fn cells(spread: &MetricSpread, is_share: bool) -> Vec<String> {
    if is_share {
        return vec![percent(spread.mean)];
    }
    let pair = |low: f64, high: f64| format!("{} to {}", number(low), number(high));
    let sd = spread.sd.map_or_else(String::new, |sd| format!(" ± {}", number(sd)));
    vec![
        number(spread.median),
        spread.median_interval_95.map_or_else(|| "–".to_owned(), |[low, high]| pair(low, high)),
        pair(spread.q25, spread.q75),
        pair(spread.min, spread.max),
        number(spread.mean) + &sd,
    ]
}
