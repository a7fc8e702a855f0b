//! Starting, connecting and configuring both sides.

use super::RunError;
use crate::coupling::Coupled;
use crate::peer::{Launch, Network, Peer, Reach, Robots, Service, SideError};
use experiment::{EXPERIMENT, Plan, SideConfig, Start, timeline};
use proto::config::Refusal;
use proto::config::{Node, Problem, Value};
use proto::types::{Coupling, DeliveryColumn, NetRecord};
use proto_messages::{convert, v1};
use record::{Configured, RunHeader, is_column_of_motes};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::time::Duration;
use tonic::Code;
use tonic_types::StatusExt as _;

/// How the sides are started.
#[derive(Clone, Debug)]
pub struct StartOptions {
    /// The executable that serves either side as a subcommand.
    pub executable: PathBuf,
    /// Threads of each side; `None`: one per core.
    pub threads: Option<u16>,
    /// Log filter.
    pub log: String,
    /// Log as JSON.
    pub log_json: bool,
    /// Other work waits for the processors: answers are waited for asleep.
    pub is_busy: bool,
}

/// What is asked of the network beside what the robots need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// Nothing.
    Nothing,
    /// What the summary is made of.
    Measures,
    /// What `[output]` says.
    Record,
}

/// Both sides, ready for the first step.
pub struct Started {
    /// The sides in step.
    pub coupled: Coupled,
    /// What was said while configuring.
    pub exchange: Configured,
    /// What the record begins with.
    pub header: RunHeader,
    /// The robots stand still until the network has formed.
    pub waits: bool,
    /// What the network keeps for the record.
    pub records: Vec<NetRecord>,
    /// Name, version, URL and transport of the robots.
    pub robots: SideIdentity,
    /// Name, version, URL and transport of the network.
    pub network: SideIdentity,
    /// What should be checked before the results are trusted.
    pub warnings: Vec<String>,
}

/// Who a side is: for provenance.
#[derive(Clone, Debug)]
pub struct SideIdentity {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// Where it runs.
    pub url: String,
    /// It was started here.
    pub is_child: bool,
    /// Steps cross in one stream.
    pub streams: bool,
}

fn identity<S: Service>(peer: &Peer<S>) -> SideIdentity {
    SideIdentity {
        name: peer.described().name.clone(),
        version: peer.described().version.clone(),
        url: peer.url().to_owned(),
        is_child: peer.is_child(),
        streams: peer.streams(),
    }
}

/// Starts, connects and configures both sides.
///
/// # Errors
///
/// A side cannot be started or reached, or refuses its configuration.
pub async fn start(
    plan: &Plan,
    options: &StartOptions,
    wanted: Wanted,
) -> Result<Started, RunError> {
    let (robots, network) = connect(plan, options).await?;
    ready(plan, robots, network, wanted).await
}

/// Starts both sides where the plan does not say that they run already, and connects to them.
pub(super) async fn connect(
    plan: &Plan,
    options: &StartOptions,
) -> Result<(Peer<Robots>, Peer<Network>), RunError> {
    let reach = |url: &Option<String>| Reach {
        url: url.clone(),
        tls: plan.tls.clone(),
        transport: plan.transport,
        step_deadline: Duration::from_secs_f64(plan.step_deadline_s),
        is_busy: options.is_busy,
        launch: Launch {
            executable: options.executable.clone(),
            threads: options.threads,
            log: options.log.clone(),
            log_json: options.log_json,
        },
    };
    let (robots_reach, network_reach) = (reach(&plan.robotsim.url), reach(&plan.netsim.url));
    let (robots, network) = tokio::join!(
        Peer::<Robots>::connect(&robots_reach),
        Peer::<Network>::connect(&network_reach)
    );
    match (robots, network) {
        (Ok(robots), Ok(network)) => Ok((robots, network)),
        (Err(error), Ok(network)) => {
            network.stop().await;
            Err(side(error))
        }
        (Ok(robots), Err(error)) => {
            robots.stop().await;
            Err(side(error))
        }
        (Err(robots), Err(network)) => {
            Err(side(SideError::Both(Box::new(robots), Box::new(network))))
        }
    }
}

