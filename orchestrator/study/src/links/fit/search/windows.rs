//! The span of time in which a hidden obstacle explains most: a truck that came and went.

use super::LinkPath;
use super::ObstacleShape;
use super::shapes_of;
use crate::links::likelihood::RowLikelihood;
use crate::links::rows::ModelledLinks;

/// Parts of equally many rows into which the time is cut first …
const PARTS: usize = 12;
/// … and then, for the place that explains most.
const FINE_PARTS: usize = 120;

/// A span of time in which an obstacle may have stood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// When it came (s); none: it was there from the beginning.
    pub from_s: Option<f64>,
    /// When it went (s); none: it was there to the end.
    pub until_s: Option<f64>,
    /// What it gains in that time (nats, by the score test).
    pub gain: f64,
    /// What the obstacle that gains most all the time gains (nats).
    pub always: f64,
}

/// A row on its way, and when it was measured.
struct Crossing {
    way: LinkPath,
    time_s: f64,
}

/// Sums of slopes and weights of the rows that an obstacle obstructs, by parts of equally many rows.
fn sums<const N: usize>(crossings: &[Crossing], shape: &ObstacleShape) -> [[f64; 2]; N] {
    let mut sums = [[0.0; 2]; N];
    let obstructed = crossings.iter().enumerate().filter(|(_, one)| shape.is_crossed(&one.way));
    for (index, one) in obstructed {
        let sum = &mut sums[index * N / crossings.len()];
        *sum = [sum[0] + one.way.slope, sum[1] + one.way.weight];
    }
    sums
}

/// The span of time in which an obstacle at the best place gains most. None where times are unknown.
#[must_use]
pub fn window(
    rows: &ModelledLinks,
    train: &[u32],
    likelihoods: &[RowLikelihood],
) -> Option<Window> {
    let plane = |at: [f64; 3]| [at[0], at[1]];
    let crossing = |(&row, likelihood): (&u32, &RowLikelihood)| {
        let (tx, rx) = rows.ends(row as usize);
        let way = LinkPath {
            from_m: plane(tx.position_m),
            to_m: plane(rx.position_m),
            slope: likelihood.over_level,
            weight: likelihood.weight,
        };
        Crossing { way, time_s: rows.links.rows[row as usize].time_s }
    };
    let mut crossings: Vec<Crossing> = train.iter().zip(likelihoods).map(crossing).collect();
    // With fewer rows than parts some part would be empty.
    if crossings.len() < FINE_PARTS || crossings.iter().any(|one| !one.time_s.is_finite()) {
        return None;
    }
    crossings.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    let n = crossings.len();
    let places = crossings.iter().flat_map(|one| [one.way.from_m, one.way.to_m]);
    let mut always: f64 = 0.0;
    let mut best: Option<(f64, ObstacleShape)> = None;
    for shape in shapes_of(places) {
        let sums: [[f64; 2]; PARTS] = sums(&crossings, &shape);
        let (gain, ..) = best_span(&sums);
        always = always.max(loss_gain(total(&sums)));
        if best.as_ref().is_none_or(|(most, _)| *most < gain) {
            best = Some((gain, shape));
        }
    }
    let (_, shape) = best?;
    let (gain, first, end) = best_span(&sums::<FINE_PARTS>(&crossings, &shape));
    let start_s = |part: usize| crossings[(part * n).div_ceil(FINE_PARTS).min(n - 1)].time_s;
    Some(Window {
        from_s: (0 < first).then(|| start_s(first)),
        until_s: (end < FINE_PARTS).then(|| start_s(end)),
        gain,
        always,
    })
}

/// What a loss on rows with this sum of slopes and weights gains (nats, by the score test).
fn loss_gain([slope, weight]: [f64; 2]) -> f64 {
    if 0.0 < weight && slope < 0.0 { 0.5 * slope * slope / weight } else { 0.0 }
}

fn total(sums: &[[f64; 2]]) -> [f64; 2] {
    sums.iter().fold([0.0; 2], |sum, part| [sum[0] + part[0], sum[1] + part[1]])
}

/// The span of parts in which a loss gains most: its gain (nats), its first part, and the part after it.
fn best_span(sums: &[[f64; 2]]) -> (f64, usize, usize) {
    let mut best = (0.0, 0, sums.len());
    for first in 0..sums.len() {
        let (mut slope, mut weight) = (0.0, 0.0);
        for (end, part) in sums.iter().enumerate().skip(first) {
            (slope, weight) = (slope + part[0], weight + part[1]);
            let gain = loss_gain([slope, weight]);
            if best.0 < gain {
                best = (gain, first, end + 1);
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_span_with_losses_is_found_and_no_wider() {
        let mut sums = [[1.0, 10.0]; 12];
        for sum in &mut sums[4..7] {
            sum[0] = -30.0;
        }
        let (gain, first, end) = best_span(&sums);
        assert_eq!((first, end), (4, 7));
        // 90^2 / (2 · 30).
        assert!((gain - 135.0).abs() < 1e-9, "{gain}");
    }

    #[test]
    fn what_only_gains_power_is_no_obstacle() {
        assert_eq!(best_span(&[[1.0, 10.0]; 12]), (0.0, 0, 12));
        assert_eq!(loss_gain(total(&[[1.0, 10.0]; 12])), 0.0);
    }
}
