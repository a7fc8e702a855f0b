//! Robot samples: where robots were measured, and what they were commanded to do.

mod commands;
mod warnings;

pub use commands::CommandKind;

use super::ranges::RangeCheck;
use super::table::{CELL_BYTES, DataTable, covariates};
use super::time_of_day;
use super::warnings::rejection_warnings;
use super::{Rejected, Rejections, TWICE, first_rejection, to_u32};
use numbers::power::square;
use numbers::statistics::median_high;
use robotsim::dynamics::{Drive, Shape};
use std::collections::BTreeMap;
use std::ops::Range;

/// Measurements of robots: positions and commands over time.
#[derive(Clone, Debug)]
pub struct RobotSamples {
    /// What could be used: by campaign, robot and time.
    pub samples: Vec<RobotSample>,
    /// One robot in one campaign each.
    pub tracks: Vec<Range<usize>>,
    /// Every other numeric column that says anything: a value per sample, NaN where it is missing.
    pub covariates: Vec<(String, Vec<f64>)>,
    /// How the robots were commanded.
    pub commands: CommandKind,
    /// What bodies of the simulator are so commanded.
    pub shape: Shape,
    /// Whether positions or commands leave the plane.
    pub is_spatial: bool,
    /// What could not be used.
    pub rejected: Vec<Rejected>,
    /// What was seen in the file, and what it does to an answer.
    pub warnings: Vec<String>,
    /// Number of rows in the file, used or not.
    pub n_rows: usize,
}

/// A row: a robot at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotSample {
    /// Line of the file that the row stands on, for messages.
    pub line: usize,
    /// Number of the campaign that it belongs to; time starts anew in each.
    pub run: u32,
    /// Number of the robot.
    pub agent: u32,
    /// From the start of the campaign (s).
    pub time_s: f64,
    /// Measured position (m).
    pub position_m: [f64; 3],
    /// Measured heading (rad), of commands of thrust and attitude else the commanded yaw; NaN where unknown.
    pub heading_rad: f64,
    /// Command in force from now on; of commands of thrust and attitude the thrust as a vector (N, east, north, up).
    pub command: Drive,
}

/// Columns with a meaning of their own, which are no covariates.
pub const KNOWN: [&str; 21] = [
    "time_s",
    time_of_day::START,
    "agent",
    "run",
    "x_m",
    "y_m",
    "z_m",
    "heading_rad",
    "cmd_vx_mps",
    "cmd_vy_mps",
    "cmd_vz_mps",
    "cmd_speed_mps",
    "cmd_yaw_rate_radps",
    "cmd_steer_rad",
    "cmd_ax_mps2",
    "cmd_ay_mps2",
    "cmd_az_mps2",
    "cmd_thrust_n",
    "cmd_roll_rad",
    "cmd_pitch_rad",
    "cmd_yaw_rad",
];
/// Fewer usable rows carry nothing.
const FEWEST_ROWS: usize = 20;

