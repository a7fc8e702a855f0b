//! A diagnosis as people read it.

use super::*;
use crate::diagnosis::{Rung, SCHEMA};
use measure::account::DataAccount;
use study::open::Subject;

fn candidate(effect: &str) -> Tested {
    Tested {
        effect: effect.to_owned(),
        gain: 0.25,
        held_out: "blocks of time",
        standard_error: 0.01,
        p_value: 0.0,
        accepted: true,
        doubt: None,
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

fn diagnosis(verdict: Verdict) -> Diagnosis {
    Diagnosis {
        schema: SCHEMA,
        kind: Subject::Links,
        verdict,
        sentence: "missing: something".to_owned(),
        missing: Vec::new(),
        missing_one_of: Vec::new(),
        possible: Vec::new(),
        split: "blocks of time",
        measurement_defects: Vec::new(),
        ladder: Vec::new(),
        candidates: Vec::new(),
        unexplained: Vec::new(),
        residuals_searched: true,
        misfits: Vec::new(),
        could_hide: f64::NAN,
        next_measurement: Vec::new(),
        complete: true,
        too_little: None,
        stopped_in_round: None,
        searched: None,
        account: DataAccount::default(),
        error_unit: "dB",
    }
}

#[test]
fn effects_that_lack_the_same_are_listed_together_in_short_lines() {
    let lacking = |effect: &str, why: &str| Tested {
        accepted: false,
        untestable: Some(why.to_owned()),
        ..candidate(effect)
    };
    let long = "needs commands of acceleration, or of thrust and attitude, at the same times as positions of all agents";
    let diagnosis = Diagnosis {
        candidates: vec![
            lacking("wall-attenuation", "needs walls in [site]"),
            lacking("ground-effect", long),
            lacking("diffraction", "needs walls in [site]"),
        ],
        ..diagnosis(Verdict::NothingMissing)
    };
    let text = text(&diagnosis);
    let expected = "not testable on these data:
  wall-attenuation, diffraction (needs walls in [site])
  ground-effect (needs commands of acceleration, or of thrust and attitude, at the same times as
    positions of all agents)
";
    assert!(text.ends_with(expected), "{text}");
}

fn rung(model: &str, log_score: f64) -> Rung {
    Rung {
        model: model.to_owned(),
        log_score,
        rmse: 2.0,
        rmse_received_db: None,
        rmse_heading_rad: None,
        crps: 1.0,
        reception_log_loss: f64::NAN,
    }
}

#[test]
fn a_curve_without_parameters_ends_its_line_and_long_names_do_not_shift_columns() {
    let only = "agents = [2]\nfrom_s = 160.8".parse().unwrap();
    let limited = Tested { only: Some(only), ..candidate("speed-limit") };
    let long = "+ speed-limit (only agents = [2], from_s = 160.8)";
    let diagnosis = Diagnosis {
        ladder: vec![rung("as configured", 2.25), rung(long, 3.5)],
        candidates: vec![limited, candidate("curve:time_s")],
        ..diagnosis(Verdict::MissingEffects)
    };
    let text = text(&diagnosis);
    assert!(text.contains(&format!("\n{:<49}       2.2500", "as configured")), "{text}");
    assert!(text.contains(&format!("\n{long}       3.5000")), "{text}");
    let gain = "gain 0.2500 +- 0.0100 nats per row (blocks of time held out)";
    let expected = format!("\n{}: {gain}\ncurve:time_s: {gain}\n", &long[2..]);
    assert!(text.ends_with(&expected), "{text}");
}
