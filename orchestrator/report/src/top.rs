//! The top of a run's page: what was run, what must be known before the rest is believed, and the few numbers that matter most.

use super::is_truth;
use super::layout::{self, with_unit};
use super::moments::{moment, with_moments};
use maud::{Markup, html};
use metrics::headline::Shown;
use metrics::kpi::kpi_summary::{DeliveredOfExpected, ExchangeOutcome, KpiSummary, Transmissions};
use metrics::task::Goal;
use numbers::format::{count, count_of, number, percent, shortest, years};
use proto::types::Coupling;
use record::run_summary::RunSummary;
use record::{FinishedRun, Status, TRUTH_BASELINE};

pub(super) fn heading(contents: &FinishedRun<'_>) -> Option<Markup> {
    let FinishedRun { header, summary, .. } = contents;
    let controller = contents.measures.and_then(|measures| measures.task.controller.as_deref());
    let started_s = summary.robots_started_s.filter(|started_s| 0.0 < *started_s);
    Some(html! {
        header {
            h1 {
                (header.name)
                span.badge.alert[summary.status != Status::Complete] { (summary.status.name()) }
                @if is_truth(contents) { span.badge.alert { (TRUTH_BASELINE) } }
            }
            p.lead {
                @if let Some(controller) = controller { "Controller " (controller) ", " }
                (count_of(u64::from(header.agent_count), "robot")) ", "
                (count(summary.steps)) " steps of "
                @if header.coupling == Coupling::Event { "at most " }
                (shortest(header.step_ns as f64 / 1e9)) " s, "
                (shortest(summary.simulated_s)) " s simulated"
                @if let Some(started_s) = started_s {
                    ", the first " (shortest(started_s)) " s of them before the robots start"
                }
                ", " (header.coupling.name()) " coupling, seed " (header.seed) "."
            }
        }
    })
}

pub(super) fn notices(contents: &FinishedRun<'_>) -> Option<Markup> {
    let RunSummary { reason, warnings, .. } = contents.summary;
    let reason = reason.iter().map(|reason| html! { strong { (reason) } });
    let warnings = warnings.iter().map(|warning| with_moments(warning, contents.summary));
    layout::notices(&reason.chain(warnings).collect::<Vec<_>>())
}

