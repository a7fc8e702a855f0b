//! Effects that users write themselves.

use super::{Effect, Entry, Situation};
use crate::dynamics::norm;
use proto::config::{Choice, Problem, Section};
use proto::effect::Catalogued;
use proto::formula::{Bound, Keys as FormulaKeys, Written};

/// `kind = "formula"`.
pub(super) const ENTRY: Entry = Entry::new::<Keys>(
    |table, path, problems| {
        written(table, path, problems);
    },
    |table| {
        let expression = written(table, "", &mut Vec::new())?.bound(&NAMES);
        let Keys { target, limit_mps, .. } = Keys::read(table);
        Some(Box::new(Formula { expression, target, limit_mps }))
    },
);

fn written(table: &toml::Table, path: &str, problems: &mut Vec<Problem>) -> Option<Written> {
    Written::read(&Keys::read(table).formula, path, &NAMES.map(|(name, _)| name), problems)
}

/// A user-defined expression of covariates and named parameters, added to the velocity, or to the acceleration of bodies that keep theirs.
///
/// # Mechanism
///
/// For effects outside the catalogue: an expression of time, position, velocity, heading and any column of the measurements, with
/// named parameters.
///
/// # Equation
///
/// ```text
/// v = u + expression * direction, of bodies that keep their velocity a' = a + expression * direction
/// ```
///
/// # Source
///
/// The user's.
///
/// # Validity
///
/// As valid as the expression. It adds nothing if a name has no value or the result is not a number. Results are clipped to limit_mps.
/// Columns of measurements have values in comparisons and fits only; in a run, only names that describe the robot do.
///
/// # Trace
///
/// An error that depends on the covariates of the expression.
#[derive(Catalogued, Section)]
#[effect(
    name = "formula",
    makes = Formula,
    example = "expression = \"-a * max(speed_mps - onset_mps, 0)\"\ntarget = \"ahead\"\n\
               parameters.a = { start = 0.1, min = 0.0, max = 1.0 }\n\
               parameters.onset_mps = { start = 1.0, min = 0.0, max = 10.0 }\n",
)]
struct Keys {
    #[key(flatten)]
    formula: FormulaKeys,
    /// The direction in which the expression's value is added: to the velocity (m/s), or to the acceleration (m/s²) of bodies that keep
    /// their velocity.
    #[key(default = Target::Ahead)]
    target: Target,
    /// Limit of the expression's absolute value (m/s, or m/s²); larger values are clipped.
    #[key(range = 0.0..=1e3, default = 10.0)]
    limit_mps: f64,
}

