//! Files that are given in each other's place, or do not exist: one sentence, with the command that is right.

use std::path::Path;
use tests::{folder, orchestrator, said};

/// The error of a command that is refused.
fn refused(args: &str, folder: &Path) -> String {
    let words: Vec<&str> = args.split(' ').collect();
    let output = orchestrator(&words, folder);
    let said = said(&output);
    assert_eq!(output.status.code(), Some(2), "{args}: {said}");
    said
}

const MODEL: &str = "[netsim.phy]\npropagation = \"friis\"\n";
const LOG: &str = "Timestamp;sender;receiver;Signal\n04.03.2025 14:02:00;a;b;-70\n";

#[test]
fn a_table_in_place_of_a_configuration_leads_to_the_command_that_takes_it() {
    let dir = folder();
    std::fs::write(dir.path().join("model.toml"), MODEL).unwrap();
    std::fs::write(dir.path().join("log.csv"), LOG).unwrap();
    std::fs::write(dir.path().join("log.txt"), LOG).unwrap();
    let mapping = "table = \"links\"\n[[input]]\nfiles = \"log.csv\"\n";
    std::fs::write(dir.path().join("map.toml"), mapping).unwrap();
    std::fs::write(dir.path().join("zipped"), b"\x1f\x8b\x08\0rest").unwrap();
    for (args, instead) in [
        ("run log.csv", "murmuration check --data log.csv"),
        ("sweep log.txt", "murmuration check --data log.txt"),
        ("check log.csv", "murmuration check --data log.csv"),
        ("check zipped", "murmuration check --data zipped"),
        ("convert log.csv", "murmuration import log.csv"),
        ("compare log.csv", "murmuration compare MODEL.toml --data log.csv"),
        ("diagnose log.txt", "murmuration diagnose MODEL.toml --data log.txt"),
        ("compare log.csv --data model.toml", "murmuration compare model.toml --data log.csv"),
        ("diagnose log.csv --data model.toml", "murmuration diagnose model.toml --data log.csv"),
        (
            "simulate log.csv --like model.toml --output x.csv",
            "murmuration simulate model.toml --like log.csv",
        ),
        ("compare log.csv --data log.txt", "murmuration compare MODEL.toml"),
        ("compare model.toml --data model.toml", "murmuration compare model.toml --data TABLE.csv"),
        ("check --data model.toml", "murmuration check --data TABLE.csv"),
        ("check map.toml", "murmuration convert map.toml"),
        ("run map.toml", "murmuration convert map.toml"),
        ("convert map.toml --json absent/map.json", "there is no folder absent; make it first"),
    ] {
        let said = refused(args, dir.path());
        assert!(said.contains(instead), "{args}: {said}");
        let errors = said.lines().filter(|line| line.starts_with("error: ")).count();
        // The status stands on a line before.
        assert_eq!((errors, said.lines().count()), (1, 2), "{args}: {said}");
    }
    // What is TOML is read as TOML, whatever its name.
    std::fs::write(dir.path().join("model.csv"), MODEL).unwrap();
    let said = refused("check model.csv", dir.path());
    assert!(said.contains("experiment.name: is missing"), "{said}");
}

#[test]
fn a_name_that_does_not_exist_leads_to_the_nearest_one_that_does() {
    let dir = folder();
    std::fs::write(dir.path().join("model.toml"), MODEL).unwrap();
    std::fs::write(dir.path().join("links.csv"), LOG).unwrap();
    std::fs::create_dir(dir.path().join("flocking")).unwrap();
    for (args, nearest) in [
        ("run modle.toml", "model.toml"),
        ("check modle.toml", "model.toml"),
        ("convert modle.toml", "model.toml"),
        ("compare model.toml --data lnks.csv", "links.csv"),
        ("compare model.toml --data links.csv --positions lnks.csv", "links.csv"),
        ("power model.toml --like lnks.csv --effect shadowing", "links.csv"),
        ("verify floking", "flocking"),
        ("replay floking", "flocking"),
        ("export floking --format csv", "flocking"),
        ("compare-runs floking flocking", "flocking"),
    ] {
        let said = refused(args, dir.path());
        assert!(said.contains(&format!("does not exist (nearest: {nearest})")), "{args}: {said}");
    }
}

#[test]
fn a_table_without_the_columns_of_measurements_leads_to_import() {
    let dir = folder();
    std::fs::write(dir.path().join("model.toml"), MODEL).unwrap();
    std::fs::write(dir.path().join("log.csv"), "t,a,b,level\n1,2,3,-70\n").unwrap();
    for args in [
        "check --data log.csv",
        "check model.toml --data log.csv",
        "compare model.toml --data log.csv",
        "diagnose model.toml --data log.csv",
        "extend model.toml --data log.csv --all --output x.toml",
    ] {
        let said = refused(args, dir.path());
        assert!(said.contains("murmuration import log.csv"), "{args}: {said}");
    }
}

#[test]
fn extend_replaces_a_file_only_if_it_is_asked_to() {
    let dir = folder();
    std::fs::write(dir.path().join("model.toml"), MODEL).unwrap();
    let rows: String =
        (0..60).map(|k| format!("{k},1,2,0,0,{},0,{},1\n", 5 + k, -60 - k / 2)).collect();
    let head = "time_s,tx,rx,tx_x_m,tx_y_m,rx_x_m,rx_y_m,rssi_dbm,received\n";
    std::fs::write(dir.path().join("links.csv"), format!("{head}{rows}")).unwrap();
    let better = dir.path().join("better.toml");
    std::fs::write(&better, "mine\n").unwrap();
    let args = "extend model.toml --data links.csv --effect system-gain --output better.toml";
    let text = refused(args, dir.path());
    assert!(text.contains("better.toml: the file exists") && text.contains("--replace"), "{text}");
    assert_eq!(std::fs::read_to_string(&better).unwrap(), "mine\n");
    let words: Vec<&str> = args.split(' ').chain(["--replace"]).collect();
    let output = orchestrator(&words, dir.path());
    assert!(output.status.success(), "{}", said(&output));
    assert!(std::fs::read_to_string(&better).unwrap().contains("system-gain"));
}
