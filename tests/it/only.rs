//! Effects that act on some nodes, robots, runs and times only: in runs of the real processes, and against measurements.

use diagnose::Request;
use measure::config::Compared;
use measure::memory::MemoryBudget;
use measure::table::DataTable;
use physics::link::channel_hz;
use proto::effect::Level;
use std::fmt::Write as _;
use std::path::Path;
use study::choices::Choices;
use study::{NotLimited, Study, TermId, open};
use tests::{answers, folder, orchestrator, run, said};

/// Four robots on a circle drive east side by side, over a radio that delivers everything.
const MODEL: &str = r#"
[experiment]
name = "abreast"
seed = 4
duration_s = 3.0
agents = 4

[output]
report = false

[robotsim]
scenario = { kind = "circle", radius_m = 5.0 }
controller = { kind = "constant-velocity", velocity_mps = [2.0, 0.0] }

[netsim.phy]
propagation = "friis"

"#;

/// The tables `steps.parquet` and `links.parquet` of a run with an effect.
fn tables(effect: &str) -> [DataTable; 2] {
    let dir = folder();
    let config = dir.path().join("model.toml");
    std::fs::write(&config, format!("{MODEL}{effect}")).unwrap();
    let out = run(&config, dir.path(), &[]);
    ["steps.parquet", "links.parquet"]
        .map(|name| DataTable::read(&out.join(name), MemoryBudget::default()).unwrap())
}

#[test]
fn an_effect_that_is_limited_by_node_and_time_changes_links_exactly_then_and_there() {
    let [_, plain] = tables("");
    let only = "only = { nodes = [2], from_s = 1.0, until_s = 2.0 }";
    let gain = format!("[[netsim.phy.effect]]\nkind = \"system-gain\"\ngain_db = -7.0\n{only}\n");
    let shadowing = format!(
        "[[netsim.phy.effect]]\nkind = \"shadowing\"\nsd_db = 4.0\ndecorrelation_m = 1e6\n{only}\n"
    );
    for (effect, expected_db) in [(gain, Some(-7.0)), (shadowing, None)] {
        let [_, limited] = tables(&effect);
        assert_eq!(limited.n_rows(), plain.n_rows());
        let cell = |table: &DataTable, name: &str, row: usize| table.column(name).unwrap()[row];
        let (mut n_changed, mut n_same) = (0, 0);
        for row in 0..plain.n_rows() {
            let [sender, receiver, sent_ns] =
                ["sender", "receiver", "sent_ns"].map(|name| cell(&plain, name, row));
            let change_db = cell(&limited, "rssi_dbm", row) - cell(&plain, "rssi_dbm", row);
            let acts = (sender == 2.0 || receiver == 2.0) && (1e9..2e9).contains(&sent_ns);
            if !acts {
                assert_eq!(change_db, 0.0, "{sender} {receiver} {sent_ns}");
                n_same += 1;
            } else {
                // The table has single precision.
                let is_expected = expected_db.is_none_or(|db: f64| (change_db - db).abs() < 1e-4);
                assert!(
                    change_db != 0.0 && is_expected,
                    "{sender} {receiver} {sent_ns}: {change_db}"
                );
                n_changed += 1;
            }
        }
        // Six of twelve links, for a third of the time.
        assert!(100 < n_changed && 4 * n_changed < n_same, "{n_changed} {n_same}");
    }
}

#[test]
fn in_a_swarm_one_robot_slips() {
    let only = "only = { agents = [1], from_s = 1.0, until_s = 2.0 }";
    let effect = format!("[[robotsim.dynamics.effect]]\nkind = \"slip\"\nscale = 0.75\n{only}\n");
    let ([plain, _], [slipping, _]) = (tables(""), tables(&effect));
    assert_eq!(slipping.n_rows(), plain.n_rows());
    let mut last_m = [0.0; 4];
    for row in 0..plain.n_rows() {
        let [agent, time_ns] = ["agent", "time_ns"].map(|name| plain.column(name).unwrap()[row]);
        let behind_m = plain.column("x_m").unwrap()[row] - slipping.column("x_m").unwrap()[row];
        let slips_s = (1e-9 * time_ns - 1.0).clamp(0.0, 1.0);
        let expected_m = if agent == 1.0 { 0.25 * 2.0 * slips_s } else { 0.0 };
        assert!((behind_m - expected_m).abs() < 1e-9, "{agent} {time_ns}: {behind_m}");
        last_m[agent as usize] = behind_m;
    }
    assert!((last_m[1] - 0.5).abs() < 1e-9, "{last_m:?}");
}

