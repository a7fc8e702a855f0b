//! The worked example of the contract, and that nothing that crosses is left out.

use super::*;
use crate::digest::hex;
use crate::types::{
    AgentMessage, AgentOrder, Bitmap, Coupling, Covariate, Deliveries, Formation, FrameOutcome,
    Frames, Heard, HeardLinks, Medium, MoteOrder, MoteStates, MoteStatistics, PacketKind, Packets,
    Schedule, Statistic, TaskFigure, Transmissions,
};
use bytes::Bytes;

fn robots_of_the_example() -> AgentStates {
    AgentStates {
        alive: Bitmap::filled(2, true),
        x_m: vec![0.0, 1.5],
        y_m: vec![0.0, -2.0],
        z_m: vec![0.0, 0.0],
        ..AgentStates::default()
    }
}

#[test]
fn the_worked_example_of_the_full_digest_holds() {
    let states = robots_of_the_example();
    let experiment = Experiment {
        seed: 7,
        agent_count: 2,
        step_ns: 100_000_000,
        coupling: Coupling::Sequential,
    };
    let request = StartRequest {
        experiment: &experiment,
        site_toml: "",
        config_toml: "a = 1",
        files: Vec::new(),
        columns: &[],
        records: &[],
    };
    let reply = RobotsStart {
        effective_toml: String::new(),
        states: states.clone(),
        payloads: None,
        columns: Vec::new(),
        messages: false,
    };
    let start = of_robots_start(&request, &reply);
    let reply = RobotsStep {
        step: 1,
        time_ns: 100_000_000,
        states,
        payloads: Payloads::silence(2),
        ..RobotsStep::default()
    };
    let given = RobotsGiven::of_reply(None, &[]);
    let digest = of_robots_step(&start, &given, &RobotsReply::of_step(&reply));
    let file = include_str!("../../../../cosim/v1/common.proto");
    for digest in [start, digest] {
        assert!(file.contains(&hex(&digest)), "common.proto states another than {}", hex(&digest));
    }
}

fn order() -> AgentCommand {
    AgentCommand { agent: 0, source: "s".to_owned(), order: AgentOrder::Velocity([1.0; 3]) }
}

fn mote_order(order: MoteOrder) -> MoteCommand {
    MoteCommand { source: "s".to_owned(), order }
}

fn robots_reply() -> RobotsStep {
    let covariates = vec![Covariate { name: "tilt_rad".to_owned(), values: vec![0.1, 0.2] }];
    RobotsStep {
        step: 3,
        time_ns: 300,
        states: AgentStates {
            heading_rad: vec![0.0, 1.0],
            covariates,
            ..AgentStates::at_rest(&[[1.0, 2.0], [3.0, 4.0]])
        },
        payloads: Payloads::new(vec![2, 1], Bytes::from_static(b"abc")).unwrap(),
        moved_obstacles: vec![MovedObstacle { name: "door".to_owned(), centre_m: [1.0, 1.0] }],
        commands: vec![order()],
        applied_commands: vec![order()],
        task_complete: false,
        held: false,
        messages: vec![AgentMessage {
            sender: 0,
            destination: 1,
            payload: Bytes::from_static(b"m"),
        }],
        figures: vec![TaskFigure { name: "mapped_ratio".to_owned(), value: 0.5 }],
    }
}

#[test]
fn every_field_of_the_robots_reply_counts() {
    type Spoil = fn(&mut RobotsStep);
    let spoilt: [Spoil; 21] = [
        |r| r.step += 1,
        |r| r.time_ns += 1,
        |r| r.states.alive.set(1, false),
        |r| r.states.x_m[1] += 1.0,
        |r| r.states.vx_mps[0] = 1.0,
        |r| r.states.vy_mps[0] = 1.0,
        |r| r.states.vz_mps[0] = -0.0,
        |r| r.states.heading_rad[0] = 1.0,
        |r| r.states.covariates[0].name.push('x'),
        |r| r.states.covariates[0].values[1] = 0.3,
        |r| r.payloads = Payloads::new(vec![1, 2], Bytes::from_static(b"abc")).unwrap(),
        |r| r.payloads = Payloads::new(vec![2, 1], Bytes::from_static(b"abd")).unwrap(),
        |r| r.moved_obstacles[0].centre_m[1] = 2.0,
        |r| r.commands[0].agent = 1,
        |r| r.commands[0].order = AgentOrder::Waypoint([1.0; 3]),
        |r| r.applied_commands[0].source.push('x'),
        |r| r.task_complete = true,
        |r| r.held = true,
        |r| r.messages[0].destination = 0,
        |r| r.messages[0].payload = Bytes::from_static(b"n"),
        |r| r.figures[0].value = 0.6,
    ];
    let whole = RobotsReply::of_step(&robots_reply());
    for (index, spoil) in spoilt.into_iter().enumerate() {
        let mut reply = robots_reply();
        spoil(&mut reply);
        assert_ne!(RobotsReply::of_step(&reply).digest, whole.digest, "change {index}");
    }
}

