//! What is run.

use crate::structure::Structure;
use netsim::catalogue::Catalogue;
use netsim::sf::PayloadCells;
use netsim::sim::Network;
use proto::config::parse;
use proto::side::{NetInput, NetOutput, NetSimulator, Setup};
use proto::site::Site;
use proto::types::{AgentStates, Coupling, Experiment, NS_PER_S, NetRecord, Payloads};
use std::collections::BTreeMap;

/// The scheduling functions: all that give motes cells.
pub(crate) fn schedulers() -> impl Iterator<Item = &'static str> {
    let all = Catalogue::built_in().scheduling_functions.iter();
    all.filter(|entry| entry.payload_cells != PayloadCells::None).map(|entry| entry.variant.name)
}

/// Propagation models, with the keys of `[netsim.phy]`. `trace` replays what was measured, whatever the line.
pub(crate) const MODELS: [(&str, &str); 8] = [
    ("full", "propagation = \"full\""),
    ("unit-disk", "propagation = \"unit-disk\"\nradius_m = 10.0"),
    ("gaussian", "propagation = \"gaussian\"\nsigma_m = 5.0"),
    ("nearest-k", "propagation = \"nearest-k\"\nk = 6"),
    ("friis", "propagation = \"friis\""),
    ("log-distance", "propagation = \"log-distance\"\nexponent = 3.0\ntx_power_dbm = -15.0"),
    ("probabilistic-disk", "propagation = \"probabilistic-disk\""),
    ("experimental-randomness", "propagation = \"experimental-randomness\""),
];

/// A network that is to form.
pub(crate) struct Case<'a> {
    /// The scheduling function.
    pub(crate) scheduler: &'a str,
    /// Keys of `[netsim.phy]`.
    pub(crate) model: &'a str,
    /// Motes.
    pub(crate) n: usize,
}

/// Distance between neighbours on the line (m).
const SPACING_M: f64 = 2.0;
/// Control period (ns), in which models that draw anew draw once.
const PERIOD_NS: u64 = 100_000_000;

impl Case<'_> {
    fn config(&self) -> String {
        let cells = match self.scheduler {
            "static" => self.static_cells(),
            "alice" => "[rpl]\nmode = \"storing\"\n".to_owned(),
            _ => String::new(),
        };
        format!(
            "mode = \"6tisch\"\n[phy]\n{}\n[swarm]\ntransport = \"none\"\n[sf]\nkind = \"{}\"\n{cells}",
            self.model, self.scheduler
        )
    }

    /// The minimal cell, and a slot for every mote in which it sends to all others.
    fn static_cells(&self) -> String {
        let slots = self.n + 1;
        let mut text = format!("slotframe_slots = {slots}\nminimal_cell_slots = 101\n");
        for mote in 0..self.n {
            text.push_str(&format!(
                "[[sf.cell]]\nslot = {}\nfrom = {mote}\nto = \"all\"\n",
                mote + 1
            ));
        }
        text
    }

    /// Runs until the network has formed: when that was (ns), and what it looks like at most two seconds later. `None`: it
    /// did not within `limit_s`.
    pub(crate) fn form(&self, seed: u64, limit_s: u64) -> Option<(u64, Structure)> {
        let n = self.n;
        let setup = Setup {
            experiment: Experiment {
                seed,
                agent_count: n,
                step_ns: PERIOD_NS,
                coupling: Coupling::Sequential,
            },
            site: Site::default(),
            config: parse(&self.config()).expect("TOML"),
            path: "netsim".to_owned(),
            files: BTreeMap::new(),
            columns: Vec::new(),
            records: vec![NetRecord::HeardLinks],
        };
        let mut network = Network::default();
        network.configure(&setup).unwrap_or_else(|problems| panic!("{problems:?}"));
        let mut states = AgentStates::at_origin(n);
        for (place, y_m) in states.y_m.iter_mut().enumerate() {
            // 0, 1, −1, 2, −2, …
            let side = if place % 2 == 1 { 1.0 } else { -1.0 };
            *y_m = side * place.div_ceil(2) as f64 * SPACING_M;
        }
        let payloads = Payloads::silence(n);
        let mut step = 0;
        let mut a_second = |records: &[NetRecord]| {
            step += 1;
            network.step(&NetInput {
                step,
                from_ns: (step - 1) * NS_PER_S,
                until_ns: step * NS_PER_S,
                states: &states,
                payloads: &payloads,
                moved_obstacles: &[],
                commands: &[],
                stop_at_first_delivery: false,
                records,
            })
        };
        for _ in 0..limit_s {
            if let Some(formed_ns) = formed_ns(&a_second(&[])) {
                let output = a_second(&[NetRecord::HeardLinks]);
                let links = output.heard_links.expect("asked for");
                return Some((formed_ns, Structure::from_parents(&output.motes.parent, &links)));
            }
        }
        None
    }
}

fn formed_ns(output: &NetOutput) -> Option<u64> {
    output.formation.as_ref().and_then(|formation| formation.formed_ns)
}
