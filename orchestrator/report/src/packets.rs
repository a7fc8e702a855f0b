//! The page of a network against measured packets: each figure among those of seeds, each mote's delivery.

use super::figures::HALF;
use super::layout::{self, number_cell};
use super::measured::{Picture, STYLE, figures, half, words};
use super::svg::{Axis, Chart};
use indexmap::IndexMap;
use maud::{Markup, html};
use measure::account::DataAccount;
use network::comparison::{Kpi, MoteDelivery, NetworkComparison};
use network::diagnosis::NetworkDiagnosis;
use network::error_split::{NetworkErrorSplit, PartOfFigure};
use network::task::comparison::{TaskComparison, TaskErrorSplit};
use numbers::format::{capitalised, count, number, percent, with_unit};
use numbers::quantity;
use numbers::statistics::range;
use serde::Serialize;

/// An answer about a network or a swarm's task.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(untagged)]
pub enum NetworkAnswer<'a> {
    /// Whether packets could be one more run of the model.
    Comparison(&'a NetworkComparison),
    /// Which effects the network lacks.
    Diagnosis(&'a NetworkDiagnosis),
    /// Whether what robots did could be one more run of the model.
    Task(&'a TaskComparison),
}

impl<'a> NetworkAnswer<'a> {
    fn account(self) -> &'a DataAccount {
        match self {
            Self::Comparison(comparison) => &comparison.account,
            Self::Diagnosis(diagnosis) => &diagnosis.account,
            Self::Task(comparison) => &comparison.account,
        }
    }

    fn sentence(self) -> &'a str {
        match self {
            Self::Comparison(comparison) => &comparison.sentence,
            Self::Diagnosis(diagnosis) => &diagnosis.sentence,
            Self::Task(comparison) => &comparison.sentence,
        }
    }

    fn seeds(self) -> u64 {
        match self {
            Self::Comparison(comparison) => comparison.among.seeds,
            Self::Diagnosis(diagnosis) => diagnosis.among.seeds,
            Self::Task(comparison) => comparison.seeds,
        }
    }

    fn kpis(self) -> &'a [Kpi] {
        match self {
            Self::Comparison(comparison) => &comparison.among.kpis,
            Self::Diagnosis(diagnosis) => &diagnosis.among.kpis,
            Self::Task(comparison) => &comparison.kpis,
        }
    }

    fn motes(self) -> &'a [MoteDelivery] {
        match self {
            Self::Comparison(comparison) => &comparison.among.motes,
            Self::Diagnosis(diagnosis) => &diagnosis.among.motes,
            Self::Task(_) => &[],
        }
    }

    /// Where the error comes from, where that was asked.
    fn split(self) -> Option<Split<'a>> {
        match self {
            Self::Comparison(comparison) => comparison.error_split.as_ref().map(Split::of_network),
            Self::Diagnosis(_) => None,
            Self::Task(comparison) => Some(Split::of_task(&comparison.error_split)),
        }
    }
}

/// What goes into the page.
struct PacketsPage<'a> {
    config: &'a str,
    command: &'a str,
    answer: NetworkAnswer<'a>,
}

/// A section of the page, or none where the answer has nothing to show in it.
type Section = fn(&PacketsPage<'_>) -> Option<Markup>;

/// The page from top to bottom.
const SECTIONS: &[Section] =
    &[heading, notices, candidates, ties, all_figures, error_split, by_figure, by_mote, again];

/// The page. `command`: what makes this page again.
#[must_use]
pub fn page(config: &str, command: &str, answer: NetworkAnswer<'_>) -> String {
    let contents = PacketsPage { config, command, answer };
    let sections = SECTIONS.iter().filter_map(|section| section(&contents));
    layout::page(&contents.title(), STYLE, &html! { @for section in sections { (section) } })
}

impl<'a> PacketsPage<'a> {
    fn title(&self) -> String {
        let kind = if self.diagnosis().is_some() { "Diagnosis" } else { "Comparison" };
        format!("{kind}: {} against {}", self.config, self.answer.account().data.file)
    }

    /// The diagnosis, if the answer is one.
    fn diagnosis(&self) -> Option<&'a NetworkDiagnosis> {
        match self.answer {
            NetworkAnswer::Diagnosis(diagnosis) => Some(diagnosis),
            NetworkAnswer::Comparison(_) | NetworkAnswer::Task(_) => None,
        }
    }
}

