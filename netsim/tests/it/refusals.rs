//! What is refused, and in which words.

use super::harness::{setup, started, text};
use netsim::catalogue::Catalogue;
use netsim::sim::Network;
use proto::config::{Node, parse};
use proto::side::{NetSimulator as _, Setup};

fn refusal(setup: &Setup) -> String {
    let mut network = Network::default();
    match network.configure(setup) {
        Err(problems) => text(&problems),
        Ok(_) => "accepted".to_owned(),
    }
}

fn refusal_of(config: &str) -> String {
    refusal(&setup(10, config))
}

#[test]
fn every_problem_is_named_at_once() {
    let config = "mod = \"propagation-only\"\nslot_duration_s = 0.03\nabsent = [3, 10, 3]\nhopping_sequence = [11, 27]\n\
        [phy]\npropagation = \"unit-disk\"\nraduis_m = 3\ntx_power_dbm = \"high\"\nmin_distance_m = -0.1\ncarrier_hz = nan\n\
        exponent = 2.0\n[phy.reception]\nkind = \"o-qpks\"\n[[phy.effect]]\nkind = \"shadowing\"\n[[phy.effect]]\n\
        sd_db = 2\n[[phy.effect]]\nkind = \"system-gain\"\ngain_db = 1000\n";
    let kinds = refusal_of("[[phy.effect]]\nkind = \"\"\n");
    let kinds = kinds
        .split_once("one of ")
        .expect("the error names the choices")
        .1
        .split_once(", got")
        .expect("one of them was given")
        .0;
    assert!(kinds.contains("\"hidden-obstacle\", \"interference\""), "{kinds}");
    insta::assert_snapshot!(refusal_of(config).replace(kinds, "the kinds of effects"), @r#"
    netsim.phy.radius_m: is missing: must be a number, greater than 0 and at most 10000000
    netsim.phy.tx_power_dbm: must be a number, from -100 to 60, got "high"
    netsim.phy.carrier_hz: must be a finite number, from 1000000 to 1000000000000, got NaN
    netsim.phy.min_distance_m: must be from 0.001 to 1000, got -0.1 (nearest valid: 0.001)
    netsim.phy.reception.kind: must be one of "table", "o-qpsk", "fsk", got "o-qpks" (nearest valid: "o-qpsk")
    netsim.phy.effect[0].sd_db: is missing: must be a number, from 0 to 20
    netsim.phy.effect[1].kind: is missing: one of the kinds of effects
    netsim.phy.effect[2].gain_db: must be from -100 to 100, got 1000 (nearest valid: 100)
    netsim.phy.raduis_m: is not a known key (nearest valid: radius_m)
    netsim.phy.exponent: does not apply with propagation = "unit-disk", only with "log-distance"
    netsim.mod: is not a known key (nearest valid: mode)
    netsim.slot_duration_s: must divide the control period, 0.1 s, into a whole number of slots, got 0.03 (nearest valid: 0.025)
    netsim.absent[1]: must be the number of a mote, 0 to 9, got 10 (nearest valid: 9)
    netsim.absent[2]: must not be listed twice, got 3
    netsim.hopping_sequence[1]: must be a channel of phy.standard = "o-qpsk-2450", a whole number from 11 to 26, got 27 (nearest valid: 26)
    "#);
}

#[test]
fn a_table_of_reception_must_rise() {
    let config = "[phy.reception]\npoints = [[-90, 0.5], [-95, 0.7], [-80, 0.6], [-70, 1.5]]\n";
    insta::assert_snapshot!(refusal_of(config), @r#"
    netsim.phy.reception.points[3]: must have a probability from 0 to 1, got 1.5 (nearest valid: 1)
    netsim.phy.reception.points[1]: must have a greater RSSI than the point before, -90, got -95
    netsim.phy.reception.points[2]: must have a probability of at least that of the point before, 0.7, got 0.6 (nearest valid: 0.7)
    "#);
    insta::assert_snapshot!(refusal_of("[phy.reception]\npoints = [[-90, 0.5]]\n"), @r#"netsim.phy.reception.points: must have 2 to 10000 entries, got [[-90, 0.5]]"#);
}

#[test]
fn negative_and_impossible_sizes_are_refused() {
    let config = "[phy]\npropagation = \"unit-disk\"\nradius_m = -3\n";
    insta::assert_snapshot!(refusal_of(config), @r#"netsim.phy.radius_m: must be greater than 0 and at most 10000000, got -3 (nearest valid: 3)"#);
    let config = "[phy]\npropagation = \"nearest-k\"\nk = -1\n";
    insta::assert_snapshot!(refusal_of(config), @r#"netsim.phy.k: must be a whole number from 0 to 1000000, got -1 (nearest valid: 0)"#);
    let config = "[phy]\npropagation = \"freis\"\n";
    insta::assert_snapshot!(refusal_of(config), @r#"netsim.phy.propagation: must be one of "experimental-randomness", "friis", "full", "gaussian", "line-of-sight", "log-distance", "nearest-k", "probabilistic-disk", "trace", "unit-disk", got "freis" (nearest valid: "friis")"#);
}

#[test]
fn a_trace_must_come_along_be_whole_and_fit_the_experiment() {
    let config = "[phy]\npropagation = \"trace\"\nfile = \"a.k7\"\n";
    insta::assert_snapshot!(refusal_of(config), @r#"netsim.phy.file: names a file whose content is missing; send it together with the configuration, got "a.k7""#);
    let mut setup = setup(10, config);
    setup.files.insert("a.k7".to_owned(), "{}".into());
    insta::assert_snapshot!(refusal(&setup), @r#"netsim.phy.file: is not a K7 trace: a.k7: line 1: must be a JSON object with start_date, stop_date, channels, node_count: missing field `start_date` at line 1 column 2"#);
    let text = "{\"start_date\": \"2018-01-11T16:32:22.0\", \"stop_date\": \"2018-01-11T16:42:22.0\", \
        \"channels\": [11, 12], \"node_count\": 2}\ndatetime,src,dst,channel,mean_rssi,pdr,tx_count\n";
    setup.files.insert("a.k7".to_owned(), text.into());
    insta::assert_snapshot!(refusal(&setup), @r#"
    netsim.phy.file: has 2 nodes, so the experiment must have as many agents, got 10 (nearest valid: 2)
    netsim.phy.file: was not measured on all channels of netsim.hopping_sequence: 16, 17, 23, 18, 26, 15, 25, 22, 19, 13, 24, 14, 20, 21 missing; the trace has the channels [11, 12]
    "#);
}

#[test]
fn what_has_no_influence_is_warned_of() {
    let config = "[phy]\npropagation = \"full\"\n[phy.reception]\nkind = \"o-qpsk\"\n";
    let (_, start) = started(&setup(2, config));
    insta::assert_snapshot!(start.warnings.join("\n"), @r#"netsim.phy.reception has no influence: propagation = "full" states itself what is received; choose a model of signal strength such as "log-distance", or leave the key out"#);
}

#[test]
fn a_radio_that_carries_no_payloads_has_no_influence() {
    let warnings = |config: &str| started(&setup(3, config)).1.warnings;
    let second = "[second_medium]\nkind = \"wifi-broadcast\"\npayloads = \"second\"\n";
    let phy = "[phy]\npropagation = \"log-distance\"\nexponent = 3.0\ntx_power_dbm = 0.0\n";
    let found = warnings(&format!("{phy}{second}"));
    let named: Vec<&str> = found.iter().filter_map(|warning| warning.split(' ').next()).collect();
    // Its power is the default, but written.
    assert_eq!(named, ["netsim.phy.tx_power_dbm"], "{found:?}");
    insta::assert_snapshot!(found[0], @r#"netsim.phy.tx_power_dbm has no influence: with netsim.second_medium.payloads = "second" the second medium carries all payloads; set netsim.second_medium.payloads = "both" or "main", or leave the key out"#);
    // Where the main network has something to carry, its radio counts.
    let none: [&str; 0] = [];
    assert_eq!(warnings(&format!("mode = \"6tisch\"\n{phy}{second}")), none);
    assert_eq!(warnings(&format!("{phy}{}", second.replace("\"second\"\n", "\"both\"\n"))), none);
    // And the other way round.
    let idle = second.replace("\"second\"\n", "\"main\"\nrange_m = 9.0\n");
    let found = warnings(&format!("{phy}{idle}"));
    assert!(
        found.len() == 1 && found[0].starts_with("netsim.second_medium.range_m has"),
        "{found:?}"
    );
}

#[test]
fn an_effective_configuration_is_warned_of_no_more_than_what_it_was_made_of() {
    let config = "[phy]\ntx_power_dbm = 3.0\n[second_medium]\nkind = \"wifi-broadcast\"\npayloads = \"second\"\n";
    let start = started(&setup(3, config)).1;
    assert_eq!(start.warnings.len(), 1, "{:?}", start.warnings);
    let again = started(&setup(3, &start.effective.to_string())).1;
    assert_eq!(again.warnings, start.warnings);
}

#[test]
fn an_effect_that_meets_nothing_of_its_kind_has_no_influence() {
    let warnings = |n: usize, effect: &str| {
        let config = format!("[phy]\npropagation = \"friis\"\n[[phy.effect]]\nkind = {effect}\n");
        started(&setup(n, &config)).1.warnings.join("\n")
    };
    insta::assert_snapshot!(warnings(3, "\"wall-attenuation\"\nloss_db = 3.0"), @"netsim.phy.effect[0] (wall-attenuation) has no influence: [site] has no walls; add [[site.wall]]");
    insta::assert_snapshot!(warnings(2, "\"body-blocking\"\nloss_db = 3.0"), @"netsim.phy.effect[0] (body-blocking) has no influence: no robot can be between two others; set experiment.agents to at least 3");
    assert_eq!(warnings(3, "\"body-blocking\"\nloss_db = 3.0"), "");
    // Where motes are is not known here.
    assert_eq!(warnings(3, "\"two-ray-ground\"\nrelative_permittivity = 15.0"), "");
}

#[test]
fn clocks_that_drift_must_be_kept() {
    let drifting = "mode = \"6tisch\"\n[mac]\nkeep_alive_s = 0\n";
    insta::assert_snapshot!(refusal_of(drifting), @r#"netsim.mac.max_drift_ppm: must be 0 with keep_alive_s = 0, because drifting clocks must be resynchronised, got 30 (nearest valid: 0)"#);
    assert_eq!(refusal_of(&format!("{drifting}max_drift_ppm = 0\n")), "accepted");
    assert_eq!(refusal_of("mode = \"6tisch\"\n"), "accepted");
}

#[test]
fn admission_beyond_one_hop_without_routes_down_is_warned_of() {
    let config = "mode = \"6tisch\"\n[rpl]\nroutes_down = false\n";
    let warnings = |n, config: &str| started(&setup(n, config)).1.warnings.join("\n");
    insta::assert_snapshot!(warnings(3, config), @r#"netsim.rpl.routes_down: without routes down the registrar's answers reach only motes that hear a root and join through it; others, who ask through a join proxy, are never admitted: set netsim.join.secure = false or netsim.rpl.routes_down = true"#);
    // Nobody is further away than one hop, or nobody must be admitted, or the answers find their way.
    assert_eq!(warnings(2, config), "");
    assert_eq!(warnings(3, &format!("{config}[join]\nsecure = false\n")), "");
    assert_eq!(warnings(3, "mode = \"6tisch\"\n"), "");
}

#[test]
fn applications_whose_frames_no_queue_holds_are_warned_of() {
    let warnings = |keys: &str| {
        let config = format!("mode = \"6tisch\"\n{keys}");
        started(&setup(3, &config)).1.warnings.join("\n")
    };
    let apps = "[[app]]\nkind = \"download\"\nblock_bytes = 1024\n[[app]]\nkind = \"coap\"\nresponse_bytes = 1000\n\
                [[app]]\npayload_bytes = 1000\n";
    insta::assert_snapshot!(warnings(apps), @r"
    netsim.app[0].block_bytes = 1024: a datagram takes at least 12 frames, more than a queue of netsim.mac.queue_frames = 10 holds, so that none arrives: set a smaller block_bytes, or netsim.mac.queue_frames to 0 or at least 12
    netsim.app[1].response_bytes = 1000: a datagram takes at least 11 frames, more than a queue of netsim.mac.queue_frames = 10 holds, so that none arrives: set a smaller response_bytes, or netsim.mac.queue_frames to 0 or at least 11
    netsim.app[2].payload_bytes = 1000: a datagram takes at least 11 frames, more than a queue of netsim.mac.queue_frames = 10 holds, so that none arrives: set a smaller payload_bytes, or netsim.mac.queue_frames to 0 or at least 11
    ");
    assert_eq!(warnings(&format!("[mac]\nqueue_frames = 0\n{apps}")), "");
    assert_eq!(warnings(&format!("[mac]\nqueue_frames = 20\n{apps}")), "");
    // The representation fits into a block of a fifth of that.
    assert_eq!(
        warnings("[[app]]\nkind = \"download\"\nblock_bytes = 1024\nsize_bytes = 200\n"),
        ""
    );
    let small = "[[app]]\nkind = \"download\"\nblock_bytes = 512\n[[app]]\nkind = \"coap\"\nresponse_bytes = 800\n\
                 [[app]]\npayload_bytes = 800\n";
    assert_eq!(warnings(small), "");
}

#[test]
fn settings_of_motes_that_move_which_change_nothing_or_shut_all_out_are_warned_of() {
    let warnings = |mobility: &str| {
        let config = format!("mode = \"6tisch\"\n{mobility}");
        started(&setup(3, &config)).1.warnings.join("\n")
    };
    let insecure = "[join]\nsecure = false\n[mobility]\nkeep_admission = true\n";
    insta::assert_snapshot!(warnings(insecure), @"netsim.mobility.keep_admission has no influence: with netsim.join.secure = false nobody needs admission; set netsim.join.secure = true, or leave the key out");
    assert_eq!(warnings("[mobility]\nkeep_admission = true\n"), "");
    insta::assert_snapshot!(warnings("[mobility]\nleaves = [1, 2]\n"), @"netsim.mobility.leaves: all motes but roots are leaves: only those that hear a root take part");
    assert_eq!(warnings("[mobility]\nleaves = [2]\n"), "");
}

#[test]
fn the_effective_configuration_is_complete_and_means_the_same() {
    let (_, start) = started(&setup(10, ""));
    insta::assert_snapshot!(start.effective.to_string(), @r#"
    mode = "propagation-only"
    slot_duration_s = 0.01

    [phy]
    propagation = "friis"
    tx_power_dbm = 0.0
    tx_antenna_gain_dbi = 0.0
    rx_antenna_gain_dbi = 0.0
    carrier_hz = 2440000000.0
    min_distance_m = 0.1

    [phy.reception]
    kind = "table"

    [phy.interference]
    kind = "o-qpsk"
    noise_floor_dbm = -105.0
    co_channel_rejection_db = 3.0
    "#);
    for config in [
        "",
        "[phy]\npropagation = \"log-distance\"\nexponent = 3",
        "absent = [1]\n[[phy.effect]]\nkind = \"shadowing\"\nsd_db = 2",
    ] {
        let (first, start) = started(&setup(10, config));
        let (again, _) = started(&setup(10, &start.effective.to_string()));
        assert_eq!(first.snapshot(), again.snapshot(), "{config}");
    }
}

#[test]
fn files_are_listed_before_they_are_read() {
    let node: Node = parse("[phy]\npropagation = \"trace\"\nfile = \"a.k7\"\n").unwrap();
    let files = netsim::config::files(&node, "netsim", Catalogue::built_in());
    assert_eq!(files.len(), 1);
    assert_eq!((files[0].key.as_str(), files[0].path.as_str()), ("netsim.phy.file", "a.k7"));
    assert_eq!(netsim::config::files(&Node::empty_table(), "netsim", Catalogue::built_in()), []);
}

#[test]
fn a_failed_configuration_leaves_the_simulator_as_it_was() {
    let (mut network, _) = started(&setup(10, ""));
    let before = network.snapshot();
    assert!(network.configure(&setup(10, "slot_duration_s = 0.03")).is_err());
    assert_eq!(network.snapshot(), before);
}

#[test]
fn the_schema_lists_every_model_and_effect() {
    let schema = Network::default().config_schema_json();
    for entry in Catalogue::built_in().physics.propagation.iter() {
        assert!(schema.contains(&format!("{:?}", entry.variant.name)), "{}", entry.variant.name);
    }
    for entry in Catalogue::built_in().physics.effects.iter() {
        assert!(schema.contains(&format!("{:?}", entry.variant.name)), "{}", entry.variant.name);
    }
}

#[test]
fn slots_shorter_than_a_frame_and_its_acknowledgment_are_refused() {
    let short = "mode = \"6tisch\"\nslot_duration_s = 0.005\n";
    insta::assert_snapshot!(refusal_of(short), @"netsim.slot_duration_s: must be at least 0.009776 s with mode = \"6tisch\", the duration of the longest frame and its acknowledgment, got 0.005 (nearest valid: 0.01)");
    assert_eq!(refusal_of("slot_duration_s = 0.005\n"), "accepted");
}

#[test]
fn a_round_robin_whose_root_cannot_answer_everybody_is_warned_of() {
    let config = "mode = \"6tisch\"\nsf.kind = \"rrsf\"\n";
    let warnings = |n, config: &str| {
        let mut setup = setup(n, config);
        setup.experiment.step_ns = n as u64 * 10_000_000;
        started(&setup).1.warnings.join("\n")
    };
    assert_eq!(warnings(400, config), "");
    let slow = warnings(500, config);
    assert!(
        slow.contains(
            "5 s: admitting all motes and acknowledging their routes takes at least 5000 s"
        ),
        "{slow}"
    );
    assert_eq!(warnings(500, &format!("{config}join.secure = false\nrpl.dao_ack = false\n")), "");
}

#[test]
fn a_scheduling_function_that_is_none_is_one_problem() {
    let config = "mode = \"6tisch\"\nsf.kind = \"msff\"\nswarm.transport = \"own-cell\"\n";
    insta::assert_snapshot!(refusal_of(config), @r#"netsim.sf.kind: must be one of "minimal", "msf", "llsf", "emsf", "rrsf", "sotdma", "orchestra", "alice", "static", "oracle", got "msff" (nearest valid: "msf")"#);
}

#[test]
fn a_network_needs_a_root_that_is_there() {
    insta::assert_snapshot!(refusal_of("mode = \"6tisch\"\nabsent = [0, 3]\n"), @"netsim.absent: must not list every root, because motes need a root to join a network, got [0, 3]");
    assert_eq!(refusal_of("mode = \"6tisch\"\nabsent = [0, 3]\nroots = [0, 5]\n"), "accepted");
    assert_eq!(refusal_of("absent = [0]\n"), "accepted");
}

#[test]
fn a_broadcast_slotframe_that_is_not_there_or_too_short_is_warned_of() {
    let warnings = |config: &str| {
        started(&setup(10, &format!("mode = \"6tisch\"\n{config}"))).1.warnings.join("\n")
    };
    insta::assert_snapshot!(warnings("sf.kind = \"rrsf\"\nswarm = { slots = 5, channel_offset = 1 }\n"), @r#"
    netsim.swarm.slots has no influence: transport = "own-cell" has no broadcast slotframe; set netsim.swarm.transport = "broadcast-slotframe", or leave the key out
    netsim.swarm.channel_offset has no influence: transport = "own-cell" has no broadcast slotframe; set netsim.swarm.transport = "broadcast-slotframe", or leave the key out
    "#);
    insta::assert_snapshot!(warnings("swarm.slots = 5\n"), @"netsim.swarm.slots = 5 for 10 motes: several share a slot, and whoever hears two of them receives one at most");
    assert_eq!(warnings("swarm.slots = 10\n"), "");
}

#[test]
fn a_key_that_is_none_is_refused_with_its_length() {
    let config = "mode = \"6tisch\"\n[security]\nk1 = \"00112233\"\nk2 = \"0011223344556677 8899aabbccddeef\"\njoin_key = \"ü\"\n";
    insta::assert_snapshot!(refusal_of(config), @r#"
    netsim.security.k1: must be 32 hexadecimal digits: a key of 128 bits, got "00112233" of length 8
    netsim.security.k2: must be 32 hexadecimal digits: a key of 128 bits, got "0011223344556677 8899aabbccddeef" of length 32
    netsim.security.join_key: must be 32 hexadecimal digits: a key of 128 bits, got "ü" of length 1
    "#);
}
