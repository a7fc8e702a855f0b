//! An experiment file: from text to something that can be run, or to every problem it has.

mod consent;
mod control;
mod file_kind;
mod idle;
mod keys;
pub mod output;
mod overrides;
mod profile;
mod program;
mod reach;
mod sides;
pub mod sweep;
pub mod timeline;
mod warm_start;

pub use consent::{Action, Acts, Capability, Consent, capabilities};
pub use control::ControlPeriod;
pub use file_kind::FileKind;
pub use keys::{ExperimentKeys, WITHOUT_EFFECT};
pub use output::OutputConfig;
pub use overrides::Overrides;
pub use overrides::opened;
pub use program::{program_name, set_program_name};
pub use reach::{ReachKeys, SideCommand, quoted};
pub use sides::SideConfig;
pub use timeline::Timeline;
pub use warm_start::WarmStart;

use keys::{CouplingMode, TlsKeys};
use proto::bounds::CONFIGURATION_BYTES;
use proto::config::{
    self, Choice, FilePath, IdleKey, Lists, Node, Problem, Refusal, Section, TableSpec, Value,
};
use proto::site;
use proto::types::{Coupling, Experiment, NS_PER_S, seconds};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sides::Sides;
pub use sides::{missing_file, named_files};
use std::cell::{Cell, OnceCell};
use std::path::{Path, PathBuf};

/// Certificates to talk to simulators with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tls {
    /// Authority (PEM).
    pub ca: PathBuf,
    /// Own certificate and key (PEM).
    pub identity: Option<(PathBuf, PathBuf)>,
}

/// How steps cross.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// One gRPC stream if the simulator supports sessions, otherwise single calls.
    Auto,
    /// One gRPC stream; refused if a simulator does not support sessions.
    Stream,
    /// Single calls.
    Unary,
}

/// When the robots start.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    /// They stand still until the network has formed; this time does not count towards duration_s.
    #[schemars(description = "When the network has formed.")]
    WhenFormed,
    /// At time 0, whether the network has formed or not.
    #[schemars(description = "At time 0.")]
    AtOnce,
}

/// A valid experiment: the checked file, from which everything else is configured.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The file it came from.
    pub path: PathBuf,
    /// Its text, for messages about what a foreign simulator refuses.
    pub text: String,
    /// What was written, with places.
    pub tree: Node,
    /// Name.
    pub name: String,
    /// Seed, capacity, period, coupling.
    pub experiment: Experiment,
    /// How often robots act.
    pub control: ControlPeriod,
    /// Simulated time from when the robots start (ns).
    pub duration_ns: u64,
    /// When the robots start; `None`: when the network has formed, if it has anything to form.
    pub start: Option<Start>,
    /// The formed network that the run starts from; `None`: it begins with motes that are switched on.
    pub warm_start: Option<WarmStart>,
    /// Simulated time within which a network that robots wait for must have formed (ns).
    pub formation_limit_ns: u64,
    /// Faults and traffic.
    pub timeline: Timeline,
    /// End when the robots are done.
    pub stop_when_complete: bool,
    /// How steps cross.
    pub transport: Transport,
    /// Longest wait for a step that shows signs of life (s).
    pub step_deadline_s: f64,
    /// Simulators that are started take orders from other programs.
    pub accept_commands: bool,
    /// Real time between checkpoints (s); 0: none.
    pub checkpoint_every_s: f64,
    /// How often the run may go on from a checkpoint.
    pub restarts: u64,
    /// How long a lost side that was not started here is waited for (s).
    pub reconnect_limit_s: f64,
    /// Certificates.
    pub tls: Option<Tls>,
    /// `[site]` as TOML text.
    pub site_toml: String,
    /// `[robotsim]`.
    pub robotsim: SideConfig,
    /// `[netsim]`.
    pub netsim: SideConfig,
    /// `[output]`.
    pub output: OutputConfig,
    /// Effective `[experiment]`, `[site]`, `[[timeline]]` and `[output]`, for the record.
    pub effective: toml::Table,
    /// What the file asks for outside of its own folder.
    pub capabilities: Vec<Capability>,
    /// What should be checked before the results are trusted.
    pub warnings: Vec<String>,
    /// Keys that are written and have no influence. Their warnings are among `warnings`.
    pub idle: Vec<IdleKey>,
    /// What was chosen for a network whose profile is `auto` and whose robots move.
    pub profile: Option<String>,
}

