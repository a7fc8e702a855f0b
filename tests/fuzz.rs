//! What fuzzers call: one entry function for each kind of input that comes from outside.
//!
//! An entry takes any bytes and returns. A panic, an abort, a hang or memory without end is a finding. Three programs call the
//! same entries: the test that replays `fuzz/corpus` (tests/it/fuzz_corpora.rs), the mutational driver that needs no more than a
//! stable toolchain (tests/bin/mutate.rs), and cargo-fuzz (fuzz/).

pub mod mutation;
pub mod seeds;
pub mod services;

use convert::mapping::Mapping;
use experiment::Overrides;
use measure::config::Compared;
use measure::memory::MemoryBudget;
use measure::table::DataTable;
use network::tracks::Tracks;
use proto::side::{NetSimulator as _, RobotSimulator as _};
use record::formed::FormedNetwork;
use std::path::{Path, PathBuf};
use study::choices::Choices;

/// A kind of input and the function that takes it.
#[derive(Clone, Copy)]
pub struct Target {
    /// Its name, which is also that of its folder in `fuzz/corpus`.
    pub name: &'static str,
    /// Takes any bytes.
    pub run: fn(&[u8]),
}

/// All targets.
pub const TARGETS: &[Target] = &[
    Target { name: "configuration", run: configuration },
    Target { name: "convert", run: logs },
    Target { name: "csv", run: table },
    Target { name: "formed", run: formed },
    Target { name: "gzip", run: table },
    Target { name: "k7", run: k7 },
    Target { name: "network_restore", run: network_restore },
    Target { name: "network_service", run: services::network },
    Target { name: "parquet", run: table },
    Target { name: "robots_restore", run: robots_restore },
    Target { name: "robots_service", run: services::robots },
    Target { name: "verify", run: verify },
];

/// The target of a name.
#[must_use]
pub fn target(name: &str) -> Option<&'static Target> {
    TARGETS.iter().find(|target| target.name == name)
}

/// The folder with the corpus of a target.
#[must_use]
pub fn corpus(target: &str) -> PathBuf {
    crate::repository().join("fuzz/corpus").join(target)
}

/// An experiment file.
fn configuration(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let path = Path::new("experiment.toml");
    if let Err(refusal) = experiment::read(path, text.to_owned(), &Overrides::default()) {
        assert!(!refusal.to_string().is_empty(), "a refusal says why");
    }
    // The part that is compared with measurements is read by another function.
    let _ = Compared::of_text(path, text.to_owned(), &[]);
}

/// A log in every format that is converted, and a mapping file.
fn logs(bytes: &[u8]) {
    const MAPPINGS: [&str; 4] = [
        "table = \"links\"\n[[input]]\nfiles = \"log\"\nformat = \"k7\"\n",
        "table = \"packets\"\n[[input]]\nfiles = \"log\"\nformat = \"openwsn-packets\"\n",
        "table = \"robots\"\n[[input]]\nfiles = \"log\"\ncolumns = { time_s = \"t\", agent = \"name\", latitude_deg = \"lat\", \
         longitude_deg = \"lon\", heading_rad = [\"qx\", \"qy\", \"qz\", \"qw\"], cmd_speed_mps = \"v\", cmd_steer_rad = 0 }\n\
         [[input]]\nfiles = \"log\"\njoin = \"interpolated\"\ncolumns = { time_s = \"t\", agent = \"name\" }\n",
        "table = \"links\"\n[[input]]\nfiles = \"log\"\ncumulative = true\ncolumns = { time_s = [\"t\", \"t\"], tx = \"name\", rx = 1, \
         rssi_dbm = \"v\", frames = \"lat\", received_frames = \"lon\" }\n",
    ];
    let folder = crate::folder();
    std::fs::write(folder.path().join("log"), bytes).expect("a temporary file");
    let path = folder.path().join("mapping.toml");
    for text in MAPPINGS {
        let mapping = Mapping::of_text(&path, text.to_owned()).expect("a valid mapping");
        if let Ok(converted) = convert::convert(&mapping, MemoryBudget::default()) {
            assert!(converted.answer.written <= converted.answer.read, "a row gives at most one");
        }
    }
    if let Ok(text) = std::str::from_utf8(bytes) {
        let _ = Mapping::of_text(&path, text.to_owned());
    }
}

/// A file of measurements, in the format that it begins like.
fn table(bytes: &[u8]) {
    let folder = crate::folder();
    let path = folder.path().join("data");
    std::fs::write(&path, bytes).expect("a temporary file");
    if let Ok(table) = DataTable::read(&path, MemoryBudget::default()) {
        read_as_everything(&table);
    }
}

/// A trace of link quality.
fn k7(bytes: &[u8]) {
    let _ = physics::k7::header(bytes);
    let _ = physics::k7::read(bytes);
    if bytes.first() == Some(&b'{') {
        table(bytes);
    }
}

fn read_as_everything(table: &DataTable) {
    let _ = measure::packets::read(table);
    let _ = Tracks::from_table(table);
    let _ = check::data(None, table, &Choices::default());
}

/// The recording of a run, in the folder of a run whose other files are good.
fn verify(bytes: &[u8]) {
    let folder = crate::folder();
    let write = |name: &str, content: &[u8]| {
        std::fs::write(folder.path().join(name), content).expect("a temporary file");
    };
    write("summary.json", include_bytes!("../fuzz/run/summary.json"));
    write("provenance.json", include_bytes!("../fuzz/run/provenance.json"));
    write("config.toml", include_bytes!("../fuzz/run/config.toml"));
    write("run.mcap", bytes);
    let report = record::verify::verify(folder.path()).expect("it is the folder of a run");
    assert!(report.steps < 1 << 20, "a file of this size cannot hold so many steps");
}

/// What a formed network holds after its checksum, which is made right.
fn formed(bytes: &[u8]) {
    let path = Path::new("formed");
    if let Ok(formed) = FormedNetwork::of_bytes(path, &FormedNetwork::sealed(bytes)) {
        let again = FormedNetwork::of_bytes(path, &formed.to_bytes()).expect("it was just written");
        assert_eq!(again.steps.len(), formed.steps.len());
    }
}

/// The state of a network simulator, as its service stores it.
fn network_restore(bytes: &[u8]) {
    let mut network = netsim::sim::Network::default();
    if network.restore(bytes).is_ok() {
        let _ = network.snapshot();
    }
}

/// The state of a robot simulator.
fn robots_restore(bytes: &[u8]) {
    let mut swarm = robotsim::sim::Swarm::default();
    if swarm.restore(bytes).is_ok() {
        let _ = swarm.snapshot();
    }
}
