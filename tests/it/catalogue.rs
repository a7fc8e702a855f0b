//! docs/effects.md is made from the effects' own words, and what docs/adding-an-effect.md walks through is compiled and run.
//!
//! `UPDATE_REFERENCE=1 cargo test --release -p tests --test it catalogue` writes docs/effects.md anew.

use std::collections::BTreeSet;
use std::path::PathBuf;
use tests::campaign::{Hidden, RobotHidden};

fn written(name: &str) -> (PathBuf, String) {
    let path = tests::repository().join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_default();
    (path, text)
}

#[test]
fn the_catalogue_is_what_the_effects_say_of_themselves() {
    let page = effects::page();
    let (path, mut text) = written("docs/effects.md");
    if std::env::var_os("UPDATE_REFERENCE").is_some() {
        std::fs::write(&path, &page).unwrap();
        text.clone_from(&page);
    }
    assert!(
        text == page,
        "docs/effects.md is out of date: write it anew as tests/it/catalogue.rs says"
    );
}

#[test]
fn the_walk_through_is_the_example_that_the_tests_compile() {
    let (_, example) = written("netsim/physics/examples/low_antenna.rs");
    let (_, guide) = written("docs/adding-an-effect.md");
    let (guide, _) = guide.split_once(SHORTEST).unwrap();
    let blocks = blocks(guide);
    assert!(4 <= blocks.len(), "{}", blocks.len());
    for block in &blocks {
        for part in block.trim().split("\n\n") {
            assert!(example.contains(part), "not in the example:\n{part}");
        }
    }
    // Nothing of the effect is left out: all but the comment on top and the program that shows it.
    let shown: usize = blocks.iter().map(|block| block.trim().lines().count()).sum();
    let program = example.split("fn main() {").nth(1).unwrap().split("\n}\n").next().unwrap();
    let rest = example.lines().count() - program.lines().count() - shown;
    assert!(rest <= 12, "{rest} lines of the example are not shown");
}

/// The heading of the part of the guide whose blocks are parts of the simulators' tests.
const SHORTEST: &str = "## The shortest of each kind";

fn blocks(guide: &str) -> Vec<&str> {
    guide.split("```rust\n").skip(1).filter_map(|rest| rest.split("\n```\n").next()).collect()
}

#[test]
fn the_shortest_of_each_kind_is_what_the_simulators_tests_add_and_has_under_40_lines() {
    let (_, guide) = written("docs/adding-an-effect.md");
    let (_, guide) = guide.split_once(SHORTEST).unwrap();
    let tests = ["netsim", "robotsim"].map(|side| {
        let (_, test) = written(&format!("{side}/tests/it/extension.rs"));
        assert!(!test.is_empty(), "{side}");
        test
    });
    let blocks = blocks(guide);
    // The call that adds one, then a radio effect, a robot effect, a scheduling function, a controller and a scenario.
    assert_eq!(blocks.len(), 6);
    for block in &blocks[1..] {
        let block = block.trim();
        assert!(tests.iter().any(|test| test.contains(block)), "in no test:\n{block}");
        assert!(block.lines().count() < 40, "{block}");
    }
    assert!(
        tests.iter().any(|test| blocks[0].lines().nth(1).is_some_and(|add| test.contains(add)))
    );
}

#[test]
fn what_contributors_are_shown_is_in_the_file_that_is_named_and_has_under_30_lines_of_code() {
    let (_, page) = written("CONTRIBUTING.md");
    for kind in ["an effect", "a controller", "a scheduling function", "a key"] {
        let section = page.split(&format!("## Add {kind}\n")).nth(1).unwrap();
        let section = section.split("\n## ").next().unwrap();
        let file = section.split('`').find(|word| word.ends_with(".rs")).unwrap();
        let (_, source) = written(file);
        let blocks = blocks(section);
        assert_eq!(blocks.len(), 1, "{kind}");
        for part in blocks[0].trim().split("\n\n") {
            assert!(source.contains(part), "not in {file}:\n{part}");
        }
        let is_code = |line: &&str| !line.trim().is_empty() && !line.trim().starts_with("//");
        assert!(blocks[0].lines().filter(is_code).count() < 30, "{kind}");
    }
}

