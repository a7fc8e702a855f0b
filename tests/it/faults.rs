//! A side that ends, crashes, hangs or lies ends the run with one message that names it.

use std::path::Path;
use std::process::{Child, Command, Output};
use tests::fake::{Fault, Faulty};
use tests::{end_of, signal, wait_until_recording};

/// An experiment that lasts until something goes wrong.
fn endless(folder: &Path) -> std::path::PathBuf {
    let path = folder.join("endless.toml");
    std::fs::write(
        &path,
        "[experiment]\nname = \"endless\"\nseed = 1\nduration_s = 1e8\nagents = 4\n\
         [robotsim.scenario]\nkind = \"line\"\n[robotsim.controller]\nkind = \"random-jump\"\n[netsim.phy]\npropagation = \"full\"\n\
         [output]\nreport = false\nsteps = false\npackets = false\nmotes = false\n",
    )
    .unwrap();
    path
}

fn start(folder: &Path, args: &[&str]) -> Child {
    let mut command = Command::new(tests::executable("murmuration"));
    command.arg("run").arg(endless(folder)).args(args);
    tests::spawn(&mut command, folder)
}

fn find_child(parent: u32, side: &str) -> Option<u32> {
    std::fs::read_dir("/proc").unwrap().find_map(|entry| {
        let path = entry.ok()?.path();
        let id: u32 = path.file_name()?.to_str()?.parse().ok()?;
        let stat = std::fs::read_to_string(path.join("stat")).ok()?;
        // After the name in parentheses: state, parent.
        let its_parent: u32 = stat.rsplit_once(')')?.1.split_whitespace().nth(1)?.parse().ok()?;
        let arguments = std::fs::read(path.join("cmdline")).ok()?;
        let is_side =
            arguments.split(|&byte| byte == 0).any(|argument| argument == side.as_bytes());
        (its_parent == parent && is_side).then_some(id)
    })
}

fn exists(process: u32) -> bool {
    Path::new(&format!("/proc/{process}")).exists()
}

/// The run failed with one message, kept what it had, and left no process behind.
fn assert_kept(folder: &Path, ended: &Output, message: &[&str]) {
    let stderr = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(1), "{stderr}");
    let errors: Vec<&str> = stderr.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(errors.len(), 1, "{stderr}");
    for part in message {
        assert!(errors[0].contains(part), "{part:?} is not in {:?}", errors[0]);
    }
    let dir = folder.join("runs/endless");
    let summary: serde_json::Value =
        serde_json::from_slice(&std::fs::read(dir.join("summary.json")).unwrap()).unwrap();
    assert_eq!(summary["status"], "failed", "{summary}");
    let output = tests::orchestrator(&["verify", dir.to_str().unwrap()], folder);
    assert!(output.status.success(), "{}", tests::said(&output));
}

fn signalled(side: &str, with: &str, message: &[&str]) {
    let folder = tests::folder();
    let run = start(folder.path(), &[]);
    wait_until_recording(&folder.path().join("runs"));
    let [child, other] = match side {
        "netsim" => ["netsim", "robotsim"],
        _ => ["robotsim", "netsim"],
    }
    .map(|side| find_child(run.id(), side).unwrap());
    signal(with, child);
    let ended = end_of(run);
    assert_kept(folder.path(), &ended, message);
    assert!(!exists(child) && !exists(other), "a child was left behind");
}

#[test]
fn robots_that_are_killed_are_named() {
    signalled("robotsim", "-KILL", &["robotsim: the process ended", "SIGKILL"]);
}

#[test]
fn a_network_that_is_killed_is_named() {
    signalled("netsim", "-KILL", &["netsim: the process ended", "SIGKILL"]);
}

#[test]
fn robots_that_crash_are_named() {
    signalled("robotsim", "-ABRT", &["robotsim: the process ended", "SIGABRT"]);
}

#[test]
fn a_network_that_exits_is_named() {
    signalled("netsim", "-TERM", &["netsim: the process ended", "exit status 0"]);
}

#[test]
fn robots_that_are_stopped_are_named() {
    signalled("robotsim", "-STOP", &["robotsim: does not respond"]);
}

#[test]
fn a_network_that_is_stopped_is_named() {
    signalled("netsim", "-STOP", &["netsim: does not respond"]);
}

#[test]
fn a_side_that_runs_elsewhere_and_dies_is_named() {
    let folder = tests::folder();
    let netsim = tests::Server::start("netsim", &[]).unwrap();
    let run = start(folder.path(), &["--netsim", &netsim.url]);
    wait_until_recording(&folder.path().join("runs"));
    drop(netsim);
    let ended = end_of(run);
    assert_kept(
        folder.path(),
        &ended,
        &["netsim: the connection to http://127.0.0.1:", "was lost"],
    );
}

#[test]
fn robots_that_say_more_than_a_frame_carries_are_named() {
    let folder = tests::folder();
    let url = &Faulty::robots(Fault::OtherPayload).url;
    let args = ["--robotsim", url, "--set", "netsim.mode=6tisch"];
    let ended = end_of(start(folder.path(), &args));
    let message = "robotsim: malformed reply to step 3: payloads: robot 0 broadcasts 148 bytes, and the network carries at most 103 \
                   bytes in a broadcast";
    assert_kept(folder.path(), &ended, &[message]);
}

