//! The promises of `proto/cosim/v1`, kept by the real programs.

use futures::StreamExt as _;
use proto::types::{AgentStates, Payloads};
use proto_host::services::net_sim_service_client::NetSimServiceClient;
use proto_host::services::robot_sim_service_client::RobotSimServiceClient;
use proto_messages::v1;
use proto_messages::v1::robot_sim_service_session_request::Request as SessionCall;
use proto_messages::v1::robot_sim_service_session_response::Response as SessionReply;
use tests::Server;
use tonic::transport::Channel;
use tonic::{Code, Status};
use tonic_types::StatusExt as _;

type Robots = RobotSimServiceClient<Channel>;
type Network = NetSimServiceClient<Channel>;

const AGENTS: u32 = 6;
const STEP_NS: u64 = 60_000_000;

async fn robots() -> (Server, Robots) {
    let server = Server::start("robotsim", &[]).unwrap();
    let client = Robots::connect(server.url.clone()).await.unwrap();
    (server, client)
}

async fn network() -> (Server, Network) {
    let server = Server::start("netsim", &[]).unwrap();
    let client = Network::connect(server.url.clone()).await.unwrap();
    (server, client)
}

fn robots_setup(seed: u64) -> v1::RobotSimServiceConfigureRequest {
    v1::RobotSimServiceConfigureRequest {
        seed,
        agent_count: AGENTS,
        step_ns: STEP_NS,
        config_toml: "[controller]\nkind = \"flocking\"\nflock_radius_m = 10.0\n[scenario]\nkind = \"line\"\n".to_owned(),
        ..Default::default()
    }
}

fn network_setup(seed: u64) -> v1::NetSimServiceConfigureRequest {
    v1::NetSimServiceConfigureRequest {
        seed,
        agent_count: AGENTS,
        step_ns: STEP_NS,
        config_toml: "[phy]\npropagation = \"experimental-randomness\"\n".to_owned(),
        columns: vec![v1::DeliveryColumn::RssiDbm.into()],
        ..Default::default()
    }
}

/// Robots in a row 15 m apart, each saying its number.
fn network_step(step: u64) -> v1::NetSimServiceStepRequest {
    let mut states = AgentStates::at_origin(AGENTS as usize);
    states.x_m = (0..AGENTS).map(|agent| 15.0 * f64::from(agent)).collect();
    let data: Vec<u8> = (0..AGENTS as u8).collect();
    let payloads = Payloads::new(vec![1; AGENTS as usize], data.into()).unwrap();
    v1::NetSimServiceStepRequest {
        step,
        until_ns: step * STEP_NS,
        states: Some(states.into()),
        payloads: Some(payloads.into()),
        ..Default::default()
    }
}

fn robots_step(step: u64) -> v1::RobotSimServiceStepRequest {
    v1::RobotSimServiceStepRequest { step, until_ns: step * STEP_NS, ..Default::default() }
}

fn assert_refused<T: std::fmt::Debug>(result: Result<T, Status>, code: Code, text: &str) {
    let status = result.expect_err(text);
    assert_eq!(status.code(), code, "{status}");
    assert!(status.message().contains(text), "{text:?} is not in {:?}", status.message());
}

#[tokio::test]
async fn nothing_goes_before_configure() {
    let (_robotsim, mut robots) = robots().await;
    let (_netsim, mut network) = network().await;
    assert_refused(robots.step(robots_step(1)).await, Code::FailedPrecondition, "not configured");
    assert_refused(network.step(network_step(1)).await, Code::FailedPrecondition, "not configured");
    let snapshot = robots.snapshot(v1::RobotSimServiceSnapshotRequest {}).await;
    assert_refused(snapshot, Code::FailedPrecondition, "not configured");
    let snapshot = network.snapshot(v1::NetSimServiceSnapshotRequest {}).await;
    assert_refused(snapshot, Code::FailedPrecondition, "not configured");
    let barrier = v1::RobotSimServiceBarrierRequest { step: 1, time_ns: STEP_NS };
    assert_refused(robots.barrier(barrier).await, Code::FailedPrecondition, "not configured");
}

