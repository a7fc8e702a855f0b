//! Random numbers of the campaigns: of their own, so that no change in the product moves a campaign.

/// A stream of random numbers: SplitMix64 (Steele, Lea and Flood 2014).
#[derive(Clone, Debug)]
pub(crate) struct Draws {
    state: u64,
    spare: Option<f64>,
}

impl Draws {
    /// The stream of a seed for one purpose. Different purposes do not disturb each other.
    pub(crate) fn new(seed: u64, purpose: &str) -> Self {
        // FNV-1a.
        let hash = purpose.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
        let mut draws = Self { state: seed, spare: None };
        let mixed = draws.next();
        draws.state = mixed ^ hash;
        draws.next();
        draws
    }

    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform from 0 to below 1.
    pub(crate) fn uniform(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform between two values.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Between two values above 0, uniform in the logarithm.
    pub(crate) fn log_between(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    /// One of the whole numbers below `n`.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.uniform() * n as f64) as usize
    }

    /// Whether something of this probability happens.
    pub(crate) fn chance(&mut self, probability: f64) -> bool {
        self.uniform() < probability
    }

    /// Standard normal (Box and Muller 1958).
    pub(crate) fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        let (sin, cos) = (std::f64::consts::TAU * self.uniform()).sin_cos();
        self.spare = Some(radius * sin);
        radius * cos
    }

    /// The numbers below `n` in random order (Fisher and Yates).
    pub(crate) fn order(&mut self, n: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..n).collect();
        for last in (1..n).rev() {
            let other = self.below(last + 1);
            order.swap(last, other);
        }
        order
    }
}

#[cfg(test)]
mod tests {
    use super::Draws;

    #[test]
    fn draws_have_the_moments_they_should_have() {
        let mut draws = Draws::new(1, "moments");
        let n = 100_000;
        let normals: Vec<f64> = (0..n).map(|_| draws.normal()).collect();
        // Of n normals the mean has a standard error of 0.0032, the variance of 0.0045: four of either.
        assert!(crate::statistics::mean(&normals).abs() < 0.0127);
        assert!((crate::statistics::deviation(&normals).powi(2) - 1.0).abs() < 0.018);
        // Uniform: 0.00091.
        let uniforms: Vec<f64> = (0..n).map(|_| draws.uniform()).collect();
        assert!((crate::statistics::mean(&uniforms) - 0.5).abs() < 0.0037);
        let mut order = draws.order(10);
        order.sort_unstable();
        assert_eq!(order, (0..10).collect::<Vec<_>>());
        assert_ne!(Draws::new(1, "a").uniform(), Draws::new(1, "b").uniform());
        assert_ne!(Draws::new(1, "a").uniform(), Draws::new(2, "a").uniform());
    }
}
