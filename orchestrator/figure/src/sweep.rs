//! A figure of a sweep: for each metric a panel with its median and interval at each setting, beside the trials.

use crate::content::{Axis, Figure, Mark, Panel, Point, SCHEMA, Scale, Series};
use crate::{FigureError, Request, is_kind_of_run};
use ::sweep::names::{Catalogue, Name};
use ::sweep::{IntervalKind, MetricSpread, TABLE_FILE};
use input::result::{ResultError, ResultFolder};
use metrics::distances::DistanceBin;
use numbers::format::{number, percent, shortest};
use numbers::statistics::range;
use parquet::record::Field;
use proto::bounds::DESCRIPTION_BYTES;
use proto::config::most_similar;
use record::metric::{SHORT_NAMES, path_of};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

/// The column of cases, which is also what `--x` and `--by` call them.
const CASE: &str = "case";
/// The column of seeds.
const SEED: &str = "experiment.seed";
/// From this ratio of the greatest to the least value on, an axis is logarithmic.
const LOG_RATIO: f64 = 20.0;
/// An axis with at most so many values has its ticks there.
const MOST_TICKS: usize = 8;
/// Most settings whose numbers the caption names.
const MOST_NAMED: usize = 8;

/// What varies: a key, or the cases.
struct Factor {
    key: String,
    name: Name,
    /// The value of each setting, as text and, if it is one, as a number.
    values: Vec<(String, Option<f64>)>,
}

impl Factor {
    /// The values, each once: by size if all are numbers, else in the order of the settings.
    fn levels(&self) -> Vec<&(String, Option<f64>)> {
        let mut seen = BTreeSet::new();
        let mut levels: Vec<_> = self.values.iter().filter(|(text, _)| seen.insert(text)).collect();
        if self.is_numeric() {
            levels.sort_by(|a, b| a.1.unwrap_or(0.0).total_cmp(&b.1.unwrap_or(0.0)));
        }
        levels
    }

    fn is_numeric(&self) -> bool {
        self.values.iter().all(|(_, number)| number.is_some())
    }

    /// What a setting is called in a legend.
    fn described(&self, setting: usize) -> String {
        let (text, number) = &self.values[setting];
        match number {
            None => text.clone(),
            Some(_) => {
                let unit = self.name.unit.map(|unit| format!(" {unit}")).unwrap_or_default();
                format!("{} {text}{unit}", self.name.words)
            }
        }
    }
}

/// A metric of all trials.
struct Metric {
    name: Name,
    is_flag: bool,
    /// The values of each setting.
    values: Vec<Vec<f64>>,
    /// The seed of each of these values.
    seeds: Vec<Vec<u64>>,
}

/// A figure of a sweep.
pub(crate) fn figure(
    folder: &ResultFolder,
    summary: &Value,
    request: &Request,
) -> Result<Figure, FigureError> {
    let refused =
        |text: String| FigureError::Request(format!("{}: {text}", folder.path().display()));
    if request.from_s.is_some() || request.until_s.is_some() {
        return Err(refused("is a sweep; --from and --until are for runs".to_owned()));
    }
    let config: toml::Table =
        folder.text(&DESCRIPTION_BYTES, "sweep.toml")?.parse().unwrap_or_default();
    let factors = factors(summary, &config);
    let (x, others) = chosen(&factors, request).map_err(refused)?;
    let table = folder.table(TABLE_FILE)?;
    let columns: Vec<String> = table.columns().map(str::to_owned).collect();
    let wanted = metrics_of(&columns, &config, request).map_err(refused)?;
    let n_settings = summary["settings"].as_array().map_or(0, Vec::len);
    let metrics = read(folder, &table, &wanted, n_settings)?;
    let drawn: Vec<(Panel, String)> =
        metrics.iter().map(|metric| panel(metric, &factors, x, &others)).collect();
    let words: Vec<&str> = metrics.iter().map(|metric| metric.name.words.as_str()).collect();
    let by = match x {
        Some(x) => format!(" by {}", factors[x].name.words),
        None => String::new(),
    };
    let (panels, captions): (Vec<Panel>, Vec<String>) = drawn.into_iter().unzip();
    Ok(Figure {
        schema: SCHEMA,
        title: format!("{}{by}", numbers::format::capitalised(&words.join(", "))),
        caption: captions.join(" "),
        note: note(&panels),
        runs: Vec::new(),
        panels,
    })
}

