//! A bit that flips on its way between the orchestrator and a simulator is noticed, wherever it is in a step.

use std::io::{Read, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use tests::fake::{Fault, Faulty};

/// Which way the bytes go whose bit flips.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    ToServer,
    ToClient,
}

/// Where a bit flips.
#[derive(Clone, Copy, Debug)]
struct Flip {
    way: Way,
    /// Messages of steps that pass before it.
    after: u64,
    /// Where in the message, as a share of its length.
    at: f64,
}

/// Passes frames of HTTP/2 on; one bit of a message of a step flips. Everything but a frame's content passes as it is.
fn pass(from: &mut TcpStream, to: &mut TcpStream, flip: Option<Flip>, is_session: &AtomicU64) {
    let mut seen = 0;
    if flip.is_none() {
        let _ = std::io::copy(from, to);
        return;
    }
    let is_to_server = flip.is_some_and(|flip| flip.way == Way::ToServer);
    if is_to_server {
        // What a client sends before its first frame.
        let mut preface = [0; 24];
        if from.read_exact(&mut preface).is_err() || to.write_all(&preface).is_err() {
            return;
        }
    }
    loop {
        let mut head = [0; 9];
        if from.read_exact(&mut head).is_err() {
            return;
        }
        let length = usize::from(head[0]) << 16 | usize::from(head[1]) << 8 | usize::from(head[2]);
        let mut content = vec![0; length];
        if from.read_exact(&mut content).is_err() {
            return;
        }
        let (is_data, stream) = (head[3] == 0, u64::from(head[8]) | u64::from(head[7]) << 8);
        // Calls of their own come first: the session is the stream that has more than one message.
        let last = is_session.load(Ordering::Relaxed);
        is_session.store(last.max(stream), Ordering::Relaxed);
        if last < stream {
            seen = 0;
        }
        // Frames of this length are pieces of the description.
        let is_message = is_data && (41..16_384).contains(&length) && stream == last;
        if let Some(flip) = flip.filter(|_| is_message) {
            seen += 1;
            if seen == flip.after {
                // Behind the prefix of gRPC and the tags that say what follows.
                let byte = 16 + (flip.at * (length - 17) as f64) as usize;
                content[byte] ^= 1 << (byte % 8);
            }
        }
        if to.write_all(&head).and_then(|()| to.write_all(&content)).is_err() {
            return;
        }
    }
}

/// Returns where the proxy listens.
fn proxy(server: &str, flip: Flip) -> String {
    let server = server.strip_prefix("http://").unwrap().to_owned();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        for client in listener.incoming() {
            let mut client = client.unwrap();
            let mut upstream = TcpStream::connect(&server).unwrap();
            let (mut to_server, mut from_client) =
                (upstream.try_clone().unwrap(), client.try_clone().unwrap());
            client.set_nodelay(true).unwrap();
            upstream.set_nodelay(true).unwrap();
            let stream = Arc::new(AtomicU64::new(0));
            let also = Arc::clone(&stream);
            let there = Some(flip).filter(|flip| flip.way == Way::ToServer);
            let back = Some(flip).filter(|flip| flip.way == Way::ToClient);
            std::thread::spawn(move || pass(&mut from_client, &mut to_server, there, &also));
            std::thread::spawn(move || pass(&mut upstream, &mut client, back, &stream));
        }
    });
    url
}

fn experiment(folder: &Path) -> std::path::PathBuf {
    let path = folder.join("flipped.toml");
    std::fs::write(
        &path,
        "[experiment]\nname = \"flipped\"\nseed = 1\nduration_s = 12.0\nagents = 6\nstep_deadline_s = 4.0\n\
         [robotsim.scenario]\nkind = \"line\"\n[robotsim.controller]\nkind = \"flocking\"\nflock_radius_m = 10.0\n\
         [netsim.phy]\npropagation = \"experimental-randomness\"\n[output]\nlinks = \"all\"\nreport = false\n",
    )
    .unwrap();
    path
}

#[test]
fn a_bit_that_flips_in_a_message_of_a_step_is_noticed_and_the_side_is_named() {
    for side in ["robotsim", "netsim"] {
        let server = tests::Server::start(side, &[]).unwrap();
        for way in [Way::ToServer, Way::ToClient] {
            for index in 0..8 {
                let flip = Flip { way, after: 20, at: (f64::from(index) + 0.37) / 8.0 };
                let folder = tests::folder();
                let config = experiment(folder.path());
                let url = proxy(&server.url, flip);
                let option = format!("--{side}");
                let args = ["run", config.to_str().unwrap(), &option, &url];
                let output = tests::orchestrator(&args, folder.path());
                let said = tests::said(&output);
                assert_eq!(output.status.code(), Some(1), "{side} {flip:?}: {said}");
                let named = format!("error: {side}: ");
                assert!(said.contains(&named), "{side} {flip:?}: {said}");
                let verified = tests::orchestrator(&["verify", "runs/flipped"], folder.path());
                assert!(verified.status.success(), "{flip:?}: {}", tests::said(&verified));
            }
        }
    }
}

#[test]
fn a_simulator_with_the_lesser_digest_still_works_and_its_user_is_told_what_is_not_covered() {
    let folder = tests::folder();
    let config = experiment(folder.path());
    let plain = tests::run(&config, &folder.path().join("plain"), &[]);
    for side in ["robotsim", "netsim"] {
        let server = match side {
            "robotsim" => Faulty::robots(Fault::LesserDigest),
            _ => Faulty::network(Fault::LesserDigest),
        };
        let option = format!("--{side}");
        let args = ["run", config.to_str().unwrap(), &option, &server.url, "--out", side];
        let output = tests::orchestrator(&args, folder.path());
        assert!(output.status.success(), "{}", tests::said(&output));
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(
            stderr.contains(&format!("warning: {side}: {side} does not announce full_digest")),
            "{stderr}"
        );
        let dir = folder.path().join(side).join("flipped");
        let provenance = std::fs::read_to_string(dir.join("provenance.json")).unwrap();
        let provenance: serde_json::Value = serde_json::from_str(&provenance).unwrap();
        assert_eq!(provenance[side]["digest"], "positions and deliveries");
        let summary = |dir: &Path| std::fs::read_to_string(dir.join("summary.json")).unwrap();
        assert_eq!(summary(&dir), summary(&plain), "the record's digest covers everything");
        let output = tests::orchestrator(&["verify", dir.to_str().unwrap()], folder.path());
        assert!(output.status.success(), "{}", tests::said(&output));
    }
}
