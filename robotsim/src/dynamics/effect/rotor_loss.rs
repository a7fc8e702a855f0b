//! A rotor that ceases to give thrust.

use super::{Effect, Entry, Situation};
use proto::config::Section;
use proto::effect::{Catalogued, Need, Search};

/// Time constant (s) with which a rotor without power stops: 30 to 100 ms of small multicopters.
const STOPPING_S: f64 = 0.05;

/// `kind = "rotor-loss"`.
pub(super) const ENTRY: Entry = Entry::of::<RotorLoss>();

/// From a time on, part of the thrust is missing.
///
/// # Mechanism
///
/// A rotor, a blade or a motor fails in flight. The others give what they are asked for, so that the whole lacks its share.
///
/// # Equation
///
/// ```text
/// a' = gain (a + g e_z) - g e_z of a quadrotor, gain = 1 - share (1 - e^(-(t - at_s) / 0.05 s)) after at_s, 1 before
/// ```
///
/// # Source
///
/// M. W. Mueller and R. D'Andrea, Stability and control of a quadrocopter despite the complete loss of one, two, or three propellers,
/// ICRA 2014: the thrust that remains; one rotor of n is a share of 1 / n.
///
/// # Validity
///
/// The thrust only. A robot that loses a rotor spins, too, and its attitude follows worse.
///
/// # Trace
///
/// A vertical error that begins at one time, and an error along each acceleration from then on.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "rotor-loss",
    needs = &[Need::ThrustCommands],
    example = "share = 0.25\nat_s = 20.0\n",
    generalises = &["thrust-scale"],
    search = Search::Times,
)]
struct RotorLoss {
    /// Share of the thrust that is lost.
    #[key(range = 0.0..=1.0)]
    #[fit(
        unit = "1",
        range = 0.0..=0.95,
        starts = [0.1],
        step = 0.002,
        null = 0.0,
        plausible = 0.02..=0.75,
        source = "a chipped blade of an octocopter to three of four rotors",
    )]
    share: f64,
    /// When it is lost (s).
    #[key(range = 0.0..=1e12)]
    #[fit(unit = "s", starts = [0.0], step = 0.02)]
    at_s: f64,
}

impl Effect for RotorLoss {
    fn thrust_gain(&self, at: &Situation<'_>) -> f64 {
        let since_s = at.time_s - self.at_s;
        if since_s <= 0.0 { 1.0 } else { 1.0 + self.share * libm::expm1(-since_s / STOPPING_S) }
    }

    fn thrust_gains(&self) -> [f64; 2] {
        [1.0 - self.share, 1.0]
    }

    fn varies_on_the_way(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;
    use super::STOPPING_S;
    use crate::dynamics::GRAVITY_MPS2;

    #[test]
    fn a_quadrotor_that_hovers_falls_from_then_on() {
        let text = "kind = 'quadrotor'\n[[effect]]\nkind = 'rotor-loss'\nshare = 0.25\nat_s = 1.0";
        assert_near(drive(text, [0.0; 3], 1.0).position_m, [0.0; 3]);
        let end = drive(text, [0.0; 3], 3.0);
        // For two seconds, less the time that the rotor takes to stop.
        let fall_mps = -0.25 * GRAVITY_MPS2 * (2.0 - STOPPING_S);
        // Steps of 10 ms with the gain half way.
        assert!((end.drive[2] - fall_mps).abs() < 1e-3, "{end:?} {fall_mps}");
    }
}
