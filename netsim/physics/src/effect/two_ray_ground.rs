//! The ray that the ground reflects.

use super::{Effect, Entry};
use crate::link::Link;
use proto::config::{Choice, Section};
use proto::effect::{Catalogued, Fixed, Level, Need};
use std::f64::consts::TAU;

/// `kind = "two-ray-ground"`.
pub const ENTRY: Entry = Entry::of::<TwoRayGround>();

/// Polarisation of the antennas.
#[derive(Choice, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Polarization {
    /// Vertical antennas: the field lies in the plane of incidence.
    Vertical,
    /// Horizontal antennas: the field is parallel to the ground.
    Horizontal,
}

/// The direct ray and the ray reflected by flat ground interfere.
///
/// # Mechanism
///
/// A second ray arrives by reflection from the ground. Both rays interfere according to the difference of their path lengths; far
/// away the reflected ray always cancels the direct ray.
///
/// # Equation
///
/// ```text
/// RSSI' = RSSI + 20 log10 |1 + G (d_los/d_ref) e^(-j 2 pi (d_ref - d_los)/lambda)|, d_ref = sqrt(d_ground^2 + (h_t +
/// h_r)^2), G Fresnel's coefficient for sin(t) = (h_t + h_r)/d_ref: vertical (e sin t - r)/(e sin t + r), horizontal (sin t
/// - r)/(sin t + r), r = sqrt(e - cos^2 t), e = relative_permittivity
/// ```
///
/// # Source
///
/// C. Sommer, S. Joerer, F. Dressler, On the applicability of two-ray path loss models for vehicular network simulation, IEEE VNC
/// 2012; C. Sommer, F. Dressler, Using the right two-ray model? (2011); Rappaport, § 4.6.
///
/// # Validity
///
/// Flat, smooth, lossless ground at z = 0 and isotropic antennas. No effect unless both antenna heights are positive. Not valid
/// indoors, where other rays are as strong.
///
/// # Trace
///
/// Ripples over distance that shift with height and channel; beyond 4 pi h_t h_r / lambda power falls with the fourth power of
/// distance.
#[derive(Clone, Copy, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "two-ray-ground",
    needs = &[Need::Positions, Need::Heights, Need::Readings],
    example = "relative_permittivity = 15.0\npolarization = \"vertical\"\n",
    variants = &[&[("polarization", Fixed::Text("vertical"))], &[("polarization", Fixed::Text("horizontal"))]],
    level = Level::Place,
)]
pub struct TwoRayGround {
    /// Relative permittivity of the ground: 3 to 5 for dry ground and concrete, 15 for average ground, 30 for wet ground, 80 for
    /// water.
    #[key(range = 1.0..=80.0)]
    #[fit(unit = "", starts = [1.05, 1.5, 4.0, 15.0, 40.0], step = 0.01)]
    pub relative_permittivity: f64,
    /// Polarisation of the antennas.
    #[key(default = Polarization::Vertical)]
    pub polarization: Polarization,
}

impl TwoRayGround {
    /// Fresnel's coefficient for a ray that meets the ground at the angle θ.
    fn reflection(&self, sine: f64, cosine_squared: f64) -> f64 {
        let root = (self.relative_permittivity - cosine_squared).sqrt();
        let upright = match self.polarization {
            Polarization::Vertical => self.relative_permittivity * sine,
            Polarization::Horizontal => sine,
        };
        (upright - root) / (upright + root)
    }
}

/// What is left where both rays cancel (dB): fields are never so equal.
const DEEPEST_DB: f64 = -100.0;

