use super::*;
use diagnose::between::error_change::ErrorChange;
use diagnose::between::{BetweenVerdict, Common, Confounded, SCHEMA, Same, SidesOf};
use diagnose::gate::Misfit;
use indexmap::IndexMap;
use measure::account::DataFile;
use study::open::Subject;

fn account(file: &str) -> DataAccount {
    DataAccount {
        data: DataFile { file: file.to_owned(), sha256: format!("sha-{file}") },
        rows: 41,
        used: 40,
        rejected: Vec::new(),
        warnings: Vec::new(),
        predicted_by: None,
    }
}

fn parameter(value: f64, low: f64, high: f64) -> Parameter {
    Parameter { value, unit: "dB".to_owned(), low, high }
}

fn change(a: Option<Parameter>, difference: Option<Parameter>) -> Change {
    let b = parameter(-6.0, -6.5, -5.5);
    let changed = Changed { unit: "dB".to_owned(), a, b, difference };
    Change {
        effect: "system-gain".to_owned(),
        only: toml::from_str("nodes = [3]").ok(),
        parameters: IndexMap::from([("gain_db".to_owned(), changed)]),
        gain: 0.4,
        standard_error: 0.04,
        p_value: 1e-9,
        indistinguishable_from: vec!["<antenna> changed".to_owned()],
        ruled_out: vec!["shadow changed".to_owned()],
        doubt: None,
        warning: None,
        settings: None,
    }
}

fn quiet() -> Between {
    Between {
        schema: SCHEMA,
        kind: Subject::Links,
        verdict: BetweenVerdict::NothingChanged,
        sentence: "nothing changed".to_owned(),
        changed: Vec::new(),
        possible: Vec::new(),
        common: Vec::new(),
        same: Vec::new(),
        not_found: Vec::new(),
        measurement_defects: SidesOf::default(),
        unexplained: Vec::new(),
        error: None,
        could_hide: f64::NAN,
        confounded: Vec::new(),
        shared: SidesOf::default(),
        recordings: SidesOf { a: 4, b: 4 },
        caution: None,
        time_of_day_h: None,
        left_out_columns: Vec::new(),
        of_time_in_a: Vec::new(),
        too_little: None,
        complete: true,
        searched: None,
        a: account("a.csv"),
        b: account("b.csv"),
        error_unit: "dB",
    }
}

#[test]
fn a_change_is_shown_with_its_intervals_the_errors_and_what_was_ruled_out() {
    let answer = Between {
        changed: vec![change(None, None)],
        same: vec![Same {
            what: "readings".to_owned(),
            difference: parameter(0.01, -0.1, 0.12),
            within: 0.12,
        }],
        not_found: vec!["path-loss-exponent".to_owned()],
        error: Some(ErrorChange {
            rmse_a: 1.5,
            rmse_b: 2.75,
            log_score_a: -1.9,
            log_score_b: -3.1,
            rmse_b_with_changes: Some(1.52),
            log_score_b_with_changes: Some(-1.91),
            p_value: 1e-4,
            p_value_new_places: Some(0.02),
        }),
        ..quiet()
    };
    let page = page("<m>.toml", "murmuration diagnose", &answer);
    for part in [
        "<td>nodes = [3]</td>",
        "<td class=\"n\">−6.00</td><td class=\"n\">−6.50 to −5.50</td>",
        "B, by the model of A",
        "2.75 dB",
        "1.52 dB",
        "p = 0.0200",
        "In place of system-gain: shadow changed",
        "−0.10 to 0.12",
        "not significant: path-loss-exponent.",
        "Indistinguishable on these data from &lt;antenna&gt; changed.",
        "(&lt;m&gt;.toml)",
        "sha-b.csv",
    ] {
        assert!(page.contains(part), "{part}\n{page}");
    }
    assert!(!page.contains("<m>") && !page.contains("<antenna>"));
}

#[test]
fn an_effect_of_both_campaigns_has_both_values_and_the_difference() {
    let change = change(Some(parameter(-2.0, -2.5, -1.5)), Some(parameter(-4.0, -4.7, -3.3)));
    let page = page("m.toml", "", &Between { changed: vec![change], ..quiet() });
    assert!(page.contains("<td class=\"n\">−2.00</td>"), "{page}");
    assert!(
        page.contains("<td class=\"n\">−4.00</td><td class=\"n\">−4.70 to −3.30</td>"),
        "{page}"
    );
}

#[test]
fn conditions_and_unexplained_differences_are_listed_and_empty_sections_left_out() {
    let answer = Between {
        common: vec![Common {
            effect: "temperature".to_owned(),
            only: None,
            parameters: IndexMap::from([("db_per_c".to_owned(), parameter(-0.4, -0.5, -0.3))]),
            found_in_a: true,
        }],
        unexplained: vec![Misfit {
            what: "readings are off".to_owned(),
            of: Some("sender 3".to_owned()),
            off: -4.0,
            unit: "dB",
            standard_error: 0.5,
            p_value: 1e-5,
        }],
        confounded: vec![Confounded {
            covariate: "temperature_c".to_owned(),
            spans: Spans { a: [1.0, 2.0], b: [8.0, 9.0] },
        }],
        time_of_day_h: Some(Spans { a: [8.0, 10.0], b: [20.0, 22.0] }),
        too_little: Some("A has only 3 blocks".to_owned()),
        complete: false,
        ..quiet()
    };
    let full = page("m.toml", "", &answer);
    for part in [
        "A was measured 08:00 to 10:00 UTC, B 20:00 to 22:00 UTC: an effect of the time of day",
        "temperature_c was 1.00 to 2.00 in A and 8.00 to 9.00 in B",
        "Beyond A, readings are off by -4.0 dB (sender 3)",
        "db_per_c = −0.40 dB (−0.50 to −0.30)",
        "A has only 3 blocks",
        "stopped before its end",
    ] {
        assert!(full.contains(part), "{part}\n{full}");
    }
    let bare = page("m.toml", "", &quiet());
    for heading in
        ["What changed</h2>", "Errors", "ruled out", "Conditions", "Unexplained", "notice\""]
    {
        assert!(!bare.contains(heading), "{heading}\n{bare}");
    }
}