/// Reads robot samples.
///
/// # Errors
///
/// What makes the whole file useless, in words for its author.
pub fn read(table: &DataTable) -> Result<RobotSamples, String> {
    let commands =
        CommandKind::of_table(table).map_err(|lacking| table.lacking("robot samples", &lacking))?;
    // Once as they stand and once in order, beside the covariates.
    let n_numbers = table.names().len() + 4;
    table.check_memory(2 * size_of::<RobotSample>() + CELL_BYTES * n_numbers, "robots")?;
    let shape = commands.shape();
    let cell = |name: &str, row: usize| table.column(name).map_or(f64::NAN, |column| column[row]);
    let mut warnings = commands.check(table)?;

    let mut ranges = RangeCheck::new(table, &[]);
    let mut rejections = Rejections::default();
    let mut kept: Vec<(RobotSample, usize)> = Vec::with_capacity(table.n_rows());
    for row in 0..table.n_rows() {
        let line = table.line(row);
        if let Some(reason) = ranges.refusal(row, line) {
            rejections.add(&reason, line);
            continue;
        }
        let required = ["time_s", "agent", "x_m", "y_m"].iter().chain(commands.columns());
        let missing = required
            .chain(if shape.is_turning() { &["heading_rad"][..] } else { &[] })
            .find(|name| cell(name, row).is_nan());
        if let Some(name) = missing {
            rejections.add(&format!("{name} is missing"), line);
            continue;
        }
        let (Some(agent), Some(run)) =
            (to_u32(cell("agent", row)), to_u32(or_zero(cell("run", row))))
        else {
            rejections.add("agent or run is not a whole number", line);
            continue;
        };
        if let Some(reason) = commands.refusal(|name| cell(name, row)) {
            rejections.add(&reason, line);
            continue;
        }
        let sample = RobotSample {
            line,
            run,
            agent,
            time_s: cell("time_s", row),
            position_m: [cell("x_m", row), cell("y_m", row), or_zero(cell("z_m", row))],
            heading_rad: commands.heading_rad(|name| cell(name, row)),
            command: commands.command(|name| cell(name, row)),
        };
        kept.push((sample, row));
    }
    warnings.extend(ranges.warnings());
    warnings.extend(backwards(&kept));
    // Of equal times the first in the file.
    kept.sort_by(|(a, _), (b, _)| {
        (a.run, a.agent).cmp(&(b.run, b.agent)).then(a.time_s.total_cmp(&b.time_s))
    });
    let mut unique: Vec<(RobotSample, usize)> = Vec::with_capacity(kept.len());
    let mut twice = Vec::new();
    for (sample, row) in kept {
        match unique.last() {
            Some((last, _)) if is_same_moment(last, &sample) => {
                let is_equal = last.position_m == sample.position_m
                    && last.command == sample.command
                    && last.heading_rad.total_cmp(&sample.heading_rad).is_eq();
                twice.push((sample.line, is_equal));
            }
            _ => unique.push((sample, row)),
        }
    }
    twice.sort_unstable();
    for (line, is_equal) in twice {
        let reason = if is_equal { TWICE } else { "another row has the same robot and time" };
        rejections.add(reason, line);
    }
    let (samples, rows): (Vec<RobotSample>, Vec<usize>) = unique.into_iter().unzip();
    if samples.len() < FEWEST_ROWS {
        return Err(format!(
            "only {} of {} rows are usable, too few to fit a model{}",
            samples.len(),
            table.n_rows(),
            first_rejection(&rejections.into_list())
        ));
    }
    let mut tracks: Vec<Range<usize>> = Vec::new();
    for (index, sample) in samples.iter().enumerate() {
        match tracks.last_mut() {
            Some(track) if is_same_robot(&samples[track.start], sample) => track.end = index + 1,
            _ => tracks.push(index..index + 1),
        }
    }
    let mut robots = RobotSamples {
        is_spatial: shape == Shape::Velocity
            && samples.iter().any(|sample| {
                sample.position_m[2] != samples[0].position_m[2] || sample.command[2] != 0.0
            }),
        samples,
        tracks,
        covariates: covariates(table, &KNOWN, &rows, &mut warnings, |_| None),
        commands,
        shape,
        rejected: rejections.into_list(),
        warnings,
        n_rows: table.n_rows(),
    };
    robots.warnings.extend(rejection_warnings(&robots.rejected, robots.n_rows));
    robots.warnings.extend(warnings::track_warnings(&robots));
    robots.check_units()?;
    Ok(robots)
}

impl RobotSamples {
    /// Time between samples (s): the median.
    #[must_use]
    pub fn spacing_s(&self) -> f64 {
        let mut steps: Vec<f64> =
            self.steps().map(|(a, b)| b.time_s - a.time_s).filter(|step| 0.0 < *step).collect();
        steps.sort_by(f64::total_cmp);
        median_high(&steps)
    }

    /// Neighbouring samples of one track.
    fn steps(&self) -> impl Iterator<Item = (&RobotSample, &RobotSample)> {
        self.tracks.iter().flat_map(|track| {
            self.samples[track.clone()].windows(2).map(|pair| (&pair[0], &pair[1]))
        })
    }

