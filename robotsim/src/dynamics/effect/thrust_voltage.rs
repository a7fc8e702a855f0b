//! Rotors on a battery that runs down.

use super::{Effect, Entry, Situation};
use proto::config::Section;
use proto::effect::{Catalogued, Need};

/// The column of measurements that says the voltage of the battery (V).
const COLUMN: &str = "voltage_v";

/// `kind = "thrust-voltage"`.
pub(super) const ENTRY: Entry = Entry::of::<ThrustVoltage>();

/// The thrust falls with the voltage of the battery.
///
/// # Mechanism
///
/// Motors that are commanded by a duty cycle turn slower at a lower voltage, and thrust falls with the square of their speed.
///
/// # Equation
///
/// ```text
/// a' = gain (a + g e_z) - g e_z of a quadrotor, gain = (voltage_v / reference_v)^exponent
/// ```
///
/// # Source
///
/// Speed of a DC motor in proportion to its mean voltage, thrust k omega^2: R. Mahony, V. Kumar and P. Corke, Multirotor aerial
/// vehicles, IEEE Robotics and Automation Magazine 19 (2012) 20, eq. 5. Measured exponents lie below 2, since currents fall, too.
///
/// # Validity
///
/// Where a column voltage_v says the voltage: in comparisons and fits, not in a run. Elsewhere it does nothing.
///
/// # Trace
///
/// As thrust-scale, growing as the battery runs down.
#[derive(Clone, Debug, PartialEq, Catalogued, Section)]
#[effect(
    name = "thrust-voltage",
    needs = &[Need::ThrustCommands, Need::Column(COLUMN)],
    example = "exponent = 1.5\nreference_v = 3.9\n",
    generalises = &["thrust-scale"],
)]
struct ThrustVoltage {
    /// With which power of the voltage the thrust falls.
    #[key(range = -10.0..=10.0)]
    #[fit(
        unit = "1",
        starts = [1.0],
        step = 0.01,
        null = 0.0,
        plausible = 0.1..=4.0,
        source = "thrust with the square of the speed, and speed at most about with the voltage",
    )]
    exponent: f64,
    /// The voltage at which thrust is what is commanded (V).
    #[key(above = 0.0, most = 1e4)]
    #[fit(unit = "V", range = 0.1..=1e3, starts = [3.8, 7.6, 11.4, 15.2, 22.8, 45.6], step = 0.01)]
    reference_v: f64,
}

impl Effect for ThrustVoltage {
    fn thrust_gain(&self, at: &Situation<'_>) -> f64 {
        let voltage_v = at.surroundings.columns.value(COLUMN).filter(|voltage_v| 0.0 < *voltage_v);
        voltage_v.map_or(1.0, |voltage_v| libm::pow(voltage_v / self.reference_v, self.exponent))
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;
    use super::COLUMN;
    use crate::dynamics::GRAVITY_MPS2;
    use crate::dynamics::surroundings::{Columns, Surroundings};

    #[test]
    fn a_battery_at_nine_tenths_gives_four_fifths_of_the_thrust() {
        let physics = physics(
            "kind = 'quadrotor'\n[[effect]]\nkind = 'thrust-voltage'\nexponent = 2.0\nreference_v = 4.0",
        );
        let fallen = |voltages_v: Vec<f64>| {
            let columns = [(COLUMN.to_owned(), voltages_v)];
            let columns = Columns { all: &columns, row: 0 };
            let surroundings = Surroundings { columns, ..Surroundings::default() };
            drive_in(&physics, [0.0; 3], 1.0, &surroundings).drive[2]
        };
        assert!((fallen(vec![3.6]) + 0.19 * GRAVITY_MPS2).abs() < 1e-12);
        assert_eq!([fallen(vec![4.0]), fallen(vec![f64::NAN]), fallen(Vec::new())], [0.0; 3]);
    }
}