#[tokio::test]
async fn the_latest_step_may_be_repeated_and_no_other() {
    let (_netsim, mut network) = network().await;
    network.configure(network_setup(1)).await.unwrap();
    let first = network.step(network_step(1)).await.unwrap().into_inner();
    let second = network.step(network_step(2)).await.unwrap().into_inner();
    assert_ne!(first.deliveries, second.deliveries, "fading is drawn anew in each period");
    assert_eq!(network.step(network_step(2)).await.unwrap().into_inner(), second);
    assert_refused(
        network.step(network_step(1)).await,
        Code::FailedPrecondition,
        "step: the next step is 3, got 1",
    );
    assert_refused(
        network.step(network_step(4)).await,
        Code::FailedPrecondition,
        "step: the next step is 3, got 4",
    );
    let mut other = network_step(2);
    other.until_ns += 1;
    assert_refused(network.step(other).await, Code::FailedPrecondition, "until_ns");
    let mut other = network_step(2);
    states(&mut other).vx_mps[3] = 1.0;
    assert_refused(
        network.step(other).await,
        Code::FailedPrecondition,
        "states: step 2 was taken with other content than its repetition has",
    );
    let mut other = network_step(2);
    other.commands.push(kill(1));
    assert_refused(network.step(other).await, Code::FailedPrecondition, "commands: step 2");
    assert_eq!(network.step(network_step(2)).await.unwrap().into_inner(), second);

    let (_robotsim, mut robots) = robots().await;
    robots.configure(robots_setup(1)).await.unwrap();
    let first = robots.step(robots_step(1)).await.unwrap().into_inner();
    assert_eq!(robots.step(robots_step(1)).await.unwrap().into_inner(), first);
    let held = v1::RobotSimServiceStepRequest { hold: true, ..robots_step(1) };
    assert_refused(robots.step(held).await, Code::FailedPrecondition, "hold: step 1");
    let mut given = robots_step(1);
    given.motes = Some(v1::MoteStates { alive: vec![0b11_1111].into(), ..Default::default() });
    assert_refused(robots.step(given).await, Code::FailedPrecondition, "motes: step 1");
    assert_refused(
        robots.step(robots_step(3)).await,
        Code::FailedPrecondition,
        "step: the next step is 2, got 3",
    );
}

#[tokio::test]
async fn a_refused_step_changes_nothing() {
    let (_netsim, mut network) = network().await;
    let (_other, mut untouched) = self::network().await;
    for client in [&mut network, &mut untouched] {
        client.configure(network_setup(7)).await.unwrap();
        client.step(network_step(1)).await.unwrap();
    }
    let mut endless = network_step(2);
    endless.until_ns = u64::MAX;
    assert_refused(
        network.step(endless).await,
        Code::InvalidArgument,
        "until_ns: must be at most 1000 periods",
    );
    type Spoil = fn(&mut v1::NetSimServiceStepRequest);
    let spoilt: [(Spoil, Code, &str); 9] = [
        (
            |r| r.until_ns = STEP_NS,
            Code::FailedPrecondition,
            "until_ns: must be later than 60000000 ns",
        ),
        (|r| r.states = None, Code::InvalidArgument, "states: is missing"),
        (
            |r| states(r).x_m[2] = f64::INFINITY,
            Code::InvalidArgument,
            "states.x_m[2]: must be finite and at most 1e12 in magnitude, got inf",
        ),
        (|r| states(r).y_m.truncate(5), Code::InvalidArgument, "states.y_m: must have 6 entries"),
        (
            |r| states(r).alive = vec![0xff].into(),
            Code::InvalidArgument,
            "states.alive: must be 1 bytes for 6 agents",
        ),
        (
            |r| r.payloads.as_mut().unwrap().length_bytes[0] = 9,
            Code::InvalidArgument,
            "payloads.data: must be 14 bytes long, got 6",
        ),
        (
            |r| r.confirmed_digest = vec![1; 32].into(),
            Code::FailedPrecondition,
            "confirmed_digest: the digest of step 1 is",
        ),
        (
            |r| r.commands.push(kill(99)),
            Code::InvalidArgument,
            "commands[0].mote: motes are 0 to 5, got 99",
        ),
        (|r| r.commands.push(jam()), Code::Unimplemented, "MOTE_COMMAND_KIND_JAM"),
    ];
    for (spoil, code, text) in spoilt {
        let mut request = network_step(2);
        spoil(&mut request);
        assert_refused(network.step(request).await, code, text);
    }
    for step in 2..5 {
        let after = network.step(network_step(step)).await.unwrap().into_inner();
        assert_eq!(after, untouched.step(network_step(step)).await.unwrap().into_inner());
    }
}