    /// Refuses, or warns of, numbers that look like another unit.
    fn check_units(&mut self) -> Result<(), String> {
        let spacing_s = self.spacing_s();
        let whole = self.samples.iter().all(|sample| sample.time_s.fract() == 0.0);
        if 5.0 <= spacing_s && whole {
            return Err(format!(
                "samples of one robot are {spacing_s} s apart, in whole numbers; time_s must be in seconds, so check \
                 whether it is in milliseconds"
            ));
        }
        if self.shape.is_turning() {
            self.check_headings()?;
        }
        let speed = |command: Drive| {
            if self.shape.is_turning() {
                command[0].abs()
            } else {
                command.iter().map(|part| part * part).sum::<f64>().sqrt()
            }
        };
        let (mut way_m, mut commanded_m) = (0.0, 0.0);
        for (a, b) in self.steps() {
            commanded_m += speed(a.command) * (b.time_s - a.time_s);
        }
        for track in &self.tracks {
            // From end to end of short stretches, so that noise does not add up to a way.
            let stride = ((1.0 / spacing_s).round() as usize).max(1);
            let places: Vec<&RobotSample> =
                self.samples[track.clone()].iter().step_by(stride).collect();
            for pair in places.windows(2) {
                way_m += distance_m(pair[0], pair[1]);
            }
        }
        if way_m == 0.0 {
            return Err("no robot ever moves: x_m and y_m are constant".to_owned());
        }
        if self.commands.is_inertial() {
            // How far a robot goes under accelerations depends on how fast it is.
        } else if commanded_m == 0.0 {
            self.warnings.push(
                "no robot is ever commanded to move; only effects that move robots without a command (such as wind) can be \
                 found"
                    .to_owned(),
            );
        } else if !(0.02..=50.0).contains(&(way_m / commanded_m)) {
            self.warnings.push(format!(
                "robots moved {way_m:.3} m, but {commanded_m:.3} m were commanded. Check that positions are in m and \
                 commands in m/s; a wrong unit would be reported as slip"
            ));
        }
        let first = self.samples[0].command;
        if self.samples.iter().all(|sample| sample.command == first) {
            self.warnings.push(
                "the command never changes, so effects after a change (lag, dead time, acceleration limits) cannot be tested"
                    .to_owned(),
            );
        }
        Ok(())
    }

    /// Refuses headings in degrees: as degrees they agree with the direction of motion, as radians they do not.
    fn check_headings(&self) -> Result<(), String> {
        let greatest =
            self.samples.iter().fold(0.0f64, |m, sample| m.max(sample.heading_rad.abs()));
        if greatest <= 6.4 {
            return Ok(());
        }
        let (mut as_rad, mut as_degrees) = (0.0, 0.0);
        for (a, b) in self.steps() {
            let sign = if a.command[0] < 0.0 { -1.0 } else { 1.0 };
            let [dx, dy] = [0, 1].map(|i| sign * (b.position_m[i] - a.position_m[i]));
            let along = |heading: f64| dx * libm::cos(heading) + dy * libm::sin(heading);
            as_rad += along(a.heading_rad);
            as_degrees += along(a.heading_rad.to_radians());
        }
        if as_rad < as_degrees {
            return Err(format!(
                "heading_rad reaches {greatest} and matches the direction of motion only if read as degrees; headings must \
                 be in rad"
            ));
        }
        Ok(())
    }
}

fn is_same_robot(a: &RobotSample, b: &RobotSample) -> bool {
    (a.run, a.agent) == (b.run, b.agent)
}

fn is_same_moment(a: &RobotSample, b: &RobotSample) -> bool {
    is_same_robot(a, b) && a.time_s.total_cmp(&b.time_s).is_eq()
}

fn distance_m(a: &RobotSample, b: &RobotSample) -> f64 {
    (0..3).map(|i| square(a.position_m[i] - b.position_m[i])).sum::<f64>().sqrt()
}

fn or_zero(number: f64) -> f64 {
    if number.is_nan() { 0.0 } else { number }
}

