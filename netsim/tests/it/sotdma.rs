//! Motes that take slots for themselves: what they settle on, and what becomes of conflicts.

use crate::harness::{payloads, setup, text};
use crate::invariants::n_seeds;
use netsim::catalogue::Catalogue;
use netsim::dice::Dice;
use netsim::mesh::network::Mesh;
use netsim::sf::sotdma::Sotdma;
use proto::ids::MoteId;
use proto::rng::Purpose;
use proto::side::{NetInput, NetOutput, Setup};
use proto::types::{AgentStates, NS_PER_S};

/// Range of a radio (m): those within it receive all there is, others nothing and no interference either.
const RANGE_M: f64 = 10.0;
/// Slots of a slotframe, of 10 ms each. Within two hops of a mote are thirty others at most places.
const SLOTS: u64 = 48;
const SLOTFRAME_NS: u64 = SLOTS * 10_000_000;

/// Motes of which each has eight neighbours in the mean, and who say where they are.
struct Field {
    mesh: Mesh,
    states: AgentStates,
    velocities_mps: Vec<[f64; 2]>,
    side_m: f64,
    period: u64,
}

impl Field {
    fn draw(n: usize, speed_mps: f64, seed: u64) -> Self {
        let config = format!(
            "mode = \"6tisch\"\n[phy]\npropagation = \"unit-disk\"\nradius_m = {RANGE_M}\n\
             [sf]\nkind = \"sotdma\"\nslotframe_slots = {SLOTS}\nshared_slots = 6\n\
             [mac]\nbeacon_period_s = 1.0\nbeacon_spacing_s = 0.2\nbeacon_wait_s = 1.0\nscan_dwell_s = 0.2\n\
             [rpl]\ndio_interval_min = 9\ndio_interval_doublings = 6\ndis_period_s = 4\ndao_ack = false\n\
             [join]\nsecure = false\n[swarm]\ntransport = \"own-cell\"\n"
        );
        let mut setup = setup(n, &config);
        setup.experiment.seed = seed;
        setup.experiment.step_ns = SLOTFRAME_NS;
        let (mut config, ..) = netsim::config::read(&setup, Catalogue::built_in())
            .unwrap_or_else(|problems| panic!("{}", text(&problems)));
        let (settings, addresses) = *config.network.take().expect("the full network");
        let Setup { experiment, site, columns, records, .. } = setup;
        let mesh = Mesh::new(experiment, config, settings, addresses, site, columns, records);
        let mut dice = Dice::new(seed, Purpose::Scenario, MoteId(0));
        let side_m = RANGE_M * (std::f64::consts::PI * n as f64 / 9.0).sqrt();
        let mut states = AgentStates::at_origin(n);
        let mut velocities_mps = Vec::new();
        for mote in 0..n {
            states.x_m[mote] = dice.between(0.0, side_m);
            states.y_m[mote] = dice.between(0.0, side_m);
            let way = dice.between(0.0, std::f64::consts::TAU);
            velocities_mps.push([speed_mps * way.cos(), speed_mps * way.sin()]);
        }
        Self { mesh, states, velocities_mps, side_m, period: 0 }
    }

    /// A control period goes by: one slotframe. Who comes to the edge turns back.
    fn step(&mut self) -> NetOutput {
        let from_ns = self.period * SLOTFRAME_NS;
        self.period += 1;
        for (mote, velocity_mps) in self.velocities_mps.iter_mut().enumerate() {
            let places_m = [&mut self.states.x_m[mote], &mut self.states.y_m[mote]];
            for (place_m, velocity_mps) in places_m.into_iter().zip(velocity_mps) {
                *place_m += *velocity_mps * SLOTFRAME_NS as f64 / NS_PER_S as f64;
                if *place_m < 0.0 || self.side_m < *place_m {
                    *velocity_mps = -*velocity_mps;
                    *place_m = place_m.clamp(0.0, self.side_m);
                }
            }
        }
        self.mesh.step(&NetInput {
            step: self.period,
            from_ns,
            until_ns: from_ns + SLOTFRAME_NS,
            states: &self.states,
            payloads: &payloads(self.states.len()),
            moved_obstacles: &[],
            commands: &[],
            stop_at_first_delivery: false,
            records: &[],
        })
    }

    /// The slots that motes have.
    fn slots(&self) -> Vec<Option<u16>> {
        let motes = self.mesh.state().motes.iter();
        motes.map(|mote| mote.sf.as_kind::<Sotdma>().expect("no other function").slot()).collect()
    }

    fn are_in_reach(&self, a: usize, b: usize) -> bool {
        let (dx_m, dy_m) =
            (self.states.x_m[a] - self.states.x_m[b], self.states.y_m[a] - self.states.y_m[b]);
        a != b && dx_m.hypot(dy_m) <= RANGE_M
    }

