//! `summary.json`: what came of a run, in numbers.

use super::directory::SCHEMA_PREFIX;
use super::run_summary::{DeliveryByDistance, FileCount, NetworkSummary, RunSummary, TaskSummary};
use super::writer::Written;
use super::{Ending, RunHeader, Status, task_warnings};
use experiment::output::Links;
use metrics::arrangement::Arrangement;
use metrics::figures::{FigureValue, FiguresByName};
use metrics::headline::{Headline, Shown};
use metrics::measures::Measures;
use metrics::task::Goal;
use numbers::statistics::ratio;
use proto::digest::hex;
use proto::types::seconds;

/// The summary of a run.
pub(crate) fn of_run(header: &RunHeader, ending: &Ending, written: &Written) -> RunSummary {
    let measures = written.measures.as_ref();
    let files = written.files.iter().map(|(file, n, _)| {
        let count = match file.rsplit('.').next() {
            Some("mcap") => FileCount::Messages(*n),
            Some("pcap") => FileCount::Frames(*n),
            _ => FileCount::Rows(*n),
        };
        ((*file).to_owned(), count)
    });
    let task = measures.map(|measures| task(measures, ending));
    let warnings = warnings(header, ending, written, task.as_ref());
    let mut summary = RunSummary {
        schema: format!("{SCHEMA_PREFIX}1"),
        name: header.name.clone(),
        seed: header.seed,
        agent_count: header.agent_count,
        step_ns: header.step_ns,
        coupling: header.coupling,
        labels: header.labels.clone(),
        baseline: is_truth(header, measures).then(|| TRUTH_BASELINE.to_owned()),
        status: ending.status,
        reason: ending.reason.clone(),
        steps: measures.map_or(0, |measures| measures.n_steps),
        start: header.start,
        robots_started_s: measures.map(|measures| seconds(measures.start_ns)),
        simulated_s: measures.map_or(0.0, |measures| seconds(measures.time_ns)),
        final_digest: written.digest.map(|digest| hex(&digest)),
        task,
        network: measures.map(network),
        kpis: measures.and_then(|measures| measures.kpis.summary()),
        orders_from_outside: Some(&written.orders).filter(|orders| !orders.is_empty()).cloned(),
        files: files.collect(),
        warnings,
    };
    let headline = measures.and_then(|measures| measures.task.headline());
    let first = headline.and_then(|headline| headline.first_of(|path| summary.number(path)));
    if let (Some(task), Some(first)) = (&mut summary.task, first) {
        task.first_figure = Some(first.path.to_owned());
    }
    summary
}

/// Whether the robots knew the truth instead of what was delivered to them.
pub(crate) fn is_truth(header: &RunHeader, measures: Option<&Measures>) -> bool {
    header.labels.get("knowledge").is_some_and(|knowledge| knowledge == "truth")
        || measures.is_some_and(|measures| measures.task.is_truth_baseline)
}

/// What such a run is called wherever it is shown.
pub const TRUTH_BASELINE: &str = "truth baseline";

fn task(measures: &Measures, ending: &Ending) -> TaskSummary {
    let n = measures.n_alive_at_end() as f64;
    let mut figures = FiguresByName::new();
    let mut add = |name: &str, value: Option<f64>| {
        figures.insert(name.to_owned(), value.map(FigureValue::Number));
    };
    // As the BotNet paper counts robots that wait for a network that does not form.
    let flock_speed_mps = if ending.never_formed { Some(0.0) } else { measures.flock_speed_mps() };
    add("flock_speed_mps", flock_speed_mps);
    add("mean_speed_mps", measures.mean_speed_mps());
    add("final_spread_m", measures.at_end().spread_m());
    if let Some(leader_speed_mps) = measures.task.leader_speed_mps {
        add("leader_speed_mps", Some(leader_speed_mps));
        add("flock_speed_floor_mps", (0.0 < n).then(|| leader_speed_mps / n));
        add("leader_speed_floor_ratio", ratio(1.0, n));
    }
    figures.extend(measures.swarm_figures());
    figures.extend(of_goal(measures));
    for reported in &measures.task_figures {
        let is_field = FIELDS.contains(&reported.name.as_str());
        // What is measured here is not for the robots to say.
        if !is_field && figures.get(&reported.name).copied().flatten().is_none() {
            figures.insert(reported.name.clone(), Some(FigureValue::Number(reported.value)));
        }
    }
    lead(measures, &mut figures);
    TaskSummary {
        controller: measures.task.controller.clone(),
        first_figure: None,
        complete: measures.completed_at_step.is_some(),
        completed_at_step: measures.completed_at_step,
        completed_after_s: measures.completed_after_s(),
        figures,
    }
}

