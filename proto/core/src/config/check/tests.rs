//! Problems, their nearest valid choices, and defaults.

use super::*;
use crate::config::{Choice, Range, Section, Tag, Variants, parse};

const INNER: TableSpec = TableSpec {
    doc: "An inner table.",
    fields: &[Field {
        key: "count",
        doc: "How many.",
        kind: Kind::Integer { min: 1, max: 9 },
        default: Default::Required,
    }],
    tag: None,
};
const SPEC: TableSpec = TableSpec {
    doc: "A table.",
    fields: &[
        Field {
            key: "radius_m",
            doc: "Size.",
            kind: Kind::Number(Range::POSITIVE),
            default: Default::Number(10.0),
        },
        Field {
            key: "mode",
            doc: "How.",
            kind: Kind::Choice(&[
                Choice { name: "slow", doc: "" },
                Choice { name: "fast", doc: "" },
            ]),
            default: Default::Text("slow"),
        },
        Field { key: "inner", doc: "More.", kind: Kind::Tables(&INNER), default: Default::Absent },
    ],
    tag: Some(&Tag {
        key: "kind",
        doc: "Which.",
        default: Some("a"),
        variants: Variants::Fixed(&[
            Variant { name: "a", doc: "A.", fields: &[] },
            Variant {
                name: "b",
                doc: "B.",
                fields: &[Field {
                    key: "gain_db",
                    doc: "Gain.",
                    kind: Kind::Number(Range::ANY),
                    default: Default::Required,
                }],
            },
        ]),
    }),
};

fn problems(text: &str) -> Vec<String> {
    let mut problems = Vec::new();
    check(&parse(text).unwrap(), "x", &SPEC, &Lists::NONE, &mut problems);
    problems.iter().map(ToString::to_string).collect()
}

#[test]
fn every_problem_is_found_at_once() {
    assert_eq!(
        problems(
            "kind = \"b\"\nradios_m = 3\nradius_m = -3\nmode = \"fats\"\n[[inner]]\ncount = 12\n[[inner]]\n"
        ),
        [
            "x.gain_db: is missing: must be a number",
            "x.radius_m: must be greater than 0, got -3 (nearest valid: 3)",
            "x.mode: must be one of \"slow\", \"fast\", got \"fats\" (nearest valid: \"fast\")",
            "x.inner[0].count: must be a whole number from 1 to 9, got 12 (nearest valid: 9)",
            "x.inner[1].count: is missing: must be a whole number from 1 to 9",
            "x.radios_m: is not a known key (nearest valid: radius_m)",
        ]
    );
}

#[test]
fn a_key_of_another_variant_says_where_it_belongs() {
    assert_eq!(
        problems("gain_db = 1"),
        ["x.gain_db: does not apply with kind = \"a\", only with \"b\""]
    );
    assert_eq!(
        problems("kind = \"c\"\ngain_db = 1"),
        ["x.kind: must be one of \"a\", \"b\", got \"c\""]
    );
}

#[test]
fn not_a_number_is_no_number() {
    assert_eq!(
        problems("radius_m = nan"),
        ["x.radius_m: must be a finite number, greater than 0, got NaN"]
    );
    assert_eq!(problems("radius_m = \"3\"").len(), 1);
}

#[test]
fn a_list_may_be_too_short() {
    const LIST: TableSpec = TableSpec {
        doc: "A table.",
        fields: &[Field {
            key: "motes",
            doc: "Some.",
            kind: Kind::List { of: &Kind::Integer { min: 0, max: 9 }, min: 1, max: usize::MAX },
            default: Default::Absent,
        }],
        tag: None,
    };
    let mut problems = Vec::new();
    check(&parse("motes = []").unwrap(), "x", &LIST, &Lists::NONE, &mut problems);
    assert_eq!(problems[0].to_string(), "x.motes: must have at least 1 entry, got []");
}

#[test]
fn what_a_configuration_names_outside_of_itself_is_listed() {
    /// A table.
    #[derive(Section)]
    struct Keys {
        /// Read.
        #[key(required)]
        file: Option<FilePath>,
        /// Started.
        command: Option<Program>,
        /// Called.
        url: Option<Url>,
        /// Executed.
        lines: Vec<ClusterLine>,
    }
    let text = "file = 1\nurl = \"http://a\"\ncommand = [\"a\", \"b\"]\nlines = [\"c\", \"d\"]";
    let mut problems = Vec::new();
    let checked = check(&parse(text).unwrap(), "x", &Keys::SPEC, &Lists::NONE, &mut problems);
    assert_eq!(problems[0].to_string(), "x.file: must be the path of a file, in quotes, got 1");
    let keys = Keys::read(&checked.table);
    assert_eq!((keys.file, keys.url), (None, Some(Url("http://a".to_owned()))));
    assert_eq!(keys.command, Some(Program(vec!["a".to_owned(), "b".to_owned()])));
    let paths: Vec<&str> = checked.touches.iter().map(|touch| &*touch.key).collect();
    assert_eq!(paths, ["x.command", "x.url", "x.lines[0]", "x.lines[1]"]);
    let last = TouchTarget::ClusterLine(ClusterLine("d".to_owned()));
    assert_eq!(checked.touches[3].target, last);
    assert_eq!((keys.lines.len(), checked.files()), (2, Vec::new()));
}

#[test]
fn defaults_are_filled_in() {
    let mut problems = Vec::new();
    let checked = check(&parse("").unwrap(), "", &SPEC, &Lists::NONE, &mut problems);
    assert!(problems.is_empty());
    assert_eq!(checked.table.to_string(), "kind = \"a\"\nradius_m = 10.0\nmode = \"slow\"\n");
}
