//! Places and ticks along an axis.

use crate::content::{Axis, Scale};
use numbers::ticks;

/// Ticks of an axis: where, and what stands there.
pub(crate) fn ticks(axis: &Axis, most: f64) -> Vec<(f64, String)> {
    let [low, high] = axis.range;
    match axis.scale {
        Scale::Category => (0..).map(f64::from).zip(axis.categories.iter().cloned()).collect(),
        Scale::Log => log_ticks([low, high], axis.is_share),
        Scale::Linear if !axis.ticks.is_empty() => {
            let label = |tick: f64| match axis.is_share {
                true => format!("{} %", numbers::format::shortest(100.0 * tick)),
                false => numbers::format::shortest(tick).replace('-', "−"),
            };
            axis.ticks.iter().map(|&tick| (tick, label(tick))).collect()
        }
        Scale::Linear => {
            // Shares are divided as per cent are.
            let (factor, unit) = if axis.is_share { (100.0, " %") } else { (1.0, "") };
            let step = ticks::round_step(factor * (high - low) / most);
            let label = |tick: f64| format!("{}{unit}", ticks::tick_label(tick, step));
            let all = ticks::ticks(factor * low, factor * high, step);
            all.into_iter().map(|tick| (tick / factor, label(tick))).collect()
        }
    }
}

/// Powers of ten; with fewer than two of these their twofold and fivefold as well, and failing these round numbers.
fn log_ticks([low, high]: [f64; 2], is_share: bool) -> Vec<(f64, String)> {
    let within = |tick: &f64| low * (1.0 - 1e-9) <= *tick && *tick <= high * (1.0 + 1e-9);
    let [first, last] = [low, high].map(|end| libm::floor(libm::log10(end)) as i32);
    let of_digits = |digits: &[f64]| -> Vec<f64> {
        let powers = (first..=last).map(|power| libm::pow(10.0, f64::from(power)));
        let all = powers.flat_map(|power| digits.iter().map(move |digit| digit * power));
        all.filter(within).collect()
    };
    let mut all = of_digits(&[1.0]);
    if all.len() < 2 {
        all = of_digits(&[1.0, 2.0, 5.0]);
    }
    if all.len() < 2 {
        all = ticks::ticks(low, high, ticks::round_step((high - low) / 3.0));
    }
    let label = |tick: f64| match is_share {
        true => {
            format!("{} %", numbers::format::shortest(numbers::format::rounded(100.0 * tick, 6)))
        }
        false => numbers::format::shortest(numbers::format::rounded(tick, 6)),
    };
    all.into_iter().map(|tick| (tick, label(tick))).collect()
}

/// The place of a value along an axis, from 0 at its lower end to 1.
pub(crate) fn place(axis: &Axis, value: f64) -> f64 {
    let [low, high] = axis.range;
    match axis.scale {
        Scale::Log => libm::log(value / low) / libm::log(high / low),
        Scale::Linear | Scale::Category => (value - low) / (high - low),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<String> {
        ticks(axis, 5.0).into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn labels_of_neighbours_differ() {
        for range in [[0.99996, 1.0], [1.0, 1.0], [0.0, 1e-7], [-3.0, 8.0], [1e6, 1e6 + 1.0]] {
            for is_share in [false, true] {
                let axis = Axis { is_share, ..Axis::linear("", range) };
                let labels = labels(&axis);
                assert!(2 <= labels.len() && labels.len() < 12, "{range:?}: {labels:?}");
                assert!(labels.windows(2).all(|pair| pair[0] != pair[1]), "{range:?}: {labels:?}");
            }
        }
    }

    #[test]
    fn a_log_axis_has_powers_of_ten_or_what_there_is_between_them() {
        let log = |range| Axis { scale: Scale::Log, ..Axis::linear("", range) };
        assert_eq!(labels(&log([0.01, 200.0])), ["0.01", "0.1", "1", "10", "100"]);
        assert_eq!(labels(&log([3.0, 70.0])), ["5", "10", "20", "50"]);
        assert_eq!(labels(&log([6.0, 9.0])), ["6", "7", "8", "9"]);
        assert!((place(&log([0.01, 100.0]), 1.0) - 0.5).abs() < 1e-12);
    }
}
