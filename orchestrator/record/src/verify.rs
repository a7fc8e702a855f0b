//! Checks a record: every file whole, every step there, every digest right.

use super::bounded::{read_file, read_text_file};
use super::directory::is_record;
use super::pcap::{self, Counter};
use super::read::{ReadError, RecordedConfiguration, RunReader};
use super::result::PROVENANCE_FILE;
use super::run_log;
use super::run_summary::{FileCount, RunSummary};
use input::fingerprint::{Fingerprint, PART_BYTES, fingerprint};
use input::table::in_words;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use proto::bounds::DESCRIPTION_BYTES;
use proto::digest::full::{NetworkReply, RobotsReply, of_exchange};
use proto::digest::{Digest, hex, of_step};
use proto::types::{AgentStates, Coupling, Deliveries};
use proto_messages::convert::{self, InvalidField};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use sha2::{Digest as _, Sha256};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{ErrorKind, Read as _};
use std::path::{Path, PathBuf};

/// What the schema of the report is called.
pub const SCHEMA: &str = "verify/1";

/// Whether a record is as it was written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct VerifyReport {
    /// The format of this answer.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: &'static str,
    /// Files that are as they were written, by name.
    pub files: Vec<String>,
    /// Steps read from the messages.
    pub steps: u64,
    /// Steps whose digest, computed again, is the one recorded.
    pub digests: u64,
    /// The SHA-256 of the whole result, to be cited: that of the lines `SHA-256`, two spaces, name (as `sha256sum` prints them) of every
    /// file that `provenance.json` lists, of `provenance.json` itself and of `run.log` if there is one, sorted by name.
    pub root_sha256: String,
    /// What is wrong, a sentence each. Empty: nothing.
    pub problems: Vec<String>,
}

/// Why there is nothing to check.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// Not the directory of a run: its `summary.json` is missing or no summary.
    #[error("{} is not the folder of a run: it has no valid summary.json", path.display())]
    NotARecord {
        /// The directory.
        path: PathBuf,
    },
}

/// Checks the record in `dir`.
///
/// # Errors
///
/// If there is none. What is wrong with one is in the report, all of it.
pub fn verify(dir: &Path) -> Result<VerifyReport, VerifyError> {
    if !is_record(dir) {
        return Err(VerifyError::NotARecord { path: dir.to_owned() });
    }
    let mut report = verify_files(dir);
    let summary: Option<RunSummary> = json(dir, RunSummary::FILE, &mut report);
    let config = configuration(dir, &mut report);
    if let Some(summary) = summary {
        tables(dir, &summary, &mut report);
        capture(dir, &summary, &mut report);
        if summary.files.contains_key("run.mcap") {
            steps(dir, &summary, &config, &mut report);
        }
    }
    Ok(report)
}

/// Checks the files that `provenance.json` lists, of whatever result it is.
#[must_use]
pub fn verify_files(dir: &Path) -> VerifyReport {
    let (files, problems) = (Vec::new(), Vec::new());
    let root_sha256 = String::new();
    let mut report =
        VerifyReport { schema: SCHEMA, files, steps: 0, digests: 0, root_sha256, problems };
    let provenance: Option<Provenance> = json(dir, PROVENANCE_FILE, &mut report);
    let found = whole_files(dir, provenance.unwrap_or_default(), &mut report);
    report.root_sha256 = root(dir, found, &mut report);
    report
}

/// What `provenance.json` says of the other files.
#[derive(Default, Deserialize)]
struct Provenance {
    /// The fingerprint of each, as it was written.
    files: Option<Map<String, Value>>,
}

fn json<T: DeserializeOwned>(dir: &Path, name: &str, report: &mut VerifyReport) -> Option<T> {
    let read = || -> Result<T, String> {
        let text =
            read_file(&DESCRIPTION_BYTES, &dir.join(name)).map_err(|error| error.to_string())?;
        serde_json::from_slice(&text).map_err(|error| error.to_string())
    };
    read().map_err(|error| report.problems.push(format!("{name}: {error}"))).ok()
}