/// Runs against a side that breaks the contract in step 3.
fn lying(side: &str, url: &str, message: &[&str]) {
    let folder = tests::folder();
    let option = format!("--{side}");
    // Of a side that is alive and does not reply, the run learns only by the deadline of a step.
    let hangs = message.contains(&"it is alive");
    let deadline: &[&str] = if hangs { &["--set", "experiment.step_deadline_s=4"] } else { &[] };
    let ended = end_of(start(folder.path(), &[&[&option, url], deadline].concat()));
    assert_kept(folder.path(), &ended, message);
    let summary = std::fs::read_to_string(folder.path().join("runs/endless/summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    assert_eq!(summary["steps"], 2, "what was right until then is kept");
}

#[test]
fn robots_that_lie_are_named() {
    for (fault, message) in [
        (Fault::WrongStep, &["robotsim: replied for step 2 instead of step 3"][..]),
        (
            Fault::WrongTime,
            &["robotsim: its time is 120000001 ns after step 3, which ends at 120000000 ns"],
        ),
        (Fault::WrongDigest, &["robotsim: its digest of step 3 is abab"]),
        (
            Fault::ShortColumn,
            &["robotsim: malformed reply to step 3: states.x_m: must have 4 entries"],
        ),
        (
            Fault::NotANumber,
            &[
                "robotsim: malformed reply to step 3: states.y_m[0]: must be finite and at most 1e12 in magnitude, got NaN",
            ],
        ),
        (Fault::OtherNumber, &["robotsim: its digest of step 3 is"]),
        (Fault::Silent, &["robotsim: does not respond: no reply to step 3"]),
        (Fault::Slow, &["robotsim: no reply to step 3", "it is alive"]),
    ] {
        lying("robotsim", &Faulty::robots(fault).url, message);
    }
}

#[test]
fn a_network_that_lies_is_named() {
    for (fault, message) in [
        (Fault::WrongStep, &["netsim: replied for step 2 instead of step 3"][..]),
        (
            Fault::WrongTime,
            &["netsim: its time is 120000001 ns after step 3, which ends at 120000000 ns"],
        ),
        (Fault::WrongDigest, &["netsim: its digest of step 3 is abab"]),
        (
            Fault::ShortColumn,
            &["netsim: malformed reply to step 3: deliveries.transmissions.sent_ns"],
        ),
        (
            Fault::NotANumber,
            &["netsim: malformed reply to step 3: deliveries.rssi_dbm: must be finite"],
        ),
        (Fault::OtherNumber, &["netsim: its digest of step 3 is"]),
        (
            Fault::OtherPayload,
            &[
                "netsim: malformed reply to step 3: deliveries.transmissions.payloads: entry 0 is not a payload that robot",
            ],
        ),
        (Fault::Healthy, &["netsim: no reply to step 3", "it is alive"]),
        (Fault::Silent, &["netsim: does not respond: no reply to step 3"]),
        (Fault::Slow, &["netsim: no reply to step 3", "it is alive"]),
    ] {
        lying("netsim", &Faulty::network(fault).url, message);
    }
}

/// Passes bytes on between a client and a server until `n_bytes` came from the server; from then on the client is sent
/// noise. Returns where it listens.
fn corrupting_proxy(server: &str, n_bytes: usize) -> String {
    use std::io::{Read as _, Write as _};
    use std::net::{TcpListener, TcpStream};
    let server = server.strip_prefix("http://").unwrap().to_owned();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        for client in listener.incoming() {
            let mut client = client.unwrap();
            let mut upstream = TcpStream::connect(&server).unwrap();
            let (mut to_server, mut from_client) =
                (upstream.try_clone().unwrap(), client.try_clone().unwrap());
            std::thread::spawn(move || std::io::copy(&mut from_client, &mut to_server));
            std::thread::spawn(move || {
                let (mut passed, mut buffer) = (0, [0; 4096]);
                while let Ok(n @ 1..) = upstream.read(&mut buffer) {
                    if n_bytes < passed {
                        // Neither a frame of HTTP/2 nor anything else.
                        buffer[..n]
                            .iter_mut()
                            .enumerate()
                            .for_each(|(i, byte)| *byte ^= 0xa5 ^ i as u8);
                    }
                    passed += n;
                    if client.write_all(&buffer[..n]).is_err() {
                        break;
                    }
                }
            });
        }
    });
    url
}

#[test]
fn a_side_whose_bytes_turn_to_noise_is_named() {
    for side in ["robotsim", "netsim"] {
        let folder = tests::folder();
        let server = tests::Server::start(side, &[]).unwrap();
        let url = corrupting_proxy(&server.url, 4_000_000);
        let ended = end_of(start(folder.path(), &[&format!("--{side}"), &url]));
        assert_kept(folder.path(), &ended, &[&format!("{side}: "), "during step"]);
    }
}
