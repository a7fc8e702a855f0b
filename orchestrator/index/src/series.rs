//! What changed during a run: a point for each of a few hundred steps, from `steps.parquet`; of a run that lasts from its recording.

use crate::read::unbelieved;
use crate::unfinished::RECORDING;
use input::result::{ResultError, ResultFolder};
use metrics::counts::Counts;
use numbers::format::{count, rounded};
use parquet::record::{Field, Row};
use record::StepRecord;
use record::leftover::Leftover;
use record::run_summary::RunSummary;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// A series that runs have.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct SeriesKind {
    /// Its name in calls.
    pub(crate) name: &'static str,
    /// What it is.
    pub(crate) label: &'static str,
    /// Its unit; `%` of a share from 0 to 1, empty of a number without a unit.
    pub(crate) unit: &'static str,
}

const N_SERIES: usize = 5;

/// All of them.
pub(crate) const SERIES: [SeriesKind; N_SERIES] = [
    SeriesKind { name: "flock_speed", label: "speed of the flock", unit: "m/s" },
    SeriesKind { name: "speed", label: "mean speed of the robots", unit: "m/s" },
    SeriesKind { name: "spread", label: "r.m.s. distance from the centre", unit: "m" },
    SeriesKind { name: "neighbours", label: "neighbours heard, mean", unit: "" },
    SeriesKind { name: "isolation", label: "robots that hear nobody", unit: "%" },
];

/// Most points of a series.
pub(crate) const MOST_POINTS: u64 = 600;
/// A table with more rows is not read for them.
const MOST_ROWS: u64 = 4_000_000;
/// The recording of a run that lasts is not read for them if it has more bytes.
const MOST_RECORDING_BYTES: u64 = 64 << 20;
/// Times that differ by less are the same (s).
const SAME_TIME_S: f64 = 1e-6;
/// Digits that are kept of a value.
const DIGITS: usize = 5;

const COLUMNS: [&str; 9] =
    ["step", "time_ns", "alive", "x_m", "y_m", "vx_mps", "vy_mps", "vz_mps", "n_heard"];

/// The series of a run, at the same times.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct RunSeries {
    /// Simulated time (s).
    pub(crate) time_s: Vec<f64>,
    /// Values by the name of the series; null where there is none.
    pub(crate) values: BTreeMap<&'static str, Vec<Option<f64>>>,
    /// When the robots started (s); null if they have not.
    pub(crate) robots_started_s: Option<f64>,
    /// Mean of each series over the time from then on; null where there is no value.
    pub(crate) means: BTreeMap<&'static str, Option<f64>>,
}

