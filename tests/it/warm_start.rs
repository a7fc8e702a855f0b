//! Runs and sweeps that start from a formed network.

use crate::resuming::{killed, unfinished};
use crate::sweeps::{number, rows};
use parquet::record::Field;
use proto::rng::{Draws, Purpose};
use record::formed::{FormedError, FormedNetwork};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use tests::fake::{Fault, Faulty};
use tests::recording::{assert_same, read_recording};

/// Robots that fly, over MSF, which draws at random what it sends when; robots measure their positions with noise.
const EXPERIMENT: &str = "[experiment]\nname = \"w\"\nseed = 1\nduration_s = 20.0\nagents = 8\n\
    control_period = { rate_hz = 1.0 }\n\
    [robotsim.scenario]\nkind = \"disc\"\ndensity_per_m2 = 0.01\n\
    [robotsim.controller]\nkind = \"flocking\"\nflock_radius_m = 30.0\n\
    [[robotsim.dynamics.effect]]\nkind = \"localization\"\nsd_m = 0.1\n\
    [netsim]\nmode = \"6tisch\"\n\
    [netsim.phy]\npropagation = \"log-distance\"\nexponent = 3.0\n\
    [[netsim.phy.effect]]\nkind = \"shadowing\"\nsd_db = 2.0\n\
    [netsim.sf]\nkind = \"msf\"\n\
    [[netsim.app]]\nkind = \"periodic\"\nperiod_s = 5.0\npayload_bytes = 40\n\
    [output]\npcap = true\n";

/// A folder with `w.toml`, the result of a run in `cold`, and the network that formed in it in `formed`.
fn formed() -> TempDir {
    let folder = tests::folder();
    std::fs::write(folder.path().join("w.toml"), EXPERIMENT).unwrap();
    finished(&["run", "w.toml", "--out", "cold", "--save-formed", "formed"], folder.path());
    folder
}

fn finished(args: &[&str], folder: &Path) -> String {
    let output = tests::orchestrator(args, folder);
    assert!(output.status.success(), "{}", tests::said(&output));
    tests::said(&output)
}

fn refused(args: &[&str], folder: &Path) -> String {
    let output = tests::orchestrator(args, folder);
    assert_eq!(output.status.code(), Some(2), "{}", tests::said(&output));
    tests::said(&output)
}

/// A run that starts from the formed network. Returns its folder.
fn warm(folder: &Path, out: &str, more: &[&str]) -> PathBuf {
    let args = ["run", "w.toml", "--set", WARM, "--out", out];
    finished(&[&args, more].concat(), folder);
    folder.join(out).join("w")
}

const WARM: &str = "experiment.warm_start=\"formed\"";

fn summary(dir: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(dir.join("summary.json")).unwrap()).unwrap()
}

#[test]
fn with_the_seed_of_the_file_it_is_the_run_that_formed_the_network() {
    let folder = formed();
    let cold = folder.path().join("cold/w");
    let run = warm(folder.path(), "warm", &[]);
    assert_same(&cold, &run);
    let config = std::fs::read_to_string(run.join("config.toml")).unwrap();
    let file = std::fs::read(folder.path().join("formed")).unwrap();
    let sha256 = proto::digest::hex(&proto::digest::of_bytes(&file));
    assert!(config.contains(&format!("warm_start_sha256 = \"{sha256}\"")), "{config}");
    let folder_of_run = run.to_str().unwrap();
    finished(&["verify", folder_of_run], folder.path());
    let said = refused(&["reproduce", folder_of_run], folder.path());
    assert!(said.contains("experiment.warm_start") && said.contains("--allow-file"), "{said}");
    let reproduce = ["reproduce", folder_of_run, "--allow-file", "formed"];
    finished(&reproduce, folder.path());
    // Another file in the place of the one that it started from.
    let [saved, w] = ["other-formed", "w.toml"];
    let args = ["run", w, "--seed", "2", "--out", "other", "--save-formed", saved];
    finished(&args, folder.path());
    std::fs::rename(folder.path().join(saved), folder.path().join("formed")).unwrap();
    let said = refused(&reproduce, folder.path());
    assert!(said.contains("experiment.warm_start_sha256: is not the checksum"), "{said}");
}

#[test]
fn other_seeds_give_other_runs_of_the_same_formed_network() {
    let folder = formed();
    let seed = |out: &str, seed: &str, more: &[&str]| {
        warm(folder.path(), out, &[&["--seed", seed], more].concat())
    };
    let five = seed("five", "5", &[]);
    assert_same(&five, &seed("again", "5", &["--threads", "1"]));
    let unary = ["--set", "experiment.transport=\"unary\"", "--threads", "3"];
    assert_same(&five, &seed("unary", "5", &unary));
    let six = seed("six", "6", &[]);
    let (a, b) = (read_recording(&five), read_recording(&six));
    assert_ne!(a["run.mcap"], b["run.mcap"]);
    assert_ne!(a["radio.pcap"], b["radio.pcap"]);
    let (a, b) = (summary(&five), summary(&six));
    let cold = summary(&folder.path().join("cold/w"));
    assert_eq!((&a["seed"], &b["seed"]), (&5.into(), &6.into()));
    for run in [&a, &b] {
        assert_eq!(run["kpis"]["formation"], cold["kpis"]["formation"]);
        assert_eq!(run["steps"], cold["steps"]);
    }
    assert_ne!(a["kpis"], b["kpis"]);
    for run in [&five, &six] {
        let run = run.to_str().unwrap();
        finished(&["verify", run], folder.path());
        finished(&["reproduce", run, "--allow-file", "formed"], folder.path());
    }
}

