//! Airtime that is rationed.

use super::{Burden, Concerned, Duty, Effect, Entry, Node};
use proto::config::Section;
use proto::effect::{Catalogued, Fixed, Level, Need};
use proto::time::SimDuration;

/// `kind = "duty-cycle-limit"`.
pub const ENTRY: Entry = Entry::of::<DutyCycleLimit>();

/// A mote may transmit only for a fraction of the time, by regulation or for lack of energy.
///
/// # Mechanism
///
/// A regulation or an energy harvester limits the airtime. A mote without remaining airtime holds its frames back, beacons and
/// keep-alives included, until it has some again. Motes near the root, which forward most, are affected first.
///
/// # Equation
///
/// ```text
/// ration(t) = min(fraction * window_s, ration + fraction * dt - airtime); a mote sends while ration > 0
/// ```
///
/// # Source
///
/// ETSI EN 300 220-2 (duty cycle below 1 GHz); 802.15.4 at 2.4 GHz has no such regulation (EN 300 328), only the limits of its
/// power supply.
///
/// # Validity
///
/// Acknowledgments do not count. A transmission that has begun is completed, so the limit may be exceeded by one frame.
///
/// # Trace
///
/// Latency that grows with load and towards the root, overflowing queues, and missing beacons, so motes join late or lose
/// synchronisation. No effect at low load.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "duty-cycle-limit",
    needs = &[Need::Packets],
    example = "fraction = 0.002\nwindow_s = 60.0\n",
    variants = &[&[("window_s", Fixed::Number(60.0))]],
    level = Level::Run,
)]
pub(crate) struct DutyCycleLimit {
    /// Fraction of the time for which a mote may transmit.
    #[key(range = 1e-6..=1.0)]
    #[fit(unit = "", starts = [0.0005, 0.001, 0.002], step = 1e-4)]
    pub fraction: f64,
    /// Averaging window (s): airtime unused over at most this time can be spent in a burst.
    #[key(range = 0.1..=86_400.0, default = 60.0)]
    pub window_s: f64,
    /// The motes that it concerns.
    #[key(flatten)]
    pub concerned: Concerned,
}

impl Effect for DutyCycleLimit {
    fn weigh(&self, node: Node, burden: &mut Burden) {
        let window = SimDuration::from_seconds(self.window_s);
        let stricter = burden.duty.is_none_or(|duty| self.fraction < duty.fraction);
        if stricter && self.concerned.includes(node.mote) {
            burden.duty = Some(Duty { fraction: self.fraction, window });
        }
    }
}
