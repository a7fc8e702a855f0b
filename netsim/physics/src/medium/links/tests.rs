//! Tests of links.

use super::*;
use crate::asn::Asn;
use crate::effect::Effect;
use crate::effect::shadowing::Shadowing;
use crate::effect::system_gain::SystemGain;
use crate::effect::testing::made;
use crate::interference::o_qpsk::OQpsk;
use crate::k7;
use crate::medium::jam::Jam;
use crate::medium::slot::{Listening, OnAir, Reception, Slot, SlotMedium};
use crate::propagation::experimental_randomness::{ExperimentalRandomness, Redraw};
use crate::propagation::friis::{Friis, friis_dbm};
use crate::propagation::full::Full;
use crate::propagation::line_of_sight::LineOfSight;
use crate::propagation::nearest_k::NearestK;
use crate::propagation::trace::Trace;
use crate::propagation::unit_disk::UnitDisk;
use crate::propagation::{AssignedRssi, Propagation, Radio};
use crate::reception::Curve;
use crate::reception::table::Table;
use proptest::prelude::*;
use proto::ids::MoteId;
use proto::site::Wall;

const SEED: u64 = 5;
const CHANNELS: [u8; 3] = [11, 18, 26];
const PERIOD_NS: u64 = 100_000_000;

const RADIO: Radio = Radio {
    tx_power_dbm: 0.0,
    tx_antenna_gain_dbi: 0.0,
    rx_antenna_gain_dbi: 0.0,
    carrier_hz: 2.44e9,
};

fn assigned() -> AssignedRssi {
    AssignedRssi::new(RADIO, None)
}

fn model(propagation: impl Propagation + 'static, effects: Vec<Box<dyn Effect>>) -> Model {
    Model::new(Box::new(propagation), effects, Box::new(Table::dust()), RADIO, 0.1, None)
}

fn shadowing() -> Box<dyn Effect> {
    Box::new(Shadowing { sd_db: 6.0, decorrelation_m: 2.0, ordinal: 0 })
}

/// Weak enough that a few hundred metres are beyond the horizon.
fn loss() -> Box<dyn Effect> {
    Box::new(SystemGain { gain_db: -45.0, register_only: false })
}

fn links(model: Model) -> Links {
    Links::new(Arc::new(model), SEED, &CHANNELS, None)
}

fn ends(positions_m: &[[f64; 2]]) -> Vec<End> {
    positions_m.iter().zip(0..).map(|(&[x, y], id)| End::new(MoteId(id), [x, y, 0.0])).collect()
}

fn placed(model: Model, positions_m: &[[f64; 2]]) -> Links {
    let mut links = links(model);
    links.set_positions(0, &ends(positions_m), &vec![0.0; positions_m.len()]);
    links
}

fn sent(sender: u32, channel: u8, sent_ns: u64) -> Sent {
    Sent { sender: MoteId(sender), channel, sent_ns, end_ns: sent_ns + 4_256_000 }
}

fn probability(links: &mut Links, sender: u32, receiver: u32) -> f64 {
    links.arrival(sent(sender, 18, 0), MoteId(receiver)).reception_probability
}

#[test]
fn a_link_has_the_power_of_its_channel() {
    let mut links = placed(model(Friis { radio: RADIO }, vec![]), &[[0.0; 2], [30.0, 40.0]]);
    for (channel, hz) in [(11, 2.405e9), (18, 2.440e9), (26, 2.480e9)] {
        let got = links.arrival(sent(0, channel, 0), MoteId(1));
        assert_eq!(got.rssi_dbm, friis_dbm(0.0, 50.0, hz));
        let table = Table::dust().reception_probability(got.rssi_dbm);
        assert_eq!(got.reception_probability, table);
    }
}

