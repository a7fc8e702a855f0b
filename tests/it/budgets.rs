//! What a stranger's file or another user of the machine can take: memory, connections, descriptors, the terminal, and room for
//! temporary folders.

use parquet::basic::{Compression, ZstdLevel};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType};
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use std::fs::File;
use std::io::{BufRead as _, BufReader};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::Arc;
use std::time::Duration;
use tests::{end_of, executable, orchestrator, said, signal, wait_until};

/// Runs the program under limits of the shell's `ulimit`.
fn limited(limits: &str, args: &str, folder: &Path) -> Command {
    let mut command = Command::new("sh");
    let program = executable("murmuration");
    command.args(["-c", &format!("{limits}; exec {} {args}", program.display())]);
    command.current_dir(folder).stdin(Stdio::null());
    command
}

/// A small file of one row of link samples with six texts of so many bytes.
fn parquet_bomb(path: &Path, n_bytes: usize) {
    const NUMBERS: [&str; 6] = ["time_s", "tx", "rx", "channel", "rssi_dbm", "received"];
    let numbers = NUMBERS.map(|name| format!("required double {name};"));
    let texts: Vec<String> = (0..6).map(|k| format!("required binary note{k} (UTF8);")).collect();
    let schema = format!("message m {{ {} {} }}", numbers.concat(), texts.concat());
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_dictionary_enabled(false)
        .set_statistics_enabled(EnabledStatistics::None);
    let mut writer = SerializedFileWriter::new(
        File::create(path).unwrap(),
        Arc::new(parse_message_type(&schema).unwrap()),
        Arc::new(properties.build()),
    )
    .unwrap();
    let mut group = writer.next_row_group().unwrap();
    for _ in NUMBERS {
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<DoubleType>().write_batch(&[1.0], None, None).unwrap();
        column.close().unwrap();
    }
    for _ in texts {
        let mut column = group.next_column().unwrap().unwrap();
        let text = [ByteArray::from(vec![b'x'; n_bytes])];
        column.typed::<ByteArrayType>().write_batch(&text, None, None).unwrap();
        column.close().unwrap();
    }
    group.close().unwrap();
    writer.close().unwrap();
}

#[test]
fn a_small_parquet_file_takes_little_memory() {
    let folder = tests::folder();
    let path = folder.path().join("bomb.parquet");
    parquet_bomb(&path, 200 << 20);
    assert!(path.metadata().unwrap().len() < 100_000);
    // Unpacked it has 1.2 GB.
    let checked = limited("ulimit -v 1000000", "check --data bomb.parquet", folder.path()).output();
    let checked = checked.unwrap();
    assert_eq!(checked.status.code(), Some(2), "{}", said(&checked));
    // It was read, and its numbers are no readings.
    assert!(said(&checked).contains("rssi_dbm is positive in 1 of 1 rows"), "{}", said(&checked));
}

#[test]
fn every_command_that_reads_measurements_obeys_the_budget() {
    let folder = tests::folder();
    let here = folder.path();
    std::fs::write(here.join("model.toml"), "[netsim.phy]\npropagation = \"log-distance\"\n")
        .unwrap();
    let rows = "1,0,1,-70,1\n".repeat(5000);
    std::fs::write(here.join("links.csv"), format!("time_s,tx,rx,rssi_dbm,received\n{rows}"))
        .unwrap();
    let mapping = "table = \"links\"\n[[input]]\nfiles = \"links.csv\"\n[input.columns]\ntime_s = \"time_s\"\ntx = \"tx\"\nrx = \"rx\"\n\
                   rssi_dbm = \"rssi_dbm\"\nreceived = \"received\"\n";
    std::fs::write(here.join("mapping.toml"), mapping).unwrap();
    for command in [
        "check --data links.csv",
        "compare model.toml --data links.csv",
        "diagnose model.toml --data links.csv",
        "diagnose model.toml --between links.csv links.csv",
        "extend model.toml --data links.csv --effect constant --output x.toml",
        "simulate model.toml --like links.csv --output x.csv",
        "power model.toml --like links.csv --effect constant",
        "convert mapping.toml --output x.csv",
    ] {
        let args: Vec<&str> = command.split(' ').chain(["--memory-budget", "150kB"]).collect();
        let output = orchestrator(&args, here);
        assert_eq!(output.status.code(), Some(2), "{command}: {}", said(&output));
        let expected = "needs more than 150 kB of memory for";
        assert!(said(&output).contains(expected), "{command}: {}", said(&output));
    }
}

#[test]
fn names_of_columns_do_not_act_on_the_terminal() {
    let folder = tests::folder();
    let header = "time_s,tx,rx,rssi_dbm,received,\u{1b}[2J\u{1b}]0;owned\u{7}";
    let rows: String = (0..40).map(|k| format!("{k},0,1,{},1,5\n", -70 - k % 3)).collect();
    std::fs::write(folder.path().join("links.csv"), format!("{header}\n{rows}")).unwrap();
    let output = orchestrator(&["check", "--data", "links.csv"], folder.path());
    assert!(!said(&output).contains('\u{1b}') && !said(&output).contains('\u{7}'));
    assert!(said(&output).contains("\\u{1b}[2J\\u{1b}]0;owned\\u{7}"), "{}", said(&output));
}

