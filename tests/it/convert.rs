//! Logs become tables that the other commands read: the real program, over small logs that are made up here.

use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;
use tests::{folder, orchestrator, said};

/// A car on a circle: poses as a robot's middleware logs them, with quaternions and an index column, and commands beside them.
fn drive(folder: &Path, name: &str, start_s: u64) {
    let mut poses = ",s,ns,x,y,q.x,q.y,q.z,q.w\n".to_owned();
    let mut commands = ",s,ns,V,delta\n".to_owned();
    for step in 0..200u64 {
        let angle = step as f64 * 0.02;
        let (s, ns) = (start_s + step / 20, step % 20 * 50_000_000);
        let (sin, cos) = (angle / 2.0).sin_cos();
        let (x, y) = (angle.sin() * 5.0, 5.0 - angle.cos() * 5.0);
        writeln!(poses, "{step},{s},{ns},{x},{y},0.0,0.0,{sin},{cos}").unwrap();
        if 4 <= step {
            let speed = if step < 100 { 2.0 } else { 2.1 };
            writeln!(commands, "{step},{s},{},{speed},0.06", ns + 10_000_000).unwrap();
        }
    }
    poses.push_str("200,1700000099,0,broken,0,0,0,0,1\n");
    std::fs::write(folder.join(format!("{name}_pose.csv")), poses).unwrap();
    std::fs::write(folder.join(format!("{name}_command.csv")), commands).unwrap();
}

const DRIVES: &str = r#"table = "robots"

[[input]]
files = "drive*_pose.csv"
columns = { time_s = ["s", "ns"], agent = 0, x_m = "x", y_m = "y", heading_rad = ["q.x", "q.y", "q.z", "q.w"] }

[[input]]
files = "drive*_command.csv"
columns = { time_s = ["s", "ns"], cmd_speed_mps = "V", cmd_steer_rad = "delta" }
within_s = 0.2
"#;

fn convert(folder: &Path, args: &[&str]) -> Value {
    let json = ["--json", "converted.json"];
    let output = orchestrator(&[&["convert"], args, &json].concat(), folder);
    assert!(output.status.success(), "{}", said(&output));
    read_json(&folder.join("converted.json"))
}

fn read_json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// What `check --data` finds: every row that was converted can be used.
fn checked(folder: &Path, data: &str) -> Value {
    let output = orchestrator(&["check", "--data", data, "--json", "checked.json"], folder);
    assert!(output.status.success(), "{}", said(&output));
    let found = read_json(&folder.join("checked.json"));
    assert_eq!(found["rejected"], Value::Array(Vec::new()), "{found:#}");
    assert_eq!(found["rows"], found["used"]);
    found
}

#[test]
fn topics_of_several_drives_become_one_table_of_robots() {
    let dir = folder();
    drive(dir.path(), "drive2", 1_700_000_000);
    drive(dir.path(), "drive10", 1_700_000_050);
    std::fs::write(dir.path().join("drives.toml"), DRIVES).unwrap();
    let mut tables = Vec::new();
    for name in ["drives.csv", "drives.csv.gz", "drives.parquet"] {
        let answer = convert(dir.path(), &["drives.toml", "--out", name]);
        // Of each drive, five poses come before the first command, and one is broken.
        assert_eq!((&answer["read"], &answer["written"]), (&402.into(), &390.into()), "{answer:#}");
        let rejected = &answer["inputs"][0]["rejected"];
        assert_eq!(rejected[0]["reason"], "x_m is not a number", "{rejected:#}");
        assert_eq!((&rejected[0]["rows"], &rejected[0]["first_line"]), (&2.into(), &202.into()));
        assert_eq!(rejected[1]["reason"], "no row of input[1] in the 0.2 s before");
        assert_eq!(rejected[1]["rows"], 10);
        // Commands come 40 ms before the next pose.
        assert_eq!(answer["inputs"][1]["join"]["greatest_age_s"], 0.04);
        assert!(answer["inputs"][0]["files"][0].as_str().unwrap().ends_with("drive2_pose.csv"));
        let found = checked(dir.path(), name);
        assert_eq!((&found["runs"], &found["commands"]), (&2.into(), &"speed and steering".into()));
        tables.push(found["x_m"].clone());
    }
    assert!(tables.iter().all(|table| *table == tables[0]), "{tables:?}");
    let text = std::fs::read_to_string(dir.path().join("drives.csv")).unwrap();
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some("run,time_s,start_epoch_s,agent,x_m,y_m,heading_rad,cmd_speed_mps,cmd_steer_rad")
    );
    // The sixth pose is the first with a command: heading 0.1 rad.
    let row: Vec<f64> =
        lines.next().unwrap().split(',').map(|cell| cell.parse().unwrap()).collect();
    assert_eq!([row[0], row[1], row[2], row[3]], [1.0, 0.0, 1_700_000_000.25, 0.0]);
    assert!((row[6] - 0.1).abs() < 1e-9 && row[7] == 2.0, "{row:?}");
    // The second drive started 50 s later.
    let second = text.lines().find(|line| line.starts_with("2,0,")).unwrap();
    assert!(second.starts_with("2,0,1700000050.25,"), "{second}");
}