/// Configures both sides, whatever they ran before. If that fails they are stopped.
pub(super) async fn ready(
    plan: &Plan,
    mut robots: Peer<Robots>,
    mut network: Peer<Network>,
    wanted: Wanted,
) -> Result<Started, RunError> {
    match configure(plan, &mut robots, &mut network, wanted).await {
        Ok(Agreed { exchange, warnings, start }) => {
            let identities = (identity(&robots), identity(&network));
            let header = header(plan, &exchange, start);
            let records = header.records.clone();
            match Coupled::new(
                robots,
                network,
                plan.experiment.clone(),
                exchange.robot_response.clone(),
                exchange.net_response.clone(),
            ) {
                Ok(coupled) => Ok(Started {
                    coupled,
                    exchange,
                    header,
                    waits: start == Start::WhenFormed,
                    records,
                    robots: identities.0,
                    network: identities.1,
                    warnings,
                }),
                Err(error) => Err(side(error)),
            }
        }
        Err(error) => {
            tokio::join!(robots.stop(), network.stop());
            Err(error)
        }
    }
}

/// What came of configuring both sides.
struct Agreed {
    exchange: Configured,
    warnings: Vec<String>,
    start: Start,
}

/// Makes sure that both sides announce what the plan asks of them.
fn announced(
    plan: &Plan,
    robots: &Peer<Robots>,
    network: &Peer<Network>,
    wanted: Wanted,
) -> Result<(), RunError> {
    let coupling = plan.experiment.coupling;
    if coupling != Coupling::Sequential {
        for (name, side, parallel) in [
            (&robots.described().name, Robots::SIDE, robots.described().parallel),
            (&network.described().name, Network::SIDE, network.described().parallel),
        ] {
            if !parallel {
                return Err(self::side(cannot(
                    side,
                    format!(
                        "{name} does not announce parallel coupling, which the experiment asks for"
                    ),
                )));
            }
        }
    }
    if coupling == Coupling::Event && !network.described().stop_at_first_delivery {
        let what = format!(
            "{} does not announce stop_at_first_delivery, which experiment.control_period = \"packet\" needs",
            network.described().name
        );
        return Err(self::side(cannot(Network::SIDE, what)));
    }
    for (side, max_agents) in [
        (Robots::SIDE, robots.described().max_agents),
        (Network::SIDE, network.described().max_agents),
    ] {
        if max_agents != 0 && max_agents < plan.experiment.agent_count as u32 {
            let what =
                format!("takes at most {max_agents} agents, got {}", plan.experiment.agent_count);
            return Err(self::side(cannot(side, what)));
        }
    }
    let capture: i32 = v1::NetRecord::from(NetRecord::Capture).into();
    if wanted == Wanted::Record
        && plan.output.pcap
        && !network.described().records.contains(&capture)
    {
        let what = format!(
            "{} does not announce a capture of its radio traffic, which output.pcap = true asks for",
            network.described().name
        );
        return Err(self::side(cannot(Network::SIDE, what)));
    }
    let mut problems: Vec<Problem> = plan
        .timeline
        .entries()
        .iter()
        .filter(|entry| {
            let kind = v1::MoteCommandKind::from(entry.order.kind()).into();
            !network.described().mote_commands.contains(&kind)
        })
        .map(|entry| {
            let name = &network.described().name;
            Problem::new(
                format!("timeline[{}].order", entry.index),
                format!("is nothing that {name} obeys: {}", timeline::describe(entry)),
            )
        })
        .collect();
    // An entry with many motes or channels is many orders, and one problem.
    problems.dedup_by(|a, b| a.path == b.path);
    if !problems.is_empty() {
        return Err(RunError::Refused(Refusal::new(&plan.path, &plan.text, &plan.tree, problems)));
    }
    Ok(())
}

/// Makes sure that the network announces what carries the robots' messages, if they send any.
fn carries(
    robots: &v1::RobotSimServiceConfigureResponse,
    network: &Peer<Network>,
) -> Result<(), RunError> {
    let send: i32 = v1::MoteCommandKind::Send.into();
    if robots.messages && !network.described().mote_commands.contains(&send) {
        let what = format!(
            "{} does not announce MOTE_COMMAND_KIND_SEND, which the robots' messages to single ones of them need",
            network.described().name
        );
        return Err(side(cannot(Network::SIDE, what)));
    }
    Ok(())
}

/// When the robots start, now that it is known whether the network has anything to form.
fn starts(
    plan: &Plan,
    robots: &Peer<Robots>,
    network: &Peer<Network>,
    forms: bool,
) -> Result<Start, RunError> {
    let start = match plan.start {
        Some(Start::WhenFormed) if !forms => {
            let what = format!(
                "{} has nothing to form, which experiment.start = \"when-formed\" waits for; start = \"at-once\" does not",
                network.described().name
            );
            return Err(side(cannot(Network::SIDE, what)));
        }
        None if forms => Start::WhenFormed,
        start => start.unwrap_or(Start::AtOnce),
    };
    if start == Start::WhenFormed && !robots.described().hold {
        let what = format!(
            "{} does not announce hold, so its robots cannot stand still until the network has formed; with \
             experiment.start = \"at-once\" they start while it forms",
            robots.described().name
        );
        return Err(side(cannot(Robots::SIDE, what)));
    }
    Ok(start)
}