#[test]
fn killed_and_resumed_it_leaves_the_same_bytes_without_the_file() {
    let folder = formed();
    let path = folder.path();
    let more = ["--seed", "5", "--set", "experiment.duration_s=1500"];
    let whole = warm(path, "whole", &more);
    let args = ["run", "w.toml", "--set", WARM, "--out", "killed"];
    let args: Vec<String> = [&args[..], &more].concat().iter().map(|&it| it.to_owned()).collect();
    let left = killed(&args, path, "killed");
    std::fs::remove_file(path.join("formed")).unwrap();
    finished(&["run", "--resume", left.to_str().unwrap()], path);
    let resumed = path.join("killed/w");
    assert_same(&whole, &resumed);
    let config = |dir: &Path| std::fs::read(dir.join("config.toml")).unwrap();
    assert_eq!(config(&whole), config(&resumed));
    assert_eq!(unfinished(&path.join("killed")), Vec::<PathBuf>::new());
}

#[test]
fn everything_that_differs_from_the_experiment_that_formed_it_is_listed() {
    let folder = formed();
    let sets = [
        WARM,
        "experiment.control_period={ rate_hz = 2.0 }",
        "netsim.phy.exponent=2.5",
        "netsim.sf.kind=\"orchestra\"",
        "robotsim.controller.flock_radius_m=20.0",
        "site.wall=[{ from_m = [1.0, 1.0], to_m = [4.0, 1.0] }]",
    ];
    let sets = sets.iter().flat_map(|&set| ["--set", set]);
    let args: Vec<&str> = ["run", "w.toml"].into_iter().chain(sets).collect();
    let said = refused(&args, folder.path());
    for key in [
        "experiment.control_period: must be 1 s",
        "netsim.phy.exponent: must be 3.0",
        "netsim.sf.kind: must be \"msf\"",
        "robotsim.controller.flock_radius_m: must be 30.0",
        "site.wall",
    ] {
        assert!(said.contains(key), "{key}: {said}");
    }
    let with = |set: &str| refused(&["run", "w.toml", "--set", WARM, "--set", set], folder.path());
    let said = with("experiment.agents=9");
    assert!(said.contains("experiment.agents: must be 8"), "{said}");
    let said = with("experiment.start=\"at-once\"");
    assert!(said.contains("experiment.start: must be \"when-formed\""), "{said}");
    let said = with("experiment.warm_start=\"absent\"");
    assert!(said.contains("experiment.warm_start: names a file that cannot be read"), "{said}");
    let said = with("experiment.warm_start=\"w.toml\"");
    assert!(said.contains("is not a formed network"), "{said}");
    let said = with("experiment.warm_start_sha256=\"12\"");
    assert!(said.contains("must be 64 hexadecimal digits"), "{said}");
    let flocking = tests::repository().join("configs/flocking.toml");
    let file = folder.path().join("formed");
    let set = format!("experiment.warm_start={:?}", file.to_str().unwrap());
    let said = refused(&["run", flocking.to_str().unwrap(), "--set", &set], folder.path());
    assert!(said.contains("requires a network that forms"), "{said}");
    // Nothing else matters to a network that has formed.
    let more = ["--set", "experiment.duration_s=3", "--set", "output.pcap=false"];
    warm(folder.path(), "shorter", &more);
    // What was not kept while it formed cannot be recorded.
    let args = ["run", "w.toml", "--set", "output.pcap=false", "--save-formed", "formed"];
    finished(&[&args[..], &["--out", "without"]].concat(), folder.path());
    let said = refused(&["run", "w.toml", "--set", WARM], folder.path());
    assert!(said.contains("output: asks for what the formed network does not keep"), "{said}");
}