fn network_reply() -> NetworkStep {
    let values = vec![1.0, 2.0];
    let known = Some(Bitmap::filled(2, true));
    let column = Statistic { name: "a".to_owned(), unit: "s".to_owned(), values, known };
    NetworkStep {
        step: 3,
        time_ns: 300,
        deliveries: Deliveries {
            transmissions: Transmissions {
                sender: vec![0],
                sent_ns: vec![5],
                end_ns: vec![6],
                payloads: Payloads::new(vec![1], Bytes::from_static(b"a")).unwrap(),
                destination: vec![1],
            },
            heard: Heard::Lists { ends: vec![0, 1], indices: vec![0] },
            received_ns: vec![7],
            rssi_dbm: vec![-50.0],
            hops: vec![1],
            medium: vec![Medium::Radio],
        },
        motes: Some(MoteStates {
            rank: vec![1, 2],
            parent: vec![1, 0],
            queue_length: vec![0, 0],
            synced: Some(Bitmap::filled(2, true)),
            joined: Some(Bitmap::filled(2, true)),
            ..MoteStates::all_working(2)
        }),
        commands: vec![order()],
        applied_commands: vec![mote_order(MoteOrder::Kill(0))],
        formation: Some(Formation { formed_ns: Some(0), ..Formation::default() }),
        packets: Some(Packets {
            id: vec![1],
            kind: vec![0],
            source: vec![0],
            destination: vec![1],
            created_ns: vec![1],
            ended_ns: vec![2],
            hops: vec![1],
            payload_bytes: vec![1],
            outcome: vec![0],
            kinds: vec![PacketKind { name: "app".to_owned(), is_application: true, created: 1 }],
            reasons: vec!["no_route".to_owned()],
        }),
        capture: Bytes::new(),
        statistics: Some(MoteStatistics { columns: vec![column] }),
        schedule: Some(Schedule { mote: vec![0], ..Schedule::default() }),
        heard_links: Some(HeardLinks { frames: vec![1], ..HeardLinks::default() }),
        frames: Some(Frames {
            packet: vec![1],
            outcome: vec![FrameOutcome::Lost],
            kinds: vec!["data".to_owned()],
            ..Frames::default()
        }),
    }
}

#[test]
fn every_field_of_the_networks_reply_counts() {
    type Spoil = fn(&mut NetworkStep);
    fn motes(reply: &mut NetworkStep) -> &mut MoteStates {
        reply.motes.as_mut().unwrap()
    }
    let spoilt: [Spoil; 34] = [
        |r| r.time_ns += 1,
        |r| r.deliveries.transmissions.sender[0] = 1,
        |r| r.deliveries.transmissions.sent_ns[0] = 4,
        |r| r.deliveries.transmissions.end_ns[0] = 7,
        |r| r.deliveries.transmissions.destination[0] = 0,
        |r| r.deliveries.heard = Heard::Lists { ends: vec![1, 1], indices: vec![0] },
        |r| r.deliveries.received_ns[0] = 8,
        |r| r.deliveries.rssi_dbm[0] = -51.0,
        |r| r.deliveries.hops[0] = 2,
        |r| r.deliveries.medium[0] = Medium::Truth,
        |r| r.motes = None,
        |r| motes(r).alive.set(0, false),
        |r| motes(r).synced = None,
        |r| motes(r).joined = None,
        |r| motes(r).rank[0] = 7,
        |r| motes(r).parent[0] = 7,
        |r| motes(r).queue_length[0] = 7,
        |r| r.commands.clear(),
        |r| r.applied_commands[0] = mote_order(MoteOrder::Revive(0)),
        |r| r.applied_commands[0] = mote_order(MoteOrder::Kill(1)),
        |r| r.formation.as_mut().unwrap().formed_ns = Some(1),
        |r| r.formation.as_mut().unwrap().formed_ns = None,
        |r| r.packets.as_mut().unwrap().outcome[0] = 1,
        |r| r.packets.as_mut().unwrap().kinds[0].created = 2,
        |r| r.packets.as_mut().unwrap().reasons[0].push('x'),
        |r| r.statistics.as_mut().unwrap().columns[0].values[0] = 7.0,
        |r| r.statistics.as_mut().unwrap().columns[0].known = None,
        |r| r.schedule.as_mut().unwrap().mote[0] = 1,
        |r| r.heard_links.as_mut().unwrap().frames[0] = 2,
        |r| r.heard_links = None,
        |r| r.frames.as_mut().unwrap().packet[0] = 2,
        |r| r.frames.as_mut().unwrap().outcome[0] = FrameOutcome::Acknowledged,
        |r| r.frames.as_mut().unwrap().kinds[0].push('s'),
        |r| r.frames = None,
    ];
    let whole = NetworkReply::of_step(&network_reply());
    for (index, spoil) in spoilt.into_iter().enumerate() {
        let mut reply = network_reply();
        spoil(&mut reply);
        assert_ne!(NetworkReply::of_step(&reply).digest, whole.digest, "change {index}");
    }
}

#[test]
fn what_one_side_replies_is_what_the_other_is_given() {
    let (robots, network) = (robots_reply(), network_reply());
    let input = RobotInput {
        step: 4,
        from_ns: 300,
        until_ns: 400,
        deliveries: Some(&network.deliveries),
        motes: network.motes.as_ref(),
        commands: &[],
        hold: false,
    };
    let reply = NetworkReply::of_step(&network);
    assert_eq!(
        RobotsGiven::of_reply(Some(&reply), &network.commands),
        RobotsGiven::of_input(&input, &network.commands)
    );
    let input = NetInput {
        step: 3,
        from_ns: 200,
        until_ns: 300,
        states: &robots.states,
        payloads: &robots.payloads,
        moved_obstacles: &robots.moved_obstacles,
        commands: &network.applied_commands,
        stop_at_first_delivery: false,
        records: &[NetRecord::Statistics],
    };
    let given = NetworkGiven::of_reply(&RobotsReply::of_step(&robots), &input, false);
    assert_eq!(given, NetworkGiven::of_input(&input, &network.applied_commands));
    let silent = Payloads::silence(2);
    let input = NetInput { payloads: &silent, ..input };
    let given = NetworkGiven::of_reply(&RobotsReply::of_step(&robots), &input, true);
    assert_eq!(given, NetworkGiven::of_input(&input, &network.applied_commands));
}
