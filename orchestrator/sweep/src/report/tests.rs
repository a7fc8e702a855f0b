//! The page of a sweep: its question, its answer and its axes, of made-up figures.

use super::*;
use crate::plan::{Machines, load};
use crate::sweep_summary::SettingSummary;
use crate::table::{TableColumn, TableEntry};
use experiment::Overrides;

/// A sweep of two scheduling functions, under so many seeds.
fn plan(n_seeds: usize, metric: &str) -> SweepPlan {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sweep.toml");
    let text = format!(
        "[experiment]\nname = \"sf\"\nseed = 1\nduration_s = 10.0\nagents = 4\n[robotsim.scenario]\nkind = \"grid\"\nspacing_m = 10.0\n\
         [robotsim.controller]\nkind = \"hold\"\n[netsim]\nmode = \"6tisch\"\n[sweep]\nseeds = {n_seeds}\nmetrics = [\"{metric}\"]\n\
         [sweep.vary]\nnetsim.sf.kind = [\"msf\", \"orchestra\"]\n"
    );
    std::fs::write(&path, text).unwrap();
    load(&path, &Overrides::default(), Machines::This).unwrap()
}

/// The page of a metric that has these values, setting after setting.
fn page_of(metric: &str, values: &[f64]) -> String {
    let plan = plan(values.len() / 2, metric);
    let entries = values.iter().map(|&value| TableEntry::Number(value)).collect();
    let column = TableColumn { name: metric.to_owned(), kind: ColumnKind::F64, entries };
    let figures = [SettingFigures::from_trials(&plan, &column, &vec![true; values.len()])];
    let summary = SweepSummary {
        schema: String::new(),
        name: "sf".to_owned(),
        trials: values.len(),
        seeds: plan.seeds.clone(),
        settings: Vec::<SettingSummary>::new(),
        warnings: Vec::new(),
    };
    page(&plan, &figures, &summary).replace('\u{a0}', " ")
}

/// Labels of the ticks along the axis of the figure.
fn labels(page: &str) -> Vec<&str> {
    let ticks = page.split("<text class=\"tick\"").skip(1);
    let ticks = ticks.filter(|tick| tick.contains("text-anchor=\"end\""));
    ticks.filter_map(|tick| tick.split('>').nth(1)?.split('<').next()).collect()
}

#[test]
fn a_page_begins_with_the_question_and_answers_it_in_a_sentence() {
    let page = page_of("pdr", &[0.97, 0.98, 0.99, 0.90, 0.91, 0.92]);
    let place = |text: &str| page.find(text).unwrap_or_else(|| panic!("{text}: {page}"));
    let question = place("How does the scheduling function change packet delivery ratio?</h2>");
    let answer = place(
        "Packet delivery ratio is best with scheduling function msf, 98.0 % [97.0 %, 99.0 %] (range of 3), and worst with \
         scheduling function orchestra, 91.0 % [90.0 %, 92.0 %] (range of 3). The two intervals do not overlap.",
    );
    assert!(
        question < answer && answer < place("<figure") && place("</figure>") < place("<details")
    );
    assert!(page.contains("(n = 3). Bars: range of the trials, least to greatest."));
    assert_eq!(labels(&page), ["90 %", "95 %"]);
}

#[test]
fn an_answer_claims_no_more_than_the_trials_show() {
    let overlapping = page_of("pdr", &[0.97, 0.98, 0.99, 0.90, 0.97, 0.985]);
    assert!(overlapping.contains("The two intervals overlap."));
    let single = page_of("pdr", &[0.97, 0.90]);
    assert!(
        single.contains("97.0 % (n = 1)") && single.contains("One trial has no interval"),
        "{single}"
    );
    let five = [0.97, 0.975, 0.98, 0.985, 0.99, 0.90, 0.905, 0.91, 0.915, 0.92];
    assert!(page_of("pdr", &five).contains("(95 % interval, n = 5)"));
    let same = page_of("pdr", &[0.9, 0.95, 1.0, 0.9, 0.95, 1.0]);
    assert!(same.contains("has the same median in both settings"), "{same}");
}

#[test]
fn an_axis_of_shares_that_are_all_whole_or_nearly_never_repeats_a_label() {
    let same = page_of("pdr", &[1.0; 6]);
    assert!(same.contains("Packet delivery ratio is 100 % in all 6 trials."), "{same}");
    assert!(same.contains("<figure"));
    let nearly = page_of("pdr", &[1.0, 0.999_96, 1.0, 0.999_98, 0.999_97, 1.0]);
    for page in [&same, &nearly] {
        let labels = labels(page);
        assert!(
            2 <= labels.len() && labels.windows(2).all(|pair| pair[0] != pair[1]),
            "{labels:?}"
        );
    }
    assert!(nearly.contains("[99.9960 %, 100.0000 %]"), "{nearly}");
}