fn heading(contents: &PacketsPage<'_>) -> Option<Markup> {
    let answer = contents.answer;
    let account = answer.account();
    let rows = if matches!(answer, NetworkAnswer::Task(_)) { "places" } else { "packets" };
    Some(html! {
        header {
            h1 { (contents.title()) }
            p.lead {
                (count(account.rows as u64)) " " (rows) ", " (count(account.used as u64)) " used; the network was run under "
                (answer.seeds()) " seeds. A measurement is one run whose chances fell in one way: the question is whether it could \
                be one of the model's."
            }
        }
        p.verdict { (capitalised(&in_words(answer.sentence(), answer.kpis()))) }
    })
}

/// A sentence with what figures are in place of their names in the answer.
fn in_words(sentence: &str, kpis: &[Kpi]) -> String {
    let mut names: Vec<&Kpi> = kpis.iter().filter(|kpi| kpi.name.contains('_')).collect();
    // A name may begin another.
    names.sort_by_key(|kpi| std::cmp::Reverse(kpi.name.len()));
    names.into_iter().fold(sentence.to_owned(), |words, kpi| words.replace(kpi.name, kpi.doc))
}

fn notices(contents: &PacketsPage<'_>) -> Option<Markup> {
    words::notices_of(contents.answer.account())
}

fn candidates(contents: &PacketsPage<'_>) -> Option<Markup> {
    let diagnosis = contents.diagnosis()?;
    Some(html! {
        h2 { "What was tried" }
        p {
            "Each candidate was run under the same seeds as the model; its gain is how much more probable these packets are with it: g nats, eᵍ times. \
            A chance below the level accepts it: that the model itself, without the effect, would give so great a gain."
        }
        table {
            tr { th { "effect" } th.n { "gain (nats)" } th.n { "p" } th { "parameters" } th { "accepted" } }
            @for candidate in &diagnosis.candidates {
                @let parameters: Vec<String> = candidate
                    .parameters
                    .iter()
                    .map(|(name, it)| {
                        let value = with_unit(&number(it.value), &it.unit);
                        format!("{name} = {value} ({} to {})", number(it.low), number(it.high))
                    })
                    .collect();
                tr {
                    td { (candidate.effect) }
                    (number_cell(number(candidate.gain.unwrap_or(f64::NAN))))
                    (number_cell(number(candidate.p_value.unwrap_or(f64::NAN))))
                    td { (parameters.join(", ")) }
                    td { @if candidate.accepted { "yes" } }
                }
            }
        }
    })
}

fn ties(contents: &PacketsPage<'_>) -> Option<Markup> {
    let diagnosis = contents.diagnosis()?;
    let candidates = diagnosis.candidates.iter();
    let candidates =
        candidates.map(|tested| (tested.effect, tested.indistinguishable_from.clone()));
    let next = diagnosis.next_measurement.iter().map(|next| next.sentence.as_str());
    words::ties_of(candidates, next)
}

/// Each figure as measured and in the model.
fn all_figures(contents: &PacketsPage<'_>) -> Option<Markup> {
    let with = contents.diagnosis().and_then(|diagnosis| diagnosis.kpis_with.as_deref());
    let with = with.unwrap_or_default();
    let range = |kpi: &Kpi| {
        format!("{} to {}", value_of(kpi, kpi.model.low), value_of(kpi, kpi.model.high))
    };
    Some(html! {
        h2 { "All figures" }
        table {
            tr {
                th { "figure" }
                th { "what it is" }
                th.n { "measured" }
                th.n { "model, 90 % of seeds" }
                @if !with.is_empty() { th.n { "with what was found" } }
                th { "unit" }
                th.n { "p" }
            }
            @for (k, kpi) in contents.answer.kpis().iter().enumerate() {
                tr {
                    td { (kpi.name) }
                    td { (kpi.doc) }
                    (number_cell(value_of(kpi, kpi.measured)))
                    (number_cell(range(kpi)))
                    @if let Some(with) = with.get(k) { (number_cell(range(with))) }
                    td { (kpi.unit) }
                    (number_cell(number(kpi.p_value.unwrap_or(f64::NAN))))
                }
            }
        }
    })
}

