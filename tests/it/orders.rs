//! Orders from outside: only where the experiment allows them, with the token of the run, and never unseen.

use proto_host::services::robot_sim_service_client::RobotSimServiceClient;
use proto_messages::v1;
use std::io::{BufRead as _, BufReader};
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tests::{DEADLINE, end_of, signal, wait_until, wait_until_recording};
use tonic::transport::Endpoint;
use tonic::{Code, Request, Status};

fn start(folder: &Path, more: &str, args: &[&str]) -> Child {
    let path = folder.join("ordered.toml");
    let text = format!(
        "[experiment]\nname = \"ordered\"\nseed = 1\nduration_s = 1e8\nagents = 4\n{more}\
         [robotsim.scenario]\nkind = \"line\"\n[robotsim.controller]\nkind = \"hold\"\n\
         [netsim.phy]\npropagation = \"full\"\n"
    );
    std::fs::write(&path, text).unwrap();
    Command::new(tests::executable("murmuration"))
        .arg("run")
        .arg(path)
        .args(args)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn order(token: Option<&str>) -> Request<v1::RobotSimServiceCommandRequest> {
    use v1::agent_command::{Order, Velocity};
    let velocity = Velocity { vx_mps: 1.0, vy_mps: 0.0, vz_mps: 0.0 };
    let order = Some(Order::Velocity(velocity));
    let command = v1::AgentCommand { agent: 2, source: "operator".to_owned(), order };
    let mut request = Request::new(v1::RobotSimServiceCommandRequest { commands: vec![command] });
    if let Some(token) = token {
        let value = proto_host::bearer(token).parse().unwrap();
        request.metadata_mut().insert("authorization", value);
    }
    request
}

/// Gives an order to whoever listens there, as soon as it listens and is configured.
async fn give(url: &str, token: Option<&str>) -> Result<(), Status> {
    let begun = Instant::now();
    let endpoint = Endpoint::from_shared(url.to_owned()).unwrap();
    // A socket's file is there from its bind on, and refuses connections until its listen.
    let channel = loop {
        match endpoint.connect().await {
            Err(_) if begun.elapsed() < DEADLINE => {
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
            answer => break answer.unwrap(),
        }
    };
    let mut robots = RobotSimServiceClient::new(channel);
    loop {
        match robots.command(order(token)).await {
            Err(status)
                if status.code() == Code::FailedPrecondition && begun.elapsed() < DEADLINE =>
            {
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
            answer => return answer.map(|_| ()),
        }
    }
}

/// The socket of the robots that a run has started.
fn socket_of(run: u32) -> PathBuf {
    let mut socket = None;
    wait_until("the robots were not started", || {
        socket = std::fs::read_dir("/proc").unwrap().flatten().find_map(|entry| {
            let arguments = std::fs::read_to_string(entry.path().join("cmdline")).ok()?;
            let stat = std::fs::read_to_string(entry.path().join("stat")).ok()?;
            let parent = stat.rsplit_once(')')?.1.split_whitespace().nth(1)?;
            let path = arguments.split('\0').find_map(|text| text.strip_prefix("unix:"))?;
            let is_child = parent == run.to_string() && arguments.contains("robotsim");
            (is_child && Path::new(path).exists()).then(|| PathBuf::from(path))
        });
        socket.is_some()
    });
    socket.unwrap()
}

/// Interrupts a run and returns the summary that it left.
fn interrupted(folder: &Path, run: Child) -> serde_json::Value {
    signal("-INT", run.id());
    let _ = end_of(run);
    let path = folder.join("runs/ordered/summary.json");
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

#[tokio::test]
async fn children_are_out_of_reach_of_others_and_take_no_orders() {
    let folder = tests::folder();
    let run = start(folder.path(), "", &[]);
    let socket = socket_of(run.id());
    let home = socket.parent().unwrap().to_owned();
    assert_eq!(std::fs::metadata(&home).unwrap().permissions().mode() & 0o777, 0o700);
    let status = give(&format!("unix:{}", socket.display()), None).await.unwrap_err();
    assert_eq!(status.code(), Code::PermissionDenied, "{status}");
    assert!(status.message().contains("experiment.accept_commands"), "{status}");
    signal("-INT", run.id());
    let _ = end_of(run);
    assert!(!home.exists(), "{} was left behind", home.display());
}

#[tokio::test]
async fn an_experiment_that_accepts_commands_says_where_and_its_summary_lists_them() {
    let folder = tests::folder();
    let mut run = start(folder.path(), "accept_commands = true\n", &[]);
    let stderr = BufReader::new(run.stderr.take().unwrap());
    let mut lines = stderr.lines().map(Result::unwrap);
    let line = lines.find(|line| line.starts_with("robotsim takes orders at ")).unwrap();
    let (url, token) = line
        .strip_prefix("robotsim takes orders at ")
        .unwrap()
        .split_once(" with authorization: Bearer ")
        .unwrap();
    let arguments = std::fs::read(format!("/proc/{}/cmdline", run.id())).unwrap();
    assert!(!String::from_utf8_lossy(&arguments).contains(token));
    for wrong in [None, Some("00000000000000000000000000000000")] {
        let status = give(url, wrong).await.unwrap_err();
        assert_eq!(status.code(), Code::Unauthenticated, "{status}");
    }
    give(url, Some(token)).await.unwrap();
    give(url, Some(token)).await.unwrap();
    wait_until_recording(&folder.path().join("runs"));
    // Nobody reads any further what it says.
    std::thread::spawn(move || lines.for_each(drop));
    let summary = interrupted(folder.path(), run);
    assert_eq!(summary["orders_from_outside"]["robots"]["operator"], 2, "{summary}");
    let warnings = summary["warnings"].to_string();
    let expected = "other programs gave 2 orders to robots (operator 2) during the run";
    assert!(warnings.contains(expected), "{warnings}");
    let report = folder.path().join("runs/ordered/report.html");
    assert!(std::fs::read_to_string(report).unwrap().contains(expected));
}

#[tokio::test]
async fn orders_to_a_simulator_that_runs_elsewhere_are_listed_too() {
    let folder = tests::folder();
    let robotsim = tests::Server::start("robotsim", &[]).unwrap();
    let mut run = start(folder.path(), "", &["--robotsim", &robotsim.url]);
    let stderr = run.stderr.take().unwrap();
    std::thread::spawn(move || BufReader::new(stderr).lines().for_each(drop));
    give(&robotsim.url, None).await.unwrap();
    wait_until_recording(&folder.path().join("runs"));
    let summary = interrupted(folder.path(), run);
    assert_eq!(summary["orders_from_outside"]["robots"]["operator"], 1, "{summary}");
}

#[tokio::test]
async fn a_simulator_that_requires_a_token_takes_orders_only_with_it() {
    let folder = tests::folder();
    let path = folder.path().join("token");
    std::fs::write(&path, "0123456789abcdef\n").unwrap();
    let text = path.to_str().unwrap();
    let readable = Command::new(tests::executable("robotsim"))
        .args(["--require-token", text])
        .output()
        .unwrap();
    assert_eq!(readable.status.code(), Some(2), "{}", tests::said(&readable));
    assert!(tests::said(&readable).contains("other users can read it"));
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).unwrap();
    let robotsim = tests::Server::start("robotsim", &["--require-token", text]).unwrap();
    let channel = Endpoint::from_shared(robotsim.url.clone()).unwrap().connect().await.unwrap();
    let mut robots = RobotSimServiceClient::new(channel);
    let status = robots.command(order(None)).await.unwrap_err();
    assert_eq!(status.code(), Code::Unauthenticated, "{status}");
    // With it, what is missing is an experiment.
    let status = robots.command(order(Some("0123456789abcdef"))).await.unwrap_err();
    assert_eq!(status.code(), Code::FailedPrecondition, "{status}");
}