/// What every task has besides figures.
const FIELDS: [&str; 5] =
    ["controller", "first_figure", "complete", "completed_at_step", "completed_after_s"];

/// Brings the figures that a run leads with to the front.
fn lead(measures: &Measures, figures: &mut FiguresByName) {
    let headline = measures.task.headline();
    let leading = headline.into_iter().flat_map(Headline::shown).filter_map(Shown::of_task);
    let mut place = 0;
    for name in leading {
        if let Some(from) = figures.get_index_of(name) {
            figures.move_index(from, place);
            place += 1;
        }
    }
}

/// The figures of a goal.
fn of_goal(measures: &Measures) -> FiguresByName {
    let log10 = |value: Option<f64>| value.filter(|&value| 0.0 < value).map(libm::log10);
    let number = |value: Option<f64>| value.map(FigureValue::Number);
    let (start, end) = (measures.at_start(), measures.at_end());
    let figures = match measures.task.measured_goal() {
        Goal::Line => {
            let residual_m2 = end.line_residual_m2();
            let across_m2 = end.across_line_m2();
            let rms_m = end.line_rms_m();
            let lines = end.n_lines(FORMED_WITHIN_M);
            vec![
                ("line_residual_m2", number(residual_m2)),
                ("line_residual_log10", number(log10(residual_m2))),
                ("line_residual_across_m2", number(across_m2)),
                ("line_residual_across_log10", number(log10(across_m2))),
                ("line_rms_m", number(rms_m)),
                ("initial_line_rms_m", number(start.line_rms_m())),
                ("lines", Some(FigureValue::Count(lines as u64))),
                ("false_completion", false_completion(measures, rms_m).map(FigureValue::Flag)),
            ]
        }
        Goal::Circle => {
            let circle = end.circle();
            let rms_m = circle.map(|circle| circle.rms_m);
            vec![
                ("circle_rms_m", number(rms_m)),
                ("circle_radius_m", number(circle.map(|circle| circle.radius_m))),
                ("circle_gap_rad", number(circle.map(|circle| circle.gap_rad))),
                ("initial_circle_rms_m", number(start.circle().map(|circle| circle.rms_m))),
                ("false_completion", false_completion(measures, rms_m).map(FigureValue::Flag)),
            ]
        }
        Goal::Lattice => {
            let error_m = measures.task.lattice_m.and_then(|spacing| end.lattice_error_m(spacing));
            vec![("lattice_error_m", number(error_m))]
        }
        Goal::Meet => vec![("initial_spread_m", number(start.spread_m()))],
        Goal::Cover => {
            let area_m = measures.task.area_m;
            let rms_m =
                |at: Arrangement<'_>| number(area_m.and_then(|area| at.coverage_rms_m(area)));
            vec![("coverage_rms_m", rms_m(end)), ("initial_coverage_rms_m", rms_m(start))]
        }
        Goal::Disperse => vec![
            ("connected_spread_m", number(measures.connected_spread_m())),
            ("initial_spread_m", number(start.spread_m())),
        ],
        Goal::Explore => EXPLORATION.map(|name| (name, None)).to_vec(),
        Goal::Align => {
            // The mean of random headings: the mean length of a sum of n independent unit vectors is √(π n)/2 for many.
            let n = measures.n_alive_at_end() as f64;
            let floor = ratio(std::f64::consts::PI, 4.0 * n).map(libm::sqrt);
            vec![("polarisation_floor", number(floor))]
        }
        Goal::FollowLeader | Goal::Carry | Goal::Other => Vec::new(),
    };
    figures.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

/// Figures of robots that explore, by name. They know them themselves; one that is not known yet is null.
const EXPLORATION: [&str; 8] = [
    "mapped_ratio",
    "seen_ratio",
    "mapped_90_s",
    "map_delay_s",
    "map_age_s",
    "map_reports",
    "map_reports_repeated",
    "waypoint_orders",
];

/// Done by the robots' own account, and not in truth: they are far from the shape, or so arranged that none fits.
fn false_completion(measures: &Measures, rms_m: Option<f64>) -> Option<bool> {
    measures.completed_at_step?;
    Some(rms_m.is_none_or(|rms_m| FORMED_WITHIN_M < rms_m))
}

/// A shape whose robots are farther from it than this, r.m.s. (m), is not formed, and a robot farther from a line is not in it:
/// BotNet's step.
const FORMED_WITHIN_M: f64 = 0.1;

fn network(measures: &Measures) -> NetworkSummary {
    let known = |value: f64| Some(value).filter(|value| value.is_finite());
    let by_distance = measures.by_distance();
    let by_distance = by_distance.iter().map(|bin| DeliveryByDistance {
        from_m: bin.from_m,
        to_m: bin.to_m,
        attempts: bin.attempts,
        deliveries: bin.deliveries,
        ratio: known(bin.ratio()),
        ratio_interval_95: bin.interval().map(known),
    });
    NetworkSummary {
        transmissions: measures.transmissions,
        sent_bytes: measures.sent_bytes,
        attempts: measures.attempts,
        deliveries: measures.deliveries,
        delivery_ratio: measures.delivery_ratio(),
        unicast_deliveries: measures.unicast_deliveries,
        second_medium_deliveries: measures.second_medium_deliveries,
        mean_delay_s: measures.mean_delay_s(),
        mean_age_s: measures.mean_age_s(),
        mean_neighbours_heard: measures.mean_neighbours(),
        isolated_ratio: measures.isolated_ratio(),
        by_distance_is_sampled: measures.is_distance_sampled,
        by_distance: by_distance.collect(),
    }
}

fn warnings(
    header: &RunHeader,
    ending: &Ending,
    written: &Written,
    task: Option<&TaskSummary>,
) -> Vec<String> {
    let mut warnings = header.warnings.clone();
    warnings.extend(written.net_warnings.iter().map(|warning| format!("network: {warning}")));
    let measures = written.measures.as_ref();
    if is_truth(header, measures) {
        warnings.push(format!(
            "{TRUTH_BASELINE}: the robots knew the true state of all others, whatever the network delivered"
        ));
    }
    if !written.orders.is_empty() {
        warnings.push(format!("other programs gave {} during the run", written.orders));
    }
    let n_steps = measures.map_or(0, |measures| measures.n_steps);
    match ending.status {
        Status::Complete => {}
        Status::Interrupted => {
            warnings.push(format!("the run was interrupted after {n_steps} steps"));
        }
        Status::Failed => warnings.push(format!("the run failed after {n_steps} steps")),
    }
    if let Some(measures) = measures {
        warnings.extend(task.iter().flat_map(|task| task_warnings::of(&measures.task, task)));
        let n_passed = measures.n_passed_walls();
        if n_passed != 0 {
            let times = if n_passed == 1 { "once".to_owned() } else { format!("{n_passed} times") };
            warnings.push(format!(
                "robots went into or through walls and obstacles of [site] {times}, since contacts are not resolved: robotsim.contacts.kind = \"resolve\" makes walls and obstacles solid"
            ));
        }
        warnings.extend(measures.kpis.warnings());
        // A network that carries packets of its own may have been asked for nothing else.
        let carries_packets = measures.kpis.account.has_applications();
        if 0 < measures.n_steps && measures.transmissions == 0 && !carries_packets {
            warnings.push("nothing that robots sent was transmitted".to_owned());
        } else if measures.transmissions != 0
            && measures.deliveries + measures.unicast_deliveries == 0
        {
            warnings.push("nothing that robots sent was delivered".to_owned());
        }
    }
    if let Links::Sample { fraction } = header.output.links {
        warnings.push(format!(
            "links.parquet holds a sample of all links, each with chance {fraction}"
        ));
    }
    if !header.output.mcap {
        warnings
            .push("there is no run.mcap: the run can be neither replayed nor verified".to_owned());
    }
    warnings
}
