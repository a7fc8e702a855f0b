//! The page of a network against measured packets: each figure among those of seeds, each mote's delivery.

use super::figures::HALF;
use super::measured::{Picture, begin, figures, half, words};
use super::svg::{Axis, Chart};
use super::text::escape;
use indexmap::IndexMap;
use measure::account::Account;
use network::comparison::{Kpi, MoteDelivery, NetworkComparison};
use network::diagnosis::NetworkDiagnosis;
use network::error_split::{NetworkErrorSplit, PartOfFigure};
use network::task::comparison::{TaskComparison, TaskErrorSplit};
use numbers::format::{capitalised, count, number};
use serde::Serialize;
use std::fmt::Write as _;

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
    fn account(self) -> &'a Account {
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

/// The page. `command`: what makes this page again.
#[must_use]
pub fn page(config: &str, command: &str, answer: NetworkAnswer<'_>) -> String {
    let account = answer.account();
    let diagnosis = match answer {
        NetworkAnswer::Diagnosis(diagnosis) => Some(diagnosis),
        NetworkAnswer::Comparison(_) | NetworkAnswer::Task(_) => None,
    };
    let title = format!(
        "{}: {config} against {}",
        if diagnosis.is_some() { "Diagnosis" } else { "Comparison" },
        account.data.file
    );
    let mut page = begin(&title);
    let _ = write!(
        page,
        "<header>\n<h1>{}</h1>\n<p class=\"lead\">{} {}, {} used; the network was run under {} seeds. A measurement is one run whose chances fell in one way: the question is whether it could be one of the model's.</p>\n</header>\n<p class=\"verdict\">{}</p>\n",
        escape(&title),
        count(account.rows as u64),
        if matches!(answer, NetworkAnswer::Task(_)) { "places" } else { "packets" },
        count(account.used as u64),
        answer.seeds(),
        escape(&capitalised(answer.sentence()))
    );
    words::notices(&mut page, account);
    if let Some(diagnosis) = diagnosis {
        candidates(&mut page, diagnosis);
        let ties = diagnosis.candidates.iter();
        let ties = ties.map(|tested| (tested.effect, tested.indistinguishable_from.clone()));
        let next = diagnosis.next_measurement.iter().map(|next| next.sentence.as_str());
        words::ties(&mut page, ties, next);
    }
    let with = diagnosis.and_then(|diagnosis| diagnosis.kpis_with.as_deref());
    table(&mut page, answer.kpis(), with.unwrap_or_default());
    if let Some(found) = answer.split() {
        split(&mut page, &found);
    }
    figures(
        &mut page,
        "Figure by figure",
        "Dots are seeds of the model, from the least to the greatest; the line is what was measured. A line amid the dots is no news. \
         One beyond them is what the model has no run for.",
        &answer.kpis().iter().filter_map(kpi).collect::<Vec<_>>(),
    );
    let motes: Vec<Picture> = delivery(answer.motes()).into_iter().collect();
    figures(&mut page, "Mote by mote", "", &motes);
    let _ = write!(
        page,
        "<h2>Again</h2>\n<p><code>{}</code></p>\n</main>\n</body>\n</html>\n",
        escape(command)
    );
    page
}

