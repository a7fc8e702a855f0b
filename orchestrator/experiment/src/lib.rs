//! An experiment file: from text to something that can be run, or to every problem it has.

mod control;
mod keys;
pub mod output;
mod overrides;
mod program;
mod reach;
mod sides;
pub mod sweep;
pub mod timeline;
mod warm_start;

pub use control::ControlPeriod;
pub use keys::{EXPERIMENT, WITHOUT_EFFECT};
pub use output::OutputConfig;
pub use overrides::Overrides;
pub use overrides::opened;
pub use program::{program_name, set_program_name};
pub use reach::{REACH, SideCommand, quoted};
pub use sides::SideConfig;
pub use timeline::Timeline;
pub use warm_start::WarmStart;

use proto::bounds::CONFIGURATION_BYTES;
use proto::config::{self, Lists, Node, Problem, Refusal, TableSpec, Value};
use proto::site;
use proto::types::{Coupling, Experiment, NS_PER_S, seconds};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sides::Sides;
pub use sides::missing_file;
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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// A stream if announced.
    Auto,
    /// A stream, or refusal.
    Stream,
    /// Single calls.
    Unary,
}

/// When the robots start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    /// When the network has formed.
    WhenFormed,
    /// At time 0.
    AtOnce,
}

impl Start {
    /// The word for it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::WhenFormed => "when-formed",
            Self::AtOnce => "at-once",
        }
    }
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
    /// What should be checked before the results are trusted.
    pub warnings: Vec<String>,
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
            "experiment": section(&EXPERIMENT, &Lists::NONE, false),
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
                "items": section(&timeline::SPEC, &Lists::NONE, false),
            },
            "output": section(&output::SPEC, &Lists::NONE, false),
            "sweep": section(&sweep::SPEC, &Lists::NONE, false),
        },
        "required": ["experiment"],
        "additionalProperties": false,
    })
}

