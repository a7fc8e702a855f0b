//! When frames are sent, who speaks, orders, and the columns of deliveries.

use super::harness::{
    STEP_NS, interval, network, pairs, pairs_of, payloads, period, setup, site, standing_at,
    started, step_with,
};
use proto::side::{NetInput, NetSimulator as _};
use proto::types::{
    Bitmap, DeliveryColumn, Heard, Medium, MoteCommand, MoteOrder, MovedObstacle, NetRecord,
    Payloads,
};

fn order(order: MoteOrder) -> MoteCommand {
    MoteCommand { source: "test".to_owned(), order }
}

#[test]
fn every_agent_sends_once_in_its_slot_and_nobody_hears_itself() {
    let mut network = network(23, "[phy]\npropagation = \"full\"");
    let states = standing_at(&[(0.0, 0.0); 23]);
    let output = period(&mut network, &states, 4);
    assert_eq!(output.time_ns, 5 * STEP_NS);
    let sent = &output.deliveries.transmissions;
    // Ten slots: 0, 10 and 20 in the first, 1, 11 and 21 in the second.
    assert_eq!(sent.sender[..5], [0, 10, 20, 1, 11]);
    assert_eq!(sent.len(), 23);
    for i in 0..23 {
        let sent_ns = 4 * STEP_NS + u64::from(sent.sender[i] % 10) * 10_000_000;
        assert_eq!((sent.sent_ns[i], sent.end_ns[i]), (sent_ns, sent_ns + 10_000_000));
    }
    for (i, payload) in sent.payloads.iter().enumerate() {
        assert_eq!(payload, sent.sender[i].to_le_bytes());
    }
    let expected: Vec<(u32, u32)> = (0..23)
        .flat_map(|receiver| (0..23).map(move |sender| (receiver, sender)))
        .filter(|(receiver, sender)| receiver != sender)
        .collect();
    assert_eq!(pairs(&output.deliveries), expected);
    // 23 rows of 3 bytes are shorter than 506 indices.
    assert!(matches!(output.deliveries.heard, Heard::Rows { .. }));
}

#[test]
fn who_says_nothing_is_dead_or_has_failed_does_not_send() {
    let mut network = network(5, "absent = [4]\n[phy]\npropagation = \"full\"");
    let mut states = standing_at(&[(0.0, 0.0); 5]);
    states.alive = Bitmap::filled(5, true);
    states.alive.set(1, false);
    let payloads = Payloads::new(vec![1, 1, 0, 1, 1], vec![7; 4].into()).unwrap();
    let mut run = |step: u64, commands: &[MoteCommand]| {
        let output = network.step(&NetInput {
            step,
            from_ns: (step - 1) * STEP_NS,
            until_ns: step * STEP_NS,
            states: &states,
            payloads: &payloads,
            moved_obstacles: &[],
            commands,
            stop_at_first_delivery: false,
            records: &[],
        });
        let alive: Vec<usize> = output.motes.alive.iter_ones().collect();
        (output.deliveries.transmissions.sender.clone(), pairs_of(&output.deliveries, 5), alive)
    };
    // 1 is dead, 2 has nothing to say, 4 is left out.
    let (senders, heard, alive) = run(1, &[]);
    assert_eq!((senders, alive), (vec![0, 3], vec![0, 1, 2, 3]));
    assert_eq!(heard, [(0, 3), (2, 0), (2, 3), (3, 0)]);
    let (senders, heard, alive) = run(2, &[order(MoteOrder::Kill(3)), order(MoteOrder::Add(4))]);
    assert_eq!((senders, alive), (vec![0, 4], vec![0, 1, 2, 4]));
    assert_eq!(heard, [(0, 4), (2, 0), (2, 4), (4, 0)]);
    let (senders, _, alive) = run(3, &[order(MoteOrder::Revive(3))]);
    assert_eq!((senders, alive), (vec![0, 3, 4], vec![0, 1, 2, 3, 4]));
}

