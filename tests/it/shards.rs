//! `murmuration sweep --shard` and `--merge`: parts of a sweep that run on several machines.

use std::collections::BTreeMap;
use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;
use tests::fake::{Fault, Faulty};

/// Trials of a sweep: two settings that take longer than the two others, each with five seeds.
const N_TRIALS: usize = 20;
const SWEEP: &str = "[experiment]\nname = \"s\"\nseed = 3\nduration_s = 1.0\n\
    [robotsim.scenario]\nkind = \"disc\"\ndensity_per_m2 = 0.1\n\
    [robotsim.controller]\nkind = \"flocking\"\nflock_radius_m = 10.0\n\
    [netsim.phy]\npropagation = \"full\"\n\
    [sweep]\nseeds = 5\n[sweep.vary]\nexperiment.agents = [4, 8]\n\
    \"netsim.phy.propagation\" = [\"full\", \"experimental-randomness\"]\n";

/// What a sweep leaves, whoever ran which trial when.
const RESULTS: [&str; 4] = ["sweep.toml", "trials.parquet", "summary.json", "report.html"];

fn folder() -> TempDir {
    let folder = tests::folder();
    std::fs::write(folder.path().join("s.toml"), SWEEP).unwrap();
    folder
}

fn sweep(folder: &Path, args: &str) -> Output {
    let args: Vec<&str> = ["sweep", "s.toml"].into_iter().chain(args.split(' ')).collect();
    tests::orchestrator(&args, folder)
}

fn succeeds(folder: &Path, args: &str) -> String {
    let output = sweep(folder, args);
    assert!(output.status.success(), "{args}: {}", tests::said(&output));
    tests::said(&output)
}

fn refused(folder: &Path, args: &str) -> String {
    let output = sweep(folder, args);
    assert_eq!(output.status.code(), Some(2), "{args}: {}", tests::said(&output));
    tests::said(&output)
}

fn results(dir: &Path) -> BTreeMap<&'static str, Vec<u8>> {
    RESULTS.map(|name| (name, std::fs::read(dir.join(name)).unwrap())).into()
}

fn journal(folder: &Path, name: &str) -> PathBuf {
    folder.join("runs/s").join(name)
}

fn n_lines(path: &Path) -> usize {
    std::fs::read_to_string(path).unwrap().lines().count()
}

fn assert_no_results(folder: &Path) {
    for name in RESULTS.iter().chain(&["provenance.json", "trials.jsonl"]) {
        assert!(!folder.join("runs/s").join(name).exists(), "{name} was written");
    }
}

#[test]
fn shards_killed_resumed_moved_and_merged_leave_the_bytes_of_the_whole_sweep() {
    let folder = folder();
    succeeds(folder.path(), "--out whole");
    let said = succeeds(folder.path(), "--shard 1/3");
    assert!(said.contains("s: shard 1/3 has 7 of 20 trials; "), "{said}");
    assert!(said.contains("run murmuration sweep s.toml --merge"), "{said}");
    // The second was killed while it wrote its fourth line.
    succeeds(folder.path(), "--shard=2/3 --jobs 1");
    let second = journal(folder.path(), "trials-2-of-3.jsonl");
    let bytes = std::fs::read(&second).unwrap();
    let ends: Vec<usize> =
        (1..).zip(&bytes).filter(|(_, b)| **b == b'\n').map(|(n, _)| n).collect();
    std::fs::write(&second, &bytes[..(ends[2] + ends[3]) / 2]).unwrap();
    let said = refused(folder.path(), "--merge");
    assert!(said.contains("runs/s: nothing was merged. Missing: 10 of 20 trials"), "{said}");
    let missing = "shard 2/3 lacks 4 of its 7 trials; run murmuration sweep s.toml --shard 2/3\n";
    assert!(said.contains(missing), "{said}");
    let said = succeeds(folder.path(), "--shard 2/3");
    assert!(said.contains("shard 2/3 has 7 of 20 trials, 3 of them finished earlier; "), "{said}");
    assert_eq!(n_lines(&second), 7);
    // The third ran on a machine that shares no files.
    let elsewhere = self::folder();
    succeeds(elsewhere.path(), "--shard 3/3 --out there");
    let name = "trials-3-of-3.jsonl";
    std::fs::copy(elsewhere.path().join("there/s").join(name), journal(folder.path(), name))
        .unwrap();
    assert_no_results(folder.path());
    let journals = || {
        (1..=3).map(|i| {
            std::fs::read(journal(folder.path(), &format!("trials-{i}-of-3.jsonl"))).unwrap()
        })
    };
    let before: Vec<Vec<u8>> = journals().collect();
    let said = succeeds(folder.path(), "--merge");
    assert!(said.contains("s: 20 trials of 3 shards merged\n"), "{said}");
    let whole = results(&folder.path().join("whole/s"));
    assert_eq!(results(&folder.path().join("runs/s")), whole);
    assert_eq!(journals().collect::<Vec<_>>(), before);
    // Merged again, or run as a whole after that, nothing changes and nothing is run.
    succeeds(folder.path(), "--merge");
    assert_eq!(n_lines(&journal(folder.path(), "trials.jsonl")), N_TRIALS);
    let said = succeeds(folder.path(), "--jobs 2");
    assert!(said.contains("20 trials, 20 of them finished earlier"), "{said}");
    assert_eq!(results(&folder.path().join("runs/s")), whole);
}

