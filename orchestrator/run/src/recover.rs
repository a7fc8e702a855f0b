//! What a run that was killed had recorded, as a result; and a recorded run once more, to compare.

use super::attempt::{Attempt, Begun, Origin, plan_of, recorded_plan};
use super::course::carry_out;
use super::interrupt::Interrupt;
use super::start::{StartOptions, connect, header, ready_with};
use super::warm_start::FormedFiles;
use super::{Audience, RunError, RunReport, Work, provenance};
use drive::{ConfigureRequests, Wanted};
use experiment::{Acts, Capability, Overrides, Start};
use proto::bounds::DESCRIPTION_BYTES;
use proto::config::Refusal;
use record::bounded::read_file;
use record::leftover::Leftover;
use record::read::RunReader;
use record::result::{PROVENANCE_FILE, ResultFolder};
use record::run_log;
use record::run_summary::RunSummary;
use record::values;
use record::{
    Ending, Finished, RecordError, Recorder, ReplacePolicy, Reservation, Status, fingerprint,
};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// What to go on with.
#[derive(Clone, Debug)]
pub struct ResumeOptions {
    /// The folder of a run that was killed.
    pub dir: PathBuf,
    /// What the command line puts over its configuration.
    pub overrides: Overrides,
    /// Which earlier results the result replaces.
    pub replace: ReplacePolicy,
    /// How the sides are started.
    pub start: StartOptions,
}

/// Goes on with a run that was killed, from its latest checkpoint.
///
/// # Errors
///
/// See [`RunError`]. The folder of the killed run is then as it was.
pub fn resume<'a>(
    options: &'a ResumeOptions,
    audience: &'a mut dyn Audience,
) -> Work<'a, Result<RunReport, RunError>> {
    Box::pin(go_on(options, audience))
}

async fn go_on(
    options: &ResumeOptions,
    audience: &mut dyn Audience,
) -> Result<RunReport, RunError> {
    let dir = &options.dir;
    is_unfinished(dir)?;
    let mut interrupt = Interrupt::listen();
    let mut leftover = Leftover::open(dir).map_err(|error| RunError::Leftover { error })?;
    let mut overrides = options.overrides.clone();
    let Some(checkpoint) = leftover.checkpoint() else {
        return Err(RunError::NoCheckpoint { dir: dir.clone() });
    };
    let urls = checkpoint.urls.clone();
    let step = checkpoint.step;
    let given = [&overrides.robotsim_url, &overrides.netsim_url].map(Option::is_some);
    let [robots_url, network_url] = urls.clone();
    overrides.robotsim_url = overrides.robotsim_url.or(robots_url);
    overrides.netsim_url = overrides.netsim_url.or(network_url);
    overrides.goes_on = true;
    let (plan, exchange) = plan_of(dir, &mut leftover, &overrides)?;
    // What a result says is no consent: it may be somebody else's.
    let files = [&exchange.robots_request.files, &exchange.network_request.files];
    let calls = ["robotsim", "netsim"].into_iter().zip(urls).zip(given.into_iter().zip(files));
    let calls = calls.filter_map(|((side, url), (is_given, files))| {
        let url = url.filter(|_| !is_given)?;
        Capability::call(format!("{side}.url"), url, files.keys().map(PathBuf::from).collect())
    });
    let refused = overrides.consent.refusals(&calls.collect::<Vec<_>>());
    if !refused.is_empty() {
        return Err(RunError::Refused(Refusal::new(&plan.path, &plan.text, &plan.tree, refused)));
    }
    options.start.run_log.add("orchestrator", &provenance::opening(&plan));
    let mut origin = Origin::new(out_of(dir), options.replace);
    let attempt = Attempt::go_on(&plan, &options.start, &origin, dir, &mut interrupt).await?;
    origin.left.push(dir.clone());
    origin.resumed.push(step);
    carry_out(&plan, &options.start, attempt, origin, interrupt, audience).await
}

/// Refuses what does not exist, and the folder of a result: it is no run to go on with.
fn is_unfinished(dir: &Path) -> Result<(), RunError> {
    if !dir.exists() {
        let reason = format!("it {}", experiment::missing_file(dir));
        return Err(RunError::NotRecovered { dir: dir.to_owned(), reason });
    }
    let name = std::path::absolute(dir).ok().and_then(|dir| dir.file_name().map(OsString::from));
    let is_hidden = name.is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
    if is_hidden || RunSummary::of(&ResultFolder::unchecked(dir)).is_err() {
        return Ok(());
    }
    let reason = "it is the result of a run that ended; there is nothing to recover".to_owned();
    Err(RunError::NotRecovered { dir: dir.to_owned(), reason })
}

