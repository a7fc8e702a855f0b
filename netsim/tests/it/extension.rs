//! A user's own kinds, all in this file: each is added to the catalogue by one call, and then is configured, refused, described
//! and simulated as those that are built in.

use crate::harness::{interval, pairs_of, period, setup, standing_at, text};
use netsim::catalogue::Catalogue;
use netsim::mac::effect::{self as mac, Burden, Duty, Node};
use netsim::sf::{self, Configured, Context, PayloadCells, SchedulingFunction};
use netsim::sim::Network;
use physics::link::Link;
use physics::propagation::{self, Family, NOT_REPLAYED, Prediction, Propagation, Reach, Reception};
use physics::reception::{self, Curve};
use physics::{effect, interference};
use proto::config::{Range, Section, variant};
use proto::effect::Catalogued;
use proto::ids::MoteId;
use proto::side::{NetSimulator as _, Setup};
use proto::time::SimDuration;
use serde::{Deserialize, Serialize};

/// `kind = "flat-loss"`.
static LOSS: effect::Entry = effect::Entry::of::<FlatLoss>();

/// A loss that is the same for all links.
///
/// # Mechanism
///
/// A cable takes power from every antenna.
///
/// # Equation
///
/// RSSI' = RSSI - loss_db
///
/// # Source
///
/// An example: not taken from the literature.
///
/// # Validity
///
/// The same on all channels.
///
/// # Trace
///
/// All links are weaker by the same.
#[derive(Debug, Catalogued, Section)]
#[effect(name = "flat-loss")]
struct FlatLoss {
    /// The loss (dB).
    #[key(range = 0.0..=60.0)]
    #[fit(unit = "dB", starts = [3.0], step = 0.05)]
    loss_db: f64,
}

impl effect::Effect for FlatLoss {
    fn contribution_db(&self, _link: &Link<'_>) -> f64 {
        -self.loss_db
    }
}

/// `kind = "mute-motes"`.
static MUTE: mac::Entry = mac::Entry { needs_kept_time: true, ..mac::Entry::of::<MuteMotes>() };

/// Motes that send one frame, and then nothing for longer than any test lasts.
///
/// # Mechanism
///
/// Their transmitters are limited.
///
/// # Equation
///
/// airtime <= fraction
///
/// # Source
///
/// An example: not taken from the literature.
///
/// # Validity
///
/// At all times.
///
/// # Trace
///
/// They send nothing.
#[derive(Debug, Catalogued, Section)]
#[effect(name = "mute-motes")]
struct MuteMotes {
    /// Fraction of the time for which they may transmit.
    #[key(range = 0.0..=1e-6)]
    fraction: f64,
    #[key(flatten)]
    concerned: mac::Concerned,
}

impl mac::Effect for MuteMotes {
    fn weigh(&self, node: Node, burden: &mut Burden) {
        if self.concerned.includes(node.mote) {
            burden.duty = Some(Duty { fraction: self.fraction, window: SimDuration::SECOND });
        }
    }
}

/// `kind = "one-cell"`.
static ONE_CELL: sf::Entry = sf::Entry {
    variant: variant::<OneCell>("one-cell"),
    payload_cells: PayloadCells::Shared,
    build: |table, _| Some(sf::Config::new(OneCell::read(table))),
};

/// The minimal cell, every so many slots.
#[derive(Clone, Debug, PartialEq, Section, Serialize, Deserialize)]
struct OneCell {
    /// Length of the slotframe (slots).
    #[key(range = 1..=20, default = 11)]
    length: u16,
}

impl Configured for OneCell {
    type OfMote = Self;

    fn create(&self, _mote: MoteId) -> Self {
        self.clone()
    }
}

impl SchedulingFunction for OneCell {
    fn start(&mut self, _cx: &mut Context<'_>) {}

    fn stop(&mut self) {}

    fn slotframe_slots(&self) -> u16 {
        self.length
    }

    fn minimal_cell(&self) -> Option<u16> {
        Some(self.length)
    }
}

/// `propagation = "upwards-only"`.
static UPWARDS: propagation::Entry = propagation::Entry {
    variant: variant::<Upwards>("upwards-only"),
    family: Family::Connectivity,
    replay: NOT_REPLAYED,
    build: |table, _| Some(Box::new(Upwards::read(table))),
};

/// Frames go to motes of higher number only.
#[derive(Debug, Section)]
struct Upwards {
    /// Power of every frame (dBm).
    #[key(range = -100.0..=0.0)]
    power_dbm: f64,
}

impl Propagation for Upwards {
    fn predict(&self, link: &Link<'_>) -> Prediction {
        let is_upwards = link.sender.id < link.receiver.id;
        let reception = Reception::Stated(if is_upwards { 1.0 } else { 0.0 });
        Prediction { rssi_dbm: self.power_dbm, reception }
    }

