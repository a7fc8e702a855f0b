//! A drift that is the same for all.

use super::{Effect, Entry, Situation, UNCHECKED};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Fixed, Level, Need, Parameter};
use serde::Deserialize;

/// `kind = "wind"`.
pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "wind",
        doc: "A drift added to the velocity: constant, slowly turning, or with gusts.",
        fields: &[
            Field {
                key: "velocity_mps",
                doc: "Velocity of the drift (x, y, z in m/s), in the direction the wind blows to; with a turn rate, its \
                      value at time 0.",
                kind: Kind::List {
                    of: &Kind::Number(Range::closed(-100.0, 100.0)),
                    min: 3,
                    max: 3,
                },
                default: Default::Required,
            },
            Field {
                key: "turning_radps",
                doc: "Turn rate of its direction, to the left (rad/s).",
                kind: Kind::Number(Range::closed(-10.0, 10.0)),
                default: Default::Number(0.0),
            },
            Field {
                key: "sd_mps",
                doc: "Standard deviation of gusts, per component of the plane (m/s).",
                kind: Kind::Number(Range::closed(0.0, 100.0)),
                default: Default::Number(0.0),
            },
            Field {
                key: "gust_s",
                doc: "Duration of a gust (s).",
                kind: Kind::Number(Range::above(0.0, 1e4)),
                default: Default::Number(2.0),
            },
        ],
    },
    about: About {
        mechanism: "Wind or a current carries robots along, independently of their commands.",
        equation: "v = u + velocity_mps + gust, gust normal with sd_mps, the same for all robots",
        source: "Definition. Gusts: normal values every gust_s, joined by g = n_k cos(pi f / 2) + n_(k+1) sin(pi f / 2), which has the same variance at all times.",
        validity: "The wind is the same everywhere. Gusts are simulated but not fitted.",
        trace: "The same error for all robots and all commands, stationary robots included.",
        needs: &[Need::VelocityCommands],
        example: "velocity_mps = [0.2, -0.1, 0.0]\n",
    },
    fit: Fit {
        parameters: &[
            Parameter {
                key: "velocity_mps[0]",
                unit: "m/s",
                min: -100.0,
                max: 100.0,
                starts: &[0.0],
                step: 0.02,
            },
            Parameter {
                key: "velocity_mps[1]",
                unit: "m/s",
                min: -100.0,
                max: 100.0,
                starts: &[0.0],
                step: 0.02,
            },
        ],
        variants: &[&[("velocity_mps[2]", Fixed::Number(0.0))]],
        level: Level::Time,
        generalises: &[],
        needs_one_frame: true,
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table| Some(Box::new(typed::<Wind>(table))),
};

/// A drift that is the same for all robots.
///
/// # Model
///
/// ```text
/// v = u + R(Ω t) w + g(t)
/// g(t) = σ (n_k cos(π f/2) + n_(k+1) sin(π f/2))        k = ⌊t/T⌋, f = t/T − k, n_k ~ N(0, 1)
/// ```
///
/// By definition. cos² + sin² = 1: gusts have the variance σ² at all times, in x and in y independently. R(Ω t) turns w about the
/// vertical.
///
/// # Arguments
///
/// * `velocity_mps` w: the drift at time 0 (x, y, z in m/s): where the wind blows to.
/// * `turning_radps` Ω: how fast its direction turns to the left (rad/s).
/// * `sd_mps` σ: standard deviation of gusts, per component of the plane (m/s), not negative.
/// * `gust_s` T: how long a gust lasts (s), greater than 0.
///
/// # Validity
///
/// The wind is the same everywhere, carries robots along whatever their drag, and standing ones as well. Gusts are simulated and not
/// fitted: a fit sees them as noise. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct Wind {
    velocity_mps: [f64; 3],
    turning_radps: f64,
    sd_mps: f64,
    gust_s: f64,
}

impl Effect for Wind {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn drift_mps(&self, at: &Situation<'_>) -> [f64; 3] {
        let [x, y, z] = self.velocity_mps;
        let (sin, cos) = libm::sincos(self.turning_radps * at.time_s);
        let mut drift_mps = [x * cos - y * sin, x * sin + y * cos, z];
        if let Some(draws) = at.surroundings.draws
            && 0.0 < self.sd_mps
        {
            let knot = at.time_s / self.gust_s;
            let before = libm::floor(knot);
            let (sin, cos) = libm::sincos((knot - before) * std::f64::consts::FRAC_PI_2);
            for (axis, drift) in drift_mps.iter_mut().take(2).enumerate() {
                let normal = |k: f64| draws.normal(axis as u64, k as u64, 0);
                *drift += self.sd_mps * (cos * normal(before) + sin * normal(before + 1.0));
            }
        }
        drift_mps
    }

    fn drifts(&self) -> bool {
        true
    }

    fn varies_on_the_way(&self) -> bool {
        self.turning_radps != 0.0 || self.sd_mps != 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;
    use super::*;
    use crate::dynamics::surroundings::Surroundings;

    use proto::rng::{Draws, Purpose};

    #[test]
    fn a_robot_that_stands_is_carried_along() {
        let text = "[[effect]]\nkind = 'wind'\nvelocity_mps = [1.0, -0.5, 0.0]";
        assert_near(drive(text, [0.0; 3], 3.0).position_m, [3.0, -1.5, 0.0]);
        let end = drive(&format!("kind = 'unicycle'\n{text}"), [0.0, 2.0, 0.0], 3.0);
        assert_near(end.position_m, [3.0, -1.5, 0.0]);
    }

    #[test]
    fn a_turning_wind_carries_in_a_circle() {
        let text = "[[effect]]\nkind = 'wind'\nvelocity_mps = [1.0, 0.0, 0.0]\nturning_radps = 0.5";
        let end = drive(text, [0.0; 3], 2.0).position_m;
        let exact = [1f64.sin() / 0.5, (1.0 - 1f64.cos()) / 0.5, 0.0];
        // Midpoint rule with 10 ms: (0.5 × 0.01)² / 24 of the way.
        assert!((0..3).all(|i| (end[i] - exact[i]).abs() < 4e-6), "{end:?} {exact:?}");
    }

    #[test]
    fn gusts_have_their_deviation_and_no_mean() {
        let text =
            "[[effect]]\nkind = 'wind'\nvelocity_mps = [0.0, 0.0, 0.0]\nsd_mps = 2.0\ngust_s = 0.5";
        let physics = physics(text);
        let surroundings =
            Surroundings { draws: Some(Draws::new(3, Purpose::Gust)), ..Surroundings::default() };
        let n = 4000;
        let drifts: Vec<f64> = (0..n)
            .map(|i| {
                let at = Situation {
                    // Every third knot and a bit: independent of each other.
                    time_s: 1.5 * f64::from(i) + 0.2,
                    position_m: [0.0; 3],
                    velocity_mps: [0.0; 3],
                    heading_rad: 0.0,
                    surroundings: &surroundings,
                };
                physics.effects()[0].drift_mps(&at)[0]
            })
            .collect();
        let mean = drifts.iter().sum::<f64>() / f64::from(n);
        let variance = drifts.iter().map(|drift| drift * drift).sum::<f64>() / f64::from(n);
        // Standard errors 2/√n and 4 √(2/n); 4.5 of each.
        assert!(mean.abs() < 4.5 * 2.0 / f64::from(n).sqrt(), "{mean}");
        assert!((variance - 4.0).abs() < 4.5 * 4.0 * (2.0 / f64::from(n)).sqrt(), "{variance}");
    }
}
