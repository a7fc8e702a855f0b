//! Physical layers other than 2.4 GHz: frequencies, slots, captures, and a network that forms on them.

use super::harness::{STEP_NS, reading_dbm, setup, standing_at, started, step_with, text};
use netsim::sim::Network;
use proto::side::NetSimulator as _;
use proto::types::NetRecord;

fn refusal(config: &str) -> String {
    let mut network = Network::default();
    match network.configure(&setup(3, config)) {
        Err(problems) => text(&problems),
        Ok(_) => "accepted".to_owned(),
    }
}

#[test]
fn val_a_frame_arrives_with_friis_power_at_the_frequency_of_its_band() {
    // 20 log10(c / (4 π d f)): 0 dBm over 10 m in the middle of each band.
    for (standard, hz) in [
        ("o-qpsk-868", 868.3e6),
        ("o-qpsk-915", 915.0e6),
        ("sun-fsk-863", 866.425e6),
        ("sun-fsk-902", 915.0e6),
    ] {
        let config = format!("[phy]\nstandard = {standard:?}");
        let got = reading_dbm(&config, 10.0).expect("it is heard");
        let expected = 20.0 * (299_792_458.0 / (4.0 * std::f64::consts::PI * 10.0 * hz)).log10();
        assert!((f64::from(got) - expected).abs() < 1e-4, "{standard}: {got} {expected}");
        // On a channel: that of the channel. Slot 0 is on the first one.
        let config = format!("hopping_sequence = [1]\n[phy]\nstandard = {standard:?}");
        if standard == "o-qpsk-915" {
            let got = reading_dbm(&config, 10.0).expect("it is heard");
            let expected = expected + 20.0 * (915.0f64 / 906.0).log10();
            assert!((f64::from(got) - expected).abs() < 1e-4, "{got} {expected}");
        }
    }
}

