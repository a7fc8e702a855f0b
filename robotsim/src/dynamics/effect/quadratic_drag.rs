//! Resistance that grows with the square of the speed.

use super::{Drive, Effect, Entry, Shape, UNCHECKED, with_speed};
use proto::config::{Default, Field, Kind, Range, Variant, typed};
use proto::effect::{About, Fit, Level, Need, Parameter};
use serde::Deserialize;

/// `kind = "quadratic-drag"`.
pub(super) const ENTRY: Entry = Entry {
    variant: Variant {
        name: "quadratic-drag",
        doc: "Drag in proportion to the square of the speed.",
        fields: &[Field {
            key: "coefficient_per_m",
            doc: "q (1/m).",
            kind: Kind::Number(Range::closed(0.0, 1e3)),
            default: Default::Required,
        }],
    },
    about: About {
        mechanism: "Air drag grows with the square of the speed, so the steady speed falls short of the commanded speed, \
                    more so at high speed.",
        equation: "v + q v^2 = u",
        source: "Lord Rayleigh's drag equation; e.g. L. D. Landau and E. M. Lifshitz, Fluid Mechanics, § 45. The steady state of a drive with proportional speed control.",
        validity: "The steady state only; actuator-lag models the transient. Linear drag is aliased with slip.",
        trace: "An error along the motion, in proportion to the square of the speed.",
        needs: &[Need::VelocityCommands],
        example: "coefficient_per_m = 0.02\n",
    },
    fit: Fit {
        parameters: &[Parameter {
            key: "coefficient_per_m",
            unit: "1/m",
            min: 0.0,
            max: 100.0,
            starts: &[0.0, 0.003, 0.03, 0.3],
            step: 0.001,
        }],
        variants: &[],
        level: Level::Time,
        generalises: &[],
        ..Fit::PLAIN
    },
    check: UNCHECKED,
    build: |table| Some(Box::new(typed::<QuadraticDrag>(table))),
};

/// Air drag against a drive that controls its speed in proportion.
///
/// # Model
///
/// ```text
/// v + q v² = u        v = 2u / (1 + √(1 + 4 q u))
/// ```
///
/// u and v are speeds; the direction is kept. The steady state of a drive whose force grows with the missing speed against
/// Rayleigh's drag, which grows with the square: Landau and Lifshitz, Fluid Mechanics, § 45.
///
/// # Arguments
///
/// * `coefficient_per_m` q: drag per drive (1/m), not negative.
///
/// # Validity
///
/// The steady state only: how it is approached is `actuator-lag`'s. Still air: `wind` adds to the velocity and not to the
/// drag. Drag that grows linearly is `slip`. Not validated against hardware.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct QuadraticDrag {
    coefficient_per_m: f64,
}

impl Effect for QuadraticDrag {
    fn name(&self) -> &'static str {
        ENTRY.variant.name
    }

    fn shape(&self, shape: Shape, demand: Drive) -> Drive {
        // The positive root, in the form that is exact for small q, too.
        with_speed(shape, demand, |speed_mps| {
            2.0 * speed_mps / (1.0 + libm::sqrt(1.0 + 4.0 * self.coefficient_per_m * speed_mps))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;

    #[test]
    fn speed_and_drag_together_are_the_command() {
        let text = "[[effect]]\nkind = 'quadratic-drag'\ncoefficient_per_m = 0.1";
        // 10 + 0.1 × 10² = 20.
        assert_near(drive(text, [12.0, 0.0, -16.0], 1.0).position_m, [6.0, 0.0, -8.0]);
    }
}