#[test]
fn a_step_may_end_at_its_first_delivery() {
    let mut network = network(12, "[phy]\npropagation = \"unit-disk\"\nradius_m = 1");
    // Only 7 and 8 are near each other.
    let places: Vec<(f64, f64)> =
        (0..12).map(|i| (if i == 8 { 70.5 } else { 10.0 * f64::from(i) }, 0.0)).collect();
    let states = standing_at(&places);
    let output = step_with(&mut network, &states, 0, STEP_NS, &[], true);
    assert_eq!(output.time_ns, 80_000_000, "the end of slot 7");
    let sent = &output.deliveries.transmissions;
    assert_eq!(sent.sender, [0, 10, 1, 11, 2, 3, 4, 5, 6, 7]);
    assert_eq!(pairs_of(&output.deliveries, 12), [(8, 7)]);
    let output = step_with(&mut network, &states, 80_000_000, STEP_NS, &[], true);
    assert_eq!(output.time_ns, 90_000_000);
    assert_eq!(pairs_of(&output.deliveries, 12), [(7, 8)]);
    // The rest of the period brings nothing: the step runs to its end.
    let output = step_with(&mut network, &states, 90_000_000, STEP_NS, &[], true);
    assert_eq!((output.time_ns, output.deliveries.transmissions.sender), (STEP_NS, vec![9]));
    // Not beyond what was asked for.
    let output = step_with(&mut network, &states, STEP_NS, STEP_NS + 71_000_000, &[], true);
    assert_eq!(output.time_ns, STEP_NS + 71_000_000);
    assert_eq!(pairs_of(&output.deliveries, 12), [(8, 7)]);
}

#[test]
fn stopping_at_deliveries_brings_the_same_frames() {
    let config = "[phy]\npropagation = \"experimental-randomness\"\ntx_power_dbm = -20";
    let states = standing_at(&[(0.0, 0.0), (9.0, 2.0), (20.0, 3.0), (4.0, 30.0), (7.0, -12.0)]);
    let mut plain = network(5, config);
    let mut event = network(5, config);
    let mut expected = Vec::new();
    for k in 0..50 {
        expected.extend(pairs_of(&period(&mut plain, &states, k).deliveries, 5));
    }
    let mut got = Vec::new();
    let mut time_ns = 0;
    while time_ns < 50 * STEP_NS {
        let until_ns = (time_ns / STEP_NS + 1) * STEP_NS;
        let output = step_with(&mut event, &states, time_ns, until_ns, &[], true);
        assert!(time_ns < output.time_ns && output.time_ns <= until_ns);
        got.extend(pairs_of(&output.deliveries, 5));
        time_ns = output.time_ns;
    }
    expected.sort_unstable();
    got.sort_unstable();
    assert_eq!(got, expected);
    assert!(100 < got.len(), "{}", got.len());
}

#[test]
fn optional_columns_are_filled_in_on_request() {
    let mut setup = setup(70, "[phy]\npropagation = \"unit-disk\"\nradius_m = 2");
    setup.columns = vec![
        DeliveryColumn::ReceivedNs,
        DeliveryColumn::RssiDbm,
        DeliveryColumn::Hops,
        DeliveryColumn::Medium,
    ];
    let places: Vec<(f64, f64)> = (0..70).map(|i| (1.5 * f64::from(i), 0.0)).collect();
    let (mut network, _) = started(&setup);
    // Two periods in one step.
    let deliveries = interval(&mut network, &standing_at(&places), 0, 2 * STEP_NS).deliveries;
    assert_eq!(deliveries.n_deliveries(), 2 * 2 * 69);
    let mut i = 0;
    for receiver in 0..70 {
        for frame in deliveries.heard_by(receiver) {
            assert_eq!(deliveries.received_ns[i], deliveries.transmissions.end_ns[frame]);
            // Friis at 1.5 m and 2.44 GHz; f32.
            assert!((deliveries.rssi_dbm[i] - -43.718).abs() < 1e-3, "{}", deliveries.rssi_dbm[i]);
            i += 1;
        }
    }
    assert_eq!(deliveries.hops, vec![1; 276]);
    assert_eq!(deliveries.medium, vec![Medium::Radio; 276]);
    let ordered = deliveries.transmissions.sent_ns.windows(2).all(|pair| pair[0] <= pair[1]);
    assert!(ordered && deliveries.transmissions.len() == 140);
}

#[test]
fn an_obstacle_that_moves_blocks_where_it_now_is() {
    let mut setup = setup(2, "[phy]\npropagation = \"line-of-sight\"");
    setup.site = site("[[obstacle]]\nname = \"cart\"\ncentre_m = [50, 50]\nradius_m = 1");
    let (mut network, _) = started(&setup);
    let states = standing_at(&[(0.0, 0.0), (10.0, 0.0)]);
    let mut run = |moved: &[MovedObstacle]| {
        let input = NetInput {
            step: 1,
            from_ns: 0,
            until_ns: STEP_NS,
            states: &states,
            payloads: &payloads(2),
            moved_obstacles: moved,
            commands: &[],
            stop_at_first_delivery: false,
            records: &[],
        };
        network.step(&input).deliveries.n_deliveries()
    };
    assert_eq!(run(&[]), 2);
    assert_eq!(run(&[MovedObstacle { name: "cart".to_owned(), centre_m: [5.0, 0.5] }]), 0);
    assert_eq!(run(&[]), 0, "it stays there");
}