#[test]
fn what_does_not_go_with_a_physical_layer_is_refused_with_the_nearest_valid_value() {
    let network = "mode = \"6tisch\"\n";
    let fsk = "[phy]\nstandard = \"sun-fsk-863\"\n";
    insta::assert_snapshot!(refusal(&format!("{network}{fsk}")), @r#"netsim.slot_duration_s: must be at least 0.03704 s with mode = "6tisch", the duration of the longest frame and its acknowledgment, got 0.01 (nearest valid: 0.05)"#);
    assert_eq!(refusal(&format!("{network}slot_duration_s = 0.05\n{fsk}")), "accepted");
    insta::assert_snapshot!(refusal(&format!("hopping_sequence = [3, 34]\n{fsk}")), @r#"netsim.hopping_sequence[1]: must be a channel of phy.standard = "sun-fsk-863", a whole number from 0 to 33, got 34 (nearest valid: 33)"#);
    insta::assert_snapshot!(refusal(&format!("{fsk}[phy.reception]\nkind = \"o-qpsk\"")), @r#"netsim.phy.reception.kind: does not apply with standard = "sun-fsk-863", because it describes receivers of another physical layer, got "o-qpsk" (nearest valid: "fsk")"#);
    insta::assert_snapshot!(refusal("[phy]\nstandard = \"sun-fsk\""), @r#"netsim.phy.standard: must be one of "o-qpsk-2450", "o-qpsk-868", "o-qpsk-915", "sun-fsk-863", "sun-fsk-902", got "sun-fsk" (nearest valid: "sun-fsk-902")"#);
}

#[test]
fn interference_that_meets_no_channel_is_warned_of() {
    let warnings = |standard: &str, channels: &str, effect: &str| {
        let config = format!(
            "{channels}\n[phy]\nstandard = {standard:?}\n[[phy.effect]]\nkind = \"interference\"\n\
             duty = 0.5\n{effect}"
        );
        started(&setup(3, &config)).1.warnings
    };
    let wifi = "centre_mhz = 2437.0";
    assert_eq!(warnings("o-qpsk-2450", "hopping_sequence = [11, 16]", wifi), Vec::<String>::new());
    // Channel 26 lies at 2480 MHz.
    let beside = |instead: &str| {
        vec![format!(
            "netsim.phy.effect[0] (interference) has no influence: no channel of the hopping sequence lies between 2426 and \
             2448 MHz; {instead}"
        )]
    };
    let others = beside(
        "move the band, or add one of the channels 16, 17, 18, 19 to netsim.hopping_sequence",
    );
    assert_eq!(warnings("o-qpsk-2450", "hopping_sequence = [26]", wifi), others);
    let beside = beside("phy.standard has no channel there either, so move the band");
    assert_eq!(warnings("o-qpsk-868", "hopping_sequence = [0]", wifi), beside);
    assert_eq!(
        warnings(
            "o-qpsk-868",
            "hopping_sequence = [0]",
            &format!("{wifi}\nonly = {{ nodes = [1] }}")
        ),
        beside
    );
    let own_band = "centre_mhz = 868.0\nwidth_mhz = 2.0";
    assert_eq!(warnings("o-qpsk-868", "hopping_sequence = [0]", own_band), Vec::<String>::new());
    let without = "netsim.phy.effect[0] (interference) has no influence: frames have no channel; set netsim.hopping_sequence";
    assert_eq!(warnings("o-qpsk-2450", "", wifi), [without]);
}

#[test]
fn the_physical_layer_of_today_stated_or_not_is_the_same_network() {
    let stated = |config: &str| started(&setup(3, config)).1.effective;
    let mut with = stated("[phy]\nstandard = \"o-qpsk-2450\"");
    let phy = with.get_mut("phy").and_then(toml::Value::as_table_mut).unwrap();
    assert!(phy.remove("standard").is_some());
    assert_eq!(with, stated(""));
}

#[test]
fn an_effective_configuration_is_read_as_the_one_it_came_from() {
    for standard in ["o-qpsk-868", "o-qpsk-915", "sun-fsk-863", "sun-fsk-902"] {
        let config = format!("[phy]\nstandard = {standard:?}");
        let (network, start) = started(&setup(3, &config));
        let again = started(&setup(3, &start.effective.to_string())).1;
        assert_eq!(again.effective, start.effective);
        assert_eq!(again.warnings, start.warnings);
        Network::default().restore(&network.snapshot()).unwrap();
    }
}

/// Frames of a capture: channel, page, and length of the PSDU.
fn frames(capture: &[u8]) -> Vec<(u16, u8, usize)> {
    let mut frames = Vec::new();
    let mut rest = capture;
    while !rest.is_empty() {
        let length = u32::from_le_bytes(rest[8..12].try_into().expect("4 bytes")) as usize;
        let record = &rest[16..16 + length];
        let fields = usize::from(u16::from_le_bytes([record[2], record[3]]));
        // FCS type takes 8 bytes after the header of 4, then the channel.
        assert_eq!(record[12..16], [3, 0, 3, 0]);
        frames.push((u16::from_le_bytes([record[16], record[17]]), record[18], length - fields));
        rest = &rest[16 + length..];
    }
    frames
}

#[test]
fn a_network_forms_on_every_physical_layer_and_its_captures_name_it() {
    for (standard, slot_s, page) in [
        ("o-qpsk-2450", 0.01, 0),
        ("o-qpsk-868", 0.02, 2),
        ("o-qpsk-915", 0.01, 2),
        ("sun-fsk-863", 0.05, 9),
        ("sun-fsk-902", 0.05, 9),
    ] {
        let config = format!(
            "mode = \"6tisch\"\nslot_duration_s = {slot_s}\n[phy]\nstandard = {standard:?}\n[sf]\nkind = \"minimal\"\n\
             slotframe_slots = 5\n[mac]\nbeacon_wait_s = 5\nbeacon_period_s = 2\n[swarm]\ntransport = \"none\"\n"
        );
        let mut setup = setup(3, &config);
        setup.records = vec![NetRecord::Capture, NetRecord::Statistics];
        let (mut network, _) = started(&setup);
        let states = standing_at(&[(0.0, 0.0), (20.0, 0.0), (0.0, 20.0)]);
        let mut formed_ns = None;
        let mut captured = Vec::new();
        for k in 0..3000 {
            let output =
                step_with(&mut network, &states, k * STEP_NS, (k + 1) * STEP_NS, &[], false);
            captured.extend(frames(&output.capture));
            formed_ns = output.formation.unwrap().formed_ns;
            if formed_ns.is_some() {
                break;
            }
        }
        assert!(formed_ns.is_some(), "{standard}");
        assert!(captured.iter().all(|&(_, of, _)| of == page), "{standard}");
        let last = [("o-qpsk-2450", 26), ("o-qpsk-868", 0), ("o-qpsk-915", 10)];
        let last = last.iter().find(|(name, _)| *name == standard).map_or(128, |&(_, last)| last);
        assert!(captured.iter().all(|&(channel, ..)| channel <= last), "{standard}");
        assert!(20 < captured.len(), "{standard}");
    }
}

#[test]
fn a_radio_at_50_kbit_s_is_on_five_times_as_long_for_each_byte() {
    let on_ns = |standard: &str| {
        let config = format!(
            "mode = \"6tisch\"\nslot_duration_s = 0.05\n[phy]\nstandard = {standard:?}\npropagation = \"full\"\n[sf]\n\
             kind = \"minimal\"\nslotframe_slots = 5\n[mac]\nbeacon_wait_s = 5\nbeacon_period_s = 2\n[swarm]\ntransport = \"none\"\n"
        );
        let mut setup = setup(1, &config);
        setup.records = vec![NetRecord::Statistics];
        let (mut network, _) = started(&setup);
        let states = standing_at(&[(0.0, 0.0)]);
        let output = network.step(&proto::side::NetInput {
            step: 1,
            from_ns: 0,
            until_ns: 600 * STEP_NS,
            states: &states,
            payloads: &super::harness::payloads(1),
            moved_obstacles: &[],
            commands: &[],
            stop_at_first_delivery: false,
            records: &[NetRecord::Statistics],
        });
        let columns = output.statistics.unwrap().columns;
        let value =
            |name: &str| columns.iter().find(|column| column.name == name).unwrap().values[0];
        // The rest is spent on idle listening, the same for both.
        (value("radio_on_ns") - 2_200_000.0 * value("idle_listen_slots"), value("tx_frames"))
    };
    let (fast, fast_frames) = on_ns("o-qpsk-2450");
    let (slow, slow_frames) = on_ns("sun-fsk-863");
    assert_eq!(fast_frames, slow_frames, "the same draws");
    assert!(10.0 < fast_frames);
    // Frames of n bytes: (6 + n) 32 µs against (8 + n) 160 µs.
    let n_bytes = fast / fast_frames / 32_000.0 - 6.0;
    let expected = (8.0 + n_bytes) * 160_000.0 * slow_frames;
    assert!((slow - expected).abs() < 1e-6 * expected, "{slow} {expected}");
}
