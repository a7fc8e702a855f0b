//! Checks a record: every file whole, every step there, every digest right.

use super::directory::is_record;
use super::pcap::{self, Counter};
use super::read::{ReadError, Reader};
use super::whole::{Fingerprint, fingerprint};
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use proto::digest::{hex, of_step};
use proto::types::{Coupling, Deliveries};
use proto_messages::convert::{self, InvalidField};
use serde_json::Value;
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

/// What was found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct VerifyReport {
    /// Files that are as they were written, by name.
    pub files: Vec<String>,
    /// Steps read from the messages.
    pub steps: u64,
    /// Steps whose digest, computed again, is the one recorded.
    pub digests: u64,
    /// What is wrong, a sentence each. Empty: nothing.
    pub problems: Vec<String>,
}

/// Why there is nothing to check.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// Not the directory of a run: its `summary.json` is missing or no summary.
    #[error("{} is not a record: it has no summary.json that a run has written", path.display())]
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
    let mut report = VerifyReport::default();
    let summary = json(dir, "summary.json", &mut report);
    let provenance = json(dir, "provenance.json", &mut report);
    whole_files(dir, &provenance, &mut report);
    configuration(dir, &mut report);
    tables(dir, &summary, &mut report);
    capture(dir, &summary, &mut report);
    if summary["files"].get("run.mcap").is_some() {
        steps(dir, &summary, &mut report);
    }
    Ok(report)
}

fn json(dir: &Path, name: &str, report: &mut VerifyReport) -> Value {
    let read = || -> Result<Value, String> {
        let text = std::fs::read(dir.join(name)).map_err(|error| error.to_string())?;
        serde_json::from_slice(&text).map_err(|error| error.to_string())
    };
    read().unwrap_or_else(|error| {
        report.problems.push(format!("{name}: {error}"));
        Value::Null
    })
}

/// Every file is as long as it was and has the content it had.
fn whole_files(dir: &Path, provenance: &Value, report: &mut VerifyReport) {
    let Some(files) = provenance["files"].as_object() else {
        report.problems.push("provenance.json: does not list the files".to_owned());
        return;
    };
    for (name, expected) in files {
        let expected: Option<Fingerprint> = serde_json::from_value(expected.clone()).ok();
        match (fingerprint(&dir.join(name)), expected) {
            (Ok(found), Some(expected)) if found == expected => report.files.push(name.clone()),
            (Ok(found), Some(expected)) if found.bytes == expected.bytes => {
                report.problems.push(format!("{name}: its content was changed"));
            }
            (Ok(found), Some(expected)) => report.problems.push(format!(
                "{name}: has {} bytes, {} were written",
                found.bytes, expected.bytes
            )),
            (Ok(_), None) => {
                report.problems.push(format!("provenance.json: files.{name} is not a fingerprint"));
            }
            (Err(error), _) => report.problems.push(format!("{name}: {error}")),
        }
    }
}

fn configuration(dir: &Path, report: &mut VerifyReport) {
    match std::fs::read_to_string(dir.join("config.toml")) {
        Ok(text) => {
            if let Err(error) = text.parse::<toml::Table>() {
                report.problems.push(format!("config.toml: is not TOML: {}", error.message()));
            }
        }
        Err(error) => report.problems.push(format!("config.toml: {error}")),
    }
}

/// Every table can be opened and has as many rows as were written.
fn tables(dir: &Path, summary: &Value, report: &mut VerifyReport) {
    for (name, counts) in summary["files"].as_object().into_iter().flatten() {
        let Some(expected) = counts["rows"].as_i64() else { continue };
        let rows = || -> Result<i64, String> {
            let file = File::open(dir.join(name)).map_err(|error| error.to_string())?;
            let reader = SerializedFileReader::new(file).map_err(|error| error.to_string())?;
            Ok(reader.metadata().file_metadata().num_rows())
        };
        match rows() {
            Ok(rows) if rows == expected => {}
            Ok(rows) => {
                report.problems.push(format!("{name}: has {rows} rows, {expected} were written"));
            }
            Err(error) => report.problems.push(format!("{name}: {error}")),
        }
    }
}

/// The capture ends where a frame does and holds as many as were written.
fn capture(dir: &Path, summary: &Value, report: &mut VerifyReport) {
    let Some(expected) = summary["files"][pcap::FILE]["frames"].as_u64() else { return };
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
        Ok(counter) if !counter.is_whole() => "ends within a frame".to_owned(),
        Ok(counter) if counter.frames() != expected => {
            format!("has {} frames, {expected} were written", counter.frames())
        }
        Ok(_) => return,
        Err(error) => error.to_string(),
    };
    report.problems.push(format!("{}: {problem}", pcap::FILE));
}

/// Every step is there, one after the other, and its digest is that of what was exchanged.
fn steps(dir: &Path, summary: &Value, report: &mut VerifyReport) {
    let mut last_digest = None;
    if let Err(error) = read_steps(dir, report, &mut last_digest) {
        report.problems.push(error);
    }
    let expected = summary["steps"].as_u64().unwrap_or(0);
    if report.steps != expected {
        report
            .problems
            .push(format!("run.mcap: has {} steps, the run took {expected}", report.steps));
    } else if last_digest.as_deref() != summary["final_digest"].as_str() {
        report.problems.push("run.mcap: the last digest is not the one in summary.json".to_owned());
    }
}

fn read_steps(
    dir: &Path,
    report: &mut VerifyReport,
    last_digest: &mut Option<String>,
) -> Result<(), String> {
    let read_error = |error: ReadError| error.to_string();
    let field_error =
        |step: u64| move |error: InvalidField| format!("run.mcap: step {step}: {error}");
    let mut reader = Reader::open(dir).map_err(read_error)?;
    let Some(configured) = reader.configured() else { return Ok(()) };
    let n = configured.robot_request.agent_count as usize;
    let coupling = convert::coupling(configured.robot_request.coupling).map_err(field_error(0))?;
    let mut states_before =
        convert::states(configured.robot_response.states.clone(), n).map_err(field_error(0))?;
    let mut given: Option<Deliveries> = None;
    while let Some(recorded) = reader.next_step().map_err(read_error)? {
        let step = report.steps + 1;
        let numbers = [recorded.robots.step, recorded.net.step, recorded.barrier.step];
        if numbers != [step; 3] {
            return Err(format!("run.mcap: step {step} is missing: found {numbers:?}"));
        }
        let states = convert::states(recorded.robots.states, n).map_err(field_error(step))?;
        let on_air = match coupling {
            Coupling::Sequential => &states,
            Coupling::Parallel | Coupling::Event => &states_before,
        };
        let digest = of_step(step, recorded.barrier.time_ns, on_air, given.as_ref());
        if recorded.barrier.digest[..] == digest {
            report.digests += 1;
        } else {
            report.problems.push(format!(
                "run.mcap: step {step}: the digest of what was exchanged is {}, recorded is {}",
                hex(&digest),
                hex(&recorded.barrier.digest)
            ));
        }
        given = convert::deliveries(recorded.net.deliveries, n).map_err(field_error(step))?;
        states_before = states;
        report.steps = step;
        *last_digest = Some(hex(&recorded.barrier.digest));
    }
    Ok(())
}