#[test]
fn a_table_that_exists_is_replaced_only_if_asked() {
    let dir = folder();
    drive(dir.path(), "drive1", 1_700_000_000);
    std::fs::write(dir.path().join("drives.toml"), DRIVES).unwrap();
    std::fs::write(dir.path().join("drives.csv"), "mine").unwrap();
    let output = orchestrator(&["convert", "drives.toml"], dir.path());
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("the file exists; give another name, or --replace"));
    assert_eq!(std::fs::read_to_string(dir.path().join("drives.csv")).unwrap(), "mine");
    convert(dir.path(), &["drives.toml", "--replace"]);
    checked(dir.path(), "drives.csv");
    let output = orchestrator(&["convert", "drives.toml", "--out", "drives.json"], dir.path());
    assert!(said(&output).contains("must end in .csv, .csv.gz or .parquet"), "{}", said(&output));
}

#[test]
fn what_is_wrong_with_a_mapping_is_said_at_once_with_its_lines() {
    let dir = folder();
    drive(dir.path(), "drive1", 1_700_000_000);
    let mapping = DRIVES.replace("\"V\"", "\"v\"").replace("\"q.w\"", "\"qw\"");
    std::fs::write(dir.path().join("drives.toml"), mapping).unwrap();
    let output = orchestrator(&["convert", "drives.toml"], dir.path());
    assert_eq!(output.status.code(), Some(2));
    let text = said(&output);
    for part in [
        "drives.toml: 2 problems",
        "drives.toml:5: input[0].columns.heading_rad: must be a column of drive1_pose.csv, which are s, ns, x, y, q.x, q.y, q.z, \
         q.w, got \"qw\"",
        "drives.toml:9: input[1].columns.cmd_speed_mps: must be a column of drive1_command.csv, which are s, ns, V, delta, got \
         \"v\" (nearest valid: \"V\")",
    ] {
        assert!(text.contains(part), "{part}\nis not in\n{text}");
    }
    assert!(!dir.path().join("drives.csv").exists());
}

