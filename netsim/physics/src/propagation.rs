//! Base models of propagation: `netsim.phy.propagation`.
//!
//! One file per model, one list: `BUILT_IN`. There are two families. *Signal models* (`friis`, `probabilistic-disk`,
//! `log-distance`, `experimental-randomness`) predict a power, and the reception curve makes a probability of it.
//! *Connectivity models* (`full`, `unit-disk`, `line-of-sight`, `nearest-k`, `gaussian`, `trace`) state the probability
//! themselves; effects in dB then change what is read, not what is received.

pub mod experimental_randomness;
pub mod friis;
pub mod full;
pub mod gaussian;
pub mod line_of_sight;
pub mod log_distance;
pub mod nearest_k;
pub mod probabilistic_disk;
pub mod trace;
pub mod unit_disk;

use super::link::{Link, Scene};
use super::scatter::Scatter;
use bytes::Bytes;
use proto::config::{Problem, Registered, Section, Tag, Variant, Variants};
use std::collections::BTreeMap;

/// A base model of propagation. Stateless: everything it depends on is an argument.
pub trait Propagation: Send + Sync + std::fmt::Debug {
    /// Mean power of a frame at the receiver, and how it decides reception.
    fn predict(&self, link: &Link<'_>) -> Prediction;

    /// What varies at random about the mean, if anything does.
    fn scatter(&self) -> Option<Scatter> {
        None
    }

    /// How far links may reach where frames of less than `floor_dbm` mean power are never received. May be too far,
    /// never too near.
    fn reach(&self, floor_dbm: f64, frequency_hz: f64) -> Reach;

    /// Whether [`Propagation::predict`] depends on nothing but distance and frequency, and neither power nor probability
    /// rises with distance. Then many links can be judged by their distance alone.
    fn is_isotropic(&self) -> bool {
        false
    }

    /// How its mean power falls with distance, where it states that.
    fn path_loss(&self) -> Option<PathLoss> {
        None
    }

    /// Whether every frame arrives, whatever the link.
    fn is_certain(&self) -> bool {
        false
    }

    /// Computes, once per moment, what it asks of the scene.
    fn prepare(&self, _scene: &mut Scene<'_>) {}
}

/// The path loss exponent of free space (Friis).
pub const FREE_SPACE_EXPONENT: f64 = 2.0;

/// How the mean power of a base model falls with distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathLoss {
    /// Path loss exponent: power falls with distance to the power of minus this.
    pub exponent: f64,
    /// The distance (m) up to which free space applies instead.
    pub reference_distance_m: f64,
}

/// What a base model says about a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// Mean power at the receiver (dBm), before effects.
    pub rssi_dbm: f64,
    /// How reception is decided.
    pub reception: Reception,
}

/// How reception is decided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reception {
    /// The reception curve, from the power.
    ByCurve,
    /// With this probability, whatever the power.
    Stated(f64),
}

/// How far links may reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reach {
    /// Anywhere.
    Unlimited,
    /// Within a distance (m).
    Within(f64),
    /// To the neighbours that [`Scene::nearest`] lists for the receiver.
    Listed,
}

/// Radio settings that models share.
#[derive(Clone, Copy, Debug, Default, PartialEq, Section)]
pub struct Radio {
    /// Transmit power (dBm).
    #[key(range = -100.0..=60.0, default = 0.0)]
    pub tx_power_dbm: f64,
    /// Antenna gain of senders (dBi).
    #[key(range = -60.0..=60.0, default = 0.0)]
    pub tx_antenna_gain_dbi: f64,
    /// Antenna gain of receivers (dBi).
    #[key(range = -60.0..=60.0, default = 0.0)]
    pub rx_antenna_gain_dbi: f64,
    /// Carrier frequency (Hz) if no channel is known. The 6TiSCH simulator has 2.4e9. Not written: the middle of the band with
    /// another phy.standard.
    #[key(range = 1e6..=1e12, default = 2.44e9)]
    pub carrier_hz: f64,
}