    /// Pairs of motes that hear each other, or a third one hears both of, and have the same slot. Who has no slot keeps none
    /// from being reused, since it announces nothing.
    fn conflicts(&self) -> Vec<(usize, usize)> {
        let slots = self.slots();
        let n = slots.len();
        let mut found = Vec::new();
        for a in (0..n).filter(|&a| slots[a].is_some()) {
            for b in (a + 1..n).filter(|&b| slots[b] == slots[a]) {
                let via = |c: usize| {
                    slots[c].is_some() && self.are_in_reach(a, c) && self.are_in_reach(c, b)
                };
                if self.are_in_reach(a, b) || (0..n).any(via) {
                    found.push((a, b));
                }
            }
        }
        found
    }

    /// Until all that can have a slot, and a minute more.
    fn settle(&mut self) {
        let n = self.n_connected();
        while self.slots().iter().flatten().count() < n {
            assert!(self.period < 1000, "eight minutes, and somebody has heard no beacon");
            self.step();
        }
        (0..125).for_each(|_| drop(self.step()));
    }

    /// Motes with a path to the root, which can get the time from it.
    fn n_connected(&self) -> usize {
        let n = self.states.len();
        let mut reached = vec![false; n];
        let mut ahead = vec![0];
        while let Some(mote) = ahead.pop() {
            if !std::mem::replace(&mut reached[mote], true) {
                ahead.extend((0..n).filter(|&other| self.are_in_reach(mote, other)));
            }
        }
        reached.into_iter().filter(|reached| *reached).count()
    }
}

#[test]
fn once_settled_no_two_motes_within_two_hops_have_the_same_slot() {
    let mut n_slots = 0;
    for seed in 0..n_seeds(20) {
        let mut field = Field::draw(60, 0.0, seed);
        field.settle();
        let settled = field.slots();
        n_slots += settled.iter().flatten().count();
        for _ in 0..60 {
            assert_eq!(field.conflicts(), [], "seed {seed}, period {}", field.period);
            field.step();
        }
        // Nobody moves: nobody has a reason to change.
        assert_eq!(field.slots(), settled, "seed {seed}");
    }
    // Slots are used again: there are 42 in a network.
    assert!(50 * n_seeds(20) < n_slots as u64, "{n_slots}");
}

#[test]
fn a_payload_is_heard_by_every_neighbour_that_has_a_slot() {
    let mut field = Field::draw(60, 0.0, 7);
    field.settle();
    let slots = field.slots();
    let n_ready = field.mesh.state().motes.iter().filter(|mote| mote.ready).count();
    let n_hearing = |sender: usize| {
        let hears = |other: &usize| slots[*other].is_some() && field.are_in_reach(sender, *other);
        (0..slots.len()).filter(hears).count()
    };
    let n_hearing: Vec<usize> = (0..slots.len()).map(n_hearing).collect();
    let (n_periods, mut n_sent) = (100, 0);
    for _ in 0..n_periods {
        let deliveries = field.step().deliveries;
        let senders = &deliveries.transmissions.sender;
        n_sent += senders.len();
        let expected: usize = senders.iter().map(|&sender| n_hearing[sender as usize]).sum();
        assert_eq!(deliveries.n_deliveries(), expected, "in period {}", field.period);
    }
    // One of 16 is a check; of eight neighbours each sends a beacon every 1.8 s, in every fourth slotframe.
    let ratio = n_sent as f64 / (n_ready * n_periods) as f64;
    assert!((0.6..=0.75).contains(&ratio), "{ratio}");
}

#[test]
fn motes_that_move_into_conflicts_resolve_them() {
    let (mut n_new, mut longest, mut n_pairs, mut n_periods) = (0, 0, 0, 0);
    for seed in 100..100 + n_seeds(5) {
        let mut field = Field::draw(60, 1.0, seed);
        // Nobody is left alone for long.
        (0..400).for_each(|_| drop(field.step()));
        let mut since = std::collections::BTreeMap::new();
        for period in 0..400 {
            field.step();
            let now = field.conflicts();
            since.retain(|pair, _| now.contains(pair));
            for pair in now {
                n_pairs += 1;
                let begun = *since.entry(pair).or_insert_with(|| {
                    n_new += 1;
                    period
                });
                longest = longest.max(period - begun);
            }
            n_periods += 1;
        }
    }
    // Robots of 1 m/s in a range of 10 m meet others all the time.
    assert!(n_periods / 10 < n_new, "{n_new} conflicts in {n_periods} slotframes");
    let mean = f64::from(n_pairs) / f64::from(n_new);
    // A check comes every sixteen slotframes in the mean, every four where a neighbour does not hear the mote: none of 150
    // conflicts should take fifteen of the latter. Many are short, as who meets parts again.
    assert!(mean < 4.0 && longest < 60, "{mean} slotframes in the mean, {longest} at most");
}
