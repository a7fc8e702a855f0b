//! Logs of many forms become tables without a mapping: the real program, over logs that are made up here.

use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;
use tests::{folder, orchestrator, said};

/// Positions of three nodes (m).
const PLACES: [[f64; 2]; 3] = [[0.0, 0.0], [12.5, 3.25], [30.0, 21.75]];
const N_FRAMES: usize = 300;

/// A frame of a campaign: time (s), sender, receiver, RSSI (dBm).
struct Frame {
    time_s: usize,
    tx: usize,
    rx: usize,
    rssi_dbm: i64,
}

fn frames() -> impl Iterator<Item = Frame> {
    (0..N_FRAMES).map(|step| {
        let (tx, rx) = [(0, 1), (1, 2), (2, 0), (1, 0), (2, 1), (0, 2)][step % 6];
        let [a, b] = [PLACES[tx], PLACES[rx]];
        let distance_m = ((a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)).sqrt();
        let noise_db = ((step * 7919) % 5) as f64 - 2.0;
        let rssi_dbm = (-40.0 - 25.0 * distance_m.log10() + noise_db).round() as i64;
        Frame { time_s: 2 * step, tx, rx, rssi_dbm }
    })
}

fn read_json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// What `import` says of a log, which it accepts.
fn imported(folder: &Path, log: &str, content: &str, args: &[&str]) -> Value {
    std::fs::write(folder.join(log), content).unwrap();
    let import = ["import", log, "--yes", "--replace", "--json", "imported.json"];
    let output = orchestrator(&[&import, args].concat(), folder);
    assert!(output.status.success(), "{log}: {}\n{content:.300}", said(&output));
    read_json(&folder.join("imported.json"))
}

/// The columns of a table that was written.
fn column(folder: &Path, table: &str, name: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(folder.join(table)).unwrap();
    let mut lines = text.lines();
    let at = lines.next().unwrap().split(',').position(|known| known == name);
    let at = at.unwrap_or_else(|| panic!("{table} has no column {name}"));
    lines.map(|line| line.split(',').nth(at).unwrap().parse().unwrap_or(f64::NAN)).collect()
}

/// The table is the campaign, whatever the log was like.
fn assert_is_campaign(folder: &Path, table: &str, with_places: bool) {
    let column = |name: &str| column(folder, table, name);
    let (time_s, tx, rx, rssi_dbm) =
        (column("time_s"), column("tx"), column("rx"), column("rssi_dbm"));
    assert_eq!(time_s.len(), N_FRAMES);
    for (row, frame) in frames().enumerate() {
        assert!((time_s[row] - frame.time_s as f64).abs() < 1e-6, "row {row}: {}", time_s[row]);
        // Numbers of named nodes begin at any number, in order.
        assert_eq!((tx[row] - rx[row]) as i64, frame.tx as i64 - frame.rx as i64, "row {row}");
        assert_eq!(rssi_dbm[row] as i64, frame.rssi_dbm, "row {row}");
    }
    if with_places {
        let (x_m, y_m) = (column("tx_x_m"), column("rx_y_m"));
        for (row, frame) in frames().enumerate() {
            assert!((x_m[row] - PLACES[frame.tx][0]).abs() < 1e-9, "row {row}: {}", x_m[row]);
            assert!((y_m[row] - PLACES[frame.rx][1]).abs() < 1e-9, "row {row}: {}", y_m[row]);
        }
    }
}