#[test]
fn packets_at_a_root_show_what_was_lost_as_gaps() {
    let dir = folder();
    let mut log = "no packet\n".to_owned();
    for number in (0..60u32).filter(|number| number % 10 != 3) {
        let created = 1000 + 40 * number;
        let arrived = created + 7;
        let mut bytes = vec![5, (arrived & 255) as u8, (arrived >> 8) as u8, 0, 0, 0];
        bytes.extend([(created & 255) as u8, (created >> 8) as u8, 0, 0, 0, number as u8, 0, 0]);
        bytes.extend([7, 1, 20, 70, 5, 2, 12, 81]);
        bytes.resize(38, 0);
        writeln!(log, "{bytes:?}\t0:00:00.1").unwrap();
    }
    std::fs::write(dir.path().join("root.log"), log).unwrap();
    let mapping = "table = \"packets\"\nnames = { 1 = 0 }\n[[input]]\nfiles = \"root.log\"\nformat = \"openwsn-packets\"\n";
    std::fs::write(dir.path().join("root.toml"), mapping).unwrap();
    let answer = convert(dir.path(), &["root.toml"]);
    assert_eq!((&answer["read"], &answer["written"]), (&55.into(), &54.into()), "{answer:#}");
    let gaps = &answer["gaps"][0];
    assert_eq!(
        (&gaps["missing"], &gaps["arrived"], &gaps["restarts"]),
        (&6.into(), &54.into(), &0.into())
    );
    // The root is mote 0; the other addresses follow.
    assert_eq!(
        (&answer["names"]["1"], &answer["names"]["5"], &answer["names"]["7"]),
        (&0.into(), &1.into(), &2.into())
    );
    let text = std::fs::read_to_string(dir.path().join("root.csv")).unwrap();
    assert!(
        text.lines().nth(1).unwrap().starts_with("15,2,0,15.105,2,0,2,3,20,-70,1,2,12,-81,"),
        "{text}"
    );
    let found = checked(dir.path(), "root.csv");
    assert_eq!(found["arrived"], 54, "{found:#}");
    // Seven slots of 15 ms, as a difference of two times.
    assert!((found["latency_s"].as_f64().unwrap() - 0.105).abs() < 1e-9, "{found:#}");

    // Gaps become lost packets, created where their number lies: number 3, at ASN 1000 + 40 × 3.
    let lost = format!("lost_from_gaps = true\n{mapping}");
    std::fs::write(dir.path().join("lost.toml"), lost).unwrap();
    let answer = convert(dir.path(), &["lost.toml"]);
    assert_eq!(
        (&answer["read"], &answer["written"], &answer["lost_from_gaps"]),
        (&55.into(), &60.into(), &6.into()),
        "{answer:#}"
    );
    let text = std::fs::read_to_string(dir.path().join("lost.csv")).unwrap();
    assert!(text.lines().any(|line| line.starts_with("16.8,2,0,,,3,")), "{text}");
    let found = checked(dir.path(), "lost.csv");
    assert_eq!((&found["rows"], &found["arrived"]), (&60.into(), &54.into()), "{found:#}");

    let links = "table = \"links\"\nlost_from_gaps = true\n[[input]]\nfiles = \"root.log\"\nformat = \"openwsn-transmissions\"\n\
                 slotframe_slots = 17\n";
    std::fs::write(dir.path().join("links.toml"), links).unwrap();
    let output = orchestrator(&["convert", "links.toml"], dir.path());
    assert_eq!(output.status.code(), Some(2));
    let text = said(&output);
    assert!(
        text.contains("links.toml:2: lost_from_gaps: makes lost packets or frames of gaps"),
        "{text}"
    );
}

#[test]
fn counters_and_places_by_name_become_a_table_of_links() {
    let dir = folder();
    let mut counters = "when,from,to,rssi,tx,ack\n".to_owned();
    for step in 0..30u32 {
        for (from, to) in [("gateway", "lamp"), ("lamp", "gateway")] {
            let (minute, tx) = (step % 60, 10 * step);
            writeln!(
                counters,
                "2024-03-01 12:{minute:02}:00,{from},{to},{},{tx},{}",
                -60 - step as i32 % 3,
                9 * step
            )
            .unwrap();
        }
    }
    std::fs::write(dir.path().join("counters.csv"), counters).unwrap();
    let places = "name,lat,lon,height [cm]\nlamp,45.001,7.0,150\ngateway,45.0,7.0,200\n";
    std::fs::write(dir.path().join("places.csv"), places).unwrap();
    let mapping = r#"table = "links"
origin_deg = [45.0, 7.0]

[[input]]
files = "counters.csv"
cumulative = true
columns = { time_s = "when", tx = "from", rx = "to", rssi_dbm = "rssi", frames = "tx", received_frames = "ack" }

[[input]]
files = "places.csv"
columns = { node = "name", latitude_deg = "lat", longitude_deg = "lon", z_m = "height [cm]" }
"#;
    std::fs::write(dir.path().join("links.toml"), mapping).unwrap();
    let answer = convert(dir.path(), &["links.toml"]);
    assert_eq!((&answer["read"], &answer["written"]), (&60.into(), &58.into()), "{answer:#}");
    assert_eq!((&answer["names"]["gateway"], &answer["names"]["lamp"]), (&0.into(), &1.into()));
    let text = std::fs::read_to_string(dir.path().join("links.csv")).unwrap();
    let header = "time_s,start_epoch_s,tx,rx,tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,rssi_dbm,frames,pdr,losses_logged";
    assert_eq!(text.lines().next(), Some(header));
    let row: Vec<f64> =
        text.lines().nth(1).unwrap().split(',').map(|cell| cell.parse().unwrap()).collect();
    // 2024-03-01T12:00:00Z.
    assert_eq!(row[1], 1_709_294_400.0);
    assert_eq!([row[0], row[2], row[3], row[6], row[9]], [60.0, 0.0, 1.0, 2.0, 1.5]);
    assert!((row[8] - 111.13).abs() < 0.01, "{row:?}");
    // Counts of what was sent show what was lost.
    assert_eq!(row[10..], [-61.0, 10.0, 0.9, 1.0]);
    assert_eq!(answer["losses_logged"], true);
    checked(dir.path(), "links.csv");
}

