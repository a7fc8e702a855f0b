//! Clocks worse than the guard time allows for.

use super::{Burden, Concerned, Effect, Entry, Node};
use proto::config::Section;
use proto::effect::{Catalogued, Level, Need};

/// `kind = "clock-drift"`.
pub const ENTRY: Entry = Entry { needs_kept_time: true, ..Entry::of::<ClockDrift>() };

/// Clocks drift more than specified, so motes leave the guard time before they are resynchronised.
///
/// # Mechanism
///
/// A cold, aged or cheap crystal exceeds its rated drift. Between two corrections the mote drifts beyond half of the guard time. It
/// then misses frames and corrections, and finally has to rejoin the network.
///
/// # Equation
///
/// ```text
/// offset(t) = -(rate + extra) * (t - t_corrected), extra uniform in +-max_ppm * 1e-6; a frame is heard where |offset of
/// sender - offset of receiver| <= macTsRxWait / 2
/// ```
///
/// # Source
///
/// IEEE Std 802.15.4-2015, 8.4.3.3 (macTsRxWait); D. Stanislowski et al., Adaptive synchronization in IEEE802.15.4e networks, IEEE
/// Trans. Ind. Inf. 10(1), 2014.
///
/// # Validity
///
/// The drift is constant and independent of temperature, so motes that hear their time source often enough estimate and compensate
/// it (netsim.mac.adaptive_synchronization). A root's clock is the reference. Requires keep_alive_s other than 0.
///
/// # Trace
///
/// Losses some seconds after the last frame between two motes, motes that lose synchronisation and rejoin, and join times with a
/// long tail.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "clock-drift",
    needs = &[Need::Packets],
    example = "max_ppm = 100.0\n",
    level = Level::Run,
)]
pub(crate) struct ClockDrift {
    /// Maximum additional clock drift (ppm), uniform in both directions, on top of netsim.mac.max_drift_ppm.
    #[key(range = 0.0..=1e4)]
    #[fit(unit = "ppm", starts = [60.0, 120.0, 250.0], step = 1.0)]
    pub max_ppm: f64,
    /// The motes that it concerns.
    #[key(flatten)]
    pub concerned: Concerned,
}

impl Effect for ClockDrift {
    fn weigh(&self, node: Node, burden: &mut Burden) {
        if !node.is_root && self.concerned.includes(node.mote) {
            burden.max_drift_ppm += self.max_ppm;
        }
    }
}
