//! What a model says of rows that it has not seen, beside what was measured: as pictures need it.

use super::Study;
use numbers::normal::Z_90;

/// Predictions and measurements, a value per row. NaN where there is none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RowPredictions {
    /// Expected readings of received frames (dBm); of robots, the way along the predicted motion (m).
    pub predicted: Vec<f64>,
    /// What was measured of that.
    pub measured: Vec<f64>,
    /// Standard deviation of the prediction.
    pub sd: Vec<f64>,
    /// Measured less predicted across the motion (m), and its standard deviation; empty for links.
    pub across: Vec<[f64; 2]>,
    /// Measured less predicted heading (rad) at the end of each window; empty for links, NaN where the body does not turn.
    pub heading_rad: Vec<f64>,
    /// Mean level (dBm) at the reception curve; empty for robots.
    pub level: Vec<f64>,
    /// Predicted probability of reception; empty for robots.
    pub passes: Vec<f64>,
}

impl RowPredictions {
    /// Measured less predicted.
    #[must_use]
    pub fn residuals(&self) -> Vec<f64> {
        self.measured.iter().zip(&self.predicted).map(|(m, p)| m - p).collect()
    }

    /// Residuals in standard deviations, all components.
    #[must_use]
    pub fn scaled(&self) -> Vec<f64> {
        let along = self.residuals().into_iter().zip(&self.sd).map(|(residual, sd)| residual / sd);
        along.chain(self.across.iter().map(|[across, sd]| across / sd)).collect()
    }

    /// A row's residual in standard deviations.
    #[must_use]
    pub fn scaled_at(&self, row: usize) -> f64 {
        (self.measured[row] - self.predicted[row]) / self.sd[row]
    }

    /// A window's residual across the motion in standard deviations.
    #[must_use]
    pub fn scaled_across(&self, row: usize) -> f64 {
        let [across, sd] = self.across[row];
        across / sd
    }

    /// The share of measurements inside the predicted 90 % interval.
    #[must_use]
    pub fn coverage_90(&self) -> f64 {
        let known: Vec<f64> = self.scaled().into_iter().filter(|z| z.is_finite()).collect();
        known.iter().filter(|z| z.abs() <= Z_90).count() as f64 / known.len() as f64
    }

    /// Takes these rows from another view.
    pub fn take(&mut self, other: &Self, rows: &[u32]) {
        fn copy<T: Copy>(to: &mut [T], from: &[T], row: usize) {
            if let (Some(to), Some(from)) = (to.get_mut(row), from.get(row)) {
                *to = *from;
            }
        }
        for &row in rows {
            let row = row as usize;
            copy(&mut self.predicted, &other.predicted, row);
            copy(&mut self.measured, &other.measured, row);
            copy(&mut self.sd, &other.sd, row);
            copy(&mut self.across, &other.across, row);
            copy(&mut self.heading_rad, &other.heading_rad, row);
            copy(&mut self.level, &other.level, row);
            copy(&mut self.passes, &other.passes, row);
        }
    }
}

/// A study whose predictions can be looked at row by row.
pub trait Viewed: Study {
    /// All rows under a fit.
    fn view(&self, fit: &Self::Fit) -> RowPredictions;
}
