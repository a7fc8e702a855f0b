use super::*;
use diagnose::diagnosis::{
    Affects, NearestEffect, NextMeasurement, Parameter, Rival, Rung, Structure, Tested, Verdict,
};
use diagnose::identifiability::{EffectSize, Identifiability, WithoutSize};
use diagnose::rows::{LinkEnd, LinkRows};
use indexmap::IndexMap;
use measure::Rejected;
use measure::account::DataFile;
use study::open::Subject;

/// Forty rows of links, half of them lost where it is weak; `shift_db` is the model's error.
fn view(shift_db: f64) -> RowPredictions {
    let level: Vec<f64> = (0..40).map(|row| -95.0 + f64::from(row)).collect();
    RowPredictions {
        predicted: level.clone(),
        measured: (0..40)
            .map(
                |row| {
                    if row < 10 { f64::NAN } else { level[row] + shift_db + (row % 3) as f64 - 1.0 }
                },
            )
            .collect(),
        sd: vec![1.0; 40],
        across: Vec::new(),
        heading_rad: Vec::new(),
        passes: (0..40).map(|row| if row < 10 { 0.1 } else { 0.95 }).collect(),
        level,
    }
}

fn contents(answer: MeasuredAnswer<'_>, site: &Site, after: Option<RowPredictions>) -> String {
    let end = |(row, is_moving): (usize, bool)| {
        let place_m = [row as f64, (row % 7) as f64];
        LinkEnd { place_m, is_moving }
    };
    let rows = LinkRows {
        ends: (0..40)
            .map(|row| [(row as usize % 4, false), (row as usize, true)].map(end))
            .collect(),
        motes: (0..40).map(|row| [row % 4, 9]).collect(),
        frames: (0..40).map(|row| [1.0, f64::from(u8::from(10 <= row))]).collect(),
        quantum_db: 1.0,
    };
    page(&MeasuredPage {
        config: "<model>.toml".to_owned(),
        command: "murmuration compare <model>.toml".to_owned(),
        answer,
        site,
        rows: PredictedRows {
            rows: MeasuredRows::Links(rows),
            before: view(4.0),
            after,
            covariates: vec![("height".to_owned(), (0..40).map(f64::from).collect())],
        },
    })
}

fn site() -> Site {
    Site::default()
}

fn account() -> DataAccount {
    DataAccount {
        data: DataFile { file: "links.csv".to_owned(), sha256: "ab".to_owned() },
        rows: 41,
        used: 40,
        rejected: vec![Rejected { reason: "tx is missing".to_owned(), rows: 1, first_line: 3 }],
        warnings: vec!["a <b>".to_owned()],
        predicted_by: None,
    }
}

fn rung(model: &str, rmse: f64, log_score: f64, reception_log_loss: f64) -> Rung {
    Rung {
        model: model.to_owned(),
        log_score,
        rmse,
        rmse_received_db: None,
        rmse_heading_rad: None,
        crps: f64::NAN,
        reception_log_loss,
    }
}

fn candidate(effect: &str, gain: f64) -> Tested {
    Tested {
        effect: effect.to_owned(),
        gain,
        held_out: "blocks of time",
        standard_error: 0.1 * gain,
        p_value: 0.0,
        accepted: 0.0 < gain,
        doubt: None,
        directions: None,
        upper: None,
        detectable: None,
        only: None,
        indistinguishable_from: Vec::new(),
        warning: None,
        parameters: IndexMap::new(),
        not_identifiable: Vec::new(),
        settings: None,
        untestable: None,
    }
}

fn structure(covariate: &str, explained: f64, formula: &str, target: &str) -> Structure {
    Structure {
        covariate: covariate.to_owned(),
        affects: None,
        explained,
        p_value: 0.0,
        formula: Some(formula.to_owned()),
        target: Some(target.to_owned()),
        also: None,
        rmse_after: None,
        indistinguishable_from: Vec::new(),
        nearest_effect: None,
        warning: None,
    }
}

fn diagnosis(verdict: Verdict, sentence: &str) -> Diagnosis {
    Diagnosis {
        schema: "diagnose/2",
        kind: Subject::Links,
        verdict,
        sentence: sentence.to_owned(),
        missing: Vec::new(),
        missing_one_of: Vec::new(),
        possible: Vec::new(),
        possible_because: Vec::new(),
        identifiability: None,
        split: "blocks of time",
        measurement_defects: Vec::new(),
        ladder: Vec::new(),
        candidates: Vec::new(),
        rivals: Vec::new(),
        unexplained: Vec::new(),
        residuals_searched: true,
        misfits: Vec::new(),
        could_hide: f64::NAN,
        next_measurement: Vec::new(),
        complete: true,
        too_little: None,
        stopped_in_round: None,
        searched: None,
        account: account(),
        error_unit: "dB",
    }
}

