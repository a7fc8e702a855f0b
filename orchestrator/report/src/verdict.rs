//! The first sentences of a run's page: whether it worked, and where to look.

use super::moments::{joined, moment, with_moments};
use maud::{Markup, Render as _, html};
use metrics::Measures;
use metrics::kpi::kpi_summary::KpiSummary;
use numbers::format::{count_of, number, percent, shortest};
use record::run_summary::RunSummary;
use record::{FinishedRun, Status};

/// The section.
pub(super) fn section(contents: &FinishedRun<'_>) -> Option<Markup> {
    let FinishedRun { summary, measures, .. } = contents;
    let kpis = summary.kpis.as_ref();
    let course = course(summary, *measures);
    let look_at: Vec<Markup> = [
        kpis.and_then(worst_delivery),
        measures.and_then(most_isolated),
        collisions(summary),
        kpis.and_then(slowest),
    ]
    .into_iter()
    .flatten()
    .take(MOST_NAMED)
    .map(|words| with_moments(&words, summary))
    .collect();
    Some(html! {
        p.verdict.alert[summary.status != Status::Complete || is_without_network(kpis)] {
            strong { (course) }
            @if !look_at.is_empty() { " Look first at " (joined(&look_at, ", and at ")) "." }
        }
    })
}

/// Most things to look at first.
const MOST_NAMED: usize = 2;

/// Whether the run came to its end, the network formed and the robots finished.
fn course(summary: &RunSummary, measures: Option<&Measures>) -> Markup {
    let status = match summary.status {
        Status::Complete => "The run finished".to_owned(),
        Status::Failed => format!("The run failed after {} s", shortest(summary.simulated_s)),
        Status::Interrupted => {
            format!("The run was interrupted after {} s", shortest(summary.simulated_s))
        }
    };
    let formation = summary.kpis.as_ref().and_then(|kpis| kpis.formation.as_ref());
    let formation = formation.map(|formation| match formation.formed_s {
        Some(formed_s) => {
            let words = format!("the network formed after {} s", number(formed_s));
            moment("formed", &words.render())
        }
        None => {
            let missing = count_of(formation.missing as u64, "mote");
            format!("the network did not form: {missing} did not join").render()
        }
    });
    let task = measures.and_then(Measures::completed_after_s);
    let task = task.map(|after_s| {
        let words = format!("the robots finished their task after {} s", number(after_s));
        moment("task", &words.render())
    });
    let parts: Vec<Markup> =
        [Some(status.render()), formation, task].into_iter().flatten().collect();
    html! { (joined(&parts, "; ")) "." }
}

fn is_without_network(kpis: Option<&KpiSummary>) -> bool {
    kpis.and_then(|kpis| kpis.formation.as_ref()).is_some_and(|formation| !formation.formed)
}

/// The mote of a column with the least value, or the greatest.
fn extreme(kpis: &KpiSummary, column: &str, is_greatest: bool) -> Option<(usize, f64)> {
    let values = kpis.motes.get(column)?.iter().enumerate();
    let known = values.filter_map(|(mote, value)| Some((mote, (*value)?)));
    if is_greatest {
        known.rev().max_by(|a, b| a.1.total_cmp(&b.1))
    } else {
        known.min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

fn worst_delivery(kpis: &KpiSummary) -> Option<String> {
    let (mote, ratio) = extreme(kpis, "delivery_ratio", false)?;
    (ratio < 1.0).then(|| format!("mote {mote}, of whose packets {} arrived", percent(ratio)))
}

/// With a smaller share of its periods in which it heard nobody, a robot is not named.
const LEAST_ISOLATED: f64 = 0.1;

fn most_isolated(measures: &Measures) -> Option<String> {
    if !measures.anybody_spoke() {
        return None;
    }
    let agents = measures.isolated_agents();
    let (agent, share) = agents.first().copied().filter(|(_, share)| LEAST_ISOLATED < *share)?;
    Some(format!("robot {agent}, which heard nobody in {} of its control periods", percent(share)))
}

fn collisions(summary: &RunSummary) -> Option<String> {
    let n = summary.task.as_ref()?.number("collisions").filter(|n| 0.0 < *n)?;
    Some(format!("the {} between robots", count_of(n as u64, "collision")))
}

/// A latency so many times the median of all motes is worth a look.
const LEAST_SLOW: f64 = 3.0;

fn slowest(kpis: &KpiSummary) -> Option<String> {
    let (mote, latency_s) = extreme(kpis, "median_latency_s", true)?;
    let median_s = kpis.delivery.as_ref()?.latency_s.as_ref()?.median?;
    (LEAST_SLOW * median_s < latency_s).then(|| {
        format!(
            "mote {mote}, whose median latency is {} s ({} s over all motes)",
            number(latency_s),
            number(median_s)
        )
    })
}
