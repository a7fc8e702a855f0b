//! `orchestrator conformance` finds nothing wrong with our own simulators, and finds what is wrong with others.

use serde_json::Value;
use tests::Server;
use tests::fake::{Fault, Faulty};

/// What it said of the simulator at a URL, by promise; and its exit status.
fn ask(side: &str, url: &str, config: &str) -> (Option<i32>, Vec<(String, String)>) {
    let folder = tests::folder();
    std::fs::write(folder.path().join("side.toml"), config).unwrap();
    let args = ["conformance", side, url, "--config", "side.toml", "--json", "found.json"];
    let output = tests::orchestrator(&args, folder.path());
    let found = std::fs::read(folder.path().join("found.json"));
    let found = found.unwrap_or_else(|_| panic!("{}", tests::said(&output)));
    let found: Value = serde_json::from_slice(&found).unwrap();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let findings = found["findings"].as_array().unwrap().iter();
    (output.status.code(), findings.map(|f| (text(&f["promise"]), text(&f["verdict"]))).collect())
}

const ROBOTS: &str = "[scenario]\nkind = \"disc\"\ndensity_per_m2 = 0.1\n[controller]\nkind = \"flocking\"\nflock_radius_m = 10.0\n\
    [[dynamics.effect]]\nkind = \"localization\"\nsd_m = 0.1\n";
const NETWORK: &str = "[phy]\npropagation = \"experimental-randomness\"\n";

#[test]
fn our_own_simulators_keep_every_promise() {
    for (side, config) in [("robotsim", ROBOTS), ("netsim", NETWORK)] {
        let server = Server::start(side, &[]).unwrap();
        let (status, findings) = ask(side, &server.url, config);
        assert_eq!(status, Some(0), "{findings:?}");
        assert!(8 <= findings.len(), "{findings:?}");
        for (promise, verdict) in findings {
            assert_eq!(verdict, "kept", "{side}: {promise}");
        }
    }
}

#[test]
fn what_is_wrong_with_others_is_found() {
    for fault in [
        Fault::WrongStep,
        Fault::WrongDigest,
        Fault::WrongTime,
        Fault::ShortColumn,
        Fault::NotANumber,
    ] {
        let (status, findings) = ask("robotsim", &Faulty::robots(fault).url, ROBOTS);
        assert_eq!(status, Some(1), "{fault:?}: {findings:?}");
        let broken: Vec<_> = findings.iter().filter(|(_, verdict)| verdict == "broken").collect();
        assert_eq!(broken.len(), 1, "{fault:?}: {findings:?}");
        assert!(
            broken[0].0.starts_with("Step replies for the requested step and time"),
            "{broken:?}"
        );
    }
    let (status, findings) = ask("netsim", &Faulty::network(Fault::OtherVersion).url, NETWORK);
    assert_eq!(status, Some(1), "{findings:?}");
    assert_eq!(findings[0].1, "broken");
}

#[test]
fn a_seed_that_is_ignored_is_found() {
    for (side, url, config) in [
        ("robotsim", Faulty::robots(Fault::IgnoresSeed).url, ROBOTS),
        ("netsim", Faulty::network(Fault::IgnoresSeed).url, NETWORK),
    ] {
        let (status, findings) = ask(side, &url, config);
        assert_eq!(status, Some(0), "{side}: {findings:?}");
        let other: Vec<_> = findings.iter().filter(|(_, verdict)| verdict == "undecided").collect();
        assert_eq!(other.len(), 1, "{side}: {findings:?}");
        assert!(other[0].0.starts_with("a snapshot restored with another seed"), "{other:?}");
    }
    let (_, findings) = ask("netsim", &Faulty::network(Fault::NoSnapshots).url, NETWORK);
    let of_snapshots = |it: &&(String, String)| it.0.contains("restored");
    let verdicts: Vec<_> = findings.iter().filter(of_snapshots).map(|it| &it.1).collect();
    assert_eq!(verdicts, ["not-announced"; 2], "{findings:?}");
}

#[test]
fn a_full_digest_that_leaves_something_out_is_found() {
    for (side, url, config) in [
        ("robotsim", Faulty::robots(Fault::FalseDigest).url, ROBOTS),
        ("netsim", Faulty::network(Fault::FalseDigest).url, NETWORK),
    ] {
        let (status, findings) = ask(side, &url, config);
        assert_eq!(status, Some(1), "{side}: {findings:?}");
        let broken: Vec<_> = findings.iter().filter(|(_, verdict)| verdict == "broken").collect();
        assert_eq!(broken.len(), 1, "{side}: {findings:?}");
        assert!(broken[0].0.starts_with("when asked for the full digest"), "{broken:?}");
    }
    let (status, findings) = ask("netsim", &Faulty::network(Fault::LesserDigest).url, NETWORK);
    assert_eq!(status, Some(0), "{findings:?}");
    assert!(findings.iter().any(|(_, verdict)| verdict == "not-announced"), "{findings:?}");
}

#[test]
fn predictions_that_break_the_contract_are_found_and_not_announced_ones_not_asked_for() {
    for (fault, promise) in [
        (Fault::PredictsNotANumber, "Predict replies for each window"),
        (Fault::PredictsTooFew, "Predict replies for each window"),
        (Fault::PredictsAnother, "Predict replies for each window"),
        (Fault::PredictsWithMemory, "Predict gives the same windows again"),
    ] {
        let (status, findings) = ask("robotsim", &Faulty::robots(fault).url, ROBOTS);
        assert_eq!(status, Some(1), "{fault:?}: {findings:?}");
        let broken: Vec<_> = findings.iter().filter(|(_, verdict)| verdict == "broken").collect();
        assert_eq!(broken.len(), 1, "{fault:?}: {findings:?}");
        assert!(broken[0].0.starts_with(promise), "{fault:?}: {broken:?}");
    }
    let (status, findings) = ask("robotsim", &Faulty::robots(Fault::CannotPredict).url, ROBOTS);
    assert_eq!(status, Some(0), "{findings:?}");
    let about = |(promise, _): &&(String, String)| promise.contains("Predict ");
    let verdicts: Vec<_> = findings.iter().filter(about).map(|(_, verdict)| verdict).collect();
    assert_eq!(verdicts, ["not-announced"; 2], "{findings:?}");
}

#[test]
fn a_configuration_that_is_refused_is_no_broken_promise() {
    let server = Server::start("robotsim", &[]).unwrap();
    let folder = tests::folder();
    let output = tests::orchestrator(&["conformance", "robotsim", &server.url], folder.path());
    let said = tests::said(&output);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("--config FILE") && said.contains("scenario.kind"), "{said}");
    assert!(!said.contains("BROKEN"), "{said}");
}

#[test]
fn robots_that_do_not_stand_still_when_told_to_are_found() {
    for (fault, said, status_expected) in
        [(Fault::Restless, "broken", 1), (Fault::CannotHold, "not-announced", 0)]
    {
        let (status, findings) = ask("robotsim", &Faulty::robots(fault).url, ROBOTS);
        assert_eq!(status, Some(status_expected), "{fault:?}: {findings:?}");
        let (promise, verdict) = findings.last().unwrap();
        assert!(promise.starts_with("with hold, robots stand still"), "{fault:?}: {promise}");
        assert_eq!(verdict, said, "{fault:?}: {findings:?}");
        // Whoever does not hold keeps every other promise.
        let others = &findings[..findings.len() - 1];
        assert!(others.iter().all(|(_, verdict)| verdict != "broken"), "{fault:?}: {findings:?}");
    }
}
