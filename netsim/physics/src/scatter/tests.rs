//! How what varies at random is drawn.

use super::*;
use crate::standard::o_qpsk_2450::CHANNELS;

fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len() as f64;
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>() / n;
    let (ma, mb) = (mean(&|p| p.0), mean(&|p| p.1));
    let (va, vb) = (mean(&|p| (p.0 - ma).powi(2)), mean(&|p| (p.1 - mb).powi(2)));
    mean(&|p| (p.0 - ma) * (p.1 - mb)) / (va * vb).sqrt()
}

#[test]
fn a_gauss_markov_process_has_unit_variance_and_exponential_correlation() {
    let draws = Draws::new(11, Purpose::Shadowing);
    // 20,000 links each: the correlation's standard error is (1 - rho^2)/141, the variance's 0.01. All 16 bounds are
    // 4.5 standard errors: a correct program fails for one seed in 9000. The seed is fixed.
    for start in [0.0, 0.37, 15.9, 1000.01] {
        for delta in [0.1, 0.5, 1.0, 3.0] {
            let pairs: Vec<(f64, f64)> = (0..20_000)
                .map(|entity| {
                    let value_after = |way| gauss_markov(draws, entity, 0, way);
                    (value_after(start), value_after(start + delta))
                })
                .collect();
            let expected = (-delta).exp();
            let tolerance = 4.5 * (1.0 - expected * expected) / 141.0 + 0.002; // 1/256 length
            let got = correlation(&pairs);
            assert!((got - expected).abs() < tolerance, "{start} + {delta}: {got}");
            let variance = pairs.iter().map(|p| p.1 * p.1).sum::<f64>() / 2e4;
            assert!((variance - 1.0).abs() < 0.047, "{start} + {delta}: {variance}");
        }
    }
}

#[test]
fn a_gauss_markov_process_does_not_jump() {
    let draws = Draws::new(3, Purpose::Shadowing);
    let mut before = gauss_markov(draws, 1, 0, 0.0);
    for step in 1..=40_000 {
        let now = gauss_markov(draws, 1, 0, f64::from(step) / 1000.0);
        // Within 0.001 lengths the standard deviation is 0.045; 40,000 normal steps beyond 6 of them: 1 in 10^4 seeds.
        assert!((now - before).abs() < 0.27, "at {step}: {before}, {now}");
        before = now;
    }
}

#[test]
fn a_coherent_uniform_level_is_uniform() {
    let scatter = Scatter {
        law: Law::Uniform { span_db: 40.0 },
        renewal: Renewal::Coherence { length_m: 0.06 },
        purpose: Purpose::RandomnessLevel,
        ordinal: 0,
        directed: false,
    };
    let at = Moment { period_ns: 0, sent_ns: 0, way_m: 1.0, channel: None };
    let n = 20_000;
    let mut values: Vec<f64> = (0..n)
        .map(|i| {
            scatter.value_db(
                &mut PairBlock::new(5, MoteId(0), MoteId(i + 1), 0),
                MoteId(0),
                MoteId(i + 1),
                at,
            )
        })
        .collect();
    values.sort_by(f64::total_cmp);
    // Kolmogorov-Smirnov: 1.95/sqrt(n) is exceeded by one seed in 1000.
    let distance = values
        .iter()
        .enumerate()
        .map(|(i, value)| ((value + 20.0) / 40.0 - i as f64 / f64::from(n)).abs())
        .fold(0.0, f64::max);
    assert!(distance < 1.95 / f64::from(n).sqrt(), "{distance}");
}

#[test]
fn both_ends_share_what_is_symmetric_and_nothing_else() {
    let at = Moment { period_ns: 7, sent_ns: 9, way_m: 3.0, channel: None };
    let place = Renewal::Place { length_m: 0.06, coherence_hz: 5e6, channels: CHANNELS };
    let coherence = Renewal::Coherence { length_m: 1.0 };
    for renewal in [Renewal::Frozen, Renewal::Period, Renewal::Frame, coherence, place] {
        for (law, purpose) in [
            (Law::Normal { sd_db: 2.0 }, Purpose::Shadowing),
            (Law::Uniform { span_db: 4.0 }, Purpose::RandomnessLevel),
            (Law::Rician { k_factor_db: 3.0 }, Purpose::FastFading),
            (Law::Nodes { tx_sd_db: 1.0, rx_sd_db: 2.0 }, Purpose::NodeOffset),
        ] {
            let scatter = Scatter { law, renewal, purpose, ordinal: 0, directed: false };
            let mut block = PairBlock::new(1, MoteId(4), MoteId(2), 7);
            let there = scatter.value_db(&mut block, MoteId(4), MoteId(2), at);
            let back = scatter.value_db(&mut block, MoteId(2), MoteId(4), at);
            assert_eq!(there == back, scatter.is_reciprocal(), "{scatter:?}");
            let other = scatter.value_db(
                &mut PairBlock::new(1, MoteId(4), MoteId(3), 7),
                MoteId(4),
                MoteId(3),
                at,
            );
            assert_ne!(there, other, "{scatter:?}");
        }
    }
}