/// What dots and bars are.
fn note(panels: &[Panel]) -> String {
    let points = || panels.iter().flat_map(|panel| &panel.series).flat_map(|series| &series.points);
    let of = |statistic: &str| points().any(|point| point.statistic == Some(statistic));
    let intervals: BTreeSet<&str> = points().filter_map(|point| point.interval).collect();
    let mut parts = Vec::new();
    if of("median") {
        let bars = match (intervals.contains(BOOTSTRAP), intervals.contains(RANGE)) {
            (true, true) => ", bars: 95 % interval, or range of fewer than 5 trials",
            (true, false) => " and 95 % interval",
            (false, true) => " and range of the trials",
            (false, false) => "",
        };
        parts.push(format!("Large dots: median{bars}; small dots: trials"));
    }
    if of("share of trials") {
        let dots = if parts.is_empty() { "Large dots" } else { "in panels of per cent of trials" };
        parts.push(format!("{dots}: share of trials and 95 % interval (Wilson)"));
    }
    let n: BTreeSet<u64> = points().filter_map(|point| point.n).collect();
    let n = match (n.first(), n.last()) {
        (Some(least), Some(most)) if least == most => format!(" (n = {most})"),
        (Some(least), Some(most)) => format!(" (n = {least} to {most})"),
        _ => String::new(),
    };
    if parts.is_empty() { String::new() } else { format!("{}{n}.", parts.join("; ")) }
}

/// What intervals are called in points.
const BOOTSTRAP: &str = "bootstrap 95 %";
const RANGE: &str = "range";

/// What varies in a sweep.
fn factors(summary: &Value, config: &toml::Table) -> Vec<Factor> {
    let settings: &[Value] = summary["settings"].as_array().map_or(&[], Vec::as_slice);
    let catalogue = Catalogue::of_program();
    let mut factors = Vec::new();
    let cases: Vec<&str> = settings.iter().filter_map(|setting| setting[CASE].as_str()).collect();
    if cases.len() == settings.len() && !cases.is_empty() {
        factors.push(Factor {
            key: CASE.to_owned(),
            name: Name::of_case(),
            values: cases.iter().map(|case| ((*case).to_owned(), None)).collect(),
        });
    }
    let keys = settings.first().and_then(|setting| setting["values"].as_object());
    for key in keys.into_iter().flat_map(|keys| keys.keys()) {
        let value = |setting: &Value| match &setting["values"][key] {
            Value::Number(number) => {
                let number = number.as_f64().unwrap_or(f64::NAN);
                (shortest(number), Some(number))
            }
            Value::String(text) => {
                (catalogue.value(key, text, config).unwrap_or_else(|| text.clone()), None)
            }
            Value::Bool(is) => ((if *is { "yes" } else { "no" }).to_owned(), None),
            other => (other.to_string(), None),
        };
        factors.push(Factor {
            key: key.clone(),
            name: catalogue.key(key, config),
            values: settings.iter().map(value).collect(),
        });
    }
    factors.retain(|factor| 1 < factor.levels().len());
    factors
}

/// What the axis has, and what lines tell apart.
fn chosen(factors: &[Factor], request: &Request) -> Result<(Option<usize>, Vec<usize>), String> {
    let keys = || factors.iter().map(|factor| factor.key.as_str());
    let place = |option: &str, key: &str| {
        keys().position(|own| own == key || own.rsplit('.').next() == Some(key)).ok_or_else(|| {
            let all: Vec<&str> = keys().collect();
            let nearest = most_similar(key, all.iter().copied())
                .map(|key| format!(" (nearest: {key})"))
                .unwrap_or_default();
            format!("{option} {key}: does not vary{nearest}; what varies is {}", all.join(", "))
        })
    };
    let by = request.by.as_deref().map(|key| place("--by", key)).transpose()?;
    // What a case sets, the case tells apart.
    let of_case = |place: &usize| {
        let case = factors.iter().position(|factor| factor.key == CASE);
        case.is_some_and(|case| case != *place && is_determined(factors, *place, &[case]))
    };
    let x = match request.x.as_deref() {
        Some(key) => Some(place("--x", key)?),
        None => {
            let free = || (0..factors.len()).filter(|place| Some(*place) != by);
            let key = free().find(|place| factors[*place].key != CASE && !of_case(place));
            key.or_else(|| free().next())
        }
    };
    if x.is_some() && x == by {
        return Err("--x and --by name the same key".to_owned());
    }
    let mut known: Vec<usize> = x.into_iter().chain(by).collect();
    let mut others: Vec<usize> = by.into_iter().collect();
    for place in 0..factors.len() {
        if !known.contains(&place) && !is_determined(factors, place, &known) {
            known.push(place);
            others.push(place);
        }
    }
    if let Some(by) = by {
        let more: Vec<&str> =
            others[1..].iter().map(|&place| factors[place].key.as_str()).collect();
        if !more.is_empty() {
            return Err(format!(
                "--by {}: {} varies as well; leave --by out, so that lines tell all of it apart",
                factors[by].key,
                more.join(", ")
            ));
        }
    }
    Ok((x, others))
}

