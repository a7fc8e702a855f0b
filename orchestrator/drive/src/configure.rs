//! Configuring both sides so that each can do what the experiment asks of it.

use crate::peer::{Described, NetworkSide, Peer, RobotSide, Side as _, SideError};
use experiment::{Plan, SideConfig, Start, timeline};
use netsim::sim::Network as BuiltInNetwork;
use proto::config::Problem;
use proto::config::Refusal;
use proto::exchange::{ConfigureRequest, Configured};
use proto::side::{NetSimulator as _, RobotSimulator as _};
use proto::types::MoteCommandKind;
use proto::types::{Coupling, DeliveryColumn, NetRecord};
use proto_messages::v1;
use robotsim::sim::Swarm as BuiltInRobots;
use std::collections::BTreeSet;

/// Which records the network is asked for, beside those that the robots need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// None; the caller may ask for records of its own.
    Nothing,
    /// Those that the summary is computed from: packets and statistics.
    Measures,
    /// Those that `[output]` of the experiment names.
    Record,
}

/// The records that the summary is computed from.
const MEASURED: [NetRecord; 2] = [NetRecord::Packets, NetRecord::Statistics];

/// What a plan asks and a side does not announce.
#[derive(Debug)]
pub enum Unfit {
    /// An entry of the file.
    Plan(Box<Refusal>),
    /// What the experiment as a whole needs.
    Side(SideError),
}

/// What both sides are asked.
#[derive(Clone, Debug, PartialEq)]
pub struct ConfigureRequests {
    /// The robots.
    pub robots: ConfigureRequest,
    /// The network. Columns and records that it does not announce are not asked of it; columns that the robots want are.
    pub network: ConfigureRequest,
}

impl ConfigureRequests {
    /// What the plan says, of sides that say this of themselves.
    #[must_use]
    pub fn from_plan(plan: &Plan, robots: &Described, network: &Described, wanted: Wanted) -> Self {
        let request = |side: &SideConfig, config_toml: String| ConfigureRequest {
            experiment: plan.experiment.clone(),
            site_toml: plan.site_toml.clone(),
            config_toml,
            files: side.files.clone(),
            columns: Vec::new(),
            records: Vec::new(),
            full_digest: false,
        };
        let (columns, records): (&[DeliveryColumn], _) = match wanted {
            Wanted::Nothing => (&[], Vec::new()),
            // Of the columns of links the delay alone is in the summary.
            Wanted::Measures if plan.output.columns().is_empty() => (&[], MEASURED.to_vec()),
            Wanted::Measures => (&[DeliveryColumn::ReceivedNs], MEASURED.to_vec()),
            Wanted::Record => (plan.output.columns(), plan.output.records()),
        };
        let robots_toml = sent(&plan.robotsim, robots.name == BuiltInRobots::NAME);
        let network_toml = sent(&plan.netsim, network.name == BuiltInNetwork::NAME);
        Self {
            robots: ConfigureRequest {
                full_digest: robots.full_digest,
                ..request(&plan.robotsim, robots_toml)
            },
            network: ConfigureRequest {
                columns: columns.to_vec(),
                records,
                full_digest: network.full_digest,
                ..request(&plan.netsim, network_toml)
            },
        }
    }
}

/// The section as the side is sent it: with defaults filled in if the side is our own.
fn sent(side: &SideConfig, is_built_in: bool) -> String {
    side.effective_toml.as_ref().filter(|_| is_built_in).unwrap_or(&side.toml).clone()
}

/// Configures both sides, the robots first: the network is asked for what they want to know of each delivery.
///
/// # Errors
///
/// A side fails or refuses, or does not announce or keep what it is asked.
pub async fn configure<R: Peer<RobotSide>, N: Peer<NetworkSide>>(
    asked: ConfigureRequests,
    robots: &mut R,
    network: &mut N,
) -> Result<Configured, SideError> {
    let ConfigureRequests { robots: robots_request, network: mut network_request } = asked;
    let robots_start = robots.configure(&robots_request).await?;
    let described = network.described();
    if robots_start.messages && !described.mote_commands.contains(&MoteCommandKind::Send) {
        let what = format!(
            "{} does not support MOTE_COMMAND_KIND_SEND, which the robots' unicast messages require",
            described.name
        );
        return Err(cannot(NetworkSide::SIDE, what));
    }
    // Each once, ascending.
    let wanted: BTreeSet<DeliveryColumn> =
        network_request.columns.iter().chain(&robots_start.columns).copied().collect();
    network_request.columns =
        wanted.into_iter().filter(|column| described.columns.contains(column)).collect();
    network_request.records.retain(|record| described.records.contains(record));
    let network_start = network.configure(&network_request).await?;
    let mut kept = network_start.records.iter();
    if let Some(&record) = kept.find(|record| !network_request.records.contains(record)) {
        let number: i32 = v1::NetRecord::from(record).into();
        let reason = format!("records: {number} was not requested");
        let doing = "Configure".to_owned();
        return Err(SideError::Garbage { side: NetworkSide::SIDE, doing, reason });
    }
    Ok(Configured { robots_request, robots_start, network_request, network_start })
}

