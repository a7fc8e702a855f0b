//! A constant offset.

use super::{Effect, Entry, UNCHECKED};
use crate::phy::link::Link;
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, CONSTANT, Fit, Fixed, Level, Need, Parameter};
use serde::Deserialize;

/// `kind = "system-gain"`.
pub const ENTRY: Entry = Entry {
    variant: Variant {
        name: "system-gain",
        doc: "A constant offset: losses of connectors and matching, or an error of the RSSI register.",
        fields: &[
            Field {
                key: "gain_db",
                doc: "Offset (dB). Losses are negative.",
                kind: Kind::Number(Range::closed(-100.0, 100.0)),
                default: Default::Required,
            },
            Field {
                key: "register_only",
                doc: "Whether only the RSSI reading changes, and not reception.",
                kind: Kind::Bool,
                default: Default::Bool(false),
            },
        ],
    },
    about: About {
        mechanism: "Connectors, cables and mismatched antennas lose the same fraction of every frame's power. Or the RSSI \
                    register of a whole series has a constant error (register_only), which does not affect reception.",
        equation: "RSSI' = RSSI + gain_db",
        source: "Definition. A register's offset: CC2420 data sheet, § 23 (RSSI_OFFSET, about -45 dB, +-6 dB accuracy).",
        validity: "The same on all links, at any power. It is aliased with an error of tx_power_dbm.",
        trace: "The same bias on every link, distance, channel and time.",
        needs: &[Need::Readings],
        example: "gain_db = -3.0\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "gain_db",
            unit: "dB",
            min: -100.0,
            max: 100.0,
            starts: &[0.0],
            step: 0.1,
        }],
        variants: &[
            &[("register_only", Fixed::Bool(false))],
            &[("register_only", Fixed::Bool(true))],
        ],
        level: Level::Time,
        generalises: &[],
        linear_in: Some(CONSTANT),
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table, _| {
        let effect: SystemGain = typed(table);
        Some(Box::new(effect))
    },
};

/// A constant offset of the received power, or of its reading.
///
/// # Model
///
/// ```text
/// RSSI' = RSSI + gain_db
/// ```
///
/// # Validity
///
/// All links alike, at any power. It is aliased with an error of `tx_power_dbm`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub struct SystemGain {
    /// What is added (dB).
    pub gain_db: f64,
    /// Only to what is read.
    pub register_only: bool,
}

impl Effect for SystemGain {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn contribution_db(&self, _: &Link<'_>) -> f64 {
        if self.register_only { 0.0 } else { self.gain_db }
    }

    fn max_gain_db(&self) -> f64 {
        if self.register_only { 0.0 } else { self.gain_db }
    }

    fn register_dbm(&self, _: &Link<'_>, register_dbm: f64) -> f64 {
        if self.register_only { register_dbm + self.gain_db } else { register_dbm }
    }

    fn is_isotropic(&self) -> bool {
        true
    }
}
