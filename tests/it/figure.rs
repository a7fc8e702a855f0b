//! Journal figures by the real program: the numbers are those of the results, and what cannot be drawn is refused with what can.

use serde_json::Value;
use std::path::Path;
use std::sync::LazyLock;
use tempfile::TempDir;
use tests::{folder, orchestrator, said};

/// A run and a sweep, made once.
static RESULTS: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = folder();
    let common = "[experiment]\nname = \"NAME\"\nseed = 1\nduration_s = 3.0\nagents = 6\ncontrol_period = { rate_hz = 10.0 }\n\
        [robotsim.scenario]\nkind = \"line\"\n[robotsim.controller]\nkind = \"flocking\"\nflock_radius_m = 5.0\n\
        [[site.wall]]\nfrom_m = [0.0, 5.0]\nto_m = [10.0, 5.0]\n\
        [netsim.phy]\npropagation = \"unit-disk\"\nradius_m = 12.0\n";
    std::fs::write(folder.path().join("run.toml"), common.replace("NAME", "run")).unwrap();
    let wide = common
        .replace("NAME", "wide")
        .replace("seed = 1", "seed = 2")
        .replace("flock_radius_m = 5.0", "flock_radius_m = 8.0");
    std::fs::write(folder.path().join("wide.toml"), wide).unwrap();
    let sweep = common.replace("NAME", "sweep")
        + "[sweep]\nseeds = 6\nmetrics = [\"task.flock_speed_mps\"]\n[sweep.vary]\nnetsim.phy.radius_m = [3.0, 12.0]\nexperiment.agents = [4, 6]\n";
    std::fs::write(folder.path().join("sweep.toml"), sweep).unwrap();
    let cases = common.replace("NAME", "cases")
        + "[sweep]\nseeds = 2\nmetrics = [\"flock_speed\"]\n[[sweep.case]]\nname = \"near\"\nrobotsim.controller.flock_radius_m = 2.0\n\
           [[sweep.case]]\nname = \"far\"\nrobotsim.controller.flock_radius_m = 8.0\n[sweep.vary]\nnetsim.phy.radius_m = [3.0, 12.0]\n";
    std::fs::write(folder.path().join("cases.toml"), cases).unwrap();
    for args in [
        ["run", "run.toml"],
        ["run", "wide.toml"],
        ["sweep", "sweep.toml"],
        ["sweep", "cases.toml"],
    ] {
        let output = orchestrator(&args, folder.path());
        assert!(output.status.success(), "{}", said(&output));
    }
    folder
});

fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// What `figure` with these words after the path of the result says as JSON.
fn figure(args: &[&str], to: &Path) -> Value {
    let file = to.join("figure.json");
    let json_to = ["--json", file.to_str().unwrap()];
    let output = orchestrator(&[&["figure"], args, &json_to].concat(), RESULTS.path());
    assert!(output.status.success(), "{args:?}: {}", said(&output));
    json(&file)
}

fn refused(args: &[&str]) -> String {
    let output = orchestrator(&[&["figure"], args, &["--json", "-"]].concat(), RESULTS.path());
    assert_eq!(output.status.code(), Some(2), "{args:?}: {}", said(&output));
    said(&output)
}

#[test]
fn a_figure_of_a_sweep_has_the_medians_and_intervals_of_its_summary() {
    let to = folder();
    let figure = figure(&["runs/sweep"], to.path());
    let summary = json(&RESULTS.path().join("runs/sweep/summary.json"));
    let panel = &figure["panels"][0];
    assert_eq!(panel["x"]["label"], "phy radius (m)");
    assert_eq!(panel["y"]["label"], "flock speed (m/s)");
    let mut n_points = 0;
    for series in panel["series"].as_array().unwrap() {
        if series["mark"] == "faint-dot" {
            assert_eq!(series["points"].as_array().unwrap().len(), 12);
            continue;
        }
        for point in series["points"].as_array().unwrap() {
            let is_own = |setting: &&Value| {
                let values = &setting["values"];
                let agents = format!("number of robots {}", values["experiment.agents"]);
                values["netsim.phy.radius_m"].as_f64() == point["x"].as_f64()
                    && series["name"] == agents.as_str()
            };
            let own = summary["settings"].as_array().unwrap().iter().find(is_own).unwrap();
            let metric = &own["metrics"]["task.flock_speed_mps"];
            assert_eq!(point["y"], metric["median"], "{point}");
            assert_eq!(
                [&point["low"], &point["high"]],
                [&metric["median_interval_95"][0], &metric["median_interval_95"][1]]
            );
            assert_eq!(
                (point["n"].as_u64(), &point["interval"]),
                (Some(6), &"bootstrap 95 %".into())
            );
            n_points += 1;
        }
    }
    assert_eq!(n_points, 4);
    let caption = figure["caption"].as_str().unwrap();
    assert!(
        caption.contains("median with the 95 % bootstrap interval")
            && caption.contains("n = 6 trials each"),
        "{caption}"
    );
}