#[test]
fn every_trial_is_in_one_shard_and_shards_take_about_as_long() {
    let folder = folder();
    let mut keys = Vec::new();
    for i in 1..=4 {
        succeeds(folder.path(), &format!("--shard {i}/4"));
        let lines =
            std::fs::read_to_string(journal(folder.path(), &format!("trials-{i}-of-4.jsonl")));
        let lines = lines.unwrap();
        assert_eq!(lines.lines().count(), 5);
        keys.extend(lines.lines().map(|line| line.split(',').next().unwrap().to_owned()));
    }
    keys.sort();
    keys.dedup();
    assert_eq!(keys.len(), N_TRIALS);
    succeeds(folder.path(), "--merge");
}

#[test]
fn shards_of_one_folder_run_at_the_same_time_and_keep_recordings() {
    let folder = folder();
    let keep = "--set sweep.keep=first-seed";
    succeeds(folder.path(), &format!("--out whole {keep}"));
    std::thread::scope(|scope| {
        for i in 1..=3 {
            let folder = folder.path();
            scope.spawn(move || succeeds(folder, &format!("--shard {i}/3 --jobs 1 {keep}")));
        }
    });
    // As if the recording of one trial had not been copied.
    let lost = folder.path().join("runs/s/runs/setting-2-seed-3");
    std::fs::remove_dir_all(&lost).unwrap();
    let said = refused(folder.path(), &format!("--merge {keep}"));
    assert!(said.contains("Missing: the recordings of 1 of 20 trials"), "{said}");
    let command = said.lines().last().unwrap().split("sweep s.toml ").nth(1).unwrap().to_owned();
    assert!(command.starts_with(keep) && command.contains(" --shard "), "{said}");
    // A repeated trial is there twice, with equal results.
    succeeds(folder.path(), &command);
    succeeds(folder.path(), &format!("--merge {keep}"));
    assert_eq!(results(&folder.path().join("runs/s")), results(&folder.path().join("whole/s")));
    assert!(lost.join("summary.json").exists());
}

