//! How robots are commanded: which columns say it, and what they say.

use crate::table::DataTable;
use proto::config::Range;
use robotsim::dynamics::{Drive, GRAVITY_MPS2, Shape, thrust_direction, wrapped};
use std::f64::consts::PI;

/// Columns that all robot samples have.
const COMMON: [&str; 4] = ["time_s", "agent", "x_m", "y_m"];
/// The forms of commands that exist, for the error about a file that has none.
const FORMS: &str = "cmd_vx_mps and cmd_vy_mps (or cmd_speed_mps with cmd_yaw_rate_radps or cmd_steer_rad; \
                     or cmd_ax_mps2 and cmd_ay_mps2; or cmd_thrust_n with cmd_roll_rad, cmd_pitch_rad and cmd_yaw_rad)";
/// Plausible thrusts (N).
const THRUST_N: Range = Range::closed(0.0, 1e6);
/// Angles beyond these are degrees (rad), yaw rates degrees per second (rad/s).
const GREATEST: [(&str, f64, &str); 5] = [
    ("cmd_steer_rad", 1.5, "steering angles must be in rad, not degrees"),
    ("cmd_yaw_rate_radps", 30.0, "yaw rates must be in rad/s, not degrees per second"),
    ("cmd_roll_rad", PI, "roll must be in rad, not degrees"),
    ("cmd_pitch_rad", PI, "pitch must be in rad, not degrees"),
    // Some turns, of yaw that is not brought back into a circle.
    ("cmd_yaw_rad", 50.0, "yaw must be in rad, not degrees"),
];
/// Vertical accelerations whose median is nearer to gravity than this share of it include gravity.
const LIKE_GRAVITY: f64 = 0.2;

/// How the robots of a file are commanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommandKind {
    /// By speed and yaw rate.
    Unicycle,
    /// By speed and steering angle.
    Car,
    /// By a velocity in space.
    Velocity,
    /// By an acceleration in space.
    Acceleration,
    /// By the size of the thrust and the attitude.
    Thrust,
}

impl CommandKind {
    /// All kinds. A file that has the columns of several is of the first of them.
    pub const ALL: [Self; 5] =
        [Self::Unicycle, Self::Car, Self::Velocity, Self::Acceleration, Self::Thrust];

    /// How robots are commanded in a table of robot samples.
    ///
    /// # Errors
    ///
    /// The columns it lacks.
    pub fn of_table(table: &DataTable) -> Result<Self, Vec<String>> {
        let lacks = |name: &&str| table.column(name).is_none();
        let mut lacking: Vec<String> =
            COMMON.into_iter().filter(lacks).map(str::to_owned).collect();
        let kind = Self::ALL.into_iter().find(|kind| !kind.columns().iter().any(&lacks));
        if kind.is_none() {
            lacking.push(FORMS.to_owned());
        }
        if kind.is_some_and(|kind| kind.shape().is_turning()) && lacks(&"heading_rad") {
            lacking.push("heading_rad (required with commands of speed)".to_owned());
        }
        match kind {
            Some(kind) if lacking.is_empty() => Ok(kind),
            _ => Err(lacking),
        }
    }