#[test]
fn nobody_hears_himself_or_who_is_off() {
    let mut links = placed(model(Full { rssi: assigned() }, vec![]), &[[0.0; 2], [1.0, 0.0]]);
    assert!(links.arrival(sent(0, 18, 0), MoteId(0)).is_nothing());
    assert!(!links.arrival(sent(0, 18, 0), MoteId(1)).is_nothing());
    assert!(links.arrival(sent(0, 18, 0), MoteId(2)).is_nothing());
    assert!(links.arrival(sent(7, 18, 0), MoteId(1)).is_nothing());
    links.set_positions(PERIOD_NS, &ends(&[[0.0; 2]]), &[0.0]);
    assert!(links.arrival(sent(0, 18, 0), MoteId(1)).is_nothing(), "switched off");
}

#[test]
fn c2_frozen_links_stay_over_100_slots_even_if_motes_move_and_are_the_same_in_both_directions() {
    let randomness = ExperimentalRandomness { radio: RADIO, redraw: Redraw::Frozen };
    let mut places = [[0.0; 2], [20.0, 0.0], [0.0, 30.0]];
    let mut links = placed(model(randomness, vec![]), &places);
    let first = links.arrival(sent(0, 18, 0), MoteId(1));
    for asn in 1..100 {
        places[2][1] += 0.1;
        links.set_positions(asn * PERIOD_NS, &ends(&places), &[0.0, 0.0, asn as f64 * 0.1]);
        assert_eq!(links.arrival(sent(0, 18, asn * 10_000_000), MoteId(1)), first);
        assert_eq!(links.arrival(sent(1, 18, asn * 10_000_000), MoteId(0)), first);
    }
}

#[test]
fn levels_of_a_period_change_with_it_and_levels_of_a_frame_with_every_frame() {
    for (redraw, changes_in_period) in [(Redraw::Period, false), (Redraw::Frame, true)] {
        let randomness = ExperimentalRandomness { radio: RADIO, redraw };
        let places = ends(&[[0.0; 2], [5.0, 0.0]]);
        let mut links = links(model(randomness, vec![]));
        links.set_positions(0, &places, &[0.0; 2]);
        let first = links.arrival(sent(0, 18, 2_120_000), MoteId(1));
        let second = links.arrival(sent(0, 18, 12_120_000), MoteId(1));
        assert_eq!(first != second, changes_in_period);
        assert_eq!(links.arrival(sent(0, 18, 2_120_000), MoteId(1)), first, "asked again");
        links.set_positions(PERIOD_NS, &places, &[0.0; 2]);
        let next = links.arrival(sent(0, 18, PERIOD_NS + 2_120_000), MoteId(1));
        assert_ne!(first, next);
        let friis = friis_dbm(0.0, 5.0, 2.44e9);
        for arrival in [first, second, next] {
            assert!((friis - 40.0..=friis).contains(&arrival.rssi_dbm));
        }
    }
}

#[test]
fn a_period_has_the_levels_of_a_propagation_only_run() {
    let randomness = ExperimentalRandomness { radio: RADIO, redraw: Redraw::Period };
    let mut links = placed(model(randomness, vec![]), &[[0.0; 2], [5.0, 0.0]]);
    let scatter = links.model.scatters()[0];
    let at = Moment { period_ns: 0, sent_ns: 77, way_m: 0.0, channel: None };
    let level_db = scatter.value_db(
        &mut PairBlock::new(SEED, MoteId(0), MoteId(1), 0),
        MoteId(0),
        MoteId(1),
        at,
    );
    let got = links.arrival(sent(0, 18, 77), MoteId(1)).rssi_dbm;
    assert_eq!(got, friis_dbm(0.0, 5.0, 2.44e9) - 20.0 + level_db);
}

#[test]
fn shadowing_changes_with_the_way_of_either_end() {
    let places = ends(&[[0.0; 2], [20.0, 0.0]]);
    let mut links = links(model(Friis { radio: RADIO }, vec![shadowing()]));
    links.set_positions(0, &places, &[0.0, 0.0]);
    let first = links.arrival(sent(0, 18, 0), MoteId(1));
    assert_eq!(links.arrival(sent(0, 18, 50), MoteId(1)), first);
    links.set_positions(PERIOD_NS, &places, &[0.0, 0.0]);
    assert_eq!(links.arrival(sent(0, 18, PERIOD_NS), MoteId(1)), first);
    links.set_positions(2 * PERIOD_NS, &places, &[0.0, 3.0]);
    assert_ne!(links.arrival(sent(0, 18, 2 * PERIOD_NS), MoteId(1)), first);
}

