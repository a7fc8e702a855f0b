//! Robots that blow each other away.

use super::{Effect, Entry, Situation};
use proto::config::Section;
use proto::effect::{Catalogued, Need};

/// `kind = "downwash"`.
pub(super) const ENTRY: Entry = Entry::of::<Downwash>();

/// Robots close to each other drift apart.
///
/// # Mechanism
///
/// The downwash of rotors pushes other robots. Close aircraft drift apart, or sink into each other's wash.
///
/// # Equation
///
/// ```text
/// v_i = u_i + gain * sum over j of e^(-d_ij / range_m) (x_i - x_j) / d_ij
/// of bodies that keep their velocity the same is added to the acceleration
/// ```
///
/// # Source
///
/// The exponential form is a simplification of this model; measured wakes: D. Yeo, E. Shrestha, D. Paley and E. Atkins, An
/// empirical model of rotorcraft UAV downwash, AIAA AFM 2015.
///
/// # Validity
///
/// Isotropic; robots up to 8 ranges away count. Others are assumed to move straight during a step.
///
/// # Trace
///
/// An error away from another robot, when it is near.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "downwash",
    needs = &[Need::OtherAgents],
    example = "gain = 0.3\nrange_m = 0.5\n",
)]
struct Downwash {
    /// Drift speed at zero distance (m/s), or acceleration (m/s²) of bodies that keep their velocity. Negative: robots attract each other.
    #[key(range = -1e3..=1e3)]
    #[fit(
        unit = "m/s",
        range = -100.0..=100.0,
        starts = [0.0],
        step = 0.02,
        plausible = -50.0..=50.0,
        source = "momentum theory, Leishman, Principles of Helicopter Aerodynamics, ch. 2: wakes of at most about 40 m/s",
    )]
    gain: f64,
    /// Distance over which the drift falls to 1/e (m).
    #[key(above = 0.0, most = 1e4)]
    #[fit(unit = "m", range = 0.05..=100.0, starts = [0.5, 2.0, 6.0], step = 0.05)]
    range_m: f64,
}

impl Effect for Downwash {
    fn drift_mps(&self, at: &Situation<'_>) -> [f64; 3] {
        let mut drift_mps = [0.0; 3];
        let ahead_s = at.time_s - at.surroundings.others_at_s;
        for other in at.surroundings.others {
            let away_m: [f64; 3] = std::array::from_fn(|i| {
                at.position_m[i] - (other.position_m[i] + other.velocity_mps[i] * ahead_s)
            });
            let square_m2: f64 = away_m.iter().map(|part| part * part).sum();
            if square_m2 == 0.0 || 64.0 * self.range_m * self.range_m < square_m2 {
                continue;
            }
            let d_m = libm::sqrt(square_m2);
            let push = self.gain * libm::exp(-d_m / self.range_m) / d_m;
            for (drift, part) in drift_mps.iter_mut().zip(away_m) {
                *drift += push * part;
            }
        }
        drift_mps
    }

    fn heeds_others(&self) -> bool {
        true
    }

    fn drifts(&self) -> bool {
        true
    }

    fn varies_on_the_way(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;
    use crate::dynamics::physics::Robot;
    use crate::dynamics::surroundings::{Other, Surroundings};

    #[test]
    fn two_that_hover_drift_apart_as_the_equation_says() {
        // ẋ = g e^(−x/r) from x0, the other held in place: e^(x/r) = e^(x0/r) + g t / r.
        let others = [Other { position_m: [0.0; 3], velocity_mps: [0.0; 3] }];
        let surroundings = Surroundings { others: &others, ..Surroundings::default() };
        let physics = physics("[[effect]]\nkind = 'downwash'\ngain = 0.8\nrange_m = 1.5");
        let mut robot = Robot { position_m: [0.0, 1.0, 0.0], ..Robot::default() };
        physics.advance(&mut robot, &[], &mut 0, 0.0, 2.0, &surroundings);
        let exact = 1.5 * ((1.0f64 / 1.5).exp() + 0.8 * 2.0 / 1.5).ln();
        // Euler steps of 10 ms: half a step of the change of the rate, below 1.3 mm.
        assert!((robot.position_m[1] - exact).abs() < 2e-3, "{robot:?} {exact}");
    }
}