#[test]
fn a_comparison_shows_errors_reception_and_scores() {
    let comparison = Comparison {
        schema: "compare/1",
        kind: Subject::Links,
        unit: "blocks".to_owned(),
        scores: IndexMap::from([("rmse_db".to_owned(), 4.1)]),
        intervals: IndexMap::from([("rmse_db".to_owned(), [4.0, 4.2])]),
        offset_db: None,
        places: Vec::new(),
        account: account(),
    };
    let page = contents(MeasuredAnswer::Comparison(&comparison), &site(), None);
    for part in [
        "&lt;model&gt;.toml against links.csv",
        "1 rows not used: tx is missing (first on line 3)",
        "a &lt;b&gt;",
        "Predicted against measured",
        "Reception, as configured",
        "Probability integral transform",
        "Errors on the map",
        "4.00 to 4.20",
    ] {
        assert!(page.contains(part), "{part} is not in the page");
    }
    let words = without_scripts(&page);
    let links = words.replace("http-equiv", "");
    assert!(!words.contains("NaN") && !links.contains("http"), "it stands alone");
    assert!(
        !page.replace("http://www.w3.org/2000/svg", "").contains("http:"),
        "nor does its script ask for anything"
    );
}

#[test]
fn a_diagnosis_shows_the_ladder_what_was_found_and_what_is_left() {
    let sd_db = Parameter { value: 7.0, unit: "dB".to_owned(), low: 6.5, high: 7.5 };
    let loss_db = Parameter { value: 4.0, unit: "dB".to_owned(), low: 3.5, high: 4.5 };
    let obstacle = "kind = \"hidden-obstacle\"\nfrom_m = [1.0, 1.0]\nto_m = [3.0, 4.0]";
    let diagnosis = Diagnosis {
        ladder: vec![
            rung("as configured", 4.1, -3.0, 0.3),
            rung("+ hidden-obstacle", 1.0, -2.0, 0.2),
        ],
        candidates: vec![
            Tested {
                indistinguishable_from: vec!["shadowing".to_owned()],
                parameters: IndexMap::from([("loss_db".to_owned(), loss_db)]),
                settings: Some(obstacle.parse().unwrap()),
                ..candidate("hidden-obstacle", 1.0)
            },
            Tested {
                untestable: Some("needs heights".to_owned()),
                ..candidate("two-ray-ground", 0.0)
            },
        ],
        rivals: vec![Rival {
            in_place_of: "hidden-obstacle".to_owned(),
            effect: "shadowing".to_owned(),
            parameters: IndexMap::from([("sd_db".to_owned(), sd_db)]),
            not_identifiable: Vec::new(),
        }],
        unexplained: vec![structure("height", 0.1, "1 + height", "mean")],
        next_measurement: vec![NextMeasurement {
            between: ["hidden-obstacle".to_owned(), "shadowing".to_owned()],
            covariate: "channel".to_owned(),
            from: 11.0,
            to: 11.0,
            difference: 1.0,
            elsewhere: 0.0,
            unit: "dB",
            rows: Some(130),
            sentence: "send on channel 11".to_owned(),
        }],
        ..diagnosis(Verdict::MissingEffects, "missing: hidden-obstacle")
    };
    let answer = MeasuredAnswer::Diagnosis(&diagnosis);
    let page = contents(answer, &site(), Some(view(0.0)));
    for part in [
        "Missing: hidden-obstacle",
        "Error, effect by effect",
        "Log loss of reception, effect by effect",
        "3.50 to 4.50",
        "or shadowing in its place",
        "6.50 to 7.50",
        "class=\"found\"",
        "is indistinguishable from shadowing",
        "Send on channel 11",
        "<code>1 + height</code>",
        "needs heights",
        "with what was found",
        "Error over height",
    ] {
        assert!(page.contains(part), "{part} is not in the page");
    }
    assert!(!without_scripts(&page).contains("NaN"));
}

#[test]
fn a_loss_that_is_the_same_everywhere_is_said_as_a_share_of_frames() {
    let diagnosis = Diagnosis {
        ladder: vec![
            rung("as configured", 2.0, -1.8, 0.64),
            rung("+ loss-curve:constant", 2.0, -1.7, 0.55),
        ],
        candidates: vec![candidate("loss-curve:constant", 0.1)],
        unexplained: vec![Structure {
            affects: Some(Affects::Losses),
            ..structure("constant", 0.13, "0.146", "loss")
        }],
        ..diagnosis(Verdict::UnexplainedStructure, "there is a loss")
    };
    let answer = MeasuredAnswer::Diagnosis(&diagnosis);
    let page = contents(answer, &site(), Some(view(0.0)));
    for part in [
        "a share of the frames, the same in every row",
        "13 % of the log loss of reception",
        "<code>extend --formula '0.146' --target loss</code>",
        "0.640 → 0.550",
    ] {
        assert!(page.contains(part), "{part} is not in the page");
    }
    assert!(!page.contains("a smooth curve"), "there is none");
}

/// Where a part begins in a page.
fn place(page: &str, part: &str) -> usize {
    page.find(part).unwrap_or_else(|| panic!("{part} is not in the page"))
}