/// Reads and checks an experiment file.
///
/// # Errors
///
/// Every problem it has, with its place.
pub fn load(path: &Path, overrides: &Overrides) -> Result<Plan, Refusal> {
    let text = text_of(path)?;
    read(path, text, overrides)
}

/// Reads the text of an experiment file.
///
/// # Errors
///
/// The file does not exist, cannot be read, or is not UTF-8 text.
pub fn text_of(path: &Path) -> Result<String, Refusal> {
    let file = std::fs::File::open(path);
    file.and_then(|file| CONFIGURATION_BYTES.read_text(file)).map_err(|error| {
        let reason = match error.kind() {
            std::io::ErrorKind::NotFound => missing_file(path),
            std::io::ErrorKind::InvalidData => "is not UTF-8 text".to_owned(),
            _ => format!("cannot be read: {error}"),
        };
        Refusal::of_file(path, reason)
    })
}

/// Checks the text of an experiment file; `path` is for messages, and for files that it names.
///
/// # Errors
///
/// Every problem it has, with its place.
pub fn read(path: &Path, text: String, overrides: &Overrides) -> Result<Plan, Refusal> {
    let (tree, problems) = opened(path, &text, overrides)?;
    of_tree(path, &text, &tree, overrides, problems)
}

/// Checks an experiment that has been parsed, adding to what was wrong with it before.
pub fn of_tree(
    path: &Path,
    text: &str,
    tree: &Node,
    overrides: &Overrides,
    mut problems: Vec<Problem>,
) -> Result<Plan, Refusal> {
    let base = path.parent().unwrap_or(Path::new(""));
    match plan(path, text, tree, base, overrides, &mut problems) {
        Some(plan) if problems.is_empty() => Ok(plan),
        _ => Err(Refusal::new(path, text, tree, problems)),
    }
}

/// The JSON Schema of an experiment file.
#[must_use]
pub fn schema() -> serde_json::Value {
    let section = |spec: &TableSpec, lists: &Lists, with_reach: bool| {
        let mut schema = config::json_schema(spec, lists);
        if with_reach {
            let reach = reach_properties();
            let tables = match schema.get_mut("oneOf").and_then(|tables| tables.as_array_mut()) {
                Some(tables) => tables.iter_mut().collect(),
                None => vec![&mut schema],
            };
            for table in tables {
                if let Some(properties) = table["properties"].as_object_mut() {
                    properties.extend(reach.clone());
                }
            }
        }
        schema
    };
    let robots = robotsim::catalogue::Catalogue::built_in().lists();
    let network = netsim::catalogue::Catalogue::built_in().lists();
    serde_json::json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Murmuration experiment",
        "type": "object",
        "properties": {
            "experiment": section(&ExperimentKeys::SPEC, &Lists::NONE, false),
            "site": section(&site::SPEC, &Lists::NONE, false),
            "robotsim": {
                "anyOf": [section(&robotsim::config::SPEC, &robots, true), foreign("robot")],
            },
            "netsim": {
                "anyOf": [section(&netsim::config::SPEC, &network, true), foreign("network")],
            },
            "timeline": {
                "type": "array",
                "description": "Scheduled events of the network.",
                "items": section(&timeline::EntryKeys::SPEC, &Lists::NONE, false),
            },
            "output": section(&OutputConfig::SPEC, &Lists::NONE, false),
            "sweep": section(&sweep::SweepKeys::SPEC, &Lists::NONE, false),
        },
        "required": ["experiment"],
        "additionalProperties": false,
    })
}

/// The schemas of the keys that say how a simulator is reached.
fn reach_properties() -> serde_json::Map<String, serde_json::Value> {
    let schema = config::json_schema(&ReachKeys::SPEC, &Lists::NONE);
    schema["properties"].as_object().cloned().unwrap_or_default()
}

