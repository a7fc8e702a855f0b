//! C1 to C7, B1, B3, B4: who hears whom, acknowledgments, traces.

use super::bench::{Bench, EAGER, LINE, What, line, own_cells, set_up, trace};
use crate::harness::{network, pairs_of, period, reading_dbm, standing_at, text};
use netsim::catalogue::Catalogue;
use physics::End;
use physics::asn::Asn;
use physics::medium::links::Links;
use physics::medium::slot::Sent;
use physics::propagation::friis::friis_dbm;
use physics::reception::{Curve as _, table::Table};
use proto::ids::MoteId;
use std::sync::Arc;

#[test]
fn c1_on_a_line_of_six_next_neighbours_hear_each_other_on_every_channel() {
    let config = "[phy]\npropagation = \"unit-disk\"\nradius_m = 15.0\nrssi_dbm = -10.0\n";
    let (config, ..) = netsim::config::read(&set_up(6, config, 1), Catalogue::built_in()).unwrap();
    let mut links = Links::new(Arc::clone(&config.model), 1, &config.hopping_sequence, None);
    let ends: Vec<End> =
        (0..6).map(|mote| End::new(MoteId(mote), [10.0 * f64::from(mote), 0.0, 0.0])).collect();
    links.set_positions(0, &ends, &[0.0; 6]);
    for channel in 11..27 {
        for (sender, receiver) in (0..6).flat_map(|one| (0..6).map(move |other| (one, other))) {
            let sent = Sent { sender: MoteId(sender), channel, sent_ns: 0, end_ns: 4_000_000 };
            let arrival = links.arrival(sent, MoteId(receiver));
            if sender.abs_diff(receiver) == 1 {
                assert_eq!((arrival.reception_probability, arrival.rssi_dbm), (1.0, -10.0));
            } else {
                assert!(arrival.is_nothing(), "{sender} to {receiver} on {channel}");
            }
        }
    }
}

#[test]
fn c1_in_a_network_on_a_line_nobody_hears_beyond_the_next_neighbour() {
    let links: Vec<(usize, usize)> = (1..6).map(|mote| (mote, mote - 1)).collect();
    let mut bench = Bench::new(&line(6), &format!("{LINE}{EAGER}{}", own_cells(6, &links)));
    bench.form();
    let heard = bench.run(50_000).heard_links.unwrap();
    let pairs: Vec<(u32, u32)> =
        heard.receiver.iter().copied().zip(heard.sender.iter().copied()).collect();
    assert_eq!(pairs.len(), 10);
    assert!(pairs.iter().all(|(one, other)| one.abs_diff(*other) == 1));
}

#[test]
fn c3_levels_depend_on_the_seed_and_not_on_the_scheduling_function() {
    // Coordinates are the robots' business; what the network draws of a topology are the levels of its links.
    let places = [0.0, 2.0, 4.0, 6.0].map(|x_m| (x_m, 0.0));
    let levels = |sf: &str, seed: u64| {
        let phy = "[phy]\npropagation = \"experimental-randomness\"\nredraw = \"frozen\"\n";
        let mut bench =
            Bench::seeded(&places, &format!("{phy}{EAGER}[sf]\nkind = \"{sf}\"\n"), seed);
        bench.form();
        let heard = bench.run(10_000).heard_links.unwrap();
        let mut levels: Vec<((u32, u32), f32)> = (0..heard.receiver.len())
            .map(|i| ((heard.receiver[i], heard.sender[i]), heard.rssi_dbm[i]))
            .collect();
        levels.sort_by_key(|(pair, _)| *pair);
        levels
    };
    let minimal = levels("minimal", 3);
    assert_eq!(minimal.len(), 12);
    for (other, differs) in [(levels("msf", 3), false), (levels("minimal", 4), true)] {
        let furthest =
            minimal.iter().zip(&other).map(|(a, b)| (a.1 - b.1).abs()).fold(0.0, f32::max);
        // Means over channels of frames that hop: Friis differs by 0.3 dB from channel 11 to 26.
        assert_eq!(differs, 0.3 < furthest, "{furthest} dB");
    }
}

#[test]
fn c6_without_a_way_back_nothing_is_acknowledged_and_synchronisation_is_lost() {
    let silent_from_s = 3000;
    let both = [(0, 0, 1, 1.0), (0, 1, 0, 1.0)];
    let deaf = [both[0], both[1], (silent_from_s, 0, 1, 0.0)];
    let silent_asn = u64::from(silent_from_s) * 100;
    let config = format!("{EAGER}{}", own_cells(2, &[(0, 1)]));
    for (rows, stays) in [(&both[..], true), (&deaf[..], false)] {
        let mut bench = Bench::over_trace(2, trace(2, rows), &config);
        bench.form();
        assert!(bench.asn < Asn(silent_asn), "{}", bench.asn);
        bench.run_to(Asn(silent_asn));
        let before = bench.mote(1).tally.clone();
        bench.frames.clear();
        // A mote that knows its clock runs free for 300 s at most.
        bench.run(30_000 + 10);
        let tally = &bench.mote(1).tally;
        let (n_sent, n_acked) = (
            tally.sent_in_all().n_unicast - before.sent_in_all().n_unicast,
            tally.sent_in_all().n_acked - before.sent_in_all().n_acked,
        );
        if stays {
            bench.run(20_000);
            let tally = &bench.mote(1).tally;
            assert_eq!(tally.sent_in_all().n_unicast, tally.sent_in_all().n_acked);
            assert_eq!(tally.n_desynchronised, 0);
        } else {
            let asked = bench.sent(1, |what| *what == What::KeepAlive);
            assert!(
                !asked.is_empty() && asked.iter().all(|frame| frame.answered),
                "the root hears"
            );
            assert!(n_sent != 0 && n_acked == 0, "{n_acked} of {n_sent}");
            assert_eq!(tally.n_desynchronised, 1);
        }
    }
}