#[test]
fn what_the_design_can_tell_is_a_table_with_the_nearest_rivals() {
    let size = |effect: &str, found_from: Option<f64>, rivals: &[&str]| EffectSize {
        effect: effect.to_owned(),
        found_from,
        parameter: None,
        told_apart_from: found_from.map(|it| 3.0 * it),
        rivals: rivals.iter().map(|&rival| rival.to_owned()).collect(),
        explained: 0.955,
    };
    let lacking = WithoutSize {
        effects: vec!["drift".to_owned(), "shadowing".to_owned()],
        because: "random effects, which the search estimates".to_owned(),
    };
    let table = Identifiability {
        noise: 2.0,
        unit: "dB",
        effects: vec![size("system-gain", Some(0.56), &["path-loss-exponent", "temperature"])],
        without_size: vec![lacking],
    };
    let diagnosis = Diagnosis {
        identifiability: Some(table),
        ..diagnosis(Verdict::NothingMissing, "nothing is missing")
    };
    let page = contents(MeasuredAnswer::Diagnosis(&diagnosis), &site(), None);
    for part in [
        "What these data can tell",
        "noise of 2.00 dB",
        "path-loss-exponent + temperature (95.5 %)",
        "0.560",
        "1.68",
        "drift, shadowing",
        "random effects, which the search estimates",
    ] {
        assert!(page.contains(part), "{part}: {page}");
    }
}

#[test]
fn what_was_not_found_is_a_table_with_the_largest_bound_first() {
    let bounded = |effect: &str, upper: f64, detectable: f64| Tested {
        upper: Some(upper),
        detectable: Some(detectable),
        ..candidate(effect, 0.0)
    };
    let diagnosis = Diagnosis {
        candidates: vec![
            bounded("vegetation", 0.25, 0.5),
            candidate("shadowing", 0.0),
            bounded("temperature", 1.25, 0.75),
            bounded("battery-sag", 9.0, 9.5),
        ],
        missing_one_of: vec![vec!["drift".to_owned(), "battery-sag".to_owned()]],
        ..diagnosis(Verdict::MissingOneOf, "missing: drift or battery-sag")
    };
    let page = contents(MeasuredAnswer::Diagnosis(&diagnosis), &site(), None);
    let table = &page[place(&page, "What was not found")..];
    let rows = "<th class=\"n\">at most (dB)</th><th class=\"n\">would be found from (dB)</th></tr>\
                <tr><td>temperature</td><td class=\"n\">1.25</td><td class=\"n\">0.750</td></tr>\
                <tr><td>vegetation</td><td class=\"n\">0.250</td><td class=\"n\">0.500</td></tr></table>";
    place(table, rows);
    let none = Diagnosis { candidates: vec![candidate("shadowing", 0.0)], ..diagnosis };
    let page = contents(MeasuredAnswer::Diagnosis(&none), &site(), None);
    assert!(!page.contains("What was not found"));
}

#[test]
fn a_structure_stands_with_the_nearest_effect_and_is_not_called_unknown_if_that_may_be_its_cause() {
    let page = |share: f64, may_be_cause: bool| {
        let nearest_effect = Some(NearestEffect {
            effect: "temperature".to_owned(),
            share,
            may_be_cause,
            why_not: "it may be chance".to_owned(),
        });
        let warning = Some("the model is still off".to_owned());
        let over = Structure { nearest_effect, warning, ..structure("dust", 0.1, "dust", "mean") };
        let diagnosis = Diagnosis {
            unexplained: vec![over],
            ..diagnosis(Verdict::UnexplainedStructure, "found structure over dust")
        };
        contents(MeasuredAnswer::Diagnosis(&diagnosis), &site(), None)
    };
    let unknown = page(0.625, false);
    place(&unknown, "There is structure over dust, which no known effect explains: 10 % of");
    let nearest = "The nearest known effect is temperature, which reaches 62.5 % of its gain. Not accepted: it may be chance.";
    place(&unknown, nearest);
    place(&unknown, "Warning: the model is still off.");
    let known = page(0.9, true);
    place(&known, "There is structure over dust: 10 % of");
    place(
        &known,
        "reaches 90 % of its gain, and may be its cause. Not accepted: it may be chance.",
    );
}

#[test]
fn many_rows_are_thinned_the_same_way_every_time() {
    let drawn: Vec<usize> = thinned(100_000).collect();
    assert!((MOST_DOTS * 8 / 10..MOST_DOTS * 12 / 10).contains(&drawn.len()), "{}", drawn.len());
    assert_eq!(drawn, thinned(100_000).collect::<Vec<_>>());
    assert_eq!(thinned(20).count(), 20);
}

#[test]
fn coverage_counts_what_lies_in_the_interval() {
    let (right, wrong) = (view(0.0), view(4.0));
    assert!((right.coverage_90() - 1.0).abs() < 1e-12);
    assert!(wrong.coverage_90() < 1e-12);
}

/// A page without its scripts: packed data are text by chance.
fn without_scripts(page: &str) -> String {
    page.split("<script").map(|part| part.rsplit("</script>").next().unwrap()).collect()
}