/// Every file is as long as it was and has the content it had. Returns the SHA-256 that each has now, by name.
fn whole_files(
    dir: &Path,
    provenance: Provenance,
    report: &mut VerifyReport,
) -> BTreeMap<String, String> {
    let mut digests = BTreeMap::new();
    let Some(files) = provenance.files else {
        report.problems.push(format!("{PROVENANCE_FILE}: the list of files is missing"));
        return digests;
    };
    for (name, expected) in files {
        let expected: Option<Fingerprint> = serde_json::from_value(expected).ok();
        let found = fingerprint(&dir.join(&name));
        if let Ok(found) = &found {
            digests.insert(name.clone(), found.sha256.clone());
        }
        match (found, expected) {
            (Ok(found), Some(expected)) if found.is_same_content(&expected) => {
                report.files.push(name.clone());
            }
            (Ok(found), Some(expected)) if found.bytes == expected.bytes => {
                let place = changed_place(&found, &expected);
                report
                    .problems
                    .push(format!("{name}: its content was changed after the run{place}"));
            }
            (Ok(found), Some(expected)) => report.problems.push(format!(
                "{name}: has {} bytes, but the run wrote {}",
                found.bytes, expected.bytes
            )),
            (Ok(_), None) => {
                report
                    .problems
                    .push(format!("provenance.json: files.{name} is not a SHA-256 digest"));
            }
            (Err(error), _) => report.problems.push(format!("{name}: {error}")),
        }
    }
    digests
}

/// Which bytes of a file were changed, as far as it is known.
fn changed_place(found: &Fingerprint, expected: &Fingerprint) -> String {
    let both = found.mebibytes.iter().zip(&expected.mebibytes).enumerate();
    let changed: Vec<usize> =
        both.filter(|(_, (found, expected))| found != expected).map(|(i, _)| i).collect();
    let (Some(first), Some(last)) = (changed.first(), changed.last()) else {
        return String::new();
    };
    let from = *first as u64 * PART_BYTES;
    let to = ((*last as u64 + 1) * PART_BYTES).min(found.bytes) - 1;
    format!(", within bytes {from} to {to}")
}

/// The SHA-256 of all files together, of which `digests` has those listed. See [`VerifyReport::root_sha256`].
fn root(dir: &Path, mut digests: BTreeMap<String, String>, report: &mut VerifyReport) -> String {
    for name in [PROVENANCE_FILE, run_log::FILE] {
        match fingerprint(&dir.join(name)) {
            Ok(found) => {
                digests.insert(name.to_owned(), found.sha256);
            }
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => report.problems.push(format!("{name}: {error}")),
        }
    }
    let lines = digests.iter().map(|(name, sha256)| format!("{sha256}  {name}\n"));
    hex(&Sha256::digest(lines.collect::<String>()))
}

/// The configuration; empty where it cannot be read.
fn configuration(dir: &Path, report: &mut VerifyReport) -> toml::Table {
    let text = read_text_file(&DESCRIPTION_BYTES, &dir.join("config.toml"));
    let config = text.map_err(|error| error.to_string()).and_then(|text| {
        text.parse().map_err(|error: toml::de::Error| format!("is not TOML: {}", error.message()))
    });
    config.unwrap_or_else(|problem| {
        report.problems.push(format!("config.toml: {problem}"));
        toml::Table::new()
    })
}

/// Every table can be opened and has as many rows as were written.
fn tables(dir: &Path, summary: &RunSummary, report: &mut VerifyReport) {
    for (name, count) in &summary.files {
        let FileCount::Rows(expected) = *count else { continue };
        let rows = || -> Result<u64, String> {
            let file = File::open(dir.join(name)).map_err(|error| error.to_string())?;
            let reader = SerializedFileReader::new(file).map_err(|error| in_words(&error))?;
            let n_rows = reader.metadata().file_metadata().num_rows();
            u64::try_from(n_rows).map_err(|error| error.to_string())
        };
        match rows() {
            Ok(rows) if rows == expected => {}
            Ok(rows) => {
                report
                    .problems
                    .push(format!("{name}: has {rows} rows, but the run wrote {expected}"));
            }
            Err(error) => report.problems.push(format!("{name}: {error}")),
        }
    }
}

/// The capture ends where a frame does and holds as many as were written.
fn capture(dir: &Path, summary: &RunSummary, report: &mut VerifyReport) {
    let Some(&FileCount::Frames(expected)) = summary.files.get(pcap::FILE) else { return };
    let count = || -> std::io::Result<Counter> {
        let mut file = File::open(dir.join(pcap::FILE))?;
        let mut counter = Counter::default();
        let mut block = vec![0; 1 << 16];
        loop {
            let n = file.read(&mut block)?;
            if n == 0 {
                return Ok(counter);
            }
            counter.read(&block[..n]);
        }
    };
    let problem = match count() {
        Ok(counter) if !counter.is_whole() => "ends in the middle of a frame".to_owned(),
        Ok(counter) if counter.frames() != expected => {
            format!("has {} frames, but the run wrote {expected}", counter.frames())
        }
        Ok(_) => return,
        Err(error) => error.to_string(),
    };
    report.problems.push(format!("{}: {problem}", pcap::FILE));
}