/// The numbers of the columns of deliveries that the record and the robots want, each once, ascending.
fn asked_columns(recorded: &[DeliveryColumn], by_robots: &[i32]) -> impl Iterator<Item = i32> {
    let recorded = recorded.iter().map(|&column| v1::DeliveryColumn::from(column).into());
    let all: BTreeSet<i32> = recorded.chain(by_robots.iter().copied()).collect();
    all.into_iter()
}

/// Configures both sides with the plan.
async fn configure(
    plan: &Plan,
    robots: &mut Peer<Robots>,
    network: &mut Peer<Network>,
    wanted: Wanted,
) -> Result<Agreed, RunError> {
    announced(plan, robots, network, wanted)?;
    let coupling = plan.experiment.coupling;
    let (seed, agent_count, step_ns) =
        (plan.experiment.seed, plan.experiment.agent_count as u32, plan.experiment.step_ns);
    let coupling = v1::Coupling::from(coupling).into();
    let files = |side: &SideConfig| {
        side.files
            .iter()
            .map(|(path, content)| v1::File { path: path.clone(), content: content.clone() })
            .collect::<Vec<_>>()
    };
    let robots_request = v1::RobotSimServiceConfigureRequest {
        seed,
        agent_count,
        step_ns,
        coupling,
        site_toml: plan.site_toml.clone(),
        config_toml: sent(robots, &plan.robotsim),
        files: files(&plan.robotsim),
    };
    let (columns, wanted_records): (&[DeliveryColumn], _) = match wanted {
        Wanted::Nothing => (&[], Vec::new()),
        // Of the columns of links the delay alone is in the summary.
        Wanted::Measures if plan.output.columns().is_empty() => (&[], MEASURED.to_vec()),
        Wanted::Measures => (&[DeliveryColumn::ReceivedNs], MEASURED.to_vec()),
        Wanted::Record => (plan.output.columns(), plan.output.records()),
    };
    let robots_response = robots
        .configure(robots_request.clone())
        .await
        .map_err(|error| refused(plan, Robots::SIDE, error))?;
    carries(&robots_response, network)?;
    let network_request = v1::NetSimServiceConfigureRequest {
        seed,
        agent_count,
        step_ns,
        coupling,
        site_toml: plan.site_toml.clone(),
        config_toml: sent(network, &plan.netsim),
        columns: asked_columns(columns, &robots_response.columns)
            .filter(|column| network.described().columns.contains(column))
            .collect(),
        files: files(&plan.netsim),
        records: wanted_records
            .into_iter()
            .map(|record| v1::NetRecord::from(record).into())
            .filter(|record| network.described().records.contains(record))
            .collect(),
    };
    let network_response = network
        .configure(network_request.clone())
        .await
        .map_err(|error| refused(plan, Network::SIDE, error))?;
    let mut warnings = plan.warnings.clone();
    for warning in &network_response.warnings {
        // Ours, found while checking, begin with the section's name.
        if !warnings.iter().any(|known| known.ends_with(warning.as_str())) {
            warnings.push(warning.clone());
        }
    }
    let start = starts(plan, robots, network, network_response.formation.is_some())?;
    let kept = network_response.records.iter();
    if let Some(record) = kept.copied().find(|record| !network_request.records.contains(record)) {
        let reason = format!("records: {record} was not asked for");
        let doing = "Configure".to_owned();
        return Err(side(SideError::Garbage { side: Network::SIDE, doing, reason }));
    }
    let columns = network_response.statistics.iter().flat_map(|statistics| &statistics.columns);
    if let Some(column) = columns.into_iter().find(|column| is_column_of_motes(&column.name)) {
        let reason = format!("statistics: motes.parquet has a column {} of its own", column.name);
        let doing = "Configure".to_owned();
        return Err(side(SideError::Garbage { side: Network::SIDE, doing, reason }));
    }
    let exchange = Configured {
        robot_request: robots_request,
        robot_response: robots_response,
        net_request: network_request,
        net_response: network_response,
    };
    let kept = records(&exchange);
    if wanted == Wanted::Record && plan.output.pcap && !kept.contains(&NetRecord::Capture) {
        warnings.push(
            "output.pcap: the network, as it is configured, has no radio traffic to capture"
                .to_owned(),
        );
    }
    Ok(Agreed { exchange, warnings, start })
}