/// The schema of a section that another simulator reads.
fn foreign(what: &str) -> serde_json::Value {
    serde_json::json!({
        "type": "object",
        "description": format!("Keys of a {what} simulator of your own; it checks them itself."),
        "properties": reach_properties(),
        "oneOf": [{ "required": ["url"] }, { "required": ["command"] }],
    })
}

/// Builds the plan, collecting problems. `None` only where there are problems.
fn plan(
    path: &Path,
    text: &str,
    tree: &Node,
    base: &Path,
    overrides: &Overrides,
    problems: &mut Vec<Problem>,
) -> Option<Plan> {
    check_sections(tree, problems);
    let capabilities = consent::capabilities(tree, base, overrides);
    problems.extend(overrides.consent.refusals(&capabilities));
    let empty = Node::empty_table();
    let section = |key: &str| tree.get(key).unwrap_or(&empty);
    let mut recorded = config::check(
        section("experiment"),
        "experiment",
        &ExperimentKeys::SPEC,
        &Lists::NONE,
        problems,
    )
    .table;
    let keys = ExperimentKeys::read(&recorded);
    let (site, site_table) = site::read(section("site"), "site", problems);
    let (output, output_table) = output::read(section("output"), "output", problems);

    if let Some(name) = &keys.name {
        check_name(name, problems);
    }
    let agents = keys.agents.unwrap_or(1);
    let robots = robotsim::catalogue::Catalogue::built_in();
    let network = netsim::catalogue::Catalogue::built_in();
    // What robots are like decides about the network, and the network about the period.
    let unknown_period = Experiment {
        seed: keys.seed,
        agent_count: agents,
        step_ns: 1,
        coupling: Coupling::Sequential,
    };
    let motes = OnceCell::new();
    let (idle_robots, idle) = (OnceCell::new(), OnceCell::new());
    let keeps_heights = Cell::new(false);
    let mut of_robots = Vec::new();
    let mut sides = Sides {
        base,
        site: &site,
        experiment: &unknown_period,
        known: keys.agents.is_some(),
        files: &overrides.files,
        unread: overrides.consent.unread(&capabilities),
        problems: &mut of_robots,
    };
    let robotsim = sides.read(
        section("robotsim"),
        "robotsim",
        overrides.robotsim_url.as_ref(),
        |node, path, problems| {
            robotsim::config::keys(node, path, robots, problems);
        },
        |node, path| robotsim::config::files(node, path, robots),
        |setup| {
            let (config, effective) = robotsim::config::read(setup, robots)?;
            _ = motes.set(profile::motes(&config, agents));
            keeps_heights.set(config.behaviour.fleet.keeps_heights());
            let found = robotsim::idle::idle(setup, robots);
            let warnings = found.iter().map(|idle| idle.warning.clone()).collect();
            _ = idle_robots.set(found);
            Ok((effective, warnings))
        },
    );
    let unknown = robotsim.0.is_foreign().then(|| profile::unknown_motes(agents));
    let own_motes = motes.get().filter(|_| unknown.is_none());
    let motes = unknown.as_ref().or_else(|| motes.get());
    let is_foreign = overrides.netsim_url.is_some() || reach::is_foreign(section("netsim"));
    let (netsim_section, profile) = profile::resolved(section("netsim"), motes, network);
    let is_parallel = keys.coupling == CouplingMode::Parallel;
    let slot_ns = slot_ns(&netsim_section);
    let control = control::read(&keys.control_period, agents, slot_ns, is_parallel, problems);
    let (timeline, timeline_tables) = timeline::read(tree, keys.agents, keys.duration_s, problems);
    if !is_foreign {
        timeline.check_orders(netsim::config::commands(&netsim_section, network), problems);
        timeline.check_added(&netsim::config::absent(&netsim_section, network), problems);
    }
    let tls = match &overrides.tls {
        Some(tls) => Some(tls.clone()),
        None => keys.tls.as_ref().and_then(|tls| tls.certificates(base, problems)),
    };
    let experiment = Experiment {
        seed: keys.seed,
        agent_count: agents,
        step_ns: control.step_ns(control::slotframe_slots(&netsim_section, agents), slot_ns),
        coupling: match (&control, keys.coupling) {
            (ControlPeriod::Packet, _) => Coupling::Event,
            (_, CouplingMode::Parallel) => Coupling::Parallel,
            (_, CouplingMode::Sequential) => Coupling::Sequential,
        },
    };
    problems.append(&mut of_robots);
    let mut sides = Sides {
        base,
        site: &site,
        experiment: &experiment,
        known: keys.agents.is_some(),
        files: &overrides.files,
        unread: overrides.consent.unread(&capabilities),
        problems,
    };
    let netsim = sides.read(
        &netsim_section,
        "netsim",
        overrides.netsim_url.as_ref(),
        |node, path, problems| {
            config::check(node, path, &netsim::config::SPEC, &network.lists(), problems);
        },
        |node, path| netsim::config::files(node, path, network),
        |setup| {
            let (_, effective, mut warnings) = netsim::config::read(setup, network)?;
            let mut found = idle::of_network(
                section("netsim"),
                setup,
                own_motes,
                // Other programs command robots as they like.
                keeps_heights.get() && keys.accept_commands != Some(true),
            );
            found.extend(idle::of_timeline(tree, &effective));
            let is_new = |idle: &&IdleKey| !warnings.contains(&idle.warning);
            let new: Vec<String> =
                found.iter().filter(is_new).map(|idle| idle.warning.clone()).collect();
            warnings.extend(new);
            _ = idle.set(found);
            let trace_ns = netsim::config::replay_ns(&effective, &setup.files, network);
            match longer_than_the_trace(trace_ns, keys.duration_s) {
                Some(problem) => Err(vec![problem]),
                None => Ok((effective, warnings)),
            }
        },
    );
    sides::check_messages(&robotsim.0, &netsim.0, problems);
    let warm_start = WarmStart::read(&keys, &mut recorded, base, &netsim.0, problems);
    if !problems.is_empty() {
        return None;
    }
    let mut effective = toml::Table::new();
    effective.insert("experiment".to_owned(), recorded.into());
    effective.insert("site".to_owned(), site_table.clone().into());
    effective.extend(timeline_tables.map(|tables| ("timeline".to_owned(), tables)));
    effective.insert("output".to_owned(), output_table.into());
    let ns = |time_s: f64| (libm::round(time_s * NS_PER_S as f64) as u64).max(1);
    Some(Plan {
        path: path.to_owned(),
        text: text.to_owned(),
        tree: tree.clone(),
        name: keys.name?,
        control,
        duration_ns: ns(keys.duration_s?),
        start: keys.start,
        warm_start,
        formation_limit_ns: ns(keys.formation_limit_s),
        timeline,
        stop_when_complete: keys.stop_when_complete,
        transport: keys.transport,
        step_deadline_s: keys.step_deadline_s,
        accept_commands: keys.accept_commands == Some(true),
        checkpoint_every_s: keys.checkpoint_every_s,
        restarts: keys.restarts,
        reconnect_limit_s: keys.reconnect_limit_s,
        tls,
        site_toml: site_table.to_string(),
        warnings: [robotsim.1, netsim.1].concat(),
        idle: [(idle_robots, &robotsim.0), (idle, &netsim.0)]
            .into_iter()
            .filter(|(_, side)| !side.is_foreign())
            .flat_map(|(idle, _)| idle.into_inner().unwrap_or_default())
            .collect(),
        profile,
        robotsim: robotsim.0,
        netsim: netsim.0,
        output,
        effective,
        capabilities,
        experiment,
    })
}

