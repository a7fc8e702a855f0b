//! Bodies that keep their velocity: what they are asked for is an acceleration.

use proto::config::Section;

/// Standard gravity (m/s²): CGPM 1901.
pub const GRAVITY_MPS2: f64 = 9.806_65;

/// A double integrator.
///
/// # Model
///
/// ẍ = a, with |a| at most `acceleration_cap_mps2`, in space. Where a controller commands a velocity u, a is such that the robot
/// has it at the end of the period Δt: a = (u − v) / Δt, as far as the cap allows; a controller may also command a itself.
/// a is held over the period.
///
/// # Validity
///
/// No drag, no attitude. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Section)]
pub(super) struct DoubleIntegrator {
    /// The cap (m/s).
    #[key(inherited)]
    pub(super) speed_cap_mps: f64,
    /// Maximum acceleration (m/s²).
    #[key(above = 0.0, most = 1e4, default = 10.0)]
    acceleration_cap_mps2: f64,
}

/// A quadrotor whose attitude follows with a lag.
///
/// # Model
///
/// ```text
/// ẍ = f − g e_z = a,    ȧ = (a_c − a) / attitude_lag_s
/// ```
///
/// f is the thrust by mass, along the body's axis. Asked for is f_c = a_c + g e_z, brought within what the vehicle can do:
/// thrust from 0 to `thrust_cap_weights` times its weight, tilt at most `tilt_cap_rad`. Height goes first: the vertical part
/// is limited by thrust alone, the horizontal one by tilt and by the thrust that is left. These bounds are a convex set, so
/// that f keeps them on its way, too. Where a controller commands a velocity u, a_c = k (u − v), k being
/// `velocity_gain_per_s`, or 1 / Δt if that is less. With k and the lag τ alone the velocity is of second order, with a damping
/// ratio of 1 / (2 √(k τ)).
///
/// The point-mass model with first-order attitude (e.g. Kamel, Stastny, Alexis, Siegwart, "Model Predictive Control for
/// Trajectory Tracking of Unmanned Aerial Vehicles Using Robot Operating System", 2017, § 3), the thrust vector lagging as a
/// whole, without yaw.
///
/// # Validity
///
/// No rotor drag, no battery, no ground effect; angular rates are not limited but by the lag. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Section)]
pub(super) struct Quadrotor {
    /// The cap (m/s).
    #[key(inherited)]
    pub(super) speed_cap_mps: f64,
    /// Velocity gain: commanded acceleration per velocity error (1/s).
    #[key(above = 0.0, most = 1e3, default = 2.0)]
    velocity_gain_per_s: f64,
    /// Maximum tilt of the thrust from the vertical (rad).
    #[key(above = 0.0, most = 1.5, default = 0.5)]
    tilt_cap_rad: f64,
    /// Maximum thrust, as a multiple of the robot's weight.
    #[key(above = 1.0, most = 100.0, default = 2.0)]
    thrust_cap_weights: f64,
    /// Time constant of the thrust (s). 0: no lag.
    #[key(range = 0.0..=100.0, default = 0.15)]
    attitude_lag_s: f64,
    /// Mass (kg). Measurements with commands of thrust require it; motion in a run does not depend on it.
    #[key(above = 0.0, most = 1e6)]
    mass_kg: Option<f64>,
}

/// How a body that keeps its velocity is pushed.
pub(super) trait Inertial {
    /// The acceleration (m/s²) to ask for, so as to come to a velocity (m/s) within `dt_s`.
    fn towards(&self, velocity_mps: [f64; 3], own_mps: [f64; 3], dt_s: f64) -> [f64; 3];

    /// What it can do of an acceleration that is asked for (m/s²).
    fn limited(&self, acceleration_mps2: [f64; 3]) -> [f64; 3];

    /// Time constant (s) with which its acceleration follows.
    fn lag_s(&self) -> f64 {
        0.0
    }

    /// The acceleration (m/s²) that its thrust must give it so that it stays at its height: gravity, where it flies.
    fn lift_mps2(&self) -> f64 {
        0.0
    }
}

impl Inertial for DoubleIntegrator {
    fn towards(&self, velocity_mps: [f64; 3], own_mps: [f64; 3], dt_s: f64) -> [f64; 3] {
        std::array::from_fn(|i| (velocity_mps[i] - own_mps[i]) / dt_s)
    }

    fn limited(&self, acceleration_mps2: [f64; 3]) -> [f64; 3] {
        within(acceleration_mps2, self.acceleration_cap_mps2)
    }
}

impl Inertial for Quadrotor {
    fn towards(&self, velocity_mps: [f64; 3], own_mps: [f64; 3], dt_s: f64) -> [f64; 3] {
        let gain_per_s = self.velocity_gain_per_s.min(1.0 / dt_s);
        std::array::from_fn(|i| gain_per_s * (velocity_mps[i] - own_mps[i]))
    }

