//! A network and agents to call it with.

use netsim::sim::Network;
use proto::config::Problem;
use proto::side::{NetInput, NetOutput, NetSimulator, NetStart, Setup};
use proto::site::Site;
use proto::types::{
    AgentStates, Coupling, Deliveries, DeliveryColumn, Experiment, MoteCommand, Payloads,
};
use std::collections::BTreeMap;

/// The control period of most tests (ns): ten slots.
pub(crate) const STEP_NS: u64 = 100_000_000;

/// A set-up with the given `[netsim]` text.
pub(crate) fn setup(n: usize, config: &str) -> Setup {
    Setup {
        experiment: Experiment {
            seed: 1,
            agent_count: n,
            step_ns: STEP_NS,
            coupling: Coupling::Sequential,
        },
        site: Site::default(),
        config: proto::config::parse(config).expect("valid TOML"),
        path: "netsim".to_owned(),
        files: BTreeMap::new(),
        columns: Vec::new(),
        records: Vec::new(),
    }
}

/// A site of the given `[site]` text.
pub(crate) fn site(text: &str) -> Site {
    let mut problems = Vec::new();
    let (site, _) =
        proto::site::read(&proto::config::parse(text).expect("valid TOML"), "site", &mut problems);
    assert_eq!(problems, []);
    site
}

/// A configured network.
pub(crate) fn started(setup: &Setup) -> (Network, NetStart) {
    let mut network = Network::default();
    let start = network.configure(setup).unwrap_or_else(|problems| panic!("{}", text(&problems)));
    (network, start)
}

/// A configured network for `n` agents.
pub(crate) fn network(n: usize, config: &str) -> Network {
    started(&setup(n, config)).0
}

/// Problems, a line each.
pub(crate) fn text(problems: &[Problem]) -> String {
    problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

/// Agents at these places in the plane.
pub(crate) fn standing_at(places: &[(f64, f64)]) -> AgentStates {
    let mut states = AgentStates::at_origin(places.len());
    for (i, &(x_m, y_m)) in places.iter().enumerate() {
        states.x_m[i] = x_m;
        states.y_m[i] = y_m;
    }
    states
}

/// Agent i says the number i.
pub(crate) fn payloads(n: usize) -> Payloads {
    let data: Vec<u8> = (0..n as u32).flat_map(u32::to_le_bytes).collect();
    Payloads::new(vec![4; n], data.into()).expect("four bytes each")
}

/// A step of which only the interval is unusual.
pub(crate) fn interval(
    network: &mut Network,
    states: &AgentStates,
    from_ns: u64,
    until_ns: u64,
) -> NetOutput {
    step_with(network, states, from_ns, until_ns, &[], false)
}

/// Any step.
pub(crate) fn step_with(
    network: &mut Network,
    states: &AgentStates,
    from_ns: u64,
    until_ns: u64,
    commands: &[MoteCommand],
    stop_at_first_delivery: bool,
) -> NetOutput {
    network.step(&NetInput {
        step: 1,
        from_ns,
        until_ns,
        states,
        payloads: &payloads(states.len()),
        moved_obstacles: &[],
        commands,
        stop_at_first_delivery,
        records: &[],
    })
}

/// Control period k, from 0.
pub(crate) fn period(network: &mut Network, states: &AgentStates, k: u64) -> NetOutput {
    interval(network, states, k * STEP_NS, (k + 1) * STEP_NS)
}

/// Who heard whom: (receiver, sender), sorted.
pub(crate) fn pairs(deliveries: &Deliveries) -> Vec<(u32, u32)> {
    let n = deliveries.transmissions.sender.iter().max().map_or(0, |&last| last + 1);
    pairs_of(deliveries, n as usize)
}

/// Who among `n` agents heard whom: (receiver, sender), sorted.
pub(crate) fn pairs_of(deliveries: &Deliveries, n: usize) -> Vec<(u32, u32)> {
    let mut pairs: Vec<(u32, u32)> = (0..n)
        .flat_map(|receiver| {
            deliveries
                .heard_by(receiver)
                .map(move |frame| (receiver as u32, deliveries.transmissions.sender[frame]))
        })
        .collect();
    pairs.sort_unstable();
    pairs
}

/// How often agent `receiver` heard agent `sender` in that many periods.
pub(crate) fn count_heard(
    network: &mut Network,
    states: &AgentStates,
    sender: u32,
    receiver: u32,
    n_periods: u64,
) -> u64 {
    (0..n_periods)
        .filter(|&k| {
            let deliveries = period(network, states, k).deliveries;
            pairs_of(&deliveries, states.len()).contains(&(receiver, sender))
        })
        .count() as u64
}

/// What agent 1 reads of agent 0 (dBm) over `distance_m`, if it hears it.
pub(crate) fn reading_dbm(config: &str, distance_m: f64) -> Option<f32> {
    let mut setup = setup(2, config);
    setup.columns = vec![DeliveryColumn::RssiDbm];
    let (mut network, _) = started(&setup);
    let deliveries =
        period(&mut network, &standing_at(&[(0.0, 0.0), (distance_m, 0.0)]), 0).deliveries;
    // Receiver 0 comes first.
    let before = deliveries.heard_by(0).count();
    deliveries.heard_by(1).next().map(|_| deliveries.rssi_dbm[before])
}
