//! Networks drawn at random: settings, places, faults, moves, traffic. A function of the seed.

use crate::harness::{STEP_NS, setup};
use bytes::Bytes;
use netsim::catalogue::Catalogue;
use netsim::dice::Dice;
use netsim::mesh::network::Mesh;
use netsim::sim::Network;
use proto::ids::MoteId;
use proto::rng::Purpose;
use proto::side::{NetInput, NetOutput, NetSimulator as _, Setup};
use proto::types::{
    AgentStates, DeliveryColumn, MoteCommand, MoteOrder, NS_PER_S, NetRecord, Payloads,
};

/// Scheduling functions, with settings under which small networks form soon.
pub(crate) const FUNCTIONS: [&str; 12] = [
    "kind = \"minimal\"\nslotframe_slots = 11",
    "kind = \"msf\"\nslotframe_slots = 23",
    "kind = \"rrsf\"\nshared_slots = 3",
    "kind = \"orchestra\"\neb_slots = 41\ncommon_slots = 7\nunicast_slots = 11",
    "kind = \"static\"\nslotframe_slots = 7\nminimal_cell_slots = 13\n\
     [[sf.cell]]\nslot = 1\nfrom = \"any\"\nto = \"all\"\n\
     [[sf.cell]]\nslot = 3\nfrom = 1\nto = 0\n\
     [[sf.cell]]\nslot = 4\nfrom = 0\nto = \"all\"\n\
     [[sf.cell]]\nslot = 5\nfrom = \"any\"\nto = 0\n",
    "kind = \"rrsf\"\n[compat]\nshared_slot_0 = true",
    "kind = \"sotdma\"\nslotframe_slots = 20\nshared_slots = 4",
    "kind = \"sotdma\"\nslotframe_slots = 20\nshared_slots = 4\nunicast = \"own\"\n[mobility]\ntime_from_beacons = true\n\
     rank_from_beacons = true\nhandover_dbm = -60.0\nreroute = true\nbursts = true\nscan_hopping = true\nkeep_admission = true",
    "kind = \"orchestra\"\ncommon_slots = 7\nunicast_slots = 11\nrules = [\"unicast-non-storing\", \"default-common\"]\n\
     [mobility]\nrank_from_beacons = true\nreroute = true",
    "kind = \"alice\"\neb_slots = 41\ncommon_slots = 7\nunicast_slots = 11",
    "kind = \"llsf\"\nslotframe_slots = 23\nmax_num_cells = 20\nlim_numcellsused_high = 12\nlim_numcellsused_low = 4",
    "kind = \"emsf\"\nslotframe_slots = 23\nmax_num_cells = 20\nlim_numcellsused_low = 4",
];

/// Radios: everyone hears everyone, only near ones, some by chance, some by power.
pub(crate) const RADIOS: [&str; 4] = [
    "propagation = \"full\"",
    "propagation = \"unit-disk\"\nradius_m = 9",
    "propagation = \"probabilistic-disk\"",
    "propagation = \"experimental-randomness\"\ntx_power_dbm = -16",
];

/// A network and what happens to it. Faults, orders and moves come at multiples of the control period.
#[derive(Clone, Debug)]
pub(crate) struct Scenario {
    pub(crate) seed: u64,
    pub(crate) n: usize,
    pub(crate) config: String,
    pub(crate) end_ns: u64,
    /// By number of the control period.
    orders: Vec<(u64, MoteOrder)>,
    /// From which control period until which a robot is gone.
    gone: Vec<(usize, u64, u64)>,
    places_m: Vec<[f64; 2]>,
    velocities_mps: Vec<[f64; 2]>,
    payload_bytes: Vec<u32>,
}

/// What is drawn beside places.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spice {
    /// Motes and robots come and go.
    pub(crate) faults: bool,
    /// Channels and areas are jammed.
    pub(crate) jams: bool,
    /// Robots move.
    pub(crate) moves: bool,
}

impl Spice {
    pub(crate) const ALL: Self = Self { faults: true, jams: true, moves: true };
    pub(crate) const NONE: Self = Self { faults: false, jams: false, moves: false };
}