#[test]
fn a_trace_as_it_is_published_is_converted_and_its_bad_rows_are_counted() {
    let dir = folder();
    let mut trace = "{\"start_date\": \"2018-01-11 16:00:00\", \"node_count\": 3}\ndatetime,src,dst,channel,mean_rssi,pdr,tx_count\n".to_owned();
    trace.push_str(
        "2018-01-11 15:59:59,0,1,11.0,-70.5,0.95,100\n2018-01-11 16:00:00,0,1,,-70.5,0.95,100\n",
    );
    for step in 0..40 {
        let (minute, src) = (step / 2, step % 2);
        writeln!(
            trace,
            "2018-01-11 16:{minute:02}:00,{src},{},11.0,-7{},0.9{},100.0",
            1 - src,
            step % 4,
            step % 7
        )
        .unwrap();
    }
    trace.push_str("2018-01-11 17:00:00,0,1,11.0,,0.0,100\nx\n");
    std::fs::write(dir.path().join("trace.k7"), trace).unwrap();
    let mapping = "table = \"links\"\n[[input]]\nfiles = \"trace.k7\"\nformat = \"k7\"\n";
    std::fs::write(dir.path().join("trace.toml"), mapping).unwrap();
    let answer = convert(dir.path(), &["trace.toml"]);
    assert_eq!((&answer["read"], &answer["written"]), (&44.into(), &41.into()), "{answer:#}");
    let rejected = answer["inputs"][0]["rejected"].as_array().unwrap();
    let lines: Vec<u64> = rejected.iter().map(|one| one["first_line"].as_u64().unwrap()).collect();
    assert_eq!(lines, [46, 3, 4], "{rejected:#?}");
    checked(dir.path(), "trace.csv");
    // The start_date of the header, 2018-01-11T16:00:00Z.
    let text = std::fs::read_to_string(dir.path().join("trace.csv")).unwrap();
    assert!(text.lines().nth(1).unwrap().starts_with("0,1515686400,"), "{text}");
}

