use super::*;
use crate::counts::Counts;
use proto::types::{AgentStates, Bitmap, Deliveries, PacketKind, Packets, Statistic};
use serde_json::{Value, json};

const N: usize = 3;
const S: u64 = 1_000_000_000;

/// A packet that ended: source, destination, created and ended (s), hops, outcome.
type Ended = (u32, u32, u64, u64, u32, u32);

fn packets(created: u64, ended: &[Ended]) -> Packets {
    Packets {
        id: (0..ended.len() as u64).collect(),
        kind: vec![0; ended.len()],
        source: ended.iter().map(|packet| packet.0).collect(),
        destination: ended.iter().map(|packet| packet.1).collect(),
        created_ns: ended.iter().map(|packet| packet.2 * S).collect(),
        ended_ns: ended.iter().map(|packet| packet.3 * S).collect(),
        hops: ended.iter().map(|packet| packet.4).collect(),
        payload_bytes: vec![90; ended.len()],
        outcome: ended.iter().map(|packet| packet.5).collect(),
        kinds: vec![PacketKind { name: "app".to_owned(), is_application: true, created }],
        reasons: vec!["queue_full".to_owned(), "max_retries".to_owned()],
    }
}

fn statistics(columns: &[(&str, [f64; N])]) -> MoteStatistics {
    let column = |&(name, values): &(&str, [f64; N])| {
        // As networks say it: what is 0 there is not known.
        let mut known = Bitmap::filled(N, true);
        if name.starts_with("first") {
            (0..N).for_each(|mote| known.set(mote, values[mote] != 0.0));
        }
        Statistic {
            name: name.to_owned(),
            values: values.to_vec(),
            known: Some(known),
            ..Statistic::default()
        }
    };
    MoteStatistics { columns: columns.iter().map(column).collect() }
}

/// What a step of 10 s brings.
#[derive(Default)]
struct Step {
    packets: Option<Packets>,
    statistics: Option<MoteStatistics>,
    formed_ns: Option<u64>,
    held: bool,
    joined: Option<[bool; N]>,
}

fn run(steps: &[Step]) -> Kpis {
    let states = AgentStates::at_origin(N);
    let motes = MoteStates { alive: Bitmap::filled(N, true), ..MoteStates::default() };
    let deliveries = Deliveries::default();
    let counts = Counts::from_deliveries(&deliveries, N);
    let mut kpis = Kpis::new(Some(Formation::default()), None);
    for (step, reply) in (1..).zip(steps) {
        let formation = Formation { formed_ns: reply.formed_ns, ..Formation::default() };
        let joined = reply.joined.map(|joined| {
            let mut all = Bitmap::filled(N, false);
            (0..N).for_each(|mote| all.set(mote, joined[mote]));
            all
        });
        let motes = MoteStates { joined, ..motes.clone() };
        kpis.add(&Period {
            step,
            from_ns: (step - 1) * 10 * S,
            time_ns: step * 10 * S,
            states: &states,
            states_before: &states,
            states_on_air: &states,
            moved_obstacles: &[],
            deliveries: &deliveries,
            counts: &counts,
            motes: &motes,
            task_complete: false,
            held: reply.held,
            formation: Some(&formation),
            packets: reply.packets.as_ref(),
            statistics: reply.statistics.as_ref(),
            schedule: None,
            heard_links: None,
            frames: None,
        });
    }
    kpis
}

/// Numbers that are equal up to rounding.
fn assert_near(value: &Value, expected: f64) {
    let found = value.as_f64().unwrap();
    assert!((found - expected).abs() <= 1e-9 * expected.abs(), "{found}, expected {expected}");
}