/// The schemas of the keys that say how a simulator is reached.
fn reach_properties() -> serde_json::Map<String, serde_json::Value> {
    let schema = config::json_schema(&REACH, &Lists::NONE);
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
    const SECTIONS: [&str; 6] = ["experiment", "site", "robotsim", "netsim", "timeline", "output"];
    if let Value::Table(entries) = &tree.value {
        for (key, ..) in entries {
            if !SECTIONS.contains(&key.as_str()) {
                if key == sweep::KEY {
                    problems.push(Problem::new(
                        key,
                        format!(
                            "defines a sweep of many experiments; run it with {} sweep",
                            program_name()
                        ),
                    ));
                    continue;
                }
                let mut problem = Problem::new(key, "is not a known section");
                problem.nearest = config::most_similar(key, SECTIONS).map(str::to_owned);
                if problem.nearest.is_none() {
                    problem.message =
                        format!("is not a known section; the sections are {}", SECTIONS.join(", "));
                }
                problems.push(problem);
            }
        }
    }
    let empty = Node::empty_table();
    let section = |key: &str| tree.get(key).unwrap_or(&empty);
    let experiment_table =
        config::check(section("experiment"), "experiment", &EXPERIMENT, &Lists::NONE, problems)
            .table;
    let (site, site_table) = site::read(section("site"), "site", problems);
    let (output, output_table) = output::read(section("output"), "output", problems);

    let name = experiment_table.get("name").and_then(toml::Value::as_str).unwrap_or("").to_owned();
    let name_known = !problems.iter().any(|problem| problem.path == "experiment.name");
    if name_known && !is_file_name(&name) {
        problems.push(
            Problem::new(
                "experiment.name",
                "must be 1 to 100 letters, digits, '-', '_' or '.', not starting with '.', because it names a folder",
            )
            .value(format!("{name:?}"))
            .nearest(format!("{:?}", as_file_name(&name))),
        );
    }
    let agents_known = !problems.iter().any(|problem| problem.path == "experiment.agents");
    let integer = |key: &str| experiment_table.get(key).and_then(toml::Value::as_integer);
    let number = |key: &str| experiment_table.get(key).and_then(toml::Value::as_float);
    let agents = integer("agents").and_then(|agents| usize::try_from(agents).ok());
    let parallel =
        experiment_table.get("coupling").and_then(toml::Value::as_str) == Some("parallel");
    let slot_ns = slot_ns(section("netsim"));
    let control =
        control::read(&experiment_table, agents.unwrap_or(1), slot_ns, parallel, problems);
    let duration_known = !problems.iter().any(|problem| problem.path == "experiment.duration_s");
    let (timeline, timeline_tables) = timeline::read(
        tree,
        agents.filter(|_| agents_known),
        number("duration_s").filter(|_| duration_known),
        problems,
    );
    let robots = robotsim::catalogue::Catalogue::built_in();
    let network = netsim::catalogue::Catalogue::built_in();
    if overrides.netsim_url.is_none() && !reach::is_foreign(section("netsim")) {
        timeline.check_orders(netsim::config::commands(section("netsim"), network), problems);
        timeline.check_added(&netsim::config::absent(section("netsim"), network), problems);
    }
    let tls = overrides.tls.clone().or_else(|| tls_of(&experiment_table, base, problems));

    let experiment = Experiment {
        seed: integer("seed").unwrap_or(0).unsigned_abs(),
        agent_count: agents.unwrap_or(1),
        step_ns: control
            .step_ns(control::slotframe_slots(section("netsim"), agents.unwrap_or(1)), slot_ns),
        coupling: match (&control, parallel) {
            (ControlPeriod::Packet, _) => Coupling::Event,
            (_, true) => Coupling::Parallel,
            (_, false) => Coupling::Sequential,
        },
    };
    let duration_s = number("duration_s").filter(|_| duration_known);
    let mut sides = Sides {
        base,
        site: &site,
        experiment: &experiment,
        known: agents_known,
        files: &overrides.files,
        problems,
    };
    let robotsim = sides.read(
        section("robotsim"),
        "robotsim",
        overrides.robotsim_url.as_ref(),
        |node, path, problems| {
            robotsim::config::keys(node, path, robots, problems);
        },
        |node, path| robotsim::config::files(node, path, robots),
        |setup| robotsim::config::read(setup, robots).map(|(_, effective)| (effective, Vec::new())),
    );
    let netsim = sides.read(
        section("netsim"),
        "netsim",
        overrides.netsim_url.as_ref(),
        |node, path, problems| {
            config::check(node, path, &netsim::config::SPEC, &network.lists(), problems);
        },
        |node, path| netsim::config::files(node, path, network),
        |setup| {
            let (_, effective, warnings) = netsim::config::read(setup, network)?;
            let trace_ns = netsim::config::replay_ns(&effective, &setup.files, network);
            match longer_than_the_trace(trace_ns, duration_s) {
                Some(problem) => Err(vec![problem]),
                None => Ok((effective, warnings)),
            }
        },
    );
    sides::check_messages(&robotsim.0, &netsim.0, problems);
    let mut recorded = experiment_table.clone();
    let warm_start = WarmStart::read(&mut recorded, base, &netsim.0, problems);
    if !problems.is_empty() {
        return None;
    }
    let mut effective = toml::Table::new();
    effective.insert("experiment".to_owned(), recorded.into());
    effective.insert("site".to_owned(), site_table.clone().into());
    effective.extend(timeline_tables.map(|tables| ("timeline".to_owned(), tables)));
    effective.insert("output".to_owned(), output_table.into());
    let ns = |key: &str| Some((libm::round(number(key)? * NS_PER_S as f64) as u64).max(1));
    Some(Plan {
        path: path.to_owned(),
        text: text.to_owned(),
        tree: tree.clone(),
        name,
        control,
        duration_ns: ns("duration_s")?,
        start: match experiment_table.get("start").and_then(toml::Value::as_str) {
            Some("when-formed") => Some(Start::WhenFormed),
            Some("at-once") => Some(Start::AtOnce),
            _ => None,
        },
        warm_start,
        formation_limit_ns: ns("formation_limit_s")?,
        timeline,
        stop_when_complete: experiment_table.get("stop_when_complete")?.as_bool()?,
        transport: match experiment_table.get("transport")?.as_str()? {
            "stream" => Transport::Stream,
            "unary" => Transport::Unary,
            _ => Transport::Auto,
        },
        step_deadline_s: number("step_deadline_s")?,
        accept_commands: experiment_table.get("accept_commands").and_then(toml::Value::as_bool)
            == Some(true),
        checkpoint_every_s: number("checkpoint_every_s")?,
        restarts: integer("restarts")?.unsigned_abs(),
        reconnect_limit_s: number("reconnect_limit_s")?,
        tls,
        site_toml: site_table.to_string(),
        warnings: [robotsim.1, netsim.1].concat(),
        robotsim: robotsim.0,
        netsim: netsim.0,
        output,
        effective,
        experiment,
    })
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

/// The certificates that a table `[experiment]` names, paths being relative to `base`; `None`: it names none.
pub fn tls_of(experiment: &toml::Table, base: &Path, problems: &mut Vec<Problem>) -> Option<Tls> {
    let table = experiment.get("tls")?.as_table()?;
    let path = |key: &str| table.get(key).and_then(toml::Value::as_str).map(|path| base.join(path));
    let identity = match (path("cert"), path("key")) {
        (Some(cert), Some(key)) => Some((cert, key)),
        (None, None) => None,
        (Some(_), None) => {
            problems.push(Problem::new(
                "experiment.tls.key",
                "is missing: cert and key must be set together",
            ));
            None
        }
        (None, Some(_)) => {
            problems.push(Problem::new(
                "experiment.tls.cert",
                "is missing: cert and key must be set together",
            ));
            None
        }
    };
    Some(Tls { ca: path("ca")?, identity })
}

/// Whether a text can name an experiment: letters, digits, `-`, `_` and `.`, at most 100, not starting with `.`.
#[must_use]
pub fn is_file_name(name: &str) -> bool {
    !name.starts_with('.')
        && name.len() <= 100
        && name.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.'))
}

/// The most similar text that can name an experiment; `experiment` if there is none.
#[must_use]
pub fn as_file_name(name: &str) -> String {
    let replaced: String = name
        .trim_start_matches('.')
        .chars()
        .take(100)
        .map(|c| if c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.') { c } else { '-' })
        .collect();
    if replaced.is_empty() { "experiment".to_owned() } else { replaced }
}
