//! The random-walk algorithm of Metropolis: N. Metropolis, A. Rosenbluth, M. Rosenbluth, A. Teller and E. Teller, Journal of Chemical
//! Physics 21 (1953); C. Robert and G. Casella, Monte Carlo Statistical Methods (2004), § 7.5.

/// A proposed state, and what decides whether the walk takes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal<P> {
    /// The state. A proposal must be as likely as its reverse.
    pub state: P,
    /// A random number that is uniform in 0 to 1.
    pub uniform: f64,
}

/// A random walk over the states of a distribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Metropolis {
    /// Number of steps.
    pub n_steps: usize,
    /// The first states, which depend on the start and are dropped.
    pub burn_in: usize,
}

impl Metropolis {
    /// States in the frequency of their density, neighbours correlated. `log_density` may be shifted by a constant. `propose` gets the
    /// number of the step and the current state; `None`: the proposed state is impossible, and the walk stays.
    pub fn sample<P: Clone>(
        &self,
        start: P,
        log_density: impl Fn(&P) -> f64,
        propose: impl Fn(usize, &P) -> Option<Proposal<P>>,
    ) -> Vec<P> {
        let mut log = log_density(&start);
        let mut state = start;
        let mut states = Vec::with_capacity(self.n_steps.saturating_sub(self.burn_in));
        for step in 0..self.n_steps {
            if let Some(proposal) = propose(step, &state) {
                let proposed = log_density(&proposal.state);
                if libm::log(proposal.uniform) < proposed - log {
                    (state, log) = (proposal.state, proposed);
                }
            }
            if self.burn_in <= step {
                states.push(state.clone());
            }
        }
        states
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::{mean, standard_deviation};

    /// A number that is uniform in 0 to 1, by the hash SplitMix64.
    fn uniform(step: usize, index: usize) -> f64 {
        let mut word = (2 * step + index + 1) as u64;
        word = word.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        word = (word ^ word >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        word = (word ^ word >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((word ^ word >> 31) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Moves one number by up to `width` in either direction.
    fn walk(width: f64) -> impl Fn(usize, &f64) -> Option<Proposal<f64>> {
        move |step, state| {
            let state = state + width * (2.0 * uniform(step, 0) - 1.0);
            (-50.0..50.0).contains(&state).then_some(Proposal { state, uniform: uniform(step, 1) })
        }
    }

    const WALK: Metropolis = Metropolis { n_steps: 100_000, burn_in: 1_000 };

    #[test]
    fn a_normal_distribution_has_its_mean_and_standard_deviation() {
        let states = WALK.sample(20.0, |x| -0.5 * (x - 3.0) * (x - 3.0) / 4.0, walk(5.0));
        assert_eq!(states.len(), 99_000);
        let (mean, sd) = (mean(states.iter().copied()), standard_deviation(states.iter().copied()));
        assert!((mean - 3.0).abs() < 0.1, "{mean}");
        assert!((sd - 2.0).abs() < 0.1, "{sd}");
    }

    #[test]
    fn impossible_states_are_never_taken() {
        let unit = |x: &f64| (0.0..1.0).contains(x);
        let proposed = walk(0.5);
        let propose = |step: usize, x: &f64| proposed(step, x).filter(|it| unit(&it.state));
        let by_proposal = WALK.sample(0.5, |_| 0.0, propose);
        let by_density =
            WALK.sample(0.5, |x| if unit(x) { 0.0 } else { f64::NEG_INFINITY }, walk(0.5));
        assert_eq!(by_proposal, by_density);
        assert!(by_proposal.iter().all(unit));
        // Uniform over them: a quarter lies in the first quarter.
        let n = by_proposal.len() as f64;
        let share = by_proposal.iter().filter(|x| **x < 0.25).count() as f64 / n;
        assert!((share - 0.25).abs() < 0.02, "{share}");
    }
}
