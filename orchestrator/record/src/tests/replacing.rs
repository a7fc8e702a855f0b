//! Which results replace which, and what stays.

use super::*;

/// Records a run and ends it.
fn ended(out: &Path, policy: ReplacePolicy, header: RunHeader, ending: &Ending) -> Finished {
    let reservation = Reservation::new(out, &header.name).unwrap();
    let recorder = Recorder::create_in(reservation, policy, header).unwrap();
    recorder.finish(ending, Value::Null, page).unwrap()
}

fn of_seed(seed: u64) -> RunHeader {
    RunHeader { seed, config_toml: format!("seed = {seed}\n"), ..header("run") }
}

fn interrupted() -> Ending {
    Ending::early(Status::Interrupted, "stopped by SIGINT".to_owned())
}

fn status_in(dir: &Path) -> (Status, u64) {
    let summary = RunSummary::read(dir).unwrap();
    (summary.status, summary.seed)
}

#[test]
fn a_complete_result_is_replaced_by_one_of_the_same_experiment_alone() {
    const SAME: ReplacePolicy = ReplacePolicy::SameExperiment;
    let out = tempfile::tempdir().unwrap();
    let run = |header: RunHeader, ending: &Ending| ended(out.path(), SAME, header, ending);
    let at = |name: &str| out.path().join(name);
    let first = run(of_seed(1), &complete());
    assert_eq!((first.dir.clone(), first.kept), (at("run"), None));
    let again = run(of_seed(1), &complete());
    assert_eq!((again.dir, again.kept), (at("run"), None));
    // Another seed, then another configuration, each next to it; and each replaces itself.
    for _ in 0..2 {
        let other = run(of_seed(2), &complete());
        assert_eq!(other.dir, at("run-2"));
        let reason = KeptReason::OtherSeed(1);
        assert_eq!(other.kept, Some(KeptResult { dir: at("run"), reason }));
    }
    let changed = || RunHeader { config_toml: "seed = 1\nx = 1\n".to_owned(), ..of_seed(1) };
    for _ in 0..2 {
        let other = run(changed(), &complete());
        assert_eq!(other.dir, at("run-3"));
        let reason = KeptReason::OtherConfiguration;
        assert_eq!(other.kept, Some(KeptResult { dir: at("run"), reason }));
    }
    // What is not complete replaces nothing, not even what is not complete.
    for place in ["run-4", "run-5"] {
        let early = run(of_seed(1), &interrupted());
        assert_eq!(early.dir, at(place));
        assert_eq!(early.kept.unwrap().reason, KeptReason::Incomplete);
    }
    assert_eq!(status_in(&at("run")), (Status::Complete, 1));
    assert_eq!(status_in(&at("run-2")), (Status::Complete, 2));
    assert_eq!(names(out.path()), ["run", "run-2", "run-3", "run-4", "run-5"]);
}

#[test]
fn an_incomplete_result_is_replaced_by_a_complete_one_of_the_same_experiment() {
    let out = tempfile::tempdir().unwrap();
    let policy = ReplacePolicy::SameExperiment;
    ended(out.path(), policy, of_seed(1), &interrupted());
    let other = ended(out.path(), policy, of_seed(2), &complete());
    assert_eq!(other.dir, out.path().join("run-2"));
    let same = ended(out.path(), policy, of_seed(1), &complete());
    assert_eq!(same.dir, out.path().join("run"));
    assert_eq!(names(out.path()), ["run", "run-2"]);
}

#[test]
fn replace_does_not_let_an_incomplete_result_replace_a_complete_one() {
    let out = tempfile::tempdir().unwrap();
    let policy = ReplacePolicy::AnyExperiment;
    ended(out.path(), policy, of_seed(1), &complete());
    let early = ended(out.path(), policy, of_seed(1), &interrupted());
    assert_eq!(early.dir, out.path().join("run-2"));
    let other = ended(out.path(), policy, of_seed(2), &complete());
    assert_eq!((other.dir, other.kept), (out.path().join("run"), None));
    assert_eq!(status_in(&out.path().join("run")), (Status::Complete, 2));
    // Where results are remade, whatever comes last stands there.
    let last = ended(out.path(), ReplacePolicy::Always, of_seed(3), &interrupted());
    assert_eq!(last.dir, out.path().join("run"));
}

#[test]
fn files_of_the_user_stay_when_a_result_is_replaced() {
    let out = tempfile::tempdir().unwrap();
    let dir = finished(out.path(), header("run")).dir;
    fs::write(dir.join("notes.txt"), "mine").unwrap();
    fs::create_dir(dir.join("figures")).unwrap();
    fs::write(dir.join("figures/a.svg"), "mine, too").unwrap();
    for _ in 0..2 {
        assert_eq!(finished(out.path(), header("run")).dir, dir);
        assert_eq!(fs::read_to_string(dir.join("notes.txt")).unwrap(), "mine");
        assert_eq!(fs::read_to_string(dir.join("figures/a.svg")).unwrap(), "mine, too");
    }
    assert_eq!(names(out.path()), ["run"]);
    assert_eq!(verify(&dir).unwrap().problems, Vec::<String>::new());
}

#[test]
fn a_replacement_that_was_cut_off_loses_nothing() {
    let out = tempfile::tempdir().unwrap();
    let dir = finished(out.path(), header("run")).dir;
    fs::write(dir.join("notes.txt"), "mine").unwrap();
    let aside = out.path().join(".run.replaced-1");
    // Killed before the new result had the name: the earlier one gets it back.
    fs::rename(&dir, &aside).unwrap();
    drop(Reservation::new(out.path(), "run").unwrap());
    assert_eq!(names(out.path()), ["run"]);
    assert_eq!(verify(&dir).unwrap().problems, Vec::<String>::new());
    // Killed after that: what is the user's still moves.
    fs::rename(&dir, &aside).unwrap();
    fs::create_dir(&dir).unwrap();
    for file in ["summary.json", "provenance.json"] {
        fs::copy(aside.join(file), dir.join(file)).unwrap();
    }
    drop(Reservation::new(out.path(), "run").unwrap());
    assert_eq!(names(out.path()), ["run"]);
    assert_eq!(names(&dir), ["notes.txt", "provenance.json", "summary.json"]);
}

#[test]
fn a_result_is_locked_until_it_stands_there() {
    let out = tempfile::tempdir().unwrap();
    let recorder = record(out.path(), header("run"), 1);
    let error = Recorder::create(out.path(), header("run")).unwrap_err();
    assert!(matches!(error, RecordError::Locked { .. }), "{error}");
    recorder.finish(&complete(), Value::Null, page).unwrap();
    finished(out.path(), header("run"));
    // Whoever has lost its lock does not touch the result of the other one.
    let recorder = record(out.path(), header("run"), 1);
    fs::write(out.path().join(".run.lock"), "{}").unwrap();
    let error = recorder.finish(&complete(), Value::Null, page).unwrap_err();
    assert!(matches!(error, RecordError::LockLost { .. }), "{error}");
    assert_eq!(RunSummary::read(&out.path().join("run")).unwrap().steps, STEPS);
}
