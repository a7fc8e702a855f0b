//! A diagnosis as people read it.

use super::*;
use crate::diagnosis::{Affects, Rival, Rung, SCHEMA};
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

fn diagnosis(verdict: Verdict) -> Diagnosis {
    Diagnosis {
        schema: SCHEMA,
        kind: Subject::Links,
        verdict,
        sentence: "missing: something".to_owned(),
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
  ground-effect (needs commands of acceleration, or of thrust and attitude, at
    the same times as positions of all agents)
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
    assert!(text.contains(&format!("\n{:<49}     2.2500", "as configured")), "{text}");
    assert!(text.contains(&format!("\n{long}     3.5000")), "{text}");
    let gain = "gain 0.2500 +- 0.0100 nats per row (blocks of time held out)";
    let expected = format!("\n{}: {gain}\ncurve:time_s: {gain}\n", &long[2..]);
    assert!(text.ends_with(&expected), "{text}");
}

fn structure(covariate: &str, nearest_effect: Option<NearestEffect>) -> Structure {
    Structure {
        covariate: covariate.to_owned(),
        affects: Some(Affects::Readings),
        explained: 0.1,
        p_value: 0.0,
        formula: Some("0.5".to_owned()),
        target: Some("left".to_owned()),
        also: None,
        rmse_after: None,
        indistinguishable_from: Vec::new(),
        nearest_effect,
        warning: None,
    }
}

fn texts(words: &[&str]) -> Vec<String> {
    words.iter().map(|&word| word.to_owned()).collect()
}

/// A gyro that drifts: an answer with one effect that is certain, and four that are not.
fn drifting() -> Diagnosis {
    let why = "headings would be off by 0.254 rad instead of 0.116 rad";
    let nearest = |why_not: &str| {
        let effect = "steering-bias".to_owned();
        Some(NearestEffect { effect, share: 1.0, may_be_cause: true, why_not: why_not.to_owned() })
    };
    Diagnosis {
        missing: texts(&["heading-bias"]),
        possible: texts(&["steering-bias", "actuator-lag (turn)", "slip", "yaw-coupling or wind"]),
        possible_because: texts(&[why, "of chance", "of a part", "of chance"]),
        unexplained: vec![
            structure("time_s", nearest(why)),
            Structure { affects: None, ..structure("time_s", nearest("another reason")) },
        ],
        ..diagnosis(Verdict::MissingEffects)
    }
}

#[test]
fn of_two_nodes_the_weaker_direction_stands_after_the_verdict() {
    let weaker_by = Parameter { value: 8.04, unit: "dB".to_owned(), low: 7.5, high: 8.56 };
    let levels = |doubt: Option<&str>| Tested {
        directions: Some(Directions { from: 2, to: 1, weaker_by: weaker_by.clone() }),
        doubt: doubt.map(str::to_owned),
        ..candidate("node-offset")
    };
    let of = |levels| Diagnosis {
        missing: texts(&["node-offset"]),
        candidates: vec![levels],
        ..diagnosis(Verdict::MissingEffects)
    };
    let expected = "missing: node-offset. Frames from node 2 to node 1 arrive 8.0 dB weaker than from 1 to 2 (90 %: 7.5 to 8.6). Two nodes do not \
                    tell a weaker transmitter of 2 from a less sensitive receiver of 1, nor which direction is right from system-gain";
    assert_eq!(sentence(&of(levels(None))), expected);
    // What is not certain is not in the sentence.
    let doubted = of(levels(Some("the data are few")));
    assert!(!sentence(&doubted).contains("weaker"));
    assert!(text(&doubted).contains("\n  frames from node 2 to node 1 arrive 8.0 dB weaker"));
}

#[test]
fn what_is_possible_has_its_reason_and_stands_after_the_verdict() {
    let expected = "missing: heading-bias. Possibly also steering-bias, which would explain 100 % of structure over time_s: not certain, \
                    because headings would be off by 0.254 rad instead of 0.116 rad. Possibly also actuator-lag (turn) and yaw-coupling \
                    or wind: not certain, because of chance. Possibly also slip: not certain, because of a part";
    assert_eq!(sentence(&drifting()), expected);
    let nothing = Diagnosis { missing: Vec::new(), ..drifting() };
    let found = sentence(&Diagnosis { verdict: Verdict::NothingFound, ..nothing.clone() });
    assert!(found.starts_with("nothing is certain. Possibly steering-bias, which"), "{found}");
    let found = sentence(&Diagnosis { verdict: Verdict::SomethingMissing, ..nothing });
    assert!(
        found.starts_with("something is missing: structure over time_s. Possibly st"),
        "{found}"
    );
    let stopped = sentence(&Diagnosis { complete: false, ..drifting() });
    let start = "stopped after the search; what follows from it may still change: missing: heading-bias. Possibly";
    assert!(stopped.starts_with(start), "{stopped}");
    let empty = Diagnosis { verdict: Verdict::NothingFound, possible: Vec::new(), ..drifting() };
    let unfinished = sentence(&Diagnosis { complete: false, ..empty });
    let start = "stopped after the search; what follows from it may still change: no effect was found until then";
    assert!(unfinished.starts_with(start), "{unfinished}");
    let before = Diagnosis { stopped_in_round: Some(1), complete: false, ..drifting() };
    assert_eq!(sentence(&before), "stopped in round 1, before any result");
}

#[test]
fn what_is_left_over_one_covariate_is_further_structure_with_nothing_repeated() {
    let text = text(&drifting());
    let lines: Vec<&str> = text.lines().filter(|line| line.contains("structure over")).collect();
    let one = "structure over time_s explains 10.0 % of the squared error: 0.5 m/s left";
    assert_eq!(lines, [format!("unexplained: {one}"), format!("unexplained: further {one}")]);
    assert_eq!(text.matches("nearest known effect").count(), 1, "{text}");
}

#[test]
fn structure_that_has_no_known_cause_is_said_beside_what_is_missing() {
    let warning = Some("the model is still off".to_owned());
    let open = Structure { warning, ..structure("heading_rad", None) };
    let diagnosis = Diagnosis {
        missing: texts(&["slip"]),
        unexplained: vec![open],
        ..diagnosis(Verdict::MissingEffects)
    };
    let expected = "missing: slip. Something else is missing, seen as structure over heading_rad. The model is still off";
    assert_eq!(sentence(&diagnosis), expected);
}

#[test]
fn the_numbers_of_a_rival_stand_below_those_of_the_effect_that_it_is_tied_with() {
    let number = |key: &str, value: f64, unit: &str| {
        let parameter =
            Parameter { value, unit: unit.to_owned(), low: value - 0.5, high: value + 0.5 };
        IndexMap::from([(key.to_owned(), parameter)])
    };
    let rival = |in_place_of: &str| Rival {
        in_place_of: in_place_of.to_owned(),
        effect: "temperature".to_owned(),
        parameters: number("db_per_c", -1.5, "dB/degC"),
        not_identifiable: texts(&["reference_c"]),
    };
    let sag = Tested {
        indistinguishable_from: texts(&["temperature"]),
        parameters: number("db_per_hour", -6.0, "dB/h"),
        ..candidate("battery-sag")
    };
    let diagnosis = Diagnosis {
        candidates: vec![sag],
        rivals: vec![rival("drift"), rival("battery-sag")],
        ..diagnosis(Verdict::MissingOneOf)
    };
    let expected = "
battery-sag: gain 0.2500 +- 0.0100 nats per row (blocks of time held out). db_per_hour = -6.0000 dB/h (90 %: -6.5000 to -5.5000)
  indistinguishable on these data from temperature
  temperature in its place: db_per_c = -1.5000 dB/degC (90 %: -2.0000 to -1.0000), reference_c not identifiable
";
    let text = text(&diagnosis);
    assert!(text.ends_with(expected), "{text}");
}