impl Effect for TwoRayGround {
    fn contribution_db(&self, link: &Link<'_>) -> f64 {
        let ([ax, ay, az], [bx, by, bz]) = (link.sender.position_m, link.receiver.position_m);
        if az <= 0.0 || bz <= 0.0 {
            return 0.0;
        }
        let ground_squared = (ax - bx) * (ax - bx) + (ay - by) * (ay - by);
        let height_m = az + bz;
        let reflected_m = (ground_squared + height_m * height_m).sqrt();
        let direct_m = link.distance_m;
        let sine = height_m / reflected_m;
        let cosine_squared = (1.0 - sine * sine).max(0.0);
        let share = self.reflection(sine, cosine_squared) * (direct_m / reflected_m);
        let phase = TAU * (reflected_m - direct_m) / link.wavelength_m();
        let power = 1.0 + 2.0 * share * libm::cos(phase) + share * share;
        (10.0 * libm::log10(power.max(0.0))).max(DEEPEST_DB)
    }

    fn needs_heights(&self) -> bool {
        true
    }

    fn max_gain_db(&self) -> f64 {
        // Both rays alike: twice the field. Where the least distance is longer than the ground's ray, a little more.
        6.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::testing::along_x;
    use crate::link::Scene;

    const BOTH: [Polarization; 2] = [Polarization::Vertical, Polarization::Horizontal];

    fn contribution_at(
        relative_permittivity: f64,
        polarization: Polarization,
        d_m: f64,
        h_m: f64,
    ) -> f64 {
        let scene = Scene::default();
        TwoRayGround { relative_permittivity, polarization }.contribution_db(&along_x(
            d_m,
            h_m,
            Some(18),
            &scene,
        ))
    }

    #[test]
    fn far_away_power_falls_with_the_fourth_power_of_distance() {
        // Rappaport, eq. 4.52: P = P_t h_t² h_r²/d⁴, which is Friis times (4 π h_t h_r/(λ d))².
        let wavelength_m = 299_792_458.0 / 2.44e9;
        for polarization in BOTH {
            for d_m in [2e5, 4e5] {
                let expected = 20.0 * (4.0 * std::f64::consts::PI / (wavelength_m * d_m)).log10();
                let got = contribution_at(15.0, polarization, d_m, 1.0);
                // 1 + Γ stands at a right angle to the phase and is, at sin θ = 10⁻⁵, 16 % of it (vertical) or
                // 1 % (horizontal): 0.11 dB and 0.0005 dB.
                let tolerance_db = match polarization {
                    Polarization::Vertical => 0.12,
                    Polarization::Horizontal => 0.001,
                };
                assert!((got - expected).abs() < tolerance_db, "{polarization:?} {d_m}: {got}");
            }
        }
    }

    #[test]
    fn at_brewsters_angle_nothing_vertical_is_reflected() {
        // tan of the angle to the ground is 1/√ε.
        for relative_permittivity in [2.0f64, 15.0] {
            let d_m = 2.0 * relative_permittivity.sqrt();
            let got = contribution_at(relative_permittivity, Polarization::Vertical, d_m, 1.0);
            assert!(got.abs() < 1e-9, "{got}");
        }
    }

    #[test]
    fn ground_of_permittivity_1_is_no_ground() {
        for polarization in BOTH {
            for d_m in [1.0, 7.0, 30.0] {
                assert!(contribution_at(1.0, polarization, d_m, 1.5).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn straight_down_fresnel_says_1_minus_the_index_over_1_plus_it() {
        // ε = 4: index 2, Γ = -1/3 (horizontal). A link straight up from 1 m to 2 m: paths 1 and 3 m.
        let scene = Scene::default();
        let mut link = along_x(0.0, 1.0, None, &scene);
        link.receiver.position_m[2] = 2.0;
        link.distance_m = 1.0;
        let effect =
            TwoRayGround { relative_permittivity: 4.0, polarization: Polarization::Horizontal };
        let phase = TAU * 2.0 * link.frequency_hz / 299_792_458.0;
        let expected = 10.0 * (1.0 - 2.0 / 9.0 * phase.cos() + 1.0 / 81.0).log10();
        assert!((effect.contribution_db(&link) - expected).abs() < 1e-9);
    }

    #[test]
    fn without_heights_nothing_is_added() {
        assert_eq!(contribution_at(15.0, Polarization::Vertical, 10.0, 0.0), 0.0);
    }
}
