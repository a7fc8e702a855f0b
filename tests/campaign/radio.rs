//! Equations of the radio, written from their sources and not from the product.

use std::f64::consts::{PI, TAU};

/// Speed of light (m/s).
pub(crate) const LIGHT_MPS: f64 = 299_792_458.0;

/// Centre of an IEEE 802.15.4 channel (MHz): IEEE Std 802.15.4-2006, 6.1.2.1.
pub(crate) fn centre_mhz(channel: u8) -> f64 {
    2405.0 + 5.0 * (f64::from(channel) - 11.0)
}

/// Wavelength of a channel (m).
pub(crate) fn wavelength_m(channel: u8) -> f64 {
    LIGHT_MPS / (centre_mhz(channel) * 1e6)
}

/// Free-space gain between isotropic antennas (dB): Friis 1946.
pub(crate) fn friis_db(distance_m: f64, channel: u8) -> f64 {
    20.0 * (wavelength_m(channel) / (4.0 * PI * distance_m.max(0.1))).log10()
}

/// Reception over RSSI (dBm) of the 6TiSCH simulator, linear between whole dBm from -97 to -79.
pub(crate) fn table(rssi_dbm: f64) -> f64 {
    const FROM_DBM: f64 = -97.0;
    const DELIVERED: [f64; 19] = [
        0.0000, 0.1494, 0.2340, 0.4071, 0.6359, 0.6866, 0.7476, 0.8603, 0.8702, 0.9324, 0.9427,
        0.9562, 0.9611, 0.9739, 0.9745, 0.9844, 0.9854, 0.9903, 1.0000,
    ];
    let place = rssi_dbm - FROM_DBM;
    if place <= 0.0 {
        return 0.0;
    }
    let below = place as usize;
    if DELIVERED.len() - 1 <= below {
        return 1.0;
    }
    DELIVERED[below] + (place - below as f64) * (DELIVERED[below + 1] - DELIVERED[below])
}

/// Reflection coefficient of flat ground for a wave that arrives at a grazing angle: Fresnel, without losses in the ground.
/// Its sign is such that it goes to -1 as the angle goes to 0.
pub(crate) fn reflection(sin: f64, cos: f64, permittivity: f64, vertical: bool) -> f64 {
    let root = (permittivity - cos * cos).sqrt();
    let direct = if vertical { permittivity * sin } else { sin };
    (direct - root) / (direct + root)
}

/// What the ray reflected by the ground adds to the direct one (dB): Sommer, Joerer and Dressler 2012, eq. 5 to 8.
/// `planar_m`: distance over ground.
pub(crate) fn two_ray_db(
    planar_m: f64,
    heights_m: [f64; 2],
    channel: u8,
    permittivity: f64,
    vertical: bool,
) -> f64 {
    let direct_m = planar_m.hypot(heights_m[0] - heights_m[1]);
    let reflected_m = planar_m.hypot(heights_m[0] + heights_m[1]);
    let sin = (heights_m[0] + heights_m[1]) / reflected_m;
    let amplitude =
        reflection(sin, planar_m / reflected_m, permittivity, vertical) * direct_m / reflected_m;
    let phase = TAU * (reflected_m - direct_m) / wavelength_m(channel);
    let (sin, cos) = phase.sin_cos();
    10.0 * ((1.0 + amplitude * cos).powi(2) + (amplitude * sin).powi(2)).max(1e-6).log10()
}

/// Loss of a knife edge (dB): ITU-R P.526, J(ν), 0 at and below ν = -0.78.
pub(crate) fn knife_edge_db(nu: f64) -> f64 {
    if nu <= -0.78 {
        return 0.0;
    }
    let shifted = nu - 0.1;
    (6.9 + 20.0 * ((shifted * shifted + 1.0).sqrt() + shifted).log10()).max(0.0)
}

/// ν of an edge that stands `above_m` above the direct path, at these distances from the ends: ITU-R P.526, eq. 26.
pub(crate) fn nu(above_m: f64, from_ends_m: [f64; 2], wavelength_m: f64) -> f64 {
    let [one, other] = from_ends_m.map(|distance| distance.max(0.01));
    above_m * (2.0 / wavelength_m * (1.0 / one + 1.0 / other)).sqrt()
}

/// Radius of the first Fresnel zone (m): ITU-R P.526, eq. 1.
pub(crate) fn fresnel_m(from_ends_m: [f64; 2], wavelength_m: f64) -> f64 {
    let [one, other] = from_ends_m;
    (wavelength_m * one * other / (one + other)).sqrt()
}

