//! How well a campaign could show its causes to somebody who knows all about it but whether they act.
//!
//! A cause changes the expected measurements by a known signal. A rival that is linear in its parameters can mimic the part of
//! the signal in the span of its columns; half the squared norm of the rest, over the variance of the noise, is the expected
//! log likelihood ratio between the two (nats).

use super::truth::{Cause, Truth};

/// From this on a cause is found with near certainty: a t value of 7, where 4 suffices after correction for 40 candidates.
pub(super) const DETECTABLE_NATS: f64 = 25.0;

/// Below this two models are indistinguishable: a t value of 2.4.
pub(super) const TIED_NATS: f64 = 3.0;

/// Share of the squared error of noise below which a cause need not be named, however many rows show it.
const WORTH: f64 = 0.01;

/// Information that obliges a diagnosis: none beyond doubt of what is too small to matter.
fn obliging(nats: f64, n_rows: usize) -> f64 {
    let is_small = 2.0 * nats < WORTH * n_rows as f64;
    if is_small { nats.min(DETECTABLE_NATS - 1.0) } else { nats }
}

/// Another explanation, by the name of its effect, as the changes of the measurements that its parameters can make.
pub(super) struct Rival {
    pub(super) name: &'static str,
    pub(super) columns: Vec<Vec<f64>>,
}

impl Rival {
    pub(super) fn new(name: &'static str, columns: Vec<Vec<f64>>) -> Self {
        Self { name, columns }
    }
}

/// Half the squared norm of what columns leave of a signal, in units of the noise (nats).
pub(super) fn nats_beyond<'a>(
    signal: &[f64],
    columns: impl IntoIterator<Item = &'a Vec<f64>>,
    noise_sd: f64,
) -> f64 {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let reduced = |vector: &[f64], basis: &[Vec<f64>]| {
        let mut left = vector.to_vec();
        // Gram and Schmidt, twice for the rounding errors.
        for direction in basis.iter().chain(basis) {
            let along = dot(&left, direction);
            left.iter_mut().zip(direction).for_each(|(left, d)| *left -= along * d);
        }
        left
    };
    for column in columns {
        let mut left = reduced(column, &basis);
        let norm = dot(&left, &left).sqrt();
        if 1e-9 * dot(column, column).sqrt() < norm {
            left.iter_mut().for_each(|value| *value /= norm);
            basis.push(left);
        }
    }
    let left = reduced(signal, &basis);
    0.5 * dot(&left, &left) / (noise_sd * noise_sd)
}

/// The truth of a campaign.
///
/// `hidden`: causes with their signals. `nuisance`: columns that every model fits, such as a constant. `rivals`: explanations that
/// the data may be unable to distinguish from one of the causes.
pub(super) fn truth(
    hidden: Vec<(Cause, Vec<f64>)>,
    nuisance: &[Vec<f64>],
    rivals: &[Rival],
    noise_sd: f64,
) -> Truth {
    let signals: Vec<Vec<f64>> = hidden.iter().map(|(_, signal)| signal.clone()).collect();
    let mut total = vec![0.0; signals.first().map_or(0, Vec::len)];
    for signal in &signals {
        total.iter_mut().zip(signal).for_each(|(total, value)| *total += value);
    }
    // The model as configured has no free constant.
    let nats = obliging(nats_beyond(&total, [], noise_sd), total.len());
    let causes = hidden.into_iter().enumerate().map(|(index, (mut cause, signal))| {
        let known = || {
            let others = signals.iter().enumerate().filter(move |(other, _)| *other != index);
            nuisance.iter().chain(others.map(|(_, other)| other))
        };
        let information = nats_beyond(&signal, known(), noise_sd) - cause.spent_nats;
        cause.nats = obliging(information, signal.len());
        if TIED_NATS < cause.nats {
            let tied = rivals.iter().filter(|rival| {
                let columns = known().chain(&rival.columns);
                nats_beyond(&signal, columns, noise_sd) < TIED_NATS
            });
            cause.ties.extend(tied.map(|rival| rival.name));
        }
        cause
    });
    Truth { causes: causes.collect(), nats, ..Truth::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_take_what_they_span_of_a_signal() {
        let signal = vec![1.0, 2.0, 3.0, 4.0];
        let ones = vec![1.0; 4];
        // Around their mean: 1.5² + 0.5² + 0.5² + 1.5² = 5, over 2 · 0.5².
        assert!((nats_beyond(&signal, [&ones], 0.5) - 10.0).abs() < 1e-9);
        let line = vec![-3.0, -1.0, 1.0, 3.0];
        assert!(nats_beyond(&signal, [&ones, &line, &ones], 0.5) < 1e-9);
    }

    #[test]
    fn what_is_small_against_the_noise_need_not_be_named() {
        assert!(obliging(59.0, 12_000) < DETECTABLE_NATS);
        assert!(DETECTABLE_NATS < obliging(61.0, 12_000));
    }

    #[test]
    fn a_rival_over_the_same_line_is_tied_and_one_over_another_is_not() {
        let n = 200;
        let line: Vec<f64> = (0..n).map(|k| f64::from(k) / 20.0).collect();
        let wave: Vec<f64> = (0..n).map(|k| (f64::from(k) / 5.0).sin()).collect();
        let rivals =
            [Rival::new("battery-sag", vec![line.clone()]), Rival::new("drift", vec![wave])];
        let cause = Cause::of("temperature");
        let truth = truth(vec![(cause, line)], &[vec![1.0; 200]], &rivals, 1.0);
        assert_eq!(truth.causes[0].ties, ["battery-sag"]);
        assert!(DETECTABLE_NATS < truth.causes[0].nats && DETECTABLE_NATS < truth.nats);
    }
}
