//! Starting, connecting and configuring both sides of a run.

use super::warm_start::{FormedFile, Placed};
use super::{RunError, Work};
use drive::coupling::{Coupled, Position};
use drive::peer::{
    Launch, LineSink, NetworkSide, Orders, Peer, Reach, Remote, RobotSide, Service, Side as _,
    SideError,
};
use drive::{self, ConfigureRequests, Past, Unfit, Wanted};
use experiment::{ExperimentKeys, Plan, SideConfig, Start};
use proto::config::{Node, Problem, Refusal, Section as _, Value};
use proto::exchange::Configured;
use proto::types::NetRecord;
use record::run_log::RunLog;
use record::{RunHeader, StepRecord, is_column_of_motes};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

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
    /// Where what the sides log goes, beside standard error.
    pub run_log: RunLog,
}

/// Two simulators in other processes, in step.
pub type Processes = Coupled<Remote<RobotSide>, Remote<NetworkSide>>;

/// Both sides, ready for the first step.
pub struct Started {
    /// The sides in step.
    pub coupled: Processes,
    /// What was said while configuring.
    pub exchange: Configured,
    /// What the record begins with.
    pub header: RunHeader,
    /// The robots stand still until the network has formed.
    pub waits: bool,
    /// What the network keeps for the record.
    pub records: Vec<NetRecord>,
    /// The steps that a formed network took before: they are recorded first.
    pub formed_steps: Vec<StepRecord>,
    /// What a driver has to know of those.
    pub past: Past,
    /// Name, version, URL and transport of the robots.
    pub robots: SideIdentity,
    /// Name, version, URL and transport of the network.
    pub network: SideIdentity,
    /// What should be checked before the results are trusted.
    pub warnings: Vec<String>,
    /// Where and how other programs may give orders, by side.
    pub orders: Vec<(&'static str, Orders)>,
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
    /// It serves snapshots.
    pub snapshots: bool,
    /// Its digests cover the whole exchange.
    pub is_compared_whole: bool,
}

pub(super) fn identity<S: Service>(peer: &Remote<S>) -> SideIdentity {
    SideIdentity {
        name: peer.described().name.clone(),
        version: peer.described().version.clone(),
        url: peer.url().to_owned(),
        is_child: peer.is_child(),
        streams: peer.streams(),
        snapshots: peer.described().snapshots,
        is_compared_whole: peer.start_digest().is_some(),
    }
}

/// Starts, connects and configures both sides, or puts them where a network has formed.
///
/// # Errors
///
/// A side cannot be started or reached, or refuses its configuration.
pub fn start<'a>(
    plan: &'a Plan,
    options: &'a StartOptions,
    wanted: Wanted,
    formed: Option<&'a FormedFile>,
) -> Work<'a, Result<Started, RunError>> {
    Box::pin(async move {
        let (robots, network) = connect(plan, options).await?;
        ready(plan, robots, network, wanted, formed).await
    })
}

