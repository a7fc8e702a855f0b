//! `report.html`: a run in pictures and numbers, in one file that opens without a network and needs no script.

mod figures;
pub mod measured;
mod motes;
mod network;
pub mod packets;
pub mod svg;
pub mod text;

use figures::Figure;
use metrics::Measures;
use numbers::format::{count, number, percent, shortest};
use proto::types::Coupling;
use record::run_summary::RunSummary;
use record::{Contents, Status, TRUTH_BASELINE};
use std::fmt::Write as _;
use text::escape;

/// The style sheet of every page.
pub const STYLE: &str = include_str!("style.css");

/// The page.
#[must_use]
pub fn page(contents: &Contents<'_>) -> String {
    let name = escape(&contents.header.name);
    let is_truth = contents.summary.baseline.is_some();
    let suffix = if is_truth { format!(" ({TRUTH_BASELINE})") } else { String::new() };
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{name}{suffix}</title>\n<style>\n{}</style>\n</head>\n<body>\n<main>\n",
        STYLE
    );
    heading(&mut page, contents, is_truth);
    notices(&mut page, contents.summary);
    if let Some(measures) = contents.measures {
        tiles(&mut page, contents, measures);
        page.push_str("<div class=\"figures\">\n");
        for figure in figures::of_run(measures, contents.header.agent_count) {
            show(&mut page, &figure);
        }
        page.push_str("</div>\n");
        motes::section(&mut page, contents.summary.kpis.as_ref(), measures);
    }
    experiment(&mut page, contents);
    if let Some(measures) = contents.measures {
        numbers(&mut page, measures);
    }
    sources(&mut page, contents);
    page.push_str("</main>\n</body>\n</html>\n");
    page
}

fn heading(page: &mut String, contents: &Contents<'_>, is_truth: bool) {
    let Contents { header, summary, .. } = contents;
    let status = summary.status.name();
    let alert = if summary.status == Status::Complete { "" } else { " alert" };
    let mut badges = format!("<span class=\"badge{alert}\">{}</span>", escape(status));
    if is_truth {
        let _ = write!(badges, "<span class=\"badge alert\">{TRUTH_BASELINE}</span>");
    }
    let controller = contents
        .measures
        .and_then(|measures| measures.task.controller.as_deref())
        .map(|controller| format!("{}, ", escape(controller)))
        .unwrap_or_default();
    let formation = match summary.robots_started_s {
        Some(started_s) if 0.0 < started_s => {
            format!(", the first {} of them without the robots", shortest(started_s))
        }
        _ => String::new(),
    };
    let _ = write!(
        page,
        "<header>\n<h1>{}{badges}</h1>\n<p class=\"lead\">{controller}{} agents, {} steps of {}{} s, {} s simulated{formation}, {} coupling, seed {}.</p>\n</header>\n",
        escape(&header.name),
        count(u64::from(header.agent_count)),
        count(summary.steps),
        if header.coupling == Coupling::Event { "at most " } else { "" },
        shortest(header.step_ns as f64 / 1e9),
        shortest(summary.simulated_s),
        coupling(header.coupling),
        header.seed,
    );
}

/// The word for a coupling, as configurations have it.
fn coupling(coupling: Coupling) -> &'static str {
    match coupling {
        Coupling::Sequential => "sequential",
        Coupling::Parallel => "parallel",
        Coupling::Event => "event",
    }
}

/// What must be known before anything else on the page is believed.
fn notices(page: &mut String, summary: &RunSummary) {
    let RunSummary { warnings, reason, .. } = summary;
    if warnings.is_empty() && reason.is_none() {
        return;
    }
    page.push_str("<section class=\"notice\" aria-label=\"Warnings\"><ul>\n");
    if let Some(reason) = reason {
        let _ = writeln!(page, "<li><strong>{}</strong></li>", escape(reason));
    }
    for warning in warnings {
        let _ = writeln!(page, "<li>{}</li>", escape(warning));
    }
    page.push_str("</ul></section>\n");
}

fn tiles(page: &mut String, contents: &Contents<'_>, measures: &Measures) {
    let n_agents = contents.header.agent_count;
    let kpis = contents.summary.kpis.as_ref();
    let formation = kpis.and_then(|kpis| kpis.formation.as_ref());
    let delivery = kpis.and_then(|kpis| kpis.delivery.as_ref());
    let latency_s = delivery.and_then(|delivery| delivery.latency_s.as_ref()?.median);
    // Of the standing network: before, motes scan.
    let energy =
        kpis.and_then(|kpis| kpis.energy_since_formation.as_ref().or(kpis.energy.as_ref()));
    let lifetime_years = energy.and_then(|energy| energy.network_lifetime_years);
    let unit = |value: Option<f64>, unit: &str| {
        value.map(|value| format!("{} <small>{unit}</small>", number(value)))
    };
    let others = format!("of {}", count(u64::from(n_agents.saturating_sub(1))));
    let is_line = measures.task.controller.as_deref() == Some("line-formation");
    let has_way = measures.has_way();
    let is_flock = !is_line && measures.anybody_moved();
    let residual_m2 = measures.line_residual_m2().filter(|_| is_line);
    let tiles = [
        ("Flock speed", unit(measures.flock_speed_mps().filter(|_| is_flock), "m/s")),
        ("Residual of the line", unit(residual_m2, "m²")),
        ("Spread at the end", unit(measures.final_spread_m().filter(|_| has_way), "m")),
        ("Task done after", unit(measures.completed_after_s(), "s")),
        ("Neighbours heard", unit(measures.mean_neighbours(), &others)),
        ("Delivery ratio", measures.delivery_ratio().map(percent)),
        ("Mean delay", unit(measures.mean_delay_s().map(|delay_s| 1e3 * delay_s), "ms")),
        ("Network formed after", unit(formation.and_then(|formation| formation.formed_s), "s")),
        ("Packets delivered", delivery.map(|delivery| percent(delivery.ratio))),
        ("Median latency", unit(latency_s, "s")),
        ("Radio on", energy.and_then(|energy| energy.duty_cycle.mean).map(percent)),
        ("Network lifetime", unit(lifetime_years, "years")),
    ];
    page.push_str("<dl class=\"tiles\">\n");
    for (name, value) in tiles {
        if let Some(value) = value {
            let _ = writeln!(page, "<div class=\"tile\"><dt>{name}</dt><dd>{value}</dd></div>");
        }
    }
    page.push_str("</dl>\n");
}