fn states(request: &mut v1::NetSimServiceStepRequest) -> &mut v1::AgentStates {
    request.states.as_mut().unwrap()
}

fn kill(mote: u32) -> v1::MoteCommand {
    use v1::mote_command::{Kill, Order};
    v1::MoteCommand { source: "test".to_owned(), order: Some(Order::Kill(Kill { mote })) }
}

fn jam() -> v1::MoteCommand {
    use v1::mote_command::{Jam, Order};
    let jam = Jam { channel: 11, from_ns: 0, until_ns: 1, ..Default::default() };
    v1::MoteCommand { source: "test".to_owned(), order: Some(Order::Jam(jam)) }
}

#[tokio::test]
async fn configure_lists_every_problem_with_its_path() {
    let (_netsim, mut network) = network().await;
    let mut request = network_setup(1);
    request.config_toml =
        "[phy]\npropagation = \"unit-disk\"\nradius_m = -3\nradios_m = 1\n".to_owned();
    request.site_toml = "[[wall]]\nfrom_m = [0, 0]\nto_m = [0, 0]\n".to_owned();
    let status = network.configure(request).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    let fields = |status: &Status| -> Vec<String> {
        let details = status.get_details_bad_request().unwrap();
        details.field_violations.into_iter().map(|violation| violation.field).collect()
    };
    assert_eq!(fields(&status), ["site.wall[0].to_m"]);
    let mut request = network_setup(1);
    request.config_toml =
        "[phy]\npropagation = \"unit-disk\"\nradius_m = -3\nradios_m = 1\n".to_owned();
    let status = network.configure(request).await.unwrap_err();
    assert_eq!(fields(&status), ["phy.radius_m", "phy.radios_m"]);
    assert!(
        status
            .message()
            .contains("phy.radius_m: must be greater than 0 and at most 10000000, got -3"),
        "{}",
        status.message()
    );

    let mut request = network_setup(1);
    request.config_toml = (0..500).map(|key| format!("unknown_key_{key} = 1\n")).collect();
    let status = network.configure(request).await.unwrap_err();
    let problems = fields(&status);
    assert!((20..500).contains(&problems.len()), "{} problems", problems.len());
    assert_eq!(problems[0], "unknown_key_0");
    let last = status.get_details_bad_request().unwrap().field_violations.pop().unwrap();
    let rest = 500 - (problems.len() - 1);
    assert_eq!(last.description, format!("and {rest} more problems"));

    let mut request = network_setup(1);
    request.agent_count = 0;
    assert_refused(
        network.configure(request).await,
        Code::InvalidArgument,
        "agent_count: must be at least 1, got 0",
    );
    let mut request = network_setup(1);
    request.agent_count = u32::MAX;
    assert_refused(
        network.configure(request).await,
        Code::ResourceExhausted,
        "agent_count: must be at most",
    );
}

