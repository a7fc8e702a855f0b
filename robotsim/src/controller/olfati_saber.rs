//! Flocking as a lattice that moves, after Olfati-Saber.

use super::{Controller, Demands, Entry, Goal, View, add, norm, scaled, sub};
use crate::dynamics::Command;
use proto::config::{Section, key, variant};
use proto::ids::AgentId;

pub(super) const ENTRY: Entry = Entry {
    variant: variant::<OlfatiSaber>("olfati-saber"),
    demands: Demands::NONE,
    goal: Goal::Lattice,
    build: |table, context, problems| {
        table.entry("target_m").or_insert(vec![0.0, 0.0].into());
        table.entry("target_velocity_mps").or_insert(vec![0.0, 0.0].into());
        let target_gain_per_s2: f64 = key(table, "target_gain_per_s2");
        let critical_per_s = 2.0 * libm::sqrt(target_gain_per_s2);
        table.entry("target_damping_per_s").or_insert(critical_per_s.into());
        let this = OlfatiSaber::read(table);
        let [vx, vy] = this.target_velocity_mps;
        super::check_speed("target_velocity_mps", libm::hypot(vx, vy), context, problems);
        Some(Box::new(this))
    },
};

/// Olfati-Saber flocking: robots form a lattice and follow a virtual leader that all know.
///
/// α-lattice flocking with a navigational feedback.
///
/// # Model
///
/// Olfati-Saber, "Flocking for multi-agent dynamic systems: algorithms and theory", IEEE Trans. Autom. Control 51(3), 2006,
/// eqs. 8 to 24. Double integrators; over the robots j that i knows of:
///
/// ```text
///     a_i  =  Σ φ_α(‖x_j − x_i‖_σ) n_ij  +  Σ a_ij (v_j − v_i)  −  c1 (x_i − x_r) − c2 (v_i − v_r)
///
///     ‖z‖_σ = (√(1 + ε|z|²) − 1) / ε           n_ij = (x_j − x_i) / √(1 + ε |x_j − x_i|²)
///     φ_α(z) = ρ(z / r_α) φ(z − d_α)           φ(z) = ((a + b) σ(z + c) + a − b) / 2,   σ(z) = z / √(1 + z²)
///     a_ij = ρ(‖x_j − x_i‖_σ / r_α)            ρ(z): 1 below h, falls as a cosine to 0 at 1
/// ```
///
/// with ε = 0.1, a = b = 5, hence c = 0, h = 0.2, d_α = ‖d‖_σ, r_α = ‖r‖_σ, as there. x_r moves with v_r from `target_m`.
/// The command is v_i + a_i Δt.
///
/// # Validity
///
/// Stable where Δt times the sum of the a_ij stays below 2. The lattice is somewhat tighter than d where c1 pulls it
/// together.
#[derive(Debug, Section)]
struct OlfatiSaber {
    /// d: desired distance between neighbours (m). Default: the source's.
    #[key(above = 0.0, most = 1e6, default = 7.0)]
    distance_m: f64,
    /// r / d: interaction range per desired distance. Default: the source's.
    #[key(above = 1.0, most = 10.0, default = 1.2)]
    range_ratio: f64,
    /// Initial position of the virtual leader (x, y in m).
    #[key(range = -1e6..=1e6, absent)]
    target_m: [f64; 2],
    /// Its velocity (x, y in m/s).
    #[key(range = -1e4..=1e4, absent)]
    target_velocity_mps: [f64; 2],
    /// c1: position gain towards the virtual leader (1/s²).
    #[key(range = 0.0..=1e3, default = 0.1)]
    target_gain_per_s2: f64,
    /// c2: velocity gain towards the virtual leader (1/s). Default: 2 √c1.
    #[key(range = 0.0..=1e3, absent)]
    target_damping_per_s: f64,
}

const EPSILON: f64 = 0.1;
const A: f64 = 5.0;
const H: f64 = 0.2;

fn sigma_norm(distance: f64) -> f64 {
    (libm::sqrt(1.0 + EPSILON * distance * distance) - 1.0) / EPSILON
}

fn bump(z: f64) -> f64 {
    if z < H {
        1.0
    } else if z < 1.0 {
        0.5 * (1.0 + libm::cos(std::f64::consts::PI * (z - H) / (1.0 - H)))
    } else {
        0.0
    }
}

impl Controller for OlfatiSaber {
    fn command(&self, view: &View<'_>, agent: AgentId) -> Command {
        let own_m = view.position_m(agent);
        let own_mps = view.velocity_mps(agent);
        let wanted = sigma_norm(self.distance_m);
        let range = sigma_norm(self.range_ratio * self.distance_m);
        let mut acceleration = [0.0; 3];
        view.knowledge.for_each_known_to(agent, |seen| {
            let to = sub(seen.motion.position_m, own_m);
            let distance_m = norm(to);
            let z = sigma_norm(distance_m);
            let weight = bump(z / range);
            if weight == 0.0 {
                return;
            }
            let off = z - wanted;
            let action = weight * A * off / libm::sqrt(1.0 + off * off);
            let towards = 1.0 / libm::sqrt(1.0 + EPSILON * distance_m * distance_m);
            acceleration = add(acceleration, scaled(to, action * towards));
            let faster = sub(seen.motion.velocity_mps, own_mps);
            acceleration = add(acceleration, scaled(faster, weight));
        });
        let ([x, y], [vx, vy]) = (self.target_m, self.target_velocity_mps);
        let target_m = [x + vx * view.time_s, y + vy * view.time_s, own_m[2]];
        let pull = scaled(sub(target_m, own_m), self.target_gain_per_s2);
        let damp = scaled(sub([vx, vy, 0.0], own_mps), self.target_damping_per_s);
        acceleration = add(acceleration, add(pull, damp));
        Command::Acceleration(acceleration)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_functions_are_those_of_the_source() {
        // By hand: ‖7‖_σ = (√5.9 − 1)/0.1; ρ halves in the middle between h and 1.
        assert!((sigma_norm(7.0) - 14.289_915_602_9).abs() < 1e-9);
        assert_eq!([bump(0.0), bump(0.19), bump(1.0), bump(2.0)], [1.0, 1.0, 0.0, 0.0]);
        assert!((bump(0.6) - 0.5).abs() < 1e-12);
    }
}
