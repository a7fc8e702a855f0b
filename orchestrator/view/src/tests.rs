//! A run made up of messages, recorded, and shown.

#[path = "../../record/src/tests/made_up.rs"]
mod made_up;

use crate::live::{LiveRun, Pace};
use crate::page::{self, PageError};
use crate::recorded::RecordedRun;
use crate::server::{RunSource, Server, Shown};
use crate::view;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use made_up::{N, STEP_NS, STEPS, configured, header, record, taken};
use prost::Message as _;
use proto::types::Coupling;
use record::result::{ResultFolder, Trust};
use record::{Ending, Recorder, RunHeader, StepRecord};
use std::io::Read as _;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;

/// The run, recorded in a folder that goes with it.
fn recorded(coupling: Coupling, steps: u64) -> (tempfile::TempDir, RecordedRun) {
    let out = tempfile::tempdir().unwrap();
    let header = RunHeader { coupling, ..header("run") };
    let ending = Ending::complete();
    let run = record(out.path(), header, steps);
    let finished = run.finish(&ending, serde_json::Value::Null, |_| String::new()).unwrap();
    let run =
        RecordedRun::open(&ResultFolder::open(&finished.dir, Trust::Checked).unwrap()).unwrap();
    (out, run)
}

fn steps(frames: &[view::Frame]) -> Vec<u64> {
    frames.iter().map(|frame| frame.step).collect()
}

/// The pairs of sender and receiver within 2 m of each other, in order: those that hear each other.
fn neighbours() -> Vec<(u32, u32)> {
    let pairs = (0..6u32).flat_map(|a| (0..6u32).map(move |b| (a, b)));
    pairs.filter(|(a, b)| a != b && a.abs_diff(*b) <= 2).collect()
}

fn pairs(links: &view::Links) -> Vec<(u32, u32)> {
    links.sender.iter().copied().zip(links.receiver.iter().copied()).collect()
}

#[test]
fn a_span_has_the_frame_at_its_beginning_and_those_after_it() {
    let (_out, run) = recorded(Coupling::Sequential, STEPS);
    assert_eq!((run.run().step_count, run.run().end_ns), (STEPS, STEPS * STEP_NS));
    let frames = run.frames(4 * STEP_NS + 5, 7 * STEP_NS, 100).unwrap();
    assert_eq!(steps(&frames), [4, 5, 6, 7]);
    for frame in &frames {
        assert_eq!(frame.from_ns, (frame.step - 1) * STEP_NS);
        assert!((frame.x_m[2] - 2.0 - 0.2 * frame.step as f32).abs() < 1e-3);
        assert_eq!(frame.alive, [0b0011_1111]);
        let links = frame.links.as_ref().unwrap();
        assert_eq!(pairs(links), neighbours());
        assert!(links.steps_ago.is_empty() && links.received.iter().all(|n| *n == 1));
    }
    assert_eq!(steps(&run.frames(0, 2 * STEP_NS, 100).unwrap()), [0, 1, 2]);
    assert_eq!(steps(&run.frames(STEP_NS - 1, 0, 100).unwrap()), [0]);
    // After the end there is nothing more.
    assert_eq!(steps(&run.frames(900 * STEP_NS, u64::MAX, 9).unwrap()), [STEPS]);
}

#[test]
fn frames_that_stand_for_several_steps_count_what_was_delivered_in_all() {
    let (_out, run) = recorded(Coupling::Sequential, STEPS);
    let frames = run.frames(0, STEPS * STEP_NS, 3).unwrap();
    assert_eq!(steps(&frames), [0, 4, 8, 12]);
    let links = frames[2].links.as_ref().unwrap();
    assert_eq!(pairs(links), neighbours());
    assert!(links.received.iter().all(|n| *n == 4), "{links:?}");
    assert_eq!(frames[2].n_sent, [4, 4, 4, 4, 4, 4, 0]);
    assert_eq!(frames[2].from_ns, 4 * STEP_NS);
}

#[test]
fn receivers_know_positions_of_the_step_before_where_both_sides_run_at_once() {
    let (_out, run) = recorded(Coupling::Parallel, STEPS);
    let frames = run.frames(3 * STEP_NS, 3 * STEP_NS, 0).unwrap();
    let links = frames[0].links.as_ref().unwrap();
    assert!(links.steps_ago.iter().all(|steps| *steps == 1) && !links.steps_ago.is_empty());
}