#[test]
fn a_trace_is_replayed_on_the_hopping_sequence() {
    let rows: String = (11..=26)
        .map(|channel| {
            let pdr = if channel == 17 { 1 } else { 0 };
            format!("2018-01-11T16:32:22.0,0,1,{channel},-70,{pdr},100\n")
        })
        .collect();
    let text = format!(
        "{{\"start_date\": \"2018-01-11T16:32:22.0\", \"stop_date\": \"2018-01-11T16:42:22.0\", \
         \"channels\": [11,12,13,14,15,16,17,18,19,20,21,22,23,24,25,26], \"node_count\": 2}}\n\
         datetime,src,dst,channel,mean_rssi,pdr,tx_count\n{rows}"
    );
    let mut setup = setup(2, "[phy]\npropagation = \"trace\"\nfile = \"a.k7\"");
    setup.files.insert("a.k7".to_owned(), text.into_bytes().into());
    setup.columns = vec![DeliveryColumn::RssiDbm];
    let (mut network, start) = started(&setup);
    assert_eq!(
        start.warnings,
        [
            "a.k7 lasts 600 s, from time 0 on, formation included: in a longer run every link then stays as its last row says"
        ]
    );
    let states = standing_at(&[(0.0, 0.0); 2]);
    // Agent 0 sends at slots 0, 10, 20, ...: sequence positions 0, 10, 4, 14, 8, 2, 12, 6. Channel 17 stands at 1: never.
    for k in 0..8 {
        assert_eq!(period(&mut network, &states, k).deliveries.n_deliveries(), 0, "{k}");
    }
    // With a sequence whose first is 17 every eighth of its frames gets through.
    setup
        .config
        .set(
            "hopping_sequence",
            proto::config::Value::from(&toml::Value::Array(
                [17, 16, 23, 18, 26, 15, 25, 22, 19, 11, 12, 13, 24, 14, 20, 21]
                    .map(toml::Value::Integer)
                    .to_vec(),
            )),
        )
        .unwrap();
    let (mut network, _) = started(&setup);
    for k in 0..16 {
        let deliveries = period(&mut network, &states, k).deliveries;
        assert_eq!(deliveries.n_deliveries(), usize::from(k % 8 == 0), "{k}");
        assert_eq!(deliveries.rssi_dbm, vec![-70.0; deliveries.n_deliveries()]);
    }
}

#[test]
fn a_payload_that_was_not_sent_before_the_next_came_is_counted() {
    // Ten slots to a period, thirty to the slotframe of payloads: of three one is sent.
    let mut setup = setup(
        3,
        "mode = \"6tisch\"\nswarm.slots = 30\njoin.secure = false\n[phy]\npropagation = \"full\"",
    );
    setup.records = vec![NetRecord::Statistics];
    let (mut network, _) = started(&setup);
    let states = standing_at(&[(0.0, 0.0); 3]);
    let payloads = payloads(3);
    let (mut n_sent, mut superseded) = (0, Vec::new());
    for step in 1..=3000 {
        let output = network.step(&NetInput {
            step,
            from_ns: (step - 1) * STEP_NS,
            until_ns: step * STEP_NS,
            states: &states,
            payloads: &payloads,
            moved_obstacles: &[],
            commands: &[],
            stop_at_first_delivery: false,
            records: if step == 3000 { &[NetRecord::Statistics] } else { &[] },
        });
        n_sent += output.deliveries.transmissions.sender.iter().filter(|&&mote| mote == 0).count();
        if let Some(statistics) = output.statistics {
            let mut columns = statistics.columns.into_iter();
            let column = columns.find(|column| column.name == "payloads_superseded");
            superseded = column.expect("counted").values;
        }
    }
    // The root speaks from the beginning; its last payload may still wait.
    let n_waiting = 3000.0 - n_sent as f64 - superseded[0];
    assert!((999..=1000).contains(&n_sent), "{n_sent}");
    assert!((0.0..=1.0).contains(&n_waiting), "{n_sent} {superseded:?}");
}