#[tokio::test]
async fn a_session_gives_what_single_calls_give() {
    let (_robotsim, mut robots) = robots().await;
    robots.configure(robots_setup(3)).await.unwrap();
    let mut single = Vec::new();
    for step in 1..6 {
        single.push(robots.step(robots_step(step)).await.unwrap().into_inner());
    }
    robots.configure(robots_setup(3)).await.unwrap();
    let calls = (1..6).map(|step| v1::RobotSimServiceSessionRequest {
        request: Some(SessionCall::Step(robots_step(step))),
    });
    let replies = robots.session(tokio_stream::iter(calls)).await.unwrap().into_inner();
    let streamed: Vec<_> = replies
        .map(|reply| match reply.unwrap().response {
            Some(SessionReply::Step(step)) => step,
            other => panic!("{other:?}"),
        })
        .collect()
        .await;
    assert_eq!(streamed, single);
}

#[tokio::test]
async fn a_restored_state_continues_as_if_never_stopped() {
    let (_robotsim, mut robots) = robots().await;
    let (_elsewhere, mut elsewhere) = self::robots().await;
    robots.configure(robots_setup(5)).await.unwrap();
    for step in 1..4 {
        robots.step(robots_step(step)).await.unwrap();
    }
    let state =
        robots.snapshot(v1::RobotSimServiceSnapshotRequest {}).await.unwrap().into_inner().state;
    let restored = elsewhere
        .restore(v1::RobotSimServiceRestoreRequest { state: state.clone(), seed: None })
        .await
        .unwrap()
        .into_inner();
    assert_eq!((restored.step, restored.time_ns), (3, 3 * STEP_NS));
    for step in 3..8 {
        let went_on = robots.step(robots_step(step)).await.unwrap().into_inner();
        assert_eq!(elsewhere.step(robots_step(step)).await.unwrap().into_inner(), went_on);
    }
    let torn =
        v1::RobotSimServiceRestoreRequest { state: state.slice(..state.len() / 2), seed: None };
    assert_refused(elsewhere.restore(torn).await, Code::InvalidArgument, "is not a snapshot");
    elsewhere.step(robots_step(8)).await.expect("a refused restore changes nothing");

    let (_netsim, mut network) = network().await;
    let (_netsim_elsewhere, mut network_elsewhere) = self::network().await;
    network.configure(network_setup(5)).await.unwrap();
    for step in 1..4 {
        network.step(network_step(step)).await.unwrap();
    }
    let state =
        network.snapshot(v1::NetSimServiceSnapshotRequest {}).await.unwrap().into_inner().state;
    network_elsewhere.restore(v1::NetSimServiceRestoreRequest { state, seed: None }).await.unwrap();
    for step in 4..8 {
        let went_on = network.step(network_step(step)).await.unwrap().into_inner();
        assert_eq!(network_elsewhere.step(network_step(step)).await.unwrap().into_inner(), went_on);
    }
}

#[tokio::test]
async fn orders_from_outside_take_effect_with_the_next_step_and_are_listed() {
    use v1::agent_command::{Order, Velocity};
    let (_robotsim, mut robots) = robots().await;
    robots.configure(robots_setup(1)).await.unwrap();
    robots.step(robots_step(1)).await.unwrap();
    let order = |source: &str, vx_mps| v1::AgentCommand {
        agent: 2,
        source: source.to_owned(),
        order: Some(Order::Velocity(Velocity { vx_mps, vy_mps: 0.0, vz_mps: 0.0 })),
    };
    // In the order of their sources, whatever the order in which they came: the last one holds.
    let commands = vec![order("zulu", 2.0), order("alpha", 9.0)];
    let reply = robots.command(v1::RobotSimServiceCommandRequest { commands }).await.unwrap();
    assert_eq!(reply.into_inner().applies_at_step, 2);
    let reply = robots.step(robots_step(2)).await.unwrap().into_inner();
    let sources: Vec<&str> =
        reply.applied_commands.iter().map(|command| command.source.as_str()).collect();
    assert_eq!(sources, ["alpha", "zulu"]);
    assert!((reply.states.unwrap().vx_mps[2] - 2.0).abs() < 1e-12);
    let reply = robots.step(robots_step(3)).await.unwrap().into_inner();
    assert!(reply.applied_commands.is_empty());
    assert!((reply.states.unwrap().vx_mps[2] - 2.0).abs() < 1e-12, "it holds until released");
}

