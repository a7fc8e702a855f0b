//! The page of a sweep: a picture for each figure, which answers how the figure depends on what varies. Each trial is a point
//! beside the median and its interval.

mod factors;
mod first_screen;
pub(crate) mod names;
mod panels;
mod question;

use super::plan::SweepPlan;
use super::setting_figures::SettingFigures;
use super::sweep_summary::{Interval, IntervalKind, MetricSpread, SweepSummary};
use factors::{Factor, View, describe, views};
use maud::{Markup, html};
use names::{Catalogue, Name};
use numbers::format::{count_of, number, percent, with_unit};
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

/// The page from top to bottom: the question and its answer; the rest opens on demand.
const SECTIONS: &[Section] = &[
    first_screen::heading,
    notices,
    question::first,
    question::others,
    first_screen::at_a_glance,
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

/// Warnings: one as it is; several fold below their number, so that they do not push the answer off the first screen.
fn notices(contents: &SweepPage<'_>) -> Option<Markup> {
    let warnings = &contents.summary.warnings;
    if warnings.len() < 2 {
        return layout::notices(warnings);
    }
    Some(html! {
        details.notice {
            summary { (count_of(warnings.len() as u64, "warning")) }
            ul { @for warning in warnings { li { (warning) } } }
        }
    })
}

fn in_numbers(contents: &SweepPage<'_>) -> Option<Markup> {
    let metrics = contents.metrics.iter().filter(|metric| metric.constant().is_none());
    let tables: Vec<Markup> = metrics.map(|metric| table(contents, metric)).collect();
    let section = html! { @for table in &tables { (table) } };
    (!tables.is_empty()).then(|| folded("Every setting in numbers", &section))
}

fn again(contents: &SweepPage<'_>) -> Option<Markup> {
    let section = html! {
        p {
            "Beside this page, " code { "sweep.toml" } " holds the whole file, and " code { "trials.parquet" } " a row for each \
             trial. The same file gives the same table, byte for byte."
        }
        (listing("murmuration sweep sweep.toml --out again"))
        details {
            summary { "The file" }
            (listing(contents.plan.written.trim_end()))
        }
    };
    Some(folded("To do it again", &section))
}

/// A section that opens on demand.
fn folded(heading: &str, section: &Markup) -> Markup {
    html! { details.section { summary { h2 { (heading) } } (section) } }
}

/// A value of a figure as people read it.
fn shown_value(metric: &MetricFigures<'_>, value: f64) -> String {
    if metric.figures.is_share() || metric.is_ratio() { percent(value) } else { number(value) }
}

/// Median, interval and number of trials, or share of trials, of a setting in words: `6.60 m/s [6.50 m/s, 6.70 m/s] (95 % interval, n = 5)`.
fn shown(metric: &MetricFigures<'_>, setting: usize) -> String {
    let figures = metric.figures;
    let Some(spread) = &figures.spreads[setting] else { return "no trial".to_owned() };
    let n = figures.values[setting].len();
    if figures.is_share() {
        return format!("{} of {n} trials", libm::round(spread.mean * n as f64));
    }
    let (times, unit) =
        if metric.is_ratio() { (100.0, "%") } else { (1.0, metric.name.unit.unwrap_or_default()) };
    let Some(interval) = spread.interval else {
        return format!("{} (n = {n})", with_unit(&number(times * spread.median), unit));
    };
    let scaled = Interval { low: times * interval.low, high: times * interval.high, ..interval };
    let [median, low, high] = scaled.digits(times * spread.median).map(|it| with_unit(&it, unit));
    let words = match interval.kind {
        IntervalKind::Bootstrap95 => format!("{}, n = {n}", interval.words(n)),
        IntervalKind::Range => interval.words(n),
    };
    format!("{median} [{low}, {high}] ({words})")
}

fn table(contents: &SweepPage<'_>, metric: &MetricFigures<'_>) -> Markup {
    let SweepPage { plan, factors, .. } = contents;
    let figures = metric.figures;
    let headings: &[&str] = if figures.is_share() {
        &["share"]
    } else {
        &["median", "interval", "kind of interval", "middle half", "all", "mean ± sd"]
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
                            @let n = figures.values[setting].len();
                            @for cell in cells(spread, n, figures.is_share()) { (number_cell(cell)) }
                        }
                    }
                }
            } }
        }
    }
}

/// The cells of a setting, under the headings of the table.
fn cells(spread: &MetricSpread, n: usize, is_share: bool) -> Vec<String> {
    if is_share {
        return vec![percent(spread.mean)];
    }
    let pair = |low: f64, high: f64| format!("{} to {}", number(low), number(high));
    let sd = spread.sd.map_or_else(String::new, |sd| format!(" ± {}", number(sd)));
    let dash = || "–".to_owned();
    let digits = spread.interval.map(|interval| interval.digits(spread.median));
    let [median, interval] = digits.map_or_else(
        || [number(spread.median), dash()],
        |[median, low, high]| [median, format!("{low} to {high}")],
    );
    vec![
        median,
        interval,
        spread.interval.map_or_else(dash, |interval| interval.words(n)),
        pair(spread.q25, spread.q75),
        pair(spread.min, spread.max),
        number(spread.mean) + &sd,
    ]
}

#[cfg(test)]
mod tests;
