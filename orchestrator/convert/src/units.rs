//! Units: what a log writes, in the units of the tables of measurements.

/// A unit that a log may use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// Its name in mapping files.
    pub name: &'static str,
    /// Other spellings in the names of columns.
    aliases: &'static [&'static str],
    /// What it measures.
    dimension: Dimension,
    /// How many units of the table are one of these: `table value = log value × factor`.
    factor: f64,
    /// Whether a column whose name ends in `_` and this unit is in this unit.
    is_suffix: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Dimension {
    Time,
    Length,
    Angle,
    /// Angles of geographic coordinates, which stay in degrees.
    Geographic,
    Speed,
    AngularRate,
    Acceleration,
    Force,
    Power,
    Share,
}

const fn unit(
    name: &'static str,
    aliases: &'static [&'static str],
    dimension: Dimension,
    factor: f64,
    is_suffix: bool,
) -> Unit {
    Unit { name, aliases, dimension, factor, is_suffix }
}

const DEG: f64 = std::f64::consts::PI / 180.0;

/// All units.
pub const ALL: &[Unit] = &[
    unit("s", &["sec", "secs", "seconds"], Dimension::Time, 1.0, true),
    unit("ms", &["msec", "millis", "milliseconds"], Dimension::Time, 1e-3, true),
    unit("us", &["µs", "usec", "micros", "microseconds"], Dimension::Time, 1e-6, true),
    unit("ns", &["nsec", "nanos", "nanoseconds"], Dimension::Time, 1e-9, true),
    unit("min", &["minutes"], Dimension::Time, 60.0, false),
    unit("h", &["hours"], Dimension::Time, 3600.0, false),
    unit("m", &["meters", "metres"], Dimension::Length, 1.0, true),
    unit("cm", &[], Dimension::Length, 1e-2, true),
    unit("mm", &[], Dimension::Length, 1e-3, true),
    unit("km", &[], Dimension::Length, 1e3, true),
    unit("ft", &["feet"], Dimension::Length, 0.3048, true),
    unit("rad", &["radians"], Dimension::Angle, 1.0, true),
    unit("deg", &["degrees", "°"], Dimension::Angle, DEG, true),
    unit("mps", &["m/s"], Dimension::Speed, 1.0, true),
    unit("cmps", &["cm/s"], Dimension::Speed, 1e-2, true),
    unit("kmh", &["km/h", "kph"], Dimension::Speed, 1.0 / 3.6, true),
    unit("mph", &[], Dimension::Speed, 0.44704, true),
    unit("knots", &["kn", "kt"], Dimension::Speed, 1852.0 / 3600.0, true),
    unit("radps", &["rad/s"], Dimension::AngularRate, 1.0, true),
    unit("degps", &["deg/s", "°/s", "dps"], Dimension::AngularRate, DEG, true),
    unit("mps2", &["m/s2", "m/s^2", "m/s²"], Dimension::Acceleration, 1.0, true),
    // Standard gravity: CGPM 1901.
    unit("g", &[], Dimension::Acceleration, 9.806_65, false),
    unit("n", &["newton", "newtons"], Dimension::Force, 1.0, false),
    unit("kgf", &[], Dimension::Force, 9.806_65, true),
    unit("dbm", &[], Dimension::Power, 1.0, true),
    unit("-dbm", &[], Dimension::Power, -1.0, false),
    unit("percent", &["%", "pct"], Dimension::Share, 1e-2, true),
];