/// Whether settings that agree in some factors agree in another one.
fn is_determined(factors: &[Factor], place: usize, by: &[usize]) -> bool {
    let mut values: BTreeMap<Vec<&str>, &str> = BTreeMap::new();
    (0..factors[place].values.len()).all(|setting| {
        let key = by.iter().map(|&by| factors[by].values[setting].0.as_str()).collect();
        let own = factors[place].values[setting].0.as_str();
        *values.entry(key).or_insert(own) == own
    })
}

/// Most metrics that a refusal lists.
const MOST_LISTED: usize = 12;

fn has_no_short_name(column: &str) -> bool {
    SHORT_NAMES.iter().all(|short| short.path != path_of(column))
}

/// Metrics of the trials in a list: those with a short name first, by which people ask for them.
fn named(figures: &[String]) -> String {
    let short =
        SHORT_NAMES.iter().filter(|short| figures.iter().any(|own| path_of(own) == short.path));
    let mut names: Vec<&str> = short.map(|short| short.name).collect();
    names.extend(figures.iter().filter(|own| has_no_short_name(own)).map(String::as_str));
    names.truncate(MOST_LISTED);
    names.join(", ")
}

/// The columns of the metrics that are asked for: those of `[sweep]`, if none are.
fn metrics_of(
    columns: &[String],
    config: &toml::Table,
    request: &Request,
) -> Result<Vec<String>, String> {
    let first = columns.iter().position(|column| column == "status").map_or(0, |status| status + 1);
    let figures = &columns[first..];
    let of_sweep = || {
        let metrics = config.get("sweep")?.get("metrics")?.as_array()?;
        Some(metrics.iter().filter_map(|name| Some(name.as_str()?.to_owned())).collect())
    };
    let wanted: Vec<String> = match &request.kinds[..] {
        [] => of_sweep().unwrap_or_default(),
        kinds => kinds.to_vec(),
    };
    if wanted.is_empty() {
        return Err(format!(
            "name one KIND or several: metrics of its trials, each a panel, such as {}; `murmuration metrics` lists all",
            named(figures)
        ));
    }
    let mut problems = Vec::new();
    let mut found = Vec::new();
    for name in wanted {
        match figures.iter().find(|column| path_of(column) == path_of(&name)) {
            Some(column) => found.push(column.clone()),
            None if is_kind_of_run(&name) => problems.push(format!(
"{name} is no metric of its trials, but a KIND of figures of a run; give the folder of a run"
            )),
            None => {
                let nearest = most_similar(&name, figures.iter().map(String::as_str))
                    .map(|name| format!(" (nearest: {name})"))
                    .unwrap_or_default();
                problems.push(format!("{name} is no metric of its trials{nearest}"));
            }
        }
    }
    if problems.is_empty() {
        return Ok(found);
    }
    let known = named(figures);
    problems
        .push(format!("Its trials have, among others, {known}; `murmuration metrics` lists all"));
    Err(problems.join("\n"))
}

/// The values of some metrics, of trials whose network has formed.
fn read(
    folder: &ResultFolder,
    table: &input::table::Table,
    wanted: &[String],
    n_settings: usize,
) -> Result<Vec<Metric>, FigureError> {
    let mut columns: Vec<&str> = vec!["setting", SEED, "status"];
    columns.extend(wanted.iter().map(String::as_str));
    let mut metrics: Vec<Metric> = wanted
        .iter()
        .map(|column| Metric {
            name: Name::of_figure(column),
            is_flag: false,
            values: vec![Vec::new(); n_settings],
            seeds: vec![Vec::new(); n_settings],
        })
        .collect();
    table.each_row_with(&columns, |row| {
        let fields: BTreeMap<&str, &Field> =
            row.get_column_iter().map(|(name, field)| (name.as_str(), field)).collect();
        let setting = match fields.get("setting") {
            Some(Field::ULong(setting)) if (*setting as usize) < n_settings => *setting as usize,
            _ => {
                let message = "a trial is of no setting of summary.json".to_owned();
                let path = folder.path().join(TABLE_FILE);
                return Err(ResultError::Format { path, message });
            }
        };
        if !matches!(fields.get("status"), Some(Field::Str(status)) if status == "complete") {
            return Ok(());
        }
        let seed = match fields.get(SEED) {
            Some(Field::ULong(seed)) => *seed,
            _ => 0,
        };
        for (metric, column) in metrics.iter_mut().zip(wanted) {
            let value = match fields.get(column.as_str()) {
                Some(Field::Double(value)) => *value,
                Some(Field::ULong(value)) => *value as f64,
                Some(Field::Bool(is)) => {
                    metric.is_flag = true;
                    f64::from(u8::from(*is))
                }
                _ => continue,
            };
            metric.values[setting].push(value);
            metric.seeds[setting].push(seed);
        }
        Ok(())
    })?;
    Ok(metrics)
}

