//! A constant offset.

use super::{Effect, Entry};
use crate::link::Link;
use proto::config::Section;
use proto::effect::{CONSTANT, Catalogued, Fixed, Need};

/// `kind = "system-gain"`.
pub const ENTRY: Entry = Entry::of::<SystemGain>();

/// A constant offset: losses of connectors and matching, or an error of the RSSI register.
///
/// # Mechanism
///
/// Connectors, cables and mismatched antennas lose the same fraction of every frame's power. Or the RSSI register of a whole series
/// has a constant error (register_only), which does not affect reception.
///
/// # Equation
///
/// ```text
/// RSSI' = RSSI + gain_db
/// ```
///
/// # Source
///
/// Definition. A register's offset: CC2420 data sheet, § 23 (RSSI_OFFSET, about -45 dB, +-6 dB accuracy).
///
/// # Validity
///
/// The same on all links, at any power. It is aliased with an error of tx_power_dbm.
///
/// # Trace
///
/// The same bias on every link, distance, channel and time.
#[derive(Clone, Copy, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "system-gain",
    needs = &[Need::Readings],
    example = "gain_db = -3.0\n",
    variants = &[&[("register_only", Fixed::Bool(false))], &[("register_only", Fixed::Bool(true))]],
    linear_in = Some(CONSTANT),
)]
pub struct SystemGain {
    /// Offset (dB). Losses are negative.
    #[key(range = -100.0..=100.0)]
    #[fit(unit = "dB", starts = [0.0], step = 0.1, null = 0.0)]
    pub gain_db: f64,
    /// Whether only the RSSI reading changes, and not reception.
    #[key(default = false)]
    pub register_only: bool,
}

impl Effect for SystemGain {
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