/// The folder of results that an unfinished run stands in.
fn out_of(dir: &Path) -> PathBuf {
    match std::path::absolute(dir).ok().as_deref().and_then(Path::parent) {
        Some(parent) => parent.to_owned(),
        None => PathBuf::from("."),
    }
}

/// Makes a result of what a run that was killed had recorded, up to its last whole step, and removes its folder. A run that was
/// killed after its last step ends as it would have.
///
/// # Errors
///
/// See [`RunError`]. The folder is then as it was.
pub fn recover(dir: &Path) -> Result<Finished, RunError> {
    let unusable = |error| RunError::Leftover { error };
    is_unfinished(dir)?;
    let mut leftover = Leftover::open(dir).map_err(unusable)?;
    let (plan, exchange) =
        plan_of(dir, &mut leftover, &Overrides::default().acting(Acts::Nothing))?;
    let recorded = &exchange.robots_request.experiment;
    // A run that started from a formed network recorded the seed with which that had formed.
    let is_same_seed = plan.warm_start.is_some() || recorded.seed == plan.experiment.seed;
    if !is_same_seed || recorded.agent_count != plan.experiment.agent_count {
        let reason = format!(
            "its config.toml was changed: seed {}, {} agents; recorded are seed {}, {} agents. Put back what was recorded",
            plan.experiment.seed, plan.experiment.agent_count, recorded.seed, recorded.agent_count
        );
        return Err(RunError::NotRecovered { dir: dir.to_owned(), reason });
    }
    let unwritten = |error: RecordError| RunError::Record { error, before_start: false };
    // A record of a network that forms says when its robots started.
    let start = plan.start.unwrap_or(Start::AtOnce);
    let mut recorder =
        Recorder::create(&out_of(dir), header(&plan, &exchange, start)).map_err(unwritten)?;
    recorder.configured(exchange).map_err(unwritten)?;
    // Twice: the radio's traffic is cut where the last step ends, which only reading to the end tells.
    let mut last = (0, 0);
    while let Some(step) = leftover.next_step() {
        last = (step.step, step.time_ns);
        recorder.step(step).map_err(unwritten)?;
    }
    if let Some(part) = leftover.capture(last.1).map_err(unwritten)? {
        recorder.capture(part).map_err(unwritten)?;
    }
    let ending = Ending::stored(dir, last.0).unwrap_or_else(|| {
        let reason = format!("the run was killed; recovered up to step {}", last.0);
        Ending::early(Status::Interrupted, reason)
    });
    let provenance = json!({
        "schema": "provenance/1",
        "orchestrator": { "version": env!("CARGO_PKG_VERSION") },
        "recovered_from": dir,
        "command_line": std::env::args().collect::<Vec<_>>(),
    });
    // What happened to it is in its log.
    run_log::carry_over(dir, &recorder.path()).map_err(unwritten)?;
    let mut finished = recorder.finish(&ending, provenance, report::page).map_err(unwritten)?;
    if let Err(source) = system::remove_dir_all(dir) {
        let error = RecordError::Remove { path: dir.to_owned(), source };
        finished.warnings.push(format!("{error}; the result is whole"));
    }
    Ok(finished)
}

/// Whether a recorded run comes out the same when it is run again.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Reproduction {
    /// The format of this answer.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: &'static str,
    /// Files that came out the same, byte for byte.
    pub equal: Vec<String>,
    /// Files that did not.
    pub different: Vec<String>,
    /// The first step whose messages differ, if any do; 0: the configuration.
    pub first_different_step: Option<u64>,
    /// The version that recorded the run, and the one that ran it again.
    pub versions: [String; 2],
}

/// What the schema of the answer is called.
pub(super) const SCHEMA: &str = "reproduce/1";

/// Runs a recorded experiment again, from its own folder, into `out`, and compares the files of both.
///
/// # Errors
///
/// See [`RunError`]; a run that is not complete cannot be run again.
pub fn reproduce<'a>(
    run: &'a ResultFolder,
    out: &'a Path,
    start: &'a StartOptions,
    overrides: &'a Overrides,
    audience: &'a mut dyn Audience,
) -> Work<'a, Result<Reproduction, RunError>> {
    Box::pin(run_again(run, out, start, overrides, audience))
}