/// The middle of the values of a setting with its interval.
fn middle(metric: &Metric, setting: usize) -> Option<Point> {
    let values = &metric.values[setting];
    let n = values.len() as u64;
    let spread = MetricSpread::from_values(values)?;
    let (y, ends, interval) = if metric.is_flag {
        let share = DistanceBin {
            attempts: n,
            deliveries: values.iter().filter(|value| **value != 0.0).count() as u64,
            ..DistanceBin::default()
        };
        (share.ratio(), Some(share.interval()), "Wilson 95 %")
    } else {
        let kind = match spread.interval.map(|interval| interval.kind) {
            Some(IntervalKind::Bootstrap95) => BOOTSTRAP,
            Some(IntervalKind::Range) | None => RANGE,
        };
        (spread.median, spread.interval.map(|interval| [interval.low, interval.high]), kind)
    };
    Some(Point {
        low: ends.map(|ends| ends[0]),
        high: ends.map(|ends| ends[1]),
        interval: ends.map(|_| interval),
        n: Some(n),
        statistic: Some(if metric.is_flag { "share of trials" } else { "median" }),
        ..Point::of(0.0, y)
    })
}

fn panel(
    metric: &Metric,
    factors: &[Factor],
    x: Option<usize>,
    others: &[usize],
) -> (Panel, String) {
    let group_of = |setting: usize| {
        let parts = others.iter().map(|&other| factors[other].described(setting));
        parts.collect::<Vec<_>>().join(", ")
    };
    let mut groups: Vec<String> = Vec::new();
    for setting in 0..metric.values.len() {
        let group = group_of(setting);
        if !groups.contains(&group) {
            groups.push(group);
        }
    }
    let axis = x_axis(x.map(|x| &factors[x]));
    let place = |setting: usize| -> f64 {
        let Some(x) = x else { return 0.0 };
        let (text, number) = &factors[x].values[setting];
        match axis.scale {
            Scale::Category => {
                axis.categories.iter().position(|name| name == text).unwrap_or(0) as f64
            }
            Scale::Linear | Scale::Log => number.unwrap_or(f64::NAN),
        }
    };
    let n_groups = groups.len() as f64;
    let mut series = Vec::new();
    let mut told = Vec::new();
    let mut counts = BTreeSet::new();
    let mut kinds = BTreeSet::new();
    for (group, name) in groups.iter().enumerate() {
        // Beside each other, where there is room for that.
        let shift = match axis.scale {
            Scale::Category => 0.6 * ((group as f64 + 0.5) / n_groups - 0.5),
            Scale::Linear | Scale::Log => 0.0,
        };
        let own: Vec<usize> =
            (0..metric.values.len()).filter(|&setting| group_of(setting) == *name).collect();
        let trials = own.iter().flat_map(|&setting| {
            let seeds = metric.seeds[setting].iter();
            seeds.zip(&metric.values[setting]).map(move |(seed, value)| (setting, *seed, *value))
        });
        let dots = trials
            .map(|(setting, seed, value)| Point {
                seed: Some(seed),
                statistic: Some("trial"),
                ..Point::of(place(setting) + shift, value)
            })
            .collect();
        let mut middles: Vec<Point> = Vec::new();
        for &setting in &own {
            let Some(point) = middle(metric, setting) else { continue };
            counts.extend(point.n);
            kinds.extend(point.interval);
            let at = x.map(|x| factors[x].described(setting)).unwrap_or_default();
            let of = [at.as_str(), name]
                .iter()
                .filter(|text| !text.is_empty())
                .copied()
                .collect::<Vec<_>>()
                .join(", ");
            told.push(format!("{of} {}", in_words(metric, &point)).trim().to_owned());
            middles.push(Point { x: place(setting) + shift, ..point });
        }
        middles.sort_by(|a, b| a.x.total_cmp(&b.x));
        // A share of trials has no dots: all would lie at 0 or 1.
        if !metric.is_flag {
            series.push(Series {
                name: String::new(),
                mark: Mark::FaintDot,
                group: Some(group),
                points: dots,
            });
        }
        series.push(Series {
            name: name.clone(),
            mark: Mark::Interval,
            group: Some(group),
            points: middles,
        });
    }
    let y = y_axis(metric, &series);
    let caption = caption(metric, &told, &counts, &kinds);
    (Panel { x: axis, y, is_map: false, series, colour: None }, caption)
}