#[test]
fn a_log_is_recognised_in_every_common_form() {
    let dir = folder();
    // From `date -u -d 2025-03-04T14:02:00 +%s`.
    const START_S: usize = 1_741_096_920;
    let clock = |time_s: usize| {
        let at_s = 14 * 3600 + 2 * 60 + time_s;
        format!("{:02}:{:02}:{:02}", at_s / 3600, at_s / 60 % 60, at_s % 60)
    };
    let table = |header: &str, row: &dyn Fn(&Frame) -> String| {
        frames().fold(header.to_owned() + "\n", |text, frame| text + &row(&frame) + "\n")
    };
    let place = |node: usize, factor: f64| PLACES[node].map(|part| part * factor);
    let german = table("Zeit;Sender;Empfaenger_id rx;x_tx(cm);y_tx(cm);x_rx;y_rx;RSSI", &|f| {
        let ([x, y], [to_x, to_y]) = (place(f.tx, 100.0), place(f.rx, 1.0));
        let to = format!("{to_x};{to_y}").replace('.', ",");
        format!(
            "04.03.2025 {};node_{};node_{};{x};{y};{to};{}",
            clock(f.time_s),
            f.tx,
            f.rx,
            f.rssi_dbm
        )
    });
    let epoch = table("timestamp,src,dst,src_x_m,src_y_m,dst_x_m,dst_y_m,rssi_dbm", &|f| {
        let ([x, y], [to_x, to_y]) = (place(f.tx, 1.0), place(f.rx, 1.0));
        format!(
            "{},{},{},{x},{y},{to_x},{to_y},{}",
            (START_S + f.time_s) * 1000,
            f.tx,
            f.rx,
            f.rssi_dbm
        )
    });
    let american = table("Date\tTime\tfrom\tto\tSignal (dBm)", &|f| {
        format!("3/14/2025\t{}\tAP{}\tAP{}\t{} dBm", clock(f.time_s), f.tx, f.rx, f.rssi_dbm)
    });
    let unsigned = table("# by a gateway\ntime_ms,sender,receiver,RSSI", &|f| {
        format!("{},{},{},{}", 1000 * f.time_s, f.tx, f.rx, -f.rssi_dbm)
    });
    let lines = frames().fold(String::new(), |mut text, f| {
        let entry = format!("{{\"id\": \"gw{}\", \"rssi\": {}}}", f.rx, f.rssi_dbm);
        writeln!(
            text,
            "{{\"at\": {}, \"device\": \"gw{}\", \"gateways\": [{entry}]}}",
            START_S + f.time_s,
            f.tx
        )
        .unwrap();
        text
    });
    for (log, content, with_places) in [
        ("german.csv", &german, true),
        ("epoch.csv", &epoch, true),
        ("american.tsv", &american, false),
        ("unsigned.csv", &unsigned, false),
        ("lines.jsonl", &lines, false),
    ] {
        let found = imported(dir.path(), log, content, &[]);
        assert_eq!(found["guess"]["table"], "links", "{log}: {found:#}");
        assert_eq!(found["guess"]["questions"], Value::Array(Vec::new()), "{log}: {found:#}");
        let name = log.split('.').next().unwrap();
        assert_is_campaign(dir.path(), &format!("{name}-links.csv"), with_places);
        // The mapping is one of `convert`, and makes the same table.
        let again = ["convert", &format!("{name}-map.toml"), "--output", "again.csv", "--replace"];
        let output = orchestrator(&again, dir.path());
        assert!(output.status.success(), "{}", said(&output));
        let read = |file: &str| std::fs::read(dir.path().join(file)).unwrap();
        assert!(read("again.csv") == read(&format!("{name}-links.csv")), "{log}");
        if with_places {
            let compare = ["compare", &format!("{name}-model.toml"), "--data", "again.csv"];
            let output = orchestrator(&compare, dir.path());
            assert!(output.status.success(), "{log}: {}", said(&output));
        }
    }
}

