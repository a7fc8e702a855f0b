//! A bit that flips in a file of a result is noticed by whoever reads it.

use export::{ExportFormat, export};
use proto::rng::philox4x64;
use record::result::{ResultFolder, Trust};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use sweep::compare_runs::compare_runs;
use view::page;
use view::recorded::RecordedRun;

/// What one way to read a result gives: bytes, or why not.
type Outcome = Result<Vec<u8>, String>;

fn text(error: impl ToString) -> String {
    error.to_string()
}

/// All files of a folder, one after the other.
fn content(folder: &Path) -> Vec<u8> {
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.iter().flat_map(|file| std::fs::read(file).unwrap()).collect()
}

fn exported(run: &Path, trust: Trust, format: ExportFormat) -> Outcome {
    let folder = tests::folder();
    let out = folder.path().join("out");
    export(&ResultFolder::open(run, trust).map_err(text)?, format, &out).map_err(text)?;
    Ok(content(&out))
}

fn recorded(run: &Path, trust: Trust) -> Result<RecordedRun, String> {
    RecordedRun::open(&ResultFolder::open(run, trust).map_err(text)?).map_err(text)
}

/// What every reader makes of a run. `plain` is another run, to compare with.
fn read(run: &Path, plain: &Path, trust: Trust) -> BTreeMap<&'static str, Outcome> {
    let moment = |end: fn(&RecordedRun) -> u64| -> Outcome {
        let run = recorded(run, trust)?;
        let at_ns = end(&run);
        Ok(format!("{:?}", run.frames(at_ns, at_ns, 1).map_err(text)?).into_bytes())
    };
    let page = || -> Outcome {
        let page = page::standalone(&[recorded(run, trust)?], None, 20_000_000).map_err(text)?;
        Ok(page.html.into_bytes())
    };
    let compared = || -> Outcome {
        let changes = compare_runs(run, plain, trust).map_err(text)?;
        Ok(serde_json::to_vec(&changes).unwrap())
    };
    BTreeMap::from([
        ("export csv", exported(run, trust, ExportFormat::Csv)),
        ("export rosbag2", exported(run, trust, ExportFormat::Rosbag2)),
        ("render of the beginning", moment(|_| 0)),
        ("render of the end", moment(|run| run.run().end_ns)),
        ("replay", page()),
        ("compare-runs", compared()),
    ])
}

#[test]
fn no_reader_passes_on_a_bit_that_was_flipped_in_silence() {
    let folder = tests::folder();
    let config = tests::repository().join("configs/flocking.toml");
    let plain = tests::run(&config, folder.path(), &["--set", "experiment.duration_s=6.0"]);
    let run = folder.path().join("flipped/flocking");
    std::fs::create_dir_all(&run).unwrap();
    for entry in std::fs::read_dir(&plain).unwrap() {
        let path = entry.unwrap().path();
        std::fs::copy(&path, run.join(path.file_name().unwrap())).unwrap();
    }
    let undisturbed = read(&run, &plain, Trust::Checked);
    assert!(undisturbed.values().all(Result::is_ok), "{:?}", undisturbed.keys());
    let root = record::verify(&run).unwrap().root_sha256;
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(&run).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    let mut n_refused = BTreeMap::new();
    for number in 0..200 {
        let file = &files[number % files.len()];
        let whole = std::fs::read(file).unwrap();
        let mut flipped = whole.clone();
        let [place, ..] = philox4x64([number as u64, 0, 0, 0], [7, 0]);
        let bit = (place % (8 * whole.len() as u64)) as usize;
        flipped[bit / 8] ^= 1 << (bit % 8);
        std::fs::write(file, &flipped).unwrap();
        let place = format!("bit {bit} of {}", file.display());
        for (reader, outcome) in read(&run, &plain, Trust::Checked) {
            match outcome {
                Ok(bytes) => {
                    assert!(undisturbed[reader].as_ref() == Ok(&bytes), "{reader}: {place}");
                }
                Err(error) => {
                    assert!(error.contains("flipped/flocking"), "{reader}: {place}: {error}");
                    *n_refused.entry(reader).or_insert(0) += 1;
                }
            }
        }
        let found = record::verify(&run);
        let is_found = |report: record::verify::VerifyReport| {
            !report.problems.is_empty() || report.root_sha256 != root
        };
        assert!(found.map_or(true, is_found), "verify: {place}");
        std::fs::write(file, &whole).unwrap();
    }
    // Each reader meets damage in the files that it reads.
    assert!(undisturbed.keys().all(|reader| 0 < n_refused[reader]), "{n_refused:?}");
}

