//! The orchestrator has no rule for an effect or a controller of a certain name.

use checks::{product_code, rust_files};

/// Where the orchestrator may have a name of a catalogue: the end of a file's path, the name, and why.
const NAMED: &[(&str, &str, &str)] = &[
    ("bench/src/lib.rs", "boids", "what is measured is a configuration like any other"),
    ("bench/src/lib.rs", "full", "what is measured is a configuration like any other"),
    ("bench/src/lib.rs", "olfati-saber", "what is measured is a configuration like any other"),
    ("bench/src/lib.rs", "random-jump", "what is measured is a configuration like any other"),
    ("bench/src/standing.rs", "msf", "what is measured is a configuration like any other"),
    ("bench/src/standing.rs", "orchestra", "what is measured is a configuration like any other"),
    ("cli/formula.rs", "formula", "the name of an argument"),
    ("cli/measured.rs", "formula", "the name of an argument"),
    ("guess/words.rs", "temperature", "a word in the names of columns"),
    ("guess/words.rs", "wind", "a word in the names of columns"),
    ("effects/src/lib.rs", "table", "a description of the type of a key"),
    ("metric/short_names.rs", "coverage", "a short name of a metric"),
    ("metric/short_names.rs", "dispersion", "a short name of a metric"),
    ("network/src/split.rs", "interference", "a key of netsim.phy"),
    ("network/src/split.rs", "trace", "the configuration that is written has measured levels"),
    ("study/src/formula.rs", "formula", "what a user's own expression is added as"),
    ("study/src/open.rs", "localization", "a section of robotsim"),
];

/// What is special about an effect or a controller is a property of its entry, so that whoever adds one need not look elsewhere.
/// Scenarios are left out, whose names are ordinary words.
#[test]
fn the_orchestrator_knows_no_entry_of_a_catalogue_by_name() {
    let network = netsim::catalogue::Catalogue::built_in();
    let robots = robotsim::catalogue::Catalogue::built_in();
    let names: Vec<&str> = (network.physics.effects.iter().map(|entry| entry.variant.name))
        .chain(network.mac_effects.iter().map(|entry| entry.variant.name))
        .chain(network.scheduling_functions.iter().map(|entry| entry.variant.name))
        .chain(network.physics.propagation.iter().map(|entry| entry.variant.name))
        .chain(network.physics.reception.iter().map(|entry| entry.variant.name))
        .chain(robots.effects.iter().map(|entry| entry.variant.name))
        .chain(robots.controllers.iter().map(|entry| entry.variant.name))
        .collect();
    let mut unused: Vec<_> = NAMED.iter().map(|(file, name, _)| (*file, *name)).collect();
    let mut wrong = Vec::new();
    for file in rust_files(&checks::repository().join("orchestrator")) {
        // The repository itself may stand in a folder called tests.
        let path = file.strip_prefix(tests::repository()).unwrap().to_string_lossy();
        if path.contains("/tests/") || path.ends_with("tests.rs") || path.contains("/benches/") {
            continue;
        }
        let code = product_code(&std::fs::read_to_string(&file).unwrap());
        for name in names.iter().filter(|name| code.contains(&format!("\"{name}\""))) {
            let is_known = |(end, known): &(&str, &str)| path.ends_with(end) && known == name;
            if !NAMED.iter().any(|(end, known, _)| is_known(&(end, known))) {
                wrong.push(format!("{path} has {name:?}"));
            }
            unused.retain(|exception| !is_known(exception));
        }
    }
    assert!(wrong.is_empty(), "make it a property of the entry:\n{}", wrong.join("\n"));
    assert!(unused.is_empty(), "these exceptions are no longer needed: {unused:?}");
}
