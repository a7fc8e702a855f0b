//! The receiver's own waterfall.

use super::{Effect, Entry};
use crate::reception::Curve;
use proto::config::Section;
use proto::effect::{Catalogued, Need};

/// `kind = "reception-curve"`.
pub const ENTRY: Entry = Entry::of::<ReceptionCurve>();

/// A logistic reception curve over RSSI that replaces \[netsim.phy.reception\].
///
/// # Mechanism
///
/// Every radio has its own sensitivity and its own transition from loss to reception, steeper than a table averaged over many
/// receivers.
///
/// # Equation
///
/// ```text
/// P(received) = 1 / (1 + e^(-(RSSI - p50_dbm) / width_db)); 0 and 1 where that is within 10^-6 of them
/// ```
///
/// # Source
///
/// M. Zuniga, B. Krishnamachari, Analyzing the transitional region in low power wireless links, SECON 2004 (a sigmoid in the
/// signal-to-noise ratio); the logistic is its simplest smooth form.
///
/// # Validity
///
/// The same for all receivers and one frame length. It is 0 or 1 beyond 13.8 widths from the midpoint. It replaces the configured
/// curve; noise-floor still shifts it.
///
/// # Trace
///
/// The loss rate is too steep or too shallow over RSSI.
#[derive(Clone, Copy, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "reception-curve",
    needs = &[Need::Losses, Need::Readings],
    example = "p50_dbm = -93.0\nwidth_db = 0.7\n",
    generalises = &["noise-floor"],
)]
pub struct ReceptionCurve {
    /// RSSI (dBm) at which half of all frames are received.
    #[key(range = -140.0..=0.0)]
    #[fit(unit = "dBm", range = -120.0..=-40.0, starts = [-93.0, -85.0], step = 0.05)]
    pub p50_dbm: f64,
    /// Width of the curve (dB): it rises from 27 % to 73 % over twice this. A single radio: 0.3 to 1.
    #[key(range = 0.01..=20.0)]
    #[fit(unit = "dB", range = 0.05..=10.0, starts = [0.7, 2.0], step = 0.02)]
    pub width_db: f64,
}

/// Widths from the middle beyond which the curve is 0 or 1: ln(10⁶).
const TAIL_WIDTHS: f64 = 13.815_510_557_964_274;

impl Curve for ReceptionCurve {
    fn reception_probability(&self, rssi_dbm: f64) -> f64 {
        let x = (rssi_dbm - self.p50_dbm) / self.width_db;
        if x < -TAIL_WIDTHS {
            0.0
        } else if TAIL_WIDTHS <= x {
            1.0
        } else {
            1.0 / (1.0 + libm::exp(-x))
        }
    }

    fn floor_dbm(&self) -> f64 {
        // A little lower, and the ceiling a little higher: rounding must not put either within the curve.
        self.p50_dbm - TAIL_WIDTHS * self.width_db * (1.0 + 1e-9) - 1e-9
    }

    fn ceiling_dbm(&self) -> f64 {
        self.p50_dbm + TAIL_WIDTHS * self.width_db * (1.0 + 1e-9) + 1e-9
    }
}

impl Effect for ReceptionCurve {
    fn curve(&self) -> Option<&dyn Curve> {
        Some(self)
    }

    fn is_isotropic(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_logistic_is_symmetric_rises_and_ends() {
        let curve = ReceptionCurve { p50_dbm: -90.0, width_db: 2.0 };
        let probability = |rssi_dbm| curve.reception_probability(rssi_dbm);
        assert_eq!(probability(-90.0), 0.5);
        // ln 3 and ln 9 widths from the middle stand 3 : 1 and 9 : 1.
        assert!((probability(-90.0 + 2.0 * 3f64.ln()) - 0.75).abs() < 1e-12);
        assert!((probability(-90.0 - 2.0 * 9f64.ln()) - 0.1).abs() < 1e-12);
        assert_eq!(probability(curve.floor_dbm() - 1e-9), 0.0);
        assert_eq!(probability(curve.ceiling_dbm()), 1.0);
        let mut before = 0.0;
        for step in 0..4000 {
            let now = probability(-130.0 + f64::from(step) / 50.0);
            assert!(before <= now);
            before = now;
        }
    }
}
