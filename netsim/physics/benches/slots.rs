//! TSCH slots on the air.
//!
//! * own slot: one robot sends, 499 listen, all within 25 m; robots have moved since the slot before.
//! * period: 500 such slots, a control period of 5 s.
//! * sparse: 10,000 standing motes in a grid, 20 frames with one listener each, acknowledged.
//! * shared: 1000 motes within reach of each other, 20 send at once and all others listen.
//!
//! `cargo bench -p physics`

use criterion::{Criterion, criterion_group, criterion_main};
use physics::asn::Asn;
use physics::interference::o_qpsk::OQpsk;
use physics::link::End;
use physics::medium::links::Links;
use physics::medium::slot::{Acknowledgment, Listening, OnAir, Slot, SlotMedium};
use physics::model::Model;
use physics::propagation::experimental_randomness::{ExperimentalRandomness, Redraw};
use physics::propagation::friis::Friis;
use physics::propagation::{Propagation, Radio};
use physics::reception::table::Table;
use proto::ids::MoteId;
use proto::rng::{Draws, Purpose};
use proto::time::SimDuration;
use std::hint::black_box;
use std::sync::Arc;

const RADIO: Radio = Radio {
    tx_power_dbm: 0.0,
    tx_antenna_gain_dbi: 0.0,
    rx_antenna_gain_dbi: 0.0,
    carrier_hz: 2.44e9,
};

const FRIIS: Friis = Friis { radio: RADIO };
const RANDOMNESS: ExperimentalRandomness =
    ExperimentalRandomness { radio: RADIO, redraw: Redraw::Period };

fn links(propagation: Box<dyn Propagation>, radio: Radio) -> Links {
    let table = Box::new(Table::dust());
    let model = Model::new(propagation, Vec::new(), table, radio, 0.1, None);
    Links::new(Arc::new(model), 1, &[11, 15, 20, 25, 26], None)
}

fn medium() -> SlotMedium {
    SlotMedium::new(1, Box::new(OQpsk::new(-105.0, 3.0)), false)
}

/// Uniform in a square.
fn ends(n: u32, side_m: f64) -> Vec<End> {
    let draws = Draws::new(7, Purpose::Scenario);
    let coordinate_m = |id: u32, k| side_m * draws.uniform(u64::from(id), 0, k);
    (0..n).map(|id| End::new(MoteId(id), [coordinate_m(id, 0), coordinate_m(id, 1), 0.0])).collect()
}

fn slot(asn: Asn) -> Slot {
    Slot { asn, begins_ns: (asn * SimDuration::from_ns(10_000_000)).ns() }
}

fn frame(sender: u32, channel: u8) -> OnAir {
    OnAir { sender: MoteId(sender), channel, starts_ns: 0, psdu_bytes: 80 }
}

fn others(n: u32, silent: MoteId, channel: u8) -> Vec<Listening> {
    let listen = |mote| Listening::synchronised(mote, channel, 0);
    (0..n).map(MoteId).filter(|&mote| mote != silent).map(listen).collect()
}

fn own_slots(criterion: &mut Criterion) {
    let models: [(&str, Box<dyn Propagation>); 2] =
        [("friis", Box::new(FRIIS)), ("experimental-randomness", Box::new(RANDOMNESS))];
    for (name, propagation) in models {
        let (mut links, mut medium) = (links(propagation, RADIO), medium());
        let mut ends = ends(500, 25.0);
        let listening: Vec<Vec<Listening>> =
            (0..500).map(|sender| others(500, MoteId(sender), 15)).collect();
        let way_m = vec![0.0; 500];
        links.set_positions(0, &ends, &way_m);
        let mut asn = 0;
        criterion.bench_function(&format!("own slot of 500, {name}"), |bencher| {
            bencher.iter(|| {
                asn += 1;
                let sender = asn % 500;
                let on_air = [frame(sender as u32, 15)];
                let listening = &listening[sender as usize];
                black_box(medium.resolve(&mut links, slot(Asn(asn)), &on_air, listening).len())
            });
        });
        criterion.bench_function(&format!("period of 500 own slots, {name}"), |bencher| {
            bencher.iter(|| {
                for end in &mut ends {
                    end.position_m[0] += 0.01;
                }
                links.set_positions(asn * 10_000_000, &ends, &way_m);
                for sender in 0..500 {
                    asn += 1;
                    let on_air = [frame(sender, 15)];
                    let listening = &listening[sender as usize];
                    black_box(medium.resolve(&mut links, slot(Asn(asn)), &on_air, listening).len());
                }
            });
        });
    }
}

fn sparse(criterion: &mut Criterion) {
    // -45 dBm: a reach of 4 m, about 50 of the motes.
    let radio = Radio { tx_power_dbm: -45.0, ..RADIO };
    let (mut links, mut medium) = (links(Box::new(Friis { radio }), radio), medium());
    let place = |id: u32| [f64::from(id % 100), f64::from(id / 100), 0.0];
    let ends: Vec<End> = (0..10_000).map(|id| End::new(MoteId(id), place(id))).collect();
    links.set_positions(0, &ends, &vec![0.0; 10_000]);
    let mut asn = 0;
    criterion.bench_function("sparse slot of 10,000 with acknowledgments", |bencher| {
        bencher.iter(|| {
            asn += 1;
            let sender = |k: u32| (k * 500 + (asn as u32 * 37) % 499) % 10_000;
            let channel = |k: u32| [11, 15, 20, 25, 26][k as usize % 5];
            let on_air: [OnAir; 20] =
                std::array::from_fn(|k| frame(sender(k as u32), channel(k as u32)));
            let listening: [Listening; 20] = std::array::from_fn(|k| {
                Listening::synchronised(MoteId(sender(k as u32) + 1), channel(k as u32), 0)
            });
            let heard = medium.resolve(&mut links, slot(Asn(asn)), &on_air, &listening);
            black_box(heard.len());
            let acknowledgments: [Acknowledgment; 20] = std::array::from_fn(|k| Acknowledgment {
                transmission: k as u32,
                receiver: listening[k].receiver,
                psdu_bytes: 27,
            });
            black_box(
                medium.acknowledge(&mut links, slot(Asn(asn)), &on_air, &acknowledgments).len(),
            )
        });
    });
}

fn shared(criterion: &mut Criterion) {
    let (mut links, mut medium) = (links(Box::new(FRIIS), RADIO), medium());
    links.set_positions(0, &ends(1000, 100.0), &vec![0.0; 1000]);
    let on_air: Vec<OnAir> = (0..20)
        .map(|k| OnAir { starts_ns: i64::from(k * 7919 % 400) * 1000, ..frame(k * 50, 20) })
        .collect();
    let listening: Vec<Listening> = (0..1000)
        .filter(|mote| mote % 50 != 0)
        .map(|mote| Listening::synchronised(MoteId(mote), 20, 0))
        .collect();
    let mut asn = 0;
    criterion.bench_function("shared slot of 1000, 20 of them sending", |bencher| {
        bencher.iter(|| {
            asn += 1;
            black_box(medium.resolve(&mut links, slot(Asn(asn)), &on_air, &listening).len())
        });
    });
}

criterion_group!(benches, own_slots, sparse, shared);
criterion_main!(benches);