#[test]
fn missing_and_overlapping_shards_and_those_of_another_sweep_are_refused() {
    let folder = folder();
    let said = refused(folder.path(), "--merge --out runs");
    let first = "Run murmuration sweep s.toml --out runs --shard i/n for each i from 1 to n first";
    assert!(said.contains("runs/s holds no shards. ") && said.contains(first), "{said}");
    succeeds(folder.path(), "--shard 1/2");
    let said = refused(folder.path(), "--merge");
    let missing = "shard 2/2 has no journal here and lacks 10 of its 10 trials; copy the journal, or run murmuration sweep s.toml --shard 2/2";
    assert!(said.contains("Missing: 10 of 20 trials") && said.contains(missing), "{said}");
    // Shards of another number.
    let overlap = "runs/s: the sweep was split into different numbers of shards, which overlap: ";
    let said = refused(folder.path(), "--shard 2/3");
    assert!(
        said.contains(&format!("{overlap}2 (trials-1-of-2.jsonl), 3 (trials-2-of-3.jsonl)")),
        "{said}"
    );
    assert!(!journal(folder.path(), "trials-2-of-3.jsonl").exists());
    let other = self::folder();
    succeeds(other.path(), "--shard 3/3");
    let stray = journal(folder.path(), "trials-3-of-3.jsonl");
    std::fs::copy(journal(other.path(), "trials-3-of-3.jsonl"), &stray).unwrap();
    succeeds_not_merged(folder.path(), overlap);
    std::fs::remove_file(stray).unwrap();
    // A whole sweep does not begin beside shards.
    let said = refused(folder.path(), "--jobs 1");
    assert!(said.contains("runs/s holds shards of a sweep. Run the other shards"), "{said}");
    // Another duration, other seeds: other trials.
    let longer = "--set experiment.duration_s=1.5";
    succeeds(folder.path(), "--shard 2/2");
    for (args, n) in [(longer, 10), ("--set sweep.seeds=4", 2)] {
        for what in ["--merge", "--shard 2/2"] {
            let said = refused(folder.path(), &format!("{what} {args}"));
            let foreign = format!("of-2.jsonl: {n} of its 10 trials are not trials of this sweep");
            assert!(said.contains(&foreign), "{said}");
        }
    }
    assert_no_results(folder.path());
    succeeds(folder.path(), "--merge");
}

fn succeeds_not_merged(folder: &Path, problem: &str) {
    let said = refused(folder, "--merge");
    assert!(said.contains(problem), "{said}");
    assert_no_results(folder);
}

#[test]
fn two_results_of_one_trial_are_refused_and_equal_ones_are_not() {
    let folder = folder();
    succeeds(folder.path(), "--shard 1/2");
    succeeds(folder.path(), "--shard 2/2");
    let [first, second] = [1, 2].map(|i| journal(folder.path(), &format!("trials-{i}-of-2.jsonl")));
    let [lines, others] = [&first, &second].map(|path| std::fs::read_to_string(path).unwrap());
    let repeated = lines.lines().next().unwrap();
    // As a program with other code and without checksums wrote it: in the journal of the other shard, with another number.
    let (unchecked, _) = repeated.rsplit_once(",\"checksum\"").unwrap();
    let (before, program) = unchecked.split_once("\"program\":\"").unwrap();
    let changed = format!("{before}\"program\":\"x{program}}}")
        .replace("\"simulated_s\":1.0", "\"simulated_s\":2.0");
    assert!(changed.contains("\"simulated_s\":2.0"), "{changed}");
    std::fs::write(&second, format!("{others}{changed}\n")).unwrap();
    let different =
        "has different results in runs/s/trials-1-of-2.jsonl and runs/s/trials-2-of-2.jsonl";
    succeeds_not_merged(folder.path(), different);
    // A damaged line is a missing trial.
    std::fs::write(
        &second,
        others.replacen("\"status\":\"complete\"", "\"status\":\"completed\"", 1),
    )
    .unwrap();
    let said = refused(folder.path(), "--merge");
    assert!(said.contains("trials-2-of-2.jsonl:1: is damaged"), "{said}");
    assert!(said.contains("shard 2/2 lacks 1 of its 10 trials"), "{said}");
    std::fs::write(&second, format!("{others}{repeated}\n")).unwrap();
    succeeds(folder.path(), "--merge");
}