fn table(page: &mut String, kpis: &[Kpi], with: &[Kpi]) {
    let column = if with.is_empty() { "" } else { "<th class=\"n\">with what was found</th>" };
    let _ = writeln!(
        page,
        "<h2>All figures</h2>\n<table>\n<tr><th>figure</th><th>what it is</th><th class=\"n\">measured</th><th class=\"n\">model, 90 % of seeds</th>{column}<th>unit</th><th class=\"n\">p</th></tr>"
    );
    let range = |kpi: &Kpi| format!("{} to {}", number(kpi.model.low), number(kpi.model.high));
    for (k, kpi) in kpis.iter().enumerate() {
        let with = with
            .get(k)
            .map_or_else(String::new, |kpi| format!("<td class=\"n\">{}</td>", range(kpi)));
        let _ = writeln!(
            page,
            "<tr><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td>{with}<td>{}</td><td class=\"n\">{}</td></tr>",
            escape(kpi.name),
            escape(kpi.doc),
            number(kpi.measured),
            range(kpi),
            kpi.unit,
            number(kpi.p_value.unwrap_or(f64::NAN)),
        );
    }
    page.push_str("</table>\n");
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

fn split(page: &mut String, split: &Split<'_>) {
    let columns: String =
        split.parts.iter().map(|part| format!("<th class=\"n\">{part}</th>")).collect();
    let _ = writeln!(
        page,
        "<h2>{}</h2>\n<p>{}. {}.</p>\n<table>\n<tr><th>figure</th><th class=\"n\">measured</th><th class=\"n\">whole model</th>{columns}<th>unit</th></tr>",
        split.heading,
        escape(&capitalised(split.sentence)),
        escape(&capitalised(split.note)),
    );
    for figure in split.figures.iter().filter(|figure| figure.measured.is_finite()) {
        let cell = |part: &&str| match figure.parts.get(part).copied().flatten() {
            None => "<td class=\"n\">–</td>".to_owned(),
            Some(PartOfFigure { value, low, high, .. }) => format!(
                "<td class=\"n\">{} ({} to {})</td>",
                number(value),
                number(low),
                number(high)
            ),
        };
        let _ = writeln!(
            page,
            "<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td>{}<td>{}</td></tr>",
            escape(figure.name),
            number(figure.measured),
            number(figure.whole),
            split.parts.iter().map(cell).collect::<String>(),
            figure.unit,
        );
    }
    page.push_str("</table>\n");
}

fn candidates(page: &mut String, diagnosis: &NetworkDiagnosis) {
    page.push_str("<h2>What was tried</h2>\n<p>Each candidate was run under the same seeds as the model; its gain is how much more probable these packets are with it. A chance below the level accepts it: that the model itself, without the effect, would give so great a gain.</p>\n<table>\n<tr><th>effect</th><th class=\"n\">gain (nats)</th><th class=\"n\">p</th><th>parameters</th><th>accepted</th></tr>\n");
    for candidate in &diagnosis.candidates {
        let parameters: Vec<String> = candidate
            .parameters
            .iter()
            .map(|(name, it)| {
                format!(
                    "{name} = {} {} ({} to {})",
                    number(it.value),
                    it.unit,
                    number(it.low),
                    number(it.high)
                )
            })
            .collect();
        let _ = writeln!(
            page,
            "<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td>{}</td><td>{}</td></tr>",
            escape(candidate.effect),
            number(candidate.gain.unwrap_or(f64::NAN)),
            number(candidate.p_value.unwrap_or(f64::NAN)),
            escape(&parameters.join(", ")),
            if candidate.accepted { "yes" } else { "" },
        );
    }
    page.push_str("</table>\n");
}

/// Bounds with some room about them.
fn bounds(values: &[f64]) -> Option<[f64; 2]> {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let room = 0.05 * (high - low).max(1e-3 * high.abs()).max(1e-6);
    (low <= high).then_some([low - room, high + room])
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
    let label = if unit.is_empty() { name.to_owned() } else { format!("{name} ({unit})") };
    let x = Axis::new("seeds, by this figure", -0.5, seeds.len() as f64 - 0.5).whole();
    let mut chart = half(x, Axis::new(&label, low, high));
    chart.dots("dot", seeds.iter().enumerate().map(|(k, &value)| [k as f64, value]));
    chart.level(measured, "measured");
    let below = seeds.iter().filter(|&&value| value < measured).count();
    let sentence = format!(
        "Measured {} {unit}; {below} of {} seeds lie below.",
        number(measured),
        seeds.len()
    );
    let svg = chart.finish(name, name, &sentence);
    Some(Picture {
        title: name.to_owned(),
        look: sentence,
        means: format!("It is {doc}."),
        key: vec![("dot", "seeds".to_owned())],
        svg,
        is_wide: false,
    })
}

fn delivery(motes: &[MoteDelivery]) -> Option<Picture> {
    let names: Vec<String> = motes.iter().map(|mote| mote.mote.to_string()).collect();
    if motes.is_empty() {
        return None;
    }
    let x = Axis::new("mote", -0.5, motes.len() as f64 - 0.5).named(&names);
    let y = Axis::new("delivery", 0.0, 1.02).percent();
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
            ("dot after", "measured".to_owned()),
        ],
        svg,
        is_wide: true,
    })
}
