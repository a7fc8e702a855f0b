//! `[netsim.energy]`.

use crate::energy::{BATTERY_AA_MAH, Model};
use proto::config::{Choice, Default, Field, Kind, Range, TableSpec, typed};
use serde::Deserialize;

/// Description of `[netsim.energy]`.
pub(super) const SPEC: TableSpec = TableSpec {
    doc: "The energy model: from radio activity to charge.",
    fields: &[
        Field {
            key: "model",
            doc: "How the charge of a slot is computed.",
            kind: Kind::Choice(&[
                Choice {
                    name: "per-slot",
                    doc: "One charge per kind of slot: the 6TiSCH simulator's table.",
                },
                Choice {
                    name: "by-length",
                    doc: "By frame length: TSCH-Sim's regression for the CC2650.",
                },
            ]),
            default: Default::Text("per-slot"),
        },
        Field {
            key: "battery_mah",
            doc: "Charge of a new battery (mAh). 2821.5: two AA cells, as in the 6TiSCH simulator.",
            kind: Kind::Number(Range::above(0.0, 1e9)),
            default: Default::Number(BATTERY_AA_MAH),
        },
        Field {
            key: "deaths",
            doc: "Whether a mote whose battery is empty fails. Batteries are checked at the start of each control period. Roots \
                  have no battery. Absent or false: batteries are only reported, and motes run on.",
            kind: Kind::Bool,
            default: Default::Absent,
        },
    ],
    tag: None,
};

/// Keys of `[netsim.energy]`.
#[derive(Deserialize)]
struct Keys {
    model: ModelKey,
    battery_mah: f64,
    #[serde(default)]
    deaths: bool,
}

/// The values of `model`.
#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum ModelKey {
    PerSlot,
    ByLength,
}

/// Makes the model, the battery (mAh) and whether an empty one kills, of the checked table.
pub(super) fn build(table: &toml::Table) -> (Model, f64, bool) {
    let keys: Keys = typed(table);
    let model = match keys.model {
        ModelKey::PerSlot => Model::PerSlot,
        ModelKey::ByLength => Model::ByLength,
    };
    (model, keys.battery_mah, keys.deaths)
}
