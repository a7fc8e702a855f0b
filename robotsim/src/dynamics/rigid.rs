//! Rigid bodies: discs with mass, friction and spin, which push each other.

use super::inertial::{GRAVITY_MPS2, Inertial, within};
use super::norm;
use proto::config::Section;

/// A rigid disc on the ground.
///
/// # Model
///
/// A disc of mass m, radius r and moment of inertia m r²/2 that keeps its velocity and its spin. Its drive pushes it, in any
/// direction, with at most `force_cap_n`; where a controller commands a velocity u the force is m (u − v) / Δt, as far as that
/// allows. The ground brakes it with Coulomb's friction, which at rest holds it against a smaller force; the spin is
/// braked as that of a disc that presses evenly, whether it slides or not:
///
/// ```text
/// |dv/dt| = μ_g g,    |dω/dt| = 4 μ_g g / (3 r)
/// ```
///
/// Contacts with other discs, walls and obstacles: Newton's law with restitution e along the normal, Coulomb's friction μ along the
/// surface, which spins the disc; of two that touch the lower e and the lower μ count, walls and obstacles having neither of their
/// own. To them robots that are no rigid bodies are round
/// bodies that push and are not pushed back, and have neither e nor μ either: off one that moves with u a disc that meets it
/// head-on with v parts with u + e (u − v).
///
/// # Validity
///
/// On a plane: z stays, and heights do not count, but that robots which are no rigid bodies pass over all of them where they are
/// higher than their own radius above the highest. Within a step these go straight, evenly. Bodies that are pressed together overlap a little, and those that meet
/// change their velocities up to one part's way before they touch. Where several meet at once, a restitution for each pair can give
/// them more energy than they had: what they exchange is then lessened until they have as much. How sliding lessens what the ground takes from the spin, and the
/// reverse, is left out (Farkas et al., Phys. Rev. Lett. 90, 248302, 2003). Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Section)]
pub(super) struct RigidBody {
    /// The cap (m/s).
    #[key(inherited)]
    pub(super) speed_cap_mps: f64,
    /// Mass (kg).
    #[key(above = 0.0, most = 1e6, default = 1.0)]
    pub(super) mass_kg: f64,
    /// Diameter of the body in contacts (m). `robotsim.diameter_m` sets what counts as a collision.
    #[key(range = 1e-3..=1e3, default = 0.3)]
    pub(super) body_diameter_m: f64,
    /// Maximum drive force (N). 0: no drive; the body is only pushed.
    #[key(range = 0.0..=1e9, default = 10.0)]
    pub(super) force_cap_n: f64,
    /// Coefficient of friction in contacts with robots, walls and obstacles.
    #[key(range = 0.0..=10.0, default = 0.3)]
    pub(super) friction: f64,
    /// Coefficient of restitution: ratio of the speed after a contact to that before.
    #[key(range = 0.0..=1.0, default = 0.0)]
    pub(super) restitution: f64,
    /// Coefficient of sliding friction with the ground. 0: it glides, or rolls on wheels.
    #[key(range = 0.0..=10.0, default = 0.0)]
    pub(super) ground_friction: f64,
}

impl Inertial for RigidBody {
    fn towards(&self, velocity_mps: [f64; 3], own_mps: [f64; 3], dt_s: f64) -> [f64; 3] {
        // What the ground takes has to be given, too.
        let ground_mps = within(velocity_mps, self.ground_mps2() * dt_s);
        let [x, y, _]: [f64; 3] =
            std::array::from_fn(|i| (velocity_mps[i] - own_mps[i] + ground_mps[i]) / dt_s);
        [x, y, 0.0]
    }

    fn limited(&self, [x, y, _]: [f64; 3]) -> [f64; 3] {
        within([x, y, 0.0], self.force_cap_n / self.mass_kg)
    }
}

impl RigidBody {
    pub(super) fn diameter_m(&self) -> f64 {
        self.body_diameter_m
    }

    /// What the ground takes (m/s²).
    fn ground_mps2(&self) -> f64 {
        self.ground_friction * GRAVITY_MPS2
    }

    /// Velocity (m/s) and way (m) after `h_s`, where without the ground it would have come from one velocity to the other on
    /// that way. Exact where nothing drives it.
    pub(super) fn braked(
        &self,
        [before_mps, after_mps]: [[f64; 3]; 2],
        way_m: [f64; 3],
        h_s: f64,
    ) -> ([f64; 3], [f64; 3]) {
        let taken_mps = self.ground_mps2() * h_s;
        if taken_mps == 0.0 {
            return (after_mps, way_m);
        }
        let speed_mps = norm(after_mps);
        if speed_mps <= taken_mps {
            let begin_mps = norm(before_mps);
            let until_s = h_s.min(begin_mps / self.ground_mps2());
            return ([0.0; 3], before_mps.map(|part_mps| 0.5 * part_mps * until_s));
        }
        let left_mps = after_mps.map(|part_mps| part_mps * (1.0 - taken_mps / speed_mps));
        let shorter = |i: usize| way_m[i] - 0.5 * (after_mps[i] - left_mps[i]) * h_s;
        (left_mps, std::array::from_fn(shorter))
    }

    /// The spin (rad/s) that the ground leaves after `h_s`.
    pub(super) fn slowed(&self, spin_radps: f64, h_s: f64) -> f64 {
        let taken_radps = 4.0 * self.ground_mps2() * h_s / (1.5 * self.body_diameter_m);
        let left_radps = (spin_radps.abs() - taken_radps).max(0.0);
        if spin_radps < 0.0 { -left_radps } else { left_radps }
    }

    /// Moment of inertia (kg m²).
    pub(super) fn inertia(&self) -> f64 {
        0.125 * self.mass_kg * self.body_diameter_m * self.body_diameter_m
    }
}
