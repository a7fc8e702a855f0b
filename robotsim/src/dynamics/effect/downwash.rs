//! Robots that blow each other away.

use super::{Effect, Entry, Situation, UNCHECKED};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Level, Need, Parameter};
use serde::Deserialize;

/// `kind = "downwash"`.
pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "downwash",
        doc: "Robots close to each other drift apart.",
        fields: &[
            Field {
                key: "gain",
                doc: "Drift speed at zero distance (m/s). Negative: robots attract each other.",
                kind: Kind::Number(Range::closed(-1e3, 1e3)),
                default: Default::Required,
            },
            Field {
                key: "range_m",
                doc: "Distance over which the drift falls to 1/e (m).",
                kind: Kind::Number(Range::above(0.0, 1e4)),
                default: Default::Required,
            },
        ],
    },
    about: About {
        mechanism: "The downwash of rotors pushes other robots. Close aircraft drift apart, or sink into each other's wash.",
        equation: "v_i = u_i + gain * sum over j of e^(-d_ij / range_m) (x_i - x_j) / d_ij",
        source: "The exponential form is a simplification of this model; measured wakes: D. Yeo, E. Shrestha, D. Paley and \
                 E. Atkins, An empirical model of rotorcraft UAV downwash, AIAA AFM 2015.",
        validity: "Isotropic; robots up to 8 ranges away count. Others are assumed to move straight during a step.",
        trace: "An error away from another robot, when it is near.",
        needs: &[Need::OtherAgents],
        example: "gain = 0.3\nrange_m = 0.5\n",
    },
    fit: Fit {
        parameters: &[
            Parameter {
                key: "gain",
                unit: "m/s",
                min: -100.0,
                max: 100.0,
                starts: &[0.0],
                step: 0.02,
            },
            Parameter {
                key: "range_m",
                unit: "m",
                min: 0.05,
                max: 100.0,
                starts: &[0.5, 2.0, 6.0],
                step: 0.05,
            },
        ],
        variants: &[],
        level: Level::Time,
        generalises: &[],
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table| Some(Box::new(typed::<Downwash>(table))),
};

/// Robots that push each other away without touching.
///
/// # Model
///
/// ```text
/// v_i = u_i + g Σ_j e^(−d_ij/r) (x_i − x_j)/d_ij        d_ij = |x_i − x_j|
/// ```
///
/// The exponential form is a simplification made here; measured wakes of rotors: Yeo, Shrestha, Paley and Atkins, "An empirical model of
/// rotorcraft UAV downwash", AIAA AFM 2015.
///
/// # Arguments
///
/// * `gain` g: the push of a robot that is very near (m/s); negative: robots attract each other.
/// * `range_m` r: the distance at which 1/e of that is left (m), greater than 0.
///
/// # Validity
///
/// The same in all directions, whereas a wake points downwards: beside each other aircraft are pushed less than above each other.
/// Robots more than 8 r away do not count (e^(−8) of the push is lost). During a step the others go straight on. Not validated
/// against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct Downwash {
    gain: f64,
    range_m: f64,
}

impl Effect for Downwash {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

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
