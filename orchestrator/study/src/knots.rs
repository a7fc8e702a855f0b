//! Knots of smooth curves, between which these are linear.

use numbers::statistics::nth_quantile;

/// Knots at quantiles of sorted values, at most `n` of them, each once. None where there are no values.
#[must_use]
pub fn at_quantiles(sorted: &[f64], n: usize) -> Vec<f64> {
    if sorted.is_empty() {
        return Vec::new();
    }
    let mut knots: Vec<f64> = (0..n).map(|k| nth_quantile(sorted, k, n - 1)).collect();
    knots.dedup();
    knots
}

/// The share of each knot in a curve at `x`: two neighbours, linear between them. Beyond the ends the curve stays level.
#[must_use]
pub fn shares(knots: &[f64], x: f64) -> [(usize, f64); 2] {
    let last = knots.len() - 1;
    if x <= knots[0] {
        return [(0, 1.0), (0, 0.0)];
    }
    if knots[last] <= x {
        return [(last, 1.0), (last, 0.0)];
    }
    let above = knots.partition_point(|&knot| knot <= x);
    let part = (x - knots[above - 1]) / (knots[above] - knots[above - 1]);
    [(above - 1, 1.0 - part), (above, part)]
}
