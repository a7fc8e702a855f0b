//! What a user reads when the request was wrong: every problem at once, exit status 2, nothing started, nothing written.

use std::path::Path;
use std::process::Output;

/// Runs a file with the given text; returns what was said on standard error, with the folder's own path left out.
fn refused(name: &str, text: &str, args: &[&str]) -> String {
    let folder = tests::folder();
    std::fs::write(folder.path().join(name), text).unwrap();
    let output = tests::orchestrator(&[&["run", name], args].concat(), folder.path());
    check(&output, folder.path())
}

fn check(output: &Output, folder: &Path) -> String {
    assert_eq!(output.status.code(), Some(2), "{}", tests::said(output));
    assert!(output.stdout.is_empty(), "{}", tests::said(output));
    assert!(!folder.join("runs").exists(), "something was written");
    String::from_utf8_lossy(&output.stderr).replace(folder.to_str().unwrap(), "FOLDER")
}

const EXPERIMENT: &str = "[experiment]\nname = \"x\"\nseed = 1\nduration_s = 1.0\nagents = 3\n";
const SCENARIO: &str = "[robotsim.scenario]\nkind = \"line\"\n";
const CONTROLLER: &str = "[robotsim.controller]\nkind = \"hold\"\n";

/// An experiment with nothing wrong in it.
fn good() -> String {
    format!("{EXPERIMENT}{SCENARIO}{CONTROLLER}")
}

#[test]
fn misspelt_keys_wrong_types_and_impossible_values_all_at_once() {
    let text = "\
[experiment]
name = \"my run\"
sede = 1
duration_s = \"ten\"
agents = 0
coupling = \"paralel\"

[robotsim.scenario]
kind = \"lin\"

[netsim.phy]
propagation = \"unit-disk\"
radius_m = -3
exponent = 2.0

[[site.wall]]
from_m = [1.0, 2.0]
to_m = [1.0, 2.0]

[outputs]
mcap = true
";
    insta::assert_snapshot!(refused("x.toml", text, &[]));
}

#[test]
fn problems_within_both_simulators_sections() {
    let text = format!(
        "{EXPERIMENT}
[robotsim]
knowledge = \"hear\"
{SCENARIO}[robotsim.controller]
kind = \"flocking\"
flock_radius_m = nan
leader = 7
[robotsim.dynamics]
kind = \"point-mass\"
speed_cap_mps = 0
[netsim.phy]
propagation = \"log-distance\"
exponent = 9.5
tx_power = 3
[[netsim.phy.effect]]
kind = \"shadowing\"
sd_db = -1.0
[[netsim.phy.effect]]
kind = \"systemgain\"
"
    );
    insta::assert_snapshot!(refused("x.toml", &text, &[]));
}

#[test]
fn a_period_that_is_not_whole_slots() {
    let text = format!("{EXPERIMENT}control_period = {{ rate_hz = 30.0 }}\n{SCENARIO}{CONTROLLER}");
    insta::assert_snapshot!(refused("x.toml", &text, &[]));
    let text = format!(
        "{EXPERIMENT}control_period = \"packet\"\ncoupling = \"parallel\"\n{SCENARIO}{CONTROLLER}"
    );
    insta::assert_snapshot!(refused("x.toml", &text, &[]));
}

#[test]
fn periods_beyond_all_measure_are_refused_at_once() {
    for rate_hz in ["1e-300", "1e-12", "1e-5"] {
        let text = format!(
            "{EXPERIMENT}control_period = {{ rate_hz = {rate_hz} }}\n{SCENARIO}{CONTROLLER}"
        );
        assert!(
            refused("x.toml", &text, &[])
                .contains("must give a period of at most 1000000 slots of 10 ms")
        );
    }
    let said = refused("x.toml", &good(), &["--set", "netsim.slot_duration_s=1e8"]);
    assert!(
        said.contains("netsim.slot_duration_s: must be from 0.000001 to 1000, got 100000000.0"),
        "{said}"
    );
}

#[test]
fn every_wrong_entry_of_a_list_and_a_place_for_json_that_is_none() {
    insta::assert_snapshot!(refused(
        "x.toml",
        &good(),
        &["--set", "netsim.hopping_sequence=[10, 11, \"a\", 27]"]
    ));
    insta::assert_snapshot!(refused("x.toml", &good(), &["--json", "nowhere/x.json"]));
}

#[test]
fn text_that_is_not_toml() {
    insta::assert_snapshot!(refused("x.toml", "[experiment\nname = \n", &[]));
}

