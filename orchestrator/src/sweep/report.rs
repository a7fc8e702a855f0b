//! The page of a sweep: every figure against what varies, each trial as a point beside the median and its interval.

use super::plan::SweepPlan;
use super::results::Figures;
use super::statistics::FEWEST;
use super::sweep_summary::SweepSummary;
use numbers::format::{count, number, percent, shortest};
use proto::config::Value as Written;
use record::ColumnKind;
use report::svg::{Axis, Chart};
use report::text::escape;
use std::fmt::Write as _;

/// The page.
pub(super) fn page(plan: &SweepPlan, figures: &[Figures<'_>], summary: &SweepSummary) -> String {
    let name = escape(&plan.name);
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{name}</title>\n<style>\n{}</style>\n</head>\n<body>\n<main>\n",
        report::STYLE
    );
    let _ = write!(
        page,
        "<header>\n<h1>{name}</h1>\n<p class=\"lead\">{} settings, {} seeds each, {} trials. Every setting was run with the same seeds.</p>\n</header>\n",
        count(plan.settings.len() as u64),
        count(plan.seeds.len() as u64),
        count(plan.n_trials() as u64)
    );
    if !summary.warnings.is_empty() {
        page.push_str("<section class=\"notice\" aria-label=\"Warnings\"><ul>\n");
        for warning in &summary.warnings {
            let _ = writeln!(page, "<li>{}</li>", escape(warning));
        }
        page.push_str("</ul></section>\n");
    }
    let _ = write!(
        page,
        "<p>Points are trials. Beside them stands the median of each setting; the bar is where it lies with 95 % confidence (percentile bootstrap, {FEWEST} trials or more).</p>\n<div class=\"figures\">\n"
    );
    let views = views(plan);
    for (number, figures) in figures.iter().enumerate() {
        for (place, view) in views.iter().enumerate() {
            figure(&mut page, plan, view, figures, &format!("figure-{number}-{place}"));
        }
    }
    page.push_str("</div>\n<h2>In numbers</h2>\n");
    for figures in figures {
        table(&mut page, plan, figures);
    }
    let _ = write!(
        page,
        "<h2>To do it again</h2>\n<p>Beside this page, <code>sweep.toml</code> holds the whole file, and <code>trials.parquet</code> a row for each trial. The same file gives the same table, byte for byte.</p>\n<pre>orchestrator sweep sweep.toml --out again</pre>\n<details><summary>The file</summary>\n<pre>{}</pre></details>\n</main>\n</body>\n</html>\n",
        escape(plan.written.trim_end())
    );
    page
}

/// What a picture has along its axis, and what tells its lines apart.
struct View {
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

/// More lines than this cannot be told apart.
const MOST_LINES: usize = 8;

fn views(plan: &SweepPlan) -> Vec<View> {
    let mut views: Vec<View> =
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
fn along(plan: &SweepPlan, key: &str, is_range: bool) -> Option<View> {
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
    Some(View { label, places, names, series, lines, is_joined: !is_range })
}

/// The settings side by side.
fn one_by_one(plan: &SweepPlan) -> View {
    let n = plan.settings.len();
    let cases: Option<Vec<String>> =
        plan.settings.iter().map(|setting| setting.case.clone()).collect();
    let is_by_case = plan.sweep.lists.is_empty() && n <= 12;
    View {
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

fn figure(page: &mut String, plan: &SweepPlan, view: &View, figures: &Figures<'_>, id: &str) {
    let ends = |values: &mut dyn Iterator<Item = f64>| {
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)])
    };
    let [low, high] = ends(&mut figures.values.iter().flatten().copied());
    if high < low {
        return;
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
        chart.open(&format!("series-{line}"));
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
            let title = format!("{}: {}", plan.settings[number].describe(), shown(figures, number));
            let interval = spread.interval_95.filter(|_| !figures.is_share());
            let interval = interval.unwrap_or([middle, middle]);
            chart.interval(place + 0.5 * step, middle, interval, &title);
        }
        if view.is_joined {
            medians.sort_by(|a, b| a[0].total_cmp(&b[0]));
            chart.line("line", medians.into_iter().map(Some));
        }
        chart.close();
    }
    let words = if figures.is_share() { "Share of trials" } else { "Trials and median" };
    let sentence = format!("{words}: {name} against {}.", view.label);
    let _ = write!(
        page,
        "<figure>\n<figcaption><h3>{}</h3>\n<p>{}</p></figcaption>\n<ul class=\"key\">",
        escape(name),
        escape(&sentence)
    );
    for (line, words) in view.lines.iter().enumerate().filter(|(_, words)| !words.is_empty()) {
        let _ = write!(
            page,
            "<li class=\"series-{line}\"><svg viewBox=\"0 0 26 12\" aria-hidden=\"true\"><path class=\"line\" d=\"M0,6H26\"/></svg>{}</li>",
            escape(words)
        );
    }
    let svg = chart.finish(id, name, &sentence);
    let _ = write!(page, "</ul>\n<div class=\"plot\">{svg}</div>\n</figure>\n");
}

/// Median and interval, or share, of a setting in words.
fn shown(figures: &Figures<'_>, number_of_setting: usize) -> String {
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

fn table(page: &mut String, plan: &SweepPlan, figures: &Figures<'_>) {
    let _ = write!(
        page,
        "<details><summary>{}</summary>\n<table>\n<tr><th class=\"n\">setting</th><th></th><th class=\"n\">trials</th>",
        escape(&figures.column.name)
    );
    let is_share = figures.column.kind == ColumnKind::Bool;
    page.push_str(if is_share {
        "<th class=\"n\">share</th></tr>\n"
    } else {
        "<th class=\"n\">median</th><th class=\"n\">95 % interval</th><th class=\"n\">middle half</th><th class=\"n\">all</th><th class=\"n\">mean ± sd</th></tr>\n"
    });
    for (setting, (words, spread)) in plan.settings.iter().zip(&figures.spreads).enumerate() {
        let _ = write!(
            page,
            "<tr><td class=\"n\">{setting}</td><td>{}</td>",
            escape(&words.describe())
        );
        let Some(spread) = spread else {
            page.push_str("<td class=\"n\">0</td></tr>\n");
            continue;
        };
        let _ = write!(page, "<td class=\"n\">{}</td>", spread.n);
        if is_share {
            let _ = writeln!(page, "<td class=\"n\">{}</td></tr>", percent(spread.mean));
            continue;
        }
        let pair = |low: f64, high: f64| format!("{} to {}", number(low), number(high));
        let _ = writeln!(
            page,
            "<td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}{}</td></tr>",
            number(spread.median),
            spread.interval_95.map_or_else(|| "–".to_owned(), |[low, high]| pair(low, high)),
            pair(spread.q25, spread.q75),
            pair(spread.min, spread.max),
            number(spread.mean),
            spread.sd.map_or_else(String::new, |sd| format!(" ± {}", number(sd)))
        );
    }
    page.push_str("</table></details>\n");
}