impl Radio {
    /// Power radiated towards the receiver as its antenna takes it up: transmit power and both gains (dBm).
    #[must_use]
    pub fn total_dbm(&self) -> f64 {
        self.tx_power_dbm + self.tx_antenna_gain_dbi + self.rx_antenna_gain_dbi
    }
}

/// What a model may need to be built.
#[derive(Debug)]
pub struct BuildContext<'a> {
    /// Path of `[netsim.phy]`, for problems.
    pub path: &'a str,
    /// Radio settings that all models share.
    pub radio: Radio,
    /// Capacity of the experiment.
    pub agent_count: usize,
    /// Length of a slot (ns).
    pub slot_ns: u64,
    /// Channels in use, if frames have any; none where measurements are compared without a network.
    pub channels: &'a [u8],
    /// Contents of the files that the configuration names.
    pub files: &'a BTreeMap<String, Bytes>,
    /// What is found wrong.
    pub problems: Vec<Problem>,
    /// What should be checked before the results are trusted.
    pub warnings: Vec<String>,
}

/// A model that can be configured.
#[derive(Debug)]
pub struct Entry {
    /// Its name and keys.
    pub variant: Variant,
    /// What it says of a link.
    pub family: Family,
    /// How long a recording lasts that it replays. [`NOT_REPLAYED`]: it replays none.
    pub replay: Replay,
    /// Makes it of the checked table of `[netsim.phy]`, or adds problems.
    pub build: fn(&toml::Table, &mut BuildContext<'_>) -> Option<Box<dyn Propagation>>,
}

/// What a base model says of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// The power of frames, of which the reception curve makes a probability.
    Signal,
    /// The probability of reception: the reception curve decides nothing.
    Connectivity,
    /// What was measured, on the channels on which it was: beside the reception curve, power, antennas and least distance
    /// decide nothing, and frames need a channel.
    Recording,
}

/// How long (ns) the recording of a checked table of `[netsim.phy]` lasts, the files given. `None`: a run may be longer.
pub type Replay = fn(&toml::Table, &BTreeMap<String, Bytes>) -> Option<u64>;

/// The model replays no trace.
pub const NOT_REPLAYED: Replay = |_, _| None;

impl Registered for Entry {
    fn variant(&self) -> &Variant {
        &self.variant
    }
}

/// What descriptions call the list of models.
pub(crate) const LIST: &str = "netsim.phy.propagation";

/// The models that are built in.
pub(crate) const BUILT_IN: &[Entry] = &[
    experimental_randomness::ENTRY,
    friis::ENTRY,
    full::ENTRY,
    gaussian::ENTRY,
    line_of_sight::ENTRY,
    log_distance::ENTRY,
    nearest_k::ENTRY,
    probabilistic_disk::ENTRY,
    trace::ENTRY,
    unit_disk::ENTRY,
];

/// The key that selects a model.
pub const TAG: Tag = Tag {
    key: "propagation",
    doc: "The base propagation model.",
    default: Some(friis::ENTRY.variant.name),
    variants: Variants::List(LIST),
};

/// The key of connectivity models, which say who receives a frame whatever its power.
#[derive(Section)]
struct Reading {
    /// RSSI reading of every frame (dBm). Absent: computed by the Friis equation. It does not affect reception.
    #[key(range = -200.0..=100.0)]
    rssi_dbm: Option<f64>,
}

/// The power that connectivity models assign: Friis, unless configured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AssignedRssi {
    radio: Radio,
    constant_dbm: Option<f64>,
}

impl AssignedRssi {
    /// A constant, or Friis for `None`.
    #[must_use]
    pub fn new(radio: Radio, constant_dbm: Option<f64>) -> Self {
        Self { radio, constant_dbm }
    }

    fn dbm(&self, link: &Link<'_>) -> f64 {
        self.constant_dbm.unwrap_or_else(|| {
            friis::friis_dbm(self.radio.total_dbm(), link.distance_m, link.frequency_hz)
        })
    }
}
