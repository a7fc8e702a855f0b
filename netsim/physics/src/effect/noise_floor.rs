//! A receiver noisier than the curve's.

use super::{Effect, Entry};
use crate::link::Link;
use proto::config::Section;
use proto::effect::{Catalogued, Need};

/// `kind = "noise-floor"`.
pub const ENTRY: Entry = Entry::of::<NoiseFloor>();

/// The noise differs from that of the reception curve: the curve shifts, the RSSI does not.
///
/// # Mechanism
///
/// The site is noisier, or the receiver less sensitive, than when the reception curve was measured, so frames must be stronger to
/// be received. The RSSI of received frames does not change.
///
/// # Equation
///
/// ```text
/// P(received) = curve(RSSI - shift_db)
/// ```
///
/// # Source
///
/// Definition: reception depends on the signal-to-noise ratio.
///
/// # Validity
///
/// The same for all receivers at all times. No effect on connectivity models, which define the reception probability.
///
/// # Trace
///
/// Frames are lost at an RSSI that should suffice; the RSSI of received frames is correct.
#[derive(Clone, Copy, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "noise-floor",
    needs = &[Need::Losses, Need::Readings],
    example = "shift_db = 4.0\n",
)]
pub struct NoiseFloor {
    /// Shift (dB): the RSSI at which a frame is received with the same probability rises by this.
    #[key(range = -60.0..=60.0)]
    #[fit(unit = "dB", range = -40.0..=40.0, starts = [0.0], step = 0.05, null = 0.0)]
    pub shift_db: f64,
}

impl Effect for NoiseFloor {
    fn max_gain_db(&self) -> f64 {
        -self.shift_db
    }

    fn curve_shift_db(&self, _: &Link<'_>) -> f64 {
        self.shift_db
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::testing::{along_x, over_friis};
    use crate::link::Scene;
    use crate::reception::Curve as _;
    use crate::reception::table::Table;

    #[test]
    fn the_curve_moves_and_the_reading_does_not() {
        let scene = Scene::default();
        let link = along_x(400.0, 1.0, None, &scene);
        let (alone, noisy) = (
            over_friis(None).evaluate(&link),
            over_friis(Some(Box::new(NoiseFloor { shift_db: 3.0 }))).evaluate(&link),
        );
        assert_eq!(alone.rssi_dbm, noisy.rssi_dbm);
        assert_eq!(alone.register_rssi_dbm, noisy.register_rssi_dbm);
        assert_eq!(
            noisy.reception_probability,
            Table::dust().reception_probability(alone.rssi_dbm - 3.0)
        );
        assert!(noisy.reception_probability < alone.reception_probability);
    }
}
