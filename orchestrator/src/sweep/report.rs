//! The page of a sweep: every figure against what varies, each trial as a point beside the median and its interval.

use super::plan::SweepPlan;
use super::setting_figures::SettingFigures;
use super::statistics::{FEWEST, SampleSummary};
use super::sweep_summary::SweepSummary;
use maud::{Markup, html};
use numbers::format::{count, number, percent, shortest};
use proto::config::Value as Written;
use report::layout::{self, key_entry, listing, number_cell};
use report::svg::{Axis, Chart};

/// What goes into the page.
struct SweepPage<'a> {
    plan: &'a SweepPlan,
    figures: &'a [SettingFigures<'a>],
    summary: &'a SweepSummary,
}

/// A section of the page, or none where there is nothing to show in it.
type Section = fn(&SweepPage<'_>) -> Option<Markup>;

/// The page from top to bottom.
const SECTIONS: &[Section] = &[heading, notices, pictures, in_numbers, again];

/// The page.
pub(super) fn page(
    plan: &SweepPlan,
    figures: &[SettingFigures<'_>],
    summary: &SweepSummary,
) -> String {
    let contents = SweepPage { plan, figures, summary };
    let sections = SECTIONS.iter().filter_map(|section| section(&contents));
    layout::page(&plan.name, "", &html! { @for section in sections { (section) } })
}

fn heading(contents: &SweepPage<'_>) -> Option<Markup> {
    let plan = contents.plan;
    Some(html! {
        header {
            h1 { (plan.name) }
            p.lead {
                (count(plan.settings.len() as u64)) " settings, " (count(plan.seeds.len() as u64)) " seeds each, "
                (count(plan.n_trials() as u64)) " trials. Every setting was run with the same seeds."
            }
        }
    })
}

fn notices(contents: &SweepPage<'_>) -> Option<Markup> {
    layout::notices(&contents.summary.warnings)
}

fn pictures(contents: &SweepPage<'_>) -> Option<Markup> {
    let SweepPage { plan, figures, .. } = contents;
    let views = views(plan);
    let pairs = figures.iter().enumerate().flat_map(|(number, figures)| {
        views.iter().enumerate().map(move |(place, view)| (number, figures, place, view))
    });
    Some(html! {
        p {
            "Points are trials. Beside them stands the median of each setting; the bar is where it lies with 95 % confidence \
             (percentile bootstrap, " (FEWEST) " trials or more)."
        }
        div.figures {
            @for (number, figures, place, view) in pairs {
                @if let Some(figure) = figure(plan, view, figures, &format!("figure-{number}-{place}")) { (figure) }
            }
        }
    })
}

fn in_numbers(contents: &SweepPage<'_>) -> Option<Markup> {
    Some(html! {
        h2 { "In numbers" }
        @for figures in contents.figures { (table(contents.plan, figures)) }
    })
}

fn again(contents: &SweepPage<'_>) -> Option<Markup> {
    Some(html! {
        h2 { "To do it again" }
        p {
            "Beside this page, " code { "sweep.toml" } " holds the whole file, and " code { "trials.parquet" } " a row for each \
             trial. The same file gives the same table, byte for byte."
        }
        (listing("orchestrator sweep sweep.toml --out again"))
        details {
            summary { "The file" }
            (listing(contents.plan.written.trim_end()))
        }
    })
}

/// What a picture has along its axis, and what its lines stand for.
struct PlotLayout {
    /// What the axis shows.
    label: String,
    /// Place of each setting along the axis.
    places: Vec<f64>,
    /// Words at whole numbers, where the places have names.
    names: Option<Vec<String>>,
    /// Line of each setting.
    series: Vec<usize>,
    /// Name of each line.
    lines: Vec<String>,
    /// Medians are joined: places are few, and each line has one setting at each.
    is_joined: bool,
}

/// More lines than this cannot be distinguished.
const MOST_LINES: usize = 8;

fn views(plan: &SweepPlan) -> Vec<PlotLayout> {
    let mut views: Vec<PlotLayout> =
        plan.sweep.ranges.iter().filter_map(|(key, _)| along(plan, key, true)).collect();
    if views.is_empty() {
        // The list with most values; of equals the first, and numbers before words.
        let mut best: Option<(usize, bool, &str)> = None;
        for (key, values) in &plan.sweep.lists {
            let are_numbers = values.iter().all(|value| as_number(&value.value).is_some());
            let rank = (values.len(), are_numbers);
            if 1 < values.len() && best.is_none_or(|(n, numbers, _)| (n, numbers) < rank) {
                best = Some((rank.0, rank.1, key));
            }
        }
        views.extend(best.and_then(|(_, _, key)| along(plan, key, false)));
    }
    if views.is_empty() {
        views.push(one_by_one(plan));
    }
    views
}

fn as_number(value: &Written) -> Option<f64> {
    match value {
        Written::Integer(n) => Some(*n as f64),
        Written::Number(number) => Some(*number),
        _ => None,
    }
}

/// The settings along one key. `None`: the rest makes too many lines.
fn along(plan: &SweepPlan, key: &str, is_range: bool) -> Option<PlotLayout> {
    let is_sampled = |name: &str| plan.sweep.ranges.iter().any(|(range, _)| range == name);
    let mut names: Vec<String> = Vec::new();
    let mut lines: Vec<String> = Vec::new();
    let (mut ranks, mut numbers, mut series) = (Vec::new(), Vec::new(), Vec::new());
    for setting in &plan.settings {
        let value = &setting.get(key)?.value;
        let name = match value {
            Written::Text(text) => text.clone(),
            other => as_number(other).map_or_else(
                || setting.get(key).map(|node| node.show().into_owned()).unwrap_or_default(),
                shortest,
            ),
        };
        let place = |list: &mut Vec<String>, word: String| {
            list.iter().position(|known| *known == word).unwrap_or_else(|| {
                list.push(word);
                list.len() - 1
            })
        };
        ranks.push(place(&mut names, name) as f64);
        numbers.push(as_number(value));
        let mut rest = setting.clone();
        rest.values.drain(..rest.n_of_case);
        rest.n_of_case = 0;
        rest.values.retain(|(name, _)| name != key && !is_sampled(name));
        let word = if rest.case.is_none() && rest.values.is_empty() {
            String::new()
        } else {
            rest.describe()
        };
        series.push(place(&mut lines, word));
    }
    if MOST_LINES < lines.len() {
        return None;
    }
    let numbers: Option<Vec<f64>> = numbers.into_iter().collect();
    let is_even = |numbers: &[f64]| {
        let low = numbers.iter().copied().fold(f64::INFINITY, f64::min);
        let high = numbers.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        is_range || low <= 0.0 || high <= 20.0 * low
    };
    let (places, names) = match numbers {
        Some(numbers) if is_even(&numbers) => (numbers, None),
        // Names, or numbers too far apart for one scale.
        _ => (ranks, Some(names)),
    };
    let label = key.to_owned();
    Some(PlotLayout { label, places, names, series, lines, is_joined: !is_range })
}

/// The settings side by side.
fn one_by_one(plan: &SweepPlan) -> PlotLayout {
    let n = plan.settings.len();
    let cases: Option<Vec<String>> =
        plan.settings.iter().map(|setting| setting.case.clone()).collect();
    let is_by_case = plan.sweep.lists.is_empty() && n <= 12;
    PlotLayout {
        label: if is_by_case { "case" } else { "setting" }.to_owned(),
        places: (0..n).map(|number| number as f64).collect(),
        names: cases.filter(|_| is_by_case),
        series: vec![0; n],
        lines: vec![String::new()],
        is_joined: false,
    }
}

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 330.0;

/// A figure of the trials against what varies, `None` where no trial has it.
fn figure(
    plan: &SweepPlan,
    view: &PlotLayout,
    figures: &SettingFigures<'_>,
    id: &str,
) -> Option<Markup> {
    let ends = |values: &mut dyn Iterator<Item = f64>| {
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)])
    };
    let [low, high] = ends(&mut figures.values.iter().flatten().copied());
    if high < low {
        return None;
    }
    let [left, right] = ends(&mut view.places.iter().copied());
    let name = &figures.column.name;
    let x = match &view.names {
        Some(names) => Axis::new(&view.label, -0.5, names.len() as f64 - 0.5).named(names),
        None => {
            let margin = 0.06 * (right - left);
            Axis::new(&view.label, left - margin, right + margin)
        }
    };
    let is_share = figures.is_share() || name.ends_with("ratio");
    let low = if 0.0 <= low && low < 0.6 * high { 0.0 } else { low };
    let margin = 0.05 * (high - low);
    let floor = if low == 0.0 { 0.0 } else { low - margin };
    let mut y = Axis::new(name, floor, (high + margin).max(floor + 1e-9));
    if is_share {
        y = y.percent();
    }
    // Lines stand side by side: within half the room of a name, or so little beside the number that it is not mistaken.
    let (width, share) = match &view.names {
        Some(names) => (names.len() as f64, 0.5 / names.len() as f64),
        None => (right - left, 0.03),
    };
    let step = (share / (1.6 * view.lines.len() as f64)).min(0.012) * width.max(f64::MIN_POSITIVE);
    let mut chart = Chart::new(x, y, WIDTH, HEIGHT);
    for line in 0..view.lines.len() {
        let shift = (line as f64 - (view.lines.len() - 1) as f64 / 2.0) * 1.6 * step;
        chart.group(&series(line), |chart| {
            let mut medians = Vec::new();
            for number in (0..plan.settings.len()).filter(|&number| view.series[number] == line) {
                let place = view.places[number] + shift;
                // A share has no points: all would lie at 0 or 1.
                if !figures.is_share() {
                    let values = &figures.values[number];
                    chart.dots("trial", values.iter().map(|&value| [place - 0.8 * step, value]));
                }
                let Some(spread) = &figures.spreads[number] else { continue };
                let middle = if figures.is_share() { spread.mean } else { spread.median };
                medians.push([place + 0.5 * step, middle]);
                let title =
                    format!("{}: {}", plan.settings[number].describe(), shown(figures, number));
                let interval = spread.interval_95.filter(|_| !figures.is_share());
                let interval = interval.unwrap_or([middle, middle]);
                chart.interval(place + 0.5 * step, middle, interval, &title);
            }
            if view.is_joined {
                medians.sort_by(|a, b| a[0].total_cmp(&b[0]));
                chart.line("line", medians.into_iter().map(Some));
            }
        });
    }
    let words = if figures.is_share() { "Share of trials" } else { "Trials and median" };
    let sentence = format!("{words}: {name} against {}.", view.label);
    let words = html! { p { (sentence) } };
    let key = html! {
        @for (line, words) in view.lines.iter().enumerate().filter(|(_, words)| !words.is_empty()) {
            (key_entry("line", Some(&series(line)), words))
        }
    };
    Some(layout::figure(name, &words, &key, &chart.finish(id, name, &sentence), false))
}