    /// The columns without which there is no such command.
    #[must_use]
    pub fn columns(self) -> &'static [&'static str] {
        match self {
            Self::Unicycle => &["cmd_speed_mps", "cmd_yaw_rate_radps"],
            Self::Car => &["cmd_speed_mps", "cmd_steer_rad"],
            Self::Velocity => &["cmd_vx_mps", "cmd_vy_mps"],
            Self::Acceleration => &["cmd_ax_mps2", "cmd_ay_mps2"],
            Self::Thrust => &["cmd_thrust_n", "cmd_roll_rad", "cmd_pitch_rad", "cmd_yaw_rad"],
        }
    }

    /// What bodies of the simulator are so commanded.
    #[must_use]
    pub fn shape(self) -> Shape {
        match self {
            Self::Unicycle => Shape::Unicycle,
            Self::Car => Shape::Car,
            Self::Velocity | Self::Acceleration | Self::Thrust => Shape::Velocity,
        }
    }

    /// Whether commands change the velocity of a robot, which keeps it otherwise.
    #[must_use]
    pub fn is_inertial(self) -> bool {
        matches!(self, Self::Acceleration | Self::Thrust)
    }

    /// Values of `robotsim.dynamics.kind` that take such commands, the plainest first.
    #[must_use]
    pub fn bodies(self) -> &'static [&'static str] {
        match self {
            Self::Unicycle => &["unicycle"],
            Self::Car => &["car"],
            Self::Velocity => &["point-mass"],
            Self::Acceleration => &["double-integrator", "quadrotor"],
            Self::Thrust => &["quadrotor"],
        }
    }

    /// `velocities`, `speed and yaw rate`, …
    #[must_use]
    pub fn describe(self) -> &'static str {
        match self {
            Self::Unicycle => "speed and yaw rate",
            Self::Car => "speed and steering",
            Self::Velocity => "velocities",
            Self::Acceleration => "accelerations",
            Self::Thrust => "thrust and attitude",
        }
    }

    /// The command of a row. Of [`CommandKind::Thrust`] it is the thrust as a vector (N, east, north, up). What moves a robot
    /// vertically may be absent.
    pub(super) fn command(self, cell: impl Fn(&str) -> f64) -> Drive {
        let third = |name: &str| Some(cell(name)).filter(|number| !number.is_nan()).unwrap_or(0.0);
        match self {
            Self::Unicycle => [cell("cmd_speed_mps"), cell("cmd_yaw_rate_radps"), 0.0],
            Self::Car => [cell("cmd_speed_mps"), cell("cmd_steer_rad"), 0.0],
            Self::Velocity => [cell("cmd_vx_mps"), cell("cmd_vy_mps"), third("cmd_vz_mps")],
            Self::Acceleration => [cell("cmd_ax_mps2"), cell("cmd_ay_mps2"), third("cmd_az_mps2")],
            Self::Thrust => {
                let angles_rad = ["cmd_roll_rad", "cmd_pitch_rad", "cmd_yaw_rad"].map(&cell);
                thrust_direction(angles_rad).map(|part| cell("cmd_thrust_n") * part)
            }
        }
    }

    /// Where a robot faces (rad): measured, or as its attitude is commanded. NaN where unknown.
    pub(super) fn heading_rad(self, cell: impl Fn(&str) -> f64) -> f64 {
        let measured_rad = cell("heading_rad");
        if self == Self::Thrust && measured_rad.is_nan() {
            wrapped(cell("cmd_yaw_rad"))
        } else {
            measured_rad
        }
    }

    /// Why the command of a row cannot be one.
    pub(super) fn refusal(self, cell: impl Fn(&str) -> f64) -> Option<String> {
        (self == Self::Thrust && !THRUST_N.contains(cell("cmd_thrust_n")))
            .then(|| format!("cmd_thrust_n is not {}", THRUST_N.describe()))
    }

    /// Refuses a file whose angles are degrees, or says what is odd about its commands.
    pub(super) fn check(self, table: &DataTable) -> Result<Vec<String>, String> {
        let known = |name: &str| {
            let column = table.column(name).unwrap_or_default().iter().copied();
            column.filter(|value| value.is_finite()).collect::<Vec<f64>>()
        };
        let greatest = |name: &str| known(name).into_iter().fold(0.0f64, |m, v| m.max(v.abs()));
        for (name, limit, unit) in GREATEST {
            if self.columns().contains(&name) && limit < greatest(name) {
                return Err(format!("{name} reaches {}; {unit}", greatest(name)));
            }
        }
        let mut warnings = Vec::new();
        let others = Self::ALL.into_iter().filter(|&other| other != self);
        for other in others.filter(|kind| kind.columns().iter().all(|c| table.column(c).is_some()))
        {
            if other.columns().iter().any(|column| !self.columns().contains(column)) {
                warnings.push(format!(
                    "the file has commands of {} and of {}; those of {} are used. Remove {} to use the others",
                    self.describe(),
                    other.describe(),
                    self.describe(),
                    self.columns().join(", ")
                ));
            }
        }
        if self == Self::Acceleration {
            let mut vertical = known("cmd_az_mps2");
            vertical.sort_by(f64::total_cmp);
            let median_mps2 = vertical.get(vertical.len() / 2).copied().unwrap_or(0.0);
            if (median_mps2.abs() - GRAVITY_MPS2).abs() < LIKE_GRAVITY * GRAVITY_MPS2 {
                warnings.push(format!(
                    "cmd_az_mps2 is {median_mps2:.2} in the median. Check that it is the acceleration of the robot, which is 0 at \
                     hover, and not that of a sensor, which includes gravity"
                ));
            }
        }
        Ok(warnings)
    }
}