/// Reads a number off a robot.
type Read = fn(&Situation<'_>) -> f64;

/// Names that every expression may use. Every other one is a column of measurements.
pub const NAMES: [(&str, Read); 9] = [
    ("time_s", |at| at.time_s),
    ("x_m", |at| at.position_m[0]),
    ("y_m", |at| at.position_m[1]),
    ("z_m", |at| at.position_m[2]),
    ("vx_mps", |at| at.velocity_mps[0]),
    ("vy_mps", |at| at.velocity_mps[1]),
    ("vz_mps", |at| at.velocity_mps[2]),
    ("speed_mps", |at| norm(at.velocity_mps)),
    ("heading_rad", |at| at.heading_rad),
];

/// In which direction the value of an expression is added.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
enum Target {
    /// The direction of motion; at rest, the heading.
    Ahead,
    /// At a right angle to the left of ahead.
    Left,
    /// +x.
    East,
    /// +y.
    North,
    /// +z.
    Up,
}

/// An expression of the user's, along a direction.
///
/// # Model
///
/// ```text
/// v = u + clamp(f(t, x, u, θ, …), −c, c) d
/// ```
///
/// f is the expression, and d the unit vector of its target: the way the robot moves (where it stands, the way it faces), a right
/// angle to the left of that, or an axis. The equation is the user's.
///
/// # Arguments
///
/// * `expression`, `parameters`, `columns`: f (m/s), in the names of [`NAMES`] and columns of measurements.
/// * `target`: d.
/// * `limit_mps` c: values beyond this (m/s) count as it, not negative.
///
/// # Validity
///
/// As far as the expression. Where a name has no value, or the result is not a number, nothing is added. Columns of measurements have
/// values in comparisons and fits; in a run only what describes the robot does.
#[derive(Clone, Debug)]
struct Formula {
    expression: Bound<Read>,
    target: Target,
    limit_mps: f64,
}

impl Formula {
    fn direction(&self, at: &Situation<'_>) -> [f64; 3] {
        let ahead = || {
            let speed_mps = norm(at.velocity_mps);
            if speed_mps < STANDING_MPS {
                let (sin, cos) = libm::sincos(at.heading_rad);
                [cos, sin, 0.0]
            } else {
                at.velocity_mps.map(|part| part / speed_mps)
            }
        };
        match self.target {
            Target::Ahead => ahead(),
            Target::Left => {
                let [x, y, _] = ahead();
                let length = libm::hypot(x, y);
                if length == 0.0 { [0.0; 3] } else { [-y / length, x / length, 0.0] }
            }
            Target::East => [1.0, 0.0, 0.0],
            Target::North => [0.0, 1.0, 0.0],
            Target::Up => [0.0, 0.0, 1.0],
        }
    }
}

/// Slower robots stand (m/s).
const STANDING_MPS: f64 = 1e-9;

impl Effect for Formula {
    fn drift_mps(&self, at: &Situation<'_>) -> [f64; 3] {
        let value = self
            .expression
            .value(|read| Some(read(at)), |column| at.surroundings.columns.value(column))
            .unwrap_or(0.0)
            .clamp(-self.limit_mps, self.limit_mps);
        self.direction(at).map(|part| value * part)
    }

    fn most_force_mps2(&self) -> f64 {
        self.limit_mps
    }

    fn drifts(&self) -> bool {
        true
    }

    fn varies_on_the_way(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::*;
    use crate::dynamics::surroundings::{Columns, Surroundings};

    #[test]
    fn what_is_written_is_added_along_its_direction() {
        // ẋ = 1 + 0.5 x from 0: x = 2 (e^(t / 2) − 1), steps of 10 ms by the midpoint rule.
        let text =
            "[[effect]]\nkind = 'formula'\nexpression = 'a * x_m'\nparameters.a = { value = 0.5 }";
        let end = drive(text, [1.0, 0.0, 0.0], 2.0).position_m;
        let exact = 2.0 * (1f64.exp() - 1.0);
        assert!((end[0] - exact).abs() < 2e-2 && end[1] == 0.0, "{end:?} {exact}");
        let text = "[[effect]]\nkind = 'formula'\ntarget = 'left'\nexpression = '0.25 * speed_mps'";
        assert_near(drive(text, [0.0, 2.0, 0.0], 1.0).position_m, [-0.5, 2.0, 0.0]);
        let text = "[[effect]]\nkind = 'formula'\ntarget = 'north'\nexpression = 'time_s * 20'";
        // The value is kept within ten metres per second: reached after half of the time.
        let end = drive(text, [0.0; 3], 1.0).position_m;
        assert!((end[1] - 7.5).abs() < 0.06, "{end:?}");
    }

    #[test]
    fn a_column_has_a_value_where_it_was_measured() {
        let physics = physics("[[effect]]\nkind = 'formula'\nexpression = '-0.1 * load_kg'");
        let columns = [("load_kg".to_owned(), vec![f64::NAN, 3.0])];
        let reached = |columns: Columns<'_>| {
            let surroundings = Surroundings { columns, ..Surroundings::default() };
            drive_in(&physics, [1.0, 0.0, 0.0], 1.0, &surroundings).position_m
        };
        assert_near(reached(Columns { all: &columns, row: 0 }), [1.0, 0.0, 0.0]);
        assert_near(reached(Columns { all: &columns, row: 1 }), [0.7, 0.0, 0.0]);
        assert_near(reached(Columns::default()), [1.0, 0.0, 0.0]);
    }
}