impl Unit {
    /// The unit of a name as mapping files write it, or as column names do.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        let name = name.trim().to_lowercase();
        ALL.iter().find(|unit| unit.name == name || unit.aliases.contains(&&*name))
    }

    /// The number and the unit of a text such as `-70 dBm`, if the unit is known.
    #[must_use]
    pub fn of_value(text: &str) -> Option<(f64, &'static Self)> {
        let end = text.find(|c: char| c.is_alphabetic() || c == '°' || c == '%')?;
        // The letter of an exponent is none of a unit.
        let number = text[..end].trim().parse::<f64>().ok().filter(|number| number.is_finite())?;
        Self::named(&text[end..]).map(|unit| (number, unit))
    }

    /// The unit that the name of a log's column states: `speed_kmh`, `yaw [deg]`, `t (ms)`, `ns`.
    #[must_use]
    pub fn of_column(name: &str) -> Option<&'static Self> {
        let name = name.trim();
        for (open, close) in [('[', ']'), ('(', ')')] {
            if let Some((_, unit)) = name.strip_suffix(close).and_then(|n| n.rsplit_once(open)) {
                return Self::named(unit);
            }
        }
        let (_, suffix) = name.rsplit_once(['_', '.', ' ']).unwrap_or(("", name));
        Self::named(suffix).filter(|unit| unit.is_suffix)
    }

    /// Whether a column of a table can be computed from values in this unit.
    #[must_use]
    pub fn fits(&self, target: &str) -> bool {
        match dimension_of(target) {
            Some(Dimension::Geographic) => self.dimension == Dimension::Angle,
            Some(dimension) => self.dimension == dimension,
            // A covariate without a unit in its name takes any.
            None => true,
        }
    }

    /// By what values in this unit are multiplied to become those of the column `target`.
    #[must_use]
    pub fn factor(&self, target: &str) -> f64 {
        match dimension_of(target) {
            Some(Dimension::Geographic) => self.factor / DEG,
            Some(_) => self.factor,
            None => 1.0,
        }
    }

    /// Nanoseconds of one unit of time.
    #[must_use]
    pub fn nanoseconds(&self) -> Option<i128> {
        (self.dimension == Dimension::Time).then(|| (self.factor * 1e9).round() as i128)
    }
}

/// What a column of a table measures, by its name.
fn dimension_of(target: &str) -> Option<Dimension> {
    if target == "pdr" {
        return Some(Dimension::Share);
    }
    if target.ends_with("latitude_deg") || target.ends_with("longitude_deg") {
        return Some(Dimension::Geographic);
    }
    // Of other columns the ending may be a number of something.
    if target == "cmd_thrust_n" {
        return Some(Dimension::Force);
    }
    let (_, suffix) = target.rsplit_once('_')?;
    match suffix {
        "s" => Some(Dimension::Time),
        "m" => Some(Dimension::Length),
        "rad" => Some(Dimension::Angle),
        "mps" => Some(Dimension::Speed),
        "radps" => Some(Dimension::AngularRate),
        "mps2" => Some(Dimension::Acceleration),
        "dbm" => Some(Dimension::Power),
        _ => None,
    }
}

/// Names of the units that a column of a table can be computed from.
#[must_use]
pub fn allowed(target: &str) -> String {
    let names: Vec<&str> =
        ALL.iter().filter(|unit| unit.fits(target)).map(|unit| unit.name).collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_a_column_states_its_unit() {
        for (name, expected) in [
            ("speed_kmh", Some("kmh")),
            ("yaw [deg]", Some("deg")),
            ("Speed (km/h)", Some("kmh")),
            ("ns", Some("ns")),
            ("header.stamp.secs", Some("s")),
            ("rssi_min", None),
            ("V", None),
            ("x", None),
        ] {
            assert_eq!(Unit::of_column(name).map(|unit| unit.name), expected, "{name}");
        }
    }

    #[test]
    fn values_become_those_of_the_table() {
        let factor = |unit: &str, target: &str| Unit::named(unit).unwrap().factor(target);
        assert!((36.0 * factor("km/h", "cmd_speed_mps") - 10.0).abs() < 1e-12);
        assert!((180.0 * factor("deg", "heading_rad") - std::f64::consts::PI).abs() < 1e-12);
        assert!((factor("deg", "latitude_deg") - 1.0).abs() < 1e-15);
        assert!((84.0 * factor("-dBm", "rssi_dbm") + 84.0).abs() < 1e-12);
        assert!(!Unit::named("kmh").unwrap().fits("heading_rad"));
        assert_eq!(allowed("heading_rad"), "rad, deg");
        assert!((0.5 * factor("g", "cmd_az_mps2") - 4.903_325).abs() < 1e-12);
        assert!((2.0 * factor("kgf", "cmd_thrust_n") - 19.6133).abs() < 1e-12);
        assert!(!Unit::named("N").unwrap().fits("cmd_ax_mps2"));
        assert_eq!(allowed("cmd_thrust_n"), "n, kgf");
    }
}