/// Every step is there, one after the other, and its digest is that of what was exchanged.
fn steps(dir: &Path, summary: &RunSummary, config: &toml::Table, report: &mut VerifyReport) {
    let mut last_digest = None;
    if let Err(error) = read_steps(dir, summary, config, report, &mut last_digest) {
        report.problems.push(error);
    }
    let expected = summary.steps;
    if report.steps != expected {
        report
            .problems
            .push(format!("run.mcap: has {} steps, but the run took {expected}", report.steps));
    } else if last_digest != summary.final_digest {
        report
            .problems
            .push("run.mcap: the last digest differs from the one in summary.json".to_owned());
    }
}

/// The summary and the configuration are of the experiment that is recorded.
fn is_of_the_experiment(
    summary: &RunSummary,
    config: &toml::Table,
    configured: &RecordedConfiguration,
    report: &mut VerifyReport,
) {
    let recorded = &configured.robot_request;
    let mut compare = |file: &str, key: &str, found: u64, recorded: u64| {
        if found != recorded {
            report.problems.push(format!(
                "{file}: {key} is {found}, but run.mcap is of a run with {recorded}"
            ));
        }
    };
    let file = RunSummary::FILE;
    // A run that started from a formed network recorded the seed with which that had formed.
    let is_warm = config.get("experiment").is_some_and(|it| it.get("warm_start").is_some());
    let drawn_from = if is_warm { summary.seed } else { recorded.seed };
    compare(file, "seed", summary.seed, drawn_from);
    compare(file, "agent_count", summary.agent_count.into(), recorded.agent_count.into());
    compare(file, "step_ns", summary.step_ns, recorded.step_ns);
    let seed = config.get("experiment").and_then(|section| section.get("seed"));
    if let Some(seed) = seed.and_then(toml::Value::as_integer) {
        compare("config.toml", "experiment.seed", seed as u64, drawn_from);
    }
}

fn read_steps(
    dir: &Path,
    summary: &RunSummary,
    config: &toml::Table,
    report: &mut VerifyReport,
    last_digest: &mut Option<String>,
) -> Result<(), String> {
    let read_error = |error: ReadError| error.to_string();
    let field_error =
        |step: u64| move |error: InvalidField| format!("run.mcap: step {step}: {error}");
    let mut reader = RunReader::open(dir).map_err(read_error)?;
    let Some(configured) = reader.configured() else { return Ok(()) };
    is_of_the_experiment(summary, config, configured, report);
    let n = configured.robot_request.agent_count as usize;
    let coupling = convert::coupling(configured.robot_request.coupling).map_err(field_error(0))?;
    let mut lesser = Lesser {
        coupling,
        states_before: convert::states(configured.robot_response.states.clone(), n)
            .map_err(field_error(0))?,
        given: None,
    };
    // Recordings of older versions hold digests of positions and deliveries alone.
    let mut is_full = true;
    while let Some(recorded) = reader.next_step().map_err(read_error)? {
        let step = report.steps + 1;
        let numbers = [recorded.robots.step, recorded.net.step, recorded.barrier.step];
        if numbers != [step; 3] {
            return Err(format!("run.mcap: step {step} is missing: found {numbers:?}"));
        }
        let commands = convert::mote_commands(recorded.commands, n).map_err(field_error(step))?;
        let (robots, _) = convert::robots_step(recorded.robots, n).map_err(field_error(step))?;
        let (network, _) = convert::network_step(recorded.net, n).map_err(field_error(step))?;
        let whole = || {
            let (robots, network) =
                (RobotsReply::of_step(&robots), NetworkReply::of_step(&network));
            of_exchange(&robots, &network, &commands)
        };
        let of_positions = || lesser.digest(step, recorded.barrier.time_ns, &robots.states);
        if step == 1 {
            is_full = recorded.barrier.digest[..] != of_positions();
        }
        let digest = if is_full { whole() } else { of_positions() };
        if recorded.barrier.digest[..] == digest {
            report.digests += 1;
        } else {
            report.problems.push(format!(
                "run.mcap: step {step}: the digest of the exchanged data is {}, but {} is recorded",
                hex(&digest),
                hex(&recorded.barrier.digest)
            ));
        }
        lesser.states_before = robots.states;
        lesser.given = Some(network.deliveries);
        report.steps = step;
        *last_digest = Some(hex(&recorded.barrier.digest));
    }
    Ok(())
}

/// What the digest of positions and deliveries depends on besides a step's own states.
struct Lesser {
    coupling: Coupling,
    states_before: AgentStates,
    given: Option<Deliveries>,
}

impl Lesser {
    fn digest(&self, step: u64, time_ns: u64, states: &AgentStates) -> Digest {
        let on_air = match self.coupling {
            Coupling::Sequential => states,
            Coupling::Parallel | Coupling::Event => &self.states_before,
        };
        of_step(step, time_ns, on_air, self.given.as_ref())
    }
}
