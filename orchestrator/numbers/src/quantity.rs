//! Words and units of keys and columns such as `flock_speed_mps`, whose names end in their unit.

/// Units by the end of a name.
const UNITS: [(&str, &str); 32] = [
    ("m", "m"),
    ("mm", "mm"),
    ("m2", "m²"),
    ("s", "s"),
    ("ms", "ms"),
    ("us", "µs"),
    ("ns", "ns"),
    ("h", "h"),
    ("years", "years"),
    ("c", "°C"),
    ("pct", "%"),
    ("db", "dB"),
    ("dbm", "dBm"),
    ("hz", "Hz"),
    ("mhz", "MHz"),
    ("rad", "rad"),
    ("radps", "rad/s"),
    ("deg", "°"),
    ("mps", "m/s"),
    ("mps2", "m/s²"),
    ("v", "V"),
    ("hpa", "hPa"),
    ("kg", "kg"),
    ("uc", "µC"),
    ("ua", "µA"),
    ("mah", "mAh"),
    ("bytes", "bytes"),
    ("ppm", "ppm"),
    ("ugm3", "µg/m³"),
    ("slots", "slots"),
    ("bytes_s", "bytes/s"),
    ("per_mote_hour", "1/h"),
];

/// The unit of a name, which is its end after a `_`; `None`: it has none, or an unknown one.
#[must_use]
pub fn unit(name: &str) -> Option<&'static str> {
    parts(name).map(|(_, unit)| unit)
}

/// A name without its unit, and the unit.
fn parts(name: &str) -> Option<(&str, &'static str)> {
    let ends = UNITS.iter().filter_map(|&(suffix, unit)| {
        Some((name.strip_suffix(suffix)?.strip_suffix('_')?, unit))
            .filter(|(rest, _)| !rest.is_empty())
    });
    // Of `bytes_s` and `s`, the longer.
    ends.min_by_key(|(rest, _)| rest.len())
}

/// A name in words, without its unit: `flock speed` of `flock_speed_mps`.
#[must_use]
pub fn words(name: &str) -> String {
    let without = parts(name).map_or(name, |(words, _)| words);
    without.replace(['_', '-'], " ")
}

/// Words and unit, as an axis shows them: `flock speed (m/s)`.
#[must_use]
pub fn label(name: &str) -> String {
    with_unit(&words(name), unit(name))
}

/// Words with a unit in parentheses, if there is one.
#[must_use]
pub fn with_unit(words: &str, unit: Option<&str>) -> String {
    match unit.filter(|unit| !["", "1"].contains(unit)) {
        Some(unit) => format!("{words} ({unit})"),
        None => words.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_ends_in_its_unit() {
        assert_eq!(label("flock_speed_mps"), "flock speed (m/s)");
        assert_eq!(label("temperature_c"), "temperature (°C)");
        assert_eq!(label("polarisation"), "polarisation");
        assert_eq!(label("channel"), "channel");
        // A name that is a unit is a name.
        assert_eq!(label("s"), "s");
        assert_eq!(label("line_rms_m"), "line rms (m)");
        assert_eq!(label("mean_goodput_bytes_s"), "mean goodput (bytes/s)");
        assert_eq!(label("churn_per_mote_hour"), "churn (1/h)");
    }
}