#[test]
fn a_run_refuses_what_it_cannot_limit_an_effect_by() {
    let dir = folder();
    let effect = "[[netsim.phy.effect]]\nkind = \"system-gain\"\ngain_db = -7.0\nonly = { runs = [2] }\n\
                  [[robotsim.dynamics.effect]]\nkind = \"slip\"\nscale = 0.75\nonly = { nodes = [1], from_s = 2, until_s = 1 }\n";
    std::fs::write(dir.path().join("model.toml"), format!("{MODEL}{effect}")).unwrap();
    let output = orchestrator(&["run", "model.toml"], dir.path());
    assert_eq!(output.status.code(), Some(2));
    let said = said(&output);
    for expected in [
        "netsim.phy.effect[0].only.runs",
        "comparisons with measurements only",
        "robotsim.dynamics.effect[0].only.nodes",
        "agents",
        "must be greater than from_s = 2",
    ] {
        assert!(said.contains(expected), "{expected}: {said}");
    }
}

fn config(text: &str) -> Compared {
    Compared::of_text(Path::new("model.toml"), text.to_owned(), &[]).unwrap()
}

fn named(study: &impl Study, name: &str) -> TermId {
    study.candidates().find(|candidate| candidate.name == name).unwrap()
}

fn table(csv: &str) -> DataTable {
    DataTable::of_csv(Path::new("data.csv"), csv.as_bytes()).unwrap()
}

#[test]
fn a_comparison_of_links_says_that_a_limited_effect_explains_its_rows_and_no_others() {
    let mut csv = "time_s,run,tx,rx,channel,tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,temperature_c,rssi_dbm,received\n".to_owned();
    for row in 0..2000_u32 {
        let (run, time_s) = (1 + row / 1000, row % 1000);
        let (tx, rx) = (row % 4, (row % 4 + 1 + row / 4 % 3) % 4);
        let distance_m = f64::from(2 + row % 17);
        let temperature_c = f64::from(10 + row * 7 % 31);
        let is_low = run == 2
            && (tx == 3 || rx == 3)
            && (200..700).contains(&time_s)
            && 25.0 < temperature_c;
        let friis_dbm = 20.0
            * (299_792_458.0 / channel_hz(15) / (4.0 * std::f64::consts::PI * distance_m)).log10();
        let rssi_dbm = friis_dbm - if is_low { 9.0 } else { 0.0 };
        writeln!(
            csv,
            "{time_s},{run},{tx},{rx},15,0,0,1,{distance_m},0,1,{temperature_c},{rssi_dbm:.9},1"
        )
        .unwrap();
    }
    let data = table(&csv);
    let rmse_db = |only: &str| {
        let text = format!(
            "[netsim.phy]\npropagation = \"friis\"\ntx_power_dbm = 0.0\n\
             [[netsim.phy.effect]]\nkind = \"system-gain\"\ngain_db = -9.0\nonly = {only}\n"
        );
        answers::compared(&Request::new(&config(&text), &data)).scores["rmse_db"]
    };
    let exact =
        "nodes = [3], runs = [2], from_s = 200, until_s = 700, where = \"temperature_c > 25\"";
    let explained_db = rmse_db(&format!("{{ {exact} }}"));
    assert!(explained_db < 1e-6, "{explained_db}");
    for part in exact.split(", ") {
        let others: Vec<&str> = exact.split(", ").filter(|other| *other != part).collect();
        let missed_db = rmse_db(&format!("{{ {} }}", others.join(", ")));
        assert!(0.5 < missed_db, "without {part}: {missed_db}");
    }
    // A candidate of a diagnosis may be limited as well, and an extended configuration then says so.
    let plain = "[netsim.phy]\npropagation = \"friis\"\ntx_power_dbm = 0.0\n";
    let (mut study, _) = open::links(&config(plain), &data, &Choices::default()).unwrap();
    let gain = named(&study, "system-gain");
    let limits: toml::Table = exact.replace(", ", "\n").parse().unwrap();
    let limited = study.add_limited(gain, &limits).unwrap();
    assert!(study.candidates()[limited].name.starts_with("system-gain (only nodes = [3], runs"));
    let all: Vec<u32> = (0..study.n_rows() as u32).collect();
    let fit = study.fit(&[limited], &all, Level::Time, None);
    let settings = study.settings(&fit, limited).unwrap();
    assert!((settings["gain_db"].as_float().unwrap() + 9.0).abs() < 0.1, "{settings}");
    assert_eq!(settings["only"]["runs"], toml::Value::Array(vec![2.into()]));
    let refused =
        study.add_limited(gain, &"agents = [1]".parse().unwrap()).unwrap_err().to_string();
    assert!(refused.contains("effect.only.agents"), "{refused}");
    let shadowing = named(&study, "shadowing");
    assert_eq!(study.add_limited(shadowing, &limits), Err(NotLimited::Candidate));
    let wrong = |effect: &str| {
        let text =
            format!("[netsim.phy]\npropagation = \"friis\"\n[[netsim.phy.effect]]\n{effect}\n");
        open::links(&config(&text), &data, &Choices::default()).unwrap_err().to_string()
    };
    let unknown =
        wrong("kind = \"system-gain\"\ngain_db = -9.0\nonly = { where = \"temperatur_k > 300\" }");
    assert!(unknown.contains("there is no such column"), "{unknown}");
    assert!(unknown.contains("temperature_c"), "{unknown}");
    let random =
        wrong("kind = \"shadowing\"\nsd_db = 3.0\ndecorrelation_m = 5.0\nonly = { nodes = [3] }");
    assert!(random.contains("must be absent from shadowing"), "{random}");
}

