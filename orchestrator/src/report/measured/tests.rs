use super::*;
use serde_json::json;

/// Forty rows of links, half of them lost where it is weak; `shift_db` is what the model errs by.
fn view(shift_db: f64) -> View {
    let level: Vec<f64> = (0..40).map(|row| -95.0 + f64::from(row)).collect();
    View {
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
        passes: (0..40).map(|row| if row < 10 { 0.1 } else { 0.95 }).collect(),
        level,
    }
}

fn contents(json: &Value, site: &Site, after: Option<View>) -> String {
    let place = |row: usize| [row as f64, (row % 7) as f64];
    let rows = LinkRows {
        ends: (0..40).map(|row| [(place(row % 4), false), (place(row), true)]).collect(),
        motes: (0..40).map(|row| [row % 4, 9]).collect(),
        frames: (0..40).map(|row| [1.0, f64::from(u8::from(10 <= row))]).collect(),
        quantum_db: 1.0,
    };
    page(&Contents {
        config: "<model>.toml".to_owned(),
        command: "orchestrator compare <model>.toml".to_owned(),
        json,
        site,
        rows: Rows::Links(rows),
        before: view(4.0),
        after,
        covariates: vec![("height".to_owned(), (0..40).map(f64::from).collect())],
    })
}

fn site() -> Site {
    Site::default()
}

#[test]
fn a_comparison_shows_errors_reception_and_scores() {
    let json = json!({ "schema": "compare/1", "kind": "link", "rows": 41, "used": 40,
        "data": { "file": "links.csv", "sha256": "ab" },
        "rejected": [{ "rows": 1, "reason": "tx is missing", "first_line": 3 }], "warnings": ["a <b>"],
        "scores": { "rmse_db": 4.1 }, "intervals": { "rmse_db": [4.0, 4.2] } });
    let page = contents(&json, &site(), None);
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
    assert!(!page.contains("NaN") && !page.contains("http"), "it stands alone");
}

#[test]
fn a_diagnosis_shows_the_ladder_what_was_found_and_what_is_left() {
    let json = json!({ "schema": "diagnose/1", "kind": "link", "rows": 40, "used": 40,
        "sentence": "missing: hidden-obstacle", "verdict": "missing-effects",
        "data": { "file": "links.csv", "sha256": "ab" }, "rejected": [], "warnings": [],
        "ladder": [{ "model": "as configured", "rmse": 4.1, "log_score": -3.0, "reception_log_loss": 0.3 },
            { "model": "+ hidden-obstacle", "rmse": 1.0, "log_score": -2.0, "reception_log_loss": 0.2 }],
        "candidates": [
            { "effect": "hidden-obstacle", "accepted": true, "gain": 1.0, "standard_error": 0.1, "p_value": 0.0,
              "indistinguishable_from": ["shadowing"],
              "parameters": { "loss_db": { "value": 4.0, "unit": "dB", "low": 3.5, "high": 4.5 } },
              "settings": { "kind": "hidden-obstacle", "from_m": [1.0, 1.0], "to_m": [3.0, 4.0] } },
            { "effect": "two-ray-ground", "accepted": false, "gain": 0.0, "untestable": "needs heights" }],
        "unexplained": [{ "covariate": "height", "explained": 0.1, "formula": "1 + height", "target": "mean" }],
        "next_measurement": [{ "sentence": "send on channel 11" }] });
    let page = contents(&json, &site(), Some(view(0.0)));
    for part in [
        "Missing: hidden-obstacle",
        "Error, effect by effect",
        "Log loss of reception, effect by effect",
        "3.50 to 4.50",
        "class=\"found\"",
        "cannot be told from shadowing",
        "Send on channel 11",
        "<code>1 + height</code>",
        "needs heights",
        "with what was found",
        "Error over height",
    ] {
        assert!(page.contains(part), "{part} is not in the page");
    }
    assert!(!page.contains("NaN"));
}

#[test]
fn a_loss_that_is_the_same_everywhere_is_said_as_a_share_of_frames() {
    let json = json!({ "schema": "diagnose/1", "kind": "link", "rows": 40, "used": 40,
        "sentence": "there is a loss", "verdict": "unexplained-structure",
        "data": { "file": "links.csv", "sha256": "ab" }, "rejected": [], "warnings": [],
        "ladder": [{ "model": "as configured", "rmse": 2.0, "log_score": -1.8, "reception_log_loss": 0.64 },
            { "model": "+ loss-curve:constant", "rmse": 2.0, "log_score": -1.7, "reception_log_loss": 0.55 }],
        "candidates": [{ "effect": "loss-curve:constant", "accepted": true, "gain": 0.1, "standard_error": 0.01,
            "p_value": 0.0, "indistinguishable_from": [], "parameters": {} }],
        "unexplained": [{ "covariate": "constant", "of": "losses", "explained": 0.13, "formula": "0.146", "target": "loss" }],
        "next_measurement": [] });
    let page = contents(&json, &site(), Some(view(0.0)));
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
