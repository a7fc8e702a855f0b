//! Pictures and videos of a run from the command line.

use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::Field;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::LazyLock;
use tests::{end_of, signal, wait_until};

const CONFIG: &str = r#"
[experiment]
name = "flock"
seed = 4
duration_s = 4.0
agents = 6
control_period = { rate_hz = 10.0 }

[[site.wall]]
from_m = [0.0, -4.0]
to_m = [20.0, -4.0]

[[site.obstacle]]
name = "rock"
centre_m = [10.0, 8.0]
radius_m = 2.0

[robotsim.scenario]
kind = "line"
spacing_m = 3.0

[robotsim.controller]
kind = "flocking"
flock_radius_m = 20.0

[netsim.phy]
propagation = "log-distance"
exponent = 3.2

[[robotsim.absence]]
robots = [5]
from_s = 2.0
"#;

/// The run that all tests draw; it goes with the process.
static RUN: LazyLock<(tempfile::TempDir, PathBuf)> = LazyLock::new(|| {
    let folder = tests::folder();
    let config = folder.path().join("flock.toml");
    std::fs::write(&config, CONFIG).unwrap();
    let run = tests::run(&config, &folder.path().join("runs"), &[]);
    (folder, run)
});

/// Renders, in a folder of its own.
fn render(args: &[&str], folder: &Path) -> Output {
    tests::orchestrator(&[&["render", RUN.1.to_str().unwrap()], args].concat(), folder)
}

fn rendered(args: &[&str], folder: &Path) -> String {
    let output = render(args, folder);
    assert!(output.status.success(), "{}", tests::said(&output));
    String::from_utf8(output.stdout).unwrap()
}

/// Rows of a table that belong to one step.
fn rows(table: &str, step: u64) -> Vec<BTreeMap<String, Field>> {
    let file = std::fs::File::open(RUN.1.join(table)).unwrap();
    let reader = SerializedFileReader::new(file).unwrap();
    let rows = reader.get_row_iter(None).unwrap().map(|row| {
        let row = row.unwrap();
        let columns = row.get_column_iter();
        columns.map(|(name, field)| (name.clone(), field.clone())).collect::<BTreeMap<_, _>>()
    });
    rows.filter(|row| row["step"] == Field::ULong(step)).collect()
}