    fn reach(&self, _floor_dbm: f64, _frequency_hz: f64) -> Reach {
        Reach::Unlimited
    }
}

/// `kind = "step-curve"`.
static STEP: reception::Entry = reception::Entry {
    variant: variant::<Step>("step-curve"),
    build: |table, _, _| Some(Box::new(Step::read(table))),
};

/// All or nothing.
#[derive(Debug, Section)]
struct Step {
    /// Power from which on frames are received (dBm).
    #[key(range = -200.0..=0.0)]
    threshold_dbm: f64,
}

impl Curve for Step {
    fn reception_probability(&self, rssi_dbm: f64) -> f64 {
        if self.threshold_dbm <= rssi_dbm { 1.0 } else { 0.0 }
    }

    fn floor_dbm(&self) -> f64 {
        self.threshold_dbm
    }

    fn ceiling_dbm(&self) -> f64 {
        self.threshold_dbm
    }
}

/// `kind = "no-interference"`.
static PEACE: interference::Entry = interference::Entry {
    variant: variant::<Peace>("no-interference"),
    build: |table| Some(Box::new(Peace::read(table))),
};

/// Nobody disturbs anybody.
#[derive(Debug, Section)]
struct Peace {
    /// Probability that a frame survives.
    #[key(range = Range::FRACTION)]
    share: f64,
}

impl interference::Rule for Peace {
    fn disturbance_mw(&self, _rssi_dbm: f64) -> f64 {
        0.0
    }

    fn survival(&self, _signal_dbm: f64, _mw: f64, _stretch_ns: i64, _frame_ns: i64) -> f64 {
        self.share
    }

    fn capture_db(&self) -> f64 {
        f64::INFINITY
    }

