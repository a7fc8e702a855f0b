//! `[netsim.energy]`.

use crate::energy::{BATTERY_AA_MAH, Model};
use physics::timing::Airtime;
use proto::config::{Choice, Problem, Section, TableSpec, join};

/// Description of `[netsim.energy]`.
pub(super) const SPEC: TableSpec = Keys::SPEC;

/// The energy model: from radio activity to charge.
#[derive(Section)]
struct Keys {
    /// How the charge of a slot is computed.
    #[key(default = ModelKey::PerSlot)]
    model: ModelKey,
    /// Current while the radio sends (mA), with model = "by-time". Absent: 24, the CC2538 at 0 dBm.
    #[key(range = 0.0..=1e4)]
    tx_ma: Option<f64>,
    /// Current while the radio listens (mA), with model = "by-time". Absent: 20, the CC2538.
    #[key(range = 0.0..=1e4)]
    rx_ma: Option<f64>,
    /// Charge of a new battery (mAh). 2821.5: two AA cells, as in the 6TiSCH simulator.
    #[key(above = 0.0, most = 1e9, default = BATTERY_AA_MAH)]
    battery_mah: f64,
    /// Whether a mote whose battery is empty fails. Batteries are checked at the start of each control period. Roots have no
    /// battery. Absent or false: batteries are only reported, and motes run on.
    deaths: Option<bool>,
}

/// The values of `model`.
#[derive(Choice)]
enum ModelKey {
    /// One charge per kind of slot: the 6TiSCH simulator's table.
    PerSlot,
    /// By frame length: TSCH-Sim's regression for the CC2650.
    ByLength,
    /// By the time in which the radio sends and listens, for any phy.standard.
    ByTime,
}

/// Makes the model, the battery (mAh) and whether an empty one kills, of the checked table at `path`, or adds problems.
pub(super) fn build(
    table: &toml::Table,
    path: &str,
    airtime: Airtime,
    problems: &mut Vec<Problem>,
) -> (Model, f64, bool) {
    let keys = Keys::read(table);
    let model = match keys.model {
        ModelKey::PerSlot => Model::PerSlot,
        ModelKey::ByLength => Model::ByLength,
        ModelKey::ByTime => {
            let (tx_ma, rx_ma) = (keys.tx_ma.unwrap_or(24.0), keys.rx_ma.unwrap_or(20.0));
            Model::ByTime { tx_ma, rx_ma, airtime }
        }
    };
    for (key, current_ma) in [("tx_ma", keys.tx_ma), ("rx_ma", keys.rx_ma)] {
        if let (Some(current_ma), false) = (current_ma, matches!(model, Model::ByTime { .. })) {
            let message = "does not apply with this model, only with model = \"by-time\"";
            problems.push(Problem::new(join(path, key), message).value(current_ma));
        }
    }
    (model, keys.battery_mah, keys.deaths == Some(true))
}