impl Scenario {
    /// A network of 3 to 12 motes that runs for so many seconds.
    pub(crate) fn draw(function: &str, radio: &str, spice: Spice, seed: u64, seconds: u64) -> Self {
        let mut dice = Dice::new(seed, Purpose::Scenario, MoteId(0));
        let n = 3 + dice.below(10) as usize;
        let config = config(function, radio, n, &mut dice);
        let end_ns = seconds * NS_PER_S;
        let n_periods = end_ns / STEP_NS;
        let mut orders = Vec::new();
        let mut gone = Vec::new();
        let mote = |dice: &mut Dice| dice.below(n as u64) as u32;
        if spice.faults {
            for _ in 0..dice.below(4) {
                let (who, when) = (mote(&mut dice), dice.below(n_periods));
                orders.push((when, MoteOrder::Kill(who)));
                orders.push((when + 1 + dice.below(n_periods / 3), MoteOrder::Revive(who)));
            }
            for _ in 0..dice.below(2) {
                let from = dice.below(n_periods);
                gone.push((mote(&mut dice) as usize, from, from + dice.below(n_periods / 3)));
            }
        }
        if spice.jams {
            for _ in 0..dice.below(3) {
                let when = dice.below(n_periods);
                let from_ns = when * STEP_NS + dice.below(NS_PER_S);
                orders.push((
                    when,
                    MoteOrder::Jam {
                        channel: [15, 20, 25, 26][dice.below(4) as usize],
                        from_ns,
                        until_ns: from_ns + dice.below(8 * NS_PER_S),
                        centre_m: [dice.between(0.0, 15.0), dice.between(0.0, 15.0)],
                        radius_m: [0.0, 6.0][dice.below(2) as usize],
                    },
                ));
            }
        }
        for _ in 0..dice.below(12) {
            let payload = Bytes::from(vec![7; 1 + dice.below(200) as usize]);
            let destination = mote(&mut dice);
            let sender = mote(&mut dice);
            if sender != destination {
                let order = MoteOrder::Send { mote: sender, destination, payload };
                orders.push((dice.below(n_periods), order));
            }
        }
        orders.sort_by_key(|(when, _)| *when);
        let side_m = 5.0 * (n as f64).sqrt();
        let places_m = (0..n).map(|_| [0.0; 2].map(|_| dice.between(0.0, side_m))).collect();
        let fast = if spice.moves && dice.below(2) == 0 { 0.4 } else { 0.0 };
        let velocities_mps = (0..n).map(|_| [0.0; 2].map(|_| dice.between(-fast, fast))).collect();
        let payload_bytes = (0..n).map(|_| [0, 4, 20, 60][dice.below(4) as usize]).collect();
        Self { seed, n, config, end_ns, orders, gone, places_m, velocities_mps, payload_bytes }
    }

    /// The set-up, with everything recorded.
    pub(crate) fn setup(&self) -> Setup {
        let mut setup = setup(self.n, &self.config);
        setup.experiment.seed = self.seed;
        setup.columns = vec![
            DeliveryColumn::ReceivedNs,
            DeliveryColumn::RssiDbm,
            DeliveryColumn::Hops,
            DeliveryColumn::Medium,
        ];
        setup.records = vec![
            NetRecord::Packets,
            NetRecord::Frames,
            NetRecord::Capture,
            NetRecord::Statistics,
            NetRecord::Schedule,
            NetRecord::HeardLinks,
        ];
        setup
    }

    /// The network behind its interface.
    pub(crate) fn network(&self) -> Network {
        crate::harness::started(&self.setup()).0
    }

    /// The network itself.
    pub(crate) fn mesh(&self) -> Mesh {
        let setup = self.setup();
        let (mut config, ..) =
            netsim::config::read(&setup, Catalogue::built_in()).unwrap_or_else(|problems| {
                panic!("{}\n{}", crate::harness::text(&problems), self.config)
            });
        let (settings, addresses) = *config.network.take().expect("the full network");
        let Setup { experiment, site, columns, records, .. } = setup;
        Mesh::new(experiment, config, settings, addresses, site, columns, records)
    }

    /// The same with one mote more, which is out of everyone's reach.
    pub(crate) fn with_hermit(&self) -> Self {
        let mut more = self.clone();
        more.n += 1;
        more.places_m.push([1e6, -1e6]);
        more.velocities_mps.push([0.0; 2]);
        more.payload_bytes.push(0);
        more
    }

    /// The same with a further effect of the radio.
    pub(crate) fn with_effect(&self, keys: &str) -> Self {
        let mut more = self.clone();
        more.config.push_str(&format!("[[phy.effect]]\n{keys}\n"));
        more
    }

    /// The robots in a control period.
    pub(crate) fn states(&self, period: u64) -> AgentStates {
        let mut states = AgentStates::at_origin(self.n);
        let time_s = period as f64 * STEP_NS as f64 / NS_PER_S as f64;
        for mote in 0..self.n {
            states.x_m[mote] = self.places_m[mote][0] + time_s * self.velocities_mps[mote][0];
            states.y_m[mote] = self.places_m[mote][1] + time_s * self.velocities_mps[mote][1];
        }
        for &(mote, from, until) in &self.gone {
            if (from..until).contains(&period) {
                states.alive.set(mote, false);
            }
        }
        states
    }

    /// What is ordered at the beginning of a control period.
    pub(crate) fn commands(&self, period: u64) -> Vec<MoteCommand> {
        let of_it = self.orders.iter().filter(|(when, _)| *when == period);
        of_it
            .map(|(_, order)| MoteCommand { source: "test".to_owned(), order: order.clone() })
            .collect()
    }