#[test]
fn a_comparison_of_robots_says_that_a_limited_effect_explains_its_rows_and_no_others() {
    let mut csv = "time_s,run,agent,x_m,y_m,cmd_vx_mps,cmd_vy_mps\n".to_owned();
    let step_s = 0.1;
    for run in [1, 2] {
        for agent in [1, 3] {
            let (mut x_m, mut y_m) = (0.0, f64::from(10 * agent + 100 * run));
            for step in 0..400 {
                let time_s = step_s * f64::from(step);
                let turn = 0.3 * f64::from(step / 15 * 7 % 20);
                let (vx_mps, vy_mps) = (turn.cos(), turn.sin());
                writeln!(csv, "{time_s:.1},{run},{agent},{x_m:.12},{y_m:.12},{vx_mps},{vy_mps}")
                    .unwrap();
                let slips = run == 2 && agent == 3 && (100..300).contains(&step);
                let scale = if slips { 0.7 } else { 1.0 };
                x_m += step_s * scale * vx_mps;
                y_m += step_s * scale * vy_mps;
            }
        }
    }
    let data = table(&csv);
    let rmse_m = |only: &str| {
        let text = format!(
            "[robotsim.dynamics]\nkind = \"point-mass\"\n\
             [[robotsim.dynamics.effect]]\nkind = \"slip\"\nscale = 0.7\nonly = {only}\n"
        );
        answers::compared(&Request::new(&config(&text), &data)).scores["rmse_m"]
    };
    let exact = "agents = [3], runs = [2], from_s = 10, until_s = 30";
    let explained_m = rmse_m(&format!("{{ {exact} }}"));
    assert!(explained_m < 1e-5, "{explained_m}");
    for (part, other) in [
        ("agents = [3]", "agents = [1, 3]"),
        ("runs = [2]", "runs = [1, 2]"),
        ("from_s = 10", "from_s = 5"),
        ("until_s = 30", "until_s = 35"),
    ] {
        let missed_m = rmse_m(&format!("{{ {} }}", exact.replace(part, other)));
        assert!(0.01 < missed_m, "{other}: {missed_m}");
    }
    let wrong = "[robotsim.dynamics]\nkind = \"point-mass\"\n[[robotsim.dynamics.effect]]\nkind = \"slip\"\nscale = 0.7\n\
                 only = { from_s = 9, until_s = 8 }\n";
    let refused = open::robots(&config(wrong), &data, &Choices::default()).unwrap_err().to_string();
    assert!(refused.contains("robotsim.dynamics.effect[0].only.until_s"), "{refused}");
    let plain = "[robotsim.dynamics]\nkind = \"point-mass\"\n";
    let (mut study, _) = open::robots(&config(plain), &data, &Choices::default()).unwrap();
    let slip = named(&study, "slip");
    let limited = study.add_limited(slip, &exact.replace(", ", "\n").parse().unwrap()).unwrap();
    let all: Vec<u32> = (0..study.n_rows() as u32).collect();
    let fit = study.fit(&[limited], &all, Level::Time, None);
    let settings = study.settings(&fit, limited).unwrap();
    assert!((settings["scale"].as_float().unwrap() - 0.7).abs() < 0.01, "{settings}");
    assert_eq!(settings["only"]["agents"], toml::Value::Array(vec![3.into()]));
}
