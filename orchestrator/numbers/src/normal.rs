//! Quantiles of the standard normal distribution, rounded as printed tables have them.

/// The quantile of 95 %: half the width of a 90 % interval (standard errors).
pub const Z_90: f64 = 1.645;
/// The fall of the log likelihood from its maximum to the ends of a 90 % interval (nats): half of the 90 % quantile of χ² with
/// one degree of freedom.
pub const FALL_90_NATS: f64 = 0.5 * Z_90 * Z_90;
/// The upper quartile less the lower one.
pub const INTERQUARTILE_RANGE: f64 = 1.349;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fall_to_the_ends_of_an_interval_is_half_a_quantile_of_chi_squared() {
        // Abramowitz and Stegun, table 26.8: 2.70554. Z_90 has four digits.
        assert!((FALL_90_NATS - 0.5 * 2.70554).abs() < 5e-4);
    }
}