#[test]
fn what_is_wrong_in_a_log_is_found_and_named() {
    let dir = folder();
    let mut text = "time_s,tx,rx,tx_x,tx_y,rx_x,rx_y,rssi\n".to_owned();
    for (row, frame) in frames().enumerate() {
        let (mut a, mut b) = (PLACES[frame.tx], PLACES[frame.rx]);
        if row % 50 == 7 {
            (a, b) = (b, a);
        }
        if row % 60 == 14 {
            a = a.map(|part| part * 100.0);
        }
        let rssi = match row % 40 {
            3 => (-frame.rssi_dbm).to_string(),
            4 => "127".to_owned(),
            5 => "NaN".to_owned(),
            _ => frame.rssi_dbm.to_string(),
        };
        let line = format!(
            "{},{},{},{},{},{},{},{rssi}",
            frame.time_s, frame.tx, frame.rx, a[0], a[1], b[0], b[1]
        );
        let n = if row == 20 { 2 } else { 1 };
        for _ in 0..n {
            writeln!(text, "{line}").unwrap();
        }
    }
    let found = imported(dir.path(), "lab.csv", &text, &[]);
    let findings = found["guess"]["findings"].to_string();
    for part in [
        "rssi has no reading in 8 of 301 rows",
        "rssi lacks its minus sign in 8 rows, first in row 4",
        "rssi is 127 in 8 rows, which stands for no reading",
        "6 of 296 rows have the ends swapped",
        "mixes units: ",
        "rows that repeat an earlier row in every field: 1, first in row 22",
    ] {
        assert!(findings.contains(part), "{part}\nis not in\n{findings}");
    }
    let rssi_dbm = column(dir.path(), "lab-links.csv", "rssi_dbm");
    assert!(rssi_dbm.iter().all(|level| level.is_nan() || (-90.0..-40.0).contains(level)));
}

#[test]
fn without_a_terminal_the_questions_are_printed_and_nothing_is_written() {
    let dir = folder();
    let mut text = "timestamp,tx,rx,rssi\n".to_owned();
    for frame in frames() {
        writeln!(text, "{},{},{},{}", frame.time_s * 1000, frame.tx, frame.rx, frame.rssi_dbm)
            .unwrap();
    }
    std::fs::write(dir.path().join("log.csv"), text).unwrap();
    let files = || std::fs::read_dir(dir.path()).unwrap().count();
    let output = orchestrator(&["import", "log.csv"], dir.path());
    let printed = said(&output);
    assert_eq!(output.status.code(), Some(2), "{printed}");
    assert!(printed.contains("--answer time-unit=ms") && printed.contains("--yes"), "{printed}");
    assert_eq!(files(), 1);

    let output =
        orchestrator(&["import", "log.csv", "--yes", "--answer", "time-unit=s"], dir.path());
    assert!(output.status.success(), "{}", said(&output));
    assert_eq!(column(dir.path(), "log-links.csv", "time_s")[1], 2000.0);
    let mapping = || std::fs::read(dir.path().join("log-map.toml")).unwrap();
    let before = mapping();
    let output = orchestrator(&["import", "log.csv", "--yes"], dir.path());
    let printed = said(&output);
    assert_eq!(output.status.code(), Some(2), "{printed}");
    assert!(printed.contains("log-map.toml") && printed.contains("--replace"), "{printed}");
    assert!(mapping() == before);
    let output =
        orchestrator(&["import", "log.csv", "--yes", "--answer", "time-unit=h"], dir.path());
    assert!(said(&output).contains("must be one of s, ms, us, ns"), "{}", said(&output));
}

#[test]
fn robots_find_their_commands_in_another_file() {
    let dir = folder();
    let mut poses = "stamp,pose.position.x,pose.position.y,pose.orientation.x,pose.orientation.y,pose.orientation.z,pose.orientation.w\n".to_owned();
    let mut commands = "stamp,linear.x,linear.y,angular.z\n".to_owned();
    for step in 0..400 {
        let (time_s, angle) = (1_700_000_000.0 + 0.05 * f64::from(step), 0.01 * f64::from(step));
        let (sin, cos) = (angle / 2.0).sin_cos();
        writeln!(
            poses,
            "{time_s:.3},{},{},0,0,{sin},{cos}",
            angle.sin() * 5.0,
            5.0 - angle.cos() * 5.0
        )
        .unwrap();
        writeln!(commands, "{:.3},1.0,0.0,0.2", time_s - 0.01).unwrap();
    }
    std::fs::write(dir.path().join("pose.csv"), poses).unwrap();
    std::fs::write(dir.path().join("cmd.csv"), commands).unwrap();
    let output = orchestrator(&["import", "pose.csv"], dir.path());
    let printed = said(&output);
    assert_eq!(output.status.code(), Some(2), "{printed}");
    assert!(
        printed.contains("no commands") && printed.contains("Give the file with the commands"),
        "{printed}"
    );
    let import = ["import", "pose.csv", "cmd.csv", "--yes", "--name", "drive"];
    let output = orchestrator(&import, dir.path());
    assert!(output.status.success(), "{}", said(&output));
    assert_eq!(column(dir.path(), "drive-robots.csv", "cmd_yaw_rate_radps")[10], 0.2);
    assert!((column(dir.path(), "drive-robots.csv", "heading_rad")[100] - 1.0).abs() < 1e-9);
    let compare = ["compare", "drive-model.toml", "--data", "drive-robots.csv"];
    let output = orchestrator(&compare, dir.path());
    assert!(output.status.success(), "{}", said(&output));
}