/// A warning where the time of a robot runs backwards in the file.
fn backwards(kept: &[(RobotSample, usize)]) -> Option<String> {
    let mut latest: BTreeMap<(u32, u32), f64> = BTreeMap::new();
    let mut lines = Vec::new();
    for (sample, _) in kept {
        let last = latest.entry((sample.run, sample.agent)).or_insert(sample.time_s);
        if sample.time_s < *last {
            lines.push(sample.line);
        }
        *last = sample.time_s;
    }
    let first = lines.first()?;
    Some(format!(
        "time_s of a robot decreases in {} places, first on line {first}. Rows are sorted by time; if the file holds \
         several campaigns, number them in a column run",
        lines.len()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write as _;
    use std::path::Path;

    fn table(text: &str) -> DataTable {
        DataTable::of_csv(Path::new("data.csv"), text.as_bytes()).unwrap()
    }

    /// A robot that goes east at 1 m/s, with changes to its rows.
    fn east(change: impl Fn(usize, &mut [f64; 6])) -> String {
        let mut text = "time_s,agent,x_m,y_m,cmd_vx_mps,cmd_vy_mps\n".to_owned();
        for row in 0..50 {
            let time = row as f64 * 0.1;
            let mut fields = [time, 0.0, time, 0.0, 1.0, 0.0];
            change(row, &mut fields);
            writeln!(text, "{}", fields.map(|f| f.to_string()).join(",")).unwrap();
        }
        text
    }

    #[test]
    fn rows_become_tracks_in_order_of_time() {
        // Two robots in turns.
        let text = east(|row, fields| {
            fields[1] = (row % 2) as f64;
        });
        let robots = read(&table(&text)).unwrap();
        assert_eq!(robots.tracks, [0..25, 25..50]);
        assert_eq!(robots.shape, Shape::Velocity);
        assert!((robots.spacing_s() - 0.2).abs() < 1e-12);
        assert!(!robots.is_spatial);
        assert_eq!(robots.samples[25].line, 3);
    }

    #[test]
    fn what_cannot_be_used_is_counted_by_reason_with_its_line() {
        let text = east(|row, fields| match row {
            3 => fields[2] = f64::NAN,
            5 => fields[1] = 0.5,
            7 => *fields = [6.0 * 0.1, 0.0, 6.0 * 0.1, 0.0, 1.0, 0.0],
            8 => *fields = [6.0 * 0.1, 0.0, 9.0, 0.0, 1.0, 0.0],
            _ => {}
        });
        let robots = read(&table(&text)).unwrap();
        let reasons: Vec<(&str, usize, usize)> = robots
            .rejected
            .iter()
            .map(|rejected| (&*rejected.reason, rejected.rows, rejected.first_line))
            .collect();
        assert_eq!(
            reasons,
            [
                ("x_m is not a finite number", 1, 5),
                ("agent or run is not a whole number", 1, 7),
                ("duplicate of an earlier row", 1, 9),
                ("another row has the same robot and time", 1, 10),
            ]
        );
        assert_eq!(robots.samples.len() + 4, robots.n_rows);
    }

    #[test]
    fn files_that_cannot_carry_an_answer_are_refused() {
        let lacking = read(&table("time_s,agent,x_m\n0,0,0\n")).unwrap_err();
        assert!(lacking.contains("y_m") && lacking.contains("cmd_vx_mps"), "{lacking}");
        let few = read(&table("time_s,agent,x_m,y_m,cmd_vx_mps,cmd_vy_mps\n0,0,0,0,1,0\n"));
        assert!(few.unwrap_err().contains("too few"));
        let still = read(&table(&east(|_, fields| fields[2] = 4.0))).unwrap_err();
        assert!(still.contains("no robot ever moves"), "{still}");
        let late = read(&table(&east(|row, fields| fields[0] = row as f64 * 100.0))).unwrap_err();
        assert!(late.contains("milliseconds"), "{late}");
    }

    #[test]
    fn degrees_are_refused() {
        let mut text = "time_s,agent,x_m,y_m,heading_rad,cmd_speed_mps,cmd_steer_rad\n".to_owned();
        for row in 0..50 {
            // North-east.
            let time = f64::from(row) * 0.1;
            writeln!(text, "{time},0,{time},{time},45,1.414,0").unwrap();
        }
        let error = read(&table(&text)).unwrap_err();
        assert!(error.contains("degrees"), "{error}");
        let error = read(&table(&text.replace(",45,1.414,0", ",0.7854,1.414,20"))).unwrap_err();
        assert!(error.contains("cmd_steer_rad reaches 20"), "{error}");
        assert!(read(&table(&text.replace(",45,", ",0.7854,"))).is_ok());
    }

    #[test]
    fn what_is_odd_is_warned_of() {
        let text = east(|row, fields| {
            if row == 9 {
                fields[0] = 0.05;
            }
        });
        let warnings = read(&table(&text)).unwrap().warnings.join("\n");
        assert!(warnings.contains("decreases in 1 places, first on line 11"), "{warnings}");
        assert!(warnings.contains("the command never changes"), "{warnings}");
        let far = read(&table(&east(|_, fields| fields[2] *= 1000.0))).unwrap();
        assert!(far.warnings.join("\n").contains("slip"), "{:?}", far.warnings);
    }
}