#[test]
fn files_that_are_missing() {
    let folder = tests::folder();
    std::fs::write(folder.path().join("flocking.toml"), good()).unwrap();
    let output = tests::orchestrator(&["run", "floking.toml"], folder.path());
    insta::assert_snapshot!(check(&output, folder.path()));
    // An equal ending makes no similar name. A file of measurements is treated as a configuration is.
    let said = |args: &[&str]| check(&tests::orchestrator(args, folder.path()), folder.path());
    assert_eq!(said(&["run", "nothere.toml"]), "error: nothere.toml: does not exist\n");
    std::fs::write(folder.path().join("push.csv"), "").unwrap();
    let nearest = "error: push.cvs: does not exist (nearest: push.csv)\n";
    assert_eq!(said(&["diagnose", "flocking.toml", "--data", "push.cvs"]), nearest);
    let text = format!(
        "{EXPERIMENT}{CONTROLLER}[netsim.phy]\npropagation = \"trace\"\nfile = \"nowhere.k7\"\n[robotsim.scenario]\nkind = \"csv\"\nfile = \"where.csv\"\n"
    );
    insta::assert_snapshot!(refused("x.toml", &text, &[]));
}

#[test]
fn c7_a_run_that_is_sure_to_outlast_its_trace() {
    let folder = tests::folder();
    let path = |name: &str| folder.path().join(name);
    let header = "{\"start_date\": \"2018-01-11T16:32:22.0\", \"stop_date\": \"2018-01-11T16:33:22.0\", \
        \"channels\": [11], \"node_count\": 3}\ndatetime,src,dst,channel,mean_rssi,pdr,tx_count\n\
        2018-01-11T16:32:22.0,0,1,11,-60,1.0,100\n";
    std::fs::write(path("three.k7"), header).unwrap();
    let run = |duration_s: f64, after_end: &str| {
        let experiment = EXPERIMENT.replace("1.0", &format!("{duration_s:?}"));
        let text = format!(
            "{experiment}control_period = {{ rate_hz = 1.0 }}\n{SCENARIO}{CONTROLLER}[netsim]\nhopping_sequence = [11]\n\
             [netsim.phy]\npropagation = \"trace\"\nfile = \"three.k7\"\n{after_end}"
        );
        std::fs::write(path("x.toml"), text).unwrap();
        tests::orchestrator(&["check", "x.toml"], folder.path())
    };
    insta::assert_snapshot!(check(&run(61.0, ""), folder.path()));
    for (duration_s, after_end, warns) in
        [(60.0, "", true), (61.0, "after_end = \"hold\"\n", false)]
    {
        let output = run(duration_s, after_end);
        assert_eq!(output.status.code(), Some(0), "{}", tests::said(&output));
        assert_eq!(tests::said(&output).contains("lasts 60 s"), warns, "{}", tests::said(&output));
    }
}

#[test]
fn duplicate_agents_in_a_table_of_positions() {
    let folder = tests::folder();
    std::fs::write(folder.path().join("p.csv"), "agent,x_m,y_m\n0,0,0\n1,1,0\n1,2,0\n2,nan,0\n")
        .unwrap();
    let text =
        format!("{EXPERIMENT}{CONTROLLER}[robotsim.scenario]\nkind = \"csv\"\nfile = \"p.csv\"\n");
    std::fs::write(folder.path().join("x.toml"), text).unwrap();
    let output = tests::orchestrator(&["run", "x.toml"], folder.path());
    insta::assert_snapshot!(check(&output, folder.path()));
}

#[test]
fn settings_on_the_command_line() {
    insta::assert_snapshot!(refused("x.toml", &good(), &["--set", "netsim.phy.propagaton=friis"]));
    insta::assert_snapshot!(refused("x.toml", &good(), &["--set", "experiment.agents"]));
    insta::assert_snapshot!(refused("x.toml", &good(), &["--set", "experiment.agents.x=1"]));
}

#[test]
fn a_folder_of_results_that_cannot_be_written() {
    // A file stands where the folder should be: that stops even root.
    let folder = tests::folder();
    std::fs::write(folder.path().join("x.toml"), good()).unwrap();
    std::fs::write(folder.path().join("occupied"), "").unwrap();
    let output = tests::orchestrator(&["run", "x.toml", "--out", "occupied"], folder.path());
    insta::assert_snapshot!(check(&output, folder.path()));

    std::fs::create_dir_all(folder.path().join("elsewhere/x")).unwrap();
    std::fs::write(folder.path().join("elsewhere/x/thesis.txt"), "precious").unwrap();
    let output = tests::orchestrator(&["run", "x.toml", "--out", "elsewhere"], folder.path());
    insta::assert_snapshot!(check(&output, folder.path()));
    assert_eq!(
        std::fs::read_to_string(folder.path().join("elsewhere/x/thesis.txt")).unwrap(),
        "precious"
    );
}