#[test]
fn impossible_shards_and_options_that_exclude_each_other_are_refused() {
    let folder = folder();
    for value in ["0/3", "4/3", "a/b", "1", "1/0", "+1/3", "1/3/3", ""] {
        let said = refused(folder.path(), &format!("--shard={value}"));
        assert!(
            said.contains("must be i/n, shard i of n, with whole numbers 1 ≤ i ≤ n ≤ 1000000"),
            "{value}: {said}"
        );
    }
    let said = refused(folder.path(), "--shard 5/21");
    assert!(
        said.contains("--shard 5/21: the sweep has only 20 trials; use at most 20 shards"),
        "{said}"
    );
    for other in ["--shard 1/3", "--restart", "--dry-run", "--jobs 2", "--threads 2"] {
        let said = refused(folder.path(), &format!("--merge {other}"));
        assert!(said.contains("cannot be used with"), "{said}");
    }
    let said = refused(folder.path(), "--shard 1/3 --json -");
    assert!(said.contains("--json: a shard has no results of the sweep"), "{said}");
    assert!(!folder.path().join("runs").exists(), "something was written");
    let said = succeeds(folder.path(), "--shard 1/3 --dry-run");
    assert!(said.contains("s: 7 trials of "), "{said}");
}

#[test]
fn failed_trials_are_merged_and_their_shards_are_named() {
    // The network breaks the contract in step 3: shorter trials succeed.
    let network = Faulty::network(Fault::WrongStep);
    let folder = folder();
    let text =
        SWEEP.split("[sweep]").next().unwrap().replace("[robotsim.s", "agents = 4\n[robotsim.s");
    let varied = "[sweep]\nseeds = 2\n[sweep.vary]\nexperiment.duration_s = [0.05, 2.0]\n";
    std::fs::write(folder.path().join("s.toml"), text + varied).unwrap();
    let run = |args: &str, status: i32| {
        let output = sweep(folder.path(), &format!("--netsim {} {args}", network.url));
        assert_eq!(output.status.code(), Some(status), "{}", tests::said(&output));
        tests::said(&output)
    };
    run("--out whole", 1);
    // The longest trials first: one of them in each of the first two shards.
    let said = run("--shard 2/3", 1);
    assert!(said.contains("1 of 1 trials of the shard failed. Run the same command"), "{said}");
    run("--shard 1/3", 1);
    run("--shard 3/3", 0);
    let said = run("--merge", 1);
    let retry = "2 of 4 trials failed; the table has all others. Run --shard 1/3, --shard 2/3 again to retry them, then --merge";
    assert!(said.contains(retry), "{said}");
    assert_eq!(results(&folder.path().join("runs/s")), results(&folder.path().join("whole/s")));
}

#[test]
fn builds_of_the_same_code_are_one_program_and_other_code_is_named() {
    let folder = folder();
    succeeds(folder.path(), "--shard 1/2");
    // The same code in other bytes, as where a package strips its program.
    let mut bytes = std::fs::read(tests::executable("murmuration")).unwrap();
    bytes.push(0);
    let other = folder.path().join("murmuration");
    std::fs::write(&other, bytes).unwrap();
    std::fs::set_permissions(&other, Permissions::from_mode(0o755)).unwrap();
    let output = Command::new(&other)
        .args(["sweep", "s.toml", "--shard", "2/2"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", tests::said(&output));
    let said = succeeds(folder.path(), "--merge");
    assert!(!said.contains("the code"), "{said}");
    let said = succeeds(folder.path(), "--shard 2/2");
    assert!(!said.contains("other code"), "{said}");

    // Without checksums, as the journal of an older program.
    let shard = journal(folder.path(), "trials-2-of-2.jsonl");
    let lines = std::fs::read_to_string(&shard).unwrap();
    let changed: Vec<String> = lines
        .lines()
        .map(|line| {
            let (unchecked, _) = line.rsplit_once(",\"checksum\"").unwrap();
            let (before, after) = unchecked.split_once("\"program\":\"").unwrap();
            format!("{before}\"program\":\"x{after}}}\n")
        })
        .collect();
    std::fs::write(&shard, changed.concat()).unwrap();
    std::fs::remove_file(journal(folder.path(), "trials.jsonl")).unwrap();
    let said = succeeds(folder.path(), "--shard 2/2");
    assert!(said.contains("10 trials were run by a program with other code"), "{said}");
    let said = succeeds(folder.path(), "--merge");
    assert!(said.contains("programs with 2 versions of the code ran the trials"), "{said}");
}