#[test]
fn every_packet_is_delivered_dropped_or_on_its_way() {
    let first = packets(6, &[(1, 0, 0, 2, 1, 0), (2, 0, 1, 5, 2, 0), (2, 0, 3, 6, 1, 2)]);
    let second =
        packets(9, &[(1, 2, 4, 12, 3, 0), (2, 0, 8, 13, 0, 1), (0, u32::MAX, 13, 13, 0, 0)]);
    let kpis = run(&[
        Step { packets: Some(first), ..Step::default() },
        Step { packets: Some(second), ..Step::default() },
    ]);
    let summary = json!(kpis.summary());
    let app = &summary["packets"]["app"];
    assert_eq!(
        ["created", "delivered", "dropped", "in_flight"].map(|key| app[key].as_u64().unwrap()),
        [9, 4, 2, 3]
    );
    assert_eq!(app["drops_by_reason"], json!({ "max_retries": 1, "queue_full": 1 }));
    // To everyone: no end-to-end packet. Those on their way count for neither side.
    let delivery = &summary["delivery"];
    assert_eq!((&delivery["delivered"], &delivery["dropped"]), (&json!(3), &json!(2)));
    assert_near(&delivery["ratio"], 0.6);
    // Wilson: Newcombe's formula for 3 of 5.
    assert_near(&delivery["ratio_interval_95"][0], 0.230_724_281_370_278_05);
    // Latencies 2, 4 and 8 s.
    let latency_s = &delivery["latency_s"];
    for (key, expected) in [
        ("min", 2.0),
        ("mean", 14.0 / 3.0),
        ("median", 4.0),
        ("p95", 7.6),
        ("p99", 7.92),
        ("max", 8.0),
    ] {
        assert_near(&latency_s[key], expected);
    }
    assert_near(&delivery["mean_hops"], 2.0);
    assert_eq!(summary["motes"]["delivered"], json!([null, 2.0, 1.0]));
    assert_near(&summary["motes"]["delivery_ratio"][2], 1.0 / 3.0);
    assert_near(&summary["motes"]["mean_latency_s"][1], 5.0);
    // Of mote 1: 2 and 8 s.
    for (key, expected) in [
        ("median_latency_s", 5.0),
        ("p95_latency_s", 7.7),
        ("p99_latency_s", 7.94),
        ("max_latency_s", 8.0),
    ] {
        assert_near(&summary["motes"][key][1], expected);
    }
    assert_eq!(summary["motes"]["dropped_queue_full"], json!([null, 0.0, 1.0]));
    assert_eq!(summary["motes"]["dropped_max_retries"], json!([null, 0.0, 1.0]));
    assert_eq!(kpis.warnings(), Vec::<String>::new());
}

#[test]
fn exchanges_have_round_trips_and_downloads_goodput() {
    // Two exchanges of 2 s and 4 s, one that failed, one that is open; downloads of 900 B in 9 s and in 3 s.
    let mut ended = packets(
        9,
        &[
            (0, 1, 0, 2, 1, 0),
            (0, 2, 1, 5, 1, 0),
            (0, 2, 6, 68, 0, 2),
            (0, 1, 0, 9, 1, 0),
            (0, 2, 9, 12, 1, 0),
        ],
    );
    ended.kind = vec![1, 1, 1, 2, 2];
    ended.payload_bytes = vec![20, 20, 20, 900, 900];
    for (name, created) in [("exchange", 4), ("download", 2)] {
        let kind = PacketKind { name: name.to_owned(), is_application: false, created };
        ended.kinds.push(kind);
    }
    let statistics = statistics(&[
        ("coap_requests", [4.0, 0.0, 0.0]),
        ("coap_retransmissions", [5.0, 0.0, 0.0]),
        ("coap_duplicates", [0.0, 1.0, 2.0]),
        ("blocks_requested", [0.0, 15.0, 15.0]),
        ("blocks_retransmitted", [0.0, 1.0, 0.0]),
        ("blocks_duplicated", [1.0, 0.0, 0.0]),
    ]);
    let step = Step { packets: Some(ended), statistics: Some(statistics), ..Step::default() };
    let summary = json!(run(&[step]).summary());
    let exchanges = &summary["exchanges"];
    let counts = |of: &Value| {
        ["started", "succeeded", "failed", "open"].map(|key| of[key].as_u64().unwrap())
    };
    assert_eq!(counts(exchanges), [4, 2, 1, 1]);
    assert_near(&exchanges["success_ratio"], 2.0 / 3.0);
    assert_near(&exchanges["round_trip_s"]["mean"], 3.0);
    assert_near(&exchanges["round_trip_s"]["max"], 4.0);
    for (key, expected) in [("requests", 4.0), ("retransmissions", 5.0), ("duplicates", 3.0)] {
        assert_near(&exchanges[key], expected);
    }
    let downloads = &summary["downloads"];
    assert_eq!(counts(downloads), [2, 2, 0, 0]);
    assert_near(&downloads["time_s"]["median"], 6.0);
    // The mean of 100 B/s and 300 B/s.
    assert_near(&downloads["mean_goodput_bytes_s"], 200.0);
    for (key, expected) in [("blocks", 30.0), ("retransmissions", 1.0), ("duplicates", 1.0)] {
        assert_near(&downloads[key], expected);
    }
    // Without such traffic there is no such figure.
    let without =
        json!(run(&[Step { packets: Some(packets(1, &[])), ..Step::default() }]).summary());
    assert!(without.get("exchanges").is_none() && without.get("downloads").is_none());
}