#[test]
fn distances_in_the_names_of_files_become_positions() {
    let dir = folder();
    for (distance, rssi) in [(1, -45), (2, -52), (4, -61), (10, -70)] {
        let rows = (0..30).fold("time,device,rssi\n".to_owned(), |text, row| {
            format!("{text}{row},phone,{}\n", rssi - row % 3)
        });
        std::fs::write(dir.path().join(format!("hall_{distance}m.csv")), rows).unwrap();
    }
    let files = ["hall_1m.csv", "hall_2m.csv", "hall_4m.csv", "hall_10m.csv"];
    let import =
        [&["import"], &files[..], &["--answer", "label-of-files=distance-m", "--yes"]].concat();
    let output = orchestrator(&import, dir.path());
    assert!(output.status.success(), "{}", said(&output));
    let x_m = column(dir.path(), "hall_1m-links.csv", "tx_x_m");
    assert_eq!((x_m[0], x_m[119], x_m.len()), (1.0, 10.0, 120));
}

#[test]
fn only_the_files_that_are_named_are_read_and_their_letters_kept() {
    let dir = folder();
    let log = |node: &[u8], level: i32| {
        (0..30).fold(b"time,sender,receiver,rssi\n".to_vec(), |mut text, row| {
            text.extend_from_slice(format!("{row},").as_bytes());
            text.extend_from_slice(node);
            text.extend_from_slice(format!(",gw,{}\n", level - row % 3).as_bytes());
            text
        })
    };
    for (name, node, level) in
        [("day1.csv", &b"\xe41"[..], -50), ("day2.csv", b"\xf61", -70), ("day9.csv", b"x", -60)]
    {
        std::fs::write(dir.path().join(name), log(node, level)).unwrap();
    }
    let import = ["import", "day1.csv", "day2.csv", "--yes", "--answer", "label-of-files=name"];
    let output = orchestrator(&import, dir.path());
    assert!(output.status.success(), "{}", said(&output));
    let tx = column(dir.path(), "day1-links.csv", "tx");
    assert_eq!(tx.len(), 60);
    // In Latin-1, ä1 and ö1 are two nodes.
    assert!(tx[0] != tx[59], "{tx:?}");
    let again = ["convert", "day1-map.toml", "--output", "again.csv"];
    let output = orchestrator(&again, dir.path());
    assert!(output.status.success(), "{}", said(&output));
}

#[test]
fn a_log_whose_rows_are_all_unusable_makes_no_table() {
    let dir = folder();
    let rows = (0..30).fold("time_s,tx,rx,rssi,ok\n".to_owned(), |text, row| {
        format!("{text}{row},1,2,{},1\n", if row < 2 { "-70" } else { "NaN" })
    });
    let all = rows.replace("-70", "NaN");
    std::fs::write(dir.path().join("log.csv"), all).unwrap();
    let mapping = "table = \"links\"\n[[input]]\nfiles = \"log.csv\"\ncolumns = { time_s = \"time_s\", tx = \"tx\", rx = \"rx\", rssi_dbm = \
                   \"rssi\", received = \"ok\" }\n";
    std::fs::write(dir.path().join("map.toml"), mapping).unwrap();
    let output = orchestrator(&["convert", "map.toml"], dir.path());
    let printed = said(&output);
    assert_eq!(output.status.code(), Some(1), "{printed}");
    assert!(printed.contains("no table was written"), "{printed}");
    assert!(!dir.path().join("map.csv").exists());
    // A column that says of every frame that it was received does not say that lost ones would be there.
    let found = imported(dir.path(), "some.csv", &rows, &[]);
    assert!(!found["guess"]["mapping"].as_str().unwrap().contains("losses = \"logged\"\n"));
}