    fn limited(&self, [east, north, up]: [f64; 3]) -> [f64; 3] {
        let most = self.thrust_cap_weights * GRAVITY_MPS2;
        let lift = (up + GRAVITY_MPS2).clamp(0.0, most);
        let left = libm::sqrt(most * most - lift * lift);
        let sideways = libm::hypot(east, north);
        let allowed = left.min(lift * libm::tan(self.tilt_cap_rad));
        let share = if allowed < sideways { allowed / sideways } else { 1.0 };
        [share * east, share * north, lift - GRAVITY_MPS2]
    }

    fn lag_s(&self) -> f64 {
        self.attitude_lag_s
    }

    fn lift_mps2(&self) -> f64 {
        GRAVITY_MPS2
    }
}

/// The direction of the thrust of a body with this attitude: its own vertical axis, east, north and up.
///
/// R = R_z(yaw) R_y(pitch) R_x(roll) turns the axes of the body (x ahead, y to the left, z up) into those of the world, and this is
/// R e_z: e.g. Siciliano et al., Robotics: Modelling, Planning and Control, § 2.4.2. Positive roll lowers the right side, positive pitch
/// the nose; both push the way they lower.
///
/// # Arguments
///
/// * Angles in rad.
#[must_use]
pub fn thrust_direction([roll_rad, pitch_rad, yaw_rad]: [f64; 3]) -> [f64; 3] {
    let [(sin_roll, cos_roll), (sin_pitch, cos_pitch), (sin_yaw, cos_yaw)] =
        [roll_rad, pitch_rad, yaw_rad].map(libm::sincos);
    [
        cos_yaw * sin_pitch * cos_roll + sin_yaw * sin_roll,
        sin_yaw * sin_pitch * cos_roll - cos_yaw * sin_roll,
        cos_pitch * cos_roll,
    ]
}

/// A vector shortened to a length.
pub(super) fn within(vector: [f64; 3], most: f64) -> [f64; 3] {
    let length = libm::sqrt(vector.iter().map(|part| part * part).sum());
    if length <= most { vector } else { vector.map(|part| part / length * most) }
}

/// Velocity (m/s) and acceleration (m/s²) of a body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Push {
    pub(super) velocity_mps: [f64; 3],
    pub(super) acceleration_mps2: [f64; 3],
}