#[test]
fn transmissions_are_those_of_all_motes_and_absent_where_nothing_was_sent() {
    let transmissions = |columns: &[(&str, [f64; N])]| {
        let step = Step { statistics: Some(statistics(columns)), ..Step::default() };
        json!(run(&[step]).summary()).get("transmissions").cloned()
    };
    let sent = transmissions(&[("tx_unicast", [0.0, 6.0, 2.0]), ("tx_acked", [0.0, 3.0, 2.0])]);
    let expected = json!({ "unicast": 8, "acknowledged": 5, "acknowledged_ratio": 0.625 });
    assert_eq!(sent, Some(expected));
    let silent = [("tx_unicast", [0.0; N]), ("tx_acked", [0.0; N])];
    assert_eq!(transmissions(&silent), None);
    assert_eq!(transmissions(&silent[..1]), None);
    assert_eq!(transmissions(&[("tx_unicast", [1.0; N])]), None);
}

#[test]
fn where_the_airtime_went_is_told_by_kind_most_first_since_the_start() {
    let counted = |beacons: f64, asked: f64, answered: f64| {
        Some(statistics(&[
            ("tx_frames_beacon", [beacons, 0.0, 0.0]),
            ("tx_frames_keep_alive", [0.0, asked, 0.0]),
            ("tx_unicast_keep_alive", [0.0, asked, 0.0]),
            ("tx_acked_keep_alive", [0.0, answered, 0.0]),
            ("tx_frames_dao", [0.0; N]),
        ]))
    };
    let formed_ns = Some(9 * S);
    let kpis = run(&[
        Step { held: true, formed_ns, ..Step::default() },
        Step { statistics: counted(8.0, 4.0, 1.0), formed_ns, ..Step::default() },
        Step { statistics: counted(9.0, 7.0, 4.0), formed_ns, ..Step::default() },
    ]);
    let summary = kpis.summary().unwrap();
    let shown = |of: Option<IndexMap<String, FramesOfKind>>| -> Vec<(String, u64, u64)> {
        let all = of.unwrap().into_iter();
        all.map(|(kind, of)| (kind, of.transmissions, of.acknowledged)).collect()
    };
    let whole = [("beacon".to_owned(), 9, 0), ("keep-alive".to_owned(), 7, 4)];
    assert_eq!(shown(summary.frames_by_kind), whole);
    let since = summary.since_start.frames_by_kind;
    assert_near(&json!(since)["keep-alive"]["share"], 0.75);
    assert_near(&json!(since)["keep-alive"]["acknowledged_ratio"], 1.0);
    assert_eq!(shown(since), [("keep-alive".to_owned(), 3, 3), ("beacon".to_owned(), 1, 0)]);
    // Absent if the network does not count frames by kind.
    let silent = Step { statistics: Some(statistics(&[])), ..Step::default() };
    assert!(run(&[silent]).summary().unwrap().frames_by_kind.is_none());
    // Robots that need not wait start with the run.
    let steps = [counted(8.0, 4.0, 1.0), counted(9.0, 7.0, 4.0)];
    let steps = steps.map(|statistics| Step { statistics, formed_ns, ..Step::default() });
    let at_once = run(&steps).summary().unwrap();
    assert_eq!(at_once.since_start.frames_by_kind, at_once.frames_by_kind);
}