#[test]
fn c7_a_trace_of_other_nodes_or_channels_is_refused_and_a_subset_of_channels_is_not() {
    let read = |agents: usize, hopping: &str, channels: &str| {
        let config = format!("{hopping}[phy]\npropagation = \"trace\"\nfile = \"links.k7\"\n");
        let mut setup = set_up(agents, &config, 1);
        let whole = trace(2, &[(0, 0, 1, 1.0)]);
        let all = "11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26";
        setup.files.insert("links.k7".to_owned(), whole.replace(all, channels).into());
        netsim::config::read(&setup, Catalogue::built_in())
            .map(|(.., warnings)| warnings)
            .map_err(|problems| text(&problems))
    };
    let all = "11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26";
    let warnings = read(2, "", all).unwrap();
    assert!(
        warnings.iter().any(|warning| warning.contains("82800 s")),
        "how long it lasts: {warnings:?}"
    );
    assert!(read(3, "", all).unwrap_err().contains("has 2 nodes"));
    assert!(read(2, "", "11, 12").unwrap_err().contains("was not measured on all channels"));
    assert!(read(2, "hopping_sequence = [12, 11]\n", "11, 12").is_ok());
}

/// Where BotNet's line of ten stands with its seed 0 (m): the jitter is numpy's.
const BOTNET_LINE_Y_M: [f64; 10] = [
    0.0,
    2.0244067519636624,
    -2.1075946831862096,
    4.051381688035822,
    -4.022441591498448,
    5.961827399669453,
    -6.072947056533328,
    7.968793605631347,
    -8.19588650039104,
    10.231831380250515,
];

/// Places on a line (m) of which the first two and the last two are in reach of each other, 10 m.
const APART_X_M: [f64; 4] = [0.0, 8.0, 20.0, 25.0];

#[test]
fn b1_mote_i_stands_where_agent_i_stands_and_says_what_agent_i_says() {
    for order in
        (0..256_usize).map(|digits| [digits % 4, digits / 4 % 4, digits / 16 % 4, digits / 64])
    {
        if (0..4).any(|place| !order.contains(&place)) {
            continue;
        }
        // Agent i stands at the place order[i].
        let places = order.map(|place| (APART_X_M[place], 0.0));
        let agent = |place: usize| order.iter().position(|&other| other == place).unwrap() as u32;
        let mut expected = Vec::new();
        for (one, other) in [(0, 1), (2, 3)] {
            expected.extend([(agent(one), agent(other)), (agent(other), agent(one))]);
        }
        expected.sort_unstable();

        let mut plain = network(4, "[phy]\npropagation = \"unit-disk\"\nradius_m = 10.0\n");
        let deliveries = period(&mut plain, &standing_at(&places), 0).deliveries;
        assert_eq!(pairs_of(&deliveries, 4), expected, "{order:?}");
        let sent = &deliveries.transmissions;
        for (sender, payload) in sent.sender.iter().zip(sent.payloads.iter()) {
            assert_eq!(payload, sender.to_le_bytes(), "{order:?}");
        }
    }

    // The full network, whose motes must reach each other to form.
    let order: [i32; 4] = [2, 0, 3, 1];
    let places = order.map(|place| (10.0 * f64::from(place), 0.0));
    let mut bench = Bench::new(&places, &format!("{LINE}{EAGER}{}", own_cells(4, &[])));
    bench.form();
    let heard = bench.run(20_000).heard_links.unwrap();
    let place = |mote: u32| order[mote as usize];
    let pairs = heard.receiver.iter().zip(&heard.sender);
    let apart: Vec<i32> = pairs.map(|(&one, &other)| place(one) - place(other)).collect();
    assert_eq!(apart.len(), 6);
    assert!(apart.iter().all(|apart| apart.abs() == 1), "{apart:?}");
}

/// Who hears mote 0, of ten on BotNet's line, in one broadcast of each.
fn hear_mote_0(phy: &str) -> Vec<u32> {
    let places = BOTNET_LINE_Y_M.map(|y_m| (0.0, y_m));
    let mut network = network(10, &format!("[phy]\ncarrier_hz = 2.4e9\n{phy}"));
    let heard = pairs_of(&period(&mut network, &standing_at(&places), 0).deliveries, 10);
    heard.into_iter().filter(|(_, sender)| *sender == 0).map(|(receiver, _)| receiver).collect()
}

#[test]
fn b3_on_botnets_line_a_disk_of_10_m_reaches_all_but_the_last() {
    let phy = "propagation = \"unit-disk\"\nradius_m = 10.0\n";
    assert_eq!(hear_mote_0(phy), (1..9).collect::<Vec<u32>>());
}

#[test]
fn b4_on_botnets_line_friis_less_40_db_has_its_figures() {
    let rssi_dbm = |mote: usize| friis_dbm(0.0, BOTNET_LINE_Y_M[mote].abs(), 2.4e9) - 40.0;
    // Half a unit of the last digit given.
    assert!((rssi_dbm(1) - -86.178).abs() < 0.0005, "{}", rssi_dbm(1));
    for (mote, expected) in [(1, 0.9538), (5, 0.1867), (7, 0.0)] {
        let got = Table::dust().reception_probability(rssi_dbm(mote));
        assert!((got - expected).abs() < 0.000_05, "{mote}: {got}");
    }
    let config = "[phy]\npropagation = \"probabilistic-disk\"\ncarrier_hz = 2.4e9\n";
    let reading = reading_dbm(config, BOTNET_LINE_Y_M[1]).expect("19 of 20 frames arrive");
    assert!((f64::from(reading) - rssi_dbm(1)).abs() < 1e-4, "{reading}");
}
