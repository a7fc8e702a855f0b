//! What an experiment file may do outside of its own folder: nothing that the user has not agreed to.

use std::fs;
use std::io::ErrorKind;
use std::net::TcpListener;
use std::path::Path;
use std::process::Output;

/// A network elsewhere that is sent a file of the user.
fn exfiltrating(url: &str, file: &Path) -> String {
    format!(
        "[experiment]\nname = \"x\"\nseed = 1\nduration_s = 5.0\nagents = 3\ncontrol_period = {{ rate_hz = 1.0 }}\n\
         [robotsim.scenario]\nkind = \"line\"\n[robotsim.controller]\nkind = \"hold\"\n\
         [netsim]\nurl = {url:?}\n[netsim.phy]\npropagation = \"trace\"\nfile = {file:?}\nother = {file:?}\n"
    )
}

fn asked(args: &[&str], folder: &Path) -> Output {
    tests::orchestrator(args, folder)
}

#[test]
fn a_file_sends_no_file_of_the_user_anywhere_unless_both_are_allowed() {
    let folder = tests::folder();
    let secret = folder.path().join("secret");
    fs::write(&secret, "a secret").unwrap();
    let own = folder.path().join("own");
    fs::create_dir(&own).unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.set_nonblocking(true).unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    fs::write(own.join("x.toml"), exfiltrating(&url, &secret)).unwrap();
    let sends = format!("send this experiment and the contents of {} to {url}", secret.display());
    let reads = format!("read a file outside of the folder of this file: {}", secret.display());
    let allow_file = ["--allow-file", secret.to_str().unwrap()];
    let allow_url = ["--allow-url", url.as_str()];
    for args in [
        &["run", "x.toml"][..],
        &["run", "x.toml", "--dry-run"],
        &["run", "x.toml", allow_url[0], "http://127.0.0.1:1"],
    ] {
        let refused = asked(args, &own);
        let said = tests::said(&refused);
        assert_eq!(refused.status.code(), Some(2), "{said}");
        for problem in ["netsim.url", &sends, &allow_url.join(" "), "netsim.phy.file", &reads] {
            assert!(said.contains(problem), "{problem}: {said}");
        }
    }
    // One of them is not enough.
    let refused = asked(&[&["run", "x.toml"], &allow_url[..]].concat(), &own);
    let said = tests::said(&refused);
    assert_eq!(refused.status.code(), Some(2), "{said}");
    assert!(said.contains(&reads) && !said.contains(&sends), "{said}");
    let refused = asked(&[&["run", "x.toml"], &allow_file[..]].concat(), &own);
    let said = tests::said(&refused);
    assert_eq!(refused.status.code(), Some(2), "{said}");
    assert!(said.contains(&sends) && !said.contains(&reads), "{said}");
    // It can be looked at.
    let checked = asked(&["check", "x.toml"], &own);
    let said = tests::said(&checked);
    assert!(checked.status.success(), "{said}");
    assert!(said.contains(&sends) && said.contains(&reads) && !said.contains("a secret"), "{said}");
    let nobody_came =
        || matches!(listener.accept(), Err(error) if error.kind() == ErrorKind::WouldBlock);
    assert!(nobody_came(), "the URL was called");
    assert!(!own.join("runs").exists(), "something was written");
    // What is refused is what would happen.
    drop(listener);
    let called = asked(&[&["run", "x.toml"], &allow_url[..], &allow_file[..]].concat(), &own);
    let said = tests::said(&called);
    assert!(said.contains(&format!("cannot reach {url}")), "{said}");
}

#[test]
fn a_recorded_configuration_reads_the_files_of_others_only_if_that_is_allowed() {
    let folder = tests::folder();
    let own = folder.path().join("own");
    fs::create_dir(&own).unwrap();
    fs::write(own.join("p.csv"), "agent,x_m,y_m\n0,0,0\n1,5,0\n").unwrap();
    let text = "[experiment]\nname = \"x\"\nseed = 1\nduration_s = 1.0\nagents = 2\n[robotsim.scenario]\nkind = \"csv\"\n\
        file = \"p.csv\"\n[robotsim.controller]\nkind = \"hold\"\n[netsim.phy]\npropagation = \"full\"\n";
    fs::write(own.join("x.toml"), text).unwrap();
    let run = tests::run(&own.join("x.toml"), &folder.path().join("out"), &[]);
    let run = run.to_str().unwrap();
    // The recording holds the file's content: it is not read again.
    let reproduced = asked(&["reproduce", run], folder.path());
    assert!(reproduced.status.success(), "{}", tests::said(&reproduced));
    let config = format!("{run}/config.toml");
    let refused = asked(&["run", &config, "--out", "again"], folder.path());
    let said = tests::said(&refused);
    assert_eq!(refused.status.code(), Some(2), "{said}");
    assert!(said.contains("robotsim.scenario.file") && said.contains("--allow-file"), "{said}");
    let allowed = ["--allow-file", own.to_str().unwrap()];
    let again = asked(&[&["run", &config, "--out", "again"], &allowed[..]].concat(), folder.path());
    assert!(again.status.success(), "{}", tests::said(&again));
}

#[test]
fn a_model_over_a_trace_is_compared_with_measurements_and_reads_no_file_elsewhere() {
    let folder = tests::folder();
    let own = folder.path().join("own");
    fs::create_dir(&own).unwrap();
    let trace = "{\"start_date\": \"2018-01-11T16:32:22.0\", \"stop_date\": \"2018-01-11T16:33:22.0\", \
                 \"node_count\": 3, \"channels\": [11]}\ndatetime,src,dst,channel,mean_rssi,pdr,tx_count\n\
                 2018-01-11T16:32:22.0,0,1,11,-60,1.0,100\n2018-01-11T16:32:22.0,1,0,11,-65,1.0,100\n";
    fs::write(own.join("own.k7"), trace).unwrap();
    fs::write(folder.path().join("other.k7"), trace).unwrap();
    let mut rows =
        "time_s,tx,rx,channel,tx_x_m,tx_y_m,rx_x_m,rx_y_m,rssi_dbm,received\n".to_owned();
    for time_s in 0..60 {
        rows += &format!("{time_s},0,1,11,0,0,9,0,{}.5,1\n", -60 - time_s % 3);
        rows += &format!("{time_s}.5,1,0,11,9,0,0,0,{}.5,1\n", -64 - time_s % 3);
    }
    fs::write(own.join("data.csv"), rows).unwrap();
    let compare = |file: &str, more: &[&str]| {
        let text = format!("[netsim.phy]\npropagation = \"trace\"\nfile = {file:?}\n");
        fs::write(own.join("model.toml"), text).unwrap();
        let args = ["compare", "model.toml", "--data", "data.csv", "--json", "-"];
        asked(&[&args[..], more].concat(), &own)
    };
    let output = compare("own.k7", &[]);
    assert!(output.status.success(), "{}", tests::said(&output));
    let refused = compare("../other.k7", &[]);
    let said = tests::said(&refused);
    assert_eq!(refused.status.code(), Some(2), "{said}");
    assert!(said.contains("netsim.phy.file: would read a file outside"), "{said}");
    assert!(said.contains("--allow-file "), "{said}");
    let output = compare("../other.k7", &["--allow-file", "../other.k7"]);
    assert!(output.status.success(), "{}", tests::said(&output));
    let refused = compare("gone.k7", &[]);
    let said = tests::said(&refused);
    assert!(said.contains("names a file that does not exist"), "{said}");
}