fn show(page: &mut String, figure: &Figure) {
    let class = if figure.is_wide { " class=\"wide\"" } else { "" };
    let _ = write!(
        page,
        "<figure{class}>\n<figcaption><h3>{}</h3>\n<p>{}</p></figcaption>\n<ul class=\"key\">",
        figure.title,
        escape(&figure.sentence)
    );
    for (mark, words) in &figure.key {
        let shape = self::mark(mark);
        let _ = write!(
            page,
            "<li><svg viewBox=\"0 0 26 12\" aria-hidden=\"true\">{shape}</svg>{words}</li>"
        );
    }
    let _ = write!(page, "</ul>\n<div class=\"plot\">{}</div>\n</figure>\n", figure.svg);
}

/// How a mark looks in a key.
fn mark(class: &str) -> String {
    match class {
        "band" => "<path class=\"band\" d=\"M0,1H26V11H0Z\"/>".to_owned(),
        "start" | "end" | "mote" => format!("<path class=\"{class}\" d=\"M13,6h0\"/>"),
        "dot" | "dot after" => {
            format!("<path class=\"{class}\" d=\"M5,8h0M10,4h0M15,7h0M20,5h0\"/>")
        }
        "interval" => {
            "<g class=\"interval\"><path d=\"M13,1V11M10,1h6M10,11h6\"/><circle cx=\"13\" cy=\"6\" r=\"3\"/></g>"
                .to_owned()
        }
        filled if filled.starts_with("cell") || filled.starts_with("b") && filled != "before" => {
            format!("<path class=\"{class}\" d=\"M8,1H18V11H8Z\"/>")
        }
        line => format!("<path class=\"{line}\" d=\"M0,6H26\"/>"),
    }
}

fn experiment(page: &mut String, contents: &Contents<'_>) {
    let Contents { header, summary, .. } = contents;
    page.push_str("<h2>Experiment</h2>\n<table class=\"facts\">\n");
    let mut fact = |name: &str, value: &str| {
        let _ = writeln!(
            page,
            "<tr><th scope=\"row\">{}</th><td>{}</td></tr>",
            escape(name),
            escape(value)
        );
    };
    fact("name", &header.name);
    fact("seed", &header.seed.to_string());
    fact("agents", &header.agent_count.to_string());
    fact("control period", &format!("{} s", shortest(header.step_ns as f64 / 1e9)));
    fact("coupling", coupling(header.coupling));
    for (label, value) in &header.labels {
        if label == "knowledge" && value == "truth" {
            fact(label, &format!("{value}: {TRUTH_BASELINE}"));
        } else {
            fact(label, value);
        }
    }
    if let Some(digest) = &summary.final_digest {
        fact("digest of the last step", digest);
    }
    page.push_str("</table>\n<h2>To do it again</h2>\n");
    page.push_str(
        "<p>Beside this page, <code>config.toml</code> holds the whole configuration, the seed included. The same configuration and seed give the same messages, tables and summary, byte for byte. In this directory:</p>\n<pre>orchestrator run config.toml --out again\norchestrator verify .</pre>\n",
    );
    let _ = write!(
        page,
        "<details><summary>The configuration</summary>\n<pre>{}</pre></details>\n",
        escape(header.config_toml.trim_end())
    );
}

/// Delivery against distance as a table: the picture for those who need the numbers.
fn numbers(page: &mut String, measures: &Measures) {
    let bins = measures.by_distance();
    if bins.is_empty() {
        return;
    }
    page.push_str(
        "<details><summary>Delivery against distance in numbers</summary>\n<table>\n<tr><th class=\"n\">from (m)</th><th class=\"n\">to (m)</th><th class=\"n\">attempts</th><th class=\"n\">deliveries</th><th class=\"n\">share</th><th class=\"n\">95 % interval</th></tr>\n",
    );
    for bin in bins {
        let [low, high] = bin.interval();
        let _ = writeln!(
            page,
            "<tr><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{} to {}</td></tr>",
            shortest(bin.from_m),
            shortest(bin.to_m),
            count(bin.attempts),
            count(bin.deliveries),
            percent(bin.ratio()),
            percent(low),
            percent(high)
        );
    }
    page.push_str("</table></details>\n");
}

fn sources(page: &mut String, contents: &Contents<'_>) {
    if contents.provenance.as_object().is_some_and(|provenance| !provenance.is_empty()) {
        let _ = write!(
            page,
            "<details><summary>When, where and how it was run</summary>\n<pre>{}</pre></details>\n",
            escape(&format!("{:#}", contents.provenance))
        );
    }
}

#[cfg(test)]
mod tests;