/// Adds a problem for each section of a file that is not known.
fn check_sections(tree: &Node, problems: &mut Vec<Problem>) {
    const SECTIONS: [&str; 6] = ["experiment", "site", "robotsim", "netsim", "timeline", "output"];
    let Value::Table(entries) = &tree.value else { return };
    for (key, ..) in entries.iter().filter(|(key, ..)| !SECTIONS.contains(&key.as_str())) {
        let mut problem = Problem::new(key, "is not a known section");
        problem.nearest = config::most_similar(key, SECTIONS).map(str::to_owned);
        if key == sweep::KEY {
            problem = Problem::new(
                key,
                format!(
                    "defines a sweep of many experiments; run it with {} sweep",
                    program_name()
                ),
            );
        } else if problem.nearest.is_none() {
            problem.message =
                format!("is not a known section; the sections are {}", SECTIONS.join(", "));
        }
        problems.push(problem);
    }
}

/// Adds a problem if a name cannot be that of a folder.
fn check_name(name: &str, problems: &mut Vec<Problem>) {
    if !is_file_name(name) {
        problems.push(
            Problem::new(
                "experiment.name",
                "must be 1 to 100 letters, digits, '-', '_' or '.', not starting with '.' or '-', because it names a folder",
            )
            .value(format!("{name:?}"))
            .nearest(format!("{:?}", as_file_name(name))),
        );
    }
}