#[test]
fn a_full_device_is_an_error_and_a_closed_pipe_is_none() {
    let folder = tests::folder();
    std::fs::write(folder.path().join("e.toml"), SHORT).unwrap();
    let recorded = orchestrator(&["run", "e.toml"], folder.path());
    assert!(recorded.status.success(), "{}", said(&recorded));
    for command in
        ["schema", "effects", "metrics", "effects shadowing", "verify runs/e", "check e.toml"]
    {
        let to = |file: File| -> Output {
            let mut program = Command::new(executable("murmuration"));
            program.args(command.split(' ')).current_dir(folder.path()).stdout(file);
            program.stderr(Stdio::piped()).spawn().unwrap().wait_with_output().unwrap()
        };
        let full = to(File::options().write(true).open("/dev/full").unwrap());
        assert_eq!(full.status.code(), Some(1), "{command}");
        assert!(
            said(&full).contains("cannot write to standard output: No space left"),
            "{command}"
        );
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let closed = to(File::from(std::os::fd::OwnedFd::from(writer)));
        assert!(
            closed.status.success() && closed.stderr.is_empty(),
            "{command}: {}",
            said(&closed)
        );
    }
}

/// A run of a second.
const SHORT: &str = "[experiment]\nname = \"e\"\nseed = 3\nduration_s = 1.0\nagents = 4\n\
    [robotsim.scenario]\nkind = \"line\"\n[robotsim.controller]\nkind = \"random-jump\"\n\
    [netsim.phy]\npropagation = \"full\"\n";

#[test]
fn connections_without_a_token_do_not_end_a_live_run() {
    let folder = tests::folder();
    let config = SHORT.replace("duration_s = 1.0", "duration_s = 600.0\ncheckpoint_every_s = 0.2");
    std::fs::write(folder.path().join("e.toml"), config).unwrap();
    // Fewer descriptors than connections that the server lets in elsewhere.
    let mut command = limited("ulimit -n 90", "run e.toml --live --live-speed 60", folder.path());
    let mut run = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let (told, lines) = std::sync::mpsc::channel();
    for stream in [
        Box::new(run.stdout.take().unwrap()) as Box<dyn std::io::Read + Send>,
        Box::new(run.stderr.take().unwrap()),
    ] {
        let told = told.clone();
        std::thread::spawn(move || {
            for line in BufReader::new(stream).lines().map_while(Result::ok) {
                let _ = told.send(line);
            }
        });
    }
    let mut said = String::new();
    let host = loop {
        let line = lines.recv_timeout(Duration::from_secs(60)).unwrap();
        said.push_str(&line);
        if let Some((_, rest)) = line.split_once("http://") {
            break rest.split('/').next().unwrap().to_owned();
        }
    };
    let mut open = Vec::new();
    for _ in 0..2000 {
        // The queue of the server may be full.
        let address = host.parse().unwrap();
        open.extend(TcpStream::connect_timeout(&address, Duration::from_millis(20)).ok());
        if 500 < open.len() {
            open.remove(0);
        }
    }
    let checkpoint = || -> Option<std::time::SystemTime> {
        let left = crate::resuming::unfinished(&folder.path().join("runs"));
        left.first()?.join("checkpoint").metadata().ok()?.modified().ok()
    };
    let before = checkpoint();
    wait_until("no checkpoint was stored while strangers were connected", || {
        assert!(
            run.try_wait().unwrap().is_none(),
            "{said} {:?}",
            lines.try_iter().collect::<Vec<_>>()
        );
        checkpoint() > before
    });
    drop(open);
    signal("-INT", run.id());
    let ended = end_of(run);
    let rest: Vec<String> = lines.try_iter().collect();
    assert!(rest.join("\n").contains("interrupted after step"), "{ended:?} {rest:?}");
    assert!(folder.path().join("runs/e/summary.json").exists());
}

#[test]
fn a_killed_program_leaves_a_folder_that_the_next_removes() {
    let folder = tests::folder();
    let place = folder.path().join("t");
    std::fs::create_dir(&place).unwrap();
    std::fs::write(folder.path().join("e.toml"), SHORT).unwrap();
    let long = SHORT.replace("duration_s = 1.0", "duration_s = 86400.0");
    std::fs::write(folder.path().join("long.toml"), long).unwrap();
    let command = |args: &[&str]| {
        let mut command = Command::new(executable("murmuration"));
        command.args(args).current_dir(folder.path()).env("TMPDIR", &place);
        command.env_remove("XDG_RUNTIME_DIR").stdout(Stdio::null()).stderr(Stdio::null());
        command
    };
    let left = || -> Vec<PathBuf> {
        std::fs::read_dir(&place).unwrap().map(|entry| entry.unwrap().path()).collect()
    };
    let serve = |out: &str| command(&["run", "long.toml", "--out", out]).spawn().unwrap();
    let (mut killed, mut alive) = (serve("a"), serve("b"));
    for out in ["a", "b"] {
        tests::wait_until_recording(&folder.path().join(out));
    }
    let of_both = left();
    assert!(2 <= of_both.len(), "{of_both:?}");
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert_eq!(left().len(), of_both.len(), "nobody has removed anything");
    assert!(command(&["run", "e.toml", "--out", "c"]).status().unwrap().success());
    assert_eq!(2 * left().len(), of_both.len(), "{:?}", left());
    assert!(alive.try_wait().unwrap().is_none());
    signal("-INT", alive.id());
    alive.wait().unwrap();
    assert_eq!(left(), Vec::<PathBuf>::new());
}