#[test]
fn joined_motes_out_of_range_of_their_parents_and_unequal_ratios_are_warned_of() {
    let step = |lost: [f64; N], joined| Step {
        statistics: Some(statistics(&[
            ("is_root", [1.0, 0.0, 0.0]),
            ("parent_out_of_range", lost),
            ("up_ns", [1e11; N]),
        ])),
        packets: Some(packets(1, &[(1, 0, 0, 2, 1, 0)])),
        joined: Some(joined),
        ..Step::default()
    };
    let warned = |step: Step| run(&[step]).warnings();
    let lost = warned(step([0.0, 1.0, 0.0], [true; N]));
    assert!(
        lost.len() == 1 && lost[0].contains("1 of 3 joined motes were out of range"),
        "{lost:?}"
    );
    assert_eq!(warned(step([0.0, 1.0, 0.0], [true, false, true])), [""; 0]);
    // One packet of two that were due arrived, and all that was sent.
    let kpis = run(&[step([0.0; N], [true; N])]);
    let kpis = kpis.with_applications(Applications::from_config(EVERY_10_S));
    let warnings = kpis.warnings();
    assert!(warnings.len() == 1 && warnings[0].contains("50.0 %"), "{warnings:?}");
}

#[test]
fn an_account_that_cannot_be_right_is_warned_of() {
    let two = packets(1, &[(1, 0, 0, 2, 1, 0), (2, 0, 1, 5, 2, 0)]);
    let kpis = run(&[Step { packets: Some(two), ..Step::default() }]);
    assert_eq!(kpis.warnings().len(), 1);
    assert_eq!(json!(kpis.summary())["packets"]["app"]["in_flight"], 0);
}

#[test]
fn upward_traffic_is_that_to_roots() {
    let kpis = run(&[Step {
        packets: Some(packets(3, &[(1, 0, 0, 2, 1, 0), (2, 0, 1, 5, 2, 1), (0, 1, 1, 6, 1, 0)])),
        statistics: Some(statistics(&[("is_root", [1.0, 0.0, 0.0])])),
        ..Step::default()
    }]);
    let summary = json!(kpis.summary());
    assert_eq!(summary["delivery"]["delivered"], 2);
    assert_eq!(summary["delivery_upward"]["delivered"], 1);
    assert_near(&summary["delivery_upward"]["ratio"], 0.5);
}

// Q25: what was called mA was a charge in µC. Q26: the charge of scanning was divided by a time without it.
#[test]
fn q25_q26_a_current_is_a_charge_over_the_time_during_which_it_was_drawn() {
    let at_formation = statistics(&[
        ("charge_uc", [0.0, 6000.0, 8000.0]),
        ("up_ns", [1e10, 1e10, 1e10]),
        ("radio_on_ns", [1e10, 5e9, 1e10]),
        ("is_root", [1.0, 0.0, 0.0]),
    ]);
    let at_end = statistics(&[
        ("charge_uc", [900.0, 9000.0, 9000.0]),
        ("up_ns", [3e10, 3e10, 3e10]),
        ("radio_on_ns", [3e10, 6e9, 1.2e10]),
        ("is_root", [1.0, 0.0, 0.0]),
    ]);
    let formed_ns = Some(5 * S);
    let kpis = run(&[
        Step { formed_ns, ..Step::default() },
        Step { formed_ns, statistics: Some(at_formation), ..Step::default() },
        Step { formed_ns, statistics: Some(at_end), ..Step::default() },
    ]);
    let summary = json!(kpis.summary());
    let whole = &summary["energy"];
    assert_near(&whole["charge_uc"], 18_900.0);
    // 9000 µC in 30 s for both motes; the root is fed from the mains.
    assert_near(&whole["mean_current_ua"]["mean"], 300.0);
    assert_near(&whole["duty_cycle"]["mean"], 0.3);
    assert_near(&whole["network_lifetime_years"], 2821.5 * 1000.0 / 300.0 / 8760.0);
    // 3000 and 1000 µC in 20 s.
    let since = &summary["energy_since_formation"];
    assert_near(&since["mean_current_ua"]["mean"], 100.0);
    assert_near(&since["mean_current_ua"]["max"], 150.0);
    assert_near(&since["network_lifetime_years"], 2821.5 * 1000.0 / 150.0 / 8760.0);
    assert_eq!(summary["motes"]["lifetime_years"][0], Value::Null);
    assert_near(&summary["motes"]["mean_current_ua"][0], 30.0);
}

