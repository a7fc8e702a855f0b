//! Robots that wait for their network, orders at their times, and what a network with protocols leaves in the record.

use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::{Field, Row};
use proto_messages::v1::mote_command::Order;
use record::read::RunReader;
use record::result::ResultFolder;
use record::verify;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Output;
use tests::fake::{Fault, Faulty};
use tests::{forming, orchestrator, said};

/// Four robots that fly east at 1 m/s; periods of 0.1 s; a network that forms after 1.5 s.
fn experiment(folder: &Path, more: &str) -> PathBuf {
    std::fs::create_dir_all(folder).unwrap();
    let path = folder.join("x.toml");
    let text = format!(
        "[experiment]\nname = \"x\"\nseed = 1\nduration_s = 2.0\nagents = 4\n\
         control_period = {{ rate_hz = 10.0 }}\n\
         [robotsim.scenario]\nkind = \"line\"\n\
         [robotsim.controller]\nkind = \"constant-velocity\"\nvelocity_mps = [1.0, 0.0]\n\
         [netsim]\nforms_after_s = 1.5\n{more}"
    );
    std::fs::write(&path, text).unwrap();
    path
}

fn start(folder: &Path, more: &str, args: &[&str]) -> Output {
    let path = experiment(folder, more);
    let network = forming::serve();
    let path = path.to_str().unwrap();
    orchestrator(&[&["run", path, "--netsim", &network.url], args].concat(), folder)
}