/// Where an error comes from, of packets or of a task.
struct Split<'a> {
    heading: &'static str,
    sentence: &'a str,
    note: &'a str,
    /// Names of the parts.
    parts: Vec<&'static str>,
    figures: Vec<SplitFigure<'a>>,
}

/// A figure whose error is split.
struct SplitFigure<'a> {
    name: &'static str,
    unit: &'static str,
    measured: f64,
    whole: f64,
    parts: &'a IndexMap<&'static str, Option<PartOfFigure>>,
}

impl<'a> Split<'a> {
    fn of_network(split: &'a NetworkErrorSplit) -> Self {
        let figures = split.figures.iter().map(|figure| SplitFigure {
            name: figure.name,
            unit: figure.unit,
            measured: figure.measured,
            whole: figure.whole,
            parts: &figure.parts,
        });
        Self {
            heading: "Robot, radio or protocol?",
            sentence: &split.sentence,
            note: split.note,
            parts: split.order.to_vec(),
            figures: figures.collect(),
        }
    }

    fn of_task(split: &'a TaskErrorSplit) -> Self {
        let figures = split.figures.iter().map(|figure| SplitFigure {
            name: figure.name,
            unit: figure.unit,
            measured: figure.measured,
            whole: figure.whole,
            parts: &figure.parts,
        });
        Self {
            heading: "Network or robot?",
            sentence: &split.sentence,
            note: split.note,
            parts: split.order.into_iter().chain(["neither"]).collect(),
            figures: figures.collect(),
        }
    }
}

/// Where the error comes from, where that was asked.
fn error_split(contents: &PacketsPage<'_>) -> Option<Markup> {
    let split = contents.answer.split()?;
    Some(html! {
        h2 { (split.heading) }
        p { (capitalised(split.sentence)) ". " (capitalised(split.note)) "." }
        table {
            tr {
                th { "figure" }
                th.n { "measured" }
                th.n { "whole model" }
                @for part in &split.parts { th.n { (part) } }
                th { "unit" }
            }
            @for figure in split.figures.iter().filter(|figure| figure.measured.is_finite()) {
                tr {
                    td { (figure.name) }
                    (number_cell(number(figure.measured)))
                    (number_cell(number(figure.whole)))
                    @for part in &split.parts {
                        (number_cell(part_in_words(figure.parts.get(part).copied().flatten())))
                    }
                    td { (figure.unit) }
                }
            }
        }
    })
}

fn part_in_words(part: Option<PartOfFigure>) -> String {
    match part {
        None => "–".to_owned(),
        Some(PartOfFigure { value, low, high, .. }) => {
            format!("{} ({} to {})", number(value), number(low), number(high))
        }
    }
}

fn by_figure(contents: &PacketsPage<'_>) -> Option<Markup> {
    let intro = "Dots are seeds of the model, from the least to the greatest; the line is what was measured. A line amid the dots is \
                 no news. One beyond them is what the model has no run for.";
    let pictures: Vec<Picture> = contents.answer.kpis().iter().filter_map(kpi).collect();
    figures("Figure by figure", intro, &pictures)
}

fn by_mote(contents: &PacketsPage<'_>) -> Option<Markup> {
    figures("Mote by mote", "", &[delivery(contents.answer.motes())?])
}

fn again(contents: &PacketsPage<'_>) -> Option<Markup> {
    Some(html! { h2 { "Again" } p { code { (contents.command) } } })
}

