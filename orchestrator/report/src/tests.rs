//! Pages of made-up runs.

#[path = "../../record/src/tests/made_up.rs"]
mod made_up;

use super::*;
use experiment::{OutputConfig, Start};
use indexmap::IndexMap;
use metrics::figures::FigureValue;
use proto::types::Coupling;
use record::run_summary::{RunSummary, TaskSummary};
use record::{Ending, Finished, Recorder, RunHeader, Status, StepRecord};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

fn header(name: &str) -> RunHeader {
    RunHeader {
        name: name.to_owned(),
        seed: 7,
        agent_count: 3,
        step_ns: 100_000_000,
        coupling: Coupling::Sequential,
        config_toml: "note = \"<script>\"".to_owned(),
        labels: BTreeMap::new(),
        output: OutputConfig::default(),
        start: Start::AtOnce,
        records: Vec::new(),
        statistics: Vec::new(),
        warnings: Vec::new(),
        keeps_checkpoints: false,
    }
}

fn summary(status: Status) -> RunSummary {
    RunSummary {
        schema: "murmuration/summary/1".to_owned(),
        name: "a<b".to_owned(),
        seed: 7,
        agent_count: 3,
        step_ns: 100_000_000,
        coupling: Coupling::Sequential,
        labels: BTreeMap::new(),
        baseline: None,
        status,
        reason: None,
        steps: 0,
        start: Start::AtOnce,
        robots_started_s: None,
        simulated_s: 0.0,
        final_digest: None,
        task: None,
        orders_from_outside: None,
        network: None,
        kpis: None,
        files: IndexMap::new(),
        warnings: Vec::new(),
    }
}

fn page_of(summary: &RunSummary) -> String {
    page_in(Path::new(""), summary)
}

fn page_in(dir: &Path, summary: &RunSummary) -> String {
    let header = header("a<b");
    page(&FinishedRun { header: &header, summary, measures: None, provenance: &Value::Null, dir })
}

#[test]
fn a_page_needs_nothing_from_elsewhere() {
    let page = page_of(&summary(Status::Complete));
    for reference in ["http:", "https:", "<script", "<link", "<img", "url(h", "@import"] {
        assert!(!page.contains(reference), "{reference}");
    }
}

#[test]
fn a_page_runs_and_loads_nothing_but_its_own_parts() {
    let policy =
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src";
    let own = format!("{policy} 'sha256-");
    assert!(page_of(&summary(Status::Complete)).contains(&own));
    let other = crate::layout::page("compare", "", &maud::html! { p { "x" } });
    assert!(other.contains(&format!("{policy} 'none'; ")), "{other}");
}

#[test]
fn the_script_of_figures_runs_by_its_hash_and_only_on_pages_with_figures() {
    use crate::svg::{Axis, Chart};
    let mut chart = Chart::new(Axis::new("", 0.0, 1.0), Axis::new("", 0.0, 1.0), 540.0, 312.0);
    chart.dots("dot", [[0.5, 0.5]]);
    let page = crate::layout::page("compare", "", &chart.finish("a", "", ""));
    let script = page.rsplit("<script>").next().unwrap().split("</script>").next().unwrap();
    assert!(script.starts_with("(() => {"), "{script}");
    let policy = format!("script-src '{}'; ", view::page::source_hash(script));
    assert!(page.contains(&policy), "{page}");
    for request in ["fetch(", "XMLHttpRequest", "import(", "eval(", "http:"] {
        assert!(!script.replace("http://www.w3.org", "").contains(request), "{request}");
    }
    assert!(script.len() < 25_000, "{}", script.len());
}

#[test]
fn names_and_configurations_are_text_not_markup() {
    let page = page_of(&summary(Status::Complete));
    assert!(page.contains("<h1>a&lt;b<"));
    assert!(page.contains("note = &quot;&lt;script&gt;&quot;"));
}

#[test]
fn warnings_and_the_reason_of_a_failure_stand_at_the_top() {
    let page = page_of(&RunSummary {
        reason: Some("netsim hangs".to_owned()),
        warnings: vec!["check the walls".to_owned()],
        ..summary(Status::Failed)
    });
    let place = |text: &str| page.find(text).unwrap();
    assert!(place("netsim hangs") < place("<h2>"));
    assert!(place("check the walls") < place("<h2>"));
    assert!(page.contains("badge alert\">failed"));
}

#[test]
fn counts_of_a_report_lead_to_their_moments() {
    let task = TaskSummary {
        controller: None,
        first_figure: None,
        complete: false,
        completed_at_step: None,
        completed_after_s: None,
        figures: [("collisions".to_owned(), Some(FigureValue::Count(1_234)))].into_iter().collect(),
    };
    let page = page_of(&RunSummary {
        task: Some(task),
        warnings: vec![
            "1,234 collisions between robots: they came closer".to_owned(),
            "robots went into or through walls and obstacles of [site] 3 times".to_owned(),
            "check <the> walls".to_owned(),
        ],
        ..summary(Status::Complete)
    });
    let of_robots = "<span data-moment=\"collision\">1,234 collisions</span> between robots";
    // In the verdict and in the warning.
    assert_eq!(page.matches(of_robots).count(), 2);
    assert!(page.contains(
        "robots <span data-moment=\"site_collision\">went into or through walls and obstacles</span> of [site] 3 times"
    ));
    assert!(page.contains("check &lt;the&gt; walls"));
}

#[test]
fn a_run_that_is_too_long_for_the_page_comes_with_the_command_that_plays_it() {
    let dir = tempfile::tempdir().unwrap();
    let complete = summary(Status::Complete);
    assert!(!page_in(dir.path(), &complete).contains("murmuration replay ."));
    let recording = std::fs::File::create(dir.path().join("run.mcap")).unwrap();
    recording.set_len(20_000_001).unwrap();
    assert!(page_in(dir.path(), &complete).contains("murmuration replay ."));
}

fn recorded(out: &Path, header: RunHeader) -> Finished {
    let recorder = made_up::record(out, header, made_up::STEPS);
    recorder.finish(&Ending::complete(), Value::Null, page).unwrap()
}

#[test]
fn the_truth_baseline_is_called_so_in_summary_and_report() {
    let out = tempfile::tempdir().unwrap();
    let mut header = made_up::header("run");
    header.labels.insert("knowledge".to_owned(), "truth".to_owned());
    let run = recorded(out.path(), header);
    assert_eq!(run.summary.baseline.as_deref(), Some("truth baseline"));
    let page = std::fs::read_to_string(run.report.unwrap()).unwrap();
    assert!(page.matches("truth baseline").count() >= 2);
}

#[test]
fn the_report_shows_four_pictures_each_with_words_and_the_walls() {
    let out = tempfile::tempdir().unwrap();
    let run = recorded(out.path(), made_up::header("run"));
    let page = std::fs::read_to_string(run.report.unwrap()).unwrap();
    assert_eq!(page.matches("<figure").count(), 4);
    assert_eq!(page.matches("role=\"img\"").count(), 4);
    for words in
        ["<desc id=\"trajectories-text\">Where the 7 agents went", "2.00 m/s on average", "60 %"]
    {
        assert!(page.contains(words), "{words}");
    }
    assert!(page.contains("<path class=\"wall\" d=\"M"));
    // Packed data are text by chance.
    let words: String = page
        .split("<script")
        .enumerate()
        .filter_map(|(n, part)| {
            if n == 0 { Some(part) } else { part.split_once("</script>").map(|(_, after)| after) }
        })
        .collect();
    assert!(words.len() < page.len());
    assert!(!words.contains("NaN") && !words.contains("inf"));
}