#[cfg(test)]
mod tests {
    use super::super::read;
    use super::*;
    use std::fmt::Write as _;
    use std::path::Path;

    /// A robot that goes east at 1 m/s, with commands of thrust: thrust (N), roll, pitch and yaw (rad).
    fn flown(command: [f64; 4]) -> DataTable {
        let mut text =
            "time_s,agent,x_m,y_m,z_m,cmd_thrust_n,cmd_roll_rad,cmd_pitch_rad,cmd_yaw_rad\n"
                .to_owned();
        let [thrust_n, roll, pitch, yaw] = command;
        for row in 0..50 {
            let time_s = 0.1 * f64::from(row);
            writeln!(text, "{time_s},0,{time_s},0,1,{thrust_n},{roll},{pitch},{yaw}").unwrap();
        }
        DataTable::of_csv(Path::new("data.csv"), text.as_bytes()).unwrap()
    }

    #[test]
    fn thrust_and_attitude_become_a_vector_of_thrust() {
        let robots = read(&flown([10.0, 0.0, 0.3, 0.0])).unwrap();
        assert_eq!(robots.commands, CommandKind::Thrust);
        assert!(robots.is_spatial);
        let [east, north, up] = robots.samples[0].command;
        assert!((east - 10.0 * libm::sin(0.3)).abs() < 1e-12 && north == 0.0);
        assert!((up - 10.0 * libm::cos(0.3)).abs() < 1e-12);
        assert!(robots.covariates.is_empty());
    }

    #[test]
    fn thrusts_that_cannot_be_are_refused_with_their_range() {
        let refused = read(&flown([-1.0, 0.0, 0.0, 0.0])).unwrap_err();
        assert!(refused.contains("cmd_thrust_n is not from 0 to 1000000"), "{refused}");
        assert!(read(&flown([1e6, 0.0, 0.0, 0.0])).is_ok());
        for angles in [[4.0, 0.0, 0.0], [0.0, -10.0, 0.0], [0.0, 0.0, 90.0]] {
            let [roll, pitch, yaw] = angles;
            let refused = read(&flown([10.0, roll, pitch, yaw])).unwrap_err();
            assert!(refused.contains("must be in rad, not degrees"), "{refused}");
        }
        assert!(read(&flown([10.0, 3.1, -3.1, 40.0])).is_ok());
    }

    #[test]
    fn accelerations_that_include_gravity_are_warned_of() {
        let warned = |vertical_mps2: f64| {
            let mut text =
                "time_s,agent,x_m,y_m,z_m,cmd_ax_mps2,cmd_ay_mps2,cmd_az_mps2\n".to_owned();
            for row in 0..50 {
                let time_s = 0.1 * f64::from(row);
                writeln!(text, "{time_s},0,{time_s},0,1,0.1,0,{vertical_mps2}").unwrap();
            }
            let table = DataTable::of_csv(Path::new("data.csv"), text.as_bytes()).unwrap();
            let robots = read(&table).unwrap();
            assert_eq!(robots.commands, CommandKind::Acceleration);
            robots.warnings.iter().any(|warning| warning.contains("includes gravity"))
        };
        assert!(warned(9.8) && warned(-9.8) && !warned(0.0) && !warned(7.8));
    }

    #[test]
    fn of_several_commands_those_of_velocity_are_used_and_the_others_are_no_covariates() {
        let mut text =
            "time_s,agent,x_m,y_m,cmd_vx_mps,cmd_vy_mps,cmd_ax_mps2,cmd_ay_mps2\n".to_owned();
        for row in 0..50 {
            let time_s = 0.1 * f64::from(row);
            writeln!(text, "{time_s},0,{time_s},0,1,0,{row},2").unwrap();
        }
        let table = DataTable::of_csv(Path::new("data.csv"), text.as_bytes()).unwrap();
        let robots = read(&table).unwrap();
        assert_eq!(robots.commands, CommandKind::Velocity);
        assert!(robots.covariates.is_empty(), "{:?}", robots.covariates);
        let warnings = robots.warnings.join("\n");
        assert!(warnings.contains("velocities and of accelerations"), "{warnings}");
    }
}
