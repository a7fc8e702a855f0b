//! Words and units of keys and columns such as `flock_speed_mps`, whose names end in their unit.

/// Units by the last part of a name.
const UNITS: [(&str, &str); 30] = [
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
];

/// The unit of a name, which is its last part after a `_`; `None`: it has none, or an unknown one.
#[must_use]
pub fn unit(name: &str) -> Option<&'static str> {
    let (_, end) = name.rsplit_once('_')?;
    UNITS.iter().find(|(suffix, _)| *suffix == end).map(|&(_, unit)| unit)
}

/// A name in words, without its unit: `flock speed` of `flock_speed_mps`.
#[must_use]
pub fn words(name: &str) -> String {
    let without = unit(name).and_then(|_| name.rsplit_once('_')).map_or(name, |(words, _)| words);
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
    }
}
