//! Recordings as replicates of a condition: whether a change is more than what recordings of one condition differ by.
//!
//! Each recording has an amplitude of its own of what changed. Their means in A and in B are compared by Welch's t test.

use super::contrast::{RUNS, Sides};
use super::welch::{WeightedMean, WelchTest, welch};
use crate::score_test::Total;
use study::Study;
use study::thresholds::FEWEST_REPLICATES;

/// Share of the information of all recordings that one has at least, to have an amplitude.
const LEAST_SHARE: f64 = 1e-6;

/// The recordings of two campaigns.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Recordings {
    /// The recording of each row, by number from 0.
    pub of_row: Vec<usize>,
    /// Whether each recording is of B.
    is_b: Vec<bool>,
}

impl Recordings {
    /// Those of a study.
    #[must_use]
    pub(super) fn of<S: Study>(study: &S, sides: &Sides) -> Self {
        let mut recordings = Self { of_row: vec![0; study.n_rows()], is_b: Vec::new() };
        let partitions = study.partitions();
        let groups = partitions.iter().filter(|partition| partition.key == Some(RUNS));
        for (number, group) in groups.flat_map(|partition| &partition.groups).enumerate() {
            recordings.is_b.push(sides.runs_b.contains(&group.id));
            for &row in &group.rows {
                recordings.of_row[row as usize] = number;
            }
        }
        recordings
    }

    /// How many there are of A and of B.
    #[must_use]
    pub(super) fn counts(&self) -> [usize; 2] {
        let n_b = self.is_b.iter().filter(|is_b| **is_b).count();
        [self.is_b.len() - n_b, n_b]
    }

    /// Whether each side has enough of them to tell how much recordings of one condition differ.
    #[must_use]
    pub(super) fn are_enough(&self) -> bool {
        self.counts().iter().all(|n| FEWEST_REPLICATES <= *n)
    }

    /// The difference of amplitudes between B and A. `totals`: of each recording. None where too few recordings tell something of it.
    #[must_use]
    pub(super) fn difference(&self, totals: &[Total]) -> Option<WelchTest> {
        let whole: f64 = totals.iter().map(|total| total.information.abs()).sum();
        let of_side = |side: bool| -> Vec<WeightedMean> {
            let of = totals.iter().zip(&self.is_b).filter(|(total, is_b)| {
                **is_b == side && LEAST_SHARE * whole < total.information.abs()
            });
            of.map(|(total, _)| WeightedMean { value: total.amplitude(), n: 1.0 }).collect()
        };
        welch(&of_side(true), &of_side(false), FEWEST_REPLICATES)
    }

    /// What all recordings of A, and all of B, tell together. `totals`: of each recording.
    #[must_use]
    pub(super) fn by_side(&self, totals: &[Total]) -> [Total; 2] {
        let mut sums = [Total::default(); 2];
        for (total, is_b) in totals.iter().zip(&self.is_b) {
            sums[usize::from(*is_b)].add(*total);
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recordings(n_a: usize, n_b: usize) -> Recordings {
        let is_b = (0..n_a + n_b).map(|number| n_a <= number).collect();
        Recordings { of_row: Vec::new(), is_b }
    }

    fn totals(amplitudes: &[f64]) -> Vec<Total> {
        let of = |amplitude: &f64| Total { slope: 50.0 * amplitude, information: 50.0 };
        amplitudes.iter().map(of).collect()
    }

    #[test]
    fn the_difference_of_recordings_is_welchs() {
        let difference = recordings(4, 4)
            .difference(&totals(&[1.0, 2.0, 3.0, 4.0, 11.0, 11.5, 12.0, 12.5]))
            .unwrap();
        assert!((difference.difference - 9.25).abs() < 1e-12);
        // Variances of the means: 5/3/4 and 5/12/4.
        assert!((difference.standard_error - (25.0_f64 / 48.0).sqrt()).abs() < 1e-12);
        let (a, b) = (5.0_f64 / 12.0, 5.0 / 48.0);
        let freedom = (a + b) * (a + b) / ((a * a + b * b) / 3.0);
        assert!((difference.freedom - freedom).abs() < 1e-9);
        // The incomplete beta function at 4.41 degrees of freedom, by its series: 1.2e-4.
        assert!((1e-4..1.4e-4).contains(&difference.two_sided()), "{}", difference.two_sided());
        assert!(1.9 * difference.standard_error < difference.half_width());
    }

    #[test]
    fn three_recordings_of_a_condition_are_too_few_and_so_are_four_of_which_one_tells_nothing() {
        assert!(recordings(4, 4).are_enough() && !recordings(3, 9).are_enough());
        let few = [1.0, 2.0, 3.0, 11.0, 12.0, 13.0, 14.0];
        assert_eq!(recordings(3, 4).difference(&totals(&few)), None);
        let mut silent = totals(&[1.0, 2.0, 3.0, 4.0, 11.0, 12.0, 13.0, 14.0]);
        silent[0] = Total { slope: 3.0, information: 0.0 };
        assert_eq!(recordings(4, 4).difference(&silent), None);
    }
}
