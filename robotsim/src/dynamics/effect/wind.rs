//! A drift that is the same for all.

use super::{Effect, Entry, Situation};
use proto::config::Section;
use proto::effect::{Catalogued, Fixed, Need};

/// `kind = "wind"`.
pub(super) const ENTRY: Entry = Entry::of::<Wind>();

/// A drift added to the velocity: constant, slowly turning, or with gusts.
///
/// # Mechanism
///
/// Wind or a current carries robots along, independently of their commands.
///
/// # Equation
///
/// ```text
/// v = u + velocity_mps + gust, gust normal with sd_mps, the same for all robots
/// ```
///
/// # Source
///
/// Definition. Gusts: normal values every gust_s, joined by g = n_k cos(pi f / 2) + n_(k+1) sin(pi f / 2), which has the same
/// variance at all times.
///
/// # Validity
///
/// The wind is the same everywhere. Gusts are simulated but not fitted.
///
/// # Trace
///
/// The same error for all robots and all commands, stationary robots included.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "wind",
    needs = &[Need::VelocityCommands],
    example = "velocity_mps = [0.2, -0.1, 0.0]\n",
    variants = &[&[("velocity_mps[2]", Fixed::Number(0.0))]],
    needs_one_frame = true,
)]
struct Wind {
    /// Velocity of the drift (x, y, z in m/s), in the direction the wind blows to; with a turn rate, its value at time 0.
    #[key(range = -100.0..=100.0)]
    #[fit(
        key = "velocity_mps[0]",
        unit = "m/s",
        starts = [0.0],
        step = 0.02,
        plausible = -60.0..=60.0,
        source = "Beaufort scale, WMO: hurricanes from 32.7 m/s",
    )]
    #[fit(
        key = "velocity_mps[1]",
        unit = "m/s",
        starts = [0.0],
        step = 0.02,
        plausible = -60.0..=60.0,
        source = "Beaufort scale, WMO: hurricanes from 32.7 m/s",
    )]
    velocity_mps: [f64; 3],
    /// Turn rate of its direction, to the left (rad/s).
    #[key(range = -10.0..=10.0, default = 0.0)]
    turning_radps: f64,
    /// Standard deviation of gusts, per component of the plane (m/s).
    #[key(range = 0.0..=100.0, default = 0.0)]
    sd_mps: f64,
    /// Duration of a gust (s).
    #[key(above = 0.0, most = 1e4, default = 2.0)]
    gust_s: f64,
}

impl Effect for Wind {
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