async fn run_again(
    folder: &ResultFolder,
    out: &Path,
    start: &StartOptions,
    overrides: &Overrides,
    audience: &mut dyn Audience,
) -> Result<Reproduction, RunError> {
    let run = folder.path();
    let not_complete = |reason: String| RunError::NotReproducible { dir: run.to_owned(), reason };
    folder.check_all().map_err(|error| RunError::Unbelieved { error })?;
    let summary = RunSummary::of(folder).map_err(|error| not_complete(error.to_string()))?;
    if summary.status != Status::Complete {
        return Err(not_complete(format!("the run is {}, not complete", summary.status.name())));
    }
    let reader = RunReader::of(folder).map_err(|error| not_complete(error.to_string()))?;
    let exchange = reader
        .configured()
        .cloned()
        .map(values::configured)
        .transpose()
        .map_err(|error| not_complete(error.to_string()))?;
    let Some(exchange) = exchange else {
        return Err(not_complete("it ended before both sides were configured".to_owned()));
    };
    let mut plan = recorded_plan(&run.join("config.toml"), &exchange, overrides)?;
    let formed = FormedFiles::default().open(&mut plan)?;
    let interrupt = Interrupt::listen();
    let (robots, network) = connect(&plan, start).await?;
    let asked =
        ConfigureRequests { robots: exchange.robots_request, network: exchange.network_request };
    let wanted = Wanted::Record;
    let started =
        ready_with(&plan, robots, network, wanted, Some(asked), formed.as_deref()).await?;
    let reservation = Reservation::new(out, &plan.name)
        .map_err(|error| RunError::Record { error, before_start: true })?;
    let replace = ReplacePolicy::SameExperiment;
    let begun = Begun { reservation, replace, log: start.run_log.clone(), before: None };
    let attempt = Attempt::begin(&plan, begun, started).await?;
    let origin = Origin::new(out.to_owned(), replace);
    let again = carry_out(&plan, start, attempt, origin, interrupt, audience).await?;
    if again.interrupted {
        return Err(RunError::Interrupted { signal: "a signal" });
    }
    compare(run, &again.finished.dir).map_err(&not_complete)
}

/// Compares the files of two runs whose content depends on the experiment alone.
fn compare(run: &Path, again: &Path) -> Result<Reproduction, String> {
    let list = |dir: &Path| -> Result<(Map<String, Value>, String), String> {
        let path = dir.join(PROVENANCE_FILE);
        let text = read_file(&DESCRIPTION_BYTES, &path)
            .map_err(|error| format!("{}: {error}", path.display()))?;
        let value: Value = serde_json::from_slice(&text)
            .map_err(|error| format!("{}: {error}", path.display()))?;
        let files = value["files"].as_object().cloned().unwrap_or_default();
        let version = value["orchestrator"]["version"].as_str().unwrap_or("unknown").to_owned();
        Ok((files, version))
    };
    let ((before, version), (after, now)) = (list(run)?, list(again)?);
    let names: BTreeSet<&String> = before.keys().chain(after.keys()).collect();
    let (mut equal, mut different) = (Vec::new(), Vec::new());
    for name in names {
        // The page shows when, where and how long.
        if name == "report.html" {
            continue;
        }
        // What stands there counts, not what was listed when it was written.
        let found = |dir: &Path| fingerprint(&dir.join(name)).ok();
        let is_equal = match (found(run), found(again)) {
            (Some(before), Some(after)) => before.is_same_content(&after),
            _ => false,
        };
        if is_equal { &mut equal } else { &mut different }.push(name.clone());
    }
    let is_same_log = !different.iter().any(|name| name == "run.mcap");
    let first_different_step = if is_same_log { None } else { first_difference(run, again) };
    Ok(Reproduction {
        schema: SCHEMA,
        equal,
        different,
        first_different_step,
        versions: [version, now],
    })
}

/// The first step whose messages differ, as far as both recordings can be read.
fn first_difference(run: &Path, again: &Path) -> Option<u64> {
    let steps = |dir: &Path| RunReader::of(&ResultFolder::unchecked(dir)).ok();
    let (mut before, mut after) = (steps(run)?, steps(again)?);
    if before.configured() != after.configured() {
        return Some(0);
    }
    for step in 1.. {
        match (before.next_step(), after.next_step()) {
            (Ok(None), Ok(None)) => return None,
            (Ok(before), Ok(after)) if before == after => {}
            _ => return Some(step),
        }
    }
    None
}
