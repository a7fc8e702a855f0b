//! Quantiles of the standard normal distribution, rounded as printed tables have them.

/// The quantile of 95 %: half the width of a 90 % interval (standard errors).
pub const Z_90: f64 = 1.645;
/// The fall of the log likelihood from its maximum to the ends of a 90 % interval (nats): half of the 90 % quantile of χ² with
/// one degree of freedom, which is half of the square of [`Z_90`].
pub const FALL_90_NATS: f64 = 1.353;
/// The upper quartile less the lower one.
pub const INTERQUARTILE_RANGE: f64 = 1.349;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_fit_together_to_their_digits() {
        assert!((0.5 * Z_90 * Z_90 - FALL_90_NATS).abs() < 1e-3);
    }
}
