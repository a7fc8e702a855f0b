//! A run made up of messages, recorded and read again.

mod first_figures;
mod made_up;
mod replacing;
mod scene;
mod tables;

use super::log::Topic;
use super::read::{ReadError, RunReader};
use super::*;
use bytes::Bytes;
use experiment::output::Links;
use made_up::{N, STEP_NS, STEPS, configured, deliveries, header, record, states, taken};
use proto::digest::of_step;
use proto_messages::v1;
use std::fs;

/// In place of a report.
fn page(contents: &FinishedRun<'_>) -> String {
    format!("report of {}", contents.header.name)
}

fn complete() -> Ending {
    Ending::complete()
}

fn finished(out: &Path, header: RunHeader) -> Finished {
    record(out, header, STEPS).finish(&complete(), json!({ "host": "here" }), page).unwrap()
}

fn names(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(dir)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn two_recordings_of_the_same_run_are_the_same_bytes() {
    let out = tempfile::tempdir().unwrap();
    let dirs = ["a", "b"].map(|place| finished(&out.path().join(place), header("run")).dir);
    for file in names(&dirs[0]) {
        let [a, b] = [&dirs[0], &dirs[1]].map(|dir| fs::read(dir.join(&file)).unwrap());
        assert_eq!(a, b, "{file}");
    }
    assert_eq!(
        names(&dirs[0]),
        [
            "config.toml",
            "links.parquet",
            "motes.parquet",
            "provenance.json",
            "report.html",
            "run.mcap",
            "scene.mcap",
            "steps.parquet",
            "summary.json",
            "transmissions.parquet"
        ]
    );
}

#[test]
fn nothing_but_the_result_is_left_behind_and_a_second_run_replaces_it() {
    let out = tempfile::tempdir().unwrap();
    let first = finished(out.path(), header("run"));
    let second = finished(out.path(), header("run"));
    assert_eq!(first.dir, second.dir);
    assert_eq!(names(out.path()), ["run"]);
}

#[test]
fn a_directory_that_no_run_left_is_refused_and_stays() {
    let out = tempfile::tempdir().unwrap();
    let foreign = out.path().join("run");
    fs::create_dir(&foreign).unwrap();
    fs::write(foreign.join("thesis.tex"), "years of work").unwrap();
    let error = Recorder::create(out.path(), header("run")).unwrap_err();
    assert!(matches!(&error, RecordError::Foreign { path } if *path == foreign), "{error}");
    assert_eq!(names(out.path()), ["run"]);
    assert_eq!(names(&foreign), ["thesis.tex"]);
}

#[test]
fn an_output_that_cannot_be_written_is_told_before_anything_runs() {
    let out = tempfile::tempdir().unwrap();
    let file = out.path().join("file");
    fs::write(&file, "").unwrap();
    let error = Recorder::create(&file.join("runs"), header("run")).unwrap_err();
    assert!(matches!(&error, RecordError::Create { .. }), "{error}");
    assert!(error.to_string().contains("file/runs"), "{error}");
    for name in ["", "../run", ".run", "a/b", "a b"] {
        let error = Recorder::create(out.path(), header(name)).unwrap_err();
        assert!(matches!(error, RecordError::Name { .. }), "{name}: {error}");
    }
}

#[test]
fn a_whole_record_is_found_whole_in_every_coupling() {
    for coupling in [Coupling::Sequential, Coupling::Parallel, Coupling::Event] {
        let out = tempfile::tempdir().unwrap();
        let run = finished(out.path(), RunHeader { coupling, ..header("run") });
        let report = verify(&run.dir).unwrap();
        assert_eq!(report.problems, Vec::<String>::new());
        assert_eq!((report.steps, report.digests), (STEPS, STEPS));
        assert_eq!(report.files.len(), 9);
    }
}

#[test]
fn files_that_were_cut_off_or_changed_are_found() {
    for file in
        ["run.mcap", "scene.mcap", "steps.parquet", "links.parquet", "report.html", "config.toml"]
    {
        let out = tempfile::tempdir().unwrap();
        let path = finished(out.path(), header("run")).dir.join(file);
        let content = fs::read(&path).unwrap();

        fs::write(&path, &content[..content.len() * 2 / 3]).unwrap();
        let problems = verify(path.parent().unwrap()).unwrap().problems;
        assert!(
            problems.iter().any(|p| p.starts_with(file) && p.contains("bytes")),
            "{problems:?}"
        );

        let mut changed = content.clone();
        changed[content.len() / 2] ^= 1;
        fs::write(&path, &changed).unwrap();
        let problems = verify(path.parent().unwrap()).unwrap().problems;
        assert!(problems.iter().any(|p| p.starts_with(file)), "{problems:?}");
    }
}

#[test]
fn a_wrong_digest_is_found_with_its_step() {
    let out = tempfile::tempdir().unwrap();
    let mut recorder = record(out.path(), header("run"), 3);
    let wrong = StepRecord { digest: taken(3).digest, ..taken(4) };
    recorder.step(wrong).unwrap();
    let dir = recorder.finish(&complete(), Value::Null, page).unwrap().dir;
    let report = verify(&dir).unwrap();
    assert_eq!((report.steps, report.digests), (4, 3));
    assert!(report.problems[0].contains("step 4: the digest"), "{:?}", report.problems);
}

#[test]
fn a_changed_velocity_is_found_with_its_step() {
    let out = tempfile::tempdir().unwrap();
    let mut recorder = record(out.path(), header("run"), 3);
    let mut changed = taken(4);
    let mut robots = (*changed.robots).clone();
    robots.states.vx_mps = vec![1.0; N];
    changed.robots = Arc::new(robots);
    recorder.step(changed).unwrap();
    let dir = recorder.finish(&complete(), Value::Null, page).unwrap().dir;
    let report = verify(&dir).unwrap();
    assert_eq!((report.steps, report.digests), (4, 3));
    assert!(report.problems[0].contains("step 4: the digest"), "{:?}", report.problems);
}

#[test]
fn a_record_of_an_older_version_is_verified_by_its_lesser_digests() {
    for coupling in [Coupling::Sequential, Coupling::Parallel, Coupling::Event] {
        let out = tempfile::tempdir().unwrap();
        let header = RunHeader { coupling, ..header("run") };
        let configured = configured(&header);
        let mut recorder = Recorder::create(out.path(), header).unwrap();
        recorder.configured(configured).unwrap();
        for step in 1..=STEPS {
            let on_air = states(if coupling == Coupling::Sequential { step } else { step - 1 });
            let given = (1 < step).then(|| deliveries(step - 1));
            let digest = of_step(step, step * STEP_NS, &on_air, given.as_ref());
            recorder.step(StepRecord { digest, ..taken(step) }).unwrap();
        }
        let dir = recorder.finish(&complete(), Value::Null, page).unwrap().dir;
        let report = verify(&dir).unwrap();
        assert_eq!(report.problems, Vec::<String>::new());
        assert_eq!(report.digests, STEPS);
    }
}

#[test]
fn what_no_run_left_cannot_be_verified() {
    let out = tempfile::tempdir().unwrap();
    let error = verify(out.path()).unwrap_err().to_string();
    assert!(error.contains("is not the folder of a run"), "{error}");
    let error = RunReader::open(out.path()).err().unwrap();
    assert!(matches!(error, ReadError::Open { .. }), "{error}");
}

#[test]
fn messages_come_back_as_they_were_but_for_what_has_a_file_of_its_own() {
    let out = tempfile::tempdir().unwrap();
    let run = finished(out.path(), header("run"));
    let mut reader = RunReader::open(&run.dir).unwrap();
    let configured = reader.configured().unwrap();
    assert_eq!(configured.robot_request.seed, 42);
    assert_eq!(configured.net_response.warnings, ["made up"]);
    for step in 1..=STEPS {
        let recorded = reader.next_step().unwrap().unwrap();
        let taken = taken(step);
        assert_eq!(recorded.robots, v1::RobotSimServiceStepResponse::from((*taken.robots).clone()));
        let network = NetworkStep { capture: Bytes::new(), ..(*taken.network).clone() };
        assert_eq!(recorded.net, v1::NetSimServiceStepResponse::from(network));
        assert_eq!(recorded.barrier.digest, taken.digest.to_vec());
    }
    assert_eq!(reader.next_step().unwrap(), None);
}

#[test]
fn the_log_describes_itself_to_any_reader() {
    let out = tempfile::tempdir().unwrap();
    let content = fs::read(finished(out.path(), header("run")).dir.join("run.mcap")).unwrap();
    let summary = mcap::Summary::read(&content).unwrap().unwrap();
    assert_eq!(summary.channels.len(), Topic::ALL.len());
    for topic in Topic::ALL {
        let channel = summary.channels.values().find(|c| c.topic == topic.names().0).unwrap();
        let schema = channel.schema.as_ref().unwrap();
        assert_eq!(
            (schema.encoding.as_str(), channel.message_encoding.as_str()),
            ("protobuf", "protobuf")
        );
        let set: prost_types::FileDescriptorSet = prost::Message::decode(&schema.data[..]).unwrap();
        let (package, message) = schema.name.rsplit_once('.').unwrap();
        let found = set.file.iter().any(|file| {
            file.package() == package && file.message_type.iter().any(|m| m.name() == message)
        });
        assert!(found, "{}", schema.name);
    }
    let statistics = summary.stats.unwrap();
    assert_eq!(statistics.message_count, 4 + 3 * STEPS);
    assert_eq!(statistics.message_end_time, STEPS * STEP_NS);
}

#[test]
fn what_is_not_asked_for_is_not_written() {
    let out = tempfile::tempdir().unwrap();
    let mut header = header("run");
    header.output = OutputConfig {
        mcap: false,
        scene: false,
        steps: false,
        transmissions: false,
        motes: false,
        links: Links::None,
        report: false,
        ..OutputConfig::default()
    };
    let run = finished(out.path(), header);
    assert_eq!(names(&run.dir), ["config.toml", "provenance.json", "summary.json"]);
    assert_eq!(run.report, None);
    assert!(verify(&run.dir).unwrap().problems.is_empty());
}

#[test]
fn an_interrupted_run_keeps_what_it_recorded_and_says_so() {
    let out = tempfile::tempdir().unwrap();
    let recorder = record(out.path(), header("run"), 5);
    let ending = Ending::early(Status::Interrupted, "stopped by Ctrl-C".to_owned());
    let run = recorder.finish(&ending, Value::Null, page).unwrap();
    assert_eq!(json!(run.summary)["status"], "interrupted");
    assert_eq!(json!(run.summary)["reason"], "stopped by Ctrl-C");
    assert_eq!(json!(run.summary)["steps"], 5);
    let report = verify(&run.dir).unwrap();
    assert_eq!((report.steps, report.problems), (5, vec![]));
}

#[test]
fn a_run_that_failed_before_it_was_configured_leaves_a_summary_too() {
    let out = tempfile::tempdir().unwrap();
    let recorder = Recorder::create(out.path(), header("run")).unwrap();
    let ending = Ending::early(Status::Failed, "no such host".to_owned());
    let run = recorder.finish(&ending, Value::Null, page).unwrap();
    assert_eq!(json!(run.summary)["steps"], 0);
    assert_eq!(json!(run.summary)["task"], Value::Null);
    let report = verify(&run.dir).unwrap();
    assert_eq!((report.steps, report.problems), (0, vec![]));
}

#[test]
fn a_recorder_that_is_dropped_leaves_messages_that_can_be_read() {
    let out = tempfile::tempdir().unwrap();
    drop(record(out.path(), header("run"), 5));
    let partial = names(out.path());
    assert_eq!(partial.len(), 1);
    assert!(partial[0].starts_with(".run.partial-"), "{partial:?}");
    let next = Reservation::new(out.path(), "run").unwrap();
    assert_eq!(next.leftovers(), [out.path().join(&partial[0])]);
    let mut reader = RunReader::open(&out.path().join(&partial[0])).unwrap();
    for _ in 0..5 {
        assert!(reader.next_step().unwrap().is_some());
    }
    assert_eq!(reader.next_step().unwrap(), None);
}

#[test]
fn a_log_that_is_cut_off_gives_the_steps_before_the_cut() {
    let out = tempfile::tempdir().unwrap();
    let dir = finished(out.path(), header("run")).dir;
    let path = dir.join("run.mcap");
    let content = fs::read(&path).unwrap();
    // The end magic is missing, all steps are there.
    fs::write(&path, &content[..content.len() - 8]).unwrap();
    let mut reader = RunReader::open(&dir).unwrap();
    for _ in 0..STEPS {
        assert!(reader.next_step().unwrap().is_some());
    }
    assert!(matches!(reader.next_step(), Err(ReadError::Damaged { .. })));
}

#[test]
fn steps_out_of_order_are_refused() {
    let out = tempfile::tempdir().unwrap();
    let mut recorder = record(out.path(), header("run"), 2);
    let skipped = taken(4);
    // The thread finds out; the caller learns of it when it next hands something over, here after a few at most.
    let error = (0..).find_map(|_| recorder.step(skipped.clone()).err()).unwrap();
    assert!(matches!(error, RecordError::Order { got: 4, expected: 3 }), "{error}");
    // Finishing nevertheless reports the same reason again.
    let error = recorder.finish(&complete(), Value::Null, page).unwrap_err();
    assert!(matches!(&error, RecordError::Stopped { .. }), "{error}");
    assert!(error.to_string().contains("step 4 cannot be recorded: step 3 is next"), "{error}");
}

#[test]
fn reserving_leaves_nothing_and_finds_what_recording_would_find() {
    let out = tempfile::tempdir().unwrap();
    let runs = out.path().join("runs");
    drop(Reservation::new(&runs, "run").unwrap());
    assert_eq!(names(out.path()), Vec::<String>::new());
    fs::create_dir_all(runs.join("run")).unwrap();
    drop(Reservation::new(&runs, "run").unwrap());
    assert_eq!(names(&runs), ["run"]);
    fs::write(runs.join("run/thesis.tex"), "years of work").unwrap();
    let error = Reservation::new(&runs, "run").unwrap_err();
    assert!(matches!(error, RecordError::Foreign { .. }), "{error}");
    assert_eq!(names(&runs), ["run"]);
}

#[test]
fn the_summary_measures_task_and_network() {
    let out = tempfile::tempdir().unwrap();
    let summary = json!(finished(out.path(), header("run")).summary);
    assert_eq!(summary["schema"], "murmuration/summary/1");
    assert_eq!(summary["simulated_s"], 1.2);
    assert_eq!(summary["baseline"], Value::Null);
    let near = |value: &Value, expected: f64| {
        // Positions are sums of decimal fractions: right up to rounding.
        let value = value.as_f64().unwrap();
        assert!((value - expected).abs() < 1e-9, "{value} is not {expected}");
    };
    near(&summary["task"]["flock_speed_mps"], 2.0);
    near(&summary["task"]["mean_speed_mps"], 2.0);
    // Six agents 1 m apart: variance 35/12 m2.
    near(&summary["task"]["final_spread_m"], (35.0f64 / 12.0).sqrt());
    let network = &summary["network"];
    assert_eq!(network["transmissions"], 6 * STEPS);
    assert_eq!(network["attempts"], 30 * STEPS);
    assert_eq!(network["deliveries"], 18 * STEPS);
    near(&network["delivery_ratio"], 0.6);
    near(&network["mean_neighbours_heard"], 3.0);
    near(&network["mean_delay_s"], 0.002);
    let by_distance = network["by_distance"].as_array().unwrap();
    assert_eq!(by_distance.len(), 5);
    for bin in by_distance {
        near(&bin["ratio"], if bin["from_m"].as_f64().unwrap() < 2.5 { 1.0 } else { 0.0 });
    }
    assert_eq!(summary["warnings"], json!(["network: made up"]));
}

#[test]
fn speeds_are_means_over_time_not_over_steps() {
    let out = tempfile::tempdir().unwrap();
    let mut recorder = record(out.path(), header("run"), 1);
    // A second step three times as long, over which nobody moves: 2 m/s become 0.5 m/s.
    let two = taken(2);
    let time_ns = 4 * STEP_NS;
    let robots = RobotsStep { time_ns, states: states(1), ..(*two.robots).clone() };
    let network = NetworkStep { time_ns, ..(*two.network).clone() };
    let (robots, network) = (Arc::new(robots), Arc::new(network));
    recorder.step(StepRecord { time_ns, robots, network, ..two }).unwrap();
    let task = json!(recorder.finish(&complete(), Value::Null, page).unwrap().summary.task);
    for key in ["flock_speed_mps", "mean_speed_mps"] {
        // Up to rounding.
        assert!((task[key].as_f64().unwrap() - 0.5).abs() < 1e-9, "{key}: {}", task[key]);
    }
}

fn stored() -> States {
    let state = || Some(Bytes::from_static(b"state"));
    States { robots: state(), network: state(), urls: [None, None] }
}

#[test]
fn a_checkpoint_stays_until_the_result_has_its_name() {
    let out = tempfile::tempdir().unwrap();
    let mut recorder =
        record(out.path(), RunHeader { keeps_checkpoints: true, ..header("run") }, STEPS);
    recorder.checkpoint(stored()).unwrap();
    let partial = recorder.path();
    // Something that no run left takes the place meanwhile.
    fs::create_dir(out.path().join("run")).unwrap();
    fs::write(out.path().join("run/thesis.tex"), "").unwrap();
    recorder.finish(&complete(), json!({ "host": "here" }), page).unwrap_err();
    assert!(partial.join(checkpoint::FILE).exists(), "the run cannot go on");
    assert!(partial.join("provenance.json").exists());
}

#[test]
fn a_result_that_has_its_name_has_no_checkpoint() {
    let out = tempfile::tempdir().unwrap();
    let mut recorder =
        record(out.path(), RunHeader { keeps_checkpoints: true, ..header("run") }, STEPS);
    recorder.checkpoint(stored()).unwrap();
    let finished = recorder.finish(&complete(), json!({ "host": "here" }), page).unwrap();
    assert!(!finished.dir.join(checkpoint::FILE).exists());
}

#[test]
fn a_link_in_the_place_of_the_result_is_refused_before_the_run() {
    let out = tempfile::tempdir().unwrap();
    fs::create_dir(out.path().join("real")).unwrap();
    std::os::unix::fs::symlink("real", out.path().join("run")).unwrap();
    let refused = Reservation::new(out.path(), "run").unwrap_err();
    assert!(refused.to_string().contains("is a symbolic link"), "{refused}");
    assert_eq!(names(out.path()), ["real", "run"]);
}