#[test]
fn strides_too_long_to_read_through_still_have_the_steps_at_their_ends() {
    let n_steps = 400;
    let (_out, run) = recorded(Coupling::Sequential, n_steps);
    let frames = run.frames(0, n_steps * STEP_NS, 4).unwrap();
    assert_eq!(steps(&frames), [0, 100, 200, 300, 400]);
    // Of such frames only the last step was read, and they say so.
    assert_eq!(frames[1].from_ns, 99 * STEP_NS);
}

#[test]
fn an_overview_of_few_points_keeps_the_means() {
    let (_out, run) = recorded(Coupling::Sequential, 4001);
    let overview = run.all_frames(1000, |_| true).unwrap();
    assert!(overview.complete);
    let series =
        |name: &str| overview.series.iter().find(|series| series.name == name).unwrap().clone();
    let speed = series("flock_speed_mps");
    assert!(speed.time_s.len() <= 2000, "{}", speed.time_s.len());
    // Drifting at 2 m/s throughout, however many steps make a point.
    assert!(speed.value.iter().all(|value| (value - 2.0).abs() < 1e-6));
    assert!((speed.time_s.last().unwrap() - 400.1).abs() < 1e-9);
    let heard = series("mean_neighbours");
    let expected = neighbours().len() as f64 / 6.0;
    assert!(heard.value.iter().all(|value| (value - expected).abs() < 1e-12));
}

/// What a page that stands by itself holds.
fn held(html: &str) -> view::Recordings {
    let begin = "<script id=\"recording\" type=\"application/octet-stream\">";
    let data = html.split_once(begin).unwrap().1.split_once("</script>").unwrap().0;
    let mut bytes = Vec::new();
    let data = STANDARD.decode(data).unwrap();
    flate2::read::GzDecoder::new(&data[..]).read_to_end(&mut bytes).unwrap();
    view::Recordings::decode(&bytes[..]).unwrap()
}

#[test]
fn a_page_by_itself_holds_all_runs_in_the_size_it_may_have() {
    let (_out, run) = recorded(Coupling::Sequential, STEPS);
    let (_second, second) = recorded(Coupling::Sequential, 30);
    let whole = page::standalone(&[run, second], None, 20_000_000).unwrap();
    assert_eq!(whole.kept, [(1, 13), (1, 31)]);
    let recordings = held(&whole.html).recordings;
    let counts: Vec<usize> = recordings.iter().map(|run| run.frames.len()).collect();
    assert_eq!(counts, [13, 31]);
    assert!(!whole.html.contains("src=\"page.js\"") && !whole.html.contains("href=\"page.css\""));

    let (_long, long) = recorded(Coupling::Sequential, 3000);
    let base = whole.html.len();
    let most_bytes = base + 40_000;
    let small = page::standalone(std::slice::from_ref(&long), None, most_bytes).unwrap();
    assert!(small.html.len() <= most_bytes, "{}", small.html.len());
    let recording = &held(&small.html).recordings[0];
    let (every, n_frames) = small.kept[0];
    assert!(1 < every, "{every}");
    assert_eq!((recording.every_steps, recording.frames.len() as u64), (every, n_frames));
    assert_eq!(recording.frames.last().unwrap().step, 3000);
    assert!(recording.overview.as_ref().unwrap().complete);

    let error = page::standalone(std::slice::from_ref(&long), None, 5000).unwrap_err();
    assert!(matches!(error, PageError::TooLarge { .. }), "{error}");
}

/// Sends a request and returns the whole reply.
async fn ask(url: &str, request: &str) -> String {
    let host = url.strip_prefix("http://").unwrap().split('/').next().unwrap();
    let mut stream = TcpStream::connect(host).await.unwrap();
    stream.write_all(request.replace("HOST", host).as_bytes()).await.unwrap();
    let mut reply = Vec::new();
    let reading = stream.read_to_end(&mut reply);
    let _ = tokio::time::timeout(Duration::from_secs(10), reading).await.unwrap();
    String::from_utf8_lossy(&reply).into_owned()
}