#[test]
fn since_the_start_only_what_robots_that_move_see_counts() {
    let churn = |changes, up_h: f64| {
        Some(statistics(&[
            ("is_root", [1.0, 0.0, 0.0]),
            ("parent_changes", changes),
            ("up_ns", [3.6e12 * up_h; N]),
        ]))
    };
    // While the network forms a packet is lost; then one of two arrives.
    let forming = packets(1, &[(1, 0, 0, 9, 1, 1)]);
    let moving = packets(3, &[(1, 0, 11, 15, 1, 0), (2, 0, 12, 19, 1, 2)]);
    let formed_ns = Some(9 * S);
    let kpis = run(&[
        Step { packets: Some(forming), held: true, formed_ns, ..Step::default() },
        Step {
            packets: Some(moving),
            statistics: churn([0.0, 5.0, 2.0], 1.0),
            formed_ns,
            joined: Some([true; N]),
            ..Step::default()
        },
        Step {
            statistics: churn([0.0, 8.0, 3.0], 3.0),
            formed_ns,
            joined: Some([true, false, false]),
            ..Step::default()
        },
    ]);
    let summary = json!(kpis.summary());
    assert_near(&summary["delivery"]["ratio"], 1.0 / 3.0);
    let since = &summary["since_start"];
    assert_near(&since["delivery"]["ratio"], 0.5);
    assert_near(&since["delivery_upward"]["ratio"], 0.5);
    // Four changes, of two motes on for two more hours each.
    assert_near(&since["parent_changes"], 4.0);
    assert_near(&since["churn_per_mote_hour"], 1.0);
    assert_near(&summary["routing"]["parent_changes"], 11.0);
    // Everyone half of the time, one of three the other half.
    assert_near(&since["joined_ratio"], 2.0 / 3.0);
    // One packet of 90 bytes in 20 s.
    assert_near(&since["throughput_bytes_s"], 4.5);
}

#[test]
fn robots_that_need_not_wait_start_with_the_run() {
    let all = Some(statistics(&[("parent_changes", [0.0, 5.0, 2.0]), ("up_ns", [3.6e12; N])]));
    let kpis = run(&[Step { statistics: all, formed_ns: Some(5 * S), ..Step::default() }]);
    let since = &json!(kpis.summary())["since_start"];
    assert_near(&since["parent_changes"], 7.0);
    assert_eq!(since["throughput_bytes_s"], Value::Null, "no application is known");
}

#[test]
fn a_lifetime_is_that_of_the_battery_the_network_names() {
    let kpis = run(&[Step {
        statistics: Some(statistics(&[
            ("charge_uc", [1000.0; N]),
            ("up_ns", [1e10; N]),
            ("battery_mah", [500.0; N]),
        ])),
        ..Step::default()
    }]);
    let summary = json!(kpis.summary());
    assert_eq!(summary["energy"]["battery_mah"], 500.0);
    assert_near(&summary["energy"]["network_lifetime_years"], 500.0 * 1000.0 / 100.0 / 8760.0);
    assert_near(&summary["motes"]["lifetime_years"][2], 500.0 * 1000.0 / 100.0 / 8760.0);
}

// KPI2: statistics before synchronisation.
#[test]
fn kpi2_motes_that_never_joined_and_never_drew_anything_have_no_figures() {
    let kpis = run(&[Step {
        statistics: Some(statistics(&[
            ("charge_uc", [0.0; N]),
            ("up_ns", [0.0; N]),
            ("radio_on_ns", [0.0; N]),
            ("first_joined_ns", [0.0; N]),
            ("parent_changes", [0.0; N]),
        ])),
        ..Step::default()
    }]);
    let summary = json!(kpis.summary());
    assert_eq!(summary["joining"]["joined"], Value::Null);
    assert_eq!(summary["delivery"], Value::Null);
    assert_eq!(summary["energy"]["mean_current_ua"]["mean"], Value::Null);
    assert_eq!(summary["energy"]["network_lifetime_years"], Value::Null);
    assert_eq!(summary["routing"]["churn_per_mote_hour"], Value::Null);
}