/// Power (dB) of a Rician channel of unit mean power. `scattered`: two standard normal draws.
pub(crate) fn rician_db(k_factor_db: f64, scattered: [f64; 2]) -> f64 {
    let k = 10_f64.powf(k_factor_db / 10.0);
    let scale = (0.5 / (k + 1.0)).sqrt();
    let in_phase = (k / (k + 1.0)).sqrt() + scale * scattered[0];
    10.0 * (in_phase.powi(2) + (scale * scattered[1]).powi(2)).max(1e-12).log10()
}

/// Share of frames lost because the channel changes within them: of the power that arrives scattered, 1 / (K + 1), what has
/// decorrelated in a frame of the greatest length (133 bytes on the air, 4.256 ms), with the coherence time 0.423 / f_D of
/// Clarke's model.
pub(crate) fn motion_loss(relative_speed_mps: f64, channel: u8, rician_k_db: f64) -> f64 {
    const FRAME_S: f64 = 133.0 * 8.0 / 250_000.0;
    let doppler_hz = relative_speed_mps / wavelength_m(channel);
    (1.0 - (-FRAME_S * doppler_hz / 0.423).exp()) / (1.0 + 10_f64.powf(rician_k_db / 10.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(value: f64, expected: f64, tolerance: f64) {
        assert!((value - expected).abs() <= tolerance, "{value}, not {expected}");
    }

    #[test]
    fn free_space_has_the_values_that_were_agreed_on() {
        // Printed to two digits.
        near(friis_db(10.0, 11), -60.07, 0.005);
        near(friis_db(10.0, 26), -60.34, 0.005);
    }

    #[test]
    fn the_table_goes_through_its_points() {
        near(table(-97.0), 0.0, 1e-12);
        near(table(-93.6), 0.4986, 5e-5);
        near(table(-90.0), 0.8603, 1e-12);
        near(table(-79.0), 1.0, 1e-12);
        near(table(-20.0), 1.0, 1e-12);
    }

    #[test]
    fn far_away_two_rays_fall_with_the_fourth_power_of_distance() {
        // Ideal ground: received power h_t² h_r² / d⁴, so relative to Friis 20 log10(4π h_t h_r / (λ d)).
        let (d, heights) = (20_000.0, [1.5, 1.0]);
        let expected = 20.0 * (4.0 * PI * 1.5 / (wavelength_m(20) * d)).log10();
        near(two_ray_db(d, heights, 20, 1e7, false), expected, 0.02);
        // No ground, no reflection.
        near(two_ray_db(30.0, heights, 20, 1.0, false), 0.0, 1e-12);
        near(two_ray_db(30.0, heights, 20, 1.0, true), 0.0, 1e-12);
    }

    #[test]
    fn vertical_waves_vanish_at_brewsters_angle() {
        let permittivity: f64 = 15.0;
        // tan(grazing) = 1 / √ε.
        let grazing = (1.0 / permittivity.sqrt()).atan();
        near(reflection(grazing.sin(), grazing.cos(), permittivity, true), 0.0, 1e-12);
        near(reflection(1e-9, 1.0, permittivity, true), -1.0, 1e-6);
        near(reflection(1e-9, 1.0, permittivity, false), -1.0, 1e-6);
    }

    #[test]
    fn an_edge_on_the_path_costs_six_decibels() {
        // P.526: J(0) = 6.0 dB in its figure; the approximation gives 6.03.
        near(knife_edge_db(nu(0.0, [10.0, 20.0], 0.123)), 6.03, 0.005);
        near(knife_edge_db(-1.0), 0.0, 1e-12);
        near(fresnel_m([15.0, 15.0], 0.12), 0.9_f64.sqrt(), 1e-12);
    }

    #[test]
    fn rayleigh_fading_costs_two_and_a_half_decibels_in_the_mean() {
        let mut draws = crate::campaign::draws::Draws::new(7, "rayleigh");
        let n = 100_000;
        let levels: Vec<f64> =
            (0..n).map(|_| rician_db(-60.0, [draws.normal(), draws.normal()])).collect();
        // -10 γ / ln 10 and 5.57 dB of scatter: standard errors 0.018 and about 0.02, four of either.
        near(crate::statistics::mean(&levels), -2.507, 0.071);
        near(crate::statistics::deviation(&levels), 5.570, 0.09);
    }

    #[test]
    fn a_still_channel_loses_nothing_and_a_fast_one_what_is_scattered() {
        near(motion_loss(0.0, 15, 0.0), 0.0, 1e-15);
        near(motion_loss(1e6, 15, 0.0), 0.5, 1e-9);
    }
}