#[test]
fn frames_that_a_log_of_received_frames_lacks_are_rebuilt_from_sequence_numbers() {
    let dir = folder();
    // Ten beacons a second with numbers of 8 bits. The dock loses three in ten, the mast every fourth.
    let mut log = "when,node,gateway,rssi,counter\n".to_owned();
    let mut n_lost = 0;
    for number in 0..600u32 {
        for (gateway, is_lost) in [("dock", number % 10 < 3), ("mast", number % 4 == 1)] {
            // Before its first row, number 3, nothing is known of what the dock lost.
            if is_lost && (gateway == "mast" || 3 < number) {
                n_lost += 1;
            } else if !is_lost {
                let when = 1_700_000_000.0 + f64::from(number) / 10.0;
                let rssi = -60 - (number % 7) as i32;
                writeln!(log, "{when:.1},buoy,{gateway},{rssi},{}", number % 256).unwrap();
            }
        }
    }
    std::fs::write(dir.path().join("beacons.csv"), log).unwrap();
    std::fs::write(
        dir.path().join("places.csv"),
        "name,t,x,y\nbuoy,1700000000,0,5\nbuoy,1700000060,60,5\ndock,1700000030,0,0\nmast,1700000030,30,0\n",
    )
    .unwrap();
    let mapping = r#"table = "links"

[[input]]
files = "beacons.csv"
columns = { time_s = "when", tx = "node", rx = "gateway", rssi_dbm = "rssi", received = 1, sequence = "counter" }

[[input]]
files = "places.csv"
columns = { node = "name", time_s = "t", x_m = "x", y_m = "y" }
join = "nearest"
within_s = 100
"#;
    std::fs::write(dir.path().join("links.toml"), mapping).unwrap();
    let answer = convert(dir.path(), &["links.toml"]);
    assert_eq!(
        (&answer["lost_from_gaps"], &answer["losses_logged"]),
        (&n_lost.into(), &true.into())
    );
    let read = answer["read"].as_u64().unwrap();
    assert_eq!(answer["written"], read + n_lost);
    let missing: u64 =
        answer["gaps"].as_array().unwrap().iter().map(|gap| gap["missing"].as_u64().unwrap()).sum();
    assert_eq!(missing, n_lost);
    assert_eq!(answer["gaps"][1]["receiver"], answer["names"]["mast"]);
    let text = std::fs::read_to_string(dir.path().join("links.csv")).unwrap();
    assert_eq!(
        text.lines().next().unwrap(),
        "time_s,start_epoch_s,tx,rx,tx_x_m,tx_y_m,rx_x_m,rx_y_m,rssi_dbm,received,sequence,losses_logged"
    );
    // Number 45, which the mast lost and the dock did not: the places are joined onto it.
    let lost: Vec<&str> = text.lines().filter(|line| line.ends_with(",,0,45,1")).collect();
    assert!(lost.iter().any(|line| line.contains("4.5,1700000000,0,2,0,5,30,0,")), "{lost:?}");
    let found = checked(dir.path(), "links.csv");
    let warnings = found["warnings"].to_string();
    assert!(!warnings.contains("sequence") && !warnings.contains("--losses"), "{warnings}");

    // Without numbers, the mapping says that losses are missing.
    let stated =
        format!("losses = \"not-logged\"\n{mapping}").replace(", sequence = \"counter\"", "");
    std::fs::write(dir.path().join("stated.toml"), stated).unwrap();
    let answer = convert(dir.path(), &["stated.toml"]);
    assert_eq!((&answer["written"], &answer["losses_logged"]), (&read.into(), &false.into()));
    let text = std::fs::read_to_string(dir.path().join("stated.csv")).unwrap();
    assert!(text.lines().skip(1).all(|line| line.ends_with(",1,0")), "{text}");
    checked(dir.path(), "stated.csv");
}

#[test]
fn a_mapping_reads_logs_of_its_own_folder_alone_unless_others_are_allowed() {
    let dir = folder();
    let own = dir.path().join("own");
    std::fs::create_dir(&own).unwrap();
    for name in ["a.csv", "b.csv"] {
        let row = "t,tx,rx,rssi\n0,0,1,-60\n1,1,0,-61\n";
        std::fs::write(dir.path().join(name), row).unwrap();
    }
    let columns =
        "columns = { time_s = \"t\", tx = \"tx\", rx = \"rx\", rssi_dbm = \"rssi\", received = 1 }";
    let mapping = |files: &str| {
        let text = format!("table = \"links\"\n[[input]]\nfiles = {files:?}\n{columns}\n");
        std::fs::write(own.join("m.toml"), text).unwrap();
    };
    let place = dir.path().display();
    for (files, asked) in [
        ("../a.csv".to_owned(), "a.csv"),
        (format!("{place}/b.csv"), "b.csv"),
        ("../*.csv".to_owned(), ""),
    ] {
        mapping(&files);
        let refused = orchestrator(&["convert", "own/m.toml", "--out", "t.csv"], dir.path());
        let text = said(&refused);
        assert_eq!(refused.status.code(), Some(2), "{text}");
        assert!(text.contains("input[0].files: would read a file outside of the folder"), "{text}");
        assert!(text.contains("--allow-file ") && text.contains(asked), "{text}");
        assert!(!dir.path().join("t.csv").exists());
        let allowed = ["convert", "own/m.toml", "--out", "t.csv", "--allow-file", "."];
        let output = orchestrator(&allowed, dir.path());
        assert!(output.status.success(), "{}", said(&output));
        std::fs::remove_file(dir.path().join("t.csv")).unwrap();
    }
}