/// Makes sure that both sides announce what the plan asks of them.
///
/// # Errors
///
/// The first thing that one does not announce, or all entries of the timeline that the network does not obey.
pub fn announced(
    plan: &Plan,
    robots: &Described,
    network: &Described,
    wanted: Wanted,
) -> Result<(), Unfit> {
    let unfit = |side, what| Err(Unfit::Side(cannot(side, what)));
    let coupling = plan.experiment.coupling;
    if coupling != Coupling::Sequential {
        for (side, described) in [(RobotSide::SIDE, robots), (NetworkSide::SIDE, network)] {
            if !described.parallel {
                let what = format!(
                    "{} does not support parallel coupling; set experiment.coupling = \"sequential\"",
                    described.name
                );
                return unfit(side, what);
            }
        }
    }
    if coupling == Coupling::Event && !network.stop_at_first_delivery {
        let what = format!(
            "{} does not support stop_at_first_delivery, which experiment.control_period = \"packet\" requires",
            network.name
        );
        return unfit(NetworkSide::SIDE, what);
    }
    for (side, max_agents) in
        [(RobotSide::SIDE, robots.max_agents), (NetworkSide::SIDE, network.max_agents)]
    {
        if max_agents != 0 && max_agents < plan.experiment.agent_count as u32 {
            let what = format!(
                "supports at most {max_agents} agents, got {}",
                plan.experiment.agent_count
            );
            return unfit(side, what);
        }
    }
    let captures = network.records.contains(&NetRecord::Capture);
    if wanted == Wanted::Record && plan.output.pcap && !captures {
        let what = format!(
            "{} does not support capturing its radio traffic, which output.pcap = true requires",
            network.name
        );
        return unfit(NetworkSide::SIDE, what);
    }
    let mut problems: Vec<Problem> = plan
        .timeline
        .entries()
        .iter()
        .filter(|entry| !network.mote_commands.contains(&entry.order.kind()))
        .map(|entry| {
            let name = &network.name;
            Problem::new(
                format!("timeline[{}].order", entry.index),
                format!("{name} does not support this event: {}", timeline::describe(entry)),
            )
        })
        .collect();
    // An entry with many motes or channels is many orders, and one problem.
    problems.dedup_by(|a, b| a.path == b.path);
    if problems.is_empty() {
        Ok(())
    } else {
        let refusal = Refusal::new(&plan.path, &plan.text, &plan.tree, problems);
        Err(Unfit::Plan(Box::new(refusal)))
    }
}

/// When the robots start, now that it is known whether the network has anything to form.
///
/// # Errors
///
/// The robots are to wait for what never comes, or cannot wait.
pub fn starts(
    plan: &Plan,
    robots: &Described,
    network: &Described,
    forms: bool,
) -> Result<Start, SideError> {
    let start = match plan.start {
        Some(Start::WhenFormed) if !forms => {
            let what = format!(
                "{} has no network formation for experiment.start = \"when-formed\" to wait for; set start = \"at-once\"",
                network.name
            );
            return Err(cannot(NetworkSide::SIDE, what));
        }
        None if forms => Start::WhenFormed,
        start => start.unwrap_or(Start::AtOnce),
    };
    if start == Start::WhenFormed && !robots.hold {
        let what = format!(
            "{} does not announce hold in Describe, so its robots cannot wait until the network has formed. Announce hold, \
             and let robots stand still in steps with hold (docs/own-simulator.md), or set experiment.start = \"at-once\" \
             to let them start during formation",
            robots.name
        );
        return Err(cannot(RobotSide::SIDE, what));
    }
    Ok(start)
}

fn cannot(side: &'static str, what: String) -> SideError {
    SideError::Cannot { side, what }
}