/// What is wrong with a run that is sure to outlast the trace it replays, which ends at `trace_ns`: it lasts `duration_s`, and the network's formation
/// besides.
fn longer_than_the_trace(trace_ns: Option<u64>, duration_s: Option<f64>) -> Option<Problem> {
    let trace_s = seconds(trace_ns?);
    let duration_s = duration_s.filter(|&duration_s| trace_s < duration_s)?;
    let message = "must not exceed the length of the trace in netsim.phy.file, unless netsim.phy.after_end = \"hold\"";
    Some(Problem::new("experiment.duration_s", message).value(duration_s).nearest(trace_s))
}

/// The slot of the network (ns), where its section says one; 10 ms otherwise (IEEE 802.15.4-2015 default timeslot).
fn slot_ns(netsim: &Node) -> u64 {
    let written = match netsim.get("slot_duration_s").map(|node| &node.value) {
        Some(Value::Number(seconds)) => *seconds,
        Some(Value::Integer(seconds)) => *seconds as f64,
        _ => 0.01,
    };
    let ns = libm::round(written * NS_PER_S as f64);
    // Beyond what the network takes: it says so.
    if (1e3..=1e12).contains(&ns) { ns as u64 } else { 10_000_000 }
}

/// The certificates that `[experiment.tls]` names, paths being relative to `base`, and every problem with that section.
pub fn tls_of(section: &Node, base: &Path, problems: &mut Vec<Problem>) -> Option<Tls> {
    let checked = config::check(section, "experiment.tls", &TlsKeys::SPEC, &Lists::NONE, problems);
    TlsKeys::read(&checked.table).certificates(base, problems)
}

impl TlsKeys {
    /// The certificates, paths being relative to `base`, and every problem with them.
    fn certificates(&self, base: &Path, problems: &mut Vec<Problem>) -> Option<Tls> {
        let path = |file: &Option<FilePath>| file.as_ref().map(|FilePath(path)| base.join(path));
        let identity = path(&self.cert).zip(path(&self.key));
        for (file, other, key) in [(&self.cert, &self.key, "key"), (&self.key, &self.cert, "cert")]
        {
            if file.is_some() && other.is_none() {
                problems.push(Problem::new(
                    format!("experiment.tls.{key}"),
                    "is missing: cert and key must be set together",
                ));
            }
        }
        Some(Tls { ca: path(&self.ca)?, identity })
    }
}

/// Whether a text can name an experiment: letters, digits, `-`, `_` and `.`, at most 100, not starting with `.` or `-`.
#[must_use]
pub fn is_file_name(name: &str) -> bool {
    !name.starts_with(['.', '-'])
        && (1..=100).contains(&name.len())
        && name.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.'))
}

/// The most similar text that can name an experiment; `experiment` if there is none.
#[must_use]
pub fn as_file_name(name: &str) -> String {
    let replaced = name
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.') { c } else { '-' })
        .skip_while(|c| ['.', '-'].contains(c))
        .take(100)
        .collect::<String>();
    if is_file_name(&replaced) { replaced } else { "experiment".to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_suggested_name_is_valid_and_a_valid_one_stays() {
        let long = "x".repeat(200);
        for (name, suggested) in [
            ("../../escape", "escape"),
            ("é", "experiment"),
            ("-rf", "rf"),
            ("my run", "my-run"),
            ("", "experiment"),
            (&long, &long[..100]),
            ("run-1.b", "run-1.b"),
        ] {
            assert_eq!(as_file_name(name), suggested);
            assert!(is_file_name(suggested), "{suggested}");
        }
        assert!(!is_file_name(""));
    }
}
