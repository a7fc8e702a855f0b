//! A measurement against the spread of seeds.
//!
//! If the model is right the measurement is one more run of it, exchangeable with those of `S` seeds. So the probability of a value
//! at least as extreme is its rank among all `S + 1`, whatever the distribution of the figure.
//!
//! For all figures together, the most extreme figure of a run counts, in units of the scatter of all `S + 1`. That rank is exact
//! too, and needs no correction for several figures.

use super::comparison::{Kpi, KpiOfModel};
use super::figure::FigureSpec;
use numbers::statistics::{mean, quantile, standard_deviation};
use study::thresholds::TAIL_90;

/// A figure of the measurement compared with its distribution over seeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FigurePlacement {
    /// Mean over the seeds.
    pub mean: f64,
    /// Where the middle 90 % of the seeds lie.
    pub interval: [f64; 2],
    /// Two-sided p-value.
    pub p_value: f64,
    /// Difference from the mean, in standard deviations of seeds and measurement together.
    pub z: f64,
}

/// A figure in the answer of a comparison.
///
/// * `seeds`: its value under each seed of the model; `mean`, and `[low, high]` of the middle 90 % of them.
pub(super) fn kpi<S>(
    figure: &FigureSpec<S>,
    measured: f64,
    mean: f64,
    [low, high]: [f64; 2],
    seeds: Vec<f64>,
    standing: Option<FigurePlacement>,
) -> Kpi {
    Kpi {
        name: figure.name,
        unit: figure.unit,
        doc: figure.doc,
        measured,
        model: KpiOfModel { mean, low, high, seeds },
        p_value: standing.map(|standing| standing.p_value),
        z: standing.map(|standing| standing.z),
    }
}

/// A measurement compared with runs under many seeds.
#[derive(Clone, Debug, PartialEq)]
pub struct Placement {
    /// By figure; `None`: it is not known of the measurement, or of a seed.
    pub figures: Vec<Option<FigurePlacement>>,
    /// P-value over all figures together.
    pub p_value: f64,
}

/// Places a measurement among seeds. Figures are given on scales on which differences mean the same everywhere.
#[must_use]
pub(crate) fn place(measured: &[f64], seeds: &[Vec<f64>]) -> Placement {
    let n = seeds.len() as f64;
    let is_known = |k: usize| {
        !seeds.is_empty() && measured[k].is_finite() && seeds.iter().all(|seed| seed[k].is_finite())
    };
    let known: Vec<usize> = (0..measured.len()).filter(|&k| is_known(k)).collect();
    let all = || seeds.iter().map(Vec::as_slice).chain([measured]);
    let scatter: Vec<(f64, f64)> = (0..measured.len())
        .map(|k| {
            let values = all().map(|run| run[k]);
            (mean(values.clone()), standard_deviation(values))
        })
        .collect();
    let out = |run: &[f64], k: usize| {
        let (mean, sd) = scatter[k];
        // What differs in nothing but rounding differs in nothing.
        if sd <= 1e-9 * mean.abs().max(1e-9) { 0.0 } else { (run[k] - mean) / sd }
    };
    let furthest =
        |run: &[f64]| known.iter().map(|&k| out(run, k).abs()).fold(0.0, f64::max) * (1.0 - 1e-12);
    let here = furthest(measured);
    let as_far = seeds.iter().filter(|seed| here <= furthest(seed) / (1.0 - 1e-12)).count();
    let figures = (0..measured.len())
        .map(|k| {
            known.contains(&k).then(|| {
                let mut values: Vec<f64> = seeds.iter().map(|seed| seed[k]).collect();
                values.sort_by(f64::total_cmp);
                let below = values.iter().filter(|&&value| value <= measured[k]).count() as f64;
                let above = values.iter().filter(|&&value| measured[k] <= value).count() as f64;
                FigurePlacement {
                    mean: mean(values.iter().copied()),
                    interval: [TAIL_90, 1.0 - TAIL_90].map(|share| quantile(&values, share)),
                    p_value: (2.0 * (1.0 + below.min(above)) / (n + 1.0)).min(1.0),
                    z: out(measured, k),
                }
            })
        })
        .collect();
    Placement { figures, p_value: (1.0 + as_far as f64) / (n + 1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::rng::{Draws, Purpose};
    use study::thresholds::CONSISTENCY_LEVEL;

    /// Figures that depend on each other, with long tails.
    fn run(number: u64, shift: f64) -> Vec<f64> {
        let draws = Draws::new(7, Purpose::Resample);
        let common = draws.normal(number, 0, 0);
        (1..6)
            .map(|k| {
                libm::exp(draws.normal(number, k, 0) + common) + if k == 3 { shift } else { 0.0 }
            })
            .collect()
    }

    #[test]
    fn a_run_of_the_model_itself_is_far_out_as_often_as_said() {
        let n = 400u64;
        let mut false_alarms = 0;
        for trial in 0..n {
            let seeds: Vec<Vec<f64>> = (1..40).map(|seed| run(trial * 100 + seed, 0.0)).collect();
            let placed = place(&run(trial * 100, 0.0), &seeds);
            false_alarms += u64::from(placed.p_value <= CONSISTENCY_LEVEL);
        }
        // 20 expected of 400, standard deviation 4.4.
        assert!((7..=33).contains(&false_alarms), "{false_alarms}");
    }

    #[test]
    fn what_no_seed_comes_near_is_found_and_named() {
        let seeds: Vec<Vec<f64>> = (1..40).map(|seed| run(seed, 0.0)).collect();
        let placed = place(&run(0, 100.0), &seeds);
        assert_eq!(placed.p_value, 1.0 / 40.0);
        let standing = placed.figures[2].unwrap();
        assert_eq!(standing.p_value, 2.0 / 40.0);
        assert!(standing.interval[1] < standing.mean + 100.0 && 5.0 < standing.z);
        // A figure that nobody knows is left out.
        let mut measured = run(0, 0.0);
        measured[1] = f64::NAN;
        assert_eq!(place(&measured, &seeds).figures[1], None);
    }
}