#[test]
fn urls_that_lead_nowhere_or_elsewhere() {
    insta::assert_snapshot!(refused("x.toml", &good(), &["--netsim", "127.0.0.1:50051"]));
    // Port 1 is reserved and nothing listens there.
    insta::assert_snapshot!(refused("x.toml", &good(), &["--netsim", "http://127.0.0.1:1"]));
    insta::assert_snapshot!(refused("x.toml", &good(), &["--netsim", "https://127.0.0.1:1"]));

    // The wrong one of the two.
    let robotsim = tests::Server::start("robotsim", &[]).unwrap();
    let said = refused("x.toml", &good(), &["--netsim", &robotsim.url]);
    insta::assert_snapshot!(said.replace(&robotsim.url, "URL"));

    // A web server, more or less.
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        use std::io::{Read as _, Write as _};
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            let mut request = [0; 24];
            let _ = stream.read(&mut request);
            let _ = stream.write_all(
                b"HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\nConnection: close\r\n\r\n",
            );
        }
    });
    let said = refused("x.toml", &good(), &["--netsim", &url]);
    insta::assert_snapshot!(said.replace(&url, "URL"));
}

#[test]
fn a_simulator_that_speaks_another_version() {
    let faulty = tests::fake::Faulty::network(tests::fake::Fault::OtherVersion);
    insta::assert_snapshot!(refused("x.toml", &good(), &["--netsim", &faulty.url]));
}

#[test]
fn a_refusal_by_a_simulator_elsewhere_stands_on_the_lines_of_the_file() {
    let robotsim = tests::Server::start("robotsim", &[]).unwrap();
    let text = format!(
        "{EXPERIMENT}{SCENARIO}[robotsim.controller]\nkind = \"flocking\"\nflock_radius_m = -4\n"
    );
    insta::assert_snapshot!(refused("x.toml", &text, &["--robotsim", &robotsim.url]));
}

#[test]
fn an_address_that_is_taken_or_open_to_all() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    for name in ["netsim", "robotsim"] {
        let said = |args: &[&str]| {
            let output =
                std::process::Command::new(tests::executable(name)).args(args).output().unwrap();
            assert_eq!(output.status.code(), Some(2), "{}", tests::said(&output));
            String::from_utf8_lossy(&output.stderr).replace(&address, "ADDRESS")
        };
        insta::assert_snapshot!(format!("{name}_taken"), said(&["--listen", &address]));
        insta::assert_snapshot!(format!("{name}_open"), said(&["--listen", "0.0.0.0:0"]));
        insta::assert_snapshot!(
            format!("{name}_no_certificate"),
            said(&[
                "--listen",
                "0.0.0.0:0",
                "--tls-cert",
                "nowhere.pem",
                "--tls-key",
                "nowhere.pem"
            ])
        );
    }
}

#[test]
fn many_problems_found_by_a_simulator_elsewhere_are_listed_and_counted() {
    let netsim = tests::Server::start("netsim", &[]).unwrap();
    let keys: String = (0..300).map(|key| format!("unknown_key_{key} = 1\n")).collect();
    let text = format!("{}[netsim]\n{keys}", good());
    let text = refused("x.toml", &text, &["--netsim", &netsim.url]);
    assert!(text.contains("unknown_key_0"), "{text}");
    assert!(text.contains("unknown_key_15"), "{text}");
    assert!(text.contains(" more problems"), "{text}");
}

#[test]
fn an_answer_on_standard_output_is_alone_there() {
    let folder = tests::folder();
    let config = tests::repository().join("configs/flocking.toml");
    let config = config.to_str().unwrap();
    let short = ["--set", "experiment.duration_s=1.0", "--json", "-"];
    for args in [&["run", config][..], &["check", config]] {
        let output = tests::orchestrator(&[args, &short].concat(), folder.path());
        assert!(output.status.success(), "{}", tests::said(&output));
        let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!(answer.get("schema").is_some(), "{answer}");
    }
    let output = tests::orchestrator(&["verify", "runs/flocking", "--json=-"], folder.path());
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answer["schema"], "verify/1");
    assert!(!folder.path().join("-").exists());
}
