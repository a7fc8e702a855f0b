//! A register that saturates.

use super::{Effect, Entry};
use crate::link::Link;
use proto::config::{Range, Section};
use proto::effect::{Catalogued, Need};

/// `kind = "receiver-nonlinearity"`.
pub const ENTRY: Entry = Entry::of::<ReceiverNonlinearity>();

/// The RSSI register saturates for strong frames. Reception does not change.
///
/// # Mechanism
///
/// Close to the transmitter, the receiver's amplifiers and detector saturate, and the register reads too low.
///
/// # Equation
///
/// ```text
/// reading = s + slope * (RSSI - s) for RSSI > s = saturation_dbm
/// ```
///
/// # Source
///
/// Y. Chen, A. Terzis, On the mechanisms and effects of calibrating RSSI measurements for 802.15.4 radios, EWSN 2010 (non-linear
/// regions of the CC2420's register).
///
/// # Validity
///
/// Piecewise linear with one breakpoint; the CC2420 has further, smaller non-linear regions. The same for all receivers.
///
/// # Trace
///
/// An error over the predicted RSSI itself: strong links read too low.
#[derive(Clone, Copy, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "receiver-nonlinearity",
    needs = &[Need::Readings],
    example = "saturation_dbm = -55.0\nslope = 0.4\n",
)]
pub struct ReceiverNonlinearity {
    /// Power (dBm) from which readings are compressed.
    #[key(range = -120.0..=30.0)]
    #[fit(unit = "dBm", range = -110.0..=0.0, starts = [-90.0, -80.0, -70.0, -60.0, -50.0, -40.0, -30.0], step = 0.1)]
    pub saturation_dbm: f64,
    /// Slope of the reading above that power: 0 for full saturation, 1 for no compression.
    #[key(range = Range::FRACTION)]
    #[fit(unit = "", range = 0.0..=1.0, starts = [0.5], step = 0.01)]
    pub slope: f64,
}

impl Effect for ReceiverNonlinearity {
    fn register_dbm(&self, _: &Link<'_>, register_dbm: f64) -> f64 {
        if register_dbm <= self.saturation_dbm {
            return register_dbm;
        }
        self.saturation_dbm + self.slope * (register_dbm - self.saturation_dbm)
    }

    fn is_isotropic(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::testing::{along_x, over_friis};
    use crate::link::Scene;

    #[test]
    fn readings_follow_two_lines_and_reception_does_not_change() {
        let scene = Scene::default();
        let effect = ReceiverNonlinearity { saturation_dbm: -50.0, slope: 0.25 };
        let link = along_x(1.0, 1.0, None, &scene);
        for (power_dbm, expected_dbm) in
            [(-90.0, -90.0), (-50.0, -50.0), (-46.0, -49.0), (-10.0, -40.0)]
        {
            assert_eq!(effect.register_dbm(&link, power_dbm), expected_dbm);
        }
        let budget = over_friis(Some(Box::new(effect))).evaluate(&link);
        let alone = over_friis(None).evaluate(&link);
        assert_eq!(budget.rssi_dbm, alone.rssi_dbm);
        assert_eq!(budget.register_rssi_dbm, -50.0 + 0.25 * (alone.rssi_dbm + 50.0));
    }
}