#[test]
fn a_changed_file_is_named_with_its_place_and_read_with_unverified_alone() {
    let folder = tests::folder();
    let config = tests::repository().join("configs/flocking.toml");
    let run =
        tests::run(&config, &folder.path().join("runs"), &["--set", "experiment.duration_s=6.0"]);
    let table = run.join("steps.parquet");
    let mut bytes = std::fs::read(&table).unwrap();
    bytes[200] ^= 4;
    std::fs::write(&table, bytes).unwrap();
    let export = ["export", "runs/flocking", "--format", "csv", "--out", "tables"];
    let refused = tests::orchestrator(&export, folder.path());
    let said = tests::said(&refused);
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(
        said.contains("runs/flocking/steps.parquet: ") && said.contains("bytes 0 to "),
        "{said}"
    );
    assert!(said.contains("--unverified"), "{said}");
    assert!(!folder.path().join("tables").exists());
    let read = tests::orchestrator(&[&export[..], &["--unverified"]].concat(), folder.path());
    let said = tests::said(&read);
    assert!(said.contains("warning: --unverified: "), "{said}");
    for command in [
        &["reproduce", "runs/flocking"][..],
        &["compare-runs", "runs/flocking", "runs/flocking"],
        &["render", "runs/flocking", "--at", "1", "--output", "a.svg"],
    ] {
        let output = tests::orchestrator(command, folder.path());
        // Only what reads the table minds.
        let is_refused = command[0] == "reproduce";
        assert_eq!(
            output.status.code(),
            Some(i32::from(is_refused)),
            "{command:?}: {}",
            tests::said(&output)
        );
    }
}

#[test]
fn a_publication_can_cite_a_result_by_one_hash() {
    let folder = tests::folder();
    let config = tests::repository().join("configs/flocking.toml");
    let run =
        tests::run(&config, &folder.path().join("runs"), &["--set", "experiment.duration_s=1.0"]);
    let verify = |more: &[&str]| {
        tests::orchestrator(&[&["verify", "runs/flocking"], more].concat(), folder.path())
    };
    let said = tests::said(&verify(&[]));
    let root = said.lines().find_map(|line| line.strip_prefix("root SHA-256 ")).unwrap().to_owned();
    assert!(verify(&["--root", &root]).status.success());
    let log = run.join("run.log");
    let longer = format!("{}again\n", std::fs::read_to_string(&log).unwrap());
    std::fs::write(&log, longer).unwrap();
    assert!(verify(&[]).status.success());
    assert_eq!(verify(&["--root", &root]).status.code(), Some(1));
}

/// Flips a bit in a file.
fn damage(file: &Path, place: usize) {
    let mut bytes = std::fs::read(file).unwrap();
    bytes[place] ^= 4;
    std::fs::write(file, bytes).unwrap();
}

#[test]
fn a_run_that_is_read_as_measurements_is_checked_too() {
    let folder = tests::folder();
    let config = tests::repository().join("configs/flocking.toml");
    let options = ["--set", "experiment.duration_s=6.0", "--set", "output.links=all"];
    let run = tests::run(&config, &folder.path().join("runs"), &options);
    let at = |name: &str| folder.path().join(name);
    std::fs::copy(&config, at("model.toml")).unwrap();
    std::fs::write(at("data.csv"), "time_s,agent,x_m,y_m\n0,0,0,0\n1,0,1,0\n").unwrap();
    let packets: String = (0..30).map(|time_s| format!("{time_s},0,1,{time_s}.5\n")).collect();
    let packets = format!("time_s,source,destination,received_s\n{packets}");
    std::fs::write(at("packets.csv"), packets).unwrap();
    std::os::unix::fs::symlink("runs/flocking/steps.parquet", at("link.parquet")).unwrap();
    damage(&run.join("steps.parquet"), 200);
    std::fs::copy(run.join("steps.parquet"), at("copy.parquet")).unwrap();
    let said_by = |args: &[&str]| {
        let output = tests::orchestrator(args, folder.path());
        (output.status.code(), tests::said(&output))
    };
    let (run, table) = ("runs/flocking", "runs/flocking/steps.parquet");
    for command in [
        &["check", "--data", run][..],
        &["check", "--data", table],
        &["check", "--data", "link.parquet"],
        &["compare", "model.toml", "--data", run],
        &["compare", "model.toml", "--data", table, "--heard", run],
        &["compare", "model.toml", "--data", run, "--heard", run],
        &["compare", "model.toml", "--data", "packets.csv", "--positions", run],
        &["compare", "model.toml", "--data", "packets.csv", "--positions", run, "--links", table],
        &["diagnose", "model.toml", "--data", run],
        &["diagnose", "model.toml", "--between", "data.csv", table],
        &["extend", "model.toml", "--data", run, "--all", "--output", "a.toml"],
        &["simulate", "model.toml", "--like", table, "--output", "a.csv"],
        &["power", "model.toml", "--like", table, "--effect", "wind"],
    ] {
        let (status, said) = said_by(command);
        assert_eq!(status, Some(1), "{command:?}: {said}");
        let has_place = said.contains(".parquet: bytes 0 to ");
        assert!(has_place && said.contains("--unverified"), "{command:?}: {said}");
        if command[0] != "check" {
            continue;
        }
        let (_, said) = said_by(&[command, &["--unverified"]].concat());
        assert_eq!(said.matches("warning: --unverified: ").count(), 1, "{command:?}: {said}");
        assert!(!said.contains("are not what the run wrote"), "{command:?}: {said}");
    }
    // What belongs to no result is read as before; what a result does not list is not.
    let (_, said) = said_by(&["check", "--data", "copy.parquet"]);
    assert!(!said.contains("provenance.json"), "{said}");
    std::fs::rename(at("copy.parquet"), at("runs/flocking/other.parquet")).unwrap();
    let (status, said) = said_by(&["check", "--data", "runs/flocking/other.parquet"]);
    assert!(status == Some(1) && said.contains("does not list it"), "{said}");
}