#[test]
fn joining_is_that_of_motes_that_joined_and_churn_is_per_mote_and_hour() {
    let kpis = run(&[Step {
        statistics: Some(statistics(&[
            ("is_root", [1.0, 0.0, 0.0]),
            ("first_joined_ns", [1.0, 4e9, 8e9]),
            ("first_synced_ns", [1.0, 3e9, 0.0]),
            ("parent_changes", [0.0, 3.0, 1.0]),
            ("up_ns", [7.2e12, 3.6e12, 3.6e12]),
        ])),
        ..Step::default()
    }]);
    let summary = json!(kpis.summary());
    let joined = &summary["joining"]["joined"];
    assert_eq!(joined["motes"], 2);
    for (key, expected) in [("first_s", 4.0), ("mean_s", 6.0), ("median_s", 6.0), ("last_s", 8.0)] {
        assert_near(&joined[key], expected);
    }
    assert_eq!(summary["joining"]["synced"]["motes"], 1);
    assert_near(&summary["routing"]["churn_per_mote_hour"], 2.0);
}

#[test]
fn a_network_without_protocols_has_no_indicators() {
    assert_eq!(Kpis::default().summary(), None);
}

#[test]
fn what_queues_did_not_keep_is_told_by_reason() {
    let queue_drops = |columns: &[(&str, [f64; N])]| {
        let step = Step { statistics: Some(statistics(columns)), ..Step::default() };
        json!(run(&[step]).summary())["queue_drops"].clone()
    };
    let both =
        queue_drops(&[("queue_drops", [1.0, 0.0, 2.0]), ("payloads_superseded", [5.0, 7.0, 0.0])]);
    assert_eq!(both, json!({ "txqueue_full": 3.0, "superseded": 12.0 }));
    let unknown = queue_drops(&[("is_root", [1.0, 0.0, 0.0])]);
    assert_eq!(unknown, json!({ "txqueue_full": null, "superseded": null }));
}

#[test]
fn what_ended_at_motes_is_told_by_reason_and_nothing_is_told_of_reasons_that_did_not_occur() {
    let drops_by_reason = |columns: &[(&str, [f64; N])]| {
        let step = Step { statistics: Some(statistics(columns)), ..Step::default() };
        json!(run(&[step]).summary())["drops_by_reason"].clone()
    };
    let known = drops_by_reason(&[
        ("drops_no_route", [0.0, 1.0, 2.0]),
        ("drops_killed", [0.0; N]),
        ("queue_drops", [4.0; N]),
    ]);
    assert_eq!(known, json!({ "no_route": 3.0 }));
    assert_eq!(drops_by_reason(&[("drops_killed", [0.0; N])]), json!({}));
    assert_eq!(drops_by_reason(&[("queue_drops", [4.0; N])]), Value::Null);
}

/// An application packet from every mote to the root, every 10 s.
const EVERY_10_S: &str =
    "[[app]]\nkind = \"periodic\"\nperiod_s = 10.0\nsenders = \"all\"\ndestination = \"root\"\n";

#[test]
fn pdr_of_a_network_that_one_of_two_motes_never_joined_counts_what_that_one_should_have_sent() {
    let ended: Vec<Ended> = (0..10).map(|k| (1, 0, 0, k, 1, 0)).collect();
    let mut kpis = run(&[Step {
        packets: Some(packets(10, &ended)),
        statistics: Some(statistics(&[
            ("is_root", [1.0, 0.0, 0.0]),
            ("up_ns", [1e11; N]),
            ("packets_created", [0.0, 11.0, 0.0]),
        ])),
        joined: Some([true, true, false]),
        ..Step::default()
    }]);
    assert_eq!(json!(kpis.summary())["delivered_of_expected"], Value::Null, "nothing is known");
    kpis = kpis.with_applications(Applications::from_config(EVERY_10_S));
    let summary = kpis.summary().unwrap();
    assert_near(&json!(summary)["delivery"]["ratio"], 1.0);
    // Ten of the mote that never joined; of the other the eleven that it created.
    let expected = summary.delivered_of_expected.clone().unwrap();
    assert_eq!([expected.delivered, expected.expected], [10, 21]);
    assert_eq!((expected.joined_at_end, expected.alive_at_end), (Some(2), 3));
    assert_eq!(json!(summary)["motes"]["expected"], json!([0.0, 11.0, 10.0]));
    // Robots that need not wait start with the run.
    let since = summary.since_start.delivered_of_expected.clone().unwrap();
    assert_eq!(summary.before_start(), None);
    // One step of ten seconds: a packet each is due, and ten of one mote ended.
    assert_eq!([since.delivered, since.expected], [10, 11]);
}