#[test]
fn limited_scatter_is_that_of_the_unlimited_effect_where_it_acts_and_nothing_elsewhere() {
    let places = [[0.0; 2], [20.0, 0.0], [0.0, 20.0]];
    for (kind, keys) in [
        ("shadowing", "sd_db = 6.0\ndecorrelation_m = 2.0"),
        ("node-offset", "tx_sd_db = 3.0\nrx_sd_db = 2.0"),
        ("multipath", "sd_db = 4.0"),
        ("fast-fading", "k_factor_db = 3.0"),
    ] {
        let links = |only: &str| {
            placed(
                model(Friis { radio: RADIO }, vec![made(kind, &format!("{keys}\n{only}"))]),
                &places,
            )
        };
        let (mut plain, mut everywhere) =
            (placed(model(Friis { radio: RADIO }, vec![]), &places), links(""));
        let mut limited = links("only = { nodes = [1], from_s = 0.02, until_s = 0.04 }");
        for (sender, receiver) in [(0, 1), (1, 0), (0, 2), (2, 1)] {
            for sent_ns in [0, 19_999_999, 20_000_000, 39_999_999, 40_000_000] {
                let frame = sent(sender, 18, sent_ns);
                let acts =
                    (sender == 1 || receiver == 1) && (20_000_000..40_000_000).contains(&sent_ns);
                let other = if acts { &mut everywhere } else { &mut plain };
                let (got, expected) = (
                    limited.arrival(frame, MoteId(receiver)),
                    other.arrival(frame, MoteId(receiver)),
                );
                assert_eq!(got, expected, "{kind} {sender} {receiver} {sent_ns}");
            }
        }
    }
}

#[test]
fn the_horizon_is_where_frames_become_too_weak_to_be_received_unless_it_is_set() {
    let weak = || model(Friis { radio: RADIO }, vec![loss()]);
    // -45 dB: the table ends where Friis has -52 dBm, at 3.9 m; -75 dBm, horizon -120, lies at 55 m.
    let places = [[0.0; 2], [3.8, 0.0], [4.1, 0.0], [54.0, 0.0], [57.0, 0.0]];
    let mut near = placed(weak(), &places);
    let arrives = |links: &mut Links| {
        [1, 2, 3, 4].map(|receiver| !links.arrival(sent(0, 18, 0), MoteId(receiver)).is_nothing())
    };
    assert_eq!(arrives(&mut near), [true, false, false, false]);
    let mut far = Links::new(Arc::new(weak()), SEED, &CHANNELS, Some(-120.0));
    far.set_positions(0, &ends(&places), &[0.0; 5]);
    assert_eq!(arrives(&mut far), [true, true, true, false]);
    assert_eq!(probability(&mut far, 0, 2), 0.0, "too weak to be received");
}

#[test]
fn the_full_model_delivers_over_any_distance() {
    let mut links = placed(model(Full { rssi: assigned() }, vec![]), &[[0.0; 2], [1e7, 0.0]]);
    assert_eq!(probability(&mut links, 0, 1), 1.0);
    assert_eq!(links.neighbours(MoteId(0)), None);
}

#[test]
fn the_disk_ends_at_its_radius() {
    let disk = UnitDisk { radius_m: 10.0, rssi: assigned() };
    let mut links = placed(model(disk, vec![]), &[[0.0; 2], [10.0, 0.0], [0.0, 10.01]]);
    assert_eq!(probability(&mut links, 0, 1), 1.0);
    assert!(links.arrival(sent(0, 18, 0), MoteId(2)).is_nothing(), "and disturbs nobody beyond");
}

