//! Which discs of the plane robots cross slower or faster than the model says.

use super::{RobotFit, RobotModel};
use numbers::power::square;

/// Discs that are tried.
const N_TRIED: usize = 6;
/// Places of a window that are looked at: in a disc, or not.
const N_LOOKS: usize = 5;

impl RobotModel {
    /// Of these discs (centre, radius, scale) the ones that explain most of what a fit leaves along the motion, each with the scale
    /// that explains it best.
    pub(super) fn likely_discs(
        &self,
        parent: &RobotFit,
        discs: &[Vec<f64>],
        train: &[u32],
    ) -> Vec<Vec<f64>> {
        let Some(residuals) = self.residuals(parent, train) else { return Vec::new() };
        let samples = &self.tracks.robots.samples;
        let looks: Vec<[[f64; 2]; N_LOOKS]> = train
            .iter()
            .map(|&row| {
                let window = &self.tracks.windows[row as usize];
                let (start, end) = (window.start as usize, window.end as usize);
                std::array::from_fn(|k| {
                    let [x_m, y_m, _] =
                        samples[start + k * (end - start) / (N_LOOKS - 1)].position_m;
                    [x_m, y_m]
                })
            })
            .collect();
        let weights: Vec<f64> = residuals
            .iter()
            .map(|residual| {
                parent.density.weight(residual) / square(parent.density.sd_m(residual)[0])
            })
            .collect();
        let mut found: Vec<(f64, Vec<f64>)> = discs
            .iter()
            .filter_map(|disc| {
                let &[x_m, y_m, radius_m, _] = disc.as_slice() else { return None };
                let is_inside =
                    |[x, y]: &&[f64; 2]| square(x - x_m) + square(y - y_m) < radius_m * radius_m;
                let (mut error, mut square) = (0.0, 0.0);
                for ((looks, residual), weight) in looks.iter().zip(&residuals).zip(&weights) {
                    let inside = looks.iter().filter(is_inside).count() as f64 / N_LOOKS as f64;
                    let way_m = inside * residual.way_m;
                    error += weight * way_m * residual.parts_m[0];
                    square += weight * way_m * way_m;
                }
                let nats = 0.5 * error * error / square;
                let scale = (1.0 + error / square).max(0.0);
                // A disc that no window touches has a square of 0.
                nats.is_finite().then(|| (nats, vec![x_m, y_m, radius_m, scale]))
            })
            .collect();
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        found.into_iter().take(N_TRIED).map(|(_, disc)| disc).collect()
    }
}
