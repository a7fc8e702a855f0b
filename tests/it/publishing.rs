//! The end of a run is as safe as its middle: what was recorded becomes a result after a kill or a failure at any point of it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tests::fault_simulation::Simulation;
use tests::recording::assert_same;

/// Points of the end of a run at which it is killed.
const POINTS: [&str; 4] =
    ["files whole", "before the rename", "between two renames", "after the rename"];

fn run(folder: &Path, schedule: &str, arguments: &[&str]) -> Output {
    let mut command = Command::new(tests::executable("murmuration"));
    command.args(arguments).current_dir(folder).env(system::fault::VARIABLE, schedule);
    tests::end_of(tests::spawn(&mut command, folder))
}

fn flocking(folder: &Path, schedule: &str) -> Output {
    let config = tests::repository().join("configs/flocking.toml");
    let sets = ["experiment.duration_s=0.4", "experiment.checkpoint_every_s=1e-9"];
    let sets = sets.iter().flat_map(|set| ["--set", set]);
    let arguments: Vec<&str> = ["run", config.to_str().unwrap()].into_iter().chain(sets).collect();
    run(folder, schedule, &arguments)
}

fn unfinished(folder: &Path) -> Option<PathBuf> {
    let entries = std::fs::read_dir(folder.join("runs")).unwrap();
    let mut paths = entries.map(|entry| entry.unwrap().path());
    paths.find(|path| path.to_str().unwrap().contains(".partial-"))
}

#[test]
fn a_run_killed_after_its_last_step_is_recovered_as_the_complete_run_that_it_is() {
    let whole = tests::folder();
    assert!(flocking(whole.path(), "").status.success());
    for point in POINTS {
        let folder = tests::folder();
        // Over an earlier result, so that there are two renames.
        assert!(flocking(folder.path(), "").status.success());
        let killed = flocking(folder.path(), &format!("kill point 1 {point}"));
        assert_eq!(killed.status.code(), None, "{point}: {}", tests::said(&killed));
        if let Some(left) = unfinished(folder.path()) {
            let recovered = run(folder.path(), "", &["recover", left.to_str().unwrap()]);
            assert!(recovered.status.success(), "{point}: {}", tests::said(&recovered));
        }
        let result = folder.path().join("runs/flocking");
        assert_same(&whole.path().join("runs/flocking"), &result);
        assert_eq!(unfinished(folder.path()), None, "{point}");
        assert!(!folder.path().join("runs/flocking-2").exists(), "{point}");
        // The next run of that name removes the files of the killed one.
        assert!(flocking(folder.path(), "").status.success());
        for file in ["checkpoint", "ending.json"] {
            assert!(!result.join(file).exists(), "{point}: {file}");
        }
        let names = std::fs::read_dir(folder.path().join("runs")).unwrap().count();
        assert_eq!(names, 1, "{point}");
    }
}

#[test]
fn a_checkpoint_that_cannot_be_removed_is_a_warning_since_the_result_stands() {
    let folder = tests::folder();
    let ended = flocking(folder.path(), "EIO remove 2 flocking/checkpoint");
    let said = tests::said(&ended);
    assert!(ended.status.success(), "{said}");
    assert!(said.contains("warning: cannot remove runs/flocking/checkpoint"), "{said}");
    assert!(said.contains("the result is whole"), "{said}");
    let verified = run(folder.path(), "", &["verify", "runs/flocking"]);
    assert!(verified.status.success(), "{}", tests::said(&verified));
}

#[test]
fn a_folder_in_which_nothing_can_be_renamed_is_refused_before_the_start() {
    let folder = tests::folder();
    let refused = flocking(folder.path(), "EXDEV rename 1 runs/.flocking.partial-#-renamed");
    let said = tests::said(&refused);
    assert_eq!(refused.status.code(), Some(2), "{said}");
    assert!(said.contains("cannot rename runs/.flocking.partial-"), "{said}");
    assert!(!folder.path().join("runs").exists());
}

/// Trials of the simulation that once showed a defect: a file of a lock, a draft or an earlier result stayed behind for ever.
const REGRESSIONS: [&str; 9] = [
    "shards | 1 | kill sync 1 runs/.s.trials-#-of-#.jsonl.lock-# | 2706190930698072430",
    "resume | 1 | kill link 1 runs/.flocking.lock-stale-# | 4968965901984421307",
    "shards | 2 | EACCES remove 1 runs/.s.lock-# | 15793073847039802184",
    "replace | 2 | EIO remove 1 .flocking.removed-#/run.log | 14117736416128077804",
    "replace | 2 | kill remove 1 .flocking.removed-#/run.log | 0",
    "sweep | 0 | EIO remove 8 setting-#-seed-#/ending.json | 11922588562097373654",
    "convert | 0 | kill sync 1 ./.table.csv.draft-# | 0",
    "export-rosbag2 | 1 | kill write 1 .exported.draft-#/metadata.yaml | 0",
    "broadcasts | 0 | kill create 1 .flocking.partial-#/run.log | 2",
];

#[test]
fn faults_that_once_showed_a_defect_show_none() {
    let simulation = Simulation::new().unwrap();
    for text in REGRESSIONS {
        let trial = simulation.parse(text).unwrap();
        assert_eq!(trial.to_string(), text);
        let (verdict, said) = simulation.carry_out(&trial).unwrap();
        assert!(!verdict.is_defect(), "{text}: {verdict:?}\n{said}");
    }
}

#[test]
fn a_seed_is_the_same_trial_whenever_it_is_drawn() {
    let [one, other] = [Simulation::new().unwrap(), Simulation::new().unwrap()];
    for seed in 1..=4 {
        assert_eq!(one.draw(seed), other.draw(seed), "seed {seed}");
    }
}