#[test]
fn a_column_that_says_what_was_received_is_read_to_its_end() {
    let dir = folder();
    // Longer than what is looked at; the only loss is behind that.
    let rows = (0..30_000).fold(
        "time_s,sender,receiver,Signalstärke,received\n".to_owned(),
        |text, row| {
            let level = if row == 29_990 { String::new() } else { (-70 - row % 9).to_string() };
            format!("{text}{row},a,b,{level},{}\n", u8::from(row != 29_990))
        },
    );
    imported(dir.path(), "log.csv", &rows, &[]);
    let received = column(dir.path(), "log-links.csv", "received");
    let lost: Vec<usize> = (0..received.len()).filter(|&row| received[row] == 0.0).collect();
    assert_eq!((received.len(), lost), (30_000, vec![29_990]));
}

#[test]
fn lines_are_counted_alike_whatever_ends_them() {
    let dir = folder();
    let rows = (0..30).fold("time_s,tx,rx,rssi_dbm\n".to_owned(), |text, row| {
        let time = if row == 6 { "x".to_owned() } else { row.to_string() };
        format!("{text}{time},a,b,{}\n", -60 - row % 7)
    });
    for (name, content) in [("lf.csv", rows.clone()), ("crlf.csv", rows.replace('\n', "\r\n"))] {
        std::fs::write(dir.path().join(name), content).unwrap();
        let output = orchestrator(&["import", name, "--yes"], dir.path());
        let expected = format!("first on line 8 of {name}");
        assert!(said(&output).contains(&expected), "{}", said(&output));
    }
}

#[test]
fn what_is_no_measurement_is_refused_with_the_reason() {
    let dir = folder();
    let write =
        |name: &str, content: &[u8]| std::fs::write(dir.path().join(name), content).unwrap();
    write("drive.bag", b"#ROSBAG V2.0\nxxxxxxxxxxxxx");
    write("flight.ulg", b"ULog\x01\x12\x35\x01xxxxxxxx");
    write("iperf.csv", b"time,throughput_mbps\n0,1.5\n1,2.5\n2,1.25\n");
    write("empty.csv", b"");
    write("walk.csv", b"timestamp,x,y\n0.0,1.5,2.5\n0.1,1.6,2.4\n0.2,1.7,2.3\n");
    write("levels.csv", b"time_s,tx,rx,rssi_dbm\n0,a,b,\n1,a,b,\n2,b,a,\n");
    write("run*.csv", b"time_s,tx,rx,rssi_dbm\n0,a,b,-60\n1,a,b,-61\n2,b,a,-62\n");
    write("model.toml", b"propagation = \"log-distance\"\n");
    for (file, parts) in [
        ("drive.bag", &["python -m murmuration.importers", "rosbags"][..]),
        ("flight.ulg", &["python -m murmuration.importers", "ulog"]),
        ("iperf.csv", &["throughput_mbps", "links need a column of RSSI"]),
        ("empty.csv", &["the file is empty"]),
        ("walk.csv", &["no commands"]),
        ("levels.csv", &["rssi_dbm has no reading"]),
        ("absent.csv", &["does not exist"]),
        ("walks.csv", &["does not exist (nearest: walk.csv)"]),
        ("run*.csv", &["rename it"]),
        ("model.toml", &["murmuration check model.toml", "murmuration convert model.toml"]),
    ] {
        let output = orchestrator(&["import", file, "--yes"], dir.path());
        let printed = said(&output);
        assert_eq!(output.status.code(), Some(2), "{file}: {printed}");
        for part in parts {
            assert!(printed.contains(part), "{file}: {part}\nis not in\n{printed}");
        }
    }
}