/// The class of a line and all its marks.
fn series(line: usize) -> String {
    format!("series-{line}")
}

/// Median and interval, or share, of a setting in words.
fn shown(figures: &SettingFigures<'_>, number_of_setting: usize) -> String {
    let Some(spread) = &figures.spreads[number_of_setting] else { return "nothing".to_owned() };
    if figures.is_share() {
        return format!("{} of {} trials", percent(spread.mean), spread.n);
    }
    let interval = spread
        .interval_95
        .map(|[low, high]| format!(" ({} to {})", number(low), number(high)))
        .unwrap_or_default();
    format!("{}{interval}, {} trials", number(spread.median), spread.n)
}

fn table(plan: &SweepPlan, figures: &SettingFigures<'_>) -> Markup {
    let headings: &[&str] = if figures.is_share() {
        &["share"]
    } else {
        &["median", "95 % interval", "middle half", "all", "mean ± sd"]
    };
    html! {
        details {
            summary { (figures.column.name) }
            table {
                tr {
                    th.n { "setting" }
                    th {}
                    th.n { "trials" }
                    @for heading in headings { th.n { (heading) } }
                }
                @for (setting, (words, spread)) in plan.settings.iter().zip(&figures.spreads).enumerate() {
                    tr {
                        (number_cell(setting))
                        td { (words.describe()) }
                        (number_cell(spread.as_ref().map_or(0, |spread| spread.n)))
                        @if let Some(spread) = spread {
                            @for cell in cells(spread, figures.is_share()) { (number_cell(cell)) }
                        }
                    }
                }
            }
        }
    }
}

/// The cells of a setting, under the headings of the table.
fn cells(spread: &SampleSummary, is_share: bool) -> Vec<String> {
    if is_share {
        return vec![percent(spread.mean)];
    }
    let pair = |low: f64, high: f64| format!("{} to {}", number(low), number(high));
    let sd = spread.sd.map_or_else(String::new, |sd| format!(" ± {}", number(sd)));
    vec![
        number(spread.median),
        spread.interval_95.map_or_else(|| "–".to_owned(), |[low, high]| pair(low, high)),
        pair(spread.q25, spread.q75),
        pair(spread.min, spread.max),
        number(spread.mean) + &sd,
    ]
}