#[tokio::test]
async fn orders_do_not_pile_up_without_end() {
    let (_netsim, mut network) = network().await;
    network.configure(network_setup(1)).await.unwrap();
    let many = v1::NetSimServiceCommandRequest { commands: vec![kill(1); 60_000] };
    network.command(many.clone()).await.unwrap();
    assert_refused(
        network.command(many).await,
        Code::ResourceExhausted,
        "commands: at most 100000 may be pending",
    );
    let reply = network.step(network_step(1)).await.unwrap().into_inner();
    assert_eq!(reply.applied_commands.len(), 60_000);
}

#[tokio::test]
async fn a_mote_that_is_killed_neither_sends_nor_hears() {
    let (_netsim, mut network) = network().await;
    let mut setup = network_setup(1);
    setup.config_toml = "[phy]\npropagation = \"full\"\n".to_owned();
    network.configure(setup).await.unwrap();
    let reply = network.step(network_step(1)).await.unwrap().into_inner();
    assert_eq!(heard(&reply), AGENTS as usize * (AGENTS as usize - 1));
    let commands = vec![kill(3)];
    network.command(v1::NetSimServiceCommandRequest { commands }).await.unwrap();
    let reply = network.step(network_step(2)).await.unwrap().into_inner();
    assert_eq!(reply.applied_commands, [kill(3)]);
    assert_eq!(heard(&reply), (AGENTS as usize - 1) * (AGENTS as usize - 2));
    assert_eq!(reply.motes.unwrap().alive[0], 0b11_0111);
}

fn heard(reply: &v1::NetSimServiceStepResponse) -> usize {
    proto_messages::convert::deliveries(reply.deliveries.clone(), AGENTS as usize)
        .unwrap()
        .unwrap()
        .n_deliveries()
}

#[tokio::test]
async fn health_and_reflection_are_served_on_both_sides() {
    use tonic_health::pb::HealthCheckRequest;
    use tonic_health::pb::health_client::HealthClient;
    use tonic_reflection::pb::v1::ServerReflectionRequest;
    use tonic_reflection::pb::v1::server_reflection_client::ServerReflectionClient;
    use tonic_reflection::pb::v1::server_reflection_request::MessageRequest;
    use tonic_reflection::pb::v1::server_reflection_response::MessageResponse;
    for (name, service) in
        [("netsim", "cosim.v1.NetSimService"), ("robotsim", "cosim.v1.RobotSimService")]
    {
        let server = Server::start(name, &[]).unwrap();
        let channel = Channel::from_shared(server.url.clone()).unwrap().connect().await.unwrap();
        let request = HealthCheckRequest { service: service.to_owned() };
        let mut health = HealthClient::new(channel.clone());
        let status = health.check(request).await.unwrap().into_inner().status;
        assert_eq!(status, tonic_health::pb::health_check_response::ServingStatus::Serving as i32);

        let mut reflection = ServerReflectionClient::new(channel);
        let ask = ServerReflectionRequest {
            host: String::new(),
            message_request: Some(MessageRequest::ListServices(String::new())),
        };
        let mut answers = reflection
            .server_reflection_info(tokio_stream::iter([ask]))
            .await
            .unwrap()
            .into_inner();
        let answer = answers.message().await.unwrap().unwrap().message_response;
        let Some(MessageResponse::ListServicesResponse(list)) = answer else {
            panic!("{answer:?}")
        };
        let names: Vec<String> = list.service.into_iter().map(|service| service.name).collect();
        assert!(names.iter().any(|name| name == service), "{names:?}");
    }
}