#[test]
fn what_a_case_sets_is_told_apart_by_the_case() {
    let to = folder();
    for args in [&["runs/cases"][..], &["runs/cases", "--x", "radius_m", "--by", "case"]] {
        let figure = figure(args, to.path());
        let panel = &figure["panels"][0];
        assert_eq!(panel["x"]["label"], "phy radius (m)");
        let series = panel["series"].as_array().unwrap();
        let names: Vec<&str> = series
            .iter()
            .filter(|series| series["mark"] == "interval")
            .map(|series| series["name"].as_str().unwrap())
            .collect();
        assert_eq!(names.len(), 2, "{names:?}");
        assert!(names[0].contains("near") && names[1].contains("far"), "{names:?}");
        // Two trials have no other interval.
        let point = &series.last().unwrap()["points"][0];
        assert_eq!((&point["interval"], point["n"].as_u64()), (&"range".into(), Some(2)));
    }
    let by_key = figure(&["runs/cases", "--by", "flock_radius_m"], to.path());
    assert_eq!(by_key["panels"][0]["x"]["label"], "phy radius (m)");
}

#[test]
fn runs_over_each_other_are_named_by_what_differs_in_them() {
    let to = folder();
    let both = figure(&["runs/run", "runs/wide", "flock_speed"], to.path());
    let series = both["panels"][0]["series"].as_array().unwrap();
    let names: Vec<&str> = series.iter().map(|one| one["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["run: flock radius 5 m, seed 1", "wide: flock radius 8 m, seed 2"]);
    for (place, run) in ["runs/run", "runs/wide"].into_iter().enumerate() {
        let alone = figure(&[run, "flock_speed"], to.path());
        assert_eq!(series[place]["points"], alone["panels"][0]["series"][0]["points"], "{run}");
        assert_eq!(series[place]["group"], place);
        assert_eq!(both["runs"][place]["path"], run);
    }
    let differs = both["runs"][1]["differs"].as_object().unwrap();
    assert_eq!(differs["robotsim.controller.flock_radius_m"], "8.0");
    assert_eq!(differs.len(), 2, "{differs:?}");
    let caption = both["caption"].as_str().unwrap();
    assert!(caption.contains("differ in robotsim.controller.flock_radius_m, experiment.seed."));
    // Two quantities are two panels, each with a curve of each run.
    let speed = figure(&["runs/run", "runs/wide", "speed"], to.path());
    let panels = speed["panels"].as_array().unwrap();
    let labels: Vec<&str> = panels.iter().map(|it| it["y"]["label"].as_str().unwrap()).collect();
    assert_eq!(labels, ["flock speed (m/s)", "mean speed (m/s)"]);
    assert!(panels.iter().all(|panel| panel["series"].as_array().unwrap().len() == 2));
}

#[test]
fn the_table_of_a_sweep_says_what_is_a_trial_and_of_which_seed() {
    let to = folder();
    let file = to.path().join("sweep.csv");
    let args = ["figure", "runs/sweep", "--output", file.to_str().unwrap()];
    assert!(orchestrator(&args, RESULTS.path()).status.success());
    let text = std::fs::read_to_string(file).unwrap();
    let mut rows = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = rows.next().unwrap();
    let column = |name: &str| header.iter().position(|own| *own == name).unwrap();
    assert!(!header.contains(&"end_x"), "{header:?}");
    let (statistic, seed) = (column("statistic"), column("seed"));
    let rows: Vec<_> = rows.collect();
    let of = |what: &str| rows.iter().filter(|row| row[statistic] == what).collect::<Vec<_>>();
    assert_eq!((of("median").len(), of("trial").len()), (4, 24));
    let mut seeds: Vec<&str> = of("trial")[..6].iter().map(|row| row[seed]).collect();
    seeds.dedup();
    assert_eq!(seeds.len(), 6, "{seeds:?}");
}

#[test]
fn who_heard_whom_is_counted_in_the_tables() {
    let to = folder();
    let figure = figure(&["runs/run", "links"], to.path());
    let panel = &figure["panels"][0];
    let series = |mark: &str| {
        panel["series"].as_array().unwrap().iter().find(|series| series["mark"] == mark).unwrap()
    };
    let arrows = series("arrow")["points"].as_array().unwrap();
    // All are within reach of each other, and no frame is lost on a disk.
    assert_eq!(arrows.len(), 30);
    for arrow in arrows {
        assert_eq!(arrow["value"], 1.0, "{arrow}");
        assert_eq!(arrow["n"], 30, "a frame in each of thirty periods");
    }
    assert_eq!(series("dot")["points"].as_array().unwrap().len(), 6);
    assert_eq!(series("segment")["name"], "walls");
}

#[test]
fn every_kind_is_written_in_every_format_and_twice_the_same() {
    let to = folder();
    let kinds = ["trajectories", "links", "speed", "flock_speed", "neighbours", "delivery"];
    let results =
        kinds.map(|kind| ("runs/run", kind)).into_iter().chain([("runs/sweep", "flock_speed")]);
    for (result, kind) in results {
        // One kind is of both results.
        let name_of = |name: &str, ending: &str| {
            to.path().join(format!("{}-{kind}-{name}.{ending}", result.replace('/', "-")))
        };
        for ending in ["pdf", "svg", "png", "csv"] {
            let [first, second] = ["a", "b"].map(|name| name_of(name, ending));
            for file in [&first, &second] {
                let args =
                    ["figure", result, kind, "--output", file.to_str().unwrap(), "--width", "page"];
                let output = orchestrator(&args, RESULTS.path());
                assert!(output.status.success(), "{}", said(&output));
            }
            let bytes = std::fs::read(&first).unwrap();
            assert!(bytes == std::fs::read(&second).unwrap(), "{kind}.{ending}");
            let begins = match ending {
                "pdf" => &b"%PDF-1.7"[..],
                "svg" => b"<svg",
                "png" => b"\x89PNG",
                _ => b"panel,series,x_label,x,y_label,y",
            };
            assert!(bytes.starts_with(begins) && 300 < bytes.len(), "{kind}.{ending}");
        }
    }
}

#[test]
fn what_cannot_be_drawn_is_refused_with_what_can() {
    for (args, parts) in [
        (&["runs/run"][..], &["name one KIND", "\n  trajectories "][..]),
        (&["runs/run", "pie"], &["\"pie\" is no KIND", "\n  delivery "]),
        (
            &["runs/run", "latency"],
            &["latency needs packets.parquet", "there are:\n  trajectories"],
        ),
        (&["runs/run", "links", "--x", "experiment.agents"], &["--x: is for sweeps"]),
        (
            &["runs/run", "links", "--from", "99"],
            &["no frame that another robot heard", "the run reaches from 0 to 3.00 s"],
        ),
        (
            &["runs/run", "speed", "--from", "2", "--until", "1"],
            &["--until 1: must be after --from 2"],
        ),
        (&["runs/run", "speed", "links"], &["has one KIND at a time", "\n  trajectories "]),
        (&["runs/run", "runs-wide", "speed"], &["\"runs-wide\" is neither a folder"]),
        (&["runs/run", "runs/absent", "speed"], &["runs/absent: does not exist"]),
        (&["runs/run", "runs/wide", "links"], &["links is a map of one run"]),
        (&["runs/run", "runs/sweep", "speed"], &["runs/sweep: is a sweep"]),
        (&["runs/run", "sped"], &["(nearest: speed)"]),
        (
            &["runs/sweep", "nosuchkind", "trajectories"],
            &["flock_speed", "`murmuration metrics` lists all", "but a KIND of figures of a run"],
        ),
        (
            &["runs/sweep", "flok_speed", "latency"],
            &["flok_speed is no metric", "nearest: ", "latency is no metric"],
        ),
        (
            &["runs/sweep", "--x", "experiment.agnets"],
            &["does not vary (nearest: experiment.agents)"],
        ),
        (&["runs/sweep", "--x", "agents", "--by", "agents"], &["name the same key"]),
        (&["runs/absent", "links"], &["does not exist"]),
        (&["run.toml", "links"], &["neither a folder of results nor an answer"]),
        (&["runs/run", "links", "--output", "a.jpg"], &["must end in .pdf, .svg, .png or .csv"]),
    ] {
        let printed = refused(args);
        for part in parts {
            assert!(printed.contains(part), "{args:?}: {part:?} is not in\n{printed}");
        }
    }
    let output = orchestrator(&["figure", "runs/run", "links"], RESULTS.path());
    assert!(said(&output).contains("give --output FILE"), "{}", said(&output));
    let output = orchestrator(
        &["figure", "runs/run", "links", "--width", "39", "--json", "-"],
        RESULTS.path(),
    );
    assert!(said(&output).contains("from 40 to 400"), "{}", said(&output));
}
