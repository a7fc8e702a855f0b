//! A drift that is the same for all.

use super::{Effect, Entry, Situation};
use crate::dynamics::norm;
use proto::config::Section;
use proto::effect::{Body, Catalogued, Fixed};

/// `kind = "wind"`.
pub(super) const ENTRY: Entry = Entry::of::<Wind>();

/// Moving air: a drift added to the velocity, or a force on bodies that keep theirs. Constant, slowly turning, or with gusts.
///
/// # Mechanism
///
/// Wind or a current carries robots along, independently of their commands.
///
/// # Equation
///
/// ```text
/// v = u + w, w = velocity_mps + gust, gust normal with sd_mps, the same for all robots
/// a' = a + drag_per_s (w - v) of bodies that keep their velocity
/// ```
///
/// # Source
///
/// Definition; drag in proportion to the airspeed: M. Faessler, A. Franchi and D. Scaramuzza, Differential flatness of quadrotor
/// dynamics subject to rotor drag, IEEE Robotics and Automation Letters 3 (2018) 620. Gusts: normal values every gust_s, joined by g = n_k cos(pi f / 2) + n_(k+1) sin(pi f / 2), which has the same
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
    example = "velocity_mps = [0.2, -0.1, 0.0]\n",
    variants = &[&[("velocity_mps[2]", Fixed::Number(0.0))]],
    generalises = &["push", "linear-drag"],
    of_body = &[("drag_per_s", Body::Inertial)],
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
    /// Deceleration of bodies that keep their velocity, per velocity through the air (1/s). Others are carried along.
    #[key(range = 0.0..=50.0, default = 0.4)]
    #[fit(
        unit = "1/s",
        starts = [0.4],
        step = 0.002,
        plausible = 0.01..=10.0,
        source = "Faessler, Franchi and Scaramuzza 2018: 0.4 to 0.5 of a quadrotor",
    )]
    drag_per_s: f64,
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

    fn force_mps2(&self, at: &Situation<'_>) -> [f64; 3] {
        let air_mps = self.drift_mps(at);
        std::array::from_fn(|i| self.drag_per_s * (air_mps[i] - at.velocity_mps[i]))
    }

    fn most_force_mps2(&self) -> f64 {
        self.drag_per_s * norm(self.velocity_mps)
    }

    fn drifts(&self) -> bool {
        true
    }

    fn varies_on_the_way(&self) -> bool {
        self.turning_radps != 0.0 || self.sd_mps != 0.0
    }

    fn force_varies(&self) -> bool {
        true
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
    fn a_body_that_keeps_its_velocity_comes_to_that_of_the_air() {
        // v = w (1 − e^(−k t)), and the same integrated.
        let text = "kind = 'double-integrator'\n[[effect]]\nkind = 'wind'\nvelocity_mps = [4.0, 0.0, -1.0]\ndrag_per_s = 0.5";
        let end = drive(text, [0.0; 3], 3.0);
        let gone = 1.0 - (-1.5f64).exp();
        for (axis, air_mps) in [4.0, 0.0, -1.0].into_iter().enumerate() {
            let way_m = air_mps * (3.0 - gone / 0.5);
            // Steps of 10 ms, of second order: (0.5 × 0.01)² / 6 a step.
            assert!((end.drive[axis] - air_mps * gone).abs() < 1e-4, "{end:?}");
            assert!((end.position_m[axis] - way_m).abs() < 1e-4, "{end:?} {way_m}");
        }
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