impl Push {
    /// Goes on for `h_s`, asked for an acceleration (m/s²) that is followed with a lag (s). Returns the mean velocity (m/s).
    ///
    /// Exact: with D = a(0) − a_c and E = 1 − e^(−h/τ),
    ///
    /// ```text
    /// a(h) = a_c + D (1 − E),   v(h) = v + a_c h + D τ E,   x(h) − x = v h + a_c h²/2 + D τ (h − τ E)
    /// ```
    pub(super) fn advance(&mut self, asked_mps2: [f64; 3], lag_s: f64, h_s: f64) -> [f64; 3] {
        let gone = if lag_s == 0.0 { 1.0 } else { -libm::expm1(-h_s / lag_s) };
        std::array::from_fn(|i| {
            let (v, missing) = (self.velocity_mps[i], self.acceleration_mps2[i] - asked_mps2[i]);
            let lagging_mps = missing * lag_s;
            self.acceleration_mps2[i] = asked_mps2[i] + missing * (1.0 - gone);
            self.velocity_mps[i] = v + asked_mps2[i] * h_s + lagging_mps * gone;
            v + 0.5 * asked_mps2[i] * h_s + lagging_mps * (1.0 - lag_s * gone / h_s)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn quadrotor() -> Quadrotor {
        Quadrotor {
            speed_cap_mps: 15.0,
            velocity_gain_per_s: 2.0,
            tilt_cap_rad: 0.5,
            thrust_cap_weights: 2.0,
            attitude_lag_s: 0.15,
            mass_kg: None,
        }
    }

    /// Position, velocity and acceleration after `t_s`, by the classical Runge-Kutta method in `n` steps.
    fn runge_kutta(state: [f64; 3], asked: f64, lag_s: f64, t_s: f64, n: usize) -> [f64; 3] {
        let rate = |[_, v, a]: [f64; 3]| [v, a, (asked - a) / lag_s];
        let advanced = |s: [f64; 3], k: [f64; 3], h: f64| std::array::from_fn(|i| s[i] + h * k[i]);
        let h = t_s / n as f64;
        (0..n).fold(state, |s, _| {
            let a = rate(s);
            let b = rate(advanced(s, a, h / 2.0));
            let c = rate(advanced(s, b, h / 2.0));
            let d = rate(advanced(s, c, h));
            std::array::from_fn(|i| s[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]))
        })
    }

    #[test]
    fn an_integration_of_fourth_order_comes_nearer_by_sixteen_with_half_the_step() {
        let start = Push { velocity_mps: [1.0, 0.0, -0.5], acceleration_mps2: [-2.0, 3.0, 0.0] };
        let (asked, lag_s, t_s) = ([3.0, 1.0, -4.0], 0.15, 0.6);
        let mut push = start;
        let mean_mps = push.advance(asked, lag_s, t_s);
        for i in 0..3 {
            let exact = [mean_mps[i] * t_s, push.velocity_mps[i], push.acceleration_mps2[i]];
            let begin = [0.0, start.velocity_mps[i], start.acceleration_mps2[i]];
            let error = |n: usize| -> f64 {
                let got = runge_kutta(begin, asked[i], lag_s, t_s, n);
                got.iter().zip(exact).map(|(got, exact)| (got - exact).abs()).sum()
            };
            // Steps of a sixteenth of the lag: the next order changes the ratio by a few per cent; rounding is far below.
            let order = (error(64) / error(128)).log2();
            assert!((3.9..4.1).contains(&order), "axis {i}: order {order}");
            assert!(error(2048) < 1e-12);
        }
    }

    #[test]
    fn thrust_points_where_the_body_is_lowered() {
        let near = |angles: [f64; 3], expected: [f64; 3]| {
            let direction = thrust_direction(angles);
            assert!((0..3).all(|i| (direction[i] - expected[i]).abs() < 1e-15), "{direction:?}");
        };
        let (sin, cos) = 0.3_f64.sin_cos();
        near([0.0; 3], [0.0, 0.0, 1.0]);
        // Nose down: ahead, which is east, or north once it has turned left by a quarter.
        near([0.0, 0.3, 0.0], [sin, 0.0, cos]);
        near([0.0, 0.3, std::f64::consts::FRAC_PI_2], [0.0, sin, cos]);
        // Right side down: to the right, south.
        near([0.3, 0.0, 0.0], [0.0, -sin, cos]);
    }

    #[test]
    fn without_a_lag_it_is_uniform_acceleration() {
        let mut push = Push { velocity_mps: [1.0, 2.0, 3.0], acceleration_mps2: [9.0; 3] };
        let mean_mps = push.advance([2.0, 0.0, -1.0], 0.0, 4.0);
        assert_eq!(push.velocity_mps, [9.0, 2.0, -1.0]);
        assert_eq!(mean_mps, [5.0, 2.0, 1.0]);
        assert_eq!(push.acceleration_mps2, [2.0, 0.0, -1.0]);
    }

    #[test]
    fn in_parts_it_is_the_same() {
        let start = Push { velocity_mps: [1.0, 0.0, -0.5], acceleration_mps2: [-2.0, 3.0, 0.0] };
        let (mut whole, mut parts) = (start, start);
        let way_m = whole.advance([1.0, 2.0, 3.0], 0.2, 0.5).map(|mean| 0.5 * mean);
        let mut gone_m = [0.0; 3];
        for _ in 0..50 {
            let mean = parts.advance([1.0, 2.0, 3.0], 0.2, 0.01);
            gone_m = std::array::from_fn(|i| gone_m[i] + 0.01 * mean[i]);
        }
        for i in 0..3 {
            // Fifty roundings.
            assert!((way_m[i] - gone_m[i]).abs() < 1e-13);
            assert!((whole.velocity_mps[i] - parts.velocity_mps[i]).abs() < 1e-13);
        }
    }

    #[test]
    fn a_quadrotor_that_hovers_bears_its_weight_and_height_goes_first() {
        let body = quadrotor();
        assert_eq!(body.limited([0.0; 3]), [0.0; 3]);
        // Tilted as far as it may, at its height: g tan(tilt).
        let [east, north, up] = body.limited([60.0, -80.0, 0.0]);
        let tilted = GRAVITY_MPS2 * 0.5_f64.tan();
        assert!((east - 0.6 * tilted).abs() < 1e-12 && (north + 0.8 * tilted).abs() < 1e-12);
        assert!(up.abs() < 1e-12);
        // All thrust upwards: none is left to go sideways.
        assert_eq!(body.limited([5.0, 0.0, 99.0]), [0.0, 0.0, GRAVITY_MPS2]);
        // It cannot pull itself down, and falls with its axis upright.
        assert_eq!(body.limited([5.0, 0.0, -99.0]), [0.0, 0.0, -GRAVITY_MPS2]);
    }

    #[test]
    fn a_double_integrator_accelerates_as_it_may() {
        let body = DoubleIntegrator { speed_cap_mps: 9.0, acceleration_cap_mps2: 2.0 };
        assert_eq!(body.towards([3.0, 0.0, 1.0], [1.0, 0.0, 0.0], 0.5), [4.0, 0.0, 2.0]);
        let limited = body.limited([4.0, 0.0, 3.0]);
        assert!(limited.iter().zip([1.6, 0.0, 1.2]).all(|(got, want)| (got - want).abs() < 1e-15));
    }

    proptest! {
        #[test]
        fn thrust_and_tilt_stay_within_bounds_on_the_way(
            asked in prop::collection::vec(prop::array::uniform3(-50.0f64..50.0), 1..6),
            h_s in 0.001f64..0.5,
        ) {
            let body = quadrotor();
            let mut push = Push::default();
            for asked in asked {
                push.advance(body.limited(asked), body.lag_s(), h_s);
                let [east, north, up] = push.acceleration_mps2;
                let (sideways, lift) = (east.hypot(north), up + GRAVITY_MPS2);
                // Rounding of numbers up to 50.
                let most = 2.0 * GRAVITY_MPS2;
                prop_assert!(sideways.hypot(lift) <= most + 1e-12 && -1e-12 <= lift);
                prop_assert!(sideways <= lift * 0.5_f64.tan() + 1e-12);
            }
        }
    }
}