/// Bounds with some room about them.
fn bounds(values: &[f64]) -> Option<[f64; 2]> {
    let [low, high] = range(values.iter().copied());
    let room = 0.05 * (high - low).max(1e-3 * high.abs()).max(1e-6);
    (low <= high).then_some([low - room, high + room])
}

/// Whether a figure is a share of packets, which people read in per cent.
fn is_share(kpi: &Kpi) -> bool {
    kpi.unit.is_empty() && kpi.doc.starts_with("share of ")
}

/// A value of a figure, without its unit.
fn value_of(kpi: &Kpi, value: f64) -> String {
    if is_share(kpi) && value.is_finite() { percent(value) } else { number(value) }
}

fn kpi(kpi: &Kpi) -> Option<Picture> {
    let Kpi { name, unit, doc, measured, .. } = *kpi;
    if !measured.is_finite() {
        return None;
    }
    let mut seeds = kpi.model.seeds.clone();
    seeds.retain(|value| value.is_finite());
    seeds.sort_by(f64::total_cmp);
    let all: Vec<f64> = seeds.iter().copied().chain([measured]).collect();
    let [low, high] = bounds(&all)?;
    let is_share = is_share(kpi);
    let value = |value: f64| with_unit(&value_of(kpi, value), unit);
    let label =
        quantity::with_unit(&quantity::words(name), Some(if is_share { "%" } else { unit }));
    let x = Axis::new("seeds, from least to greatest (rank)", -0.5, seeds.len() as f64 - 0.5)
        .integer_ticks();
    let y = Axis::new(&label, low, high);
    let mut chart = half(x, if is_share { y.percent() } else { y });
    chart.dots("trial", seeds.iter().enumerate().map(|(k, &value)| [k as f64, value]));
    chart.level(measured, "measured");
    let below = seeds.iter().filter(|&&value| value < measured).count();
    let sentence =
        format!("Measured {}; {below} of {} seeds lie below.", value(measured), seeds.len());
    let title = capitalised(doc);
    let svg = chart.finish(name, &title, &sentence);
    Some(Picture {
        title,
        look: sentence,
        means: format!(
            "90 % of the seeds of the model lie from {} to {}.",
            value(kpi.model.low),
            value(kpi.model.high)
        ),
        key: vec![("trial", "a seed of the model".to_owned())],
        svg,
        is_wide: false,
    })
}

fn delivery(motes: &[MoteDelivery]) -> Option<Picture> {
    let names: Vec<String> = motes.iter().map(|mote| mote.mote.to_string()).collect();
    if motes.is_empty() {
        return None;
    }
    let x = Axis::new("mote (number)", -0.5, motes.len() as f64 - 0.5).named(&names);
    let y = Axis::new("share delivered (%)", 0.0, 1.02).percent();
    let mut chart = Chart::new(x, y, 2.0 * HALF, super::figures::HALF_HEIGHT);
    for (k, mote) in motes.iter().enumerate() {
        let model = &mote.model;
        let words = format!("mote {}: {} arrived of {}", names[k], mote.arrived, mote.sent);
        chart.interval(k as f64, model.mean, [model.low, model.high], &words);
    }
    let measured = motes.iter().enumerate();
    chart.dots("point after", measured.map(|(k, mote)| [k as f64, mote.delivery]));
    let outside = motes.iter().filter(|mote| mote.is_outside).count();
    let sentence = format!("{outside} of {} motes lie outside.", motes.len());
    let svg = chart.finish("delivery-by-mote", "Delivery by mote", &sentence);
    Some(Picture {
        title: "Delivery by mote".to_owned(),
        look: sentence,
        means: "About a tenth of the motes lie outside by chance alone; a few far outside are motes, or links, that the model has wrong."
            .to_owned(),
        key: vec![
            ("interval", "90 % of seeds".to_owned()),
            ("point after", "measured".to_owned()),
        ],
        svg,
        is_wide: true,
    })
}