#[test]
fn the_k_nearest_are_those_of_now() {
    let nearest = || model(NearestK { k: 1, rssi: assigned() }, vec![]);
    let mut links = placed(nearest(), &[[0.0; 2], [1.0, 0.0], [3.0, 0.0]]);
    assert_eq!(probability(&mut links, 1, 0), 1.0);
    assert_eq!(probability(&mut links, 2, 0), 0.0);
    assert_eq!(probability(&mut links, 1, 2), 1.0);
    assert_eq!(probability(&mut links, 2, 1), 0.0, "not mutual");
    links.set_positions(PERIOD_NS, &ends(&[[0.0; 2], [1.0, 0.0], [0.5, 0.0]]), &[0.0; 3]);
    assert_eq!(probability(&mut links, 2, 0), 1.0);
    assert_eq!(probability(&mut links, 1, 0), 0.0);
}

#[test]
fn walls_stand_in_the_line_of_sight_and_may_come_and_go() {
    let sight = LineOfSight {
        radius_m: None,
        field_of_view_rad: None,
        body_radius_m: None,
        rssi: assigned(),
    };
    let mut links = placed(model(sight, vec![]), &[[0.0; 2], [4.0, 0.0], [0.0, 4.0]]);
    let wall = Wall { from_m: [2.0, -1.0], to_m: [2.0, 1.0], height_m: None, material: None };
    links.set_site(&Site { wall: vec![wall], ..Site::default() });
    assert_eq!(probability(&mut links, 0, 1), 0.0);
    assert_eq!(probability(&mut links, 0, 2), 1.0);
    links.set_site(&Site::default());
    assert_eq!(probability(&mut links, 0, 1), 1.0);
}

#[test]
fn bodies_of_others_stand_in_the_line_of_sight() {
    let sight = LineOfSight {
        radius_m: None,
        field_of_view_rad: None,
        body_radius_m: Some(0.2),
        rssi: assigned(),
    };
    // A row of 20: each sees its neighbours only. More than 16 make the model use its grid.
    let places: Vec<[f64; 2]> = (0..20).map(|i| [f64::from(i), 0.0]).collect();
    let mut links = placed(model(sight, vec![]), &places);
    for asked in 0..2 {
        assert_eq!(probability(&mut links, 5, 6), 1.0, "{asked}");
        assert_eq!(probability(&mut links, 5, 7), 0.0, "{asked}");
    }
}

#[test]
fn c7_a_trace_is_replayed_by_time_and_channel() {
    const TEXT: &str = "{\"tx_length\": 100, \"start_date\": \"2018-01-11T16:32:22.0\", \
        \"stop_date\": \"2018-01-11T16:33:22.0\", \"channels\": [11, 18, 26], \"location\": \"x\", \
        \"node_count\": 2, \"interframe_duration\": 100}\n\
        datetime,src,dst,channel,mean_rssi,pdr,tx_count\n\
        2018-01-11T16:32:22.0,0,1,18,-69.9,0.75,100\n\
        2018-01-11T16:32:32.0,0,1,18,-80,0.25,100\n";
    let trace = Trace::new(&k7::read(TEXT.as_bytes()).unwrap(), 10_000_000);
    let mut links = placed(model(trace, vec![]), &[[0.0; 2], [0.0; 2]]);
    let mut at = |channel, sent_ns| {
        let arrival = links.arrival(sent(0, channel, sent_ns), MoteId(1));
        (arrival.rssi_dbm, arrival.reception_probability)
    };
    assert_eq!(at(18, 2_120_000), (-69.9, 0.75));
    assert_eq!(at(18, 9_992_120_000), (-69.9, 0.75));
    assert_eq!(at(18, 10_002_120_000), (-80.0, 0.25));
    assert_eq!(at(11, 2_120_000), (f64::NEG_INFINITY, 0.0), "no row: nothing arrives");
}