#[tokio::test]
async fn only_who_knows_the_token_and_comes_from_here_is_answered() {
    let (_out, run) = recorded(Coupling::Sequential, STEPS);
    let shown = Shown::new(vec![RunSource::Recorded(Arc::new(run))]);
    let server = Server::bind(0, shown).await.unwrap();
    let url = server.url().to_owned();
    let token = url.split_once("token=").unwrap().1.to_owned();
    let serving = tokio::spawn(server.serve());
    let get = |path: &str, headers: &str| {
        let request = format!("GET {path} HTTP/1.1\r\nConnection: close\r\n{headers}\r\n");
        let url = url.clone();
        async move { ask(&url, &request).await }
    };
    let bearer = format!("Host: HOST\r\nAuthorization: Bearer {token}\r\n");
    let page = get("/", "Host: HOST\r\n").await;
    assert!(page.starts_with("HTTP/1.1 200") && page.contains("default-src 'none'"), "{page}");
    for (path, headers, status) in [
        ("/api/runs", bearer.clone(), "200"),
        ("/api/runs", "Host: HOST\r\n".to_owned(), "401"),
        ("/api/runs", bearer.replace(&token, "0123456789abcdef0123456789abcdef"), "401"),
        ("/api/runs", bearer.replace("Bearer ", ""), "401"),
        // A page of another site, and a name that was made to point here.
        ("/api/runs", format!("{bearer}Origin: https://evil.example\r\n"), "403"),
        ("/api/runs", format!("{bearer}Origin: null\r\n"), "403"),
        ("/api/runs", format!("{bearer}Origin: http://ev\u{ef}l.example\r\n"), "403"),
        (
            "/api/runs",
            format!("{bearer}Origin: http://HOST\r\nOrigin: https://evil.example\r\n"),
            "403",
        ),
        ("/api/runs", format!("{bearer}Origin: http://HOST\r\n"), "200"),
        ("/api/runs", bearer.replace("HOST", "evil.example"), "403"),
        ("/", "Host: 127.0.0.1\r\n".to_owned(), "403"),
        ("/api/runs/1/overview", bearer.clone(), "404"),
        ("/api/runs/0/frames?from_ns=0&until_ns=9&most=2001", bearer.clone(), "400"),
        ("/api/runs/0/frames?from_ns=-1&until_ns=9&most=1", bearer.clone(), "400"),
        ("/api/runs/0/frames?from_ns=0&until_ns=9&most=1", bearer.clone(), "200"),
        ("/api/live", bearer.clone(), "409"),
        ("/api/nothing", bearer.clone(), "404"),
    ] {
        let reply = get(path, &headers).await;
        assert!(reply.starts_with(&format!("HTTP/1.1 {status}")), "{path} {headers}: {reply}");
    }
    serving.abort();
}

#[tokio::test]
async fn a_run_that_lasts_is_driven_only_if_that_was_asked_for() {
    for (controllable, status) in [(false, "403"), (true, "204")] {
        let pace = Arc::new(Pace::new(None));
        let header = header("run");
        let (live, feed) =
            LiveRun::begin("run", &configured(&header), Arc::clone(&pace), controllable).unwrap();
        let server = Server::bind(0, Shown::new(vec![RunSource::Live(live)])).await.unwrap();
        let url = server.url().to_owned();
        let token = url.split_once("token=").unwrap().1.to_owned();
        let serving = tokio::spawn(server.serve());
        // `kind` (field 1) = pause (1).
        let reply = ask(
            &url,
            &format!(
                "POST /api/control HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\nAuthorization: Bearer {token}\r\n\
                 Content-Length: 2\r\n\r\n\x08\x01"
            ),
        )
        .await;
        assert!(reply.starts_with(&format!("HTTP/1.1 {status}")), "{reply}");
        assert_eq!(feed.may_step(0), !controllable);
        serving.abort();
    }
}

#[test]
fn a_paused_run_takes_single_steps_and_goes_on() {
    let pace = Pace::new(None);
    assert!(pace.may_step(0) && !pace.is_paused());
    pace.control(view::ControlKind::Pause);
    assert!(!pace.may_step(0) && pace.is_paused());
    pace.control(view::ControlKind::Step);
    pace.control(view::ControlKind::Step);
    assert!(pace.may_step(0) && pace.may_step(0) && !pace.may_step(0));
    pace.control(view::ControlKind::Resume);
    assert!(pace.may_step(0) && !pace.is_paused());
}