#[test]
fn a_file_cut_off_anywhere_or_changed_is_refused() {
    let folder = formed();
    let path = folder.path().join("formed");
    let whole = std::fs::read(&path).unwrap();
    assert!(FormedNetwork::of_bytes(&path, &whole).is_ok());
    let draws = Draws::new(1, Purpose::Resample);
    let drawn = (0..200).map(|k| draws.words(k, 0, 0)[0] as usize % whole.len());
    for length in (0..100).chain(drawn.clone()).chain([whole.len() - 1]) {
        match FormedNetwork::of_bytes(&path, &whole[..length]) {
            Err(FormedError::Foreign | FormedError::Damaged { .. }) => {}
            other => panic!("{length}: {other:?}"),
        }
    }
    for place in drawn {
        let mut changed = whole.clone();
        changed[place] ^= 1 << (place % 8);
        assert!(FormedNetwork::of_bytes(&path, &changed).is_err(), "{place}");
    }
    // Of another version, with a checksum that is right.
    let version = env!("CARGO_PKG_VERSION").as_bytes();
    let at = whole.windows(version.len()).position(|it| it == version).unwrap();
    let mut other = whole.clone();
    other[at + version.len() - 1] ^= 1;
    let checksum = proto::digest::of_bytes(&other[40..]);
    other[8..40].copy_from_slice(&checksum);
    std::fs::write(&path, &other).unwrap();
    let said = refused(&["run", "w.toml", "--set", WARM], folder.path());
    assert!(said.contains("was written by version"), "{said}");
    std::fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    let said = refused(&["run", "w.toml", "--set", WARM], folder.path());
    assert!(said.contains("is damaged: its checksum is wrong"), "{said}");
}

#[test]
fn a_network_that_cannot_be_saved_leaves_no_file() {
    let folder = tests::folder();
    std::fs::write(folder.path().join("w.toml"), EXPERIMENT).unwrap();
    let save = ["run", "w.toml", "--save-formed", "formed"];
    let args = [&save[..], &["--set", "experiment.formation_limit_s=5"]].concat();
    let output = tests::orchestrator(&args, folder.path());
    let said = tests::said(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("formed was not written, since the network had not formed"), "{said}");
    let args = [&save[..], &["--set", "experiment.start=\"at-once\""]].concat();
    let said = refused(&args, folder.path());
    assert!(said.contains("--save-formed formed: the robots of this experiment do not"), "{said}");
    let network = Faulty::network(Fault::NoSnapshots);
    let said = refused(&[&save[..], &["--netsim", &network.url]].concat(), folder.path());
    assert!(said.contains("does not support snapshots"), "{said}");
    assert!(!folder.path().join("formed").exists());
    let names = std::fs::read_dir(folder.path()).unwrap();
    let names: BTreeSet<_> = names.map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(names, ["runs", "w.toml"].map(Into::into).into());
}

#[test]
fn a_simulator_that_cannot_be_given_another_seed_is_named() {
    let folder = formed();
    let network = Faulty::network(Fault::NoSnapshots);
    let args = ["run", "w.toml", "--set", WARM, "--netsim", &network.url];
    let said = refused(&args, folder.path());
    assert!(said.contains("does not support restoring a snapshot with another seed"), "{said}");
}

#[test]
fn trials_of_a_sweep_start_from_it_each_with_its_own_seed() {
    let folder = formed();
    let text = EXPERIMENT.replace("seed = 1\n", "seed = 5\nwarm_start = \"formed\"\n");
    let sweep = |vary: &str| {
        std::fs::write(folder.path().join("s.toml"), format!("{text}[sweep]\n{vary}")).unwrap();
    };
    sweep("seeds = 3\n[sweep.vary]\nexperiment.duration_s = [10.0, 20.0]\n");
    finished(&["sweep", "s.toml", "--out", "a", "--jobs", "1"], folder.path());
    finished(&["sweep", "s.toml", "--out", "b", "--jobs", "3"], folder.path());
    let table =
        |out: &str| std::fs::read(folder.path().join(out).join("w/trials.parquet")).unwrap();
    assert!(table("a") == table("b"));
    let rows = rows(&folder.path().join("a/w/trials.parquet"));
    assert_eq!(rows.len(), 6);
    let column = |name: &str| -> BTreeSet<u64> {
        rows.iter().map(|row| number(row, name).to_bits()).collect()
    };
    assert_eq!(column("kpis.formation.formed_s").len(), 1);
    assert_eq!(column("kpis.delivery.latency_s.mean").len(), 6);
    // Each row is that of a run of its own.
    let of_run = summary(&warm(folder.path(), "run", &["--seed", "6"]));
    let is_same = |row: &&BTreeMap<String, Field>| {
        number(row, "experiment.seed") == 6.0 && number(row, "experiment.duration_s") == 20.0
    };
    let row = rows.iter().find(is_same).unwrap();
    for figure in ["/kpis/delivery/ratio", "/kpis/delivery/latency_s/mean", "/task/flock_speed_mps"]
    {
        let name = figure[1..].replace('/', ".");
        let expected = of_run.pointer(figure).unwrap().as_f64().unwrap();
        assert_eq!(number(row, &name).to_bits(), expected.to_bits(), "{name}");
    }
    sweep("seeds = 2\n[sweep.vary]\nnetsim.phy.exponent = [3.0, 2.8]\n");
    let said = refused(&["sweep", "s.toml"], folder.path());
    assert!(said.contains("netsim.phy.exponent: must be 3.0"), "{said}");
}