#[test]
fn in_a_jam_nothing_arrives_and_outside_everything() {
    let places = [[0.0; 2], [10.0, 0.0], [-10.0, 0.0]];
    let mut links = placed(model(Full { rssi: assigned() }, vec![]), &places);
    let mut jams = Jams::default();
    let (from_ns, until_ns) = (1_000_000_000, 2_000_000_000);
    jams.add(Jam { channel: 18, from_ns, until_ns, centre_m: [10.0, 0.0], radius_m: 2.0 });
    links.set_jams(&jams);
    let mut medium = SlotMedium::new(SEED, Box::new(OQpsk::new(-105.0, 3.0)), false);
    for (asn, channel, hears) in
        [(50, 18, true), (150, 18, false), (150, 11, true), (250, 18, true)]
    {
        let slot = Slot { asn: Asn(asn), begins_ns: asn * 10_000_000 };
        let on_air = [OnAir { sender: MoteId(0), channel, starts_ns: 0, psdu_bytes: 50 }];
        let listening = [1, 2].map(|mote| Listening::synchronised(MoteId(mote), channel, 0));
        let got = medium.resolve(&mut links, slot, &on_air, &listening);
        assert_eq!(matches!(got[0], Reception::Received { .. }), hears, "{asn} {channel}");
        assert!(matches!(got[1], Reception::Received { .. }), "outside the disc");
    }
}

/// Motes of which some move, in some periods.
fn journeys() -> impl Strategy<Value = Vec<Vec<Option<[f64; 2]>>>> {
    let place = (-40i32..40, -40i32..40).prop_map(|(x, y)| [f64::from(x), f64::from(y)]);
    let first = prop::collection::vec(prop::option::weighted(0.9, place.clone()), 1..150);
    // By period: for every mote nothing new, or a new place, or off.
    let change = prop_oneof![
        8 => Just(None),
        2 => prop::option::weighted(0.8, place).prop_map(Some),
    ];
    let changes = prop::collection::vec(prop::collection::vec(change, 150), 0..4);
    (first, changes).prop_map(|(first, changes)| {
        let mut periods = vec![first];
        for changes in changes {
            let before = &periods[periods.len() - 1];
            let next = before.iter().zip(changes).map(|(&place, change)| change.unwrap_or(place));
            let next = next.collect();
            periods.push(next);
        }
        periods
    })
}

fn models() -> Vec<Model> {
    let randomness = |redraw| ExperimentalRandomness { radio: RADIO, redraw };
    vec![
        model(Friis { radio: RADIO }, vec![loss()]),
        model(Friis { radio: RADIO }, vec![loss(), shadowing()]),
        model(randomness(Redraw::Frame), vec![loss()]),
        model(randomness(Redraw::Coherence), vec![loss()]),
        model(UnitDisk { radius_m: 15.0, rssi: assigned() }, vec![]),
        model(NearestK { k: 4, rssi: assigned() }, vec![]),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(30))]

    /// Links that have seen all periods, and been asked in each, answer as links that are made for the last one.
    #[test]
    fn what_has_been_asked_before_does_not_matter(journeys in journeys(), which in 0usize..6) {
        let made = || links(models().swap_remove(which));
        let mut old = made();
        let mut way_m = vec![0.0; journeys[0].len()];
        let mut before: Vec<Option<[f64; 2]>> = journeys[0].clone();
        for (period, places) in (0..).zip(&journeys) {
            let mut ends = Vec::new();
            let mut ways = Vec::new();
            for (mote, &place) in places.iter().enumerate() {
                if before[mote] != place {
                    way_m[mote] += 1.0;
                }
                before[mote] = place;
                if let Some([x, y]) = place {
                    ends.push(End::new(MoteId(mote as u32), [x, y, 0.0]));
                    ways.push(way_m[mote]);
                }
            }
            let now_ns = period * PERIOD_NS;
            old.set_positions(now_ns, &ends, &ways);
            let mut new = made();
            new.set_positions(now_ns, &ends, &ways);
            for sender in ends.iter().step_by(7) {
                let sent = sent(sender.id.0, 18, now_ns + 2_120_000);
                let mut plain = Vec::new();
                for receiver in 0..places.len() as u32 {
                    plain.push(new.arrival(sent, MoteId(receiver)));
                }
                // In another order, some of them twice.
                for receiver in (0..places.len() as u32).rev().chain([0]) {
                    prop_assert_eq!(old.arrival(sent, MoteId(receiver)), plain[receiver as usize]);
                }
                // Outside of the neighbours nothing arrives.
                if let Some(neighbours) = old.neighbours(sender.id) {
                    prop_assert!(neighbours.is_sorted());
                    for (receiver, arrival) in (0..).zip(&plain) {
                        let is_listed = neighbours.binary_search(&MoteId(receiver)).is_ok();
                        prop_assert!(is_listed || arrival.is_nothing(), "{}", receiver);
                    }
                }
            }
        }
    }
}