#[test]
fn damage_of_a_recording_or_a_summary_is_named_with_its_place() {
    let folder = tests::folder();
    let config = tests::repository().join("configs/flocking.toml");
    let options = ["--set", "experiment.duration_s=6.0"];
    let run = tests::run(&config, &folder.path().join("runs"), &options);
    let intact = std::fs::read(run.join("run.mcap")).unwrap();
    let refused = |command: &[&str], part: &str| {
        let output = tests::orchestrator(command, folder.path());
        let said = tests::said(&output);
        assert_eq!(output.status.code(), Some(1), "{command:?}: {said}");
        assert!(said.contains(part) && said.contains("--unverified"), "{command:?}: {said}");
    };
    damage(&run.join("run.mcap"), intact.len() / 2);
    for command in [
        &["render", "runs/flocking", "--at", "1", "--output", "a.svg"][..],
        &["replay", "runs/flocking", "--output", "a.html"],
        &["export", "runs/flocking", "--format", "rosbag2", "--out", "bag"],
        &["reproduce", "runs/flocking"],
    ] {
        refused(command, "runs/flocking/run.mcap: bytes 0 to ");
    }
    std::fs::write(run.join("run.mcap"), intact).unwrap();
    damage(&run.join("summary.json"), 3);
    let compared = ["compare-runs", "runs/flocking", "runs/flocking"];
    refused(&compared, "runs/flocking/summary.json: bytes 0 to ");
    let other = tests::orchestrator(&["compare-runs", ".", "runs/flocking"], folder.path());
    assert_eq!(other.status.code(), Some(2), "{}", tests::said(&other));
}

#[test]
fn a_sweep_is_verified_with_the_runs_that_it_keeps() {
    let folder = tests::folder();
    let text = "[experiment]\nname = \"s\"\nseed = 3\nduration_s = 1.0\nagents = 3\n\
                [robotsim.scenario]\nkind = \"line\"\n[robotsim.controller]\nkind = \"hold\"\n\
                [netsim.phy]\npropagation = \"full\"\n[sweep]\nseeds = 1\nkeep = \"all\"\n\
                [sweep.vary]\nrobotsim.scenario.spacing_m = [1.0, 2.0]\n";
    std::fs::write(folder.path().join("s.toml"), text).unwrap();
    let said_by = |args: &[&str]| {
        let output = tests::orchestrator(args, folder.path());
        (output.status.code(), tests::said(&output))
    };
    let (status, said) = said_by(&["sweep", "s.toml", "--out", "runs"]);
    assert_eq!(status, Some(0), "{said}");
    let (status, said) = said_by(&["verify", "runs/s"]);
    assert!(status == Some(0) && said.contains("valid"), "{said}");
    damage(&folder.path().join("runs/s/trials.parquet"), 200);
    let kept = folder.path().join("runs/s/runs");
    let run = std::fs::read_dir(kept).unwrap().next().unwrap().unwrap();
    damage(&run.path().join("steps.parquet"), 200);
    let (status, said) = said_by(&["verify", "runs/s"]);
    let name = run.file_name();
    let of_run = format!("runs/{}: steps.parquet: ", name.to_str().unwrap());
    assert!(status == Some(1) && said.contains(&of_run), "{said}");
    assert!(said.contains("trials.parquet: its content was changed"), "{said}");
    let (status, said) = said_by(&["recover", "nosuch"]);
    assert!(status == Some(2) && said.contains("it does not exist"), "{said}");
}