/// What the network keeps for the record.
fn records(exchange: &Configured) -> Vec<NetRecord> {
    // Each of them was asked for, hence known.
    convert::records(&exchange.net_response.records).unwrap_or_default()
}

/// The section as the side is sent it: with defaults filled in if the side is our own.
fn sent<S: Service>(peer: &Peer<S>, side: &SideConfig) -> String {
    match &side.effective_toml {
        Some(effective) if peer.described().name == S::BUILT_IN => effective.clone(),
        _ => side.toml.clone(),
    }
}

fn header(plan: &Plan, exchange: &Configured, start: Start) -> RunHeader {
    let robotsim = effective(&exchange.robot_response.effective_config_toml, &plan.robotsim);
    let netsim = effective(&exchange.net_response.effective_config_toml, &plan.netsim);
    let mut labels = BTreeMap::new();
    if let Some(knowledge) = robotsim.get("knowledge").and_then(toml::Value::as_str) {
        labels.insert("knowledge".to_owned(), knowledge.to_owned());
    }
    let mut config = plan.effective.clone();
    if let Some(experiment) = config.get_mut("experiment").and_then(toml::Value::as_table_mut) {
        experiment.insert("start".to_owned(), start.name().into());
        // In the order in which the file made of it is read back.
        let order: Vec<&str> = EXPERIMENT.fields.iter().map(|field| field.key).collect();
        let mut entries: Vec<_> = std::mem::take(experiment).into_iter().collect();
        entries.sort_by_key(|(key, _)| order.iter().position(|known| known == key));
        experiment.extend(entries);
    }
    let rest: Vec<_> =
        ["timeline", "output"].map(|key| config.remove_entry(key)).into_iter().flatten().collect();
    config.insert("robotsim".to_owned(), robotsim.into());
    config.insert("netsim".to_owned(), netsim.into());
    config.extend(rest);
    let mut tree = Node { value: Value::from(&toml::Value::Table(config)), span: None };
    for (key, file) in plan.robotsim.places.iter().chain(&plan.netsim.places) {
        // The key exists: the file was found through it.
        let _ = tree.set(key, Value::Text(file.clone()));
    }
    let config = tree.to_toml().as_table().map(toml::Table::to_string).unwrap_or_default();
    RunHeader {
        name: plan.name.clone(),
        seed: plan.experiment.seed,
        agent_count: plan.experiment.agent_count as u32,
        step_ns: plan.experiment.step_ns,
        coupling: plan.experiment.coupling,
        config_toml: config,
        labels,
        output: plan.output,
        start,
        records: records(exchange),
        statistics: exchange
            .net_response
            .statistics
            .iter()
            .flat_map(|statistics| &statistics.columns)
            .map(|column| (column.name.clone(), column.unit.clone()))
            .collect(),
        // The network's own are recorded with its reply.
        warnings: Vec::new(),
    }
}

/// A side's configuration in force: as it says, or as it was sent.
fn effective(reply: &str, side: &SideConfig) -> toml::Table {
    let text = if reply.is_empty() { &side.toml } else { reply };
    let mut table = toml::Table::new();
    table.extend(side.written_url.clone().map(|url| ("url".to_owned(), url.into())));
    table.extend(toml::from_str::<toml::Table>(text).unwrap_or_default());
    table
}

/// The records that the summary is made of.
const MEASURED: [NetRecord; 2] = [NetRecord::Packets, NetRecord::Statistics];

fn cannot(side: &'static str, what: String) -> SideError {
    SideError::Cannot { side, what }
}

fn side(error: SideError) -> RunError {
    RunError::Side { error, kept: None }
}

/// A configuration that a side refuses is the user's: shown on the lines of the file.
fn refused(plan: &Plan, section: &str, error: SideError) -> RunError {
    let SideError::Refused { status, .. } = &error else { return side(error) };
    if status.code() != Code::InvalidArgument {
        return side(error);
    }
    let violations = status
        .get_details_bad_request()
        .map(|bad_request| bad_request.field_violations)
        .unwrap_or_default();
    let problems: Vec<Problem> = if violations.is_empty() {
        vec![Problem::new(section, format!("is refused: {}", status.message()))]
    } else {
        violations
            .into_iter()
            .map(|violation| {
                let path = if violation.field.starts_with("site") {
                    violation.field
                } else {
                    proto::config::join(section, &violation.field)
                };
                Problem::new(path, violation.description)
            })
            .collect()
    };
    RunError::Refused(Refusal::new(&plan.path, &plan.text, &plan.tree, problems))
}