pub(super) fn tiles(contents: &FinishedRun<'_>) -> Option<Markup> {
    let measures = contents.measures?;
    let n_agents = contents.header.agent_count;
    let kpis = contents.summary.kpis.as_ref();
    let formation = kpis.and_then(|kpis| kpis.formation.as_ref());
    let delivery = kpis.and_then(|kpis| kpis.delivery.as_ref());
    let latency_s = delivery.and_then(|delivery| delivery.latency_s.as_ref()?.median);
    let expected = kpis.and_then(|kpis| kpis.delivered_of_expected.as_ref());
    let transmissions = kpis.and_then(|kpis| kpis.transmissions.as_ref());
    let exchanges = kpis.and_then(|kpis| kpis.exchanges.as_ref());
    let round_trip_s = exchanges.and_then(|exchanges| exchanges.round_trip_s.as_ref()?.median);
    let downloads = kpis.and_then(|kpis| kpis.downloads.as_ref());
    let shown = kpis.and_then(KpiSummary::energy_shown);
    let radio_on = shown.map(|(_, period)| format!("Radio on, {}", period.words()));
    let lifetime = shown.map(|(_, period)| format!("Network lifetime, {}", period.words()));
    let energy = shown.map(|(energy, _)| energy);
    let lifetime_years = energy.and_then(|energy| energy.network_lifetime_years).map(years);
    let unit = |value: Option<f64>, unit: &str| Some(with_unit(&number(value?), unit));
    let share = |value: Option<f64>| Some(html! { (percent(value?)) });
    let others = format!("of {}", count(u64::from(n_agents.saturating_sub(1))));
    let goal = measures.task.measured_goal();
    let has_way = measures.has_way();
    let flock_speed_mps = measures.flock_speed_mps().filter(|_| goal == Goal::FollowLeader);
    let residual_m2 = measures.at_end().line_residual_m2().filter(|_| goal == Goal::Line);
    let since = kpis.and_then(|kpis| kpis.since_start.delivered_of_expected.as_ref());
    let of_expected = |expected: &DeliveredOfExpected| {
        let share = percent(expected.ratio);
        let joined = expected
            .joined_at_end
            .map(|joined| format!("{} of {} motes joined", joined, expected.alive_at_end));
        joined.map_or_else(|| html! { (share) }, |joined| with_unit(&share, &joined))
    };
    let spread_m = measures.at_end().spread_m().filter(|_| has_way);
    let tiles = [
        ("Delivered of expected packets since the start", since.map(of_expected)),
        (
            "Mean speed of robots",
            unit(measures.mean_speed_mps().filter(|_| goal == Goal::FollowLeader), "m/s"),
        ),
        ("Flock speed (BotNet)", unit(flock_speed_mps, "m/s")),
        ("Residual of the line (BotNet)", unit(residual_m2, "m²")),
        ("Spread at the end", unit(spread_m, "m")),
        ("Task done after", unit(measures.completed_after_s(), "s")),
        ("Neighbours heard", unit(measures.mean_neighbours(), &others)),
        ("Delivery ratio", share(measures.delivery_ratio())),
        ("Mean delay", unit(measures.mean_delay_s().map(|delay_s| 1e3 * delay_s), "ms")),
        ("Network formed after", unit(formation.and_then(|formation| formation.formed_s), "s")),
        ("Packets delivered, of those sent", share(delivery.map(|delivery| delivery.ratio))),
        (
            "Delivered of expected packets, whole run",
            expected.map(|of| html! { (percent(of.ratio)) }),
        ),
        ("Median latency", unit(latency_s, "s")),
        ("Unicast transmissions acknowledged", transmissions.map(acknowledged)),
        ("Exchanges succeeded", exchanges.map(|exchanges| outcome(&exchanges.outcome))),
        ("Median round trip", unit(round_trip_s, "s")),
        ("Downloads complete", downloads.map(|downloads| outcome(&downloads.outcome))),
        ("Mean goodput", unit(downloads.and_then(|of| of.mean_goodput_bytes_s), "B/s")),
        (
            radio_on.as_deref().unwrap_or_default(),
            share(energy.and_then(|energy| energy.duty_cycle.mean)),
        ),
        (
            lifetime.as_deref().unwrap_or_default(),
            lifetime_years.map(|(time, unit)| with_unit(&time, unit)),
        ),
    ];
    let first = headline_tiles(contents.summary);
    let is_first = |name: &str| first.iter().any(|(first, _)| *first == name);
    let others = tiles.into_iter().filter_map(|(name, value)| Some((name, value?)));
    let others: Vec<_> = others.filter(|(name, _)| !is_first(name)).collect();
    let tiles = first.iter().cloned().chain(others);
    Some(layout::tiles(tiles.map(|(name, value)| (name, with_moment(name, value)))))
}

/// The value of a tile that is about moments of the run leads to them.
fn with_moment(name: &str, value: Markup) -> Markup {
    let kind = match name {
        "Collisions between robots" if value.0 != "0" => "collision",
        "Network formed after" => "formed",
        "Task done after" => "task",
        _ => return value,
    };
    moment(kind, &value)
}

/// The figure that the run leads with and those beside it, if they are of the robots' task.
fn headline_tiles(summary: &RunSummary) -> Vec<(&'static str, Markup)> {
    let Some((headline, first, _)) = summary.first_figure() else { return Vec::new() };
    if first.of_task().is_none() {
        return Vec::new();
    }
    let tile = |shown: &'static Shown| {
        let value = summary.number(shown.path)?;
        Some((shown.words, html! { (shown.text(value)) }))
    };
    headline.shown().filter_map(tile).collect()
}

/// How many exchanges or downloads succeeded, of how many.
fn outcome(outcome: &ExchangeOutcome) -> Markup {
    of_all(&count(outcome.succeeded), outcome.started)
}

fn acknowledged(transmissions: &Transmissions) -> Markup {
    of_all(&percent(transmissions.acknowledged_ratio), transmissions.unicast)
}

/// A figure, of how many.
fn of_all(figure: &str, n: u64) -> Markup {
    with_unit(figure, &format!("of {}", count(n)))
}