fn id(field: &Field) -> u64 {
    match field {
        Field::UInt(value) => u64::from(*value),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_scene_has_the_positions_and_links_of_the_tables() {
    let folder = tests::folder();
    for (at, step) in [("1.55", 15), ("4", 40)] {
        let args = ["--at", at, "--output", "a.svg", "--json", "a.json", "--links", "rssi"];
        let said = rendered(&args, folder.path());
        assert!(said.starts_with(&format!("a.svg: step {step} at ")), "{said}");
        let json = std::fs::read(folder.path().join("a.json")).unwrap();
        let scene: Value = serde_json::from_slice(&json).unwrap();
        assert_eq!(scene["step"], step);
        // Frames hold positions to 2 mm.
        let near = |drawn: &Value, tabled: &Field| match tabled {
            Field::Double(tabled) => (drawn.as_f64().unwrap() - tabled).abs() < 0.0021,
            other => panic!("{other:?}"),
        };
        let robots = scene["robots"].as_array().unwrap();
        assert_eq!(robots.len(), 6);
        let tabled = rows("steps.parquet", step);
        assert_eq!(tabled.len(), 6);
        for (robot, row) in robots.iter().zip(&tabled) {
            assert_eq!(robot["robot"].as_u64().unwrap(), id(&row["agent"]));
            let alive = robot["alive"].as_bool().unwrap();
            assert_eq!(Field::Bool(alive), row["alive"]);
            assert_eq!(alive, robot["robot"] != 5 || step < 20);
            // Where a lost robot is, the table does not say.
            assert!(!alive || near(&robot["x_m"], &row["x_m"]) && near(&robot["y_m"], &row["y_m"]));
        }
        let drawn: BTreeSet<[u64; 2]> = scene["links"]
            .as_array()
            .unwrap()
            .iter()
            .map(|link| ["sender", "receiver"].map(|end| link[end].as_u64().unwrap()))
            .collect();
        let tabled: BTreeSet<[u64; 2]> = rows("links.parquet", step)
            .iter()
            .filter(|row| row["received"] == Field::Bool(true))
            .map(|row| ["sender", "receiver"].map(|end| id(&row[end])))
            .collect();
        assert!(!drawn.is_empty());
        assert_eq!(drawn, tabled);
        // Every robot is in the picture.
        let svg = std::fs::read_to_string(folder.path().join("a.svg")).unwrap();
        for robot in 0..6 {
            assert!(svg.contains(&format!("<title>robot {robot}</title>")), "{robot}");
        }
        assert!(svg.contains("rock") && svg.contains("wall") && svg.contains("dBm"));
        assert_eq!(svg.contains("robot that is lost"), 20 <= step);
    }
}

#[test]
fn a_png_has_its_size_and_something_on_it() {
    let folder = tests::folder();
    let mut pictures = BTreeSet::new();
    for more in [&[][..], &["--dark"], &["--follow", "0", "--span", "10"], &["--links", "none"]] {
        let args = [&["--at", "2", "--output", "a.png", "--size", "640x480"], more].concat();
        rendered(&args, folder.path());
        let png = std::fs::read(folder.path().join("a.png")).unwrap();
        assert_eq!(png[..8], *b"\x89PNG\r\n\x1a\n");
        let size = |at: usize| u32::from_be_bytes(png[at..at + 4].try_into().unwrap());
        assert_eq!((size(16), size(20)), (640, 480));
        // Of one colour it would have less than 3 kB.
        assert!(8_000 < png.len(), "{} bytes", png.len());
        assert!(pictures.insert(png), "{more:?} changes nothing");
    }
}

/// Number of frames of a GIF, and how long they are shown (1/100 s).
fn frames_of_gif(gif: &[u8]) -> (usize, u32) {
    assert_eq!(gif[..6], *b"GIF89a");
    let table = |flags: u8| if flags & 0x80 == 0 { 0 } else { 3 << ((flags & 7) + 1) };
    let mut at = 13 + table(gif[10]);
    let (mut n, mut delay) = (0, 0);
    let skip_blocks = |mut at: usize| {
        while gif[at] != 0 {
            at += 1 + usize::from(gif[at]);
        }
        at + 1
    };
    loop {
        match gif[at] {
            0x21 => {
                if gif[at + 1] == 0xf9 {
                    delay += u32::from(u16::from_le_bytes([gif[at + 4], gif[at + 5]]));
                }
                at = skip_blocks(at + 2);
            }
            0x2c => {
                n += 1;
                at = skip_blocks(at + 11 + table(gif[at + 9]));
            }
            0x3b => return (n, delay),
            other => panic!("{other:#x} at {at}"),
        }
    }
}

#[test]
fn a_gif_has_its_frames() {
    let folder = tests::folder();
    let args = ["--video", "a.gif", "--speed", "2", "--fps", "15", "--size", "480x320"];
    let said = rendered(&args, folder.path());
    assert_eq!(said, "a.gif: 31 frames at 15 frames/s, 4 s of the run at 2 times its speed\n");
    let gif = std::fs::read(folder.path().join("a.gif")).unwrap();
    assert_eq!(gif[6..10], [480u16.to_le_bytes(), 320u16.to_le_bytes()].concat());
    assert_eq!(frames_of_gif(&gif), (31, 206));
    // The same command makes the same video, and a part of it the same pictures.
    rendered(&args, folder.path());
    assert_eq!(gif, std::fs::read(folder.path().join("a.gif")).unwrap());
    let part = ["--video", "b.gif", "--from", "1", "--until", "1.5", "--follow", "2", "--dark"];
    rendered(&part, folder.path());
    let gif = std::fs::read(folder.path().join("b.gif")).unwrap();
    assert_eq!(frames_of_gif(&gif), (13, 52));
}

#[test]
fn wrong_requests_name_the_option_and_what_is_allowed() {
    let folder = tests::folder();
    for (args, said) in [
        (
            &["--at", "4.5", "--output", "a.png"][..],
            "--at 4.5: the run ends at 4 s; give a time from 0 to 4",
        ),
        (&["--at", "-1", "--output", "a.png"], "from 0 to 1e9"),
        (
            &["--at", "1", "--output", "a.jpg"],
            "--output a.jpg: a picture is written as .svg or .png",
        ),
        (&["--at", "1", "--output", "nowhere/a.png"], "--output nowhere/a.png"),
        (&["--at", "1"], "--output"),
        (&["--output", "a.png"], "--at"),
        (&[], "--at"),
        (&["--video", "a.avi"], "--video a.avi: a video is written as .mp4, .webm or .gif"),
        (&["--video", "a.gif", "--fps", "0"], "1..=60"),
        (&["--video", "a.gif", "--fps", "60"], "--fps 60: a .gif has at most 50"),
        (&["--video", "a.gif", "--speed", "0"], "from 0.001 to 1000000"),
        (&["--video", "a.gif", "--speed", "0.001"], "100,001 frames are more than 20,000"),
        (&["--video", "a.gif", "--size", "5000x100"], "from 320x240 to 4096x4096"),
        (&["--video", "a.mp4", "--size", "641x480"], "must be even; give 640x480"),
        (&["--video", "a.gif", "--from", "3", "--until", "2"], "--until 2: is before --from 3"),
        (&["--video", "a.gif", "--until", "9"], "--until 9: the run ends at 4 s"),
        (&["--video", "a.gif", "--at", "1"], "--at"),
        (
            &["--video", "a.gif", "--follow", "6"],
            "--follow 6: robots of this run have numbers from 0 to 5",
        ),
        (&["--at", "1", "--output", "a.png", "--links", "age"], "rssi"),
    ] {
        let output = render(args, folder.path());
        assert_eq!(output.status.code(), Some(2), "{args:?}: {}", tests::said(&output));
        assert!(tests::said(&output).contains(said), "{args:?}: {}", tests::said(&output));
    }
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn without_ffmpeg_the_error_names_gif() {
    let folder = tests::folder();
    for name in ["a.mp4", "a.webm"] {
        let output = Command::new(tests::executable("murmuration"))
            .args(["render", RUN.1.to_str().unwrap(), "--video", name])
            .env("PATH", folder.path())
            .current_dir(folder.path())
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(1), "{}", tests::said(&output));
        let said = tests::said(&output);
        assert!(said.contains("ffmpeg is not installed") && said.contains("a .gif"), "{said}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn ctrl_c_leaves_nothing() {
    let folder = tests::folder();
    let args = ["--video", "a.gif", "--speed", "0.01", "--fps", "40", "--size", "1920x1080"];
    let child = Command::new(tests::executable("murmuration"))
        .args(["render", RUN.1.to_str().unwrap()])
        .args(args)
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    wait_until("nothing is written", || {
        std::fs::read_dir(folder.path()).unwrap().any(|entry| {
            entry.is_ok_and(|entry| entry.metadata().is_ok_and(|file| 10_000 < file.len()))
        })
    });
    signal("-INT", child.id());
    let output = end_of(child);
    assert_eq!(output.status.code(), Some(1), "{}", tests::said(&output));
    assert!(tests::said(&output).contains("a.gif was not written"), "{}", tests::said(&output));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