#[test]
fn a_run_is_held_to_the_speed_that_was_asked_for() {
    let pace = Pace::new(Some(0.001));
    assert!(pace.may_step(0));
    // A second later at a thousandth of real time is a quarter of an hour from now.
    assert!(!pace.may_step(1_000_000_000));
}

/// A message of a stream that has a length before each.
fn live_message(bytes: &[u8]) -> view::Live {
    view::Live::decode_length_delimited(bytes).unwrap()
}

#[tokio::test]
async fn a_viewer_sees_the_latest_frame_and_every_event_and_point_once() {
    let header = header("run");
    let (live, mut feed) =
        LiveRun::begin("run", &configured(&header), Arc::new(Pace::new(None)), false).unwrap();
    feed.step(&taken(1));
    let mut early = live.viewer();
    let first = live_message(&early.next().await.unwrap());
    assert!(first.status.unwrap().reached_ns <= STEP_NS);
    let mut gone = taken(2);
    // Robot 3 ceases to exist.
    let mut robots = (*gone.robots).clone();
    robots.states.alive.set(3, false);
    gone.robots = Arc::new(robots);
    feed.step(&gone);
    for step in 3..=40 {
        feed.step(&taken(step));
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    drop(feed);
    let mut messages = vec![first];
    while let Some(message) = early.next().await {
        messages.push(live_message(&message));
    }
    let events: Vec<String> = messages
        .iter()
        .flat_map(|message| message.added.iter().flat_map(|added| &added.events))
        .map(|event| event.text.clone())
        .collect();
    assert_eq!(events, ["robot 3 is lost", "robot 3 is there"]);
    let alive: Vec<_> = messages
        .iter()
        .flat_map(|message| message.added.iter().flat_map(|added| &added.series))
        .filter(|series| series.name == "n_alive")
        .collect();
    let times: Vec<f64> = alive.iter().flat_map(|series| series.time_s.clone()).collect();
    assert!(times.is_sorted_by(|a, b| a < b) && times.last() == Some(&4.0), "{times:?}");
    let shown: Vec<u64> =
        messages.iter().filter_map(|message| message.frame.as_ref()).map(|f| f.step).collect();
    assert!(shown.is_sorted_by(|a, b| a < b) && shown.len() < 40, "{shown:?}");
    assert!(messages.last().unwrap().status.unwrap().ended);
    assert_eq!(N, 7);

    // A viewer that connects late gets all earlier events.
    let late = live_message(&live.viewer().next().await.unwrap());
    assert_eq!(late.added.unwrap().events.len(), 2);
}

#[test]
fn steps_that_a_resumed_run_takes_again_are_shown_once() {
    let header = header("run");
    let (live, mut feed) =
        LiveRun::begin("run", &configured(&header), Arc::new(Pace::new(None)), false).unwrap();
    for step in [1, 2, 3, 2, 3, 4] {
        feed.step(&taken(step));
    }
    drop(feed);
    while !live.has_ended() {
        std::thread::park_timeout(Duration::from_millis(5));
    }
    let overview = live.overview();
    let alive = overview.series.iter().find(|series| series.name == "n_alive").unwrap();
    assert_eq!(alive.time_s, [0.1, 0.2, 0.3, 0.4]);
}

#[test]
fn damage_that_is_found_in_the_background_is_told_and_shown() {
    let (out, run) = recorded(Coupling::Sequential, STEPS);
    let file = out.path().join("run/run.mcap");
    let mut bytes = std::fs::read(&file).unwrap();
    // Of the magic number at the end, which no step needs.
    *bytes.last_mut().unwrap() ^= 4;
    std::fs::write(&file, bytes).unwrap();
    let run = Arc::new(run);
    let (tell, told) = std::sync::mpsc::channel();
    run.read_in_background(move |failure| tell.send(failure.to_owned()).unwrap());
    let told = told.recv_timeout(Duration::from_secs(60)).unwrap();
    assert!(told.contains("run.mcap: bytes 0 to ") && told.contains("--unverified"), "{told}");
    let shown = (0..600).find_map(|_| {
        std::thread::sleep(Duration::from_millis(100));
        run.overview().err()
    });
    assert_eq!(shown, Some(told));
}