fn in_words(metric: &Metric, point: &Point) -> String {
    let shown = |value: f64| match metric.name.is_share || metric.is_flag {
        // Duty cycles differ in digits that per cent with one decimal do not show.
        true if value.abs() < 0.1 => format!("{} %", number(100.0 * value)),
        true => percent(value),
        false => number(value),
    };
    let middle = point.y.map(shown).unwrap_or_default();
    match (point.low, point.high) {
        (Some(low), Some(high)) => format!("{middle} [{}, {}]", shown(low), shown(high)),
        _ => middle,
    }
}

/// What the panel shows: statistic, interval, number of trials, and the numbers if they are few.
fn caption(
    metric: &Metric,
    told: &[String],
    counts: &BTreeSet<u64>,
    kinds: &BTreeSet<&str>,
) -> String {
    let unit = metric.name.unit.map(|unit| format!(" ({unit})")).unwrap_or_default();
    let n = match (counts.first(), counts.last()) {
        (Some(least), Some(most)) if least == most => format!("n = {most} trials each"),
        (Some(least), Some(most)) => format!("n = {least} to {most} trials"),
        _ => return format!("{}{unit}: no trial has it.", metric.name.words),
    };
    let intervals: Vec<&str> = kinds
        .iter()
        .map(|kind| match *kind {
            RANGE => "the range of the trials",
            BOOTSTRAP => "the 95 % bootstrap interval of the median",
            _ => "the 95 % interval of the share (Wilson)",
        })
        .collect();
    let with = if intervals.is_empty() {
        String::new()
    } else {
        format!(" with {}", intervals.join(" or "))
    };
    let what = if metric.is_flag { "share of trials" } else { "median" };
    let numbers =
        if told.len() <= MOST_NAMED { format!(": {}", told.join("; ")) } else { String::new() };
    format!(
        "{}{unit}: {what}{with}, {n}{numbers}.",
        numbers::format::capitalised(&metric.name.words)
    )
}

fn x_axis(factor: Option<&Factor>) -> Axis {
    let Some(factor) = factor else { return Axis::of_categories("", vec![String::new()]) };
    let levels = factor.levels();
    if !factor.is_numeric() {
        let names = levels.iter().map(|(text, _)| text.clone()).collect();
        return Axis::of_categories(factor.name.label(), names);
    }
    let numbers: Vec<f64> = levels.iter().filter_map(|(_, number)| *number).collect();
    let [low, high] = range(numbers.iter().copied());
    if 0.0 < low && LOG_RATIO * low <= high {
        let margin = libm::pow(high / low, 0.05);
        let axis = Axis::linear(factor.name.label(), [low / margin, high * margin]);
        return Axis { scale: Scale::Log, ..axis };
    }
    let margin = 0.06 * (high - low);
    let axis = Axis::linear(factor.name.label(), [low - margin, high + margin]);
    let ticks = if numbers.len() <= MOST_TICKS { numbers } else { Vec::new() };
    Axis { ticks, ..axis }
}

fn y_axis(metric: &Metric, series: &[Series]) -> Axis {
    let label = if metric.is_flag {
        format!("{} (share of trials)", metric.name.words)
    } else {
        metric.name.label()
    };
    let points = series.iter().flat_map(|series| &series.points);
    let [low, high] = range(points.flat_map(|point| [point.y, point.low, point.high]).flatten());
    let is_share = metric.name.is_share || metric.is_flag;
    // From 0, unless all lies in the upper part.
    let floor = if 0.0 <= low && low < 0.6 * high { 0.0 } else { low - 0.06 * (high - low) };
    // Trials of 100 % do not lie on the edge.
    let axis = Axis::linear(label, [floor, high + 0.06 * (high - floor)]);
    if is_share { axis.of_shares() } else { axis }
}