/// Starts both sides where the plan does not say that they run already, and connects to them.
pub(super) async fn connect(
    plan: &Plan,
    options: &StartOptions,
) -> Result<(Remote<RobotSide>, Remote<NetworkSide>), RunError> {
    let run_log = options.run_log.clone();
    let lines = LineSink::new(move |side, line| run_log.add(side, line));
    let reach = |side: &SideConfig| Reach {
        url: side.url.clone(),
        tls: plan.tls.clone(),
        transport: plan.transport,
        step_deadline: Duration::from_secs_f64(plan.step_deadline_s),
        is_busy: options.is_busy,
        launch: Launch {
            executable: options.executable.clone(),
            command: side.command.clone(),
            threads: options.threads,
            log: options.log.clone(),
            log_json: options.log_json,
            accept_commands: plan.accept_commands,
            lines: Some(lines.clone()),
        },
    };
    let (robots_reach, network_reach) = (reach(&plan.robotsim), reach(&plan.netsim));
    let (robots, network) = tokio::join!(
        Remote::<RobotSide>::connect(&robots_reach),
        Remote::<NetworkSide>::connect(&network_reach)
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

/// Configures both sides, whatever they ran before, or puts them where a network has formed. If that fails they are stopped.
pub(super) async fn ready(
    plan: &Plan,
    robots: Remote<RobotSide>,
    network: Remote<NetworkSide>,
    wanted: Wanted,
    formed: Option<&FormedFile>,
) -> Result<Started, RunError> {
    ready_with(plan, robots, network, wanted, None, formed).await
}

/// As [`ready`], asking both sides what is given, if it is, instead of what the plan says.
pub(super) async fn ready_with(
    plan: &Plan,
    mut robots: Remote<RobotSide>,
    mut network: Remote<NetworkSide>,
    wanted: Wanted,
    asked: Option<ConfigureRequests>,
    formed: Option<&FormedFile>,
) -> Result<Started, RunError> {
    let placed = match formed {
        Some(formed) => place(plan, &mut robots, &mut network, wanted, formed).await,
        None => configure(plan, &mut robots, &mut network, wanted, asked).await.map(
            |(exchange, start)| {
                let (steps, past) = (Vec::new(), Past::default());
                (Placed { exchange, steps, past }, start)
            },
        ),
    };
    match placed {
        Ok((Placed { exchange, steps, past }, start)) => {
            let identities = (identity(&robots), identity(&network));
            let mut warnings = warnings(plan, &exchange, wanted);
            warnings.extend(not_compared(RobotSide::SIDE, &identities.0));
            warnings.extend(not_compared(NetworkSide::SIDE, &identities.1));
            let orders = orders(&robots, &network);
            let header = header(plan, &exchange, start);
            let records = header.records.clone();
            let coupled = Coupled::new(
                robots,
                network,
                plan.experiment.clone(),
                &exchange.robots_start,
                &exchange.network_start,
            );
            let coupled = match steps.last() {
                Some(StepRecord { step, time_ns, robots, network, .. }) => {
                    coupled.after(&Position {
                        step: *step,
                        time_ns: *time_ns,
                        robots: Arc::clone(robots),
                        network: Arc::clone(network),
                    })
                }
                None => coupled,
            };
            Ok(Started {
                coupled,
                exchange,
                header,
                waits: start == Start::WhenFormed,
                records,
                formed_steps: steps,
                past,
                robots: identities.0,
                network: identities.1,
                warnings,
                orders,
            })
        }
        Err(error) => {
            tokio::join!(robots.stop(), network.stop());
            Err(error)
        }
    }
}

/// Where and how other programs may give orders, by side.
pub(super) fn orders(
    robots: &Remote<RobotSide>,
    network: &Remote<NetworkSide>,
) -> Vec<(&'static str, Orders)> {
    let orders = [(RobotSide::SIDE, robots.orders()), (NetworkSide::SIDE, network.orders())];
    orders.into_iter().filter_map(|(side, orders)| Some((side, orders?.clone()))).collect()
}

/// Configures both sides with the plan.
async fn configure(
    plan: &Plan,
    robots: &mut Remote<RobotSide>,
    network: &mut Remote<NetworkSide>,
    wanted: Wanted,
    asked: Option<ConfigureRequests>,
) -> Result<(Configured, Start), RunError> {
    announced(plan, robots, network, wanted)?;
    let asked = asked.unwrap_or_else(|| {
        ConfigureRequests::from_plan(plan, robots.described(), network.described(), wanted)
    });
    let exchange =
        drive::configure(asked, robots, network).await.map_err(|error| refused(plan, error))?;
    let forms = exchange.network_start.formation.is_some();
    let start =
        drive::starts(plan, robots.described(), network.described(), forms).map_err(side)?;
    let statistics = exchange.network_start.statistics.iter();
    let mut columns = statistics.flat_map(|statistics| &statistics.columns);
    if let Some(column) = columns.find(|column| is_column_of_motes(&column.name)) {
        let reason = format!(
            "statistics: the name {} is reserved for a column of motes.parquet",
            column.name
        );
        let doing = "Configure".to_owned();
        return Err(side(SideError::Garbage { side: NetworkSide::SIDE, doing, reason }));
    }
    Ok((exchange, start))
}

/// Makes sure that both sides announce what the plan asks of them.
fn announced(
    plan: &Plan,
    robots: &Remote<RobotSide>,
    network: &Remote<NetworkSide>,
    wanted: Wanted,
) -> Result<(), RunError> {
    drive::announced(plan, robots.described(), network.described(), wanted).map_err(|unfit| {
        match unfit {
            Unfit::Plan(refusal) => RunError::Refused(*refusal),
            Unfit::Side(error) => side(error),
        }
    })
}

/// Puts both sides where a network has formed.
async fn place(
    plan: &Plan,
    robots: &mut Remote<RobotSide>,
    network: &mut Remote<NetworkSide>,
    wanted: Wanted,
    formed: &FormedFile,
) -> Result<(Placed, Start), RunError> {
    announced(plan, robots, network, wanted)?;
    let start = drive::starts(plan, robots.described(), network.described(), true).map_err(side)?;
    Ok((formed.place(plan, robots, network, wanted).await?, start))
}

/// What should be checked before the results are trusted: what the plan says, and what the network adds.
fn warnings(plan: &Plan, exchange: &Configured, wanted: Wanted) -> Vec<String> {
    let mut warnings = plan.warnings.clone();
    for warning in &exchange.network_start.warnings {
        // Ours, found while checking, begin with the section's name.
        if !warnings.iter().any(|known| known.ends_with(warning.as_str())) {
            warnings.push(warning.clone());
        }
    }
    let captures = exchange.network_start.records.contains(&NetRecord::Capture);
    if wanted == Wanted::Record && plan.output.pcap && !captures {
        warnings.push(
            "output.pcap: the network as configured has no radio traffic to capture; set netsim.mode = \"6tisch\", or \
             output.pcap = false"
                .to_owned(),
        );
    }
    warnings
}

/// What the digests of a side leave out.
fn not_compared(side: &str, identity: &SideIdentity) -> Option<String> {
    (!identity.is_compared_whole).then(|| {
        format!(
            "{side}: {} does not announce full_digest: only positions and deliveries are compared after each step. A change \
             in transit of velocities, headings, received times, RSSI, hops, motes, orders or records is not detected",
            identity.name
        )
    })
}

/// What a record of the plan begins with.
pub(super) fn header(plan: &Plan, exchange: &Configured, start: Start) -> RunHeader {
    let robotsim = effective(&exchange.robots_start.effective_toml, &plan.robotsim);
    let netsim = effective(&exchange.network_start.effective_toml, &plan.netsim);
    let mut labels = BTreeMap::new();
    if let Some(knowledge) = robotsim.get("knowledge").and_then(toml::Value::as_str) {
        labels.insert("knowledge".to_owned(), knowledge.to_owned());
    }
    let mut config = plan.effective.clone();
    if let Some(experiment) = config.get_mut("experiment").and_then(toml::Value::as_table_mut) {
        experiment.insert("start".to_owned(), start.name().into());
        // In the order in which the file made of it is read back.
        let order: Vec<&str> = ExperimentKeys::SPEC.fields.iter().map(|field| field.key).collect();
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
        records: exchange.network_start.records.clone(),
        statistics: exchange
            .network_start
            .statistics
            .iter()
            .flat_map(|statistics| &statistics.columns)
            .map(|column| (column.name.clone(), column.unit.clone()))
            .collect(),
        // The network's own are recorded with its reply.
        warnings: Vec::new(),
        keeps_checkpoints: 0.0 < plan.checkpoint_every_s,
    }
}

/// A side's configuration in force: as it says, or as it was sent.
fn effective(reply: &str, side: &SideConfig) -> toml::Table {
    let text = if reply.is_empty() { &side.toml } else { reply };
    let mut table = toml::Table::new();
    table.extend(side.written_reach.clone());
    table.extend(toml::from_str::<toml::Table>(text).unwrap_or_default());
    table
}

pub(super) fn side(error: SideError) -> RunError {
    RunError::Side { error, kept: None }
}

/// A configuration that a side refuses is the user's: shown on the lines of the file.
fn refused(plan: &Plan, error: SideError) -> RunError {
    let SideError::Unacceptable { side: section, problems } = error else { return side(error) };
    let placed = |problem: Problem| {
        if problem.path.starts_with("site") { problem } else { problem.within(section) }
    };
    let problems = problems.into_iter().map(placed).collect();
    RunError::Refused(Refusal::new(&plan.path, &plan.text, &plan.tree, problems))
}
