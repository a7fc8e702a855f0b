//! Whether passes of a node through all bearings agree on a pattern of its antenna.

use nalgebra::{Matrix3, Vector3};
use numbers::power::square;
use statrs::distribution::{ContinuousCDF as _, FisherSnedecor};
use study::linear::Linearised;
use study::links::rows::passes::Passes;
use study::thresholds::FEWEST_REPLICATES;

/// P-value of a first harmonic over the bearing. Each pass gives its amplitudes along cosine and sine beside a level of its own, so that
/// neither a level of the pair nor one of a turn counts. All passes together show no pattern where their mean is no greater than their
/// scatter, by Fisher's F: as every bearing is passed, the scatter is the same along both.
#[must_use]
pub(crate) fn p_value(rows: &Linearised, passes: &Passes) -> f64 {
    let amplitudes: Vec<[f64; 2]> =
        passes.rows.iter().filter_map(|pass| amplitude(rows, passes, pass)).collect();
    if amplitudes.len() < FEWEST_REPLICATES {
        return 1.0;
    }
    let n = amplitudes.len() as f64;
    let mean: [f64; 2] =
        std::array::from_fn(|k| amplitudes.iter().map(|one| one[k]).sum::<f64>() / n);
    let between = n * mean.iter().map(|mean| square(*mean)).sum::<f64>();
    let within: f64 =
        amplitudes.iter().flat_map(|one| (0..2).map(|k| square(one[k] - mean[k]))).sum();
    let freedom = [2.0, 2.0 * (n - 1.0)];
    let ratio = between / freedom[0] / (within / freedom[1]);
    FisherSnedecor::new(freedom[0], freedom[1]).map_or(1.0, |law| law.sf(ratio))
}

/// Least-squares amplitudes of a pass along the cosine and the sine of the bearing (dB), beside a level.
fn amplitude(rows: &Linearised, passes: &Passes, pass: &[u32]) -> Option<[f64; 2]> {
    let (mut squares, mut products) = (Matrix3::zeros(), Vector3::zeros());
    for &row in pass {
        let row = row as usize;
        let [cosine, sine] = passes.harmonic[row];
        let (x, error) = (Vector3::new(1.0, cosine, sine), rows.errors[row][0]);
        if error.is_finite() {
            squares += x * x.transpose();
            products += error * x;
        }
    }
    let amplitudes = squares.cholesky()?.solve(&products);
    Some([amplitudes[1], amplitudes[2]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::rng::{Draws, Purpose};
    use std::f64::consts::TAU;

    /// Turns of 40 rows with levels that differ by turn, noise of 2 dB and, along the cosine, this amplitude (dB).
    fn p_of(seed: u64, n_turns: usize, amplitude_db: f64) -> f64 {
        let draws = Draws::new(seed, Purpose::Resample);
        let bearing = |row: usize| TAU * row as f64 / 40.0;
        let error = |row: usize| {
            let level_db = 3.0 * draws.normal((row / 40) as u64, 1, 0);
            let noise_db = 2.0 * draws.normal(row as u64, 0, 0);
            [level_db + noise_db + amplitude_db * libm::cos(bearing(row)), f64::NAN, f64::NAN]
        };
        let n = 40 * n_turns;
        let rows = Linearised { errors: (0..n).map(error).collect(), ..Linearised::default() };
        let passes = Passes {
            rows: (0..n_turns as u32).map(|turn| (40 * turn..40 * (turn + 1)).collect()).collect(),
            harmonic: (0..n)
                .map(|row| [libm::cos(bearing(row)), libm::sin(bearing(row))])
                .collect(),
        };
        p_value(&rows, &passes)
    }

    #[test]
    fn four_turns_show_a_pattern_whatever_their_levels_and_three_do_not() {
        assert!((1..=20).all(|seed| p_of(seed, 4, 2.0) < 0.005));
        assert!((p_of(1, 3, 2.0) - 1.0).abs() < f64::EPSILON);
    }

    #[test]
    fn of_turns_without_a_pattern_as_many_are_significant_as_stated() {
        let n_found = (1..=2000).filter(|&seed| p_of(seed, 4, 0.0) < 0.05).count();
        assert!((70..=130).contains(&n_found), "{n_found} of 2000");
    }
}
