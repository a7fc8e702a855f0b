//! Round numbers along an axis.

/// The least of 1, 2, 5 times a power of ten that is not below `step`.
#[must_use]
pub fn round_step(step: f64) -> f64 {
    let power = libm::pow(10.0, libm::floor(libm::log10(step)));
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|digit| digit * power)
        .find(|&round| step <= round * (1.0 + 1e-9))
        .unwrap_or(10.0 * power)
}

/// The multiples of `step` from `min` to `max`, in ascending order.
#[must_use]
pub fn ticks(min: f64, max: f64, step: f64) -> Vec<f64> {
    let first = libm::ceil(min / step - 1e-9);
    let last = libm::floor(max / step + 1e-9);
    (0..=(last - first).max(0.0) as usize).map(|i| (first + i as f64) * step).collect()
}

/// The products of these digits and powers of ten from `min` to `max`, both greater than 0, in ascending order.
///
/// * `digits`: ascending, from 1 to below 10.
#[must_use]
pub fn decades(min: f64, max: f64, digits: &[f64]) -> Vec<f64> {
    let power = |value: f64| libm::floor(libm::log10(value) + 1e-9) as i32;
    let all = (power(min)..=power(max)).flat_map(|power| {
        digits.iter().map(move |digit| digit * libm::pow(10.0, f64::from(power)))
    });
    all.filter(|tick| min * (1.0 - 1e-9) <= *tick && *tick <= max * (1.0 + 1e-9)).collect()
}

/// A multiple of `step`, with the decimals that tell it from its neighbours, and with U+2212 for a minus. `-0` is written `0`.
/// With a step below 10⁻⁶ it has an exponent, if that is shorter.
#[must_use]
pub fn tick_label(tick: f64, step: f64) -> String {
    let power_of_step = libm::floor(libm::log10(step) + 1e-9);
    let tick = if tick.abs() < 1e-9 * step { 0.0 } else { tick };
    let decimals = (-power_of_step).clamp(0.0, MOST_DECIMALS) as usize;
    let plain = format!("{tick:.decimals$}").replace('-', "−");
    if -6.0 <= power_of_step {
        return plain;
    }
    if tick == 0.0 {
        return "0".to_owned();
    }
    let power = libm::floor(libm::log10(tick.abs()) + 1e-9);
    let digits = (power - power_of_step).clamp(0.0, MOST_DECIMALS) as usize;
    let short = format!("{tick:.digits$e}").replace('-', "−");
    if short.len() < plain.len() { short } else { plain }
}

/// Most digits after the point: more than a number has.
const MOST_DECIMALS: f64 = 17.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_1_2_or_5_times_a_power_of_ten() {
        for (step, expected) in [(0.03, 0.05), (1.0, 1.0), (1.1, 2.0), (23.0, 50.0), (70.0, 100.0)]
        {
            assert!((round_step(step) / expected - 1.0).abs() < 1e-12, "{step}");
        }
    }

    #[test]
    fn ticks_of_ratios_are_round_within_each_power_of_ten() {
        assert_eq!(decades(1.0, 100.0, &[1.0, 2.0, 5.0]), [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0]);
        assert_eq!(decades(0.03, 20.0, &[1.0]), [0.1, 1.0, 10.0]);
        assert!(decades(2.1, 4.9, &[1.0, 5.0]).is_empty());
    }

    #[test]
    fn labels_have_the_decimals_of_their_step() {
        assert_eq!(ticks(-3.0, 3.0, 2.0), [-2.0, 0.0, 2.0]);
        assert_eq!(tick_label(-0.0, 0.2), "0.0");
        assert_eq!(tick_label(-20.0, 20.0), "−20");
        assert_eq!(tick_label(0.15, 0.05), "0.15");
        let small = [-2e-9, 0.0, 1.5e-8].map(|tick| tick_label(tick, 5e-10));
        assert_eq!(small, ["−2.0e−9", "0", "1.50e−8"]);
        assert_eq!(tick_label(1.000_000_02, 1e-8), "1.00000002");
    }
}