#[test]
fn many_have_neighbours_and_few_of_them() {
    let places: Vec<[f64; 2]> = (0..900).map(|i| [f64::from(i % 30), f64::from(i / 30)]).collect();
    let mut links = placed(model(Friis { radio: RADIO }, vec![loss()]), &places);
    // 3.9 m: 48 or 49 places of a unit grid within.
    let neighbours = links.neighbours(MoteId(15 * 30 + 15)).unwrap();
    assert!((40..60).contains(&neighbours.len()), "{}", neighbours.len());
}

/// A slot with one frame or two, by radios some of which are off, wait elsewhere or at another time.
#[test]
fn where_frames_are_certain_the_same_ones_are_received_without_their_levels() {
    let full = || model(Full { rssi: assigned() }, Vec::new());
    let frame = |sender, starts_ns| OnAir { sender, channel: 18, starts_ns, psdu_bytes: 60 };
    let jam = Jam { channel: 18, from_ns: 0, until_ns: 1, centre_m: [0.0; 2], radius_m: 0.0 };
    let mut n_levels = [0; 2];
    for (on_air, is_jammed) in [
        (vec![frame(MoteId(1), 0)], false),
        (vec![frame(MoteId(1), 700_000)], false),
        (vec![frame(MoteId(9), 0)], false),
        (vec![frame(MoteId(1), 0), frame(MoteId(3), 200_000)], false),
        (vec![frame(MoteId(1), 0)], true),
    ] {
        // Radio 4 is off, and 9 does not exist.
        let positions = ends(&[[0.0, 0.0], [3.0, 1.0], [5.0, 5.0], [900.0, 2.0], [1.0, 1.0]]);
        let listening: Vec<Listening> = [(0, 18, 0), (2, 18, -600_000), (3, 11, 0), (4, 18, 0)]
            .into_iter()
            .map(|(receiver, channel, off_ns)| {
                Listening::synchronised(MoteId(receiver), channel, off_ns)
            })
            .chain([Listening::scanning(MoteId(1), 18)])
            .collect();
        let slot = Slot { asn: Asn(77), begins_ns: 770_000_000 };
        let mut resolved = [false, true].map(|asks| {
            let mut links = if asks { links(full()) } else { links(full()).without_levels() };
            links.set_positions(0, &positions[..4], &[0.0; 4]);
            if is_jammed {
                let mut jams = Jams::default();
                jams.add(jam);
                links.set_jams(&jams);
            }
            let mut medium = SlotMedium::new(SEED, Box::new(OQpsk::new(-105.0, 3.0)), false);
            medium.resolve(&mut links, slot, &on_air, &listening).to_vec()
        });
        for (resolved, n_levels) in resolved.iter_mut().zip(&mut n_levels) {
            for reception in resolved {
                if let Reception::Received { rssi_dbm, .. } = reception {
                    *n_levels += u32::from(!rssi_dbm.is_nan());
                    *rssi_dbm = 0.0;
                }
            }
        }
        assert_eq!(resolved[0], resolved[1], "{on_air:?}");
    }
    // Where two frames meet, or noise lasts, levels are computed all the same.
    assert!(0 < n_levels[0] && n_levels[0] < n_levels[1], "{n_levels:?}");
}