    fn hides_preambles(&self) -> bool {
        false
    }
}

fn catalogue() -> Catalogue {
    let mut catalogue = Catalogue::default();
    catalogue.physics.effects.add(&LOSS);
    catalogue.mac_effects.add(&MUTE);
    catalogue.scheduling_functions.add(&ONE_CELL);
    catalogue.physics.propagation.add(&UPWARDS);
    catalogue.physics.reception.add(&STEP);
    catalogue.physics.interference.add(&PEACE);
    catalogue
}

fn started(setup: &Setup) -> Network {
    let mut network = Network::with_catalogue(catalogue());
    network.configure(setup).unwrap_or_else(|problems| panic!("{}", text(&problems)));
    network
}

/// What is wrong with a configuration.
fn refusal(config: &str) -> String {
    text(&netsim::config::read(&setup(3, config), &catalogue()).expect_err("it is wrong"))
}

/// A network over the scheduling function and the rule of this file.
const NETWORK: &str = "mode = \"6tisch\"\nswarm.transport = \"none\"\nsf.kind = \"one-cell\"\n\
    phy = { propagation = \"full\", interference = { kind = \"no-interference\", share = 1.0 } }\n";

#[test]
fn each_is_refused_by_its_own_range_and_unknown_where_it_was_not_added() {
    insta::assert_snapshot!(refusal("[[phy.effect]]\nkind = \"flat-loss\"\nloss_db = 70"), @"netsim.phy.effect[0].loss_db: must be from 0 to 60, got 70 (nearest valid: 60)");
    insta::assert_snapshot!(refusal(&format!("{NETWORK}[[mac.effect]]\nkind = \"mute-motes\"\nfraction = 1\nmotes = [5]")), @"
    netsim.mac.effect[0].fraction: must be from 0 to 0.000001, got 1 (nearest valid: 0.000001)
    netsim.mac.effect[0].motes[0]: must be the number of a mote, 0 to 2, got 5 (nearest valid: 2)
    ");
    insta::assert_snapshot!(refusal(&format!("{NETWORK}mac.keep_alive_s = 0\nmac.max_drift_ppm = 0\n[[mac.effect]]\nkind = \"mute-motes\"\nfraction = 0")), @"netsim.mac.effect[0].kind: requires keep_alive_s other than 0, because drifting clocks must be resynchronised");
    insta::assert_snapshot!(refusal(&format!("{NETWORK}sf.length = 21")), @"netsim.sf.length: must be a whole number from 1 to 20, got 21 (nearest valid: 20)");
    insta::assert_snapshot!(refusal(&NETWORK.replace("none", "own-cell")), @r#"netsim.swarm.transport: does not apply with sf.kind = "one-cell", because it gives no mote a cell for itself, got "own-cell" (nearest valid: "broadcast-slotframe")"#);
    insta::assert_snapshot!(refusal("phy = { propagation = \"upwards-only\", power_dbm = 3 }"), @"netsim.phy.power_dbm: must be from -100 to 0, got 3 (nearest valid: 0)");
    insta::assert_snapshot!(refusal("phy.reception = { kind = \"step-curve\", threshold_dbm = 3 }"), @"netsim.phy.reception.threshold_dbm: must be from -200 to 0, got 3 (nearest valid: 0)");
    insta::assert_snapshot!(refusal(&NETWORK.replace("share = 1.0", "share = 2.0")), @"netsim.phy.interference.share: must be from 0 to 1, got 2.0 (nearest valid: 1)");
    let setup = setup(3, NETWORK);
    let problems = netsim::config::read(&setup, Catalogue::built_in()).unwrap_err();
    let paths: Vec<&str> = problems.iter().map(|problem| problem.path.as_str()).collect();
    assert_eq!(
        paths,
        ["netsim.sf.kind", "netsim.phy.interference.kind", "netsim.phy.interference.share"]
    );
}

#[test]
fn each_is_in_the_schema_with_its_keys() {
    let schema = Network::with_catalogue(catalogue()).config_schema_json();
    for (name, key) in [
        ("flat-loss", "loss_db"),
        ("mute-motes", "fraction"),
        ("one-cell", "length"),
        ("upwards-only", "power_dbm"),
        ("step-curve", "threshold_dbm"),
        ("no-interference", "share"),
    ] {
        assert!(schema.contains(&format!("{{\"const\":{name:?}}}")), "{name}");
        assert!(schema.contains(&format!("{key:?}:{{")), "{key}");
        assert!(!Network::default().config_schema_json().contains(name), "{name}");
    }
}

#[test]
fn a_base_model_decides_who_hears_whom_and_a_curve_from_which_power_on() {
    let config = "phy = { propagation = \"upwards-only\", power_dbm = -50 }";
    let places = standing_at(&[(0.0, 0.0), (1.0, 0.0), (9.0, 0.0)]);
    let mut network = started(&setup(3, config));
    let deliveries = period(&mut network, &places, 0).deliveries;
    assert_eq!(pairs_of(&deliveries, 3), [(1, 0), (2, 0), (2, 1)]);
    // Friis at 0 dBm and 2.44 GHz: -40.2 dBm over 1 m, -58.3 dBm over 8 m, -59.3 dBm over 9 m.
    let step = "phy.reception = { kind = \"step-curve\", threshold_dbm = -58.5 }";
    let mut network = started(&setup(3, step));
    let deliveries = period(&mut network, &places, 0).deliveries;
    assert_eq!(pairs_of(&deliveries, 3), [(0, 1), (1, 0), (1, 2), (2, 1)]);
}

#[test]
fn a_radio_effect_weakens_what_is_received_in_a_run_and_in_a_comparison() {
    let config = |loss_db: f64| {
        format!(
            "phy.reception = {{ kind = \"step-curve\", threshold_dbm = -45 }}\n\
             [[phy.effect]]\nkind = \"flat-loss\"\nloss_db = {loss_db:?}"
        )
    };
    let places = standing_at(&[(0.0, 0.0), (1.0, 0.0)]);
    for (loss_db, n_heard) in [(0.0, 2), (4.0, 2), (5.0, 0)] {
        let mut network = started(&setup(2, &config(loss_db)));
        let deliveries = period(&mut network, &places, 0).deliveries;
        assert_eq!(pairs_of(&deliveries, 2).len(), n_heard, "{loss_db}");
    }
    let phy = proto::config::parse(&config(5.0)).unwrap().take("phy").unwrap();
    let files = std::collections::BTreeMap::new();
    let (model, _) =
        physics::section::read(&phy, "netsim.phy", 2, &files, &catalogue().physics).unwrap();
    assert_eq!(model.effects[0].name(), "flat-loss");
}

#[test]
fn a_scheduling_function_forms_a_network_and_an_effect_on_motes_keeps_it_from_forming() {
    let joined = |config: &str| {
        let mut network = started(&setup(3, config));
        let states = standing_at(&[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)]);
        let motes = interval(&mut network, &states, 0, 1_200_000_000_000).motes;
        let joined = motes.joined.expect("the network reports it");
        (0..3).filter(|&mote| joined.get(mote)).count()
    };
    assert_eq!(joined(NETWORK), 3);
    let effect = "[[mac.effect]]\nkind = \"mute-motes\"\nfraction = 0\nmotes = [0]";
    assert_eq!(joined(&format!("{NETWORK}{effect}")), 1);
}

#[test]
fn a_scheduling_function_says_how_long_its_slotframe_is() {
    let slots = |text: &str| {
        let node = proto::config::parse(&format!("{NETWORK}{text}")).unwrap();
        netsim::config::slotframe_slots(&node, 3, &catalogue())
    };
    assert_eq!((slots(""), slots("sf.length = 7")), (11, 7));
}

#[test]
fn a_saved_network_goes_on_where_its_scheduling_function_is_known() {
    let states = standing_at(&[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)]);
    let mut network = started(&setup(3, NETWORK));
    interval(&mut network, &states, 0, 60_000_000_000);
    let saved = network.snapshot();
    let mut other = Network::with_catalogue(catalogue());
    other.restore(&saved).unwrap();
    assert!(other.snapshot() == saved);
    let go_on = |network: &mut Network| {
        interval(network, &states, 60_000_000_000, 600_000_000_000);
        network.snapshot()
    };
    assert!(go_on(&mut network) == go_on(&mut other));
    let refused = Network::default().restore(&saved).unwrap_err();
    assert!(refused.to_string().contains("one-cell"), "{refused}");
}