    /// What robots say in a control period.
    pub(crate) fn payloads(&self, period: u64) -> Payloads {
        let lengths = self.payload_bytes.clone();
        let total: u32 = lengths.iter().sum();
        let data = vec![period as u8; total as usize];
        Payloads::new(lengths, data.into()).expect("as much as the lengths say")
    }

    /// Runs anything that can be stepped from `from_ns` to `until_ns`, within a control period.
    pub(crate) fn step(
        &self,
        from_ns: u64,
        until_ns: u64,
        run: impl FnOnce(&NetInput<'_>) -> NetOutput,
    ) -> NetOutput {
        let period = from_ns / STEP_NS;
        assert!(until_ns <= (period + 1) * STEP_NS, "within a control period");
        let begins = from_ns.is_multiple_of(STEP_NS);
        let commands = if begins { self.commands(period) } else { Vec::new() };
        run(&NetInput {
            step: 1,
            from_ns,
            until_ns,
            states: &self.states(period),
            payloads: &self.payloads(period),
            moved_obstacles: &[],
            commands: &commands,
            stop_at_first_delivery: false,
            records: &[NetRecord::Statistics, NetRecord::Schedule, NetRecord::HeardLinks],
        })
    }

    /// Runs a network from `from_ns` to `until_ns`, within a control period.
    pub(crate) fn step_network(
        &self,
        network: &mut Network,
        from_ns: u64,
        until_ns: u64,
    ) -> NetOutput {
        self.step(from_ns, until_ns, |input| network.step(input))
    }
}

/// Settings under which a small network forms within seconds.
fn config(function: &str, radio: &str, n: usize, dice: &mut Dice) -> String {
    let mut pick = |choices: &[&str]| choices[dice.below(choices.len() as u64) as usize].to_owned();
    let roots = pick(&["", "", "", &format!("roots = [0, {}]\n", n - 1)]);
    let absent = pick(&["", "", "", &format!("absent = [{}]\n", n / 2)]);
    let channels = pick(&["[15]", "[15, 20, 25, 26]", "[15, 20, 25, 26]"]);
    let noise = pick(&["", "", "noise_sd_db = 2.0\n"]);
    let rule = pick(&["o-qpsk", "table"]);
    let mac = pick(&[
        "",
        "pending_bit = true",
        "queue_frames = 4\nmax_retries = 2",
        "keep_alive_s = 2\ndesynchronise_s = 5\nmax_drift_ppm = 100",
        "keep_alive_s = 0\nmax_drift_ppm = 0",
    ]);
    let rpl = pick(&["", "mode = \"storing\"", "objective = \"mrhof\"", "dao_ack = false"]);
    // Its cells are those of parents and children.
    let rpl = if function.contains("alice") { "mode = \"storing\"".to_owned() } else { rpl };
    let lowpan = pick(&["", "fragmentation = \"per-hop\"", "discard_after_last = true"]);
    let energy = pick(&["per-slot", "by-length"]);
    let own_cell = if function.contains("minimal\"")
        || function.contains("msf")
        || function.contains("orchestra")
        || function.contains("alice")
        || function.contains("llsf")
    {
        "broadcast-slotframe"
    } else {
        "own-cell"
    };
    let shared_cell = if function.contains("rrsf") || function.contains("sotdma") {
        "none"
    } else {
        "shared-cell"
    };
    let transport = pick(&["none", "none", own_cell, shared_cell, "unicast-neighbours"]);
    let app = pick(&[
        "",
        "[[app]]\nperiod_s = 2\npayload_bytes = 20\n",
        "[[app]]\nperiod_s = 5\npayload_bytes = 180\n",
        "[[app]]\ndestination = \"peers\"\nperiod_s = 5\n",
        "[[app]]\nperiod_s = 3\n[[app]]\nsenders = [0]\ndestination = \"all\"\nperiod_s = 1\npayload_bytes = 90\n",
        "[[app]]\nkind = \"burst\"\nat_s = 5\nn_packets = 8\n",
    ]);
    let ways =
        pick(&["", "", "", "eb_rule = true", "perfect_acks = true", "no_frame_overhead = true"]);
    let compat = match function.contains("[compat]") || ways.is_empty() {
        true => String::new(),
        false => format!("[compat]\n{ways}\n"),
    };
    format!(
        "mode = \"6tisch\"\nhopping_sequence = {channels}\n{roots}{absent}\
         [phy]\n{radio}\n{noise}[phy.interference]\nkind = \"{rule}\"\n\
         [sf]\n{function}\n\
         [mac]\nbeacon_period_s = 1.0\nbeacon_spacing_s = 0.2\nbeacon_wait_s = 1.0\nscan_dwell_s = 0.2\n{mac}\n\
         [rpl]\ndio_interval_min = 9\ndio_interval_doublings = 4\ndis_period_s = 4\n{rpl}\n\
         [lowpan]\nreassembly_timeout_s = 10\n{lowpan}\n\
         [energy]\nmodel = \"{energy}\"\n\
         [swarm]\ntransport = \"{transport}\"\n{compat}{app}"
    )
}