#[test]
fn the_formula_of_the_walk_through_is_accepted_and_its_error_is_the_one_shown() {
    let (_, guide) = written("docs/adding-an-effect.md");
    let toml = guide.split("```toml\n").nth(1).unwrap().split("```").next().unwrap();
    let flocking = std::fs::read_to_string(tests::repository().join("configs/flocking.toml"));
    let flocking = flocking.unwrap();
    let check = |effect: &str| {
        let folder = tests::folder();
        std::fs::write(folder.path().join("x.toml"), format!("{flocking}\n{effect}")).unwrap();
        let output = tests::orchestrator(&["check", "x.toml"], folder.path());
        (output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (is_good, said) = check(toml);
    assert!(is_good, "{said}");
    let broken = toml
        .replace("-a * max(temperature_c - onset_c, 0)", "-a * distanc_m")
        .lines()
        .filter(|line| !line.contains("onset_c"))
        .collect::<Vec<_>>()
        .join("\n");
    let (is_good, said) = check(&broken);
    let shown = guide.split("```text output\n").nth(1).unwrap().split("```").next().unwrap();
    assert!(!is_good, "{broken}");
    for line in shown.lines() {
        // The page checks another file.
        let line = line.rsplit("flocking.toml: ").next().unwrap();
        assert!(said.contains(line), "{line} is not in\n{said}");
    }
}

#[test]
fn the_program_lists_explains_and_draws_effects() {
    let folder = tests::folder();
    let run = |arguments: &[&str]| {
        let output = tests::orchestrator(&[&["effects"], arguments].concat(), folder.path());
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (output.status.code(), text(&output.stdout), text(&output.stderr))
    };
    let (code, list, _) = run(&[]);
    assert_eq!(code, Some(0));
    let (code, json, _) = run(&["--json", "-"]);
    assert_eq!(code, Some(0));
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let effects = json["effects"].as_array().unwrap();
    assert!(30 <= effects.len(), "{}", effects.len());
    for effect in effects {
        let name = effect["name"].as_str().unwrap();
        assert!(list.contains(name), "{name}");
        let (code, text, _) = run(&[name]);
        assert_eq!(code, Some(0), "{name}");
        assert!(text.contains(&format!("kind = {name:?}")), "{text}");
    }
    let (code, ..) = run(&["two-ray-ground", "--svg", "two-ray-ground.svg"]);
    assert_eq!(code, Some(0));
    let picture = std::fs::read_to_string(folder.path().join("two-ray-ground.svg")).unwrap();
    assert!(picture.starts_with("<svg xmlns") && picture.trim_end().ends_with("</svg>"));
    let (code, _, error) = run(&["two-way-ground"]);
    assert_eq!(code, Some(2));
    assert!(error.contains("did you mean two-ray-ground?"), "{error}");
}

/// Why effects on thrust have no campaign there.
const FLOWN: &str = "campaigns have robots on the ground: tests/it/quadrotors.rs hides it from quadrotors by equations of its own";

/// Effects that no campaign of `tests/campaign` can hide, and why.
const WITHOUT_CAMPAIGN: [(&str, &str, &str); 14] = [
    (
        "radio",
        "drift",
        "links that drift together have a campaign of their own: tests/campaign/unforeseen/drift.rs",
    ),
    (
        "radio",
        "link-drift",
        "links that drift by themselves have a campaign of their own: tests/campaign/unforeseen/drift.rs",
    ),
    ("robots", "attitude-bias", FLOWN),
    ("robots", "ground-effect", FLOWN),
    ("robots", "linear-drag", FLOWN),
    ("robots", "payload-mass", FLOWN),
    ("robots", "push", FLOWN),
    ("robots", "rotor-loss", FLOWN),
    ("robots", "swinging-load", FLOWN),
    ("robots", "thrust-scale", FLOWN),
    ("robots", "thrust-voltage", FLOWN),
    (
        "robots",
        "turn-slowdown",
        "unicycles that are slower in turns have a campaign of their own: tests/campaign/unforeseen/robots.rs",
    ),
    (
        "radio",
        "formula",
        "it is what its user writes: tests/it/formula.rs fits one to measurements",
    ),
    (
        "robots",
        "formula",
        "it is what its user writes: tests/it/formula.rs fits one to measurements",
    ),
];

#[test]
fn every_effect_is_hidden_in_some_campaign_or_says_why_it_cannot_be() {
    let names = |of: &str| -> BTreeSet<&str> {
        let all = effects::all();
        all.iter().filter(|effect| effect.of == of).map(|effect| effect.variant.name).collect()
    };
    for (of, hidden) in [
        ("radio", Hidden::KNOWN.iter().map(|hidden| hidden.effect()).collect::<BTreeSet<_>>()),
        ("robots", RobotHidden::KNOWN.iter().map(|hidden| hidden.effect()).collect()),
    ] {
        let excused = WITHOUT_CAMPAIGN.iter().filter(|(other, ..)| *other == of);
        let excused: BTreeSet<&str> = excused.map(|(_, name, _)| *name).collect();
        let covered: BTreeSet<&str> = hidden.union(&excused).copied().collect();
        assert_eq!(names(of), covered, "{of}: a campaign for each, or a reason why there is none");
        assert!(hidden.is_disjoint(&excused), "{of}: it has a campaign after all");
    }
    // Campaigns have equations of their own for links and for motion, not for a network: there the running simulation hides
    // the effect from a model that lacks it.
    let measured_by_packets = include_str!("packets_missing.rs");
    for name in names("network") {
        assert!(measured_by_packets.contains(&format!("{name:?}")), "{name} is hidden nowhere");
    }
}