/// A run that must succeed; its folder and summary.
fn run(folder: &Path, more: &str, args: &[&str]) -> (PathBuf, Value) {
    let output = start(folder, more, args);
    assert!(output.status.success(), "{}", said(&output));
    let dir = folder.join("runs/x");
    assert_eq!(verify(&dir).unwrap().problems, Vec::<String>::new());
    let summary = std::fs::read_to_string(dir.join("summary.json")).unwrap();
    (dir, serde_json::from_str(&summary).unwrap())
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn rows(dir: &Path, file: &str) -> Vec<Row> {
    let reader = SerializedFileReader::new(std::fs::File::open(dir.join(file)).unwrap()).unwrap();
    reader.get_row_iter(None).unwrap().map(Result::unwrap).collect()
}

fn column(row: &Row, name: &str) -> Field {
    row.get_column_iter().find(|(column, _)| *column == name).unwrap().1.clone()
}

/// East of the robots' start (m), of agent 0 at the end of each step.
fn way(dir: &Path) -> Vec<f64> {
    rows(dir, "steps.parquet")
        .iter()
        .filter(|row| column(row, "agent") == Field::UInt(0))
        .map(|row| match column(row, "x_m") {
            Field::Double(x) => x,
            other => panic!("{other:?}"),
        })
        .collect()
}

#[test]
fn robots_stand_still_until_the_network_has_formed_and_their_time_counts_from_then() {
    let folder = tests::folder();
    let (dir, summary) = run(folder.path(), "", &[]);
    assert_eq!(summary["start"], "when-formed");
    assert_eq!(summary["robots_started_s"], 1.5);
    assert_eq!(summary["kpis"]["formation"]["formed_s"], 1.5);
    assert_eq!(summary["simulated_s"], 3.5);
    assert_eq!(summary["steps"], 35);
    // Measured from the start: 1 m/s, not less because they stood.
    assert!((summary["task"]["flock_speed_mps"].as_f64().unwrap() - 1.0).abs() < 1e-9);
    let way = way(&dir);
    assert_eq!(way.len(), 36);
    assert!(way[..=15].iter().all(|&x| x == way[0]), "{way:?}");
    assert!((way[35] - way[0] - 2.0).abs() < 1e-9, "{way:?}");
}

#[test]
fn however_steps_cross_and_whoever_takes_the_first_turn_the_record_is_the_same_or_as_still() {
    let folder = tests::folder();
    let (streamed, _) = run(&folder.path().join("a"), "", &[]);
    let (single, _) = run(&folder.path().join("b"), "", &["--set", "experiment.transport=unary"]);
    tests::recording::assert_same(&streamed, &single);
    for setting in ["experiment.coupling=parallel", "experiment.control_period=packet"] {
        let (dir, summary) = run(&folder.path().join(setting), "", &["--set", setting]);
        let way = way(&dir);
        let n_held = way.iter().take_while(|&&x| x == way[0]).count() - 1;
        let started_s = summary["robots_started_s"].as_f64().unwrap();
        assert!(
            (1.5..1.6).contains(&started_s) && 15 <= n_held,
            "{setting}: {started_s}, {n_held}"
        );
    }
}

#[test]
fn the_effective_configuration_waits_as_well() {
    let folder = tests::folder();
    let (dir, _) = run(folder.path(), "", &[]);
    let text = std::fs::read_to_string(dir.join("config.toml")).unwrap();
    let config: toml::Table = text.parse().unwrap();
    assert_eq!(config["experiment"]["start"].as_str(), Some("when-formed"));
    assert_eq!(config["experiment"]["formation_limit_s"].as_float(), Some(3600.0));
}

#[test]
fn robots_that_start_at_once_do_not_wait() {
    let folder = tests::folder();
    let (dir, summary) = run(folder.path(), "", &["--set", "experiment.start=at-once"]);
    assert_eq!((&summary["steps"], &summary["robots_started_s"]), (&20.into(), &0.0.into()));
    // It forms meanwhile, and that is told all the same.
    assert_eq!(summary["kpis"]["formation"]["formed_s"], 1.5);
    let way = way(&dir);
    assert!((way[1] - way[0] - 0.1).abs() < 1e-9);
}

#[test]
fn nobody_says_anything_to_the_network_while_robots_wait_for_it() {
    for coupling in ["sequential", "parallel"] {
        let folder = tests::folder();
        let set = format!("experiment.coupling={coupling}");
        let (dir, _) = run(folder.path(), "", &["--set", &set]);
        let sent = rows(&dir, "transmissions.parquet");
        let steps: Vec<u64> = sent
            .iter()
            .map(|row| match column(row, "step") {
                Field::ULong(step) => step,
                other => panic!("{other:?}"),
            })
            .collect();
        // The network had formed after step 15; four robots.
        assert_eq!(steps, (16..=35).flat_map(|step| [step; 4]).collect::<Vec<_>>(), "{coupling}");
    }
}

#[test]
fn a_network_that_does_not_form_in_time_ends_the_run_with_who_is_missing_and_why() {
    let folder = tests::folder();
    let output = start(folder.path(), "", &["--set", "experiment.formation_limit_s=0.7"]);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    let stderr = stderr(&output);
    for words in [
        "the network had not formed after 0.7 s of simulated time (experiment.formation_limit_s): 2 motes are missing",
        "\n  has not joined: 2\n  hears no enhanced beacon: 3\n",
        "the partial recording is in ",
    ] {
        assert!(stderr.contains(words), "{stderr}");
    }
    let dir = folder.path().join("runs/x");
    assert_eq!(verify(&dir).unwrap().steps, 7);
    let summary: Value =
        serde_json::from_slice(&std::fs::read(dir.join("summary.json")).unwrap()).unwrap();
    assert_eq!(summary["status"], "failed");
    assert_eq!(summary["task"]["flock_speed_mps"], 0.0, "the paper's: 0 if never formed");
    let formation = &summary["kpis"]["formation"];
    assert_eq!((&formation["formed"], &formation["missing"]), (&false.into(), &2.into()));
    assert_eq!(summary["kpis"]["joining"]["joined"]["motes"], 1);
}

#[test]
fn what_a_side_cannot_do_is_refused_with_what_could_be_done_instead() {
    let folder = tests::folder();
    let robots = Faulty::robots(Fault::CannotHold);
    let output = start(folder.path(), "", &["--robotsim", &robots.url]);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(
        stderr(&output).contains(
            "robotsim: robotsim does not announce hold in Describe, so its robots cannot wait until the network has formed. \
             Announce hold, and let robots stand still in steps with hold (docs/own-simulator.md), or set experiment.start = \
             \"at-once\" to let them start during formation"
        ),
        "{}",
        said(&output)
    );

    let standing = tests::repository().join("configs/flocking.toml");
    let args = ["run", standing.to_str().unwrap(), "--set", "experiment.start=when-formed"];
    let output = orchestrator(&args, folder.path());
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(
        stderr(&output).contains("netsim: netsim has no network formation"),
        "{}",
        said(&output)
    );
}

#[test]
fn robots_that_move_although_they_were_told_to_hold_are_found_out() {
    let folder = tests::folder();
    let robots = Faulty::robots(Fault::Restless);
    let output = start(folder.path(), "", &["--robotsim", &robots.url]);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(
        stderr(&output).contains(
            "robotsim: malformed reply to step 3: states: must be those of the step before"
        ),
        "{}",
        said(&output)
    );
}

const KILLED: &str = "[[timeline]]\nat_s = 0.35\norder = \"kill\"\nmotes = [1, 3]\n\
                      [[timeline]]\nat_s = 1.0\norder = \"revive\"\nmotes = 3\n";

#[test]
fn orders_take_effect_in_the_step_that_contains_their_time_and_are_recorded_there() {
    let folder = tests::folder();
    let (dir, summary) = run(folder.path(), KILLED, &[]);
    // 15 steps of formation; the fourth step after that goes from 0.3 to 0.4 s.
    let mut reader = RunReader::of(&ResultFolder::unchecked(&dir)).unwrap();
    let mut ordered = Vec::new();
    while let Some(step) = reader.next_step().unwrap() {
        for command in &step.commands {
            assert_eq!(command.source, "timeline");
            let what = match &command.order {
                Some(Order::Kill(kill)) => ("kill", kill.mote),
                Some(Order::Revive(revive)) => ("revive", revive.mote),
                other => panic!("{other:?}"),
            };
            ordered.push((step.net.step, what));
        }
    }
    assert_eq!(ordered, [(19, ("kill", 1)), (19, ("kill", 3)), (26, ("revive", 3))]);
    assert_eq!(summary["files"]["run.mcap"]["messages"], 4 + 3 * 35 + 2);
    let alive = |step: usize, mote: usize| {
        column(&rows(&dir, "motes.parquet")[4 * step + mote], "alive") == Field::Bool(true)
    };
    let alive_at = |step: usize| [1, 2, 3].map(|mote| alive(step, mote));
    assert_eq!(
        [alive_at(18), alive_at(19), alive_at(26)],
        [[true; 3], [false, true, false], [false, true, true]]
    );
}

#[test]
fn orders_that_the_network_does_not_obey_are_refused_on_their_lines() {
    let folder = tests::folder();
    let more = "[[timeline]]\nat_s = 1.0\norder = \"kill\"\nmotes = 9\n";
    let output = start(folder.path(), more, &[]);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(
        stderr(&output).contains("timeline[0].motes: must be the number of a mote, 0 to 3, got 9")
    );
    let more = "[[timeline]]\nat_s = 1.0\norder = \"add\"\nmotes = [1, 2]\n";
    let output = start(folder.path(), more, &[]);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    let said_of_add =
        "x.toml:16: timeline[0].order: forming does not support this event: add mote 1 at 1 s";
    assert_eq!(
        stderr(&output).matches("does not support this event").count(),
        1,
        "{}",
        said(&output)
    );
    assert!(stderr(&output).contains(said_of_add), "{}", said(&output));
}

#[test]
fn what_the_network_says_of_itself_is_in_tables_capture_and_figures() {
    let folder = tests::folder();
    let (dir, summary) = run(folder.path(), "", &["--set", "output.pcap=true"]);

    // Motes 1, 2, 3 join after 0.5, 1 and 1.5 s of 3.5 s: 31, 26 and 21 packets; those of the last step are on their way.
    let app = &summary["kpis"]["packets"]["app"];
    let counts =
        ["created", "delivered", "dropped", "in_flight"].map(|key| app[key].as_u64().unwrap());
    assert_eq!(counts, [78, 50, 25, 3]);
    let delivery = &summary["kpis"]["delivery"];
    assert_eq!(delivery["ratio"].as_f64(), Some(50.0 / 75.0));
    assert_eq!(delivery["drops_by_reason"]["max_retries"], 25);
    assert!((delivery["latency_s"]["median"].as_f64().unwrap() - 0.1).abs() < 1e-12);
    assert_eq!(delivery, &summary["kpis"]["delivery_upward"]);
    let packets = rows(&dir, "packets.parquet");
    assert_eq!(packets.len(), 75);
    let dropped = packets.iter().find(|row| column(row, "source") == Field::UInt(2)).unwrap();
    assert_eq!(column(dropped, "drop_reason"), Field::Str("max_retries".to_owned()));
    assert_eq!(column(dropped, "kind"), Field::Str("app".to_owned()));

    let motes = rows(&dir, "motes.parquet");
    assert_eq!(motes.len(), 4 * 36);
    assert_eq!(column(&motes[4 * 35 + 1], "charge_uc"), Field::Double(3.5e9 * 1e-7 * 2.0));
    assert_eq!(column(&motes[4 * 4 + 1], "first_joined_ns"), Field::Null);
    assert_eq!(column(&motes[4 * 5 + 1], "first_joined_ns"), Field::Double(5e8));
    let energy = &summary["kpis"]["energy_since_formation"];
    assert!((energy["mean_current_ua"]["max"].as_f64().unwrap() - 200.0).abs() < 1e-9);
    assert!((energy["duty_cycle"]["mean"].as_f64().unwrap() - 0.25).abs() < 1e-9);

    // After formation and at the end.
    for (file, n) in [("schedule.parquet", 4), ("neighbours.parquet", 3)] {
        let steps: Vec<Field> = rows(&dir, file).iter().map(|row| column(row, "step")).collect();
        assert_eq!(
            steps,
            [vec![Field::ULong(16); n], vec![Field::ULong(35); n]].concat(),
            "{file}"
        );
    }
    assert_eq!(summary["files"]["radio.pcap"]["frames"], 35);
    let capture = std::fs::read(dir.join("radio.pcap")).unwrap();
    assert_eq!(capture.len(), 24 + 35 * 18);

    // A frame that was cut off is found.
    std::fs::write(dir.join("radio.pcap"), &capture[..capture.len() - 1]).unwrap();
    let problems = verify(&dir).unwrap().problems;
    assert!(
        problems.iter().any(|problem| problem == "radio.pcap: ends in the middle of a frame"),
        "{problems:?}"
    );
}

#[test]
fn the_report_shows_what_the_network_told_and_nothing_that_it_did_not() {
    let folder = tests::folder();
    let (dir, _) = run(folder.path(), "", &[]);
    let report = std::fs::read_to_string(dir.join("report.html")).unwrap();
    let pictures =
        ["Connectivity", "Routing graph", "Schedule", "Packets delivered over time", "Latency"];
    let heading = |title: &str| format!("<h3>{title}</h3>");
    for title in pictures {
        assert!(report.contains(&heading(title)), "{title}");
    }
    for words in [
        "6 pairs, 6 of them both ways, 3.00 neighbours a mote on average; drawn where they are at the end of that period",
        "3 of 4 motes have one, and the deepest is 3 hops",
        "in slotframe 0 of 101 slots: 4 cells at 4 places, 0 of which several motes share",
        "66.7 % of 75 over all",
        "half of them after 0.100 s (median), 99 % after 0.100 s, all after 0.100 s",
        "<dt>Network formed after</dt><dd><span data-moment=\"formed\">1.50 <small>s</small></span></dd>",
    ] {
        let shown = report.split("Which motes heard each other").nth(1).unwrap_or_default();
        let shown: String = shown.chars().take(120).collect();
        assert!(report.contains(words), "{words} is not in the report, which has: {shown}");
    }
    let flocking = tests::repository().join("configs/flocking.toml");
    let args = ["--set", "experiment.duration_s=0.5"];
    let dir = tests::run(&flocking, &folder.path().join("flocking"), &args);
    let report = std::fs::read_to_string(dir.join("report.html")).unwrap();
    assert!(pictures.iter().all(|title| !report.contains(&heading(title))));
}

#[test]
fn motes_are_asked_as_often_as_is_wanted_and_at_the_end() {
    let folder = tests::folder();
    let (dir, _) = run(folder.path(), "", &["--set", "output.motes_every_s=1.2"]);
    let mut steps: Vec<Field> =
        rows(&dir, "motes.parquet").iter().map(|row| column(row, "step")).collect();
    steps.dedup();
    // 0; 1.2 and 2.4 s; after formation; the last.
    assert_eq!(steps, [0, 12, 16, 24, 35].map(Field::ULong));
}