/// Why there is no series: what that says of the status of the run, if anything, and words.
pub(crate) type NoSeries = (Option<&'static str>, String);

impl RunSeries {
    /// At most so many points: each is the mean of as many that follow each other, at the time of the first of them.
    pub(crate) fn thinned(&self, n_points: usize) -> Self {
        let every = self.time_s.len().div_ceil(n_points.max(1)).max(1);
        let mean = |values: &[Option<f64>]| {
            let known: Vec<f64> = values.iter().copied().flatten().collect();
            let n = known.len() as f64;
            (0.0 < n).then(|| rounded(known.iter().sum::<f64>() / n, DIGITS))
        };
        let thinned = |values: &[Option<f64>]| values.chunks(every).map(mean).collect();
        Self {
            time_s: self.time_s.iter().copied().step_by(every).collect(),
            values: self.values.iter().map(|(name, values)| (*name, thinned(values))).collect(),
            robots_started_s: self.robots_started_s,
            means: self.means.clone(),
        }
    }

    /// Adds what a step came to.
    fn add(&mut self, sums: &Sums) {
        if sums.n == 0.0 {
            return;
        }
        self.time_s.push(rounded(sums.time_ns / 1e9, 9));
        for (kind, value) in SERIES.iter().zip(sums.values()) {
            self.values.entry(kind.name).or_default().push(value);
        }
    }

    /// Computes the means. The robots start at the end of a step, so that step is not theirs.
    fn with_means(mut self, robots_started_s: Option<f64>) -> Self {
        self.robots_started_s = robots_started_s;
        let from = robots_started_s.map_or(0, |started| {
            self.time_s.partition_point(|&time_s| time_s <= started + SAME_TIME_S)
        });
        let mean = |values: &[Option<f64>]| {
            let known: Vec<f64> = values.iter().skip(from).copied().flatten().collect();
            let n = known.len() as f64;
            (0.0 < n).then(|| rounded(known.iter().sum::<f64>() / n, DIGITS))
        };
        self.means = self.values.iter().map(|(name, values)| (*name, mean(values))).collect();
        self
    }
}

/// The series of a run that is being recorded, or was killed, as far as its recording goes.
///
/// # Errors
///
/// The recording is too long, or has no step yet.
pub(crate) fn unfinished(path: &Path) -> Result<RunSeries, NoSeries> {
    let length = std::fs::metadata(path.join(RECORDING)).map_or(0, |file| file.len());
    if MOST_RECORDING_BYTES < length {
        let most = MOST_RECORDING_BYTES >> 20;
        return Err((
            None,
            format!("its recording has more than {most} MiB; it is drawn when the run has ended"),
        ));
    }
    let none = || (None, "no step has been recorded yet".to_owned());
    let mut leftover = Leftover::open(path).map_err(|error| (None, error.to_string()))?;
    leftover.configured().map_err(|_| none())?;
    let mut steps = Vec::new();
    let (mut steps_before, mut robots_started_s) = (0, Some(0.0));
    while let Some(step) = leftover.next_step() {
        if step.robots.held {
            (steps_before, robots_started_s) = (step.step, Some(step.time_ns as f64 / 1e9));
        }
        steps.push((step.step, sums_of(&step)));
    }
    let sampling = Sampling::new(steps.len() as u64, steps_before);
    let mut series = RunSeries::default();
    let mut latest = None;
    for (step, sums) in &steps {
        if latest != Some(sampling.point(*step)) {
            latest = Some(sampling.point(*step));
            series.add(sums);
        }
    }
    if series.time_s.is_empty() { Err(none()) } else { Ok(series.with_means(robots_started_s)) }
}

/// The same sums of a recorded step as of its rows in `steps.parquet`.
fn sums_of(step: &StepRecord) -> Sums {
    let states = &step.robots.states;
    let counts = Counts::from_deliveries(&step.network.deliveries, states.len());
    let mut sums = Sums { time_ns: step.time_ns as f64, ..Sums::default() };
    let of = |column: &[f64], agent: usize| column.get(agent).copied().unwrap_or(f64::NAN);
    for (agent, &n_heard) in counts.neighbours.iter().enumerate() {
        if states.alive.get(agent) {
            let [x_m, y_m, _] = states.position_m(agent);
            let [vx, vy, vz] =
                [&states.vx_mps, &states.vy_mps, &states.vz_mps].map(|column| of(column, agent));
            sums.add([x_m, y_m, vx, vy, vz, f64::from(n_heard)]);
        }
    }
    sums
}

/// Sums over the robots that are alive at a step.
#[derive(Default)]
struct Sums {
    time_ns: f64,
    n: f64,
    velocity_mps: [f64; 2],
    speed_mps: f64,
    /// Where the first robot is (m): sums of places are from there on, so that a swarm that is far away loses no digits.
    origin_m: [f64; 2],
    place_m: [f64; 2],
    place_m2: f64,
    heard: f64,
    n_heard: f64,
    isolated: f64,
}

impl Sums {
    fn add(&mut self, [x, y, vx, vy, vz, heard]: [f64; 6]) {
        if self.n == 0.0 {
            self.origin_m = [x, y];
        }
        let [vx, vy, vz] = [vx, vy, vz].map(|speed| if speed.is_finite() { speed } else { 0.0 });
        let [x, y] = [x - self.origin_m[0], y - self.origin_m[1]];
        self.n += 1.0;
        self.velocity_mps = [self.velocity_mps[0] + vx, self.velocity_mps[1] + vy];
        self.speed_mps += libm::sqrt(vx * vx + vy * vy + vz * vz);
        self.place_m = [self.place_m[0] + x, self.place_m[1] + y];
        self.place_m2 += x * x + y * y;
        if heard.is_finite() {
            self.heard += heard;
            self.n_heard += 1.0;
            self.isolated += f64::from(u8::from(heard == 0.0));
        }
    }

    /// The values in the order of [`SERIES`].
    fn values(&self) -> [Option<f64>; N_SERIES] {
        let mean = |sum: f64| sum / self.n;
        let [x, y] = self.place_m.map(mean);
        let spread_m2 = (mean(self.place_m2) - x * x - y * y).max(0.0);
        let of_heard = |sum: f64| (0.0 < self.n_heard).then(|| sum / self.n_heard);
        [
            Some(libm::hypot(self.velocity_mps[0], self.velocity_mps[1]) / self.n),
            Some(mean(self.speed_mps)),
            Some(libm::sqrt(spread_m2)),
            of_heard(self.heard),
            of_heard(self.isolated),
        ]
        .map(|value| value.filter(|value| value.is_finite()).map(|value| rounded(value, DIGITS)))
    }
}

/// Which steps share a point. A network may form for much longer than robots move, so the time before they start has few of the points.
struct Sampling {
    /// Steps before the robots start.
    steps_before: u64,
    every_before: u64,
    every: u64,
}

impl Sampling {
    fn new(n_steps: u64, steps_before: u64) -> Self {
        let steps_before = steps_before.min(n_steps);
        let points_before = if steps_before == 0 { 0 } else { MOST_POINTS / 6 };
        let every = |n_steps: u64, n_points: u64| n_steps.div_ceil(n_points.max(1)).max(1);
        Self {
            steps_before,
            every_before: every(steps_before, points_before),
            every: every(n_steps - steps_before, MOST_POINTS - points_before),
        }
    }

    /// The point of a step, which is at least 1: whether the robots have started, and its number.
    fn point(&self, step: u64) -> (bool, u64) {
        if step <= self.steps_before {
            (false, step.saturating_sub(1) / self.every_before)
        } else {
            (true, (step - self.steps_before - 1) / self.every)
        }
    }
}

/// Why a table is not read to its end.
enum Stop {
    Result(ResultError),
    TooLong,
}

impl From<ResultError> for Stop {
    fn from(error: ResultError) -> Self {
        Self::Result(error)
    }
}

/// The series of a run.
///
/// # Errors
///
/// Its table was changed, is damaged or too long, or no robot is in it.
pub(crate) fn series(folder: &ResultFolder, summary: &RunSummary) -> Result<RunSeries, NoSeries> {
    let steps_before = summary.robots_started_s.map_or(0.0, |started| started * 1e9)
        / summary.step_ns.max(1) as f64;
    let sampling = Sampling::new(summary.steps, libm::round(steps_before) as u64);
    let mut series = RunSeries::default();
    let mut n_rows = 0;
    let mut step = 0;
    let mut sums = Sums::default();
    let table = folder.table("steps.parquet").map_err(|error| no_series(&error))?;
    let read = table.each_row_with(&COLUMNS, |row| {
        n_rows += 1;
        if MOST_ROWS < n_rows {
            return Err(Stop::TooLong);
        }
        let [row_step, time_ns, alive, rest @ ..] = numbers_of(row);
        let row_step = row_step as u64;
        // Of several steps the first that is recorded stands for all. Step 0 is before anything was sent.
        let is_of_same_point = || sampling.point(row_step) == sampling.point(step);
        if row_step == 0 || step != 0 && row_step != step && is_of_same_point() {
            return Ok(());
        }
        if row_step != step {
            series.add(&sums);
            sums = Sums { time_ns, ..Sums::default() };
            step = row_step;
        }
        if alive == 1.0 {
            sums.add(rest);
        }
        Ok(())
    });
    series.add(&sums);
    match read {
        Err(Stop::Result(error)) => Err(no_series(&error)),
        Err(Stop::TooLong) => {
            let words = format!(
                "steps.parquet has more than {} rows; `murmuration figure` draws its series",
                count(MOST_ROWS)
            );
            Err((None, words))
        }
        Ok(()) if series.time_s.is_empty() => {
            Err((None, "steps.parquet has no step with a robot".to_owned()))
        }
        Ok(()) => Ok(series.with_means(summary.robots_started_s)),
    }
}

fn no_series(error: &ResultError) -> NoSeries {
    let (status, words) = unbelieved(error);
    (Some(status), words)
}

/// The numbers of a row in the order of [`COLUMNS`]; of a null NaN.
fn numbers_of(row: &Row) -> [f64; COLUMNS.len()] {
    let mut numbers = [f64::NAN; COLUMNS.len()];
    for (name, field) in row.get_column_iter() {
        let Some(at) = COLUMNS.iter().position(|column| column == name) else { continue };
        numbers[at] = match field {
            Field::Bool(is) => f64::from(u8::from(*is)),
            Field::UInt(number) => f64::from(*number),
            Field::ULong(number) => *number as f64,
            Field::Int(number) => f64::from(*number),
            Field::Long(number) => *number as f64,
            Field::Float(number) => f64::from(*number),
            Field::Double(number) => *number,
            _ => f64::NAN,
        };
    }
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_values_of_a_step_are_those_of_its_robots() {
        let mut sums = Sums::default();
        // Two robots 6 m apart, far from the origin: one stands still and hears nobody.
        sums.add([1e6, 5.0, 3.0, 4.0, 0.0, 1.0]);
        sums.add([1e6 + 6.0, 5.0, 0.0, 0.0, f64::NAN, 0.0]);
        let expected = [Some(2.5), Some(2.5), Some(3.0), Some(0.5), Some(0.5)];
        assert_eq!(sums.values(), expected);
    }

    #[test]
    fn robots_that_start_late_have_most_of_the_points() {
        let points = |n_steps: u64, before: u64| {
            let sampling = Sampling::new(n_steps, before);
            let points: std::collections::BTreeSet<_> =
                (1..=n_steps).map(|step| sampling.point(step)).collect();
            let n_before = points.iter().filter(|(has_started, _)| !has_started).count();
            (n_before, points.len() - n_before)
        };
        assert_eq!(points(600, 0), (0, 600));
        assert_eq!(points(601, 0), (0, 301));
        assert_eq!(points(4410, 4210), (98, 200));
        assert_eq!(points(10, 10), (10, 0));
    }

    #[test]
    fn a_point_of_a_thinned_series_is_a_mean() {
        let time_s: Vec<f64> = (0..10).map(f64::from).collect();
        let values = time_s.iter().map(|&time_s| (time_s != 9.0).then_some(time_s % 2.0));
        let values = BTreeMap::from([("speed", values.collect())]);
        let series = RunSeries { time_s, values, ..RunSeries::default() };
        let mean = |started| series.clone().with_means(started).means["speed"];
        assert_eq!(mean(None), Some(rounded(4.0 / 9.0, DIGITS)));
        assert_eq!(mean(Some(6.0)), Some(0.5));
        assert_eq!(mean(Some(8.5)), None);
        assert_eq!(series.thinned(10), series);
        let thinned = series.thinned(3);
        assert_eq!(thinned.time_s, [0.0, 4.0, 8.0]);
        assert_eq!(thinned.values["speed"], [Some(0.5), Some(0.5), Some(0.0)]);
    }
}