#[test]
fn of_packets_due_since_the_start_those_sent_before_count_for_neither() {
    let up = |up_s: f64, created: f64| {
        Some(statistics(&[
            ("is_root", [1.0, 0.0, 0.0]),
            ("up_ns", [1e9 * up_s; N]),
            ("packets_created", [0.0, created, 0.0]),
        ]))
    };
    // Created while the network formed, one delivered then and one afterwards, one lost; then one of each mote is due.
    let forming = packets(3, &[(1, 0, 1, 2, 1, 0), (1, 0, 3, 9, 1, 2)]);
    let moving = packets(4, &[(1, 0, 4, 11, 1, 0), (1, 0, 12, 13, 1, 0)]);
    let formed_ns = Some(9 * S);
    let kpis = run(&[
        Step {
            packets: Some(forming),
            held: true,
            formed_ns,
            statistics: up(10.0, 3.0),
            ..Step::default()
        },
        Step { packets: Some(moving), formed_ns, statistics: up(20.0, 4.0), ..Step::default() },
    ])
    .with_applications(Applications::from_config(EVERY_10_S));
    let summary = kpis.summary().unwrap();
    let since = summary.since_start.delivered_of_expected.clone().unwrap();
    assert_eq!([since.delivered, since.expected], [1, 2]);
    assert_near(&json!(since.ratio), 0.5);
    assert_eq!(summary.before_start(), Some([1, 2]));
    let whole = summary.delivered_of_expected.unwrap();
    assert_eq!([whole.delivered, whole.expected], [3, 6]);
}

#[test]
fn battery_mah_of_next_to_nothing_is_warned_of_where_it_kills_nobody() {
    let columns =
        [("is_root", [1.0, 0.0, 0.0]), ("charge_uc", [4e4, 4e4, 3e4]), ("battery_mah", [0.01; N])];
    let warnings = |columns: &[(&str, [f64; N])]| {
        run(&[Step { statistics: Some(statistics(columns)), ..Step::default() }]).warnings()
    };
    let [warning] = &warnings(&columns)[..] else { panic!("{:?}", warnings(&columns)) };
    assert!(warning.contains("mote 1)") && warning.contains("netsim.energy.deaths"), "{warning}");
    // Where empty motes fail, there is nothing to warn of.
    let dying = [&columns[..], &[("battery_empty", [0.0, 1.0, 0.0])]].concat();
    assert_eq!(warnings(&dying), [""; 0]);
}

#[test]
fn radio_on_and_lifetime_of_tiles_and_table_are_of_one_period() {
    let step = |charge_uc: f64, on_ns: f64, up_ns: f64, formed_ns| Step {
        statistics: Some(statistics(&[
            ("charge_uc", [charge_uc; N]),
            ("radio_on_ns", [on_ns; N]),
            ("up_ns", [up_ns; N]),
        ])),
        formed_ns,
        ..Step::default()
    };
    // Motes scan until they have formed; then their radios are on for a hundredth of the time.
    let formed = Some(5 * S);
    let kpis = run(&[
        step(1e4, 5e9, 5e9, formed),
        step(1e4, 1e10, 1e10, formed),
        step(1.1e4, 1.01e10, 2e10, formed),
    ]);
    let summary = kpis.summary().unwrap();
    let (energy, period) = summary.energy_shown().unwrap();
    let duty_cycles = &summary.motes[&format!("duty_cycle{}", period.suffix())];
    assert_eq!(period.words(), "since formation");
    assert_eq!(Some(duty_cycles[1].unwrap()), energy.duty_cycle.mean);
    assert!((duty_cycles[1].unwrap() - 0.01).abs() < 1e-12, "{duty_cycles:?}");
    let lifetimes = &summary.motes[&format!("lifetime_years{}", period.suffix())];
    assert_eq!(lifetimes[1], energy.network_lifetime_years);
    assert!(summary.motes["duty_cycle"][1] > duty_cycles[1]);
    // Without formation there is but the whole run.
    let forming = run(&[step(1e4, 5e9, 5e9, None)]).summary().unwrap();
    assert_eq!(forming.energy_shown().unwrap().1.words(), "whole run");
}
